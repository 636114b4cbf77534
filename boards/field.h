/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The layout of a frame's data: a list of fields of any number of bits, one after the other without
 * gaps. The boards build and read frames from these lists, and the DBC export uses the same lists.
 * Immutable; RT-safe.
 *
 * Bits count from the least significant bit of byte 0; for big-endian fields from the most
 * significant bit of byte 0. A list may change the byte order only at a byte boundary. A field of
 * type FIELD_END ends a list.
 */
#ifndef BOARDS_FIELD_H
#define BOARDS_FIELD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* A type is a number of bits with flags for their meaning. */
enum field_type {
    FIELD_END = 0,
    FIELD_SIGNED = 1 << 8,
    FIELD_BIG_ENDIAN = 1 << 9,
    FIELD_FLOAT = 1 << 10,   /* IEEE 754, 32 bits; the value is the bit pattern */
    FIELD_PADDING = 1 << 11, /* sent as zero, ignored when received; has no value */

    FIELD_U8 = 8,
    FIELD_I8 = 8 | FIELD_SIGNED,
    FIELD_U16 = 16,
    FIELD_I16 = 16 | FIELD_SIGNED,
    FIELD_U32 = 32,
    FIELD_I32 = 32 | FIELD_SIGNED,
    FIELD_F32 = 32 | FIELD_FLOAT,
    FIELD_U16_BE = 16 | FIELD_BIG_ENDIAN,
    FIELD_I16_BE = 16 | FIELD_BIG_ENDIAN | FIELD_SIGNED,
    FIELD_PAD = 8 | FIELD_PADDING,
};

enum { FIELD_BITS_MASK = 0xff };

/* A named value of a field. */
struct field_value {
    int64_t value;
    const char *name; /* NULL ends a list */
};

struct field {
    unsigned type; /* enum field_type, or a number of bits up to 32 with its flags */
    const char *name;
    const char *unit; /* unit of value * scale + offset; NULL = dimensionless */
    int64_t min, max; /* other values are refused; both 0 = any value of the type */
    double scale;     /* 0 means 1 */
    double offset;
    const struct field_value *values; /* names of values; NULL = plain numbers */
};

enum { FIELDS_MAX = 16 }; /* most values in a list */

/* Return the number of values (fields without padding), bits and bytes of a list. A NULL list is
 * empty. */
size_t fields_count(const struct field *fields);
size_t fields_bits(const struct field *fields);
size_t fields_bytes(const struct field *fields);

/* Return the smallest and the largest value that the bits of a field can hold. */
int64_t field_lowest(const struct field *field);
int64_t field_highest(const struct field *field);

/* Reads the values of the fields from data. A field beyond `size` reads as 0. Returns false when a
 * value is outside its range. values must have room for FIELDS_MAX. */
bool fields_decode(const struct field *fields, const uint8_t *data, size_t size, int64_t *values);

/* Writes the values, each clamped to the range of its type. Writes padding as zero. */
void fields_encode(const struct field *fields, const int64_t *values, uint8_t *data);

#endif
