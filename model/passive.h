/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Passive joints: a linear spring and a damper without mass beside each other (Kelvin, Voigt)
 * between the two bodies that a joint joins, beside its drive or in the place of one: cables and
 * hoses across a joint, return springs, and the structure itself where a joint without a drive
 * stands for what bends. With the position q and its rest q_0 they press with
 *   tau = -K (q - q_0) - D q',
 * a law without state that stores K (q - q_0)^2/2 and turns D q'^2 into heat.
 *
 * SI units: N m, rad; of a prismatic joint N, m. All functions are pure and RT-safe.
 */
#ifndef MODEL_PASSIVE_H
#define MODEL_PASSIVE_H

#include "model/robot.h"

/* Returns whether a joint has one. */
bool passive_is_present(const struct robot_passive *passive);

double passive_torque(const struct robot_passive *passive, double q, double qd);

/* Return what is stored, J, and the damper's loss, W. */
double passive_energy(const struct robot_passive *passive, double q);
double passive_loss(const struct robot_passive *passive, double qd);

#endif
