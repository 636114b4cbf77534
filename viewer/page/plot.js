// SPDX-License-Identifier: Apache-2.0
// One of several plots that share a time axis. It has a chip for each signal, an axis for each
// unit, the cursor, and the gestures to zoom and pan.
import uPlot from 'uplot';
import { axisWidth, h, setClass, setText, short } from './dom.js';

export const SIGNALS_MOST = 12;
const COLORS = ['#2f81f7', '#e0552b', '#2f9e6e', '#b05cd6', '#d9a514', '#12a5b5', '#d6336c',
  '#7a8b2b', '#6b6ff2', '#a0622d', '#4aa3ff', '#8a94a3'];
const CLICK_PX = 4; // longest movement of a click; a drag is longer
const BOX_PX = 24; // a zoom box below this height zooms only time
const WHEEL = 1.0015; // zoom factor per pixel of the wheel

/** Returns the color of the signal at an index of a plot. */
export const colorOf = (index) => COLORS[index % COLORS.length];

/** Returns the index of the sample nearest to a time; times must be ascending. */
export function nearest(times, time) {
  let low = 0;
  let high = times.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < time) low = middle + 1;
    else high = middle;
  }
  return low > 0 && time - times[low - 1] < times[low] - time ? low - 1 : low;
}

/** Returns the minimum and maximum of columns, with a margin; null without values. */
function rangeOf(columns) {
  let low = Infinity;
  let high = -Infinity;
  for (const column of columns) {
    for (const value of column) {
      if (value !== null && value < low) low = value;
      if (value !== null && value > high) high = value;
    }
  }
  if (low > high) return null;
  const flat = low === high ? 0.1 * Math.abs(high) || 1 : 0; // puts a constant in the middle of its axis
  const margin = Math.max(0.08 * (high - low), 1e-6 + 0.01 * Math.abs(high), flat);
  return { min: low - margin, max: high + margin };
}

export class Plot {
  #plot = null;
  #layout = '';
  #zoomed = null; // range of values by unit, chosen with a zoom box; null = automatic
  #dragged = false;

  /** panel: the Plots object that owns this plot. */
  constructor(panel, names = []) {
    this.panel = panel;
    this.names = names;
    this.chips = h('div', { class: 'chips' });
    this.stage = h('div', { class: 'stage' });
    this.empty = h('p', { class: 'empty' }, 'Search for a signal, or drop one here.');
    this.now = h('i', { class: 'now', hidden: true });
    this.close = h('button', { class: 'icon', title: 'remove this plot', onclick: () => panel.remove(this) }, '×');
    this.element = h('article', { class: 'plot', tabIndex: 0, role: 'group',
      onfocusin: () => panel.choose(this), onpointerdown: () => panel.choose(this),
      onkeydown: (event) => this.#key(event), ondragover: (event) => this.#over(event),
      ondragleave: () => this.element.classList.remove('target'), ondrop: (event) => this.#drop(event) },
    h('header', {}, this.chips, this.close), this.stage);
    this.stage.append(this.empty);
    new ResizeObserver(() => this.#plot?.setSize(this.#box())).observe(this.stage);
    this.changed();
  }

  // ---- signals ----

  /** Rebuilds the chips after a change of names. */
  changed() {
    this.#zoomed = null;
    this.chips.replaceChildren(...this.names.map((name, i) => this.#makeChip(name, i)));
    this.empty.hidden = this.names.length > 0;
    this.#label();
  }

  #label() {
    const number = this.panel.numberOf(this);
    this.element.setAttribute('aria-label', `plot ${number}: ${this.names.join(', ') || 'empty'}`);
    this.close.setAttribute('aria-label', `remove plot ${number}`);
  }

  #makeChip(name, index) {
    const sign = h('i');
    sign.style.background = colorOf(index);
    return h('button', { class: 'chip', title: 'remove; drag to another plot, or Shift with arrows',
      'aria-label': `remove ${name}`, draggable: true, onclick: () => this.panel.drop(this, name),
      onkeydown: (event) => this.#moveChip(event, name),
      ondragstart: (event) => {
        event.dataTransfer.setData('text/plain', name);
        this.panel.dragged = { plot: this, name };
      }, ondragend: () => { this.panel.dragged = null; } }, sign, h('span', {}, name), h('b', { class: 'mono' }),
    h('small', { class: 'mono', hidden: true }), h('em', {}, '×'));
  }

  #moveChip(event, name) {
    const way = event.shiftKey && { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!way) return;
    event.preventDefault();
    event.stopPropagation();
    this.panel.move(this, name, way);
  }

  #over(event) {
    event.preventDefault();
    this.element.classList.add('target');
  }

