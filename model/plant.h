/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant: rigid-body dynamics, drives, parallel springs and contact joined into one system of
 * ordinary differential equations, integrated together (the paper's strong coupling).
 *
 * State, one flat array: q (nq), v (nv), then an enum plant_drive_part for each joint with a
 * drive, in joint order, then p for each joint with an enabled parallel spring, then an enum
 * plant_free_part for each free body, then hysteresis, winding and housing temperature of each
 * drive where some drive has effects (model/drives/effects.h), the bus of the supply if there is
 * one (model/drives/supply.h), an enum hydraulic_part for each hydraulic joint and the pressure of
 * their supply (model/hydraulics/hydraulic.h), with account_energy the integrals of the powers, and
 * at last the bristles of sticking friction (contact.h), an enum contact_bristle_part for each
 * pair. Joints without a drive have no actuator state and no torque but that of their parallel
 * spring, of the stops at the ends of their range (model/stop.h) and of their coupling to another
 * joint (model/coupling.h). Time is int64_t ns.
 *
 * Free bodies are the scene's: rigid, joined to nothing, moved by gravity, contact and pushes.
 * Wherever a body is meant by its index they follow the robot's: free[i] is body nbody + i. (Bodies
 * that never move are no bodies here, but surfaces of the world.)
 *
 * A command is held over one call of plant_step: voltages stay, the pretension of a parallel spring
 * moves at a constant rate so that it is reached at the end of the call.
 *
 * A drive in a condition (plant_io.h) is one whose parameters differ: what its spring or its rotor
 * had stored when it broke or jammed counts as motor friction.
 */
#ifndef MODEL_PLANT_H
#define MODEL_PLANT_H

#include "contact/contact.h"
#include "model/dynamics.h"
#include "model/plant_io.h"
#include "model/drives/supply.h"

struct plant;

/* rk4: the paper's, for steps short enough. implicit: order 2, stable with long steps, drives exact
 * for the voltage held; the one for real time (model/implicit/implicit.c, docs/integrator.md).
 * dopri5: adaptive, any substep, as accurate as asked and as slow as that takes: the oracle; not
 * RT-safe. */
enum plant_integrator { PLANT_RK4, PLANT_IMPLICIT, PLANT_DOPRI5 };

/* A free body as it starts. Its center of mass need not be the origin of its frame. */
struct plant_free_body {
    const char *name;
    struct robot_inertia inertia; /* mass and principal moments > 0 */
    double position[3];           /* of the body's origin, world, m */
    double quaternion[4];         /* wxyz, body to world, of any length but zero */
    double v[3];                  /* of the body's origin, world, m/s */
    double w[3];                  /* world, rad/s */
};

/* Parts of a drive's state, link side of the gear. */
enum plant_drive_part {
    DRIVE_MOTOR_POSITION, /* qm, rad */
    DRIVE_MOTOR_SPEED,    /* qm', rad/s */
    DRIVE_CURRENT,        /* I, A */
    PLANT_DRIVE_STATE,    /* their number */
};

/* Offsets of the parts of a free body's state. */
enum plant_free_part {
    PLANT_FREE_POSITION = 0,   /* of its center of mass, world, m */
    PLANT_FREE_QUATERNION = 3, /* wxyz, body to world */
    PLANT_FREE_VELOCITY = 7,   /* of its center of mass, world, m/s */
    PLANT_FREE_SPIN = 10,      /* angular velocity, body frame, rad/s */
    PLANT_FREE_STATE = 13,     /* their number */
};

struct plant_config {
    const struct robot *robot;
    const struct dynamics *dynamics;    /* of the same robot; used by no other thread */
    const struct plant_free_body *free; /* nfree; copied, but for the names */
    size_t nfree;
    struct contact_world *contact; /* NULL = none; not owned, and nobody else's to evaluate */
    const int *contact_body;       /* body of each of the world's ncontact motions; copied */
    size_t ncontact;
    enum plant_integrator integrator;
    int64_t substep_ns;             /* h */
    double rtol, atol;              /* of dopri5, for each number of the state */
    double supply_v;                /* terminal voltages are clipped to +-supply_v */
    double supply_ohm;              /* of the source: the supply sags under load; 0 = none */
    struct supply_bus bus;          /* behind it; capacitance 0 = none */
    bool bending;                   /* sample the moments across the joints' axes too */
    bool account_energy;            /* integrate the power balance too (plant_energy) */
    int64_t (*now_ns)(void *clock); /* to time the contact engine by; RT-safe; NULL = untimed */
    void *clock;                    /* handed to now_ns */
};

