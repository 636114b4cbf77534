/* SPDX-License-Identifier: Apache-2.0 */
/* Expressions of kinematics, accelerations and energy in the world frame. */
#include "model/symbolic/derive_private.h"

#include <string.h>

/* Offsets of the parts of a struct body_motion and a struct body_acceleration, in doubles. */
enum motion_part { MOTION_R = 0, MOTION_P = 9, MOTION_W = 12, MOTION_V = 15, MOTION_COUNT = 18 };
enum acceleration_part { ACCELERATION_ALPHA = 0, ACCELERATION_A = 3, ACCELERATION_COUNT = 6 };

/* Returns whether the first lane of a constant that is not 0 has a negative value. */
static bool factor_is_negative(const struct derive *d, expr factor)
{
    const struct graph_node *node = graph_get(d->g, factor);
    int l = 0;

    while (l < node->width - 1 && node->value[l] == 0.0) {
        l++;
    }
    return (node->value[l] < 0.0) != expr_negative(factor);
}

/* Stores the variable factor of x in the pose, or reads it from the pose. Kinematics stores the
 * factors, velocities and accelerations read them. The indices agree, because all three functions
 * build equal expressions in equal order. */
static expr keep_factor(struct derive *d, expr x)
{
    const struct graph_node *node = d->g->failed ? NULL : graph_get(d->g, x);
    struct derivation *out = d->out;
    int index[TREE_LANES];

    if (!node || node->op == GRAPH_CONST) {
        return x;
    }
    if (node->op == GRAPH_MUL && graph_get(d->g, node->operand[0])->op == GRAPH_CONST) {
        expr factor = node->operand[0], rest = node->operand[1];
        bool negative = factor_is_negative(d, factor);

        /* The sign belongs to the stored factor, because the order of creation decides whether the
         * node is a - b or b - a */
        factor = negative ? expr_neg(factor) : factor;
        rest = negative != expr_negative(x) ? expr_neg(rest) : rest;
        return mul(d, factor, keep_factor(d, rest));
    }
    /* Align the index to the number of lanes */
    index[0] = (out->npose + node->width - 1) / node->width * node->width;
    out->npose = index[0] + node->width;
    if (d->function == DERIVE_KINEMATICS) {
        out->output[out->count++] = (struct derive_output){index[0], x, true};
        return x;
    }
    for (int l = 1; l < node->width; l++) {
        index[l] = index[0] + l;
    }
    return graph_input(d->g, DERIVE_POSE, node->width, index);
}

/* Applies keep_factor to a vector, except in the energy, which has no pose. */
static void keep_pose(struct derive *d, expr x[3])
{
    for (int m = 0; d->function != DERIVE_ENERGY && m < 3; m++) {
        x[m] = keep_factor(d, x[m]);
    }
}

/* Fills the pose of the base: inputs for a floating base, else constants. */
static void base_pose(struct derive *d)
{
    struct state *base = &d->state[0];
    const struct tree_body *body = &d->tree->body[0];

    if (d->tree->robot->floating) {
        derive_base_rotation(d, base->R);
        for (int m = 0; m < 3; m++) {
            base->p[m] = graph_input(d->g, DERIVE_Q, 1, &m);
        }
        return;
    }
    for (int m = 0; m < 3; m++) {
        for (int n = 0; n < 3; n++) {
            base->R[m][n] = graph_const(d->g, body->align[3 * m + n]);
        }
    }
}

/* Computes pose, velocity and, if accelerations is set, classical acceleration in the world frame,
 * from the parents. */
