/* SPDX-License-Identifier: Apache-2.0 */
/* The law of couplings, and the system of their forces against a dense solution of the whole. */
#include "model/coupling.h"

#include "tests/physics/near.h"
#include "tests/test.h"

enum { JOINTS = 6, COUPLINGS = 3 };

static struct robot_coupling couplings[COUPLINGS] = {
    {.follower = 1, .leader = 0, .multiplier = -2.0, .offset = 0.1, .stiffness = 50, .damping = 2},
    {.follower = 4, .leader = 0, .multiplier = 0.5, .offset = 0.0, .stiffness = 70, .damping = 0},
    {.follower = 2, .leader = 5, .multiplier = 1.0, .offset = -0.3, .stiffness = 9, .damping = 1},
};
static const struct robot robot = {
    .njoint = JOINTS, .nq = JOINTS, .nv = JOINTS, .coupling = couplings, .ncoupling = COUPLINGS};

TEST(force_presses_follower_back_and_leader_on)
{
    const struct robot_coupling *c = &couplings[0];
    const double q[JOINTS] = {0.2, 0.1}, qd[JOINTS] = {1.0, 0.5};
    double torque[JOINTS] = {0.0}, force;

    assert_near(coupling_error(c, q), 0.1 + 0.4 - 0.1, 1e-15);
    assert_near(coupling_rate(c, qd), 2.5, 1e-15);
    force = coupling_force(c, 0.4, 2.5);
    assert_near(force, 50 * 0.4 + 2 * 2.5, 1e-12);
    coupling_press(c, force, torque);
    assert_near(torque[1], -force, 0.0);
    assert_near(torque[0], -2.0 * force, 0.0);

    /* What it takes from the joints is what its damper turns into heat and its spring takes up */
    assert_near(-(torque[0] * qd[0] + torque[1] * qd[1]), coupling_loss(c, 2.5) + 50 * 0.4 * 2.5,
                1e-12);
    assert_near(coupling_energy(c, 0.4), 4.0, 1e-12);
}

TEST(aligned_followers_have_no_error)
{
    double q[JOINTS] = {0.3, 9.0, 9.0, 0.7, 9.0, -0.2};

    coupling_align(&robot, q);
    for (int i = 0; i < COUPLINGS; i++) {
        assert_near(coupling_error(&couplings[i], q), 0.0, 1e-15);
    }
    assert_near(q[0], 0.3, 0.0);
    assert_near(q[3], 0.7, 0.0);
    assert_near(q[5], -0.2, 0.0);
}

/* Gaussian elimination of a dense system, with the largest pivot of each column. */
static void solve_dense(double A[JOINTS][JOINTS], double *b)
{
    for (int k = 0; k < JOINTS; k++) {
        int best = k;

        for (int i = k + 1; i < JOINTS; i++) {
            best = fabs(A[i][k]) > fabs(A[best][k]) ? i : best;
        }
        for (int j = 0; j < JOINTS; j++) {
            const double swap = A[k][j];

            A[k][j] = A[best][j];
            A[best][j] = swap;
        }
        {
            const double swap = b[k];

            b[k] = b[best];
            b[best] = swap;
        }
        for (int i = 0; i < JOINTS; i++) {
            const double factor = i == k ? 0.0 : A[i][k] / A[k][k];

            for (int j = k; j < JOINTS; j++) {
                A[i][j] -= factor * A[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    for (int k = 0; k < JOINTS; k++) {
        b[k] /= A[k][k];
    }
}

/* A mass matrix with all joints joined: positive definite. */
static double mass(int i, int j)
{
    return (i == j ? 2.0 + 0.3 * i : 0.0) + 1.0 / (1.0 + i + j);
}

static void fill_mass(double A[JOINTS][JOINTS])
{
    for (int i = 0; i < JOINTS; i++) {
        for (int j = 0; j < JOINTS; j++) {
            A[i][j] = mass(i, j);
        }
    }
}

/* (M + sum c w w^T) a = b - sum w s0 in one piece, and by the forces of the couplings. */
TEST(forces_solve_the_whole_system)
{
    const double b[JOINTS] = {1.0, -2.0, 0.5, 3.0, -1.0, 0.7}, pull[COUPLINGS] = {0.3, -4.0, 1.0};

    for (double stiff = 1e-3; stiff <= 1e9; stiff *= 1e3) {
        double column[COUPLINGS * JOINTS], factor[COUPLINGS * COUPLINGS], A[JOINTS][JOINTS];
        double compliance[COUPLINGS], c[COUPLINGS], force[COUPLINGS], a[JOINTS], exact[JOINTS];

        /* Columns and accelerations of M alone */
        for (int i = 0; i < COUPLINGS; i++) {
            double *w = column + JOINTS * i;

            memset(w, 0, JOINTS * sizeof *w);
            coupling_press(&couplings[i], -1.0, w);
            fill_mass(A);
            solve_dense(A, w);
            compliance[i] = 1.0 / (stiff * (1 + i));
            c[i] = pull[i] * compliance[i];
        }
        memcpy(a, b, sizeof a);
        fill_mass(A);
        solve_dense(A, a);
        coupling_factorize(&robot, column, compliance, factor);
        coupling_correct(&robot, column, factor, c, force, a);

        /* The whole */
        memcpy(exact, b, sizeof exact);
        fill_mass(A);
        for (int i = 0; i < COUPLINGS; i++) {
            double w[JOINTS] = {0.0};

            coupling_press(&couplings[i], -1.0, w);
            for (int r = 0; r < JOINTS; r++) {
                exact[r] -= w[r] * pull[i];
                for (int k = 0; k < JOINTS; k++) {
                    A[r][k] += stiff * (1 + i) * w[r] * w[k];
                }
            }
        }
        solve_dense(A, exact);
        for (int j = 0; j < JOINTS; j++) {
            assert_near(a[j], exact[j], 1e-12 + 1e-15 * stiff);
        }

        /* Each force is that of its own law at those accelerations */
        for (int i = 0; i < COUPLINGS && stiff < 1e6; i++) {
            assert_near(force[i], pull[i] + coupling_rate(&couplings[i], a) / compliance[i],
                        1e-12 * fmax(1.0, stiff));
        }
    }
}

/* Without compliance followers accelerate as their leaders say, to rounding. */
TEST(rigid_couplings_hold_followers)
{
    double column[COUPLINGS * JOINTS], factor[COUPLINGS * COUPLINGS], A[JOINTS][JOINTS];
    double force[COUPLINGS], a[JOINTS] = {1.0, -2.0, 0.5, 3.0, -1.0, 0.7};
    const double none[COUPLINGS] = {0.0};

    for (int i = 0; i < COUPLINGS; i++) {
        memset(column + JOINTS * i, 0, JOINTS * sizeof *column);
        coupling_press(&couplings[i], -1.0, column + JOINTS * i);
        fill_mass(A);
        solve_dense(A, column + JOINTS * i);
    }
    coupling_factorize(&robot, column, none, factor);
    coupling_correct(&robot, column, factor, none, force, a);
    for (int i = 0; i < COUPLINGS; i++) {
        assert_near(coupling_rate(&couplings[i], a), 0.0, 1e-14);
    }
}
