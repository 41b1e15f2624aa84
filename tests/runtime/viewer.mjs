// The viewer in headless Chromium: `node viewer.mjs a.glb out [times...]`. CHROMIUM is its path.
// Writes pictures to the folder `out` and prints JSON: weights baked and by the network at the times, and what a
// dragged joint did. The page and three.js come from this machine; nothing from the network.

import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import {chromium} from '../engines/node_modules/playwright-core/index.mjs';

const [, , glb, out, ...times] = process.argv;
const RUNTIME = path.resolve(import.meta.dirname, '../../examples/runtime');
const MODULES = path.resolve(import.meta.dirname, '../engines/node_modules');
const TYPES = {'.html': 'text/html', '.js': 'text/javascript'};
const ARGUMENTS = ['--no-first-run', '--disable-quic', '--disable-background-networking', '--disable-component-update',
  '--disable-sync', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];

/** The address's file: of the runtime's folder or of the packages, and no other. */
function fileOf(address) {
  if (address === '/outfit.glb') return glb;
  const packaged = address.startsWith('/node_modules/');
  const [root, name] = packaged ? [MODULES, address.slice(14)] : [RUNTIME, address.slice(1)];
  const file = path.join(root, name);
  if (!file.startsWith(root + path.sep)) throw new Error(`${address} is outside`);
  return file;
}

const server = http.createServer((request, response) => {
  try {
    const {pathname} = new URL(request.url, 'http://localhost');
    const bytes = fs.readFileSync(fileOf(decodeURIComponent(pathname)));
    response.setHeader('content-type', TYPES[path.extname(pathname)] ?? 'application/octet-stream');
    response.end(bytes);
  } catch (error) {
    response.writeHead(404).end(String(error));
  }
});
await new Promise(resolve => server.listen(0, '127.0.0.1', resolve));

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM, chromiumSandbox: false, args: ARGUMENTS,
});
try {
  const page = await browser.newPage({viewport: {width: 700, height: 560}});
  page.setDefaultTimeout(300_000);
  const complaints = [];
  page.on('pageerror', error => complaints.push(error.message));
  page.on('console', message => { if (message.type() === 'error') complaints.push(message.text()); });
  await page.goto(`http://127.0.0.1:${server.address().port}/viewer.html?url=outfit.glb`, {waitUntil: 'commit'});
  await page.waitForFunction(() => window.viewer && !document.querySelector('#play').disabled);
  const picture = name => page.screenshot({path: path.join(out, `${name}.png`)});

  const frames = [];
  for (const [i, time] of times.entries()) {
    const weights = {};
    for (const [mode, live] of [['baked', false], ['live', true]]) {
      await page.setChecked('#live', live);
      weights[mode] = await page.evaluate(time => {
        viewer.seek(time);
        viewer.draw(0);
        return viewer.weights();
      }, Number(time));
      await picture(`${mode}-${i}`);
    }
    frames.push(weights);
  }
  await page.setChecked('#live', false);
  await page.evaluate(() => {
    viewer.clear();
    viewer.draw(0);
  });
  await picture('without');

  await page.click('#rest');
  await page.setChecked('#joints', true);
  await page.evaluate(() => viewer.draw(0));
  await picture('rest');
  const rest = await page.evaluate(() => viewer.weights());
  const from = await page.evaluate(() => viewer.jointOnPage('left_elbow'));
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  for (let step = 1; step <= 5; step++) await page.mouse.move(from.x - 4 * step, from.y + 12 * step);
  await page.mouse.up();
  const dragged = await page.evaluate(() => {
    viewer.draw(0);
    return {weights: viewer.weights(), rotations: viewer.rotations(), elbow: viewer.jointOnPage('left_elbow')};
  });
  await picture('dragged');
  console.log(JSON.stringify({frames, rest, dragged: {...dragged, from}, complaints}));
} finally {
  await browser.close();
  server.close();
}