static void world_outward(struct derive *d, size_t group, bool accelerations)
{
    const struct tree_body *body = derive_first_body(d, group);
    struct state *state = &d->state[group];
    expr r[3], arm[3], axis[3], slide[3] = {EXPR_ZERO, EXPR_ZERO, EXPR_ZERO};

    /* Copy the parents' pose, velocity and acceleration */
    for (int m = 0; m < 3; m++) {
        size_t at = (size_t)m * sizeof(expr);

        for (int n = 0; n < 3; n++) {
            state->R[m][n] =
                derive_from_parent(d, group, STATE(R[0][0]) + 3 * at + (size_t)n * sizeof(expr));
        }
        state->p[m] = derive_from_parent(d, group, STATE(p[0]) + at);
        state->w[m] = derive_from_parent(d, group, STATE(w[0]) + at);
        state->v[m] = derive_from_parent(d, group, STATE(v[0]) + at);
        state->alpha[m] = derive_from_parent(d, group, STATE(alpha[0]) + at);
        state->a[m] = derive_from_parent(d, group, STATE(a[0]) + at);
    }
    derive_origin(d, group, r);
    derive_rotate(d, state->R, r, arm);
    for (int m = 0; m < 3; m++) {
        derive_vector_down(d, group, state->R[m]);
    }
    /* Compute the joint's axis in the world frame. A prismatic joint lengthens the arm */
    derive_column_of(state->R, body->axis, axis);
    for (int m = 0; body->prismatic && m < 3; m++) {
        add_to(d, &arm[m], mul(d, axis[m], state->d));
    }
    keep_pose(d, axis);
    keep_pose(d, arm);
    for (int m = 0; body->prismatic && m < 3; m++) {
        slide[m] = mul(d, axis[m], state->rate);
    }
    if (accelerations) {
        bool prismatic = derive_first_body(d, group)->prismatic;
        int first = d->tree->robot->floating ? BASE_V_COUNT : 0;
        expr rate = derive_signed_input(d, group, DERIVE_VDOT, first), turn[3];
        expr twice = graph_const(d->g, 2.0), across[3] = {EXPR_ZERO, EXPR_ZERO, EXPR_ZERO};

        /* Add the acceleration due to arm (from the parent's origin) and to the joint along
         * axis: a += alpha x arm + w x (w x arm), and for a prismatic joint 2 w x slide + axis
         * d''. w and alpha are still the parent's values. */
        derive_add_cross(d, state->a, state->alpha, arm);
        derive_add_cross(d, across, state->w, arm);
        for (int m = 0; m < 3; m++) {
            add_to(d, &across[m], mul(d, twice, slide[m]));
        }
        derive_add_cross(d, state->a, state->w, across);
        for (int m = 0; m < 3; m++) {
            turn[m] = mul(d, axis[m], state->rate);
            add_to(d, prismatic ? &state->a[m] : &state->alpha[m], mul(d, axis[m], rate));
        }
        if (!prismatic) {
            derive_add_cross(d, state->alpha, state->w, turn);
        }
    }
    /* Compute velocity and pose last, because the acceleration uses the parent's values */
    derive_add_cross(d, state->v, state->w, arm);
    for (int m = 0; m < 3; m++) {
        add_to(d, &state->p[m], arm[m]);
        add_to(d, &state->v[m], slide[m]);
        if (!body->prismatic) {
            add_to(d, &state->w[m], mul(d, axis[m], state->rate));
        }
    }
}

/* Computes the base's velocity and, if accelerations is set, its acceleration in the world
 * frame. */
static void base_motion(struct derive *d, bool accelerations)
{
    struct state *base = &d->state[0];
    expr w[3], v[3], R[3][3];

    base_pose(d);
    if (!d->tree->robot->floating) {
        return;
    }
    memcpy(R, base->R, sizeof R);
    for (int m = 0; m < 3; m++) {
        keep_pose(d, R[m]);
    }
    derive_base_input(d, DERIVE_V, BASE_V_LINEAR, v);
    derive_base_input(d, DERIVE_V, BASE_V_ANGULAR, w);
    derive_rotate(d, R, v, base->v);
    derive_rotate(d, R, w, base->w);
    if (accelerations) {
        expr linear[3], angular[3];

        derive_base_input(d, DERIVE_VDOT, BASE_V_LINEAR, linear);
        derive_base_input(d, DERIVE_VDOT, BASE_V_ANGULAR, angular);
        derive_add_cross(d, linear, w, v);
        derive_rotate(d, R, linear, base->a);
        derive_rotate(d, R, angular, base->alpha);
    }
}

/* Writes three outputs from index on. */
static void put_vector(struct derive *d, int index, const expr x[3])
{
    for (int m = 0; m < 3; m++) {
        derive_put(d, index + m, x[m]);
    }
}

/* Writes the motion of a body's own frame, computed from its working frame. The function for
 * velocities omits the pose. */
static void put_motion(struct derive *d, int body, struct state *lane)
{
    const bool place = d->function == DERIVE_KINEMATICS;
    expr at[3], arm[3], row[3];

    for (int m = 0; place && m < 3; m++) {
        derive_apply(d, d->tree->body[body].align, lane->R[m], row);
        put_vector(d, MOTION_COUNT * body + MOTION_R + 3 * m, row);
    }
    derive_body_origin(d, body, at);
    derive_rotate(d, lane->R, at, arm);
    for (int m = 0; m < 3; m++) {
        add_to(d, &lane->p[m], arm[m]);
    }
    keep_pose(d, arm);
    derive_add_cross(d, lane->v, lane->w, arm);
    if (place) {
        put_vector(d, MOTION_COUNT * body + MOTION_P, lane->p);
    }
    put_vector(d, MOTION_COUNT * body + MOTION_W, lane->w);
    put_vector(d, MOTION_COUNT * body + MOTION_V, lane->v);
}

