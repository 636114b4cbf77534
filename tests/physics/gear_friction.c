/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Friction of a gear that follows from the torques it carries (model/drives/effects.h) against
 * closed forms: its values, when a drive breaks away and when it is driven back, how a rotor speeds
 * up, that it rests exactly, and where the energy goes. Integrators agree on a swinging link.
 */

#include "model/drives/effects.h"
#include "model/drives/steady.h"
#include "tests/physics/near.h"
#include "tests/physics/toy_plant.h"

enum { MS = 1000000, AT_DRIVE = 2 };

/* A link on a fixed base behind a drive, about an axis across gravity or along it. */
struct bench {
    struct toy_plant on;
    struct robot_effects effects;
    struct plant *plant;
    double *drive, *state;
    struct motor_command *motor;
};

static void bench_begin(struct bench *b, struct robot_sea sea, struct robot_effects effects,
                        bool level, enum plant_integrator integrator, int64_t substep_ns)
{
    const double none[3] = {0.0, 0.0, 0.0}, com[3] = {level ? 0.1 : 0.0, 0.0, 0.0};
    const double axis[3] = {0.0, level ? 1.0 : 0.0, level ? 0.0 : 1.0};
    const double I[6] = {0.02, 0.0, 0.0, 0.02, 0.0, 0.02};

    *b = (struct bench){.effects = effects};
    toy_plant_begin(&b->on, integrator, substep_ns);
    sea.effects = &b->effects;
    toy_begin(&b->on.toy, false, 1.0, none, I);
    b->on.toy.joint[toy_add(&b->on.toy, 0, JOINT_REVOLUTE, axis, none, 2.0, com, I)].sea = sea;
    toy_plant_open(&b->on);
    b->plant = b->on.plant;
    b->state = b->on.state;
    b->motor = b->on.motor;
    b->drive = b->state + AT_DRIVE;
    assert_ok(plant_reset(b->plant, NULL, NULL, (const double[1]){0.0}));
}

/* Begins a bench with a held link. Its gear has friction F with a presliding stiffness, and no
 * other losses. */
static void bench_begin_gripping(struct bench *b, struct robot_sea sea, double F, double stiffness,
                                 enum plant_integrator integrator, int64_t substep_ns)
{
    sea.Kw = 0.0;
    sea.Dm = sea.Ks > 0.0 ? 3.0 : 0.0;
    sea.Ds = 5e-4 * sea.Ks;
    bench_begin(b, sea,
                (struct robot_effects){.coulomb = F, .breakaway = F, .presliding = stiffness},
                false, integrator, substep_ns);
    plant_clamp(b->plant, true);
    b->motor->bridge_on = true;
}

static void bench_end(struct bench *b)
{
    arena_fini(&b->on.arena);
}

/* A gear with all terms of the model m6 of Duclusaud et al. (ICRA 2025). */
static struct robot_effects all_terms(void)
{
    return (struct robot_effects){.coulomb = 0.4,
                                  .breakaway = 0.6,
                                  .stribeck = 0.5,
                                  .stribeck_exponent = 1.5,
                                  .load = {.motor = 0.2,
                                           .external = 0.1,
                                           .motor_stribeck = 0.05,
                                           .external_stribeck = 0.03,
                                           .motor_quadratic = 0.01,
                                           .external_quadratic = 0.02}};
}

TEST(terms_add_up_as_published)
{
    struct robot_effects effects = all_terms();
    struct robot_sea sea = toy_drive(100.0);
    const struct {
        double motor, external, speed;
    } at[] = {{3.0, -2.0, 0.0}, {3.0, -2.0, 0.7}, {1.0, -4.0, -0.2},
              {2.0, 1.0, 0.1},  {0.0, -1.0, 0.0}, {-3.0, 2.5, 3.0}};

    sea.effects = &effects;
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++) {
        const double M = at[i].motor, T = at[i].external;
        const double dip = exp(-pow(fabs(at[i].speed / 0.5), 1.5));
        double F = 0.4 + 0.2 * dip + fabs(0.1 * T - 0.2 * M) + dip * fabs(0.03 * T - 0.05 * M);

        if (M * T < 0.0) {
            F += dip * (fabs(T) < fabs(M) ? 0.02 * T * T : 0.01 * M * M);
        }
        assert_near(effects_friction(&sea, at[i].speed, &(struct effects_carried){M, T}), F, 1e-12);
    }

    /* Without the exponent it is Gauss's curve, and off is off */
    effects.stribeck_exponent = 0.0;
    effects.load = (struct robot_load_friction){0};
    assert_near(effects_friction(&sea, 0.5, &(struct effects_carried){9.0, 9.0}),
                0.4 + 0.2 * exp(-1.0), 1e-12);
}

