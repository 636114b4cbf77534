/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The contact law of contact.h over the springs of a pair, LANES at a time: normal force with
 * dissipation (penalty method), regularized friction, stored and dissipated energy, and the
 * tangents (stiffness and damping matrices) for implicit integration. Sticking friction (stiction)
 * is in friction_sticking.c and friction_sums.c.
 */
#include "contact/native/law.h"

#include "contact/lanes.h"
#include "contact/native/friction.h"
#include "contact/native/narrow_phase.h"
#include "contact/native/stick.h"
#include "contact/native/moments_sum.h"
#include "base/vec3.h"

/* Pads the batch to a full set of lanes with springs that exert no force. */
static void batch_pad(struct native_batch *b)
{
    for (; b->n % LANES; ++b->n) {
        for (int k = 0; k < 3; k++) {
            b->p[k][b->n] = b->d[k][b->n] = 0;
        }
        b->force[b->n] = b->depth[b->n] = b->rate[b->n] = 0;
    }
}

/* Computes normal force and regularized friction of each spring (contact.h). Adds force, moment
 * about the frame's origin, sums for the center of pressure, and energies to sum. */
static void law_add_forces(const struct native_batch *batch, const struct native_law *law,
                           const struct native_relative *relative, struct native_sum *sum)
{
    const double *w = relative->w, *v = relative->v;
    lanes zero = {0}, force[3] = {zero, zero, zero}, moment[3] = {zero, zero, zero};
    lanes lever[3] = {zero, zero, zero}, normal = zero, potential = zero, power = zero;

    for (size_t i = batch->start; i < batch->n; i += LANES) {
        lanes px = lanes_load(batch->p[0] + i), py = lanes_load(batch->p[1] + i),
              pz = lanes_load(batch->p[2] + i);
        lanes dx = lanes_load(batch->d[0] + i), dy = lanes_load(batch->d[1] + i),
              dz = lanes_load(batch->d[2] + i);
        lanes f = lanes_load(batch->force + i), depth = lanes_load(batch->depth + i);

        /* Velocity of the first body relative to the second at the spring, and its component along
         * the normal: the rate x' of the penetration depth is -leaving */
        lanes ux = v[0] + (w[1] * pz - w[2] * py);
        lanes uy = v[1] + (w[2] * px - w[0] * pz);
        lanes uz = v[2] + (w[0] * py - w[1] * px);
        lanes leaving = ux * dx + uy * dy + uz * dz;

        /* Normal force f (1 + c x'): elastic with damping, never negative */
        lanes fn = f * (1 - law->dissipation * leaving);
        lanes_mask pushes = lanes_less(zero, fn);

        fn = lanes_pick(pushes, fn, zero);

        /* Friction force against the sliding velocity, the component across the normal */
        ux -= leaving * dx;
        uy -= leaving * dy;
        uz -= leaving * dz;

        lanes v2 = ux * ux + uy * uy + uz * uz;
        lanes drag = fn * friction_over_speed(lanes_root(v2), law);
        lanes fx = fn * dx - drag * ux;
        lanes fy = fn * dy - drag * uy;
        lanes fz = fn * dz - drag * uz;

        /* Sums: force, moment p x f, center of pressure (lever over normal), stored and dissipated
         * energy */
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
        power += (f - fn) * leaving + drag * v2;
    }

    /* Adds up the lanes; half of force times depth is stored */
    for (int k = 0; k < 3; k++) {
        sum->force[k] += lanes_sum(force[k]);
        sum->moment[k] += lanes_sum(moment[k]);
        sum->lever[k] += lanes_sum(lever[k]);
    }
    sum->normal += lanes_sum(normal);
    sum->potential += lanes_sum(potential) / 2;
    sum->power += lanes_sum(power);
}

/* ---- tangents ---- */

#define RESISTANCE_MAX 136 /* springs at a time; not a large power of two, see BATCH_MAX */

/* Stiffness and damping that springs add to a tangent, and their points of action, along the axes
 * of the world frame. */
