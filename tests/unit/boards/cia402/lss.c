/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Layer setting services, exchanges written down from CiA 305: states, addresses, inquiries, the
 * Node-ID and when it takes effect, and a master's fastscan.
 */
#include "tests/unit/boards/cia402/cia402_bench.h"

/* Addresses of the nodes of bus 0: vendor, product, revision, serial number. */
static const uint32_t address_4[4] = {0, 0x48494c00, 0x10000, 4};
static const uint32_t address_20[4] = {0, 0x48494c00, 0x10000, 20};

static void say(struct board_bench *bench, const char *request)
{
    bench_say(bench, 0, CIA402_LSS_REQUEST, request);
}

/* A request that no node answers. */
static void say_unanswered(struct board_bench *bench, const char *request)
{
    say(bench, request);
    assert_int_equal(bench_sent(bench, 0, CIA402_LSS_REPLY), 0);
}

static void ask(struct board_bench *bench, const char *request, const char *answer)
{
    say(bench, request);
    bench_expect(bench, 0, CIA402_LSS_REPLY, answer);
}

static size_t send_part(struct board_bench *bench, unsigned command, uint32_t value)
{
    struct bus_frame frame = {.id = CIA402_LSS_REQUEST, .len = 8, .data = {(uint8_t)command}};

    put_u32_le(frame.data + 1, value);
    boards_receive(bench->boards, bench->now_ns, 0, &frame);
    bench_tick(bench);
    return bench_sent(bench, 0, CIA402_LSS_REPLY);
}

static bool select_node(struct board_bench *bench, const uint32_t address[4])
{
    for (unsigned part = 0; part < 3; part++) {
        assert_int_equal(send_part(bench, 0x40 + part, address[part]), 0);
    }
    return send_part(bench, 0x43, address[3]) == 1;
}

/* A value that SDO reads of a node of bus 0; UINT32_MAX: it does not answer. */
static uint32_t device_type(struct board_bench *bench, unsigned node)
{
    bench_say(bench, 0, CIA402_SDO_REQUEST + node, "40 00 10 00 00 00 00 00");
    return bench_sent(bench, 0, CIA402_SDO_REPLY + node)
               ? get_u32_le(bench_find(bench, 0, CIA402_SDO_REPLY + node)->data + 4)
               : UINT32_MAX;
}

/* ---- states ---- */

TEST_ON(requests_are_obeyed_in_the_state_of_configuration_only, start, bench)
{
    say_unanswered(bench, "5E 00 00 00 00 00 00 00");
    say_unanswered(bench, "11 07 00 00 00 00 00 00");
    say_unanswered(bench, "17 00 00 00 00 00 00 00");

    /* all three of the bus at once, and back */
    say_unanswered(bench, "04 01 00 00 00 00 00 00");
    say(bench, "5E 00 00 00 00 00 00 00");
    assert_int_equal(bench_sent(bench, 0, CIA402_LSS_REPLY), 3);
    say_unanswered(bench, "04 02 00 00 00 00 00 00"); /* no such state */
    say_unanswered(bench, "04 00 00 00 00 00 00 00");
    say_unanswered(bench, "5E 00 00 00 00 00 00 00");

    /* one of them: the answer is 0x44, and its address what 0x1018 has */
    assert_true(select_node(bench, address_20));
    bench_expect(bench, 0, CIA402_LSS_REPLY, "44 00 00 00 00 00 00 00");
    ask(bench, "5A 00 00 00 00 00 00 00", "5A 00 00 00 00 00 00 00");
    ask(bench, "5B 00 00 00 00 00 00 00", "5B 00 4C 49 48 00 00 00");
    ask(bench, "5C 00 00 00 00 00 00 00", "5C 00 00 01 00 00 00 00");
    ask(bench, "5D 00 00 00 00 00 00 00", "5D 14 00 00 00 00 00 00");
    ask(bench, "5E 00 00 00 00 00 00 00", "5E 14 00 00 00 00 00 00");
    assert_int_equal(READ(0x1018, 4), 4);
}

TEST_ON(an_address_is_taken_whole_and_in_order, start, bench)
{
    uint32_t wrong[4];

    for (int part = 0; part < 4; part++) {
        memcpy(wrong, address_4, sizeof wrong);
        wrong[part] ^= 0x80;
        assert_false(select_node(bench, wrong));
    }
    send_part(bench, 0x41, address_4[1]);
    send_part(bench, 0x40, address_4[0]);
    send_part(bench, 0x42, address_4[2]);
    assert_int_equal(send_part(bench, 0x43, address_4[3]), 0);
    assert_true(select_node(bench, address_4));
}

TEST_ON(what_is_no_request_is_counted, start, bench)
{
    say_unanswered(bench, "04 01");
    assert_int_equal(bench_counters(bench).malformed, 1);
    say_unanswered(bench, "99 00 00 00 00 00 00 00");
    assert_int_equal(bench_counters(bench).unknown, 1);
}

