/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whatever arrives on the buses, whatever the sensors say and whichever board breaks: voltages stay
 * within the supply, bridges are open in idle and after faults, every frame that a board sends is
 * one of the list of messages with its values in range, every frame that it gets is accounted for,
 * nothing is allocated, and the same input gives the same answers. Bus 0 speaks FUZZ_PROTOCOL,
 * bus 1 iCub. PDOs of cia402 boards can be mapped to anything: there a frame is only legal.
 */
#include "base/hash.h"
#include "boards/described/protocol.h"
#include "faults/faults.h"
#include "boards/messages.h"
#include "tests/fuzz/fuzz.h"
#include "tests/unit/boards/board_bench.h"

#include <inttypes.h>

enum { TICKS_MAX = 600, MESSAGES_MAX = 2048, MEMORY = 8 << 20 };

static const struct protocol *const spoken = &FUZZ_PROTOCOL;

/* ---- allocations: the linker sends them through here ---- */

static bool armed;

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *memory, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *memory, size_t size);

void *__wrap_malloc(size_t size)
{
    fuzz_require(!armed, "%zu bytes allocated in a tick", size);
    return __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size)
{
    fuzz_require(!armed, "%zu bytes allocated in a tick", count * size);
    return __real_calloc(count, size);
}

void *__wrap_realloc(void *memory, size_t size)
{
    fuzz_require(!armed, "%zu bytes allocated in a tick", size);
    return __real_realloc(memory, size);
}

/* ---- the boards ---- */

static const char *const fault_lines[] = {
    "a: board one/1 off manual",          "b: board one/1 hung watchdog=0.005 manual",
    "c: board one/1 stuck manual",        "d: board one/1 garbage manual",
    "e: board one/1 slow 3 manual",       "f: board one/1 delayed 0.003 manual",
    "g: board one/13 garbage manual",     "h: board two/1 intermittent 0.5 manual",
    "i: board one/2 delayed 0.01 manual",
};

enum { FAULTS = sizeof fault_lines / sizeof *fault_lines };

/* What a run needs beside the base. */
struct fuzz_bench {
    struct board_bench base;
    struct boards_bus_config bus[BENCH_BUSES];
    struct faults *faults;
    struct message message[BENCH_BUSES][MESSAGES_MAX], command[BENCH_BUSES][MESSAGES_MAX];
    size_t nmessage[BENCH_BUSES], ncommand[BENCH_BUSES];
    double supply_v, sampled_v; /* the boards read the supply at the end of the tick before */
    uint64_t received, hash;
    int ticks, bus_in_hand;
    bool garbage; /* some board has sent what means nothing */
    bool hung;    /* some board hangs, or has */
    bool moved;   /* some board has another address now */
    bool loose;   /* some board has a loose contact, or had: it may miss a command */
    size_t room;  /* for frames of a tick */

    /* Bit by bit, the iCub addresses that have sent something */
    unsigned asked[BENCH_BUSES];
};

static bool list_message(void *context, const struct message *message)
{
    struct fuzz_bench *bench = context;
    const int bus = bench->bus_in_hand;

    fuzz_require(bench->nmessage[bus] < MESSAGES_MAX && bench->ncommand[bus] < MESSAGES_MAX,
                 "too many messages");
    if (message->from_host) {
        bench->command[bus][bench->ncommand[bus]++] = *message;
    } else {
        bench->message[bus][bench->nmessage[bus]++] = *message;
    }
    return true;
}

static struct faults *make_faults(const struct board_bench *base, struct arena *arena)
{
    static const char *const buses[] = {"one", "two"};
    const char *board[BENCH_BOARDS];
    size_t board_bus[BENCH_BOARDS];
    int address[BENCH_BOARDS];
    struct fault_names names = {.nbus = 2,
                                .bus = buses,
                                .board = board,
                                .board_bus = board_bus,
                                .board_address = address,
                                .nboard = base->config.nboard};
    struct fault fault[FAULTS];
    struct faults *faults;
    struct error error;

    for (size_t i = 0; i < base->config.nboard; i++) {
        board[i] = base->board[i].name;
        board_bus[i] = (size_t)base->board[i].bus;
        address[i] = base->board[i].address;
    }
    for (size_t i = 0; i < FAULTS; i++) {
        fuzz_require(fault_parse(fault_lines[i], &names, &fault[i], &error) == ERROR_NONE, "%s",
                     error.text);
    }
    fuzz_require(faults_create(fault, FAULTS, 1, arena, &faults, &error) == ERROR_NONE, "%s",
                 error.text);
    return faults;
}

