/* SPDX-License-Identifier: Apache-2.0 */
/* Faults of boards: what each does to the frames of one board, to no other, only in its time. */
#include "tests/unit/boards/board_bench.h"

#include "boards/faults.h"
#include "boards/sensing.h"

#define MS INT64_C(1000000)

enum { POSITION = 0x111, STRAIN_FORCE = 0x3d0 | ICUB_FORCE, RUN_MS = 200 };

static struct faults *arm(struct board_bench *base, struct arena *arena, const char *line)
{
    static const char *const bus[] = {"leg", "arm"};
    static const bool wire[] = {false, false};
    static const char *const board[] = {"leg1", "leg2", "torques", "ankle", "arm1"};
    static const size_t board_bus[] = {0, 0, 0, 0, 1};
    static const int address[] = {1, 2, 12, 13, 1};
    const struct fault_names names = {.nbus = 2,
                                      .bus = bus,
                                      .wire = wire,
                                      .nboard = 5,
                                      .board = board,
                                      .board_bus = board_bus,
                                      .board_address = address};
    struct faults *faults;
    struct fault fault;
    struct error error;

    if (line && fault_parse(line, &names, &fault, &error)) {
        fail_msg("%s", error.text);
    }
    assert_int_equal(faults_create(&fault, line != NULL, 5, arena, &faults, &error), ERROR_NONE);
    base->config.faults = faults;
    return faults;
}

/* A bench whose board leg1 has line as its fault, all boards telling from the start. */
struct fault_bench {
    struct board_bench base;
    struct arena arena;
    struct faults *faults;
    int64_t ms;
};

static void begin(struct fault_bench *bench, const char *line)
{
    struct error error;

    bench_configure(&bench->base);
    for (int i = 0; i < BENCH_BOARDS; i++) {
        bench->base.board[i].transmit_at_start = true;
    }
    assert_int_equal(arena_init(&bench->arena, 8u << 20, &error), ERROR_NONE);
    bench->faults = arm(&bench->base, &bench->arena, line);
    bench_start(&bench->base);
    bench->ms = 0;
}

static void end(struct fault_bench *bench)
{
    bench_stop(&bench->base);
    arena_fini(&bench->arena);
}

/* A millisecond, with joint 0 at a place of its own. */
static void tick(struct fault_bench *bench)
{
    faults_step(bench->faults, bench->ms * MS);
    bench->base.sense[0].q = 0.01 * (double)bench->ms;
    bench->base.ft.force_n[2] = (double)bench->ms;
    bench_tick(&bench->base);
    bench->ms++;
}

static int32_t position(const struct fault_bench *bench)
{
    const struct bus_frame *frame = bench_find(&bench->base, 0, POSITION);

    return frame ? get_i32_le(frame->data) : INT32_MIN;
}

static void enable(struct fault_bench *bench)
{
    bench_send(&bench->base, 0, 0x001, "09 50");
    bench_send(&bench->base, 0, 0x001, "72 4D 01");
}

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

static void armed_fault_that_does_not_begin_changes_no_frame(void **state)
{
    static const char *const lines[] = {
        "board leg1 off manual",          "board leg1 stuck manual",
        "board leg1 garbage manual",      "board leg1 slow 3 manual",
        "board leg1 delayed 0.01 manual", "board leg1 intermittent manual",
        "board leg1 hung manual"};
    uint64_t sound = run_hash(NULL, false);

    (void)state;
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        assert_true(run_hash(lines[i], false) == sound);
    }
}

static void fault_shows_on_its_board_only_and_repeats_with_the_seed(void **state)
{
    static const char *const lines[] = {"board leg1 off 0.05..",
                                        "board leg1 stuck 0.05..",
                                        "board leg1 garbage 0.05..",
                                        "board leg1 slow 3 0.05..",
                                        "board leg1 delayed 0.01 0.05..",
                                        "board leg1 intermittent 0.05..",
                                        "board leg1 hung watchdog=0.03 0.05.."};
    uint64_t sound = run_hash(NULL, false), others = run_hash(NULL, true);

    (void)state;
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++) {
        uint64_t hash = run_hash(lines[i], false);

        assert_true(hash != sound);
        assert_true(hash == run_hash(lines[i], false));
        assert_true(run_hash(lines[i], true) == others);
    }
}

