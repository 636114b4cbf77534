/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Friction that sticks, in a rig as it is: COMAN on a slope for a minute, its motors holding.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"

enum { FEET = 2, SECOND = 1000 };

static const struct rig_scene_choice coman = {.file = "coman.yaml",
                                              .integrator = PLANT_IMPLICIT,
                                              .substep_ns = 1000000,
                                              .slope_rad = 5.0 * 3.14159265358979323846 / 180.0};

/* Where the feet are, m. */
static void find_feet(const struct rig_scene *scene, double at[FEET][3])
{
    for (int f = 0; f < FEET; f++) {
        memcpy(at[f], plant_motion(scene->plant)[scene->rig->contact_body[f]].p, sizeof at[f]);
    }
}

static void coman_stays_on_a_slope_for_a_minute(void **state)
{
    static struct rig_scene scene;
    double before[FEET][3], after[FEET][3], crept = 0.0;

    (void)state;
    rig_scene_init(&scene, &coman);
    for (size_t j = 0; j < scene.robot->njoint; j++) {
        scene.reference[j] = scene.rig->joint[j];
    }
    /* Until it has swayed out, on legs that hardly damp it */
    for (int k = 0; k < 30 * SECOND; k++) {
        rig_scene_hold(&scene);
    }
    find_feet(&scene, before);
    for (int k = 0; k < 60 * SECOND; k++) {
        rig_scene_hold(&scene);
    }
    find_feet(&scene, after);
    for (int f = 0; f < FEET; f++) {
        for (int i = 0; i < 3; i++) {
            crept = fmax(crept, fabs(after[f][i] - before[f][i]));
        }
    }
    print_message("# the feet crept by %.2e m in 60 s\n", crept);
    assert_true(crept < 1e-4);
    rig_scene_fini(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(coman_stays_on_a_slope_for_a_minute),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
