// SPDX-License-Identifier: Apache-2.0
// The samples of signals by name, apart from any drawing: live rows are appended, what was before a
// signal was chosen is fetched from the server when somebody asks for it, memory is bounded.
//
// All signals share the times of their rows, so that columns of a range always fit each other; a
// value that is not known is NaN. Rows of one time come once: time that goes back, as after a reset,
// removes what it undoes.

const CHUNK = 4096; // rows
const PIECE = 4000; // rows of a fetch
const PIECE_BYTES = 240 << 10; // of a fetch; the server has room for some more
const MEMORY = 64 << 20; // bytes
const AGAIN_MS = 500; // after a fetch that has failed

/** Index of the first of sorted times that is at least time. */
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

/** Two points for each span of time: the least and the greatest value in it, the earlier one first.
 * Spans lie at multiples of their width, so that a curve that moves on keeps its shape. */
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
  #chosen = []; // names of the columns of live rows
  #known = new Map(); // by name: from when on its values are here
  #listeners = new Set();
  #fetching = false;
  #age = 0; // counts what makes answers that are under way stale

  /** signals: of the description, with name and unit. fetch(names, from_s, to_s): a promise of
   * {times, columns} with every row between those times, of at most PIECE rows; without it nothing
   * is known from before a signal is chosen. period_s: between rows. */
  constructor({ signals = [], fetch = null, period_s = 1e-3, bytes = MEMORY } = {}) {
    this.units = new Map(signals.map(({ name, unit }) => [name, unit]));
    this.fetch = fetch;
    this.period = period_s;
    this.limit = bytes;
  }

  // ---- what there is ----

  get chosen() {
    return this.#chosen;
  }

  /** Time of the oldest and of the newest row; NaN without any. */
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

  /** The newest value of a signal; NaN when there is none. */
  last(name) {
    const chunk = this.#chunks.at(-1);
    return chunk?.columns.get(name)?.[chunk.count - 1] ?? NaN;
  }

  /** Columns of signals between two times, one more row on either side so that a curve does not end
   * within a picture: {times: Float64Array, columns: [Float32Array], lost}, in the order of names;
   * lost: how many rows are missing among them, for which the server had no room. With
   * points, where there are more rows, the least and the greatest of some. What is not here yet is
   * fetched; listeners are told when it has come. */
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

  /** Calls changed() whenever rows have come or gone; returns a function that ends it. */
  listen(changed) {
    this.#listeners.add(changed);
    return () => this.#listeners.delete(changed);
  }

  #tell() {
    for (const changed of this.#listeners) changed();
  }

  // ---- live rows ----

  /** The signals that live rows have from now on, in their order. One that was left out before
   * begins anew; without any all is forgotten. after_s: the time of the last row before those rows,
   * null when there is none: what is up to there of signals that are new can be fetched. */
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

  /** Forgets all rows, as for another run. */
  clear() {
    this.#chunks = [];
    this.#known.clear();
    this.#age++;
    this.#tell();
  }

  /** Rows that follow those that there are, with the columns of choose(). */
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

  /** Removes rows of that time and later ones. */
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

  /** Drops the oldest rows beyond the memory. */
  #bound() {
    while (this.#chunks.length > 1 && this.bytes > this.limit) {
      this.#chunks.shift();
      for (const [name, from] of this.#known) this.#known.set(name, Math.max(from, this.from_s));
    }
  }

  // ---- rows from before ----

  /** Rows that are older than what is known of signals, all of them up to there. */
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

  /** Fetches what those signals were before, piece by piece, the newest first. */
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
      // Before the first row that the server has there is nothing to ask for
      const end = !(piece.times[0] < newest) || piece.times[0] > begin + 1.5 * this.period;
      for (const name of age === this.#age ? batch : []) {
        if (this.#known.has(name)) this.#known.set(name, end ? -Infinity : Math.min(newest, begin));
      }
    } catch {
      await new Promise((again) => { setTimeout(again, AGAIN_MS); }); // no connection, or no room in it
    } finally {
      this.#fetching = false;
    }
    this.#tell();
  }
}
