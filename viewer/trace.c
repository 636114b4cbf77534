/* SPDX-License-Identifier: Apache-2.0 */
/* Receives the frames on the buses through the viewer's ports, and stores them for clients that
 * trace. docs/page.md describes the bytes. */
#include "viewer/private.h"

enum { TRACE_KIND = 2, TRACE_HEADER = 12, TRACE_RECORD = 16, BATCH = 64, TURNS = 256 };
/* flag for frames sent by a client, in addition to the flags of canbus/frame.h */
enum { TRACE_OURS = 0x80 };

void client_trace_frame(struct viewer_client *client, size_t bus, const struct bus_frame *frame,
                        uint8_t flags)
{
    size_t padded = (frame->len + 3U) & ~3U;
    uint8_t *to = client->trace + client->traced;

    if (client->traced + TRACE_RECORD + padded > VIEWER_TRACE) {
        client->trace_lost++;
        return;
    }
    to = put_u64(to, (uint64_t)frame->time_ns);
    to = put_u32(to, frame->id);
    to = put_u8(to, (uint8_t)bus);
    to = put_u8(to, flags);
    to = put_u8(to, frame->len);
    to = put_u8(to, 0);
    memset(to, 0, padded);
    memcpy(to, frame->data, frame->len);
    client->traced += TRACE_RECORD + padded;
    client->ntraced++;
}

void viewer_trace_frame(struct viewer *viewer, size_t bus, const struct bus_frame *frame, bool ours)
{
    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        struct viewer_client *client = &viewer->client[i];

        if (client->socket >= 0 && client->watch.on && client->watch.trace) {
            client_trace_frame(client, bus, frame,
                               (uint8_t)(frame->flags | (ours ? TRACE_OURS : 0)));
        }
    }
}

void viewer_hear_buses(struct viewer *viewer)
{
    for (size_t b = 0; viewer->config.ports && b < viewer->rig->nbus; b++) {
        struct can_port *port = viewer->config.ports->port[b];
        struct bus_frame frame[BATCH];
        size_t count = BATCH;

        /* Receive frames of a bus, a limited number per turn */
        for (int turn = 0; turn < TURNS && count == BATCH; turn++) {
            count = can_receive(port, frame, BATCH);
            for (size_t i = 0; i < count; i++) {
                /* A frame without a time stamp gets the newest time stamp of its bus */
                if (frame[i].time_ns == 0) {
                    frame[i].time_ns = viewer->frame_ns[b];
                }
                viewer->frame_ns[b] = frame[i].time_ns;
                viewer_trace_frame(viewer, b, &frame[i], false);
            }
        }
    }
}

void client_send_trace(struct viewer *viewer, struct viewer_client *client)
{
    uint8_t *to;

    if (client->ntraced == 0) {
        return;
    }
    to = client_room(viewer, client, WEBSOCKET_HEADER + TRACE_HEADER + client->traced);
    if (!to) {
        client->trace_lost += client->ntraced;
    } else {
        uint8_t *at = to + websocket_header(to, WEBSOCKET_BINARY, TRACE_HEADER + client->traced);

        at = put_u8(at, TRACE_KIND);
        at = put_u8(at, VIEWER_PROTOCOL);
        at = put_u16(at, 0);
        at = put_u32(at, client->ntraced);
        at = put_u32(at, client->trace_lost);
        memcpy(at, client->trace, client->traced);
        client->filled += (size_t)(at - to) + client->traced;
        client->trace_lost = 0;
        client_flush(viewer, client);
    }
    client->traced = client->ntraced = 0;
}
