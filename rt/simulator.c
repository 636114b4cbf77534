/* SPDX-License-Identifier: Apache-2.0 */
/* Joins the parts of a rig behind the loop. */
#include "rt/simulator.h"

#include "canbus/wire.h"
#include "model/symbolic/builtin.h"
#include "rt/cache.h"
#include "rt/injection.h"
#include "rt/interfaces.h"
#include "rt/pace.h"
#include "rt/rig_faults.h"
#include "rt/steered.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    SIGNALS_PER_JOINT = 5,
    SIGNALS_PER_CONTACT = 6,
    SIGNALS_PER_PAIR = 6,
    SIGNALS_BASE = 7,
    SIGNALS_PER_FREE = 7,
    SIGNALS_PER_BUS = 2
};
enum { TITLE_SIZE = 192 };
enum { STREAM_ROWS = 1024 }; /* a second at 1 kHz */

/* A settled robot's rotors are held by brakes, which let go so long after the last motor is on: time
 * for a controller's first voltages to raise the currents. */
#define BRAKE_NS INT64_C(20000000)

/* The contact engine with a stopwatch, for its share of the plant's time is wanted, and a memory of
 * one evaluation: the sensors at the end of a tick and the first stage of the next ask for the same
 * motion, and what the engine answers depends on nothing else. */
struct timed_contact {
    struct contact_world world;
    struct contact_ops ops; /* without what the engine cannot do */
    struct contact_world *engine;
    struct clock *time;
    size_t nbody;
    struct contact_motion *motion; /* of the last evaluation */
    struct contact_wrench *wrench;
    bool remembered;
    uint64_t evaluations;
    int64_t spent_ns;
};

/* Where the recording of a wire goes. */
struct bus_tap {
    struct recorder *recorder;
    size_t bus;
};

/* When the links of a held robot are let go. */
struct release {
    bool due;      /* when every motor is on */
    int64_t at_ns; /* virtual time; -1 = not yet or done */
};

struct simulator {
    struct simulator_config config;
    struct arena *arena;
    struct clock *time;
    struct dynamics dynamics;
    struct symbolic_library library; /* of a module that is not built in */
    struct error dynamics_notice;    /* which implementation, and why */
    struct timed_contact contact;
    struct plant *plant;
    struct settled settled;
    struct faults *faults;
    struct injection *injection;
    struct sensing *sensing;
    const struct plant_sensors *measured; /* what the boards see; the plant's are true */
    struct boards *boards;
    struct buses buses;
    struct interfaces interfaces; /* the real ones; none with local buses */
    struct bus_ports ports, task_ports, gateway_ports;
    struct gateway *gateway;
    size_t *transmit_max;
    struct loop *loop;
    struct recorder *recorder;
    const char **title; /* of the signals: those of signals.csv, then those of the buses */
    double *row;
    struct contact_patch *patch; /* of the pairs, for a row */
    size_t nrecorded, nsignal, npatch;
    struct stream *stream;
    uint64_t row_ticks;
    struct controller *controller;
    bool task_inline, task_running;
    pthread_t task_thread;
    struct realtime_config task_realtime;
    struct simulator_status status;
    struct snapshot *published; /* struct simulator_status */
    struct release release;
    _Atomic int64_t released; /* virtual time at which they were let go; -1 = told or not yet */
    char failure[256];
    struct steering *steering; /* NULL = none */
    struct steered *steered;
    struct pace *pace;           /* of a task in its own thread that is steered; NULL = none */
    size_t moves_from, moves_to; /* of the arena: what moves in virtual time */
};

/* ---- the stopwatch on the contact engine ---- */

static enum error_code timed_evaluate(struct contact_world *world,
                                      const struct contact_motion *motion,
                                      struct contact_wrench *wrench)
{
    struct timed_contact *timed = (struct timed_contact *)world;
    int64_t begin = clock_now(timed->time);
    enum error_code code;

    if (timed->remembered && memcmp(motion, timed->motion, timed->nbody * sizeof *motion) == 0) {
        memcpy(wrench, timed->wrench, timed->nbody * sizeof *wrench);
        return ERROR_NONE;
    }
    code = timed->engine->ops->evaluate(timed->engine, motion, wrench);
    timed->remembered = !code;
    memcpy(timed->motion, motion, timed->nbody * sizeof *motion);
    memcpy(timed->wrench, wrench, timed->nbody * sizeof *wrench);
    timed->spent_ns += clock_now(timed->time) - begin;
    timed->evaluations++;
    return code;
}

static size_t timed_patches(struct contact_world *world, struct contact_patch *patch, size_t max)
{
    struct timed_contact *timed = (struct timed_contact *)world;

    return timed->engine->ops->patches(timed->engine, patch, max);
}

static size_t timed_tangents(struct contact_world *world, struct contact_tangent *tangent,
                             size_t max)
{
    struct timed_contact *timed = (struct timed_contact *)world;
    int64_t begin = clock_now(timed->time);
    size_t count = timed->engine->ops->tangents(timed->engine, tangent, max);

    timed->spent_ns += clock_now(timed->time) - begin;
    return count;
}

static const char *timed_failure(const struct contact_world *world)
{
    const struct timed_contact *timed = (const struct timed_contact *)world;

    return timed->engine->ops->failure(timed->engine);
}

static void timed_destroy(struct contact_world *world)
{
    struct timed_contact *timed = (struct timed_contact *)world;

    if (timed->engine) {
        timed->engine->ops->destroy(timed->engine);
        timed->engine = NULL;
    }
}

static const struct contact_ops timed_ops = {
    .name = "timed",
    .evaluate = timed_evaluate,
    .patches = timed_patches,
    .tangents = timed_tangents,
    .failure = timed_failure,
    .destroy = timed_destroy,
};

