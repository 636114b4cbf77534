/* SPDX-License-Identifier: Apache-2.0 */
/* The core of the host: map of the boards, time and lockstep, reception, start-up, health
 * checks. */
#include "tasks/host_private.h"

#include "base/array.h"
#include "base/text.h"
#include "canbus/lockstep.h"

#include <inttypes.h>

/* ---- health ---- */

/* longest time without rotor positions */
static const int64_t TELEMETRY_TIMEOUT_NS = 200 * HOST_MS;
/* longest time without values of a watched sensor, */
static const int64_t SENSOR_TIMEOUT_NS = 100 * HOST_MS;
enum { SENSOR_TIMEOUT_PERIODS = 10 }; /* or this number of the sensor's periods, if longer */

enum { TRAFFIC_TEXT = 96 };

/* Writes the numbers of frames exchanged on a bus, for messages about a failed start-up. Returns
 * text. */
static const char *host_list_traffic(const struct host *host, size_t bus, char text[TRAFFIC_TEXT])
{
    const struct host_line *line = &host->line[bus];

    text[0] = '\0';
    if (host->phase < HOST_READY) {
        snprintf(text, TRAFFIC_TEXT, " (%" PRIu64 " frames sent on this bus, %" PRIu64 " received)",
                 line->frames_sent, line->frames_received);
    }
    return text;
}

void host_fail_node(struct host *host, size_t bus, unsigned address, const char *what)
{
    char traffic[TRAFFIC_TEXT];

    if (host->phase != HOST_FAILED) { /* keep the first failure, because it caused the others */
        snprintf(host->message, sizeof host->message, "board %u on %s %s%s", address,
                 host->config.port[bus]->bus, what, host_list_traffic(host, bus, traffic));
        host->phase = HOST_FAILED;
    }
}

enum { FAULTS_TEXT = 128 };

enum host_phase host_fail_joint(struct host *host, size_t axis, const char *what)
{
    const struct host_joint *joint = &host->joint[axis];
    char names[FAULTS_TEXT], traffic[TRAFFIC_TEXT];

    if (joint->motor == HOST_MOTOR_FAULT) {
        const struct host_line *line = &host->line[host->config.axis[axis].bus];

        /* Name the faults, or the possible cause of a fault without a bit */
        protocol_list_faults(line->protocol, joint->fault, names, sizeof names);
        if (joint->fault == 0 && line->ops->unnamed_fault) {
            snprintf(names, sizeof names, "%s", line->ops->unnamed_fault);
        }
        snprintf(host->message, sizeof host->message, "joint %s is in fault 0x%02X%s%s",
                 host->config.axis[axis].joint, (unsigned)joint->fault, *names ? ": " : "", names);
    } else {
        snprintf(host->message, sizeof host->message, "joint %s %s%s",
                 host->config.axis[axis].joint, what,
                 host_list_traffic(host, (size_t)host->config.axis[axis].bus, traffic));
    }
    return host->phase = HOST_FAILED;
}

void host_watch_force(struct host *host, size_t ft)
{
    host->force_watched[ft] = true;
}

void host_watch_motion(struct host *host)
{
    host->motion_watched = true;
}

/* Fails the host if a required value is too old. time_ns: time of the value; -1 = no value yet.
 * Ages are counted from the end of the start-up at the earliest. */
static void host_judge_sensor(struct host *host, int bus, unsigned address, int64_t time_ns,
                              const char *what)
{
    int64_t period_ns = host->line[bus].node[address].period_ns;
    int64_t since_ns = time_ns > host->phase_since_ns ? time_ns : host->phase_since_ns;
    int64_t timeout_ns = SENSOR_TIMEOUT_PERIODS * period_ns;

    timeout_ns = timeout_ns > SENSOR_TIMEOUT_NS ? timeout_ns : SENSOR_TIMEOUT_NS;
    if (host->phase != HOST_FAILED && host->now_ns - since_ns > timeout_ns) {
        host_fail_node(host, (size_t)bus, address, what);
        host->lost = true;
    }
}