static void board_without_power_is_silent_deaf_and_limp_and_boots_anew(void **state)
{
    static struct fault_bench bench;
    uint64_t foreign;
    struct boards_counters counters;

    (void)state;
    begin(&bench, "board leg/1 off 0.02..0.04");
    bench.base.board[0].boot_ns = 0;
    enable(&bench);
    while (bench.ms < 20) {
        tick(&bench);
    }
    assert_true(bench.base.motor[0].bridge_on);
    boards_counters(bench.base.boards, &counters);
    foreign = counters.foreign;
    while (bench.ms < 40) {
        tick(&bench);
        assert_false(bench.base.motor[0].bridge_on);
        assert_int_equal(bench_sent(&bench.base, 0, POSITION), 0);
        enable(&bench); /* nobody hears it */
    }
    boards_counters(bench.base.boards, &counters);
    assert_int_equal(counters.foreign - foreign, 2 * 20);
    for (int i = 0; i < 8; i++) {
        tick(&bench);
        assert_false(bench.base.motor[0].bridge_on); /* idle after the restart */
    }
    enable(&bench);
    tick(&bench);
    tick(&bench);
    assert_true(bench.base.motor[0].bridge_on);
    end(&bench);
}

static void board_that_boots_is_away_for_its_boot_time(void **state)
{
    static struct fault_bench bench;
    int64_t first = 0;

    (void)state;
    bench_configure(&bench.base);
    begin(&bench, "board leg1 off 0.02..0.03");
    bench_stop(&bench.base);
    bench.base.board[0].boot_ns = 50 * MS;
    bench_start(&bench.base);
    while (bench.ms < 150) {
        tick(&bench);
        if (bench.ms > 30 && !first && bench_sent(&bench.base, 0, POSITION)) {
            first = bench.ms;
        }
    }
    assert_in_range((uint64_t)first, 80, 86);
    end(&bench);
}

/* +333 counts of 1333 in open loop; then the firmware stands still, the timer does not. */
static void hung_board_keeps_its_share_of_the_supply_until_the_watchdog_resets_it(void **state)
{
    static struct fault_bench bench;
    double sampled_v = SUPPLY_V;

    (void)state;
    begin(&bench, "board leg1 hung watchdog=0.03 0.02..0.021");
    enable(&bench);
    while (bench.ms < 20) {
        tick(&bench);
    }
    assert_near(bench.base.motor[0].voltage_v, 333.0 / 1333.0 * SUPPLY_V, 1e-12);
    while (bench.ms < 50) {
        bench.base.sensors.supply_v = bench.ms < 30 ? SUPPLY_V : 40.0;
        bench_send(&bench.base, 0, 0x001, "72 00 00"); /* nobody hears it */
        bench_send(&bench.base, 0, 0x70f, "FF");
        tick(&bench);
        assert_int_equal(bench_sent(&bench.base, 0, POSITION), 0);
        assert_int_equal(bench_sent(&bench.base, 0, 0x710), 0);
        assert_true(bench.base.motor[0].bridge_on);
        assert_near(bench.base.motor[0].voltage_v, 333.0 / 1333.0 * sampled_v, 1e-12);
        sampled_v = bench.base.sensors.supply_v; /* at the end of the tick */
        assert_false(bench.base.motor[1].bridge_on);
    }
    for (int i = 0; i < 8; i++) {
        tick(&bench);
        assert_false(bench.base.motor[0].bridge_on); /* idle after the restart */
    }
    enable(&bench);
    tick(&bench);
    assert_true(bench.base.motor[0].bridge_on);
    end(&bench);
}

