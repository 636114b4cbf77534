/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The generator's equations, interpreted: what is derived for a tree, in any number of lanes, is
 * what the numeric algorithms compute, and simplification does what it says.
 */
#include "model/spatial.h"
#include "model/symbolic/symbolic.h"
#include "tests/unit/model/coman.h"
#include "tests/unit/model/symbolic/evaluate.h"

enum { TREES = 120, STATES = 3, BODIES = RANDOM_JOINTS + 1, VELOCITIES = RANDOM_JOINTS + 6 };

/* ---- the graph ---- */

static expr input(struct graph *graph, int index)
{
    return graph_input(graph, DERIVE_Q, 1, &index);
}

BENCH(graph_init, struct graph, graph_fini)

TEST_ON(constants_are_folded_and_zeros_and_ones_vanish, graph_init, g)
{
    expr x = input(g, 0), one = graph_const(g, 1.0), two = graph_const(g, 2.0);

    assert_int_equal(graph_add(g, two, two), graph_const(g, 4.0));
    assert_int_equal(graph_mul(g, graph_const(g, -3.0), two), graph_const(g, -6.0));
    assert_int_equal(graph_add(g, x, EXPR_ZERO), x);
    assert_int_equal(graph_mul(g, x, EXPR_ZERO), EXPR_ZERO);
    assert_int_equal(graph_mul(g, one, x), x);
    assert_int_equal(graph_mul(g, x, expr_neg(one)), expr_neg(x));
    assert_int_equal(graph_add(g, x, expr_neg(x)), EXPR_ZERO);
    assert_int_equal(graph_add(g, x, x), graph_mul(g, two, x));
    assert_int_equal(graph_mul(g, two, graph_mul(g, x, two)), graph_mul(g, x, graph_const(g, 4.0)));
    assert_int_equal(graph_sin(g, EXPR_ZERO), EXPR_ZERO);
    assert_int_equal(graph_cos(g, EXPR_ZERO), one);
    assert_int_equal(graph_invert(g, graph_invert(g, x)), x);
}

TEST_ON(equal_expressions_are_one_node_whatever_their_order_and_sign, graph_init, g)
{
    expr x = input(g, 0), y = input(g, 1);
    size_t count;

    assert_int_equal(input(g, 0), x);
    assert_int_equal(graph_add(g, x, y), graph_add(g, y, x));
    assert_int_equal(graph_add(g, x, expr_neg(y)), expr_neg(graph_add(g, y, expr_neg(x))));
    assert_int_equal(graph_mul(g, expr_neg(x), y), expr_neg(graph_mul(g, y, x)));
    assert_int_equal(graph_sin(g, expr_neg(x)), expr_neg(graph_sin(g, x)));
    assert_int_equal(graph_cos(g, expr_neg(x)), graph_cos(g, x));
    count = g->count;
    assert_int_equal(graph_add(g, expr_neg(x), expr_neg(y)), expr_neg(graph_add(g, x, y)));
    assert_int_equal(graph_add(g, expr_neg(x), y), graph_add(g, y, expr_neg(x)));
    assert_int_equal(g->count, count);
}

TEST_ON(sine_squared_and_cosine_squared_are_one, graph_init, g)
{
    expr s = graph_sin(g, input(g, 0)), c = graph_cos(g, input(g, 0));
    expr other = graph_cos(g, input(g, 1)), one = graph_const(g, 1.0);

    assert_int_equal(graph_add(g, graph_mul(g, s, s), graph_mul(g, c, c)), one);
    assert_int_equal(graph_add(g, graph_mul(g, c, c), graph_mul(g, s, s)), one);
    assert_int_not_equal(graph_add(g, graph_mul(g, s, s), graph_mul(g, other, other)), one);
}

TEST_ON(packing_and_taking_lanes_undo_each_other, graph_init, g)
{
    const int index[2] = {3, 5};
    expr x = graph_sin(g, graph_input(g, DERIVE_Q, 2, index));
    expr both[2] = {graph_lane(g, x, 0), graph_lane(g, x, 1)};
    expr swapped[2] = {both[1], both[0]}, same[2] = {both[0], both[0]};

    assert_int_equal(graph_pack(g, 2, both), x);
    assert_int_not_equal(graph_pack(g, 2, swapped), x);
    assert_int_equal(graph_lane(g, graph_pack(g, 2, swapped), 0), both[1]);
    assert_int_equal(graph_pack(g, 2, same), both[0]);
    assert_int_equal(graph_lane(g, graph_input(g, DERIVE_Q, 2, index), 1), input(g, 5));
}

