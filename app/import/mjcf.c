/* SPDX-License-Identifier: Apache-2.0 */
/* Reads MJCF: settings, and the tree of bodies with their joints. */
#include "app/import/mjcf_private.h"

#include "base/array.h"
#include "base/vec3.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum error_code mjcf_refuse(const struct mjcf_reader *r, const xmlNode *node, const char *format,
                            ...)
{
    char text[600];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    return import_error(r->error, xml_name(r->file, node), xml_line(node), "%s", text);
}

const xmlNode *mjcf_next(const struct mjcf_reader *r, const char *section, const char *element,
                         const xmlNode *after)
{
    const xmlNode *in = after ? after->parent : xml_child(r->file->root, section), *node;

    node = after ? xml_next(after, element) : in ? xml_child(in, element) : NULL;
    /* Sections with one name count as one: continues in the next one */
    while (!node && in) {
        in = xml_next(in, section);
        node = in ? xml_child(in, element) : NULL;
    }
    return node;
}

enum error_code mjcf_no_memory(const struct mjcf_reader *r)
{
    return error_set(r->error, ERROR_MEMORY, "%.200s: no memory left for this robot",
                     r->file->name);
}

/* ---- settings ---- */

/* Reads the source of bodies' inertia; adds notes on settings that are ignored. */
static enum error_code mjcf_read_inertia_rules(struct mjcf_reader *r, const xmlNode *node)
{
    static const char *const unused[] = {"settotalmass", "boundmass", "boundinertia",
                                         "balanceinertia"};
    const char *from = xml_attribute(node, "inertiafromgeom");
    const char *exact = xml_attribute(node, "exactmeshinertia");

    if (from) {
        r->from_geom = !strcmp(from, "true")    ? MJCF_INERTIA_OF_GEOMS
                       : !strcmp(from, "false") ? MJCF_INERTIA_OF_BODY
                                                : MJCF_INERTIA_AUTO;
    }
    r->exact_meshes = exact ? !strcmp(exact, "true") : r->exact_meshes;
    for (size_t i = 0; i < ARRAY_COUNT(unused); i++) {
        const char *value = xml_attribute(node, unused[i]);

        if (value && strcmp(value, "false") != 0 && strcmp(value, "0") != 0) {
            import_note_add(r->notes, IMPORT_DROPPED, xml_name(r->file, node), xml_line(node),
                            "%s \"%.40s\": masses are the file's", unused[i], value);
        }
    }
    return xml_reals(r->file, node, "inertiagrouprange", 2, r->groups, NULL);
}

/* Reads one <compiler>; several ones add up. */
static enum error_code mjcf_read_compiler(struct mjcf_reader *r, const xmlNode *node)
{
    const char *angle = xml_attribute(node, "angle"), *seq = xml_attribute(node, "eulerseq");
    const char *limits = xml_attribute(node, "autolimits"),
               *folder = xml_attribute(node, "meshdir");
    const char *coordinate = xml_attribute(node, "coordinate");

    folder = folder ? folder : xml_attribute(node, "assetdir");
    if (coordinate && strcmp(coordinate, "local") != 0) {
        return mjcf_refuse(r, node,
                           "found coordinate \"%.20s\", expected \"local\": load the file in "
                           "MuJoCo and save it (mj_saveLastXML)",
                           coordinate);
    }
    if (seq && (strlen(seq) != 3 || strspn(seq, "xyzXYZ") != 3)) {
        return mjcf_refuse(r, node, "found eulerseq \"%.10s\", expected three of x y z X Y Z", seq);
    }
    if (angle) {
        r->angle = strcmp(angle, "radian") == 0 ? 1.0 : M_PI / 180.0;
    }
    r->autolimits = limits ? strcmp(limits, "false") != 0 : r->autolimits;
    r->meshdir = folder ? folder : r->meshdir;
    memcpy(r->eulerseq, seq ? seq : r->eulerseq, sizeof r->eulerseq);
    return mjcf_read_inertia_rules(r, node);
}

/* Checks whether an element generates bodies or loads them from elsewhere, which only MuJoCo can
 * expand. */
