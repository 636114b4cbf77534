/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the parts of the plant share: plant_create.c (configuration, memory), plant_step.c
 * (stepping), plant_derive.c (right-hand side), plant_effects.c (drives with effects, the supply),
 * plant_contact.c, plant_free.c (free bodies), plant_sample.c (sensors), plant_energy.c,
 * implicit/, settle.c. Units and frames as in model/plant.h. RT-safe unless said otherwise.
 */
#ifndef MODEL_PLANT_PRIVATE_H
#define MODEL_PLANT_PRIVATE_H

#include "model/drives/effects.h"
#include "model/hydraulics/hydraulic.h"
#include "model/hydraulics/supply.h"
#include "model/integrator.h"
#include "model/plant.h"
#include "model/stop.h"
#include "model/drives/supply.h"

/* Integrals of powers at the end of the state. WORK_CONTACT is what contact does on the bodies.
 * Those from WORK_GEAR on are there with effects of drives or a bus only. */
enum plant_work {
    WORK_ELECTRICAL,
    WORK_PRETENSION,
    WORK_PUSH,
    WORK_CONTACT,
    WORK_JOULE,
    WORK_FRICTION,
    WORK_SPRING_DAMPING,
    WORK_PARALLEL_DAMPING,
    WORK_STOPS,
    WORK_GEAR,
    WORK_HYSTERESIS,
    WORK_BRIDGE,
    WORK_SOURCE,
    WORK_SOURCE_LOSS,
    WORK_CHOPPER,
    WORK_COUNT,
    WORK_HYDRAULIC = WORK_COUNT, /* those from here on with hydraulic joints only */
    WORK_ORIFICE,
    WORK_LEAKAGE,
    WORK_CYLINDER,
    WORK_RELIEF,
    WORK_ALL,
};

/* Offsets of the parts of the flat state, and its length. */
struct plant_layout {
    size_t v, drive, pretension, free, effect, supply, hydraulic, work, bristle, count;
};

/* Inverse of a free body's tensor of inertia, as struct robot_inertia has the tensor. */
struct plant_free_inverse {
    double I[6];
};

/* The plant's memory of its contact engine: the last evaluation and what all of them have cost.
 * It follows the engine and the wall clock, not virtual time: one block, which a copy of the
 * plant's memory that is put back leaves out (plant_contact_memory). */
struct plant_contact_memory {
    struct plant_contact_cost cost;
    bool valid;                  /* there was one, and it did not fail */
    double ahead_s;              /* of the last evaluation, as what follows */
    size_t nasked, nlive;        /* pairs listed before and after it */
    struct body_motion motion[]; /* ncontact; what follows: plant_contact.c */
};

/* Arrays by body have nbody entries of the robot, then nfree of the free bodies. */
struct plant {
    struct plant_config config; /* contact_body and free are the plant's own copies */
    struct dynamics whole;      /* generic, with every body observed: pushes, center of mass */
    struct plant_layout at;
    size_t ndrive, nspring, npassive, nhydraulic, nbristle;
    size_t nwork;          /* integrals of powers, with account_energy */
    bool has_effects;      /* some drive has: the state has their parts */
    bool accounts;         /* powers are integrated: account_energy, or a bus that lives on them */
    size_t *drive_joint;   /* joint of each drive */
    size_t *spring_joint;  /* joint of each enabled parallel spring */
    size_t *passive_joint; /* joint of each passive spring or damper */
    size_t *hydraulic_joint; /* of each cylinder */
    struct plant_free_inverse *free_inverse;

    double *state;
    bool handed_out; /* somebody else may write it */
    int *live;       /* nlive pairs: all whose bristles are not 0, and those that touched last */
    size_t nlive;
    int64_t time_ns;
    struct plant_command command;
    struct plant_sensors sensors;
    struct wrench *push; /* by body, world frame */
    bool pushing;        /* some push is not zero */
    bool clamped;        /* links held where they are */
    bool stepped;        /* last_good is what an implicit step of the free robot led to */
    bool balanced; /* ... by a clamp that holds the rotors too and carries no load: plant_settle */

