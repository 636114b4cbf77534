/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contact in a stage of the implicit integrator. Linearizes the active pairs with their tangents,
 * adds their inertias to the bodies, and computes the wrenches at the stage.
 */
#include "model/implicit/private.h"

#include <math.h>
#include <string.h>

/* Accuracy of friction relative to its limit. Friction aims below the limit by this part, so it
 * stays within the limit. */
#define ACCURATE 2e-5

/* Smallest normal force with friction, as a share of the normal force at the point. Friction that
 * holds may exceed its limit by the same share. */
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

/* Adds a wrench on b at the center of a pair, and a matrix S times scale, to the pair and to both
 * bodies. Their loads get S times the acceleration from base to point, so that S has no effect at
 * the point. */
static void change_pair(struct plant *plant, struct active_pair *pair, const struct spatial *wrench,
                        double scale, const double S[21])
{
    struct implicit *im = plant->implicit;
    struct spatial_inertia A;
    struct spatial load;
    double scaled[21] = {0.0};

    add_scaled(scale, S, scaled, 21);
    spatial_inertia_unpack(scaled, &A);
    spatial_inertia_add(&A, &pair->A);
    spatial_inertia_apply(&A, &pair->point, &load);
    for (int i = 0; i < 3; i++) {
        pair->changed.l[i] += wrench->l[i];
        pair->changed.a[i] += wrench->a[i];
        load.l[i] += wrench->l[i];
        load.a[i] += wrench->a[i];
    }

    /* The wrench on a is opposite to the wrench on b */
    for (int side = PAIR_A; side <= PAIR_B; side++) {
        int contact = pair->body[side];

        if (implicit_moves(plant, contact)) {
            struct spatial f = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
            struct spatial_inertia own = A;
            double arm[3];

            implicit_arm(plant, contact, pair->center, arm);
            spatial_add_wrench(side == PAIR_B ? 1.0 : -1.0, &load, arm, &f);
            add_contact_wrench(plant, contact, &f,
                               &plant->ext[plant->config.contact_body[contact]]);
            spatial_inertia_shift(arm, &own);
            spatial_inertia_add(&own, &im->contact_inertia[contact]);
        }
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
        /* Linearize one pair at the point */
        struct contact_tangent *tangent = &im->tangent[t];
        struct active_pair *pair = &im->active[t];
        const struct spatial none = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
        const double h = im->stage_h;
        double A[21];

        /* Store the pair's state at the point */
        pair->index = tangent->pair;
        pair->body[PAIR_A] = tangent->body_a;
        pair->body[PAIR_B] = tangent->body_b;
        memcpy(pair->center, tangent->center, sizeof pair->center);
        pair->point = relative_twist(plant, pair, im->twist_point);
        memset(&pair->beyond, 0, sizeof pair->beyond);
        pair->settled = tangent->sliding > 0.0 && pair_reverses(plant, tangent, pair);
        if (pair->settled) {
            add_scaled(1.0, tangent->slide_D, tangent->D, 21);
            add_scaled(1.0, tangent->slide_D, tangent->friction_D, 21);
        }
        pair->followed = pair->followed_1 = pair->found_1 = tangent->pressing;

        /* A = h (D + h K) */
        memset(&pair->A, 0, sizeof pair->A);
        memset(&pair->changed, 0, sizeof pair->changed);
        for (int i = 0; i < 21; i++) {
            A[i] = h * (tangent->D[i] + h * tangent->K[i]);
        }
        change_pair(plant, pair, &none, 1.0, A);
        im->coupled |=
            implicit_moves(plant, pair->body[PAIR_A]) && implicit_moves(plant, pair->body[PAIR_B]);
    }
    return ERROR_NONE;
}

void implicit_add_contact_inertia(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    if (im->has_added) {
        memset(im->added, 0, im->nobserved * sizeof *im->added);
    }
    im->has_added = im->ntouched > 0;
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
        wrench->l[i] = tangent->friction[CONTACT_MOVE_X + i] - h * decrease.l[i];
        wrench->a[i] = tangent->friction[CONTACT_TURN_X + i] - h * decrease.a[i];
    }
}

/* Lets the friction of a sliding pair follow the normal force found at the stage. Friction changes
 * the normal force in turn, almost linearly. So the secant through the last two solutions leads to
 * the force that friction and solution share. Returns the factor of the friction. */
static double follow_normal(const struct contact_tangent *tangent, struct active_pair *pair,
                            double found)
{
    const double change = pair->followed - pair->followed_1;
    const double slope = change == 0.0 ? 0.0 : (found - pair->found_1) / change;
    const double share = tangent->sliding / tangent->pressing;

    pair->followed_1 = pair->followed;
    pair->found_1 = found;
    pair->followed += (found - pair->followed) / (1.0 - fmin(slope, STEEPEST));
    pair->followed = fmax(SETTLED * tangent->pressing, pair->followed);
    return (1.0 + share * (pair->followed - tangent->pressing)) /
           (1.0 + share * (pair->followed_1 - tangent->pressing));
}

