/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The plant's linearly implicit integrator: a Runge-Kutta scheme of two stages and order 2,
 * L-stable in everything that is stiff (contact, springs), with one evaluation of the right-hand
 * side and one linear system of the size and structure of the mechanism a stage, and with the
 * drives solved exactly for the voltage held; see implicit.c.
 */
#ifndef MODEL_IMPLICIT_IMPLICIT_H
#define MODEL_IMPLICIT_IMPLICIT_H

#include "model/plant_private.h"

/* Most pairs in touch that a step takes into account. */
enum { IMPLICIT_TANGENTS = PLANT_PATCHES };

/* Allocates the scratch for plant in the arena; returns NULL when there is no room. Not RT-safe. */
struct implicit *implicit_create(const struct plant *plant, struct arena *arena);

/* Computes what follows from the parameters of the drives, once they are known. Not RT-safe. */
void implicit_prepare_drives(struct plant *plant);

/* The same for drive d after its parameters have changed, in some 50,000 products; back to its own
 * in none. RT-safe. */
void implicit_refresh_drive(struct plant *plant, size_t d);

/* Forgets what earlier steps foretell: for a state that has been set. RT-safe. */
void implicit_restart(struct plant *plant);

/* Advances plant->state, which plant->last_good is a copy of, by h seconds (those of the
 * configuration) with what plant_step holds; quaternions keep their length but
 * for rounding. Returns the contact engine's failure or ERROR_INPUT for more than IMPLICIT_TANGENTS
 * pairs in touch, with plant->failure set; the state is then not to be used. RT-safe when the
 * contact engine is. */
enum error_code implicit_step(struct plant *plant, double h);

/* What the last step moved the bodies with at its end, which is not what the laws of contact say of
 * the state that it led to: fills plant->vdot and contact_wrench (of the last unclamped step; the
 * wrenches in the world frame, about the bodies' origins). RT-safe. */
void implicit_last_forces(struct plant *plant);

/* Takes the forces and moments of count patches, which the contact engine had where it was asked
 * last in that step, to its end. RT-safe. */
void implicit_patches(const struct plant *plant, struct contact_patch *patch, size_t count);

#endif
