/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contact in a stage of the implicit integrator. Linearizes the active pairs with their tangents,
 * adds their inertias to the bodies, and computes the wrenches at the stage.
 */
#include "model/implicit/private.h"

#include <math.h>
#include <string.h>

/* Relative accuracy of the normal force that friction at its limit follows. */
#define SETTLED 1e-6

/* Largest slope of the normal force over the force that friction follows. Near 1 friction jams the
 * pair, and the slide ends within the stage. */
#define STEEPEST 0.9

static const char too_many_pairs[] =
    "contact: more pairs are active than the implicit integrator takes";

/* Returns the motion of b relative to a at the pair's center, from the twists of the contact
 * bodies. */
static struct spatial relative_twist(const struct plant *plant, const struct active_pair *pair,
                                     const struct spatial *twist)
{
    struct spatial x = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};

    for (int side = PAIR_A; side <= PAIR_B; side++) {
        if (pair->body[side] >= 0) {
            /* Add the motion at the pair's center of the body on this side to x; b counts positive,
             * a negative */
            struct spatial at;
            double arm[3];

            implicit_arm(plant, pair->body[side], pair->center, arm);
            at = spatial_motion_at(&twist[pair->body[side]], arm);
            for (int i = 0; i < 3; i++) {
                x.a[i] += side == PAIR_B ? at.a[i] : -at.a[i];
                x.l[i] += side == PAIR_B ? at.l[i] : -at.l[i];
            }
        }
    }
    return x;
}

/* Adds a wrench on b at a pair's center to the loads of both bodies, if they move; a gets the
 * opposite. */
static void load_pair(struct plant *plant, const struct active_pair *pair,
                      const struct spatial *wrench)
{
    for (int side = PAIR_A; side <= PAIR_B; side++) {
        int contact = pair->body[side];

        if (implicit_moves(plant, contact)) {
            struct spatial f = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
            double arm[3];

            implicit_arm(plant, contact, pair->center, arm);
            spatial_add_wrench(side == PAIR_B ? 1.0 : -1.0, wrench, arm, &f);
            add_contact_wrench(plant, contact, &f,
                               &plant->ext[plant->config.contact_body[contact]]);
        }
    }
}

/* Adds a matrix of a pair to the inertias of both bodies, and to their loads the matrix times the
 * acceleration that leads to the point, which cancels it there. */
static void resist_pair(struct plant *plant, const struct active_pair *pair,
                        const struct spatial_inertia *A)
{
    struct implicit *im = plant->implicit;
    struct spatial back;

    spatial_inertia_apply(A, &pair->point, &back);
    load_pair(plant, pair, &back);
    for (int side = PAIR_A; side <= PAIR_B; side++) {
        int contact = pair->body[side];

        if (implicit_moves(plant, contact)) {
            struct spatial_inertia own = *A;
            double arm[3];

            implicit_arm(plant, contact, pair->center, arm);
            spatial_inertia_shift(arm, &own);
            spatial_inertia_add(&own, &im->contact_inertia[contact]);
        }
    }
}

/* Linearizes one pair at the point. */
static void linearize_pair(struct plant *plant, const struct contact_tangent *tangent,
                           struct active_pair *pair)
{
    struct implicit *im = plant->implicit;
    const double h = im->stage_h;
    double A[21];

    /* Store the pair's state at the point */
    pair->index = tangent->pair;
    pair->body[PAIR_A] = tangent->body_a;
    pair->body[PAIR_B] = tangent->body_b;
    memcpy(pair->center, tangent->center, sizeof pair->center);
    pair->point = relative_twist(plant, pair, im->twist_point);
    memset(&pair->released, 0, sizeof pair->released);
    memset(&pair->grown, 0, sizeof pair->grown);
    pair->settled = false;
    pair->followed = pair->followed_1 = pair->found_1 = tangent->pressing;

    /* A = h (D + h K) */
    for (int i = 0; i < 21; i++) {
        A[i] = h * (tangent->D[i] + h * tangent->K[i]);
    }
    spatial_inertia_unpack(A, &pair->A);
    resist_pair(plant, pair, &pair->A);
    im->coupled |=
        implicit_moves(plant, pair->body[PAIR_A]) && implicit_moves(plant, pair->body[PAIR_B]);
}

