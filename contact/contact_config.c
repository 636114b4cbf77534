/* SPDX-License-Identifier: Apache-2.0 */
/* Checks of configurations and motions, common to all contact engines. */
#include "base/array.h"
#include "contact/contact.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>

#define ROTATION_TOLERANCE 1e-6 /* for dot products of a configured rotation's rows */
#define MOTION_TOLERANCE 1e-2   /* for a rotation in a motion: error left by an integrator stage */
#define MOTION_LIMIT 1e9        /* for the numbers of a motion: m, rad/s, m/s */

/* Returns ERROR_NONE if `good`, else ERROR_INPUT with the found and the expected value. */
static enum error_code surface_expect(bool good, const struct contact_surface *s, const char *key,
                                      double found, const char *expected, struct error *error)
{
    if (good) {
        return ERROR_NONE;
    }
    return error_set(error, ERROR_INPUT, "contact surface '%s': found %s %g, expected %s", s->name,
                     key, found, expected);
}

/* Checks that x is finite and positive. */
static bool number_is_positive(double x)
{
    return x > 0 && isfinite(x);
}

/* Checks that x is finite and zero or more. */
static bool number_is_not_negative(double x)
{
    return x >= 0 && isfinite(x);
}

static double matrix_determinant(const double r[9])
{
    return r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) +
           r[2] * (r[3] * r[7] - r[4] * r[6]);
}

/* Checks that a matrix is finite, has orthonormal rows and is right-handed. */
static bool matrix_is_rotation(const double r[9], double tolerance)
{
    for (int a = 0; a < 3; a++) {
        for (int b = a; b < 3; b++) {
            double dot =
                r[3 * a] * r[3 * b] + r[3 * a + 1] * r[3 * b + 1] + r[3 * a + 2] * r[3 * b + 2];

            if (!(fabs(dot - (a == b ? 1 : 0)) < tolerance)) {
                return false;
            }
        }
    }
    return matrix_determinant(r) > 0;
}

/* Checks that a matrix is nearly a rotation: the mean of its squared singular values is near 1,
 * and the cube of the mean is near their product, which it equals only if all three are equal. It
 * takes half the work of matrix_is_rotation; each evaluation checks each body. */
static bool matrix_turns(const double r[9], double tolerance)
{
    double mean = 0, volume = matrix_determinant(r);

    for (int i = 0; i < 9; i++) {
        mean += r[i] * r[i];
    }
    mean *= 1.0 / 3;
    return volume > 0 && fabs(mean - 1) < tolerance &&
           mean * mean * mean - volume * volume < 3 * tolerance * tolerance;
}

/* Checks that position and velocities are within MOTION_LIMIT and R is a rotation. */
static bool motion_is_valid(const struct body_motion *motion)
{
    for (int i = 0; i < 3; i++) {
        if (!(fabs(motion->p[i]) <= MOTION_LIMIT && fabs(motion->w[i]) <= MOTION_LIMIT &&
              fabs(motion->v[i]) <= MOTION_LIMIT)) {
            return false;
        }
    }
    return matrix_turns(motion->R, MOTION_TOLERANCE);
}

enum error_code contact_check_motions(const struct body_motion *motion, size_t n, char *failure,
                                      size_t size)
{
    for (size_t b = 0; b < n; b++) {
        if (!motion_is_valid(&motion[b])) {
            snprintf(failure, size,
                     "contact: invalid motion of body %zu: expected a rotation and finite numbers",
                     b);
            return ERROR_INPUT;
        }
    }
    return ERROR_NONE;
}

/* Checks the material of a surface: stiffness, dissipation and friction coefficients in their
 * ranges. */
static enum error_code surface_check_material(const struct contact_surface *s, struct error *error)
{
    const struct contact_material *m = &s->material;

    /* Ranges of the numbers */
    const struct {
        bool good;
        const char *key;
        double value;
        const char *expected;
    } rule[] = {
        {number_is_positive(m->young_pa), "young_pa", m->young_pa, "over 0"},
        {number_is_positive(m->thickness_m), "thickness_m", m->thickness_m, "over 0"},
        {number_is_not_negative(m->backing_pa_per_m), "backing_pa_per_m", m->backing_pa_per_m,
         "0 or more"},
        {number_is_not_negative(m->dissipation_s_per_m), "dissipation_s_per_m",
         m->dissipation_s_per_m, "0 or more"},
        {number_is_not_negative(m->static_friction), "static_friction", m->static_friction,
         "0 or more"},
        {number_is_not_negative(m->dynamic_friction) && m->dynamic_friction <= m->static_friction,
         "dynamic_friction", m->dynamic_friction, "0 up to static_friction"},
        {number_is_not_negative(m->viscous_friction), "viscous_friction", m->viscous_friction,
         "0 or more"},
    };

