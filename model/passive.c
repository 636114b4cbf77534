/* SPDX-License-Identifier: Apache-2.0 */
/* The law of passive joints. */
#include "model/passive.h"

bool passive_is_present(const struct robot_passive *passive)
{
    return passive->stiffness > 0.0 || passive->damping > 0.0;
}

double passive_torque(const struct robot_passive *passive, double q, double qd)
{
    return -passive->stiffness * (q - passive->rest) - passive->damping * qd;
}

double passive_energy(const struct robot_passive *passive, double q)
{
    const double bend = q - passive->rest;

    return 0.5 * passive->stiffness * bend * bend;
}

double passive_loss(const struct robot_passive *passive, double qd)
{
    return passive->damping * qd * qd;
}
