/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the implicit integrator share: implicit.c (steps and their length), stage.c
 * (one stage), actuators.c (drives and springs), lanes.c (drives side by side), effects.c (drives
 * with effects), contact.c (pairs in touch), bristle.c (their bristles), solve.c (the linear system
 * with the joint couplings). The scheme and its symbols: implicit.c. A contact body's index is the
 * index of its motion in the array given to the engine. SI units. The plant owns the memory. All
 * errors are returned. RT-safe.
 */
#ifndef MODEL_IMPLICIT_PRIVATE_H
#define MODEL_IMPLICIT_PRIVATE_H

#include "model/drives/drive_flow.h"
#include "model/drives/effects_flow.h"
#include "model/implicit/implicit.h"
#include "model/spatial.h"

/* Part of a spring's room within which its stop is ignored in a span. */
#define STOP_NEAR 0.8

/* Lever, m, that converts the velocity jumps of joints, and of rotors on their springs, at an
 * impact into those of a body. */
#define STRIKE_LEVER 0.1

/* The scheme's coefficient, 1 - 1/sqrt(2). */
#define IMPLICIT_GAMMA 0.29289321881345247560

/* The two sides of a pair. */
enum pair_side { PAIR_A, PAIR_B };

/* A pair of surfaces in contact. World frame, about center. */
struct active_pair {
    int index;   /* index of the pair in the contact configuration */
    int body[2]; /* side's contact body, -1 = the world */
    double center[3];
    struct spatial_inertia A; /* h (D + h K), h the length of the stage */
    struct spatial point;     /* relative acceleration that leads to the linearization point */
    struct spatial beyond;    /* relative acceleration of the stage minus point */
    /* change of the wrench on b from the point to the stage, negated: A times beyond */
    struct spatial decrease;
    double bent; /* twice the energy of its bristles at the stage's base, J */
};

/* Parts of a free body's accelerations, in its frame. */
enum free_acceleration_part { FREE_LINEAR = 0, FREE_ANGULAR = 3, FREE_ACCELERATIONS = 6 };

/* Lengths of steps: whole; a quarter or a sixteenth at impacts. The drives' accounts also use
 * quarters of the shortest one. */
enum implicit_level { LEVEL_WHOLE, LEVEL_QUARTER, LEVEL_SIXTEENTH, STEP_LEVELS, FLOW_LEVELS };

/* The two spans of a step for a drive: to the start of the second stage, (1 - gamma) h, and
 * through a stage, gamma h. */
enum implicit_span { SPAN_TO_BASE, SPAN_STAGE, SPANS };

/* Linear law of a drive's spring: free, or pressing its stop. */
enum spring_law { SPRING_FREE, SPRING_PRESSED, SPRING_LAWS };

/* A drive's flows by spring law, bridge off and on, level and span. */
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

/* The drives of one register: model/implicit/lanes.c. */
struct drive_group {
    size_t drive[DRIVE_LANES]; /* unused lanes repeat the last drive */

    /* Constant over a step */
    drive_lanes V, Ks, Ds;
    drive_lanes
        room; /* deflection of the spring that is far from its stop, rad; -1: drive with effects */
    struct drive_lane_flow flow[STEP_LEVELS][SPANS]; /* flow with a free spring */
    drive_lanes extra[STEP_LEVELS];                  /* of the stage, on the joint */

    /* At the stage's base */
    drive_lanes q, twist, qm, qmd, I; /* twist: qm - q */
    drive_lanes_mask is_free;         /* drives that were linearized by lanes */
};

/* Data of a drive with effects for its spans. */
struct implicit_effects {
    struct effects_linear linear;
    struct effects_flow flow[STEP_LEVELS][SPANS];
};

/* Arrays are indexed by joint, contact body, free body or body of the robot. "Rates" are
 * velocities or their derivatives: nv of the robot, then enum free_acceleration_part of each free
 * body. All linear rates of free bodies are in the world frame, where a fall is a parabola for any
 * rotation. States have the plant's layout. */
