/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The host and the boards of a mixed rig on a hostile bus: frames of both sides are lost, doubled,
 * spoiled, or made up. What the host sends stays what the protocols allow, its picture of the
 * joints stays finite, and a start-up that fails says why. By the first byte in lockstep, where the
 * simulator's side is canbus/lockstep.h.
 */
#include "boards/described/protocol.h"
#include "boards/messages.h"
#include "boards/protocol_list.h"
#include "canbus/lockstep.h"
#include "tasks/host.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>
#include <string.h>

enum {
    BUSES = 4,
    AXES = 5,
    BOARDS = 8,
    FTS = 2,
    INBOX = 512,
    MESSAGES_MAX = 2048,
    PERIODS_MAX = 1500
};
enum { STEP_ID = 0x6f0, DONE_ID = 0x6f1, IMU_ADDRESS = 9 };

/* Bus by bus: iCub with torque and F/T boards, FOC, by the first byte one of the protocols that a
 * file describes, compact over CAN FD. */
static struct boards_bus_config board_buses[BUSES] = {{.protocol = &protocol_icub},
                                                      {.protocol = &protocol_foc},
                                                      {.protocol = &protocol_compact},
                                                      {.protocol = &protocol_compact, .fd = true}};
static struct host_bus host_buses[BUSES] = {{.protocol = "icub"},
                                            {.protocol = "foc"},
                                            {.protocol = "compact"},
                                            {.protocol = "compact", .fd = true}};

/* A port whose other end is the input. */
struct wire_end {
    struct can_port port; /* begins with it */
    struct bus_frame inbox[INBOX];
    size_t waiting, taken;
    struct bus_frame sent[INBOX];
    size_t nsent;
};

struct bench {
    struct wire_end end[BUSES];
    struct can_port *port[BUSES];
    struct host *host;
    struct boards *boards;
    struct motor_sense sense[AXES];
    struct motor_command motor[AXES];
    struct ft_sense ft[FTS];
    struct plant_sensors sensors;
    struct plant_command command;
    struct lockstep lockstep;
    struct message message[BUSES][MESSAGES_MAX];
    size_t nmessage[BUSES];
    int bus_in_hand, periods;
    int64_t now_ns; /* the host's clock */
    enum host_phase phase;
    bool in_lockstep;
    int imu_bus; /* with the inertial board */
    /* what becomes of the next frames on their way */
    uint8_t lose, spoil, twice;
};

/* ---- ports ---- */

static size_t take(struct can_port *port, struct bus_frame *frames, size_t max)
{
    struct wire_end *end = (struct wire_end *)port;
    size_t count = end->waiting - end->taken < max ? end->waiting - end->taken : max;

    memcpy(frames, end->inbox + end->taken, count * sizeof *frames);
    end->taken += count;
    if (end->taken == end->waiting) {
        end->taken = end->waiting = 0;
    }
    return count;
}

static size_t give(struct can_port *port, const struct bus_frame *frames, size_t count)
{
    struct wire_end *end = (struct wire_end *)port;
    size_t accepted = 0;

    while (accepted < count && end->nsent < INBOX) {
        end->sent[end->nsent++] = frames[accepted++];
    }
    return accepted;
}

static const struct can_port_ops ops = {.receive = take, .send = give};

static void arrive(struct bench *bench, size_t bus, const struct bus_frame *frame)
{
    struct wire_end *end = &bench->end[bus];

    if (end->waiting < INBOX) {
        end->inbox[end->waiting++] = *frame;
    }
}

/* ---- the rig ---- */

static struct board_axis_config board_axis(int joint)
{
    return (struct board_axis_config){.joint = joint,
                                      .joint_ticks_per_rad = 10000.0,
                                      .motor_ticks_per_rad = 65000.0,
                                      .lower_rad = -2.0,
                                      .upper_rad = 2.5,
                                      .current_limit_a = 12.0,
                                      .torque_full_scale_nm = 55.0,
                                      .gear = 100.0,
                                      .winding_ohm = 0.7,
                                      .winding_h = 0.0003,
                                      .bemf_v_s_rad = 4.0,
                                      .torque_nm_a = 4.0};
}

