/* SPDX-License-Identifier: Apache-2.0 */
/* Creates a plant: checks the configuration, lays out the state and allocates the memory. */
#include "model/plant.h"

#include "model/implicit/implicit.h"
#include "model/integrator.h"
#include "model/plant_private.h"

#include <math.h>
#include <string.h>

/* Largest number of dopri5 steps per substep. */
enum { DOPRI5_TRIES = 100000 };

/* Checks that a body is observed, so that the dynamics compute its motion. */
static enum error_code check_observed_body(const struct robot *robot, int body, const char *what,
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

/* Checks the body of a contact surface. It must be an observed body of the robot, or a free
 * body. */
static enum error_code check_contact_body(const struct plant_config *config, int body,
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
    return check_observed_body(config->robot, body, "a contact surface", error);
}

/* Checks the free bodies, and the bodies of all contact surfaces and sensors. */
static enum error_code check_plant_bodies(const struct plant_config *config, struct error *error)
{
    const struct robot *robot = config->robot;
    enum error_code code;

    for (size_t i = 0; i < config->nfree; i++) {
        if ((code = plant_check_free_body(&config->free[i], error))) {
            return code;
        }
    }
    for (size_t c = 0; c < config->ncontact; c++) {
        if ((code = check_contact_body(config, config->contact_body[c], error))) {
            return code;
        }
    }
    for (size_t f = 0; f < robot->nft; f++) {
        int body = robot->frame[robot->ft[f].frame].body;

        if ((code = check_observed_body(robot, body, "a force-torque sensor", error))) {
            return code;
        }
    }
    if (robot->imu_frame < 0) {
        return ERROR_NONE;
    }
    return check_observed_body(robot, robot->frame[robot->imu_frame].body, "the inertial sensor",
                               error);
}

/* Checks robot, dynamics, time, supply and contact of a configuration, then its bodies. */
static enum error_code check_plant_config(const struct plant_config *config, struct error *error)
{
    if (config->dynamics->robot != config->robot) {
        return error_set(error, ERROR_INPUT, "the dynamics are not those of robot %s",
                         config->robot->name);
    }

    /* Check that the integrator exists and that its requirements are met */
    if (config->integrator != PLANT_RK4 && config->integrator != PLANT_IMPLICIT &&
        config->integrator != PLANT_DOPRI5) {
        return error_set(error, ERROR_INPUT, "unknown integrator %d", (int)config->integrator);
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

    /* Check time and supply */
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

    /* Check the parameters of the bus, if there is one */
    const struct supply_bus *bus = &config->bus;

    if (!(bus->capacitance_f >= 0.0) || !isfinite(bus->capacitance_f)) {
        return error_set(error, ERROR_INPUT, "the supply's capacitance is %g F, expected 0 or more",
                         bus->capacitance_f);
    }
    if (bus->capacitance_f > 0.0 && config->supply_ohm == 0.0) {
        return error_set(error, ERROR_INPUT,
                         "a supply with a capacitance needs a source with a resistance");
    }
    if (bus->on_v != 0.0 && (bus->capacitance_f == 0.0 || !(bus->on_v > bus->off_v) ||
                             !(bus->off_v > config->supply_v) || !(bus->brake_ohm > 0.0))) {
        return error_set(error, ERROR_INPUT,
                         "a brake chopper that switches on at %g V and off at %g V through %g ohm, "
                         "expected on > off > the supply's %g V, a resistance, and a capacitance",
                         bus->on_v, bus->off_v, bus->brake_ohm, config->supply_v);
    }

    /* Check contact, then the bodies */
    if ((config->contact != NULL) != (config->ncontact > 0)) {
        return error_set(error, ERROR_INPUT, "contact bodies: found %zu with %s contact engine",
                         config->ncontact, config->contact ? "a" : "no");
    }
    return check_plant_bodies(config, error);
}

/* Counts the actuators and computes the layout of the flat state. */
static void lay_out_state(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;
    const bool has_bus = plant->config.bus.capacitance_f > 0.0;
    bool has_grip = false;

    for (size_t j = 0; j < robot->njoint; j++) {
        plant->ndrive += robot->joint[j].sea.present;
        plant->has_effects |= robot->joint[j].sea.present && robot->joint[j].sea.effects;
        has_grip |= robot->joint[j].sea.effects && robot->joint[j].sea.effects->presliding > 0.0;
        plant->nspring += robot->joint[j].spring.present && robot->joint[j].spring.enabled;
        plant->npassive += passive_is_present(&robot->joint[j].passive);
        plant->nhydraulic += robot->joint[j].hydraulic.present;
    }
    plant->at.v = robot->nq;
    plant->at.drive = plant->at.v + robot->nv;
    plant->at.pretension = plant->at.drive + PLANT_DRIVE_STATE * plant->ndrive;
    plant->at.free = plant->at.pretension + plant->nspring;
    plant->nbristle = plant->config.contact ? plant->config.contact->nbristle : 0;
    plant->at.effect = plant->at.free + PLANT_FREE_STATE * plant->config.nfree;
    plant->neffect = !plant->has_effects ? 0 : has_grip ? PLANT_EFFECT_STATE : EFFECT_GRIP;
    plant->at.supply = plant->at.effect + plant->neffect * plant->ndrive;
    plant->at.hydraulic = plant->at.supply + (has_bus ? SUPPLY_STATE : 0);
    plant->at.work = plant_hydraulic_supply(plant) + (plant->nhydraulic > 0);
    plant->nwork = plant->nhydraulic > 0           ? WORK_ALL
                   : plant->has_effects || has_bus ? WORK_COUNT
                                                   : WORK_GEAR;
    plant->accounts = plant->config.account_energy || has_bus;
    plant->at.bristle = plant->at.work + (plant->config.account_energy ? plant->nwork : 0);
    plant->at.count = plant->at.bristle + plant->nbristle;
}

/* Allocates the plant's arrays. Returns false if the arena is full. */
static bool allocate_plant(struct plant *plant, struct arena *arena)
{
    const struct robot *robot = plant->config.robot;
    size_t count = plant->at.count, ncontact = plant->config.ncontact;
    size_t nbody = robot->nbody + plant->config.nfree;
    bool ok = true;

    /* Actuators and free bodies */
    TAKE(plant->drive_joint, plant->ndrive);
    TAKE(plant->spring_joint, plant->nspring);
    TAKE(plant->passive_joint, plant->npassive);
    TAKE(plant->hydraulic_joint, plant->nhydraulic);
    TAKE(plant->free_inverse, plant->config.nfree);

    /* State, inputs and outputs */
    TAKE(plant->state, count);
    TAKE(plant->command.motor, robot->njoint);
    TAKE(plant->sensors.motor, robot->njoint);
    TAKE(plant->sensors.ft, robot->nft);
    TAKE(plant->push, nbody);

    /* Constant over a step */
    TAKE(plant->sea, plant->ndrive);
    TAKE(plant->condition, plant->ndrive);
    TAKE(plant->voltage, plant->ndrive);
    TAKE(plant->bridge_on, plant->ndrive);
    TAKE(plant->bridge, plant->has_effects ? plant->ndrive : 0);
    TAKE(plant->mode, plant->has_effects ? plant->ndrive : 0);
    TAKE(plant->loop, plant->ndrive);
    TAKE(plant->delayed, plant->ndrive);
    TAKE(plant->ndelayed, plant->ndrive);
    TAKE(plant->pretension_rate, plant->nspring);
    TAKE(plant->valve_voltage, plant->nhydraulic);

    /* One evaluation */
    TAKE(plant->q, robot->nq);
    TAKE(plant->tau, robot->njoint);
    TAKE(plant->vdot, robot->nv);
    TAKE(plant->ext, nbody);
    TAKE(plant->motion, nbody);
    TAKE(plant->contact_wrench, ncontact);
    TAKE(plant->peak, ncontact);
    TAKE(plant->peak_force, ncontact);
    TAKE(plant->impulse, ncontact);
    TAKE(plant->live, plant->nbristle / CONTACT_BRISTLE);
    ok = ok && plant_contact_create(plant, arena);
    TAKE(plant->whole_motion, robot->nbody);

    /* Integration */
    TAKE(plant->last_good, count);
    TAKE(plant->kept, plant->nbristle / CONTACT_BRISTLE);
    TAKE(plant->lost, count);
    if (plant->config.integrator == PLANT_IMPLICIT) {
        plant->implicit = implicit_create(plant, arena);
        ok = ok && plant->implicit;
    } else {
        TAKE(plant->scratch,
             count * (plant->config.integrator == PLANT_RK4 ? RK4_SCRATCH : DOPRI5_SCRATCH));
    }

    /* The last sample */
    TAKE(plant->sampled_motion, nbody);
    TAKE(plant->sampled_wrench, ncontact);
    TAKE(plant->acceleration, robot->nbody);
    TAKE(plant->bending_acceleration, plant->config.bending ? robot->nbody : 0);
    TAKE(plant->bending_load, plant->config.bending ? robot->nbody : 0);
    TAKE(plant->patch, plant->config.contact ? PLANT_PATCHES : 0);
    return ok;
}

/* Finds the joint of each drive, spring and cylinder. */
static void number_actuators(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;
    size_t drive = 0, spring = 0, passive = 0, cylinder = 0;

    for (size_t j = 0; j < robot->njoint; j++) {
        if (robot->joint[j].sea.present) {
            plant->sea[drive] = robot->joint[j].sea;
            plant->drive_joint[drive++] = j;
        }
        if (robot->joint[j].spring.present && robot->joint[j].spring.enabled) {
            plant->spring_joint[spring++] = j;
        }
        if (passive_is_present(&robot->joint[j].passive)) {
            plant->passive_joint[passive++] = j;
        }
        if (robot->joint[j].hydraulic.present) {
            plant->hydraulic_joint[cylinder++] = j;
        }
    }
}

/* Copies the configuration with its arrays. Returns false if the arena is full. */
static bool copy_plant_config(struct plant *plant, const struct plant_config *config,
                              struct arena *arena)
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
    enum error_code code = check_plant_config(config, error);
    struct plant *made;

    if (code != ERROR_NONE) {
        return code;
    }

    /* Allocate the plant, its state and scratch, and the dynamics of all bodies */
    made = arena_alloc(arena, 1, sizeof *made);
    if (!made || !copy_plant_config(made, config, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory for the plant of %s", robot->name);
    }
    lay_out_state(made);
    if (!allocate_plant(made, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory for the plant of %s", robot->name);
    }
    if ((code = dynamics_generic(robot, arena, &made->whole, error))) {
        return code;
    }

    /* Compute derived data, then set the reset state */
    number_actuators(made);
    if (!plant_loop_create(made, arena)) {
        return error_set(error, ERROR_MEMORY, "no memory for the plant of %s", robot->name);
    }
    if (made->implicit) {
        implicit_prepare_drives(made);
    }
    plant_free_reset(made);
    plant_effects_reset(made);
    plant_hydraulic_reset(made);
    made->command.njoint = robot->njoint;
    made->sensors.njoint = robot->njoint;
    made->sensors.nft = robot->nft;
    made->failure = "";
    made->dopri5 = (struct integrator_dopri5){
        .rtol = config->rtol, .atol = config->atol, .tries = DOPRI5_TRIES};
    if (robot->floating) {
        made->state[BASE_Q_QUATERNION] = 1.0;
    }
    *plant = made;
    return ERROR_NONE;
}
