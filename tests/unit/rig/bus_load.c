/* SPDX-License-Identifier: Apache-2.0 */
/* The wire section of rigs: how long frames take, and buses that cannot carry their traffic. */

#include "tests/unit/rig/rig_bench.h"

static const struct rig_wire *wire_of(const char *line)
{
    return &load_toy_rig_with(line)->wire;
}

TEST_WITH(without_it_frames_take_no_time, open_rig_tree, close_rig_tree)
{
    const struct rig_wire *wire = wire_of("");

    assert_false(wire->timed || wire->paced || wire->fifo);
}

TEST_WITH(every_key_is_taken, open_rig_tree, close_rig_tree)
{
    const struct rig_wire *wire = wire_of("wire: {mode: wire, pace: wire, order: fifo}");

    assert_true(wire->timed && wire->paced && wire->fifo);
    assert_false(wire_of("wire: {mode: wire}")->paced);
}

TEST_WITH(what_is_wrong_is_said_with_its_place, open_rig_tree, close_rig_tree)
{
    static const struct {
        const char *line;
        int column;
        const char *found, *expected;
    } cases[] = {
        {"wire: {mode: exact}", 14, "\"exact\"", "ideal or wire"},
        {"wire: {pace: 1}", 14, "1", "none or wire"},
        {"wire: {order: lifo}", 15, "\"lifo\"", "priority or fifo"},
        {"wire: {queue: 4}", 8, "unknown key \"queue\"", "mode, pace or order"},
        {"wire: wire", 7, "wire", "map"},
    };
    int line = 1;

    for (const char *at = toy_rig; (at = strchr(at, '\n')); at++) {
        line++;
    }
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct rig *rig;
        struct error error = {0};
        char place[96];

        snprintf(place, sizeof place, "%s:%d:%d: ", rig_path, line, cases[i].column);
        if (read_toy_rig_with(cases[i].line, &rig, &error) != ERROR_INPUT ||
            strncmp(error.text, place, strlen(place)) != 0 ||
            !strstr(error.text + strlen(place), cases[i].found) ||
            !strstr(error.text + strlen(place), cases[i].expected)) {
            fail_msg("for %s: %s", cases[i].line, error.text);
        }
    }
}

/* A bus that is too slow: what is said, and what would help. */
TEST_WITH(an_overloaded_bus_is_told_with_advice, open_rig_tree, close_rig_tree)
{
    const struct rig *rig = load_toy_rig_with("");
    struct rig changed;
    struct rig_bus bus;
    char text[384], slow[384];

    assert_false(rig_bus_over_budget(rig, 0, text, sizeof text));
    changed = *rig;
    bus = rig->bus[0];
    bus.bitrate = 50000;
    changed.bus = &bus;
    changed.nbus = 1;
    assert_true(rig_bus_over_budget(&changed, 0, slow, sizeof slow));
    assert_non_null(strstr(slow, "would be loaded to"));
    assert_non_null(strstr(slow, "split it over"));
    assert_non_null(strstr(slow, "or run it at"));
}
