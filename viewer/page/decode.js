// SPDX-License-Identifier: Apache-2.0
// Decodes frames into signals and encodes signals into frames, by the messages of /messages.json.
// Bit 8 i + j is bit j of byte i. The start bit of a little-endian signal is its least significant
// bit, the start bit of a big-endian signal its most significant bit.

/** Iterates over the bit positions of a signal in the frame, most significant bit first. */
function* bitsOf(signal) {
  if (!signal.big_endian) {
    for (let k = signal.bits - 1; k >= 0; k--) yield signal.start + k;
    return;
  }
  for (let k = 0, at = signal.start; k < signal.bits; k++) {
    yield at;
    at = at % 8 === 0 ? at + 15 : at - 1;
  }
}

function rawValue(signal, data) {
  let value = 0;
  for (const at of bitsOf(signal)) {
    if (at >> 3 >= data.length) return null;
    value = 2 * value + (data[at >> 3] >> (at & 7) & 1);
  }
  if (signal.type === 'signed' && value >= 2 ** (signal.bits - 1)) value -= 2 ** signal.bits;
  if (signal.type === 'float') {
    const view = new DataView(new ArrayBuffer(4));
    view.setUint32(0, value);
    value = view.getFloat32(0);
  }
  return value;
}

/** Returns the signals of a frame: name, value, unit, and the word for the value if it has one. */
export function decode(message, data) {
  const multiplexor = message.signals.find((signal) => signal.multiplexor);
  const selected = multiplexor ? rawValue(multiplexor, data) : null;
  const found = [];
  for (const signal of message.signals) {
    if (signal.selector !== undefined && signal.selector !== selected) continue;
    const raw = rawValue(signal, data);
    if (raw === null) continue;
    found.push({ name: signal.name, value: raw * (signal.scale ?? 1) + (signal.offset ?? 0),
      unit: signal.unit ?? '', word: signal.values?.[raw] });
  }
  return found;
}

/** Encodes values, given by signal name, into the bytes of a frame. Other signals are zero. */
export function encode(message, values) {
  const data = new Uint8Array(message.length);
  const multiplexor = message.signals.find((signal) => signal.multiplexor);
  const selected = multiplexor ? values[multiplexor.name] ?? 0 : null;
  let last = multiplexor ? 1 : message.length;
  for (const signal of message.signals) {
    if (signal.selector !== undefined && signal.selector !== selected) continue;
    const value = values[signal.name] ?? 0;
    let raw = Math.round((value - (signal.offset ?? 0)) / (signal.scale ?? 1));
    if (signal.type === 'float') {
      const view = new DataView(new ArrayBuffer(4));
      view.setFloat32(0, value);
      raw = view.getUint32(0);
    }
    if (raw < 0) raw += 2 ** signal.bits;
    const bits = [...bitsOf(signal)].reverse();
    bits.forEach((at, k) => {
      if (Math.floor(raw / 2 ** k) % 2) data[at >> 3] |= 1 << (at & 7);
      last = Math.max(last, (at >> 3) + 1);
    });
  }
  return data.subarray(0, last);
}

const key = (frame) => (frame.extended ? 2 ** 29 : 0) + frame.id;

export class Database {
  #byBus = [];

  constructor(buses) {
    this.buses = buses;
    this.#byBus = buses.map((messages) => new Map(messages.map((m) => [key(m), m])));
  }

  /* Finds the message of a frame. Identifiers that carry values are compared by their other
   * bits. */
  find(bus, frame) {
    return this.#byBus[bus]?.get(key(frame)) ?? (frame.extended
      ? this.buses[bus]?.find((m) => m.mask && m.extended && (frame.id & ~m.mask) === m.id)
      : undefined);
  }
}

export const hex = (data) => Array.from(data, (byte) => byte.toString(16).padStart(2, '0')).join(' ');