    for (size_t i = 0; i < ARRAY_COUNT(rule); i++) {
        enum error_code code =
            surface_expect(rule[i].good, s, rule[i].key, rule[i].value, rule[i].expected, error);

        if (code != ERROR_NONE) {
            return code;
        }
    }
    return ERROR_NONE;
}

/* Checks half extents (m) and cells of a box. */
static enum error_code surface_check_box(const struct contact_surface *s, struct error *error)
{
    for (int i = 0; i < 3; i++) {
        double half = s->half_extent_m[i];
        enum error_code code =
            surface_expect(half > 0 && half <= MESH_MAX_COORDINATE_M, s, "half_extent_m", half,
                           "over 0 and no larger than a mesh may be", error);

        if (code != ERROR_NONE) {
            return code;
        }
    }
    return surface_expect(s->cells_per_edge >= 1 && s->cells_per_edge <= MESH_MAX_BOX_CELLS, s,
                          "cells_per_edge", s->cells_per_edge, "1 to 256", error);
}

/* Checks that a surface has a sound mesh. */
static enum error_code surface_check_mesh(const struct contact_surface *s, struct error *error)
{
    struct mesh_finding finding;
    enum error_code code;

    if (!s->mesh) {
        return error_set(error, ERROR_INPUT, "contact surface '%s': found no mesh, expected one",
                         s->name);
    }

    /* Skips the slow check if the mesh is known to be sound */
    if (s->mesh->sound) {
        return ERROR_NONE;
    }
    code = mesh_check(s->mesh, &finding, error);
    if (code != ERROR_NONE) {
        return code;
    }
    if (finding.fault != MESH_SOUND) {
        return error_set(error, ERROR_INPUT,
                         "contact surface '%s': found a mesh with %s (face %zu), expected a closed "
                         "surface with its outside out",
                         s->name, mesh_fault_text(finding.fault), finding.face);
    }
    return ERROR_NONE;
}

/* Checks radius and length (m) of a capsule. */
static enum error_code surface_check_capsule(const struct contact_surface *s, struct error *error)
{
    enum error_code code =
        surface_expect(s->radius_m > 0 && s->radius_m <= MESH_MAX_COORDINATE_M, s, "radius_m",
                       s->radius_m, "over 0 and no larger than a mesh may be", error);

    if (code != ERROR_NONE) {
        return code;
    }
    return surface_expect(s->length_m >= 0 && s->length_m <= MESH_MAX_COORDINATE_M, s, "length_m",
                          s->length_m, "0 or more and no larger than a mesh may be", error);
}

/* Checks the dimensions that a surface's shape needs. */
static enum error_code surface_check_shape(const struct contact_surface *s, struct error *error)
{
    switch (s->shape) {
    case CONTACT_HALF_SPACE:
        return ERROR_NONE;
    case CONTACT_SPHERE:
        return surface_expect(number_is_positive(s->radius_m), s, "radius_m", s->radius_m, "over 0",
                              error);
    case CONTACT_CAPSULE:
        return surface_check_capsule(s, error);
    case CONTACT_BOX:
        return surface_check_box(s, error);
    case CONTACT_MESH:
        return surface_check_mesh(s, error);
    }
    return error_set(error, ERROR_INPUT,
                     "contact surface '%s': found shape %d, expected a known one", s->name,
                     (int)s->shape);
}

/* Checks that a surface's position is finite and its rotation orthonormal and right-handed. */
static enum error_code surface_check_pose(const struct contact_surface *s, struct error *error)
{
    const double *r = s->rotation;

    for (int i = 0; i < 3; i++) {
        enum error_code code = surface_expect(isfinite(s->position[i]), s, "position",
                                              s->position[i], "a finite number", error);

        if (code != ERROR_NONE) {
            return code;
        }
    }
    if (!matrix_is_rotation(r, ROTATION_TOLERANCE)) {
        return error_set(error, ERROR_INPUT,
                         "contact surface '%s': found a rotation with columns (%g %g %g), (%g %g "
                         "%g), (%g %g %g), expected a right-handed orthonormal matrix",
                         s->name, r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8]);
    }
    return ERROR_NONE;
}

/* Checks one surface: name, body, shape, pose and material. */
static enum error_code surface_check(const struct contact_config *config, size_t index,
                                     struct error *error)
{
    const struct contact_surface *s = &config->surface[index];
    enum error_code code;

    if (!s->name) {
        return error_set(error, ERROR_INPUT, "contact surface %zu: found no name, expected one",
                         index);
    }

    /* Its body exists */
    if (s->body < -1 || (s->body >= 0 && (size_t)s->body >= config->nbody)) {
        return error_set(error, ERROR_INPUT,
                         "contact surface '%s': found body %d, expected -1 (the world) or 0 to one "
                         "less than %zu",
                         s->name, s->body, config->nbody);
    }
    code = surface_check_shape(s, error);
    if (code != ERROR_NONE) {
        return code;
    }
    code = surface_check_pose(s, error);
    if (code != ERROR_NONE) {
        return code;
    }
    return surface_check_material(s, error);
}

