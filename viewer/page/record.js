// SPDX-License-Identifier: Apache-2.0
// Saves pictures of the robot, and a recording made by the page. The simulator's recording begins
// with the run (run --record). The page's recording begins with a click. It has the plotted signals
// and the frames that reached the page.
import { hex } from './decode.js';
import { fixed, h, save, setClass, setText } from './dom.js';
import { saveCurves } from './plot_export.js';
import { readFrame, visitTrace } from './wire.js';

const BYTES_MOST = 64 << 20; // maximum size of the frames

/** Formats a frame like candump -L. */
export function candumpLine(frame, bus) {
  const id = (frame.error ? frame.id | 0x20000000 : frame.id).toString(16).toUpperCase()
    .padStart(frame.extended || frame.error ? 8 : 3, '0');
  const data = hex(frame.data).replaceAll(' ', '').toUpperCase();
  const body = frame.fd ? `##${frame.brs ? 1 : 0}${data}` : frame.remote ? '#R' : `#${data}`;
  return `(${frame.time.toFixed(6)}) ${bus} ${id}${body}`;
}

export class Recorder {
  #from = null; // start time of the recording, s; null = not recording
  #lines = [];
  #bytes = 0;
  #lost = 0;

  constructor(link, hello, plots, complain) {
    Object.assign(this, { link, hello, plots, complain });
    this.button = h('button', { class: 'toggle record', id: 'record', 'aria-pressed': 'false',
      title: 'record what the page sees: plotted signals as CSV, frames as candump',
      onclick: () => this.toggle() }, 'Record');
    link.addEventListener('trace', ({ detail }) => this.#take(detail));
  }

  toggle() {
    if (this.#from === null) this.#begin();
    else this.#end();
  }

  #begin() {
    this.#from = this.plots.newest ?? 0;
    this.#lines = [];
    this.#bytes = this.#lost = 0;
    if (this.hello.run.frames) this.link.trace(this, true);
    this.#show();
  }

  #take(message) {
    if (this.#from === null) return;
    this.#lost += message.lost;
    visitTrace(message, (_, at) => {
      const frame = readFrame(message.view, at);
      const line = candumpLine(frame, this.hello.buses[frame.bus].interface);
      if (frame.time < this.#from || this.#bytes > BYTES_MOST) return;
      this.#lines.push(line);
      this.#bytes += line.length + 1;
    });
  }

  #show() {
    const on = this.#from !== null;
    this.button.setAttribute('aria-pressed', String(on));
    setClass(this.button, 'on', on);
    if (!on) setText(this.button, 'Record');
  }

  render(time) {
    if (this.#from !== null) setText(this.button, `Stop · ${fixed(time - this.#from, 1)} s`);
  }

  #end() {
    const name = `${this.hello.run.rig}-${fixed(this.#from, 3)}s`;
    const to = this.plots.newest;
    const { names, curves } = this.plots.samples(this.#from, to);
    saveCurves(`${name}-signals.csv`, names, curves, this.#from, to);
    if (this.hello.run.frames) {
      this.link.trace(this, false);
      save(`${name}-candump.log`, new Blob([`${this.#lines.join('\n')}\n`], { type: 'text/plain' }));
    }
    this.complain(`Recorded ${fixed(to - this.#from, 1)} s: ${names.length} signals, ${this.#lines.length} frames${
      this.#lost ? `, ${this.#lost} lost` : ''}${this.#bytes > BYTES_MOST ? '; frames ended at 64 MB' : ''}`, true);
    this.#from = null;
    this.#show();
  }
}

/** Saves the picture of the robot. */
export function shoot(scene, file) {
  scene.renderer.render(scene.scene, scene.camera); // the browser has cleared the canvas
  scene.canvas.toBlob((blob) => save(file, blob), 'image/png');
}
