/* SPDX-License-Identifier: Apache-2.0 */
/* Robots built by hand and a ground of point springs. */
#include "tests/physics/toy.h"

#include "contact/tangent.h"
#include "model/spatial.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void toy_begin(struct toy *toy, bool floating, double mass, const double com[3], const double I[6])
{
    memset(toy, 0, sizeof *toy);
    toy->robot = (struct robot){.name = "toy",
                                .file = "toy.yaml",
                                .floating = floating,
                                .gravity = {0.0, 0.0, -9.81},
                                .nbody = 1,
                                .body = toy->body,
                                .joint = toy->joint,
                                .frame = toy->frame,
                                .ft = toy->ft,
                                .imu_frame = -1};
    toy->body[0] = (struct robot_body){.name = "base", .parent = -1, .inertia.mass = mass};
    memcpy(toy->body[0].inertia.com, com, sizeof toy->body[0].inertia.com);
    memcpy(toy->body[0].inertia.I, I, sizeof toy->body[0].inertia.I);
}

size_t toy_add(struct toy *toy, int parent, enum joint_type type, const double axis[3],
               const double origin[3], double mass, const double com[3], const double I[6])
{
    static const char *const names[TOY_BODIES] = {"j0",  "j1",  "j2",  "j3", "j4",  "j5",
                                                  "j6",  "j7",  "j8",  "j9", "j10", "j11",
                                                  "j12", "j13", "j14", "j15"};
    size_t j = toy->robot.njoint++;
    struct robot_joint *joint = &toy->joint[j];
    struct robot_body *body = &toy->body[toy->robot.nbody++];

    assert(toy->robot.nbody <= TOY_BODIES);
    *joint = (struct robot_joint){
        .name = names[j], .type = type, .lower = -10.0, .upper = 10.0, .torque_limit = 1000.0};
    memcpy(joint->axis, axis, sizeof joint->axis);
    memcpy(joint->origin, origin, sizeof joint->origin);
    mat3_identity(joint->rotation);
    *body = (struct robot_body){.name = names[j], .parent = parent, .inertia.mass = mass};
    memcpy(body->inertia.com, com, sizeof body->inertia.com);
    memcpy(body->inertia.I, I, sizeof body->inertia.I);
    return j;
}

int toy_add_frame(struct toy *toy, int body, const double position[3])
{
    static const char *const names[TOY_FRAMES] = {"f0", "f1", "f2", "f3"};
    int f = (int)toy->robot.nframe++;
    struct robot_frame *frame = &toy->frame[f];

    assert(f < TOY_FRAMES);
    *frame = (struct robot_frame){.name = names[f], .body = body};
    memcpy(frame->position, position, sizeof frame->position);
    mat3_identity(frame->rotation);
    return f;
}

void toy_finish(struct toy *toy)
{
    struct error error = {0};

    if (robot_finish(&toy->robot, &error) != ERROR_NONE) {
        fprintf(stderr, "%s\n", error.text);
        abort();
    }
}

struct robot_sea toy_drive(double Ks)
{
    return (struct robot_sea){.present = true,
                              .J = 0.1387,
                              .Dm = 0.19958,
                              .Ks = Ks,
                              .Ds = 5e-4 * Ks,
                              .N = 100.0,
                              .Kt = 4.1,
                              .Kw = 4.1,
                              .R = 0.664,
                              .L = 0.32e-3};
}

