/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Drives under their own current controllers against closed forms and dopri5: steps of a locked
 * rotor, limits, filter, delay, an impedance law against a spring. The default integrator at 1 ms
 * unless said otherwise.
 */
#include "base/array.h"
#include "tests/physics/near.h"
#include "tests/physics/toy_plant.h"

enum { MS = 1000000, AT_DRIVE = 2, AT_CURRENT = AT_DRIVE + DRIVE_CURRENT };

/* A link of 0.5 kg m2 about a vertical axis behind COMAN's drive. */
static void start(struct toy_plant *p, struct robot_sea sea, enum plant_integrator integrator,
                  int64_t substep_ns)
{
    const double none[3] = {0.0, 0.0, 0.0}, z[3] = {0.0, 0.0, 1.0};
    const double I[6] = {0.5, 0.0, 0.0, 0.5, 0.0, 0.5};

    toy_plant_begin(p, integrator, substep_ns);
    toy_begin(&p->toy, false, 1.0, none, I);
    p->toy.joint[toy_add(&p->toy, 0, JOINT_REVOLUTE, z, none, 2.0, none, I)].sea = sea;
    toy_plant_open(p);
    assert_ok(plant_reset(p->plant, none, NULL, none));
    p->motor[0] =
        (struct motor_command){.bridge_on = true, .law = {.on = true, .limit_a = (double)INFINITY}};
}

static void step(struct toy_plant *p)
{
    p->motor[0].law.reading_rad = p->state[AT_DRIVE];
    assert_ok(plant_step(p->plant, 1));
}

static double balance(struct toy_plant *p)
{
    struct plant_energy energy;

    assert_ok(plant_energy(p->plant, &energy));
    return energy.balance;
}

/* Returns 1 A filtered by a delay, a first-order filter and the bandwidth, at t. */
static double step_response(double w, double filter, double delay, double t)
{
    t -= delay;
    if (t <= 0.0) {
        return 0.0;
    }
    return filter == 0.0 ? -expm1(-w * t)
                         : 1.0 - (w * filter * exp(-t / filter) - exp(-w * t)) / (w * filter - 1.0);
}

TEST(current_of_a_locked_rotor_follows_its_bandwidth_filter_and_delay)
{
    static const struct {
        double hz, filter, delay;
        enum plant_integrator integrator;
        int64_t substep_ns;
        double tolerance;
    } rows[] = {
        {10.0, 0.0, 0.0, PLANT_IMPLICIT, MS, 1e-12},
        {100.0, 0.0, 0.0, PLANT_IMPLICIT, MS, 1e-12},
        {1000.0, 0.0, 0.0, PLANT_IMPLICIT, MS, 1e-12},
        {20000.0, 0.0, 0.0, PLANT_IMPLICIT, MS, 1e-12},
        {1000.0, 0.012, 0.0, PLANT_IMPLICIT, MS, 1e-12},
        {1000.0, 1e-6, 0.0, PLANT_IMPLICIT, MS, 1e-12},
        {100.0, 1e-12, 0.0, PLANT_IMPLICIT, MS, 1e-9},
        {100.0, 1e-320, 0.0, PLANT_IMPLICIT, MS, 1e-12},
        {50.0, 0.04, 0.003, PLANT_IMPLICIT, MS, 1e-12},
        {1000.0, 0.0, 0.0025, PLANT_IMPLICIT, MS, 1e-12},
        {200.0, 0.005, 0.00137, PLANT_IMPLICIT, MS, 1e-12},
        {200.0, 0.005, 0.00137, PLANT_IMPLICIT, MS / 4, 1e-12},
        {200.0, 0.005, 0.002, PLANT_DOPRI5, MS, 1e-9},
        {200.0, 0.005, 0.002, PLANT_RK4, MS / 10, 1e-5},
    };

    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        struct robot_sea sea = toy_drive(400.0);
        struct toy_plant p;

        sea.current_loop_hz = rows[i].hz;
        sea.command_filter_s = rows[i].filter;
        sea.command_delay_s = rows[i].delay;
        start(&p, sea, rows[i].integrator, rows[i].substep_ns);
        p.config.supply_v = 48.0;
        plant_set_source(p.plant, 1e6);
        p.motor[0].condition = DRIVE_JAM;
        p.motor[0].law.current_a = 1.0;
        while (plant_time_ns(p.plant) < 60 * MS) {
            step(&p);
            assert_near(p.state[AT_CURRENT],
                        step_response(2.0 * M_PI * rows[i].hz, rows[i].filter, rows[i].delay,
                                      1e-9 * (double)plant_time_ns(p.plant)),
                        rows[i].tolerance);
        }
        assert_near(balance(&p), 0.0, 1e-6);
        arena_fini(&p.arena);
    }
}