/* Cost of the plant's contact engine since the plant was made. */
struct plant_contact_cost {
    uint64_t evaluations; /* that the engine was asked for; others came from memory */
    int64_t spent_ns;     /* in them and in its tangents, by the configuration's clock */
};

/* Most contact patches whose stored energy plant_energy counts. */
enum { PLANT_PATCHES = 256 };

/* Energies since the start, J. balance = what was put in (electrical_in, pretension_work,
 * push_work) - (what is stored now - what was stored at the start) - what was lost (joule_heat,
 * motor_friction, spring_damping, parallel_damping, stop_loss, contact_dissipation, and with
 * effects of drives gear_friction, gear_hysteresis and bridge_loss (of diodes), with a bus
 * source_loss and chopper_heat): zero for an exact integration. electrical_in is what the bridges
 * take, with a bus what its source gives. stop_loss is that of the joints' stops; what the stops of
 * series springs, passive springs and the couplings of joints lose is in spring_damping.
 *
 * Contact enters the balance by the work of its wrenches on the bodies, whatever the engine says of
 * its own energies: contact_dissipation is that work, negated, less the growth of what the patches
 * report as stored. With an engine that reports no potential it holds the stored part too. */
struct plant_energy {
    double electrical_in, pretension_work, push_work;
    double joule_heat, motor_friction, spring_damping, parallel_damping, stop_loss;
    double contact_dissipation;
    double gear_friction, gear_hysteresis, bridge_loss, source_loss, chopper_heat;
    double hydraulic_in, orifice_loss, leakage_loss, cylinder_friction, relief_loss;
    double stored; /* kinetic, gravity, springs, stops, couplings, windings, contacts, bus, oil */
    double balance;
};

/* Checks whether a free body has the inertia of some body, none of it zero, and a place to start
 * from; the error says why not. Not RT-safe. */
enum error_code plant_check_free_body(const struct plant_free_body *body, struct error *error);

/* Creates a plant in the arena. The state is the reset one with the base at the origin and all
 * joints at zero. Fails on a substep or supply <= 0, a contact or sensor body that the robot
 * does not mark as observed, a free body that fails its check, no memory. Not RT-safe. */
enum error_code plant_create(const struct plant_config *config, struct arena *arena,
                             struct plant **plant, struct error *error);

/* Sets a pose at rest at time zero: joints at the pose with springs relaxed (qm = q), no current,
 * no push, pretensions where the command has them, free bodies as they start; energies count from
 * here and the sensors are sampled. Base arguments are ignored (may be NULL) with a fixed base. The
 * command is kept. Returns the contact engine's failure, if any. */
enum error_code plant_reset(struct plant *plant, const double base_position[3],
                            const double base_quaternion[4], const double *joint);

/* Return the command struct to write voltages into before plant_step, and the sensors that
 * plant_sample fills; both owned by the plant. A voltage that is not a number counts as 0 V. */
struct plant_command *plant_command(struct plant *plant);
const struct plant_sensors *plant_sensors(const struct plant *plant);

/* Advances by steps substeps with the command held. A bridge that is off carries no current; the
 * magnetic energy it had when it opened counts as heat. Fails when the contact engine fails, or
 * with ERROR_INPUT when the state stops being finite (a substep too long for the stiffness); the
 * state and the time are then those of the last good substep, and plant_failure tells why. RT-safe
 * when the contact engine is. */
enum error_code plant_step(struct plant *plant, size_t steps);

/* Returns one sentence on the last failure of plant_step, plant_sample, plant_reset or
 * plant_energy; "" when there was none. Owned by the plant or the contact engine. RT-safe. */
const char *plant_failure(const struct plant *plant);

/* Fills the sensors from the present state; on failure they keep their last values. Forces of
 * contact and accelerations are those that the laws give for it; after a plant_step of the implicit
 * integrator, until something is set or written, those that its last stage moved the bodies with,
 * so that accelerations, forces and motion agree. A force-torque sensor feels the contact and
 * pushes on its body (all of which count as below it) and the weight and inertia of its distal
 * part; bodies that are joined to its body count as above it. What the part below exerts through
 * it: a robot at rest on its foot reads + the carried weight along up. RT-safe when the contact
 * engine is. */
enum error_code plant_sample(struct plant *plant);

/* Return the flat state and its length: to be read; to be written too, at any time from then on,
 * for which each step looks through all of it. RT-safe. */
