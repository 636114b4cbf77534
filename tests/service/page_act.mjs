// SPDX-License-Identifier: Apache-2.0
// usage: node page_act.mjs COMAN-HIL [FOLDER]
// What a page does to a run, in a headless Chromium: sliders of the task pose move joints, a body that is
// dragged is pushed until it is let go, views by key, pictures and recordings, all of it by keyboard.
// Prints TAP; pictures go to FOLDER.
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { begin, check, lookAt, test, WAIT_MS } from './browser.mjs';

const [program, folder] = process.argv.slice(2);
const TESTS = 13;
const PATIENCE_MS = 3 * WAIT_MS; // the processor draws, and simulates in real time

/** In the page: the angle of a joint. */
function angle(name) {
  const { scene } = window.coman.page.hello;
  return window.coman.state.joints[2 * scene.joints.findIndex((joint) => joint.name === name)];
}

/** In the page: where the camera looks from, as a unit vector. */
function direction() {
  const { camera, controls } = window.coman.page.scene;
  return camera.position.clone().sub(controls.target).normalize().toArray();
}

/** In the page: a place of the picture where the chest is. */
function chest() {
  const { scene, hello } = window.coman.page;
  const box = scene.canvas.getBoundingClientRect();
  const heaviest = hello.scene.bodies.reduce((best, body, i, all) => body.mass_kg > all[best].mass_kg ? i : best, 0);
  for (let y = box.top + 20; y < box.bottom - 60; y += 6) {
    for (let x = box.left + 160; x < box.right - 160; x += 12) {
      if (scene.hit(x, y)?.body === heaviest) return { x, y: y + 12, body: hello.scene.bodies[heaviest].name };
    }
  }
  return null;
}

