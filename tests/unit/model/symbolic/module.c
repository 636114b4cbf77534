/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Generated code, compiled: the built-in modules and modules compiled here are the numeric
 * algorithms of the robot at hand, in every variant, which all have the same bits; which robots
 * have a built-in module.
 */
#include "model/symbolic/symbolic.h"
#include "tests/unit/model/coman.h"
#include "tests/unit/model/symbolic/evaluate.h"

#include <unistd.h>

enum {
    BODIES = RANDOM_JOINTS + 1,
    VELOCITIES = RANDOM_JOINTS + 6,
    POSE = 40 * BODIES,
    STATES = 100,
};

static const struct robot *load_robot(const char *file)
{
    const struct robot *robot;
    struct error error;

    assert_no_error(robot_load(file, NULL, &arena, &robot, &error), error.text);
    return robot;
}

/* The robot with other mass properties: up to 5 kg more in each body, its center elsewhere. */
static struct robot *with_masses(const struct robot *robot, uint64_t *seed)
{
    struct robot *heavier;
    struct error error;

    assert_no_error(robot_copy(robot, &arena, &heavier, &error), error.text);
    for (size_t b = 0; b < heavier->nbody; b++) {
        struct robot_inertia *inertia = &heavier->body[b].inertia;
        double shift[3];

        inertia->mass += random_in(seed, 0.0, 5.0);
        random_vector(seed, 0.05, shift);
        for (int m = 0; m < 3; m++) {
            inertia->com[m] += shift[m];
        }
    }
    assert_no_error(robot_finish(heavier, &error), error.text);
    assert_true(heavier->hash != robot->hash && heavier->massless_hash == robot->massless_hash);
    return heavier;
}

/* Everything that struct dynamics has, side by side. */
struct answers {
    double forward[VELOCITIES], wrenches[VELOCITIES], implicit[VELOCITIES], inverse[VELOCITIES];
    double motion[18 * BODIES], speed[18 * BODIES], rates[6 * BODIES], energy[2];
};

static void answer(const struct dynamics *d, const struct random_state *x, const double *extra,
                   const double *added, const double *vdot, struct answers *out)
{
    memset(out, 0, sizeof *out);
    d->ops->forward(d, x->q, x->v, x->tau, NULL, out->forward);
    d->ops->forward(d, x->q, x->v, x->tau, x->ext, out->wrenches);
    d->ops->implicit(d, x->q, x->v, x->tau, x->ext, extra, (const struct added_inertia *)added,
                     out->implicit);
    d->ops->inverse(d, x->q, x->v, vdot, x->ext, out->inverse);
    d->ops->kinematics(d, x->q, x->v, (struct body_motion *)out->motion);
    /* Other velocities in the same pose */
    d->ops->velocities(d, x->q, vdot, (struct body_motion *)out->speed);
    d->ops->acceleration(d, x->q, x->v, vdot, (struct body_acceleration *)out->rates);
    d->ops->energy(d, x->q, x->v, &out->energy[0], &out->energy[1]);
}

/* Largest relative difference of each answer over all states. */
struct worst {
    double forward, wrenches, implicit, inverse, motion, rates, energy;
};

static void note_worst(struct worst *worst, const struct robot *robot,
                       const struct dynamics_module *module, const struct answers *found,
                       const struct answers *expected)
{
    const size_t n = robot->nv;

#define NOTE(part, count)                                                                          \
    worst->part = fmax(worst->part, relative_difference(found->part, expected->part, count))
    NOTE(forward, n);
    NOTE(wrenches, n);
    NOTE(implicit, n);
    NOTE(inverse, n);
    NOTE(energy, 2);
#undef NOTE
    for (uint32_t o = 0; o < module->nobserved; o++) {
        int b = module->observed[o];

        worst->motion = fmax(worst->motion, relative_difference(found->motion + 18 * b,
                                                                expected->motion + 18 * b, 18));
        worst->motion = fmax(worst->motion, relative_difference(found->speed + 18 * b + 12,
                                                                expected->speed + 18 * b + 12, 6));
        worst->rates = fmax(worst->rates,
                            relative_difference(found->rates + 6 * b, expected->rates + 6 * b, 6));
    }
}