/* A controller starts at the present current after a voltage, and after a reset of the plant during
 * a law. The reset discards delayed commands. */
TEST(a_law_starts_at_the_present_current_without_earlier_commands)
{
    struct robot_sea sea = toy_drive(400.0);
    const double none[3] = {0.0, 0.0, 0.0};
    double held, first[20];
    struct toy_plant p;

    sea.command_filter_s = 0.02;
    sea.command_delay_s = 0.0;
    start(&p, sea, PLANT_IMPLICIT, MS);
    p.motor[0] = (struct motor_command){
        .bridge_on = true, .voltage_v = 2.0, .condition = DRIVE_JAM, .law.on = false};
    assert_ok(plant_step(p.plant, 500));
    held = p.state[AT_CURRENT];
    p.motor[0].law = (struct current_law){.on = true, .limit_a = 100.0, .current_a = held};
    for (int tick = 0; tick < 40; tick++) {
        step(&p);
        assert_near(p.state[AT_CURRENT], held, 1e-9);
    }
    arena_fini(&p.arena);

    sea.command_delay_s = 0.0041;
    start(&p, sea, PLANT_IMPLICIT, MS);
    for (int run = 0; run < 2; run++) {
        p.motor[0].law.current_a = 1.0;
        for (int tick = 0; tick < 20; tick++) {
            step(&p);
            first[tick] = run == 0 ? p.state[AT_CURRENT] : first[tick];
            assert_true(p.state[AT_CURRENT] == first[tick]);
        }
        assert_ok(plant_reset(p.plant, none, NULL, none));
    }
    arena_fini(&p.arena);
}

/* Gains and limits change together with their command, also within a substep. A locked rotor at 1
 * rad gets a command of 2 A, then a stiffness that asks for 5 A, then a limit of 3 A. */
TEST(gains_and_limits_change_with_their_command_after_any_delay)
{
    static const struct {
        double delay;
        enum plant_integrator integrator;
        int64_t substep_ns;
        double tolerance;
    } rows[] = {
        {0.0, PLANT_IMPLICIT, MS, 1e-11},    {0.0005, PLANT_IMPLICIT, MS, 1e-11},
        {0.0037, PLANT_IMPLICIT, MS, 1e-11}, {0.0037, PLANT_IMPLICIT, MS / 4, 1e-11},
        {0.0999, PLANT_IMPLICIT, MS, 1e-11}, {0.0037, PLANT_DOPRI5, MS, 1e-8},
        {0.0037, PLANT_RK4, MS / 50, 2e-2},
    };
    const double none[3] = {0.0, 0.0, 0.0}, pose = 1.0, w = 2.0 * M_PI * 300.0;

    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        struct robot_sea sea = toy_drive(400.0);
        struct toy_plant p;

        sea.current_loop_hz = 300.0;
        sea.command_delay_s = rows[i].delay;
        start(&p, sea, rows[i].integrator, rows[i].substep_ns);
        assert_ok(plant_reset(p.plant, none, NULL, &pose));
        plant_clamp(p.plant, true);
        plant_set_source(p.plant, 1e6);
        p.motor[0].condition = DRIVE_JAM;
        while (plant_time_ns(p.plant) < 160 * MS) {
            const int64_t at = plant_time_ns(p.plant) / MS;
            const double goal[] = {0.0, 2.0, 5.0, 3.0};
            double t, I = 0.0;

            p.motor[0].law = (struct current_law){.on = true,
                                                  .current_a = at < 10 ? 2.0 : 0.0,
                                                  .limit_a = at < 20 ? 40.0 : 3.0,
                                                  .stiffness_a_rad = at < 10 ? 0.0 : 50.0,
                                                  .position_rad = at < 10 ? 0.3 : 1.1};
            step(&p);
            t = 1e-9 * (double)plant_time_ns(p.plant) - rows[i].delay;
            for (int k = 1; k <= 3 && t > 0.01 * (k - 1); k++) {
                const double passed = k < 3 && t > 0.01 * k ? 0.01 : t - 0.01 * (k - 1);

                I = goal[k] + (I - goal[k]) * exp(-w * passed);
            }
            assert_near(p.state[AT_CURRENT], I, rows[i].tolerance);
        }
        arena_fini(&p.arena);
    }
}