static void hung_board_boots_for_its_boot_time_and_hangs_once(void **state)
{
    static struct fault_bench bench;
    int64_t first = 0;
    size_t sent = 0;

    (void)state;
    begin(&bench, "board leg1 hung watchdog=0.02 0.05..");
    bench_stop(&bench.base);
    bench.base.board[0].boot_ns = 30 * MS;
    bench_start(&bench.base);
    while (bench.ms < 300) {
        tick(&bench);
        if (bench.ms > 50 && bench_sent(&bench.base, 0, POSITION)) {
            first = first ? first : bench.ms;
            sent++;
        }
    }
    assert_in_range((uint64_t)first, 100, 106); /* 50 + 20 + 30, and its slot */
    assert_in_range(sent, 48, 51);
    end(&bench);
}

static void emergency_stop_opens_the_bridges_of_a_hung_board(void **state)
{
    static struct fault_bench bench;

    (void)state;
    begin(&bench, "board leg1 hung watchdog=1 0.02..");
    enable(&bench);
    while (bench.ms < 30) {
        tick(&bench);
    }
    assert_true(bench.base.motor[0].bridge_on);
    boards_shut_down(bench.base.boards, bench.base.now_ns, &bench.base.command);
    for (int i = 0; i < 5; i++) {
        assert_false(bench.base.motor[0].bridge_on);
        assert_true(bench.base.motor[0].voltage_v == 0.0);
        tick(&bench);
    }
    end(&bench);
}

/* Board leg2 has one axis; the joints of leg1 are none of its business. */
static void hung_board_leaves_the_bridges_of_others_alone(void **state)
{
    static struct fault_bench bench;

    (void)state;
    begin(&bench, "board leg2 hung watchdog=1 0.02..");
    enable(&bench);
    while (bench.ms < 30) {
        tick(&bench);
    }
    bench_send(&bench.base, 0, 0x001, "72 00 01");
    tick(&bench);
    assert_near(bench.base.motor[0].voltage_v, 256.0 / 1333.0 * SUPPLY_V, 1e-12);
    end(&bench);
}

static void power_cut_ends_a_hang(void **state)
{
    static struct fault_bench bench;
    struct board_event event;
    struct fault fault[2];
    int restarts = 0;

    (void)state;
    begin(&bench, "board leg1 hung watchdog=10 0.02..");
    bench_stop(&bench.base);
    fault[0] = *faults_at(bench.faults, 0);
    fault[1] = fault[0];
    fault[1].kind = FAULT_OFF;
    fault[1].from_ns = 40 * MS;
    fault[1].to_ns = 50 * MS;
    snprintf(fault[1].name, sizeof fault[1].name, "off");
    assert_int_equal(
        faults_create(fault, 2, 5, &bench.arena, &bench.faults, &(struct error){ERROR_NONE}),
        ERROR_NONE);
    bench.base.config.faults = bench.faults;
    bench_start(&bench.base);
    enable(&bench);
    while (bench.ms < 45) {
        tick(&bench);
    }
    assert_false(bench.base.motor[0].bridge_on);
    while (bench.ms < 60) {
        tick(&bench);
    }
    while (bench_event(&bench.base, BOARD_EVENT_RESTART, &event)) {
        restarts++;
    }
    assert_int_equal(restarts, 2); /* into the bootloader and out of it: by the power alone */
    assert_int_not_equal(position(&bench), INT32_MAX);
    end(&bench);
}

