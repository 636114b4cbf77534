/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The numeric dynamics against what is known without another program: closed forms, the balance of
 * momentum and energy, the robot's own mirror image, and its two directions against each other.
 */
#include "model/spatial.h"
#include "tests/unit/model/coman.h"
#include "tests/unit/model/random_robot.h"

static struct error error;

enum { TREES = 100, MAX_BODIES = RANDOM_JOINTS + 1, MAX_V = RANDOM_JOINTS + 6 };

static void make(const struct robot *robot, struct dynamics *d)
{
    assert_no_error(dynamics_generic(robot, &arena, d, &error), error.text);
}

static void finish(struct robot *robot)
{
    assert_no_error(robot_finish(robot, &error), error.text);
}

/* |a - b| / max(|b|, floor), Euclidean norms */
static double relative(const double *a, const double *b, size_t n, double floor)
{
    double difference = 0.0, size = 0.0;

    for (size_t i = 0; i < n; i++) {
        difference += (a[i] - b[i]) * (a[i] - b[i]);
        size += b[i] * b[i];
    }
    return sqrt(difference) / fmax(sqrt(size), floor);
}

static void assert_near(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance * fmax(1.0, fabs(expected)))) {
        fail_msg("found %.17g, expected %.17g within %g", value, expected, tolerance);
    }
}

/* ---- closed forms ---- */

static const double turn_y[3] = {0.0, 1.0, 0.0};

/* A chain of one or two joints on a fixed base. */
struct chain {
    struct robot robot;
    struct robot_body body[3];
    struct robot_joint joint[2];
};

static void chain_add(struct chain *chain, enum joint_type type, const double axis[3],
                      const double origin[3], const struct robot_inertia *inertia)
{
    struct robot *robot = &chain->robot;
    struct robot_joint *joint = &chain->joint[robot->njoint];

    if (robot->nbody == 0) {
        *robot = (struct robot){.name = "chain",
                                .body = chain->body,
                                .joint = chain->joint,
                                .nbody = 1,
                                .imu_frame = -1,
                                .gravity = {0.0, 0.0, -9.81}};
        chain->body[0] = (struct robot_body){.name = "base", .parent = -1};
    }
    *joint = (struct robot_joint){.name = "joint", .type = type, .lower = -9.0, .upper = 9.0};
    memcpy(joint->axis, axis, sizeof joint->axis);
    memcpy(joint->origin, origin, sizeof joint->origin);
    mat3_identity(joint->rotation);
    chain->body[robot->nbody] =
        (struct robot_body){.name = "body", .parent = (int)robot->nbody - 1, .inertia = *inertia};
    robot->nbody++;
    robot->njoint++;
}

TEST_WITH(a_pendulum_falls_as_its_equation_says, open_arena, close_arena)
{
    const double m = 1.3, l = 0.7, Iyy = 0.05, g = 9.81, at_base[3] = {0.1, 0.2, 0.3};
    const struct robot_inertia bob = {m, {0.0, 0.0, -l}, {0.06, 0.0, 0.0, Iyy, 0.0, 0.03}};
    struct chain chain = {0};
    struct dynamics d;

    chain_add(&chain, JOINT_REVOLUTE, turn_y, at_base, &bob);
    finish(&chain.robot);
    make(&chain.robot, &d);
    for (double q = -3.0; q < 3.0; q += 0.37) {
        double v = 2.0 * q - 1.0, tau = q * q, vdot, kinetic, potential;

        d.ops->forward(&d, &q, &v, &tau, NULL, &vdot);
        assert_near(vdot, (tau - m * g * l * sin(q)) / (m * l * l + Iyy), 1e-14);
        d.ops->energy(&d, &q, &v, &kinetic, &potential);
        assert_near(kinetic, 0.5 * (m * l * l + Iyy) * v * v, 1e-14);
        assert_near(potential, m * g * (at_base[2] - l * cos(q)), 1e-14);
    }
}

