/* SPDX-License-Identifier: Apache-2.0 */
/* Makes robots from other robots: copies a robot, or fixes its base. */
#include "model/robot.h"

#include "model/spatial.h"

#include <string.h>

/* Copies an array into the arena. Returns NULL if the arena is full. */
static void *copy_array(struct arena *arena, const void *from, size_t count, size_t size)
{
    void *to = arena_alloc(arena, count, size);

    if (to && count) {
        memcpy(to, from, count * size);
    }
    return to;
}

enum error_code robot_copy(const struct robot *robot, struct arena *arena, struct robot **out,
                           struct error *error)
{
    struct robot *copy = copy_array(arena, robot, 1, sizeof *copy);

    if (copy) {
        copy->body = copy_array(arena, robot->body, robot->nbody, sizeof *copy->body);
        copy->joint = copy_array(arena, robot->joint, robot->njoint, sizeof *copy->joint);
        copy->frame = copy_array(arena, robot->frame, robot->nframe, sizeof *copy->frame);
        copy->capsule = copy_array(arena, robot->capsule, robot->ncapsule, sizeof *copy->capsule);
        copy->visual = copy_array(arena, robot->visual, robot->nvisual, sizeof *copy->visual);
    }
    if (!copy || !copy->body || !copy->joint || !copy->frame || !copy->capsule || !copy->visual) {
        return error_set(error, ERROR_MEMORY, "no memory for another robot like %s", robot->name);
    }
    *out = copy;
    return ERROR_NONE;
}

/* Transforms a point from a frame with origin p and rotation R to the frame in which R and p are
 * given. */
static void place_point(const double R[9], const double p[3], double point[3])
{
    double turned[3];

    mat3_apply(R, point, turned);
    vec3_add_scaled(p, 1.0, turned, point);
}

/* Transforms a point and a rotation to the frame in which R and p are given. */
static void place_frame(const double R[9], const double p[3], double point[3], double rotation[9])
{
    double turned[9];

    place_point(R, p, point);
    mat3_mul(R, rotation, turned);
    memcpy(rotation, turned, sizeof turned);
}

enum error_code robot_fix_base(struct robot *robot, const double position[3],
                               const double quaternion[4], struct error *error)
{
    struct robot_inertia *inertia = &robot->body[0].inertia;
    double R[9];

    mat3_from_quaternion(quaternion, R);
    /* Make the base's frame the world frame: transform all data given in the base's frame */
    robot->floating = false;
    place_point(R, position, inertia->com);
    sym3_rotate(R, inertia->I);
    /* Joints of bodies attached to the base */
    for (size_t j = 0; j < robot->njoint; j++) {
        if (robot->body[j + 1].parent == 0) {
            place_frame(R, position, robot->joint[j].origin, robot->joint[j].rotation);
        }
    }
    /* Frames, capsules and visuals of the base */
    for (size_t f = 0; f < robot->nframe; f++) {
        if (robot->frame[f].body == 0) {
            place_frame(R, position, robot->frame[f].position, robot->frame[f].rotation);
        }
    }
    for (size_t c = 0; c < robot->ncapsule; c++) {
        if (robot->capsule[c].body == 0) {
            place_frame(R, position, robot->capsule[c].position, robot->capsule[c].rotation);
        }
    }
    for (size_t v = 0; v < robot->nvisual; v++) {
        if (robot->visual[v].body == 0) {
            place_frame(R, position, robot->visual[v].position, robot->visual[v].rotation);
        }
    }
    return robot_finish(robot, error);
}
