/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the default integrator at its default step of 1 ms makes of COMAN's rig, against dopri5 with
 * a tolerance of 1e-9 (or a closed form): a locked rotor, one joint under voltage, a drop, tumbling
 * and the energy account of each.
 */

#include "tests/figure.h"
#include "tests/physics/free_rig.h"
#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"

enum { DENSE = 50, MS = 1000000, DROPS = 8 };

static struct rig_scene scene;

static void begin_scene(enum plant_integrator integrator)
{
    const struct rig_scene_choice choice = {.file = "coman.yaml",
                                            .integrator = integrator,
                                            .substep_ns =
                                                integrator == PLANT_DOPRI5 ? MS / DENSE : MS,
                                            .tolerance = 1e-9};

    rig_scene_init(&scene, &choice);
}

/* ---- drop ---- */

struct drop {
    double peak, lost, balance, energy[600];
    uint64_t evaluations;
};

/* Returns the sum of the largest forces on the feet in the last step, N. */
static double feet_peak(void)
{
    double peak = 0.0;

    for (size_t c = 0; c < scene.rig->contact.nbody; c++) {
        const int body = scene.rig->contact_body[c];

        if (body == robot_find_body(scene.robot, "RFoot") ||
            body == robot_find_body(scene.robot, "LFoot")) {
            peak += plant_contact_peaks(scene.plant)[c];
        }
    }
    return peak;
}

/* Drops it from 0.5 m and so much more. */
static void drop_robot(enum plant_integrator integrator, double more_m, struct drop *drop)
{
    double position[3];
    struct plant_energy energy;

    begin_scene(integrator);
    memcpy(position, scene.rig->base_position, sizeof position);
    position[2] += 0.5 + more_m;
    assert_ok(plant_reset(scene.plant, position, scene.rig->base_quaternion, scene.rig->joint));
    drop->peak = 0.0;
    for (int k = 0; k < (integrator == PLANT_DOPRI5 ? 400 * DENSE : 400); k++) {
        assert_ok(plant_step(scene.plant, 1));
        assert_ok(plant_sample(scene.plant));
        drop->peak = fmax(drop->peak, feet_peak());
    }
    assert_ok(plant_energy(scene.plant, &energy));
    drop->lost = energy.contact_dissipation;
    drop->balance = energy.balance;
    drop->evaluations = plant_contact_cost(scene.plant)->evaluations;
    print_message("# %s: peak %.0f N, %.2f J in contacts, balance %.2e J, stored %.3f, damping "
                  "%.3f, joule %.3f friction %.3f, %llu evaluations\n",
                  integrator == PLANT_DOPRI5 ? "dopri5" : "implicit", drop->peak, drop->lost,
                  drop->balance, energy.stored, energy.spring_damping, energy.joule_heat,
                  energy.motor_friction, (unsigned long long)drop->evaluations);
    rig_scene_fini(&scene);
}

TEST(a_drop_peaks_as_it_should)
{
    static struct drop oracle, found, other;
    double balance;

    drop_robot(PLANT_DOPRI5, 0.0, &oracle);
    drop_robot(PLANT_IMPLICIT, 0.0, &found);
    assert_near(found.peak / oracle.peak, 1.0, 0.05);

    /* The impact is shorter than a step: what the balance misses depends on when within a step it
     * begins, as the force at the tick does. From eight heights, a step's way of 3.1 mm in all */
    balance = fabs(found.balance);
    for (int k = 1; k < DROPS; k++) {
        drop_robot(PLANT_IMPLICIT, 4e-4 * k, &other);
        balance += fabs(other.balance);
        assert_near(other.balance / oracle.lost, 0.0, 0.035);
    }
    balance /= DROPS;
    assert_true(balance < 0.02 * oracle.lost);
    figure_hold("drop_exact_n", oracle.peak);
    figure_hold("drop_peak_n", found.peak);
    figure_hold("drop_lost_j", oracle.lost);
    figure_hold("drop_balance_percent", 100.0 * balance / oracle.lost);
}

/* ---- one drive, one joint ---- */

struct joint_rig {
    struct toy toy;
    struct arena arena;
    struct dynamics dynamics;
    struct plant *plant;
    double *state;
};

