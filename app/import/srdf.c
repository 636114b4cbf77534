/* SPDX-License-Identifier: Apache-2.0 */
/* Reads SRDF: named poses, and whether the base is fixed in the world. */
#include "app/import/urdf_private.h"

#include <string.h>

/* Counts the states, and in *values the joint positions of all of them. */
static size_t srdf_count_states(const xmlNode *root, size_t *values)
{
    size_t states = 0;

    *values = 0;
    for (const xmlNode *node = xml_child(root, "group_state"); node;
         node = xml_next(node, "group_state")) {
        states++;
        for (const xmlNode *joint = xml_child(node, "joint"); joint;
             joint = xml_next(joint, "joint")) {
            ++*values;
        }
    }
    return states;
}

/* Returns the model's pose of that name, or NULL. */
static struct import_pose *srdf_find_pose(struct import_model *model, const char *name)
{
    for (size_t i = 0; i < model->npose; i++) {
        if (!strcmp(model->pose[i].name, name)) {
            return &model->pose[i];
        }
    }
    return NULL;
}

/* Reads the position of one joint into the pose; drops those of joints that the robot lacks or that
 * have more than one coordinate. */
static enum error_code srdf_read_value(const struct urdf_reader *r, const xmlNode *node,
                                       struct import_pose *pose)
{
    struct import_value value = {.line = xml_line(node)};
    const char *name, *text;
    enum error_code code;
    int joint;

    if ((code = xml_need(r->file, node, "name", &name, r->error)) ||
        (code = xml_need(r->file, node, "value", &text, r->error))) {
        return code;
    }

    /* Joints that the robot lacks, and joints with several coordinates, are left out */
    joint = import_find_joint(r->model, name);
    if (joint < 0 || strpbrk(text + strspn(text, " \t\r\n"), " \t\r\n")) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, value.line,
                        "position of \"%.63s\" in pose \"%.63s\": %s", name, pose->name,
                        joint < 0 ? "the robot has no such joint"
                                  : "it has more coordinates than one");
        return ERROR_NONE;
    }
    code = xml_parse_reals(r->file, node, "value", text, 1, &value.value, r->error);
    if (code) {
        return code;
    }
    value.joint = r->model->joint[joint].name;

    /* The first value of a joint counts */
    for (size_t i = 0; i < pose->nvalue; i++) {
        if (!strcmp(pose->value[i].joint, value.joint)) {
            import_note_add(r->notes, IMPORT_DROPPED, r->file->name, value.line,
                            "second position of \"%.63s\" in pose \"%.63s\"", name, pose->name);
            return ERROR_NONE;
        }
    }
    pose->value[pose->nvalue++] = value;
    return ERROR_NONE;
}

/* Reads a state; states of several groups with one name are one pose. */
static enum error_code srdf_read_state(const struct urdf_reader *r, const xmlNode *node)
{
    struct import_model *model = r->model;
    const char *name;
    struct import_pose *pose;
    enum error_code code = urdf_need_text(r, node, "name", &name);

    if (code) {
        return code;
    }

    /* A second state of the same name belongs to another group of joints: it adds to the pose */
    pose = srdf_find_pose(model, name);
    if (!pose) {
        pose = &model->pose[model->npose++];
        *pose = (struct import_pose){.name = name, .file = r->file->name, .line = xml_line(node)};
        pose->value = arena_alloc(r->arena, model->njoint + 1, sizeof *pose->value);
        if (!pose->value) {
            return urdf_no_memory(r);
        }
    }
    for (const xmlNode *joint = xml_child(node, "joint"); joint && !code;
         joint = xml_next(joint, "joint")) {
        code = srdf_read_value(r, joint, pose);
    }
    return code;
}

enum error_code srdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error)
{
    struct urdf_reader r = {file, arena, model, notes, error, NULL, 0};
    size_t values, states = srdf_count_states(file->root, &values);
    enum error_code code = ERROR_NONE;

    code = xml_check_elements(file, error);
    if (code) {
        return code;
    }
    if (!xml_is(file->root, "robot")) {
        return import_error(error, file->name, xml_line(file->root),
                            "found <%.40s>, expected <robot> of an SRDF",
                            (const char *)file->root->name);
    }
    if (states > 256 || values > 65536) {
        return import_error(error, file->name, xml_line(file->root),
                            "found %zu states with %zu positions, expected at most 256 and 65536",
                            states, values);
    }
    model->pose = arena_alloc(arena, states + 1, sizeof *model->pose);
    if (!model->pose) {
        return urdf_no_memory(&r);
    }

    /* The virtual joint says whether the base floats; anything else is of no use here */
    for (const xmlNode *node = xml_child(file->root, NULL); node && !code;
         node = xml_next(node, NULL)) {
        if (xml_is(node, "group_state")) {
            code = srdf_read_state(&r, node);
        } else if (xml_is(node, "virtual_joint")) {
            const char *type = xml_attribute(node, "type");

            model->floating_base |= type && !strcmp(type, "floating");
            model->fixed_base |= type && !strcmp(type, "fixed");
        }
    }
    return code;
}
