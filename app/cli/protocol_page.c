/* SPDX-License-Identifier: Apache-2.0 */
/* Pages on what the boards speak. */
#include "app/cli/protocol_page.h"

#include "app/cli/object_list.h"
#include "base/count.h"
#include "base/options.h"
#include "boards/compact/table.h"
#include "boards/described/protocol.h"
#include "boards/messages.h"
#include "manual/protocol_cia402.h"
#include "manual/protocol_compact.h"
#include "manual/protocol_foc.h"
#include "manual/protocol_icub.h"

#include <inttypes.h>
#include <stdarg.h>
#include <string.h>

enum { FRAMES_MAX = 512, SECTIONS_MAX = 8 };

/* A frame with its identifier as base + step * address. */
struct protocol_frame {
    struct message message;
    uint32_t base, step;
    const char *counts; /* what the address is called */
    bool cycle_varies;  /* with the address */
    bool by_axis;       /* cia402: the identifier grows with the axis */
    bool described;
    bool printed;
};

struct protocol_frames {
    const struct described_protocol *described; /* NULL: of a personality in C */
    size_t count;
    struct protocol_frame frame[FRAMES_MAX];
};

/* ---- the frames of a bus with a motor, a force-torque and an inertial board ---- */

/* Addresses by board, in the first of two walks */
enum { BENCH_MOTOR, BENCH_FT, BENCH_INERTIAL };
static const uint8_t bench_address[] = {[BENCH_MOTOR] = 1, [BENCH_FT] = 3, [BENCH_INERTIAL] = 5};

static bool protocol_keep_message(void *context, const struct message *message)
{
    struct protocol_frames *frames = context;

    if (frames->count < FRAMES_MAX) {
        frames->frame[frames->count++].message = *message;
    }
    return true;
}

/* shift is added to all addresses: what moves with it in an identifier is the address. */
static void protocol_walk_bus(const struct boards_bus_config *bus, int shift,
                              struct protocol_frames *frames)
{
    const int axes = bus->personality == BOARD_COMPACT || bus->personality == BOARD_CIA402
                         ? BOARD_AXES_MAX
                     : bus->described ? (int)bus->described->axes
                                      : 1;
    struct board_config board[] = {
        {.kind = BOARD_MOTOR, .address = (uint8_t)(bench_address[BENCH_MOTOR] + shift)},
        {.kind = BOARD_FT, .address = (uint8_t)(bench_address[BENCH_FT] + shift)},
        {.kind = BOARD_INERTIAL, .address = (uint8_t)(bench_address[BENCH_INERTIAL] + shift)},
    };
    const struct boards_config config = {
        .nboard = ARRAY_COUNT(board), .board = board, .nbus = 1, .bus = bus, .tick_ns = 1000000};

    for (int k = 0; k < BOARD_AXES_MAX; k++) {
        board[0].axis[k].joint = k < axes ? k : -1;
    }
    frames->count = 0;
    boards_messages(&config, 0, protocol_keep_message, frames);
}

static bool protocol_is_known(const struct protocol_frames *frames, size_t count,
                              const struct protocol_frame *frame)
{
    for (size_t i = 0; i < count; i++) {
        const struct protocol_frame *other = &frames->frame[i];

        if (other->base == frame->base && other->step == frame->step &&
            other->message.code == frame->message.code &&
            !strcmp(other->message.name, frame->message.name)) {
            return true;
        }
    }
    return false;
}

/* A described frame says itself what its identifier counts. */
static void protocol_split_described(struct protocol_frame *frame,
                                     const struct described_protocol *protocol)
{
    static const char *const counts[] = {[DESCRIBED_BY_NONE] = "a",
                                         [DESCRIBED_BY_ADDRESS] = "a",
                                         [DESCRIBED_BY_SLOT] = "s",
                                         [DESCRIBED_BY_GROUP] = "g"};

    for (size_t i = 0; i < protocol->nframe; i++) {
        const struct described_frame *row = &protocol->frame[i];

        if (row->layout == frame->message.fields) {
            frame->base = row->base;
            frame->step = row->by == DESCRIBED_BY_NONE ? 0 : row->step;
            frame->counts = counts[row->by];
            frame->described = true;
        }
    }
}

