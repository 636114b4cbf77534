/* SPDX-License-Identifier: Apache-2.0 */
/* Reads MJCF: settings, and the tree of bodies with their joints. */
#include "app/import/readers_private.h"

#include "base/array.h"
#include "base/vec3.h"

#include <math.h>
#include <string.h>

const xmlNode *mjcf_next(const struct import_reader *r, const char *section, const char *element,
                         const xmlNode *after)
{
    const xmlNode *in = after ? after->parent : xml_child(r->file->root, section), *node;

    node = after ? xml_next(after, element) : in ? xml_child(in, element) : NULL;
    /* All sections with one name count as one, so continue in the next one */
    while (!node && in) {
        in = xml_next(in, section);
        node = in ? xml_child(in, element) : NULL;
    }
    return node;
}

/* ---- settings ---- */

/* Reads one <compiler> element; several ones add up. */
static void mjcf_read_compiler(struct import_reader *r, const xmlNode *node)
{
    const char *angle = xml_attribute(node, "angle"), *seq = xml_attribute(node, "eulerseq");
    const char *limits = xml_attribute(node, "autolimits");
    const char *folder = xml_attribute(node, "meshdir");
    const char *coordinate = xml_attribute(node, "coordinate");
    const char *from = xml_attribute(node, "inertiafromgeom");
    const char *exact = xml_attribute(node, "exactmeshinertia");

    folder = folder ? folder : xml_attribute(node, "assetdir");
    if (coordinate && strcmp(coordinate, "local") != 0) {
        xml_refuse(r->file, node,
                   "found coordinate \"%.20s\", expected \"local\": load the file in MuJoCo and "
                   "save it (mj_saveLastXML)",
                   coordinate);
    }
    if (seq && (strlen(seq) != 3 || strspn(seq, "xyzXYZ") != 3)) {
        xml_refuse(r->file, node, "found eulerseq \"%.10s\", expected three of x y z X Y Z", seq);
        return;
    }
    r->angle = !angle ? r->angle : !strcmp(angle, "radian") ? 1.0 : M_PI / 180.0;
    r->autolimits = limits ? strcmp(limits, "false") != 0 : r->autolimits;
    r->meshdir = folder ? folder : r->meshdir;
    memcpy(r->eulerseq, seq ? seq : r->eulerseq, sizeof r->eulerseq);

    /* Read the source of masses and inertias */
    if (from) {
        r->from_geom = !strcmp(from, "true")    ? MJCF_INERTIA_OF_GEOMS
                       : !strcmp(from, "false") ? MJCF_INERTIA_OF_BODY
                                                : MJCF_INERTIA_AUTO;
    }
    r->exact_meshes = exact ? !strcmp(exact, "true") : r->exact_meshes;
    xml_reals(r->file, node, "inertiagrouprange", 2, r->groups);
    xml_reals(r->file, node, "settotalmass", 1, &r->total_mass);
}

/* Refuses an element that generates or loads bodies, which only MuJoCo can expand. Returns whether
 * it is one. */
static bool mjcf_refuse_unexpanded(const struct import_reader *r, const xmlNode *node)
{
    static const char *const name[] = {"replicate", "attach", "composite", "flexcomp", NULL};
    const bool unexpanded = reader_is_one_of(node, name);

    if (unexpanded) {
        xml_refuse(r->file, node,
                   "found <%.40s>, expected plain bodies: load the file in MuJoCo and save it "
                   "(mj_saveLastXML)",
                   (const char *)node->name);
    }
    return unexpanded;
}

/* Refuses constraints between bodies, because they close loops. mjcf_read_couplings handles
 * constraints between joints, which make one joint follow another. */
