/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant's linearly implicit integrator: a Runge-Kutta scheme of two stages and order 2. It is
 * L-stable for all stiff parts (contact, springs). Each stage takes one evaluation of the
 * right-hand side and one linear system with the size and structure of the mechanism. Drives are
 * solved exactly for constant voltage. See implicit.c.
 */
#ifndef MODEL_IMPLICIT_IMPLICIT_H
#define MODEL_IMPLICIT_IMPLICIT_H

#include "model/plant_private.h"

/* Largest number of pairs in contact in a step. */
enum { IMPLICIT_TANGENTS = PLANT_PATCHES };

/* Allocates the scratch for plant in the arena. Returns NULL if the arena is full. Not RT-safe. */
struct implicit *implicit_create(const struct plant *plant, struct arena *arena);

/* Computes constants from the parameters of the drives. Call it after the parameters are set. Not
 * RT-safe. */
void implicit_prepare_drives(struct plant *plant);

/* Updates the constants of drive d after its parameters have changed. Takes about 50,000
 * multiplications, or none if the drive returns to its own parameters. RT-safe. */
void implicit_refresh_drive(struct plant *plant, size_t d);

/* Updates drive d after its current controller was switched on or off. RT-safe. */
void implicit_switch_loop(struct plant *plant, size_t d);

/* Discards predictions from earlier steps; call it after the state has been set. RT-safe. */
void implicit_restart(struct plant *plant);

/* Advances plant->state by h seconds (the configuration's substep) with the command held by
 * plant_step. plant->last_good must be a copy of the state. Quaternions keep their length except
 * for rounding. Returns the contact engine's failure, or ERROR_INPUT for more than
 * IMPLICIT_TANGENTS pairs in contact. After an error plant->failure is set and the state is
 * invalid. RT-safe if the contact engine is. */
enum error_code implicit_step(struct plant *plant, double h);

/* Fills plant->vdot and contact_wrench with the accelerations and wrenches that moved the bodies at
 * the end of the last step. They differ from the contact law evaluated at the resulting state. Call
 * it only after an unclamped step. Wrenches are in the world frame, about the bodies' origins.
 * RT-safe. */
void implicit_last_forces(struct plant *plant);

/* Moves the forces and moments of `count` patches to the end of the last step. Before the call,
 * they are from the engine's last evaluation in that step. RT-safe. */
void implicit_patches(const struct plant *plant, struct contact_patch *patch, size_t count);

#endif
