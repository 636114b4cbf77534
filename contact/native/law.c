/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The contact law of contact.h over the springs of a pair, LANES at a time: normal force with
 * dissipation (penalty method), regularized friction, stored and dissipated energy, and the
 * tangents (stiffness and damping matrices) for implicit integration. Sticking friction (stiction)
 * is in friction_sticking.c and friction_sums.c.
 */
#include "contact/native/law.h"

#include "contact/native/friction.h"
#include "contact/native/narrow_phase.h"
#include "contact/native/moments_sum.h"

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

/* Adds normal force, moment about the frame's origin, sums for the center of pressure, and energies
 * of the springs to sum. gathers: adds the sums of struct native_gather, but no friction. Otherwise
 * adds regularized friction (contact.h). gathers is a constant in each call, so that the compiler
 * makes two loops. */
LANES_INLINE void law_add_springs(const struct native_batch *batch, const struct native_law *law,
                                  const struct native_relative *relative, const bool gathers,
                                  struct native_sum *sum)
{
    struct native_gather *out = sum->gather;
    const double *const p[3] = {batch->p[0] + batch->start, batch->p[1] + batch->start,
                                batch->p[2] + batch->start};
    const lanes zero = {0};
    lanes force[3] = {zero, zero, zero}, moment[3] = {zero, zero, zero};
    lanes lever[3] = {zero, zero, zero}, second[6] = {zero, zero, zero, zero, zero, zero};
    lanes normal = zero, potential = zero, power = zero, elastic = zero;

    for (size_t i = batch->start; i < batch->n; i += LANES) {
        lanes f[3], fp[3], depth = lanes_load(batch->depth + i), lost;
        struct friction_spring s;

        /* Normal force and its first moments; dissipated power */
        friction_load_spring(batch, i, law, relative, &s);
        lost = (s.force - s.normal) * s.leaving;
        for (int k = 0; k < 3; k++) {
            f[k] = s.normal * s.d[k];
            fp[k] = s.normal * s.p[k];
            lever[k] += fp[k];
        }

        /* Friction force against the sliding velocity, or the second moments */
        if (gathers) {
            elastic += s.force;
            second[0] += fp[0] * s.p[0];
            second[1] += fp[0] * s.p[1];
            second[2] += fp[0] * s.p[2];
            second[3] += fp[1] * s.p[1];
            second[4] += fp[1] * s.p[2];
            second[5] += fp[2] * s.p[2];
        } else {
            lanes v2 = s.u[0] * s.u[0] + s.u[1] * s.u[1] + s.u[2] * s.u[2];
            lanes drag = s.normal * friction_over_speed(lanes_root(v2), law);

            lost += drag * v2;
            for (int k = 0; k < 3; k++) {
                f[k] -= drag * s.u[k];
            }
        }
        for (int k = 0; k < 3; k++) {
            force[k] += f[k];
        }
        moment[0] += s.p[1] * f[2] - s.p[2] * f[1];
        moment[1] += s.p[2] * f[0] - s.p[0] * f[2];
        moment[2] += s.p[0] * f[1] - s.p[1] * f[0];
        normal += s.normal;
        potential += s.force * depth;
        power += lost;
    }