/* Returns the protocol that a file describes: that of compact boards, also for described ones. */
static const struct described_protocol *load_described(bool fd)
{
    static const struct described_protocol *protocol[2];
    static struct arena arena;
    struct error error;

    if (!protocol[fd]) {
        fuzz_require((arena.memory || arena_init(&arena, 8u << 20, &error) == ERROR_NONE) &&
                         described_load(fd ? HIL_SOURCE_DIR "/config/protocols/compact-fd.yaml"
                                           : HIL_SOURCE_DIR "/config/protocols/compact.yaml",
                                        false, &arena, &protocol[fd], &error) == ERROR_NONE,
                     "%s", error.text);
    }
    return protocol[fd];
}

/* What the first bytes say of the base. */
static void configure(struct fuzz_bench *bench, struct fuzz_bytes *bytes)
{
    static const int64_t ticks_ns[] = {1000000, 250000, 3000000, 10000000};
    const uint8_t how = fuzz_u8(bytes), what = fuzz_u8(bytes);
    struct board_bench *base = &bench->base;

    bench_configure(base);
    base->config.tick_ns = ticks_ns[how & 3];
    bench->bus[0].protocol = spoken;
    bench->bus[0].padded = spoken->torque_boards && how & 64;
    bench->bus[0].fd = spoken->canfd_only || (spoken->canfd && !spoken->needs_file && how & 4);
    bench->bus[0].described =
        spoken->needs_file || spoken->text ? load_described(bench->bus[0].fd) : NULL;
    base->config.bus = bench->bus;
    if (!spoken->torque_boards) {
        base->config.nboard = BENCH_BOARDS - 1; /* torques need no board */
        base->board[2] = base->board[4];
    }
    if (spoken->motors_only) {
        base->board[3].kind = BOARD_MOTOR;
        base->board[3].axis[0] = base->board[3].axis[1] = (struct board_axis_config){.joint = -1};
    } else if (what & 64) {
        base->board[1] =
            (struct board_config){.name = "leg 2", .kind = BOARD_INERTIAL, .address = 2};
    }
    for (size_t i = 0; i < base->config.nboard; i++) {
        struct board_config *board = &base->board[i];

        board->strict = how & 8;
        board->require_calibration = how & 32;
        board->discovery_stops_motors = how & 16;
        board->keep_firmware = what == 0xff && i == 0; /* costs pages */
        board->transmit_at_start = what & 1;
        board->command_timeout_ns = what & 2 ? 2000000 : 0;
        board->boot_ns = what & 4 ? 3000000 : 0;
        board->status_period_ns = what & 8 ? 5000000 : 0;
        for (int k = 0; k < BOARD_AXES_MAX; k++) {
            board->axis[k].gear = 100.0;
            board->axis[k].temperature_limit_c = what & 16 ? 80.0 : 0.0;
            board->axis[k].winding_ohm = what & 32 ? 0.7 : 0.0;
            board->axis[k].bemf_v_s_rad = what & 32 ? 4.0 : 0.0;
            board->axis[k].torque_nm_a = what & 32 ? 4.0 : 0.0;
            board->axis[k].joint = k < 2 ? board->axis[k].joint : -1;
        }
    }
}

static void start(struct fuzz_bench *bench, struct fuzz_bytes *bytes)
{
    struct arena *arena = fuzz_arena(MEMORY);
    struct board_bench *base = &bench->base;
    struct error error;

    memset(bench, 0, sizeof *bench);
    configure(bench, bytes);
    bench->faults = make_faults(base, arena);
    base->config.faults = bench->faults;
    fuzz_require(boards_create(&base->config, arena, &base->boards, &error) == ERROR_NONE, "%s",
                 error.text);
    for (int bus = 0; bus < BENCH_BUSES; bus++) {
        fuzz_require(boards_transmit_max(base->boards, (size_t)bus) <= BENCH_FRAMES, "%zu frames",
                     boards_transmit_max(base->boards, (size_t)bus));
        bench->bus_in_hand = bus;
        boards_messages(&base->config, bus, list_message, bench);
    }
    bench->supply_v = SUPPLY_V;
    bench->hash = HASH_START;
    bench->room = BENCH_FRAMES;
}