enum error_code implicit_linearize_contact(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    im->coupled = false;
    im->nactive = im->ntouched = 0;
    if (!plant->config.contact || (plant->clamped && plant->config.nfree == 0)) {
        return ERROR_NONE;
    }
    im->nactive = plant_contact_tangents(plant, im->tangent, IMPLICIT_TANGENTS);
    if (im->nactive > IMPLICIT_TANGENTS) {
        plant->failure = too_many_pairs;
        im->nactive = 0;
        return ERROR_INPUT;
    }

    /* List the contact bodies of the active pairs and set their added inertias to zero */
    memset(im->is_touched, 0, plant->config.ncontact * sizeof *im->is_touched);
    for (size_t t = 0; t < im->nactive; t++) {
        const struct contact_tangent *tangent = &im->tangent[t];

        if (tangent->body_a >= 0) {
            im->is_touched[tangent->body_a] = true;
        }
        if (tangent->body_b >= 0) {
            im->is_touched[tangent->body_b] = true;
        }
    }
    im->ntouched = 0;
    for (size_t c = 0; c < plant->config.ncontact; c++) {
        if (im->is_touched[c]) {
            im->touched[im->ntouched++] = (int)c;
            memset(&im->contact_inertia[c], 0, sizeof im->contact_inertia[c]);
        }
    }
    if (im->nactive > 0) {
        implicit_contact_accelerations(plant, im->a_point, im->twist_point);
    }
    for (size_t t = 0; t < im->nactive; t++) {
        linearize_pair(plant, &im->tangent[t], &im->active[t]);
    }
    return ERROR_NONE;
}

void implicit_add_contact_inertia(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    memset(im->added, 0, im->nobserved * sizeof *im->added);
    for (size_t t = 0; t < im->ntouched; t++) {
        int c = im->touched[t];

        if (!implicit_is_free(plant, c)) {
            struct spatial_inertia own = im->contact_inertia[c];
            double back[9], S[21];

            mat3_transpose(implicit_motion(plant, c)->R, back);
            spatial_inertia_rotate(back, &own);
            spatial_inertia_pack(&own, S);
            add_scaled(1.0, S, im->added[im->number[c]].A, 21);
        }
    }
}

/* Computes beyond and decrease of a pair from the accelerations of the contact bodies. */
static void find_decrease(const struct plant *plant, struct active_pair *pair)
{
    struct spatial *beyond = &pair->beyond;

    /* The wrench decreases by A times the relative acceleration in excess of the point's */
    *beyond = relative_twist(plant, pair, plant->implicit->twist_z);
    for (int i = 0; i < 3; i++) {
        beyond->l[i] -= pair->point.l[i];
        beyond->a[i] -= pair->point.a[i];
    }
    spatial_inertia_apply(&pair->A, beyond, &pair->decrease);
}

/* Computes the wrench of a pair's friction on b at its center, at the stage. */
static void find_friction_wrench(const struct plant *plant, const struct contact_tangent *tangent,
                                 const struct active_pair *pair, struct spatial *wrench)
{
    const double h = plant->implicit->stage_h;
    struct spatial_inertia D;
    struct spatial decrease;

    spatial_inertia_unpack(tangent->friction_D, &D);
    spatial_inertia_apply(&D, &pair->beyond, &decrease);
    for (int i = 0; i < 3; i++) {
        wrench->l[i] = tangent->friction[CONTACT_MOVE_X + i] - h * decrease.l[i] + pair->grown.l[i];
        wrench->a[i] = tangent->friction[CONTACT_TURN_X + i] - h * decrease.a[i] + pair->grown.a[i];
    }
}

/* Returns whether the friction of a sliding pair would drive it at the solved stage: its velocity
 * along the friction has reversed. */
static bool pair_reverses(const struct plant *plant, const struct contact_tangent *tangent,
                          const struct active_pair *pair)
{
    const double h = plant->implicit->stage_h;
    struct spatial velocity;

    implicit_pair_velocity(plant, pair, &velocity);
    vec3_add_scaled(velocity.l, h, pair->beyond.l, velocity.l);
    vec3_add_scaled(velocity.a, h, pair->beyond.a, velocity.a);
    return vec3_dot(tangent->friction + CONTACT_MOVE_X, velocity.l) +
               vec3_dot(tangent->friction + CONTACT_TURN_X, velocity.a) >=
           0.0;
}

