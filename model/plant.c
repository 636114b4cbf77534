/* SPDX-License-Identifier: Apache-2.0 */
/* The plant: making it, its right-hand side, and stepping it. */
#include "model/plant.h"

#include "base/hash.h"
#include "model/implicit.h"
#include "model/integrator.h"
#include "model/plant_private.h"
#include "model/spatial.h"

#include <math.h>
#include <string.h>

/* Position of the base quaternion in q. */
enum { QUATERNION = 3 };

/* Steps that dopri5 may try for one substep. */
enum { DOPRI5_TRIES = 100000 };

static const char not_accurate[] = "dopri5 does not reach its tolerances: the model is too stiff "
                                   "for it, or an input is out of all "
                                   "bounds";
static const char diverged[] =
    "the state is no longer finite: the substep is too long for the stiffness of the model, or an "
    "input is out of all bounds";

void plant_normalize_quaternion(double quaternion[4])
{
    double norm = sqrt(quaternion[0] * quaternion[0] + quaternion[1] * quaternion[1] +
                       quaternion[2] * quaternion[2] + quaternion[3] * quaternion[3]);

    for (int i = 0; i < 4; i++) {
        quaternion[i] /= norm;
    }
}

void plant_place(struct plant *plant, const double *state)
{
    const struct robot *robot = plant->config.robot;

    memcpy(plant->q, state, robot->nq * sizeof *state);
    if (robot->floating) {
        plant_normalize_quaternion(plant->q + QUATERNION);
    }
    plant_free_place(plant, state);
}

/* Adds a world-frame wrench to what acts on a body; returns its power. */
static double apply_wrench(const struct body_motion *motion, const double force[3],
                           const double moment[3], struct wrench *ext)
{
    double f[3], n[3];

    mat3_apply_transposed(motion->R, force, f);
    mat3_apply_transposed(motion->R, moment, n);
    for (int i = 0; i < 3; i++) {
        ext->force[i] += f[i];
        ext->moment[i] += n[i];
    }
    return vec3_dot(force, motion->v) + vec3_dot(moment, motion->w);
}

void plant_apply_loads(struct plant *plant, const double *v, struct plant_load *load)
{
    const struct plant_config *config = &plant->config;
    size_t nbody = config->robot->nbody, count = nbody + config->nfree;

    memset(plant->ext, 0, count * sizeof *plant->ext);
    for (size_t c = 0; c < config->ncontact; c++) {
        const struct contact_wrench *wrench = &plant->contact_wrench[c];
        int body = config->contact_body[c];

        load->contact +=
            apply_wrench(&plant->motion[body], wrench->force, wrench->moment, &plant->ext[body]);
    }
    if (plant->pushing) {
        plant->whole.ops->kinematics(&plant->whole, plant->q, v, plant->whole_motion);
        for (size_t b = 0; b < count; b++) {
            load->push += apply_wrench(b < nbody ? &plant->whole_motion[b] : &plant->motion[b],
                                       plant->push[b].force, plant->push[b].moment, &plant->ext[b]);
        }
    }
}

/* torques of drives and parallel springs on the joints */
static void apply_actuators(struct plant *plant, const double *state)
{
    const struct robot *robot = plant->config.robot;

    memset(plant->tau, 0, robot->njoint * sizeof *plant->tau);
    for (size_t d = 0; d < plant->ndrive; d++) {
        size_t j = plant->drive_joint[d];
        struct sea_state drive = plant_drive_state(plant, state, d);

        plant->tau[j] += sea_torque(&plant->sea[d], &drive, plant_joint_position(plant, state, j),
                                    plant_joint_rate(plant, state, j));
    }
    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];

        plant->tau[j] += parallel_spring_torque(
            &robot->joint[j].spring, state[plant->at.pretension + s], plant->pretension_rate[s],
            plant_joint_position(plant, state, j), plant_joint_rate(plant, state, j));
    }
}