/* rk4 is unstable at these bandwidths, so it uses the largest bandwidth at which it is stable. */
TEST(rk4_settles_at_any_bandwidth)
{
    static const double hz[] = {1000.0, 2e4, 1e6};

    for (size_t i = 0; i < ARRAY_COUNT(hz); i++) {
        struct robot_sea sea = toy_drive(400.0);
        struct toy_plant p;

        sea.current_loop_hz = hz[i];
        start(&p, sea, PLANT_RK4, MS);
        p.motor[0].condition = DRIVE_JAM;
        p.motor[0].law.current_a = 1.0;
        for (int tick = 0; tick < 60; tick++) {
            step(&p);
            assert_true(fabs(p.state[AT_CURRENT]) <= 1.0 + 1e-9);
        }
        assert_near(p.state[AT_CURRENT], 1.0, 1e-9);
        arena_fini(&p.arena);
    }
}

TEST(a_step_beyond_the_supply_is_the_step_of_the_voltage_until_the_loop_takes_over)
{
    static const double hz[] = {30.0, 1000.0, 20000.0}, volts[] = {12.0, 40.0};

    for (size_t i = 0; i < ARRAY_COUNT(hz) * ARRAY_COUNT(volts); i++) {
        struct robot_sea sea = toy_drive(400.0);
        const double w = 2.0 * M_PI * hz[i % 3], V = volts[i / 3], target = 11.0;
        double at, taken;
        struct toy_plant p;

        sea.L = 2e-3;
        sea.current_loop_hz = hz[i % 3];
        start(&p, sea, PLANT_IMPLICIT, MS);
        plant_set_source(p.plant, V);
        p.motor[0].condition = DRIVE_JAM;
        p.motor[0].law.current_a = target;
        /* The loop takes over where R I + L w (target - I) = V */
        taken = sea.L * w * target > V ? (sea.L * w * target - V) / (sea.L * w - sea.R) : 0.0;
        at = -sea.L / sea.R * log1p(-sea.R * taken / V);
        for (int k = 1; k <= 40; k++) {
            const double t = 1e-3 * k;

            step(&p);
            assert_near(p.state[AT_CURRENT],
                        t < at ? -V / sea.R * expm1(-sea.R * t / sea.L)
                               : target + (taken - target) * exp(-w * (t - at)),
                        1e-6);
            assert_true(fabs(plant_sensors(p.plant)->motor[0].voltage_v) <= V);
        }
        arena_fini(&p.arena);
    }
}

