/* SPDX-License-Identifier: Apache-2.0 */
/* Examines a machine: one function for each finding, which reads what it judges. */
#include "app/cli/doctor/private.h"

#include "base/array.h"

#include <ctype.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Time to leave an idle state, us, above which waking up can cost a tick. */
enum { SLOW_STATE_US = 50 };

/* ---- the kernel ---- */

/* Examines whether the kernel is fully preemptible (PREEMPT_RT). */
static void examine_kernel(struct doctor *d)
{
    char version[DOCTOR_TEXT] = "", release[DOCTOR_TEXT] = "unknown", realtime[DOCTOR_TEXT] = "";

    doctor_read_line(d, version, sizeof version, "/proc/sys/kernel/version");
    doctor_read_line(d, release, sizeof release, "/proc/sys/kernel/osrelease");
    doctor_read_line(d, realtime, sizeof realtime, "/sys/kernel/realtime");
    if (strcmp(realtime, "1") == 0 || strstr(version, "PREEMPT_RT")) {
        doctor_add_finding(d, DOCTOR_OK, "kernel", "", "%.80s, fully preemptible (PREEMPT_RT)",
                           release);
    } else {
        const char *model = strstr(version, "PREEMPT_DYNAMIC") ? "PREEMPT_DYNAMIC"
                            : strstr(version, "PREEMPT")       ? "PREEMPT"
                                                               : "not preemptible";

        doctor_add_finding(d, DOCTOR_WARN, "kernel", doctor_realtime_kernel(d),
                           "%.80s is %s: wake-ups may be late by milliseconds", release, model);
    }
}

/* Examines whether the machine is virtual. */
static void examine_virtual_machine(struct doctor *d)
{
    char flags[4096];

    if ((doctor_read_entry(d, "/proc/cpuinfo", "flags", flags, sizeof flags) &&
         strstr(flags, " hypervisor")) ||
        (doctor_is_arm(d) && doctor_is_virtual_arm(d))) {
        doctor_add_finding(
            d, DOCTOR_WARN, "machine", "",
            "virtual: its host may take the processor away at any time; use it for lockstep");
    } else {
        doctor_add_finding(d, DOCTOR_OK, "machine", "", "no hypervisor seen");
    }
}

/* Examines whether the time is read without a system call. */
static void examine_clock_source(struct doctor *d)
{
    static const char *const fast[] = {"tsc", "arch_sys_counter", "kvm-clock", "riscv_clocksource"};
    static const char file[] = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
    char text[64] = "unknown", fix[160];
    bool good = false;

    doctor_read_line(d, text, sizeof text, "%s", file);
    for (size_t i = 0; i < ARRAY_COUNT(fast); i++) {
        good = good || strcmp(text, fast[i]) == 0;
    }
    if (good) {
        doctor_add_finding(d, DOCTOR_OK, "clock source", "", "%s, read without a system call",
                           text);
    } else {
        snprintf(fix, sizeof fix, "echo %s > %s", doctor_is_arm(d) ? "arch_sys_counter" : "tsc",
                 file);
        doctor_add_finding(d, DOCTOR_WARN, "clock source", fix,
                           "%s: reading the time is slow, and the loop reads it eight times a tick",
                           text);
    }
}

/* Examines RT throttling, which stops real-time threads after a share of each period. */
static void examine_throttling(struct doctor *d)
{
    char runtime[64], period[64];
    double share;

    if (!doctor_read_line(d, runtime, sizeof runtime, "/proc/sys/kernel/sched_rt_runtime_us") ||
        !doctor_read_line(d, period, sizeof period, "/proc/sys/kernel/sched_rt_period_us")) {
        doctor_add_finding(d, DOCTOR_OK, "RT throttling", "", "the kernel has none");
        return;
    }
    share = 100.0 * strtod(runtime, NULL) / strtod(period, NULL);
    if (strtol(runtime, NULL, 10) < 0) {
        doctor_add_finding(d, DOCTOR_OK, "RT throttling", "", "off");
    } else if (share >= 90.0) {
        doctor_add_finding(d, DOCTOR_OK, "RT throttling", "",
                           "after %.0f %% of a second: the loop stays below", share);
    } else {
        doctor_add_finding(d, DOCTOR_WARN, "RT throttling",
                           "sysctl kernel.sched_rt_runtime_us=950000",
                           "stops real-time threads after %.0f %% of a period", share);
    }
}

