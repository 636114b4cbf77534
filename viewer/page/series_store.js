// SPDX-License-Identifier: Apache-2.0
// Stores the samples of signals by name, independent of any drawing. Live rows are appended. Rows
// from before a signal was chosen are fetched from the server when a range needs them. Memory is
// bounded.
//
// All signals share the times of their rows, so that all columns of a range have equal length.
// Unknown values are NaN. Each time has one row. If time goes back, for example after a reset, the
// rows from that time on are removed.

const CHUNK = 4096; // rows of a chunk of memory
const PIECE = 4000; // maximum number of rows of a fetch
const PIECE_BYTES = 240 << 10; // maximum size of a fetch, a little below the server's limit
const MEMORY = 64 << 20; // default memory limit, bytes
const AGAIN_MS = 500; // delay after a failed fetch

/** Returns the index of the first of sorted times that is at least `time`. */
function lowerBound(times, count, time) {
  let low = 0;
  let high = count;
  while (low < high) {
    const middle = low + high >> 1;
    if (times[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low;
}

class Chunk {
  constructor(room) {
    this.times = new Float64Array(room);
    this.count = 0;
    this.columns = new Map();
  }

  get bytes() {
    return this.times.length * (8 + 4 * this.columns.size);
  }

  column(name) {
    let column = this.columns.get(name);
    if (!column) this.columns.set(name, column = new Float32Array(this.times.length).fill(NaN));
    return column;
  }
}

/** Reduces samples to two points per time span: the minimum and the maximum, in time order. Spans
 * begin at multiples of their width, so that a scrolling curve keeps its shape. */
function reduce({ times, columns }, points) {
  const count = times.length;
  const least = 2 * (times[count - 1] - times[0]) / points;
  const width = 2 ** Math.ceil(Math.log2(least));
  const starts = [];
  for (let i = 0, last = NaN; i < count; i++) {
    const span = Math.floor(times[i] / width);
    if (span !== last) starts.push(i);
    last = span;
  }
  const made = { times: new Float64Array(2 * starts.length),
    columns: columns.map(() => new Float32Array(2 * starts.length)) };
  starts.forEach((begin, k) => {
    const end = starts[k + 1] ?? count;
    made.times[2 * k] = times[begin];
    made.times[2 * k + 1] = times[begin + end >> 1];
    columns.forEach((column, c) => {
      let low = begin;
      let high = begin;
      for (let i = begin + 1; i < end; i++) {
        if (column[i] < column[low] || Number.isNaN(column[low])) low = i;
        if (column[i] > column[high] || Number.isNaN(column[high])) high = i;
      }
      made.columns[c][2 * k] = column[Math.min(low, high)];
      made.columns[c][2 * k + 1] = column[Math.max(low, high)];
    });
  });
  return made;
}

export class SeriesStore {
  #chunks = [];
  #chosen = []; // names of the live rows' columns
  #known = new Map(); // time of the first stored value, by signal name
  #listeners = new Set();
  #fetching = false;
  #age = 0; // incremented when outstanding answers become stale

  /** signals: name and unit of each signal. fetch(names, from_s, to_s): returns a promise of
   * {times, columns} with every row between the times, at most PIECE rows; null: no earlier rows.
   * period_s: time between rows. bytes: memory limit. */
  constructor({ signals = [], fetch = null, period_s = 1e-3, bytes = MEMORY } = {}) {
    this.units = new Map(signals.map(({ name, unit }) => [name, unit]));
    this.fetch = fetch;
    this.period = period_s;
    this.limit = bytes;
  }

  // ---- reading ----

  get chosen() {
    return this.#chosen;
  }

  /** Time of the oldest row (from_s) and of the newest row (to_s), s; NaN without rows. */
  get from_s() {
    return this.#chunks[0]?.times[0] ?? NaN;
  }

  get to_s() {
    const last = this.#chunks.at(-1);
    return last ? last.times[last.count - 1] : NaN;
  }

  get bytes() {
    return this.#chunks.reduce((sum, chunk) => sum + chunk.bytes, 0);
  }

  /** Returns the newest value of a signal; NaN if there is none. */
  last(name) {
    const chunk = this.#chunks.at(-1);
    return chunk?.columns.get(name)?.[chunk.count - 1] ?? NaN;
  }

  /** Returns the rows between two times, plus one row on each side so that curves reach the edges:
   * {times: Float64Array, columns: [Float32Array], lost}, columns in the order of names. lost:
   * number of rows that the server dropped. If there are more rows than `points`, returns the
   * minimum and maximum of time spans. Missing values are fetched; listeners are called when they
   * arrive. */
  range(names, from_s, to_s, points = Infinity) {
    const parts = [];
    let count = 0;
    this.#chunks.forEach((chunk, i) => {
      let begin = lowerBound(chunk.times, chunk.count, from_s);
      let end = lowerBound(chunk.times, chunk.count, to_s) + 1;
      const next = this.#chunks[i + 1];
      if (begin === chunk.count && (!next || next.times[0] < from_s)) return;
      begin = Math.max(0, begin - 1);
      end = Math.min(chunk.count, end);
      const before = this.#chunks[i - 1];
      if (before && before.times[before.count - 1] > to_s) return;
      parts.push({ chunk, begin, end });
      count += end - begin;
    });
    const found = { times: new Float64Array(count),
      columns: names.map(() => new Float32Array(count).fill(NaN)) };
    let at = 0;
    for (const { chunk, begin, end } of parts) {
      found.times.set(chunk.times.subarray(begin, end), at);
      names.forEach((name, k) => {
        const column = chunk.columns.get(name);
        if (column) found.columns[k].set(column.subarray(begin, end), at);
      });
      at += end - begin;
    }
    this.#fetchBefore(names, from_s);
    const lost = count ? Math.round((found.times[count - 1] - found.times[0]) / this.period) + 1 - count : 0;
    return { ...count > points ? reduce(found, points) : found, lost };
  }

  /** Calls changed() after each change of the rows. Returns a function that stops the calls. */
  listen(changed) {
    this.#listeners.add(changed);
    return () => this.#listeners.delete(changed);
  }

  #tell() {
    for (const changed of this.#listeners) changed();
  }

  // ---- live rows ----

  /** Sets the signals of the live rows from now on, in the order of their columns. Forgets the
   * samples of other signals; without names, clears the store. after_s: time of the last row
   * before the new live rows, null = none. Earlier values of new signals can be fetched up to
   * after_s. */
  choose(names, after_s = null) {
    for (const name of this.#known.keys()) {
      if (!names.includes(name)) this.#forget(name);
    }
    this.#chosen = [...names];
    for (const name of names) {
      if (!this.#known.has(name)) this.#known.set(name, after_s === null ? -Infinity : after_s + this.period / 2);
    }
    if (!names.length) this.clear();
    this.#tell();
  }

  #forget(name) {
    this.#known.delete(name);
    for (const chunk of this.#chunks) chunk.columns.delete(name);
  }

  /** Removes all rows, for example before another run. */
  clear() {
    this.#chunks = [];
    this.#known.clear();
    this.#age++;
    this.#tell();
  }

  /** Appends rows with the columns of choose(). */
  append(times, columns) {
    if (!times.length) return;
    if (times[0] <= this.to_s) this.#cut(times[0]);
    for (let at = 0; at < times.length;) {
      let chunk = this.#chunks.at(-1);
      if (!chunk || chunk.count === chunk.times.length) this.#chunks.push(chunk = new Chunk(CHUNK));
      const count = Math.min(chunk.times.length - chunk.count, times.length - at);
      chunk.times.set(times.subarray(at, at + count), chunk.count);
      this.#chosen.forEach((name, k) => {
        chunk.column(name).set(columns[k].subarray(at, at + count), chunk.count);
      });
      chunk.count += count;
      at += count;
    }
    this.#bound();
    this.#tell();
  }

  /** Removes the rows at and after a time. */
  #cut(time) {
    this.#age++;
    while (this.#chunks.length && this.#chunks.at(-1).times[0] >= time) this.#chunks.pop();
    const last = this.#chunks.at(-1);
    if (last) {
      last.count = lowerBound(last.times, last.count, time);
      for (const column of last.columns.values()) column.fill(NaN, last.count);
    }
    for (const [name, from] of this.#known) this.#known.set(name, Math.min(from, time));
  }

  /** Removes the oldest rows that exceed the memory limit. */
  #bound() {
    while (this.#chunks.length > 1 && this.bytes > this.limit) {
      this.#chunks.shift();
      for (const [name, from] of this.#known) this.#known.set(name, Math.max(from, this.from_s));
    }
  }

  // ---- earlier rows ----

  /** Stores fetched rows of signals, up to to_s, the first known value of these signals. */
  #fill(names, { times, columns }, to_s) {
    const kept = [...names.keys()].filter((k) => this.#known.has(names[k]));
    const fresh = lowerBound(times, times.length, this.#chunks.length ? this.from_s : to_s);
    let chunk = 0;
    let at = 0;
    for (let i = fresh; i < times.length && chunk < this.#chunks.length; i++) {
      while (chunk < this.#chunks.length && this.#chunks[chunk].times[at] < times[i]) {
        if (++at >= this.#chunks[chunk].count) {
          chunk++;
          at = 0;
        }
      }
      if (this.#chunks[chunk]?.times[at] !== times[i]) continue;
      for (const k of kept) this.#chunks[chunk].column(names[k])[at] = columns[k][i];
    }
    if (fresh > 0) {
      const older = new Chunk(fresh);
      older.times.set(times.subarray(0, fresh));
      older.count = fresh;
      for (const k of kept) older.column(names[k]).set(columns[k].subarray(0, fresh));
      this.#chunks.unshift(older);
    }
  }

  /** Fetches earlier values of signals in pieces, the newest piece first. */
  async #fetchBefore(names, from_s) {
    const late = names.filter((name) => this.#known.get(name) > from_s);
    if (!this.fetch || this.#fetching || !late.length) return;
    const newest = Math.max(...late.map((name) => this.#known.get(name)));
    const batch = late.filter((name) => this.#known.get(name) === newest);
    const rows = Math.floor(Math.min(PIECE, PIECE_BYTES / (8 + 4 * batch.length)));
    const begin = Math.max(from_s, newest - (rows - 4) * this.period);
    if (newest <= this.from_s && this.bytes + rows * (8 + 4 * batch.length) > this.limit) return;
    const age = this.#age;
    this.#fetching = true;
    try {
      const piece = await this.fetch(batch, begin, newest);
      if (age === this.#age) this.#fill(batch, piece, newest);
      // The server has no earlier rows: mark the signals as complete
      const end = !(piece.times[0] < newest) || piece.times[0] > begin + 1.5 * this.period;
      for (const name of age === this.#age ? batch : []) {
        if (this.#known.has(name)) this.#known.set(name, end ? -Infinity : Math.min(newest, begin));
      }
    } catch {
      await new Promise((again) => { setTimeout(again, AGAIN_MS); }); // no connection or busy
    } finally {
      this.#fetching = false;
    }
    this.#tell();
  }
}
