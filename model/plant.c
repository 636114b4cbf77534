/* SPDX-License-Identifier: Apache-2.0 */
/* The plant: making it, its right-hand side, and stepping it. */
#include "model/plant.h"

#include "base/hash.h"
#include "model/integrator.h"
#include "model/plant_private.h"
#include "model/spatial.h"

#include <math.h>
#include <string.h>

/* Position of the base quaternion in q. */
enum { QUATERNION = 3 };

static const char diverged[] =
    "the state is no longer finite: the substep is too long for the stiffness of the model, or an "
    "input is out of all bounds";

static void normalize_quaternion(double quaternion[4])
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
        normalize_quaternion(plant->q + QUATERNION);
    }
}

enum error_code plant_touch(struct plant *plant, const double *v)
{
    const struct plant_config *config = &plant->config;
    struct contact_world *contact = config->contact;
    enum error_code code;

    config->dynamics->ops->kinematics(config->dynamics, plant->q, v, plant->motion);
    for (size_t c = 0; c < config->ncontact; c++) {
        const struct body_motion *from = &plant->motion[config->contact_body[c]];
        struct contact_motion *to = &plant->contact_motion[c];

        memcpy(to->R, from->R, sizeof to->R);
        memcpy(to->p, from->p, sizeof to->p);
        memcpy(to->w, from->w, sizeof to->w);
        memcpy(to->v, from->v, sizeof to->v);
    }
    code = contact->ops->evaluate(contact, plant->contact_motion, plant->contact_wrench);
    if (code != ERROR_NONE) {
        plant->failure = contact->ops->failure(contact);
    }
    return code;
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

/* ext and the powers from contact and pushes, given q */
static enum error_code apply_loads(struct plant *plant, const double *v, struct plant_load *load)
{
    const struct plant_config *config = &plant->config;
    size_t nbody = config->robot->nbody;

    memset(plant->ext, 0, nbody * sizeof *plant->ext);
    *load = (struct plant_load){0.0, 0.0};
    if (config->contact) {
        enum error_code code = plant_touch(plant, v);

        if (code != ERROR_NONE) {
            return code;
        }
        for (size_t c = 0; c < config->ncontact; c++) {
            const struct contact_wrench *wrench = &plant->contact_wrench[c];
            int body = config->contact_body[c];

            load->contact += apply_wrench(&plant->motion[body], wrench->force, wrench->moment,
                                          &plant->ext[body]);
        }
    }
    if (plant->pushing) {
        plant->whole.ops->kinematics(&plant->whole, plant->q, v, plant->whole_motion);
        for (size_t b = 0; b < nbody; b++) {
            load->push += apply_wrench(&plant->whole_motion[b], plant->push[b].force,
                                       plant->push[b].moment, &plant->ext[b]);
        }
    }
    return ERROR_NONE;
}

/* torques of drives and parallel springs on the joints */
static void apply_actuators(struct plant *plant, const double *state)
{
    const struct robot *robot = plant->config.robot;

    memset(plant->tau, 0, robot->njoint * sizeof *plant->tau);
    for (size_t d = 0; d < plant->ndrive; d++) {
        size_t j = plant->drive_joint[d];
        struct sea_state drive = plant_drive_state(plant, state, d);

        plant->tau[j] +=
            sea_torque(&robot->joint[j].sea, &drive, plant_joint_position(plant, state, j),
                       plant_joint_rate(plant, state, j));
    }
    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];

        plant->tau[j] += parallel_spring_torque(
            &robot->joint[j].spring, state[plant->at.pretension + s], plant->pretension_rate[s],
            plant_joint_position(plant, state, j), plant_joint_rate(plant, state, j));
    }
}

/* in the jig: no wrench, no acceleration */
static void feel_nothing(struct plant *plant, struct plant_load *load)
{
    *load = (struct plant_load){0.0, 0.0};
    memset(plant->ext, 0, plant->config.robot->nbody * sizeof *plant->ext);
    memset(plant->contact_wrench, 0, plant->config.ncontact * sizeof *plant->contact_wrench);
    memset(plant->vdot, 0, plant->config.robot->nv * sizeof *plant->vdot);
}

enum error_code plant_evaluate(struct plant *plant, const double *state, struct plant_load *load)
{
    const struct dynamics *dynamics = plant->config.dynamics;
    const double *v = state + plant->at.v;
    bool loaded = plant->config.contact || plant->pushing;
    enum error_code code;

