/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Prepares a robot's description for the numeric dynamics. Each joint becomes a fixed rotation,
 * then a rotation about or a displacement along the z axis. A body whose joint axis is +z keeps its
 * frame. Any other body gets an inner frame whose z axis is the joint axis.
 */
#include "base/instruction_set.h"
#include "model/dynamics_kernels.h"

/* Functions of dynamics_sweeps.c, by instruction set. */
extern const struct dynamics_ops generic_ops, generic_ops_avx2;

/* Computes a rotation whose third column is the unit vector axis. */
static void align_axis(const double axis[3], double align[9])
{
    double x[3] = {0.0, 0.0, 0.0}, y[3], norm;
    int least = 0;

    mat3_identity(align);
    if (axis[2] == 1.0 && axis[0] == 0.0 && axis[1] == 0.0) {
        return;
    }

    /* Make two columns orthogonal to the axis, starting from the coordinate axis farthest from
     * it */
    for (int m = 1; m < 3; m++) {
        if (fabs(axis[m]) < fabs(axis[least])) {
            least = m;
        }
    }
    x[least] = 1.0;
    vec3_cross(axis, x, y);
    norm = vec3_norm(y);
    for (int m = 0; m < 3; m++) {
        y[m] /= norm;
    }
    vec3_cross(y, axis, x);
    for (int m = 0; m < 3; m++) {
        align[3 * m] = x[m];
        align[3 * m + 1] = y[m];
        align[3 * m + 2] = axis[m];
    }
}

/* Sets one lane of each of `count` lane vectors. */
static void set_lanes(const double *x, int count, int lane, lanes *set)
{
    for (int k = 0; k < count; k++) {
        set[k][lane] = x[k];
    }
}

/* Fills the lane of a body. */
static void fill_body_lane(const struct robot *robot, const struct generic *g, size_t b)
{
    const struct robot_body *body = &robot->body[b];
    struct group *group = &g->group[g->home[b]];
    const int lane = g->lane[b];
    double align[9], to_inner[9], I[6], com[3];
    struct spatial_inertia rigid;

    mat3_identity(align);
    group->body[lane] = (int)b;
    group->idle[lane] = 0.0;
    if (b > 0) {
        const struct robot_joint *joint = &robot->joint[b - 1];
        const struct group *parent = &g->group[g->home[body->parent]];
        double parent_align[9], turned[9], fixed[9], origin[3];

        /* Compute the pose of the inner frame in the parent's inner frame */
        align_axis(joint->axis, align);
        for (int k = 0; k < 9; k++) {
            parent_align[k] = parent->align[k][g->lane[body->parent]];
        }
        mat3_transpose(parent_align, to_inner);
        mat3_mul(to_inner, joint->rotation, turned);
        mat3_mul(turned, align, fixed);
        mat3_apply(to_inner, joint->origin, origin);
        set_lanes(fixed, 9, lane, group->fixed);
        set_lanes(origin, 3, lane, group->origin);
        group->joint[lane] = (int)b - 1;
        group->turns[lane] = joint->type == JOINT_REVOLUTE ? 1.0 : 0.0;
        group->slides = group->slides || joint->type == JOINT_PRISMATIC;
    }

    /* Compute the inertia of the body in its inner frame */
    memcpy(I, body->inertia.I, sizeof I);
    mat3_transpose(align, to_inner);
    mat3_apply(to_inner, body->inertia.com, com);
    sym3_rotate(to_inner, I);
    spatial_inertia_rigid(body->inertia.mass, com, I, &rigid);
    set_lanes(align, 9, lane, group->align);
    set_lanes(rigid.J, 6, lane, group->inertia);
    group->mass[lane] = body->inertia.mass;
    for (int m = 0; m < 3; m++) {
        group->center[m][lane] = body->inertia.mass * com[m];
    }
}

/* Adds an empty group. Its lanes continue the lanes of the group `parent`. */
static void add_group(struct generic *g, int parent)
{
    struct group *group = &g->group[g->ngroup++];

    group->aligned = true;
    for (int i = 0; i < GROUP; i++) {
        group->body[i] = -1;
        group->parent[i] = parent;
        group->lane[i] = i;
        group->idle[i] = group->turns[i] = 1.0;
        for (int m = 0; m < 3; m++) {
            group->fixed[4 * m][i] = group->align[4 * m][i] = group->R[4 * m][i] = 1.0;
        }
    }
}

/* Puts body b into a free lane of the groups from `from` on. If `continues`, the body may take only
 * the lane of its parent, in a group that continues the parent's group. Returns false if no lane is
 * free. Sets *begun if a group continues the parent's group. */
