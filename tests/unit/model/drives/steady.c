/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Steady states against their closed forms: Coulomb's friction c, viscous Dm, and a share k of both
 * torques that the gear carries, F = c + k (motor + load); a gear that locks itself; no effects.
 */

#include "model/drives/steady.h"
#include "tests/physics/near.h"
#include "tests/test.h"

static const double c = 0.2, k = 0.1, Dm = 0.05, Kt = 0.5, Kw = 0.6, R = 2.0;

static const struct robot_effects effects = {
    .coulomb = 0.2, .breakaway = 0.2, .load = {.motor = 0.1, .external = 0.1}};
static const struct robot_sea sea = {
    .present = true, .Dm = 0.05, .Kt = 0.5, .Kw = 0.6, .R = 2.0, .effects = &effects};

TEST(loads_and_motors_are_as_written_out)
{
    for (double speed = 0.0; speed < 3.0; speed += 1.5) {
        const double loss = c + Dm * speed, motor = 5.0, load = 3.0;

        assert_near(steady_load(&sea, motor, speed, 1), (motor * (1.0 - k) - loss) / (1.0 + k),
                    1e-12);
        assert_near(steady_load(&sea, motor, speed, -1), (motor * (1.0 + k) + loss) / (1.0 - k),
                    1e-12);
        assert_near(steady_motor(&sea, load, speed, 1), (load * (1.0 + k) + loss) / (1.0 - k),
                    1e-12);
        assert_near(steady_motor(&sea, load, speed, -1), (load * (1.0 - k) - loss) / (1.0 + k),
                    1e-12);
    }
}

TEST(a_voltage_turns_a_load_at_one_speed)
{
    /* Kt (V - Kw w) / R (1 - k) = c + Dm w + (1 + k) load */
    const double voltage = 12.0, load = 1.0, part = Kt / R * (1.0 - k);
    const double speed = (part * voltage - c - (1.0 + k) * load) / (part * Kw + Dm);

    assert_near(steady_speed(&sea, voltage, load), speed, 1e-12);
    assert_true(isnan(steady_speed(&sea, voltage, 3.0)));
}

TEST(what_does_not_move_is_no_number)
{
    struct robot_effects locked = effects;
    struct robot_sea worm = sea;

    assert_true(isnan(steady_load(&sea, 0.1, 0.0, 1))); /* less than c */
    locked.load.external = 1.2;
    worm.effects = &locked;
    assert_true(isnan(steady_load(&worm, 1.0, 0.0, -1)));
}

TEST(a_drive_without_effects_has_viscous_losses_alone)
{
    struct robot_sea plain = sea;

    plain.effects = NULL;
    assert_near(steady_load(&plain, 5.0, 2.0, 1), 4.9, 1e-12);
    assert_near(steady_load(&plain, 5.0, 40.0, 1), 3.0, 1e-12);
    assert_true(isnan(steady_load(&plain, 1.9, 40.0, 1))); /* less than Dm w = 2 */
    assert_near(steady_speed(&plain, 12.0, 0.0), 3.0 / (0.15 + Dm), 1e-12);
}
