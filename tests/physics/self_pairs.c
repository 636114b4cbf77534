/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The robots' own pairs, against random poses within the ranges of the joints: every two surfaces
 * that overlap in some pose and not in others are watched, but for a few that are listed here, and
 * none has more slack than the poses of the robot's file ask for. Distances are searched for, not
 * computed as the rig does.
 */

#include "tests/physics/rig_scene.h"
#include "tests/unit/contact/random_number.h"

enum { POSES = 2000, SURFACES = 32, BODIES = 64 };

#define ROOM 2e-3 /* m, of a slack beyond the poses */

struct left_out {
    const char *one, *other;
};

/* The waist's end stops hold pelvis and trunk apart, the capsules of which overlap from the start;
 * a foot turns inside of the lower end of its shank's. */
static const struct left_out coman_left[] = {{"pelvis", "trunk"}};
static const struct left_out walkman_left[] = {
    {"pelvis", "right_thigh"},
    {"pelvis", "left_thigh"},
    {"right_foot", "right_shank"},
    {"left_foot", "left_shank"},
    {"right_upper_arm", "right_forearm"},
    {"left_upper_arm", "left_forearm"},
    {"right_upper_arm", "right_wrist"},
    {"left_upper_arm", "left_wrist"},
};

/* Two of the robot's surfaces over all poses. */
struct over_poses {
    double deepest; /* overlap in random poses, m; negative: a distance */
    double shallowest;
    double drawn; /* the deepest in those of the file and the rig */
};

static struct rig_scene scene;
static struct over_poses seen[SURFACES][SURFACES];

/* ---- overlaps ---- */

/* Where a point of a capsule's axis is in the world: at s of its length from the middle. */
static void axis_point(const struct contact_surface *s, const struct body_motion *body, double at,
                       double out[3])
{
    double in_body[3];

    for (int k = 0; k < 3; k++) {
        in_body[k] = s->position[k] + at * s->length_m * s->rotation[3 * k + 2];
    }
    mat3_apply(body->R, in_body, out);
    vec3_add_scaled(out, 1, body->p, out);
}

/* Distance of a point to an axis, by thirds: it is convex along the axis. */
static double point_distance(const double p[3], const struct contact_surface *s,
                             const struct body_motion *body)
{
    double from = -0.5, to = 0.5, distance[2] = {0};

    for (int i = 0; i < 40; i++) {
        for (int k = 0; k < 2; k++) {
            double q[3], d[3];

            axis_point(s, body, k ? to - (to - from) / 3 : from + (to - from) / 3, q);
            vec3_sub(p, q, d);
            distance[k] = vec3_norm(d);
        }
        if (distance[0] < distance[1]) {
            to -= (to - from) / 3;
        } else {
            from += (to - from) / 3;
        }
    }
    return fmin(distance[0], distance[1]);
}

static double capsules_overlap(const struct contact_surface *s, const struct body_motion *body,
                               const struct contact_surface *t, const struct body_motion *other)
{
    double from = -0.5, to = 0.5, distance[2] = {0}, p[3], q[3], d[3];

    /* Far apart: a bound will do */
    axis_point(s, body, 0, p);
    axis_point(t, other, 0, q);
    vec3_sub(p, q, d);
    distance[0] = vec3_norm(d) - (s->length_m + t->length_m) / 2;
    if (distance[0] > s->radius_m + t->radius_m) {
        return s->radius_m + t->radius_m - distance[0];
    }
    for (int i = 0; i < 40; i++) {
        for (int k = 0; k < 2; k++) {
            axis_point(s, body, k ? to - (to - from) / 3 : from + (to - from) / 3, p);
            distance[k] = point_distance(p, t, other);
        }
        if (distance[0] < distance[1]) {
            to -= (to - from) / 3;
        } else {
            from += (to - from) / 3;
        }
    }
    return s->radius_m + t->radius_m - fmin(distance[0], distance[1]);
}

/* How far a mesh's deepest vertex is inside a capsule. */
static double mesh_overlap(const struct contact_surface *mesh, const struct body_motion *body,
                           const struct contact_surface *t, const struct body_motion *other)
{
    double deepest = -1e9;

    for (size_t v = 0; v < mesh->mesh->nvertex; v += 1) {
        double in_body[3], p[3], d[3], q[3];

        mat3_apply(mesh->rotation, mesh->mesh->vertex[v], in_body);
        vec3_add_scaled(in_body, 1, mesh->position, in_body);
        mat3_apply(body->R, in_body, p);
        vec3_add_scaled(p, 1, body->p, p);
        axis_point(t, other, 0, q);
        vec3_sub(p, q, d);
        if (vec3_norm(d) < t->radius_m + t->length_m / 2) {
            deepest = fmax(deepest, t->radius_m - point_distance(p, t, other));
        }
    }
    return deepest;
}

static int robot_body(int surface)
{
    int body = scene.rig->contact.surface[surface].body;

    return body < 0 ? -1 : scene.rig->contact_body[body];
}

static double overlap(int a, int b, const struct body_motion *body)
{
    const struct contact_surface *s = &scene.rig->contact.surface[a];
    const struct contact_surface *t = &scene.rig->contact.surface[b];
    const struct body_motion *at = &body[robot_body(a)], *other = &body[robot_body(b)];

    if (s->shape == CONTACT_CAPSULE && t->shape == CONTACT_CAPSULE) {
        return capsules_overlap(s, at, t, other);
    }
    if (s->shape == CONTACT_MESH && t->shape == CONTACT_CAPSULE) {
        return mesh_overlap(s, at, t, other);
    }
    return -1e9; /* a foot and a foot: left to the list of the rig */
}