/* A field that the firmware turns stands still: the motor brakes. */
static void hung_2foc_brakes(void **state)
{
    static const struct boards_bus_config buses[BENCH_BUSES] = {{.personality = BOARD_FOC}};
    static struct fault_bench bench;

    (void)state;
    begin(&bench, "board leg1 hung watchdog=0.03 0.02..");
    bench_stop(&bench.base);
    bench.base.config.bus = buses;
    bench.base.config.nboard = 1;
    bench.base.board[0].axis[0].gear = 100.0;
    bench.base.board[0].axis[1].joint = -1;
    bench_start(&bench.base);
    bench_send(&bench.base, 0, 0x001, "5B 01 06");
    bench_send(&bench.base, 0, 0x001, "77 01 00 10 00 00 0E");
    bench_send(&bench.base, 0, 0x001, "48 00 A0 0F 40 1F 20 4E");
    bench_send(&bench.base, 0, 0x001, "65 92 00 E3 00 00 00 0F");
    bench_send(&bench.base, 0, 0x001, "09 50");
    while (bench.ms < 50) {
        bench_send(&bench.base, 0, 0x10f, "00 10");
        tick(&bench);
        assert_true(bench.base.motor[0].bridge_on);
        assert_int_equal(bench.base.motor[0].voltage_v != 0.0, bench.ms <= 20);
    }
    tick(&bench);
    assert_false(bench.base.motor[0].bridge_on);
    end(&bench);
}

static void joint_restarted(void *context, int joint)
{
    sensing_restart_counter(context, (size_t)joint);
}

/* What the motor board 1 tells of its rotor, in ticks, before and after it was without power. */
static void counter_of_an_incremental_encoder_starts_anew_with_the_power(void **state)
{
    static struct fault_bench bench;
    struct sensor_joint joint[BENCH_JOINTS] = {{.name = "hip", .incremental = true}};
    struct sensing_config config = {
        .njoint = BENCH_JOINTS, .nft = 1, .joint = joint, .tick_ns = MS, .seed = 1};
    struct motor_sense true_sense[BENCH_JOINTS] = {{.qm = 0.5}};
    struct plant_sensors truth;
    struct sensing *sensing;
    struct error error;
    int32_t seen[3] = {0};

    (void)state;
    for (int j = 1; j < BENCH_JOINTS; j++) {
        joint[j].name = "other";
        true_sense[j].qm = 0.25;
    }
    begin(&bench, "board leg1 off 0.1..0.12");
    bench_stop(&bench.base);
    assert_int_equal(sensing_create(&config, &bench.arena, &sensing, &error), ERROR_NONE);
    bench.base.config.restarted = joint_restarted;
    bench.base.config.context = sensing;
    bench_start(&bench.base);
    bench_send(&bench.base, 0, 0x001, "49 FF 0F 00 00");
    truth = bench.base.sensors;
    truth.motor = true_sense;
    bench.base.sensors = *sensing_sample(sensing, truth.time_ns, &truth);
    for (; bench.ms < 200; bench.ms++) {
        const struct bus_frame *frame;

        true_sense[0].qm = bench.ms < 50 ? 0.5 : bench.ms < 110 ? 0.6 : bench.ms < 150 ? 0.9 : 1.0;
        truth.time_ns = bench.ms * MS;
        faults_step(bench.faults, bench.ms * MS);
        if (bench.ms == 125) {
            bench_send(&bench.base, 0, 0x001, "49 FF 0F 00 00");
        }
        bench_control(&bench.base);
        bench.base.sensors = *sensing_sample(sensing, truth.time_ns, &truth);
        bench_transmit(&bench.base);
        frame = bench_find(&bench.base, 0, 0x110 | ICUB_MOTOR_POSITION);
        if (frame) {
            seen[bench.ms < 100 ? 0 : bench.ms < 150 ? 1 : 2] = get_i32_le(frame->data);
            assert_int_equal(get_i32_le(frame->data + 4), 0.25 * MOTOR_TICKS_PER_RAD);
        }
        frame = bench_find(&bench.base, 0, 0x110 | ICUB_MOTOR_SPEED);
        if (frame && bench.ms > 120 && bench.ms < 150) {
            assert_int_equal(get_i16_le(frame->data), 0); /* the jump of the count is no motion */
        }
    }
    assert_int_equal(seen[0], lround(0.1 * MOTOR_TICKS_PER_RAD));
    assert_int_equal(seen[1], 0);
    assert_int_equal(seen[2], lround(0.1 * MOTOR_TICKS_PER_RAD));
    end(&bench);
}

