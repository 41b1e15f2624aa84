// Reads every file with glTF-Transform, does `steps` to it, and writes it again.

import {NodeIO} from '@gltf-transform/core';
import {ALL_EXTENSIONS} from '@gltf-transform/extensions';
import {dedup, flatten, meshopt, prune, resample, sparse, weld} from '@gltf-transform/functions';
import fs from 'node:fs';
import {MeshoptDecoder, MeshoptEncoder} from 'meshoptimizer';
import {eachJob} from './jobs.mjs';

await Promise.all([MeshoptDecoder.ready, MeshoptEncoder.ready]);

const STEPS = {
  dedup: dedup(),
  /** No sparse accessors: version 4.5 writes normalized integers in them as zeros. */
  dense: sparse({ratio: 0}),
  flatten: flatten(),
  meshopt: meshopt({encoder: MeshoptEncoder}), // reorders and quantizes before it compresses
  prune: prune(),
  resample: resample(),
  weld: weld(),
};

await eachJob(async ({glb, out, steps}) => {
  const io = new NodeIO()
    .registerExtensions(ALL_EXTENSIONS)
    .registerDependencies({'meshopt.decoder': MeshoptDecoder, 'meshopt.encoder': MeshoptEncoder});
  const document = await io.read(glb);
  await document.transform(...steps.map(step => STEPS[step]));
  fs.writeFileSync(out, await io.writeBinary(document));
});
