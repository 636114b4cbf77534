/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The supervision of real CAN interfaces, on a controller that the test makes up: what virtual
 * interfaces and QEMU's controllers never do, bus-off above all, happens here, in virtual time.
 */
#include "sim/interfaces.h"
#include "tests/test.h"

#include <net/if_arp.h>

#define SECOND INT64_C(1000000000)

struct bench {
    struct link_info link; /* the controller */
    bool gone, refuses;    /* no such interface; takes no settings */
    int configured, restarted;
    struct interface_settings settings; /* of the last configuration */
    struct rig_bus bus;
    struct rig rig;
    const char *name;
    struct can_state_box box;
    struct interface_ops ops;
    struct interfaces interfaces;
    int64_t now_ns;
};

static enum error_code query(void *context, const char *name, struct link_info *info,
                             struct error *error)
{
    const struct bench *bench = context;

    if (bench->gone) {
        return error_set(error, ERROR_INPUT, "no interface %s", name);
    }
    *info = bench->link;
    return ERROR_NONE;
}

static enum error_code configure(void *context, const char *name,
                                 const struct interface_settings *settings, struct error *error)
{
    struct bench *bench = context;

    bench->configured++;
    if (bench->refuses) {
        return error_set(error, ERROR_SYSTEM, "no permission to set interface %s", name);
    }
    bench->settings = *settings;
    bench->link.up = true;
    bench->link.controller.state = CAN_STATE_ERROR_ACTIVE;
    bench->link.controller.timing.bitrate = (uint32_t)settings->bitrate;
    bench->link.controller.restart_ms = (uint32_t)settings->restart_ms;
    return ERROR_NONE;
}

static enum error_code restart(void *context, const char *name, struct error *error)
{
    struct bench *bench = context;

    (void)name;
    (void)error;
    bench->restarted++;
    bench->link.controller.state = CAN_STATE_ERROR_ACTIVE;
    return ERROR_NONE;
}

static void set_up(struct bench *bench)
{
    *bench = (struct bench){
        .link = {.index = 4,
                 .up = true,
                 .type = ARPHRD_CAN,
                 .mtu = 16,
                 .kind = "can",
                 .controller = {.timing = {.bitrate = 1000000, .sample_point = 750}}},
        .bus = {.name = "torso", .interface = "can0", .bitrate = 1000000},
        .name = "can0",
    };
    bench->rig = (struct rig){.nbus = 1, .bus = &bench->bus};
    bench->ops = (struct interface_ops){query, configure, restart, bench};
    interfaces_init(&bench->interfaces, &bench->rig, &bench->name, &bench->box, &bench->ops);
}

BENCH(set_up, struct bench, (void))

static enum error_code prepare(struct bench *bench, struct error *error)
{
    return interfaces_prepare(&bench->rig, &bench->name, &bench->ops, error);
}

static void assert_says(const char *text, const char *part)
{
    if (!strstr(text, part)) {
        fail_msg("\"%s\" does not say \"%s\"", text, part);
    }
}

/* A second later; the event that it brings must speak of this, "" = there must be none. */
static void look(struct bench *bench, const char *event)
{
    char text[INTERFACES_EVENT_TEXT] = "";
    size_t bus = 99;

    bench->now_ns += SECOND;
    interfaces_watch(&bench->interfaces, bench->now_ns);
    if (interfaces_next_event(&bench->interfaces, &bus, text, sizeof text)) {
        assert_int_equal(bus, 0);
        assert_false(interfaces_next_event(&bench->interfaces, &bus, text, sizeof text));
    }
    if (!event[0] && text[0]) {
        fail_msg("unexpected event \"%s\"", text);
    }
    assert_says(text, event);
}

TEST_ON(takes_an_interface_as_it_is_when_the_bit_rate_fits, set_up, bench)
{
    struct error error;

    bench->link.controller.timing.bitrate = 1004000; /* as near as some clocks come */
    assert_ok(prepare(bench, &error));
    assert_int_equal(bench->configured, 0);
}

TEST_ON(refuses_another_bit_rate_and_says_how_to_set_it, set_up, bench)
{
    struct error error;

    bench->link.controller.timing.bitrate = 500000;
    assert_int_equal(prepare(bench, &error), ERROR_INPUT);
    assert_says(error.text, "bus torso: interface can0 runs at 500000 bit/s, expected 1000000");
    assert_says(error.text, "ip link set can0 type can bitrate 1000000");
    assert_int_equal(bench->configured, 0);
}

TEST_ON(refuses_another_data_bit_rate_even_where_it_may_configure, set_up, bench)
{
    struct error error;

    bench->bus.fd = bench->bus.configure = true;
    bench->bus.data_bitrate = 8000000;
    assert_int_equal(prepare(bench, &error), ERROR_INPUT);
    assert_says(error.text, "dbitrate 8000000 fd on");
    bench->link.controller.data_timing.bitrate = 8000000;
    assert_ok(prepare(bench, &error));
}

TEST_ON(configures_what_differs_and_leaves_alone_what_does_not, set_up, bench)
{
    struct error error;

    bench->bus.configure = true;
    bench->bus.sample_point = 0.75;
    assert_ok(prepare(bench, &error));
    assert_int_equal(bench->configured, 0);
    bench->bus.restart_ms = 100;
    assert_ok(prepare(bench, &error));
    assert_int_equal(bench->configured, 1);
    assert_int_equal(bench->settings.restart_ms, 100);
    bench->link.up = false;
    assert_ok(prepare(bench, &error));
    assert_int_equal(bench->configured, 2);
    bench->link.up = false;
    bench->refuses = true;
    assert_int_equal(prepare(bench, &error), ERROR_SYSTEM);
}

