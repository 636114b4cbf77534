/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Finds the contact pairs of the robot's surfaces: with all other surfaces, and with each other.
 *
 * Two surfaces of the robot have contact unless one of these conditions holds. Both are on one
 * body. The file excludes the pair. One joint connects the bodies; its end stops keep them apart.
 * The surfaces overlap in every pose of the robot's file and in the rig's pose, because they belong
 * together.
 *
 * If two surfaces overlap only in some of these poses, their capsules are wider than the real
 * parts, which do not touch there. Such a pair gets the largest overlap as its slack.
 */
#include "contact/segments.h"
#include "rig/builder_private.h"

#define SLACK_ROOM 2e-3 /* additional slack, for motion around the poses that define it, m */

enum { TRIAL_ARENA = 1 << 30 }; /* bytes of reserved address space */

/* ---- poses ---- */

/* A pair of the robot's own surfaces, and its overlaps in all poses. */
struct own_pair {
    struct contact_pair pair;
    bool round;     /* both are capsules or spheres */
    size_t touched; /* number of poses in which the surfaces overlap */
    double deepest; /* largest overlap in any pose, m; only for round pairs */
    const char *in; /* name of the last pose with an overlap */
};

/* The robot's own pairs, and the data to detect their overlaps. A contact engine evaluates the
 * pairs that are not round, in the same order. */
struct pair_trial {
    struct own_pair *own;
    size_t nown, npose;
    struct contact_pair *pair; /* pairs in the engine */
    int *of;                   /* for each pair in the engine: its index in `own` */
    struct contact_patch *patch;
    struct contact_world *world;
    struct body_motion *body;   /* one entry per body of the robot */
    struct body_motion *motion; /* one entry per contact body */
    struct contact_wrench *wrench;
};

/* Makes a trial of `count` pairs `own`. Pairs that are not round go to an engine. */
static enum error_code trial_make(const struct rig_builder *b, struct own_pair *own, size_t count,
                                  struct arena *arena, struct pair_trial *trial)
{
    struct contact_config config = b->rig->contact;

    *trial = (struct pair_trial){
        .own = own,
        .nown = count,
        .pair = arena_alloc(arena, count + 1, sizeof *trial->pair),
        .of = arena_alloc(arena, count + 1, sizeof *trial->of),
        .patch = arena_alloc(arena, count + 1, sizeof *trial->patch),
        .body = arena_alloc(arena, b->robot->nbody, sizeof *trial->body),
        .motion = arena_alloc(arena, config.nbody + 1, sizeof *trial->motion),
        .wrench = arena_alloc(arena, config.nbody + 1, sizeof *trial->wrench),
    };
    if (!trial->pair || !trial->of || !trial->patch || !trial->body || !trial->motion ||
        !trial->wrench) {
        return error_set(b->error, ERROR_MEMORY, "%s: no memory for the robot's pairs",
                         b->rig->file);
    }

    /* Create the engine with its pairs */
    config.pair = trial->pair;
    config.npair = 0;
    for (size_t i = 0; i < count; i++) {
        if (!own[i].round) {
            trial->of[config.npair] = (int)i;
            trial->pair[config.npair++] = own[i].pair;
        }
    }
    return contact_native_create(&config, arena, &trial->world, b->error);
}

/* Returns the axis of a capsule, or the center of a sphere, for a pose of its body. */
static struct segment surface_axis(const struct contact_surface *s, const struct body_motion *body)
{
    const double length = s->shape == CONTACT_CAPSULE ? s->length_m : 0;
    const double z[3] = {s->rotation[2], s->rotation[5], s->rotation[8]};
    struct segment axis;
    double from[3];

    vec3_add_scaled(s->position, -length / 2, z, from);
    mat3_apply(body->R, from, axis.from);
    vec3_add_scaled(axis.from, 1, body->p, axis.from);
    mat3_apply(body->R, z, axis.by);
    for (int k = 0; k < 3; k++) {
        axis.by[k] *= length;
    }
    return axis;
}

static void own_note(struct own_pair *own, double depth, const char *pose)
{
    own->touched++;
    own->deepest = depth > own->deepest ? depth : own->deepest;
    own->in = pose;
}

