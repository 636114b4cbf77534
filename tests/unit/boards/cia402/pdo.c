/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Process data: mapping rules, transmission types, inhibit time and event timer, RPDOs with and
 * without SYNC; and emergencies, which PDOs of a wrong length raise.
 */
#include "tests/unit/boards/cia402/cia402_bench.h"

#define WRITE_FAILS(index, sub, bytes, value, reason)                                              \
    assert_int_equal(sdo_write(bench, 0, 4, index, sub, bytes, (uint32_t)(value)), reason)

/* Sets a PDO of node 4 up, as a host does. */
static void map(struct board_bench *bench, unsigned parameter, uint32_t cob_id, unsigned type,
                const uint32_t *objects, unsigned count)
{
    unsigned mapping = parameter + 0x200;

    assert_int_equal(sdo_write(bench, 0, 4, parameter, 1, 4, cob_id | 0x80000000), 0);
    assert_int_equal(sdo_write(bench, 0, 4, parameter, 2, 1, type), 0);
    assert_int_equal(sdo_write(bench, 0, 4, mapping, 0, 1, 0), 0);
    for (unsigned i = 0; i < count; i++) {
        assert_int_equal(sdo_write(bench, 0, 4, mapping, i + 1, 4, objects[i]), 0);
    }
    assert_int_equal(sdo_write(bench, 0, 4, mapping, 0, 1, count), 0);
    assert_int_equal(sdo_write(bench, 0, 4, parameter, 1, 4, cob_id), 0);
}

#define MAP(parameter, cob_id, type, ...)                                                          \
    map(bench, parameter, cob_id, type, (const uint32_t[]){__VA_ARGS__},                           \
        sizeof((const uint32_t[]){__VA_ARGS__}) / sizeof(uint32_t))

static void sync(struct board_bench *bench)
{
    bench_send(bench, 0, CIA402_SYNC, "");
}

/* ---- mapping ---- */

TEST_ON(the_factory_mapping_is_that_of_the_profile, start, bench)
{
    static const uint32_t second[2][4] = {{0, 0x60600008, 0x607a0020, 0x60ff0020},
                                          {0, 0x60610008, 0x60640020, 0x606c0020}};

    for (unsigned send = 0; send < 2; send++) {
        for (unsigned n = 0; n < 4; n++) {
            unsigned at = (send ? 0x1800 : 0x1400) + n, count = second[send][n] ? 2 : 1;
            uint32_t cob_id = (send ? 0x180u : 0x200u) + 0x100 * n + 4;

            assert_int_equal(READ(at, 1), cob_id | (n ? 0x80000000 : 0));
            assert_int_equal(READ(at, 2), 255);
            assert_int_equal(READ(at + 0x200, 0), count);
            assert_int_equal(READ(at + 0x200, 1), send ? 0x60410010 : 0x60400010);
            assert_int_equal(READ(at + 0x200, 2), second[send][n]);

            /* the second axis: at + 0x800 and at + 64, not valid */
            assert_int_equal(READ(at + 64, 1), 0x80000000);
            assert_int_equal(READ(at + 64 + 0x200, 1), send ? 0x68410010 : 0x68400010);
        }
    }
}

