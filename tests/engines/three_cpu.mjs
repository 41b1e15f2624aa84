// World positions of every vertex at the given times of the first animation, by three.js.
// three.js uses JOINTS_0 and WEIGHTS_0 only, scaled to sum to 1.

import {eachJob, writePositions} from './jobs.mjs';
import {THREE, load, worldPositions} from './three_scene.mjs';

await eachJob(async ({glb, out, times}) => {
  const {scene, animations, meshes} = await load(glb);
  const mixer = new THREE.AnimationMixer(scene);
  const action = animations.length ? mixer.clipAction(animations[0]) : null;
  action?.setLoop(THREE.LoopOnce, 1).play();
  if (action) action.clampWhenFinished = true;
  const positions = [];
  for (const time of times) {
    action?.reset();
    mixer.setTime(time);
    for (const value of worldPositions(scene, meshes)) positions.push(value);
  }
  writePositions(out, positions);
});
