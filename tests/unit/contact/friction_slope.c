/* SPDX-License-Identifier: Apache-2.0 */
/* The bound of the friction law's slope, against the law as contact.h writes it. */
#include "contact/friction_slope.h"

#include <math.h>

#include "tests/physics/near.h"
#include "tests/test.h"

TEST(friction_is_bounded_by_its_steepest_slope_and_its_secant)
{
    const double us = 1.1, v_t = 0.01, fn = 30.0;
    double last = 0.0, slope = 0.0;

    /* contact.h's law while it sticks */
    for (int k = 1; k <= 1000; k++) {
        double u = 1e-3 * k, force = fn * us * u * u * u * (10.0 - u * (15.0 - 6.0 * u));
        double bound = contact_friction_damping(us, 0.0, v_t, fn, u * v_t);

        slope = fmax(slope, (force - last) / (1e-3 * v_t));
        last = force;
        assert_true(bound >= force / (u * v_t));
        assert_true(bound >= (1.0 - 1e-12) * slope);
    }
    assert_true(contact_friction_damping(us, 0.0, v_t, fn, 0.0) == 0.0);
    assert_near(contact_friction_damping(us, 0.0, v_t, fn, 0.5 * v_t) / slope, 1.0, 1e-5);
    /* And while it slides */
    assert_true(contact_friction_damping(us, 0.5, v_t, fn, 0.2) >= fn * (us / 0.2 + 0.5));
}