static void mjcf_check_equality(const struct import_reader *r, const xmlNode *equality)
{
    for (const xmlNode *node = xml_child(equality, NULL); node; node = xml_next(node, NULL)) {
        const char *site = xml_attribute(node, "site1");
        const char *first = site ? site : reader_text(node, "body1");
        const char *second = xml_attribute(node, site ? "site2" : "body2");

        if (!xml_is(node, "joint") && !mjcf_is_active(r, node)) {
            reader_note(r, IMPORT_DROPPED, node, "equality <%.40s>: it is not active",
                        (const char *)node->name);
        } else if (xml_is(node, "connect") || xml_is(node, "weld")) {
            xml_refuse(r->file, node,
                       "found <%s> %.63s between \"%.63s\" and \"%.63s\", which closes a loop, "
                       "expected a tree: loops are not imported; remove it and drive the open tree",
                       (const char *)node->name, reader_text(node, "name"), first,
                       second ? second : "the world");
        }
    }
}

/* Finds the site of the first gyro or accelerometer, which becomes the inertial sensor. Adds notes
 * that sensors at other places are dropped. */
static void mjcf_find_imu(struct import_reader *r)
{
    for (const xmlNode *node = mjcf_next(r, "sensor", NULL, NULL); node;
         node = mjcf_next(r, "sensor", NULL, node)) {
        const char *site = xml_attribute(node, "site"), *name = xml_attribute(node, "name");

        if (!xml_is(node, "gyro") && !xml_is(node, "accelerometer")) {
            continue; /* the report lists it by its kind */
        }
        if (site && !r->imu_site) {
            r->imu_site = site;
            r->imu_name = name ? name : site;
        } else if (!site || strcmp(site, r->imu_site) != 0) {
            reader_note(r, IMPORT_DROPPED, node, "sensor <%.40s> \"%.63s\"",
                        (const char *)node->name, name ? name : "");
        }
    }
}

/* ---- parts of bodies ---- */

/* Iterates over the parts of a body, through its frames. Pass NULL to start. Returns NULL at the
 * end. */
static const xmlNode *mjcf_next_part(const xmlNode *body, const xmlNode *after)
{
    const xmlNode *next = NULL;

    if (!after || xml_is(after, "frame")) {
        next = xml_child(after ? after : body, NULL);
    }
    for (; after && after != body && !next; after = after->parent) {
        next = xml_next(after, NULL);
    }
    return next;
}

/* ---- joints ---- */

/* Adds a link and returns its index. */
static int mjcf_add_link(const struct import_reader *r, const char *name, const xmlNode *node)
{
    r->model->link[r->model->nlink] =
        (struct import_link){.name = name, .file = xml_name(r->file, node), .line = xml_line(node)};
    return (int)r->model->nlink++;
}

/* Adds a joint between two existing links, at a place in the parent. */
static struct import_joint *mjcf_add_joint(const struct import_reader *r, const char *name,
                                           const xmlNode *node, enum import_joint_type type,
                                           int parent, int child, const struct import_place *place)
{
    struct import_model *model = r->model;
    struct import_joint *joint = &model->joint[model->njoint++];

    *joint = (struct import_joint){.name = name,
                                   .file = xml_name(r->file, node),
                                   .line = xml_line(node),
                                   .type = type,
                                   .parent = model->link[parent].name,
                                   .child = model->link[child].name,
                                   .parent_link = parent,
                                   .child_link = child,
                                   .place = *place};
    return joint;
}

/* Reads axis, limits, damping, friction, spring and rotor inertia of a joint. In the file's pose
 * the joint has the angle ref in MuJoCo, but 0 here. So ref is subtracted from the limits and from
 * the spring's rest. */
static void mjcf_read_joint_numbers(const struct import_reader *r, const xmlNode *node,
                                    struct import_joint *joint)
{
    const char *limited = mjcf_attribute(r, node, "limited");
    const double unit = joint->type == IMPORT_PRISMATIC ? 1.0 : r->angle;
    const size_t own = (size_t)(joint - r->model->joint);
    double range[2] = {0, 0}, *ref = &r->ref[own], length, axis[3];
    struct import_place frame;
    bool ranged;
    const struct {
        const char *name;
        size_t count;
        double *value;
    } numbers[] = {{"axis", 3, joint->axis},          {"ref", 1, ref},
                   {"damping", 1, &joint->damping},   {"frictionloss", 1, &joint->friction},
                   {"armature", 1, &joint->armature}, {"stiffness", 1, &joint->stiffness},
                   {"springref", 1, &joint->rest}};

