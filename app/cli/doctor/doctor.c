/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil doctor: examines whether a machine can run a rig. One function per subject reads its
 * data, judges them, and suggests a remedy. */
#include "app/cli/doctor/doctor.h"

#include "app/cli/cli.h"
#include "base/array.h"
#include "base/text.h"
#include "manual/doctor.h"
#include "model/symbolic/symbolic.h"
#include "rt/histogram.h"
#include "sim/external.h"

#include <ctype.h>
#include <dirent.h>
#include <inttypes.h>
#include <stdlib.h>
#include <unistd.h>

enum {
    TEXT = 4096,        /* size of a buffer, enough for the flags of a processor */
    CAP_NET_ADMIN = 12, /* capabilities, as in linux/capability.h */
    CAP_IPC_LOCK = 14,
    CAP_SYS_NICE = 23,
    ARPHRD_CAN = 280,         /* type of a CAN interface in sysfs, as in linux/if_arp.h */
    SLOW_STATE_US = 50,       /* an idle state with a longer exit latency, us, can delay a tick */
    SHORT_QUEUE = 100,        /* with a shorter queue, a controller may lose frames within a tick */
    RECEIVE_WANTED = 4 << 20, /* receive buffer that a run requests, bytes */
    RECEIVE_FRAME = 384,      /* bytes per frame in the receive buffer, with overhead */
    RECEIVE_BATCH = 64,       /* frames read from a bus in one call */
    PROCESSORS_MAX = 64,
    SENSORS_MAX = 32,
};

/* A running examination. */
struct doctor {
    const struct doctor_config *config;
    const struct rig *rig;
    int cpu; /* the loop's processor; negative = none */
    const char *subject;
    struct doctor_finding *findings;
    size_t count, max;
};

/* ---- findings ---- */

/* Adds a finding while there is room. format gives the text. A finding with the verdict OK needs no
 * fix. */
__attribute__((format(printf, 4, 5))) static void
doctor_add(struct doctor *d, enum doctor_verdict verdict, const char *fix, const char *format, ...)
{
    struct doctor_finding *finding = &d->findings[d->count];

    if (d->count == d->max) {
        return;
    }
    d->count++;
    finding->verdict = verdict;
    finding->subject = d->subject;
    snprintf(finding->fix, sizeof finding->fix, "%s", verdict == DOCTOR_OK ? "" : fix);
    TEXT_FORMAT(finding->found, format);
}

/* ---- files below the root ---- */

/* Finds the first line of a file that starts with key, and copies the rest of the line. Leaves text
 * unchanged if there is none. */
static bool doctor_read_entry(const struct doctor *d, const char *name, const char *key,
                              char text[TEXT])
{
    char path[TEXT], line[2 * TEXT];
    bool found = false;
    FILE *file;

    snprintf(path, sizeof path, "%s%s", d->config->root, name);
    file = fopen(path, "re");
    while (file && !found && fgets(line, sizeof line, file)) {
        found = strncmp(line, key, strlen(key)) == 0;
    }
    if (found) {
        const char *value = line + strlen(key);

        value += *key ? strspn(value, " \t:") : 0;
        snprintf(text, TEXT, "%.*s", (int)strcspn(value, "\n"), value);
    }
    if (file) {
        fclose(file);
    }
    return found;
}

/* Reads the first line of a file. */
__attribute__((format(printf, 3, 4))) static bool
doctor_read_line(const struct doctor *d, char text[TEXT], const char *format, ...)
{
    char name[256];

    TEXT_FORMAT(name, format);
    return doctor_read_entry(d, name, "", text);
}

static bool doctor_has_capability(const struct doctor *d, int capability)
{
    char text[TEXT] = "0";

    doctor_read_entry(d, "/proc/self/status", "CapEff", text);
    return (strtoull(text, NULL, 16) >> capability & 1) != 0;
}

/* Returns the soft limit of a row of /proc/self/limits; LLONG_MAX = unlimited, -2 = unknown. */
static long long doctor_find_limit(const struct doctor *d, const char *row)
{
    char text[TEXT] = "-2";

    doctor_read_entry(d, "/proc/self/limits", row, text);
    return strncmp(text, "unlimited", 9) == 0 ? LLONG_MAX : strtoll(text, NULL, 10);
}

bool doctor_list_has(const char *list, int cpu)
{
    while (isdigit((unsigned char)*list)) {
        char *end;
        long first = strtol(list, &end, 10), last = first;

        if (*end == '-' && isdigit((unsigned char)end[1])) {
            last = strtol(end + 1, &end, 10);
        }
        if (cpu >= first && cpu <= last) {
            return true;
        }
        list = *end == ',' ? end + 1 : end;
    }
    return false;
}

