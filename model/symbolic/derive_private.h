/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Functions shared by the parts of the derivation: the state of a group of bodies, and arithmetic
 * on expressions. Index k is a joint's axis; i and j follow it in cyclic order. Not RT-safe.
 */
#ifndef MODEL_SYMBOLIC_DERIVE_PRIVATE_H
#define MODEL_SYMBOLIC_DERIVE_PRIVATE_H

#include "model/symbolic/derive.h"

/* State of a group of bodies; one expression holds all its lanes. */
struct state {
    expr c, s;    /* cosine and sine of a revolute joint's angle */
    expr d, rate; /* displacement of a prismatic joint; rate of either joint */
    /* Newton-Euler: angular velocity, angular acceleration, acceleration of the origin */
    expr w[3], alpha[3], a[3];
    expr G[3][3];                   /* [alpha] + [w][w] */
    expr n[3], f[3];                /* moment about the origin, force */
    expr J[3][3], H[3][3], M[3][3]; /* articulated inertia; J, M: upper triangle only */
    expr ratio[6];                  /* U / D, angular first */
    expr x;                         /* u / D */
    expr da[3], dl[3];        /* accelerations in addition to the Newton-Euler accelerations */
    expr R[3][3], p[3], v[3]; /* rotation to the world, origin, velocity of the origin */
};

struct derive {
    enum derive_function function;
    bool inertia_inputs;
    struct graph *g;
    const struct tree *tree;
    struct state *state;
    struct derivation *out;
    int *observed; /* by body: index among the observed bodies, or -1 */
};

/* Offsets of a body's constants and of a group's expressions. */
#define BODY(field) offsetof(struct tree_body, field)
#define STATE(field) offsetof(struct state, field)

/* Returns the expression at offset of a group's state. */
static inline expr *state_field(struct derive *d, size_t group, size_t offset)
{
    return (expr *)(void *)((char *)&d->state[group] + offset);
}

/* Returns element (i, j) of a symmetric matrix whose upper triangle is stored. */
static inline expr *upper(expr m[3][3], int i, int j)
{
    return i < j ? &m[i][j] : &m[j][i];
}

/* Arithmetic on expressions; the graph simplifies. */
static inline expr add(struct derive *d, expr a, expr b)
{
    return graph_add(d->g, a, b);
}

static inline expr sub(struct derive *d, expr a, expr b)
{
    return graph_add(d->g, a, expr_neg(b));
}

static inline expr mul(struct derive *d, expr a, expr b)
{
    return graph_mul(d->g, a, b);
}

static inline void add_to(struct derive *d, expr *sum, expr term)
{
    *sum = graph_add(d->g, *sum, term);
}

/* ---- derive_link.c: vectors between bodies, joints, inputs and outputs ---- */

/* Adds x cross z to y. */
void derive_add_cross(struct derive *d, expr y[3], const expr x[3], const expr z[3]);

/* Returns x . y. */
expr derive_dot(struct derive *d, const expr x[3], const expr y[3]);

/* Computes y = A^T x for a matrix A of numbers. */
void derive_apply_transposed(struct derive *d, const double A[9], const expr x[3], expr y[3]);

/* Computes y = A x for a matrix A of numbers. */
void derive_apply(struct derive *d, const double A[9], const expr x[3], expr y[3]);

/* Returns a mass property of each lane's body. property: number as in enum tree_inertia. */
expr derive_inertia(struct derive *d, size_t group, int property);

/* Returns the element of array for each lane's joint. */
expr derive_joint_input(struct derive *d, size_t group, enum derive_array array, int first);

/* Returns the element of array for each lane's joint, in the joint's working direction. */
expr derive_signed_input(struct derive *d, size_t group, enum derive_array array, int first);

/* Returns the body in lane 0. It has all data that the lanes share; only constants differ by
 * lane. */
const struct tree_body *derive_first_body(const struct derive *d, size_t group);

/* Returns a field of the parents. Each lane has the field of its own parent. */
expr derive_from_parent(struct derive *d, size_t group, size_t offset);

/* Adds value's lanes to the field of each lane's parent. */
void derive_to_parent(struct derive *d, size_t group, size_t offset, expr value);

/* Transforms x from the axes after a rotation by (c, s) about k to the axes before it. */
void derive_turn_up(struct derive *d, int k, expr c, expr s, expr x[3]);

/* Returns sine or cosine of the n-th fixed turn between parents and bodies. */
expr derive_turn_const(struct derive *d, size_t group, int n, bool sine);

/* Rotates x from the parent's axes to the body's axes. */
void derive_vector_down(struct derive *d, size_t group, expr x[3]);

/* Rotates x from the body's axes to the parent's axes. */
void derive_vector_up(struct derive *d, size_t group, expr x[3]);

/* Computes the origins in the parents' frames. */
void derive_origin(struct derive *d, size_t group, expr r[3]);

/* Computes the origin of the robot's body in the working frame. */
void derive_body_origin(struct derive *d, int body, expr at[3]);

/* Computes the rate of a group's joints, and their sine and cosine or their displacement. */
void derive_joint_state(struct derive *d, size_t group);

/* Computes the rotation from the base's working frame to the world. The base's quaternion, an
 * input, may have any length. */
void derive_base_rotation(struct derive *d, expr R[3][3]);

/* Reads three inputs, the first at index `first`, and rotates them into the base's working
 * frame. */
void derive_base_input(struct derive *d, enum derive_array array, int first, expr x[3]);

/* Copies column k of R to x. */
void derive_column_of(expr R[3][3], int k, expr x[3]);

/* Computes y = R x for a matrix R of expressions. */
void derive_rotate(struct derive *d, expr R[3][3], const expr x[3], expr y[3]);

/* Adds the output out[index] = value. */
void derive_put(struct derive *d, int index, expr value);

/* Adds one output for each lane's joint, in the joint's own direction. */
void derive_put_joint(struct derive *d, size_t group, expr value);

/* Adds three outputs for a vector given in the base's working frame. */
void derive_put_base(struct derive *d, int index, const expr x[3]);

/* ---- derive_inertia.c: articulated inertias ---- */

/* Computes the inertia of the rigid bodies. */
void derive_body_inertia(struct derive *d, size_t group);

/* Transforms A from the axes after a rotation by (c, s) about k to the axes before it. */
void derive_turn_inertia(struct derive *d, int k, expr c, expr s, struct state *A);

/* Moves the reference point of an inertia by -way along axis k: H' = H + [r] M, J' = J + [r] H^T -
 * H' [r]. */
void derive_shift_inertia(struct derive *d, int k, expr way, struct state *A);

/* Returns element (a, b) of the 6x6 articulated inertia, angular part first. */
expr *derive_inertia_element(struct state *A, int a, int b);

/* Adds the given matrices (struct added_inertia) to the inertias of the observed bodies. */
void derive_add_given_inertia(struct derive *d, size_t group);

/* ---- the functions ---- */

void derive_motion(struct derive *d);
void derive_energy(struct derive *d);

#endif
