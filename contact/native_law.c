/* SPDX-License-Identifier: Apache-2.0 */
/* The contact law, four points at a time. */
#include "contact/native_law.h"

#include "contact/lanes.h"
#include "contact/tangent.h"
#include "contact/vec.h"

#include <float.h>

/* 10 x^3 - 15 x^4 + 6 x^5 over x^2 */
LANES_INLINE lanes step_over_square(lanes x)
{
    return x * (10 - x * (15 - 6 * x));
}

/* The coefficient of friction over the sliding velocity v, finite at rest. */
LANES_INLINE lanes friction_over_speed(lanes v, const struct native_law *law)
{
    lanes u = v * law->transition_inverse;
    lanes t = (u - 1) * 0.5;
    lanes sticking, sliding, zero = {0}, one = zero + 1;

    t = lanes_pick(lanes_less(t, one), t, one);
    t = lanes_pick(lanes_less(zero, t), t, zero);
    sticking = law->us * law->transition_inverse * (u * (10 - u * (15 - 6 * u)) * u);
    sliding = (law->us - (law->us - law->ud) * (t * t * step_over_square(t))) / (v + DBL_MIN);
    return lanes_pick(lanes_less(u, one), sticking, sliding) + law->uv;
}

static void pad(struct native_batch *b)
{
    for (; b->n % LANES; ++b->n) {
        for (int k = 0; k < 3; ++k) {
            b->p[k][b->n] = b->d[k][b->n] = 0;
        }
        b->force[b->n] = b->depth[b->n] = b->rate[b->n] = 0;
    }
}

FOR_EACH_ISA
static void add_forces(const struct native_batch *batch, const struct native_law *law,
                       const struct native_relative *relative, struct native_sum *sum)
{
    const double *w = relative->w, *v = relative->v;
    lanes zero = {0}, force[3] = {zero, zero, zero}, moment[3] = {zero, zero, zero};
    lanes lever[3] = {zero, zero, zero}, normal = zero, potential = zero, power = zero;

    for (size_t i = 0; i < batch->n; i += LANES) {
        lanes px = lanes_load(batch->p[0] + i), py = lanes_load(batch->p[1] + i),
              pz = lanes_load(batch->p[2] + i);
        lanes dx = lanes_load(batch->d[0] + i), dy = lanes_load(batch->d[1] + i),
              dz = lanes_load(batch->d[2] + i);
        lanes f = lanes_load(batch->force + i), depth = lanes_load(batch->depth + i);

        /* the first body's velocity against the second's */
        lanes ux = v[0] + (w[1] * pz - w[2] * py);
        lanes uy = v[1] + (w[2] * px - w[0] * pz);
        lanes uz = v[2] + (w[0] * py - w[1] * px);
        lanes leaving = ux * dx + uy * dy + uz * dz;

        lanes fn = f * (1 - law->dissipation * leaving);
        lanes_mask pushes = lanes_less(zero, fn);

        fn = lanes_pick(pushes, fn, zero);
        f = lanes_pick(pushes, f, zero);

        /* friction against what is left of it across the normal */
        ux -= leaving * dx;
        uy -= leaving * dy;
        uz -= leaving * dz;

        lanes v2 = ux * ux + uy * uy + uz * uz;
        lanes drag = fn * friction_over_speed(lanes_root(v2), law);
        lanes fx = fn * dx - drag * ux;
        lanes fy = fn * dy - drag * uy;
        lanes fz = fn * dz - drag * uz;

        force[0] += fx;
        force[1] += fy;
        force[2] += fz;
        moment[0] += py * fz - pz * fy;
        moment[1] += pz * fx - px * fz;
        moment[2] += px * fy - py * fx;
        normal += fn;
        lever[0] += fn * px;
        lever[1] += fn * py;
        lever[2] += fn * pz;
        potential += f * depth;
        power += f * law->dissipation * (leaving * leaving) + drag * v2;
    }
    for (int k = 0; k < 3; ++k) {
        sum->force[k] += lanes_sum(force[k]);
        sum->moment[k] += lanes_sum(moment[k]);
        sum->lever[k] += lanes_sum(lever[k]);
    }
    sum->normal += lanes_sum(normal);
    sum->potential += lanes_sum(potential) / 2;
    sum->power += lanes_sum(power);
}

