// SPDX-License-Identifier: Apache-2.0
// The store of samples of a run, which a connection fills: every row of it, and by request what was before.
import { SeriesStore } from './series_store.js';

const POINTS = 8000; // of a series: more than a piece of the store has rows

export function feedStore(link, hello) {
  const store = new SeriesStore({ signals: hello.signals, period_s: hello.run.tick_s,
    fetch: (signals, from, to) => link.ask('series', { signals, from_s: from, to_s: to, points: POINTS }) });
  link.addEventListener('watching', ({ detail }) => store.choose(detail.signals, detail.rows_after_s));
  link.addEventListener('rows', ({ detail: { times, columns } }) => {
    if (columns.length === store.chosen.length) store.append(times, columns);
  });
  link.addEventListener('hello', () => store.clear()); // a new connection: what came meanwhile is fetched
  link.watch({ rows: true });
  return store;
}