async function judge(browser, work) {
  const run = await begin(work, program, ['run', join(process.env.HIL_SOURCE_DIR, 'config/rigs/coman.yaml'), '--transport',
    'local', '--clock', 'real', '--task', 'pose', '--control', join(work, 'control'), '--quiet']);
  const page = await browser.newPage({ viewport: { width: 800, height: 560 }, colorScheme: 'dark',
    acceptDownloads: true });
  const errors = [];
  const wait = (test, argument) => page.waitForFunction(test, argument, { timeout: PATIENCE_MS });
  const picture = (name) => folder && page.screenshot({ path: join(folder, `${name}.png`) });
  const texts = () => page.evaluate(() => window.coman.page.events.all.map(({ text }) => text));
  page.setDefaultTimeout(PATIENCE_MS);
  page.on('pageerror', (error) => errors.push(error.message));
  await page.goto(`${run.page}&quality=low`);
  await wait(() => window.coman?.page.scene?.firstDrawn > 0);
  await page.evaluate(() => { window.coman.page.scene.period = 1000; });

  // Paused: time goes on in steps, so that a slow machine draws no other conclusions
  const step = (count) => page.evaluate(async (ticks) => {
    const end = window.coman.state.time + ticks * window.coman.page.hello.run.tick_s;
    await window.coman.link.ask('step', { count: ticks });
    while (window.coman.state.time < end - 1e-9) await new Promise((done) => { setTimeout(done, 20); });
  }, count);
  await wait(() => window.coman.state.time > 0.5);
  await page.click('#pause');
  await wait(() => window.coman.state.paused);

  // Sliders, by keys: the joint goes there smoothly
  await page.waitForSelector('[data-joint=LElbj]');
  await step(1500);
  const before = await page.evaluate(angle, 'LElbj');
  await page.focus('[data-joint=LElbj]');
  await page.keyboard.press('PageUp');
  const wanted = Number(await page.inputValue('[data-joint=LElbj]'));
  await wait(() => window.coman.page.events.all.some(({ text }) => text.includes('pose.LElbj_rad is')));
  await step(300);
  const halfway = await page.evaluate(angle, 'LElbj');
  await step(2000);
  const after = await page.evaluate(angle, 'LElbj');
  // A controller that was kept waiting makes up for a tenth of a second
  const fastest = (0.3 + 0.1) * Number(await page.inputValue('[aria-label="rate of the joints"]')) + 0.01;
  check(Math.abs(wanted - before) > 0.1 && Math.abs(after - wanted) < 0.02
    && Math.abs(halfway - before) <= fastest && fastest < Math.abs(wanted - before),
  'a slider moves its joint, not faster than allowed', { before, halfway, after, wanted, fastest });
  await picture('sliders');

  // Views: from the front, the side, above
  const seen = {};
  for (const [key, name] of [['7', 'front'], ['8', 'side'], ['9', 'top']]) {
    await page.keyboard.press(key);
    seen[name] = await page.evaluate(direction);
  }
  check(seen.front[0] > 0.95 && seen.side[1] < -0.95 && seen.top[2] > 0.99, 'keys look from the front, side and top', seen);
  await page.keyboard.press('0');
  check(await page.evaluate(() => window.coman.page.camera.rides), 'and along with a body');
  await page.keyboard.press('r');
  await wait(() => !window.coman.page.camera.rides && window.coman.page.scene.framed);

  // A recording of what the page sees begins
  await page.click('#record');
  const recordedFrom = await page.evaluate(() => window.coman.state.time);
  const plotted = (await page.textContent('.chip span')).match(/^q_(\w+)_rad$/)[1];

  // Ctrl and a drag push, paused: the push waits, acts in the steps, and ends when let go
  await wait(() => window.coman.page.scene.state === window.coman.state);
  const at = await page.evaluate(chest);
  await page.keyboard.down('Control');
  await page.mouse.move(at.x, at.y);
  await page.mouse.down();
  await page.mouse.move(at.x + 40, at.y, { steps: 4 });
  await wait(() => Number.parseFloat(document.querySelector('.force').textContent) > 10);
  await page.waitForTimeout(200);
  await page.mouse.move(at.x + 41, at.y);
  const force = Number.parseFloat(await page.textContent('.force'));
  check(force > 10 && await page.evaluate(() => window.coman.page.scene.push.visible),
    'a drag draws its force with its value', force);
  await picture('drag');
  await wait(() => window.coman.page.events.all.some(({ text }) => /pushed with [1-9]/.test(text)));
  const chestAt = () => page.evaluate((name) => window.coman.state.bodies.slice(
    ...[0, 3].map((k) => 7 * window.coman.page.hello.scene.bodies.findIndex((body) => body.name === name) + k)), at.body);
  const still = await chestAt();
  await step(100);
  const pushed = await chestAt();
  const way = Math.hypot(...[0, 1, 2].map((k) => pushed[k] - still[k]));
  check(way > 1e-3, 'the steps of a paused run feel it', { way, body: at.body });
  await page.mouse.up();
  await page.keyboard.up('Control');
  await wait(() => /let go, pushed with \d{2,}\.\d N at most/.test(window.coman.page.events.all.at(-1).text));
  check(await page.evaluate(() => document.querySelector('.force').hidden && !window.coman.page.scene.push.visible),
    'letting go ends the push');
  const pushes = (await texts()).filter((text) => text.includes('pushed'));
  check(pushes.length <= 5, 'a drag is a few events, not one for each request', pushes);

  // Files
  const saved = async (act) => {
    const [file] = await Promise.all([page.waitForEvent('download'), act()]);
    return readFileSync(await file.path());
  };
  const image = await saved(() => page.keyboard.press('p'));
  const shown = await lookAt(page, image);
  const canvas = await page.evaluate(() => [window.coman.page.scene.canvas.width, window.coman.page.scene.canvas.height]);
  check(shown.width === canvas[0] && shown.height === canvas[1] && shown.variance > 100, 'a picture is saved', { shown, canvas });
  const stepped = [];
  for (let i = 0; i < 10; i++) {
    await step(60);
    stepped.push(await page.evaluate((joint) => {
      const { scene } = window.coman.page.hello;
      return { time: window.coman.state.time,
        angle: window.coman.state.joints[2 * scene.joints.findIndex(({ name }) => name === joint)] };
    }, plotted));
  }
  const files = [];
  page.on('download', (file) => files.push(file));
  await page.click('#record');
  for (const end = Date.now() + PATIENCE_MS; files.length < 2 && Date.now() < end;) await page.waitForTimeout(100);
  const contents = await Promise.all(files.map(async (file) => [file.suggestedFilename(),
    readFileSync(await file.path(), 'utf8').trimEnd().split('\n')]));
  const [signals, frames] = ['signals.csv', 'candump.log'].map((end) => contents.find(([name]) => name.endsWith(end))?.[1] ?? []);
  const rows = signals.slice(1).map((line) => line.split(',').map(Number));
  const column = (signals[0] ?? '').split(',').indexOf(`q_${plotted}_rad`);
  const missing = stepped.filter(({ time, angle: value }) => !rows.some((row) =>
    Math.abs(row[0] - time) < 1e-9 && Math.abs(row[column] - value) < 1e-6));
  check(column > 0 && missing.length === 0 && rows.every(([time]) => time >= recordedFrom - 1e-9),
    'a recording has the signals, from the click on', { rows: rows.length, from: recordedFrom, first: rows[0]?.[0], missing });
  check(frames.length > 100 && frames.every((line) => /^\(\d+\.\d{6}\) \w+ [0-9A-F]{3}(#[0-9A-F]*)$/.test(line)),
    'and the frames as candump writes them', frames[0]);

  // By keyboard: everything has a name and is reached by Tab
  const nameless = await page.evaluate(() => [...document.querySelectorAll('button, input, select, [tabindex]')]
    .filter((e) => e.checkVisibility() && !(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length))
    .map((e) => e.outerHTML.slice(0, 120)));
  check(nameless.length === 0, 'everything that acts has a name', nameless);
  await page.focus('#plots-png');
  await page.keyboard.press('Tab');
  check(await page.evaluate(() => document.activeElement.matches('.plot')
    && getComputedStyle(document.activeElement).outlineStyle === 'solid'), 'Tab reaches the plots, and shows it');
  check(errors.length === 0, 'the page has no errors', errors);
}

await test(TESTS, judge);
