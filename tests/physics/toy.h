/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Small robots built by hand and a contact engine of point springs, for tests of the plant that
 * need neither a robot file nor a mesh.
 */
#ifndef TESTS_PHYSICS_TOY_H
#define TESTS_PHYSICS_TOY_H

#include "contact/contact.h"
#include "model/plant.h"

enum { TOY_BODIES = 16, TOY_FRAMES = 4, TOY_POINTS = 16 };

/* Room for a robot; begin with toy_begin, end with toy_finish. */
struct toy {
    struct robot robot;
    struct robot_body body[TOY_BODIES];
    struct robot_joint joint[TOY_BODIES];
    struct robot_frame frame[TOY_FRAMES];
    struct robot_ft_sensor ft[TOY_FRAMES];
};

void toy_begin(struct toy *toy, bool floating, double mass, const double com[3], const double I[6]);

/* A joint and the body that it moves; returns the joint's index. */
size_t toy_add(struct toy *toy, int parent, enum joint_type type, const double axis[3],
               const double origin[3], double mass, const double com[3], const double I[6]);

/* A frame on a body, not rotated; returns its index. */
int toy_add_frame(struct toy *toy, int body, const double position[3]);

void toy_finish(struct toy *toy);

/* COMAN's drive (link-side constants) with a series spring of stiffness Ks. */
struct robot_sea toy_drive(double Ks);

/* A floating trunk with two three-joint legs and a two-joint arm, eight joints: hips, knees and
 * ankles about y, a skew shoulder, a prismatic hand without a drive; series elastic drives, a
 * parallel spring on either knee (+1, -1), force-torque sensors in the feet, an inertial one in the
 * trunk. About COMAN's size. Feet are bodies 3 and 6, soles 0.08 m below the ankles, which are
 * 0.45 m below the trunk's origin. */
void toy_walker(struct toy *toy);
enum { TOY_RIGHT_FOOT = 3, TOY_LEFT_FOOT = 6, TOY_ARM = 7, TOY_HAND = 8 };

/* A point on contact body `body` that meets the ground z = 0. */
struct toy_point {
    int body;
    double position[3];
};

/* Ground of point springs: at depth d and rate d' a point is pushed by n = k d (1 + c d') upward,
 * no less than 0, and by -slip n times its horizontal velocity. */
struct toy_ground {
    struct contact_world world;
    size_t nbody, npoint;
    struct toy_point point[TOY_POINTS];
    double k, c, slip;
    size_t evaluations;
    size_t fail_at; /* the evaluation with this number fails, 0 = none */
    struct contact_patch patch[TOY_POINTS];
    struct contact_tangent tangent[TOY_POINTS];
    size_t npatch;
};

void toy_ground_begin(struct toy_ground *ground, size_t nbody);
void toy_ground_add(struct toy_ground *ground, int body, double x, double y, double z);

/* The walker's feet, four corners each; contact bodies 0 and 1 are the right and the left foot. */
void toy_walker_ground(struct toy_ground *ground);

#endif
