/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Generated code, compiled: the built-in module of COMAN and modules compiled here are the numeric
 * algorithms in every variant that this CPU runs; refusing of modules.
 */
#include "base/array.h"
#include "base/instruction_set.h"
#include "model/symbolic/builtin.h"
#include "model/symbolic/symbolic.h"
#include "tests/unit/model/coman.h"
#include "tests/unit/model/symbolic/evaluate.h"
#include "tests/test.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { BODIES = RANDOM_JOINTS + 1, VELOCITIES = RANDOM_JOINTS + 6, POSE = 40 * BODIES };

static char folder[64];

FIXTURE(open_folder)
{
    strcpy(folder, "/tmp/hil-symbolic-XXXXXX");
    return open_arena(test_state) || !mkdtemp(folder);
}

FIXTURE(close_folder)
{
    char command[128];

    close_arena(test_state);
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return system(command);
}

/* Sums of relative differences over states, and the largest. */
struct difference {
    double sum, worst;
    int count;
};

static void note(struct difference *d, const double *found, const double *expected, size_t n)
{
    double x = relative_difference(found, expected, n);

    d->sum += x;
    d->worst = fmax(d->worst, x);
    d->count++;
}

static void assert_within(const struct difference *d, double mean, const char *variant,
                          const char *what)
{
    print_message("# %s %s: mean %.2g, largest %.2g\n", variant, what, d->sum / d->count, d->worst);
    if (!(d->sum / d->count <= mean)) {
        fail_msg("%s %s: mean relative difference %g", variant, what, d->sum / d->count);
    }
}

/* Everything that struct dynamics promises, generated against generic. */
static void compare_module(const struct robot *robot, const struct dynamics_module *module,
                           int states)
{
    static double expected[18 * BODIES], found[18 * BODIES];
    struct difference forward = {0}, wrench = {0}, inverse = {0}, motion = {0}, rates = {0};
    struct difference energy = {0};
    struct dynamics generic, generated;
    struct error error;
    uint64_t seed = 41;

    if (dynamics_generic(robot, &arena, &generic, &error) ||
        dynamics_generated(robot, module, &arena, &generated, &error)) {
        fail_msg("%s", error.text);
    }
    for (int n = 0; n < states; n++) {
        const struct dynamics *a = &generic, *b = &generated;
        double vdot[VELOCITIES];
        struct random_state x;

        random_state_make(&seed, robot, &x);
        a->ops->forward(a, x.q, x.v, x.tau, NULL, expected);
        b->ops->forward(b, x.q, x.v, x.tau, NULL, found);
        note(&forward, found, expected, robot->nv);
        a->ops->forward(a, x.q, x.v, x.tau, x.ext, vdot);
        b->ops->forward(b, x.q, x.v, x.tau, x.ext, found);
        note(&wrench, found, vdot, robot->nv);
        a->ops->inverse(a, x.q, x.v, vdot, n % 2 ? x.ext : NULL, expected);
        b->ops->inverse(b, x.q, x.v, vdot, n % 2 ? x.ext : NULL, found);
        note(&inverse, found, expected, robot->nv);
        memset(expected, 0, sizeof expected);
        memset(found, 0, sizeof found);
        a->ops->kinematics(a, x.q, x.v, (struct body_motion *)expected);
        b->ops->kinematics(b, x.q, x.v, (struct body_motion *)found);
        for (uint32_t o = 0; o < module->nobserved; o++) {
            note(&motion, found + 18 * module->observed[o], expected + 18 * module->observed[o],
                 18);
        }
        /* Other velocities in the same pose */
        a->ops->velocities(a, x.q, vdot, (struct body_motion *)expected);
        b->ops->velocities(b, x.q, vdot, (struct body_motion *)found);
        for (uint32_t o = 0; o < module->nobserved; o++) {
            note(&motion, found + 18 * module->observed[o], expected + 18 * module->observed[o],
                 18);
        }
        a->ops->acceleration(a, x.q, x.v, vdot, (struct body_acceleration *)expected);
        b->ops->acceleration(b, x.q, x.v, vdot, (struct body_acceleration *)found);
        for (uint32_t o = 0; o < module->nobserved; o++) {
            note(&rates, found + 6 * module->observed[o], expected + 6 * module->observed[o], 6);
        }
        a->ops->energy(a, x.q, x.v, &expected[0], &expected[1]);
        b->ops->energy(b, x.q, x.v, &found[0], &found[1]);
        note(&energy, found, expected, 2);
    }
    assert_within(&forward, 1e-12, module->variant, "forward");
    assert_within(&wrench, 1e-12, module->variant, "forward with wrenches");
    assert_within(&inverse, 1e-11, module->variant, "inverse");
    assert_within(&motion, 1e-12, module->variant, "kinematics");
    assert_within(&rates, 1e-12, module->variant, "acceleration");
    assert_within(&energy, 1e-12, module->variant, "energy");
}

static void compare_variants(const struct robot *robot, const struct dynamics_module *module,
                             int states)
{
    for (; module; module = module->plainer) {
        compare_module(robot, module, states);
    }
}

