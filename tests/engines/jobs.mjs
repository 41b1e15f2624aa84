// The jobs of a test run: `node engine.mjs jobs.json`, with [{"glb": path, "out": path, ...}].

import fs from 'node:fs';

export const jobs = JSON.parse(fs.readFileSync(process.argv[2], 'utf8'));

/** Do `work` on every job in turn. Why an engine refuses one goes to its `out`.error; the others go on. */
export async function eachJob(work) {
  for (const job of jobs) {
    try {
      await work(job);
    } catch (error) {
      fs.writeFileSync(`${job.out}.error`, String(error?.stack ?? error));
    }
  }
}

/** Write positions, x y z of every vertex of every frame, as 64-bit floats. */
export function writePositions(path, positions) {
  fs.writeFileSync(path, Buffer.from(Float64Array.from(positions).buffer));
}
