/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the scene of a rig: surfaces with their materials and meshes, and pairs that may touch. */
#include "base/array.h"
#include "contact/mesh/solid_store.h"
#include "model/spatial.h"
#include "rig/builder_private.h"

/* Returns the index of a plant's body among the contact bodies. Adds the body if it is new. */
static int scene_add_contact_body(struct rig_builder *b, int *bodies, int body)
{
    size_t i = 0;

    while (i < b->rig->contact.nbody && bodies[i] != body) {
        i++;
    }
    if (i == b->rig->contact.nbody) {
        bodies[b->rig->contact.nbody++] = body;
    }
    return (int)i;
}

/* Finds the place of a surface: a body, a named frame on a body, or the world. */
static enum error_code surface_find_place(struct rig_builder *b, const struct raw_surface *raw,
                                          struct rig_place *place)
{
    const struct robot_frame *frame;
    enum error_code code;
    int index;

    if (yaml_has(&raw->mark, "body") == yaml_has(&raw->mark, "frame")) {
        return yaml_error(b->error, &raw->mark, "found %s, expected one of \"body\" and \"frame\"",
                          yaml_has(&raw->mark, "body") ? "both a body and a frame" : "no body");
    }
    if (yaml_has(&raw->mark, "body")) {
        code = rig_find(b, yaml_place(&raw->mark, "body"), "body", raw->body,
                        RIG_NAMES(b->place, b->nplace), &index);
        if (code) {
            return code;
        }
        *place = b->place[index];

        /* Check that the robot file has a frame or a capsule on a body. Without one, the plant
         * does not compute the body's pose. */
        if (place->body >= 0 && (size_t)place->body < b->robot->nbody &&
            !b->robot->body[place->body].observed) {
            return yaml_error(b->error, (yaml_place(&raw->mark, "body")),
                              "found body \"%s\", on which the robot file has no frame or capsule, "
                              "expected one with either",
                              b->robot->body[place->body].name);
        }
        return ERROR_NONE;
    }
    code = rig_find(b, yaml_place(&raw->mark, "frame"), "frame", raw->frame,
                    RIG_NAMES(b->robot->frame, b->robot->nframe), &index);
    if (code) {
        return code;
    }
    frame = &b->robot->frame[index];
    place->body = frame->body;
    memcpy(place->position, frame->position, sizeof place->position);
    memcpy(place->rotation, frame->rotation, sizeof place->rotation);
    return ERROR_NONE;
}

/* Sets the body, position and rotation of a surface. */
static enum error_code surface_set_place(struct rig_builder *b, const struct raw_surface *raw,
                                         int *bodies, struct contact_surface *surface)
{
    struct rig_place place;
    double R[9], offset[3];
    enum error_code code = surface_find_place(b, raw, &place);

    if (code) {
        return code;
    }
    surface->body = place.body < 0 ? -1 : scene_add_contact_body(b, bodies, place.body);
    mat3_apply(place.rotation, raw->xyz_m, offset);
    for (int i = 0; i < 3; i++) {
        surface->position[i] = place.position[i] + offset[i];
    }
    mat3_from_rpy(raw->rpy_rad, R);
    mat3_mul(place.rotation, R, surface->rotation);
    return ERROR_NONE;
}

/* Sets the shape of a surface and reads its mesh. */
static enum error_code surface_set_shape(struct rig_builder *b, const struct raw_surface *raw,
                                         struct contact_surface *surface)
{
    static const char *const what[] = {"a half space", "a sphere", "a box", "a mesh", "a capsule"};
    const struct rig_key keys[] = {
        {"radius_m", 1 << CONTACT_SPHERE | 1 << CONTACT_CAPSULE,
         1 << CONTACT_SPHERE | 1 << CONTACT_CAPSULE},
        {"length_m", 1 << CONTACT_CAPSULE, 1 << CONTACT_CAPSULE},
        {"half_extents_m", 1 << CONTACT_BOX, 1 << CONTACT_BOX},
        {"cells", 1 << CONTACT_BOX, 0},
        {"mesh", 1 << CONTACT_MESH, 1 << CONTACT_MESH},
    };
    const char *path;
    enum error_code code = rig_check_keys(b, &raw->mark, what[raw->surface.shape],
                                          raw->surface.shape, keys, ARRAY_COUNT(keys));

    if (code || raw->surface.shape != CONTACT_MESH) {
        return code;
    }
    code = yaml_resolve_path(yaml_place(&raw->mark, "mesh"), raw->mesh, b->arena, &path, b->error);
    return code ? code
                : rig_place_file(b, yaml_place(&raw->mark, "mesh"), path,
                                 solid_store_read_obj(path, b->arena, &surface->mesh, b->error));
}