/* ---- what the loop calls ---- */

static void machine_advance(void *context, int64_t time_ns)
{
    const struct simulator *simulator = context;

    buses_advance(&simulator->buses, time_ns);
}

/* What a wire in virtual time has carried, with its time. */
static void record_carried(void *context, const struct bus_frame *frame)
{
    const struct bus_tap *tap = context;

    recorder_frame(tap->recorder, tap->bus, frame, frame->time_ns);
}

static bool machine_controller(void *context, int64_t time_ns)
{
    struct simulator *simulator = context;
    const struct simulator_observer *observer = simulator->config.observer;
    bool goes_on = observer && simulator->config.clock == RIG_CLOCK_FREE;

    if (observer) {
        observer->step(observer->context, time_ns);
    }
    if (simulator->task_inline && simulator->controller->now.status == TASK_RUNNING) {
        controller_step(simulator->controller, time_ns);
    }
    return goes_on || !simulator->task_inline || simulator->controller->now.status == TASK_RUNNING;
}

static void machine_receive(void *context, size_t bus, const struct bus_frame *frame)
{
    struct simulator *simulator = context;

    boards_receive(simulator->boards, bus, frame);
}

static bool all_motors_on(const struct simulator *simulator)
{
    const struct rig *rig = simulator->config.rig;
    const struct plant_command *command = plant_command(simulator->plant);

    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];

        for (int k = 0; k < BOARD_AXES_MAX && board->kind == BOARD_MOTOR; k++) {
            int joint = board->axis[k].joint;

            if (joint >= 0 && !command->motor[joint].bridge_on) {
                return false;
            }
        }
    }
    return true;
}

static void machine_control(void *context)
{
    struct simulator *simulator = context;

    boards_control(simulator->boards, simulator->measured, plant_command(simulator->plant));
    if (simulator->release.due && all_motors_on(simulator)) {
        simulator->release.due = false;
        simulator->release.at_ns =
            plant_time_ns(simulator->plant) + (simulator->config.settle ? BRAKE_NS : 0);
    }
    if (simulator->release.at_ns >= 0 &&
        plant_time_ns(simulator->plant) >= simulator->release.at_ns) {
        plant_clamp(simulator->plant, false);
        simulator->release.at_ns = -1;
        atomic_store(&simulator->released, plant_time_ns(simulator->plant));
    }
}

static bool sane(struct simulator *simulator, enum error_code code)
{
    if (code) {
        snprintf(simulator->failure, sizeof simulator->failure, "%s",
                 plant_failure(simulator->plant));
    }
    return !code;
}

static bool machine_plant(void *context)
{
    struct simulator *simulator = context;

    return sane(simulator, plant_step(simulator->plant, simulator->config.rig->substeps));
}

static bool machine_sample(void *context)
{
    struct simulator *simulator = context;

    if (!sane(simulator, plant_sample(simulator->plant))) {
        return false;
    }
    simulator->measured = sensing_sample(simulator->sensing, plant_sensors(simulator->plant));
    return true;
}

/* On a wire every board has a controller of its own, in the order of the rig, with error counters
 * that the board tells. */
static void tell_controllers(struct simulator *simulator, size_t bus)
{
    const struct boards_config *boards = &simulator->config.rig->boards;
    const struct wire *wire = simulator->buses.wire[bus];
    size_t node = 0;

    for (size_t i = 0; wire && i < boards->nboard; i++) {
        struct wire_node_stats stats;

        if (boards->board[i].bus == (int)bus) {
            wire_node_stats(wire, node++, &stats);
            boards_set_can_state(simulator->boards, i,
                                 &(struct board_can_state){.tec = stats.tec,
                                                           .rec = stats.rec,
                                                           .bus_off = stats.state == WIRE_BUS_OFF});
        }
    }
}

static size_t machine_transmit(void *context, size_t bus, struct bus_frame *frames, size_t max)
{
    struct simulator *simulator = context;

    tell_controllers(simulator, bus);
    return boards_transmit(simulator->boards, bus, simulator->measured, frames, max);
}

static bool machine_fault(void *context)
{
    const struct simulator *simulator = context;

    return boards_fault(simulator->boards);
}

static void machine_shut_down(void *context)
{
    struct simulator *simulator = context;

    boards_shut_down(simulator->boards, plant_command(simulator->plant));
}

static void fill_buses(struct simulator *simulator)
{
    const struct rig *rig = simulator->config.rig;

    for (size_t b = 0; b < rig->nbus; b++) {
        const struct can_port *port = simulator->ports.port[b];
        const struct can_counters *counters = &port->counters;

        simulator->status.bus[b] = (struct bus_status){
            .rx_frames = counters->rx_frames,
            .tx_frames = counters->tx_frames,
            .rx_dropped = counters->rx_dropped,
            .tx_dropped = counters->tx_dropped,
            .bits = (uint64_t)rig_bus_bits(&rig->bus[b], counters),
            .state = port->state,
        };
    }
}

static void fill_plant(struct simulator *simulator)
{
    const struct rig *rig = simulator->config.rig;
    const struct plant_sensors *sensors = plant_sensors(simulator->plant);
    const struct contact_wrench *wrench = plant_contact_wrenches(simulator->plant);
    size_t count;

    if (rig->robot->floating) {
        memcpy(simulator->status.base, plant_state(simulator->plant, &count),
               sizeof simulator->status.base);
    }
    for (size_t j = 0; j < rig->robot->njoint; j++) {
        simulator->status.q[j] = sensors->motor[j].q;
    }
    simulator->status.clamped = plant_is_clamped(simulator->plant);
    for (size_t c = 0; c < rig->contact.nbody; c++) {
        simulator->status.force_z[c] = wrench[c].force[2];
    }
    for (size_t i = 0; i < rig->nfree && i < SIMULATOR_FREE_MAX; i++) {
        plant_free_pose(simulator->plant, i, simulator->status.free[i]);
    }
}

