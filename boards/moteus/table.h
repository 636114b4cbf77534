/* SPDX-License-Identifier: Apache-2.0 */
/* The registers of a moteus: quantity, access, and default value in a new command. Functions only
 * read a constant table; RT-safe. */
#ifndef BOARDS_MOTEUS_TABLE_H
#define BOARDS_MOTEUS_TABLE_H

#include "boards/field.h"
#include "boards/moteus/protocol.h"

/* Quantity of a register. It determines the scale of integer values. */
enum moteus_quantity {
    MOTEUS_Q_NUMBER,  /* dimensionless */
    MOTEUS_Q_PINS,    /* bits of the five pins of a port */
    MOTEUS_Q_WORD,    /* 32 bits, readable only as int32 */
    MOTEUS_Q_COUNTER, /* wraps around in each integer type */
    MOTEUS_Q_POSITION,
    MOTEUS_Q_VELOCITY,
    MOTEUS_Q_ACCELERATION,
    MOTEUS_Q_TORQUE,
    MOTEUS_Q_CURRENT,
    MOTEUS_Q_VOLTAGE,
    MOTEUS_Q_TEMPERATURE,
    MOTEUS_Q_POWER,
    MOTEUS_Q_SCALE,
    MOTEUS_Q_DUTY, /* 0 to 1, in the scale of MOTEUS_Q_SCALE */
    MOTEUS_Q_TIME,
};

enum moteus_access { MOTEUS_R, MOTEUS_RW, MOTEUS_W };

struct moteus_row {
    uint16_t number;
    uint16_t same_as; /* register that this register repeats; 0 = none */
    const char *name;
    enum moteus_quantity quantity;
    enum moteus_access access;
    bool commanded; /* a new command sets the register to `initial` */
    double initial;
};

extern const struct moteus_row moteus_rows[];
extern const size_t moteus_row_count;

/* Returns the row of a register; NULL = the register does not exist. */
const struct moteus_row *moteus_find_row(uint32_t number);

/* Returns the unit of a quantity; NULL = dimensionless. */
const char *moteus_unit(enum moteus_quantity quantity);

/* Returns the size of a value in bytes. */
unsigned moteus_bytes(enum moteus_type type);

/* Read and write a value in the scale of its quantity. The lowest integer of a type means NaN, so
 * integers saturate above it. moteus_put returns false if the quantity cannot have the type. */
double moteus_get(enum moteus_quantity quantity, enum moteus_type type, const uint8_t *data);
bool moteus_put(enum moteus_quantity quantity, enum moteus_type type, double value, uint8_t *data);

/* The registers in the frames of our host (tasks/) and in the replies to these frames. Other hosts
 * may use other registers. */
extern const struct field moteus_command_fields[], moteus_reply_fields[];
enum { MOTEUS_COMMAND_LENGTH = 24, MOTEUS_REPLY_LENGTH = 32 };

#endif
