/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contact in a step of the implicit integrator: the active pairs with their tangents, what they
 * add to the inertias of their bodies, and the wrenches at the end of the step.
 */
#include "model/implicit_private.h"

#include <string.h>

static const char too_many_pairs[] =
    "contact: more pairs are active than the implicit integrator takes";

/* Adds to x what body number side of the pair does at the center when y is its motion: b counts
 * positive, a negative. */
static void add_relative(const struct plant *plant, const struct active_pair *pair, int side,
                         const struct spatial *y, struct spatial *x)
{
    struct spatial at;
    double arm[3];

    implicit_arm(plant, pair->body[side], pair->center, arm);
    at = spatial_motion_at(y, arm);
    for (int i = 0; i < 3; i++) {
        x->a[i] += side == PAIR_B ? at.a[i] : -at.a[i];
        x->l[i] += side == PAIR_B ? at.l[i] : -at.l[i];
    }
}

/* The velocity of b at the center less that of a. */
static struct spatial relative_velocity(const struct plant *plant, const struct active_pair *pair)
{
    struct spatial V = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};

    for (int side = PAIR_A; side <= PAIR_B; side++) {
        if (pair->body[side] >= 0) {
            const struct body_motion *motion = implicit_motion(plant, pair->body[side]);
            struct spatial x;

            memcpy(x.a, motion->w, sizeof x.a);
            memcpy(x.l, motion->v, sizeof x.l);
            add_relative(plant, pair, side, &x, &V);
        }
    }
    return V;
}

/* One pair: its matrix to both bodies, and -h K V to what acts on them. */
static void linearize_pair(struct plant *plant, const struct contact_tangent *tangent, double h,
                           struct active_pair *pair)
{
    struct implicit *im = plant->implicit;
    struct spatial_inertia K;
    struct spatial V;
    double A[21];

    /* The pair as it is at the begin of the step */
    pair->index = tangent->pair;
    pair->body[PAIR_A] = tangent->body_a;
    pair->body[PAIR_B] = tangent->body_b;
    memcpy(pair->center, tangent->center, sizeof pair->center);

    /* A = h (D + h K), and h K V of the relative velocity V */
    for (int i = 0; i < 21; i++) {
        A[i] = h * (tangent->D[i] + h * tangent->K[i]);
    }
    spatial_inertia_unpack(A, &pair->A);
    spatial_inertia_unpack(tangent->K, &K);
    V = relative_velocity(plant, pair);
    for (int i = 0; i < 3; i++) {
        V.a[i] *= h;
        V.l[i] *= h;
    }
    spatial_inertia_apply(&K, &V, &pair->decrease);

    /* Both on the bodies that can move, about their origins; a feels the opposite of b */
    for (int side = PAIR_A; side <= PAIR_B; side++) {
        int contact = pair->body[side];

        if (implicit_moves(plant, contact)) {
            struct spatial f = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
            struct spatial_inertia own = pair->A;
            double arm[3];

            implicit_arm(plant, contact, pair->center, arm);
            spatial_add_wrench(side == PAIR_B ? -1.0 : 1.0, &pair->decrease, arm, &f);
            add_contact_wrench(plant, contact, &f,
                               &plant->ext[plant->config.contact_body[contact]]);
            spatial_inertia_shift(arm, &own);
            spatial_inertia_add(&own, &im->contact_inertia[contact]);
        }
    }
    im->coupled |=
        implicit_moves(plant, pair->body[PAIR_A]) && implicit_moves(plant, pair->body[PAIR_B]);
}

enum error_code implicit_linearize_contact(struct plant *plant, double h)
{
    struct implicit *im = plant->implicit;

    im->coupled = false;
    im->nactive = 0;
    memset(im->contact_inertia, 0, plant->config.ncontact * sizeof *im->contact_inertia);
    if (!plant->config.contact || (plant->clamped && plant->config.nfree == 0)) {
        return ERROR_NONE;
    }
    im->nactive = plant_contact_tangents(plant, im->tangent, IMPLICIT_TANGENTS);
    if (im->nactive > IMPLICIT_TANGENTS) {
        plant->failure = too_many_pairs;
        return ERROR_INPUT;
    }
    for (size_t t = 0; t < im->nactive; t++) {
        linearize_pair(plant, &im->tangent[t], h, &im->active[t]);
    }
    return ERROR_NONE;
}

void implicit_add_contact_inertia(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    memset(im->added, 0, im->nobserved * sizeof *im->added);
    for (size_t c = 0; c < plant->config.ncontact; c++) {
        if (!implicit_is_free(plant, (int)c)) {
            struct spatial_inertia own = im->contact_inertia[c];
            double back[9], S[21];

            mat3_transpose(implicit_motion(plant, (int)c)->R, back);
            spatial_inertia_rotate(back, &own);
            spatial_inertia_pack(&own, S);
            add_scaled(1.0, S, im->added[im->number[c]].A, 21);
        }
    }
}

void implicit_end_contact(struct plant *plant)
{
    struct implicit *im = plant->implicit;

    memcpy(im->wrench, plant->contact_wrench, plant->config.ncontact * sizeof *im->wrench);
    if (im->nactive > 0) {
        implicit_contact_accelerations(plant, im->a, im->twist_z);
    }
    for (size_t t = 0; t < im->nactive; t++) {
        struct active_pair *pair = &im->active[t];
        struct spatial A = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}}, f;

        /* By the relative acceleration A the wrench falls by another h (D + h K) A */
        for (int side = PAIR_A; side <= PAIR_B; side++) {
            if (pair->body[side] >= 0) {
                add_relative(plant, pair, side, &im->twist_z[pair->body[side]], &A);
            }
        }
        spatial_inertia_apply(&pair->A, &A, &f);
        add_scaled(1.0, f.l, pair->decrease.l, 3);
        add_scaled(1.0, f.a, pair->decrease.a, 3);

        /* ... on both bodies */
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
}

void implicit_recall(struct plant *plant)
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
