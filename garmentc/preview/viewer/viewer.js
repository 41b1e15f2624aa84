// The page: connects the panel, the timeline and the stage.

import {BAKED, BY_HAND, Figure, NETWORK} from 'garmentc/figure';
import {Stage} from 'garmentc/stage';
import {choice, element, slider, toggle} from 'garmentc/controls';

const by = id => document.getElementById(id);
const GROUPS = {
  Trunk: ['pelvis', 'spine1', 'spine2', 'spine3', 'neck', 'head'],
  'Left arm': ['left_collar', 'left_shoulder', 'left_elbow', 'left_wrist', 'left_hand'],
  'Right arm': ['right_collar', 'right_shoulder', 'right_elbow', 'right_wrist', 'right_hand'],
  'Left leg': ['left_hip', 'left_knee', 'left_ankle', 'left_foot'],
  'Right leg': ['right_hip', 'right_knee', 'right_ankle', 'right_foot'],
};
const LINGER = 12; // frames that are drawn after the last touch; a picture that stands still costs nothing
const degrees = radians => radians * 180 / Math.PI, radians = degrees => degrees * Math.PI / 180;

function bytesOf(base64) {
  return Uint8Array.from(atob(base64.trim()), character => character.charCodeAt(0)).buffer;
}

async function start() {
  const content = JSON.parse(by('content').textContent);
  by('name').textContent = content.name;
  const stage = new Stage(by('view'));
  const figure = await Figure.load(bytesOf(by('asset').textContent), content);
  stage.scene.add(figure.scene, figure.skeleton);
  figure.update(0);
  stage.scene.updateMatrixWorld(true);
  stage.frame(figure.scene, figure.lowest - figure.sole);
  by('message').remove();

  const refreshers = [
    display(stage, figure), poses(figure, content), joints(figure, content), morphs(figure, content),
    timeline(figure), facts(content),
  ];
  views(stage);
  const place = figure.bones[0].position.clone();
  let before = performance.now(), awake = LINGER, frame = 0;
  const wake = () => { awake = LINGER; };
  for (const event of ['input', 'click', 'keydown']) document.addEventListener(event, wake);
  stage.controls.addEventListener('change', wake);
  window.addEventListener('resize', wake);
  const tick = now => {
    const seconds = Math.min((now - before) / 1000, 0.1);
    before = now;
    figure.update(seconds);
    if (figure.posed) figure.standOn(stage.ground); // animations know where the floor is
    if (figure.moving || stage.controls.autoRotate) wake();
    if (awake-- <= 0) return requestAnimationFrame(tick);
    stage.follow(figure.bones[0].getWorldPosition(place));
    stage.draw();
    if (!figure.playing || frame++ % 4 === 0) for (const refresh of refreshers) refresh?.(seconds);
    return requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
  window.garmentc = {stage, figure}; // for tests, and for the curious
}

function views(stage) {
  const turns = {front: 0, side: 90, back: 180};
  for (const [name, turn] of Object.entries(turns))
    by('views').append(element('button', {textContent: name, type: 'button', onclick: () => stage.look(turn)}));
}

function display(stage, figure) {
  const show = (objects, shown) => { for (const object of objects) object.visible = shown; };
  const dark = matchMedia('(prefers-color-scheme: dark)').matches;
  const theme = dark => {
    document.documentElement.dataset.theme = dark ? 'dark' : 'light';
    stage.theme = dark;
  };
  theme(dark);
  const outfits = figure.meshes.map(mesh => mesh.material);
  by('display').append(
    toggle('outfit', true, shown => outfits.forEach(material => { material.visible = shown; })),
    ...figure.bodyMeshes.length ? [toggle('body', true, shown => show(figure.bodyMeshes, shown))] : [],
    toggle('wireframe', false, shown => show(figure.wires, shown)),
    toggle('skeleton', false, shown => show([figure.skeleton], shown)),
    toggle('floor', true, shown => show([stage.floor], shown)),
    toggle('turntable', false, turning => { stage.controls.autoRotate = turning; }),
    toggle('dark', dark, theme),
  );
}

function poses(figure, {poses}) {
  for (const [name, pose] of Object.entries(poses))
    by('poses').append(element('button', {textContent: name, type: 'button', onclick: () => figure.goTo(pose)}));
}

function joints(figure, {jointNames}) {
  const rows = [];
  for (const [group, names] of Object.entries(GROUPS)) {
    const inGroup = names.map(name => {
      const joint = jointNames.indexOf(name);
      const change = () => figure.turn(joint, ...sliders.map(one => radians(one.value())));
      const sliders = ['x', 'y', 'z'].map(axis => slider(axis, [-180, 180, 1], value => `${Math.round(value)}°`, change));
      const label = name.replace(/^(left|right)_/, '').replace(/(\d)/, ' $1');
      const details = element('details', {}, element('summary', {textContent: label}), ...sliders.map(one => one.row));
      rows.push({joint, sliders, details});
      return details;
    });
    by('joints').append(element('details', {open: group === 'Trunk'}, element('summary', {textContent: group}), ...inGroup));
  }
  return () => {
    for (const {joint, sliders, details} of rows)
      if (details.open) figure.angles(joint).forEach((angle, axis) => sliders[axis].set(degrees(angle)));
  };
}

function morphs(figure, {weights: [low, high]}) {
  const sources = [...figure.clips.length ? [BAKED] : [], ...figure.drivers.length ? [NETWORK] : [], BY_HAND];
  const source = choice(sources, name => figure.driveBy(name));
  const note = element('p', {className: 'note', textContent: 'Weights set by'});
  by('morphs').append(note, element('div', {className: 'buttons'}, ...source.buttons), element('p', {className: 'note'}));
  const rows = figure.morphed.flatMap(meshes => meshes[0].morphTargetInfluences.map((_, target) => {
    const name = Object.entries(meshes[0].morphTargetDictionary ?? {}).find(([, index]) => index === target)?.[0];
    const change = weight => figure.setMorph(meshes, target, weight);
    const one = slider(name ?? `${target}`, [low, high, 0.01], value => value.toFixed(2), change);
    by('morphs').append(one.row);
    return {one, meshes, target};
  }));
  if (!rows.length) note.textContent = 'The outfit has no morph targets.';
  return () => {
    source.choose(figure.keys);
    if (!by('morphs').parentElement.open) return;
    for (const {one, meshes, target} of rows) one.set(meshes[0].morphTargetInfluences[target]);
  };
}

function timeline(figure) {
  if (!figure.clips.length) return null;
  by('timeline').hidden = false;
  figure.clips.forEach((clip, i) => by('clips').append(element('option', {value: i, textContent: clip.name || `animation ${i}`})));
  by('clips').hidden = figure.clips.length < 2;
  const play = playing => {
    if (playing) figure.play();
    else figure.playing = false;
  };
  by('play').addEventListener('click', () => play(!figure.playing));
  by('clips').addEventListener('change', () => figure.choose(Number(by('clips').value)));
  by('speed').addEventListener('change', () => { figure.speed = Number(by('speed').value); });
  by('time').addEventListener('input', () => {
    figure.playing = false;
    figure.seek(by('time').valueAsNumber);
  });
  addEventListener('keydown', event => {
    if (event.code !== 'Space' || ['BUTTON', 'SELECT', 'SUMMARY'].includes(event.target.tagName)) return;
    event.preventDefault();
    play(!figure.playing);
  });
  play(true);
  return () => {
    by('time').max = figure.duration;
    by('time').value = figure.time;
    by('play').textContent = figure.playing ? '❚❚' : '▶';
    by('clock').value = `${figure.time.toFixed(2)} / ${figure.duration.toFixed(2)} s`;
  };
}

function facts({facts}) {
  const row = (name, value) => element('tr', {}, element('th', {textContent: name}), value);
  for (const [name, value] of facts) by('facts').append(row(name, element('td', {textContent: value})));
  const rate = element('td');
  by('facts').append(row('frames a second', rate));
  let smooth = 1 / 60;
  return seconds => {
    smooth += 0.1 * (seconds - smooth);
    rate.textContent = Math.round(1 / Math.max(smooth, 1e-3));
  };
}

start().catch(error => {
  const message = by('message') ?? document.querySelector('main').appendChild(element('p', {id: 'message'}));
  message.className = 'error';
  message.textContent = `This outfit cannot be shown: ${error.message}`;
  console.error(error);
});