/* Finds a material by its name. */
static enum error_code scene_find_material(struct rig_builder *b, const struct yaml_mark *mark,
                                           const char *name, struct contact_material *material)
{
    const struct raw_scene *scene = &b->raw->scene;
    const struct raw_material *m;
    enum error_code code;
    int index;

    code =
        rig_find(b, mark, "material", name, RIG_NAMES(scene->material, scene->nmaterial), &index);
    if (code) {
        return code;
    }
    m = &scene->material[index];
    if (m->material.static_friction < m->material.dynamic_friction) {
        return yaml_error(b->error, &m->mark,
                          "found static_friction %g below dynamic_friction %g, expected at least "
                          "as much",
                          m->material.static_friction, m->material.dynamic_friction);
    }
    *material = m->material;
    return ERROR_NONE;
}

/* Appends the robot's capsules to the surfaces of the file. The array must have room for all. */
static enum error_code scene_add_capsules(struct rig_builder *b, struct contact_surface *surface,
                                          int *bodies)
{
    const struct raw_scene *scene = &b->raw->scene;
    const struct raw_robot_surfaces *raw = &scene->robot_surfaces;
    struct contact_config *contact = &b->rig->contact;
    struct contact_material material;
    enum error_code code;

    code = scene_find_material(b, yaml_place(&raw->mark, "material"), raw->material, &material);
    for (size_t c = 0; !code && c < b->robot->ncapsule; c++) {
        const struct robot_capsule *capsule = &b->robot->capsule[c];
        struct contact_surface *s = &surface[contact->nsurface];

        /* Check that no surface of the file has the same name as the capsule */
        for (size_t i = 0; i < contact->nsurface; i++) {
            if (!strcmp(surface[i].name, capsule->name)) {
                return yaml_error(b->error, yaml_place(&scene->surface[i].mark, "name"),
                                  "found surface \"%s\", expected another name: a capsule of the "
                                  "robot has it",
                                  capsule->name);
            }
        }
        /* Fix the surface to the body of the capsule */
        *s = (struct contact_surface){
            .name = capsule->name,
            .body = scene_add_contact_body(b, bodies, capsule->body),
            .shape = CONTACT_CAPSULE,
            .radius_m = capsule->radius,
            .length_m = capsule->length,
            .material = material,
        };
        memcpy(s->position, capsule->position, sizeof s->position);
        memcpy(s->rotation, capsule->rotation, sizeof s->rotation);
        contact->nsurface++;
    }
    return code;
}

/* Builds the surfaces of the file, then the surfaces of the robot. */
static enum error_code scene_build_surfaces(struct rig_builder *b)
{
    const struct raw_scene *scene = &b->raw->scene;
    struct contact_config *contact = &b->rig->contact;
    struct contact_surface *surface;
    size_t most = scene->nsurface + b->robot->ncapsule;
    int *bodies = arena_alloc(b->arena, most, sizeof *bodies);

    surface = arena_alloc(b->arena, most, sizeof *surface);
    if (!surface || !bodies) {
        return rig_no_memory(b);
    }
    contact->surface = surface;
    for (size_t i = 0; i < scene->nsurface; i++) {
        const struct raw_surface *raw = &scene->surface[i];
        enum error_code code;

        /* Check that the name is unique, then set place, shape and material */
        for (size_t k = 0; k < i; k++) {
            if (!strcmp(scene->surface[k].surface.name, raw->surface.name)) {
                return yaml_error(b->error, yaml_place(&raw->mark, "name"),
                                  "found surface \"%s\" again, expected a name of its own",
                                  raw->surface.name);
            }
        }
        surface[i] = raw->surface;
        code = rig_check_name(b, yaml_place(&raw->mark, "name"), "surface", raw->surface.name);
        code = code ? code : surface_set_place(b, raw, bodies, &surface[i]);
        code = code ? code : surface_set_shape(b, raw, &surface[i]);
        code = code ? code
                    : scene_find_material(b, yaml_place(&raw->mark, "material"), raw->material,
                                          &surface[i].material);
        if (code) {
            return code;
        }
    }
    contact->nsurface = scene->nsurface;
    b->rig->contact_body = bodies;
    return yaml_has(&scene->mark, "robot_surfaces") ? scene_add_capsules(b, surface, bodies)
                                                    : ERROR_NONE;
}

enum error_code rig_build_pair(struct rig_builder *b, const struct raw_pair *raw,
                               struct contact_pair *pair)
{
    const struct contact_config *contact = &b->rig->contact;
    const struct contact_surface *surface = contact->surface;
    int index[2];