struct resistance {
    size_t n;
    _Alignas(64) double arm[3][RESISTANCE_MAX];    /* from the tangent's center, m */
    _Alignas(64) double stiffness[RESISTANCE_MAX]; /* along the normal, N/m */
    _Alignas(64) double damping
        [RESISTANCE_MAX]; /* along the normal, minus regularized friction, N s/m */
    _Alignas(64) double friction[RESISTANCE_MAX]; /* damping in all directions, N s/m */
    /* The normal n and its moment arm x n, for springs with individual directions */
    _Alignas(64) double along[CONTACT_AXES][RESISTANCE_MAX];
};

/* Returns the product of one row of a rotation matrix and a vector. */
LANES_INLINE lanes lanes_turn(const double row[3], const lanes v[3])
{
    return row[0] * v[0] + row[1] * v[1] + row[2] * v[2];
}

/* Returns the stiffness over bend of the bristles at the springs from `from` on: friction force
 * over e of contact.h. Reads it from the batch, or computes it again if the batch had no room. */
LANES_INLINE lanes bristle_stiffness(const struct native_batch *b, size_t from,
                                     const struct native_law *law,
                                     const struct native_relative *relative,
                                     const struct native_grip *grip)
{
    struct friction_spring spring;
    struct friction_bend bend;

    if (!b->full) {
        return lanes_load(b->held + from);
    }
    friction_load_spring(b, from, law, relative, &spring);
    friction_find_bend(&spring, law, grip, &bend);
    return bend.stiffness;
}

/* Computes stiffness, damping and points of action of the springs from start on, as many as there
 * is room for. The damping of regularized friction comes from contact_friction_damping. The
 * damping of bristles is their stiffness times the time by which they follow the velocity. */
static void law_find_resistance(const struct native_batch *b, size_t start,
                                const struct native_law *law,
                                const struct native_relative *relative,
                                const struct native_sum *sum, struct resistance *out)
{
    const double *w = relative->w, *v = relative->v, *center = sum->tangent->center;
    const double scale = law->us * law->transition_inverse;
    const lanes zero = {0};
    const double apart =
        sum->grip ? 1 - sum->grip->whole : 0; /* share that each spring bears by itself */
    const double follow = sum->grip ? apart * sum->grip->root * sum->grip->follow_s : 0;

    out->n = b->n - start < RESISTANCE_MAX ? b->n - start : RESISTANCE_MAX;
    for (size_t i = 0; i < out->n; i += LANES) {
        const size_t from = start + i;
        lanes p[3], d[3], u[3], pushes, slope, friction;
        lanes force = lanes_load(b->force + from);

        for (int k = 0; k < 3; k++) {
            p[k] = lanes_load(b->p[k] + from);
            d[k] = lanes_load(b->d[k] + from);
        }

        /* Relative velocity of the first body against the second along the normal */
        u[0] = v[0] + (w[1] * p[2] - w[2] * p[1]);
        u[1] = v[1] + (w[2] * p[0] - w[0] * p[2]);
        u[2] = v[2] + (w[0] * p[1] - w[1] * p[0]);
        lanes leaving = u[0] * d[0] + u[1] * d[1] + u[2] * d[2];

        /* Factor of the elastic force with dissipation, 0 if the surfaces part fast; and the
         * damping of no, sticking or regularized friction */
        pushes = 1 - law->dissipation * leaving;
        pushes = lanes_pick(lanes_less(zero, pushes), pushes, zero);
        if (sum->grip && !(apart > 0)) {
            friction = zero;
        } else if (sum->grip) {
            friction = follow * bristle_stiffness(b, from, law, relative, sum->grip);
        } else {
            for (int k = 0; k < 3; k++) {
                u[k] -= leaving * d[k];
            }
            slope = friction_slope_bound(lanes_root(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]), law);
            friction = (slope * scale + law->uv) * (force * pushes);
        }

        /* Friction damps in all directions, so its part along the normal is subtracted; for
         * bristles, tangent_add_bristles subtracts it */
        lanes_store(lanes_load(b->rate + from) * pushes, out->stiffness + i);
        lanes_store(friction, out->friction + i);
        lanes_store(lanes_pick(lanes_less(zero, pushes), law->dissipation * force, zero) -
                        (sum->grip ? zero : friction),
                    out->damping + i);

        /* Arm from the tangent's center, turned into the world frame */
        for (int k = 0; k < 3; k++) {
            p[k] -= center[k];
        }
        for (int k = 0; k < 3; k++) {
            lanes_store(lanes_turn(sum->turn + 3 * k, p), out->arm[k] + i);
        }
    }
}

