/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What actuators do in a step of the implicit integrator: the exact flow of a drive against an
 * exponential of its linear equations and against Runge-Kutta, at any stiffness and length, and the
 * eliminated implicit Euler steps of a parallel spring and of a stop.
 */
#include "model/drives/drive_flow.h"
#include "model/stop.h"

#include "tests/physics/near.h"
#include "tests/physics/toy.h"
#include "tests/test.h"

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

/* Over any time, stiff or soft: the state is that of the exponential, in one flow and in many. */
TEST(a_flow_is_the_exponential)
{
    const double stiffness[] = {1.2e-3, 120.0, 395.46, 8400.0, 1e7};

    for (size_t s = 0; s < sizeof stiffness / sizeof stiffness[0]; s++) {
        const struct robot_sea sea = toy_drive(stiffness[s]);
        const struct sea_state exact = exact_drive(&sea, 5.0, 0.02);

        for (int flows = 1; flows <= 1000; flows *= 10) {
            struct sea_state found = {0.0, 0.0, 0.0};
            struct drive_flow flow;

            drive_flow_make(&sea, true, 0.02 / flows, &flow);
            for (int k = 0; k < flows; k++) {
                found = drive_flow_advance(&flow, &found, 0.0, 0.0, 5.0);
            }
            assert_near(found.qm, exact.qm, 1e-9 * fabs(exact.qm));
            assert_near(found.qmd, exact.qmd, 1e-9 * fabs(exact.qmd) + 1e-11);
            assert_near(found.I, exact.I, 1e-9 * fabs(exact.I));
        }
    }
}

/* The state after t seconds by Runge-Kutta in steps of a microsecond, the joint moving at qd. */
static struct sea_state integrated_drive(const struct robot_sea *sea, struct sea_state y, double q,
                                         double qd, double V, bool on, double t)
{
    const double h = 1e-6, part[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0, 2.0, 2.0, 1.0};

    for (int k = 0; k < (int)lround(t / h); k++) {
        struct sea_state rate = {0.0, 0.0, 0.0}, sum = {0.0, 0.0, 0.0};

        for (int stage = 0; stage < 4; stage++) {
            const double c = part[stage] * h;
            const struct sea_state at = {y.qm + c * rate.qm, y.qmd + c * rate.qmd,
                                         y.I + c * rate.I};

            sea_derivative(sea, &at, q + qd * (k * h + c), qd, V, on, &rate);
            sum.qm += weight[stage] / 6.0 * rate.qm;
            sum.qmd += weight[stage] / 6.0 * rate.qmd;
            sum.I += weight[stage] / 6.0 * rate.I;
        }
        y = (struct sea_state){y.qm + h * sum.qm, y.qmd + h * sum.qmd, y.I + h * sum.I};
    }
    return y;
}

/* From any state, with a joint that moves, the bridge on and off; Kw unlike Kt. */
TEST(a_flow_follows_a_joint_that_moves)
{
    const struct sea_state begin = {0.3, -1.2, 2.5};
    const double q = 0.1, qd = 0.7, V = -3.0, t = 1e-3;
    struct robot_sea sea = toy_drive(395.46);

    sea.Kw = 3.7;
    for (int on = 0; on < 2; on++) {
        struct sea_state exact = integrated_drive(&sea, begin, q, qd, V, on, t), end;
        struct drive_flow flow;

        drive_flow_make(&sea, on, t, &flow);
        end = drive_flow_advance(&flow, &begin, q, qd, V);
        assert_near(end.qm, exact.qm, 1e-12);
        assert_near(end.qmd, exact.qmd, 1e-11);
        assert_near(end.I, exact.I, 1e-10);
        assert_true(on || end.I == begin.I);
    }
}