/* A link of 2 kg on a fixed base, about a horizontal axis. */
static void joint_rig_init(struct joint_rig *rig, double Ks, enum plant_integrator integrator)
{
    const double none[3] = {0.0, 0.0, 0.0}, com[3] = {0.0, 0.0, -0.2}, y[3] = {0.0, 1.0, 0.0};
    const double I[6] = {0.02, 0.0, 0.0, 0.02, 0.0, 0.002};
    struct plant_config config = {.robot = &rig->toy.robot,
                                  .dynamics = &rig->dynamics,
                                  .integrator = integrator,
                                  .substep_ns = MS,
                                  .rtol = 1e-10,
                                  .atol = 1e-10,
                                  .supply_v = 48.0,
                                  .account_energy = true};
    struct error error;
    size_t count;

    toy_begin(&rig->toy, false, 1.0, none, I);
    rig->toy.joint[toy_add(&rig->toy, 0, JOINT_REVOLUTE, y, none, 2.0, com, I)].sea = toy_drive(Ks);
    toy_finish(&rig->toy);
    assert_ok(arena_init(&rig->arena, 1 << 20, &error));
    assert_ok(dynamics_generic(&rig->toy.robot, &rig->arena, &rig->dynamics, &error));
    assert_ok(plant_create(&config, &rig->arena, &rig->plant, &error));
    rig->state = plant_state(rig->plant, &count);
    assert_ok(plant_reset(rig->plant, NULL, NULL, (const double[1]){0.0}));
}

/* The current of a rotor that is held, after each tick: V/R (1 - exp(-R t/L)). */
TEST(the_current_of_a_locked_rotor_is_exact)
{
    const struct robot_sea sea = toy_drive(395.46);
    struct joint_rig rig;

    joint_rig_init(&rig, 395.46, PLANT_IMPLICIT);
    plant_command(rig.plant)->motor[0] =
        (struct motor_command){.bridge_on = true, .voltage_v = 48.0, .condition = DRIVE_JAM};
    plant_clamp(rig.plant, true);
    for (int k = 1; k <= 10; k++) {
        const double exact = 48.0 / sea.R * -expm1(-sea.R / sea.L * 1e-3 * k);

        assert_ok(plant_step(rig.plant, 1));
        assert_near(rig.state[2 + DRIVE_CURRENT] / exact, 1.0, 1e-12);
    }
    arena_fini(&rig.arena);
}

/* The decay of a drive's spring, motor against a clamped link, is that of its poles. */
TEST(a_spring_rings_as_long_as_it_should)
{
    const double stiffness[] = {395.46, 8400.0};

    for (int n = 0; n < 2; n++) {
        const struct robot_sea sea = toy_drive(stiffness[n]);
        const double rate = 0.5 * (sea.Dm + sea.Ds) / sea.J;
        const double swing = sqrt(sea.Ks / sea.J - rate * rate);
        struct joint_rig rig;

        joint_rig_init(&rig, stiffness[n], PLANT_IMPLICIT);
        plant_clamp(rig.plant, true);
        rig.state[2 + DRIVE_MOTOR_POSITION] = 0.1;
        for (int k = 1; k <= 100; k++) {
            const double t = 1e-3 * k;
            const double exact =
                0.1 * exp(-rate * t) * (cos(swing * t) + rate / swing * sin(swing * t));

            assert_ok(plant_step(rig.plant, 1));
            assert_near(rig.state[2 + DRIVE_MOTOR_POSITION], exact, 1e-12);
        }
        arena_fini(&rig.arena);
    }
}

enum { VOLTAGE_MS = 1000 };

struct voltage_run {
    double q[VOLTAGE_MS], current[VOLTAGE_MS];
    struct plant_energy energy;
};

