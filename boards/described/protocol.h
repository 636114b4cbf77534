/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A protocol that a file describes (docs/own-boards.md): frames with fields, the states of an axis,
 * and the frames that our host sends. described_load reads the table once; it is immutable from
 * then on. Boards, host, DBC and `coman-hil protocol` all use it. It covers classic CAN and CAN FD,
 * identifiers of 11 and 29 bits, fields in data and identifier.
 *
 * Units: SI, angles on the link side of the gear. A field carries value = count * scale + offset in
 * the unit of its meaning. The arena of described_load owns all memory. RT-safe, except
 * described_load and described_read_text.
 */
#ifndef BOARDS_DESCRIBED_PROTOCOL_H
#define BOARDS_DESCRIBED_PROTOCOL_H

#include "base/yaml.h"
#include "boards/board.h"
#include "boards/field.h"

#include <endian.h>
#include <string.h>

enum {
    DESCRIBED_FRAMES_MAX = 64,
    DESCRIBED_PARAMETERS_MAX = 256,
    DESCRIBED_MODELS_MAX = 32,
    DESCRIBED_STATES_MAX = 32,
    DESCRIBED_LAWS_MAX = 8,
    DESCRIBED_LIST_MAX = 8, /* frames in one step of the host */
    DESCRIBED_ECHOES = 4,   /* most echo fields in a frame */
    DESCRIBED_ADDRESS_MAX = 254,
    DESCRIBED_SLOTS = 32,      /* axes of a bus */
    DESCRIBED_AXES = 4,        /* most axes of a motor board */
    DESCRIBED_FIELDS_MAX = 64, /* most fields of a frame, in data and identifier */
    DESCRIBED_CLASSIC_MAX = 8, /* bytes of a classic frame */
    DESCRIBED_LENGTH_MAX = 64, /* bytes of a CAN FD frame */
    DESCRIBED_STANDARD_ID_MAX = 0x7ff,
    DESCRIBED_EXTENDED_ID_MAX = 0x1fffffff,
    DESCRIBED_PERIOD_MAX_MS = 255, /* longest telemetry period that a host may set */
};

/* Meaning of the number in an identifier: id = base + step * number. */
enum described_by {
    DESCRIBED_BY_NONE,
    DESCRIBED_BY_ADDRESS,
    DESCRIBED_BY_SLOT,  /* slots: axes of a bus, numbered consecutively in the rig's order */
    DESCRIBED_BY_GROUP, /* groups of slots; one frame holds one repetition per slot of its group */
};

/* The boards that send or receive a frame; bits. */
enum described_kind {
    DESCRIBED_MOTOR = 1 << 0,
    DESCRIBED_FT = 1 << 1,
    DESCRIBED_INERTIAL = 1 << 2,
    DESCRIBED_ANY = DESCRIBED_MOTOR | DESCRIBED_FT | DESCRIBED_INERTIAL,
};

/* Control law of an axis in a state. */
enum described_law {
    DESCRIBED_OFF, /* bridge open; a commanded state with this law ends a fault */
    DESCRIBED_VOLTAGE,
    DESCRIBED_CURRENT,
    DESCRIBED_TORQUE,
    DESCRIBED_VELOCITY,
    DESCRIBED_POSITION,
    DESCRIBED_IMPEDANCE, /* torque = kp (p* - p) + kd (v* - v) + torque* */
    DESCRIBED_FAULT,     /* bridge open until OFF is commanded */
    /* only in a state: stands for the law that the host has selected */
    DESCRIBED_SELECTED,
    /* the axis keeps its state and reports the result of the refused state */
    DESCRIBED_REFUSED,
};

/* Returns whether a servo valve supports a law. It supports no law that controls a current. */
static inline bool described_law_suits_valve(enum described_law law)
{
    return law != DESCRIBED_CURRENT && law != DESCRIBED_TORQUE && law != DESCRIBED_IMPEDANCE;
}

