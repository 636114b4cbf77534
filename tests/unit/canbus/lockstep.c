/* SPDX-License-Identifier: Apache-2.0 */
/* The state machine of lockstep: which STEP runs, what DONE says, when a silence is reported. */
#include "canbus/lockstep.h"

#include "base/array.h"
#include "tests/test.h"

#define MS INT64_C(1000000)

enum { STEP_ID = 0x123, DONE_ID = 0x124, OTHER_ID = 0x125 };

static struct lockstep started(void)
{
    const struct lockstep_config config = {
        .step_id = STEP_ID, .done_id = DONE_ID, .silence_ns = 100 * MS};
    struct lockstep lockstep;

    lockstep_init(&lockstep, &config);
    return lockstep;
}

static struct bus_frame step(uint32_t expected, uint16_t ticks)
{
    uint8_t data[LOCKSTEP_LENGTH];

    put_u32_le(data, expected);
    put_u16_le(data + 4, ticks);
    return frame_make(STEP_ID, sizeof data, data);
}

static enum lockstep_verdict receive(struct lockstep *lockstep, struct bus_frame frame)
{
    return lockstep_receive(lockstep, &frame);
}

/* DONE is a frame of its identifier with these numbers in it. */
static void assert_done(struct lockstep *lockstep, uint16_t more, uint32_t tick, uint16_t flags)
{
    const struct bus_frame done = lockstep_done(lockstep, more);

    assert_int_equal(done.id, DONE_ID);
    assert_int_equal(done.flags, 0);
    assert_int_equal(done.len, LOCKSTEP_LENGTH);
    assert_int_equal(get_u32_le(done.data), tick);
    assert_int_equal(get_u16_le(done.data + 4), flags);
}

/* ---- STEP ---- */

TEST(a_step_that_expects_the_tick_runs)
{
    struct lockstep lockstep = started();

    assert_int_equal(receive(&lockstep, step(0, 3)), LOCKSTEP_RUN);
    assert_int_equal(lockstep.ticks, 3);
    assert_false(lockstep_advance(&lockstep, 0));
    assert_false(lockstep_advance(&lockstep, 0));
    assert_true(lockstep_advance(&lockstep, 0));
    assert_int_equal(receive(&lockstep, step(3, 1)), LOCKSTEP_RUN);
    assert_true(lockstep_advance(&lockstep, 0));
    assert_int_equal(lockstep.tick, 4);
    assert_int_equal(lockstep.counters.steps, 2);
}

TEST(zero_ticks_are_one)
{
    struct lockstep lockstep = started();

    assert_int_equal(receive(&lockstep, step(0, 0)), LOCKSTEP_RUN);
    assert_true(lockstep_advance(&lockstep, 0));
    assert_int_equal(lockstep.tick, 1);
}

TEST(a_step_takes_up_to_65535_ticks)
{
    struct lockstep lockstep = started();
    uint32_t run = 1;

    assert_int_equal(receive(&lockstep, step(0, UINT16_MAX)), LOCKSTEP_RUN);
    while (!lockstep_advance(&lockstep, 0)) {
        run++;
    }
    assert_int_equal(run, UINT16_MAX);
}

TEST(a_step_that_expects_another_tick_is_refused_and_told_the_true_one)
{
    struct lockstep lockstep = started();

    assert_int_equal(receive(&lockstep, step(0, 2)), LOCKSTEP_RUN);
    lockstep_advance(&lockstep, 0);
    lockstep_advance(&lockstep, 0);
    assert_int_equal(receive(&lockstep, step(7, 1)), LOCKSTEP_REFUSED);
    assert_int_equal(lockstep.expected, 7);
    assert_int_equal(lockstep.tick, 2);
    assert_int_equal(lockstep.counters.mismatches, 1);
    assert_int_equal(lockstep.counters.steps, 1);
    assert_done(&lockstep, LOCKSTEP_MISMATCH, 2, LOCKSTEP_MISMATCH);

    /* With the count from the answer the host goes on */
    assert_int_equal(receive(&lockstep, step(2, 1)), LOCKSTEP_RUN);
}

TEST(the_count_of_ticks_wraps_around)
{
    struct lockstep lockstep = started();

    lockstep.tick = UINT32_MAX;
    assert_int_equal(receive(&lockstep, step(UINT32_MAX, 1)), LOCKSTEP_RUN);
    assert_true(lockstep_advance(&lockstep, 0));
    assert_done(&lockstep, 0, 0, 0);
    assert_int_equal(receive(&lockstep, step(0, 1)), LOCKSTEP_RUN);
}

TEST(a_step_of_another_form_is_malformed)
{
    static const struct {
        uint8_t flags, len;
    } forms[] = {{0, 0}, {0, 5}, {0, 7}, {0, 8}, {FRAME_REMOTE, 6}, {FRAME_FD, 12}};
    struct lockstep lockstep = started();

    for (size_t i = 0; i < ARRAY_COUNT(forms); i++) {
        struct bus_frame frame = step(0, 1);

        frame.flags = forms[i].flags;
        frame.len = forms[i].len;
        assert_int_equal(receive(&lockstep, frame), LOCKSTEP_MALFORMED);
    }
    assert_int_equal(lockstep.counters.malformed, ARRAY_COUNT(forms));
    assert_int_equal(lockstep.counters.steps, 0);
    assert_int_equal(lockstep.counters.mismatches, 0);
    assert_int_equal(lockstep.tick, 0);
}