/* Adds a part of D, scaled, to the damping of a pair's friction, to A and to both bodies. */
static void add_friction_damping(struct plant *plant, struct contact_tangent *tangent,
                                 struct active_pair *pair, double scale, const double D[21])
{
    struct spatial_inertia S;
    double A[21];

    for (int i = 0; i < 21; i++) {
        A[i] = scale * plant->implicit->stage_h * D[i];
    }
    spatial_inertia_unpack(A, &S);
    spatial_inertia_add(&S, &pair->A);
    resist_pair(plant, pair, &S);
    add_scaled(scale, D, tangent->friction_D, 21);
    implicit_add_contact_inertia(plant);
    pair->settled = true;
}

/* Lets a pair whose friction would exceed its limit slide: friction becomes constant along the
 * motion from the point to the stage, at its limit in the direction that it has at the stage.
 * friction: at the stage. */
static void release_pair(struct plant *plant, struct contact_tangent *tangent,
                         struct active_pair *pair, const struct spatial *friction)
{
    const double part = tangent->friction_max * tangent->pressing / vec3_norm(friction->l);
    struct spatial_inertia D;
    struct spatial resisted;
    double row[6], removed[21], power, trace = 0.0;
    int at = 0;

    /* D - D u (D u)'/(u' D u), with u the motion */
    spatial_inertia_unpack(tangent->friction_D, &D);
    spatial_inertia_apply(&D, &pair->beyond, &resisted);
    power = vec3_dot(resisted.l, pair->beyond.l) + vec3_dot(resisted.a, pair->beyond.a);
    for (int i = 0; i < 6; i++) {
        trace += tangent->friction_D[CONTACT_TANGENT_AT(i, i)];
    }
    if (!(power * trace >
          0.5 * (vec3_dot(resisted.l, resisted.l) + vec3_dot(resisted.a, resisted.a)))) {
        return; /* D has nothing along u but rounding */
    }
    memcpy(row + CONTACT_MOVE_X, resisted.l, sizeof resisted.l);
    memcpy(row + CONTACT_TURN_X, resisted.a, sizeof resisted.a);
    for (int i = 0; i < 6; i++) {
        for (int k = i; k < 6; k++, at++) {
            removed[at] = row[i] * row[k] / power;
        }
    }
    add_friction_damping(plant, tangent, pair, -1.0, removed);
    for (int i = 0; i < 3; i++) {
        pair->released.l[i] = part * friction->l[i] - tangent->friction[CONTACT_MOVE_X + i];
        pair->released.a[i] = part * friction->a[i] - tangent->friction[CONTACT_TURN_X + i];
        tangent->friction[CONTACT_MOVE_X + i] = part * friction->l[i];
        tangent->friction[CONTACT_TURN_X + i] = part * friction->a[i];
    }
    load_pair(plant, pair, &pair->released);
    tangent->sliding = 1.0;
}

/* Lets the friction of a sliding pair follow the normal force found at the stage. Friction changes
 * the normal force in turn, almost linearly. So the secant through the last two solutions leads to
 * the force that friction and solution share. */
static void follow_normal(struct plant *plant, const struct contact_tangent *tangent,
                          struct active_pair *pair, double found)
{
    const double change = pair->followed - pair->followed_1;
    const double slope = change == 0.0 ? 0.0 : (found - pair->found_1) / change;
    struct spatial added;
    double growth;

    pair->followed_1 = pair->followed;
    pair->found_1 = found;
    pair->followed += (found - pair->followed) / (1.0 - fmin(slope, STEEPEST));
    pair->followed = fmax(0.0, pair->followed);
    growth = tangent->sliding * (pair->followed / tangent->pressing - 1.0);
    for (int i = 0; i < 3; i++) {
        added.l[i] = growth * tangent->friction[CONTACT_MOVE_X + i] - pair->grown.l[i];
        added.a[i] = growth * tangent->friction[CONTACT_TURN_X + i] - pair->grown.a[i];
        pair->grown.l[i] += added.l[i];
        pair->grown.a[i] += added.a[i];
    }
    load_pair(plant, pair, &added);
}

/* Revises the friction of one pair; returns whether its load or its inertia has changed. */
static bool revise_pair(struct plant *plant, struct contact_tangent *tangent,
                        struct active_pair *pair)
{
    const double normal =
        fmax(0.0, tangent->pressing - vec3_dot(tangent->normal, pair->decrease.l));
    struct spatial friction;
    bool again = false;

