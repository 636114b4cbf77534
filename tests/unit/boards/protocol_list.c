/* SPDX-License-Identifier: Apache-2.0 */
/* The list of protocols: each is found by its name, has what everyone may ask for, and is refused
 * what it cannot do. */
#include "tests/unit/arena_fixture.h"

#include "boards/described/protocol.h"
#include "tests/unit/boards/board_bench.h"

TEST(each_is_found_by_its_name)
{
    size_t count = 0;

    for (const struct protocol *p; (p = protocol_at(count)); count++) {
        assert_ptr_equal(protocol_find(p->name), p);
        assert_string_equal(protocol_words[count].word, p->name);
        assert_int_equal(protocol_words[count].value, count);
    }
    assert_true(count >= 5);
    assert_null(protocol_words[count].word);
    assert_null(protocol_at(count + 1));
    assert_null(protocol_find("nobody"));
    assert_ptr_equal(protocol_find("compact"), &protocol_compact);
}

TEST(each_has_what_everyone_asks_for)
{
    const struct protocol *p;

    for (size_t i = 0; (p = protocol_at(i)); i++) {
        assert_true(p->bus && p->board[BOARD_MOTOR] && p->visit_broadcasts && p->visit_board);
        assert_true(p->mode_name && p->fault_names && p->timeout_text && p->limit_text);
        assert_true(!p->sections || p->sections[0]);
        assert_in_range(strlen(p->summary), 20, 80);
        assert_true(p->needs_file || p->text || p->help);
        assert_true(!p->visit_board_load == !p->visit_command_load);
        assert_in_range(p->axes_max, 1, BOARD_AXES_MAX);
        assert_in_range(p->motor_address_max, 1, p->address_max);
        assert_true(p->address_max < 255);
        assert_true(p->external || !p->external_torque);
        assert_true(p->canfd || !p->bench_fd.bus_axes);
        for (size_t k = 0; p->fault_names[k]; k++) {
            assert_true(k < 32);
        }
        for (uint32_t mode = 0; mode < 300; mode++) {
            assert_non_null(p->mode_name(mode));
        }
        assert_string_equal(p->mode_name(299), "unknown");
    }
}

TEST(capabilities_are_listed_in_words)
{
    char text[80], brief[8];

    assert_string_equal(protocols_list(offsetof(struct protocol, external), text, sizeof text),
                        "icub, compact or foc");
    assert_string_equal(protocols_list(offsetof(struct protocol, padded), text, sizeof text),
                        "icub or foc");
    assert_string_equal(protocols_list(offsetof(struct protocol, spare_axes), text, sizeof text),
                        "icub");
    assert_string_equal(protocols_list(offsetof(struct protocol, external), brief, sizeof brief),
                        "icub, c");
}

TEST(a_mode_that_a_board_reports_has_a_name)
{
    assert_string_equal(protocol_compact.mode_name(7), "fault");
    assert_string_equal(protocol_icub.mode_name(0x50), "voltage");
    assert_string_equal(protocol_cia402.mode_name(0), "not ready to switch on");
    assert_string_equal(protocol_described.mode_name(6), "impedance");
}

TEST_WITH(boards_that_a_protocol_cannot_have_are_refused, open_arena, close_arena)
{
    const struct boards_bus_config buses[BENCH_BUSES] = {{.protocol = &protocol_moteus},
                                                         {.protocol = &protocol_described}};
    struct board_config board[9];
    const struct boards_config config = {
        .nboard = 9, .board = board, .nbus = BENCH_BUSES, .bus = buses, .tick_ns = 1000000};
    struct boards *boards;
    struct error error;

    for (int i = 0; i < 9; i++) {
        board[i] = bench_motor("hip", 1, (uint8_t)(i + 1), 0, 1);
        board[i].axis[2].joint = 2;
        board[i].axis[3].joint = i < 8 ? 3 : -1;
    }
    assert_int_equal(boards_create(&config, &arena, &boards, &error), ERROR_INPUT);
    assert_string_equal(error.text,
                        "found 35 axes on a bus that speaks described, expected at most 32");
    board[8] = bench_motor("knee", 0, 1, 0, -1);
    board[8].axis[0].valve = true;
    assert_int_equal(boards_create(&config, &arena, &boards, &error), ERROR_INPUT);
    assert_string_equal(error.text, "board knee: found a servo valve on a bus that speaks moteus, "
                                    "expected a motor");
}
