/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The stability map of the default integrator: the spectral radius of one step of 1 ms for a link
 * on a series elastic drive, over the frequencies of the link and of the rotor on the spring.
 * Prints the map of docs/integrator.md.
 */

#include "tests/physics/free_rig.h"
#include "tests/physics/near.h"

enum { MS = 1000000, MOST = 8 };

/* The largest modulus of an eigenvalue of A (n x n): the root of the norm of A^(2^k). */
static double spectral_radius(size_t n, double A[MOST][MOST])
{
    enum { SQUARINGS = 40 };
    double logarithm = 0.0;

    for (int k = 0; k < SQUARINGS; k++) {
        double product[MOST][MOST] = {{0.0}}, norm = 0.0;

        for (size_t i = 0; i < n; i++) {
            for (size_t j = 0; j < n; j++) {
                for (size_t m = 0; m < n; m++) {
                    product[i][j] += A[i][m] * A[m][j];
                }
                norm = fmax(norm, fabs(product[i][j]));
            }
        }
        if (norm == 0.0) {
            return 0.0;
        }
        logarithm = 2.0 * logarithm + log(norm);
        for (size_t i = 0; i < n; i++) {
            for (size_t j = 0; j < n; j++) {
                A[i][j] = product[i][j] / norm;
            }
        }
    }
    return exp(ldexp(logarithm, -SQUARINGS));
}

/* A link of inertia 1 without weight on a drive whose spring makes it swing at link rad/s and the
 * rotor at rotor rad/s; no damping but the step's, the winding shorted. */
static double drive_radius(double link, double rotor)
{
    const double none[3] = {0.0, 0.0, 0.0}, y[3] = {0.0, 1.0, 0.0};
    const double I[6] = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0};
    struct toy toy;
    struct arena arena;
    struct dynamics dynamics;
    struct plant_config config = {.robot = &toy.robot,
                                  .dynamics = &dynamics,
                                  .integrator = PLANT_IMPLICIT,
                                  .substep_ns = MS,
                                  .supply_v = 48.0};
    struct robot_sea *sea;
    struct plant *plant;
    struct error error;
    double *state, A[MOST][MOST];
    size_t count;

    toy_begin(&toy, false, 1.0, none, I);
    sea = &toy.joint[toy_add(&toy, 0, JOINT_REVOLUTE, y, none, 1.0, none, I)].sea;
    *sea = toy_drive(link * link);
    sea->J = link * link / (rotor * rotor);
    sea->Ds = sea->Dm = 0.0;
    toy_finish(&toy);
    assert_ok(arena_init(&arena, 1 << 20, &error));
    assert_ok(dynamics_generic(&toy.robot, &arena, &dynamics, &error));
    assert_ok(plant_create(&config, &arena, &plant, &error));
    state = plant_state(plant, &count);
    assert_int_equal(count, 5);
    for (size_t j = 0; j < count; j++) {
        assert_ok(plant_reset(plant, NULL, NULL, (const double[1]){0.0}));
        state[j] = 1e-3;
        assert_ok(plant_step(plant, 1));
        for (size_t i = 0; i < count; i++) {
            A[i][j] = 1e3 * state[i];
        }
    }
    arena_fini(&arena);
    return spectral_radius(count, A);
}

TEST(a_link_on_its_drive_is_stable)
{
    const double frequency[] = {30.0, 100.0, 300.0, 1e3, 3e3, 1e4, 1e5, 1e6};

    double worst = 0.0;

    print_message(
        "# rotor, rad/s: spectral radius for the link at 30, 100, 300, 1e3, 3e3, 1e4, 1e5, "
        "1e6 rad/s\n");
    for (int r = 0; r < 6; r++) {
        char line[128] = "";

        for (int l = 0; l < 8; l++) {
            const double radius = drive_radius(frequency[l], frequency[r]);

            snprintf(line + strlen(line), sizeof line - strlen(line), " %.8f", radius);
            worst = fmax(worst, radius);
        }
        print_message("# %6g %s\n", frequency[r], line);
    }
    /* Without any damping an exact rotor on an unresolved link grows by less than this a step; the
     * springs' own damping is thousands of times as much */
    assert_true(worst <= 1.0 + 1e-6);
}