TEST(frames_of_other_identifiers_are_no_step)
{
    struct lockstep lockstep = started();
    struct bus_frame frame = step(0, 1);

    frame.id = OTHER_ID;
    assert_int_equal(receive(&lockstep, frame), LOCKSTEP_OTHER);
    frame.id = DONE_ID;
    assert_int_equal(receive(&lockstep, frame), LOCKSTEP_OTHER);

    /* The same number with 29 bits, or as the class of an error frame, is another identifier */
    frame = step(0, 1);
    frame.flags = FRAME_EXTENDED;
    assert_int_equal(receive(&lockstep, frame), LOCKSTEP_OTHER);
    frame.flags = FRAME_ERROR;
    assert_int_equal(receive(&lockstep, frame), LOCKSTEP_OTHER);
    assert_int_equal(lockstep.counters.malformed, 0);
}

/* ---- DONE ---- */

TEST(done_carries_the_flags_of_all_ticks_since_the_last_one)
{
    struct lockstep lockstep = started();

    assert_int_equal(receive(&lockstep, step(0, 3)), LOCKSTEP_RUN);
    lockstep_advance(&lockstep, LOCKSTEP_OVERRUN);
    lockstep_advance(&lockstep, 0);
    lockstep_advance(&lockstep, LOCKSTEP_FAULT);
    assert_done(&lockstep, 0, 3, LOCKSTEP_OVERRUN | LOCKSTEP_FAULT);

    /* Told once */
    assert_int_equal(receive(&lockstep, step(3, 1)), LOCKSTEP_RUN);
    lockstep_advance(&lockstep, 0);
    assert_done(&lockstep, 0, 4, 0);
}

TEST(gathered_flags_are_told_once)
{
    struct lockstep lockstep = started();

    assert_int_equal(receive(&lockstep, step(0, 2)), LOCKSTEP_RUN);
    lockstep_advance(&lockstep, LOCKSTEP_FAULT);
    assert_done(&lockstep, LOCKSTEP_STOPPING, 1, LOCKSTEP_FAULT | LOCKSTEP_STOPPING);
    assert_done(&lockstep, LOCKSTEP_STOPPING, 1, LOCKSTEP_STOPPING);
}

/* ---- silence ---- */

TEST(a_silence_is_reported_at_growing_intervals_up_to_a_minute)
{
    /* After the start of the wait, in ms: intervals of 100, 200, 400 ... 51,200, then 60,000 */
    static const int64_t reports[] = {100,   300,   700,   1500,   3100,   6300,
                                      12700, 25500, 51100, 102300, 162300, 222300};
    struct lockstep lockstep = started();
    const int64_t begin = 5000 * MS;
    size_t next = 0;

    lockstep_wait_begin(&lockstep, begin);
    for (int64_t ms = 0; ms <= 222300; ms += 50) {
        int64_t silent_ns = -1;
        const bool report = lockstep_wait_check(&lockstep, begin + ms * MS, &silent_ns);

        assert_true(report == (next < ARRAY_COUNT(reports) && ms == reports[next]));
        if (report) {
            assert_true(silent_ns == ms * MS);
            next++;
        }
    }
    assert_int_equal(next, ARRAY_COUNT(reports));
    assert_int_equal(lockstep.counters.silences, 1);
}

TEST(a_check_that_comes_late_reports_once)
{
    struct lockstep lockstep = started();
    int64_t silent_ns;

    lockstep_wait_begin(&lockstep, 0);
    assert_true(lockstep_wait_check(&lockstep, 5000 * MS, &silent_ns));
    assert_true(silent_ns == 5000 * MS);
    assert_false(lockstep_wait_check(&lockstep, 5199 * MS, &silent_ns));
    assert_true(lockstep_wait_check(&lockstep, 5200 * MS, &silent_ns));
}

TEST(the_end_of_a_silence_is_told_if_it_was_reported)
{
    struct lockstep lockstep = started();
    int64_t silent_ns;

    lockstep_wait_begin(&lockstep, 0);
    assert_false(lockstep_wait_check(&lockstep, 99 * MS, &silent_ns));
    assert_false(lockstep_wait_end(&lockstep, 99 * MS, &silent_ns));
    lockstep_wait_begin(&lockstep, 1000 * MS);
    assert_true(lockstep_wait_check(&lockstep, 1100 * MS, &silent_ns));
    assert_true(lockstep_wait_end(&lockstep, 1150 * MS, &silent_ns));
    assert_true(silent_ns == 150 * MS);

    /* The next wait begins anew */
    lockstep_wait_begin(&lockstep, 2000 * MS);
    assert_false(lockstep_wait_check(&lockstep, 2099 * MS, &silent_ns));
    assert_true(lockstep_wait_check(&lockstep, 2100 * MS, &silent_ns));
    assert_int_equal(lockstep.counters.silences, 2);
}
