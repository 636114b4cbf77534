/* SPDX-License-Identifier: Apache-2.0 */
/* Counts the deadlines of the real clock (met, missed, dropped), and charges overruns to phases.
 * rt/loop.h states the rules. */
#include "rt/loop_private.h"
#include "rt/probes.h"

/* Returns how many deadlines have passed at now_ns, not counting one at now_ns itself. */
static uint64_t overrun_missed_deadlines(const struct loop *loop, int64_t now_ns)
{
    int64_t behind = now_ns - loop->deadline_ns;

    return (uint64_t)((behind + loop->period_ns - 1) / loop->period_ns);
}

/* Skips deadlines of the grid. */
static void overrun_drop_deadlines(struct loop *loop, uint64_t count)
{
    loop->deadline_ns += (int64_t)count * loop->period_ns;
}

void overrun_skip_pause(struct loop *loop, int64_t now_ns)
{
    uint64_t missed = overrun_missed_deadlines(loop, now_ns);

    loop_emit_event(loop, LOOP_EVENT_PAUSE, -1, now_ns - loop->deadline_ns, 0);
    overrun_drop_deadlines(loop, missed);
    loop->stats.pauses++;
    loop->stats.pause_ticks += missed;
}

/* Charges an overrun to the phase that took longest, and ends the run if the policy requires it. */
static void overrun_charge_phase(struct loop *loop, int64_t over_ns)
{
    int worst = 0;

    for (int p = 1; p < PHASE_COUNT; p++) {
        worst = loop->spent[p] > loop->spent[worst] ? p : worst;
    }
    loop->stats.overruns[worst]++;
    loop->stats.overrun_total++;
    PROBE2(overrun, worst, over_ns);
    loop_emit_event(loop, LOOP_EVENT_OVERRUN, -1, worst, over_ns);
    if (loop->config.overrun == LOOP_OVERRUN_STOP &&
        loop->stats.overrun_total >= (uint64_t)loop->config.stop_after) {
        loop->end = LOOP_END_OVERRUNS;
    }
}

void overrun_account_tick(struct loop *loop, int64_t now_ns)
{
    loop->last_end_ns = now_ns;
    loop->deadline_ns += loop->period_ns;

    /* In time, or no grid of deadlines (speed 0) */
    if (now_ns <= loop->deadline_ns || loop->period_ns == 0) {
        return;
    }

    /* The process must have been stopped, because the delay is so long: count a pause, not an
     * overrun */
    if (now_ns - loop->deadline_ns > LOOP_PAUSE_NS) {
        overrun_skip_pause(loop, now_ns);
        return;
    }

    /* An overrun if this tick took too long; late if only an earlier tick did */
    if (now_ns - loop->reference_ns > loop->period_ns) {
        overrun_charge_phase(loop, now_ns - loop->deadline_ns);
    } else {
        loop->stats.late_ticks++;
    }

    /* All policies but slip drop the deadlines that have passed */
    if (loop->config.overrun != LOOP_OVERRUN_SLIP) {
        uint64_t missed = overrun_missed_deadlines(loop, now_ns);

        overrun_drop_deadlines(loop, missed);
        loop->stats.lost_ticks += missed;
    }
}

void overrun_pace_tick(struct loop *loop, int64_t now_ns)
{
    loop->last_end_ns = now_ns;
    loop->deadline_ns += loop->period_ns;
    loop->deadline_ns = loop->deadline_ns > now_ns ? loop->deadline_ns : now_ns;
}
