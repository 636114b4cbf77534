// SPDX-License-Identifier: Apache-2.0
// The page of a run: creates its parts and updates them.
import plotStyle from 'uplot/dist/uPlot.min.css';
import { Camera, VIEWS } from './camera.js';
import { Compare } from './compare.js';
import { count, fixed, h, setClass, setText } from './dom.js';
import { Drag } from './drag.js';
import { Ending } from './ending.js';
import { Events, Past } from './events.js';
import { Link } from './link.js';
import { Actions, Boards, Buses, Joints, Parameters } from './panels.js';
import { Playback } from './playback.js';
import { Plots } from './plots.js';
import { Pose } from './pose.js';
import { Recorder, shoot } from './record.js';
import { Scene } from './scene.js';
import { feedStore } from './series_feed.js';
import style from './style.css';
import { Trace } from './trace.js';
import { Welcome } from './welcome.js';

const TABLES_MS = 120;
const PACE_S = 0.5; // period over which the pace is measured
const LATE_MS = 10000; // how long an overrun is shown in color
const KEYS = [['Space', 'pause, go on'], ['.', 'one tick'], [',', 'ten ticks'], ['L', 'live again'],
  ['1 … 6', 'panels'],
  ['J', 'sliders of the task pose'], ['B', 'drag bodies, or turn the camera'], ['Ctrl drag', 'pushes a body']];
const REPLAY_KEYS = [['Space', 'play, pause'], ['. ,', 'a row on, back'], ['→ ←', 'a second on, back'],
  ['] [', 'next event, event before'], ['Home End', 'begin, end'], ['1 2 6', 'panels']];
const ALL_KEYS = [['/', 'search a signal'], ['F', 'forces'], ['C', 'center of mass'],
  ['Q', 'torques by color'],
  ['I', 'ellipsoids of inertia'], ['V', 'how it looks, or what can touch'], ['R', 'look at the robot'],
  ...Object.values(VIEWS).map(({ key, text }) => [key, `look ${text}`]), ['W', 'follow the robot, or not'],
  ['P', 'save the picture'], ['T', 'light or dark'], ['?', 'this list']];

for (const text of [plotStyle, style]) {
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(text);
  document.adoptedStyleSheets.push(sheet);
}

const link = new Link();
const page = {};
let newest = null;

// ---- messages to the user ----

/** Shows a message. good: not an error. stays: shown until the user closes it. */
function complain(text, good = false, stays = false) {
  const toast = h('div', { class: good ? 'toast good' : 'toast', role: stays ? 'alert' : 'status' }, text,
    stays ? h('button', { class: 'icon', 'aria-label': 'close', onclick: () => toast.remove() }, '×') : null);
  page.toasts.append(toast);
  if (!stays) setTimeout(() => toast.remove(), 5000);
}

async function act(cmd, keys) {
  try {
    return await link.ask(cmd, keys);
  } catch (error) {
    complain(error.message);
    return null;
  }
}

function setTheme(theme) {
  page.theme = theme;
  document.documentElement.dataset.theme = theme;
  try {
    localStorage.setItem('theme', theme);
  } catch { /* the browser has no storage */ }
  page.scene?.setTheme(theme);
  page.plots?.setTheme();
}

function firstTheme() {
  try {
    const kept = localStorage.getItem('theme');
    if (kept) return kept;
  } catch { /* the browser has no storage */ }
  return matchMedia('(prefers-color-scheme: dark)').matches ? 'dark' : 'light';
}

// ---- the frame of the page ----

function figure(name, title) {
  const value = h('b', { class: 'mono', id: `figure-${name}` }, '–');
  return [value, h('div', { class: 'figure', title }, h('span', {}, name), value)];
}

function makeFrame() {
  page.toasts = h('div', { class: 'toasts' });
  page.gone = h('div', { class: 'gone', role: 'alert', hidden: true });
  page.root = h('main', { class: 'root' });
  document.body.replaceChildren(page.root, page.gone, page.toasts);
}

