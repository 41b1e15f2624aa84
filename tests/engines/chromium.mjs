// Runs three_gpu.html on all jobs in headless Chromium: `node chromium.mjs jobs.json`. CHROMIUM names another browser.
// The page fetches its jobs and their files from here, and posts its results here; nothing comes from the network.

import {spawn} from 'node:child_process';
import fs from 'node:fs';
import http from 'node:http';
import os from 'node:os';
import path from 'node:path';
import {jobs} from './jobs.mjs';

const SILENCE = 120_000; // milliseconds without a request, after which the page counts as stuck
const TYPES = {'.html': 'text/html', '.js': 'text/javascript', '.mjs': 'text/javascript'};
const FLAGS = [
  '--headless', '--no-sandbox', '--no-first-run', '--disable-quic', '--disable-background-networking',
  '--disable-component-update', '--disable-sync', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
];

/** A file of this folder, and no other. */
function engineFile(url) {
  const file = path.join(import.meta.dirname, decodeURIComponent(url));
  if (!file.startsWith(import.meta.dirname + path.sep)) throw new Error(`${url} is outside`);
  return file;
}

async function body(request) {
  const chunks = [];
  for await (const chunk of request) chunks.push(chunk);
  return Buffer.concat(chunks);
}

async function answer(request, response) {
  const [, kind, number] = request.url.split('/');
  const job = jobs[Number(number)];
  if (request.url === '/jobs') return response.end(JSON.stringify(jobs.map(({glb, out, ...job}) => job)));
  if (kind === 'glb') return response.end(fs.readFileSync(job.glb));
  if (kind === 'out') return response.end(fs.writeFileSync(job.out, await body(request)));
  if (kind === 'error') return response.end(fs.writeFileSync(`${job.out}.error`, await body(request)));
  if (kind === 'done') return response.end(finish(0));
  if (kind === 'broken') return response.end(finish(1, String(await body(request))));
  response.setHeader('content-type', TYPES[path.extname(request.url)] ?? 'application/octet-stream');
  return response.end(fs.readFileSync(engineFile(request.url)));
}

const profile = fs.mkdtempSync(path.join(os.tmpdir(), 'chromium-'));
let browser, alarm;

function listen() {
  clearTimeout(alarm);
  alarm = setTimeout(() => finish(1, 'the page says nothing any more'), SILENCE);
}

function finish(code, message = '') {
  clearTimeout(alarm);
  if (message) console.error(message);
  process.exitCode = code;
  server.close();
  browser.kill();
}

const server = http.createServer((request, response) => {
  listen();
  answer(request, response).catch(error => { response.statusCode = 404; response.end(String(error)); });
});
server.listen(0, '127.0.0.1', () => {
  const page = `http://127.0.0.1:${server.address().port}/three_gpu.html`;
  browser = spawn(process.env.CHROMIUM ?? 'chromium', [...FLAGS, `--user-data-dir=${profile}`, page], {stdio: 'ignore'});
  browser.on('error', error => finish(1, `Chromium does not start: ${error.message}`));
  browser.on('exit', () => {
    if (process.exitCode === undefined) finish(1, 'Chromium ended by itself');
    server.closeAllConnections();
    fs.rmSync(profile, {recursive: true, force: true, maxRetries: 5});
  });
  listen();
});
