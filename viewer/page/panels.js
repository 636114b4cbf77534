// SPDX-License-Identifier: Apache-2.0
// The tables and tiles beside the picture: joints, boards, buses, faults and pushes, parameters.
import { count, fixed, h, setClass, setText, short } from './dom.js';
import { describe } from './words.js';

/** Returns a name that may wrap after its dots and underscores. */
const breakable = (name) => name.split(/(?<=[._])/).map((part) => [part, h('wbr')]);

const STATES = ['up', 'warning', 'passive', 'bus off', 'down', 'gone', 'stuck'];

export class Joints {
  constructor(hello, pick) {
    this.joints = hello.scene.joints;
    this.rows = this.joints.map((joint) => {
      const row = { angle: h('td', { class: 'mono right' }), torque: h('td', { class: 'mono right' }),
        bar: h('i'), mark: h('b') };
      row.element = h('tr', { tabIndex: 0, draggable: true, onclick: () => pick(joint.name),
        onkeydown: (event) => {
          if (event.key === 'Enter') pick(joint.name);
        },
        ondragstart: (event) => event.dataTransfer.setData('text/plain', `q_${joint.name}_rad\ntorque_${joint.name}_nm`) },
      h('td', { title: describe(joint.name) }, breakable(joint.name)), row.angle,
        h('td', { class: 'range' }, h('span', {}, row.mark)), row.torque,
        h('td', { class: 'load' }, h('span', {}, row.bar)));
      return row;
    });
    this.element = h('section', { class: 'panel', id: 'panel-joints' },
      h('div', { class: 'scroll' }, h('table', { class: 'joints' },
        h('thead', {}, h('tr', {}, ['Joint', 'Angle', 'in its range', 'Torque', 'of its limit']
          .map((title) => h('th', {}, title)))),
        h('tbody', {}, this.rows.map((row) => row.element)))),
      h('p', { class: 'muted hint' }, 'A click on a joint plots its angle and torque.'));
  }

  render(state) {
    this.joints.forEach((joint, j) => {
      const row = this.rows[j];
      const angle = state.joints[2 * j];
      const torque = state.joints[2 * j + 1];
      const range = joint.upper - joint.lower;
      const part = Math.min(1, Math.abs(torque) / (joint.torque_limit_nm || 50));
      setText(row.angle, joint.type === 'revolute' ? `${fixed(angle * 180 / Math.PI, 1)}°`
        : `${fixed(1e3 * angle, 1)} mm`);
      setText(row.torque, `${fixed(torque, 1)} N m`);
      row.mark.style.left = `${fixed(100 * Math.min(1, Math.max(0, range > 0 ? (angle - joint.lower) / range : 0.5)), 1)}%`;
      row.bar.style.width = `${fixed(100 * part, 1)}%`;
      row.bar.className = part > 0.8 ? 'hot' : part > 0.35 ? 'warm' : '';
    });
  }
}

export class Boards {
  constructor(hello) {
    this.hello = hello;
    this.tiles = hello.boards.map((board) => {
      const tile = { mode: h('p', { class: 'mode' }), age: h('span', { class: 'mono' }),
        name: h('b', {}, board.kind === 'motor'
          ? board.joints.map((j) => hello.scene.joints[j].name).join(', ') : board.kind) };
      tile.element = h('article', { class: 'tile' },
        h('header', {}, h('span', { class: 'mono muted' }, `0x${board.address.toString(16).padStart(2, '0')}`), tile.age),
        tile.name, tile.mode);
      return tile;
    });
    this.element = h('section', { class: 'panel', id: 'panel-boards' }, h('div', { class: 'scroll' },
      hello.buses.map((bus, b) => h('div', { class: 'shelf' },
        h('h3', {}, bus.name, h('span', { class: 'muted' }, ` ${bus.protocol}`)),
        h('div', { class: 'tiles' }, this.tiles.filter((_, i) => hello.boards[i].bus === b)
          .map((tile) => tile.element))))));
  }

