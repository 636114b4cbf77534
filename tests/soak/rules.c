/* SPDX-License-Identifier: Apache-2.0 */
/* What must hold in every tick of a part, and at its end. */
#include "base/hash.h"
#include "canbus/wire/wire.h"
#include "tests/soak/part.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

void part_fail(struct run *run, const char *format, ...)
{
    va_list args;

    if (!run->failure[0]) {
        va_start(args, format);
        vsnprintf(run->failure, sizeof run->failure, format, args);
        va_end(args);
        simulator_stop(run->simulator);
    }
}

long rules_resident_pages(void)
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

/* ---- before each tick ---- */

/* No current beyond what the supply and the rotor's back-EMF, at the fastest that it has been,
 * drive through the winding; speeds somehow bounded, for a light link whose broken spring is whole
 * again when it is a turn away flies; and nobody out of the room. */
static void check_plant(struct run *run)
{
    const struct plant_sensors *sensors = plant_sensors(simulator_plant(run->simulator));
    size_t count;
    const double *state = plant_state(simulator_plant(run->simulator), &count);

    for (size_t j = 0; j < sensors->njoint; j++) {
        const struct motor_sense *m = &sensors->motor[j];
        const struct robot_sea *sea = &run->rig.robot->joint[j].sea;
        double drop_v = sea->R * fabs(m->current_a);

        run->fastest[j] = fmax(run->fastest[j], fabs(m->qmd));
        if (!isfinite(m->q) || !isfinite(m->qm) || !isfinite(m->torque_nm) ||
            !(fabs(m->qd) < 1e4) || !(fabs(m->qmd) < 1e3) ||
            !(drop_v <= run->rig.supply_v + sea->Kw * run->fastest[j])) {
            part_fail(run, "joint %s: q %g, q' %g, qm %g, qm' %g, %g A, %g N m",
                      run->rig.robot->joint[j].name, m->q, m->qd, m->qm, m->qmd, m->current_a,
                      m->torque_nm);
        }
    }
    for (size_t i = 0; i < 3 && run->rig.robot->floating; i++) {
        if (!(fabs(state[i]) < 10.0)) {
            part_fail(run, "the base is at %g %g %g m", state[0], state[1], state[2]);
        }
    }
}

static void check_energy(struct run *run)
{
    struct plant_energy energy;

    if (plant_energy(simulator_plant(run->simulator), &energy)) {
        part_fail(run, "energy: %s", plant_failure(simulator_plant(run->simulator)));
    } else if (!isfinite(energy.balance) || !isfinite(energy.stored) ||
               !(fabs(energy.stored) < 1e4) || !(energy.joule_heat >= 0.0) ||
               !(energy.spring_damping >= 0.0)) {
        part_fail(run, "energy: %g J stored, %g J of heat, %g J unbalanced", energy.stored,
                  energy.joule_heat, energy.balance);
    }
}

/* What is published tells of this very tick, and no counter goes back. */
static void check_status(struct run *run, int64_t time_ns)
{
    struct simulator_status now;

    if (time_ns != (int64_t)run->listener.tick * run->rig.tick_ns) {
        part_fail(run, "virtual time is %" PRId64 " ns after %u ticks", time_ns,
                  run->listener.tick);
    }
    if (!simulator_read(run->simulator, &now)) {
        return; /* before the first tick */
    }
    if (now.tick != run->listener.tick || now.time_ns != time_ns) {
        part_fail(run, "status of tick %" PRIu64 " at tick %u", now.tick, run->listener.tick);
    }
    for (size_t b = 0; b < run->rig.nbus; b++) {
        struct bus_status *before = &run->before[b];

        if (now.bus[b].rx_frames < before->rx_frames || now.bus[b].tx_frames < before->tx_frames ||
            now.bus[b].rx_dropped < before->rx_dropped ||
            now.bus[b].tx_dropped < before->tx_dropped || now.bus[b].bits < before->bits) {
            part_fail(run, "a counter of bus %s went back", run->rig.bus[b].name);
        }
        *before = now.bus[b];
    }
}

