// SPDX-License-Identifier: Apache-2.0
// usage: node page_replay.mjs COMAN-HIL [FOLDER]
// A recording in the page, in a headless Chromium: that it plays, that the line shows an earlier
// pose, that plots have every row, and that nothing can be pushed. Prints TAP; pictures go to
// FOLDER.
import { spawnSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { begin, check, test, variance, WAIT_MS } from './browser.mjs';

const [program, folder] = process.argv.slice(2);
const source = process.env.HIL_SOURCE_DIR;
const TESTS = 9;

function record(directory) {
  const made = spawnSync(program, ['run', join(source, 'config/rigs/coman.yaml'), '--transport',
    'local', '--clock', 'free', '--task', 'squat', '--duration', '8', '--control', 'none', '--quiet',
    '--record', directory, '--fault', 'jam: motor LElbj jam 2..3'], { encoding: 'utf8' });
  if (made.status !== 0) throw new Error(made.stderr);
}

/** Rows of a CSV file, as objects. */
function readRows(path) {
  const [titles, ...lines] = readFileSync(path, 'utf8').trimEnd().split('\n').map((l) => l.split(','));
  return lines.map((cells) => Object.fromEntries(cells.map((cell, i) => [titles[i], Number(cell)])));
}

/** In the page: the time that is shown, and the place of the robot's base in the picture. */
function shown() {
  const { scene } = window.coman.page;
  const { x, y, z } = scene.robot.bodies[0].position;
  return { time: window.coman.state.time, place: [x, y, z] };
}

async function judge(browser, work) {
  const directory = join(work, 'recording');
  record(directory);
  const run = await begin(work, program, ['replay', directory]);
  const page = await browser.newPage({ viewport: { width: 900, height: 640 }, colorScheme: 'light' });
  const poses = readRows(join(directory, 'poses.csv'));
  const signals = readRows(join(directory, 'signals.csv'));
  const base = Object.keys(poses[0])[1].replace(/_x_m$/, '');
  const errors = [];
  const wait = (test, argument) => page.waitForFunction(test, argument, { timeout: WAIT_MS });
  const picture = (name) => folder && page.screenshot({ path: join(folder, `${name}.png`) });
  page.setDefaultTimeout(WAIT_MS);
  page.on('pageerror', (error) => errors.push(error.message));
  page.on('console', (message) => {
    if (message.type() === 'error' && !message.text().includes('WebSocket')) errors.push(message.text());
  });

  // It plays by itself
  await page.goto(`${run.page_view}&quality=low`);
  await wait(() => window.coman?.page.scene?.firstDrawn > 0);
  const found = await page.evaluate(variance);
  check(found > 100, 'the picture is not blank', found);
  await wait(() => window.coman.state.time > 0.3);
  check(true, 'the recording plays');

  // The line goes to the lowest pose, and back to an earlier one: both as they were recorded
  const lowest = poses.reduce((a, b) => b[`${base}_z_m`] < a[`${base}_z_m`] ? b : a);
  await page.click('#pause');
  await wait(() => window.coman.state.paused);
  const near = async (wanted, name) => {
    await page.evaluate((part) => {
      const range = document.getElementById('past');
      range.value = String(Math.round(part * Number(range.max)));
      range.dispatchEvent(new Event('input'));
    }, (wanted.time_s - poses[0].time_s) / (poses.at(-1).time_s - poses[0].time_s));
    await wait((time) => Math.abs(window.coman.state.time - time) < 0.011
      && Math.abs(window.coman.page.scene.state.time - time) < 0.011, wanted.time_s);
    const now = await page.evaluate(shown);
    const row = poses.findLast(({ time_s: time }) => time <= now.time + 1e-9);
    const away = Math.hypot(...['x', 'y', 'z'].map((axis, i) => now.place[i] - row[`${base}_${axis}_m`]));
    check(away < 1e-6, name, { now, away });
    return now;
  };
  const low = await near(lowest, 'the line shows a pose as it was recorded');
  const early = await near(poses[20], 'and an earlier one');
  check(early.time < low.time - 1 && early.place[2] > low.place[2] + 0.03, 'which is another');

  // Plots have every row
  await page.fill('#signal-search', 'q rknee rad');
  await page.press('#signal-search', 'Enter');
  await wait(() => document.querySelector('.chip b')?.textContent && document.querySelector('.plots canvas'));
  const series = await page.evaluate(async () => {
    const { times, columns, rows } = await window.coman.link.ask('series',
      { signals: ['q_RKneeSag_rad'], from_s: 0, to_s: 100, points: 8000 });
    return { rows, times: [...times], values: [...columns[0]] };
  });
  const worst = Math.max(...series.times.map((time, i) => Math.abs(time - signals[i].time_s)
    + Math.abs(series.values[i] - signals[i].q_RKneeSag_rad)));
  check(series.times.length === signals.length && worst < 1e-6, 'plots have every row of the file',
    { rows: series.rows, worst });

  // Events jump, frames are those of the moment
  await page.click('#tab-panel-events');
  await page.click('.events li:has-text("jam ends")');
  await wait(() => Math.abs(window.coman.state.time - 3) < 0.011);
  await page.click('#tab-panel-trace');
  await wait(() => document.querySelectorAll('.frames tbody tr').length > 10
    && [...document.querySelectorAll('.meaning')].some(({ textContent }) => textContent.includes('position')));
  check(true, 'an event shows its moment, with the frames of then, decoded');
  await picture('replay');

  // Nobody can act on what is over
  const push = await page.evaluate(() => window.coman.link.ask('push', { body: 'Waist', force_n: [9, 0, 0] })
    .then(() => 'pushed', (error) => error.message));
  check(push.includes('recording') && !await page.$('#tab-panel-actions'), 'nothing can be pushed', push);
  check(errors.length === 0, 'the page has no errors', errors);
}

await test(TESTS, judge);
