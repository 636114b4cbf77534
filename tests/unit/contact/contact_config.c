/* SPDX-License-Identifier: Apache-2.0 */
/* What every contact engine refuses in its configuration. */
#include "contact/contact.h"

#include <math.h>
#include <string.h>

#include "tests/physics/contact_fixture.h"
#include "tests/test.h"

/* By the check, with a message that says what was found and what was expected, and by the
 * engines. */
static void check_refused(const struct scene *scene, int row, const char *message)
{
    struct contact_world *world = NULL;
    struct error error = {0};

    if (contact_config_check(&scene->config, &error) != ERROR_INPUT ||
        !strstr(error.text, message) || !strstr(error.text, "expected")) {
        fail_msg("row %d: '%s', expected '%s'", row, error.text, message);
    }
    assert_int_equal(contact_simbody_create(&scene->config, &world, NULL), ERROR_INPUT);
    assert_int_equal(contact_native_create(&scene->config, &fixture_arena, &world, NULL),
                     ERROR_INPUT);
    assert_null(world);
}

TEST(wrong_configurations_are_refused_with_the_reason)
{
    static const struct mesh nothing = {.name = "nothing"};
    struct scene good, bad;
    int row = 0;

    scene_init(&good, 2);
    scene_add(&good, -1, CONTACT_HALF_SPACE, &scene_ground);
    scene_add(&good, 0, CONTACT_SPHERE, &scene_foot)->radius_m = 0.1;
    scene_add_box(&good, 1, 0.1, 0.1, 0.1, 2, &scene_foot);
    scene_add(&good, 1, CONTACT_MESH, &scene_foot)->mesh = fixture_foot;
    scene_add(&good, 0, CONTACT_HALF_SPACE, &scene_foot);
    scene_add_pair(&good, 0, 1);
    scene_add_pair(&good, 1, 2);

#define REFUSED(change, message)                                                                   \
    do {                                                                                           \
        bad = good;                                                                                \
        bad.config.surface = bad.surface;                                                          \
        bad.config.pair = bad.pair;                                                                \
        change;                                                                                    \
        row++;                                                                                     \
        check_refused(&bad, row, message);                                                         \
    } while (0)

    REFUSED(bad.config.transition_velocity_m_s = 0, "transition_velocity_m_s 0");
    REFUSED(bad.config.transition_velocity_m_s = NAN, "transition_velocity_m_s");
    REFUSED(bad.config.mesh_law = (enum contact_mesh_law)2, "mesh_law 2");
    REFUSED(bad.config.nbody = CONTACT_MAX_BODIES + 1, "1025 bodies");
    REFUSED(bad.config.npair = CONTACT_MAX_PAIRS + 1, "16385 pairs");
    REFUSED(bad.surface[1].name = NULL, "no name");
    REFUSED(bad.surface[1].body = 2, "found body 2");
    REFUSED(bad.surface[1].body = -2, "found body -2");
    REFUSED(bad.surface[1].shape = (enum contact_shape)9, "shape 9");
    REFUSED(bad.surface[1].radius_m = 0, "radius_m 0");
    REFUSED(bad.surface[1].radius_m = -1, "radius_m -1");
    REFUSED(bad.surface[1].radius_m = INFINITY, "radius_m inf");
    REFUSED(bad.surface[2].half_extent_m[1] = 0, "half_extent_m 0");
    REFUSED(bad.surface[2].half_extent_m[2] = NAN, "half_extent_m");
    REFUSED(bad.surface[2].cells_per_edge = 0, "cells_per_edge 0");
    REFUSED(bad.surface[2].cells_per_edge = 257, "cells_per_edge 257");
    REFUSED(bad.surface[3].mesh = NULL, "no mesh");
    REFUSED(bad.surface[3].mesh = &nothing, "no faces");
    REFUSED(bad.surface[1].position[2] = NAN, "position");
    REFUSED(bad.surface[1].rotation[0] = 0.999, "rotation");
    REFUSED(bad.surface[1].rotation[8] = -1, "rotation");
    REFUSED(bad.surface[1].rotation[1] = NAN, "rotation");
    REFUSED(bad.surface[1].material.young_pa = 0, "young_pa 0");
    REFUSED(bad.surface[1].material.young_pa = INFINITY, "young_pa inf");
    REFUSED(bad.surface[1].material.thickness_m = 0, "thickness_m 0");
    REFUSED(bad.surface[1].material.dissipation_s_per_m = -1, "dissipation_s_per_m -1");
    REFUSED(bad.surface[1].material.static_friction = -1, "static_friction -1");
    REFUSED(bad.surface[1].material.dynamic_friction = 2, "dynamic_friction 2");
    REFUSED(bad.surface[1].material.viscous_friction = NAN, "viscous_friction");
    REFUSED(bad.pair[1].b = 5, "found surface 5");
    REFUSED(bad.pair[1].a = -1, "found surface -1");
    REFUSED(bad.pair[1].slack_m = 1e-3, "found a slack of 0.001 m");
    REFUSED(bad.pair[1].slack_m = NAN, "found a slack of nan m");
    REFUSED(bad.pair[1].a = 3, "on the same body");
    REFUSED(bad.pair[1].a = bad.pair[1].b, "on the same body");
    REFUSED((bad.pair[1].a = 4, bad.pair[1].b = 0), "two half-spaces");
    REFUSED((bad.pair[1].a = 1, bad.pair[1].b = 0), "again (as pair 0)");
#undef REFUSED
}

