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

int64_t field_lowest(const struct field *field)
{
    return field->type & FIELD_SIGNED ? -(INT64_C(1) << (field_bits(field) - 1)) : 0;
}

int64_t field_highest(const struct field *field)
{
    unsigned bits = field_bits(field) - (field->type & FIELD_SIGNED ? 1 : 0);

    return (INT64_C(1) << bits) - 1;
}

/* A run of bits of a field within one byte. */
struct run {
    size_t byte;
    unsigned from;  /* first bit in the byte */
    unsigned value; /* first bit in the value */
    unsigned bits;
};

/* Returns the next run of a field's bits within one byte, when `done` bits are already copied. */
static struct run field_next_run(const struct field *field, size_t start, unsigned done)
{
    unsigned bits = field_bits(field), from = (start + done) % 8;
    struct run run = {.byte = (start + done) / 8, .from = from, .value = done};

    run.bits = bits - done < 8 - from ? bits - done : 8 - from;
    if (field->type & FIELD_BIG_ENDIAN) {
        run.from = 8 - from - run.bits;
        run.value = bits - done - run.bits;
    }
    return run;
}

/* Returns the signed value of a field's bits. */
static int64_t field_extend_sign(const struct field *field, uint64_t bits)
{
    const uint64_t sign = UINT64_C(1) << (field_bits(field) - 1);

    return (int64_t)(field->type & FIELD_SIGNED ? (bits ^ sign) - sign : bits);
}

/* Reads the value of a field that starts at a bit of the data. */
static int64_t field_get_value(const struct field *field, size_t start, const uint8_t *data)
{
    unsigned bits = field_bits(field);
    uint64_t value = 0;

    /* Most fields are whole bytes: a fast path */
    if ((start | bits) % 8 == 0 && !(field->type & FIELD_BIG_ENDIAN)) {
        for (unsigned done = 0; done < bits; done += 8) {
            value |= (uint64_t)data[(start + done) / 8] << done;
        }
        return field_extend_sign(field, value);
    }
    for (unsigned done = 0; done < bits;) {
        struct run run = field_next_run(field, start, done);
        uint64_t part = data[run.byte] >> run.from & ((1u << run.bits) - 1);

        value |= part << run.value;
        done += run.bits;
    }
    return field_extend_sign(field, value);
}

/* Writes the value of a field that starts at a bit of the data. */
static void field_put_value(const struct field *field, int64_t value, size_t start, uint8_t *data)
{
    unsigned bits = field_bits(field);

    /* Most fields are whole bytes: a fast path */
    if ((start | bits) % 8 == 0 && !(field->type & FIELD_BIG_ENDIAN)) {
        for (unsigned done = 0; done < bits; done += 8) {
            data[(start + done) / 8] = (uint8_t)((uint64_t)value >> done);
        }
        return;
    }
    for (unsigned done = 0; done < bits;) {
        struct run run = field_next_run(field, start, done);
        unsigned mask = (1u << run.bits) - 1;
        unsigned part = (unsigned)((uint64_t)value >> run.value) & mask;

        data[run.byte] = (uint8_t)((data[run.byte] & ~(mask << run.from)) | part << run.from);
        done += run.bits;
    }
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
    size_t at = 0;

    for (; fields && fields->type != FIELD_END; fields++) {
        int64_t value = 0;

        if (!(fields->type & FIELD_PADDING)) {
            int64_t low = field_lowest(fields), high = field_highest(fields);

            value = *values < low ? low : *values > high ? high : *values;
            values++;
        }
        field_put_value(fields, value, at, data);
        at += field_bits(fields);
    }
}
