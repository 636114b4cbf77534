/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contact engine "native", evaluation. For each pair that the broad phase finds near, it computes
 * the relative pose and velocity of the surfaces. contact/native/narrow_phase.h finds penetration
 * and force, and friction_sticking.c adds sticking friction. Then the wrench is transformed to the
 * world frame.
 */
#include "contact/native/private.h"
#include "contact/lanes.h"

#include <stdio.h>

#define BRISTLE_MOST 1e9 /* J^0.5, largest accepted bristle state */

/* Two numbers in one vector. */
typedef double couple __attribute__((vector_size(2 * sizeof(double))));

/* ---- poses of surfaces ---- */

/* Computes pose and velocity of a surface's frame in the world from its body's motion. */
static void surface_place(const struct native_surface *s, const struct body_motion *m,
                          struct native_pose *pose)
{
    double arm[3], turn[3];

    /* Rotation and origin of the frame */
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            pose->R[3 * r + c] = m->R[3 * r] * s->rotation[c] +
                                 m->R[3 * r + 1] * s->rotation[3 + c] +
                                 m->R[3 * r + 2] * s->rotation[6 + c];
        }
    }
    mat3_apply(m->R, s->position, arm);
    vec3_add_scaled(arm, 1, m->p, pose->p);

    /* Velocity of its origin: v + w x arm */
    vec3_cross(m->w, arm, turn);
    vec3_add_scaled(m->v, 1, turn, pose->v);
    memcpy(pose->w, m->w, sizeof pose->w);
}

/* Updates the plane of a half-space for the broad phase: outward normal and minus its offset, m. */
static void surface_place_plane(const struct native_engine *e, size_t index)
{
    const struct native_pose *pose = &e->pose[index];
    const struct broad_balls *ball = &e->broad.ball;

    ball->x[index] = pose->R[2];
    ball->y[index] = pose->R[5];
    ball->z[index] = pose->R[8];
    ball->reach[index] =
        -(pose->R[2] * pose->p[0] + pose->R[5] * pose->p[1] + pose->R[8] * pose->p[2]);
}

/* Updates center and axis of the bounding ball and capsule of a surface for the broad phase, in the
 * world frame. */
static void surface_place_ball(const struct native_engine *e, size_t index,
                               const struct body_motion *m)
{
    const double *c = e->surface[index].center, *half = e->surface[index].about.half;
    const couple from[3] = {{c[0], half[0]}, {c[1], half[1]}, {c[2], half[2]}};
    double *const center[3] = {e->broad.ball.x, e->broad.ball.y, e->broad.ball.z};

    /* Ball and capsule in one loop */
    for (int k = 0; k < 3; k++) {
        const couple to =
            m->R[3 * k] * from[0] + m->R[3 * k + 1] * from[1] + m->R[3 * k + 2] * from[2];

        center[k][index] = to[0] + m->p[k];
        e->broad.capsule[index].half[k] = to[1];
    }
}

void native_place_fixed_surfaces(struct native_engine *e)
{
    const struct body_motion world_at_rest = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};

    for (size_t i = 0; i < e->nsurface; i++) {
        if (e->surface[i].body < 0) {
            surface_place(&e->surface[i], &world_at_rest, &e->pose[i]);
            e->placed[i] = true;
        }
        e->broad.ball.reach[i] = e->surface[i].reach;
        e->broad.capsule[i].radius = e->surface[i].about.radius;
        if (e->surface[i].body < 0 && e->surface[i].shape == CONTACT_HALF_SPACE) {
            surface_place_plane(e, i);
        } else if (e->surface[i].body < 0) {
            surface_place_ball(e, i, &world_at_rest);
        }
    }
}