/* Meaning of a field. Targets come from a host, sources from a board. */
enum described_meaning {
    DESCRIBED_NOTHING,
    DESCRIBED_CONSTANT, /* constant that identifies the frame */
    DESCRIBED_STORED,   /* parameter that a host writes and reads back */
    /* These select axes */
    DESCRIBED_SLOTS_MASK,
    DESCRIBED_ADDRESS,
    DESCRIBED_AXIS,
    /* In frames of both directions */
    DESCRIBED_STATE,
    DESCRIBED_LAW,
    DESCRIBED_TELEMETRY_PERIOD, /* in s */
    /* increases by one with each frame of the same row, number and axis */
    DESCRIBED_COUNTER,
    DESCRIBED_CHECKSUM,        /* checksum of the other bytes: struct described_frame */
    DESCRIBED_PARAMETER,       /* number of a parameter */
    DESCRIBED_PARAMETER_VALUE, /* bits of a parameter: struct described_parameter */
    DESCRIBED_HOST_NUMBER,     /* number of the host that a board answers */
    DESCRIBED_ANSWER_ID,       /* identifier of the frames with answer_id */
    /* Settings of an axis, in frames of both directions. A restart of the board resets them */
    DESCRIBED_SETTING,
    DESCRIBED_VELOCITY_LIMIT = DESCRIBED_SETTING,
    DESCRIBED_CURRENT_LIMIT,
    DESCRIBED_POSITION_GAIN,
    DESCRIBED_VELOCITY_GAIN,
    DESCRIBED_INTEGRAL_GAIN,
    DESCRIBED_COMMAND_TIMEOUT,      /* 0 = none */
    DESCRIBED_POSITION_SPEED_LIMIT, /* limit of the speed that a position law commands */
    DESCRIBED_SETTINGS_END,
    /* Command: redefines the zero so that the present position gets this value */
    DESCRIBED_PRESENT_POSITION = DESCRIBED_SETTINGS_END,
    /* Targets */
    DESCRIBED_SET_POINT, /* in the unit of the state's law, scaled by its set_point_scale */
    DESCRIBED_TO_VOLTAGE,
    DESCRIBED_TO_DUTY,
    DESCRIBED_TO_CURRENT,
    DESCRIBED_TO_TORQUE,
    DESCRIBED_TO_VELOCITY,
    DESCRIBED_TO_POSITION,
    DESCRIBED_TO_KP,
    DESCRIBED_TO_KD,
    DESCRIBED_TO_VELOCITY_CAP, /* this and the next: limits until the state or law changes */
    DESCRIBED_TO_CURRENT_CAP,
    DESCRIBED_TARGETS_END,
    DESCRIBED_NEW_ADDRESS = DESCRIBED_TARGETS_END, /* gives the board another address */
    /* Sources of an axis */
    DESCRIBED_MOTOR_POSITION,
    DESCRIBED_LINK_POSITION,
    DESCRIBED_DEFLECTION, /* counts of motor position minus counts of link position */
    DESCRIBED_MOTOR_VELOCITY,
    DESCRIBED_AXIS_CURRENT,
    DESCRIBED_AXIS_TORQUE,    /* measured torque of the spring */
    DESCRIBED_DRIVE_TORQUE,   /* torque of the motor: current times torque constant */
    DESCRIBED_CURRENT_TARGET, /* target of the current loop */
    DESCRIBED_TORQUE_TARGET,  /* target of the current loop times the torque constant */
    DESCRIBED_ELECTRICAL_POWER,
    DESCRIBED_MECHANICAL_POWER,
    DESCRIBED_SUPPLY_CURRENT,
    DESCRIBED_AXIS_VOLTAGE,
    DESCRIBED_AXIS_DUTY,
    DESCRIBED_PISTON_PRESSURE, /* this and the next two: only of a hydraulic axis */
    DESCRIBED_ROD_PRESSURE,
    DESCRIBED_VALVE_OPENING, /* -1 to 1 */
    DESCRIBED_COMMANDS,      /* number of set points received */
    DESCRIBED_SLOT,
    DESCRIBED_RESULT,         /* second number of a state (struct described_state) */
    DESCRIBED_LATCHED_FAULTS, /* faults that opened the bridge */
    DESCRIBED_FAULT_BIT,      /* 1 = the fault `constant` is reported */
    /* Sources of a board */
    DESCRIBED_FAULTS,
    DESCRIBED_FAULTY, /* 1 = a fault that opens the bridge is present or latched */
    DESCRIBED_SUPPLY,
    DESCRIBED_TEMPERATURE, /* winding; on a sensor board: air */
    DESCRIBED_AMBIENT,     /* temperature of the air */
    DESCRIBED_SEQUENCE,    /* number of telemetry periods */
    DESCRIBED_UPTIME,
    DESCRIBED_FIRST_SLOT,
    DESCRIBED_AXES_COUNT,
    DESCRIBED_SERIAL, /* 32 bits, from the board's name */
    DESCRIBED_ECHO,   /* copies the field with the same name from the answered frame */
    /* Sources of a sensor board; its channels begin with DESCRIBED_CHANNEL */
    DESCRIBED_SATURATED,
    DESCRIBED_CHANNEL,
    DESCRIBED_FT_CHANNEL = DESCRIBED_CHANNEL, /* force x y z, moment x y z */
    DESCRIBED_ACCELERATION = DESCRIBED_FT_CHANNEL + 6,
    DESCRIBED_RATE = DESCRIBED_ACCELERATION + 3,
    DESCRIBED_QUATERNION = DESCRIBED_RATE + 3,
    DESCRIBED_MAGNETIC = DESCRIBED_QUATERNION + 4,
    DESCRIBED_EULER = DESCRIBED_MAGNETIC + 3,
    DESCRIBED_MEANINGS = DESCRIBED_EULER + 3,
};