TEST_ON(mapping_rules_are_enforced, start, bench)
{
    WRITE(0x1a01, 0, 1, 0);

    /* what may be mapped */
    WRITE_FAILS(0x1a01, 1, 4, 0x60600008, 0x06040041); /* an object that is not for TPDOs */
    WRITE_FAILS(0x1a01, 1, 4, 0x60830020, 0x06040041);
    WRITE_FAILS(0x1a01, 1, 4, 0x10180008, 0x06040041); /* a count */
    WRITE_FAILS(0x1a01, 1, 4, 0x00050008, 0x06020000); /* a dummy in a TPDO */
    WRITE_FAILS(0x1a01, 1, 4, 0x70410010, 0x06020000); /* no such axis */
    WRITE_FAILS(0x1a01, 1, 4, 0x60410110, 0x06090011);
    WRITE_FAILS(0x1a01, 1, 4, 0x60410008, 0x06070010); /* not as long as the object */
    WRITE(0x1a01, 1, 4, 0x60640020);
    WRITE(0x1a01, 2, 4, 0x60410010);
    WRITE(0x1a01, 3, 4, 0x68640020);

    /* how much: 64 bits, eight objects, none that is not there */
    WRITE_FAILS(0x1a01, 0, 1, 3, 0x06040042);
    WRITE_FAILS(0x1a01, 0, 1, 9, 0x06040042);
    WRITE_FAILS(0x1a01, 0, 1, 4, 0x06020000);
    WRITE(0x1a01, 3, 4, 0x68410010);
    WRITE(0x1a01, 0, 1, 3);
    WRITE_FAILS(0x1a01, 3, 4, 0, 0x08000022);

    /* RPDOs: objects for them, and dummies */
    WRITE(0x1601, 0, 1, 0);
    WRITE_FAILS(0x1601, 1, 4, 0x60410010, 0x06040041);
    WRITE(0x1601, 1, 4, 0x00060010);
    WRITE(0x1601, 2, 4, 0x40000010);
    WRITE_FAILS(0x1601, 3, 4, 0x00060020, 0x06070010);
    WRITE(0x1601, 0, 1, 2);
    WRITE(0x1401, 1, 4, 0x304);

    /* while it is valid */
    WRITE_FAILS(0x1601, 0, 1, 0, 0x08000022);
    WRITE_FAILS(0x1401, 1, 4, 0x305, 0x06090030);
    WRITE(0x1401, 2, 1, 1);
    WRITE(0x1401, 1, 4, 0x80000304);
    WRITE(0x1401, 1, 4, 0x305);
}

TEST_ON(a_dummy_is_skipped_and_bytes_are_little_endian, start, bench)
{
    MAP(0x1401, 0x304, 255, 0x00060010, 0x60ff0020, 0x00020008, 0x60600008);
    nmt(bench, CIA402_NMT_START, 4);
    bench_send(bench, 0, 0x304, "AA BB 04 03 02 FF CC 03");
    assert_int_equal(READ(0x60ff, 0), 0xff020304);
    assert_int_equal(READ(0x6060, 0), 3);

    /* a value out of its range is left out, the others count */
    bench_send(bench, 0, 0x304, "AA BB 05 00 00 00 CC 63");
    assert_int_equal(READ(0x60ff, 0), 5);
    assert_int_equal(READ(0x6060, 0), 3);
}

/* ---- transmission ---- */

TEST_ON(synchronous_types_count_syncs, start, bench)
{
    static const int types[] = {1, 2, 5, 240};

    nmt(bench, CIA402_NMT_START, 4);
    for (int i = 0; i < 4; i++) {
        int sent = 0;

        MAP(0x1801, 0x284, (unsigned)types[i], 0x40030020);
        for (int t = 1; t <= 480; t++) {
            bench_tick(bench); /* none without a SYNC */
            assert_int_equal(bench_sent(bench, 0, 0x284), 0);
            sync(bench);
            bench_tick(bench);
            sent += (int)bench_sent(bench, 0, 0x284);
            assert_int_equal(bench_sent(bench, 0, 0x284), t % types[i] == 0);
        }
        assert_int_equal(sent, 480 / types[i]);
    }
}

TEST_ON(type_0_answers_a_sync_after_a_change, start, bench)
{
    nmt(bench, CIA402_NMT_START, 4);
    MAP(0x1801, 0x284, 0, 0x40030020);
    sync(bench);
    bench_tick(bench);
    bench_expect(bench, 0, 0x284, "00 00 00 00"); /* the first */
    for (int i = 0; i < 5; i++) {
        sync(bench);
        bench_tick(bench);
        assert_int_equal(bench_sent(bench, 0, 0x284), 0);
    }
    bench->sense[0].qm = 0.5;
    bench_ticks(bench, 3);
    assert_int_equal(bench_sent(bench, 0, 0x284), 0);
    sync(bench);
    bench_tick(bench);
    bench_expect(bench, 0, 0x284, "50 C3 00 00");
}