static bool mjcf_must_be_expanded(const xmlNode *node)
{
    static const char *const name[] = {"frame",     "replicate", "attach",
                                       "composite", "flexcomp",  NULL};

    for (size_t i = 0; name[i]; i++) {
        if (xml_is(node, name[i])) {
            return true;
        }
    }
    return false;
}

/* Refuses such an element and says how to expand it. */
static enum error_code mjcf_refuse_unexpanded(const struct mjcf_reader *r, const xmlNode *node)
{
    return mjcf_refuse(r, node,
                       "found <%.40s>, expected plain bodies: load the file in MuJoCo and save it "
                       "(mj_saveLastXML)",
                       (const char *)node->name);
}

/* Refuses constraints between bodies, which close loops. Constraints between joints, which make
 * one follow another, are left to mjcf_read_couplings. */
static enum error_code mjcf_check_equality(const struct mjcf_reader *r, const xmlNode *equality)
{
    for (const xmlNode *node = xml_child(equality, NULL); node; node = xml_next(node, NULL)) {
        const char *first = xml_attribute(node, "body1"), *second = xml_attribute(node, "body2");
        const char *name = xml_attribute(node, "name");

        if (xml_is(node, "connect") || xml_is(node, "weld")) {
            return mjcf_refuse(r, node,
                               "found <%s> %.63s between \"%.63s\" and \"%.63s\", which closes a "
                               "loop, expected a tree: loops are not imported; remove it and drive "
                               "the open tree",
                               (const char *)node->name, name ? name : "", first ? first : "a site",
                               second ? second : "the world");
        }
        if (!xml_is(node, "joint")) {
            import_note_add(r->notes, IMPORT_DROPPED, xml_name(r->file, node), xml_line(node),
                            "equality <%.40s>", (const char *)node->name);
        }
    }
    return ERROR_NONE;
}

/* Reads the top-level sections except bodies: reads compiler settings, refuses loops, adds notes
 * on unused sections. */
static enum error_code mjcf_read_settings(struct mjcf_reader *r)
{
    static const char *const silent[] = {"asset",   "worldbody", "actuator", "keyframe", "visual",
                                         "default", "statistic", "size",     "compiler", "equality",
                                         "sensor",  "custom",    NULL};
    enum error_code code = ERROR_NONE;

    for (const xmlNode *node = xml_child(r->file->root, NULL); node && !code;
         node = xml_next(node, NULL)) {
        bool known = false;

        for (size_t i = 0; silent[i] && !known; i++) {
            known = xml_is(node, silent[i]);
        }

        /* Sections that are read elsewhere are known; a section that nothing reads is noted */
        if (mjcf_must_be_expanded(node)) {
            code = mjcf_refuse_unexpanded(r, node);
        } else if (xml_is(node, "compiler")) {
            code = mjcf_read_compiler(r, node);
        } else if (xml_is(node, "equality")) {
            code = mjcf_check_equality(r, node);
        } else if (!known) {
            import_note_add(r->notes, IMPORT_DROPPED, xml_name(r->file, node), xml_line(node),
                            "section <%.40s>", (const char *)node->name);
        }
    }
    return code;
}

/* Finds the site of the first gyro or accelerometer, where the inertial sensor is; notes
 * sensors at other places as dropped. */
static void mjcf_find_imu(struct mjcf_reader *r)
{
    for (const xmlNode *node = mjcf_next(r, "sensor", NULL, NULL); node;
         node = mjcf_next(r, "sensor", NULL, node)) {
        const char *site = xml_attribute(node, "site"), *name = xml_attribute(node, "name");

        if (site && !r->imu_site && (xml_is(node, "gyro") || xml_is(node, "accelerometer"))) {
            r->imu_site = site;
            r->imu_name = name ? name : site;
        } else if (!(site && r->imu_site && !strcmp(site, r->imu_site))) {
            import_note_add(r->notes, IMPORT_DROPPED, xml_name(r->file, node), xml_line(node),
                            "sensor <%.40s> \"%.63s\"", (const char *)node->name, name ? name : "");
        }
    }
}

/* ---- joints ---- */

