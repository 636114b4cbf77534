/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Joint couplings in motion: two flywheels against the closed form, at rest and under load; a
 * double pendulum against its own equations; a walker with couplings, energies and order of the
 * integrators; a leader driven against its follower's stop; static equilibrium.
 */
#include "model/coupling.h"
#include "model/settle.h"

#include "tests/physics/plant_rig.h"
#include "tests/physics/toy_plant.h"

static struct error error;

/* Two bodies on a fixed base, the second on the base or on the first, the second joint a follower
 * of the first. */
struct pair {
    struct toy_plant on;
    struct robot_coupling coupling;
    struct plant *plant;
    double *q, *qd;
};

static const double origin[3] = {0.0, 0.0, 0.0}, pitch[3] = {0.0, 1.0, 0.0};

static void pair_finish(struct pair *pair, enum plant_integrator integrator, int64_t substep_ns)
{
    pair->on.config.integrator = integrator;
    pair->on.config.substep_ns = substep_ns;
    pair->on.toy.robot.coupling = &pair->coupling;
    pair->on.toy.robot.ncoupling = 1;
    toy_plant_open(&pair->on);
    pair->plant = pair->on.plant;
    pair->q = pair->on.state;
    pair->qd = pair->q + 2;
}

/* ---- flywheels ---- */

#define LEADER 0.08   /* kg m2 */
#define FOLLOWER 0.03 /* kg m2 */
#define TIMES (-2.0)
#define SHIFT 0.1

/* Wheels about parallel axes, which only their coupling joins. */
static void wheels_init(struct pair *pair, enum plant_integrator integrator, int64_t substep_ns,
                        double stiffness, double damping)
{
    static const double base[6] = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}, aside[3] = {0.0, 0.0, 0.5};
    static const double own[6] = {0.05, 0.0, 0.0, LEADER, 0.0, 0.05};
    static const double other[6] = {0.02, 0.0, 0.0, FOLLOWER, 0.0, 0.02};

    toy_plant_begin(&pair->on, PLANT_RK4, 1);
    toy_begin(&pair->on.toy, false, 1.0, origin, base);
    toy_add(&pair->on.toy, 0, JOINT_REVOLUTE, pitch, origin, 2.0, origin, own);
    toy_add(&pair->on.toy, 0, JOINT_REVOLUTE, pitch, aside, 1.0, origin, other);
    pair->coupling = (struct robot_coupling){.follower = 1,
                                             .leader = 0,
                                             .multiplier = TIMES,
                                             .offset = SHIFT,
                                             .stiffness = stiffness,
                                             .damping = damping};
    pair_finish(pair, integrator, substep_ns);
}

/* At rest, the follower off by an angle from where its leader wants it. */
static void wheels_start(struct pair *pair, double q, double gap)
{
    const double joint[2] = {q, TIMES * q + SHIFT + gap};

    assert_ok(plant_reset(pair->plant, NULL, NULL, joint));
}

/* The gap e = q_f - m q_l - o follows e'' = -w^2 e, w^2 = K (1/I_f + m^2/I_l): one swings against
 * the other, and I_l q_l' + m I_f q_f' stays what it was. */