/* Twice the same accelerations, to the bit. */
static void assert_repeats(const struct robot *robot, const struct dynamics_module *module)
{
    double first[VELOCITIES], second[VELOCITIES];
    struct random_state x;
    uint64_t seed = 53;

    for (int n = 0; n < 50; n++) {
        random_state_make(&seed, robot, &x);
        module->forward(NULL, x.q, x.v, x.tau, x.ext[0].force, first);
        module->forward(NULL, x.q, x.v, x.tau, x.ext[0].force, second);
        assert_memory_equal(first, second, robot->nv * sizeof *first);
    }
}

/* The variant of COMAN's built-in module, whichever this CPU would choose; skipped where it cannot
 * run it, for then the chain from its best to the plain one has it not. */
static void compare_variant(const char *name)
{
    const struct robot *robot = load_coman(NULL);
    const struct dynamics_module *module = symbolic_builtin(robot);

    assert_non_null(module);
    while (module && strcmp(module->variant, name) != 0) {
        module = module->plainer;
    }
    if (!module) {
        print_message("SKIP: this CPU does not run the variant %s\n", name);
        skip();
    }
    assert_int_equal(module->nobserved, 12);
    compare_module(robot, module, 300);
    assert_repeats(robot, module);
}

/* Inertias of joints and of observed bodies for implicit, the latter positive: dominated by their
 * diagonals. */
static void make_extra_inertia(uint64_t *seed, double *extra, double *added)
{
    for (int j = 0; j < RANDOM_JOINTS; j++) {
        extra[j] = random_in(seed, 0.0, 0.2);
    }
    for (int m = 0; m < 21 * BODIES; m++) {
        const int at = m % 21;
        const bool diagonal = at == 0 || at == 6 || at == 11 || at == 15 || at == 18 || at == 20;

        added[m] = diagonal ? 1.0 : random_in(seed, -0.1, 0.1);
    }
}

/* All that two variants of a module give, to the bit, also for angles beyond the fast reduction. */
static void assert_same_bits(const struct robot *robot, const struct dynamics_module *a,
                             const struct dynamics_module *b)
{
    static double of_a[18 * BODIES], of_b[18 * BODIES];
    static double extra[RANDOM_JOINTS], added[21 * BODIES];
    static _Alignas(32) double pose_a[POSE], pose_b[POSE];
    struct random_state x;
    uint64_t seed = 67;

    assert_true(a->npose == b->npose && a->npose <= POSE);

    for (int n = 0; n < 1000; n++) {
        const size_t nv = robot->nv * sizeof(double);

        random_state_make(&seed, robot, &x);
        make_extra_inertia(&seed, extra, added);
        x.q[robot->nq - 1] *= n % 10 ? 1.0 : 1e7;
        a->implicit(NULL, x.q, x.v, x.tau, x.ext[0].force, extra, added, of_a);
        b->implicit(NULL, x.q, x.v, x.tau, x.ext[0].force, extra, added, of_b);
        assert_memory_equal(of_a, of_b, nv);
        a->forward(NULL, x.q, x.v, x.tau, x.ext[0].force, of_a);
        b->forward(NULL, x.q, x.v, x.tau, x.ext[0].force, of_b);
        assert_memory_equal(of_a, of_b, nv);
        a->inverse(NULL, x.q, x.v, of_a, NULL, of_a + VELOCITIES);
        b->inverse(NULL, x.q, x.v, of_a, NULL, of_b + VELOCITIES);
        assert_memory_equal(of_a + VELOCITIES, of_b + VELOCITIES, nv);
        a->kinematics(x.q, x.v, pose_a, of_a);
        b->kinematics(x.q, x.v, pose_b, of_b);
        assert_memory_equal(pose_a, pose_b, a->npose * sizeof *pose_a);
        a->velocities(x.q, pose_a, of_a);
        b->velocities(x.q, pose_b, of_b);
        for (uint32_t o = 0; o < a->nobserved; o++) {
            assert_memory_equal(of_a + 18 * a->observed[o], of_b + 18 * a->observed[o],
                                18 * sizeof(double));
        }
        a->acceleration(x.v, x.q, pose_a, of_a);
        b->acceleration(x.v, x.q, pose_b, of_b);
        for (uint32_t o = 0; o < a->nobserved; o++) {
            assert_memory_equal(of_a + 6 * a->observed[o], of_b + 6 * a->observed[o],
                                6 * sizeof(double));
        }
        a->energy(NULL, x.q, x.v, of_a);
        b->energy(NULL, x.q, x.v, of_b);
        assert_memory_equal(of_a, of_b, 2 * sizeof(double));
    }
}

