/* SPDX-License-Identifier: Apache-2.0 */
/* Ends of the counts of lockstep; tests/unit/rt/loop_lockstep.c has the rest with the loop. */
#include "canbus/lockstep.h"

#include "tests/test.h"

TEST(a_step_takes_65535_ticks_and_the_count_wraps_around)
{
    const struct lockstep_config config = {.step_id = 0x123, .done_id = 0x124};
    const uint8_t data[LOCKSTEP_LENGTH] = {0xff, 0xff, 0xff, 0xff, 0xff, 0xff};
    const struct bus_frame step = frame_make(config.step_id, sizeof data, data);
    struct lockstep lockstep;
    struct bus_frame done;
    uint32_t run = 1;

    lockstep_init(&lockstep, &config);
    assert_int_equal(lockstep_receive(&lockstep, &step), LOCKSTEP_REFUSED);
    lockstep.tick = UINT32_MAX;
    assert_int_equal(lockstep_receive(&lockstep, &step), LOCKSTEP_RUN);
    while (!lockstep_advance(&lockstep, LOCKSTEP_FAULT)) {
        run++;
    }
    assert_int_equal(run, UINT16_MAX);
    done = lockstep_done(&lockstep, LOCKSTEP_OVERRUN);
    assert_int_equal(done.id, config.done_id);
    assert_int_equal(get_u32_le(done.data), UINT16_MAX - 1);
    assert_int_equal(get_u16_le(done.data + 4), LOCKSTEP_FAULT | LOCKSTEP_OVERRUN);
}
