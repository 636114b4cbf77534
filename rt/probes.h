/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Static tracepoints (USDT) between the phases of the loop. Use them with perf, bpftrace, SystemTap
 * or gdb on the same program that runs a rig in the lab. A probe that is not traced is one nop; its
 * arguments are values that the loop already holds. A build without <sys/sdt.h> (Debian:
 * systemtap-sdt-dev), or with -DHIL_PROBES=OFF, has no probes.
 *
 * Provider coman_hil. All probes fire in the loop's thread. This is the complete list:
 *
 *   run_begin(clock, tick_ns)       before the first tick; clock as enum loop_clock
 *   tick_begin(tick, time_ns)       after the wait; tick from 0, virtual time of its beginning
 *   received(bus, frames)           one batch received from a bus, in wait or receive
 *   sent(bus, frames, accepted)     one batch for a bus; how many its port accepted
 *   phase_end(phase, ns)            end of a phase; enum loop_phase (0 wait to 6 publish), duration
 *   overrun(phase, ns)              the phase that the overrun is charged to, ns past the deadline
 *   tick_end(tick, work_ns)         after the overrun accounts; duration of the tick without wait
 *   run_end(end, ticks)             enum loop_end; before the motors are switched off
 *
 * Examples, with PROGRAM the path of coman-hil:
 *
 *   bpftrace -e 'usdt:PROGRAM:coman_hil:phase_end { @ns[arg0] = hist(arg1); }'
 *   bpftrace -e 'usdt:PROGRAM:coman_hil:overrun { printf("phase %d, %d ns late\n", arg0, arg1); }'
 *   perf buildid-cache --add PROGRAM
 *   perf probe --add 'sdt_coman_hil:*' && perf record -e 'sdt_coman_hil:*' -- PROGRAM run RIG
 *
 * RT-safe. A traced probe costs the trap of its tracer, some microseconds.
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
