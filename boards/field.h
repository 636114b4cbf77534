/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How the data of a frame is laid out: a list of fields, one after the other without gaps, of any
 * number of bits. Frames are built and read from these lists and an export of the protocol (DBC)
 * reads the same ones, so that the two cannot differ. Immutable; RT-safe.
 *
 * Bits count from the least significant of byte 0 on, of big-endian fields from the most
 * significant of byte 0 on; where both meet in a list, it is between bytes. A list ends with a
 * field of type FIELD_END.
 */
#ifndef BOARDS_FIELD_H
#define BOARDS_FIELD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A type is its number of bits and what they mean. */
enum field_type {
    FIELD_END = 0,
    FIELD_SIGNED = 1 << 8,
    FIELD_BIG_ENDIAN = 1 << 9,
    FIELD_FLOAT = 1 << 10,   /* 32 bits, IEEE 754; as a value: its bits */
    FIELD_PADDING = 1 << 11, /* zero when sent, ignored when received; no value */

    FIELD_U8 = 8,
    FIELD_I8 = 8 | FIELD_SIGNED,
    FIELD_U16 = 16,
    FIELD_I16 = 16 | FIELD_SIGNED,
    FIELD_I24 = 24 | FIELD_SIGNED,
    FIELD_U32 = 32,
    FIELD_I32 = 32 | FIELD_SIGNED,
    FIELD_F32 = 32 | FIELD_FLOAT,
    FIELD_U16_BE = 16 | FIELD_BIG_ENDIAN,
    FIELD_I16_BE = 16 | FIELD_BIG_ENDIAN | FIELD_SIGNED,
    FIELD_PAD = 8 | FIELD_PADDING,
};

enum { FIELD_BITS_MASK = 0xff };

/* The name of a value of a field. */
struct field_value {
    int64_t value;
    const char *name; /* NULL closes a list */
};

struct field {
    unsigned type; /* enum field_type, or any other number of bits up to 32 with its flags */
    const char *name;
    const char *unit; /* of value * scale + offset; NULL: a bare number */
    int64_t min, max; /* values outside are refused; both 0: whatever the type holds */
    double scale;     /* 0: 1 */
    double offset;
    const struct field_value *values; /* NULL: numbers */
};

enum { FIELDS_MAX = 16 }; /* values that one list has at most */

/* Number of values (fields without padding) of a list, and the bits and whole bytes they take. A
 * NULL list is empty. */
size_t fields_count(const struct field *fields);
size_t fields_bits(const struct field *fields);
size_t fields_bytes(const struct field *fields);

/* Smallest and largest value that a field can hold, min and max aside. */
int64_t field_lowest(const struct field *field);
int64_t field_highest(const struct field *field);

/* Reads the values of fields from data; a field beyond size reads as 0. Returns false when a value
 * is outside its field's range. values holds FIELDS_MAX. */
bool fields_decode(const struct field *fields, const uint8_t *data, size_t size, int64_t *values);

/* Writes the values, each brought into the range of its type, and zero padding. */
void fields_encode(const struct field *fields, const int64_t *values, uint8_t *data);

#endif
