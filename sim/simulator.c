/* SPDX-License-Identifier: Apache-2.0 */
/* Joins the parts of a rig behind the loop. */
#include "sim/private.h"

#include "sim/module_cache.h"
#include "rig/faults.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

    return simulator->config.rig->contact_engine == RIG_CONTACT_NATIVE
               ? contact_native_create(config, simulator->arena, &simulator->contact, error)
               : contact_simbody_create(config, &simulator->contact, error);
}

static int64_t wall_time_ns(void *clock)
{
    return clock_now(clock);
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
        .now_ns = wall_time_ns,
        .clock = simulator->time,
    };
    enum error_code code = create_dynamics(simulator, error);

    if (!code && rig->contact_engine != RIG_CONTACT_NONE) {
        code = create_contact(simulator, error);
        config.contact = simulator->contact;
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

    if (!code && simulator->buses.local && config->clock == LOOP_CLOCK_LOCKSTEP && !guests) {
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
        simulator->measured = sensing_sample(simulator->sensing, plant_time_ns(simulator->plant),
                                             plant_sensors(simulator->plant));
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
    boards_sample(simulator->boards, plant_time_ns(simulator->plant), simulator->measured);
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
    simulator->task_inline = config->clock != LOOP_CLOCK_REAL;
    if (config->steered && !simulator->task_inline) {
        code = pace_create(simulator->time, simulator->arena, &simulator->pace, error);
        if (code) {
            return code;
        }
        time = pace_clock(simulator->pace);
    }
    code = controller_create(config->rig, config->task, simulator->task_ports.port,
                             config->clock == LOOP_CLOCK_LOCKSTEP, time, simulator->arena,
                             &simulator->controller, error);
    if (simulator->task_inline) {
        simulator->moves_to = simulator->arena->used;
    }
    return code;
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
        .show = simulator_publish,
        .pace = simulator->pace ? follow_pace : NULL,
    };

    return simulator->config.steered
               ? steered_create(&steered, simulator->arena, &simulator->steered,
                                &simulator->steering, error)
               : ERROR_NONE;
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
        .machine = simulator_machine(simulator),
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
    struct gateway_bus bus[RIG_BUSES_MAX];
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
        code = simulator_create_signals(simulator, error);
    }
    /* last of what can fail outside: it leaves files */
    if (!code) {
        code = simulator_create_recorder(simulator, error);
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

/* The task wakes up in the middle between two ticks: on one processor it would else make the loop late,
 * by as long as it takes, whenever the two grids happen to coincide. */
static void keep_off_the_grid(struct simulator *simulator)
{
    int64_t tick_ns = simulator->config.rig->tick_ns;
    struct simulator_status status;

    while (!simulator_read(simulator, &status)) {
        if (atomic_load(&simulator->controller->stop)) {
            return;
        }
        clock_sleep_until(simulator->time, clock_now(simulator->time) + tick_ns);
    }
    simulator->controller->grid_ns = status.start_ns + tick_ns / 2;
}

static void *task_main(void *context)
{
    struct simulator *simulator = context;
    struct realtime_report unused; /* the loop's thread has said the same */

    realtime_apply(&simulator->task_realtime, &unused);
    keep_off_the_grid(simulator);
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
    if (code || simulator->config.clock != LOOP_CLOCK_REAL) {
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
    if (simulator->contact) {
        simulator->contact->ops->destroy(simulator->contact);
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

const struct plant_contact_cost *simulator_contact_cost(const struct simulator *simulator)
{
    return plant_contact_cost(simulator->plant);
}
