/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The implicit integrator on a toy walker with and without ground, free bodies and ties: its order,
 * that neither stiff nor soft springs nor stiff contact upset it, and that it neither makes energy
 * nor momentum. References are dopri5 at 1e-9 and rk4 with short steps.
 */

#include "tests/physics/free_rig.h"
#include "tests/physics/plant_rig.h"

enum { MOST_STATES = 128, MS = 1000000 };

/* Where the walker's q and its joints' part of it are. */
enum { JOINTS_BEGIN = 7, JOINTS_END = 15 };

/* Root mean square of the difference of a part of two states. */
static double distance(const double *a, const double *b, size_t begin, size_t end)
{
    double sum = 0.0;

    for (size_t i = begin; i < end; i++) {
        sum += (a[i] - b[i]) * (a[i] - b[i]);
    }
    return sqrt(sum / (double)(end - begin));
}

/* Angular momentum of the first free body about its center of mass, world frame, kg m2/s. */
static void free_angular_momentum(const struct free_rig *rig, double momentum[3])
{
    double R[9], own[3];

    sym3_apply(rig->body[0].inertia.I, rig->free + PLANT_FREE_SPIN, own);
    mat3_from_quaternion(rig->free + PLANT_FREE_QUATERNION, R);
    mat3_apply(R, own, momentum);
}

/* What the walker is asked to do. */
struct task {
    bool on_ground;
    double Ks; /* of all springs, 0 = their own */
    double voltage;
    int milliseconds;
};

/* Runs it and copies the state; voltages change every 20 ms. */
static void run_walker(const struct task *task, enum plant_integrator integrator,
                       int64_t substep_ns, double *state)
{
    struct plant_rig rig CLOSED_BY(plant_rig_fini);

    plant_rig_walker_with(&rig, task->on_ground, integrator, substep_ns, task->Ks);
    plant_rig_reset(&rig, task->on_ground ? 0.52 : 1.0);
    for (int k = 0; k < task->milliseconds; k++) {
        if (k % 20 == 0) {
            plant_rig_random_voltages(&rig, task->voltage);
        }
        assert_ok(plant_step(rig.plant, (size_t)(MS / substep_ns)));
    }
    assert_true(rig.count <= MOST_STATES);
    memcpy(state, rig.state, rig.count * sizeof *state);
}

TEST(dopri5_is_where_rk4_with_short_steps_is)
{
    const struct task tasks[] = {{false, 0.0, 10.0, 100}, {true, 0.0, 10.0, 100}};
    static double adaptive[MOST_STATES], fixed[MOST_STATES];

    for (int n = 0; n < 2; n++) {
        run_walker(&tasks[n], PLANT_DOPRI5, MS, adaptive);
        run_walker(&tasks[n], PLANT_RK4, 10000, fixed);
        print_message("# on ground %d: difference %.1e\n", tasks[n].on_ground,
                      distance(adaptive, fixed, 0, JOINTS_END));
        assert_true(distance(adaptive, fixed, 0, JOINTS_END) < 1e-6);
    }
}

TEST(it_converges_with_order_two)
{
    const struct task tasks[] = {{false, 0.0, 10.0, 100}, {true, 0.0, 10.0, 100}};
    static double reference[MOST_STATES], found[MOST_STATES];

    for (int n = 0; n < 2; n++) {
        double previous = 0.0, slope = 0.0;

        run_walker(&tasks[n], PLANT_DOPRI5, MS, reference);
        for (int64_t h = MS; h >= MS / 64; h /= 2) {
            double error;

            run_walker(&tasks[n], PLANT_IMPLICIT, h, found);
            error = distance(found, reference, 0, JOINTS_END);
            slope = h < MS ? log2(previous / error) : 0.0;
            print_message("# on ground %d, h = %.4f ms: error %.2e, order %.2f\n",
                          tasks[n].on_ground, 1e-6 * (double)h, error, slope);
            previous = error;
        }
        assert_near(slope, 2.0, 0.05);
    }
}

