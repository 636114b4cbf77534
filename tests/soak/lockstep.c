/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN for an hour of its own time in lockstep, at full traffic, while everything that can break
 * breaks at random: soak_lockstep [SECONDS [SEED [RECORD-DIRECTORY]]].
 *
 * The time is cut into parts of some minutes, each a simulator of its own: COMAN hung up in a harness
 * with every kind of board, on buses with and without wire time, moved by a controller that never
 * gives up (player.h); and, standing on its feet or in front of a box, the tasks of the product, which
 * end when something breaks badly enough. A listener judges what passes on the buses (watch.h), a
 * stranger talks on them (stranger.h). In the harness every half minute ends with eight seconds in
 * which nothing is broken: at the end of them every motor must be on and tell where it is.
 *
 * Prints a line for each part and one for all; two runs with the same arguments agree in their hash,
 * whatever else the machine does. Exit status 1: a rule was broken, and stderr says which.
 */
#include "base/hash.h"
#include "boards/icub_protocol.h"
#include "canbus/wire.h"
#include "rt/simulator.h"
#include "tests/soak/lines.h"
#include "tests/soak/player.h"
#include "tests/soak/stranger.h"
#include "tests/soak/watch.h"

#include <dirent.h>
#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define MEMORY ((size_t)1 << 30) /* of address space */
#define SECOND INT64_C(1000000000)
#define MS INT64_C(1000000)

enum { ROUND_S = 30, BROKEN_S = 22, ROUND_FAULTS = 36, TASK_S = 26, TASK_FAULTS = 8 };

struct part {
    const char *name, *rig;
    const char *task; /* NULL: the player, in a harness */
    bool wire;
};

static const struct part programme[] = {
    {"icub", "coman.yaml", NULL, false},
    {"squat", "coman.yaml", "squat", false},
    {"sensors on wires", "coman-sensors.yaml", NULL, true},
    {"foc", "coman-foc.yaml", NULL, false},
    {"grasp", "grasp.yaml", "grasp", false},
    {"compact on wires", "coman-compact.yaml", NULL, true},
    {"fd", "coman-fd.yaml", NULL, false},
    {"squat on wires", "coman-sensors.yaml", "squat", true},
};

enum { PARTS = sizeof programme / sizeof programme[0] };

/* What is kept through all parts. */
struct totals {
    uint64_t hash, ticks, frames, faults, events, switched_on, starts, strange, refused;
    uint64_t of_kind[LINE_KINDS_MAX];
    size_t parts, kind;
    long pages_first, pages_minute_2, pages_last; /* between two parts; 0 = not yet */
    int descriptors, threads;
};

/* One part while it runs. */
struct run {
    const struct part *part;
    struct rig rig;
    struct arena arena;
    struct simulator *simulator;
    struct watch watch;
    struct player player;
    struct stranger stranger;
    struct lines lines;
    struct random_stream random;
    uint64_t ticks;   /* it is to run */
    bool odd;         /* the stranger is rude in the second, not the first round */
    int64_t last_ns;  /* virtual, of the last look; -1 = none yet */
    int waits;        /* calls in which the STEP is withheld */
    int64_t quiet_ns; /* until when the controller sends STEP frames only */
    int64_t quiet_due_ns;
    double held[7]; /* where the harness holds the base */
    double error_before[6];
    struct bus_status before[BUSES_MAX];
    uint64_t faults, events;
    bool was_active[FAULTS_MAX];
    long pages_early;
    char failure[512];
};

/* ---- of this process ---- */

static long resident_pages(void)
{
    long size = 0, resident = 0;
    FILE *in = fopen("/proc/self/statm", "re");

    if (in) {
        if (fscanf(in, "%ld %ld", &size, &resident) != 2) {
            resident = 0;
        }
        fclose(in);
    }
    return resident;
}

static int entries(const char *path)
{
    DIR *directory = opendir(path);
    int count = 0;

    while (directory && readdir(directory)) {
        count++;
    }
    if (directory) {
        closedir(directory);
    }
    return count;
}

