/* SPDX-License-Identifier: Apache-2.0 */
/* Runge-Kutta 4 against closed solutions: order, exactness, and that it stays in its scratch. */
#include "model/integrator.h"

#include "tests/physics/near.h"
#include "tests/test.h"

/* y0' = y0 cos t (solution exp(sin t)); y1' = -y1^2 (solution 1/(1 + t)); y2, y3: an oscillator. */
static void mixed_problem(void *context, double t, const double *y, double *dydt)
{
    (void)context;
    dydt[0] = y[0] * cos(t);
    dydt[1] = -y[1] * y[1];
    dydt[2] = y[3];
    dydt[3] = -y[2];
}

static double mixed_error(int steps)
{
    const double end = 2.0, h = end / steps;
    double y[4] = {1.0, 1.0, 0.0, 1.0};
    double lost[4] = {0.0}, scratch[20], worst = 0.0;
    const double exact[4] = {exp(sin(end)), 1.0 / (1.0 + end), sin(end), cos(end)};

    assert_true(RK4_SCRATCH * 4 <= sizeof scratch / sizeof scratch[0]);
    for (int k = 0; k < steps; k++) {
        integrator_rk4(mixed_problem, NULL, k * h, h, 4, y, lost, scratch);
    }
    for (int i = 0; i < 4; i++) {
        worst = fmax(worst, fabs(y[i] - exact[i]));
    }
    return worst;
}

TEST(rk4_converges_with_order_four)
{
    double previous = mixed_error(20);

    for (int steps = 40; steps <= 640; steps *= 2) {
        double error = mixed_error(steps), slope = log2(previous / error);

        print_message("# %3d steps: error %.3e, order %.3f\n", steps, error, slope);
        assert_near(slope, 4.0, 0.1);
        previous = error;
    }
}

static void cubic_slope(void *context, double t, const double *y, double *dydt)
{
    (void)context;
    (void)y;
    dydt[0] = ((4.0 * t - 3.0) * t + 2.0) * t - 1.0;
}

/* On y' = f(t) the scheme is Simpson's rule, which is exact for cubics. */
TEST(rk4_integrates_cubics_exactly)
{
    double y = 0.25, lost = 0.0, scratch[5];
    const double t = 0.3, h = 1.7, u = t + h;

    integrator_rk4(cubic_slope, NULL, t, h, 1, &y, &lost, scratch);
    assert_near(
        y, 0.25 + (u * u * u * u - u * u * u + u * u - u) - (t * t * t * t - t * t * t + t * t - t),
        1e-13);
}

static void record_time(void *context, double t, const double *y, double *dydt)
{
    double **next = context;

    (void)y;
    *(*next)++ = t;
    dydt[0] = 0.0;
}

TEST(rk4_evaluates_at_both_ends_and_twice_in_the_middle)
{
    double times[4], *next = times, y = 0.0, lost = 0.0, scratch[5];

    integrator_rk4(record_time, &next, 3.0, 0.5, 1, &y, &lost, scratch);
    assert_ptr_equal(next, times + 4);
    assert_near(times[0], 3.0, 0.0);
    assert_near(times[1], 3.25, 0.0);
    assert_near(times[2], 3.25, 0.0);
    assert_near(times[3], 3.5, 0.0);
}

TEST(rk4_stays_within_its_scratch)
{
    enum { ROOM = 64 };
    double y[4] = {1.0, 1.0, 0.0, 1.0}, lost[4] = {0.0}, scratch[ROOM];
    size_t need = RK4_SCRATCH * 4;

    assert_true(need < ROOM);
    for (size_t i = 0; i < ROOM; i++) {
        scratch[i] = 12345.0;
    }
    integrator_rk4(mixed_problem, NULL, 0.0, 0.1, 4, y, lost, scratch);
    for (size_t i = need; i < ROOM; i++) {
        assert_near(scratch[i], 12345.0, 0.0);
    }
}

static void even_slope(void *context, double t, const double *y, double *dydt)
{
    (void)t;
    (void)y;
    dydt[0] = *(const double *)context;
}

/* Each step cuts up to half a unit in the last place off, which a plain sum adds up. */
TEST(rk4_does_not_add_up_its_roundings)
{
    const double h = 1e-9;
    double slope = 1.0 / 3.0, y = 1.0, lost = 0.0, plain = 1.0, scratch[5];

    for (int k = 0; k < 1000000; k++) {
        integrator_rk4(even_slope, &slope, k * h, h, 1, &y, &lost, scratch);
        plain += h * slope;
    }
    print_message("# off by %.1e, a plain sum by %.1e\n", y - (1.0 + 1e-3 / 3.0),
                  plain - (1.0 + 1e-3 / 3.0));
    assert_near(y, 1.0 + 1e-3 / 3.0, 3e-16);
    assert_true(fabs(plain - (1.0 + 1e-3 / 3.0)) > 1e-12);
}
