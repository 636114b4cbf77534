/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the bounding-volume tree, and collects the items that meet a box. */
#include "contact/mesh/tree.h"

#include "base/vec3.h"

#include <math.h>
#include <stdlib.h>

struct tree_builder {
    const struct box *box;
    double (*middle)[3]; /* twice the middle of each item's box */
    struct tree_node *node;
    int *item;
    int nnode, leaf;
};

/* Checks whether item x comes before y along an axis: by the middles of their boxes, then by
 * number, so that the order is total. */
static bool tree_item_before(const struct tree_builder *b, int axis, int x, int y)
{
    double mx = b->middle[x][axis], my = b->middle[y][axis];

    return mx != my ? mx < my : x < y;
}

static void tree_swap_items(int *x, int *y)
{
    int t = *x;

    *x = *y;
    *y = t;
}

/* Partially sorts item[first..last] so that the median is in its place (quickselect). */
static void tree_put_median(struct tree_builder *b, int axis, int first, int last)
{
    const int middle = first + (last - first) / 2;
    int *item = b->item;

    while (first < last) {
        int i = first, j = last, pivot = item[first + (last - first) / 2];

        /* Hoare's partition: items before the pivot to the left, after it to the right */
        while (i <= j) {
            while (tree_item_before(b, axis, item[i], pivot)) {
                ++i;
            }
            while (tree_item_before(b, axis, pivot, item[j])) {
                --j;
            }
            if (i <= j) {
                tree_swap_items(&item[i++], &item[j--]);
            }
        }

        /* Continues with the side that contains the middle */
        if (middle <= j) {
            last = j;
        } else if (middle >= i) {
            first = i;
        } else {
            return;
        }
    }
}

/* Returns the axis along which the middles of the items' boxes are most spread out. */
static int tree_find_axis(const struct tree_builder *b, const int *item, int count)
{
    struct box middles = box_of_point(b->middle[item[0]]);
    int axis = 0;

    for (int i = 1; i < count; i++) {
        box_add(&middles, b->middle[item[i]]);
    }
    for (int k = 1; k < 3; k++) {
        if (middles.high[k] - middles.low[k] > middles.high[axis] - middles.low[axis]) {
            axis = k;
        }
    }
    return axis;
}

/* Makes the node over count items from first on, and all nodes below it. */
static void tree_split(struct tree_builder *b, int first, int count)
{
    struct tree_node *node = &b->node[b->nnode++];

    /* Few items are a leaf */
    node->first = first;
    if (count <= b->leaf) {
        node->box = b->box[b->item[first]];
        for (int i = 1; i < count; i++) {
            box_add_box(&node->box, &b->box[b->item[first + i]]);
        }
        node->count = count;
        node->size = 1;
        return;
    }

    /* Splits more items at the median; the box covers the boxes of both halves */
    tree_put_median(b, tree_find_axis(b, b->item + first, count), first, first + count - 1);
    node->count = 0;
    tree_split(b, first, count / 2);
    tree_split(b, first + count / 2, count - count / 2);
    node->size = (int)(b->node + b->nnode - node);
    node->box = node[1].box;
    box_add_box(&node->box, &node[1 + node[1].size].box);
}

enum error_code tree_build(const struct box *boxes, size_t n, int leaf, struct arena *arena,
                           struct tree *tree, struct error *error)
{
    struct tree_builder b = {.box = boxes, .leaf = leaf, .middle = malloc(n * sizeof *b.middle)};

    b.node = arena_alloc(arena, 2 * n, sizeof *b.node);
    b.item = arena_alloc(arena, n, sizeof *b.item);
    if (!b.middle || !b.node || !b.item) {
        free(b.middle);
        return error_set(error, ERROR_MEMORY, "contact: no memory for a tree over %zu items", n);
    }
    for (size_t i = 0; i < n; i++) {
        b.item[i] = (int)i;
        for (int k = 0; k < 3; k++) {
            b.middle[i][k] = boxes[i].low[k] + boxes[i].high[k];
        }
    }
    tree_split(&b, 0, (int)n);
    free(b.middle);
    *tree = (struct tree){.node = b.node, .item = b.item, .nnode = (size_t)b.nnode};
    return ERROR_NONE;
}

void tree_cover(const struct tree *tree, const struct box *boxes, struct box *out)
{
    /* Children come after their parents */
    for (size_t i = tree->nnode; i-- > 0;) {
        const struct tree_node *node = &tree->node[i];

        out[i] = node->count ? boxes[tree->item[node->first]] : out[i + 1];
        for (int k = 1; k < node->count; k++) {
            box_add_box(&out[i], &boxes[tree->item[node->first + k]]);
        }
        if (node->count == 0) {
            box_add_box(&out[i], &out[i + 1 + (size_t)node[1].size]);
        }
    }
}

size_t tree_collect(const struct tree *tree, const struct box *box, int *list, size_t max)
{
    const struct tree_node *node = tree->node, *end = tree_end(tree);
    size_t n = 0;

    while (node != end && n < max) {
        if (!boxes_meet(&node->box, box)) {
            node += node->size;
            continue;
        }
        for (int i = 0; i < node->count && n < max; i++) {
            list[n++] = tree->item[node->first + i];
        }
        ++node;
    }
    return n;
}

void box_transform(const struct box *box, const double R[9], const double p[3], struct box *out)
{
    double center[3], half[3], to[3];

    for (int k = 0; k < 3; k++) {
        center[k] = (box->low[k] + box->high[k]) / 2;
        half[k] = (box->high[k] - box->low[k]) / 2;
    }
    mat3_apply(R, center, to);
    for (int k = 0; k < 3; k++) {
        double reach =
            fabs(R[3 * k]) * half[0] + fabs(R[3 * k + 1]) * half[1] + fabs(R[3 * k + 2]) * half[2];

        out->low[k] = to[k] + p[k] - reach;
        out->high[k] = to[k] + p[k] + reach;
    }
}