/* ---- settings ---- */

TEST_ON(a_node_id_takes_effect_with_a_reset_of_communication, start, bench)
{
    WRITE(0x1801, 1, 4, 0x80000000 | 0x2a0); /* one that does not contain the Node-ID */
    WRITE(0x1010, 1, 4, 0x65766173);
    assert_true(select_node(bench, address_4));
    ask(bench, "11 00 00 00 00 00 00 00", "11 01 00 00 00 00 00 00");
    ask(bench, "11 20 00 00 00 00 00 00", "11 01 00 00 00 00 00 00"); /* 31 is the highest */
    ask(bench, "11 14 00 00 00 00 00 00", "11 FF 01 00 00 00 00 00"); /* another's */
    ask(bench, "11 07 00 00 00 00 00 00", "11 00 00 00 00 00 00 00");
    ask(bench, "5E 00 00 00 00 00 00 00", "5E 04 00 00 00 00 00 00");
    assert_int_equal(device_type(bench, 4), 0xffff0192);

    nmt(bench, CIA402_NMT_RESET_COMMUNICATION, 4);
    bench_tick(bench);
    bench_expect(bench, 0, 0x707, "00");
    assert_int_equal(device_type(bench, 4), UINT32_MAX);
    assert_int_equal(device_type(bench, 7), 0xffff0192);

    /* what contained the old one contains the new one */
    assert_int_equal(sdo_read(bench, 0, 7, 0x1014, 0), 0x87);
    assert_int_equal(sdo_read(bench, 0, 7, 0x1200, 1), 0x607);
    assert_int_equal(sdo_read(bench, 0, 7, 0x1800, 1), 0x187);
    assert_int_equal(sdo_read(bench, 0, 7, 0x1403, 1), 0x80000507);
    assert_int_equal(sdo_read(bench, 0, 7, 0x1801, 1), 0x800002a0);
    assert_int_equal(sdo_read(bench, 0, 7, 0x1018, 4), 4);

    /* it was not stored */
    nmt(bench, CIA402_NMT_RESET_NODE, 7);
    bench_ticks(bench, 3);
    assert_int_equal(device_type(bench, 7), UINT32_MAX);
    assert_int_equal(READ(0x1014, 0), 0x84);
    assert_int_equal(READ(0x1801, 1), 0x800002a0);
}

TEST_ON(a_stored_node_id_is_that_of_the_next_power_up, start, bench)
{
    assert_true(select_node(bench, address_4));
    ask(bench, "11 07 00 00 00 00 00 00", "11 00 00 00 00 00 00 00");
    ask(bench, "17 00 00 00 00 00 00 00", "17 00 00 00 00 00 00 00");
    nmt(bench, CIA402_NMT_RESET_NODE, 4);
    bench_ticks(bench, 3);
    assert_int_equal(device_type(bench, 7), 0xffff0192);
    say_unanswered(bench, "5E 00 00 00 00 00 00 00"); /* and it waits again */
}

TEST_ON(other_bit_rates_are_refused, start, bench)
{
    assert_true(select_node(bench, address_4));
    ask(bench, "13 00 00 00 00 00 00 00", "13 01 00 00 00 00 00 00");
    say_unanswered(bench, "15 0A 00 00 00 00 00 00");
    assert_int_equal(device_type(bench, 4), 0xffff0192);
    assert_int_equal(bench_counters(bench).unknown + bench_counters(bench).malformed, 0);
}

/* ---- nodes without a Node-ID ---- */

/* Takes the Node-ID from the node of an address. */
static void unname(struct board_bench *bench, const uint32_t address[4], unsigned node)
{
    assert_true(select_node(bench, address));
    ask(bench, "11 FF 00 00 00 00 00 00", "11 00 00 00 00 00 00 00");
    nmt(bench, CIA402_NMT_RESET_COMMUNICATION, node);
    bench_tick(bench);
}

TEST_ON(a_node_without_a_node_id_does_nothing_but_lss, start, bench)
{
    WRITE(0x1017, 0, 2, 10);
    unname(bench, address_4, 4);
    nmt(bench, CIA402_NMT_START, 0);
    for (int ms = 0; ms < 50; ms++) {
        bench_say(bench, 0, CIA402_SYNC, "");
        assert_int_equal(bench_sent(bench, 0, 0x704) + bench_sent(bench, 0, 0x084), 0);
    }
    assert_int_equal(device_type(bench, 4), UINT32_MAX);
    assert_true(select_node(bench, address_4));
    ask(bench, "5E 00 00 00 00 00 00 00", "5E FF 00 00 00 00 00 00");

    /* with the end of the configuration it boots, of itself */
    ask(bench, "11 04 00 00 00 00 00 00", "11 00 00 00 00 00 00 00");
    assert_int_equal(device_type(bench, 4), UINT32_MAX);
    say_unanswered(bench, "04 00 00 00 00 00 00 00");
    bench_expect(bench, 0, 0x704, "00");
    assert_int_equal(device_type(bench, 4), 0xffff0192);
}

