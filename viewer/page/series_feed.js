// SPDX-License-Identifier: Apache-2.0
// Creates the sample store of a run. The connection delivers live rows, and on request older rows.
import { SeriesStore } from './series_store.js';

const POINTS = 8000; // maximum number of points of a series; must exceed PIECE of series_store.js

export function feedStore(link, hello) {
  const store = new SeriesStore({ signals: hello.signals, period_s: hello.run.tick_s,
    fetch: (signals, from, to) => link.ask('series', { signals, from_s: from, to_s: to, points: POINTS }) });
  link.addEventListener('watching', ({ detail }) => store.choose(detail.signals, detail.rows_after_s));
  link.addEventListener('rows', ({ detail: { times, columns } }) => {
    if (columns.length === store.chosen.length) store.append(times, columns);
  });
  link.addEventListener('hello', () => store.clear()); // new connection: missed rows are fetched
  link.watch({ rows: true });
  return store;
}