    /* Adds up the lanes; half of force times depth is stored; the stiffness is proportional to the
     * area */
    for (int k = 0; k < 3; k++) {
        double push = lanes_sum(force[k]);

        sum->force[k] += push;
        sum->moment[k] += lanes_sum(moment[k]);
        sum->lever[k] += lanes_sum(lever[k]);
        if (gathers) {
            out->along[k] += push;
        }
    }
    if (gathers) {
        for (int k = 0; k < 6; k++) {
            out->second[k] += lanes_sum(second[k]);
        }
        moments_add_springs(p, batch->rate + batch->start, batch->n - batch->start, &out->area);
        out->elastic += lanes_sum(elastic);
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
    /* The direction in which the bristles of a spring slide, and its moment; 0 where they hold */
    _Alignas(64) double slide[CONTACT_AXES][RESISTANCE_MAX];
};

/* Returns the product of one row of a rotation matrix and a vector. */
LANES_INLINE lanes lanes_turn(const double row[3], const lanes v[3])
{
    return row[0] * v[0] + row[1] * v[1] + row[2] * v[2];
}

/* Stores directions d in the world frame, and the moments of unit forces along them at arm. */
LANES_INLINE void store_direction(const double turn[9], const lanes d[3], const lanes arm[3],
                                  double out[CONTACT_AXES][RESISTANCE_MAX], size_t i)
{
    lanes along[3];

    for (int k = 0; k < 3; k++) {
        along[k] = lanes_turn(turn + 3 * k, d);
        lanes_store(along[k], out[k] + i);
    }
    lanes_store(arm[1] * along[2] - arm[2] * along[1], out[CONTACT_TURN_X] + i);
    lanes_store(arm[2] * along[0] - arm[0] * along[2], out[CONTACT_TURN_Y] + i);
    lanes_store(arm[0] * along[1] - arm[1] * along[0], out[CONTACT_TURN_Z] + i);
}

/* Computes stiffness, damping and points of action of the springs from start on, as many as there
 * is room for. The damping of regularized friction comes from contact_friction_damping. The
 * damping of bristles is their stiffness times the time by which they follow the velocity. */
static void law_find_resistance(const struct native_batch *b, size_t start,
                                const struct native_law *law,
                                const struct native_relative *relative,
                                const struct native_sum *sum, struct resistance *out)
{
    const double *center = sum->tangent->center;
    const double scale = law->us * law->transition_inverse;
    const lanes zero = {0};
    const double apart = sum->sticking ? 1 - sum->sticking->whole
                                       : 0; /* share of friction that each spring bears by itself */
    const double follow = sum->sticking ? apart * sum->sticking->root * sum->sticking->follow_s : 0;

    out->n = b->n - start < RESISTANCE_MAX ? b->n - start : RESISTANCE_MAX;
    for (size_t i = 0; i < out->n; i += LANES) {
        const size_t from = start + i;
        lanes pushes, slope, friction = zero, arm[3];
        struct friction_spring s;
        struct friction_bend bend = {.slide = {zero, zero, zero}};

        /* Factor of the elastic force with dissipation, 0 if the surfaces part fast; and the
         * damping of no, sticking or regularized friction */
        friction_load_spring(b, from, law, relative, &s);
        pushes = 1 - law->dissipation * s.leaving;
        pushes = lanes_pick(lanes_less(zero, pushes), pushes, zero);
        if (!sum->sticking) {
            slope = friction_slope_bound(
                lanes_root(s.u[0] * s.u[0] + s.u[1] * s.u[1] + s.u[2] * s.u[2]), law);
            friction = (slope * scale + law->uv) * (s.force * pushes);
        } else if (apart > 0) {
            friction_find_bend(&s, law, sum->sticking, &bend);
            friction = follow * bend.stiffness;
        }

        /* Friction damps in all directions, so its part along the normal is subtracted; for
         * bristles, tangent_add_bristles subtracts it */
        lanes_store(s.rate * pushes, out->stiffness + i);
        lanes_store(friction, out->friction + i);
        lanes_store(lanes_pick(lanes_less(zero, pushes), law->dissipation * s.force, zero) -
                        (sum->sticking ? zero : friction),
                    out->damping + i);

        /* Arm from the tangent's center, turned into the world frame */
        for (int k = 0; k < 3; k++) {
            s.p[k] -= center[k];
        }
        for (int k = 0; k < 3; k++) {
            arm[k] = lanes_turn(sum->turn + 3 * k, s.p);
            lanes_store(arm[k], out->arm[k] + i);
        }
        if (apart > 0) {
            store_direction(sum->turn, bend.slide, arm, out->slide, i);
        }
    }
}

/* ---- springs with individual directions ---- */

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

/* Subtracts from D, along one direction per spring, the damping that friction adds in all
 * directions. */
static void tangent_take_along(const struct resistance *by,
                               const double along[CONTACT_AXES][RESISTANCE_MAX],
                               double D[CONTACT_TANGENT_SIZE])
{
    for (int row = 0; row < CONTACT_AXES; row++) {
        for (int column = row; column < CONTACT_AXES; column++) {
            lanes sum = {0};

            for (size_t i = 0; i < by->n; i += LANES) {
                sum += lanes_load(by->friction + i) * lanes_load(along[row] + i) *
                       lanes_load(along[column] + i);
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

/* Adds the damping of sticking friction that each spring bears by itself to friction_D: in all
 * directions, minus the part along the normals. Subtracts from slide_D the part along the sliding
 * directions, along which friction at its limit does not change. direction: the common normal of
 * springs that push one way (world frame). */
static void tangent_add_bristles(const struct resistance *by, bool one_way,
                                 const double direction[3], struct contact_tangent *tangent)
{
    struct moments friction;

    find_moments(by, by->friction, &friction);
    tangent_add_across(1, &friction, tangent->friction_D);
    if (one_way) {
        tangent_add_along(-1, &friction, direction, tangent->friction_D);
    } else {
        tangent_take_along(by, by->along, tangent->friction_D);
    }
    tangent_take_along(by, by->slide, tangent->slide_D);
}

void native_law_sum(struct native_batch *batch, const struct native_law *law,
                    const struct native_relative *relative, struct native_sum *sum)
{
    batch_pad(batch);
    if (sum->tangent) {
        /* Add the springs of the current pair to the tangent, RESISTANCE_MAX at a time: normal
         * stiffness and damping by moments if all push one way, else row by row; then friction */
        struct resistance by;
        struct moments friction;
        double direction[3] = {0, 0, 0};

        for (size_t start = batch->start; start < batch->n; start += RESISTANCE_MAX) {
            law_find_resistance(batch, start, law, relative, sum, &by);
            if (sum->one_way) {
                const double d[3] = {batch->d[0][start], batch->d[1][start], batch->d[2][start]};
                struct moments stiffness, damping;

                mat3_apply(sum->turn, d, direction);
                find_moments(&by, by.stiffness, &stiffness);
                find_moments(&by, by.damping, &damping);
                tangent_add_along(1, &stiffness, direction, sum->tangent->K);
                tangent_add_along(1, &damping, direction, sum->tangent->D);
            } else {
                /* Compute each spring's direction in the world frame and the moment of a unit force
                 * along it about the tangent's center (m) */
                for (size_t i = 0; i < by.n; i += LANES) {
                    lanes d[3], arm[3];

                    for (int k = 0; k < 3; k++) {
                        d[k] = lanes_load(batch->d[k] + start + i);
                        arm[k] = lanes_load(by.arm[k] + i);
                    }
                    store_direction(sum->turn, d, arm, by.along, i);
                }
                tangent_add_row(&by, CONTACT_MOVE_X, sum->tangent);
                tangent_add_row(&by, CONTACT_MOVE_Y, sum->tangent);
                tangent_add_row(&by, CONTACT_MOVE_Z, sum->tangent);
                tangent_add_row(&by, CONTACT_TURN_X, sum->tangent);
                tangent_add_row(&by, CONTACT_TURN_Y, sum->tangent);
                tangent_add_row(&by, CONTACT_TURN_Z, sum->tangent);
            }

            /* Adds the damping of regularized friction, or of springs that stick one by one.
             * native_bristle_resist adds the damping of a patch that sticks as a whole */
            if (!sum->sticking) {
                find_moments(&by, by.friction, &friction);
                tangent_add_across(1, &friction, sum->tangent->D);
            } else if (sum->sticking->whole < 1) {
                tangent_add_bristles(&by, sum->one_way, direction, sum->tangent);
            }
        }
    } else if (sum->gather && sum->one_way) {
        friction_sums_gather(batch, law, relative, sum);
    } else if (sum->gather) {
        law_add_springs(batch, law, relative, true, sum);
    } else if (sum->sticking) {
        friction_sums_hold(batch, law, relative, sum);
    } else {
        law_add_springs(batch, law, relative, false, sum);
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
