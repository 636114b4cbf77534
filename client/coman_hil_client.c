/* SPDX-License-Identifier: Apache-2.0 */
/* Implements coman_hil_client.h. Order of the file: numbers in frames, client table, connections
 * (gateway and SocketCAN), joints and the commands of their boards, time. */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include "coman_hil_client.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <linux/can/raw.h>
#include <locale.h>
#include <math.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum {
    BUSES_MAX = 64,
    JOINTS_MAX = 512,
    SENSORS_MAX = 128,
    FILE_SIZE = 1 << 24,   /* largest client table, bytes */
    STREAM_SIZE = 1 << 16, /* bytes of the gateway's receive buffer, and of its send buffer */
    READS_MAX = 64,        /* most reads per receive call */
    PLAIN = -1,            /* signal that is not multiplexed */
    SELECTOR = -2,         /* multiplexer: byte 0 selects the signals in the frame */
    STEP_TICKS = 1000,     /* most ticks in one STEP */
    READY_SIZE = 4096,     /* longest line in the file of --ready, bytes */
    STAGES_MAX = 4096,     /* most stages of a setup */
    STAGE_TICKS = 2,       /* ticks between two stages of a setup */
    SETTLE_TICKS = 5,      /* ticks until the boards have reported a new mode or setting */
    ENABLE_TICKS = 1000,   /* longest wait for motors to switch on */
    MISMATCH = 4,          /* flags of DONE */
    STOPPING = 8,
    ID_BYTE = 64, /* place of the identifier behind the data of a frame */
    IMAGE_SIZE = ID_BYTE + 4,
    WORDS_MAX = 10, /* most words in a row of the client table */
};

/* Quantities that boards report. */
enum source {
    POSITION,
    TURN, /* position within a turn of the motor */
    DEFLECTION,
    MOTOR_POSITION,
    MOTOR_VELOCITY,
    CURRENT,
    TORQUE,
    MODE,
    FAULTS,
    FORCE, /* six channels of a sensor */
    GAIN = FORCE + 6,
    SOURCES = GAIN + HIL_CLIENT_QUANTITIES,
};

static const char *const source_names[SOURCES] = {
    [POSITION] = "position",
    [TURN] = "position_in_turn",
    [DEFLECTION] = "deflection",
    [MOTOR_POSITION] = "motor_position",
    [MOTOR_VELOCITY] = "motor_velocity",
    [CURRENT] = "current",
    [TORQUE] = "torque",
    [MODE] = "mode",
    [FAULTS] = "faults",
    [FORCE] = "fx",
    [FORCE + 1] = "fy",
    [FORCE + 2] = "fz",
    [FORCE + 3] = "mx",
    [FORCE + 4] = "my",
    [FORCE + 5] = "mz",
    [GAIN + HIL_CLIENT_CURRENT] = "current_gain",
    [GAIN + HIL_CLIENT_POSITION] = "position_gain",
    [GAIN + HIL_CLIENT_VELOCITY] = "velocity_gain",
};

static const char *const quantity_names[HIL_CLIENT_QUANTITIES] = {"off",      "voltage",  "current",
                                                                  "position", "velocity", "torque"};

/* A number in a frame: value = count * scale + offset. */
struct field {
    struct message *message;
    unsigned start, end; /* first bit; bytes of the shortest frame with the whole field */
    unsigned bits;
    bool big_endian, negative, floating;
    double scale, offset;
};

/* A signal of a message. */
struct signal {
    struct field field;
    const char *name;
    int selector;    /* multiplexed: the value of byte 0; else PLAIN or SELECTOR */
    unsigned length; /* bytes of its frame */
};

/* A message, a frame or a report of the client table. */
struct message {
    const char *name;
    uint32_t id; /* bit 31 set: 29-bit identifier */
    struct bus *bus;
    size_t first, count; /* its signals in core->signal */
    bool fd, remote, pending;
    unsigned length, heard; /* heard: length of the last received frame */
    uint8_t data[IMAGE_SIZE];
    int64_t time_ns;

    /* Reports: the bits that identify the frame, and their values */
    uint32_t id_mask;
    uint8_t mask[64], value[64];
    /* Frames: checksum and its byte; number of the counter, -1 = none, and its place */
    int checksum, checksum_byte, counter;
    struct field count_field;
    uint32_t *sent; /* frames sent with this counter */
    uint32_t own_sent;
};

/* A named mode of a bus. */
struct name {
    const struct bus *bus;
    int64_t number;
    const char *text;
};

struct bus {
    char name[41], interface[16];
    bool every_tick; /* set points are sent every tick */
    uint32_t step_id, done_id;
    size_t first, count; /* its messages in core->message */
    size_t frame, nframe, report, nreport;
    int socket; /* SocketCAN; -1 = none */
    bool done;  /* DONE of the present STEP received */
};

/* A row of the client table about frames and values (rig/client_table.h). */
struct row {
    enum { SETUP, CYCLE, SWITCH, SET, ASK, VALUE } kind;
    int owner; /* joint or sensor; -1 = none */
    enum hil_client_quantity quantity;
    enum source source;
    int stage;
    struct message *frame;
    struct field field;
    int64_t count;
    double low, high;
    const char *mode; /* name of the mode in which the board takes the set point */
};

struct joint {
    const char *name;
    enum hil_client_quantity quantity;
    double value;
};

struct hil_client_core {
    struct bus bus[BUSES_MAX];
    struct joint joint[JOINTS_MAX];
    const char *sensor[SENSORS_MAX];
    struct message *message, *frame, *report;
    struct signal *signal;
    struct name *name;
    struct row *row;
    size_t nbus, njoint, nsensor, nmessage, nframe, nreport, nsignal, nname, nrow;
    const char *rig;
    struct bus *reading; /* bus of the rows that are read */
    int timeout_ms, refresh_ticks;
    int64_t deadline_ms;
    bool lockstep, listening;

    int gateway;     /* its socket; -1 = SocketCAN */
    unsigned heard;  /* number of its answers ("hi", "ok", "ok") */
    uint64_t frames; /* number of received frames */
    size_t nin, nout, ntable;
    char in[STREAM_SIZE], out[STREAM_SIZE];
    char *table;    /* text of the client table; its rows point into it */
    char told[512]; /* last row that the gateway told */

    struct bus *step; /* bus of STEP; NULL = none */
    uint32_t begin, expected, at;
    bool joined, refused, stopping;
};

/* ---- errors and time ---- */

/* Writes client->message and returns the code. Control characters become '?'. */
__attribute__((format(printf, 3, 4))) static enum hil_client_code
client_fail(struct hil_client *client, enum hil_client_code code, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(client->message, sizeof client->message, format, arguments);
    va_end(arguments);
    for (char *at = client->message; *at; at++) {
        *at = (char)((unsigned char)*at < 0x20 || *at == 0x7f ? '?' : *at);
    }
    return code;
}

/* Writes the text of errno to client->message. */
static enum hil_client_code client_fail_system(struct hil_client *client, const char *what)
{
    return client_fail(client, HIL_CLIENT_SYSTEM, "%.200s: %s", what, strerror(errno));
}

