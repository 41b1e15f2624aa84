// Reads every file with gltfpack and writes it again; `flags` are those of its command line.

import fs from 'node:fs';
import {pack} from 'gltfpack';
import {eachJob} from './jobs.mjs';

await eachJob(async ({glb, out, flags}) => {
  await pack(['-i', 'in.glb', '-o', 'out.glb', ...flags], {
    read: () => fs.readFileSync(glb),
    write: (_, bytes) => fs.writeFileSync(out, bytes),
  });
});
