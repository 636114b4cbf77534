// SPDX-License-Identifier: Apache-2.0
// Reads the server's binary messages, which docs/page.md describes.

const HEADER = 80;

/** Reads a state message, version 1. Arrays are views into the message if its alignment allows. */
export function readState(buffer) {
  const view = new DataView(buffer);
  const u16 = (at) => view.getUint16(at, true);
  const u32 = (at) => view.getUint32(at, true);
  const f32 = (at) => view.getFloat32(at, true);
  const u64 = (at) => Number(view.getBigUint64(at, true));
  const flags = u16(2);
  const [nbody, njoint, ncontact, nbus, nboard, nfault, nsignal] =
    [64, 66, 68, 70, 72, 74, 76].map(u16);
  const state = {
    paused: Boolean(flags & 1), clamped: Boolean(flags & 2), ended: Boolean(flags & 4), skipped: u32(4), tick: u64(8),
    time: u64(16) * 1e-9, elapsed: u64(24) * 1e-9, sent: u64(32) * 1e-6,
    overruns: u32(40), lost: u32(44), speed: f32(48),
    workMean: f32(52), work99: f32(56), workMax: f32(60),
    contacts: [], buses: [], boards: [], faults: [],
  };
  let at = HEADER;
  const floats = (n) => {
    const array = new Float32Array(buffer, at, n);
    at += 4 * n;
    return array;
  };

  state.bodies = floats(7 * nbody);
  state.joints = floats(2 * njoint);
  for (let i = 0; i < ncontact; i++) {
    const index = u16(at);
    at += 4;
    state.contacts.push({ index, wrench: floats(6) });
  }
  for (let i = 0; i < nbus; i++, at += 24) {
    state.buses.push({ rx: u32(at), tx: u32(at + 4), rxLost: u32(at + 8), txLost: u32(at + 12),
      load: f32(at + 16), state: u32(at + 20) });
  }
  for (let i = 0; i < nboard; i++, at += 12) {
    const bits = view.getUint8(at + 5);
    state.boards.push({ age: f32(at), address: view.getUint8(at + 4), loader: Boolean(bits & 1),
      away: Boolean(bits & 2), faulty: Boolean(bits & 4), external: Boolean(bits & 8),
      silent: Boolean(bits & 16), naxis: view.getUint8(at + 6),
      mode: [8, 9, 10, 11].map((k) => view.getUint8(at + k)) });
  }
  for (let i = 0; i < nfault; i++) {
    state.faults.push(Boolean(u32(at + 4 * (i >> 5)) >>> (i & 31) & 1));
  }
  at += 4 * Math.ceil(nfault / 32);
  state.signals = floats(nsignal);
  return state;
}

/** Reads a series message: the times of the points, and the values of each signal. */
export function readSeries(buffer) {
  const view = new DataView(buffer);
  const [nsignal, id, count, rows] = [view.getUint16(2, true), view.getUint32(4, true),
    view.getUint32(8, true), view.getUint32(12, true)];
  const values = 24 + 8 * count;
  return { id, rows, times: new Float64Array(buffer, 24, count),
    columns: Array.from({ length: nsignal }, (_, k) => new Float32Array(buffer, values + 4 * k * count, count)) };
}

/** Reads a trace message. Its records, often thousands, are parsed only when they are shown. */
export function readTrace(buffer) {
  const view = new DataView(buffer);
  return { view, count: view.getUint32(4, true), lost: view.getUint32(8, true) };
}

/** Calls visit(key, at) for each frame. key: bus and identifier; at: offset in the message. */
export function visitTrace({ view, count }, visit) {
  let at = 12;
  for (let i = 0; i < count; i++) {
    visit(view.getUint8(at + 12) * 2 ** 30 + view.getUint32(at + 8, true), at);
    at += 16 + (view.getUint8(at + 14) + 3 & ~3);
  }
}

export function frameTime(view, at) {
  return Number(view.getBigInt64(at, true)) * 1e-9;
}

export function readFrame(view, at) {
  const flags = view.getUint8(at + 13);
  return { time: frameTime(view, at), id: view.getUint32(at + 8, true), bus: view.getUint8(at + 12),
    extended: Boolean(flags & 1), remote: Boolean(flags & 2), error: Boolean(flags & 4),
    fd: Boolean(flags & 8), brs: Boolean(flags & 16), ours: Boolean(flags & 0x80),
    data: new Uint8Array(view.buffer, at + 16, view.getUint8(at + 14)) };
}
