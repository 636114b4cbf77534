/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Free bodies in the plant. References: the parabola, Jacobi's solution of Euler's equations
 * (Landau, Lifshitz, Mechanics, section 37), conservation of momentum and energy, statics.
 */

#include "tests/physics/free_rig.h"
#include "tests/physics/near.h"

static const double gravity = 9.81;

static void step(struct free_rig *rig, size_t steps)
{
    if (plant_step(rig->plant, steps) != ERROR_NONE) {
        fail_msg("%s", plant_failure(rig->plant));
    }
    assert_ok(plant_sample(rig->plant));
}

/* ---- where it is ---- */

CLOSED_BENCH(free_rig, struct free_rig, free_rig_fini)

TEST_ON(body_starts_where_it_is_put, free_rig, rig)
{
    const struct body_motion *motion;
    double pose[7], R[9];

    free_rig_post(rig, 2, 1000000);
    rig->body[1] = (struct plant_free_body){.name = "other",
                                            .inertia = rig->body[0].inertia,
                                            .position = {0.3, -0.4, 0.5},
                                            .quaternion = {1.6, 0.4, -0.6, 0.2},
                                            .v = {0.1, 0.2, -0.3},
                                            .w = {1.0, -2.0, 3.0}};
    free_rig_start(rig);
    motion = plant_motion(rig->plant) + rig->toy.robot.nbody;
    plant_free_pose(rig->plant, 1, pose);
    mat3_from_quaternion(rig->body[1].quaternion, R);
    for (int i = 0; i < 3; i++) {
        assert_near(motion[0].p[i], 0.0, 1e-16);
        assert_near(motion[1].p[i], rig->body[1].position[i], 1e-15);
        assert_near(pose[i], rig->body[1].position[i], 1e-15);
        assert_near(motion[1].v[i], rig->body[1].v[i], 1e-15);
        assert_near(motion[1].w[i], rig->body[1].w[i], 1e-14);
    }
    for (int i = 0; i < 9; i++) {
        assert_near(motion[1].R[i], R[i], 1e-15);
    }
    assert_near(pose[3], 1.6 / sqrt(2.56 + 0.16 + 0.36 + 0.04), 1e-15);
}

/* The center of mass is on its parabola, however the body turns: to rounding, since Runge-Kutta
 * integrates polynomials of this degree exactly. */
TEST_ON(falls_on_a_parabola, free_rig, rig)
{
    const double t = 1.5;
    double start[3], v[3];

    free_rig_post(rig, 1, 5000000);
    memcpy(rig->body[0].v, (const double[3]){0.7, -0.3, 2.0}, sizeof rig->body[0].v);
    memcpy(rig->body[0].w, (const double[3]){3.0, 5.0, -4.0}, sizeof rig->body[0].w);
    free_rig_start(rig);
    memcpy(start, rig->free, sizeof start);
    memcpy(v, rig->free + 7, sizeof v);
    step(rig, 300);
    for (int i = 0; i < 3; i++) {
        double a = i == 2 ? -gravity : 0.0;

        assert_near(rig->free[i], start[i] + v[i] * t + 0.5 * a * t * t, 1e-12);
        assert_near(rig->free[7 + i], v[i] + a * t, 1e-12);
    }
}

/* ---- how it turns ---- */

/* sn, cn, dn of u for the parameter m = k^2 by descending Landen's transformation (Abramowitz,
 * Stegun, 16.4) */
static void jacobi(double u, double m, double *sn, double *cn, double *dn)
{
    double a[32] = {1.0}, c[32] = {sqrt(m)}, b = sqrt(1.0 - m), phi, before = 0.0;
    int n = 0;

    while (n < 30 && c[n] > 1e-17) {
        a[n + 1] = 0.5 * (a[n] + b);
        c[n + 1] = 0.5 * (a[n] - b);
        b = sqrt(a[n] * b);
        n++;
    }
    phi = ldexp(a[n] * u, n);
    for (; n > 0; n--) {
        before = phi;
        phi = 0.5 * (phi + asin(c[n] / a[n] * sin(phi)));
    }
    *sn = sin(phi);
    *cn = cos(phi);
    *dn = *cn / cos(before - phi);
}

