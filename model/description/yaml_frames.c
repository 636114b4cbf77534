/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the frames, capsules, visuals, sensors and poses of a robot file. */
#include "base/array.h"
#include "base/vec3.h"
#include "model/coupling.h"
#include "model/description/yaml.h"

#include <math.h>
#include <string.h>

/* Finds the body that the key "body" of an entry names. */
static enum error_code find_key_body(struct robot_builder *b, const struct yaml_mark *entry,
                                     const char *name, int *body)
{
    return yaml_find_name(YAML_NAMES(b->robot->body, b->robot->nbody, name), "body", name,
                          yaml_place(entry, "body"), body, b->error);
}

enum error_code robot_build_frames(struct robot_builder *b)
{
    struct robot *robot = b->robot;
    enum error_code code = ERROR_NONE;

    robot->nframe = b->file.nframe;
    robot->frame = arena_alloc(b->arena, robot->nframe, sizeof *robot->frame);
    if (!robot->frame) {
        return robot_no_memory(b);
    }
    for (size_t i = 0; i < robot->nframe && !code; i++) {
        const struct frame_yaml *given = &b->file.frame[i];

        robot->frame[i] = given->frame;
        code = find_key_body(b, &given->mark, given->body, &robot->frame[i].body);
        mat3_from_rpy(given->rpy, robot->frame[i].rotation);
    }
    return code;
}

enum error_code robot_build_capsules(struct robot_builder *b)
{
    struct robot *robot = b->robot;
    enum error_code code = ERROR_NONE;

    robot->ncapsule = b->file.ncapsule;
    robot->capsule = arena_alloc(b->arena, robot->ncapsule, sizeof *robot->capsule);
    if (!robot->capsule) {
        return robot_no_memory(b);
    }
    for (size_t i = 0; i < robot->ncapsule && !code; i++) {
        const struct capsule_yaml *given = &b->file.capsule[i];

        if (yaml_has(&given->mark, "radius_m") == yaml_has(&given->mark, "half_extents_m")) {
            return yaml_error(b->error, &given->mark,
                              "found both or neither of radius_m and half_extents_m, expected one");
        }
        robot->capsule[i] = given->capsule;
        code = find_key_body(b, &given->mark, given->body, &robot->capsule[i].body);
        mat3_from_rpy(given->rpy, robot->capsule[i].rotation);
    }
    return code;
}

/* ---- visuals ---- */

/* Refuses keys that a shape does not have, and missing keys of a shape. */
static enum error_code check_visual_keys(struct robot_builder *b, const struct visual_yaml *given)
{
    enum {
        MESH = 1 << VISUAL_MESH,
        ROUND = 1 << VISUAL_CYLINDER | 1 << VISUAL_CAPSULE,
    };
    const struct {
        const char *key;
        int needed; /* bits of the shapes that need the key */
    } keys[] = {
        {"half_extents_m", 1 << VISUAL_BOX},
        {"radius_m", 1 << VISUAL_SPHERE | ROUND},
        {"length_m", ROUND},
        {given->visual.missing ? "missing" : "file", MESH},
    };

    if (given->visual.missing && given->file) {
        return yaml_error(b->error, yaml_place(&given->mark, "file"),
                          "found \"file\" beside \"missing\", expected one of them");
    }
    for (size_t i = 0; i < ARRAY_COUNT(keys); i++) {
        bool needed = keys[i].needed & 1 << given->visual.shape;

        if (needed != yaml_has(&given->mark, keys[i].key)) {
            return yaml_error(b->error, &given->mark, "found a %s %s \"%s\", expected %s",
                              robot_visual_shapes[given->visual.shape].word,
                              needed ? "without" : "with", keys[i].key,
                              needed ? "it" : "none there");
        }
    }
    return ERROR_NONE;
}

enum error_code robot_build_visuals(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;
    enum error_code code = ERROR_NONE;

    if (file->nvisual > ROBOT_VISUALS_MAX) {
        return yaml_error(b->error, &file->visual[ROBOT_VISUALS_MAX].mark,
                          "found %zu visuals, expected at most %d", file->nvisual,
                          ROBOT_VISUALS_MAX);
    }
    robot->visual = arena_alloc(b->arena, file->nvisual, sizeof *robot->visual);
    if (!robot->visual) {
        return robot_no_memory(b);
    }
    for (size_t i = 0; i < file->nvisual && !code; i++) {
        const struct visual_yaml *given = &file->visual[i];
        struct robot_visual *visual = &robot->visual[i];

        /* Build a visual and find its body and its mesh file */
        code = check_visual_keys(b, given);
        *visual = given->visual;
        code = code ? code : find_key_body(b, &given->mark, given->body, &visual->body);
        mat3_from_rpy(given->rpy, visual->rotation);
        visual->colored = yaml_has(&given->mark, "color");
        code = code || !given->file
                   ? code
                   : yaml_resolve_path(yaml_place(&given->mark, "file"), given->file, b->arena,
                                       &visual->file, b->error);
    }
    robot->nvisual = file->nvisual;
    return code;
}

