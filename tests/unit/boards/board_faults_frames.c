/* SPDX-License-Identifier: Apache-2.0 */
/* Faults of boards in the frames that they send. */
#include "tests/unit/boards/fault_bench.h"

CLOSED_BENCH(fault_bench, struct fault_bench, end)

TEST_ON(stuck_board_repeats_its_last_position_at_its_rate, fault_bench, bench)
{
    int32_t last = 0;
    size_t sent = 0;

    begin(bench, "board leg1 stuck 0.05..0.1");
    while (bench->ms < 50) {
        tick(bench);
        last = position(bench) != INT32_MIN ? position(bench) : last;
    }
    while (bench->ms < 100) {
        tick(bench);
        if (position(bench) != INT32_MIN) {
            sent++;
            assert_int_equal(position(bench), last);
        }
    }
    assert_in_range(sent, 12, 13);
    for (int i = 0; i < 4; i++) {
        tick(bench);
        if (position(bench) != INT32_MIN) {
            assert_true(position(bench) > last);
        }
    }
}

TEST_ON(garbage_keeps_identifiers_and_lengths, fault_bench, bench)
{
    int different = 0, sent = 0;

    begin(bench, "board leg1 garbage");
    while (bench->ms < 100) {
        const struct bus_frame *frame;

        tick(bench);
        frame = bench_find(&bench->base, 0, POSITION);
        if (frame) {
            assert_int_equal(frame->len, 8);
            sent++;
            different += get_i32_le(frame->data) != (int32_t)(100 * (bench->ms - 1));
        }
    }
    assert_in_range(sent, 24, 25);
    assert_int_equal(different, sent);
}

TEST_ON(slow_board_sends_one_frame_of_n, fault_bench, bench)
{
    size_t sent = 0;

    begin(bench, "board leg1 slow 5");
    while (bench->ms < 200) {
        tick(bench);
        sent += bench_sent(&bench->base, 0, POSITION);
    }
    assert_int_equal(sent, 10); /* of 50 */
}

TEST(delayed_board_sends_what_was_true_before)
{
    static struct fault_bench bench, sound;
    int32_t history[RUN_MS];
    int compared = 0;

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

TEST_ON(intermittent_board_is_gone_for_its_share_but_keeps_running, fault_bench, bench)
{
    size_t sent = 0;
    const int ticks = 20000;

    begin(bench, "board leg1 intermittent 0.25 dwell=0.01");
    while (bench->ms < ticks) {
        bench->base.sense[0].q = 0.0;
        faults_step(bench->faults, bench->ms++ * MS);
        bench_tick(&bench->base);
        sent += bench_sent(&bench->base, 0, POSITION);
    }
    /* 5000 slots; five standard deviations with gaps of 2.5 slots on average */
    assert_in_range(sent, 5000 * 3 / 4 - 400, 5000 * 3 / 4 + 400);
}

TEST_ON(neighbors_hear_the_faulty_torque_of_a_strain_board, fault_bench, bench)
{
    begin(bench, "board torques off 0.05..");
    bench_send(&bench->base, 0, 0x001, "34 0C 00 00 00 00 00 00");
    bench_send(&bench->base, 0, 0x001, "09 03"); /* torque mode lives on the source */
    run_to(bench, 50);
    assert_true(bench->base.motor[0].bridge_on);
    run_to(bench, 400);
    assert_false(bench->base.motor[0].bridge_on); /* silent for 200 ms: watchdog */
}