/* A body that spins about almost its middle axis: it turns over again and again (Dzhanibekov). */
static const double moments[3] = {1e-2, 2e-2, 3e-2};
static const double spin[3] = {17.0, 0.0, 10.0}; /* about the principal axes, rad/s */

/* That body's angular velocity about its principal axes after t seconds without torque. */
static void euler_top(double t, double w[3])
{
    const double *I = moments;
    double E2 = 0.0, M2 = 0.0, over, under, rate, k2, sn, cn, dn;

    for (int i = 0; i < 3; i++) {
        E2 += I[i] * spin[i] * spin[i];
        M2 += I[i] * I[i] * spin[i] * spin[i];
    }
    over = E2 * I[2] - M2;
    under = M2 - E2 * I[0];
    rate = sqrt((I[2] - I[1]) * under / (I[0] * I[1] * I[2]));
    k2 = (I[1] - I[0]) * over / ((I[2] - I[1]) * under);
    jacobi(rate * t, k2, &sn, &cn, &dn);
    w[0] = sqrt(over / (I[0] * (I[2] - I[0]))) * cn;
    w[1] = sqrt(over / (I[1] * (I[2] - I[1]))) * sn;
    w[2] = sqrt(under / (I[2] * (I[2] - I[0]))) * dn;
}

/* Its axes lie askew in its frame, and it starts turned: every element of the tensor counts. */
static void spin_up(struct free_rig *rig, int64_t substep_ns, double axes[9])
{
    struct plant_free_body *body;
    double R[9], w[3];

    free_rig_post(rig, 1, substep_ns);
    memset(rig->toy.robot.gravity, 0, sizeof rig->toy.robot.gravity);
    mat3_from_rpy((const double[3]){0.5, -0.8, 1.3}, axes);
    body = &rig->body[0];
    memcpy(body->quaternion, (const double[4]){0.5, 0.1, -0.7, 0.3}, sizeof body->quaternion);
    memcpy(body->inertia.I, (const double[6]){moments[0], 0.0, 0.0, moments[1], 0.0, moments[2]},
           sizeof body->inertia.I);
    sym3_rotate(axes, body->inertia.I);
    mat3_apply(axes, spin, w);
    mat3_from_quaternion(body->quaternion, R);
    mat3_apply(R, w, body->w);
    free_rig_start(rig);
}

/* World, about the center of mass */
static void angular_momentum(const struct free_rig *rig, double L[3])
{
    double R[9], momentum[3];

    mat3_from_quaternion(rig->free + 3, R);
    sym3_apply(rig->body[0].inertia.I, rig->free + 10, momentum);
    mat3_apply(R, momentum, L);
}

/* Largest deviation after 5 s from Jacobi's spin, and relative ones of momentum and energy */
static void tumble(int64_t substep_ns, double error[3])
{
    struct free_rig rig CLOSED_BY(free_rig_fini);
    struct plant_energy energy;
    double axes[9], expected[3], w[3], L0[3], L[3], norm;
    int turns = 0;
    double last = 1.0;

    spin_up(&rig, substep_ns, axes);
    angular_momentum(&rig, L0);
    error[0] = error[1] = 0.0;
    for (int part = 1; part <= 500; part++) {
        step(&rig, (size_t)(10000000 / substep_ns));
        euler_top(0.01 * part, expected);
        mat3_apply_transposed(axes, rig.free + 10, w);
        for (int i = 0; i < 3; i++) {
            error[0] = fmax(error[0], fabs(w[i] - expected[i]));
        }
        turns += w[1] * last < 0.0;
        last = w[1];
    }
    angular_momentum(&rig, L);
    norm = sqrt(vec3_dot(L0, L0));
    for (int i = 0; i < 3; i++) {
        error[1] = fmax(error[1], fabs(L[i] - L0[i]) / norm);
    }
    assert_ok(plant_energy(rig.plant, &energy));
    error[2] = fabs(energy.balance) / energy.stored;
    print_message("# h = %lld us: spin off by %.2e rad/s of %.0f, angular momentum by %.1e, energy "
                  "by %.1e; turned over %d times\n",
                  (long long)(substep_ns / 1000), error[0], spin[0], error[1], error[2], turns);
    assert_in_range(turns, 5, 50);
}