static void replies_that_wait_are_lost_with_the_power(void **state)
{
    static struct fault_bench bench;

    (void)state;
    begin(&bench, "board leg1 off 0.001..0.002");
    tick(&bench);
    bench_send(&bench.base, 0, 0x001, "07"); /* control mode, please */
    for (int i = 0; i < 10; i++) {
        tick(&bench);
        assert_int_equal(bench_sent(&bench.base, 0, 0x010), 0);
    }
    bench_send(&bench.base, 0, 0x001, "07");
    tick(&bench);
    assert_int_equal(bench_sent(&bench.base, 0, 0x010), 1);
    end(&bench);
}

static void stuck_board_repeats_its_last_position_at_its_rate(void **state)
{
    static struct fault_bench bench;
    int32_t last = 0;
    size_t sent = 0;

    (void)state;
    begin(&bench, "board leg1 stuck 0.05..0.1");
    while (bench.ms < 50) {
        tick(&bench);
        last = position(&bench) != INT32_MIN ? position(&bench) : last;
    }
    while (bench.ms < 100) {
        tick(&bench);
        if (position(&bench) != INT32_MIN) {
            sent++;
            assert_int_equal(position(&bench), last);
        }
    }
    assert_in_range(sent, 12, 13);
    for (int i = 0; i < 4; i++) {
        tick(&bench);
        if (position(&bench) != INT32_MIN) {
            assert_true(position(&bench) > last);
        }
    }
    end(&bench);
}

static void garbage_keeps_identifiers_and_lengths(void **state)
{
    static struct fault_bench bench;
    int different = 0, sent = 0;

    (void)state;
    begin(&bench, "board leg1 garbage");
    while (bench.ms < 100) {
        const struct bus_frame *frame;

        tick(&bench);
        frame = bench_find(&bench.base, 0, POSITION);
        if (frame) {
            assert_int_equal(frame->len, 8);
            sent++;
            different += get_i32_le(frame->data) != (int32_t)(100 * (bench.ms - 1));
        }
    }
    assert_in_range(sent, 24, 25);
    assert_int_equal(different, sent);
    end(&bench);
}

static void slow_board_sends_one_frame_of_n(void **state)
{
    static struct fault_bench bench;
    size_t sent = 0;

    (void)state;
    begin(&bench, "board leg1 slow 5");
    while (bench.ms < 200) {
        tick(&bench);
        sent += bench_sent(&bench.base, 0, POSITION);
    }
    assert_int_equal(sent, 10); /* of 50 */
    end(&bench);
}

static void delayed_board_sends_what_was_true_before(void **state)
{
    static struct fault_bench bench, sound;
    int32_t history[RUN_MS];
    int compared = 0;

    (void)state;
    begin(&bench, "board leg1 delayed 0.008");
    begin(&sound, NULL);
    for (int i = 0; i < RUN_MS; i++) {
        tick(&sound);
        tick(&bench);
        history[i] = position(&sound);
        if (i >= 8 && position(&bench) != INT32_MIN) {
            assert_int_equal(position(&bench), history[i - 8]);
            compared++;
        }
        if (i < 8) {
            assert_int_equal(position(&bench), INT32_MIN);
        }
    }
    assert_in_range(compared, 46, 48);
    end(&bench);
    end(&sound);
}

static void intermittent_board_is_gone_for_its_share_but_keeps_running(void **state)
{
    static struct fault_bench bench;
    size_t sent = 0;
    const int ticks = 20000;

    (void)state;
    begin(&bench, "board leg1 intermittent 0.25 dwell=0.01");
    while (bench.ms < ticks) {
        bench.base.sense[0].q = 0.0;
        faults_step(bench.faults, bench.ms++ * MS);
        bench_tick(&bench.base);
        sent += bench_sent(&bench.base, 0, POSITION);
    }
    /* 5000 slots; five standard deviations with gaps of 2.5 slots on average */
    assert_in_range(sent, 5000 * 3 / 4 - 400, 5000 * 3 / 4 + 400);
    end(&bench);
}