  /** Adds the dropped signals, one name per line. A chip from another plot is moved. */
  #drop(event) {
    const { dragged } = this.panel;
    event.preventDefault();
    this.element.classList.remove('target');
    this.panel.addTo(this, event.dataTransfer.getData('text/plain').split('\n'));
    if (dragged && dragged.plot !== this && this.names.includes(dragged.name)) {
      this.panel.drop(dragged.plot, dragged.name);
    }
  }

  // ---- drawing ----

  #box() {
    const box = this.stage.getBoundingClientRect();
    return { width: Math.max(100, Math.floor(box.width)), height: Math.max(80, Math.floor(box.height)) };
  }

  #units() {
    return [...new Set(this.names.map((name) => this.panel.unitOf(name)))];
  }

  /** Returns the curves: one per signal, then one dashed curve per signal of the second
   * recording. */
  #series(compares) {
    const curve = (name, i, other) => ({ label: name, width: 1.6, scale: this.panel.unitOf(name),
      stroke: colorOf(i), spanGaps: true, points: { show: false }, ...other });
    return [{}, ...this.names.map((name, i) => curve(name, i)), ...compares
      ? this.names.map((name, i) => curve(name, i, { dash: [6, 4], width: 1.2 })) : []];
  }

  #make(compares) {
    const style = getComputedStyle(document.documentElement);
    const text = style.getPropertyValue('--muted').trim();
    const grid = { stroke: style.getPropertyValue('--line').trim(), width: 1 };
    const units = this.#units();
    const series = this.#series(compares);
    this.#plot?.destroy();
    this.#plot = new uPlot({
      ...this.#box(),
      legend: { show: false },
      cursor: { y: false, points: { size: 6 },
        drag: { x: true, y: true, uni: BOX_PX, setScale: false },
        bind: { dblclick: () => null, mousedown: (plot, target, handler) => (event) => {
          if (event.button === 0 && !event.shiftKey) handler(event);
        } } },
      hooks: { setSelect: [(plot) => this.#select(plot)], ready: [(plot) => this.#bind(plot)],
        setCursor: [(plot) => this.panel.pointAt(this, plot.cursor.left >= 0
          ? plot.posToVal(plot.cursor.left, 'x') : null)] },
      scales: { x: { time: false }, ...Object.fromEntries(units.map((unit) => [unit, {}])) },
      series,
      axes: [{ stroke: text, grid, ticks: grid, size: 34,
        values: (_, ticks) => ticks.map((t) => `${+t.toFixed(6)} s`) },
      ...units.map((unit, i) => ({ scale: unit, label: unit, side: i % 2 ? 1 : 3, stroke: text,
        size: (_, labels) => axisWidth(labels), labelSize: 18, grid: i ? { show: false } : grid, ticks: grid,
        values: (_, ticks) => ticks.map((t) => +t.toPrecision(6)) }))],
    }, [[], ...series.slice(1).map(() => [])], this.stage);
    this.#plot.root.hidden = this.names.length === 0;
  }

  /** Makes the next drawing rebuild the plot with the new colors. */
  setTheme() {
    this.#layout = '';
  }

  get canvas() {
    return this.names.length ? this.#plot?.ctx.canvas : null;
  }

  /** Draws the curves. data: {times, columns by signal name}; other signals are ignored. other: the
   * same for the second recording, or null. range: the shown times, s. */
  draw(data, other, range) {
    const layout = `${this.names.join()} ${Boolean(other)}`;
    if (layout !== this.#layout || !this.#plot) {
      this.#layout = layout;
      this.#make(Boolean(other));
    }
    const tables = [data, ...other ? [other] : []].map(({ times, columns }) => [times,
      ...this.names.map((name) => columns.get(name) ?? Array(times.length).fill(null))]);
    const joined = tables.length > 1 ? uPlot.join(tables) : tables[0];
    this.#plot.batch(() => {
      this.#plot.setData(joined, false);
      for (const unit of this.#units()) {
        const columns = tables.flatMap((table) => this.names.flatMap((name, k) =>
          this.panel.unitOf(name) === unit ? [table[k + 1]] : []));
        const found = this.#zoomed?.[unit] ?? rangeOf(columns);
        if (found) this.#plot.setScale(unit, found);
      }
      this.#plot.setScale('x', { min: range[0], max: range[1] });
    });
  }

  /** Shows the values of the signals, and the differences to the second recording. */
  tell(values, others) {
    this.names.forEach((name, i) => {
      const chip = this.chips.children[i];
      const value = values.get(name) ?? NaN;
      const apart = others ? (others.get(name) ?? NaN) - value : NaN;
      setText(chip.children[2], short(value));
      chip.children[3].hidden = !others;
      if (others) setText(chip.children[3], `Δ ${short(apart)}`);
    });
  }

  /** Moves the cursor to a time; null hides it. */
  showCursor(time) {
    const left = time === null ? -10 : this.#plot?.valToPos(time, 'x');
    this.#plot?.setCursor({ left, top: -10 }, false, false);
  }

  /** Marks the time of the 3D picture with a line; null = no line. */
  showMoment(time) {
    const { min, max } = this.#plot?.scales.x ?? {};
    this.now.hidden = time === null || !(time >= min && time <= max);
    if (!this.now.hidden) this.now.style.left = `${this.#plot.valToPos(time, 'x')}px`;
  }

  showChosen(on) {
    setClass(this.element, 'chosen', on);
    this.#label();
  }

  // ---- gestures ----

  /** Zooms to the drawn box: time in all plots, and values if the box is high enough. */
  #select(plot) {
    const { left, top, width, height } = plot.select;
    this.#dragged = width > CLICK_PX || height > CLICK_PX;
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    if (!this.#dragged) return;
    if (height > CLICK_PX && height < plot.over.clientHeight - 1) {
      this.#zoomed = Object.fromEntries(this.#units().map((unit) => [unit,
        { min: plot.posToVal(top + height, unit), max: plot.posToVal(top, unit) }]));
    }
    if (width > CLICK_PX) this.panel.show(plot.posToVal(left, 'x'), plot.posToVal(left + width, 'x'));
    else this.panel.redraw();
  }

  /** Returns to the automatic range of values. */
  unzoom() {
    this.#zoomed = null;
  }

  #bind(plot) {
    const { over } = plot;
    over.append(this.now);
    over.addEventListener('dblclick', () => this.panel.showAll());
    over.addEventListener('click', (event) => {
      if (!this.#dragged && !event.shiftKey) {
        this.panel.seek?.(plot.posToVal(event.clientX - over.getBoundingClientRect().left, 'x'));
      }
      this.#dragged = false;
    });
    over.addEventListener('wheel', (event) => this.#wheel(event, plot), { passive: false });
    this.#bindFingers(plot, over);
  }

  #wheel(event, plot) {
    event.preventDefault();
    const { min, max } = plot.scales.x;
    const along = event.shiftKey ? event.deltaX || event.deltaY : event.deltaX;
    if (Math.abs(along) > Math.abs(event.shiftKey ? 0 : event.deltaY)) {
      this.panel.pan(along / plot.over.clientWidth);
    } else {
      const at = plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, 'x');
      this.panel.zoom(WHEEL ** (event.deltaMode ? 30 * event.deltaY : event.deltaY), (at - min) / (max - min));
    }
  }

  /** Binds pointer gestures: one finger, the middle button or Shift pans; two fingers zoom. */
  #bindFingers(plot, over) {
    const fingers = new Map();
    const part = (event) => (event.clientX - over.getBoundingClientRect().left) / over.clientWidth;
    over.addEventListener('pointerdown', (event) => {
      if (event.pointerType !== 'touch' && event.button !== 1 && !event.shiftKey) return;
      event.preventDefault();
      over.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, part(event));
    });
    over.addEventListener('pointermove', (event) => {
      if (!fingers.has(event.pointerId)) return;
      const before = [...fingers.values()];
      fingers.set(event.pointerId, part(event));
      const after = [...fingers.values()];
      if (after.length === 1) this.panel.pan(before[0] - after[0]);
      else this.panel.stretch(before, after);
    });
    for (const end of ['pointerup', 'pointercancel']) {
      over.addEventListener(end, (event) => fingers.delete(event.pointerId));
    }
  }

  /** Handles the keys of the plot that has the focus. */
  #key(event) {
    if (event.target !== this.element || event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const action = arrow ? () => event.shiftKey ? this.panel.pan(arrow / 5) : this.panel.moveCursor(arrow)
      : { '+': () => this.panel.zoom(0.5), '=': () => this.panel.zoom(0.5), '-': () => this.panel.zoom(2),
        Escape: () => this.panel.showAll(), Delete: () => this.panel.remove(this) }[event.key];
    if (!action) return;
    event.preventDefault();
    event.stopPropagation();
    action();
  }
}
