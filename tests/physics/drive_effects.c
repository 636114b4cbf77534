/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What real drives do beside the paper's equations (model/drives/effects.h), one effect at a time
 * against a closed form, and several together against an integration of the test's own in steps of
 * 1 us. The link is clamped unless said otherwise; the default integrator at its default step of 1
 * ms.
 */

#include "model/drives/effects.h"
#include "tests/physics/near.h"
#include "tests/physics/toy.h"

enum { MS = 1000000 };

struct effects_rig {
    struct toy toy;
    struct robot_effects effects;
    struct arena arena;
    struct dynamics dynamics;
    struct plant_config config;
    struct plant *plant;
    struct motor_command *motor;
    double *state, *drive;
};

/* Parts of the state of one joint on a fixed base: q, v, the drive, its effects. */
enum { AT_DRIVE = 2, AT_EFFECT = AT_DRIVE + PLANT_DRIVE_STATE };

/* A link on a fixed base about a vertical axis, behind such a drive. */
static void effects_rig_begin(struct effects_rig *rig, struct robot_sea sea,
                              struct robot_effects effects)
{
    const double none[3] = {0.0, 0.0, 0.0}, z[3] = {0.0, 0.0, 1.0};
    const double I[6] = {0.02, 0.0, 0.0, 0.02, 0.0, 0.02};

    *rig = (struct effects_rig){.effects = effects};
    toy_begin(&rig->toy, false, 1.0, none, I);
    sea.effects = &rig->effects;
    rig->toy.joint[toy_add(&rig->toy, 0, JOINT_REVOLUTE, z, none, 2.0, none, I)].sea = sea;
    toy_finish(&rig->toy);
    rig->config = (struct plant_config){.robot = &rig->toy.robot,
                                        .dynamics = &rig->dynamics,
                                        .integrator = PLANT_IMPLICIT,
                                        .substep_ns = MS,
                                        .rtol = 1e-10,
                                        .atol = 1e-10,
                                        .supply_v = 48.0,
                                        .account_energy = true};
}

static void effects_rig_start(struct effects_rig *rig)
{
    struct error error;
    size_t count;

    assert_ok(arena_init(&rig->arena, 1 << 20, &error));
    assert_ok(dynamics_generic(&rig->toy.robot, &rig->arena, &rig->dynamics, &error));
    assert_ok(plant_create(&rig->config, &rig->arena, &rig->plant, &error));
    rig->state = plant_state(rig->plant, &count);
    rig->drive = rig->state + AT_DRIVE;
    rig->motor = plant_command(rig->plant)->motor;
    assert_ok(plant_reset(rig->plant, NULL, NULL, (const double[1]){0.0}));
    plant_clamp(rig->plant, true);
}

static void step_rig(struct effects_rig *rig, size_t steps)
{
    assert_ok(plant_step(rig->plant, steps));
}

/* A rotor that hangs on nothing and has no friction. */
static struct robot_sea free_rotor(void)
{
    struct robot_sea sea = toy_drive(0.0);

    sea.Ds = sea.Dm = 0.0;
    return sea;
}

/* ---- friction ---- */