/* what each pair of surfaces does to its second one; the moment is about the middle of the patch */
static void record_pairs(const struct simulator *simulator, double *to)
{
    size_t npair = simulator->config.rig->contact.npair, count;

    memset(to, 0, npair * SIGNALS_PER_PAIR * sizeof *to);
    count = npair ? plant_patches(simulator->plant, simulator->patch, simulator->npatch) : 0;
    for (size_t i = 0; i < count && i < simulator->npatch; i++) {
        const struct contact_patch *patch = &simulator->patch[i];
        double *row = to + (size_t)patch->pair * SIGNALS_PER_PAIR;

        for (int k = 0; k < 3; k++) {
            row[k] += patch->force[k];
            row[3 + k] += patch->moment[k];
        }
    }
}

/* the columns in the order of make_titles; returns where the next would go */
static double *fill_row(const struct simulator *simulator, double *to)
{
    const struct rig *rig = simulator->config.rig;
    const struct plant_sensors *sensors = plant_sensors(simulator->plant);
    const struct contact_wrench *wrench = plant_contact_wrenches(simulator->plant);

    for (size_t j = 0; j < rig->robot->njoint; j++) {
        const struct motor_sense *motor = &sensors->motor[j];

        *to++ = motor->q;
        *to++ = motor->qm;
        *to++ = motor->torque_nm;
        *to++ = motor->current_a;
        *to++ = motor->voltage_v;
    }
    for (size_t c = 0; c < rig->contact.nbody; c++) {
        memcpy(to, wrench[c].force, sizeof wrench[c].force);
        memcpy(to + 3, wrench[c].moment, sizeof wrench[c].moment);
        to += SIGNALS_PER_CONTACT;
    }
    record_pairs(simulator, to);
    to += rig->contact.npair * SIGNALS_PER_PAIR;
    if (rig->robot->floating) {
        memcpy(to, simulator->status.base, sizeof simulator->status.base);
        to += SIGNALS_BASE;
    }
    for (size_t i = 0; i < rig->nfree; i++) {
        plant_free_pose(simulator->plant, i, to);
        to += SIGNALS_PER_FREE;
    }
    return to;
}

/* for subscribers, when a row is due */
static void stream_row(struct simulator *simulator)
{
    const struct simulator_status *status = &simulator->status;
    double *to = stream_begin(simulator->stream, status->tick, status->time_ns);

    if (!to) {
        return;
    }
    to = fill_row(simulator, to);
    for (size_t b = 0; b < simulator->config.rig->nbus; b++) {
        *to++ = (double)status->bus[b].rx_frames;
        *to++ = (double)status->bus[b].tx_frames;
    }
    stream_commit(simulator->stream);
}

static void fill_counters(struct simulator *simulator, const struct loop_stats *stats)
{
    struct simulator_status *status = &simulator->status;

    status->tick = stats->ticks;
    status->time_ns = stats->time_ns;
    status->elapsed_ns = clock_now(simulator->time) - stats->start_ns;
    status->overruns = stats->overrun_total;
    memcpy(status->overruns_by, stats->overruns, sizeof status->overruns_by);
    status->late_ticks = stats->late_ticks;
    status->lost_ticks = stats->lost_ticks;
    status->pauses = stats->pauses;
    status->pause_ticks = stats->pause_ticks;
    status->events_lost = stats->events_lost;
    status->lockstep = stats->lockstep;
}

static void fill_faults(struct simulator *simulator)
{
    uint64_t *word = simulator->status.fault;

    memset(word, 0, sizeof simulator->status.fault);
    for (size_t i = 0; i < faults_count(simulator->faults); i++) {
        word[i / 64] |= (uint64_t)faults_at(simulator->faults, i)->active << i % 64;
    }
}

static void publish_status(void *context, const struct loop_stats *stats)
{
    struct simulator *simulator = context;

    fill_counters(simulator, stats);
    fill_faults(simulator);
    fill_buses(simulator);
    fill_plant(simulator);
    snapshot_write(simulator->published, &simulator->status);
}

static void machine_publish(void *context, const struct loop_stats *stats)
{
    struct simulator *simulator = context;

    publish_status(simulator, stats);
    if (simulator->recorder && stats->ticks % simulator->row_ticks == 0) {
        fill_row(simulator, simulator->row);
        recorder_row(simulator->recorder, simulator->status.time_ns, simulator->row);
    }
    stream_row(simulator);
    injection_step(simulator->injection, stats->time_ns);
}

/* ---- assembly ---- */

static enum error_code check_configuration(const struct simulator_config *config,
                                           struct error *error)
{
    const struct rig *rig = config->rig;

    if (rig->robot->njoint > SIMULATOR_JOINTS_MAX || rig->contact.nbody > SIMULATOR_CONTACTS_MAX) {
        return error_set(error, ERROR_INPUT,
                         "%s: found %zu joints and %zu bodies with contact, expected at most %d "
                         "and %d",
                         rig->file, rig->robot->njoint, rig->contact.nbody, SIMULATOR_JOINTS_MAX,
                         SIMULATOR_CONTACTS_MAX);
    }
    if (config->record && config->row_period_ns % rig->tick_ns) {
        return error_set(error, ERROR_INPUT,
                         "%s: the period of recorded signals must be a multiple of the tick, %g ms",
                         rig->file, (double)rig->tick_ns * 1e-6);
    }
    return config->task ? controller_check_name(config->task, error) : ERROR_NONE;
}

static enum error_code create_contact(struct simulator *simulator, struct error *error)
{
    const struct contact_config *config = &simulator->config.rig->contact;
    struct timed_contact *timed = &simulator->contact;
    enum error_code code;