    find_friction_wrench(plant, tangent, pair, &friction);
    if (!pair->settled && tangent->sliding > 0.0 && pair_reverses(plant, tangent, pair)) {
        add_friction_damping(plant, tangent, pair, 1.0, tangent->slide_D);
        again = true;
    } else if (!pair->settled && tangent->sliding < 1.0 &&
               vec3_norm(friction.l) >
                   tangent->friction_max * normal + SETTLED * tangent->pressing) {
        release_pair(plant, tangent, pair, &friction);
        again = pair->settled;
    }
    if (tangent->sliding > 0.0 && fabs(normal - pair->followed) > SETTLED * normal) {
        follow_normal(plant, tangent, pair, normal);
        again = true;
    }
    return again;
}

bool implicit_revise_friction(struct plant *plant)
{
    struct implicit *im = plant->implicit;
    bool again = false;

    for (size_t t = 0; t < im->nactive; t++) {
        if (im->tangent[t].pressing > 0.0) {
            again |= revise_pair(plant, &im->tangent[t], &im->active[t]);
        }
    }
    return again;
}

void implicit_find_contact(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    if (im->nactive > 0) {
        implicit_contact_accelerations(plant, im->a, im->twist_z);
    }
    for (size_t t = 0; t < im->nactive; t++) {
        find_decrease(plant, &im->active[t]);
    }
}

void implicit_end_contact(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    im->contact_power = 0.0;
    memcpy(im->wrench, plant->contact_wrench, plant->config.ncontact * sizeof *im->wrench);
    if (im->nactive == 0) {
        return;
    }
    for (size_t t = 0; t < im->nactive; t++) {
        /* Compute the wrench of the pair at the stage on both bodies */
        struct active_pair *pair = &im->active[t];
        const struct spatial *beyond = &pair->beyond;

        for (int i = 0; i < 3; i++) {
            pair->decrease.l[i] -= pair->released.l[i] + pair->grown.l[i];
            pair->decrease.a[i] -= pair->released.a[i] + pair->grown.a[i];
        }
        im->jump = fmax(im->jump, im->stage_h * sqrt(vec3_dot(beyond->l, beyond->l)));
        for (int side = PAIR_A; side <= PAIR_B; side++) {
            if (pair->body[side] >= 0) {
                struct contact_wrench *wrench = &im->wrench[pair->body[side]];
                struct spatial sum = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
                double arm[3];

                implicit_arm(plant, pair->body[side], pair->center, arm);
                spatial_add_wrench(side == PAIR_B ? -1.0 : 1.0, &pair->decrease, arm, &sum);
                add_scaled(1.0, sum.l, wrench->force, 3);
                add_scaled(1.0, sum.a, wrench->moment, 3);
            }
        }
    }

    /* Compute the power of the wrenches with the bodies' velocities at the stage */
    for (size_t t = 0; t < im->ntouched; t++) {
        int c = im->touched[t];
        const struct body_motion *motion = implicit_motion(plant, c);
        const struct spatial *to = &im->twist_z[c], *point = &im->twist_point[c];

        for (int i = 0; i < 3; i++) {
            double v = motion->v[i] + im->stage_h * (to->l[i] - point->l[i]);
            double w = motion->w[i] + im->stage_h * (to->a[i] - point->a[i]);

            im->contact_power += im->wrench[c].force[i] * v + im->wrench[c].moment[i] * w;
        }
    }
}

