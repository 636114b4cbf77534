/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The eliminated implicit Euler step of drives and parallel springs: it is the implicit Euler step,
 * it converges to the exponential of the drive's linear equations, and no stiffness upsets it.
 */
#include "model/actuator.h"
#include "model/stop.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "tests/physics/near.h"
#include "tests/physics/toy.h"

enum { N = 4 }; /* qm, qm', I and a constant 1 */

static void multiply(const double A[N][N], const double B[N][N], double C[N][N])
{
    double product[N][N] = {{0.0}};

    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            for (int k = 0; k < N; k++) {
                product[i][j] += A[i][k] * B[k][j];
            }
        }
    }
    memcpy(C, product, sizeof product);
}

/* exp(A) by Taylor's series of A/2^20, squared 20 times */
static void exponential(double A[N][N], double E[N][N])
{
    double power[N][N] = {{0.0}};

    memset(E, 0, sizeof power);
    for (int i = 0; i < N; i++) {
        E[i][i] = power[i][i] = 1.0;
        for (int j = 0; j < N; j++) {
            A[i][j] /= 1 << 20;
        }
    }
    for (int k = 1; k < 12; k++) {
        multiply(power, A, power);
        for (int i = 0; i < N; i++) {
            for (int j = 0; j < N; j++) {
                power[i][j] /= k;
                E[i][j] += power[i][j];
            }
        }
    }
    for (int k = 0; k < 20; k++) {
        multiply(E, E, E);
    }
}

/* The drive after t seconds on a link that stays at q = 0, from rest, at a constant voltage. */
static struct sea_state exact_drive(const struct robot_sea *sea, double V, double t)
{
    double A[N][N] = {
        {0.0, t, 0.0, 0.0},
        {-t * sea->Ks / sea->J, -t * (sea->Dm + sea->Ds) / sea->J, t * sea->Kt / sea->J, 0.0},
        {0.0, -t * sea->Kw / sea->L, -t * sea->R / sea->L, t * V / sea->L},
        {0.0, 0.0, 0.0, 0.0}};
    double E[N][N];

    exponential(A, E);
    return (struct sea_state){.qm = E[0][3], .qmd = E[1][3], .I = E[2][3]};
}

static struct sea_state stepped_drive(const struct robot_sea *sea, double V, double h, int steps)
{
    struct sea_state state = {0.0, 0.0, 0.0};
    struct sea_step step;

    for (int k = 0; k < steps; k++) {
        sea_step_begin(sea, &state, 0.0, 0.0, V, true, h, &step);
        sea_step_end(&step, 0.0, h, &state);
    }
    return state;
}

static void a_drive_converges_to_its_exponential_with_order_one(void **state)
{
    const struct robot_sea sea = toy_drive(395.46);
    const struct sea_state exact = exact_drive(&sea, 5.0, 0.02);
    double previous = 0.0;

    (void)state;
    for (int steps = 20; steps <= 5120; steps *= 4) {
        struct sea_state found = stepped_drive(&sea, 5.0, 0.02 / steps, steps);
        double error = fabs(found.qm - exact.qm) / fabs(exact.qm);

        print_message("# h = %.4f ms: error %.2e, current %.2e\n", 20.0 / steps, error,
                      fabs(found.I / exact.I - 1.0));
        if (steps > 80) {
            assert_near(log2(previous / error) / 2.0, 1.0, 0.05);
        }
        previous = error;
    }
    assert_true(previous < 1e-3);
}

/* However stiff and however long the step, it goes to the equilibrium and stays there. */
static void a_drive_settles_at_any_stiffness_and_step(void **state)
{
    const double stiffness[] = {1.2e-3, 1.0, 120.0, 395.46, 8400.0, 1e7};

    (void)state;
    for (size_t s = 0; s < sizeof stiffness / sizeof stiffness[0]; s++) {
        for (double h = 1e-4; h < 0.2; h *= 10.0) {
            const struct robot_sea sea = toy_drive(stiffness[s]);
            const double V = 5.0, torque = sea.Kt * V / sea.R;
            /* The slowest pole of a soft spring is that of the motor's drag on the spring */
            double slowest = (sea.Dm + sea.Kt * sea.Kw / sea.R) / sea.Ks;
            int steps = (int)fmin(1e6, 20.0 * (slowest + 0.1) / h);
            struct sea_state found = stepped_drive(&sea, V, h, steps);

            assert_true(fabs(found.I) <= V / sea.R * (1.0 + 1e-9));
            assert_true(found.qm >= 0.0 && sea.Ks * found.qm < 1.8 * torque);
            if (steps < 1000000) {
                assert_near(sea.Ks * found.qm / torque, 1.0, 1e-6);
                assert_near(found.I * sea.R / V, 1.0, 1e-6);
            }
        }
    }
}

/* What is promised of the torque, and that the three equations hold at the end of the step. */
static void assert_step_solves_equations(const struct robot_sea *sea)
{
    const struct sea_state begin = {0.3, -1.2, 2.5};
    const double q = 0.1, qd = 0.7, V = -3.0, h = 1e-3, qdd = 45.0;

    for (int on = 0; on < 2; on++) {
        double qd_end = qd + h * qdd, q_end = q + h * qd_end;
        struct sea_state end = begin, rate;
        struct sea_step step;

        end.I = on ? begin.I : 0.0;
        sea_step_begin(sea, &end, q, qd, on ? V : 0.0, on, h, &step);
        sea_step_end(&step, qd_end, h, &end);
        sea_derivative(sea, &end, q_end, qd_end, on ? V : 0.0, on, &rate);
        assert_near(end.qm - begin.qm, h * rate.qm, 1e-15);
        assert_near(end.qmd - begin.qmd, h * rate.qmd, 1e-13);
        assert_near(end.I, (on ? begin.I : 0.0) + h * rate.I, 1e-12);
        assert_near(step.torque - step.extra * qdd, sea_torque(sea, &end, q_end, qd_end), 1e-10);
        assert_true(step.extra > 0.0);
    }
}

