/* SPDX-License-Identifier: Apache-2.0 */
/* Page faults of the loop's thread by phase, from getrusage. `perf record -e page-faults -d` says
 * where they are. */
#include "guard.h"

#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/syscall.h>

static uint64_t count[GUARD_PHASES], before;
static bool forbidden;

static uint64_t faults(void)
{
    struct rusage usage;

    guard_syscall(SYS_getrusage, RUSAGE_THREAD, (long)&usage, 0, 0, 0, 0);
    return (uint64_t)(usage.ru_minflt + usage.ru_majflt);
}

void guard_watch_faults(void)
{
    const char *mode = getenv("RT_GUARD_FAULTS");

    forbidden = mode && !strcmp(mode, "forbid");
    /* What the guard itself touches in the loop for the first time */
    memset(count, 0, sizeof count);
    before = faults();
}

void guard_count_faults(int phase)
{
    uint64_t now = faults(), found = now - before;

    before = now;
    count[phase] += found;
    if (found && forbidden) {
        guard_state.phase = phase;
        guard_violation("%llu page faults", (unsigned long long)found);
    }
}

void guard_report_faults(void)
{
    guard_print("rt guard: %-16s", "page faults");
    for (int p = 0; p < GUARD_PHASES; p++) {
        guard_print("%9llu", (unsigned long long)count[p]);
    }
    guard_print("\n");
}
