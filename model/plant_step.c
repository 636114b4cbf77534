/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Steps the plant: holds the command over a step and advances the substeps. Also has the external
 * settings (poses, pushes, clamp, supply) and queries.
 */
#include "model/plant.h"

#include "base/hash.h"
#include "model/implicit/implicit.h"
#include "model/integrator.h"
#include "model/plant_private.h"
#include "model/spatial.h"

#include <math.h>
#include <string.h>

static const char not_accurate[] = "dopri5 does not reach its tolerances: the model is too stiff "
                                   "for it, or an input is far out of range";
static const char diverged[] = "the state is no longer finite: the substep is too long for the "
                               "stiffness of the model, or an input is far out of range";

/* Inertia of a fixed rotor, kg m2. It is so large that the rotor's position stays bit-identical
 * with each integrator. */
#define JAMMED_INERTIA 1e30

/* Sets the parameters of a drive for its condition. Lost energy counts as friction. */
static void set_drive_condition(struct plant *plant, size_t d, unsigned condition)
{
    size_t j = plant->drive_joint[d];
    double before = plant_drive_energy(plant, plant->state, d);
    struct robot_sea *sea = &plant->sea[d];

    /* Stop a rotor that jams, becomes imposed or is released */
    if ((condition ^ plant->condition[d]) & (DRIVE_JAM | DRIVE_IMPOSED)) {
        plant->state[plant_drive_offset(plant, d) + DRIVE_MOTOR_SPEED] = 0.0;
    }
    plant->condition[d] = condition;
    plant->account.runs = false; /* parts that break or jam remove energy */
    plant->lost[plant_drive_offset(plant, d) + DRIVE_MOTOR_SPEED] = 0.0;

    /* Start from the parameters without faults, then remove the broken parts */
    *sea = plant->config.robot->joint[j].sea;
    if (condition & DRIVE_SPRING_BREAK) {
        sea->Ks = sea->Ds = 0.0;
        sea->stop = (struct robot_stop){0};
    }
    if (condition & (DRIVE_JAM | DRIVE_IMPOSED) || plant->balanced) {
        sea->J = JAMMED_INERTIA;
    }
    if (plant->config.account_energy) {
        plant->state[plant->at.work + WORK_FRICTION] +=
            before - plant_drive_energy(plant, plant->state, d);
    }
    if (plant->implicit) {
        implicit_refresh_drive(plant, d);
    }
}

void plant_balance(struct plant *plant, bool balanced)
{
    plant->balanced = balanced;
    plant->stepped = false;
    for (size_t d = 0; d < plant->ndrive; d++) {
        plant->state[plant_drive_offset(plant, d) + DRIVE_MOTOR_SPEED] = 0.0;
        set_drive_condition(plant, d, plant->condition[d]);
    }
}

/* Sets the command for the next steps. seconds: their total duration. */
static void hold_command(struct plant *plant, double seconds)
{
    double supply = plant_supply(plant);

    plant->has_loops = false;
    for (size_t d = 0; d < plant->ndrive; d++) {
        const struct motor_command *motor = &plant->command.motor[plant->drive_joint[d]];
        double given = motor->law.on ? plant->voltage[d] : motor->voltage_v;
        double asked = isnan(given) ? 0.0 : given;
        double voltage = asked > supply ? supply : asked > -supply ? asked : -supply;
        double *I = &plant->state[plant_drive_offset(plant, d) + DRIVE_CURRENT];
        bool shorted = motor->condition & DRIVE_SHORT, open = motor->condition & DRIVE_OPEN_PHASE;

        /* Set the voltage of the bridge at the winding */
        if (motor->condition != plant->condition[d]) {
            set_drive_condition(plant, d, motor->condition);
        }
        if (motor->condition & DRIVE_IMPOSED) {
            /* Set the speed of an imposed rotor. Its large inertia keeps the speed during the
             * steps */
            size_t speed = plant_drive_offset(plant, d) + DRIVE_MOTOR_SPEED;
            bool led = !(motor->condition & DRIVE_JAM) && !plant->balanced;

            plant->state[speed] = led && isfinite(motor->rotor_rad_s) ? motor->rotor_rad_s : 0.0;
            plant->lost[speed] = 0.0;
        }
        plant->bridge_on[d] = (motor->bridge_on || shorted) && !open;
        plant->voltage[d] = plant->bridge_on[d] && !shorted ? voltage : 0.0;
        if (motor->law.on || plant->loop[d].on) {
            plant_loop_hold(plant, d, supply);
        }

        /* An open bridge stops the current immediately: the winding's energy becomes heat */
        if (plant->has_effects) {
            plant_effects_hold(plant, d, supply);
        }
        if (!plant->bridge_on[d] && !(plant->has_effects && plant->bridge[d].conducts)) {
            if (plant->config.account_energy) {
                plant->state[plant->at.work + WORK_JOULE] += 0.5 * plant->sea[d].L * *I * *I;
            }
            *I = 0.0;
            plant->lost[plant_drive_offset(plant, d) + DRIVE_CURRENT] = 0.0;
        }
    }

    plant_hydraulic_hold(plant);

    /* Pretensions move at a constant rate and reach the command at the end of the steps */
    for (size_t s = 0; s < plant->nspring; s++) {
        double goal = plant->command.motor[plant->spring_joint[s]].pretension_m;

        plant->pretension_rate[s] = (goal - plant->state[plant->at.pretension + s]) / seconds;
    }
}