TEST(tumbles_as_euler_and_jacobi_say)
{
    double coarse[3], fine[3];

    tumble(1000000, coarse);
    tumble(500000, fine);
    assert_true(fine[0] < 1e-4);
    assert_true(fine[1] < 1e-8 && fine[2] < 1e-8);
    assert_near(log2(coarse[0] / fine[0]), 4.0, 0.4);
    for (int i = 1; i < 3; i++) { /* what is conserved drifts with the order or one better */
        assert_true(log2(coarse[i] / fine[i]) > 3.6);
    }
}

/* ---- what acts on it ---- */

/* A force at the frame's origin moves the center of mass by F/m and turns the body about it. */
TEST_ON(push_moves_and_turns_it, free_rig, rig)
{
    const double force[3] = {3.0, -2.0, 5.0}, moment[3] = {0.02, 0.01, -0.03}, t = 1e-4;
    struct plant_energy energy;
    double about[3], rate[3], R[9], local[3], work = 0.0, before[3], expected[3];

    free_rig_post(rig, 2, 10000);
    memcpy(rig->body[1].quaternion, (const double[4]){0.9, 0.3, -0.2, 0.1},
           sizeof rig->body[1].quaternion);
    free_rig_start(rig);
    memcpy(before, rig->free + PLANT_FREE_STATE, sizeof before);
    plant_set_push(rig->plant, (int)rig->toy.robot.nbody + 1, force, moment);
    step(rig, 10);

    /* Moment about the center of mass, in the body: I w' = that at rest */
    mat3_from_quaternion(rig->body[1].quaternion, R);
    mat3_apply(R, rig->body[1].inertia.com, about);
    vec3_cross(force, about, local);
    for (int i = 0; i < 3; i++) {
        local[i] += moment[i];
    }
    mat3_apply_transposed(R, local, expected);
    for (int i = 0; i < 3; i++) {
        rate[i] = rig->free[PLANT_FREE_STATE + 10 + i] / t;
        work += force[i] * (rig->free[PLANT_FREE_STATE + i] - before[i]);
    }
    sym3_apply(rig->body[1].inertia.I, rate, local);
    for (int i = 0; i < 3; i++) {
        double a = force[i] / 1.5 - (i == 2 ? gravity : 0.0);

        assert_near(rig->free[PLANT_FREE_STATE + 7 + i], a * t, 1e-12);
        assert_near(local[i], expected[i], 1e-6);
        assert_near(rig->free[10 + i], 0.0, 0.0); /* the other body feels nothing */
    }
    assert_ok(plant_energy(rig->plant, &energy));
    assert_true(energy.push_work > work); /* and what turned it */
    assert_near(energy.balance, 0.0, 1e-15);
}

TEST_ON(rests_on_the_ground_with_its_weight, free_rig, rig)
{
    const struct contact_wrench *wrench;
    double depth;

    free_rig_walker_on_ground(rig, 100000);
    memset(rig->body[0].inertia.com, 0, sizeof rig->body[0].inertia.com);
    memcpy(rig->body[0].position, (const double[3]){1.0, 0.0, 0.075}, sizeof rig->body[0].position);
    rig->ground.c = 30.0;
    free_rig_start(rig);
    plant_clamp(rig->plant, true);
    step(rig, 20000);
    wrench = &plant_contact_wrenches(rig->plant)[2];
    depth = 0.075 - plant_motion(rig->plant)[rig->toy.robot.nbody].p[2];
    print_message("# %.9f N, %.6f mm deep\n", wrench->force[2], 1e3 * depth);
    assert_near(wrench->force[2], 14.715, 1e-6);
    assert_near(depth, 14.715 / (4.0 * rig->ground.k), 1e-9);
}

