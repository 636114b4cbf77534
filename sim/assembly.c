/* SPDX-License-Identifier: Apache-2.0 */
/* Creates the parts of a simulator from its configuration; each part uses earlier ones. */
#include "base/array.h"
#include "base/ring.h"
#include "canbus/replay_port.h"
#include "model/symbolic/symbolic.h"
#include "rig/client_table.h"
#include "sim/simulator_private.h"

#include <inttypes.h>
#include <limits.h>
#include <stdlib.h>

enum { TOLD_ROWS = 1000 }; /* rows of the client table in one answer of the gateway */

/* Checks that the rig fits the status, that rows fall on ticks, and that an energy account is
 * possible. */
static enum error_code simulator_check_config(const struct simulator_config *config,
                                              struct error *error)
{
    const struct rig *rig = config->rig;

    if (rig->robot->njoint > RIG_JOINTS_MAX || rig->contact.nbody > RIG_CONTACTS_MAX) {
        return error_set(
            error, ERROR_INPUT,
            "%s: found %zu joints and %zu bodies with contact, expected at most %d and %d",
            rig->file, rig->robot->njoint, rig->contact.nbody, RIG_JOINTS_MAX, RIG_CONTACTS_MAX);
    }
    if (config->record && config->row_period_ns % rig->tick_ns) {
        return error_set(error, ERROR_INPUT,
                         "%s: the period of recorded signals must be a multiple of the tick, %g ms",
                         rig->file, (double)rig->tick_ns * 1e-6);
    }
    for (size_t i = 0; config->energy && i < rig->boards.nboard; i++) {
        if (rig->boards.board[i].external) {
            return error_set(error, ERROR_UNSUPPORTED,
                             "%s: an account of energy cannot hold what the real motors of "
                             "external board %s put in",
                             rig->file, rig->boards.board[i].name);
        }
    }
    return config->task ? task_runner_check_name(config->task, error) : ERROR_NONE;
}

/* ---- buses ---- */

/* Opens the buses and joins them for the boards, the task and the gateway. */
static enum error_code simulator_create_buses(struct simulator *simulator, char notice[256],
                                              struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    size_t guests = config->guests + (config->task != NULL) + (config->gateway != NULL);
    bool apart = config->gateway || (config->guests && !config->guests_inline) ||
                 (config->task && config->clock == LOOP_CLOCK_REAL);
    enum error_code code =
        buses_open(config->rig, config->transport, config->interface, config->ninterface, guests,
                   apart, simulator->arena, &simulator->buses, notice, error);

    if (code) {
        return code;
    }
    if (!simulator->buses.local) {
        buses_claim(&simulator->buses, notice);
    }
    /* No other process can send a STEP on a local bus */
    if (simulator->buses.local && config->clock == LOOP_CLOCK_LOCKSTEP && !guests &&
        !config->stimulus) {
        return error_set(
            error, ERROR_UNSUPPORTED,
            "lockstep on local buses waits for STEP frames that nobody can send: give "
            "--task, --gateway or --stimulus, or use --transport socketcan on a kernel with CAN");
    }
    if (!simulator->buses.local) {
        interfaces_init(&simulator->interfaces, config->rig, simulator->buses.interface,
                        simulator->buses.state, &interface_kernel);
    }

    /* The boards join first, because participants are numbered in order of joining */
    code = buses_join_boards(&simulator->buses, simulator->arena, &simulator->ports, error);
    if (!code && config->task) {
        code = buses_join(&simulator->buses, simulator->arena, &simulator->task_ports, error);
    }
    if (!code && config->gateway) {
        code = buses_join(&simulator->buses, simulator->arena, &simulator->gateway_ports, error);
    }
    return code;
}

/* ---- a recorded controller ---- */

/* Reads the frames of a recorded controller. They are constant, so they are placed before the
 * memory that checkpoints save. The length of the log is the default length of the run. */
static enum error_code simulator_load_stimulus(struct simulator *simulator, struct error *error)
{
    struct simulator_config *config = &simulator->config;
    const int64_t tick_ns = config->rig->tick_ns;
    enum error_code code;

