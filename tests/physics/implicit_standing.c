/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN on Simbody's contact with the implicit integrator at a millisecond: stands, does not
 * chatter on friction that is stiffer than its step by far, and bends its knees as rk4 says.
 */
#include <math.h>
#include <time.h>

#include "tests/physics/near.h"
#include "tests/physics/standing.h"
#include "tests/test.h"

#define PI 3.14159265358979323846

static double carried_z(const struct standing *standing)
{
    const struct contact_wrench *wrench = plant_contact_wrenches(standing->plant);

    return wrench[0].force[2] + wrench[1].force[2];
}

TEST(it_stands_on_the_ground_for_two_seconds)
{
    const struct standing_choice choice = {
        .integrator = PLANT_IMPLICIT, .substep_ns = 1000000, .transition_velocity_m_s = 0.1};
    static struct standing standing;
    double weight, start[3], end[3], momentum[3];

    standing_init(&standing, &choice);
    plant_center_of_mass(standing.plant, start, momentum);
    standing_hold(&standing, 2000);
    plant_center_of_mass(standing.plant, end, momentum);
    weight = -standing.robot->total_mass * standing.robot->gravity[2];
    print_message("# ground carries %.3f N of %.3f N, center of mass moved %.4f m\n",
                  carried_z(&standing), weight, end[0] - start[0]);
    assert_near(carried_z(&standing), weight, 1e-3 * weight);
    assert_near(end[0], start[0], 0.01);
    assert_near(end[2], start[2], 0.01);
    standing_fini(&standing);
}

/* With a transition velocity of 1 cm/s friction is a damper with a time constant of some 20 us on a
 * foot, and with 1 mm/s of 2 us: rk4 would need steps as short. Chatter is force on the feet that
 * changes from step to step. */
TEST(friction_does_not_chatter_at_a_millisecond)
{
    const double transition[] = {0.01, 0.001};

    for (int n = 0; n < 2; n++) {
        const struct standing_choice choice = {.integrator = PLANT_IMPLICIT,
                                               .substep_ns = 1000000,
                                               .transition_velocity_m_s = transition[n]};
        static struct standing standing;
        double last[2][3], jump = 0.0, speed = 0.0;

        standing_init(&standing, &choice);
        standing_hold(&standing, 100);
        for (int k = 0; k < 200; k++) {
            const struct contact_wrench *wrench = plant_contact_wrenches(standing.plant);

            for (int f = 0; f < 2; f++) {
                memcpy(last[f], wrench[f].force, sizeof last[f]);
            }
            standing_hold(&standing, 1);
            for (int f = 0; f < 2; f++) {
                const double *v = plant_motion(standing.plant)[standing.foot[f]].v;

                for (int i = 0; i < 3; i++) {
                    jump = fmax(jump, fabs(wrench[f].force[i] - last[f][i]));
                }
                speed = fmax(speed, hypot(v[0], v[1]));
            }
        }
        print_message("# transition %g m/s: force changes by at most %.3f N a step, feet slide at "
                      "%.1e m/s\n",
                      transition[n], jump, speed);
        assert_true(jump < 1.0);
        assert_true(speed < transition[n]);
        standing_fini(&standing);
    }
}

enum { SAMPLES = 600, FIRST = 200, MOST = 32 }; /* FIRST: after the transient */

struct track {
    double q[SAMPLES][MOST], fz[SAMPLES];
    double seconds; /* of the machine, for the steps */
};

/* Bends hips, knees and ankles by up to 0.15 rad and back within 0.6 s. */
static void bend(const struct standing_choice *choice, struct track *track)
{
    static const char *const names[] = {"RHipSag", "RKneeSag", "RAnkSag",
                                        "LHipSag", "LKneeSag", "LAnkSag"};
    static const double share[] = {-0.15, 0.3, -0.15, -0.15, 0.3, -0.15};
    static struct standing standing;
    struct timespec begin, end;
    double pose[STANDING_COORDINATES];

    standing_init(&standing, choice);
    memcpy(pose, standing.reference, sizeof pose);
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (int k = 0; k < SAMPLES; k++) {
        for (int n = 0; n < 6; n++) {
            int j = robot_find_joint(standing.robot, names[n]);

            standing.reference[j] = pose[j] + 0.5 * share[n] * (1.0 - cos(2.0 * PI * k / SAMPLES));
        }
        standing_hold(&standing, 1);
        for (size_t j = 0; j < standing.robot->njoint; j++) {
            track->q[k][j] = plant_sensors(standing.plant)->motor[j].q;
        }
        track->fz[k] = carried_z(&standing);
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    track->seconds =
        (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec);
    standing_fini(&standing);
}

/* The bounds that the real-time plant has to keep: 2e-3 rad of any joint, 2 % of the foot force. */
TEST(bending_its_knees_it_is_where_rk4_is)
{
    static const int64_t substep[] = {1000000, 500000, 250000};
    static struct track reference, found;
    struct standing_choice choice = {
        .integrator = PLANT_RK4, .substep_ns = 125000, .transition_velocity_m_s = 0.1};

    bend(&choice, &reference);
    choice.integrator = PLANT_IMPLICIT;
    for (int n = 0; n < 3; n++) {
        double worst = 0.0, force = 0.0, size = 0.0;

        choice.substep_ns = substep[n];
        bend(&choice, &found);
        for (int j = 0; j < MOST; j++) {
            double sum = 0.0;

            for (int k = FIRST; k < SAMPLES; k++) {
                double difference = found.q[k][j] - reference.q[k][j];

                sum += difference * difference;
            }
            worst = fmax(worst, sqrt(sum / (SAMPLES - FIRST)));
        }
        for (int k = FIRST; k < SAMPLES; k++) {
            force += (found.fz[k] - reference.fz[k]) * (found.fz[k] - reference.fz[k]);
            size += reference.fz[k] * reference.fz[k];
        }
        print_message("# h = %.2f ms: worst joint %.2e rad RMS, foot force %.2f %% RMS; takes %.0f "
                      "%% of the time of rk4 with 0.125 ms\n",
                      1e-6 * (double)substep[n], worst, 100.0 * sqrt(force / size),
                      100.0 * found.seconds / reference.seconds);
        assert_true(worst < 2e-3);
        assert_true(sqrt(force / size) < 0.02);
    }
}
