// SPDX-License-Identifier: Apache-2.0
// Creates elements with one call, and formats numbers.

/** Creates an element: h('button', {class: 'x', onclick: f}, 'text', child). */
export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(properties ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith('on')) element.addEventListener(key.slice(2), value);
    else if (key === 'class') element.className = value;
    else if (key in element && key !== 'list') element[key] = value;
    else element.setAttribute(key, value);
  }
  element.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined));
  return element;
}

/** Creates an icon of 12 x 12 units from an SVG path, because no font has all icons. */
export function sign(path) {
  const space = 'http://www.w3.org/2000/svg';
  const picture = document.createElementNS(space, 'svg');
  const line = document.createElementNS(space, 'path');
  picture.setAttribute('viewBox', '0 0 12 12');
  picture.setAttribute('class', 'sign');
  line.setAttribute('d', path);
  picture.append(line);
  return picture;
}

/** Sets the text only if it differs, which avoids a new layout of the page. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function setClass(element, name, on) {
  if (element.classList.contains(name) !== Boolean(on)) element.classList.toggle(name, Boolean(on));
}

/** Formats a number with a fixed number of decimals; avoids a negative zero. */
export function fixed(value, digits = 2) {
  if (!Number.isFinite(value)) return '–';
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace('-', '') : text;
}

export function count(value) {
  return value.toLocaleString('en-US').replaceAll(',', ' ');
}

/** Formats a number with as few digits as possible, and at most four significant digits. */
export function plain(value) {
  return Number.isFinite(value) ? String(+value.toPrecision(4)) : '–';
}

/** Returns the width (px) of an axis: longest label at 7 px per letter, tick and gap. */
export function axisWidth(labels) {
  return Math.max(52, 16 + 7 * Math.max(0, ...(labels ?? []).map((label) => String(label ?? '').length)));
}

/** Formats a number of any size with four significant digits. */
export function short(value) {
  if (!Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(2);
  return fixed(value, size >= 1000 ? 0 : size >= 100 ? 1 : size >= 10 ? 2 : 3);
}

/** Downloads a file to the user's disk. */
export function save(file, blob) {
  const url = URL.createObjectURL(blob);
  h('a', { href: url, download: file }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}
