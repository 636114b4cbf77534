/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a browser may ask the server of a recording: each line of an input is a message, after which
 * the time goes on by 40 ms, or "@" and the milliseconds by which it does; between them states are
 * sent as to any page. What comes back is refused in a sentence, or has the bytes that its header
 * promises: states at times of the recording, series in the order of time and not longer than was
 * asked for, frames of buses that there are.
 */
#include "tests/fuzz/fuzz.h"
#include "tests/unit/rig/rig_files.h"
#include "viewer/private.h"

#include <math.h>
#include <sys/socket.h>

enum { ROWS = 500, ROW_MS = 10, FRAMES = 2000, BUFFER = 2 << 20, LINES = 64 };
enum { KIND_STATE = 1, KIND_FRAMES, KIND_SERIES };

static struct arena arena;
static const struct rig *rig;
static struct recording *recording;
static struct viewer *viewer;
static struct viewer_client fresh; /* a client as it is before it comes */
static uint8_t buffer[BUFFER];

/* ---- a recording ---- */

static void write_rows(FILE *file, double value)
{
    for (int row = 0; row < ROWS; row++) {
        fprintf(file, "%.3f", row * ROW_MS * 1e-3);
        for (size_t i = 0; i < (size_t)value; i++) {
            fprintf(file, ",%.9g", sin(0.01 * row + (double)i));
        }
        putc('\n', file);
    }
}

static void write_text(const char *name, struct fuzz_text *text)
{
    fuzz_text_finish(text);
    fuzz_write_file(name, text->text, text->size);
    fuzz_text_free(text);
}

static void write_recording(void)
{
    const struct robot *robot = rig->robot;
    struct fuzz_text text;
    FILE *file = fuzz_text_open(&text);

    fputs("time_s", file);
    for (size_t j = 0; j < robot->njoint; j++) {
        fprintf(file, ",q_%s_rad,torque_%s_nm", robot->joint[j].name, robot->joint[j].name);
    }
    putc('\n', file);
    write_rows(file, 2.0 * (double)robot->njoint);
    write_text("recording/signals.csv", &text);

    file = fuzz_text_open(&text);
    fputs("time_s", file);
    for (size_t b = 0; b < robot->nbody + rig->nfree; b++) {
        const char *name =
            b < robot->nbody ? robot->body[b].name : rig->free[b - robot->nbody].name;

        fprintf(file, ",%s_x_m,%s_y_m,%s_z_m,%s_qw,%s_qx,%s_qy,%s_qz", name, name, name, name, name,
                name, name);
    }
    putc('\n', file);
    write_rows(file, 7.0 * (double)(robot->nbody + rig->nfree));
    write_text("recording/poses.csv", &text);

    file = fuzz_text_open(&text);
    for (int i = 0; i < FRAMES; i++) {
        fprintf(file, "(%d.%06d) %s 1%02X#%016X\n", i / 400, i % 400 * 2500, rig->bus[0].interface,
                i % 256, i);
    }
    write_text("recording/candump.log", &text);
}

static void tear_down(void)
{
    viewer_stop(viewer);
    viewer_destroy(viewer);
    recording_close(recording);
    arena_fini(&arena);
}

/* The server, whose thread waits for an order that never comes: its work is done here. */
static void set_up(void)
{
    struct recording_config config = {.from_s = -INFINITY, .to_s = INFINITY, .speed = 1.0};
    char directory[128];
    struct error error;

    fuzz_require(make_tree() == 0 &&
                     write_file("config/rigs/toy.yaml", toy_rig, sizeof toy_rig - 1) == 0,
                 "no tree");
    fuzz_require(arena_init(&arena, (size_t)64 << 20, &error) == ERROR_NONE, "%s", error.text);
    fuzz_require(rig_load(rig_path, &arena, &rig, &error) == ERROR_NONE, "%s", error.text);
    remove_tree();
    write_recording();
    snprintf(directory, sizeof directory, "%s/recording", fuzz_folder());
    config.directory = directory;
    config.rig = rig;
    fuzz_require(recording_open(&config, &arena, &recording, &error) == ERROR_NONE, "%s",
                 error.text);
    fuzz_require(viewer_start(&(struct viewer_config){.recording = recording, .rig = rig}, &viewer,
                              &error) == ERROR_NONE,
                 "%s", error.text);
    fresh = viewer->client[0];
    fuzz_require(atexit(tear_down) == 0, "no end");
}

/* ---- what comes back ---- */

static uint64_t take(const uint8_t *at, size_t size)
{
    uint64_t value = 0;

    for (size_t i = 0; i < size; i++) {
        value |= (uint64_t)at[i] << 8 * i;
    }
    return value;
}

static void check_state(const uint8_t *at, size_t size)
{
    static const size_t part[] = {28, 8, 28, 24, 12};
    size_t expected = 80;
    int64_t time_ns;

    fuzz_require(size >= expected, "%zu", size);
    for (size_t i = 0; i < 5; i++) {
        expected += part[i] * take(at + 64 + 2 * i, 2);
    }
    expected += (take(at + 74, 2) + 31) / 32 * 4 + 4 * take(at + 76, 2);
    fuzz_require(size == expected, "%zu, not %zu", size, expected);
    time_ns = (int64_t)take(at + 16, 8);
    fuzz_require(time_ns >= recording->first_ns && time_ns <= recording->last_ns, "%jd",
                 (intmax_t)time_ns);
}