/* ---- rules ---- */

static void __attribute__((format(printf, 2, 3)))
fail(struct run *run, const char *format, ...)
{
    va_list args;

    if (!run->failure[0]) {
        va_start(args, format);
        vsnprintf(run->failure, sizeof run->failure, format, args);
        va_end(args);
        simulator_stop(run->simulator);
    }
}

/* Bounds that physics gives: no current beyond what the supply and twice the fastest rotor's back-EMF
 * drive through the winding, nothing faster than a free fall of a second, nobody out of the room. */
static void check_plant(struct run *run)
{
    const struct plant_sensors *sensors = plant_sensors(simulator_plant(run->simulator));
    size_t count;
    const double *state = plant_state(simulator_plant(run->simulator), &count);

    for (size_t j = 0; j < sensors->njoint; j++) {
        const struct motor_sense *m = &sensors->motor[j];
        const struct robot_sea *sea = &run->rig.robot->joint[j].sea;
        double most_a = sea->present ? 3.0 * run->rig.supply_v / sea->R : 0.0;

        if (!isfinite(m->q) || !isfinite(m->qm) || !isfinite(m->torque_nm) ||
            !(fabs(m->qd) < 200.0) || !(fabs(m->qmd) < 100.0) || !(fabs(m->current_a) <= most_a)) {
            fail(run, "joint %s: q %g, q' %g, qm %g, qm' %g, %g A, %g N m",
                 run->rig.robot->joint[j].name, m->q, m->qd, m->qm, m->qmd, m->current_a,
                 m->torque_nm);
        }
    }
    for (size_t i = 0; i < 3 && run->rig.robot->floating; i++) {
        if (!(fabs(state[i]) < 10.0)) {
            fail(run, "the base is at %g %g %g m", state[0], state[1], state[2]);
        }
    }
}

static void check_energy(struct run *run)
{
    struct plant_energy energy;

    if (plant_energy(simulator_plant(run->simulator), &energy)) {
        fail(run, "energy: %s", plant_failure(simulator_plant(run->simulator)));
    } else if (!isfinite(energy.balance) || !isfinite(energy.stored) ||
               !(fabs(energy.stored) < 1e4) || !(energy.joule_heat >= 0.0) ||
               !(energy.spring_damping >= 0.0)) {
        fail(run, "energy: %g J stored, %g J of heat, %g J unbalanced", energy.stored,
             energy.joule_heat, energy.balance);
    }
}

/* What is published tells of this very tick, and no counter goes back. */
static void check_status(struct run *run, int64_t time_ns)
{
    struct simulator_status now;

    if (time_ns != (int64_t)run->watch.tick * run->rig.tick_ns) {
        fail(run, "virtual time is %" PRId64 " ns after %u ticks", time_ns, run->watch.tick);
    }
    if (!simulator_read(run->simulator, &now)) {
        return; /* before the first tick */
    }
    if (now.tick != run->watch.tick || now.time_ns != time_ns) {
        fail(run, "status of tick %" PRIu64 " at tick %u", now.tick, run->watch.tick);
    }
    for (size_t b = 0; b < run->rig.nbus; b++) {
        struct bus_status *before = &run->before[b];

        if (now.bus[b].rx_frames < before->rx_frames || now.bus[b].tx_frames < before->tx_frames ||
            now.bus[b].rx_dropped < before->rx_dropped ||
            now.bus[b].tx_dropped < before->tx_dropped || now.bus[b].bits < before->bits) {
            fail(run, "a counter of bus %s went back", run->rig.bus[b].name);
        }
        *before = now.bus[b];
    }
}

static void count_faults(struct run *run)
{
    const struct faults *faults = simulator_faults(run->simulator);

    for (size_t i = 0; i < faults_count(faults); i++) {
        bool active = faults_at(faults, i)->active;

        run->faults += active && !run->was_active[i];
        run->was_active[i] = active;
    }
}