/* ---- sensors ---- */

enum error_code robot_build_sensors(struct robot_builder *b)
{
    const struct robot_yaml *file = &b->file;
    struct robot *robot = b->robot;
    const struct yaml_names frames = YAML_NAMES(robot->frame, robot->nframe, name);
    enum error_code code;

    robot->ft = arena_alloc(b->arena, file->nft, sizeof *robot->ft);
    if (!robot->ft) {
        return robot_no_memory(b);
    }
    for (size_t i = 0; i < file->nft; i++) {
        const struct ft_yaml *given = &file->ft[i];
        struct robot_ft_sensor *sensor = &robot->ft[i];

        *sensor = given->sensor;
        if ((code = yaml_find_name(frames, "frame", given->frame, yaml_place(&given->mark, "frame"),
                                   &sensor->frame, b->error)) ||
            (code = robot_refuse_inertia(b, yaml_place(&given->mark, "distal"), &sensor->distal))) {
            return code;
        }
    }
    robot->nft = file->nft;
    robot->imu_frame = -1;
    return file->imu_frame
               ? yaml_find_name(frames, "frame", file->imu_frame,
                                yaml_place(&file->mark, "imu.frame"), &robot->imu_frame, b->error)
               : ERROR_NONE;
}

/* ---- poses ---- */

/* Reads the positions (rad or m) of joints of one type; they must be within the limits. */
static enum error_code build_joint_positions(struct robot_builder *b, enum joint_type type,
                                             const struct yaml_real_entry *entry, size_t count,
                                             double *position)
{
    for (size_t i = 0; i < count; i++) {
        const struct robot_joint *joint;
        int j;
        enum error_code code = yaml_find_name(YAML_NAMES(b->robot->joint, b->robot->njoint, name),
                                              "joint", entry[i].name, &entry[i].mark, &j, b->error);

        if (code) {
            return code;
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

/* Returns a pose's position entry of a joint, or NULL. */
static const struct yaml_real_entry *find_position(const struct pose_yaml *pose, const char *joint)
{
    for (size_t i = 0; i < pose->njoint_rad + pose->njoint_m; i++) {
        const struct yaml_real_entry *entry =
            i < pose->njoint_rad ? &pose->joint_rad[i] : &pose->joint_m[i - pose->njoint_rad];

        if (strcmp(entry->name, joint) == 0) {
            return entry;
        }
    }
    return NULL;
}

/* Checks the joints that a pose does not name: each must be a follower, or zero must be within its
 * limits. */
static enum error_code check_unnamed_joints(struct robot_builder *b, const struct pose_yaml *given)
{
    for (size_t j = 0; j < b->robot->njoint; j++) {
        const struct robot_joint *joint = &b->robot->joint[j];

        if ((joint->lower > 0.0 || joint->upper < 0.0) && !find_position(given, joint->name) &&
            !robot_find_coupling(b->robot, j)) {
            return yaml_error(b->error, &given->mark,
                              "found pose \"%s\" without joint \"%s\", expected it: its limits %g "
                              "to %g exclude zero",
                              given->pose.name, joint->name, joint->lower, joint->upper);
        }
    }
    return ERROR_NONE;
}

/* Moves followers to the positions that their leaders give. Refuses positions beyond the limits,
 * and a pose that gives a follower another position. */
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
    /* Compares the pose's positions and the limits with the aligned positions */
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const int j = robot->coupling[i].follower;
        const struct robot_joint *joint = &robot->joint[j];
        const struct yaml_real_entry *entry = find_position(given, joint->name);
        const double near = COUPLING_ALIGNED * fmax(1.0, fabs(aligned[j]));

        if (entry && fabs(position[j] - aligned[j]) > near) {
            return yaml_error(
                b->error, &entry->mark,
                "found joint \"%s\" at %g, expected %.9g, where \"%s\" leads it, or no such key",
                joint->name, position[j], aligned[j], robot->joint[robot->coupling[i].leader].name);
        }
        if (aligned[j] < joint->lower - near || aligned[j] > joint->upper + near) {
            return yaml_error(b->error, &given->mark,
                              "found pose \"%s\" with joint \"%s\" at %g, where \"%s\" leads it, "
                              "expected %g to %g (its limits)",
                              given->pose.name, joint->name, aligned[j],
                              robot->joint[robot->coupling[i].leader].name, joint->lower,
                              joint->upper);
        }
    }
    memcpy(position, aligned, robot->njoint * sizeof *aligned);
    return ERROR_NONE;
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
    if (yaml_has(&given->mark, "base_xyz_m") != b->robot->floating ||
        (yaml_has(&given->mark, "base_rpy_rad") && !b->robot->floating)) {
        return yaml_error(b->error, &given->mark, "found pose \"%s\" %s, expected %s",
                          given->pose.name,
                          b->robot->floating ? "without key \"base_xyz_m\"" : "with a base",
                          b->robot->floating ? "it: the base floats" : "none: the base is fixed");
    }

    /* Set defaults: base at the origin, joints at zero */
    *pose = given->pose;
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