TEST_ON(type_255_tells_changes_within_inhibit_and_event_times, start, bench)
{
    int sent = 0;

    WRITE(0x1801, 3, 2, 50); /* 5 ms */
    WRITE(0x1801, 5, 2, 20); /* 20 ms */
    MAP(0x1801, 0x284, 255, 0x40030020);
    nmt(bench, CIA402_NMT_START, 4);
    bench_tick(bench);
    assert_int_equal(bench_sent(bench, 0, 0x284), 1); /* the first */

    /* the event timer alone */
    for (int t = 1; t <= 100; t++) {
        bench_tick(bench);
        assert_int_equal(bench_sent(bench, 0, 0x284), t % 20 == 0);
    }

    /* a change every millisecond, told every fifth */
    for (int t = 1; t <= 100; t++) {
        bench->sense[0].qm += 0.01;
        bench_tick(bench);
        sent += (int)bench_sent(bench, 0, 0x284);
    }
    assert_int_equal(sent, 20);

    /* one change, at once */
    bench_ticks(bench, 10);
    bench->sense[0].qm += 0.01;
    bench_tick(bench);
    assert_int_equal(bench_sent(bench, 0, 0x284), 1);
}

TEST_ON(values_beyond_their_type_saturate, start, bench)
{
    MAP(0x1801, 0x284, 1, 0x40040010, 0x40070010, 0x40050010);
    nmt(bench, CIA402_NMT_START, 4);
    bench->sense[0] = (struct motor_sense){.q = -1.0, .current_a = -100.0, .torque_nm = 1e4};
    sync(bench);
    bench_tick(bench);
    bench_expect(bench, 0, 0x284, "FF 7F 00 80 FF 7F");
}

TEST_ON(sensors_send_their_wrench_with_every_sync, start, bench)
{
    nmt(bench, CIA402_NMT_START, 0);
    bench->ft = (struct ft_sense){.force_n = {12.34, -5.0, 1e6},
                                  .torque_nm = {1.234, 0.0, -1.0},
                                  .peak_nm = {1.234, 1e6, -1.0}};
    sync(bench);
    bench_tick(bench);
    bench_expect(bench, 0, 0x19f, "7B 00 CE FF 20 4E");
    bench_expect(bench, 0, 0x29f, "7B 00 00 00 9C FF");
    /* Fz is cut at 2000 N, and the peak of Ty is beyond its own */
    assert_int_equal(sdo_read(bench, 0, 31, 0x2100, 0), 20);
    assert_int_equal(sdo_read(bench, 0, 31, 0x2101, 0), CIA402_FAULT_SATURATED);
    assert_int_equal(sdo_read(bench, 0, 31, 0x7130, 0), 6);
    assert_int_equal(sdo_write(bench, 0, 31, 0x2102, 1, 2, 0xff85), 0); /* -123 */
    assert_int_equal(sdo_read(bench, 0, 31, 0x7130, 1), 0);
    bench->ft.force_n[1] = NAN;
    bench_tick(bench);
    assert_int_equal(sdo_read(bench, 0, 31, 0x7130, 2), 0xffce);
    assert_int_equal(sdo_read(bench, 0, 31, 0x2101, 0),
                     CIA402_FAULT_SATURATED | CIA402_FAULT_SENSOR);
}

TEST_ON(the_inertial_node_sends_what_it_measures, start, bench)
{
    const struct bus_frame start_all = {.id = 0, .len = 2, .data = {1, 0}};
    const struct bus_frame tick = {.id = CIA402_SYNC};

    boards_receive(bench->boards, bench->now_ns, 1, &start_all);
    bench->sensors.imu = (struct imu_sense){.gyro_rad_s = {0.1, -0.2, 0.3},
                                            .accel_m_s2 = {0.0, 1.0, 9.81},
                                            .quaternion = {1.0, 0.0, 0.0, 0.0}};
    for (int t = 1; t <= 50; t++) {
        boards_receive(bench->boards, bench->now_ns, 1, &tick);
        bench_tick(bench);
        bench_expect(bench, 1, 0x188, "00 00 C8 00 AA 07");
        bench_expect(bench, 1, 0x288, "64 00 38 FF 2C 01");
        bench_expect(bench, 1, 0x388, "10 27 00 00 00 00 00 00");
        assert_int_equal(bench_sent(bench, 1, 0x488), t == 50); /* the magnetic field */
    }
}

/* ---- reception ---- */

TEST_ON(synchronous_rpdos_wait_for_the_next_sync, start, bench)
{
    MAP(0x1401, 0x304, 1, 0x60ff0020);
    nmt(bench, CIA402_NMT_START, 4);
    bench_send(bench, 0, 0x304, "01 00 00 00; 02 00 00 00");
    bench_ticks(bench, 3);
    assert_int_equal(READ(0x60ff, 0), 0);
    sync(bench);
    assert_int_equal(READ(0x60ff, 0), 2);
    sync(bench);
    assert_int_equal(READ(0x60ff, 0), 2);
}

