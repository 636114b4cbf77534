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

/* Completes a trial in place: sets the pointers to its own parts, and adds the arm's mass. Like the
 * reader of a robot file, it enables the effects only if one is set. */
static void settle_trial(struct trial_robot *trial)
{
    static const struct robot_effects none;

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
    return code;
}

/* Index in the plant's state, after the joint's angle and rate. */
enum { STATE_MOTOR_SPEED = 2 + DRIVE_MOTOR_SPEED, STATE_CURRENT = 2 + DRIVE_CURRENT };

/* Returns the mean position at the start of a recording. */
static double start_position(const struct recording *r)
{
    double sum = 0.0;
    size_t count = 0;

    while (count < r->count && r->time[count] <= r->time[0] + START_S) {
        sum += r->position[count++];
    }
    return sum / (double)count;
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
    double *state, before, after, current[2];
    size_t length, row = 0, next = 0;

    state = plant_state(plant, &length);
    before = after = state[0] - trial->bench.offset_rad;
    current[0] = current[1] = state[STATE_CURRENT];
    for (size_t k = 0; next < r->count; k++) {
        const double now = r->time[0] + (double)k * tick;
        double duty;

        /* Interpolate the times up to the end of the tick between the two positions */
        while (row + 1 < r->count && r->time[row + 1] <= now - trial->bench.delay_s + 1e-9) {
            row++;
        }

        /* Set the command from a time on. row is the last row at that time; `after` has the
         * recording's zero. */
        command->bridge_on = r->enabled[row];
        if (law->duty_per_rad > 0.0) {
            duty = law->duty_per_rad * r->gain * (r->goal[row] - after);
            duty = fmax(-law->duty_max, fmin(law->duty_max, duty));
            command->voltage_v = duty * supply;
        } else {
            command->voltage_v =
                r->voltage[r->voltage_before && row + 1 < r->count ? row + 1 : row];
            if (r->is_torque) {
                /* The voltage at which a current loop holds the current for this torque */
                command->voltage_v =
                    sea->R * command->voltage_v / sea->Kt + sea->Kw * state[STATE_MOTOR_SPEED];
            }
        }
        before = after;
        current[0] = current[1];
        if (!out->diverged && !plant_step(plant, rig->substeps) && isfinite(state[0])) {
            after = state[0] - trial->bench.offset_rad;
            current[1] = state[STATE_CURRENT];
        } else {
            out->diverged = true;
        }
        for (; next < r->count && r->time[next] <= now + tick; next++) {
            const double share = (r->time[next] - now) / tick;

            out->position[next] = before + (after - before) * share;
            if (out->current) {
                out->current[next] = current[0] + (current[1] - current[0]) * share;
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
    enum error_code code = arena_init(&arena, PLANT_BYTES, error);

    if (code) {
        return code;
    }
    out->diverged = false;
    settle_trial(&trial);
    code = make_plant(rig, &trial, start_position(recording) + trial.bench.offset_rad, &dynamics,
                      &arena, &plant, error);
    if (!code) {
        run_plant(rig, &trial, law, recording, plant, out);
    }
    arena_fini(&arena);
    return code;
}

struct simulation_error simulation_compare(const struct recording *recording,
                                           const double *position)
{
    struct simulation_error error = {0.0, 0.0, 0.0};
    const double count = (double)recording->count;

    for (size_t i = 0; i < recording->count; i++) {
        const double off = fabs(position[i] - recording->position[i]);

        error.mean += off / count;
        error.rms += off * off / count;
        error.worst = fmax(error.worst, off);
    }
    error.rms = sqrt(error.rms);
    return error;
}
