/* SPDX-License-Identifier: Apache-2.0 */
/* A simulator with its guests: the harness, the controller's STEP frames, creation and end. */
#include "tests/soak/part.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#define MEMORY ((size_t)1 << 30) /* of address space */

enum { ROUND_FAULTS = 36, TASK_FAULTS = 4 };

/* ---- the harness ---- */

/* Springs and dampers between the base and where it began, and its weight: a push on the base. */
static void hold_base(struct run *run, int64_t time_ns)
{
    const double stiffness[2] = {5000.0, 150.0}, damping[2] = {300.0, 4.0}; /* N/m, N m/rad, .. s */
    size_t count;
    const double *at = plant_state(simulator_plant(run->simulator), &count), *to = run->held;
    const double *q = at + 3, *p = to + 3;
    double dt = (double)(time_ns - run->last_ns) * 1e-9, push[6], error[6];
    /* The vector part of q p^-1: half the rotation from p to q */
    double w = q[0] * p[0] + q[1] * p[1] + q[2] * p[2] + q[3] * p[3], sign = w < 0.0 ? -2.0 : 2.0;

    for (int i = 0; i < 3; i++) {
        error[i] = at[i] - to[i];
    }
    error[3] = sign * (-q[0] * p[1] + q[1] * p[0] - q[2] * p[3] + q[3] * p[2]);
    error[4] = sign * (-q[0] * p[2] + q[1] * p[3] + q[2] * p[0] - q[3] * p[1]);
    error[5] = sign * (-q[0] * p[3] - q[1] * p[2] + q[2] * p[1] + q[3] * p[0]);
    for (int i = 0; i < 6; i++) {
        double rate = run->last_ns >= 0 ? (error[i] - run->error_before[i]) / dt : 0.0;

        push[i] = -stiffness[i / 3] * error[i] - damping[i / 3] * rate;
        run->error_before[i] = error[i];
    }
    for (int i = 0; i < 3; i++) {
        push[i] -= run->rig.robot->total_mass * run->rig.robot->gravity[i];
    }
    plant_set_push(simulator_plant(run->simulator), 0, push, push + 3);
}

/* ---- the controller's side of lockstep ---- */

static void send_step(struct run *run, uint64_t left)
{
    uint8_t data[LOCKSTEP_LENGTH];
    uint16_t ticks = 1;
    struct bus_frame step;

    if (random_uniform(&run->random) < 0.05) {
        ticks = (uint16_t)(1 + random_bits(&run->random) % 5);
    }
    ticks = ticks > left ? (uint16_t)left : ticks;
    put_u32_le(data, run->listener.tick);
    put_u16_le(data + 4, ticks);
    step = frame_make(run->rig.lockstep.step_id, LOCKSTEP_LENGTH, data);
    can_send(run->player.ports.port[run->rig.lockstep.bus], &step, 1);
}

/* Now and then it says nothing for up to 0.4 s but STEP */
static bool is_quiet(struct run *run, int64_t time_ns)
{
    if (time_ns >= run->quiet_due_ns) {
        run->quiet_ns = time_ns + (int64_t)(0.4e9 * random_uniform(&run->random));
        run->quiet_due_ns = time_ns + (int64_t)(20e9 * random_uniform(&run->random));
    }
    /* Not while a round is to end well */
    return time_ns < run->quiet_ns && time_ns / SECOND % ROUND_S < BROKEN_S;
}

static void play(struct run *run, int64_t time_ns)
{
    struct error error;

    hold_base(run, time_ns);
    if (player_step(&run->player, time_ns, is_quiet(run, time_ns), &error)) {
        part_fail(run, "controller: %s", error.text);
    }
}

static bool is_rude(const struct run *run, int64_t time_ns)
{
    int64_t second = time_ns / SECOND;

    return !run->part->task && (second / ROUND_S & 1) == run->odd &&
           second % ROUND_S < BROKEN_S - 1;
}

static void step(void *context, int64_t time_ns)
{
    struct run *run = context;
    bool fresh = time_ns != run->last_ns;

    if (!listener_check(&run->listener, true)) {
        part_fail(run, "%s", run->listener.failure);
    }
    if (fresh) {
        rules_check_tick(run, time_ns);
        intruder_step(&run->intruder, is_rude(run, time_ns), run->listener.tick);
        if (!run->part->task) {
            play(run, time_ns);
            /* Twice in a part the STEP itself is late, by the wall's clock */
            run->waits = time_ns == 5 * SECOND || time_ns == 6 * SECOND ? 2 : 0;
        }
    }
    run->last_ns = time_ns;
    if (!run->part->task && run->waits-- == 0) {
        send_step(run, run->ticks - run->listener.tick);
    }
}

/* ---- a part ---- */

static enum error_code write_faults(struct run *run, const struct totals *totals,
                                    struct error *error)
{
    double length_s = (double)run->ticks * 1e-3;
    uint64_t seed = random_bits(&run->random);

    fault_lines_init(&run->fault_lines, &run->rig, run->part->wire, seed, totals->kind);
    if (run->part->task) {
        const size_t count = run->part->faults ? run->part->faults : TASK_FAULTS;

        return fault_lines_add(&run->fault_lines, count, 0.5, TASK_S, 1.0, error) ? ERROR_NONE
                                                                                  : error->code;
    }
    for (double t = 0.0; t < length_s; t += ROUND_S) {
        double end = fmin(t + BROKEN_S, length_s);

        if (is_rude(run, (int64_t)(t * 1e9))) {
            /* Frames that are taken for the host's may change any setting */
            fault_lines_add_power_cycle(&run->fault_lines, t + BROKEN_S - 0.5, t + BROKEN_S);
        }
        if (end - t > 4.0 &&
            !fault_lines_add(&run->fault_lines, ROUND_FAULTS, t + 1.0, end, 2.0, error)) {
            return error->code;
        }
    }
    return ERROR_NONE;
}