TEST_ON(an_rpdo_of_another_length_raises_an_emergency, start, bench)
{
    MAP(0x1401, 0x304, 255, 0x60ff0020);
    nmt(bench, CIA402_NMT_START, 4);
    bench_say(bench, 0, 0x304, "01 00 00");
    bench_expect(bench, 0, 0x084, "10 82 11 00 00 00 00 00");
    assert_int_equal(READ(0x60ff, 0), 0);
    bench_say(bench, 0, 0x304, "07 00 00 00 FF");
    bench_expect(bench, 0, 0x084, "20 82 11 00 00 00 00 00");
    assert_int_equal(READ(0x60ff, 0), 7);

    /* the newest error first; it can be emptied */
    assert_int_equal(READ(0x1003, 0), 2);
    assert_int_equal(READ(0x1003, 1), 0x8220);
    assert_int_equal(READ(0x1003, 2), 0x8210);
    WRITE(0x1003, 0, 1, 0);
    assert_int_equal(READ(0x1003, 0), 0);
    assert_int_equal(bench_counters(bench).malformed, 2);
}

TEST_ON(a_frame_that_one_of_its_nodes_refuses_is_told_of_that_one, start, bench)
{
    struct board_event event;

    /* Node 4 takes four bytes of 0x304, node 20 the two of its control word */
    MAP(0x1401, 0x304, 255, 0x60ff0020);
    assert_int_equal(sdo_write(bench, 0, 20, 0x1400, 1, 4, 0x80000304), 0);
    assert_int_equal(sdo_write(bench, 0, 20, 0x1600, 0, 1, 1), 0);
    assert_int_equal(sdo_write(bench, 0, 20, 0x1400, 1, 4, 0x304), 0);
    nmt(bench, CIA402_NMT_START, 0);
    bench_send(bench, 0, 0x304, "06 00");
    assert_true(bench_event(bench, BOARD_EVENT_MALFORMED, &event));
    assert_int_equal(event.address, 4);
    bench_send(bench, 0, 0x304, "01 00 00 00");
    assert_true(bench_event(bench, BOARD_EVENT_MALFORMED, &event));
    assert_int_equal(event.address, 20);
    assert_false(bench_event(bench, BOARD_EVENT_MALFORMED, &event));
    assert_int_equal(bench_counters(bench).malformed, 2);
}

/* ---- emergencies ---- */

TEST(every_fault_has_its_emergency)
{
    static const struct {
        const char *frame;
        double supply_v, winding_c, current_a, q, qm, torque_nm, oil_pa;
    } rows[] = {{"20 32 05 00 01 00 00 00", 10.0, 0, 0, 0, 0, 0, 0},
                {"10 32 05 00 02 00 00 00", 70.0, 0, 0, 0, 0, 0, 0},
                {"05 73 21 00 08 00 00 00", 48.0, 0, 0, 0, NAN, 0, 0},
                {"06 73 21 00 10 00 00 00", 48.0, 0, 0, NAN, 0, 0, 0},
                {"01 FF 81 00 20 00 00 00", 48.0, 0, 0, 0, 0, NAN, 0},
                {"10 43 09 00 40 00 00 00", 48.0, 130.0, 0, 0, 0, 0, 0},
                {"02 FF 81 00 00 20 00 00", 48.0, 0, 0, 0, 0, 0, 7.9e6},
                {"03 FF 81 00 00 40 00 00", 48.0, 0, 0, 0, 0, 0, 2.01e7}};

    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct board_bench base, *bench = &base;
        struct motor_sense healthy;

        configure(bench);
        bench->board[0].axis[0].valve = rows[i].oil_pa > 0.0;
        bench->board[0].under_pressure_pa = 8e6;
        bench->board[0].over_pressure_pa = 2e7;
        bench->sensors.oil_pa = 1.6e7;
        bench_start(bench);
        bench_tick(bench);
        healthy = bench->sense[0];
        bench->sensors.supply_v = rows[i].supply_v;
        bench->sensors.oil_pa = rows[i].oil_pa;
        bench->sense[0] = (struct motor_sense){.q = rows[i].q,
                                               .qm = rows[i].qm,
                                               .current_a = rows[i].current_a,
                                               .torque_nm = rows[i].torque_nm,
                                               .winding_c = rows[i].winding_c};
        bench_ticks(bench, 2);
        bench_expect_frame(bench_find(bench, 0, 0x084), 0x084, rows[i].frame);
        bench_ticks(bench, 10);
        assert_int_equal(bench_sent(bench, 0, 0x084), 0); /* once */

        /* gone when it was reset, on both axes where both had it */
        bench->sensors.supply_v = SUPPLY_V;
        bench->sensors.oil_pa = 1.6e7;
        bench->sense[0] = healthy;
        bench_ticks(bench, 3);
        WRITE(0x6040, 0, 2, 0x80);
        if (i < 2) {
            assert_int_equal(bench_sent(bench, 0, 0x084), 0);
            WRITE(0x6840, 0, 2, 0x80);
        }
        bench_expect(bench, 0, 0x084, "00 00 00 00 00 00 00 00");
        assert_int_equal(READ(0x1001, 0), 0);
        bench_stop(bench);
    }
}