/* ---- what must hold ---- */

static void check_commands(const struct fuzz_bench *bench)
{
    double supply_v = isfinite(bench->sampled_v) ? fmax(bench->sampled_v, 0.0) : 0.0;

    /* what a hung board leaves switched on follows the supply at once */
    if (bench->hung && isfinite(bench->supply_v)) {
        supply_v = fmax(supply_v, bench->supply_v);
    }

    for (int i = 0; i < BENCH_JOINTS; i++) {
        const struct motor_command *motor = &bench->base.motor[i];

        fuzz_require(fabs(motor->voltage_v) <= supply_v, "%g V of %g", motor->voltage_v, supply_v);
        fuzz_require(motor->bridge_on || motor->voltage_v == 0.0, "%g V with the bridge open",
                     motor->voltage_v);
    }
}

/* Texts are as long as they are; a saturated STRAIN board adds a byte that says so; a bootloader
 * has no build number. */
static bool is_length(const struct message *message, uint8_t len)
{
    const bool strain = message->length == ICUB_STRAIN_LENGTH && message->id >> 8 == 3;

    return len == message->length || (strain && len == ICUB_STRAIN_SATURATED_LENGTH) ||
           (strcmp(message->name, "PRINT") == 0 && len > 2 && len < message->length) ||
           (message->code == ICUB_DISCOVER && len == message->length - 1);
}

/* On iCub buses bits 4 to 7 are the sender's address, and bits 0 to 3 of an answer are the address
 * that has asked, which need not be the host's. */
static bool is_id(const struct fuzz_bench *bench, size_t bus, const struct message *message,
                  uint32_t id)
{
    const bool icub = bus == 1 || spoken == &protocol_icub;
    uint32_t any = bench->moved ? 0x0f0 : 0;

    if (icub && message->family && strstr(message->family, "REPLY") &&
        bench->asked[bus] >> (id & 0xf) & 1) {
        any |= 0x00f;
    }
    return (id | any) == (message->id | any);
}

static bool is_message(const struct fuzz_bench *bench, size_t bus, const struct message *message,
                       const struct bus_frame *frame)
{
    const size_t bytes = fields_bytes(message->fields);
    int64_t values[FIELDS_MAX];

    if (!is_id(bench, bus, message, frame->id) || !is_length(message, frame->len)) {
        return false;
    }
    /* bit 7 is the axis */
    if (message->code != MESSAGE_NO_CODE && (frame->data[0] & 0x7f) != (message->code & 0x7f)) {
        return false;
    }
    for (uint8_t k = 0; k < message->repeats; k++) {
        const size_t at = message->first_byte + k * bytes;

        if (!fields_decode(message->fields, frame->data + at, frame->len - at, values)) {
            return false;
        }
    }
    return true;
}

static void check_frame(const struct fuzz_bench *bench, size_t bus, const struct bus_frame *frame)
{
    const unsigned flags = bench->bus[bus].fd ? FRAME_FD | FRAME_BRS : 0;
    const bool free_layout = spoken->print_appendix && bus == 0; /* frames hold what the host has
                                                                  * chosen from the page's end */
    const bool free_format = spoken->canfd_only && bus == 0;     /* they have the request's */
    size_t i = 0;

    fuzz_require(frame_valid(frame) && frame->node < BENCH_BOARDS &&
                     (free_format || (frame->id <= 0x7ff && frame->flags == flags)),
                 "id 0x%x flags 0x%x length %u", frame->id, frame->flags, frame->len);
    while (!bench->garbage && !free_layout && i < bench->nmessage[bus] &&
           !is_message(bench, bus, &bench->message[bus][i], frame)) {
        i++;
    }
    fuzz_require(bench->garbage || free_layout || i < bench->nmessage[bus],
                 "no such message: id 0x%x length %u: %02x %02x %02x %02x %02x %02x %02x %02x",
                 frame->id, frame->len, frame->data[0], frame->data[1], frame->data[2],
                 frame->data[3], frame->data[4], frame->data[5], frame->data[6], frame->data[7]);
}

