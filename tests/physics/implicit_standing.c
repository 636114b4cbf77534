/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN on Simbody's contact with the implicit integrator at a millisecond: stands, and does not
 * chatter on friction that is stiffer than its step by far.
 */
#include <math.h>

#include "tests/physics/near.h"
#include "tests/physics/standing.h"
#include "tests/test.h"

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