/** Creates the figures of the bar: a run's load, or a recording's length. */
function makeFigures(hello) {
  if (hello.run.replay) {
    const parts = { time: figure('time', 'virtual time'), length: figure('length', 'of what is shown'),
      rows: figure('rows', 'how far apart rows of signals are') };
    setText(parts.length[0], `${fixed(hello.run.replay.to_s - hello.run.replay.from_s, 2)} s`);
    setText(parts.rows[0], `${fixed(1e3 * hello.run.replay.period_s, 1)} ms`);
    return parts;
  }
  return { time: figure('time', 'virtual time'),
    factor: figure('pace', 'virtual seconds a second'),
    tick: figure('tick', 'what a tick takes: mean of late, 99th percentile and greatest of all'),
    overruns: figure('overruns', 'ticks that missed their deadline, and deadlines that were skipped') };
}

const SPEEDS = [[0.05, '×0.05'], [0.1, '×0.1'], [0.25, '×0.25'], [0.5, '×0.5'], [1, '×1'], [2, '×2'],
  [5, '×5']];

function makeBar(hello) {
  const { replay } = hello.run;
  const can = hello.right === 'control' || Boolean(replay);
  const fast = replay ? [[10, '×10'], [20, '×20']] : [[0, 'fastest']];
  const timed = Boolean(replay) || hello.run.clock === 'real';
  const parts = makeFigures(hello);
  page.figures = Object.fromEntries(Object.entries(parts).map(([name, [value]]) => [name, value]));
  page.budget = h('i');
  page.pause = h('button', { id: 'pause', class: 'main', disabled: !can, title: 'Space',
    onclick: () => act(newest?.paused ? 'resume' : 'pause') }, 'Pause');
  page.step = h('button', { id: 'step', class: 'quiet', disabled: !can, title: 'one tick: .',
    onclick: () => act('step', { count: 1 }) }, 'Step');
  page.speed = h('select', { 'aria-label': 'speed', disabled: !can || !timed,
    title: timed ? 'virtual seconds a second' : 'only the real clock has a speed',
    onchange: () => act('speed', { factor: Number(page.speed.value) }) },
  [...SPEEDS, ...fast].map(([value, text]) => h('option', { value: String(value), selected: value === 1 }, text)));
  page.right = h('span', { class: can ? 'badge control' : 'badge', id: 'right' },
    replay ? 'recording' : can ? 'control' : 'look only');
  return h('header', { class: 'bar' },
    h('div', { class: 'brand' }, h('b', {}, hello.run.robot), h('span', {}, `${hello.run.rig}${hello.run.task ? ` · ${hello.run.task}` : ''}`)),
    h('div', { class: 'figures' }, Object.values(parts).map(([, element]) => element)),
    replay ? h('span', { class: 'muted file', title: hello.run.recording }, hello.run.recording)
      : h('div', { class: 'budget', title: `the tick's budget: ${fixed(1e6 * hello.run.tick_s, 0)} us` }, page.budget),
    h('div', { class: 'transport' }, page.pause, page.step, page.speed),
    page.right,
    h('button', { class: 'icon', title: 'light or dark: T', 'aria-label': 'light or dark',
      onclick: () => setTheme(page.theme === 'dark' ? 'light' : 'dark') }, '◐'),
    h('button', { class: 'icon', title: 'keys: ?', 'aria-label': 'keys', onclick: () => page.help.showModal() }, '?'));
}

/** Creates the menu of views, for devices without a keyboard. */
function makeCameraSelect() {
  const select = h('select', { class: 'toggle', 'aria-label': 'camera', title: 'keys 7, 8, 9, 0', onchange: () => {
    look(select.value);
    select.value = '';
  } }, h('option', { value: '' }, 'Camera'), Object.entries(VIEWS).map(([name, { text }]) =>
    h('option', { value: name }, text)));
  return select;
}

/** Moves the camera to a view of VIEWS. */
function look(name) {
  page.camera.view(name, page.chosen);
  if (newest) page.scene.update(page.past.shown ?? newest);
}

