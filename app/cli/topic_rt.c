/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil help rt: how the loop keeps real time, and how to see whether it does. */
#include "base/options.h"
#include "rt/phase_budget.h"
#include "app/cli/topics.h"

#include <inttypes.h>

enum { TICK_INSTRUCTIONS = 1000000, NAME_COLUMN = 12 };

static const char about[] =
    "Real time in coman-hil: what a tick does, what it may cost, how to see what it costs.\n\n"
    "One thread runs the loop, phase by phase. From its first tick to its last it allocates "
    "nothing, "
    "takes no lock, prints nothing and has no page fault; the recorder, the gateway, the control "
    "socket, a task and the log each have a thread of their own and meet the loop in rings that "
    "neither side waits for. (Of a recording in lockstep and free run nothing may be lost: there "
    "the "
    "loop waits for a recorder that has fallen behind. A task runs in the loop's thread there.) "
    "All "
    "memory comes from one arena that is sized and touched before the first tick, together with "
    "the "
    "program's code and the thread's stack; the program is linked so that no function is looked up "
    "at its first call. In the loop the kernel is asked for this and nothing else: clock_nanosleep "
    "and ppoll in wait, recvmmsg in wait and receive, sendmmsg in transmit, getsockopt when a "
    "socket "
    "ran over or its interface came back, and read and write on event descriptors to wake a reader "
    "of local buses that sleeps and to be woken. A test has the unchanged program watched by a "
    "guard "
    "that ends it when it does anything else.\n\n"
    "The phases of a tick:\n";

static const char table_about[] =
    "\nThe budget of a tick. Instructions: what COMAN's squat may cost on its five buses in wire "
    "mode, the mean of a tick, x86-64. Share: of a tick of 1 ms at one instruction in a "
    "nanosecond; "
    "most machines do two to four. Measured: median and 99th percentile in microseconds, in real "
    "time on a virtual machine of two cores with other load, and the share of the latter.\n";

static const char reading[] =
    "\nReading the summary of a run. Every phase has a histogram: p50, p99 and max in "
    "microseconds, "
    "the mean, and the share of the tick. A percentile is at most 1/64 too high. wait is the time "
    "slept, tick the sum of the others. wake-up is how late the kernel woke the loop: when its "
    "maximum is large and those of the phases are not, the machine is at fault, and doctor says "
    "what to change. A phase whose p99 is far above its p50 while wake-up is small was "
    "interrupted: "
    "look for another FIFO thread, interrupts on this processor, or the clock frequency. page "
    "faults "
    "in the loop must be 0. summary.json of a recording has the same numbers.\n\n"
    "Overruns. A tick that ends after the next deadline and took longer than the tick is an "
    "overrun, "
    "charged to the phase that took longest; wait when it was the late wake-up. skip, the default, "
    "drops the deadlines that have passed: the controller sees a gap, virtual time falls behind "
    "the "
    "wall clock by it. slip runs late ticks back to back until the grid is caught up: no time is "
    "lost, but for a while telemetry comes faster. stop ends the run at the stop_after-th: for "
    "tests "
    "that are void after one. More than a second behind (a stopped process, a suspended machine) "
    "is "
    "taken for a pause under every policy, and the grid is taken up again.\n\n"
    "Probes. The program has static tracepoints (USDT, provider coman_hil), one nop each when "
    "nobody "
    "watches:\n\n"
    "  run_begin(clock, tick_ns)      tick_begin(tick, time_ns)\n"
    "  phase_end(phase, ns)           tick_end(tick, work_ns)\n"
    "  received(bus, frames)          sent(bus, frames, accepted)\n"
    "  overrun(phase, ns)             run_end(end, ticks)\n\n"
    "phase is 0 for wait to 6 for publish. A histogram of each phase while it runs, and each "
    "overrun "
    "with its time:\n\n"
    "  bpftrace -p PID -e 'usdt:*:coman_hil:phase_end { @[arg0] = hist(arg1); }'\n"
    "  bpftrace -p PID -e 'usdt:*:coman_hil:overrun\n"
    "    { time(\"%H:%M:%S \"); printf(\"phase %d, %d ns late\\n\", arg0, arg1); }'\n\n"
    "With perf, to see what else the kernel did between two phases:\n\n"
    "  perf buildid-cache --add $(command -v coman-hil)\n"
    "  perf probe --add 'sdt_coman_hil:*'\n"
    "  perf record -a -e 'sdt_coman_hil:*' -e 'sched:sched_switch' -- sleep 5\n\n"
    "See also: coman-hil doctor RIG, coman-hil run --help.";

static void print_phases(FILE *out)
{
    for (int p = 0; p < PHASE_COUNT; p++) {
        fprintf(out, "  %-10s", loop_phase_name((enum loop_phase)p));
        options_wrap(phase_budgets[p].does, NAME_COLUMN, NAME_COLUMN, out);
    }
}

static void print_budget(FILE *out)
{
    uint32_t sum = 0;

    fprintf(out, "  %-10s%14s%9s%12s%9s%9s\n", "phase", "instructions", "share", "measured", "99 %",
            "share");
    for (int p = PHASE_RECEIVE; p < PHASE_COUNT; p++) {
        const struct phase_budget *budget = &phase_budgets[p];

        fprintf(out, "  %-10s%14" PRIu32 "%7.2f %%%12.1f%9.1f%7.2f %%\n",
                loop_phase_name((enum loop_phase)p), budget->instructions,
                100.0 * budget->instructions / TICK_INSTRUCTIONS, budget->typical_us,
                budget->worst_us, 0.1 * budget->worst_us);
        sum += budget->instructions;
    }
    fprintf(out, "  %-10s%14" PRIu32 "%7.2f %%\n", "sum", sum, 100.0 * sum / TICK_INSTRUCTIONS);
}

void topic_rt(FILE *out)
{
    options_wrap(about, 0, 0, out);
    print_phases(out);
    options_wrap(table_about, 0, 0, out);
    print_budget(out);
    options_wrap(reading, 0, 0, out);
}