/* J v'= -F: at rest after J v/F, having turned by J v^2/(2 F). */
TEST(friction_stops_a_rotor_when_it_should)
{
    const enum plant_integrator integrator[] = {PLANT_IMPLICIT, PLANT_RK4, PLANT_DOPRI5};
    const double F = 3.0, v = 5.0;
    const struct robot_sea sea = free_rotor();

    for (int n = 0; n < 3; n++) {
        struct effects_rig rig;
        struct plant_energy energy;
        const double stop = sea.J * v / F;
        const size_t per_ms = integrator[n] == PLANT_IMPLICIT ? 1 : 100;

        effects_rig_begin(&rig, sea, (struct robot_effects){.coulomb = F, .breakaway = F});
        rig.config.integrator = integrator[n];
        rig.config.substep_ns = MS / (int64_t)per_ms;
        effects_rig_start(&rig);
        rig.drive[DRIVE_MOTOR_SPEED] = v;
        assert_ok(plant_restart_energy(rig.plant));
        for (int k = 1; k <= 300; k++) {
            const double t = 1e-3 * k;

            step_rig(&rig, per_ms);
            if (t < stop) {
                assert_near(rig.drive[DRIVE_MOTOR_SPEED], v - F / sea.J * t, 1e-11);
            } else {
                assert_true(rig.drive[DRIVE_MOTOR_SPEED] == 0.0);
            }
        }
        assert_near(rig.drive[DRIVE_MOTOR_POSITION], 0.5 * sea.J * v * v / F, 1e-8);
        assert_ok(plant_energy(rig.plant, &energy));
        assert_near(energy.gear_friction, 0.5 * sea.J * v * v, 1e-6);
        assert_near(energy.balance, 0.0, 1e-6);
        arena_fini(&rig.arena);
    }
}

/* Loads below the breakaway torque, also ones that shake, do not move a rotor by a bit. */
TEST(friction_holds_a_load_for_ever)
{
    struct robot_sea sea = toy_drive(395.46);
    struct effects_rig rig;
    double place;

    effects_rig_begin(&rig, sea,
                      (struct robot_effects){.coulomb = 2.0, .breakaway = 3.0, .stribeck = 0.05});
    effects_rig_start(&rig);
    rig.drive[DRIVE_MOTOR_POSITION] = place = 0.0025; /* 1 N m on the spring */
    rig.motor[0].bridge_on = true;
    for (int k = 0; k < 10000; k++) {
        rig.motor[0].voltage_v = sea.R / sea.Kt * (k % 7 < 3 ? 3.9 : -1.9);
        step_rig(&rig, 1);
        assert_true(rig.drive[DRIVE_MOTOR_POSITION] == place);
        assert_true(rig.drive[DRIVE_MOTOR_SPEED] == 0.0);
    }
    for (int k = 0; k < 20; k++) {
        rig.motor[0].voltage_v = sea.R / sea.Kt * 4.1;
        step_rig(&rig, 1);
    }
    assert_true(rig.drive[DRIVE_MOTOR_POSITION] > place);
    arena_fini(&rig.arena);
}

/* ---- several at once, against an integration of the test's own ---- */

struct reference {
    double qm, v, I, z;
};

/* The equations of model/drives/effects.h with the link at zero, written down again, for a given
 * direction of motion. */
static struct reference reference_rates(const struct robot_sea *sea, const struct reference *x,
                                        double V, double direction)
{
    const struct robot_effects *e = sea->effects;
    const double w = e->error[0].per_turn * sea->N, c = e->cogging[0].per_turn * sea->N;
    const double d = x->qm + e->error[0].amplitude * sin(w * x->qm);
    const double slope = 1.0 + e->error[0].amplitude * w * cos(w * x->qm);
    const double play = 0.5 * e->backlash, rate = slope * x->v;
    double bend = d > play ? d - play : d < -play ? d + play : 0.0;
    double push = bend == 0.0 && play > 0.0 ? 0.0 : sea->Ks * bend + sea->Ds * rate;
    double s = x->v / e->stribeck, F = 0.0;

    if (push * bend < 0.0 && play > 0.0) {
        push = 0.0;
    }
    if (e->coulomb > 0.0) {
        F = e->coulomb + (e->breakaway - e->coulomb) * exp(-s * s);
    }
    return (struct reference){
        .qm = x->v,
        .v = (sea->Kt * x->I - sea->Dm * x->v - slope * (push + x->z) +
              e->cogging[0].amplitude * sin(c * x->qm) - direction * F) /
             sea->J,
        .I = (V - sea->R * x->I - sea->Kw * x->v) / sea->L,
        .z = e->hysteresis > 0.0
                 ? e->hysteresis_stiffness * (rate - fabs(rate) * x->z / e->hysteresis)
                 : 0.0,
    };
}