bool host_healthy(struct host *host)
{
    for (size_t i = 0; i < host->config.naxis && host->phase != HOST_FAILED; i++) {
        const struct host_joint *joint = &host->joint[i];

        if (joint->motor != HOST_MOTOR_ON) {
            /* A motor that is off without a fault means that the board has restarted */
            host->lost = joint->motor == HOST_MOTOR_OFF;
            host_fail_joint(host, i,
                            joint->motor == HOST_MOTOR_OTHER ? "is in a mode that was not commanded"
                                                             : "has switched its motor off");
        } else if (host->now_ns - joint->motor_time_ns > TELEMETRY_TIMEOUT_NS) {
            host_fail_joint(host, i, "sends no telemetry");
            host->lost = joint->motor != HOST_MOTOR_FAULT;
        }
    }

    /* Check the age of all watched values */
    const struct host_imu *imu = &host->config.imu;
    const struct host_motion *motion = &host->motion;

    for (size_t i = 0; i < host->config.nft; i++) {
        const struct host_ft *ft = &host->config.ft[i];

        if (host->force_watched[i]) {
            host_judge_sensor(host, ft->bus, ft->address, host->force[i].force_time_ns,
                              "sends no force");
            host_judge_sensor(host, ft->bus, ft->address, host->force[i].torque_time_ns,
                              "sends no torque");
        }
    }
    if (host->motion_watched) {
        host_judge_sensor(host, imu->bus, imu->address, motion->rate_time_ns,
                          "sends no angular rate");
        host_judge_sensor(host, imu->bus, imu->address,
                          motion->quaternion_time_ns >= 0 ? motion->quaternion_time_ns
                                                          : motion->acceleration_time_ns,
                          "sends no attitude");
    }
    return host->phase != HOST_FAILED;
}

const char *host_message(const struct host *host)
{
    return host->message;
}

bool host_lost(const struct host *host)
{
    return host->phase == HOST_FAILED && host->lost;
}

/* ---- start-up: discover, configure, switch the motors on ---- */

static const int64_t DISCOVERY_TIMEOUT_NS = 8000 * HOST_MS; /* boards may boot for five seconds */
static const int64_t DISCOVERY_REPEAT_NS = 250 * HOST_MS;
/* a status follows a mode change within 10 ms */
static const int64_t ENABLE_TIMEOUT_NS = 1000 * HOST_MS;
/* timeout of a request, as in real hosts */
static const int64_t REPLY_TIMEOUT_NS = 300 * HOST_MS;

enum { REQUEST_TRIES = 3 };

static void host_enter_phase(struct host *host, enum host_phase phase)
{
    host->phase = phase;
    host->phase_since_ns = host->now_ns;
}

/* Calls step for every board of this host. Returns true if all calls returned true. */
static bool host_every_node(struct host *host,
                            bool (*step)(struct host *, size_t bus, unsigned address))
{
    bool all = true;

    for (size_t b = 0; b < host->config.nbus; b++) {
        for (unsigned a = 1; a < HOST_ADDRESSES; a++) {
            if (host->line[b].node[a].kind != HOST_NO_BOARD && !step(host, b, a)) {
                all = false;
            }
        }
    }
    return all;
}

static bool host_node_found(struct host *host, size_t bus, unsigned address)
{
    return host->line[bus].node[address].found;
}

/* Fails the host for a board that does not answer; host_fail_node keeps the first failure. */
static bool host_fail_missing(struct host *host, size_t bus, unsigned address)
{
    if (!host->line[bus].node[address].found) {
        host_fail_node(host, bus, address, "does not answer discovery");
        host->lost = true;
    }
    return true;
}

/* Sends a board its requests in order, and repeats each until the board answers. Returns true if
 * all are answered. */