TEST(springs_of_any_stiffness_are_stable_at_a_millisecond)
{
    const double stiffness[] = {1.2e-3, 0.1, 10.0, 395.46, 8400.0};
    static double reference[MOST_STATES], found[MOST_STATES];

    for (int n = 0; n < 10; n++) {
        const struct task task = {
            .on_ground = n % 2, .Ks = stiffness[n / 2], .voltage = 5.0, .milliseconds = 300};
        double error;

        run_walker(&task, PLANT_IMPLICIT, MS, found);
        run_walker(&task, PLANT_RK4, 20000, reference);
        error = distance(found, reference, JOINTS_BEGIN, JOINTS_END - 1);
        print_message("# Ks = %g N m/rad, on ground %d: error %.2e rad\n", task.Ks, task.on_ground,
                      error);
        assert_true(error < 0.03);
    }
}

/* Deflected springs swing in free fall, motors off. The joints' and springs' energy fades. */
TEST(swinging_in_free_fall_gains_no_energy)
{
    struct plant_rig rig CLOSED_BY(plant_rig_fini);
    struct plant_energy energy;
    double start, last, gain = 0.0;

    plant_rig_walker_with(&rig, false, PLANT_IMPLICIT, MS, 0.0);
    plant_rig_reset(&rig, 1.0);
    for (size_t i = 0; i < 7; i++) {
        rig.state[rig.toy.robot.nq + rig.toy.robot.nv + 3 * i] += 0.2; /* motor angles */
    }
    assert_ok(plant_restart_energy(rig.plant));
    assert_ok(plant_energy(rig.plant, &energy));
    start = last = energy.stored;
    for (int k = 0; k < 500; k++) {
        assert_ok(plant_step(rig.plant, 1));
        assert_ok(plant_energy(rig.plant, &energy));
        gain = fmax(gain, energy.stored - last);
        last = energy.stored;
    }
    print_message("# stored energy %.3f J less, largest gain of a step %.1e J\n", start - last,
                  gain);
    assert_true(last < start - 1.0);
    assert_true(gain < 1e-4 * (start - last));
}

/* A box that tumbles freely for ten seconds at 30 rad/s keeps its energy, and its angular momentum
 * to the order of the step. */
TEST(tumbling_keeps_energy_and_momentum)
{
    double gain[2], turned[2];

    for (int n = 0; n < 2; n++) {
        struct free_rig rig CLOSED_BY(free_rig_fini);
        struct plant_energy energy;
        double start, before[3], after[3], change[3];

        free_rig_post(&rig, 1, n == 0 ? MS : MS / 2);
        rig.config.integrator = PLANT_IMPLICIT;
        rig.toy.robot.gravity[2] = 0.0;
        rig.body[0].w[0] = rig.body[0].w[1] = rig.body[0].w[2] = 30.0 / sqrt(3.0);
        free_rig_start(&rig);
        free_angular_momentum(&rig, before);
        assert_ok(plant_energy(rig.plant, &energy));
        start = energy.stored;
        assert_ok(plant_step(rig.plant, n == 0 ? 10000 : 20000));
        assert_ok(plant_energy(rig.plant, &energy));
        free_angular_momentum(&rig, after);
        vec3_sub(after, before, change);
        gain[n] = energy.stored / start - 1.0;
        turned[n] = sqrt(vec3_dot(change, change) / vec3_dot(before, before));
    }
    print_message("# at 30 rad/s, in ten seconds: %.2e of the energy at 1 ms, %.2e at 0.5 ms; "
                  "momentum off by %.2e and %.2e\n",
                  gain[0], gain[1], turned[0], turned[1]);
    assert_near(gain[0], 0.0, 1e-4);
    assert_near(turned[0] / turned[1], 4.0, 0.2);
    assert_true(turned[0] < 0.01);
}

