// SPDX-License-Identifier: Apache-2.0
// Shows how a run ended: verdict, the task's message, warnings, and the files of the recording.
import { count, fixed, h, setText } from './dom.js';

const WARNINGS = 6;
const LATE = 'overrun by ';

/** Formats a size in bytes with its unit. */
function size(bytes) {
  return bytes < 1e4 ? `${count(bytes)} B` : bytes < 1e7 ? `${fixed(bytes / 1e3, 0)} kB` : `${fixed(bytes / 1e6, 0)} MB`;
}

/** Summarizes the overruns in one line. */
function summary(late) {
  const worst = Math.max(...late.map(({ text }) => Number.parseFloat(text.slice(LATE.length))));
  return `${count(late.length)} ${late.length === 1 ? 'overrun' : 'overruns'} in the log, by ${fixed(worst, 1)} ms at most`;
}

export class Ending {
  constructor(link, complain) {
    this.link = link;
    this.complain = complain;
    this.note = h('p', { class: 'muted' });
    this.element = h('section', { class: 'ending', id: 'ending', role: 'status', hidden: true });
  }

  /** end: the server's end message; events: the run's events; openEvents() shows all events. */
  show(end, events, openEvents) {
    const bad = events.filter(({ priority }) => priority <= 4);
    const late = bad.filter(({ text }) => text.startsWith(LATE));
    const rest = bad.filter(({ text }) => !text.startsWith(LATE));
    this.element.className = end.failed ? 'ending failed' : 'ending';
    this.element.replaceChildren(...[
      h('header', {}, h('b', {}, end.failed ? 'Failed' : end.task && end.text === 'the task ended' ? 'Done' : 'Ended'),
        h('span', {}, `${end.text}, at ${fixed(end.time_s, 3)} s`),
        h('button', { class: 'icon', 'aria-label': 'close', title: 'close', onclick: () => { this.element.hidden = true; } }, '×')),
      end.task ? h('p', {}, h('b', {}, `Task ${end.task}`), `: ${end.task_text ?? 'was not at its end'}`) : null,
      h('p', {}, bad.length ? `${count(bad.length)} ${bad.length === 1 ? 'warning' : 'warnings'}` : 'No warnings',
        ` among ${count(events.length)} events. `, h('button', { class: 'plain', onclick: openEvents }, 'Show the events')),
      bad.length ? h('ul', {}, late.length ? h('li', {}, summary(late)) : null, rest.slice(-WARNINGS).map(({ time, text }) =>
        h('li', {}, Number.isFinite(time) ? `${fixed(time, 3)} s: ` : '', text))) : null,
      end.recording ? this.#recording(end) : null,
      this.note].filter(Boolean));
    this.#tell(end.stays ? 'The program waits until this page is closed.' : '');
    this.element.hidden = false;
  }

  #recording({ recording, files }) {
    return h('div', { class: 'files' }, h('p', {}, 'Recording: ', h('span', { class: 'mono' }, recording)),
      h('p', {}, files.map(({ name, bytes }) => h('a', { href: `/recording/${name}`, download: name,
        onclick: (event) => this.#save(event, name) }, name, h('small', { class: 'muted' }, ` ${size(bytes)}`)))));
  }

  /** Downloads a file with a request that carries the token, because a plain link cannot. */
  async #save(event, name) {
    event.preventDefault();
    try {
      const url = URL.createObjectURL(await (await this.link.fetch(`/recording/${name}`)).blob());
      h('a', { href: url, download: name }).click();
      setTimeout(() => URL.revokeObjectURL(url), 60000);
    } catch (error) {
      this.complain(`${name}: ${error.message}`);
    }
  }

  #tell(text) {
    setText(this.note, text);
  }

  /** Shows that the program has ended, and disables the links to its files. */
  lose() {
    for (const link of this.element.querySelectorAll('.files a')) link.replaceWith(link.textContent, ' ');
    this.#tell('The program has ended. This page waits for the next run at this address.');
  }
}
