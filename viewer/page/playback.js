// SPDX-License-Identifier: Apache-2.0
// The timeline of a recording, with its events; the user drags it to any time. For a recording, it
// replaces the timeline of the last half minute (events.js).
import { fixed, h, setText, sign } from './dom.js';

const STEPS = 10000; // steps of the timeline
const MARKS = 400;
const PLAY = 'M3 1.5v9l7-4.5z';
const PAUSE = 'M2.5 1.5h2.5v9H2.5zM7 1.5h2.5v9H7z';
const BEFORE = 'M2 1.5h1.6v9H2zM10.5 1.5v9L4 6z';
const NEXT = 'M8.4 1.5H10v9H8.4zM1.5 1.5v9L8 6z';
const WORDS = ['emergency', 'alert', 'critical', 'error', 'warning', 'notice', 'info', 'debug'];

/** Parses a line of events.log. */
export function readEvent(line) {
  const [, time, word, text] = line.match(/^(-?[\d.]+) (\w+) (.*)$/) ?? [null, NaN, 'info', line];
  return { time: Number(time), priority: Math.max(0, WORDS.indexOf(word)), text };
}

export class Playback {
  #wanted = null;
  #asking = false;
  #events = [];
  #marked = null;

  /** jumped() is called when the shown time jumps: earlier frames no longer apply. */
  constructor(link, replay, jumped) {
    this.link = link;
    this.replay = replay;
    this.jumped = jumped;
    this.time = replay.from_s;
    this.range = h('input', { type: 'range', min: '0', max: String(STEPS), value: '0', id: 'past',
      'aria-label': 'moment to show', oninput: () => this.show(this.#at(Number(this.range.value)), false) });
    this.play = h('button', { class: 'live', id: 'play', title: 'Space', 'aria-label': 'play, pause',
      onclick: () => this.toggle() }, sign(PLAY));
    this.label = h('span', { class: 'mono moment' });
    this.marks = h('div', { class: 'marks' });
    const jump = (way, path, title) => h('button', { class: 'live', title, 'aria-label': title,
      onclick: () => this.jump(way) }, sign(path));
    this.element = h('div', { class: 'past recorded' }, jump(-1, BEFORE, 'event before: ['), this.play,
      jump(1, NEXT, 'next event: ]'), h('div', { class: 'line' }, this.marks, this.range), this.label);
  }

  #at(step) {
    return this.replay.from_s + step / STEPS * (this.replay.to_s - this.replay.from_s);
  }

  #step(time) {
    return STEPS * (time - this.replay.from_s) / Math.max(this.replay.to_s - this.replay.from_s, 1e-9);
  }

  /** Returns null: a recording always shows the newest state, because the server seeks. */
  get shown() {
    return null;
  }

  take(state) {
    this.state = state;
    if (this.#wanted === null && !this.#asking) this.time = state.time;
  }

  toggle() {
    this.link.ask(this.state?.paused ? 'resume' : 'pause').catch(() => {});
    this.jumped();
  }

  /** Seeks to a time. While a request is outstanding, only the last of several calls is sent. */
  async show(time, move = true) {
    if (time === null || Number.isNaN(time)) return;
    this.time = Math.min(Math.max(time, this.replay.from_s), this.replay.to_s);
    this.#wanted = this.time;
    if (move) this.range.value = String(this.#step(this.time));
    if (this.#asking) return;
    this.#asking = true;
    while (this.#wanted !== null) {
      const next = this.#wanted;
      this.#wanted = null;
      this.jumped();
      try {
        await this.link.ask('seek', { time_s: next });
      } catch { /* the connection is gone, and the page says so */ }
    }
    this.#asking = false;
  }

  move(seconds) {
    this.show(this.time + seconds);
  }

  /** Seeks to the previous (-1) or next (1) event. Events of the same time count as one. */
  jump(way) {
    const gap = 1.5 * this.replay.period_s;
    const found = way > 0 ? this.#events.find(({ time }) => time > this.time + gap)
      : this.#events.findLast(({ time }) => time < this.time - gap);
    this.show(found ? found.time : way > 0 ? this.replay.to_s : this.replay.from_s);
  }

  #mark(events) {
    const place = (time) => Math.round(this.#step(time) / STEPS * MARKS);
    const best = new Map(); // most severe event at each position
    for (const event of events) {
      const at = place(event.time);
      if (!(best.get(at)?.priority <= event.priority)) best.set(at, event);
    }
    this.marks.replaceChildren(...[...best.values()].map(({ time, priority, text }) => {
      const mark = h('i', { class: WORDS[priority], title: text });
      mark.style.left = `${fixed(this.#step(time) * 100 / STEPS, 2)}%`;
      return mark;
    }));
  }

  render(events) {
    if (events !== this.#marked) {
      this.#marked = events;
      this.#events = events.filter(({ time }) => Number.isFinite(time));
      this.#mark(this.#events);
    }
    if (document.activeElement !== this.range || this.#wanted === null) {
      const step = Math.round(this.#step(this.time));
      if (Number(this.range.value) !== step) this.range.value = String(step);
    }
    this.play.firstChild.firstChild.setAttribute('d', this.state?.paused ? PLAY : PAUSE);
    setText(this.label, `${fixed(this.time, 2)} / ${fixed(this.replay.to_s, 2)} s`);
  }
}
