/* SPDX-License-Identifier: Apache-2.0 */
/* Chooses working frames and lumps mass properties. */
#include "model/symbolic/tree.h"

#include "base/portable_math.h"
#include "model/spatial.h"

#include <math.h>
#include <stdlib.h>

/* Rounding error of a rotated unit vector; smaller components count as zero. */
#define ROUNDING 4e-16

/* Costs for the choice of frames, in floating-point operations. */
#define COST_TURN 90.0
#define COST_SHIFT 35.0
#define COST_ALIGN 30.0

/* Placement of a joint in its parent's working frame. */
struct placement {
    double r[3];
    int axis;
    double sign;
    int nturn;
    struct tree_turn turn[TREE_TURNS];
};

/* Sets components of a vector that are only rounding errors to zero. */
static void clean_vector(double x[3])
{
    double norm = vec3_norm(x);

    for (int m = 0; m < 3; m++) {
        if (fabs(x[m]) <= ROUNDING * norm) {
            x[m] = 0.0;
        }
    }
}

/* Computes the rotation matrix of a turn. */
static void turn_to_matrix(const struct tree_turn *turn, double R[9])
{
    int i = (turn->axis + 1) % 3, j = (turn->axis + 2) % 3;

    mat3_identity(R);
    R[3 * i + i] = R[3 * j + j] = turn->c;
    R[3 * j + i] = turn->s;
    R[3 * i + j] = -turn->s;
}

/* Appends a turn to a rotation: R <- R Rot(turn). */
static void turn_append(double R[9], const struct tree_turn *turn)
{
    double T[9], product[9];

    turn_to_matrix(turn, T);
    mat3_mul(R, T, product);
    memcpy(R, product, sizeof product);
}

/* Computes the placement of a joint in its parent's working frame. align: rotation of this frame to
 * the parent's body frame. at: the parent's origin in this frame. */
static void place_joint(const struct robot_joint *joint, const double align[9], const double at[3],
                        struct placement *place)
{
    double in_parent[3], a[3], norm;

    mat3_apply_transposed(align, joint->origin, place->r);
    clean_vector(place->r);
    vec3_add_scaled(place->r, 1.0, at, place->r);
    clean_vector(place->r);
    mat3_apply(joint->rotation, joint->axis, in_parent);
    mat3_apply_transposed(align, in_parent, a);
    norm = vec3_norm(a);
    for (int m = 0; m < 3; m++) {
        a[m] /= norm;
    }
    clean_vector(a);

    /* Find the smallest number of fixed turns after which the unit vector a is +axis or -axis */
    int k = 0, zero = -1;

    /* Find the coordinate axis nearest to a */
    for (int m = 0; m < 3; m++) {
        k = fabs(a[m]) > fabs(a[k]) ? m : k;
        zero = a[m] == 0.0 ? m : zero;
    }
    place->axis = k;
    place->sign = a[k] < 0.0 ? -1.0 : 1.0;
    place->nturn = 0;

    /* Use as many turns, 0 to 2, as a has components across this axis */
    int i = (k + 1) % 3, j = (k + 2) % 3;
    double ai = place->sign * a[i], aj = place->sign * a[j], ak = fabs(a[k]);
    if (ai == 0.0 && aj == 0.0) {
        return;
    }
    if (zero == i) {
        place->turn[place->nturn++] = (struct tree_turn){i, ak, -aj};
    } else if (zero == j) {
        place->turn[place->nturn++] = (struct tree_turn){j, ak, ai};
    } else {
        double perpendicular = sqrt(ai * ai + aj * aj);

        place->turn[place->nturn++] = (struct tree_turn){k, ai / perpendicular, aj / perpendicular};
        place->turn[place->nturn++] = (struct tree_turn){j, ak, perpendicular};
    }
}

/* Computes the shift of the joint's origin after which r has no component along the axis. For a
 * prismatic joint r becomes zero. */
static void free_origin(const struct placement *place, bool prismatic, double moved[3])
{
    memset(moved, 0, 3 * sizeof *moved);
    if (prismatic) {
        memcpy(moved, place->r, 3 * sizeof *moved);
    } else if (place->nturn == 0) {
        moved[place->axis] = place->r[place->axis];
    }
}