/* The law with all its limits on a moving link, and on a jammed rotor: against dopri5. */
TEST(laws_on_a_moving_link_agree_with_dopri5)
{
    static const struct {
        double stiffness, damping, speed, limit, supply, delay, tolerance;
    } rows[] = {
        {0.0, 0.0, 0.0, 40.0, 48.0, 0.0, 2e-4},   {40.0, 1.0, 0.0, 40.0, 48.0, 0.0, 2e-4},
        {40.0, 4.0, 1.0, 40.0, 48.0, 0.0, 2e-4},  {200.0, 10.0, 0.0, 6.0, 48.0, 0.0, 2e-3},
        {200.0, 10.0, 0.0, 40.0, 8.0, 0.0, 2e-3}, {40.0, 1.0, 0.0, 40.0, 48.0, 0.003, 2e-4},
    };

    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        struct robot_sea sea = toy_drive(400.0);
        double scale = 0.0, off = 0.0;
        struct toy_plant p[2];

        sea.command_delay_s = rows[i].delay;
        for (int k = 0; k < 2; k++) {
            start(&p[k], sea, k ? PLANT_DOPRI5 : PLANT_IMPLICIT, MS);
            plant_set_source(p[k].plant, rows[i].supply);
        }
        for (int tick = 0; tick < 400; tick++) {
            for (int k = 0; k < 2; k++) {
                p[k].motor[0].law = (struct current_law){.on = true,
                                                         .current_a = sin(0.02 * tick),
                                                         .limit_a = rows[i].limit,
                                                         .stiffness_a_rad = rows[i].stiffness,
                                                         .position_rad = tick < 200 ? 0.2 : -0.1,
                                                         .damping_a_s_rad = rows[i].damping,
                                                         .speed_rad_s = rows[i].speed};
                step(&p[k]);
            }
            scale = fmax(scale, fabs(p[1].state[AT_DRIVE]));
            off = fmax(off, fabs(p[0].state[AT_DRIVE] - p[1].state[AT_DRIVE]));
        }
        printf("# row %zu: off %.2g of %.3g, balance %.2g\n", i, off, scale, balance(&p[0]));
        if (!(off <= rows[i].tolerance * scale)) {
            fail_msg("row %zu: off %g of %g", i, off, scale);
        }
        for (int k = 0; k < 2; k++) {
            arena_fini(&p[k].arena);
        }
    }
}

/* y <- exp(A t) y for n = 3, by a Taylor series in 1,024 parts. */
static void propagate(const double A[3][3], double t, double y[3])
{
    for (int part = 0; part < 1024; part++) {
        double term[3] = {y[0], y[1], y[2]};

        for (int k = 1; k < 12; k++) {
            const double old[3] = {term[0], term[1], term[2]};

            for (int i = 0; i < 3; i++) {
                term[i] = (A[i][0] * old[0] + A[i][1] * old[1] + A[i][2] * old[2]) * t / 1024 / k;
                y[i] += term[i];
            }
        }
    }
}

