/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A series elastic drive in motion against closed solutions: winding, torque, speed, resonance,
 * braking and the energy balance. The drive is COMAN's (link-side constants).
 */
#include "model/integrator.h"

#include "tests/physics/coman_drive.h"
#include "tests/physics/near.h"

/* A drive with a link of pure inertia behind it, or with the rotor or the link held fast. */
struct bench {
    struct robot_sea sea;
    double link_inertia; /* kg m2; 0 = the link is held fast */
    bool rotor_locked;
    bool bridge_on;
    double volts, chirp; /* V(t) = volts cos(chirp t^2) */
};

/* Integrals of the powers come last. */
enum { QM, QMD, CURRENT, Q, QD, ELECTRICAL, JOULE, FRICTION, DAMPING, STATES };

static struct sea_state drive_state(const double *y)
{
    return (struct sea_state){.qm = y[QM], .qmd = y[QMD], .I = y[CURRENT]};
}

static void bench_derivative(void *context, double t, const double *y, double *dydt)
{
    const struct bench *bench = context;
    struct sea_state s = drive_state(y), d;
    struct sea_power power;
    double V = bench->volts * cos(bench->chirp * t * t);

    sea_derivative(&bench->sea, &s, y[Q], y[QD], V, bench->bridge_on, &d);
    sea_power(&bench->sea, &s, y[Q], y[QD], V, &power);
    dydt[QM] = bench->rotor_locked ? 0.0 : d.qm;
    dydt[QMD] = bench->rotor_locked ? 0.0 : d.qmd;
    dydt[CURRENT] = d.I;
    dydt[Q] = y[QD];
    dydt[QD] = bench->link_inertia > 0.0
                   ? sea_torque(&bench->sea, &s, y[Q], y[QD]) / bench->link_inertia
                   : 0.0;
    dydt[ELECTRICAL] = power.electrical;
    dydt[JOULE] = power.joule;
    dydt[FRICTION] = power.friction;
    dydt[DAMPING] = power.spring_damping;
}

/* One step from step k on the grid of h. */
static void bench_step(struct bench *bench, int k, double h, double *y)
{
    double lost[STATES] = {0.0}, scratch[5 * STATES];

    assert_true(RK4_SCRATCH * STATES <= sizeof scratch / sizeof scratch[0]);
    integrator_rk4(bench_derivative, bench, k * h, h, STATES, y, lost, scratch);
}

static void bench_run(struct bench *bench, double seconds, double h, double *y)
{
    int steps = (int)lround(seconds / h);

    for (int k = 0; k < steps; k++) {
        bench_step(bench, k, h, y);
    }
}

TEST(locked_rotor_current_rises_as_the_exponential)
{
    struct bench bench = {
        .sea = coman_drive, .rotor_locked = true, .bridge_on = true, .volts = 12.0};
    const double h = 1e-5, final = 12.0 / 0.664, rate = 0.664 / 0.32e-3;
    double y[STATES] = {0}, worst = 0.0;

    for (int k = 0; k < 500; k++) {
        bench_step(&bench, k, h, y);
        worst = fmax(worst, fabs(y[CURRENT] - final * (1.0 - exp(-rate * (k + 1) * h))));
    }
    print_message("# worst error of the current: %.3e A of %.1f A\n", worst, final);
    assert_true(worst < 1e-8 * final);
    assert_near(coman_drive.Kt * y[CURRENT], coman_drive.Kt * final, 1e-3 * coman_drive.Kt * final);
}

TEST(locked_link_feels_the_stall_torque)
{
    struct bench bench = {.sea = coman_drive, .bridge_on = true, .volts = 8.0};
    double y[STATES] = {0};
    struct sea_state s;

    bench_run(&bench, 3.0, 1e-4, y);
    s = drive_state(y);
    assert_near(sea_torque(&coman_drive, &s, 0.0, 0.0), 4.1 * 8.0 / 0.664, 1e-9);
    assert_near(s.I, 8.0 / 0.664, 1e-9);
}

/* Dm w = Kt I and V = R I + Kw w give w = Kt V / (R Dm + Kt Kw). */
TEST(unloaded_rotor_reaches_the_no_load_speed)
{
    struct bench bench = {.sea = coman_drive, .bridge_on = true, .volts = 24.0};
    double y[STATES] = {0};
    const double expected = 4.1 * 24.0 / (0.664 * 0.19958 + 4.1 * 4.1);

    bench.sea.Ks = 0.0;
    bench.sea.Ds = 0.0;
    bench_run(&bench, 1.0, 1e-4, y);
    print_message("# no-load speed at 24 V: %.6f rad/s\n", y[QMD]);
    assert_near(y[QMD], expected, 1e-10 * expected);
}

/* Upward zero crossings of the spring's twist: their mean spacing and the mean factor by which
 * the crossing speed falls from one to the next. */