static void protocol_split_id(struct protocol_frame *frame, const struct message *shifted,
                              enum board_personality personality)
{
    const struct message *message = &frame->message;
    int board = message->from_host ? message->receiver : message->sender;
    const struct compact_message *row = compact_message(message->id >> 5);

    frame->step = shifted->id - message->id;
    frame->cycle_varies = shifted->cycle_ns != message->cycle_ns;
    frame->base = message->id - frame->step * (board < 0 ? 0u : bench_address[board]);
    frame->counts = personality == BOARD_COMPACT || personality == BOARD_CIA402 ? "n" : "a";
    if (personality == BOARD_CIA402) {
        frame->by_axis = message->slot >= 0;
        frame->base -= 0x100 * (uint32_t)(frame->by_axis ? message->slot : 0);
    } else if (message->slot >= 0) {
        frame->base = message->id - (uint32_t)message->slot;
        frame->step = 1;
        frame->counts = "s";
    } else if (personality == BOARD_COMPACT && row && row->by == COMPACT_BY_GROUP) {
        frame->step = 1;
        frame->base = message->id;
        frame->counts = "g";
    }
}

/* Every frame once, whichever board or slot it is of. */
static void protocol_collect(const struct boards_bus_config *bus, struct protocol_frames *frames)
{
    static struct protocol_frames shifted;
    size_t kept = 0;

    protocol_walk_bus(bus, 0, frames);
    protocol_walk_bus(bus, 1, &shifted);
    for (size_t i = 0; i < frames->count; i++) {
        struct protocol_frame frame = {.message = frames->frame[i].message};

        protocol_split_id(&frame, &shifted.frame[i].message, bus->personality);
        if (bus->described) {
            protocol_split_described(&frame, bus->described);
        }
        if (!protocol_is_known(frames, kept, &frame)) {
            frames->frame[kept++] = frame;
        }
    }
    frames->count = kept;
}

/* ---- fields ---- */

/* A line that is wrapped when it is complete. */
struct protocol_line {
    size_t used;
    char text[2048];
};

static void __attribute__((format(printf, 2, 3)))
protocol_add_text(struct protocol_line *line, const char *format, ...)
{
    size_t room = sizeof line->text - line->used;
    va_list arguments;
    int length;

    va_start(arguments, format);
    length = vsnprintf(line->text + line->used, room, format, arguments);
    va_end(arguments);
    line->used += length < 0 ? 0 : (size_t)length < room ? (size_t)length : room - 1;
}

/* What makes a described field more than a number; "" = nothing. */
static void protocol_add_role(struct protocol_line *line, const struct described_frame *row,
                              size_t index)
{
    if (row && (int)index == row->counter) {
        protocol_add_text(line, ", counts the frames");
    } else if (row && row->field[index].meaning == DESCRIBED_CHECKSUM) {
        protocol_add_text(line, ", %s of the other bytes", described_checksum_name(row->checksum));
    }
}

static void protocol_add_place(struct protocol_line *line, unsigned bit, unsigned bits)
{
    if (bits == 1) {
        protocol_add_text(line, "- bit %u", bit);
    } else if (bit % 8 || bits % 8) {
        protocol_add_text(line, "- bits %u-%u", bit, bit + bits - 1);
    } else if (bits == 8) {
        protocol_add_text(line, "- byte %u", bit / 8);
    } else {
        protocol_add_text(line, "- bytes %u-%u", bit / 8, (bit + bits) / 8 - 1);
    }
}

/* Unit and scale, and the range where it is not that of the type. */
static void protocol_add_measure(struct protocol_line *line, const struct field *field)
{
    double scale = field->scale != 0.0 ? field->scale : 1.0;
    bool limited = field->min || field->max;
    const char *unit = field->unit ? field->unit : "";

    if (field->unit && scale == 1.0) {
        protocol_add_text(line, ", %s", unit);
    } else if (field->unit) {
        protocol_add_text(line, ", in %g %s", scale, unit);
    }
    if (limited || (scale != 1.0 && !(field->type & FIELD_FLOAT))) {
        int64_t low = limited ? field->min : field_lowest(field);
        int64_t high = limited ? field->max : field_highest(field);

        protocol_add_text(line, ", %.10g to %.10g%s%s", scale * (double)low + field->offset,
                          scale * (double)high + field->offset, *unit ? " " : "", unit);
    }
}

