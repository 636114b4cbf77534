/* SPDX-License-Identifier: Apache-2.0 */
/* Reads URDF: the elements of <robot>, and how its links and joints refer to each other by name. */
#include "app/import/urdf_private.h"

#include "base/vec3.h"

#include <stdio.h>
#include <string.h>

/* Elements without meaning for dynamics, passed over without a note. */
static const char *const ignored[] = {"material", "group", "version", NULL};

enum error_code urdf_no_memory(const struct urdf_reader *r)
{
    return error_set(r->error, ERROR_MEMORY, "%.200s: no memory left for this robot",
                     r->file->name);
}

enum error_code urdf_need_text(const struct urdf_reader *r, const xmlNode *node, const char *name,
                               const char **text)
{
    const char *found;
    enum error_code code = xml_need(r->file, node, name, &found, r->error);

    if (code) {
        return code;
    }
    *text = arena_strdup(r->arena, found);
    return *text ? ERROR_NONE : urdf_no_memory(r);
}

enum error_code urdf_only_child(const struct urdf_reader *r, const xmlNode *node, const char *name,
                                xmlNode **child)
{
    xmlNode *second;

    *child = xml_child(node, name);
    second = *child ? xml_next(*child, name) : NULL;
    if (second) {
        return import_error(r->error, r->file->name, xml_line(second),
                            "found a second <%s> in <%.40s>, expected one (line %d)", name,
                            (const char *)node->name, xml_line(*child));
    }
    return ERROR_NONE;
}

enum error_code urdf_read_origin(const struct urdf_reader *r, const xmlNode *node,
                                 struct import_place *place)
{
    double rpy[3] = {0, 0, 0}, quaternion[4];
    bool by_quaternion;
    xmlNode *origin;
    enum error_code code = urdf_only_child(r, node, "origin", &origin);

    import_place_identity(place);
    if (code || !origin) {
        return code;
    }
    if ((code = xml_reals(r->file, origin, "xyz", 3, place->xyz, NULL, r->error)) ||
        (code = xml_reals(r->file, origin, "rpy", 3, rpy, NULL, r->error)) ||
        (code = xml_reals(r->file, origin, "quat_xyzw", 4, quaternion, &by_quaternion, r->error))) {
        return code;
    }
    if (by_quaternion) {
        return import_error(r->error, r->file->name, xml_line(origin),
                            "found quat_xyzw, expected rpy: URDF 1.0 knows no quaternions");
    }
    mat3_from_rpy(rpy, place->R);
    return ERROR_NONE;
}

/* ---- elements of the robot ---- */

/* Checks that the root is <robot> and that no xacro elements are left to be expanded. */
static enum error_code urdf_check_root(const struct urdf_reader *r)
{
    const xmlNode *root = r->file->root;

    if (!xml_is(root, "robot")) {
        return import_error(r->error, r->file->name, xml_line(root),
                            "found <%.40s>, expected <robot> of a URDF or <mujoco> of an MJCF",
                            (const char *)root->name);
    }
    for (const xmlNode *node = xml_child(root, NULL); node; node = xml_next(node, NULL)) {
        const char *prefix = node->ns && node->ns->prefix ? (const char *)node->ns->prefix : "";
        const char *name = (const char *)node->name;

        if (strcmp(prefix, "xacro") == 0 &&
            (!strcmp(name, "macro") || !strcmp(name, "include") || !strcmp(name, "property") ||
             !strcmp(name, "arg") || !strcmp(name, "if") || !strcmp(name, "unless"))) {
            return import_error(r->error, r->file->name, xml_line(node),
                                "found <xacro:%s>, expected plain URDF: run `xacro FILE "
                                ">robot.urdf` (Debian package xacro) and import that",
                                name);
        }
    }
    return ERROR_NONE;
}

/* Counts the elements of that name at any depth. */
static size_t xml_count_deep(const xmlNode *node, const char *name)
{
    size_t count = 0;

    for (const xmlNode *child = xml_child(node, NULL); child; child = xml_next(child, NULL)) {
        count += xml_is(child, name) + xml_count_deep(child, name);
    }
    return count;
}

/* Counts the children of that name. */
static size_t xml_count(const xmlNode *node, const char *name)
{
    size_t count = 0;

    for (const xmlNode *child = xml_child(node, name); child; child = xml_next(child, name)) {
        count++;
    }
    return count;
}

