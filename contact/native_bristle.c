/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sticking friction of a pair in the native engine: from the sums over its springs to what bends
 * its bristles and what makes them yield (contact.h), in the frame of the first surface. The
 * bristles' state goes by b against a of the configured pair in the world frame; the twist is the
 * same from both sides.
 */
#include "contact/native_moments.h"
#include "contact/native_private.h"
#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define LENGTH_M 1e-4       /* l_b */
#define DELAY_S 1e-3        /* t_d */
#define YIELD_S 0.5e-3      /* t_y */
#define YIELD_FROM 0.998    /* of what sliding that way would give */
#define ALIGN_S 10e-3       /* in which the shear turns into a patch's plane that has tilted */
enum { SCALE_STEPS = 6 };   /* to find the scale at which bristles begin to yield */
#define SCALE_ACCURATE 1e-3 /* of YIELD_FROM */

/* How sliding would bend bristles that do not yield. */
struct bend {
    double rate[CONTACT_BRISTLE]; /* J^0.5/s */
};

/* ---- sums over the springs of a pair ---- */

/* The springs of a pair: in the batch, or there was no room for all and they are found anew. */
struct springs {
    struct native_engine *e;
    const struct native_pair *pair;
    const struct native_relative *relative;
    struct native_springs at;
    bool lost;
};

/* Adds to the sum what it wants of all springs. */
static void springs_add(const struct springs *s, struct native_sum *sum)
{
    struct native_batch *batch = &s->e->scratch->batch;

    if (s->lost) {
        double area = sum->area, depth = sum->depth;

        batch->n = batch->start = 0;
        native_pair_find_force(s->e, s->pair, s->relative, sum);
        sum->area = area;
        sum->depth = depth;
        return;
    }
    batch->start = s->at.from;
    batch->n = s->at.to;
    s->pair->kernels->sum(batch, &s->pair->law, s->relative, sum);
}

/* Friction of the grip's bristles, added to sum, or only what is found in the grip. */
static void springs_hold(const struct springs *s, struct native_grip *grip, struct native_sum *sum)
{
    struct native_sum unused = {.depth = 0};

    grip->keeps = sum;
    sum = sum ? sum : &unused;
    grip->power = grip->held = grip->most = grip->open = 0;
    sum->gather = NULL;
    sum->grip = grip;
    springs_add(s, sum);
}

/* ---- the patch ---- */

/* Where the bristles stand and how stiff they are, and how the motion bends them. */
static void grip_find(const struct native_sum *sum, const struct native_gather *gather,
                      struct native_grip *grip, struct bend *bend)
{
    const double *second = gather->second, inverse = 1 / sum->normal;
    const double length = vec3_norm(gather->along);
    double square, turn[3], about[3], along;
    double *n = grip->normal, *c = grip->center;

    /* Center of pressure and mean normal */
    *grip = (struct native_grip){.inverse_normal = inverse};
    for (int k = 0; k < 3; k++) {
        c[k] = inverse * sum->lever[k];
        n[k] = length > DBL_MIN ? gather->along[k] / length : k == 2;
    }
    grip->root = sqrt(sum->normal / LENGTH_M);
    grip->reach = sum->normal / grip->root;

    /* r^2: the trace of the second moment about c, less the part along n */
    square = inverse * (second[0] + second[3] + second[5]) - vec3_dot(c, c);
    square -=
        inverse * (n[0] * (n[0] * second[0] + 2 * (n[1] * second[1] + n[2] * second[2])) +
                   n[1] * (n[1] * second[3] + 2 * n[2] * second[4]) + n[2] * n[2] * second[5]) -
        vec3_dot(n, c) * vec3_dot(n, c);
    grip->inverse_radius = square > 1e-12 * vec3_dot(c, c) + DBL_MIN ? 1 / sqrt(square) : 0;

    /* The mean sliding velocity, and its mean turn about c */
    vec3_cross(c, gather->slip, about);
    vec3_sub(gather->turn, about, turn);
    along = vec3_dot(n, gather->slip);
    for (int k = 0; k < 3; k++) {
        bend->rate[BRISTLE_SHEAR + k] = grip->root * inverse * (gather->slip[k] - along * n[k]);
    }
    bend->rate[BRISTLE_TWIST] = grip->root * inverse * vec3_dot(n, turn) * grip->inverse_radius;
}

/* The shear into the plane across n, keeping its length. */
static void shear_align(const double n[3], double y[CONTACT_BRISTLE])
{
    double length = vec3_norm(y), along = vec3_dot(n, y), left;

    vec3_add_scaled(y, -along, n, y);
    left = vec3_norm(y);
    for (int k = 0; k < 3; k++) {
        y[k] = left > DBL_MIN ? y[k] * (length / left) : 0;
    }
}