/* Checks whether the examined machine has ARM processors. */
static bool doctor_is_arm(const struct doctor *d)
{
    char text[TEXT];

    return doctor_read_entry(d, "/proc/cpuinfo", "CPU implementer", text);
}

static bool doctor_is_raspberry_pi(const struct doctor *d)
{
    char text[TEXT];

    return doctor_read_entry(d, "/proc/device-tree/model", "Raspberry Pi", text);
}

/* Returns the place where the user sets the kernel's parameters. */
static const char *doctor_find_command_line(const struct doctor *d)
{
    return doctor_is_raspberry_pi(d) ? "/boot/firmware/cmdline.txt" : "the kernel's command line";
}

/* ---- the kernel ---- */

static void examine_kernel(struct doctor *d)
{
    char version[TEXT] = "", release[TEXT] = "unknown", realtime[TEXT] = "";

    doctor_read_line(d, version, "/proc/sys/kernel/version");
    doctor_read_line(d, release, "/proc/sys/kernel/osrelease");
    doctor_read_line(d, realtime, "/sys/kernel/realtime");
    if (strcmp(realtime, "1") == 0 || strstr(version, "PREEMPT_RT")) {
        doctor_add(d, DOCTOR_OK, "", "%.80s, fully preemptible (PREEMPT_RT)", release);
    } else {
        doctor_add(d, DOCTOR_WARN,
                   doctor_is_raspberry_pi(d)
                       ? "apt install linux-image-rpi-v8-rt; add kernel=kernel8_rt.img to "
                         "/boot/firmware/config.txt; reboot"
                   : doctor_is_arm(d) ? "apt install linux-image-rt-arm64 && reboot"
                                      : "apt install linux-image-rt-amd64 && reboot",
                   "%.80s is %s: wake-ups may be late by milliseconds", release,
                   strstr(version, "PREEMPT_DYNAMIC") ? "PREEMPT_DYNAMIC"
                   : strstr(version, "PREEMPT")       ? "PREEMPT"
                                                      : "not preemptible");
    }
}

static void examine_virtual_machine(struct doctor *d)
{
    char text[TEXT] = "", vendor[TEXT] = "";
    bool is_virtual =
        doctor_read_entry(d, "/proc/cpuinfo", "flags", text) && strstr(text, " hypervisor") != NULL;

    /* ARM processors have no flag for a hypervisor: the device tree names the hypervisor, or its
     * board */
    if (doctor_is_arm(d)) {
        doctor_read_line(d, vendor, "/sys/class/dmi/id/sys_vendor");
        is_virtual = doctor_read_line(d, text, "/proc/device-tree/hypervisor/compatible") ||
                     doctor_read_line(d, text, "/sys/hypervisor/type") ||
                     (doctor_read_line(d, text, "/proc/device-tree/compatible") &&
                      strcmp(text, "linux,dummy-virt") == 0) ||
                     strcmp(vendor, "QEMU") == 0 || strcmp(vendor, "Amazon EC2") == 0;
    }
    doctor_add(d, is_virtual ? DOCTOR_WARN : DOCTOR_OK, "",
               is_virtual ? "virtual: its host may take the processor away at any time; use it for "
                            "lockstep"
                          : "no hypervisor seen");
}

/* Examines whether the process can read the time without a system call. */
static void examine_clock_source(struct doctor *d)
{
    static const char fast[] = " tsc arch_sys_counter kvm-clock riscv_clocksource ";
    static const char file[] = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
    char text[TEXT] = "unknown", word[TEXT + 2], fix[160];
    bool is_fast;

    doctor_read_line(d, text, "%s", file);
    snprintf(word, sizeof word, " %s ", text);
    is_fast = strstr(fast, word) != NULL;
    snprintf(fix, sizeof fix, "echo %s > %s", doctor_is_arm(d) ? "arch_sys_counter" : "tsc", file);
    doctor_add(d, is_fast ? DOCTOR_OK : DOCTOR_WARN, fix, "%.60s%s", text,
               is_fast ? ", read without a system call"
                       : ": reading the time is slow, and the loop reads it eight times a tick");
}

/* Examines RT throttling, which stops real-time threads for a part of each period. */
static void examine_throttling(struct doctor *d)
{
    char runtime[TEXT] = "-1", period[TEXT] = "-1";
    double share;

    doctor_read_line(d, runtime, "/proc/sys/kernel/sched_rt_runtime_us");
    doctor_read_line(d, period, "/proc/sys/kernel/sched_rt_period_us");
    share = 100.0 * strtod(runtime, NULL) / strtod(period, NULL);
    if (period[0] == '-' || share < 0.0) {
        doctor_add(d, DOCTOR_OK, "", period[0] == '-' ? "the kernel has none" : "off");
    } else {
        doctor_add(d, share >= 90.0 ? DOCTOR_OK : DOCTOR_WARN,
                   "sysctl kernel.sched_rt_runtime_us=950000",
                   share >= 90.0 ? "after %.0f %% of a second: the loop stays below"
                                 : "stops real-time threads after %.0f %% of a period",
                   share);
    }
}

