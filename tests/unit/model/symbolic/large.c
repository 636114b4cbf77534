/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Robots of many joints: what the compiler gets is bounded, function by function, and what comes
 * out of it are the numeric algorithm's equations.
 */
#include "model/symbolic/symbolic.h"
#include "tests/unit/arena_fixture.h"
#include "tests/unit/model/random_robot.h"
#include "tests/test.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { LONGEST = 120, BODIES = LONGEST + 1, VELOCITIES = LONGEST + 6 };

/* A chain of turning joints, axes in turn, hanging from a floating base; every tenth body is
 * observed. */
struct chain {
    struct robot robot;
    struct robot_body body[BODIES];
    struct robot_joint joint[LONGEST];
};

static void make_chain(struct chain *chain, size_t length)
{
    struct robot *robot = &chain->robot;
    struct error error;
    uint64_t seed = 9;

    *robot = (struct robot){.name = "chain",
                            .floating = true,
                            .gravity = {0.0, 0.0, -9.81},
                            .imu_frame = -1,
                            .nbody = length + 1,
                            .njoint = length,
                            .body = chain->body,
                            .joint = chain->joint};
    for (size_t b = 0; b <= length; b++) {
        chain->body[b] =
            (struct robot_body){.name = "body", .parent = (int)b - 1, .observed = b % 10 == 0};
        random_inertia(&seed, &chain->body[b].inertia);
        if (b > 0) {
            chain->joint[b - 1] = (struct robot_joint){.name = "joint",
                                                       .lower = -9.0,
                                                       .upper = 9.0,
                                                       .origin = {0.0, 0.0, -0.2},
                                                       .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
            chain->joint[b - 1].axis[b * 2 % 3] = 1.0;
        }
    }
    if (robot_finish(robot, &error)) {
        fail_msg("%s", error.text);
    }
}

/* Lines of the longest function of a generated file. */
static size_t longest_function(const char *text)
{
    size_t longest = 0, lines = 0;

    for (const char *line = text; line; line = strchr(line + 1, '\n')) {
        lines = strncmp(line, "\nTARGET static", 14) == 0 ? 0 : lines + 1;
        longest = strncmp(line, "\n}", 2) == 0 && lines > longest ? lines : longest;
    }
    return longest;
}

/* What a compiler needs grows faster than a function: none is long, and all of them together grow
 * hardly faster than the robot. */
TEST(functions_stay_short_however_many_joints_there_are)
{
    const struct symbolic_options options = {.lanes = 4};
    static struct chain chain;
    size_t size[2], longest;

    for (int n = 0; n < 2; n++) {
        struct symbolic_report report;
        struct error error;
        char *text = NULL;
        FILE *file;

        make_chain(&chain, n ? LONGEST : LONGEST / 2);
        file = open_memstream(&text, &size[n]);
        assert_non_null(file);
        assert_int_equal(symbolic_generate(&chain.robot, &options, file, &report, &error),
                         ERROR_NONE);
        fclose(file);
        longest = longest_function(text);
        print_message("# %zu joints: %zu bytes, longest function %zu lines\n", chain.robot.njoint,
                      size[n], longest);
        assert_true(report.large);
        assert_in_range(longest, 500, 1000);
        free(text);
    }
    assert_true((double)size[1] < 2.2 * (double)size[0]);
}

/* A state of the chain, numbers of order one. */
struct chain_state {
    double q[LONGEST + 7], v[VELOCITIES], tau[LONGEST], extra[LONGEST];
    struct wrench ext[BODIES];
    struct added_inertia added[BODIES];
};

static void make_state(uint64_t *seed, const struct robot *robot, struct chain_state *x)
{
    memset(x, 0, sizeof *x);
    for (size_t i = 0; i < robot->nq; i++) {
        x->q[i] = random_in(seed, -1.0, 1.0);
    }
    for (size_t i = 0; i < robot->nv; i++) {
        x->v[i] = random_in(seed, -1.0, 1.0);
    }
    for (size_t i = 0; i < robot->njoint; i++) {
        x->tau[i] = random_in(seed, -1.0, 1.0);
        x->extra[i] = random_in(seed, 0.0, 1.0);
    }
    for (size_t b = 0; b < robot->nbody; b++) {
        random_vector(seed, 1.0, x->ext[b].force);
        random_vector(seed, 1.0, x->ext[b].moment);
        x->added[b].A[0] = x->added[b].A[6] = x->added[b].A[11] = 1.0;
    }
}

static double worst_difference(const double *found, const double *expected, size_t count)
{
    double size = 0.0, worst = 0.0;

    for (size_t i = 0; i < count; i++) {
        size = fmax(size, fabs(expected[i]));
        worst = fmax(worst, fabs(found[i] - expected[i]));
    }
    return worst / size;
}

TEST_WITH(the_compiled_equations_are_the_numeric_ones, open_arena, close_arena)
{
    const struct symbolic_options options = {.lanes = 4};
    static struct chain chain;
    static struct chain_state x;
    struct dynamics generic, generated;
    struct symbolic_library library;
    double found[VELOCITIES], expected[VELOCITIES];
    char folder[] = "/tmp/hil-large-XXXXXX", command[64];
    struct error error;
    uint64_t seed = 11;

    if (system("cc --version >/dev/null 2>&1") != 0) {
        print_message("SKIP: no C compiler (cc)\n");
        skip();
    }
    assert_non_null(mkdtemp(folder));
    make_chain(&chain, 30);
    if (symbolic_build(&chain.robot, &options, folder, &library, &error) ||
        dynamics_generic(&chain.robot, &arena, &generic, &error) ||
        dynamics_generated(&chain.robot, library.module, &arena, &generated, &error)) {
        fail_msg("%s", error.text);
    }
    for (int n = 0; n < 20; n++) {
        const struct dynamics *a = &generic, *b = &generated;
        size_t nv = chain.robot.nv;

        make_state(&seed, &chain.robot, &x);
        a->ops->forward(a, x.q, x.v, x.tau, x.ext, expected);
        b->ops->forward(b, x.q, x.v, x.tau, x.ext, found);
        assert_true(worst_difference(found, expected, nv) < 1e-11);
        a->ops->implicit(a, x.q, x.v, x.tau, x.ext, x.extra, x.added, expected);
        b->ops->implicit(b, x.q, x.v, x.tau, x.ext, x.extra, x.added, found);
        assert_true(worst_difference(found, expected, nv) < 1e-11);
        a->ops->inverse(a, x.q, x.v, x.v, x.ext, expected);
        b->ops->inverse(b, x.q, x.v, x.v, x.ext, found);
        assert_true(worst_difference(found, expected, nv) < 1e-10);
    }
    symbolic_close(&library);
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    assert_int_equal(system(command), 0);
}
