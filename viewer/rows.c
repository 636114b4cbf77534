/* SPDX-License-Identifier: Apache-2.0 */
/* Moves rows of signals from the loop to the history, and on to the clients that want them. */
#include "viewer/private.h"

#include <string.h>

enum {
    ROWS_MESSAGE = 64 * 1024,
    ROWS_MANY = 256,
    ROWS_A_TURN = 1024, /* all that wait in a stream; a bound if the loop is as fast as this */
};

enum error_code viewer_create_history(struct viewer *viewer, struct error *error)
{
    viewer->stream =
        viewer->config.simulator ? simulator_view_stream(viewer->config.simulator) : NULL;
    return viewer->stream ? history_create(viewer->nsignal, HISTORY_COLUMNS, &viewer->arena,
                                           &viewer->history, error)
                          : ERROR_NONE;
}

/* Makes clients go on from a row, if they are ahead of it because time has gone back. */
static void viewer_rewind_clients(struct viewer *viewer, uint64_t row)
{
    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        viewer->client[i].row = viewer->client[i].row < row ? viewer->client[i].row : row;
    }
}

void viewer_take_rows(struct viewer *viewer)
{
    const struct stream_row *row;
    size_t count = 0;

    while (viewer->stream && count < ROWS_A_TURN && (row = stream_front(viewer->stream))) {
        history_put(viewer->history, row->time_ns, row->value);
        viewer_rewind_clients(viewer, history_end(viewer->history) - 1);
        viewer->rows_lost = row->lost;
        stream_drop(viewer->stream);
        count++;
    }
    viewer->rows_hurry = count >= ROWS_MANY;
}

/* Sends the next rows that fit in a message; false = there are none, or no room. */
static bool client_send_some_rows(struct viewer *viewer, struct viewer_client *client)
{
    const struct viewer_watch *watch = &client->watch;
    struct series series = {.nsignal = watch->nsignal, .step = 1};
    uint64_t begin = history_begin(viewer->history);
    uint64_t lost = viewer->rows_lost - client->rows_lost;
    uint64_t most = ROWS_MESSAGE / (8 + 4 * watch->nsignal);

    /* Rows that have left the history meanwhile are lost for this client */
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
