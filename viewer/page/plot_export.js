// SPDX-License-Identifier: Apache-2.0
// Exports plots: the samples as CSV, the plots as a picture.
import { save } from './dom.js';
import { colorOf } from './plot.js';

const MARGIN = 8;
const TITLE = 22; // height of the names above a plot, px

/** Formats a 32-bit float with the fewest digits that restore it; '' for an unknown value. */
function shortest(value) {
  if (!Number.isFinite(value)) return '';
  for (let digits = 6; digits < 9; digits++) {
    const text = String(Number(value.toPrecision(digits)));
    if (Math.fround(Number(text)) === value) return text;
  }
  return String(Number(value.toPrecision(9)));
}

/** Writes CSV rows between two times: the time with nanoseconds, then the signals. */
function curvesAsText(names, { times, columns }, from, to) {
  const lines = [`time_s,${names.join()}`];
  for (let i = 0; i < times.length; i++) {
    if (times[i] < from || times[i] > to) continue;
    lines.push([times[i].toFixed(9), ...columns.map((column) => shortest(column[i]))].join());
  }
  return `${lines.join('\n')}\n`;
}

export function saveCurves(file, names, curves, from, to) {
  save(file, new Blob([curvesAsText(names, curves, from, to)], { type: 'text/csv' }));
}

/** Draws the names of a plot's signals in their colors, until the width is used up. */
function drawNames(pen, names, x, y, width) {
  let at = x;
  names.forEach((name, i) => {
    const wide = pen.measureText(name).width;
    if (at + wide > x + width) return;
    pen.fillStyle = colorOf(i);
    pen.fillText(name, at, y);
    at += wide + 12;
  });
}

/** Draws the plots as arranged in the grid, with their signals' names and the page's colors. */
function drawPlots(grid, plots) {
  const canvas = document.createElement('canvas');
  const pen = canvas.getContext('2d');
  const style = getComputedStyle(document.documentElement);
  const frame = grid.getBoundingClientRect();
  const scale = devicePixelRatio;
  const cards = plots.filter((plot) => plot.canvas).map((plot) => {
    const box = plot.element.getBoundingClientRect();
    const part = plot.stage.getBoundingClientRect();
    return { plot, x: part.left - frame.left, y: box.top - frame.top + grid.scrollTop,
      width: part.width, height: part.height };
  });
  canvas.width = scale * (2 * MARGIN + frame.width);
  canvas.height = scale * (2 * MARGIN + Math.max(0, ...cards.map(({ y, height }) => y + height + TITLE)));
  pen.fillStyle = style.getPropertyValue('--panel');
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.scale(scale, scale);
  pen.translate(MARGIN, MARGIN);
  pen.font = `12px ${getComputedStyle(document.body).fontFamily}`;
  for (const { plot, x, y, width, height } of cards) {
    drawNames(pen, plot.names, x + MARGIN, y + TITLE - 8, width - MARGIN);
    pen.drawImage(plot.canvas, x, y + TITLE, width, height);
  }
  return canvas;
}

export function savePicture(file, grid, plots) {
  drawPlots(grid, plots).toBlob((blob) => save(file, blob), 'image/png');
}