TEST_ON(leaves_virtual_and_missing_interfaces_alone, set_up, bench)
{
    struct error error;

    bench->bus.configure = true;
    bench->link = (struct link_info){.index = 4, .up = true, .type = ARPHRD_CAN, .kind = "vcan"};
    assert_ok(prepare(bench, &error));
    look(bench, "");
    bench->gone = true;
    assert_ok(prepare(bench, &error));
    look(bench, "");
    assert_int_equal(bench->configured, 0);
    assert_int_equal(bench->box.post, 0);
}

TEST_ON(looks_once_a_second_and_posts_every_state, set_up, bench)
{
    static const struct {
        enum can_state state;
        enum can_port_state port;
    } cases[] = {
        {CAN_STATE_ERROR_ACTIVE, CAN_PORT_UP},
        {CAN_STATE_ERROR_WARNING, CAN_PORT_WARNING},
        {CAN_STATE_ERROR_PASSIVE, CAN_PORT_PASSIVE},
        {CAN_STATE_ERROR_PASSIVE, CAN_PORT_PASSIVE}, /* told again: a port may have missed it */
    };
    uint32_t last = 0;

    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        bench->link.controller.state = cases[i].state;
        look(bench, "");
        assert_int_not_equal(bench->box.post, last);
        assert_int_equal(bench->box.post & 0xff, cases[i].port);
        last = bench->box.post;
        interfaces_watch(&bench->interfaces, bench->now_ns + SECOND / 2);
        assert_int_equal(bench->box.post, last);
    }
    bench->link.controller.state = CAN_STATE_STOPPED;
    look(bench, "");
    assert_int_equal(bench->box.post, last);
}

TEST_ON(reports_bus_off_once_and_restarts_nothing_that_it_may_not_set, set_up, bench)
{
    bench->link.controller.state = CAN_STATE_BUS_OFF;
    look(bench, "is in bus-off until it is restarted");
    assert_int_equal(bench->box.post & 0xff, CAN_PORT_BUS_OFF);
    look(bench, "");
    bench->link.controller.state = CAN_STATE_ERROR_ACTIVE;
    look(bench, "");
    bench->bus.configure = true; /* but the kernel does it */
    bench->link.controller.restart_ms = 100;
    bench->link.controller.state = CAN_STATE_BUS_OFF;
    look(bench, "the kernel restarts it after 100 ms");
    assert_int_equal(bench->restarted, 0);
}

TEST_ON(restarts_at_most_ten_times_in_a_minute, set_up, bench)
{
    int64_t first;

    bench->bus.configure = true;
    first = bench->now_ns + SECOND;
    for (int i = 1; i <= INTERFACES_RESTARTS; i++) {
        bench->link.controller.state = CAN_STATE_BUS_OFF;
        look(bench, "restarted");
        assert_int_equal(bench->restarted, i);
    }
    bench->link.controller.state = CAN_STATE_BUS_OFF;
    look(bench, "again after 10 restarts in a minute, and waits");
    while (bench->now_ns + SECOND < first + 60 * SECOND) {
        look(bench, "");
    }
    assert_int_equal(bench->restarted, INTERFACES_RESTARTS);
    look(bench, "restarted, number 11");
    assert_int_equal(bench->restarted, INTERFACES_RESTARTS + 1);
}

TEST_ON(restores_the_bit_rate_of_what_was_changed_or_created_anew, set_up, bench)
{
    bench->bus.configure = true;
    look(bench, "");
    bench->link.controller.timing.bitrate = 250000;
    look(bench, "runs at 250000 bit/s: set again to 1000000");
    assert_int_equal(bench->configured, 1);
    look(bench, "");
    /* Somebody's will */
    bench->link.up = false;
    look(bench, "");
    assert_int_equal(bench->configured, 1);
    bench->gone = true;
    look(bench, "");
    bench->gone = false;
    bench->link.index = 7;
    bench->link.controller.timing.bitrate = 0;
    bench->refuses = true;
    look(bench, "was created anew and cannot be set again");
    bench->refuses = false;
    look(bench, "was created anew: set again");
    assert_true(bench->link.up);
    look(bench, "");
    assert_int_equal(bench->configured, 3);
}

TEST_ON(reports_a_changed_bit_rate_once_where_it_may_not_set_it, set_up, bench)
{
    look(bench, "");
    bench->link.controller.timing.bitrate = 250000;
    look(bench, "runs at 250000 bit/s, the rig says 1000000: it disturbs the bus");
    look(bench, "");
    bench->link.controller.timing.bitrate = 1000000;
    look(bench, "");
    bench->link.controller.timing.bitrate = 250000;
    look(bench, "disturbs the bus");
    assert_int_equal(bench->configured, 0);
}

TEST_ON(describes_a_controller, set_up, bench)
{
    char text[320];

    bench->link.controller.errors = (struct can_berr_counter){.txerr = 128, .rxerr = 7};
    bench->link.controller.state = CAN_STATE_ERROR_PASSIVE;
    bench->link.controller.stats.bus_off = 3;
    assert_true(interfaces_describe(&bench->interfaces, 0, text, sizeof text));
    assert_says(text, "error passive, 1000000 bit/s, sample point 0.750, TEC 128, REC 7");
    assert_says(text, "bus-off 3");
    assert_false(interfaces_describe(&bench->interfaces, 1, text, sizeof text));
}