static struct host_axis host_axis(const char *name, int bus, uint8_t axis)
{
    return (struct host_axis){.joint = name,
                              .bus = bus,
                              .address = 1,
                              .axis = axis,
                              .joint_ticks_per_rad = 10000.0,
                              .motor_ticks_per_rad = 65000.0,
                              .torque_address = bus == 0 ? 12 : -1,
                              .torque_channel = axis,
                              .torque_full_scale_nm = 55.0,
                              .lower_rad = -2.0,
                              .upper_rad = 2.5,
                              .drive = {.gear = 100.0,
                                        .spring_nm_rad = 400.0,
                                        .winding_ohm = 0.7,
                                        .winding_h = 0.0003,
                                        .current_limit_a = 12.0,
                                        .poles = 8,
                                        .torque_nm_a = 4.0,
                                        .bemf_v_s_rad = 4.0}};
}

static bool list_message(void *context, const struct message *message)
{
    struct bench *bench = context;
    size_t *count = &bench->nmessage[bench->bus_in_hand];

    fuzz_require(*count < MESSAGES_MAX, "too many messages");
    if (message->from_host) {
        bench->message[bench->bus_in_hand][(*count)++] = *message;
    }
    return true;
}

/* Returns a protocol of config/protocols, which bus 2 speaks, or bus 3. */
static const struct described_protocol *load_protocol(unsigned which)
{
    static const char *const names[] = {"compact", "servo-valve", "mini-cheetah", "odrive",
                                        "compact-fd"};
    static const struct described_protocol *protocol[5];
    static struct arena arena;
    char path[256];
    struct error error;

    if (!protocol[which]) {
        snprintf(path, sizeof path, "%s/config/protocols/%s.yaml", HIL_SOURCE_DIR, names[which]);
        fuzz_require((arena.memory || arena_init(&arena, 16u << 20, &error) == ERROR_NONE) &&
                         described_load(path, false, &arena, &protocol[which], &error) ==
                             ERROR_NONE,
                     "%s", error.text);
    }
    return protocol[which];
}

/* Chooses what bus 2 speaks. */
static void choose_protocol(unsigned which)
{
    board_buses[2].protocol = which ? &protocol_described : &protocol_compact;
    host_buses[2].protocol = which ? "described" : "compact";
    board_buses[2].described = host_buses[2].described = load_protocol(which);
    board_buses[3].described = host_buses[3].described = load_protocol(4);
}

static void make_boards(struct bench *bench, struct arena *arena)
{
    static struct board_config board[BOARDS];
    struct boards_config config = {.nboard = BOARDS,
                                   .board = board,
                                   .nbus = BUSES,
                                   .bus = board_buses,
                                   .njoint = AXES,
                                   .nft = FTS,
                                   .tick_ns = 1000000};
    struct error error;

    memset(board, 0, sizeof board);
    for (int b = 0; b < BUSES; b++) {
        board[b] =
            (struct board_config){.name = "motor", .kind = BOARD_MOTOR, .bus = b, .address = 1};
        board[b].axis[0] = board_axis(b);
        board[b].axis[1] = board_axis(b == 0 ? 4 : -1);
        board[b].axis[2].joint = board[b].axis[3].joint = -1;
    }
    board[4] = (struct board_config){.name = "torque",
                                     .kind = BOARD_TORQUE,
                                     .address = 12,
                                     .torque_joint = {0, 4, -1, -1, -1, -1},
                                     .full_scale = {55, 55, 55, 55, 55, 55}};
    board[5] = (struct board_config){.name = "ft",
                                     .kind = BOARD_FT,
                                     .address = 13,
                                     .full_scale = {1500, 1500, 2000, 40, 40, 40}};
    board[6] = (struct board_config){.name = "ft",
                                     .kind = BOARD_FT,
                                     .address = 2,
                                     .bus = 3,
                                     .ft = 1,
                                     .full_scale = {1500, 1500, 2000, 40, 40, 40}};
    board[7] = (struct board_config){
        .name = "imu", .kind = BOARD_INERTIAL, .address = IMU_ADDRESS, .bus = bench->imu_bus};
    fuzz_require(boards_create(&config, arena, &bench->boards, &error) == ERROR_NONE, "%s",
                 error.text);
    for (int bus = 0; bus < BUSES; bus++) {
        bench->bus_in_hand = bus;
        boards_messages(&config, bus, list_message, bench);
    }
}

