/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the implicit integrator share: implicit.c (steps and their length),
 * stage.c (one stage), actuators.c (drives and springs), lanes.c (drives
 * side by side), effects.c (drives with effects), contact.c (pairs in touch),
 * bristle.c (their bristles), coupling.c (joint couplings), solve.c (the
 * linear system). The scheme and its
 * symbols: implicit.c. Contact bodies go by the index of their motion among those given to the
 * engine. SI units. Memory is the plant's. No errors but those that are returned. RT-safe.
 */
#ifndef MODEL_IMPLICIT_PRIVATE_H
#define MODEL_IMPLICIT_PRIVATE_H

#include "model/drives/drive_flow.h"
#include "model/drives/effects_flow.h"
#include "model/implicit/implicit.h"
#include "model/spatial.h"

/* Part of its room within which a spring counts as far from its stop in a span. */
#define STOP_NEAR 0.8

/* Lever of joints, and of rotors on their springs, that are thrown, m: turns their jumps into those
 * of a body. */
#define STRIKE_LEVER 0.1

/* The scheme's coefficient, 1 - 1/sqrt(2). */
#define IMPLICIT_GAMMA 0.29289321881345247560

/* The two sides of a pair. */
enum pair_side { PAIR_A, PAIR_B };

/* A pair of surfaces in contact. World frame, about center. */
struct active_pair {
    int index;   /* index of the pair in the contact configuration */
    int body[2]; /* by side: its contact body, -1 = the world */
    double center[3];
    struct spatial_inertia A; /* h (D + h K), h that of the stage */
    struct spatial point;     /* relative acceleration that leads to where it is linearized */
    struct spatial beyond;    /* relative acceleration of the stage beyond that */
    struct spatial decrease;  /* of the wrench on b from there to the stage: A times beyond */
    double bent;              /* twice the energy of its bristles where they are advanced from, J */
};

/* Parts of a free body's accelerations, in its frame. */
enum free_acceleration_part { FREE_LINEAR = 0, FREE_ANGULAR = 3, FREE_ACCELERATIONS = 6 };

/* Steps are one long, or a quarter or a sixteenth where something strikes; the drives' accounts are
 * by quarters of the shortest too. */
enum implicit_level { LEVEL_WHOLE, LEVEL_QUARTER, LEVEL_SIXTEENTH, STEP_LEVELS, FLOW_LEVELS };

/* The two parts of a step that a drive is taken through: to where the second stage begins, (1 -
 * gamma) h, and through a stage, gamma h. */
enum implicit_span { SPAN_TO_BASE, SPAN_STAGE, SPANS };

/* Which linear law a drive's spring follows: it is free, or presses its stop. */
enum spring_law { SPRING_FREE, SPRING_PRESSED, SPRING_LAWS };

/* A drive's flows: by law of the spring, bridge off and on, level and span. */
struct drive_flows {
    struct drive_flow of[SPRING_LAWS][2][FLOW_LEVELS][SPANS];
};

/* Drives side by side in a vector register of the baseline instruction set. */
enum { DRIVE_LANES = 2 };
typedef double drive_lanes __attribute__((vector_size(DRIVE_LANES * sizeof(double))));
typedef long long drive_lanes_mask __attribute__((vector_size(DRIVE_LANES * sizeof(long long))));

/* struct drive_flow of each. */
struct drive_lane_flow {
    drive_lanes t;
    drive_lanes qm[FLOW_INPUTS], qmd[FLOW_INPUTS], I[FLOW_INPUTS];
};

/* Those of a register: model/implicit/lanes.c. */
struct drive_group {
    /* Over a step */
    drive_lanes V, Ks, Ds;
    drive_lanes
        room; /* for the spring's deflection, rad, far from its stop, if any; -1: with effects */
    struct drive_lane_flow flow[STEP_LEVELS][SPANS]; /* of the free spring */
    drive_lanes extra[STEP_LEVELS];                  /* of the stage, on the joint */

    /* At the stage's base */
    drive_lanes q, twist, qm, qmd, I; /* twist: qm - q */
    drive_lanes_mask is_free;         /* those that were linearized by lanes */
};

/* What a drive with effects is taken through a span by. */
struct implicit_effects {
    struct effects_linear linear;
    struct effects_flow flow[STEP_LEVELS][SPANS];
};

/* Arrays by joint, by contact body, by free body or by body of the robot. "Rates" are velocities or
 * their derivatives: nv of the robot, then enum free_acceleration_part of each free body; all
 * linear ones in the world frame, where a fall is a parabola however the body turns. States are
 * laid out as the plant's. */
