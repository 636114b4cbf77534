/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The guard: a library for LD_PRELOAD that watches the loop of an unchanged coman-hil and aborts it
 * with a message, the phase, the tick and a backtrace when the loop's thread does what a real-time
 * loop may not. Linux on x86-64 only.
 *
 *   guard_probes.c    knows where the loop is from the program's own tracepoints (rt/probes.h):
 *   each
 *                     is a nop that the guard replaces by a breakpoint. The program needs no hook.
 *   guard_calls.c     every function that the program imports and that is not on a list of harmless
 *                     ones goes over a guarded doorstep: allocation, locks, printing, files, ...
 *   guard_syscalls.c  every system call of the loop's thread goes over a seccomp trap, is held
 *   against
 *                     a table of what is allowed in which phase and on which kind of descriptor,
 *                     and is counted.
 *   guard_faults.c    counts page faults.
 *   guard.c           keeps the state, reports.
 *
 * Environment: RT_GUARD_LOG, a file for the message or the table (standard error when unset);
 * RT_GUARD_FAULTS=forbid makes a page fault a violation too.
 */
#ifndef TESTS_RT_GUARD_H
#define TESTS_RT_GUARD_H

#include <elf.h>
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <ucontext.h>

enum { GUARD_PHASES = 7 }; /* enum loop_phase of rt/loop.h */

/* Of the loop's thread, which alone writes it. */
struct guard_state {
    bool inside; /* between run_begin and run_end */
    int phase;
    int64_t clock, tick;
    uint64_t runs, ticks, probes;
};

extern struct guard_state guard_state;

/* Whether the calling thread is the loop's and inside a run. */
bool guard_inside(void);

/* Ends the process: what was done and a backtrace. */
void __attribute__((noreturn, format(printf, 1, 2))) guard_violation(const char *format, ...);

/* For what goes wrong with the guard itself. */
void __attribute__((noreturn, format(printf, 1, 2))) guard_fail(const char *format, ...);

/* A line of the report. */
void __attribute__((format(printf, 1, 2))) guard_print(const char *format, ...);

const char *guard_phase_name(int phase);

/* What is at an address: "function+0x12" in the program, "library+0x345", or the number alone. */
void guard_place(uintptr_t address, char *text, size_t size);

/* ---- the program's file ---- */

struct guard_program {
    const unsigned char *file; /* mapped */
    size_t size;
    uintptr_t bias; /* address in memory minus address in the file */
    const Elf64_Sym *symbol;
    size_t nsymbol;
    const char *name;
    bool bind_now;
};

extern struct guard_program guard_program;

void guard_open_program(void);
const Elf64_Shdr *guard_section(const char *name); /* NULL = none */

/* ---- tracepoints ---- */

enum guard_event { RUN_BEGIN, TICK_BEGIN, PHASE_END, TICK_END, RUN_END, GUARD_EVENTS };

void guard_plant_probes(void);
/* At each probe, in a signal handler. */
void guard_event(enum guard_event event, int64_t a, int64_t b);

/* ---- calls ---- */

void guard_watch_calls(void); /* at the first run_begin */

/* ---- system calls ---- */

/* Made so that the filter lets it pass. */
long guard_syscall(long number, long a, long b, long c, long d, long e, long f);
void guard_handle(int number, void (*entry)(int, siginfo_t *, void *));
/* The entries, and the functions that they call */
void guard_entry_breakpoint(int number, siginfo_t *info, void *context);
void guard_entry_system_call(int number, siginfo_t *info, void *context);
__attribute__((visibility("hidden"))) void guard_on_breakpoint(int number, siginfo_t *info,
                                                               void *context);
__attribute__((visibility("hidden"))) void guard_on_system_call(int number, siginfo_t *info,
                                                                void *context);

void guard_watch_syscalls(void); /* at the first run_begin */
void guard_report_syscalls(void);

/* ---- page faults ---- */

void guard_watch_faults(void);      /* at each run_begin */
void guard_count_faults(int phase); /* those since the last call belong to this phase */
void guard_report_faults(void);

#endif