/* ---- the equations ---- */

/* One robot with all its functions derived. */
struct subject {
    const struct robot *robot;
    struct dynamics generic;
    struct tree tree;
    struct graph graph[DERIVE_COUNT];
    struct derivation derivation[DERIVE_COUNT];
};

static void subject_open(struct subject *s, const struct robot *robot, int lanes)
{
    struct error error;

    s->robot = robot;
    if (dynamics_generic(robot, &arena, &s->generic, &error) ||
        tree_create(robot, lanes, &s->tree, &error)) {
        fail_msg("%s", error.text);
    }
    for (int f = 0; f < DERIVE_COUNT; f++) {
        graph_init(&s->graph[f]);
        assert_no_error(derive((enum derive_function)f, &s->tree, false, &s->graph[f],
                               &s->derivation[f], &error),
                        error.text);
    }
}

static void subject_close(struct subject *s)
{
    for (int f = 0; f < DERIVE_COUNT; f++) {
        derivation_fini(&s->derivation[f]);
        graph_fini(&s->graph[f]);
    }
    tree_destroy(&s->tree);
}

/* The pose of the last kinematics is that of velocities and accelerations. */
static void run(const struct subject *s, enum derive_function f, const struct random_state *x,
                const double *vdot, const double *extra, const double *added, double *out)
{
    static double pose[40 * BODIES];
    const double *const argument[DERIVE_ARRAYS] = {[DERIVE_Q] = x->q,
                                                   [DERIVE_V] = x->v,
                                                   [DERIVE_TAU] = x->tau,
                                                   [DERIVE_VDOT] = vdot,
                                                   [DERIVE_EXT] = x->ext[0].force,
                                                   [DERIVE_EXTRA] = extra,
                                                   [DERIVE_ADDED] = added,
                                                   [DERIVE_POSE] = pose};

    assert_in_range(s->derivation[f].npose, 0, 40 * BODIES);
    assert_true(evaluate(&s->graph[f], &s->derivation[f], argument, pose, out));
}

static void assert_close(const double *found, const double *expected, size_t n, double tolerance,
                         const char *what)
{
    double difference = relative_difference(found, expected, n);

    if (!(difference <= tolerance)) {
        fail_msg("%s: relative difference %g", what, difference);
    }
}

static void compare(const struct subject *s, const struct random_state *x)
{
    const struct dynamics *g = &s->generic;
    const struct robot *robot = s->robot;
    double expected[18 * BODIES], found[18 * BODIES], vdot[VELOCITIES], energy[2];
    struct random_state other = *x;
    size_t n = robot->nv;

    g->ops->forward(g, x->q, x->v, x->tau, NULL, expected);
    run(s, DERIVE_FORWARD, x, NULL, NULL, NULL, found);
    assert_close(found, expected, n, 1e-12, "forward");
    g->ops->forward(g, x->q, x->v, x->tau, x->ext, vdot);
    run(s, DERIVE_FORWARD_EXT, x, NULL, NULL, NULL, found);
    assert_close(found, vdot, n, 1e-12, "forward with wrenches");
    g->ops->inverse(g, x->q, x->v, vdot, x->ext, expected);
    run(s, DERIVE_INVERSE, x, vdot, NULL, NULL, found);
    assert_close(found, expected, n, 1e-11, "inverse");
    g->ops->energy(g, x->q, x->v, &expected[0], &expected[1]);
    run(s, DERIVE_ENERGY, x, NULL, NULL, NULL, energy);
    assert_close(&energy[0], &expected[0], 1, 1e-12, "kinetic energy");
    assert_close(energy, expected, 2, 1e-12, "energy");

    memset(expected, 0, sizeof expected);
    memset(found, 0, sizeof found);
    g->ops->kinematics(g, x->q, x->v, (struct body_motion *)expected);
    run(s, DERIVE_KINEMATICS, x, NULL, NULL, NULL, found);
    for (size_t b = 0; b < robot->nbody; b++) {
        if (robot->body[b].observed) {
            assert_close(found + 18 * b, expected + 18 * b, 18, 1e-12, "motion");
        }
    }
    g->ops->acceleration(g, x->q, x->v, vdot, (struct body_acceleration *)expected);
    run(s, DERIVE_ACCELERATION, x, vdot, NULL, NULL, found);
    for (size_t b = 0; b < robot->nbody; b++) {
        if (robot->body[b].observed) {
            assert_close(found + 6 * b, expected + 6 * b, 6, 1e-11, "acceleration");
        }
    }

    /* Other velocities in the same pose: w and v alone */
    memcpy(other.v, vdot, n * sizeof *vdot);
    g->ops->kinematics(g, x->q, vdot, (struct body_motion *)expected);
    run(s, DERIVE_VELOCITIES, &other, NULL, NULL, NULL, found);
    for (size_t b = 0; b < robot->nbody; b++) {
        if (robot->body[b].observed) {
            assert_close(found + 18 * b + 12, expected + 18 * b + 12, 6, 1e-12, "velocities");
        }
    }
}

