/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Adds the robot's capsules as surfaces of a scene, and the pairs that follow from them: the robot
 * against everything that is not the robot, and against itself. Of the robot's own pairs those are
 * left out that belong together: surfaces of one body, of bodies with none in between on the tree,
 * and those that overlap in one of the robot's poses, because the parts are drawn so and do not
 * touch.
 */
#include "rig/builder_private.h"

#include <string.h>

enum { TRIAL_ARENA = 1 << 30 }; /* reserved, not taken */

/* ---- surfaces ---- */

enum error_code rig_add_robot_surfaces(struct rig_builder *b, struct contact_surface *surface,
                                       int *bodies)
{
    const struct raw_scene *scene = &b->raw->scene;
    const struct raw_robot_surfaces *raw = &scene->robot_surfaces;
    struct contact_config *contact = &b->rig->contact;
    struct contact_material material;
    enum error_code code;

    code = rig_find_material(b, &raw->material_mark, raw->material, &material);
    for (size_t c = 0; !code && c < b->robot->ncapsule; c++) {
        const struct robot_capsule *capsule = &b->robot->capsule[c];
        struct contact_surface *s = &surface[contact->nsurface];

        /* A capsule has a name that no surface of the file has */
        for (size_t i = 0; i < contact->nsurface; i++) {
            if (!strcmp(surface[i].name, capsule->name)) {
                return yaml_error(b->error, &scene->surface[i].name_mark,
                                  "found surface \"%s\", expected another name: a capsule of the "
                                  "robot has it",
                                  capsule->name);
            }
        }
        /* It moves with its body */
        *s = (struct contact_surface){
            .name = capsule->name,
            .body = rig_add_contact_body(b, bodies, capsule->body),
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

/* ---- which of the robot's own pairs belong together ---- */

/* Returns the body of the robot that a surface is on; -1 when it is another's or the world's. */
static int surface_robot_body(const struct rig_builder *b, int surface)
{
    int contact_body = b->rig->contact.surface[surface].body;
    int body = contact_body < 0 ? -1 : b->rig->contact_body[contact_body];

    return body < (int)b->robot->nbody ? body : -1;
}

/* Returns the nearest body up the tree that carries a surface; -1 when there is none. */
static int body_find_carrier(const struct rig_builder *b, int body)
{
    const struct contact_config *contact = &b->rig->contact;

    for (int up = b->robot->body[body].parent; up >= 0; up = b->robot->body[up].parent) {
        for (size_t c = 0; c < contact->nbody; c++) {
            if (b->rig->contact_body[c] == up) {
                return up;
            }
        }
    }
    return -1;
}

/* Returns whether no body with a surface is between two bodies on the tree. */
static bool bodies_are_neighbors(const struct rig_builder *b, int first, int second)
{
    int above[2] = {body_find_carrier(b, first), body_find_carrier(b, second)};

    return first == second || above[0] == second || above[1] == first ||
           (above[0] < 0 && above[1] < 0);
}

/* Pairs of a list in an engine of their own. */
struct pair_trial {
    struct contact_world *world;
    struct contact_patch *patch; /* one a pair */
    struct body_motion *body;    /* by body of the robot */
    struct body_motion *motion;  /* by contact body */
    struct contact_wrench *wrench;
    bool *touches; /* by pair: in some pose */
};

/* Makes an engine with some pairs of the scene. */
static enum error_code trial_make(const struct rig_builder *b, const struct contact_pair *pair,
                                  size_t count, struct arena *arena, struct pair_trial *trial)
{
    struct contact_config config = b->rig->contact;

    config.pair = pair;
    config.npair = count;
    *trial = (struct pair_trial){
        .patch = arena_alloc(arena, count + 1, sizeof *trial->patch),
        .body = arena_alloc(arena, b->robot->nbody, sizeof *trial->body),
        .motion = arena_alloc(arena, config.nbody + 1, sizeof *trial->motion),
        .wrench = arena_alloc(arena, config.nbody + 1, sizeof *trial->wrench),
        .touches = arena_alloc(arena, count + 1, sizeof *trial->touches),
    };
    if (!trial->patch || !trial->body || !trial->motion || !trial->wrench || !trial->touches) {
        return error_set(b->error, ERROR_MEMORY, "%s: no memory for the robot's pairs",
                         b->rig->file);
    }
    return contact_native_create(&config, arena, &trial->world, b->error);
}

/* Notes the pairs that touch in a pose of the robot. */
static enum error_code trial_note_touching(struct pair_trial *trial, const struct rig_builder *b,
                                           const double *joint)
{
    static const double origin[3] = {0, 0, 0}, upright[4] = {1, 0, 0, 0};
    const struct contact_config *contact = &b->rig->contact;
    struct contact_world *world = trial->world;
    enum error_code code;
    size_t count;

    robot_place_bodies(b->robot, origin, upright, joint, trial->body);
    for (size_t c = 0; c < contact->nbody; c++) {
        int k = b->rig->contact_body[c];

        /* Bodies that are not the robot's are in no pair of the trial: anywhere will do */
        trial->motion[c] = trial->body[k < (int)b->robot->nbody ? k : 0];
    }
    code = world->ops->evaluate(world, trial->motion, NULL, trial->wrench);
    if (code) {
        return error_set(b->error, code, "%s: %s", b->rig->file, world->ops->failure(world));
    }
    count = world->ops->patches(world, trial->patch, SIZE_MAX);
    for (size_t i = 0; i < count; i++) {
        trial->touches[trial->patch[i].pair] = true;
    }
    return ERROR_NONE;
}

/* Keeps the pairs that never touch: in every pose of the robot and in that of the rig. */
static enum error_code scene_drop_overlaps(struct rig_builder *b, struct contact_pair *pair,
                                           size_t *count, struct arena *arena)
{
    struct pair_trial trial;
    size_t kept = 0;
    enum error_code code = trial_make(b, pair, *count, arena, &trial);

    for (size_t p = 0; !code && p < b->robot->npose; p++) {
        code = trial_note_touching(&trial, b, b->robot->pose[p].joint);
    }
    code = code ? code : trial_note_touching(&trial, b, b->rig->joint);
    for (size_t i = 0; !code && i < *count; i++) {
        if (!trial.touches[i]) {
            pair[kept++] = pair[i];
        }
    }
    *count = kept;
    return code;
}

/* ---- pairs ---- */

/* Returns whether a pair consists of two surfaces, in whichever order. */
static bool pairs_are_same(const struct contact_pair *p, int a, int b)
{
    return (p->a == a && p->b == b) || (p->a == b && p->b == a);
}

/* Returns whether two surfaces make a pair of the scene already, or are excluded from making
 * one. */
static bool scene_has_pair(const struct rig_builder *b, int first, int second,
                           const struct contact_pair *pair, size_t npair,
                           const struct contact_pair *excluded)
{
    for (size_t i = 0; i < npair; i++) {
        if (pairs_are_same(&pair[i], first, second)) {
            return true;
        }
    }
    for (size_t i = 0; i < b->raw->scene.robot_surfaces.nexclude; i++) {
        if (pairs_are_same(&excluded[i], first, second)) {
            return true;
        }
    }
    return false;
}

/* Adds the pairs of the robot with others (self false) or with itself. given: those that the file
 * lists. */
static size_t scene_find_pairs(const struct rig_builder *b, bool self,
                               const struct contact_pair *given, size_t ngiven,
                               const struct contact_pair *excluded, struct contact_pair *pair)
{
    const int n = (int)b->rig->contact.nsurface;
    size_t count = 0;

    for (int first = 0; first < n; first++) {
        for (int second = first + 1; second < n; second++) {
            int on[2] = {surface_robot_body(b, first), surface_robot_body(b, second)};
            bool wanted = self ? on[0] >= 0 && on[1] >= 0 && !bodies_are_neighbors(b, on[0], on[1])
                               : (on[0] >= 0) != (on[1] >= 0);

            if (wanted && !scene_has_pair(b, first, second, given, ngiven, excluded)) {
                pair[count++] = (struct contact_pair){first, second};
            }
        }
    }
    return count;
}

enum error_code rig_add_robot_pairs(struct rig_builder *b, struct contact_pair *pair, size_t *npair)
{
    const struct raw_robot_surfaces *raw = &b->raw->scene.robot_surfaces;
    const size_t given = *npair;
    struct contact_pair *excluded = arena_alloc(b->arena, raw->nexclude + 1, sizeof *excluded);
    struct arena arena;
    enum error_code code = excluded ? ERROR_NONE : rig_no_memory(b);
    size_t own;

    for (size_t i = 0; !code && i < raw->nexclude; i++) {
        code = rig_build_pair(b, &raw->exclude[i], &excluded[i]);
    }
    if (code) {
        return code;
    }

    /* With the others; with itself, less what belongs together */
    *npair += scene_find_pairs(b, false, pair, given, excluded, pair + given);
    if (!raw->self_collision) {
        return ERROR_NONE;
    }
    own = scene_find_pairs(b, true, pair, given, excluded, pair + *npair);
    code = arena_init(&arena, TRIAL_ARENA, b->error);
    if (code) {
        return code;
    }
    code = scene_drop_overlaps(b, pair + *npair, &own, &arena);
    arena_fini(&arena);
    *npair += own;
    return code;
}
