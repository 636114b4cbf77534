/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Newton-Euler and articulated-body recursions over expressions (Featherstone, Rigid Body Dynamics
 * Algorithms, 2008, tables 5.1 and 7.1), arranged for few operations:
 *
 * - All velocity terms are combined into the forces of a motion with zero joint accelerations
 *   (Newton-Euler with G = [alpha] + [w][w], force m a + G h, moment
 *   h x a + skew(G K)). The rest is linear in the accelerations, so the articulated-body recursion
 *   needs no bias accelerations.
 * - After a joint is eliminated, its own row of the articulated inertia is zero and gets no code.
 * - Gravity and -w x v are added to the base's acceleration at the end, because a uniform field
 *   does not move the joints of a free robot.
 */
#include "model/symbolic/derive_private.h"

#include "model/spatial.h"

#include <stdlib.h>
#include <string.h>

/* Computes gravity minus w x v in the base's working frame: the rate of the base's linear velocity
 * components without other forces. The recursion starts from its negative. */
static void base_drift(struct derive *d, expr drift[3])
{
    const struct robot *robot = d->tree->robot;
    expr gravity[3];

    for (int m = 0; m < 3; m++) {
        gravity[m] = graph_const(d->g, robot->gravity[m]);
    }
    if (robot->floating) {
        expr R[3][3], v[3], w[3], column[3];

        derive_base_rotation(d, R);
        derive_base_input(d, DERIVE_V, BASE_V_LINEAR, v);
        derive_base_input(d, DERIVE_V, BASE_V_ANGULAR, w);
        for (int m = 0; m < 3; m++) {
            derive_column_of(R, m, column);
            drift[m] = derive_dot(d, column, gravity);
        }
        derive_add_cross(d, drift, v, w);
    } else {
        derive_apply_transposed(d, d->tree->body[0].align, gravity, drift);
    }
}

/* Computes G = [alpha] + [w][w]. */
static void rate_matrix(struct derive *d, struct state *state)
{
    expr square[3];

    for (int m = 0; m < 3; m++) {
        square[m] = mul(d, state->w[m], state->w[m]);
    }
    for (int m = 0; m < 3; m++) {
        int i = (m + 1) % 3, j = (m + 2) % 3;
        expr product = mul(d, state->w[i], state->w[j]);

        state->G[m][m] = expr_neg(add(d, square[i], square[j]));
        state->G[i][j] = sub(d, product, state->alpha[m]);
        state->G[j][i] = add(d, product, state->alpha[m]);
    }
}

/* Computes velocity and accelerations from the parents (Newton-Euler, outward). given: also adds
 * the joints' own accelerations. */
static void motion_outward(struct derive *d, size_t group, bool given)
{
    struct state *state = &d->state[group];
    int k = derive_first_body(d, group)->axis, i = (k + 1) % 3, j = (k + 2) % 3;
    bool prismatic = derive_first_body(d, group)->prismatic;
    expr r[3];

    /* Compute the parents' velocity and accelerations at the origins of the group's bodies, in
     * the bodies' axes */
    derive_origin(d, group, r);
    for (int m = 0; m < 3; m++) {
        size_t at = (size_t)m * sizeof(expr);

        state->w[m] = derive_from_parent(d, group, STATE(w[0]) + at);
        state->alpha[m] = derive_from_parent(d, group, STATE(alpha[0]) + at);
        state->a[m] = derive_from_parent(d, group, STATE(a[0]) + at);
        for (int n = 0; n < 3; n++) {
            size_t element = STATE(G[0][0]) + (size_t)(3 * m + n) * sizeof(expr);

            /* Add the acceleration of the origin: a + G r */
            if (r[n] != EXPR_ZERO) {
                expr G = derive_from_parent(d, group, element);

                add_to(d, &state->a[m], mul(d, G, r[n]));
            }
        }
    }
    derive_vector_down(d, group, state->w);
    derive_vector_down(d, group, state->alpha);
    derive_vector_down(d, group, state->a);
    /* A prismatic joint adds its offset and the Coriolis terms, a revolute joint its rate */
    if (prismatic) {
        expr twice = mul(d, graph_const(d->g, 2.0), state->rate);

        rate_matrix(d, state);
        for (int m = 0; m < 3; m++) {
            add_to(d, &state->a[m], mul(d, state->G[m][k], state->d));
        }
        add_to(d, &state->a[i], mul(d, state->w[j], twice));
        add_to(d, &state->a[j], expr_neg(mul(d, state->w[i], twice)));
    } else {
        add_to(d, &state->alpha[i], mul(d, state->w[j], state->rate));
        add_to(d, &state->alpha[j], expr_neg(mul(d, state->w[i], state->rate)));
        add_to(d, &state->w[k], state->rate);
    }
    if (given) {
        int first = d->tree->robot->floating ? BASE_V_COUNT : 0;

        add_to(d, prismatic ? &state->a[k] : &state->alpha[k],
               derive_signed_input(d, group, DERIVE_VDOT, first));
    }
    rate_matrix(d, state);
}