/* ---- springs with individual directions ---- */

/* Computes each spring's direction in the world frame and the moment of a unit force along it about
 * the tangent's center (m). */
static void law_find_directions(const struct native_batch *b, size_t start,
                                const struct native_sum *sum, struct resistance *out)
{
    for (size_t i = 0; i < out->n; i += LANES) {
        lanes d[3], arm[3], along[3];

        for (int k = 0; k < 3; k++) {
            d[k] = lanes_load(b->d[k] + start + i);
            arm[k] = lanes_load(out->arm[k] + i);
        }
        for (int k = 0; k < 3; k++) {
            along[k] = lanes_turn(sum->turn + 3 * k, d);
            lanes_store(along[k], out->along[k] + i);
        }
        lanes_store(arm[1] * along[2] - arm[2] * along[1], out->along[CONTACT_TURN_X] + i);
        lanes_store(arm[2] * along[0] - arm[0] * along[2], out->along[CONTACT_TURN_Y] + i);
        lanes_store(arm[0] * along[1] - arm[1] * along[0], out->along[CONTACT_TURN_Z] + i);
    }
}

/* Adds one row of the upper triangles of K and D: stiffness and damping of the springs times the
 * outer product of (n, arm x n). The sums of one row fit into the registers. */
LANES_INLINE void tangent_add_row(const struct resistance *by, const int row,
                                  struct contact_tangent *tangent)
{
    lanes k[CONTACT_AXES] = {{0}}, d[CONTACT_AXES] = {{0}};

    for (size_t i = 0; i < by->n; i += LANES) {
        lanes w = lanes_load(by->along[row] + i);
        lanes stiffness = lanes_load(by->stiffness + i) * w;
        lanes damping = lanes_load(by->damping + i) * w;

        for (int column = row; column < CONTACT_AXES; column++) {
            lanes other = lanes_load(by->along[column] + i);

            k[column] += stiffness * other;
            d[column] += damping * other;
        }
    }
    for (int column = row; column < CONTACT_AXES; column++) {
        tangent->K[CONTACT_TANGENT_AT(row, column)] += lanes_sum(k[column]);
        tangent->D[CONTACT_TANGENT_AT(row, column)] += lanes_sum(d[column]);
    }
}

/* Subtracts from D, along each spring's own normal, the damping that friction adds in all
 * directions. */
static void tangent_take_along(const struct resistance *by, double D[CONTACT_TANGENT_SIZE])
{
    for (int row = 0; row < CONTACT_AXES; row++) {
        for (int column = row; column < CONTACT_AXES; column++) {
            lanes sum = {0};

            for (size_t i = 0; i < by->n; i += LANES) {
                sum += lanes_load(by->friction + i) * lanes_load(by->along[row] + i) *
                       lanes_load(by->along[column] + i);
            }
            D[CONTACT_TANGENT_AT(row, column)] -= lanes_sum(sum);
        }
    }
}

/* ---- springs by their moments ---- */

/* Computes the zeroth, first and second moments of a weight over the springs, about the tangent's
 * center. */
static void find_moments(const struct resistance *by, const double *weight, struct moments *m)
{
    const double *const arm[3] = {by->arm[0], by->arm[1], by->arm[2]};

    *m = (struct moments){.zeroth = 0};
    moments_add_springs(arm, weight, by->n, m);
}

/* Adds stiffness and damping of springs that all push along the unit vector d (world frame) to K
 * and D, by their moments. */
static void tangent_add_one_way(const struct resistance *by, const double d[3],
                                struct contact_tangent *tangent)
{
    struct moments stiffness, damping;

    find_moments(by, by->stiffness, &stiffness);
    find_moments(by, by->damping, &damping);
    tangent_add_along(1, &stiffness, d, tangent->K);
    tangent_add_along(1, &damping, d, tangent->D);
}

/* Adds the damping of sticking friction that each spring bears by itself to friction_D: in all
 * directions, minus the part along the normals. direction: the common normal of springs that push
 * one way (world frame). */
static void tangent_add_bristles(const struct resistance *by, bool one_way,
                                 const double direction[3], struct contact_tangent *tangent)
{
    struct moments friction;

    find_moments(by, by->friction, &friction);
    tangent_add_across(&friction, tangent->friction_D);
    if (one_way) {
        tangent_add_along(-1, &friction, direction, tangent->friction_D);
    } else {
        tangent_take_along(by, tangent->friction_D);
    }
}