    joint->axis[2] = 1.0;
    for (size_t i = 0; i < ARRAY_COUNT(numbers); i++) {
        mjcf_reals(r, node, numbers[i].name, numbers[i].count, numbers[i].value);
    }
    ranged = mjcf_reals(r, node, "range", 2, range);
    length = vec3_norm(joint->axis);
    if (!(length > 1e-6 && length < 1e6)) {
        xml_refuse(r->file, node, "found an axis of length %g, expected a direction", length);
    }
    if (mjcf_read_frame(r, node, &frame)) {
        mat3_apply(frame.R, joint->axis, axis);
        memcpy(joint->axis, axis, sizeof axis);
    }

    /* Limits apply if the file says so or, with autolimits, if it gives a range */
    *ref *= unit;
    r->force[own][0] = -(double)INFINITY;
    r->force[own][1] = (double)INFINITY;
    if (mjcf_clamp(r, node, "actuatorfrc", 1.0, r->force[own])) {
        joint->effort = fmax(fabs(r->force[own][0]), fabs(r->force[own][1]));
    }
    joint->has_limit =
        ranged && (limited && strcmp(limited, "auto") ? !strcmp(limited, "true")
                                                      : r->autolimits && range[0] < range[1]);
    joint->lower = joint->has_limit ? range[0] * unit - *ref : 0.0;
    joint->upper = joint->has_limit ? range[1] * unit - *ref : 0.0;
    reader_free_limits(r, node, joint);
    joint->rest = joint->rest * unit - *ref;

    /* Add notes where the meaning differs */
    if (*ref != 0.0) {
        reader_note(r, IMPORT_CHANGED, node,
                    "joint \"%.63s\" counts from the place in the file: MuJoCo's %g is 0",
                    joint->name, *ref);
    }
    if (joint->damping < 0 || joint->friction < 0 || joint->armature < 0 || joint->stiffness < 0) {
        xml_refuse(r->file, node,
                   "found damping %g, frictionloss %g, armature %g, stiffness %g, expected 0 or "
                   "more",
                   joint->damping, joint->friction, joint->armature, joint->stiffness);
    }
}

/* Reads the type of a joint: free, hinge or slide; refuses ball joints. */
static enum import_joint_type mjcf_read_joint_type(const struct import_reader *r,
                                                   const xmlNode *node)
{
    const char *word = mjcf_attribute(r, node, "type");

    if (xml_is(node, "freejoint") || (word && !strcmp(word, "free"))) {
        return IMPORT_FLOATING;
    }
    if (word && !strcmp(word, "slide")) {
        return IMPORT_PRISMATIC;
    }
    if (word && strcmp(word, "hinge") != 0) {
        xml_refuse(r->file, node,
                   "found a joint of type \"%.40s\", expected hinge, slide or free: write three "
                   "hinges for a ball",
                   word);
    }
    return IMPORT_REVOLUTE;
}

/* A body during reading: the link for its next joint, and the pose of the body's frame in that
 * link. */
struct mjcf_body {
    const char *name;
    const xmlNode *node;
    int link, joints, left; /* number of joints read, and number left */
    struct import_place place;
};