/* Stiff ground, friction whose damping of a foot has a time constant of 10 us, stiff springs. */
static void run_on_sticky_ground(enum plant_integrator integrator, int64_t substep_ns,
                                 double *state)
{
    struct plant_rig rig CLOSED_BY(plant_rig_fini);

    plant_rig_walker_with(&rig, true, integrator, substep_ns, 8400.0);
    rig.ground.k = 2e5;
    rig.ground.c = 10.0;
    rig.ground.slip = 300.0;
    plant_rig_reset(&rig, 0.52);
    assert_ok(plant_step(rig.plant, (size_t)(150 * MS / substep_ns)));
    memcpy(state, rig.state, rig.count * sizeof *state);
}

TEST(stiff_and_sticky_ground_is_stable_at_a_millisecond)
{
    static double found[MOST_STATES], reference[MOST_STATES];
    double error;

    run_on_sticky_ground(PLANT_IMPLICIT, MS, found);
    run_on_sticky_ground(PLANT_RK4, 5000, reference);
    error = distance(found, reference, 0, JOINTS_END);
    print_message("# error %.2e\n", error);
    assert_true(error < 5e-3);
}

TEST(equal_runs_give_equal_bits)
{
    uint64_t hash[2];

    for (int n = 0; n < 2; n++) {
        struct free_rig rig CLOSED_BY(free_rig_fini);

        free_rig_tied(&rig, MS);
        rig.config.integrator = PLANT_IMPLICIT;
        free_rig_start(&rig);
        assert_ok(plant_step(rig.plant, 300));
        hash[n] = plant_hash(rig.plant);
    }
    assert_true(hash[0] == hash[1]);
}

/* A box falls on stiff ground beside the walker, and rests. */
TEST(a_free_box_comes_to_rest_on_the_ground)
{
    struct free_rig rig CLOSED_BY(free_rig_fini);
    const struct contact_wrench *wrench;
    double weight;

    free_rig_walker_on_ground(&rig, MS);
    rig.config.integrator = PLANT_IMPLICIT;
    rig.ground.k = 1e5;
    rig.ground.c = 5.0;
    rig.body[0].position[2] = 0.1;
    free_rig_start(&rig);
    plant_clamp(rig.plant, true);
    assert_ok(plant_step(rig.plant, 1500));
    assert_ok(plant_sample(rig.plant));
    wrench = plant_contact_wrenches(rig.plant);
    weight = 9.81 * rig.body[0].inertia.mass;
    assert_near(wrench[2].force[2], weight, 1e-3 * weight);
    for (int i = 7; i < PLANT_FREE_STATE; i++) {
        assert_near(rig.free[i], 0.0, 1e-3);
    }
}

/* Moves the box to where the tie has no length, and starts. */
static void start_tied(struct free_rig *rig)
{
    const struct body_motion *foot;
    double at[3];

    free_rig_start(rig);
    foot = &plant_motion(rig->plant)[TOY_LEFT_FOOT];
    mat3_apply(foot->R, rig->tie.point[0], at);
    for (int i = 0; i < 3; i++) {
        rig->body[0].position[i] = foot->p[i] + at[i] - rig->tie.point[1][i];
    }
    free_rig_start(rig);
}

/* Walker and box, tied. What the tie gives to the one it takes from the other, whatever its
 * stiffness: that needs the coupled system to be solved, not only its diagonal blocks. */
