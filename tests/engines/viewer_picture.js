// Sets the viewer's page for docs/viewer.png: a step, driven by the network, with the sliders to be seen.
(async () => {
  const {figure, stage} = window.garmentc;
  const named = (summary, within = document) =>
    [...within.querySelectorAll('details')].find(one => one.firstChild.textContent === summary);
  for (const [summary, open] of [['Show', false], ['Joints', true], ['Morph targets', true], ['Trunk', false], ['Left leg', true]])
    named(summary).open = open;
  named('hip', named('Left leg')).open = true;
  figure.playing = false;
  figure.seek(0.7);
  [...document.querySelectorAll('#poses button')].find(button => button.textContent === 'step').click();
  for (let i = 0; i < 9; i++) figure.update(0.1);
  stage.look(30);
  await new Promise(done => setTimeout(done, 3000)); // software rendering takes a while for a frame
})()
