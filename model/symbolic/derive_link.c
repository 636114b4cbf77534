/* SPDX-License-Identifier: Apache-2.0 */
/* Expressions of vectors between bodies, of joints, and of the inputs and outputs of the derived
 * functions. */
#include "model/symbolic/derive_private.h"

#include "model/spatial.h"

void derive_add_cross(struct derive *d, expr y[3], const expr x[3], const expr z[3])
{
    for (int m = 0; m < 3; m++) {
        int i = (m + 1) % 3, j = (m + 2) % 3;

        add_to(d, &y[m], sub(d, mul(d, x[i], z[j]), mul(d, x[j], z[i])));
    }
}

expr derive_dot(struct derive *d, const expr x[3], const expr y[3])
{
    return add(d, add(d, mul(d, x[0], y[0]), mul(d, x[1], y[1])), mul(d, x[2], y[2]));
}

void derive_apply_transposed(struct derive *d, const double A[9], const expr x[3], expr y[3])
{
    for (int m = 0; m < 3; m++) {
        y[m] = EXPR_ZERO;
        for (int n = 0; n < 3; n++) {
            add_to(d, &y[m], mul(d, graph_const(d->g, A[3 * n + m]), x[n]));
        }
    }
}

void derive_apply(struct derive *d, const double A[9], const expr x[3], expr y[3])
{
    double transposed[9];

    mat3_transpose(A, transposed);
    derive_apply_transposed(d, transposed, x, y);
}

/* Returns the constant at offset of each lane's body. */
static expr derive_body_const(struct derive *d, size_t group, size_t offset)
{
    const struct tree_group *lanes = &d->tree->group[group];
    double value[TREE_LANES];

    for (int l = 0; l < lanes->width; l++) {
        const char *body = (const char *)&d->tree->body[lanes->body[l]];

        memcpy(&value[l], body + offset, sizeof value[l]);
    }
    return graph_const_lanes(d->g, lanes->width, value);
}

expr derive_inertia(struct derive *d, size_t group, int property)
{
    const struct tree_group *lanes = &d->tree->group[group];
    double value[TREE_LANES];
    int index[TREE_LANES];

    if (lanes->place[property] < 0) {
        return EXPR_ZERO;
    }
    for (int l = 0; l < lanes->width; l++) {
        value[l] = tree_inertia(&d->tree->body[lanes->body[l]], property);
        index[l] = lanes->place[property] + l;
    }
    return d->inertia_inputs ? graph_input(d->g, DERIVE_INERTIA, lanes->width, index)
                             : graph_const_lanes(d->g, lanes->width, value);
}

expr derive_joint_input(struct derive *d, size_t group, enum derive_array array, int first)
{
    const struct tree_group *lanes = &d->tree->group[group];
    int index[TREE_LANES];

    for (int l = 0; l < lanes->width; l++) {
        index[l] = first + lanes->body[l] - 1;
    }
    return graph_input(d->g, array, lanes->width, index);
}

expr derive_signed_input(struct derive *d, size_t group, enum derive_array array, int first)
{
    return mul(d, derive_body_const(d, group, BODY(sign)),
               derive_joint_input(d, group, array, first));
}

const struct tree_body *derive_first_body(const struct derive *d, size_t group)
{
    return &d->tree->body[d->tree->group[group].body[0]];
}

expr derive_from_parent(struct derive *d, size_t group, size_t offset)
{
    const struct tree_group *lanes = &d->tree->group[group];
    expr lane[TREE_LANES];

    for (int l = 0; l < lanes->width; l++) {
        expr e = *state_field(d, (size_t)lanes->parent_group[l], offset);

        lane[l] = graph_lane(d->g, e, lanes->parent_lane[l]);
    }
    return graph_pack(d->g, lanes->width, lane);
}

void derive_to_parent(struct derive *d, size_t group, size_t offset, expr value)
{
    const struct tree_group *lanes = &d->tree->group[group];
    bool given[TREE_LANES] = {false};

    for (int start = 0; start < lanes->count; start++) {
        int parent = lanes->parent_group[start];
        const struct tree_group *to = &d->tree->group[parent];
        expr lane[TREE_LANES] = {EXPR_ZERO, EXPR_ZERO, EXPR_ZERO, EXPR_ZERO};
        bool used[TREE_LANES] = {false};

        if (given[start]) {
            continue;
        }
        /* Each round takes one child per lane of the parent. Further children come in the next
         * round */
        for (int l = start; l < lanes->count; l++) {
            int at = lanes->parent_lane[l];

            if (!given[l] && lanes->parent_group[l] == parent && !used[at]) {
                given[l] = used[at] = true;
                lane[at] = graph_lane(d->g, value, l);
            }
        }
        for (int l = to->count; l < to->width; l++) {
            lane[l] = lane[0];
        }
        add_to(d, state_field(d, (size_t)parent, offset), graph_pack(d->g, to->width, lane));
    }
}

void derive_turn_up(struct derive *d, int k, expr c, expr s, expr x[3])
{
    int i = (k + 1) % 3, j = (k + 2) % 3;
    expr xi = x[i], xj = x[j];

    x[i] = sub(d, mul(d, c, xi), mul(d, s, xj));
    x[j] = add(d, mul(d, s, xi), mul(d, c, xj));
}

expr derive_turn_const(struct derive *d, size_t group, int n, bool sine)
{
    return derive_body_const(d, group,
                             sine ? BODY(turn[0].s) + (size_t)n * sizeof(struct tree_turn)
                                  : BODY(turn[0].c) + (size_t)n * sizeof(struct tree_turn));
}

