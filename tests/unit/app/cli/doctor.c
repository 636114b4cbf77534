/* SPDX-License-Identifier: Apache-2.0 */
/* What the doctor says of machines that the test makes up: trees of the files it reads. */
#include "app/cli/doctor/doctor.h"
#include "base/array.h"
#include "tests/test.h"

#include <sys/stat.h>
#include <unistd.h>

struct machine {
    char root[64];
    struct arena arena;
    struct rig rig;
    struct rig_bus bus;
    struct link_info link;
    struct doctor_finding finding[DOCTOR_FINDINGS_MAX];
    size_t count;
};

static void put(const struct machine *m, const char *name, const char *text)
{
    char path[512];
    FILE *file;

    snprintf(path, sizeof path, "%s%s", m->root, name);
    for (char *slash = strchr(path + strlen(m->root) + 1, '/'); slash;
         slash = strchr(slash + 1, '/')) {
        *slash = '\0';
        mkdir(path, 0755);
        *slash = '/';
    }
    file = fopen(path, "we");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void remove_file(const struct machine *m, const char *name)
{
    char path[512];

    snprintf(path, sizeof path, "%s%s", m->root, name);
    assert_int_equal(unlink(path), 0);
}

/* a laboratory machine as it should be */
static void put_good_machine(const struct machine *m)
{
    put(m, "/proc/sys/kernel/version", "#1 SMP PREEMPT_RT Debian 6.1.0\n");
    put(m, "/proc/sys/kernel/osrelease", "6.1.0-rt-amd64\n");
    put(m, "/sys/kernel/realtime", "1\n");
    put(m, "/proc/cpuinfo", "processor : 0\nflags\t\t: fpu avx2\n");
    put(m, "/sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n");
    put(m, "/proc/sys/kernel/sched_rt_runtime_us", "950000\n");
    put(m, "/proc/sys/kernel/sched_rt_period_us", "1000000\n");
    put(m, "/proc/self/status",
        "Name:\tcoman-hil\nCapEff:\t0000000000000000\nCpus_allowed_list:\t0-2\n");
    put(m, "/proc/self/limits",
        "Limit                     Soft Limit           Hard Limit           Units     \n"
        "Max locked memory         unlimited            unlimited            bytes     \n"
        "Max realtime priority     90                   90                             \n");
    put(m, "/sys/devices/system/cpu/online", "0-3\n");
    put(m, "/sys/devices/system/cpu/isolated", "3\n");
    put(m, "/proc/irq/24/effective_affinity_list", "0\n");
    put(m, "/sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "performance\n");
    put(m, "/sys/devices/system/cpu/cpu3/cpuidle/state0/latency", "1\n");
    put(m, "/sys/devices/system/cpu/cpu3/cpuidle/state0/name", "C1\n");
    put(m, "/proc/net/protocols", "protocol  size sockets\nCAN_RAW   1024 0\n");
    put(m, "/proc/sys/net/core/rmem_max", "4194304\n");
    put(m, "/sys/class/net/can0/type", "280\n");
    put(m, "/sys/class/net/can0/flags", "0x40c1\n");
    put(m, "/sys/class/net/can0/tx_queue_len", "1000\n");
}

static inline void start(struct machine *m)
{
    snprintf(m->root, sizeof m->root, "/tmp/hil-doctor-XXXXXX");
    if (!mkdtemp(m->root) || arena_init(&m->arena, 1 << 20, NULL)) {
        fail();
    }
    m->bus = (struct rig_bus){.name = "torso", .interface = "can0", .bitrate = 1000000};
    m->rig = (struct rig){.nbus = 1, .bus = &m->bus};
    m->rig.realtime = (struct rig_realtime){.priority = 80, .cpu = 3, .lock_memory = true};
    m->rig.servo.command_period_ns = 1000000;
    put_good_machine(m);
}

static inline void stop(struct machine *m)
{
    char command[128];

    snprintf(command, sizeof command, "rm -rf '%s'", m->root);
    arena_fini(&m->arena);
    assert_int_equal(system(command), 0);
}

/* the controller that the test makes up; one without a kind is none */
static enum error_code query(void *context, const char *name, struct link_info *info,
                             struct error *error)
{
    const struct machine *m = context;

    *info = m->link;
    return m->link.kind[0] ? ERROR_NONE : error_set(error, ERROR_INPUT, "no interface %s", name);
}

static enum doctor_verdict examine(struct machine *m)
{
    struct interface_ops interfaces = {.query = query, .context = m};
    struct doctor_config config = {.root = m->root, .rig = &m->rig, .interfaces = &interfaces};

    m->count = doctor_examine(&config, m->finding, DOCTOR_FINDINGS_MAX);
    return doctor_verdict(m->finding, m->count);
}

/* the finding on a subject has this verdict and speaks of this; the others are ok */
static void assert_only(struct machine *m, const char *subject, enum doctor_verdict verdict,
                        const char *words)
{
    bool seen = false;

    assert_int_equal(examine(m), verdict);
    for (size_t i = 0; i < m->count; i++) {
        const struct doctor_finding *f = &m->finding[i];

        if (strcmp(f->subject, subject) == 0 && f->verdict != DOCTOR_OK) {
            seen = true;
            assert_int_equal(f->verdict, verdict);
            if (!strstr(f->found, words)) {
                fail_msg("\"%s\" does not speak of \"%s\"", f->found, words);
            }
        } else if (f->verdict != DOCTOR_OK) {
            fail_msg("%s: %s", f->subject, f->found);
        }
    }
    assert_true(seen);
}

BENCH(start, struct machine, stop)

TEST_ON(finds_nothing_on_a_good_machine, start, m)
{
    assert_int_equal(examine(m), DOCTOR_OK);
    assert_int_equal(m->count, 14);
    for (size_t i = 0; i < m->count; i++) {
        assert_string_equal(m->finding[i].fix, "");
    }
}

TEST_ON(finds_the_module_of_a_contact_engine, start, m)
{
    m->rig.contact_engine = RIG_CONTACT_SIMBODY;
    assert_int_equal(examine(m), DOCTOR_OK);
    assert_int_equal(m->count, 15);
    for (size_t i = 0; i < m->count; i++) {
        if (strcmp(m->finding[i].subject, "contact engine") == 0) {
            assert_non_null(strstr(m->finding[i].found, "/coman-hil-simbody.so"));
            return;
        }
    }
    fail();
}

TEST_ON(sees_a_virtual_machine_in_a_long_list_of_flags, start, m)
{
    char text[3000] = "flags : ";

    while (strlen(text) < 2500) {
        strcat(text, "some_flag ");
    }
    strcat(text, "hypervisor lahf\n");
    put(m, "/proc/cpuinfo", text);
    assert_only(m, "machine", DOCTOR_WARN, "virtual");
}

TEST_ON(sees_missing_rights_but_not_with_the_capabilities, start, m)
{
    const char *limits =
        "Max locked memory         65536                65536                bytes\n"
        "Max realtime priority     0                    0\n";

    put(m, "/proc/self/limits", limits);
    assert_int_equal(examine(m), DOCTOR_WARN);
    put(m, "/proc/self/status", "CapEff:\t0000000000804000\nCpus_allowed_list:\t0-2\n");
    assert_int_equal(examine(m), DOCTOR_OK);
    put(m, "/proc/self/status", "CapEff:\t0000000000004000\nCpus_allowed_list:\t0-2\n");
    assert_only(m, "FIFO priority", DOCTOR_WARN, "80");
    m->rig.realtime.priority = 0;
    assert_int_equal(examine(m), DOCTOR_OK);
}

TEST_ON(judges_the_processor, start, m)
{
    put(m, "/sys/devices/system/cpu/isolated", "\n");
    put(m, "/proc/self/status", "CapEff:\t0\nCpus_allowed_list:\t0-3\n");
    assert_only(m, "processor", DOCTOR_WARN, "not isolated");
    put(m, "/proc/self/status", "CapEff:\t0\nCpus_allowed_list:\t0-2\n");
    assert_only(m, "processor", DOCTOR_FAIL, "may use 0-2");
    put(m, "/sys/devices/system/cpu/online", "0-1\n");
    assert_only(m, "processor", DOCTOR_FAIL, "there are 0-1");
    m->rig.realtime.cpu = -1;
    assert_only(m, "processor", DOCTOR_WARN, "names none");
}

TEST_ON(judges_interfaces, start, m)
{
    put(m, "/sys/class/net/can0/tx_queue_len", "10\n");
    assert_only(m, "interface", DOCTOR_WARN, "queues 10 frames");
    put(m, "/sys/devices/virtual/net/can0/type", "280\n");
    assert_int_equal(examine(m), DOCTOR_OK);
    put(m, "/sys/class/net/can0/flags", "0x40c0\n");
    assert_only(m, "interface", DOCTOR_FAIL, "is down");
    put(m, "/sys/class/net/can0/type", "1\n");
    assert_only(m, "interface", DOCTOR_FAIL, "no CAN interface");
    m->bus.interface = "can7";
    assert_only(m, "interface", DOCTOR_FAIL, "no such interface");
    put(m, "/proc/net/protocols", "protocol  size sockets\n");
    assert_only(m, "CAN", DOCTOR_WARN, "no CAN");
}

TEST_ON(judges_controllers, start, m)
{
    m->link = (struct link_info){.up = true, .type = 280, .kind = "can"};
    m->link.controller.timing.bitrate = 500000;
    assert_only(m, "controller", DOCTOR_FAIL, "runs at 500000 bit/s, the rig says 1000000");
    m->bus.configure = true;
    assert_only(m, "controller", DOCTOR_FAIL, "may not do");
    put(m, "/proc/self/status", "CapEff:\t0000000000001000\nCpus_allowed_list:\t0-2\n");
    assert_int_equal(examine(m), DOCTOR_OK);
    put(m, "/sys/class/net/can0/flags", "0x40c0\n");
    assert_int_equal(examine(m), DOCTOR_OK); /* a run starts it */
    put(m, "/sys/class/net/can0/flags", "0x40c1\n");
    m->link.controller.timing.bitrate = 1000000;
    m->bus.configure = false;
    assert_only(m, "controller", DOCTOR_WARN, "has no restart-ms");
    m->link.controller.restart_ms = 100;
    assert_int_equal(examine(m), DOCTOR_OK);
    m->link.controller.state = CAN_STATE_ERROR_PASSIVE;
    m->link.controller.errors.txerr = 128;
    assert_only(m, "controller", DOCTOR_WARN, "error passive (TEC 128, REC 0)");
    m->link.controller.state = CAN_STATE_BUS_OFF;
    assert_only(m, "controller", DOCTOR_FAIL, "is in bus-off");
}

/* what a Raspberry Pi 5 with its own system has instead, ready for real time */
static void put_raspberry_pi(const struct machine *m)
{
    put(m, "/proc/cpuinfo", "processor\t: 0\nBogoMIPS\t: 108.00\nCPU implementer\t: 0x41\n");
    put(m, "/proc/device-tree/model", "Raspberry Pi 5 Model B Rev 1.0");
    put(m, "/proc/device-tree/compatible", "raspberrypi,5-model-b");
    put(m, "/proc/sys/kernel/osrelease", "6.12.25+rpt-rpi-v8-rt\n");
    put(m, "/sys/devices/system/clocksource/clocksource0/current_clocksource",
        "arch_sys_counter\n");
    put(m, "/sys/class/hwmon/hwmon0/name", "cpu_thermal\n");
    put(m, "/sys/class/hwmon/hwmon2/name", "rpi_volt\n");
    put(m, "/sys/class/hwmon/hwmon2/in0_lcrit_alarm", "0\n");
    for (int cpu = 0; cpu < 4; cpu++) {
        char name[64];

        snprintf(name, sizeof name, "/sys/devices/system/cpu/cpu%d/cpu_capacity", cpu);
        put(m, name, "1024\n");
    }
}

/* the finding on a subject proposes a command with these words */
static void assert_fix(const struct machine *m, const char *subject, const char *words)
{
    for (size_t i = 0; i < m->count; i++) {
        if (strcmp(m->finding[i].subject, subject) == 0) {
            assert_non_null(strstr(m->finding[i].fix, words));
            return;
        }
    }
    fail_msg("nothing on %s", subject);
}

/* A file of a machine changes, and one subject has a warning; without a subject all is well. */
struct step {
    enum { SAME, NEW, NEW_PI } machine;
    const char *file, *text; /* text NULL: the file is removed */
    const char *subject, *words, *fix;
};

#define CLOCK "/sys/devices/system/clocksource/clocksource0/current_clocksource"
#define STATE1 "/sys/devices/system/cpu/cpu3/cpuidle/state1/"
#define ALARM "/sys/class/hwmon/hwmon2/in0_lcrit_alarm"

static const struct step steps[] = {
    {NEW, "/proc/sys/kernel/version", "#1 SMP PREEMPT_DYNAMIC Debian\n", NULL, NULL, NULL},
    {SAME, "/sys/kernel/realtime", "0\n", "kernel", "PREEMPT_DYNAMIC", "linux-image-rt-amd64"},
    {NEW, CLOCK, "hpet\n", "clock source", "hpet", "echo tsc"},
    {NEW, "/proc/sys/kernel/sched_rt_runtime_us", "500000\n", "RT throttling", "50 %", "sysctl"},
    {SAME, "/proc/sys/kernel/sched_rt_runtime_us", "-1\n", NULL, NULL, NULL},
    {NEW, "/proc/irq/25/effective_affinity_list", "2-3\n", "interrupts", "1 come", "irqbalance"},
    {SAME, "/proc/irq/26/effective_affinity_list", "3\n", "interrupts", "2 come to processor 3",
     ""},
    {NEW, "/sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "powersave\n", "frequency",
     "powersave", "cpupower"},
    {NEW, STATE1 "name", "C6\n", NULL, NULL, NULL},
    {SAME, STATE1 "latency", "133\n", "idle states", "C6 takes 133 us", "usermod"},
    {SAME, "/dev/cpu_dma_latency", "", NULL, NULL, NULL},
    {SAME, "/dev/cpu_dma_latency", NULL, "idle states", "cannot be written", ""},
    {SAME, STATE1 "disable", "0\n", "idle states", "C6 takes 133 us", ""},
    {SAME, STATE1 "disable", "1\n", NULL, NULL, NULL},
    {NEW, "/proc/sys/net/core/rmem_max", "212992\n", "receive buffer", "about 554 frames",
     "sysctl"},
    {SAME, "/proc/self/status", "CapEff:\t0000000000001000\nCpus_allowed_list:\t0-2\n", NULL, NULL,
     NULL},

    /* A Raspberry Pi, and boards that are nearly one */
    {NEW_PI, "/proc/sys/kernel/version", "#1 SMP PREEMPT Debian\n", NULL, NULL, NULL},
    {SAME, "/sys/kernel/realtime", "0\n", "kernel", "PREEMPT", "linux-image-rpi-v8-rt"},
    {SAME, "/proc/device-tree/model", "Some other board", "kernel", "PREEMPT",
     "linux-image-rt-arm64"},
    {NEW_PI, "/proc/self/status", "CapEff:\t0\nCpus_allowed_list:\t0-3\n", NULL, NULL, NULL},
    {SAME, "/sys/devices/system/cpu/isolated", "\n", "processor", "not isolated",
     "/boot/firmware/cmdline.txt"},
    {NEW_PI, "/sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "ondemand\n", "frequency",
     "ondemand", ""},
    {NEW_PI, ALARM, "1\n", "supply", "under-voltage", "a supply"},
    {SAME, ALARM, "0\n", NULL, NULL, NULL},
    {SAME, "/sys/devices/system/cpu/cpu3/cpu_capacity", "256\n", "processor type",
     "number 3 has 25 % of the speed of number 0", "cpu: 0"},
    {NEW_PI, CLOCK, "timer\n", "clock source", "timer", "arch_sys_counter"},
    {NEW_PI, "/proc/device-tree/compatible", "linux,dummy-virt", "machine", "virtual", ""},
    {NEW_PI, "/sys/class/dmi/id/sys_vendor", "QEMU\n", "machine", "virtual", ""},
    {NEW_PI, "/proc/device-tree/hypervisor/compatible", "linux,kvm", "machine", "virtual", ""},
};

TEST(judges_what_the_files_of_a_machine_say)
{
    static struct machine machine;
    struct machine *m = NULL;

    for (size_t i = 0; i < ARRAY_COUNT(steps); i++) {
        const struct step *step = &steps[i];

        print_message("# %s\n", step->file);
        if (step->machine) {
            if (m) {
                stop(m);
            }
            m = &machine;
            memset(m, 0, sizeof *m);
            start(m);
            if (step->machine == NEW_PI) {
                put_raspberry_pi(m);
                assert_int_equal(examine(m), DOCTOR_OK);
                assert_int_equal(m->count, 16); /* type of processor and supply on top */
            }
        }
        if (step->text) {
            put(m, step->file, step->text);
        } else {
            remove_file(m, step->file);
        }
        if (step->subject) {
            assert_only(m, step->subject, DOCTOR_WARN, step->words);
            assert_fix(m, step->subject, step->fix);
        } else {
            assert_int_equal(examine(m), DOCTOR_OK);
        }
    }
    stop(m);
}

TEST_ON(lives_in_an_empty_machine, start, m)
{
    snprintf(m->root, sizeof m->root, "/tmp/hil-doctor-none");
    assert_int_equal(examine(m), DOCTOR_FAIL); /* processor 3 of one */
}

TEST(reads_lists_of_processors)
{
    assert_true(doctor_list_has("0-3,6", 0));
    assert_true(doctor_list_has("0-3,6", 6));
    assert_false(doctor_list_has("0-3,6", 5));
    assert_true(doctor_list_has("12", 12));
    assert_false(doctor_list_has("", 0));
    assert_false(doctor_list_has("(null)", 0));
    assert_false(doctor_list_has("-3", 3));
    assert_false(doctor_list_has("1-", 0));
}