/* Allocates the model for all that the file has, within bounds. */
static enum error_code urdf_make_room(const struct urdf_reader *r)
{
    const xmlNode *root = r->file->root;
    struct import_model *model = r->model;
    size_t links = xml_count(root, "link"), joints = xml_count(root, "joint");
    size_t shapes = xml_count_deep(root, "geometry"), sensors = xml_count_deep(root, "sensor");

    if (links == 0 || links > IMPORT_LINKS_MAX || joints > IMPORT_LINKS_MAX ||
        shapes > IMPORT_GEOMETRY_MAX || sensors > IMPORT_LINKS_MAX) {
        return import_error(r->error, r->file->name, xml_line(root),
                            "found %zu links, %zu joints, %zu shapes, %zu sensors, expected 1 to "
                            "%d links and as many joints and sensors, and at most %d shapes",
                            links, joints, shapes, sensors, IMPORT_LINKS_MAX, IMPORT_GEOMETRY_MAX);
    }
    model->link = arena_alloc(r->arena, links + 1, sizeof *model->link); /* the world too */
    model->joint = arena_alloc(r->arena, joints + 1, sizeof *model->joint);
    model->geometry = arena_alloc(r->arena, shapes + 1, sizeof *model->geometry);
    model->sensor = arena_alloc(r->arena, sensors + 1, sizeof *model->sensor);
    return model->link && model->joint && model->geometry && model->sensor ? ERROR_NONE
                                                                           : urdf_no_memory(r);
}

/* Reads the gear ratio of a <transmission>; notes and drops one without a gear or with several
 * joints. */
static enum error_code urdf_read_transmission(const struct urdf_reader *r, const xmlNode *node)
{
    const xmlNode *joint = xml_child(node, "joint"), *actuator = xml_child(node, "actuator");
    const xmlNode *gear = actuator ? xml_child(actuator, "mechanicalReduction") : NULL;
    const char *name = joint ? xml_attribute(joint, "name") : NULL;
    int at = name ? import_find_joint(r->model, name) : -1;
    double ratio;
    enum error_code code;

    gear = gear ? gear : xml_child(node, "mechanicalReduction");
    if (!gear || at < 0 || xml_next(joint, "joint")) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, xml_line(node),
                        "transmission \"%.63s\": no gear of one joint",
                        xml_attribute(node, "name") ? xml_attribute(node, "name") : "");
        return ERROR_NONE;
    }
    code = xml_parse_reals(r->file, gear, "text", xml_content(gear), 1, &ratio, r->error);
    if (!code && ratio > 0) {
        r->model->joint[at].gear = ratio;
    }
    return code;
}

/* Reads the sensors of a <gazebo> element; notes the rest of it as dropped. */
static enum error_code urdf_read_gazebo(const struct urdf_reader *r, const xmlNode *node)
{
    const char *reference = xml_attribute(node, "reference");
    char dropped[200] = "";
    size_t used = 0;

    for (const xmlNode *child = xml_child(node, NULL); child; child = xml_next(child, NULL)) {
        if (xml_is(child, "sensor")) {
            enum error_code code = urdf_read_sensor(r, child, reference);

            if (code) {
                return code;
            }
        } else if (used < sizeof dropped) {
            used += (size_t)snprintf(dropped + used, sizeof dropped - used, "%s%.40s",
                                     used ? ", " : "", (const char *)child->name);
        }
    }
    if (used) {
        import_note_add(r->notes, IMPORT_DROPPED, r->file->name, xml_line(node),
                        "gazebo tags of \"%.63s\": %s", reference ? reference : "the robot",
                        dropped);
    }
    return ERROR_NONE;
}

/* Checks whether an element is passed over without a note. */
static bool urdf_is_ignored(const xmlNode *node)
{
    for (size_t i = 0; ignored[i]; i++) {
        if (xml_is(node, ignored[i])) {
            return true;
        }
    }
    return false;
}

/* Reads links and joints first, then the elements that refer to them. */
static enum error_code urdf_read_elements(const struct urdf_reader *r)
{
    struct import_model *model = r->model;
    enum error_code code = ERROR_NONE;
    const xmlNode *node;

