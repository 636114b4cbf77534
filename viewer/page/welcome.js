// SPDX-License-Identifier: Apache-2.0
// The card that a newcomer sees over the picture: what it shows, and three things to try.
import { h } from './dom.js';

const KEPT = 'welcome';

/** Returns "1 board" or "12 boards". */
function several(number, noun, plural = `${noun}s`) {
  return `${number} ${number === 1 ? noun : plural}`;
}

function story({ run, buses, boards }) {
  if (run.replay) return `A recording of the simulated robot ${run.robot}, from the rig ${run.rig}. You see it as it moved.`;
  const host = run.task ? `A controller (task ${run.task}) sends commands` : 'Your controller sends commands';
  return `${run.robot}, a simulated robot. ${host} over ${several(buses.length, 'CAN bus', 'CAN buses')} to `
    + `${several(boards.length, 'board')}. The boards drive the motors and report what their sensors measure.`;
}

export class Welcome {
  /** tries: [text, words of the button or null, function] of each thing to try. */
  constructor(hello, tries) {
    this.element = h('section', { class: 'welcome', id: 'welcome', 'aria-label': 'what am I looking at?',
      onkeydown: (event) => { if (event.key === 'Escape') this.close(); } },
    h('header', {}, h('b', {}, 'What am I looking at?'),
      h('button', { class: 'icon', 'aria-label': 'close', title: 'close', onclick: () => this.close() }, '×')),
    h('p', {}, story(hello)),
    h('p', { class: 'muted' }, 'Blue arrows: contact forces. Gold ball: center of mass. Amber and red: joints near their torque limit.'),
    h('b', {}, 'Three things to try'),
    h('ol', {}, tries.map(([text, words, action]) => h('li', {}, `${text} `,
      words && h('button', { class: 'plain', onclick: action }, words)))),
    h('button', { class: 'main', onclick: () => this.close() }, 'Got it'));
    try {
      this.element.hidden = localStorage.getItem(KEPT) === 'seen';
    } catch { /* the browser has no storage: the card comes each time */ }
  }

  open() {
    this.element.hidden = false;
  }

  close() {
    this.element.hidden = true;
    try {
      localStorage.setItem(KEPT, 'seen');
    } catch { /* the browser has no storage */ }
  }
}
