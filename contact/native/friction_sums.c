/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sums over springs for sticking friction (stiction), LANES at a time: the sums without friction of
 * springs that all push in one direction, and the friction of each spring's bristles.
 */
#include "contact/native/friction_sums.h"

#include "contact/native/friction.h"
#include "contact/native/moments_sum.h"

/* ---- springs that all push in one direction ---- */

enum { WEIGHTS_MAX = 136 }; /* springs at a time; not a large power of two, see BATCH_MAX */

/* Weights of springs for their moments: normal force (N), stiffness (N/m) and damping (N s/m) along
 * the normal. */
struct weights {
    _Alignas(64) double normal[WEIGHTS_MAX];
    _Alignas(64) double stiffness[WEIGHTS_MAX];
    _Alignas(64) double damping[WEIGHTS_MAX];
};

/* Computes the weights of n springs from start on, which all push along d. Adds their energies to
 * sum. */
static void find_weights(const struct native_batch *b, size_t start, size_t n, const double d[3],
                         const struct native_law *law, const struct native_relative *relative,
                         struct weights *out, struct native_sum *sum)
{
    const double leaving_at_0 = vec3_dot(relative->v, d), c = law->dissipation;
    const lanes zero = {0};
    lanes potential = zero, power = zero, elastic = zero;
    double slope[3]; /* gradient of the separation speed */

    /* The separation speed (v + w x p) . d = v . d + (d x w) . p is linear in the point p */
    vec3_cross(d, relative->w, slope);
    for (size_t i = 0; i < n; i += LANES) {
        const size_t at = start + i;
        lanes force = lanes_load(b->force + at);
        lanes leaving = leaving_at_0 +
                        (slope[0] * lanes_load(b->p[0] + at) + slope[1] * lanes_load(b->p[1] + at) +
                         slope[2] * lanes_load(b->p[2] + at));
        lanes share = 1 - c * leaving; /* factor of the elastic force; springs never pull */
        lanes_mask pushes = lanes_less(zero, share);
        lanes normal;

        share = lanes_pick(pushes, share, zero);
        normal = force * share;
        lanes_store(normal, out->normal + i);
        lanes_store(lanes_load(b->rate + at) * share, out->stiffness + i);
        lanes_store(lanes_pick(pushes, c * force, zero), out->damping + i);
        potential += force * lanes_load(b->depth + at);
        power += (force - normal) * leaving;
        elastic += force;
    }
    sum->gather->elastic += lanes_sum(elastic);
    sum->potential += lanes_sum(potential) / 2;
    sum->power += lanes_sum(power);
}

void native_gather_add(const struct moments *f, const double d[3], struct native_sum *sum)
{
    struct native_gather *out = sum->gather;
    double moment[3];

    vec3_cross(f->first, d, moment);
    sum->normal += f->zeroth;
    for (int k = 0; k < 3; k++) {
        sum->force[k] += f->zeroth * d[k];
        sum->moment[k] += moment[k];
        sum->lever[k] += f->first[k];
        out->along[k] += f->zeroth * d[k];
    }
    for (int k = 0; k < 6; k++) {
        out->second[k] += f->second[k];
    }
}

void friction_sums_gather(const struct native_batch *b, const struct native_law *law,
                          const struct native_relative *relative, struct native_sum *sum)
{
    struct moments normal = {.zeroth = 0};
    struct weights weights;
    size_t n;

    if (b->start == b->n) {
        return;
    }

    const double d[3] = {b->d[0][b->start], b->d[1][b->start], b->d[2][b->start]};

    for (size_t start = b->start; start < b->n; start += n) {
        const double *const p[3] = {b->p[0] + start, b->p[1] + start, b->p[2] + start};

        /* Computes the moments of normal force and area, and of stiffness and damping for the
         * tangent */
        n = b->n - start < WEIGHTS_MAX ? b->n - start : WEIGHTS_MAX;
        find_weights(b, start, n, d, law, relative, &weights, sum);
        moments_add_springs(p, weights.normal, n, &normal);
        moments_add_springs(p, weights.stiffness, n, &sum->gather->stiffness);
        moments_add_springs(p, weights.damping, n, &sum->gather->damping);
        moments_add_springs(p, b->rate + start, n, &sum->gather->area);
    }
    native_gather_add(&normal, d, sum);
}

/* ---- friction ---- */

/* keeps: adds the friction of the springs. Otherwise computes only its utilization (held, most,
 * open). keeps is a constant in each call, so that the compiler makes two loops. */
LANES_INLINE void hold_springs(const struct native_batch *b, const struct native_law *law,
                               const struct native_relative *relative, const bool keeps,
                               struct native_sum *sum)
{
    struct sticking_patch *patch = sum->sticking;
    const lanes zero = {0};
    lanes force[3] = {zero, zero, zero}, moment[3] = {zero, zero, zero};
    lanes power = zero, held = zero, most = zero, open = zero;

    for (size_t i = b->start; i < b->n; i += LANES) {
        struct friction_spring s;
        struct friction_bend bend;
        lanes f[3], size, bears;
        lanes_mask below;

        friction_load_spring(b, i, law, relative, &s);
        friction_find_bend(&s, law, patch, &bend);

        /* Adds the friction force opposite to the bend, its moment and its power */
        if (keeps) {
            for (int k = 0; k < 3; k++) {
                f[k] = bend.stiffness * bend.e[k];
                force[k] -= f[k];
                power += f[k] * s.u[k];
            }
            moment[0] -= s.p[1] * f[2] - s.p[2] * f[1];
            moment[1] -= s.p[2] * f[0] - s.p[0] * f[2];
            moment[2] -= s.p[0] * f[1] - s.p[1] * f[0];
        }

        /* Adds the utilization of the friction limit by the bristles without their damping */
        size = lanes_root(bend.square);
        bears = bend.share * size;
        below = lanes_less(bears, bend.limit);
        held += lanes_pick(below, bears, bend.limit) * size;
        most += bend.limit * size;
        open += lanes_pick(below, bend.share * bend.square, zero);
    }

    for (int k = 0; k < 3 && keeps; k++) {
        sum->force[k] += lanes_sum(force[k]);
        sum->moment[k] += lanes_sum(moment[k]);
    }
    patch->power += lanes_sum(power);
    patch->held += lanes_sum(held);
    patch->most += lanes_sum(most);
    patch->open += lanes_sum(open);
}

void friction_sums_hold(const struct native_batch *b, const struct native_law *law,
                        const struct native_relative *relative, struct native_sum *sum)
{
    if (sum->sticking->keeps) {
        hold_springs(b, law, relative, true, sum);
    } else {
        hold_springs(b, law, relative, false, sum);
    }
}