/* A leg from hip to foot; returns nothing, the feet's bodies are known by number */
static void add_leg(struct toy *toy, double y, double spring_sense)
{
    static const double pitch[3] = {0.0, 1.0, 0.0};
    const double hip[3] = {0.0, y, -0.05}, down[3] = {0.0, 0.0, -0.2};
    const double thigh_com[3] = {0.01, 0.1 * y, -0.08}, shank_com[3] = {0.0, -0.05 * y, -0.09};
    const double foot_com[3] = {0.015, 0.1 * y, -0.045};
    const double thigh[6] = {0.012, 1e-4, -3e-4, 0.013, 2e-4, 0.004};
    const double shank[6] = {0.008, -1e-4, 2e-4, 0.0085, 1e-4, 0.002};
    const double foot[6] = {0.0013, 1e-5, 2e-4, 0.0016, -1e-5, 0.0013};
    const double sensor[3] = {0.002, -0.1 * y, -0.065};
    size_t j = toy_add(toy, 0, JOINT_REVOLUTE, pitch, hip, 3.5, thigh_com, thigh);
    struct robot_ft_sensor *ft;

    toy->joint[j].sea = toy_drive(395.46);
    j = toy_add(toy, (int)j + 1, JOINT_REVOLUTE, pitch, down, 2.1, shank_com, shank);
    toy->joint[j].sea = toy_drive(395.46);
    toy->joint[j].spring = (struct robot_parallel_spring){
        .present = true, .enabled = true, .k_p = 2000.0, .d_p = 10.0, .r = 0.05, .s = spring_sense};
    j = toy_add(toy, (int)j + 1, JOINT_REVOLUTE, pitch, down, 0.67, foot_com, foot);
    toy->joint[j].sea = toy_drive(1000.0);
    ft = &toy->ft[toy->robot.nft++];
    *ft = (struct robot_ft_sensor){.name = y < 0.0 ? "ft_right" : "ft_left",
                                   .frame = toy_add_frame(toy, (int)j + 1, sensor),
                                   .distal = {.mass = 0.2,
                                              .com = {0.01, -0.005, -0.01},
                                              .I = {1.5e-4, 1e-5, 2e-5, 2e-4, 0, 2e-4}}};
    mat3_from_rpy((const double[3]){0.2, -0.1, 0.4}, toy->frame[ft->frame].rotation);
}

void toy_walker(struct toy *toy)
{
    const double com[3] = {-0.02, 0.001, 0.1}, I[6] = {0.12, -1e-3, 5e-3, 0.1, 1e-3, 0.06};
    const double skew[3] = {0.6, 0.0, 0.8}, slide[3] = {0.0, 0.0, 1.0};
    const double shoulder[3] = {-0.01, 0.15, 0.22}, wrist[3] = {0.0, 0.02, -0.2};
    const double arm_com[3] = {0.01, 0.01, -0.1}, hand_com[3] = {0.0, 0.0, -0.05};
    const double arm[6] = {0.006, 1e-4, 1e-4, 0.006, 1e-4, 0.001};
    const double hand[6] = {5e-4, 0.0, 1e-5, 5e-4, 0.0, 2e-4}, head[3] = {-0.07, -0.007, 0.044};
    size_t j;

    toy_begin(toy, true, 11.0, com, I);
    add_leg(toy, -0.07, 1.0);
    add_leg(toy, 0.07, -1.0);
    j = toy_add(toy, 0, JOINT_REVOLUTE, skew, shoulder, 1.9, arm_com, arm);
    toy->joint[j].sea = toy_drive(120.0);
    mat3_from_rpy((const double[3]){0.3, 0.5, -0.2}, toy->joint[j].rotation);
    toy_add(toy, (int)j + 1, JOINT_PRISMATIC, slide, wrist, 0.5, hand_com, hand);
    toy->robot.imu_frame = toy_add_frame(toy, 0, head);
    mat3_from_rpy((const double[3]){1.0, 0.2, -0.3}, toy->frame[toy->robot.imu_frame].rotation);
    toy_finish(toy);
}

