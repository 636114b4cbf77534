/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sticking friction of a pair in the native engine: from the sums over its springs to what bends
 * its bristles and what makes them yield (contact.h), in the frame of the first surface. The
 * bristles' state goes by b against a of the configured pair in the world frame; the twist is the
 * same from both sides.
 */
#include "contact/native/anchor.h"
#include "contact/native/moments.h"
#include "contact/native/private.h"
#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <string.h>

#define DELAY_S 0.5e-3      /* t_d */
#define YIELD_S 0.5e-3      /* t_y */
#define YIELD_FROM 0.998    /* of what sliding that way would give */
#define ALIGN_S 10e-3       /* in which the shear turns into a patch's plane that has tilted */
enum { SCALE_STEPS = 6 };   /* to find the scale at which bristles begin to yield */
#define SCALE_ACCURATE 1e-3 /* of YIELD_FROM */

/* Shares of what friction can bear between which a patch goes over from holding as a whole to what
 * each of its springs holds. */
#define WHOLE_UNTIL 0.80
#define WHOLE_NEVER 0.95

/* How the motion moves the surfaces past each other where a patch's bristles stand. */
struct slide {
    double velocity[3], spin;  /* across the normal, about the twist's axis */
    double rate[BRISTLE_BENT]; /* of bristles that do not yield, J^0.5/s */
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

/* The RMS distance of what weighs m from the axis through c along n; 0 for what weighs nothing. */
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

/* Finds what presses on a patch and where, and the area that touches: what a new anchor would
 * be. */
static void grip_find(const struct springs *s, const struct native_sum *sum,
                      struct native_grip *grip, struct native_anchor *touch)
{
    const struct native_gather *gather = sum->gather;
    const struct moments *area = &gather->area;
    const double length = vec3_norm(gather->along);
    struct moments pressure = {.zeroth = sum->normal};
    double *n = grip->normal, radius;

    /* Mean normal, center of pressure and centroid of the area */
    *grip = (struct native_grip){.inverse_normal = 1 / sum->normal,
                                 .inverse_area = area->zeroth > 0 ? 1 / area->zeroth : 0};
    for (int k = 0; k < 3; k++) {
        n[k] = length > DBL_MIN ? gather->along[k] / length : k == 2;
        grip->pressure[k] = sum->lever[k] / sum->normal;
        touch->point[k] = area->zeroth > 0 ? area->first[k] / area->zeroth : grip->pressure[k];
    }
    memcpy(touch->axis, n, sizeof touch->axis);
    grip->root = s->pair->law.shear_root;
    grip->reach = sum->normal / grip->root;

    /* Their radii */
    touch->radius = moments_find_radius(area, touch->point, n);
    memcpy(pressure.first, sum->lever, sizeof pressure.first);
    memcpy(pressure.second, gather->second, sizeof pressure.second);
    radius = moments_find_radius(&pressure, grip->pressure, n);
    grip->inverse_pressure_radius = radius > 0 ? 1 / radius : 0;

