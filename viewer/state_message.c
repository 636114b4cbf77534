/* SPDX-License-Identifier: Apache-2.0 */
/* Writes states: binary messages with the values of one time. docs/page.md has the layout. */
#include "base/text.h"
#include "base/vec3.h"
#include "viewer/private.h"

#include <math.h>
#include <stdio.h>

enum {
    STATE_KIND = 1,
    STATE_HEADER = 80,
    STATE_BODY = 28,
    STATE_JOINT = 8,
    STATE_CONTACT = 28,
    STATE_BUS = 24,
    STATE_BOARD = 12,
};

enum state_flag { STATE_PAUSED = 1, STATE_CLAMPED = 2, STATE_ENDED = 4 };
enum board_flag {
    STATE_BOARD_LOADER = 1,
    STATE_BOARD_AWAY = 2,
    STATE_BOARD_FAULTY = 4,
    STATE_BOARD_EXTERNAL = 8,
    STATE_BOARD_SILENT = 16,
};

/* Period of the measurements of bus loads and tick durations. */
#define MEASURE_NS (250 * CLOCK_MS)
#define CONTACT_LEAST_N 1e-3
#define ENDED_NS (500 * CLOCK_MS) /* period of states after the end of a run */

/* ---- columns of signals ---- */

size_t viewer_find_column(const char *const *title, size_t count, const char *before,
                          const char *name, const char *after)
{
    char text[192];
    int column;

    snprintf(text, sizeof text, "%s%.100s%s", before, name, after);
    column = TEXT_INDEX(title, count, text);
    return column < 0 ? SIZE_MAX : (size_t)column;
}

static double state_signal(const struct viewer *viewer, size_t column, size_t offset)
{
    return column == SIZE_MAX ? 0.0 : viewer->view.signal[column + offset];
}

enum error_code viewer_create_state(struct viewer *viewer, struct error *error)
{
    const struct rig *rig = viewer->rig;
    struct arena *arena = &viewer->arena;
    size_t nbody = rig->robot->nbody + rig->nfree, njoint = rig->robot->njoint;

    viewer->state_max = STATE_HEADER + nbody * STATE_BODY + njoint * STATE_JOINT +
                        rig->contact.nbody * STATE_CONTACT + rig->nbus * STATE_BUS +
                        rig->boards.nboard * STATE_BOARD + FAULTS_MAX / 8 +
                        VIEWER_SIGNALS * sizeof(float);
    viewer->state = arena_alloc(arena, 1, viewer->state_max);
    viewer->motion = arena_alloc(arena, nbody + 1, sizeof *viewer->motion);
    viewer->torque = arena_alloc(arena, njoint + 1, sizeof *viewer->torque);
    viewer->wrench = arena_alloc(arena, rig->contact.nbody + 1, sizeof *viewer->wrench);
    viewer->free = arena_alloc(arena, rig->nfree + 1, sizeof *viewer->free);
    if (!viewer->state || !viewer->motion || !viewer->torque || !viewer->wrench || !viewer->free) {
        return error_set(error, ERROR_MEMORY, "page: no memory");
    }

    /* Find the columns that states use */
    for (size_t j = 0; j < njoint; j++) {
        viewer->torque[j] = viewer_find_column(viewer->signal, viewer->nsignal, "torque_",
                                               rig->robot->joint[j].name, "_nm");
    }
    for (size_t c = 0; c < rig->contact.nbody; c++) {
        viewer->wrench[c] = viewer_find_column(viewer->signal, viewer->nsignal, "fx_",
                                               rig_contact_name(rig, c), "_n");
    }
    for (size_t i = 0; i < rig->nfree; i++) {
        viewer->free[i] =
            viewer_find_column(viewer->signal, viewer->nsignal, "", rig->free[i].name, "_x_m");
    }
    return viewer->config.recording
               ? viewer_create_playback(viewer, error)
               : simulator_view_create(viewer->config.simulator, arena, &viewer->view, error);
}

/* ---- bus loads and tick durations ---- */