TEST(wheels_swing_as_the_closed_form)
{
    const double w = 60.0, e0 = 0.05, q0 = 0.3;
    const double K = w * w / (1.0 / FOLLOWER + TIMES * TIMES / LEADER);
    const struct {
        enum plant_integrator integrator;
        int64_t substep_ns;
        double tolerance;
    } run[] = {{PLANT_DOPRI5, 1000000, 1e-8},
               {PLANT_RK4, 100000, 1e-8},
               {PLANT_IMPLICIT, 1000000, 1.2e-2},
               {PLANT_IMPLICIT, 100000, 1.2e-4}};

    for (size_t i = 0; i < sizeof run / sizeof *run; i++) {
        struct pair pair;
        double worst = 0.0, drift = 0.0;

        wheels_init(&pair, run[i].integrator, run[i].substep_ns, K, 0.0);
        wheels_start(&pair, q0, e0);
        for (int64_t t = run[i].substep_ns; t <= 1000000000; t += run[i].substep_ns) {
            const double e = e0 * cos(w * 1e-9 * (double)t), moved = e - e0;
            const double leader = -TIMES * FOLLOWER * moved / (LEADER + TIMES * TIMES * FOLLOWER);

            assert_ok(plant_step(pair.plant, 1));
            worst = fmax(worst, fabs(coupling_error(&pair.coupling, pair.q) - e) / e0);
            worst = fmax(worst, fabs(pair.q[0] - q0 - leader) / e0);
            drift = fmax(drift, fabs(LEADER * pair.qd[0] + TIMES * FOLLOWER * pair.qd[1]));
        }
        print_message("# integrator %d, %lld ns: off by %.1e of the amplitude in 9.5 turns, "
                      "momentum by %.1e N m s\n",
                      (int)run[i].integrator, (long long)run[i].substep_ns, worst, drift);
        assert_true(worst <= run[i].tolerance);
        assert_true(drift <= 1e-12);
        arena_fini(&pair.on.arena);
    }
}

/* What the spring had is in the damper when all has come to rest. */
TEST(damper_takes_what_the_spring_had)
{
    const double K = 100.0, e0 = 0.1;
    static const enum plant_integrator all[] = {PLANT_RK4, PLANT_DOPRI5, PLANT_IMPLICIT};

    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        struct plant_energy energy;
        struct pair pair;

        wheels_init(&pair, all[i], 200000, K, 0.5);
        wheels_start(&pair, 0.0, e0);
        assert_ok(plant_energy(pair.plant, &energy));
        assert_near(energy.stored, 0.5 * K * e0 * e0 + 9.81 * 0.5, 1e-12);
        assert_ok(plant_step(pair.plant, 25000));
        assert_ok(plant_energy(pair.plant, &energy));
        print_message("# integrator %d: lost %.9f of %.9f J, balance %.1e J\n", (int)all[i],
                      energy.spring_damping, 0.5 * K * e0 * e0, energy.balance);
        assert_near(coupling_error(&pair.coupling, pair.q), 0.0, 1e-9);
        assert_near(energy.spring_damping, 0.5 * K * e0 * e0, 1e-4 * K * e0 * e0);
        assert_near(energy.balance, 0.0, 1e-4 * K * e0 * e0);
        arena_fini(&pair.on.arena);
    }
}

/* However stiff, at the millisecond of real time: a moment on the leader turns both as one wheel of
 * I_l + m^2 I_f would turn, the follower where the force that turns it bends it to. */
TEST(stiff_coupling_is_a_gear)
{
    static const double none[3];
    const double moment[3] = {0.0, 0.4, 0.0}, whole = LEADER + TIMES * TIMES * FOLLOWER;
    double worst = 0.0, bent = 0.0;

    for (double K = 300.0; K <= 1e9; K *= 7.0) {
        const double exact = 0.4 / whole, bend = -TIMES * FOLLOWER * exact / K;
        struct pair pair;

        wheels_init(&pair, PLANT_IMPLICIT, 1000000, K, 2.0 * sqrt(K * FOLLOWER));
        wheels_start(&pair, 0.0, bend);
        plant_set_push(pair.plant, 1, none, moment);
        assert_ok(plant_step(pair.plant, 1000));
        worst = fmax(worst, fabs(pair.q[0] - 0.5 * exact) / exact);
        worst = fmax(worst, fabs(pair.qd[0] - exact) / exact);
        bent = fmax(bent, fabs(coupling_error(&pair.coupling, pair.q) - bend));
        arena_fini(&pair.on.arena);
    }
    print_message("# 300 to 1e9 N m/rad: the leader is off by %.1e, the follower by %.1e rad\n",
                  worst, bent);
    assert_true(worst <= 1e-6);
    assert_true(bent <= 1e-6);
}

