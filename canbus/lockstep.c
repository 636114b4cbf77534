/* SPDX-License-Identifier: Apache-2.0 */
/* The simulator's side of lockstep: validates STEP, makes DONE, and times the reports of
 * silence. */
#include "canbus/lockstep.h"

/* Largest interval between reports of silence: one minute. */
#define BACKOFF_MAX_NS INT64_C(60000000000)

void lockstep_init(struct lockstep *lockstep, const struct lockstep_config *config)
{
    *lockstep = (struct lockstep){.config = *config};
}

enum lockstep_verdict lockstep_receive(struct lockstep *lockstep, const struct bus_frame *frame)
{
    uint16_t ticks;

    if (frame->id != lockstep->config.step_id || frame->flags & (FRAME_EXTENDED | FRAME_ERROR)) {
        return LOCKSTEP_OTHER;
    }
    if (frame->flags & FRAME_REMOTE || frame->len != LOCKSTEP_LENGTH) {
        lockstep->counters.malformed++;
        return LOCKSTEP_MALFORMED;
    }
    /* Refuse a STEP whose tick differs from the present tick */
    lockstep->expected = get_u32_le(frame->data);
    if (lockstep->expected != lockstep->tick) {
        lockstep->counters.mismatches++;
        return LOCKSTEP_REFUSED;
    }
    /* 0 ticks mean 1 */
    ticks = get_u16_le(frame->data + 4);
    lockstep->ticks = ticks ? ticks : 1;
    lockstep->counters.steps++;
    return LOCKSTEP_RUN;
}

bool lockstep_advance(struct lockstep *lockstep, uint16_t flags)
{
    lockstep->flags |= flags;
    lockstep->tick++;
    lockstep->ticks--;
    return lockstep->ticks == 0;
}

struct bus_frame lockstep_done(struct lockstep *lockstep, uint16_t more)
{
    uint8_t data[LOCKSTEP_LENGTH];

    put_u32_le(data, lockstep->tick);
    put_u16_le(data + 4, lockstep->flags | more);
    lockstep->flags = 0;
    return frame_make(lockstep->config.done_id, LOCKSTEP_LENGTH, data);
}

void lockstep_wait_begin(struct lockstep *lockstep, int64_t now_ns)
{
    lockstep->wait_since_ns = now_ns;
    lockstep->backoff_ns = lockstep->config.silence_ns;
    lockstep->report_at_ns = now_ns + lockstep->backoff_ns;
    lockstep->silent = false;
}

bool lockstep_wait_check(struct lockstep *lockstep, int64_t now_ns, int64_t *silent_ns)
{
    if (now_ns < lockstep->report_at_ns) {
        return false;
    }
    lockstep->counters.silences += !lockstep->silent;
    lockstep->silent = true;
    lockstep->backoff_ns *= 2;
    if (lockstep->backoff_ns > BACKOFF_MAX_NS) {
        lockstep->backoff_ns = BACKOFF_MAX_NS;
    }
    lockstep->report_at_ns = now_ns + lockstep->backoff_ns;
    *silent_ns = now_ns - lockstep->wait_since_ns;
    return true;
}

bool lockstep_wait_end(struct lockstep *lockstep, int64_t now_ns, int64_t *silent_ns)
{
    *silent_ns = now_ns - lockstep->wait_since_ns;
    return lockstep->silent;
}