static bool host_configure_node(struct host *host, size_t bus, unsigned address)
{
    struct host_line *line = &host->line[bus];
    struct host_node *node = &line->node[address];
    struct host_request request = {0};
    bool waits = node->answered < node->requested;
    int64_t took_ns = host->now_ns - node->request_time_ns;

    /* Measure the round trip time only with requests that were sent once */
    if (node->timed && !waits) {
        node->timed = false;
        if (line->round_trip_ns == 0 || took_ns < line->round_trip_ns) {
            line->round_trip_ns = took_ns;
        }
    }
    /* If the answer is missing, wait, give up, or repeat the request */
    if (waits && took_ns <= REPLY_TIMEOUT_NS) {
        return false;
    }
    if (waits && node->tries == REQUEST_TRIES) {
        char what[64];

        snprintf(what, sizeof what, "does not answer the start-up request 0x%03" PRIx32,
                 node->request_id);
        host_fail_node(host, bus, address, what);
        host->lost = true;
        return false;
    }
    if (!line->ops->request || !line->ops->request(host, bus, address, node->answered, &request)) {
        return true;
    }
    /* Count requests that expect no answer as answered */
    host_queue(host, bus, &request.frame);
    node->request_id = request.frame.id;
    node->requested = node->answered + 1;
    node->answered += !request.reply;
    node->tries = waits ? node->tries + 1 : 1;
    node->timed = request.reply && node->tries == 1;
    node->request_time_ns = host->now_ns;
    return false;
}

/* Switches all motors off, then on, until every board reports "on". Fails after
 * ENABLE_TIMEOUT_NS. */
static enum host_phase host_enable_motors(struct host *host)
{
    bool all = true;

    /* Switch off first, to clear old faults, then on. Repeat for motors that have not followed */
    if (host->enabling < 2 || host->now_ns - host->asked_ns >= REPLY_TIMEOUT_NS) {
        for (size_t i = 0; i < host->config.naxis; i++) {
            /* If an earlier host left a motor on, wait until the motor reports "off" */
            if (host->enabling == 0 && host->joint[i].motor == HOST_MOTOR_ON) {
                host->joint[i].motor = HOST_MOTOR_UNKNOWN;
            }
            if (host->enabling < 2 || host->joint[i].motor != HOST_MOTOR_ON) {
                host_set_motor(host, i, host->enabling > 0);
            }
        }
        host->enabling++;
        host->asked_ns = host->now_ns;
    }

    /* A motor counts as on if it reports "on" and values from both encoders */
    for (size_t i = 0; i < host->config.naxis; i++) {
        const struct host_joint *joint = &host->joint[i];
        bool ready =
            joint->motor == HOST_MOTOR_ON && joint->motor_time_ns >= 0 && joint->joint_time_ns >= 0;

        if (!ready && host->now_ns - host->phase_since_ns > ENABLE_TIMEOUT_NS) {
            return host_fail_joint(
                host, i,
                joint->motor == HOST_MOTOR_UNKNOWN
                    ? "does not switch its motor on: no frame has reported its state"
                : joint->motor != HOST_MOTOR_ON
                    ? "does not switch its motor on: its board still reports another state"
                : joint->motor_time_ns < 0 ? "reports no position of its motor"
                                           : "reports no position of its link");
        }
        all = all && ready;
    }
    if (all && host->enabling > 1) {
        host_enter_phase(host, HOST_READY);
    }
    return host->phase;
}

int64_t host_round_trip_ns(const struct host *host)
{
    int64_t longest = 0;

    for (size_t b = 0; b < host->config.nbus; b++) {
        longest = host->line[b].round_trip_ns > longest ? host->line[b].round_trip_ns : longest;
    }
    return longest;
}

enum host_phase host_start_up(struct host *host)
{
    switch (host->phase) {
    case HOST_DISCOVERING:
        /* Send at least one request, because boards need it even if they have already reported */
        if (host->asked && host_every_node(host, host_node_found)) {
            host_enter_phase(host, HOST_CONFIGURING);
            return host->phase;
        }

        /* Repeat the request, because a booting board answers late */
        if (!host->asked) {
            host->phase_since_ns = host->now_ns;
        }
        if (!host->asked || host->now_ns - host->asked_ns >= DISCOVERY_REPEAT_NS) {
            for (size_t b = 0; b < host->config.nbus; b++) {
                host->line[b].ops->discover(host, b);
            }
            host->asked = true;
            host->asked_ns = host->now_ns;
        }

        /* Report the first missing board */
        if (host->now_ns - host->phase_since_ns > DISCOVERY_TIMEOUT_NS) {
            host_every_node(host, host_fail_missing);
        }
        return host->phase;

    case HOST_CONFIGURING:
        if (host_every_node(host, host_configure_node) && host->phase == HOST_CONFIGURING) {
            host_enter_phase(host, HOST_ENABLING);
        }
        return host->phase;
    case HOST_ENABLING:
        return host_enable_motors(host);
    default:
        return host->phase;
    }
}

