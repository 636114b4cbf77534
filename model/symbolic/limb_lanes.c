/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Assigns limbs to lanes. A limb is a sequence of bodies without a branch. Two limbs may form a
 * bundle if the joints of the shorter limb turn about the same axes as the first joints of the
 * longer limb. The groups of all bundles must have an order with parents before children. Otherwise
 * a group would depend on itself.
 */
#include "model/symbolic/tree.h"

#include <stdlib.h>
#include <string.h>

struct limb {
    int first, length;
    int bundle;
};

struct limbs {
    const struct tree *tree;
    int count;
    struct limb *limb;
    int *next;   /* by body: index of the only child, or -1 */
    bool *moved; /* scratch, by limb */
};

/* Returns whether two joints need equal operations; their constants may differ. */
static bool same_joint(const struct tree_body *a, const struct tree_body *b)
{
    if (a->prismatic != b->prismatic || a->axis != b->axis || a->nturn != b->nturn) {
        return false;
    }
    for (int n = 0; n < a->nturn; n++) {
        if (a->turn[n].axis != b->turn[n].axis) {
            return false;
        }
    }
    return true;
}

/* Fills next and limb. A body with one child continues its limb; the base and any other body ends
 * it. */
static void find_limbs(struct limbs *limbs)
{
    const struct tree *tree = limbs->tree;
    int n = (int)tree->nbody;

    /* Find the only child of each body */
    for (int b = 0; b < n; b++) {
        int children = 0;

        limbs->next[b] = -1;
        for (int c = b + 1; c < n; c++) {
            if (tree->body[c].parent == b) {
                limbs->next[b] = c;
                children++;
            }
        }
        if (children != 1 || b == 0) {
            limbs->next[b] = -1;
        }
    }

    /* A limb begins at each body that is not an only child */
    for (int b = 1; b < n; b++) {
        int parent = tree->body[b].parent;

        if (limbs->next[parent] != b) {
            struct limb *limb = &limbs->limb[limbs->count];

            limb->first = b;
            limb->bundle = limbs->count++;
            for (int c = b; c >= 0; c = limbs->next[c]) {
                limb->length++;
            }
        }
    }
}

/* Returns whether the shorter limb's joints match the first joints of the longer one. */
static bool limbs_match(const struct limbs *limbs, const struct limb *a, const struct limb *b)
{
    int x = a->first, y = b->first;

    while (x >= 0 && y >= 0) {
        if (!same_joint(&limbs->tree->body[x], &limbs->tree->body[y])) {
            return false;
        }
        x = limbs->next[x];
        y = limbs->next[y];
    }
    return true;
}

/* Lists the limbs of a bundle, longest first. Returns their number. */
static int bundle_members(const struct limbs *limbs, int bundle, int *member)
{
    int count = 0;

    for (int n = 0; n < limbs->count; n++) {
        if (limbs->limb[n].bundle == bundle) {
            int at = count++;

            while (at > 0 && limbs->limb[member[at - 1]].length < limbs->limb[n].length) {
                member[at] = member[at - 1];
                at--;
            }
            member[at] = n;
        }
    }
    return count;
}

/* Makes the groups of the bundles in order; group 0 is the base. */
static void make_groups(const struct limbs *limbs, struct tree *tree)
{
    memset(tree->group, 0, tree->nbody * sizeof *tree->group);
    tree->group[0] = (struct tree_group){.width = 1, .count = 1, .parent_group = {-1}};
    tree->group_of[0] = tree->lane_of[0] = 0;
    tree->ngroup = 1;
    for (int bundle = 0; bundle < limbs->count; bundle++) {
        int member[TREE_LANES], at[TREE_LANES];
        int count = bundle_members(limbs, bundle, member);

        /* Go along all limbs of the bundle until the longest limb ends */
        for (int l = 0; l < count; l++) {
            at[l] = limbs->limb[member[l]].first;
        }
        while (count > 0) {
            struct tree_group *group = &tree->group[tree->ngroup];
            int active = 0;

            group->count = count;
            group->width = count > 2 ? 4 : count;
            for (int l = 0; l < count; l++) {
                group->body[l] = at[l];
                tree->group_of[at[l]] = (int)tree->ngroup;
                tree->lane_of[at[l]] = l;
                at[l] = limbs->next[at[l]];
                active += at[l] >= 0;
            }

            /* Lanes without a body repeat lane 0 */
            for (int l = count; l < group->width; l++) {
                group->body[l] = group->body[0];
            }
            tree->ngroup++;
            count = active;
        }
    }

    /* Find the index of each lane's parent */
    for (size_t g = 1; g < tree->ngroup; g++) {
        for (int l = 0; l < tree->group[g].width; l++) {
            int parent = tree->body[tree->group[g].body[l]].parent;

            tree->group[g].parent_group[l] = tree->group_of[parent];
            tree->group[g].parent_lane[l] = tree->lane_of[parent];
        }
    }
}

