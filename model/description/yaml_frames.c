/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the frames, capsules, sensors and poses of a robot file. */
#include "base/portable_math.h"
#include "base/vec3.h"
#include "model/coupling.h"
#include "model/description/yaml.h"

#include <math.h>
#include <string.h>

enum error_code robot_build_frames(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;

    robot->frame = arena_alloc(b->arena, file->nframe, sizeof *robot->frame);
    if (!robot->frame) {
        return robot_no_memory(b);
    }
    for (size_t i = 0; i < file->nframe; i++) {
        const struct frame_yaml *given = &file->frame[i];
        struct robot_frame *frame = &robot->frame[i];

        frame->name = given->name;
        frame->body = robot_find_body(robot, given->body);
        if (frame->body < 0) {
            return robot_unknown_name(b, &given->body_mark, "body", given->body, file->body,
                                      file->nbody, sizeof *file->body);
        }
        memcpy(frame->position, given->xyz, sizeof frame->position);
        mat3_from_rpy(given->rpy, frame->rotation);
    }
    robot->nframe = file->nframe;
    return ERROR_NONE;
}

enum error_code robot_build_capsules(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;

    robot->capsule = arena_alloc(b->arena, file->ncapsule, sizeof *robot->capsule);
    if (!robot->capsule) {
        return robot_no_memory(b);
    }
    for (size_t i = 0; i < file->ncapsule; i++) {
        const struct capsule_yaml *given = &file->capsule[i];
        struct robot_capsule *capsule = &robot->capsule[i];

        capsule->name = given->name;
        capsule->body = robot_find_body(robot, given->body);
        if (capsule->body < 0) {
            return robot_unknown_name(b, &given->body_mark, "body", given->body, file->body,
                                      file->nbody, sizeof *file->body);
        }
        memcpy(capsule->position, given->xyz, sizeof capsule->position);
        mat3_from_rpy(given->rpy, capsule->rotation);
        capsule->radius = given->radius;
        capsule->length = given->length;
    }
    robot->ncapsule = file->ncapsule;
    return ERROR_NONE;
}

/* Finds the frame of a sensor by name. */
static enum error_code find_sensor_frame(struct robot_builder *b, const char *name,
                                         const struct yaml_mark *mark, int *frame)
{
    *frame = robot_find_frame(b->robot, name);
    if (*frame < 0) {
        return robot_unknown_name(b, mark, "frame", name, b->file.frame, b->file.nframe,
                                  sizeof *b->file.frame);
    }
    return ERROR_NONE;
}

enum error_code robot_build_sensors(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;
    enum error_code code;

    robot->ft = arena_alloc(b->arena, file->nft, sizeof *robot->ft);
    if (!robot->ft) {
        return robot_no_memory(b);
    }
    for (size_t i = 0; i < file->nft; i++) {
        const struct ft_yaml *given = &file->ft[i];
        const struct inertia_yaml *distal = &given->distal;

        robot->ft[i].name = given->name;
        if ((code = find_sensor_frame(b, given->frame, &given->frame_mark, &robot->ft[i].frame)) ||
            (code = robot_build_inertia(b, &distal->mark, distal->mass, distal->com, distal->I,
                                        &robot->ft[i].distal))) {
            return code;
        }
    }
    robot->nft = file->nft;
    robot->imu_frame = -1;
    if (file->has_imu) {
        return find_sensor_frame(b, file->imu.frame, &file->imu.frame_mark, &robot->imu_frame);
    }
    return ERROR_NONE;
}

/* Takes the positions (rad or m) of the joints of one type, within their limits. */
static enum error_code build_joint_positions(struct robot_builder *b, enum joint_type type,
                                             const struct yaml_real_entry *entry, size_t count,
                                             double *position)
{
    for (size_t i = 0; i < count; i++) {
        int j = robot_find_joint(b->robot, entry[i].name);
        const struct robot_joint *joint;

        if (j < 0) {
            return robot_unknown_name(b, &entry[i].mark, "joint", entry[i].name, b->file.joint,
                                      b->file.njoint, sizeof *b->file.joint);
        }
        joint = &b->robot->joint[j];
        if (joint->type != type) {
            return yaml_error(b->error, &entry[i].mark, "found %s joint \"%s\", expected it in %s",
                              type == JOINT_REVOLUTE ? "prismatic" : "revolute", joint->name,
                              type == JOINT_REVOLUTE ? "joints_m" : "joints_rad");
        }
        if (entry[i].value < joint->lower || entry[i].value > joint->upper) {
            return yaml_error(b->error, &entry[i].mark,
                              "found joint \"%s\" at %g, expected %g to %g (its limits)",
                              joint->name, entry[i].value, joint->lower, joint->upper);
        }
        position[j] = entry[i].value;
    }
    return ERROR_NONE;
}

/* Returns what a pose says of a joint, or NULL. */
static const struct yaml_real_entry *find_position(const struct pose_yaml *pose, const char *joint)
{
    for (size_t i = 0; i < pose->njoint_rad; i++) {
        if (strcmp(pose->joint_rad[i].name, joint) == 0) {
            return &pose->joint_rad[i];
        }
    }
    for (size_t i = 0; i < pose->njoint_m; i++) {
        if (strcmp(pose->joint_m[i].name, joint) == 0) {
            return &pose->joint_m[i];
        }
    }
    return NULL;
}

