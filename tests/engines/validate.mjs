// The Khronos validator on every file; its report goes to `out`.

import fs from 'node:fs';
import validator from 'gltf-validator';
import {eachJob} from './jobs.mjs';

await eachJob(async ({glb, out}) => {
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(glb)), {maxIssues: 0, writeTimestamp: false});
  fs.writeFileSync(out, JSON.stringify(report));
});