static int64_t client_now_ns(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* Sets the deadline of the following waits. */
static void client_limit_time(struct hil_client_core *core, int timeout_ms)
{
    core->deadline_ms = client_now_ns() / 1000000 + timeout_ms;
}

/* Waits until one of the sockets is ready or the deadline has passed. */
static enum hil_client_code client_poll(struct hil_client *client, struct pollfd *sockets,
                                        size_t count)
{
    int64_t left;
    int ready;

    do {
        left = client->core->deadline_ms - client_now_ns() / 1000000;
        ready = poll(sockets, (nfds_t)count, left > 0 ? (int)left : 0);
    } while (ready < 0 && errno == EINTR);
    return ready > 0    ? HIL_CLIENT_OK
           : ready == 0 ? client_fail(client, HIL_CLIENT_TIMEOUT, "nothing came in time")
                        : client_fail_system(client, "poll");
}

/* ---- numbers in frames ---- */

/* Returns the next bit of a field: less significant if big-endian, else more significant. */
static unsigned field_next_bit(const struct field *field, unsigned bit)
{
    return !field->big_endian ? bit + 1 : bit % 8 ? bit - 1 : bit + 15;
}

/* Writes a raw value into the bits of a field. */
static void field_put(const struct field *field, uint8_t *data, uint64_t count)
{
    unsigned bit = field->start;

    for (unsigned i = 0; i < field->bits; i++, bit = field_next_bit(field, bit)) {
        const unsigned mask = 1u << bit % 8;

        data[bit / 8] &= (uint8_t)~mask;
        if (count >> (field->big_endian ? field->bits - 1 - i : i) & 1u) {
            data[bit / 8] |= (uint8_t)mask;
        }
    }
}

/* Reads the raw value from the last frame of the field's message; false = no frame, or the frame
 * lacks the field. */
static bool field_get(const struct field *field, int64_t *count)
{
    const struct message *message = field ? field->message : NULL;
    uint64_t raw = 0;
    unsigned bit = field ? field->start : 0;

    if (!message || message->time_ns < 0 || message->heard < field->end) {
        return false;
    }
    for (unsigned i = 0; i < field->bits; i++, bit = field_next_bit(field, bit)) {
        const uint64_t one = message->data[bit / 8] >> bit % 8 & 1u;

        raw = field->big_endian ? raw << 1 | one : raw | one << i;
    }
    if (field->negative && field->bits < 64 && raw >> (field->bits - 1)) {
        raw -= UINT64_C(1) << field->bits;
    }
    *count = (int64_t)raw;
    return true;
}

/* Returns the value in the last frame; NAN = no value. */
static double field_value(const struct field *field)
{
    int64_t count;
    uint32_t bits;
    float number;

    if (!field_get(field, &count)) {
        return NAN;
    }
    bits = (uint32_t)count;
    memcpy(&number, &bits, sizeof number);
    return (field->floating   ? (double)number
            : field->negative ? (double)count
                              : (double)(uint64_t)count) *
               field->scale +
           field->offset;
}

/* Converts a value to the bits of a field. Clamps the value to the range of the field. */
static uint64_t field_encode(const struct field *field, double value)
{
    const double high = ldexp(1.0, (int)field->bits - field->negative);
    const double scaled = (value - field->offset) / field->scale, count = rint(scaled);
    const float number = (float)scaled;
    uint32_t bits;

    if (field->floating) {
        memcpy(&bits, &number, sizeof bits);
        return bits;
    }
    if (count >= high) {
        return UINT64_MAX >> (64 - field->bits + field->negative);
    }
    if (field->negative && count < 0.0) {
        return (uint64_t)(int64_t)(count > -high ? count : -high);
    }
    return count > 0.0 ? (uint64_t)count : 0;
}

/* Reads START|BITS@ORDER; false = invalid. Sets the end. */
static bool field_read(struct field *field, const char *text)
{
    char order, kind;

    if (sscanf(text, "%3u|%2u@%c%c", &field->start, &field->bits, &order, &kind) != 4) {
        return false;
    }
    field->big_endian = order == '0';
    field->negative = kind == '-';
    field->floating = kind == 'f';
    field->end = !field->big_endian
                     ? (field->start + field->bits + 7) / 8
                     : field->start / 8 + (field->bits + 7 - field->start % 8 + 7) / 8;
    return field->bits <= 64 && (!field->floating || field->bits == 32) && field->end <= IMAGE_SIZE;
}

/* ---- messages ---- */

static struct signal *signal_find(const struct hil_client_core *core, const struct message *message,
                                  const char *name)
{
    for (size_t i = 0; message && i < message->count; i++) {
        if (!strcmp(core->signal[message->first + i].name, name)) {
            return &core->signal[message->first + i];
        }
    }
    return NULL;
}

static struct message *message_find_id(const struct hil_client_core *core, const struct bus *bus,
                                       uint32_t id)
{
    for (size_t i = 0; i < bus->count; i++) {
        if (core->message[bus->first + i].id == id) {
            return &core->message[bus->first + i];
        }
    }
    return NULL;
}

/* Finds the message with a name; NULL = not found. */
static struct message *message_find(const struct hil_client_core *core, const struct bus *bus,
                                    const char *name)
{
    for (size_t i = 0; bus && i < bus->count; i++) {
        if (!strcmp(core->message[bus->first + i].name, name)) {
            return &core->message[bus->first + i];
        }
    }
    return NULL;
}

static struct bus *bus_find(struct hil_client_core *core, const char *name)
{
    for (size_t i = 0; i < core->nbus; i++) {
        if (!strcmp(core->bus[i].name, name)) {
            return &core->bus[i];
        }
    }
    return NULL;
}

/* ---- the client table (rig/client_table.h) ---- */

static int table_find_joint(const struct hil_client_core *core, const char *name)
{
    for (size_t i = 0; i < core->njoint; i++) {
        if (!strcmp(core->joint[i].name, name)) {
            return (int)i;
        }
    }
    return -1;
}

static int table_find_sensor(const struct hil_client_core *core, const char *name)
{
    for (size_t i = 0; i < core->nsensor; i++) {
        if (!strcmp(core->sensor[i], name)) {
            return (int)i;
        }
    }
    return -1;
}

/* Returns the index of a word; -1 = not found. */
static int table_find_word(const char *const *words, int count, const char *word)
{
    for (int i = 0; i < count; i++) {
        if (words[i] && !strcmp(words[i], word)) {
            return i;
        }
    }
    return -1;
}

/* Reads hexadecimal data, "-" = none. Returns the number of bytes. */
static unsigned table_read_data(const char *text, uint8_t data[64])
{
    unsigned length = 0, byte;

    while (length < 64 && isxdigit((unsigned char)text[0]) && isxdigit((unsigned char)text[1]) &&
           sscanf(text, "%2x", &byte) == 1) {
        text += 2;
        data[length++] = (uint8_t)byte;
    }
    return length;
}

/* Reads ID FORMAT. */
static void table_read_head(struct message *message, struct bus *bus, char **word)
{
    message->bus = bus;
    message->id = (uint32_t)strtoul(word[0], NULL, 16) | (strlen(word[0]) == 8 ? CAN_EFF_FLAG : 0);
    message->fd = *word[1] == 'f';
    message->remote = *word[1] == 'r';
    message->time_ns = -1;
    memcpy(message->data + ID_BYTE, &message->id, sizeof message->id);
}

/* Reads a frame from the host: ID FORMAT DATA CHECKSUM BYTE COUNTER FIELD */
static bool table_read_frame(struct hil_client_core *core, struct bus *bus, char **word)
{
    struct message *frame = &core->frame[core->nframe];

    table_read_head(frame, bus, word);
    frame->length = table_read_data(word[2], frame->data);
    frame->checksum = atoi(word[3]);
    frame->checksum_byte = atoi(word[4]);
    frame->counter = atoi(word[5]);
    frame->sent = &frame->own_sent;
    for (size_t i = bus->nframe; i-- > 0;) {
        struct message *other = &core->frame[bus->frame + i];

        frame->sent = frame->counter >= 0 && other->counter == frame->counter ? &other->own_sent
                                                                              : frame->sent;
    }
    core->nframe++;
    bus->nframe++;
    return field_read(&frame->count_field, word[6]) && (unsigned)frame->checksum_byte < 64;
}

/* Reads a report of a board: ID FORMAT LENGTH ID_MASK DATA_MASK DATA */
static bool table_read_report(struct hil_client_core *core, struct bus *bus, char **word)
{
    struct message *report = &core->report[core->nreport];

    table_read_head(report, bus, word);
    report->length = (unsigned)atoi(word[2]);
    report->id_mask = (uint32_t)strtoul(word[3], NULL, 16) | CAN_EFF_FLAG;
    table_read_data(word[4], report->mask);
    table_read_data(word[5], report->value);
    core->nreport++;
    bus->nreport++;
    return true;
}

/* Reads the frame or the report with a number on the bus into a row; false = none. */
static bool table_read_number(struct message *first, size_t count, const char *word,
                              struct row *row)
{
    const unsigned long number = strtoul(word, NULL, 10);

    row->frame = number < count ? first + number : NULL;
    return row->frame;
}

/* Reads a row of one of the kinds of struct row. */
static bool table_read_row(struct hil_client_core *core, struct bus *bus, char **word)
{
    /* places of the words; -1 = none */
    static const struct {
        const char *name;
        int owner, quantity, stage, frame, field;
    } kinds[] = {
        [SETUP] = {"setup", -1, -1, 1, 2, -1}, [CYCLE] = {"cycle", 2, -1, -1, 1, -1},
        [SWITCH] = {"switch", 1, 2, 3, 4, 5},  [SET] = {"set", 1, 2, -1, 3, 4},
        [ASK] = {"ask", 1, 2, -1, 3, -1},      [VALUE] = {"value", 1, 2, -1, 3, 4},
    };
    struct row *row = &core->row[core->nrow];
    int kind = 0, found;

    while (strcmp(kinds[kind].name, word[0]) != 0) {
        kind++;
    }
    *row = (struct row){.kind = kind, .owner = -1};
    if (kinds[kind].owner >= 0) {
        row->owner = table_find_joint(core, word[kinds[kind].owner]);
    }
    if (kind == VALUE) {
        found = table_find_word(source_names, SOURCES, word[2]);
        row->source = (enum source)found;
        row->owner = found >= FORCE && found < GAIN ? table_find_sensor(core, word[1]) : row->owner;
    } else {
        found = kinds[kind].quantity < 0
                    ? 0
                    : table_find_word(quantity_names, HIL_CLIENT_QUANTITIES, word[2]);
        row->quantity = (enum hil_client_quantity)found;
    }
    row->stage = kinds[kind].stage < 0 ? 0 : atoi(word[kinds[kind].stage]);
    if (found < 0 || row->stage < 0 || row->stage >= STAGES_MAX ||
        (row->owner < 0 && kinds[kind].owner >= 0 && strcmp(word[kinds[kind].owner], "-") != 0) ||
        !table_read_number(kind == VALUE ? core->report + bus->report : core->frame + bus->frame,
                           kind == VALUE ? bus->nreport : bus->nframe, word[kinds[kind].frame],
                           row) ||
        (kinds[kind].field >= 0 && !field_read(&row->field, word[kinds[kind].field]))) {
        return false;
    }
    row->field.message = row->frame;
    row->field.end = row->field.start >= 8 * ID_BYTE ? 0 : row->field.end;
    if (kind == SWITCH) {
        row->count = strtoll(word[6], NULL, 10);
    } else if (kind == SET || kind == VALUE) {
        row->field.scale = strtod(word[5], NULL);
        row->field.offset = strtod(word[6], NULL);
    }
    if (kind == SET) {
        row->low = strtod(word[7], NULL);
        row->high = strtod(word[8], NULL);
        row->mode = word[9];
    }
    core->nrow++;
    return (kind != SET && kind != VALUE) || (row->field.bits >= 1 && fabs(row->field.scale) > 0.0);
}

/* Reads a message: ID FORMAT LENGTH NAME */
static bool table_read_message(struct hil_client_core *core, struct bus *bus, char **word)
{
    struct message *message = &core->message[core->nmessage++];

    table_read_head(message, bus, word);
    message->length = (unsigned)atoi(word[2]);
    message->name = word[3];
    message->first = core->nsignal;
    bus->count++;
    return message->length <= ID_BYTE;
}

/* Reads a signal of the last message: FIELD SCALE OFFSET SELECTOR LENGTH NAME */
static bool table_read_signal(struct hil_client_core *core, struct bus *bus, char **word)
{
    struct signal *signal = &core->signal[core->nsignal++];
    struct message *message = bus->count ? &core->message[core->nmessage - 1] : NULL;

    signal->field.message = message;
    signal->field.scale = strtod(word[1], NULL);
    signal->field.offset = strtod(word[2], NULL);
    signal->selector = atoi(word[3]);
    signal->length = (unsigned)atoi(word[4]);
    signal->name = word[5];
    if (!message || !field_read(&signal->field, word[0]) || signal->field.bits < 1 ||
        signal->length > message->length || signal->field.end > message->length ||
        !(fabs(signal->field.scale) > 0.0)) {
        return false;
    }
    message->count++;
    return true;
}

/* Begins a bus: NAME INTERFACE PROTOCOL STEP DONE REFRESH */
static bool table_read_bus(struct hil_client_core *core, char **word)
{
    struct bus *bus = &core->bus[core->nbus];

    if (core->nbus == BUSES_MAX) {
        return false;
    }
    snprintf(bus->name, sizeof bus->name, "%s", word[0]);
    snprintf(bus->interface, sizeof bus->interface, "%s", word[1]);
    bus->step_id = (uint32_t)strtoul(word[3], NULL, 16);
    bus->done_id = (uint32_t)strtoul(word[4], NULL, 16);
    bus->every_tick = *word[5] == '1';
    bus->frame = core->nframe;
    bus->report = core->nreport;
    bus->socket = -1;
    core->step = bus->step_id != UINT32_MAX ? bus : core->step;
    core->reading = bus;
    core->nbus++;
    return true;
}

/* Reads a row of the client table. Rows of unknown kinds are skipped. */
static bool table_read_line(struct hil_client_core *core, char *line)
{
    static const struct {
        const char *name;
        int words; /* the last word is the rest of the row */
    } forms[] = {{"rig", 2},     {"joint", 3},  {"sensor", 3}, {"bus", 7},
                 {"name", 3},    {"frame", 8},  {"setup", 3},  {"cycle", 3},
                 {"switch", 7},  {"set", 10},   {"ask", 4},    {"messages", 2},
                 {"message", 5}, {"signal", 7}, {"report", 7}, {"value", 7}};
    struct bus *bus = core->reading;
    char *word[WORDS_MAX] = {line};
    size_t form = 0;

    for (size_t length = strcspn(line, " ");
         form < sizeof forms / sizeof *forms &&
         (strlen(forms[form].name) != length || strncmp(forms[form].name, line, length) != 0);) {
        form++;
    }
    if (form == sizeof forms / sizeof *forms) {
        return true;
    }
    for (int i = 1; i < forms[form].words; i++) {
        word[i] = strchr(word[i - 1], ' ');
        if (!word[i]) {
            return false;
        }
        *word[i]++ = '\0';
    }
    if (!strcmp(line, "rig")) {
        core->rig = word[1];
    } else if (!strcmp(line, "joint") && core->njoint < JOINTS_MAX) {
        core->joint[core->njoint++].name = word[1];
    } else if (!strcmp(line, "sensor") && core->nsensor < SENSORS_MAX) {
        core->sensor[core->nsensor++] = word[1];
    } else if (!strcmp(line, "bus")) {
        return table_read_bus(core, word + 1);
    } else if (!strcmp(line, "messages")) {
        core->reading = bus_find(core, word[1]);
        if (core->reading) {
            core->reading->first = core->nmessage;
        }
        return core->reading;
    } else if (!bus) {
        return false;
    } else if (!strcmp(line, "message")) {
        return table_read_message(core, bus, word + 1);
    } else if (!strcmp(line, "signal")) {
        return table_read_signal(core, bus, word + 1);
    } else if (!strcmp(line, "name")) {
        core->name[core->nname++] = (struct name){bus, strtoll(word[1], NULL, 10), word[2]};
    } else if (!strcmp(line, "frame")) {
        return table_read_frame(core, bus, word + 1);
    } else if (!strcmp(line, "report")) {
        return table_read_report(core, bus, word + 1);
    } else {
        return table_read_row(core, bus, word);
    }
    return true;
}

/* Counts the rows that begin with a word. */
static size_t table_count(const char *text, const char *word)
{
    size_t count = 1;

    for (; (text = strstr(text, word)); text++) {
        count++;
    }
    return count;
}

/* Parses the client table in core->table. `from`: its file or gateway, for errors. */
static enum hil_client_code table_read_text(struct hil_client *client, const char *from)
{
    struct hil_client_core *core = client->core;
    /* Parse numbers with a decimal point in any locale of the program */
    locale_t c = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0), before;
    const size_t rows = table_count(core->table, "\n");
    enum hil_client_code code = HIL_CLIENT_OK;
    char *text = core->table;
    size_t number = 1;

    core->rig = "";
    core->frame = calloc(table_count(text, "\nframe "), sizeof *core->frame);
    core->report = calloc(table_count(text, "\nreport "), sizeof *core->report);
    core->name = calloc(table_count(text, "\nname "), sizeof *core->name);
    core->message = calloc(table_count(text, "\nmessage "), sizeof *core->message);
    core->signal = calloc(table_count(text, "\nsignal "), sizeof *core->signal);
    core->row = calloc(rows, sizeof *core->row);
    if (!c || !core->message || !core->signal || !core->frame || !core->report || !core->name ||
        !core->row) {
        return client_fail(client, HIL_CLIENT_SYSTEM, "no memory");
    }
    before = uselocale(c);
    for (char *line; (line = strsep(&text, "\n")) && !code; number++) {
        if (!table_read_line(core, line)) {
            code = client_fail(client, HIL_CLIENT_TABLES,
                               "%.200s:%zu: expected a row of a client table, as coman-hil dbc "
                               "writes it",
                               from, number);
        }
    }
    uselocale(before);
    freelocale(c);
    return code || core->nbus ? code
                              : client_fail(client, HIL_CLIENT_TABLES,
                                            "%.200s: found no bus, expected a client table", from);
}