/* The module in each of its variants against the numeric algorithms, and against one another to the
 * bit: observed bodies' entries only. */
static void compare_module(const struct robot *robot, const struct dynamics_module *module)
{
    static double extra[RANDOM_JOINTS], added[21 * BODIES];
    static struct answers expected, found, first;

    for (const struct dynamics_module *variant = module; variant; variant = variant->plainer) {
        struct dynamics generic, generated, best;
        struct worst worst = {0};
        struct error error;
        uint64_t seed = 41;

        if (dynamics_generic(robot, &arena, &generic, &error) ||
            dynamics_generated(robot, variant, &arena, &generated, &error) ||
            dynamics_generated(robot, module, &arena, &best, &error)) {
            fail_msg("%s", error.text);
        }
        for (int n = 0; n < STATES; n++) {
            double vdot[VELOCITIES];
            struct random_state x;

            random_state_make(&seed, robot, &x);

            /* Numbers that make the added inertias of implicit integration positive */
            for (int j = 0; j < RANDOM_JOINTS; j++) {
                extra[j] = random_in(&seed, 0.0, 0.2);
            }
            for (int m = 0; m < 21 * BODIES; m++) {
                int at = m % 21;
                bool diagonal = at == 0 || at == 6 || at == 11 || at == 15 || at == 18 || at == 20;

                added[m] = diagonal ? 1.0 : random_in(&seed, -0.1, 0.1);
            }
            /* Some angles are beyond the fast reduction of sine and cosine */
            if (n % 10 == 0 && robot->joint[robot->njoint - 1].type == JOINT_REVOLUTE) {
                x.q[robot->nq - 1] *= 1e7;
            }
            generic.ops->forward(&generic, x.q, x.v, x.tau, x.ext, vdot);
            answer(&generic, &x, extra, added, vdot, &expected);
            answer(&generated, &x, extra, added, vdot, &found);
            answer(&best, &x, extra, added, vdot, &first);
            assert_memory_equal(&found, &first, sizeof found);
            note_worst(&worst, robot, variant, &found, &expected);
        }
        print_message("# %s %s: forward %.1g, with wrenches %.1g, implicit %.1g, inverse %.1g, "
                      "kinematics %.1g, accelerations %.1g, energy %.1g\n",
                      robot->name, variant->variant, worst.forward, worst.wrenches, worst.implicit,
                      worst.inverse, worst.motion, worst.rates, worst.energy);
        assert_true(worst.forward <= 1e-12 && worst.wrenches <= 1e-12 && worst.implicit <= 1e-12);
        assert_true(worst.inverse <= 1e-12 && worst.motion <= 1e-12 && worst.rates <= 1e-12);
        assert_true(worst.energy <= 1e-12);
    }
}

/* A built-in module of the robot in that file, with its own masses and with others. */
static void compare_with_masses(const char *file)
{
    const struct robot *robot = load_robot(file);
    uint64_t seed = 83;

    assert_non_null(symbolic_builtin(robot));
    compare_module(robot, symbolic_builtin(robot));
    for (int n = 0; n < 3; n++) {
        const struct robot *heavier = with_masses(robot, &seed);
        const struct dynamics_module *module = symbolic_builtin(heavier);

        assert_non_null(module);
        compare_module(heavier, module);
    }
}

TEST_WITH(coman_with_other_masses_is_the_numeric_algorithms, open_arena, close_arena)
{
    compare_with_masses(COMAN);
}

TEST_WITH(walkman_with_other_masses_is_the_numeric_algorithms, open_arena, close_arena)
{
    compare_with_masses(HIL_SOURCE_DIR "/config/robots/walkman.yaml");
}

TEST_WITH(hyq_with_other_masses_is_the_numeric_algorithms, open_arena, close_arena)
{
    compare_with_masses(HIL_SOURCE_DIR "/config/robots/hyq.yaml");
}

/* COMAN with forearms is COMAN with other masses. */
TEST_WITH(a_module_with_inputs_serves_the_variants_of_a_robot, open_arena, close_arena)
{
    const struct robot *forearms = load_coman("forearms");
    uint64_t seed = 89;

    assert_int_equal(forearms->massless_hash, load_coman(NULL)->massless_hash);
    assert_non_null(symbolic_builtin(with_masses(forearms, &seed)));
}