enum {
    RECEIVE_BATCH = 64,
    BATCHES_MAX = 64, /* limit per bus and period, so that many frames cannot delay the period */
    /* maximum tick difference in the answer to a repeated STEP; a larger difference means that the
     * simulator has restarted */
    STEPS_APART = 50,
};

static const int64_t STEP_REPEAT_NS = 100000000;

/* ---- creation ---- */

/* Initializes the state of a bus. Returns ERROR_INPUT if no host supports the bus's protocol. */
static enum error_code host_open_line(struct host *host, size_t bus, struct arena *arena,
                                      struct error *error)
{
    const struct host_bus *of = host->config.bus ? &host->config.bus[bus] : NULL;
    struct host_line *line = &host->line[bus];

#define HOST_ADDRESS(NAME) &host_##NAME,
    static const struct host_ops *const known[] = {PROTOCOLS(HOST_ADDRESS)};

    for (size_t i = 0; i < ARRAY_COUNT(known); i++) {
        if (!line->ops && (!of || !of->protocol || !strcmp(protocol_at(i)->name, of->protocol))) {
            line->ops = known[i];
            line->protocol = protocol_at(i);
        }
    }
    if (!line->ops) {
        return error_set(error, ERROR_INPUT, "host: bus %zu speaks %.40s, which no host knows", bus,
                         of->protocol);
    }
    if (of && of->described) {
        line->sent = arena_alloc(arena, HOST_ROWS, sizeof *line->sent);
        if (!line->sent) {
            return error_set(error, ERROR_MEMORY, "no memory for the host");
        }
    }
    for (int k = 0; k < HOST_SLOTS; k++) {
        line->slot[k] = -1;
    }
    return ERROR_NONE;
}

/* Finds the node at an address of a bus and checks its kind. The first call sets the kind. Returns
 * ERROR_INPUT if the bus or the address does not exist. */
static enum error_code host_claim_node(struct host *host, int bus, unsigned address,
                                       enum host_kind kind, struct host_node **out,
                                       struct error *error)
{
    const struct protocol *protocol;
    struct host_node *node;

    if (bus < 0 || (size_t)bus >= host->config.nbus) {
        return error_set(error, ERROR_INPUT, "host: no bus %d", bus);
    }
    protocol = host->line[bus].protocol;
    if (address < 1 || address > (kind == HOST_MOTOR_BOARD ? protocol->motor_address_max
                                                           : protocol->address_max)) {
        return error_set(error, ERROR_INPUT, "host: no address %u on bus %d", address, bus);
    }
    node = &host->line[bus].node[address];
    if (node->kind == HOST_NO_BOARD) {
        node->kind = kind;
        for (int k = 0; k < HOST_AXES; k++) {
            node->axis[k] = -1;
        }
        for (int c = 0; c < HOST_CHANNELS; c++) {
            node->channel[c] = -1;
        }
    } else if (node->kind != kind) {
        return error_set(error, ERROR_INPUT, "host: address %u on bus %d has two kinds of board",
                         address, bus);
    }
    *out = node;
    return ERROR_NONE;
}

/* Maps a joint to the axis of its motor board and to the channel of its torque board. */
static enum error_code host_map_axis(struct host *host, size_t index, struct error *error)
{
    const struct host_axis *axis = &host->config.axis[index];
    const struct host_ops *ops;
    struct host_node *node;
    enum error_code code =
        host_claim_node(host, axis->bus, axis->address, HOST_MOTOR_BOARD, &node, error);

    if (code) {
        return code;
    }

