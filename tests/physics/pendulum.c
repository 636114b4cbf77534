/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The pendulums of the paper's section 3.1 and Table 1, through the whole plant: energy error of
 * Runge-Kutta 4 at fixed steps, and the period of the synchronous double pendulum.
 *
 * Dimensionless: g = l = m = 1. First body: center of mass at l = 1 from the fixed axis, inertia
 * 5.5 about it. Second body: its axis at d = 2 from the first, center of mass at c = 2.5 from that,
 * inertia 2. The paper leaves out the second mass m2. Its synchronous motion (no angle between the
 * bodies, ever) needs both equations of motion at equal angles a to ask for the same acceleration:
 *   first:   (5.5 + 1 + m2 d^2 + m2 d c) a'' = -(1 + m2 d) sin a
 *   second:        (2 + m2 c^2 + m2 d c) a'' = -m2 c sin a
 * so 2.5 m2 (6.5 + 9 m2) = (1 + 2 m2)(2 + 11.25 m2); the m2^2 terms cancel and m2 = 2 is the only
 * mass. Then a'' = -k sin a with k = 5/24.5. Started upward from below at speed w0 with
 * w0^2 > 4 k it turns over with the period 4 K(m)/w0, m = 4 k/w0^2, K the complete elliptic
 * integral K(m) = pi/(2 agm(1, sqrt(1 - m))). At w0 = 2.1 that is the paper's "approximately 3.15".
 */

#include "tests/physics/near.h"
#include "tests/physics/toy_plant.h"

static const double pi = 3.14159265358979323846;
static const double start_speed = 2.1;

struct pendulum {
    struct toy_plant on;
    struct plant *plant;
    size_t bodies;
    double *state;
};

/* Axis y is horizontal; the bodies hang along -z at zero angle. */
static void pendulum_init(struct pendulum *pendulum, size_t bodies, int64_t step_ns)
{
    static const double still[3], none[6], axis[3] = {0.0, 1.0, 0.0};
    static const double second_axis[3] = {0.0, 0.0, -2.0};
    static const double com1[3] = {0.0, 0.0, -1.0}, com2[3] = {0.0, 0.0, -2.5};
    static const double I1[6] = {5.5, 0.0, 0.0, 5.5, 0.0, 5.5};
    static const double I2[6] = {2.0, 0.0, 0.0, 2.0, 0.0, 2.0};

    toy_plant_begin(&pendulum->on, PLANT_RK4, step_ns);
    pendulum->on.config.supply_v = 1.0;
    pendulum->on.config.account_energy = false;
    toy_begin(&pendulum->on.toy, false, 0.0, still, none);
    toy_add(&pendulum->on.toy, 0, JOINT_REVOLUTE, axis, still, 1.0, com1, I1);
    if (bodies == 2) {
        toy_add(&pendulum->on.toy, 1, JOINT_REVOLUTE, axis, second_axis, 2.0, com2, I2);
    }
    pendulum->on.toy.robot.gravity[2] = -1.0;
    toy_plant_open(&pendulum->on);
    pendulum->bodies = bodies;
    pendulum->plant = pendulum->on.plant;
    pendulum->state = pendulum->on.state;
}

static void pendulum_fini(struct pendulum *pendulum)
{
    arena_fini(&pendulum->on.arena);
}

static double pendulum_energy(struct pendulum *pendulum)
{
    struct plant_energy energy;

    assert_ok(plant_energy(pendulum->plant, &energy));
    return energy.stored;
}

/* Largest |E(t) - E(0)| / |E(t)| over 10 time units. */
static double energy_error(size_t bodies, double angle, const double speed[2], int64_t step_ns)
{
    struct pendulum pendulum;
    double start, worst = 0.0;
    int64_t steps = INT64_C(10000000000) / step_ns;

    pendulum_init(&pendulum, bodies, step_ns);
    pendulum.state[0] = angle;
    pendulum.state[bodies] = speed[0];
    if (bodies == 2) {
        pendulum.state[3] = speed[1];
    }
    start = pendulum_energy(&pendulum);
    for (int64_t k = 0; k < steps; k++) {
        double energy;

        assert_ok(plant_step(pendulum.plant, 1));
        energy = pendulum_energy(&pendulum);
        worst = fmax(worst, fabs((energy - start) / energy));
    }
    assert_int_equal(plant_time_ns(pendulum.plant), INT64_C(10000000000));
    pendulum_fini(&pendulum);
    return worst;
}

