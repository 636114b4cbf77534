/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Closed forms over a facet below a plane. A spring has the point p, the depth D and the damping
 * factor S = 1 - c v. All are linear in x and y along the facet's axes. So the weights of a spring
 * (normal force k D S, stiffness k S, damping k c D, rate k) have at most degree two. Their moments
 * up to the second are sums over struct facet_moments. The four weights are the lanes.
 */
#include "contact/native/facet_below_plane.h"

#include "contact/lanes.h"
#include "contact/native/friction_sums.h"

/* Lanes: the weights of a spring. */
enum { WEIGHT_NORMAL, WEIGHT_STIFFNESS, WEIGHT_DAMPING, WEIGHT_AREA };

/* Rows of struct facet_moments. */
enum { POWER_1, POWER_X, POWER_Y, POWER_XX, POWER_XY, POWER_YY };

struct facet_linear facet_below_plane_depth(const struct solid *solid, const struct facet *facet,
                                            const double n[3], double height, double *deepest,
                                            double *shallowest)
{
    const struct facet_linear depth = {
        height - vec3_dot(n, facet->center),
        {-vec3_dot(n, facet->axis[0]), -vec3_dot(n, facet->axis[1])},
    };
    const double *x = solid->outline[0] + facet->outline, *y = solid->outline[1] + facet->outline;
    lanes most = {0}, least;

    /* The repeated first corner in the padding does not change the result */
    most += depth.center + depth.slope[0] * x[0] + depth.slope[1] * y[0];
    least = most;
    for (int i = 0; i < facet->count; i += LANES) {
        lanes at = depth.center + depth.slope[0] * lanes_load_any(x + i) +
                   depth.slope[1] * lanes_load_any(y + i);

        most = lanes_pick(lanes_less(most, at), at, most);
        least = lanes_pick(lanes_less(at, least), at, least);
    }
    *deepest = -lanes_least(-most);
    *shallowest = lanes_least(least);
    return depth;
}

/* Computes the moments of the weights along the facet's axes, from the integrals of products of
 * powers. */
static void weigh_facet(const struct facet_moments *moments, const struct facet_linear *depth,
                        const struct facet_linear *share, double k, double c,
                        lanes weight[FACET_POWERS])
{
    const double D = k * depth->center, Dx = k * depth->slope[0], Dy = k * depth->slope[1];
    const double S = share->center, Sx = share->slope[0], Sy = share->slope[1];
    const lanes by[FACET_POWERS] = {
        [POWER_1] = {D * S, k * S, c * D, k},
        [POWER_X] = {D * Sx + Dx * S, k * Sx, c * Dx, 0},
        [POWER_Y] = {D * Sy + Dy * S, k * Sy, c * Dy, 0},
        [POWER_XX] = {Dx * Sx, 0, 0, 0},
        [POWER_XY] = {Dx * Sy + Dy * Sx, 0, 0, 0},
        [POWER_YY] = {Dy * Sy, 0, 0, 0},
    };

    for (int i = 0; i < FACET_POWERS; i++) {
        lanes sum = {0};

#pragma GCC unroll 6
        for (int m = 0; m < FACET_POWERS; m++) {
            sum += by[m] * moments->of[m][i];
        }
        weight[i] = sum;
    }
}

/* Adds one lane of the weights' moments to the moments of one weight. */
static void add_lane(const double zeroth[LANES], const double first[3][LANES],
                     const double second[6][LANES], int lane, struct moments *m)
{
    m->zeroth += zeroth[lane];
    for (int k = 0; k < 3; k++) {
        m->first[k] += first[k][lane];
    }
    for (int k = 0; k < 6; k++) {
        m->second[k] += second[k][lane];
    }
}

/* Transforms the moments of the weights to space and adds them. Springs are at origin + x ax + y
 * ay. */
static void add_in_space(const lanes weight[FACET_POWERS], const double origin[3],
                         const double ax[3], const double ay[3], const double n[3],
                         struct native_sum *sum)
{
    _Alignas(32) double zeroth[LANES], first[3][LANES], second[6][LANES];
    struct native_gather *out = sum->gather;
    struct moments normal = {.zeroth = 0};
    int at = 0;