TEST_WITH(a_double_pendulum_falls_as_its_equations_say, open_arena, close_arena)
{
    const double m1 = 1.0, m2 = 2.0, l1 = 1.0, l2 = 0.6, g = 9.81, none[3] = {0.0, 0.0, 0.0};
    const double elbow[3] = {0.0, 0.0, -l1};
    const struct robot_inertia upper = {m1, {0.0, 0.0, -l1}, {0}};
    const struct robot_inertia lower = {m2, {0.0, 0.0, -l2}, {0}};
    struct chain chain = {0};
    struct dynamics d;
    uint64_t seed = 1;

    chain_add(&chain, JOINT_REVOLUTE, turn_y, none, &upper);
    chain_add(&chain, JOINT_REVOLUTE, turn_y, elbow, &lower);
    finish(&chain.robot);
    make(&chain.robot, &d);
    for (int i = 0; i < 50; i++) {
        double q[2] = {random_in(&seed, -3.0, 3.0), random_in(&seed, -3.0, 3.0)};
        double v[2] = {random_in(&seed, -5.0, 5.0), random_in(&seed, -5.0, 5.0)};
        double tau[2] = {random_in(&seed, -9.0, 9.0), random_in(&seed, -9.0, 9.0)}, vdot[2];
        double c = m2 * l1 * l2 * cos(q[1]), s = m2 * l1 * l2 * sin(q[1]);
        double A = (m1 + m2) * l1 * l1 + m2 * l2 * l2 + 2.0 * c, B = m2 * l2 * l2 + c;
        double C = m2 * l2 * l2, hang = m2 * g * l2 * sin(q[0] + q[1]);
        double f1 =
            tau[0] + s * (2.0 * v[0] * v[1] + v[1] * v[1]) - (m1 + m2) * g * l1 * sin(q[0]) - hang;
        double f2 = tau[1] - s * v[0] * v[0] - hang;
        double determinant = A * C - B * B;

        d.ops->forward(&d, q, v, tau, NULL, vdot);
        assert_near(vdot[0], (C * f1 - B * f2) / determinant, 1e-12);
        assert_near(vdot[1], (A * f2 - B * f1) / determinant, 1e-12);
    }
}

TEST_WITH(a_slider_drops_along_its_axis, open_arena, close_arena)
{
    const double axis[3] = {0.6, 0.0, -0.8}, none[3] = {0.0, 0.0, 0.0};
    const struct robot_inertia block = {2.5, {0.3, -0.1, 0.2}, {0.1, 0.0, 0.0, 0.1, 0.0, 0.1}};
    double q = 0.4, v = -1.5, tau = 3.0, vdot;
    struct body_acceleration acceleration[2];
    struct body_motion motion[2];
    struct chain chain = {0};
    struct dynamics d;

    chain_add(&chain, JOINT_PRISMATIC, axis, none, &block);
    finish(&chain.robot);
    make(&chain.robot, &d);
    d.ops->forward(&d, &q, &v, &tau, NULL, &vdot);
    assert_near(vdot, 9.81 * 0.8 + tau / 2.5, 1e-14);
    d.ops->kinematics(&d, &q, &v, motion);
    d.ops->acceleration(&d, &q, &v, &vdot, acceleration);
    for (int m = 0; m < 3; m++) {
        assert_near(motion[1].p[m], axis[m] * q, 1e-15);
        assert_near(motion[1].v[m], axis[m] * v, 1e-15);
        assert_near(acceleration[1].a[m], axis[m] * vdot, 1e-14);
        assert_near(acceleration[1].alpha[m], 0.0, 1e-15);
    }
}