/* Computes relative pose and velocity of surface b in the frame of surface a. */
static void pose_relate(const struct native_pose *a, const struct native_pose *b,
                        struct native_relative *relative)
{
    double arm[3], w[3], v[3], turn[3];

    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            relative->R[3 * r + c] =
                a->R[r] * b->R[c] + a->R[3 + r] * b->R[3 + c] + a->R[6 + r] * b->R[6 + c];
        }
    }
    vec3_sub(b->p, a->p, arm);
    mat3_apply_transposed(a->R, arm, relative->p);

    /* Velocity of the first body minus velocity of the second, both at the first surface's
     * origin */
    vec3_cross(b->w, arm, turn);
    vec3_sub(a->v, b->v, v);
    vec3_add_scaled(v, 1, turn, v);
    vec3_sub(a->w, b->w, w);
    mat3_apply_transposed(a->R, w, relative->w);
    mat3_apply_transposed(a->R, v, relative->v);
}

/* ---- force of a pair ---- */

void native_pair_find_force(const struct native_engine *e, const struct native_pair *pair,
                            const struct native_relative *relative, struct native_sum *sum)
{
    const struct native_surface *a = &e->surface[pair->surface[0]];
    const struct native_surface *b = &e->surface[pair->surface[1]];
    const struct native_overlap overlap = {
        .solid = {a->solid, b->solid},
        .field = {a->field, b->field},
        .capsule = {{a->capsule.radius - pair->slack / 2, a->capsule.half, a->capsule.flat},
                    {b->shape == CONTACT_HALF_SPACE ? HUGE_VAL
                                                    : b->capsule.radius - pair->slack / 2,
                     b->capsule.half, b->capsule.flat}},
        .law = &pair->law,
        .relative = relative,
        .scratch = e->scratch,
        .sum = sum,
    };

    native_overlap(pair->kind, &overlap);
}

/* Adds sign times a force and a moment at the point `at` (world frame) to the wrench of a
 * surface's body about its origin. Does nothing for a surface of the fixed world. */
static void surface_add_wrench(const struct native_engine *e, int surface, const double force[3],
                               const double moment[3], const double at[3], double sign,
                               const struct body_motion *motion, struct contact_wrench *wrench)
{
    int body = e->surface[surface].body;
    double arm[3], turn[3];

    if (body < 0) {
        return;
    }
    vec3_sub(at, motion[body].p, arm);
    vec3_cross(arm, force, turn);
    vec3_add_scaled(wrench[body].force, sign, force, wrench[body].force);
    vec3_add_scaled(wrench[body].moment, sign, moment, wrench[body].moment);
    vec3_add_scaled(wrench[body].moment, sign, turn, wrench[body].moment);
}

/* Evaluates a pair: finds its springs, which are appended to the batch, sums their forces, and
 * adds sticking friction and the patch if there is a penetration. */
static void pair_evaluate(struct native_engine *e, size_t index, const struct body_motion *motion,
                          struct contact_bristles *bristles, struct contact_wrench *wrench)
{
    const struct native_pair *pair = &e->pair[index];
    struct native_batch *batch = &e->scratch->batch;
    const size_t from = (batch->n + BATCH_ALIGN - 1) / BATCH_ALIGN * BATCH_ALIGN;
    const bool full = batch->full;
    struct native_relative relative;
    struct native_gather gather = {.along = {0, 0, 0}};
    struct native_sum sum = {.gather = e->sticking ? &gather : NULL,
                             .one_way = native_pair_is_one_way(pair)};