    /* Map the motor: one joint per axis. If the boards do not report the link's angle, require gear
     * and spring, because the host computes it from them */
    ops = host->line[axis->bus].ops;
    if (axis->axis >= host->line[axis->bus].protocol->axes_max || node->axis[axis->axis] >= 0) {
        return error_set(error, ERROR_INPUT, "host: joint %s shares its axis", axis->joint);
    }
    node->axis[axis->axis] = (int)index;
    if (host->line[axis->bus].slots < HOST_SLOTS) {
        host->line[axis->bus].slot[host->line[axis->bus].slots++] = (int)index;
    }
    if (ops->rotor_only &&
        !(axis->drive.gear > 0 && (axis->drive.spring_nm_rad > 0 || axis->drive.valve))) {
        return error_set(error, ERROR_INPUT, "host: joint %s has no gear or no spring",
                         axis->joint);
    }

    /* Map the torque, if a separate board measures it */
    host->joint[index].torque_told = !ops->torque_apart || axis->torque_address >= 0;
    if (axis->torque_address < 0) {
        return ERROR_NONE;
    }
    code = host_claim_node(host, axis->bus, (unsigned)axis->torque_address, HOST_TORQUE_BOARD,
                           &node, error);
    if (code) {
        return code;
    }
    if (axis->torque_channel < 0 || axis->torque_channel >= HOST_CHANNELS) {
        return error_set(error, ERROR_INPUT, "host: joint %s has torque channel %d", axis->joint,
                         axis->torque_channel);
    }
    node->channel[axis->torque_channel] = (int)index;
    node->period_ns = axis->torque_period_ns;
    return ERROR_NONE;
}

enum error_code host_create(const struct host_config *config, struct arena *arena,
                            struct host **out, struct error *error)
{
    struct host *host = arena_alloc(arena, 1, sizeof *host);
    struct host_node *node;
    enum error_code code;

    if (host) {
        host->line = arena_alloc(arena, config->nbus, sizeof *host->line);
        host->joint = arena_alloc(arena, config->naxis, sizeof *host->joint);
        host->force = arena_alloc(arena, config->nft, sizeof *host->force);
        host->force_watched = arena_alloc(arena, config->nft, sizeof *host->force_watched);
        host->volts = arena_alloc(arena, config->naxis, sizeof *host->volts);
        host->want = arena_alloc(arena, config->naxis, sizeof *host->want);
    }
    /* Allocate everything here, so that the loop never allocates */
    if (!host || !host->line || !host->joint || !host->force || !host->force_watched ||
        !host->volts || !host->want) {
        return error_set(error, ERROR_MEMORY, "no memory for the host");
    }
    host->config = *config;
    for (size_t b = 0; b < config->nbus; b++) {
        code = host_open_line(host, b, arena, error);
        if (code) {
            return code;
        }
    }

    /* Map axes and sensors to addresses */
    for (size_t i = 0; i < config->naxis; i++) {
        code = host_map_axis(host, i, error);
        if (code) {
            return code;
        }
        host->joint[i].motor_time_ns = -1;
        host->joint[i].joint_time_ns = -1;
        host->joint[i].torque_time_ns = -1;
    }
    for (size_t i = 0; i < config->nft; i++) {
        const struct host_ft *ft = &host->config.ft[i];

        code = host_claim_node(host, ft->bus, ft->address, HOST_FT_BOARD, &node, error);
        if (code) {
            return code;
        }
        node->ft = (int)i;
        node->period_ns = ft->period_ns;
        host->force[i].force_time_ns = host->force[i].torque_time_ns = -1;
    }
    host->motion.acceleration_time_ns = -1;
    host->motion.rate_time_ns = host->motion.quaternion_time_ns = -1;
    *out = host;
    if (!config->imu.present) {
        return ERROR_NONE;
    }
    code = host_claim_node(host, config->imu.bus, config->imu.address, HOST_INERTIAL_BOARD, &node,
                           error);
    if (!code) {
        node->period_ns = config->imu.period_ns;
    }
    return code;
}

/* ---- receiving ---- */

struct host_joint *host_node_joint(struct host *host, const struct host_node *node, int axis)
{
    return node->axis[axis] < 0 ? NULL : &host->joint[node->axis[axis]];
}

/* Handles a DONE whose tick is not the STEP's tick. Adopts the simulator's tick, or fails if the
 * simulator has restarted. */