/* The paper does not print its initial conditions; the turning-over motion of its Fig. 3 is
 * used. */
static void check_energy_error(size_t bodies)
{
    static const double synchronous[2] = {2.1, 0.0};
    double coarse = energy_error(bodies, 0.0, synchronous, 10000000);
    double fine = energy_error(bodies, 0.0, synchronous, 100000);

    print_message("# %zu bodies: energy error %.2e at dt 1e-2, %.2e at dt 1e-4\n", bodies, coarse,
                  fine);
    assert_true(coarse <= 3e-8);
    assert_true(fine < 1e-14); /* the paper's is 1e-13 */
}

TEST(single_pendulum_keeps_its_energy)
{
    check_energy_error(1);
}

TEST(double_pendulum_keeps_its_energy)
{
    check_energy_error(2);
}

/* A motion in which the bodies fold: the double pendulum's usual chaos, energy far from zero. */
TEST(folding_double_pendulum_keeps_its_energy)
{
    static const double speed[2] = {1.0, -2.0};
    double fine = energy_error(2, 0.6, speed, 100000);

    print_message("# folding: energy error %.2e at dt 1e-4\n", fine);
    assert_true(fine < 5e-13);
}

static double analytic_period(void)
{
    double k = 5.0 / 24.5, m = 4.0 * k / (start_speed * start_speed), a = 1.0, b = sqrt(1.0 - m);

    for (int i = 0; i < 8; i++) {
        double mean = 0.5 * (a + b);

        b = sqrt(a * b);
        a = mean;
    }
    return 4.0 * pi / (2.0 * a) / start_speed;
}

/* The same by quadrature of dt = da / a': the trapezoidal rule, which converges faster than any
 * power on a periodic integrand. */
static double period_by_quadrature(void)
{
    enum { POINTS = 64 };
    double k = 5.0 / 24.5, sum = 0.0;

    for (int i = 0; i < POINTS; i++) {
        double angle = 2.0 * pi * i / POINTS;

        sum += 1.0 / sqrt(start_speed * start_speed - 2.0 * k * (1.0 - cos(angle)));
    }
    return sum * 2.0 * pi / POINTS;
}

/* Time at which the angle passes `turns` turns: Newton from the grid point before, with the cubic
 * that fits angles and rates at both ends of the step. */
static double passing_time(double t, double h, const double before[2], const double after[2],
                           double goal)
{
    double s = (goal - before[0]) / (after[0] - before[0]);

    for (int i = 0; i < 20; i++) {
        double a = before[0], b = after[0], u = h * before[1], v = h * after[1];
        double c2 = 3.0 * (b - a) - 2.0 * u - v, c3 = 2.0 * (a - b) + u + v;

        s -= (a + s * (u + s * (c2 + s * c3)) - goal) / (u + s * (2.0 * c2 + s * 3.0 * c3));
    }
    return t + s * h;
}

TEST(synchronous_double_pendulum_has_the_analytic_period)
{
    struct pendulum pendulum CLOSED_BY(pendulum_fini);
    double period = analytic_period(), last = 0.0, worst = 0.0, apart = 0.0;
    int turns = 0;

    assert_near(period_by_quadrature(), period, 1e-14 * period);
    assert_near(period, 3.15, 0.01);
    pendulum_init(&pendulum, 2, 10000000);
    pendulum.state[2] = start_speed;
    for (int k = 0; k < 30000; k++) { /* 300 time units, as the paper's Fig. 3 */
        double before[2] = {pendulum.state[0], pendulum.state[2]};

        assert_ok(plant_step(pendulum.plant, 1));
        apart = fmax(apart, fabs(pendulum.state[1]));
        if (pendulum.state[0] >= 2.0 * pi * (turns + 1)) {
            double after[2] = {pendulum.state[0], pendulum.state[2]};
            double now = passing_time(1e-2 * k, 1e-2, before, after, 2.0 * pi * (turns + 1));

            worst = fmax(worst, fabs(now - last - period));
            last = now;
            turns++;
        }
    }
    print_message("# period %.15f (analytic), %d turns in 300 time units, worst error of one %.2e, "
                  "mean error %.2e, bodies apart by %.2e\n",
                  period, turns, worst, last / turns - period, apart);
    assert_int_equal(turns, (int)(300.0 / period));
    assert_true(worst < 1e-8); /* the paper's curve fluctuates by 5e-9 */
    assert_true(apart < 1e-9);
}