    /* Until the pair is done, full means that the batch lost springs of this pair */
    batch->n = batch->start = from;
    batch->full = false;
    for (int side = 0; side < 2; side++) {
        const int at = pair->surface[side];

        /* Skip poses that this evaluation has already computed */
        if (!e->placed[at]) {
            surface_place(&e->surface[at], &motion[e->surface[at].body], &e->pose[at]);
            e->placed[at] = true;
        }
    }
    pose_relate(&e->pose[pair->surface[0]], &e->pose[pair->surface[1]], &relative);
    native_pair_find_force(e, pair, &relative, &sum);
    if (sum.area > 0) {
        e->springs[e->npatch] = (struct native_springs){from, batch->n};
        if (e->sticking) {
            friction_sticking_add(e, index, &relative, e->springs[e->npatch],
                                  batch->full || sum.closed, bristles, &sum);
            e->springs[e->npatch].to = batch->n; /* may have grown */
        }

        /* Add the wrench of a pair in contact to both bodies and append its patch */
        const struct native_pose *a = &e->pose[pair->surface[0]];
        struct contact_patch *patch = &e->patch[e->npatch++];
        double center[3] = {0, 0, 0}, force[3], moment[3], about[3], turn[3];

        /* Moment about the center of pressure, near the contact: a moment about a far origin would
         * lose digits */
        if (sum.normal > 0) {
            vec3_add_scaled(center, 1 / sum.normal, sum.lever, center);
        }
        vec3_cross(center, sum.force, turn);
        vec3_sub(sum.moment, turn, about);

        /* From the first surface's frame to the world */
        mat3_apply(a->R, sum.force, force);
        mat3_apply(a->R, about, moment);
        mat3_apply(a->R, center, patch->center);
        vec3_add_scaled(patch->center, 1, a->p, patch->center);

        /* Adds the wrench to the first body, and its opposite to the second */
        surface_add_wrench(e, pair->surface[0], force, moment, patch->center, 1, motion, wrench);
        surface_add_wrench(e, pair->surface[1], force, moment, patch->center, -1, motion, wrench);

        /* The patch reports the wrench on the configured pair's b */
        patch->pair = (int)index;
        for (int k = 0; k < 3; k++) {
            patch->force[k] = pair->sign * force[k];
            patch->moment[k] = pair->sign * moment[k];
        }
        patch->area_m2 = sum.area;
        patch->penetration_m = sum.depth;
        patch->potential_j = sum.potential;
        patch->dissipation_w = sum.power;
    }
    batch->full |= full;
}

/* ---- functions of contact.h ---- */

/* Checks that the listed bristle states are within BRISTLE_MOST. Otherwise returns ERROR_INPUT,
 * and the failure names the pair. */
static enum error_code bristles_check(struct native_engine *e,
                                      const struct contact_bristles *bristles)
{
    for (size_t i = 0; e->sticking && bristles && i < bristles->npair; i++) {
        const double *y = bristles->y + CONTACT_BRISTLE * (size_t)bristles->pair[i];

        for (int k = 0; k < CONTACT_BRISTLE; k++) {
            if (!(fabs(y[k]) <= BRISTLE_MOST)) {
                snprintf(e->failure, sizeof e->failure,
                         "contact: the bristles of pair %d are not finite, or out of range",
                         bristles->pair[i]);
                return ERROR_INPUT;
            }
        }
    }
    return ERROR_NONE;
}

#define MOTION_SQUARES 1e18 /* square of contact_check_motions' limit */

/* Checks that all motions are moderate numbers, by the sum of their squares. Only if the sum is
 * large, checks each motion to name the faulty one. The caller is responsible for R being a
 * rotation. */
static enum error_code motions_check(struct native_engine *e, const struct body_motion *motion)
{
    const double *x = (const double *)motion;
    const size_t n = e->nbody * (sizeof *motion / sizeof *x);
    lanes sum = {0};
    double rest = 0;
    size_t i = 0;

    for (; i + LANES <= n; i += LANES) {
        lanes some = lanes_load_any(x + i);

        sum += some * some;
    }
    for (; i < n; ++i) {
        rest += x[i] * x[i];
    }
    if (lanes_sum(sum) + rest <= MOTION_SQUARES) {
        return ERROR_NONE;
    }
    return contact_check_motions(motion, e->nbody, e->failure, sizeof e->failure);
}

/* Evaluates contact and friction of all near pairs (struct contact_ops). */
static enum error_code native_evaluate(struct contact_world *world,
                                       const struct body_motion *motion,
                                       struct contact_bristles *bristles,
                                       struct contact_wrench *wrench)
{
    struct native_engine *e = (struct native_engine *)world;
    enum error_code code = motions_check(e, motion);

    code = code ? code : bristles_check(e, bristles);
    if (code != ERROR_NONE) {
        return code;
    }