/* Thrown off by half a radian a stiff coupling comes to rest in a few steps, and nothing gains. */
TEST(stiff_coupling_damps_what_it_cannot_follow)
{
    for (double K = 1e3; K <= 1e9; K *= 10.0) {
        for (int damped = 0; damped < 2; damped++) {
            double last = INFINITY;
            struct pair pair;

            wheels_init(&pair, PLANT_IMPLICIT, 1000000, K, damped ? 2.0 * sqrt(K * FOLLOWER) : 0.0);
            wheels_start(&pair, 0.2, 0.5);
            for (int k = 0; k < 400; k++) {
                struct plant_energy energy;

                assert_ok(plant_step(pair.plant, 1));
                assert_ok(plant_energy(pair.plant, &energy));
                energy.stored -= 9.81 * 0.5;
                assert_true(energy.stored <= last * (1.0 + 1e-9) + 1e-9);
                last = energy.stored;
            }
            assert_true(!damped || fabs(coupling_error(&pair.coupling, pair.q)) <= 1e-6);
            arena_fini(&pair.on.arena);
        }
    }
}

/* ---- the follower's stop ---- */

/* A moment on the leader that presses the follower on its stop: the stop carries moment / |m|, and
 * the coupling is bent by that. */
TEST(leader_presses_the_stop_of_its_follower)
{
    static const double none[3];
    const double K = 3000.0, moment[3] = {0.0, -1.5, 0.0};
    const double press = 1.5 / fabs(TIMES), upper = 0.7;
    const struct robot_stop stop = {.stiffness = 2e3, .damping = 2.0};
    static const enum plant_integrator both[] = {PLANT_DOPRI5, PLANT_IMPLICIT};
    double deepest[2] = {0.0, 0.0}, lost[2];

    for (int i = 0; i < 2; i++) {
        struct plant_energy energy;
        struct pair pair;

        wheels_init(&pair, both[i], 1000000, K, 2.0 * sqrt(K * FOLLOWER));
        pair.on.toy.joint[1].upper = upper;
        pair.on.toy.joint[1].stop = stop;
        arena_fini(&pair.on.arena);
        pair_finish(&pair, both[i], 1000000);
        wheels_start(&pair, 0.0, 0.0);
        plant_set_push(pair.plant, 1, none, moment);
        for (int k = 0; k < 20000; k++) {
            assert_ok(plant_step(pair.plant, 1));
            deepest[i] = fmax(deepest[i], pair.q[1] - upper);
        }
        assert_near(pair.q[1], upper + press / stop.stiffness, 1e-7);
        assert_near(coupling_error(&pair.coupling, pair.q), -press / K, 1e-7);
        assert_ok(plant_energy(pair.plant, &energy));
        lost[i] = energy.stop_loss + energy.spring_damping;
        print_message("# integrator %d: %.5f rad deep at the most, %.6f at rest, lost %.5f J, "
                      "balance %.1e J\n",
                      (int)both[i], deepest[i], pair.q[1] - upper, lost[i], energy.balance);
        assert_near(energy.balance, 0.0, (both[i] == PLANT_DOPRI5 ? 1e-6 : 5e-2) * lost[i]);
        arena_fini(&pair.on.arena);
    }
    assert_true(deepest[1] <= 1.05 * deepest[0] && deepest[1] >= 0.8 * deepest[0]);
}

/* Driven on by a voltage the leader of a follower at its stop stands, whatever the voltage. */
TEST(drive_stalls_at_the_stop_of_its_follower)
{
    for (double volts = 6.0; volts <= 48.0; volts *= 2.0) {
        const struct robot_sea sea = toy_drive(1000.0);
        const double tau = sea.Kt * volts / sea.R, press = tau / fabs(TIMES);
        struct pair pair;

        wheels_init(&pair, PLANT_IMPLICIT, 1000000, 1e6, 2.0 * sqrt(1e6 * FOLLOWER));
        pair.on.toy.joint[0].sea = sea;
        pair.on.toy.joint[1].lower = -0.5;
        pair.on.toy.joint[1].stop = (struct robot_stop){.stiffness = 1e5, .damping = 100.0};
        arena_fini(&pair.on.arena);
        pair_finish(&pair, PLANT_IMPLICIT, 1000000);
        wheels_start(&pair, 0.0, 0.0);
        plant_command(pair.plant)->motor[0] =
            (struct motor_command){.bridge_on = true, .voltage_v = volts};
        assert_ok(plant_step(pair.plant, 5000));
        assert_near(pair.q[1], -0.5 - press / 1e5, 1e-6);
        assert_near(coupling_error(&pair.coupling, pair.q), press / 1e6, 1e-6);
        assert_near(pair.qd[0], 0.0, 1e-6);
        arena_fini(&pair.on.arena);
    }
}

