/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Declarations shared by the parts of the plant: plant_create.c (configuration, memory),
 * plant_step.c (stepping), plant_loop.c (current controllers), plant_derive.c (right-hand side),
 * plant_effects.c (drives with effects, the supply), plant_contact.c, plant_free.c (free bodies),
 * plant_sample.c (sensors), plant_energy.c, plant_account.c, implicit/, settle.c. Units and frames
 * as in model/plant.h. RT-safe unless said otherwise.
 */
#ifndef MODEL_PLANT_PRIVATE_H
#define MODEL_PLANT_PRIVATE_H

#include "model/drives/effects.h"
#include "model/drives/current_loop.h"
#include "model/hydraulics/hydraulic.h"
#include "model/hydraulics/supply.h"
#include "model/integrator.h"
#include "model/plant.h"
#include "model/stop.h"
#include "model/drives/supply.h"

/* Allocates an array in `arena`; sets `ok` to false if the arena is full. */
#define TAKE(pointer, count)                                                                       \
    do {                                                                                           \
        (pointer) = arena_alloc(arena, (count), sizeof *(pointer));                                \
        ok = ok && (pointer);                                                                      \
    } while (0)

/* Integrals of powers near the end of the state. WORK_CONTACT is the work of contact on the
 * bodies. The entries from WORK_GEAR on exist only with effects of drives or a bus. */
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
    WORK_HYDRAULIC = WORK_COUNT, /* the entries from here on exist only with hydraulic joints */
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

/* Inverse of a free body's inertia tensor, in the layout of struct robot_inertia. */
struct plant_free_inverse {
    double I[6];
};

/* The plant's memory of its contact engine: the last evaluation, and the cost of all evaluations.
 * It belongs to the engine and the wall clock, not to virtual time. It is one block, so that a
 * copy of the plant's memory can leave it out (plant_contact_memory). */
struct plant_contact_memory {
    struct plant_contact_cost cost;
    bool valid;                  /* there was an evaluation, and it succeeded */
    double ahead_s;              /* time ahead of the last evaluation */
    size_t nasked, nlive;        /* pairs listed before and after the last evaluation */
    struct body_motion motion[]; /* ncontact; more arrays follow: plant_contact.c */
};

/* Powers of external forces on the bodies, W. */
struct plant_load {
    double contact, push;
};

/* The energy account that always runs: plant_account.c. Sums in J: work of drives and pushes, work
 * of contact on the bodies, losses, and the sum of the magnitudes. */
enum plant_account_sum {
    ACCOUNT_IN,
    ACCOUNT_CONTACT,
    ACCOUNT_LOST,
    ACCOUNT_TURNOVER,
    ACCOUNT_SUMS
};
struct plant_account_moment {
    int64_t time_ns;
    double sum[ACCOUNT_SUMS], stored,
        contact; /* stored: energy in motion and springs; contact: energy in contacts */
};
struct plant_account {
    bool runs;                /* start and window are valid */
    double sum[ACCOUNT_SUMS]; /* up to the present state */
    struct plant_account_moment start, window;
    struct plant_load load; /* at the last evaluation of an integrator that is not implicit */
};

/* Arrays by body have nbody entries for the robot, then nfree for the free bodies. */
struct plant {
    struct plant_config config; /* contact_body and free are the plant's own copies */
    /* numeric dynamics: motions of all bodies, for pushes and the center of mass */
    struct dynamics whole;
    struct plant_layout at;
    size_t ndrive, nspring, npassive, nhydraulic, nbristle;
    size_t nwork;            /* number of integrals of powers, with account_energy */
    size_t neffect;          /* parts of effects of each drive in the state */
    bool has_effects;        /* a drive has effects, so the state has the parts of effects */
    bool accounts;           /* powers are integrated, for account_energy or for a bus */
    size_t *drive_joint;     /* joint of each drive */
    size_t *spring_joint;    /* joint of each enabled parallel spring */
    size_t *passive_joint;   /* joint of each passive spring or damper */
    size_t *hydraulic_joint; /* joint of each cylinder */
    struct plant_free_inverse *free_inverse;

    double *state;
    bool handed_out; /* plant_state was called: a caller may write the state */
    /* nlive pairs: pairs with bristles that are not 0, and pairs in the last contact */
    int *live;
    size_t nlive;
    int64_t time_ns;
    struct plant_command command;
    struct plant_sensors sensors;
    struct wrench *push; /* by body, world frame */
    bool pushing;        /* some push is not zero */
    bool clamped;        /* the links are clamped */
    bool stepped;        /* last_good is the result of an implicit step of the unclamped robot */
    bool balanced;       /* the clamp also holds the rotors and carries no load: plant_settle */

