/* SPDX-License-Identifier: Apache-2.0 */
/* Faults of boards: power, hanging firmware; no fault shows on another board or out of its time. */
#include "tests/unit/boards/fault_bench.h"
#include "boards/protocol_list.h"

static struct error error;

/* Frames of the whole run of a base, hashed; without those of leg1 when others_only. */
static uint64_t run_hash(const char *line, bool others_only)
{
    static struct fault_bench bench;
    uint64_t hash = 0;

    begin(&bench, line);
    for (int i = 0; i < RUN_MS; i++) {
        tick(&bench);
        for (size_t b = 0; b < BENCH_BUSES; b++) {
            for (size_t k = 0; k < bench.base.count[b]; k++) {
                const struct bus_frame *frame = &bench.base.frame[b][k];

                if (others_only && b == 0 && (frame->id >> 4 & 0xf) == 1) {
                    continue;
                }
                hash = hash * 31 + frame->id * 7 + (uint64_t)i;
                for (int n = 0; n < frame->len; n++) {
                    hash = hash * 131 + frame->data[n];
                }
            }
        }
    }
    end(&bench);
    return hash;
}

TEST(armed_fault_that_does_not_begin_changes_no_frame)
{
    static const char *const lines[] = {
        "board leg1 off manual",          "board leg1 stuck manual",
        "board leg1 garbage manual",      "board leg1 slow 3 manual",
        "board leg1 delayed 0.01 manual", "board leg1 intermittent manual",
        "board leg1 hung manual"};
    uint64_t sound = run_hash(NULL, false);

    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        assert_true(run_hash(lines[i], false) == sound);
    }
}

TEST(fault_shows_on_its_board_only_and_repeats_with_the_seed)
{
    static const char *const lines[] = {"board leg1 off 0.05..",
                                        "board leg1 stuck 0.05..",
                                        "board leg1 garbage 0.05..",
                                        "board leg1 slow 3 0.05..",
                                        "board leg1 delayed 0.01 0.05..",
                                        "board leg1 intermittent 0.05..",
                                        "board leg1 hung watchdog=0.03 0.05.."};
    uint64_t sound = run_hash(NULL, false), others = run_hash(NULL, true);

    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        uint64_t hash = run_hash(lines[i], false);

        assert_true(hash != sound);
        assert_true(hash == run_hash(lines[i], false));
        assert_true(run_hash(lines[i], true) == others);
    }
}

CLOSED_BENCH(fault_bench, struct fault_bench, end)

TEST_ON(board_without_power_is_silent_deaf_and_limp_and_boots_anew, fault_bench, bench)
{
    uint64_t foreign;
    struct boards_counters counters;

    begin(bench, "board leg/1 off 0.02..0.04");
    bench->base.board[0].boot_ns = 0;
    enable(bench);
    run_to(bench, 20);
    assert_true(bench->base.motor[0].bridge_on);
    boards_counters(bench->base.boards, &counters);
    foreign = counters.foreign;
    while (bench->ms < 40) {
        tick(bench);
        assert_false(bench->base.motor[0].bridge_on);
        assert_int_equal(bench_sent(&bench->base, 0, POSITION), 0);
        enable(bench); /* nobody hears it */
    }
    boards_counters(bench->base.boards, &counters);
    assert_int_equal(counters.foreign - foreign, 2 * 20);
    for (int i = 0; i < 8; i++) {
        tick(bench);
        assert_false(bench->base.motor[0].bridge_on); /* idle after the restart */
    }
    enable(bench);
    tick(bench);
    tick(bench);
    assert_true(bench->base.motor[0].bridge_on);
}

TEST_ON(board_that_boots_is_away_for_its_boot_time, fault_bench, bench)
{
    int64_t first = 0;

    bench_configure(&bench->base);
    begin(bench, "board leg1 off 0.02..0.03");
    bench_stop(&bench->base);
    bench->base.board[0].boot_ns = 50 * MS;
    bench_start(&bench->base);
    while (bench->ms < 150) {
        tick(bench);
        if (bench->ms > 30 && !first && bench_sent(&bench->base, 0, POSITION)) {
            first = bench->ms;
        }
    }
    assert_in_range((uint64_t)first, 80, 86);
}

/* +333 counts of 1333 in open loop; then the firmware stands still, the timer does not. */
TEST_ON(hung_board_keeps_its_share_of_the_supply_until_the_watchdog_resets_it, fault_bench, bench)
{
    double sampled_v = SUPPLY_V;

    begin(bench, "board leg1 hung watchdog=0.03 0.02..0.021");
    enable(bench);
    run_to(bench, 20);
    assert_near(bench->base.motor[0].voltage_v, 333.0 / 1333.0 * SUPPLY_V, 1e-12);
    while (bench->ms < 50) {
        bench->base.sensors.supply_v = bench->ms < 30 ? SUPPLY_V : 40.0;
        bench_send(&bench->base, 0, 0x001, "72 00 00"); /* nobody hears it */
        bench_send(&bench->base, 0, 0x70f, "FF");
        tick(bench);
        assert_int_equal(bench_sent(&bench->base, 0, POSITION), 0);
        assert_int_equal(bench_sent(&bench->base, 0, 0x710), 0);
        assert_true(bench->base.motor[0].bridge_on);
        assert_near(bench->base.motor[0].voltage_v, 333.0 / 1333.0 * sampled_v, 1e-12);
        sampled_v = bench->base.sensors.supply_v; /* at the end of the tick */
        assert_false(bench->base.motor[1].bridge_on);
    }
    for (int i = 0; i < 8; i++) {
        tick(bench);
        assert_false(bench->base.motor[0].bridge_on); /* idle after the restart */
    }
    enable(bench);
    tick(bench);
    assert_true(bench->base.motor[0].bridge_on);
}