/* in the jig: no acceleration, and no wrench on the robot unless it stands on its own; what acts on
 * free bodies stays */
static void feel_jig(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;

    memset(plant->vdot, 0, robot->nv * sizeof *plant->vdot);
    if (plant->balanced) {
        return;
    }
    memset(plant->ext, 0, robot->nbody * sizeof *plant->ext);
    for (size_t c = 0; c < plant->config.ncontact; c++) {
        if ((size_t)plant->config.contact_body[c] < robot->nbody) {
            plant->contact_wrench[c] = (struct contact_wrench){0};
        }
    }
}

enum error_code plant_load_bodies(struct plant *plant, const double *state, struct plant_load *load)
{
    enum error_code code = ERROR_NONE;

    plant_place(plant, state);
    *load = (struct plant_load){0.0, 0.0};
    if (plant->clamped && !plant->balanced && plant->config.nfree == 0) {
        return ERROR_NONE;
    }
    if (plant->config.contact) {
        code = plant_contact_evaluate(plant, state + plant->at.v);
    }
    if (code == ERROR_NONE) {
        plant_apply_loads(plant, state + plant->at.v, load);
    }
    return code;
}

enum error_code plant_evaluate(struct plant *plant, const double *state, struct plant_load *load)
{
    const struct dynamics *dynamics = plant->config.dynamics;
    const double *v = state + plant->at.v;
    bool loaded = plant->config.contact || plant->pushing;
    enum error_code code = plant_load_bodies(plant, state, load);

    if (code != ERROR_NONE) {
        return code;
    }
    if (plant->clamped) {
        feel_jig(plant);
        return ERROR_NONE;
    }
    apply_actuators(plant, state);
    dynamics->ops->forward(dynamics, plant->q, v, plant->tau, loaded ? plant->ext : NULL,
                           plant->vdot);
    return ERROR_NONE;
}

/* the drives' states and, with them, where their power goes */
static void derive_drives(const struct plant *plant, const double *state, double *derivative,
                          double *work)
{
    for (size_t d = 0; d < plant->ndrive; d++) {
        size_t j = plant->drive_joint[d];
        const struct robot_sea *sea = &plant->sea[d];
        double q = plant_joint_position(plant, state, j), qd = plant_joint_rate(plant, state, j);
        double *out = derivative + plant->at.drive + 3 * d;
        struct sea_state drive = plant_drive_state(plant, state, d), rate;

        sea_derivative(sea, &drive, q, qd, plant->voltage[d], plant->bridge_on[d], &rate);
        out[0] = rate.qm;
        out[1] = rate.qmd;
        out[2] = rate.I;
        if (work) {
            struct sea_power power;

            sea_power(sea, &drive, qd, plant->voltage[d], &power);
            work[WORK_ELECTRICAL] += power.electrical;
            work[WORK_JOULE] += power.joule;
            work[WORK_FRICTION] += power.friction;
            work[WORK_SPRING_DAMPING] += power.spring_damping;
        }
    }
}

/* the same for the parallel springs, whose winches move at a given rate */
static void derive_springs(const struct plant *plant, const double *state, double *derivative,
                           double *work)
{
    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];
        const struct robot_parallel_spring *spring = &plant->config.robot->joint[j].spring;
        double q = plant_joint_position(plant, state, j), qd = plant_joint_rate(plant, state, j);
        double p = state[plant->at.pretension + s], pd = plant->pretension_rate[s];

        derivative[plant->at.pretension + s] = pd;
        if (work) {
            work[WORK_PRETENSION] += pd * parallel_spring_force(spring, p, pd, q, qd);
            work[WORK_PARALLEL_DAMPING] += parallel_spring_damping(spring, p, pd, q, qd);
        }
    }
}