/* ---- rights ---- */

static void examine_priority_right(struct doctor *d)
{
    int wanted = d->rig->realtime.priority;
    long long limit = doctor_find_limit(d, "Max realtime priority");
    char fix[160];

    if (wanted == 0) {
        doctor_add(d, DOCTOR_OK, "", "the rig asks for none");
    } else if (doctor_has_capability(d, CAP_SYS_NICE) || limit >= wanted) {
        doctor_add(d, DOCTOR_OK, "", "%d is allowed", wanted);
    } else {
        snprintf(fix, sizeof fix,
                 "echo \"$USER - rtprio %d\" | sudo tee /etc/security/limits.d/coman-hil.conf, and "
                 "log in again",
                 wanted);
        doctor_add(d, DOCTOR_WARN, fix,
                   "the rig asks for %d, the limit is %lld: the loop runs as a normal thread",
                   wanted, limit);
    }
}

static void examine_memory_right(struct doctor *d)
{
    long long limit = doctor_find_limit(d, "Max locked memory");

    if (!d->rig->realtime.lock_memory) {
        doctor_add(d, DOCTOR_OK, "", "the rig asks for none");
    } else if (doctor_has_capability(d, CAP_IPC_LOCK) || limit == LLONG_MAX) {
        doctor_add(d, DOCTOR_OK, "", "allowed without limit");
    } else {
        doctor_add(d, DOCTOR_WARN,
                   "echo \"$USER - memlock unlimited\" | sudo tee -a "
                   "/etc/security/limits.d/coman-hil.conf, and log in again",
                   "at most %lld kB: pages may be swapped out", limit / 1024);
    }
}

/* ---- processors ---- */

/* Examines whether the rig names the loop's processor, and whether it is online, allowed, and
 * isolated from other processes. */
static void examine_processor(struct doctor *d)
{
    char online[TEXT] = "0", isolated[TEXT] = "", allowed[TEXT] = "", fix[160];

    doctor_read_line(d, online, "/sys/devices/system/cpu/online");
    doctor_read_line(d, isolated, "/sys/devices/system/cpu/isolated");
    doctor_read_entry(d, "/proc/self/status", "Cpus_allowed_list", allowed);
    snprintf(fix, sizeof fix, "add isolcpus=%d nohz_full=%d rcu_nocbs=%d to %s", d->cpu, d->cpu,
             d->cpu, doctor_find_command_line(d));
    if (d->cpu < 0) {
        doctor_add(d, DOCTOR_WARN, "isolate one and name it in the rig: realtime: {cpu: N}",
                   "the rig names none: the loop shares %.60s with everything else", online);
    } else if (!doctor_list_has(online, d->cpu)) {
        doctor_add(d, DOCTOR_FAIL, "name one of them in the rig: realtime: {cpu: N}",
                   "the rig names number %d, there are %.60s", d->cpu, online);
    } else if (allowed[0] && !doctor_list_has(allowed, d->cpu) &&
               !doctor_list_has(isolated, d->cpu)) {
        doctor_add(d, DOCTOR_FAIL, "run it outside of the taskset or cpuset",
                   "the rig names number %d, this process may use %.60s", d->cpu, allowed);
    } else if (!doctor_list_has(isolated, d->cpu)) {
        doctor_add(d, DOCTOR_WARN, fix, "number %d is not isolated from other processes", d->cpu);
    } else {
        doctor_add(d, DOCTOR_OK, "", "number %d, isolated", d->cpu);
    }
}

/* Examines how many interrupts the loop's processor may receive. */
static void examine_interrupts(struct doctor *d)
{
    char text[TEXT], fix[160];
    struct dirent *entry;
    DIR *directory;
    int count = 0;

    if (d->cpu < 0) {
        return;
    }
    snprintf(text, sizeof text, "%s/proc/irq", d->config->root);
    directory = opendir(text);
    while (directory && (entry = readdir(directory)) != NULL) {
        count +=
            doctor_read_line(d, text, "/proc/irq/%.20s/effective_affinity_list", entry->d_name) &&
            doctor_list_has(text, d->cpu);
    }
    if (directory) {
        closedir(directory);
    }
    snprintf(fix, sizeof fix,
             "systemctl disable --now irqbalance; add irqaffinity= with the other processors to %s",
             doctor_find_command_line(d));
    doctor_add(d, count > 0 ? DOCTOR_WARN : DOCTOR_OK, fix,
               count > 0 ? "%d come to processor %d" : "none of the %d come to processor %d", count,
               d->cpu);
}

