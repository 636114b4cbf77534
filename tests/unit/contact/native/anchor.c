/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The play of an anchor: it stays to the last bit within, and ends on its border beyond.
 */
#include "contact/native/anchor.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/vec3.h"
#include "tests/physics/near.h"

static const struct native_anchor touch = {{1, 2, 3}, {0, 0, 1}, 0.1};

static void an_anchor_stays_while_the_area_is_within_its_play(void **state)
{
    const struct native_anchor anchor = {{1.05, 1.92, 3.001}, {0, sin(0.06), cos(0.06)}, 0.12};
    struct native_anchor dragged = anchor;

    (void)state;
    assert_false(native_anchor_drag(&touch, &dragged));
    assert_memory_equal(&dragged, &anchor, sizeof anchor);
}

static void an_anchor_beyond_its_play_is_dragged_to_the_border(void **state)
{
    struct native_anchor anchor = {{1.3, 2.4, 2.5}, {sin(0.2), 0, cos(0.2)}, 0.5};

    (void)state;
    assert_true(native_anchor_drag(&touch, &anchor));

    /* The area's radius off on the same side across the normal, a 64th of it along */
    assert_near(anchor.radius, 0.125, 1e-15);
    assert_near(anchor.point[0], 1 + 0.1 * 0.6, 1e-15);
    assert_near(anchor.point[1], 2 + 0.1 * 0.8, 1e-15);
    assert_near(anchor.point[2], 3 - 0.1 / 64, 1e-15);
    assert_near(anchor.axis[0], 1.0 / 16, 1e-15);
    assert_near(vec3_norm(anchor.axis), 1, 1e-15);
}

static void an_anchor_is_no_smaller_than_the_area(void **state)
{
    struct native_anchor anchor = {{1, 2, 3}, {0, 0, 1}, 0.05};

    (void)state;
    assert_true(native_anchor_drag(&touch, &anchor));
    assert_near(anchor.radius, 0.1, 1e-17);
}

static void an_axis_that_points_away_is_the_normal(void **state)
{
    struct native_anchor anchor = {{1, 2, 3}, {0, 0, -1}, 0.1};

    (void)state;
    assert_true(native_anchor_drag(&touch, &anchor));
    assert_true(anchor.axis[2] > 0.99);
}

static void an_anchor_that_fades_keeps_its_place(void **state)
{
    double y[CONTACT_BRISTLE] = {0};
    struct native_anchor read;

    (void)state;
    assert_false(native_anchor_read(y, &read));
    native_anchor_write(&touch, y);
    for (int k = 0; k < CONTACT_BRISTLE; k++) {
        y[k] *= 1.0 / 1024;
    }
    assert_true(native_anchor_read(y, &read));
    assert_near(read.radius, touch.radius / 1024, 1e-18);
    for (int k = 0; k < 3; k++) {
        assert_near(read.point[k], touch.point[k], 1e-15);
        assert_near(read.axis[k], touch.axis[k], 1e-15);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_anchor_stays_while_the_area_is_within_its_play),
        cmocka_unit_test(an_anchor_beyond_its_play_is_dragged_to_the_border),
        cmocka_unit_test(an_anchor_is_no_smaller_than_the_area),
        cmocka_unit_test(an_axis_that_points_away_is_the_normal),
        cmocka_unit_test(an_anchor_that_fades_keeps_its_place),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