/* What the springs of a batch add to a tangent: along the normal to K and D, and across it to D. */
struct resistance {
    _Alignas(64) double stiffness[BATCH_MAX];
    _Alignas(64) double damping[BATCH_MAX];  /* along the normal, less friction */
    _Alignas(64) double friction[BATCH_MAX]; /* in all directions */
};

static void find_resistance(const struct native_batch *b, const struct native_law *law,
                            const struct native_relative *relative, struct resistance *out)
{
    for (size_t i = 0; i < b->n; ++i) {
        const double p[3] = {b->p[0][i], b->p[1][i], b->p[2][i]};
        const double d[3] = {b->d[0][i], b->d[1][i], b->d[2][i]};
        double u[3], leaving, pushes;

        vec_cross(relative->w, p, u);
        vec_madd(u, 1, relative->v, u);
        leaving = vec_dot(u, d);
        vec_madd(u, -leaving, d, u);
        pushes = 1 - law->dissipation * leaving;
        pushes = pushes > 0 ? pushes : 0;
        out->stiffness[i] = b->rate[i] * pushes;
        out->friction[i] = contact_friction_damping(law->us, law->uv, 1 / law->transition_inverse,
                                                    b->force[i] * pushes, vec_norm(u));
        out->damping[i] = (pushes > 0 ? law->dissipation * b->force[i] : 0) - out->friction[i];
    }
}

FOR_EACH_ISA
static void add_tangents(const struct native_batch *b, const struct resistance *by,
                         struct contact_tangent *tangent)
{
    lanes K[21] = {{0}}, D[21] = {{0}}, f = {0}, fr[3] = {{0}}, frr[6] = {{0}};

    for (size_t i = 0; i < b->n; i += LANES) {
        lanes r[3], w[6];
        lanes stiffness = lanes_load(by->stiffness + i), damping = lanes_load(by->damping + i);
        lanes friction = lanes_load(by->friction + i);

        for (int k = 0; k < 3; ++k) {
            r[k] = lanes_load(b->p[k] + i) - tangent->center[k];
            w[k] = lanes_load(b->d[k] + i);
        }
        w[3] = r[1] * w[2] - r[2] * w[1];
        w[4] = r[2] * w[0] - r[0] * w[2];
        w[5] = r[0] * w[1] - r[1] * w[0];
        for (int row = 0, at = 0; row < 6; ++row) {
            for (int column = row; column < 6; ++column, ++at) {
                lanes ww = w[row] * w[column];

                K[at] += stiffness * ww;
                D[at] += damping * ww;
            }
        }
        f += friction;
        for (int row = 0, at = 0; row < 3; ++row) {
            fr[row] += friction * r[row];
            for (int column = row; column < 3; ++column, ++at) {
                frr[at] += friction * r[row] * r[column];
            }
        }
    }
    for (int at = 0; at < 21; ++at) {
        tangent->K[at] += lanes_sum(K[at]);
        tangent->D[at] += lanes_sum(D[at]);
    }

    /* friction f against the velocity v + w x r at r: the identity, the cross product with r, and
     * r^2 less the outer product of r; rows of the upper triangle */
    double s = lanes_sum(f), x = lanes_sum(fr[0]), y = lanes_sum(fr[1]), z = lanes_sum(fr[2]);
    double xx = lanes_sum(frr[0]), xy = lanes_sum(frr[1]), xz = lanes_sum(frr[2]);
    double yy = lanes_sum(frr[3]), yz = lanes_sum(frr[4]), zz = lanes_sum(frr[5]);
    const double across[21] = {s, 0, 0,  0, z,       -y,  s,   0,       -z,  0,      x,
                               s, y, -x, 0, yy + zz, -xy, -xz, xx + zz, -yz, xx + yy};

    for (int at = 0; at < 21; ++at) {
        tangent->D[at] += across[at];
    }
}

void native_law_sum(struct native_batch *batch, const struct native_law *law,
                    const struct native_relative *relative, struct native_sum *sum)
{
    struct resistance by;

    pad(batch);
    if (sum->tangent) {
        find_resistance(batch, law, relative, &by);
        add_tangents(batch, &by, sum->tangent);
    } else {
        add_forces(batch, law, relative, sum);
    }
    batch->n = 0;
}