    if (!config->stimulus) {
        return ERROR_NONE;
    }
    if (config->task) {
        return error_set(error, ERROR_INPUT,
                         "found a task and a stimulus, expected one: both are the controller");
    }
    code = stimulus_load(config->stimulus, config->rig, simulator->buses.interface,
                         config->clock == LOOP_CLOCK_LOCKSTEP, simulator->arena,
                         &simulator->stimulus, error);
    if (!code && !config->ticks) {
        const struct stimulus *stimulus = &simulator->stimulus;
        const int64_t ticks = (stimulus->end_ns + tick_ns - 1) / tick_ns;
        /* The last frame is received in the first tick that begins at or after its time. A
         * recording of the simulator itself ends with its last tick. In lockstep, the STEP frames
         * count the ticks */
        const int64_t played = (stimulus->last_ns + tick_ns - 1) / tick_ns + 1;
        const bool own = stimulus->start_ns == 0 && stimulus->last_ns < stimulus->end_ns &&
                         stimulus->end_ns % tick_ns == 0;

        config->ticks = (uint64_t)(ticks > 0 ? ticks : 1);
        if (played > ticks && !own && config->clock != LOOP_CLOCK_LOCKSTEP) {
            config->ticks = (uint64_t)played;
        }
    }
    return code;
}

/* Wraps the ports in replay ports, outside the fault ports: the faults have already acted on the
 * recorded frames. */
static enum error_code simulator_play_stimulus(struct simulator *simulator, struct error *error)
{
    enum error_code code = ERROR_NONE;

    for (size_t b = 0; !code && simulator->config.stimulus && b < simulator->ports.count; b++) {
        const struct replay_port_config config = {
            .port = simulator->ports.port[b],
            .frame = simulator->stimulus.frame[b],
            .count = simulator->stimulus.count[b],
            .now_ns = &simulator->stimulus_ns,
        };

        code = replay_port_create(&config, simulator->arena, &simulator->ports.port[b], error);
    }
    return code;
}

/* ---- the robot ---- */

/* Returns the clock by which the plant measures the time spent in its contact engine, ns. */
static int64_t simulator_wall_time_ns(void *clock)
{
    return clock_now(clock);
}

/* Clamps the robot if the rig says so, sets its pose, creates the watch, and settles the robot. */
static enum error_code simulator_place_robot(struct simulator *simulator, struct error *error)
{
    const struct rig *rig = simulator->config.rig;
    const enum rig_hold hold = simulator->config.hold;
    enum error_code code;

    simulator->release = (struct release){.due = hold == RIG_HOLD_ENABLED, .at_ns = -1};
    atomic_store(&simulator->released, -1);
    atomic_store(&simulator->clamped_trip, -1);
    plant_clamp(simulator->plant, hold != RIG_HOLD_NONE);
    if (plant_reset(simulator->plant, rig->base_position, rig->base_quaternion, rig->joint)) {
        return error_set(error, ERROR_INPUT, "%s: the robot cannot be put into pose %s: %s",
                         rig->file, rig->pose, plant_failure(simulator->plant));
    }
    code = watch_create(rig, simulator->plant, simulator->arena, &simulator->watch, error);
    if (code) {
        return code;
    }
    if (simulator->config.settle &&
        plant_settle(simulator->plant, simulator->arena, &simulator->settled, error)) {
        return error_prefix(error, "%s: pose %s cannot settle", rig->file, rig->pose);
    }
    return ERROR_NONE;
}

/* Creates dynamics, contact engine and plant, and places the robot. */
static enum error_code simulator_create_plant(struct simulator *simulator, struct error *error)
{
    const struct rig *rig = simulator->config.rig;
    struct plant_config config = {
        .robot = rig->robot,
        .dynamics = &simulator->dynamics,
        .free = rig->free,
        .nfree = rig->nfree,
        .contact_body = rig->contact_body,
        .ncontact = rig->contact.nbody,
        .integrator = rig->integrator,
        .rtol = rig->tolerance,
        .atol = rig->tolerance,
        .substep_ns = rig->substep_ns,
        .supply_v = rig->supply_v,
        .bending = sensing_sees_bending(&rig->sensing),
        .account_energy = simulator->config.energy,
        .supply_ohm = rig->supply_ohm,
        .bus = rig->supply_bus,
        .now_ns = simulator_wall_time_ns,
        .clock = simulator->time,
    };
    enum error_code code =
        dynamics_choose(rig->robot, rig->dynamics == RIG_DYNAMICS_GENERIC, simulator->arena,
                        &simulator->dynamics, &simulator->dynamics_notice, error);

    if (!code && rig->contact_engine != RIG_CONTACT_NONE) {
        code =
            rig->contact_engine == RIG_CONTACT_NATIVE
                ? contact_native_create(&rig->contact, simulator->arena, &simulator->contact, error)
                : contact_simbody_create(&rig->contact, &simulator->contact, error);
        config.contact = simulator->contact;
    }
    if (code) {
        return code;
    }

