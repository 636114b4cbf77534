/* SPDX-License-Identifier: Apache-2.0 */
/* Implements coman_hil_client.h. Order of the file: signals in frames, DBC files, connections
 * (gateway and SocketCAN), joints and the commands of their boards, time. */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include "coman_hil_client.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <dirent.h>
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

#define WORD "%32[A-Za-z0-9_]" /* sscanf format of a name in a DBC file */

enum {
    BUSES_MAX = 64,
    BOARDS_MAX = 512,
    JOINTS_MAX = 512,
    SENSORS_MAX = 128,
    NAME_SIZE = 33,        /* bytes of a short name in a DBC file, with the final zero */
    LONG_SIZE = 128,       /* bytes of a long name, with the final zero */
    FILE_SIZE = 1 << 22,   /* largest DBC file, bytes */
    STREAM_SIZE = 1 << 16, /* bytes of the gateway's receive buffer, and of its send buffer */
    READS_MAX = 64,        /* most reads per receive call */
    PLAIN = -1,            /* signal that is not multiplexed */
    SELECTOR = -2,         /* multiplexer: byte 0 selects the signals in the frame */
    STEP_TICKS = 1000,     /* most ticks in one STEP */
    READY_SIZE = 4096,     /* longest line in the file of --ready, bytes */
    SETTLE_TICKS = 5,      /* ticks until the boards have reported a new mode or setting */
    ENABLE_TICKS = 1000,   /* longest wait for motors to switch on */
    MISMATCH = 4,          /* flags of DONE */
    STOPPING = 8,
};

enum protocol { ICUB, FOC, COMPACT, OTHER };

/* Quantities of a joint that boards report. */
enum source {
    POSITION,
    DEFLECTION,
    MOTOR_POSITION,
    MOTOR_VELOCITY,
    CURRENT,
    TORQUE,
    MODE,
    FAULTS,
    SOURCES
};

struct signal {
    char name[LONG_SIZE], unit[16];
    const char *about;     /* its joint or sensor; "" = none */
    const char *long_name; /* NULL = none */
    double scale, offset;
    struct message *message;
    size_t first, count;   /* its named values in core->name */
    int selector;          /* multiplexed: the value of byte 0; else PLAIN or SELECTOR */
    unsigned start, end;   /* first bit; bytes of the shortest frame with the whole signal */
    unsigned bits, length; /* length: bytes of its frame; 0 = the message's length */
    bool big_endian, negative, floating;
};

struct message {
    char name[LONG_SIZE], sender[LONG_SIZE];
    const char *long_name; /* NULL = none */
    uint32_t id;           /* bit 31 set: 29-bit identifier */
    struct bus *bus;
    size_t first, count; /* its signals in core->signal */
    bool fd, pending;
    unsigned length, heard; /* heard: length of the last received frame, in data */
    uint8_t data[64], out[64];
    int64_t time_ns;
};

/* A named value of a signal (VAL_). */
struct name {
    int64_t number;
    const char *text;
};

struct board {
    char name[LONG_SIZE];
    struct bus *bus;
    bool has_motors;
};

struct bus {
    char name[41], interface[16], *file, *text; /* file: path and text, one allocation */
    uint64_t hash;                              /* hash of the file's bytes */
    enum protocol protocol;
    double supply_v;
    size_t first, count; /* its messages in core->message */
    int socket;          /* SocketCAN; -1 = none */
    bool done;           /* DONE of the present STEP received */
};

/* Conversion of a set-point to a raw value: (value - offset) / scale. If percent is true, the value
 * is in % of the supply. */
struct set_point {
    const struct signal *signal; /* NULL = not supported by the board */
    double scale, offset;
    bool percent;
};

struct joint {
    const char *name;
    const struct board *board;
    const struct signal *source[SOURCES], *mode; /* mode: signal of the mode command; NULL = none */
    struct set_point set_point[HIL_CLIENT_QUANTITIES];
    enum hil_client_quantity quantity;
    double value;
};

struct sensor {
    const char *name;
    const struct board *board;
    const struct signal *source[6];
};

struct hil_client_core {
    struct bus bus[BUSES_MAX];
    struct board board[BOARDS_MAX];
    struct joint joint[JOINTS_MAX];
    struct sensor sensor[SENSORS_MAX];
    struct message *message;
    struct signal *signal;
    struct name *name;
    size_t nbus, nboard, njoint, nsensor, nmessage, nsignal, nname;
    char rig[41];
    struct hil_client_foc_motor motor;
    int timeout_ms, refresh_ticks;
    int64_t deadline_ms;
    bool lockstep, listening;

    int gateway;     /* its socket; -1 = SocketCAN */
    unsigned heard;  /* number of its answers ("hi", "ok", "ok") */
    uint64_t frames; /* number of received frames */
    size_t nin, nout;
    char in[STREAM_SIZE], out[STREAM_SIZE];

    struct message *step; /* STEP; NULL = no bus has this message */
    uint32_t begin, expected, told;
    bool joined, refused, stopping;
};

/* Per protocol and quantity: the board's name of the mode, and the prefix of the set-point signal's
 * name. */
static const struct {
    const char *name, *mode[HIL_CLIENT_QUANTITIES], *signal[HIL_CLIENT_QUANTITIES];
} protocols[] = {
    [ICUB] = {"icub",
              {"force_idle", "open_loop", "current", "direct"},
              {NULL, "SET_OPEN_LOOP_pwm", "SET_DESIRED_TORQUE_torq", "SET_COMMAND_POSITION_p"}},
    [FOC] = {"foc", {"force_idle", "open_loop", "current", NULL}, {NULL, "target", "target", NULL}},
    [COMPACT] = {"compact", {"off", "voltage", "current", NULL}, {NULL, "set_po", "set_po", NULL}},
    [OTHER] = {"", {NULL}, {NULL}},
};

/* Per quantity: the signals that report it, as MESSAGE:signal without the names of sender and
 * joint. The client uses the first entry that the tables contain. */
