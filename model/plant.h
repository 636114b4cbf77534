/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant: rigid-body dynamics, drives, parallel springs and contact joined into one system of
 * ordinary differential equations, integrated together (the paper's strong coupling).
 *
 * State, one flat array: q (nq), v (nv), then qm, qmd, I for each joint with a drive, in joint
 * order, then the dissipated-energy integrals when asked for. Time is int64_t ns.
 */
#ifndef MODEL_PLANT_H
#define MODEL_PLANT_H

#include "contact/contact.h"
#include "model/dynamics.h"
#include "model/plant_io.h"

struct plant;

enum plant_integrator { PLANT_RK4 };

struct plant_config {
    const struct robot *robot;
    const struct dynamics *dynamics;
    struct contact_world *contact; /* NULL = none; not owned */
    const int *contact_body;       /* body of each of the world's ncontact motions */
    size_t ncontact;
    enum plant_integrator integrator;
    int64_t substep_ns;     /* h */
    double supply_v;        /* terminal voltages are clipped to +-supply_v */
    bool account_energy;    /* integrate the power balance too (plant_energy) */
};

/* Energies since the start, J. balance = electrical + work of external pushes - (what is stored now
 * - what was stored at the start) - all dissipation: zero for an exact integration. */
struct plant_energy {
    double electrical_in, joule_heat, motor_friction, spring_damping, contact_dissipation;
    double stored; /* kinetic, gravity, springs, windings, contact layers */
    double balance;
};

/* Memory from arena. Not RT-safe. */
enum error_code plant_create(const struct plant_config *config, struct arena *arena,
                             struct plant **plant, struct error *error);

/* Sets a pose at rest: joints at the pose with springs relaxed (qm = q), no current. Not RT-safe. */
void plant_reset(struct plant *plant, const double base_position[3],
                 const double base_quaternion[4], const double *joint);

/* The command struct to write voltages into before plant_step, and the sensors that plant_sample
 * fills; both owned by the plant. */
struct plant_command *plant_command(struct plant *plant);
const struct plant_sensors *plant_sensors(const struct plant *plant);

/* Advances by steps substeps with the command held. Returns the contact engine's failure, if any.
 * RT-safe when the contact engine is. */
enum error_code plant_step(struct plant *plant, size_t steps);

/* Fills the sensors from the present state. RT-safe when the contact engine is. */
enum error_code plant_sample(struct plant *plant);

/* The flat state (read and, for tests, written) and its length; wrenches on contact bodies at the
 * last sample (world frame, about the body's origin). */
double *plant_state(struct plant *plant, size_t *count);
const struct contact_wrench *plant_contact_wrenches(const struct plant *plant);

/* Virtual time of the state. */
int64_t plant_time_ns(const struct plant *plant);

/* FNV hash of state and time: equal runs have equal hashes. */
uint64_t plant_hash(const struct plant *plant);

void plant_energy(struct plant *plant, struct plant_energy *energy);

/* A push from outside on a body, world frame at the body's origin, until changed. RT-safe. */
void plant_set_push(struct plant *plant, int body, const double force[3], const double moment[3]);

/* Centre of mass (m) and total momentum (kg m/s), world frame. */
void plant_centre_of_mass(struct plant *plant, double position[3], double momentum[3]);

#endif
