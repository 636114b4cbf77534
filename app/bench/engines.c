/* SPDX-License-Identifier: Apache-2.0 */
/* Wraps our implementations of the dynamics in the interface for other simulators. */
#include "app/bench/bench.h"

#include "base/random.h"
#include "model/dynamics.h"
#include "model/symbolic/symbolic.h"

#include <dirent.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define ARENA_BYTES ((size_t)16 << 20)

/* A state, and joint torques. */
struct state {
    double *q, *v, *tau;
};

/* One of our implementations, and the states in which it is measured. */
struct engine {
    struct arena arena;
    struct dynamics dynamics;
    struct symbolic_library library;
    struct state kept[PEER_SLOTS];
    double *vdot;
};

static void bench_engine_destroy(void *memory)
{
    struct engine *engine = memory;

    symbolic_close(&engine->library);
    arena_fini(&engine->arena);
    free(engine);
}

/* Allocates the states of an engine. */
static enum error_code bench_engine_begin(struct engine *engine, const struct robot *robot,
                                          struct error *error)
{
    if (arena_init(&engine->arena, ARENA_BYTES, error)) {
        return error->code;
    }
    engine->vdot = arena_alloc(&engine->arena, robot->nv, sizeof(double));
    for (size_t i = 0; i < PEER_SLOTS; i++) {
        struct state *state = &engine->kept[i];

        state->q = arena_alloc(&engine->arena, robot->nq, sizeof(double));
        state->v = arena_alloc(&engine->arena, robot->nv, sizeof(double));
        state->tau = arena_alloc(&engine->arena, robot->njoint + 1, sizeof(double));
        if (!engine->vdot || !state->q || !state->v || !state->tau) {
            return error_set(error, ERROR_MEMORY, "no memory for the states");
        }
    }
    return ERROR_NONE;
}

/* Creates an engine with the numeric implementation, or with the generated code: the built-in code,
 * or else code compiled now. After an error, sets the message and returns NULL. */
static void *bench_engine_create(const struct robot *robot, bool generated, char *message,
                                 size_t size)
{
    static const struct symbolic_options options = {.lanes = 4};
    const struct dynamics_module *module = symbolic_builtin(robot);
    struct error error = {.text = "no memory"};
    struct engine *engine = calloc(1, sizeof *engine);
    enum error_code code = engine ? bench_engine_begin(engine, robot, &error) : ERROR_MEMORY;

    if (!code && !generated) {
        code = dynamics_generic(robot, &engine->arena, &engine->dynamics, &error);
    } else if (!code && (module || !(code = symbolic_compile(robot, &options, "-O2",
                                                             &engine->library, &error)))) {
        module = module ? module : engine->library.module;
        code = dynamics_generated(robot, module, &engine->arena, &engine->dynamics, &error);
    }
    if (code) {
        snprintf(message, size, "%s", error.text);
        if (engine) {
            bench_engine_destroy(engine);
        }
        return NULL;
    }
    return engine;
}

static void *bench_engine_create_generic(const struct robot *robot, char *message, size_t size)
{
    return bench_engine_create(robot, false, message, size);
}

static void *bench_engine_create_generated(const struct robot *robot, char *message, size_t size)
{
    return bench_engine_create(robot, true, message, size);
}

/* Stores a state in a slot. */
static void bench_engine_put_state(void *memory, size_t slot, const double *q, const double *v,
                                   const double *tau)
{
    struct engine *engine = memory;
    const struct robot *robot = engine->dynamics.robot;

    memcpy(engine->kept[slot].q, q, robot->nq * sizeof *q);
    memcpy(engine->kept[slot].v, v, robot->nv * sizeof *v);
    memcpy(engine->kept[slot].tau, tau, robot->njoint * sizeof *tau);
}

/* Computes the accelerations of the state in a slot. */
static void bench_engine_run_state(void *memory, size_t slot)
{
    struct engine *engine = memory;
    const struct state *state = &engine->kept[slot];

    engine->dynamics.ops->forward(&engine->dynamics, state->q, state->v, state->tau, NULL,
                                  engine->vdot);
}