TEST_WITH(a_robot_with_another_geometry_gets_none, open_arena, close_arena)
{
    const struct robot *coman = load_coman(NULL);
    uint64_t seed = 101;
    struct robot *longer = with_masses(coman, &seed);
    const struct dynamics_module *module = symbolic_builtin(longer);
    struct dynamics d;
    struct error error;

    longer->joint[3].origin[2] += 1e-9;
    assert_ok(robot_finish(longer, &error));
    assert_true(longer->massless_hash != coman->massless_hash);
    assert_null(symbolic_builtin(longer));
    assert_int_equal(dynamics_generated(longer, module, &arena, &d, &error), ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "another robot"));
    assert_non_null(strstr(error.text, "not only with other masses"));
}

TEST_WITH(no_memory_is_said_only_of_memory, open_arena, close_arena)
{
    uint64_t seed = 113;
    const struct robot *heavier = with_masses(load_coman(NULL), &seed);
    struct error error;
    struct arena small;
    struct dynamics d;

    assert_ok(arena_init(&small, 64, &error));
    while (arena_alloc(&small, 1, 64)) {
    }
    assert_int_equal(dynamics_generated(heavier, symbolic_builtin(heavier), &small, &d, &error),
                     ERROR_MEMORY);
    assert_non_null(strstr(error.text, "no memory"));
    arena_fini(&small);
}

/* Distance of value from exact in units of the last place of exact. */
static double ulps(double value, long double exact)
{
    double near = (double)exact;

    return (double)(fabsl((long double)value - exact) /
                    (long double)(nextafter(fabs(near), 2.0) - fabs(near)));
}

TEST_WITH(sine_and_cosine_are_right_to_the_last_place, open_arena, close_arena)
{
    const struct robot *robot = load_coman(NULL);
    _Alignas(64) double x[8], sine[8], cosine[8];

    for (const struct dynamics_module *module = symbolic_builtin(robot); module;
         module = module->plainer) {
        double worst = 0.0;
        uint64_t seed = 47;

        for (int n = 0; n < 200000; n++) {
            double size = pow(10.0, random_in(&seed, -8.0, 15.0));

            for (int l = 0; l < 8; l++) {
                x[l] = random_in(&seed, -size, size);
                /* Multiples of pi/2, where a reduction shows what it is worth */
                if (n % 4 == 0) {
                    x[l] = round(x[l]) * M_PI_2;
                }
            }
            module->sincos(x, sine, cosine);
            for (int l = 0; l < 8; l++) {
                worst = fmax(worst, ulps(sine[l], sinl(x[l])));
                worst = fmax(worst, ulps(cosine[l], cosl(x[l])));
            }
        }
        print_message("# %s: %.3f units of the last place\n", module->variant, worst);
        assert_true(worst < 1.0);
    }
}

TEST_WITH(far_angles_infinities_and_nan_are_those_of_libm, open_arena, close_arena)
{
    const struct robot *robot = load_coman(NULL);
    _Alignas(64) const double x[8] = {0.0, 1e22, -1e9, INFINITY, -INFINITY, NAN, 1.0, 2e5};
    _Alignas(64) double sine[8], cosine[8];

    for (const struct dynamics_module *module = symbolic_builtin(robot); module;
         module = module->plainer) {
        module->sincos(x, sine, cosine);
        for (int l = 0; l < 8; l++) {
            if (isfinite(x[l])) {
                assert_true(fabs(sine[l] - sin(x[l])) < 2.3e-16);
                assert_true(fabs(cosine[l] - cos(x[l])) < 2.3e-16);
            } else {
                assert_true(isnan(sine[l]) && isnan(cosine[l]));
            }
        }
    }
}

/* Largest difference of a rotation or a place (entries 0 to 11) between the two for all observed
 * bodies, m and 1; q within size of zero. */
