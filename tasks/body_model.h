/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The controller's model of the robot's body: lengths, masses, places of sensors. It is a tree of
 * links, each with one joint, and has no dynamics. The rig creates, owns and never changes it.
 * Right-handed frames: x forward, y left, z up. SI units. All functions are RT-safe except
 * body_find_link.
 */
#ifndef TASKS_BODY_MODEL_H
#define TASKS_BODY_MODEL_H

#include <stddef.h>

/* The frame of a link is on the axis of its joint: link = parent * Trans(origin) * rotation *
 * Rot(direction, angle). Link 0 is the pelvis and has no joint. */
struct body_link {
    const char *name, *joint; /* joint: the joint that moves this link; NULL for link 0 */
    int parent;               /* index of the parent, less than this link's; -1 for link 0 */
    /* axis of the host that drives the joint; -1 = the joint stays at fixed_rad */
    int axis;
    double fixed_rad;
    double origin[3], rotation[9], direction[3];
    double mass_kg, com_m[3]; /* center of mass in the link's frame */
};

/* A named place on a link: its pose in the link's frame, rotation row-major. */
struct body_frame {
    int link; /* -1 = not on this robot */
    double position[3], rotation[9];
};

enum { BODY_RIGHT, BODY_LEFT, BODY_SIDES };

struct body_model {
    size_t nlink;
    const struct body_link *link;
    struct body_frame imu;
    /* foot_force: frame of the foot's force-torque sensor */
    struct body_frame sole[BODY_SIDES], foot_force[BODY_SIDES];
    double gravity_m_s2;
    double mass_kg; /* sum over all links */
};

/* Pose of a link: row-major rotation from the link to the reference frame, and position of the
 * link's origin. */
struct body_pose {
    double R[9], p[3];
};

/* Computes the poses of all links in the frame of the pelvis (forward kinematics). angle: joint
 * angles by axis of the host, rad. pose: nlink entries. */
void body_place(const struct body_model *model, const double *angle, struct body_pose *pose);

/* Computes the center of mass in the frame of the poses, m. */
void body_center_of_mass(const struct body_model *model, const struct body_pose *pose,
                         double com[3]);

/* Computes the pose of a frame from the pose of its link. */
void body_place_frame(const struct body_frame *frame, const struct body_pose *link,
                      struct body_pose *pose);

/* Returns the torque (N m) of a link's joint motor in static equilibrium. Gravity acts along the
 * unit vector `down`. A force (N) acts at a point (m) of the last link of the chain. chain: the
 * nchain links from this link to the link with the force, in order; only they have weight. Poses,
 * force, point and down are in one frame. */
double body_static_torque(const struct body_model *model, const struct body_pose *pose,
                          const int *chain, size_t nchain, const double force[3],
                          const double point[3], const double down[3]);

/* Returns the link that a joint moves; -1 = none. */
int body_find_link(const struct body_model *model, const char *joint);

#endif