static const char *const sources[SOURCES] = {
    [POSITION] = " POSITION:position TELEMETRY_FD:link_position ",
    [DEFLECTION] = " TELEMETRY:deflection ",
    [MOTOR_POSITION] = (" MOTOR_POSITION:position FOC:position TELEMETRY:motor_position "
                        "TELEMETRY_FD:motor_position "),
    [MOTOR_VELOCITY] = " FOC:velocity TELEMETRY_FD:motor_velocity ",
    [CURRENT] = " CURRENT:current FOC:current TELEMETRY:current TELEMETRY_FD:current ",
    [TORQUE] = " TELEMETRY:torque TELEMETRY_FD:torque FORCE:torque TORQUE:torque ",
    [MODE] = " TELEMETRY_FD:mode STATUS:mode STATE:mode ",
    [FAULTS] = " STATUS:fault STATUS:faults STATE:faults ",
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

/* ---- signals in frames ---- */

/* Returns the next bit of a signal: less significant if big-endian, else more significant. */
static unsigned signal_next_bit(const struct signal *signal, unsigned bit)
{
    return !signal->big_endian ? bit + 1 : bit % 8 ? bit - 1 : bit + 15;
}

/* Writes a raw value into the bits of a signal. */
static void signal_put(const struct signal *signal, uint8_t *data, uint64_t count)
{
    unsigned bit = signal->start;

    for (unsigned i = 0; i < signal->bits; i++, bit = signal_next_bit(signal, bit)) {
        const unsigned mask = 1u << bit % 8;

        data[bit / 8] &= (uint8_t)~mask;
        if (count >> (signal->big_endian ? signal->bits - 1 - i : i) & 1u) {
            data[bit / 8] |= (uint8_t)mask;
        }
    }
}

/* Reads the raw value from the last frame of the signal's message; false = no frame, or the frame
 * lacks the signal. */
static bool signal_get(const struct signal *signal, int64_t *count)
{
    const struct message *message = signal ? signal->message : NULL;
    uint64_t raw = 0;
    unsigned bit = signal ? signal->start : 0;

    if (!message || message->time_ns < 0 || message->heard < signal->end ||
        (signal->selector >= 0 && message->data[0] != signal->selector)) {
        return false;
    }
    for (unsigned i = 0; i < signal->bits; i++, bit = signal_next_bit(signal, bit)) {
        const uint64_t one = message->data[bit / 8] >> bit % 8 & 1u;

        raw = signal->big_endian ? raw << 1 | one : raw | one << i;
    }
    if (signal->negative && signal->bits < 64 && raw >> (signal->bits - 1)) {
        raw -= UINT64_C(1) << signal->bits;
    }
    *count = (int64_t)raw;
    return true;
}

/* Returns the value in the last frame, in the signal's unit; NAN = no value. */
static double signal_value(const struct signal *signal)
{
    int64_t count;
    uint32_t bits;
    float number;

    if (!signal_get(signal, &count)) {
        return NAN;
    }
    bits = (uint32_t)count;
    memcpy(&number, &bits, sizeof number);
    return (signal->floating   ? (double)number
            : signal->negative ? (double)count
                               : (double)(uint64_t)count) *
               signal->scale +
           signal->offset;
}

/* Returns the value in the last frame, in SI units (mA converted to A). */
static double signal_value_si(const struct signal *signal)
{
    return signal_value(signal) * (signal && !strcmp(signal->unit, "mA") ? 1e-3 : 1.0);
}

/* Converts a value to the bits of a signal. Clamps the value to the range of the signal. */
static uint64_t signal_encode(const struct signal *signal, double value, double scale,
                              double offset)
{
    const double high = ldexp(1.0, (int)signal->bits - signal->negative);
    const double count = rint((value - offset) / scale);
    const float number = (float)value;
    uint32_t bits;

    if (signal->floating) {
        memcpy(&bits, &number, sizeof bits);
        return bits;
    }
    if (count >= high) {
        return UINT64_MAX >> (64 - signal->bits + signal->negative);
    }
    if (signal->negative && count < 0.0) {
        return (uint64_t)(int64_t)(count > -high ? count : -high);
    }
    return count > 0.0 ? (uint64_t)count : 0;
}

/* Returns the name of a signal without the prefix of its joint. */
static const char *signal_quantity(const struct signal *signal)
{
    const char *name = signal->name, *about = signal->about;

    name += *name == '_' && isdigit((unsigned char)*about);
    for (; *about && *name == (isalnum((unsigned char)*about) ? *about : '_'); about++) {
        name++;
    }
    return signal->about[0] && !*about && *name == '_' ? name + 1 : signal->name;
}

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

/* Finds a named value by its text or, if text is NULL, by its number; NULL = not found. */
static const struct name *signal_find_name(const struct hil_client_core *core,
                                           const struct signal *signal, const char *text,
                                           int64_t number)
{
    for (size_t i = 0; signal && i < signal->count; i++) {
        const struct name *name = &core->name[signal->first + i];

        if (text ? !strcmp(name->text, text) : name->number == number) {
            return name;
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

/* Finds the message whose name is sender followed by kind; NULL = not found. */
static struct message *message_find(const struct hil_client_core *core, const struct bus *bus,
                                    const char *sender, const char *kind)
{
    const size_t length = strlen(sender);

    for (size_t i = 0; bus && i < bus->count; i++) {
        struct message *message = &core->message[bus->first + i];

        if (!strncmp(message->name, sender, length) && !strcmp(message->name + length, kind)) {
            return message;
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

/* ---- tables: the lines of a DBC file ---- */

/* Each function parses the rest of a line after its keyword; false = invalid line. Stored strings
 * point into the text of the file. */

/* Reads a message (BO_): ID NAME: LENGTH SENDER */
static bool table_read_message(struct hil_client_core *core, struct bus *bus, char *line)
{
    struct message *message = &core->message[core->nmessage];

    *message = (struct message){.bus = bus, .first = core->nsignal, .time_ns = -1};
    if (sscanf(line, "%10" SCNu32 " " WORD ": %4u " WORD, &message->id, message->name,
               &message->length, message->sender) != 4 ||
        message->length > sizeof message->data || message_find_id(core, bus, message->id)) {
        return false;
    }
    core->nmessage++;
    bus->count++;
    return true;
}

/* Reads a signal (SG_): NAME SELECTOR : START|BITS@ORDER SIGN (SCALE,OFFSET) [MIN|MAX] "UNIT"
 * RECEIVERS */
static bool table_read_signal(struct hil_client_core *core, struct bus *bus, char *line)
{
    struct message *message = bus->count ? &core->message[core->nmessage - 1] : NULL;
    struct signal *s = &core->signal[core->nsignal];
    char selector[8] = "", order, sign;
    int size = 0;

    *s = (struct signal){.about = "", .message = message, .selector = PLAIN};
    if (!message || sscanf(line, WORD " %n%7[Mm0-9] %n", s->name, &size, selector, &size) < 1 ||
        sscanf(line + size, ": %3u|%2u@%c%c (%lf,%lf) [%*f|%*f] \"%n%15[^\"]", &s->start, &s->bits,
               &order, &sign, &s->scale, &s->offset, &size, s->unit) < 6) {
        return false;
    }
    s->selector = selector[0] == 'm' ? atoi(selector + 1) : selector[0] ? SELECTOR : PLAIN;
    s->big_endian = order == '0';
    s->negative = sign == '-';
    s->end = !s->big_endian ? (s->start + s->bits + 7) / 8
                            : s->start / 8 + (s->bits + 7 - s->start % 8 + 7) / 8;
    if (s->bits < 1 || s->bits > 64 || s->end > message->length || s->selector > UINT8_MAX ||
        !(fabs(s->scale) > 0.0 && isfinite(s->scale) && isfinite(s->offset))) {
        return false;
    }
    core->nsignal++;
    message->count++;
    return true;
}

/* Finds the signal of "ID NAME" at the start of a line; NULL = not found. `rest` is set to the text
 * behind the name. */
static struct signal *table_find_signal(struct hil_client_core *core, struct bus *bus, char *line,
                                        char **rest)
{
    char name[NAME_SIZE];
    uint32_t id;
    int size = 0;

    if (sscanf(line, "%10" SCNu32 " " WORD "%n", &id, name, &size) != 2) {
        return NULL;
    }
    *rest = line + size;
    return signal_find(core, message_find_id(core, bus, id), name);
}

/* Returns the first quoted text of a line; NULL = none. `rest` is set to the text behind it. */
static char *table_take_text(char *line, char **rest)
{
    char *begin = strchr(line, '"'), *end = begin ? strchr(begin + 1, '"') : NULL;

    if (!end) {
        return NULL;
    }
    *end = '\0';
    *rest = end + 1;
    return begin + 1;
}

/* Reads the comment of a node (CM_ BU_): NAME "address 1, motors A B", or "address 1, F/T A".
 * Skips other nodes. */
static bool table_read_board(struct hil_client_core *core, struct bus *bus, char *line)
{
    struct board *board = &core->board[core->nboard];
    char *rest, *text = table_take_text(line, &rest), kind[16] = "";
    int size = 0;

    *board = (struct board){.bus = bus};
    if (core->nboard == BOARDS_MAX || !text || sscanf(line, WORD, board->name) != 1) {
        return false;
    }
    if (sscanf(text, "address %*u, %15[a-zA-Z/]%n", kind, &size) != 1) {
        return true;
    }
    core->nboard++;
    board->has_motors = !strcmp(kind, "motors");
    text += size;
    while ((board->has_motors || !strcmp(kind, "F/T")) && (rest = strsep(&text, " "))) {
        if (*rest && (core->njoint == JOINTS_MAX || core->nsensor == SENSORS_MAX)) {
            return false;
        }
        if (*rest && board->has_motors) {
            core->joint[core->njoint++] = (struct joint){.name = rest, .board = board};
        } else if (*rest) {
            core->sensor[core->nsensor++] = (struct sensor){.name = rest, .board = board};
        }
    }
    return true;
}

/* Reads the joint or sensor of a signal (CM_ SG_): ID SIGNAL "JOINT OR SENSOR" */
static bool table_read_subject(struct hil_client_core *core, struct bus *bus, char *line)
{
    char *rest, *text;
    struct signal *signal = table_find_signal(core, bus, line, &rest);

    text = signal ? table_take_text(rest, &rest) : NULL;
    if (text) {
        signal->about = text;
    }
    return text;
}

/* Reads the named values of a signal (VAL_): ID SIGNAL NUMBER "NAME" ... ; */
static bool table_read_names(struct hil_client_core *core, struct bus *bus, char *line)
{
    char *at, *end;
    struct signal *signal = table_find_signal(core, bus, line, &at);

    if (!signal) {
        return false;
    }
    signal->first = core->nname;
    for (;;) {
        struct name *name = &core->name[core->nname];

        name->number = strtoll(at, &end, 10);
        if (end == at) {
            signal->count = core->nname - signal->first;
            return true;
        }
        name->text = table_take_text(end, &at);
        if (!name->text) {
            return false;
        }
        core->nname++;
    }
}

/* Reads the length of the frame that carries a multiplexed signal: ID SIGNAL LENGTH; */
static bool table_read_length(struct hil_client_core *core, struct bus *bus, char *line)
{
    char *rest;
    struct signal *signal = table_find_signal(core, bus, line, &rest);

    return signal && sscanf(rest, "%2u", &signal->length) == 1 && signal->length >= signal->end &&
           signal->length <= signal->message->length;
}

/* Reads the format of a message: ID FORMAT; 14 and above mean CAN FD. */
static bool table_read_format(struct hil_client_core *core, struct bus *bus, char *line)
{
    unsigned id, format;
    struct message *message =
        sscanf(line, "%10u %2u", &id, &format) == 2 ? message_find_id(core, bus, id) : NULL;

    if (message) {
        message->fd = format >= 14;
    }
    return message;
}

/* Marks a signal as an IEEE float: ID SIGNAL : 1; */
static bool table_read_float(struct hil_client_core *core, struct bus *bus, char *line)
{
    char *rest;
    struct signal *signal = table_find_signal(core, bus, line, &rest);

    if (signal) {
        signal->floating = true;
    }
    return signal && signal->bits == 32;
}

/* Replaces the short name of a node by its long name: NAME "LONG NAME"; */
static bool table_read_long_node(struct hil_client_core *core, struct bus *bus, char *line)
{
    char *rest, *text = table_take_text(line, &rest), name[NAME_SIZE];

    if (!text || sscanf(line, WORD, name) != 1) {
        return false;
    }
    for (size_t i = 0; i < core->nboard; i++) {
        if (core->board[i].bus == bus && !strcmp(core->board[i].name, name)) {
            snprintf(core->board[i].name, LONG_SIZE, "%s", text);
        }
    }
    for (size_t i = 0; i < bus->count; i++) {
        if (!strcmp(core->message[bus->first + i].sender, name)) {
            snprintf(core->message[bus->first + i].sender, LONG_SIZE, "%s", text);
        }
    }
    return true;
}

/* Reads the long name of a message: ID "LONG NAME"; */
static bool table_read_long_message(struct hil_client_core *core, struct bus *bus, char *line)
{
    char *rest, *text = table_take_text(line, &rest);
    struct message *message =
        text ? message_find_id(core, bus, (uint32_t)strtoul(line, NULL, 10)) : NULL;

    if (message) {
        message->long_name = text;
    }
    return message;
}

/* Reads the long name of a signal: ID SIGNAL "LONG NAME"; */
static bool table_read_long_signal(struct hil_client_core *core, struct bus *bus, char *line)
{
    char *rest;
    struct signal *signal = table_find_signal(core, bus, line, &rest);

    if (signal) {
        signal->long_name = table_take_text(rest, &rest);
    }
    return signal && signal->long_name;
}

/* Parsers of DBC lines by the beginning of the line. Other lines are skipped. */
static const struct {
    const char *begin;
    bool (*read)(struct hil_client_core *core, struct bus *bus, char *line);
} lines[] = {
    {"BO_ ", table_read_message},
    {" SG_ ", table_read_signal},
    {"CM_ BU_ ", table_read_board},
    {"CM_ SG_ ", table_read_subject},
    {"VAL_ ", table_read_names},
    {"BA_ \"FrameLength\" SG_ ", table_read_length},
    {"BA_ \"VFrameFormat\" BO_ ", table_read_format},
    {"SIG_VALTYPE_ ", table_read_float},
    {"BA_ \"SystemNodeLongSymbol\" BU_ ", table_read_long_node},
    {"BA_ \"SystemMessageLongSymbol\" BO_ ", table_read_long_message},
    {"BA_ \"SystemSignalLongSymbol\" SG_ ", table_read_long_signal},
};

/* Parses the messages and signals of a bus from the text of its file. */
static enum hil_client_code table_read(struct hil_client *client, struct bus *bus)
{
    char *text = bus->text;
    size_t number = 0;

    bus->first = client->core->nmessage;
    for (char *line; number++, (line = strsep(&text, "\n"));) {
        for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
            const size_t length = strlen(lines[i].begin);

            if (!strncmp(line, lines[i].begin, length) &&
                !lines[i].read(client->core, bus, line + length)) {
                return client_fail(client, HIL_CLIENT_TABLES,
                                   "%.200s:%zu: expected a line \"%s\" of coman-hil dbc", bus->file,
                                   number, lines[i].begin);
            }
        }
    }
    /* All lines are parsed, and no line refers to a short name any more: use the long names */
    for (size_t i = bus->first; i < client->core->nmessage; i++) {
        struct message *message = &client->core->message[i];

        if (message->long_name) {
            snprintf(message->name, LONG_SIZE, "%s", message->long_name);
        }
        for (size_t k = message->first; k < message->first + message->count; k++) {
            struct signal *signal = &client->core->signal[k];

            if (signal->long_name) {
                snprintf(signal->name, LONG_SIZE, "%s", signal->long_name);
            }
        }
    }
    return HIL_CLIENT_OK;
}

/* ---- tables: the files of a rig ---- */

static int tables_is_dbc(const struct dirent *entry)
{
    const char *end = strrchr(entry->d_name, '.');

    return end && !strcmp(end, ".dbc");
}

/* Returns the FNV-1a hash of a DBC file. The file of --ready holds the hash of each bus's file. */
static uint64_t tables_hash(const char *text, size_t size)
{
    uint64_t hash = UINT64_C(0xcbf29ce484222325);

    for (size_t i = 0; i < size; i++) {
        hash = (hash ^ (unsigned char)text[i]) * UINT64_C(0x100000001b3);
    }
    return hash;
}

/* Reads a file. One allocation, which the bus owns, holds the path and the text behind it. */
static enum hil_client_code tables_read_file(struct hil_client *client, struct bus *bus,
                                             const char *folder, const char *name)
{
    const size_t length = strlen(folder) + strlen(name) + 2;
    char *memory = malloc(length + FILE_SIZE + 1);
    FILE *file;
    size_t size;

    if (!memory) {
        return client_fail(client, HIL_CLIENT_SYSTEM, "no memory");
    }
    snprintf(memory, length, "%s/%s", folder, name);
    bus->file = memory;
    bus->text = memory + length;
    file = fopen(memory, "re");
    if (!file) {
        return client_fail(client, HIL_CLIENT_TABLES, "%.200s: %s", memory, strerror(errno));
    }
    size = fread(bus->text, 1, FILE_SIZE, file);
    fclose(file);
    bus->text[size] = '\0';
    bus->hash = tables_hash(bus->text, size);
    memory = realloc(memory, length + size + 1);
    bus->file = memory ? memory : bus->file;
    bus->text = bus->file + length;
    return size < FILE_SIZE ? HIL_CLIENT_OK
                            : client_fail(client, HIL_CLIENT_TABLES,
                                          "%.200s: expected a file of less than 4 MiB", bus->file);
}

/* Reads the title of a file: CM_ "Rig R, bus B on I: protocol P, supply V V. ..." */
static enum hil_client_code tables_read_title(struct hil_client *client, struct bus *bus,
                                              char rig[static 41])
{
    const char *title = strstr(bus->text, "\nCM_ \"Rig "), *supply;
    char protocol[16], line[320];

    snprintf(line, sizeof line, "%.*s", title ? (int)strcspn(title + 1, "\n") : 0,
             title ? title + 1 : "");
    if (!title || sscanf(line, "CM_ \"Rig %40[^ ,], bus %40[^ ,] on %15[^ :]: protocol %15[a-z0-9]",
                         rig, bus->name, bus->interface, protocol) != 4) {
        return client_fail(client, HIL_CLIENT_TABLES,
                           "%.200s: found no CM_ \"Rig ..., expected a file of coman-hil dbc",
                           bus->file);
    }
    supply = strstr(line, ", supply ");
    if (!supply || sscanf(supply, ", supply %lf V", &bus->supply_v) != 1) {
        bus->supply_v = 0.0;
    }
    bus->protocol = ICUB;
    while (bus->protocol != OTHER && strcmp(protocols[bus->protocol].name, protocol) != 0) {
        bus->protocol++;
    }
    return HIL_CLIENT_OK;
}

/* Adds the bus of a file. Skips files of rigs other than `wanted`; NULL = any rig. */
static enum hil_client_code tables_add_file(struct hil_client *client, const char *folder,
                                            const char *name, const char *wanted)
{
    struct hil_client_core *core = client->core;
    struct bus *bus = &core->bus[core->nbus];
    enum hil_client_code code;
    char rig[41];

    if (core->nbus == BUSES_MAX) {
        return client_fail(client, HIL_CLIENT_TABLES, "%.200s: found more than 64 buses", folder);
    }
    bus->socket = -1;
    code = tables_read_file(client, bus, folder, name);
    code = code ? code : tables_read_title(client, bus, rig);
    if (code || (wanted && strcmp(rig, wanted) != 0)) {
        free(bus->file);
        return code;
    }
    if (core->nbus > 0 && strcmp(core->rig, rig) != 0) {
        free(bus->file);
        return client_fail(client, HIL_CLIENT_TABLES,
                           "%.150s: found files of the rigs %s and %s: say which in options.rig",
                           folder, core->rig, rig);
    }
    memcpy(core->rig, rig, sizeof rig);
    core->nbus++;
    return HIL_CLIENT_OK;
}

/* Counts the occurrences of `what` in a text. */
static size_t tables_count(const char *text, const char *what)
{
    size_t count = 0;

    for (; (text = strstr(text, what)); text++) {
        count++;
    }
    return count;
}

/* Allocates the messages, signals and names, and parses all files. Each array has a spare entry,
 * because a parser writes to an entry before it checks the line. */
static enum hil_client_code tables_read_all(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    size_t messages = 1, signals = 1, names = 1;
    enum hil_client_code code = HIL_CLIENT_OK;

    for (size_t i = 0; i < core->nbus; i++) {
        messages += tables_count(core->bus[i].text, "BO_ ");
        signals += tables_count(core->bus[i].text, " SG_ ");
        names += tables_count(core->bus[i].text, "\"");
    }
    core->message = calloc(messages, sizeof *core->message);
    core->signal = calloc(signals, sizeof *core->signal);
    core->name = calloc(names, sizeof *core->name);
    if (!core->message || !core->signal || !core->name) {
        return client_fail(client, HIL_CLIENT_SYSTEM, "no memory");
    }
    for (size_t i = 0; i < core->nbus && !code; i++) {
        code = table_read(client, &core->bus[i]);
    }
    return code;
}

/* Reads the DBC files of a rig from a folder, sorted by name. */
static enum hil_client_code tables_open(struct hil_client *client, const char *folder,
                                        const char *rig)
{
    /* Parse numbers with a decimal point in any locale of the program */
    locale_t c = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0), before;
    enum hil_client_code code = HIL_CLIENT_OK;
    struct dirent **entry = NULL;
    int count = folder ? scandir(folder, &entry, tables_is_dbc, alphasort) : 0;

    if (!c || count < 0) {
        code = client_fail_system(client, folder);
        return c ? (freelocale(c), code) : code;
    }
    before = uselocale(c);
    for (int i = 0; i < count; i++) {
        code = code ? code : tables_add_file(client, folder, entry[i]->d_name, rig);
        free(entry[i]);
    }
    free(entry);
    if (!code && client->core->nbus == 0) {
        code =
            client_fail(client, HIL_CLIENT_TABLES,
                        "%.150s: found no file of %.40s: coman-hil dbc RIG -o FOLDER writes them",
                        folder ? folder : "options.tables", rig ? rig : "a rig");
    }
    code = code ? code : tables_read_all(client);
    uselocale(before);
    freelocale(c);
    return code;
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
        core->told = tick;
        core->refused = flags & MISMATCH;
        core->stopping = flags & STOPPING;
        client->flags = (uint16_t)flags;
        bus->done = true;
    }
}

/* Stores a received frame as the last frame of its message, or handles a DONE. */
static void bus_take_frame(struct hil_client *client, struct bus *bus, uint32_t id,
                           const uint8_t *data, size_t length, int64_t time_ns)
{
    struct message *message = message_find_id(client->core, bus, id);

    client->core->frames++;
    if (message && !strcmp(message->name, "DONE") && length == 6) {
        bus_take_done(client, bus, data);
    } else if (message) {
        memcpy(message->data, data, length);
        message->heard = (unsigned)length;
        message->time_ns = time_ns;
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
    struct canfd_frame frame = {
        .can_id = message->id, .len = (uint8_t)length, .flags = message->fd ? CANFD_BRS : 0};
    const size_t room = 512; /* more than the longest command, a frame of 64 bytes */
    enum hil_client_code code;
    char *out;

    if (core->gateway < 0) {
        memcpy(frame.data, data, length);
        return interface_send(client, message->bus, &frame, message->fd ? CANFD_MTU : CAN_MTU);
    }
    code = core->nout + room > sizeof core->out ? stream_flush(client) : HIL_CLIENT_OK;
    if (code) {
        return code;
    }
    out = core->out + core->nout;
    out += sprintf(out, "< %s %0*" PRIX32 "%s %zu", message->fd ? "fdsend" : "send",
                   message->id & CAN_EFF_FLAG ? 8 : 3, message->id & CAN_EFF_MASK,
                   message->fd ? " 1" : "", length);
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

/* Contents of the file of --ready: address of the gateway, clock of the run, and hashes of the
 * run's tables ("BUS=HASH BUS=HASH ..."); "" = unknown. */
struct place {
    char host[64], clock[16], tables[READY_SIZE];
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
            sscanf(line, "clock='%15[^']", place->clock) != 1 &&
            sscanf(line, "tables='%4095[^']", place->tables) != 1) {
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

/* Opens all buses of the gateway. Waits for the answer to each command. */
static enum hil_client_code stream_open(struct hil_client *client)
{
    static const char *const commands[] = {"", "< open all >", "< rawmode >"};
    struct hil_client_core *core = client->core;
    enum hil_client_code code = HIL_CLIENT_OK;

    for (unsigned i = 0; i < 3 && !code; i++) {
        core->nout = (size_t)sprintf(core->out, "%s", commands[i]);
        code = stream_flush(client);
        while (!code && core->heard <= i) {
            code = client_wait(client);
        }
    }
    return code;
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

/* Compares the DBC files and the clock option with those of the run. Skips a comparison if the file
 * of --ready lacks the value. */
static enum hil_client_code client_check_place(struct hil_client *client, const struct place *place,
                                               const struct hil_client_options *options)
{
    const struct hil_client_core *core = client->core;

    for (size_t i = 0; place->tables[0] && i < core->nbus; i++) {
        char wanted[64];

        snprintf(wanted, sizeof wanted, "%s=%016" PRIx64, core->bus[i].name, core->bus[i].hash);
        if (!strstr(place->tables, wanted)) {
            return client_fail(client, HIL_CLIENT_TABLES,
                               "%.120s is older than the rig of the run, or of another rig: "
                               "coman-hil dbc RIG -o %.80s writes it anew",
                               core->bus[i].file, options->tables);
        }
    }
    if (place->clock[0] && core->lockstep != !strcmp(place->clock, "lockstep")) {
        return client_fail(client, HIL_CLIENT_INPUT,
                           "%.200s: the clock of the run is %s, the client's options.lockstep is "
                           "%s",
                           options->ready, place->clock, core->lockstep ? "true" : "false");
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
    for (size_t i = 0; i < client->core->nbus && !code; i++) {
        code = interface_open(client, &client->core->bus[i], options->interfaces);
    }
    return code;
}

/* ---- messages of commands ---- */

/* Sends a message with the given values. length: bytes of the frame; 0 = length from the tables. */
static enum hil_client_code client_send_values(struct hil_client *client,
                                               const struct message *message, size_t length,
                                               const struct hil_client_value *values, size_t count)
{
    unsigned longest = 0;
    bool is_command = false;
    uint8_t data[64] = {0};

    for (size_t i = 0; i < count; i++) {
        const struct signal *signal = signal_find(client->core, message, values[i].signal);

        if (!signal) {
            return client_fail(client, HIL_CLIENT_INPUT, "%s has no signal %.60s", message->name,
                               values[i].signal);
        }
        signal_put(signal, data,
                   signal_encode(signal, values[i].value, signal->scale, signal->offset));
        if (signal->selector >= 0) {
            const unsigned own = signal->length ? signal->length : message->length;

            data[0] = (uint8_t)signal->selector;
            longest = own > longest ? own : longest;
        }
        is_command = is_command || signal->selector == SELECTOR;
    }
    longest = longest ? longest : is_command ? 1 : message->length;
    return client_send_frame(client, message, data, length ? length : longest);
}

/* Sends a command to a board. A signal's name is COMMAND_signal, such as SET_MOTOR_CONFIG_poles. */
static enum hil_client_code board_command(struct hil_client *client, const struct board *board,
                                          size_t length, const struct hil_client_value *values,
                                          size_t count)
{
    const struct message *message = message_find(client->core, board->bus, board->name, "_COMMAND");

    return message ? client_send_values(client, message, length, values, count)
                   : client_fail(client, HIL_CLIENT_TABLES, "%s: found no %s_COMMAND",
                                 board->bus->file, board->name);
}

/* ---- joints and their boards ---- */

static bool text_begins(const char *text, const char *begin)
{
    return !strncmp(text, begin, strlen(begin));
}

/* Uses a reported signal as the source of its quantity if it is earlier in the list of sources than
 * the present source. best: place of the present source in the list. */
static void joint_take_source(struct joint *joint, const struct signal *signal,
                              const char *best[SOURCES])
{
    const struct message *message = signal->message;
    const size_t sender = strlen(message->sender);
    const char *kind = message->name;
    char key[2 * LONG_SIZE + 4];
    size_t length;

    /* Remove the sender's name and a final number from the name of the message */
    kind += text_begins(kind, message->sender) && kind[sender] == '_' ? sender + 1 : 0;
    length = strlen(kind);
    while (length > 0 && isdigit((unsigned char)kind[length - 1])) {
        length--;
    }
    length = kind[length] && length > 0 && kind[length - 1] == '_' ? length - 1 : strlen(kind);
    snprintf(key, sizeof key, " %.*s:%s ", (int)length, kind, signal_quantity(signal));
    for (int i = 0; i < SOURCES; i++) {
        const char *found = strstr(sources[i], key);

        if (found && (!best[i] || found < best[i])) {
            best[i] = found;
            joint->source[i] = signal;
        }
    }
}

/* Stores a command signal of a joint: mode or set-point. A current set-point counts 1 mA,
 * independent of the DBC's scale. */
static void joint_take_command(struct joint *joint, const struct signal *signal)
{
    const enum protocol protocol = joint->board->bus->protocol;
    const char *quantity = signal_quantity(signal);

    if (text_begins(quantity, "SET_CONTROL_MODE_mode")) {
        joint->mode = signal;
    }
    for (int i = HIL_CLIENT_VOLTAGE; i < HIL_CLIENT_QUANTITIES; i++) {
        const char *begin = protocols[protocol].signal[i];

        if (begin && text_begins(quantity, begin)) {
            joint->set_point[i] = (struct set_point){
                .signal = signal,
                .scale = i == HIL_CLIENT_CURRENT ? 1e-3 : signal->scale,
                .offset = i == HIL_CLIENT_CURRENT ? 0.0 : signal->offset,
                .percent = i == HIL_CLIENT_VOLTAGE && strcmp(signal->unit, "V") != 0,
            };
        }
    }
}

/* Finds the reported signals and the command signals of a joint. */
static void joint_resolve(const struct hil_client_core *core, struct joint *joint)
{
    const struct bus *bus = joint->board->bus;
    const struct message *status = message_find(core, bus, joint->board->name, "_STATUS");
    const char *best[SOURCES] = {NULL};

    for (size_t i = 0; i < core->nsignal; i++) {
        const struct signal *signal = &core->signal[i];

        if (strcmp(signal->about, joint->name) != 0) {
            continue;
        }
        if (strcmp(signal->message->sender, "host") != 0 && signal->selector == PLAIN) {
            joint_take_source(joint, signal, best);
        } else if (!strcmp(signal->message->sender, "host") && signal->message->bus == bus) {
            joint_take_command(joint, signal);
        }
    }

    /* foc: a voltage target uses the scale of the signal "pwm" in STATUS */
    for (size_t i = 0; bus->protocol == FOC && status && i < status->count; i++) {
        const struct signal *signal = &core->signal[status->first + i];

        if (!strcmp(signal_quantity(signal), "pwm")) {
            joint->set_point[HIL_CLIENT_VOLTAGE].scale = signal->scale;
        }
    }
}

/* Finds the signals of the six channels of a force-torque sensor. */
static void sensor_resolve(const struct hil_client_core *core, struct sensor *sensor)
{
    static const char *const names[] = {"fx", "fy", "fz", "mx", "my", "mz"};
    const struct bus *bus = sensor->board->bus;

    for (size_t i = 0; i < bus->count; i++) {
        const struct message *message = &core->message[bus->first + i];

        for (int k = 0; k < 6 && !strcmp(message->sender, sensor->board->name); k++) {
            const struct signal *signal = signal_find(core, message, names[k]);

            sensor->source[k] = signal && signal->selector == PLAIN ? signal : sensor->source[k];
        }
    }
}

/* Converts a joint's set-point to the bits of its signal. Limits a voltage to the supply. */
static uint64_t joint_set_point_bits(const struct joint *joint)
{
    const struct set_point *point = &joint->set_point[joint->quantity];
    const double supply_v = joint->board->bus->supply_v;
    double value = joint->value;

    if (joint->quantity == HIL_CLIENT_VOLTAGE && supply_v > 0.0) {
        value = fmax(-supply_v, fmin(supply_v, value));
        value = point->percent ? 100.0 * value / supply_v : value;
    }
    return signal_encode(point->signal, value, point->scale, point->offset);
}

/* Sends the set-points. icub: one frame per motor. Other protocols: frames shared by motors. */
static enum hil_client_code client_send_set_points(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    enum hil_client_code code = HIL_CLIENT_OK;

    /* Send the commands of single motors, and fill the shared frames */
    for (size_t i = 0; i < core->njoint && !code; i++) {
        const struct joint *joint = &core->joint[i];
        const struct signal *signal =
            joint->set_point[joint->quantity ? joint->quantity : HIL_CLIENT_VOLTAGE].signal;
        const uint64_t bits = joint->quantity ? joint_set_point_bits(joint) : 0;
        uint8_t data[64] = {0};

        if (signal && signal->selector < 0) {
            signal_put(signal, signal->message->out, bits);
            signal->message->pending = signal->message->pending || joint->quantity;
        } else if (signal && joint->quantity) {
            data[0] = (uint8_t)signal->selector;
            signal_put(signal, data, bits);
            code = client_send_frame(client, signal->message, data,
                                     signal->length ? signal->length : signal->message->length);
        }
    }
    /* Send the shared frames that contain a set-point */
    for (size_t i = 0; i < core->nmessage && !code; i++) {
        struct message *message = &core->message[i];

        if (message->pending) {
            message->pending = false;
            code = client_send_frame(client, message, message->out, message->length);
        }
    }
    return code;
}

/* Returns the number of a signal's named value; 0 = unknown name. */
static double client_number(const struct hil_client_core *core, const struct signal *signal,
                            const char *text)
{
    const struct name *name = signal_find_name(core, signal, text, 0);

    return name ? (double)name->number : 0.0;
}

/* Switches the chosen joints of a bus to the mode of a quantity. */
static enum hil_client_code bus_switch(struct hil_client *client, struct bus *bus,
                                       const bool *chosen, enum hil_client_quantity quantity)
{
    struct hil_client_core *core = client->core;
    const char *word = protocols[bus->protocol].mode[quantity];
    const struct message *all = message_find(core, bus, "ALL_MODE", "");
    enum hil_client_code code = HIL_CLIENT_OK;
    uint32_t slots = 0;

    for (size_t i = 0; i < core->njoint && !code; i++) {
        const struct joint *joint = &core->joint[i];
        const struct signal *point = joint->set_point[HIL_CLIENT_VOLTAGE].signal;

        if (joint->board->bus != bus || !chosen[i]) {
            continue;
        }
        /* Send the mode of one motor; for compact boards, collect the slots */
        if (joint->mode) {
            const struct hil_client_value value = {joint->mode->name,
                                                   client_number(core, joint->mode, word)};

            code = client_send_values(client, joint->mode->message, 0, &value, 1);
        } else if (point && !strncmp(point->message->name, "ALL_COMMAND_", 12)) {
            const int group = atoi(point->message->name + 12);

            slots |= 1u << (((unsigned)group * 4 + point->start / 16) & 31);
        }
    }
    /* One frame switches all compact boards */
    if (slots && all && !code) {
        const struct hil_client_value values[] = {
            {"mode", client_number(core, signal_find(core, all, "mode"), word)}, {"slots", slots}};

        code = client_send_values(client, all, 0, values, 2);
    }
    return code;
}

/* Sends the configuration command of a stage (0 to 3) to a motor board or sensor board. */
static enum hil_client_code board_configure(struct hil_client *client, const struct board *board,
                                            int stage)
{
    struct hil_client_core *core = client->core;
    const struct hil_client_foc_motor *m = &core->motor;
    const struct hil_client_value sensor = {"SET_TRANSMIT_MODE_mode", 0.0};
    const struct hil_client_value version[] = {{"GET_FIRMWARE_VERSION_major", 1.0},
                                               {"GET_FIRMWARE_VERSION_minor", 6.0}};
    const struct hil_client_value motor[] = {
        {"SET_MOTOR_CONFIG_flags", 1.0}, /* has an encoder */
        {"SET_MOTOR_CONFIG_resolution", m->encoder_ticks_per_rev},
        {"SET_MOTOR_CONFIG_poles", m->poles}};
    const struct hil_client_value limit[] = {{"SET_CURRENT_LIMIT_nominal", 1e3 * m->nominal_a},
                                             {"SET_CURRENT_LIMIT_peak", 1e3 * m->peak_a},
                                             {"SET_CURRENT_LIMIT_overload", 1e3 * m->overload_a}};
    const struct hil_client_value pid[] = {{"SET_CURRENT_PID_kp", m->current_kp},
                                           {"SET_CURRENT_PID_ki", m->current_ki},
                                           {"SET_CURRENT_PID_shift", m->current_shift}};
    const char *const reports[] = {"_POSITION", "_STATUS", "_CURRENT", "_MOTOR_POSITION"};
    struct hil_client_value policy = {"SET_BROADCAST_POLICY_mask_0", 0.0};

    /* A force-torque sensor needs one command. A foc board needs one per stage */
    if (message_find(core, board->bus, board->name, "_FORCE")) {
        return stage ? HIL_CLIENT_OK : board_command(client, board, 0, &sensor, 1);
    }
    if (board->bus->protocol == FOC && board->has_motors) {
        return stage == 0   ? board_command(client, board, 0, version, 2)
               : stage == 1 ? board_command(client, board, 7, motor, 3)
               : stage == 2 ? board_command(client, board, 0, limit, 3)
                            : board_command(client, board, 0, pid, 3);
    }
    if (stage || !board->has_motors) {
        return HIL_CLIENT_OK;
    }
    /* icub motor boards: enable each report that the tables contain, one bit per report */
    for (size_t i = 0; i < sizeof reports / sizeof *reports; i++) {
        const struct message *message = message_find(core, board->bus, board->name, reports[i]);

        policy.value += message ? 1u << (((message->id & 0xf) - 1) & 0xf) : 0;
    }
    return board_command(client, board, 0, &policy, 1);
}

/* Sends the commands of a configuration stage to all boards, so that they report. foc boards need
 * four stages, the others only stage 0. Time must pass between stages. */
static enum hil_client_code client_configure(struct hil_client *client, int stage)
{
    struct hil_client_core *core = client->core;
    enum hil_client_code code = HIL_CLIENT_OK;

    for (size_t i = 0; i < core->nboard && !code; i++) {
        if (core->board[i].bus->protocol < COMPACT) {
            code = board_configure(client, &core->board[i], stage);
        }
    }
    for (size_t i = 0; stage == 0 && i < core->nmessage && !code; i++) {
        const struct message *message = &core->message[i];
        const struct signal *parameter = signal_find(core, message, "parameter");
        const char *end = strrchr(message->name, '_');

        if (message->bus->protocol == COMPACT && parameter && end && !strcmp(end, "_REQUEST")) {
            const struct hil_client_value values[] = {
                {"parameter", client_number(core, parameter, "telemetry_period")},
                {"write", 1.0},
                {"value", 1e-3}};

            code = client_send_values(client, message, 0, values, 3);
        }
    }
    return code;
}

/* ---- time ---- */

/* Returns the most ticks in one STEP, so that set-points are sent often enough. */
static int client_refresh_ticks(const struct hil_client_core *core)
{
    int ticks = STEP_TICKS;

    for (size_t i = 0; i < core->njoint; i++) {
        if (core->joint[i].quantity) {
            const int own = core->joint[i].board->bus->protocol == FOC ? 1 : core->refresh_ticks;

            ticks = own < ticks ? own : ticks;
        }
    }
    return ticks;
}

/* Returns whether the present STEP is answered. SocketCAN: a DONE on every bus. Gateway: one DONE,
 * on the bus of the STEP, after all other frames. A refusal on one bus is enough. */
static bool client_is_done(const struct hil_client_core *core)
{
    bool done = core->step->bus->done;

    for (size_t i = 0; core->gateway < 0 && i < core->nbus; i++) {
        done = done && core->bus[i].done;
    }
    return done || core->refused;
}

/* Sends a STEP and receives frames until the STEP is answered. */
static enum hil_client_code client_step_once(struct hil_client *client, int ticks)
{
    struct hil_client_core *core = client->core;
    const struct hil_client_value values[] = {{"tick", (uint32_t)client->tick}, {"ticks", ticks}};
    enum hil_client_code code = client_send_values(client, core->step, 0, values, 2);

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
    if (!code && core->stopping && core->told != core->expected) {
        return client_fail(client, HIL_CLIENT_STOPPED, "tick %" PRIu32 ": the run is over",
                           core->told);
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
            client->tick = core->told;
            code = !core->joined ? client_step_once(client, count) : HIL_CLIENT_OK;
        }
        if (!code && core->refused) {
            code = client_fail(client, HIL_CLIENT_MOVED,
                               "the run is at tick %" PRIu32 ": somebody else moves its time",
                               core->told);
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
    static const struct hil_client_foc_motor coman = {4096, 8, 12.0, 18.0, 24.0, 146, 227, 15};
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
    core->motor = options->foc ? *options->foc : coman;

    /* Read the tables; find STEP and the signals of each joint and sensor */
    code = tables_open(client, options->tables, options->rig);
    for (size_t i = 0; i < core->nbus && !core->step && !code; i++) {
        core->step = message_find(core, &core->bus[i], "STEP", "");
    }
    if (!code && core->lockstep && !core->step) {
        code = client_fail(client, HIL_CLIENT_TABLES, "found no STEP on any bus of %s", core->rig);
    }
    for (size_t i = 0; i < core->njoint && !code; i++) {
        joint_resolve(core, &core->joint[i]);
    }
    for (size_t i = 0; i < core->nsensor && !code; i++) {
        sensor_resolve(core, &core->sensor[i]);
    }
    code = code ? code : client_connect(client, options);
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
        free(core->bus[i].file);
    }
    free(core->message);
    free(core->signal);
    free(core->name);
    free(core);
    client->core = NULL;
}

int hil_client_find_joint(const struct hil_client *client, const char *name)
{
    for (size_t i = 0; i < client->core->njoint; i++) {
        if (!strcmp(client->core->joint[i].name, name)) {
            return (int)i;
        }
    }
    return -1;
}

int hil_client_find_sensor(const struct hil_client *client, const char *name)
{
    for (size_t i = 0; i < client->core->nsensor; i++) {
        if (!strcmp(client->core->sensor[i].name, name)) {
            return (int)i;
        }
    }
    return -1;
}

const char *hil_client_joint_name(const struct hil_client *client, int joint)
{
    return joint >= 0 && (size_t)joint < client->core->njoint ? client->core->joint[joint].name
                                                              : NULL;
}

const char *hil_client_sensor_name(const struct hil_client *client, int sensor)
{
    return sensor >= 0 && (size_t)sensor < client->core->nsensor ? client->core->sensor[sensor].name
                                                                 : NULL;
}

enum hil_client_code hil_client_listen(struct hil_client *client)
{
    struct hil_client_core *core = client->core;
    enum hil_client_code code = HIL_CLIENT_OK;
    int stages = 1;

    for (size_t i = 0; i < core->nbus; i++) {
        stages = core->bus[i].protocol == FOC ? 4 : stages;
    }
    client_limit_time(core, core->timeout_ms);
    for (int stage = 0; stage < stages && !core->listening && !code; stage++) {
        code = client_configure(client, stage);
        code = code ? code : client_pass(client, 2);
    }
    code = code || core->listening ? code : client_pass(client, SETTLE_TICKS);
    core->listening = core->listening || !code;
    return code;
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
        const struct set_point *point;

        if (joint < 0) {
            return client_fail(client, HIL_CLIENT_INPUT, "rig %s has no joint \"%.60s\"", core->rig,
                               names[i]);
        }
        point = &core->joint[joint].set_point[quantity];
        if (quantity && (!point->signal ||
                         (point->percent && core->joint[joint].board->bus->supply_v <= 0.0))) {
            return client_fail(
                client, HIL_CLIENT_BOARD,
                "the board of %s takes no such set-point, or its tables name no supply",
                core->joint[joint].name);
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
    enum hil_client_code code = HIL_CLIENT_OK;

    client_limit_time(core, core->timeout_ms);
    for (size_t i = 0; i < core->njoint; i++) {
        struct hil_client_joint state;

        if (chosen[i]) {
            hil_client_read(client, (int)i, &state);
            core->joint[i].value = quantity == HIL_CLIENT_POSITION ? state.position_rad : 0.0;
            core->joint[i].quantity = quantity;
        }
    }
    for (size_t i = 0; i < core->nbus && !code; i++) {
        code = bus_switch(client, &core->bus[i], chosen, quantity);
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

/* Reads the control gains of icub boards. Fails if all gains of a loop are 0, because the loop then
 * has no effect. Accepts a board that does not answer. */
static enum hil_client_code client_check_gains(struct hil_client *client, const bool *chosen,
                                               enum hil_client_quantity quantity)
{
    static const char *const loops[HIL_CLIENT_QUANTITIES] = {
        [HIL_CLIENT_CURRENT] = "CURRENT", [HIL_CLIENT_POSITION] = "POSITION"};
    struct hil_client_core *core = client->core;
    enum hil_client_code code = HIL_CLIENT_OK;

    for (size_t i = 0; i < core->njoint && loops[quantity] && !code; i++) {
        const struct joint *joint = &core->joint[i];
        const struct board *board = joint->board;
        const struct message *reply = message_find(core, board->bus, board->name, "_REPLY");
        const struct signal *point = joint->set_point[quantity].signal, *gain[3] = {NULL};
        struct hil_client_value command = {"command", 0.0};

        /* The gains' names end with the axis of the set-point signal, _0 or _1 */
        for (int k = 0; k < 3 && chosen[i] && board->bus->protocol == ICUB; k++) {
            char name[NAME_SIZE];

            snprintf(name, sizeof name, "GET_%s_PID_k%c%s", loops[quantity], "pid"[k],
                     strrchr(point->name, '_'));
            gain[k] = signal_find(core, reply, name);
        }
        if (!gain[0] || !gain[1] || !gain[2]) {
            continue;
        }
        command.value = gain[0]->selector;
        code = board_command(client, board, 0, &command, 1);
        code = code ? code : client_pass(client, 2);
        if (!code && signal_value(gain[0]) == 0.0 && signal_value(gain[1]) == 0.0 &&
            signal_value(gain[2]) == 0.0) {
            code = client_fail(client, HIL_CLIENT_BOARD,
                               "%s: its loop has gains of 0 and would do nothing: send "
                               "SET_%s_PID before, or set them in the rig",
                               joint->name, loops[quantity]);
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

enum hil_client_code hil_client_read(const struct hil_client *client, int joint,
                                     struct hil_client_joint *state)
{
    const struct joint *j;
    const struct name *mode = NULL;
    int64_t count;

    if (!hil_client_joint_name(client, joint)) {
        return HIL_CLIENT_INPUT;
    }
    j = &client->core->joint[joint];
    /* Values in SI units; NAN = not received */
    *state = (struct hil_client_joint){
        .position_rad = signal_value_si(j->source[POSITION]),
        .motor_position_rad = signal_value_si(j->source[MOTOR_POSITION]),
        .motor_velocity_rad_s = signal_value_si(j->source[MOTOR_VELOCITY]),
        .current_a = signal_value_si(j->source[CURRENT]),
        .torque_nm = signal_value_si(j->source[TORQUE]),
        .mode = "",
        .time_ns = -1,
    };
    /* Boards that report the spring's deflection: link position = motor position - deflection */
    if (j->source[DEFLECTION]) {
        state->position_rad = state->motor_position_rad - signal_value_si(j->source[DEFLECTION]);
    }
    /* The motor is on if the reported mode is the requested mode */
    if (signal_get(j->source[MODE], &count)) {
        mode = signal_find_name(client->core, j->source[MODE], NULL, count);
        state->mode = mode ? mode->text : "";
    }
    state->faults = signal_get(j->source[FAULTS], &count) ? (uint32_t)count : 0;
    state->is_on = j->quantity && mode &&
                   !strcmp(mode->text, protocols[j->board->bus->protocol].mode[j->quantity]);
    /* Find the time of the newest frame */
    for (int i = 0; i < SOURCES; i++) {
        if (j->source[i] && j->source[i]->message->time_ns > state->time_ns) {
            state->time_ns = j->source[i]->message->time_ns;
        }
    }
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
        const struct signal *signal = client->core->sensor[sensor].source[i];

        *(i < 3 ? &wrench->force_n[i] : &wrench->moment_nm[i - 3]) = signal_value(signal);
        if (signal && signal->message->time_ns > wrench->time_ns) {
            wrench->time_ns = signal->message->time_ns;
        }
    }
    return HIL_CLIENT_OK;
}

enum hil_client_code hil_client_send(struct hil_client *client, const char *bus,
                                     const char *message, const struct hil_client_value *values,
                                     size_t nvalue)
{
    const struct message *found =
        message_find(client->core, bus_find(client->core, bus), message, "");

    client_limit_time(client->core, client->core->timeout_ms);
    return found ? client_send_values(client, found, 0, values, nvalue)
                 : client_fail(client, HIL_CLIENT_INPUT, "found no message %.40s on bus %.40s",
                               message, bus);
}

double hil_client_signal(const struct hil_client *client, const char *bus, const char *message,
                         const char *signal)
{
    return signal_value(
        signal_find(client->core,
                    message_find(client->core, bus_find(client->core, bus), message, ""), signal));
}