/* Measures bus loads and tick durations, four times a second. */
static void viewer_measure(struct viewer *viewer)
{
    const struct simulator_status *now = &viewer->view.status;
    const struct loop_stats *stats = simulator_stats(viewer->config.simulator);
    struct histogram *work = viewer->histogram;
    int64_t span_ns = now->time_ns - viewer->measured_ns;

    if (span_ns >= 0 && viewer->now_ns - viewer->measured_at_ns < MEASURE_NS) {
        return;
    }
    for (size_t b = 0; b < viewer->rig->nbus; b++) {
        double bits = (double)(now->bus[b].bits - viewer->measured_bits[b]);

        if (span_ns > 0) {
            viewer->load[b] = bits / ((double)span_ns * 1e-9 * (double)viewer->rig->bus[b].bitrate);
        }
        viewer->measured_bits[b] = now->bus[b].bits;
    }

    /* The mean is over the ticks since the last measurement; percentile and maximum are over all
     * ticks */
    histogram_copy(&stats->work, work);
    if (work->count > viewer->work_count) {
        viewer->work_us[0] = (double)(work->sum - viewer->work_sum) * 1e-3 /
                             (double)(work->count - viewer->work_count);
    }
    viewer->work_us[1] = (double)histogram_percentile(work, 0.99) * 1e-3;
    viewer->work_us[2] = (double)work->max * 1e-3;
    viewer->work_count = work->count;
    viewer->work_sum = work->sum;
    viewer->measured_ns = now->time_ns;
    viewer->measured_at_ns = viewer->now_ns;
}

/* ---- parts of a state ---- */

static uint8_t *put_pose(uint8_t *to, const double position[3], const double quaternion[4])
{
    for (int k = 0; k < 3; k++) {
        to = put_f32(to, position[k]);
    }
    for (int k = 0; k < 4; k++) {
        to = put_f32(to, quaternion[k]);
    }
    return to;
}

/* Writes the poses of the bodies: recorded poses, or poses computed from base and joint angles. */
static uint8_t *put_bodies(struct viewer *viewer, uint8_t *to)
{
    const struct robot *robot = viewer->rig->robot;
    const struct simulator_status *status = &viewer->view.status;

    if (viewer->playback) {
        for (size_t i = 0; i < robot->nbody + viewer->rig->nfree; i++) {
            to = put_pose(to, playback_pose(viewer, i), playback_pose(viewer, i) + 3);
        }
        return to;
    }
    robot_place_bodies(robot, status->base, status->base + BASE_Q_QUATERNION, status->q,
                       viewer->motion);
    for (size_t i = 0; i < robot->nbody; i++) {
        double quaternion[4];

        quaternion_from_mat3(viewer->motion[i].R, quaternion);
        to = put_pose(to, viewer->motion[i].p, quaternion);
    }
    for (size_t i = 0; i < viewer->rig->nfree; i++) {
        double pose[7];

        for (size_t k = 0; k < 7; k++) {
            pose[k] = state_signal(viewer, viewer->free[i], k);
        }
        to = put_pose(to, pose, pose + 3);
    }
    return to;
}

static uint8_t *put_joints(const struct viewer *viewer, uint8_t *to)
{
    for (size_t j = 0; j < viewer->rig->robot->njoint; j++) {
        to = put_f32(to, viewer->view.status.q[j]);
        to = put_f32(to, state_signal(viewer, viewer->torque[j], 0));
    }
    return to;
}

/* Writes the contact wrench of each body in contact: world frame, about the body's origin. *count
 * receives the number of wrenches. */
static uint8_t *put_contacts(const struct viewer *viewer, uint8_t *to, uint16_t *count)
{
    *count = 0;
    for (size_t c = 0; c < viewer->rig->contact.nbody; c++) {
        double wrench[6];

        for (size_t k = 0; k < 6; k++) {
            wrench[k] = state_signal(viewer, viewer->wrench[c], k);
        }
        if (!(vec3_norm(wrench) > CONTACT_LEAST_N)) {
            continue;
        }
        to = put_u16(to, (uint16_t)c);
        to = put_u16(to, 0);
        for (size_t k = 0; k < 6; k++) {
            to = put_f32(to, wrench[k]);
        }
        (*count)++;
    }
    return to;
}

/* Writes counters, load and state of each bus. */
static uint8_t *put_buses(const struct viewer *viewer, uint8_t *to)
{
    for (size_t b = 0; b < viewer->rig->nbus; b++) {
        const struct bus_status *bus = &viewer->view.status.bus[b];

        to = put_u32(to, (uint32_t)bus->rx_frames);
        to = put_u32(to, (uint32_t)bus->tx_frames);
        to = put_u32(to, (uint32_t)bus->rx_dropped);
        to = put_u32(to, (uint32_t)bus->tx_dropped);
        to = put_f32(to, viewer->load[b]);
        to = put_u32(to, (uint32_t)bus->state);
    }
    return to;
}