/* A field with the row and the index that it has in it when it is described. */
static void protocol_put_field(const struct field *field, unsigned bit, bool in_id,
                               const struct described_frame *row, size_t index, FILE *out)
{
    unsigned bits = field->type & FIELD_BITS_MASK;
    struct protocol_line line = {.used = 0};

    if (in_id) {
        protocol_add_text(&line, bits == 1 ? "- identifier bit %u" : "- identifier bits %u-%u", bit,
                          bit + bits - 1);
    } else {
        protocol_add_place(&line, bit, bits);
    }
    protocol_add_text(&line, " `%s`: %c%u%s", field->name,
                      field->type & FIELD_FLOAT    ? 'f'
                      : field->type & FIELD_SIGNED ? 'i'
                                                   : 'u',
                      bits, field->type & FIELD_BIG_ENDIAN ? " be" : "");
    protocol_add_measure(&line, field);
    protocol_add_role(&line, row, index);
    for (const struct field_value *v = field->values; v && v->name; v++) {
        protocol_add_text(&line, "%s %" PRId64 " = %s", v == field->values ? ";" : ",", v->value,
                          v->name);
    }
    options_wrap(line.text, 0, 2, out);
}

/* The fields of a list, the first of which is at a bit of data or identifier; returns how many. */
static size_t protocol_put_list(const struct field *fields, unsigned bit, bool in_id,
                                const struct described_frame *row, size_t index, FILE *out)
{
    for (const struct field *field = fields; field && field->type != FIELD_END; field++) {
        if (!(field->type & FIELD_PADDING)) {
            protocol_put_field(field, bit, in_id, row, index++, out);
        }
        bit += field->type & FIELD_BITS_MASK;
    }
    return index;
}

static void protocol_put_fields(const struct message *message, const struct described_frame *row,
                                FILE *out)
{
    size_t bytes = fields_bytes(message->fields), count;

    if (fields_count(message->fields) == 0 && !message->id_fields) {
        return;
    }
    if (message->repeats > 1) {
        fprintf(out, "\nFor each of its axes or slots, %zu bytes apart:\n", bytes);
    }
    putc('\n', out);
    count = protocol_put_list(message->fields, 8u * message->first_byte, false, row, 0, out);
    protocol_put_list(message->id_fields, 0, true, row, count, out);
}

/* ---- frames ---- */

static void protocol_put_id(const struct protocol_frame *frame, FILE *out)
{
    const struct message *message = &frame->message;

    fprintf(out, "id 0x%0*" PRIx32, message->extended ? 8 : 3, frame->base);
    if (frame->step == 1) {
        fprintf(out, " + %s", frame->counts);
    } else if (frame->step > 1) {
        fprintf(out, " + 0x%" PRIx32 " %s", frame->step, frame->counts);
    }
    if (frame->by_axis) {
        fputs(" + 0x100 k", out);
    }
    if (message->code != MESSAGE_NO_CODE) {
        fprintf(out, ", byte 0 = 0x%02x", (unsigned)message->code);
    }
    if (message->shortest && message->shortest != message->length) {
        fprintf(out, ", %u to %u bytes", message->shortest, message->length);
    } else {
        fprintf(out, ", %u byte%s", message->length, message->length == 1 ? "" : "s");
    }
    if (message->extended) {
        fputs(", 29-bit identifier", out);
    }
    if (message->fd && frame->described) {
        fprintf(out, ", CAN FD%s", message->bit_rate_switch ? " with bit rate switch" : "");
    }
    if (message->cycle_ns) {
        fprintf(out, ", every %g ms%s", message->cycle_ns * 1e-6,
                frame->cycle_varies ? " at address 1" : "");
    }
}

