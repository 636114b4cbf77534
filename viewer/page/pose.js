// SPDX-License-Identifier: Apache-2.0
// Sliders for the joints while the task `pose` runs. A slider sets the joint's target angle. The
// task sends frames to reach it, as any controller does. A mark shows the joint's present angle.
import { fixed, h, setText } from './dom.js';

const STEPS = 1000; // steps of a slider
const DEGREES = 180 / Math.PI;

export class Pose {
  #waiting = new Map(); // values that are not sent yet, by name of the setting
  #asking = false;
  #rows = [];

  constructor(link, hello, complain) {
    Object.assign(this, { link, hello, complain });
    this.can = hello.right === 'control';
    this.list = h('div', { class: 'scroll sliders' });
    this.back = h('button', { class: 'quiet', disabled: !this.can, id: 'pose-back',
      onclick: () => this.#goBack() }, 'Back to the first pose');
    this.rate = h('input', { type: 'number', disabled: !this.can, step: 0.05, 'aria-label': 'rate of the joints',
      onchange: () => this.#set('pose.rate_rad_s', Number(this.rate.value)) });
    this.element = h('section', { class: 'panel', id: 'panel-pose' },
      h('div', { class: 'tools' }, h('label', {}, h('span', {}, 'at most'), this.rate,
        h('span', { class: 'muted' }, 'rad/s')), this.back),
      this.list);
  }

  /** Reads the task's settings when the panel opens. */
  async shown(visible) {
    if (!visible) return;
    try {
      const { tunables } = await this.link.ask('list', { what: 'tunables', match: 'pose.*' });
      this.#make(tunables);
    } catch (error) {
      this.complain(error.message);
    }
  }

  #make(tunables) {
    const joints = new Map(this.hello.scene.joints.map((joint, j) => [`pose.${joint.name}_rad`, { joint, j }]));
    const rate = tunables.find(({ name }) => name === 'pose.rate_rad_s');
    if (rate) Object.assign(this.rate, { min: rate.min, max: rate.max, value: String(rate.value) });
    this.#rows = tunables.filter(({ name }) => joints.has(name))
      .map((tunable) => this.#makeRow(tunable, joints.get(tunable.name)));
    this.first ??= new Map(this.#rows.map(({ tunable }) => [tunable.name, tunable.value]));
    this.list.replaceChildren(...this.#rows.map(({ element }) => element));
  }

  #makeRow(tunable, { joint, j }) {
    const row = { tunable, j, mark: h('i'), wanted: h('output', { class: 'mono' }) };
    const change = () => {
      this.#show(row, Number(row.range.value));
      this.#set(tunable.name, Number(row.range.value));
    };
    row.range = h('input', { type: 'range', min: tunable.min, max: tunable.max,
      step: (tunable.max - tunable.min) / STEPS, disabled: !this.can, 'aria-label': `angle of ${joint.name}`,
      'data-joint': joint.name, oninput: change });
    row.range.value = String(tunable.value);
    row.element = h('label', { class: 'slider' }, h('span', { class: 'name' }, joint.name),
      h('span', { class: 'track' }, row.mark, row.range), row.wanted);
    this.#show(row, tunable.value);
    return row;
  }

  #show(row, angle) {
    const text = `${fixed(angle * DEGREES, 1)}°`;
    setText(row.wanted, text);
    row.range.setAttribute('aria-valuetext', text);
  }

  #goBack() {
    for (const row of this.#rows) {
      const angle = this.first.get(row.tunable.name);
      row.range.value = String(angle);
      this.#show(row, angle);
      this.#set(row.tunable.name, angle);
    }
  }

  /** Sends the values of a setting, one request at a time; skips all but the newest waiting
   * value. */
  async #set(name, value) {
    this.#waiting.set(name, value);
    if (this.#asking) return;
    this.#asking = true;
    while (this.#waiting.size) {
      const [next, angle] = this.#waiting.entries().next().value;
      const { min = angle, max = angle } = this.#rows.find(({ tunable }) => tunable.name === next)?.tunable ?? {};
      this.#waiting.delete(next);
      try {
        await this.link.ask('set', { name: next, value: Math.min(Math.max(angle, min), max) });
      } catch (error) {
        this.complain(error.message);
        this.#waiting.clear();
      }
    }
    this.#asking = false;
  }

  /** Marks the present angles of the joints. */
  render(state) {
    for (const { tunable, j, mark } of this.#rows) {
      const part = (state.joints[2 * j] - tunable.min) / (tunable.max - tunable.min);
      mark.style.left = `${fixed(100 * Math.min(1, Math.max(0, part)), 1)}%`;
    }
  }
}
