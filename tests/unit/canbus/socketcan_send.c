/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Sending to a queue that is full, without a kernel that has CAN: a socket that takes so many
 * frames and then fails on order, and a clock that a test sets.
 */
#include "canbus/socketcan.c"

#include "base/array.h"
#include "tests/test.h"

enum { TAKEN_MAX = 1024, SOCKET = 77 };

#define MS INT64_C(1000000)

/* ---- the socket and the clock ---- */

static struct {
    int64_t now_ns;
    size_t room;     /* frames that the queue takes before it is full */
    int full;        /* what it says then: ENOBUFS, or another errno */
    uint32_t refuse; /* it never takes this identifier, 0 = all */
    int calls;
    struct canfd_frame frame[TAKEN_MAX];
    size_t size[TAKEN_MAX], count;
} fake;

int __wrap_sendmmsg(int descriptor, struct mmsghdr *message, unsigned count, int flags);
int __wrap_recvmmsg(int descriptor, struct mmsghdr *message, unsigned count, int flags,
                    struct timespec *timeout);
int __wrap_clock_gettime(clockid_t clock, struct timespec *now);

int __wrap_sendmmsg(int descriptor, struct mmsghdr *message, unsigned count, int flags)
{
    int sent = 0;

    assert_int_equal(descriptor, SOCKET);
    assert_int_equal(flags, MSG_DONTWAIT);
    assert_in_range(count, 1, SOCKETCAN_BATCH);
    fake.calls++;
    for (unsigned i = 0; i < count; i++, sent++) {
        const struct iovec *vector = message[i].msg_hdr.msg_iov;
        const struct canfd_frame *frame = vector->iov_base;
        bool refused = fake.refuse && (frame->can_id & CAN_EFF_MASK) == fake.refuse;

        if (refused || fake.room == 0) {
            errno = refused ? EINVAL : fake.full;
            return sent > 0 ? sent : -1;
        }
        fake.room--;
        assert_true(fake.count < TAKEN_MAX);
        fake.size[fake.count] = vector->iov_len;
        fake.frame[fake.count++] = *frame;
    }
    return sent;
}

/* Nothing is ever received. */
int __wrap_recvmmsg(int descriptor, struct mmsghdr *message, unsigned count, int flags,
                    struct timespec *timeout)
{
    (void)message;
    (void)count;
    (void)timeout;
    assert_int_equal(descriptor, SOCKET);
    assert_int_equal(flags, MSG_DONTWAIT);
    errno = EAGAIN;
    return -1;
}

int __wrap_clock_gettime(clockid_t clock, struct timespec *now)
{
    assert_int_equal(clock, CLOCK_MONOTONIC);
    now->tv_sec = fake.now_ns / 1000000000;
    now->tv_nsec = fake.now_ns % 1000000000;
    return 0;
}

static struct socketcan can;

FIXTURE(open_port)
{
    memset(&fake, 0, sizeof fake);
    fake.now_ns = 1000 * MS;
    fake.full = ENOBUFS;
    memset(&can, 0, sizeof can);
    can.port.ops = &socketcan_ops;
    can.port.bus = "can0";
    can.port.state = CAN_PORT_UP;
    can.socket = SOCKET;
    can.sought = true; /* nobody looks for the interface from here */
    return 0;
}

static struct bus_frame numbered(uint32_t id, uint8_t number)
{
    return frame_make(id, 1, &number);
}

/* Sends frames of so many identifiers from 0x100 on. */
static size_t send_cycle(uint32_t count, uint8_t number)
{
    static struct bus_frame frame[512];

    assert_true(count <= ARRAY_COUNT(frame));
    for (uint32_t i = 0; i < count; i++) {
        frame[i] = numbered(0x100 + i, number);
    }
    return can_send(&can.port, frame, count);
}

static void expect_taken(size_t at, uint32_t id, uint8_t number)
{
    assert_true(at < fake.count);
    assert_int_equal(fake.frame[at].can_id, id);
    assert_int_equal(fake.frame[at].data[0], number);
    assert_int_equal(fake.size[at], CAN_MTU);
}