/* The row of a described frame; NULL without a described protocol. */
static const struct described_frame *protocol_find_row(const struct described_protocol *protocol,
                                                       const struct protocol_frame *frame)
{
    for (size_t i = 0; protocol && i < protocol->nframe; i++) {
        if (protocol->frame[i].layout == frame->message.fields) {
            return &protocol->frame[i];
        }
    }
    return NULL;
}

static struct protocol_frame *protocol_find_described_answer(struct protocol_frames *frames,
                                                             const struct protocol_frame *frame)
{
    const struct described_frame *row = protocol_find_row(frames->described, frame);

    for (size_t i = 0; row && i < frames->count; i++) {
        for (int kind = 0; kind < 3; kind++) {
            if (row->reply[kind] >= 0 && protocol_find_row(frames->described, &frames->frame[i]) ==
                                             &frames->described->frame[row->reply[kind]]) {
                return &frames->frame[i];
            }
        }
    }
    return NULL;
}

/* The frame by which a board answers a command; NULL = none. */
static struct protocol_frame *protocol_find_answer(struct protocol_frames *frames,
                                                   const struct protocol_frame *frame)
{
    static const char *const pairs[][2] = {
        {"REQUEST", "REPLY"}, {"DISCOVER", "IDENTITY"}, {"SDO_REQUEST", "SDO_REPLY"}};

    if (frames->described) {
        return protocol_find_described_answer(frames, frame);
    }
    for (size_t i = 0; i < frames->count && frame->message.from_host; i++) {
        struct protocol_frame *other = &frames->frame[i];

        if (other->message.from_host || other->message.code != frame->message.code) {
            continue;
        }
        if (frame->message.code != MESSAGE_NO_CODE &&
            !strcmp(other->message.name, frame->message.name)) {
            return other;
        }
        for (size_t k = 0; k < ARRAY_COUNT(pairs); k++) {
            if (!strcmp(frame->message.name, pairs[k][0]) &&
                !strcmp(other->message.name, pairs[k][1])) {
                return other;
            }
        }
    }
    return NULL;
}

static void protocol_put_frame(struct protocol_frames *frames, struct protocol_frame *frame,
                               FILE *out)
{
    struct protocol_frame *answer = protocol_find_answer(frames, frame);

    fprintf(out, "\n### %s\n\n%s, ", frame->message.name,
            frame->message.from_host ? "Host to board" : "Board to host");
    protocol_put_id(frame, out);
    if (!frame->message.from_host && !frame->message.cycle_ns) {
        fputs(", when there is something to tell", out);
    }
    fputs(".\n", out);
    protocol_put_fields(&frame->message, protocol_find_row(frames->described, frame), out);
    frame->printed = true;
    if (answer) {
        fputs("\nAnswer: ", out);
        if (strcmp(answer->message.name, frame->message.name) != 0) {
            fprintf(out, "%s, ", answer->message.name);
        }
        protocol_put_id(answer, out);
        fputs(".\n", out);
        if (!frames->described || !answer->printed) {
            protocol_put_fields(&answer->message, protocol_find_row(frames->described, answer),
                                out);
        }
        answer->printed = true;
    }
}

/* ---- sections ---- */

static const struct protocol_section {
    const char *title;
    int class_of_id; /* of an iCub identifier; -1: of other frames */
    int board;       /* on the bench; -1: of any */
    bool from_host;
} sections[] = {
    {"Targets and telemetry of motor boards", 1, -1, false},
    {"Commands of motor boards", 0, -1, false},
    {"Telemetry of STRAIN boards", 3, -1, false},
    {"Commands of STRAIN boards", 2, BENCH_FT, false},
    {"Telemetry of inertial boards", 5, -1, false},
    {"Commands of inertial boards", 2, BENCH_INERTIAL, false},
    {"Management of all boards", 7, -1, false},
    {"From the host", -1, -1, true},
    {"From boards", -1, -1, false},
};

