/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations that the parts of the implicit integrator share: implicit.c (steps and their
 * length), stage.c (one stage), actuators.c (drives and springs), current_loop.c (current
 * controllers), lanes.c (two drives per vector register), effects.c (drives with effects),
 * hydraulic.c (hydraulic joints), contact.c (pairs in contact), bristle.c (bristles of the pairs),
 * solve.c (the linear system with the joint couplings). implicit.c explains the scheme and its
 * symbols. The index of a contact body is the index of its motion in the array given to the
 * engine. SI units. The plant owns the memory. Functions return all errors. RT-safe.
 */
#ifndef MODEL_IMPLICIT_PRIVATE_H
#define MODEL_IMPLICIT_PRIVATE_H

#include "model/drives/current_loop.h"
#include "model/drives/drive_flow.h"
#include "model/drives/effects_flow.h"
#include "model/implicit/implicit.h"
#include "model/spatial.h"

/* Below this part of the largest deflection, the stop of a spring is ignored in a span. */
#define STOP_NEAR 0.8

/* Lever, m. It converts velocity jumps of joints, and of rotors on their springs, to the velocity
 * jump of a body. */
#define STRIKE_LEVER 0.1

/* The scheme's coefficient, 1 - 1/sqrt(2). */
#define IMPLICIT_GAMMA 0.29289321881345247560

/* The two sides of a pair. */
enum pair_side { PAIR_A, PAIR_B };

/* A pair of surfaces in contact. Twists and wrenches are in the world frame, about the pair's
 * center. */
struct active_pair {
    int index;   /* index of the pair in the contact configuration */
    int body[2]; /* contact body of each side; -1 = the world */
    double center[3];
    struct spatial_inertia A; /* h (D + h K); h: length of the stage */
    struct spatial point;     /* relative acceleration from base to point */
    struct spatial beyond;    /* relative acceleration of the stage, minus `point` */
    /* wrench on b at the point minus wrench on b at the stage: A times beyond */
    struct spatial decrease;
    struct spatial changed; /* change of the wrench on b since its linearization */
    /* normal force that friction at its limit follows, N; the same in the last solution, and the
     * normal force that this solution had */
    double followed, followed_1, found_1;
    bool settled; /* it has begun to slide, or its sliding direction has been damped */
    double bent;  /* twice the energy of the pair's bristles at the base, J */
};

/* Parts of a free body's accelerations, in its frame. */
enum free_acceleration_part { FREE_LINEAR = 0, FREE_ANGULAR = 3, FREE_ACCELERATIONS = 6 };

/* Lengths of steps: whole, or a quarter or a sixteenth at impacts. The drives' accounts also use a
 * quarter of the shortest step. */
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

/* A drive's flows under its own current controller, by spring law, level, span and regime; t 0 =
 * not known. row: the winding's equation that they belong to. */
struct loop_flows {
    struct loop_row row;
    struct loop_flow of[SPRING_LAWS][FLOW_LEVELS][SPANS][LOOP_KINDS];
};

/* A span of a step, or of a part of a step. */
struct implicit_part {
    enum spring_law law;
    int level;
    enum implicit_span span;
    double step_s;  /* length of the step or part */
    double begin_s; /* start of the span, from the start of the substep */
};

/* Number of drives per vector register of the baseline instruction set. */
enum { DRIVE_LANES = 2 };
typedef double drive_lanes __attribute__((vector_size(DRIVE_LANES * sizeof(double))));
typedef long long drive_lanes_mask __attribute__((vector_size(DRIVE_LANES * sizeof(long long))));

/* Members of struct drive_flow, with one lane per drive. */
struct drive_lane_flow {
    drive_lanes t;
    drive_lanes qm[FLOW_INPUTS], qmd[FLOW_INPUTS], I[FLOW_INPUTS];
};

/* The drives that share vector registers: model/implicit/lanes.c. */
struct drive_group {
    size_t drive[DRIVE_LANES]; /* unused lanes repeat the last drive */

    /* Constant over a step */
    drive_lanes V, Ks, Ds;
    drive_lanes room; /* largest deflection far from the stop, rad; -1: effects or a controller */
    struct drive_lane_flow flow[STEP_LEVELS][SPANS]; /* flow with a free spring */
    drive_lanes extra[STEP_LEVELS];                  /* inertia on the joint in the stage */

