/* SPDX-License-Identifier: Apache-2.0 */
/* The table of faults: windows, switching by hand, events, names. */
#include "tests/unit/faults/lines.h"

static struct error error;

struct bench {
    struct arena arena;
    struct faults *faults;
};

static void set_up(struct bench *bench)
{
    const struct fault fault[] = {parse("motor LKneeSag jam 2..2.5"),
                                  parse("lossy: bus left_leg loss 0.1 manual"),
                                  parse("sensor imu off 0..0.001")};

    assert_ok(arena_init(&bench->arena, 1 << 20, &error));
    assert_ok(faults_create(fault, 3, 7, &bench->arena, &bench->faults, &error));
}

static void tear_down(struct bench *bench)
{
    arena_fini(&bench->arena);
}

BENCH(set_up, struct bench, tear_down)

static bool is_active(const struct bench *bench, size_t i)
{
    return faults_at(bench->faults, i)->active;
}

TEST_ON(window_holds_from_its_begin_to_before_its_end, set_up, bench)
{
    assert_false(is_active(bench, 2)); /* not before the first step */
    faults_step(bench->faults, 0);
    assert_true(is_active(bench, 2) && !is_active(bench, 0) && !is_active(bench, 1));
    faults_step(bench->faults, SECOND / 1000);
    assert_false(is_active(bench, 2));
    faults_step(bench->faults, 2 * SECOND - 1);
    assert_false(is_active(bench, 0));
    faults_step(bench->faults, 2 * SECOND);
    assert_true(is_active(bench, 0));
    faults_step(bench->faults, 5 * SECOND / 2 - 1);
    assert_true(is_active(bench, 0));
    faults_step(bench->faults, 5 * SECOND / 2);
    assert_false(is_active(bench, 0));
}

TEST_ON(hand_overrules_the_clock, set_up, bench)
{
    int lossy = faults_find(bench->faults, "lossy");

    assert_int_equal(lossy, 1);
    assert_int_equal(faults_seed(bench->faults), 7);
    assert_int_equal(faults_count(bench->faults), 3);
    assert_int_equal(faults_find(bench->faults, "1"), 0);
    assert_int_equal(faults_find(bench->faults, "3"), 2);
    assert_int_equal(faults_find(bench->faults, "none"), -1);
    assert_true(faults_set(bench->faults, 0, 1, true));
    assert_true(is_active(bench, 1));
    faults_step(bench->faults, SECOND);
    assert_true(is_active(bench, 1));
    assert_true(faults_set(bench->faults, SECOND, 0, false));
    faults_step(bench->faults, 2 * SECOND);
    assert_false(is_active(bench, 0));
    assert_false(faults_set(bench->faults, 2 * SECOND, 3, true));
}

TEST_ON(each_change_is_one_event, set_up, bench)
{
    struct fault_event event;
    char text[256];

    for (int64_t ms = 0; ms < 3000; ms++) {
        faults_step(bench->faults, ms * 1000000);
    }
    faults_set(bench->faults, 2999 * (SECOND / 1000), 1, true);
    faults_set(bench->faults, 2999 * (SECOND / 1000), 1, true);
    for (int i = 0; i < 4; i++) {
        assert_true(faults_next_event(bench->faults, &event));
    }
    fault_event_format(bench->faults, &event, text, sizeof text);
    assert_string_equal(text, "2.500000 s: fault 1 ends: motor LKneeSag jam 2..2.5");
    assert_true(faults_next_event(bench->faults, &event));
    fault_event_format(bench->faults, &event, text, sizeof text);
    assert_string_equal(
        text, "2.999000 s: fault lossy begins (by hand): lossy: bus left_leg loss 0.1 manual");
    assert_false(faults_next_event(bench->faults, &event));
}

TEST_ON(a_run_may_have_no_faults, set_up, bench)
{
    struct fault_event event;
    struct faults *faults;

    assert_ok(faults_create(NULL, 0, 7, &bench->arena, &faults, &error));
    assert_int_equal(faults_count(faults), 0);
    faults_step(faults, SECOND);
    assert_false(faults_set(faults, SECOND, 0, true));
    assert_false(faults_next_event(faults, &event));
}

/* A name of one letter counts, and so does the number of another fault. */
TEST_ON(refuses_the_number_of_another_fault_as_a_name, set_up, bench)
{
    const struct fault fault[] = {parse("a: motor LKneeSag jam"), parse("3: motor LHipSag jam"),
                                  parse("motor LHipSag jam")};
    struct faults *faults;

    assert_ok(faults_create(fault, 2, 7, &bench->arena, &faults, &error));
    assert_int_equal(faults_find(faults, "a"), 0);
    assert_int_equal(faults_create(fault, 3, 7, &bench->arena, &faults, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "name 3 again"));
}

TEST_ON(refuses_one_name_twice, set_up, bench)
{
    const struct fault fault[] = {parse("a: motor LKneeSag jam"), parse("a: motor LHipSag jam")};
    struct faults *faults;

    assert_int_equal(faults_create(fault, 2, 7, &bench->arena, &faults, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "name a again"));
}