  /** Returns the text for a board's state: the modes of its axes, or why it has none. */
  #mode(board, state) {
    if (state.external) return state.silent ? 'real board, silent' : 'real board';
    if (state.away) return 'off the bus';
    if (state.loader) return 'bootloader';
    if (board.kind !== 'motor') return 'measures';
    const words = this.hello.modes[this.hello.buses[board.bus].protocol] ?? {};
    const names = state.mode.slice(0, state.naxis).map((mode) => words[mode] ?? `mode ${mode}`);
    return new Set(names).size === 1 ? names[0] : names.join(', ');
  }

  render(state) {
    state.boards.forEach((now, i) => {
      const board = this.hello.boards[i];
      const tile = this.tiles[i];
      const mode = this.#mode(board, now);
      const late = board.kind === 'motor' && now.age > 0.1;
      setText(tile.mode, now.faulty ? `fault: ${mode}` : mode);
      setText(tile.age, now.age < 0 ? 'never heard of' : now.age < 1 ? `${fixed(1e3 * now.age, 0)} ms`
        : `${fixed(now.age, 1)} s`);
      tile.age.title = now.external ? 'since the last telemetry of this board'
        : 'since the last frame for this board';
      setClass(tile.element, 'bad', now.faulty || now.away || now.silent);
      setClass(tile.element, 'off', !now.faulty && (now.loader || mode === 'idle' || mode === 'off'));
      setClass(tile.element, 'run', board.kind === 'motor' && !now.faulty && mode !== 'idle' && mode !== 'off');
      setClass(tile.age, 'late', late);
    });
  }
}

export class Buses {
  #history = [];

  constructor(hello) {
    this.hello = hello;
    this.rows = hello.buses.map((bus) => {
      const row = { state: h('span', { class: 'state' }), load: h('b', { class: 'mono' }),
        bar: h('i'), figures: h('p', { class: 'mono muted' }), answers: h('p', { class: 'mono muted' }), lost: h('p', { class: 'mono' }),
        curve: document.createElementNS('http://www.w3.org/2000/svg', 'polyline') };
      const chart = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
      chart.setAttribute('viewBox', '0 0 120 30');
      chart.setAttribute('preserveAspectRatio', 'none');
      chart.append(row.curve);
      row.element = h('article', { class: 'bus' },
        h('header', {}, h('b', {}, bus.name), h('span', { class: 'muted' },
          `${bus.interface} · ${short(bus.bitrate / 1e3)} kbit/s${bus.fd ? ' FD' : ''}`), row.state),
        h('div', { class: 'loadline' }, h('span', { class: 'meter' }, row.bar), row.load), chart,
        row.figures, row.answers, row.lost);
      row.past = [];
      return row;
    });
    this.element = h('section', { class: 'panel', id: 'panel-buses' },
      h('div', { class: 'scroll' }, this.rows.map((row) => row.element)));
  }