TEST(a_tie_of_any_stiffness_conserves_momentum)
{
    const double stiffness[] = {400.0, 1e5, 1e8};

    for (int n = 0; n < 3; n++) {
        struct free_rig rig CLOSED_BY(free_rig_fini);
        double center[3], robot[3], box, total, seconds = 0.3, given, length;

        free_rig_tied(&rig, MS);
        rig.config.integrator = PLANT_IMPLICIT;
        rig.tie.k = stiffness[n];
        rig.tie.d = 1e-2 * stiffness[n];
        start_tied(&rig);
        for (int k = 0; k < 300; k++) {
            if (k % 20 == 0) {
                for (size_t j = 0; j < 8; j++) {
                    plant_command(rig.plant)->motor[j].bridge_on = true;
                    plant_command(rig.plant)->motor[j].voltage_v = k % 40 ? 10.0 : -10.0;
                }
            }
            assert_ok(plant_step(rig.plant, 1));
        }
        plant_center_of_mass(rig.plant, center, robot);
        box = rig.body[0].inertia.mass * rig.free[9];
        total = robot[2] + box;
        given = -9.81 * seconds * (rig.toy.robot.total_mass + rig.body[0].inertia.mass);
        length = sqrt(rig.tie.stretch);
        print_message("# k = %g N/m: momentum %.4f of %.4f kg m/s, tie %.1e m long\n", stiffness[n],
                      total, given, length);
        assert_near(total, given, 1e-3 * fabs(given));
        assert_true(n == 0 || length < 0.01);
    }
}

TEST(tied_bodies_converge_with_order_two)
{
    static double reference[MOST_STATES];
    double previous = 0.0, slope = 0.0;

    for (int64_t h = 0; h == 0 || h >= MS / 32; h = h == 0 ? MS : h / 2) {
        struct free_rig rig CLOSED_BY(free_rig_fini);

        free_rig_tied(&rig, h == 0 ? MS : h);
        rig.config.integrator = h == 0 ? PLANT_DOPRI5 : PLANT_IMPLICIT;
        rig.config.rtol = rig.config.atol = 1e-9;
        rig.tie.k = 1e4;
        rig.tie.d = 50.0;
        start_tied(&rig);
        assert_ok(plant_step(rig.plant, (size_t)(100 * MS / (h == 0 ? MS : h))));
        if (h == 0) {
            memcpy(reference, rig.state, rig.count * sizeof *reference);
        } else {
            double error = distance(rig.state, reference, 0, JOINTS_END);

            slope = log2(previous / error);
            print_message("# h = %.4f ms: error %.2e, order %.2f\n", 1e-6 * (double)h, error,
                          h < MS ? slope : 0.0);
            previous = error;
        }
    }
    assert_near(slope, 2.0, 0.05);
}

TEST(a_contact_engine_without_tangents_is_refused)
{
    struct free_rig rig CLOSED_BY(free_rig_fini);
    struct contact_ops ops;
    struct plant *plant = NULL;
    struct error error = {0};

    free_rig_tied(&rig, MS);
    ops = *rig.tie.world.ops;
    ops.tangents = NULL;
    rig.tie.world.ops = &ops;
    rig.config.integrator = PLANT_IMPLICIT;
    assert_ok(dynamics_generic(&rig.toy.robot, &rig.arena, &rig.dynamics, &error));
    assert_int_equal(plant_create(&rig.config, &rig.arena, &plant, &error), ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "tie gives no tangents"));
    rig.config.integrator = PLANT_DOPRI5;
    assert_int_equal(plant_create(&rig.config, &rig.arena, &plant, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "tolerances are 0 and 0"));
}

/* The engine's failure stops the step and leaves the last good state. */
TEST(a_failing_contact_engine_stops_the_step)
{
    const enum plant_integrator integrators[] = {PLANT_IMPLICIT, PLANT_DOPRI5};

    for (int n = 0; n < 2; n++) {
        struct plant_rig rig CLOSED_BY(plant_rig_fini);
        uint64_t hash;

        plant_rig_walker_with(&rig, true, integrators[n], MS, 0.0);
        plant_rig_reset(&rig, 0.52);
        assert_ok(plant_step(rig.plant, 5));
        hash = plant_hash(rig.plant);
        rig.ground.fail_at = rig.ground.evaluations + 1;
        assert_int_equal(plant_step(rig.plant, 1), ERROR_SYSTEM);
        assert_string_equal(plant_failure(rig.plant), "the toy ground gave way");
        assert_true(plant_hash(rig.plant) == hash);
    }
}
