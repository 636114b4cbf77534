/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil protocol: prints the frames of a board protocol. */
#include "app/cli/cli.h"

#include "base/array.h"
#include "base/config.h"
#include "base/text.h"
#include "boards/described/protocol.h"
#include "boards/protocol_list.h"
#include "manual/protocol.h"

#include <inttypes.h>
#include <stdarg.h>

enum { FRAMES_MAX = 512 };

/* A frame of the page. */
struct protocol_frame {
    struct message message;
    bool printed; /* already printed, as an answer or in its section */
};

/* All frames of a bus, one of each kind. */
struct protocol_frames {
    const struct protocol *protocol;
    bool fd; /* all frames are CAN FD frames */
    size_t count;
    struct protocol_frame frame[FRAMES_MAX];
};

/* ---- the frames of a bus with a motor, a force-torque and an inertial board ---- */

/* Checks whether the frames have a message already. */
static bool protocol_is_known(const struct protocol_frames *frames, const struct message *message)
{
    for (size_t i = 0; i < frames->count; i++) {
        const struct message *other = &frames->frame[i].message;

        if (other->base == message->base && other->step == message->step &&
            other->code == message->code && !strcmp(other->name, message->name)) {
            return true;
        }
    }
    return false;
}

/* Stores each frame once, even if several boards or slots send it. */
static bool protocol_keep_message(void *context, const struct message *message)
{
    struct protocol_frames *frames = context;

    if (frames->count < FRAMES_MAX && !protocol_is_known(frames, message)) {
        frames->frame[frames->count++] = (struct protocol_frame){.message = *message};
    }
    return true;
}

/* Collects the frames of a bus with a motor, a force-torque and an inertial board. */
static void protocol_collect(const struct boards_bus_config *bus, struct protocol_frames *frames)
{
    const int axes = bus->described ? (int)bus->described->axes : bus->protocol->axes_max;
    struct board_config board[] = {
        {.kind = BOARD_MOTOR, .address = 1},
        {.kind = BOARD_FT, .address = 3},
        {.kind = BOARD_INERTIAL, .address = 5},
    };
    const struct boards_config config = {
        .nboard = ARRAY_COUNT(board), .board = board, .nbus = 1, .bus = bus, .tick_ns = 1000000};

    for (int k = 0; k < BOARD_AXES_MAX; k++) {
        board[0].axis[k].joint = k < axes ? k : -1;
    }
    frames->protocol = bus->protocol;
    frames->fd = bus->fd;
    frames->count = 0;
    boards_messages(&config, 0, protocol_keep_message, frames);
}

/* ---- fields ---- */

/* A line of text, which is wrapped when it is complete. */
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

/* Prints a field with its place, type, measure and named values; index counts fields of data and
 * identifier. */
static void protocol_put_field(const struct field *field, unsigned bit, bool in_id,
                               const struct protocol *protocol, const struct message *message,
                               size_t index, FILE *out)
{
    unsigned bits = field->type & FIELD_BITS_MASK;
    struct protocol_line line = {.used = 0};

    if (in_id) {
        protocol_add_text(&line, bits == 1 ? "- identifier bit %u" : "- identifier bits %u-%u", bit,
                          bit + bits - 1);
    } else {
        /* Adds a field's place: in bits if it does not consist of whole bytes */
        if (bits == 1) {
            protocol_add_text(&line, "- bit %u", bit);
        } else if (bit % 8 || bits % 8) {
            protocol_add_text(&line, "- bits %u-%u", bit, bit + bits - 1);
        } else if (bits == 8) {
            protocol_add_text(&line, "- byte %u", bit / 8);
        } else {
            protocol_add_text(&line, "- bytes %u-%u", bit / 8, (bit + bits) / 8 - 1);
        }
    }
    protocol_add_text(&line, " `%s`: %c%u%s", field->name,
                      field->type & FIELD_FLOAT    ? 'f'
                      : field->type & FIELD_SIGNED ? 'i'
                                                   : 'u',
                      bits, field->type & FIELD_BIG_ENDIAN ? " be" : "");

    /* Add unit and scale, and the range if it is not the range of the type */
    double scale = field->scale != 0.0 ? field->scale : 1.0;
    bool limited = field->min || field->max;
    const char *unit = field->unit ? field->unit : "";

    if (field->unit && scale == 1.0) {
        protocol_add_text(&line, ", %s", unit);
    } else if (field->unit) {
        protocol_add_text(&line, ", in %g %s", scale, unit);
    }
    if (limited || (scale != 1.0 && !(field->type & FIELD_FLOAT))) {
        int64_t low = limited ? field->min : field_lowest(field);
        int64_t high = limited ? field->max : field_highest(field);

        protocol_add_text(&line, ", %.10g to %.10g%s%s", scale * (double)low + field->offset,
                          scale * (double)high + field->offset, *unit ? " " : "", unit);
    }

    /* Add the protocol's meaning of a field's values, if there is one */
    char note[80] = "";

    if (protocol->note_field) {
        protocol->note_field(message, index, note, sizeof note);
    }
    protocol_add_text(&line, "%s%s", *note ? ", " : "", note);
    for (const struct field_value *v = field->values; v && v->name; v++) {
        protocol_add_text(&line, "%s %" PRId64 " = %s", v == field->values ? ";" : ",", v->value,
                          v->name);
    }
    options_wrap(line.text, 0, 2, out);
}