TEST_ON(bouncing_body_and_falling_robot_balance_their_energies, free_rig, rig)
{
    struct plant_energy energy;
    double turnover, top = 0.0;

    free_rig_walker_on_ground(rig, 50000);
    rig->body[0].position[2] = 0.4;
    memcpy(rig->body[0].quaternion, (const double[4]){0.9, 0.3, -0.2, 0.1},
           sizeof rig->body[0].quaternion);
    memcpy(rig->body[0].w, (const double[3]){4.0, -2.0, 1.0}, sizeof rig->body[0].w);
    rig->ground.c = 0.2;
    free_rig_start(rig);
    for (int k = 0; k < 1000; k++) {
        double z = rig->free[2];

        step(rig, 20);
        top = k > 400 && rig->free[2] > z ? fmax(top, rig->free[2]) : top;
    }
    assert_ok(plant_energy(rig->plant, &energy));
    turnover = energy.joule_heat + energy.motor_friction + energy.spring_damping +
               energy.parallel_damping + energy.contact_dissipation;
    print_message("# balance %.1e J of %.2f J; the box bounced to %.3f m\n", energy.balance,
                  turnover, top);
    assert_true(top > 0.1); /* it did bounce */
    assert_true(fabs(energy.balance) < 1e-6 * turnover);
}

/* ---- it and the robot ---- */

/* What the one gets the other gives: the sum of both linear momenta stays, and forces are equal and
 * opposite to the last bit. */
TEST_ON(robot_and_box_exchange_momentum, free_rig, rig)
{
    double position[3], robot[3], box[3], start[3], given;

    free_rig_tied(rig, 100000);
    memset(rig->toy.robot.gravity, 0, sizeof rig->toy.robot.gravity);
    memcpy(rig->body[0].position, (const double[3]){0.3, -0.1, 0.1}, sizeof rig->body[0].position);
    memcpy(rig->body[0].v, (const double[3]){0.5, 1.0, -0.7}, sizeof rig->body[0].v);
    memcpy(rig->body[0].w, (const double[3]){2.0, -3.0, 1.0}, sizeof rig->body[0].w);
    free_rig_start(rig);
    plant_center_of_mass(rig->plant, position, robot);
    for (int i = 0; i < 3; i++) {
        start[i] = robot[i] + 1.5 * rig->free[7 + i];
        box[i] = 1.5 * rig->free[7 + i];
    }
    for (int k = 0; k < 20; k++) {
        const struct contact_wrench *wrench;

        step(rig, 500);
        plant_center_of_mass(rig->plant, position, robot);
        wrench = plant_contact_wrenches(rig->plant);
        for (int i = 0; i < 3; i++) {
            assert_near(robot[i] + 1.5 * rig->free[7 + i], start[i], 1e-9);
            assert_near(wrench[0].force[i], -wrench[1].force[i], 0.0);
        }
    }
    given = fabs(1.5 * rig->free[7] - box[0]) + fabs(1.5 * rig->free[8] - box[1]) +
            fabs(1.5 * rig->free[9] - box[2]);
    print_message("# forces up to %.1f N; the box gave %.3f kg m/s away\n", rig->tie.impulse,
                  given);
    assert_true(rig->tie.impulse > 10.0 && given > 0.1);
}

/* World, about the world's origin */
static void whole_angular_momentum(const struct free_rig *rig, double L[3])
{
    double orbit[3];

    angular_momentum(rig, L);
    vec3_cross(rig->free + PLANT_FREE_POSITION, rig->free + PLANT_FREE_VELOCITY, orbit);
    vec3_add_scaled(L, rig->body[0].inertia.mass, orbit, L);
}

/* The mean wrench of a tick times its length is what the box's momentum and angular momentum have
 * changed by, however much the wrench changes within; at 5 ms ticks of ten steps. */
