/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What a controller knows of its robot's body: lengths, masses, where sensors sit. A tree of links
 * with one joint each, without dynamics; it comes from the rig, like the map of the boards. Right-
 * handed frames, x forward, y left, z up; SI units. Owned by the rig, never changed. All functions
 * are RT-safe but body_find_link.
 */
#ifndef TASKS_BODY_MODEL_H
#define TASKS_BODY_MODEL_H

#include <stddef.h>

/* The frame of a link sits on the axis of the joint that moves it: link = parent * Trans(origin) *
 * rotation * Rot(direction, angle). Link 0 is the pelvis and has no joint. */
struct body_link {
    const char *name, *joint; /* joint: that moves it, NULL of link 0 */
    int parent;               /* index, less than its own; -1 of link 0 */
    int axis;                 /* of the host, that drives the joint; -1: it stays at fixed_rad */
    double fixed_rad;
    double origin[3], rotation[9], direction[3];
    double mass_kg, com_m[3]; /* in its own frame */
};

/* A named place on a link: frame to link, row-major. */
struct body_frame {
    int link; /* -1: the robot has none */
    double position[3], rotation[9];
};

enum { BODY_RIGHT, BODY_LEFT, BODY_SIDES };

struct body_model {
    size_t nlink;
    const struct body_link *link;
    struct body_frame imu;
    struct body_frame sole[BODY_SIDES], foot_force[BODY_SIDES]; /* its force-torque sensor */
    double gravity_m_s2;
    double mass_kg; /* of all links */
};

/* Where a link is: rotation link to reference, row-major, and position of its origin. */
struct body_pose {
    double R[9], p[3];
};

/* Places all links in the frame of the pelvis; angle by axis of the host, pose has nlink entries.
 * */
void body_place(const struct body_model *model, const double *angle, struct body_pose *pose);

/* The center of mass in the frame that the poses are in. */
void body_center_of_mass(const struct body_model *model, const struct body_pose *pose,
                         double com[3]);

/* Where a frame is when its link is there. */
void body_place_frame(const struct body_frame *frame, const struct body_pose *link,
                      struct body_pose *pose);

/* The torque (N m) that the motor of a link's joint exerts so that nothing accelerates, when the
 * parts from that link on are pulled by gravity, which points along down (unit), and by a force (N)
 * at a point on a link of theirs; poses, force, point and down in one frame. chain: the links from
 * that one on to the one that the force acts on, nchain of them, in order. */
double body_static_torque(const struct body_model *model, const struct body_pose *pose,
                          const int *chain, size_t nchain, const double force[3],
                          const double point[3], const double down[3]);

/* The link that a joint moves, -1 = none. */
int body_find_link(const struct body_model *model, const char *joint);

#endif