    /* Constant over a step */
    struct robot_sea *sea; /* of each drive: parameters in its condition */
    unsigned *condition;   /* of each drive: bits of enum drive_condition */
    double *voltage;       /* of each drive, after saturation */
    bool *bridge_on;
    struct effects_bridge *bridge; /* of each drive with effects */
    struct effects_mode *mode;     /* of each drive with effects, in a substep of rk4 and dopri5 */
    /* Of each drive: its own current controller, and the last ndelayed commands to it, one a
     * substep */
    struct current_loop *loop;
    struct loop_command **delayed;
    size_t *ndelayed;
    bool has_loops;          /* a controller is on */
    size_t substeps;         /* number of substeps with controllers */
    double within_s;         /* time of an evaluated state from the start of its substep */
    double *pretension_rate; /* of each parallel spring */
    double *valve_voltage;   /* of each cylinder */

    /* Scratch of one evaluation */
    double *q; /* generalized coordinates, with a unit quaternion */
    double *tau, *vdot;
    struct wrench *ext;         /* by body, body frame */
    struct body_motion *motion; /* by body */
    struct contact_wrench *contact_wrench;
    const double
        *bristle_rate;    /* nbristle, valid for the live pairs; points into the contact memory */
    bool bristles_follow; /* the derivative of the bristles is bristle_rate, else 0 */
    struct plant_contact_memory *contact_memory;
    struct body_motion *whole_motion; /* of the robot's bodies */
    /* state before a substep. If plant_state was called: after plant_step, the state at its end */
    double *last_good;
    int *kept; /* nkept pairs: pairs with bristles in last_good that are not 0 */
    size_t nkept;
    double *scratch;
    double *lost; /* rounding errors of the state (integrator_rk4) */
    struct integrator_dopri5 dopri5;
    struct implicit *implicit; /* NULL for other integrators */

    /* Of the last sample */
    bool sampled_step;                  /* the forces are from an implicit step */
    struct body_motion *sampled_motion; /* by body */
    struct contact_wrench *sampled_wrench;
    struct contact_wrench *peak; /* by contact body: wrench with the largest force in the steps */
    double *peak_force;          /* by contact body: magnitude of that force, N */
    /* by contact body: impulse in the steps, N s, and its moment about the world's origin */
    struct contact_wrench *impulse;
    double impulse_s; /* duration of the impulses */
    struct body_acceleration *acceleration;
    /* Only with bending, by body: acceleration, and load on the joint that moves the body, world
     * frame */
    struct body_acceleration *bending_acceleration;
    struct wrench *bending_load;

