/* SPDX-License-Identifier: Apache-2.0 */
/* Functions that all implementations of the dynamics share. */
#include "model/dynamics.h"

#include "model/spatial.h"

void dynamics_qdot(const struct robot *robot, const double *q, const double *v, double *qdot)
{
    size_t nq0 = robot->nq - robot->njoint, nv0 = robot->nv - robot->njoint;

    if (robot->floating) {
        double R[9];
        const double *e = q + BASE_Q_QUATERNION, *w = v + BASE_V_ANGULAR;
        double *rate = qdot + BASE_Q_QUATERNION;

        /* The base: velocity in the world's axes; the quaternion's rate is half its product with
         * (0, w) */
        mat3_from_quaternion(e, R);
        mat3_apply(R, v + BASE_V_LINEAR, qdot + BASE_Q_POSITION);
        rate[0] = 0.5 * (-e[1] * w[0] - e[2] * w[1] - e[3] * w[2]);
        rate[1] = 0.5 * (e[0] * w[0] + e[2] * w[2] - e[3] * w[1]);
        rate[2] = 0.5 * (e[0] * w[1] + e[3] * w[0] - e[1] * w[2]);
        rate[3] = 0.5 * (e[0] * w[2] + e[1] * w[1] - e[2] * w[0]);
    }
    for (size_t j = 0; j < robot->njoint; j++) {
        qdot[nq0 + j] = v[nv0 + j];
    }
}
