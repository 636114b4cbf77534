/* SPDX-License-Identifier: Apache-2.0 */
/* The adaptive scheme against closed solutions: accuracy as asked, failure when it must. */
#include "model/integrator.h"

#include "tests/physics/near.h"
#include "tests/test.h"

enum { ROOM = 64 };

/* y0' = y0 cos t (solution exp(sin t)); y1' = -y1^2 (solution 1/(1 + t)); y2, y3: an oscillator. */
static void mixed_problem(void *context, double t, const double *y, double *dydt)
{
    (void)context;
    dydt[0] = y[0] * cos(t);
    dydt[1] = -y[1] * y[1];
    dydt[2] = y[3];
    dydt[3] = -y[2];
}

/* Largest error after calls that cover 0 to 2 together. */
static double mixed_error(struct integrator_dopri5 *control, int calls)
{
    const double end = 2.0, h = end / calls;
    const double exact[4] = {exp(sin(end)), 1.0 / (1.0 + end), sin(end), cos(end)};
    double y[4] = {1.0, 1.0, 0.0, 1.0}, scratch[ROOM], worst = 0.0;

    assert_true(DOPRI5_SCRATCH * 4 <= ROOM);
    for (int k = 0; k < calls; k++) {
        assert_true(integrator_dopri5(mixed_problem, NULL, k * h, h, 4, y, control, scratch));
    }
    for (int i = 0; i < 4; i++) {
        worst = fmax(worst, fabs(y[i] - exact[i]));
    }
    return worst;
}

TEST(error_follows_the_tolerance)
{
    size_t previous = 0;

    for (double tolerance = 1e-4; tolerance > 1e-12; tolerance /= 100.0) {
        struct integrator_dopri5 control = {.rtol = tolerance, .atol = tolerance, .tries = 1000};
        double error = mixed_error(&control, 1);

        print_message("# tolerance %.0e: error %.1e, %zu evaluations\n", tolerance, error,
                      control.evaluations);
        assert_true(error < 20.0 * tolerance);
        assert_true(control.evaluations > previous);
        previous = control.evaluations;
    }
}

/* The cost grows as tolerance^(-1/5): a hundredth of it costs 100^(1/5) = 2.5 times as much. */
TEST(work_grows_as_the_order_says)
{
    struct integrator_dopri5 coarse = {.rtol = 1e-8, .atol = 1e-8, .tries = 10000};
    struct integrator_dopri5 fine = {.rtol = 1e-12, .atol = 1e-12, .tries = 10000};
    double ratio;

    mixed_error(&coarse, 1);
    mixed_error(&fine, 1);
    ratio = (double)fine.evaluations / (double)coarse.evaluations;
    assert_near(log(ratio) / log(1e4), 0.2, 0.03);
}

TEST(short_calls_remember_the_length_of_the_step)
{
    struct integrator_dopri5 control = {.rtol = 1e-6, .atol = 1e-6, .tries = 1000};

    assert_true(mixed_error(&control, 1000) < 1e-5);
    /* One step each, but for the first calls, which find out */
    assert_true(control.evaluations < 1000 * 7 + 100);
}

TEST(gives_up_after_its_tries)
{
    struct integrator_dopri5 control = {.rtol = 1e-12, .atol = 1e-12, .tries = 3};
    double y[4] = {1.0, 1.0, 0.0, 1.0}, scratch[ROOM];

    assert_false(integrator_dopri5(mixed_problem, NULL, 0.0, 2.0, 4, y, &control, scratch));
    assert_int_equal(control.evaluations, 1 + 3 * 6);
}

/* y' = y^2 leaves every bound at t = 1 */
static void blow_up(void *context, double t, const double *y, double *dydt)
{
    (void)context;
    (void)t;
    dydt[0] = y[0] * y[0];
}

static void not_a_number(void *context, double t, const double *y, double *dydt)
{
    (void)context;
    (void)t;
    (void)y;
    dydt[0] = (double)NAN;
}

TEST(ends_where_the_solution_ends)
{
    struct integrator_dopri5 control = {.rtol = 1e-8, .atol = 1e-8, .tries = 100000};
    double y = 1.0, scratch[ROOM];

    assert_false(integrator_dopri5(blow_up, NULL, 0.0, 2.0, 1, &y, &control, scratch));
    control = (struct integrator_dopri5){.rtol = 1e-8, .atol = 1e-8, .tries = 100000};
    y = 1.0;
    assert_false(integrator_dopri5(not_a_number, NULL, 0.0, 2.0, 1, &y, &control, scratch));
    assert_near(y, 1.0, 0.0);
}

TEST(stays_within_its_scratch)
{
    struct integrator_dopri5 control = {.rtol = 1e-6, .atol = 1e-6, .tries = 1000};
    double y[4] = {1.0, 1.0, 0.0, 1.0}, scratch[ROOM];
    size_t need = DOPRI5_SCRATCH * 4;

    assert_true(need < ROOM);
    for (size_t i = 0; i < ROOM; i++) {
        scratch[i] = 12345.0;
    }
    assert_true(integrator_dopri5(mixed_problem, NULL, 0.0, 1.0, 4, y, &control, scratch));
    for (size_t i = need; i < ROOM; i++) {
        assert_near(scratch[i], 12345.0, 0.0);
    }
}