/* Reads one joint of a body, and adds a link at the joint's anchor. */
static void mjcf_read_joint(struct import_reader *r, const xmlNode *node, struct mjcf_body *body)
{
    const enum import_joint_type type = mjcf_read_joint_type(r, node);
    const char *name = xml_attribute(node, "name");
    struct import_place anchor, frame, at;
    struct import_joint *joint;
    int link;

    import_place_identity(&anchor);
    if (type != IMPORT_FLOATING) {
        mjcf_reals(r, node, "pos", 3, anchor.xyz);
        if (mjcf_read_frame(r, node, &frame)) {
            import_place_compose(&frame, &anchor, &at);
            memcpy(anchor.xyz, at.xyz, sizeof anchor.xyz);
        }
    }

    /* Add the link: the last joint's link has the name of the body, earlier ones have a number */
    body->left--;
    name = name ? reader_copy(r, name) : reader_format(r, "%.100s-%d", body->name, body->joints);
    link = mjcf_add_link(
        r, body->left == 0 ? body->name : reader_format(r, "%.100s-%d", body->name, body->joints),
        node);

    /* The joint is at its anchor in the previous link; qpos is the index in MuJoCo's coordinates */
    import_place_compose(&body->place, &anchor, &at);
    joint = mjcf_add_joint(r, name, node, type, body->link, link, &at);
    r->qpos[joint - r->model->joint] = r->qpos_count;
    r->qpos_count += type == IMPORT_FLOATING ? 7 : 1;

    /* In the new link, the body's frame is displaced by minus the anchor */
    import_place_identity(&body->place);
    vec3_sub(body->place.xyz, anchor.xyz, body->place.xyz);
    body->link = link;
    body->joints++;
    if (type != IMPORT_FLOATING) {
        mjcf_read_joint_numbers(r, node, joint);
    }
}

/* ---- bodies ---- */

/* Reads <inertial> into the link's frame: mass, center, and inertia in one of two forms. */
static void mjcf_read_inertial(const struct import_reader *r, const xmlNode *node,
                               struct import_link *link)
{
    /* From the file's xx, yy, zz, xy, xz, yz to the indices in xx, xy, xz, yy, yz, zz */
    static const int order[6] = {0, 3, 5, 1, 2, 4};
    struct robot_inertia inertia = {.mass = xml_need_real(r->file, node, "mass")};
    struct import_place place;
    double value[6] = {0};
    const bool full = xml_reals(r->file, node, "fullinertia", 6, value);
    const bool diagonal = !full && xml_reals(r->file, node, "diaginertia", 3, value);

    link->inertia_line = xml_line(node);
    mjcf_read_place(r, node, &place);
    if ((full ? xml_attribute(node, "diaginertia") != NULL : !diagonal) || inertia.mass < 0 ||
        inertia.mass > 1e6) {
        xml_refuse(r->file, node,
                   "found mass %g and %s, expected a mass of 0 to 1e6 kg and one of diaginertia "
                   "and fullinertia",
                   inertia.mass, full ? "both inertias" : "no inertia or both");
    }
    for (int i = 0; i < 6; i++) {
        inertia.I[order[i]] = value[i];
    }
    if (inertia.mass > 0) {
        import_add_inertia(&link->inertia, &inertia, &place);
    }
}

/* Reads inertia and geoms of a body into its link, and the site of the inertial sensor. */
static void mjcf_read_matter(const struct import_reader *r, const xmlNode *node, int own)
{
    struct import_model *model = r->model;
    struct import_link *link = &model->link[own];
    const xmlNode *inertial = NULL, *geom = NULL;
    /* inertiafromgeom applies, but a body with <inertial> and without geoms keeps its own
     * inertia */
    bool of_geoms;

    for (const xmlNode *at = mjcf_next_part(node, NULL); at; at = mjcf_next_part(node, at)) {
        inertial = xml_is(at, "inertial") ? at : inertial;
        geom = xml_is(at, "geom") ? at : geom;
    }
    of_geoms = r->from_geom == MJCF_INERTIA_OF_GEOMS
                   ? !inertial || geom
                   : r->from_geom == MJCF_INERTIA_AUTO && !inertial;
    if (inertial && !of_geoms) {
        mjcf_read_inertial(r, inertial, link);
    }
    for (const xmlNode *child = mjcf_next_part(node, NULL); child;
         child = mjcf_next_part(node, child)) {
        if (xml_is(child, "geom")) {
            mjcf_read_geom(r, child, own, of_geoms ? &link->inertia : NULL);
        } else if (xml_is(child, "site") && r->imu_site &&
                   !strcmp(reader_text(child, "name"), r->imu_site) && model->nsensor == 0) {
            struct import_sensor *sensor = &model->sensor[model->nsensor++];

            *sensor = (struct import_sensor){.kind = IMPORT_IMU,
                                             .name = reader_copy(r, r->imu_name),
                                             .file = xml_name(r->file, child),
                                             .line = xml_line(child),
                                             .link = link->name};
            mjcf_read_place(r, child, &sensor->place);
        } else if (xml_is(child, "site")) {
            reader_skip(r, child, NULL);
        }
    }
    link->has_inertia = link->inertia.mass > 0;
}