/* Revises the friction of one pair; returns whether its load or its inertia has changed. */
static bool revise_pair(struct plant *plant, struct contact_tangent *tangent,
                        struct active_pair *pair)
{
    const double found = tangent->pressing - vec3_dot(tangent->normal, pair->decrease.l);
    const double normal = (1.0 - ACCURATE) * fmax(0.0, found), least = SETTLED * tangent->pressing;
    const bool follows =
        tangent->sliding * fabs(normal - pair->followed) > fmax(least * SETTLED, ACCURATE * normal);
    const double most =
        found < 0.0 ? least : fmax(found, follows ? pair->followed : 0.0) * (1.0 + SETTLED);
    struct spatial friction, change;
    double D[21] = {0.0}, part, size; /* D: change of the friction's damping */

    /* A pair that pulls without friction is open */
    if (found < 0.0 && pair->followed <= least) {
        /* Remove a pair that pulls at the solved stage: its surfaces have separated */
        struct contact_world *engine = plant->config.contact;
        const size_t count = engine->ops->patches(engine, plant->patch, PLANT_PATCHES);
        struct spatial wrench = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
        double A[21];

        /* Take off the wrench at the point, its changes and A */
        for (size_t i = 0; i < count && i < PLANT_PATCHES; i++) {
            if (plant->patch[i].pair == pair->index) {
                vec3_add_scaled(wrench.l, -1.0, plant->patch[i].force, wrench.l);
                vec3_add_scaled(wrench.a, -1.0, plant->patch[i].moment, wrench.a);
            }
        }
        vec3_add_scaled(wrench.l, -1.0, pair->changed.l, wrench.l);
        vec3_add_scaled(wrench.a, -1.0, pair->changed.a, wrench.a);
        spatial_inertia_pack(&pair->A, A);
        change_pair(plant, pair, &wrench, -1.0, A);
        memset(tangent->friction, 0, sizeof tangent->friction);
        memset(tangent->friction_D, 0, sizeof tangent->friction_D);
        tangent->pressing = 0.0;

        return true;
    }
    find_friction_wrench(plant, tangent, pair, &friction);
    size = vec3_norm(friction.l);
    if (size > tangent->friction_max * most) {
        /* The pair begins to slide: its friction is at the limit, in the direction that it has at
         * the stage */
        follow_normal(tangent, pair, normal);
        part = tangent->friction_max * pair->followed / size;
        add_scaled(-1.0, tangent->friction_D, D, 21);
        tangent->sliding = 1.0;
        pair->settled = true;
    } else {
        if (!pair->settled && tangent->sliding > 0.0 && pair_reverses(plant, tangent, pair)) {
            /* Friction ends together with the velocity */
            memcpy(D, tangent->slide_D, sizeof D);
            pair->settled = true;
        } else if (!follows) {
            return false;
        }
        part = follows ? follow_normal(tangent, pair, normal) : 1.0;
        memcpy(friction.l, tangent->friction + CONTACT_MOVE_X, sizeof friction.l);
        memcpy(friction.a, tangent->friction + CONTACT_TURN_X, sizeof friction.a);
    }
    for (int i = 0; i < 3; i++) {
        change.l[i] = part * friction.l[i] - tangent->friction[CONTACT_MOVE_X + i];
        change.a[i] = part * friction.a[i] - tangent->friction[CONTACT_TURN_X + i];
        tangent->friction[CONTACT_MOVE_X + i] = part * friction.l[i];
        tangent->friction[CONTACT_TURN_X + i] = part * friction.a[i];
    }
    change_pair(plant, pair, &change, plant->implicit->stage_h, D);
    add_scaled(1.0, D, tangent->friction_D, 21);
    return true;
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
    if (again) {
        implicit_add_contact_inertia(plant);
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
        /* Compute beyond and decrease of a pair from the accelerations of the contact bodies */
        struct active_pair *pair = &im->active[t];
        struct spatial *beyond = &pair->beyond;

        /* The wrench decreases by A times the relative acceleration in excess of the point's */
        *beyond = relative_twist(plant, pair, plant->implicit->twist_z);
        vec3_sub(beyond->l, pair->point.l, beyond->l);
        vec3_sub(beyond->a, pair->point.a, beyond->a);
        spatial_inertia_apply(&pair->A, beyond, &pair->decrease);
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

        vec3_sub(pair->decrease.l, pair->changed.l, pair->decrease.l);
        vec3_sub(pair->decrease.a, pair->changed.a, pair->decrease.a);
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

                vec3_sub(pair->center, patch[i].center, arm);
                spatial_add_wrench(-1.0, &pair->decrease, arm, &sum);
                add_scaled(1.0, sum.l, patch[i].force, 3);
                add_scaled(1.0, sum.a, patch[i].moment, 3);
                break;
            }
        }
    }
}
