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

enum { MEMORY = 16 << 20, TICKS_MAX = 200, IDS = 0x800 };

struct described_run {
    struct board_bench base;
    struct boards_bus_config bus[BENCH_BUSES];
    const struct described_protocol *protocol;
    uint8_t length[IDS]; /* of frames from boards, plus 1; 0: there is none */
    int ticks;
};

/* ---- the table ---- */

static void check_fields(const struct described_frame *frame)
{
    uint8_t data[DESCRIBED_LENGTH_MAX] = {0};
    int64_t counts[FIELDS_MAX] = {0}, again[FIELDS_MAX] = {0};

    fuzz_require(frame->length * frame->repeats <= DESCRIBED_LENGTH_MAX, "%d bytes", frame->length);
    fuzz_require(fields_bits(frame->layout) == 8u * frame->length, "%zu bits of %d bytes",
                 fields_bits(frame->layout), frame->length);
    fuzz_require(fields_count(frame->layout) == frame->nfield, "%zu fields", frame->nfield);
    for (size_t i = 0; i < frame->nfield; i++) {
        const struct field *layout = described_layout(frame, i);
        const struct described_field *field = &frame->field[i];

        counts[i] = field->meaning == DESCRIBED_CONSTANT
                        ? field->constant
                        : described_count(layout, field, field->scale * 3.0 + field->offset);
        fuzz_require(layout->type & FIELD_FLOAT ||
                         (counts[i] >= field_lowest(layout) && counts[i] <= field_highest(layout)),
                     "count %lld of %s", (long long)counts[i], layout->name);
    }
    fields_encode(frame->layout, counts, data);
    if (!frame->remote && frame->length > 0) {
        fuzz_require(described_match_data(frame, data, frame->length, again) == DESCRIBED_IS,
                     "%s is not itself", frame->name);
        fuzz_require(!memcmp(counts, again, sizeof counts), "%s reads otherwise", frame->name);
    }
}

static bool list_message(void *context, const struct message *message)
{
    struct described_run *run = context;

    fuzz_require(message->id < IDS, "id 0x%x", (unsigned)message->id);
    if (!message->from_host) {
        run->length[message->id] = (uint8_t)(message->length + 1);
    }
    return true;
}

/* ---- the boards ---- */

static void start(struct described_run *run, struct arena *arena)
{
    struct board_bench *base = &run->base;
    struct error error;

    bench_configure(base);
    run->bus[0] =
        (struct boards_bus_config){.personality = BOARD_DESCRIBED, .described = run->protocol};
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

        fuzz_require(frame_valid(frame) && frame->id < IDS && run->length[frame->id] > 0,
                     "no such message: id 0x%x length %d", (unsigned)frame->id, frame->len);
    }
    while (boards_next_event(base->boards, &event)) {
        board_event_format(base->boards, &event, text, sizeof text);
    }
    run->ticks++;
}

/* A frame of the host's with its constants, or any. */
static void receive(struct described_run *run, struct fuzz_bytes *bytes)
{
    const struct described_frame *row =
        &run->protocol->frame[fuzz_u8(bytes) % run->protocol->nframe];
    struct bus_frame frame = {.id = described_id(row, fuzz_u8(bytes) & 3),
                              .len = (uint8_t)(row->length * row->repeats)};
    int64_t counts[FIELDS_MAX];

    fuzz_copy(bytes, frame.data, frame.len);
    fields_decode(row->layout, frame.data, row->length, counts);
    for (size_t i = 0; i < row->nfield; i++) {
        counts[i] =
            row->field[i].meaning == DESCRIBED_CONSTANT ? row->field[i].constant : counts[i];
    }
    fields_encode(row->layout, counts, frame.data);
    frame.flags = row->remote ? FRAME_REMOTE : 0;
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
    if (described_read_text("toy.yaml", (const char *)data, text, arena, &run.protocol, &error)) {
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
