/* SPDX-License-Identifier: Apache-2.0 */
/* Simulates the plant of a rig with the commands of a recording. */

#include "app/identify/identify.h"

#include "model/plant.h"

#include <math.h>
#include <string.h>

/* Reserved address space for a plant with one joint, bytes. */
#define PLANT_BYTES ((size_t)1 << 22)

/* Duration over which the initial position of a recording is averaged, s. */
#define START_S 0.02

/* Completes a trial in place: sets the pointers to its own parts, and adds the arm's mass. Puts the
 * mount of the output in place: an inertia about the joint's axis without gravity, behind the
 * spring of a load cell at the angle `start`. Like the
 * reader of a robot file, it enables the effects only if one is set. */
static void settle_trial(struct trial_robot *trial, double start)
{
    static const struct robot_effects none;
    const struct bench_mount *mount = &trial->mount;

    if (mount->inertia_kg_m2 > 0.0) {
        trial->body[1].inertia = (struct robot_inertia){
            .mass = trial->body[1].inertia.mass,
            .I = {mount->inertia_kg_m2, 0.0, 0.0, mount->inertia_kg_m2, 0.0, mount->inertia_kg_m2}};
    }
    if (mount->lock_nm_rad > 0.0) {
        trial->joint.passive =
            (struct robot_passive){.stiffness = mount->lock_nm_rad, .rest = start};
    }
    if (trial->bench.arm_kg > 0.0) {
        struct robot_inertia *inertia = &trial->body[1].inertia;

        /* Both centers of mass lie on a line through the origin; apply the parallel axis theorem */
        static const int row[6] = {0, 0, 0, 1, 1, 2}, column[6] = {0, 1, 2, 1, 2, 2};
        const double total = inertia->mass + trial->bench.arm_kg, *c = inertia->com;
        const double apart =
            inertia->mass * trial->bench.arm_kg / total * 0.25 + trial->bench.arm_kg / 12.0;
        const double square = c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
        const double moved = (inertia->mass + 0.5 * trial->bench.arm_kg) / total;

        /* Add a uniform rod from the joint's axis, at the frame's origin, to the center of mass */
        for (int i = 0; i < 6; i++) {
            inertia->I[i] +=
                apart * ((row[i] == column[i] ? square : 0.0) - c[row[i]] * c[column[i]]);
        }
        for (int i = 0; i < 3; i++) {
            inertia->com[i] *= moved;
        }
        inertia->mass = total;
    }
    trial->robot.body = trial->body;
    trial->robot.joint = &trial->joint;
    trial->joint.sea.effects =
        memcmp(&trial->effects, &none, sizeof none) != 0 ? &trial->effects : NULL;
}

/* Creates the plant of a trial, at the start of a recording. */
static enum error_code make_plant(const struct rig *rig, const struct trial_robot *trial,
                                  double start, struct dynamics *dynamics, struct arena *arena,
                                  struct plant **plant, struct error *error)
{
    enum error_code code = dynamics_generic(&trial->robot, arena, dynamics, error);
    const struct plant_config config = {.robot = &trial->robot,
                                        .dynamics = dynamics,
                                        .integrator = rig->integrator,
                                        .substep_ns = rig->substep_ns,
                                        .rtol = rig->tolerance,
                                        .atol = rig->tolerance,
                                        .supply_v = rig->supply_v,
                                        .supply_ohm = rig->supply_ohm,
                                        .bus = rig->supply_bus};

    code = code ? code : plant_create(&config, arena, plant, error);
    if (!code && plant_reset(*plant, NULL, NULL, &start)) {
        code = error_set(error, ERROR_INPUT, "%s", plant_failure(*plant));
    }
    if (!code) {
        plant_clamp(*plant,
                    trial->mount.output == OUTPUT_LOCKED && trial->mount.lock_nm_rad == 0.0);
    }
    return code;
}

/* Returns the mean position at the start of a recording. */
static double start_position(const struct recording *r)
{
    const double *position = r->signal[SIGNAL_POSITION];
    double sum = 0.0;
    size_t count = 0;

    while (position && count < r->count && r->time[count] <= r->time[0] + START_S) {
        sum += position[count++];
    }
    return count > 0 ? sum / (double)count : 0.0;
}

/* Reads all signals of the plant in its present state. Returns false if the plant failed. */
static bool sense_signals(const struct trial_robot *trial, struct plant *plant,
                          double value[SIGNALS])
{
    const struct motor_sense *sense = plant_sensors(plant)->motor;
    const struct robot_passive *cell = &trial->joint.passive;

    if (plant_sample(plant) || !isfinite(sense->q)) {
        return false;
    }
    value[SIGNAL_POSITION] = sense->q - trial->bench.offset_rad;
    value[SIGNAL_LOAD_TORQUE] = trial->mount.lock_nm_rad > 0.0
                                    ? cell->stiffness * (sense->q - cell->rest)
                                    : sense->torque_nm;
    value[SIGNAL_DEFLECTION] = sense->qm - sense->q;
    value[SIGNAL_MOTOR_POSITION] = sense->qm - trial->bench.offset_rad;
    value[SIGNAL_CURRENT] = sense->current_a;
    value[SIGNAL_TEMPERATURE] = sense->winding_c;
    return true;
}

/* A host's loop about the torque of the spring: the torques of the last ticks, which exceed the
 * longest delay by the shortest tick, the torque that the host has, and its command. */
enum { TORQUES = 10002 };
struct torque_loop {
    double torque[TORQUES], told, correction, command, period;
};