/* Returns whether two surfaces can have a slack: both must be round, and one must be a capsule,
 * because two spheres use Hertz's law. */
static bool pair_slack_fits(const struct contact_surface *a, const struct contact_surface *b,
                            double slack)
{
    bool capsules[2] = {a->shape == CONTACT_CAPSULE, b->shape == CONTACT_CAPSULE};
    bool round =
        (capsules[0] || a->shape == CONTACT_SPHERE) && (capsules[1] || b->shape == CONTACT_SPHERE);

    return round && (capsules[0] || capsules[1]) && slack > 0 && slack < 2 * a->radius_m &&
           slack < 2 * b->radius_m;
}

/* Checks one pair: its surfaces exist, can touch, and no earlier pair has them. */
static enum error_code pair_check(const struct contact_config *config, size_t index,
                                  struct error *error)
{
    const struct contact_pair *p = &config->pair[index];

    /* Both surfaces exist */
    for (int side = 0; side < 2; side++) {
        int surface = side == 0 ? p->a : p->b;

        if (surface < 0 || (size_t)surface >= config->nsurface) {
            return error_set(error, ERROR_INPUT,
                             "contact pair %zu: found surface %d, expected 0 to one less than %zu",
                             index, surface, config->nsurface);
        }
    }

    /* They can touch: they are on different bodies and are not two half-spaces */
    const struct contact_surface *a = &config->surface[p->a], *b = &config->surface[p->b];

    if (a->body == b->body) {
        return error_set(
            error, ERROR_INPUT,
            "contact pair %zu: found '%s' and '%s' on the same body, expected two that "
            "can move against each other",
            index, a->name, b->name);
    }
    if (a->shape == CONTACT_HALF_SPACE && b->shape == CONTACT_HALF_SPACE) {
        return error_set(error, ERROR_INPUT,
                         "contact pair %zu: found two half-spaces ('%s' and '%s'), expected one at "
                         "most",
                         index, a->name, b->name);
    }

    /* Only round shapes have a slack, and it is less than their diameters */
    if (p->slack_m != 0 && !pair_slack_fits(a, b, p->slack_m)) {
        return error_set(error, ERROR_INPUT,
                         "contact pair %zu: found a slack of %g m between '%s' and '%s', expected "
                         "0, or between a capsule and a capsule or sphere less than their "
                         "diameters",
                         index, p->slack_m, a->name, b->name);
    }

    /* No earlier pair has the same surfaces */
    for (size_t i = 0; i < index; i++) {
        const struct contact_pair *q = &config->pair[i];

        if ((q->a == p->a && q->b == p->b) || (q->a == p->b && q->b == p->a)) {
            return error_set(error, ERROR_INPUT,
                             "contact pair %zu: found '%s' and '%s' again (as pair %zu), expected "
                             "every pair once",
                             index, a->name, b->name, i);
        }
    }
    return ERROR_NONE;
}

enum error_code contact_config_check(const struct contact_config *config, struct error *error)
{
    /* Sizes, and the transition velocity common to all pairs */
    if (config->nbody > CONTACT_MAX_BODIES || config->nsurface > CONTACT_MAX_SURFACES ||
        config->npair > CONTACT_MAX_PAIRS) {
        return error_set(error, ERROR_INPUT,
                         "contact: found %zu bodies, %zu surfaces and %zu pairs, expected at most "
                         "%d, %d and %d",
                         config->nbody, config->nsurface, config->npair, CONTACT_MAX_BODIES,
                         CONTACT_MAX_SURFACES, CONTACT_MAX_PAIRS);
    }
    if (!number_is_positive(config->transition_velocity_m_s)) {
        return error_set(error, ERROR_INPUT,
                         "contact: found transition_velocity_m_s %g, expected over 0",
                         config->transition_velocity_m_s);
    }

    /* The laws are valid enumerators */
    if (config->mesh_law != CONTACT_PRESSURE_FIELD &&
        config->mesh_law != CONTACT_ELASTIC_FOUNDATION) {
        return error_set(error, ERROR_INPUT,
                         "contact: found mesh_law %d, expected one of contact.h",
                         (int)config->mesh_law);
    }
    if (config->friction != CONTACT_FRICTION_REGULARIZED &&
        config->friction != CONTACT_FRICTION_STICKING) {
        return error_set(error, ERROR_INPUT, "contact: unknown law of friction %d",
                         (int)config->friction);
    }

    /* Surfaces first, because pairs refer to them */
    for (size_t i = 0; i < config->nsurface; i++) {
        enum error_code code = surface_check(config, i, error);

        if (code != ERROR_NONE) {
            return code;
        }
    }
    for (size_t i = 0; i < config->npair; i++) {
        enum error_code code = pair_check(config, i, error);

        if (code != ERROR_NONE) {
            return code;
        }
    }
    return ERROR_NONE;
}
