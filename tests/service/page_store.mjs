// SPDX-License-Identifier: Apache-2.0
// usage: node page_store.mjs
// The page's store of samples against a plain table: live rows, time that goes back, what was before
// a signal was chosen, bounds; and the width of an axis. Prints TAP.
import { join } from 'node:path';
import { check } from './browser.mjs';

const { SeriesStore } = await import(join(process.env.HIL_SOURCE_DIR, 'viewer/page/series_store.js'));
const { axisWidth } = await import(join(process.env.HIL_SOURCE_DIR, 'viewer/page/dom.js'));

const NAMES = ['a', 'b', 'c'];
const valueOf = (name, tick, life) => Math.fround(1000 * NAMES.indexOf(name) + tick % 977 + 0.25 * life);
const timeOf = (tick) => tick * 1e6 * 1e-9;

/** A server: what it has sent and keeps, by tick. */
class Server {
  rows = []; // {tick, life}
  life = 0;
  asked = 0;
  most = 0;

  run(store, count) {
    const begin = (this.rows.at(-1)?.tick ?? -1) + 1;
    const ticks = Array.from({ length: count }, (_, i) => begin + i);
    for (const tick of ticks) this.rows.push({ tick, life: this.life });
    if (!store.chosen.length) return;
    store.append(Float64Array.from(ticks, timeOf),
      store.chosen.map((name) => Float32Array.from(ticks, (tick) => valueOf(name, tick, this.life))));
  }

  restore(tick) {
    this.rows = this.rows.filter((row) => row.tick < tick);
    this.life++;
  }

  get after() {
    return this.rows.length ? timeOf(this.rows.at(-1).tick) : null;
  }

  /** With a row more on either side, as the server gives them. */
  async fetch(names, from, to) {
    const inside = this.rows.map(({ tick }) => timeOf(tick) >= from - 1e-9 && timeOf(tick) <= to + 1e-9);
    const rows = this.rows.slice(Math.max(0, inside.indexOf(true) - 1), inside.lastIndexOf(true) + 2);
    this.asked++;
    this.most = Math.max(this.most, rows.length);
    return { times: Float64Array.from(rows, ({ tick }) => timeOf(tick)),
      columns: names.map((name) => Float32Array.from(rows, ({ tick, life }) => valueOf(name, tick, life))) };
  }
}

/** Looks at a range until nothing more comes. */
async function settled(store, names, from, to) {
  for (let before = -1, now = 0; ; before = now) {
    const found = store.range(names, from, to);
    await new Promise((resolve) => { setTimeout(resolve, 0); });
    now = found.columns.reduce((sum, column) => sum + column.filter((v) => !Number.isNaN(v)).length, 0);
    if (now === before) return found;
  }
}

/** Whether a range is what the server's table has. */
function agrees(server, names, found, from, to) {
  const rows = server.rows.filter(({ tick }) => timeOf(tick) >= from && timeOf(tick) <= to);
  const inside = [...found.times.keys()].filter((i) => found.times[i] >= from && found.times[i] <= to);
  return rows.length === inside.length && rows.every(({ tick, life }, r) =>
    found.times[inside[r]] === timeOf(tick)
    && names.every((name, k) => found.columns[k][inside[r]] === valueOf(name, tick, life)));
}

console.log('1..14');

const server = new Server();
const store = new SeriesStore({ signals: NAMES.map((name) => ({ name, unit: 'm' })),
  fetch: (...question) => server.fetch(...question) });
server.run(store, 9000); // nobody looks
store.choose(['a'], server.after);
check(agrees(server, ['a'], await settled(store, ['a'], 0, 20), 0, 20) && store.to_s === server.after,
  'what was before the choice comes while nothing runs', store.to_s);
for (let i = 0; i < 300; i++) server.run(store, 17);
const live = store.range(['a'], 9.5, 10.5);
check(agrees(server, ['a'], live, 9.5, 10.5), 'live rows are all there', live.times.length);
check(live.times[0] < 9.5 && live.times.at(-1) >= 10.5, 'a range has a row on either side');
check(agrees(server, ['a'], await settled(store, ['a'], 0, 20), 0, 20), 'and all of it stays',
  [server.asked, server.most]);
check(server.most <= 4000, 'in pieces of bounded size', server.most);

const before = store.range(['a'], 0, 20);
store.choose(['a', 'b'], server.after);
check(agrees(server, ['a', 'b'], await settled(store, ['a', 'b'], 0, 20), 0, 20), 'so does that of one more signal');
server.run(store, 100);
const after = store.range(['a', 'b'], 0, 20);
check(before.times.every((time, i) => after.times[i] === time && after.columns[0][i] === before.columns[0][i]),
  'a second signal leaves the first one\'s rows alone');
check(agrees(server, ['a', 'b'], await settled(store, ['a', 'b'], 0, 20), 0, 20), 'and gets its own past');

server.restore(12000);
for (let i = 0; i < 90; i++) server.run(store, 13);
check(agrees(server, ['b', 'a'], await settled(store, ['b', 'a'], 0, 20), 0, 20) && store.to_s < 13.2,
  'time that goes back removes what it undoes', store.to_s);

const few = store.range(['a'], 0, 13, 200);
const all = store.range(['a'], 0, 13);
check(few.times.length <= 260 && Math.max(...few.columns[0]) === Math.max(...all.columns[0])
  && Math.min(...few.columns[0]) === Math.min(...all.columns[0])
  && few.times.every((time, i) => i === 0 || time >= few.times[i - 1]), 'few points keep the peaks',
few.times.length);

const gap = new SeriesStore();
gap.choose(['a'], null);
for (const tick of [5, 9]) gap.append(Float64Array.of(timeOf(tick), timeOf(tick + 1)), [Float32Array.of(1, 2)]);
check(gap.range(['a'], 0, 1).lost === 2 && store.range(['a'], 0, 13).lost === 0, 'rows that are missing are counted');

const failing = new SeriesStore({ fetch: () => failing.asked++ ? server.fetch(['a'], 0, 1) : Promise.reject(new Error('no room')) });
failing.asked = 0;
failing.choose(['a'], 1);
failing.range(['a'], 0, 1);
await new Promise((told) => { failing.listen(told); });
failing.range(['a'], 0, 1);
await new Promise((told) => { failing.listen(told); });
check(agrees(server, ['a'], failing.range(['a'], 0, 1), 0, 1), 'a fetch that fails is done again', failing.asked);

const small = new SeriesStore({ bytes: 300000 });
const other = new Server();
small.choose(NAMES, other.after);
for (let i = 0; i < 50; i++) other.run(small, 1000);
check(small.bytes <= 300000 && small.to_s === timeOf(49999) && small.from_s > 30, 'memory is bounded: the oldest go',
  [small.bytes, small.from_s]);

check(axisWidth(null) === 52 && axisWidth([0, 10]) === 52 && axisWidth([-0.000001, 0]) >= 16 + 7 * '-1e-6'.length
  && axisWidth([0, -0.000012345]) > axisWidth([0, 12]) && axisWidth([null, '-123456.5']) >= 16 + 7 * 9,
  'an axis is as wide as its longest number', axisWidth([0, -0.000012345]));