TEST_WITH(random_trees_have_the_numeric_algorithms_equations, open_arena, close_arena)
{
    struct random_tree tree;
    struct random_state x;
    struct error error;
    uint64_t seed = 20140001;

    for (int t = 0; t < TREES; t++) {
        struct subject s;

        assert_ok(random_tree_make(&seed, &tree, &error));
        subject_open(&s, &tree.robot, 1 << t % 3);
        for (int n = 0; n < STATES; n++) {
            random_state_make(&seed, &tree.robot, &x);
            compare(&s, &x);
        }
        subject_close(&s);
    }
}

TEST_WITH(like_limbs_in_lanes_have_the_same_equations, open_arena, close_arena)
{
    struct random_tree tree;
    struct random_state x;
    struct error error;
    uint64_t seed = 20140002;
    size_t bodies = 0, groups = 0;

    for (int t = 0; t < TREES; t++) {
        struct subject s;

        assert_ok(limbed_tree_make(&seed, &tree, &error));
        subject_open(&s, &tree.robot, 2 << t % 2);
        bodies += tree.robot.nbody;
        groups += s.tree.ngroup;
        for (int n = 0; n < STATES; n++) {
            random_state_make(&seed, &tree.robot, &x);
            compare(&s, &x);
        }
        subject_close(&s);
    }
    assert_true(groups < 2 * bodies / 3);
}

/* Solves A x = b in place for a symmetric positive A by Gauss elimination. */
static void solve(size_t n, double A[VELOCITIES][VELOCITIES], double b[VELOCITIES])
{
    for (size_t k = 0; k < n; k++) {
        for (size_t i = k + 1; i < n; i++) {
            double factor = A[i][k] / A[k][k];

            for (size_t j = k; j < n; j++) {
                A[i][j] -= factor * A[k][j];
            }
            b[i] -= factor * b[k];
        }
    }
    for (size_t k = n; k-- > 0;) {
        for (size_t j = k + 1; j < n; j++) {
            b[k] -= A[k][j] * b[j];
        }
        b[k] /= A[k][k];
    }
}

/* Adds Jb^T A Jb of a body's 21 numbers to the mass matrix. */
static void add_body_inertia(const struct dynamics *g, const double *q, size_t body,
                             const double *added, double mass[VELOCITIES][VELOCITIES])
{
    size_t n = g->robot->nv;
    double J[VELOCITIES][6], A[6][6];

    for (size_t i = 0; i < n; i++) {
        double v[VELOCITIES] = {0};

        v[i] = 1.0;

        /* Velocity of a body in its own frame, linear first, for the generalized velocity v */
        struct body_motion motion[BODIES];

        g->ops->kinematics(g, q, v, motion);
        mat3_apply_transposed(motion[body].R, motion[body].v, J[i]);
        mat3_apply_transposed(motion[body].R, motion[body].w, J[i] + 3);
    }
    for (int row = 0; row < 6; row++) {
        for (int column = row; column < 6; column++) {
            A[row][column] = A[column][row] = *added++;
        }
    }
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            for (int row = 0; row < 6; row++) {
                for (int column = 0; column < 6; column++) {
                    mass[i][j] += J[i][row] * A[row][column] * J[j][column];
                }
            }
        }
    }
}