/* Makes the name NAME-NUMBER; NULL when there is no memory. */
static const char *mjcf_number_name(const struct mjcf_reader *r, const char *name, int number)
{
    char text[128];

    snprintf(text, sizeof text, "%.100s-%d", name, number);
    return arena_strdup(r->arena, text);
}

/* Makes a name for a body without one: by its line in the main file, by the number of links in
 * an included one. */
static const char *mjcf_name_body(const struct mjcf_reader *r, const xmlNode *node)
{
    return xml_name(r->file, node) == r->file->name
               ? mjcf_number_name(r, "body", xml_line(node))
               : mjcf_number_name(r, "included-body", (int)r->model->nlink);
}

const char *mjcf_file(const struct mjcf_reader *r, const xmlNode *node)
{
    const char *name = xml_name(r->file, node);

    return name == r->file->name ? r->model->file : name;
}

/* Adds a link and returns its index; NULL as name means that there is no memory. */
static enum error_code mjcf_add_link(const struct mjcf_reader *r, const char *name,
                                     const xmlNode *node, int *link)
{
    struct import_model *model = r->model;

    *link = (int)model->nlink;
    model->link[model->nlink++] =
        (struct import_link){.name = name, .file = mjcf_file(r, node), .line = xml_line(node)};
    return name ? ERROR_NONE : mjcf_no_memory(r);
}

/* Adds a joint between two existing links, at a place in the parent. */
static struct import_joint *mjcf_add_joint(const struct mjcf_reader *r, const char *name,
                                           const xmlNode *node, enum import_joint_type type,
                                           int parent, int child, const struct import_place *place)
{
    struct import_model *model = r->model;
    struct import_joint *joint = &model->joint[model->njoint++];

    *joint = (struct import_joint){.name = name,
                                   .file = mjcf_file(r, node),
                                   .line = xml_line(node),
                                   .type = type,
                                   .parent = model->link[parent].name,
                                   .child = model->link[child].name,
                                   .parent_link = parent,
                                   .child_link = child,
                                   .place = *place};
    return joint;
}

/* Reads limits, damping, friction, spring and rotor inertia of a joint. In the file's pose
 * MuJoCo's angle is ref and ours is 0, so limits and the spring's rest are shifted by ref. */
static enum error_code mjcf_read_joint_numbers(const struct mjcf_reader *r, const xmlNode *node,
                                               const char *childclass, struct import_joint *joint)
{
    const char *limited = mjcf_attribute(r, node, childclass, "limited");
    double unit = joint->type == IMPORT_PRISMATIC ? 1.0 : r->angle;
    double range[2] = {0, 0}, force[2] = {0, 0}, *ref = &r->ref[joint - r->model->joint];
    bool ranged;
    enum error_code code;

    if ((code = mjcf_reals(r, node, childclass, "range", 2, range, &ranged)) ||
        (code = mjcf_reals(r, node, childclass, "ref", 1, ref, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "damping", 1, &joint->damping, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "frictionloss", 1, &joint->friction, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "armature", 1, &joint->armature, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "stiffness", 1, &joint->stiffness, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "springref", 1, &joint->rest, NULL)) ||
        (code = mjcf_reals(r, node, childclass, "actuatorfrcrange", 2, force, NULL))) {
        return code;
    }
    /* Limits apply if the file says so, or with autolimits if a range is given */
    *ref *= unit;
    joint->effort = fmax(fabs(force[0]), fabs(force[1]));
    joint->has_limit =
        ranged && (limited && strcmp(limited, "auto") ? !strcmp(limited, "true")
                                                      : r->autolimits && range[0] < range[1]);
    joint->lower = joint->has_limit ? range[0] * unit - *ref : 0.0;
    joint->upper = joint->has_limit ? range[1] * unit - *ref : 0.0;
    if (joint->type == IMPORT_REVOLUTE && !joint->has_limit) {
        joint->type = IMPORT_CONTINUOUS;
    }
    joint->rest = joint->rest * unit - *ref;
    /* Adds notes on different meanings */
    if (*ref != 0.0) {
        import_note_add(r->notes, IMPORT_CHANGED, joint->file, joint->line,
                        "joint \"%.63s\" counts from the place in the file: MuJoCo's %g is 0",
                        joint->name, *ref);
    }
    return joint->damping < 0 || joint->friction < 0 || joint->armature < 0 || joint->stiffness < 0
               ? import_error(r->error, joint->file, joint->line,
                              "found damping %g, frictionloss %g, armature %g, stiffness %g, "
                              "expected 0 or more",
                              joint->damping, joint->friction, joint->armature, joint->stiffness)
               : ERROR_NONE;
}

