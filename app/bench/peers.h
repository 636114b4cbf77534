/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Other simulators, for benchmarks and for tests of accuracy. They are in a separate module,
 * libhil-peers.so, which is built if their libraries are installed. The program loads the module at
 * run time if it exists. All numbers have the units and orders of model/robot.h and
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

/* Number of states that an engine stores. */
enum { PEER_SLOTS = 64 };

/* An engine that computes the accelerations of a tree of bodies. */
struct peer_dynamics {
    const char *name, *version;
    /* Creates an engine for the robot. Returns NULL with a sentence in message if the engine does
     * not support the robot. */
    void *(*create)(const struct robot *robot, char *message, size_t size);
    /* Creates an engine that steps the robot with its joint couplings. contact: NULL for a robot
     * without contact. Otherwise the robot stands on the ground, and its joints have their passive
     * springs. Each contact pair must then consist of a surface and a half-space; a mesh is
     * replaced by its bounding box. body: index of the robot's body for each body of the contact
     * model. create_moving is NULL if the engine cannot step. */
    void *(*create_moving)(const struct robot *robot, const struct contact_config *contact,
                           const int *body, char *message, size_t size);
    void (*destroy)(void *engine);
    /* Stores a state in slot (less than PEER_SLOTS), in the engine's own coordinates. */
    void (*put)(void *engine, size_t slot, const double *q, const double *v, const double *tau);
    /* Computes the accelerations of a stored state. Benchmarks measure this function. */
    void (*run)(void *engine, size_t slot);
    /* Copies vdot (nv values) of the last run. */
    void (*get)(void *engine, double *vdot);
    /* Simulates `steps` steps of dt from a stored state; each call starts from that state.
     * implicit: use the method that is implicit in the velocities, else the engine's default.
     * Returns false if the state does not stay finite, or a standing robot has left its place. NULL
     * if the engine cannot step. */
    bool (*step)(void *engine, size_t slot, bool implicit, double dt, size_t steps);
};

/* A planar chain of one or two bodies that turn about parallel horizontal axes. Quantities are
 * dimensionless or SI. */
struct peer_chain {
    size_t count; /* 1 or 2 */
    double gravity;
    double mass[2], inertia[2]; /* inertia about the center of mass, equal about all axes */
    double com[2];              /* distance from the body's axis down to its center of mass */
    double reach;               /* distance from the first axis down to the second */
    double speed;               /* initial rate of both bodies, which hang straight down */
};

/* Motion of a body of the chain. The angle is 0 when the body hangs, and increases with rotation
 * about y. It may differ by whole turns. */
struct peer_chain_body {
    double x, z, vx, vz; /* position and velocity of the center of mass, from the first axis */
    double angle, rate;
};

/* An engine for planar chains. */
struct peer_pendulum {
    const char *name, *version;
    size_t coordinates, constraints; /* number per body */
    void *(*create)(const struct peer_chain *chain, double dt, char *message, size_t size);
    void (*destroy)(void *engine);
    void (*step)(void *engine, size_t steps);
    void (*get)(void *engine, struct peer_chain_body body[2]);
};

/* The contents of a module. */
struct peers {
    uint32_t abi; /* must be PEERS_ABI */
    /* Size of struct robot; a different size means that the module was built from other headers. */
    uint32_t robot_size;
    size_t ndynamics, npendulum;
    const struct peer_dynamics *dynamics;
    const struct peer_pendulum *pendulum;
};

/* Returns the contents of the module. The module exports this symbol. */
const struct peers *hil_peers(void);

/* A loaded module. */
struct peers_library {
    void *handle;
    const struct peers *peers;
};

/* Loads the module at path. Without path, looks beside the program and in its folder tests, where
 * the build puts it. Returns ERROR_UNSUPPORTED if there is no module. */
enum error_code peers_open(const char *path, struct peers_library *library, struct error *error);

/* Unloads the module. Destroy all its engines first. Safe on a zeroed library. */
void peers_close(struct peers_library *library);

#endif