/* A motion turned about an axis that is none of the frame's, then each row times a factor. */
static struct body_motion turned_motion(const double factor[3])
{
    static const double axis[3] = {2.0 / 7, 3.0 / 7, 6.0 / 7};
    const double c = cos(0.7), s = sin(0.7);
    struct body_motion motion = {.p = {1, 2, 3}, .w = {-1, 0, 1}, .v = {0.1, 0.2, 0.3}};

    for (int r = 0; r < 3; r++) {
        for (int k = 0; k < 3; k++) {
            const double cross = k == r             ? 0
                                 : k == (r + 1) % 3 ? -axis[(r + 2) % 3]
                                                    : axis[(r + 1) % 3];

            motion.R[3 * r + k] =
                factor[r] * ((k == r) * c + s * cross + (1 - c) * axis[r] * axis[k]);
        }
    }
    return motion;
}

static bool is_taken(const struct body_motion *motion)
{
    char failure[200] = "";
    bool taken = contact_check_motions(motion, 1, failure, sizeof failure) == ERROR_NONE;

    assert_int_equal(taken, !strstr(failure, "body 0: expected a rotation"));
    return taken;
}

TEST(motions_are_rotations_of_finite_numbers)
{
    static const struct {
        double factor[3];
        bool taken;
    } row[] = {
        {{1, 1, 1}, true},           {{1.004, 1.004, 1.004}, true},
        {{0.996, 1.004, 1}, true},   {{-1, 1, 1}, false},
        {{-1, -1, -1}, false},       {{0, 0, 0}, false},
        {{1.02, 1.02, 1.02}, false}, {{0.98, 0.98, 0.98}, false},
        {{1.02, 0.98, 1}, false},    {{1.015, 1.015, 0.97}, false},
        {{2, 0.5, 1}, false},
    };
    static const double bad[] = {NAN, INFINITY, -1.1e9};
    const struct body_motion good = turned_motion(row[0].factor);

    for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
        const struct body_motion motion = turned_motion(row[i].factor);

        if (is_taken(&motion) != row[i].taken) {
            fail_msg("row %zu", i);
        }
    }

    /* Sheared: the first row leans to the second */
    for (int i = 0; i < 2; i++) {
        struct body_motion motion = good;

        for (int k = 0; k < 3; k++) {
            motion.R[k] += (i == 0 ? 0.005 : 0.03) * good.R[3 + k];
        }
        assert_int_equal(is_taken(&motion), i == 0);
    }

    /* Every number has to be one, and within its range */
    for (size_t i = 0; i < sizeof good / sizeof(double); i++) {
        for (int k = 0; k < 3; k++) {
            struct body_motion motion = good;

            ((double *)&motion)[i] = bad[k];
            assert_false(is_taken(&motion));
        }
    }
}

TEST_GROUP(fixture_set_up, fixture_tear_down)
