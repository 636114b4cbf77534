// SPDX-License-Identifier: Apache-2.0
// usage: node page_browser.mjs COMAN-HIL [FOLDER]
// The page in a headless Chromium: what is drawn, that it moves, that clicks reach the simulator,
// that who may look cannot, that a stopped run is said. Prints TAP; pictures go to FOLDER.
import { mkdirSync, readFileSync, symlinkSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { begin, check, test, variance, WAIT_MS } from './browser.mjs';

const [program, folder] = process.argv.slice(2);
const source = process.env.HIL_SOURCE_DIR;
const TESTS = 20;
const PATIENCE_MS = 3 * WAIT_MS; // the processor draws, and simulates in real time

/** A rig whose squat outlasts the slowest browser. */
function makeRig(work) {
  const config = join(source, 'config');
  mkdirSync(join(work, 'rigs'));
  symlinkSync(join(config, 'robots'), join(work, 'robots'));
  symlinkSync(join(config, 'meshes'), join(work, 'meshes'));
  writeFileSync(join(work, 'rigs/coman.yaml'), readFileSync(join(config, 'rigs/coman.yaml'), 'utf8')
    .replace(/cycles: \d+/, 'cycles: 90'));
  return join(work, 'rigs/coman.yaml');
}

const knee = () => {
  const { scene } = window.coman.page.hello;
  return window.coman.state.joints[2 * scene.joints.findIndex(({ name }) => name === 'RKneeSag')];
};

async function judge(browser, work) {
  const run = await begin(work, program, ['run', makeRig(work), '--transport', 'local', '--clock', 'real', '--task', 'squat',
    '--control', join(work, 'control'), '--quiet', '--token-file', 'none', '--fault', 'jam: motor LElbj jam manual']);
  const page = await browser.newPage({ viewport: { width: 900, height: 640 }, colorScheme: 'light' });
  const errors = [];
  const wait = (test, argument) => page.waitForFunction(test, argument, { timeout: PATIENCE_MS });
  const picture = (name) => folder && page.screenshot({ path: join(folder, `${name}.png`) });
  page.setDefaultTimeout(PATIENCE_MS);
  page.on('pageerror', (error) => errors.push(error.message));
  page.on('console', (message) => {
    if (message.type() === 'error' && !message.text().includes('WebSocket')) errors.push(message.text());
  });

  // The picture, and that it moves
  const begun = Date.now();
  await page.goto(`${run.page}&quality=low`);
  await wait(() => window.coman?.page.scene?.firstDrawn > 0);
  const first = await page.evaluate(() => window.coman.page.scene.firstDrawn);
  console.log(`# first picture after ${first.toFixed(0)} ms in the page, seen after ${Date.now() - begun} ms`);
  const found = await page.evaluate(variance);
  check(found > 100, 'the picture is not blank', found);
  await page.evaluate(() => { window.coman.page.scene.period = 1000; }); // the processor has other things to do
  const bent = await page.evaluate(knee);
  await wait((from) => {
    const index = window.coman.page.hello.scene.joints.findIndex(({ name }) => name === 'RKneeSag');
    return Math.abs(window.coman.state.joints[2 * index] - from) > 0.25;
  }, bent);
  check(true, 'the knees move during a squat');
  const delay = await page.evaluate(() => window.coman.page.delay);
  console.log(`# a state comes ${delay.toFixed(1)} ms after it was made`);
  await picture('squat');

  // Back in time, and forth
  await page.evaluate(() => {
    const range = document.getElementById('past');
    range.value = '960'; // 1.2 s ago
    range.dispatchEvent(new Event('input'));
  });
  const back = await page.evaluate(() => {
    const { past, scene } = window.coman.page;
    return { shown: past.shown?.time, now: window.coman.state.time,
      same: Math.abs(scene.robot.bodies[0].position.z - past.shown.bodies[2]) < 1e-6 };
  });
  check(back.shown < back.now - 0.5 && back.same, 'the line goes back to an earlier pose', back);
  await page.click('#live');
  check(await page.evaluate(() => window.coman.page.past.shown === null), 'and comes back to now');

  // 900 pixels are enough for the table of joints
  const table = await page.evaluate(() => {
    const { scrollWidth, clientWidth } = document.querySelector('#panel-joints .scroll');
    return { scrollWidth, clientWidth };
  });
  check(table.scrollWidth <= table.clientWidth && table.clientWidth > 0, 'the table of joints is not cut', table);

  // A click pauses, a click trips a fault
  await page.click('#pause');
  await wait(() => window.coman.state.paused);
  check(true, 'a click pauses');
  await page.waitForTimeout(1500);
  const pace = await page.textContent('#figure-pace');
  check(pace === '×0.00', 'a run that is paused has no pace, whatever the picture does', pace);
  await page.click('#tab-panel-actions');
  await page.click('[data-fault="jam"] input');
  await wait(() => window.coman.state.faults[0]);
  check(true, 'a click on a fault trips it');
  await picture('fault');

  // A frame that is sent is on the bus, and a board answers for it
  await page.click('#tab-panel-trace');
  await page.fill('#send-id', '001');
  await page.fill('#send-data', '7e');
  await page.click('#send');
  await wait(() => document.querySelector('.frames tr.ours'));
  await page.click('#step');
  await wait(() => window.coman.page.events.all.some(({ text }) => text.includes('unknown command 0x7e')));
  check(true, 'the frame that is sent reaches the bus and its board');
  await page.fill('#panel-trace input[type=search]', 'POSITION');
  await page.click('#pause');
  await wait(() => document.querySelector('.meaning')?.textContent.includes('_position'));
  check(true, 'frames are decoded by the names of the DBC',
    await page.evaluate(() => document.querySelector('.meaning').textContent));
  await picture('frames');

  // Signals by search
  await page.click('#tab-panel-plots');
  await page.fill('#signal-search', 'rknee torque');
  await page.press('#signal-search', 'Enter');
  await wait(() => document.querySelector('.chip b')?.textContent && document.querySelector('.plots canvas'));
  check(true, 'a signal is found and plotted');

  // A newcomer: a card with three things to try, each of which works, and which stays closed. The run is
  // paused, so that no tick is late now, whatever was before.
  await page.click('#pause');
  await wait(() => window.coman.state.paused);
  const fresh = await browser.newPage({ viewport: { width: 1280, height: 800 }, colorScheme: 'light', newcomer: true });
  fresh.on('pageerror', (error) => errors.push(error.message));
  await fresh.goto(`${run.page}&quality=low`);
  await fresh.waitForSelector('#welcome:not([hidden])');
  await fresh.waitForFunction(() => window.coman.page.scene?.firstDrawn > 0);
  if (folder) await fresh.screenshot({ path: join(folder, 'welcome.png') });
  const card = await fresh.textContent('#welcome');
  const late = await fresh.evaluate(() => document.getElementById('figure-overruns').classList.contains('late'));
  check(/COMAN.*task squat.*5 CAN buses.*\d+ boards/.test(card) && !late, 'the first picture says what it shows, and no alarm', card);
  await fresh.click('#welcome li:nth-child(1) button');
  await fresh.click('#welcome li:nth-child(2) button');
  await fresh.click('#welcome li:nth-child(3) button');
  const tried = await fresh.evaluate(() => ({ drag: window.coman.page.drag.mode,
    plots: document.querySelector('.plots').textContent.includes('q_RKneeSag_rad'),
    act: !document.getElementById('panel-actions').hidden }));
  check(tried.drag && tried.plots && tried.act, 'the three things to try work', tried);
  await fresh.click('#welcome button.main');
  await fresh.reload();
  await fresh.waitForFunction(() => window.coman?.page.pause);
  check(await fresh.isHidden('#welcome'), 'the card stays closed');
  await fresh.click('[aria-label=keys]');
  await fresh.click('.help button.plain');
  check(await fresh.isVisible('#welcome'), 'and opens from the list of keys');
  await fresh.setViewportSize({ width: 400, height: 640 });
  const covered = await fresh.evaluate(() => [...document.querySelectorAll('#welcome button')].filter((button) => {
    const { x, y, width, height } = button.getBoundingClientRect();
    return document.elementFromPoint(x + width / 2, y + height / 2) !== button;
  }).map((button) => button.textContent));
  check(covered.length === 0, 'a telephone shows the whole card', covered);
  await fresh.close();
  await page.click('#pause');

  // Who may look
  const look = await browser.newPage({ viewport: { width: 400, height: 700 } });
  await look.goto(`${run.page_view}&quality=low`);
  await look.waitForFunction(() => window.coman?.page.pause, null, { timeout: WAIT_MS });
  await look.waitForFunction(() => document.querySelector('.joints td'));
  const narrow = await look.evaluate(() => {
    const at = (name) => document.querySelector(name).getBoundingClientRect();
    return { robot: at('#view').bottom, buttons: Math.min(at('.toggles.left').top, at('.past').top),
      above: at('.toggles').bottom, top: at('#view').top };
  });
  check(narrow.robot <= narrow.buttons && narrow.above <= narrow.top, 'on a telephone no button covers the robot', narrow);
  const refused = await look.evaluate(async () => ({ disabled: window.coman.page.pause.disabled,
    push: await window.coman.link.ask('push', { body: 'Waist', force_n: [100, 0, 0] })
      .then(() => 'pushed', (error) => error.message) }));
  check(refused.disabled && refused.push.includes('look'), 'the right to look cannot push', refused);
  await look.close();

  // The end
  run.child.kill('SIGTERM');
  await page.waitForSelector('#ending:not([hidden])');
  await page.waitForFunction(() => /waits for the next run/.test(document.getElementById('ending').textContent));
  const gone = await page.textContent('#ending');
  check(/stopped/.test(gone) && !/null|undefined/.test(gone) && await page.isHidden('.gone'), 'a run that was stopped is said to be', gone);
  await picture('gone');
  check(errors.length === 0, 'the page has no errors', errors);
}

await test(TESTS, judge);
