// The runtime in engines: `node drive.mjs jobs.json` with
// [{"engine": "three", "glb": path, "poses": [[24 × x y z w], ...], "turn": [x, y, z, w], "scale": 1, "out": path}].
// out: [{"joints": names, "weights": of each pose, of each mesh}, ...] for each driver, or {"error": message}.

import fs from 'node:fs';
import {inBabylon, inThree} from './engines.mjs';

const ENGINES = {
  three: inThree,
  babylon: inBabylon,
  babylon_right_handed: glb => inBabylon(glb, {leftHanded: false}),
};

for (const {engine, glb, poses, turn, scale, out} of JSON.parse(fs.readFileSync(process.argv[2], 'utf8'))) {
  const result = await driven(engine, glb, poses, turn, scale).catch(error => ({error: error.message}));
  fs.writeFileSync(out, JSON.stringify(result));
}
process.exit(0); // Babylon's timers would keep it alive

async function driven(engine, glb, poses, turn, scale) {
  const loaded = await ENGINES[engine](glb);
  if (turn) loaded.turn(turn, scale);
  return loaded.drivers.map(driver => ({
    joints: driver.joints.map(joint => joint.name),
    weights: poses.map(pose => {
      loaded.pose(pose, driver.joints);
      loaded.leave(0.5, driver); // what an animation has left
      driver.update(1 / 30);
      return loaded.weights(driver);
    }),
  }));
}