static void request(struct board_bench *bench, uint32_t id)
{
    const struct bus_frame frame = {.id = id, .len = 2, .flags = FRAME_REMOTE};

    boards_receive(bench->boards, bench->now_ns, 0, &frame);
    bench_tick(bench);
}

/* Bit 30 of the COB-ID says that remote frames are not answered. */
TEST(a_tpdo_is_sent_when_it_is_asked_for)
{
    static const unsigned types[] = {0, 20, 254, 255};

    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        struct board_bench base, *bench = &base;

        start(bench);
        WRITE(0x1800, 2, 1, types[i]);
        request(bench, 0x184); /* not operational */
        assert_int_equal(bench_sent(bench, 0, 0x184), 0);
        nmt(bench, CIA402_NMT_START, 4);
        bench_ticks(bench, 5);
        assert_int_equal(bench_sent(bench, 0, 0x184), 0);
        request(bench, 0x184);
        bench_expect(bench, 0, 0x184, "50 02");
        bench_tick(bench);
        assert_int_equal(bench_sent(bench, 0, 0x184), 0);

        WRITE(0x1800, 1, 4, 0xc0000184);
        WRITE(0x1800, 1, 4, 0x40000184);
        bench_ticks(bench, 3);
        request(bench, 0x184);
        assert_int_equal(bench_sent(bench, 0, 0x184), 0);
        bench_stop(bench);
    }
}

TEST_ON(emergencies_keep_their_inhibit_time, start, bench)
{
    int last = -1000, sent = 0;

    WRITE(0x1015, 0, 2, 100); /* 10 ms */
    MAP(0x1401, 0x304, 255, 0x60ff0020);
    nmt(bench, CIA402_NMT_START, 4);
    bench_ticks(bench, 10);
    for (int i = 0; i < 5; i++) {
        bench_send(bench, 0, 0x304, "01");
    }
    for (int t = 0; t < 100; t++) {
        bench_tick(bench);
        if (bench_sent(bench, 0, 0x084)) {
            assert_true(t - last >= 10);
            last = t;
            sent++;
        }
    }
    assert_int_equal(sent, 5);
    assert_int_equal(last, 40);

    /* the register tells of it until one of the right length comes */
    assert_int_equal(READ(0x1001, 0), 0x11);
    bench_say(bench, 0, 0x304, "00 00 00 00");
    bench_expect(bench, 0, 0x084, "00 00 00 00 00 00 00 00");
    assert_int_equal(READ(0x1001, 0), 0x00);

    /* the identifier stays while the EMCY is valid */
    assert_int_equal(sdo_write(bench, 0, 4, 0x1014, 0, 4, 0x85), 0x06090030);
    WRITE(0x1014, 0, 4, 0x84);
    WRITE(0x1014, 0, 4, 0x80000085);
    WRITE(0x1014, 0, 4, 0x85);

    /* an EMCY that is switched off says nothing */
    WRITE(0x1014, 0, 4, 0x80000085);
    bench_send(bench, 0, 0x304, "01");
    bench_ticks(bench, 1);
    assert_int_equal(bench_sent(bench, 0, 0x084), 0);
}