static void drain_events(struct fuzz_bench *bench)
{
    struct board_event event;
    char text[256];

    while (boards_next_event(bench->base.boards, &event)) {
        bench->hash = hash_bytes(bench->hash, &event.kind, sizeof event.kind);
        bench->moved = bench->moved || event.kind == BOARD_EVENT_ADDRESS;
        armed = false; /* not for the loop */
        board_event_format(bench->base.boards, &event, text, sizeof text);
        armed = true;
        fuzz_require(fuzz_is_sentence(text) && strlen(text) > 10, "%s", text);
    }
}

static void check_counters(const struct fuzz_bench *bench)
{
    const struct boards_counters counters = bench_counters(&bench->base);

    /* boards whose receiver is off do not count */
    fuzz_require(counters.frames + counters.foreign <= bench->received,
                 "%" PRIu64 " and %" PRIu64 " of %" PRIu64, counters.frames, counters.foreign,
                 bench->received);
    fuzz_require(counters.unknown + counters.malformed <= counters.frames, "more bad than all");
}

/* ---- what happens ---- */

static void tick(struct fuzz_bench *bench)
{
    struct board_bench *base = &bench->base;

    bench->ticks++;
    faults_step(bench->faults, base->now_ns);
    bench->sampled_v = bench->supply_v;
    bench->supply_v = base->sensors.supply_v;
    bench_control(base);
    check_commands(bench);
    bench->hash = hash_bytes(bench->hash, base->motor, sizeof base->motor);
    bench->hash = hash_bytes(bench->hash, &(bool){boards_fault(base->boards)}, sizeof(bool));
    boards_sample(base->boards, base->now_ns, &base->sensors);
    for (size_t bus = 0; bus < BENCH_BUSES; bus++) {
        const size_t most = boards_transmit_max(base->boards, bus);
        const size_t room = bench->room < most ? bench->room : most;
        const size_t count =
            boards_transmit(base->boards, base->now_ns, bus, base->frame[bus], room);

        fuzz_require(count <= room, "%zu frames, room for %zu", count, room);
        drain_events(bench);
        for (size_t i = 0; i < count; i++) {
            const struct bus_frame *frame = &base->frame[bus][i];

            check_frame(bench, bus, frame);
            bench->hash = hash_bytes(bench->hash, &frame->id, sizeof frame->id);
            bench->hash = hash_bytes(bench->hash, frame->data, frame->len);
        }
    }
    bench->room = BENCH_FRAMES;
}

static void receive(struct fuzz_bench *bench, size_t bus, const struct bus_frame *frame)
{
    boards_receive(bench->base.boards, bench->base.now_ns, bus, frame);
    bench->asked[bus] |= 1u << (frame->id >> 4 & 0xf);
    bench->received++;
}

/* Brings an SDO request near to one that is obeyed: its length, a command, and an index of the
 * dictionary that the first bytes choose. */
static void make_request(struct bus_frame *frame, uint8_t which)
{
    static const uint8_t commands[] = {0x40, 0x2f, 0x2b, 0x23, 0x21, 0x60, 0x00, 0x22,
                                       0xa4, 0xa3, 0xa2, 0xa1, 0xc6, 0xc1, 0xc0, 0xa0};
    static const uint16_t pages[] = {0x1000, 0x1400, 0x1600, 0x1800, 0x1a00, 0x4000,
                                     0x6040, 0x6080, 0x4800, 0x6840, 0x1440, 0x1840,
                                     0x2000, 0x2100, 0x7130, 0x1010};
    uint16_t index = (uint16_t)(pages[frame->data[1] & 0xf] + (frame->data[2] & 0x3f));

    if (which & 0x80) {
        return; /* any request */
    }
    frame->len = 8;
    frame->data[0] = (uint8_t)(commands[frame->data[0] & 0xf] | (frame->data[0] & 0x10));
    if (frame->data[0] == 0xa2) {
        return; /* what it acknowledges stands where others have the index */
    }
    put_u16_le(frame->data + 1, index);
    frame->data[3] &= which & 0x40 ? 0xff : 3;
}

/* Brings an LSS request near to one that is obeyed: a command, and of those that select or scan the
 * address of the node 1 of bus 0. */
