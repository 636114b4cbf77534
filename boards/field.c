/* SPDX-License-Identifier: Apache-2.0 */
/* Encodes and decodes fields; boards/field.h describes the layout. */
#include "boards/field.h"

/* Returns the number of bits of a field. */
static unsigned field_bits(const struct field *field)
{
    return field->type & FIELD_BITS_MASK;
}

size_t fields_count(const struct field *fields)
{
    size_t count = 0;

    for (; fields && fields->type != FIELD_END; fields++) {
        count += !(fields->type & FIELD_PADDING);
    }
    return count;
}

size_t fields_bits(const struct field *fields)
{
    size_t bits = 0;

    for (; fields && fields->type != FIELD_END; fields++) {
        bits += field_bits(fields);
    }
    return bits;
}

size_t fields_bytes(const struct field *fields)
{
    return (fields_bits(fields) + 7) / 8;
}

inline int64_t field_lowest(const struct field *field)
{
    return field->type & FIELD_SIGNED ? -(INT64_C(1) << (field_bits(field) - 1)) : 0;
}

inline int64_t field_highest(const struct field *field)
{
    unsigned bits = field_bits(field) - (field->type & FIELD_SIGNED ? 1 : 0);

    return (INT64_C(1) << bits) - 1;
}

/* Reads the value of a field that begins at bit `start` of the data. */
static int64_t field_get_value(const struct field *field, size_t start, const uint8_t *data)
{
    const unsigned bits = field_bits(field), before = start % 8, bytes = (before + bits + 7) / 8;
    const bool big = field->type & FIELD_BIG_ENDIAN;
    const uint64_t sign = UINT64_C(1) << (bits - 1);
    uint64_t value = 0;

    /* The bytes form a number in the field's byte order */
    for (unsigned i = 0; i < bytes; i++) {
        value |= (uint64_t)data[start / 8 + i] << 8 * (big ? bytes - 1 - i : i);
    }
    value = value >> (big ? 8 * bytes - before - bits : before) & (2 * sign - 1);
    return (int64_t)(field->type & FIELD_SIGNED ? (value ^ sign) - sign : value);
}

bool fields_decode(const struct field *fields, const uint8_t *data, size_t size, int64_t *values)
{
    size_t at = 0;

    for (; fields && fields->type != FIELD_END; fields++) {
        size_t end = at + field_bits(fields);

        if (!(fields->type & FIELD_PADDING)) {
            int64_t value = end <= 8 * size ? field_get_value(fields, at, data) : 0;

            if ((fields->min || fields->max) && (value < fields->min || value > fields->max)) {
                return false;
            }
            *values++ = value;
        }
        at = end;
    }
    return true;
}

void fields_encode(const struct field *fields, const int64_t *values, uint8_t *data)
{
    uint64_t held = 0; /* the last bits, not yet written */
    unsigned count = 0;
    bool big = false;

    for (; fields && fields->type != FIELD_END; fields++) {
        const unsigned bits = field_bits(fields);
        uint64_t value = 0;

        if (!(fields->type & FIELD_PADDING)) {
            const int64_t low = field_lowest(fields), high = field_highest(fields);

            value = (uint64_t)(*values < low ? low : *values > high ? high : *values);
            value &= (UINT64_C(1) << bits) - 1;
            values++;
        }
        big = fields->type & FIELD_BIG_ENDIAN;
        held = big ? held << bits | value : held | value << count;
        for (count += bits; count >= 8; count -= 8) {
            *data++ = (uint8_t)(big ? held >> (count - 8) : held);
            held = big ? held : held >> 8;
        }
        held = count > 0 ? held : 0;
    }
    if (count > 0) {
        *data = (uint8_t)(big ? held << (8 - count) : held);
    }
}