  render(state) {
    this.#history.push({ time: state.time, buses: state.buses });
    while (this.#history.length > 2 && (state.time - this.#history[0].time > 1
      || this.#history[0].time > state.time)) this.#history.shift();
    const then = this.#history[0];
    const span = state.time - then.time;
    state.buses.forEach((bus, b) => {
      const row = this.rows[b];
      const rate = (key) => span > 0 ? count(Math.round((bus[key] - then.buses[b][key]) / span)) : '–';
      const load = Math.min(1, bus.load);
      row.past.push(load);
      if (row.past.length > 60) row.past.shift();
      row.curve.setAttribute('points', row.past.map((l, i) => `${2 * i},${fixed(29 - 28 * l, 1)}`).join(' '));
      setText(row.load, `${fixed(100 * bus.load, 1)} %`);
      row.bar.style.width = `${fixed(100 * load, 1)}%`;
      row.bar.className = load > 0.9 ? 'hot' : load > 0.7 ? 'warm' : '';
      if (this.hello.run.replay) { // a log does not record the sender of a frame
        setText(row.figures, `${count(bus.rx)} frames, ${rate('rx')} a second`);
        return;
      }
      setText(row.state, STATES[bus.state] ?? 'unknown');
      setClass(row.state, 'bad', bus.state > 0);
      setText(row.figures, `to boards    ${count(bus.rx)}, ${rate('rx')} a second`);
      setText(row.answers, `from boards  ${count(bus.tx)}, ${rate('tx')} a second`);
      setText(row.lost, bus.rxLost + bus.txLost ? `lost: ${count(bus.rxLost)} received, ${count(bus.txLost)} sent` : '');
    });
  }
}

export class Actions {
  constructor(link, hello, scene, complain) {
    this.link = link;
    this.hello = hello;
    this.scene = scene;
    this.complain = complain;
    this.can = hello.right === 'control';
    this.element = h('section', { class: 'panel', id: 'panel-actions' },
      h('div', { class: 'scroll' }, this.can ? null : h('p', { class: 'note' },
        'This page may look, and not control: the address with the other token can.'),
      this.#buildPush(), this.#buildFaults(), this.#buildCheckpoints()));
  }

  async #do(cmd, keys) {
    try {
      return await this.link.ask(cmd, keys);
    } catch (error) {
      this.complain(error.message);
      return null;
    }
  }

  // ---- pushes ----

  #buildPush() {
    const bodies = this.hello.scene.bodies.map((body, i) => h('option', { value: String(i) }, body.name));
    // choose the heaviest body that can move; the base of a fixed robot cannot
    const first = this.hello.scene.floating || bodies.length < 2 ? 0 : 1;
    const trunk = this.hello.scene.bodies.reduce((best, body, i, all) =>
      i > first && body.mass_kg > all[best].mass_kg ? i : best, first);
    const number = (label, value, min, max, step, unit) => {
      const input = h('input', { type: 'number', min, max, step, value: String(value) });
      return [input, h('label', {}, h('span', {}, label), input, h('span', { class: 'muted' }, unit))];
    };
    const [force, forceLabel] = number('Force', 60, 0, 2000, 5, 'N');
    const [duration, durationLabel] = number('for', 0.1, 0.001, 10, 0.05, 's');
    const ways = { '← back': [-1, 0, 0], 'front →': [1, 0, 0], 'left': [0, 1, 0], 'right': [0, -1, 0],
      '↑ up': [0, 0, 1] };
    this.body = h('select', { id: 'push-body', 'aria-label': 'body', onchange: () =>
      this.choose(Number(this.body.value)) }, bodies);
    this.body.value = String(trunk);
    const show = (way) => this.scene.showPush(Number(this.body.value),
      way?.map((part) => part * Number(force.value)));
    const buttons = Object.entries(ways).map(([name, way]) => h('button', { class: 'quiet',
      'data-way': way.join(), onmouseenter: () => show(way), onmouseleave: () => this.scene.showPush(null),
      onclick: () => this.#do('push', { body: this.hello.scene.bodies[Number(this.body.value)].name,
        force_n: way.map((part) => part * Number(force.value)), duration_s: Number(duration.value) }) },
    name));
    return h('fieldset', { disabled: !this.can }, h('legend', {}, 'Push'),
      h('div', { class: 'tools' }, this.body, forceLabel, durationLabel),
      h('div', { class: 'ways' }, buttons),
      h('p', { class: 'muted hint' }, 'A click on the robot chooses the body.'));
  }

  choose(index) {
    if (index !== null) this.body.value = String(index);
    this.scene.robot.mark(index);
  }

  // ---- faults ----

  #buildFaults() {
    this.faults = this.hello.faults.map((fault) => {
      const box = h('input', { type: 'checkbox', role: 'switch', onclick: (event) => {
        event.preventDefault();
        this.#do('fault', { name: fault.name, on: !this.active?.[this.hello.faults.indexOf(fault)] });
      } });
      const element = h('label', { class: 'fault', 'data-fault': fault.name }, box, h('span', {}, h('b', {},
        fault.name), h('span', { class: 'muted' }, fault.text.replace(`${fault.name}: `, ''))));
      return { box, element };
    });
    return h('fieldset', { disabled: !this.can, id: 'faults' }, h('legend', {}, 'Faults'),
      this.faults.length ? this.faults.map((fault) => fault.element) : h('p', { class: 'muted hint' },
        'This run has none. Give it some to switch here, as: --fault \'motor LKneeSag jam manual\''));
  }

  // ---- checkpoints ----

  #buildCheckpoints() {
    const slot = h('select', { 'aria-label': 'slot' }, ['1', '2', '3'].map((n) => h('option', {}, n)));
    const say = async (cmd, keys, text) => {
      const answer = await this.#do(cmd, keys);
      if (answer) this.complain(`${text} at ${fixed(answer.time_s, 3)} s`, true);
    };
    return h('fieldset', { disabled: !this.can }, h('legend', {}, 'Checkpoints'),
      h('div', { class: 'tools' }, slot,
        h('button', { class: 'quiet', onclick: () => say('checkpoint', { slot: Number(slot.value) }, 'Saved') }, 'Save'),
        h('button', { class: 'quiet', onclick: () => say('restore', { slot: Number(slot.value) }, 'Restored') }, 'Restore'),
        h('button', { class: 'quiet', onclick: () => say('reset', {}, 'At the start,') }, 'Back to the start')));
  }

  render(state) {
    this.active = state.faults;
    this.faults.forEach(({ box, element }, i) => {
      box.checked = state.faults[i];
      setClass(element, 'on', state.faults[i]);
    });
  }
}