/* ---- rights ---- */

/* Examines whether this process may have the FIFO priority that the rig asks for. */
static void examine_priority_right(struct doctor *d)
{
    int wanted = d->config->rig->realtime.priority;
    long long limit = doctor_limit_of(d, "Max realtime priority");
    char fix[160];

    snprintf(fix, sizeof fix,
             "echo \"$USER - rtprio %d\" | sudo tee /etc/security/limits.d/coman-hil.conf, and log "
             "in again",
             wanted);
    if (wanted == 0) {
        doctor_add_finding(d, DOCTOR_OK, "FIFO priority", "", "the rig asks for none");
    } else if (doctor_has_capability(d, CAP_SYS_NICE) || limit == -1 || limit >= wanted) {
        doctor_add_finding(d, DOCTOR_OK, "FIFO priority", "", "%d is allowed", wanted);
    } else {
        doctor_add_finding(
            d, DOCTOR_WARN, "FIFO priority", fix,
            "the rig asks for %d, the limit is %lld: the loop runs as a normal thread", wanted,
            limit);
    }
}

/* Examines whether this process may lock its memory. */
static void examine_memory_right(struct doctor *d)
{
    long long limit = doctor_limit_of(d, "Max locked memory");

    if (!d->config->rig->realtime.lock_memory) {
        doctor_add_finding(d, DOCTOR_OK, "locked memory", "", "the rig asks for none");
    } else if (doctor_has_capability(d, CAP_IPC_LOCK) || limit == -1) {
        doctor_add_finding(d, DOCTOR_OK, "locked memory", "", "allowed without limit");
    } else {
        doctor_add_finding(d, DOCTOR_WARN, "locked memory",
                           "echo \"$USER - memlock unlimited\" | sudo tee -a "
                           "/etc/security/limits.d/coman-hil.conf, "
                           "and log in again",
                           "at most %lld kB: pages may be swapped out", limit / 1024);
    }
}

/* ---- processors ---- */

/* Examines the loop's processor: named, online, allowed, and isolated from other processes. */
static void examine_processor(struct doctor *d)
{
    int cpu = d->config->rig->realtime.cpu;
    char online[DOCTOR_TEXT] = "0", isolated[DOCTOR_TEXT] = "", allowed[DOCTOR_TEXT] = "", fix[160];

    doctor_read_line(d, online, sizeof online, "/sys/devices/system/cpu/online");
    doctor_read_line(d, isolated, sizeof isolated, "/sys/devices/system/cpu/isolated");
    doctor_read_entry(d, "/proc/self/status", "Cpus_allowed_list", allowed, sizeof allowed);
    snprintf(fix, sizeof fix, "add isolcpus=%d nohz_full=%d rcu_nocbs=%d to %s", cpu, cpu, cpu,
             doctor_command_line(d));

    /* Worst first: no processor named, one that is not there, one that is not allowed */
    if (cpu < 0) {
        doctor_add_finding(
            d, DOCTOR_WARN, "processor", "isolate one and name it in the rig: realtime: {cpu: N}",
            "the rig names none: the loop shares %.60s with everything else", online);
    } else if (!doctor_list_has(online, cpu)) {
        doctor_add_finding(d, DOCTOR_FAIL, "processor",
                           "name one of them in the rig: realtime: {cpu: N}",
                           "the rig names number %d, there are %.60s", cpu, online);
    } else if (allowed[0] && !doctor_list_has(allowed, cpu) && !doctor_list_has(isolated, cpu)) {
        doctor_add_finding(d, DOCTOR_FAIL, "processor", "run it outside of the taskset or cpuset",
                           "the rig names number %d, this process may use %.60s", cpu, allowed);
    } else if (!doctor_list_has(isolated, cpu)) {
        doctor_add_finding(d, DOCTOR_WARN, "processor", fix,
                           "number %d is not isolated from other processes", cpu);
    } else {
        doctor_add_finding(d, DOCTOR_OK, "processor", "", "number %d, isolated", cpu);
    }
}

