/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Real CAN interfaces: two SJA1000 controllers on one bus, can0 and can1, behind the kernel's own
 * driver. Runs in QEMU (qemu/run.sh); elsewhere it is skipped, for it takes interfaces down.
 *
 * QEMU's controller acknowledges every frame itself and has no error counters, so nothing here gets
 * into bus-off by its own doing: tests/unit/sim/interfaces.c has those cases. After a remote frame
 * it reads its receive buffer from a wrong place for ever: there are none here. Queues fill because
 * the test runs above the interrupt threads, as the loop does, until it sleeps; then all of it is
 * on the other controller at once, whose buffer holds five frames. So bursts are counted where they
 * leave: a second port on the same interface hears what its controller has sent.
 */
#include "canbus/interface.h"

#include "base/array.h"
#include "sim/interfaces.h"
#include "tests/test.h"

#include <libsocketcan.h>
#include <sched.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { MANY = 512, MS = 1000 /* us */ };

static const struct interface_settings usual = {.bitrate = 1000000};

struct bench {
    struct arena arena;
    struct can_state_box box;
    struct can_port *a, *b; /* on can0 and can1 */
    struct can_port *sent;  /* on can0: hears what a has sent */
};

static bool run(const char *command)
{
    return system(command) == 0;
}

static void must(enum error_code code, const struct error *error)
{
    assert_no_error(code, error->text);
}

static void configure(const char *name, struct interface_settings settings)
{
    struct error error;

    must(interface_kernel.configure(NULL, name, &settings, &error), &error);
}

static struct link_info query(const char *name)
{
    struct link_info info;
    struct error error;

    must(interface_kernel.query(NULL, name, &info, &error), &error);
    return info;
}

static void assert_says(const char *text, const char *part)
{
    if (!strstr(text, part)) {
        fail_msg("\"%s\" does not say \"%s\"", text, part);
    }
}

static bool here(void)
{
    return getenv("HIL_QEMU") != NULL;
}

FIXTURE(set_up)
{
    static struct bench bench;
    struct socketcan_config config = {.interface = "can0", .controller = &bench.box};
    struct error error;

    if (!here()) {
        print_message("SKIP: takes real interfaces down, runs in QEMU only\n");
        return 0;
    }
    memset(&bench, 0, sizeof bench);
    *test_state = &bench;
    assert_true(run("ip link set can0 txqueuelen 1000 && ip link set can1 txqueuelen 1000"));
    configure("can0", usual);
    configure("can1", usual);
    must(arena_init(&bench.arena, 4 << 20, &error), &error);
    must(socketcan_open(&config, &bench.arena, &bench.a, &error), &error);
    config = (struct socketcan_config){.interface = "can1"};
    must(socketcan_open(&config, &bench.arena, &bench.b, &error), &error);
    config.interface = "can0";
    must(socketcan_open(&config, &bench.arena, &bench.sent, &error), &error);
    return 0;
}

FIXTURE(tear_down)
{
    struct bench *bench = *test_state;

    if (here()) {
        bench->a->ops->close(bench->a);
        bench->b->ops->close(bench->b);
        bench->sent->ops->close(bench->sent);
        arena_fini(&bench->arena);
    }
    return 0;
}

static struct bench *need_controllers(void **state)
{
    if (!here()) {
        skip();
    }
    return *state;
}

static struct bus_frame numbered(uint32_t id, uint32_t number)
{
    uint8_t data[8] = {0};

    put_u32_le(data, number);
    return frame_make(id, 8, data);
}

/* Lets both ports work until so many frames are at `to`, and a little longer. */
static size_t pump(struct can_port *from, struct can_port *to, struct bus_frame *frames,
                   size_t expected)
{
    struct bus_frame ignored[16];
    size_t count = 0;
    int rest = 20;

    for (int i = 0; i < 3000 && rest > 0 && count < MANY; i++) {
        can_receive(from, ignored, 16);
        count += can_receive(to, frames + count, MANY - count);
        rest -= count >= expected;
        usleep(MS);
    }
    return count;
}