/* Returns the time from which the command of a row holds. The first row is there from the start. */
static double command_time(const struct recording *r, size_t row)
{
    const double next = r->time[row + 1 < r->count ? row + 1 : row];

    return row == 0 ? r->time[0] : r->time[row] + r->command_at * (next - r->time[row]);
}

/* Runs the loop in a row that is `age` seconds old in tick k. */
static void run_torque_loop(const struct bench_law *law, const struct recording *r, size_t row,
                            double age, double tick, size_t k, struct torque_loop *loop)
{
    const size_t late =
        (size_t)fmin((age + law->torque_delay_s) / tick + 0.5, (double)(TORQUES - 1));
    const double period = floor((r->time[row] - r->time[0]) / law->torque_period_s);
    const double torque = late <= k ? loop->torque[(k - late) % TORQUES] : 0.0;

    loop->told += law->torque_share * (law->torque_gain * torque - loop->told);
    if (row == 0 || law->torque_period_s == 0.0 || period != loop->period) {
        loop->correction = law->torque_kp * (r->voltage[row] - loop->told);
        loop->correction =
            fmax(-law->torque_limit_nm, fmin(law->torque_limit_nm, loop->correction));
        loop->period = period;
    }
    loop->command = law->torque_feed_forward * r->voltage[row] + loop->correction;
}

/* Simulates the recording. */
static void run_plant(const struct rig *rig, const struct trial_robot *trial,
                      const struct bench_law *law, const struct recording *r, struct plant *plant,
                      struct simulated *out)
{
    const double tick = (double)rig->tick_ns * 1e-9,
                 supply = r->supply > 0.0 ? r->supply : rig->supply_v;
    const struct robot_sea *sea = &trial->joint.sea;
    struct motor_command *command = plant_command(plant)->motor;
    double value[2][SIGNALS] = {{0.0}};
    struct torque_loop loop = {.period = -1.0};
    size_t row = 0, begun = 0, next = 0;

    out->diverged |= !sense_signals(trial, plant, value[1]);
    for (size_t k = 0; next < r->count; k++) {
        const double now = r->time[0] + (double)k * tick;
        double duty;

        /* Take the rows whose commands hold from this tick on */
        loop.torque[k % TORQUES] = value[1][SIGNAL_LOAD_TORQUE];
        while (begun < r->count && command_time(r, begun) <= now - trial->bench.delay_s + 1e-9) {
            row = begun++;
            run_torque_loop(law, r, row, now - r->time[row], tick, k, &loop);
        }

        /* Set the command from a time on. row is the last row at that time; the position has the
         * recording's zero. */
        command->bridge_on = r->enabled[row];
        if (law->duty_per_rad > 0.0) {
            duty = law->duty_per_rad * r->gain * (r->goal[row] - value[1][SIGNAL_POSITION]);
            duty = fmax(-law->duty_max, fmin(law->duty_max, duty));
            command->voltage_v = duty * supply;
        } else {
            command->voltage_v =
                trial->bench.command_gain *
                (law->torque_kp > 0.0
                     ? loop.command
                     : r->voltage[r->voltage_before && row + 1 < r->count ? row + 1 : row]);
            if (r->command != COMMAND_VOLTAGE) {
                command->law = (struct current_law){
                    .on = true,
                    .current_a =
                        command->voltage_v / (r->command == COMMAND_TORQUE ? sea->Kt : 1.0),
                    .limit_a = INFINITY};
            }
        }
        memcpy(value[0], value[1], sizeof value[0]);
        out->diverged = out->diverged || plant_step(plant, rig->substeps) ||
                        !sense_signals(trial, plant, value[1]);
        /* Interpolate the times up to the end of the tick between the two positions */
        for (; next < r->count && r->time[next] <= now + tick; next++) {
            const double share = (r->time[next] - now) / tick;

            for (size_t i = 0; i < SIGNALS; i++) {
                if (out->signal[i]) {
                    out->signal[i][next] = value[0][i] + (value[1][i] - value[0][i]) * share;
                }
            }
        }
    }
}

enum error_code simulate_recording(const struct rig *rig, const struct trial_robot *given,
                                   const struct bench_law *law, const struct recording *recording,
                                   struct simulated *out, struct error *error)
{
    struct trial_robot trial = *given;
    struct dynamics dynamics;
    struct plant *plant;
    struct arena arena;
    double start;
    enum error_code code;

    if (recording->signal[SIGNAL_LOSS]) {
        point_simulate(given, recording, out);
        return ERROR_NONE;
    }
    if ((code = arena_init(&arena, PLANT_BYTES, error))) {
        return code;
    }
    out->diverged = false;
    parameter_take_group(&trial, recording->group);
    start = start_position(recording) + trial.bench.offset_rad;
    settle_trial(&trial, start);
    code = make_plant(rig, &trial, start, &dynamics, &arena, &plant, error);
    if (!code) {
        run_plant(rig, &trial, law, recording, plant, out);
    }
    arena_fini(&arena);
    return code;
}

struct simulation_error simulation_compare(const double *measured, const double *simulated,
                                           size_t count)
{
    struct simulation_error error = {0.0, 0.0, 0.0, 0.0};
    double power = 0.0;

    for (size_t i = 0; i < count; i++) {
        const double off = fabs(simulated[i] - measured[i]);

        error.mean += off / (double)count;
        error.rms += off * off / (double)count;
        error.worst = fmax(error.worst, off);
        power += measured[i] * measured[i] / (double)count;
    }
    error.rms = sqrt(error.rms);
    error.share = error.rms / sqrt(power);
    return error;
}