    plant_place(plant, state);
    if (plant->clamped) {
        feel_nothing(plant, load);
        return ERROR_NONE;
    }
    code = apply_loads(plant, v, load);
    if (code != ERROR_NONE) {
        return code;
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
        const struct robot_sea *sea = &plant->config.robot->joint[j].sea;
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
    if (work) {
        work[WORK_CONTACT] = load.contact;
        work[WORK_PUSH] = load.push;
    }
}

/* takes the command over for the coming steps, of seconds in all */
static void hold_command(struct plant *plant, double seconds)
{
    double supply = plant->config.supply_v;

    for (size_t d = 0; d < plant->ndrive; d++) {
        const struct motor_command *motor = &plant->command.motor[plant->drive_joint[d]];
        double voltage = isnan(motor->voltage_v) ? 0.0 : motor->voltage_v;
        double *I = &plant->state[plant->at.drive + 3 * d + 2];

        plant->bridge_on[d] = motor->bridge_on;
        plant->voltage[d] = motor->bridge_on ? fmax(-supply, fmin(supply, voltage)) : 0.0;
        if (!motor->bridge_on) {
            if (plant->config.account_energy) {
                double L = plant->config.robot->joint[plant->drive_joint[d]].sea.L;

                plant->state[plant->at.work + WORK_JOULE] += 0.5 * L * *I * *I;
            }
            *I = 0.0;
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

static enum error_code substep(struct plant *plant)
{
    size_t count = plant->at.count;
    double h = 1e-9 * (double)plant->config.substep_ns;

    memcpy(plant->last_good, plant->state, count * sizeof *plant->state);
    plant->step_code = ERROR_NONE;
    integrator_rk4(derive, plant, 0.0, h, count, plant->state, plant->rk4);
    if (plant->step_code == ERROR_NONE && !all_finite(plant->state, count)) {
        plant->step_code = ERROR_INPUT;
        plant->failure = diverged;
    }
    if (plant->step_code != ERROR_NONE) {
        memcpy(plant->state, plant->last_good, count * sizeof *plant->state);
        return plant->step_code;
    }
    if (plant->config.robot->floating) {
        normalize_quaternion(plant->state + QUATERNION);
    }
    plant->time_ns += plant->config.substep_ns;
    return ERROR_NONE;
}

enum error_code plant_step(struct plant *plant, size_t steps)
{
    if (steps == 0) {
        return ERROR_NONE;
    }
    hold_command(plant, 1e-9 * (double)plant->config.substep_ns * (double)steps);
    for (size_t k = 0; k < steps; k++) {
        enum error_code code = substep(plant);

        if (code != ERROR_NONE) {
            return code;
        }
    }
    settle_pretensions(plant);
    return ERROR_NONE;
}

enum error_code plant_reset(struct plant *plant, const double base_position[3],
                            const double base_quaternion[4], const double *joint)
{
    const struct robot *robot = plant->config.robot;
    size_t njoint = robot->njoint;
    enum error_code code;

    memset(plant->state, 0, plant->at.count * sizeof *plant->state);
    if (robot->floating) {
        memcpy(plant->state, base_position, 3 * sizeof *base_position);
        memcpy(plant->state + QUATERNION, base_quaternion, 4 * sizeof *base_quaternion);
        normalize_quaternion(plant->state + QUATERNION);
    }
    memcpy(plant->state + plant->at.v - njoint, joint, njoint * sizeof *joint);
    for (size_t d = 0; d < plant->ndrive; d++) {
        plant->state[plant->at.drive + 3 * d] = joint[plant->drive_joint[d]];
        plant->voltage[d] = 0.0;
        plant->bridge_on[d] = false;
    }
    settle_pretensions(plant);
    memset(plant->pretension_rate, 0, plant->nspring * sizeof *plant->pretension_rate);
    memset(plant->push, 0, robot->nbody * sizeof *plant->push);
    plant->pushing = false;
    plant->time_ns = 0;
    plant->failure = "";
    code = plant_restart_energy(plant);
    return code == ERROR_NONE ? plant_sample(plant) : code;
}

void plant_set_push(struct plant *plant, int body, const double force[3], const double moment[3])
{
    size_t nbody = plant->config.robot->nbody;

    memcpy(plant->push[body].force, force, sizeof plant->push[body].force);
    memcpy(plant->push[body].moment, moment, sizeof plant->push[body].moment);
    plant->pushing = false;
    for (size_t b = 0; b < nbody; b++) {
        for (int i = 0; i < 3; i++) {
            plant->pushing |= plant->push[b].force[i] != 0.0 || plant->push[b].moment[i] != 0.0;
        }
    }
}

void plant_clamp(struct plant *plant, bool clamped)
{
    plant->clamped = clamped;
    if (clamped) {
        memset(plant->state + plant->at.v, 0, plant->config.robot->nv * sizeof *plant->state);
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

static enum error_code check_bodies(const struct plant_config *config, struct error *error)
{
    const struct robot *robot = config->robot;
    enum error_code code = ERROR_NONE;

    for (size_t c = 0; c < config->ncontact && code == ERROR_NONE; c++) {
        code = check_observed(robot, config->contact_body[c], "a contact surface", error);
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
    if (config->integrator != PLANT_RK4) {
        return error_set(error, ERROR_INPUT, "there is no integrator %d", (int)config->integrator);
    }
    if (config->substep_ns <= 0) {
        return error_set(error, ERROR_INPUT, "the substep is %lld ns, expected more than 0",
                         (long long)config->substep_ns);
    }
    if (!(config->supply_v > 0.0) || !isfinite(config->supply_v)) {
        return error_set(error, ERROR_INPUT, "the supply is %g V, expected more than 0",
                         config->supply_v);
    }
    if ((config->contact != NULL) != (config->ncontact > 0)) {
        return error_set(error, ERROR_INPUT, "contact bodies: found %zu with %s contact engine",
                         config->ncontact, config->contact ? "a" : "no");
    }
    return check_bodies(config, error);
}

/* Sizes of everything, from the robot. */
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
    plant->at.work = plant->at.pretension + plant->nspring;
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
    bool ok = true;

    TAKE(plant->drive_joint, plant->ndrive);
    TAKE(plant->spring_joint, plant->nspring);
    TAKE(plant->state, count);
    TAKE(plant->command.motor, robot->njoint);
    TAKE(plant->sensors.motor, robot->njoint);
    TAKE(plant->sensors.ft, robot->nft);
    TAKE(plant->push, robot->nbody);
    TAKE(plant->voltage, plant->ndrive);
    TAKE(plant->bridge_on, plant->ndrive);
    TAKE(plant->pretension_rate, plant->nspring);
    TAKE(plant->q, robot->nq);
    TAKE(plant->tau, robot->njoint);
    TAKE(plant->vdot, robot->nv);
    TAKE(plant->ext, robot->nbody);
    TAKE(plant->motion, robot->nbody);
    TAKE(plant->contact_motion, ncontact);
    TAKE(plant->contact_wrench, ncontact);
    TAKE(plant->whole_motion, robot->nbody);
    TAKE(plant->last_good, count);
    TAKE(plant->rk4, integrator_rk4_scratch(count));
    TAKE(plant->sampled_motion, robot->nbody);
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
            plant->drive_joint[drive++] = j;
        }
        if (robot->joint[j].spring.present && robot->joint[j].spring.enabled) {
            plant->spring_joint[spring++] = j;
        }
    }
}

enum error_code plant_create(const struct plant_config *config, struct arena *arena,
                             struct plant **plant, struct error *error)
{
    const struct robot *robot = config->robot;
    enum error_code code = check_config(config, error);
    struct plant *made;
    int *contact_body;

    if (code != ERROR_NONE) {
        return code;
    }
    made = arena_alloc(arena, 1, sizeof *made);
    contact_body = arena_alloc(arena, config->ncontact, sizeof *contact_body);
    if (!made || !contact_body) {
        return error_set(error, ERROR_MEMORY, "no memory for the plant of %s", robot->name);
    }
    made->config = *config;
    if (config->ncontact > 0) {
        memcpy(contact_body, config->contact_body, config->ncontact * sizeof *contact_body);
    }
    made->config.contact_body = contact_body;
    lay_out(made);
    if (!allocate(made, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory for the plant of %s", robot->name);
    }
    code = observe_all(made, arena, error);
    if (code != ERROR_NONE) {
        return code;
    }
    number_actuators(made);
    made->command.njoint = robot->njoint;
    made->sensors.njoint = robot->njoint;
    made->sensors.nft = robot->nft;
    made->failure = "";
    if (robot->floating) {
        made->state[QUATERNION] = 1.0;
    }
    *plant = made;
    return ERROR_NONE;
}