static void reference_move(struct reference *x, const struct reference *rate, double h)
{
    x->qm += h * rate->qm;
    x->v += h * rate->v;
    x->I += h * rate->I;
    x->z += h * rate->z;
}

/* One step of 1 us by the midpoint rule; friction as a set at zero. */
static void reference_step(const struct robot_sea *sea, struct reference *x, double V)
{
    const double h = 1e-6;
    struct reference middle = *x, rate = reference_rates(sea, x, V, 0.0);
    double direction = (x->v > 0.0) - (x->v < 0.0), before = x->v;

    if (x->v == 0.0 && sea->effects->breakaway > 0.0) {
        if (sea->J * fabs(rate.v) <= sea->effects->breakaway) {
            rate.v = 0.0;
            reference_move(x, &rate, h);
            return;
        }
        direction = (rate.v > 0.0) - (rate.v < 0.0);
    }
    rate = reference_rates(sea, x, V, direction);
    reference_move(&middle, &rate, 0.5 * h);
    rate = reference_rates(sea, &middle, V, direction);
    reference_move(x, &rate, h);
    if (sea->effects->breakaway > 0.0 && before * x->v < 0.0) {
        x->v = 0.0;
    }
}

/* Errors allowed are parts of the largest. */
static const struct {
    const char *name;
    struct robot_effects effects;
    double Ks, volt, hz, error;
} blend[] = {
    {"friction", {.coulomb = 6.0, .breakaway = 9.0, .stribeck = 0.1}, 395.46, 3.0, 2.0, 1e-4},
    {"backlash", {.backlash = 0.02}, 8400.0, 4.0, 5.0, 1e-3},
    {"hysteresis", {.hysteresis = 8.0, .hysteresis_stiffness = 4000.0}, 395.46, 6.0, 4.0, 1e-4},
    {"gear error", {.error = {{2.0, 1e-3, 0.0}}, .nerror = 1}, 395.46, 6.0, 4.0, 1e-4},
    {"cogging", {.cogging = {{24.0, 1.0, 0.0}}, .ncogging = 1}, 395.46, 6.0, 4.0, 1e-4},
    {"all",
     {.coulomb = 6.0,
      .breakaway = 9.0,
      .stribeck = 0.1,
      .backlash = 0.01,
      .hysteresis = 4.0,
      .hysteresis_stiffness = 2000.0,
      .error = {{2.0, 1e-3, 0.0}},
      .nerror = 1,
      .cogging = {{24.0, 1.0, 0.0}},
      .ncogging = 1},
     395.46,
     6.0,
     4.0,
     3e-4},
};

TEST(effects_agree_with_a_fine_integration)
{
    for (size_t n = 0; n < sizeof blend / sizeof blend[0]; n++) {
        struct robot_sea sea = toy_drive(blend[n].Ks);
        double off = 0.0, way = 0.0, current = 0.0, peak = 0.0, turnover;
        struct reference x = {0.0, 0.0, 0.0, 0.0};
        struct plant_energy energy;
        struct effects_rig rig;

        effects_rig_begin(&rig, sea, blend[n].effects);
        sea.effects = &rig.effects;
        effects_rig_start(&rig);
        rig.motor[0].bridge_on = true;
        for (int k = 0; k < 1000; k++) {
            const double V = blend[n].volt * sin(2.0 * M_PI * blend[n].hz * 1e-3 * k);

            rig.motor[0].voltage_v = V;
            step_rig(&rig, 1);
            for (int i = 0; i < 1000; i++) {
                reference_step(&sea, &x, V);
            }
            off = fmax(off, fabs(rig.drive[DRIVE_MOTOR_POSITION] - x.qm));
            way = fmax(way, fabs(x.qm));
            current = fmax(current, fabs(rig.drive[DRIVE_CURRENT] - x.I));
            peak = fmax(peak, fabs(x.I));
        }
        assert_ok(plant_energy(rig.plant, &energy));
        turnover = energy.joule_heat + energy.motor_friction + energy.spring_damping +
                   energy.gear_friction + energy.gear_hysteresis;
        print_message("# %s: off by %.1e of %.4f rad, current by %.1e of %.2f A, balance %.1e of "
                      "%.2f J (friction %.2f, hysteresis %.2f)\n",
                      blend[n].name, off / way, way, current / peak, peak, energy.balance, turnover,
                      energy.gear_friction, energy.gear_hysteresis);
        assert_true(off < blend[n].error * way);
        assert_true(current < blend[n].error * peak);
        assert_near(energy.balance, 0.0, 5e-4 * turnover);
        arena_fini(&rig.arena);
    }
}