/** Creates the buttons to drag bodies, and to save pictures and recordings. */
function makeButtons(hello) {
  const buttons = [h('button', { class: 'toggle', id: 'shoot', title: 'save the picture: P',
    onclick: () => shoot(page.scene, `${hello.run.rig}-${fixed((page.past.shown ?? newest)?.time ?? 0, 3)}s.png`) }, 'Picture')];
  if (hello.right === 'control' && !hello.run.replay) {
    page.drag = new Drag(link, hello, page.scene, { pace: () => pace.factor, complain });
    page.dragMode = h('button', { class: 'toggle', id: 'drag', 'aria-pressed': 'false',
      title: 'a drag pushes a body: B; else Ctrl and drag', onclick: () => {
        page.drag.mode = !page.drag.mode;
        page.dragMode.setAttribute('aria-pressed', String(page.drag.mode));
      } }, 'Drag bodies');
    buttons.unshift(page.dragMode);
  }
  if (!hello.run.replay) buttons.push(page.recorder.button);
  return buttons;
}

function makeView(hello) {
  const canvas = h('canvas', { id: 'view', tabIndex: 0, 'aria-label': 'the robot' });
  const stage = h('div', { class: 'canvas' }, canvas);
  const loadMesh = async (url) => (await link.fetch(url)).arrayBuffer();
  page.scene = new Scene(canvas, hello, loadMesh,
    new URLSearchParams(location.hash.slice(1)).get('quality'));
  page.scene.hurried = () => link.watch({ rate_hz: 15 });
  const toggle = (key, name, keyName) => h('button', { class: 'toggle', title: keyName,
    'aria-pressed': String(page.scene.show[key]), 'data-show': key, onclick: (event) => {
      page.scene.show[key] = !page.scene.show[key];
      event.currentTarget.setAttribute('aria-pressed', String(page.scene.show[key]));
      if (newest) page.scene.update(page.past.shown ?? newest);
    } }, name);
  let down = null;
  canvas.addEventListener('pointerdown', (event) => { down = [event.clientX, event.clientY]; });
  canvas.addEventListener('pointerup', (event) => {
    if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 4) {
      const body = page.scene.pick(event.clientX, event.clientY);
      if (page.actions) page.actions.choose(body);
      else page.scene.robot.mark(body);
      page.chosen = body;
      setText(page.picked, body === null ? '' : `${hello.scene.bodies[body].name} · ${fixed(hello.scene.bodies[body].mass_kg, 2)} kg`);
    }
  });
  page.camera = new Camera(page.scene, hello);
  page.compare = new Compare(hello, page.scene, loadMesh, { complain,
    changed: (table) => page.plots.compareWith(table) });
  page.plots.compare.append(page.compare.element);
  page.picked = h('span', { class: 'picked mono' });
  page.badge = h('span', { class: 'status', id: 'status' });
  return h('section', { class: 'view' }, stage,
    h('div', { class: 'overlay' }, page.badge, page.picked),
    h('div', { class: 'toggles' }, toggle('forces', 'Forces', 'F'), toggle('centers', 'Center of mass', 'C'),
      toggle('torques', 'Torques', 'Q'), toggle('skeleton', 'Inertia', 'I'), toggle('follow', 'Follow', 'W'),
      hello.scene.visuals?.length ? toggle('visuals', 'Looks', 'V') : null),
    h('div', { class: 'toggles left' }, makeCameraSelect(), makeButtons(hello)),
    makeLacks(),
    page.past.element);
}

/** Creates the list of visual shapes that cannot be shown; hidden while none is missing. */
function makeLacks() {
  const sum = h('summary', {});
  const list = h('ul', {});
  const element = h('details', { class: 'lacks', hidden: true, role: 'status' }, sum, list);
  page.scene.loaded = () => {
    const { lacks } = page.scene.robot;
    element.hidden = lacks.length === 0;
    setText(sum, `${lacks.length} ${lacks.length === 1 ? 'shape is' : 'shapes are'} missing`);
    list.replaceChildren(...lacks.map(({ name, reason }) => h('li', {}, h('b', {}, name), ` ${reason}`)));
  };
  page.scene.loaded();
  return element;
}

function makeTabs(name, panels, first) {
  const buttons = panels.map(([title, panel], i) => h('button', { role: 'tab', id: `tab-${panel.element.id}`,
    onclick: () => open(i) }, title));
  const open = (index) => panels.forEach(([, panel], i) => {
    const on = i === index;
    panel.element.hidden = !on;
    buttons[i].setAttribute('aria-selected', String(on));
    if (Boolean(panel.isOpen) !== on) {
      panel.isOpen = on;
      panel.shown?.(on);
    }
  });
  const element = h('section', { class: `tabs ${name}` }, h('nav', { role: 'tablist' }, buttons),
    h('div', { class: 'sheets' }, panels.map(([, panel]) => panel.element)));
  open(first);
  return { element, open };
}