    /* Clears wrenches, patches and springs; updates the broad phase */
    for (size_t b = 0; b < e->nbody; b++) {
        wrench[b] = (struct contact_wrench){{0}, {0}};
    }

    /* Move the bounding balls to the present poses of the bodies. Compute the poses of half-spaces,
     * which the broad phase needs; pair_evaluate computes the other poses later. */
    for (size_t i = 0; i < e->nsurface; i++) {
        const struct native_surface *s = &e->surface[i];

        if (s->body < 0) {
            continue;
        }
        e->placed[i] = s->shape == CONTACT_HALF_SPACE;
        if (e->placed[i]) {
            surface_place(s, &motion[s->body], &e->pose[i]);
            surface_place_plane(e, i);
        } else {
            surface_place_ball(e, i, &motion[s->body]);
        }
    }
    e->npatch = 0;
    e->scratch->batch.n = e->scratch->batch.start = 0;
    e->scratch->batch.full = false;
    e->scratch->visits = 0;

    /* Bristles of pairs without contact relax; pairs in contact overwrite their rates below */
    if (e->sticking && bristles && bristles->rate) {
        native_bristle_relax(bristles);
    }

    /* Evaluates the pairs that may touch in ascending order, so that sums are reproducible */
    broad_phase_find(&e->broad, e->near);
    for (size_t w = 0; w < e->broad.nword; w++) {
        for (uint64_t near = e->near[w]; near; near &= near - 1) {
            pair_evaluate(e, 64 * w + (size_t)__builtin_ctzll(near), motion,
                          e->sticking ? bristles : NULL, wrench);
        }
    }
    return ERROR_NONE;
}

/* Copies at most max patches of the last evaluation; returns the number of patches. */
static size_t native_patches(struct contact_world *world, struct contact_patch *patch, size_t max)
{
    const struct native_engine *e = (const struct native_engine *)world;

    for (size_t i = 0; i < e->npatch && i < max; i++) {
        patch[i] = e->patch[i];
    }
    return e->npatch;
}

/* Adds stiffness and damping of a patch's springs to a tangent: the springs of the last
 * evaluation, or the same springs computed again if the batch had no room. center: in the first
 * surface's frame, like the springs. */
static void patch_add_springs(const struct native_engine *e, size_t patch, const double center[3],
                              struct contact_tangent *tangent)
{
    const struct native_pair *pair = &e->pair[e->patch[patch].pair];
    const struct native_pose *a = &e->pose[pair->surface[0]];
    struct native_batch *batch = &e->scratch->batch;
    struct native_relative relative;
    struct native_sum sum = {.tangent = tangent,
                             .turn = a->R,
                             .one_way = native_pair_is_one_way(pair),
                             .sticking = e->sticking ? &e->sticking[patch] : NULL};

    pose_relate(a, &e->pose[pair->surface[1]], &relative);
    memcpy(tangent->center, center, sizeof tangent->center);
    if (batch->full) {
        batch->n = batch->start = 0;
        native_pair_find_force(e, pair, &relative, &sum);
    } else {
        batch->start = e->springs[patch].from;
        batch->n = e->springs[patch].to;
        native_law_sum(batch, &pair->law, &relative, &sum);
    }
}

/* Sets how a patch's bristles follow the motion, sets their friction wrench, and adds their damping
 * to D. center: the tangent's center in the first surface's frame; turn: rotation of that frame to
 * the world. */