TEST(impedance_law_against_a_spring_is_the_linear_system_of_third_order_at_any_gain)
{
    /* Stiffness and damping in N m/rad and N m s/rad; the last rows swing at more than 1 rad/ms */
    static const struct {
        double Ks, J, stiffness, damping, hz, tolerance;
    } rows[] = {
        {400.0, 0.14, 100.0, 5.0, 1000.0, 1e-11},  {400.0, 0.14, 1e4, 50.0, 1000.0, 1e-11},
        {400.0, 0.14, 1e4, 2000.0, 5000.0, 1e-11}, {400.0, 0.14, 0.0, 50.0, 200.0, 1e-11},
        {400.0, 0.001, 5000.0, 4.0, 1000.0, 1e-2}, {1e6, 0.01, 2e5, 100.0, 1000.0, 1e-2},
    };

    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        struct robot_sea sea = toy_drive(rows[i].Ks);
        const double kp = rows[i].stiffness, kd = rows[i].damping, w = 2.0 * M_PI * rows[i].hz;
        const double A[3][3] = {
            {0.0, 1.0, 0.0},
            {-sea.Ks / rows[i].J, -(sea.Dm + sea.Ds) / rows[i].J, sea.Kt / rows[i].J},
            {-w * kp / sea.Kt, -w * kd / sea.Kt, -w}};
        const double rest = 0.1 * kp / (kp + sea.Ks);
        double y[3] = {-rest, 0.0, -sea.Ks / sea.Kt * rest};
        struct toy_plant p;

        sea.J = rows[i].J;
        sea.current_loop_hz = rows[i].hz;
        start(&p, sea, PLANT_IMPLICIT, MS);
        plant_set_source(p.plant, 1e9);
        plant_clamp(p.plant, true);
        p.motor[0].law.stiffness_a_rad = kp / sea.Kt;
        p.motor[0].law.position_rad = 0.1;
        p.motor[0].law.damping_a_s_rad = kd / sea.Kt;
        if (kp == 0.0) {
            p.state[AT_DRIVE] = y[0] = 0.02;
            y[2] = 0.0;
        }
        for (int tick = 0; tick < 200; tick++) {
            step(&p);
            propagate(A, 1e-3, y);
            if (rows[i].tolerance < 1e-6 || tick > 50) {
                assert_near(p.state[AT_DRIVE], rest + y[0], rows[i].tolerance * 0.1);
            }
        }
        arena_fini(&p.arena);
    }
}

static double energy_of(const struct robot_sea *sea, const double *y)
{
    const double inertia = 0.5, speed = y[AT_DRIVE + DRIVE_MOTOR_SPEED];
    const double play = sea->effects ? sea->effects->backlash : 0.0;
    const double bend = fmax(0.0, fabs(y[AT_DRIVE] - y[0]) - 0.5 * play);

    return 0.5 * (inertia * y[1] * y[1] + sea->J * speed * speed + sea->Ks * bend * bend);
}

/* An impedance law is a spring and a damper. With its spring's energy, no drive gains energy beyond
 * the error of the scheme. Here the damping exceeds kp/w, what the lag of the loop gives back. */
TEST(impedance_laws_against_stiff_links_only_lose_energy)
{
    static const double Ks[] = {400.0, 1e5, 1e7}, J[] = {0.14, 1e-3, 1e-5};
    static const double kp[] = {0.0, 50.0, 5000.0}, play[] = {0.0, 2e-3};

    for (size_t i = 0; i < 54; i++) {
        struct robot_sea sea = toy_drive(Ks[i % 3]);
        const struct robot_effects effects = {
            .backlash = play[i / 27], .coulomb = 0.05, .breakaway = 0.05};
        const double stiffness = kp[i / 9 % 3];
        double start_j, mean[2] = {0.0, 0.0};
        struct toy_plant p;

        sea.J = J[i / 3 % 3];
        sea.Dm = 1e-3;
        sea.effects = i / 27 ? &effects : NULL;
        sea.current_loop_hz = 2e4;
        start(&p, sea, PLANT_IMPLICIT, MS);
        plant_set_source(p.plant, 1e6);
        p.state[1] = p.state[AT_DRIVE + DRIVE_MOTOR_SPEED] = 1.0;
        start_j = energy_of(&sea, p.state);
        p.motor[0].law.stiffness_a_rad = stiffness / sea.Kt;
        p.motor[0].law.damping_a_s_rad = 2.0 * stiffness / 1e5 / sea.Kt;
        for (int tick = 0; tick < 2000; tick++) {
            double energy;

            step(&p);
            energy = energy_of(&sea, p.state) + 0.5 * stiffness * pow(p.state[AT_DRIVE], 2.0);
            mean[tick / 1000] += energy / 1000;
            if (!(energy <= 1.01 * start_j)) {
                fail_msg("Ks %g, J %g, kp %g, play %g: %g J after %g J", sea.Ks, sea.J, stiffness,
                         effects.backlash, energy, start_j);
            }
        }
        assert_true(mean[1] <= mean[0]);
        arena_fini(&p.arena);
    }
}