/* integrator_function; a failure is left in plant->failure and the slope is then zero */
static void derive(void *context, double t, const double *state, double *derivative)
{
    struct plant *plant = context;
    const struct robot *robot = plant->config.robot;
    double *work = plant->config.account_energy ? derivative + plant->at.work : NULL;
    struct plant_load load;

    (void)t; /* the command is held, so time does not enter */
    memset(derivative, 0, plant->at.count * sizeof *derivative);
    if (plant->step_code != ERROR_NONE) {
        return;
    }
    plant->step_code = plant_evaluate(plant, state, &load);
    if (plant->step_code != ERROR_NONE) {
        return;
    }
    dynamics_qdot(robot, plant->q, state + plant->at.v, derivative);
    memcpy(derivative + plant->at.v, plant->vdot, robot->nv * sizeof *derivative);
    derive_drives(plant, state, derivative, work);
    derive_springs(plant, state, derivative, work);
    plant_free_derive(plant, state, derivative);
    if (work) {
        work[WORK_CONTACT] = load.contact;
        work[WORK_PUSH] = load.push;
    }
}

/* A rotor that is held fast is one of this inertia, kg m2: whatever the integrator, it keeps its
 * place to the last bit. */
#define JAMMED_INERTIA 1e30

/* Changes what a drive is; the energy that is gone with it counts as friction. */
static void set_condition(struct plant *plant, size_t d, unsigned condition)
{
    size_t j = plant->drive_joint[d];
    struct sea_state drive = plant_drive_state(plant, plant->state, d);
    double q = plant_joint_position(plant, plant->state, j);
    double before = sea_energy(&plant->sea[d], &drive, q);
    struct robot_sea *sea = &plant->sea[d];

    if ((condition ^ plant->condition[d]) & DRIVE_JAM) {
        drive.qmd = 0.0;
        plant->state[plant->at.drive + 3 * d + 1] = 0.0;
    }
    plant->condition[d] = condition;
    plant->lost[plant->at.drive + 3 * d + 1] = 0.0;
    *sea = plant->config.robot->joint[j].sea;
    if (condition & DRIVE_SPRING_BREAK) {
        sea->Ks = sea->Ds = 0.0;
    }
    if (condition & DRIVE_JAM || plant->balanced) {
        sea->J = JAMMED_INERTIA;
    }
    if (plant->config.account_energy) {
        plant->state[plant->at.work + WORK_FRICTION] += before - sea_energy(sea, &drive, q);
    }
}

void plant_balance(struct plant *plant, bool balanced)
{
    plant->balanced = balanced;
    plant->stepped = false;
    for (size_t d = 0; d < plant->ndrive; d++) {
        plant->state[plant->at.drive + 3 * d + 1] = 0.0;
        set_condition(plant, d, plant->condition[d]);
    }
}

/* V of V = source - R P / V, where P is what the bridges take; half of the source when it cannot
 * give so much. */
double plant_supply(const struct plant *plant)
{
    double source = fmax(0.0, plant->config.supply_v - plant->command.supply_sag_v), power = 0.0;
    double rest;

    if (plant->config.supply_ohm == 0.0) {
        return source;
    }
    for (size_t d = 0; d < plant->ndrive; d++) {
        power += plant->voltage[d] * plant->state[plant->at.drive + 3 * d + 2];
    }
    rest = 0.25 * source * source - plant->config.supply_ohm * power;
    return 0.5 * source + sqrt(fmax(0.0, rest));
}

