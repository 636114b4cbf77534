/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a controller knows of its robot's body: lengths, masses, places of sensors. It is a tree of
 * links with one joint each, without dynamics, and comes from the rig, like the map of the boards.
 * Right-handed frames, x forward, y left, z up; SI units. Owned by the rig, immutable. All
 * functions are RT-safe but body_find_link.
 */
#ifndef TASKS_BODY_MODEL_H
#define TASKS_BODY_MODEL_H

#include <stddef.h>

/* The frame of a link sits on the axis of the joint that moves it: link = parent * Trans(origin) *
 * rotation * Rot(direction, angle). Link 0 is the pelvis and has no joint. */
struct body_link {
    const char *name, *joint; /* joint: the one that moves it, NULL of link 0 */
    int parent;               /* index, less than its own; -1 of link 0 */
    int axis;                 /* axis of the host that drives the joint; -1: it stays at
                               * fixed_rad */
    double fixed_rad;
    double origin[3], rotation[9], direction[3];
    double mass_kg, com_m[3]; /* center of mass in the link's own frame */
};

/* A named place on a link: its pose in the link's frame, rotation row-major. */
struct body_frame {
    int link; /* -1: the robot has none */
    double position[3], rotation[9];
};

enum { BODY_RIGHT, BODY_LEFT, BODY_SIDES };

struct body_model {
    size_t nlink;
    const struct body_link *link;
    struct body_frame imu;
    struct body_frame sole[BODY_SIDES], foot_force[BODY_SIDES]; /* foot_force: its force-torque
                                                                 * sensor */
    double gravity_m_s2;
    double mass_kg; /* total, of all links */
};

/* Pose of a link: rotation link to reference, row-major, and position of its origin. */
struct body_pose {
    double R[9], p[3];
};

/* Computes the poses of all links in the frame of the pelvis (forward kinematics). angle is by
 * axis of the host, rad; pose has nlink entries. */
void body_place(const struct body_model *model, const double *angle, struct body_pose *pose);

/* Computes the center of mass in the frame that the poses are in, m. */
void body_center_of_mass(const struct body_model *model, const struct body_pose *pose,
                         double com[3]);

/* Computes the pose of a frame from the pose of its link. */
void body_place_frame(const struct body_frame *frame, const struct body_pose *link,
                      struct body_pose *pose);

/* Returns the torque (N m) that the motor of a link's joint exerts in static equilibrium, when
 * gravity (along down, a unit vector) pulls the parts from that link on and a force (N) acts at
 * a point on one of them; poses, force, point and down in one frame. chain: the links from that
 * one to the one that the force acts on, nchain of them, in order. */
double body_static_torque(const struct body_model *model, const struct body_pose *pose,
                          const int *chain, size_t nchain, const double force[3],
                          const double point[3], const double down[3]);

/* Returns the link that a joint moves, -1 when there is none. */
int body_find_link(const struct body_model *model, const char *joint);

#endif
