/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Plans the steps of the feet and the motion of the center of mass. From the commanded velocity, it
 * computes the footholds, the plan of the zero-moment point and of the divergent component of
 * motion (DCM, below), and the path of the foot in the air. It commands no motors and no forces.
 *
 * If a push on a standing robot is too large for any center of pressure, the robot takes a step in
 * the direction of the fall (catching step). It then closes its feet.
 *
 * A step has two phases. In the transfer, both feet stand, and the zero-moment point moves from one
 * foot to the other. In the swing, one foot stands. World frame of the estimator; SI units.
 * RT-safe.
 */
#ifndef TASKS_GAIT_H
#define TASKS_GAIT_H

#include "tasks/task.h"

/* The command: velocities in the robot's heading. */
struct gait_command {
    bool step; /* steps, also in place; false = stand still, feet side by side */
    double forward_m_s, left_m_s, turn_rad_s;
    /* duration of a step, from the next swing on, with the same ratio of swing to transfer; 0 =
     * unchanged */
    double step_s;
};

enum gait_phase { GAIT_STAND, GAIT_TRANSFER, GAIT_SWING };

/* The place of a sole: origin, heading and tilt. Roll, then pitch, then yaw about the world's
 * axes. */
struct gait_foothold {
    double p[3], yaw, roll, pitch;
};

/* Measurements, from balance_measure in tasks/balance.c. */
struct gait_measured {
    double dcm[2], com[2];
    struct gait_foothold foot[BODY_SIDES];
    bool touches[BODY_SIDES]; /* the foot carries load */
    double force_n[BODY_SIDES];
    bool flat[BODY_SIDES]; /* the foot lies flat, so that its tilt is the ground's tilt */
};

struct gait_reference {
    enum gait_phase phase;
    int stance;      /* the foot that stands, or will stand next (BODY_RIGHT, BODY_LEFT) */
    double progress; /* progress of the phase, 0 to 1 */
    double zmp[2], dcm[2], com[2], com_m_s[2];
    double share[BODY_SIDES];              /* planned share of the weight on each foot, 0 to 1 */
    struct gait_foothold foot[BODY_SIDES]; /* planned place of each foot */
    /* planned height of the foot in the air above the ground */
    double height_m;
    double foot_m_s2[2]; /* horizontal acceleration of the foot in the air */
    double yaw;          /* planned heading of the pelvis */
};

struct gait {
    struct gait_config config;
    double omega;
    struct gait_command command;
    struct gait_reference now;
    struct gait_foothold next, lift; /* next and last foothold of the foot in the air */
    double elapsed_s, duration_s;    /* time in the phase, duration of the phase */
    double zmp_from[2];              /* zero-moment point at the beginning of a transfer */
    double dcm_end[2];               /* planned DCM at the end of a swing to `next` */
    double shift[2];                 /* adjustment that is included in `next` */
    bool closing;                    /* this is the last step before standing */
    bool landed;                     /* the swinging foot is on the ground */
    bool catches;                    /* this swing is a catching step */
    /* share of the weight on the standing foot when the catching step began */
    double bore;
    bool apart;     /* a catching step may have left the feet apart */
    unsigned steps; /* number of completed steps */
};

/* Starts the gait with both feet standing at these footholds. */
void gait_start(struct gait *gait, const struct gait_config *config, double omega,
                const struct gait_foothold foot[BODY_SIDES], const double com[2]);

/* Advances the gait by dt_s. A foot that lands early stays in place until the swing ends. If a foot
 * lands late, it is lowered, and the plan waits. */
void gait_update(struct gait *gait, const struct gait_command *command,
                 const struct gait_measured *measured, double dt_s);

/* Transforms a point from the world into a foothold's frame: forward and left, m. */
void gait_into_foot(const struct gait_foothold *foot, const double point[2], double in[2]);

/* Computes the planned zero-moment point on a foot. */
void gait_foot_zmp(const struct gait *gait, int side, const struct gait_foothold *foot,
                   double zmp[2]);

/* ---- the divergent component of motion ----
 *
 * The DCM is xi = c + c'/omega of the linear inverted pendulum c'' = omega^2 (c - r). Its plan has
 * a closed form (Englsberger, Ott, Albu-Schaeffer: Three-dimensional bipedal walking control based
 * on divergent component of motion, IEEE Trans. Robotics 31(2), 2015). The zero-moment point r
 * moves along a sequence of straight lines. At the end of the last line, xi comes to rest. A line
 * lasts T and goes from r0 to r1 at the rate r'. If xi is xi1 at its end, then at its beginning
 *
 *     xi0 = r0 + r'/omega + exp(-omega T) (xi1 - r1 - r'/omega).
 *
 * Horizontal components only; m, s. */

enum { DCM_LINES = 16 };

struct dcm_line {
    double duration_s;
    double from[2], to[2]; /* zero-moment point at the beginning and the end, m */
};

struct dcm_plan {
    double omega; /* rad/s: sqrt(g / height of the center of mass) */
    size_t nline;
    struct dcm_line line[DCM_LINES];
};

/* Appends a line. Ignores the line if the plan is full (DCM_LINES) or the duration is 0. */
void dcm_add(struct dcm_plan *plan, double duration_s, const double from[2], const double to[2]);

/* Computes the zero-moment point and the DCM at time elapsed_s of the first line, and the DCM at
 * the line's end. elapsed_s must be within the line. */
void dcm_evaluate(const struct dcm_plan *plan, double elapsed_s, double zmp[2], double dcm[2],
                  double dcm_end[2]);

/* Moves the start point of the first line so that the plan starts with this DCM. */
void dcm_begin_at(struct dcm_plan *plan, const double dcm[2]);

/* Computes the DCM after duration_s with the constant zero-moment point zmp. */
void dcm_advance(double omega, double duration_s, const double zmp[2], const double dcm[2],
                 double after[2]);

#endif
