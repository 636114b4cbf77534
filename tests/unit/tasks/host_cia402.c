/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host against CANopen nodes played by the test: a drive of two axes, a drive of one, and a
 * force-torque node, by the documents of CiA 301 and CiA 402.
 */
#include "tests/unit/tasks/host_bench.h"

enum { AXES = 3, DRIVES = 2, NODES = 3 };
enum { NMT = 0x000, SYNC = 0x080, EMCY = 0x080, STATUS = 0x1c0, VOLTAGE = 0x200, CONTROL = 0x300 };
enum { SDO_REPLY = 0x580, SDO_REQUEST = 0x600, HEARTBEAT = 0x700 };

static const uint8_t node_id[NODES] = {1, 5, 31};
static const int node_axes[NODES] = {2, 1, 0};

/* motor 1.23456 rad, deflection -0.02 rad, torque 3.2 N m */
static const uint8_t telemetry[8] = {0x40, 0xe2, 0x01, 0x00, 0x30, 0xf8, 0x40, 0x01};

static struct node {
    bool operational;
    uint16_t status[2], control[2];
    uint8_t mode[2];
    int writes;
} nodes[NODES];
static uint32_t device_type, refused; /* of all drives; index that is aborted */

static void step_axis(struct node *node, int k, uint16_t word)
{
    uint16_t *status = &node->status[k];

    if (word & ~node->control[k] & 0x80 && *status == 0x08) {
        *status = 0x40;
    } else if (!(word & 0x82)) {
        *status = *status == 0x08 ? 0x08 : 0x40;
    } else if (*status == 0x40 && word == 0x06) {
        *status = 0x21;
    } else if (*status == 0x21 && word == 0x07) {
        *status = 0x23;
    } else if (*status == 0x23 && word == 0x0f && node->mode[k] == 0xff) {
        *status = 0x27;
    }
    node->control[k] = word;
}

static void say_status(struct bench *bench, int i)
{
    uint8_t data[4] = {(uint8_t)nodes[i].status[0], 2, (uint8_t)nodes[i].status[1], 2};

    if (nodes[i].operational && node_axes[i] > 0) {
        say(bench, 0, STATUS + node_id[i], (uint8_t)(2 * node_axes[i]), data);
    }
}

static void play_sdo(struct bench *bench, int i, const uint8_t *data)
{
    uint8_t answer[8] = {0x60, data[1], data[2], data[3]};
    uint32_t index = data[1] | (uint32_t)data[2] << 8;

    if (data[0] == 0x40) {
        uint32_t type = i < DRIVES ? device_type : 0x00020194;

        assert_int_equal(index, 0x1000);
        answer[0] = 0x43;
        memcpy(answer + 4, (const uint8_t[]){(uint8_t)type, (uint8_t)(type >> 8), 2, 0}, 4);
        if (bench->mute && i == 1) {
            return;
        }
    } else {
        assert_int_equal(data[0] & 0xe3, 0x23);
        nodes[i].writes++;
        if (index == 0x6060 || index == 0x6860) {
            nodes[i].mode[index == 0x6860] = data[4];
        }
        if (index == refused) {
            answer[0] = 0x80;
            memcpy(answer + 4, (const uint8_t[]){0, 0, 2, 6}, 4);
        }
    }
    say(bench, 0, SDO_REPLY + node_id[i], 8, answer);
}