    timed->ops = timed_ops;
    timed->world.ops = &timed->ops;
    timed->time = simulator->time;
    timed->nbody = config->nbody;
    timed->motion = arena_alloc(simulator->arena, config->nbody, sizeof *timed->motion);
    timed->wrench = arena_alloc(simulator->arena, config->nbody, sizeof *timed->wrench);
    if (!timed->motion || !timed->wrench) {
        return error_set(error, ERROR_MEMORY, "no memory left for the contact engine");
    }
    code = simulator->config.rig->contact_engine == RIG_CONTACT_NATIVE
               ? contact_native_create(config, simulator->arena, &timed->engine, error)
               : contact_simbody_create(config, &timed->engine, error);
    if (!code && !timed->engine->ops->tangents) {
        timed->ops.tangents = NULL;
    }
    return code;
}

static enum error_code create_dynamics(struct simulator *simulator, struct error *error)
{
    const struct rig *rig = simulator->config.rig;
    char folder[4096];

    if (rig->dynamics == RIG_DYNAMICS_GENERIC) {
        error_set(&simulator->dynamics_notice, ERROR_NONE, "numeric dynamics, as the rig says");
        return dynamics_generic(rig->robot, simulator->arena, &simulator->dynamics, error);
    }
    return dynamics_fastest(rig->robot, cache_folder(folder, sizeof folder) ? folder : NULL,
                            simulator->arena, &simulator->dynamics, &simulator->library,
                            &simulator->dynamics_notice, error);
}

static enum error_code create_plant(struct simulator *simulator, struct error *error)
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
        .account_energy = simulator->config.energy,
        .supply_ohm = rig->supply_ohm,
    };
    enum error_code code = create_dynamics(simulator, error);

    if (!code && rig->contact_engine != RIG_CONTACT_NONE) {
        code = create_contact(simulator, error);
        config.contact = &simulator->contact.world;
    }
    simulator->moves_from = simulator->arena->used;
    if (!code) {
        code = plant_create(&config, simulator->arena, &simulator->plant, error);
    }
    if (!code) {
        simulator->release =
            (struct release){.due = simulator->config.hold == RIG_HOLD_ENABLED, .at_ns = -1};
        atomic_store(&simulator->released, -1);
        plant_clamp(simulator->plant, simulator->config.hold != RIG_HOLD_NONE);
    }
    if (!code &&
        plant_reset(simulator->plant, rig->base_position, rig->base_quaternion, rig->joint)) {
        code = error_set(error, ERROR_INPUT, "%s: the robot cannot be put into pose %s: %s",
                         rig->file, rig->pose, plant_failure(simulator->plant));
    }
    if (!code && simulator->config.settle &&
        plant_settle(simulator->plant, simulator->arena, &simulator->settled, error)) {
        code = error_prefix(error, "%s: pose %s cannot settle", rig->file, rig->pose);
    }
    return code;
}

static enum error_code create_buses(struct simulator *simulator, char notice[256],
                                    struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    size_t guests = config->guests + (config->task != NULL) + (config->gateway != NULL);
    enum error_code code =
        buses_open(config->rig, config->transport, config->interface, config->ninterface, guests,
                   simulator->arena, &simulator->buses, notice, error);

    if (!code && simulator->buses.local && config->clock == RIG_CLOCK_LOCKSTEP && !guests) {
        code = error_set(error, ERROR_UNSUPPORTED,
                         "lockstep on local buses waits for STEP frames that nobody can send: give "
                         "--task or --gateway, or use --transport socketcan on a kernel with CAN");
    }
    if (!code && !simulator->buses.local) {
        interfaces_init(&simulator->interfaces, config->rig, simulator->buses.interface,
                        simulator->buses.state, &interface_kernel);
    }
    if (!code) {
        code = buses_join_boards(&simulator->buses, simulator->arena, &simulator->ports, error);
    }
    if (!code && config->task) {
        code = buses_join(&simulator->buses, simulator->arena, &simulator->task_ports, error);
    }
    if (!code && config->gateway) {
        code = buses_join(&simulator->buses, simulator->arena, &simulator->gateway_ports, error);
    }
    return code;
}

