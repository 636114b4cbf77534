/* SPDX-License-Identifier: Apache-2.0 */
/* The registers of a moteus: what each is measured in, who may write it, and what it is in a new
 * command. Pure functions of a constant table; RT-safe. */
#ifndef BOARDS_MOTEUS_TABLE_H
#define BOARDS_MOTEUS_TABLE_H

#include "boards/field.h"
#include "boards/moteus/protocol.h"

#include <stdbool.h>

/* What a register is measured in, which gives its integers a scale. */
enum moteus_quantity {
    MOTEUS_Q_NUMBER,  /* the number itself */
    MOTEUS_Q_WORD,    /* 32 bits, only as int32 */
    MOTEUS_Q_COUNTER, /* wraps in each type */
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
    uint16_t same_as; /* the register that it shows once more; 0: none */
    const char *name;
    enum moteus_quantity quantity;
    enum moteus_access access;
    bool commanded; /* a new command sets it to what follows */
    double initial;
};

extern const struct moteus_row moteus_rows[];
extern const size_t moteus_row_count;

/* Returns the row of a register; NULL when there is none. */
const struct moteus_row *moteus_find_row(uint32_t number);

/* Returns the unit of a quantity; NULL: a bare number. */
const char *moteus_unit(enum moteus_quantity quantity);

/* Returns the number of bytes of a value. */
unsigned moteus_bytes(enum moteus_type type);

/* Read a value from data, and write one, by the scale of the quantity. Integers saturate above
 * their lowest, which is NaN. moteus_put: false when the quantity does not come in that type. */
double moteus_get(enum moteus_quantity quantity, enum moteus_type type, const uint8_t *data);
bool moteus_put(enum moteus_quantity quantity, enum moteus_type type, double value, uint8_t *data);

/* What the frames of the host in tasks/, and the answers to them, hold; others ask for what they
 * like. */
extern const struct field moteus_command_fields[], moteus_reply_fields[];
enum { MOTEUS_COMMAND_LENGTH = 24, MOTEUS_REPLY_LENGTH = 32 };

#endif