enum { MOVE_MS = 400 };

/* A link that moves, under steps of voltage: its angle and current at each tick. */
static double move_link(enum plant_integrator integrator, int64_t substep_ns, double *q, double *I)
{
    struct robot_effects all = blend[5].effects;
    struct plant_energy energy;
    struct effects_rig rig;

    all.freewheel = true;
    all.diode = 0.7;
    all.dead_time = 1e-6;
    all.pwm = 2e4;
    effects_rig_begin(&rig, toy_drive(1000.0), all);
    rig.config.integrator = integrator;
    rig.config.substep_ns = substep_ns;
    effects_rig_start(&rig);
    plant_clamp(rig.plant, false);
    for (int k = 0; k < MOVE_MS; k++) {
        rig.motor[0].bridge_on = k % 100 < 70;
        rig.motor[0].voltage_v = k / 50 % 2 ? -20.0 : 24.0;
        step_rig(&rig, (size_t)(MS / substep_ns));
        q[k] = rig.state[0];
        I[k] = rig.drive[DRIVE_CURRENT];
    }
    assert_ok(plant_energy(rig.plant, &energy));
    arena_fini(&rig.arena);
    return energy.balance /
           (energy.joule_heat + energy.motor_friction + energy.gear_friction + energy.bridge_loss);
}

/* All integrators solve the same equations. rk4 and dopri5 place events at the ends of substeps: an
 * error in proportion to those. */
TEST(integrators_agree_on_a_link_that_moves)
{
    static double q[2][MOVE_MS], I[2][MOVE_MS];
    const struct {
        enum plant_integrator integrator;
        int64_t substep_ns;
        double q, I, balance; /* errors allowed, of the largest */
    } run[] = {{PLANT_DOPRI5, 5000, 3e-4, 8e-4, 1e-6},
               {PLANT_IMPLICIT, MS, 3e-3, 6e-3, 2e-3},
               {PLANT_IMPLICIT, MS / 4, 2e-4, 4e-4, 1e-4}};

    move_link(PLANT_RK4, 1000, q[0], I[0]);
    for (int n = 0; n < 3; n++) {
        double balance = move_link(run[n].integrator, run[n].substep_ns, q[1], I[1]);
        double off[2] = {0.0, 0.0}, most[2] = {0.0, 0.0};

        for (int k = 0; k < MOVE_MS; k++) {
            off[0] = fmax(off[0], fabs(q[1][k] - q[0][k]));
            off[1] = fmax(off[1], fabs(I[1][k] - I[0][k]));
            most[0] = fmax(most[0], fabs(q[0][k]));
            most[1] = fmax(most[1], fabs(I[0][k]));
        }
        print_message("# angle off by %.1e of %.3f rad, current by %.1e of %.1f A, balance %.1e\n",
                      off[0] / most[0], most[0], off[1] / most[1], most[1], balance);
        assert_true(off[0] < run[n].q * most[0]);
        assert_true(off[1] < run[n].I * most[1]);
        assert_near(balance, 0.0, run[n].balance);
    }
}

/* ---- backlash ---- */

/* A rotor in the play of a gear with elastic flanks and nothing that takes energy: the play at an
 * even speed, then half a swing on the flank, and back. */