/* Finds and records the pairs that overlap in a pose of the robot. */
static enum error_code trial_note_pose(struct pair_trial *trial, const struct rig_builder *b,
                                       const double *joint, const char *name)
{
    static const double origin[3] = {0, 0, 0}, upright[4] = {1, 0, 0, 0};
    const struct contact_config *contact = &b->rig->contact;
    struct contact_world *world = trial->world;
    enum error_code code;
    size_t count;

    trial->npose++;
    robot_place_bodies(b->robot, origin, upright, joint, trial->body);
    for (size_t c = 0; c < contact->nbody; c++) {
        int k = b->rig->contact_body[c];

        /* For bodies that are not the robot's, use any pose: no pair of the trial has them */
        trial->motion[c] = trial->body[k < (int)b->robot->nbody ? k : 0];
    }

    /* Compute the overlap of round pairs in closed form */
    for (size_t i = 0; i < trial->nown; i++) {
        const struct contact_surface *s = &contact->surface[trial->own[i].pair.a];
        const struct contact_surface *t = &contact->surface[trial->own[i].pair.b];

        if (trial->own[i].round) {
            struct segment axis[2] = {surface_axis(s, &trial->motion[s->body]),
                                      surface_axis(t, &trial->motion[t->body])};
            double depth = s->radius_m + t->radius_m - sqrt(segments_distance2(&axis[0], &axis[1]));

            if (depth > 0) {
                own_note(&trial->own[i], depth, name);
            }
        }
    }

    /* Let the engine evaluate the other pairs */
    code = world->ops->evaluate(world, trial->motion, NULL, trial->wrench);
    if (code) {
        return error_set(b->error, code, "%s: %s", b->rig->file, world->ops->failure(world));
    }
    count = world->ops->patches(world, trial->patch, SIZE_MAX);
    for (size_t i = 0; i < count; i++) {
        own_note(&trial->own[trial->of[trial->patch[i].pair]], trial->patch[i].penetration_m, name);
    }
    return ERROR_NONE;
}

/* Counts the poses in which each pair overlaps: all poses of the robot, and the rig's pose. */
static enum error_code trial_note_poses(struct pair_trial *trial, const struct rig_builder *b)
{
    enum error_code code = ERROR_NONE;

    for (size_t p = 0; !code && p < b->robot->npose; p++) {
        code = trial_note_pose(trial, b, b->robot->pose[p].joint, b->robot->pose[p].name);
    }
    return code ? code : trial_note_pose(trial, b, b->rig->joint, "of the rig");
}

/* ---- selection of pairs ---- */

/* Returns the robot's body that carries a surface. -1 = another body or the world. */
static int surface_robot_body(const struct rig_builder *b, int surface)
{
    int contact_body = b->rig->contact.surface[surface].body;
    int body = contact_body < 0 ? -1 : b->rig->contact_body[contact_body];

    return body < (int)b->robot->nbody ? body : -1;
}

/* Returns the index of the pair of two surfaces among n pairs, or -1 if there is none. */
static int pairs_find(const struct contact_pair *pair, size_t n, int first, int second)
{
    for (size_t i = 0; i < n; i++) {
        if ((pair[i].a == first && pair[i].b == second) ||
            (pair[i].a == second && pair[i].b == first)) {
            return (int)i;
        }
    }
    return -1;
}

/* Adds two surfaces to the list of pairs without contact. */
static void rig_leave_pair(struct rig_builder *b, int first, int second, enum rig_left_why why,
                           const char *what)
{
    b->left[b->rig->nleft++] = (struct rig_left_pair){first, second, why, what};
}

/* Returns the joint that directly connects two bodies, or NULL if there is none. */
static const struct robot_joint *bodies_find_joint(const struct robot *robot, int first, int second)
{
    /* Joint j moves body j + 1 */
    if (robot->body[first].parent == second) {
        return &robot->joint[first - 1];
    }
    return robot->body[second].parent == first ? &robot->joint[second - 1] : NULL;
}

/* Adds pairs between the robot's surfaces and all other surfaces. Returns their number. Skips the
 * pairs that the file lists. */
static size_t scene_pair_with_others(const struct rig_builder *b, const struct contact_pair *given,
                                     size_t ngiven, const struct contact_pair *excluded,
                                     struct contact_pair *pair)
{
    const int n = (int)b->rig->contact.nsurface;
    const size_t nexclude = b->raw->scene.robot_surfaces.nexclude;
    size_t count = 0;

    for (int first = 0; first < n; first++) {
        for (int second = first + 1; second < n; second++) {
            if ((surface_robot_body(b, first) >= 0) != (surface_robot_body(b, second) >= 0) &&
                pairs_find(given, ngiven, first, second) < 0 &&
                pairs_find(excluded, nexclude, first, second) < 0) {
                pair[count++] = (struct contact_pair){.a = first, .b = second};
            }
        }
    }
    return count;
}

/* Finds the robot's own pairs that need the test in all poses. Skips the pairs that the file
 * lists. */
static size_t scene_find_own_pairs(struct rig_builder *b, const struct contact_pair *given,
                                   size_t ngiven, const struct contact_pair *excluded,
                                   struct own_pair *own)
{
    const int n = (int)b->rig->contact.nsurface;
    size_t count = 0;