static void measure_oscillation(struct bench *bench, double h, double *y, double *period,
                                double *factor)
{
    enum { CROSSINGS = 12 };
    double first_time = 0.0, first_speed = 0.0, time = 0.0, speed = 0.0;
    int found = 0;

    for (int k = 0; found < CROSSINGS; k++) {
        double before = y[QM] - y[Q], speed_before = y[QMD] - y[QD], after, fraction;

        assert_true(k < 1000000);
        bench_step(bench, k, h, y);
        after = y[QM] - y[Q];
        if (before < 0.0 && after >= 0.0) {
            fraction = before / (before - after);
            time = (k + fraction) * h;
            speed = speed_before + fraction * (y[QMD] - y[QD] - speed_before);
            if (found == 0) {
                first_time = time;
                first_speed = speed;
            }
            found++;
        }
    }
    *period = (time - first_time) / (CROSSINGS - 1);
    *factor = pow(speed / first_speed, 1.0 / (CROSSINGS - 1));
}

/* Rotor and link on the spring alone: twist'' + 2 zeta w twist' + w^2 twist = 0 with
 * w^2 = Ks (1/J + 1/Jl) and zeta = Ds (1/J + 1/Jl) / (2 w). */
static void check_two_mass_resonance(double Ds)
{
    const double link = 0.35, pi = 3.14159265358979323846;
    struct bench bench = {.sea = coman_drive, .link_inertia = link, .bridge_on = false};
    double y[STATES] = {[QM] = 0.1, [QMD] = 0.0, [Q] = -0.05};
    const double mobility = 1.0 / coman_drive.J + 1.0 / link;
    const double w = sqrt(coman_drive.Ks * mobility), zeta = Ds * mobility / (2.0 * w);
    double period, factor, ratio;

    bench.sea.Dm = 0.0;
    bench.sea.Ds = Ds;
    measure_oscillation(&bench, 1e-5, y, &period, &factor);
    ratio = -log(factor) / hypot(2.0 * pi, log(factor));
    print_message("# %.6f Hz, damping ratio %.8f (closed form %.8f)\n", 1.0 / period, ratio, zeta);
    assert_near(2.0 * pi / period, w * sqrt(1.0 - zeta * zeta), 1e-6 * w);
    assert_near(ratio, zeta, 1e-7);
}

TEST(rotor_and_link_ring_at_the_two_mass_resonance)
{
    check_two_mass_resonance(0.0);
    check_two_mass_resonance(0.198);
    check_two_mass_resonance(2.0);
}

/* Winding shorted at speed w0: I'' ... two exponentials with the roots of
 * s^2 + (R/L + Dm/J) s + (R Dm + Kt Kw)/(L J) = 0. */
TEST(shorted_winding_brakes_the_rotor)
{
    struct bench bench = {.sea = coman_drive, .bridge_on = true, .volts = 0.0};
    const double w0 = 5.0, h = 1e-5;
    const double b = coman_drive.R / coman_drive.L + coman_drive.Dm / coman_drive.J;
    const double c = (coman_drive.R * coman_drive.Dm + coman_drive.Kt * coman_drive.Kw) /
                     (coman_drive.L * coman_drive.J);
    const double fast = -0.5 * (b + sqrt(b * b - 4.0 * c)), slow = c / fast;
    const double slope0 = -coman_drive.Dm / coman_drive.J * w0; /* no current yet */
    const double A = (slope0 - fast * w0) / (slow - fast), B = w0 - A;
    double y[STATES] = {[QMD] = w0}, worst = 0.0, before = 0.0;

    bench.sea.Ks = 0.0;
    bench.sea.Ds = 0.0;
    for (int k = 0; k < 3000; k++) {
        double t = (k + 1) * h;

        bench_step(&bench, k, h, y);
        worst = fmax(worst, fabs(y[QMD] - (A * exp(slow * t) + B * exp(fast * t))));
        if (k == 1999) {
            before = y[QMD];
        }
    }
    print_message("# worst error %.3e rad/s; time constant %.4f ms (R J / (R Dm + Kt Kw) = %.4f)\n",
                  worst, 1e3 * 1e-2 / log(before / y[QMD]),
                  1e3 * coman_drive.R * coman_drive.J /
                      (coman_drive.R * coman_drive.Dm + coman_drive.Kt * coman_drive.Kw));
    assert_true(worst < 1e-8 * w0);
    assert_near(1e-2 / log(before / y[QMD]), -1.0 / slow, 1e-6 / -slow);
}

/* Electrical in = mechanical + stored + heat; returns the relative gap. */
static double energy_gap(double h, double Kw)
{
    struct bench bench = {
        .sea = coman_drive, .link_inertia = 0.35, .bridge_on = true, .volts = 20.0, .chirp = 40.0};
    double y[STATES] = {0}, stored;
    struct sea_state s;

    bench.sea.Kw = Kw;
    bench_run(&bench, 1.0, h, y);
    s = drive_state(y);
    stored = sea_energy(&bench.sea, &s, y[Q]) + 0.5 * bench.link_inertia * y[QD] * y[QD];
    return fabs(y[ELECTRICAL] - stored - y[JOULE] - y[FRICTION] - y[DAMPING]) / y[ELECTRICAL];
}

TEST(electrical_energy_is_stored_or_turned_to_heat)
{
    print_message("# relative gap of the balance: %.2e at 1e-4 s, %.2e at 1e-5 s\n",
                  energy_gap(1e-4, 4.1), energy_gap(1e-5, 4.1));
    assert_true(energy_gap(1e-4, 4.1) < 1e-6);
    assert_true(energy_gap(1e-5, 4.1) < 1e-10);
    assert_true(energy_gap(1e-5, 3.6) < 1e-10);
}