TEST(backlash_is_crossed_in_its_time)
{
    struct robot_sea sea = free_rotor();
    const double v = 0.5, play = 0.02;
    struct effects_rig rig;
    struct plant_energy energy;
    double half, last = 0.0, before = 0.0;
    int crossings = 0;

    sea.Ks = 8400.0;
    half = play / v + M_PI * sqrt(sea.J / sea.Ks);
    effects_rig_begin(&rig, sea, (struct robot_effects){.backlash = play});
    effects_rig_start(&rig);
    rig.drive[DRIVE_MOTOR_SPEED] = v;
    assert_ok(plant_restart_energy(rig.plant));
    for (int k = 1; k <= 1000; k++) {
        double x;

        before = rig.drive[DRIVE_MOTOR_POSITION];
        step_rig(&rig, 1);
        x = rig.drive[DRIVE_MOTOR_POSITION];
        if (before * x < 0.0) {
            last = 1e-3 * (k - x / (x - before));
            crossings++;
        }
        if (fabs(x) < 0.5 * play) {
            assert_near(fabs(rig.drive[DRIVE_MOTOR_SPEED]), v, 2e-3 * v);
        }
    }
    print_message("# %d crossings in %.5f s, exact %.5f\n", crossings, last, crossings * half);
    assert_true(crossings > 10);
    assert_near(last, crossings * half, 1e-3 * last);
    assert_ok(plant_energy(rig.plant, &energy));
    assert_near(energy.stored, 0.5 * sea.J * v * v, 2e-3 * 0.5 * sea.J * v * v);
    arena_fini(&rig.arena);
}

/* In the play a link hangs loose: no torque on it at all. */
TEST(backlash_leaves_the_link_loose)
{
    struct effects_rig rig;

    effects_rig_begin(&rig, toy_drive(395.46), (struct robot_effects){.backlash = 0.02});
    effects_rig_start(&rig);
    plant_clamp(rig.plant, false);
    rig.state[1] = 0.05;
    step_rig(&rig, 150);
    assert_near(rig.state[1], 0.05, 1e-15);
    assert_near(rig.state[0], 0.0075, 1e-15);
    assert_near(rig.drive[DRIVE_MOTOR_POSITION], 0.0, 1e-15);
    arena_fini(&rig.arena);
}

/* ---- hysteresis ---- */

/* The area of a closed loop of Dahl's law between -A and A. */
TEST(hysteresis_loses_the_area_of_its_loop)
{
    struct robot_effects effects = {.hysteresis = 8.0, .hysteresis_stiffness = 4000.0};
    struct robot_sea sea = toy_drive(395.46);
    const double zm = 8.0, sigma = 4000.0, A = 0.003, top = zm * tanh(sigma * A / zm);
    const double area =
        2.0 * (2.0 * A * zm - (zm + top) * zm / sigma * -expm1(-2.0 * sigma * A / zm));
    double z = 0.0, lost = 0.0, loss;

    sea.effects = &effects;
    for (int cycle = 0; cycle < 40; cycle++) {
        lost = 0.0;
        for (int k = 0; k < 200; k++) {
            z = effects_hysteresis(&sea, z, (k < 100 ? 0.02 : -0.02) * A, &loss);
            assert_true(loss >= 0.0);
            lost += loss;
        }
    }
    assert_near(z, -top, 1e-12);
    assert_near(lost, area, 1e-12);
}

/* ---- functions of the motor's angle ---- */

/* A rotor that coasts over the poles: J v^2/2 + A/w cos(w qm) stays; and one that rests swings
 * about the nearest place without torque at sqrt(A w/J). */