static bool protocol_belongs(const struct protocol_section *section,
                             const struct protocol_frame *frame, bool classless)
{
    const struct message *message = &frame->message;
    int board = message->from_host ? message->receiver : message->sender;

    return classless ? section->class_of_id < 0 && section->from_host == message->from_host
                     : section->class_of_id == (int)(message->id >> 8) &&
                           (section->board < 0 || section->board == board);
}

static void protocol_put_sections(struct protocol_frames *frames, bool classless, FILE *out)
{
    for (size_t s = 0; s < ARRAY_COUNT(sections); s++) {
        bool titled = false;

        for (size_t i = 0; i < frames->count; i++) {
            struct protocol_frame *frame = &frames->frame[i];

            if (frame->printed || !protocol_belongs(&sections[s], frame, classless)) {
                continue;
            }
            if (!titled) {
                fprintf(out, "\n## %s\n", sections[s].title);
                titled = true;
            }
            protocol_put_frame(frames, frame, out);
        }
    }
}

/* On CAN FD: frames that a classic bus does not have, or that are longer there. */
static void protocol_put_fd(const struct protocol_frames *classic, FILE *out)
{
    static struct protocol_frames frames;

    protocol_collect(&(struct boards_bus_config){.personality = BOARD_COMPACT, .fd = true},
                     &frames);
    fputs("\n## On CAN FD buses\n\nThe frames above but telemetry and forces, which are these:\n",
          out);
    for (size_t i = 0; i < frames.count; i++) {
        struct protocol_frame *frame = &frames.frame[i];

        if (!protocol_is_known(classic, classic->count, frame)) {
            protocol_put_frame(&frames, frame, out);
        }
    }
}

static void protocol_put_faults(enum board_personality personality, FILE *out)
{
    const char *const *names = board_fault_names(personality);

    fputs("\n## Faults\n\nThe bits of the fields `fault` and `faults` of an axis:\n\n", out);
    for (int bit = 0; names[bit]; bit++) {
        fprintf(out, "- bit %d: %s\n", bit, names[bit]);
    }
}

void protocol_page_print(enum board_personality personality, FILE *out)
{
    static const char *const name[] = {[BOARD_ICUB] = "icub",
                                       [BOARD_FOC] = "foc",
                                       [BOARD_COMPACT] = "compact",
                                       [BOARD_CIA402] = "cia402"};
    static const char *const intro[] = {[BOARD_ICUB] = MANUAL_PROTOCOL_ICUB,
                                        [BOARD_FOC] = MANUAL_PROTOCOL_FOC,
                                        [BOARD_COMPACT] = MANUAL_PROTOCOL_COMPACT,
                                        [BOARD_CIA402] = MANUAL_PROTOCOL_CIA402};
    static struct protocol_frames frames;

    fprintf(out, "# What `%s` boards speak\n\n", name[personality]);
    options_wrap(intro[personality], 0, 0, out);
    protocol_collect(&(struct boards_bus_config){.personality = personality}, &frames);
    protocol_put_sections(&frames, personality != BOARD_ICUB && personality != BOARD_FOC, out);
    if (personality == BOARD_COMPACT) {
        protocol_put_fd(&frames, out);
    }
    protocol_put_faults(personality, out);
    if (personality == BOARD_CIA402) {
        object_list_print(out);
    }
}

void protocol_page_print_described(const struct described_protocol *protocol, FILE *out)
{
    static struct protocol_frames frames;

    fprintf(out, "# What `%s` boards speak\n\n", protocol->name);
    options_wrap(protocol->description, 0, 0, out);
    protocol_collect(
        &(struct boards_bus_config){.personality = BOARD_DESCRIBED, .described = protocol},
        &frames);
    frames.described = protocol;
    protocol_put_sections(&frames, true, out);
    if (protocol->tells[DESCRIBED_FAULTS]) {
        fputs("\n## Faults\n\nThe bits of its fields of faults:\n\n", out);
    }
    for (int i = 0; i < DESCRIBED_FAULT_KINDS; i++) {
        if (protocol->fault_bit[i] >= 0 && protocol->tells[DESCRIBED_FAULTS]) {
            fprintf(out, "- bit %d: %s\n", protocol->fault_bit[i], described_fault_names[i]);
        }
    }
}
