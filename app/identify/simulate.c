/* SPDX-License-Identifier: Apache-2.0 */
/* Simulates the plant of a rig with the commands of a recording. */

#include "app/identify/identify.h"

#include "model/plant.h"

#include <math.h>
#include <string.h>

/* Reserved address space for a plant, bytes per joint. */
#define PLANT_BYTES ((size_t)1 << 22)

/* Brake that holds a joint whose drive is not identified, N m/rad and N m s/rad. */
static const struct robot_passive BRAKE = {.stiffness = 1e5, .damping = 100.0};

/* Duration over which the initial position of a recording is averaged, s. */
#define START_S 0.02

/* Adds a uniform rod from the joint's axis, at the frame's origin, to the center of mass. */
static void add_arm(double arm_kg, struct robot_inertia *inertia)
{
    /* Both centers of mass lie on a line through the origin; apply the parallel axis theorem */
    static const int row[6] = {0, 0, 0, 1, 1, 2}, column[6] = {0, 1, 2, 1, 2, 2};
    const double total = inertia->mass + arm_kg, *c = inertia->com;
    const double apart = inertia->mass * arm_kg / total * 0.25 + arm_kg / 12.0;
    const double square = c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
    const double moved = (inertia->mass + 0.5 * arm_kg) / total;

    for (int i = 0; i < 6; i++) {
        inertia->I[i] += apart * ((row[i] == column[i] ? square : 0.0) - c[row[i]] * c[column[i]]);
    }
    for (int i = 0; i < 3; i++) {
        inertia->com[i] *= moved;
    }
    inertia->mass = total;
}

/* Completes a trial in place: sets the pointers to its own parts, and adds the arm's mass. Adds the
 * mount of the output: an inertia about the joint's axis without gravity, and the spring of a load
 * cell at the angle `start`. As in a robot file, a drive has effects only if one is set. An output
 * that swings on the spring by more than 1 rad in a substep also gets effects, because the implicit
 * integrator's torque of a drive without effects would be up to four times too large. Brakes hold
 * the driven joints that are not identified. */
static void settle_trial(struct trial_robot *trial, double substep_s, const double *start)
{
    static const struct robot_effects none;
    const struct bench_mount *mount = &trial->mount;
    const bool light = mount->output == OUTPUT_INERTIA &&
                       trial->joint[0].sea.Ks * substep_s * substep_s > mount->inertia_kg_m2;

    if (mount->inertia_kg_m2 > 0.0) {
        trial->body[1].inertia = (struct robot_inertia){
            .mass = trial->body[1].inertia.mass,
            .I = {mount->inertia_kg_m2, 0.0, 0.0, mount->inertia_kg_m2, 0.0, mount->inertia_kg_m2}};
    }
    if (mount->lock_nm_rad > 0.0) {
        trial->joint[0].passive =
            (struct robot_passive){.stiffness = mount->lock_nm_rad, .rest = start[0]};
    }
    if (trial->bench[0].arm_kg > 0.0) {
        add_arm(trial->bench[0].arm_kg, &trial->body[1].inertia);
    }
    trial->robot.body = trial->body;
    trial->robot.joint = trial->joint;
    for (size_t j = 0; j < trial->robot.njoint; j++) {
        struct robot_joint *joint = &trial->joint[j];

        if (joint->sea.present || joint->hydraulic.present) {
            joint->sea.effects = light || memcmp(&trial->effects[j], &none, sizeof none) != 0
                                     ? &trial->effects[j]
                                     : NULL;
            if (trial->drive[j] < 0) {
                joint->sea.present = joint->hydraulic.present = false;
                joint->passive = BRAKE;
                joint->passive.rest = start[j];
            }
        }
    }
}