/* With a spring that is free, one that is far into its stop, and one that is not yet there. */
static void the_step_solves_the_equations_at_its_end(void **state)
{
    static const double room[] = {0.0, 0.15, 0.21};

    (void)state;
    for (size_t i = 0; i < sizeof room / sizeof *room; i++) {
        struct robot_sea sea = toy_drive(120.0);

        sea.deflection = room[i];
        sea.stop.stiffness = room[i] > 0.0 ? 8000.0 : 0.0;
        sea.stop.damping = room[i] > 0.0 ? 4.0 : 0.0;
        assert_step_solves_equations(&sea);
    }
}

/* The linear law around any deflection and rate is the torque there. */
static void the_spring_law_is_its_torque(void **state)
{
    struct robot_sea sea = toy_drive(120.0);

    (void)state;
    sea.deflection = 0.2;
    sea.stop = (struct robot_stop){.stiffness = 8000.0, .damping = 40.0};
    for (double twist = -0.3; twist < 0.3; twist += 0.013) {
        for (double rate = -40.0; rate < 40.0; rate += 1.7) {
            const struct sea_state drive = {.qm = 0.4 + twist, .qmd = 1.0 + rate};
            struct sea_spring law = sea_spring_at(&sea, twist, rate);
            double past = fabs(twist) > 0.2 ? twist - copysign(0.2, twist) : 0.0;
            double stop = past != 0.0 ? 8000.0 * past + 40.0 * rate : 0.0;
            double torque = sea.Ks * twist + sea.Ds * rate + (stop * past > 0.0 ? stop : 0.0);

            assert_near(law.Ks * twist + law.Ds * rate + law.offset, torque, 1e-10);
            assert_near(sea_torque(&sea, &drive, 0.4, 1.0), torque, 1e-10);
        }
    }
}

/* A stop's step is its law at the end, where it presses; left, or without need, it is nothing. */
static void a_stop_is_taken_at_the_end_of_the_step(void **state)
{
    const struct robot_stop stop = {.stiffness = 1e5, .damping = 100.0};
    const double lower = -0.3, upper = 0.9, h = 1e-3;

    (void)state;
    for (int side = -1; side <= 1; side += 2) {
        double limit = side > 0 ? upper : lower;

        for (double a = -500.0; a <= 4000.0; a += 100.0) {
            double x = limit - 0.002 * side, rate = 3.0 * side, end = rate + h * a * side, torque;
            double depth = stop_depth(lower, upper, x + h * end);
            struct stop_step step;

            stop_step_begin(&stop, lower, upper, x, rate, h, &step);
            assert_int_equal(step.side, side);
            torque = step.torque - step.extra * a * side;
            if (stop_step_revise(&stop, lower, upper, x, rate, h, a * side, &step)) {
                assert_true(torque * side > 0.0); /* it would have pulled */
                assert_near(step.torque, 0.0, 0.0);
                assert_near(step.extra, 0.0, 0.0);
            } else if (depth != 0.0) {
                assert_near(torque, stop_torque(&stop, depth, end), 1e-9);
            }

            /* From rest it is engaged by what throws the coordinate past the limit */
            end = h * a * side;
            depth = stop_depth(lower, upper, x + h * end);
            stop_step_begin(&stop, lower, upper, x, 0.0, h, &step);
            assert_int_equal(step.side, 0);
            assert_true(stop_step_revise(&stop, lower, upper, x, 0.0, h, a * side, &step) ==
                        (depth * side > 0.0));
            if (depth != 0.0) {
                assert_near(step.torque - step.extra * a * side, stop_torque(&stop, depth, end),
                            1e-9);
                assert_false(stop_step_revise(&stop, lower, upper, x, 0.0, h, a * side, &step));
            }
        }
    }
}

static void a_parallel_spring_is_taken_at_the_end_of_the_step(void **state)
{
    const struct robot_parallel_spring spring = {
        .present = true, .enabled = true, .k_p = 2000.0, .d_p = 10.0, .r = 0.05, .s = -1.0};
    const double p = -0.01, pd = 0.02, q = -0.1, qd = 0.4, h = 1e-3, qdd = -80.0;
    double qd_end = qd + h * qdd, torque, extra;

    (void)state;
    parallel_spring_step(&spring, p, pd, q, qd, h, &torque, &extra);
    assert_near(torque - extra * qdd,
                parallel_spring_torque(&spring, p + h * pd, pd, q + h * qd_end, qd_end), 1e-12);
    parallel_spring_step(&spring, 0.1, pd, q, qd, h, &torque, &extra);
    assert_near(torque, 0.0, 0.0);
    assert_near(extra, 0.0, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_drive_converges_to_its_exponential_with_order_one),
        cmocka_unit_test(a_drive_settles_at_any_stiffness_and_step),
        cmocka_unit_test(the_step_solves_the_equations_at_its_end),
        cmocka_unit_test(the_spring_law_is_its_torque),
        cmocka_unit_test(a_stop_is_taken_at_the_end_of_the_step),
        cmocka_unit_test(a_parallel_spring_is_taken_at_the_end_of_the_step),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