    /* From here on the arena holds state that changes in virtual time */
    simulator->moves_from = simulator->arena->used;
    code = plant_create(&config, simulator->arena, &simulator->plant, error);
    return code ? code : simulator_place_robot(simulator, error);
}

/* ---- faults, sensors, boards ---- */

/* Creates the table of faults and their injection, which may insert fault ports before the boards'
 * ports. */
static enum error_code simulator_create_faults(struct simulator *simulator, struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    struct fault_injection_config injection = {.rig = config->rig,
                                               .command = plant_command(simulator->plant),
                                               .wire = simulator->buses.wire};
    uint64_t seed = config->seed_given ? config->seed : config->rig->seed;
    bool *wire = arena_alloc(simulator->arena, config->rig->nbus + 1, sizeof *wire);
    enum error_code code;

    if (!wire) {
        return error_set(error, ERROR_MEMORY, "no memory left for faults");
    }
    for (size_t b = 0; b < config->rig->nbus; b++) {
        wire[b] = simulator->buses.wire[b] != NULL;
    }
    code = rig_faults_create(config->rig, config->fault, config->nfault, seed, wire,
                             simulator->arena, &simulator->faults, error);
    if (code) {
        return code;
    }
    injection.faults = simulator->faults;
    code = fault_injection_create(&injection, simulator->arena, &simulator->ports,
                                  &simulator->injection, error);
    if (code) {
        return code;
    }

    /* Faults that begin at time 0 already affect the first sample */
    fault_injection_step(simulator->injection, 0);
    return ERROR_NONE;
}

/* Creates the sensors, and takes their first sample. */
static enum error_code simulator_create_sensing(struct simulator *simulator, struct error *error)
{
    struct sensing_config config = simulator->config.rig->sensing;
    enum error_code code;

    config.seed = faults_seed(simulator->faults);
    config.faults = simulator->faults;
    code = sensing_create(&config, simulator->arena, &simulator->sensing, error);
    if (code) {
        return code;
    }

    /* The boards need measured values before the first tick */
    simulator->measured = sensing_sample(simulator->sensing, plant_time_ns(simulator->plant),
                                         plant_sensors(simulator->plant));
    return ERROR_NONE;
}

/* Restarts a joint's incremental encoder; called when its board restarts. */
static void simulator_restart_counter(void *context, int joint)
{
    const struct simulator *simulator = context;

    sensing_restart_counter(simulator->sensing, (size_t)joint);
}

/* Creates the boards with their first measured values, their limits of frames per tick, and the
 * listener to external boards. */
static enum error_code simulator_create_boards(struct simulator *simulator, struct error *error)
{
    const struct rig *rig = simulator->config.rig;
    struct boards_config config = rig->boards;
    enum error_code code;

    config.faults = simulator->faults;
    config.restarted = simulator_restart_counter;
    config.context = simulator;
    code = boards_create(&config, simulator->arena, &simulator->boards, error);
    if (code) {
        return code;
    }
    boards_sample(simulator->boards, plant_time_ns(simulator->plant), simulator->measured);
    simulator->transmit_max =
        arena_alloc(simulator->arena, rig->nbus, sizeof *simulator->transmit_max);
    if (!simulator->transmit_max) {
        return error_set(error, ERROR_MEMORY, "no memory left for the buses");
    }
    for (size_t b = 0; b < rig->nbus; b++) {
        simulator->transmit_max[b] = boards_transmit_max(simulator->boards, b);
        simulator->listener[b] = (struct simulator_bus){simulator, b};
        if (simulator->buses.bus[b]) {
            local_bus_listen(simulator->buses.bus[b], simulator_hear, &simulator->listener[b]);
        }
    }

    /* The listener to external boards stays NULL if the rig has none */
    return external_create(rig, simulator->boards, simulator->plant, simulator->arena,
                           &simulator->external, error);
}

/* ---- the other side: task, requests, gateway ---- */

