/* SPDX-License-Identifier: Apache-2.0 */
/* Chooses stiffness and damping of couplings; the rules are in stiffness.h. */
#include "app/import/stiffness.h"

#include "app/import/joint_inertia.h"

#include <math.h>
#include <stdio.h>

#define SWINGS_RAD_S 1000.0 /* frequency of the held follower on its coupling */
#define GIVES 1e-3          /* deflection at the leader under its drive's full strength, rad or m */
#define STIFFNESS_LEAST 1e-6
#define STIFFNESS_MOST 1e8

void import_lead_torques(const struct robot *robot, double *torque)
{
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];

        torque[coupling->leader] += coupling->multiplier * torque[coupling->follower];
    }
}

void import_lead_loads(const struct robot *robot, double *load)
{
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];

        load[coupling->leader] += fabs(coupling->multiplier) * load[coupling->follower];
    }
}

void import_lead_stiffnesses(const struct robot *robot, double *stiffness)
{
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];

        stiffness[coupling->leader] +=
            coupling->multiplier * coupling->multiplier * stiffness[coupling->follower];
    }
}

/* Chooses a coupling's stiffness by the follower's inertia and the strength of the leader's drive;
 * damping is critical. */
static void choose_stiffness(const struct robot *robot, double inertia,
                             struct robot_coupling *coupling)
{
    const struct robot_joint *leader = &robot->joint[coupling->leader];
    const double square = coupling->multiplier * coupling->multiplier;
    double K = SWINGS_RAD_S * SWINGS_RAD_S * inertia;

    if (robot_joint_is_driven(leader)) {
        K = fmax(K, leader->torque_limit / (GIVES * square));
    }
    coupling->stiffness = fmin(fmax(K, STIFFNESS_LEAST), STIFFNESS_MOST);
    coupling->damping = 2.0 * sqrt(coupling->stiffness * fmax(inertia, 0.0));
}

/* Notes a coupling that was assumed. */
static void tell_coupling(const struct import_robot *from, const struct robot_coupling *coupling,
                          struct import_notes *notes)
{
    const struct import_joint *source = from->source[coupling->follower];
    const bool turns = from->robot->joint[coupling->follower].type == JOINT_REVOLUTE;
    char shift[32] = "";

    if (coupling->offset != 0.0) {
        snprintf(shift, sizeof shift, " %c %.9g", coupling->offset < 0.0 ? '-' : '+',
                 fabs(coupling->offset));
    }
    import_note_add(notes, IMPORT_ASSUMED, source->mimic_file, source->mimic_line,
                    "joint \"%.63s\" follows \"%.63s\", %.9g times its position%s, through a "
                    "coupling of %.3g %s and %.3g %s; it has no drive of its own, the file's "
                    "effort %g and velocity %g are not used",
                    source->name, from->source[coupling->leader]->name, coupling->multiplier, shift,
                    coupling->stiffness, turns ? "N m/rad" : "N/m", coupling->damping,
                    turns ? "N m s/rad" : "N s/m", source->effort, source->velocity);
}

enum error_code import_stiffen_couplings(struct import_robot *from, struct arena *arena,
                                         struct import_notes *notes, struct error *error)
{
    struct robot *robot = from->robot;
    struct import_trial trial;
    enum error_code code;

    if (robot->ncoupling == 0) {
        return ERROR_NONE;
    }
    code = import_trial_make(robot, from->rest, arena, &trial, error);
    for (size_t i = 0; i < robot->ncoupling && !code; i++) {
        struct robot_coupling *coupling = &robot->coupling[i];
        const size_t follower = (size_t)coupling->follower;

        choose_stiffness(robot, import_trial_held_inertia(&trial, follower), coupling);
        tell_coupling(from, coupling, notes);
    }
    return code;
}
