/* SPDX-License-Identifier: Apache-2.0 */
/* Building the tree of boxes, and collecting what meets a box. */
#include "contact/tree.h"

#include <string.h>

struct build {
    const struct box *box;
    struct tree_node *node;
    int *item;
    int nnode, leaf;
};

/* Twice the middle of a thing's box along an axis; ties go by number, so the order is total. */
static bool before(const struct build *b, int axis, int x, int y)
{
    double mx = b->box[x].low[axis] + b->box[x].high[axis];
    double my = b->box[y].low[axis] + b->box[y].high[axis];

    return mx != my ? mx < my : x < y;
}

static void swap(int *x, int *y)
{
    int t = *x;

    *x = *y;
    *y = t;
}

/* Orders item[first..last] just so far that the middle one is in its place. */
static void put_median(struct build *b, int axis, int first, int last)
{
    const int middle = first + (last - first) / 2;
    int *item = b->item;

    while (first < last) {
        int i = first, j = last, pivot = item[first + (last - first) / 2];

        while (i <= j) {
            while (before(b, axis, item[i], pivot)) {
                ++i;
            }
            while (before(b, axis, pivot, item[j])) {
                --j;
            }
            if (i <= j) {
                swap(&item[i++], &item[j--]);
            }
        }
        if (middle <= j) {
            last = j;
        } else if (middle >= i) {
            first = i;
        } else {
            return;
        }
    }
}

static void split(struct build *b, int first, int count)
{
    struct tree_node *node = &b->node[b->nnode++];
    struct box middles = {.low = {0}};
    int axis = 0;

    node->box = b->box[b->item[first]];
    for (int i = 0; i < count; ++i) {
        const struct box *box = &b->box[b->item[first + i]];
        double middle[3];

        box_add(&node->box, box->low);
        box_add(&node->box, box->high);
        for (int k = 0; k < 3; ++k) {
            middle[k] = box->low[k] + box->high[k];
        }
        if (i == 0) {
            memcpy(middles.low, middle, sizeof middle);
            memcpy(middles.high, middle, sizeof middle);
        }
        box_add(&middles, middle);
    }
    node->first = first;
    if (count <= b->leaf) {
        node->count = count;
        return;
    }
    for (int k = 1; k < 3; ++k) {
        if (middles.high[k] - middles.low[k] > middles.high[axis] - middles.low[axis]) {
            axis = k;
        }
    }
    put_median(b, axis, first, first + count - 1);
    node->count = 0;
    split(b, first, count / 2);
    node->right = b->nnode;
    split(b, first + count / 2, count - count / 2);
}

enum error_code tree_build(const struct box *boxes, size_t n, int leaf, struct arena *arena,
                           struct tree *tree, struct error *error)
{
    struct build b = {.box = boxes, .leaf = leaf};

    b.node = arena_alloc(arena, 2 * n, sizeof *b.node);
    b.item = arena_alloc(arena, n, sizeof *b.item);
    if (!b.node || !b.item) {
        return error_set(error, ERROR_MEMORY, "contact: no memory for a tree over %zu faces", n);
    }
    for (size_t i = 0; i < n; ++i) {
        b.item[i] = (int)i;
    }
    split(&b, 0, (int)n);
    *tree = (struct tree){.node = b.node, .item = b.item, .nnode = (size_t)b.nnode, .nitem = n};
    return ERROR_NONE;
}

void tree_cover(const struct tree *tree, const struct box *boxes, struct box *out)
{
    /* children come after their parents */
    for (size_t i = tree->nnode; i-- > 0;) {
        const struct tree_node *node = &tree->node[i];

        out[i] = node->count ? boxes[tree->item[node->first]] : out[i + 1];
        for (int k = 1; k < node->count; ++k) {
            box_add(&out[i], boxes[tree->item[node->first + k]].low);
            box_add(&out[i], boxes[tree->item[node->first + k]].high);
        }
        if (node->count == 0) {
            box_add(&out[i], out[node->right].low);
            box_add(&out[i], out[node->right].high);
        }
    }
}

size_t tree_collect(const struct tree *tree, const struct box *box, int *list, size_t max)
{
    int stack[TREE_DEPTH_MAX], top = 0;
    size_t n = 0;

    stack[top++] = 0;
    while (top > 0 && n < max) {
        int index = stack[--top];
        const struct tree_node *node = &tree->node[index];

        if (!boxes_meet(&node->box, box)) {
            continue;
        }
        if (node->count == 0) {
            stack[top++] = node->right;
            stack[top++] = index + 1;
            continue;
        }
        for (int i = 0; i < node->count && n < max; ++i) {
            list[n++] = tree->item[node->first + i];
        }
    }
    return n;
}
