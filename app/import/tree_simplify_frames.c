/* SPDX-License-Identifier: Apache-2.0 */
/* Makes frames, sensors and poses of the robot. */
#include "app/import/tree_simplify_private.h"

#include "base/text.h"
#include "base/vec3.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* ---- frames ---- */

/* Adds a frame at a pose in a link, and returns its index. Refuses a name that is already used. */
static int simplify_add_frame(struct simplifier *r, const char *name, const char *file, int line,
                              int link, const struct import_place *place)
{
    struct robot *robot = r->out->robot;
    struct robot_frame *f = &robot->frame[robot->nframe];
    struct import_place at;

    f->name = simplify_name(r, file, line, "frame", name);
    if (robot_find_frame(robot, f->name) >= 0) {
        import_error(r->error, file, line,
                     "found a second frame named \"%.63s\", expected other names", f->name);
    }
    f->body = r->out->body[link];
    import_place_compose(&r->out->place[link], place, &at);
    memcpy(f->position, at.xyz, sizeof f->position);
    memcpy(f->rotation, at.R, sizeof f->rotation);
    return (int)robot->nframe++;
}

/* ---- sensors ---- */

/* Adds the frame of a sensor, with the name NAME-sensor. */
static int simplify_add_sensor_frame(struct simplifier *r, const struct import_sensor *sensor,
                                     const char *name, int link)
{
    static const char suffix[] = "-sensor";
    char text[64];

    snprintf(text, sizeof text, "%.*s%s", (int)(sizeof text - sizeof suffix), name, suffix);
    return simplify_add_frame(r, text, sensor->file, sensor->line, link, &sensor->place);
}

/* Sums the inertia of the part below a force-torque sensor within its body, in the body's frame.
 * Returns false if other bodies are attached to this part, because the sensor model ignores their
 * forces. One pass down the tree is enough, because parents come first. */
static bool sensor_sum_distal(const struct simplifier *r, int top, struct robot_inertia *distal)
{
    const struct import_robot *out = r->out;
    bool *below = simplify_alloc(r, r->model->nlink, sizeof *below), ends = true;

    for (size_t i = 0; i < r->norder && below; i++) {
        int link = r->order[i], above = i > 0 ? r->above[link] : -1;

        below[link] = link == top || (above >= 0 && below[r->model->joint[above].parent_link]);
        if (below[link] && out->body[link] == out->body[top]) {
            import_add_inertia(distal, &r->model->link[link].inertia, &out->place[link]);
        }
        ends = ends && (!below[link] || out->body[link] == out->body[top]);
    }
    return ends;
}

/* Checks whether a sensor's name is unique. Sensors that are named by their type in the file may
 * share a name. */
static bool sensor_has_own_name(const struct import_model *model,
                                const struct import_sensor *sensor)
{
    size_t count = 0;

    for (size_t i = 0; i < model->nsensor; i++) {
        count += !strcmp(model->sensor[i].name, sensor->name);
    }
    return count == 1;
}

/* Adds a force-torque sensor at the child link of its joint. Drops a sensor that is not at the end
 * of a limb, with a note. */
static void simplify_add_ft(struct simplifier *r, const struct import_sensor *sensor, int link)
{
    struct robot *robot = r->out->robot;
    struct robot_ft_sensor *ft = &robot->ft[robot->nft];
    const struct robot_frame *frame;
    struct robot_inertia below = {0};
    struct import_place back;

    if (!sensor_sum_distal(r, link, &below)) {
        import_note_add(r->notes, IMPORT_DROPPED, sensor->file, sensor->line,
                        "force-torque sensor \"%.63s\" in joint \"%.63s\": joints move below it, "
                        "and sensors here are at the end of a limb",
                        sensor->name, sensor->joint);
        return;
    }
    ft->name = simplify_name(r, sensor->file, sensor->line, "sensor",
                             sensor_has_own_name(r->model, sensor) ? sensor->name : sensor->joint);
    ft->frame = simplify_add_sensor_frame(r, sensor, sensor->joint, link);
    frame = &robot->frame[ft->frame];

    /* Transform the inertia below it from the body's frame to the sensor's: R^T and -R^T p */
    mat3_transpose(frame->rotation, back.R);
    mat3_apply(back.R, frame->position, back.xyz);
    for (int i = 0; i < 3; i++) {
        back.xyz[i] = -back.xyz[i];
    }
    import_add_inertia(&ft->distal, &below, &back);
    robot->nft++;
}

