/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The play of an anchor: it stays to the last bit within, and ends on its border beyond.
 */
#include "contact/native/anchor.h"

#include "base/vec3.h"
#include "tests/physics/near.h"
#include "tests/test.h"

static const struct native_anchor touch = {{1, 2, 3}, {0, 0, 1}, 0.1};

TEST(an_anchor_stays_while_the_area_is_within_its_play)
{
    const struct native_anchor anchor = {{1.05, 1.92, 3.001}, {0, sin(0.06), cos(0.06)}, 0.12};
    struct native_anchor dragged = anchor;

    assert_false(native_anchor_drag(&touch, &dragged));
    assert_memory_equal(&dragged, &anchor, sizeof anchor);
}

TEST(an_anchor_beyond_its_play_is_dragged_to_the_border)
{
    struct native_anchor anchor = {{1.3, 2.4, 2.5}, {sin(0.2), 0, cos(0.2)}, 0.5};

    assert_true(native_anchor_drag(&touch, &anchor));

    /* The area's radius off on the same side across the normal, a 64th of it along */
    assert_near(anchor.radius, 0.125, 1e-15);
    assert_near(anchor.point[0], 1 + 0.1 * 0.6, 1e-15);
    assert_near(anchor.point[1], 2 + 0.1 * 0.8, 1e-15);
    assert_near(anchor.point[2], 3 - 0.1 / 64, 1e-15);
    assert_near(anchor.axis[0], 1.0 / 16, 1e-15);
    assert_near(vec3_norm(anchor.axis), 1, 1e-15);
}

TEST(an_anchor_is_no_smaller_than_the_area)
{
    struct native_anchor anchor = {{1, 2, 3}, {0, 0, 1}, 0.05};

    assert_true(native_anchor_drag(&touch, &anchor));
    assert_near(anchor.radius, 0.1, 1e-17);
}

TEST(an_axis_that_points_away_is_the_normal)
{
    struct native_anchor anchor = {{1, 2, 3}, {0, 0, -1}, 0.1};

    assert_true(native_anchor_drag(&touch, &anchor));
    assert_true(anchor.axis[2] > 0.99);
}

TEST(an_anchor_that_fades_keeps_its_place)
{
    double y[CONTACT_BRISTLE] = {0};
    struct native_anchor read;

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
