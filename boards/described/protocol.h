/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A protocol that a file describes (docs/own-boards.md): its frames with their fields, the states
 * of an axis and the frames that our host has to send. The table is read once (described_load) and
 * immutable from then on; boards, host, DBC and `coman-hil protocol` all work from it. Classic CAN
 * and CAN FD, identifiers of 11 and of 29 bits, fields in the data and in the identifier.
 *
 * Units: SI, angles at the link side of the gear. A field carries value = count * scale + offset in
 * the unit of its meaning. Memory is the arena's of described_load. RT-safe but for described_load
 * and described_read_text.
 */
#ifndef BOARDS_DESCRIBED_PROTOCOL_H
#define BOARDS_DESCRIBED_PROTOCOL_H

#include "base/arena.h"
#include "base/error.h"
#include "base/yaml.h"
#include "boards/field.h"
#include "canbus/frame.h"

#include <endian.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum {
    DESCRIBED_FRAMES_MAX = 64,
    DESCRIBED_PARAMETERS_MAX = 48,
    DESCRIBED_STATES_MAX = 16,
    DESCRIBED_LAWS_MAX = 8,
    DESCRIBED_LIST_MAX = 8, /* frames of one step of the host */
    DESCRIBED_ADDRESS_MAX = 31,
    DESCRIBED_SLOTS = 32,      /* axes of a bus */
    DESCRIBED_AXES = 4,        /* of a motor board at most */
    DESCRIBED_FIELDS_MAX = 64, /* of a frame, in its data and its identifier together */
    DESCRIBED_CLASSIC_MAX = 8, /* bytes of a frame */
    DESCRIBED_LENGTH_MAX = 64, /* of a CAN FD frame */
    DESCRIBED_STANDARD_ID_MAX = 0x7ff,
    DESCRIBED_EXTENDED_ID_MAX = 0x1fffffff,
    DESCRIBED_PERIOD_MAX_MS = 255, /* of telemetry that a host may ask for */
};

/* Meaning of the number in an identifier: id = base + step * number. */
enum described_by {
    DESCRIBED_BY_NONE,
    DESCRIBED_BY_ADDRESS,
    DESCRIBED_BY_SLOT,  /* the axes of a bus, numbered through in the order of the rig */
    DESCRIBED_BY_GROUP, /* of as many slots as the frame repeats its fields */
};

/* The boards that send a frame, or listen to it; bits. */
enum described_kind {
    DESCRIBED_MOTOR = 1 << 0,
    DESCRIBED_FT = 1 << 1,
    DESCRIBED_INERTIAL = 1 << 2,
    DESCRIBED_ANY = DESCRIBED_MOTOR | DESCRIBED_FT | DESCRIBED_INERTIAL,
};

/* Law of an axis in a state. */
enum described_law {
    DESCRIBED_OFF, /* bridge open; the way out of a fault */
    DESCRIBED_VOLTAGE,
    DESCRIBED_CURRENT,
    DESCRIBED_TORQUE,
    DESCRIBED_VELOCITY,
    DESCRIBED_POSITION,
    DESCRIBED_IMPEDANCE, /* torque = kp (p* - p) + kd (v* - v) + torque* */
    DESCRIBED_FAULT,     /* bridge open until OFF is commanded */
    DESCRIBED_SELECTED,  /* of a state: the law that the host has selected */
};

/* Returns whether an axis with a servo valve has that law: not those that control a current. */
static inline bool described_law_suits_valve(enum described_law law)
{
    return law != DESCRIBED_CURRENT && law != DESCRIBED_TORQUE && law != DESCRIBED_IMPEDANCE;
}