/* The drive and back-drive diagram: forward when M (1 - a) - F > T (1 + b), back when
 * T (1 - b) - F > M (1 + a), with the shares a, b at rest. */
TEST(drives_break_away_where_the_diagram_says)
{
    const double F = 0.5, a = 0.2, b = 0.1, load[] = {0.0, 1.0, 7.0};
    struct robot_effects effects = {
        .coulomb = F, .breakaway = F, .load = {.motor = a, .external = b}};
    struct robot_sea sea = toy_drive(100.0);
    const struct effects_bridge bridge = {.conducts = false};

    sea.effects = &effects;
    for (size_t i = 0; i < 3; i++) {
        const double T = load[i], forward = (T * (1.0 + b) + F) / (1.0 - a);
        const double back = (T * (1.0 - b) - F) / (1.0 + a);
        const double M[] = {forward * 1.001, forward * 0.999, back + 0.001, back - 0.001};
        const int slide[] = {1, 0, 0, -1};

        for (int k = 0; k < (back > 0.0 ? 4 : 2); k++) {
            struct effects_state state = {.sea = {.qm = T / sea.Ks, .I = M[k] / sea.Kt}};

            assert_int_equal(effects_find_mode(&sea, &state, 0.0, 0.0, &bridge).slide, slide[k]);
        }
    }
}

/* A rotor without a load under a constant current: J v' = M (1 - a) - F. */
TEST(share_of_the_motor_slows_its_start)
{
    struct robot_sea sea = toy_drive(0.0);
    const double F = 1.0, a = 0.25, I = 5.0, M = sea.Kt * I;
    const double rate = (M * (1.0 - a) - F) / sea.J;
    struct plant_energy energy;
    struct bench b;

    sea.Ds = sea.Dm = sea.Kw = 0.0;
    bench_begin(&b, sea, (struct robot_effects){.coulomb = F, .breakaway = F, .load = {.motor = a}},
                false, PLANT_IMPLICIT, MS);
    plant_clamp(b.plant, true);
    b.drive[DRIVE_CURRENT] = I;
    b.motor->bridge_on = true;
    b.motor->voltage_v = sea.R * I;
    assert_ok(plant_restart_energy(b.plant));
    for (int k = 1; k <= 200; k++) {
        assert_ok(plant_step(b.plant, 1));
        assert_near(b.drive[DRIVE_MOTOR_SPEED], rate * 1e-3 * k, 1e-9 * rate);
    }
    assert_ok(plant_energy(b.plant, &energy));
    assert_near(energy.gear_friction, (F + a * M) * b.drive[DRIVE_MOTOR_POSITION], 1e-6);
    assert_near(energy.balance, 0.0, 1e-6);
    bench_end(&b);
}

/* A load that shakes within what friction carries does not move the rotor by a bit in 10 s. */
TEST(friction_by_load_holds_exactly)
{
    struct robot_sea sea = toy_drive(100.0);
    struct bench b;

    bench_begin(&b, sea, (struct robot_effects){.load = {.motor = 0.5, .external = 0.5}}, false,
                PLANT_IMPLICIT, MS);
    plant_clamp(b.plant, true);
    b.drive[DRIVE_MOTOR_POSITION] = 0.03; /* 3 N m, which a motor of 1 N m and more holds */
    b.motor->bridge_on = true;
    b.drive[DRIVE_CURRENT] = 2.5 / sea.Kt;
    for (int k = 0; k < 10000; k++) {
        b.motor->voltage_v = sea.R / sea.Kt * (2.5 + sin(0.05 * k));
        assert_ok(plant_step(b.plant, 1));
        assert_true(b.drive[DRIVE_MOTOR_POSITION] == 0.03);
    }
    bench_end(&b);
}

/* Friction with a presliding stiffness against the closed forms of a Maxwell slip element. The link
 * is held, and the torque swings slowly about 0. Below breakaway the rotor gives way as on both
 * springs, each cycle takes no energy, and nothing drifts. Above, a cycle of amplitude A takes
 * 4 F (A - F/stiffness). */
