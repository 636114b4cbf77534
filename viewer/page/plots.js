// SPDX-License-Identifier: Apache-2.0
// Plots of signals against virtual time, chosen by search; one axis a unit.
import uPlot from 'uplot';
import { h, setText, short } from './dom.js';

const SPAN_S = 10;
const POINTS = 4000; // of a series
const MOST = 12;
const COLORS = ['#2f81f7', '#e0552b', '#2f9e6e', '#b05cd6', '#d9a514', '#12a5b5', '#d6336c',
  '#7a8b2b', '#6b6ff2', '#a0622d', '#4aa3ff', '#8a94a3'];

export class Plots {
  #chosen = [];
  #order = [];
  #plot = null;
  #layout = '';
  #range = null; // of a recording: what is shown of it
  #series = null;
  #values = null; // of the newest state

  constructor(link, hello, complain, store) {
    this.link = link;
    this.store = store;
    this.hello = hello;
    this.complain = complain;
    this.replay = hello.run.replay;
    if (this.replay) this.#range = [this.replay.from_s, this.replay.to_s];
    this.units = new Map(hello.signals.map(({ name, unit }) => [name, unit]));
    this.element = this.#build();
    link.addEventListener('watching', (event) => {
      this.#order = event.detail;
      if (this.replay) this.#fetch();
    });
    this.store.listen(() => { this.stale = true; });
    new ResizeObserver(() => this.#size()).observe(this.stage);
  }

  #build() {
    this.found = h('ul', { class: 'found', role: 'listbox' });
    this.search = h('input', { type: 'search', id: 'signal-search', autocomplete: 'off',
      placeholder: 'Add a signal: knee torque…', 'aria-label': 'search signals',
      oninput: () => this.#list(), onfocus: () => this.#list(),
      onblur: () => setTimeout(() => this.found.replaceChildren(), 150),
      onkeydown: (event) => {
        if (event.key === 'Enter' && this.found.firstChild) this.add(this.found.firstChild.dataset.name);
        if (event.key === 'Escape') this.search.blur();
      } });
    this.chips = h('div', { class: 'chips' });
    this.stage = h('div', { class: 'stage' });
    this.empty = h('p', { class: 'empty' }, 'Type a few letters of a joint, a force or a bus. Press / to begin.');
    this.now = h('i', { class: 'now', hidden: true });
    this.stage.append(this.empty);
    return h('section', { class: 'panel plots', id: 'panel-plots' },
      h('div', { class: 'tools' }, h('div', { class: 'search' }, this.search, this.found), this.chips),
      this.stage);
  }

  /** Signals whose names have all the words, the shorter ones first. */
  #list() {
    const words = this.search.value.toLowerCase().split(/[\s_]+/).filter(Boolean);
    const names = this.hello.signals.map(({ name }) => name).filter((name) =>
      !this.#chosen.includes(name) && words.every((word) => name.toLowerCase().includes(word)));
    this.found.replaceChildren(...names.slice(0, 12).map((name) => h('li', { role: 'option',
      'data-name': name, onmousedown: () => this.add(name) }, name,
    h('span', { class: 'muted' }, this.units.get(name)))));
    for (const item of this.found.children) item.dataset.name = item.firstChild.data;
  }