static void play_node(struct bench *bench, int i, const struct bus_frame *frame)
{
    const uint8_t *data = frame->data;
    struct node *node = &nodes[i];

    if (frame->id == NMT && (data[1] == 0 || data[1] == node_id[i])) {
        node->operational = data[0] == 1;
        if (data[0] == 130) {
            say(bench, 0, HEARTBEAT + node_id[i], 1, (const uint8_t[]){0});
        }
        say_status(bench, i);
    } else if (frame->id == (uint32_t)SDO_REQUEST + node_id[i] && frame->len == 8) {
        play_sdo(bench, i, data);
    } else if (frame->id == (uint32_t)CONTROL + node_id[i] && node->operational) {
        for (int k = 0; k < node_axes[i]; k++) {
            step_axis(node, k, (uint16_t)(data[2 * k] | data[2 * k + 1] << 8));
        }
        say_status(bench, i);
    } else if (frame->id == SYNC && node->operational) {
        for (int k = 0; k < node_axes[i]; k++) {
            say(bench, 0, 0x180 + 0x100 * (uint32_t)k + node_id[i], 8, telemetry);
        }
        if (i == 2) {
            say(bench, 0, 0x19f, 6, (const uint8_t[]){0x7b, 0, 0, 0, 0x38, 0xff});
            say(bench, 0, 0x29f, 6, (const uint8_t[]){0x7b, 0, 0, 0, 0x9c, 0xff});
        }
    }
}

static void play(struct bench *bench, int bus, const struct bus_frame *frame)
{
    assert_int_equal(bus, 0);
    assert_int_equal(frame->flags, 0);
    for (int i = 0; i < NODES; i++) {
        play_node(bench, i, frame);
        if (frame->id == SYNC && bench->nseen % 100 == 0) { /* now and then */
            say_status(bench, i);
            say(bench, 0, HEARTBEAT + node_id[i], 1,
                (const uint8_t[]){nodes[i].operational ? 5 : 127});
        }
    }
}

static inline void set_up(struct bench *bench)
{
    static const struct host_axis axis[AXES] = {
        {.joint = "hip", .address = 1, .torque_address = -1},
        {.joint = "knee", .address = 1, .axis = 1, .torque_address = -1},
        {.joint = "ankle", .address = 5, .torque_address = -1}};
    static const struct host_ft ft[] = {{.name = "foot", .address = 31, .period_ns = 4000000}};
    static const struct host_bus bus[] = {{.protocol = "cia402"}};
    struct host_config config = {.nbus = 1,
                                 .bus = bus,
                                 .naxis = AXES,
                                 .axis = axis,
                                 .nft = 1,
                                 .ft = ft,
                                 .supply_v = 48,
                                 .period_ns = 1000000};

    memset(nodes, 0, sizeof nodes);
    for (int i = 0; i < NODES; i++) {
        nodes[i].status[0] = nodes[i].status[1] = 0x40;
    }
    nodes[0].status[1] = 0x08; /* a fault of before */
    device_type = 0xffff0192;
    refused = 0;
    bench->play[0] = play;
    bench_open(bench, &config);
}

BENCH(set_up, struct bench, bench_close)

TEST_ON(start_up_configures_starts_and_enables, set_up, bench)
{
    reach_ready(bench);

    assert_true(was_sent(bench, 0, NMT, 2, (const uint8_t[]){130, 0}));
    assert_true(was_sent(bench, 0, NMT, 2, (const uint8_t[]){1, 31}));
    for (int i = 0; i < DRIVES; i++) {
        for (int k = 0; k < node_axes[i]; k++) {
            assert_int_equal(nodes[i].status[k], 0x27);
        }
    }

    /* the second axis's telemetry: TPDO 65 with COB-ID 0x281, and its first object, 0x4803 */
    assert_true(
        was_sent(bench, 0, 0x601, 8, (const uint8_t[]){0x23, 0x40, 0x18, 1, 0x81, 0x02, 0, 0}));
    assert_true(was_sent(bench, 0, 0x601, 8,
                         (const uint8_t[]){0x23, 0x40, 0x1a, 1, 0x20, 0x00, 0x03, 0x48}));
    /* the foot with every fourth SYNC */
    assert_true(was_sent(bench, 0, 0x61f, 8, (const uint8_t[]){0x2f, 0x00, 0x18, 2, 4, 0, 0, 0}));
    assert_true(host_healthy(bench->host));
}

TEST_ON(a_lost_frame_does_not_stop_the_start_up, set_up, bench)
{
    check_start_up_without_each_frame(bench, set_up);
}

