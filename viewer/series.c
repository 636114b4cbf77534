/* SPDX-License-Identifier: Apache-2.0 */
/* Sends rows of signals. New rows move from the loop to the history, and to the clients that want
 * rows. For plots, it sends the rows between two times, from the recording or from the run's
 * history. If there are too many rows, it sends the minimum and maximum of groups of rows.
 * docs/page.md describes the bytes. */
#include "viewer/private.h"

#include "base/text.h"

#include <math.h>

/* A request: signals, range of rows, and the reduction to points. */
struct series {
    size_t nsignal;
    uint16_t column[VIEWER_SIGNALS];
    uint64_t first, end; /* first row, and the row after the last */
    uint64_t step;       /* rows per group, which gives two points; 1: each row is a point */
};

enum { SERIES_KIND = 3, SERIES_HEADER = 24 };

/* Reads the signals' values of a row. */
static void series_read_row(const struct viewer *viewer, const struct series *series, uint64_t row,
                            double value[VIEWER_SIGNALS])
{
    bool wanted[RECORDED_COLUMNS];
    size_t ncolumn = 0;

    if (!viewer->playback) {
        for (size_t k = 0; k < series->nsignal; k++) {
            value[k] = (double)history_value(viewer->history, row, series->column[k]);
        }
        return;
    }
    for (size_t k = 0; k < series->nsignal; k++) {
        ncolumn = series->column[k] >= ncolumn ? series->column[k] + 1U : ncolumn;
    }
    memset(wanted, 0, ncolumn);
    for (size_t k = 0; k < series->nsignal; k++) {
        wanted[series->column[k]] = true;
    }
    recorded_table_read(&viewer->config.recording->signals, row, ncolumn, wanted,
                        viewer->playback->signal);
    for (size_t k = 0; k < series->nsignal; k++) {
        value[k] = viewer->playback->signal[series->column[k]];
    }
}

/* ---- requested rows ---- */

/* Finds the columns of the named signals. Returns false, with the reason, on failure. */
static bool series_find_signals(struct viewer *viewer, const json_t *names, struct series *series,
                                struct error *error)
{
    for (size_t i = 0; i < json_array_size(names); i++) {
        const char *name = json_string_value(json_array_get(names, i));
        const int column = TEXT_INDEX(viewer->signal, viewer->nsignal, name);

        if (column < 0 || series->nsignal == VIEWER_SIGNALS) {
            error_set(error, ERROR_INPUT,
                      "series: found \"%.60s\", expected the names of at most %d signals", name,
                      VIEWER_SIGNALS);
            return false;
        }
        series->column[series->nsignal++] = (uint16_t)column;
    }
    return true;
}

/* Returns the number of points in the message: two per group of rows. */
static size_t series_points(const struct series *series)
{
    uint64_t count = series->end - series->first;

    return (size_t)(series->step == 1 ? count : 2 * ((count + series->step - 1) / series->step));
}

/* ---- bytes ---- */

static uint8_t *put_f64(uint8_t *to, double value)
{
    uint64_t bits;

    memcpy(&bits, &value, sizeof bits);
    return put_u64(to, bits);
}

/* Reduces a group of rows to two values per signal: the minimum and the maximum, in time order. */
static void series_reduce(const struct viewer *viewer, const struct series *series, uint64_t begin,
                          uint64_t end, double pair[2][VIEWER_SIGNALS])
{
    uint64_t least[VIEWER_SIGNALS], greatest[VIEWER_SIGNALS];
    double low[VIEWER_SIGNALS], high[VIEWER_SIGNALS], value[VIEWER_SIGNALS];

    for (size_t k = 0; k < series->nsignal; k++) {
        low[k] = high[k] = NAN;
        least[k] = greatest[k] = begin;
    }
    for (uint64_t row = begin; row < end; row++) {
        series_read_row(viewer, series, row, value);
        for (size_t k = 0; k < series->nsignal; k++) {
            if (value[k] < low[k] || !(low[k] == low[k])) {
                low[k] = value[k];
                least[k] = row;
            }
            if (value[k] > high[k] || !(high[k] == high[k])) {
                high[k] = value[k];
                greatest[k] = row;
            }
        }
    }
    for (size_t k = 0; k < series->nsignal; k++) {
        bool rises = least[k] <= greatest[k];

        pair[0][k] = rises ? low[k] : high[k];
        pair[1][k] = rises ? high[k] : low[k];
    }
}

/* Writes one column of times, then one column of values per signal. */
static void series_put_points(const struct viewer *viewer, const struct series *series, uint8_t *to)
{
    size_t npoint = series_points(series), point = 0;
    uint8_t *values = to + 8 * npoint;
    double pair[2][VIEWER_SIGNALS];

    for (uint64_t row = series->first; row < series->end; row += series->step) {
        uint64_t end = row + series->step < series->end ? row + series->step : series->end;
        size_t points = series->step == 1 ? 1 : 2;

        series_reduce(viewer, series, row, end, pair);
        for (size_t i = 0; i < points; i++, point++) {
            uint64_t at = row + i * (end - row) / 2;

            to = put_f64(to, (double)(viewer->playback
                                          ? viewer->config.recording->signals.row[at].time_ns
                                          : history_time(viewer->history, at)) *
                                 1e-9);
            for (size_t k = 0; k < series->nsignal; k++) {
                put_f32(values + 4 * (k * npoint + point), pair[i][k]);
            }
        }
    }
}