/* The table of faults and what carries them out: the ports of the boards may be replaced. */
static enum error_code create_faults(struct simulator *simulator, struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    struct injection_config injection = {.rig = config->rig,
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
    code = injection_create(&injection, simulator->arena, &simulator->ports, &simulator->injection,
                            error);
    if (!code) {
        injection_step(simulator->injection, 0);
    }
    return code;
}

static enum error_code create_sensing(struct simulator *simulator, struct error *error)
{
    struct sensing_config config = simulator->config.rig->sensing;
    enum error_code code;

    config.seed = faults_seed(simulator->faults);
    config.faults = simulator->faults;
    code = sensing_create(&config, simulator->arena, &simulator->sensing, error);
    if (!code) {
        simulator->measured = sensing_sample(simulator->sensing, plant_sensors(simulator->plant));
    }
    return code;
}

static void board_restarted(void *context, int joint)
{
    const struct simulator *simulator = context;

    sensing_restart_counter(simulator->sensing, (size_t)joint);
}

static enum error_code create_boards(struct simulator *simulator, struct error *error)
{
    const struct rig *rig = simulator->config.rig;
    struct boards_config config = rig->boards;
    enum error_code code;

    config.faults = simulator->faults;
    config.restarted = board_restarted;
    config.context = simulator;
    code = boards_create(&config, simulator->arena, &simulator->boards, error);

    if (code) {
        return code;
    }
    simulator->transmit_max =
        arena_alloc(simulator->arena, rig->nbus, sizeof *simulator->transmit_max);
    if (!simulator->transmit_max) {
        return error_set(error, ERROR_MEMORY, "no memory left for the buses");
    }
    for (size_t b = 0; b < rig->nbus; b++) {
        simulator->transmit_max[b] = boards_transmit_max(simulator->boards, b);
    }
    return ERROR_NONE;
}

static enum error_code create_task(struct simulator *simulator, struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    struct clock *time = simulator->time;
    enum error_code code;

    simulator->moves_to = simulator->arena->used;
    if (!config->task) {
        return ERROR_NONE;
    }
    simulator->task_inline = config->clock != RIG_CLOCK_REAL;
    if (config->steered && !simulator->task_inline) {
        code = pace_create(simulator->time, simulator->arena, &simulator->pace, error);
        if (code) {
            return code;
        }
        time = pace_clock(simulator->pace);
    }
    code = controller_create(config->rig, config->task, simulator->task_ports.port,
                             config->clock == RIG_CLOCK_LOCKSTEP, time, simulator->arena,
                             &simulator->controller, error);
    if (simulator->task_inline) {
        simulator->moves_to = simulator->arena->used;
    }
    return code;
}

/* What depends on the past and is no part of the copy. */
static void went_back(void *context)
{
    struct simulator *simulator = context;

    simulator->contact.remembered = false;
}

static void follow_pace(void *context, double speed, bool paused)
{
    const struct simulator *simulator = context;

    pace_set(simulator->pace, paused ? 0.0 : speed);
}

static enum error_code create_steering(struct simulator *simulator, struct error *error)
{
    struct controller *task = simulator->task_inline ? simulator->controller : NULL;
    const struct span moving[] = {
        {simulator->arena->memory + simulator->moves_from,
         simulator->moves_to - simulator->moves_from},
        {&simulator->release, sizeof simulator->release},
    };
    const struct span hole[] = {
        {task ? task->published : NULL, task ? sizeof *task->published : 0},
        {task ? task->published->word : NULL, task ? 8 * task->published->words : 0},
    };
    struct steered_config steered = {
        .rig = simulator->config.rig,
        .plant = simulator->plant,
        .boards = simulator->boards,
        .sensing = simulator->sensing,
        .faults = simulator->faults,
        .injection = simulator->injection,
        .buses = &simulator->buses,
        .moving = moving,
        .nmoving = sizeof moving / sizeof moving[0],
        .hole = hole,
        .nhole = sizeof hole / sizeof hole[0],
        .own = 1 + simulator->task_inline,
        .one_way = simulator->controller && !simulator->task_inline,
        .context = simulator,
        .went_back = went_back,
        .show = publish_status,
        .pace = simulator->pace ? follow_pace : NULL,
    };

    return simulator->config.steered
               ? steered_create(&steered, simulator->arena, &simulator->steered,
                                &simulator->steering, error)
               : ERROR_NONE;
}

/* appends a formatted title */
static bool add_title(struct arena *arena, const char **titles, size_t *count, const char *format,
                      const char *name)
{
    char text[TITLE_SIZE];
    int size = snprintf(text, sizeof text, "%s", format);
    const char *hole = strchr(format, '*');

    if (hole) {
        size =
            snprintf(text, sizeof text, "%.*s%s%s", (int)(hole - format), format, name, hole + 1);
    }
    titles[*count] = size < TITLE_SIZE ? arena_strdup(arena, text) : NULL;
    return titles[(*count)++] != NULL;
}

/* titles of the columns of signals.csv and of what only the stream has; false when memory is short or
 * a name too long */
static bool make_titles(struct simulator *simulator)
{
    static const char *const joint[SIGNALS_PER_JOINT] = {"q_*_rad", "qm_*_rad", "torque_*_nm",
                                                         "current_*_a", "voltage_*_v"};
    static const char *const contact[SIGNALS_PER_CONTACT] = {"fx_*_n",  "fy_*_n",  "fz_*_n",
                                                             "mx_*_nm", "my_*_nm", "mz_*_nm"};
    static const char *const pair[SIGNALS_PER_PAIR] = {"fx_*_n",  "fy_*_n",  "fz_*_n",
                                                       "mx_*_nm", "my_*_nm", "mz_*_nm"};
    static const char *const base[SIGNALS_BASE] = {"base_x_m", "base_y_m", "base_z_m", "base_qw",
                                                   "base_qx",  "base_qy",  "base_qz"};
    static const char *const free_body[SIGNALS_PER_FREE] = {"*_x_m", "*_y_m", "*_z_m", "*_qw",
                                                            "*_qx",  "*_qy",  "*_qz"};
    static const char *const bus[SIGNALS_PER_BUS] = {"rx_*_frames", "tx_*_frames"};
    const struct rig *rig = simulator->config.rig;
    size_t count = rig->robot->njoint * SIGNALS_PER_JOINT +
                   rig->contact.nbody * SIGNALS_PER_CONTACT +
                   rig->contact.npair * SIGNALS_PER_PAIR +
                   (rig->robot->floating ? SIGNALS_BASE : 0) + rig->nfree * SIGNALS_PER_FREE +
                   rig->nbus * SIGNALS_PER_BUS;
    const char **titles = arena_alloc(simulator->arena, count + 1, sizeof *titles);
    bool good = titles != NULL;
    size_t n = 0;

    for (size_t i = 0; good && i < rig->robot->njoint * SIGNALS_PER_JOINT; i++) {
        good = add_title(simulator->arena, titles, &n, joint[i % SIGNALS_PER_JOINT],
                         rig->robot->joint[i / SIGNALS_PER_JOINT].name);
    }
    for (size_t i = 0; good && i < rig->contact.nbody * SIGNALS_PER_CONTACT; i++) {
        good = add_title(simulator->arena, titles, &n, contact[i % SIGNALS_PER_CONTACT],
                         rig_contact_name(rig, i / SIGNALS_PER_CONTACT));
    }
    for (size_t i = 0; good && i < rig->contact.npair * SIGNALS_PER_PAIR; i++) {
        const struct contact_pair *of = &rig->contact.pair[i / SIGNALS_PER_PAIR];
        char name[TITLE_SIZE];

        snprintf(name, sizeof name, "%.63s_on_%.63s", rig->contact.surface[of->a].name,
                 rig->contact.surface[of->b].name);
        good = add_title(simulator->arena, titles, &n, pair[i % SIGNALS_PER_PAIR], name);
    }
    for (size_t i = 0; good && rig->robot->floating && i < SIGNALS_BASE; i++) {
        good = add_title(simulator->arena, titles, &n, base[i], "");
    }
    for (size_t i = 0; good && i < rig->nfree * SIGNALS_PER_FREE; i++) {
        good = add_title(simulator->arena, titles, &n, free_body[i % SIGNALS_PER_FREE],
                         rig->free[i / SIGNALS_PER_FREE].name);
    }
    simulator->nrecorded = n;
    for (size_t i = 0; good && i < rig->nbus * SIGNALS_PER_BUS; i++) {
        good = add_title(simulator->arena, titles, &n, bus[i % SIGNALS_PER_BUS],
                         rig->bus[i / SIGNALS_PER_BUS].name);
    }
    simulator->nsignal = n;
    simulator->title = titles;
    return good;
}

static enum error_code create_signals(struct simulator *simulator, struct error *error)
{
    /* an engine may cut a pair's patch in parts */
    simulator->npatch = 2 * simulator->config.rig->contact.npair;
    simulator->patch =
        arena_alloc(simulator->arena, simulator->npatch + 1, sizeof *simulator->patch);
    if (!simulator->patch || !make_titles(simulator)) {
        return error_set(error, ERROR_MEMORY, "no memory left for the signals");
    }
    return stream_create(simulator->nsignal, STREAM_ROWS, simulator->arena, &simulator->stream,
                         error);
}

/* Timed buses record what they have carried themselves. */
static enum error_code tap_wires(struct simulator *simulator, struct error *error)
{
    const size_t nbus = simulator->config.rig->nbus;
    struct bus_tap *tap = arena_alloc(simulator->arena, nbus, sizeof *tap);

    if (!tap) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder's buses");
    }
    for (size_t b = 0; b < nbus && simulator->buses.timed; b++) {
        tap[b] = (struct bus_tap){simulator->recorder, b};
        buses_tap(&simulator->buses, b, record_carried, &tap[b]);
    }
    return ERROR_NONE;
}