function makeHelp(hello) {
  const keys = [...(hello.run.replay ? REPLAY_KEYS : KEYS), ...ALL_KEYS];
  page.help = h('dialog', { class: 'help' }, h('h2', {}, 'Keys'), h('dl', {}, keys.map(([key, text]) =>
    [h('dt', { class: 'mono' }, key), h('dd', {}, text)])),
  h('form', { method: 'dialog' }, h('button', { class: 'main' }, 'Close'),
    h('button', { class: 'plain', onclick: () => page.welcome.open() }, 'What am I looking at?')));
  return page.help;
}

function plotJoint(name) {
  // a cylinder has pressures too; the plot ignores signals that do not exist
  page.plots.add(`q_${name}_rad`, `torque_${name}_nm`,
    `piston_pressure_${name}_pa`, `rod_pressure_${name}_pa`);
  page.bottom.open(0);
}

/** Returns what a newcomer may try: what this page has the right to do. */
function makeTries(hello) {
  const { joints } = hello.scene;
  const joint = (joints.find(({ name }) => /Knee|Elb|kfe/i.test(name)) ?? joints[0])?.name;
  const plot = ['A click on a row of Joints plots its angle and torque.', joint && `Plot ${joint}`, () => plotJoint(joint)];
  const turn = ['Drag the picture to turn the camera; the wheel zooms.', null];
  const back = ['Drag the line below the picture to an earlier moment. Live returns.', null];
  if (hello.run.replay) return [['Play the recording.', 'Play', () => page.pause.click()], back, plot];
  if (hello.right !== 'control') return [turn, plot, back];
  return [['Push the robot: hold Ctrl and drag a part of it, or', 'drag without Ctrl', () => page.dragMode.click()], plot,
    ['Make something fail: the panel Act has pushes, faults and checkpoints.', 'Open Act',
      () => page.side.open(page.panels.findIndex(([name]) => name === 'Act'))]];
}

function build(hello) {
  document.title = `${hello.run.rig} · coman-hil`;
  page.hello = hello;
  page.late = { count: Infinity, at: -Infinity }; // the overruns of before are no news
  page.past = hello.run.replay ? new Playback(link, hello.run.replay, () => page.trace.reset()) : new Past(() => {
    const state = page.past.shown ?? newest;
    if (state) page.scene.update(state);
    page.tablesAt = 0;
  });
  page.store = hello.run.replay ? null : feedStore(link, hello);
  page.plots = new Plots(link, hello, complain, page.store);
  page.recorder = new Recorder(link, hello, page.plots, complain);
  const view = makeView(hello);
  page.ending = new Ending(link, complain);
  page.events = new Events(link, page.past);
  page.trace = new Trace(link, hello, complain);
  page.joints = new Joints(hello, plotJoint);
  page.buses = new Buses(hello);
  page.panels = [['Joints', page.joints], ['Buses', page.buses]];
  if (hello.run.replay) {
    page.plots.seek = (time) => page.past.show(time);
    if (hello.run.replay.with) page.compare.fetch(link, hello.run.replay.with);
    page.events.load(link).catch((error) => complain(error.message));
  } else {
    page.boards = new Boards(hello);
    page.actions = new Actions(link, hello, page.scene, complain);
    page.parameters = new Parameters(link, hello, complain);
    page.panels.splice(1, 0, ['Boards', page.boards]);
    page.panels.push(['Act', page.actions], ['Parameters', page.parameters]);
    if (hello.run.task === 'pose') page.panels.push(['Pose', new Pose(link, hello, complain)]);
  }
  page.side = makeTabs('side', page.panels, hello.run.task === 'pose' ? page.panels.length - 1 : 0);
  page.bottom = makeTabs('bottom', [['Plots', page.plots], ['Frames', page.trace], ['Events', page.events]], 0);
  page.welcome = new Welcome(hello, makeTries(hello));
  view.append(page.welcome.element, page.ending.element);
  page.root.replaceChildren(makeBar(hello), view, page.side.element, page.bottom.element, makeHelp(hello));
  setTheme(firstTheme());
}

