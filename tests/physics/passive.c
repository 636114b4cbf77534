/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Passive springs of joints in motion, against closed forms: a wheel that swings on one, with and
 * without damping; what is stored and lost; an arm that hangs on one at rest; a cable that helps a
 * drive to hold.
 */
#include "model/settle.h"

#include "tests/physics/near.h"
#include "tests/physics/toy_plant.h"

static struct error error;

#define INERTIA 0.08 /* kg m2, about the joint */
#define REST 0.2     /* rad */

static const double origin[3] = {0.0, 0.0, 0.0}, pitch[3] = {0.0, 1.0, 0.0};

/* Makes the body: its center of mass is `arm` beside the joint, along x. */
static void sprung_init(struct toy_plant *sprung, enum plant_integrator integrator,
                        int64_t substep_ns, double arm, struct robot_passive passive,
                        struct robot_sea drive)
{
    static const double base[6] = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0};
    const double own[6] = {0.05, 0.0, 0.0, INERTIA - 2.0 * arm * arm, 0.0, 0.05};
    const double com[3] = {arm, 0.0, 0.0};

    toy_plant_begin(sprung, integrator, substep_ns);
    toy_begin(&sprung->toy, false, 1.0, origin, base);
    toy_add(&sprung->toy, 0, JOINT_REVOLUTE, pitch, origin, 2.0, com, own);
    sprung->toy.joint[0].passive = passive;
    sprung->toy.joint[0].sea = drive;
    toy_plant_open(sprung);
}

/* x = q - rest follows I x'' = -K x - D x': from x_0 at rest
 * x = x_0 e^(-a t) (cos(w t) + a/w sin(w t)) with a = D/(2 I), w^2 = K/I - a^2. */
TEST(wheel_swings_as_the_closed_form)
{
    const struct {
        enum plant_integrator integrator;
        int64_t substep_ns;
        double tolerance;
    } run[] = {{PLANT_DOPRI5, 1000000, 1e-8},
               {PLANT_RK4, 100000, 1e-8},
               {PLANT_IMPLICIT, 1000000, 1.2e-2},
               {PLANT_IMPLICIT, 100000, 1.2e-4}};
    const double x0 = 0.05, whole = 60.0;

    for (int damped = 0; damped < 2; damped++) {
        const double K = whole * whole * INERTIA, D = damped ? 0.1 * whole * INERTIA : 0.0;
        const double a = D / (2.0 * INERTIA), w = sqrt(K / INERTIA - a * a);

        for (size_t i = 0; i < sizeof run / sizeof *run; i++) {
            const struct robot_passive passive = {.stiffness = K, .damping = D, .rest = REST};
            const double joint = REST + x0;
            struct toy_plant sprung;
            double worst = 0.0;

            sprung_init(&sprung, run[i].integrator, run[i].substep_ns, 0.0, passive,
                        (struct robot_sea){0});
            assert_ok(plant_reset(sprung.plant, NULL, NULL, &joint));
            for (int64_t ns = run[i].substep_ns; ns <= 1000000000; ns += run[i].substep_ns) {
                const double t = 1e-9 * (double)ns;
                const double x = x0 * exp(-a * t) * (cos(w * t) + a / w * sin(w * t));

                assert_ok(plant_step(sprung.plant, 1));
                worst = fmax(worst, fabs(sprung.state[0] - REST - x) / x0);
            }
            print_message("# integrator %d, %lld ns, D %g: off by %.1e of the amplitude\n",
                          (int)run[i].integrator, (long long)run[i].substep_ns, D, worst);
            assert_true(worst <= run[i].tolerance);
            arena_fini(&sprung.arena);
        }
    }
}

/* What the spring had is in the damper when all has come to rest. */
TEST(damper_takes_what_the_spring_had)
{
    static const enum plant_integrator all[] = {PLANT_RK4, PLANT_DOPRI5, PLANT_IMPLICIT};
    const double K = 100.0, joint = REST + 0.1, stored = 0.5 * K * 0.1 * 0.1;

    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        struct plant_energy energy;
        struct toy_plant sprung;

        sprung_init(&sprung, all[i], 200000, 0.0, (struct robot_passive){K, 0.5, REST},
                    (struct robot_sea){0});
        assert_ok(plant_reset(sprung.plant, NULL, NULL, &joint));
        assert_ok(plant_energy(sprung.plant, &energy));
        assert_near(energy.stored, stored, 1e-12);
        assert_ok(plant_step(sprung.plant, 50000));
        assert_ok(plant_energy(sprung.plant, &energy));
        assert_near(sprung.state[0], REST, 1e-9);
        assert_near(energy.spring_damping, stored, 2e-4 * stored);
        assert_near(energy.balance, 0.0, 2e-4 * stored);
        arena_fini(&sprung.arena);
    }
}

/* An arm without a drive hangs where K (q - rest) = m g c cos(q), and stays there. */
TEST(settled_arm_hangs_on_its_spring)
{
    const double K = 80.0, start = 0.0, arm = 0.15;
    struct settled settled;
    struct toy_plant sprung;
    double before;

    sprung_init(&sprung, PLANT_IMPLICIT, 1000000, arm, (struct robot_passive){K, 1.0, REST},
                (struct robot_sea){0});
    assert_ok(plant_reset(sprung.plant, NULL, NULL, &start));
    assert_no_error(plant_settle(sprung.plant, &sprung.arena, &settled, &error), error.text);
    assert_near(K * (sprung.state[0] - REST), 2.0 * 9.81 * arm * cos(sprung.state[0]), 1e-8);
    assert_ok(plant_sample(sprung.plant));
    assert_near(plant_sensors(sprung.plant)->motor[0].torque_nm, -K * (sprung.state[0] - REST),
                1e-12);
    before = sprung.state[0];
    assert_ok(plant_step(sprung.plant, 2000));
    assert_near(sprung.state[0], before, 1e-9);
    arena_fini(&sprung.arena);
}

/* Beside a drive a spring bears its part of the load; the sensor in the drive sees the rest. */
TEST(cable_helps_the_drive)
{
    const double K = 5.0, start = 0.4, arm = 0.15;
    struct settled settled;
    struct toy_plant sprung;

    sprung_init(&sprung, PLANT_IMPLICIT, 1000000, arm, (struct robot_passive){K, 0.1, REST},
                toy_drive(400.0));
    assert_ok(plant_reset(sprung.plant, NULL, NULL, &start));
    assert_no_error(plant_settle(sprung.plant, &sprung.arena, &settled, &error), error.text);
    assert_near(sprung.state[0], start, 0.0);
    assert_ok(plant_sample(sprung.plant));
    assert_near(plant_sensors(sprung.plant)->motor[0].torque_nm,
                K * (start - REST) - 2.0 * 9.81 * arm * cos(start), 1e-9);
    assert_ok(plant_step(sprung.plant, 2000));
    assert_near(sprung.state[0], start, 1e-9);
    arena_fini(&sprung.arena);
}