/* Sorts the groups with parents before children; returns false if there is no such order. sorted
 * and place: scratch. */
static bool sort_groups(struct tree *tree, struct tree_group *sorted, int *place)
{
    size_t done = 0;

    for (size_t g = 0; g < tree->ngroup; g++) {
        place[g] = -1;
    }

    /* In each round, add the groups whose parents are already sorted */
    while (done < tree->ngroup) {
        size_t before = done;

        for (size_t g = 0; g < tree->ngroup; g++) {
            bool ready = place[g] < 0;

            for (int l = 0; ready && l < tree->group[g].width; l++) {
                int parent = tree->group[g].parent_group[l];

                ready = parent < 0 || place[parent] >= 0;
            }
            if (ready) {
                place[g] = (int)done;
                sorted[done++] = tree->group[g];
            }
        }
        if (done == before) {
            return false;
        }
    }

    /* Replace the indices of parents by the new indices */
    for (size_t g = 0; g < tree->ngroup; g++) {
        for (int l = 0; l < sorted[g].width; l++) {
            int parent = sorted[g].parent_group[l];

            sorted[g].parent_group[l] = parent < 0 ? -1 : place[parent];
        }
    }
    memcpy(tree->group, sorted, tree->ngroup * sizeof *sorted);
    for (size_t b = 0; b < tree->nbody; b++) {
        tree->group_of[b] = place[tree->group_of[b]];
    }
    return true;
}

/* Joins the bundles of limbs a and b if they fit. */
static void try_bundle(struct limbs *limbs, struct tree *tree, int lanes, int a, int b,
                       struct tree_group *sorted, int *place)
{
    int from = limbs->limb[b].bundle, to = limbs->limb[a].bundle, count = 0;

    if (from == to) {
        return;
    }

    /* Each limb of one bundle must match each limb of the other, and their number must fit the
     * lanes */
    for (int n = 0; n < limbs->count; n++) {
        bool in_a = limbs->limb[n].bundle == to, in_b = limbs->limb[n].bundle == from;

        count += in_a || in_b;
        for (int m = 0; in_a && m < limbs->count; m++) {
            if (limbs->limb[m].bundle == from &&
                !limbs_match(limbs, &limbs->limb[n], &limbs->limb[m])) {
                return;
            }
        }
    }
    if (count > lanes) {
        return;
    }

    /* Join the bundles. Separate them again if the groups then have no order */
    for (int n = 0; n < limbs->count; n++) {
        limbs->moved[n] = limbs->limb[n].bundle == from;
        if (limbs->moved[n]) {
            limbs->limb[n].bundle = to;
        }
    }
    make_groups(limbs, tree);
    if (!sort_groups(tree, sorted, place)) {
        for (int n = 0; n < limbs->count; n++) {
            if (limbs->moved[n]) {
                limbs->limb[n].bundle = from;
            }
        }
    }
}

enum error_code tree_assign_lanes(struct tree *tree, int lanes, struct error *error)
{
    struct limbs limbs = {.tree = tree};
    struct tree_group *sorted = calloc(tree->nbody, sizeof *sorted);
    int *place = calloc(tree->nbody, sizeof *place);
    enum error_code code = ERROR_NONE;

    limbs.limb = calloc(tree->nbody, sizeof *limbs.limb);
    limbs.next = calloc(tree->nbody, sizeof *limbs.next);
    limbs.moved = calloc(tree->nbody, sizeof *limbs.moved);
    if (sorted && place && limbs.limb && limbs.next && limbs.moved) {
        find_limbs(&limbs);

        /* Bundle equal limbs with one parent first, then equal limbs anywhere, then partial
         * matches */
        for (int round = 0; round < 3; round++) {
            for (int a = 0; a < limbs.count; a++) {
                for (int b = a + 1; b < limbs.count; b++) {
                    const struct limb *x = &limbs.limb[a], *y = &limbs.limb[b];
                    bool siblings = tree->body[x->first].parent == tree->body[y->first].parent;

                    if ((round > 1 || x->length == y->length) && (round > 0 || siblings) &&
                        limbs_match(&limbs, x, y)) {
                        try_bundle(&limbs, tree, lanes, a, b, sorted, place);
                    }
                }
            }
        }
        make_groups(&limbs, tree);
        sort_groups(tree, sorted, place);
    } else {
        code = error_set(error, ERROR_MEMORY, "no memory for %zu limbs", tree->nbody);
    }
    free(sorted);
    free(place);
    free(limbs.limb);
    free(limbs.next);
    free(limbs.moved);
    return code;
}
