/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Protocol files, and frames for the boards that they describe: an input is the file, then, behind
 * a line "%%%", bytes that choose frames and how the sensors read. The file is refused with its
 * place, or its boards can be made; then counts and values of every field go into each other,
 * voltages stay within the supply, and what the boards send is a message of the list.
 */
#include "boards/described/protocol.h"
#include "boards/messages.h"
#include "tests/fuzz/fuzz.h"
#include "tests/unit/boards/board_bench.h"

enum { MEMORY = 16 << 20, TICKS_MAX = 200, MESSAGES_MAX = 1024 };

struct described_run {
    struct board_bench base;
    struct boards_bus_config bus[BENCH_BUSES];
    const struct described_protocol *protocol;
    struct message message[MESSAGES_MAX]; /* from boards */
    size_t nmessage;
    int ticks;
};

/* ---- the table ---- */

static void check_fields(const struct described_frame *frame)
{
    int64_t counts[DESCRIBED_FIELDS_MAX] = {0}, again[DESCRIBED_FIELDS_MAX] = {0};
    struct bus_frame sent = {.flags = frame->flags, .len = frame->length};
    unsigned number;

    fuzz_require(frame->length * frame->repeats <= DESCRIBED_LENGTH_MAX, "%d bytes", frame->length);
    fuzz_require(fields_bits(frame->layout) == 8u * frame->length, "%zu bits of %d bytes",
                 fields_bits(frame->layout), frame->length);
    fuzz_require(fields_count(frame->layout) + fields_count(frame->id_layout) == frame->nfield,
                 "%zu fields", frame->nfield);
    for (size_t i = 0; i < frame->nfield; i++) {
        const struct field *layout = described_layout(frame, i);
        const struct described_field *field = &frame->field[i];

        counts[i] = field->meaning == DESCRIBED_CONSTANT
                        ? field->constant
                        : described_count(field, field->scale * 3.0 + field->offset);
        fuzz_require(layout->type & FIELD_FLOAT ||
                         (counts[i] >= field_lowest(layout) && counts[i] <= field_highest(layout)),
                     "count %lld of %s", (long long)counts[i], layout->name);
    }
    described_encode(frame, frame->most, 0, counts, &sent);
    fuzz_require(described_number(frame, sent.id, frame->flags & FRAME_EXTENDED, &number) &&
                     number == frame->most,
                 "%s has another number", frame->name);
    if (!frame->remote && frame->length > 0 && frame->repeats == 1) {
        fuzz_require(frame_valid(&sent), "%s is no frame", frame->name);
        fuzz_require(described_match_frame(frame, &sent) == DESCRIBED_IS, "%s is not itself",
                     frame->name);
        if (frame->checksum) {
            int field = described_find_field(frame, DESCRIBED_CHECKSUM);

            counts[field] = sent.data[frame->checksum_byte];
        }
        described_decode(frame, &sent, 0, again);
        fuzz_require(!memcmp(counts, again, sizeof counts), "%s reads otherwise", frame->name);
    }
}

static bool list_message(void *context, const struct message *message)
{
    struct described_run *run = context;

    fuzz_require(message->id <= (message->extended ? 0x1fffffffu : 0x7ffu), "id 0x%x",
                 (unsigned)message->id);
    fuzz_require(run->nmessage < MESSAGES_MAX, "too many messages");
    if (!message->from_host) {
        run->message[run->nmessage++] = *message;
    }
    return true;
}

/* Whether a board of the list sends such a frame. */
static bool is_listed(const struct described_run *run, const struct bus_frame *frame)
{
    for (size_t i = 0; i < run->nmessage; i++) {
        const struct message *m = &run->message[i];
        const struct described_frame *row = m->row;
        unsigned number;

        /* A host may have given the board another address, or its answers another identifier */
        if ((row->answer_id || described_number(row, frame->id, m->extended, &number)) &&
            frame->len == m->length && !(frame->flags & FRAME_EXTENDED) == !m->extended &&
            !(frame->flags & FRAME_FD) == !m->fd) {
            return true;
        }
    }
    return false;
}

/* ---- the boards ---- */

