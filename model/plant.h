/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant: rigid-body dynamics, drives, parallel springs and contact as one system of ordinary
 * differential equations, integrated together (the paper's strong coupling).
 *
 * The state is one flat array with these parts in order:
 * - q (nq), v (nv);
 * - enum plant_drive_part for each joint with a drive, in joint order;
 * - p for each joint with an enabled parallel spring;
 * - enum plant_free_part for each free body;
 * - hysteresis, winding and housing temperature of each drive, if any drive has effects
 *   (model/drives/effects.h);
 * - the bus of the supply, if there is one (model/drives/supply.h);
 * - enum hydraulic_part for each hydraulic joint, and the pressure of their supply
 *   (model/hydraulics/hydraulic.h);
 * - with account_energy, the integrals of the powers;
 * - the bristles of sticking friction (contact.h), enum contact_bristle_part for each pair.
 *
 * A joint without a drive has no actuator state. Its torque comes from its parallel spring, the
 * stops of its range (model/stop.h) and its coupling to another joint (model/coupling.h). Time is
 * int64_t ns.
 *
 * Free bodies belong to the scene: they are rigid, have no joints, and move by gravity, contact and
 * pushes. Body indices count them after the robot's bodies: free[i] is body nbody + i. Bodies that
 * never move are not bodies here but surfaces of the world.
 *
 * A command is held during one call of plant_step: voltages are constant, and the pretension of a
 * parallel spring moves at a constant rate to reach its target at the end of the call.
 *
 * A drive in a condition (plant_io.h) has changed parameters. The energy that its spring or rotor
 * had stored when it broke or jammed counts as motor friction.
 */
#ifndef MODEL_PLANT_H
#define MODEL_PLANT_H

#include "contact/contact.h"
#include "model/dynamics.h"
#include "model/plant_io.h"
#include "model/drives/supply.h"

struct plant;

/* Integration schemes. rk4: the paper's scheme, for short steps. implicit: the scheme for real
 * time, of order 2, stable with long steps, exact for drives at constant voltage
 * (model/implicit/implicit.c, docs/integrator.md). dopri5: adaptive with a tolerance, for any
 * substep; slow, a reference for the others; not RT-safe. */
enum plant_integrator { PLANT_RK4, PLANT_IMPLICIT, PLANT_DOPRI5 };

/* A free body at its start. Its center of mass need not be the origin of its frame. */
struct plant_free_body {
    const char *name;
    struct robot_inertia inertia; /* mass and principal moments > 0 */
    double position[3];           /* of the body's origin, world, m */
    double quaternion[4];         /* wxyz, body to world; any length except zero */
    double v[3];                  /* of the body's origin, world, m/s */
    double w[3];                  /* world, rad/s */
};

/* Parts of a drive's state, link side of the gear. */
enum plant_drive_part {
    DRIVE_MOTOR_POSITION, /* qm, rad */
    DRIVE_MOTOR_SPEED,    /* qm', rad/s */
    DRIVE_CURRENT,        /* I, A */
    PLANT_DRIVE_STATE,    /* number of parts */
};

/* Offsets of the parts of a free body's state. */
enum plant_free_part {
    PLANT_FREE_POSITION = 0,   /* of its center of mass, world, m */
    PLANT_FREE_QUATERNION = 3, /* wxyz, body to world */
    PLANT_FREE_VELOCITY = 7,   /* of its center of mass, world, m/s */
    PLANT_FREE_SPIN = 10,      /* angular velocity, body frame, rad/s */
    PLANT_FREE_STATE = 13,     /* number of parts */
};

struct plant_config {
    const struct robot *robot;
    const struct dynamics *dynamics;    /* dynamics of the same robot; used by this thread only */
    const struct plant_free_body *free; /* nfree; copied, except the names */
    size_t nfree;
    /* contact engine, NULL = none; the caller owns it; only the plant may evaluate it */
    struct contact_world *contact;
    const int *contact_body; /* body of each of the engine's ncontact motions; copied */
    size_t ncontact;
    enum plant_integrator integrator;
    int64_t substep_ns; /* length h of a substep */
    double rtol, atol;  /* tolerances of dopri5 for each number of the state */
    double supply_v;    /* terminal voltages are clipped to +-supply_v */
    /* resistance of the source: the supply sags under load; 0 = none */
    double supply_ohm;
    struct supply_bus bus; /* bus behind the source; capacitance 0 = none */
    bool bending;          /* also sample the moments across the joints' axes */
    bool account_energy;   /* also integrate the power balance (plant_energy) */
    /* clock for the time of the contact engine; RT-safe; NULL = not measured */
    int64_t (*now_ns)(void *clock);
    void *clock; /* argument of now_ns */
};

/* Cost of the contact engine since the plant was created. */
struct plant_contact_cost {
    /* evaluations by the engine; results reused from memory do not count */
    uint64_t evaluations;
    int64_t spent_ns; /* time spent in evaluations and tangents, measured by config.now_ns */
};

/* Largest number of contact patches whose stored energy plant_energy counts. */
enum { PLANT_PATCHES = 256 };

/* Energies since the start, J.
 *
 * balance = input - growth of stored energy - losses; it is zero for an exact integration. Input:
 * electrical_in, pretension_work, push_work. Losses: joule_heat, motor_friction, spring_damping,
 * parallel_damping, stop_loss, contact_dissipation; with effects of drives gear_friction,
 * gear_hysteresis and bridge_loss (of diodes); with a bus source_loss and chopper_heat.
 * electrical_in is the energy that the bridges take, or with a bus the energy that its source
 * gives. stop_loss is for the joints' stops; losses of the stops of series springs, of passive
 * springs and of couplings are in spring_damping.
 *
 * Contact enters the balance by the work of its wrenches on the bodies, independent of the
 * engine's own energies: contact_dissipation is minus that work, minus the growth of the energy
 * that the patches report as stored. For an engine that reports no potential, it includes the
 * stored part. */
struct plant_energy {
    double electrical_in, pretension_work, push_work;
    double joule_heat, motor_friction, spring_damping, parallel_damping, stop_loss;
    double contact_dissipation;
    double gear_friction, gear_hysteresis, bridge_loss, source_loss, chopper_heat;
    double hydraulic_in, orifice_loss, leakage_loss, cylinder_friction, relief_loss;
    double stored; /* kinetic, gravity, springs, stops, couplings, windings, contacts, bus, oil */
    double balance;
};

/* Checks that a free body has a physically possible inertia without zeros, and a valid start. The
 * error gives the reason. Not RT-safe. */
enum error_code plant_check_free_body(const struct plant_free_body *body, struct error *error);

/* Creates a plant in the arena, in the reset state with the base at the origin and all joints at
 * zero. Fails for a substep or supply <= 0, a contact or sensor body that the robot does not mark
 * as observed, a free body that fails its check, or no memory. Not RT-safe. */
enum error_code plant_create(const struct plant_config *config, struct arena *arena,
                             struct plant **plant, struct error *error);

/* Sets a pose at rest at time zero: joints at the pose with relaxed springs (qm = q), no current,
 * no push, pretensions as commanded, free bodies at their starts. Restarts the energies and samples
 * the sensors. Keeps the command. With a fixed base the base arguments have no effect and may be
 * NULL. Returns the contact engine's failure, if any. */
enum error_code plant_reset(struct plant *plant, const double base_position[3],
                            const double base_quaternion[4], const double *joint);

/* plant_command returns the command to write before plant_step; plant_sensors returns the sensors
 * that plant_sample fills. The plant owns both. A voltage that is NAN counts as 0 V. */
struct plant_command *plant_command(struct plant *plant);
const struct plant_sensors *plant_sensors(const struct plant *plant);

/* Advances by `steps` substeps with the command held. A bridge that is off carries no current; the
 * magnetic energy at its opening counts as heat. Returns the contact engine's failure, or
 * ERROR_INPUT if the state is no longer finite (a substep too long for the stiffness). After a
 * failure, state and time are at the end of the last good substep, and plant_failure gives the
 * reason. RT-safe if the contact engine is. */
enum error_code plant_step(struct plant *plant, size_t steps);

/* Returns one sentence on the last failure of plant_step, plant_sample, plant_reset or
 * plant_energy, or "" if there was none. The plant or the contact engine owns the text. RT-safe. */
const char *plant_failure(const struct plant *plant);

/* Fills the sensors from the present state. After a failure they keep their last values. Contact
 * forces and accelerations follow from the state by the laws of contact and motion. After a
 * plant_step of the implicit integrator they come from the step's last stage, until a caller sets
 * the state or an input. So accelerations, forces and motion agree.
 *
 * A force-torque sensor measures all contact and pushes on its body, and the weight and inertia of
 * its distal part. It does not measure bodies joined to its body. The reading is the wrench that
 * the distal part exerts through the sensor. For a robot at rest on its foot, the force along up is
 * positive and equals the carried weight. RT-safe if the contact engine is. */
enum error_code plant_sample(struct plant *plant);

/* plant_values returns the flat state and its length, read-only. plant_state returns the state for
 * writing, at any later time too. After its first call, each step checks the whole state for
 * changes. RT-safe. */
const double *plant_values(const struct plant *plant, size_t *count);
double *plant_state(struct plant *plant, size_t *count);

/* Returns the wrenches on contact bodies at the last sample (ncontact entries, world frame, about
 * the body's origin). RT-safe. */
const struct contact_wrench *plant_contact_wrenches(const struct plant *plant);

/* Returns the largest force on each contact body within the last plant_step, N. With the implicit
 * integrator it is the maximum of the mean forces of its steps and of the last sample. At impacts a
 * step is as short as a sixteenth of a substep. With other integrators, for a clamped robot, or if
 * the state was set between steps, it is the force of the last sample. RT-safe. */
const double *plant_contact_peaks(const struct plant *plant);

/* Computes the mean wrench on contact body c over the last plant_step, world frame: the impulse
 * divided by the duration. The moment is about the body's origin at the last sample, not about an
 * origin that moves. It is exact for the implicit integrator's scheme. In the other cases of
 * plant_contact_peaks it is the wrench of the last sample. RT-safe. */
void plant_contact_mean(const struct plant *plant, size_t c, struct contact_wrench *mean);

/* Copies at most max contact patches of the last sample and returns their number. A patch is the
 * wrench of one pair in contact. Call it before the next plant_step or plant_energy. RT-safe. */
size_t plant_patches(const struct plant *plant, struct contact_patch *patch, size_t max);

/* Returns poses and velocities at the last sample, at the origins of the bodies' frames: nbody
 * entries for the robot, then nfree entries for the free bodies. Of the robot's entries, only those
 * of observed bodies are set. */
const struct body_motion *plant_motion(const struct plant *plant);

/* Returns poses and velocities of all bodies of the robot in the present state, observed or not.
 * They are valid until the next call of a plant function. Takes one pass over the tree. RT-safe. */
const struct body_motion *plant_whole_motion(struct plant *plant);

/* Computes the pose of free body i in the present state: position of its origin (m), quaternion
 * wxyz. RT-safe. */
void plant_free_pose(const struct plant *plant, size_t i, double pose[7]);

/* Returns the cost of contact evaluations so far. Owned by the plant. RT-safe. */
const struct plant_contact_cost *plant_contact_cost(const struct plant *plant);

/* Returns the plant's memory of its contact engine, *size bytes within the arena. It belongs to the
 * present engine, not to a point of virtual time. A caller that copies and restores the arena must
 * exclude this memory. */
void *plant_contact_memory(const struct plant *plant, size_t *size);

/* Returns the virtual time of the state. */
int64_t plant_time_ns(const struct plant *plant);

/* Returns the FNV hash of state and time; equal runs have equal hashes. */
uint64_t plant_hash(const struct plant *plant);

/* Computes the energies of the present state. Without account_energy only stored is filled, and
 * the rest is zero. Returns the contact engine's failure, or ERROR_MEMORY for more than
 * PLANT_PATCHES patches. RT-safe when the contact engine is. */
enum error_code plant_energy(struct plant *plant, struct plant_energy *energy);

/* Energy that appeared without work or loss that explains it. */
struct plant_created {
    /* energy that appeared; work and losses in the same span */
    double energy_j, turnover_j;
    int64_t span_ns; /* length of the span, which ends at the present state */
    bool contact;    /* true: from contacts; false: in the motion */
};

/* Checks the energy account since the last check, and since the account began (plant_account.c).
 * Returns true and fills created if too much energy appeared: the integrator diverges, or a law is
 * too stiff for its steps. The limit is a fifth of the turnover plus the energy that lifts the
 * robot by 2 cm. The account then begins again, as it does after a clamp. Robots with hydraulic
 * joints have no account. Call it after plant_sample. RT-safe. */
bool plant_check_energy(struct plant *plant, struct plant_created *created);

/* Restarts the energies at the present state, after a caller has written the state through
 * plant_state. Returns the errors of plant_energy. RT-safe if the contact engine is. */
enum error_code plant_restart_energy(struct plant *plant);

/* Sets an external push on a body (0 to nbody + nfree - 1), in the world frame at the body's
 * origin. The push lasts until the next call for this body. RT-safe. */
void plant_set_push(struct plant *plant, int body, const double force[3], const double moment[3]);

/* Gets the sizes of force and moment of the push on a body. RT-safe. */
void plant_push(const struct plant *plant, int body, double size[2]);

/* Sets the voltage of the source without load and sag (config.supply_v) from the next step on.
 * RT-safe. */
void plant_set_source(struct plant *plant, double supply_v);
double plant_source(const struct plant *plant);

/* Clamps every link at its present place, or releases all links. In a clamped robot only the drives
 * move, behind their springs. The clamp carries all contact forces and pushes on the robot, so the
 * wrenches of its bodies read zero. Free bodies still move; for them a clamped robot is a rigid
 * obstacle. A robot starts clamped so that it does not fall before its motors are on. Clamping
 * stops the links. plant_reset does not change the clamp. After plant_settle the clamp also holds
 * the rotors and carries no load: the contacts carry the robot, and the sensors measure them. The
 * rotors are released together with the links. RT-safe. */
void plant_clamp(struct plant *plant, bool clamped);
bool plant_is_clamped(const struct plant *plant);

/* Computes the center of mass (m) and total linear momentum (kg m/s) of the robot, without the
 * free bodies, in the present state, world frame. RT-safe. */
void plant_center_of_mass(struct plant *plant, double position[3], double momentum[3]);

#endif