TEST(cogging_takes_and_gives_back)
{
    const struct robot_sea sea = free_rotor();
    const double A = 1.0, w = 24.0 * sea.N, start = 0.5 * sea.J * 0.6 * 0.6 + A / w;
    const double swing = sqrt(A * w / sea.J), bottom = M_PI / w;
    struct effects_rig rig;

    effects_rig_begin(&rig, sea,
                      (struct robot_effects){.cogging = {{24.0, A, 0.0}}, .ncogging = 1});
    effects_rig_start(&rig);
    rig.drive[DRIVE_MOTOR_SPEED] = 0.6;
    for (int k = 0; k < 1000; k++) {
        const double qm = rig.drive[DRIVE_MOTOR_POSITION], v = rig.drive[DRIVE_MOTOR_SPEED];

        assert_near(0.5 * sea.J * v * v + A / w * cos(w * qm), start, 2e-2 * A / w);
        step_rig(&rig, 1);
    }
    rig.drive[DRIVE_MOTOR_SPEED] = 0.0;
    rig.drive[DRIVE_MOTOR_POSITION] = bottom + 1e-6;
    for (int k = 1; k <= 100; k++) {
        step_rig(&rig, 1);
        assert_near(rig.drive[DRIVE_MOTOR_POSITION] - bottom, 1e-6 * cos(swing * 1e-3 * k), 3e-9);
    }
    arena_fini(&rig.arena);
}

/* A link that is held behind a gear with an error: where the motor is, the spring carries Ks e. */
TEST(kinematic_error_bends_the_spring)
{
    struct robot_sea sea = toy_drive(395.46);
    struct effects_rig rig;

    effects_rig_begin(&rig, sea, (struct robot_effects){.error = {{2.0, 1e-3, 0.3}}, .nerror = 1});
    effects_rig_start(&rig);
    assert_near(rig.drive[DRIVE_MOTOR_POSITION] +
                    1e-3 * sin(200.0 * rig.drive[DRIVE_MOTOR_POSITION] + 0.3),
                0.0, 1e-15); /* relaxed at the start */
    rig.drive[DRIVE_MOTOR_POSITION] = 0.05;
    assert_ok(plant_sample(rig.plant));
    assert_near(plant_sensors(rig.plant)->motor[0].torque_nm,
                395.46 * (0.05 + 1e-3 * sin(200.0 * 0.05 + 0.3)), 1e-12);
    arena_fini(&rig.arena);
}

/* ---- bridge ---- */

/* A rotor that is held, bridge off: the diodes drive the current down against the supply, and then
 * there is none. */
TEST(freewheeling_current_decays_against_the_supply)
{
    const struct robot_sea sea = free_rotor();
    const double U = 48.0 + 2.0 * 0.7, I0 = 60.0, end = sea.L / sea.R * log1p(I0 * sea.R / U);
    struct effects_rig rig;
    struct plant_energy energy;
    double charge;

    effects_rig_begin(&rig, sea, (struct robot_effects){.freewheel = true, .diode = 0.7});
    rig.config.substep_ns = MS / 20;
    effects_rig_start(&rig);
    rig.drive[DRIVE_CURRENT] = I0;
    rig.motor[0].condition = DRIVE_JAM;
    assert_ok(plant_restart_energy(rig.plant));
    for (int k = 1; k <= 40; k++) {
        const double t = 5e-5 * k;

        step_rig(&rig, 1);
        if (t < end) {
            assert_near(rig.drive[DRIVE_CURRENT],
                        (I0 + U / sea.R) * exp(-t * sea.R / sea.L) - U / sea.R, 1e-9);
        } else {
            assert_true(rig.drive[DRIVE_CURRENT] == 0.0);
        }
    }
    /* L I0 = U t + R Q */
    charge = (sea.L * I0 - U * end) / sea.R;
    assert_ok(plant_energy(rig.plant, &energy));
    assert_near(energy.electrical_in, -48.0 * charge, 1e-3 * 48.0 * charge);
    assert_near(energy.bridge_loss, 1.4 * charge, 1e-3 * 1.4 * charge);
    assert_near(energy.balance, 0.0, 1e-3 * 48.0 * charge);
    arena_fini(&rig.arena);
}

/* Diodes rectify what exceeds the supply: a rotor that is turned too fast is braked down to where
 * its voltage is that of the supply, and coasts there. */
