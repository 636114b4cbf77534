/* SPDX-License-Identifier: Apache-2.0 */
/* Signals of a recording between two times, for plots: every row, or the least and the greatest
 * value of as many rows as it takes to make few enough. docs/page.md has the bytes. */
#include "viewer/bytes.h"
#include "viewer/private.h"

#include <math.h>

enum { SERIES_KIND = 3, SERIES_HEADER = 24 };

/* What is asked for, and how it is made. */
struct series {
    size_t nsignal;
    uint16_t column[VIEWER_SIGNALS];
    size_t ncolumn; /* of a row that have to be read */
    bool wanted[RECORDED_COLUMNS];
    size_t first, end; /* rows */
    size_t step;       /* rows that two points stand for; 1: each row is a point */
    size_t npoint;
};

static bool series_find_signals(const struct viewer *viewer, const json_t *names,
                                struct series *series, struct error *error)
{
    for (size_t i = 0; i < json_array_size(names); i++) {
        const char *name = json_string_value(json_array_get(names, i));
        size_t column = 0;

        while (column < viewer->nsignal && strcmp(viewer->signal[column], name) != 0) {
            column++;
        }
        if (column == viewer->nsignal || series->nsignal == VIEWER_SIGNALS) {
            error_set(error, ERROR_INPUT,
                      "series: found \"%.60s\", expected the names of at most %d signals", name,
                      VIEWER_SIGNALS);
            return false;
        }
        series->column[series->nsignal++] = (uint16_t)column;
        series->wanted[column] = true;
        series->ncolumn = column >= series->ncolumn ? column + 1 : series->ncolumn;
    }
    return true;
}

/* Which rows, one more on either side so that a curve does not end within the picture. */
static void series_find_rows(const struct recording *recording,
                             const struct viewer_message *message, struct series *series)
{
    const struct recorded_table *table = &recording->signals;
    double from_ns = fmax(message->from_s * 1e9, (double)recording->first_ns);
    double to_ns = fmin(message->to_s * 1e9, (double)recording->last_ns);
    size_t most = (size_t)message->points, room, count;

    series->step = 1;
    if (!(from_ns <= to_ns)) {
        return;
    }
    series->first = recorded_table_find(table, (int64_t)from_ns);
    series->end = recorded_table_find(table, (int64_t)to_ns) + 2;
    series->end = series->end > table->nrow ? table->nrow : series->end;
    count = series->end - series->first;

    /* Few enough to be one message that leaves room for others */
    room = VIEWER_OUTBOX / 2 / (8 + 4 * series->nsignal);
    most = most < room ? most : room;
    if (count > most) {
        series->step = (count + most / 2 - 1) / (most / 2);
    }
    series->npoint = series->step == 1 ? count : 2 * ((count + series->step - 1) / series->step);
}

static uint8_t *put_f64(uint8_t *to, double value)
{
    uint64_t bits;

    memcpy(&bits, &value, sizeof bits);
    return put_u64(to, bits);
}

/* The values of a bucket's rows: the earlier and the later one of the least and the greatest. */
static void series_reduce(const struct viewer *viewer, const struct series *series, size_t begin,
                          size_t end, double pair[2][VIEWER_SIGNALS])
{
    const struct recorded_table *table = &viewer->config.recording->signals;
    size_t least[VIEWER_SIGNALS], greatest[VIEWER_SIGNALS];
    double low[VIEWER_SIGNALS], high[VIEWER_SIGNALS];

    for (size_t k = 0; k < series->nsignal; k++) {
        low[k] = high[k] = NAN;
        least[k] = greatest[k] = begin;
    }
    for (size_t row = begin; row < end; row++) {
        recorded_table_read(table, row, series->ncolumn, series->wanted, viewer->playback->signal);
        for (size_t k = 0; k < series->nsignal; k++) {
            double value = viewer->playback->signal[series->column[k]];

            if (value < low[k] || !(low[k] == low[k])) {
                low[k] = value;
                least[k] = row;
            }
            if (value > high[k] || !(high[k] == high[k])) {
                high[k] = value;
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

/* Times in one column, then the values of each signal in one. */
static void series_put_points(const struct viewer *viewer, const struct series *series, uint8_t *to)
{
    const struct recorded_table *table = &viewer->config.recording->signals;
    uint8_t *values = to + 8 * series->npoint;
    double pair[2][VIEWER_SIGNALS];
    size_t point = 0;

    for (size_t row = series->first; row < series->end; row += series->step) {
        size_t end = row + series->step < series->end ? row + series->step : series->end;
        size_t points = series->step == 1 ? 1 : 2;

        series_reduce(viewer, series, row, end, pair);
        for (size_t i = 0; i < points; i++, point++) {
            size_t at = row + i * (end - row) / 2;

            to = put_f64(to, (double)table->row[at].time_ns * 1e-9);
            for (size_t k = 0; k < series->nsignal; k++) {
                put_f32(values + 4 * (k * series->npoint + point), pair[i][k]);
            }
        }
    }
}

bool client_send_series(struct viewer *viewer, struct viewer_client *client,
                        const struct viewer_message *message, struct error *error)
{
    struct series series = {.nsignal = 0};
    uint8_t *to, *at;
    size_t size;

    if (!series_find_signals(viewer, message->signals, &series, error)) {
        return false;
    }
    series_find_rows(viewer->config.recording, message, &series);
    size = SERIES_HEADER + series.npoint * (8 + 4 * series.nsignal);
    to = client_room(viewer, client, WEBSOCKET_HEADER + size);
    if (!to) {
        error_set(error, ERROR_SYSTEM, "series: there is no room: take what was sent before");
        return false;
    }

    /* What kind of message, for which question, then how much follows */
    at = to + websocket_header(to, WEBSOCKET_BINARY, size);
    at = put_u8(at, SERIES_KIND);
    at = put_u8(at, VIEWER_PROTOCOL);
    at = put_u16(at, (uint16_t)series.nsignal);
    at = put_u32(at, (uint32_t)json_integer_value(message->id));
    at = put_u32(at, (uint32_t)series.npoint);
    at = put_u32(at, (uint32_t)(series.end - series.first));
    at = put_u64(at, 0);
    series_put_points(viewer, &series, at);
    client->filled += (size_t)(at - to) + series.npoint * (8 + 4 * series.nsignal);
    client_flush(viewer, client);
    return true;
}
