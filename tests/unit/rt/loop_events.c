/* SPDX-License-Identifier: Apache-2.0 */
/* The lines that the events of the loop make in the log: names, and numbers in the units that they
 * say. */
#include "rt/loop_private.h"

#include "rt/request_machine.h"

#include "tests/unit/arena_fixture.h"

static struct can_port left = {.bus = "left"}, right = {.bus = "right"};
static struct can_port *ports[] = {&left, &right};
static struct loop loop;

static const char *body_name(void *context, size_t index)
{
    return index == 2 ? context : "another";
}

static double get(void *context, size_t index)
{
    (void)context;
    return (double)index;
}

FIXTURE(set_up)
{
    static const struct tunable tunable[] = {{"gain", "", 0.0, 10.0, true},
                                             {"supply_v", "V", -5.0, 5.0, false}};
    static char waist[] = "Waist";
    const struct request_machine machine = {
        .context = waist, .body = body_name, .get = get, .ntunable = 2, .tunable = tunable};

    memset(&loop, 0, sizeof loop);
    loop.config.port = ports;
    return open_arena(test_state) ||
           requests_create(&machine, &arena, &loop.config.requests, NULL) != ERROR_NONE;
}

FIXTURE(tear_down)
{
    requests_destroy(loop.config.requests);
    return close_arena(test_state);
}

static void assert_text(enum loop_event_kind kind, int bus, int64_t a, int64_t b,
                        const char *expected)
{
    const struct loop_event event = {0, kind, bus, a, b};
    char text[128];

    memset(text, '?', sizeof text);
    text[sizeof text - 1] = '\0';
    loop_event_format(&loop, &event, text, sizeof text);
    assert_string_equal(text, expected);
}

TEST_WITH(deadlines_are_told_in_ms_and_s, set_up, tear_down)
{
    assert_text(LOOP_EVENT_OVERRUN, -1, PHASE_PLANT, 1234567, "overrun by 1.235 ms in phase plant");
    assert_text(LOOP_EVENT_OVERRUN, -1, PHASE_PUBLISH, 250000,
                "overrun by 0.250 ms in phase publish");
    assert_text(LOOP_EVENT_PAUSE, -1, 2500000000, 0,
                "2.5 s behind: counted as a pause, goes on at the next deadline");
}

TEST_WITH(buses_are_told_by_name, set_up, tear_down)
{
    assert_text(LOOP_EVENT_FRAMES_LOST, -1, 3, 4, "lost 3 frames on receiving and 4 on sending");
    assert_text(LOOP_EVENT_SILENT, 0, 1500000000, 0,
                "no STEP frame on left for 1.5 s: still waiting for the controller");
    assert_text(LOOP_EVENT_BACK, 1, 3000000000, 0, "STEP frames on right again after 3.0 s");
    assert_text(LOOP_EVENT_STEP_MISMATCH, 0, 7, 8,
                "STEP on left expects tick 7, but this is tick 8: not run");
    assert_text(LOOP_EVENT_STEP_MALFORMED, 1, 5, 0,
                "malformed STEP on right: length 5, expected 6");
}

TEST_WITH(requests_are_told_as_control, set_up, tear_down)
{
    double value = 2.5;
    int64_t bits;

    memcpy(&bits, &value, sizeof bits);
    assert_text(LOOP_EVENT_PAUSED, -1, 12, 0, "control: paused at tick 12");
    assert_text(LOOP_EVENT_RESUMED, -1, 13, 0, "control: resumed at tick 13");
    assert_text(LOOP_EVENT_SPEED, -1, 250000, 0, "control: speed 0.25");
    assert_text(LOOP_EVENT_SPEED, -1, 0, 0, "control: as fast as possible");
    assert_text(LOOP_EVENT_CHECKPOINT, -1, 2, 500, "control: checkpoint 2 at tick 500");
    assert_text(LOOP_EVENT_RESTORED, -1, 2, 500, "control: restored checkpoint 2, tick 500");
    assert_text(LOOP_EVENT_RESTORED, -1, 0, 0, "control: reset to the start");
    assert_text(LOOP_EVENT_PUSH, -1, 2, 80500, "control: body Waist pushed with 80.5 N");
    assert_text(LOOP_EVENT_LET_GO, -1, 2, 80500,
                "control: body Waist let go, pushed with 80.5 N at most");
    assert_text(LOOP_EVENT_SET, -1, 1, bits, "control: supply_v is 2.5 V");
    assert_text(LOOP_EVENT_SET, -1, 0, bits, "control: gain is 2.5");
    assert_text((enum loop_event_kind)99, -1, 0, 0, "event 99");
}
