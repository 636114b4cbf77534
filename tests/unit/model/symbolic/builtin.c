/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Built-in modules: with masses as inputs they are the numeric algorithms of the robot at hand, in
 * every variant; which of them a robot gets.
 */
#include "model/symbolic/builtin.h"
#include "tests/unit/model/coman.h"
#include "tests/unit/model/symbolic/evaluate.h"
#include "tests/test.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { BODIES = RANDOM_JOINTS + 1, VELOCITIES = RANDOM_JOINTS + 6, STATES = 100 };

static const struct robot *load_robot(const char *file)
{
    const struct robot *robot;
    struct error error;

    if (robot_load(file, NULL, &arena, &robot, &error)) {
        fail_msg("%s", error.text);
    }
    return robot;
}

/* The robot with other mass properties: up to 5 kg more in each body, its center elsewhere. */
static struct robot *with_masses(const struct robot *robot, uint64_t *seed)
{
    struct robot *heavier;
    struct error error;

    if (robot_copy(robot, &arena, &heavier, &error)) {
        fail_msg("%s", error.text);
    }
    for (size_t b = 0; b < heavier->nbody; b++) {
        struct robot_inertia *inertia = &heavier->body[b].inertia;
        double shift[3];

        inertia->mass += random_in(seed, 0.0, 5.0);
        random_vector(seed, 0.05, shift);
        for (int m = 0; m < 3; m++) {
            inertia->com[m] += shift[m];
        }
    }
    if (robot_finish(heavier, &error)) {
        fail_msg("%s", error.text);
    }
    assert_true(heavier->hash != robot->hash && heavier->massless_hash == robot->massless_hash);
    return heavier;
}

/* Numbers that make the added inertias of implicit integration positive. */
static void random_added(uint64_t *seed, double *extra, double *added)
{
    for (int j = 0; j < RANDOM_JOINTS; j++) {
        extra[j] = random_in(seed, 0.0, 0.2);
    }
    for (int m = 0; m < 21 * BODIES; m++) {
        int at = m % 21;
        bool diagonal = at == 0 || at == 6 || at == 11 || at == 15 || at == 18 || at == 20;

        added[m] = diagonal ? 1.0 : random_in(seed, -0.1, 0.1);
    }
}

/* Everything that struct dynamics has, side by side. */
struct answers {
    double forward[VELOCITIES], wrenches[VELOCITIES], implicit[VELOCITIES], inverse[VELOCITIES];
    double motion[18 * BODIES], rates[6 * BODIES], energy[2];
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
            random_added(&seed, extra, added);
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

/* A built-in module of the robot in that file with other masses. */
static void compare_with_masses(const char *file)
{
    const struct robot *robot = load_robot(file);
    uint64_t seed = 83;

    for (int n = 0; n < 3; n++) {
        const struct robot *heavier = with_masses(robot, &seed);
        const struct dynamics_module *module = symbolic_builtin(heavier);

        assert_non_null(module);
        assert_true(module->ninertia > 0);
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

TEST_WITH(a_module_made_from_the_robot_comes_first, open_arena, close_arena)
{
    const struct robot *coman = load_coman(NULL);
    const struct dynamics_module *module = symbolic_builtin(coman);
    uint64_t seed = 97;

    assert_non_null(module);
    assert_int_equal(module->ninertia, 0);
    assert_int_equal(module->robot_hash, coman->hash);
    assert_ptr_equal(symbolic_builtin_exact(coman), module);
    assert_null(symbolic_builtin_exact(with_masses(coman, &seed)));
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
    assert_int_equal(robot_finish(longer, &error), ERROR_NONE);
    assert_true(longer->massless_hash != coman->massless_hash);
    assert_null(symbolic_builtin(longer));
    assert_int_equal(dynamics_generated(longer, module, &arena, &d, &error), ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "another robot"));
    assert_non_null(strstr(error.text, "not only with other masses"));
}

TEST_WITH(a_module_whose_frames_are_others_is_refused, open_arena, close_arena)
{
    uint64_t seed = 103;
    const struct robot *heavier = with_masses(load_coman(NULL), &seed);
    struct dynamics_module module = *symbolic_builtin(heavier);
    struct dynamics d;
    struct error error;

    module.tree_hash ^= 1;
    assert_int_equal(dynamics_generated(heavier, &module, &arena, &d, &error), ERROR_UNSUPPORTED);
    assert_non_null(strstr(error.text, "other working frames"));
}

TEST_WITH(no_memory_is_said_only_of_memory, open_arena, close_arena)
{
    uint64_t seed = 113;
    const struct robot *heavier = with_masses(load_coman(NULL), &seed);
    struct error error;
    struct arena small;
    struct dynamics d;

    assert_int_equal(arena_init(&small, 64, &error), ERROR_NONE);
    while (arena_alloc(&small, 1, 64)) {
    }
    assert_int_equal(dynamics_generated(heavier, symbolic_builtin(heavier), &small, &d, &error),
                     ERROR_MEMORY);
    assert_non_null(strstr(error.text, "no memory"));
    arena_fini(&small);
}

/* A fixed base with a slide among its joints, compiled here with masses as inputs. */
TEST_WITH(a_fixed_base_with_a_slide_takes_masses_as_inputs, open_arena, close_arena)
{
    const struct symbolic_options options = {
        .lanes = 4, .fast_compile = true, .inertia_inputs = true};
    char folder[] = "/tmp/hil-builtin-XXXXXX", command[64];
    struct symbolic_library library;
    const struct robot *heavier;
    struct random_tree tree;
    struct error error;
    uint64_t seed = 127;
    bool slides;
    int tries = 0;

    if (system("cc --version >/dev/null 2>&1") != 0) {
        print_message("SKIP: no C compiler (cc)\n");
        skip();
    }
    do {
        slides = false;
        assert_int_equal(limbed_tree_make(&seed, &tree, &error), ERROR_NONE);
        for (size_t j = 0; j < tree.robot.njoint; j++) {
            slides = slides || tree.joint[j].type == JOINT_PRISMATIC;
        }
    } while (++tries < 1000 && (tree.robot.floating || !slides || tree.robot.njoint > 24));
    assert_true(tries < 1000);
    assert_non_null(mkdtemp(folder));
    if (symbolic_build(&tree.robot, &options, folder, &library, &error)) {
        fail_msg("%s", error.text);
    }
    heavier = with_masses(&tree.robot, &seed);
    compare_module(&tree.robot, library.module);
    compare_module(heavier, library.module);
    symbolic_close(&library);
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    assert_int_equal(system(command), 0);
}