// ---- keys ----

const ACTIONS = {
  ' ': () => page.pause.click(),
  '.': () => page.step.click(),
  ',': () => page.hello.right === 'control' && !page.over && act('step', { count: 10 }),
  l: () => page.past.show(null),
  r: () => {
    page.camera.free();
    page.scene.reset();
  },
  j: () => page.side.open(Math.max(0, page.panels.findIndex(([name]) => name === 'Pose'))),
  b: () => page.dragMode?.click(),
  p: () => document.getElementById('shoot').click(),
  t: () => setTheme(page.theme === 'dark' ? 'light' : 'dark'),
  '?': () => page.help.showModal(),
  '/': () => {
    page.bottom.open(0);
    page.plots.search.focus();
  },
  6: () => page.bottom.open(1),
};
for (const [name, { key }] of Object.entries(VIEWS)) ACTIONS[key] = () => look(name);
for (let i = 1; i <= 5; i++) ACTIONS[i] = () => i <= page.panels.length && page.side.open(i - 1);

/** Keys of a recording, which add to ACTIONS or replace some of them. */
const REPLAY_ACTIONS = {
  ',': () => page.past.move(-page.hello.run.replay.period_s),
  ArrowRight: () => page.past.move(1),
  ArrowLeft: () => page.past.move(-1),
  '[': () => page.past.jump(-1),
  ']': () => page.past.jump(1),
  Home: () => page.past.show(page.hello.run.replay.from_s),
  End: () => page.past.show(page.hello.run.replay.to_s),
};
for (const [key, name] of [['f', 'forces'], ['c', 'centers'], ['q', 'torques'], ['i', 'skeleton'],
  ['v', 'visuals'], ['w', 'follow']]) {
  ACTIONS[key] = () => document.querySelector(`[data-show=${name}]`)?.click();
}

/** Keys that move a slider. */
const SLIDES = /^(Arrow|Page|Home|End)/;

addEventListener('keydown', (event) => {
  const typing = event.target.closest?.('input:not([type=range]), select, textarea, dialog')
    || (SLIDES.test(event.key) && event.target.closest?.('input[type=range]:not(#past)'));
  if (typing || event.ctrlKey || event.metaKey || event.altKey || !page.built) return;
  const action = (page.hello.run.replay && REPLAY_ACTIONS[event.key]) || ACTIONS[event.key]
    || ACTIONS[event.key.toLowerCase()];
  if (action && !(event.key === ' ' && event.target.closest?.('button'))) {
    event.preventDefault();
    action();
  }
});

// ---- messages from the server ----

link.addEventListener('hello', ({ detail }) => {
  page.gone.hidden = true;
  if (page.hello?.run.id === detail.run.id) {
    setOver(page.over === 'ended' ? 'ended' : '');
    return;
  }
  // Another run at this address: reload the page
  if (page.hello) {
    location.reload();
    return;
  }
  try {
    build(detail);
    page.built = true;
  } catch (error) {
    console.error(error);
    page.root.replaceChildren(h('p', { class: 'note' }, `This browser cannot show the robot: ${error.message}`));
  }
});

/** Disables the controls. over: 'ended' or 'lost'; '' = the run is connected. */
function setOver(over) {
  const { replay } = page.hello.run;
  const can = !over && (page.hello.right === 'control' || Boolean(replay));
  page.over = over;
  page.past.word = { ended: 'End', lost: 'Lost' }[over] ?? 'Live';
  setClass(page.root, 'over', Boolean(over));
  page.pause.disabled = page.step.disabled = !can;
  page.speed.disabled = !can || (!replay && page.hello.run.clock !== 'real');
  setText(page.right, over || (replay ? 'recording' : page.hello.right === 'control' ? 'control' : 'look only'));
  for (const set of document.querySelectorAll('#panel-actions fieldset, .sender fieldset')) set.disabled = !can;
}

link.addEventListener('end', ({ detail }) => {
  if (!page.built) return;
  setOver('ended');
  page.ending.show(detail, page.events.all, () => page.bottom.open(2));
});