static void count_faults(struct run *run)
{
    const struct faults *faults = simulator_parts(run->simulator).faults;

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

/* At the end of each round nothing has been broken for a while. What has been flung about may still
 * trip, but can be switched on. */
static void check_recovery(struct run *run, int64_t time_ns)
{
    int64_t healed_ns = time_ns - (ROUND_S - BROKEN_S) * SECOND + SECOND;
    char text[320];

    if (!player_all_back(&run->player, healed_ns, text, sizeof text)) {
        part_fail(run, "after the last fault %s", text);
    }
}

/* Whether a time with this period, counted from phase before it, lies between the last look and
 * now: a STEP may ask for several ticks. */
static bool is_time(const struct run *run, int64_t time_ns, int64_t period_ns, int64_t phase_ns)
{
    return run->last_ns >= 0 &&
           (time_ns + phase_ns) / period_ns != (run->last_ns + phase_ns) / period_ns;
}

void rules_check_tick(struct run *run, int64_t time_ns)
{
    check_plant(run);
    check_status(run, time_ns);
    take_events(run);
    if (is_time(run, time_ns, 10 * MS, 0)) {
        count_faults(run);
    }
    if (is_time(run, time_ns, SECOND, 0)) {
        uint64_t state = plant_hash(simulator_plant(run->simulator));

        run->listener.hash = hash_bytes(run->listener.hash, &state, sizeof state);
        check_energy(run);
    }
    if (!run->pages_early && time_ns >= 2 * SECOND) {
        run->pages_early = rules_resident_pages();
    }
    if (!run->part->task && is_time(run, time_ns, ROUND_S * SECOND, 10 * MS)) {
        check_recovery(run, time_ns);
    }
}

/* ---- after the run ---- */

/* Each frame that somebody has sent has passed the listener, or is counted as lost. */
static void account(struct run *run)
{
    for (size_t b = 0; b < run->rig.nbus && !run->part->task; b++) {
        const struct can_counters *boards = &simulator_port(run->simulator, b)->counters;
        const struct can_counters *player = &run->player.ports.port[b]->counters;
        const struct can_counters *intruder = &run->intruder.ports.port[b]->counters;
        const struct can_counters *listener = &run->listener.ports.port[b]->counters;
        const struct wire *wire = simulator_wire(run->simulator, b);
        uint64_t sent = boards->tx_frames + player->tx_frames + intruder->tx_frames;
        uint64_t seen = listener->rx_frames;

        if (wire) {
            struct wire_stats stats;

            wire_stats(wire, &stats);
            sent = stats.frames;
            seen = run->listener.frames[b];
        }
        if (sent != seen) {
            part_fail(run, "bus %s: %" PRIu64 " frames sent, %" PRIu64 " seen",
                      run->rig.bus[b].name, sent, seen);
        }
    }
}

void rules_check_end(struct run *run, enum loop_end end)
{
    const struct loop_stats *stats = simulator_stats(run->simulator);
    struct boards_counters boards;
    long pages = rules_resident_pages();

    boards_counters(simulator_parts(run->simulator).boards, &boards);
    if (!listener_check(&run->listener, run->part->task == NULL)) {
        part_fail(run, "%s", run->listener.failure);
    }
    if (end == LOOP_END_MODEL) {
        part_fail(run, "the model failed: %s", simulator_parts(run->simulator).failure);
    }
    if (!run->part->task && (end != LOOP_END_LENGTH || stats->ticks != run->ticks)) {
        part_fail(run, "ended after %" PRIu64 " of %" PRIu64 " ticks", stats->ticks, run->ticks);
    }
    if (stats->lockstep.steps != run->listener.steps ||
        stats->lockstep.mismatches != run->listener.refused ||
        stats->lockstep.malformed != run->listener.malformed || !run->listener.stopping) {
        part_fail(run,
                  "the simulator counts %" PRIu64 " STEP frames, %" PRIu64 " refused, %" PRIu64
                  " malformed, the listener %" PRIu64 ", %" PRIu64 ", %" PRIu64,
                  stats->lockstep.steps, stats->lockstep.mismatches, stats->lockstep.malformed,
                  run->listener.steps, run->listener.refused, run->listener.malformed);
    }
    /* A person may read some; three times what these faults have been seen to cause is a storm */
    if (run->events > 500 + stats->ticks / 2) {
        part_fail(run, "%" PRIu64 " events in %" PRIu64 " ms", run->events, stats->ticks);
    }
    if (stats->events_lost + boards.events_lost > 0) {
        part_fail(run, "%" PRIu64 " events lost: a storm", stats->events_lost + boards.events_lost);
    }
    account(run);
    if (PAGES_ARE_COUNTED && run->pages_early && labs(pages - run->pages_early) > 16) {
        part_fail(run, "resident memory went from %ld to %ld pages within the part",
                  run->pages_early, pages);
    }
}