    for (int first = 0; first < n; first++) {
        int body = surface_robot_body(b, first);

        for (int second = first + 1; second < n && body >= 0; second++) {
            int other = surface_robot_body(b, second);

            if (other >= 0 && other != body && pairs_find(given, ngiven, first, second) < 0) {
                /* Decide about a pair of the robot's own surfaces. The pair becomes a candidate for
                 * the test in all poses, or it goes to the pairs without contact. */
                const struct raw_robot_surfaces *raw = &b->raw->scene.robot_surfaces;
                const struct contact_surface *s = &b->rig->contact.surface[first];
                const struct contact_surface *t = &b->rig->contact.surface[second];
                const struct robot_joint *joint = bodies_find_joint(
                    b->robot, surface_robot_body(b, first), surface_robot_body(b, second));
                int by_file = pairs_find(excluded, raw->nexclude, first, second);

                if (by_file >= 0) {
                    rig_leave_pair(b, first, second, RIG_LEFT_BY_FILE,
                                   raw->exclude[by_file].reason);
                } else if (joint) {
                    rig_leave_pair(b, first, second, RIG_LEFT_JOINED, joint->name);
                } else {
                    bool round[2] = {s->shape == CONTACT_CAPSULE || s->shape == CONTACT_SPHERE,
                                     t->shape == CONTACT_CAPSULE || t->shape == CONTACT_SPHERE};

                    own[count++] = (struct own_pair){.pair = {.a = first, .b = second},
                                                     .round = round[0] && round[1]};
                }
            }
        }
    }
    return count;
}

/* Adds the tested pairs to `pair` or to the pairs without contact. Sets the slack of pairs that
 * overlap in some poses. Returns the number of added pairs. */
static size_t scene_add_own_pairs(struct rig_builder *b, const struct pair_trial *trial,
                                  struct contact_pair *pair)
{
    const struct contact_surface *surface = b->rig->contact.surface;
    size_t count = 0;

    for (size_t i = 0; i < trial->nown; i++) {
        const struct own_pair *own = &trial->own[i];
        const struct contact_surface *s = &surface[own->pair.a], *t = &surface[own->pair.b];
        double slack = own->deepest + SLACK_ROOM;

        if (own->touched == 0) {
            pair[count++] = own->pair;
        } else if (own->touched == trial->npose) {
            rig_leave_pair(b, own->pair.a, own->pair.b, RIG_LEFT_ALWAYS, NULL);
        } else if (own->round && (s->shape == CONTACT_CAPSULE || t->shape == CONTACT_CAPSULE) &&
                   slack < 2 * fmin(s->radius_m, t->radius_m)) {
            pair[count] = own->pair;
            pair[count++].slack_m = slack;
        } else {
            rig_leave_pair(b, own->pair.a, own->pair.b, RIG_LEFT_IN_POSE, own->in);
        }
    }
    return count;
}

/* Adds the robot's own pairs to `pair`, and writes their number to *count. */
static enum error_code scene_add_own(struct rig_builder *b, const struct contact_pair *given,
                                     size_t ngiven, const struct contact_pair *excluded,
                                     struct contact_pair *pair, size_t *count)
{
    const size_t n = b->rig->contact.nsurface;
    struct pair_trial trial;
    struct own_pair *own;
    struct arena arena;
    enum error_code code = arena_init(&arena, TRIAL_ARENA, b->error);

    if (code) {
        return code;
    }
    own = arena_alloc(&arena, n * n / 2 + 1, sizeof *own);
    b->left = arena_alloc(b->arena, n * n / 2 + 1, sizeof *b->left);
    b->rig->left = b->left;
    code = own && b->left ? ERROR_NONE : rig_no_memory(b);
    if (!code) {
        size_t nown = scene_find_own_pairs(b, given, ngiven, excluded, own);

        code = trial_make(b, own, nown, &arena, &trial);
    }
    code = code ? code : trial_note_poses(&trial, b);
    *count = code ? 0 : scene_add_own_pairs(b, &trial, pair);
    arena_fini(&arena);
    return code;
}

enum error_code rig_add_robot_pairs(struct rig_builder *b, struct contact_pair *pair, size_t *npair)
{
    const struct raw_robot_surfaces *raw = &b->raw->scene.robot_surfaces;
    const size_t given = *npair;
    struct contact_pair *excluded = arena_alloc(b->arena, raw->nexclude + 1, sizeof *excluded);
    enum error_code code = excluded ? ERROR_NONE : rig_no_memory(b);
    size_t own = 0;

    for (size_t i = 0; !code && i < raw->nexclude; i++) {
        code = rig_build_pair(b, &raw->exclude[i], &excluded[i]);
    }
    if (code) {
        return code;
    }

    /* Add pairs with other surfaces, then pairs of two own surfaces */
    *npair += scene_pair_with_others(b, pair, given, excluded, pair + given);
    if (raw->self_collision) {
        code = scene_add_own(b, pair, given, excluded, pair + *npair, &own);
        *npair += own;
    }
    return code;
}