TEST_WITH(built_in_modules_have_the_same_bits_in_every_variant, open_folder, close_folder)
{
    static const char *const robots[] = {COMAN, HIL_SOURCE_DIR "/config/robots/walkman.yaml"};
    struct error error;

    for (size_t i = 0; i < ARRAY_COUNT(robots); i++) {
        const struct dynamics_module *module;
        const struct robot *robot;

        assert_int_equal(robot_load(robots[i], NULL, &arena, &robot, &error), ERROR_NONE);
        module = symbolic_builtin(robot);
        assert_non_null(module);
        for (; module->plainer; module = module->plainer) {
            assert_same_bits(robot, module, module->plainer);
        }
    }
}

TEST_WITH(coman_is_the_same_in_the_plain_variant, open_folder, close_folder)
{
    compare_variant("plain");
}

TEST_WITH(coman_is_the_same_in_the_avx2_variant, open_folder, close_folder)
{
    compare_variant("avx2");
}

TEST_WITH(coman_is_the_same_in_the_avx512_variant, open_folder, close_folder)
{
    compare_variant("avx512");
}

/* Distance of value from exact in units of the last place of exact. */
static double ulps(double value, long double exact)
{
    double near = (double)exact;

    return (double)(fabsl((long double)value - exact) /
                    (long double)(nextafter(fabs(near), 2.0) - fabs(near)));
}

TEST_WITH(sine_and_cosine_are_right_to_the_last_place, open_folder, close_folder)
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

TEST_WITH(far_angles_infinities_and_nan_are_those_of_libm, open_folder, close_folder)
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

    if (dynamics_generic(robot, &arena, &generic, &error)) {
        fail_msg("%s", error.text);
    }
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
TEST_WITH(joints_that_turn_for_ever_keep_their_accuracy, open_folder, close_folder)
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

TEST_WITH(small_trees_compiled_here_have_the_same_equations, open_folder, close_folder)
{
    uint64_t seed = 51;
    struct random_tree tree;
    struct error error;

    need_compiler();
    int made = 0;
    for (int tries = 0; made < 3 && tries < 1000; tries++) {
        const struct symbolic_options options = {.lanes = 4, .fast_compile = true};
        struct symbolic_library library;

        assert_int_equal(made % 2 ? limbed_tree_make(&seed, &tree, &error)
                                  : random_tree_make(&seed, &tree, &error),
                         ERROR_NONE);
        if (tree.robot.njoint > (made % 2 ? 24 : 5)) {
            continue;
        }
        if (symbolic_build(&tree.robot, &options, folder, &library, &error)) {
            fail_msg("%s", error.text);
        }
        compare_variants(&tree.robot, library.module, 50);
        symbolic_close(&library);
        made++;
    }
    assert_int_equal(made, 3);
}

/* Functions beyond some thousand operations are cut into pieces: a chain that is long enough. */
TEST_WITH(long_functions_compute_the_same_in_pieces, open_folder, close_folder)
{
    const struct symbolic_options options = {.lanes = 4, .fast_compile = true};
    static struct random_tree tree;
    struct symbolic_report report;
    struct symbolic_library library;
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
    assert_int_equal(robot_finish(robot, &error), ERROR_NONE);
    assert_int_equal(symbolic_generate(robot, &options, nowhere, &report, &error), ERROR_NONE);
    fclose(nowhere);
    assert_true(report.count[0].operations > 4000);
    if (symbolic_build(robot, &options, folder, &library, &error)) {
        fail_msg("%s", error.text);
    }
    compare_variants(robot, library.module, 50);
    symbolic_close(&library);
}

static void make_pendulum(struct random_tree *tree)
{
    struct error error;

    if (pendulum_make(tree, &error)) {
        fail_msg("%s", error.text);
    }
}

/* Compiles the robot's file with warnings as errors, without making code. */
static void assert_clean(const struct robot *robot)
{
    const struct symbolic_options options = {.lanes = 4};
    char path[128], command[256];
    struct error error;
    FILE *file;

    snprintf(path, sizeof path, "%s/clean.c", folder);
    file = fopen(path, "w");
    assert_non_null(file);
    if (symbolic_generate(robot, &options, file, NULL, &error)) {
        fail_msg("%s", error.text);
    }
    fclose(file);
    snprintf(command, sizeof command,
             "cc -std=gnu11 -Wall -Wextra -Wshadow -Wundef -Wmissing-prototypes -Werror "
             "-fsyntax-only '%s'",
             path);
    assert_int_equal(system(command), 0);
}

TEST_WITH(generated_code_compiles_without_warnings, open_folder, close_folder)
{
    uint64_t seed = 61;
    struct random_tree tree;
    struct error error;

    need_compiler();
    make_pendulum(&tree);
    assert_clean(&tree.robot);
    for (int n = 0; n < 3; n++) {
        assert_int_equal(limbed_tree_make(&seed, &tree, &error), ERROR_NONE);
        assert_clean(&tree.robot);
    }
    /* A free body without a joint */
    tree.robot.floating = true;
    tree.robot.njoint = 0;
    tree.robot.nbody = 1;
    assert_int_equal(robot_finish(&tree.robot, &error), ERROR_NONE);
    assert_clean(&tree.robot);
}

TEST_WITH(a_module_of_another_robot_is_refused, open_folder, close_folder)
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
