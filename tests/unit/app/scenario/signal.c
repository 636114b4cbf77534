/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Signals of a scenario by their names: unknown ones are answered with the nearest, however many
 * joints a robot has, and counters of a wire are those of the right node. Stimuli reach the bus
 * that they name, as often as they say.
 */
#include "app/scenario/private.h"

#include "base/array.h"
#include "canbus/wire/wire.h"
#include "tests/test.h"

enum { LEFT_LEG = 1 };

static struct arena arena;
static const struct rig *coman;

FIXTURE(load_coman)
{
    struct error error;

    assert_ok(arena_init(&arena, (size_t)1 << 30, &error));
    assert_no_error(rig_load(HIL_SOURCE_DIR "/config/rigs/coman.yaml", &arena, &coman, &error),
                    error.text);
    return 0;
}

FIXTURE(close_arena)
{
    arena_fini(&arena);
    return 0;
}

/* ---- names ---- */

static const struct yaml_mark mark = {.file = "x.yaml", .line = 3, .column = 7};

TEST_WITH(unknown_names_are_answered_with_the_nearest, load_coman, close_arena)
{
    static const struct {
        const char *name, *says;
    } table[] = {
        {"LElbk.q", "with unknown \"LElbk\", expected \"LElbj\""},
        {"LElbk", "expected \"LElbj\""},
        {"measured.LElbk.q", "with unknown \"LElbk\", expected \"LElbj\""},
        {"bus.torsso.rx", "with unknown \"torsso\", expected \"torso\""},
        {"host.ft.l_leg_tf.fz", "expected \"l_leg_ft\""},
        {"LKneeSag.qq", "with unknown \"qq\", expected \"q\""},
        {"measured.LKneeSag.curent", "expected \"current\""},
        {"bus.torso.rxx", "expected \"rx\""},
        {"base.tillt", "expected \"tilt\""},
        {"nothing like it at all", "expected one that is listed by test --help"},
        {"", "expected one that is listed by test --help"},
    };

    for (size_t i = 0; i < ARRAY_COUNT(table); i++) {
        struct scenario_signal signal;
        struct error error;

        assert_int_equal(scenario_signal_find(table[i].name, coman, &mark, &signal, &error),
                         ERROR_INPUT);
        if (strncmp(error.text, "x.yaml:3:7: ", 12) != 0 || !strstr(error.text, table[i].says)) {
            fail_msg("%s", error.text);
        }
    }
}

/* Fewer and more joints than there is room for names, none among them. */
TEST_WITH(any_number_of_joints_can_be_searched, load_coman, close_arena)
{
    static const size_t counts[] = {0, 1, 127, 128, 129, 300};
    static struct robot_joint joint[300];
    static char name[300][8];

    for (size_t i = 0; i < ARRAY_COUNT(joint); i++) {
        snprintf(name[i], sizeof name[i], "j%zu", i);
        joint[i].name = name[i];
    }
    for (size_t i = 0; i < ARRAY_COUNT(counts); i++) {
        struct robot robot = *coman->robot;
        struct rig rig = *coman;
        struct scenario_signal signal;
        struct error error;

        robot.joint = joint;
        robot.njoint = counts[i];
        rig.robot = &robot;
        assert_int_equal(scenario_signal_find("k0.q", &rig, &mark, &signal, &error), ERROR_INPUT);
        assert_true((strstr(error.text, "expected \"j0\"") != NULL) == (counts[i] > 0));
        if (counts[i] > 0) {
            assert_int_equal(scenario_signal_find("j0.qd", &rig, &mark, &signal, &error), 0);
            assert_int_equal(signal.a, 0);
            assert_int_equal(signal.b, 1);
        }
        if (counts[i] > 126) {
            assert_int_equal(scenario_signal_find("j126.q", &rig, &mark, &signal, &error), 0);
            assert_int_equal(signal.a, 126);
        }
    }
}

/* ---- counters of a wire ---- */

struct watcher {
    struct scenario_view view;
    struct bus_ports ports;
    struct scenario_signal tec;
    unsigned largest[5]; /* TEC that was seen of each board of the leg */
    bool differed;       /* the signal from the largest of all */
};

