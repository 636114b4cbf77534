/* SPDX-License-Identifier: Apache-2.0 */
/* The compact protocol on its buses: identifiers, room on the wire, configurations, events. */
#include "tests/unit/boards/compact/compact_bench.h"
#include "boards/protocol_list.h"

TEST(identifiers_are_apart_and_ordered_by_urgency)
{
    assert_int_equal(compact_id(COMPACT_MODE, 0), 0x020);
    assert_int_equal(compact_id(COMPACT_COMMAND, 7), 0x047);
    assert_int_equal(compact_id(COMPACT_TELEMETRY, 31), 0x11f);
    assert_int_equal(compact_id(COMPACT_REQUEST, 31), 0x69f);
    assert_int_equal(compact_id(COMPACT_DISCOVER, 0), 0x7e0);
    for (int i = 1; i < COMPACT_MESSAGES; i++) {
        assert_true(compact_messages[i - 1].function < compact_messages[i].function);
    }
    for (int i = 0; i < COMPACT_MESSAGES; i++) {
        const struct compact_message *row = &compact_messages[i];

        assert_int_equal(fields_bytes(row->fields), row->length);
        assert_int_equal(fields_bits(row->fields) % 8, 0);
        assert_true(fields_count(row->fields) <= FIELDS_MAX);
        assert_true(row->length * row->repeats <= 64);
        assert_ptr_equal(compact_message(row->function), row);
    }
    assert_null(compact_message(0x37)); /* where the lockstep frames are */
}

TEST(an_fd_frame_on_a_classic_bus_is_foreign)
{
    struct bus_frame frame = {.id = 0x020, .flags = FRAME_FD, .len = 5, .data = {1, 1}};
    struct board_bench bench;

    start(&bench);
    boards_receive(bench.boards, bench.now_ns, 0, &frame);
    assert_int_equal(bench_counters(&bench).foreign, 1);
    bench_stop(&bench);
}

TEST(a_classic_half_leg_fits_1_mbit_at_1_khz)
{
    /* worst-case bits of a classic frame of n bytes: 8n + 47 + floor((34 + 8n - 1) / 4) */
    struct board_bench bench;
    double bits = 0.0;

    start(&bench);
    for (int t = 0; t < 1000; t++) {
        bench_tick(&bench);
        bits += 115.0; /* COMMAND of three axes */
        for (size_t i = 0; i < bench.count[0]; i++) {
            int n = bench.frame[0][i].len;

            bits += 8 * n + 47 + (34 + 8 * n - 1) / 4;
        }
    }
    /* 3 * 135 + 2 * 115 + 115 a millisecond, and 4 STATE frames in 50 ms: 76.1 % */
    assert_near(bits, 1000.0 * (405.0 + 230.0 + 115.0) + 20.0 * 4.0 * 135.0, 4.0 * 135.0);
    assert_true(bits <= 0.77e6);
    bench_stop(&bench);
}

TEST(a_wrong_configuration_is_refused)
{
    static const struct {
        const char *text;
    } wrong[] = {{"1 to 31 on a bus that speaks compact"},
                 {"a bus that speaks compact has no torque boards"},
                 {"both axes have the same joint"},
                 {" boards speak CAN FD"},
                 {"1 to 4 on a bus that speaks foc"},
                 {"the gear must be above 0"}};
    static const struct boards_bus_config fd[BENCH_BUSES] = {
        {.protocol = &protocol_icub, .fd = true}, {.protocol = &protocol_icub}};
    static const struct boards_bus_config foc[BENCH_BUSES] = {{.protocol = &protocol_foc},
                                                              {.protocol = &protocol_compact}};

    for (int i = 0; i < 6; i++) {
        struct boards *boards;
        struct error error;
        struct board_bench bench;

        configure(&bench);
        switch (i) {
        case 0:
            bench.board[1].address = 32;
            break;
        case 1:
            bench.board[2].kind = BOARD_TORQUE;
            break;
        case 2:
            bench.board[3].axis[2] = bench_axis(3);
            break;
        case 3:
            bench.config.bus = fd;
            break;
        default:
            bench.config.bus = foc;
            bench.board[0].address = i == 4 ? 5 : 4;
            break;
        }
        assert_int_equal(arena_init(&bench.arena, 64u << 20, &error), ERROR_NONE);
        assert_int_equal(boards_create(&bench.config, &bench.arena, &boards, &error), ERROR_INPUT);
        if (!strstr(error.text, wrong[i].text)) {
            fail_msg("\"%s\" does not say \"%s\"", error.text, wrong[i].text);
        }
        arena_fini(&bench.arena);
    }
}

TEST(events_have_the_names_of_this_protocol)
{
    static const struct {
        struct board_event event;
        const char *text;
    } cases[] = {
        {{.kind = BOARD_EVENT_MODE, .axis = 1, .a = COMPACT_OFF, .b = COMPACT_VOLTAGE},
         "axis 1 from off to voltage mode"},
        {{.kind = BOARD_EVENT_MODE, .a = COMPACT_CURRENT, .b = COMPACT_FAULT},
         "axis 0 from current to fault mode"},
        {{.kind = BOARD_EVENT_TIMEOUT, .a = COMPACT_VOLTAGE},
         "axis 0: the voltage command timed out, reference set to 0"},
        {{.kind = BOARD_EVENT_FAULT, .a = COMPACT_FAULT_TEMPERATURE},
         "axis 0 has a fault: temperature"},
        {{.kind = BOARD_EVENT_LIMIT, .a = (uint32_t)-200100},
         "axis 0 is beyond its position limit at -200100 x 1e-5 rad, only commands that lead back "
         "are obeyed"},
    };
    char text[256];
    struct board_bench bench;

    start(&bench);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        board_event_format(bench.boards, &cases[i].event, text, sizeof text);
        assert_string_equal(strstr(text, "): ") + 3, cases[i].text);
    }
    bench_stop(&bench);
}