    /* At the stage's base */
    drive_lanes q, twist, qm, qmd, I; /* twist: qm - q */
    drive_lanes_mask is_free;         /* drives that lanes.c linearized in this stage */
};

/* How drives with effects are integrated: in parts of exact flows if the step resolves the rotor's
 * oscillation on its spring; by the integrator's scheme; or, with the whole plant, by implicit
 * Euler steps. */
enum effects_scheme { EFFECTS_USUAL, EFFECTS_STIFF, EFFECTS_EULER, EFFECTS_SCHEMES };

/* Torque of a drive at the end of a stage, linearized at a joint rate. The rate of the solution is
 * between low and high. */
struct effects_tangent {
    double rate, torque, slope, low, high;
};

/* Data of a drive with effects for its spans. */
struct implicit_effects {
    bool is_stiff;  /* the step does not resolve the drive's oscillations */
    double inertia; /* of the joint, with all joints at zero */
    struct effects_linear linear;
    struct effects_flow flow[STEP_LEVELS][SPANS];
};

/* Arrays are indexed by joint, contact body, free body or body of the robot. "Rates" are
 * velocities or their derivatives: nv of the robot, then enum free_acceleration_part of each free
 * body. All linear rates of free bodies are in the world frame, where a fall is a parabola for any
 * rotation. States have the plant's layout. */
struct implicit {
    /* The step */
    double h;               /* length of the step, s */
    double start_s, base_s; /* of the step and of base, from the start of the substep */
    enum implicit_level level;
    double *begin;         /* state at the start of the step */
    double *u_begin, *u_1; /* rates at the start and at the first stage */
    double *trend;         /* limited slope of the rates from the last step: see implicit.c */
    double *trend_begin;   /* trend at the start of the step, to repeat the step */
    double jump;           /* largest unpredicted change of a pair's velocity, m/s */
    double work[WORK_ALL]; /* integrals of powers in the step */

    /* The stage */
    double stage_h;               /* gamma h */
    double *base;                 /* state at the start of the stage */
    double *point;                /* state at which forces are linearized */
    double *u_base, *u_point, *u; /* rates at the base, at the point and at the stage */
    double *slope;                /* derivative of u */
    double *a_point;              /* (u_point - u_base) / stage_h, in the coordinates of a */
    struct plant_load load;       /* powers of pushes, evaluated at the point */

    /* Actuators */
    /* of each drive: flows for its own parameters, and for the parameters in a condition */
    struct drive_flows *sound, *changed;
    const struct drive_flows **flows; /* of each drive: the flows in use */
    struct loop_flows *loop_flows;    /* of each drive */
    enum spring_law *law;             /* of each drive: spring law in this stage */
    /* The same three arrays, for drives with effects */
    struct implicit_effects *effects_sound, *effects_changed;
    const struct implicit_effects **effects;
    struct effects_tangent *effects_tangent;
    enum effects_scheme scheme;
    int revisions;             /* of the stage, by implicit_revise_effects */
    struct drive_group *group; /* ngroup groups of DRIVE_LANES drives each */
    size_t ngroup;
    signed char *lane_bridge; /* of each drive: bridge state for which its lane was filled */
    double *extra, *torque;   /* by joint */
    struct stop_step *stop;   /* by joint */
    bool passive;             /* no input acts: the step adds up joint_work */
    double joint_work;        /* of springs, drives and stops in the step, J */
    double *joint_impulse;    /* by joint, of the first stage */
    bool stops_rest;          /* all entries of stop are 0 */
    bool stops_acted;         /* some stop acted in the first stage, with stop_torque */
    double *stop_torque;      /* by joint, weighted for the second stage */
    double *lower, *upper;    /* by joint: range of the position */

    /* By joint coupling */
    /* compliance: 1 / (h (D + h K)); pull: compliance times the force for a = 0 */
    double *compliance, *pull;
    /* column: nv numbers per coupling; factor: n x n; see model/coupling.h */
    double *column, *factor;
    double *unit; /* torques of a unit load of each coupling, by joint */
    /* dynamics of P: the plant's, or numeric dynamics if the plant's lack `respond` */
    const struct dynamics *tree;
    double *force; /* N m or N */

