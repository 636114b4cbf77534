// SPDX-License-Identifier: Apache-2.0
// usage: node page_plots.mjs COMAN-HIL [FOLDER]
// Plots of two recordings in a headless Chromium, against the files that they were made from: the
// cursor's values, zoom and pan, signals that move, what is exported, the ghost. Prints TAP; pictures
// go to FOLDER.
import { spawnSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { begin, check, lookAt, test, WAIT_MS } from './browser.mjs';

const [program, folder] = process.argv.slice(2);
const rig = join(process.env.HIL_SOURCE_DIR, 'config/rigs/coman.yaml');
const TESTS = 15;
const KNEE = 'q_RKneeSag_rad';
const ELBOW = 'q_LElbj_rad';

function record(directory, ...more) {
  const made = spawnSync(program, ['run', rig, '--transport', 'local', '--clock', 'free', '--duration', '4',
    '--control', 'none', '--quiet', '--record', directory, ...more], { encoding: 'utf8' });
  if (made.status !== 0) throw new Error(made.stderr);
}

/** Rows of a CSV file, as objects. */
function readRows(text) {
  const [titles, ...lines] = text.trimEnd().split('\n').map((l) => l.split(','));
  return lines.map((cells) => Object.fromEntries(cells.map((cell, i) => [titles[i], Number(cell)])));
}

/** How far a value is from that of a row as near to a time as any: the page shows milliseconds. */
const missOf = (rows, time, valueOf, value) => Math.min(...rows.flatMap((row, i) =>
  Math.abs(row.time_s - time) < 0.0056 ? [Math.abs(valueOf(row, i) - value)] : []));

const rowAt = (rows, time) => rows.reduce((a, b) => Math.abs(b.time_s - time) < Math.abs(a.time_s - time) ? b : a);

/** In the page: what each plot shows, by its chips and its axis of time. */
function shown() {
  return [...document.querySelectorAll('.plot')].map((plot) => ({
    names: [...plot.querySelectorAll('.chip span')].map((e) => e.textContent),
    values: [...plot.querySelectorAll('.chip b')].map((e) => Number(e.textContent)),
    apart: [...plot.querySelectorAll('.chip small')].map((e) => Number(e.textContent.replace('Δ', ''))) }));
}

/** In the page: where the saved picture has each plot, and the colors of its curves. */
function places() {
  const [margin, title] = [8, 22];
  const grid = document.querySelector('.plotgrid');
  const frame = grid.getBoundingClientRect();
  return { width: frame.width, plots: [...grid.querySelectorAll('.plot')].map((plot) => {
    const part = plot.querySelector('.stage').getBoundingClientRect();
    const y = margin + plot.getBoundingClientRect().top - frame.top + grid.scrollTop;
    const area = { x: margin + part.left - frame.left, width: part.width,
      colors: [...plot.querySelectorAll('.chip i')].map((e) => getComputedStyle(e).backgroundColor) };
    return { names: { ...area, y, height: title }, curves: { ...area, y: y + title, height: part.height } };
  }) };
}

async function judge(browser, work) {
  record(join(work, 'one'), '--task', 'squat');
  record(join(work, 'two'), '--task', 'pose', '--set', 'pose.LElbj_rad=-0.9');
  const run = await begin(work, program, ['replay', join(work, 'one'), '--with', join(work, 'two')]);
  const rows = ['one', 'two'].map((name) => readRows(readFileSync(join(work, name, 'signals.csv'), 'utf8')));
  const poses = readRows(readFileSync(join(work, 'two', 'poses.csv'), 'utf8'));
  const page = await browser.newPage({ viewport: { width: 1400, height: 800 }, colorScheme: 'light',
    acceptDownloads: true });
  const errors = [];
  const wait = (test, argument) => page.waitForFunction(test, argument, { timeout: WAIT_MS });
  const picture = (name) => folder && page.screenshot({ path: join(folder, `${name}.png`) });
  const range = () => page.evaluate(() => window.coman.page.plots.range);
  const saved = async (button) => {
    const end = button.replace('#plots-', '.');
    const [file] = await Promise.all([
      page.waitForEvent('download', (download) => download.suggestedFilename().endsWith(end)), page.click(button)]);
    return readFileSync(await file.path());
  };
  page.setDefaultTimeout(WAIT_MS);
  page.on('pageerror', (error) => errors.push(error.message));

  // A first set of plots
  await page.goto(`${run.page_view}&quality=low`);
  await wait(() => window.coman?.page.scene?.firstDrawn > 0 && window.coman.page.compare.name);
  await page.evaluate(() => { window.coman.page.scene.period = 1000; }); // the picture is not judged here
  await page.click('#pause');
  await wait(() => window.coman.state.paused && document.querySelectorAll('.plot canvas').length === 3);
  const first = await page.evaluate(shown);
  check(first.length === 3 && first[0].names.includes(KNEE) && first[1].names[0].startsWith('torque_'),
    'knees and forces are plotted at first', first.map(({ names }) => names));

  // The cursor reads all plots at one time
  const over = await (await page.$('.plot .u-over')).boundingBox();
  await page.mouse.move(over.x + over.width * 0.7, over.y + 20);
  await wait(() => document.querySelector('.cursor').textContent);
  await wait(([name, from]) => {
    const time = parseFloat(document.querySelector('.cursor').textContent);
    return time > from && Number.isFinite(parseFloat(document.querySelector('.chip b').textContent)) && name;
  }, [KNEE, 2]);
  const time = parseFloat(await page.textContent('.cursor'));
  const read = await page.evaluate(shown);
  const off = read.flatMap(({ names, values }) => names.map((name, i) =>
    missOf(rows[0], time, (row) => row[name], values[i]) / (Math.abs(values[i]) + 0.1)));
  check(Math.max(...off) < 1e-3 && off.length === 6, 'the cursor reads every plot at one time', { time, off });
  const apart = missOf(rows[0], time, (row, i) => rows[1][i][KNEE] - row[KNEE], read[0].apart[0]);
  check(apart < 1e-3 && Math.abs(read[0].apart[0]) > 0.05, 'and how far the other recording is away', read[0]);
  await picture('cursor');

  // Wheel, keys, a box, back
  const all = await range();
  await page.mouse.wheel(0, -400);
  await wait((to) => window.coman.page.plots.range[1] < to, all[1]);
  const near = await range();
  check(near[0] > all[0] && near[0] < time && near[1] > time && near[1] - near[0] < 0.7 * (all[1] - all[0]),
    'the wheel zooms about the pointer', near);
  await page.focus('.plot');
  await page.keyboard.press('Shift+ArrowLeft');
  const moved = await range();
  check(moved[0] < near[0] && Math.abs(moved[1] - moved[0] - (near[1] - near[0])) < 1e-6, 'arrows pan', moved);
  await page.keyboard.press('Escape');
  check(JSON.stringify(await range()) === JSON.stringify(all), 'Esc shows all');
  await page.mouse.move(over.x + over.width * 0.25, over.y + 10);
  await page.mouse.down();
  await page.mouse.move(over.x + over.width * 0.75, over.y + 14, { steps: 4 });
  await page.mouse.up();
  await wait((to) => window.coman.page.plots.range[1] < to, all[1]);
  const box = await range();
  const quarter = (all[1] - all[0]) / 4;
  check(Math.abs(box[0] - all[0] - quarter) < 0.03 && Math.abs(all[1] - box[1] - quarter) < 0.03, 'a box zooms', box);

  // Another plot, a signal by search, one that moves over by keys
  await page.click('#plot-add');
  await page.fill('#signal-search', 'q lelbj');
  await page.keyboard.press('Enter');
  await wait(() => document.querySelectorAll('.plot').length === 4);
  await page.focus('.plot:nth-child(3) .chip');
  await page.keyboard.press('Shift+ArrowRight');
  await wait(() => document.querySelectorAll('.plot:nth-child(4) .chip').length === 2);
  const four = await page.evaluate(shown);
  check(four[3].names[0] === ELBOW && four[2].names.length === 1 && four[3].names[1] === first[2].names[0],
    'a plot is added, a signal moves to it', four.map(({ names }) => names));

  // A search reads joints as people call them, and says when it finds nothing
  await page.fill('#signal-search', 'elbow torque');
  const words = await page.evaluate(() => [...document.querySelectorAll('#signals-found li')].map((li) => li.dataset.name));
  check(words.includes('torque_LElbj_nm') && words.includes('torque_RElbj_nm') && words.every((name) => /elb/i.test(name)),
    'a search matches the joints that people mean', words);
  await page.fill('#signal-search', 'elbow flux');
  await page.keyboard.press('Enter');
  const none = await page.textContent('#signals-found');
  check(/No signal has “elbow flux”/.test(none) && await page.locator('.plot').count() === 4,
    'a search that finds nothing says so, and adds nothing', none);
  await page.fill('#signal-search', '');
  await page.keyboard.press('Escape');

  // What is shown is saved
  await wait(() => !document.querySelector('.plot:nth-child(4) .chip b').textContent.includes('–'));
  const curves = readRows((await saved('#plots-csv')).toString());
  const inside = rows[0].filter(({ time_s: t }) => t >= box[0] && t <= box[1]);
  const worst = Math.max(...curves.map((row, i) => Math.abs(row.time_s - inside[i].time_s)
    + Math.max(...Object.keys(row).map((name) => Math.abs(row[name] - inside[i][name]) / (1 + Math.abs(row[name]))))));
  check(curves.length === inside.length && worst < 1e-6 && ELBOW in curves[0], 'CSV has the rows that are shown',
    { rows: curves.length, worst });
  const image = await saved('#plots-png');
  const { width, plots } = await page.evaluate(places);
  const seen = await lookAt(page, image, plots.flatMap(({ names, curves }) => [names, curves]));
  const named = seen.shares.filter((_, i) => i % 2 === 0).flat();
  const drawn = seen.shares.filter((_, i) => i % 2);
  check(image.subarray(1, 4).toString() === 'PNG' && seen.width >= width && plots.length === 4
    && plots.every(({ curves }) => curves.y + curves.height <= seen.height) && Math.min(...named) > 0.02
    && drawn.every((shares) => shares.some((share) => share > 0.5)), 'PNG has the plots with names and curves', seen);

  // The other robot
  await page.evaluate(() => window.coman.page.past.show(3));
  await wait(() => Math.abs(window.coman.state.time - 3) < 0.3); // of the states that a slow machine was sent
  const [ghost, base] = await page.evaluate(async () => {
    const { compare, hello, scene } = window.coman.page;
    compare.show(3);
    return [scene.scene.children.at(-1).children[0].position.toArray(), hello.scene.bodies[0].name];
  });
  const row = rowAt(poses, 3);
  const away = Math.hypot(...['x', 'y', 'z'].map((axis, i) => ghost[i] - row[`${base}_${axis}_m`]));
  check(away < 1e-6, 'the ghost is where the other robot was', { ghost, away });
  await page.click('#compare');
  check(await page.evaluate(() => document.querySelector('.chip small').hidden), 'and goes away again');
  await picture('four');
  check(errors.length === 0, 'the page has no errors', errors);
}

await test(TESTS, judge);