/* Adds the springs of the current pair to the tangent, RESISTANCE_MAX at a time: normal stiffness
 * and damping by moments if all push one way, else row by row; then friction. */
static void law_add_tangents(const struct native_batch *b, const struct native_law *law,
                             const struct native_relative *relative, const struct native_sum *sum)
{
    struct resistance by;
    struct moments friction;
    double direction[3] = {0, 0, 0};

    for (size_t start = b->start; start < b->n; start += RESISTANCE_MAX) {
        law_find_resistance(b, start, law, relative, sum, &by);
        if (sum->one_way) {
            const double d[3] = {b->d[0][start], b->d[1][start], b->d[2][start]};

            mat3_apply(sum->turn, d, direction);
            tangent_add_one_way(&by, direction, sum->tangent);
        } else {
            law_find_directions(b, start, sum, &by);
            tangent_add_row(&by, CONTACT_MOVE_X, sum->tangent);
            tangent_add_row(&by, CONTACT_MOVE_Y, sum->tangent);
            tangent_add_row(&by, CONTACT_MOVE_Z, sum->tangent);
            tangent_add_row(&by, CONTACT_TURN_X, sum->tangent);
            tangent_add_row(&by, CONTACT_TURN_Y, sum->tangent);
            tangent_add_row(&by, CONTACT_TURN_Z, sum->tangent);
        }

        /* Damping of regularized friction, or of bristles that springs hold one by one;
         * native_bristle_resist adds a patch that holds as a whole */
        if (!sum->grip) {
            find_moments(&by, by.friction, &friction);
            tangent_add_across(&friction, sum->tangent->D);
        } else if (sum->grip->whole < 1) {
            tangent_add_bristles(&by, sum->one_way, direction, sum->tangent);
        }
    }
}

void native_law_sum(struct native_batch *batch, const struct native_law *law,
                    const struct native_relative *relative, struct native_sum *sum)
{
    batch_pad(batch);
    if (sum->tangent) {
        law_add_tangents(batch, law, relative, sum);
    } else if (sum->gather) {
        native_stick_gather(batch, law, relative, sum);
    } else if (sum->grip) {
        native_stick_hold(batch, law, relative, sum);
    } else {
        law_add_forces(batch, law, relative, sum);
    }
    batch->start = batch->n;
}

void native_make_room(const struct native_overlap *o, size_t n)
{
    struct native_batch *batch = &o->scratch->batch;

    if (batch->n + n > BATCH_MAX) {
        native_law_sum(batch, o->law, o->relative, o->sum);
        batch->n = batch->start = 0;
        batch->full = true;
    }
}

void native_overlap(enum native_pair_kind kind, const struct native_overlap *o)
{
    static void (*const narrow_phase[])(const struct native_overlap *o) = {
        [PAIR_HERTZ_SPHERES] = native_overlap_hertz,
        [PAIR_HERTZ_HALF_SPACE] = native_overlap_hertz,
        [PAIR_MESH_HALF_SPACE] = native_overlap_half_space,
        [PAIR_MESH_SPHERE] = native_overlap_sphere,
        [PAIR_MESHES] = native_overlap_meshes,
        [PAIR_FIELDS] = native_overlap_fields,
        [PAIR_CAPSULE_HALF_SPACE] = native_overlap_capsule_half_space,
        [PAIR_CAPSULES] = native_overlap_capsules,
    };
    const struct native_law *law = o->law;
    const bool layered = kind != PAIR_HERTZ_SPHERES && kind != PAIR_HERTZ_HALF_SPACE;

    narrow_phase[kind](o);

    /* The backing overlaps by the depth minus the thickness of the layers; two meshes add the
     * backing facet by facet */
    if (layered && kind != PAIR_MESHES && law->backing > 0 && o->sum->depth > law->layers) {
        const double area = o->sum->area;
        struct native_law backing = *law;
        struct native_overlap deeper = *o;

        backing.stiffness = law->backing;
        deeper.law = &backing;
        deeper.from = law->layers;
        narrow_phase[kind](&deeper);
        o->sum->area = area;
    }
    native_law_sum(&o->scratch->batch, law, o->relative, o->sum);
}