static void make_host(struct bench *bench, struct arena *arena)
{
    static struct host_axis axis[AXES];
    static const struct host_ft ft[FTS] = {
        {.name = "a", .bus = 0, .address = 13, .period_ns = 5000000},
        {.name = "b", .bus = 3, .address = 2},
    };
    struct host_config config = {.nbus = BUSES,
                                 .port = bench->port,
                                 .bus = host_buses,
                                 .naxis = AXES,
                                 .axis = axis,
                                 .nft = FTS,
                                 .ft = ft,
                                 .imu = {true, bench->imu_bus, IMU_ADDRESS, 2000000},
                                 .supply_v = 48.0,
                                 .period_ns = 1000000,
                                 .lockstep = bench->in_lockstep,
                                 .step_id = STEP_ID,
                                 .done_id = DONE_ID};
    struct error error;

    for (int b = 0; b < BUSES; b++) {
        bench->end[b].port = (struct can_port){.ops = &ops, .bus = "x", .fd = host_buses[b].fd};
        bench->port[b] = &bench->end[b].port;
        axis[b] = host_axis("j", b, 0);
    }
    axis[4] = host_axis("k", 0, 1);
    fuzz_require(host_create(&config, arena, &bench->host, &error) == ERROR_NONE, "%s", error.text);
}

static void start(struct bench *bench, uint8_t how)
{
    struct arena *arena = fuzz_arena((size_t)16 << 20);
    const struct lockstep_config lockstep = {
        .step_id = STEP_ID, .done_id = DONE_ID, .silence_ns = 1000000000};

    memset(bench, 0, sizeof *bench);
    bench->in_lockstep = how & 1;
    bench->imu_bus = how >> 1 & 3;
    choose_protocol(how >> 3 & 3);
    bench->sensors = (struct plant_sensors){
        .supply_v = 48.0, .njoint = AXES, .nft = FTS, .motor = bench->sense, .ft = bench->ft};
    bench->command = (struct plant_command){.njoint = AXES, .motor = bench->motor};
    make_boards(bench, arena);
    make_host(bench, arena);
    lockstep_init(&bench->lockstep, &lockstep);
}

/* ---- what must hold ---- */

static bool is_message(const struct message *message, const struct bus_frame *frame)
{
    return frame->id == message->id && frame->len <= message->length &&
           (message->code == MESSAGE_NO_CODE ||
            (frame->len > 0 && (frame->data[0] & 0x7f) == (message->code & 0x7f)));
}

static void check_sent(const struct bench *bench, size_t bus, const struct bus_frame *frame)
{
    size_t i = 0;

    fuzz_require(frame_valid(frame) && !(frame->flags & ~(FRAME_FD | FRAME_BRS)) &&
                     (!(frame->flags & FRAME_FD) || host_buses[bus].fd),
                 "id 0x%x flags 0x%x length %u", frame->id, frame->flags, frame->len);
    if (frame->id == STEP_ID) {
        fuzz_require(bench->in_lockstep && bus == 0, "a STEP on bus %zu", bus);
        return;
    }
    while (i < bench->nmessage[bus] && !is_message(&bench->message[bus][i], frame)) {
        i++;
    }
    fuzz_require(i < bench->nmessage[bus], "bus %zu has no message 0x%x of %u bytes, first 0x%02x",
                 bus, frame->id, frame->len, frame->data[0]);
}