TEST(drives_with_effects_agree_with_dopri5_under_a_law)
{
    static const struct {
        struct robot_effects effects;
        double stiffness, limit, supply, tolerance;
        bool by_rk4; /* dopri5 cannot step over the sign change of the loss */
    } rows[] = {
        {{.coulomb = 0.8, .breakaway = 0.8}, 0.0, 40.0, 48.0, 2e-3, false},
        {{.coulomb = 0.8, .breakaway = 0.8}, 100.0, 3.0, 48.0, 5e-3, false},
        {{.backlash = 5e-3}, 100.0, 40.0, 10.0, 5e-3, false},
        {{.hysteresis = 2.0, .hysteresis_stiffness = 300.0}, 100.0, 40.0, 48.0, 5e-3, false},
        {{.dead_time = 1e-6, .pwm = 2e4, .bridge_ohm = 0.1}, 100.0, 40.0, 48.0, 5e-3, false},
        {{.dead_time = 5e-6, .pwm = 2e4}, 100.0, 40.0, 3.0, 5e-3, true},
    };

    for (size_t i = 0; i < ARRAY_COUNT(rows); i++) {
        struct robot_sea sea = toy_drive(400.0);
        double scale = 0.0, off = 0.0;
        struct toy_plant p[2];

        sea.effects = &rows[i].effects;
        for (int k = 0; k < 2; k++) {
            start(&p[k], sea,
                  !k               ? PLANT_IMPLICIT
                  : rows[i].by_rk4 ? PLANT_RK4
                                   : PLANT_DOPRI5,
                  k ? MS / 20 : MS);
            plant_set_source(p[k].plant, rows[i].supply);
        }
        for (int tick = 0; tick < 400; tick++) {
            for (int k = 0; k < 2; k++) {
                p[k].motor[0].law =
                    (struct current_law){.on = true,
                                         .current_a = sin(0.02 * tick),
                                         .limit_a = rows[i].limit,
                                         .reading_rad = p[k].state[AT_DRIVE],
                                         .stiffness_a_rad = rows[i].stiffness,
                                         .position_rad = tick < 200 ? 0.2 : -0.1,
                                         .damping_a_s_rad = 0.05 * rows[i].stiffness};
                assert_ok(plant_step(p[k].plant, k ? 20 : 1));
            }
            scale = fmax(scale, fabs(p[1].state[AT_DRIVE]));
            off = fmax(off, fabs(p[0].state[AT_DRIVE] - p[1].state[AT_DRIVE]));
        }
        printf("# effects %zu: off %.2g of %.3g, balance %.2g %.2g\n", i, off, scale,
               balance(&p[0]), balance(&p[1]));
        if (!(off <= rows[i].tolerance * scale)) {
            fail_msg("row %zu: off %g of %g", i, off, scale);
        }
        for (int k = 0; k < 2; k++) {
            arena_fini(&p[k].arena);
        }
    }
}

TEST(torque_target_0_is_quiet_on_a_light_rotor_with_play)
{
    struct robot_sea sea = toy_drive(5000.0);
    const struct robot_effects effects = {.backlash = 4e-3, .coulomb = 0.02, .breakaway = 0.02};
    double sum = 0.0, square = 0.0;
    struct toy_plant p;

    sea.J = 2e-3;
    sea.Dm = 0.01;
    sea.effects = &effects;
    start(&p, sea, PLANT_IMPLICIT, MS);
    p.state[1] = p.state[AT_DRIVE + DRIVE_MOTOR_SPEED] = 0.2;
    for (int tick = 0; tick < 2000; tick++) {
        double torque;

        step(&p);
        torque = sea.Kt * p.state[AT_CURRENT];
        sum += torque / 2000;
        square += torque * torque / 2000;
    }
    assert_near(sqrt(square - sum * sum), 0.0, 1e-9);
    arena_fini(&p.arena);
}