/* Copies the accelerations of the last evaluation. */
static void bench_engine_get_accelerations(void *memory, double *vdot)
{
    const struct engine *engine = memory;

    memcpy(vdot, engine->vdot, engine->dynamics.robot->nv * sizeof *vdot);
}

const struct peer_dynamics bench_ours[BENCH_OURS] = {
    {"generic", HIL_VERSION, bench_engine_create_generic, NULL, bench_engine_destroy,
     bench_engine_put_state, bench_engine_run_state, bench_engine_get_accelerations, NULL},
    {"generated", HIL_VERSION, bench_engine_create_generated, NULL, bench_engine_destroy,
     bench_engine_put_state, bench_engine_run_state, bench_engine_get_accelerations, NULL},
};

enum error_code bench_part(const struct robot *whole, size_t njoint, struct arena *arena,
                           const struct robot **part, struct error *error)
{
    struct robot *robot = arena_alloc(arena, 1, sizeof *robot);
    struct robot_body *body = arena_alloc(arena, njoint + 1, sizeof *body);

    if (!robot || !body) {
        return error_set(error, ERROR_MEMORY, "no memory for a part of %s", whole->name);
    }
    *robot = *whole;
    memcpy(body, whole->body, (njoint + 1) * sizeof *body);
    robot->body = body;
    robot->nbody = njoint + 1;
    robot->njoint = njoint;

    /* Omit frames, sensors and poses, because they may refer to bodies that the part does not
     * have */
    robot->nframe = robot->ncapsule = robot->nft = robot->npose = 0;
    robot->imu_frame = -1;
    for (size_t b = 0; b < robot->nbody; b++) {
        body[b].observed = false;
    }
    *part = robot;
    return robot_finish(robot, error);
}

/* Returns a random number between two bounds. */
static double random_in(struct random_stream *stream, double lower, double upper)
{
    return lower + (upper - lower) * random_uniform(stream);
}

void bench_put_states(const struct peer_dynamics *peer, void *engine, const struct robot *robot)
{
    double q[BENCH_NUMBERS], v[BENCH_NUMBERS], tau[BENCH_NUMBERS];
    size_t base = robot->nq - robot->njoint;
    struct random_stream stream = {2014};

    for (size_t slot = 0; slot < PEER_SLOTS; slot++) {
        double square = 0.0;

        /* The base: a position, and a quaternion that is normalized below */
        for (size_t i = 0; i < base; i++) {
            q[i] = random_in(&stream, -1.0, 1.0);
            square += i >= 3 ? q[i] * q[i] : 0.0;
        }
        for (size_t i = 3; i < base; i++) {
            q[i] /= sqrt(square);
        }
        for (size_t i = 0; i < robot->nv; i++) {
            v[i] = random_in(&stream, -2.0, 2.0);
        }
        for (size_t j = 0; j < robot->njoint; j++) {
            const struct robot_joint *joint = &robot->joint[j];

            q[base + j] = random_in(&stream, joint->lower, joint->upper);
            tau[j] = random_in(&stream, -joint->torque_limit, joint->torque_limit);
        }
        peer->put(engine, slot, q, v, tau);
    }
}

double bench_difference(const struct peer_dynamics *a, void *engine_a,
                        const struct peer_dynamics *b, void *engine_b, size_t nv, double *worst)
{
    double x[BENCH_NUMBERS], y[BENCH_NUMBERS], sum = 0.0, largest = 0.0;

    for (size_t slot = 0; slot < PEER_SLOTS; slot++) {
        double difference = 0.0, size = 0.0, relative;

        a->run(engine_a, slot);
        b->run(engine_b, slot);
        a->get(engine_a, x);
        b->get(engine_b, y);
        for (size_t i = 0; i < nv; i++) {
            difference += (x[i] - y[i]) * (x[i] - y[i]);
            size += y[i] * y[i];
        }
        relative = sqrt(difference / size);
        sum += relative;
        /* A comparison instead of fmax, because fmax would ignore a NAN */
        largest = relative <= largest ? largest : relative;
    }
    if (worst) {
        *worst = largest;
    }
    return sum / PEER_SLOTS;
}
