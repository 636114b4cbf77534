/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Ours against Simbody and MuJoCo, two independent programs: the same accelerations of the same
 * random states, on the robots of config/ and on their parts, as the benchmark computes them. The
 * paper found an average relative difference of 1.9e-13.
 */
#include "app/bench/bench.h"
#include "tests/unit/model/random_robot.h"
#include "tests/test.h"

static struct error error;

#define MODULE HIL_BINARY_DIR "/tests/" PEERS_FILE

static const double tolerance = 1e-10;

/* Loads the module, or skips. */
static const struct peers *open_peers(struct peers_library *library)
{
    assert_no_error(peers_open(MODULE, library, &error), error.text);
    if (library->peers->ndynamics == 0) {
        print_message("SKIP: neither Simbody nor MuJoCo was found when this was built\n");
        skip();
    }
    return library->peers;
}

static void *open_engine(const struct peer_dynamics *peer, const struct robot *robot)
{
    char message[512];
    void *engine = peer->create(robot, message, sizeof message);

    if (!engine) {
        fail_msg("%s: %s", peer->name, message);
    }
    bench_put_states(peer, engine, robot);
    return engine;
}

static void compare(const struct peer_dynamics *ours, const struct peer_dynamics *theirs,
                    const struct robot *robot)
{
    void *engine = open_engine(ours, robot), *peer = open_engine(theirs, robot);
    double worst;
    double average = bench_difference(ours, engine, theirs, peer, robot->nv, &worst);

    print_message("# %s, %zu degrees of freedom, %s and %s %s: average %.1e, largest %.1e\n",
                  robot->name, robot->nv, ours->name, theirs->name, theirs->version, average,
                  worst);
    assert_true(average <= tolerance);
    assert_true(worst <= 10.0 * tolerance);
    ours->destroy(engine);
    theirs->destroy(peer);
}

static void compare_all(const char *path, size_t njoint)
{
    struct peers_library library;
    const struct peers *peers = open_peers(&library);
    const struct robot *robot;
    struct arena arena;

    assert_ok(arena_init(&arena, 1 << 24, &error));
    if (robot_load(path, NULL, &arena, &robot, &error) ||
        (njoint && bench_part(robot, njoint, &arena, &robot, &error))) {
        fail_msg("%s", error.text);
    }
    for (size_t i = 0; i < BENCH_OURS; i++) {
        for (size_t k = 0; k < peers->ndynamics; k++) {
            compare(&bench_ours[i], &peers->dynamics[k], robot);
        }
    }
    arena_fini(&arena);
    peers_close(&library);
}

TEST(coman_moves_as_in_every_peer)
{
    compare_all(HIL_SOURCE_DIR "/config/robots/coman.yaml", 0);
}

TEST(a_leg_of_coman_moves_as_in_every_peer)
{
    compare_all(HIL_SOURCE_DIR "/config/robots/coman.yaml", 6);
}

TEST(walkman_moves_as_in_every_peer)
{
    compare_all(HIL_SOURCE_DIR "/config/robots/walkman.yaml", 0);
}

CLOSED_BENCH(peers_library, struct peers_library, peers_close)

/* Any tree: fixed and floating bases, sliding joints, branches. The numeric implementation only:
 * the generator's code is compared with it elsewhere, and each tree would have to be compiled. */
