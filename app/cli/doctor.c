/* SPDX-License-Identifier: Apache-2.0 */
/* One function a finding; each reads what it judges. */
#include "app/cli/doctor.h"

#include <ctype.h>
#include <dirent.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum {
    TEXT = 512,
    PATH = 512,
    CAP_NET_ADMIN = 12,
    CAP_IPC_LOCK = 14,
    CAP_SYS_NICE = 23,
    ARPHRD_CAN = 280
};

/* A controller's queue that holds less than this loses frames when a tick's batch is sent. */
enum { SHORT_QUEUE = 100 };

/* Wake-up from a deeper state than this can cost a tick, us. */
enum { SLOW_STATE_US = 50 };

struct doctor {
    const struct doctor_config *config;
    struct doctor_finding *findings;
    size_t count, max;
};

/* ---- findings and files ---- */

static void __attribute__((format(printf, 5, 6)))
say(struct doctor *d, enum doctor_verdict verdict, const char *subject, const char *fix,
    const char *format, ...)
{
    struct doctor_finding *finding;
    va_list args;

    if (d->count == d->max) {
        return;
    }
    finding = &d->findings[d->count++];
    finding->verdict = verdict;
    finding->subject = subject;
    snprintf(finding->fix, sizeof finding->fix, "%s", fix);
    va_start(args, format);
    vsnprintf(finding->found, sizeof finding->found, format, args);
    va_end(args);
}

/* the first line of a file below the root, without its end; false when it cannot be read */
static bool __attribute__((format(printf, 4, 5)))
read_line(const struct doctor *d, char *text, size_t size, const char *format, ...)
{
    char path[PATH], name[PATH];
    va_list args;
    FILE *file;
    bool good;

    va_start(args, format);
    vsnprintf(name, sizeof name, format, args);
    va_end(args);
    if ((size_t)snprintf(path, sizeof path, "%s%s", d->config->root, name) >= sizeof path) {
        return false;
    }
    file = fopen(path, "re");
    if (!file) {
        return false;
    }
    good = fgets(text, (int)size, file) != NULL;
    fclose(file);
    if (good) {
        text[strcspn(text, "\n")] = '\0';
    }
    return good;
}

/* the rest of the line of a file that begins with key */
static bool read_entry(const struct doctor *d, const char *name, const char *key, char *text,
                       size_t size)
{
    char path[PATH], line[8192]; /* the processor's flags are that long */
    bool found = false;
    FILE *file;

    snprintf(path, sizeof path, "%s%s", d->config->root, name);
    file = fopen(path, "re");
    while (file && !found && fgets(line, sizeof line, file)) {
        found = strncmp(line, key, strlen(key)) == 0;
    }
    if (found) {
        const char *value = line + strlen(key);

        value += strspn(value, " \t:");
        snprintf(text, size, "%.*s", (int)strcspn(value, "\n"), value);
    }
    if (file) {
        fclose(file);
    }
    return found;
}

static bool may_write(const struct doctor *d, const char *name)
{
    char path[PATH];

    return (size_t)snprintf(path, sizeof path, "%s%s", d->config->root, name) < sizeof path &&
           access(path, W_OK) == 0;
}

static bool has_capability(const struct doctor *d, int capability)
{
    char text[TEXT];

    return read_entry(d, "/proc/self/status", "CapEff", text, sizeof text) &&
           (strtoull(text, NULL, 16) >> capability & 1) != 0;
}