/* Meaning of a field. Targets come from a host, sources from a board. */
enum described_meaning {
    DESCRIBED_NOTHING,
    DESCRIBED_CONSTANT, /* part of what makes the frame this one */
    /* selection of axes */
    DESCRIBED_SLOTS_MASK,
    DESCRIBED_ADDRESS,
    DESCRIBED_AXIS,
    /* both ways */
    DESCRIBED_STATE,
    DESCRIBED_LAW,
    DESCRIBED_TELEMETRY_PERIOD, /* s */
    DESCRIBED_COUNTER,          /* one more with each frame of its kind, number and axis */
    DESCRIBED_CHECKSUM,         /* of the other bytes: struct described_frame */
    DESCRIBED_PARAMETER,        /* the number of a parameter */
    DESCRIBED_PARAMETER_VALUE,  /* its bits: struct described_parameter */
    /* both ways: settings of an axis, kept until its board restarts */
    DESCRIBED_SETTING,
    DESCRIBED_VELOCITY_LIMIT = DESCRIBED_SETTING,
    DESCRIBED_CURRENT_LIMIT,
    DESCRIBED_POSITION_GAIN,
    DESCRIBED_VELOCITY_GAIN,
    DESCRIBED_INTEGRAL_GAIN,
    DESCRIBED_SETTINGS_END,
    /* an order: what the position is to read here */
    DESCRIBED_PRESENT_POSITION = DESCRIBED_SETTINGS_END,
    /* targets */
    DESCRIBED_SET_POINT, /* in the unit of the state's law, by the state's set_point_scale */
    DESCRIBED_TO_VOLTAGE,
    DESCRIBED_TO_DUTY,
    DESCRIBED_TO_CURRENT,
    DESCRIBED_TO_TORQUE,
    DESCRIBED_TO_VELOCITY,
    DESCRIBED_TO_POSITION,
    DESCRIBED_TO_KP,
    DESCRIBED_TO_KD,
    /* sources: of an axis */
    DESCRIBED_MOTOR_POSITION,
    DESCRIBED_LINK_POSITION,
    DESCRIBED_DEFLECTION, /* counts of motor position less counts of link position */
    DESCRIBED_MOTOR_VELOCITY,
    DESCRIBED_AXIS_CURRENT,
    DESCRIBED_AXIS_TORQUE,    /* of the spring, measured */
    DESCRIBED_DRIVE_TORQUE,   /* of the motor: current times torque constant */
    DESCRIBED_CURRENT_TARGET, /* of the current loop */
    DESCRIBED_TORQUE_TARGET,  /* that current times torque constant */
    DESCRIBED_ELECTRICAL_POWER,
    DESCRIBED_MECHANICAL_POWER,
    DESCRIBED_SUPPLY_CURRENT,
    DESCRIBED_AXIS_VOLTAGE,
    DESCRIBED_AXIS_DUTY,
    DESCRIBED_PISTON_PRESSURE, /* of a hydraulic axis, as the two below */
    DESCRIBED_ROD_PRESSURE,
    DESCRIBED_VALVE_OPENING, /* -1 to 1 */
    DESCRIBED_COMMANDS,      /* set-points taken */
    DESCRIBED_SLOT,
    DESCRIBED_RESULT,         /* of the state: struct described_state */
    DESCRIBED_LATCHED_FAULTS, /* those that have opened the bridge */
    /* of a board */
    DESCRIBED_FAULTS,
    DESCRIBED_FAULTY, /* 1: a fault has opened the bridge or would */
    DESCRIBED_SUPPLY,
    DESCRIBED_TEMPERATURE,
    DESCRIBED_SEQUENCE, /* telemetry periods so far */
    DESCRIBED_UPTIME,
    DESCRIBED_FIRST_SLOT,
    DESCRIBED_AXES_COUNT,
    DESCRIBED_SERIAL, /* 32 bits, of the board's name */
    DESCRIBED_ECHO,   /* of the answered frame's field of that name */
    /* of a sensor: channels from here on */
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

/* Faults that boards notice, in the order of their own bits; a protocol gives each a bit or none.
 */
enum described_fault {
    DESCRIBED_UNDER_VOLTAGE,
    DESCRIBED_OVER_VOLTAGE,
    DESCRIBED_OVER_CURRENT,
    DESCRIBED_MOTOR_ENCODER,
    DESCRIBED_LINK_ENCODER,
    DESCRIBED_TORQUE_SENSOR,
    DESCRIBED_OVER_TEMPERATURE,
    DESCRIBED_UNDER_PRESSURE, /* of the oil that feeds an axis's valve, as the next */
    DESCRIBED_OVER_PRESSURE,
    DESCRIBED_STALE,    /* no command for the time-out */
    DESCRIBED_LIMIT,    /* beyond a position limit */
    DESCRIBED_OVERFLOW, /* frames were lost */
    DESCRIBED_CHANNEL_SATURATED,
    DESCRIBED_INERTIAL_SENSOR,
    DESCRIBED_STOPPED, /* an emergency stop of the host, until faults are cleared */
    DESCRIBED_FAULT_KINDS,
    /* These open the bridge */
    DESCRIBED_FATAL = ((1 << DESCRIBED_STALE) - 1) | 1 << DESCRIBED_STOPPED,
};

/* "under-voltage", ... by enum described_fault; NULL from there on */
extern const char *const described_fault_names[32];

/* How the byte of a checksum comes of the other bytes of the data, in their order. */
enum described_checksum {
    DESCRIBED_NO_CHECKSUM,
    DESCRIBED_XOR,            /* exclusive or */
    DESCRIBED_CRC8_SAE_J1850, /* polynomial 0x1d, begins with 0xff, inverted at the end */
};

struct described_field {
    enum described_meaning meaning;
    /* Place in the data: the first of the eight bytes that it is within, and how many of their bits
     * are below it; in_id: how many bits of the identifier are below it */
    uint8_t byte, shift, end;     /* end: the bytes up to its last one */
    bool in_id, big_endian, real; /* real: the bits of a float */
    uint64_t mask, sign;          /* of its count; sign: the bit that has it, or 0 */
    uint8_t axis;                 /* of the board, where a frame tells of several */
    int64_t low, high;            /* counts that it holds */
    int64_t constant; /* count of DESCRIBED_CONSTANT; field of the request of DESCRIBED_ECHO */
    double scale, offset;
    double host; /* what our host sends where it has nothing better */
};

struct described_frame {
    const char *name;
    bool from_host, remote;
    bool or_empty; /* of a remote frame: one without data does too */
    uint8_t flags; /* FRAME_EXTENDED, FRAME_FD, FRAME_BRS, FRAME_REMOTE (canbus/frame.h) */
    unsigned of;   /* enum described_kind */
    enum described_by by;
    uint32_t base, step;
    uint32_t mask;  /* bits of the identifier that its fields fill, constant ones aside */
    uint8_t most;   /* number */
    uint8_t length; /* without repetition */
    uint8_t shortest, longest; /* that a board takes; missing fields are 0, further bytes ignored */
    uint8_t repeats;
    size_t nfield, ndata;          /* in all, of the data */
    const struct field *layout;    /* of the data; with gaps as padding, ends with FIELD_END */
    const struct field *id_layout; /* of the identifier, from bit 0 on, 32 bits; NULL: no fields */
    struct described_field *field; /* those of layout, then of id_layout, without padding */
    int8_t first[DESCRIBED_MEANINGS];   /* the first field of each meaning; -1: none */
    uint8_t read[DESCRIBED_FIELDS_MAX]; /* fields that a host reads, in the order in which it does:
                                         * torques and rates before the angles made of them */
    uint8_t nread;
    int counter;       /* index of the field that counts frames; -1: none */
    uint8_t nconstant; /* fields that are constant */
    bool switches;     /* changes states, laws or faults */
    bool configures;   /* sets settings, parameters or the position */
    bool checked;      /* names states, laws, parameters or a period */
    enum described_checksum checksum;
    uint8_t checksum_byte; /* where it is in the data */