static double bristle_square(const double y[CONTACT_BRISTLE])
{
    return y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3];
}

/* The scale, up to 1, at which the grip's bristles begin to yield, after their springs_hold:
 * Newton's method from below on a function that is concave and piecewise linear. */
static double grip_find_yield(const struct springs *s, const struct native_grip *grip)
{
    struct native_grip scaled = *grip;
    double scale = 0, part = 0, slope;

    if (!(grip->most > 0)) {
        return bristle_square(grip->bristle) > 0 ? 0 : 1;
    }
    if (grip->held <= YIELD_FROM * grip->most) {
        return 1;
    }

    /* The part of what sliding would give: none at scale 0, with the slope of bristles of which
     * none is at its limit */
    slope = bristle_square(grip->bristle) / grip->most;
    for (int step = 0; step < SCALE_STEPS; step++) {
        scale += (YIELD_FROM - part) / slope;
        if (!(scale < 1)) {
            return 1;
        }
        for (int k = 0; k < CONTACT_BRISTLE; k++) {
            scaled.bristle[k] = scale * grip->bristle[k];
        }
        springs_hold(s, &scaled, NULL);
        part = scaled.held / scaled.most;
        slope = scaled.open / (scale * scaled.most);
        if (part >= (1 - SCALE_ACCURATE) * YIELD_FROM || !(slope > 0)) {
            break;
        }
    }
    return scale;
}

/* ---- springs that hold as one ---- */

/* Whether no spring of the grip can be near its limit, wherever on the surface it is. u: the
 * sliding velocity at the center. */
static bool grip_is_rigid(const struct springs *s, const struct native_grip *grip,
                          const double u[3])
{
    const struct native_law *law = &s->pair->law;
    const double across = 2 * s->e->surface[s->pair->surface[0]].reach;
    const double limit = fmin(law->us, law->ud) * grip->reach;
    double bend = vec3_norm(grip->bristle) +
                  fabs(grip->bristle[BRISTLE_TWIST]) * grip->inverse_radius * across;
    double speed = vec3_norm(u) + vec3_norm(s->relative->w) * across;

    return native_pair_is_one_way(s->pair) &&
           bend + grip->delay_s * grip->root * speed < YIELD_FROM * limit;
}

/* springs_hold of a grip that is_rigid, by the moments of the normal force f: with r from the
 * center, where the sum of f r is zero, C the sum of f r r, n the normal, bristles g = y + t n x r
 * and the sliding velocity u + (w x r across n). Fills power too. False when it is not rigid. */
static bool grip_hold_rigid(const struct springs *s, const struct native_gather *gather,
                            struct native_grip *grip, struct native_sum *sum)
{
    const double *n = grip->normal, *c = grip->center, *y = grip->bristle, *w = s->relative->w;
    const double N = 1 / grip->inverse_normal, twist = y[BRISTLE_TWIST] * grip->inverse_radius;
    const double delay = grip->delay_s * grip->root, stiffness = grip->inverse_normal * grip->root;
    const double *second = gather->second;
    double u[3], force[3], turn[3], b[3], Cn[3], Cw[3], Cb[3], Cbn[3], *C = grip->second, trace;

    /* The velocity at the center, across the normal */
    vec3_cross(w, c, u);
    vec3_add_scaled(s->relative->v, 1, u, u);
    vec3_add_scaled(u, -vec3_dot(n, u), n, u);
    if (!grip_is_rigid(s, grip, u)) {
        return false;
    }

    /* C, and what of it is needed */
    C[0] = second[0] - N * c[0] * c[0];
    C[1] = second[1] - N * c[0] * c[1];
    C[2] = second[2] - N * c[0] * c[2];
    C[3] = second[3] - N * c[1] * c[1];
    C[4] = second[4] - N * c[1] * c[2];
    C[5] = second[5] - N * c[2] * c[2];
    trace = C[0] + C[3] + C[5];
    vec3_cross(n, w, b);
    moments_apply_second(C, n, Cn);
    moments_apply_second(C, w, Cw);
    moments_apply_second(C, b, Cb);
    vec3_cross(Cb, n, Cbn);