TEST_WITH(a_free_body_turns_as_euler_says, open_arena, close_arena)
{
    struct robot_body body = {.name = "body", .parent = -1};
    struct robot robot = {.name = "free body",
                          .floating = true,
                          .nbody = 1,
                          .body = &body,
                          .imu_frame = -1,
                          .gravity = {0.3, -0.2, -9.81}};
    const double I[3] = {0.2, 0.5, 0.4}, m = 3.0;
    struct random_state s;
    struct dynamics d;
    uint64_t seed = 3;
    double vdot[6];

    body.inertia = (struct robot_inertia){m, {0}, {I[0], 0.0, 0.0, I[1], 0.0, I[2]}};
    finish(&robot);
    make(&robot, &d);
    for (int n = 0; n < 20; n++) {
        double R[9], g[3], turning[3];
        const double *w = s.v + 3;

        random_state_make(&seed, &robot, &s);
        d.ops->forward(&d, s.q, s.v, s.tau, s.ext, vdot);
        mat3_from_quaternion(s.q + 3, R);
        mat3_apply_transposed(R, robot.gravity, g);
        vec3_cross(w, s.v, turning);
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, k = (i + 2) % 3;

            assert_near(vdot[i], g[i] + s.ext[0].force[i] / m - turning[i], 1e-13);
            assert_near(vdot[3 + i], (s.ext[0].moment[i] - (I[k] - I[j]) * w[j] * w[k]) / I[i],
                        1e-13);
        }
    }
}

/* ---- any tree ---- */

TEST_WITH(inverse_gives_back_the_forces_of_forward, open_arena, close_arena)
{
    uint64_t seed = 11;
    double worst = 0.0;

    for (int n = 0; n < TREES; n++) {
        static struct random_tree tree;
        struct random_state s;
        double vdot[MAX_V], f[MAX_V], expected[MAX_V] = {0};
        struct dynamics d;

        assert_ok(random_tree_make(&seed, &tree, NULL));
        make(&tree.robot, &d);
        random_state_make(&seed, &tree.robot, &s);
        d.ops->forward(&d, s.q, s.v, s.tau, s.ext, vdot);
        d.ops->inverse(&d, s.q, s.v, vdot, s.ext, f);

        /* Nothing holds a floating base: its six come back as zero */
        memcpy(expected + tree.robot.nv - tree.robot.njoint, s.tau,
               tree.robot.njoint * sizeof *s.tau);
        worst = fmax(worst, relative(f, expected, tree.robot.nv, 1.0));
    }
    print_message("largest difference of %d round trips: %.1e\n", TREES, worst);
    assert_true(worst <= 1e-9);
}

/* Linear momentum and angular momentum about the world's origin. */
static void momentum(const struct dynamics *d, const double *q, const double *v, double P[6])
{
    struct body_motion motion[MAX_BODIES];

    d->ops->kinematics(d, q, v, motion);
    memset(P, 0, 6 * sizeof *P);
    for (size_t b = 0; b < d->robot->nbody; b++) {
        const struct robot_inertia *inertia = &d->robot->body[b].inertia;
        double r[3], place[3], velocity[3], spin[3], w[3], h[3];

        mat3_apply(motion[b].R, inertia->com, r);
        mat3_apply_transposed(motion[b].R, motion[b].w, w);
        sym3_apply(inertia->I, w, h);
        mat3_apply(motion[b].R, h, spin);
        memcpy(velocity, motion[b].v, sizeof velocity);
        vec3_add_cross(motion[b].w, r, velocity);
        for (int m = 0; m < 3; m++) {
            place[m] = motion[b].p[m] + r[m];
            velocity[m] *= inertia->mass;
            P[m] += velocity[m];
            P[3 + m] += spin[m];
        }
        vec3_add_cross(place, velocity, P + 3);
    }
}