/* Examines the frequency governor of the loop's processor. */
static void examine_governor(struct doctor *d)
{
    char text[TEXT];

    if (!doctor_read_line(d, text, "/sys/devices/system/cpu/cpu%d/cpufreq/scaling_governor",
                          d->cpu < 0 ? 0 : d->cpu)) {
        doctor_add(d, DOCTOR_OK, "", "not scaled by this kernel");
    } else {
        bool fast = strcmp(text, "performance") == 0;

        doctor_add(d, fast ? DOCTOR_OK : DOCTOR_WARN, "cpupower frequency-set -g performance",
                   "governor %.60s%s", text,
                   fast ? "" : ": a tick after an idle period runs slowly");
    }
}

/* Examines the slowest enabled idle state. A run forbids such states through /dev/cpu_dma_latency
 * if it may write there. */
static void examine_idle_states(struct doctor *d)
{
    static const char states[] = "/sys/devices/system/cpu/cpu%d/cpuidle/state%d/%s";
    const int cpu = d->cpu < 0 ? 0 : d->cpu;
    char text[TEXT], name[TEXT] = "none";
    long worst = 0;

    for (int i = 0; doctor_read_line(d, text, states, cpu, i, "latency"); i++) {
        const long latency = strtol(text, NULL, 10);
        const bool disabled =
            doctor_read_line(d, text, states, cpu, i, "disable") && strcmp(text, "0") != 0;

        if (!disabled && latency > worst) {
            worst = latency;
            doctor_read_line(d, name, states, cpu, i, "name");
        }
    }
    snprintf(text, sizeof text, "%.60s/dev/cpu_dma_latency", d->config->root);
    if (worst <= SLOW_STATE_US || access(text, W_OK) == 0) {
        doctor_add(d, DOCTOR_OK, "", "slowest %.60s, %ld us to leave%s", name, worst,
                   worst <= SLOW_STATE_US ? "" : ": a run in real time prevents it");
    } else {
        doctor_add(d, DOCTOR_WARN,
                   "groupadd -r realtime; usermod -aG realtime $USER; cp "
                   "/usr/share/doc/coman-hil/examples/80-coman-hil-can.rules /etc/udev/rules.d/; "
                   "udevadm trigger",
                   "%.60s takes %ld us to leave, and /dev/cpu_dma_latency cannot be written", name,
                   worst);
    }
}

/* Examines whether the loop's processor is a fast one. On ARM chips with processors of several
 * speeds the kernel gives the relative capacity of each. */
static void examine_capacity(struct doctor *d)
{
    long own = 0, best = 0;
    int fastest = -1;
    char text[TEXT], fix[160];

    for (int i = 0; i < PROCESSORS_MAX && doctor_is_arm(d); i++) {
        if (doctor_read_line(d, text, "/sys/devices/system/cpu/cpu%d/cpu_capacity", i)) {
            const long capacity = strtol(text, NULL, 10);

            own = i == d->cpu ? capacity : own;
            fastest = capacity > best ? i : fastest;
            best = capacity > best ? capacity : best;
        }
    }
    snprintf(fix, sizeof fix, "name a fast one in the rig: realtime: {cpu: %d}", fastest);
    if (own > 0) {
        doctor_add(d, own < best ? DOCTOR_WARN : DOCTOR_OK, fix,
                   "number %d has %.0f %% of the speed of number %d", d->cpu,
                   100.0 * (double)own / (double)best, fastest);
    }
}

/* Examines the power supply of a Raspberry Pi, which lowers its clock when the voltage drops. The
 * alarm stays set until it is read. */
static void examine_supply(struct doctor *d)
{
    char text[TEXT];

    for (int i = 0; i < SENSORS_MAX && doctor_is_arm(d); i++) {
        if (!doctor_read_line(d, text, "/sys/class/hwmon/hwmon%d/name", i) ||
            strcmp(text, "rpi_volt") != 0 ||
            !doctor_read_line(d, text, "/sys/class/hwmon/hwmon%d/in0_lcrit_alarm", i)) {
            continue;
        }
        doctor_add(d, strcmp(text, "0") == 0 ? DOCTOR_OK : DOCTOR_WARN,
                   "use a supply and a cable for what the board and its hats draw",
                   strcmp(text, "0") == 0
                       ? "voltage is high enough"
                       : "under-voltage: the firmware lowers the clock of the processors");
        return;
    }
}