    if (raw->nbetween != 2) {
        return yaml_error(b->error, yaml_place(&raw->mark, "between"),
                          "found %zu surfaces, expected two: [one, other]", raw->nbetween);
    }
    for (int k = 0; k < 2; k++) {
        enum error_code code = rig_find(b, &raw->between[k].mark, "surface", raw->between[k].name,
                                        RIG_NAMES(surface, contact->nsurface), &index[k]);

        if (code) {
            return code;
        }
    }
    if (surface[index[0]].body == surface[index[1]].body) {
        return yaml_error(b->error, yaml_place(&raw->mark, "between"),
                          "found two surfaces of one body, expected surfaces of two bodies");
    }
    *pair = (struct contact_pair){.a = index[0], .b = index[1]};
    return ERROR_NONE;
}

/* Sets the friction law. The default is sticking. For the engine simbody it is regularized, the
 * only law that this engine supports. */
static enum error_code scene_set_friction(struct rig_builder *b)
{
    const struct raw_scene *scene = &b->raw->scene;
    bool sticks = scene->engine != RIG_CONTACT_SIMBODY;

    if (yaml_has(&scene->mark, "friction")) {
        if (scene->contact.friction == CONTACT_FRICTION_STICKING && !sticks) {
            return yaml_error(b->error, yaml_place(&scene->mark, "friction"),
                              "found friction \"sticking\" with engine \"simbody\", expected "
                              "\"regularized\", the only one that it has");
        }
        sticks = scene->contact.friction == CONTACT_FRICTION_STICKING;
    }
    b->rig->contact.friction = sticks ? CONTACT_FRICTION_STICKING : CONTACT_FRICTION_REGULARIZED;
    return ERROR_NONE;
}

/* Builds the pairs that the file lists. A pair may be listed once, in any order of its surfaces. */
static enum error_code scene_build_pairs(struct rig_builder *b, struct contact_pair *pair)
{
    const struct raw_scene *scene = &b->raw->scene;

    for (size_t i = 0; i < scene->npair; i++) {
        enum error_code code = rig_build_pair(b, &scene->pair[i], &pair[i]);

        if (code) {
            return code;
        }
        for (size_t k = 0; k < i; k++) {
            if ((pair[k].a == pair[i].a && pair[k].b == pair[i].b) ||
                (pair[k].a == pair[i].b && pair[k].b == pair[i].a)) {
                return yaml_error(b->error, &scene->pair[i].mark,
                                  "found the pair of line %d again, expected it once",
                                  scene->pair[k].mark.line);
            }
        }
    }
    b->rig->contact.npair = b->rig->nlisted_pair = scene->npair;
    return ERROR_NONE;
}

/* Refuses a scene that no engine accepts. The error has the place in the file. */
static enum error_code scene_check(struct rig_builder *b)
{
    const struct raw_scene *scene = &b->raw->scene;
    struct error why;
    enum error_code code = contact_config_check(&b->rig->contact, &why);

    if (code == ERROR_INPUT) {
        return yaml_error(b->error, &scene->mark, "%s", why.text);
    }
    return code ? error_set(b->error, code, "%s: %s", b->rig->file, why.text) : ERROR_NONE;
}

enum error_code rig_build_scene(struct rig_builder *b)
{
    const struct raw_scene *scene = &b->raw->scene;
    struct contact_config *contact = &b->rig->contact;
    size_t n = scene->nsurface + b->robot->ncapsule;
    struct contact_pair *pair;
    enum error_code code;

    *contact = scene->contact;
    b->rig->contact_engine = scene->engine;
    if (yaml_has(&scene->mark, "robot_surfaces") && b->rig->contact_engine == RIG_CONTACT_SIMBODY) {
        return yaml_error(b->error, &scene->robot_surfaces.mark,
                          "found robot_surfaces with engine simbody, which has no capsules; "
                          "expected engine native");
    }

    /* Build the surfaces, then the pairs of the file, then the pairs of the robot */
    pair = arena_alloc(b->arena, scene->npair + n * n / 2, sizeof *pair);
    code = pair ? scene_build_surfaces(b) : rig_no_memory(b);
    code = code ? code : scene_build_pairs(b, pair);
    contact->pair = pair;
    code = code ? code : scene_set_friction(b);
    code = code ? code : scene_check(b);
    if (!code && yaml_has(&scene->mark, "robot_surfaces")) {
        code = rig_add_robot_pairs(b, pair, &contact->npair);
        code = code ? code : scene_check(b);
    }

    /* Without an engine, still check the scene, then empty it */
    if (!code && b->rig->contact_engine == RIG_CONTACT_NONE) {
        *contact = (struct contact_config){0};
        b->rig->nlisted_pair = b->rig->nleft = 0;
    }
    return code;
}