/* What gravity and the wrenches add to momentum per second; returns their power. */
static double outside(const struct dynamics *d, const struct random_state *s, bool gravity,
                      double rate[6])
{
    const struct robot *robot = d->robot;
    struct body_motion motion[MAX_BODIES];
    double power = 0.0;

    d->ops->kinematics(d, s->q, s->v, motion);
    memset(rate, 0, 6 * sizeof *rate);
    for (size_t b = 0; b < robot->nbody; b++) {
        double force[3], moment[3], weight[3], com[3];

        mat3_apply(motion[b].R, s->ext[b].force, force);
        mat3_apply(motion[b].R, s->ext[b].moment, moment);
        power += vec3_dot(force, motion[b].v) + vec3_dot(moment, motion[b].w);
        mat3_apply(motion[b].R, robot->body[b].inertia.com, com);
        for (int m = 0; m < 3; m++) {
            com[m] += motion[b].p[m];
            weight[m] = gravity ? robot->body[b].inertia.mass * robot->gravity[m] : 0.0;
            rate[m] += force[m] + weight[m];
            rate[3 + m] += moment[m];
        }
        vec3_add_cross(motion[b].p, force, rate + 3);
        vec3_add_cross(com, weight, rate + 3);
    }
    return power;
}

/* The state h seconds later, to second order: enough for central differences. */
static void advance(const struct robot *robot, const struct random_state *s, const double *vdot,
                    double h, struct random_state *later)
{
    double middle[MAX_V], qdot[MAX_V + 1], half[MAX_V + 1];

    for (size_t i = 0; i < robot->nv; i++) {
        middle[i] = s->v[i] + 0.5 * h * vdot[i];
        later->v[i] = s->v[i] + h * vdot[i];
    }
    dynamics_qdot(robot, s->q, s->v, qdot);
    for (size_t i = 0; i < robot->nq; i++) {
        half[i] = s->q[i] + 0.5 * h * qdot[i];
    }
    dynamics_qdot(robot, half, middle, qdot);
    for (size_t i = 0; i < robot->nq; i++) {
        later->q[i] = s->q[i] + h * qdot[i];
    }
}

TEST_WITH(momentum_and_energy_change_by_what_acts_from_outside, open_arena, close_arena)
{
    const double h = 1e-6;
    double worst_momentum = 0.0, worst_power = 0.0;
    uint64_t seed = 12;

    for (int n = 0; n < TREES; n++) {
        static struct random_tree tree;
        struct random_state s, before, after;
        double vdot[MAX_V], first[6], last[6], rate[6], change[6], power, K[2], V[2], gained;
        const struct robot *robot = &tree.robot;
        struct dynamics d;

        assert_ok(random_tree_make(&seed, &tree, NULL));
        make(robot, &d);
        random_state_make(&seed, robot, &s);
        d.ops->forward(&d, s.q, s.v, s.tau, s.ext, vdot);
        advance(robot, &s, vdot, -h, &before);
        advance(robot, &s, vdot, h, &after);

        power = outside(&d, &s, true, rate);
        for (size_t j = 0; j < robot->njoint; j++) {
            power += s.tau[j] * s.v[robot->nv - robot->njoint + j];
        }
        d.ops->energy(&d, before.q, before.v, &K[0], &V[0]);
        d.ops->energy(&d, after.q, after.v, &K[1], &V[1]);
        gained = (K[1] + V[1] - K[0] - V[0]) / (2.0 * h);
        worst_power = fmax(worst_power, fabs(gained - power) / fmax(fabs(power), K[0] + 1.0));

        if (robot->floating) {
            momentum(&d, before.q, before.v, first);
            momentum(&d, after.q, after.v, last);
            for (int m = 0; m < 6; m++) {
                change[m] = (last[m] - first[m]) / (2.0 * h);
            }
            worst_momentum = fmax(worst_momentum, relative(change, rate, 6, 1.0));
        }
    }
    print_message("largest relative differences: momentum %.1e, power %.1e\n", worst_momentum,
                  worst_power);
    assert_true(worst_momentum <= 1e-6);
    assert_true(worst_power <= 1e-6);
}

