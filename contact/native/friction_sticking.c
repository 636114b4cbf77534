/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sticking friction (stiction) of a pair in the native engine, by the bristle law of contact.h.
 * Computes anchor, normal and center of pressure from the sums over the springs. Then computes the
 * friction force, and the rates at which the bristles bend, yield and relax. All are in the frame
 * of the first surface. The stored state is for b against a of the configured pair in the world
 * frame; the twist is equal for both surfaces. docs/contact.md explains the law.
 */
#include "contact/native/anchor.h"
#include "contact/native/private.h"

#include <float.h>

#define DELAY_S 0.5e-3 /* t_d, retardation: damping over stiffness of the bristles */
#define YIELD_S 0.5e-3 /* t_y, time constant of yielding and of relaxing */
/* yielding starts at this fraction of the sliding friction in the same direction */
#define YIELD_FROM 0.998
#define ALIGN_S 10e-3 /* time constant at which the shear turns into the plane of a tilted patch */
enum { SCALE_STEPS = 6 };   /* Newton steps for the scale in patch_find_yield */
#define SCALE_ACCURATE 1e-3 /* accuracy relative to YIELD_FROM */

/* Range of the demand in which the friction changes from the patch as a whole to its springs one by
 * one. */
#define WHOLE_UNTIL 0.80
#define WHOLE_NEVER 0.95

/* Sliding velocity of the surfaces at a patch's anchor. */
struct slide {
    double velocity[3], spin;  /* across the normal, m/s; about the twist axis, rad/s */
    double rate[BRISTLE_BENT]; /* rate of bristles that do not yield, J^0.5/s */
};

/* ---- sums over the springs of a pair ---- */

/* The springs of a pair: in the batch, or computed again (lost) because the batch had no room or
 * they were not needed before. */
struct springs {
    struct native_engine *e;
    const struct native_pair *pair;
    const struct native_relative *relative;
    struct native_springs at;
    bool lost;
};

/* Computes the friction of each spring's bristles, up to the spring's limit, and adds it to sum. If
 * sum is NULL, computes only held, most and open of the patch. */
static void springs_hold(const struct springs *s, struct sticking_patch *patch,
                         struct native_sum *sum)
{
    struct native_sum unused = {.depth = 0};

    patch->keeps = sum;
    sum = sum ? sum : &unused;
    patch->power = patch->held = patch->most = patch->open = 0;
    sum->gather = NULL;
    sum->sticking = patch;

    /* Compute the sums that `sum` requests over all springs of the pair */
    struct native_batch *batch = &s->e->scratch->batch;

    /* Area and depth are already in the sum */
    if (s->lost) {
        double area = sum->area, depth = sum->depth;

        batch->n = batch->start = batch->full ? 0 : s->at.from;
        native_pair_find_force(s->e, s->pair, s->relative, sum);
        sum->area = area;
        sum->depth = depth;
        return;
    }
    batch->start = s->at.from;
    batch->n = s->at.to;
    native_law_sum(batch, &s->pair->law, s->relative, sum);
}

/* ---- the patch ---- */

/* Returns the RMS distance of a weight with moments m from the axis through c along n, m. Returns
 * 0 without weight, or if the weight is a point within rounding. */
static double moments_find_radius(const struct moments *m, const double c[3], const double n[3])
{
    double second[6], along[3], square;

    if (!(m->zeroth > 0)) {
        return 0;
    }
    moments_shift_second(m, c, second);
    moments_apply_second(second, n, along);
    square = (second[0] + second[3] + second[5] - vec3_dot(n, along)) / m->zeroth;
    return square > 1e-12 * vec3_dot(c, c) + DBL_MIN ? sqrt(square) : 0;
}

/* Computes mean normal, center of pressure and stiffness of a patch (patch). Also computes
 * centroid, normal and RMS radius of the contact area (touch), which are the anchor of a new
 * patch. */