TEST(presliding_friction_follows_its_closed_forms)
{
    const double F = 0.4, stiffness = 150.0, both = 100.0 + stiffness, yield = F * both / stiffness;
    const double torque[] = {0.1, 0.9 * yield, 1.5 * yield, 5.0 * yield};
    const struct robot_sea sea = toy_drive(100.0);

    for (size_t i = 0; i < 4; i++) {
        const bool slides = torque[i] > yield;
        const double most = slides ? (torque[i] - F) / sea.Ks : torque[i] / both;
        struct plant_energy energy[2];
        double start = 0.0, found = 0.0, area;
        struct bench b;

        bench_begin_gripping(&b, toy_drive(100.0), F, stiffness, PLANT_IMPLICIT, MS);
        for (int k = 0; k <= 30000; k++) {
            b.motor->voltage_v = sea.R / sea.Kt * torque[i] * sin(2.0 * M_PI * k / 10000.0);
            assert_ok(plant_step(b.plant, 1));
            if (k == 10000) {
                start = b.drive[DRIVE_MOTOR_POSITION];
                assert_ok(plant_energy(b.plant, &energy[0]));
            }
            found = fmax(found, fabs(b.drive[DRIVE_MOTOR_POSITION]));
        }
        assert_ok(plant_energy(b.plant, &energy[1]));
        assert_near(found, most, 1e-3 * most);
        area = slides ? 4.0 * F * (found - F / stiffness) : 0.0;
        assert_near(b.drive[DRIVE_MOTOR_POSITION], start, 1e-9 * most);
        assert_near(energy[1].gear_friction - energy[0].gear_friction, 2.0 * area,
                    1e-3 * area + 1e-9);
        assert_near(energy[1].balance, 0.0, 1e-4 * energy[1].electrical_in);
        bench_end(&b);
    }
}

/* A rotor without a spring behind friction F with a presliding stiffness. A torque below F bends
 * the contacts by torque / stiffness, and the rotor rests there. A torque above F slides the rotor
 * as under Coulomb friction. A moving rotor stops as under Coulomb friction, and turns back by at
 * most the bending of the contacts. Soft contacts still swing at the end. So the test checks the
 * rest only for contacts whose swing turns by half a rad or more in a substep. */
TEST(presliding_friction_holds_slides_and_brakes_at_any_stiffness)
{
    static const double stiffness[] = {150.0, 1e3, 1e5, 1e7};
    const double F = 0.4, h = 1e-4;

    for (size_t i = 0; i < 24; i++) {
        const double k = stiffness[i / 6], speed = i % 3 == 2 ? 0.5 : 0.0;
        const double torque = i % 3 == 0 ? 0.49 * F : i % 3 == 1 ? 1.2 * F : 0.0;
        const double stop = 0.5 * 0.1387 * speed * speed / F;
        const bool slides = torque > F, adaptive = i % 6 > 2;
        const double *position, *rate;
        struct bench b;

        bench_begin_gripping(&b, toy_drive(0.0), F, k, adaptive ? PLANT_DOPRI5 : PLANT_IMPLICIT,
                             MS / 10);
        position = &b.drive[DRIVE_MOTOR_POSITION];
        rate = &b.drive[DRIVE_MOTOR_SPEED];
        b.drive[DRIVE_MOTOR_SPEED] = speed;
        b.drive[DRIVE_CURRENT] = torque / toy_drive(0.0).Kt;
        b.motor->voltage_v = toy_drive(0.0).R * b.drive[DRIVE_CURRENT];
        for (int step = 1; step <= 3000; step++) {
            assert_ok(plant_step(b.plant, 1));
            assert_true(slides || *position <= stop + F / k + h * speed);
            if (speed > 0.0 && step == 1000) {
                assert_near(*rate, speed - F / 0.1387 * (0.1 - 0.5 * F / (k * speed)), 5e-4);
            }
        }
        if (slides) {
            assert_near(*rate, (torque - F) / 0.1387 * 0.3, 2.0 * F / sqrt(k * 0.1387));
        } else if (!adaptive && h * sqrt(k / 0.1387) > 0.5) {
            assert_near(*rate, 0.0, speed > 0.0 ? 1e-4 : 1e-5);
            assert_near(*position, stop + torque / k, speed > 0.0 ? F / k + 1e-5 : 1e-3 * F / k);
        }
        bench_end(&b);
    }
}

/* A link that swings with its drive, by the default step and by rk4 in steps of 2 us. */
static void compare_integrators(struct robot_effects effects)
{
    const struct robot_sea sea = toy_drive(100.0);
    struct plant_energy energy;
    double q[2][4];

    for (int n = 0; n < 2; n++) {
        const size_t per_ms = n == 0 ? 1 : 500;
        struct bench b;

        bench_begin(&b, sea, effects, true, n == 0 ? PLANT_IMPLICIT : PLANT_RK4,
                    MS / (int64_t)per_ms);
        b.motor->bridge_on = true;
        for (int k = 0; k < 400; k++) {
            b.motor->voltage_v = 20.0 * sin(0.02 * k);
            assert_ok(plant_step(b.plant, per_ms));
            if (k % 100 == 99) {
                q[n][k / 100] = b.state[0];
            }
        }
        assert_ok(plant_energy(b.plant, &energy));
        assert_near(energy.balance, 0.0, 5e-3 * energy.electrical_in);
        bench_end(&b);
    }
    for (int k = 0; k < 4; k++) {
        assert_near(q[0][k], q[1][k], 2e-3 * fabs(q[1][k]) + 1e-4);
    }
}