static bool client_put_series(struct viewer *viewer, struct viewer_client *client,
                              const struct series *series, uint32_t id, uint64_t lost)
{
    size_t size = SERIES_HEADER + series_points(series) * (8 + 4 * series->nsignal);
    uint8_t *to = client_room(viewer, client, WEBSOCKET_HEADER + size), *at;

    if (!to) {
        return false;
    }
    /* Kind of message, id of the request, then the sizes of the parts */
    at = to + websocket_header(to, WEBSOCKET_BINARY, size);
    at = put_u8(at, SERIES_KIND);
    at = put_u8(at, VIEWER_PROTOCOL);
    at = put_u16(at, (uint16_t)series->nsignal);
    at = put_u32(at, id);
    at = put_u32(at, (uint32_t)series_points(series));
    at = put_u32(at, (uint32_t)(series->end - series->first));
    at = put_u64(at, lost);
    series_put_points(viewer, series, at);
    client->filled += (size_t)(at - to) + size - SERIES_HEADER;
    client_flush(viewer, client);
    return true;
}

bool client_send_series(struct viewer *viewer, struct viewer_client *client,
                        const struct viewer_message *message, struct error *error)
{
    struct series series = {.nsignal = 0};

    if (!series_find_signals(viewer, message->signals, &series, error)) {
        return false;
    }
    if (viewer->playback) {
        const struct recorded_table *table = &viewer->config.recording->signals;
        double from_ns = fmax(message->from_s * 1e9, (double)viewer->config.recording->first_ns);
        double to_ns = fmin(message->to_s * 1e9, (double)viewer->config.recording->last_ns);

        /* Find the rows of a recording between two times, plus one row on each side so that
         * curves reach the edges of a plot */
        if (from_ns <= to_ns) {
            series.first = recorded_table_find(table, (int64_t)from_ns);
            series.end = recorded_table_find(table, (int64_t)to_ns) + 2;
            series.end = series.end > table->nrow ? table->nrow : series.end;
        }
    } else {
        /* Find the rows of the history in the same way */
        uint64_t begin = history_begin(viewer->history), end = history_end(viewer->history);

        if (message->from_s <= message->to_s) {
            series.first = history_find(viewer->history, (int64_t)floor(message->from_s * 1e9));
            series.end = history_find(viewer->history, (int64_t)ceil(message->to_s * 1e9)) + 2;
            series.first -= series.first > begin ? 1 : 0;
            series.end = series.end > end ? end : series.end;
        }
    }

    /* Choose the group size so that the points fit in one message, and other messages have
     * space */
    size_t most = (size_t)message->points;
    size_t room = VIEWER_OUTBOX / 2 / (8 + 4 * series.nsignal);
    uint64_t count = series.end - series.first;

    most = most < room ? most : room;
    series.step = count > most ? (count + most / 2 - 1) / (most / 2) : 1;
    if (!client_put_series(viewer, client, &series, (uint32_t)json_integer_value(message->id), 0)) {
        error_set(error, ERROR_SYSTEM, "series: there is no room: take what was sent before");
        return false;
    }
    return true;
}

enum {
    ROWS_MESSAGE = 64 * 1024,
    ROWS_MANY = 256,
    /* limit of rows per turn, in case the loop writes rows as fast as this thread reads them */
    ROWS_A_TURN = 1024,
};

enum error_code viewer_create_history(struct viewer *viewer, struct error *error)
{
    viewer->stream =
        viewer->config.simulator ? simulator_parts(viewer->config.simulator).view_stream : NULL;
    return viewer->stream ? history_create(viewer->nsignal, HISTORY_COLUMNS, &viewer->arena,
                                           &viewer->history, error)
                          : ERROR_NONE;
}

void viewer_take_rows(struct viewer *viewer)
{
    const struct stream_row *row;
    size_t count = 0;

    while (viewer->stream && count < ROWS_A_TURN && (row = stream_front(viewer->stream))) {
        history_put(viewer->history, row->time_ns, row->value);
        /* After time has gone back, send the rows from there on again to clients ahead of it */
        for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
            const uint64_t last = history_end(viewer->history) - 1;

            viewer->client[i].row = viewer->client[i].row < last ? viewer->client[i].row : last;
        }
        viewer->rows_lost = row->lost;
        stream_drop(viewer->stream);
        count++;
    }
    viewer->rows_hurry = count >= ROWS_MANY;
}

/* Sends the next rows, as many as fit in a message. Returns false without new rows or without
 * space. */
static bool client_send_some_rows(struct viewer *viewer, struct viewer_client *client)
{
    const struct viewer_watch *watch = &client->watch;
    struct series series = {.nsignal = watch->nsignal, .step = 1};
    uint64_t begin = history_begin(viewer->history);
    uint64_t lost = viewer->rows_lost - client->rows_lost;
    uint64_t most = ROWS_MESSAGE / (8 + 4 * watch->nsignal);

    /* Skip rows that have been dropped from the history, and count them */
    series.first = client->row < begin ? begin : client->row;
    lost += series.first - client->row;
    series.end = history_end(viewer->history);
    series.end = series.end - series.first > most ? series.first + most : series.end;
    memcpy(series.column, watch->signal, watch->nsignal * sizeof series.column[0]);
    if (series.end == series.first || !client_put_series(viewer, client, &series, 0, lost)) {
        return false;
    }
    client->row = series.end;
    client->rows_lost = viewer->rows_lost;
    return true;
}

void client_send_rows(struct viewer *viewer, struct viewer_client *client)
{
    const struct viewer_watch *watch = &client->watch;

    if (!viewer->history || !watch->rows || watch->nsignal == 0) {
        return;
    }
    while (client->socket >= 0 && client_waiting(client) < VIEWER_OUTBOX / 8 &&
           client_send_some_rows(viewer, client)) {
    }
}