/* ---- poses ---- */

static void look(const double *joint, bool drawn)
{
    static const double origin[3] = {0, 0, 0}, upright[4] = {1, 0, 0, 0};
    const int n = (int)scene.rig->contact.nsurface;
    struct body_motion body[BODIES];

    robot_place_bodies(scene.robot, origin, upright, joint, body);
    for (int a = 0; a < n; a++) {
        for (int b = a + 1; b < n; b++) {
            struct over_poses *pair = &seen[a][b];
            double depth;

            if (robot_body(a) < 0 || robot_body(b) < 0 || robot_body(a) == robot_body(b)) {
                continue;
            }
            depth = overlap(a, b, body);
            if (drawn) {
                pair->drawn = fmax(pair->drawn, depth);
            } else {
                pair->deepest = fmax(pair->deepest, depth);
                pair->shallowest = fmin(pair->shallowest, depth);
            }
        }
    }
}

/* Poses of the file, of the rig, and random ones: a third of the joints at an end of its range. */
static void look_at_poses(void)
{
    const struct robot *robot = scene.robot;
    double joint[RIG_SCENE_JOINTS];
    uint64_t seed = 11;

    for (int a = 0; a < SURFACES; a++) {
        for (int b = 0; b < SURFACES; b++) {
            seen[a][b] = (struct over_poses){-1e9, 1e9, -1e9};
        }
    }
    for (size_t p = 0; p < robot->npose; p++) {
        look(robot->pose[p].joint, true);
    }
    look(scene.rig->joint, true);
    for (int i = 0; i < POSES; i++) {
        for (size_t j = 0; j < robot->njoint; j++) {
            double x = 1.5 * random_number(&seed);
            double half = (robot->joint[j].upper - robot->joint[j].lower) / 2;

            joint[j] = robot->joint[j].lower + half * (1 + fmax(-1, fmin(1, x)));
        }
        look(joint, false);
    }
}

/* ---- what the rig makes of them ---- */

static const struct contact_pair *watched(int a, int b)
{
    for (size_t i = 0; i < scene.rig->contact.npair; i++) {
        const struct contact_pair *p = &scene.rig->contact.pair[i];

        if ((p->a == a && p->b == b) || (p->a == b && p->b == a)) {
            return p;
        }
    }
    return NULL;
}

static bool is_listed(const struct left_out *list, size_t count, const char *one, const char *other)
{
    for (size_t i = 0; i < count; i++) {
        if ((!strcmp(list[i].one, one) && !strcmp(list[i].other, other)) ||
            (!strcmp(list[i].one, other) && !strcmp(list[i].other, one))) {
            return true;
        }
    }
    return false;
}

static bool rig_says_why(int a, int b)
{
    for (size_t i = 0; i < scene.rig->nleft; i++) {
        if ((scene.rig->left[i].a == a && scene.rig->left[i].b == b) ||
            (scene.rig->left[i].a == b && scene.rig->left[i].b == a)) {
            return true;
        }
    }
    return false;
}

static void assert_closed(const char *file, const struct left_out *list, size_t count)
{
    const struct rig_scene_choice choice = {
        .file = file, .integrator = PLANT_IMPLICIT, .substep_ns = 1000000};
    size_t mixed = 0, left = 0;

    rig_scene_init(&scene, &choice);
    assert_true(scene.rig->contact.nsurface <= SURFACES && scene.robot->nbody <= BODIES);
    look_at_poses();
    for (int a = 0; a < (int)scene.rig->contact.nsurface; a++) {
        for (int b = a + 1; b < (int)scene.rig->contact.nsurface; b++) {
            const char *one = scene.rig->contact.surface[a].name;
            const char *other = scene.rig->contact.surface[b].name;
            const struct over_poses *pair = &seen[a][b];
            const struct contact_pair *p = watched(a, b);

            if (robot_body(a) < 0 || robot_body(b) < 0 || robot_body(a) == robot_body(b)) {
                continue;
            }
            if ((p == NULL) != rig_says_why(a, b)) {
                fail_msg("%s - %s: watched, and left out, or neither", one, other);
            }
            if (p && p->slack_m > 0 && fabs(p->slack_m - pair->drawn - ROOM) > 1e-6) {
                fail_msg("%s - %s: slack %g m, drawn %g m", one, other, p->slack_m, pair->drawn);
            }
            if (p && p->slack_m == 0 && pair->drawn > 0) {
                fail_msg("%s - %s: overlap by %g m where they are drawn", one, other, pair->drawn);
            }
            if (pair->deepest <= 0 || pair->shallowest > 0) {
                continue; /* never, or always */
            }
            mixed++;
            left += !p;
            if (!p) {
                print_message("# %s: %s - %s left out, %.0f to %.0f mm\n", file, one, other,
                              1e3 * pair->shallowest, 1e3 * pair->deepest);
            }
            if (!p != is_listed(list, count, one, other)) {
                fail_msg("%s - %s: overlap by up to %g m, %swatched", one, other, pair->deepest,
                         p ? "" : "not ");
            }
        }
    }
    print_message("# %s: of %zu pairs that can touch and part %zu are left out\n", file, mixed,
                  left);
    assert_int_equal(left, count);
    rig_scene_fini(&scene);
}

TEST(all_pairs_of_coman_that_can_touch_are_watched)
{
    assert_closed("coman.yaml", coman_left, sizeof coman_left / sizeof coman_left[0]);
}

TEST(all_pairs_of_walkman_that_can_touch_are_watched)
{
    assert_closed("walkman.yaml", walkman_left, sizeof walkman_left / sizeof walkman_left[0]);
}