struct implicit {
    /* The step */
    double h; /* of the step, s */
    enum implicit_level level;
    double *begin;         /* state at its begin */
    double *u_begin, *u_1; /* rates at its begin and at the first stage */
    double *trend;         /* slope of the rates by the last step, limited: see implicit.c */
    double *trend_begin;   /* before a step that is taken again */
    double jump;           /* largest change of a pair's velocity that was not foreseen, m/s */
    double work[WORK_ALL]; /* of the step */

    /* The stage */
    double stage_h;               /* gamma h */
    double *base;                 /* state that it starts from */
    double *point;                /* state where all is linearized */
    double *u_base, *u_point, *u; /* rates there, and at the stage */
    double *slope;                /* derivative of u */
    double *a_point;              /* (u_point - u_base) / stage_h, as a */
    struct plant_load load;       /* of pushes, at the point */

    /* Actuators */
    struct drive_flows *sound, *changed; /* by drive: of its own parameters, and of a condition's */
    const struct drive_flows **flows;    /* by drive: those of the two that hold */
    enum spring_law *law;                /* by drive: in this stage */
    /* By drive, of a robot with effects: as sound and changed, and those that hold */
    struct implicit_effects *effects_sound, *effects_changed;
    const struct implicit_effects **effects;
    struct drive_group *group; /* of DRIVE_LANES drives each */
    signed char *lane_bridge;  /* by drive: the bridge that its lane was filled for */
    double *extra, *torque;    /* by joint */
    struct stop_step *stop;    /* by joint */
    bool stops_rest;           /* all of stop is 0 */
    bool stops_acted;          /* in the first stage, with stop_torque */
    double *stop_torque;       /* by joint, weighted as the second stage's */
    double *lower, *upper;     /* by joint: its range */

    /* By joint coupling */
    double *compliance, *pull; /* reciprocal of h (D + h K), and that times the force for a = 0 */
    double *column, *factor;   /* nv numbers each; of all of them: coupling.h */
    double *force;             /* N m or N */

    /* Contact */
    size_t nactive;
    struct contact_tangent *tangent;
    struct active_pair *active;
    size_t ntouched;
    bool *is_touched;                        /* by contact body: of an active pair */
    int *touched;                            /* those that are, ascending */
    struct spatial_inertia *contact_inertia; /* by contact body: A_b, world, about its origin */
    struct contact_wrench *wrench;           /* by contact body, at the stage */
    struct contact_wrench *wrench_1;         /* at the first stage */
    double contact_power;                    /* of them, W */
    bool coupled;                            /* some pair is between two bodies that move */
    size_t nobserved;
    size_t *number;              /* by contact body: its number among the observed bodies */
    struct added_inertia *added; /* by observed body */

    /* Free bodies, in their frames at the point about their centers of mass */
    struct spatial_inertia *free_inertia; /* with A_b */
    struct spatial *free_load;

    /* Accelerations: nv of the robot, then FREE_ACCELERATIONS of each free body */
    size_t na;
    double *a, *uncoupled, *z, *p;