/* Prints the fields of a list, which starts at a bit of data or identifier; returns the next
 * index. */
static size_t protocol_put_list(const struct field *fields, unsigned bit, bool in_id,
                                const struct protocol *protocol, const struct message *message,
                                size_t index, FILE *out)
{
    for (const struct field *field = fields; field && field->type != FIELD_END; field++) {
        if (!(field->type & FIELD_PADDING)) {
            protocol_put_field(field, bit, in_id, protocol, message, index++, out);
        }
        bit += field->type & FIELD_BITS_MASK;
    }
    return index;
}

/* Prints the fields of a message, in its data and in its identifier. */
static void protocol_put_fields(const struct protocol *protocol, const struct message *message,
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
    count = protocol_put_list(message->fields, 8u * message->first_byte, false, protocol, message,
                              0, out);
    protocol_put_list(message->id_fields, 0, true, protocol, message, count, out);
}

/* ---- frames ---- */

/* Prints how a frame's identifier is computed, then the frame's length, kind and period. */
static void protocol_put_id(const struct protocol_frames *frames, const struct message *message,
                            FILE *out)
{
    /* Letters for the variable part of an identifier, as explained on the page */
    static const char counts[] = {[MESSAGE_OF_ADDRESS] = 'a',
                                  [MESSAGE_OF_NODE] = 'n',
                                  [MESSAGE_OF_SLOT] = 's',
                                  [MESSAGE_OF_GROUP] = 'g'};

    fprintf(out, "id 0x%0*" PRIx32, message->extended ? 8 : 3, message->base);
    if (message->step == 1) {
        fprintf(out, " + %c", counts[message->counts]);
    } else if (message->step > 1) {
        fprintf(out, " + 0x%" PRIx32 " %c", message->step, counts[message->counts]);
    }
    if (message->axis_step) {
        fprintf(out, " + 0x%" PRIx32 " k", message->axis_step);
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
    if (message->fd && !frames->fd) {
        fprintf(out, ", CAN FD%s", message->bit_rate_switch ? " with bit rate switch" : "");
    }
    if (message->cycle_ns) {
        fprintf(out, ", every %g ms%s", message->cycle_ns * 1e-6,
                message->cycle_varies ? " at address 1" : "");
    }
}

/* Returns the frame by which a board answers a command; NULL = none. */
static struct protocol_frame *protocol_find_answer(struct protocol_frames *frames,
                                                   const struct message *message)
{
    const char *name = message->answer                    ? message->answer
                       : message->code == MESSAGE_NO_CODE ? NULL
                                                          : message->name;

    for (size_t i = 0; name && message->from_host && i < frames->count; i++) {
        const struct message *other = &frames->frame[i].message;

        if (!other->from_host && other->code == message->code && !strcmp(other->name, name)) {
            return &frames->frame[i];
        }
    }
    return NULL;
}

/* ---- sections ---- */

/* Prints the frames by section: the protocol's sections, or one per sender. */
static void protocol_put_sections(struct protocol_frames *frames, FILE *out)
{
    static const char *const by_sender[] = {
        [MESSAGE_FROM_HOST] = "From the host", [MESSAGE_FROM_BOARDS] = "From boards", NULL};
    const char *const *sections =
        frames->protocol->sections ? frames->protocol->sections : by_sender;

    for (size_t s = 0; sections[s]; s++) {
        bool titled = false;

        for (size_t i = 0; i < frames->count; i++) {
            struct protocol_frame *frame = &frames->frame[i];

            if (frame->printed || frame->message.section != s) {
                continue;
            }
            if (!titled) {
                fprintf(out, "\n## %s\n", sections[s]);
                titled = true;
            }

            /* Print a frame, and its answer below. If the answer was already printed, print
             * the answer's fields only if it has a code of its own. */
            const struct message *message = &frame->message;
            struct protocol_frame *answer = protocol_find_answer(frames, message);

            fprintf(out, "\n### %s\n\n%s, ", message->name,
                    message->from_host ? "Host to board" : "Board to host");
            protocol_put_id(frames, message, out);
            if (!message->from_host && !message->cycle_ns) {
                fputs(", when there is something to tell", out);
            }
            fputs(".\n", out);
            protocol_put_fields(frames->protocol, message, out);
            frame->printed = true;

            /* The answer is printed with its command, not in its own section */
            if (answer) {
                bool own_code = answer->message.code != MESSAGE_NO_CODE;

                fputs("\nAnswer: ", out);
                if (strcmp(answer->message.name, message->name) != 0) {
                    fprintf(out, "%s, ", answer->message.name);
                }
                protocol_put_id(frames, &answer->message, out);
                fputs(".\n", out);
                if (own_code || !answer->printed) {
                    protocol_put_fields(frames->protocol, &answer->message, out);
                }
                answer->printed = true;
            }
        }
    }
}

/* Writes how a protocol tells a fault: by a state, bits, or fields of their own; or "". */
static void protocol_describe_fault(const struct described_protocol *described, int fault,
                                    struct protocol_line *line)
{
    const bool common = fault <= DESCRIBED_OVER_TEMPERATURE;
    const int own = described->fault_for[fault] >= 0 ? described->fault_for[fault]
                    : fault == DESCRIBED_STALE       ? described->timeout_state
                    : common                         ? described->fault_state
                                                     : -1;
    const struct described_state *state = own < 0 ? NULL : &described->state[own];

    if (state && described->tells[DESCRIBED_STATE]) {
        protocol_add_text(line, "state %s = %" PRId64 ", ", state->name, state->value);
    }
    if (state && described->tells[DESCRIBED_RESULT] && state->result) {
        protocol_add_text(line, "result %" PRId64 ", ", state->result);
    }
    if (described->fault_bit[fault] >= 0 && described->tells[DESCRIBED_FAULTS]) {
        protocol_add_text(line, "bit %d, ", described->fault_bit[fault]);
    }
    for (size_t f = 0; f < described->nframe; f++) {
        const struct described_frame *frame = &described->frame[f];

        for (size_t i = 0; i < frame->nfield; i++) {
            if (frame->field[i].meaning == DESCRIBED_FAULT_BIT &&
                frame->field[i].constant == fault) {
                protocol_add_text(line, "%s.%s, ", frame->name, described_layout(frame, i)->name);
            }
        }
    }
    line->used -= line->used > 0 ? strlen(", ") : 0;
    line->text[line->used] = '\0';
}

/* Prints a row for each fault that a protocol reports, of a list or of the table of all protocols.
 * The table also has the faults of supply, current, temperature and silence without a report. */
static void protocol_put_faults(const struct described_protocol *described, bool table, FILE *out)
{
    static const uint32_t common = 1u << DESCRIBED_UNDER_VOLTAGE | 1u << DESCRIBED_OVER_VOLTAGE |
                                   1u << DESCRIBED_OVER_CURRENT | 1u << DESCRIBED_OVER_TEMPERATURE |
                                   1u << DESCRIBED_STALE;

    for (int i = 0; i < DESCRIBED_FAULT_KINDS; i++) {
        struct protocol_line line = {.used = 0};

        protocol_describe_fault(described, i, &line);
        if (line.used == 0 && table && common >> i & 1) {
            protocol_add_text(&line,
                              i == DESCRIBED_STALE ? "not reported" : "not reported; bridge open");
        }
        if (line.used > 0) {
            if (table) {
                fprintf(out, "| %s ", described->name);
            }
            fprintf(out, table ? "| %s | %s |\n" : "- %s: %s\n", described_fault_names[i],
                    line.text);
        }
    }
}

enum { MEMORY = 8 << 20, FAULTS_MEMORY = 64 << 20, NAMES_MAX = 16 };

/* Prints a protocol that a file describes; name is a path or a name of the catalogue. */
static enum error_code print_described(const char *name, struct error *error)
{
    const struct described_protocol *protocol;
    struct arena arena = {.memory = NULL};
    char path[PATH_MAX];
    enum error_code code = config_locate(CONFIG_PROTOCOL, name, path, error);

    code = code ? code : arena_init(&arena, MEMORY, error);
    code = code ? code : described_load(path, false, &arena, &protocol, error);
    if (!code) {
        const struct boards_bus_config bus = {.protocol = &protocol_described,
                                              .described = protocol};
        static struct protocol_frames frames;

        fprintf(stdout, "# What `%s` boards speak\n\n", protocol->name);
        options_wrap(protocol->description, 0, 0, stdout);
        protocol_collect(&bus, &frames);
        protocol_put_sections(&frames, stdout);
        fputs("\n## Faults\n\nHow it tells each fault:\n\n", stdout);
        protocol_put_faults(protocol, false, stdout);
    }
    arena_fini(&arena);
    return code;
}

/* Lists the protocols that are written in C: in names, with NULL at the end, and as text in help.
 * Returns their number. */
static size_t list_names(const char *names[NAMES_MAX + 1], char *help, size_t size)
{
    const struct protocol *protocol;
    size_t count = 0, used = 0;

    for (size_t i = 0; count < NAMES_MAX && (protocol = protocol_at(i)); i++) {
        if (protocol->help) {
            names[count++] = protocol->name;
            used += used < size ? (size_t)snprintf(help + used, size - used, "%s, ", protocol->name)
                                : 0;
        }
    }
    if (used < size) {
        snprintf(help + used, size - used,
                 "or a protocol that a file describes: its name or the file");
    }
    names[count] = NULL;
    return count;
}

/* Prints how each protocol tells each fault. */
static enum error_code print_faults(struct error *error)
{
    struct arena arena = {.memory = NULL};
    struct config_entry *entry;
    size_t count = 0;
    enum error_code code = arena_init(&arena, FAULTS_MEMORY, error);

    code = code ? code : config_list(CONFIG_PROTOCOL, &arena, &entry, &count, error);
    puts("# How each protocol tells each fault\n\n"
         "By a fault line such as `motor KNEE over_temperature`, or by the robot itself.\n\n"
         "| protocol | fault | told as |\n|---|---|---|");
    for (size_t i = 0; protocol_at(i) && !code; i++) {
        for (int bit = 0; protocol_at(i)->text == NULL && !protocol_at(i)->needs_file &&
                          protocol_at(i)->fault_names[bit];
             bit++) {
            printf("| %s | %s | bit %d |\n", protocol_at(i)->name, protocol_at(i)->fault_names[bit],
                   bit);
        }
    }
    for (size_t i = 0; i < count && !code; i++) {
        const struct described_protocol *protocol;

        code = described_load(entry[i].path, true, &arena, &protocol, error);
        if (!code) {
            protocol_put_faults(protocol, true, stdout);
        }
    }
    arena_fini(&arena);
    return code;
}

int cmd_protocol(int argc, char **argv)
{
    static const char *names[NAMES_MAX + 1], *name;
    static char help[240];
    static const struct operand_spec operands[] = {
        {"PROTOCOL", help, true, .value = &name, .words = names},
    };
    static const struct command_spec spec = {
        .name = "protocol",
        .summary = "Print every frame of a protocol: fields, units, ranges, answers, faults.",
        OPERAND_TABLE(operands),
        .manual = MANUAL_PROTOCOL,
    };
    const struct protocol *protocol;
    const char *nearest;
    struct error error;
    size_t count = list_names(names, help, sizeof help);
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }

    /* Find a protocol in C, else one described by a file, unless the name resembles a protocol in
     * C */
    protocol = protocol_find(name);
    if (protocol && protocol->help) {
        static struct protocol_frames frames;

        fprintf(stdout, "# What `%s` boards speak\n\n", protocol->name);
        options_wrap(protocol->help, 0, 0, stdout);
        protocol_collect(&(struct boards_bus_config){.protocol = protocol}, &frames);
        protocol_put_sections(&frames, stdout);

        /* Print the fault bits of an axis */
        fputs("\n## Faults\n\nThe bits of the fields `fault` and `faults` of an axis:\n\n", stdout);
        for (int bit = 0; protocol->fault_names[bit]; bit++) {
            fprintf(stdout, "- bit %d: %s\n", bit, protocol->fault_names[bit]);
        }
        if (protocol->print_appendix) {
            protocol->print_appendix(stdout);
        }
        return STATUS_OK;
    }
    if (!strcmp(name, "faults")) {
        return print_faults(&error) ? command_fail("protocol", &error) : STATUS_OK;
    }
    nearest = text_nearest(name, names, count);
    if (nearest) {
        error_set(&error, ERROR_INPUT, "found unknown protocol \"%.60s\", expected %s", name,
                  nearest);
        return options_fail(&spec, &error);
    }
    return print_described(name, &error) ? command_fail("protocol", &error) : STATUS_OK;
}