/* Writes the acceleration of a body's own origin. */
static void put_acceleration(struct derive *d, int body, struct state *lane)
{
    expr at[3], arm[3], across[3] = {EXPR_ZERO, EXPR_ZERO, EXPR_ZERO};

    derive_body_origin(d, body, at);
    derive_rotate(d, lane->R, at, arm);
    keep_pose(d, arm);
    derive_add_cross(d, across, lane->w, arm);
    derive_add_cross(d, lane->a, lane->alpha, arm);
    derive_add_cross(d, lane->a, lane->w, across);
    put_vector(d, ACCELERATION_COUNT * body + ACCELERATION_ALPHA, lane->alpha);
    put_vector(d, ACCELERATION_COUNT * body + ACCELERATION_A, lane->a);
}

void derive_motion(struct derive *d)
{
    bool accelerations = d->function == DERIVE_ACCELERATION;

    base_motion(d, accelerations);
    for (size_t g = 0; g < d->tree->ngroup; g++) {
        const struct tree_group *lanes = &d->tree->group[g];
        struct state *state = &d->state[g];

        if (g > 0) {
            derive_joint_state(d, g);
            world_outward(d, g, accelerations);
        }
        /* Add the outputs of the observed bodies of the group */
        for (int l = 0; l < lanes->count; l++) {
            int body = lanes->body[l];
            struct state lane;

            if (d->observed[body] < 0) {
                continue;
            }

            /* Extract one lane of the motion */
            for (int m = 0; m < 3; m++) {
                for (int n = 0; n < 3; n++) {
                    lane.R[m][n] = graph_lane(d->g, state->R[m][n], l);
                }
                lane.p[m] = graph_lane(d->g, state->p[m], l);
                lane.v[m] = graph_lane(d->g, state->v[m], l);
                lane.w[m] = graph_lane(d->g, state->w[m], l);
                lane.a[m] = graph_lane(d->g, state->a[m], l);
                lane.alpha[m] = graph_lane(d->g, state->alpha[m], l);
            }
            if (accelerations) {
                put_acceleration(d, body, &lane);
            } else {
                put_motion(d, body, &lane);
            }
        }
    }
}

/* Adds the lanes of value that have a body to *sum. */
static void add_lanes(struct derive *d, size_t group, expr *sum, expr value)
{
    for (int l = 0; l < d->tree->group[group].count; l++) {
        add_to(d, sum, graph_lane(d->g, value, l));
    }
}

void derive_energy(struct derive *d)
{
    expr kinetic = EXPR_ZERO, potential = EXPR_ZERO;

    base_motion(d, false);
    for (size_t g = 0; g < d->tree->ngroup; g++) {
        if (g > 0) {
            derive_joint_state(d, g);
            world_outward(d, g, false);
        }

        /* Add twice the kinetic energy, m v.v + 2 v.(w x h) + w.J w with the last term in the
         * bodies' axes, and the potential energy, -g.(m p + R h) */
        struct state *state = &d->state[g];
        expr mass = derive_inertia(d, g, TREE_MASS), two = graph_const(d->g, 2.0);
        expr h[3], first[3], w[3], Jw[3], across[3] = {EXPR_ZERO, EXPR_ZERO, EXPR_ZERO}, twice;

        /* Compute h and w in the bodies' axes, and R h in the world's axes */
        derive_body_inertia(d, g);
        for (int m = 0; m < 3; m++) {
            expr column[3];

            h[m] = derive_inertia(d, g, TREE_H + m);
            derive_column_of(state->R, m, column);
            w[m] = derive_dot(d, column, state->w);
        }
        derive_rotate(d, state->R, h, first);

        /* Add twice the kinetic energy */
        for (int m = 0; m < 3; m++) {
            expr row[3];

            for (int n = 0; n < 3; n++) {
                row[n] = *upper(state->J, m, n);
            }
            Jw[m] = derive_dot(d, row, w);
        }
        derive_add_cross(d, across, state->w, first);
        twice = add(d, mul(d, mass, derive_dot(d, state->v, state->v)), derive_dot(d, w, Jw));
        add_to(d, &twice, mul(d, two, derive_dot(d, state->v, across)));
        add_lanes(d, g, &kinetic, twice);

        /* Add the potential energy */
        for (int m = 0; m < 3; m++) {
            expr moment = add(d, first[m], mul(d, mass, state->p[m]));
            double gravity = d->tree->robot->gravity[m];

            add_lanes(d, g, &potential, mul(d, graph_const(d->g, -gravity), moment));
        }
    }
    derive_put(d, 0, mul(d, graph_const(d->g, 0.5), kinetic));
    derive_put(d, 1, potential);
}