/* Sets pretensions exactly to the command, without integration errors. */
static void complete_pretensions(struct plant *plant)
{
    for (size_t s = 0; s < plant->nspring; s++) {
        plant->state[plant->at.pretension + s] =
            plant->command.motor[plant->spring_joint[s]].pretension_m;
    }
}

/* Checks whether the state is finite, except bristles of pairs that are not live. */
static bool state_is_finite(const struct plant *plant)
{
    const double *y = plant->state + plant->at.bristle;
    double sum = 0.0;

    /* 0 times a number that is not finite is NAN, so the sum becomes NAN */
#pragma GCC unroll 8
    for (size_t i = 0; i < plant->at.bristle; i++) {
        sum += 0.0 * plant->state[i];
    }
    for (size_t i = 0; i < plant->nlive; i++) {
        for (int k = 0; k < CONTACT_BRISTLE; k++) {
            sum += fabs(y[CONTACT_BRISTLE * (size_t)plant->live[i] + (size_t)k]);
        }
    }
    return isfinite(sum);
}

/* Integrates one substep with the integrator of the configuration. */
static enum error_code integrate_state(struct plant *plant, double h)
{
    const struct plant_config *config = &plant->config;
    size_t count = plant->at.count;

    if (config->integrator == PLANT_IMPLICIT) {
        return implicit_step(plant, h);
    }
    plant->step_code = ERROR_NONE;
    plant_effects_begin(plant);
    if (config->integrator == PLANT_RK4) {
        integrator_rk4(plant_derivative, plant, 0.0, h, count, plant->state, plant->lost,
                       plant->scratch);
    } else if (!integrator_dopri5(plant_derivative, plant, 0.0, h, count, plant->state,
                                  &plant->dopri5, plant->scratch) &&
               plant->step_code == ERROR_NONE) {
        plant->failure = not_accurate;
        return ERROR_INPUT;
    }
    plant_effects_end(plant);
    return plant->step_code;
}

/* Advances one substep; on failure state and time stay unchanged. */
static enum error_code advance_substep(struct plant *plant)
{
    enum error_code code;
    double h = 1e-9 * (double)plant->config.substep_ns;

    plant_keep_state(plant);
    if (plant->has_loops) {
        plant_loops_begin(plant);
    }
    code = integrate_state(plant, h);
    if (code == ERROR_NONE && !state_is_finite(plant)) {
        code = ERROR_INPUT;
        plant->failure = diverged;
    }
    if (code != ERROR_NONE) {
        plant_return_state(plant);
        return code;
    }
    /* Normalize the quaternions */
    if (plant->config.robot->floating) {
        plant_normalize_quaternion(plant->state + BASE_Q_QUATERNION);
    }
    plant_free_normalize(plant);
    plant->time_ns += plant->config.substep_ns;
    if (plant->has_loops) {
        plant_loops_end(plant, h);
    }
    plant_account_step(plant, h);
    return ERROR_NONE;
}

enum error_code plant_step(struct plant *plant, size_t steps)
{
    if (steps == 0) {
        return ERROR_NONE;
    }
    plant->stepped = false;
    plant_forget_peaks(plant);
    plant_list_bristles(plant);
    hold_command(plant, 1e-9 * (double)plant->config.substep_ns * (double)steps);
    for (size_t k = 0; k < steps; k++) {
        enum error_code code = advance_substep(plant);

        if (code != ERROR_NONE) {
            return code;
        }
    }
    complete_pretensions(plant);
    plant_drop_bristles(plant);
    plant->stepped = plant->config.integrator == PLANT_IMPLICIT && !plant->clamped;
    if (plant->handed_out) {
        plant_keep_state(plant); /* to detect later whether a caller has written the state */
    }
    return ERROR_NONE;
}