/* Returns the number of boards; a recording has none. */
static size_t viewer_boards(const struct viewer *viewer)
{
    return viewer->playback ? 0 : viewer->rig->boards.nboard;
}

/* Writes for each board the time since its last frame (s, -1 = never), its flags and the modes of
 * its axes. */
static uint8_t *put_boards(const struct viewer *viewer, uint8_t *to)
{
    for (size_t i = 0; i < viewer_boards(viewer); i++) {
        const struct board_state *board = &viewer->view.board[i];
        double age_s = (double)(viewer->view.status.time_ns - board->heard_ns) * 1e-9;

        to = put_f32(to, board->heard_ns < 0 ? -1.0 : fmax(age_s, 0.0));
        to = put_u8(to, board->address);
        to = put_u8(to, (uint8_t)((board->in_bootloader ? STATE_BOARD_LOADER : 0) |
                                  (board->away ? STATE_BOARD_AWAY : 0) |
                                  (board->faulty ? STATE_BOARD_FAULTY : 0) |
                                  (board->external ? STATE_BOARD_EXTERNAL : 0) |
                                  (board->silent ? STATE_BOARD_SILENT : 0)));
        to = put_u8(to, board->naxis);
        to = put_u8(to, 0);
        for (size_t k = 0; k < 4; k++) {
            to = put_u8(to, k < BOARD_AXES_MAX ? board->mode[k] : 0);
        }
    }
    return to;
}

/* Writes the active faults, one bit each. */
static uint8_t *put_faults(const struct viewer *viewer, uint8_t *to, size_t count)
{
    for (size_t i = 0; i < (count + 31) / 32; i++) {
        to = put_u32(to, (uint32_t)(viewer->view.status.fault[i / 2] >> (32 * (i % 2))));
    }
    return to;
}

/* ---- a state ---- */

/* Writes the header of a state. */
static void put_state_header(const struct viewer *viewer, const struct viewer_client *client,
                             uint8_t *to, uint16_t ncontact, size_t nfault)
{
    const struct simulator_status *status = &viewer->view.status;
    const struct requests *requests =
        viewer->playback ? NULL : simulator_requests(viewer->config.simulator);
    const struct rig *rig = viewer->rig;
    bool paused =
        viewer->playback ? client->playback.paused : requests && requests_paused(requests);
    double speed = viewer->playback ? client->playback.speed
                   : requests       ? requests_speed(requests)
                                    : 1.0;
    struct timespec wall;

    /* Kind of message, the clocks, then the sizes of the parts */
    to = put_u8(to, STATE_KIND);
    to = put_u8(to, VIEWER_PROTOCOL);
    to =
        put_u16(to, (uint16_t)((paused ? STATE_PAUSED : 0) | (status->clamped ? STATE_CLAMPED : 0) |
                               (viewer->ended ? STATE_ENDED : 0)));
    to = put_u32(to, 0); /* number of the client's skipped states, set in client_send_state */
    to = put_u64(to, status->tick);
    to = put_u64(to, (uint64_t)status->time_ns);
    to = put_u64(to, (uint64_t)status->elapsed_ns);
    clock_gettime(CLOCK_REALTIME, &wall);
    to = put_u64(to, (uint64_t)(wall.tv_sec * CLOCK_SECOND + wall.tv_nsec));
    to = put_u32(to, (uint32_t)status->overruns);
    to = put_u32(to, (uint32_t)status->lost_ticks);
    to = put_f32(to, speed);
    for (int k = 0; k < 3; k++) {
        to = put_f32(to, viewer->work_us[k]);
    }
    to = put_u16(to, (uint16_t)(rig->robot->nbody + rig->nfree));
    to = put_u16(to, (uint16_t)rig->robot->njoint);
    to = put_u16(to, ncontact);
    to = put_u16(to, (uint16_t)rig->nbus);
    to = put_u16(to, (uint16_t)viewer_boards(viewer));
    to = put_u16(to, (uint16_t)nfault);
    put_u32(to, 0); /* number of the client's signals, set in client_send_state */
}

