/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the gait is made of: gait.c has the schedule of a walk and its plan, gait_catch.c the step
 * that catches a robot which is pushed while it stands. RT-safe.
 */
#ifndef TASKS_GAIT_PRIVATE_H
#define TASKS_GAIT_PRIVATE_H

#include "tasks/gait.h"

/* ---- gait.c ---- */

int gait_other(int side);

/* +1 of the left foot, -1 of the right one */
double gait_outward(int side);

void gait_offset(const struct gait_foothold *from, double ahead, double left, double to[2]);

/* Where the foot of that side steps to while the other one stands. */
void gait_foothold_of(const struct gait *gait, int side, const struct gait_foothold *stance,
                      bool close, struct gait_foothold *to);

/* How far a point is on the way from the right foot's planned zero-moment point to the left one's:
 * 0 to 1 between them. */
double gait_left_share(const struct gait *gait, const double point[2]);

void gait_begin(struct gait *gait, enum gait_phase phase, double duration_s);

/* The next step: from now on stance carries, the other foot goes. */
void gait_begin_step(struct gait *gait, int stance, double transfer_s);

/* The transfer that has begun starts from this DCM. */
void gait_begin_at(struct gait *gait, const double dcm[2]);

/* ---- gait_catch.c ---- */

#define GAIT_CATCH_LATE_S 0.1    /* a catching step that has met no ground is over so much later */
#define GAIT_CATCH_LOWER_M_S 0.3 /* until then its foot is lowered */
#define GAIT_CATCH_COM_S 0.05    /* in which the planned center of mass goes to where it is */

/* Whether a robot that stands has to step. */
bool gait_must_catch(const struct gait *gait, const struct gait_measured *measured);

/* Lifts the foot that is further from the DCM, at once. */
void gait_begin_catch(struct gait *gait, const struct gait_measured *measured);

/* Zero-moment point, DCM and foothold of the catching swing. */
void gait_plan_catch(struct gait *gait, const struct gait_measured *measured, double dt_s);

/* The foot has come down: the other one follows, or both stay where they are. */
void gait_end_catch(struct gait *gait, const struct gait_measured *measured);

/* Share of the weight on the standing foot while the other one leaves the ground. */
double gait_catch_share(const struct gait *gait);

/* Whether it has come to rest with its feet apart. */
bool gait_rests_apart(const struct gait *gait, const struct gait_measured *measured);

#endif
