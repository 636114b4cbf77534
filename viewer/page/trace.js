// SPDX-License-Identifier: Apache-2.0
// Shows the decoded frames on the buses, and a form to send a frame.
import { Database, decode, encode, hex } from './decode.js';
import { count, fixed, h, plain, setText } from './dom.js';
import { frameTime, readFrame, visitTrace } from './wire.js';

const ROWS = 150;
const RENDER_MS = 300;
const SHOWN_SIGNALS = 8;
const LOGGED = 60; // number of trace messages that are kept
const NONE_YET = 'no frames yet: they come while this panel is open';

function describe(message, data) {
  if (!message) return '';
  return decode(message, data).slice(0, SHOWN_SIGNALS)
    .map(({ name, value, unit, word }) => `${name} ${word ?? plain(value)}${unit && !word ? ` ${unit}` : ''}`)
    .join(' · ');
}

const idText = (frame) => frame.id.toString(16).toUpperCase().padStart(frame.extended ? 8 : 3, '0');

export class Trace {
  #groups = new Map();
  #log = [];
  #database = null;
  #seen = 0;
  #lost = 0;
  #held = false;
  #opened = new Set(); // keys of the messages that are shown in full

  constructor(link, hello, complain) {
    this.link = link;
    this.hello = hello;
    this.complain = complain;
    this.element = this.#build();
    link.addEventListener('trace', (event) => this.#take(event.detail));
  }

  #build() {
    const buses = this.hello.buses.map((bus, i) => h('option', { value: String(i) }, bus.name));
    const changed = () => this.render(true);
    this.filter = h('input', { type: 'search', placeholder: 'message, signal or id…',
      'aria-label': 'filter frames', oninput: changed });
    this.bus = h('select', { 'aria-label': 'bus', onchange: changed },
      h('option', { value: '' }, 'all buses'), buses);
    this.order = h('select', { 'aria-label': 'order', onchange: changed },
      h('option', { value: 'groups' }, 'by message'), h('option', { value: 'log' }, 'in order'));
    this.hold = h('button', { class: 'quiet', onclick: () => {
      this.#held = !this.#held;
      setText(this.hold, this.#held ? 'Go on' : 'Hold');
    } }, 'Hold');
    this.note = h('span', { class: 'muted' }, NONE_YET);
    this.body = h('tbody', { onclick: (event) => this.#toggle(event.target.closest('tr')?.dataset.key) });
    this.head = h('thead', {}, h('tr', {}, ['Bus', 'Id', 'Message', '', 'Data', 'Meaning']
      .map((title) => h('th', {}, title))));
    return h('section', { class: 'panel trace', id: 'panel-trace' },
      h('div', { class: 'tools' }, this.filter, this.bus, this.order, this.hold, this.note),
      h('div', { class: 'scroll' }, h('table', { class: this.hello.buses.some(({ fd }) => fd) ? 'frames fd' : 'frames' }, this.head, this.body)),
      this.hello.run.replay ? null : this.#buildSender());
  }

  // ---- sending ----

  #buildSender() {
    const can = this.hello.right === 'control' && this.hello.run.frames;
    this.sendBus = h('select', { id: 'send-bus', 'aria-label': 'bus of the frame',
      onchange: () => this.#fillMessages() },
    this.hello.buses.map((bus, i) => h('option', { value: String(i) }, bus.name)));
    this.sendMessage = h('select', { 'aria-label': 'message', onchange: () => this.#fillFields() },
      h('option', { value: '' }, 'bytes'));
    this.sendId = h('input', { id: 'send-id', placeholder: 'id, hex', size: 8,
      'aria-label': 'identifier, hexadecimal' });
    this.sendData = h('input', { id: 'send-data', placeholder: 'data, hex: 0a ff 00', size: 22,
      'aria-label': 'data, hexadecimal' });
    this.fields = h('div', { class: 'fields' });
    this.sendNote = h('span', { class: 'muted', id: 'send-note', role: 'status' });
    return h('form', { class: 'sender', onsubmit: (event) => {
      event.preventDefault();
      this.#send();
    } },
    h('fieldset', { disabled: !can },
      h('legend', {}, 'Send a frame'),
      h('div', { class: 'tools' }, this.sendBus, this.sendMessage, this.sendId, this.sendData,
        h('button', { id: 'send', type: 'submit' }, 'Send'), this.sendNote),
      this.fields),
    can ? null : h('p', { class: 'muted' }, 'This page may look, and not send.'));
  }

  #fillMessages() {
    const messages = this.#database?.buses[Number(this.sendBus.value)] ?? [];
    this.sendMessage.replaceChildren(h('option', { value: '' }, 'bytes'), ...messages
      .filter((message) => message.sender === 'host')
      .map((message) => h('option', { value: String(message.id) }, message.name)));
    this.#fillFields();
  }

  #message() {
    const id = Number(this.sendMessage.value);
    return this.sendMessage.value === '' ? null
      : this.#database.buses[Number(this.sendBus.value)].find((message) => message.id === id);
  }

  /** Creates inputs for the signals of the chosen message. A multiplexed message shows only the
   * signals of the chosen command. */
  #fillFields() {
    const message = this.#message();
    this.fields.replaceChildren();
    if (!message) return;
    const multiplexor = message.signals.find((signal) => signal.multiplexor);
    const values = {};
    const update = () => {
      this.sendData.value = hex(encode(message, values));
      this.sendId.value = message.id.toString(16);
    };
    const field = (signal) => {
      const change = (event) => {
        values[signal.name] = Number(event.target.value);
        if (signal.multiplexor) build();
        update();
      };
      const words = Object.entries(signal.values ?? {});
      const input = words.length
        ? h('select', { onchange: change }, words.map(([raw, word]) =>
          h('option', { value: raw, selected: Number(raw) === values[signal.name] }, word)))
        : h('input', { type: 'number', step: 'any', value: String(values[signal.name] ?? 0),
          oninput: change });
      values[signal.name] ??= words.length ? Number(words[0][0]) : 0;
      return h('label', {}, h('span', {}, signal.name), input,
        h('span', { class: 'muted' }, signal.unit ?? ''));
    };
    const build = () => {
      const first = multiplexor ? [field(multiplexor)] : [];
      this.fields.replaceChildren(...first, ...message.signals
        .filter((signal) => !signal.multiplexor && (signal.selector === undefined
          || signal.selector === values[multiplexor?.name])).map(field));
    };
    build();
    update();
  }

  async #send() {
    const id = Number.parseInt(this.sendId.value, 16);
    try {
      await this.link.ask('send', { bus: this.hello.buses[Number(this.sendBus.value)].name,
        frame_id: Number.isNaN(id) ? -1 : id, extended: id > 0x7ff,
        fd: this.sendData.value.replaceAll(' ', '').length > 16, data: this.sendData.value });
      setText(this.sendNote, 'sent');
      setTimeout(() => setText(this.sendNote, ''), 1500);
    } catch (error) {
      setText(this.sendNote, error.message);
    }
  }

  // ---- receiving ----

  async shown(visible) {
    this.visible = visible;
    this.link.trace(this, visible);
    if (visible && !this.#database) {
      try {
        this.#database = new Database(await (await this.link.fetch('/messages.json')).json());
        this.stale = true;
        if (!this.hello.run.replay) this.#fillMessages();
      } catch (error) {
        this.complain(error.message);
      }
    }
  }

  /** Clears the frames, because another time is shown. */
  reset() {
    this.#groups.clear();
    this.#log = [];
    this.#seen = this.#lost = 0;
    this.stale = true;
  }

  #take(message) {
    const { view } = message;
    this.#lost += message.lost;
    this.#seen += message.count;
    if (this.#held) return;
    visitTrace(message, (key, at) => {
      let group = this.#groups.get(key);
      if (!group) this.#groups.set(key, group = { count: 0, period: NaN });
      const time = frameTime(view, at);
      const period = time - group.time;
      if (Number.isFinite(period)) {
        group.period = Number.isFinite(group.period) ? 0.9 * group.period + 0.1 * period : period;
      }
      Object.assign(group, { view, at, time, count: group.count + 1 });
    });
    this.#log.push(message);
    if (this.#log.length > LOGGED) this.#log.shift();
    this.stale = true;
  }

  /** Iterates over the rows to show, from top to bottom. */
  *#entries() {
    if (this.order.value === 'groups') {
      for (const [, group] of [...this.#groups].sort(([a], [b]) => a - b)) {
        yield { ...group, frame: readFrame(group.view, group.at) };
      }
      return;
    }
    for (const message of this.#log.slice().reverse()) {
      const places = [];
      visitTrace(message, (_, at) => places.push(at));
      for (const at of places.reverse()) yield { frame: readFrame(message.view, at) };
    }
  }

  /** Shows a message in full, or in one line again. Lines have equal height, so that rows do not
   * jump. */
  #toggle(key) {
    if (!key || getSelection().type === 'Range') return;
    if (!this.#opened.delete(key)) this.#opened.add(key);
    this.render(true);
  }

  #matches(frame, message) {
    const words = this.filter.value.trim().toLowerCase();
    if (this.bus.value !== '' && frame.bus !== Number(this.bus.value)) return false;
    if (!words) return true;
    return idText(frame).toLowerCase().includes(words)
      || (message?.name.toLowerCase().includes(words) ?? false)
      || describe(message, frame.data).toLowerCase().includes(words);
  }

  render(now = false) {
    const clock = performance.now();
    if (!this.visible || (!now && (!this.stale || clock - (this.rendered ?? 0) < RENDER_MS))) return;
    this.stale = false;
    this.rendered = clock;
    const grouped = this.order.value === 'groups';
    const rows = [];
    for (const { frame, period, count: times } of this.#entries()) {
      const message = this.#database?.find(frame.bus, frame);
      if (!this.#matches(frame, message)) continue;
      const meaning = describe(message, frame.data);
      const key = `${frame.bus}:${frame.id}`;
      rows.push(h('tr', { 'data-key': key, class: [frame.ours ? 'ours' : frame.error ? 'bad' : '',
        this.#opened.has(key) ? 'open' : ''].join(' ').trim() },
        h('td', {}, this.hello.buses[frame.bus].name), h('td', { class: 'mono' }, idText(frame)),
        h('td', {}, frame.error ? 'error frame' : message?.name ?? ''),
        h('td', { class: 'mono right muted' }, grouped
          ? `${count(times)} × ${fixed(1e3 * period, 1)} ms` : `${fixed(frame.time, 4)} s`),
        h('td', { class: 'mono data' }, h('div', {}, hex(frame.data))),
        h('td', { class: 'meaning', title: meaning }, h('div', {}, meaning))));
      if (rows.length >= ROWS) break;
    }
    this.body.replaceChildren(...rows);
    setText(this.note, this.#seen
      ? `${count(this.#seen)} frames${this.#lost ? `, ${count(this.#lost)} not shown` : ''}` : NONE_YET);
  }
}