/* vdot of (Mass + E + sum J^T A J) vdot = tau - bias + sum J^T f with dense matrices. */
static void dense_implicit(const struct dynamics *g, const struct random_state *x,
                           const double *extra, const double *added, double *vdot)
{
    const struct robot *robot = g->robot;
    size_t n = robot->nv, first = robot->nv - robot->njoint;
    double mass[VELOCITIES][VELOCITIES], none[VELOCITIES] = {0}, bias[VELOCITIES];

    g->ops->inverse(g, x->q, x->v, none, x->ext, bias);
    for (size_t i = 0; i < n; i++) {
        double unit[VELOCITIES] = {0}, column[VELOCITIES];

        unit[i] = 1.0;
        g->ops->inverse(g, x->q, x->v, unit, x->ext, column);
        for (size_t j = 0; j < n; j++) {
            mass[j][i] = column[j] - bias[j];
        }
        vdot[i] = (i >= first ? x->tau[i - first] : 0.0) - bias[i];
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        mass[first + j][first + j] += extra[j];
    }
    for (size_t b = 0; b < robot->nbody; b++) {
        if (robot->body[b].observed) {
            add_body_inertia(g, x->q, b, added, mass);
            added += 21;
        }
    }
    solve(n, mass, vdot);
}

/* B B^T of a random 6x6 matrix, the upper triangle by rows. */
static void random_matrix(uint64_t *seed, double size, double *upper)
{
    double B[6][6];

    for (int i = 0; i < 36; i++) {
        B[i / 6][i % 6] = random_in(seed, -size, size);
    }
    for (int i = 0; i < 6; i++) {
        for (int j = i; j < 6; j++) {
            *upper = 0.0;
            for (int k = 0; k < 6; k++) {
                *upper += B[i][k] * B[j][k];
            }
            upper++;
        }
    }
}

TEST_WITH(added_inertias_act_on_the_rates_of_the_velocities, open_arena, close_arena)
{
    static double extra[RANDOM_JOINTS], added[21 * BODIES];
    double expected[VELOCITIES], found[VELOCITIES];
    struct random_tree tree;
    struct random_state x;
    struct error error;
    uint64_t seed = 20140003;

    for (int t = 0; t < TREES; t++) {
        struct subject s;

        assert_ok(t % 2 ? limbed_tree_make(&seed, &tree, &error)
                        : random_tree_make(&seed, &tree, &error));
        subject_open(&s, &tree.robot, 1 << t % 3);
        random_state_make(&seed, &tree.robot, &x);
        for (int j = 0; j < RANDOM_JOINTS; j++) {
            extra[j] = random_in(&seed, 0.0, 0.5);
        }
        for (int b = 0; b < BODIES; b++) {
            random_matrix(&seed, 1.0, added + 21 * b);
        }
        dense_implicit(&s.generic, &x, extra, added, expected);
        run(&s, DERIVE_IMPLICIT, &x, NULL, extra, added, found);
        assert_close(found, expected, tree.robot.nv, 1e-10, "implicit");
        subject_close(&s);
    }
}

/* ---- the text ---- */

static char *text_of(const struct robot *robot, int lanes, size_t *size,
                     struct symbolic_report *report)
{
    const struct symbolic_options options = {.lanes = lanes};
    struct error error;
    char *text = NULL;
    FILE *file = open_memstream(&text, size);

    assert_non_null(file);
    assert_no_error(symbolic_generate(robot, &options, file, report, &error), error.text);
    fclose(file);
    return text;
}

TEST_WITH(the_same_robot_gives_the_same_bytes, open_arena, close_arena)
{
    const struct robot *robot;
    struct error error;
    size_t first_size, second_size;

    assert_ok(robot_load(COMAN, NULL, &arena, &robot, &error));
    char *first = text_of(robot, 4, &first_size, NULL);
    char *second = text_of(robot, 4, &second_size, NULL);
    assert_int_equal(first_size, second_size);
    assert_memory_equal(first, second, first_size);
    free(first);
    free(second);
}

