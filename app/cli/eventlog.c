/* SPDX-License-Identifier: Apache-2.0 */
/* Limits the rate of log lines. */
#include "app/cli/cli.h"

/* Longest window for the summary of a flood. */
#define WINDOW_MAX_NS (60 * CLOCK_SECOND)

static const char *eventlog_prefix(const struct eventlog *log, uint64_t key)
{
    return log->prefix ? log->prefix(key) : "";
}

/* Ends the entry's window. During a flood it starts another window of twice the length, and
 * suppresses all lines in it. */
static void eventlog_end_window(struct eventlog *log, struct eventlog_entry *entry, int64_t now_ns)
{
    bool flood = entry->held > 0;
    int64_t next = 2 * entry->window_ns;

    if (entry->held == 1) {
        fprintf(log->out, "%s%s%s\n", log->clear, eventlog_prefix(log, entry->key), entry->last);
    } else if (entry->held > 1) {
        fprintf(log->out, "%s%s... and %llu more like it%s, the last: %s\n", log->clear,
                eventlog_prefix(log, entry->key), (unsigned long long)entry->held,
                log->where ? log->where : "", entry->last);
    }
    entry->held = 0;
    entry->used = flood;
    entry->lines = EVENTLOG_BURST;
    entry->since_ns = now_ns;
    entry->window_ns = next < WINDOW_MAX_NS ? next : WINDOW_MAX_NS;
}

/* Returns the entry of a key, else a free entry, else the shared entry. */
static struct eventlog_entry *eventlog_entry_of(struct eventlog *log, uint64_t key)
{
    struct eventlog_entry *shared = &log->entry[EVENTLOG_KEYS], *place = NULL;

    for (size_t i = 0; i < EVENTLOG_KEYS; i++) {
        struct eventlog_entry *entry = &log->entry[i];

        if (entry->used && entry->key == key) {
            return entry;
        }
        if (!entry->used && !place) {
            place = entry;
        }
    }
    return place ? place : shared;
}

void eventlog_put(struct eventlog *log, int64_t now_ns, uint64_t key, const char *text)
{
    struct eventlog_entry *entry = eventlog_entry_of(log, key);

    if (entry->used && now_ns - entry->since_ns >= entry->window_ns) {
        eventlog_end_window(log, entry, now_ns);
    }
    if (!entry->used) {
        *entry = (struct eventlog_entry){
            .used = true, .key = key, .since_ns = now_ns, .window_ns = CLOCK_SECOND};
    }

    /* Prints the first lines of a window, and counts the others */
    if (entry->lines < EVENTLOG_BURST) {
        entry->lines++;
        log->printed++;
        fprintf(log->out, "%s%s%s\n", log->clear, eventlog_prefix(log, key), text);
    } else {
        entry->held++;
        log->held++;
        snprintf(entry->last, sizeof entry->last, "%s", text);
    }
}

void eventlog_flush(struct eventlog *log, int64_t now_ns, bool all)
{
    for (size_t i = 0; i <= EVENTLOG_KEYS; i++) {
        struct eventlog_entry *entry = &log->entry[i];

        if (entry->used && (all || now_ns - entry->since_ns >= entry->window_ns)) {
            eventlog_end_window(log, entry, now_ns);
        }
    }
    fflush(log->out);
}