TEST_WITH(accelerations_of_bodies_are_the_change_of_their_velocities, open_arena, close_arena)
{
    const double h = 1e-6;
    double worst = 0.0;
    uint64_t seed = 13;

    for (int n = 0; n < TREES; n++) {
        static struct random_tree tree;
        struct random_state s, before, after;
        struct body_motion first[MAX_BODIES], last[MAX_BODIES];
        struct body_acceleration acceleration[MAX_BODIES];
        double vdot[MAX_V];
        struct dynamics d;

        assert_ok(random_tree_make(&seed, &tree, NULL));
        make(&tree.robot, &d);
        random_state_make(&seed, &tree.robot, &s);
        for (size_t i = 0; i < tree.robot.nv; i++) {
            vdot[i] = random_in(&seed, -5.0, 5.0);
        }
        advance(&tree.robot, &s, vdot, -h, &before);
        advance(&tree.robot, &s, vdot, h, &after);
        d.ops->kinematics(&d, before.q, before.v, first);
        d.ops->kinematics(&d, after.q, after.v, last);
        d.ops->acceleration(&d, s.q, s.v, vdot, acceleration);
        for (size_t b = 0; b < tree.robot.nbody; b++) {
            double change[6];

            for (int m = 0; m < 3; m++) {
                change[m] = (last[b].w[m] - first[b].w[m]) / (2.0 * h);
                change[3 + m] = (last[b].v[m] - first[b].v[m]) / (2.0 * h);
            }
            worst = fmax(worst, relative(change, acceleration[b].alpha, 6, 1.0));
        }
    }
    print_message("largest relative difference: %.1e\n", worst);
    assert_true(worst <= 1e-6);
}

/* ---- COMAN ---- */

/* Index of the joint (or body: one more) on the other side, itself in the middle. */
static size_t other_side(const struct robot *robot, size_t joint)
{
    char name[64];
    int other;

    snprintf(name, sizeof name, "%s", robot->joint[joint].name);
    name[0] = name[0] == 'R' ? 'L' : name[0] == 'L' ? 'R' : name[0];
    other = robot_find_joint(robot, name);
    assert_true(other >= 0);
    return (size_t)other;
}

/* Turns about y keep their sign in the mirror, those about x and z change it. */
static double mirror_sign(const struct robot_joint *joint)
{
    return joint->axis[1] == 1.0 ? 1.0 : -1.0;
}

static const double mirrored[3] = {1.0, -1.0, 1.0};
static const double mirrored_tensor[6] = {1.0, -1.0, 1.0, 1.0, -1.0, 1.0};

/* A copy of COMAN that is its own mirror image: left bodies are those of the right mirrored, what
 * sticks out sideways of the middle ones is taken away. */
static struct robot *symmetric_coman(const struct robot *coman)
{
    struct robot *robot = arena_alloc(&arena, 1, sizeof *robot);

    *robot = *coman;
    robot->body = arena_alloc(&arena, coman->nbody, sizeof *robot->body);
    memcpy(robot->body, coman->body, coman->nbody * sizeof *robot->body);
    for (size_t b = 0; b < coman->nbody; b++) {
        size_t other = b == 0 ? 0 : 1 + other_side(coman, b - 1);
        struct robot_inertia *inertia = &robot->body[b].inertia;

        if (other == b) {
            inertia->com[1] = inertia->I[1] = inertia->I[4] = 0.0;
        } else if (coman->joint[b - 1].name[0] == 'L') {
            *inertia = coman->body[other].inertia;
            for (int m = 0; m < 6; m++) {
                inertia->I[m] *= mirrored_tensor[m];
                inertia->com[m % 3] *= m < 3 ? mirrored[m] : 1.0;
            }
        }
    }
    finish(robot);
    return robot;
}

/* Difference between the accelerations of a robot in a state that is its own mirror image and the
 * mirror image of these accelerations, relative to their size. */