link.addEventListener('gone', ({ detail }) => {
  if (page.over === 'ended') {
    page.ending.lose();
    return;
  }
  if (page.built && !page.hello.run.replay) setOver('lost');
  page.gone.replaceChildren(h('b', {}, detail.reason), h('span', {}, detail.final ? ''
    : newest ? ` What is shown is of ${fixed(newest.time, 3)} s. Looking for it again…` : ' Looking for it again…'));
  page.gone.hidden = false;
});
link.addEventListener('complaint', ({ detail }) => complain(detail));

/** Pace: virtual seconds per second of the simulator's clock. States carry both times, so that the
 * time to draw has no effect. */
const pace = { time: NaN, clock: NaN, factor: NaN };

link.addEventListener('state', ({ detail }) => {
  const { state } = detail;
  if (!page.built) return;
  newest = state;
  updatePace(state);
  page.delay = Date.now() - state.sent;
  page.past.take(state);
  page.plots.take(state);
  page.drag?.update();
});

function updatePace(state) {
  const span = state.elapsed - pace.clock;
  if (span >= 0 && span < PACE_S) return;
  if (span > 0 && state.time >= pace.time) pace.factor = (state.time - pace.time) / span;
  pace.time = state.time;
  pace.clock = state.elapsed;
}

/** Returns the status badges over the picture: conditions that every user must see. */
function statusOf(state) {
  if (page.hello.run.replay) return ['', ''];
  if (page.past.shown) return ['looking back', 'back'];
  if (page.over) return [page.over, page.over];
  if (state.paused) return ['paused', 'paused'];
  if (state.clamped) return ['links are clamped', 'clamped'];
  return ['', ''];
}

/** Shows pace, tick duration and overruns of a run. */
function renderLoad(state) {
  const tick = 1e6 * page.hello.run.tick_s;
  const part = Math.min(1, state.workMean / tick);
  setText(page.figures.factor, page.over ? '–' : `×${fixed(state.paused ? 0 : pace.factor, 2)}`);
  setText(page.figures.tick, `${fixed(state.workMean, 0)} / ${fixed(state.work99, 0)} / ${fixed(state.workMax, 0)} us`);
  setText(page.figures.overruns, state.lost ? `${count(state.overruns)}, ${count(state.lost)} skipped` : count(state.overruns));
  if (state.overruns > page.late.count) page.late.at = Date.now();
  page.late.count = state.overruns;
  setClass(page.figures.overruns, 'late', Date.now() - page.late.at < LATE_MS);
  page.budget.style.width = `${fixed(100 * part, 1)}%`;
  page.budget.className = part > 0.8 ? 'hot' : part > 0.5 ? 'warm' : '';
}

function renderBar(state) {
  const { replay } = page.hello.run;
  if (!replay) renderLoad(state);
  setText(page.figures.time, `${fixed((page.past.shown ?? state).time, 3)} s`);
  const speed = String(+state.speed.toPrecision(3));
  if (document.activeElement !== page.speed && page.speed.value !== speed
    && [...page.speed.options].some(({ value }) => value === speed)) page.speed.value = speed;
  setText(page.pause, state.paused ? replay ? 'Play' : 'Go on' : 'Pause');
  const [text, kind] = statusOf(state);
  setText(page.badge, text);
  page.badge.className = `status ${kind}`;
}

function renderTables(state) {
  renderBar(newest);
  for (const [, panel] of page.panels) {
    if (panel.isOpen) panel.render?.(state);
  }
  page.trace.render();
  page.events.render(state.time);
  page.past.render(page.events.all);
  page.recorder.render(newest.time);
  if (page.plots.isOpen) page.plots.render();
}

function draw(now) {
  if (newest && page.scene) {
    const state = page.past.shown ?? newest;
    page.compare.show(state.time);
    page.scene.draw(now, state);
    if (now - (page.tablesAt ?? 0) > TABLES_MS * (page.scene.period ? 3 : 1)) {
      page.tablesAt = now;
      renderTables(page.past.shown ?? newest);
    }
  }
  requestAnimationFrame(draw);
}

makeFrame();
setTheme(firstTheme());
link.connect();
requestAnimationFrame(draw);

// For tests, and for the browser's console
window.coman = { link, page, get state() { return newest; } };
