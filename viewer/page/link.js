// SPDX-License-Identifier: Apache-2.0
// The connection to the server: sends the token and requests, and dispatches the messages that
// arrive. It reconnects after a loss.
import { readSeries, readState, readTrace } from './wire.js';

const AGAIN_MS = 1500;
const KEPT = new Set(['watch', 'series']); // answered also after the end of the run

export class Link extends EventTarget {
  #socket = null;
  #number = 0;
  #waiting = new Map();
  #tracing = new Set();
  #wish = { rate_hz: 60, trace: false, signals: [] };
  hello = null;
  open = false;

  constructor() {
    super();
    this.token = new URLSearchParams(location.hash.slice(1)).get('token') ?? '';
    addEventListener('hashchange', () => location.reload());
  }

  connect() {
    if (!this.token) {
      this.#tell('gone', { reason: 'The address has no token: take the one that the run printed.',
        final: true });
      return;
    }
    const socket = new WebSocket(`ws://${location.host}/socket`);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => socket.send(JSON.stringify({ cmd: 'enter', token: this.token, stay: true }));
    socket.onmessage = (event) => this.#take(event.data);
    socket.onclose = (event) => this.#lose(event);
    this.#socket = socket;
  }

  #tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  #lose(event) {
    const refused = event.code === 1008;
    this.open = false;
    this.#refuseWaiting('the connection is gone');
    this.#tell('gone', {
      reason: refused ? 'The token is not that of this run: take the address that it printed.'
        : event.code === 1001 ? this.hello?.run.replay ? 'The replay has ended.' : 'The run has ended.'
          : event.code === 1013 ? 'Too many pages look at this run.' : 'No connection to the simulator.',
      final: refused,
    });
    if (!refused) setTimeout(() => this.connect(), AGAIN_MS);
  }

  #refuseWaiting(text, but = new Set()) {
    for (const [id, { cmd, reject }] of this.#waiting) {
      if (but.has(cmd)) continue;
      this.#waiting.delete(id);
      reject(new Error(text));
    }
  }

  #take(data) {
    if (typeof data !== 'string') {
      const kind = new DataView(data).getUint8(0);
      if (kind === 1) this.#tell('state', { state: readState(data), buffer: data });
      else if (kind === 2) this.#tell('trace', readTrace(data));
      else if (kind === 3) this.#takeSeries(readSeries(data));
      return;
    }
    const message = JSON.parse(data);
    if (message.type === 'hello') {
      this.hello = message;
      this.open = true;
      this.#watch(); // first request, so that a state arrives while the page is built
      this.#tell('hello', message);
    } else if (message.type === 'event') {
      this.#tell('event', message);
    } else if (message.type === 'end') {
      this.#refuseWaiting('the run has ended', KEPT);
      this.#tell('end', message);
    } else {
      this.#answer(message);
    }
  }

  /** Dispatches a series message: id 0 has live rows, other ids answer a request. */
  #takeSeries(series) {
    if (series.id === 0) this.#tell('rows', series);
    else this.#answer({ ok: true, ...series });
  }

  #answer(message) {
    const waiting = this.#waiting.get(message.id);
    this.#waiting.delete(message.id);
    if (message.ok) waiting?.resolve(message);
    else waiting?.reject(new Error(message.error));
  }

  /** Sends a request. Resolves to the answer, or rejects with the server's error text. */
  ask(cmd, keys = {}) {
    if (!this.open) return Promise.reject(new Error('there is no connection'));
    const id = ++this.#number;
    this.#socket.send(JSON.stringify({ id, cmd, ...keys }));
    return new Promise((resolve, reject) => this.#waiting.set(id, { cmd, resolve, reject }));
  }

  /** Changes which data the server sends. */
  watch(wish) {
    Object.assign(this.#wish, wish);
    return this.open ? this.#watch() : Promise.resolve();
  }

  /** Subscribes a part of the page to frames, or unsubscribes it. Without subscribers none are
   * sent. */
  trace(who, on) {
    if (on) this.#tracing.add(who);
    else this.#tracing.delete(who);
    return this.watch({ trace: this.#tracing.size > 0 });
  }

  async #watch() {
    try {
      const answer = await this.ask('watch', this.#wish);
      this.#tell('watching', answer);
    } catch (error) {
      this.#tell('complaint', error.message);
    }
  }

  /** Fetches a file from the server with the token. */
  async fetch(path) {
    const answer = await fetch(path, { headers: { Authorization: `Bearer ${this.token}` } });
    if (!answer.ok) throw new Error(await answer.text() || `${path}: ${answer.status}`);
    return answer;
  }

  /** Fetches the text of a file from the server; calls told(share) with the progress, 0 to 1. */
  async fetchText(path, told) {
    const answer = await this.fetch(path);
    const all = Number(answer.headers.get('Content-Length'));
    const parts = [];
    let size = 0;
    for (const reader = answer.body.getReader();;) {
      const { done, value } = await reader.read();
      if (done) break;
      parts.push(value);
      size += value.length;
      told(all ? size / all : 0);
    }
    if (size < all) throw new Error(`${path}: only ${size} of ${all} bytes came`);
    return new Blob(parts).text();
  }
}
