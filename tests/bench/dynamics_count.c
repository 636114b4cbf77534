/* SPDX-License-Identifier: Apache-2.0 */
/* dynamics-count ROBOT ENGINE N [MODULE]: N evaluations of the robot's accelerations by one
 * engine, for an instruction counter. The engines are ours, and those of the module with other
 * simulators. */
#include "app/bench/bench.h"

#include "base/text.h"

#include <stdio.h>
#include <string.h>

static int fail(const char *text)
{
    fprintf(stderr, "dynamics-count: %s\n", text);
    return 1;
}

static const struct peer_dynamics *find(const char *name, const struct peers *peers)
{
    for (size_t i = 0; i < BENCH_OURS; i++) {
        if (!strcmp(bench_ours[i].name, name)) {
            return &bench_ours[i];
        }
    }
    for (size_t i = 0; peers && i < peers->ndynamics; i++) {
        if (!strcmp(peers->dynamics[i].name, name)) {
            return &peers->dynamics[i];
        }
    }
    return NULL;
}

int main(int argc, char **argv)
{
    struct peers_library library = {0};
    const struct peer_dynamics *peer;
    const struct robot *robot;
    struct arena arena;
    struct error error;
    char message[512];
    int64_t count;
    void *engine;

    if (argc < 4 || argc > 5 || !text_to_int(argv[3], 0, 1000000, &count)) {
        return fail("usage: dynamics-count ROBOT ENGINE N [MODULE]");
    }
    if (arena_init(&arena, (size_t)1 << 24, &error) ||
        robot_load(argv[1], NULL, &arena, &robot, &error) ||
        (argc == 5 && peers_open(argv[4], &library, &error))) {
        return fail(error.text);
    }
    peer = find(argv[2], library.peers);
    if (!peer) {
        return fail("no such engine");
    }
    engine = peer->create(robot, message, sizeof message);
    if (!engine) {
        return fail(message);
    }
    bench_put_states(peer, engine, robot);
    for (int64_t n = 0; n < count; n++) {
        peer->run(engine, (size_t)n % PEER_SLOTS);
    }
    peer->destroy(engine);
    peers_close(&library);
    arena_fini(&arena);
    return 0;
}
