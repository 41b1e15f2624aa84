// Bytes that one update allocates, when warm: `node --expose-gc allocations.mjs three|babylon a.glb`.

import {inBabylon, inThree} from './engines.mjs';

const UPDATES = 2000;

const [, , engine, glb] = process.argv;
const {drivers: [driver]} = await {three: inThree, babylon: inBabylon}[engine](glb);
const elbow = driver.joints[18].rotationQuaternion ?? driver.joints[18].quaternion;
console.log(allocated(turn => {
  elbow.x = Math.sin(1e-3 * turn);
  elbow.w = Math.cos(1e-3 * turn);
  driver.update(0);
}));
process.exit(0); // Babylon's timers would keep it alive

/** Bytes a call, the least of up to 30 rounds: V8 takes some of them to compile, and keeps house now and then. */
function allocated(work) {
  let least = Infinity;
  for (let round = 0; round < 30 && least > 0.5; round++) {
    gc();
    const before = process.memoryUsage().heapUsed;
    for (let i = 0; i < UPDATES; i++) work(i);
    least = Math.min(least, (process.memoryUsage().heapUsed - before) / UPDATES);
  }
  return least;
}
