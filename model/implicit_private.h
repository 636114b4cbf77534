/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the implicit integrator share: implicit.c (the step), implicit_contact.c (pairs
 * in pair), implicit_solve.c (the linear system). The scheme and its symbols: implicit.c. Contact
 * bodies go by the index of their motion among those given to the engine. SI units. Memory is the
 * plant's. No errors but those that are returned. RT-safe.
 */
#ifndef MODEL_IMPLICIT_PRIVATE_H
#define MODEL_IMPLICIT_PRIVATE_H

#include "model/implicit.h"
#include "model/spatial.h"

/* The two sides of a pair. */
enum pair_side { PAIR_A, PAIR_B };

/* A pair of surfaces in contact. World frame, about center. */
struct active_pair {
    int index;   /* of the pair in the contact configuration */
    int body[2]; /* by side: its contact body, -1 = the world */
    double center[3];
    struct spatial_inertia A; /* h (D + h K) */
    struct spatial decrease;  /* of the wrench on b in the step; at first its part h K V */
};

/* Parts of a free body's accelerations, in its frame. */
enum free_acceleration_part { FREE_LINEAR = 0, FREE_ANGULAR = 3, FREE_ACCELERATIONS = 6 };

/* Arrays by joint, by contact body, by free body or by body of the robot. */
struct implicit {
    /* Actuators */
    struct sea_step *drive;
    double *extra, *torque; /* by joint */
    struct stop_step *stop; /* by joint */

    /* Contact */
    size_t nactive;
    struct contact_tangent *tangent;
    struct active_pair *active;
    struct spatial_inertia *contact_inertia; /* by contact body: A_b, world, about its origin */
    struct contact_wrench *wrench;           /* by contact body, at the end of the step */
    bool coupled;                            /* some pair is between two bodies that move */
    size_t nobserved;
    size_t *number;              /* by contact body: its number among the observed bodies */
    struct added_inertia *added; /* by observed body */

    /* Free bodies, in their frames about their centers of mass */
    struct spatial_inertia *free_inertia; /* with A_b */
    struct spatial *free_load;

    /* Accelerations: nv of the robot, then FREE_ACCELERATIONS of each free body */
    size_t na;
    double *a, *uncoupled, *z, *p;

    /* Of the contact bodies, world frame, about their origins: accelerations and wrenches */
    struct spatial *twist_p, *twist_z, *r, *s, *w;

    /* Scratch, by body of the robot */
    struct wrench *ext;
    struct body_motion *motion;
};

/* ---- contact bodies ---- */

static inline const struct body_motion *implicit_motion(const struct plant *plant, int contact)
{
    return &plant->motion[plant->config.contact_body[contact]];
}

static inline bool implicit_is_free(const struct plant *plant, int contact)
{
    return (size_t)plant->config.contact_body[contact] >= plant->config.robot->nbody;
}

/* A contact body that its forces can move. */
static inline bool implicit_moves(const struct plant *plant, int contact)
{
    return contact >= 0 && (!plant->clamped || implicit_is_free(plant, contact));
}

/* From the body's origin to a point, world frame. */
static inline void implicit_arm(const struct plant *plant, int contact, const double center[3],
                                double arm[3])
{
    for (int i = 0; i < 3; i++) {
        arm[i] = center[i] - implicit_motion(plant, contact)->p[i];
    }
}

/* y += scale x */
static inline void add_scaled(double scale, const double *x, double *y, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        y[i] += scale * x[i];
    }
}

/* Adds a wrench in the world frame to what acts on a contact body, ext. */
static inline void add_contact_wrench(struct plant *plant, int contact, const struct spatial *f,
                                      struct wrench *ext)
{
    struct spatial own = spatial_turn_back(implicit_motion(plant, contact)->R, f);

    for (int i = 0; i < 3; i++) {
        ext->force[i] += own.l[i];
        ext->moment[i] += own.a[i];
    }
}

/* ---- active pairs: implicit_contact.c ---- */

/* Linearizes contact at the begin of a step of h seconds: fills active, and adds -h K V to
 * plant->ext and h (D + h K) to contact_inertia. ERROR_INPUT for more than IMPLICIT_TANGENTS
 * pairs. */
enum error_code implicit_linearize_contact(struct plant *plant, double h);

/* Hands contact_inertia over to the dynamics: fills added. */
void implicit_add_contact_inertia(struct plant *plant);

/* The wrenches at the end of the step, from those at its begin and the accelerations a. */
void implicit_end_contact(struct plant *plant);

/* ---- the linear system: implicit_solve.c ---- */

/* Solves (P + C) a = right-hand side for the accelerations a of robot and free bodies, given extra,
 * torque, added, contact_inertia, active and plant->ext. */
void implicit_solve(struct plant *plant);

/* What accelerations a mean at the contact bodies' origins, world frame. */
void implicit_contact_accelerations(struct plant *plant, const double *a, struct spatial *twist);

#endif