static void mjcf_read_body(struct import_reader *r, const xmlNode *node, int parent, int depth);

/* Reads the bodies in a body. */
static void mjcf_read_children(struct import_reader *r, const xmlNode *node, int parent, int depth)
{
    for (const xmlNode *child = mjcf_next_part(node, NULL); child;
         child = mjcf_next_part(node, child)) {
        if (!mjcf_refuse_unexpanded(r, child) && xml_is(child, "body")) {
            mjcf_read_body(r, child, parent, depth + 1);
        } else if (depth == 0 && (xml_is(child, "geom") || xml_is(child, "site"))) {
            reader_skip(r, child, NULL); /* of the world */
        }
    }
}

/* Adds a fixed link at the body's frame, unless its last joint's link is there already. */
static void mjcf_end_body(const struct import_reader *r, struct mjcf_body *body)
{
    static const double here[3];
    int link;

    if (body->joints && !memcmp(body->place.xyz, here, sizeof here)) {
        return;
    }
    link = mjcf_add_link(r, reader_format(r, "%.100s%s", body->name, body->joints ? "-frame" : ""),
                         body->node);
    mjcf_add_joint(r, reader_format(r, "%.100s-fixed", body->name), body->node, IMPORT_FIXED,
                   body->link, link, &body->place);
    body->link = link;
}

/* Reads a body: the chain of links from its joints, its inertia and geoms, then its child
 * bodies. */
static void mjcf_read_body(struct import_reader *r, const xmlNode *node, int parent, int depth)
{
    static const char *const joints[] = {"joint", "freejoint", NULL};
    const char *name = xml_attribute(node, "name");
    struct mjcf_body body = {.node = node, .link = parent};

    if (depth > MJCF_DEPTH_MAX) {
        xml_refuse(r->file, node, "found bodies more than %d deep, expected fewer", MJCF_DEPTH_MAX);
        return;
    }

    /* Name an unnamed body by its line or, in an included file, by the number of links */
    if (name) {
        body.name = reader_copy(r, name);
    } else if (xml_name(r->file, node) == r->file->name) {
        body.name = reader_format(r, "body-%d", xml_line(node));
    } else {
        body.name = reader_format(r, "included-body-%zu", r->model->nlink);
    }
    mjcf_read_place(r, node, &body.place);

    /* Counts joints first, because the last one's link has the body's name */
    for (const xmlNode *joint = mjcf_next_part(node, NULL); joint;
         joint = mjcf_next_part(node, joint)) {
        body.left += reader_is_one_of(joint, joints);
    }
    for (const xmlNode *joint = mjcf_next_part(node, NULL); joint;
         joint = mjcf_next_part(node, joint)) {
        if (reader_is_one_of(joint, joints)) {
            mjcf_read_joint(r, joint, &body);
        }
    }
    mjcf_end_body(r, &body);
    mjcf_read_matter(r, node, body.link);
    mjcf_read_children(r, node, body.link, depth);
}

/* ---- the whole ---- */