/* Faults that boards detect, in internal order. A protocol maps each fault to a bit or to none. */
enum described_fault {
    DESCRIBED_UNDER_VOLTAGE,
    DESCRIBED_OVER_VOLTAGE,
    DESCRIBED_OVER_CURRENT,
    DESCRIBED_MOTOR_ENCODER,
    DESCRIBED_LINK_ENCODER,
    DESCRIBED_TORQUE_SENSOR,
    DESCRIBED_OVER_TEMPERATURE,
    DESCRIBED_UNDER_PRESSURE, /* this and the next: supply pressure of a servo valve */
    DESCRIBED_OVER_PRESSURE,
    DESCRIBED_STALE,    /* command time-out */
    DESCRIBED_LIMIT,    /* beyond a position limit */
    DESCRIBED_OVERFLOW, /* frames were lost */
    DESCRIBED_CHANNEL_SATURATED,
    DESCRIBED_INERTIAL_SENSOR,
    DESCRIBED_STOPPED, /* emergency stop by the host, until faults are cleared */
    DESCRIBED_FAULT_KINDS,
    /* Mask of the faults that open the bridge */
    DESCRIBED_FATAL = ((1 << DESCRIBED_STALE) - 1) | 1 << DESCRIBED_STOPPED,
};

/* Names by enum described_fault ("under-voltage", ...); NULL at the end */
extern const char *const described_fault_names[32];

/* Checksum over all data bytes except its own, in order. */
enum described_checksum {
    DESCRIBED_NO_CHECKSUM,
    DESCRIBED_XOR,            /* exclusive or */
    DESCRIBED_CRC8_SAE_J1850, /* polynomial 0x1d, initial value 0xff, inverted at the end */
};

struct described_field {
    enum described_meaning meaning;
    /* Place in the data: the field lies in the eight bytes from `byte` on. shift: number of bits
     * below the field, in these bytes or, with in_id, in the identifier */
    uint8_t byte, shift, end;     /* end: index of the last byte + 1 */
    bool in_id, big_endian, real; /* real: a float */
    uint64_t mask, sign;          /* mask of the count; sign: its sign bit, 0 = unsigned */
    unsigned axis;                /* axis of the board, in a frame that reports several axes */
    int64_t low, high;            /* range of the count */
    /* DESCRIBED_CONSTANT, DESCRIBED_STORED: its count; DESCRIBED_ECHO: index in `echo` of the
     * request; DESCRIBED_FAULT_BIT: enum described_fault */
    int64_t constant;
    double scale, offset;
    /* value that our host sends by default; DESCRIBED_ECHO: count if the request lacks the field */
    double host;
    int16_t times; /* parameter by which the value is multiplied; -1 = none */
    bool wraps;    /* a count beyond the range wraps around */
};