    /* Of the contact bodies that are touched, world frame, about their origins: accelerations and
     * wrenches */
    struct spatial *twist_point, *twist_p, *twist_z, *r, *s, *w;

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

/* Returns whether forces can move a contact body. */
static inline bool implicit_moves(const struct plant *plant, int contact)
{
    return contact >= 0 && (!plant->clamped || implicit_is_free(plant, contact));
}

/* Computes the vector from the body's origin to a point, world frame. */
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

/* ---- one stage: stage.c ---- */

/* Solves the stage of stage_h seconds that starts from base (u_base), linearized where u_point
 * leads to: fills slope and u. Returns the contact engine's failure, if any. */
enum error_code implicit_solve_stage(struct plant *plant);

/* Read the rates out of a state, and write them back into it. */
void implicit_get_rates(const struct plant *plant, const double *state, double *u);
void implicit_set_rates(const struct plant *plant, const double *u, double *state);

/* Moves the positions of robot and free bodies in state by h seconds at the rates u. */
void implicit_move(const struct plant *plant, const double *u, double h, double *state);

/* ---- actuators: actuators.c ---- */

/* Fills torque and extra of the stage from base. */
void implicit_linearize_actuators(struct plant *plant);

/* Takes away the end stops that would pull with the accelerations found, and adds those that joints
 * are thrown past; true when there are some, so that the stage has to be solved again. */
bool implicit_revise_stops(struct plant *plant);

/* Keeps what the end stops have done in the first stage, which was solved, for the second, whose
 * weight in the step is that part of the first's. */
void implicit_keep_stops(struct plant *plant, double weight);

/* Advances drives and pretensions of base through a span, with the joints at the rates of u from
 * the positions in base, and as implicit_linearize_actuators has found base; adds the drives'
 * powers to work. */
void implicit_advance_actuators(struct plant *plant, enum implicit_span span, const double *u);

/* The same of one drive, whatever holds for it: adds to torque and extra; takes it through a span
 * with its joint at that rate. */
void implicit_linearize_drive(struct plant *plant, size_t d);
void implicit_advance_drive(struct plant *plant, size_t d, enum implicit_span span, double rate);

/* Adds the powers over weight seconds of parallel springs, their pretensions offset seconds after
 * state, of end stops and of joint couplings to work. */
void implicit_account_joints(struct plant *plant, double weight, const double *state,
                             double offset);

/* ---- drives side by side: lanes.c ---- */

/* Takes over the voltages and bridges that hold for a step; and forgets what was kept of a drive,
 * whose parameters have changed. */
void implicit_hold_lanes(struct plant *plant);
void implicit_forget_lane(struct plant *plant, size_t d);

/* All drives: sets torque and extra of their joints; takes them through a span with the joints at
 * those rates (njoint). */
void implicit_linearize_drives(struct plant *plant);
void implicit_advance_drives(struct plant *plant, enum implicit_span span, const double *rates);

/* ---- drives with effects: effects.c ---- */

/* Makes the flows of a drive's own parameters, if it has effects; and chooses them, or makes those
 * of its condition. */
void implicit_prepare_effects(struct plant *plant, size_t d);
void implicit_refresh_effects(struct plant *plant, size_t d);

/* As for other drives: adds to torque and extra; takes a drive through a span with its joint at
 * that rate. */
void implicit_linearize_effects(struct plant *plant, size_t d);
void implicit_advance_effects(struct plant *plant, size_t d, enum implicit_span span, double rate,
                              double *state);

/* ---- hydraulic joints: hydraulic.c ---- */

/* Adds to torque and extra; takes them through t seconds with the joints at those rates. */
void implicit_linearize_hydraulics(struct plant *plant);
void implicit_advance_hydraulics(struct plant *plant, double t, const double *rates);

/* ---- joint couplings: coupling.c ---- */

/* Fills compliance and pull of the stage from base. */
void implicit_linearize_couplings(struct plant *plant);

/* Fills column and factor, given extra, torque, added, ext and the accelerations a that these make
 * of the tree alone. */
void implicit_find_columns(struct plant *plant, const double *a);

/* Changes the accelerations of the tree alone, whatever the loads on it, to those with the
 * couplings. */
void implicit_hold_couplings(struct plant *plant, double *a);

/* ---- active pairs: contact.c ---- */

/* Linearizes contact at the point: fills active, adds A times the acceleration that leads there to
 * plant->ext, and A to contact_inertia. ERROR_INPUT for more than IMPLICIT_TANGENTS pairs. */
enum error_code implicit_linearize_contact(struct plant *plant);

/* Hands contact_inertia over to the dynamics: fills added. */
void implicit_add_contact_inertia(struct plant *plant);

/* Computes the wrenches at the stage and their power, from those at the point and the
 * accelerations a; raises jump. */
void implicit_end_contact(struct plant *plant);

/* Takes the mean wrenches of the part of a step whose stages were solved into the plant's peaks and
 * impulses. */
void implicit_gather_wrenches(struct plant *plant);

/* Brings the wrenches at the end of the step, which have moved the bodies, within what contact can
 * exert: surfaces do not pull, and friction is within its cone. For who reads them; the physics and
 * its accounts are done. */
void implicit_clamp_friction(struct plant *plant);

/* ---- bristles: bristle.c ---- */

/* Advances those of the plant's state, which are the stages' base, by h seconds at the slope that
 * they have in the stage that was solved. */
void implicit_advance_bristles(struct plant *plant, double h);

/* ---- the linear system: solve.c ---- */

/* Solves (P + C) a = right-hand side for the accelerations a of robot and free bodies, given extra,
 * torque, added, contact_inertia, active and plant->ext. */
void implicit_solve(struct plant *plant);

/* Computes the accelerations of the touched contact bodies' origins that a means, world frame. */
void implicit_contact_accelerations(struct plant *plant, const double *a, struct spatial *twist);

#endif