const double *plant_values(const struct plant *plant, size_t *count);
double *plant_state(struct plant *plant, size_t *count);

/* Returns the wrenches on contact bodies at the last sample (ncontact entries, world frame, about
 * the body's origin). RT-safe. */
const struct contact_wrench *plant_contact_wrenches(const struct plant *plant);

/* Returns the largest force on each contact body within the last plant_step, N: of the means over
 * the parts that the implicit integrator divides its steps into where something strikes, down to
 * a sixteenth, and of the last sample; with other integrators, and where a robot is
 * clamped or its state was set between steps, that of the sample. RT-safe. */
const double *plant_contact_peaks(const struct plant *plant);

/* Returns the mean force on contact body c over the last plant_step, world frame, N: its impulse
 * by the length of that, exact for the scheme of the implicit integrator; else as the peaks, the
 * force of the sample. RT-safe. */
void plant_contact_mean(const struct plant *plant, size_t c, double force[3]);

/* Copies the patches of the last sample, until the plant steps or is asked for its energies:
 * what of those wrenches each pair in touch gives. Returns their number, writes at most max.
 * RT-safe. */
size_t plant_patches(const struct plant *plant, struct contact_patch *patch, size_t max);

/* Returns poses and velocities of the robot's bodies (nbody entries) at the last sample; only
 * those of observed bodies are set. */
const struct body_motion *plant_motion(const struct plant *plant);

/* Returns those of all of the robot's bodies in the present state, observed or not, until the
 * next call of the plant; costs a pass over the tree. RT-safe. */
const struct body_motion *plant_whole_motion(struct plant *plant);

/* Returns those of the free bodies (nfree entries), of the origins of their frames. */
const struct body_motion *plant_free_motion(const struct plant *plant);

/* Computes the pose of free body i in the present state: position of its origin (m), quaternion
 * wxyz. RT-safe. */
void plant_free_pose(const struct plant *plant, size_t i, double pose[7]);

/* Returns the contact evaluations so far. Owned by the plant. RT-safe. */
const struct plant_contact_cost *plant_contact_cost(const struct plant *plant);

/* Returns the plant's memory of its contact engine, size bytes within the arena. It belongs to
 * the engine as it is now, not to a moment of virtual time: whoever copies the arena and puts it
 * back later has to leave it out. */
void *plant_contact_memory(const struct plant *plant, size_t *size);

/* Returns the virtual time of the state. */
int64_t plant_time_ns(const struct plant *plant);

/* Returns the FNV hash of state and time: equal runs have equal hashes. */
uint64_t plant_hash(const struct plant *plant);

/* Computes the energies of the present state. Without account_energy only stored is filled, the
 * rest is zero. Returns the contact engine's failure, or ERROR_MEMORY with more than
 * PLANT_PATCHES patches. RT-safe when the contact engine is. */
enum error_code plant_energy(struct plant *plant, struct plant_energy *energy);

/* Makes energies count from the present state on; for a state that was written through
 * plant_state. Returns as plant_energy. RT-safe when the contact engine is. */
enum error_code plant_restart_energy(struct plant *plant);

/* Sets a push from outside on a body (0 to nbody + nfree - 1), world frame at the body's origin,
 * until changed. RT-safe. */
void plant_set_push(struct plant *plant, int body, const double force[3], const double moment[3]);

/* Sets the voltage of the source without load and sag (config.supply_v), from the next step on.
 * RT-safe. */
void plant_set_source(struct plant *plant, double supply_v);
double plant_source(const struct plant *plant);

/* Clamps every link where it is, or lets go: while clamped nothing of the robot moves but the
 * drives behind their springs, and it feels neither contacts nor pushes (the clamp takes them: its
 * bodies' wrenches read zero). Free bodies live on, and lean on a clamped robot as on a rock. A
 * robot starts clamped so that it does not fall before its motors are on. Clamping stops the links;
 * plant_reset leaves the clamp as it is. After plant_settle the clamp holds the rotors too, like
 * brakes that are let go with the links, and carries no load: the contacts do, and are felt.
 * RT-safe. */
void plant_clamp(struct plant *plant, bool clamped);
bool plant_is_clamped(const struct plant *plant);

/* Computes the center of mass (m) and total linear momentum (kg m/s) of the robot, without the
 * free bodies, in the present state, world frame. RT-safe. */
void plant_center_of_mass(struct plant *plant, double position[3], double momentum[3]);

#endif
