/* SPDX-License-Identifier: Apache-2.0 */
/* Answers of the kernel about an interface, right and wrong. */
#include "base/array.h"
#include "canbus/link.h"
#include "tests/test.h"

#include <errno.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <unistd.h>

/* An answer under construction, as large as the kernel's. */
struct answer {
    _Alignas(struct nlmsghdr) char bytes[1024];
    size_t size;
};

static struct nlmsghdr *header_of(struct answer *answer)
{
    return (struct nlmsghdr *)(void *)answer->bytes;
}

static void begin(struct answer *answer, unsigned flags)
{
    const struct ifinfomsg link = {.ifi_index = 7, .ifi_flags = flags, .ifi_type = ARPHRD_CAN};

    memset(answer, 0, sizeof *answer);
    memcpy(answer->bytes + NLMSG_HDRLEN, &link, sizeof link);
    answer->size = NLMSG_LENGTH(sizeof link);
    header_of(answer)->nlmsg_type = RTM_NEWLINK;
    header_of(answer)->nlmsg_len = (uint32_t)answer->size;
}

/* Where the attribute begins, for end_nested. */
static size_t put(struct answer *answer, uint16_t type, const void *data, size_t size)
{
    const size_t at = answer->size = NLMSG_ALIGN(answer->size);
    const struct rtattr attribute = {.rta_len = (uint16_t)RTA_LENGTH(size), .rta_type = type};

    memcpy(answer->bytes + at, &attribute, sizeof attribute);
    if (size > 0) {
        memcpy(answer->bytes + at + RTA_LENGTH(0), data, size);
    }
    answer->size += RTA_LENGTH(size);
    header_of(answer)->nlmsg_len = (uint32_t)answer->size;
    return at;
}

/* What was put since an attribute stands in it. */
static void end_nested(struct answer *answer, size_t at)
{
    const uint16_t size = (uint16_t)(answer->size - at);

    memcpy(answer->bytes + at, &size, sizeof size);
}

/* A controller at 1 Mbit/s in error passive, as a driver with error counters tells it. */
static void put_controller(struct answer *answer, const char *kind)
{
    const struct can_bittiming timing = {.bitrate = 1000000, .sample_point = 750};
    const struct can_berr_counter errors = {.txerr = 128, .rxerr = 3};
    const struct can_device_stats stats = {.bus_off = 2};
    const uint32_t state = CAN_STATE_ERROR_PASSIVE, restart_ms = 100;
    size_t info, data;

    info = put(answer, IFLA_LINKINFO | NLA_F_NESTED, NULL, 0);
    put(answer, IFLA_INFO_KIND, kind, strlen(kind) + 1);
    data = put(answer, IFLA_INFO_DATA, NULL, 0);
    put(answer, IFLA_CAN_STATE, &state, sizeof state);
    put(answer, IFLA_CAN_BITTIMING, &timing, sizeof timing);
    put(answer, IFLA_CAN_RESTART_MS, &restart_ms, sizeof restart_ms);
    put(answer, IFLA_CAN_BERR_COUNTER, &errors, sizeof errors);
    end_nested(answer, data);
    put(answer, IFLA_INFO_XSTATS, &stats, sizeof stats);
    end_nested(answer, info);
}

TEST(an_interface_has_what_its_answer_says)
{
    const uint32_t mtu = 72, tx_queue = 10;
    struct answer answer;
    struct link_info info;

    begin(&answer, IFF_UP);
    put(&answer, IFLA_MTU, &mtu, sizeof mtu);
    put(&answer, IFLA_TXQLEN, &tx_queue, sizeof tx_queue);
    put_controller(&answer, "can");
    assert_int_equal(link_parse(answer.bytes, answer.size, &info), 0);
    assert_int_equal(info.index, 7);
    assert_true(info.up);
    assert_int_equal(info.type, ARPHRD_CAN);
    assert_int_equal(info.mtu, 72);
    assert_int_equal(info.tx_queue, 10);
    assert_string_equal(info.kind, "can");
    assert_int_equal(info.controller.state, CAN_STATE_ERROR_PASSIVE);
    assert_int_equal(info.controller.timing.bitrate, 1000000);
    assert_int_equal(info.controller.timing.sample_point, 750);
    assert_int_equal(info.controller.restart_ms, 100);
    assert_true(info.controller.counts);
    assert_int_equal(info.controller.errors.txerr, 128);
    assert_int_equal(info.controller.stats.bus_off, 2);
}

TEST(what_an_answer_leaves_out_is_zero)
{
    struct answer answer;
    struct link_info info;

    begin(&answer, 0);
    assert_int_equal(link_parse(answer.bytes, answer.size, &info), 0);
    assert_false(info.up);
    assert_int_equal(info.mtu, 0);
    assert_string_equal(info.kind, "");
    assert_false(info.controller.counts);
}

