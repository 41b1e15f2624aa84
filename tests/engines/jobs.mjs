// The jobs of a test run: `node engine.mjs jobs.json`, with [{"glb": path, "out": path, ...}].

import fs from 'node:fs';

export const jobs = JSON.parse(fs.readFileSync(process.argv[2], 'utf8'));

/** Write positions, x y z of every vertex of every frame, as 64-bit floats. */
export function writePositions(path, positions) {
  fs.writeFileSync(path, Buffer.from(Float64Array.from(positions).buffer));
}