static enum error_code create_recorder(struct simulator *simulator, struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    struct recorder_config recorder = {
        .directory = config->record,
        .overwrite = config->overwrite,
        .lossless = config->clock != RIG_CLOCK_REAL,
        .nbus = config->rig->nbus,
        .bus = simulator->buses.interface,
    };
    enum error_code code;

    if (!config->record) {
        return ERROR_NONE;
    }
    recorder.signal = simulator->title;
    recorder.nsignal = simulator->nrecorded;
    simulator->row = arena_alloc(simulator->arena, simulator->nrecorded + 1, sizeof(double));
    simulator->row_ticks = (uint64_t)(config->row_period_ns / config->rig->tick_ns);
    if (!simulator->row) {
        return error_set(error, ERROR_MEMORY, "no memory left for the recorder's signals");
    }
    code = recorder_open(&recorder, simulator->arena, &simulator->recorder, error);
    return code ? code : tap_wires(simulator, error);
}

static enum error_code create_loop(struct simulator *simulator, struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    struct loop_config loop = {
        .clock = config->clock,
        .tick_ns = config->rig->tick_ns,
        .overrun = config->overrun,
        .stop_after = config->stop_after,
        .lockstep = config->rig->lockstep,
        .ticks = config->ticks,
        .nbus = config->rig->nbus,
        .port = simulator->ports.port,
        .transmit_max = simulator->transmit_max,
        .time = simulator->time,
        .machine =
            {
                .context = simulator,
                .advance = simulator->buses.timed ? machine_advance : NULL,
                .controller =
                    simulator->task_inline || config->observer ? machine_controller : NULL,
                .receive = machine_receive,
                .control = machine_control,
                .plant = machine_plant,
                .sample = machine_sample,
                .transmit = machine_transmit,
                .fault = machine_fault,
                .publish = machine_publish,
                .shut_down = machine_shut_down,
            },
        .recorder = simulator->recorder,
        .steering = simulator->steering,
    };
    enum error_code code = snapshot_create(sizeof(struct simulator_status), simulator->arena,
                                           &simulator->published, error);

    return code ? code : loop_create(&loop, simulator->arena, &simulator->loop, error);
}

/* The buses of the rig, each by its name and by that of its interface, for clients of the gateway. */
static enum error_code create_gateway(struct simulator *simulator, struct error *error)
{
    const struct simulator_config *config = &simulator->config;
    struct gateway_bus bus[BUSES_MAX];
    struct gateway_config gateway;

    if (!config->gateway) {
        return ERROR_NONE;
    }
    for (size_t b = 0; b < config->rig->nbus; b++) {
        bus[b] = (struct gateway_bus){.name = config->rig->bus[b].name,
                                      .alias = simulator->buses.interface[b],
                                      .port = simulator->gateway_ports.port[b]};
    }
    gateway = *config->gateway;
    gateway.nbus = config->rig->nbus;
    gateway.bus = bus;
    return gateway_start(&gateway, simulator->arena, &simulator->gateway, error);
}

enum error_code simulator_create(const struct simulator_config *config, struct arena *arena,
                                 struct simulator **out, char notice[256], struct error *error)
{
    struct simulator *simulator = arena_alloc(arena, 1, sizeof *simulator);
    enum error_code code = check_configuration(config, error);