    lanes_store(weight[POWER_1], zeroth);
    for (int i = 0; i < 3; i++) {
        const lanes to_x = ax[i] * weight[POWER_XX] + ay[i] * weight[POWER_XY];
        const lanes to_y = ax[i] * weight[POWER_XY] + ay[i] * weight[POWER_YY];
        const lanes to_1 =
            origin[i] * weight[POWER_1] + ax[i] * weight[POWER_X] + ay[i] * weight[POWER_Y];

        lanes_store(to_1, first[i]);
        for (int j = i; j < 3; j++, at++) {
            lanes_store(origin[j] * to_1 + ax[j] * (origin[i] * weight[POWER_X] + to_x) +
                            ay[j] * (origin[i] * weight[POWER_Y] + to_y),
                        second[at]);
        }
    }
    add_lane(zeroth, first, second, WEIGHT_NORMAL, &normal);
    add_lane(zeroth, first, second, WEIGHT_STIFFNESS, &out->stiffness);
    add_lane(zeroth, first, second, WEIGHT_DAMPING, &out->damping);
    add_lane(zeroth, first, second, WEIGHT_AREA, &out->area);
    native_gather_add(&normal, n, sum);
}

bool facet_below_plane_gather(const struct solid *solid, const struct facet *facet,
                              const struct facet_linear *depth, const double n[3], double pressure,
                              const struct native_law *law, const struct native_relative *relative,
                              struct native_sum *sum)
{
    const struct facet_moments *moments = &solid->moments[facet->moments];

    /* Compute the separation speed of the surfaces, linear over the facet: (v + w x p) . n = v . n
     * + (n x w) . p. The extent of a spring along n does not change it. */
    double turn[3];

    vec3_cross(n, relative->w, turn);
    const struct facet_linear leaving = {
        vec3_dot(relative->v, n) + vec3_dot(turn, facet->center),
        {vec3_dot(turn, facet->axis[0]), vec3_dot(turn, facet->axis[1])},
    };
    const double c = law->dissipation, *slope = leaving.slope;
    const struct facet_linear share = {1 - c * leaving.center, {-c * slope[0], -c * slope[1]}};
    const double change =
        facet->radius * sqrt(share.slope[0] * share.slope[0] + share.slope[1] * share.slope[1]);
    lanes weight[FACET_POWERS];
    double origin[3], axis[2][3];

    if (!(share.center > change && depth->center > 0)) {
        return false;
    }

    /* Points of action are off the facet toward the plane by its share of the depth */
    for (int k = 0; k < 3; k++) {
        const double way = law->share[0] * n[k];

        origin[k] = facet->center[k] + way * depth->center;
        axis[0][k] = facet->axis[0][k] + way * depth->slope[0];
        axis[1][k] = facet->axis[1][k] + way * depth->slope[1];
    }
    weigh_facet(moments, depth, &share, pressure, c, weight);
    add_in_space(weight, origin, axis[0], axis[1], n, sum);

    /* Add the elastic forces and energies of the springs to sum: stored k D^2 / 2, dissipated power
     * k D c v^2 */
    const double x = leaving.slope[0], y = leaving.slope[1], at = leaving.center;
    const double square[FACET_POWERS] = {at * at, 2 * at * x, 2 * at * y, x * x, 2 * x * y, y * y};
    double force[FACET_POWERS], power = 0;

    for (int i = 0; i < FACET_POWERS; i++) {
        force[i] = pressure * (depth->center * moments->of[POWER_1][i] +
                               depth->slope[0] * moments->of[POWER_X][i] +
                               depth->slope[1] * moments->of[POWER_Y][i]);
        power += square[i] * force[i];
    }
    sum->gather->elastic += force[POWER_1];
    sum->potential += (depth->center * force[POWER_1] + depth->slope[0] * force[POWER_X] +
                       depth->slope[1] * force[POWER_Y]) /
                      2;
    sum->power += c * power;
    return true;
}
