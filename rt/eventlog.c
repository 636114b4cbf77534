/* SPDX-License-Identifier: Apache-2.0 */
/* Rate limiting of log lines. */
#include "rt/eventlog.h"

#include "rt/clock.h"

#include <string.h>

#define WINDOW_MAX_NS (60 * CLOCK_SECOND)

/* prints what was held back */
static void sum_up(struct eventlog *log, const struct eventlog_entry *entry)
{
    if (entry->held == 1) {
        fprintf(log->out, "%s%s\n", log->clear, entry->last);
    } else if (entry->held > 1) {
        fprintf(log->out, "%s... and %llu more like it, the last: %s\n", log->clear,
                (unsigned long long)entry->held, entry->last);
    }
}

/* ends the entry's window; a flood gets another, longer one, in which all is held back */
static void end_window(struct eventlog *log, struct eventlog_entry *entry, int64_t now_ns)
{
    bool flood = entry->held > 0;
    int64_t next = 2 * entry->window_ns;

    sum_up(log, entry);
    entry->held = 0;
    entry->used = flood;
    entry->lines = EVENTLOG_BURST;
    entry->since_ns = now_ns;
    entry->window_ns = next < WINDOW_MAX_NS ? next : WINDOW_MAX_NS;
}

void eventlog_put(struct eventlog *log, int64_t now_ns, uint64_t key, const char *text)
{
    struct eventlog_entry *entry =
        &log->entry[key * UINT64_C(0x9e3779b97f4a7c15) >> 58 & (EVENTLOG_KEYS - 1)];

    if (entry->used && entry->key != key) {
        sum_up(log, entry);
        entry->used = false;
    } else if (entry->used && now_ns - entry->since_ns >= entry->window_ns) {
        end_window(log, entry, now_ns);
    }
    if (!entry->used) {
        *entry = (struct eventlog_entry){
            .used = true, .key = key, .since_ns = now_ns, .window_ns = CLOCK_SECOND};
    }
    if (entry->lines < EVENTLOG_BURST) {
        entry->lines++;
        log->printed++;
        fprintf(log->out, "%s%s\n", log->clear, text);
    } else {
        entry->held++;
        log->held++;
        snprintf(entry->last, sizeof entry->last, "%s", text);
    }
}

void eventlog_flush(struct eventlog *log, int64_t now_ns, bool all)
{
    for (size_t i = 0; i < EVENTLOG_KEYS; i++) {
        struct eventlog_entry *entry = &log->entry[i];

        if (entry->used && (all || now_ns - entry->since_ns >= entry->window_ns)) {
            end_window(log, entry, now_ns);
        }
    }
    fflush(log->out);
}