static bool comes_to(struct can_port *port, enum can_port_state state)
{
    struct bus_frame ignored[16];

    for (int i = 0; i < 3000 && port->state != state; i++) {
        can_receive(port, ignored, 16);
        usleep(MS);
    }
    return port->state == state;
}

/* ---- settings ---- */

TEST_WITH(tells_controllers_from_virtual_interfaces, set_up, tear_down)
{
    struct link_info info;
    struct error error;

    need_controllers(test_state);
    assert_true(run("ip link add vcan0 type vcan && ip link set vcan0 up"));
    info = query("can0");
    assert_int_equal(interface_kind(&info), INTERFACE_CONTROLLER);
    info = query("vcan0");
    assert_int_equal(interface_kind(&info), INTERFACE_VIRTUAL);
    info = query("lo");
    assert_int_equal(interface_kind(&info), INTERFACE_NOT_CAN);
    assert_int_equal(interface_kernel.query(NULL, "can7", &info, &error), ERROR_INPUT);
    assert_int_equal(interface_kernel.configure(NULL, "vcan0", &usual, &error), ERROR_INPUT);
    assert_says(error.text, "vcan0 is of kind vcan, which has no controller");
    assert_int_equal(interface_stop("lo", &error), ERROR_INPUT);
    assert_int_equal(interface_start("can7", &error), ERROR_INPUT);
    assert_true(run("ip link del vcan0"));
}

/* What iproute2 says of can0. */
static void ask_ip(char *text, size_t size)
{
    FILE *ip = popen("ip -details -statistics link show can0", "r");

    assert_non_null(ip);
    text[fread(text, 1, size - 1, ip)] = '\0';
    pclose(ip);
}

TEST_WITH(reads_what_libsocketcan_and_ip_read, set_up, tear_down)
{
    struct can_bittiming timing;
    struct can_berr_counter errors;
    struct can_clock clock;
    struct link_info info;
    char text[4096], part[64];
    uint32_t restart_ms;
    int can_state;

    need_controllers(test_state);
    configure("can0", (struct interface_settings){500000, 0.8, 100});
    info = query("can0");
    assert_true(info.up);
    assert_int_equal(info.controller.timing.bitrate, 500000);
    assert_in_range(info.controller.timing.sample_point, 740, 860); /* in steps of 1/16 */
    assert_int_equal(info.controller.state, CAN_STATE_ERROR_ACTIVE);
    assert_int_equal(info.controller.restart_ms, 100);
    assert_int_equal(info.tx_queue, 1000);

    assert_int_equal(can_get_bittiming("can0", &timing), 0);
    assert_memory_equal(&timing, &info.controller.timing, sizeof timing);
    assert_int_equal(can_get_state("can0", &can_state), 0);
    assert_int_equal(can_state, info.controller.state);
    assert_int_equal(can_get_restart_ms("can0", &restart_ms), 0);
    assert_int_equal(restart_ms, 100);
    assert_int_equal(can_get_clock("can0", &clock), 0);
    assert_int_equal(clock.freq, info.controller.clock.freq);
    assert_int_equal(can_get_berr_counter("can0", &errors), 0);
    assert_true(info.controller.counts);
    assert_memory_equal(&errors, &info.controller.errors, sizeof errors);

    ask_ip(text, sizeof text);
    assert_says(text, "state ERROR-ACTIVE");
    assert_says(text, "restart-ms 100");
    snprintf(part, sizeof part, "bitrate 500000 sample-point %.3f",
             (double)info.controller.timing.sample_point * 1e-3);
    assert_says(text, part);
    snprintf(part, sizeof part, "clock %u", info.controller.clock.freq);
    assert_says(text, part);
}