/* the soft limit of a row of /proc/self/limits; -1 = unlimited, -2 = unknown */
static long long limit_of(const struct doctor *d, const char *row)
{
    char text[TEXT];

    if (!read_entry(d, "/proc/self/limits", row, text, sizeof text)) {
        return -2;
    }
    return strncmp(text, "unlimited", 9) == 0 ? -1 : strtoll(text, NULL, 10);
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

/* ---- the kernel ---- */

static void kernel(struct doctor *d)
{
    char version[TEXT] = "", release[TEXT] = "unknown", realtime[TEXT] = "";

    read_line(d, version, sizeof version, "/proc/sys/kernel/version");
    read_line(d, release, sizeof release, "/proc/sys/kernel/osrelease");
    read_line(d, realtime, sizeof realtime, "/sys/kernel/realtime");
    if (strcmp(realtime, "1") == 0 || strstr(version, "PREEMPT_RT")) {
        say(d, DOCTOR_OK, "kernel", "", "%.80s, fully preemptible (PREEMPT_RT)", release);
    } else {
        const char *model = strstr(version, "PREEMPT_DYNAMIC") ? "PREEMPT_DYNAMIC"
                            : strstr(version, "PREEMPT")       ? "PREEMPT"
                                                               : "not preemptible";

        say(d, DOCTOR_WARN, "kernel", "apt install linux-image-rt-amd64 && reboot",
            "%.80s is %s: wake-ups may be late by milliseconds", release, model);
    }
}

static void virtual_machine(struct doctor *d)
{
    char flags[4096];

    if (read_entry(d, "/proc/cpuinfo", "flags", flags, sizeof flags) &&
        strstr(flags, " hypervisor")) {
        say(d, DOCTOR_WARN, "machine", "",
            "virtual: its host may take the processor away at any time; use it for lockstep");
    } else {
        say(d, DOCTOR_OK, "machine", "", "no hypervisor seen");
    }
}

static void clock_source(struct doctor *d)
{
    static const char *const fast[] = {"tsc", "arch_sys_counter", "kvm-clock", "riscv_clocksource"};
    static const char file[] = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
    char text[64] = "unknown";
    bool good = false;

    read_line(d, text, sizeof text, "%s", file);
    for (size_t i = 0; i < sizeof fast / sizeof fast[0]; i++) {
        good = good || strcmp(text, fast[i]) == 0;
    }
    if (good) {
        say(d, DOCTOR_OK, "clock source", "", "%s, read without a system call", text);
    } else {
        say(d, DOCTOR_WARN, "clock source",
            "echo tsc > /sys/devices/system/clocksource/clocksource0/current_clocksource",
            "%s: reading the time is slow, and the loop reads it eight times a tick", text);
    }
}

static void throttling(struct doctor *d)
{
    char runtime[64], period[64];
    double share;

    if (!read_line(d, runtime, sizeof runtime, "/proc/sys/kernel/sched_rt_runtime_us") ||
        !read_line(d, period, sizeof period, "/proc/sys/kernel/sched_rt_period_us")) {
        say(d, DOCTOR_OK, "RT throttling", "", "the kernel has none");
        return;
    }
    share = 100.0 * strtod(runtime, NULL) / strtod(period, NULL);
    if (strtol(runtime, NULL, 10) < 0) {
        say(d, DOCTOR_OK, "RT throttling", "", "off");
    } else if (share >= 90.0) {
        say(d, DOCTOR_OK, "RT throttling", "", "after %.0f %% of a second: the loop stays below",
            share);
    } else {
        say(d, DOCTOR_WARN, "RT throttling", "sysctl kernel.sched_rt_runtime_us=950000",
            "stops real-time threads after %.0f %% of a period", share);
    }
}

/* ---- rights ---- */

static void priority_right(struct doctor *d)
{
    int wanted = d->config->rig->realtime.priority;
    long long limit = limit_of(d, "Max realtime priority");
    char fix[160];

    snprintf(fix, sizeof fix,
             "echo \"$USER - rtprio %d\" | sudo tee /etc/security/limits.d/coman-hil.conf, and log "
             "in anew",
             wanted);
    if (wanted == 0) {
        say(d, DOCTOR_OK, "FIFO priority", "", "the rig asks for none");
    } else if (has_capability(d, CAP_SYS_NICE) || limit == -1 || limit >= wanted) {
        say(d, DOCTOR_OK, "FIFO priority", "", "%d is allowed", wanted);
    } else {
        say(d, DOCTOR_WARN, "FIFO priority", fix,
            "the rig asks for %d, the limit is %lld: the loop runs as a normal thread", wanted,
            limit);
    }
}

static void memory_right(struct doctor *d)
{
    long long limit = limit_of(d, "Max locked memory");

    if (!d->config->rig->realtime.lock_memory) {
        say(d, DOCTOR_OK, "locked memory", "", "the rig asks for none");
    } else if (has_capability(d, CAP_IPC_LOCK) || limit == -1) {
        say(d, DOCTOR_OK, "locked memory", "", "allowed without limit");
    } else {
        say(d, DOCTOR_WARN, "locked memory",
            "echo \"$USER - memlock unlimited\" | sudo tee -a "
            "/etc/security/limits.d/coman-hil.conf, "
            "and log in anew",
            "at most %lld kB: pages may be swapped out", limit / 1024);
    }
}

/* ---- processors ---- */

static void processor(struct doctor *d)
{
    int cpu = d->config->rig->realtime.cpu;
    char online[TEXT] = "0", isolated[TEXT] = "", allowed[TEXT] = "", fix[160];

    read_line(d, online, sizeof online, "/sys/devices/system/cpu/online");
    read_line(d, isolated, sizeof isolated, "/sys/devices/system/cpu/isolated");
    read_entry(d, "/proc/self/status", "Cpus_allowed_list", allowed, sizeof allowed);
    snprintf(fix, sizeof fix,
             "add isolcpus=%d nohz_full=%d rcu_nocbs=%d to the kernel's command line", cpu, cpu,
             cpu);
    if (cpu < 0) {
        say(d, DOCTOR_WARN, "processor", "isolate one and name it in the rig: realtime: {cpu: N}",
            "the rig names none: the loop moves among %.60s with everything else", online);
    } else if (!doctor_list_has(online, cpu)) {
        say(d, DOCTOR_FAIL, "processor", "name one of them in the rig: realtime: {cpu: N}",
            "the rig wants number %d, there are %.60s", cpu, online);
    } else if (allowed[0] && !doctor_list_has(allowed, cpu) && !doctor_list_has(isolated, cpu)) {
        say(d, DOCTOR_FAIL, "processor", "run it outside of the taskset or cpuset",
            "the rig wants number %d, this process may use %.60s", cpu, allowed);
    } else if (!doctor_list_has(isolated, cpu)) {
        say(d, DOCTOR_WARN, "processor", fix, "number %d is not isolated from other processes",
            cpu);
    } else {
        say(d, DOCTOR_OK, "processor", "", "number %d, isolated", cpu);
    }
}

/* interrupts that may come to the loop's processor */
static void interrupts(struct doctor *d)
{
    int cpu = d->config->rig->realtime.cpu, count = 0;
    char path[PATH], text[TEXT], fix[160];
    struct dirent *entry;
    DIR *directory;

    if (cpu < 0) {
        return;
    }
    snprintf(path, sizeof path, "%s/proc/irq", d->config->root);
    directory = opendir(path);
    while (directory && (entry = readdir(directory)) != NULL) {
        if (isdigit((unsigned char)entry->d_name[0]) &&
            read_line(d, text, sizeof text, "/proc/irq/%.20s/effective_affinity_list",
                      entry->d_name) &&
            doctor_list_has(text, cpu)) {
            count++;
        }
    }
    if (directory) {
        closedir(directory);
    }
    snprintf(
        fix, sizeof fix,
        "systemctl disable --now irqbalance; add irqaffinity= with the other processors to the "
        "kernel's command line");
    if (count > 0) {
        say(d, DOCTOR_WARN, "interrupts", fix, "%d come to processor %d", count, cpu);
    } else {
        say(d, DOCTOR_OK, "interrupts", "", "none come to processor %d", cpu);
    }
}

static void governor(struct doctor *d)
{
    int cpu = d->config->rig->realtime.cpu < 0 ? 0 : d->config->rig->realtime.cpu;
    char text[64];

    if (!read_line(d, text, sizeof text, "/sys/devices/system/cpu/cpu%d/cpufreq/scaling_governor",
                   cpu)) {
        say(d, DOCTOR_OK, "frequency", "", "not scaled by this kernel");
    } else if (strcmp(text, "performance") == 0) {
        say(d, DOCTOR_OK, "frequency", "", "governor performance");
    } else {
        say(d, DOCTOR_WARN, "frequency", "cpupower frequency-set -g performance",
            "governor %s: a tick after an idle time runs slow", text);
    }
}

/* the slowest idle state that may be entered; the loop holds /dev/cpu_dma_latency when it may */
static void idle_states(struct doctor *d)
{
    int cpu = d->config->rig->realtime.cpu < 0 ? 0 : d->config->rig->realtime.cpu;
    char latency[64], disabled[64], name[64] = "", slowest[64] = "none";
    long worst = 0;

    for (int i = 0; i < 16; i++) {
        if (!read_line(d, latency, sizeof latency,
                       "/sys/devices/system/cpu/cpu%d/cpuidle/state%d/latency", cpu, i)) {
            break;
        }
        if (read_line(d, disabled, sizeof disabled,
                      "/sys/devices/system/cpu/cpu%d/cpuidle/state%d/disable", cpu, i) &&
            strcmp(disabled, "0") != 0) {
            continue;
        }
        if (strtol(latency, NULL, 10) > worst) {
            worst = strtol(latency, NULL, 10);
            read_line(d, name, sizeof name, "/sys/devices/system/cpu/cpu%d/cpuidle/state%d/name",
                      cpu, i);
            snprintf(slowest, sizeof slowest, "%s", name);
        }
    }
    if (worst > SLOW_STATE_US && may_write(d, "/dev/cpu_dma_latency")) {
        say(d, DOCTOR_OK, "idle states", "",
            "slowest %s, %ld us to leave: a run in real time holds it off", slowest, worst);
    } else if (worst > SLOW_STATE_US) {
        say(d, DOCTOR_WARN, "idle states",
            "groupadd -r realtime; usermod -aG realtime $USER; cp "
            "/usr/share/doc/coman-hil/examples/"
            "80-coman-hil-can.rules /etc/udev/rules.d/; udevadm trigger",
            "%s takes %ld us to leave, and /dev/cpu_dma_latency cannot be written", slowest, worst);
    } else {
        say(d, DOCTOR_OK, "idle states", "", "slowest %s, %ld us to leave", slowest, worst);
    }
}

/* ---- buses ---- */

static bool interface_is_virtual(const struct doctor *d, const char *interface)
{
    char text[64];

    return read_line(d, text, sizeof text, "/sys/devices/virtual/net/%s/type", interface);
}

static void interface(struct doctor *d, const struct rig_bus *bus)
{
    const char *name = bus->interface;
    char type[64], flags[64] = "0", queue[64] = "0", fix[192];
    bool up, is_virtual = interface_is_virtual(d, name);

    if (!read_line(d, type, sizeof type, "/sys/class/net/%s/type", name)) {
        snprintf(fix, sizeof fix, "ip link add dev %s type vcan && ip link set up %s", name, name);
        say(d, DOCTOR_FAIL, "interface", fix, "%s of bus %s: there is no such interface", name,
            bus->name);
        return;
    }
    read_line(d, flags, sizeof flags, "/sys/class/net/%s/flags", name);
    read_line(d, queue, sizeof queue, "/sys/class/net/%s/tx_queue_len", name);
    up = (strtoul(flags, NULL, 16) & 1) != 0;
    if (strtol(type, NULL, 10) != ARPHRD_CAN) {
        say(d, DOCTOR_FAIL, "interface", "name another one: run --bus NAME=INTERFACE",
            "%s of bus %s is no CAN interface", name, bus->name);
    } else if (!up && is_virtual) {
        snprintf(fix, sizeof fix, "ip link set up %s", name);
        say(d, DOCTOR_FAIL, "interface", fix, "%s of bus %s is down", name, bus->name);
    } else if (!up && bus->configure && has_capability(d, CAP_NET_ADMIN)) {
        say(d, DOCTOR_OK, "interface", "",
            "%s of bus %s is down: a run sets it to %" PRId64 " bit/s and starts it", name,
            bus->name, bus->bitrate);
    } else if (!up) {
        snprintf(fix, sizeof fix, "ip link set %s up type can bitrate %" PRId64 " restart-ms 100",
                 name, bus->bitrate);
        say(d, DOCTOR_FAIL, "interface", fix, "%s of bus %s is down", name, bus->name);
    } else if (!is_virtual && strtol(queue, NULL, 10) < SHORT_QUEUE) {
        snprintf(fix, sizeof fix, "ip link set %s txqueuelen 1000", name);
        say(d, DOCTOR_WARN, "interface", fix,
            "%s of bus %s queues %s frames only: a tick's batch may be lost", name, bus->name,
            queue);
    } else {
        say(d, DOCTOR_OK, "interface", "", "%s of bus %s is up%s", name, bus->name,
            is_virtual ? ", virtual" : "");
    }
}

/* whether a controller runs at another bit rate than the rig says; then what follows is said */
static bool bitrate_is_wrong(struct doctor *d, const struct rig_bus *bus,
                             const struct link_info *info)
{
    const uint32_t actual = info->controller.timing.bitrate;
    char fix[192];

    if (interface_bitrate_fits(actual, bus->bitrate)) {
        return false;
    }
    snprintf(fix, sizeof fix,
             "ip link set %s down && ip link set %s type can bitrate %" PRId64
             " && ip link set %s up, or configure: true in the rig",
             bus->interface, bus->interface, bus->bitrate, bus->interface);
    if (!bus->configure) {
        say(d, DOCTOR_FAIL, "controller", fix,
            "%s of bus %s runs at %u bit/s, the rig says %" PRId64, bus->interface, bus->name,
            actual, bus->bitrate);
    } else if (!has_capability(d, CAP_NET_ADMIN)) {
        say(d, DOCTOR_FAIL, "controller", "run it with CAP_NET_ADMIN",
            "%s of bus %s is to be set to %" PRId64 " bit/s, which this process may not do",
            bus->interface, bus->name, bus->bitrate);
    } else {
        say(d, DOCTOR_OK, "controller", "",
            "%s of bus %s runs at %u bit/s: a run sets it to %" PRId64, bus->interface, bus->name,
            actual, bus->bitrate);
    }
    return true;
}

/* A controller that runs; what the files do not tell. */
static void controller(struct doctor *d, const struct rig_bus *bus)
{
    const struct interface_ops *ops = d->config->interfaces;
    const char *name = bus->interface;
    const struct link_controller *c;
    struct link_info info;
    char fix[192];

    if (!ops || ops->query(ops->context, name, &info, NULL) || !info.up ||
        interface_kind(&info) != INTERFACE_CONTROLLER || bitrate_is_wrong(d, bus, &info)) {
        return;
    }
    c = &info.controller;
    if (c->state == CAN_STATE_BUS_OFF) {
        snprintf(fix, sizeof fix, "check cable and terminators; ip link set %s type can restart",
                 name);
        say(d, DOCTOR_FAIL, "controller", fix, "%s of bus %s is in bus-off", name, bus->name);
    } else if (c->state != CAN_STATE_ERROR_ACTIVE) {
        say(d, DOCTOR_WARN, "controller",
            "check cable, terminators, and that another node is on with the same bit rate",
            "%s of bus %s is %s (TEC %u, REC %u)", name, bus->name, interface_state_name(c->state),
            c->errors.txerr, c->errors.rxerr);
    } else if (!c->restart_ms && !bus->configure) {
        snprintf(fix, sizeof fix, "ip link set %s down; ip link set %s up type can restart-ms 100",
                 name, name);
        say(d, DOCTOR_WARN, "controller", fix,
            "%s of bus %s stays in bus-off once it is there: it has no restart-ms", name,
            bus->name);
    } else {
        say(d, DOCTOR_OK, "controller", "", "%s of bus %s is error active at %u bit/s", name,
            bus->name, c->timing.bitrate);
    }
}

/* What waits for a loop that is held up: without the capability a buffer is as large as the kernel
 * allows everybody. */
static void receive_buffer(struct doctor *d)
{
    enum { WANTED = 4 << 20, FRAME_COST = 384 /* of that size, with the kernel's own account */ };
    char text[TEXT];
    long long most;

    if (has_capability(d, CAP_NET_ADMIN) ||
        !read_line(d, text, sizeof text, "/proc/sys/net/core/rmem_max")) {
        return;
    }
    most = strtoll(text, NULL, 10);
    if (most < WANTED) {
        say(d, DOCTOR_WARN, "receive buffer", "sysctl -w net.core.rmem_max=4194304",
            "%lld bytes, about %lld frames, wait for the loop at most; what else comes is lost, and "
            "counted",
            most, most / FRAME_COST);
    } else {
        say(d, DOCTOR_OK, "receive buffer", "", "%lld bytes of frames may wait for the loop", most);
    }
}

static void kernel_can(struct doctor *d)
{
    char text[TEXT];

    /* the protocol family is registered when the module has been loaded */
    if (!read_entry(d, "/proc/net/protocols", "CAN_RAW", text, sizeof text) &&
        !read_line(d, text, sizeof text, "/proc/net/can/version")) {
        say(d, DOCTOR_WARN, "CAN", "modprobe can-raw vcan",
            "the kernel has no CAN now: buses stay inside the process");
        return;
    }
    say(d, DOCTOR_OK, "CAN", "", "the kernel has raw CAN sockets");
    receive_buffer(d);
    for (size_t i = 0; i < d->config->rig->nbus; i++) {
        interface(d, &d->config->rig->bus[i]);
        controller(d, &d->config->rig->bus[i]);
    }
}

static void bus_budget(struct doctor *d, size_t bus)
{
    const struct rig *rig = d->config->rig;
    double telemetry, commands, percent;

    rig_bus_load(rig, bus, rig->servo.command_period_ns, &telemetry, &commands);
    percent = 100.0 * (telemetry + commands) / (double)rig->bus[bus].bitrate;
    if (percent > 100.0) {
        say(d, DOCTOR_WARN, "bus load", "coman-hil check tells which split or rate fits",
            "%s needs %.0f %% of its wire in the worst case", rig->bus[bus].name, percent);
    } else {
        say(d, DOCTOR_OK, "bus load", "", "%s needs %.0f %% of its wire in the worst case",
            rig->bus[bus].name, percent);
    }
}

size_t doctor_examine(const struct doctor_config *config, struct doctor_finding *findings,
                      size_t max)
{
    struct doctor d = {.config = config, .findings = findings, .max = max};

    kernel(&d);
    virtual_machine(&d);
    clock_source(&d);
    throttling(&d);
    priority_right(&d);
    memory_right(&d);
    processor(&d);
    interrupts(&d);
    governor(&d);
    idle_states(&d);
    if (!config->local) {
        kernel_can(&d);
    }
    for (size_t i = 0; i < config->rig->nbus; i++) {
        bus_budget(&d, i);
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