struct described_frame {
    const char *name;
    bool from_host, remote;
    bool or_empty; /* remote: accepts also a frame without data */
    uint8_t flags; /* FRAME_EXTENDED, FRAME_FD, FRAME_BRS, FRAME_REMOTE (canbus/frame.h) */
    unsigned of;   /* enum described_kind */
    enum described_by by;
    uint32_t base, step;
    uint32_t mask;  /* identifier bits of fields, except constants */
    uint8_t most;   /* largest number in the identifier */
    uint8_t length; /* length without repetitions */
    /* lengths that a board accepts; missing fields are 0, extra bytes ignored */
    uint8_t shortest, longest;
    uint8_t repeats;
    uint8_t index;              /* in the protocol */
    bool either;                /* boards accept classic CAN and CAN FD */
    bool answer_id;             /* a host may change the identifier (DESCRIBED_ANSWER_ID) */
    size_t nfield, ndata;       /* all fields, fields in the data */
    const struct field *layout; /* fields of the data, with padding; ends with FIELD_END */
    /* fields of the 32-bit identifier, from bit 0 up; NULL = none */
    const struct field *id_layout;
    /* layouts of data and identifier by model; NULL = the same for all models */
    const struct field **model_layout, **model_id_layout;
    struct described_field *field;    /* fields of layout, then of id_layout, without padding */
    int8_t first[DESCRIBED_MEANINGS]; /* first field of each meaning; -1 = none */
    /* fields that a host reads, in order: torques and rates before the angles computed from them */
    uint8_t read[DESCRIBED_FIELDS_MAX];
    uint8_t nread;
    int counter;       /* index of the counter field; -1 = none */
    uint8_t nconstant; /* number of constant fields */
    bool switches;     /* can change the state, the law or the faults */
    bool configures;   /* can set settings, parameters or the position */
    bool checked;      /* has states, laws, parameters or a period, whose values a board checks */
    enum described_checksum checksum;
    uint8_t checksum_byte; /* index in the data */

    /* From boards */
    int64_t period_ns;  /* 0 = no period of its own */
    unsigned spread_ms; /* delay is spread_ms times the number in the identifier */
    bool telemetry;     /* sent every telemetry period of the rig or the host */
    bool on_change;     /* also sent when state or faults change */
    bool on_fault;      /* sent when there are other faults */
    bool on_restart;
    bool optional; /* periodic only on boards with transmit_at_start */

    /* From the host */
    int reply[3];                  /* answering frame by kind of board; -1 = none */
    struct board_reply_time time;  /* time of the answer */
    int8_t echo[DESCRIBED_ECHOES]; /* fields that echoes in the answer copy; -1 = none */
    int enter;                     /* state to enter; -1 = none */
    int select;                    /* law to select; -1 = none */
    int only;                      /* law in which the frame is obeyed; -1 = any */
    bool save;                     /* keeps the parameters over a restart */
    bool zero;                     /* sets the present position to 0 */
    bool stop;                     /* emergency stop */
    bool clear;                    /* clears faults */
    bool restart;                  /* restarts the board */
    bool commands;                 /* carries a set point, which resets the time-out */
    bool selects;                  /* has a field that selects boards or axes */
    bool of_one; /* all fields are for one axis: by slot, or selected by a field */
};

struct described_state {
    struct yaml_mark mark; /* place in the file */
    const char *name;
    int64_t value, result; /* result: second number of the state, for DESCRIBED_RESULT */
    enum described_law law;
    const char *fault; /* law fault: the fault that leads here; NULL = faults without a state */
    double set_point_scale;
    /* after this time the axis enters the first state with law off; 0 = never */
    int64_t lasts_ns;
};

/* A parameter that a host reads by its number, and may write. */
struct described_parameter {
    const char *name;
    uint32_t number;
    bool numbered; /* false: only a factor of fields */
    bool writable;
    bool positive; /* a factor of fields: zero, negative and infinite values are refused */
    struct described_field field;
};

/* Values of parameters in a new drive of one type. */
struct described_model {
    const char *name;
    const int64_t *count; /* by parameter */
    const bool *given;    /* by parameter: count is a value to write at power-up */
};

/* Gains of the inner loops. */
struct described_gains {
    double position_per_s, velocity_nm_s_rad, velocity_nm_rad;
};

struct described_list {
    size_t count;
    uint8_t frame[DESCRIBED_LIST_MAX];
};

/* Frames that a kind of board sends without request, in the order of the file. */
struct described_schedule {
    size_t count;
    uint8_t frame[DESCRIBED_FRAMES_MAX];
};