static void check_host(struct bench *bench)
{
    for (size_t i = 0; i < AXES; i++) {
        const struct host_joint *joint = host_joint(bench->host, i);

        fuzz_require(isfinite(joint->joint_rad) && isfinite(joint->motor_rad) &&
                         isfinite(joint->current_a) && isfinite(joint->torque_nm),
                     "axis %zu: %g %g %g %g", i, joint->joint_rad, joint->motor_rad,
                     joint->current_a, joint->torque_nm);
        fuzz_require(joint->motor <= HOST_MOTOR_FAULT, "motor %d", (int)joint->motor);
    }
    for (int i = 0; i < 3 * FTS; i++) {
        const struct host_force *force = host_force(bench->host, (size_t)i / 3);

        fuzz_require(isfinite(force->force_n[i % 3]) && isfinite(force->torque_nm[i % 3]),
                     "%g N, %g Nm", force->force_n[i % 3], force->torque_nm[i % 3]);
    }
    for (int i = 0; i < 4; i++) {
        const struct host_motion *motion = host_motion(bench->host);

        fuzz_require(isfinite(motion->quaternion[i]) && fabs(motion->quaternion[i]) <= 2.0,
                     "component %g", motion->quaternion[i]);
    }
    fuzz_require(bench->phase != HOST_FAILED || fuzz_is_sentence(host_message(bench->host)), "%s",
                 host_message(bench->host));
    fuzz_require(bench->phase != HOST_READY || host_healthy(bench->host) ||
                     fuzz_is_sentence(host_message(bench->host)),
                 "%s", host_message(bench->host));
}

/* ---- what happens ---- */

/* How often a frame goes on: not at all, once or twice, and maybe spoiled. */
static int carry(struct bench *bench, struct bus_frame *frame)
{
    if (bench->lose > 0) {
        bench->lose--;
        return 0;
    }
    if (bench->spoil > 0) {
        frame->data[bench->spoil % 8] ^= (uint8_t)(1u << bench->spoil / 8 % 8);
        bench->spoil = 0;
    }
    if (bench->twice > 0) {
        bench->twice--;
        return 2;
    }
    return 1;
}

static void run_boards(struct bench *bench)
{
    struct bus_frame frames[256], done;
    struct board_event event;

    boards_control(bench->boards, bench->sensors.time_ns, &bench->command);
    bench->sensors.time_ns += 1000000;
    boards_sample(bench->boards, bench->sensors.time_ns, &bench->sensors);
    for (size_t bus = 0; bus < BUSES; bus++) {
        size_t count = boards_transmit(bench->boards, bench->sensors.time_ns, bus, frames, 256);

        for (size_t i = 0; i < count; i++) {
            for (int times = carry(bench, &frames[i]); times > 0; times--) {
                arrive(bench, bus, &frames[i]);
            }
        }
    }
    while (boards_next_event(bench->boards, &event)) {
    }
    if (bench->in_lockstep && bench->lockstep.ticks > 0) {
        lockstep_advance(&bench->lockstep, 0);
        done = lockstep_done(&bench->lockstep, 0);
        for (size_t bus = 0; bus < BUSES; bus++) {
            for (int times = carry(bench, &done); times > 0; times--) {
                arrive(bench, bus, &done);
            }
        }
    }
}

static void deliver_sent(struct bench *bench)
{
    for (size_t bus = 0; bus < BUSES; bus++) {
        struct wire_end *end = &bench->end[bus];

        for (size_t i = 0; i < end->nsent; i++) {
            check_sent(bench, bus, &end->sent[i]);
            for (int times = carry(bench, &end->sent[i]); times > 0; times--) {
                if (end->sent[i].id == STEP_ID) {
                    lockstep_receive(&bench->lockstep, &end->sent[i]);
                } else {
                    boards_receive(bench->boards, bench->sensors.time_ns, bus, &end->sent[i]);
                }
            }
        }
        end->nsent = 0;
    }
}