static double far_difference(const struct robot *robot, const struct dynamics_module *module,
                             double size)
{
    static double expected[18 * BODIES], found[18 * BODIES];
    static _Alignas(32) double pose[POSE];
    struct dynamics generic;
    struct error error;
    uint64_t seed = 59;
    double worst = 0.0;

    assert_no_error(dynamics_generic(robot, &arena, &generic, &error), error.text);
    for (int n = 0; n < 300; n++) {
        struct random_state x;

        random_state_make(&seed, robot, &x);
        for (size_t j = 0; j < robot->njoint; j++) {
            x.q[robot->nq - robot->njoint + j] = random_in(&seed, -size, size);
        }
        generic.ops->kinematics(&generic, x.q, x.v, (struct body_motion *)expected);
        module->kinematics(x.q, x.v, pose, found);
        for (uint32_t o = 0; o < module->nobserved; o++) {
            for (int m = 0; m < 12; m++) {
                int at = 18 * module->observed[o] + m;

                worst = fmax(worst, fabs(found[at] - expected[at]));
            }
        }
    }
    return worst;
}

/* COMAN's working frames have offsets of 20 degrees between them and the joints' own zeros: were
 * they added to the angles, the sums would be rounded to the last place of 3e7 rad, 4e-9. */
TEST_WITH(joints_that_turn_for_ever_keep_their_accuracy, open_arena, close_arena)
{
    static const double size[] = {3.0, 3e5, 3e7, 1e12, 1e15};
    const struct robot *robot = load_coman(NULL);

    for (const struct dynamics_module *module = symbolic_builtin(robot); module;
         module = module->plainer) {
        for (size_t n = 0; n < sizeof size / sizeof size[0]; n++) {
            double worst = far_difference(robot, module, size[n]);

            print_message("# %s: within %.0e rad: %.2g\n", module->variant, size[n], worst);
            assert_true(worst <= 6e-15);
        }
    }
}

/* Whether cc can be run; the tests that need it are skipped where it cannot. */
static void need_compiler(void)
{
    if (system("cc --version >/dev/null 2>&1") != 0) {
        print_message("SKIP: no C compiler (cc)\n");
        skip();
    }
}

/* Compares a module that is compiled here with the numeric algorithms. */
static void compare_compiled(const struct robot *robot, const struct robot *heavier,
                             const struct symbolic_options *options)
{
    struct symbolic_library library;
    struct error error;

    assert_no_error(symbolic_compile(robot, options, "-O1", &library, &error), error.text);
    compare_module(robot, library.module);
    if (heavier) {
        compare_module(heavier, library.module);
    }
    symbolic_close(&library);
}

TEST_WITH(small_trees_compiled_here_have_the_same_equations, open_arena, close_arena)
{
    uint64_t seed = 51;
    struct random_tree tree;
    struct error error;

    need_compiler();
    int made = 0;
    for (int tries = 0; made < 3 && tries < 1000; tries++) {
        const struct symbolic_options options = {.lanes = 4};

        assert_ok(made % 2 ? limbed_tree_make(&seed, &tree, &error)
                           : random_tree_make(&seed, &tree, &error));
        if (tree.robot.njoint > (made % 2 ? 24 : 5)) {
            continue;
        }
        compare_compiled(&tree.robot, NULL, &options);
        made++;
    }
    assert_int_equal(made, 3);
}