static void host_read_refusal(struct host *host, uint32_t tick)
{
    if (tick == host->step_tick) {
        return; /* answer to an earlier copy of a repeated STEP */
    }
    if (tick + STEPS_APART < host->step_tick && host->phase != HOST_FAILED) {
        host->phase = HOST_FAILED;
        host->lost = true;
        snprintf(host->message, sizeof host->message,
                 "the simulator was restarted: it is at tick %u", (unsigned)tick);
    }
    host->step_refused = true;
    host->tick = tick;
}

/* Returns whether the frame may come from a board of the bus. */
static bool host_hears(const struct host_line *line, const struct bus_frame *frame)
{
    return !(frame->flags & (FRAME_ERROR | FRAME_REMOTE)) &&
           (line->ops->extended || !(frame->flags & FRAME_EXTENDED));
}

/* Passes a frame to the lockstep or to the protocol of its bus. */
static void host_read_frame(struct host *host, size_t bus, const struct bus_frame *frame)
{
    struct host_line *line = &host->line[bus];

    if (!host_hears(line, frame)) {
        return;
    }
    if (host->config.lockstep && frame_has_standard_id(frame, &host->config.done_id, 1)) {
        /* Read a DONE frame: the bus has finished its tick, has refused the STEP, or is stopping */
        if (frame->len == LOCKSTEP_LENGTH) {
            uint16_t flags = get_u16_le(frame->data + 4);
            uint32_t tick = get_u32_le(frame->data);

            if (flags & LOCKSTEP_MISMATCH && tick != host->step_tick + 1) {
                host_read_refusal(host, tick);
            } else {
                /* The simulator may refuse a copy of a STEP because the STEP has run and its DONE
                 * was lost */
                line->done = true;
                host->tick = tick;
            }
            if (flags & LOCKSTEP_STOPPING) {
                host->phase = HOST_FAILED;
                host->lost = true;
                snprintf(host->message, sizeof host->message, "the simulator is stopping");
            }
        }
    } else {
        line->frames_received++;
        line->ops->read(host, bus, frame);
    }
}

bool host_receive(struct host *host, int64_t now_ns)
{
    bool all_done = true;

    if (!host->config.lockstep) {
        host->now_ns = now_ns;
    }
    for (size_t b = 0; b < host->config.nbus; b++) {
        struct bus_frame frames[RECEIVE_BATCH];
        size_t count = RECEIVE_BATCH;

        /* Read the frames that have arrived on a bus, up to the limit for a period */
        for (int batch = 0; batch < BATCHES_MAX && count == RECEIVE_BATCH; batch++) {
            count = can_receive(host->config.port[b], frames, RECEIVE_BATCH);
            for (size_t i = 0; i < count; i++) {
                host_read_frame(host, b, &frames[i]);
            }
        }
        all_done = all_done && host->line[b].done;
    }
    if (!host->config.lockstep) {
        return true;
    }
    /* In lockstep, begin the period when every bus has finished its tick, or a STEP was refused */
    if (host->step_waits && !all_done && !host->step_refused) {
        return false;
    }
    for (size_t b = 0; b < host->config.nbus; b++) {
        host->line[b].done = false;
    }
    host->step_waits = false;
    host->step_refused = false;
    host->now_ns = host->tick * host->config.period_ns;
    return true;
}

int64_t host_time_ns(const struct host *host)
{
    return host->now_ns;
}

/* ---- listening only ---- */

void host_begin_listening(struct host *host)
{
    for (size_t b = 0; b < host->config.nbus; b++) {
        for (unsigned a = 0; a < HOST_ADDRESSES; a++) {
            host->line[b].node[a].found = true;
        }
    }
}

void host_listen(struct host *host, size_t bus, const struct bus_frame *frame, int64_t now_ns)
{
    if (!host_hears(&host->line[bus], frame)) {
        return;
    }
    host->now_ns = now_ns;
    host->line[bus].ops->read(host, bus, frame);
    host->line[bus].queued = 0; /* a passive host discards its answers */
}