/* Computes the force and moment for the bodies' own motion: f = m a + G h, n = h x a + skew(G
 * K). */
static void body_force(struct derive *d, size_t group, bool ext)
{
    struct state *state = &d->state[group];
    expr mass = derive_inertia(d, group, TREE_MASS), h[3], K[3][3];

    for (int m = 0; m < 3; m++) {
        h[m] = derive_inertia(d, group, TREE_H + m);
        for (int n = m; n < 3; n++) {
            K[m][n] = K[n][m] = derive_inertia(d, group, TREE_K + sym3_index[m][n]);
        }
    }
    for (int m = 0; m < 3; m++) {
        int i = (m + 1) % 3, j = (m + 2) % 3;
        expr wi = mul(d, state->w[i], state->w[i]), wj = mul(d, state->w[j], state->w[j]);

        state->f[m] = add(d, mul(d, mass, state->a[m]), derive_dot(d, state->G[m], h));
        state->n[m] = sub(d, mul(d, K[i][i], state->G[j][i]), mul(d, K[j][j], state->G[i][j]));
        add_to(d, &state->n[m], mul(d, K[i][j], sub(d, wj, wi)));
        add_to(d, &state->n[m], mul(d, K[m][i], state->G[j][m]));
        add_to(d, &state->n[m], expr_neg(mul(d, K[m][j], state->G[i][m])));
    }
    derive_add_cross(d, state->n, h, state->a);
    if (ext) {
        /* Subtract the external wrenches on the group's bodies, in their working frames */
        const struct tree_group *lanes = &d->tree->group[group];

        expr lane[6][TREE_LANES];

        for (int l = 0; l < lanes->width; l++) {
            int body = lanes->body[l];
            expr in[6], out[6], at[3];

            for (int m = 0; m < 6; m++) {
                int index = 6 * body + m;

                in[m] = graph_input(d->g, DERIVE_EXT, 1, &index);
            }
            derive_apply_transposed(d, d->tree->body[body].align, in, out);
            derive_apply_transposed(d, d->tree->body[body].align, in + 3, out + 3);
            derive_body_origin(d, body, at);
            derive_add_cross(d, out + 3, at, out);
            for (int m = 0; m < 6; m++) {
                lane[m][l] = out[m];
            }
        }
        for (int m = 0; m < 3; m++) {
            state->f[m] = sub(d, state->f[m], graph_pack(d->g, lanes->width, lane[m]));
            state->n[m] = sub(d, state->n[m], graph_pack(d->g, lanes->width, lane[3 + m]));
        }
    }
}

/* Adds n and f to the parents' force and moment, at the parents' origins. */
static void force_inward(struct derive *d, size_t group, expr n[3], expr f[3])
{
    const struct tree_body *body = derive_first_body(d, group);
    expr r[3], way[3] = {EXPR_ZERO, EXPR_ZERO, EXPR_ZERO};

    if (body->prismatic) {
        way[body->axis] = d->state[group].d;
        derive_add_cross(d, n, way, f);
    }
    derive_vector_up(d, group, f);
    derive_vector_up(d, group, n);
    derive_origin(d, group, r);
    derive_add_cross(d, n, r, f);
    for (int m = 0; m < 3; m++) {
        size_t at = (size_t)m * sizeof(expr);

        derive_to_parent(d, group, STATE(n[0]) + at, n[m]);
        derive_to_parent(d, group, STATE(f[0]) + at, f[m]);
    }
}

