/* SPDX-License-Identifier: Apache-2.0 */
/* What every contact engine refuses in its configuration. */
#include "contact/contact.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "tests/physics/contact_fixture.h"

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

static void wrong_configurations_are_refused_with_the_reason(void **state)
{
    static const struct mesh nothing = {.name = "nothing"};
    struct scene good, bad;
    int row = 0;

    (void)state;
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
    REFUSED(bad.pair[1].a = 3, "on the same body");
    REFUSED(bad.pair[1].a = bad.pair[1].b, "on the same body");
    REFUSED((bad.pair[1].a = 4, bad.pair[1].b = 0), "two half-spaces");
    REFUSED((bad.pair[1].a = 1, bad.pair[1].b = 0), "again (as pair 0)");
#undef REFUSED
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wrong_configurations_are_refused_with_the_reason),
    };

    return cmocka_run_group_tests_name("contact_config", tests, fixture_set_up, fixture_tear_down);
}
