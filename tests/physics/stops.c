/* SPDX-License-Identifier: Apache-2.0 */
/*
 * End stops and spring stops in motion: a body that turns freely between its limits against the
 * closed form of the stop's law, with every integrator; a robot that falls over its stops; a drive
 * that presses its spring beyond the room that it has.
 */
#include "model/drives/actuator.h"
#include "model/settle.h"
#include "model/spatial.h"
#include "model/stop.h"

#include "tests/physics/plant_rig.h"
#include "tests/physics/toy_plant.h"

/* A wheel on a fixed base with its range off the middle and all on one side of zero. */
#define INERTIA 0.08
#define LOWER 0.2
#define UPPER 0.9
static const struct robot_stop wheel_stop = {.stiffness = 2e4, .damping = 30.0};

static void wheel_init_driven(struct toy_plant *wheel, enum plant_integrator integrator,
                              int64_t substep_ns, const double com[3], struct robot_sea sea)
{
    static const double origin[3] = {0.0, 0.0, 0.0}, axis[3] = {0.0, 1.0, 0.0};
    static const double base[6] = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0};
    static const double own[6] = {0.05, 0.0, 0.0, INERTIA, 0.0, 0.05};

    toy_plant_begin(wheel, integrator, substep_ns);
    wheel->config.rtol = wheel->config.atol = 1e-10;
    toy_begin(&wheel->toy, false, 1.0, origin, base);
    toy_add(&wheel->toy, 0, JOINT_REVOLUTE, axis, origin, 2.0, com, own);
    wheel->toy.joint[0].lower = LOWER;
    wheel->toy.joint[0].upper = UPPER;
    wheel->toy.joint[0].stop = wheel_stop;
    wheel->toy.joint[0].sea = sea;
    toy_plant_open(wheel);
}

static void wheel_init(struct toy_plant *wheel, enum plant_integrator integrator,
                       int64_t substep_ns, const double com[3])
{
    wheel_init_driven(wheel, integrator, substep_ns, com, (struct robot_sea){0});
}

/* Turns at the given rate from the angle q. */
static void wheel_throw(struct toy_plant *wheel, double q, double rate)
{
    assert_ok(plant_reset(wheel->plant, NULL, NULL, &q));
    wheel->state[1] = rate;
    assert_ok(plant_restart_energy(wheel->plant));
}

/* What a throw against a stop comes to. */
struct impact {
    double depth, restitution, balance, loss;
};

/* From 0.1 rad before a limit, until the wheel is back there; side 1 = the upper one. */
static struct impact wheel_hit(struct toy_plant *wheel, int side, double rate)
{
    double limit = side > 0 ? UPPER : LOWER;
    struct impact impact = {0};
    struct plant_energy energy;

    wheel_throw(wheel, limit - 0.1 * side, side * rate);
    for (int k = 0; k < 1000000 && (k == 0 || side * (wheel->state[0] - limit) > -0.1); k++) {
        assert_ok(plant_step(wheel->plant, 1));
        impact.depth = fmax(impact.depth, side * (wheel->state[0] - limit));
    }
    assert_ok(plant_energy(wheel->plant, &energy));
    impact.restitution = -side * wheel->state[1] / rate;
    impact.balance = energy.balance;
    impact.loss = energy.stop_loss;
    return impact;
}

/* I x'' = -k x - d x' from x = 0 until the force is zero: x' turns at w t = acos(z) / sqrt(1 - z^2)
 * with the damping ratio z, and the force is zero at twice that time, with the rate left over
 * exp(-2 z acos(z) / sqrt(1 - z^2)). */
static struct impact exact_impact(double rate)
{
    double w = sqrt(wheel_stop.stiffness / INERTIA);
    double z = wheel_stop.damping / (2.0 * sqrt(wheel_stop.stiffness * INERTIA));
    double t = acos(z) / sqrt(1.0 - z * z);
    struct impact impact = {.depth = rate / w * exp(-z * t), .restitution = exp(-2.0 * z * t)};

    impact.loss = 0.5 * INERTIA * rate * rate * (1.0 - impact.restitution * impact.restitution);
    return impact;
}

static void assert_impact(enum plant_integrator integrator, int64_t substep_ns, double tolerance)
{
    struct toy_plant wheel;

    wheel_init(&wheel, integrator, substep_ns, (const double[3]){0.0, 0.0, 0.0});
    for (int side = -1; side <= 1; side += 2) {
        struct impact exact = exact_impact(6.0), found = wheel_hit(&wheel, side, 6.0);

        print_message("# side %+d, %d: depth %.6f of %.6f rad, restitution %.5f of %.5f, loss %.5f "
                      "of %.5f J, balance %.1e J\n",
                      side, (int)integrator, found.depth, exact.depth, found.restitution,
                      exact.restitution, found.loss, exact.loss, found.balance);
        assert_near(found.depth, exact.depth, tolerance * exact.depth);
        assert_near(found.restitution, exact.restitution, tolerance);
        assert_near(found.loss, exact.loss, tolerance * exact.loss);
        assert_near(found.balance, 0.0, tolerance * exact.loss);
    }
    arena_fini(&wheel.arena);
}