TEST_ON(random_trees_move_as_in_every_peer, peers_library, library)
{
    enum { TREES = 60 };
    const struct peers *peers = open_peers(library);
    static struct random_tree tree;
    const struct peer_dynamics *numeric = &bench_ours[0];
    double worst[8] = {0.0};
    uint64_t seed = 1961;
    void *engine;

    for (int n = 0; n < TREES; n++) {
        assert_ok(random_tree_make(&seed, &tree, &error));
        for (size_t j = 0; j < tree.robot.njoint; j++) {
            tree.joint[j].lower = -3.0;
            tree.joint[j].upper = 3.0;
            tree.joint[j].torque_limit = 50.0;
        }
        engine = open_engine(numeric, &tree.robot);
        for (size_t k = 0; k < peers->ndynamics; k++) {
            void *peer = open_engine(&peers->dynamics[k], &tree.robot);
            double average =
                bench_difference(numeric, engine, &peers->dynamics[k], peer, tree.robot.nv, NULL);

            assert_true(average <= tolerance);
            worst[k] = fmax(worst[k], average);
            peers->dynamics[k].destroy(peer);
        }
        numeric->destroy(engine);
    }
    for (size_t k = 0; k < peers->ndynamics; k++) {
        print_message("# %d random trees and %s: largest average %.1e\n", TREES,
                      peers->dynamics[k].name, worst[k]);
    }
}

TEST_ON(a_wrong_robot_is_noticed, peers_library, library)
{
    const struct peers *peers = open_peers(library);
    const struct robot *robot, *other;
    struct robot_body *body;
    struct arena arena CLOSED_BY(arena_fini);

    assert_ok(arena_init(&arena, 1 << 24, &error));
    if (robot_load(HIL_SOURCE_DIR "/config/robots/coman.yaml", NULL, &arena, &robot, &error) ||
        bench_part(robot, robot->njoint, &arena, &other, &error)) {
        fail_msg("%s", error.text);
    }
    body = other->body;
    body[3].inertia.com[0] += 1e-6;
    for (size_t k = 0; k < peers->ndynamics; k++) {
        void *engine = open_engine(&bench_ours[0], robot);
        void *peer = open_engine(&peers->dynamics[k], other);

        assert_true(bench_difference(&bench_ours[0], engine, &peers->dynamics[k], peer, robot->nv,
                                     NULL) > 1e3 * tolerance);
        bench_ours[0].destroy(engine);
        peers->dynamics[k].destroy(peer);
    }
}

/* ODE's pendulum starts where ours does and falls as gravity has it. */
TEST_ON(the_chain_of_bodies_starts_in_line, peers_library, library)
{
    static const struct peer_chain chain = {.count = 2,
                                            .gravity = 1.0,
                                            .mass = {1.0, 2.0},
                                            .inertia = {5.5, 2.0},
                                            .com = {1.0, 2.5},
                                            .reach = 2.0,
                                            .speed = 0.5};
    struct peer_chain_body body[2];
    char message[512];

    assert_no_error(peers_open(MODULE, library, &error), error.text);
    if (library->peers->npendulum == 0) {
        print_message("SKIP: ODE was not found when this was built\n");
        skip();
    }
    for (size_t k = 0; k < library->peers->npendulum; k++) {
        const struct peer_pendulum *peer = &library->peers->pendulum[k];
        void *engine = peer->create(&chain, 1e-4, message, sizeof message);

        assert_non_null(engine);
        peer->get(engine, body);
        assert_true(fabs(body[0].z + 1.0) < 1e-15 && fabs(body[1].z + 4.5) < 1e-15);
        assert_true(fabs(body[0].vx + 0.5) < 1e-15 && fabs(body[1].vx + 2.25) < 1e-15);
        peer->step(engine, 1000);
        peer->get(engine, body);
        /* in line, a'' = -(5/24.5) sin a: over 0.1 the angle is 0.5 t - (5/24.5) 0.5 t^3/6 */
        for (int b = 0; b < 2; b++) {
            assert_true(fabs(body[b].angle - (0.05 - 5.0 / 24.5 * 0.5 * 1e-3 / 6.0)) < 2e-6);
        }
        peer->destroy(engine);
    }
}

TEST_ON(a_missing_module_is_reported, peers_library, library)
{
    assert_int_equal(peers_open("/nonexistent/libhil-peers.so", library, &error),
                     ERROR_UNSUPPORTED);
    assert_null(library->peers);
    /* a library, but not this one */
    assert_int_equal(peers_open("libm.so.6", library, &error), ERROR_UNSUPPORTED);
    assert_null(library->handle);
}
