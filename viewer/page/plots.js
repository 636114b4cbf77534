// SPDX-License-Identifier: Apache-2.0
// Shows signals over virtual time in several plots, with one time axis and one cursor. The user
// finds signals by search, or drops them on a plot. The shown range can be saved.
import { cutTable } from './compare.js';
import { count, h, setText, short } from './dom.js';
import { nearest, Plot, SIGNALS_MOST } from './plot.js';
import { saveCurves, savePicture } from './plot_export.js';
import { describe } from './words.js';

const SPAN_S = 10; // span that is shown of a run
const KEPT_S = 600;
const POINTS = 4000; // maximum number of points of a curve
const PIECE = 8000; // maximum number of rows of a series
const PLOTS_MOST = 8;
const WATCHED_MOST = 64; // maximum number of signals that the server sends
const LISTED = 12;
const STEPS = 100; // cursor steps, by keys, over the width of a plot

/** Returns the default plots: angle and torque of the knees (without knees: of the two strongest
 * joints), and the first two contact forces. */
function firstPlots(hello) {
  const known = new Set(hello.signals.map(({ name }) => name));
  const weight = ({ name, torque_limit_nm: limit }) => /knee/i.test(name) ? Infinity : limit ?? 0;
  const order = (a, b) => Number(weight(b) > weight(a)) - Number(weight(b) < weight(a));
  const joints = hello.scene.joints.toSorted(order).slice(0, 2);
  const forces = hello.scene.contacts.slice(0, 2).map(({ name }) => `fz_${name}_n`);
  return [joints.map(({ name }) => `q_${name}_rad`), joints.map(({ name }) => `torque_${name}_nm`), forces]
    .map((names) => names.filter((name) => known.has(name))).filter(({ length }) => length);
}

export class Plots {
  #plots = [];
  #chosen = null; // the plot that receives signals from the search
  #order = []; // signal names, in the order of a state's values
  #span = SPAN_S; // span while the plots follow the run, s
  #range = null; // fixed range, s; null = the plots follow the run
  #cursor = null; // time of the cursor, s; null = none
  #pointed = null; // the plot under the pointer
  #data = { times: [], columns: new Map() };
  #table = null; // samples of the second recording
  #other = null; // its samples in the shown range
  #values = new Map(); // values of the newest state
  #asking = false;
  #stale = true;