/* Creates the task: inline in the loop's thread, or with a clock for its own thread. */
static enum error_code simulator_create_task(struct simulator *simulator, struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    struct clock *time = simulator->time;
    enum error_code code;

    simulator->moves_to = simulator->arena->used;
    if (!config->task) {
        return ERROR_NONE;
    }

    /* With the real clock the task has a thread, whose clock follows the simulator's speed */
    simulator->task_inline = config->clock != LOOP_CLOCK_REAL;
    if (config->requests && !simulator->task_inline) {
        code = pace_create(simulator->time, simulator->arena, &simulator->pace, error);
        if (code) {
            return code;
        }
        time = pace_clock(simulator->pace);
    }
    code = task_runner_create(config->rig, config->task, config->task_input,
                              simulator->task_ports.port, config->clock == LOOP_CLOCK_LOCKSTEP,
                              time, simulator->arena, &simulator->task, error);

    /* An inline task is part of checkpoints */
    if (simulator->task_inline) {
        simulator->moves_to = simulator->arena->used;
    }
    return code ? code
                : task_set_all(simulator->task->task, config->setting, config->nsetting, error);
}

/* Makes the task's clock follow the simulator's speed and its pauses. */
static void simulator_set_task_pace(void *context, double speed, bool paused)
{
    const struct simulator *simulator = context;

    pace_set(simulator->pace, paused ? 0.0 : speed);
}

/* Creates the executor of requests, with the memory spans that a checkpoint saves. */
static enum error_code simulator_create_requests(struct simulator *simulator, struct error *error)
{
    struct task_runner *task = simulator->task_inline ? simulator->task : NULL;
    /* A checkpoint saves the part of the arena that changes in virtual time */
    const struct span moving[] = {
        {simulator->arena->memory + simulator->moves_from,
         simulator->moves_to - simulator->moves_from},
        {&simulator->release, sizeof simulator->release},
    };
    /* Holes: memory that other threads read or write meanwhile */
    const struct ring *events = watch_event_ring(simulator->watch);
    const struct span hole[] = {
        {(void *)(uintptr_t)events, sizeof *events},
        {events->slots, events->slot_size * ((size_t)events->mask + 1)},
        {task ? task->published : NULL, task ? sizeof *task->published : 0},
        {task ? task->published->word : NULL, task ? 8 * task->published->words : 0},
    };
    const struct robot_requests_config config = {
        .rig = simulator->config.rig,
        .plant = simulator->plant,
        .boards = simulator->boards,
        .sensing = simulator->sensing,
        .faults = simulator->faults,
        .injection = simulator->injection,
        .buses = &simulator->buses,
        .task = simulator->task ? simulator->task->task : NULL,
        .moving = moving,
        .nmoving = ARRAY_COUNT(moving),
        .hole = hole,
        .nhole = ARRAY_COUNT(hole),
        .own = 1 + simulator->task_inline,
        .one_way = simulator->task && !simulator->task_inline,
        .context = simulator,
        .publish = simulator_publish,
        .pace = simulator->pace ? simulator_set_task_pace : NULL,
    };

    return simulator->config.requests
               ? robot_requests_create(&config, simulator->arena, &simulator->robot_requests,
                                       &simulator->requests, error)
               : ERROR_NONE;
}

/* Returns what the gateway tells its clients: a part of the client table, by number, or the number
 * of commands that boards have dropped and the last reason. */
static const char *simulator_tell(void *context, const char *word, size_t *size)
{
    struct simulator *simulator = context;
    const char *text = simulator->client_table.text, *end;
    struct simulator_status now;
    unsigned long skip;
    char *rest;

    if (!strcmp(word, "dropped")) {
        const bool begun = simulator->published && simulator_read(simulator, &now);

        pthread_mutex_lock(&simulator->dropped.lock);
        /* The log may not have taken the event yet */
        if (begun && now.boards.malformed > 0 &&
            now.malformed.time_ns >= simulator->dropped.time_ns) {
            board_event_format(simulator->boards, &now.malformed, simulator->dropped.reason,
                               sizeof simulator->dropped.reason);
        }
        *size = (size_t)snprintf(
            simulator->dropped.told, sizeof simulator->dropped.told, "%" PRIu64 " %s",
            begun ? now.boards.unknown + now.boards.malformed : 0, simulator->dropped.reason);
        pthread_mutex_unlock(&simulator->dropped.lock);
        return simulator->dropped.told;
    }
    skip = strtoul(word, &rest, 10);
    if (!text || *rest || skip > INT_MAX) {
        return NULL;
    }
    for (skip *= TOLD_ROWS; skip > 0 && *text; skip--) {
        text += strcspn(text, "\n") + 1;
    }
    end = text;
    for (int row = 0; row < TOLD_ROWS && *end; row++) {
        end += strcspn(end, "\n") + 1;
    }
    *size = (size_t)(end - text);
    return text;
}

