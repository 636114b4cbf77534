/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Expressions of articulated inertias: rigid bodies, rotations, shifts. The rotation of a 2x2 block
 * takes one number t and four sums instead of two matrix products.
 */
#include "model/symbolic/derive_private.h"

#include "model/spatial.h"

void derive_body_inertia(struct derive *d, size_t group)
{
    struct state *state = &d->state[group];

    for (int m = 0; m < 3; m++) {
        int i = (m + 1) % 3, j = (m + 2) % 3;
        expr h = derive_inertia(d, group, TREE_H + m);

        state->M[m][m] = derive_inertia(d, group, TREE_MASS);
        /* H = [h] */
        state->H[j][i] = h;
        state->H[i][j] = expr_neg(h);
        /* J = trace(K) 1 - K */
        state->J[m][m] = add(d, derive_inertia(d, group, TREE_K + sym3_index[i][i]),
                             derive_inertia(d, group, TREE_K + sym3_index[j][j]));
        *upper(state->J, i, j) = expr_neg(derive_inertia(d, group, TREE_K + sym3_index[i][j]));
    }
}

/* Rotates a symmetric matrix, S <- Rot S Rot^T, by a turn about k: with t = s (sii - sjj) + 2 c
 * sij, sii' = sii - s t, sjj' = sjj + s t, sij' = c t - sij. */
static void turn_symmetric(struct derive *d, int k, expr c, expr s, expr S[3][3])
{
    int i = (k + 1) % 3, j = (k + 2) % 3;
    expr Sij = *upper(S, i, j), twice = mul(d, graph_const(d->g, 2.0), c);
    expr t = add(d, mul(d, s, sub(d, S[i][i], S[j][j])), mul(d, twice, Sij));
    expr x[3];

    S[i][i] = sub(d, S[i][i], mul(d, s, t));
    S[j][j] = add(d, S[j][j], mul(d, s, t));
    *upper(S, i, j) = sub(d, mul(d, c, t), Sij);
    x[i] = *upper(S, i, k);
    x[j] = *upper(S, j, k);
    derive_turn_up(d, k, c, s, x);
    *upper(S, i, k) = x[i];
    *upper(S, j, k) = x[j];
}

/* Rotates a general matrix, H <- Rot H Rot^T, by a turn about k: t = s (hii - hjj) + c (hij + hji),
 * hij' = c t - hji. */
static void turn_matrix(struct derive *d, int k, expr c, expr s, expr H[3][3])
{
    int i = (k + 1) % 3, j = (k + 2) % 3;
    expr t = add(d, mul(d, s, sub(d, H[i][i], H[j][j])), mul(d, c, add(d, H[i][j], H[j][i])));
    expr Hij = H[i][j], ct = mul(d, c, t), x[3];

    H[i][i] = sub(d, H[i][i], mul(d, s, t));
    H[j][j] = add(d, H[j][j], mul(d, s, t));
    H[i][j] = sub(d, ct, H[j][i]);
    H[j][i] = sub(d, ct, Hij);
    x[i] = H[i][k];
    x[j] = H[j][k];
    derive_turn_up(d, k, c, s, x);
    H[i][k] = x[i];
    H[j][k] = x[j];
    derive_turn_up(d, k, c, s, H[k]);
}

void derive_turn_inertia(struct derive *d, int k, expr c, expr s, struct state *A)
{
    turn_symmetric(d, k, c, s, A->J);
    turn_matrix(d, k, c, s, A->H);
    turn_symmetric(d, k, c, s, A->M);
}

/* Moves the reference point by -way along axis k: H' = H + [r] M, J' = J + [r] H^T - H' [r]. */
void derive_shift_inertia(struct derive *d, int k, expr way, struct state *A)
{
    int i = (k + 1) % 3, j = (k + 2) % 3;
    expr H[3][3];

    if (way == EXPR_ZERO) {
        return;
    }
    memcpy(H, A->H, sizeof H);
    for (int m = 0; m < 3; m++) {
        A->H[i][m] = sub(d, H[i][m], mul(d, way, *upper(A->M, j, m)));
        A->H[j][m] = add(d, H[j][m], mul(d, way, *upper(A->M, i, m)));
    }
    A->J[i][i] = sub(d, A->J[i][i], mul(d, way, add(d, H[i][j], A->H[i][j])));
    A->J[j][j] = add(d, A->J[j][j], mul(d, way, add(d, H[j][i], A->H[j][i])));
    add_to(d, upper(A->J, i, j), mul(d, way, sub(d, A->H[i][i], H[j][j])));
    add_to(d, upper(A->J, i, k), expr_neg(mul(d, way, H[k][j])));
    add_to(d, upper(A->J, j, k), mul(d, way, H[k][i]));
}

expr *derive_inertia_element(struct state *A, int a, int b)
{
    if (a > b) {
        int swap = a;

        a = b;
        b = swap;
    }
    if (b < 3) {
        return &A->J[a][b];
    }
    return a < 3 ? &A->H[a][b - 3] : &A->M[a - 3][b - 3];
}

/* Transforms the added inertia of an observed body into its working frame. */
static void given_inertia(struct derive *d, int body, struct state *A)
{
    const double *align = d->tree->body[body].align;
    int index = 21 * d->observed[body];
    expr in[6][6], half[6][6];

    /* Read the upper triangle by rows, as in struct added_inertia */
    for (int row = 0; row < 6; row++) {
        for (int column = row; column < 6; column++) {
            in[row][column] = in[column][row] = graph_input(d->g, DERIVE_ADDED, 1, &index);
            index++;
        }
    }

    /* Rotate each 3x3 block B to align^T B align. In the input the linear rows come first */
    for (int row = 0; row < 6; row++) {
        derive_apply_transposed(d, align, in[row], half[row]);
        derive_apply_transposed(d, align, in[row] + 3, half[row] + 3);
    }
    for (int column = 0; column < 3; column++) {
        expr x[3][3], y[3][3];

        for (int m = 0; m < 3; m++) {
            x[0][m] = half[3 + m][3 + column];
            x[1][m] = half[3 + m][column];
            x[2][m] = half[m][column];
        }
        for (int block = 0; block < 3; block++) {
            derive_apply_transposed(d, align, x[block], y[block]);
        }
        for (int m = 0; m < 3; m++) {
            A->J[m][column] = y[0][m];
            A->H[m][column] = y[1][m];
            A->M[m][column] = y[2][m];
        }
    }

    /* Move the reference point from the body's origin to the working frame's origin */
    for (int m = 0; m < 3; m++) {
        derive_shift_inertia(d, m, graph_const(d->g, d->tree->body[body].at[m]), A);
    }
}

void derive_add_given_inertia(struct derive *d, size_t group)
{
    const struct tree_group *lanes = &d->tree->group[group];
    struct state given[TREE_LANES];
    bool any = false;

    memset(given, 0, sizeof given);
    for (int l = 0; l < lanes->width; l++) {
        if (d->observed[lanes->body[l]] >= 0) {
            given_inertia(d, lanes->body[l], &given[l]);
            any = true;
        }
    }

    /* Add all lanes at once. Bodies that are not observed add zero */
    for (int a = 0; any && a < 6; a++) {
        for (int b = a; b < 6; b++) {
            expr lane[TREE_LANES];

            for (int l = 0; l < lanes->width; l++) {
                lane[l] = *derive_inertia_element(&given[l], a, b);
            }
            add_to(d, derive_inertia_element(&d->state[group], a, b),
                   graph_pack(d->g, lanes->width, lane));
        }
    }
}
