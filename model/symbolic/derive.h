/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Derives the equations of a tree as expressions. Each function of the generated module becomes a
 * list of outputs that depend on its arguments. Not RT-safe.
 */
#ifndef MODEL_SYMBOLIC_DERIVE_H
#define MODEL_SYMBOLIC_DERIVE_H

#include "model/symbolic/graph.h"
#include "model/symbolic/tree.h"

/* The derived functions. */
enum derive_function {
    DERIVE_FORWARD,      /* vdot from q, v, tau */
    DERIVE_FORWARD_EXT,  /* vdot with external wrenches */
    DERIVE_IMPLICIT,     /* vdot with external wrenches and added joint and body inertias */
    DERIVE_INVERSE,      /* generalized forces from q, v, vdot with external wrenches */
    DERIVE_KINEMATICS,   /* struct body_motion of the observed bodies */
    DERIVE_VELOCITIES,   /* w and v of struct body_motion, in the pose stored by kinematics */
    DERIVE_ACCELERATION, /* struct body_acceleration of the observed bodies, in the stored pose */
    DERIVE_ENERGY,       /* kinetic and potential energy */
    DERIVE_COUNT
};

/* Argument arrays: the array numbers of GRAPH_INPUT. */
enum derive_array {
    DERIVE_INERTIA, /* mass properties, at the places given by struct tree_group */
    DERIVE_Q,
    DERIVE_V,
    DERIVE_TAU,
    DERIVE_VDOT,
    DERIVE_EXT,   /* struct wrench of each body */
    DERIVE_EXTRA, /* added inertia of each joint */
    DERIVE_ADDED, /* 21 numbers for each observed body, see model/symbolic/module.h */
    DERIVE_POSE,  /* data of a pose, stored by kinematics */
    DERIVE_ARRAYS
};

/* An output: out[index] = value, a one-lane expression. Or the lanes of value are stored in
 * pose[index] and the following numbers. */
struct derive_output {
    int index;
    expr value;
    bool pose;
};

struct derivation {
    size_t count;
    struct derive_output *output;
    int npose; /* size of pose */
};

/* Derives one function and adds its expressions to graph. inertia_inputs: mass properties are
 * inputs; otherwise they are constants from the tree. Not RT-safe. */
enum error_code derive(enum derive_function function, const struct tree *tree, bool inertia_inputs,
                       struct graph *graph, struct derivation *out, struct error *error);
void derivation_fini(struct derivation *derivation);

#endif
