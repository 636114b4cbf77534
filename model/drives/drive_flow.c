/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Computes the matrix exponential of a drive minus the identity, by scaling, Taylor series and
 * doubling: with E = exp(M t) - 1, doubling the time is E <- 2 E + E E. Without the identity, small
 * changes keep their digits: the angle of a fixed rotor (inertia 1e30) changes by zero.
 */
#include "model/drives/drive_flow.h"

#include <math.h>
#include <string.h>

/* Number of terms of the series, enough for rounding accuracy at a norm of 1/4. Largest number of
 * doublings: after more, the initial state has no effect, because exp(-2^60) is zero. */
enum { SERIES_TERMS = 13, DOUBLINGS_MAX = 60 };

/* Rows of the states, in columns of states and constant inputs. The rows of the constant inputs are
 * zero and not stored. A drive at a voltage has the first three states. */
enum { FLOW_STATES = 3 };
typedef double flow_matrix[LOOP_STATES][LOOP_INPUTS];

/* A linear system over a time: n states, m columns. */
struct flow_system {
    int n, m;
    flow_matrix M;
};

/* Fills M with the system's matrix times t, for the states deflection, motor speed and current. */
static void flow_fill_matrix(const struct robot_sea *sea, bool bridge_on, double t,
                             struct flow_system *system)
{
    const double inertia = t / sea->J, winding = bridge_on ? t / sea->L : 0.0;

    *system = (struct flow_system){
        .n = FLOW_STATES,
        .m = FLOW_INPUTS,
        .M = {{0.0, t, 0.0, -t, 0.0},
              {-sea->Ks * inertia, -(sea->Dm + sea->Ds) * inertia, sea->Kt * inertia,
               sea->Ds * inertia, 0.0},
              {0.0, -sea->Kw * winding, -sea->R * winding, 0.0, winding}},
    };
}

/* Returns the row-sum norm of the states' part of a matrix. */
static double flow_norm(const struct flow_system *system)
{
    double norm = 0.0;

    for (int i = 0; i < system->n; i++) {
        double row = 0.0;

        for (int j = 0; j < system->n; j++) {
            row += fabs(system->M[i][j]);
        }
        norm = fmax(norm, row);
    }
    return norm;
}

/* Computes C = A B; the rows of the constant inputs in B are zero. */
static void flow_multiply(const struct flow_system *system, flow_matrix A, flow_matrix B,
                          flow_matrix C)
{
    for (int i = 0; i < system->n; i++) {
        for (int j = 0; j < system->m; j++) {
            double sum = A[i][0] * B[0][j];

            for (int k = 1; k < system->n; k++) {
                sum += A[i][k] * B[k][j];
            }
            C[i][j] = sum;
        }
    }
}

/* Computes E = exp(M) - 1. */
static void flow_exponential(struct flow_system *system, flow_matrix E)
{
    const size_t bytes = sizeof(flow_matrix);
    flow_matrix term, next;
    int doublings = 0;

    /* Scale to a norm of 1/4 by a power of two, which is exact. Balancing the units of angle and
     * speed would only shorten the series */
    for (double norm = flow_norm(system); norm > 0.25 && doublings < DOUBLINGS_MAX; norm *= 0.5) {
        doublings++;
    }
    for (int i = 0; i < system->n; i++) {
        for (int j = 0; j < system->m; j++) {
            system->M[i][j] = ldexp(system->M[i][j], -doublings);
        }
    }

    /* M + M^2/2! + M^3/3! ... */
    memcpy(E, system->M, bytes);
    memcpy(term, system->M, bytes);
    for (int k = 2; k <= SERIES_TERMS; k++) {
        flow_multiply(system, system->M, term, next);
        for (int i = 0; i < system->n; i++) {
            for (int j = 0; j < system->m; j++) {
                term[i][j] = next[i][j] / k;
                E[i][j] += term[i][j];
            }
        }
    }
    for (int d = 0; d < doublings; d++) {
        flow_multiply(system, E, E, next);
        for (int i = 0; i < system->n; i++) {
            for (int j = 0; j < system->m; j++) {
                E[i][j] = 2.0 * E[i][j] + next[i][j];
            }
        }
    }
}

/* Fills a flow from the changes of deflection, speed and current. The motor's angle changes by the
 * deflection's change plus the joint's displacement. */
static void flow_take(flow_matrix E, double t, struct drive_flow *flow)
{
    flow->t = t;
    memcpy(flow->qm, E[0], sizeof flow->qm);
    flow->qm[FLOW_RATE] += t;
    memcpy(flow->qmd, E[1], sizeof flow->qmd);
    memcpy(flow->I, E[2], sizeof flow->I);
}

void drive_flow_make(const struct robot_sea *sea, bool bridge_on, double t, struct drive_flow *flow)
{
    struct flow_system system;
    flow_matrix E;

    flow_fill_matrix(sea, bridge_on, t, &system);
    flow_exponential(&system, E);
    flow_take(E, t, flow);
}

void loop_flow_make(const struct robot_sea *sea, const struct loop_row *row, double t,
                    struct loop_flow *flow)
{
    const double inertia = t / sea->J;
    struct flow_system system = {
        .n = LOOP_STATES,
        .m = LOOP_INPUTS,
        .M = {{0.0, t, 0.0, 0.0, 0.0, -t, 0.0},
              {-sea->Ks * inertia, -(sea->Dm + sea->Ds) * inertia, sea->Kt * inertia, 0.0, 0.0,
               sea->Ds * inertia, 0.0},
              {0.0, -row->speed * t, -row->current * t, row->error * t, row->filter * t, 0.0,
               row->constant * t},
              {0.0, -t},
              {0.0, 0.0, 0.0, 0.0, row->filter_s > 0.0 ? -t / row->filter_s : 0.0}},
    };
    flow_matrix E;

    flow_exponential(&system, E);
    flow->t = t;
    memcpy(flow->qm, E[0], sizeof flow->qm);
    flow->qm[LOOP_RATE] += t;
    memcpy(flow->qmd, E[1], sizeof flow->qmd);
    memcpy(flow->I, E[2], sizeof flow->I);
}

/* The changes x of the three states satisfy x = M (input + x), hence (1 - M) x = M input.
 * Eliminates the current first, then the deflection; the remaining pivot is positive for any
 * passive drive. */
void drive_flow_make_implicit(const struct robot_sea *sea, bool bridge_on, double t, double scale,
                              struct drive_flow *flow)
{
    struct flow_system system;
    flow_matrix E;

    flow_fill_matrix(sea, bridge_on, t, &system);
    for (int k = 0; k < FLOW_INPUTS; k++) {
        double(*M)[LOOP_INPUTS] = system.M;
        const double winding = 1.0 - M[2][2];
        const double pivot = 1.0 - M[1][1] - M[1][0] * M[0][1] - M[1][2] * M[2][1] / winding;

        E[1][k] = (M[1][k] + M[1][0] * M[0][k] + M[1][2] * M[2][k] / winding) / pivot;
        E[0][k] = M[0][k] + M[0][1] * E[1][k];
        E[2][k] = (M[2][k] + M[2][1] * E[1][k]) / winding;
    }
    for (int i = 0; i < FLOW_STATES; i++) {
        for (int k = 0; k < FLOW_INPUTS; k++) {
            E[i][k] *= scale;
        }
    }
    flow_take(E, scale * t, flow);
}