static void tangent_set_bristles(const struct sticking_patch *sticking, const double center[3],
                                 const double turn[9], double sign, struct contact_tangent *tangent)
{
    double gain = sticking->root * sticking->bend_s, arm[3], about[3];

    for (int i = 0; i < CONTACT_TANGENT_SIZE; i++) {
        tangent->friction_D[i] += tangent->slide_D[i];
        tangent->D[i] += tangent->friction_D[i];
        tangent->slide_D[i] = -tangent->slide_D[i];
    }

    /* Friction wrench on b about the center, world frame */
    vec3_cross(center, sticking->force, arm);
    vec3_sub(sticking->moment, arm, about);
    mat3_apply(turn, sticking->force, tangent->friction + CONTACT_MOVE_X);
    mat3_apply(turn, about, tangent->friction + CONTACT_TURN_X);
    for (int k = 0; k < CONTACT_AXES; k++) {
        tangent->friction[k] *= sign;
    }

    /* Anchor of the bristles: arm from the center, normal and twist axis */
    vec3_sub(sticking->center, center, arm);
    mat3_apply(turn, arm, tangent->bristle_arm);
    mat3_apply(turn, sticking->normal, tangent->normal);
    mat3_apply(turn, sticking->axis, tangent->bristle_axis);
    for (int k = 0; k < 3; k++) {
        tangent->normal[k] *= sign;
        tangent->bristle_axis[k] *= sign;
    }

    /* Bend per velocity, J^0.5 over m/s and rad/s */
    tangent->bristle_per_m_s = gain;
    tangent->bristle_per_rad_s = sticking->inverse_radius > 0 ? gain / sticking->inverse_radius : 0;
}

/* Returns the largest ratio of friction to normal force, at the pair's sliding velocity at center
 * (in the first surface's frame). */
static double patch_friction_max(const struct native_engine *e, const struct native_pair *pair,
                                 const double center[3])
{
    const struct native_law *law = &pair->law;
    struct native_relative relative;

    if (law->uv == 0) {
        return law->us;
    }
    pose_relate(&e->pose[pair->surface[0]], &e->pose[pair->surface[1]], &relative);
    vec3_add_cross(relative.w, center, relative.v);
    return law->us + law->uv * vec3_norm(relative.v);
}

/* Computes at most max tangents (stiffness K, damping D) at the last evaluation; returns the
 * number of patches. */
static size_t native_tangents(struct contact_world *world, struct contact_tangent *tangent,
                              size_t max)
{
    const struct native_engine *e = (const struct native_engine *)world;

    for (size_t i = 0; i < e->npatch && i < max; i++) {
        const struct native_pair *pair = &e->pair[e->patch[i].pair];
        const struct native_pose *a = &e->pose[pair->surface[0]];
        bool turned = pair->sign > 0; /* the configured pair's a is the second surface */
        const struct sticking_patch *sticking = e->sticking ? &e->sticking[i] : NULL;
        double arm[3], center[3]; /* in the first surface's frame */

        tangent[i] = (struct contact_tangent){
            .pair = e->patch[i].pair,
            .body_a = e->surface[pair->surface[turned]].body,
            .body_b = e->surface[pair->surface[!turned]].body,
        };

        /* Sets the tangent's center to the patch's center. If a patch sticks as a whole and pushes
         * one way, the moments of its springs are already known */
        vec3_sub(e->patch[i].center, a->p, arm);
        mat3_apply_transposed(a->R, arm, center);
        if (sticking && sticking->whole == 1 && native_pair_is_one_way(pair)) {
            native_bristle_press(sticking, center, a->R, &tangent[i]);
        } else {
            patch_add_springs(e, i, center, &tangent[i]);
        }
        if (sticking && sticking->whole > 0) {
            native_bristle_resist(sticking, center, a->R, &tangent[i]);
        }
        memcpy(tangent[i].center, e->patch[i].center, sizeof tangent[i].center);
        if (sticking) {
            tangent_set_bristles(sticking, center, a->R, pair->sign, &tangent[i]);
            tangent[i].pressing = sticking->root * sticking->reach;
            tangent[i].friction_max = patch_friction_max(e, pair, center);
            tangent[i].sliding = sticking->sliding;
        }
    }
    return e->npatch;
}

static const char *native_failure(const struct contact_world *world)
{
    return ((const struct native_engine *)world)->failure;
}

/* Does nothing: the arena owns all memory. */
static void native_destroy(struct contact_world *world)
{
    (void)world;
}

const struct contact_ops native_ops = {
    .name = "native",
    .evaluate = native_evaluate,
    .patches = native_patches,
    .tangents = native_tangents,
    .failure = native_failure,
    .destroy = native_destroy,
};