TEST(diodes_rectify_what_exceeds_the_supply)
{
    const struct robot_sea sea = free_rotor();
    struct effects_rig rig;

    effects_rig_begin(&rig, sea, (struct robot_effects){.freewheel = true});
    effects_rig_start(&rig);
    rig.drive[DRIVE_MOTOR_SPEED] = 20.0;
    step_rig(&rig, 400);
    assert_near(rig.drive[DRIVE_MOTOR_SPEED], 48.0 / sea.Kw, 1e-9);
    assert_near(rig.drive[DRIVE_CURRENT], 0.0, 1e-9);
    rig.drive[DRIVE_MOTOR_SPEED] = 47.0 / sea.Kw;
    step_rig(&rig, 10);
    assert_true(rig.drive[DRIVE_CURRENT] == 0.0);
    assert_near(rig.drive[DRIVE_MOTOR_SPEED], 47.0 / sea.Kw, 1e-6);
    arena_fini(&rig.arena);
}

/* Dead time takes 2 t f U against the current; a voltage below that moves none. */
TEST(dead_time_takes_its_voltage)
{
    const struct robot_sea sea = free_rotor();
    struct effects_rig rig;
    const double lost = 2.0 * 1e-6 * 2e4 * 48.0;

    effects_rig_begin(&rig, sea, (struct robot_effects){.dead_time = 1e-6, .pwm = 2e4});
    effects_rig_start(&rig);
    rig.motor[0] =
        (struct motor_command){.bridge_on = true, .voltage_v = -10.0, .condition = DRIVE_JAM};
    for (int k = 1; k <= 20; k++) {
        step_rig(&rig, 1);
        assert_near(rig.drive[DRIVE_CURRENT],
                    (-10.0 + lost) / sea.R * -expm1(-1e-3 * k * sea.R / sea.L), 1e-9);
    }
    rig.motor[0].voltage_v = 0.9 * lost;
    step_rig(&rig, 5);
    assert_true(rig.drive[DRIVE_CURRENT] == 0.0);
    arena_fini(&rig.arena);
}

/* A held rotor at the end of its current's rise: what the supply gives becomes heat of winding and
 * bridge, by I = V/(R + R_b), the ripple U d (1 - d)/(L f), d = V/U, and t_s f U |I|. */
TEST(bridges_lose_what_their_ripple_and_switching_take)
{
    static const enum plant_integrator integrator[] = {PLANT_IMPLICIT, PLANT_DOPRI5};
    const double V = -12.0, U = 48.0, R_b = 0.1, f = 2e4, t_s = 2e-7;
    struct robot_sea sea = free_rotor();

    for (size_t i = 0; i < 2; i++) {
        const double I = V / (sea.R + R_b), peak_to_peak = U * 0.25 * 0.75 / (sea.L * f);
        const double square = I * I + peak_to_peak * peak_to_peak / 12.0;
        const double switched = t_s * f * U * fabs(I);
        struct effects_rig rig;
        struct plant_energy energy;

        effects_rig_begin(&rig, sea,
                          (struct robot_effects){.pwm = f, .switching = t_s, .bridge_ohm = R_b});
        rig.config.integrator = integrator[i];
        effects_rig_start(&rig);
        rig.motor[0] =
            (struct motor_command){.bridge_on = true, .voltage_v = V, .condition = DRIVE_JAM};
        step_rig(&rig, 200);
        assert_near(rig.drive[DRIVE_CURRENT], I, 1e-9);
        assert_ok(plant_restart_energy(rig.plant));
        step_rig(&rig, 1000);
        assert_ok(plant_energy(rig.plant, &energy));
        assert_near(energy.joule_heat, sea.R * square, 1e-6 * energy.joule_heat);
        assert_near(energy.bridge_loss, R_b * square + switched, 1e-6 * energy.joule_heat);
        assert_near(energy.electrical_in, energy.joule_heat + energy.bridge_loss,
                    1e-6 * energy.joule_heat);
        arena_fini(&rig.arena);
    }
}