/* takes the command over for the coming steps, of seconds in all */
static void hold_command(struct plant *plant, double seconds)
{
    double supply = plant_supply(plant);

    for (size_t d = 0; d < plant->ndrive; d++) {
        const struct motor_command *motor = &plant->command.motor[plant->drive_joint[d]];
        double voltage = isnan(motor->voltage_v) ? 0.0 : motor->voltage_v;
        double *I = &plant->state[plant->at.drive + 3 * d + 2];
        bool shorted = motor->condition & DRIVE_SHORT, open = motor->condition & DRIVE_OPEN_PHASE;

        if (motor->condition != plant->condition[d]) {
            set_condition(plant, d, motor->condition);
        }
        plant->bridge_on[d] = (motor->bridge_on || shorted) && !open;
        plant->voltage[d] =
            plant->bridge_on[d] && !shorted ? fmax(-supply, fmin(supply, voltage)) : 0.0;
        if (!plant->bridge_on[d]) {
            if (plant->config.account_energy) {
                plant->state[plant->at.work + WORK_JOULE] += 0.5 * plant->sea[d].L * *I * *I;
            }
            *I = 0.0;
            plant->lost[plant->at.drive + 3 * d + 2] = 0.0;
        }
    }
    for (size_t s = 0; s < plant->nspring; s++) {
        double goal = plant->command.motor[plant->spring_joint[s]].pretension_m;

        plant->pretension_rate[s] = (goal - plant->state[plant->at.pretension + s]) / seconds;
    }
}

/* pretensions are now exactly as commanded, free of the integration's rounding */
static void settle_pretensions(struct plant *plant)
{
    for (size_t s = 0; s < plant->nspring; s++) {
        plant->state[plant->at.pretension + s] =
            plant->command.motor[plant->spring_joint[s]].pretension_m;
    }
}

static bool all_finite(const double *value, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(value[i])) {
            return false;
        }
    }
    return true;
}

/* one substep with the integrator of the configuration */
static enum error_code integrate(struct plant *plant, double h)
{
    const struct plant_config *config = &plant->config;
    size_t count = plant->at.count;

    if (config->integrator == PLANT_IMPLICIT) {
        return implicit_step(plant, h);
    }
    plant->step_code = ERROR_NONE;
    if (config->integrator == PLANT_RK4) {
        integrator_rk4(derive, plant, 0.0, h, count, plant->state, plant->lost, plant->scratch);
    } else if (!integrator_dopri5(derive, plant, 0.0, h, count, plant->state, &plant->dopri5,
                                  plant->scratch) &&
               plant->step_code == ERROR_NONE) {
        plant->failure = not_accurate;
        return ERROR_INPUT;
    }
    return plant->step_code;
}

static enum error_code substep(struct plant *plant)
{
    enum error_code code;
    size_t count = plant->at.count;
    double h = 1e-9 * (double)plant->config.substep_ns;

    memcpy(plant->last_good, plant->state, count * sizeof *plant->state);
    code = integrate(plant, h);
    if (code == ERROR_NONE && !all_finite(plant->state, count)) {
        code = ERROR_INPUT;
        plant->failure = diverged;
    }
    if (code != ERROR_NONE) {
        memcpy(plant->state, plant->last_good, count * sizeof *plant->state);
        return code;
    }
    if (plant->config.robot->floating) {
        plant_normalize_quaternion(plant->state + QUATERNION);
    }
    plant_free_normalize(plant);
    plant->time_ns += plant->config.substep_ns;
    return ERROR_NONE;
}

enum error_code plant_step(struct plant *plant, size_t steps)
{
    if (steps == 0) {
        return ERROR_NONE;
    }
    plant->stepped = false;
    hold_command(plant, 1e-9 * (double)plant->config.substep_ns * (double)steps);
    for (size_t k = 0; k < steps; k++) {
        enum error_code code = substep(plant);

        if (code != ERROR_NONE) {
            return code;
        }
    }
    settle_pretensions(plant);
    plant->stepped = plant->config.integrator == PLANT_IMPLICIT && !plant->clamped;
    memcpy(plant->last_good, plant->state, plant->at.count * sizeof *plant->state);
    return ERROR_NONE;
}