static void take_events(struct run *run)
{
    char text[512];
    uint64_t key;

    while (simulator_next_event(run->simulator, &key, text, sizeof text)) {
        run->events++;
    }
}

/* At the end of each round nothing is broken any more. */
static void check_recovery(struct run *run, int64_t time_ns)
{
    const char *joint;

    if (!player_all_well(&run->player, time_ns, &joint)) {
        fail(run, "%s has not come back %d s after the last fault: %s", joint, ROUND_S - BROKEN_S,
             host_message(run->player.host));
    }
}

static void check_tick(struct run *run, int64_t time_ns)
{
    check_plant(run);
    check_status(run, time_ns);
    take_events(run);
    if (time_ns % (10 * MS) == 0) {
        count_faults(run);
    }
    if (time_ns % SECOND == 0) {
        uint64_t state = plant_hash(simulator_plant(run->simulator));

        run->watch.hash = hash_bytes(run->watch.hash, &state, sizeof state);
        check_energy(run);
    }
    if (time_ns == 2 * SECOND) {
        run->pages_early = resident_pages();
    }
    if (!run->part->task && time_ns > 0 && time_ns % (ROUND_S * SECOND) == 0) {
        check_recovery(run, time_ns);
    }
}

/* ---- the harness ---- */

/* Springs and dampers between the base and where it began, and its weight: a push on the base. */
static void hold_base(struct run *run, int64_t time_ns)
{
    const double stiffness[2] = {5000.0, 150.0}, damping[2] = {300.0, 4.0}; /* N/m, N m/rad, .. s */
    size_t count;
    const double *at = plant_state(simulator_plant(run->simulator), &count), *to = run->held;
    const double *q = at + 3, *p = to + 3;
    double dt = (double)(time_ns - run->last_ns) * 1e-9, push[6], error[6];
    /* the vector part of q p^-1: half the rotation from p to q */
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
    put_u32_le(data, run->watch.tick);
    put_u16_le(data + 4, ticks);
    step = frame_make(run->rig.lockstep.step_id, LOCKSTEP_LENGTH, data);
    can_send(run->player.ports.port[run->rig.lockstep.bus], &step, 1);
}

/* now and then it says nothing for up to 0.4 s but STEP */
static bool is_quiet(struct run *run, int64_t time_ns)
{
    if (time_ns >= run->quiet_due_ns) {
        run->quiet_ns = time_ns + (int64_t)(0.4e9 * random_uniform(&run->random));
        run->quiet_due_ns = time_ns + (int64_t)(20e9 * random_uniform(&run->random));
    }
    /* not while a round is to end well */
    return time_ns < run->quiet_ns && time_ns / SECOND % ROUND_S < BROKEN_S;
}

static void play(struct run *run, int64_t time_ns)
{
    struct error error;

    hold_base(run, time_ns);
    if (player_step(&run->player, time_ns, is_quiet(run, time_ns), &error)) {
        fail(run, "controller: %s", error.text);
    }
}

static bool is_rude(const struct run *run, int64_t time_ns)
{
    int64_t second = time_ns / SECOND;

    return !run->part->task && (second / ROUND_S & 1) == run->odd && second % ROUND_S < BROKEN_S - 1;
}

static void step(void *context, int64_t time_ns)
{
    struct run *run = context;
    bool fresh = time_ns != run->last_ns;

    if (!watch_look(&run->watch, true)) {
        fail(run, "%s", run->watch.failure);
    }
    if (fresh) {
        check_tick(run, time_ns);
        stranger_step(&run->stranger, is_rude(run, time_ns), run->watch.tick);
        if (!run->part->task) {
            play(run, time_ns);
            /* twice in a part the STEP itself is late, by the wall's clock */
            run->waits = time_ns == 5 * SECOND || time_ns == 6 * SECOND ? 2 : 0;
        }
    }
    run->last_ns = time_ns;
    if (!run->part->task && (fresh || run->waits > 0) && run->waits-- <= 0) {
        send_step(run, run->ticks - run->watch.tick);
    }
}

