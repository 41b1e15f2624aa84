// The runtime alone: `node evaluate.mjs job.json` with {"network": path, "rotations": path, "out": path}.
// network: the string of a node's extras; rotations: T × 24 quaternions x y z w, out: T × M keys; both in doubles.

import fs from 'node:fs';
import {PoseKeys, networkInExtras} from '../../examples/runtime/pose_keys.js';

const job = JSON.parse(fs.readFileSync(process.argv[2], 'utf8'));
const bytes = fs.readFileSync(job.rotations);
const rotations = new Float64Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
const evaluator = new PoseKeys(networkInExtras(fs.readFileSync(job.network, 'utf8')));
const keys = [];
for (let at = 0; at < rotations.length; at += 96) {
  const pose = rotations.subarray(at, at + 96);
  keys.push(...evaluator.evaluate(columns(pose), pose));
}
fs.writeFileSync(job.out, Buffer.from(Float64Array.from(keys).buffer));

/** The pelvis' matrix, column after column. */
function columns([x, y, z, w]) {
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
    2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
    2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0,
    0, 0, 0, 1,
  ];
}