/* Eliminates the joint's own motion from the inertia A and from the bias force p: A <- A - U U^T /
 * D and p <- p + U u / D, with D = S^T A S, U = A S, u = tau - S^T p. */
static void eliminate_joint(struct derive *d, size_t group, struct state *A)
{
    const struct tree_body *body = derive_first_body(d, group);
    struct state *state = &d->state[group];
    bool added = d->function == DERIVE_IMPLICIT;
    int own = body->axis + (body->prismatic ? 3 : 0);
    expr U[6], *bias[6], D, invert, tau = derive_signed_input(d, group, DERIVE_TAU, 0);

    /* Compute U, D and the joint's component of the bias force */
    for (int m = 0; m < 6; m++) {
        U[m] = *derive_inertia_element(A, own, m);
    }
    for (int m = 0; m < 3; m++) {
        bias[m] = &A->n[m];
        bias[3 + m] = &A->f[m];
    }
    D = added ? add(d, U[own], derive_joint_input(d, group, DERIVE_EXTRA, 0)) : U[own];
    invert = graph_invert(d->g, D);
    state->x = mul(d, sub(d, tau, *bias[own]), invert);
    for (int m = 0; m < 6; m++) {
        state->ratio[m] = mul(d, U[m], invert);
    }

    /* Compute A - U U^T / D and p + U u / D */
    for (int a = 0; a < 6; a++) {
        /* Without added inertia the joint's own row becomes zero and its own force becomes tau */
        bool gone = a == own && !added;

        *bias[a] = gone ? tau : add(d, *bias[a], mul(d, U[a], state->x));
        for (int b = a; b < 6; b++) {
            expr *element = derive_inertia_element(A, a, b);

            if (gone || (b == own && !added)) {
                *element = EXPR_ZERO;
            } else {
                *element = sub(d, *element, mul(d, state->ratio[a], U[b]));
            }
        }
    }
}

/* Solves for the floating base's accelerations: A x = -p by elimination, the linear part first. */
static void solve_base(struct derive *d)
{
    static const int order[6] = {5, 4, 3, 2, 1, 0};
    struct state *base = &d->state[0], A = *base;
    expr ratio[6][6], x[6], bias[6], *out[6];

    /* Angular parts are rows 0 to 2, linear ones rows 3 to 5 */
    for (int m = 0; m < 3; m++) {
        bias[m] = A.n[m];
        bias[3 + m] = A.f[m];
        out[m] = &base->da[m];
        out[3 + m] = &base->dl[m];
    }

    /* Eliminate row by row, in the order linear, angular */
    for (int step = 0; step < 6; step++) {
        int own = order[step];
        expr invert = graph_invert(d->g, *derive_inertia_element(&A, own, own));
        expr column[6];

        for (int m = step + 1; m < 6; m++) {
            column[m] = *derive_inertia_element(&A, own, order[m]);
            ratio[step][m] = mul(d, column[m], invert);
        }
        x[step] = mul(d, bias[own], invert);
        for (int m = step + 1; m < 6; m++) {
            bias[order[m]] = sub(d, bias[order[m]], mul(d, ratio[step][m], bias[own]));
            for (int n = m; n < 6; n++) {
                expr *element = derive_inertia_element(&A, order[m], order[n]);

                *element = sub(d, *element, mul(d, ratio[step][m], column[n]));
            }
        }
    }

    /* Back substitution */
    for (int step = 5; step >= 0; step--) {
        expr value = expr_neg(x[step]);

        for (int m = 5; m > step; m--) {
            value = sub(d, value, mul(d, ratio[step][m], *out[order[m]]));
        }
        *out[order[step]] = value;
    }
}

/* Returns the joints' accelerations. Computes the bodies' accelerations from the parents'
 * accelerations. */