/* Reads the client table from a file. */
static enum hil_client_code table_read_file(struct hil_client *client, const char *path)
{
    char *text = malloc(FILE_SIZE + 1);
    FILE *file = path && text ? fopen(path, "re") : NULL;
    size_t size;

    client->core->table = text;
    if (!text) {
        return client_fail(client, HIL_CLIENT_SYSTEM, "no memory");
    }
    if (!file) {
        return client_fail(client, HIL_CLIENT_TABLES, "%.200s: %s", path ? path : "options.table",
                           path ? strerror(errno)
                                : "expected the file RIG.joints of coman-hil dbc RIG -o FOLDER");
    }
    size = fread(text, 1, FILE_SIZE, file);
    fclose(file);
    text[size] = '\0';
    return table_read_text(client, path);
}

/* ---- sending and receiving frames ---- */

/* Handles a DONE. It answers the present STEP in three cases: its tick is the expected end of the
 * STEP, the run is stopping, or it refuses the STEP because the run is at a different tick. Ignores
 * the DONE of earlier STEPs and of other clients. */
static void bus_take_done(struct hil_client *client, struct bus *bus, const uint8_t *data)
{
    struct hil_client_core *core = client->core;
    const uint32_t tick =
        data[0] | (uint32_t)data[1] << 8 | (uint32_t)data[2] << 16 | (uint32_t)data[3] << 24;
    const unsigned flags = data[4] | (unsigned)data[5] << 8;

    if (flags & MISMATCH ? tick != core->begin : flags & STOPPING || tick == core->expected) {
        core->at = tick;
        core->refused = flags & MISMATCH;
        core->stopping = flags & STOPPING;
        client->flags = (uint16_t)flags;
        bus->done = true;
    }
}