    *out = NULL;
    notice[0] = '\0';
    if (code) {
        return code;
    }
    if (!simulator) {
        return error_set(error, ERROR_MEMORY, "no memory left for the simulator");
    }
    simulator->config = *config;
    simulator->arena = arena;
    simulator->time = clock_monotonic();
    code = create_buses(simulator, notice, error);
    if (!code) {
        code = create_plant(simulator, error);
    }
    if (!code) {
        code = create_faults(simulator, error);
    }
    if (!code) {
        code = create_sensing(simulator, error);
    }
    if (!code) {
        code = create_boards(simulator, error);
    }
    if (!code) {
        code = create_task(simulator, error);
    }
    if (!code) {
        code = create_steering(simulator, error);
    }
    if (!code) {
        code = create_signals(simulator, error);
    }
    /* last of what can fail outside: it leaves files */
    if (!code) {
        code = create_recorder(simulator, error);
    }
    if (!code) {
        code = create_loop(simulator, error);
    }
    if (!code) {
        code = create_gateway(simulator, error);
    }
    if (code) {
        simulator_destroy(simulator);
        return code;
    }
    *out = simulator;
    return ERROR_NONE;
}

/* ---- running ---- */

static void *task_main(void *context)
{
    struct simulator *simulator = context;
    struct realtime_report unused; /* the loop's thread has said the same */

    realtime_apply(&simulator->task_realtime, &unused);
    controller_run(simulator->controller);
    loop_stop(simulator->loop);
    return NULL;
}

enum error_code simulator_start(struct simulator *simulator, struct realtime_report *report,
                                struct error *error)
{
    const struct rig_realtime *wanted = &simulator->config.rig->realtime;
    struct realtime_config config = {
        .priority = wanted->priority,
        .cpu = wanted->cpu,
        .lock_memory = wanted->lock_memory,
    };
    enum error_code code;

    memset(report, 0, sizeof *report);
    code = arena_seal(simulator->arena, false, error);
    realtime_touch();
    if (code || simulator->config.clock != RIG_CLOCK_REAL) {
        return code;
    }
    if (simulator->controller) {
        int reason;

        /* above the loop, as the computer on the other end of a cable would be */
        simulator->task_realtime = (struct realtime_config){
            .priority = wanted->priority + (wanted->priority > 0 && wanted->priority < 99),
            .cpu = -1,
        };
        reason = pthread_create(&simulator->task_thread, NULL, task_main, simulator);
        if (reason) {
            return error_set_errno(error, reason, "cannot start the task's thread");
        }
        simulator->task_running = true;
    }
    realtime_apply(&config, report);
    return ERROR_NONE;
}

enum loop_end simulator_run(struct simulator *simulator)
{
    enum loop_end end = loop_run(simulator->loop);

    if (simulator->task_running) {
        atomic_store(&simulator->controller->stop, true);
        if (simulator->pace) {
            pace_set(simulator->pace, 1.0); /* it may sleep */
        }
        pthread_join(simulator->task_thread, NULL);
        simulator->task_running = false;
        if (end == LOOP_END_STOPPED && simulator->controller->now.status != TASK_RUNNING) {
            end = LOOP_END_CONTROLLER;
        }
    }
    return end;
}

enum error_code simulator_join(struct simulator *simulator, struct bus_ports *ports,
                               struct error *error)
{
    return buses_join(&simulator->buses, simulator->arena, ports, error);
}

void simulator_stop(struct simulator *simulator)
{
    loop_stop(simulator->loop);
}

uint64_t simulator_beat(const struct simulator *simulator)
{
    return loop_beat(simulator->loop);
}

enum error_code simulator_finish_recording(struct simulator *simulator,
                                           struct recorder_counters *counters, struct error *error)
{
    struct recorder *recorder = simulator->recorder;

    memset(counters, 0, sizeof *counters);
    simulator->recorder = NULL;
    return recorder ? recorder_close(recorder, counters, error) : ERROR_NONE;
}

bool simulator_close_gateway(struct simulator *simulator, struct gateway_counters *counters)
{
    struct gateway *gateway = simulator->gateway;

    if (!gateway) {
        return false;
    }
    simulator->gateway = NULL;
    gateway_stop(gateway);
    gateway_counters(gateway, counters);
    return true;
}

void simulator_destroy(struct simulator *simulator)
{
    struct gateway_counters carried;
    struct recorder_counters counters;
    struct error error;

    if (!simulator) {
        return;
    }
    if (simulator->recorder && (!simulator->loop || !loop_stats(simulator->loop)->ticks)) {
        recorder_discard(simulator->recorder);
        simulator->recorder = NULL;
    }
    simulator_finish_recording(simulator, &counters, &error);
    simulator_close_gateway(simulator, &carried);
    bus_ports_close(&simulator->gateway_ports);
    bus_ports_close(&simulator->task_ports);
    bus_ports_close(&simulator->ports);
    buses_close(&simulator->buses);
    symbolic_close(&simulator->library);
    if (simulator->contact.world.ops) {
        simulator->contact.world.ops->destroy(&simulator->contact.world);
    }
    steering_destroy(simulator->steering);
}

/* ---- looking in ---- */

bool simulator_read(const struct simulator *simulator, struct simulator_status *status)
{
    return snapshot_read(simulator->published, status) > 0;
}

size_t simulator_signals(const struct simulator *simulator)
{
    return simulator->nsignal;
}

const char *const *simulator_signal_names(const struct simulator *simulator)
{
    return simulator->title;
}

struct stream *simulator_stream(const struct simulator *simulator)
{
    return simulator->stream;
}

