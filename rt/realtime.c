/* SPDX-License-Identifier: Apache-2.0 */
/* Applies SCHED_FIFO, mlockall, processor affinity and the idle-state limit to the calling
 * thread. */
#include "rt/realtime.h"

#include <errno.h>
#include <fcntl.h>
#include <link.h>
#include <sched.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

/* Bytes of stack to touch in advance; the loop uses less. */
enum { STACK_TOUCHED = 256 * 1024 };

/* Adds a warning to the report, if there is room. */
__attribute__((format(printf, 2, 3))) static void realtime_warn(struct realtime_report *report,
                                                                const char *format, ...)
{
    va_list args;

    if (report->count < REALTIME_WARNINGS_MAX) {
        va_start(args, format);
        vsnprintf(report->warning[report->count++], sizeof report->warning[0], format, args);
        va_end(args);
    }
}

/* Binds the thread to one processor, or warns that it may run on any. */
static void realtime_pin_processor(int cpu, struct realtime_report *report)
{
    cpu_set_t set;

    CPU_ZERO(&set);
    if (cpu < CPU_SETSIZE) {
        CPU_SET((size_t)cpu, &set);
    }
    if (cpu < CPU_SETSIZE && sched_setaffinity(0, sizeof set, &set) == 0) {
        report->pinned = true;
    } else {
        realtime_warn(
            report, "cannot stay on processor %d (%s): runs on any; there are %ld, numbered from 0",
            cpu, cpu < CPU_SETSIZE ? strerror(errno) : "no such number",
            sysconf(_SC_NPROCESSORS_ONLN));
    }
}

/* Sets SCHED_FIFO, or warns and names the limit that forbids it. */
static void realtime_set_priority(int priority, struct realtime_report *report)
{
    struct sched_param param = {.sched_priority = priority};
    struct rlimit limit = {0};

    if (sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &param) == 0) {
        report->fifo = true;
        if (access("/sys/kernel/realtime", F_OK)) {
            realtime_warn(report, "this kernel is not a real-time (PREEMPT_RT) one: wake-ups may "
                                  "be late by milliseconds; see the wake-up line of the summary");
        }
        return;
    }
    if (errno == EPERM) {
        getrlimit(RLIMIT_RTPRIO, &limit);
        realtime_warn(
            report,
            "no permission for SCHED_FIFO priority %d (RLIMIT_RTPRIO is %llu): runs as a normal "
            "thread; allow it with 'rtprio %d' in /etc/security/limits.d or CAP_SYS_NICE",
            priority, (unsigned long long)limit.rlim_cur, priority);
    } else {
        realtime_warn(report, "cannot set SCHED_FIFO priority %d: %s: runs as a normal thread",
                      priority, strerror(errno));
    }
}

/* Locks all present and future memory, or warns and names the limit that forbids it. */
static void realtime_lock_memory(struct realtime_report *report)
{
    struct rlimit limit = {0};

    /* Lock pages when they are touched, because the arena reserves far more address space than it
     * uses */
    if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0) {
        report->locked = true;
        return;
    }
    getrlimit(RLIMIT_MEMLOCK, &limit);
    realtime_warn(report,
                  "cannot lock memory (%s; RLIMIT_MEMLOCK is %llu kB): pages may be swapped out; "
                  "allow it with 'memlock unlimited' in /etc/security/limits.d or CAP_IPC_LOCK",
                  strerror(errno), (unsigned long long)limit.rlim_cur / 1024);
}

/* Keeps processors out of deep idle states. The kernel honors the limit while the file is open,
 * that is until the process ends. The threads of the loop and of the task may call this
 * concurrently. */
static void realtime_avoid_idle_states(struct realtime_report *report)
{
    static _Atomic int shared = -1;
    int32_t latency_us = 0;
    int descriptor = atomic_load(&shared), none = -1;

    if (descriptor < 0) {
        descriptor = open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
        if (descriptor >= 0 && !atomic_compare_exchange_strong(&shared, &none, descriptor)) {
            close(descriptor);
            descriptor = none;
        }
    }
    report->awake = descriptor >= 0 &&
                    write(descriptor, &latency_us, sizeof latency_us) == (ssize_t)sizeof latency_us;
}

/* Touches the thread's stack, so that the loop's use of it causes no page fault. */
__attribute__((noinline)) static void realtime_touch_stack(void)
{
    volatile unsigned char stack[STACK_TOUCHED];

    for (size_t i = 0; i < sizeof stack; i += 1024) {
        stack[i] = 0;
    }
}

/* Maps all pages of a range with one call; on kernels before 5.14, reads each page. The reads
 * include the padding between variables, so sanitizers are off. */
__attribute__((no_sanitize("address", "thread"))) static void
realtime_touch_pages(uintptr_t begin, uintptr_t end, size_t page)
{
    if (madvise((void *)begin, end - begin, MADV_POPULATE_READ) == 0) {
        return;
    }
    for (uintptr_t at = begin; at < end; at += page) {
        (void)*(const volatile unsigned char *)at;
    }
}

/* Maps the readable segments of the program or of a library. Callback of dl_iterate_phdr. */
static int realtime_touch_object(struct dl_phdr_info *info, size_t size, void *context)
{
    const size_t *page = context;
    uintptr_t constant = 0; /* end of the range that is read-only after relocation */

    (void)size;
    /* Find the range that is read-only after relocation: it must not be written */
    for (int i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *part = &info->dlpi_phdr[i];

        if (part->p_type == PT_GNU_RELRO) {
            constant = info->dlpi_addr + part->p_vaddr + part->p_memsz;
        }
    }
    for (int i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *part = &info->dlpi_phdr[i];
        uintptr_t begin = (info->dlpi_addr + part->p_vaddr) / *page * *page;
        uintptr_t end = info->dlpi_addr + part->p_vaddr + part->p_memsz;

        if (part->p_type != PT_LOAD || !(part->p_flags & PF_R)) {
            continue;
        }
        realtime_touch_pages(begin, end, *page);
        if (part->p_flags & PF_W) {
            begin = constant > begin ? constant / *page * *page : begin;
            /* Copy private pages now instead of at the first write; kernels before 5.14 refuse
             * this */
            madvise((void *)begin, end > begin ? end - begin : 0, MADV_POPULATE_WRITE);
        }
    }
    return 0;
}

void realtime_touch(void)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE);

    dl_iterate_phdr(realtime_touch_object, &page);
    realtime_touch_stack();
}

void realtime_apply(const struct realtime_config *config, struct realtime_report *report)
{
    memset(report, 0, sizeof *report);
    /* The sleeps of a normal thread end up to 50 us late unless it asks for less */
    prctl(PR_SET_TIMERSLACK, 1ul);
    if (config->cpu >= 0) {
        realtime_pin_processor(config->cpu, report);
    }
    if (config->lock_memory) {
        realtime_lock_memory(report);
    }
    if (config->priority > 0) {
        realtime_set_priority(config->priority, report);
        realtime_avoid_idle_states(report);
    }
    realtime_touch_stack();
}