    /* Springs act between the surfaces. What rocks on the other without sliding is a point of the
     * surface that the normals do not belong to */
    if (area->zeroth > 0) {
        vec3_add_scaled(touch->point, s->pair->onto * gather->elastic / area->zeroth, n,
                        touch->point);
    }
}

/* An anchor, which is in the first surface's frame, in that of the surface that it is fixed in. */
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

/* The other way. */
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

/* Stands the grip's bristles on the anchor that given has kept, dragged to the area that touches if
 * it is too far off, or on a new one. Fills the state of that anchor (kept) and of a new one
 * (anew). */
static void grip_stand(const struct springs *s, struct native_anchor touch,
                       const double given[CONTACT_BRISTLE], struct native_grip *grip,
                       double kept[CONTACT_BRISTLE], double anew[CONTACT_BRISTLE])
{
    struct native_anchor anchor;
    double aligned;

    /* In the frame of the surface that it is fixed in */
    anchor_enter(s, &touch);
    native_anchor_write(&touch, anew);
    memcpy(kept, given, CONTACT_BRISTLE * sizeof *kept);
    if (!(touch.radius > 0) || !native_anchor_read(given, &anchor)) {
        anchor = touch;
        memcpy(kept, anew, CONTACT_BRISTLE * sizeof *kept);
    } else if (native_anchor_drag(&touch, &anchor)) {
        native_anchor_write(&anchor, kept);
    }

    /* In the first surface's. The twist turns about an axis between that of the anchor and the
     * normal, each fixed in one of the surfaces: its integral depends on how they stand alone */
    anchor_leave(s, &anchor);
    aligned = 1 / (1 + vec3_dot(anchor.axis, grip->normal));
    for (int k = 0; k < 3; k++) {
        grip->center[k] = anchor.point[k];
        grip->axis[k] = aligned * (anchor.axis[k] + grip->normal[k]);
    }
    grip->inverse_radius = anchor.radius > 0 ? 1 / anchor.radius : 0;
}

/* Finds how the motion slides the surfaces past each other where a grip's bristles stand, and bends
 * these. */
static void slide_find(const struct springs *s, const struct native_grip *grip, struct slide *slide)
{
    const struct native_relative *relative = s->relative;
    double along;

    vec3_cross(relative->w, grip->center, slide->velocity);
    vec3_add_scaled(slide->velocity, 1, relative->v, slide->velocity);
    along = vec3_dot(grip->normal, slide->velocity);
    vec3_add_scaled(slide->velocity, -along, grip->normal, slide->velocity);
    slide->spin = vec3_dot(grip->axis, relative->w);
    for (int k = 0; k < 3; k++) {
        slide->rate[BRISTLE_SHEAR + k] = grip->root * slide->velocity[k];
    }
    slide->rate[BRISTLE_TWIST] =
        grip->inverse_radius > 0 ? grip->root * slide->spin / grip->inverse_radius : 0;
}

/* The shear into the plane across n, keeping its length. */
static void shear_align(const double n[3], double y[BRISTLE_BENT])
{
    double length = vec3_norm(y), along = vec3_dot(n, y), left;

    vec3_add_scaled(y, -along, n, y);
    left = vec3_norm(y);
    for (int k = 0; k < 3; k++) {
        y[k] = left > DBL_MIN ? y[k] * (length / left) : 0;
    }
}

static double bristle_square(const double y[BRISTLE_BENT])
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
        for (int k = 0; k < BRISTLE_BENT; k++) {
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

/* ---- patches that hold as a whole ---- */

/* The coefficient of friction at a sliding velocity; as friction_fall of friction.h. */
static double law_find_coefficient(const struct native_law *law, double speed)
{
    double t = fmin(1, fmax(0, (speed * law->transition_inverse - 1) / 2));

    return law->us - (law->us - law->ud) * (t * t * t * (10 - t * (15 - 6 * t))) + law->uv * speed;
}

/* How much of what friction can bear the bristles e ask for: 1 at an ellipsoid that stands for the
 * surface of all forces and moments with which the patch slides (Howe, Cutkosky, Int. J. Robotics
 * Research 15, 1996). */
static double grip_find_demand(const struct springs *s, const struct native_grip *grip,
                               const struct slide *slide, const double e[BRISTLE_BENT])
{
    const double limit =
        grip->reach * law_find_coefficient(&s->pair->law, vec3_norm(slide->velocity));
    double arm[3], turn[3], moment, square = vec3_dot(e, e);

    /* The moment about the center of pressure */
    vec3_sub(grip->center, grip->pressure, arm);
    vec3_cross(arm, e, turn);
    moment = vec3_dot(grip->normal, turn);
    moment += grip->inverse_radius > 0 ? e[BRISTLE_TWIST] / grip->inverse_radius : 0;
    if (grip->inverse_pressure_radius > 0) {
        square += moment * moment * grip->inverse_pressure_radius * grip->inverse_pressure_radius;
    } else if (e[BRISTLE_TWIST] != 0) {
        return INFINITY;
    }
    return sqrt(square) / (limit + DBL_MIN);
}

/* Adds a share of the friction of bristles e that hold as a whole: at the centroid of the area, and
 * about it. Returns its power, which is what bends them and what their retardation takes. */
static double grip_add_whole(const struct native_grip *grip, const struct slide *slide,
                             const double e[BRISTLE_BENT], double share, struct native_sum *sum)
{
    const double twist = grip->inverse_radius > 0 ? e[BRISTLE_TWIST] / grip->inverse_radius : 0;
    double force[3], turn[3];

    for (int k = 0; k < 3; k++) {
        force[k] = -share * grip->root * e[k];
    }
    vec3_cross(grip->center, force, turn);
    vec3_add_scaled(turn, -share * grip->root * twist, grip->axis, turn);
    vec3_add_scaled(sum->force, 1, force, sum->force);
    vec3_add_scaled(sum->moment, 1, turn, sum->moment);
    return share * grip->root * (vec3_dot(e, slide->velocity) + twist * slide->spin);
}

/* Adds the friction of the grip's bristles to sum: of the patch as a whole well inside of what
 * friction can bear, else that of each spring. */
static void grip_hold(const struct springs *s, const struct slide *slide, struct native_grip *grip,
                      struct native_sum *sum)
{
    struct native_sum apart = {.one_way = sum->one_way};
    double e[BRISTLE_BENT], demand, power = 0;

    for (int k = 0; k < BRISTLE_BENT; k++) {
        e[k] = grip->bristle[k] + grip->delay_s * slide->rate[k];
    }
    demand =
        fmax(grip_find_demand(s, grip, slide, e), grip_find_demand(s, grip, slide, grip->bristle));
    grip->whole = 1 - native_ramp(demand, WHOLE_UNTIL, WHOLE_NEVER);
    if (grip->whole > 0) {
        power = grip_add_whole(grip, slide, e, grip->whole, sum);
    }
    if (grip->whole < 1) {
        springs_hold(s, grip, &apart);
        power += (1 - grip->whole) * grip->power;
        vec3_add_scaled(sum->force, 1 - grip->whole, apart.force, sum->force);
        vec3_add_scaled(sum->moment, 1 - grip->whole, apart.moment, sum->moment);
    } else {
        grip->stiffness = sum->gather->stiffness;
        grip->damping = sum->gather->damping;
        grip->held = grip->most = grip->open = 0;
    }
    grip->power = power;
}

/* Whether the grip's bristles bear less than they yield at, after grip_hold. */
static bool grip_is_firm(const struct native_grip *grip)
{
    return grip->whole == 1 || grip->held <= YIELD_FROM * grip->most;
}

void native_bristle_resist(const struct native_grip *grip, const double center[3],
                           const double turn[9], struct contact_tangent *tangent)
{
    const double each = grip->whole * grip->root * grip->root * grip->follow_s;
    const double radius = grip->inverse_radius > 0 ? 1 / grip->inverse_radius : 0;
    struct moments friction = {.zeroth = each};
    double normal[3], arm[3], to[3];
    int at = 0;

    /* As of springs about the centroid in the plane across the normal */
    mat3_apply(turn, grip->normal, normal);
    vec3_sub(grip->center, center, arm);
    mat3_apply(turn, arm, to);
    for (int i = 0; i < 3; i++) {
        friction.first[i] = each * to[i];
        for (int j = i; j < 3; j++) {
            friction.second[at++] =
                each * (to[i] * to[j] + radius * radius / 2 * ((i == j) - normal[i] * normal[j]));
        }
    }
    tangent_add_across(&friction, tangent->friction_D);
    tangent_add_along(-1, &friction, normal, tangent->friction_D);
}

void native_bristle_press(const struct native_grip *grip, const double center[3],
                          const double turn[9], struct contact_tangent *tangent)
{
    struct moments stiffness, damping;
    double normal[3];

    mat3_apply(turn, grip->normal, normal);
    moments_move(&grip->stiffness, center, turn, &stiffness);
    moments_move(&grip->damping, center, turn, &damping);
    tangent_add_along(1, &stiffness, normal, tangent->K);
    tangent_add_along(1, &damping, normal, tangent->D);
}

/* ---- the state ---- */

/* Between the world and the first surface's frame: those that bend. */
static void bristle_enter(const struct native_engine *e, const struct native_pair *pair,
                          const double *world, double y[BRISTLE_BENT])
{
    mat3_apply_transposed(e->pose[pair->surface[0]].R, world, y);
    for (int k = 0; k < 3; k++) {
        y[k] *= pair->sign;
    }
    y[BRISTLE_TWIST] = world[BRISTLE_TWIST];
}

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
 * with the spin of the surface that the normals belong to, from which an anchor's place is seen. */
static void bend_bristles(const struct native_engine *e, const struct native_pair *pair,
                          const struct native_grip *grip, const struct slide *slide,
                          const double y[BRISTLE_BENT], double rate[BRISTLE_BENT])
{
    const struct native_pose *a = &e->pose[pair->surface[0]];
    const struct native_pose *owner = &e->pose[pair->surface[!pair->anchored]];
    double spin[3], turn[3];

    mat3_apply_transposed(a->R, owner->w, spin);
    vec3_cross(grip->normal, y, turn);
    memcpy(rate, slide->rate, sizeof slide->rate);
    vec3_add_scaled(rate, vec3_dot(grip->normal, spin), turn, rate);
}

/* Friction of the bristles y, in the patch's plane, as they are; fills their rate. Returns how fast
 * they yield, 1/s. */
static double hold_now(const struct springs *s, const struct slide *slide,
                       const double y[BRISTLE_BENT], struct native_grip *grip,
                       struct native_sum *sum, double rate[BRISTLE_BENT])
{
    double square = bristle_square(y), gain, yield = 0;

    memcpy(grip->bristle, y, sizeof grip->bristle);
    grip->delay_s = grip->follow_s = DELAY_S;
    grip_hold(s, slide, grip, sum);

    /* They yield beyond their limit, and to what would store more than friction takes */
    bend_bristles(s->e, s->pair, grip, slide, y, rate);
    gain = vec3_dot(y, rate) + y[BRISTLE_TWIST] * rate[BRISTLE_TWIST];
    if (grip->whole < 1) {
        yield = (1 - grip_find_yield(s, grip)) / YIELD_S;
        yield = square > DBL_MIN ? fmax(yield, (gain - grip->power) / square) : yield;
    }
    for (int k = 0; k < BRISTLE_BENT; k++) {
        rate[k] -= yield * y[k];
    }
    sum->potential += square / 2;
    sum->power += fmax(0, grip->power - gain + yield * square);
    return yield;
}

/* Friction of the bristles that y becomes in h seconds; fills their mean rate. The power of
 * friction that bounds what they store is that of the bristles before they yield. Returns how fast
 * they yield, 1/s. */
static double hold_ahead(const struct springs *s, const struct slide *slide, double h,
                         const double y[BRISTLE_BENT], struct native_grip *grip,
                         struct native_sum *sum, double rate[BRISTLE_BENT])
{
    struct native_sum unyielding = *sum;
    double before = bristle_square(y), after, most, scale = 1;

    /* All the way */
    bend_bristles(s->e, s->pair, grip, slide, y, rate);
    for (int k = 0; k < BRISTLE_BENT; k++) {
        grip->bristle[k] = y[k] + h * rate[k];
    }
    grip->delay_s = DELAY_S;
    grip->follow_s = DELAY_S + h;
    grip->bend_s = h;
    after = bristle_square(grip->bristle);
    grip_hold(s, slide, grip, &unyielding);
    most = fmax(0, before + 2 * h * grip->power);

    if (grip->whole == 1 || (grip_is_firm(grip) && after <= most)) {
        *sum = unyielding;
    } else {
        /* Back to what they can bear and to what the work on them allows */
        scale = (1 + h / YIELD_S * grip_find_yield(s, grip)) / (1 + h / YIELD_S);
        scale = after > most ? fmin(scale, sqrt(most / after)) : scale;
        for (int k = 0; k < BRISTLE_BENT; k++) {
            grip->bristle[k] *= scale;
            rate[k] = (grip->bristle[k] - y[k]) / h;
        }
        grip->follow_s = DELAY_S + scale * h;
        grip->bend_s = scale * h;
        grip_hold(s, slide, grip, sum);
        after = bristle_square(grip->bristle);
    }
    sum->potential += after / 2;
    sum->power += fmax(0, grip->power - (after - before) / (2 * h));
    return (1 - scale) / h;
}

/* The rates that lead an anchor's state from given to kept, and as far as the bristles yield to
 * that of a new one. */
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

void native_bristle_hold(struct native_engine *e, size_t index,
                         const struct native_relative *relative, struct native_springs at,
                         bool lost, struct contact_bristles *bristles, struct native_sum *sum)
{
    static const double relaxed[CONTACT_BRISTLE];
    const struct native_pair *pair = &e->pair[index];
    const struct springs springs = {e, pair, relative, at, lost};
    const double *given = bristles ? bristles->y + CONTACT_BRISTLE * index : relaxed;
    struct native_grip *grip = &e->grip[e->npatch];
    double y[BRISTLE_BENT], start[BRISTLE_BENT], rate[CONTACT_BRISTLE], h, along, yield;
    double kept[CONTACT_BRISTLE], anew[CONTACT_BRISTLE];
    double force[3], moment[3]; /* without friction */
    struct native_anchor touch;
    struct slide slide;

    /* Springs that all pull bear nothing, and what was bent relaxes */
    if (!(sum->normal > 0)) {
        double square = bristle_square(given);

        *grip = (struct native_grip){.root = 0};
        sum->potential += square / 2;
        sum->power += square / YIELD_S;
        return;
    }

    grip_find(&springs, sum, grip, &touch);
    grip_stand(&springs, touch, given, grip, kept, anew);
    slide_find(&springs, grip, &slide);
    bristle_enter(e, pair, given, start);
    memcpy(y, start, sizeof y);
    memcpy(force, sum->force, sizeof force);
    memcpy(moment, sum->moment, sizeof moment);
    shear_align(grip->normal, y);
    h = bristles ? bristles->ahead_s : 0;
    yield = h > 0 ? hold_ahead(&springs, &slide, h, y, grip, sum, rate)
                  : hold_now(&springs, &slide, y, grip, sum, rate);
    vec3_sub(sum->force, force, grip->force);
    vec3_sub(sum->moment, moment, grip->moment);

    /* The state turns into the plane too: until the end of the time ahead, or in a while */
    along = vec3_dot(start, start);
    along = h > 0 || along < DBL_MIN ? 1 : vec3_dot(y, start) / along;
    for (int k = 0; k < 3; k++) {
        rate[k] += (y[k] - along * start[k]) / (h > 0 ? h : ALIGN_S);
    }
    if (bristles && bristles->rate) {
        double *out = bristles->rate + CONTACT_BRISTLE * index;

        bristle_list(bristles, index);
        bristle_leave(e, pair, rate, out);
        anchor_follow(given, kept, anew, h, yield, out);
    }
}