static void neighbors_hear_the_faulty_torque_of_a_strain_board(void **state)
{
    static struct fault_bench bench;

    (void)state;
    begin(&bench, "board torques off 0.05..");
    bench_send(&bench.base, 0, 0x001, "34 0C 00 00 00 00 00 00");
    bench_send(&bench.base, 0, 0x001, "09 03"); /* torque mode lives on the source */
    while (bench.ms < 50) {
        tick(&bench);
    }
    assert_true(bench.base.motor[0].bridge_on);
    while (bench.ms < 400) {
        tick(&bench);
    }
    assert_false(bench.base.motor[0].bridge_on); /* silent for 200 ms: watchdog */
    end(&bench);
}

/* An encoder mounted 0.1 rad off: command 0x04 with what it reads at zero takes it out. */
static void calibration_takes_out_the_offset_of_an_encoder(void **state)
{
    static struct fault_bench bench;
    struct sensor_joint joint[BENCH_JOINTS] = {{.name = "hip", .link_encoder = {.offset = 0.1}}};
    struct sensing_config config = {
        .njoint = BENCH_JOINTS, .nft = 1, .joint = joint, .tick_ns = MS, .seed = 1};
    struct plant_sensors truth;
    struct sensing *sensing;
    struct error error;
    int32_t seen[2] = {0};

    (void)state;
    for (int j = 1; j < BENCH_JOINTS; j++) {
        joint[j].name = "other";
    }
    begin(&bench, NULL);
    truth = bench.base.sensors;
    assert_int_equal(sensing_create(&config, &bench.arena, &sensing, &error), ERROR_NONE);
    for (int i = 0; i < 300; i++) {
        bench.base.sensors = *sensing_sample(sensing, truth.time_ns, &truth);
        if (i == 100) {
            bench_send(&bench.base, 0, 0x001, "04 03 00 00 0A 00 E8 03");
        }
        bench_tick(&bench.base);
        truth.time_ns += MS;
        if (position(&bench) != INT32_MIN) {
            seen[i > 100] = position(&bench);
        }
    }
    assert_int_equal(seen[0], 0.1 * TICKS_PER_RAD);
    assert_int_equal(seen[1], 0);
    end(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(armed_fault_that_does_not_begin_changes_no_frame),
        cmocka_unit_test(fault_shows_on_its_board_only_and_repeats_with_the_seed),
        cmocka_unit_test(board_without_power_is_silent_deaf_and_limp_and_boots_anew),
        cmocka_unit_test(board_that_boots_is_away_for_its_boot_time),
        cmocka_unit_test(hung_board_keeps_its_share_of_the_supply_until_the_watchdog_resets_it),
        cmocka_unit_test(hung_board_boots_for_its_boot_time_and_hangs_once),
        cmocka_unit_test(emergency_stop_opens_the_bridges_of_a_hung_board),
        cmocka_unit_test(hung_board_leaves_the_bridges_of_others_alone),
        cmocka_unit_test(power_cut_ends_a_hang),
        cmocka_unit_test(hung_2foc_brakes),
        cmocka_unit_test(counter_of_an_incremental_encoder_starts_anew_with_the_power),
        cmocka_unit_test(replies_that_wait_are_lost_with_the_power),
        cmocka_unit_test(stuck_board_repeats_its_last_position_at_its_rate),
        cmocka_unit_test(garbage_keeps_identifiers_and_lengths),
        cmocka_unit_test(slow_board_sends_one_frame_of_n),
        cmocka_unit_test(delayed_board_sends_what_was_true_before),
        cmocka_unit_test(intermittent_board_is_gone_for_its_share_but_keeps_running),
        cmocka_unit_test(calibration_takes_out_the_offset_of_an_encoder),
        cmocka_unit_test(neighbors_hear_the_faulty_torque_of_a_strain_board),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