/* Returns the cost of a placement after the origin has moved by the shortest shift. */
static double placement_cost(const struct placement *place, bool prismatic)
{
    double cost = COST_TURN * place->nturn, moved[3];

    free_origin(place, prismatic, moved);
    for (int m = 0; m < 3; m++) {
        cost += place->r[m] != moved[m] ? COST_SHIFT : 0.0;
    }
    return cost;
}

/* Returns the cost of the children of body b with this working frame and origin of b. */
static double children_cost(const struct robot *robot, size_t b, const double align[9],
                            const double at[3])
{
    double cost = 0.0;

    for (size_t c = b + 1; c < robot->nbody; c++) {
        if (robot->body[c].parent == (int)b) {
            struct placement place;

            place_joint(&robot->joint[c - 1], align, at, &place);
            cost += placement_cost(&place, robot->joint[c - 1].type == JOINT_PRISMATIC);
        }
    }
    return cost;
}

/* Removes rounding errors from the rows of a rotation. */
static void clean_rotation(double R[9])
{
    for (int m = 0; m < 9; m++) {
        if (fabs(R[m]) <= ROUNDING) {
            R[m] = 0.0;
        } else if (fabs(fabs(R[m]) - 1.0) <= ROUNDING) {
            R[m] = copysign(1.0, R[m]);
        }
    }
}

/* Chooses the working frame of the base: its own frame, or a frame in which a child's axis is a
 * coordinate axis. */
static void choose_base_frame(const struct robot *robot, struct tree_body *base)
{
    double best;

    mat3_identity(base->align);
    best = children_cost(robot, 0, base->align, base->at);
    for (size_t c = 1; c < robot->nbody; c++) {
        struct placement place;
        double align[9], identity[9], cost;

        if (robot->body[c].parent != 0) {
            continue;
        }
        /* The frame in which this child's axis is a coordinate axis */
        mat3_identity(identity);
        place_joint(&robot->joint[c - 1], identity, base->at, &place);
        mat3_identity(align);
        for (int n = 0; n < place.nturn; n++) {
            turn_append(align, &place.turn[n]);
        }
        clean_rotation(align);
        cost =
            children_cost(robot, 0, align, base->at) + (mat3_is_identity(align) ? 0.0 : COST_ALIGN);
        if (cost < best) {
            best = cost;
            memcpy(base->align, align, sizeof align);
        }
    }
    base->aligned = mat3_is_identity(base->align);
}

/* Chooses the zero of a revolute joint to reduce the cost of the body's children. align: working
 * frame for offset 0. */
static void choose_offset(const struct robot *robot, size_t b, struct tree_body *body)
{
    double start[9], best;

    memcpy(start, body->align, sizeof start);
    best = children_cost(robot, b, start, body->at);
    for (size_t c = b + 1; c < robot->nbody; c++) {
        double across[2][3], in_parent[3];
        const double *at = body->at;

        if (robot->body[c].parent != (int)b) {
            continue;
        }
        /* Try two candidates per child: its axis or its origin on a coordinate axis */
        mat3_apply(robot->joint[c - 1].rotation, robot->joint[c - 1].axis, in_parent);
        mat3_apply_transposed(start, in_parent, across[0]);
        mat3_apply_transposed(start, robot->joint[c - 1].origin, across[1]);
        vec3_add_scaled(across[1], 1.0, at, across[1]);
        for (int n = 0; n < 2; n++) {
            /* The angle that rotates the component across the axis onto a coordinate axis */
            const double turned =
                portable_atan2(across[n][(body->axis + 2) % 3], across[n][(body->axis + 1) % 3]);
            double angle = turned - M_PI_2 * round(turned / M_PI_2), align[9], cost;
            struct tree_turn turn = {body->axis, portable_cos(angle), portable_sin(angle)};

            if (fabs(angle) <= ROUNDING) {
                continue;
            }
            memcpy(align, start, sizeof align);
            turn_append(align, &turn);
            clean_rotation(align);
            cost = children_cost(robot, b, align, body->at);
            if (cost < best - 1.0) {
                best = cost;
                memcpy(body->align, align, sizeof align);
                body->offset = angle;
            }
        }
    }
}

