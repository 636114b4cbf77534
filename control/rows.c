/* SPDX-License-Identifier: Apache-2.0 */
/* Serves subscriptions: requests rows from the loop, and sends each client its signals. */
#include "control/private.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

enum {
    ROWS_A_TURN = 1024, /* capacity of the stream, so that one turn can send all waiting rows */
    ROW_BYTES = 128,    /* length of a row without its values, bytes */
    VALUE_BYTES = 26,   /* length of a number in %.15g and a comma, bytes */
    /* Largest number of bytes of rows in an outbox; the rest is for answers */
    ROWS_OUTBOX = CONTROL_OUTBOX / 2,
};

/* Returns the greatest common divisor of a and b; a if b is 0. */
static uint64_t common_divisor(uint64_t a, uint64_t b)
{
    while (b) {
        uint64_t rest = a % b;

        a = b;
        b = rest;
    }
    return a;
}

/* Requests rows from the loop at the largest period (ticks) that serves all subscribers. Without
 * subscribers the period is 0: no rows. */
static void want_rows(struct control *control)
{
    uint64_t period = 0;

    for (size_t i = 0; i < CONTROL_PLACES; i++) {
        const struct control_client *client = &control->client[i];

        if (client->socket >= 0 && client->subscription.count > 0) {
            period = common_divisor(client->subscription.period, period);
        }
    }
    stream_want(simulator_parts(control->config.simulator).stream, period);
}

/* ---- subscribing ---- */

/* Returns whether a subscription already has a signal. */
static bool has_signal(const struct control_subscription *of, size_t signal)
{
    for (size_t i = 0; i < of->count; i++) {
        if (of->signal[i] == signal) {
            return true;
        }
    }
    return false;
}

/* Appends the signals that match a pattern and are not yet in the list. A pattern without a match
 * is an error. */
static enum error_code add_signals(const struct control *control, const char *pattern,
                                   struct control_subscription *to, struct error *error)
{
    const char *const *name = simulator_parts(control->config.simulator).signal, *nearest;
    size_t count = simulator_parts(control->config.simulator).nsignal;
    bool matched = false;

    for (size_t i = 0; i < count; i++) {
        if (control_matches(pattern, name[i])) {
            matched = true;
            if (!has_signal(to, i)) {
                to->signal[to->count++] = (uint16_t)i;
            }
        }
    }
    if (matched) {
        return ERROR_NONE;
    }
    nearest = text_nearest(pattern, name, count);
    return error_set(error, ERROR_INPUT,
                     "subscribe: found no signal \"%.80s\", expected a name or a pattern of one of "
                     "%zu%s%s%s",
                     pattern, count, nearest ? "; the nearest is \"" : "", nearest ? nearest : "",
                     nearest ? "\"" : "");
}

/* Converts the period to ticks; it must be a multiple of the tick. */
static enum error_code check_period(const struct control *control,
                                    const struct control_request *request, uint64_t *ticks,
                                    struct error *error)
{
    double tick_ms = (double)control->rig->tick_ns * 1e-6;
    double count = request->period_ms / tick_ms;

    if (count < 0.999 || fabs(count - round(count)) > 1e-6 * count) {
        return error_set(error, ERROR_INPUT,
                         "subscribe: key \"period_ms\": found %g, expected a multiple of the tick, "
                         "%g",
                         request->period_ms, tick_ms);
    }
    *ticks = (uint64_t)llround(count);
    return ERROR_NONE;
}

/* Makes the answer to a subscription: its signals and period. Returns NULL if out of memory. */
static json_t *subscription_answer(const struct control *control,
                                   const struct control_subscription *to)
{
    const char *const *name = simulator_parts(control->config.simulator).signal;
    json_t *array = json_array();

    for (size_t i = 0; i < to->count; i++) {
        control_append(&array, control_text(name[to->signal[i]]));
    }
    return json_pack("{s:o, s:f}", "signals", array, "period_ms",
                     (double)to->period * (double)control->rig->tick_ns * 1e-6);
}