static bool find_lane(struct generic *g, int parent, size_t b, size_t from, bool continues,
                      bool *begun)
{
    *begun = false;
    for (size_t n = from; n < g->ngroup; n++) {
        struct group *group = &g->group[n];
        const bool continued = group->parent[0] == g->home[parent];

        *begun = *begun || continued;
        for (int i = 0; i < GROUP; i++) {
            if (group->body[i] < 0 && (!continues || (continued && i == g->lane[parent]))) {
                g->home[b] = (int)n;
                g->lane[b] = i;
                group->body[i] = (int)b;
                group->parent[i] = g->home[parent];
                group->lane[i] = g->lane[parent];
                group->aligned = group->aligned && continues;
                return true;
            }
        }
    }
    return false;
}

/* Returns whether a body has no lane yet, but its parent has one before group `from`. */
static bool body_is_next(const struct robot *robot, const struct generic *g, size_t b, size_t from)
{
    const int home = g->home[robot->body[b].parent];

    return g->home[b] < 0 && home >= 0 && home < (int)from;
}

/* Distributes the bodies over as few groups as possible by their distance from the base. First,
 * limbs continue in their lanes. Then the other bodies take free lanes. */
static void group_bodies(const struct robot *robot, struct generic *g)
{
    size_t from, count;

    for (size_t b = 1; b < g->nbody; b++) {
        g->home[b] = -1;
    }
    add_group(g, 0);
    g->group[0].body[0] = 0;
    do {
        from = g->ngroup;
        count = 0;
        for (size_t b = 1; b < g->nbody; b++) {
            count += body_is_next(robot, g, b, from);
        }
        for (int pass = 0; pass < 2; pass++) {
            for (size_t b = 1; b < g->nbody; b++) {
                const int parent = robot->body[b].parent;
                bool begun;

                if (body_is_next(robot, g, b, from) &&
                    !find_lane(g, parent, b, from, pass == 0, &begun) &&
                    (pass == 1 || (!begun && GROUP * (g->ngroup - from) < count))) {
                    add_group(g, g->home[parent]);
                    find_lane(g, parent, b, g->ngroup - 1, true, &begun);
                }
            }
        }
    } while (count > 0);
}

enum error_code dynamics_generic(const struct robot *robot, struct arena *arena,
                                 struct dynamics *out, struct error *error)
{
    struct generic *g = arena_alloc(arena, 1, sizeof *g);
    struct group *group = arena_alloc(arena, robot->nbody, sizeof *group);
    struct response *response = arena_alloc(arena, robot->nbody, sizeof *response);
    double *q = arena_alloc(arena, robot->nq, sizeof *q);
    double *v = arena_alloc(arena, robot->nv, sizeof *v);
    lanes *sine = arena_alloc(arena, robot->nbody, sizeof *sine);
    lanes *cosine = arena_alloc(arena, robot->nbody, sizeof *cosine);
    int *home = arena_alloc(arena, robot->nbody, sizeof *home);
    int *lane = arena_alloc(arena, robot->nbody, sizeof *lane);

    if (!g || !group || !response || !q || !v || !sine || !cosine || !home || !lane) {
        return error_set(error, ERROR_MEMORY, "no memory for the dynamics of %s", robot->name);
    }
    *g = (struct generic){.nbody = robot->nbody,
                          .first = robot->nv - robot->njoint,
                          .group = group,
                          .home = home,
                          .lane = lane,
                          .response = response,
                          .sine = sine,
                          .cosine = cosine,
                          .q = q,
                          .v = v};
    group_bodies(robot, g);
    for (size_t b = 0; b < robot->nbody; b++) {
        fill_body_lane(robot, g, b);
    }
    *out = (struct dynamics){.ops = &generic_ops, .robot = robot, .work = g};
#ifdef SWEEPS_VARIANTS
    if (instruction_set_used() >= INSTRUCTIONS_AVX2) {
        out->ops = &generic_ops_avx2;
    }
#endif
    return ERROR_NONE;
}

/* ---- common to all implementations ---- */

void dynamics_qdot(const struct robot *robot, const double *q, const double *v, double *qdot)
{
    size_t nq0 = robot->nq - robot->njoint, nv0 = robot->nv - robot->njoint;

    if (robot->floating) {
        double R[9];
        const double *e = q + BASE_Q_QUATERNION, *w = v + BASE_V_ANGULAR;
        double *rate = qdot + BASE_Q_QUATERNION;

        /* The base: rotate the velocity to the world's axes. The quaternion's rate is half its
         * product with (0, w) */
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
