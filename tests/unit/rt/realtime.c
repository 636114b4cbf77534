/* SPDX-License-Identifier: Apache-2.0 */
/* Asking for real-time service: what is not given is said once, with what would help, and nothing
 * is asked for that was not wanted. In children of their own, for the effects last. */
#include "rt/realtime.h"
#include "tests/test.h"

#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

enum { NOBODY = 65534 };

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { SANITIZED = true };
#else
enum { SANITIZED = false };
#endif

/* Runs the check in a child; true when it returned true there */
static bool in_child(bool (*check)(void))
{
    pid_t child = fork();
    int status = 1;

    assert_true(child >= 0);
    if (child == 0) {
        _exit(check() ? 0 : 1);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

static bool nothing(void)
{
    struct realtime_config config = {0, false, -1};
    struct realtime_report report;

    realtime_apply(&config, &report);
    return report.count == 0 && !report.fifo && !report.locked && !report.pinned &&
           sched_getscheduler(0) == SCHED_OTHER;
}

TEST(nothing_wanted_is_nothing_done)
{
    assert_true(in_child(nothing));
}

/* Without the right to it */
static bool forbidden(void)
{
    struct realtime_config config = {80, true, 100000};
    struct rlimit none = {0, 0};
    struct realtime_report report;

    if (setrlimit(RLIMIT_RTPRIO, &none) || setrlimit(RLIMIT_MEMLOCK, &none) || setuid(NOBODY)) {
        return false;
    }
    realtime_apply(&config, &report);
    return report.count == 3 && !report.fifo && !report.locked && !report.pinned &&
           strstr(report.warning[0], "processor 100000") &&
           strstr(report.warning[1], "memlock unlimited") &&
           strstr(report.warning[2], "rtprio 80") && sched_getscheduler(0) == SCHED_OTHER;
}

TEST(each_refusal_is_one_warning_that_says_what_helps)
{
    if (getuid() != 0) {
        print_message("SKIP: needs root to give up its rights\n");
        skip();
    }
    if (SANITIZED) {
        print_message("SKIP: the sanitizers answer mlockall themselves\n");
        skip();
    }
    assert_true(in_child(forbidden));
}

static bool pinned(void)
{
    struct realtime_config config = {0, false, 0};
    struct realtime_report report;
    cpu_set_t set;

    realtime_apply(&config, &report);
    return report.pinned && report.count == 0 && sched_getaffinity(0, sizeof set, &set) == 0 &&
           CPU_COUNT(&set) == 1 && CPU_ISSET(0, &set);
}

TEST(a_processor_of_its_own_is_taken)
{
    cpu_set_t set;

    if (sched_getaffinity(0, sizeof set, &set) || !CPU_ISSET(0, &set)) {
        print_message("SKIP: this process may not run on processor 0\n");
        skip();
    }
    assert_true(in_child(pinned));
}

/* kB of this process that are locked, from /proc; -1 = unknown. */
static long locked_kb(void)
{
    FILE *status = fopen("/proc/self/status", "r");
    long kb = -1;
    char line[256];

    while (status && fgets(line, sizeof line, status)) {
        sscanf(line, "VmLck: %ld", &kb);
    }
    if (status) {
        fclose(status);
    }
    return kb;
}

/* Whatever this machine gives: the report says what the kernel says, and warns of the rest. */
static bool as_the_kernel_says(void)
{
    struct realtime_config config = {3, true, -1};
    struct realtime_report report;
    struct sched_param param;
    size_t refused;
    bool fifo;

    realtime_apply(&config, &report);
    fifo = (sched_getscheduler(0) & ~SCHED_RESET_ON_FORK) == SCHED_FIFO;
    refused = (size_t)(!report.fifo || access("/sys/kernel/realtime", F_OK) != 0) +
              (size_t)!report.locked;
    return report.fifo == fifo &&
           (!fifo || (!sched_getparam(0, &param) && param.sched_priority == 3)) &&
           report.locked == (locked_kb() > 0) && !report.pinned && report.count == refused;
}

TEST(the_report_says_what_the_kernel_says)
{
    if (SANITIZED) {
        print_message("SKIP: the sanitizers answer mlockall themselves\n");
        skip();
    }
    assert_true(in_child(as_the_kernel_says));
}