    /* Force, moment and power */
    for (int k = 0; k < 3; k++) {
        force[k] = -stiffness * N * (y[k] + delay * u[k]);
    }
    vec3_cross(c, force, turn);
    for (int k = 0; k < 3; k++) {
        sum->force[k] += force[k];
        sum->moment[k] += turn[k] - stiffness * (twist * (trace * n[k] - Cn[k]) +
                                                 delay * (trace * w[k] - Cw[k] - Cbn[k]));
    }
    grip->power =
        stiffness *
        (N * vec3_dot(y, u) + twist * (trace * vec3_dot(n, w) - vec3_dot(n, Cw)) +
         delay * (N * vec3_dot(u, u) + trace * vec3_dot(w, w) - vec3_dot(w, Cw) - vec3_dot(b, Cb)));
    grip->stiffness = gather->stiffness;
    grip->damping = gather->damping;
    grip->rigid = true;
    return true;
}

void native_bristle_resist(const struct native_grip *grip, const double center[3],
                           const double turn[9], struct contact_tangent *tangent)
{
    const double each = grip->root * grip->follow_s * grip->inverse_normal * grip->root;
    struct moments friction = {.zeroth = each / grip->inverse_normal}, stiffness, damping;
    double normal[3];

    /* Friction follows the normal force; the springs are those of the last evaluation */
    mat3_apply(turn, grip->normal, normal);
    memcpy(friction.second, grip->second, sizeof friction.second);
    sym3_rotate(turn, friction.second);
    for (int k = 0; k < 6; k++) {
        friction.second[k] *= each;
    }
    moments_move(&grip->stiffness, center, turn, &stiffness);
    moments_move(&grip->damping, center, turn, &damping);

    /* Friction in all directions but the normal */
    damping.zeroth -= friction.zeroth;
    for (int k = 0; k < 6; k++) {
        damping.second[k] -= friction.second[k];
    }
    tangent_add_along(1, &stiffness, normal, tangent->K);
    tangent_add_along(1, &damping, normal, tangent->D);
    tangent_add_across(&friction, tangent->D);
}

/* ---- the state ---- */

/* Between the world and the first surface's frame. */
static void bristle_enter(const struct native_engine *e, const struct native_pair *pair,
                          const double *world, double y[CONTACT_BRISTLE])
{
    mat3_apply_transposed(e->pose[pair->surface[0]].R, world, y);
    for (int k = 0; k < 3; k++) {
        y[k] *= pair->sign;
    }
    y[BRISTLE_TWIST] = world[BRISTLE_TWIST];
}

static void bristle_leave(const struct native_engine *e, const struct native_pair *pair,
                          const double y[CONTACT_BRISTLE], double *world)
{
    mat3_apply(e->pose[pair->surface[0]].R, y, world);
    for (int k = 0; k < 3; k++) {
        world[k] *= pair->sign;
    }
    world[BRISTLE_TWIST] = y[BRISTLE_TWIST];
}

void native_bristle_relax(const struct contact_bristles *bristles)
{
    const double rate = 1 / (YIELD_S + bristles->ahead_s);

    for (size_t i = 0; i < bristles->npair; i++) {
        const size_t from = CONTACT_BRISTLE * (size_t)bristles->pair[i];

        for (size_t k = from; k < from + CONTACT_BRISTLE; k++) {
            bristles->rate[k] = -rate * bristles->y[k];
        }
    }
}

/* A pair that touches is listed. */
static void bristle_list(struct contact_bristles *bristles, size_t pair)
{
    for (size_t i = 0; i < bristles->npair; i++) {
        if (bristles->pair[i] == (int)pair) {
            return;
        }
    }
    bristles->pair[bristles->npair++] = (int)pair;
}

/* The rates of the sliding motion, y the bristles in the patch's plane: by it and carried along
 * with the spin. */
static void bend_bristles(const struct native_engine *e, const struct native_pair *pair,
                          const struct native_grip *grip, const struct bend *bend,
                          const double y[CONTACT_BRISTLE], double rate[CONTACT_BRISTLE])
{
    const struct native_pose *a = &e->pose[pair->surface[0]], *b = &e->pose[pair->surface[1]];
    double w[3], spin[3], turn[3];

    for (int k = 0; k < 3; k++) {
        w[k] = (a->w[k] + b->w[k]) / 2;
    }
    mat3_apply_transposed(a->R, w, spin);
    vec3_cross(grip->normal, y, turn);
    memcpy(rate, bend->rate, sizeof bend->rate);
    vec3_add_scaled(rate, vec3_dot(grip->normal, spin), turn, rate);
}

/* Friction of the bristles y, in the patch's plane, as they are; fills their rate. */
static void hold_now(const struct springs *s, const struct bend *bend,
                     const double y[CONTACT_BRISTLE], struct native_grip *grip,
                     struct native_sum *sum, double rate[CONTACT_BRISTLE])
{
    double square = bristle_square(y), gain, yield;