void derive_vector_down(struct derive *d, size_t group, expr x[3])
{
    const struct tree_body *body = derive_first_body(d, group);

    for (int n = 0; n < body->nturn; n++) {
        derive_turn_up(d, body->turn[n].axis, derive_turn_const(d, group, n, false),
                       expr_neg(derive_turn_const(d, group, n, true)), x);
    }
    if (!body->prismatic) {
        derive_turn_up(d, body->axis, d->state[group].c, expr_neg(d->state[group].s), x);
    }
}

void derive_vector_up(struct derive *d, size_t group, expr x[3])
{
    const struct tree_body *body = derive_first_body(d, group);

    if (!body->prismatic) {
        derive_turn_up(d, body->axis, d->state[group].c, d->state[group].s, x);
    }
    for (int n = body->nturn - 1; n >= 0; n--) {
        derive_turn_up(d, body->turn[n].axis, derive_turn_const(d, group, n, false),
                       derive_turn_const(d, group, n, true), x);
    }
}

void derive_origin(struct derive *d, size_t group, expr r[3])
{
    for (int m = 0; m < 3; m++) {
        r[m] = derive_body_const(d, group, BODY(r[0]) + (size_t)m * sizeof(double));
    }
}

void derive_body_origin(struct derive *d, int body, expr at[3])
{
    for (int m = 0; m < 3; m++) {
        at[m] = graph_const(d->g, d->tree->body[body].at[m]);
    }
}

void derive_joint_state(struct derive *d, size_t group)
{
    const struct robot *robot = d->tree->robot;
    struct state *state = &d->state[group];
    expr position = derive_signed_input(d, group, DERIVE_Q, robot->floating ? 7 : 0);

    state->rate = derive_signed_input(d, group, DERIVE_V, robot->floating ? 6 : 0);
    if (derive_first_body(d, group)->prismatic) {
        state->d = position;
    } else {
        /* Use the addition theorem. The sum of a large angle and an offset would be rounded to the
         * last place of the angle, which is 3e-11 rad at 3e5 rad */
        expr offset = derive_body_const(d, group, BODY(offset));
        expr c = graph_cos(d->g, position), s = graph_sin(d->g, position);
        expr co = graph_cos(d->g, offset), so = graph_sin(d->g, offset);

        state->c = sub(d, mul(d, co, c), mul(d, so, s));
        state->s = add(d, mul(d, co, s), mul(d, so, c));
    }
}

void derive_base_rotation(struct derive *d, expr R[3][3])
{
    expr e[4], square = EXPR_ZERO, k, body[3][3];

    for (int m = 0; m < 4; m++) {
        int index = 3 + m;

        e[m] = graph_input(d->g, DERIVE_Q, 1, &index);
        add_to(d, &square, mul(d, e[m], e[m]));
    }
    /* With k = 2 / |e|^2 the quaternion may have any length */
    k = mul(d, graph_const(d->g, 2.0), graph_invert(d->g, square));
    for (int m = 0; m < 3; m++) {
        int i = (m + 1) % 3, j = (m + 2) % 3;
        expr kw = mul(d, k, e[0]), ki = mul(d, k, e[1 + i]), kj = mul(d, k, e[1 + j]);
        expr ij = mul(d, ki, e[1 + j]), wm = mul(d, kw, e[1 + m]);

        body[m][m] =
            sub(d, graph_const(d->g, 1.0), add(d, mul(d, ki, e[1 + i]), mul(d, kj, e[1 + j])));
        body[i][j] = sub(d, ij, wm);
        body[j][i] = add(d, ij, wm);
    }
    /* Rotate by align, because the working frame differs from the body's frame */
    for (int row = 0; row < 3; row++) {
        derive_apply_transposed(d, d->tree->body[0].align, body[row], R[row]);
    }
}

void derive_base_input(struct derive *d, enum derive_array array, int first, expr x[3])
{
    expr in[3];

    for (int m = 0; m < 3; m++) {
        int index = first + m;

        in[m] = graph_input(d->g, array, 1, &index);
    }
    derive_apply_transposed(d, d->tree->body[0].align, in, x);
}

void derive_column_of(expr R[3][3], int k, expr x[3])
{
    for (int m = 0; m < 3; m++) {
        x[m] = R[m][k];
    }
}

void derive_rotate(struct derive *d, expr R[3][3], const expr x[3], expr y[3])
{
    for (int m = 0; m < 3; m++) {
        y[m] = derive_dot(d, R[m], x);
    }
}

void derive_put(struct derive *d, int index, expr value)
{
    d->out->output[d->out->count++] = (struct derive_output){index, value, false};
}

void derive_put_joint(struct derive *d, size_t group, expr value)
{
    const struct tree_group *lanes = &d->tree->group[group];
    int first = d->tree->robot->floating ? 6 : 0;

    value = mul(d, derive_body_const(d, group, BODY(sign)), value);
    for (int l = 0; l < lanes->count; l++) {
        derive_put(d, first + lanes->body[l] - 1, graph_lane(d->g, value, l));
    }
}

void derive_put_base(struct derive *d, int index, const expr x[3])
{
    expr out[3];

    derive_apply(d, d->tree->body[0].align, x, out);
    for (int m = 0; m < 3; m++) {
        derive_put(d, index + m, out[m]);
    }
}
