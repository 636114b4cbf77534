/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Static tracepoints (USDT) at the seams of the loop, for perf, bpftrace, SystemTap and gdb on the
 * very program that runs a lab's rig. A probe that nobody watches is one nop; its arguments are
 * values that the loop has at hand. Without <sys/sdt.h> at build time (Debian: systemtap-sdt-dev),
 * or with -DHIL_PROBES=OFF, a probe is nothing at all.
 *
 * Provider coman_hil. All probes are hit in the loop's thread, and these are all there are:
 *
 *   run_begin(clock, tick_ns)       before the first tick; clock as enum loop_clock
 *   tick_begin(tick, time_ns)       the wait is over; tick from 0, virtual time at which it begins
 *   received(bus, frames)           one batch taken from a bus, in wait and receive
 *   sent(bus, frames, accepted)     one batch for a bus; accepted by its port
 *   phase_end(phase, ns)            a phase has ended; enum loop_phase (0 wait to 6 publish) and
 *                                   the time that it took
 *   overrun(phase, ns)              an overrun: the phase that it is charged to, and how far past
 *                                   the deadline
 *   tick_end(tick, work_ns)         accounts are done; the tick without the wait
 *   run_end(end, ticks)             enum loop_end; before the motors are switched off
 *
 * Examples, with PROGRAM the path of coman-hil:
 *
 *   bpftrace -e 'usdt:PROGRAM:coman_hil:phase_end { @ns[arg0] = hist(arg1); }'
 *   bpftrace -e 'usdt:PROGRAM:coman_hil:overrun { printf("phase %d, %d ns late\n", arg0, arg1); }'
 *   perf buildid-cache --add PROGRAM
 *   perf probe --add 'sdt_coman_hil:*' && perf record -e 'sdt_coman_hil:*' -- PROGRAM run RIG
 *
 * RT-safe; a watched probe costs its watcher's trap, some microseconds.
 */
#ifndef RT_PROBES_H
#define RT_PROBES_H

#if HIL_PROBES
#include <sys/sdt.h>
#define PROBE2(name, a, b) DTRACE_PROBE2(coman_hil, name, a, b)
#define PROBE3(name, a, b, c) DTRACE_PROBE3(coman_hil, name, a, b, c)
#else
#define PROBE2(name, a, b) ((void)(a), (void)(b))
#define PROBE3(name, a, b, c) ((void)(a), (void)(b), (void)(c))
#endif

#endif
