/* SPDX-License-Identifier: Apache-2.0 */
/* Lines of faults as people write them, right and wrong, and the table's clock. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "boards/faults.h"

#include <stdio.h>
#include <string.h>

#define SECOND INT64_C(1000000000)

static const char *const joints[] = {"LHipSag", "LKneeSag", "hand"};
static const bool driven[] = {true, true, false};
static const char *const fts[] = {"l_leg_ft", "r.leg.ft"};
static const char *const buses[] = {"left_leg", "torso"};
static const bool wire[] = {true, false};
static const char *const boards[] = {"left_leg/0x01", "ankle"};
static const size_t board_bus[] = {0, 0};
static const int board_address[] = {1, 13};

static const struct fault_names names = {
    .njoint = 3,
    .joint = joints,
    .driven = driven,
    .nft = 2,
    .ft = fts,
    .imu = true,
    .nbus = 2,
    .bus = buses,
    .wire = wire,
    .nboard = 2,
    .board = boards,
    .board_bus = board_bus,
    .board_address = board_address,
};

static struct fault parse(const char *text)
{
    struct fault fault;
    struct error error;

    if (fault_parse(text, &names, &fault, &error)) {
        fail_msg("%s", error.text);
    }
    return fault;
}

static void assert_refused(const char *text, enum error_code code, const char *message)
{
    struct fault fault;
    struct error error = {0};

    if (fault_parse(text, &names, &fault, &error) != code || !strstr(error.text, message)) {
        fail_msg("\"%s\" gave \"%s\", expected \"%s\"", text, error.text, message);
    }
}

static void reads_what_is_broken_how_and_when(void **unused)
{
    struct fault fault = parse("motor LKneeSag jam 2.0..2.5");

    (void)unused;
    assert_int_equal(fault.target, FAULT_MOTOR);
    assert_int_equal(fault.kind, FAULT_JAM);
    assert_int_equal(fault.index, 1);
    assert_int_equal(fault.from_ns, 2 * SECOND);
    assert_int_equal(fault.to_ns, 5 * SECOND / 2);
    assert_string_equal(fault.text, "motor LKneeSag jam 2.0..2.5");
    assert_string_equal(fault.name, "");
}

static void window_may_be_open_missing_or_manual(void **unused)
{
    struct fault fault = parse("motor LHipSag short 0.25..");

    (void)unused;
    assert_int_equal(fault.from_ns, SECOND / 4);
    assert_int_equal(fault.to_ns, INT64_MAX);
    fault = parse("motor LHipSag open_phase");
    assert_int_equal(fault.from_ns, 0);
    assert_int_equal(fault.to_ns, INT64_MAX);
    fault = parse("knee: motor LHipSag spring_break manual");
    assert_int_equal(fault.from_ns, INT64_MAX);
    assert_string_equal(fault.name, "knee");
}

static void sensors_are_numbered_through(void **unused)
{
    struct fault fault = parse("sensor LKneeSag.motor_encoder stuck 3..");

    (void)unused;
    assert_int_equal(fault.index, SENSOR_JOINT_CHANNELS + SENSOR_MOTOR_ENCODER);
    assert_int_equal(fault.channels, 1);
    fault = parse("sensor hand.link_encoder off");
    assert_int_equal(fault.index, 2 * SENSOR_JOINT_CHANNELS);
    fault = parse("sensor l_leg_ft off");
    assert_int_equal(fault.index, 3 * SENSOR_JOINT_CHANNELS);
    assert_int_equal(fault.channels, 6);
    fault = parse("sensor r.leg.ft.ty off");
    assert_int_equal(fault.index, 3 * SENSOR_JOINT_CHANNELS + 6 + 4);
    assert_int_equal(fault.channels, 1);
    fault = parse("sensor r.leg.ft off");
    assert_int_equal(fault.index, 3 * SENSOR_JOINT_CHANNELS + 6);
    fault = parse("sensor imu.accel_z off");
    assert_int_equal(fault.index, 3 * SENSOR_JOINT_CHANNELS + 2 * 6 + 5);
    fault = parse("sensor imu off");
    assert_int_equal(fault.channels, 6);
}

static void boards_have_a_name_or_an_address(void **unused)
{
    (void)unused;
    assert_int_equal(parse("board left_leg/0x01 off").index, 0);
    assert_int_equal(parse("board left_leg/1 off 1..1.2").index, 0);
    assert_int_equal(parse("board left_leg/13 stuck").index, 1);
    assert_int_equal(parse("board ankle garbage").index, 1);
}

static void parameters_have_keys_defaults_and_a_first(void **unused)
{
    struct fault fault = parse("sensor LKneeSag.torque wrong gain=1.1 offset=-0.5 1..2");

    (void)unused;
    assert_true(fault.value[0] == 1.1 && fault.value[1] == -0.5);
    fault = parse("sensor LKneeSag.torque wrong offset=2");
    assert_true(fault.value[0] == 1.0 && fault.value[1] == 2.0);
    fault = parse("bus left_leg loss 0.1");
    assert_true(fault.value[0] == 0.1);
    assert_int_equal(fault.id, -1);
    fault = parse("bus torso loss p=1 id=0x6f0 1..1.1");
    assert_int_equal(fault.id, 0x6f0);
    fault = parse("board ankle intermittent");
    assert_true(fault.value[0] == 0.5 && fault.value[1] == 0.02);
    fault = parse("supply sag 30 1..1.05");
    assert_int_equal(fault.target, FAULT_SUPPLY);
    assert_true(fault.value[0] == 30.0);
}

static void refuses_what_it_does_not_know_and_names_the_nearest(void **unused)
{
    (void)unused;
    assert_refused("", ERROR_INPUT, "expected sensor, board, motor, bus or supply");
    assert_refused("engine LKneeSag jam", ERROR_INPUT, "found \"engine\"");
    assert_refused("motor LKneeSga jam", ERROR_INPUT, "\"LKneeSag\"");
    assert_refused("motor LKneeSag jamm", ERROR_INPUT, "\"jam\"");
    assert_refused("motor LKneeSag", ERROR_INPUT, "open_phase, short, jam, spring_break");
    assert_refused("motor", ERROR_INPUT, "what is broken");
    assert_refused("sensor LKneeSag off", ERROR_INPUT, "JOINT.CHANNEL");
    assert_refused("sensor LKneeSag.torqe off", ERROR_INPUT, "\"torque\"");
    assert_refused("sensor l_leg_ft.fw off", ERROR_INPUT, "fx");
    assert_refused("board left_leg/2 off", ERROR_INPUT, "a board");
    assert_refused("bus left_leg wrong", ERROR_INPUT, "a kind of fault");
    assert_refused("sensor l_leg_ft loss 0.1", ERROR_INPUT, "a kind of fault");
}

static void refuses_wrong_numbers_and_windows(void **unused)
{
    (void)unused;
    assert_refused("bus left_leg loss", ERROR_INPUT, "expected p");
    assert_refused("bus left_leg loss 1.5", ERROR_INPUT, "p=0 to 1");
    assert_refused("bus left_leg loss nan", ERROR_INPUT, "p=0 to 1");
    assert_refused("bus left_leg loss 0.1 0.2", ERROR_INPUT, "once");
    assert_refused("bus left_leg loss q=0.2", ERROR_INPUT, "p=");
    assert_refused("bus left_leg loss 0.2 id=-1", ERROR_INPUT, "id=");
    assert_refused("motor LKneeSag jam 3", ERROR_INPUT, "FROM..TO");
    assert_refused("motor LKneeSag jam 3..2", ERROR_INPUT, "FROM before TO");
    assert_refused("motor LKneeSag jam -1..2", ERROR_INPUT, "FROM..TO");
    assert_refused("motor LKneeSag jam ..", ERROR_INPUT, "FROM..TO");
    assert_refused("motor LKneeSag jam 1..2 manual", ERROR_INPUT, "nothing after");
    assert_refused("bad/name: motor LKneeSag jam", ERROR_INPUT, "a name");
    assert_refused("sensor imu.gyro_x slow 0", ERROR_INPUT, "period=");
}

static void refuses_what_is_unsupported_there(void **unused)
{
    (void)unused;
    assert_refused("motor hand jam", ERROR_UNSUPPORTED, "no drive");
    assert_refused("bus torso error_burst 0.1", ERROR_UNSUPPORTED, "not in wire mode");
    assert_refused("bus torso id_collision", ERROR_UNSUPPORTED, "not in wire mode");
    parse("bus left_leg error_burst 0.1");
    parse("bus left_leg id_collision");
}

static void any_text_is_refused_or_read_and_nothing_else(void **unused)
{
    static const char alphabet[] = "sensor motor LKneeSag. jam 0.1..2=:/ left_leg\t\x01\xff bus id";
    uint32_t random = 1;

    (void)unused;
    for (int i = 0; i < 20000; i++) {
        char text[FAULT_TEXT_SIZE + 40];
        struct fault fault;
        struct error error;
        size_t length = (random >> 8) % sizeof text;

        for (size_t k = 0; k < length; k++) {
            random = random * 1664525u + 1013904223u;
            text[k] = alphabet[(random >> 16) % (sizeof alphabet - 1)];
        }
        text[length ? length - 1 : 0] = '\0';
        random = random * 1664525u + 1013904223u;
        fault_parse(text, &names, &fault, &error);
    }
}

static void help_lists_every_kind_once(void **unused)
{
    char text[200];
    size_t count = faults_help(0, NULL, 0);

    (void)unused;
    assert_true(count > 20);
    for (size_t i = 0; i < count; i++) {
        faults_help(i, text, sizeof text);
        assert_non_null(strstr(text, " ... "));
        assert_non_null(strchr(text, ':'));
    }
}

/* ---- the table ---- */