export class Parameters {
  constructor(link, hello, complain) {
    this.link = link;
    this.can = hello.right === 'control';
    this.complain = complain;
    this.search = h('input', { type: 'search', placeholder: 'gain, limit, supply…',
      'aria-label': 'search parameters', oninput: () => this.#draw() });
    this.body = h('tbody');
    this.element = h('section', { class: 'panel', id: 'panel-parameters' },
      h('div', { class: 'tools' }, this.search),
      h('div', { class: 'scroll' }, h('table', { class: 'parameters' }, h('thead', {}, h('tr', {},
        ['Parameter', 'Value', 'Unit', 'Range'].map((title) => h('th', {}, title)))), this.body)));
  }

  async shown(visible) {
    if (!visible) return;
    try {
      this.list = (await this.link.ask('list', { what: 'tunables' })).tunables;
      this.#draw();
    } catch (error) {
      this.complain(error.message);
    }
  }

  #draw() {
    const words = this.search.value.toLowerCase().split(/[\s._]+/).filter(Boolean);
    const found = (this.list ?? []).filter(({ name }) =>
      words.every((word) => describe(name).includes(word))).slice(0, 120);
    if (this.list && !found.length) {
      this.body.replaceChildren(h('tr', {}, h('td', { class: 'muted none', colSpan: 4 },
        `No parameter has “${this.search.value.trim()}” in its name or description.`)));
      return;
    }
    this.body.replaceChildren(...found.map((tunable) => {
      const input = h('input', { type: 'number', step: tunable.whole ? 1 : 'any', disabled: !this.can,
        value: String(tunable.value), onchange: async () => {
          try {
            await this.link.ask('set', { name: tunable.name, value: Number(input.value) });
            tunable.value = Number(input.value);
          } catch (error) {
            input.value = String(tunable.value);
            this.complain(error.message);
          }
        } });
      return h('tr', {}, h('td', {}, breakable(tunable.name)), h('td', {}, input), h('td', { class: 'muted' },
        tunable.unit), h('td', { class: 'muted mono' }, `${short(tunable.min)} … ${short(tunable.max)}`));
    }));
  }
}
