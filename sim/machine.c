/* SPDX-License-Identifier: Apache-2.0 */
/* The phases of a tick: the functions of a simulator that the loop calls. */
#include "canbus/wire/wire.h"
#include "sim/simulator_private.h"

/* Brakes hold the rotors of a settled robot. They open this long after the last motor is on, so
 * that the controller's first voltages can build up the currents. */
#define BRAKE_NS INT64_C(20000000)

enum { ANSWERS = 64 }; /* answers that one call sends within a tick */

/* Opens and closes the windows of faults. It runs before the wait, because in lockstep the loop
 * receives frames while it waits, through ports with faults. */
static void machine_begin(void *context, int64_t now_ns)
{
    struct simulator *simulator = context;

    simulator->stimulus_ns = now_ns;
    fault_injection_step(simulator->injection, now_ns);
}

/* Calls the observer with the last tick, then steps an inline task. Returns false if the task has
 * finished. With an observer, a free run continues after the task's end. */
static bool machine_controller(void *context, int64_t now_ns)
{
    struct simulator *simulator = context;
    const struct simulator_observer *observer = simulator->config.observer;
    bool goes_on = observer && simulator->config.clock == LOOP_CLOCK_FREE;

    if (observer) {
        observer->step(observer->context, now_ns);
    }
    if (simulator->task_inline && simulator->task->now.status == TASK_RUNNING) {
        /* In lockstep, passes the clock's time, so that the task detects a lost STEP */
        task_runner_step(simulator->task, simulator->config.clock == LOOP_CLOCK_LOCKSTEP
                                              ? clock_now(simulator->time)
                                              : now_ns);
    }
    return goes_on || !simulator->task_inline || simulator->task->now.status == TASK_RUNNING;
}

/* Passes a frame to the boards and to the listener of external boards. */
static void machine_receive(void *context, int64_t now_ns, size_t bus,
                            const struct bus_frame *frame)
{
    struct simulator *simulator = context;

    boards_receive_early(simulator->boards, now_ns, frame->time_ns, bus, frame);
    if (simulator->external) {
        external_receive(simulator->external, now_ns, bus, frame);
    }
}

/* Returns the number of motors that the boards drive; *on is the number that are on. A motor of an
 * external board is on while its board sends. */
static size_t simulator_count_motors(const struct simulator *simulator, size_t *on)
{
    const struct rig *rig = simulator->config.rig;
    const struct plant_command *command = plant_command(simulator->plant);
    size_t driven = 0;

    *on = 0;
    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];

        for (int k = 0; k < BOARD_AXES_MAX && board->kind == BOARD_MOTOR; k++) {
            int joint = board->axis[k].joint;

            driven += joint >= 0;
            *on += joint >= 0 && (board->external ? boards_external_present(simulator->boards, i)
                                                  : command->motor[joint].bridge_on);
        }
    }
    return driven;
}

/* Runs the boards' control, and sets the motion of external boards' rotors. */
static void machine_control(void *context, int64_t now_ns)
{
    struct simulator *simulator = context;

    boards_control(simulator->boards, now_ns, plant_command(simulator->plant));
    if (simulator->external) {
        external_control(simulator->external, now_ns);
    }

    /* Records for the log that an axis tripped because its link is clamped */
    struct release *release = &simulator->release;
    struct boards_counters counters;
    size_t on;

    boards_counters(simulator->boards, &counters);
    if (counters.trips > release->trips && plant_is_clamped(simulator->plant)) {
        simulator_count_motors(simulator, &on);
        atomic_store(&simulator->clamped_trip_on, (int)on);
        atomic_store(&simulator->clamped_trip, now_ns);
    }
    release->trips = counters.trips;

    /* Releases a clamped robot when all its motors are on; a settled robot BRAKE_NS later */
    if (release->due) {
        const size_t driven = simulator_count_motors(simulator, &on);

        release->due = driven != on;
        release->at_ns =
            driven != on ? release->at_ns : now_ns + (simulator->config.settle ? BRAKE_NS : 0);
    }
    if (release->at_ns >= 0 && now_ns >= release->at_ns) {
        plant_clamp(simulator->plant, false);
        release->at_ns = -1;
        atomic_store(&simulator->released, now_ns);
    }
}

/* Stores the cause if the model failed, and checks for energy from nowhere. Returns whether the
 * model is valid. */
static bool simulator_check_plant(struct simulator *simulator, enum error_code code, int64_t now_ns)
{
    if (code) {
        watch_check_energy(simulator->watch, now_ns);
        snprintf(simulator->failure, sizeof simulator->failure, "%s%s",
                 watch_found_energy(simulator->watch) ? "the integrator diverges: " : "",
                 plant_failure(simulator->plant));
    }
    return !code;
}

/* Integrates the plant over the tick; returns false if the model failed. */
static bool machine_plant(void *context, int64_t now_ns)
{
    struct simulator *simulator = context;

    return simulator_check_plant(
        simulator, plant_step(simulator->plant, simulator->config.rig->substeps), now_ns);
}

/* Samples plant and sensors for the boards at the tick's end; returns false if the model
 * failed. */
static bool machine_sample(void *context, int64_t now_ns)
{
    struct simulator *simulator = context;

    if (!simulator_check_plant(simulator, plant_sample(simulator->plant), now_ns)) {
        return false;
    }
    watch_step(simulator->watch, now_ns);
    simulator->measured =
        sensing_sample(simulator->sensing, now_ns, plant_sensors(simulator->plant));
    if (!simulator->buses.timed) {
        boards_sample(simulator->boards, now_ns, simulator->measured);
    }
    return true;
}

/* Passes the error counters of the CAN controllers to the boards, which report them. On a wire
 * each board has its own controller, in the order of the rig. */