TEST_ON(telemetry_is_in_si_units, set_up, bench)
{
    const struct host_joint *joint;
    const struct host_force *force;

    reach_ready(bench);
    one_period(bench);
    for (size_t i = 0; i < AXES; i++) {
        joint = host_joint(bench->host, i);
        assert_near(joint->motor_rad, 1.23456, 1e-9);
        assert_near(joint->joint_rad, 1.25456, 1e-9);
        assert_near(joint->torque_nm, 3.2, 1e-9);
    }
    force = host_force(bench->host, 0);
    assert_near(force->force_n[0], 12.3, 1e-9);
    assert_near(force->force_n[2], -20.0, 1e-9);
    assert_near(force->torque_nm[0], 1.23, 1e-9);
    assert_near(force->torque_nm[2], -1.0, 1e-9);
}

TEST_ON(voltages_go_out_by_node_with_a_sync, set_up, bench)
{
    reach_ready(bench);

    host_set_voltage(bench->host, 0, 5.0);
    host_set_voltage(bench->host, 1, -100.0); /* within the supply */
    host_set_voltage(bench->host, 2, 0.002);
    bench->nseen = 0;
    one_period(bench);
    assert_int_equal(bench->nseen, 3);
    assert_true(was_sent(bench, 0, VOLTAGE + 1, 4, (const uint8_t[]){0xc4, 0x09, 0x40, 0xa2}));
    assert_true(was_sent(bench, 0, VOLTAGE + 5, 2, (const uint8_t[]){0x01, 0x00}));
    assert_int_equal(bench->seen[2].id, SYNC);
    assert_int_equal(bench->seen[2].len, 0);
}

TEST_ON(a_fault_is_named_with_its_cause, set_up, bench)
{
    reach_ready(bench);

    nodes[0].status[1] = 0x08;
    say(bench, 0, EMCY + 1, 8, (const uint8_t[]){0x20, 0x32, 0x05, 1, 0x01, 0, 0, 0});
    say_status(bench, 0);
    one_period(bench);
    assert_false(host_healthy(bench->host));
    assert_non_null(strstr(host_message(bench->host), "knee"));
    assert_non_null(strstr(host_message(bench->host), "under-voltage"));
    assert_false(host_lost(bench->host));
}

TEST_ON(a_node_that_boots_is_lost, set_up, bench)
{
    reach_ready(bench);

    say(bench, 0, HEARTBEAT + 5, 1, (const uint8_t[]){0});
    bench->play[0] = play;
    nodes[1].operational = false;
    one_period(bench);
    assert_false(host_healthy(bench->host));
    assert_true(host_lost(bench->host));
}

TEST_ON(what_contradicts_the_rig_ends_the_start_up, set_up, bench)
{
    device_type = 0x00020191;
    assert_int_equal(start_up(bench, 100), HOST_FAILED);
    assert_non_null(strstr(host_message(bench->host), "board 1 on can0 is of another kind"));

    reopen(bench, set_up);
    refused = 0x1a40;
    assert_int_equal(start_up(bench, 100), HOST_FAILED);
    assert_non_null(strstr(host_message(bench->host), "board 1 on can0 refuses"));

    reopen(bench, set_up);
    bench->mute = true;
    assert_int_equal(start_up(bench, 9000), HOST_FAILED);
    assert_non_null(strstr(host_message(bench->host), "board 5 on can0 does not answer"));
}

TEST_ON(a_motor_is_switched_off_and_on, set_up, bench)
{
    reach_ready(bench);

    host_set_motor(bench->host, 0, false);
    for (int i = 0; i < 5; i++) {
        one_period(bench);
    }
    assert_int_equal(nodes[0].status[0], 0x40);
    assert_int_equal(nodes[0].status[1], 0x27);
    assert_int_equal(host_joint(bench->host, 0)->motor, HOST_MOTOR_OFF);
    host_set_motor(bench->host, 0, true);
    for (int i = 0; i < 10; i++) {
        one_period(bench);
    }
    assert_int_equal(host_joint(bench->host, 0)->motor, HOST_MOTOR_ON);
}