void simulator_watch_interfaces(struct simulator *simulator, int64_t now_ns)
{
    interfaces_watch(&simulator->interfaces, now_ns);
    buses_seek(&simulator->buses, now_ns);
}

/* what an event's key has above its 32 bits */
enum event_source {
    EVENT_LOOP,
    EVENT_BOARD,
    EVENT_RECORDER,
    EVENT_RELEASE,
    EVENT_FAULT,
    EVENT_INTERFACE,
};

static uint64_t event_key(enum event_source source, uint64_t topic)
{
    return (uint64_t)source << 32 | topic;
}

static enum journal_priority board_event_priority(enum board_event_kind kind)
{
    switch (kind) {
    case BOARD_EVENT_MODE:
    case BOARD_EVENT_ADDRESS:
    case BOARD_EVENT_RESTART:
        return JOURNAL_INFO;
    default:
        return JOURNAL_WARNING;
    }
}

enum journal_priority simulator_event_priority(uint64_t key)
{
    switch (key >> 32) {
    case EVENT_LOOP:
        return key >> 8 == LOOP_EVENT_BACK     ? JOURNAL_INFO
               : key >> 8 >= LOOP_EVENT_PAUSED ? JOURNAL_NOTICE
                                               : JOURNAL_WARNING;
    case EVENT_BOARD:
        return board_event_priority((enum board_event_kind)(key >> 16 & 0xffff));
    case EVENT_RECORDER:
        return JOURNAL_ERROR;
    case EVENT_RELEASE:
        return JOURNAL_INFO;
    case EVENT_FAULT:
        return JOURNAL_NOTICE;
    default:
        return JOURNAL_WARNING;
    }
}

bool simulator_next_event(struct simulator *simulator, uint64_t *key, char *text, size_t size)
{
    struct loop_event loop_event;
    struct board_event board_event;
    struct fault_event fault_event;
    unsigned kind;
    int64_t released = atomic_exchange(&simulator->released, -1);
    size_t bus;
    int used;

    if (released >= 0) {
        *key = event_key(EVENT_RELEASE, 0);
        snprintf(text, size, "%.6f s: all motors are on, the links are let go",
                 (double)released * 1e-9);
        return true;
    }
    if (loop_next_event(simulator->loop, &loop_event)) {
        *key = event_key(EVENT_LOOP, (uint64_t)loop_event.kind << 8 | (uint8_t)loop_event.bus);
        used = snprintf(text, size, "%.6f s: ", (double)loop_event.time_ns * 1e-9);
        loop_event_format(simulator->loop, &loop_event, text + used, size - (size_t)used);
        return true;
    }
    if (faults_next_event(simulator->faults, &fault_event)) {
        *key = event_key(EVENT_FAULT, fault_event.fault);
        fault_event_format(simulator->faults, &fault_event, text, size);
        return true;
    }
    if (interfaces_next_event(&simulator->interfaces, &bus, text, size)) {
        *key = event_key(EVENT_INTERFACE, bus);
        return true;
    }
    if (boards_next_event(simulator->boards, &board_event)) {
        /* all axes change their mode at once when a controller comes and goes: one topic */
        bool grouped = board_event.kind == BOARD_EVENT_MODE;

        *key = event_key(EVENT_BOARD,
                         (uint64_t)board_event.kind << 16 |
                             (grouped ? 0 : (uint64_t)board_event.bus << 8 | board_event.address));
        board_event_format(simulator->boards, &board_event, text, size);
        return true;
    }
    if (simulator->recorder && recorder_next_event(simulator->recorder, &kind, text, size)) {
        *key = event_key(EVENT_RECORDER, kind);
        return true;
    }
    return false;
}

const struct simulator_config *simulator_configuration(const struct simulator *simulator)
{
    return &simulator->config;
}

const struct loop_stats *simulator_stats(const struct simulator *simulator)
{
    return loop_stats(simulator->loop);
}

struct can_port *simulator_port(const struct simulator *simulator, size_t bus)
{
    return simulator->ports.port[bus];
}

struct boards *simulator_boards(const struct simulator *simulator)
{
    return simulator->boards;
}

struct faults *simulator_faults(const struct simulator *simulator)
{
    return simulator->faults;
}

struct plant *simulator_plant(const struct simulator *simulator)
{
    return simulator->plant;
}

const struct plant_sensors *simulator_measured(const struct simulator *simulator)
{
    return simulator->measured;
}

const struct gateway *simulator_gateway(const struct simulator *simulator)
{
    return simulator->gateway;
}

const struct controller *simulator_controller(const struct simulator *simulator)
{
    return simulator->controller;
}

const char *simulator_failure(const struct simulator *simulator)
{
    return simulator->failure;
}

const struct settled *simulator_settled(const struct simulator *simulator)
{
    return simulator->config.settle ? &simulator->settled : NULL;
}

const char *simulator_dynamics(const struct simulator *simulator)
{
    return simulator->dynamics_notice.text;
}

bool simulator_controller_state(const struct simulator *simulator, size_t bus, char *text,
                                size_t size)
{
    return interfaces_describe(&simulator->interfaces, bus, text, size);
}

const struct wire *simulator_wire(const struct simulator *simulator, size_t bus)
{
    return simulator->buses.wire[bus];
}

struct steering *simulator_steering(const struct simulator *simulator)
{
    return simulator->steering;
}

size_t simulator_checkpoint_size(const struct simulator *simulator)
{
    return simulator->steered ? steered_checkpoint_size(simulator->steered) : 0;
}

bool simulator_is_local(const struct simulator *simulator)
{
    return simulator->buses.local;
}

void simulator_contact_profile(const struct simulator *simulator, uint64_t *evaluations,
                               int64_t *spent_ns)
{
    *evaluations = simulator->contact.evaluations;
    *spent_ns = simulator->contact.spent_ns;
}