/* Scales the masses and inertias of all bodies so that their total mass is settotalmass. */
static void mjcf_set_total_mass(const struct import_reader *r)
{
    double mass = 0.0;

    for (size_t i = 0; i < r->model->nlink; i++) {
        mass += r->model->link[i].inertia.mass;
    }
    for (size_t i = 0; i < r->model->nlink && r->total_mass > 0.0 && mass > 0.0; i++) {
        struct robot_inertia *inertia = &r->model->link[i].inertia;

        inertia->mass *= r->total_mass / mass;
        for (int k = 0; k < 6; k++) {
            inertia->I[k] *= r->total_mass / mass;
        }
    }
}

/* Allocates the model for all bodies of the file: a link for the world, each body and each
 * joint. */
static void mjcf_make_room(struct import_reader *r)
{
    const xmlNode *world = xml_child(r->file->root, "worldbody");
    size_t bodies = 0, joints = 0, geoms = 0, links;

    for (const xmlNode *next = world; next; next = xml_next(next, "worldbody")) {
        bodies += xml_count(next, "body");
        joints += xml_count(next, "joint") + xml_count(next, "freejoint");
        geoms += xml_count(next, "geom");
    }
    links = 1 + bodies + joints;
    if (bodies == 0 || links > IMPORT_LINKS_MAX || geoms > IMPORT_GEOMETRY_MAX) {
        xml_refuse(r->file, world,
                   "found %zu bodies, %zu joints, %zu geoms, expected 1 to %d bodies with their "
                   "joints, and at most %d geoms",
                   bodies, joints, geoms, IMPORT_LINKS_MAX, IMPORT_GEOMETRY_MAX);
    }
    reader_make_room(r, links, links, geoms, 1);
    r->ref = reader_alloc(r, links, sizeof *r->ref);
    r->force = reader_alloc(r, links, sizeof *r->force);
    r->qpos = reader_alloc(r, links, sizeof *r->qpos);
}

enum error_code mjcf_read(const struct xml_file *file, const struct import_packages *packages,
                          struct arena *arena, struct import_model *model,
                          struct import_notes *notes, struct error *error)
{
    struct import_reader r = {.file = file,
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
    const char *name = reader_text(file->root, "model");
    const xmlNode *world;

    *model = (struct import_model){.file = reader_copy(&r, file->name),
                                   .name = reader_copy(&r, *name ? name : "robot")};
    r.unread = reader_alloc(&r, 1, sizeof *r.unread);
    if (!r.unread) {
        return error->code;
    }

    /* Expand includes first, so that the other steps read one document */
    mjcf_expand_includes(&r);
    xml_check_elements(file);
    world = xml_child(file->root, "worldbody");
    if (!world) {
        xml_refuse(file, file->root, "found <mujoco> without <worldbody>, expected one");
        return error->code;
    }

    /* Bodies need settings and classes; actuators, couplings and keyframes need bodies */
    mjcf_index(&r);

    /* Read the compiler settings, and refuse loops */
    for (const xmlNode *node = xml_child(r.file->root, NULL); node; node = xml_next(node, NULL)) {
        if (xml_is(node, "compiler")) {
            mjcf_read_compiler(&r, node);
        } else if (xml_is(node, "equality")) {
            mjcf_check_equality(&r, node);
        } else {
            mjcf_refuse_unexpanded(&r, node);
        }
    }

    mjcf_make_room(&r);
    mjcf_find_imu(&r);
    if (error->code) {
        return error->code;
    }
    mjcf_add_link(&r, "world", world);
    for (; world; world = xml_next(world, "worldbody")) {
        mjcf_read_children(&r, world, 0, 0);
    }
    reader_check_names(&r, "body");
    mjcf_set_total_mass(&r);
    mjcf_read_actuators(&r);
    mjcf_read_couplings(&r);
    mjcf_read_keys(&r);
    reader_report(&r, mjcf_read_attributes);
    return error->code;
}
