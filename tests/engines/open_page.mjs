// Opens a page from disk in headless Chromium, as a user does: `node open_page.mjs page.html function.js [picture.png]`.
// Prints as JSON what the page asked the network for, what went wrong, and what the function in the file returned once
// the viewer ran; takes a picture after that.

import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import {pathToFileURL} from 'node:url';
import {chromium} from 'playwright-core';

const [page, script, picture] = process.argv.slice(2);
const LONGEST = 300_000; // milliseconds
const profile = fs.mkdtempSync(path.join(os.tmpdir(), 'page-'));
const context = await chromium.launchPersistentContext(profile, {
  executablePath: process.env.CHROMIUM,
  viewport: picture ? {width: 1180, height: 760} : {width: 640, height: 400},
  args: [
    '--no-sandbox', '--no-first-run', '--disable-quic', '--disable-background-networking', '--disable-component-update',
    '--disable-sync', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
  ],
});
try {
  const [tab] = context.pages(), requests = [], errors = [];
  tab.on('request', request => { if (!/^(data|blob):/.test(request.url())) requests.push(request.url().split('/').at(-1)); });
  tab.on('console', message => { if (['error', 'warning'].includes(message.type())) errors.push(message.text()); });
  tab.on('pageerror', error => errors.push(error.message));
  const url = pathToFileURL(path.resolve(page)).href, start = Date.now();
  await tab.goto(url, {waitUntil: 'commit', timeout: LONGEST});
  while (!errors.length && !await tab.evaluate('Boolean(window.garmentc)') && Date.now() - start < LONGEST)
    await tab.waitForTimeout(100);
  const found = errors.length ? null : await tab.evaluate(fs.readFileSync(script, 'utf8'));
  if (picture) await tab.screenshot({path: picture, timeout: LONGEST});
  console.log(JSON.stringify({requests, errors, found}));
} finally {
  await context.close();
  fs.rmSync(profile, {recursive: true, force: true, maxRetries: 5});
}
