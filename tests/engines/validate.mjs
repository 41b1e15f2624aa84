// The Khronos validator on every file; its report goes to `out`.

import fs from 'node:fs';
import validator from 'gltf-validator';
import {jobs} from './jobs.mjs';

for (const {glb, out} of jobs) {
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(glb)), {maxIssues: 0, writeTimestamp: false});
  fs.writeFileSync(out, JSON.stringify(report));
}