TEST(an_impact_is_that_of_the_closed_form)
{
    assert_impact(PLANT_DOPRI5, 10000, 1e-5);
    assert_impact(PLANT_RK4, 10000, 2e-3); /* the damper begins within a step */
    assert_impact(PLANT_IMPLICIT, 2000, 2e-2);
}

/* At the millisecond of real time: whatever the speed, no deeper than exactly, no faster back, but
 * for what slow ones do whose strike divides no step. */
TEST(long_steps_stay_at_the_stop)
{
    double depth[2] = {0.0, 0.0}, restitution[2] = {0.0, 0.0};
    struct toy_plant wheel;

    wheel_init(&wheel, PLANT_IMPLICIT, 1000000, (const double[3]){0.0, 0.0, 0.0});
    for (double rate = 0.01; rate < 100.0; rate *= 1.37) {
        for (int side = -1; side <= 1; side += 2) {
            struct impact exact = exact_impact(rate), found = wheel_hit(&wheel, side, rate);
            const bool slow = rate < 1.0;

            depth[slow] = fmax(depth[slow], found.depth / exact.depth);
            restitution[slow] = fmax(restitution[slow], found.restitution);
            assert_true(found.restitution > 0.0);
        }
    }
    print_message(
        "# depths up to %.3f times the exact ones, slow ones %.3f; restitution up to %.3f "
        "and %.3f of %.3f\n",
        depth[0], depth[1], restitution[0], restitution[1], exact_impact(1.0).restitution);
    assert_true(depth[0] <= 1.05 && restitution[0] <= exact_impact(1.0).restitution + 0.03);
    assert_true(depth[1] <= 1.2 && restitution[1] <= exact_impact(1.0).restitution + 0.08);
    arena_fini(&wheel.arena);
}

/* The law by itself: against the depth or nothing, for any rate; never a gain. */
TEST(a_stop_never_pulls)
{
    for (double depth = -0.02; depth <= 0.02; depth += 0.0005) {
        for (double rate = -50.0; rate <= 50.0; rate += 0.7) {
            double torque = stop_torque(&wheel_stop, depth, rate);
            double inner = wheel_stop.stiffness * depth + wheel_stop.damping * rate;

            assert_true(torque * depth <= 0.0);
            assert_near(torque, depth * inner > 0.0 ? -inner : 0.0, 0.0);
            assert_true(stop_loss(&wheel_stop, depth, rate) >= 0.0);
        }
    }
    assert_near(stop_torque(&wheel_stop, 0.0, 3.0), 0.0, 0.0);
    assert_near(stop_depth(-1.0, 2.0, 2.5), 0.5, 0.0);
    assert_near(stop_depth(-1.0, 2.0, -1.5), -0.5, 0.0);
    assert_near(stop_depth(-1.0, 2.0, -0.5), 0.0, 0.0);
}

/* A pendulum that gravity turns back just before the limit moves as if there were no stop, though
 * its rate at the begin of the step leads past it. */
TEST(a_stop_that_would_pull_is_left_out)
{
    static const double com[3] = {0.3, 0.0, 0.0}; /* to positive angles is down */
    struct toy_plant wheel;
    double with, without;

    wheel_init(&wheel, PLANT_IMPLICIT, 1000000, com);
    wheel_throw(&wheel, LOWER + 1e-6, -0.002);
    assert_ok(plant_step(wheel.plant, 1));
    with = wheel.state[1];
    wheel.toy.joint[0].stop = (struct robot_stop){0};
    wheel_throw(&wheel, LOWER + 1e-6, -0.002);
    assert_ok(plant_step(wheel.plant, 1));
    without = wheel.state[1];
    assert_true(without > 0.01);
    assert_near(with, without, 1e-12);
    arena_fini(&wheel.arena);
}

/* Struck within a step, from rest just before its limit, the wheel is met by the stop in that step:
 * it gets no farther than exactly. */
