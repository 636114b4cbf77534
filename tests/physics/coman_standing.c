/* SPDX-License-Identifier: Apache-2.0 */
/*
 * COMAN on its two foot meshes on Simbody's contact: stands still in its crouch, the ground carries
 * its weight, the force-torque sensors agree, and the energy balance closes, which says that the
 * step is short enough for the contact's friction.
 */
#include <math.h>
#include <string.h>

#include "tests/physics/near.h"
#include "tests/physics/standing.h"
#include "tests/test.h"

static const char *const sensor_names[STANDING_FEET] = {"r_leg_ft", "l_leg_ft"};

TEST(ground_carries_the_weight_of_the_standing_robot)
{
    const struct standing_choice choice = {
        .integrator = PLANT_RK4, .substep_ns = 250000, .transition_velocity_m_s = 0.1};
    static struct standing standing;
    const struct contact_wrench *wrench;
    const struct plant_sensors *sensors;
    struct plant_energy energy;
    double weight, carried = 0.0, felt = 0.0, expected, centre[3], momentum[3], start[3];

    standing_init(&standing, &choice);
    plant_center_of_mass(standing.plant, start, momentum);
    standing_hold(&standing, 800);
    weight = -standing.robot->total_mass * standing.robot->gravity[2];
    expected = weight;
    wrench = plant_contact_wrenches(standing.plant);
    sensors = plant_sensors(standing.plant);
    for (int f = 0; f < STANDING_FEET; f++) {
        carried += wrench[f].force[2];
        for (size_t s = 0; s < standing.robot->nft; s++) {
            if (strcmp(standing.robot->ft[s].name, sensor_names[f]) == 0) {
                felt += sensors->ft[s].force_n[2];
                expected += standing.robot->ft[s].distal.mass * standing.robot->gravity[2];
            }
        }
    }
    plant_center_of_mass(standing.plant, centre, momentum);
    assert_int_equal(plant_energy(standing.plant, &energy), ERROR_NONE);
    print_message(
        "# ground %.3f N of %.3f, sensors %.3f N of %.3f; center of mass moved %.4f m and "
        "has %.1e kg m/s; balance %.1e J of %.1f J\n",
        carried, weight, felt, expected, centre[0] - start[0], sqrt(vec3_dot(momentum, momentum)),
        energy.balance, energy.joule_heat);
    assert_near(carried, weight, 1e-3 * weight);
    assert_near(felt, expected, 1e-3 * weight);
    assert_near(centre[0], start[0], 0.02);
    assert_near(centre[2], start[2], 0.01);
    assert_near(energy.balance, 0.0, 1e-3); /* a step too long for the friction loses joules */
    standing_fini(&standing);
}