/* Reads the type of a joint: free, hinge or slide; refuses ball joints. */
static enum error_code mjcf_read_joint_type(const struct mjcf_reader *r, const xmlNode *node,
                                            const char *childclass, enum import_joint_type *type)
{
    const char *word = mjcf_attribute(r, node, childclass, "type");

    if (xml_is(node, "freejoint") || (word && !strcmp(word, "free"))) {
        *type = IMPORT_FLOATING;
    } else if (!word || !strcmp(word, "hinge")) {
        *type = IMPORT_REVOLUTE;
    } else if (!strcmp(word, "slide")) {
        *type = IMPORT_PRISMATIC;
    } else {
        return mjcf_refuse(r, node,
                           "found a joint of type \"%.40s\", expected hinge, slide or free: write "
                           "three hinges for a ball",
                           word);
    }
    return ERROR_NONE;
}

/* A body during reading: the link to which its next joint is attached, and the pose of the body's
 * frame in that link. */
struct mjcf_body {
    const char *name, *childclass;
    const xmlNode *node;
    int link, joints, left; /* joints read, and joints left */
    struct import_place place;
};

/* Reads one joint of a body and adds a link of its own at the joint's anchor. */
static enum error_code mjcf_read_joint(struct mjcf_reader *r, const xmlNode *node,
                                       struct mjcf_body *body)
{
    struct import_place anchor, at, back;
    struct import_joint *joint;
    enum import_joint_type type;
    const char *name = xml_attribute(node, "name");
    double length;
    int link;
    enum error_code code = mjcf_read_joint_type(r, node, body->childclass, &type);

    import_place_identity(&anchor);
    if (code || (type != IMPORT_FLOATING &&
                 (code = mjcf_reals(r, node, body->childclass, "pos", 3, anchor.xyz, NULL)))) {
        return code;
    }

    /* Adds the link: the last joint's link has the body's name, earlier ones get a number */
    body->left--;
    name = name ? arena_strdup(r->arena, name) : mjcf_number_name(r, body->name, body->joints);
    if (!name ||
        (code = mjcf_add_link(
             r, body->left == 0 ? body->name : mjcf_number_name(r, body->name, body->joints), node,
             &link))) {
        return name ? code : mjcf_no_memory(r);
    }
    /* The joint is at its anchor in the previous link; qpos counts MuJoCo's coordinates */
    import_place_compose(&body->place, &anchor, &at);
    joint = mjcf_add_joint(r, name, node, type, body->link, link, &at);
    r->qpos[joint - r->model->joint] = r->qpos_count;
    r->qpos_count += type == IMPORT_FLOATING ? 7 : 1;
    /* Relative to the new link, the body's frame is displaced by minus the anchor */
    import_place_identity(&back);
    for (int m = 0; m < 3; m++) {
        back.xyz[m] = 0.0 - anchor.xyz[m]; /* no -0 */
    }
    body->place = back;
    body->link = link;
    body->joints++;
    if (type == IMPORT_FLOATING) {
        return ERROR_NONE;
    }
    /* A free joint is done; the others have an axis, z by default, and numbers */
    joint->axis[2] = 1.0;
    code = mjcf_reals(r, node, body->childclass, "axis", 3, joint->axis, NULL);
    length = vec3_norm(joint->axis);
    if (!code && !(length > 1e-6 && length < 1e6)) {
        return import_error(r->error, joint->file, joint->line,
                            "found an axis of length %g, expected a direction", length);
    }
    return code ? code : mjcf_read_joint_numbers(r, node, body->childclass, joint);
}

/* ---- bodies ---- */

