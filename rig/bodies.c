/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the free and static bodies of a rig's scene, and the list of places for surfaces. */
#include "base/array.h"
#include "model/spatial.h"
#include "rig/builder_private.h"

enum { FREE, STATIC };

/* Checks that a body has the keys of its kind. A free body needs exactly one form of inertia. */
static enum error_code scene_check_body_keys(struct rig_builder *b, const struct raw_body *raw)
{
    const struct rig_key keys[] = {
        {"mass_kg", 1 << FREE, 1 << FREE}, {"com_m", 1 << FREE, 0},
        {"inertia_kg_m2", 1 << FREE, 0},   {"box_m", 1 << FREE, 0},
        {"velocity_m_s", 1 << FREE, 0},    {"rate_rad_s", 1 << FREE, 0},
    };
    const bool inertia = yaml_has(&raw->mark, "inertia_kg_m2");
    enum error_code code =
        rig_check_keys(b, &raw->mark, raw->is_static ? "a static body" : "a free body",
                       raw->is_static ? STATIC : FREE, keys, ARRAY_COUNT(keys));

    if (!code && !raw->is_static && inertia == yaml_has(&raw->mark, "box_m")) {
        code = yaml_error(b->error, &raw->mark,
                          "found %s of the keys \"inertia_kg_m2\" and \"box_m\", expected exactly "
                          "one",
                          inertia ? "both" : "neither");
    }
    return code;
}

/* Adds a place at the origin of a body or of the world. */
static struct rig_place *scene_add_place(struct rig_builder *b, const char *name, int body)
{
    struct rig_place *place = &b->place[b->nplace++];

    place->name = name;
    place->body = body;
    mat3_identity(place->rotation);
    return place;
}

/* Builds a body and adds it to the places for surfaces. */
static enum error_code scene_build_body(struct rig_builder *b, const struct raw_body *raw,
                                        struct plant_free_body *free_body)
{
    /* Check the name of a body. It must be unique among all bodies that can have surfaces. */
    enum error_code code =
        rig_check_name(b, yaml_place(&raw->mark, "name"), "body", raw->body.name);

    for (size_t i = 0; !code && i < b->nplace; i++) {
        if (!strcmp(b->place[i].name, raw->body.name)) {
            code = yaml_error(b->error, yaml_place(&raw->mark, "name"),
                              "found body \"%s\"%s, expected a name of its own", raw->body.name,
                              i == 0                 ? ", the name of the static surroundings"
                              : i <= b->robot->nbody ? ", which the robot has too"
                                                     : " again");
        }
    }

    code = code ? code : scene_check_body_keys(b, raw);
    if (code) {
        return code;
    }
    if (raw->is_static) {
        struct rig_place *place = scene_add_place(b, raw->body.name, -1);

        memcpy(place->position, raw->body.position, sizeof place->position);
        mat3_from_rpy(raw->rpy_rad, place->rotation);
        return ERROR_NONE;
    }
    scene_add_place(b, raw->body.name, (int)(b->robot->nbody + b->rig->nfree));

    /* Build a free body with its pose and its inertia. The inertia is given, or computed for a
     * box of uniform density. */
    struct plant_free_body *body = &free_body[b->rig->nfree++];
    const double m = raw->body.inertia.mass;
    const double x = raw->box_m[0], y = raw->box_m[1], z = raw->box_m[2];
    const double box[6] = {m * (y * y + z * z) / 12.0, 0.0, 0.0,
                           m * (x * x + z * z) / 12.0, 0.0, m * (x * x + y * y) / 12.0};
    const bool given = yaml_has(&raw->mark, "inertia_kg_m2");
    struct error why;

    *body = raw->body;
    if (!given) {
        memcpy(body->inertia.I, box, sizeof box);
    }
    quaternion_from_rpy(raw->rpy_rad, body->quaternion);
    if (plant_check_free_body(body, &why)) {
        return yaml_error(b->error, yaml_place(&raw->mark, given ? "inertia_kg_m2" : "mass_kg"),
                          "%s", why.text);
    }
    return ERROR_NONE;
}

enum error_code rig_build_bodies(struct rig_builder *b)
{
    const struct raw_scene *scene = &b->raw->scene;
    const struct robot *robot = b->robot;
    struct plant_free_body *free_body = arena_alloc(b->arena, scene->nbody, sizeof *free_body);

    b->place = arena_alloc(b->arena, 1 + robot->nbody + scene->nbody, sizeof *b->place);
    if (!free_body || !b->place) {
        return rig_no_memory(b);
    }
    b->rig->free = free_body;
    scene_add_place(b, "world", -1);
    for (size_t i = 0; i < robot->nbody; i++) {
        scene_add_place(b, robot->body[i].name, (int)i);
    }
    memcpy(b->place[1].position, b->base_position, sizeof b->base_position);
    memcpy(b->place[1].rotation, b->base_rotation, sizeof b->base_rotation);
    for (size_t i = 0; i < scene->nbody; i++) {
        enum error_code code = scene_build_body(b, &scene->body[i], free_body);

        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
}