enum error_code plant_reset(struct plant *plant, const double base_position[3],
                            const double base_quaternion[4], const double *joint)
{
    const struct robot *robot = plant->config.robot;
    size_t njoint = robot->njoint;
    enum error_code code;

    memset(plant->state, 0, plant->at.count * sizeof *plant->state);
    memset(plant->lost, 0, plant->at.count * sizeof *plant->lost);
    if (robot->floating) {
        memcpy(plant->state, base_position, 3 * sizeof *base_position);
        memcpy(plant->state + QUATERNION, base_quaternion, 4 * sizeof *base_quaternion);
        plant_normalize_quaternion(plant->state + QUATERNION);
    }
    memcpy(plant->state + plant->at.v - njoint, joint, njoint * sizeof *joint);
    for (size_t d = 0; d < plant->ndrive; d++) {
        plant->state[plant->at.drive + 3 * d] = joint[plant->drive_joint[d]];
        plant->voltage[d] = 0.0;
        plant->bridge_on[d] = false;
        plant->condition[d] = 0;
        plant->sea[d] = robot->joint[plant->drive_joint[d]].sea;
    }
    settle_pretensions(plant);
    plant_free_reset(plant);
    memset(plant->pretension_rate, 0, plant->nspring * sizeof *plant->pretension_rate);
    memset(plant->push, 0, (robot->nbody + plant->config.nfree) * sizeof *plant->push);
    plant->pushing = false;
    plant->stepped = false;
    plant->balanced = false;
    plant->time_ns = 0;
    plant->failure = "";
    plant->dopri5.next = plant->dopri5.last_error = 0.0;
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

double *plant_state(struct plant *plant, size_t *count)
{
    *count = plant->at.count;
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

/* What the plant reads of a body must be among what the dynamics computes. */
static enum error_code check_observed(const struct robot *robot, int body, const char *what,
                                      struct error *error)
{
    if (body < 0 || (size_t)body >= robot->nbody) {
        return error_set(error, ERROR_INPUT, "%s is on body %d, but %s has bodies 0 to %zu", what,
                         body, robot->name, robot->nbody - 1);
    }
    if (!robot->body[body].observed) {
        return error_set(error, ERROR_INPUT, "%s is on body %s, which %s does not mark as observed",
                         what, robot->body[body].name, robot->name);
    }
    return ERROR_NONE;
}

static enum error_code check_contact(const struct plant_config *config, int body,
                                     struct error *error)
{
    size_t nbody = config->robot->nbody;

    if (body >= 0 && (size_t)body >= nbody + config->nfree && config->nfree > 0) {
        return error_set(error, ERROR_INPUT,
                         "a contact surface is on body %d, but %s has bodies 0 to %zu and free "
                         "ones follow up to %zu",
                         body, config->robot->name, nbody - 1, nbody + config->nfree - 1);
    }
    if (body >= 0 && (size_t)body >= nbody && config->nfree > 0) {
        return ERROR_NONE;
    }
    return check_observed(config->robot, body, "a contact surface", error);
}

static enum error_code check_bodies(const struct plant_config *config, struct error *error)
{
    const struct robot *robot = config->robot;
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < config->nfree && code == ERROR_NONE; i++) {
        code = plant_check_free_body(&config->free[i], error);
    }
    for (size_t c = 0; c < config->ncontact && code == ERROR_NONE; c++) {
        code = check_contact(config, config->contact_body[c], error);
    }
    for (size_t f = 0; f < robot->nft && code == ERROR_NONE; f++) {
        code = check_observed(robot, robot->frame[robot->ft[f].frame].body, "a force-torque sensor",
                              error);
    }
    if (robot->imu_frame >= 0 && code == ERROR_NONE) {
        code = check_observed(robot, robot->frame[robot->imu_frame].body, "the inertial sensor",
                              error);
    }
    return code;
}

static enum error_code check_config(const struct plant_config *config, struct error *error)
{
    if (config->dynamics->robot != config->robot) {
        return error_set(error, ERROR_INPUT, "the dynamics are not those of robot %s",
                         config->robot->name);
    }
    if (config->integrator != PLANT_RK4 && config->integrator != PLANT_IMPLICIT &&
        config->integrator != PLANT_DOPRI5) {
        return error_set(error, ERROR_INPUT, "there is no integrator %d", (int)config->integrator);
    }
    if (config->integrator == PLANT_IMPLICIT && config->contact &&
        !config->contact->ops->tangents) {
        return error_set(error, ERROR_UNSUPPORTED,
                         "contact engine %s gives no tangents, which the implicit integrator needs",
                         config->contact->ops->name);
    }
    if (config->integrator == PLANT_DOPRI5 && !(config->rtol > 0.0 && config->atol > 0.0)) {
        return error_set(error, ERROR_INPUT, "tolerances are %g and %g, expected more than 0",
                         config->rtol, config->atol);
    }
    if (config->substep_ns <= 0) {
        return error_set(error, ERROR_INPUT, "the substep is %lld ns, expected more than 0",
                         (long long)config->substep_ns);
    }
    if (!(config->supply_v > 0.0) || !isfinite(config->supply_v)) {
        return error_set(error, ERROR_INPUT, "the supply is %g V, expected more than 0",
                         config->supply_v);
    }
    if (!(config->supply_ohm >= 0.0) || !isfinite(config->supply_ohm)) {
        return error_set(error, ERROR_INPUT,
                         "the supply's resistance is %g ohm, expected 0 or more",
                         config->supply_ohm);
    }
    if ((config->contact != NULL) != (config->ncontact > 0)) {
        return error_set(error, ERROR_INPUT, "contact bodies: found %zu with %s contact engine",
                         config->ncontact, config->contact ? "a" : "no");
    }
    return check_bodies(config, error);
}

/* Sizes of everything, from the robot and the free bodies. */
static void lay_out(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;

    for (size_t j = 0; j < robot->njoint; j++) {
        plant->ndrive += robot->joint[j].sea.present;
        plant->nspring += robot->joint[j].spring.present && robot->joint[j].spring.enabled;
    }
    plant->at.v = robot->nq;
    plant->at.drive = plant->at.v + robot->nv;
    plant->at.pretension = plant->at.drive + 3 * plant->ndrive;
    plant->at.free = plant->at.pretension + plant->nspring;
    plant->at.work = plant->at.free + PLANT_FREE_STATE * plant->config.nfree;
    plant->at.count = plant->at.work + (plant->config.account_energy ? WORK_COUNT : 0);
}

/* An array of count elements for pointer; clears ok when the arena is used up. */
#define TAKE(pointer, count)                                                                       \
    do {                                                                                           \
        (pointer) = arena_alloc(arena, (count), sizeof *(pointer));                                \
        ok = ok && (pointer);                                                                      \
    } while (0)

static bool allocate(struct plant *plant, struct arena *arena)
{
    const struct robot *robot = plant->config.robot;
    size_t count = plant->at.count, ncontact = plant->config.ncontact;
    size_t nbody = robot->nbody + plant->config.nfree;
    bool ok = true;

    TAKE(plant->drive_joint, plant->ndrive);
    TAKE(plant->spring_joint, plant->nspring);
    TAKE(plant->free_inverse, plant->config.nfree);
    TAKE(plant->state, count);
    TAKE(plant->command.motor, robot->njoint);
    TAKE(plant->sensors.motor, robot->njoint);
    TAKE(plant->sensors.ft, robot->nft);
    TAKE(plant->push, nbody);
    TAKE(plant->sea, plant->ndrive);
    TAKE(plant->condition, plant->ndrive);
    TAKE(plant->voltage, plant->ndrive);
    TAKE(plant->bridge_on, plant->ndrive);
    TAKE(plant->pretension_rate, plant->nspring);
    TAKE(plant->q, robot->nq);
    TAKE(plant->tau, robot->njoint);
    TAKE(plant->vdot, robot->nv);
    TAKE(plant->ext, nbody);
    TAKE(plant->motion, nbody);
    TAKE(plant->contact_motion, ncontact);
    TAKE(plant->contact_wrench, ncontact);
    ok = ok && plant_contact_create(plant, arena);
    TAKE(plant->whole_motion, robot->nbody);
    TAKE(plant->last_good, count);
    TAKE(plant->lost, count);
    if (plant->config.integrator == PLANT_IMPLICIT) {
        plant->implicit = implicit_create(plant, arena);
        ok = ok && plant->implicit;
    } else {
        size_t rk4 = integrator_rk4_scratch(count), dopri5 = integrator_dopri5_scratch(count);

        TAKE(plant->scratch, plant->config.integrator == PLANT_RK4 ? rk4 : dopri5);
    }
    TAKE(plant->sampled_motion, nbody);
    TAKE(plant->sampled_wrench, ncontact);
    TAKE(plant->acceleration, robot->nbody);
    TAKE(plant->patch, plant->config.contact ? PLANT_PATCHES : 0);
    return ok;
}

/* Dynamics of the same robot that give the motion of every body. */
static enum error_code observe_all(struct plant *plant, struct arena *arena, struct error *error)
{
    const struct robot *robot = plant->config.robot;
    struct robot *all = arena_alloc(arena, 1, sizeof *all);
    struct robot_body *body = arena_alloc(arena, robot->nbody, sizeof *body);

    if (!all || !body) {
        return error_set(error, ERROR_MEMORY, "no memory for the plant of %s", robot->name);
    }
    memcpy(body, robot->body, robot->nbody * sizeof *body);
    for (size_t b = 0; b < robot->nbody; b++) {
        body[b].observed = true;
    }
    *all = *robot;
    all->body = body;
    return dynamics_generic(all, arena, &plant->whole, error);
}

static void number_actuators(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;
    size_t drive = 0, spring = 0;

    for (size_t j = 0; j < robot->njoint; j++) {
        if (robot->joint[j].sea.present) {
            plant->sea[drive] = robot->joint[j].sea;
            plant->drive_joint[drive++] = j;
        }
        if (robot->joint[j].spring.present && robot->joint[j].spring.enabled) {
            plant->spring_joint[spring++] = j;
        }
    }
}

/* False when the arena is used up. */
static bool copy_config(struct plant *plant, const struct plant_config *config, struct arena *arena)
{
    int *contact_body = arena_alloc(arena, config->ncontact, sizeof *contact_body);
    struct plant_free_body *body = arena_alloc(arena, config->nfree, sizeof *body);

    if (!contact_body || !body) {
        return false;
    }
    if (config->ncontact > 0) {
        memcpy(contact_body, config->contact_body, config->ncontact * sizeof *contact_body);
    }
    if (config->nfree > 0) {
        memcpy(body, config->free, config->nfree * sizeof *body);
    }
    plant->config = *config;
    plant->config.contact_body = contact_body;
    plant->config.free = body;
    return true;
}

enum error_code plant_create(const struct plant_config *config, struct arena *arena,
                             struct plant **plant, struct error *error)
{
    const struct robot *robot = config->robot;
    enum error_code code = check_config(config, error);
    struct plant *made;

    if (code != ERROR_NONE) {
        return code;
    }
    made = arena_alloc(arena, 1, sizeof *made);
    if (!made || !copy_config(made, config, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory for the plant of %s", robot->name);
    }
    lay_out(made);
    if (!allocate(made, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory for the plant of %s", robot->name);
    }
    code = observe_all(made, arena, error);
    if (code != ERROR_NONE) {
        return code;
    }
    number_actuators(made);
    plant_free_prepare(made);
    plant_free_reset(made);
    made->command.njoint = robot->njoint;
    made->sensors.njoint = robot->njoint;
    made->sensors.nft = robot->nft;
    made->failure = "";
    made->dopri5 = (struct integrator_dopri5){
        .rtol = config->rtol, .atol = config->atol, .tries = DOPRI5_TRIES};
    if (robot->floating) {
        made->state[QUATERNION] = 1.0;
    }
    *plant = made;
    return ERROR_NONE;
}