TEST_WITH(coman_stays_within_its_budget_of_operations, open_arena, close_arena)
{
    const struct robot *robot;
    struct symbolic_report report;
    struct error error;
    size_t size;

    assert_ok(robot_load(COMAN, NULL, &arena, &robot, &error));
    for (int lanes = 1; lanes <= 4; lanes *= 2) {
        free(text_of(robot, lanes, &size, &report));
        for (int f = 0; f < SYMBOLIC_FUNCTIONS; f++) {
            const struct symbolic_count *count = &report.count[f];

            print_message("# lanes %d %s: %zu operations, %zu angles, %zu statements\n", lanes,
                          count->function, count->operations, count->sincos, count->statements);
        }
        assert_true(report.count[DERIVE_FORWARD].operations <= 6000);
        assert_true((double)report.count[DERIVE_IMPLICIT].operations <=
                    1.35 * (double)report.count[DERIVE_FORWARD].operations);
    }
    /* Legs and arms side by side */
    assert_int_equal(report.groups, 10);
}

enum { LONGEST = 120 };

/* Forward dynamics of a robot of any length at one random state. */
static void compare_forward(uint64_t *seed, const struct robot *robot)
{
    static double q[LONGEST + 7], v[LONGEST + 6], tau[LONGEST], expected[LONGEST + 6];
    static double found[LONGEST + 6];
    const double *const argument[DERIVE_ARRAYS] = {
        [DERIVE_Q] = q, [DERIVE_V] = v, [DERIVE_TAU] = tau};
    struct subject s;

    for (size_t i = 0; i < robot->nq; i++) {
        q[i] = random_in(seed, -1.0, 1.0);
    }
    for (size_t i = 0; i < robot->nv; i++) {
        v[i] = random_in(seed, -1.0, 1.0);
    }
    for (size_t i = 0; i < robot->njoint; i++) {
        tau[i] = random_in(seed, -1.0, 1.0);
    }
    subject_open(&s, robot, 4);
    s.generic.ops->forward(&s.generic, q, v, tau, NULL, expected);
    assert_true(
        evaluate(&s.graph[DERIVE_FORWARD], &s.derivation[DERIVE_FORWARD], argument, NULL, found));
    assert_close(found, expected, robot->nv, 1e-11, "forward");
    subject_close(&s);
}

TEST_WITH(operations_grow_linearly_with_the_chain, open_arena, close_arena)
{
    static struct robot_body body[LONGEST + 1];
    static struct robot_joint joint[LONGEST];
    size_t operations[3];
    uint64_t seed = 7;

    for (int n = 0; n < 3; n++) {
        struct robot robot = {.name = "chain",
                              .floating = true,
                              .gravity = {0.0, 0.0, -9.81},
                              .imu_frame = -1,
                              .body = body,
                              .joint = joint};
        struct symbolic_report report;
        size_t size;

        /* A chain of turning joints, axes in turn, hanging from a floating base */
        const size_t length = (size_t)LONGEST / 4 << n;
        struct error error;

        robot.njoint = length;
        robot.nbody = length + 1;
        for (size_t b = 0; b < robot.nbody; b++) {
            robot.body[b] = (struct robot_body){.name = "body", .parent = (int)b - 1};
            random_inertia(&seed, &robot.body[b].inertia);
            if (b > 0) {
                robot.joint[b - 1] = (struct robot_joint){.name = "joint",
                                                          .lower = -9.0,
                                                          .upper = 9.0,
                                                          .origin = {0.0, 0.0, -0.2},
                                                          .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
                robot.joint[b - 1].axis[b * 2 % 3] = 1.0;
            }
        }
        assert_no_error(robot_finish(&robot, &error), error.text);
        free(text_of(&robot, 4, &size, &report));
        operations[n] = report.count[DERIVE_FORWARD].operations;
        print_message("# chain of %zu joints: %zu operations\n", robot.njoint, operations[n]);
        compare_forward(&seed, &robot);
    }
    assert_int_equal(operations[2] - operations[1], 2 * (operations[1] - operations[0]));
}