struct implicit {
    /* The step */
    double h; /* of the step, s */
    enum implicit_level level;
    double *begin;         /* state at the start of the step */
    double *u_begin, *u_1; /* rates at the start and at the first stage */
    double *trend;         /* slope of the rates from the last step, limited: see implicit.c */
    double *trend_begin;   /* trend before a step that is repeated */
    double jump;           /* largest unpredicted change of a pair's velocity, m/s */
    double work[WORK_ALL]; /* integrals of powers in the step */

    /* The stage */
    double stage_h;               /* gamma h */
    double *base;                 /* state at the start of the stage */
    double *point;                /* state about which all is linearized */
    double *u_base, *u_point, *u; /* rates at the base, at the point and at the stage */
    double *slope;                /* derivative of u */
    double *a_point;              /* (u_point - u_base) / stage_h, as a */
    struct plant_load load;       /* powers of pushes, at the point */

    /* Actuators */
    /* of each drive: for its own parameters, and for a condition's */
    struct drive_flows *sound, *changed;
    const struct drive_flows **flows; /* of each drive: the flows in use */
    enum spring_law *law;             /* of each drive: in this stage */
    /* The same three, for drives of a robot with effects */
    struct implicit_effects *effects_sound, *effects_changed;
    const struct implicit_effects **effects;
    struct drive_group *group; /* ngroup groups of DRIVE_LANES drives each */
    size_t ngroup;
    signed char *lane_bridge; /* of each drive: bridge state for which its lane was filled */
    double *extra, *torque;   /* by joint */
    struct stop_step *stop;   /* by joint */
    bool stops_rest;          /* all of stop are 0 */
    bool stops_acted;         /* some stop acted in the first stage, with stop_torque */
    double *stop_torque;      /* by joint, weighted for the second stage */
    double *lower, *upper;    /* by joint: its range */

    /* By joint coupling */
    /* reciprocal of h (D + h K), and the force for a = 0 times the reciprocal */
    double *compliance, *pull;
    double *column, *factor; /* nv numbers per coupling; factor of all couplings: coupling.h */
    double *force;           /* N m or N */

    /* Contact */
    size_t nactive;
    struct contact_tangent *tangent;
    struct active_pair *active;
    size_t ntouched;
    bool *is_touched;                        /* by contact body: it belongs to an active pair */
    int *touched;                            /* those bodies, ascending */
    struct spatial_inertia *contact_inertia; /* by contact body: A_b, world, about its origin */
    struct contact_wrench *wrench;           /* by contact body, at the stage */
    struct contact_wrench *wrench_1;         /* at the first stage */
    double contact_power;                    /* power of the wrenches, W */
    bool coupled;                            /* some pair is between two moving bodies */
    size_t nobserved;
    size_t *number;              /* by contact body: its index among the observed bodies */
    struct added_inertia *added; /* by observed body */

    /* Free bodies, in their frames, about their centers of mass, at the linearization point */
    struct spatial_inertia *free_inertia; /* with A_b */
    struct spatial *free_load;

    /* Accelerations: nv of the robot, then FREE_ACCELERATIONS of each free body */
    size_t na;
    double *a, *uncoupled, *z, *p;

