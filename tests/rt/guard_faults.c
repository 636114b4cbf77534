/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Page faults of the loop's thread by phase, from getrusage. Where the kernel allows it a counter
 * of perf_event keeps the address and the instruction of the last ones.
 */
#include "guard.h"

#include <linux/perf_event.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

static uint64_t count[GUARD_PHASES], before;
static bool forbidden;
static struct perf_event_mmap_page *ring;

static uint64_t faults(void)
{
    struct rusage usage;

    guard_syscall(SYS_getrusage, RUSAGE_THREAD, (long)&usage, 0, 0, 0, 0);
    return (uint64_t)(usage.ru_minflt + usage.ru_majflt);
}

static void open_ring(void)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    struct perf_event_attr wanted = {
        .type = PERF_TYPE_SOFTWARE,
        .size = sizeof wanted,
        .config = PERF_COUNT_SW_PAGE_FAULTS,
        .sample_period = 1,
        .sample_type = PERF_SAMPLE_IP | PERF_SAMPLE_ADDR,
    };
    long descriptor =
        guard_syscall(SYS_perf_event_open, (long)&wanted, 0, -1, -1, PERF_FLAG_FD_CLOEXEC, 0);
    void *memory;

    if (descriptor < 0) {
        return;
    }
    memory =
        mmap(NULL, 9 * page, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, (int)descriptor, 0);
    ring = memory == MAP_FAILED ? NULL : memory;
}

void guard_watch_faults(void)
{
    const char *mode = getenv("RT_GUARD_FAULTS");

    forbidden = mode && !strcmp(mode, "forbid");
    if (!ring) {
        open_ring();
    }
    /* What the guard itself touches in the loop for the first time */
    memset(count, 0, sizeof count);
    if (ring) {
        ring->data_tail = ring->data_head;
    }
    before = faults();
}

/* The faults that the ring has kept */
static void print_ring(void)
{
    const unsigned char *data = (const unsigned char *)ring + ring->data_offset;

    const uint64_t head = ring->data_head; /* printing may add some */

    while (ring->data_tail + 24 <= head) {
        struct {
            struct perf_event_header header;
            uint64_t instruction, address;
        } sample;
        char address[128], instruction[128];

        for (size_t i = 0; i < sizeof sample; i++) {
            ((unsigned char *)&sample)[i] = data[(ring->data_tail + i) % ring->data_size];
        }
        ring->data_tail += sample.header.size;
        guard_place(sample.address, address, sizeof address);
        guard_place(sample.instruction, instruction, sizeof instruction);
        guard_print("rt guard: page fault at %s by %s\n", address, instruction);
    }
}

void guard_count_faults(int phase)
{
    uint64_t now = faults(), found = now - before;

    before = now;
    count[phase] += found;
    if (found && ring) {
        bool inside = guard_state.inside;

        guard_state.inside = false;
        print_ring();
        guard_state.inside = inside;
        before = faults();
    }
    if (ring) {
        ring->data_tail = ring->data_head;
    }
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
