// Microseconds of one evaluation, and of one update, along the first clip of a file: `node bench.mjs a.glb`.
// Figures to report; no test waits for them.

import {inBabylon, inThree} from './engines.mjs';

const POSES = 120, BATCH = 20, BATCHES = 500;

const [three, babylon] = [await inThree(process.argv[2]), await inBabylon(process.argv[2])];
const {drivers: [{evaluator, joints}], gltf, THREE} = three, mixer = new THREE.AnimationMixer(gltf.scene);
mixer.clipAction(gltf.animations[0]).play();
const poses = Array.from({length: POSES}, (_, i) => {
  mixer.setTime(gltf.animations[0].duration * i / POSES);
  return Float64Array.from(joints.flatMap(joint => joint.quaternion.toArray()));
});
const upright = Float64Array.of(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1);
report('evaluate', i => evaluator.evaluate(upright, poses[i % POSES]));
report('update in three.js', i => { three.pose(poses[i % POSES]); three.drivers[0].update(); });
report('update in Babylon.js', i => { babylon.pose(poses[i % POSES]); babylon.drivers[0].update(); });
process.exit(0); // Babylon's timers would keep it alive

function report(name, work) {
  for (let i = 0; i < 5000; i++) work(i);
  const times = Array.from({length: BATCHES}, (_, batch) => {
    const start = performance.now();
    for (let i = 0; i < BATCH; i++) work(batch * BATCH + i);
    return (performance.now() - start) / BATCH * 1000;
  }).sort((a, b) => a - b);
  const at = share => times[Math.floor(share * BATCHES)].toFixed(1);
  console.log(`${name}: median ${at(0.5)} µs, fastest ${at(0)} µs, 90 % below ${at(0.9)} µs`);
}