struct described_protocol {
    const char *name, *description;
    unsigned axes; /* most axes of a motor board */
    unsigned address_max;
    size_t nframe, nstate, nlaw;
    struct described_frame frame[DESCRIBED_FRAMES_MAX];
    /* law: laws that the host can select; the first is the default */
    const struct described_state *state, *law;
    int off_state, fault_state;           /* states after power-up and after a fault */
    int fault_bit[DESCRIBED_FAULT_KINDS]; /* -1 = not reported */
    int fault_for[DESCRIBED_FAULT_KINDS]; /* state of its own; -1 = none */
    uint32_t sticky, momentary;           /* bit masks of faults */
    bool saves;                           /* some frame keeps the parameters */
    int64_t command_timeout_ns;           /* 0 = the rig's time-out; -1 = none */
    int timeout_state;                    /* -1 = keep the state and reset the set points */
    /* state with law refused, for unknown state values; -1 = the frame is malformed */
    int unknown_state;
    /* faults are cleared only by frames, not by a state with law off */
    bool clears;
    bool period_settable;           /* the host sets the telemetry period; none before */
    bool tells[DESCRIBED_MEANINGS]; /* some frame of the boards reports this meaning */
    struct described_gains gains;
    size_t nparameter;
    struct described_parameter parameter[DESCRIBED_PARAMETERS_MAX];
    size_t nmodel; /* at least 1 */
    struct described_model model[DESCRIBED_MODELS_MAX];

    /* Bit masks of frames: one for each 11-bit identifier, all with 29-bit identifiers, all from
     * the host */
    uint64_t rows[DESCRIBED_STANDARD_ID_MAX + 1], extended_rows, host_rows;
    struct described_schedule telemetry[3], other[3]; /* by kind of board */

    struct {
        struct described_list discover, configure, on, off, command;
        int on_state, off_state;
        enum described_law law; /* law of on_state after the host has selected a law */
    } host;
};

/* Returns the law of a state. law: index of the law that the host has selected. */
static inline enum described_law described_state_law(const struct described_protocol *protocol,
                                                     int state, int law)
{
    enum described_law of = protocol->state[state].law;

    return of == DESCRIBED_SELECTED ? protocol->law[law].law : of;
}

/* Returns the state of an axis with these faults: the state of the first fault, or the common
 * state. */
static inline int described_fault_state(const struct described_protocol *protocol, uint32_t faults)
{
    int fault = faults ? __builtin_ctz(faults) : 0;

    return faults && protocol->fault_for[fault] >= 0 ? protocol->fault_for[fault]
                                                     : protocol->fault_state;
}

/* Returns the meaning of a set point under a law; DESCRIBED_NOTHING = the law has none. */
static inline enum described_meaning described_law_target(enum described_law law)
{
    return law == DESCRIBED_IMPEDANCE ? DESCRIBED_TO_POSITION
           : law == DESCRIBED_VOLTAGE ? DESCRIBED_TO_VOLTAGE
           : law > DESCRIBED_OFF && law < DESCRIBED_IMPEDANCE
               ? (enum described_meaning)(DESCRIBED_TO_CURRENT + (law - DESCRIBED_CURRENT))
               : DESCRIBED_NOTHING;
}

/* Reads a protocol file. fd: the bus has CAN FD, for files whose frames follow the bus. Errors
 * begin with file:line:column. Not RT-safe. */
enum error_code described_load(const char *path, bool fd, struct arena *arena,
                               const struct described_protocol **protocol, struct error *error);

/* Reads a protocol file from memory; `name` appears in errors. Not RT-safe. */
enum error_code described_read_text(const char *name, const char *text, size_t size, bool fd,
                                    struct arena *arena, const struct described_protocol **protocol,
                                    struct error *error);

/* Return the word of a protocol file for a law, and for the meaning of a field. from_host:
 * direction of the field's frame. "constant", "counter" or "checksum" for these meanings; "" = no
 * word. */
const char *described_law_word(enum described_law law);
const char *described_meaning_name(enum described_meaning meaning, bool from_host);

/* Returns the unit of a meaning; "" = dimensionless, NULL = a count without scale. */
const char *described_unit(enum described_meaning meaning);

/* Convert fault bits of the protocol to bits of enum described_fault, and the reverse. */
uint32_t described_known_faults(const struct described_protocol *protocol, int64_t bits);
int64_t described_fault_bits(const struct described_protocol *protocol, uint32_t faults);

/* Returns the count of a value, clamped to the range of the field. A NaN gives 0. Infinity gives
 * the end of the range. For a float field, returns the bits of the float. */