/* ---- after a part ---- */

/* Each frame that somebody has sent has passed the listener, or is counted as lost. */
static void account(struct run *run)
{
    for (size_t b = 0; b < run->rig.nbus && !run->part->task; b++) {
        const struct can_counters *boards = &simulator_port(run->simulator, b)->counters;
        const struct can_counters *player = &run->player.ports.port[b]->counters;
        const struct can_counters *stranger = &run->stranger.ports.port[b]->counters;
        const struct can_counters *listener = &run->watch.ports.port[b]->counters;
        const struct wire *wire = simulator_wire(run->simulator, b);
        uint64_t sent = boards->tx_frames + player->tx_frames + stranger->tx_frames;
        uint64_t seen = listener->rx_frames;

        if (wire) {
            struct wire_stats stats;

            wire_stats(wire, &stats);
            sent = stats.frames;
            seen = run->watch.frames[b];
        }
        if (sent != seen) {
            fail(run, "bus %s: %" PRIu64 " frames sent, %" PRIu64 " seen", run->rig.bus[b].name,
                 sent, seen);
        }
    }
}

static void check_end(struct run *run, enum loop_end end)
{
    const struct loop_stats *stats = simulator_stats(run->simulator);
    struct boards_counters boards;
    long pages = resident_pages();

    boards_counters(simulator_boards(run->simulator), &boards);
    if (!watch_look(&run->watch, run->part->task == NULL)) {
        fail(run, "%s", run->watch.failure);
    }
    if (end == LOOP_END_MODEL) {
        fail(run, "the model failed: %s", simulator_failure(run->simulator));
    }
    if (!run->part->task && (end != LOOP_END_LENGTH || stats->ticks != run->ticks)) {
        fail(run, "ended after %" PRIu64 " of %" PRIu64 " ticks", stats->ticks, run->ticks);
    }
    if (stats->lockstep.steps != run->watch.steps ||
        stats->lockstep.mismatches != run->watch.refused ||
        stats->lockstep.malformed != run->watch.malformed || !run->watch.stopping) {
        fail(run, "the simulator counts %" PRIu64 " STEP frames, %" PRIu64 " refused, %" PRIu64
                  " malformed, the listener %" PRIu64 ", %" PRIu64 ", %" PRIu64,
             stats->lockstep.steps, stats->lockstep.mismatches, stats->lockstep.malformed,
             run->watch.steps, run->watch.refused, run->watch.malformed);
    }
    if (stats->events_lost + boards.events_lost > 0) {
        fail(run, "%" PRIu64 " events lost: a storm", stats->events_lost + boards.events_lost);
    }
    account(run);
#ifndef __SANITIZE_ADDRESS__
    if (run->pages_early && labs(pages - run->pages_early) > 16) {
        fail(run, "resident memory went from %ld to %ld pages within the part", run->pages_early,
             pages);
    }
#endif
}

/* ---- a part ---- */

static enum error_code write_faults(struct run *run, const struct totals *totals,
                                    struct error *error)
{
    double length_s = (double)run->ticks * 1e-3;
    uint64_t seed = random_bits(&run->random);