TEST_ON(hung_board_boots_for_its_boot_time_and_hangs_once, fault_bench, bench)
{
    int64_t first = 0;
    size_t sent = 0;

    begin(bench, "board leg1 hung watchdog=0.02 0.05..");
    bench_stop(&bench->base);
    bench->base.board[0].boot_ns = 30 * MS;
    bench_start(&bench->base);
    while (bench->ms < 300) {
        tick(bench);
        if (bench->ms > 50 && bench_sent(&bench->base, 0, POSITION)) {
            first = first ? first : bench->ms;
            sent++;
        }
    }
    assert_in_range((uint64_t)first, 100, 106); /* 50 + 20 + 30, and its slot */
    assert_in_range(sent, 48, 51);
}

TEST_ON(emergency_stop_opens_the_bridges_of_a_hung_board, fault_bench, bench)
{
    begin(bench, "board leg1 hung watchdog=1 0.02..");
    enable(bench);
    run_to(bench, 30);
    assert_true(bench->base.motor[0].bridge_on);
    boards_shut_down(bench->base.boards, bench->base.now_ns, &bench->base.command);
    for (int i = 0; i < 5; i++) {
        assert_false(bench->base.motor[0].bridge_on);
        assert_true(bench->base.motor[0].voltage_v == 0.0);
        tick(bench);
    }
}

/* Board leg2 has one axis; the joints of leg1 are none of its business. */
TEST_ON(hung_board_leaves_the_bridges_of_others_alone, fault_bench, bench)
{
    begin(bench, "board leg2 hung watchdog=1 0.02..");
    enable(bench);
    run_to(bench, 30);
    bench_send(&bench->base, 0, 0x001, "72 00 01");
    tick(bench);
    assert_near(bench->base.motor[0].voltage_v, 256.0 / 1333.0 * SUPPLY_V, 1e-12);
}

TEST_ON(power_cut_ends_a_hang, fault_bench, bench)
{
    struct board_event event;
    struct fault fault[2];
    int restarts = 0;

    begin(bench, "board leg1 hung watchdog=10 0.02..");
    bench_stop(&bench->base);
    fault[0] = *faults_at(bench->faults, 0);
    fault[1] = fault[0];
    fault[1].kind = FAULT_OFF;
    fault[1].from_ns = 40 * MS;
    fault[1].to_ns = 50 * MS;
    snprintf(fault[1].name, sizeof fault[1].name, "off");
    assert_ok(
        faults_create(fault, 2, 5, &bench->arena, &bench->faults, &(struct error){ERROR_NONE}));
    bench->base.config.faults = bench->faults;
    bench_start(&bench->base);
    enable(bench);
    run_to(bench, 45);
    assert_false(bench->base.motor[0].bridge_on);
    run_to(bench, 60);
    while (bench_event(&bench->base, BOARD_EVENT_RESTART, &event)) {
        restarts++;
    }
    assert_int_equal(restarts, 2); /* into the bootloader and out of it: by the power alone */
    assert_int_not_equal(position(bench), INT32_MAX);
}

/* A field that the firmware turns stands still: the motor brakes. */
TEST_ON(hung_2foc_brakes, fault_bench, bench)
{
    static const struct boards_bus_config buses[BENCH_BUSES] = {{.protocol = &protocol_foc}};

    begin(bench, "board leg1 hung watchdog=0.03 0.02..");
    bench_stop(&bench->base);
    bench->base.config.bus = buses;
    bench->base.config.nboard = 1;
    bench->base.board[0].axis[0].gear = 100.0;
    bench->base.board[0].axis[1].joint = -1;
    bench_start(&bench->base);
    bench_send(&bench->base, 0, 0x001, "5B 01 06; 77 01 00 10 00 00 0E");
    bench_send(&bench->base, 0, 0x001, "48 00 A0 0F 40 1F 20 4E; 65 92 00 E3 00 00 00 0F");
    bench_send(&bench->base, 0, 0x001, "09 50");
    while (bench->ms < 50) {
        bench_send(&bench->base, 0, 0x10f, "00 10");
        tick(bench);
        assert_true(bench->base.motor[0].bridge_on);
        assert_int_equal(bench->base.motor[0].voltage_v != 0.0, bench->ms <= 20);
    }
    tick(bench);
    assert_false(bench->base.motor[0].bridge_on);
}