int64_t described_count(const struct described_field *field, double value);

/* Returns the value of a float from its bits; 0 if the float is not finite. */
double described_real(uint32_t bits);

static inline double described_value(const struct described_field *field, int64_t count)
{
    double scaled = field->real ? described_real((uint32_t)count) : (double)count;

    return scaled * field->scale + field->offset;
}

/* Returns a field whose scale and offset are those of a factor. */
static inline struct described_field described_scaled(const struct described_field *field,
                                                      double factor)
{
    struct described_field scaled = *field;

    scaled.scale *= factor;
    scaled.offset *= factor;
    return scaled;
}

/* Returns a field as a new drive of a model has it. */
static inline struct described_field
described_model_field(const struct described_protocol *protocol, unsigned model,
                      const struct described_field *field)
{
    return field->times < 0
               ? *field
               : described_scaled(field,
                                  described_value(&protocol->parameter[field->times].field,
                                                  protocol->model[model].count[field->times]));
}

/* Returns a count wrapped around to the bits of a field, without saturation. */
static inline int64_t described_wrap(const struct described_field *field, uint32_t count)
{
    return (int64_t)(count & field->mask);
}

/* Returns name, type and unit of a field. field: index without padding. */
const struct field *described_layout(const struct described_frame *frame, size_t field);

/* Returns the index of a field with a meaning; -1 = none. */
static inline int described_find_field(const struct described_frame *frame,
                                       enum described_meaning meaning)
{
    return frame->first[meaning];
}

/* Returns the length of a frame with `parts` repetitions. */
static inline uint8_t described_length(const struct described_frame *frame, unsigned parts)
{
    unsigned bytes = frame->length * parts;

    return frame->flags & FRAME_FD ? frame_fd_length(bytes) : (uint8_t)bytes;
}

/* Returns the identifier of a frame for a number. Bits of identifier fields are 0. */
static inline uint32_t described_id(const struct described_frame *frame, unsigned number)
{
    return frame->base + frame->step * number;
}

/* Returns a bit mask of the frames, from the host or from boards, that may have an identifier.
 * Check each of them with described_number. */
static inline uint64_t described_rows(const struct described_protocol *protocol,
                                      const struct bus_frame *frame, bool from_host)
{
    uint64_t rows = frame->flags & FRAME_EXTENDED
                        ? protocol->extended_rows
                        : protocol->rows[frame->id & DESCRIBED_STANDARD_ID_MAX];

    return rows & (from_host ? protocol->host_rows : ~protocol->host_rows);
}

/* Returns whether an identifier belongs to a frame, and stores its number. extended: the identifier
 * has 29 bits. */
static inline bool described_number(const struct described_frame *frame, uint32_t id, bool extended,
                                    unsigned *number)
{
    uint32_t fixed = id & ~frame->mask, above = fixed - frame->base;

    *number = 0;
    if (extended != !!(frame->flags & FRAME_EXTENDED)) {
        return false;
    }
    if (fixed < frame->base || frame->by == DESCRIBED_BY_NONE) {
        return fixed == frame->base;
    }
    *number = above / frame->step;
    return above % frame->step == 0 && *number <= frame->most &&
           (frame->by != DESCRIBED_BY_ADDRESS || *number > 0);
}

/* ---- fields ---- */

/* Bytes that are read and written at once; they contain the whole field. Bytes beyond the data are
 * other members of struct bus_frame and keep their values. */
enum { DESCRIBED_WINDOW = 8 };
_Static_assert(sizeof(struct bus_frame) >=
                   offsetof(struct bus_frame, data) + DESCRIBED_LENGTH_MAX + DESCRIBED_WINDOW,
               "room for the window of the last byte");

/* Loads the window that starts at a byte, in the byte order of a field. */
static inline uint64_t described_load_window(const struct described_field *field,
                                             const uint8_t *byte)
{
    uint64_t bits;

    memcpy(&bits, byte, sizeof bits);
    return field->big_endian ? be64toh(bits) : le64toh(bits);
}

/* Returns the count in the lowest bits of a number. */
static inline int64_t described_signed(const struct described_field *field, uint64_t bits)
{
    return (int64_t)(((bits & field->mask) ^ field->sign) - field->sign);
}

/* Returns the count of a field. after: first byte of the repetition that contains the field. 0 if
 * the field is beyond the end of the frame. */