/* ---- temperatures ---- */

/* A constant current into two bodies: the response of the linear system, from its poles. */
TEST(windings_warm_up_as_two_bodies)
{
    const struct robot_thermal thermal = {.winding_k_w = 0.8,
                                          .housing_k_w = 1.5,
                                          .winding_j_k = 3.0,
                                          .housing_j_k = 20.0,
                                          .ambient_c = 30.0};
    const struct robot_sea sea = free_rotor();
    const double V = 3.0, P = V * V / sea.R;
    const double a = -1.0 / (0.8 * 3.0), b = -a, c = 1.0 / (0.8 * 20.0);
    const double d = -c - 1.0 / (1.5 * 20.0), mean = 0.5 * (a + d);
    const double root = sqrt(mean * mean - (a * d - b * c)), s[2] = {mean + root, mean - root};
    const double end[2] = {P * 2.3, P * 1.5}; /* above ambient */
    struct effects_rig rig;

    effects_rig_begin(&rig, sea, (struct robot_effects){.thermal = thermal});
    effects_rig_start(&rig);
    rig.motor[0] =
        (struct motor_command){.bridge_on = true, .voltage_v = V, .condition = DRIVE_JAM};
    rig.drive[DRIVE_CURRENT] = V / sea.R;
    for (int k = 1; k <= 20000; k++) {
        /* x = end - sum of w_i e^(s_i t), from x(0) = 0 and x'(0) = (P/C, 0) */
        const double t = 1e-3 * k, e0 = exp(s[0] * t), e1 = exp(s[1] * t);
        const double w1 = (P / 3.0 + end[0] * s[0]) / (s[0] - s[1]),
                     h1 = end[1] * s[0] / (s[0] - s[1]);

        step_rig(&rig, 1);
        if (k % 1000 == 0) {
            assert_near(rig.state[AT_EFFECT + 1], 30.0 + end[0] - (end[0] - w1) * e0 - w1 * e1,
                        1e-5);
            assert_near(rig.state[AT_EFFECT + 2], 30.0 + end[1] - (end[1] - h1) * e0 - h1 * e1,
                        1e-5);
        }
    }
    assert_ok(plant_sample(rig.plant));
    assert_true(plant_sensors(rig.plant)->motor[0].winding_c == rig.state[AT_EFFECT + 1]);
    arena_fini(&rig.arena);
}

/* At rest in the heat: T = Ta + Rth V^2/R(T), a quadratic; and the torque constant that is left. */
TEST(warm_windings_conduct_and_pull_less)
{
    const struct robot_thermal thermal = {.winding_k_w = 0.5,
                                          .housing_k_w = 1.0,
                                          .winding_j_k = 0.2,
                                          .housing_j_k = 0.2,
                                          .ambient_c = 25.0,
                                          .R_per_k = 0.00385,
                                          .Kt_per_k = -0.0012};
    struct robot_sea sea = free_rotor();
    const double V = 5.0, x = V * V / sea.R * 1.5;
    const double rise = (-1.0 + sqrt(1.0 + 4.0 * 0.00385 * x)) / (2.0 * 0.00385);
    const double I = V / (sea.R * (1.0 + 0.00385 * rise));
    struct effects_rig rig;

    sea.Ks = 395.46;
    sea.Dm = 50.0;
    effects_rig_begin(&rig, sea, (struct robot_effects){.thermal = thermal});
    effects_rig_start(&rig);
    rig.motor[0] = (struct motor_command){.bridge_on = true, .voltage_v = V};
    step_rig(&rig, 10000);
    assert_near(rig.state[AT_EFFECT + 1], 25.0 + rise, 1e-6);
    assert_near(rig.drive[DRIVE_CURRENT], I, 1e-8);
    assert_near(rig.drive[DRIVE_MOTOR_POSITION], sea.Kt * (1.0 - 0.0012 * rise / 1.5) * I / sea.Ks,
                1e-8);
    arena_fini(&rig.arena);
}