    /* Held over a step */
    struct robot_sea *sea; /* of each drive, as its condition leaves it */
    unsigned *condition;   /* of each drive: bits of enum drive_condition */
    double *voltage;       /* of each drive, after saturation */
    bool *bridge_on;
    struct effects_bridge *bridge; /* of each drive, with effects */
    struct effects_mode *mode;     /* of each drive, in a substep of rk4 and dopri5; with effects */
    double *pretension_rate;       /* of each parallel spring */
    double *valve_voltage;         /* of each cylinder */

    /* Scratch of one evaluation */
    double *q; /* with a quaternion of unit length */
    double *tau, *vdot;
    struct wrench *ext;         /* by body, body frame */
    struct body_motion *motion; /* by body */
    struct contact_wrench *contact_wrench;
    const double *bristle_rate; /* nbristle, those of the live pairs; in the contact memory */
    bool bristles_follow;       /* they do, at those rates */
    struct plant_contact_memory *contact_memory;
    struct body_motion *whole_motion; /* of the robot's bodies */
    double *last_good; /* the state before a substep; of one that is handed out, once plant_step is
                        * done, the one it led to */
    int *kept;         /* nkept pairs: all whose bristles in last_good are not 0 */
    size_t nkept;
    double *scratch;
    double *lost; /* of the state, by rounding (integrator_rk4) */
    struct integrator_dopri5 dopri5;
    struct implicit *implicit; /* NULL with another integrator */

    /* Of the last sample */
    bool sampled_step;                  /* taken from an implicit step */
    struct body_motion *sampled_motion; /* by body */
    struct contact_wrench *sampled_wrench;
    struct contact_wrench *peak; /* by contact body: the one with the largest force in the steps */
    double *peak_force;          /* by contact body: that force, N */
    double *impulse;             /* by contact body: of the steps, three numbers each, N s */
    double impulse_s;            /* over so much time */
    struct body_acceleration *acceleration;
    /* With bending, by body: accelerations, and the load on the joint that moves it, world frame */
    struct body_acceleration *bending_acceleration;
    struct wrench *bending_load;

    double start_mechanical, start_contact; /* stored at the start, J */
    struct contact_patch *patch;
    enum error_code step_code; /* of the substep that is being taken */
    const char *failure;
};

/* Powers of outside forces on the bodies, W. */
struct plant_load {
    double contact, push;
};

/* Returns the offset of a drive's state; its parts are enum plant_drive_part. */
static inline size_t plant_drive_offset(const struct plant *plant, size_t drive)
{
    return plant->at.drive + PLANT_DRIVE_STATE * drive;
}

static inline struct sea_state plant_drive_state(const struct plant *plant, const double *state,
                                                 size_t drive)
{
    const double *y = state + plant_drive_offset(plant, drive);

    return (struct sea_state){
        .qm = y[DRIVE_MOTOR_POSITION], .qmd = y[DRIVE_MOTOR_SPEED], .I = y[DRIVE_CURRENT]};
}

/* Return position and rate of joint j. */
static inline double plant_joint_position(const struct plant *plant, const double *state, size_t j)
{
    return state[plant->at.v - plant->config.robot->njoint + j];
}

static inline double plant_joint_rate(const struct plant *plant, const double *state, size_t j)
{
    return state[plant->at.drive - plant->config.robot->njoint + j];
}

/* ---- drives with effects, and the supply: plant_effects.c ---- */

/* Parts of the state of each drive, where some drive has effects. */
enum plant_effect_part {
    EFFECT_HYSTERESIS, /* N m */
    EFFECT_WINDING,    /* deg C */
    EFFECT_HOUSING,    /* deg C */
    PLANT_EFFECT_STATE,
};

/* Read the whole state of a drive with effects, and write it back. */
struct effects_state plant_effects_state(const struct plant *plant, const double *state, size_t d);
void plant_effects_store(const struct plant *plant, size_t d, const struct effects_state *effects,
                         double *state);