/* Examines whether the rig's contact engine is installed; one of the engines is a module. */
static void examine_engine(struct doctor *d)
{
    char path[512];
    bool found = contact_simbody_find(path, sizeof path);

    if (d->rig->contact_engine == RIG_CONTACT_SIMBODY) {
        doctor_add(d, found ? DOCTOR_OK : DOCTOR_FAIL,
                   "scene engine native, or a build with HIL_SIMBODY=ON",
                   found ? "simbody: %.110s"
                         : "the rig's engine simbody is not installed: no %.110s",
                   path);
    }
}

/* ---- buses ---- */

/* Checks whether the buses are kernel interfaces and the kernel supports CAN. The kernel lists the
 * protocol family once its module is loaded. */
static bool doctor_has_can(const struct doctor *d)
{
    char text[TEXT];

    return !d->config->local && (doctor_read_entry(d, "/proc/net/protocols", "CAN_RAW", text) ||
                                 doctor_read_line(d, text, "/proc/net/can/version"));
}

static void examine_can(struct doctor *d)
{
    bool there = doctor_has_can(d);

    if (!d->config->local) {
        doctor_add(d, there ? DOCTOR_OK : DOCTOR_WARN, "modprobe can-raw vcan",
                   there ? "the kernel has raw CAN sockets"
                         : "the kernel has no CAN now: buses stay inside the process");
    }
}

/* Examines whether the receive buffer is large enough for the frames that arrive while the loop is
 * delayed. Without CAP_NET_ADMIN the kernel limits the buffer's size. */
static void examine_receive_buffer(struct doctor *d)
{
    char text[TEXT];
    long long most;

    if (!doctor_has_can(d) || doctor_has_capability(d, CAP_NET_ADMIN) ||
        !doctor_read_line(d, text, "/proc/sys/net/core/rmem_max")) {
        return;
    }
    most = strtoll(text, NULL, 10);
    doctor_add(d, most < RECEIVE_WANTED ? DOCTOR_WARN : DOCTOR_OK,
               "sysctl -w net.core.rmem_max=4194304",
               "%lld bytes, about %lld frames, may wait for the loop%s", most, most / RECEIVE_FRAME,
               most < RECEIVE_WANTED ? "; more are lost, and counted" : "");
}

/* Examines the interface of a bus: it must exist, be of type CAN, be up, and have a long enough
 * queue. */
static void examine_interface(struct doctor *d, const struct rig_bus *bus)
{
    const char *name = bus->interface;
    char type[TEXT], flags[TEXT] = "0", queue[TEXT] = "0", fix[192];
    bool up, is_virtual = doctor_read_line(d, type, "/sys/devices/virtual/net/%s/type", name);

    if (!doctor_read_line(d, type, "/sys/class/net/%s/type", name)) {
        snprintf(fix, sizeof fix, "ip link add dev %s type vcan && ip link set up %s", name, name);
        doctor_add(d, DOCTOR_FAIL, fix, "%s of bus %s: there is no such interface", name,
                   bus->name);
        return;
    }

    /* Judge the state in the order in which it would stop a run */
    doctor_read_line(d, flags, "/sys/class/net/%s/flags", name);
    doctor_read_line(d, queue, "/sys/class/net/%s/tx_queue_len", name);
    up = (strtoul(flags, NULL, 16) & 1) != 0;
    if (strtol(type, NULL, 10) != ARPHRD_CAN) {
        doctor_add(d, DOCTOR_FAIL, "name another one: run --bus NAME=INTERFACE",
                   "%s of bus %s is no CAN interface", name, bus->name);
    } else if (!up && !is_virtual && bus->configure && doctor_has_capability(d, CAP_NET_ADMIN)) {
        doctor_add(d, DOCTOR_OK, "",
                   "%s of bus %s is down: a run sets it to %" PRId64 " bit/s and starts it", name,
                   bus->name, bus->bitrate);
    } else if (!up) {
        snprintf(fix, sizeof fix, "ip link set up %s", name);
        if (!is_virtual) {
            snprintf(fix, sizeof fix,
                     "ip link set %s up type can bitrate %" PRId64 " restart-ms 100", name,
                     bus->bitrate);
        }
        doctor_add(d, DOCTOR_FAIL, fix, "%s of bus %s is down", name, bus->name);
    } else if (!is_virtual && strtol(queue, NULL, 10) < SHORT_QUEUE) {
        snprintf(fix, sizeof fix, "ip link set %s txqueuelen 1000", name);
        doctor_add(d, DOCTOR_WARN, fix,
                   "%s of bus %s queues %.20s frames only: a tick's batch may be lost", name,
                   bus->name, queue);
    } else {
        doctor_add(d, DOCTOR_OK, "", "%s of bus %s is up%s", name, bus->name,
                   is_virtual ? ", virtual" : "");
    }
}

