// SPDX-License-Identifier: Apache-2.0
// usage: node page_end.mjs COMAN-HIL [FOLDER]
// The page over the end of a run and into the next one, in a headless Chromium: long frames, the key
// help, the history of signals, the floor, sizes on a telephone; how the run ended, its files; that
// the same page shows the next run. Prints TAP; pictures go to FOLDER.
import { connect } from 'node:net';
import { join } from 'node:path';
import { begin, check, test, WAIT_MS } from './browser.mjs';

const [program, folder] = process.argv.slice(2);
const source = process.env.HIL_SOURCE_DIR;
const TESTS = 20;
const TOUCH_PX = 44;
const TICKS = 20000; // of the first run, which is paused at once and driven by the page: a slow browser misses nothing

async function start(work, name, ...words) {
  const { child, page } = await begin(work, program, ['run', join(source, 'config/rigs/coman-fd.yaml'), '--transport', 'local',
    '--control', join(work, name), '--quiet', ...words], { cwd: work, env: { ...process.env, XDG_STATE_HOME: join(work, 'state') } });
  await new Promise((resolve, reject) => {
    const control = connect(join(work, name), () => control.write('{"cmd": "pause"}\n'));
    control.once('data', resolve).once('error', reject);
  });
  return { child, address: page };
}

/** Runs so many ticks, not more at a time than the server's thread finds room for when it wakes late. */
const step = (page, count) => page.evaluate(async (ticks) => {
  const end = window.coman.state.time + ticks * window.coman.page.hello.run.tick_s;
  for (let left = ticks; left > 0; left -= 500) {
    const some = Math.min(left, 500);
    await window.coman.link.ask('step', { count: some });
    while (window.coman.state.time < end - (left - some) * 1e-3 - 1e-9) await new Promise((done) => { setTimeout(done, 20); });
  }
}, count);

/** Whether the program ends. */
function ended(child) {
  if (child.exitCode !== null) return Promise.resolve(child.exitCode);
  return new Promise((resolve) => {
    child.once('exit', (code) => resolve(code));
    setTimeout(() => resolve('still there'), WAIT_MS).unref();
  });
}

async function judgeTables(page, picture) {
  await page.keyboard.press('?');
  const help = await page.textContent('.help');
  check(!help.includes('[object') && /one tick/.test(help), 'the key help can be read', help);
  await picture('help');
  await page.click('.help button');

  await page.click('#tab-panel-trace');
  await page.waitForTimeout(300); // until frames are sent
  await step(page, 200);
  await page.waitForFunction(() => [...document.querySelectorAll('.frames .data')].some((cell) => cell.textContent.length > 100));
  const rows = await page.evaluate(() => [...document.querySelectorAll('.frames tbody tr')].map((row) => row.getBoundingClientRect().height));
  check(Math.max(...rows) <= 48 && Math.max(...rows) - Math.min(...rows) <= 1, 'rows of frames have one height', [Math.max(...rows), rows.length]);
  const edge = await page.evaluate(() => Math.max(...[...document.querySelectorAll('.frames th, .frames .meaning')]
    .map((cell) => cell.getBoundingClientRect().right)));
  check(edge <= 1400, 'their meaning is in the picture', edge);
  await picture('frames');
  await page.evaluate(() => [...document.querySelectorAll('.frames tbody tr')]
    .find((row) => row.querySelector('.data').textContent.length > 100).click());
  const open = await page.evaluate(() => {
    const cell = document.querySelector('.frames tr.open .data div');
    return cell.scrollHeight <= cell.clientHeight + 1;
  });
  check(open, 'a click shows all of a frame');

  await page.click('#tab-panel-parameters');
  await page.waitForSelector('.parameters tbody tr');
  const right = await page.evaluate(() => Math.max(...[...document.querySelectorAll('.parameters th, .parameters td')]
    .map((cell) => cell.getBoundingClientRect().right)));
  check(right <= 1400, 'all columns of the parameters are in the picture', right);
  await picture('parameters');
}

async function judgeHistory(page, picture) {
  await page.click('#tab-panel-plots');
  await page.waitForFunction(() => window.coman.state.time > 3);
  const clicked = await page.evaluate(() => window.coman.state.time);
  const add = async (words) => {
    await page.fill('#signal-search', words);
    await page.press('#signal-search', 'Enter');
  };
  const rows = (name) => page.evaluate(([signal, to]) => {
    const { times, columns } = window.coman.page.store.range([signal], 0, to);
    return times.filter((_, i) => !Number.isNaN(columns[0][i])).length;
  }, [name, clicked]);
  const whole = (name) => page.waitForFunction(([signal, to]) => {
    const { times, columns } = window.coman.page.store.range([signal], 0, to);
    return times.filter((_, i) => !Number.isNaN(columns[0][i])).length >= 1000 * to - 20;
  }, [name, clicked]);
  const watched = (name) => page.waitForFunction((signal) => window.coman.page.store.chosen.includes(signal), name);
  const [name, other] = ['q_RHipLat_rad', 'torque_RHipLat_nm'];
  await add('q rhiplat rad');
  await watched(name);
  await whole(name);
  check(true, 'a signal has every row from before the click', [name, await rows(name), clicked]);
  const kept = await rows(name);
  await add('torque rhiplat nm');
  await watched(other);
  check(await rows(name) === kept, 'a second one leaves it alone', kept);
  await whole(other);
  const before = await page.evaluate(() => window.coman.page.store.to_s);
  await step(page, 800);
  await page.waitForFunction((from) => window.coman.page.store.to_s > from + 0.7995, before);
  const live = await page.evaluate(([signal, from]) => {
    const { times, columns } = window.coman.page.store.range([signal], from + 5e-4, from + 0.8);
    return [times.length, columns[0].some(Number.isNaN)];
  }, [other, before]);
  check(live[0] >= 800 && live[0] <= 802 && !live[1], 'and a row comes for every tick', live);
  await picture('plots');
}