/* Stores a received frame in the messages and reports that it is, or handles a DONE. */
static void bus_take_frame(struct hil_client *client, struct bus *bus, uint32_t id,
                           const uint8_t *data, size_t length, int64_t time_ns)
{
    struct hil_client_core *core = client->core;
    struct message *message = message_find_id(core, bus, id);

    core->frames++;
    if (id == bus->done_id && length == 6) {
        bus_take_done(client, bus, data);
        return;
    }
    for (size_t i = 0; i <= bus->nreport; i++) {
        struct message *taker = i < bus->nreport ? &core->report[bus->report + i] : message;
        bool is = taker && (taker == message ||
                            ((id & taker->id_mask) == taker->id && length >= taker->length));

        for (size_t k = 0; is && k < 64; k++) {
            is = ((k < length ? data[k] : 0) & taker->mask[k]) == taker->value[k];
        }
        if (is) {
            memcpy(taker->data, data, length);
            memcpy(taker->data + ID_BYTE, &id, sizeof id);
            taker->heard = (unsigned)length;
            taker->time_ns = time_ns;
        }
    }
}

/* Parses and stores "frame ID SECONDS.MICROSECONDS BYTES BUS". fdframe has FLAGS behind the ID. */
static void stream_take_frame(struct hil_client *client, char *text)
{
    char *word[8] = {NULL}, *end;
    uint8_t data[64];
    size_t words = 0, length;
    struct bus *bus;
    int64_t time_ns;
    uint32_t id;

    while (words < 8 && (word[words] = strsep(&text, " "))) {
        words++;
    }
    if (words == 8 && !strcmp(word[1], "fdframe")) {
        memmove(&word[3], &word[4], 4 * sizeof *word);
    } else if (words != 7 || strcmp(word[1], "frame") != 0) {
        return;
    }
    /* Bus, identifier (8 digits = 29 bits), time and data */
    bus = bus_find(client->core, word[5]);
    id = (uint32_t)strtoul(word[2], &end, 16) | (end - word[2] == 8 ? CAN_EFF_FLAG : 0);
    time_ns = strtoll(word[3], &end, 10) % INT64_C(9000000000) * 1000000000;
    time_ns += *end == '.' ? strtol(end + 1, NULL, 10) % 1000000 * 1000 : 0;
    length = strlen(word[4]) / 2;
    for (size_t i = 0; i < length && i < sizeof data; i++) {
        const char byte[] = {word[4][2 * i], word[4][2 * i + 1], '\0'};

        data[i] = (uint8_t)strtoul(byte, NULL, 16);
    }
    if (bus && length <= sizeof data && time_ns >= 0) {
        bus_take_frame(client, bus, id, data, length, time_ns);
    }
}

/* Keeps a row that the gateway tells, and adds it to the client table while that is read. */
static void stream_take_row(struct hil_client_core *core, const char *row)
{
    const size_t length = strlen(row);
    char *table;

    snprintf(core->told, sizeof core->told, "%s", row);
    table = core->row ? NULL : realloc(core->table, core->ntable + length + 2);
    if (table) {
        core->table = table;
        core->ntable += (size_t)sprintf(table + core->ntable, "%s\n", row);
    }
}

/* Handles the complete messages in the receive buffer. Keeps an incomplete message for later. */
static enum hil_client_code stream_take(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    char *at = core->in, *end, *begin;

    while ((begin = memchr(at, '<', core->nin - (size_t)(at - core->in))) &&
           (end = memchr(begin, '>', core->nin - (size_t)(begin - core->in)))) {
        *end = '\0';
        at = end + 1;
        if (!strncmp(begin, "< error ", 8)) {
            const bool is_bus = !strncmp(begin + 8, "no such bus", 11);

            end[-1] = (char)(end[-1] == ' ' ? '\0' : end[-1]);
            return client_fail(client, HIL_CLIENT_CONNECTION, "the gateway says: %.160s%s%s",
                               begin + 8, is_bus ? "; the tables are of rig " : "",
                               is_bus ? core->rig : "");
        }
        core->heard += !strcmp(begin, "< hi ") || !strcmp(begin, "< ok ");
        if (!strncmp(begin, "< row ", 6)) {
            end[-1] = '\0';
            stream_take_row(core, begin + 6);
        }
        stream_take_frame(client, begin + 1);
    }
    core->nin = begin ? core->nin - (size_t)(begin - core->in) : 0;
    memmove(core->in, begin ? begin : core->in, core->nin);
    return core->nin < sizeof core->in ? HIL_CLIENT_OK
                                       : client_fail(client, HIL_CLIENT_CONNECTION,
                                                     "the gateway sends a command without an end");
}

/* Receives bytes from the gateway and handles the complete messages. */
static enum hil_client_code stream_receive(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    const ssize_t size =
        recv(core->gateway, core->in + core->nin, sizeof core->in - core->nin, MSG_DONTWAIT);

    if (size < 0 && (errno == EAGAIN || errno == EINTR)) {
        return HIL_CLIENT_OK;
    }
    if (size <= 0) {
        return client_fail(client, HIL_CLIENT_CONNECTION, "the gateway has closed the connection");
    }
    core->nin += (size_t)size;
    return stream_take(client);
}

/* Sends the whole send buffer to the gateway. Waits up to the deadline. */
static enum hil_client_code stream_flush(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    struct pollfd socket = {.fd = core->gateway, .events = POLLOUT};

    while (core->nout > 0) {
        const ssize_t size =
            send(core->gateway, core->out, core->nout, MSG_DONTWAIT | MSG_NOSIGNAL);
        enum hil_client_code code = HIL_CLIENT_OK;

        if (size > 0) {
            core->nout -= (size_t)size;
            memmove(core->out, core->out + size, core->nout);
        } else if (errno == EAGAIN) {
            code = client_poll(client, &socket, 1);
        } else if (errno != EINTR) {
            code =
                client_fail(client, HIL_CLIENT_CONNECTION, "the gateway has closed the connection");
        }
        if (code) {
            return code;
        }
    }
    return HIL_CLIENT_OK;
}

/* Reads the waiting frames of a SocketCAN interface, at most READS_MAX. */
static enum hil_client_code interface_receive(struct hil_client *client, struct bus *bus)
{
    for (int i = 0; i < READS_MAX; i++) {
        struct canfd_frame frame;
        const ssize_t size = read(bus->socket, &frame, sizeof frame);

        if (size < 0 && (errno == EAGAIN || errno == EINTR)) {
            break;
        }
        if (size < (ssize_t)CAN_MTU) {
            return client_fail_system(client, bus->interface);
        }
        if (!(frame.can_id & (CAN_RTR_FLAG | CAN_ERR_FLAG)) && frame.len <= sizeof frame.data) {
            bus_take_frame(client, bus, frame.can_id, frame.data, frame.len, client_now_ns());
        }
    }
    return HIL_CLIENT_OK;
}

/* Sends a frame to a SocketCAN interface. While its queue is full, retries up to the deadline. */
static enum hil_client_code interface_send(struct hil_client *client, const struct bus *bus,
                                           const struct canfd_frame *frame, size_t size)
{
    const struct timespec pause = {.tv_nsec = 200000};

    while (write(bus->socket, frame, size) != (ssize_t)size) {
        if (errno != EAGAIN && errno != EINTR && errno != ENOBUFS) {
            return client_fail_system(client, bus->interface);
        }
        if (client_now_ns() / 1000000 > client->core->deadline_ms) {
            return client_fail(client, HIL_CLIENT_TIMEOUT, "%s: its queue is full", bus->interface);
        }
        nanosleep(&pause, NULL);
    }
    return HIL_CLIENT_OK;
}

/* Sends a frame through SocketCAN, or appends its command to the send buffer of the gateway. */
static enum hil_client_code client_send_frame(struct hil_client *client,
                                              const struct message *message, const uint8_t *data,
                                              size_t length)
{
    struct hil_client_core *core = client->core;
    struct canfd_frame frame = {.len = (uint8_t)length, .flags = message->fd ? CANFD_BRS : 0};
    const size_t room = 512; /* more than the longest command, a frame of 64 bytes */
    enum hil_client_code code;
    uint32_t id;
    char *out;

    memcpy(&id, data + ID_BYTE, sizeof id);
    if (core->gateway < 0) {
        frame.can_id = id | (message->remote ? CAN_RTR_FLAG : 0);
        memcpy(frame.data, data, length);
        return interface_send(client, message->bus, &frame, message->fd ? CANFD_MTU : CAN_MTU);
    }
    code = core->nout + room > sizeof core->out ? stream_flush(client) : HIL_CLIENT_OK;
    if (code) {
        return code;
    }
    out = core->out + core->nout;
    out += sprintf(out, "< %s %0*" PRIX32 "%s %zu",
                   message->fd       ? "fdsend"
                   : message->remote ? "sendrtr"
                                     : "send",
                   id & CAN_EFF_FLAG ? 8 : 3, id & CAN_EFF_MASK, message->fd ? " 1" : "", length);
    for (size_t i = 0; i < length; i++) {
        out += sprintf(out, " %02x", data[i]);
    }
    out += sprintf(out, " %s >", message->bus->name);
    core->nout = (size_t)(out - core->out);
    return HIL_CLIENT_OK;
}