static void start(struct described_run *run, struct arena *arena)
{
    struct board_bench *base = &run->base;
    struct error error;

    bench_configure(base);
    run->bus[0] =
        (struct boards_bus_config){.protocol = &protocol_described, .described = run->protocol};
    for (size_t i = 0; i < run->protocol->nframe; i++) {
        run->bus[0].fd = run->bus[0].fd || run->protocol->frame[i].flags & FRAME_FD;
    }
    base->config.bus = run->bus;
    base->config.nboard = run->protocol->address_max < 3 ? 1 : 3;
    base->board[1] = base->board[3];
    base->board[1].address = 2;
    base->board[2] = (struct board_config){.name = "imu", .kind = BOARD_INERTIAL, .address = 3};
    for (int k = 0; k < BOARD_AXES_MAX; k++) {
        base->board[0].axis[k] = bench_axis(k < (int)run->protocol->axes ? k : -1);
        base->board[0].axis[k].winding_ohm = 0.7;
        base->board[0].axis[k].bemf_v_s_rad = base->board[0].axis[k].torque_nm_a = 4.0;
    }
    fuzz_require(boards_create(&base->config, arena, &base->boards, &error) == ERROR_NONE, "%s",
                 error.text);
    boards_messages(&base->config, 0, list_message, run);
}

static void tick(struct described_run *run)
{
    struct board_bench *base = &run->base;
    struct board_event event;
    char text[256];

    bench_control(base);
    for (int i = 0; i < BENCH_JOINTS; i++) {
        fuzz_require(fabs(base->motor[i].voltage_v) <= SUPPLY_V, "%g V", base->motor[i].voltage_v);
    }
    bench_transmit(base);
    for (size_t i = 0; i < base->count[0]; i++) {
        const struct bus_frame *frame = &base->frame[0][i];

        fuzz_require(frame_valid(frame) && is_listed(run, frame),
                     "no such message: id 0x%x length %d", (unsigned)frame->id, frame->len);
    }
    while (boards_next_event(base->boards, &event)) {
        board_event_format(base->boards, &event, text, sizeof text);
    }
    run->ticks++;
}

/* A frame of the host's with its constants and its checksum, sometimes with a bit that is wrong. */
static void receive(struct described_run *run, struct fuzz_bytes *bytes)
{
    const struct described_frame *row =
        &run->protocol->frame[fuzz_u8(bytes) % run->protocol->nframe];
    const uint8_t how = fuzz_u8(bytes);
    struct bus_frame frame = {.id = fuzz_u32(bytes), .flags = row->flags};
    int64_t counts[DESCRIBED_FIELDS_MAX];

    frame.len = row->flags & FRAME_FD ? frame_fd_length(row->length * row->repeats)
                                      : (uint8_t)(row->length * row->repeats);
    fuzz_copy(bytes, frame.data, frame.len);
    described_decode(row, &frame, 0, counts);
    for (size_t i = 0; i < row->nfield; i++) {
        counts[i] =
            row->field[i].meaning == DESCRIBED_CONSTANT ? row->field[i].constant : counts[i];
    }
    memset(frame.data, 0, row->length);
    described_encode(row, how & 3, 0, counts, &frame);
    frame.data[how >> 2 & 7] ^= how >> 5 == 7 ? 1 << (how & 7) : 0;
    boards_receive(run->base.boards, run->base.now_ns, 0, &frame);
}

static void act(struct described_run *run, struct fuzz_bytes *bytes)
{
    const uint8_t what = fuzz_u8(bytes);
    struct bus_frame frame;

    switch (what & 3) {
    case 0:
        tick(run);
        break;
    case 1:
        run->base.sense[what >> 2 & 3].qm = fuzz_real(bytes, 4.0);
        run->base.sense[what >> 2 & 3].current_a = fuzz_real(bytes, 20.0);
        run->base.ft.force_n[what >> 2 & 1] = fuzz_real(bytes, 4000.0);
        break;
    case 2:
        fuzz_frame(bytes, &frame);
        boards_receive(run->base.boards, run->base.now_ns, 0, &frame);
        break;
    default:
        receive(run, bytes);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char mark[] = "\n%%%\n";
    static struct described_run run;
    const char *end = memmem(data, size, mark, sizeof mark - 1);
    const size_t text = end ? (size_t)(end + 1 - (const char *)data) : size;
    struct fuzz_bytes bytes = {end ? (const uint8_t *)end + sizeof mark - 1 : data + size,
                               end ? size - text - (sizeof mark - 2) : 0};
    struct arena *arena = fuzz_arena(MEMORY);
    struct error error;

    memset(&run, 0, sizeof run);
    if (described_read_text("toy.yaml", (const char *)data, text, false, arena, &run.protocol,
                            &error)) {
        fuzz_require(error.code == ERROR_MEMORY || fuzz_has_place(error.text, "toy.yaml", text),
                     "\"%s\"", error.text);
        fuzz_tally.refused++;
        return 0;
    }
    fuzz_tally.taken++;
    for (size_t i = 0; i < run.protocol->nframe; i++) {
        check_fields(&run.protocol->frame[i]);
    }
    start(&run, arena);
    while (bytes.left > 0 && run.ticks < TICKS_MAX) {
        act(&run, &bytes);
    }
    tick(&run);
    return 0;
}
