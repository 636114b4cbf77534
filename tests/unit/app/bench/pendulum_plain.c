/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Where the numbers of the paper's Table 1 and Fig. 3 come from: plain Runge-Kutta methods on the
 * pendulums' equation in closed form. The orders are checked by their convergence.
 */
#include "app/bench/pendulum.h"
#include "tests/test.h"

#include <math.h>

static void assert_converges(enum pendulum_order order, double expected)
{
    for (size_t bodies = 1; bodies <= 2; bodies++) {
        double coarse = pendulum_plain_energy(bodies, order, 2e-2);
        double fine = pendulum_plain_energy(bodies, order, 1e-2);

        print_message("# %zu bodies: %.3e at 2e-2, %.3e at 1e-2\n", bodies, coarse, fine);
        assert_true(fabs(log2(coarse / fine) - expected) < 0.1);
    }
}

TEST(methods_have_their_orders)
{
    assert_converges(PENDULUM_RK3, 3.0);
    assert_converges(PENDULUM_RK4, 4.0);
}

/* To two digits, as they are printed. */
static void assert_digits(double value, double printed)
{
    assert_true(fabs(value / printed - 1.0) < 0.03);
}

TEST(the_papers_3e_8_is_that_of_a_third_order_method)
{
    assert_digits(pendulum_plain_energy(1, PENDULUM_RK3, 1e-2), 2.0e-8);
    assert_digits(pendulum_plain_energy(2, PENDULUM_RK3, 1e-2), 3.5e-8);
    assert_true(pendulum_plain_energy(1, PENDULUM_RK4, 1e-2) < 1.5e-11);
    assert_true(pendulum_plain_energy(2, PENDULUM_RK4, 1e-2) < 1.5e-11);
}

/* Rounding that adds up over 1e5 steps: of this size, its digits are the machine's. */
TEST(the_papers_1e_13_is_rounding_without_compensation)
{
    for (size_t bodies = 1; bodies <= 2; bodies++) {
        double error = pendulum_plain_energy(bodies, PENDULUM_RK4, 1e-4);

        print_message("# %zu bodies: %.2e\n", bodies, error);
        assert_true(error > 1e-14 && error < 2e-13);
    }
}

TEST(the_papers_5e_9_is_a_linear_interpolation)
{
    assert_digits(pendulum_linear_period_error(), 6.0e-9);
}