/* Examines how many interrupts may come to the loop's processor. */
static void examine_interrupts(struct doctor *d)
{
    int cpu = d->config->rig->realtime.cpu, count = 0;
    char path[DOCTOR_PATH], text[DOCTOR_TEXT], fix[160];
    struct dirent *entry;
    DIR *directory;

    if (cpu < 0) {
        return;
    }

    /* Count the interrupts whose affinity includes the processor */
    snprintf(path, sizeof path, "%s/proc/irq", d->config->root);
    directory = opendir(path);
    while (directory && (entry = readdir(directory)) != NULL) {
        if (isdigit((unsigned char)entry->d_name[0]) &&
            doctor_read_line(d, text, sizeof text, "/proc/irq/%.20s/effective_affinity_list",
                             entry->d_name) &&
            doctor_list_has(text, cpu)) {
            count++;
        }
    }
    if (directory) {
        closedir(directory);
    }

    snprintf(fix, sizeof fix,
             "systemctl disable --now irqbalance; add irqaffinity= with the other processors to %s",
             doctor_command_line(d));
    if (count > 0) {
        doctor_add_finding(d, DOCTOR_WARN, "interrupts", fix, "%d come to processor %d", count,
                           cpu);
    } else {
        doctor_add_finding(d, DOCTOR_OK, "interrupts", "", "none come to processor %d", cpu);
    }
}

/* Examines the frequency governor of the loop's processor. */
static void examine_governor(struct doctor *d)
{
    int cpu = d->config->rig->realtime.cpu < 0 ? 0 : d->config->rig->realtime.cpu;
    char text[64];

    if (!doctor_read_line(d, text, sizeof text,
                          "/sys/devices/system/cpu/cpu%d/cpufreq/scaling_governor", cpu)) {
        doctor_add_finding(d, DOCTOR_OK, "frequency", "", "not scaled by this kernel");
    } else if (strcmp(text, "performance") == 0) {
        doctor_add_finding(d, DOCTOR_OK, "frequency", "", "governor performance");
    } else {
        doctor_add_finding(d, DOCTOR_WARN, "frequency", "cpupower frequency-set -g performance",
                           "governor %s: a tick after an idle period runs slowly", text);
    }
}

/* Examines the slowest idle state that may be entered; a run holds /dev/cpu_dma_latency open to
 * forbid it, when it may write there. */
static void examine_idle_states(struct doctor *d)
{
    int cpu = d->config->rig->realtime.cpu < 0 ? 0 : d->config->rig->realtime.cpu;
    char latency[64], disabled[64], name[64] = "", slowest[64] = "none";
    long worst = 0;

    /* States are numbered from 0; disabled ones do not count */
    for (int i = 0; i < 16; i++) {
        if (!doctor_read_line(d, latency, sizeof latency,
                              "/sys/devices/system/cpu/cpu%d/cpuidle/state%d/latency", cpu, i)) {
            break;
        }
        if (doctor_read_line(d, disabled, sizeof disabled,
                             "/sys/devices/system/cpu/cpu%d/cpuidle/state%d/disable", cpu, i) &&
            strcmp(disabled, "0") != 0) {
            continue;
        }
        if (strtol(latency, NULL, 10) > worst) {
            worst = strtol(latency, NULL, 10);
            doctor_read_line(d, name, sizeof name,
                             "/sys/devices/system/cpu/cpu%d/cpuidle/state%d/name", cpu, i);
            snprintf(slowest, sizeof slowest, "%s", name);
        }
    }

    /* A slow state is harmless when the loop can forbid it */
    if (worst > SLOW_STATE_US && doctor_may_write(d, "/dev/cpu_dma_latency")) {
        doctor_add_finding(d, DOCTOR_OK, "idle states", "",
                           "slowest %s, %ld us to leave: a run in real time prevents it", slowest,
                           worst);
    } else if (worst > SLOW_STATE_US) {
        doctor_add_finding(d, DOCTOR_WARN, "idle states",
                           "groupadd -r realtime; usermod -aG realtime $USER; cp "
                           "/usr/share/doc/coman-hil/examples/"
                           "80-coman-hil-can.rules /etc/udev/rules.d/; udevadm trigger",
                           "%s takes %ld us to leave, and /dev/cpu_dma_latency cannot be written",
                           slowest, worst);
    } else {
        doctor_add_finding(d, DOCTOR_OK, "idle states", "", "slowest %s, %ld us to leave", slowest,
                           worst);
    }
}

void doctor_examine_machine(struct doctor *d)
{
    examine_kernel(d);
    examine_virtual_machine(d);
    examine_clock_source(d);
    examine_throttling(d);
    examine_priority_right(d);
    examine_memory_right(d);
    examine_processor(d);
    examine_interrupts(d);
    examine_governor(d);
    examine_idle_states(d);
}