  add(...names) {
    for (const name of names) {
      if (!this.units.has(name) || this.#chosen.includes(name)) continue;
      if (this.#chosen.length === MOST) {
        this.complain(`A plot holds ${MOST} signals: remove one first.`);
        break;
      }
      this.#chosen.push(name);
    }
    this.search.value = '';
    this.found.replaceChildren();
    this.#choose();
  }

  remove(name) {
    this.#chosen = this.#chosen.filter((other) => other !== name);
    this.#choose();
  }

  #choose() {
    this.link.watch({ signals: this.#chosen });
    this.chips.replaceChildren(...this.#chosen.map((name, i) => h('button', { class: 'chip',
      title: 'remove', onclick: () => this.remove(name) },
    h('i', { style: '' }), h('span', {}, name), h('b', { class: 'mono' }), h('em', {}, '×'))));
    [...this.chips.children].forEach((chip, i) => {
      chip.firstChild.style.background = COLORS[i % COLORS.length];
    });
    this.empty.hidden = this.#chosen.length > 0;
  }

  // ---- of a recording: every row between two times ----

  /** Shows a part of the recording; without one, all of it. */
  zoom(from, to) {
    const { from_s: first, to_s: last, period_s: period } = this.replay;
    const middle = (from + to) / 2;
    const half = Math.max((to - from) / 2, 5 * period);
    this.#range = from === undefined ? [first, last]
      : [Math.max(first, middle - half), Math.min(last, middle + half)];
    this.#fetch();
  }

  async #fetch() {
    const signals = this.#order;
    const [from, to] = this.#range;
    if (!signals.length) return;
    try {
      const series = await this.link.ask('series', { signals, from_s: from, to_s: to, points: POINTS });
      if (signals !== this.#order || from !== this.#range[0] || to !== this.#range[1]) return;
      this.#series = series;
      this.stale = true;
    } catch (error) {
      this.complain(error.message);
    }
  }

  /** A drag chooses a part, a click a moment, a double click all. */
  #makeHooks() {
    let dragged = false;
    return { setSelect: [(plot) => {
      const { left, width } = plot.select;
      dragged = width > 4;
      if (dragged) this.zoom(plot.posToVal(left, 'x'), plot.posToVal(left + width, 'x'));
      plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    }], ready: [(plot) => {
      plot.over.append(this.now);
      plot.over.addEventListener('dblclick', () => this.zoom());
      plot.over.addEventListener('click', (event) => {
        const box = plot.over.getBoundingClientRect();
        if (!dragged) this.seek?.(plot.posToVal(event.clientX - box.left, 'x'));
        dragged = false;
      });
    }] };
  }

  /** The moment that is shown, as a line. */
  #placeNow(time) {
    const [from, to] = this.#range;
    this.now.hidden = !this.#series || time < from || time > to;
    if (!this.now.hidden) this.now.style.left = `${this.#plot.valToPos(time, 'x')}px`;
    [...this.chips.children].forEach((chip, k) => setText(chip.querySelector('b'), short(this.#values?.[k] ?? NaN)));
  }

  // ---- of a run: what has come ----

  take(state) {
    this.#values = state.signals;
  }

  #make() {
    const style = getComputedStyle(document.documentElement);
    const text = style.getPropertyValue('--muted').trim();
    const grid = { stroke: style.getPropertyValue('--line').trim(), width: 1 };
    const units = [...new Set(this.#order.map((name) => this.units.get(name) || '–'))];
    this.#plot?.destroy();
    this.#plot = new uPlot({
      ...this.#box(),
      legend: { show: false },
      cursor: { drag: { x: Boolean(this.replay), y: false, setScale: false }, points: { size: 6 } },
      hooks: this.replay ? this.#makeHooks() : {},
      scales: { x: { time: false }, ...Object.fromEntries(units.map((unit) => [unit, {}])) },
      series: [{}, ...this.#order.map((name, i) => ({ label: name, width: 1.6,
        scale: this.units.get(name) || '–', stroke: COLORS[i % COLORS.length],
        points: { show: false } }))],
      axes: [{ stroke: text, grid, ticks: grid, values: (_, ticks) => ticks.map((t) => `${+t.toFixed(3)} s`) },
        ...units.map((unit, i) => ({ scale: unit, label: unit, side: i % 2 ? 1 : 3, stroke: text,
          size: 52, labelSize: 18, grid: i ? { show: false } : grid, ticks: grid,
          values: (_, ticks) => ticks.map((t) => +t.toPrecision(6)) }))],
    }, [[], ...this.#order.map(() => [])], this.stage);
    this.#plot.root.hidden = this.#order.length === 0;
  }

  #box() {
    const box = this.stage.getBoundingClientRect();
    return { width: Math.max(100, Math.floor(box.width)), height: Math.max(80, Math.floor(box.height)) };
  }

  #size() {
    this.#plot?.setSize(this.#box());
  }

  setTheme() {
    this.#layout = '';
    this.stale = true;
  }

  render(time) {
    const layout = this.#order.join();
    if (layout !== this.#layout) {
      this.#layout = layout;
      this.#make();
      this.stale = true;
    }
    if (this.replay && this.#plot && !this.stale) this.#placeNow(time);
    if (!this.#plot || !this.stale) return;
    this.stale = false;
    const recorded = this.#series?.columns.length === this.#order.length ? this.#series : null;
    const now = this.store.to_s || time || 0;
    const [from, to] = this.#range ?? [Math.max(0, now - SPAN_S), Math.max(now, 1e-3)];
    const { times, columns } = this.replay ? recorded ?? { times: [], columns: this.#order.map(() => []) }
      : this.store.range(this.#order, from, to, POINTS);
    this.#plot.setData([times, ...columns], false);
    this.#plot.batch(() => {
      for (const unit of Object.keys(this.#plot.scales)) {
        if (unit === 'x') continue;
        let low = Infinity;
        let high = -Infinity;
        this.#order.forEach((name, k) => {
          if ((this.units.get(name) || '–') !== unit) return;
          for (const value of columns[k]) {
            if (value < low) low = value;
            if (value > high) high = value;
          }
        });
        if (low > high) continue;
        const room = Math.max(0.08 * (high - low), 1e-6 + 0.01 * Math.abs(high));
        this.#plot.setScale(unit, { min: low - room, max: high + room });
      }
      this.#plot.setScale('x', { min: from, max: to });
    });
    if (this.replay) {
      this.#placeNow(time);
      return;
    }
    [...this.chips.children].forEach((chip, k) => {
      setText(chip.querySelector('b'), k < columns.length ? short(this.store.last(this.#order[k])) : '');
    });
  }
}
