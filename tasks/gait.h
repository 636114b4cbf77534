/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Plans where and when the feet step and how the center of mass moves over them: footholds from the
 * commanded velocity, the plan of the zero-moment point and of the divergent component of motion
 * over them (below), the path of the foot in the air. Knows nothing of motors and forces.
 *
 * A robot that stands and is pushed so far that no center of pressure brings it back takes a step
 * in the direction of the fall, and then closes its feet.
 *
 * A step is a transfer (both feet stand, the zero-moment point goes from one to the other) and a
 * swing (one foot stands). World of the estimator; SI units. RT-safe.
 */
#ifndef TASKS_GAIT_H
#define TASKS_GAIT_H

#include "tasks/body_model.h"
#include "tasks/task.h"

#include <stdbool.h>

/* The command: velocities in the robot's own heading. */
struct gait_command {
    bool step; /* steps, maybe in place; false: stands still, feet side by side */
    double forward_m_s, left_m_s, turn_rad_s;
    double step_s; /* of a step, from the next swing on: swing and transfer keep their ratio; 0: as
                    * it is */
};

enum gait_phase { GAIT_STAND, GAIT_TRANSFER, GAIT_SWING };

/* A sole's place: its origin, heading and tilt (roll, then pitch, then yaw about the world's axes).
 */
struct gait_foothold {
    double p[3], yaw, roll, pitch;
};

/* What balance_measure measures. */
struct gait_measured {
    double dcm[2], com[2];
    struct gait_foothold foot[BODY_SIDES];
    bool touches[BODY_SIDES]; /* it is loaded */
    double force_n[BODY_SIDES];
    bool flat[BODY_SIDES]; /* it lies flat on the ground, so that its tilt is the ground's */
};

struct gait_reference {
    enum gait_phase phase;
    int stance;      /* the foot that stands, or will: enum of body_model.h */
    double progress; /* of the phase, 0 to 1 */
    double zmp[2], dcm[2], com[2], com_m_s[2];
    double share[BODY_SIDES];              /* share of the weight that a foot is to carry, 0 to 1 */
    struct gait_foothold foot[BODY_SIDES]; /* where each is to be */
    double height_m;                       /* of the foot in the air over the ground */
    double foot_m_s2[2];                   /* acceleration of the foot in the air, horizontal */
    double yaw;                            /* heading of the pelvis */
};

struct gait {
    struct gait_config config;
    double omega;
    struct gait_command command;
    struct gait_reference now;
    struct gait_foothold next, lift; /* where the foot in the air goes to, came from */
    double elapsed_s, duration_s;    /* of the phase */
    double zmp_from[2];              /* zero-moment point at the begin of a transfer */
    double dcm_end[2];               /* planned DCM at the end of a swing to next */
    double shift[2];                 /* adjustment by which next was moved */
    bool closing;                    /* the step after which the robot stands */
    bool landed;                     /* the foot in the air has met the ground */
    bool catches;                    /* this swing began at once, to catch a fall */
    double bore;                     /* share of the weight that the standing foot carried when
                                      * the catching step began */
    bool apart;                      /* a catching step may have left its feet apart */
    unsigned steps;                  /* number of completed steps */
};

/* Starts the gait with both feet standing at these footholds. */
void gait_start(struct gait *gait, const struct gait_config *config, double omega,
                const struct gait_foothold foot[BODY_SIDES], const double com[2]);

/* Advances by dt_s. A foot that meets the ground before its time stays there until the swing is
 * over; one that has not met it in time is lowered, while the plan waits. */
void gait_update(struct gait *gait, const struct gait_command *command,
                 const struct gait_measured *measured, double dt_s);

/* Transforms a point of the world into a foothold's heading: ahead and to the left, m. */
void gait_into_foot(const struct gait_foothold *foot, const double point[2], double in[2]);

/* Computes the zero-moment point that the plan uses for a foot. */
void gait_foot_zmp(const struct gait *gait, int side, const struct gait_foothold *foot,
                   double zmp[2]);

/* ---- the divergent component of motion ----
 *
 * xi = c + c'/omega of the linear inverted pendulum c'' = omega^2 (c - r), and its plan in closed
 * form (Englsberger, Ott, Albu-Schaeffer: Three-dimensional bipedal walking control based on
 * divergent component of motion, IEEE Trans. Robotics 31(2), 2015). r, the zero-moment point, moves
 * along straight lines, one after the other; where the last one ends xi is to come to rest.
 * Backward through a line that lasts T, from r0 with the rate r' to r1,
 *
 *     xi0 = r0 + r'/omega + exp(-omega T) (xi1 - r1 - r'/omega).
 *
 * Horizontal components only; m, s. */

enum { DCM_LINES = 16 };

struct dcm_line {
    double duration_s;
    double from[2], to[2]; /* zero-moment point at its begin and end, m */
};

struct dcm_plan {
    double omega; /* rad/s: sqrt(g / height of the center of mass) */
    size_t nline;
    struct dcm_line line[DCM_LINES];
};

/* Appends a line; drops it when there are DCM_LINES already or it has no duration. */
void dcm_add(struct dcm_plan *plan, double duration_s, const double from[2], const double to[2]);

/* Computes the zero-moment point and the DCM elapsed_s after the first line's begin, and the DCM
 * at the first line's end; elapsed_s within the first line. */
void dcm_evaluate(const struct dcm_plan *plan, double elapsed_s, double zmp[2], double dcm[2],
                  double dcm_end[2]);

/* Moves the begin of the first line so that the plan has that DCM at its begin. */
void dcm_begin_at(struct dcm_plan *plan, const double dcm[2]);

/* Computes the DCM after duration_s with the zero-moment point at rest in zmp. */
void dcm_advance(double omega, double duration_s, const double zmp[2], const double dcm[2],
                 double after[2]);

#endif