static double mirror_difference(const struct robot *robot, uint64_t *seed)
{
    struct random_state s;
    struct dynamics d;
    double vdot[MAX_V], image[MAX_V];

    make(robot, &d);
    random_state_make(seed, robot, &s);
    s.q[4] = s.q[6] = 0.0; /* the base only pitches */
    s.q[3] = 0.8;
    s.q[5] = 0.6;
    s.v[1] = s.v[3] = s.v[5] = 0.0;
    for (size_t j = 0; j < robot->njoint; j++) {
        size_t other = other_side(robot, j);
        double sign = mirror_sign(&robot->joint[j]);

        if (other == j && sign < 0.0) {
            s.q[7 + j] = s.v[6 + j] = s.tau[j] = 0.0;
        } else if (other != j) {
            s.q[7 + other] = sign * s.q[7 + j];
            s.v[6 + other] = sign * s.v[6 + j];
            s.tau[other] = sign * s.tau[j];
        }
    }
    d.ops->forward(&d, s.q, s.v, s.tau, NULL, vdot);
    for (int m = 0; m < 3; m++) {
        image[m] = mirrored[m] * vdot[m];
        image[3 + m] = -mirrored[m] * vdot[3 + m];
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        image[6 + other_side(robot, j)] = mirror_sign(&robot->joint[j]) * vdot[6 + j];
    }
    return relative(image, vdot, robot->nv, 1.0);
}

TEST_WITH(coman_in_a_mirror_accelerates_as_its_mirror_image, open_arena, close_arena)
{
    const struct robot *coman = load_coman(NULL), *symmetric = symmetric_coman(coman);
    double worst = 0.0, real = 0.0;
    uint64_t seed = 14;

    for (int n = 0; n < 50; n++) {
        worst = fmax(worst, mirror_difference(symmetric, &seed));
        real = fmax(real, mirror_difference(coman, &seed));
    }
    print_message("largest difference to the mirror image: symmetric %.1e, COMAN itself %.1e\n",
                  worst, real);
    assert_true(worst <= 1e-11);
}

TEST_WITH(the_limbs_of_coman_are_mirror_images_and_its_trunk_is_not, open_arena, close_arena)
{
    const struct robot *coman = load_coman(NULL);

    for (size_t b = 0; b < coman->nbody; b++) {
        size_t other = b == 0 ? 0 : 1 + other_side(coman, b - 1);
        const struct robot_inertia *x = &coman->body[b].inertia, *y = &coman->body[other].inertia;

        if (other == b) {
            print_message("%s is not symmetric: com y %g m, I xy %g, yz %g kg m2\n",
                          coman->body[b].name, x->com[1], x->I[1], x->I[4]);
            continue;
        }
        /* The source rounds two numbers of the legs differently, by 4e-11 and 4e-9 m */
        assert_true(x->mass == y->mass);
        for (int m = 0; m < 3; m++) {
            assert_true(fabs(x->com[m] - mirrored[m] * y->com[m]) <= 5e-9);
        }
        for (int m = 0; m < 6; m++) {
            assert_true(x->I[m] == mirrored_tensor[m] * y->I[m]);
        }
    }
}

TEST_WITH(the_same_state_gives_the_same_bits, open_arena, close_arena)
{
    const struct robot *coman = load_coman(NULL);
    struct dynamics one, two;
    uint64_t seed = 15;

    make(coman, &one);
    make(coman, &two);
    arena_seal(&arena);
    for (int n = 0; n < 200; n++) {
        struct random_state s, disturbing;
        double first[MAX_V], again[MAX_V], other[MAX_V];

        random_state_make(&seed, coman, &s);
        random_state_make(&seed, coman, &disturbing);
        one.ops->forward(&one, s.q, s.v, s.tau, s.ext, first);
        one.ops->inverse(&one, disturbing.q, disturbing.v, first, disturbing.ext, other);
        one.ops->forward(&one, s.q, s.v, s.tau, s.ext, again);
        two.ops->forward(&two, s.q, s.v, s.tau, s.ext, other);
        assert_memory_equal(first, again, coman->nv * sizeof *first);
        assert_memory_equal(first, other, coman->nv * sizeof *first);
    }
}