/* Motor boards 1 to 3, nodes 0 to 2 of the wire, are asked for their address in every tick. */
static void watcher_step(void *context, int64_t now_ns)
{
    static const struct bus_frame ask[] = {{.id = 0x001, .len = 1, .data = {0x33}},
                                           {.id = 0x002, .len = 1, .data = {0x33}},
                                           {.id = 0x003, .len = 1, .data = {0x33}}};
    struct watcher *watcher = context;
    const struct wire *wire = simulator_wire(watcher->view.simulator, LEFT_LEG);
    const double value = watcher->tec.read(&watcher->view, watcher->tec.a, watcher->tec.b);
    unsigned largest = 0;

    if (now_ns == 0) {
        const struct wire_fault fault = {
            .kind = WIRE_FAULT_CORRUPT, .node = 1, .probability = 1.0, .count = 6};

        assert_true(wire_inject((struct wire *)(uintptr_t)wire, &fault) >= 0);
    }
    for (size_t i = 0; i < ARRAY_COUNT(watcher->largest); i++) {
        struct wire_node_stats stats;

        wire_node_stats(wire, i, &stats);
        largest = stats.tec > largest ? stats.tec : largest;
        watcher->largest[i] = stats.tec > watcher->largest[i] ? stats.tec : watcher->largest[i];
    }
    can_send(watcher->ports.port[LEFT_LEG], ask, ARRAY_COUNT(ask));
    watcher->differed = watcher->differed || value != (double)largest;
}

TEST_WITH(the_error_counter_of_a_bus_is_the_largest_of_its_boards, load_coman, close_arena)
{
    static struct watcher watcher;
    const struct simulator_observer observer = {&watcher, watcher_step};
    struct simulator_config config = {.clock = LOOP_CLOCK_FREE,
                                      .hold = RIG_HOLD_ALWAYS,
                                      .transport = TRANSPORT_LOCAL,
                                      .ticks = 60,
                                      .observer = &observer,
                                      .guests = 1,
                                      .row_period_ns = 1000000};
    struct realtime_report report;
    struct rig rig = *coman;
    struct error error;
    char notice[256];

    rig.wire.timed = true;
    config.rig = &rig;
    watcher.view.rig = &rig;
    assert_int_equal(rig.bus[LEFT_LEG].nboard, ARRAY_COUNT(watcher.largest));
    assert_ok(scenario_signal_find("bus.left_leg.tec", &rig, &mark, &watcher.tec, &error));
    if (simulator_create(&config, &arena, &watcher.view.simulator, notice, &error) ||
        simulator_join(watcher.view.simulator, &watcher.ports, &error) ||
        simulator_start(watcher.view.simulator, &report, &error)) {
        fail_msg("%s", error.text);
    }
    assert_int_equal(simulator_run(watcher.view.simulator), LOOP_END_LENGTH);
    bus_ports_close(&watcher.ports);
    simulator_destroy(watcher.view.simulator);
    assert_false(watcher.differed);
    for (size_t i = 0; i < ARRAY_COUNT(watcher.largest); i++) {
        assert_int_equal(watcher.largest[i] > 0, i == 1);
    }
}

/* ---- stimuli ---- */

/* Three requests to a board of the third bus are three answers there and none elsewhere. */
TEST_WITH(copies_of_a_frame_reach_their_bus, load_coman, close_arena)
{
    static const char text[] =
        "name: copies\ndescription: d\nrig: coman.yaml\n"
        "hold: always\nduration_s: 0.05\n"
        "stimuli:\n"
        "  - {at_s: 0.01, frame: {bus: right_leg, id: 0x002, data: \"33\", copies: 3}}\n"
        "  - {at_s: 0.03, frame: {bus: left_arm, id: 0x001, data: \"33\"}}\n"
        "expectations:\n"
        "  - {name: three, to_s: 0.02, frame: {bus: right_leg, id: 0x020, data: \"33 02\"}, "
        "count: [3, 3]}\n"
        "  - {name: no more, frame: {bus: right_leg, id: 0x020}, count: [3, 3]}\n"
        "  - {name: torso, frame: {bus: torso, id: 0x020}, never: true}\n"
        "  - {name: left leg, frame: {bus: left_leg, id: 0x020}, never: true}\n"
        "  - {name: one, from_s: 0.025, frame: {bus: left_arm, id: 0x010, data: \"33 01\"}, "
        "count: [1, 1]}\n"
        "  - {name: right arm, frame: {bus: right_arm, id: 0x010}, never: true}\n";
    const struct scenario_options options = {.mutation = -1};
    static struct scenario_outcome outcome;
    struct scenario *cases;
    struct error error;
    size_t count;

    assert_no_error(scenario_read_text(HIL_SOURCE_DIR "/config/rigs/x.yaml", text, sizeof text - 1,
                                       &arena, &cases, &count, &error),
                    error.text);
    scenario_run(cases, &options, &outcome);
    if (!outcome.ran) {
        fail_msg("%s", outcome.text);
    }
    for (size_t i = 0; i < outcome.nverdict; i++) {
        if (!outcome.verdict[i].met) {
            fail_msg("%s: %s", cases->expectation[i].name, outcome.verdict[i].text);
        }
    }
}