    /* Contact */
    size_t nactive;
    struct contact_tangent *tangent;
    struct active_pair *active;
    size_t ntouched;
    bool *is_touched;                        /* by contact body: it belongs to an active pair */
    int *touched;                            /* indices of these bodies, ascending */
    struct spatial_inertia *contact_inertia; /* by contact body: A_b, world, about its origin */
    struct contact_wrench *wrench;           /* by contact body, at the stage */
    struct contact_wrench *wrench_1;         /* at the first stage */
    double (*origin_1)[3];                   /* by contact body: its origin at the first stage */
    double contact_power;                    /* power of the wrenches, W */
    bool coupled;                            /* at least one pair is between two moving bodies */
    size_t nobserved;
    size_t *number;              /* by contact body: its index among the observed bodies */
    struct added_inertia *added; /* by observed body */
    bool has_added;              /* some entry of added may differ from zero */

    /* Free bodies, in their frames, about their centers of mass, at the linearization point */
    struct spatial_inertia *free_inertia; /* including A_b */
    struct spatial *free_load;

    /* Accelerations: nv of the robot, then FREE_ACCELERATIONS of each free body */
    size_t na;
    double *a, *uncoupled, *z, *p;

    /* Accelerations and wrenches of the touched contact bodies, world frame, about their
     * origins */
    struct spatial *twist_point, *twist_p, *twist_z, *r, *s, *w;
    /* -C a for the stage's last solution, from which its next solution starts; residual of the
     * stage's first solution, 0 = none yet */
    struct spatial *held;
    double first_residual;

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
    vec3_sub(center, implicit_motion(plant, contact)->p, arm);
}

/* Adds scale times x to y. */
static inline void add_scaled(double scale, const double *x, double *y, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        y[i] += scale * x[i];
    }
}

/* Adds a wrench in the world frame to the wrench ext on a contact body, in its own frame. */
static inline void add_contact_wrench(struct plant *plant, int contact, const struct spatial *f,
                                      struct wrench *ext)
{
    struct spatial own = spatial_turn_back(implicit_motion(plant, contact)->R, f);

    vec3_add_scaled(ext->force, 1.0, own.l, ext->force);
    vec3_add_scaled(ext->moment, 1.0, own.a, ext->moment);
}

/* ---- one stage: stage.c ---- */

/* Solves the stage of stage_h seconds from base (u_base). Linearizes the forces at the point, the
 * state that the rates u_point lead to. Fills slope and u. Returns the contact engine's failure, if
 * any. */
enum error_code implicit_solve_stage(struct plant *plant);

/* implicit_get_rates reads the rates from a state; implicit_set_rates writes them to it. */
void implicit_get_rates(const struct plant *plant, const double *state, double *u);
void implicit_set_rates(const struct plant *plant, const double *u, double *state);

/* Moves the positions of robot and free bodies in state by h seconds at the rates u. */
void implicit_move(const struct plant *plant, const double *u, double h, double *state);

/* ---- actuators: actuators.c ---- */

/* Fills torque and extra of the stage from base. */
void implicit_linearize_actuators(struct plant *plant);

/* Removes end stops that pull at the solved accelerations, and adds stops that joints would pass
 * within the stage. Returns true after a change: the stage must then be solved again. */
bool implicit_revise_stops(struct plant *plant);

/* Advances drives and pretensions of base through a span with the joints at the rates u, from the
 * positions and linearizations at base. Adds the drives' powers to work. */
void implicit_advance_actuators(struct plant *plant, enum implicit_span span, const double *u);

/* One drive with any spring law: linearizes it into torque and extra, or advances it through a
 * span with its joint at the given rate. */
void implicit_linearize_drive(struct plant *plant, size_t d);
void implicit_advance_drive(struct plant *plant, size_t d, enum implicit_span span, double rate);

/* Returns the shift of the deflection that replaces the offset of the stop's law. */
double implicit_stop_shift(const struct robot_sea *sea, double deflection);

/* Returns the state of a drive under its own current controller after a part; its joint moves from
 * q at `rate`. *slope receives the derivatives with respect to the rate (current_loop.c). */