/* Judges a CAN controller whose bit rate differs from the rig's. */
static void judge_bitrate(struct doctor *d, const struct rig_bus *bus, uint32_t actual)
{
    char fix[192];

    /* A run that configures the interface corrects the bit rate, if it has permission */
    snprintf(fix, sizeof fix,
             "ip link set %s down && ip link set %s type can bitrate %" PRId64
             " && ip link set %s up, or configure: true in the rig",
             bus->interface, bus->interface, bus->bitrate, bus->interface);
    if (!bus->configure) {
        doctor_add(d, DOCTOR_FAIL, fix, "%s of bus %s runs at %u bit/s, the rig says %" PRId64,
                   bus->interface, bus->name, actual, bus->bitrate);
    } else if (!doctor_has_capability(d, CAP_NET_ADMIN)) {
        doctor_add(d, DOCTOR_FAIL, "run it with CAP_NET_ADMIN",
                   "%s of bus %s is to be set to %" PRId64 " bit/s, which this process may not do",
                   bus->interface, bus->name, bus->bitrate);
    } else {
        doctor_add(d, DOCTOR_OK, "", "%s of bus %s runs at %u bit/s: a run sets it to %" PRId64,
                   bus->interface, bus->name, actual, bus->bitrate);
    }
}

/* Examines the state of a CAN controller that is up, through netlink. */
static void examine_controller(struct doctor *d, const struct rig_bus *bus)
{
    const struct interface_ops *ops = d->config->interfaces;
    const char *name = bus->interface;
    const struct link_controller *c;
    struct link_info info;
    char fix[192];

    if (!ops || ops->query(ops->context, name, &info, NULL) || !info.up ||
        interface_kind(&info) != INTERFACE_CONTROLLER) {
        return;
    }
    c = &info.controller;
    if (!interface_bitrate_fits(c->timing.bitrate, bus->bitrate)) {
        judge_bitrate(d, bus, c->timing.bitrate);
    } else if (c->state == CAN_STATE_BUS_OFF) {
        snprintf(fix, sizeof fix, "check cable and terminators; ip link set %s type can restart",
                 name);
        doctor_add(d, DOCTOR_FAIL, fix, "%s of bus %s is in bus-off", name, bus->name);
    } else if (c->state != CAN_STATE_ERROR_ACTIVE) {
        doctor_add(d, DOCTOR_WARN,
                   "check cable, terminators, and that another node is on with the same bit rate",
                   "%s of bus %s is %s (TEC %u, REC %u)", name, bus->name,
                   interface_state_name(c->state), c->errors.txerr, c->errors.rxerr);
    } else if (!c->restart_ms && !bus->configure) {
        snprintf(fix, sizeof fix, "ip link set %s down; ip link set %s up type can restart-ms 100",
                 name, name);
        doctor_add(d, DOCTOR_WARN, fix,
                   "%s of bus %s stays in bus-off once it is there: it has no restart-ms", name,
                   bus->name);
    } else {
        doctor_add(d, DOCTOR_OK, "", "%s of bus %s is error active at %u bit/s", name, bus->name,
                   c->timing.bitrate);
    }
}

static void examine_interfaces(struct doctor *d)
{
    for (size_t b = 0; doctor_has_can(d) && b < d->rig->nbus; b++) {
        d->subject = "interface";
        examine_interface(d, &d->rig->bus[b]);
        d->subject = "controller";
        examine_controller(d, &d->rig->bus[b]);
    }
}

/* Examines whether each bus can carry its worst-case load, telemetry and commands together. */
static void examine_loads(struct doctor *d)
{
    for (size_t b = 0; b < d->rig->nbus; b++) {
        double telemetry, commands, percent;

        rig_bus_load(d->rig, b, d->rig->servo.command_period_ns, &telemetry, &commands);
        percent = 100.0 * (telemetry + commands) / (double)d->rig->bus[b].bitrate;
        doctor_add(d, percent > 100.0 ? DOCTOR_WARN : DOCTOR_OK,
                   "coman-hil check tells which split or rate fits",
                   "%s needs %.0f %% of its wire in the worst case", d->rig->bus[b].name, percent);
    }
}

/* ---- external boards ---- */