/* Steps of 48 V every 50 ms, then a sine of 48 V and 5 Hz held over each tick. */
static void run_voltage(enum plant_integrator integrator, double Ks, struct voltage_run *run)
{
    struct joint_rig rig;

    joint_rig_init(&rig, Ks, integrator);
    for (int k = 0; k < VOLTAGE_MS; k++) {
        plant_command(rig.plant)->motor[0] = (struct motor_command){
            .bridge_on = true,
            .voltage_v = k < VOLTAGE_MS / 2 ? (k / 50 % 2 ? -48.0 : 48.0)
                                            : 48.0 * sin(2.0 * M_PI * 5.0 * 1e-3 * k)};
        assert_ok(plant_step(rig.plant, 1));
        run->q[k] = rig.state[0];
        run->current[k] = rig.state[2 + DRIVE_CURRENT];
    }
    assert_ok(plant_energy(rig.plant, &run->energy));
    arena_fini(&rig.arena);
}

TEST(a_joint_under_voltage_is_where_dopri5_is)
{
    const double stiffness[] = {395.46, 8400.0};
    static struct voltage_run oracle, found;
    double way = 0.0, worst = 0.0;

    for (int n = 0; n < 2; n++) {
        double low = 0.0, high = 0.0, off = 0.0, peak = 0.0, current = 0.0, turnover;

        run_voltage(PLANT_DOPRI5, stiffness[n], &oracle);
        run_voltage(PLANT_IMPLICIT, stiffness[n], &found);
        for (int k = 0; k < VOLTAGE_MS; k++) {
            low = fmin(low, oracle.q[k]);
            high = fmax(high, oracle.q[k]);
            off = fmax(off, fabs(found.q[k] - oracle.q[k]));
            peak = fmax(peak, fabs(oracle.current[k]));
            current = fmax(current, fabs(found.current[k] - oracle.current[k]));
        }
        turnover =
            oracle.energy.joule_heat + oracle.energy.motor_friction + oracle.energy.spring_damping;
        print_message("# Ks %g: joint off by %.2e of its way of %.3f rad, current by %.2e of "
                      "%.1f A, balance %.2e J (dopri5 %.1e) of %.1f J, spring damping %.4f of "
                      "%.4f J\n",
                      stiffness[n], off / (high - low), high - low, current / peak, peak,
                      found.energy.balance, oracle.energy.balance, turnover,
                      found.energy.spring_damping, oracle.energy.spring_damping);
        assert_true(off < 5e-3 * (high - low));
        assert_true(current < 0.01 * peak);
        assert_near(found.energy.balance, 0.0, 1e-3 * turnover);
        way = fmax(way, 100.0 * off / (high - low));
        worst = fmax(worst, 100.0 * current / peak);
    }
    figure_hold("voltage_way_percent", way);
    figure_hold("voltage_current_percent", worst);
}

/* ---- bounce ---- */

/* How fast a box that hits the ground flat at 1 m/s leaves it. */
static double bounce_box(enum plant_integrator integrator, double k)
{
    struct free_rig rig;
    double speed;

    free_rig_post(&rig, 1, MS);
    toy_ground_begin(&rig.ground, 1);
    for (int corner = 0; corner < 4; corner++) {
        toy_ground_add(&rig.ground, 0, corner & 1 ? 0.085 : -0.065, corner & 2 ? 0.055 : -0.095,
                       -0.075);
    }
    rig.ground.k = 0.25 * k;
    rig.ground.c = 0.1;
    rig.ground.slip = 0.0;
    rig.contact_body[0] = (int)rig.toy.robot.nbody;
    rig.config.contact = &rig.ground.world;
    rig.config.ncontact = 1;
    rig.config.integrator = integrator;
    rig.config.rtol = rig.config.atol = 1e-9;
    rig.toy.robot.gravity[2] = 0.0;
    rig.body[0].position[2] = 0.075 + 0.0203;
    rig.body[0].v[2] = -1.0;
    free_rig_start(&rig);
    assert_ok(plant_step(rig.plant, 100));
    speed = rig.free[PLANT_FREE_VELOCITY + 2];
    free_rig_fini(&rig);
    return speed;
}