static void patch_find(const struct springs *s, const struct native_sum *sum,
                       struct sticking_patch *patch, struct native_anchor *touch)
{
    const struct native_gather *gather = sum->gather;
    const struct moments *area = &gather->area;
    const double length = vec3_norm(gather->along);
    struct moments pressure = {.zeroth = sum->normal};
    double *n = patch->normal, radius;

    /* Mean normal, center of pressure and centroid of the area */
    *patch = (struct sticking_patch){.inverse_normal = 1 / sum->normal,
                                     .inverse_area = area->zeroth > 0 ? 1 / area->zeroth : 0};
    for (int k = 0; k < 3; k++) {
        n[k] = length > DBL_MIN ? gather->along[k] / length : k == 2;
        patch->pressure[k] = sum->lever[k] / sum->normal;
        touch->point[k] = area->zeroth > 0 ? area->first[k] / area->zeroth : patch->pressure[k];
    }
    memcpy(touch->axis, n, sizeof touch->axis);

    /* Constant stiffness s of the pair; reach is the bend at which a friction coefficient of 1
     * bears the load, J^0.5 */
    patch->root = s->pair->law.shear_root;
    patch->reach = sum->normal / patch->root;

    /* RMS radii of area and pressure about their centers; the second one is for the friction
     * moment */
    touch->radius = moments_find_radius(area, touch->point, n);
    memcpy(pressure.first, sum->lever, sizeof pressure.first);
    memcpy(pressure.second, gather->second, sizeof pressure.second);
    radius = moments_find_radius(&pressure, patch->pressure, n);
    patch->inverse_pressure_radius = radius > 0 ? 1 / radius : 0;

    /* Springs act between the surfaces. When one surface rocks on the other, the point that does
     * not slide is on the surface that does not define the normals. So the centroid is moved there
     * by a share of the mean depth */
    if (area->zeroth > 0) {
        vec3_add_scaled(touch->point, s->pair->onto * gather->elastic / area->zeroth, n,
                        touch->point);
    }
}

/* Transforms an anchor from the first surface's frame into the frame of the surface that holds
 * it. */
static void anchor_enter(const struct springs *s, struct native_anchor *anchor)
{
    double from[3], axis[3];

    if (s->pair->anchored == 1) {
        vec3_sub(anchor->point, s->relative->p, from);
        memcpy(axis, anchor->axis, sizeof axis);
        mat3_apply_transposed(s->relative->R, from, anchor->point);
        mat3_apply_transposed(s->relative->R, axis, anchor->axis);
    }
}

/* Transforms an anchor from the frame of the surface that holds it into the first surface's
 * frame. */
static void anchor_leave(const struct springs *s, struct native_anchor *anchor)
{
    double point[3], axis[3];

    if (s->pair->anchored == 1) {
        memcpy(point, anchor->point, sizeof point);
        memcpy(axis, anchor->axis, sizeof axis);
        mat3_apply(s->relative->R, point, anchor->point);
        mat3_apply(s->relative->R, axis, anchor->axis);
        vec3_add_scaled(anchor->point, 1, s->relative->p, anchor->point);
    }
}

/* Computes the sliding velocity of the first body against the second, at the anchor and about the
 * twist axis. Computes the bend rates sqrt(s) v and sqrt(s) r w_n. */
static void slide_find(const struct springs *s, const struct sticking_patch *patch,
                       struct slide *slide)
{
    const struct native_relative *relative = s->relative;
    double along;

    vec3_cross(relative->w, patch->center, slide->velocity);
    vec3_add_scaled(slide->velocity, 1, relative->v, slide->velocity);
    along = vec3_dot(patch->normal, slide->velocity);
    vec3_add_scaled(slide->velocity, -along, patch->normal, slide->velocity);
    slide->spin = vec3_dot(patch->axis, relative->w);
    for (int k = 0; k < 3; k++) {
        slide->rate[BRISTLE_SHEAR + k] = patch->root * slide->velocity[k];
    }
    slide->rate[BRISTLE_TWIST] =
        patch->inverse_radius > 0 ? patch->root * slide->spin / patch->inverse_radius : 0;
}