/* Checks whether an earlier entry is a force-torque sensor in the same joint, because some files
 * list a sensor twice. */
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

void simplify_add_frames(struct simplifier *r)
{
    const struct import_model *model = r->model;
    struct robot *robot = r->out->robot;
    struct import_place here;

    robot->frame = simplify_alloc(r, model->nlink + model->nsensor, sizeof *robot->frame);
    robot->ft = simplify_alloc(r, model->nsensor + 1, sizeof *robot->ft);
    import_place_identity(&here);
    for (size_t i = 0; i < r->norder && !r->error->code; i++) {
        const struct import_link *link = &model->link[r->order[i]];

        /* The first link of a body is the body's own frame; the others become frames */
        if (strcmp(link->name, robot->body[r->out->body[r->order[i]]].name) != 0) {
            simplify_add_frame(r, link->name, link->file, link->line, r->order[i], &here);
        }
    }
    for (size_t i = 0; i < model->nsensor && !r->error->code; i++) {
        const struct import_sensor *sensor = &model->sensor[i];
        int link = sensor->kind == IMPORT_IMU
                       ? import_find_link(model, sensor->link)
                       : model->joint[import_find_joint(model, sensor->joint)].child_link;

        if (r->out->body[link] < 0) {
            import_note_add(r->notes, IMPORT_DROPPED, sensor->file, sensor->line,
                            "sensor \"%.63s\": it is fixed in the world", sensor->name);
        } else if (sensor->kind == IMPORT_FT) {
            if (!ft_is_known(r, i)) {
                simplify_add_ft(r, sensor, link);
            }
        } else if (robot->imu_frame < 0) {
            robot->imu_frame = simplify_add_sensor_frame(r, sensor, sensor->name, link);
        } else {
            import_note_add(r->notes, IMPORT_DROPPED, sensor->file, sensor->line,
                            "inertial sensor \"%.63s\" on link \"%.63s\": a robot has one, and the "
                            "first is it",
                            sensor->name, sensor->link);
        }
    }
}

/* ---- poses ---- */

/* Adds a pose of the file. Joints that it does not name are at rest. All joints are moved into
 * their limits. */
static void simplify_add_pose(struct simplifier *r, const struct import_pose *source)
{
    struct robot *robot = r->out->robot;
    struct robot_pose *pose = &robot->pose[robot->npose];
    double *position = simplify_alloc(r, robot->njoint + 1, sizeof *position);

    pose->name = simplify_name(r, source->file, source->line, "pose", source->name);
    if (robot_find_pose(robot, pose->name) >= 0) {
        import_note_add(r->notes, IMPORT_DROPPED, source->file, source->line,
                        "pose \"%.63s\": the name is taken", pose->name);
        return;
    }

    /* The limits are those of the joint and of all joints coupled to it */
    for (size_t j = 0; j < robot->njoint && position; j++) {
        const int given = TEXT_FIND(source->value, source->nvalue, joint, r->out->source[j]->name);
        const struct import_value *value = given < 0 ? NULL : &source->value[given];
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
    if (position) {
        simplify_align_pose(r, source, position);
    }
    pose->base_quaternion[0] = 1.0;
    pose->joint = position;
    robot->npose++;
}

void simplify_add_poses(struct simplifier *r)
{
    const struct import_pose rest = {.name = "rest", .file = r->model->file};

    r->out->robot->pose = simplify_alloc(r, r->model->npose + 1, sizeof *r->out->robot->pose);
    for (size_t i = 0; i <= r->model->npose && !r->error->code; i++) {
        simplify_add_pose(r, i == 0 ? &rest : &r->model->pose[i - 1]);
    }
}
