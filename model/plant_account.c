/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant's energy account, which always runs. Unlike plant_energy it has no integrals in the
 * state, so it costs a few operations per drive and substep. It only detects energy that appears.
 * It does not count all losses, so energy that appears can hide behind the losses not counted. It
 * checks two laws, over a window and since the account began:
 *
 *   motion   the stored energy of bodies, drives and springs grows at most by the work of the
 *            motors' torques Kt I, of cylinders, of rotors whose motion external boards impose, of
 *            pretensions, contacts and pushes, minus the losses of rotors and series springs;
 *   contact  contacts give the bodies at most the energy that they had stored.
 *
 * The implicit integrator integrates the work of contacts and pushes exactly. Other integrators
 * sample it at the end of each substep, like all powers of drives.
 */
#include "model/plant.h"

#include "model/plant_private.h"

#include <math.h>
#include <string.h>

/* Limit of the energy that may appear: a share of the turnover, plus the energy that lifts the
 * robot by ACCOUNT_LIFT_M. The error of sampled powers in a hard landing is below this limit. */
#define ACCOUNT_SHARE 0.2
#define ACCOUNT_LIFT_M 0.02
#define ACCOUNT_GRAVITY 9.81

void plant_account_step(struct plant *plant, double h)
{
    double *sum = plant->account.sum;
    double in = 0.0, turnover = 0.0, lost = 0.0;

    for (size_t d = 0; d < plant->ndrive; d++) {
        const struct robot_sea *sea = &plant->sea[d];
        const size_t j = plant->drive_joint[d];
        const double *y = plant->state + plant_drive_offset(plant, d), speed = y[DRIVE_MOTOR_SPEED];
        const double twist = speed - plant_joint_rate(plant, plant->state, j);
        /* An imposed rotor gives the spring's torque; its own motion comes from outside */
        const bool imposed = plant->condition[d] & DRIVE_IMPOSED;
        const double strength = sea->effects ? effects_saturation(sea, y[DRIVE_CURRENT]) : 1.0;
        const double power = speed * (imposed ? plant_drive_torque(plant, plant->state, d)
                                              : sea->Kt * y[DRIVE_CURRENT] * strength);

        in += power;
        turnover += fabs(power);
        lost += (imposed ? 0.0 : sea->Dm * speed * speed) + sea->Ds * twist * twist;
    }
    for (size_t c = 0; c < plant->nhydraulic; c++) {
        const double power = plant_hydraulic_torque(plant, plant->state, c) *
                             plant_joint_rate(plant, plant->state, plant->hydraulic_joint[c]);

        in += power;
        turnover += fabs(power);
    }
    for (size_t s = 0; s < plant->nspring; s++) {
        const size_t j = plant->spring_joint[s];
        const double pd = plant->pretension_rate[s];

        in += pd * parallel_spring_force(&plant->config.robot->joint[j].spring,
                                         plant->state[plant->at.pretension + s], pd,
                                         plant_joint_position(plant, plant->state, j),
                                         plant_joint_rate(plant, plant->state, j));
    }
    if (!plant->implicit) {
        plant_account_load(plant, h, &plant->account.load);
    }
    sum[ACCOUNT_IN] += h * in;
    sum[ACCOUNT_LOST] += h * lost;
    sum[ACCOUNT_TURNOVER] += h * (turnover + lost);
}

void plant_account_load(struct plant *plant, double h, const struct plant_load *load)
{
    double *sum = plant->account.sum;

    sum[ACCOUNT_CONTACT] += h * load->contact;
    sum[ACCOUNT_IN] += h * load->push;
    sum[ACCOUNT_TURNOVER] += h * (fabs(load->contact) + fabs(load->push));
}

/* Computes the energy that appeared since `from`, and the turnover. Returns whether the energy is
 * above the limit. */
static bool find_created(const struct plant *plant, const struct plant_account_moment *now,
                         const struct plant_account_moment *from, struct plant_created *created)
{
    const double lift = plant->config.robot->total_mass * ACCOUNT_GRAVITY * ACCOUNT_LIFT_M;
    double flow[ACCOUNT_SUMS], motion, contact;

    for (int i = 0; i < ACCOUNT_SUMS; i++) {
        flow[i] = now->sum[i] - from->sum[i];
    }
    motion =
        now->stored - from->stored + flow[ACCOUNT_LOST] - flow[ACCOUNT_IN] - flow[ACCOUNT_CONTACT];
    contact = plant->implicit ? flow[ACCOUNT_CONTACT] - from->contact : 0.0;
    *created = (struct plant_created){
        .energy_j = fmax(motion, contact),
        .turnover_j = flow[ACCOUNT_TURNOVER],
        .span_ns = now->time_ns - from->time_ns,
        .contact = contact > motion,
    };
    return created->energy_j > ACCOUNT_SHARE * created->turnover_j + lift;
}

bool plant_check_energy(struct plant *plant, struct plant_created *created)
{
    struct plant_account *account = &plant->account;
    struct contact_world *contact = plant->config.contact;
    struct plant_account_moment now = {.time_ns = plant->time_ns};
    bool found;

    /* The account cannot measure the energy of a clamp, or of a caller that writes the state */
    if (plant->clamped || plant->handed_out) {
        account->runs = false;
        return false;
    }
    memcpy(now.sum, account->sum, sizeof now.sum);

    /* Compute the stored energy without the oil and without imposed rotors, whose inertia is so
     * large that it would hide all other energy */
    double inertia = 0.0;

    for (size_t d = 0; d < plant->ndrive; d++) {
        if (plant->condition[d] & DRIVE_IMPOSED) {
            inertia = plant->sea[d].J;
            plant->sea[d].J = 0.0;
        }
    }
    now.stored = plant_stored_mechanical(plant) - plant_hydraulic_energy(plant, plant->state);
    for (size_t d = 0; d < plant->ndrive; d++) {
        if (plant->condition[d] & DRIVE_IMPOSED) {
            plant->sea[d].J = inertia;
        }
    }

    if (contact && plant->implicit) {
        const size_t count = contact->ops->patches(contact, plant->patch, PLANT_PATCHES);

        for (size_t p = 0; p < count && p < PLANT_PATCHES; p++) {
            now.contact += plant->patch[p].potential_j;
        }
    }
    found = account->runs && (find_created(plant, &now, &account->window, created) ||
                              find_created(plant, &now, &account->start, created));
    account->window = now;
    if (!account->runs || found) {
        account->start = now;
        account->runs = true;
    }
    return found;
}