  /** store: a SeriesStore that the link fills; null for a recording. */
  constructor(link, hello, complain, store) {
    this.link = link;
    this.hello = hello;
    this.complain = complain;
    this.replay = hello.run.replay;
    if (this.replay) this.#range = [this.replay.from_s, this.replay.to_s];
    this.units = new Map(hello.signals.map(({ name, unit }) => [name, unit]));
    this.described = new Map(hello.signals.map(({ name }) => [name, describe(name)]));
    this.store = store;
    store?.listen(() => { this.#stale = true; });
    this.compare = h('span');
    this.element = this.#build();
    this.#restore();
    link.addEventListener('watching', (event) => this.#watched(event.detail.signals));
  }

  // ---- elements of the panel ----

  #build() {
    this.found = h('ul', { class: 'found', role: 'listbox', id: 'signals-found' });
    this.search = h('input', { type: 'search', id: 'signal-search', autocomplete: 'off', role: 'combobox',
      'aria-controls': 'signals-found', 'aria-expanded': 'false', placeholder: 'Add a signal: knee torque…',
      'aria-label': 'search signals', oninput: () => this.#list(), onfocus: () => this.#list(),
      onblur: () => {
        if (!this.found.matches(':hover')) this.#clearFound();
      },
      onkeydown: (event) => this.#searchKey(event) });
    const button = (text, title, action, id) => h('button', { class: 'quiet', title, onclick: action, id }, text);
    this.back = button(this.replay ? 'All' : 'Live', this.replay ? 'the whole recording: Esc' : 'back to now: Esc',
      () => this.showAll(), 'plots-live');
    this.lack = h('span', { class: 'muted', id: 'rows-lost' });
    this.time = h('output', { class: 'mono cursor', 'aria-live': 'off' });
    this.grid = h('div', { class: 'plotgrid' });
    return h('section', { class: 'panel plots', id: 'panel-plots' },
      h('div', { class: 'tools' }, h('div', { class: 'search' }, this.search, this.found),
        button('+ Plot', 'another plot beside', () => this.#addPlot(), 'plot-add'),
        h('span', { class: 'group' }, button('−', 'less in detail', () => this.zoom(2), 'plots-out'),
          button('+', 'more in detail', () => this.zoom(0.5), 'plots-in'), this.back),
        this.time, this.lack, h('span', { class: 'space' }), this.compare,
        button('CSV', 'save the samples that are shown', () => this.#saveCurves(), 'plots-csv'),
        button('PNG', 'save the plots as a picture', () => this.#savePicture(), 'plots-png')),
      this.grid);
  }

  numberOf(plot) {
    return this.#plots.indexOf(plot) + 1;
  }

  /** Restores the plots that this browser stored for this robot, or creates the default plots. */
  #restore() {
    let kept = null;
    try {
      kept = JSON.parse(localStorage.getItem(this.#key));
    } catch { /* the browser has no storage */ }
    const lists = Array.isArray(kept) && kept.every(Array.isArray) ? kept.slice(0, PLOTS_MOST)
      .map((names) => names.filter((name) => this.units.has(name)).slice(0, SIGNALS_MOST)) : firstPlots(this.hello);
    for (const names of lists.length ? lists : [[]]) this.#insert(names);
    this.choose(this.#plots[0]);
    this.#watch();
  }

  get #key() {
    return `plots ${this.hello.run.robot}`;
  }

  #keep() {
    try {
      localStorage.setItem(this.#key, JSON.stringify(this.#plots.map(({ names }) => names)));
    } catch { /* the browser has no storage */ }
  }

  #insert(names = []) {
    const plot = new Plot(this, names);
    this.#plots.push(plot);
    this.grid.append(plot.element);
    plot.showChosen(false);
    return plot;
  }

  #addPlot() {
    if (this.#plots.length === PLOTS_MOST) {
      this.complain(`There is room for ${PLOTS_MOST} plots: remove one first.`);
      return;
    }
    this.choose(this.#insert());
    this.#keep();
    this.#chosen.element.scrollIntoView({ block: 'nearest' });
    this.search.focus();
  }

  remove(plot) {
    if (this.#plots.length === 1) {
      plot.names = [];
      plot.changed();
    } else {
      const at = this.#plots.indexOf(plot);
      this.#plots.splice(at, 1);
      plot.element.remove();
      this.choose(this.#plots[Math.max(0, at - 1)]);
      this.#chosen.element.focus();
    }
    this.#changed();
  }

  /** Selects the plot that receives signals from the search. */
  choose(plot) {
    if (this.#chosen === plot) return;
    this.#chosen = plot;
    for (const other of this.#plots) other.showChosen(other === plot);
  }

  // ---- signals ----

  unitOf(name) {
    return this.units.get(name) || '–';
  }

  /** Lists the first signals whose names or descriptions have all words of the search. */
  #list() {
    const words = this.search.value.toLowerCase().split(/[\s_]+/).filter(Boolean);
    const names = this.hello.signals.map(({ name }) => name).filter((name) =>
      !this.#chosen.names.includes(name) && words.every((word) => this.described.get(name).includes(word)));
    this.found.replaceChildren(...names.slice(0, LISTED).map((name, i) => h('li', { role: 'option',
      'data-name': name, 'aria-selected': String(i === 0), id: `found-${i}`, draggable: true,
      onclick: () => this.add(name), ondragend: () => this.#clearFound(),
      ondragstart: (event) => {
        event.dataTransfer.setData('text/plain', name);
        event.dataTransfer.effectAllowed = 'copyMove';
      } }, name, h('span', { class: 'muted' }, this.units.get(name)))));
    if (!names.length) {
      this.found.replaceChildren(h('li', { class: 'muted none', role: 'status' },
        words.length ? `No signal has “${this.search.value.trim()}” in its name or description.`
          : 'All signals are in this plot.'));
    }
    this.#pick(0);
  }

  #clearFound() {
    this.found.replaceChildren();
    this.search.setAttribute('aria-expanded', 'false');
    this.search.removeAttribute('aria-activedescendant');
  }

  #pick(index) {
    const items = [...this.found.querySelectorAll('[role=option]')];
    this.picked = Math.min(Math.max(index, 0), items.length - 1);
    items.forEach((item, i) => item.setAttribute('aria-selected', String(i === this.picked)));
    this.search.setAttribute('aria-expanded', String(items.length > 0));
    if (items.length) this.search.setAttribute('aria-activedescendant', `found-${this.picked}`);
    items[this.picked]?.scrollIntoView({ block: 'nearest' });
  }

  #searchKey(event) {
    const way = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (way) {
      event.preventDefault();
      this.#pick(this.picked + way);
    } else if (event.key === 'Enter' && this.found.children[this.picked]?.dataset.name) {
      this.add(this.found.children[this.picked].dataset.name);
    } else if (event.key === 'Escape') {
      this.#clearFound();
      this.#chosen.element.focus();
    }
  }

  /** Adds signals to the chosen plot. */
  add(...names) {
    this.search.value = '';
    this.#clearFound();
    this.addTo(this.#chosen, names);
  }

  /** Adds signals to a plot; returns false if none was added. */
  addTo(plot, names) {
    const fresh = [...new Set(names)].filter((name) => this.units.has(name) && !plot.names.includes(name));
    const watched = new Set(this.#plots.flatMap((other) => other.names));
    const taken = [];
    for (const name of fresh) {
      if (plot.names.length + taken.length === SIGNALS_MOST || (!watched.has(name) && watched.size === WATCHED_MOST)) {
        this.complain(watched.size === WATCHED_MOST ? `All plots together hold ${WATCHED_MOST} signals: remove one first.`
          : `A plot holds ${SIGNALS_MOST} signals: remove one first, or add a plot.`);
        break;
      }
      watched.add(name);
      taken.push(name);
    }
    if (!taken.length) return false;
    plot.names = [...plot.names, ...taken];
    plot.changed();
    this.#changed();
    return true;
  }

  /** Removes a signal from a plot. */
  drop(plot, name) {
    plot.names = plot.names.filter((other) => other !== name);
    plot.changed();
    this.#changed();
  }

  /** Moves a signal to the next (1) or previous (-1) plot. */
  move(plot, name, way) {
    const to = this.#plots[this.#plots.indexOf(plot) + way];
    if (!to || (!to.names.includes(name) && !this.addTo(to, [name]))) return;
    this.drop(plot, name);
    [...to.chips.children].find((chip) => chip.children[1].textContent === name)?.focus();
  }

  #changed() {
    this.#keep();
    this.#watch();
  }

  #watch() {
    this.link.watch({ signals: [...new Set(this.#plots.flatMap(({ names }) => names))] });
    this.#stale = true;
  }

  #watched(names) {
    this.#order = names;
    if (this.replay) this.#fetch();
  }

  // ---- time ----

  /** Returns the shown range: [from, to], s. */
  get range() {
    if (this.#range) return this.#range;
    const now = this.#now;
    const from = Math.max(0, now - this.#span);
    return [from, Math.max(now, from + Math.min(this.#span, 1))];
  }

  /** Returns the time of a run's newest sample, s. */
  get #now() {
    return this.store?.to_s || this.newest || 0;
  }

  /** Returns the range of available samples: [from, to], s. */
  get #limits() {
    const now = this.#now;
    return this.replay ? [this.replay.from_s, this.replay.to_s] : [Math.max(0, now - KEPT_S), now];
  }

  /** Returns the shortest range that can be shown, s: a few rows. */
  get #least() {
    return 5 * (this.replay?.period_s ?? this.hello.run.tick_s);
  }

  /** Shows a range. A range beyond the samples is moved and shortened. */
  show(from, to) {
    const [first, last] = this.#limits;
    const width = Math.max(Math.min(to - from, last - first), this.#least);
    const begin = Math.max(Math.min((from + to - width) / 2, last - width), first);
    this.#range = [begin, begin + width];
    this.redraw();
  }

  /** Follows the run again, or shows the whole recording. */
  showAll() {
    for (const plot of this.#plots) plot.unzoom();
    this.#span = SPAN_S;
    this.#range = this.replay ? [this.replay.from_s, this.replay.to_s] : null;
    this.redraw();
  }

  /** Multiplies the shown span by factor. at: the fixed point, as a share of the width. */
  zoom(factor, at = 0.5) {
    const [from, to] = this.range;
    if (!this.#range) { // the newest sample stays at the edge
      this.#span = Math.min(Math.max(this.#span * factor, this.#least), KEPT_S);
      this.redraw();
      return;
    }
    this.show(from + at * (to - from) * (1 - factor), to - (1 - at) * (to - from) * (1 - factor));
  }

  /** Moves the shown range by a share of its width. */
  pan(part) {
    const [from, to] = this.range;
    const by = part * (to - from);
    this.show(from + by, to + by);
  }

  /** Zooms with two fingers that move from `before` to `after`, as shares of the width. */
  stretch(before, after) {
    const [from, to] = this.range;
    const factor = (before[0] - before[1]) / (after[0] - after[1]);
    if (!(factor > 0.01 && factor < 100)) return;
    const begin = from + (before[0] - after[0] * factor) * (to - from);
    this.show(begin, begin + factor * (to - from));
  }

  redraw() {
    this.#stale = true;
    if (this.replay) this.#fetch();
    this.back.disabled = !this.replay && !this.#range;
    this.render();
  }

  // ---- the cursor ----

  /** Moves the cursor to the pointer's time in a plot; null = the pointer has left the plot. */
  pointAt(plot, time) {
    if (time === null && this.#pointed !== plot) return;
    this.#pointed = time === null ? null : plot;
    this.#cursor = time;
    for (const other of this.#plots) {
      if (other !== plot) other.showCursor(time);
    }
    this.#tell();
  }

  /** Moves the cursor by one of STEPS: 1 = right, -1 = left. */
  moveCursor(way) {
    const [from, to] = this.range;
    const step = (to - from) / STEPS;
    this.#pointed = null;
    this.#cursor = Math.min(Math.max((this.#cursor ?? (from + to) / 2) + way * step, from), to);
    for (const plot of this.#plots) plot.showCursor(this.#cursor);
    this.#tell();
  }

  /** Shows the values at the cursor; without a cursor, the newest values. */
  #tell() {
    const at = ({ times, columns }, time) => {
      const row = nearest(times, time);
      return new Map(times.length ? [...columns].map(([name, column]) => [name, column[row]]) : []);
    };
    const values = this.#cursor === null ? this.#values : at(this.#data, this.#cursor);
    const others = this.#other && at(this.#other, this.#cursor ?? this.newest ?? 0);
    for (const plot of this.#plots) plot.tell(values, others);
    setText(this.time, this.#cursor === null ? '' : `${short(this.#cursor)} s`);
  }

  // ---- samples ----

  take(state) {
    this.newest = state.time;
    this.#values = new Map(this.#order.map((name, k) => [name, state.signals[k]]));
  }

  #columnsOf(names, { times, columns }) {
    return { times, columns: new Map(names.map((name, k) => [name, columns[k]])) };
  }

  /** Requests the shown range of a recording. During a request, only the last of later ranges
   * counts. */
  async #fetch() {
    if (this.#asking || !this.#order.length) return;
    this.#asking = true;
    let done = null;
    while (this.#order.length && done !== `${this.#range} ${this.#order}`) {
      const names = this.#order;
      const [from, to] = this.#range;
      done = `${this.#range} ${names}`;
      try {
        this.#data = this.#columnsOf(names, await this.link.ask('series',
          { signals: names, from_s: from, to_s: to, points: POINTS }));
      } catch (error) {
        this.complain(error.message);
      }
      this.#stale = true;
    }
    this.#asking = false;
    this.render();
  }

  /** Sets the table of the second recording; null = none. */
  compareWith(table) {
    this.#table = table;
    this.#stale = true;
    this.render();
  }

  setTheme() {
    for (const plot of this.#plots) plot.setTheme();
    this.#stale = true;
  }

  render() {
    if (!this.isOpen) return;
    if (this.#stale) {
      this.#stale = false;
      const range = this.range;
      if (!this.replay) {
        const found = this.store.range(this.#order, ...range, POINTS);
        this.#data = this.#columnsOf(this.#order, found);
        setText(this.lack, found.lost > 0 ? `${count(found.lost)} ticks are missing` : '');
      }
      this.#other = this.#table && cutTable(this.#table, this.#order, ...range, POINTS);
      for (const plot of this.#plots) plot.draw(this.#data, this.#other, range);
      if (this.#cursor !== null) {
        for (const plot of this.#plots) {
          if (plot !== this.#pointed) plot.showCursor(this.#cursor);
        }
      }
    }
    for (const plot of this.#plots) plot.showMoment(this.replay ? this.newest : null);
    this.#tell();
  }

  // ---- saving ----

  /** Returns every row of the signals between two times. A recording is read in pieces that fit
   * into a message. */
  async #read(names, from, to) {
    if (!this.replay) return this.store.range(names, from, to);
    const series = await this.link.ask('series', { signals: names, from_s: from, to_s: to, points: PIECE });
    if (series.rows === series.times.length) return series;
    const middle = (from + to) / 2;
    const [a, b] = [await this.#read(names, from, middle), await this.#read(names, middle, to)];
    const last = a.times.at(-1) ?? -Infinity;
    const skip = b.times.findIndex((time) => time > last);
    const rest = skip < 0 ? b.times.length : skip;
    return { times: [...a.times, ...b.times.subarray(rest)],
      columns: names.map((_, k) => [...a.columns[k], ...b.columns[k].slice(rest)]) };
  }

  /** Returns the stored samples of the plotted signals between two times of a run. */
  samples(from, to) {
    return { names: this.#order, curves: this.store.range(this.#order, from, to) };
  }

  async #saveCurves() {
    const names = [...new Set(this.#plots.flatMap((plot) => plot.names))];
    const [from, to] = this.range;
    try {
      const curves = await this.#read(names, from, to);
      saveCurves(`${this.hello.run.rig}.csv`, names, curves, from, to);
      if (this.#table) {
        const { times, columns } = cutTable(this.#table, names, from, to, Infinity);
        saveCurves(`${this.hello.run.rig}-compared.csv`, [...columns.keys()],
          { times, columns: [...columns.values()] }, from, to);
      }
    } catch (error) {
      this.complain(error.message);
    }
  }

  #savePicture() {
    savePicture(`${this.hello.run.rig}-plots.png`, this.grid, this.#plots);
  }
}