/* Reads <inertial>: mass, center and one of two forms of inertia, into the link's frame. */
static enum error_code mjcf_read_inertial(const struct mjcf_reader *r, const xmlNode *node,
                                          struct import_link *link)
{
    static const int order[6] = {
        0, 3, 5, 1, 2, 4}; /* index in xx yy zz xy xz yz of the file's xx, yy, zz, xy, xz, yz */
    struct robot_inertia inertia = {0};
    struct import_place place;
    double full[6], diagonal[3];
    bool has_full, has_diagonal;
    enum error_code code;

    link->inertia_line = xml_line(node);
    if ((code = mjcf_read_place(r, node, NULL, &place)) ||
        (code = xml_need_real(r->file, node, "mass", &inertia.mass)) ||
        (code = xml_reals(r->file, node, "fullinertia", 6, full, &has_full)) ||
        (code = xml_reals(r->file, node, "diaginertia", 3, diagonal, &has_diagonal))) {
        return code;
    }
    if (has_full == has_diagonal || inertia.mass < 0 || inertia.mass > 1e6) {
        return mjcf_refuse(r, node,
                           "found mass %g and %s, expected a mass of 0 to 1e6 kg and one of "
                           "diaginertia and fullinertia",
                           inertia.mass, has_full ? "both inertias" : "no inertia or both");
    }
    for (int i = 0; i < 6; i++) {
        inertia.I[order[i]] = has_full ? full[i] : i < 3 ? diagonal[i] : 0.0;
    }
    link->has_inertia = inertia.mass > 0;
    if (link->has_inertia) {
        import_add_inertia(&link->inertia, &inertia, &place);
    }
    return ERROR_NONE;
}

/* Checks whether a body's inertia is computed from its geoms, by inertiafromgeom; a body with
 * <inertial> and no geom keeps its own. */
static bool mjcf_takes_geoms(const struct mjcf_reader *r, const xmlNode *body, bool inertial)
{
    switch (r->from_geom) {
    case MJCF_INERTIA_OF_BODY:
        return false;
    case MJCF_INERTIA_OF_GEOMS:
        return !inertial || xml_child(body, "geom");
    default:
        return !inertial;
    }
}

/* Reads inertia and geoms of a body into its link, and the site that is the inertial sensor. */
static enum error_code mjcf_read_matter(const struct mjcf_reader *r, const xmlNode *node,
                                        const char *childclass, int at)
{
    struct import_model *model = r->model;
    struct import_link *link = &model->link[at];
    const xmlNode *inertial = xml_child(node, "inertial");
    bool of_geoms = mjcf_takes_geoms(r, node, inertial != NULL);
    enum error_code code =
        inertial && !of_geoms ? mjcf_read_inertial(r, inertial, link) : ERROR_NONE;

    for (const xmlNode *child = xml_child(node, NULL); child && !code;
         child = xml_next(child, NULL)) {
        const char *name = xml_attribute(child, "name");

        /* Geoms add to the inertia only if the body has no inertia of its own */
        if (xml_is(child, "geom")) {
            code = mjcf_read_geom(r, child, childclass, at, of_geoms ? &link->inertia : NULL);
        } else if (xml_is(child, "site") && name && r->imu_site && !strcmp(name, r->imu_site) &&
                   model->nsensor == 0) {
            struct import_sensor *sensor = &model->sensor[model->nsensor++];

            *sensor = (struct import_sensor){
                .kind = IMPORT_IMU, .file = mjcf_file(r, child), .line = xml_line(child)};
            sensor->name = arena_strdup(r->arena, r->imu_name);
            sensor->link = link->name;
            code = sensor->name ? mjcf_read_place(r, child, childclass, &sensor->place)
                                : mjcf_no_memory(r);
        }
    }
    link->has_inertia = link->inertia.mass > 0;
    return code;
}

static enum error_code mjcf_read_body(struct mjcf_reader *r, const xmlNode *node, int parent,
                                      const char *childclass, int depth);

/* Reads the bodies in a body. */
static enum error_code mjcf_read_children(struct mjcf_reader *r, const xmlNode *node, int parent,
                                          const char *childclass, int depth)
{
    enum error_code code = ERROR_NONE;

    for (const xmlNode *child = xml_child(node, NULL); child && !code;
         child = xml_next(child, NULL)) {
        if (mjcf_must_be_expanded(child)) {
            code = mjcf_refuse_unexpanded(r, child);
        } else if (xml_is(child, "body")) {
            code = mjcf_read_body(r, child, parent, childclass, depth + 1);
        }
    }
    return code;
}