    /* From boards */
    int64_t period_ns;  /* 0: as below */
    unsigned spread_ms; /* of the period's grid: that many times the number later */
    bool telemetry;     /* every telemetry period, of the rig or the host */
    bool on_change;     /* also when the state or the faults change */
    bool on_restart;

    /* From the host */
    int reply[3];  /* by kind of board: the frame that answers; -1: none */
    int enter;     /* state; -1: none */
    bool zero;     /* the present position becomes 0 */
    bool stop;     /* an emergency stop */
    bool clear;    /* clears faults */
    bool restart;  /* the board restarts */
    bool commands; /* carries a set-point, which the time-out waits for */
    bool of_one;   /* by slot, or by a field that selects: all fields are about one axis */
};

struct described_state {
    struct yaml_mark mark; /* in the file */
    const char *name;
    int64_t value, result; /* result: a second number of it, which a field may tell */
    enum described_law law;
    double set_point_scale;
};

/* Parameter that a host reads, or writes where it is a setting, by a number. */
struct described_parameter {
    uint32_t number;
    struct described_field field;
};

/* Gains of the inner laws. */
struct described_gains {
    double position_per_s, velocity_nm_s_rad, velocity_nm_rad;
};

struct described_list {
    size_t count;
    uint8_t frame[DESCRIBED_LIST_MAX];
};

/* Frames that boards of a kind send by themselves, in the order of the file. */
struct described_schedule {
    size_t count;
    uint8_t frame[DESCRIBED_FRAMES_MAX];
};

struct described_protocol {
    const char *name, *description;
    unsigned axes; /* of a motor board at most */
    unsigned address_max;
    size_t nframe, nstate, nlaw;
    struct described_frame frame[DESCRIBED_FRAMES_MAX];
    const struct described_state *state, *law; /* law: that a host may select; the first at first */
    int off_state, fault_state;                /* after power-up; after a fault */
    int fault_bit[DESCRIBED_FAULT_KINDS];      /* -1: not reported */
    int64_t command_timeout_ns;                /* 0: as the rig says; -1: none */
    int timeout_state;                         /* -1: set-points become 0, the state stays */
    bool clears;                               /* only frames clear faults, not the state off */
    bool period_settable;                      /* telemetry waits for a host that sets its period */
    bool tells[DESCRIBED_MEANINGS];            /* some frame of the boards has it */
    struct described_gains gains;
    size_t nparameter;
    struct described_parameter parameter[DESCRIBED_PARAMETERS_MAX];

