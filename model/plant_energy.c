/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the plant's energies: the stored energy by kind, and the balance since the start. */
#include "model/plant.h"

#include "model/coupling.h"
#include "model/plant_private.h"

#include <string.h>

double plant_stored_mechanical(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;
    const struct dynamics *dynamics = plant->config.dynamics;
    const double *state = plant->state;
    double kinetic, potential, energy;

    /* Add motion and gravity of the robot and of the free bodies */
    plant_place(plant, state);
    dynamics->ops->energy(dynamics, plant->q, state + plant->at.v, &kinetic, &potential);
    energy = kinetic + potential;
    energy += plant_free_energy(plant, state);
    /* Add the drives and cylinders */
    for (size_t d = 0; d < plant->ndrive; d++) {
        energy += plant_drive_energy(plant, state, d);
    }
    energy += plant_hydraulic_energy(plant, state);
    /* Add parallel and passive springs, stops and couplings */
    for (size_t s = 0; s < plant->nspring; s++) {
        size_t j = plant->spring_joint[s];

        energy += parallel_spring_energy(&robot->joint[j].spring, state[plant->at.pretension + s],
                                         plant_joint_position(plant, state, j));
    }
    for (size_t i = 0; i < plant->npassive; i++) {
        size_t j = plant->passive_joint[i];

        energy += passive_energy(&robot->joint[j].passive, plant_joint_position(plant, state, j));
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        energy += stop_energy(&robot->joint[j].stop, plant_joint_depth(plant, state, j));
    }
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];

        energy += coupling_energy(coupling,
                                  coupling_error(coupling, state + plant->at.v - robot->njoint));
    }
    /* Add the bus, C V^2/2 */
    if (plant->config.bus.capacitance_f > 0.0) {
        double V = state[plant->at.supply + SUPPLY_VOLTAGE];

        energy += 0.5 * plant->config.bus.capacitance_f * V * V;
    }
    return energy;
}

/* Computes the energy stored in contact, J: in elastic layers, as the engine reports it, and in
 * bristles. */
static enum error_code stored_contact(struct plant *plant, double *energy)
{
    struct contact_world *contact = plant->config.contact;
    enum error_code code;
    size_t count;

    *energy = 0.0;
    if (!contact) {
        return ERROR_NONE;
    }
    plant_place(plant, plant->state);
    plant_list_bristles(plant);
    code = plant_contact_evaluate(plant, plant->state + plant->at.v,
                                  plant->state + plant->at.bristle, 0.0);
    if (code != ERROR_NONE) {
        return code;
    }
    count = contact->ops->patches(contact, plant->patch, PLANT_PATCHES);
    if (count > PLANT_PATCHES) {
        plant->failure = "more contact patches than the energy account has room for";
        return ERROR_MEMORY;
    }
    for (size_t p = 0; p < count; p++) {
        *energy += plant->patch[p].potential_j;
    }

    /* Add the energy in bristles of pairs that no longer touch, J. These bristles relax after some
     * time. They push again if the surfaces meet before that */
    const double *y = plant->state + plant->at.bristle;
    double square = 0.0;

    for (size_t i = 0; i < plant->nlive; i++) {
        const double *own = y + CONTACT_BRISTLE * (size_t)plant->live[i];
        size_t p = 0;

        while (p < count && plant->patch[p].pair != plant->live[i]) {
            p++;
        }
        for (int k = 0; k < BRISTLE_BENT && p == count; k++) {
            square += own[k] * own[k];
        }
    }
    *energy += square / 2.0;
    return ERROR_NONE;
}

enum error_code plant_restart_energy(struct plant *plant)
{
    if (plant->config.account_energy) {
        memset(plant->state + plant->at.work, 0, plant->nwork * sizeof *plant->state);
    }
    plant->account.runs = false;
    plant->start_mechanical = plant_stored_mechanical(plant);
    return stored_contact(plant, &plant->start_contact);
}

enum error_code plant_energy(struct plant *plant, struct plant_energy *energy)
{
    const double *work = plant->state + plant->at.work;
    double mechanical = plant_stored_mechanical(plant), contact;
    enum error_code code = stored_contact(plant, &contact);

    if (code != ERROR_NONE) {
        return code;
    }
    *energy = (struct plant_energy){.stored = mechanical + contact};
    if (!plant->config.account_energy) {
        return ERROR_NONE;
    }
    /* Copy the integrals that the integrator stores in the state */
    energy->electrical_in = work[WORK_ELECTRICAL];
    energy->pretension_work = work[WORK_PRETENSION];
    energy->push_work = work[WORK_PUSH];
    energy->joule_heat = work[WORK_JOULE];
    energy->motor_friction = work[WORK_FRICTION];
    energy->spring_damping = work[WORK_SPRING_DAMPING];
    energy->parallel_damping = work[WORK_PARALLEL_DAMPING];
    energy->stop_loss = work[WORK_STOPS];
    energy->contact_dissipation = 0.0 - work[WORK_CONTACT] - (contact - plant->start_contact);
    if (plant->nwork > WORK_GEAR) {
        /* Copy the accounts of effects and bus */
        energy->gear_friction = work[WORK_GEAR];
        energy->gear_hysteresis = work[WORK_HYSTERESIS];
        energy->bridge_loss = work[WORK_BRIDGE];
        if (plant->config.bus.capacitance_f > 0.0) {
            energy->electrical_in = work[WORK_SOURCE];
            energy->source_loss = work[WORK_SOURCE_LOSS];
            energy->chopper_heat = work[WORK_CHOPPER];
        }
    }
    if (plant->nhydraulic > 0) {
        /* Copy the accounts of hydraulic joints */
        energy->hydraulic_in = work[WORK_HYDRAULIC];
        energy->orifice_loss = work[WORK_ORIFICE];
        energy->leakage_loss = work[WORK_LEAKAGE];
        energy->cylinder_friction = work[WORK_CYLINDER];
        energy->relief_loss = work[WORK_RELIEF];
    }
    /* Balance: input, minus growth of the stored energy, minus losses */
    energy->balance = energy->electrical_in + energy->pretension_work + energy->push_work +
                      work[WORK_CONTACT] - (mechanical - plant->start_mechanical) -
                      energy->joule_heat - energy->motor_friction - energy->spring_damping -
                      energy->parallel_damping - energy->stop_loss - energy->gear_friction -
                      energy->gear_hysteresis - energy->bridge_loss - energy->source_loss -
                      energy->chopper_heat + energy->hydraulic_in - energy->orifice_loss -
                      energy->leakage_loss - energy->cylinder_friction - energy->relief_loss;
    return ERROR_NONE;
}