/* Force and moment of one point; adds to the body's wrench */
static void press(struct toy_ground *ground, const struct toy_point *point,
                  const struct body_motion *motion, struct contact_wrench *wrench)
{
    double arm[3], velocity[3], moment[3] = {0.0, 0.0, 0.0}, force[3];
    double depth, normal;

    mat3_apply(motion->R, point->position, arm);
    depth = -(motion->p[2] + arm[2]);
    if (depth <= 0.0) {
        return;
    }
    memcpy(velocity, motion->v, sizeof velocity);
    vec3_add_cross(motion->w, arm, velocity);
    normal = fmax(0.0, ground->k * depth * (1.0 - ground->c * velocity[2]));
    force[0] = -ground->slip * normal * velocity[0];
    force[1] = -ground->slip * normal * velocity[1];
    force[2] = normal;
    vec3_add_cross(arm, force, moment);
    for (int i = 0; i < 3; i++) {
        wrench->force[i] += force[i];
        wrench->moment[i] += moment[i];
    }

    /* The point's tangent, in the place of the patch that is about to be counted */
    struct contact_tangent *tangent = &ground->tangent[ground->npatch];
    struct contact_element element = {.normal = {0.0, 0.0, 1.0},
                                      .stiffness = normal / depth,
                                      .damping = normal > 0.0 ? ground->k * depth * ground->c : 0.0,
                                      .friction = ground->slip * normal};

    *tangent = (struct contact_tangent){.body_a = -1, .body_b = point->body};
    for (int i = 0; i < 3; i++) {
        element.point[i] = tangent->center[i] = motion->p[i] + arm[i];
    }
    contact_tangent_add(tangent, &element);
    ground->patch[ground->npatch++] =
        (struct contact_patch){.potential_j = 0.5 * ground->k * depth * depth};
}

static enum error_code ground_evaluate(struct contact_world *world,
                                       const struct body_motion *motion,
                                       struct contact_bristles *bristles,
                                       struct contact_wrench *wrench)
{
    struct toy_ground *ground = (struct toy_ground *)world;

    (void)bristles;
    ground->npatch = 0;
    if (++ground->evaluations == ground->fail_at) {
        return ERROR_SYSTEM;
    }
    memset(wrench, 0, ground->nbody * sizeof *wrench);
    for (size_t p = 0; p < ground->npoint; p++) {
        int body = ground->point[p].body;

        press(ground, &ground->point[p], &motion[body], &wrench[body]);
    }
    return ERROR_NONE;
}

static size_t ground_patches(struct contact_world *world, struct contact_patch *patch, size_t max)
{
    struct toy_ground *ground = (struct toy_ground *)world;

    memcpy(patch, ground->patch, (ground->npatch < max ? ground->npatch : max) * sizeof *patch);
    return ground->npatch;
}

static size_t ground_tangents(struct contact_world *world, struct contact_tangent *tangent,
                              size_t max)
{
    struct toy_ground *ground = (struct toy_ground *)world;

    memcpy(tangent, ground->tangent,
           (ground->npatch < max ? ground->npatch : max) * sizeof *tangent);
    return ground->npatch;
}

static const char *ground_failure(const struct contact_world *world)
{
    (void)world;
    return "the toy ground gave way";
}

void toy_ground_begin(struct toy_ground *ground, size_t nbody)
{
    static const struct contact_ops ops = {.name = "toy",
                                           .evaluate = ground_evaluate,
                                           .patches = ground_patches,
                                           .tangents = ground_tangents,
                                           .failure = ground_failure};

    *ground =
        (struct toy_ground){.world.ops = &ops, .nbody = nbody, .k = 2e4, .c = 1.0, .slip = 5.0};
}

void toy_ground_add(struct toy_ground *ground, int body, double x, double y, double z)
{
    assert(ground->npoint < TOY_POINTS);
    ground->point[ground->npoint++] = (struct toy_point){.body = body, .position = {x, y, z}};
}

void toy_walker_ground(struct toy_ground *ground)
{
    toy_ground_begin(ground, 2);
    for (int corner = 0; corner < 8; corner++) {
        toy_ground_add(ground, corner / 4, corner & 1 ? 0.13 : -0.06, corner & 2 ? 0.045 : -0.045,
                       -0.08);
    }
}
