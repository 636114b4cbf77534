/* SPDX-License-Identifier: Apache-2.0 */
/* Configurations and motions that every contact engine refuses. */
#include "contact/contact.h"

#include "tests/physics/contact_scene.h"
#include "tests/test.h"

TEST(too_many_surfaces_and_two_half_spaces_are_refused_with_the_reason)
{
    struct error error;
    struct scene scene;

    scene_init(&scene, 2);
    scene_add(&scene, -1, CONTACT_HALF_SPACE, &scene_ground);
    scene_add(&scene, 0, CONTACT_SPHERE, &scene_foot)->radius_m = 0.1;
    scene_add(&scene, 1, CONTACT_HALF_SPACE, &scene_foot);
    scene_add_pair(&scene, 0, 1);
    scene_add_pair(&scene, 1, 2);
    assert_no_error(contact_config_check(&scene.config, &error), error.text);

    size_t *const count[] = {&scene.config.nbody, &scene.config.nsurface, &scene.config.npair};
    const size_t most[] = {CONTACT_MAX_BODIES, CONTACT_MAX_SURFACES, CONTACT_MAX_PAIRS};
    const char *const found[] = {"1025 bodies", "1025 surfaces", "16385 pairs"};

    for (int i = 0; i < 3; i++) {
        const size_t kept = *count[i];

        *count[i] = most[i] + 1;
        assert_int_equal(contact_config_check(&scene.config, &error), ERROR_INPUT);
        assert_non_null(strstr(error.text, found[i]));
        *count[i] = kept;
    }
    scene.config.nbody = CONTACT_MAX_BODIES;
    assert_ok(contact_config_check(&scene.config, &error));
    scene_add_pair(&scene, 2, 0);
    assert_int_equal(contact_config_check(&scene.config, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "contact pair 2: found two half-spaces"));
}

TEST(motions_are_finite_numbers_in_their_range)
{
    static const double bad[] = {NAN, INFINITY, -1.1e9};
    char failure[200] = "";
    struct body_motion motion[2];

    scene_place(&motion[0], 1e9, 0, 0);
    scene_place(&motion[1], 0, 0, -1e9);
    assert_ok(contact_check_motions(motion, 2, failure, sizeof failure));
    for (size_t i = 0; i < sizeof *motion / sizeof(double); i++) {
        double *number = (double *)&motion[1] + i;
        const double kept = *number;

        for (int k = 0; k < 3; k++) {
            *number = bad[k];
            assert_int_equal(contact_check_motions(motion, 2, failure, sizeof failure),
                             ERROR_INPUT);
            assert_non_null(strstr(failure, "body 1"));
        }
        *number = kept;
    }
}