enum error_code plant_reset(struct plant *plant, const double base_position[3],
                            const double base_quaternion[4], const double *joint)
{
    const struct robot *robot = plant->config.robot;
    size_t njoint = robot->njoint;
    enum error_code code;

    /* Set the pose of the base and of the joints, at rest */
    memset(plant->state, 0, plant->at.count * sizeof *plant->state);
    memset(plant->lost, 0, plant->at.count * sizeof *plant->lost);
    plant->nlive = 0;
    if (robot->floating) {
        memcpy(plant->state, base_position, 3 * sizeof *base_position);
        memcpy(plant->state + BASE_Q_QUATERNION, base_quaternion, 4 * sizeof *base_quaternion);
        plant_normalize_quaternion(plant->state + BASE_Q_QUATERNION);
    }
    memcpy(plant->state + plant->at.v - njoint, joint, njoint * sizeof *joint);

    /* Reset the drives (no faults, relaxed springs), the pretensions (as commanded) and the free
     * bodies (at their starts) */
    for (size_t d = 0; d < plant->ndrive; d++) {
        plant->state[plant_drive_offset(plant, d) + DRIVE_MOTOR_POSITION] =
            joint[plant->drive_joint[d]];
        plant->voltage[d] = 0.0;
        plant->bridge_on[d] = false;
        plant->loop[d] = (struct current_loop){.on = false};
        plant->condition[d] = 0;
        plant->sea[d] = robot->joint[plant->drive_joint[d]].sea;
        if (plant->implicit) {
            implicit_refresh_drive(plant, d);
        }
    }
    complete_pretensions(plant);
    plant_free_reset(plant);
    plant_effects_reset(plant);
    plant_hydraulic_reset(plant);
    memset(plant->pretension_rate, 0, plant->nspring * sizeof *plant->pretension_rate);

    /* Remove external forces, and data of an earlier run */
    memset(plant->push, 0, (robot->nbody + plant->config.nfree) * sizeof *plant->push);
    plant->pushing = false;
    plant->stepped = false;
    plant->balanced = false;
    plant->time_ns = 0;
    plant->failure = "";
    plant->dopri5.next = plant->dopri5.last_error = 0.0;
    if (plant->implicit) {
        implicit_restart(plant);
    }

    code = plant_restart_energy(plant);
    return code == ERROR_NONE ? plant_sample(plant) : code;
}

void plant_set_push(struct plant *plant, int body, const double force[3], const double moment[3])
{
    size_t count = plant->config.robot->nbody + plant->config.nfree;

    memcpy(plant->push[body].force, force, sizeof plant->push[body].force);
    memcpy(plant->push[body].moment, moment, sizeof plant->push[body].moment);
    plant->stepped = false;
    plant->pushing = false;
    for (size_t b = 0; b < count; b++) {
        for (int i = 0; i < 3; i++) {
            plant->pushing |= plant->push[b].force[i] != 0.0 || plant->push[b].moment[i] != 0.0;
        }
    }
}

void plant_push(const struct plant *plant, int body, double size[2])
{
    size[0] = vec3_norm(plant->push[body].force);
    size[1] = vec3_norm(plant->push[body].moment);
}

void plant_set_source(struct plant *plant, double supply_v)
{
    plant->config.supply_v = supply_v;
}

double plant_source(const struct plant *plant)
{
    return plant->config.supply_v;
}

void plant_clamp(struct plant *plant, bool clamped)
{
    plant->clamped = clamped;
    plant->stepped = false;
    if (clamped) {
        memset(plant->state + plant->at.v, 0, plant->config.robot->nv * sizeof *plant->state);
        memset(plant->lost + plant->at.v, 0, plant->config.robot->nv * sizeof *plant->lost);
        if (plant->implicit) {
            implicit_restart(plant);
        }
    } else if (plant->balanced) {
        plant_balance(plant, false);
    }
}

bool plant_is_clamped(const struct plant *plant)
{
    return plant->clamped;
}

struct plant_command *plant_command(struct plant *plant)
{
    return &plant->command;
}

const char *plant_failure(const struct plant *plant)
{
    return plant->failure;
}

const double *plant_values(const struct plant *plant, size_t *count)
{
    *count = plant->at.count;
    return plant->state;
}

double *plant_state(struct plant *plant, size_t *count)
{
    *count = plant->at.count;
    if (!plant->handed_out) {
        plant_keep_state(plant);
        plant->handed_out = true;
    }
    return plant->state;
}

int64_t plant_time_ns(const struct plant *plant)
{
    return plant->time_ns;
}

uint64_t plant_hash(const struct plant *plant)
{
    uint64_t hash = hash_bytes(HASH_START, plant->state, plant->at.count * sizeof *plant->state);

    return hash_bytes(hash, &plant->time_ns, sizeof plant->time_ns);
}