/* ---- a double pendulum ---- */

#define LENGTH 0.4
#define UPPER_MASS 1.7
#define LOWER_MASS 0.9
#define UPPER_COM 0.25
#define LOWER_COM 0.15
#define UPPER_I 0.02
#define LOWER_I 0.005

/* Its accelerations by Lagrange's equations of the angles q and q + r, coupling included. */
static void pendulum_derive(const struct robot_coupling *c, const double y[4], double dy[4])
{
    const double g = 9.81, a = y[0], b = y[0] + y[1], da = y[2], db = y[2] + y[3];
    const double A = UPPER_MASS * UPPER_COM * UPPER_COM + UPPER_I + LOWER_MASS * LENGTH * LENGTH;
    const double B = LOWER_MASS * LOWER_COM * LOWER_COM + LOWER_I;
    const double C = LOWER_MASS * LENGTH * LOWER_COM;
    const double F = c->stiffness * (y[1] - c->multiplier * y[0] - c->offset) +
                     c->damping * (y[3] - c->multiplier * y[2]);
    /* Torques of the joints, between base and upper and between upper and lower */
    const double upper = c->multiplier * F, lower = -F;
    /* On the absolute angles: the upper one feels its own less the lower's */
    const double p = upper - lower - C * sin(a - b) * db * db -
                     g * (UPPER_MASS * UPPER_COM + LOWER_MASS * LENGTH) * sin(a);
    const double r = lower + C * sin(a - b) * da * da - g * LOWER_MASS * LOWER_COM * sin(b);
    const double D = C * cos(a - b), det = A * B - D * D;

    dy[0] = y[2];
    dy[1] = y[3];
    dy[2] = (B * p - D * r) / det;
    dy[3] = (A * r - D * p) / det - dy[2];
}

/* One step of the classical Runge-Kutta scheme. */
static void pendulum_step(const struct robot_coupling *c, double h, double y[4])
{
    static const double part[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0, 2.0, 2.0, 1.0};
    double k[4] = {0.0}, sum[4] = {0.0}, at[4];

    for (int s = 0; s < 4; s++) {
        for (int i = 0; i < 4; i++) {
            at[i] = y[i] + part[s] * h * k[i];
        }
        pendulum_derive(c, at, k);
        for (int i = 0; i < 4; i++) {
            sum[i] += weight[s] * k[i];
        }
    }
    for (int i = 0; i < 4; i++) {
        y[i] += h / 6.0 * sum[i];
    }
}

static void pendulum_init(struct pair *pair, enum plant_integrator integrator, int64_t substep_ns)
{
    static const double base[6] = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}, knee[3] = {0.0, 0.0, -LENGTH};
    static const double upper[6] = {UPPER_I, 0.0, 0.0, UPPER_I, 0.0, 0.01};
    static const double lower[6] = {LOWER_I, 0.0, 0.0, LOWER_I, 0.0, 0.001};
    static const double upper_com[3] = {0.0, 0.0, -UPPER_COM};
    static const double lower_com[3] = {0.0, 0.0, -LOWER_COM};

    toy_plant_begin(&pair->on, PLANT_RK4, 1);
    toy_begin(&pair->on.toy, false, 1.0, origin, base);
    toy_add(&pair->on.toy, 0, JOINT_REVOLUTE, pitch, origin, UPPER_MASS, upper_com, upper);
    toy_add(&pair->on.toy, 1, JOINT_REVOLUTE, pitch, knee, LOWER_MASS, lower_com, lower);
    pair->coupling = (struct robot_coupling){.follower = 1,
                                             .leader = 0,
                                             .multiplier = 1.5,
                                             .offset = -0.2,
                                             .stiffness = 60.0,
                                             .damping = 0.05};
    pair_finish(pair, integrator, substep_ns);
}