/* Creates the plant of a trial, at the start of a recording. */
static enum error_code make_plant(const struct rig *rig, const struct trial_robot *trial,
                                  const double *start, struct dynamics *dynamics,
                                  struct arena *arena, struct plant **plant, struct error *error)
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
    if (!code && plant_reset(*plant, NULL, NULL, start)) {
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

/* State of a host's torque loop. torque: the spring's torque in the last ticks; TORQUES is the
 * longest delay in the shortest ticks. told: the torque that the host measures. */
enum { TORQUES = 10002 };
struct torque_loop {
    double torque[TORQUES], told, correction, command, period;
};

/* A joint in a simulation: its recording, and its present row and signals. */
struct joint_run {
    const struct recording *r;
    const struct bench_numbers *bench;
    const struct robot_joint *joint;
    const struct motor_sense *sense;
    struct motor_command *command;
    struct torque_loop loop;
    struct simulated *out;
    double guide;             /* feedback of the measured position, unit of the command per rad */
    double lock_nm_rad;       /* stiffness of the load cell; 0 = no load cell */
    double value[2][SIGNALS]; /* at the begin and the end of the tick */
    size_t row, begun, next;  /* row of the command, of the next command, of the next time */
};

/* Reads the signals of a joint from the plant's sensors. Returns false if they are not finite. */
static bool sense_signals(struct joint_run *run)
{
    const struct motor_sense *sense = run->sense;
    double *value = run->value[1];

    value[SIGNAL_POSITION] = sense->q - run->bench->offset_rad;
    value[SIGNAL_LOAD_TORQUE] = run->lock_nm_rad > 0.0
                                    ? run->lock_nm_rad * (sense->q - run->joint->passive.rest)
                                    : sense->torque_nm;
    value[SIGNAL_DEFLECTION] = sense->qm - sense->q;
    value[SIGNAL_MOTOR_POSITION] = sense->qm - run->bench->offset_rad;
    value[SIGNAL_CURRENT] = sense->current_a;
    value[SIGNAL_TEMPERATURE] = sense->winding_c;
    return isfinite(sense->q);
}

/* Returns the time at which the command of a row comes into force. The command of the first row is
 * in force from the start. */
static double command_time(const struct recording *r, size_t row)
{
    const double next = r->time[row + 1 < r->count ? row + 1 : row];

    return row == 0 ? r->time[0] : r->time[row] + r->command_at * (next - r->time[row]);
}

/* Runs the torque loop once for a row. age: time from the row to tick k, s. */
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

/* Sets the command of a joint for tick k, which begins at `now`. */
static void command_joint(const struct rig *rig, const struct bench_law *law, struct joint_run *run,
                          size_t k, double now)
{
    const struct recording *r = run->r;
    const double supply = r->supply > 0.0 ? r->supply : rig->supply_v,
                 tick = (double)rig->tick_ns * 1e-9;
    struct motor_command *command = run->command;
    double duty, given;

    /* Take the rows whose commands hold from this tick on */
    run->loop.torque[k % TORQUES] = run->value[1][SIGNAL_LOAD_TORQUE];
    while (run->begun < r->count &&
           command_time(r, run->begun) <= now - run->bench->delay_s + 1e-9) {
        run->row = run->begun++;
        run_torque_loop(law, r, run->row, now - r->time[run->row], tick, k, &run->loop);
    }
    command->bridge_on = r->enabled[run->row];
    if (law->duty_per_rad > 0.0) {
        duty = law->duty_per_rad * r->gain * (r->goal[run->row] - run->value[1][SIGNAL_POSITION]);
        duty = fmax(-law->duty_max, fmin(law->duty_max, duty));
        command->voltage_v = duty * supply;
        return;
    }
    given =
        law->torque_kp > 0.0
            ? run->loop.command
            : r->voltage[r->voltage_before && run->row + 1 < r->count ? run->row + 1 : run->row];
    command->voltage_v = run->bench->command_gain * given;
    if (run->guide > 0.0) {
        command->voltage_v +=
            run->guide * (r->signal[SIGNAL_POSITION][run->row] - run->value[1][SIGNAL_POSITION]);
    }
    if (r->command != COMMAND_VOLTAGE) {
        command->law = (struct current_law){
            .on = true,
            .current_a =
                command->voltage_v / (r->command == COMMAND_TORQUE ? run->joint->sea.Kt : 1.0),
            .limit_a = INFINITY};
    }
}

/* Interpolates the signals between the ends of a tick, at the times of the rows up to the tick's
 * end. */
static void take_rows(struct joint_run *run, double now, double tick)
{
    const struct recording *r = run->r;

    for (; run->next < r->count && r->time[run->next] <= now + tick; run->next++) {
        const double share = (r->time[run->next] - now) / tick;

        for (size_t i = 0; i < SIGNALS; i++) {
            if (run->out->signal[i]) {
                run->out->signal[i][run->next] =
                    run->value[0][i] + (run->value[1][i] - run->value[0][i]) * share;
            }
        }
    }
}

/* Simulates the recordings of `count` joints. */
static void run_plant(const struct rig *rig, const struct bench_law *law, struct plant *plant,
                      struct joint_run *run, size_t count)
{
    const double tick = (double)rig->tick_ns * 1e-9;
    double begin = INFINITY;
    bool diverged = plant_sample(plant) != ERROR_NONE, done = false;

    for (size_t i = 0; i < count; i++) {
        begin = fmin(begin, run[i].r->time[0]);
        diverged |= !sense_signals(&run[i]);
    }
    for (size_t k = 0; !done; k++) {
        const double now = begin + (double)k * tick;

        for (size_t i = 0; i < count; i++) {
            command_joint(rig, law, &run[i], k, now);
            memcpy(run[i].value[0], run[i].value[1], sizeof run[i].value[0]);
        }
        diverged = diverged || plant_step(plant, rig->substeps) || plant_sample(plant);
        done = true;
        for (size_t i = 0; i < count; i++) {
            diverged = diverged || !sense_signals(&run[i]);
            take_rows(&run[i], now, tick);
            done &= run[i].next == run[i].r->count;
        }
    }
    for (size_t i = 0; i < count; i++) {
        run[i].out->diverged = diverged;
    }
}

enum error_code simulate_recording(const struct rig *rig, const struct trial_robot *given,
                                   const struct bench_law *law, const struct recording *recording,
                                   struct simulated *out, struct error *error)
{
    struct trial_robot trial = *given;
    struct joint_run *run;
    struct dynamics dynamics;
    struct plant *plant;
    struct arena arena;
    double start[TRIAL_JOINTS_MAX];
    enum error_code code;

    if (recording->signal[SIGNAL_LOSS]) {
        point_simulate(given, recording, out);
        return ERROR_NONE;
    }
    if ((code = arena_init(&arena, (trial.robot.njoint + 1) * PLANT_BYTES, error))) {
        return code;
    }
    parameter_take_group(&trial, recording->group);
    memcpy(start, rig->joint, trial.robot.njoint * sizeof *start);
    for (size_t i = 0; i < trial.njoint; i++) {
        start[trial.at[i]] = start_position(&recording[i]) + trial.bench[trial.at[i]].offset_rad;
    }
    settle_trial(&trial, 1e-9 * (double)rig->substep_ns, start);
    code = make_plant(rig, &trial, start, &dynamics, &arena, &plant, error);
    run = arena_alloc(&arena, trial.njoint, sizeof *run);
    if (!code && !run) {
        code = error_set(error, ERROR_MEMORY, "no memory for a simulation");
    }
    for (size_t i = 0; i < trial.njoint && !code; i++) {
        const int j = trial.at[i];

        run[i] = (struct joint_run){.r = &recording[i],
                                    .bench = &trial.bench[j],
                                    .joint = &trial.joint[j],
                                    .sense = &plant_sensors(plant)->motor[j],
                                    .command = &plant_command(plant)->motor[j],
                                    .out = &out[i],
                                    .lock_nm_rad = trial.mount.lock_nm_rad};
        for (size_t k = 0; k < recording[i].count && recording[i].signal[SIGNAL_POSITION]; k++) {
            run[i].guide = fmax(run[i].guide, trial.guide * fabs(recording[i].voltage[k]));
        }
    }
    if (!code) {
        run_plant(rig, law, plant, run, trial.njoint);
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