    /* Accelerations and wrenches of the touched contact bodies, world frame, about their
     * origins */
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

/* Solves the stage of stage_h seconds that starts from base (u_base), linearized at the state to
 * which u_point leads. Fills slope and u. Returns the contact engine's failure, if any. */
enum error_code implicit_solve_stage(struct plant *plant);

/* implicit_get_rates reads the rates from a state; implicit_set_rates writes them to it. */
void implicit_get_rates(const struct plant *plant, const double *state, double *u);
void implicit_set_rates(const struct plant *plant, const double *u, double *state);

/* Moves the positions of robot and free bodies in state by h seconds at the rates u. */
void implicit_move(const struct plant *plant, const double *u, double h, double *state);

/* ---- actuators: actuators.c ---- */

/* Fills torque and extra of the stage from base. */
void implicit_linearize_actuators(struct plant *plant);

/* Removes the end stops that would pull at the accelerations found, and adds stops that joints
 * would pass within the stage. Returns true if there are changes; the stage must then be solved
 * again. */
bool implicit_revise_stops(struct plant *plant);

/* Advances drives and pretensions of base through a span with the joints at the rates u, from the
 * positions and linearizations at base. Adds the drives' powers to work. */
void implicit_advance_actuators(struct plant *plant, enum implicit_span span, const double *u);

/* One drive with any spring law: linearizes it into torque and extra, or advances it through a
 * span with its joint at the given rate. */
void implicit_linearize_drive(struct plant *plant, size_t d);
void implicit_advance_drive(struct plant *plant, size_t d, enum implicit_span span, double rate);

/* Adds to work the powers over weight seconds of parallel springs, end stops and joint couplings.
 * offset: seconds from state to the pretensions used. */
void implicit_account_joints(struct plant *plant, double weight, const double *state,
                             double offset);

/* ---- drives side by side: lanes.c ---- */

/* Takes over the voltages and bridges of a step, and discards the kept data of drives whose
 * parameters have changed. */
void implicit_hold_lanes(struct plant *plant);
void implicit_forget_lane(struct plant *plant, size_t d);

/* All drives: linearizes them into torque and extra of their joints, or advances them through a
 * span with the joints at the given rates (njoint). */
void implicit_linearize_drives(struct plant *plant);
void implicit_advance_drives(struct plant *plant, enum implicit_span span, const double *rates);

/* ---- drives with effects: effects.c ---- */

/* implicit_prepare_effects computes the flows of a drive's own parameters if it has effects. The
 * refresh function selects them, or computes those of its condition. */
void implicit_prepare_effects(struct plant *plant, size_t d);
void implicit_refresh_effects(struct plant *plant, size_t d);

/* One drive with effects: linearizes it into torque and extra, or advances it through a span with
 * its joint at the given rate. */
void implicit_linearize_effects(struct plant *plant, size_t d);
void implicit_advance_effects(struct plant *plant, size_t d, enum implicit_span span, double rate,
                              double *state);

/* ---- hydraulic joints: hydraulic.c ---- */

/* Hydraulic joints: linearizes them into torque and extra, or advances them through t seconds with
 * the joints at the given rates. */
void implicit_linearize_hydraulics(struct plant *plant);
void implicit_advance_hydraulics(struct plant *plant, double t, const double *rates);

/* ---- active pairs: contact.c ---- */

/* Linearizes contact at the point: fills active, adds A times the acceleration that leads to the
 * point to plant->ext, and A to contact_inertia. Returns ERROR_INPUT for more than
 * IMPLICIT_TANGENTS pairs. */
enum error_code implicit_linearize_contact(struct plant *plant);

/* Computes the wrenches at the stage and their power, from the wrenches at the point and the
 * accelerations a; raises jump. */
void implicit_end_contact(struct plant *plant);

/* Adds the mean wrenches of the solved part of a step to the plant's peaks and impulses, and their
 * work to its account. */
void implicit_gather_wrenches(struct plant *plant);

/* Limits the wrenches at the end of the step for output: surfaces do not pull, and friction is
 * within its cone. The motion and the energy accounts are already complete. */
void implicit_clamp_friction(struct plant *plant);

/* ---- bristles: bristle.c ---- */

/* Advances the bristles of the plant's state, the stages' base, by h seconds with the slope of the
 * solved stage. */
void implicit_advance_bristles(struct plant *plant, double h);

/* ---- the linear system: solve.c ---- */

/* Solves (P + C) a = right-hand side for the accelerations a of robot and free bodies. Inputs:
 * extra, torque, added, contact_inertia, active and plant->ext. */
void implicit_solve(struct plant *plant);

/* Computes the accelerations of the touched contact bodies' origins from a, world frame. */
void implicit_contact_accelerations(struct plant *plant, const double *a, struct spatial *twist);

#endif