static void joint_restarted(void *context, int joint)
{
    sensing_restart_counter(context, (size_t)joint);
}

/* What the motor board 1 tells of its rotor, in ticks, before and after it was without power. */
TEST_ON(counter_of_an_incremental_encoder_starts_anew_with_the_power, fault_bench, bench)
{
    struct sensor_joint joint[BENCH_JOINTS] = {{.name = "hip", .incremental = true}};
    struct sensing_config config = {
        .njoint = BENCH_JOINTS, .nft = 1, .joint = joint, .tick_ns = MS, .seed = 1};
    struct motor_sense true_sense[BENCH_JOINTS] = {{.qm = 0.5}};
    struct plant_sensors truth;
    struct sensing *sensing;
    int32_t seen[3] = {0};

    for (int j = 1; j < BENCH_JOINTS; j++) {
        joint[j].name = "other";
        true_sense[j].qm = 0.25;
    }
    begin(bench, "board leg1 off 0.1..0.12");
    bench_stop(&bench->base);
    assert_ok(sensing_create(&config, &bench->arena, &sensing, &error));
    bench->base.config.restarted = joint_restarted;
    bench->base.config.context = sensing;
    bench_start(&bench->base);
    bench_send(&bench->base, 0, 0x001, "49 FF 0F 00 00");
    truth = bench->base.sensors;
    truth.motor = true_sense;
    bench->base.sensors = *sensing_sample(sensing, truth.time_ns, &truth);
    for (; bench->ms < 200; bench->ms++) {
        const struct bus_frame *frame;

        true_sense[0].qm = bench->ms < 50    ? 0.5
                           : bench->ms < 110 ? 0.6
                           : bench->ms < 150 ? 0.9
                                             : 1.0;
        truth.time_ns = bench->ms * MS;
        faults_step(bench->faults, bench->ms * MS);
        if (bench->ms == 125) {
            bench_send(&bench->base, 0, 0x001, "49 FF 0F 00 00");
        }
        bench_control(&bench->base);
        bench->base.sensors = *sensing_sample(sensing, truth.time_ns, &truth);
        bench_transmit(&bench->base);
        frame = bench_find(&bench->base, 0, 0x110 | ICUB_MOTOR_POSITION);
        if (frame) {
            seen[bench->ms < 100 ? 0 : bench->ms < 150 ? 1 : 2] = get_i32_le(frame->data);
            assert_int_equal(get_i32_le(frame->data + 4), 0.25 * MOTOR_TICKS_PER_RAD);
        }
        frame = bench_find(&bench->base, 0, 0x110 | ICUB_MOTOR_SPEED);
        if (frame && bench->ms > 120 && bench->ms < 150) {
            assert_int_equal(get_i16_le(frame->data), 0); /* the jump of the count is no motion */
        }
    }
    assert_int_equal(seen[0], lround(0.1 * MOTOR_TICKS_PER_RAD));
    assert_int_equal(seen[1], 0);
    assert_int_equal(seen[2], lround(0.1 * MOTOR_TICKS_PER_RAD));
}

TEST_ON(replies_that_wait_are_lost_with_the_power, fault_bench, bench)
{
    begin(bench, "board leg1 off 0.001..0.002");
    tick(bench);
    bench_send(&bench->base, 0, 0x001, "07"); /* control mode, please */
    for (int i = 0; i < 10; i++) {
        tick(bench);
        assert_int_equal(bench_sent(&bench->base, 0, 0x010), 0);
    }
    bench_send(&bench->base, 0, 0x001, "07");
    tick(bench);
    assert_int_equal(bench_sent(&bench->base, 0, 0x010), 1);
}

/* An encoder mounted 0.1 rad off: command 0x04 with what it reads at zero takes it out. */
TEST_ON(calibration_takes_out_the_offset_of_an_encoder, fault_bench, bench)
{
    struct sensor_joint joint[BENCH_JOINTS] = {{.name = "hip", .link_encoder = {.offset = 0.1}}};
    struct sensing_config config = {
        .njoint = BENCH_JOINTS, .nft = 1, .joint = joint, .tick_ns = MS, .seed = 1};
    struct plant_sensors truth;
    struct sensing *sensing;
    int32_t seen[2] = {0};

    for (int j = 1; j < BENCH_JOINTS; j++) {
        joint[j].name = "other";
    }
    begin(bench, NULL);
    truth = bench->base.sensors;
    assert_ok(sensing_create(&config, &bench->arena, &sensing, &error));
    for (int i = 0; i < 300; i++) {
        bench->base.sensors = *sensing_sample(sensing, truth.time_ns, &truth);
        if (i == 100) {
            bench_send(&bench->base, 0, 0x001, "04 03 00 00 0A 00 E8 03");
        }
        bench_tick(&bench->base);
        truth.time_ns += MS;
        if (position(bench) != INT32_MIN) {
            seen[i > 100] = position(bench);
        }
    }
    assert_int_equal(seen[0], 0.1 * TICKS_PER_RAD);
    assert_int_equal(seen[1], 0);
}