struct sea_state implicit_follow_loop(struct plant *plant, size_t d,
                                      const struct implicit_part *part,
                                      const struct sea_state *drive, double q, double rate,
                                      struct sea_state *slope);

/* Adds `weight` seconds times the powers of parallel springs, end stops and joint couplings to
 * work. offset: time from state to the pretensions used, s. */
void implicit_account_joints(struct plant *plant, double weight, const double *state,
                             double offset);

/* ---- drives side by side: lanes.c ---- */

/* Bridge state that no drive has. It marks a lane to fill again, because the drive's parameters
 * have changed. */
enum { BRIDGE_UNKNOWN = -1 };

/* Loads the voltages and bridge states of a step into the lanes. */
void implicit_hold_lanes(struct plant *plant);

/* Linearize all drives into torque and extra of their joints, or advance all drives through a span
 * with the joints at the given rates (njoint). */
void implicit_linearize_drives(struct plant *plant);
void implicit_advance_drives(struct plant *plant, enum implicit_span span, const double *rates);

/* ---- drives with effects: effects.c ---- */

/* implicit_prepare_effects computes the flows for a drive's own parameters, if it has effects.
 * implicit_refresh_effects selects these flows, or computes the flows for the drive's condition. */
void implicit_prepare_effects(struct plant *plant, size_t d);
void implicit_refresh_effects(struct plant *plant, size_t d);

/* One drive with effects: linearizes it into torque and extra, or advances it through a span with
 * its joint at the given rate. */
void implicit_linearize_effects(struct plant *plant, size_t d);
void implicit_advance_effects(struct plant *plant, size_t d, enum implicit_span span, double rate,
                              double *state);

/* Linearizes stiff drives with effects again at the solved accelerations if they are not linear up
 * to there. Returns true after a change: the stage must then be solved again. */
bool implicit_revise_effects(struct plant *plant);

/* ---- hydraulic joints: hydraulic.c ---- */

/* Hydraulic joints: linearizes them into torque and extra, or advances them through t seconds with
 * the joints at the given rates. */
void implicit_linearize_hydraulics(struct plant *plant);
void implicit_advance_hydraulics(struct plant *plant, double t, const double *rates);

/* ---- active pairs: contact.c ---- */

/* Linearizes contact at the point. Fills active and adds each pair's A to contact_inertia. Adds A
 * times the acceleration from base to point to plant->ext. Returns ERROR_INPUT for more than
 * IMPLICIT_TANGENTS pairs. */
enum error_code implicit_linearize_contact(struct plant *plant);

/* Fills added from contact_inertia, for the dynamics. */
void implicit_add_contact_inertia(struct plant *plant);

/* Computes `beyond` and `decrease` of the active pairs from the accelerations a. */
void implicit_find_contact(struct plant *plant);

/* Keeps friction of bristles within its limit at the solved stage. Sliding friction follows the
 * normal force, pairs beyond the limit begin to slide, pairs that would reverse are damped, and
 * pairs that pull are removed. Changes loads and inertias of their bodies. Returns true after a
 * change: the stage must then be solved again. */
bool implicit_revise_friction(struct plant *plant);

/* Computes the velocity of b against a at a pair's center, at the point. */
void implicit_pair_velocity(const struct plant *plant, const struct active_pair *pair,
                            struct spatial *velocity);

/* Computes the wrenches at the stage and their power from the wrenches at the point and the
 * relative accelerations. Updates jump, the largest velocity jump. */
void implicit_end_contact(struct plant *plant);

/* Adds the mean wrenches of the solved part of a step to the plant's peaks and impulses, and their
 * work to its account. */
void implicit_gather_wrenches(struct plant *plant);

/* ---- bristles: bristle.c ---- */

/* Advances the bristles of the plant's state, which is the base of the stages, by h seconds with
 * the slope of the solved stage. */
void implicit_advance_bristles(struct plant *plant, double h);

/* ---- the linear system: solve.c ---- */

/* Solves (P + C) a = right-hand side for the accelerations a of robot and free bodies. Inputs:
 * extra, torque, added, contact_inertia, active and plant->ext. */
void implicit_solve(struct plant *plant);

/* Computes the accelerations of the origins of the touched contact bodies from a, in the world
 * frame. */
void implicit_contact_accelerations(struct plant *plant, const double *a, struct spatial *twist);

#endif
