/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the robot of a rig: reads its file, applies the rig's changes, and sets the initial
 * pose. */
#include "model/coupling.h"
#include "model/spatial.h"
#include "rig/builder_private.h"
#include "base/config.h"

/* Replaces series springs of the robot by springs of the rig. */
static enum error_code rig_replace_springs(struct rig_builder *b, struct robot *robot)
{
    const struct raw_robot *raw = &b->raw->robot;
    int index;

    /* Check that the joint has a drive, because only such a joint has a spring */
    for (size_t i = 0; i < raw->nspring; i++) {
        const struct raw_spring *spring = &raw->spring[i];
        enum error_code code = rig_find(b, &spring->mark, "joint", spring->joint,
                                        RIG_NAMES(robot->joint, robot->njoint), &index);

        if (code) {
            return code;
        }
        if (!robot->joint[index].sea.present) {
            return yaml_error(b->error, &spring->mark,
                              "found a spring for joint \"%s\", expected a joint with a drive",
                              spring->joint);
        }
        robot->joint[index].sea.Ks = spring->Ks_nm_rad;
        robot->joint[index].sea.Ds = spring->Ds_nm_s_rad;
    }
    return ERROR_NONE;
}

/* Replaces the part beyond a force-torque sensor by a tool of the rig. */
static enum error_code rig_hang_tool(struct rig_builder *b, struct robot_ft_sensor *ft,
                                     const struct raw_ft_sensors *raw)
{
    struct error why;

    ft->distal = raw->tool;
    return robot_check_inertia(&ft->distal, &why)
               ? yaml_error(b->error, yaml_place(&raw->mark, "tool"), "%s", why.text)
               : ERROR_NONE;
}

/* Sets the rig's tools on the force-torque sensors: the common tool first, then tools of single
 * sensors. */
static enum error_code rig_hang_tools(struct rig_builder *b, struct robot *robot)
{
    const struct raw_sensors *raw = &b->raw->sensors;
    enum error_code code = ERROR_NONE;
    int index;

    for (size_t f = 0; yaml_has(&raw->every_ft.mark, "tool") && f < robot->nft && !code; f++) {
        code = rig_hang_tool(b, &robot->ft[f], &raw->every_ft);
    }
    for (size_t i = 0; i < raw->nft && !code; i++) {
        code = rig_find(b, &raw->ft[i].mark, "F/T sensor", raw->ft[i].sensor.name,
                        RIG_NAMES(robot->ft, robot->nft), &index);
        if (!code && yaml_has(&raw->ft[i].mark, "tool")) {
            code = rig_hang_tool(b, &robot->ft[index], &raw->ft[i]);
        }
    }
    return code;
}

/* Adds a mass on a body to the part beyond the body's force-torque sensors, which carry the mass
 * too. */
static enum error_code rig_hang_mass(struct rig_builder *b, struct robot *robot, int body,
                                     const struct yaml_real_entry *added)
{
    for (size_t f = 0; f < robot->nft; f++) {
        struct robot_ft_sensor *ft = &robot->ft[f];
        const struct robot_frame *frame = &robot->frame[ft->frame];
        double arm[3], p[3];

        if (frame->body != body) {
            continue;
        }
        if (!(ft->distal.mass + added->value > 0.0)) {
            return yaml_error(b->error, &added->mark,
                              "found %g kg on body \"%s\", expected more than %g kg, all that its "
                              "sensor \"%s\" carries",
                              added->value, added->name, 0.0 - ft->distal.mass, ft->name);
        }
        vec3_sub(robot->body[body].inertia.com, frame->position, arm);
        mat3_apply_transposed(frame->rotation, arm, p);

        /* Add a point mass at `p`, in the frame of the inertia. The moments of inertia are
         * about the center of mass. */
        struct robot_inertia *inertia = &ft->distal;
        double total = inertia->mass + added->value, reduced = inertia->mass * added->value / total,
               d[3];

        vec3_sub(p, inertia->com, d);
        for (int i = 0; i < 3; i++) {
            for (int j = i; j < 3; j++) {
                inertia->I[sym3_index[i][j]] +=
                    reduced * ((i == j ? vec3_dot(d, d) : 0.0) - d[i] * d[j]);
            }
        }
        vec3_add_scaled(inertia->com, added->value / total, d, inertia->com);
        inertia->mass = total;
    }
    return ERROR_NONE;
}

/* Adds point masses to bodies, at their centers of mass. */
static enum error_code rig_add_masses(struct rig_builder *b, struct robot *robot)
{
    const struct raw_robot *raw = &b->raw->robot;
    enum error_code code = ERROR_NONE;
    int index;