TEST_ON(mean_wrench_is_the_momentum_received, free_rig, rig)
{
    const double tick = 10 * 500000e-9;
    double changed = 0.0, least = INFINITY, most = 0.0, off = 0.0, off_at_ticks = 0.0;

    free_rig_tied(rig, 500000);
    rig->config.integrator = PLANT_IMPLICIT;
    rig->tie.k = 4e4;
    memset(rig->toy.robot.gravity, 0, sizeof rig->toy.robot.gravity);
    memcpy(rig->body[0].v, (const double[3]){0.5, 1.0, -0.7}, sizeof rig->body[0].v);
    free_rig_start(rig);
    for (int k = 0; k < 100; k++) {
        const struct contact_wrench *wrench = &plant_contact_wrenches(rig->plant)[1];
        const double *p = plant_motion(rig->plant)[rig->toy.robot.nbody].p;
        struct contact_wrench mean;
        double before[3], L[2][3], moment[2][3];

        memcpy(before, rig->free + PLANT_FREE_VELOCITY, sizeof before);
        whole_angular_momentum(rig, L[0]);
        assert_ok(plant_step(rig->plant, 10));
        assert_ok(plant_sample(rig->plant));
        plant_contact_mean(rig->plant, 1, &mean);
        whole_angular_momentum(rig, L[1]);
        vec3_cross(p, mean.force, moment[0]);
        vec3_cross(p, wrench->force, moment[1]);
        for (int i = 0; i < 3; i++) {
            const double force = 1.5 * (rig->free[PLANT_FREE_VELOCITY + i] - before[i]) / tick;
            const double turn = (L[1][i] - L[0][i]) / tick;

            assert_near(mean.force[i], force, 1e-6 * (1.0 + fabs(force)));
            changed = fmax(changed, fabs(force - wrench->force[i]));
            least = fmin(least, force);
            most = fmax(most, fabs(turn));
            off = fmax(off, fabs(mean.moment[i] + moment[0][i] - turn));
            off_at_ticks = fmax(off_at_ticks, fabs(wrench->moment[i] + moment[1][i] - turn));
        }
    }
    print_message(
        "# forces at ticks are up to %.0f N off their means; of moments of up to %.1f N m "
        "means are off by %.1e, those at ticks by %.1f\n",
        changed, most, off, off_at_ticks);
    assert_true(changed > 10.0 && least < 0.0);
    assert_true(off < 1e-3 * most && off_at_ticks > 0.1 * most);
}

/* Work that the tie does on the one is taken from the other: nothing is lost but what it damps. */
TEST_ON(energy_goes_between_robot_and_box, free_rig, rig)
{
    struct plant_energy energy;

    free_rig_tied(rig, 50000);
    rig->tie.d = 0.0;
    free_rig_start(rig);
    step(rig, 20000);
    assert_ok(plant_energy(rig->plant, &energy));
    print_message("# balance %.1e J, contact %.1e J of %.1f J stored\n", energy.balance,
                  energy.contact_dissipation, energy.stored);
    assert_near(energy.balance, 0.0, 1e-6);
    assert_near(energy.contact_dissipation, 0.0, 1e-6); /* a spring loses nothing */
}

/* The box hangs by its center of mass on a clamped robot: it swings and comes to rest, and the
 * robot does not notice. */
TEST_ON(free_bodies_live_on_beside_a_clamped_robot, free_rig, rig)
{
    const struct contact_wrench *wrench;
    double before[64];
    size_t links; /* q and v */

    free_rig_tied(rig, 100000);
    rig->tie.d = 12.0;
    memcpy(rig->tie.point[1], rig->body[0].inertia.com, sizeof rig->tie.point[1]);
    rig->body[0].position[0] = 0.4;
    free_rig_start(rig);
    plant_clamp(rig->plant, true);
    links = rig->toy.robot.nq + rig->toy.robot.nv;
    memcpy(before, rig->state, links * sizeof *before);
    step(rig, 100);
    wrench = plant_contact_wrenches(rig->plant);
    assert_true(fabs(wrench[1].force[0]) > 1.0);
    step(rig, 30000);
    for (size_t i = 0; i < links; i++) { /* the quaternion is scaled to unit length at each step */
        assert_near(rig->state[i], before[i], i >= 3 && i < 7 ? 1e-15 : 0.0);
    }
    for (int i = 0; i < 3; i++) {
        assert_near(wrench[0].force[i], 0.0, 0.0); /* the clamp takes it */
        assert_near(wrench[0].moment[i], 0.0, 0.0);
        assert_near(wrench[1].force[i], i == 2 ? 1.5 * gravity : 0.0, 1e-3);
    }
}

