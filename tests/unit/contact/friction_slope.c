/* SPDX-License-Identifier: Apache-2.0 */
/* The bound of the friction law's slope, against the law as contact.h writes it. */
#include "base/array.h"
#include "contact/friction_slope.h"

#include "tests/physics/near.h"
#include "tests/test.h"

/* Slope of contact.h's S(x), from its coefficients. */
static double step_slope(double x)
{
    return 30 * x * x - 60 * x * x * x + 30 * x * x * x * x;
}

TEST(the_bound_is_the_steepest_slope_up_to_the_speed_and_then_falls_with_it)
{
    const double u[] = {0, 0.1, 0.25, 0.4, 0.5, 0.6, 0.999, 1, 1.5, 20};
    const double us = 1.1, uv = 0.07, v_t = 0.01, normal = 30;

    for (size_t i = 0; i < ARRAY_COUNT(u); i++) {
        double slope = u[i] < 0.5 ? step_slope(u[i]) : 1.875 / fmax(1, u[i]);
        double expected = normal * (us / v_t * slope + uv);

        assert_near(contact_friction_damping(us, uv, v_t, normal, u[i] * v_t), expected,
                    1e-12 * expected);
    }
}

TEST(the_bound_is_above_the_slopes_up_to_the_speed_and_above_force_over_speed)
{
    const double us = 1.1, v_t = 0.01, normal = 30;
    double steepest = 0;

    for (int k = 1; k <= 1000; k++) {
        double u = 1e-3 * k, force = normal * us * u * u * u * (10 - u * (15 - 6 * u));
        double bound = contact_friction_damping(us, 0, v_t, normal, u * v_t);

        steepest = fmax(steepest, normal * us / v_t * step_slope(u));
        assert_true(bound >= (1 - 1e-12) * force / (u * v_t));
        assert_true(bound >= (1 - 1e-12) * steepest);
    }
}