/* Checks that joints which a pose does not name can stand at zero, or follow. */
static enum error_code check_unnamed_joints(struct robot_builder *b, const struct pose_yaml *given)
{
    for (size_t j = 0; j < b->robot->njoint; j++) {
        const struct robot_joint *joint = &b->robot->joint[j];

        if ((joint->lower > 0.0 || joint->upper < 0.0) && !find_position(given, joint->name) &&
            !robot_find_coupling(b->robot, j)) {
            return yaml_error(
                b->error, &given->mark,
                "found pose \"%s\" without joint \"%s\", expected it: its limits %g to "
                "%g exclude zero",
                given->name, joint->name, joint->lower, joint->upper);
        }
    }
    return ERROR_NONE;
}

/* Moves followers to where their leaders want them, within their limits. A pose may name them,
 * but not put them elsewhere. */
static enum error_code align_followers(struct robot_builder *b, const struct pose_yaml *given,
                                       double *position)
{
    const struct robot *robot = b->robot;
    double *aligned = arena_alloc(b->arena, robot->njoint, sizeof *aligned);

    if (!aligned) {
        return robot_no_memory(b);
    }
    memcpy(aligned, position, robot->njoint * sizeof *aligned);
    coupling_align(robot, aligned);
    /* Compare what the pose says, and the limits, with the aligned positions */
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const int j = robot->coupling[i].follower;
        const struct robot_joint *joint = &robot->joint[j];
        const struct yaml_real_entry *entry = find_position(given, joint->name);
        const double near = COUPLING_ALIGNED * fmax(1.0, fabs(aligned[j]));

        if (entry && fabs(position[j] - aligned[j]) > near) {
            return yaml_error(b->error, &entry->mark,
                              "found joint \"%s\" at %g, expected %.9g, where \"%s\" leads it, or "
                              "no such key",
                              joint->name, position[j], aligned[j],
                              robot->joint[robot->coupling[i].leader].name);
        }
        if (aligned[j] < joint->lower - near || aligned[j] > joint->upper + near) {
            return yaml_error(b->error, &given->mark,
                              "found pose \"%s\" with joint \"%s\" at %g, where \"%s\" leads it, "
                              "expected %g to %g (its limits)",
                              given->name, joint->name, aligned[j],
                              robot->joint[robot->coupling[i].leader].name, joint->lower,
                              joint->upper);
        }
    }
    memcpy(position, aligned, robot->njoint * sizeof *aligned);
    return ERROR_NONE;
}

/* Computes the quaternion wxyz of Rz(yaw) Ry(pitch) Rx(roll). */
static void quaternion_from_rpy(const double rpy[3], double quaternion[4])
{
    double cr = portable_cos(0.5 * rpy[0]), sr = portable_sin(0.5 * rpy[0]);
    double cp = portable_cos(0.5 * rpy[1]), sp = portable_sin(0.5 * rpy[1]);
    double cy = portable_cos(0.5 * rpy[2]), sy = portable_sin(0.5 * rpy[2]);

    quaternion[0] = cr * cp * cy + sr * sp * sy;
    quaternion[1] = sr * cp * cy - cr * sp * sy;
    quaternion[2] = cr * sp * cy + sr * cp * sy;
    quaternion[3] = cr * cp * sy - sr * sp * cy;
}

/* Builds a pose: base, joints, followers. */
static enum error_code build_pose(struct robot_builder *b, const struct pose_yaml *given,
                                  struct robot_pose *pose)
{
    double *position = arena_alloc(b->arena, b->robot->njoint, sizeof *position);
    enum error_code code;

    if (!position) {
        return robot_no_memory(b);
    }
    if (given->has_xyz != b->robot->floating || (given->has_rpy && !b->robot->floating)) {
        return yaml_error(b->error, &given->mark, "found pose \"%s\" %s, expected %s", given->name,
                          b->robot->floating ? "without key \"base_xyz_m\"" : "with a base",
                          b->robot->floating ? "it: the base floats" : "none: the base is fixed");
    }

    /* The base at the origin where it is not given, the joints at zero */
    pose->name = given->name;
    memcpy(pose->base_position, given->base_xyz, sizeof pose->base_position);
    quaternion_from_rpy(given->base_rpy, pose->base_quaternion);
    pose->joint = position;
    if ((code = build_joint_positions(b, JOINT_REVOLUTE, given->joint_rad, given->njoint_rad,
                                      position)) ||
        (code = build_joint_positions(b, JOINT_PRISMATIC, given->joint_m, given->njoint_m,
                                      position))) {
        return code;
    }
    code = check_unnamed_joints(b, given);
    return code ? code : align_followers(b, given, position);
}

enum error_code robot_build_poses(struct robot_builder *b)
{
    struct robot *robot = b->robot;

    robot->pose = arena_alloc(b->arena, b->file.npose, sizeof *robot->pose);
    if (!robot->pose) {
        return robot_no_memory(b);
    }
    for (size_t i = 0; i < b->file.npose; i++) {
        enum error_code code = build_pose(b, &b->file.pose[i], &robot->pose[i]);

        if (code) {
            return code;
        }
    }
    robot->npose = b->file.npose;
    return ERROR_NONE;
}
