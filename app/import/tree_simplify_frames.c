/* SPDX-License-Identifier: Apache-2.0 */
/* Makes frames, sensors and poses of the robot. */
#include "app/import/tree_simplify_private.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* ---- frames ---- */

/* Adds a frame at a pose in a body and returns its index; refuses a name that is already used. */
static enum error_code simplify_add_frame(struct simplifier *r, const char *name, const char *file,
                                          int line, int body, const struct import_place *place,
                                          int *frame)
{
    struct robot *robot = r->out->robot;
    struct robot_frame *f = &robot->frame[robot->nframe];
    enum error_code code =
        import_make_name(file, name, line, "frame", r->arena, r->notes, &f->name, r->error);

    if (code) {
        return code;
    }
    *frame = robot_find_frame(robot, f->name);
    if (*frame >= 0) {
        return import_error(r->error, file, line,
                            "found a second frame named \"%.63s\", expected other names", f->name);
    }
    f->body = body;
    memcpy(f->position, place->xyz, sizeof f->position);
    memcpy(f->rotation, place->R, sizeof f->rotation);
    *frame = (int)robot->nframe++;
    return ERROR_NONE;
}

/* Makes the name of a sensor's frame, NAME-sensor. */
static const char *frame_choose_name(const struct simplifier *r, const char *name)
{
    static const char suffix[] = "-sensor";
    char text[64];

    snprintf(text, sizeof text, "%.*s%s", (int)(sizeof text - sizeof suffix), name, suffix);
    return arena_strdup(r->arena, text);
}

/* ---- sensors ---- */

/* Sums the inertia below a force-torque sensor within its body, in the body's frame. *ends is
 * false if other bodies are attached there, whose forces the model's sensor does not include. One
 * pass down the tree: parents come first. */
static enum error_code sensor_sum_distal(const struct simplifier *r, int top,
                                         struct robot_inertia *distal, bool *ends)
{
    const struct import_robot *out = r->out;
    bool *below = arena_alloc(r->arena, r->model->nlink, sizeof *below);

    if (!below) {
        return simplify_no_memory(r);
    }
    *ends = true;
    for (size_t i = 0; i < r->norder; i++) {
        int link = r->order[i], above = i > 0 ? r->above[link] : -1;

        below[link] = link == top || (above >= 0 && below[r->model->joint[above].parent_link]);
        if (below[link] && out->body[link] == out->body[top]) {
            import_add_inertia(distal, &r->model->link[link].inertia, &out->place[link]);
        }
        *ends = *ends && (!below[link] || out->body[link] == out->body[top]);
    }
    return ERROR_NONE;
}

/* Adds a force-torque sensor at the child link of its joint; drops one that is not at the end of a
 * limb, with a note. */
static enum error_code simplify_add_ft(struct simplifier *r, const struct import_sensor *sensor)
{
    struct robot *robot = r->out->robot;
    const struct import_joint *joint = &r->model->joint[import_find_joint(r->model, sensor->joint)];
    struct robot_ft_sensor *ft = &robot->ft[robot->nft];
    struct robot_inertia below = {0};
    struct import_place place, back;
    const char *name;
    bool ends = true;
    enum error_code code = sensor_sum_distal(r, joint->child_link, &below, &ends);

    if (code) {
        return code;
    }
    if (!ends) {
        import_note_add(
            r->notes, IMPORT_DROPPED, sensor->file, sensor->line,
            "force-torque sensor \"%.63s\" in joint \"%.63s\": joints move below it, and "
            "sensors here are at the end of a limb",
            sensor->name, sensor->joint);
        return ERROR_NONE;
    }

    /* Place the sensor in the frame of the child link, moved by its own offset */
    import_place_compose(&r->out->place[joint->child_link], &sensor->place, &place);
    name = frame_choose_name(r, sensor->joint);
    if (!name) {
        return simplify_no_memory(r);
    }
    if ((code = import_make_name(sensor->file, sensor->joint, sensor->line, "sensor", r->arena,
                                 r->notes, &ft->name, r->error)) ||
        (code = simplify_add_frame(r, name, sensor->file, sensor->line,
                                   r->out->body[joint->child_link], &place, &ft->frame))) {
        return code;
    }

    /* Transforms the part below it from the body's frame to the sensor's: R^T and -R^T p */
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            back.R[3 * i + j] = place.R[3 * j + i];
        }
        back.xyz[i] = -(place.R[i] * place.xyz[0] + place.R[3 + i] * place.xyz[1] +
                        place.R[6 + i] * place.xyz[2]);
    }
    import_add_inertia(&ft->distal, &below, &back);
    robot->nft++;
    return ERROR_NONE;
}

/* Adds the first inertial sensor; drops others with a note. */
static enum error_code simplify_add_imu(struct simplifier *r, const struct import_sensor *sensor)
{
    struct robot *robot = r->out->robot;
    int link = import_find_link(r->model, sensor->link);
    struct import_place place;
    const char *name;

    if (robot->imu_frame >= 0) {
        import_note_add(
            r->notes, IMPORT_DROPPED, sensor->file, sensor->line,
            "inertial sensor \"%.63s\" on link \"%.63s\": a robot has one, and the first "
            "is it",
            sensor->name, sensor->link);
        return ERROR_NONE;
    }
    import_place_compose(&r->out->place[link], &sensor->place, &place);
    name = frame_choose_name(r, sensor->name);
    if (!name) {
        return simplify_no_memory(r);
    }
    return simplify_add_frame(r, name, sensor->file, sensor->line, r->out->body[link], &place,
                              &robot->imu_frame);
}