/* Returns the cost after the body's origin has moved by `moved` from its origin in the robot file.
 * at: this displacement in the body's axes; moved is in the axes of r. */
static double origin_cost(const struct robot *robot, size_t b, const struct placement *place,
                          const struct tree_body *body, const double moved[3], double at[3])
{
    double cost = COST_TURN * place->nturn;

    memcpy(at, moved, 3 * sizeof *at);
    for (int n = 0; n < place->nturn; n++) {
        struct tree_turn back = place->turn[n];
        double T[9], x[3] = {at[0], at[1], at[2]};

        back.s = -back.s;
        turn_to_matrix(&back, T);
        mat3_apply(T, x, at);
    }
    for (int m = 0; m < 3; m++) {
        cost += place->r[m] != moved[m] ? COST_SHIFT : 0.0;
    }
    return cost + children_cost(robot, b, body->align, at);
}

/* Chooses the working frame of a body: its origin and the zero of its joint. */
static void set_body(const struct robot *robot, size_t b, struct tree *tree)
{
    const struct robot_joint *joint = &robot->joint[b - 1];
    struct tree_body *body = &tree->body[b];
    const struct tree_body *parent = &tree->body[robot->body[b].parent];
    struct placement place;
    double align[9], transposed[9];

    place_joint(joint, parent->align, parent->at, &place);
    body->prismatic = joint->type == JOINT_PRISMATIC;
    body->axis = place.axis;
    body->sign = place.sign;
    body->nturn = place.nturn;
    memcpy(body->turn, place.turn, sizeof body->turn);

    /* align = R^T align(parent) turns, because the joint has no rotation at q = 0 */
    mat3_transpose(joint->rotation, transposed);
    mat3_mul(transposed, parent->align, align);
    for (int n = 0; n < place.nturn; n++) {
        turn_append(align, &place.turn[n]);
    }
    clean_rotation(align);
    memcpy(body->align, align, sizeof align);

    /* Choose the origin and the zero so that the children are cheap */
    const double zero[3] = {0.0, 0.0, 0.0};
    double moved[3], at[3], best, cost;

    memcpy(body->r, place.r, sizeof body->r);
    best = origin_cost(robot, b, &place, body, zero, at);
    for (size_t c = b; c < robot->nbody; c++) {
        /* Displacement of the origin for this candidate */
        if (c == b) {
            free_origin(&place, body->prismatic, moved);
        } else if (robot->body[c].parent == (int)b && !body->prismatic && place.nturn == 0) {
            struct placement child;

            place_joint(&robot->joint[c - 1], body->align, zero, &child);
            memset(moved, 0, sizeof moved);
            moved[place.axis] = -child.r[place.axis];
        } else {
            continue;
        }

        /* Keep the best candidate, if it saves more than rounding */
        cost = origin_cost(robot, b, &place, body, moved, at);
        if (cost < best - 1.0) {
            best = cost;
            memcpy(body->at, at, sizeof at);
            vec3_sub(place.r, moved, body->r);
        }
    }

    if (!body->prismatic) {
        choose_offset(robot, b, body);
    }
    body->aligned = mat3_is_identity(body->align);
}

/* Adds a symmetric outer product: K <- K + factor (x y^T + y x^T). */
static void add_outer(double K[6], double factor, const double x[3], const double y[3])
{
    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++) {
            K[sym3_index[i][j]] += factor * (x[i] * y[j] + y[i] * x[j]);
        }
    }
}

/* Moves mass properties to the parent if they move with it equally well. */
static void lump_into_parent(struct tree_body *child, struct tree_body *parent)
{
    int k = child->axis, kk = sym3_index[k][k];
    double C[9], a[3];

    mat3_identity(C);
    for (int n = 0; n < child->nturn; n++) {
        turn_append(C, &child->turn[n]);
    }
    /* The body of a prismatic joint has the parent's rotation, so all of K moves */
    if (child->prismatic) {
        sym3_rotate(C, child->K);
        for (int m = 0; m < 6; m++) {
            parent->K[m] += child->K[m];
            child->K[m] = 0.0;
        }
        return;
    }
    /* For mass along a revolute joint's axis, m, h_k and K_kk move */
    for (int m = 0; m < 3; m++) {
        a[m] = C[3 * m + k];
        parent->h[m] += child->h[k] * a[m] + child->mass * child->r[m];
    }
    add_outer(parent->K, 0.5 * child->K[kk], a, a);
    add_outer(parent->K, child->h[k], a, child->r);
    add_outer(parent->K, 0.5 * child->mass, child->r, child->r);
    parent->mass += child->mass;
    child->mass = child->h[k] = child->K[kk] = 0.0;
}

