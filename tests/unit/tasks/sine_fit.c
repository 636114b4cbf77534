/* SPDX-License-Identifier: Apache-2.0 */
/* The fit finds the sine that samples were made of. */
#include "tasks/sine_fit.h"
#include "tests/test.h"

enum { SAMPLES = 400 };

static double place(int i)
{
    return 2.0 * i / (SAMPLES - 1) - 1;
}

TEST(a_sine_on_an_offset_and_a_drift_is_found)
{
    struct sine_fit fit;
    struct sine sine;

    /* At uneven times, of two and a half periods */
    sine_fit_start(&fit);
    for (int i = 0; i < SAMPLES; i++) {
        double u = place(i) + 0.001 * (i % 3), p = 2.5 * M_PI * (u + 1);

        sine_fit_add(&fit, p, u, 1, 1000 + 3 * u + 0.2 * cos(p) - 0.7 * sin(p));
    }
    assert_true(sine_fit_solve(&fit, &sine));
    assert_true(fabs(sine.cosine - 0.2) < 1e-9 && fabs(sine.sine + 0.7) < 1e-9);
    assert_true(sine.coherence > 1 - 1e-9 && sine.coherence <= 1);
}

/* A staircase has the sine that its steps are the means of. */
TEST(a_held_signal_is_what_it_was_held_from)
{
    double width = 2 * M_PI / 40;
    struct sine_fit fit;
    struct sine sine;

    sine_fit_start(&fit);
    for (int i = 0; i < SAMPLES; i++) {
        double p = width * (i + 0.5);

        sine_fit_add(&fit, p, place(i), sin(width / 2) / (width / 2),
                     (2 * (cos(p - width / 2) - cos(p + width / 2)) +
                      1.5 * (sin(p + width / 2) - sin(p - width / 2))) /
                         width);
    }
    assert_true(sine_fit_solve(&fit, &sine));
    assert_true(fabs(sine.cosine - 1.5) < 1e-9 && fabs(sine.sine - 2) < 1e-9);
}

TEST(coherence_is_the_part_that_is_the_sine)
{
    struct sine_fit fit;
    struct sine sine;

    /* As much variance of another frequency, over whole periods of both */
    sine_fit_start(&fit);
    for (int i = 0; i < SAMPLES; i++) {
        double p = 2 * M_PI * 10 * i / SAMPLES;

        sine_fit_add(&fit, p, place(i), 1, sin(p) + cos(1.7 * p));
    }
    assert_true(sine_fit_solve(&fit, &sine));
    assert_true(fabs(sine.coherence - 0.5) < 0.01);
}

/* Five samples have five terms; a small sine on a large drift is a sine. */
TEST(few_samples_and_small_sines_are_enough)
{
    struct sine_fit fit;
    struct sine sine;

    sine_fit_start(&fit);
    for (int i = 0; i < 5; i++) {
        assert_false(sine_fit_solve(&fit, &sine));
        sine_fit_add(&fit, 1.3 * i, place(100 * i), 1, sin(1.3 * i));
    }
    assert_true(sine_fit_solve(&fit, &sine));
    assert_true(fabs(sine.sine - 1) < 1e-9);
    sine_fit_start(&fit);
    for (int i = 0; i < SAMPLES; i++) {
        sine_fit_add(&fit, 0.1 * i, place(i), 1, 100 * place(i) + 0.01 * sin(0.1 * i));
    }
    assert_true(sine_fit_solve(&fit, &sine));
    assert_true(sine.coherence > 0.99 && fabs(sine.sine - 0.01) < 1e-6);
}

TEST(samples_that_do_not_tell_are_refused)
{
    struct sine_fit fit;
    struct sine sine;

    sine_fit_start(&fit);
    assert_false(sine_fit_solve(&fit, &sine));
    for (int i = 0; i < SAMPLES; i++) {
        sine_fit_add(&fit, M_PI * i, place(i), 1, i % 2);
    }
    assert_false(sine_fit_solve(&fit, &sine));
    assert_true(sine.coherence == 0 && sine.sine == 0 && sine.cosine == 0);

    /* Nothing moves */
    sine_fit_start(&fit);
    for (int i = 0; i < SAMPLES; i++) {
        sine_fit_add(&fit, 0.1 * i, place(i), 1, 0.3);
    }
    assert_true(sine_fit_solve(&fit, &sine));
    assert_true(sine.coherence == 0 && sine.sine == 0);
}