/* Return the torque of a drive with effects on its joint, N m, and of any drive; and the energy
 * that any stores, J. */
double plant_effects_torque(const struct plant *plant, const double *state, size_t d);

static inline double plant_drive_torque(const struct plant *plant, const double *state, size_t d)
{
    const size_t j = plant->drive_joint[d];
    const struct sea_state drive = plant_drive_state(plant, state, d);

    return plant->sea[d].effects
               ? plant_effects_torque(plant, state, d)
               : sea_torque(&plant->sea[d], &drive, plant_joint_position(plant, state, j),
                            plant_joint_rate(plant, state, j));
}

double plant_drive_energy(const struct plant *plant, const double *state, size_t d);

/* Resets effects and bus to their start: relaxed, at ambient temperature, charged. */
void plant_effects_reset(struct plant *plant);

/* Computes what the bridge of a drive with effects does, after its voltage is held. */
void plant_effects_hold(struct plant *plant, size_t d, double supply);

/* Returns the terminal voltage that keeps a current in any drive at rest, V. */
double plant_holding_voltage(const struct plant *plant, size_t d, double I);

/* Computes the rates of a drive with effects in the mode of the substep; work may be NULL. */
void plant_effects_derive(const struct plant *plant, const double *state, size_t d,
                          double *derivative, double *work);

/* Begin and end a substep of an integrator that knows no events: find the modes that hold in it,
 * and set to zero what has passed zero in it. */
void plant_effects_begin(struct plant *plant);
void plant_effects_end(struct plant *plant);

/* Computes the rates of the bus; work may be NULL. */
void plant_supply_derive(const struct plant *plant, const double *state, double *derivative,
                         double *work);

/* Advances the bus by a step of h seconds in which the bridges took that energy, J. */
void plant_supply_advance(struct plant *plant, double energy, double h);

/* Returns the voltage of the supply in the present state, under the load of the bridges. */
double plant_supply(const struct plant *plant);

/* Makes a clamped robot's clamp one that holds the rotors too and carries no load, or one as
 * before; rotors stop. */
void plant_balance(struct plant *plant, bool balanced);

/* ---- hydraulic joints: plant_hydraulic.c ---- */

/* Returns the offset of the supply's pressure in the state. */
static inline size_t plant_hydraulic_supply(const struct plant *plant)
{
    return plant->at.hydraulic + HYDRAULIC_STATE * plant->nhydraulic;
}

/* Returns what cylinder c is connected to. */
struct hydraulic_port plant_hydraulic_port(const struct plant *plant, const double *state,
                                           size_t c);

/* Reset the cylinders: at rest and charged; hold the valves' voltages by the command; return the
 * torque of cylinder c on its joint, N m, and the energy of oil and accumulator, J. */
void plant_hydraulic_reset(struct plant *plant);
void plant_hydraulic_hold(struct plant *plant);
double plant_hydraulic_torque(const struct plant *plant, const double *state, size_t c);
void plant_hydraulic_sample(struct plant *plant);

/* Closes the valve of cylinder c and sets its pressures such that its joint stands under that
 * torque; returns false where supply and return do not suffice. */
bool plant_hydraulic_load(struct plant *plant, size_t c, double torque);

double plant_hydraulic_energy(const struct plant *plant, const double *state);

/* Adds the powers of a cylinder, and of the supply, to the accounts. */
void plant_hydraulic_account(const struct hydraulic_power *power, double supply, double *work);
void plant_hydraulic_account_supply(const struct hydraulic_supply_power *power, double *work);

/* Computes the rates of cylinders and supply; work may be NULL. */
void plant_hydraulic_derive(const struct plant *plant, const double *state, double *derivative,
                            double *work);

/* Returns how far joint j is past its limits, as model/stop.h has it. */
static inline double plant_joint_depth(const struct plant *plant, const double *state, size_t j)
{
    const struct robot_joint *joint = &plant->config.robot->joint[j];

    return stop_depth(joint->lower, joint->upper, plant_joint_position(plant, state, j));
}