void host_visit_start_up(struct host *host, size_t bus, unsigned restart_stages,
                         void (*visit)(void *context, unsigned stage, const struct bus_frame *),
                         void *context)
{
    struct host_line *line = &host->line[bus];
    const unsigned first = line->ops->restarts ? restart_stages + 1 : 1;
    struct host_request request;

    line->ops->discover(host, bus);
    for (size_t i = 0; i < line->queued; i++) {
        visit(context, 0, &line->queue[i]);
    }
    line->queued = 0;
    for (unsigned address = 0; address < HOST_ADDRESSES && line->ops->request; address++) {
        for (int number = 0; line->node[address].kind != HOST_NO_BOARD &&
                             line->ops->request(host, bus, address, number, &request);
             number++) {
            visit(context, first + (unsigned)number, &request.frame);
        }
    }
}

/* ---- commands ---- */

void host_queue(struct host *host, size_t bus, const struct bus_frame *frame)
{
    struct host_line *to = &host->line[bus];

    if (to->queued < HOST_QUEUE) {
        to->queue[to->queued] = *frame;
        to->queue[to->queued++].time_ns = host->now_ns;
    }
}

/* Returns the bus of an axis's motor board. */
static struct host_line *host_axis_line(struct host *host, size_t axis)
{
    return &host->line[host->config.axis[axis].bus];
}

void host_set_motor(struct host *host, size_t axis, bool on)
{
    struct host_line *line = host_axis_line(host, axis);

    host->volts[axis] = 0;
    host->want[axis].referred = false;
    host->want[axis].rad_s = 0.0;
    line->driving = line->driving || on;
    line->ops->set_motor(host, axis, on);
}

void host_set_voltage(struct host *host, size_t axis, double volts)
{
    struct host_line *line = host_axis_line(host, axis);
    const double most = host->config.supply_v;

    host->volts[axis] = volts > most ? most : volts > -most ? volts : -most;
    if (line->ops->set_voltage) {
        line->ops->set_voltage(host, axis);
    }
}

double host_voltage(const struct host *host, size_t axis)
{
    return host->volts[axis];
}

void host_set_reference(struct host *host, size_t axis, double rad, double rad_s)
{
    host->want[axis].rad = rad;
    host->want[axis].rad_s = rad_s;
    host->want[axis].referred = true;
}

double host_duty(const struct host *host, size_t axis)
{
    return host->volts[axis] / host->config.supply_v;
}

/* Makes the STEP frame: one tick, from step_tick. */
static struct bus_frame host_step_frame(const struct host *host)
{
    uint8_t data[LOCKSTEP_LENGTH];

    put_u32_le(data, host->step_tick);
    put_u16_le(data + 4, 1);
    return frame_make(host->config.step_id, LOCKSTEP_LENGTH, data);
}

void host_send(struct host *host)
{
    for (size_t b = 0; b < host->config.nbus; b++) {
        struct host_line *line = &host->line[b];

        if (line->ops->end_period) {
            line->ops->end_period(host, b);
        }
        if (line->queued) {
            can_send(host->config.port[b], line->queue, line->queued);
            line->frames_sent += line->queued;
            line->queued = 0;
        }
    }
    /* Send STEP last: earlier commands belong to its tick */
    if (host->config.lockstep) {
        struct bus_frame step;

        host->step_tick = host->tick;
        step = host_step_frame(host);
        can_send(host->config.port[host->config.lockstep_bus], &step, 1);
        host->step_waits = true;
        host->step_sent_ns = -1;
    }
}

void host_repeat_step(struct host *host, int64_t now_ns)
{
    if (!host->step_waits) {
        return;
    }
    if (host->step_sent_ns < 0) {
        host->step_sent_ns = now_ns;
    }
    if (now_ns - host->step_sent_ns >= STEP_REPEAT_NS) {
        struct bus_frame step = host_step_frame(host);

        can_send(host->config.port[host->config.lockstep_bus], &step, 1);
        host->step_sent_ns = now_ns;
    }
}

/* ---- access functions ---- */

const struct host_joint *host_joint(const struct host *host, size_t axis)
{
    return &host->joint[axis];
}

const struct host_force *host_force(const struct host *host, size_t ft)
{
    return &host->force[ft];
}

const struct host_motion *host_motion(const struct host *host)
{
    return &host->motion;
}

const struct host_config *host_configuration(const struct host *host)
{
    return &host->config;
}

int host_find_axis(const struct host *host, const char *joint)
{
    return TEXT_FIND(host->config.axis, host->config.naxis, joint, joint);
}