static void make_lss_request(struct bus_frame *frame, uint8_t which)
{
    static const uint8_t commands[] = {0x04, 0x11, 0x13, 0x15, 0x17, 0x40, 0x41, 0x42,
                                       0x43, 0x51, 0x51, 0x5a, 0x5d, 0x5e, 0x11, 0x04};
    static const uint32_t address[] = {0, 0x48494c00, 0x10000, 1};

    if (which & 0x80) {
        return;
    }
    frame->len = 8;
    frame->data[0] = commands[frame->data[0] & 0xf];
    if (frame->data[0] == 0x51) {
        frame->data[5] = frame->data[5] & 0x40 ? 0x80 : frame->data[5] & 0x1f;
        frame->data[6] &= 3;
        frame->data[7] &= 3;
        put_u32_le(frame->data + 1, address[frame->data[6]]);
    } else if (frame->data[0] >= 0x40 && frame->data[0] <= 0x43) {
        put_u32_le(frame->data + 1, address[frame->data[0] & 3]);
    } else {
        frame->data[1] = frame->data[1] & 0x80 ? 255 : frame->data[1] & 0x21;
    }
}

/* A frame that some board is likely to take: the right identifier and length. */
static void receive_likely(struct fuzz_bench *bench, struct fuzz_bytes *bytes, uint8_t what)
{
    static const uint16_t icub[] = {0x001, 0x002, 0x00f, 0x20c, 0x20d, 0x20f, 0x701, 0x702,
                                    0x70c, 0x70d, 0x70f, 0x35a, 0x35b, 0x30c, 0x3ca, 0x3cb};
    static const uint16_t foc[] = {0x001, 0x002, 0x10f, 0x701, 0x702, 0x20d, 0x70f, 0x00f};
    static const uint16_t compact[] = {0x020, 0x040, 0x041, 0x042, 0x680, 0x681, 0x682, 0x683,
                                       0x68d, 0x7e0, 0x7e1, 0x7c1, 0x060, 0x080, 0x6a1, 0x000};
    static const uint16_t cia402[] = {0x000, 0x080, 0x201, 0x301, 0x401, 0x501, 0x601, 0x601,
                                      0x602, 0x60d, 0x701, 0x764, 0x202, 0x7e5, 0x601, 0x7e5};
    struct bus_frame frame = {.id = what >> 4 & 1};
    const size_t bus = frame.id;
    const uint8_t which = fuzz_u8(bytes);

    if (bus == 1 || spoken == &protocol_icub) {
        frame.id = icub[which & 0xf];
    } else if (spoken == &protocol_foc) {
        frame.id = foc[which & 7];
    } else if (spoken == &protocol_cia402) {
        frame.id = cia402[which & 0xf];
        frame.flags = frame.id == 0x701 ? FRAME_REMOTE : 0;
    } else if (spoken == &protocol_compact || spoken == &protocol_described) {
        frame.id = compact[which & 0xf];
        frame.flags = bench->bus[0].fd ? FRAME_FD | FRAME_BRS : 0;
    } else {
        const struct message *message = &bench->command[bus][which % bench->ncommand[bus]];

        frame.id = message->id;
        frame.flags = (message->extended ? FRAME_EXTENDED : 0) |
                      (bench->bus[0].fd ? FRAME_FD | FRAME_BRS : 0);
    }
    frame.len = what & 0xf;
    if (frame.len > 8) {
        frame.len = frame.flags & FRAME_FD ? frame_fd_length(4u * frame.len) : 8;
    }
    fuzz_copy(bytes, frame.data, frame.len);
    if (spoken->write_eds && bus == 0 && frame.id > 0x600 && frame.id < 0x700) {
        make_request(&frame, which);
    } else if (spoken->write_eds && bus == 0 && frame.id == 0x7e5) {
        make_lss_request(&frame, which);
    }
    receive(bench, bus, &frame);
}

static void change_sensor(struct fuzz_bench *bench, struct fuzz_bytes *bytes, uint8_t what)
{
    struct motor_sense *sense = &bench->base.sense[(what & 7) % BENCH_JOINTS];

    switch (what >> 3 & 7) {
    case 0:
        sense->q = fuzz_real(bytes, 4.0);
        break;
    case 1:
        sense->qm = fuzz_real(bytes, 4.0);
        break;
    case 2:
        sense->current_a = fuzz_real(bytes, 40.0);
        break;
    case 3:
        sense->torque_nm = fuzz_real(bytes, 100.0);
        break;
    case 4:
        sense->qd = fuzz_real(bytes, 10.0);
        sense->qmd = fuzz_real(bytes, 10.0);
        break;
    case 5:
        sense->winding_c = fuzz_real(bytes, 200.0);
        break;
    case 6:
        bench->base.ft.force_n[what % 3] = fuzz_real(bytes, 4000.0);
        bench->base.sensors.imu.accel_m_s2[what % 3] = bench->base.ft.force_n[what % 3];
        bench->base.sensors.imu.gyro_rad_s[what % 3] = bench->base.ft.force_n[what % 3] / 20.0;
        bench->base.sensors.imu.quaternion[what % 4] = bench->base.ft.force_n[what % 3] / 4000.0;
        bench->base.ft.torque_nm[what % 3] = fuzz_real(bytes, 80.0);
        break;
    default:
        bench->base.sensors.supply_v = fuzz_real(bytes, 60.0);
        break;
    }
}

