/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Other simulators beside ours, for benchmarks and for tests of exactness. They are no part of this
 * program: a module of their own, libhil-peers.so, is built where their libraries are installed
 * and loaded when it is there. Every number is in the units and orders of model/robot.h and
 * model/dynamics.h. Not RT-safe.
 */
#ifndef APP_BENCH_PEERS_H
#define APP_BENCH_PEERS_H

#include "base/error.h"
#include "contact/contact.h"
#include "model/robot.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define PEERS_ABI 4
#define PEERS_FILE "libhil-peers.so"

/* States that an engine keeps at a time. */
enum { PEER_SLOTS = 64 };

/* An engine that computes accelerations of a tree of bodies. */
struct peer_dynamics {
    const char *name, *version;
    /* Creates an engine with the robot in it; NULL with a sentence in message when it cannot take
     * that robot. */
    void *(*create)(const struct robot *robot, char *message, size_t size);
    /* The same of a robot whose joints have their passive springs and that touches the ground: the
     * pairs of contact are of a surface with a half-space; a mesh counts as the box about it.
     * body: the robot's, of each motion that contact counts. NULL: the peer knows no contact. */
    void *(*create_standing)(const struct robot *robot, const struct contact_config *contact,
                             const int *body, char *message, size_t size);
    void (*destroy)(void *engine);
    /* Keeps a state in slot (below PEER_SLOTS), in the engine's own coordinates. */
    void (*put)(void *engine, size_t slot, const double *q, const double *v, const double *tau);
    /* Computes the accelerations of a kept state; this is what is timed. */
    void (*run)(void *engine, size_t slot);
    /* Copies vdot (nv) of the last run. */
    void (*get)(void *engine, double *vdot);
    /* Steps a kept state on, beginning there at each call, by the engine's default method or by
     * that which is implicit in the rates; false when it does not stay finite, or when a standing
     * robot is no longer near where it stood. NULL: the peer does not step. */
    bool (*step)(void *engine, size_t slot, bool implicit, double dt, size_t steps);
};

/* A chain of one or two bodies that turn about parallel horizontal axes, so that it moves in a
 * plane; dimensionless or SI. */
struct peer_chain {
    size_t count; /* 1 or 2 */
    double gravity;
    double mass[2], inertia[2]; /* about the center of mass, equal about all axes */
    double com[2];              /* distance of the center of mass below the body's axis */
    double reach;               /* distance of the second axis below the first */
    double speed;               /* rate of both bodies at the start, when they hang straight down */
};

/* Motion of a body of the chain. The angle is 0 when the body hangs and grows with rotation about
 * y; it may be off by whole turns. */
struct peer_chain_body {
    double x, z, vx, vz; /* of the center of mass; the first axis is at the origin */
    double angle, rate;
};

/* An engine that moves such a chain. */
struct peer_pendulum {
    const char *name, *version;
    size_t coordinates, constraints; /* for each body */
    void *(*create)(const struct peer_chain *chain, double dt, char *message, size_t size);
    void (*destroy)(void *engine);
    void (*step)(void *engine, size_t steps);
    void (*get)(void *engine, struct peer_chain_body body[2]);
};

/* What a module holds. */
struct peers {
    uint32_t abi; /* PEERS_ABI */
    /* Sizeof(struct robot): shows that both were built from the same headers. */
    uint32_t robot_size;
    size_t ndynamics, npendulum;
    const struct peer_dynamics *dynamics;
    const struct peer_pendulum *pendulum;
};

/* Returns what the module holds; the symbol that it exports. */
const struct peers *hil_peers(void);

/* A loaded module. */
struct peers_library {
    void *handle;
    const struct peers *peers;
};

/* Loads the module at path, or with path NULL the one beside the program or in its folder tests,
 * where the build puts it. ERROR_UNSUPPORTED without one. */
enum error_code peers_open(const char *path, struct peers_library *library, struct error *error);

/* Unloads the module, of which nothing may be in use. Safe on a zeroed library. */
void peers_close(struct peers_library *library);

#endif
