// SPDX-License-Identifier: Apache-2.0
// What the tests of the page in a browser share: TAP, the browser, what a picture shows.
import { spawn } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

const modules = join(process.env.HIL_SOURCE_DIR, 'viewer/page/node_modules/playwright-core');
const browserPath = '/usr/bin/chromium';
export const WAIT_MS = 30000;

let number = 0;

/** One line of TAP, and what was found instead. */
export function check(good, name, found) {
  number++;
  console.log(`${good ? 'ok' : 'not ok'} ${number} - ${name}`);
  if (found !== undefined) console.log(`# ${JSON.stringify(found)}`);
}

/** Prints the plan; false when there is no browser, and all tests have been skipped. */
function plan(tests) {
  console.log(`1..${tests}`);
  const missing = [modules, browserPath].filter((path) => !existsSync(path));
  while (missing.length && number < tests) {
    check(true, `the page in a browser # SKIP no ${missing.join(', no ')}: ./dev setup --browser installs both`);
  }
  return missing.length === 0;
}

const children = [];

/** Starts the program with a page; returns it, what it says, and the lines of its --ready file by their names. */
export async function begin(work, program, words, options = {}) {
  const ready = join(work, `ready-${children.length}`);
  const child = spawn(program, [...words, '--http', '0', '--ready', ready],
    { stdio: ['ignore', 'ignore', 'pipe'], ...options });
  let text = '';
  child.stderr.on('data', (data) => { text += data; });
  children.push(child);
  for (const end = Date.now() + WAIT_MS; !existsSync(ready);) {
    if (child.exitCode !== null || Date.now() > end) throw new Error(text);
    await new Promise((resolve) => { setTimeout(resolve, 10); });
  }
  const lines = [...readFileSync(ready, 'utf8').matchAll(/^(\w+)='(.*)'$/gm)];
  return { child, said: () => text, ...Object.fromEntries(lines.map(([, name, value]) => [name, value])) };
}

/** A whole test: judge(browser, work) with a headless browser that draws with the processor and a directory, and the
 * end of what it began. */
export async function test(tests, judge) {
  if (!plan(tests)) process.exit(0);
  const work = mkdtempSync(join(tmpdir(), 'coman-page-'));
  const { chromium } = createRequire(join(modules, 'index.js'))(modules);
  const browser = await chromium.launch({ executablePath: browserPath,
    args: ['--enable-unsafe-swiftshader', '--no-sandbox', '--disable-dev-shm-usage'] });
  // The browser of somebody who has seen the card for newcomers, unless the page is for a newcomer
  const newPage = browser.newPage.bind(browser);
  browser.newPage = async ({ newcomer, ...options } = {}) => {
    const page = await newPage(options);
    if (!newcomer) await page.addInitScript(() => localStorage.setItem('welcome', 'seen'));
    return page;
  };
  try {
    await judge(browser, work);
  } catch (error) {
    check(false, error.message);
  } finally {
    for (const child of children) child.kill('SIGKILL');
    await browser.close();
    rmSync(work, { recursive: true });
  }
  process.exit(0);
}

/** What a PNG shows: its size, the variance of its luminance, and for each area {x, y, width, height,
 * colors} how many of its columns have a pixel of each of those colors (as CSS writes them), of all. */
export async function lookAt(page, png, areas = []) {
  if (png.length < 8 || png.subarray(1, 4).toString() !== 'PNG' || png.subarray(-8, -4).toString() !== 'IEND') {
    throw new Error(`no whole PNG: ${png.length} bytes, ${JSON.stringify(png.subarray(0, 60).toString('latin1'))} to ${JSON.stringify(png.subarray(-12).toString('latin1'))}`);
  }
  return page.evaluate(async ({ code, wanted }) => {
    const bytes = Uint8Array.from(atob(code), (letter) => letter.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    const { width, height } = bitmap;
    const pen = new OffscreenCanvas(width, height).getContext('2d');
    const read = (x, y, w, h) => pen.getImageData(Math.round(x), Math.round(y), Math.round(w), Math.round(h));
    pen.drawImage(bitmap, 0, 0);
    const share = ({ x, y, width: w, height: h, colors }) => colors.map((color) => {
      const ink = color.match(/\d+/g).map(Number);
      const image = read(x, y, w, h);
      const columns = new Set();
      for (let i = 0; i < image.data.length; i += 4) {
        if (ink.every((part, k) => Math.abs(part - image.data[i + k]) < 48)) columns.add((i / 4) % image.width);
      }
      return columns.size / image.width;
    });
    const { data } = read(0, 0, width, height);
    let sum = 0;
    let square = 0;
    for (let i = 0; i < data.length; i += 4) {
      const light = 0.2126 * data[i] + 0.7152 * data[i + 1] + 0.0722 * data[i + 2];
      sum += light;
      square += light * light;
    }
    const count = data.length / 4;
    return { width, height, variance: square / count - (sum / count) ** 2, shares: wanted.map(share) };
  }, { code: png.toString('base64'), wanted: areas });
}

/** In the page: how much the picture of the robot differs from one color, the variance of its luminance. */
export function variance() {
  const { scene } = window.coman.page;
  scene.renderer.render(scene.scene, scene.camera);
  const canvas = document.createElement('canvas');
  canvas.width = 160;
  canvas.height = 120;
  const pen = canvas.getContext('2d');
  pen.drawImage(scene.canvas, 0, 0, 160, 120);
  const { data } = pen.getImageData(0, 0, 160, 120);
  let sum = 0;
  let square = 0;
  for (let i = 0; i < data.length; i += 4) {
    const light = 0.2126 * data[i] + 0.7152 * data[i + 1] + 0.0722 * data[i + 2];
    sum += light;
    square += light * light;
  }
  const count = data.length / 4;
  return square / count - (sum / count) ** 2;
}