void implicit_gather_wrenches(struct plant *plant)
{
    const struct implicit *im = plant->implicit;

    plant->impulse_s += im->h;
    plant_account_load(plant, 1.0,
                       &(struct plant_load){im->work[WORK_CONTACT], im->work[WORK_PUSH]});
    for (size_t c = 0; c < plant->config.ncontact; c++) {
        const double *w = im->wrench[c].force, *w_1 = im->wrench_1[c].force;
        struct contact_wrench mean;

        if (vec3_dot(w, w) + vec3_dot(w_1, w_1) == 0.0) {
            continue;
        }
        for (int i = 0; i < 3; i++) {
            mean.force[i] = w_1[i] + IMPLICIT_GAMMA * (w[i] - w_1[i]);
            mean.moment[i] = im->wrench_1[c].moment[i] +
                             IMPLICIT_GAMMA * (im->wrench[c].moment[i] - im->wrench_1[c].moment[i]);
        }
        plant_raise_peak(plant, c, &mean);

        /* Add the impulse, with its moment about the world's origin */
        struct contact_wrench *sum = &plant->impulse[c];
        double moment[2][3];

        vec3_cross(im->origin_1[c], w_1, moment[0]);
        vec3_cross(implicit_motion(plant, (int)c)->p, w, moment[1]);
        vec3_add_scaled(sum->force, im->h, mean.force, sum->force);
        vec3_add_scaled(sum->moment, im->h, mean.moment, sum->moment);
        vec3_add_scaled(sum->moment, im->h - im->stage_h, moment[0], sum->moment);
        vec3_add_scaled(sum->moment, im->stage_h, moment[1], sum->moment);
    }
}

/* Subtracts a part of a wrench on b at the pair's center from both bodies and from the pair
 * itself. */
static void take_off_pair(struct plant *plant, struct active_pair *pair, double part,
                          const struct spatial *wrench)
{
    for (int i = 0; i < 3; i++) {
        pair->decrease.l[i] += part * wrench->l[i];
        pair->decrease.a[i] += part * wrench->a[i];
    }
    for (int side = PAIR_A; side <= PAIR_B; side++) {
        if (pair->body[side] >= 0) {
            struct contact_wrench *own = &plant->implicit->wrench[pair->body[side]];
            struct spatial sum = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
            double arm[3];

            implicit_arm(plant, pair->body[side], pair->center, arm);
            spatial_add_wrench(side == PAIR_B ? -part : part, wrench, arm, &sum);
            add_scaled(1.0, sum.l, own->force, 3);
            add_scaled(1.0, sum.a, own->moment, 3);
        }
    }
}

void implicit_clamp_friction(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    for (size_t t = 0; t < im->nactive; t++) {
        const struct contact_tangent *tangent = &im->tangent[t];
        struct active_pair *pair = &im->active[t];
        const double normal = tangent->pressing - vec3_dot(tangent->normal, pair->decrease.l);
        struct spatial wrench;
        double friction, most;

        if (tangent->pressing == 0.0) {
            continue; /* the pair has no bristles */
        }
        if (normal <= 0.0) {
            /* Compute the wrench of the pair on b at the pair's center, at the stage */
            struct contact_world *engine = plant->config.contact;
            const size_t count = engine->ops->patches(engine, plant->patch, PLANT_PATCHES);

            memset(&wrench, 0, sizeof wrench);
            for (size_t i = 0; i < count && i < PLANT_PATCHES; i++) {
                if (plant->patch[i].pair == pair->index) {
                    vec3_sub(plant->patch[i].force, pair->decrease.l, wrench.l);
                    vec3_sub(plant->patch[i].moment, pair->decrease.a, wrench.a);
                }
            }
            take_off_pair(plant, pair, 1.0, &wrench);
            continue;
        }

        find_friction_wrench(plant, tangent, pair, &wrench);
        friction = vec3_norm(wrench.l);
        most = tangent->friction_max * normal;
        if (friction > most) {
            take_off_pair(plant, pair, 1.0 - most / friction, &wrench);
        }
    }
}

void implicit_last_forces(struct plant *plant)
{
    const struct implicit *im = plant->implicit;

    memcpy(plant->vdot, im->a, plant->config.robot->nv * sizeof *plant->vdot);
    memcpy(plant->contact_wrench, im->wrench,
           plant->config.ncontact * sizeof *plant->contact_wrench);
}

void implicit_patches(const struct plant *plant, struct contact_patch *patch, size_t count)
{
    const struct implicit *im = plant->implicit;

    for (size_t t = 0; t < im->nactive; t++) {
        const struct active_pair *pair = &im->active[t];

        for (size_t i = 0; i < count; i++) {
            if (patch[i].pair == pair->index) {
                struct spatial sum = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
                double arm[3];

                for (int k = 0; k < 3; k++) {
                    arm[k] = pair->center[k] - patch[i].center[k];
                }
                spatial_add_wrench(-1.0, &pair->decrease, arm, &sum);
                add_scaled(1.0, sum.l, patch[i].force, 3);
                add_scaled(1.0, sum.a, patch[i].moment, 3);
                break;
            }
        }
    }
}