/* Receives the frames that have arrived. Does not wait. */
static enum hil_client_code client_take(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    enum hil_client_code code = HIL_CLIENT_OK;

    if (core->gateway >= 0) {
        return stream_receive(client);
    }
    for (size_t i = 0; i < core->nbus && !code; i++) {
        code = interface_receive(client, &core->bus[i]);
    }
    return code;
}

/* Waits for data up to the deadline, and receives it. */
static enum hil_client_code client_wait(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    struct pollfd socket[BUSES_MAX] = {{.fd = core->gateway, .events = POLLIN}};
    enum hil_client_code code;

    for (size_t i = 0; core->gateway < 0 && i < core->nbus; i++) {
        socket[i] = (struct pollfd){.fd = core->bus[i].socket, .events = POLLIN};
    }
    code = client_poll(client, socket, core->gateway < 0 ? core->nbus : 1);
    return code ? code : client_take(client);
}

/* ---- connections ---- */

/* Contents of the file of --ready: address of the gateway, clock of the run; "" = unknown. */
struct place {
    char host[64], clock[16];
    uint16_t port;
};

/* Waits for the file of --ready up to the deadline, and reads it. */
static enum hil_client_code client_read_ready(struct hil_client *client, const char *path,
                                              struct place *place)
{
    const struct timespec pause = {.tv_nsec = 2000000};
    char line[READY_SIZE];
    FILE *file;

    while (!(file = fopen(path, "re"))) {
        if (client_now_ns() / 1000000 > client->core->deadline_ms) {
            return client_fail(client, HIL_CLIENT_TIMEOUT, "%.200s is not there after %d ms", path,
                               client->core->timeout_ms);
        }
        nanosleep(&pause, NULL);
    }
    while (fgets(line, sizeof line, file)) {
        if (sscanf(line, "gateway_host='%63[^']", place->host) != 1 &&
            sscanf(line, "clock='%15[^']", place->clock) != 1) {
            sscanf(line, "gateway_port='%5" SCNu16, &place->port);
        }
    }
    fclose(file);
    return place->port ? HIL_CLIENT_OK
                       : client_fail(client, HIL_CLIENT_CONNECTION,
                                     "%.200s names no gateway: run with --gateway 0", path);
}