/* Listens for the external boards of the rig. */
static void examine_external(struct doctor *d)
{
    const struct doctor_config *config = d->config;
    struct external *external = NULL;
    struct bus_frame frames[RECEIVE_BATCH];
    struct error error;
    int64_t start, now;

    if (!config->port || config->listen_ns <= 0) {
        return;
    }
    if (external_create(d->rig, NULL, NULL, config->arena, &external, &error)) {
        doctor_add(d, DOCTOR_WARN, "", "cannot listen: %s", error.text);
    }
    if (!external) {
        return;
    }

    /* Time starts at 0, as in the loop; frames beyond a batch wait for the next reading */
    start = now = clock_now(config->clock);
    while (now - start < config->listen_ns) {
        clock_sleep_until(config->clock, now + CLOCK_MS);
        now = clock_now(config->clock);
        for (size_t b = 0; b < d->rig->nbus; b++) {
            size_t count =
                config->port[b] ? can_receive(config->port[b], frames, RECEIVE_BATCH) : 0;

            for (size_t i = 0; i < count; i++) {
                external_receive(external, now - start, b, &frames[i]);
            }
        }
    }
    for (size_t i = 0; i < d->rig->boards.nboard; i++) {
        const struct board_config *board = &d->rig->boards.board[i];

        if (board->external && config->port[board->bus]) {
            const int64_t heard_ns = external_heard_ns(external, i);
            const int64_t now_ns = now - start;
            static const char fix[] = "switch it on, check cable and address; one that sends when "
                                      "it is told to needs its controller";
            const char *interface = d->rig->bus[board->bus].interface;
            const double age_ms = 1e-6 * (double)(now_ns - heard_ns);

            /* Judge a board by the time since its last frame: no frame, longer than its
             * timeout, or in time */
            if (heard_ns < 0) {
                doctor_add(d, DOCTOR_WARN, fix, "board %s on %s is silent: not heard in %.3g s",
                           board->name, interface, 1e-9 * (double)d->config->listen_ns);
            } else if (now_ns - heard_ns > board->external_timeout_ns) {
                doctor_add(
                    d, DOCTOR_WARN, fix,
                    "board %s on %s is silent: last heard %.0f ms ago, its time-out is %.0f ms",
                    board->name, interface, age_ms, 1e-6 * (double)board->external_timeout_ns);
            } else {
                doctor_add(d, DOCTOR_OK, "", "board %s on %s is heard, %.0f ms ago", board->name,
                           interface, age_ms);
            }
        }
    }
}

/* ---- all ---- */

size_t doctor_examine(const struct doctor_config *config, struct doctor_finding *findings,
                      size_t max)
{
    static const struct {
        const char *subject;
        void (*examine)(struct doctor *d);
    } subjects[] = {
        {"kernel", examine_kernel},
        {"machine", examine_virtual_machine},
        {"clock source", examine_clock_source},
        {"RT throttling", examine_throttling},
        {"FIFO priority", examine_priority_right},
        {"locked memory", examine_memory_right},
        {"processor", examine_processor},
        {"interrupts", examine_interrupts},
        {"frequency", examine_governor},
        {"idle states", examine_idle_states},
        {"processor type", examine_capacity},
        {"supply", examine_supply},
        {"contact engine", examine_engine},
        {"CAN", examine_can},
        {"receive buffer", examine_receive_buffer},
        {"interface", examine_interfaces},
        {"bus load", examine_loads},
        {"external", examine_external},
    };
    struct doctor d = {.config = config,
                       .rig = config->rig,
                       .cpu = config->rig->realtime.cpu,
                       .findings = findings,
                       .max = max};

    for (size_t i = 0; i < ARRAY_COUNT(subjects); i++) {
        d.subject = subjects[i].subject;
        subjects[i].examine(&d);
    }
    return d.count;
}

enum doctor_verdict doctor_verdict(const struct doctor_finding *findings, size_t count)
{
    enum doctor_verdict worst = DOCTOR_OK;

    for (size_t i = 0; i < count; i++) {
        worst = findings[i].verdict > worst ? findings[i].verdict : worst;
    }
    return worst;
}

/* ---- the command ---- */

/* Measures wake-up latency: sleeps until each tick as the loop does, and prints the delays. */
static void doctor_measure_wakeups(const struct rig *rig, double seconds)
{
    struct realtime_config config = {.priority = rig->realtime.priority,
                                     .lock_memory = rig->realtime.lock_memory,
                                     .cpu = rig->realtime.cpu};
    static struct histogram late;
    struct realtime_report report;
    struct clock *clock = clock_monotonic();
    int64_t count = (int64_t)(seconds * 1e9 / (double)rig->tick_ns), deadline;

    /* Uses the scheduling of a run; drops deadlines that have passed, like the overrun policy
     * skip */
    realtime_apply(&config, &report);
    deadline = clock_now(clock) + rig->tick_ns;
    for (int64_t i = 0; i < count; i++, deadline += rig->tick_ns) {
        int64_t now;

        do {
            clock_sleep_until(clock, deadline);
            now = clock_now(clock);
        } while (now < deadline);
        histogram_add(&late, now - deadline);
        while (deadline + rig->tick_ns <= now) {
            deadline += rig->tick_ns;
        }
    }
    printf("%-5s%-15s%" PRId64
           " wake-ups%s: p50 %.0f us, p99 %.0f us, p99.9 %.0f us, max %.0f us\n",
           "", "measured", count, report.fifo ? ", FIFO" : ", normal thread",
           (double)histogram_percentile(&late, 0.5) * 1e-3,
           (double)histogram_percentile(&late, 0.99) * 1e-3,
           (double)histogram_percentile(&late, 0.999) * 1e-3, (double)late.max * 1e-3);
}