TEST(robot_moves_alike_with_a_body_that_it_never_meets)
{
    struct free_rig with CLOSED_BY(free_rig_fini), without CLOSED_BY(free_rig_fini);
    double with_momentum[3], with_place[3], momentum[3], place[3];

    free_rig_walker(&with, 2, 100000);
    free_rig_walker(&without, 0, 100000);
    free_rig_start(&with);
    free_rig_start(&without);
    for (size_t j = 0; j < 7; j++) {
        plant_command(with.plant)->motor[j] = plant_command(without.plant)->motor[j] =
            (struct motor_command){.bridge_on = true, .voltage_v = 3.0 * (double)j - 9.0};
    }
    step(&with, 500);
    step(&without, 500);
    assert_memory_equal(with.state, without.state,
                        (size_t)(without.free - without.state) * sizeof *with.state);
    plant_center_of_mass(with.plant, with_place, with_momentum);
    plant_center_of_mass(without.plant, place, momentum);
    assert_memory_equal(with_place, place, sizeof place);
    assert_memory_equal(with_momentum, momentum, sizeof momentum);
}

/* ---- runs and errors ---- */

static void assert_refused(const struct free_rig *rig, const char *words)
{
    struct arena arena CLOSED_BY(arena_fini);
    struct plant *plant = NULL;
    struct error error = {0};

    assert_ok(arena_init(&arena, 1 << 20, &error));
    assert_int_equal(plant_create(&rig->config, &arena, &plant, &error), ERROR_INPUT);
    if (!strstr(error.text, words)) {
        fail_msg("\"%s\" does not say \"%s\"", error.text, words);
    }
}

TEST_ON(refuses_bodies_that_cannot_be, free_rig, rig)
{
    static const double flat[6] = {1e-3, 0.0, 0.0, 0.0, 0.0, 1e-3};
    static const double impossible[6] = {1e-3, 0.0, 0.0, 1e-3, 0.0, 3e-3};
    static const double indefinite[6] = {1e-3, 2e-3, 0.0, 1e-3, 0.0, 1e-3};
    struct plant_free_body *body = &rig->body[0];

    free_rig_walker_on_ground(rig, 100000);
    free_rig_start(rig);
    body->inertia.mass = 0.0;
    assert_refused(rig, "free body box: inertia without mass");
    memset(body->inertia.I, 0, sizeof body->inertia.I);
    assert_refused(rig, "free body box: expected a mass and three principal moments");
    *body = free_rig_box();
    body->inertia.mass = -1.0;
    assert_refused(rig, "mass -1 kg is negative");
    *body = free_rig_box();
    memcpy(body->inertia.I, flat, sizeof flat);
    assert_refused(rig, "free body box: expected a mass and three principal moments");
    memcpy(body->inertia.I, impossible, sizeof impossible);
    assert_refused(rig, "the largest exceeds the sum");
    memcpy(body->inertia.I, indefinite, sizeof indefinite);
    assert_refused(rig, "not positive");
    *body = free_rig_box();
    body->position[1] = (double)NAN;
    assert_refused(rig, "invalid start");
    *body = free_rig_box();
    body->w[2] = (double)INFINITY;
    assert_refused(rig, "invalid start");
    *body = free_rig_box();
    body->quaternion[0] = 0.0;
    assert_refused(rig, "invalid start");
    *body = free_rig_box();
    rig->contact_body[2]++;
    assert_refused(rig, "bodies 0 to 8 and free ones follow up to 9");
    rig->contact_body[2] = -1;
    assert_refused(rig, "bodies 0 to 8");
}

TEST_ON(reports_every_lack_of_memory, free_rig, rig)
{
    enum error_code code = ERROR_MEMORY;
    int refused = 0;

    free_rig_walker_on_ground(rig, 100000);
    free_rig_start(rig);
    for (size_t room = 0; code != ERROR_NONE; room += 256) {
        struct arena arena CLOSED_BY(arena_fini);
        struct error error = {0};
        struct plant *plant;

        assert_true(room < 1 << 20);
        assert_ok(arena_init(&arena, 1 << 20, &error));
        arena.capacity = room;
        code = plant_create(&rig->config, &arena, &plant, &error);
        assert_true(code == ERROR_NONE || code == ERROR_MEMORY);
        refused += code != ERROR_NONE;
        arena.capacity = 1 << 20;
    }
    assert_true(refused > 40);
}