/* Adds a fixed link at the body's own frame, unless the link of its last joint is there already. */
static enum error_code mjcf_end_body(const struct mjcf_reader *r, struct mjcf_body *body)
{
    static const double here[3];
    const char *suffix = body->joints ? "-frame" : "";
    const char *name, *joint;
    char text[128];
    int link;

    if (body->joints && !memcmp(body->place.xyz, here, sizeof here)) {
        return ERROR_NONE;
    }
    snprintf(text, sizeof text, "%.100s%s", body->name, suffix);
    name = arena_strdup(r->arena, text);
    snprintf(text, sizeof text, "%.100s-fixed", body->name);
    joint = arena_strdup(r->arena, text);
    if (!name || !joint || mjcf_add_link(r, name, body->node, &link)) {
        return mjcf_no_memory(r);
    }
    mjcf_add_joint(r, joint, body->node, IMPORT_FIXED, body->link, link, &body->place);
    body->link = link;
    return ERROR_NONE;
}

/* Reads a body: the chain of links that its joints make, its inertia and geoms, then the bodies
 * in it. */
static enum error_code mjcf_read_body(struct mjcf_reader *r, const xmlNode *node, int parent,
                                      const char *childclass, int depth)
{
    const char *own = xml_attribute(node, "childclass"), *name = xml_attribute(node, "name");
    struct mjcf_body body = {.childclass = own ? own : childclass, .node = node, .link = parent};
    enum error_code code;

    if (depth > MJCF_DEPTH_MAX) {
        return mjcf_refuse(r, node, "found bodies more than %d deep, expected fewer",
                           MJCF_DEPTH_MAX);
    }
    body.name = name ? arena_strdup(r->arena, name) : mjcf_name_body(r, node);
    if (!body.name) {
        return mjcf_no_memory(r);
    }
    /* Counts joints first, because the last one's link has the body's name */
    code = mjcf_read_place(r, node, NULL, &body.place);
    for (const xmlNode *joint = xml_child(node, NULL); joint; joint = xml_next(joint, NULL)) {
        body.left += xml_is(joint, "joint") || xml_is(joint, "freejoint");
    }
    for (const xmlNode *joint = xml_child(node, NULL); joint && !code;
         joint = xml_next(joint, NULL)) {
        if (xml_is(joint, "joint") || xml_is(joint, "freejoint")) {
            code = mjcf_read_joint(r, joint, &body);
        }
    }
    if (code || (code = mjcf_end_body(r, &body)) ||
        (code = mjcf_read_matter(r, node, body.childclass, body.link))) {
        return code;
    }
    return mjcf_read_children(r, node, body.link, body.childclass, depth);
}

/* ---- the whole ---- */

/* Counts bodies, joints and geoms below a node, to make room for them. */
static void mjcf_count(const xmlNode *node, int depth, size_t *bodies, size_t *joints,
                       size_t *geoms)
{
    for (const xmlNode *child = xml_child(node, NULL); child; child = xml_next(child, NULL)) {
        *bodies += xml_is(child, "body");
        *joints += xml_is(child, "joint") || xml_is(child, "freejoint");
        *geoms += xml_is(child, "geom");
        if (xml_is(child, "body") && depth <= MJCF_DEPTH_MAX) {
            mjcf_count(child, depth + 1, bodies, joints, geoms);
        }
    }
}

/* Allocates the model for all bodies of the file; a link for the world, each body and each
 * joint. */
static enum error_code mjcf_make_room(struct mjcf_reader *r)
{
    struct import_model *model = r->model;
    const xmlNode *world = xml_child(r->file->root, "worldbody");
    size_t bodies = 0, joints = 0, geoms = 0, links;

    for (const xmlNode *next = world; next; next = xml_next(next, "worldbody")) {
        mjcf_count(next, 0, &bodies, &joints, &geoms);
    }