static inline int64_t described_get(const struct described_field *field,
                                    const struct bus_frame *sent, unsigned after)
{
    uint64_t bits = sent->id;

    if (!field->in_id) {
        if (after + field->end > sent->len) {
            return 0;
        }
        bits = described_load_window(field, sent->data + field->byte + after);
    }
    return described_signed(field, bits >> field->shift);
}

/* Writes a count, clamped to the range of the field, into data or identifier. The field must be 0
 * before. after: first byte of the repetition. */
static inline void described_put(const struct described_field *field, int64_t count, unsigned after,
                                 struct bus_frame *out)
{
    uint64_t bits = (uint64_t)(count < field->low    ? field->low
                               : count > field->high ? field->high
                                                     : count) &
                    field->mask;
    uint8_t *byte = out->data + field->byte + after;

    bits <<= field->shift;
    if (field->in_id) {
        out->id |= (uint32_t)bits;
        return;
    }
    bits |= described_load_window(field, byte);
    bits = field->big_endian ? htobe64(bits) : htole64(bits);
    memcpy(byte, &bits, sizeof bits);
}

/* Returns the checksum of `length` bytes, without the byte at index `skip`. */
uint8_t described_checksum(enum described_checksum checksum, const uint8_t *data, size_t length,
                           size_t skip);

/* Writes the checksum of a frame, if it has one. */
static inline void described_close(const struct described_frame *frame, uint8_t *data)
{
    if (frame->checksum) {
        data[frame->checksum_byte] =
            described_checksum(frame->checksum, data, frame->length, frame->checksum_byte);
    }
}

/* Writes identifier, all fields of repetition `part`, and checksum into a frame that was zeroed. */
void described_encode(const struct described_frame *frame, unsigned number, unsigned part,
                      const int64_t *counts, struct bus_frame *out);

/* Reads the counts of all fields of repetition `part`; fields beyond the frame's end are 0. */
void described_decode(const struct described_frame *frame, const struct bus_frame *sent,
                      unsigned part, int64_t *counts);

/* Returns the name of a checksum for DBC files and the printed protocol; "" = none. */
const char *described_checksum_name(enum described_checksum checksum);

/* Returns whether a receiver can distinguish frames of two rows with the same identifier. Row a
 * comes first in the file. Rows of opposite directions can differ only by the remote flag. Rows of
 * one direction can differ by remote flag, length, parameters, or constants of a that b does not
 * match. */
bool described_told_apart(const struct described_frame *a, const struct described_frame *b);

/* Why a board does not obey a frame (struct board_event). */
enum described_wrong {
    DESCRIBED_WRONG_LENGTH = 1,
    DESCRIBED_WRONG_FORMAT, /* classic CAN instead of CAN FD, or the reverse */
    DESCRIBED_WRONG_CHECKSUM,
    DESCRIBED_WRONG_COUNTER,
    DESCRIBED_WRONG_VALUE, /* `expected` is the index of the field */
    DESCRIBED_WRONG_LAW,   /* a servo valve does not support the law */
    DESCRIBED_WRONG_MODE,  /* another law is selected; found and expected are laws */
};

/* Result of comparing a frame with a row. */
enum described_match {
    DESCRIBED_BAD_LENGTH, /* wrong length; or classic CAN instead of CAN FD, or the reverse */
    DESCRIBED_BAD_CONSTANT,
    DESCRIBED_BAD_CHECKSUM,
    DESCRIBED_IS
};

/* Returns whether the constant fields of repetition `part` have their values. */
bool described_has_constants(const struct described_frame *frame, const struct bus_frame *sent,
                             unsigned part);

/* Compares a frame with a row, except the identifier outside its fields. */
enum described_match described_match_frame(const struct described_frame *frame,
                                           const struct bus_frame *sent);

/* Returns the index of the state with a value; -1 = none. commanded: finds only states that a host
 * may command. */
int described_find_state(const struct described_state *state, size_t count, int64_t value,
                         bool commanded);

/* Returns the parameter with a number; NULL = none. */
const struct described_parameter *
described_find_parameter(const struct described_protocol *protocol, int64_t number);

/* Returns whether a meaning is a setting of an axis. */
static inline bool described_is_setting(enum described_meaning meaning)
{
    return meaning >= DESCRIBED_SETTING && meaning < DESCRIBED_SETTINGS_END;
}

#endif