TEST(a_stop_meets_what_is_thrown_within_a_step)
{
    static const enum plant_integrator both[] = {PLANT_DOPRI5, PLANT_IMPLICIT};
    const double force[3] = {0.0}, blow[3] = {0.0, 1200.0, 0.0}, none[3] = {0.0};
    double farthest[2] = {0.0, 0.0};

    for (int i = 0; i < 2; i++) {
        int64_t substep_ns = both[i] == PLANT_DOPRI5 ? 10000 : 1000000;
        struct toy_plant wheel;

        wheel_init(&wheel, both[i], substep_ns, none);
        wheel_throw(&wheel, UPPER - 1e-4, 0.0);
        plant_set_push(wheel.plant, 1, force, blow);
        for (int64_t t = 0; t < 20000000; t += substep_ns) {
            assert_ok(plant_step(wheel.plant, 1));
            farthest[i] = fmax(farthest[i], wheel.state[0] - UPPER);
            if (t + substep_ns == 1000000) {
                plant_set_push(wheel.plant, 1, force, none);
            }
        }
        arena_fini(&wheel.arena);
    }
    print_message("# struck: %.5f rad exactly, %.5f in long steps\n", farthest[0], farthest[1]);
    assert_true(farthest[0] > 0.01);
    assert_true(farthest[1] > 0.2 * farthest[0] && farthest[1] <= 1.02 * farthest[0]);
}

/* At rest on its stop the pendulum presses it by its weight; settled, it does from the start. */
TEST(what_lies_on_a_stop_presses_it_by_its_weight)
{
    static const double com[3] = {0.3, 0.0, 0.0};
    static const enum plant_integrator all[] = {PLANT_RK4, PLANT_DOPRI5, PLANT_IMPLICIT};
    double depth = 2.0 * 9.81 * 0.3 * cos(UPPER) / wheel_stop.stiffness;

    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        struct settled settled;
        struct error error;
        struct toy_plant wheel;

        wheel_init(&wheel, all[i], 100000, com);
        wheel_throw(&wheel, UPPER, 0.0);
        assert_ok(plant_step(wheel.plant, 10000));
        assert_near(wheel.state[0] - UPPER, depth, 1e-3 * depth);

        wheel_throw(&wheel, UPPER, 0.0);
        assert_ok(plant_settle(wheel.plant, &wheel.arena, &settled, &error));
        assert_near(wheel.state[0] - UPPER, depth, 1e-3 * depth);
        depth = wheel.state[0] - UPPER;
        assert_ok(plant_step(wheel.plant, 1000));
        assert_near(wheel.state[0] - UPPER, depth, 1e-9 * depth);
        arena_fini(&wheel.arena);
    }
}

/* Away from a limit, or pulled away from one, nothing holds a joint without a drive. */
TEST(what_a_stop_cannot_hold_does_not_settle)
{
    static const double com[3] = {0.3, 0.0, 0.0};
    const double start[] = {LOWER, 0.5};
    struct toy_plant wheel;

    wheel_init(&wheel, PLANT_RK4, 100000, com);
    for (size_t i = 0; i < sizeof start / sizeof *start; i++) {
        struct settled settled;
        struct error error;

        wheel_throw(&wheel, start[i], 0.0);
        assert_int_equal(plant_settle(wheel.plant, &wheel.arena, &settled, &error), ERROR_INPUT);
        assert_non_null(strstr(error.text, "joint j0 has no drive"));
        assert_near(wheel.state[0], start[i], 0.0);
    }
    arena_fini(&wheel.arena);
}

/* ---- a robot ---- */

TEST(energy_balances_over_stops)
{
    const struct {
        enum plant_integrator integrator;
        int64_t substep_ns;
        double tolerance;
    } run[] = {{PLANT_DOPRI5, 1000000, 1e-6}, {PLANT_RK4, 10000, 2e-3}};

    for (size_t i = 0; i < sizeof run / sizeof *run; i++) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        struct plant_energy energy;
        double turnover;

        plant_rig_walker_with(&rig, true, run[i].integrator, run[i].substep_ns, 0.0);

        /* Narrow, uneven ranges around the pose it starts in, and springs with little room */
        static const double joint[8] = {-0.4, 0.8, -0.4, -0.35, 0.75, -0.4, 0.2, 0.05};

        for (size_t j = 0; j < rig.toy.robot.njoint; j++) {
            struct robot_joint *to = &rig.toy.joint[j];

            to->lower = joint[j] - 0.03 - 0.01 * (double)j;
            to->upper = joint[j] + 0.12 - 0.01 * (double)j;
            to->stop = (struct robot_stop){.stiffness = 3e4, .damping = 15.0};
        }
        plant_rig_reset(&rig, 0.7);
        assert_ok(plant_step(rig.plant, (size_t)(800000000 / run[i].substep_ns)));
        assert_ok(plant_energy(rig.plant, &energy));
        turnover = energy.motor_friction + energy.spring_damping + energy.parallel_damping +
                   energy.stop_loss + energy.contact_dissipation;
        print_message("# stops lost %.4f J of %.3f J; balance %.1e J\n", energy.stop_loss, turnover,
                      energy.balance);
        assert_true(energy.stop_loss > 0.05 * turnover);
        assert_near(energy.balance, 0.0, run[i].tolerance * turnover);
    }
}