TEST_WITH(refuses_settings_and_goes_on_with_those_it_had, set_up, tear_down)
{
    static const struct interface_settings wrong[] = {
        {.bitrate = 0},
        {.bitrate = 1000001},
        {.bitrate = 3}, /* the kernel's to refuse: no divider is that large */
        {.bitrate = 500000, .sample_point = 1.0},
        {.bitrate = 500000, .sample_point = -0.1},
        {.bitrate = 500000, .restart_ms = -1},
    };
    struct link_info before, after;
    struct error error;

    need_controllers(test_state);
    configure("can0", (struct interface_settings){250000, 0.875, 50});
    before = query("can0");
    for (size_t i = 0; i < ARRAY_COUNT(wrong); i++) {
        assert_int_not_equal(interface_kernel.configure(NULL, "can0", &wrong[i], &error),
                             ERROR_NONE);
        assert_says(error.text, "can0");
        after = query("can0");
        assert_true(after.up);
        assert_memory_equal(&after.controller.timing, &before.controller.timing,
                            sizeof before.controller.timing);
        assert_int_equal(after.controller.restart_ms, 50);
    }
}

TEST_WITH(says_which_right_is_missing, set_up, tear_down)
{
    struct error error;
    int status;
    pid_t child;

    need_controllers(test_state);
    child = fork();
    if (child == 0) {
        const bool refused =
            !setuid(1000) &&
            interface_kernel.configure(NULL, "can0", &usual, &error) == ERROR_SYSTEM &&
            strstr(error.text, "needs CAP_NET_ADMIN");

        _exit(refused ? 0 : 1);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
}

TEST_WITH(starts_stops_and_restarts_only_from_bus_off, set_up, tear_down)
{
    struct link_info info;
    struct error error;

    need_controllers(test_state);
    must(interface_stop("can0", &error), &error);
    info = query("can0");
    assert_false(info.up);
    assert_int_equal(info.controller.state, CAN_STATE_STOPPED);
    assert_int_equal(interface_kernel.restart(NULL, "can0", &error), ERROR_INPUT);
    assert_says(error.text, "can0 is down, expected bus-off");
    must(interface_start("can0", &error), &error);
    must(interface_start("can0", &error), &error);
    info = query("can0");
    assert_true(info.up);
    assert_int_equal(interface_kernel.restart(NULL, "can0", &error), ERROR_INPUT);
    assert_says(error.text, "can0 is error active, expected bus-off");
}

/* ---- frames ---- */

TEST_WITH(a_burst_into_a_short_queue_is_late_but_whole, set_up, tear_down)
{
    struct bench *bench = need_controllers(test_state);
    struct bus_frame sent[100], got[MANY];

    assert_true(run("ip link set can0 txqueuelen 10"));
    for (uint32_t i = 0; i < 100; i++) {
        sent[i] = numbered(0x100 + i, i);
    }
    assert_int_equal(can_send(bench->a, sent, 100), 100);
    /* More than the queue and the controller hold was left to be sent later */
    assert_int_equal(bench->a->counters.tx_frames + bench->a->counters.tx_held, 100);
    assert_in_range(bench->a->counters.tx_held, 1, 95);
    print_message("ENOBUFS after %d frames of 100\n", (int)bench->a->counters.tx_frames);
    assert_int_equal(bench->a->counters.tx_queue_full, 1);
    assert_int_equal(pump(bench->a, bench->sent, got, 100), 100);
    for (int i = 0; i < 100; i++) {
        assert_int_equal(got[i].id, sent[i].id);
    }
    assert_int_equal(bench->a->counters.tx_frames, 100);
    assert_int_equal(bench->a->counters.tx_dropped, 0);
    assert_int_equal(bench->a->state, CAN_PORT_UP);
}

TEST_WITH(of_periodic_frames_the_newest_waits_and_all_others_are_counted, set_up, tear_down)
{
    enum { IDS = 40, CYCLES = 30 };
    struct bench *bench = need_controllers(test_state);
    const struct can_counters *counters = &bench->a->counters;
    uint32_t last[IDS] = {0}, seen = 0;
    struct bus_frame cycle[IDS], got[MANY];
    size_t count;

    assert_true(run("ip link set can0 txqueuelen 10"));
    for (uint32_t c = 1; c <= CYCLES; c++) {
        for (uint32_t i = 0; i < IDS; i++) {
            cycle[i] = numbered(0x200 + i, c);
        }
        can_send(bench->a, cycle, IDS);
        usleep(MS / 2);
        count =
            c < CYCLES ? can_receive(bench->sent, got, MANY) : pump(bench->a, bench->sent, got, 0);
        for (size_t i = 0; i < count; i++, seen++) {
            const uint32_t number = get_u32_le(got[i].data);

            assert_true(number > last[got[i].id - 0x200]);
            last[got[i].id - 0x200] = number;
        }
    }
    for (int i = 0; i < IDS; i++) {
        assert_int_equal(last[i], CYCLES);
    }
    print_message("%d cycles of %d frames at once: %u sent, %d replaced, ENOBUFS %d times\n",
                  (int)CYCLES, (int)IDS, seen, (int)counters->tx_dropped,
                  (int)counters->tx_queue_full);
    assert_int_equal(seen, counters->tx_frames);
    assert_int_equal(counters->tx_frames + counters->tx_dropped, IDS * CYCLES);
    assert_true(counters->tx_dropped > 0);
}

TEST_WITH(backs_off_from_a_queue_that_does_not_empty_and_comes_back, set_up, tear_down)
{
    struct bench *bench = need_controllers(test_state);
    struct bus_frame frame[8], got[MANY];
    uint64_t attempts;
    uint32_t number = 0;
    size_t count;

    /* As a bus without another node would: what was queued stays there */
    assert_true(run("tc qdisc replace dev can0 root netem limit 4 delay 100s"));
    while (bench->a->state != CAN_PORT_STUCK && number < 3000) {
        number++;
        for (uint32_t i = 0; i < 8; i++) {
            frame[i] = numbered(0x300 + i, number);
        }
        can_send(bench->a, frame, 8);
        usleep(MS);
    }
    assert_int_equal(bench->a->state, CAN_PORT_STUCK);
    attempts = bench->a->counters.tx_queue_full;
    for (int i = 0; i < 1500; i++, number++) {
        frame[0] = numbered(0x300, number);
        assert_int_equal(can_send(bench->a, frame, 1), 1); /* kept */
        usleep(MS);
    }
    assert_int_equal(bench->a->state, CAN_PORT_STUCK);
    /* 10 + 20 + ... + 640 ms and then 1 s: seven or eight in so long, not 1500 */
    attempts = bench->a->counters.tx_queue_full - attempts;
    print_message("%d attempts in 1500 cycles of a stuck queue\n", (int)attempts);
    assert_in_range(attempts, 1, 10);
    assert_true(run("tc qdisc del dev can0 root"));
    assert_true(comes_to(bench->a, CAN_PORT_UP));
    /* What the other queue held is lost with it */
    count = pump(bench->a, bench->sent, got, 8);
    assert_int_equal(count, 8);
    for (size_t i = 0; i < count; i++) {
        if (got[i].id == 0x300) {
            assert_int_equal(get_u32_le(got[i].data), number - 1);
        }
    }
    assert_int_equal(bench->a->counters.down_events, 0);
}

/* ---- interfaces that come and go ---- */

/* One rig bus on can0, watched as a run does. */
struct watched {
    struct rig_bus bus;
    struct rig rig;
    const char *name;
    struct interfaces interfaces;
    int64_t now_ns;
};

static void watch(struct watched *w, struct bench *bench)
{
    *w = (struct watched){
        .bus = {.name = "torso", .interface = "can0", .bitrate = 1000000, .configure = true},
        .name = "can0",
    };
    w->rig = (struct rig){.nbus = 1, .bus = &w->bus};
    interfaces_init(&w->interfaces, &w->rig, &w->name, &bench->box, &interface_kernel);
}

static void look(struct watched *w, const char *event)
{
    char text[INTERFACES_EVENT_TEXT] = "";
    size_t bus;

    w->now_ns += 1000000000;
    interfaces_watch(&w->interfaces, w->now_ns);
    interfaces_next_event(&w->interfaces, &bus, text, sizeof text);
    assert_says(text, event);
    if (!event[0]) {
        assert_string_equal(text, "");
    }
}

TEST_WITH(a_changed_bit_rate_is_refused_before_and_restored_during_the_run, set_up, tear_down)
{
    struct bench *bench = need_controllers(test_state);
    struct bus_frame frame = numbered(0x123, 7), got[MANY];
    struct link_info info;
    struct watched w;
    struct error error;

    watch(&w, bench);
    look(&w, "");
    assert_true(run("ip link set can0 down && ip link set can0 type can bitrate 125000 && "
                    "ip link set can0 up"));
    w.bus.configure = false;
    assert_int_equal(interfaces_prepare(&w.rig, &w.name, &interface_kernel, &error), ERROR_INPUT);
    assert_says(error.text, "can0 runs at 125000 bit/s, expected 1000000");
    w.bus.configure = true;
    look(&w, "runs at 125000 bit/s: set again to 1000000 bit/s");
    look(&w, "");
    info = query("can0");
    assert_int_equal(info.controller.timing.bitrate, 1000000);
    assert_true(comes_to(bench->a, CAN_PORT_DOWN) || bench->a->state == CAN_PORT_UP);
    assert_true(comes_to(bench->a, CAN_PORT_UP));
    assert_int_equal(can_send(bench->a, &frame, 1), 1);
    assert_int_equal(pump(bench->a, bench->b, got, 1), 1);
}

TEST_WITH(what_was_removed_and_created_anew_is_set_and_used_again, set_up, tear_down)
{
    struct bench *bench = need_controllers(test_state);
    struct bus_frame frame = numbered(0x123, 7), got[MANY];
    struct link_info before = query("can0"), after;
    struct watched w;

    watch(&w, bench);
    look(&w, "");
    assert_true(run("echo 1 >/sys/class/net/can0/device/remove"));
    assert_true(comes_to(bench->a, CAN_PORT_GONE));
    look(&w, "");
    assert_int_equal(can_send(bench->a, &frame, 1), 0);
    assert_true(run("echo 1 >/sys/bus/pci/rescan"));
    after = query("can0");
    assert_int_not_equal(after.index, before.index);
    assert_false(after.up);
    look(&w, "was created anew: set again to 1000000 bit/s");
    assert_true(comes_to(bench->a, CAN_PORT_UP));
    after = query("can0");
    assert_int_equal(after.controller.timing.bitrate, 1000000);
    assert_int_equal(can_send(bench->a, &frame, 1), 1);
    assert_int_equal(pump(bench->a, bench->b, got, 1), 1);
    assert_int_equal(bench->a->counters.down_events, 1);
}

TEST_WITH(a_port_follows_what_is_asked_of_the_controller, set_up, tear_down)
{
    struct bench *bench = need_controllers(test_state);
    char text[320];
    struct watched w;

    watch(&w, bench);
    /* An error frame that announced a state, and none that announced its end */
    can_state_post(&bench->box, CAN_PORT_BUS_OFF);
    assert_true(comes_to(bench->a, CAN_PORT_BUS_OFF));
    look(&w, "");
    assert_true(comes_to(bench->a, CAN_PORT_UP));
    assert_true(interfaces_describe(&w.interfaces, 0, text, sizeof text));
    print_message("can0: %s\n", text);
    assert_says(text, "error active, 1000000 bit/s, sample point 0.750");
}

FIXTURE(take_the_processor)
{
    const struct sched_param priority = {.sched_priority = 80};

    return here() ? sched_setscheduler(0, SCHED_FIFO, &priority) : 0;
}

TEST_GROUP(take_the_processor, NULL)