TEST(a_box_bounces_as_it_should)
{
    const double stiffness[] = {1e4, 1e5, 1e6, 1e7, 1e8};
    double slowest = 1.0, fastest = 0.0;

    for (int n = 0; n < 5; n++) {
        double exact = bounce_box(PLANT_DOPRI5, stiffness[n]);
        double found = bounce_box(PLANT_IMPLICIT, stiffness[n]);

        print_message("# k = %g N/m: leaves at %.4f m/s, exact %.4f\n", stiffness[n], found, exact);
        assert_near(found / exact, 1.0, stiffness[n] < 5e6 ? 0.01 : 0.1);
        assert_true(found <= 1.0);
        slowest = fmin(slowest, found);
        fastest = fmax(fastest, found);
    }
    figure_hold("bounce_exact_m_s", bounce_box(PLANT_DOPRI5, stiffness[0]));
    figure_hold("bounce_slowest_m_s", slowest);
    figure_hold("bounce_fastest_m_s", fastest);
}

/* ---- tumbling ---- */

enum { BODIES = 64 };

/* The angular momentum of all bodies about their common center of mass, kg m2/s. */
static void angular_momentum(double L[3])
{
    const struct robot *robot = scene.robot;
    size_t count;
    const double *q = plant_state(scene.plant, &count);
    struct body_motion motion[BODIES];
    double center[3] = {0.0, 0.0, 0.0}, p[3] = {0.0, 0.0, 0.0}, turn[3];

    assert_true(robot->nbody <= BODIES);
    memset(L, 0, 3 * sizeof *L);
    scene.dynamics.ops->kinematics(&scene.dynamics, q, q + robot->nq, motion);
    for (size_t b = 0; b < robot->nbody; b++) {
        const struct robot_inertia *inertia = &robot->body[b].inertia;
        double arm[3], place[3], v[3], w[3], own[3], spin[3];

        mat3_apply(motion[b].R, inertia->com, arm);
        memcpy(v, motion[b].v, sizeof v);
        vec3_add_cross(motion[b].w, arm, v);
        mat3_apply_transposed(motion[b].R, motion[b].w, w);
        sym3_apply(inertia->I, w, own);
        mat3_apply(motion[b].R, own, spin);
        for (int i = 0; i < 3; i++) {
            v[i] *= inertia->mass;
            place[i] = motion[b].p[i] + arm[i];
            p[i] += v[i];
            center[i] += inertia->mass * place[i] / robot->total_mass;
            L[i] += spin[i];
        }
        vec3_add_cross(place, v, L);
    }
    vec3_cross(center, p, turn);
    vec3_sub(L, turn, L);
}

/* Limp, at 30 rad/s, for ten seconds: what is lost beyond all that dissipates. */
TEST(tumbling_keeps_its_energy)
{
    struct plant_energy before, after;
    double position[3] = {0.0, 0.0, 1000.0}, L[3], then[3], energy, turned, *rates;
    size_t count;

    begin_scene(PLANT_IMPLICIT);
    assert_ok(plant_reset(scene.plant, position, scene.rig->base_quaternion, scene.rig->joint));
    rates = plant_state(scene.plant, &count) + scene.robot->nq;
    rates[BASE_V_ANGULAR] = 10.0;
    rates[BASE_V_ANGULAR + 1] = 25.0;
    rates[BASE_V_ANGULAR + 2] = 13.0;
    assert_ok(plant_restart_energy(scene.plant));
    assert_ok(plant_energy(scene.plant, &before));
    angular_momentum(L);
    for (int k = 0; k < 10000; k++) {
        assert_ok(plant_step(scene.plant, 1));
    }
    assert_ok(plant_energy(scene.plant, &after));
    angular_momentum(then);
    vec3_sub(then, L, then);
    turned = vec3_norm(then) / vec3_norm(L);
    energy = before.stored + scene.robot->total_mass * scene.robot->gravity[2] * 1000.0;
    print_message("# COMAN tumbling: %.1f J, balance %.2e J (%.1e), angular momentum off by %.1e; "
                  "it turns at %.1f rad/s then\n",
                  energy, after.balance, after.balance / energy, turned,
                  vec3_norm(rates + BASE_V_ANGULAR));
    assert_near(after.balance / energy, 0.0, 1e-3);
    assert_near(turned, 0.0, 1e-3);
    figure_hold("tumbling_balance_percent", 100.0 * fabs(after.balance / energy));
    figure_hold("tumbling_momentum_percent", 100.0 * turned);
    rig_scene_fini(&scene);
}