/* A second of it, far from rest: dopri5 at its tolerance, the implicit scheme with order 2. */
TEST(pendulum_moves_as_its_own_equations)
{
    const double start[2] = {1.2, 0.3};
    double y[4] = {start[0], start[1], 0.0, 0.0}, apart[3];
    struct pair pair;

    for (int i = 0; i < 3; i++) {
        static const int64_t step[3] = {1000000, 500000, 250000};

        pendulum_init(&pair, PLANT_IMPLICIT, step[i]);
        assert_ok(plant_reset(pair.plant, NULL, NULL, start));
        assert_ok(plant_step(pair.plant, (size_t)(1000000000 / step[i])));
        for (int k = 0; i == 0 && k < 100000; k++) {
            pendulum_step(&pair.coupling, 1e-5, y);
        }
        apart[i] = fmax(fabs(pair.q[0] - y[0]), fabs(pair.q[1] - y[1]));
        arena_fini(&pair.on.arena);
    }
    print_message("# implicit: %.1e, %.1e, %.1e rad off after 1 s in steps of 1, 1/2, 1/4 ms\n",
                  apart[0], apart[1], apart[2]);
    assert_true(apart[0] <= 6e-3);
    assert_true(log2(apart[0] / apart[1]) > 1.8 && log2(apart[1] / apart[2]) > 1.8);

    pendulum_init(&pair, PLANT_DOPRI5, 1000000);
    assert_ok(plant_reset(pair.plant, NULL, NULL, start));
    assert_ok(plant_step(pair.plant, 1000));
    for (int i = 0; i < 4; i++) {
        assert_near(pair.q[i], y[i], 1e-9);
    }
    arena_fini(&pair.on.arena);
}

/* ---- a walker ---- */

/* Half a second of one that falls on its feet, limp. */
TEST(walker_with_couplings_keeps_its_energy)
{
    const struct {
        enum plant_integrator integrator;
        int64_t substep_ns;
        double tolerance;
    } run[] = {
        {PLANT_DOPRI5, 1000000, 1e-6}, {PLANT_RK4, 20000, 1e-3}, {PLANT_IMPLICIT, 250000, 1e-2}};
    double last[8] = {0.0};

    for (size_t i = 0; i < sizeof run / sizeof *run; i++) {
        struct robot_coupling coupling[2];
        struct plant_energy energy;
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        double turnover, off = 0.0;

        plant_rig_coupled_walker(&rig, coupling, run[i].integrator, run[i].substep_ns);
        plant_rig_reset(&rig, 0.6);
        assert_ok(plant_step(rig.plant, (size_t)(500000000 / run[i].substep_ns)));
        assert_ok(plant_energy(rig.plant, &energy));
        turnover = energy.motor_friction + energy.spring_damping + energy.parallel_damping +
                   energy.contact_dissipation;
        for (int j = 0; j < 8; j++) {
            const double q = rig.state[7 + j];

            off = i > 0 ? fmax(off, fabs(q - last[j])) : 0.0;
            last[j] = i > 0 ? last[j] : q;
        }
        print_message("# integrator %d: balance %.1e of %.3f J, %.1e rad from dopri5\n",
                      (int)run[i].integrator, energy.balance, turnover, off);
        assert_near(energy.balance, 0.0, run[i].tolerance * turnover);
        assert_true(off <= 2e-2);
    }
}

/* ---- rest ---- */

/* An arm held out on its drive, and one that follows it: the drive carries both, the follower sags
 * by what it weighs, and from then on nothing moves. */