/* ---- what waits ---- */

TEST_WITH(a_burst_is_late_but_whole_and_in_order, open_port, NULL)
{
    const struct can_counters *counters = &can.port.counters;

    fake.room = 10;
    assert_int_equal(send_cycle(100, 1), 100);
    assert_int_equal(counters->tx_frames, 10);
    assert_int_equal(counters->tx_held, 90);
    assert_int_equal(counters->tx_queue_full, 1);
    assert_int_equal(can.port.state, CAN_PORT_UP);

    /* It moves again: what waits goes first, and only then what is new */
    fake.room = 70;
    fake.now_ns += MS;
    assert_int_equal(send_cycle(1, 2), 1);
    assert_int_equal(counters->tx_frames, 80);
    assert_int_equal(can.nheld, 21); /* 20 and the new one, whose identifier had gone */
    fake.room = 1000;
    assert_int_equal(can_send(&can.port, NULL, 0), 0);
    assert_int_equal(fake.count, 101);
    for (uint32_t i = 0; i < 100; i++) {
        expect_taken(i, 0x100 + i, 1);
    }
    expect_taken(100, 0x100, 2);
    assert_int_equal(counters->tx_frames, 101);
    assert_int_equal(counters->tx_dropped, 0);
    assert_int_equal(counters->tx_queue_full, 2);
    assert_int_equal(can.nheld, 0);
}

TEST_WITH(of_an_identifier_the_newest_waits_in_the_place_of_the_oldest, open_port, NULL)
{
    const struct can_counters *counters = &can.port.counters;

    for (uint8_t cycle = 1; cycle <= 5; cycle++) {
        assert_int_equal(send_cycle(3, cycle), 3);
        fake.now_ns += MS;
    }
    assert_int_equal(counters->tx_dropped, 4 * 3);
    assert_int_equal(counters->tx_held, 5 * 3);
    assert_int_equal(counters->tx_queue_full, 5);
    assert_int_equal(can.nheld, 3);
    fake.room = 1000;
    can_send(&can.port, NULL, 0);
    for (uint32_t i = 0; i < 3; i++) {
        expect_taken(i, 0x100 + i, 5);
    }
    assert_int_equal(fake.count, 3);
}

/* An identifier of 29 bits, a remote frame and one of 11 bits are three; FD is the same. */
TEST_WITH(identifiers_differ_by_their_format, open_port, NULL)
{
    struct bus_frame frame[4];

    for (int i = 0; i < 4; i++) {
        frame[i] = numbered(0x123, (uint8_t)i);
    }
    frame[1].flags = FRAME_EXTENDED;
    frame[2].flags = FRAME_REMOTE;
    frame[3].flags = FRAME_FD;
    can.port.fd = true;
    assert_int_equal(can_send(&can.port, frame, 4), 4);
    assert_int_equal(can.nheld, 3);
    fake.room = 10;
    can_send(&can.port, NULL, 0);
    assert_int_equal(fake.count, 3);
    assert_int_equal(fake.size[0], CANFD_MTU); /* the newest, in the place of the first */
    assert_int_equal(fake.frame[0].data[0], 3);
    assert_int_equal(fake.frame[1].can_id, 0x123 | CAN_EFF_FLAG);
    assert_int_equal(fake.frame[2].can_id, 0x123 | CAN_RTR_FLAG);
}

TEST_WITH(there_is_room_for_so_many_identifiers, open_port, NULL)
{
    assert_int_equal(send_cycle(SOCKETCAN_HELD_MAX + 7, 1), SOCKETCAN_HELD_MAX);
    assert_int_equal(can.nheld, SOCKETCAN_HELD_MAX);
    assert_int_equal(can.port.counters.tx_dropped, 7);
    fake.room = 1000;
    can_send(&can.port, NULL, 0);
    assert_int_equal(fake.count, SOCKETCAN_HELD_MAX);
    expect_taken(SOCKETCAN_HELD_MAX - 1, 0x100 + SOCKETCAN_HELD_MAX - 1, 1);
}

