/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Bounding-volume tree: a binary tree of axis-aligned boxes over items that do not move in their
 * frame; meters. It is built once by median splits along the longest side. So its depth is the
 * logarithm of the number of items, and the cost of a walk is bounded. Its order depends on the
 * boxes only. The arena owns its memory. Building is not RT-safe; boxes and walks are.
 */
#ifndef CONTACT_MESH_TREE_H
#define CONTACT_MESH_TREE_H

#include "base/arena.h"
#include "base/error.h"

#define TREE_DEPTH_MAX 48 /* stack size for a search; 2^32 items need 33 */

/* An axis-aligned box, m. */
struct box {
    double low[3], high[3];
};

/* Nodes are in preorder: a node, then its left subtree, then its right subtree. So a walk needs no
 * stack; it skips a subtree by its size:
 *
 *     for (node = tree->node; node != tree_end(tree);) {
 *         if (nothing below the node is wanted) {
 *             node += node->size;
 *             continue;
 *         }
 *         ... item[node->first] to item[node->first + node->count - 1] (of an inner node none)
 *         ++node;
 *     } */
struct tree_node {
    struct box box;
    int first,
        count; /* a leaf's items are item[first] to item[first + count - 1]; inner: count 0 */
    /* nodes of its subtree, including itself; its children are node + 1 and node + 1 +
     * node[1].size */
    int size;
};

/* A bounding-volume tree over items, which are numbers chosen by the caller. */
struct tree {
    const struct tree_node *node; /* node[0] is the root */
    const int *item;
    size_t nnode;
};

/* Returns the address after the last node. RT-safe. */
static inline const struct tree_node *tree_end(const struct tree *tree)
{
    return tree->node + tree->nnode;
}

/* Builds a tree over n > 0 items with these boxes; a leaf holds at most `leaf` items. Memory from
 * arena; the only error is ERROR_MEMORY. Not RT-safe. */
enum error_code tree_build(const struct box *boxes, size_t n, int leaf, struct arena *arena,
                           struct tree *tree, struct error *error);

/* Computes bounds of another property of the items, such as their normals: out[i] covers the boxes
 * of all items under node i. Not RT-safe. */
void tree_cover(const struct tree *tree, const struct box *boxes, struct box *out);

/* Lists the items of all leaves whose box meets `box`, in the tree's order; stops at max. Returns
 * their number. RT-safe. */
size_t tree_collect(const struct tree *tree, const struct box *box, int *list, size_t max);

/* ---- boxes; RT-safe ---- */

/* Returns the box of one point. */
static inline struct box box_of_point(const double p[3])
{
    return (struct box){.low = {p[0], p[1], p[2]}, .high = {p[0], p[1], p[2]}};
}

/* Grows the box to hold a point. */
static inline void box_add(struct box *box, const double p[3])
{
    for (int i = 0; i < 3; i++) {
        box->low[i] = p[i] < box->low[i] ? p[i] : box->low[i];
        box->high[i] = p[i] > box->high[i] ? p[i] : box->high[i];
    }
}

/* Grows the box to hold another box. */
static inline void box_add_box(struct box *box, const struct box *other)
{
    box_add(box, other->low);
    box_add(box, other->high);
}

/* Checks whether two boxes overlap or touch. */
static inline bool boxes_meet(const struct box *a, const struct box *b)
{
    return a->low[0] <= b->high[0] && b->low[0] <= a->high[0] && a->low[1] <= b->high[1] &&
           b->low[1] <= a->high[1] && a->low[2] <= b->high[2] && b->low[2] <= a->high[2];
}

/* Returns the smallest value of d . p over the points p of the box. */
static inline double box_least(const struct box *box, const double d[3])
{
    return d[0] * (d[0] > 0 ? box->low[0] : box->high[0]) +
           d[1] * (d[1] > 0 ? box->low[1] : box->high[1]) +
           d[2] * (d[2] > 0 ? box->low[2] : box->high[2]);
}

/* Returns the square of a point's distance to the box, m2; 0 inside. */
static inline double box_distance2(const struct box *box, const double p[3])
{
    double sum = 0;

    for (int i = 0; i < 3; i++) {
        double below = box->low[i] - p[i], above = p[i] - box->high[i];
        double d = below > above ? below : above;

        sum += d > 0 ? d * d : 0;
    }
    return sum;
}

/* Computes the box about a transformed box. R (columns) and p are axes and origin of the box's
 * frame in the new frame. */
void box_transform(const struct box *box, const double R[9], const double p[3], struct box *out);

#endif