static enum error_code load_rig(struct run *run, struct error *error)
{
    const struct rig *rig;
    char path[4096];
    enum error_code code = arena_init(&run->arena, MEMORY, error);

    snprintf(path, sizeof path, "%s/config/rigs/%s", HIL_SOURCE_DIR, run->part->rig);
    if (!code) {
        code = rig_load(path, &run->arena, &rig, error);
    }
    if (!code) {
        run->rig = *rig;
        run->rig.wire.timed = run->part->wire;
    }
    return code;
}

static enum error_code create(struct run *run, const struct totals *totals, uint64_t seed,
                              const char *record, const struct simulator_observer *observer,
                              struct error *error)
{
    struct simulator_config config = {
        .rig = &run->rig,
        .clock = LOOP_CLOCK_LOCKSTEP,
        .energy = true,
        .transport = TRANSPORT_LOCAL,
        .seed_given = true,
        .seed = seed,
        .task = run->part->task,
        .observer = observer,
        .guests = run->part->task ? 2 : 3,
        .record = record,
        .overwrite = true,
        .row_period_ns = 10 * MS,
    };
    char notice[256];
    enum error_code code = write_faults(run, totals, error);

    config.hold = run->rig.hold;
    config.ticks = run->ticks;
    config.fault = run->fault_lines.line;
    config.nfault = run->fault_lines.count;
    code = code ? code : simulator_create(&config, &run->arena, &run->simulator, notice, error);
    code = code ? code : simulator_join(run->simulator, &run->listener.ports, error);
    code = code ? code : simulator_join(run->simulator, &run->intruder.ports, error);
    if (!code && !run->part->task) {
        code = simulator_join(run->simulator, &run->player.ports, error);
        code = code ? code : player_init(&run->player, &run->rig, seed, error);
    }
    return code;
}

static void prepare(struct run *run, uint64_t seed)
{
    run->last_ns = -1;
    run->listener.rig = run->intruder.rig = &run->rig;
    run->listener.wire = run->part->wire;
    run->listener.hash = HASH_START;
    run->random = random_named(seed, "run");
    run->intruder.random = random_named(seed, "intruder");
    run->odd = seed & 1;
    run->quiet_due_ns = 3 * SECOND;
    memcpy(run->held, run->rig.base_position, 3 * sizeof(double));
    memcpy(run->held + 3, run->rig.base_quaternion, 4 * sizeof(double));
    run->held[2] += 0.02;
}

static void close_all(struct run *run)
{
    bus_ports_close(&run->listener.ports);
    bus_ports_close(&run->intruder.ports);
    bus_ports_close(&run->player.ports);
    player_fini(&run->player);
    simulator_destroy(run->simulator);
    arena_fini(&run->arena);
}

static void add_up(struct totals *totals, const struct run *run, uint64_t ticks)
{
    totals->hash = hash_bytes(totals->hash, &run->listener.hash, sizeof run->listener.hash);
    totals->ticks += ticks;
    for (size_t b = 0; b < run->rig.nbus; b++) {
        totals->frames += run->listener.frames[b];
    }
    totals->faults += run->faults;
    totals->events += run->events;
    totals->switched_on += run->player.switched_on;
    totals->starts += run->player.starts;
    totals->intruder += run->intruder.frames;
    totals->refused += run->listener.refused;
    totals->kind = run->fault_lines.kind;
    for (size_t k = 0; k < LINE_KINDS_MAX; k++) {
        totals->of_kind[k] += run->fault_lines.of_kind[k];
    }
}

static void print_part(const struct run *run, uint64_t ticks)
{
    uint64_t frames = 0;

    for (size_t b = 0; b < run->rig.nbus; b++) {
        frames += run->listener.frames[b];
    }
    printf("%-16s %7.2f s %10" PRIu64 " frames %4" PRIu64 " faults %6" PRIu64
           " events, switched on %5" PRIu64 ", started %3" PRIu64 ", hash %016" PRIx64 "\n",
           run->part->name, (double)ticks * 1e-3, frames, run->faults, run->events,
           run->player.switched_on, run->player.starts, run->listener.hash);
    fflush(stdout);
}

bool part_run(const struct part *part, struct totals *totals, uint64_t seed, uint64_t ticks,
              const char *record)
{
    static struct run run;
    const struct simulator_observer observer = {&run, step};
    struct realtime_report report;
    struct recorder_counters recorded;
    struct error error;
    uint64_t ran = 0;

    memset(&run, 0, sizeof run);
    run.part = part;
    run.ticks = ticks;
    error.text[0] = '\0';
    if (!load_rig(&run, &error)) {
        prepare(&run, seed);
        if (!create(&run, totals, seed, record, &observer, &error) &&
            !simulator_start(run.simulator, &report, &error)) {
            rules_check_end(&run, simulator_run(run.simulator));
            ran = simulator_stats(run.simulator)->ticks;
            print_part(&run, ran);
            if (simulator_finish_recording(run.simulator, &recorded, &error) == ERROR_NONE) {
                error.text[0] = '\0';
            }
        }
    }
    add_up(totals, &run, ran);
    close_all(&run);
    if (error.text[0] || run.failure[0]) {
        fprintf(stderr, "soak: part %zu, %s, seed %" PRIu64 ", at %.3f s: %s%s\n", totals->parts,
                run.part->name, seed, (double)run.last_ns * 1e-9, run.failure, error.text);
        return false;
    }
    return true;
}