/* ---- springs ---- */

/* COMAN's drive with room in its spring. */
static struct robot_sea roomy_drive(void)
{
    struct robot_sea sea = toy_drive(395.46);

    sea.deflection = 0.14;
    sea.stop = (struct robot_stop){.stiffness = 8000.0, .damping = 4.0};
    return sea;
}

/* At stall the current is V/R and the spring carries Kt V/R, beyond its room with its stop. */
TEST(a_spring_at_its_stop_carries_the_rest)
{
    static const double nowhere[3] = {0.0, 0.0, 0.0};
    static const enum plant_integrator all[] = {PLANT_RK4, PLANT_DOPRI5, PLANT_IMPLICIT};
    const struct robot_sea sea = roomy_drive();

    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        struct toy_plant wheel;

        wheel_init_driven(&wheel, all[i], 200000, nowhere, sea);
        for (double volts = -16.0; volts <= 16.0; volts += 8.0) {
            double tau = 4.1 * volts / 0.664, past = fabs(tau) - sea.Ks * sea.deflection;
            double twist = fabs(tau) / sea.Ks;
            struct motor_sense motor;

            twist = past > 0.0 ? sea.deflection + past / (sea.Ks + sea.stop.stiffness) : twist;
            wheel_throw(&wheel, 0.5, 0.0);
            plant_clamp(wheel.plant, true);
            plant_command(wheel.plant)->motor[0].bridge_on = true;
            plant_command(wheel.plant)->motor[0].voltage_v = volts;
            assert_ok(plant_step(wheel.plant, 20000));
            assert_ok(plant_sample(wheel.plant));
            motor = plant_sensors(wheel.plant)->motor[0];
            assert_near(motor.torque_nm, tau, 1e-6 * fabs(tau) + 1e-9);
            assert_near(motor.qm - motor.q, copysign(twist, tau), 1e-6 * twist + 1e-12);
            assert_near(sea_deflection(&sea, tau), copysign(twist, tau), 1e-12);
        }
        arena_fini(&wheel.arena);
    }
}

/* A rotor that swings against its clamped link, into both stops: the drive's balance, and the same
 * motion with all integrators. */
TEST(a_spring_stop_balances)
{
    static const double nowhere[3] = {0.0, 0.0, 0.0};
    const struct {
        enum plant_integrator integrator;
        int64_t substep_ns;
        double tolerance, angle;
    } run[] = {{PLANT_DOPRI5, 1000000, 1e-6, 1e-6},
               {PLANT_RK4, 20000, 1e-3, 1e-3},
               {PLANT_IMPLICIT, 10000, 2e-2, 2e-2}};
    double reference = 0.0;

    for (size_t i = 0; i < sizeof run / sizeof *run; i++) {
        double reached[2] = {0.0, 0.0}, turnover;
        struct plant_energy energy;
        struct toy_plant wheel;
        size_t count;

        wheel_init_driven(&wheel, run[i].integrator, run[i].substep_ns, nowhere, roomy_drive());
        wheel_throw(&wheel, 0.5, 0.0);
        plant_clamp(wheel.plant, true);
        plant_state(wheel.plant, &count)[3] = 20.0; /* q, q', qm, qm' */
        assert_ok(plant_restart_energy(wheel.plant));
        for (int k = 0; k < 100; k++) {
            double twist;

            assert_ok(plant_step(wheel.plant, (size_t)(1000000 / run[i].substep_ns)));
            twist = plant_state(wheel.plant, &count)[2] - 0.5;
            reached[0] = fmin(reached[0], twist);
            reached[1] = fmax(reached[1], twist);
        }
        assert_ok(plant_energy(wheel.plant, &energy));
        turnover = energy.motor_friction + energy.spring_damping;
        print_message("# springs lost %.4f J of %.4f J, balance %.1e J; twist %.5f to %.5f rad\n",
                      energy.spring_damping, turnover, energy.balance, reached[0], reached[1]);
        assert_true(reached[0] < -0.15 && reached[1] > 0.15 && reached[1] < 0.25);
        assert_near(energy.balance, 0.0, run[i].tolerance * turnover);
        reference = i == 0 ? reached[1] : reference;
        assert_near(reached[1], reference, run[i].angle * reference);
        arena_fini(&wheel.arena);
    }
}