TEST_WITH(a_full_socket_is_a_full_queue, open_port, NULL)
{
    fake.full = EAGAIN;
    assert_int_equal(send_cycle(5, 1), 5);
    assert_int_equal(can.nheld, 5);
    assert_int_equal(can.port.counters.tx_queue_full, 1);
}

/* ---- a queue that does not empty ---- */

/* Sends every 100 us; returns the time of the next attempt after from_ns. */
static int64_t next_attempt(void)
{
    int calls = fake.calls;

    for (int i = 0; i < 30000 && fake.calls == calls; i++) {
        fake.now_ns += MS / 10;
        assert_int_equal(send_cycle(1, 1), 1);
    }
    return fake.now_ns;
}

TEST_WITH(attempts_become_rarer_up_to_one_a_second, open_port, NULL)
{
    static const int expected_ms[] = {10, 20, 40, 80, 160, 320, 640, 1000, 1000, 1000};
    int64_t begin_ns = fake.now_ns, last_ns;

    assert_int_equal(send_cycle(1, 1), 1);
    fake.now_ns = begin_ns + SOCKETCAN_STUCK_NS - 1;
    assert_int_equal(send_cycle(1, 1), 1);
    assert_int_equal(can.port.state, CAN_PORT_UP);
    fake.now_ns = last_ns = begin_ns + SOCKETCAN_STUCK_NS;
    assert_int_equal(send_cycle(1, 1), 1);
    assert_int_equal(can.port.state, CAN_PORT_STUCK);
    assert_int_equal(fake.calls, 3);
    for (size_t i = 0; i < ARRAY_COUNT(expected_ms); i++) {
        int64_t now_ns = next_attempt();

        assert_int_equal(now_ns - last_ns, expected_ms[i] * MS);
        last_ns = now_ns;
    }
    assert_int_equal(can.port.state, CAN_PORT_STUCK);
    assert_int_equal(can.port.counters.tx_queue_full, fake.calls);

    /* One frame leaves: all is as it was, and it takes as long again until it is stuck */
    fake.room = 1;
    next_attempt();
    assert_int_equal(can.port.state, CAN_PORT_UP);
    begin_ns = fake.now_ns;
    send_cycle(1, 1);
    fake.now_ns = begin_ns + SOCKETCAN_STUCK_NS - 1;
    send_cycle(1, 1);
    assert_int_equal(can.port.state, CAN_PORT_UP);
    fake.now_ns = last_ns = begin_ns + SOCKETCAN_STUCK_NS;
    send_cycle(1, 1);
    assert_int_equal(can.port.state, CAN_PORT_STUCK);
    assert_int_equal(next_attempt() - last_ns, 10 * MS);
}

TEST_WITH(a_bus_that_is_off_stays_so, open_port, NULL)
{
    can.port.state = CAN_PORT_BUS_OFF;
    send_cycle(1, 1);
    fake.now_ns += SOCKETCAN_STUCK_NS;
    send_cycle(1, 1);
    assert_int_equal(can.port.state, CAN_PORT_BUS_OFF);
    fake.room = 10;
    next_attempt();
    assert_int_equal(can.port.state, CAN_PORT_BUS_OFF); /* frames leave it, too, into the queue */
}

/* ---- frames and interfaces that fail ---- */

TEST_WITH(what_the_device_cannot_carry_is_left_out, open_port, NULL)
{
    const struct can_counters *counters = &can.port.counters;

    fake.room = 1000;
    fake.refuse = 0x102;
    assert_int_equal(send_cycle(200, 1), 199);
    assert_int_equal(fake.count, 199);
    expect_taken(1, 0x101, 1);
    expect_taken(2, 0x103, 1);
    expect_taken(198, 0x1c7, 1);
    assert_int_equal(counters->tx_frames, 199);
    assert_int_equal(counters->tx_dropped, 1);
    assert_int_equal(counters->tx_queue_full, 0);
    assert_int_equal(can.nheld, 0);
}