    memcpy(grip->bristle, y, sizeof grip->bristle);
    grip->delay_s = grip->follow_s = DELAY_S;
    springs_hold(s, grip, sum);

    /* They yield beyond their limit, and to what would store more than friction takes */
    bend_bristles(s->e, s->pair, grip, bend, y, rate);
    gain = vec3_dot(y, rate) + y[BRISTLE_TWIST] * rate[BRISTLE_TWIST];
    yield = (1 - grip_find_yield(s, grip)) / YIELD_S;
    yield = square > DBL_MIN ? fmax(yield, (gain - grip->power) / square) : yield;
    for (int k = 0; k < CONTACT_BRISTLE; k++) {
        rate[k] -= yield * y[k];
    }
    sum->potential += square / 2;
    sum->power += grip->power - gain + yield * square;
}

/* Friction of the bristles that y becomes in h seconds; fills their mean rate. The power of
 * friction that bounds what they store is that of the bristles before they yield. */
static void hold_ahead(const struct springs *s, const struct bend *bend, double h,
                       const double y[CONTACT_BRISTLE], struct native_grip *grip,
                       struct native_sum *sum, double rate[CONTACT_BRISTLE])
{
    struct native_sum unyielding = *sum;
    double before = bristle_square(y), after, most, scale;

    /* All the way */
    bend_bristles(s->e, s->pair, grip, bend, y, rate);
    for (int k = 0; k < CONTACT_BRISTLE; k++) {
        grip->bristle[k] = y[k] + h * rate[k];
    }
    grip->delay_s = DELAY_S;
    grip->follow_s = DELAY_S + h;
    grip->bend_s = h;
    after = bristle_square(grip->bristle);
    if (!grip_hold_rigid(s, sum->gather, grip, &unyielding)) {
        springs_hold(s, grip, &unyielding);
    }
    most = fmax(0, before + 2 * h * grip->power);

    if ((grip->rigid || grip->held <= YIELD_FROM * grip->most) && after <= most) {
        *sum = unyielding;
    } else {
        /* Back to what they can bear and to what the work on them allows */
        if (grip->rigid) {
            grip->rigid = false;
            springs_hold(s, grip, &unyielding);
        }
        scale = (1 + h / YIELD_S * grip_find_yield(s, grip)) / (1 + h / YIELD_S);
        scale = after > most ? fmin(scale, sqrt(most / after)) : scale;
        for (int k = 0; k < CONTACT_BRISTLE; k++) {
            grip->bristle[k] *= scale;
            rate[k] = (grip->bristle[k] - y[k]) / h;
        }
        grip->follow_s = DELAY_S + scale * h;
        grip->bend_s = scale * h;
        springs_hold(s, grip, sum);
        after = bristle_square(grip->bristle);
    }
    sum->potential += after / 2;
    sum->power += fmax(0, grip->power - (after - before) / (2 * h));
}

void native_bristle_hold(struct native_engine *e, size_t index,
                         const struct native_relative *relative, struct native_springs at,
                         bool lost, struct contact_bristles *bristles, struct native_sum *sum)
{
    static const double relaxed[CONTACT_BRISTLE];
    const struct native_pair *pair = &e->pair[index];
    const struct springs springs = {e, pair, relative, at, lost};
    const double *given = bristles ? bristles->y + CONTACT_BRISTLE * index : relaxed;
    struct native_grip *grip = &e->grip[e->npatch];
    double y[CONTACT_BRISTLE], start[CONTACT_BRISTLE], rate[CONTACT_BRISTLE], h, along;
    struct bend bend;

    /* Springs that all pull bear nothing */
    if (!(sum->normal > 0)) {
        *grip = (struct native_grip){.root = 0};
        return;
    }

    grip_find(sum, sum->gather, grip, &bend);
    bristle_enter(e, pair, given, start);
    memcpy(y, start, sizeof y);
    shear_align(grip->normal, y);
    h = bristles ? bristles->ahead_s : 0;
    if (h > 0) {
        hold_ahead(&springs, &bend, h, y, grip, sum, rate);
    } else {
        hold_now(&springs, &bend, y, grip, sum, rate);
    }

    /* The state turns into the plane too: until the end of the time ahead, or in a while */
    along = vec3_dot(start, start);
    along = h > 0 || along < DBL_MIN ? 1 : vec3_dot(y, start) / along;
    for (int k = 0; k < 3; k++) {
        rate[k] += (y[k] - along * start[k]) / (h > 0 ? h : ALIGN_S);
    }
    if (bristles && bristles->rate) {
        bristle_list(bristles, index);
        bristle_leave(e, pair, rate, bristles->rate + CONTACT_BRISTLE * index);
    }
}