/* Checks whether an earlier entry is a force-torque sensor in the same joint, because some files
 * list one twice. */
static bool ft_is_known(const struct simplifier *r, size_t sensor)
{
    for (size_t i = 0; i < sensor; i++) {
        if (r->model->sensor[i].kind == IMPORT_FT &&
            !strcmp(r->model->sensor[i].joint, r->model->sensor[sensor].joint)) {
            return true;
        }
    }
    return false;
}

enum error_code simplify_add_frames(struct simplifier *r)
{
    const struct import_model *model = r->model;
    struct robot *robot = r->out->robot;
    enum error_code code = ERROR_NONE;
    int frame;

    robot->frame = arena_alloc(r->arena, model->nlink + model->nsensor, sizeof *robot->frame);
    robot->ft = arena_alloc(r->arena, model->nsensor + 1, sizeof *robot->ft);
    if (!robot->frame || !robot->ft) {
        return simplify_no_memory(r);
    }
    for (size_t i = 0; i < r->norder && !code; i++) {
        int link = r->order[i];

        /* The first link of a body is the body's own frame; the others become frames */
        if (strcmp(model->link[link].name, robot->body[r->out->body[link]].name) != 0) {
            code = simplify_add_frame(r, model->link[link].name, model->link[link].file,
                                      model->link[link].line, r->out->body[link],
                                      &r->out->place[link], &frame);
        }
    }
    for (size_t i = 0; i < model->nsensor && !code; i++) {
        const struct import_sensor *sensor = &model->sensor[i];
        int link = sensor->kind == IMPORT_IMU
                       ? import_find_link(model, sensor->link)
                       : model->joint[import_find_joint(model, sensor->joint)].child_link;

        if (r->out->body[link] < 0) {
            import_note_add(r->notes, IMPORT_DROPPED, sensor->file, sensor->line,
                            "sensor \"%.63s\": it is fixed in the world", sensor->name);
        } else if (sensor->kind == IMPORT_IMU) {
            code = simplify_add_imu(r, sensor);
        } else if (!ft_is_known(r, i)) {
            code = simplify_add_ft(r, sensor);
        }
    }
    return code;
}

/* ---- poses ---- */

/* Returns a pose's value for a joint, or NULL. */
static const struct import_value *pose_find_value(const struct import_pose *pose, const char *joint)
{
    for (size_t i = 0; i < pose->nvalue; i++) {
        if (!strcmp(pose->value[i].joint, joint)) {
            return &pose->value[i];
        }
    }
    return NULL;
}

/* Adds a pose of the file. Joints that it does not name are at rest, and all are moved into their
 * limits. */
static enum error_code simplify_add_pose(struct simplifier *r, const struct import_pose *source)
{
    struct robot *robot = r->out->robot;
    struct robot_pose *pose = &robot->pose[robot->npose];
    double *position = arena_alloc(r->arena, robot->njoint + 1, sizeof *position);
    enum error_code code;

    if (!position) {
        return simplify_no_memory(r);
    }
    code = import_make_name(source->file, source->name, source->line, "pose", r->arena, r->notes,
                            &pose->name, r->error);
    if (code) {
        return code;
    }
    if (robot_find_pose(robot, pose->name) >= 0) {
        import_note_add(r->notes, IMPORT_DROPPED, source->file, source->line,
                        "pose \"%.63s\": the name is taken", pose->name);
        return ERROR_NONE;
    }

    /* These limits are those of the joint and of all joints coupled to it */
    for (size_t j = 0; j < robot->njoint; j++) {
        const struct import_value *value = pose_find_value(source, r->out->source[j]->name);
        const struct robot_joint *joint = &robot->joint[j];
        const size_t own = (size_t)(r->out->source[j] - r->model->joint);
        const double lower = fmax(joint->lower, r->lower[own]);
        const double upper = fmin(joint->upper, r->upper[own]);

        position[j] = value ? value->value : r->out->rest[j];
        if (position[j] < lower || position[j] > upper) {
            position[j] = fmin(fmax(position[j], lower), upper);
            import_note_add(r->notes, IMPORT_CHANGED, source->file, source->line,
                            "pose \"%.63s\": joint \"%.63s\" is at its limit %g, not at %g",
                            pose->name, joint->name, position[j], value ? value->value : 0.0);
        }
    }
    simplify_align_pose(r, source, position);
    pose->base_quaternion[0] = 1.0;
    pose->joint = position;
    robot->npose++;
    return ERROR_NONE;
}

enum error_code simplify_add_poses(struct simplifier *r)
{
    const struct import_pose rest = {.name = "rest", .file = r->model->file};
    struct robot *robot = r->out->robot;
    enum error_code code;

    robot->pose = arena_alloc(r->arena, r->model->npose + 1, sizeof *robot->pose);
    if (!robot->pose) {
        return simplify_no_memory(r);
    }
    code = simplify_add_pose(r, &rest);
    for (size_t i = 0; i < r->model->npose && !code; i++) {
        code = simplify_add_pose(r, &r->model->pose[i]);
    }
    return code;
}