/* Two nodes change places, which needs a third Node-ID; an address that was taken meanwhile leaves
 * its old owner without one. */
TEST_ON(a_node_id_belongs_to_one_node, start, bench)
{
    assert_true(select_node(bench, address_4));
    ask(bench, "11 05 00 00 00 00 00 00", "11 00 00 00 00 00 00 00");
    nmt(bench, CIA402_NMT_RESET_COMMUNICATION, 4);
    bench_tick(bench);
    assert_true(select_node(bench, address_20));
    ask(bench, "11 04 00 00 00 00 00 00", "11 00 00 00 00 00 00 00");
    nmt(bench, CIA402_NMT_RESET_COMMUNICATION, 20);
    bench_tick(bench);
    assert_int_equal(sdo_read(bench, 0, 5, 0x1018, 4), 4);
    assert_int_equal(sdo_read(bench, 0, 4, 0x1018, 4), 20);

    /* node 4 of the rig comes up with what it has stored, 4, which is node 20's now */
    nmt(bench, CIA402_NMT_RESET_NODE, 5);
    bench_ticks(bench, 3);
    assert_int_equal(device_type(bench, 5), UINT32_MAX);
    assert_int_equal(sdo_read(bench, 0, 4, 0x1018, 4), 20);
    assert_true(select_node(bench, address_4));
    ask(bench, "5E 00 00 00 00 00 00 00", "5E FF 00 00 00 00 00 00");
}

/* ---- fastscan ---- */

/* Whether any node answers. */
static bool scan(struct board_bench *bench, uint32_t value, unsigned bit, unsigned part,
                 unsigned next)
{
    struct bus_frame frame = {.id = CIA402_LSS_REQUEST, .len = 8, .data = {0x51}};

    put_u32_le(frame.data + 1, value);
    frame.data[5] = (uint8_t)bit;
    frame.data[6] = (uint8_t)part;
    frame.data[7] = (uint8_t)next;
    boards_receive(bench->boards, bench->now_ns, 0, &frame);
    bench_tick(bench);
    for (size_t i = 0; i < bench->count[0]; i++) {
        if (bench->frame[0][i].id == CIA402_LSS_REPLY) {
            bench_expect_frame(&bench->frame[0][i], CIA402_LSS_REPLY, "4F 00 00 00 00 00 00 00");
        }
    }
    return bench_sent(bench, 0, CIA402_LSS_REPLY) > 0;
}

/* Finds one node as a master does: each bit is asked for as 0. */
static bool find_node(struct board_bench *bench, uint32_t address[4])
{
    if (!scan(bench, 0, 0x80, 0, 0)) {
        return false;
    }
    for (unsigned part = 0; part < 4; part++) {
        address[part] = 0;
        for (unsigned bit = 32; bit-- > 0;) {
            address[part] |= scan(bench, address[part], bit, part, part) ? 0 : UINT32_C(1) << bit;
        }
        assert_true(scan(bench, address[part], 0, part, (part + 1) % 4));
    }
    return true;
}

TEST_ON(a_master_finds_every_node_without_a_node_id, start, bench)
{
    uint32_t found[4];

    assert_false(find_node(bench, found)); /* all have one */
    unname(bench, address_20, 20);
    unname(bench, address_4, 4);
    assert_true(find_node(bench, found));
    assert_memory_equal(found, address_4, sizeof found);
    ask(bench, "11 09 00 00 00 00 00 00", "11 00 00 00 00 00 00 00");
    say_unanswered(bench, "04 00 00 00 00 00 00 00");
    assert_int_equal(device_type(bench, 9), 0xffff0192);

    assert_true(find_node(bench, found));
    assert_memory_equal(found, address_20, sizeof found);
    ask(bench, "11 0A 00 00 00 00 00 00", "11 00 00 00 00 00 00 00");
    say_unanswered(bench, "04 00 00 00 00 00 00 00");
    assert_int_equal(device_type(bench, 10), 0x20192); /* of one axis */
    assert_false(find_node(bench, found));
}

TEST_ON(a_scan_out_of_order_finds_nothing, start, bench)
{
    unname(bench, address_4, 4);
    assert_true(scan(bench, 0, 0x80, 0, 0));
    assert_false(scan(bench, address_4[1], 0, 1, 2)); /* the vendor comes first */
    assert_false(scan(bench, 0, 32, 0, 0));           /* no such bit */
    assert_false(scan(bench, 0, 31, 4, 0));           /* no such part */
    assert_false(scan(bench, 0, 31, 0, 4));
    assert_true(scan(bench, 0, 0, 0, 1));
    assert_true(scan(bench, address_4[1], 0, 1, 2));
    say_unanswered(bench, "5E 00 00 00 00 00 00 00");
}