TEST_WITH(fd_frames_stay_where_there_is_no_fd, open_port, NULL)
{
    struct bus_frame frame[3] = {numbered(1, 1), numbered(2, 2), numbered(3, 3)};

    frame[1].flags = FRAME_FD;
    fake.room = 1000;
    assert_int_equal(can_send(&can.port, frame, 3), 2);
    expect_taken(0, 1, 1);
    expect_taken(1, 3, 3);
    assert_int_equal(can.port.counters.tx_dropped, 1);

    /* Nor do they wait */
    fake.room = 0;
    assert_int_equal(can_send(&can.port, frame, 3), 2);
    assert_int_equal(can.nheld, 2);
    assert_int_equal(can.port.counters.tx_dropped, 2);
}

TEST_WITH(what_waits_goes_with_its_interface, open_port, NULL)
{
    static const struct {
        int code;
        enum can_port_state state;
    } table[] = {{ENETDOWN, CAN_PORT_DOWN}, {ENODEV, CAN_PORT_GONE}, {ENXIO, CAN_PORT_GONE}};

    for (size_t i = 0; i < ARRAY_COUNT(table); i++) {
        open_port(test_state);
        assert_int_equal(send_cycle(5, 1), 5);
        fake.full = table[i].code;
        assert_int_equal(send_cycle(3, 2), 0);
        assert_int_equal(can.port.state, table[i].state);
        assert_int_equal(can.nheld, 0);
        assert_int_equal(can.port.counters.tx_dropped, 8);
        assert_int_equal(can.port.counters.down_events, 1);
        assert_int_equal(send_cycle(3, 3), 0);
        assert_int_equal(can.port.counters.tx_dropped, 11);
        assert_int_equal(can.port.counters.down_events, 1);
        assert_int_equal(fake.calls, 2);
    }
}

/* ---- the state that the controller tells ---- */

static enum can_port_state state_after(struct can_state_box *box, enum can_port_state told)
{
    struct bus_frame frame;

    can_state_post(box, told);
    assert_int_equal(can_receive(&can.port, &frame, 1), 0);
    return can.port.state;
}

/* A port that is stuck stays so whatever the controller says, but bus-off, which is why; one that
 * is not follows the controller, also back from bus-off. */
TEST_WITH(a_stuck_port_believes_bus_off_alone, open_port, NULL)
{
    struct can_state_box box = {0};
    int64_t begin_ns = fake.now_ns;

    can.controller = &box;
    assert_int_equal(state_after(&box, CAN_PORT_PASSIVE), CAN_PORT_PASSIVE);
    assert_int_equal(state_after(&box, CAN_PORT_UP), CAN_PORT_UP);
    send_cycle(1, 1);
    fake.now_ns = begin_ns + SOCKETCAN_STUCK_NS;
    send_cycle(1, 1);
    assert_int_equal(can.port.state, CAN_PORT_STUCK);
    assert_int_equal(state_after(&box, CAN_PORT_PASSIVE), CAN_PORT_STUCK);
    assert_int_equal(state_after(&box, CAN_PORT_UP), CAN_PORT_STUCK);
    assert_int_equal(state_after(&box, CAN_PORT_BUS_OFF), CAN_PORT_BUS_OFF);
    assert_int_equal(state_after(&box, CAN_PORT_UP), CAN_PORT_UP);
}

TEST_WITH(another_failure_drops_the_frames_and_no_more, open_port, NULL)
{
    fake.room = 2;
    fake.full = EPERM;
    assert_int_equal(send_cycle(5, 1), 2);
    assert_int_equal(can.port.counters.tx_dropped, 3);
    assert_int_equal(can.nheld, 0);
    assert_int_equal(can.port.state, CAN_PORT_UP);
}