static expr acceleration_outward(struct derive *d, size_t group)
{
    const struct tree_body *body = derive_first_body(d, group);
    struct state *state = &d->state[group];
    bool added = d->function == DERIVE_IMPLICIT;
    int own = body->axis + (body->prismatic ? 3 : 0);
    expr r[3], sum = state->x, before, *element[6];
    expr part[3] = {EXPR_ZERO, EXPR_ZERO, EXPR_ZERO};

    /* Compute the parent's acceleration at the body's origin, in the body's axes */
    derive_origin(d, group, r);
    for (int m = 0; m < 3; m++) {
        state->da[m] = derive_from_parent(d, group, STATE(da[0]) + (size_t)m * sizeof(expr));
        state->dl[m] = derive_from_parent(d, group, STATE(dl[0]) + (size_t)m * sizeof(expr));
        element[m] = &state->da[m];
        element[3 + m] = &state->dl[m];
    }
    derive_add_cross(d, state->dl, state->da, r);
    derive_vector_down(d, group, state->da);
    derive_vector_down(d, group, state->dl);
    if (body->prismatic) {
        expr way[3] = {EXPR_ZERO, EXPR_ZERO, EXPR_ZERO};

        way[body->axis] = state->d;
        derive_add_cross(d, state->dl, state->da, way);
    }

    /* The joint's acceleration is its remaining force minus the part used by the body's
     * acceleration. Three short sums are faster than a long sum, because the next joint waits for
     * the result */
    for (int m = 0; m < 6; m++) {
        if (m != own || added) {
            add_to(d, &part[m % 3], mul(d, state->ratio[m], *element[m]));
        }
    }
    sum = sub(d, sub(d, sum, part[own % 3]), add(d, part[(own + 1) % 3], part[(own + 2) % 3]));
    before = *element[own];
    if (added) {
        *element[own] = add(d, before, sum);
        return sum;
    }
    *element[own] = sum;
    return sub(d, sum, before);
}

static void derive_forward(struct derive *d)
{
    size_t ngroup = d->tree->ngroup;
    struct state *base = &d->state[0];
    bool floating = d->tree->robot->floating, added = d->function == DERIVE_IMPLICIT;
    bool ext = d->function != DERIVE_FORWARD;
    expr drift[3];

    /* Compute the base's motion */
    base_drift(d, drift);
    if (floating) {
        derive_base_input(d, DERIVE_V, BASE_V_ANGULAR, base->w);
    }
    /* The drift of a free base is added at the end. With added inertias it is included from the
     * start, because they resist only the rates of v */
    for (int m = 0; (!floating || added) && m < 3; m++) {
        base->a[m] = expr_neg(drift[m]);
    }

    /* Outward: compute the motion at zero joint accelerations, and the force that each body needs
     * for this motion */
    rate_matrix(d, base);
    for (size_t g = 0; g < ngroup; g++) {
        if (g > 0) {
            derive_joint_state(d, g);
            motion_outward(d, g, false);
        }
        body_force(d, g, ext);
        derive_body_inertia(d, g);
        if (added) {
            derive_add_given_inertia(d, g);
        }
    }

    /* Inward: compute articulated inertias. Outward: compute accelerations */
    for (size_t g = ngroup - 1; g > 0; g--) {
        /* Eliminate the group's joints; add the remaining inertia and force to the parents */
        struct state A = d->state[g];

        eliminate_joint(d, g, &A);

        /* Transform the inertia A from the bodies' frames to the parents' frames */
        const struct tree_body *body = derive_first_body(d, g);
        expr r[3];

        if (body->prismatic) {
            derive_shift_inertia(d, body->axis, d->state[g].d, &A);
        } else {
            derive_turn_inertia(d, body->axis, d->state[g].c, d->state[g].s, &A);
        }
        for (int n = body->nturn - 1; n >= 0; n--) {
            derive_turn_inertia(d, body->turn[n].axis, derive_turn_const(d, g, n, false),
                                derive_turn_const(d, g, n, true), &A);
        }
        derive_origin(d, g, r);
        for (int m = 0; m < 3; m++) {
            derive_shift_inertia(d, m, r[m], &A);
        }
        for (int a = 0; a < 6; a++) {
            for (int b = a; b < 6; b++) {
                expr *element = derive_inertia_element(&A, a, b);
                size_t at = (size_t)((char *)element - (char *)&A);

                derive_to_parent(d, g, at, *element);
            }
        }
        force_inward(d, g, A.n, A.f);
    }
    if (floating) {
        expr linear[3];

        solve_base(d);
        for (int m = 0; m < 3; m++) {
            linear[m] = added ? base->dl[m] : add(d, base->dl[m], drift[m]);
        }
        derive_put_base(d, BASE_V_LINEAR, linear);
        derive_put_base(d, BASE_V_ANGULAR, base->da);
    }
    for (size_t g = 1; g < ngroup; g++) {
        derive_put_joint(d, g, acceleration_outward(d, g));
    }
}