struct bench {
    struct arena arena;
    struct faults *faults;
};

static int set_up(void **state)
{
    static struct bench bench;
    const struct fault fault[] = {parse("motor LKneeSag jam 2..2.5"),
                                  parse("lossy: bus left_leg loss 0.1 manual"),
                                  parse("sensor imu off 0..0.001")};
    struct error error;

    assert_int_equal(arena_init(&bench.arena, 1 << 20, &error), ERROR_NONE);
    assert_int_equal(faults_create(fault, 3, 7, &bench.arena, &bench.faults, &error), ERROR_NONE);
    *state = &bench;
    return 0;
}

static int tear_down(void **state)
{
    arena_fini(&((struct bench *)*state)->arena);
    return 0;
}

static bool is_active(const struct bench *bench, size_t i)
{
    return faults_at(bench->faults, i)->active;
}

static void window_holds_from_its_begin_to_before_its_end(void **state)
{
    struct bench *bench = *state;

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

static void hand_overrules_the_clock(void **state)
{
    struct bench *bench = *state;
    int lossy = faults_find(bench->faults, "lossy");

    assert_int_equal(lossy, 1);
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

static void each_change_is_one_event(void **state)
{
    struct bench *bench = *state;
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

static void refuses_one_name_twice(void **state)
{
    struct bench *bench = *state;
    const struct fault fault[] = {parse("a: motor LKneeSag jam"), parse("a: motor LHipSag jam")};
    struct faults *faults;
    struct error error;

    assert_int_equal(faults_create(fault, 2, 7, &bench->arena, &faults, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "name a again"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reads_what_is_broken_how_and_when),
        cmocka_unit_test(window_may_be_open_missing_or_manual),
        cmocka_unit_test(sensors_are_numbered_through),
        cmocka_unit_test(boards_have_a_name_or_an_address),
        cmocka_unit_test(parameters_have_keys_defaults_and_a_first),
        cmocka_unit_test(refuses_what_it_does_not_know_and_names_the_nearest),
        cmocka_unit_test(refuses_wrong_numbers_and_windows),
        cmocka_unit_test(refuses_what_is_unsupported_there),
        cmocka_unit_test(any_text_is_refused_or_read_and_nothing_else),
        cmocka_unit_test(help_lists_every_kind_once),
        cmocka_unit_test_setup_teardown(window_holds_from_its_begin_to_before_its_end, set_up,
                                        tear_down),
        cmocka_unit_test_setup_teardown(hand_overrules_the_clock, set_up, tear_down),
        cmocka_unit_test_setup_teardown(each_change_is_one_event, set_up, tear_down),
        cmocka_unit_test_setup_teardown(refuses_one_name_twice, set_up, tear_down),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