TEST(integrators_agree_on_a_swinging_link)
{
    struct robot_effects effects = all_terms();

    compare_integrators(effects);
    effects.presliding = 500.0;
    compare_integrators(effects);
    effects = (struct robot_effects){.saturation = 3.0, .iron = 1e-3, .skin = 0.1, .standby = 2.0};
    compare_integrators(effects);
}

/* A rotor at a constant voltage U turns where U = R' I + s Kw w and s Kt I = (Dm + iron I^2) w,
 * with R' = R + skin sqrt(w) and s = 1/sqrt(1 + (I/I_s)^2). The supply gives U I and the standby
 * power, and all of it becomes heat. A load that turns the motor back overcomes the same drag. The
 * implicit integrator is stable with any drag and any resistance. */
TEST(saturated_motor_turns_and_heats_by_its_closed_form)
{
    static const struct {
        enum plant_integrator integrator;
        struct robot_effects effects;
    } rows[] = {
        {PLANT_IMPLICIT, {.saturation = 2.0, .iron = 0.05, .skin = 0.2, .standby = 3.0}},
        {PLANT_RK4, {.saturation = 2.0, .iron = 0.05, .skin = 0.2, .standby = 3.0}},
        {PLANT_IMPLICIT, {.saturation = 1e9, .iron = 1e6, .standby = 1e6}},
        {PLANT_IMPLICIT, {.saturation = 1e9, .iron = 1.0, .skin = 1e6, .standby = 3.0}},
    };
    struct robot_sea sea = toy_drive(0.0);

    sea.Ds = 0.0;
    sea.Dm = 5.0;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const int steps = rows[i].integrator == PLANT_IMPLICIT ? 1 : 100;
        const struct robot_effects *effects = &rows[i].effects;
        const struct robot_sea *drive;
        double I, w, s, R, damping, back;
        struct plant_energy energy;
        struct bench b;

        bench_begin(&b, sea, *effects, false, rows[i].integrator, MS / steps);
        drive = &b.on.toy.joint[0].sea;
        plant_clamp(b.plant, true);
        b.motor->bridge_on = true;
        b.motor->voltage_v = 12.0;
        for (int k = 0; k < 2000; k++) {
            assert_ok(plant_step(b.plant, (size_t)steps));
        }
        I = b.drive[DRIVE_CURRENT];
        w = b.drive[DRIVE_MOTOR_SPEED];
        s = 1.0 / sqrt(1.0 + I * I / (effects->saturation * effects->saturation));
        R = sea.R + effects->skin * sqrt(w);
        damping = sea.Dm + effects->iron * I * I;
        assert_true(w > 0.0);
        assert_near(R * I + s * sea.Kw * w, 12.0, 1e-8);
        assert_near(damping * w, s * sea.Kt * I, 1e-9 * sea.Kt * I + 1e-9);
        assert_near(steady_current(drive, 12.0, w), I, 1e-8 * I);
        assert_near(steady_speed(drive, 12.0, 0.0), w, 1e-8 * w);
        assert_near(effects_current(drive, s * sea.Kt * I), I, 1e-9 * I);
        back = effects_current(drive, steady_motor(drive, 20.0, w, -1));
        assert_near(sea.Kt * back / sqrt(1.0 + pow(back / effects->saturation, 2.0)) +
                        (sea.Dm + effects->iron * back * back) * w,
                    20.0, 1e-8);
        assert_ok(plant_energy(b.plant, &energy));
        assert_near(energy.balance, 0.0, 3e-5 * energy.electrical_in);
        assert_ok(plant_restart_energy(b.plant));
        assert_ok(plant_step(b.plant, (size_t)steps));
        assert_ok(plant_energy(b.plant, &energy));
        assert_near(energy.electrical_in, (12.0 * I + effects->standby) * 1e-3, 1e-9);
        assert_near(energy.bridge_loss, effects->standby * 1e-3, 1e-9);
        assert_near(energy.motor_friction, damping * w * w * 1e-3, 1e-9);
        bench_end(&b);
    }
}