/* Returns whether lump_into_parent removes a mass property of a body completely. */
static bool is_lumped(const struct tree_body *body, int property)
{
    int k = body->axis;

    if (body->parent < 0) {
        return false;
    }
    return body->prismatic ? property >= TREE_K
                           : property == TREE_MASS || property == TREE_H + k ||
                                 property == TREE_K + sym3_index[k][k];
}

enum error_code tree_create(const struct robot *robot, int lanes, struct tree *tree,
                            struct error *error)
{
    memset(tree, 0, sizeof *tree);
    tree->robot = robot;
    tree->nbody = robot->nbody;
    tree->body = calloc(robot->nbody, sizeof *tree->body);
    tree->group = calloc(robot->nbody, sizeof *tree->group);
    tree->group_of = calloc(robot->nbody, sizeof *tree->group_of);
    tree->lane_of = calloc(robot->nbody, sizeof *tree->lane_of);
    if (!tree->body || !tree->group || !tree->group_of || !tree->lane_of) {
        tree_destroy(tree);
        return error_set(error, ERROR_MEMORY, "no memory for a tree of %zu bodies", robot->nbody);
    }

    /* Compute working frames from the base outward, then lump inertias inward */
    for (size_t b = 0; b < robot->nbody; b++) {
        struct tree_body *body = &tree->body[b];
        double com[3], I[6], transposed[9], trace;

        body->parent = robot->body[b].parent;
        body->observed = robot->body[b].observed;
        if (b == 0) {
            choose_base_frame(robot, body);
        } else {
            set_body(robot, b, tree);
        }

        /* Compute m, h and K of a body in its working frame */
        mat3_apply_transposed(body->align, robot->body[b].inertia.com, com);
        vec3_add_scaled(com, 1.0, body->at, com);
        memcpy(I, robot->body[b].inertia.I, sizeof I);
        mat3_transpose(body->align, transposed);
        if (!body->aligned) {
            sym3_rotate(transposed, I);
        }

        /* K = trace(I)/2 - I + m c c^T */
        trace = I[0] + I[3] + I[5];
        body->mass = robot->body[b].inertia.mass;
        for (int i = 0; i < 3; i++) {
            body->h[i] = robot->body[b].inertia.mass * com[i];
            for (int j = i; j < 3; j++) {
                int ij = sym3_index[i][j];

                body->K[ij] = (i == j ? 0.5 * trace : 0.0) - I[ij] + body->h[i] * com[j];
            }
        }
    }
    for (size_t b = robot->nbody - 1; b > 0; b--) {
        struct tree_body *child = &tree->body[b];

        lump_into_parent(child, &tree->body[child->parent]);
    }
    if (tree_assign_lanes(tree, lanes, error)) {
        tree_destroy(tree);
        return ERROR_MEMORY;
    }

    /* Assign array indices to the groups' mass properties */
    tree->ninertia = 0;
    for (size_t g = 0; g < tree->ngroup; g++) {
        struct tree_group *group = &tree->group[g];
        size_t width = (size_t)group->width;

        tree->ninertia = (tree->ninertia + width - 1) / width * width;
        for (int p = 0; p < TREE_INERTIA; p++) {
            bool lumped = is_lumped(&tree->body[group->body[0]], p);

            group->place[p] = lumped ? -1 : (int)tree->ninertia;
            tree->ninertia += lumped ? 0 : width;
        }
    }
    return ERROR_NONE;
}

double tree_inertia(const struct tree_body *body, int property)
{
    return property == TREE_MASS ? body->mass
           : property < TREE_K   ? body->h[property - TREE_H]
                                 : body->K[property - TREE_K];
}

void tree_destroy(struct tree *tree)
{
    free(tree->body);
    free(tree->group);
    free(tree->group_of);
    free(tree->lane_of);
    memset(tree, 0, sizeof *tree);
}