    /* A link for the world, each body, and each joint of a body with several */
    links = 1 + bodies + joints;
    if (bodies == 0 || links > IMPORT_LINKS_MAX || geoms > IMPORT_GEOMETRY_MAX) {
        return mjcf_refuse(r, world,
                           "found %zu bodies, %zu joints, %zu geoms, expected 1 to %d bodies with "
                           "their joints, and at most %d geoms",
                           bodies, joints, geoms, IMPORT_LINKS_MAX, IMPORT_GEOMETRY_MAX);
    }
    model->link = arena_alloc(r->arena, links, sizeof *model->link);
    model->joint = arena_alloc(r->arena, links, sizeof *model->joint);
    model->geometry = arena_alloc(r->arena, geoms + 1, sizeof *model->geometry);
    model->sensor = arena_alloc(r->arena, 1, sizeof *model->sensor);
    r->ref = arena_alloc(r->arena, links, sizeof *r->ref);
    r->qpos = arena_alloc(r->arena, links, sizeof *r->qpos);
    return model->link && model->joint && model->geometry && model->sensor && r->ref && r->qpos
               ? ERROR_NONE
               : mjcf_no_memory(r);
}

/* Refuses duplicate names of links and joints. */
static enum error_code mjcf_check_names(const struct mjcf_reader *r)
{
    const struct import_model *model = r->model;

    for (size_t i = 0; i < model->nlink; i++) {
        if ((size_t)import_find_link(model, model->link[i].name) != i) {
            return import_error(r->error, model->link[i].file, model->link[i].line,
                                "found body \"%.63s\" again, expected it once",
                                model->link[i].name);
        }
    }
    for (size_t i = 0; i < model->njoint; i++) {
        if ((size_t)import_find_joint(model, model->joint[i].name) != i) {
            return import_error(r->error, model->joint[i].file, model->joint[i].line,
                                "found joint \"%.63s\" again, expected it once",
                                model->joint[i].name);
        }
    }
    return ERROR_NONE;
}

/* Reads the bodies of all <worldbody> sections, which count as one. */
static enum error_code mjcf_read_worlds(struct mjcf_reader *r)
{
    const xmlNode *world = xml_child(r->file->root, "worldbody");
    int link;
    enum error_code code = mjcf_add_link(r, arena_strdup(r->arena, "world"), world, &link);

    for (; world && !code; world = xml_next(world, "worldbody")) {
        code = mjcf_read_children(r, world, link, NULL, 0);
    }
    return code;
}

enum error_code mjcf_read(const struct xml_file *file, const struct import_packages *packages,
                          struct arena *arena, struct import_model *model,
                          struct import_notes *notes, struct error *error)
{
    struct mjcf_reader r = {.file = file,
                            .packages = packages,
                            .arena = arena,
                            .model = model,
                            .notes = notes,
                            .error = error,
                            .angle = M_PI / 180.0,
                            .eulerseq = "xyz",
                            .autolimits = true,
                            .meshdir = "",
                            .groups = {0, 5}};
    const char *name = xml_attribute(file->root, "model");
    enum error_code code;

    *model = (struct import_model){.file = arena_strdup(arena, file->name)};
    model->name = arena_strdup(arena, name && *name ? name : "robot");
    if (!model->file || !model->name) {
        return mjcf_no_memory(&r);
    }
    /* Includes first, so that all that follows sees one document */
    if ((code = mjcf_expand_includes(&r)) || (code = xml_check_elements(file, error))) {
        return code;
    }
    if (!xml_child(file->root, "worldbody")) {
        return mjcf_refuse(&r, file->root, "found <mujoco> without <worldbody>, expected one");
    }
    /* Settings and classes are needed by the bodies, bodies by actuators, couplings and
     * keyframes */
    if ((code = mjcf_read_settings(&r)) || (code = mjcf_index(&r)) || (code = mjcf_make_room(&r))) {
        return code;
    }
    mjcf_find_imu(&r);
    if ((code = mjcf_read_worlds(&r)) || (code = mjcf_check_names(&r)) ||
        (code = mjcf_read_actuators(&r)) || (code = mjcf_read_couplings(&r))) {
        return code;
    }
    return mjcf_read_keys(&r);
}