TEST(settled_follower_sags_by_its_weight)
{
    static const double base[6] = {1.0, 0.0, 0.0, 1.0, 0.0, 1.0}, aside[3] = {0.0, 0.5, 0.0};
    static const double own[6] = {0.01, 0.0, 0.0, 0.02, 0.0, 0.02}, com[3] = {0.2, 0.0, 0.0};
    const double K = 500.0, times = 0.5, start[2] = {0.4, 0.2};
    struct settled settled;
    struct pair pair;
    double weight, before[2];

    toy_plant_begin(&pair.on, PLANT_RK4, 1);
    toy_begin(&pair.on.toy, false, 1.0, origin, base);
    toy_add(&pair.on.toy, 0, JOINT_REVOLUTE, pitch, origin, 1.5, com, own);
    toy_add(&pair.on.toy, 0, JOINT_REVOLUTE, pitch, aside, 1.0, com, own);
    pair.on.toy.joint[0].sea = toy_drive(400.0);
    pair.coupling = (struct robot_coupling){
        .follower = 1, .leader = 0, .multiplier = times, .stiffness = K, .damping = 1.0};
    pair_finish(&pair, PLANT_IMPLICIT, 1000000);
    assert_ok(plant_reset(pair.plant, NULL, NULL, start));
    assert_no_error(plant_settle(pair.plant, &pair.on.arena, &settled, &error), error.text);

    /* Positive angles are down: m g c cos(q) = K e */
    weight = 9.81 * 0.2 * cos(pair.q[1]);
    assert_near(pair.q[0], start[0], 0.0);
    assert_near(coupling_error(&pair.coupling, pair.q), weight / K, 1e-9);
    assert_ok(plant_sample(pair.plant));
    assert_near(plant_sensors(pair.plant)->motor[0].torque_nm,
                -9.81 * 1.5 * 0.2 * cos(start[0]) - times * weight, 1e-9);
    assert_near(plant_sensors(pair.plant)->motor[1].torque_nm, -weight, 1e-9);
    memcpy(before, pair.q, sizeof before);
    assert_ok(plant_step(pair.plant, 2000));
    assert_near(pair.q[0], before[0], 1e-9);
    assert_near(pair.q[1], before[1], 1e-9);
    arena_fini(&pair.on.arena);
}

/* A robot that floats stands on feet of which one ankle follows the other: settled it stays. */
TEST(settled_walker_stands)
{
    static const double quaternion[4] = {1.0, 0.0, 0.0, 0.0}, position[3] = {0.0, 0.0, 0.52};
    const double joint[8] = {-0.2, 0.4, -0.2, -0.2, 0.4, -0.2, 0.2, 0.03};
    struct robot_coupling coupling[2];
    struct settled settled;
    struct plant_rig rig CLOSED_BY(plant_rig_fini);
    double before[15], moved = 0.0;

    plant_rig_coupled_walker(&rig, coupling, PLANT_IMPLICIT, 1000000);
    assert_ok(plant_reset(rig.plant, position, quaternion, joint));
    assert_no_error(plant_settle(rig.plant, &rig.arena, &settled, &error), error.text);
    memcpy(before, rig.state, sizeof before);
    for (int i = 0; i < 2; i++) {
        const double bent = coupling_error(&coupling[i], rig.state + 7);

        print_message("# coupling %d is bent by %.2e\n", i, bent);
        assert_true(fabs(bent) > 1e-5 && fabs(bent) < 0.05);
    }
    assert_ok(plant_step(rig.plant, 1000));
    for (int i = 0; i < 15; i++) {
        moved = fmax(moved, fabs(rig.state[i] - before[i]));
    }
    print_message("# settled, it moves by %.1e in a second\n", moved);
    assert_true(moved <= 1e-6);
}

/* Clamped links do not feel their couplings; let go, they do. */
TEST(clamp_holds_couplings)
{
    struct pair pair;

    wheels_init(&pair, PLANT_IMPLICIT, 1000000, 100.0, 0.1);
    wheels_start(&pair, 0.2, 0.1);
    plant_clamp(pair.plant, true);
    assert_ok(plant_step(pair.plant, 100));
    assert_near(coupling_error(&pair.coupling, pair.q), 0.1, 1e-15);
    assert_near(pair.q[0], 0.2, 0.0);
    plant_clamp(pair.plant, false);
    assert_ok(plant_step(pair.plant, 1));
    assert_true(pair.qd[1] < 0.0 && pair.qd[0] < 0.0);
    arena_fini(&pair.on.arena);
}