    /* Frames, a bit each: of an identifier of 11 bits, of all with 29, and those from the host */
    uint64_t rows[DESCRIBED_STANDARD_ID_MAX + 1], extended_rows, host_rows;
    struct described_schedule telemetry[3], other[3]; /* by kind of board */

    struct {
        struct described_list discover, configure, on, off, command;
        int on_state, off_state;
        enum described_law law; /* of on_state, with the law that it selects */
    } host;
};

/* Returns the law of a state with that law selected. */
static inline enum described_law described_state_law(const struct described_protocol *protocol,
                                                     int state, int law)
{
    enum described_law of = protocol->state[state].law;

    return of == DESCRIBED_SELECTED ? protocol->law[law].law : of;
}

/* Reads a file; errors begin with file:line:column. Not RT-safe. */
enum error_code described_load(const char *path, struct arena *arena,
                               const struct described_protocol **protocol, struct error *error);

/* Reads a file's text from memory; name stands for the file. Not RT-safe. */
enum error_code described_read_text(const char *name, const char *text, size_t size,
                                    struct arena *arena, const struct described_protocol **protocol,
                                    struct error *error);

/* Returns the unit of a meaning; "" = a bare number. */
const char *described_unit(enum described_meaning meaning);

/* Convert bits that a host reads as faults to bits of enum described_fault, and back. */
uint32_t described_known_faults(const struct described_protocol *protocol, int64_t bits);
int64_t described_fault_bits(const struct described_protocol *protocol, uint32_t faults);

/* Returns the count of a field for a value, within the field; of a float its bits. A value that
 * is no number gives 0. */
int64_t described_count(const struct described_field *field, double value);

/* Returns the value of the bits of a float; 0 when they are no number. */
double described_real(uint32_t bits);

static inline double described_value(const struct described_field *field, int64_t count)
{
    double scaled = field->real ? described_real((uint32_t)count) : (double)count;

    return scaled * field->scale + field->offset;
}

/* Returns the bits of a count that a field holds: it wraps where others saturate. */
static inline int64_t described_wrap(const struct described_field *field, uint32_t count)
{
    return (int64_t)(count & field->mask);
}

/* Returns the name, type and unit of a field, padding not counted. */
const struct field *described_layout(const struct described_frame *frame, size_t field);

/* Returns the index of a field with a meaning; -1 = none. */
static inline int described_find_field(const struct described_frame *frame,
                                       enum described_meaning meaning)
{
    return frame->first[meaning];
}

/* Returns the length of a frame with so many repetitions. */
static inline uint8_t described_length(const struct described_frame *frame, unsigned parts)
{
    unsigned bytes = frame->length * parts;

    return frame->flags & FRAME_FD ? frame_fd_length(bytes) : (uint8_t)bytes;
}

/* Returns the identifier of a frame with a number; bits of fields in it are 0. */
static inline uint32_t described_id(const struct described_frame *frame, unsigned number)
{
    return frame->base + frame->step * number;
}

/* Returns the frames from the host, or from boards, that an identifier may be of, a bit each:
 * described_number tells which it is. */
static inline uint64_t described_rows(const struct described_protocol *protocol,
                                      const struct bus_frame *frame, bool from_host)
{
    uint64_t rows = frame->flags & FRAME_EXTENDED
                        ? protocol->extended_rows
                        : protocol->rows[frame->id & DESCRIBED_STANDARD_ID_MAX];

    return rows & (from_host ? protocol->host_rows : ~protocol->host_rows);
}

/* Returns whether an identifier, of 29 bits when extended, belongs to a frame, and its number. */
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

enum { DESCRIBED_WINDOW = 8 }; /* bytes that are read and written at once: a field is within them */

/* Returns the first byte of the window of a field that lies `after` bytes behind its place, and in
 * *shift the bits of the window behind it. */
static inline unsigned described_window(const struct described_field *field, unsigned after,
                                        unsigned *shift)
{
    unsigned most = DESCRIBED_LENGTH_MAX - DESCRIBED_WINDOW, first = field->byte + after;

    *shift = field->shift;
    if (first > most) {
        *shift += field->big_endian ? 8 * (most - first) : 8 * (first - most);
        first = most;
    }
    return first;
}

/* Returns the window at a byte, in the order of a field. */
static inline uint64_t described_load_window(const struct described_field *field,
                                             const uint8_t *byte)
{
    uint64_t bits;

    memcpy(&bits, byte, sizeof bits);
    return field->big_endian ? be64toh(bits) : le64toh(bits);
}

/* Returns the count of a field of a frame, `after` bytes behind its place; 0 beyond its end. */
static inline int64_t described_get(const struct described_field *field,
                                    const struct bus_frame *sent, unsigned after)
{
    uint64_t bits;
    unsigned shift;

    if (field->in_id) {
        bits = sent->id >> field->shift;
    } else if (after + field->end > sent->len) {
        return 0;
    } else {
        const uint8_t *byte = sent->data + described_window(field, after, &shift);

        bits = described_load_window(field, byte) >> shift;
    }
    return (int64_t)(((bits & field->mask) ^ field->sign) - field->sign);
}

/* Writes a count, held within the field, into data, which has DESCRIBED_LENGTH_MAX bytes and zeros
 * in its place, or into the identifier. */
static inline void described_put(const struct described_field *field, int64_t count, unsigned after,
                                 uint8_t *data, uint32_t *id)
{
    uint64_t bits = (uint64_t)(count < field->low    ? field->low
                               : count > field->high ? field->high
                                                     : count) &
                    field->mask;
    unsigned shift, first;

    if (field->in_id) {
        *id |= (uint32_t)bits << field->shift;
        return;
    }
    first = described_window(field, after, &shift);
    bits = described_load_window(field, data + first) | bits << shift;
    bits = field->big_endian ? htobe64(bits) : htole64(bits);
    memcpy(data + first, &bits, sizeof bits);
}

/* Closes the data of a frame with its checksum, if it has one. */
void described_close(const struct described_frame *frame, uint8_t *data);

/* Writes the counts of all fields into data, which holds DESCRIBED_LENGTH_MAX and is zero before,
 * as its repetition part, closes it with the checksum and returns the identifier. */
uint32_t described_encode(const struct described_frame *frame, unsigned number, unsigned part,
                          const int64_t *counts, uint8_t *data);

/* Reads the counts of all fields of the repetition part; fields beyond the frame's end are 0. */
void described_decode(const struct described_frame *frame, const struct bus_frame *sent,
                      unsigned part, int64_t *counts);

/* Returns a checksum of length bytes, the one at the index skip left out. */
uint8_t described_checksum(enum described_checksum checksum, const uint8_t *data, size_t length,
                           size_t skip);

/* Returns the name of a checksum in DBC and pages; "" = none. */
const char *described_checksum_name(enum described_checksum checksum);

/* Returns whether a receiver tells frames of two rows of one protocol with one identifier apart:
 * by direction and remote flag, by length, or because not all of b match the constants of a,
 * which comes first in the file. Two rows from opposite sides are told apart only by the remote
 * flag. */
bool described_told_apart(const struct described_frame *a, const struct described_frame *b);

/* Result of matching a frame on the bus with a row. */
enum described_match {
    DESCRIBED_BAD_LENGTH, /* or the wrong format of CAN */
    DESCRIBED_BAD_CONSTANT,
    DESCRIBED_BAD_CHECKSUM,
    DESCRIBED_IS
};

/* Returns whether the fields of the repetition part that are constant have their values. */
bool described_has_constants(const struct described_frame *frame, const struct bus_frame *sent,
                             unsigned part);

/* Compares all but the fixed part of the identifier. */
enum described_match described_match_frame(const struct described_frame *frame,
                                           const struct bus_frame *sent);

/* Returns the state with a value, one that a host may command when commanded; -1 = none. */
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