    for (node = xml_child(r->file->root, NULL); node && !code; node = xml_next(node, NULL)) {
        if (xml_is(node, "link")) {
            code = urdf_read_link(r, node, model->nlink);
            model->nlink++;
        } else if (xml_is(node, "joint")) {
            code = urdf_read_joint(r, node, &model->joint[model->njoint]);
            model->njoint++;
        }
    }
    for (node = xml_child(r->file->root, NULL); node && !code; node = xml_next(node, NULL)) {
        if (xml_is(node, "transmission")) {
            code = urdf_read_transmission(r, node);
        } else if (xml_is(node, "gazebo")) {
            code = urdf_read_gazebo(r, node);
        } else if (xml_is(node, "sensor")) {
            code = urdf_read_sensor(r, node, NULL);
        } else if (!xml_is(node, "link") && !xml_is(node, "joint") && !urdf_is_ignored(node)) {
            import_note_add(r->notes, IMPORT_DROPPED, r->file->name, xml_line(node),
                            "element <%.63s>: nothing here knows it", (const char *)node->name);
        }
    }
    return code;
}

/* ---- names ---- */

#define WORLD "world"

/* Finds the index of a link that a joint names; suggests no nearest name, as such files are written
 * by programs. */
static enum error_code urdf_resolve_link(const struct urdf_reader *r,
                                         const struct import_joint *joint, const char *name,
                                         int *link)
{
    *link = import_find_link(r->model, name);
    if (*link < 0) {
        return import_error(r->error, r->file->name, joint->line,
                            "found link \"%.63s\" of joint \"%.63s\", expected one of this file",
                            name, joint->name);
    }
    return ERROR_NONE;
}

/* Adds a link "world" when joints hang on one that is not in the file, as some tools write it. */
static void urdf_add_world(const struct urdf_reader *r)
{
    struct import_model *model = r->model;

    for (size_t i = 0; i < model->njoint && import_find_link(model, WORLD) < 0; i++) {
        if (!strcmp(model->joint[i].parent, WORLD)) {
            model->link[model->nlink++] = (struct import_link){
                .name = WORLD, .file = model->file, .line = model->joint[i].line};
            import_note_add(r->notes, IMPORT_ASSUMED, r->file->name, model->joint[i].line,
                            "link \"" WORLD "\" of joint \"%.63s\" is not in the file: it stands "
                            "still",
                            model->joint[i].name);
        }
    }
}

/* Resolves the names of parents, children and mimicked joints; refuses names that stand twice. */
static enum error_code urdf_resolve_names(const struct urdf_reader *r)
{
    struct import_model *model = r->model;

    urdf_add_world(r);

    for (size_t i = 0; i < model->nlink; i++) {
        int first = import_find_link(model, model->link[i].name);

        /* The first of a name is found: another one stands twice */
        if ((size_t)first != i) {
            return import_error(r->error, r->file->name, model->link[i].line,
                                "found link \"%.63s\" again, expected it once (line %d)",
                                model->link[i].name, model->link[first].line);
        }
    }
    for (size_t i = 0; i < model->njoint; i++) {
        struct import_joint *joint = &model->joint[i];
        int first = import_find_joint(model, joint->name);
        enum error_code code;

        if ((size_t)first != i) {
            return import_error(r->error, r->file->name, joint->line,
                                "found joint \"%.63s\" again, expected it once (line %d)",
                                joint->name, model->joint[first].line);
        }
        if ((code = urdf_resolve_link(r, joint, joint->parent, &joint->parent_link)) ||
            (code = urdf_resolve_link(r, joint, joint->child, &joint->child_link))) {
            return code;
        }
        if (joint->mimic && import_find_joint(model, joint->mimic) < 0) {
            return import_error(r->error, r->file->name, joint->mimic_line,
                                "found joint \"%.63s\" to be followed, expected one of this file",
                                joint->mimic);
        }
    }
    return ERROR_NONE;
}

enum error_code urdf_read(const struct xml_file *file, struct arena *arena,
                          struct import_model *model, struct import_notes *notes,
                          struct error *error)
{
    struct urdf_reader r = {file, arena, model, notes, error, NULL, 0};
    enum error_code code;

    *model = (struct import_model){.file = arena_strdup(arena, file->name)};
    if (!model->file) {
        return urdf_no_memory(&r);
    }
    if ((code = xml_check_elements(file, error)) || (code = urdf_check_root(&r)) ||
        (code = urdf_need_text(&r, file->root, "name", &model->name)) ||
        (code = urdf_make_room(&r)) || (code = urdf_read_materials(&r)) ||
        (code = urdf_read_elements(&r))) {
        return code;
    }
    return urdf_resolve_names(&r);
}
