/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The Open Dynamics Engine as a peer: a chain of bodies in absolute coordinates, each held by a
 * hinge (five constraints; its quaternion's length is the sixth). Settings of the paper's section
 * 3.1: dWorldStep with constraint force mixing 1e-10 and error reduction 0.2.
 */
#include "tests/bench/peers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <ode/ode.h>

#ifndef dDOUBLE
#error "ODE of single precision"
#endif

struct engine {
    dWorldID world;
    dJointGroupID joints;
    dBodyID body[2];
    size_t count;
    double dt;
};

static void add_body(struct engine *engine, const struct peer_chain *chain, size_t b)
{
    double axis = b ? -chain->reach : 0.0; /* its height at the start */
    dBodyID body = dBodyCreate(engine->world);
    dJointID hinge = dJointCreateHinge(engine->world, engine->joints);
    dMass mass;

    dMassSetParameters(&mass, chain->mass[b], 0.0, 0.0, 0.0, chain->inertia[b], chain->inertia[b],
                       chain->inertia[b], 0.0, 0.0, 0.0);
    dBodySetMass(body, &mass);
    dBodySetPosition(body, 0.0, 0.0, axis - chain->com[b]);
    dBodySetAngularVel(body, 0.0, chain->speed, 0.0);
    /* w x r about the first axis, which both turn about at the start */
    dBodySetLinearVel(body, chain->speed * (axis - chain->com[b]), 0.0, 0.0);
    dJointAttach(hinge, body, b ? engine->body[b - 1] : 0);
    dJointSetHingeAnchor(hinge, 0.0, 0.0, axis);
    dJointSetHingeAxis(hinge, 0.0, 1.0, 0.0);
    engine->body[b] = body;
}

static void *create(const struct peer_chain *chain, double dt, char *message, size_t size)
{
    struct engine *engine = calloc(1, sizeof *engine);

    if (!engine || !dInitODE2(0)) {
        snprintf(message, size, "no memory");
        free(engine);
        return NULL;
    }
    engine->world = dWorldCreate();
    engine->joints = dJointGroupCreate(0);
    engine->dt = dt;
    engine->count = chain->count;
    dWorldSetGravity(engine->world, 0.0, 0.0, -chain->gravity);
    dWorldSetCFM(engine->world, 1e-10);
    dWorldSetERP(engine->world, 0.2);
    for (size_t b = 0; b < chain->count; b++) {
        add_body(engine, chain, b);
    }
    return engine;
}

static void destroy(void *memory)
{
    struct engine *engine = memory;

    dJointGroupDestroy(engine->joints);
    dWorldDestroy(engine->world);
    dCloseODE();
    free(engine);
}

static void step(void *memory, size_t steps)
{
    struct engine *engine = memory;

    for (size_t i = 0; i < steps; i++) {
        dWorldStep(engine->world, engine->dt);
    }
}

static void get(void *memory, struct peer_chain_body *out)
{
    const struct engine *engine = memory;

    for (size_t b = 0; b < engine->count; b++) {
        const dReal *p = dBodyGetPosition(engine->body[b]);
        const dReal *v = dBodyGetLinearVel(engine->body[b]);
        const dReal *R = dBodyGetRotation(engine->body[b]); /* rows of four */

        out[b] = (struct peer_chain_body){.x = p[0],
                                          .z = p[2],
                                          .vx = v[0],
                                          .vz = v[2],
                                          .angle = atan2(R[2], R[0]),
                                          .rate = dBodyGetAngularVel(engine->body[b])[1]};
    }
}

const struct peer_pendulum peer_ode = {"ODE", PEERS_ODE_VERSION, 7, 6, create, destroy, step, get};