/* However stiff and however long the flow, it goes to the equilibrium and stays there. */
TEST(a_flow_of_any_length_ends_in_equilibrium)
{
    const double stiffness[] = {1.0, 120.0, 395.46, 8400.0, 1e7};

    for (size_t s = 0; s < sizeof stiffness / sizeof stiffness[0]; s++) {
        const struct robot_sea sea = toy_drive(stiffness[s]);
        const double V = 5.0, torque = sea.Kt * V / sea.R;
        struct sea_state found = {0.0, 0.0, 0.0};
        struct drive_flow flow;

        drive_flow_make(&sea, true, 1000.0, &flow);
        found = drive_flow_advance(&flow, &found, 0.0, 0.0, V);
        assert_near(sea.Ks * found.qm / torque, 1.0, 1e-6);
        assert_near(found.I * sea.R / V, 1.0, 1e-6);
    }
}

/* A rotor of an inertia beyond measure, at rest, keeps its place to the last bit. */
TEST(a_held_rotor_stays_where_it_is)
{
    struct robot_sea sea = toy_drive(395.46);
    struct sea_state drive = {0.3, 0.0, 0.0};
    struct drive_flow flow;

    sea.J = 1e30;
    drive_flow_make(&sea, true, 1e-3, &flow);
    for (int k = 0; k < 1000; k++) {
        drive = drive_flow_advance(&flow, &drive, 0.1 + 1e-3 * k, 1.0, 48.0);
        assert_true(drive.qm == 0.3);
    }
    assert_near(drive.I, 48.0 / sea.R, 1e-9);
}

/* The linear law around any deflection and rate is the torque there. */
TEST(the_spring_law_is_its_torque)
{
    struct robot_sea sea = toy_drive(120.0);

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
TEST(a_stop_is_taken_at_the_end_of_the_step)
{
    const struct robot_stop stop = {.stiffness = 1e5, .damping = 100.0};
    const double lower = -0.3, upper = 0.9, h = 1e-3;

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

/* A stop that has pushed in an earlier stage may take that much back in this one, and no more. */
TEST(a_stop_takes_back_no_more_than_it_has_pushed)
{
    const struct robot_stop stop = {.stiffness = 1e5, .damping = 100.0};
    const double lower = -0.3, upper = 0.9, h = 1e-3;

    for (int side = -1; side <= 1; side += 2) {
        const double limit = side > 0 ? upper : lower, earlier = -50.0 * side;

        for (double rate = 0.0; rate >= -3.0; rate -= 0.125) {
            const double own = rate * side, depth = h * own;
            const double torque = -stop.stiffness * depth - stop.damping * own;
            struct stop_step step;

            /* Within its range and on its way back, where the stop would not begin */
            stop_step_begin(&stop, lower, upper, limit, own, h, &step);
            assert_int_equal(step.side, 0);
            stop_step_continue(&stop, lower, upper, limit, own, h, side, earlier, &step);
            assert_int_equal(step.side, side);
            assert_near(step.torque, torque, 1e-9);
            assert_true(stop_step_revise(&stop, lower, upper, limit, own, h, 0.0, &step) ==
                        (torque * side > 50.0));
        }
    }
}

TEST(a_parallel_spring_is_taken_at_the_end_of_the_step)
{
    const struct robot_parallel_spring spring = {
        .present = true, .enabled = true, .k_p = 2000.0, .d_p = 10.0, .r = 0.05, .s = -1.0};
    const double p = -0.01, pd = 0.02, q = -0.1, qd = 0.4, h = 1e-3, qdd = -80.0;
    double qd_end = qd + h * qdd, torque, extra;

    parallel_spring_step(&spring, p, pd, q, qd, h, &torque, &extra);
    assert_near(torque - extra * qdd,
                parallel_spring_torque(&spring, p + h * pd, pd, q + h * qd_end, qd_end), 1e-12);
    parallel_spring_step(&spring, 0.1, pd, q, qd, h, &torque, &extra);
    assert_near(torque, 0.0, 0.0);
    assert_near(extra, 0.0, 0.0);
}
