// WebAssembly from its text form: `node assemble.mjs kernel.wat kernel.wasm`.

import fs from 'node:fs';
import wabt from '../engines/node_modules/wabt/index.js';

const [, , source, target] = process.argv;
const module = (await wabt()).parseWat(source, fs.readFileSync(source, 'utf8'), {simd: true});
fs.writeFileSync(target, module.toBinary({}).buffer);