    /* Check that the total mass stays positive, because an added mass may be negative */
    for (size_t i = 0; i < raw->nmass && !code; i++) {
        const struct yaml_real_entry *added = &raw->mass[i];
        struct robot_inertia *inertia;

        code = rig_find(b, &added->mark, "body", added->name, RIG_NAMES(robot->body, robot->nbody),
                        &index);
        if (code) {
            break;
        }
        inertia = &robot->body[index].inertia;
        if (!(inertia->mass + added->value > 0.0)) {
            return yaml_error(b->error, &added->mark,
                              "found %g kg on body \"%s\", expected more than %g kg, all that it "
                              "has",
                              added->value, added->name, -inertia->mass);
        }
        inertia->mass += added->value;
        code = rig_hang_mass(b, robot, index, added);
    }
    return code;
}

/* Applies the rig's changes to a copy of the robot. The original stays unchanged. */
static enum error_code rig_change_robot(struct rig_builder *b)
{
    const struct raw_robot *raw = &b->raw->robot;
    const struct raw_sensors *sensors = &b->raw->sensors;
    struct robot *robot;
    enum error_code code;

    if (!raw->nspring && !raw->nmass && !sensors->nft &&
        !yaml_has(&sensors->every_ft.mark, "tool")) {
        return ERROR_NONE;
    }
    code = robot_copy(b->robot, b->arena, &robot, b->error);
    code = code ? code : rig_replace_springs(b, robot);
    code = code ? code : rig_hang_tools(b, robot);
    code = code ? code : rig_add_masses(b, robot);
    if (code) {
        return code;
    }

    /* Update the derived data and the hash */
    b->robot = robot;
    code = robot_finish(robot, b->error);
    return code && raw->nmass ? error_prefix(b->error, "%s:%d:%d: with the masses that are added",
                                             raw->mass[0].mark.file, raw->mass[0].mark.line,
                                             raw->mass[0].mark.column)
                              : code;
}

/* Finds the robot's file from a path relative to the rig's folder, or from a name. */
static enum error_code rig_find_robot(struct rig_builder *b, const char **path)
{
    const struct raw_robot *raw = &b->raw->robot;
    const struct yaml_mark *mark = yaml_place(&raw->mark, "file");

    if (!*raw->file || strpbrk(raw->file, "/.")) {
        return yaml_resolve_path(mark, raw->file, b->arena, path, b->error);
    }
    return config_locate_from(CONFIG_ROBOT, raw->file, mark->file, b->arena, path, b->error)
               ? error_prefix(b->error, "%s:%d:%d", mark->file, mark->line, mark->column)
               : ERROR_NONE;
}

enum error_code rig_build_robot(struct rig_builder *b)
{
    const struct raw_robot *raw = &b->raw->robot;
    const char *path;
    enum error_code code = rig_find_robot(b, &path);

    if (!code) {
        code = robot_load_named(path, raw->variant, yaml_place(&raw->mark, "variant"), b->arena,
                                &b->robot, b->error);
        code = rig_place_file(b, yaml_place(&raw->mark, "file"), path, code);
    }
    code = code ? code : rig_change_robot(b);
    if (code) {
        return code;
    }
    mat3_identity(b->base_rotation);
    b->rig->robot = b->robot;
    b->rig->variant = raw->variant;
    b->torque = arena_alloc(b->arena, b->robot->njoint, sizeof *b->torque);
    b->driver = arena_alloc(b->arena, b->robot->njoint, sizeof *b->driver);
    b->ft = arena_alloc(b->arena, b->robot->nft, sizeof *b->ft);
    return b->torque && b->driver && b->ft ? ERROR_NONE : rig_no_memory(b);
}

/* Builds the joint positions: the pose of the robot, then the angles that the rig gives. */
static enum error_code rig_build_joints(struct rig_builder *b, const struct robot_pose *pose)
{
    const struct raw_initial *raw = &b->raw->initial;
    double *joint = arena_alloc(b->arena, b->robot->njoint, sizeof *joint);

    if (!joint) {
        return rig_no_memory(b);
    }