/* Opens the TCP connection to the gateway. */
static enum hil_client_code stream_connect(struct hil_client *client, const char *host,
                                           uint16_t port)
{
    struct hil_client_core *core = client->core;
    const struct addrinfo hints = {.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV,
                                   .ai_socktype = SOCK_STREAM};
    struct addrinfo *address = NULL;
    struct pollfd wait = {.events = POLLOUT};
    char service[8];
    socklen_t size = sizeof(int);
    int error = 0, one = 1;

    snprintf(service, sizeof service, "%u", port);
    error = getaddrinfo(host, service, &hints, &address);
    if (error == EAI_MEMORY || error == EAI_SYSTEM) {
        return client_fail(client, HIL_CLIENT_SYSTEM, "host: %s",
                           error == EAI_MEMORY ? "no memory" : strerror(errno));
    }
    if (error) {
        return client_fail(client, HIL_CLIENT_INPUT, "host: found \"%.60s\", expected an address",
                           host);
    }
    core->gateway = socket(address->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    wait.fd = core->gateway;
    if (connect(core->gateway, address->ai_addr, address->ai_addrlen)) {
        error = errno;
        if (error == EINPROGRESS && client_poll(client, &wait, 1)) {
            error = ETIMEDOUT;
        } else if (error == EINPROGRESS) {
            getsockopt(core->gateway, SOL_SOCKET, SO_ERROR, &error, &size);
        }
    }
    freeaddrinfo(address);
    if (core->gateway < 0 || error) {
        return client_fail(client, HIL_CLIENT_CONNECTION, "%.60s:%u: %s", host, port,
                           strerror(error));
    }
    setsockopt(core->gateway, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    return HIL_CLIENT_OK;
}

/* Sends a command to the gateway and waits for its "ok". */
static enum hil_client_code stream_ask(struct hil_client *client, const char *command)
{
    struct hil_client_core *core = client->core;
    const unsigned heard = core->heard;
    enum hil_client_code code = stream_flush(client);

    core->nout = (size_t)sprintf(core->out, "%s", command);
    code = code ? code : stream_flush(client);
    while (!code && core->heard == heard) {
        code = client_wait(client);
    }
    return code;
}

/* Opens all buses of the gateway and reads the client table of its run. */
static enum hil_client_code stream_open(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    enum hil_client_code code = stream_ask(client, "");
    size_t before = 0;

    code = code ? code : stream_ask(client, "< open all >");
    /* The run tells the table in parts; an empty part is the end */
    for (unsigned part = 0; !code && (part == 0 || core->ntable > before); part++) {
        char command[32];

        before = core->ntable;
        snprintf(command, sizeof command, "< tell %u >", part);
        code = stream_ask(client, command);
    }
    code = code || core->table
               ? code
               : client_fail(client, HIL_CLIENT_TABLES, "the gateway tells no client table");
    code = code ? code : table_read_text(client, "gateway");
    return code ? code : stream_ask(client, "< rawmode >");
}

/* Opens the SocketCAN interface of a bus. A "BUS=INTERFACE" option replaces the rig's interface. */
static enum hil_client_code interface_open(struct hil_client *client, struct bus *bus,
                                           const char *const *interfaces)
{
    struct sockaddr_can address = {.can_family = AF_CAN};
    const size_t length = strlen(bus->name);
    const int on = 1;

    for (; interfaces && *interfaces; interfaces++) {
        if (!strncmp(*interfaces, bus->name, length) && (*interfaces)[length] == '=') {
            snprintf(bus->interface, sizeof bus->interface, "%s", *interfaces + length + 1);
        }
    }
    bus->socket = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW);
    address.can_ifindex = (int)if_nametoindex(bus->interface);
    if (bus->socket < 0 || !address.can_ifindex ||
        setsockopt(bus->socket, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) ||
        bind(bus->socket, (struct sockaddr *)&address, sizeof address)) {
        return client_fail_system(client, bus->interface);
    }
    return HIL_CLIENT_OK;
}

/* Checks the option `lockstep` against the clock in the file of --ready, if the file has one. */
static enum hil_client_code client_check_place(struct hil_client *client, const struct place *place,
                                               const struct hil_client_options *options)
{
    if (place->clock[0] && client->core->lockstep != !strcmp(place->clock, "lockstep")) {
        return client_fail(client, HIL_CLIENT_INPUT,
                           "%.200s: the clock of the run is %s, the client's options.lockstep is "
                           "%s",
                           options->ready, place->clock, client->core->lockstep ? "true" : "false");
    }
    return HIL_CLIENT_OK;
}

/* Connects to the gateway that the file of --ready names. If the gateway does not answer, the file
 * may be from a killed run: reads the file again until the deadline. */
static enum hil_client_code client_connect_ready(struct hil_client *client,
                                                 const struct hil_client_options *options)
{
    const struct timespec pause = {.tv_nsec = 2000000};
    struct hil_client_core *core = client->core;
    struct place place;
    enum hil_client_code code;

    for (;;) {
        place = (struct place){.host = "127.0.0.1"};
        code = client_read_ready(client, options->ready, &place);
        code = code ? code : stream_connect(client, place.host, place.port);
        if (code != HIL_CLIENT_CONNECTION || core->gateway < 0) {
            break;
        }
        close(core->gateway);
        core->gateway = -1;
        if (client_now_ns() / 1000000 > core->deadline_ms) {
            return client_fail(client, code,
                               "%.60s:%u: nobody serves the gateway that %.150s names", place.host,
                               place.port, options->ready);
        }
        nanosleep(&pause, NULL);
    }
    code = code ? code : stream_open(client);
    return code ? code : client_check_place(client, &place, options);
}

/* Connects to the gateway of the options, or opens the SocketCAN interfaces. */
static enum hil_client_code client_connect(struct hil_client *client,
                                           const struct hil_client_options *options)
{
    const char *host = options->host ? options->host : "127.0.0.1";
    enum hil_client_code code = HIL_CLIENT_OK;

    client_limit_time(client->core, client->core->timeout_ms);
    if (options->ready) {
        return client_connect_ready(client, options);
    }
    if (options->port) {
        code = stream_connect(client, host, options->port);
        return code ? code : stream_open(client);
    }
    code = table_read_file(client, options->table);
    for (size_t i = 0; i < client->core->nbus && !code; i++) {
        code = interface_open(client, &client->core->bus[i], options->interfaces);
    }
    return code;
}

/* ---- frames of the host ---- */

/* Returns the exclusive or (1), or CRC-8 SAE J1850 (2), of all bytes but one. */
static uint8_t frame_checksum(const struct message *frame, const uint8_t *data, size_t length)
{
    const bool crc = frame->checksum == 2;
    uint8_t total = crc ? 0xff : 0;

    for (size_t i = 0; i < length; i++) {
        total ^= (int)i == frame->checksum_byte ? 0 : data[i];
        for (int bit = 0; crc && (int)i != frame->checksum_byte && bit < 8; bit++) {
            total = (uint8_t)(total << 1 ^ (total & 0x80 ? 0x1d : 0));
        }
    }
    return crc ? total ^ 0xff : total;
}

/* Fills in counter and checksum, except bits that are given; NULL = none. */
static void frame_close(const struct message *frame, uint8_t *data, size_t length,
                        const uint8_t *given)
{
    uint8_t place[IMAGE_SIZE] = {0};
    bool counts = frame->counter >= 0;

    field_put(&frame->count_field, place, UINT64_MAX);
    for (size_t i = 0; given && i < IMAGE_SIZE; i++) {
        counts = counts && !(place[i] & given[i]);
    }
    if (counts) {
        field_put(&frame->count_field, data, (*frame->sent)++);
    }
    if (frame->checksum && !(given && given[frame->checksum_byte])) {
        data[frame->checksum_byte] = frame_checksum(frame, data, length);
    }
}

/* Sends a frame of the client table. */
static enum hil_client_code client_send_row_frame(struct hil_client *client, struct message *frame)
{
    frame_close(frame, frame->data, frame->length, NULL);
    return client_send_frame(client, frame, frame->data, frame->length);
}

/* Sends a message with the given values. Fills in the constants, the counter and the checksum of
 * its frame in the client table. */
static enum hil_client_code client_send_values(struct hil_client *client,
                                               const struct message *message,
                                               const struct hil_client_value *values, size_t count)
{
    struct hil_client_core *core = client->core;
    unsigned longest = 0;
    bool is_command = false;
    uint8_t data[IMAGE_SIZE] = {0}, given[IMAGE_SIZE] = {0};

    for (size_t i = 0; i < count; i++) {
        const struct signal *signal = signal_find(core, message, values[i].signal);

        if (!signal) {
            return client_fail(client, HIL_CLIENT_INPUT, "%s has no signal %.60s", message->name,
                               values[i].signal);
        }
        field_put(&signal->field, data, field_encode(&signal->field, values[i].value));
        field_put(&signal->field, given, UINT64_MAX);
        if (signal->selector >= 0) {
            const unsigned own = signal->length ? signal->length : message->length;

            data[0] = (uint8_t)signal->selector;
            longest = own > longest ? own : longest;
        }
        is_command = is_command || signal->selector == SELECTOR;
    }
    longest = longest ? longest : is_command ? 1 : message->length;
    for (size_t i = 0; i < message->bus->nframe; i++) {
        const struct message *frame = &core->frame[message->bus->frame + i];

        if (frame->id == message->id && frame->length == longest &&
            (frame->checksum || frame->counter >= 0)) {
            for (size_t k = 0; k < longest; k++) {
                data[k] |= (uint8_t)(frame->data[k] & ~given[k]);
            }
            frame_close(frame, data, longest, given);
            break;
        }
    }
    memcpy(data + ID_BYTE, &message->id, sizeof message->id);
    return client_send_frame(client, message, data, longest);
}

/* Sends the frames of a kind of rows: of a stage, and of the chosen joints; NULL = of all. */
static enum hil_client_code client_send_rows(struct hil_client *client, int kind, int stage,
                                             const bool *chosen, enum hil_client_quantity quantity)
{
    struct hil_client_core *core = client->core;
    enum hil_client_code code = HIL_CLIENT_OK;

    for (size_t i = 0; i < core->nrow && !code; i++) {
        const struct row *row = &core->row[i];

        if ((int)row->kind == kind && row->stage == stage && row->quantity == quantity &&
            (!chosen || chosen[row->owner])) {
            field_put(&row->field, row->frame->data, (uint64_t)row->count);
            code = client_send_row_frame(client, row->frame);
        }
    }
    return code;
}

/* Returns the number of stages of a kind of rows. */
static int client_count_stages(const struct hil_client_core *core, int kind)
{
    int stages = 0;

    for (size_t i = 0; i < core->nrow; i++) {
        if ((int)core->row[i].kind == kind && core->row[i].stage >= stages) {
            stages = core->row[i].stage + 1;
        }
    }
    return stages;
}

/* Sends the set points of the joints that are on, and the cyclic frames. */
static enum hil_client_code client_send_set_points(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    enum hil_client_code code = HIL_CLIENT_OK;

    /* A joint that is off has the set point 0 in frames that it shares */
    for (int on = 0; on < 2; on++) {
        for (size_t i = 0; i < core->nrow; i++) {
            const struct row *row = &core->row[i];

            if (row->kind == SET && (!on || row->quantity == core->joint[row->owner].quantity)) {
                const double value = on ? core->joint[row->owner].value : 0.0;

                field_put(&row->field, row->frame->data,
                          field_encode(&row->field, fmax(row->low, fmin(row->high, value))));
                row->frame->pending = on;
            }
        }
    }
    for (size_t i = 0; i < core->nframe && !code; i++) {
        if (core->frame[i].pending) {
            code = client_send_row_frame(client, &core->frame[i]);
        }
    }
    for (size_t i = 0; i < core->nrow && core->listening && !code; i++) {
        const struct row *row = &core->row[i];

        if (row->kind == CYCLE && (row->owner < 0 || !core->joint[row->owner].quantity)) {
            code = client_send_row_frame(client, row->frame);
        }
    }
    return code;
}

/* ---- time ---- */

/* Returns the most ticks in one STEP, so that set-points are sent often enough. */
static int client_refresh_ticks(const struct hil_client_core *core)
{
    int ticks = STEP_TICKS;

    for (size_t i = 0; i < core->nrow; i++) {
        const struct row *row = &core->row[i];

        if ((row->kind == CYCLE && core->listening) ||
            (row->kind == SET && row->quantity == core->joint[row->owner].quantity)) {
            const int own = row->frame->bus->every_tick ? 1 : core->refresh_ticks;

            ticks = own < ticks ? own : ticks;
        }
    }
    return ticks;
}

/* Returns whether the present STEP is answered. SocketCAN: a DONE on every bus. Gateway: one DONE,
 * on the bus of the STEP, after all other frames. A refusal on one bus is enough. */
static bool client_is_done(const struct hil_client_core *core)
{
    bool done = core->step->done;

    for (size_t i = 0; core->gateway < 0 && i < core->nbus; i++) {
        done = done && core->bus[i].done;
    }
    return done || core->refused;
}

/* Sends a STEP and receives frames until the STEP is answered. */
static enum hil_client_code client_step_once(struct hil_client *client, int ticks)
{
    struct hil_client_core *core = client->core;
    const struct message step = {.bus = core->step};
    const uint32_t begin = (uint32_t)client->tick;
    const uint8_t words[] = {(uint8_t)begin,         (uint8_t)(begin >> 8), (uint8_t)(begin >> 16),
                             (uint8_t)(begin >> 24), (uint8_t)ticks,        (uint8_t)(ticks >> 8)};
    uint8_t data[IMAGE_SIZE] = {0};
    enum hil_client_code code;

    memcpy(data, words, sizeof words);
    memcpy(data + ID_BYTE, &core->step->step_id, sizeof core->step->step_id);
    code = client_send_frame(client, &step, data, sizeof words);

    /* Ticks by which a DONE of this STEP is recognized */
    core->begin = (uint32_t)client->tick;
    core->expected = core->begin + (uint32_t)ticks;
    core->refused = core->stopping = false;
    for (size_t i = 0; i < core->nbus; i++) {
        core->bus[i].done = false;
    }
    code = code || core->gateway < 0 ? code : stream_flush(client);
    while (!code && !client_is_done(core)) {
        code = client_wait(client);
    }
    if (code == HIL_CLIENT_TIMEOUT) {
        return client_fail(client, code,
                           "tick %" PRId64 ": no answer to STEP within %d ms: is the run's clock "
                           "lockstep, and are the tables of its rig?",
                           client->tick, core->timeout_ms);
    }
    if (!code && core->stopping && core->at != core->expected) {
        return client_fail(client, HIL_CLIENT_STOPPED, "tick %" PRIu32 ": the run is over",
                           core->at);
    }
    client->tick += code || core->refused ? 0 : ticks;
    return code;
}

enum hil_client_code hil_client_step(struct hil_client *client, int ticks)
{
    struct hil_client_core *core = client->core;
    enum hil_client_code code = HIL_CLIENT_OK;

    if (!core->lockstep || ticks < 1) {
        return client_fail(client, HIL_CLIENT_INPUT, "expected the lockstep clock, and a tick");
    }
    while (ticks > 0 && !code) {
        const int most = client_refresh_ticks(core), count = ticks < most ? ticks : most;

        client_limit_time(core, core->timeout_ms);
        code = client_send_set_points(client);
        code = code ? code : client_step_once(client, count);
        /* If the run is at another tick, the first step starts there; a later step fails */
        if (!code && core->refused) {
            client->tick = core->at;
            code = !core->joined ? client_step_once(client, count) : HIL_CLIENT_OK;
        }
        if (!code && core->refused) {
            code = client_fail(client, HIL_CLIENT_MOVED,
                               "the run is at tick %" PRIu32 ": somebody else moves its time",
                               core->at);
        }
        core->joined = core->joined || !code;
        ticks -= count;
    }
    return code;
}

enum hil_client_code hil_client_write(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    enum hil_client_code code;

    if (core->lockstep) {
        return client_fail(client, HIL_CLIENT_INPUT, "expected hil_client_step, in lockstep");
    }
    client_limit_time(core, core->timeout_ms);
    code = client_send_set_points(client);
    return code || core->gateway < 0 ? code : stream_flush(client);
}

enum hil_client_code hil_client_receive(struct hil_client *client, int timeout_ms)
{
    struct hil_client_core *core = client->core;
    uint64_t seen = core->frames;
    enum hil_client_code code;

    if (core->lockstep) {
        return client_fail(client, HIL_CLIENT_INPUT, "expected hil_client_step, in lockstep");
    }
    client_limit_time(core, timeout_ms);
    code = client_wait(client);
    for (int i = 0; i < READS_MAX && !code && seen != core->frames; i++) {
        seen = core->frames;
        code = client_take(client);
    }
    return code == HIL_CLIENT_TIMEOUT && timeout_ms <= 0 ? HIL_CLIENT_OK : code;
}

/* Advances by `ticks`. Without lockstep, writes and receives once per ms instead. */
static enum hil_client_code client_pass(struct hil_client *client, int ticks)
{
    const struct timespec tick = {.tv_nsec = 1000000};
    enum hil_client_code code = HIL_CLIENT_OK;

    if (client->core->lockstep) {
        return hil_client_step(client, ticks);
    }
    for (; ticks > 0 && !code; ticks--) {
        code = hil_client_write(client);
        nanosleep(&tick, NULL);
        code = code ? code : hil_client_receive(client, 0);
    }
    return code;
}

/* ---- the client ---- */

enum hil_client_code hil_client_open(struct hil_client *client,
                                     const struct hil_client_options *options)
{
    struct hil_client_core *core = calloc(1, sizeof *core);
    enum hil_client_code code;

    *client = (struct hil_client){.core = core};
    if (!core) {
        return client_fail(client, HIL_CLIENT_SYSTEM, "no memory");
    }
    /* Copy the options, with defaults */
    core->gateway = -1;
    core->lockstep = options->lockstep;
    core->timeout_ms = options->timeout_ms > 0 ? options->timeout_ms : 10000;
    core->refresh_ticks = options->refresh_ticks > 0 ? options->refresh_ticks : 10;
    code = client_connect(client, options);
    if (!code && core->lockstep && !core->step) {
        code = client_fail(client, HIL_CLIENT_TABLES, "found no STEP on any bus of %s", core->rig);
    }
    if (code) {
        hil_client_close(client);
    }
    return code;
}

void hil_client_close(struct hil_client *client)
{
    struct hil_client_core *core = client->core;

    if (!core) {
        return;
    }
    if (core->gateway >= 0) {
        close(core->gateway);
    }
    for (size_t i = 0; i < core->nbus; i++) {
        if (core->bus[i].socket >= 0) {
            close(core->bus[i].socket);
        }
    }
    free(core->message);
    free(core->signal);
    free(core->frame);
    free(core->report);
    free(core->name);
    free(core->row);
    free(core->table);
    free(core);
    client->core = NULL;
}

int hil_client_find_joint(const struct hil_client *client, const char *name)
{
    return table_find_joint(client->core, name);
}

int hil_client_find_sensor(const struct hil_client *client, const char *name)
{
    return table_find_sensor(client->core, name);
}

const char *hil_client_joint_name(const struct hil_client *client, int joint)
{
    return joint >= 0 && (size_t)joint < client->core->njoint ? client->core->joint[joint].name
                                                              : NULL;
}

const char *hil_client_sensor_name(const struct hil_client *client, int sensor)
{
    return sensor >= 0 && (size_t)sensor < client->core->nsensor ? client->core->sensor[sensor]
                                                                 : NULL;
}

enum hil_client_code hil_client_listen(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    const int stages = core->listening ? 0 : client_count_stages(core, SETUP);
    enum hil_client_code code = HIL_CLIENT_OK;

    for (int stage = 0; stage < stages && !code; stage++) {
        client_limit_time(core, core->timeout_ms);
        code = client_send_rows(client, SETUP, stage, NULL, HIL_CLIENT_OFF);
        code = code ? code : client_pass(client, STAGE_TICKS);
    }
    if (!code && !core->listening) {
        core->listening = true;
        code = client_pass(client, SETTLE_TICKS);
    }
    return code;
}

/* Returns the row with a joint's set points of a quantity; NULL = its board takes none. */
static const struct row *client_find_set(const struct hil_client_core *core, int joint,
                                         enum hil_client_quantity quantity)
{
    for (size_t i = 0; i < core->nrow; i++) {
        if (core->row[i].kind == SET && core->row[i].owner == joint &&
            core->row[i].quantity == quantity) {
            return &core->row[i];
        }
    }
    return NULL;
}

/* Marks the joints with the given names; count 0 = all joints. HIL_CLIENT_BOARD = a joint's board
 * does not support the quantity. */
static enum hil_client_code client_choose(struct hil_client *client, const char *const *names,
                                          size_t count, enum hil_client_quantity quantity,
                                          bool chosen[JOINTS_MAX])
{
    struct hil_client_core *core = client->core;

    if ((unsigned)quantity >= HIL_CLIENT_QUANTITIES) {
        return client_fail(client, HIL_CLIENT_INPUT, "there is no set-point %d", (int)quantity);
    }
    for (size_t i = 0; i < (count ? count : core->njoint); i++) {
        const int joint = count ? hil_client_find_joint(client, names[i]) : (int)i;

        if (joint < 0) {
            return client_fail(client, HIL_CLIENT_INPUT, "rig %s has no joint \"%.60s\"", core->rig,
                               names[i]);
        }
        if (quantity && !client_find_set(core, joint, quantity)) {
            return client_fail(client, HIL_CLIENT_BOARD, "the board of %s takes no %s",
                               core->joint[joint].name, quantity_names[quantity]);
        }
        chosen[joint] = true;
    }
    return HIL_CLIENT_OK;
}

/* Switches the mode of the chosen joints and resets their set-points. Waits SETTLE_TICKS, so that
 * the boards report the new mode. */
static enum hil_client_code client_switch(struct hil_client *client, const bool *chosen,
                                          enum hil_client_quantity quantity)
{
    struct hil_client_core *core = client->core;
    const int stages = client_count_stages(core, SWITCH);
    enum hil_client_code code = HIL_CLIENT_OK;

    client_limit_time(core, core->timeout_ms);
    for (size_t i = 0; i < core->njoint; i++) {
        struct hil_client_joint state;

        if (!chosen[i]) {
            continue;
        }
        hil_client_read(client, (int)i, &state);
        core->joint[i].value = 0.0;
        core->joint[i].quantity = quantity;
        /* A loop begins at the angle of the motor */
        if (quantity == HIL_CLIENT_POSITION) {
            core->joint[i].value =
                isfinite(state.motor_position_rad) ? state.motor_position_rad : state.position_rad;
        }
        if (!isfinite(core->joint[i].value)) {
            core->joint[i].quantity = HIL_CLIENT_OFF;
            return client_fail(client, HIL_CLIENT_BOARD,
                               "%s: its board has reported no position to hold",
                               core->joint[i].name);
        }
    }
    for (int stage = 0; stage < stages && !code; stage++) {
        code = client_send_rows(client, SWITCH, stage, chosen, quantity);
        code = code || stage + 1 == stages ? code : client_pass(client, STAGE_TICKS);
    }
    return code ? code : client_pass(client, SETTLE_TICKS);
}

/* Writes why a joint did not switch on: its board refused, or no board sent a frame. */
static enum hil_client_code client_fail_enable(struct hil_client *client, const char *joint,
                                               const struct hil_client_joint *state)
{
    if (client->core->frames == 0) {
        return client_fail(client, HIL_CLIENT_BOARD,
                           "%s does not switch on: no frame has come from any board%s", joint,
                           client->core->lockstep
                               ? ""
                               : ": is the run paused, or in lockstep (options.lockstep)?");
    }
    return client_fail(client, HIL_CLIENT_BOARD,
                       "%s does not switch on: mode \"%s\", faults 0x%" PRIx32
                       "; the simulator's log may say what its board wants first",
                       joint, state->mode, state->faults);
}

/* Reads the gains of loops. Fails if all gains of a loop are 0, because the loop then has no
 * effect. Accepts a board that does not answer. */
static enum hil_client_code client_check_gains(struct hil_client *client, const bool *chosen,
                                               enum hil_client_quantity quantity)
{
    struct hil_client_core *core = client->core;
    enum hil_client_code code = HIL_CLIENT_OK;
    bool asked = false;

    for (size_t i = 0; i < core->nrow; i++) {
        asked = asked || (core->row[i].kind == ASK && core->row[i].quantity == quantity &&
                          chosen[core->row[i].owner]);
    }
    code = client_send_rows(client, ASK, 0, chosen, quantity);
    code = code || !asked ? code : client_pass(client, STAGE_TICKS);
    for (size_t joint = 0; joint < core->njoint && asked && !code; joint++) {
        size_t gains = 0, zero = 0;

        for (size_t i = 0; i < core->nrow && chosen[joint]; i++) {
            const struct row *row = &core->row[i];

            if (row->kind == VALUE && row->owner == (int)joint &&
                (int)row->source == GAIN + (int)quantity) {
                gains++;
                zero += field_value(&row->field) == 0.0;
            }
        }
        if (gains > 0 && zero == gains) {
            code = client_fail(client, HIL_CLIENT_BOARD,
                               "%s: the %s loop of its board has gains of 0 and would do nothing: "
                               "send a message with its gains before, or set them in the rig",
                               core->joint[joint].name, quantity_names[quantity]);
        }
    }
    return code;
}

enum hil_client_code hil_client_enable(struct hil_client *client, const char *const *joints,
                                       size_t njoint, enum hil_client_quantity quantity)
{
    struct hil_client_core *core = client->core;
    bool chosen[JOINTS_MAX] = {false};
    enum hil_client_code code = client_choose(client, joints, njoint, quantity, chosen);

    code = code ? code : hil_client_listen(client);
    client_limit_time(core, core->timeout_ms);
    code = code ? code : client_check_gains(client, chosen, quantity);
    /* Switch off first, because this clears faults; then switch on */
    code = code ? code : client_switch(client, chosen, HIL_CLIENT_OFF);
    if (code || quantity == HIL_CLIENT_OFF) {
        return code;
    }
    code = client_switch(client, chosen, quantity);
    /* Wait until every chosen motor reports that it is on */
    for (int ticks = 0; !code; ticks += SETTLE_TICKS) {
        struct hil_client_joint state = {.is_on = true};
        size_t i = 0;

        while (i < core->njoint &&
               (!chosen[i] || (hil_client_read(client, (int)i, &state), state.is_on))) {
            i++;
        }
        if (i == core->njoint) {
            return HIL_CLIENT_OK;
        }
        code = ticks >= ENABLE_TICKS ? client_fail_enable(client, core->joint[i].name, &state)
                                     : client_pass(client, SETTLE_TICKS);
    }
    return code;
}

enum hil_client_code hil_client_command(struct hil_client *client, int joint,
                                        enum hil_client_quantity quantity, double value)
{
    if (!hil_client_joint_name(client, joint) || !isfinite(value) || !quantity ||
        client->core->joint[joint].quantity != quantity) {
        return client_fail(client, HIL_CLIENT_INPUT,
                           "joint %d: expected one that is on for this set-point, and a number",
                           joint);
    }
    client->core->joint[joint].value = value;
    return HIL_CLIENT_OK;
}

int hil_client_find_tripped(const struct hil_client *client, int first)
{
    for (size_t i = first > 0 ? (size_t)first : 0; i < client->core->njoint; i++) {
        struct hil_client_joint state;

        hil_client_read(client, (int)i, &state);
        if (client->core->joint[i].quantity && !state.is_on) {
            return (int)i;
        }
    }
    return -1;
}

/* Returns the newest field in which a joint or a sensor reports a quantity; NULL = none. */
static const struct field *client_find_value(const struct hil_client_core *core, int owner,
                                             enum source source)
{
    const struct field *newest = NULL;

    for (size_t i = 0; i < core->nrow; i++) {
        const struct row *row = &core->row[i];

        if (row->kind == VALUE && row->owner == owner && row->source == source &&
            (!newest || row->frame->time_ns > newest->message->time_ns)) {
            newest = &row->field;
        }
    }
    return newest;
}

enum hil_client_code hil_client_read(const struct hil_client *client, int joint,
                                     struct hil_client_joint *state)
{
    const struct hil_client_core *core = client->core;
    const double turn = 2.0 * acos(-1.0);
    const struct field *field[FORCE];
    const struct row *set;
    int64_t count;

    if (!hil_client_joint_name(client, joint)) {
        return HIL_CLIENT_INPUT;
    }
    *state = (struct hil_client_joint){.mode = "", .time_ns = -1};
    for (int i = 0; i < FORCE; i++) {
        field[i] = client_find_value(core, joint, (enum source)i);
        if (field[i] && field[i]->message->time_ns > state->time_ns) {
            state->time_ns = field[i]->message->time_ns;
        }
    }
    /* Values in SI units; NAN = not received */
    state->position_rad = field_value(field[POSITION]);
    state->motor_position_rad = field_value(field[MOTOR_POSITION]);
    state->motor_velocity_rad_s = field_value(field[MOTOR_VELOCITY]);
    state->current_a = field_value(field[CURRENT]);
    state->torque_nm = field_value(field[TORQUE]);
    /* The link's angle, from the spring's deflection or from an angle within a turn */
    if (field[DEFLECTION]) {
        state->position_rad = state->motor_position_rad - field_value(field[DEFLECTION]);
    } else if (field[TURN]) {
        const double link = field_value(field[TURN]);

        state->position_rad = link + turn * round((state->motor_position_rad - link) / turn);
    }
    for (size_t i = core->nname; i-- > 0 && field_get(field[MODE], &count);) {
        if (core->name[i].bus == field[MODE]->message->bus && core->name[i].number == count) {
            state->mode = core->name[i].text;
        }
    }
    state->faults = field_get(field[FAULTS], &count) ? (uint32_t)count : 0;
    /* The motor is on if the reported mode is that of its set points. Some boards report no mode */
    set = client_find_set(core, joint, core->joint[joint].quantity);
    if (set && !field[MODE] && state->time_ns >= 0) {
        state->mode = set->mode;
    }
    state->is_on = set && !strcmp(state->mode, set->mode);
    return HIL_CLIENT_OK;
}

enum hil_client_code hil_client_read_wrench(const struct hil_client *client, int sensor,
                                            struct hil_client_wrench *wrench)
{
    if (!hil_client_sensor_name(client, sensor)) {
        return HIL_CLIENT_INPUT;
    }
    wrench->time_ns = -1;
    for (int i = 0; i < 6; i++) {
        const struct field *field =
            client_find_value(client->core, sensor, (enum source)(FORCE + i));

        *(i < 3 ? &wrench->force_n[i] : &wrench->moment_nm[i - 3]) = field_value(field);
        if (field && field->message->time_ns > wrench->time_ns) {
            wrench->time_ns = field->message->time_ns;
        }
    }
    return HIL_CLIENT_OK;
}

enum hil_client_code hil_client_read_dropped(struct hil_client *client, uint64_t *count)
{
    struct hil_client_core *core = client->core;
    enum hil_client_code code;
    int size = 0;

    if (core->gateway < 0) {
        return client_fail(client, HIL_CLIENT_INPUT, "expected a gateway, which counts commands");
    }
    client_limit_time(core, core->timeout_ms);
    code = stream_ask(client, "< tell dropped >");
    if (!code && sscanf(core->told, "%" SCNu64 "%n", count, &size) != 1) {
        return client_fail(client, HIL_CLIENT_CONNECTION, "the gateway says: %.160s", core->told);
    }
    if (!code) {
        client_fail(client, code, "%s", core->told + size + (core->told[size] == ' '));
    }
    return code;
}

enum hil_client_code hil_client_send(struct hil_client *client, const char *bus,
                                     const char *message, const struct hil_client_value *values,
                                     size_t nvalue)
{
    const struct message *found = message_find(client->core, bus_find(client->core, bus), message);

    client_limit_time(client->core, client->core->timeout_ms);
    return found ? client_send_values(client, found, values, nvalue)
                 : client_fail(client, HIL_CLIENT_INPUT, "found no message %.40s on bus %.40s%s",
                               message, bus, "");
}

double hil_client_signal(const struct hil_client *client, const char *bus, const char *message,
                         const char *signal)
{
    const struct signal *found = signal_find(
        client->core, message_find(client->core, bus_find(client->core, bus), message), signal);

    if (!found || (found->selector >= 0 && found->field.message->data[0] != found->selector)) {
        return NAN;
    }
    return field_value(&found->field);
}