/* Turns the shear into the plane across the normal n and keeps its length, so that a tilting patch
 * keeps its energy. */
static void shear_align(const double n[3], double y[BRISTLE_BENT])
{
    double length = vec3_norm(y), along = vec3_dot(n, y), left;

    vec3_add_scaled(y, -along, n, y);
    left = vec3_norm(y);
    for (int k = 0; k < 3; k++) {
        y[k] = left > DBL_MIN ? y[k] * (length / left) : 0;
    }
}

/* Returns |y|^2 of shear and twist: twice the energy stored in the bristles, J. */
static double bristle_square(const double y[BRISTLE_BENT])
{
    return y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3];
}

/* Returns the scale b of contact.h, at most 1, at which the patch's bristles begin to yield. Call
 * it after springs_hold. Newton's method from below, on a concave piecewise linear function, does
 * not overshoot. */
static double patch_find_yield(const struct springs *s, const struct sticking_patch *patch)
{
    struct sticking_patch scaled = *patch;
    double scale = 0, part = 0, slope;

    /* Without friction every bend yields; below the yield limit no bend does */
    if (!(patch->most > 0)) {
        return bristle_square(patch->bristle) > 0 ? 0 : 1;
    }
    if (patch->held <= YIELD_FROM * patch->most) {
        return 1;
    }

    /* Solves part = YIELD_FROM. part = held/most is the friction at a scale over the sliding
     * friction. At scale 0 it is 0, and its slope is that without limits */
    slope = bristle_square(patch->bristle) / patch->most;
    for (int step = 0; step < SCALE_STEPS; step++) {
        scale += (YIELD_FROM - part) / slope;
        if (!(scale < 1)) {
            return 1;
        }
        for (int k = 0; k < BRISTLE_BENT; k++) {
            scaled.bristle[k] = scale * patch->bristle[k];
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

/* ---- patches that stick as a whole ---- */

/* Returns the coefficient of friction at a sliding speed, m/s; static at rest. It equals
 * friction_fall of friction.h plus the viscous part. */
static double law_find_coefficient(const struct native_law *law, double speed)
{
    double t = (speed * law->transition_inverse - 1) / 2;

    t = t > 0 ? (t < 1 ? t : 1) : 0;
    return law->us - (law->us - law->ud) * (t * t * t * (10 - t * (15 - 6 * t))) + law->uv * speed;
}

/* Returns the demand of contact.h: the friction of bristles e over the friction limit. It is 1 on
 * an ellipsoid that approximates the limit surface: forces and moments at which the patch slides
 * (Howe, Cutkosky, Int. J. Robotics Research 15, 1996). It is INFINITY for a twist of a patch that
 * is a point. */
static double patch_find_demand(const struct springs *s, const struct sticking_patch *patch,
                                const struct slide *slide, const double e[BRISTLE_BENT])
{
    const double limit =
        patch->reach * law_find_coefficient(&s->pair->law, vec3_norm(slide->velocity));
    double arm[3], turn[3], moment, square = vec3_dot(e, e);

    /* Moment about the center of pressure: from the shear at the anchor, and from the twist */
    vec3_sub(patch->center, patch->pressure, arm);
    vec3_cross(arm, e, turn);
    moment = vec3_dot(patch->normal, turn);
    moment += patch->inverse_radius > 0 ? e[BRISTLE_TWIST] / patch->inverse_radius : 0;
    if (patch->inverse_pressure_radius > 0) {
        square += moment * moment * patch->inverse_pressure_radius * patch->inverse_pressure_radius;
    } else if (e[BRISTLE_TWIST] != 0) {
        return (double)INFINITY;
    }
    return sqrt(square) / (limit + DBL_MIN);
}

/* Computes the friction of the patch's bristles and adds it to sum: for the patch as a whole if the
 * demand is well below the friction limit, else for each spring, with a blend between them. */
static void patch_add_friction(const struct springs *s, const struct slide *slide,
                               struct sticking_patch *patch, struct native_sum *sum)
{
    struct native_sum apart = {.one_way = sum->one_way};
    double e[BRISTLE_BENT], demand, power = 0;

    for (int k = 0; k < BRISTLE_BENT; k++) {
        e[k] = patch->bristle[k] + patch->delay_s * slide->rate[k];
    }

    /* The demand is the larger one of those with and without damping */
    demand = fmax(patch_find_demand(s, patch, slide, e),
                  patch_find_demand(s, patch, slide, patch->bristle));
    patch->whole = 1 - native_ramp(demand, WHOLE_UNTIL, WHOLE_NEVER);
    if (patch->whole > 0) {
        /* Add a share of the friction force and moment of bristles e, for the patch as a whole: the
         * force at the anchor's point c, the moment about the twist axis. Their power, W,
         * bends the bristles and is partly lost in their retardation. */
        const double twist =
            patch->inverse_radius > 0 ? e[BRISTLE_TWIST] / patch->inverse_radius : 0;
        double force[3], turn[3];

        for (int k = 0; k < 3; k++) {
            force[k] = -patch->whole * patch->root * e[k];
        }
        vec3_cross(patch->center, force, turn);
        vec3_add_scaled(turn, -patch->whole * patch->root * twist, patch->axis, turn);
        vec3_add_scaled(sum->force, 1, force, sum->force);
        vec3_add_scaled(sum->moment, 1, turn, sum->moment);
        power = patch->whole * patch->root * (vec3_dot(e, slide->velocity) + twist * slide->spin);
    }
    patch->sliding = 0;
    if (patch->whole < 1) {
        springs_hold(s, patch, &apart);
        if (patch->held > 0) {
            patch->sliding = (1 - patch->whole) * fmax(0, 1 - patch->open / patch->held);
        }
        power += (1 - patch->whole) * patch->power;
        vec3_add_scaled(sum->force, 1 - patch->whole, apart.force, sum->force);
        vec3_add_scaled(sum->moment, 1 - patch->whole, apart.moment, sum->moment);
    } else {
        /* The tangent of a patch that sticks as a whole uses the gathered moments */
        patch->stiffness = sum->gather->stiffness;
        patch->damping = sum->gather->damping;
        patch->held = patch->most = patch->open = 0;
    }
    patch->power = power;
}

/* Models springs in the plane across the normal n, with the anchor's radius r about its point, at
 * x from the center. They resist v + w x x across n, and the spin about n with r^2. With m = x x n
 * the terms are I - n n^T, [x] - n m^T and |x|^2 I - x x^T - m m^T + r^2 n n^T. */
void native_bristle_resist(const struct sticking_patch *patch, const double center[3],
                           const double turn[9], struct contact_tangent *tangent)
{
    const double each = patch->whole * patch->root * patch->root * patch->follow_s;
    const double radius = patch->inverse_radius > 0 ? 1 / patch->inverse_radius : 0;
    double *T = tangent->friction_D, n[3], arm[3], x[3], m[3], square;

    mat3_apply(turn, patch->normal, n);
    vec3_sub(patch->center, center, arm);
    mat3_apply(turn, arm, x);
    vec3_cross(x, n, m);
    square = vec3_dot(x, x);
    const double crossed[9] = {0, x[2], -x[1], -x[2], 0, x[0], x[1], -x[0], 0};

    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++) {
            T[CONTACT_TANGENT_AT(i, j)] += each * ((i == j) - n[i] * n[j]);
            T[CONTACT_TANGENT_AT(CONTACT_TURN_X + i, CONTACT_TURN_X + j)] +=
                each *
                ((i == j) * square - x[i] * x[j] - m[i] * m[j] + radius * radius * (n[i] * n[j]));
        }
        for (int j = 0; j < 3; j++) {
            T[CONTACT_TANGENT_AT(i, CONTACT_TURN_X + j)] +=
                each * (crossed[3 * i + j] - n[i] * m[j]);
        }
    }
}

void native_bristle_press(const struct sticking_patch *patch, const double center[3],
                          const double turn[9], struct contact_tangent *tangent)
{
    const struct moments *const of[2] = {&patch->stiffness, &patch->damping};
    double *const to[2] = {tangent->K, tangent->D};
    const double *n = patch->normal;
    const double cross[9] = {0, n[2], -n[1], -n[2], 0,
                             /* matrix of r -> r x n */
                             n[0], n[1], -n[0], 0};
    double d[3], turned[9];

    /* Directions n and r x n of springs at r, in the world frame */
    mat3_apply(turn, n, d);
    mat3_mul(turn, cross, turned);
    for (int w = 0; w < 2; w++) {
        const struct moments *m = of[w];
        const double first[3] = {m->first[0] - m->zeroth * center[0],
                                 m->first[1] - m->zeroth * center[1],
                                 m->first[2] - m->zeroth * center[2]};
        double second[6], arm[3];

        moments_shift_second(m, center, second);
        mat3_apply(turned, first, arm);
        sym3_rotate(turned, second);
        tangent_add_directions(m->zeroth, arm, second, d, to[w]);
    }
}

/* ---- the state ---- */

/* Transforms shear and twist from the world frame, b against a, into the first surface's frame,
 * first against second. */
static void bristle_enter(const struct native_engine *e, const struct native_pair *pair,
                          const double *world, double y[BRISTLE_BENT])
{
    mat3_apply_transposed(e->pose[pair->surface[0]].R, world, y);
    for (int k = 0; k < 3; k++) {
        y[k] *= pair->sign;
    }
    y[BRISTLE_TWIST] = world[BRISTLE_TWIST];
}

/* Transforms shear and twist back into the world frame: the inverse of bristle_enter. */
static void bristle_leave(const struct native_engine *e, const struct native_pair *pair,
                          const double y[BRISTLE_BENT], double *world)
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

/* Appends a pair to the list if it is not there. */
static void bristle_list(struct contact_bristles *bristles, size_t pair)
{
    for (size_t i = 0; i < bristles->npair; i++) {
        if (bristles->pair[i] == (int)pair) {
            return;
        }
    }
    bristles->pair[bristles->npair++] = (int)pair;
}

/* Computes the rates of bristles y in the patch's plane without yielding: the rate from sliding,
 * plus W x y_s. W is the spin about the normal of the surface that defines the normals. The
 * anchor's position is relative to this surface. */
static void bend_bristles(const struct native_engine *e, const struct native_pair *pair,
                          const struct sticking_patch *patch, const struct slide *slide,
                          const double y[BRISTLE_BENT], double rate[BRISTLE_BENT])
{
    const struct native_pose *a = &e->pose[pair->surface[0]];
    const struct native_pose *owner = &e->pose[pair->surface[!pair->anchored]];
    double spin[3], turn[3];

    mat3_apply_transposed(a->R, owner->w, spin);
    vec3_cross(patch->normal, y, turn);
    memcpy(rate, slide->rate, sizeof slide->rate);
    vec3_add_scaled(rate, vec3_dot(patch->normal, spin), turn, rate);
}

/* Computes friction and rates of the bristles y, in the patch's plane, for explicit integration.
 * Returns their yield rate, 1/s. */
static double hold_now(const struct springs *s, const struct slide *slide,
                       const double y[BRISTLE_BENT], struct sticking_patch *patch,
                       struct native_sum *sum, double rate[BRISTLE_BENT])
{
    double square = bristle_square(y), gain, yield = 0;

    memcpy(patch->bristle, y, sizeof patch->bristle);
    patch->delay_s = patch->follow_s = DELAY_S;
    patch_add_friction(s, slide, patch, sum);

    /* Computes the yield rate q of contact.h: above the friction limit (q_1), and if the bristles
     * would store more than the work of friction (q_2) */
    bend_bristles(s->e, s->pair, patch, slide, y, rate);
    gain = vec3_dot(y, rate) + y[BRISTLE_TWIST] * rate[BRISTLE_TWIST];
    if (patch->whole < 1) {
        yield = (1 - patch_find_yield(s, patch)) / YIELD_S;
        yield = square > DBL_MIN ? fmax(yield, (gain - patch->power) / square) : yield;
    }
    for (int k = 0; k < BRISTLE_BENT; k++) {
        rate[k] -= yield * y[k];
    }

    /* The part of the friction power that the bristles do not store is dissipated */
    sum->potential += square / 2;
    sum->power += fmax(0, patch->power - gain + yield * square);
    return yield;
}

/* Computes the friction of the bristles y in h seconds, and their mean rate until then, for
 * implicit integration. The friction power before yielding bounds the stored energy. Returns the
 * yield rate, 1/s. */
static double hold_ahead(const struct springs *s, const struct slide *slide, double h,
                         const double y[BRISTLE_BENT], struct sticking_patch *patch,
                         struct native_sum *sum, double rate[BRISTLE_BENT])
{
    struct native_sum unyielding = *sum;
    double before = bristle_square(y), after, most, scale = 1;

    /* Bends the bristles for the whole time without yielding */
    bend_bristles(s->e, s->pair, patch, slide, y, rate);
    for (int k = 0; k < BRISTLE_BENT; k++) {
        patch->bristle[k] = y[k] + h * rate[k];
    }
    patch->delay_s = DELAY_S;
    patch->follow_s = DELAY_S + h;
    patch->bend_s = h;
    after = bristle_square(patch->bristle);
    patch_add_friction(s, slide, patch, &unyielding);

    /* Limits the growth of |y|^2 to twice the work of friction */
    most = fmax(0, before + 2 * h * patch->power);

    if (patch->whole == 1 || (patch->held <= YIELD_FROM * patch->most && after <= most)) {
        *sum = unyielding;
    } else {
        /* Scales the bristles back to the friction limit, by an implicit step of the yield q_1, and
         * to the energy bound */
        scale = (1 + h / YIELD_S * patch_find_yield(s, patch)) / (1 + h / YIELD_S);
        scale = after > most ? fmin(scale, sqrt(most / after)) : scale;
        for (int k = 0; k < BRISTLE_BENT; k++) {
            patch->bristle[k] *= scale;
            rate[k] = (patch->bristle[k] - y[k]) / h;
        }
        patch->follow_s = DELAY_S + scale * h;
        patch->bend_s = scale * h;
        patch_add_friction(s, slide, patch, sum);
        after = bristle_square(patch->bristle);
    }
    sum->potential += after / 2;
    sum->power += fmax(0, patch->power - (after - before) / (2 * h));
    return (1 - scale) / h;
}

/* Computes the rates that lead an anchor's state from given to kept and, in proportion to the
 * yield, on to a new anchor (anew). yield: 1/s. */
static void anchor_follow(const double given[CONTACT_BRISTLE], const double kept[CONTACT_BRISTLE],
                          const double anew[CONTACT_BRISTLE], double h, double yield,
                          double rate[CONTACT_BRISTLE])
{
    const double soon = 1 / (YIELD_S + h);

    yield = fmin(soon, fmax(0, yield));
    for (int k = BRISTLE_BENT; k < CONTACT_BRISTLE; k++) {
        rate[k] = soon * (kept[k] - given[k]) + yield * (anew[k] - kept[k]);
    }
}

void friction_sticking_add(struct native_engine *e, size_t index,
                           const struct native_relative *relative, struct native_springs at,
                           bool lost, struct contact_bristles *bristles, struct native_sum *sum)
{
    static const double relaxed[CONTACT_BRISTLE];
    const struct native_pair *pair = &e->pair[index];
    const struct springs springs = {e, pair, relative, at, lost};
    const double *given = bristles ? bristles->y + CONTACT_BRISTLE * index : relaxed;
    struct sticking_patch *patch = &e->sticking[e->npatch];
    double y[BRISTLE_BENT], start[BRISTLE_BENT], rate[CONTACT_BRISTLE], h, along, yield;
    double kept[CONTACT_BRISTLE], anew[CONTACT_BRISTLE];
    double force[3], moment[3]; /* wrench without friction */
    struct native_anchor touch;
    struct slide slide;

    /* Without a normal force there is no friction, and the bristles relax; native_bristle_relax
     * has already set their rates */
    if (!(sum->normal > 0)) {
        double square = bristle_square(given);

        *patch = (struct sticking_patch){.root = 0};
        sum->potential += square / 2;
        sum->power += square / YIELD_S;
        return;
    }

    /* Computes patch, anchor and sliding velocity. Transforms the bristles into the first surface's
     * frame and the patch's plane */
    patch_find(&springs, sum, patch, &touch);

    /* Set the anchor of the patch's bristles: the anchor of the given state, dragged into its play
     * about the contact area, or a new anchor if the state has none. Write the states of this
     * anchor (kept) and of a new anchor (anew). */
    struct native_anchor anchor;
    double aligned;

    /* Finds the anchor in the frame of the surface that holds it */
    anchor_enter(&springs, &touch);
    native_anchor_write(&touch, anew);
    memcpy(kept, given, CONTACT_BRISTLE * sizeof *kept);
    if (!(touch.radius > 0) || !native_anchor_read(given, &anchor)) {
        anchor = touch;
        memcpy(kept, anew, CONTACT_BRISTLE * sizeof *kept);
    } else if (native_anchor_drag(&touch, &anchor)) {
        native_anchor_write(&anchor, kept);
    }

    /* Twist axis (n + u)/(1 + n . u) in the first surface's frame. The anchor's axis u and the
     * normal n are fixed in different surfaces. So the integral of the twist rate depends only on
     * their relative rotation */
    anchor_leave(&springs, &anchor);
    aligned = 1 / (1 + vec3_dot(anchor.axis, patch->normal));
    for (int k = 0; k < 3; k++) {
        patch->center[k] = anchor.point[k];
        patch->axis[k] = aligned * (anchor.axis[k] + patch->normal[k]);
    }
    patch->inverse_radius = anchor.radius > 0 ? 1 / anchor.radius : 0;

    slide_find(&springs, patch, &slide);
    bristle_enter(e, pair, given, start);
    memcpy(y, start, sizeof y);
    memcpy(force, sum->force, sizeof force);
    memcpy(moment, sum->moment, sizeof moment);
    shear_align(patch->normal, y);

    /* Computes friction, now or after the time ahead. Its wrench is the change of the sum */
    h = bristles ? bristles->ahead_s : 0;
    yield = h > 0 ? hold_ahead(&springs, &slide, h, y, patch, sum, rate)
                  : hold_now(&springs, &slide, y, patch, sum, rate);
    vec3_sub(sum->force, force, patch->force);
    vec3_sub(sum->moment, moment, patch->moment);

    /* Turns the state into the plane too: within the time ahead, or in ALIGN_S */
    along = vec3_dot(start, start);
    along = h > 0 || along < DBL_MIN ? 1 : vec3_dot(y, start) / along;
    for (int k = 0; k < 3; k++) {
        rate[k] += (y[k] - along * start[k]) / (h > 0 ? h : ALIGN_S);
    }

    /* Returns the rates of bristles and anchor, in the frames of their states */
    if (bristles && bristles->rate) {
        double *out = bristles->rate + CONTACT_BRISTLE * index;

        bristle_list(bristles, index);
        bristle_leave(e, pair, rate, out);
        anchor_follow(given, kept, anew, h, yield, out);
    }
}