TEST(only_controllers_have_the_attributes_of_one)
{
    struct answer answer;
    struct link_info info;

    begin(&answer, IFF_UP);
    put_controller(&answer, "vcan");
    assert_int_equal(link_parse(answer.bytes, answer.size, &info), 0);
    assert_string_equal(info.kind, "vcan");
    assert_int_equal(info.controller.timing.bitrate, 0);
    assert_int_equal(info.controller.stats.bus_off, 0);
}

TEST(long_kinds_and_unknown_states_stay_in_bounds)
{
    const uint32_t unknown = 99, stopped = CAN_STATE_SLEEPING, beyond = CAN_STATE_MAX;
    struct answer answer;
    struct link_info info;
    size_t nested, data;

    begin(&answer, IFF_UP);
    put_controller(&answer, "a kind of more than sixteen letters");
    assert_int_equal(link_parse(answer.bytes, answer.size, &info), 0);
    assert_string_equal(info.kind, "a kind of more ");

    begin(&answer, IFF_UP);
    nested = put(&answer, IFLA_LINKINFO, NULL, 0);
    put(&answer, IFLA_INFO_KIND, "can", 4);
    data = put(&answer, IFLA_INFO_DATA, NULL, 0);
    put(&answer, IFLA_CAN_STATE, &unknown, sizeof unknown);
    put(&answer, IFLA_CAN_RESTART_MS, &unknown, 2); /* too short */
    put(&answer, IFLA_CAN_BERR_COUNTER, &unknown, 3);
    put(&answer, IFLA_CAN_STATE, &stopped, sizeof stopped);
    put(&answer, IFLA_CAN_STATE, &beyond, sizeof beyond);
    end_nested(&answer, data);
    put(&answer, IFLA_INFO_KIND, "", 0); /* changes nothing */
    end_nested(&answer, nested);
    put(&answer, IFLA_MTU, &unknown, 3);
    assert_int_equal(link_parse(answer.bytes, answer.size, &info), 0);
    assert_int_equal(info.controller.state, CAN_STATE_SLEEPING);
    assert_int_equal(info.controller.restart_ms, 0);
    assert_false(info.controller.counts);
    assert_int_equal(info.controller.errors.txerr, 0);
    assert_int_equal(info.mtu, 0);
    assert_string_equal(info.kind, "can");
}

TEST(an_error_of_the_kernel_is_its_number)
{
    /* Numbers of errors are negative, and no error is one too */
    static const struct {
        int error, result;
    } cases[] = {{-ENODEV, ENODEV},
                 {-1, 1},
                 {-INT16_MAX, INT16_MAX},
                 {0, EPROTO},
                 {1, EPROTO},
                 {-INT16_MAX - 1, EPROTO},
                 {INT32_MIN, EPROTO},
                 {INT32_MAX, EPROTO}};
    struct answer answer;
    struct link_info info;

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        const struct nlmsgerr failure = {.error = cases[i].error};

        begin(&answer, 0);
        header_of(&answer)->nlmsg_type = NLMSG_ERROR;
        header_of(&answer)->nlmsg_len = NLMSG_LENGTH(sizeof failure);
        memcpy(answer.bytes + NLMSG_HDRLEN, &failure, sizeof failure);
        assert_int_equal(link_parse(answer.bytes, sizeof answer.bytes, &info), cases[i].result);
    }
    header_of(&answer)->nlmsg_len = NLMSG_LENGTH(sizeof(struct nlmsgerr)) - 1;
    assert_int_equal(link_parse(answer.bytes, sizeof answer.bytes, &info), EPROTO);
}

TEST(answers_of_another_length_or_type_are_refused)
{
    struct answer answer;
    struct link_info info;

    begin(&answer, IFF_UP);
    for (size_t size = 0; size < answer.size; size++) {
        assert_int_equal(link_parse(answer.bytes, size, &info), EPROTO);
    }
    header_of(&answer)->nlmsg_len = NLMSG_LENGTH(sizeof(struct ifinfomsg)) - 1;
    assert_int_equal(link_parse(answer.bytes, answer.size, &info), EPROTO);
    begin(&answer, IFF_UP);
    header_of(&answer)->nlmsg_type = RTM_DELLINK;
    assert_int_equal(link_parse(answer.bytes, answer.size, &info), EPROTO);
}

/* Every system has lo, which is no CAN interface. A second question gets its own answer, although
 * the first one's was not the last in the socket. */
TEST(the_kernel_is_asked_by_name)
{
    const int descriptor = link_open();
    struct link_info info;

    if (descriptor < 0) {
        print_message("SKIP: no netlink socket\n");
        skip();
    }
    for (int i = 0; i < 2; i++) {
        assert_int_equal(link_query(descriptor, "lo", &info), 0);
        assert_int_equal(info.type, ARPHRD_LOOPBACK);
        assert_true(info.index > 0 && info.mtu > 0);
        assert_int_equal(link_query(descriptor, "hil_none", &info), ENODEV);
    }
    assert_int_equal(link_query(descriptor, "", &info), ENODEV);
    assert_int_equal(link_query(descriptor, "sixteen_letters_", &info), ENODEV);
    close(descriptor);
}