json_t *control_subscribe(struct control *control, struct control_client *client,
                          const struct control_request *request, struct error *error)
{
    struct control_subscription *to = &client->subscription;
    enum error_code code;
    json_t *body = NULL;

    /* The old subscription ends, even if the new one fails */
    control_forget(control, client);
    code = check_period(control, request, &to->period, error);
    for (size_t i = 0; i < json_array_size(request->signals) && !code; i++) {
        code =
            add_signals(control, json_string_value(json_array_get(request->signals, i)), to, error);
    }
    if (!code && ROW_BYTES + to->count * VALUE_BYTES > ROWS_OUTBOX) {
        code = error_set(error, ERROR_INPUT, "subscribe: found %zu signals, expected at most %d",
                         to->count, (ROWS_OUTBOX - ROW_BYTES) / VALUE_BYTES);
    }
    if (!code && !(body = subscription_answer(control, to))) {
        code = error_set(error, ERROR_MEMORY, "no memory for the answer");
    }
    if (code) {
        control_forget(control, client);
    }
    want_rows(control);
    return body;
}

/* Ends the client's subscription, if any. */
void control_forget(struct control *control, struct control_client *client)
{
    client->subscription = (struct control_subscription){.signal = client->subscription.signal};
    want_rows(control);
}

json_t *control_unsubscribe(struct control *control, struct control_client *client)
{
    json_t *body = json_pack("{s:I, s:I}", "rows", (json_int_t)client->subscription.rows, "missed",
                             (json_int_t)client->subscription.missed);

    control_forget(control, client);
    return body;
}

/* ---- rows ---- */

/* Returns the number of rows that the stream lost between the previous row and this row. */
static uint64_t lost_before(struct control_subscription *to, const struct stream_row *row)
{
    uint64_t lost = 0;

    if (to->begun && row->tick > to->tick) {
        lost = row->tick / to->period - to->tick / to->period - 1;
    } else if (to->begun) {
        lost = row->lost - to->lost; /* a reset or restore has set the time back: an upper bound */
    }
    to->begun = true;
    to->tick = row->tick;
    to->lost = row->lost;
    return lost;
}

/* Writes a row as a line of JSON, with the number of missed rows before it. Returns the length of
 * the line. */
static size_t format_row(const struct control_subscription *to, const struct stream_row *row,
                         uint64_t missed, char *text)
{
    char *at = text;

    at += sprintf(at, "{\"time_s\":%.15g,\"tick\":%" PRIu64 ",", (double)row->time_ns * 1e-9,
                  row->tick);
    if (missed > 0) {
        at += sprintf(at, "\"missed\":%" PRIu64 ",", missed);
    }
    at += sprintf(at, "\"values\":[");
    for (size_t i = 0; i < to->count; i++) {
        double value = row->value[to->signal[i]];

        at += isfinite(value) ? sprintf(at, "%s%.15g", i ? "," : "", value)
                              : sprintf(at, "%snull", i ? "," : "");
    }
    at += sprintf(at, "]}\n");
    return (size_t)(at - text);
}

/* Sends a row to a subscriber. Counts the row as missed if the outbox is too full. */
static void give_row(struct control *control, struct control_client *client,
                     const struct stream_row *row)
{
    struct control_subscription *to = &client->subscription;
    size_t size = ROW_BYTES + to->count * VALUE_BYTES;
    uint64_t lost = lost_before(to, row);
    char *text = NULL;

    if (client->filled - client->sent + size > ROWS_OUTBOX) {
        control_flush(control, client);
    }
    if (client->socket < 0) {
        return;
    }
    if (client->filled - client->sent + size <= ROWS_OUTBOX) {
        text = control_room(control, client, size);
    }
    to->missed += lost + (text == NULL);
    control->counters.missed_rows += lost + (text == NULL);
    if (text) {
        client->filled += format_row(to, row, to->missed - to->missed_told, text);
        to->missed_told = to->missed;
        to->rows++;
        control->counters.rows++;
    }
}

bool control_rows(struct control *control)
{
    struct stream *stream = simulator_parts(control->config.simulator).stream;
    const struct stream_row *row = stream_front(stream);

    for (int n = 0; row && n < ROWS_A_TURN; n++) {
        for (size_t i = 0; i < CONTROL_PLACES; i++) {
            struct control_client *client = &control->client[i];

            if (client->socket >= 0 && client->subscription.count > 0 &&
                row->tick % client->subscription.period == 0) {
                give_row(control, client, row);
            }
        }
        stream_drop(stream);
        row = stream_front(stream);
    }
    for (size_t i = 0; i < CONTROL_PLACES; i++) {
        control_flush(control, &control->client[i]);
    }
    return row != NULL;
}