static void simulator_update_can_states(struct simulator *simulator, size_t bus)
{
    const struct rig_bus *on = &simulator->config.rig->bus[bus];
    const struct wire *wire = simulator->buses.wire[bus];

    /* Usual case: no errors, now and before */
    if (!wire || (!wire_has_errors(wire) && !boards_have_can_errors(simulator->boards, bus))) {
        return;
    }
    for (size_t node = 0; node < on->nboard; node++) {
        struct wire_node_stats stats;

        wire_node_stats(wire, node, &stats);
        boards_set_can_state(simulator->boards, on->first_board + node,
                             &(struct board_can_state){.tec = stats.tec,
                                                       .rec = stats.rec,
                                                       .bus_off = stats.state == WIRE_BUS_OFF});
    }
}

int64_t simulator_hear(void *context, const struct bus_frame *frame)
{
    const struct simulator_bus *listener = context;
    struct simulator *simulator = listener->simulator;
    struct bus_frame heard[2];
    const size_t count = fault_injection_hear(simulator->injection, listener->bus, frame, heard);

    for (size_t i = 0; i < count; i++) {
        boards_receive(simulator->boards, frame->time_ns, listener->bus, &heard[i]);
        if (simulator->external) {
            /* Its values take effect at the beginning of the next tick */
            external_receive(simulator->external, simulator->advance_ns, listener->bus, &heard[i]);
        }
    }
    return boards_next_answer(simulator->boards, listener->bus);
}

/* Moves the wires to the end of the tick. Boards that answer in the tick report the samples of its
 * beginning; they get those of its end afterwards. */
static void machine_advance(void *context, int64_t now_ns)
{
    struct simulator *simulator = context;

    simulator->advance_ns = now_ns;
    for (size_t b = 0; b < simulator->config.rig->nbus; b++) {
        /* Move a wire to the end of the tick. It stops whenever an answer of a board is due, which
         * then enters the board's controller. */
        struct bus_frame answer[ANSWERS];
        int64_t at_ns = 0;

        while (at_ns < now_ns) {
            const int64_t due_ns = boards_next_answer(simulator->boards, b);
            size_t count;

            at_ns = buses_advance(&simulator->buses, b,
                                  simulator->buses.local && due_ns < now_ns ? due_ns : now_ns);
            while (at_ns < now_ns && (count = boards_answer(simulator->boards, at_ns, at_ns, b,
                                                            answer, ANSWERS)) > 0) {
                can_send(simulator->ports.port[b], answer, count);
            }
        }
    }
    boards_sample(simulator->boards, now_ns, simulator->measured);
}

static void machine_set_due(void *context, int64_t due_ns)
{
    ((struct simulator *)context)->due_ns = due_ns;
}

static int64_t machine_next_answer(void *context)
{
    const struct simulator *simulator = context;
    int64_t next_ns = INT64_MAX;

    for (size_t b = 0; b < simulator->config.rig->nbus; b++) {
        const int64_t due_ns = boards_next_answer(simulator->boards, b);

        next_ns = due_ns < next_ns ? due_ns : next_ns;
    }
    return next_ns;
}

/* Collects the answers of boards that are due. */
static size_t machine_answer(void *context, int64_t now_ns, size_t bus, struct bus_frame *frames,
                             size_t max)
{
    const struct simulator *simulator = context;

    return boards_answer(simulator->boards, now_ns, simulator->due_ns, bus, frames, max);
}

static size_t machine_transmit(void *context, int64_t now_ns, size_t bus, struct bus_frame *frames,
                               size_t max)
{
    struct simulator *simulator = context;
    const size_t count = machine_answer(context, now_ns, bus, frames, max);

    simulator_update_can_states(simulator, bus);
    return count +
           boards_transmit_periodic(simulator->boards, now_ns, bus, frames + count, max - count);
}

/* Checks whether other programs can send frames: always on SocketCAN; on local buses only through
 * the gateway. */
static bool machine_listens(void *context)
{
    const struct simulator *simulator = context;

    return !simulator->buses.local || (simulator->gateway && gateway_is_heard(simulator->gateway));
}

static bool machine_fault(void *context)
{
    const struct simulator *simulator = context;

    return boards_fault(simulator->boards);
}

static void machine_shut_down(void *context, int64_t now_ns)
{
    struct simulator *simulator = context;

    boards_shut_down(simulator->boards, now_ns, plant_command(simulator->plant));
}

/* Publishes the status, and a row for the recording and the subscribers. */
static void machine_publish(void *context, int64_t now_ns, const struct loop_stats *stats)
{
    struct simulator *simulator = context;

    simulator_publish(simulator, now_ns, stats);
    simulator_record_row(simulator);
    simulator_stream_row(simulator);
}

static void machine_idle(void *context)
{
    simulator_renew_view(context);
}

struct loop_machine simulator_machine(struct simulator *simulator)
{
    return (struct loop_machine){
        .context = simulator,
        .begin = machine_begin,
        .controller =
            simulator->task_inline || simulator->config.observer ? machine_controller : NULL,
        .receive = machine_receive,
        /* On a wire in virtual time, frames arrive in ticks only */
        .answer = simulator->buses.timed ? NULL : machine_answer,
        .set_due = machine_set_due,
        .next_answer = machine_next_answer,
        .listens = machine_listens,
        .control = machine_control,
        .plant = machine_plant,
        .sample = machine_sample,
        .advance = simulator->buses.timed ? machine_advance : NULL,
        .transmit = machine_transmit,
        .fault = machine_fault,
        .publish = machine_publish,
        .idle = machine_idle,
        .shut_down = machine_shut_down,
    };
}