/* Functions beyond some thousand operations are cut into pieces: a chain that is long enough. */
TEST_WITH(long_functions_compute_the_same_in_pieces, open_arena, close_arena)
{
    const struct symbolic_options options = {.lanes = 4};
    static struct random_tree tree;
    struct symbolic_report report;
    struct robot *robot = &tree.robot;
    struct error error;
    uint64_t seed = 57;
    FILE *nowhere = fopen("/dev/null", "w");

    need_compiler();
    *robot = (struct robot){.name = "chain",
                            .floating = true,
                            .gravity = {0.0, 0.0, -9.81},
                            .imu_frame = -1,
                            .nbody = 17,
                            .njoint = 16,
                            .body = tree.body,
                            .joint = tree.joint};
    for (size_t b = 0; b < robot->nbody; b++) {
        tree.body[b] = (struct robot_body){.name = "body", .parent = (int)b - 1};
        tree.body[b].observed = b == robot->nbody - 1;
        random_inertia(&seed, &tree.body[b].inertia);
        if (b > 0) {
            tree.joint[b - 1] = (struct robot_joint){.name = "joint",
                                                     .lower = -9.0,
                                                     .upper = 9.0,
                                                     .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
            random_vector(&seed, 0.3, tree.joint[b - 1].origin);
            tree.joint[b - 1].axis[b % 3] = 1.0;
        }
    }
    assert_ok(robot_finish(robot, &error));
    assert_ok(symbolic_generate(robot, &options, nowhere, &report, &error));
    fclose(nowhere);
    assert_true(report.count[0].operations > 4000);
    compare_compiled(robot, NULL, &options);
}

/* A fixed base with a slide among its joints, compiled here with masses as inputs. */
TEST_WITH(a_fixed_base_with_a_slide_takes_masses_as_inputs, open_arena, close_arena)
{
    const struct symbolic_options options = {.lanes = 4, .inertia_inputs = true};
    struct random_tree tree;
    struct error error;
    uint64_t seed = 127;
    bool slides;
    int tries = 0;

    need_compiler();
    do {
        slides = false;
        assert_ok(limbed_tree_make(&seed, &tree, &error));
        for (size_t j = 0; j < tree.robot.njoint; j++) {
            slides = slides || tree.joint[j].type == JOINT_PRISMATIC;
        }
    } while (++tries < 1000 && (tree.robot.floating || !slides || tree.robot.njoint > 24));
    assert_true(tries < 1000);
    compare_compiled(&tree.robot, with_masses(&tree.robot, &seed), &options);
}

static void make_pendulum(struct random_tree *tree)
{
    struct error error;

    assert_no_error(pendulum_make(tree, &error), error.text);
}

/* Compiles the robot's file with warnings as errors, without making code. */
static void assert_clean(const struct robot *robot)
{
    const struct symbolic_options options = {.lanes = 4};
    char path[] = "/tmp/hil-clean-XXXXXX", command[256];
    struct error error;
    FILE *file;

    file = fdopen(mkstemp(path), "w");
    assert_non_null(file);
    assert_no_error(symbolic_generate(robot, &options, file, NULL, &error), error.text);
    fclose(file);
    snprintf(command, sizeof command,
             "cc -std=gnu11 -Wall -Wextra -Wshadow -Wundef -Wmissing-prototypes -Werror "
             "-fsyntax-only -x c '%s'",
             path);
    assert_int_equal(system(command), 0);
    unlink(path);
}

TEST_WITH(generated_code_compiles_without_warnings, open_arena, close_arena)
{
    uint64_t seed = 61;
    struct random_tree tree;
    struct error error;

    need_compiler();
    make_pendulum(&tree);
    assert_clean(&tree.robot);
    for (int n = 0; n < 3; n++) {
        assert_ok(limbed_tree_make(&seed, &tree, &error));
        assert_clean(&tree.robot);
    }
    /* A free body without a joint */
    tree.robot.floating = true;
    tree.robot.njoint = 0;
    tree.robot.nbody = 1;
    assert_ok(robot_finish(&tree.robot, &error));
    assert_clean(&tree.robot);
}

TEST_WITH(a_compiler_that_fails_makes_no_module, open_arena, close_arena)
{
    const struct symbolic_options options = {.lanes = 4};
    struct symbolic_library library;
    struct random_tree tree;
    struct error error;

    make_pendulum(&tree);
    assert_int_equal(
        symbolic_compile(&tree.robot, &options, "-fno-such-flag 2>/dev/null", &library, &error),
        ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "(cc) made no module"));
    assert_null(library.handle);
}

TEST_WITH(a_module_of_another_robot_is_refused, open_arena, close_arena)
{
    const struct robot *coman = load_coman(NULL);
    struct random_tree tree;
    struct dynamics d;
    struct error error;

    make_pendulum(&tree);
    assert_int_equal(dynamics_generated(&tree.robot, symbolic_builtin(coman), &arena, &d, &error),
                     ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "another robot"));
    assert_null(symbolic_builtin(&tree.robot));
}