/* Appends the client's own part (skipped states, chosen signals) and sends the state. */
static void client_send_state(struct viewer *viewer, struct viewer_client *client, size_t size)
{
    const struct viewer_watch *watch = &client->watch;
    uint8_t *to = viewer->state + size;

    put_u32(viewer->state + 4, watch->skipped);
    put_u16(viewer->state + 76, (uint16_t)watch->nsignal);
    for (size_t i = 0; i < watch->nsignal; i++) {
        to = put_f32(to, viewer->view.signal[watch->signal[i]]);
    }
    client_send_message(viewer, client, WEBSOCKET_BINARY, viewer->state,
                        (size_t)(to - viewer->state));
    viewer->counters.states++;
}

/* ---- events ---- */

void client_send_events(struct viewer *viewer, struct viewer_client *client)
{
    for (;;) {
        struct viewer_event event;
        uint64_t next;

        pthread_mutex_lock(&viewer->events_lock);
        next = viewer->nevent > client->events + VIEWER_EVENTS ? viewer->nevent - VIEWER_EVENTS
                                                               : client->events;
        event = viewer->events[next % VIEWER_EVENTS];
        next = next < viewer->nevent ? next + 1 : 0;
        pthread_mutex_unlock(&viewer->events_lock);

        /* An event without space is sent with the next state */
        if (next == 0 || client_waiting(client) > VIEWER_OUTBOX / 2 ||
            !client_send_object(viewer, client,
                                json_pack("{s:s, s:i, s:s}", "type", "event", "priority",
                                          (int)event.priority, "text", event.text))) {
            return;
        }
        client->events = next;
    }
}

/* ---- all clients ---- */

/* Checks whether a state is due for a client; a slow client skips one. */
static bool client_wants_state(struct viewer *viewer, struct viewer_client *client)
{
    struct viewer_watch *watch = &client->watch;

    if (client->socket < 0 || !watch->on || viewer->now_ns < watch->due_ns) {
        return false;
    }
    watch->due_ns += watch->period_ns;
    if (watch->due_ns < viewer->now_ns || viewer->ended) {
        watch->due_ns = viewer->now_ns + (viewer->ended ? ENDED_NS : watch->period_ns);
    }
    if (client_waiting(client) > VIEWER_OUTBOX / 8) {
        watch->skipped++;
        viewer->counters.skipped_states++;
        return false;
    }
    return true;
}

/* Checks whether the present view is older than the request for views. */
static bool viewer_awaits_view(struct viewer *viewer)
{
    if (viewer->awaited &&
        (viewer->now_ns > viewer->awaited_till_ns ||
         simulator_view_read(viewer->config.simulator, &viewer->view) != viewer->views_before)) {
        viewer->awaited = false;
    }
    return viewer->awaited;
}

void viewer_send_states(struct viewer *viewer)
{
    size_t size = 0;

    if (viewer_awaits_view(viewer)) {
        return;
    }
    for (size_t i = 0; i < VIEWER_CLIENTS; i++) {
        struct viewer_client *client = &viewer->client[i];

        if (!client_wants_state(viewer, client)) {
            continue;
        }
        /* Make one state for all clients that are due; for a recording, one state per client */
        if (viewer->playback) {
            playback_view(viewer, client);
            playback_trace(viewer, client);
        } else if (size == 0) {
            simulator_view_read(viewer->config.simulator, &viewer->view);
            viewer_measure(viewer);
        }
        if (viewer->playback || size == 0) {
            size_t nfault = viewer->playback
                                ? 0
                                : faults_count(simulator_parts(viewer->config.simulator).faults);
            uint8_t *to = viewer->state + STATE_HEADER;
            uint16_t ncontact;

            /* Write the part of a state that all clients share; for a recording, it is made for
             * one client. */
            to = put_bodies(viewer, to);
            to = put_joints(viewer, to);
            to = put_contacts(viewer, to, &ncontact);
            to = put_buses(viewer, to);
            to = put_boards(viewer, to);
            to = put_faults(viewer, to, nfault);
            put_state_header(viewer, client, viewer->state, ncontact, nfault);
            size = (size_t)(to - viewer->state);
        }
        client_send_events(viewer, client);
        client_send_trace(viewer, client);
        client_send_rows(viewer, client);
        client_send_state(viewer, client, size);
    }
}