static void derive_inverse(struct derive *d)
{
    struct state *base = &d->state[0];
    expr drift[3];

    /* Compute the base's motion with its given acceleration */
    base_drift(d, drift);
    for (int m = 0; m < 3; m++) {
        base->a[m] = expr_neg(drift[m]);
    }
    if (d->tree->robot->floating) {
        expr linear[3];

        derive_base_input(d, DERIVE_V, BASE_V_ANGULAR, base->w);
        derive_base_input(d, DERIVE_VDOT, BASE_V_LINEAR, linear);
        derive_base_input(d, DERIVE_VDOT, BASE_V_ANGULAR, base->alpha);
        for (int m = 0; m < 3; m++) {
            add_to(d, &base->a[m], linear[m]);
        }
    }

    /* Outward: compute the force that each body's motion needs. Inward: compute the joints'
     * components of these forces */
    rate_matrix(d, base);
    for (size_t g = 0; g < d->tree->ngroup; g++) {
        if (g > 0) {
            derive_joint_state(d, g);
            motion_outward(d, g, true);
        }
        body_force(d, g, true);
    }
    for (size_t g = d->tree->ngroup - 1; g > 0; g--) {
        const struct tree_body *body = derive_first_body(d, g);
        struct state *state = &d->state[g];

        derive_put_joint(d, g, body->prismatic ? state->f[body->axis] : state->n[body->axis]);
        force_inward(d, g, state->n, state->f);
    }
    if (d->tree->robot->floating) {
        derive_put_base(d, BASE_V_LINEAR, base->f);
        derive_put_base(d, BASE_V_ANGULAR, base->n);
    }
}

/* ---- the derivation ---- */

enum error_code derive(enum derive_function function, const struct tree *tree, bool inertia_inputs,
                       struct graph *graph, struct derivation *out, struct error *error)
{
    struct derive d = {.function = function,
                       .inertia_inputs = inertia_inputs,
                       .g = graph,
                       .tree = tree,
                       .out = out};
    enum error_code code = ERROR_NONE;
    int observed = 0;

    /* At most 27 outputs per body: its motion, and 9 for its pose */
    memset(out, 0, sizeof *out);
    out->output = calloc(27 * tree->nbody + 12, sizeof *out->output);
    d.state = calloc(tree->ngroup, sizeof *d.state);
    d.observed = calloc(tree->nbody, sizeof *d.observed);
    if (!out->output || !d.state || !d.observed) {
        code = error_set(error, ERROR_MEMORY, "no memory for the equations of %zu bodies",
                         tree->nbody);
        goto done;
    }

    /* Number the observed bodies */
    for (size_t b = 0; b < tree->nbody; b++) {
        d.observed[b] = tree->body[b].observed ? observed++ : -1;
    }

    /* Derive the equations of d->function */
    switch (d.function) {
    case DERIVE_INVERSE:
        derive_inverse(&d);
        break;
    case DERIVE_KINEMATICS:
    case DERIVE_VELOCITIES:
    case DERIVE_ACCELERATION:
        derive_motion(&d);
        break;
    case DERIVE_ENERGY:
        derive_energy(&d);
        break;
    default:
        derive_forward(&d);
        break;
    }
    if (graph->failed) {
        code = error_set(error, ERROR_MEMORY, "no memory for the expression graph");
    }

done:
    free(d.state);
    free(d.observed);
    if (code) {
        derivation_fini(out);
    }
    return code;
}

void derivation_fini(struct derivation *derivation)
{
    free(derivation->output);
    memset(derivation, 0, sizeof *derivation);
}
