// SPDX-License-Identifier: Apache-2.0
// Compares with a second recording: its signals are dashed curves in the same plots, and its robot
// is a transparent ghost. Its files come from the server (replay --with) or from the user's disk.
import * as THREE from 'three';
import { makeBodies } from './bodies.js';
import { h, setText } from './dom.js';
import { nearest } from './plot.js';

const TRIES = 5; // attempts to read a file from the server
const AGAIN_MS = 1000;
const POSE = 7; // columns of a body in poses.csv: position, quaternion wxyz
const GHOST = { color: 0x8e5bd6, transparent: true, opacity: 0.35, depthWrite: false };

/** Parses a CSV file of a recording. Returns the times and the columns with wanted titles, by
 * title. Cells that are not numbers are NaN. */
export function readTable(text, wanted = () => true) {
  const end = text.indexOf('\n');
  const titles = text.slice(0, end < 0 ? undefined : end).trimEnd().split(',');
  if (titles[0] !== 'time_s') {
    throw new Error('found no column time_s, expected signals.csv or poses.csv of a recording');
  }
  const lines = end < 0 ? [] : text.slice(end + 1).trimEnd().split('\n').filter(Boolean);
  const places = titles.flatMap((title, i) => i > 0 && wanted(title) ? [i] : []);
  const times = new Float64Array(lines.length);
  const columns = new Map(places.map((i) => [titles[i], new Float32Array(lines.length)]));
  lines.forEach((line, row) => {
    const cells = line.split(',');
    times[row] = Number(cells[0]);
    for (const i of places) columns.get(titles[i])[row] = cells[i] ? Number(cells[i]) : NaN;
  });
  return { times, columns };
}

/** Returns the rows of a table between two times, plus one row on each side. If there are more rows
 * than `points`, returns the minimum and maximum of groups of rows instead. */
export function cutTable({ times, columns }, names, from, to, points) {
  if (!times.length) return { times, columns: new Map() };
  const first = Math.max(0, nearest(times, from) - 1);
  const end = Math.min(times.length, nearest(times, to) + 2);
  const step = Math.max(1, Math.ceil(2 * (end - first) / points));
  const known = names.filter((name) => columns.has(name));
  if (end - first <= points) {
    return { times: times.subarray(first, end),
      columns: new Map(known.map((name) => [name, columns.get(name).subarray(first, end)])) };
  }
  const starts = Array.from({ length: Math.ceil((end - first) / step) }, (_, k) => first + k * step);
  const reduce = (column) => starts.flatMap((begin) => {
    const part = column.subarray(begin, Math.min(end, begin + step));
    let low = 0;
    let high = 0;
    part.forEach((value, i) => {
      if (value < part[low]) low = i;
      if (value > part[high]) high = i;
    });
    return [part[Math.min(low, high)], part[Math.max(low, high)]];
  });
  return { times: Float64Array.from(starts.flatMap((begin) =>
    [times[begin], times[Math.min(end - 1, begin + (step >> 1))]])),
    columns: new Map(known.map((name) => [name, Float32Array.from(reduce(columns.get(name)))])) };
}

export class Compare {
  #poses = null;
  #ghost = null;
  #shown = NaN; // time of the ghost's pose, s

  /** changed(table) is called when the other recording's signals are loaded; null = removed. */
  constructor(hello, scene, loadMesh, { changed, complain }) {
    Object.assign(this, { hello, scene, loadMesh, changed, complain });
    this.file = h('input', { type: 'file', accept: '.csv', multiple: true, hidden: true,
      onchange: () => this.#choose() });
    this.text = h('span', {}, 'Compare with…');
    this.button = h('button', { class: 'quiet', id: 'compare', onclick: () => this.#toggle(),
      title: 'show another recording too: its signals.csv, for its robot also its poses.csv' }, this.text);
    this.element = h('span', {}, this.button, this.file);
  }

  #toggle() {
    if (!this.name) {
      this.file.click();
      return;
    }
    this.file.value = '';
    this.#show(null, null, null);
  }

  async #choose() {
    const files = [...this.file.files];
    const find = (name) => files.find((file) => file.name.includes(name))?.text();
    try {
      if (!files.length) return;
      if (!find('signals')) {
        throw new Error('found no signals.csv among the files, expected that of a recording');
      }
      this.load('recording', await find('signals'), await find('poses'));
    } catch (error) {
      this.complain(error.message);
    }
  }

  /** Fetches the recording of replay --with. Its files are long: shows progress, and retries. */
  async fetch(link, directory) {
    const read = async (name) => {
      for (let left = TRIES - 1; ; left--) {
        try {
          return await link.fetchText(`/with/${name}`,
            (share) => setText(this.text, `Loading ${name} ${Math.round(100 * share)} %`));
        } catch (error) {
          if (!left) throw error;
          setText(this.text, `Loading ${name} again`);
          await new Promise((resolve) => { setTimeout(resolve, AGAIN_MS); });
        }
      }
    };
    this.button.disabled = true;
    try {
      this.load(directory, await read('signals.csv'), await read('poses.csv'));
    } catch (error) {
      setText(this.text, 'Compare with…');
      this.complain(`${directory} cannot be compared with: ${error.message}. Reload the page to try again.`, false, true);
    }
    this.button.disabled = false;
  }

  /** Loads the recording from the texts of its two CSV files; poses may be undefined. */
  load(name, signals, poses) {
    const known = new Set(this.hello.signals.map((signal) => signal.name));
    this.#show(name, readTable(signals, (title) => known.has(title)), poses ? readTable(poses) : null);
  }

  #show(name, signals, poses) {
    this.name = name;
    this.#poses = poses;
    this.#shown = NaN;
    setText(this.text, name ? `Without ${name}` : 'Compare with…');
    if (poses) this.#ghost ??= this.#makeGhost();
    if (this.#ghost) this.#ghost.group.visible = Boolean(poses);
    this.scene.dirty = true;
    this.changed(signals);
  }

  #makeGhost() {
    const ghost = makeBodies(this.hello, this.loadMesh, () => { this.scene.dirty = true; }, true);
    this.material = new THREE.MeshLambertMaterial(GHOST);
    ghost.group.traverse((part) => {
      if (!part.isMesh) return;
      part.material = this.material;
      part.castShadow = part.receiveShadow = false;
    });
    this.scene.scene.add(ghost.group);
    return ghost;
  }

  /** Moves the ghost to the other robot's pose at a time. */
  show(time) {
    if (!this.#poses?.times.length || time === this.#shown) return;
    this.#shown = time;
    const row = nearest(this.#poses.times, time);
    const titles = [...this.#poses.columns.keys()];
    const bodies = new Float32Array(POSE * this.hello.scene.bodies.length);
    this.hello.scene.bodies.forEach(({ name }, i) => {
      const at = titles.indexOf(`${name}_x_m`);
      for (let k = 0; k < POSE && at >= 0; k++) bodies[POSE * i + k] = this.#poses.columns.get(titles[at + k])[row];
    });
    this.#ghost.update({ bodies, joints: new Float32Array(2 * this.hello.scene.joints.length) },
      { torques: false, skeleton: false });
    this.material.color.set(GHOST.color); // the drums have another color
    this.scene.dirty = true;
  }
}