async function judgeFloor(page) {
  const off = await page.evaluate(() => {
    const { scene } = window.coman.page;
    const before = scene.controls.target.clone();
    scene.controls.target.set(103.3, -57.9, 0.8);
    scene.update(window.coman.state);
    scene.ground.updateMatrixWorld(true);
    const at = scene.floor.getWorldPosition(before.clone());
    const found = [at.x - scene.controls.target.x, at.y - scene.controls.target.y, at.x % 0.5, at.y % 0.5];
    scene.controls.target.copy(before);
    scene.update(window.coman.state);
    return found;
  });
  check(Math.hypot(off[0], off[1]) < 0.5 && Math.abs(off[2]) + Math.abs(off[3]) < 1e-6, 'the floor goes along', off);
}

async function judgeTelephone(browser, address, picture) {
  const phone = await browser.newPage({ viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true });
  await phone.goto(`${address}&quality=low`);
  await phone.waitForFunction(() => window.coman?.page.scene?.firstDrawn > 0, null, { timeout: WAIT_MS });
  const small = await phone.evaluate((least) => [...document.querySelectorAll('button, select, input[type=search]')]
    .filter((element) => element.offsetParent).map((element) => [element.textContent, element.getBoundingClientRect().height])
    .filter(([, height]) => height < least), TOUCH_PX);
  check(small.length === 0, 'on a telephone everything can be hit', small);
  const wide = await phone.evaluate(() => document.documentElement.scrollWidth);
  check(wide <= 390, 'and nothing is wider than it', wide);
  await picture('telephone', phone);
  return phone;
}

async function judgeEnd(page, phone, run, picture) {
  await page.evaluate(() => window.coman.link.ask('speed', { factor: 5 }).then(() => window.coman.link.ask('resume')));
  await page.waitForSelector('#ending:not([hidden])');
  const found = await page.evaluate(() => ({ gone: document.querySelector('.gone').hidden,
    text: document.getElementById('ending').textContent, live: document.getElementById('live').textContent,
    pause: Boolean(document.getElementById('pause').offsetParent) }));
  check(found.gone && /the task ended.*Task hold: held for 10/.test(found.text) && found.live === 'End' && !found.pause,
    'the page says how the run ended, and offers nothing that is over', found);
  await picture('end');
  const [file] = await Promise.all([page.waitForEvent('download'), page.click('.files a[download="signals.csv"]')]);
  const stream = await file.createReadStream();
  let data = '';
  for await (const part of stream) data += part;
  check(data.startsWith('time_s,') && data.split('\n').length > 100, 'the recording can be saved', data.length);
  await page.click('#tab-panel-joints');
  const angle = await page.textContent('.joints tbody td:nth-child(2)');
  check(/°/.test(angle), 'its tables are still there', angle);
  await phone.waitForSelector('#ending:not([hidden])');
  await picture('end-telephone', phone);
  const note = await phone.evaluate(() => {
    document.getElementById('tab-panel-trace').click();
    return document.querySelector('#panel-trace .tools .muted').textContent;
  });
  check(/while this panel is open/.test(note), 'a table of frames that was closed says why it is empty', note);
  await phone.close();
  check(run.child.exitCode === null, 'the program waits');
}

async function judge(browser, work) {
  const run = await start(work, 'one', '--clock', 'real', '--task', 'hold', '--ticks', String(TICKS),
    '--record', join(work, 'recording'));
  const page = await browser.newPage({ viewport: { width: 1400, height: 900 }, colorScheme: 'dark' });
  const errors = [];
  const picture = (name, of = page) => folder && of.screenshot({ path: join(folder, `${name}.png`) });
  page.setDefaultTimeout(3 * WAIT_MS);
  page.on('pageerror', (error) => errors.push(error.message));
  await page.goto(`${run.address}&quality=low`);
  await page.waitForFunction(() => window.coman?.page.scene?.firstDrawn > 0);
  await page.evaluate(() => { window.coman.page.scene.period = 500; }); // it moves little
  await step(page, 3000);
  await judgeTables(page, picture);
  await judgeHistory(page, picture);
  await judgeFloor(page);
  const phone = await judgeTelephone(browser, run.address, picture);
  await judgeEnd(page, phone, run, picture);

  // The program goes, the page stays, and shows the next run
  run.child.kill('SIGTERM');
  check(await ended(run.child) === 0, 'until it is told to end');
  await page.waitForFunction(() => /waits for the next run/.test(document.getElementById('ending').textContent));
  const first = await page.evaluate(() => window.coman.page.hello.run.id);
  const next = await start(work, 'two', '--clock', 'lockstep');
  await page.waitForFunction((id) => window.coman?.page.hello && window.coman.page.hello.run.id !== id && window.coman.state, first);
  check(next.address === run.address, 'the same page shows the next run', next.address.replace(/=.*/, ''));

  // One that dies is lost
  next.child.kill('SIGKILL');
  await page.waitForSelector('.gone:not([hidden])');
  const lost = await page.evaluate(() => [document.getElementById('live').textContent, document.getElementById('pause').disabled,
    document.querySelector('.gone').textContent]);
  check(lost[1] && /connection/.test(lost[2]), 'a run that dies is said to be out of reach', lost);
  await picture('lost');
  check(errors.length === 0, 'the page has no errors', errors);
}

await test(TESTS, judge);