/* integrator_function with the plant as its context. A failure is left in step_code and failure;
 * the rates are then zero. */
void plant_derivative(void *plant, double t, const double *state, double *derivative);

/* Return the losses of the joints' stops, and of passive springs and couplings, W. */
double plant_stop_loss(const struct plant *plant, const double *state);
double plant_spring_loss(const struct plant *plant, const double *state);

/* Fills q, ext, tau, vdot and the free bodies' motion from state; the robot's motion and
 * contact_wrench too when there is contact. */
enum error_code plant_evaluate(struct plant *plant, const double *state, struct plant_load *load);

/* The part of it before the dynamics: q, ext, the motions and bristle_rate, with or without
 * contact, whose bristles are these (nbristle), taken so far ahead (struct contact_bristles). */
enum error_code plant_load_bodies(struct plant *plant, const double *state, const double *bristle,
                                  double ahead_s, struct plant_load *load);

/* The part of that which fills ext, given what plant_place fills and, when there is contact, the
 * robot's motion and contact_wrench; adds the powers to load's. */
void plant_apply_loads(struct plant *plant, const double *v, struct plant_load *load);

/* The contact part of it: fills the robot's motion, contact_wrench and bristle_rate, given v, the
 * bristles and what plant_place fills. Returns the engine's failure, if any, with plant->failure
 * set. RT-safe when the engine is. */
enum error_code plant_contact_evaluate(struct plant *plant, const double *v, const double *bristle,
                                       double ahead_s);

/* Forgets the peaks and impulses of contact; and takes a wrench on contact body c into its own, if
 * its force is the largest since then. RT-safe. */
void plant_forget_peaks(struct plant *plant);
void plant_raise_peak(struct plant *plant, size_t c, const struct contact_wrench *wrench);

/* Allocates what bending takes; returns false when the arena is used up. And fills in bending_nm of
 * all joints, when vdot, ext and q are those of the sample; RT-safe. */
bool plant_bending_create(struct plant *plant, struct arena *arena);
void plant_sample_bending(struct plant *plant);

/* Lists the pairs whose bristles are not 0, in ascending order. They are among those that were
 * listed last, unless the state was handed out: then all bristles are looked through. RT-safe. */
void plant_list_bristles(struct plant *plant);

/* The same by looking through all bristles, after they were set as a whole. RT-safe. */
void plant_find_bristles(struct plant *plant);

/* Copies the state to last_good: of the bristles those of the live pairs, as all others are 0.
 * RT-safe. */
void plant_keep_state(struct plant *plant);

/* Copies last_good back to the state, of which no pairs have changed but those that are live by
 * now. RT-safe. */
void plant_return_state(struct plant *plant);

/* Lets go of the bristles of live pairs that have relaxed to nothing. RT-safe. */
void plant_drop_bristles(struct plant *plant);

/* The engine's tangents at the last evaluation, of which it writes at most max; returns their
 * number. The engine has to give some. RT-safe when the engine does so. */
size_t plant_contact_tangents(struct plant *plant, struct contact_tangent *tangent, size_t max);

/* Allocates the memory for both in the arena; returns false when that is used up. Not RT-safe. */
bool plant_contact_create(struct plant *plant, struct arena *arena);

/* Copies the generalized coordinates of state to plant->q with a quaternion of unit length, and
 * fills the free bodies' motion. */
void plant_place(struct plant *plant, const double *state);

void plant_normalize_quaternion(double quaternion[4]);

/* Computes what follows from the free bodies' inertias, once. */
void plant_free_prepare(struct plant *plant);

/* Reset them to their starts, and normalize their quaternions, in plant->state. */
void plant_free_reset(struct plant *plant);
void plant_free_normalize(struct plant *plant);

/* Compute their part of plant->motion, of the derivative (from motion and ext), and of the
 * energy stored (kinetic and gravity, J). */
void plant_free_place(struct plant *plant, const double *state);
void plant_free_derive(const struct plant *plant, const double *state, double *derivative);
double plant_free_energy(const struct plant *plant, const double *state);

#endif