    double start_mechanical, start_contact; /* stored energies at the start, J */
    struct plant_account account;
    struct contact_patch *patch;
    enum error_code step_code; /* error of the current substep */
    const char *failure;
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

/* plant_joint_position and plant_joint_rate return position and rate of joint j. */
static inline double plant_joint_position(const struct plant *plant, const double *state, size_t j)
{
    return state[plant->at.v - plant->config.robot->njoint + j];
}

static inline double plant_joint_rate(const struct plant *plant, const double *state, size_t j)
{
    return state[plant->at.drive - plant->config.robot->njoint + j];
}

/* ---- drives with effects, and the supply: plant_effects.c ---- */

/* Parts of each drive's effects in the state, if some drive has effects. The last is there if some
 * drive has a presliding stiffness. */
enum plant_effect_part {
    EFFECT_HYSTERESIS, /* N m */
    EFFECT_WINDING,    /* deg C */
    EFFECT_HOUSING,    /* deg C */
    EFFECT_GRIP,       /* N m */
    PLANT_EFFECT_STATE,
};

/* plant_effects_state reads the whole state of a drive with effects; plant_effects_store writes
 * it. */
struct effects_state plant_effects_state(const struct plant *plant, const double *state, size_t d);
void plant_effects_store(const struct plant *plant, size_t d, const struct effects_state *effects,
                         double *state);

/* Return values of a drive: plant_effects_torque the torque on the joint of a drive with effects, N
 * m; plant_drive_torque the torque of any drive; plant_drive_energy the stored energy, J. */
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

/* Resets the effects to relaxed springs and ambient temperature, and charges the bus. */
void plant_effects_reset(struct plant *plant);

/* Computes the bridge state of a drive with effects from its held voltage and the supply
 * voltage. */
void plant_effects_hold(struct plant *plant, size_t d, double supply);

/* Returns the terminal voltage at which a drive at rest carries the current I, V. */
double plant_holding_voltage(const struct plant *plant, size_t d, double I);

/* Computes the rates of a drive with effects in the mode of the substep; work may be NULL. */
void plant_effects_derive(const struct plant *plant, const double *state, size_t d,
                          double *derivative, double *work);

/* For integrators without events: plant_effects_begin selects the modes for a substep.
 * plant_effects_end sets values to zero that crossed zero in the substep. */
void plant_effects_begin(struct plant *plant);
void plant_effects_end(struct plant *plant);

/* Current controllers: plant_loop.c. plant_loop_create allocates the commands under way;
 * returns false if the arena is full. plant_loop_hold takes the command of a drive at the start
 * of a step. plant_loops_begin and plant_loops_end frame a substep of h seconds. */
bool plant_loop_create(struct plant *plant, struct arena *arena);
void plant_loop_hold(struct plant *plant, size_t d, double supply);
void plant_loops_begin(struct plant *plant);
void plant_loops_end(struct plant *plant, double h);

/* Returns the voltage of a drive in a state, V: the held voltage, or the voltage that its current
 * controller sets. */
double plant_drive_voltage(const struct plant *plant, const double *state, size_t d);

/* Computes the rates of the bus; work may be NULL. */
void plant_supply_derive(const struct plant *plant, const double *state, double *derivative,
                         double *work);

/* Advances the bus by a step of h seconds in which the bridges took this energy, J. */
void plant_supply_advance(struct plant *plant, double energy, double h);

/* Returns the voltage of the supply in the present state, under the load of the bridges. */
double plant_supply(const struct plant *plant);

/* Sets the kind of the clamp and stops the rotors. balanced: the clamp of a clamped robot also
 * holds the rotors and carries no load. Otherwise it is an ordinary clamp. */
void plant_balance(struct plant *plant, bool balanced);

/* ---- energy: plant_energy.c, plant_account.c ---- */

/* Returns the stored energy of motion, gravity, springs, stops, couplings, oil, windings and bus,
 * J. */
double plant_stored_mechanical(struct plant *plant);

/* Add to the account over h seconds: plant_account_step the powers of the state after a substep,
 * plant_account_load the powers of external forces. */
void plant_account_step(struct plant *plant, double h);
void plant_account_load(struct plant *plant, double h, const struct plant_load *load);

/* ---- hydraulic joints: plant_hydraulic.c ---- */

/* Returns the offset of the supply's pressure in the state. */
static inline size_t plant_hydraulic_supply(const struct plant *plant)
{
    return plant->at.hydraulic + HYDRAULIC_STATE * plant->nhydraulic;
}

/* Returns the inputs of cylinder c from the plant. */
struct hydraulic_port plant_hydraulic_port(const struct plant *plant, const double *state,
                                           size_t c);

/* plant_hydraulic_reset sets the cylinders to rest and charges the supply. plant_hydraulic_hold
 * holds the commanded valve voltages. plant_hydraulic_torque returns the torque of cylinder c on
 * its joint, N m. plant_hydraulic_sample fills the sensors of the cylinders. */
void plant_hydraulic_reset(struct plant *plant);
void plant_hydraulic_hold(struct plant *plant);
double plant_hydraulic_torque(const struct plant *plant, const double *state, size_t c);
void plant_hydraulic_sample(struct plant *plant);

/* Closes the valve of cylinder c and sets its pressures so that it exerts this torque on its joint.
 * Returns false if supply and return pressures do not allow it. */
bool plant_hydraulic_load(struct plant *plant, size_t c, double torque);

double plant_hydraulic_energy(const struct plant *plant, const double *state);

/* Adds the powers of a cylinder, and of the supply, to the accounts. */
void plant_hydraulic_account(const struct hydraulic_power *power, double supply, double *work);
void plant_hydraulic_account_supply(const struct hydraulic_supply_power *power, double *work);

/* Computes the rates of cylinders and supply; work may be NULL. */
void plant_hydraulic_derive(const struct plant *plant, const double *state, double *derivative,
                            double *work);

/* Returns the depth of joint j past its limits, as in model/stop.h. */
static inline double plant_joint_depth(const struct plant *plant, const double *state, size_t j)
{
    const struct robot_joint *joint = &plant->config.robot->joint[j];

    return stop_depth(joint->lower, joint->upper, plant_joint_position(plant, state, j));
}

/* Computes the derivative of the state (an integrator_function; the context is the plant). On
 * failure sets step_code and failure, and the rates are zero. */
void plant_derivative(void *plant, double t, const double *state, double *derivative);

/* Return losses, W: plant_stop_loss of the joint stops, plant_spring_loss of passive springs and
 * couplings. */
double plant_stop_loss(const struct plant *plant, const double *state);
double plant_spring_loss(const struct plant *plant, const double *state);

/* Fills q, ext, tau, vdot and the free bodies' motion from state; with contact, also the robot's
 * motion and contact_wrench. */
enum error_code plant_evaluate(struct plant *plant, const double *state, struct plant_load *load);

/* Performs the part of plant_evaluate before the dynamics: fills q, ext, the motions and
 * bristle_rate, with or without contact. bristle: bristle state (nbristle). ahead_s: time ahead
 * (struct contact_bristles). */
enum error_code plant_load_bodies(struct plant *plant, const double *state, const double *bristle,
                                  double ahead_s, struct plant_load *load);

/* Fills ext with contact wrenches and pushes, for plant_load_bodies. Reads the results of
 * plant_place and, with contact, the robot's motion and contact_wrench. v: rates of the robot. Adds
 * the powers to load. */
void plant_apply_loads(struct plant *plant, const double *v, struct plant_load *load);

/* Evaluates contact for plant_load_bodies. Fills the robot's motion, contact_wrench and
 * bristle_rate from v, the bristles and the results of plant_place. Returns the engine's failure,
 * if any, and sets plant->failure. RT-safe if the engine is. */
enum error_code plant_contact_evaluate(struct plant *plant, const double *v, const double *bristle,
                                       double ahead_s);

/* plant_forget_peaks resets peaks and impulses of contact. plant_raise_peak stores a wrench on
 * contact body c if its force is the largest since that reset. RT-safe. */
void plant_forget_peaks(struct plant *plant);
void plant_raise_peak(struct plant *plant, size_t c, const struct contact_wrench *wrench);

/* Fills bending_nm of all joints from vdot, ext and q of the sample. RT-safe. */
void plant_sample_bending(struct plant *plant);

/* Lists the pairs with bristles that are not 0, in ascending order. Checks only the last listed
 * pairs, unless plant_state was called; then it checks all bristles. RT-safe. */
void plant_list_bristles(struct plant *plant);

/* Lists the pairs with bristles that are not 0 after the whole state was set: checks all bristles.
 * RT-safe. */
void plant_find_bristles(struct plant *plant);

/* Copies the state to last_good. Of the bristles it copies only the live pairs, since all others
 * are 0. RT-safe. */
void plant_keep_state(struct plant *plant);

/* Copies last_good back to the state. Only live pairs can have changed. RT-safe. */
void plant_return_state(struct plant *plant);

/* Removes pairs whose bristles have relaxed to 0 from the live pairs. RT-safe. */
void plant_drop_bristles(struct plant *plant);

/* Writes at most max of the engine's tangents at the last evaluation; returns their number. The
 * engine must provide tangents. RT-safe when the engine's function is. */
size_t plant_contact_tangents(struct plant *plant, struct contact_tangent *tangent, size_t max);

/* Allocates the contact memory and its arrays in the arena; returns false if the arena is full.
 * Not RT-safe. */
bool plant_contact_create(struct plant *plant, struct arena *arena);

/* Copies the generalized coordinates of state to plant->q with a unit quaternion, and fills the
 * free bodies' motion. */
void plant_place(struct plant *plant, const double *state);

void plant_normalize_quaternion(double quaternion[4]);

/* Returns the offset of a part of a free body's state. */
static inline size_t plant_free_offset(const struct plant *plant, size_t body,
                                       enum plant_free_part part)
{
    return plant->at.free + PLANT_FREE_STATE * body + (size_t)part;
}

/* plant_free_reset sets the free bodies in plant->state to their initial states and inverts their
 * inertias; plant_free_normalize normalizes their quaternions. */
void plant_free_reset(struct plant *plant);
void plant_free_normalize(struct plant *plant);

/* The free bodies' parts: plant_free_place fills plant->motion, plant_free_derive the derivative
 * (from motion and ext). plant_free_energy returns kinetic and potential energy, J. */
void plant_free_place(struct plant *plant, const double *state);
void plant_free_derive(const struct plant *plant, const double *state, double *derivative);
double plant_free_energy(const struct plant *plant, const double *state);

#endif
