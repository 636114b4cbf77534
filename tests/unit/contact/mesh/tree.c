/* SPDX-License-Identifier: Apache-2.0 */
/* The bounding-volume tree against brute force. */
#include "contact/mesh/tree.h"

#include "tests/unit/arena_fixture.h"
#include "tests/unit/contact/random_number.h"

enum { COUNT = 500 };

static struct box boxes[COUNT];
static struct tree tree;

static void make_tree(uint64_t *seed, int leaf)
{
    for (int i = 0; i < COUNT; i++) {
        for (int k = 0; k < 3; k++) {
            boxes[i].low[k] = random_number(seed);
            boxes[i].high[k] = boxes[i].low[k] + 0.1 * fabs(random_number(seed));
        }
    }
    assert_ok(tree_build(boxes, COUNT, leaf, &arena, &tree, NULL));
}

TEST(a_tree_collects_no_more_than_there_is_room_for)
{
    const struct box everything = {{-2, -2, -2}, {2, 2, 2}};
    uint64_t seed = 3;
    int list[20];

    make_tree(&seed, 2);
    list[13] = -1;
    assert_int_equal(tree_collect(&tree, &everything, list, 13), 13);
    assert_int_equal(list[13], -1);
    assert_int_equal(tree_collect(&tree, &everything, list, 0), 0);
}

TEST(a_tree_collects_what_brute_force_finds)
{
    uint64_t seed = 9;

    make_tree(&seed, 1);
    for (int i = 0; i < 300; i++) {
        unsigned char found[COUNT] = {0};
        int list[COUNT];
        struct box query;
        size_t n;

        for (int k = 0; k < 3; k++) {
            query.low[k] = random_number(&seed);
            query.high[k] = query.low[k] + 0.5 * fabs(random_number(&seed));
        }
        n = tree_collect(&tree, &query, list, sizeof list / sizeof *list);
        for (size_t j = 0; j < n; j++) {
            assert_int_equal(found[list[j]]++, 0);
        }
        for (int j = 0; j < COUNT; j++) {
            assert_int_equal(found[j], boxes_meet(&boxes[j], &query));
        }
    }
}

/* What a walk that steps over nodes rests on. */
TEST(nodes_are_in_preorder_and_know_how_many_are_below_them)
{
    const struct box everything = {{-2, -2, -2}, {2, 2, 2}};
    uint64_t seed = 17;
    int items = 0, list[COUNT];

    make_tree(&seed, 3);
    assert_ptr_equal(tree.node + tree.node->size, tree_end(&tree));
    for (const struct tree_node *node = tree.node; node != tree_end(&tree); node++) {
        const struct tree_node *left = node + 1, *right;

        items += node->count;
        if (node->count > 0) {
            assert_true(node->count <= 3);
            assert_int_equal(node->size, 1);
            continue;
        }
        right = left + left->size;
        assert_int_equal(node->size, 1 + left->size + right->size);
        for (int k = 0; k < 3; k++) {
            assert_true(node->box.low[k] == fmin(left->box.low[k], right->box.low[k]));
            assert_true(node->box.high[k] == fmax(left->box.high[k], right->box.high[k]));
        }
    }
    assert_int_equal(items, COUNT);
    assert_int_equal(tree_collect(&tree, &everything, list, COUNT), COUNT);
    for (int i = 0; i < COUNT; i++) {
        assert_int_equal(list[i], tree.item[i]);
    }
}

TEST(a_cover_holds_what_is_below_each_node)
{
    struct box *cover;
    uint64_t seed = 23;

    make_tree(&seed, 2);
    cover = arena_alloc(&arena, tree.nnode, sizeof *cover);
    assert_non_null(cover);
    tree_cover(&tree, boxes, cover);
    for (size_t i = 0; i < tree.nnode; i++) {
        assert_memory_equal(&cover[i], &tree.node[i].box, sizeof *cover);
    }
}

TEST_GROUP(open_arena, close_arena)