static void period(struct bench *bench)
{
    bench->periods++;
    bench->now_ns += 1000000;
    if (host_receive(bench->host, bench->now_ns)) {
        bench->phase = host_start_up(bench->host);
        fuzz_require(bench->phase <= HOST_FAILED, "phase %d", (int)bench->phase);
        host_send(bench->host);
    } else {
        host_repeat_step(bench->host, bench->now_ns);
    }
    check_host(bench);
    deliver_sent(bench);
    run_boards(bench);
}

static void make_up(struct bench *bench, struct fuzz_bytes *bytes, uint8_t what)
{
    static const uint16_t ids[BUSES][16] = {
        {0x010, 0x110, 0x111, 0x113, 0x114, 0x11a, 0x710, 0x7d0, 0x3ca, 0x3cb, 0x3da, 0x3db, 0x2c0,
         0x2d0, 0x7c0, DONE_ID},
        {0x010, 0x110, 0x113, 0x11e, 0x710, 0x111, 0x010, DONE_ID},
        {0x100, 0x200, 0x6a1, 0x7c1, 0x101, 0x140, 0x160, 0x201, 0x220, 0x6a2, 0x7c2, DONE_ID},
        {0x121, 0x200, 0x6a1, 0x7c1, 0x122, 0x180, 0x100, 0x201, 0x220, 0x6a2, 0x7c2, DONE_ID},
    };
    const size_t bus = what & 3;
    struct bus_frame frame = {.flags = host_buses[bus].fd ? FRAME_FD | FRAME_BRS : 0};
    const uint8_t which = fuzz_u8(bytes);

    frame.id = ids[bus][which & 0xf];
    frame.len = which >> 4;
    if (frame.len > 8) {
        frame.len = frame.flags & FRAME_FD ? frame_fd_length(4u * frame.len) : 8;
    }
    fuzz_copy(bytes, frame.data, frame.len);
    arrive(bench, bus, &frame);
}

static void act(struct bench *bench, struct fuzz_bytes *bytes)
{
    const uint8_t what = fuzz_u8(bytes);
    struct bus_frame frame;

    switch (what >> 4) {
    case 0:
    case 1:
    case 2:
    case 3:
        for (int i = 1 + (what & 0x3f); i > 0 && bench->periods < PERIODS_MAX; i--) {
            period(bench);
        }
        break;
    case 4:
    case 5:
    case 6:
        make_up(bench, bytes, what);
        break;
    case 7:
        fuzz_frame(bytes, &frame);
        arrive(bench, what & 3, &frame);
        break;
    case 8:
        host_set_motor(bench->host, (what & 7) % AXES, what & 8);
        break;
    case 9:
        host_set_voltage(bench->host, (what & 7) % AXES, fuzz_real(bytes, 60.0));
        break;
    case 10:
        bench->lose = fuzz_u8(bytes);
        break;
    case 11:
        bench->spoil = fuzz_u8(bytes);
        break;
    case 12:
        bench->twice = fuzz_u8(bytes);
        break;
    case 13:
        bench->sense[(what & 7) % AXES].qm = fuzz_real(bytes, 4.0);
        bench->sense[(what & 7) % AXES].torque_nm = fuzz_real(bytes, 100.0);
        break;
    case 14:
        bench->sense[(what & 7) % AXES].current_a = fuzz_real(bytes, 40.0);
        break;
    default:
        if (what & 8) {
            bench->now_ns += (what & 7) * INT64_C(1500000000);
        } else {
            bench->sensors.supply_v = fuzz_real(bytes, 60.0);
        }
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct bench bench;
    struct fuzz_bytes bytes = {data, size};

    start(&bench, fuzz_u8(&bytes));
    while (bytes.left > 0 && bench.periods < PERIODS_MAX) {
        act(&bench, &bytes);
    }
    period(&bench);
    return 0;
}
