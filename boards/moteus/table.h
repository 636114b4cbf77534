/* SPDX-License-Identifier: Apache-2.0 */
/* The registers of a moteus: quantity, access, and default in a new command. Pure functions of a
 * constant table; RT-safe. */
#ifndef BOARDS_MOTEUS_TABLE_H
#define BOARDS_MOTEUS_TABLE_H

#include "boards/field.h"
#include "boards/moteus/protocol.h"

#include <stdbool.h>

/* The quantity of a register, which sets the scale of its integers. */
enum moteus_quantity {
    MOTEUS_Q_NUMBER,  /* dimensionless */
    MOTEUS_Q_WORD,    /* 32 bits, only readable as int32 */
    MOTEUS_Q_COUNTER, /* wraps in each integer type */
    MOTEUS_Q_POSITION,
    MOTEUS_Q_VELOCITY,
    MOTEUS_Q_ACCELERATION,
    MOTEUS_Q_TORQUE,
    MOTEUS_Q_CURRENT,
    MOTEUS_Q_VOLTAGE,
    MOTEUS_Q_TEMPERATURE,
    MOTEUS_Q_POWER,
    MOTEUS_Q_SCALE,
    MOTEUS_Q_TIME,
};

enum moteus_access { MOTEUS_R, MOTEUS_RW, MOTEUS_W };

struct moteus_row {
    uint16_t number;
    uint16_t same_as; /* the register that it repeats; 0 = none */
    const char *name;
    enum moteus_quantity quantity;
    enum moteus_access access;
    bool commanded; /* a new command sets it to the default that follows */
    double initial;
};

extern const struct moteus_row moteus_rows[];
extern const size_t moteus_row_count;

/* Returns the row of a register; NULL = no such register. */
const struct moteus_row *moteus_find_row(uint32_t number);

/* Returns the unit of a quantity; NULL = dimensionless. */
const char *moteus_unit(enum moteus_quantity quantity);

/* Returns the size of a value in bytes. */
unsigned moteus_bytes(enum moteus_type type);

/* Read and write a value with the scale of its quantity. Integers saturate above their lowest
 * value, which means NaN. moteus_put returns false when the quantity has no such type. */
double moteus_get(enum moteus_quantity quantity, enum moteus_type type, const uint8_t *data);
bool moteus_put(enum moteus_quantity quantity, enum moteus_type type, double value, uint8_t *data);

/* The fields in the frames of our host (tasks/) and in the replies to them. Other hosts may use
 * other registers. */
extern const struct field moteus_command_fields[], moteus_reply_fields[];
enum { MOTEUS_COMMAND_LENGTH = 24, MOTEUS_REPLY_LENGTH = 32 };

#endif
