/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the robot's body model for tasks, and the configuration of the walk. */
#include "rig/builder_private.h"

#include "base/text.h"

/* Returns a frame of the robot. If index < 0, the link of the result is -1. */
static struct body_frame task_body_frame(const struct robot *robot, int index)
{
    struct body_frame frame = {.link = -1};

    if (index >= 0) {
        frame.link = robot->frame[index].body;
        memcpy(frame.position, robot->frame[index].position, sizeof frame.position);
        memcpy(frame.rotation, robot->frame[index].rotation, sizeof frame.rotation);
    }
    return frame;
}

/* Builds the configuration of the walk: the common gains of all axes, then the exceptions for
 * single joints. */
static enum error_code task_body_walk(struct rig_builder *b)
{
    const struct raw_walk *raw = &b->raw->walk;
    struct walk_config *walk = arena_alloc(b->arena, 1, sizeof *walk);
    struct servo_gains *gains = arena_alloc(b->arena, b->rig->naxis, sizeof *gains);

    if (!walk || !gains) {
        return rig_no_memory(b);
    }
    for (size_t i = 0; i < b->rig->naxis; i++) {
        gains[i] = raw->servo;
    }
    *walk = raw->config;
    walk->balance.gains = gains;
    b->rig->walk = walk;
    return rig_override_gains(b, raw->other, raw->nother, gains);
}

enum error_code rig_build_task_body(struct rig_builder *b)
{
    static const char *const sole[BODY_SIDES] = {"r_sole", "l_sole"};
    static const char *const force[BODY_SIDES] = {"r_leg_ft", "l_leg_ft"};
    const struct robot *robot = b->robot;
    struct body_link *link = arena_alloc(b->arena, robot->nbody, sizeof *link);
    struct body_model *model = &b->rig->body;

    if (!link) {
        return rig_no_memory(b);
    }
    /* Build the links, then the frames of the sensors and the soles */
    for (size_t i = 0; i < robot->nbody; i++) {
        const struct robot_body *body = &b->robot->body[i];

        link[i] = (struct body_link){.name = body->name, .parent = body->parent, .axis = -1};
        link[i].mass_kg = body->inertia.mass;
        memcpy(link[i].com_m, body->inertia.com, sizeof link[i].com_m);
        if (i > 0) {
            const struct robot_joint *joint = &b->robot->joint[i - 1];

            link[i].joint = joint->name;
            link[i].axis = TEXT_FIND(b->rig->axis, b->rig->naxis, joint, joint->name);
            link[i].fixed_rad = b->rig->joint[i - 1];
            memcpy(link[i].origin, joint->origin, sizeof link[i].origin);
            memcpy(link[i].rotation, joint->rotation, sizeof link[i].rotation);
            memcpy(link[i].direction, joint->axis, sizeof link[i].direction);
        }
    }
    *model = (struct body_model){
        .nlink = robot->nbody,
        .link = link,
        .imu = task_body_frame(robot, robot->imu_frame),
        .gravity_m_s2 =
            sqrt(robot->gravity[0] * robot->gravity[0] + robot->gravity[1] * robot->gravity[1] +
                 robot->gravity[2] * robot->gravity[2]),
        .mass_kg = robot->total_mass,
    };
    for (int side = 0; side < BODY_SIDES; side++) {
        model->sole[side] = task_body_frame(robot, robot_find_frame(robot, sole[side]));
        model->foot_force[side] = task_body_frame(robot, robot_find_frame(robot, force[side]));
    }
    return yaml_has(&b->raw->mark, "tasks.walk") ? task_body_walk(b) : ERROR_NONE;
}