/* iCub: after the command to be idle nothing that a host says closes the bridge, but a mode. */
static void go_idle(struct fuzz_bench *bench)
{
    static const struct bus_frame idle = {.id = 1, .len = 2, .data = {0x09, 0x00}};
    static const struct bus_frame pwm = {.id = 1, .len = 3, .data = {0x72, 0x35, 0x05}};
    const size_t bus = 1; /* whatever bus 0 speaks */

    /* Its address may have changed since the last tick */
    drain_events(bench);
    if (bench->moved || bench->loose) {
        return;
    }
    receive(bench, bus, &idle);
    receive(bench, bus, &pwm);
    tick(bench);
    tick(bench);
    fuzz_require(!bench->base.motor[3].bridge_on || bench->base.config.tick_ns < 1000000,
                 "the bridge is on in idle");
}

static void shut_down(struct fuzz_bench *bench)
{
    boards_shut_down(bench->base.boards, bench->base.now_ns, &bench->base.command);
    for (int i = 0; i < BENCH_JOINTS; i++) {
        fuzz_require(!bench->base.motor[i].bridge_on && bench->base.motor[i].voltage_v == 0.0,
                     "joint %d is on after the end", i);
    }
}

static void break_board(struct fuzz_bench *bench, uint8_t what)
{
    const size_t fault = what % FAULTS;

    faults_set(bench->faults, bench->base.now_ns, fault, what & 0x10);
    bench->garbage = bench->garbage || faults_at(bench->faults, fault)->kind == FAULT_GARBAGE;
    bench->hung = bench->hung || faults_at(bench->faults, fault)->kind == FAULT_HUNG;
    bench->loose = bench->loose || faults_at(bench->faults, fault)->kind == FAULT_INTERMITTENT;
}

static void act(struct fuzz_bench *bench, struct fuzz_bytes *bytes)
{
    const uint8_t what = fuzz_u8(bytes);
    struct board_can_state state;
    struct bus_frame frame;

    switch (what >> 5) {
    case 0:
        for (int i = 1 + (what & 3) * (what & 0x1c); i > 0 && bench->ticks < TICKS_MAX; i--) {
            tick(bench);
        }
        break;
    case 1:
    case 2:
    case 3:
        receive_likely(bench, bytes, what);
        break;
    case 4:
        fuzz_frame(bytes, &frame);
        receive(bench, what & 1, &frame);
        break;
    case 5:
    case 6:
        change_sensor(bench, bytes, what - 0xa0);
        break;
    default:
        if (what < 0xe8) {
            go_idle(bench);
        } else if (what < 0xea) {
            shut_down(bench);
        } else if (what < 0xec) {
            state = (struct board_can_state){fuzz_u8(bytes), fuzz_u8(bytes), what & 1};
            boards_set_can_state(bench->base.boards, fuzz_u8(bytes) % bench->base.config.nboard,
                                 &state);
        } else if (what < 0xee) {
            bench->room = fuzz_u8(bytes) % 8;
        } else {
            break_board(bench, fuzz_u8(bytes));
        }
    }
}

/* Returns the hash of everything that the boards said and commanded. */
static uint64_t run(const uint8_t *data, size_t size)
{
    static struct fuzz_bench bench;
    struct fuzz_bytes bytes = {data, size};

    start(&bench, &bytes);
    armed = true;
    while (bytes.left > 0 && bench.ticks < TICKS_MAX) {
        act(&bench, &bytes);
    }
    tick(&bench);
    check_counters(&bench);
    armed = false;
    return bench.hash;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const uint64_t hash = run(data, size);

    fuzz_require(size % 8 || run(data, size) == hash, "other answers the second time");
    return 0;
}