struct doctor_options {
    const char *rig;
    bool local;
    double measure_s, listen_s;
};

/* Examines the machine for a rig, prints all findings, and measures; returns the exit status. */
static int doctor_examine_rig(void *context, const struct rig *rig, struct arena *arena)
{
    static const char *const words[] = {"ok", "warn", "fail"};
    static struct doctor_finding findings[DOCTOR_FINDINGS_MAX];
    const struct doctor_options *options = context;
    struct can_port *port[RIG_BUSES_MAX] = {NULL};
    struct doctor_config config = {.root = "",
                                   .rig = rig,
                                   .local = options->local,
                                   .interfaces = &interface_kernel,
                                   .port = port,
                                   .listen_ns = (int64_t)(options->listen_s * 1e9),
                                   .clock = clock_monotonic(),
                                   .arena = arena};
    size_t count;

    if (!options->local) {
        /* Open ports on the interfaces of external boards. A port stays NULL if it cannot be
         * opened; the finding on its interface gives the reason. */
        for (size_t i = 0; i < rig->boards.nboard; i++) {
            const int bus = rig->boards.board[i].bus;
            const struct socketcan_config can = {.interface = rig->bus[bus].interface,
                                                 .fd = rig->bus[bus].fd};
            struct error error;

            if (rig->boards.board[i].external && !port[bus] &&
                socketcan_open(&can, arena, &port[bus], &error)) {
                port[bus] = NULL;
            }
        }
    }
    count = doctor_examine(&config, findings, DOCTOR_FINDINGS_MAX);
    for (size_t b = 0; b < rig->nbus; b++) {
        if (port[b]) {
            port[b]->ops->close(port[b]);
        }
    }
    for (size_t i = 0; i < count; i++) {
        printf("%-5s%-15s%s\n", words[findings[i].verdict], findings[i].subject, findings[i].found);
        if (findings[i].fix[0]) {
            printf("%20s-> %s\n", "", findings[i].fix);
        }
    }

    /* Print the implementation of the dynamics that a run would use now */
    struct error notice = {.text = ""}, error;
    struct dynamics dynamics;
    bool failed = dynamics_choose(rig->robot, rig->dynamics == RIG_DYNAMICS_GENERIC, arena,
                                  &dynamics, &notice, &error);

    printf("%-5s%-15s%s, hash %016" PRIx64 ": %s\n", failed ? "fail" : "ok", "robot",
           rig->robot->name, rig->robot->hash, failed ? error.text : notice.text);

    /* The measurement changes the scheduling of this process, so it comes last */
    if (options->measure_s > 0.0) {
        fflush(stdout);
        doctor_measure_wakeups(rig, options->measure_s);
    }
    return doctor_verdict(findings, count) == DOCTOR_FAIL ? STATUS_FAILED : STATUS_OK;
}

int cmd_doctor(int argc, char **argv)
{
    static struct doctor_options o = {.measure_s = 1.0, .listen_s = 1.0};
    static const struct option_spec options[] = {
        {"--measure", OPTION_REAL, "S", "measure wake-ups for S seconds, 1 by default; 0 does not",
         .value = &o.measure_s, .min = 0.0, .max = 3600.0, .unit = "seconds"},
        {"--listen", OPTION_REAL, "S",
         "listen for the rig's external boards for S seconds, 1 by default; 0 does not",
         .value = &o.listen_s, .min = 0.0, .max = 60.0, .unit = "seconds"},
        {"--local", OPTION_FLAG, NULL, "buses inside the process: skip CAN interfaces",
         .value = &o.local},
    };
    static const struct operand_spec operands[] = {
        {"RIG", "a rig's file or name", true, &o.rig, .noun = "rigs"}};
    static const struct command_spec spec = {
        .name = "doctor",
        .summary = "Say what keeps this machine from meeting a rig's deadlines.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_DOCTOR,
    };
    int status;

    return options_read(&spec, argc, argv, &status)
               ? rig_command("doctor", o.rig, &o, doctor_examine_rig)
               : status;
}