    lines_init(&run->lines, &run->rig, run->part->wire, seed, totals->kind);
    if (run->part->task) {
        return lines_add(&run->lines, TASK_FAULTS, 0.5, TASK_S, 1.0, error) ? ERROR_NONE
                                                                            : error->code;
    }
    for (double t = 0.0; t < length_s; t += ROUND_S) {
        double end = fmin(t + BROKEN_S, length_s);

        if (is_rude(run, (int64_t)(t * 1e9))) {
            /* frames that are taken for the host's may change any setting */
            lines_add_power_cycle(&run->lines, t + BROKEN_S - 0.5, t + BROKEN_S);
        }
        if (end - t > 4.0 && !lines_add(&run->lines, ROUND_FAULTS, t + 1.0, end, 2.0, error)) {
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
        .clock = RIG_CLOCK_LOCKSTEP,
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
    config.fault = run->lines.line;
    config.nfault = run->lines.count;
    code = code ? code : simulator_create(&config, &run->arena, &run->simulator, notice, error);
    code = code ? code : simulator_join(run->simulator, &run->watch.ports, error);
    code = code ? code : simulator_join(run->simulator, &run->stranger.ports, error);
    if (!code && !run->part->task) {
        code = simulator_join(run->simulator, &run->player.ports, error);
        code = code ? code : player_init(&run->player, &run->rig, seed, error);
    }
    return code;
}

static void prepare(struct run *run, uint64_t seed)
{
    run->last_ns = -1;
    run->watch.rig = run->stranger.rig = &run->rig;
    run->watch.wire = run->part->wire;
    run->watch.hash = HASH_START;
    run->random = random_named(seed, "run");
    run->stranger.random = random_named(seed, "stranger");
    run->odd = seed & 1;
    run->quiet_due_ns = 3 * SECOND;
    memcpy(run->held, run->rig.base_position, 3 * sizeof(double));
    memcpy(run->held + 3, run->rig.base_quaternion, 4 * sizeof(double));
    run->held[2] += 0.02;
}

static void close_all(struct run *run)
{
    bus_ports_close(&run->watch.ports);
    bus_ports_close(&run->stranger.ports);
    bus_ports_close(&run->player.ports);
    player_fini(&run->player);
    simulator_destroy(run->simulator);
    arena_fini(&run->arena);
}

static void add_up(struct totals *totals, const struct run *run, uint64_t ticks)
{
    totals->hash = hash_bytes(totals->hash, &run->watch.hash, sizeof run->watch.hash);
    totals->ticks += ticks;
    for (size_t b = 0; b < run->rig.nbus; b++) {
        totals->frames += run->watch.frames[b];
    }
    totals->faults += run->faults;
    totals->events += run->events;
    totals->switched_on += run->player.switched_on;
    totals->starts += run->player.starts;
    totals->strange += run->stranger.frames;
    totals->refused += run->watch.refused;
    totals->kind = run->lines.kind;
    for (size_t k = 0; k < LINE_KINDS_MAX; k++) {
        totals->of_kind[k] += run->lines.of_kind[k];
    }
}

static void print_part(const struct run *run, uint64_t ticks)
{
    uint64_t frames = 0;

    for (size_t b = 0; b < run->rig.nbus; b++) {
        frames += run->watch.frames[b];
    }
    printf("%-16s %7.2f s %10" PRIu64 " frames %4" PRIu64 " faults %6" PRIu64
           " events, switched on %5" PRIu64 ", started %3" PRIu64 ", hash %016" PRIx64 "\n",
           run->part->name, (double)ticks * 1e-3, frames, run->faults, run->events,
           run->player.switched_on, run->player.starts, run->watch.hash);
    fflush(stdout);
}

/* false with a message on stderr */
static bool run_part(struct totals *totals, uint64_t seed, uint64_t ticks, const char *record)
{
    static struct run run;
    const struct simulator_observer observer = {&run, step};
    struct realtime_report report;
    struct recorder_counters recorded;
    struct error error;
    uint64_t ran = 0;

    memset(&run, 0, sizeof run);
    run.part = &programme[totals->parts % PARTS];
    run.ticks = ticks;
    error.text[0] = '\0';
    if (!load_rig(&run, &error)) {
        prepare(&run, seed);
        if (!create(&run, totals, seed, record, &observer, &error) &&
            !simulator_start(run.simulator, &report, &error)) {
            check_end(&run, simulator_run(run.simulator));
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

/* ---- all parts ---- */

/* Nothing is left of a part: not a page, not a descriptor, not a thread. */
static bool check_leaks(struct totals *totals)
{
    int descriptors = entries("/proc/self/fd"), threads = entries("/proc/self/task");

    totals->pages_last = resident_pages();
    if (totals->parts == 0) {
        totals->descriptors = descriptors;
        totals->threads = threads;
    }
    if (!totals->pages_minute_2 && totals->ticks >= 120000) {
        totals->pages_minute_2 = totals->pages_last;
    }
    if (!totals->pages_first && totals->parts >= PARTS) {
        totals->pages_first = totals->pages_last; /* every part was there once */
    }
    if (descriptors != totals->descriptors || threads != totals->threads) {
        fprintf(stderr, "soak: %d descriptors and %d threads, expected %d and %d\n", descriptors,
                threads, totals->descriptors, totals->threads);
        return false;
    }
#ifndef __SANITIZE_ADDRESS__
    if (totals->pages_first && totals->pages_last - totals->pages_first > 32) {
        fprintf(stderr, "soak: resident memory grew from %ld to %ld pages\n", totals->pages_first,
                totals->pages_last);
        return false;
    }
#endif
    return true;
}

/* Every kind of fault had its turn. */
static bool check_kinds(const struct totals *totals)
{
    char help[256];

    for (size_t k = 0; k < faults_help(0, NULL, 0); k++) {
        if (totals->of_kind[k] == 0) {
            faults_help(k, help, sizeof help);
            fprintf(stderr, "soak: no fault of the kind %s\n", help);
            return false;
        }
    }
    return true;
}

static uint64_t part_ticks(const struct totals *totals, uint64_t wanted)
{
    const struct part *part = &programme[totals->parts % PARTS];
    /* rounds of half a minute: an hour has a dozen of long parts, five minutes have short ones */
    uint64_t rounds = wanted >= 1800000 ? 4 : 1;
    uint64_t ticks = part->task ? TASK_S * 1000 : rounds * ROUND_S * 1000;

    return ticks < wanted - totals->ticks ? ticks : wanted - totals->ticks;
}

static void print_totals(const struct totals *totals)
{
    const long kb = sysconf(_SC_PAGESIZE) / 1024;

    printf("soak: %" PRIu64 " ticks, %" PRIu64 " frames, %" PRIu64 " faults, %" PRIu64
           " strange frames, %" PRIu64 " STEP refused, %" PRIu64 " events, %" PRIu64
           " motors switched on again, %" PRIu64 " controllers started; RSS %ld kB after 2 min, %ld "
           "kB at the end; hash %016" PRIx64 "\n",
           totals->ticks, totals->frames, totals->faults, totals->strange, totals->refused,
           totals->events, totals->switched_on, totals->starts, totals->pages_minute_2 * kb,
           totals->pages_last * kb, totals->hash);
}

int main(int argc, char **argv)
{
    double seconds = argc > 1 ? strtod(argv[1], NULL) : 300.0;
    uint64_t seed = argc > 2 ? strtoull(argv[2], NULL, 10) : 1, wanted;
    const char *record = argc > 3 ? argv[3] : NULL;
    struct totals totals = {.hash = HASH_START};
    struct random_stream seeds = random_named(seed, "parts");

    if (!(seconds >= 1.0 && seconds <= 1e6)) {
        fprintf(stderr, "usage: soak_lockstep [SECONDS [SEED [RECORD-DIRECTORY]]]\n");
        return 2;
    }
    wanted = (uint64_t)(seconds * 1000.0);
    while (totals.ticks < wanted) {
        if (!check_leaks(&totals) || !run_part(&totals, random_bits(&seeds) >> 16,
                                               part_ticks(&totals, wanted),
                                               totals.parts == 0 ? record : NULL)) {
            return 1;
        }
        totals.parts++;
    }
    if (!check_leaks(&totals) || (totals.parts >= PARTS && !check_kinds(&totals))) {
        return 1;
    }
    print_totals(&totals);
    return 0;
}