    /* Copy the pose, then set the rig's angles of single joints within their limits */
    memcpy(joint, pose->joint, b->robot->njoint * sizeof *joint);
    for (size_t i = 0; i < raw->njoint; i++) {
        const struct yaml_real_entry *entry = &raw->joint[i];
        const struct robot_coupling *coupling;
        const struct robot_joint *limits;
        int index;
        enum error_code code = rig_find(b, &entry->mark, "joint", entry->name,
                                        RIG_NAMES(b->robot->joint, b->robot->njoint), &index);

        if (code) {
            return code;
        }
        limits = &b->robot->joint[index];
        if (limits->type != JOINT_REVOLUTE || entry->value < limits->lower ||
            entry->value > limits->upper) {
            return yaml_error(b->error, &entry->mark,
                              "found joint \"%s\" at %g rad, expected a revolute joint within its "
                              "limits, %g to %g",
                              entry->name, entry->value, limits->lower, limits->upper);
        }
        coupling = robot_find_coupling(b->robot, (size_t)index);
        if (coupling) {
            return yaml_error(b->error, &entry->mark,
                              "found joint \"%s\", which follows \"%s\", expected that one",
                              entry->name, b->robot->joint[coupling->leader].name);
        }
        joint[index] = entry->value;
    }
    b->rig->joint = joint;

    /* Set each follower joint to the angle that its leader's angle requires */
    const struct robot *robot = b->robot;

    coupling_align(robot, joint);
    for (size_t i = 0; i < robot->ncoupling; i++) {
        const struct robot_coupling *coupling = &robot->coupling[i];
        const struct robot_joint *follower = &robot->joint[coupling->follower];
        const double at = joint[coupling->follower], near = COUPLING_ALIGNED * fmax(1.0, fabs(at));

        if (at < follower->lower - near || at > follower->upper + near) {
            return yaml_error(b->error, &b->raw->initial.mark,
                              "found joint \"%s\" at %g, where \"%s\" leads it, expected %g to "
                              "%g (its limits)",
                              follower->name, at, robot->joint[coupling->leader].name,
                              follower->lower, follower->upper);
        }
    }
    return ERROR_NONE;
}

/* Fixes the base to the world at the place that the rig gives. Does nothing for a free base. */
static enum error_code rig_fix_base(struct rig_builder *b)
{
    struct rig *rig = b->rig;
    enum error_code code;
    struct robot *robot;

    if (!b->raw->robot.fixed_base || !b->robot->floating) {
        return ERROR_NONE;
    }
    memcpy(b->base_position, rig->base_position, sizeof b->base_position);
    mat3_from_quaternion(rig->base_quaternion, b->base_rotation);
    code = robot_copy(b->robot, b->arena, &robot, b->error);
    code = code ? code : robot_fix_base(robot, rig->base_position, rig->base_quaternion, b->error);
    if (code) {
        return code;
    }
    b->robot = rig->robot = robot;
    return ERROR_NONE;
}

enum error_code rig_build_pose(struct rig_builder *b)
{
    const struct raw_initial *raw = &b->raw->initial;
    const struct robot_pose *pose;
    struct rig *rig = b->rig;
    enum error_code code;
    int index;

    /* Check that the pose exists, and that at most one key places the base */
    code = rig_find(b, yaml_place(&raw->mark, "pose"), "pose", raw->pose,
                    RIG_NAMES(b->robot->pose, b->robot->npose), &index);
    if (code) {
        return code;
    }
    if (yaml_has(&raw->mark, "base_xyz_m") && yaml_has(&raw->mark, "base_height_m")) {
        return yaml_error(b->error, &raw->mark,
                          "found base_xyz_m and base_height_m, expected one of them");
    }
    if (!b->robot->floating &&
        (yaml_has(&raw->mark, "base_xyz_m") || yaml_has(&raw->mark, "base_height_m") ||
         yaml_has(&raw->mark, "base_rpy_rad"))) {
        return yaml_error(b->error, &raw->mark,
                          "found a place of the base, expected none for a robot with a fixed base");
    }

    /* Combine the pose of the robot file with the values of the rig */
    pose = &b->robot->pose[index];
    rig->pose = pose->name;
    rig->hold = (enum rig_hold)raw->hold;
    rig->settle = raw->settle;
    memcpy(rig->base_position,
           yaml_has(&raw->mark, "base_xyz_m") ? raw->base_xyz_m : pose->base_position,
           sizeof rig->base_position);
    memcpy(rig->base_quaternion, pose->base_quaternion, sizeof rig->base_quaternion);
    if (yaml_has(&raw->mark, "base_height_m")) {
        rig->base_position[2] = raw->base_height_m;
    }
    if (yaml_has(&raw->mark, "base_rpy_rad")) {
        quaternion_from_rpy(raw->base_rpy_rad, rig->base_quaternion);
    }
    code = rig_build_joints(b, pose);
    return code ? code : rig_fix_base(b);
}
