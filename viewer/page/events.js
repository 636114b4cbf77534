// SPDX-License-Identifier: Apache-2.0
// Shows events in a list, and as marks on the timeline of the last half minute.
import { fixed, h, setClass, setText } from './dom.js';

import { readEvent } from './playback.js';

const SPAN_S = 30;
const KEPT = 500;
const LISTED = 200;
const WORDS = { 3: 'error', 4: 'warning', 5: 'notice', 6: 'info' };

export class Events {
  #all = [];

  constructor(link, past) {
    this.past = past;
    this.filter = h('input', { type: 'search', placeholder: 'filter events…',
      'aria-label': 'filter events', oninput: () => this.#list() });
    this.items = h('ol');
    this.element = h('section', { class: 'panel events', id: 'panel-events' },
      h('div', { class: 'tools' }, this.filter), h('div', { class: 'scroll' }, this.items));
    link.addEventListener('event', ({ detail }) => this.#take(detail));
    link.addEventListener('hello', () => {
      this.#all = [];
      this.#list();
    });
  }

  /** Loads all events of a recording, ordered by time. */
  async load(link) {
    const text = await (await link.fetch('/events.log')).text();
    this.recorded = true;
    this.#all = text.split('\n').slice(0, -1).map(readEvent);
    this.stale = true;
  }

  #take({ priority, text }) {
    const [, time, rest] = text.match(/^(-?[\d.]+) s: ([\s\S]*)$/) ?? [null, NaN, text];
    this.#all.push({ priority, time: Number(time), text: rest });
    if (this.#all.length > KEPT) this.#all.shift();
    this.stale = true;
  }

  get all() {
    return this.#all;
  }

  #list() {
    const words = this.filter.value.toLowerCase();
    const found = this.#all.filter(({ text }) => text.toLowerCase().includes(words));
    // A recording: the events around the shown time, oldest first. A run: the newest event first
    const next = found.findIndex(({ time }) => time > this.time);
    const from = Math.max(0, (next < 0 ? found.length : next) - LISTED / 2);
    const listed = this.recorded ? found.slice(from, from + LISTED) : found.slice(-LISTED).reverse();
    this.rows = listed.map((event) => ({ time: event.time,
      element: h('li', { class: WORDS[event.priority] ?? 'info', title: 'show this moment',
        tabIndex: 0, onclick: () => this.past.show(event.time), onkeydown: (key) => {
          if (key.key === 'Enter') this.past.show(event.time);
        } },
      h('time', { class: 'mono' }, Number.isFinite(event.time) ? `${fixed(event.time, 3)} s` : ''),
      h('span', {}, event.text)) }));
    this.items.replaceChildren(...this.rows.map(({ element }) => element));
  }

  /** Dims the events of a recording after the shown time, and scrolls to the last event before
   * it. */
  #follow() {
    let last = null;
    for (const { time, element } of this.rows ?? []) {
      setClass(element, 'later', time > this.time + 1e-6);
      if (time <= this.time + 1e-6) last = element;
    }
    if (last !== this.last) last?.scrollIntoView({ block: 'nearest' });
    this.last = last;
  }

  render(time) {
    const moved = this.recorded && this.#all.length > LISTED && Math.abs(time - (this.listedAt ?? time)) > 0;
    this.time = time;
    if (this.stale || moved) {
      this.stale = false;
      this.listedAt = time;
      this.#list();
    }
    if (this.recorded && this.isOpen) this.#follow();
  }
}

/** Keeps the states of the last half minute, and shows the timeline to go back. */
export class Past {
  #kept = [];
  #shown = null;
  #word = 'Live';

  constructor(changed) {
    this.changed = changed;
    this.range = h('input', { type: 'range', min: '0', max: '1000', value: '1000', id: 'past',
      'aria-label': 'moment to show', oninput: () => this.#move() });
    this.label = h('span', { class: 'mono' });
    this.live = h('button', { class: 'live', id: 'live', onclick: () => this.show(null) }, 'Live');
    this.marks = h('div', { class: 'marks' });
    this.element = h('div', { class: 'past' }, this.live,
      h('div', { class: 'line' }, this.marks, this.range), this.label);
  }

  /** Sets the label of the newest state ("Live") and shows it at once, before the next picture. */
  set word(word) {
    this.#word = word;
    this.#say();
  }

  #say() {
    setText(this.live, !this.#shown ? this.#word : this.#word === 'Live' ? 'Back to now' : 'Back to the end');
  }

  take(state) {
    const last = this.#kept.at(-1);
    if (last && state.time < last.time) this.#kept = [];
    if (last && state.time === last.time) this.#kept[this.#kept.length - 1] = state;
    else this.#kept.push(state);
    while (this.#kept[0].time < state.time - SPAN_S) this.#kept.shift();
  }

  /** Returns the state to show instead of the newest one; null = the newest. */
  get shown() {
    return this.#shown;
  }

  #move() {
    const part = Number(this.range.value) / 1000;
    const last = this.#kept.at(-1);
    if (!last || part >= 0.999) {
      this.show(null);
      return;
    }
    this.show(last.time - (1 - part) * Math.max(SPAN_S, 1e-9), false);
  }

  show(time, move = true) {
    const last = this.#kept.at(-1);
    if (time === null || !last || Number.isNaN(time)) {
      this.#shown = null;
      this.range.value = '1000';
    } else {
      this.#shown = this.#kept.find((state) => state.time >= time) ?? last;
      if (move) this.range.value = String(1000 * (1 - (last.time - this.#shown.time) / SPAN_S));
    }
    this.changed();
  }

  render(events) {
    const last = this.#kept.at(-1);
    const now = last?.time ?? 0;
    setClass(this.element, 'back', this.#shown !== null);
    this.#say();
    setText(this.label, this.#shown ? `${fixed(this.#shown.time - now, 2)} s` : '');
    const marks = events.filter(({ time }) => time > now - SPAN_S && time <= now);
    const key = `${marks.length} ${Math.round(now * 4)}`;
    if (key === this.key) return;
    this.key = key;
    this.marks.replaceChildren(...marks.slice(-120).map(({ time, priority, text }) => {
      const mark = h('i', { class: WORDS[priority] ?? 'info', title: text });
      mark.style.left = `${fixed(100 * (1 - (now - time) / SPAN_S), 2)}%`;
      return mark;
    }));
  }
}
