/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The parts of the gait: gait.c has the phases of a walk and its plan, gait_catch.c the step that
 * catches a standing robot that is pushed. RT-safe.
 */
#ifndef TASKS_GAIT_PRIVATE_H
#define TASKS_GAIT_PRIVATE_H

#include "tasks/gait.h"

/* ---- gait.c ---- */

int gait_other(int side);

/* Returns the sign of the direction away from the other foot: +1 of the left foot, -1 of the
 * right one. */
double gait_outward(int side);

void gait_offset(const struct gait_foothold *from, double ahead, double left, double to[2]);

/* Computes where the foot of that side steps to while the other one stands; close: beside it. */
void gait_foothold_of(const struct gait *gait, int side, const struct gait_foothold *stance,
                      bool close, struct gait_foothold *to);

/* Returns how far a point is on the way from the right foot's planned zero-moment point to the
 * left one's: 0 to 1 between them. */
double gait_left_share(const struct gait *gait, const double point[2]);

void gait_begin(struct gait *gait, enum gait_phase phase, double duration_s);

/* Begins the next step, with its transfer: from now on stance carries, the other foot will
 * swing. */
void gait_begin_step(struct gait *gait, int stance, double transfer_s);

/* Makes the transfer that has begun start from this DCM. */
void gait_begin_at(struct gait *gait, const double dcm[2]);

/* ---- gait_catch.c ---- */

#define GAIT_CATCH_LATE_S 0.1    /* a catching step that has met no ground ends so much later */
#define GAIT_CATCH_LOWER_M_S 0.3 /* speed at which its foot is lowered until then */
#define GAIT_CATCH_COM_S 0.05    /* time constant of the planned center of mass */

/* Returns whether a standing robot has to step. */
bool gait_must_catch(const struct gait *gait, const struct gait_measured *measured);

/* Begins the swing of the foot that is further from the DCM, at once. */
void gait_begin_catch(struct gait *gait, const struct gait_measured *measured);

/* Computes zero-moment point, DCM and foothold of the catching swing. */
void gait_plan_catch(struct gait *gait, const struct gait_measured *measured, double dt_s);

/* Ends the catching swing: the other foot follows, or both stay where they are. */
void gait_end_catch(struct gait *gait, const struct gait_measured *measured);

/* Returns the share of the weight on the standing foot while the other one leaves the ground. */
double gait_catch_share(const struct gait *gait);

/* Returns whether the robot has come to rest with its feet apart. */
bool gait_rests_apart(const struct gait *gait, const struct gait_measured *measured);

#endif
