// SPDX-License-Identifier: Apache-2.0
// A store of samples that a connection fills: every row of the run where the server keeps a history,
// else the signals of the states that come.
import { SeriesStore } from './series_store.js';

const POINTS = 8000; // of a series: more than a piece of the store has rows

export function feedStore(link, hello) {
  const { rows } = hello.limits;
  const store = new SeriesStore({ signals: hello.signals, period_s: hello.run.tick_s,
    fetch: rows && !hello.run.replay ? (signals, from, to) => link.ask('series',
      { signals, from_s: from, to_s: to, points: POINTS }) : null });
  link.addEventListener('watching', ({ detail }) => store.choose(detail));
  if (rows) {
    link.addEventListener('rows', ({ detail: { times, columns } }) => {
      if (columns.length === store.chosen.length) store.append(times, columns);
    });
    link.watch({ rows: true });
  } else {
    link.addEventListener('state', ({ detail: { state } }) => {
      if (state.signals.length !== store.chosen.length || state.time === store.to_s) return;
      store.append(Float64Array.of(state.time), Array.from(state.signals, (value) => Float32Array.of(value)));
    });
  }
  return store;
}