/* Writes the client table. A rig whose DBC files cannot be written has none. */
static enum error_code simulator_write_table(struct simulator *simulator, struct error *error)
{
    FILE *out = memory_file_open(&simulator->client_table);
    enum error_code code, closed;

    if (!out) {
        return error_set(error, ERROR_MEMORY, "no memory left for the client table");
    }
    code = rig_client_table(simulator->config.rig, out, error);
    closed = memory_file_close(out, &simulator->client_table, "the client table", error);
    /* Names of a protocol file may have the characters that end a row of the gateway */
    for (char *at = simulator->client_table.text; at && *at; at++) {
        *at = (char)(*at == '<' || *at == '>' ? '?' : *at);
    }
    if (code && code != ERROR_MEMORY && !closed) {
        free(simulator->client_table.text);
        simulator->client_table.text = NULL;
        code = ERROR_NONE;
    }
    return code ? code : closed;
}

/* Starts the gateway, which offers each bus of the rig by its name and by its interface's name. */
static enum error_code simulator_create_gateway(struct simulator *simulator, struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    struct gateway_bus bus[RIG_BUSES_MAX];
    struct gateway_config gateway;
    enum error_code code;

    if (!config->gateway) {
        return ERROR_NONE;
    }
    for (size_t b = 0; b < config->rig->nbus; b++) {
        bus[b] = (struct gateway_bus){
            .name = config->rig->bus[b].name,
            .alias = simulator->buses.interface[b],
            .port = simulator->gateway_ports.port[b],
            .bitrate = config->rig->bus[b].bitrate,
            .data_bitrate = config->rig->bus[b].fd ? config->rig->bus[b].data_bitrate : 0};
    }
    code = simulator_write_table(simulator, error);
    if (code) {
        return code;
    }
    gateway = *config->gateway;
    gateway.tell = simulator_tell;
    gateway.context = simulator;
    gateway.nbus = config->rig->nbus;
    gateway.bus = bus;
    gateway.lockstep = (struct gateway_lockstep){
        .on = config->clock == LOOP_CLOCK_LOCKSTEP,
        .bus = (size_t)config->rig->lockstep.bus,
        .step_id = config->rig->lockstep.step_id,
        .done_id = config->rig->lockstep.done_id,
    };
    return gateway_start(&gateway, simulator->arena, &simulator->gateway, error);
}

/* ---- the loop ---- */

/* Creates the published status and the loop. */
static enum error_code simulator_create_loop(struct simulator *simulator, struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    const struct loop_config loop = {
        .clock = config->clock,
        .tick_ns = config->rig->tick_ns,
        .overrun = config->overrun,
        .lockstep = config->rig->lockstep,
        .ticks = config->ticks,
        .nbus = config->rig->nbus,
        .port = simulator->ports.port,
        .transmit_max = simulator->transmit_max,
        .time = simulator->time,
        .machine = simulator_machine(simulator),
        .recorder = simulator->recorder,
        .recording = simulator->buses.timed ? LOOP_RECORD_UNCARRIED : LOOP_RECORD_ALL,
        .requests = simulator->requests,
    };
    enum error_code code = snapshot_create(sizeof(struct simulator_status), simulator->arena,
                                           &simulator->published, error);

    if (code) {
        return code;
    }
    simulator_leave_out_unused(simulator);
    return loop_create(&loop, simulator->arena, &simulator->loop, error);
}

/* ---- the whole simulator ---- */

enum error_code simulator_assemble(struct simulator *simulator, char notice[256],
                                   struct error *error)
{
    static enum error_code (*const parts[])(struct simulator * simulator, struct error * error) = {
        simulator_create_plant,
        simulator_create_faults,
        simulator_create_sensing,
        simulator_create_boards,
        simulator_play_stimulus,
        simulator_create_task,
        simulator_create_requests,
        simulator_create_signals,
        simulator_create_view,
        /* Create the recorder late: it would leave files behind if a later part failed */
        simulator_create_recorder,
        simulator_create_loop,
        simulator_create_gateway,
    };
    enum error_code code = simulator_check_config(&simulator->config, error);

    code = code ? code : simulator_create_buses(simulator, notice, error);
    code = code ? code : simulator_load_stimulus(simulator, error);
    for (size_t i = 0; !code && i < ARRAY_COUNT(parts); i++) {
        code = parts[i](simulator, error);
    }
    return code;
}