static void check_trace(const uint8_t *at, size_t size)
{
    const uint8_t *end = at + size;
    uint64_t count = take(at + 4, 4);

    for (at += 12; count > 0; count--) {
        fuzz_require(end - at >= 16 && at[12] < rig->nbus, "bus %d", at[12]);
        fuzz_require((int64_t)take(at, 8) <= recording->log.last_ns, "a frame of tomorrow");
        at += 16 + (at[14] + 3u) / 4 * 4;
    }
    fuzz_require(at == end, "%td bytes are left", end - at);
}

static void check_series(const uint8_t *at, size_t size)
{
    size_t signals = take(at + 2, 2), points = take(at + 8, 4), rows = take(at + 12, 4);
    double before = -INFINITY;

    fuzz_require(size == 24 + points * (8 + 4 * signals), "%zu points of %zu in %zu", points,
                 signals, size);
    fuzz_require(points <= VIEWER_POINTS && rows <= ROWS && signals <= VIEWER_SIGNALS, "%zu %zu",
                 points, rows);
    fuzz_require(points == rows || points < rows, "%zu points for %zu rows", points, rows);
    for (size_t i = 0; i < points; i++) {
        uint64_t bits = take(at + 24 + 8 * i, 8);
        double time_s;

        memcpy(&time_s, &bits, sizeof time_s);
        fuzz_require(time_s >= before && time_s <= ROWS * ROW_MS * 1e-3, "%g after %g", time_s,
                     before);
        before = time_s;
    }
}

static void check_text(const char *text, size_t size)
{
    json_t *answer = json_loadb(text, size, 0, NULL);
    const char *error = json_string_value(json_object_get(answer, "error"));

    fuzz_require(json_is_object(answer), "%.*s", (int)size, text);
    if (error) {
        fuzz_require(fuzz_is_sentence(error), "%s", error);
        fuzz_tally.refused++;
    } else {
        fuzz_tally.taken++;
    }
    json_decref(answer);
}

/* Frames of a server: not masked, all of them whole messages. */
static void check_answers(const uint8_t *at, size_t size)
{
    while (size > 0) {
        size_t header = at[1] < 126 ? 2 : at[1] == 126 ? 4 : 10, length = at[1];

        fuzz_require(size >= header && at[0] & 0x80 && at[1] < 128, "%02x %02x", at[0], at[1]);
        for (size_t i = 2; i < header; i++) {
            length = (i == 2 ? 0 : length << 8) | at[i];
        }
        fuzz_require(size >= header + length, "%zu of %zu", size, header + length);
        at += header;
        switch (at[-(ptrdiff_t)header] & 15) {
        case WEBSOCKET_TEXT:
            check_text((const char *)at, length);
            break;
        case WEBSOCKET_BINARY:
            fuzz_require(length >= 12 && at[0] >= KIND_STATE && at[0] <= KIND_SERIES, "%d", at[0]);
            (at[0] == KIND_STATE    ? check_state
             : at[0] == KIND_FRAMES ? check_trace
                                    : check_series)(at, length);
            break;
        default:
            fuzz_require((at[-(ptrdiff_t)header] & 15) == WEBSOCKET_CLOSE, "%02x", at[0]);
        }
        at += length;
        size -= header + length;
    }
}

/* Takes all that the client is sent. */
static void drain(struct viewer_client *client, int other)
{
    size_t size = 0;
    ssize_t got;

    do {
        client_flush(viewer, client);
        got = recv(other, buffer + size, BUFFER - size, MSG_DONTWAIT);
        size += got > 0 ? (size_t)got : 0;
        fuzz_require(size < BUFFER, "too much at once");
    } while (got > 0 || client_waiting(client) > 0);
    check_answers(buffer, size);
}

/* ---- an input ---- */

static void obey_line(struct viewer_client *client, const char *line, size_t size)
{
    int64_t wait_ms = 40;

    if (size > 0 && line[0] == '@') {
        char text[24] = {0};

        memcpy(text, line + 1, size - 1 < sizeof text - 1 ? size - 1 : sizeof text - 1);
        wait_ms = strtol(text, NULL, 10) % 10000000;
        wait_ms = wait_ms < 0 ? -wait_ms : wait_ms;
    } else if (size <= VIEWER_INBOX && client->mode == CLIENT_SOCKET) {
        viewer_obey(viewer, client, line, size);
    }
    viewer->now_ns += wait_ms * INT64_C(1000000);
    viewer_send_states(viewer);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *at = (const char *)data, *end = at + size;
    struct viewer_client *client;
    char enter[96];
    int pair[2];

    if (!viewer) {
        set_up();
    }
    client = &viewer->client[0];
    fuzz_require(socketpair(AF_UNIX, SOCK_STREAM, 0, pair) == 0, "no sockets");
    *client = fresh;
    client->socket = pair[0];
    client->mode = CLIENT_SOCKET;
    viewer->now_ns = 1;
    viewer->playback->counted_ns = INT64_MIN;
    snprintf(enter, sizeof enter, "{\"cmd\":\"enter\",\"token\":\"%s\"}", viewer->token[0]);
    obey_line(client, enter, strlen(enter));
    drain(client, pair[1]);

    for (int i = 0; i < LINES && at < end && client->socket >= 0; i++) {
        const char *stop = memchr(at, '\n', (size_t)(end - at));
        size_t length = (size_t)((stop ? stop : end) - at);

        obey_line(client, at, length);
        drain(client, pair[1]);
        at += length + (stop != NULL);
    }
    client_close(viewer, client);
    close(pair[1]);
    return 0;
}
