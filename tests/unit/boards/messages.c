/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The list of messages is complete and agrees with the boards: everything that boards send in a run
 * is in it with its length, no two messages look the same, and cycle times give the worst-case load
 * of the bus plans' table.
 */
#include "boards/messages.h"
#include "tests/protocol_file.h"
#include "tests/unit/boards/board_bench.h"

enum { MESSAGES_MAX = 2048 };

struct list {
    struct message message[MESSAGES_MAX];
    size_t count;
};

static bool append(void *context, const struct message *message)
{
    struct list *list = context;

    assert_true(list->count < MESSAGES_MAX);
    list->message[list->count++] = *message;
    return true;
}

static const struct boards_bus_config icub[BENCH_BUSES],
    foc[BENCH_BUSES] = {{.protocol = &protocol_foc}};
static struct boards_bus_config compact[BENCH_BUSES] = {{.protocol = &protocol_compact}},
                                fd[BENCH_BUSES] = {{.protocol = &protocol_compact, .fd = true}};

static void configure(struct board_bench *bench, const struct boards_bus_config *bus)
{
    bench_configure(bench);
    if (!compact[0].described) {
        compact[0].described = protocol_file("compact");
        fd[0].described = protocol_file("compact-fd");
    }
    bench->config.bus = bus;
    for (int i = 0; i < BENCH_BOARDS; i++) {
        bench->board[i].axis[0].gear = 100.0;
        bench->board[i].axis[2].joint = bench->board[i].axis[3].joint = -1;
        bench->board[i].transmit_at_start = true;
    }
    if (bus->protocol == &protocol_compact) {
        bench->board[2] = bench->board[3];
        bench->board[2].period_ns = 1000000;
        bench->config.nboard = 3;
    }
}

/* The same with an inertial board in the place of the second motor board. */
static void configure_inertial(struct board_bench *bench, const struct boards_bus_config *bus)
{
    configure(bench, bus);
    bench->board[1] = (struct board_config){
        .name = "pelvis", .kind = BOARD_INERTIAL, .address = 9, .transmit_at_start = true};
}

TEST_ON(everything_sent_is_in_the_list, board_bench, bench)
{
    const struct boards_bus_config *const variants[] = {icub, foc, compact, fd};
    static struct list list;

    for (int run = 0; run < 8; run++) {
        size_t seen = 0;
        int v = run % 4;

        (run < 4 ? configure : configure_inertial)(bench, variants[v]);
        bench_start(bench);
        list.count = 0;
        boards_messages(&bench->config, 0, append, &list);
        assert_true(list.count > 10);
        for (int t = 0; t < 400; t++) {
            if (t % 50 == 0) {
                bench_send(bench, 0, v < 2 ? 0x70f : 0x7e0, v < 2 ? "FF" : "");
                bench_send(bench, 0, 0x209, "34 7F 80 01; 35 01");
            }
            bench_say(bench, 0, 0x10f, "00 00 00 00 00 00 00 00");
            for (size_t i = 0; i < bench->count[0]; i++) {
                const struct bus_frame *frame = &bench->frame[0][i];
                size_t k = 0;

                while (k < list.count &&
                       (list.message[k].id != frame->id || list.message[k].from_host ||
                        list.message[k].length != frame->len ||
                        (list.message[k].code >= 0 && list.message[k].code != frame->data[0]))) {
                    k++;
                }
                if (k == list.count) {
                    fail_msg("id 0x%03x of %d bytes is in no message", (unsigned)frame->id,
                             frame->len);
                }
                assert_int_equal(list.message[k].fd, (frame->flags & FRAME_FD) != 0);
                seen++;
            }
        }
        assert_true(seen > 100);
    }
}

TEST(no_two_messages_look_the_same)
{
    const struct boards_bus_config *const variants[] = {icub, foc, compact, fd};
    static struct list list;

    for (int v = 0; v < 8; v++) {
        struct board_bench bench;

        (v < 4 ? configure : configure_inertial)(&bench, variants[v % 4]);
        list.count = 0;
        boards_messages(&bench.config, 0, append, &list);
        for (size_t i = 0; i < list.count; i++) {
            const struct message *a = &list.message[i];

            assert_non_null(a->name);
            assert_true(a->id <= 0x7ff && a->repeats >= 1);
            assert_true(a->first_byte + a->repeats * fields_bytes(a->fields) <= a->length ||
                        a->length < 8);
            assert_true(a->from_host ? a->sender == -1 : a->receiver == -1);
            for (size_t k = 0; k < i; k++) {
                const struct message *b = &list.message[k];

                if (a->id == b->id && a->code == b->code && a->from_host == b->from_host) {
                    fail_msg("%s and %s are both 0x%03x", a->name, b->name, (unsigned)a->id);
                }
            }
        }
    }
}

/* 8n + 47 + floor((34 + 8n - 1) / 4) bits a frame of n bytes, with its cycle. */
TEST(cycle_times_give_the_loads_of_the_plans)
{
    /* half a leg with F/T at 1 kHz: compact 3 axes, 3 * 135 + 2 * 115 + 115 a ms and STATE; foc
     * with STATUS each 10 ms 81.0 %, each millisecond 117.5 % */
    static const struct {
        const struct boards_bus_config *bus;
        int64_t status_period_ns;
        double percent;
    } plans[] = {{compact, 0, 75.0 + 4 * 0.27}, {foc, 0, 117.5}, {foc, 10000000, 81.05}};
    static struct list list;

    for (int p = 0; p < 3; p++) {
        struct board_bench bench;
        double bits = 0.0;

        configure(&bench, plans[p].bus);
        bench.board[2] = bench.board[p ? 3 : 2];
        bench.board[2].period_ns = 1000000;
        bench.config.nboard = p ? 4 : 3;
        if (p) { /* one axis a board */
            for (int i = 0; i < 4; i++) {
                bench.board[i == 3 ? 3 : i] = i == 2 ? bench.board[2] : bench.board[i];
            }
            bench.board[3] = bench_motor("third", 0, 3, 4, -1);
            for (int i = 0; i < 4; i++) {
                bench.board[i].axis[0].gear = 100.0;
                bench.board[i].status_period_ns = plans[p].status_period_ns;
            }
        }
        list.count = 0;
        boards_messages(&bench.config, 0, append, &list);
        for (size_t i = 0; i < list.count; i++) {
            const struct message *m = &list.message[i];
            int n = m->length;

            if (m->cycle_ns > 0 && !(p && m->name[0] == 'A')) { /* not the slow temperatures */
                bits += (8 * n + 47 + (34 + 8 * n - 1) / 4) * 1e9 / m->cycle_ns;
            }
        }
        assert_near(bits / 1e4, plans[p].percent, 0.01);
    }
}
