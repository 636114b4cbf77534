/* SPDX-License-Identifier: Apache-2.0 */
/* What the frames of a described protocol mean: identifiers, counts and values; see the header. */
#include "boards/described/protocol.h"

#include "boards/motor_control.h"

#include <math.h>
#include <string.h>

const char *const described_fault_names[32] = {
    "under-voltage",  "over-voltage", "over-current",   "motor encoder",   "link encoder",
    "torque sensor",  "temperature",  "under-pressure", "over-pressure",   "stale set-point",
    "position limit", "frames lost",  "saturated",      "inertial sensor",
};

const char *described_unit(enum described_meaning meaning)
{
    if (meaning >= DESCRIBED_FT_CHANNEL) {
        return meaning < DESCRIBED_FT_CHANNEL + 3 ? "N"
               : meaning < DESCRIBED_ACCELERATION ? "Nm"
               : meaning < DESCRIBED_RATE         ? "m/s2"
               : meaning < DESCRIBED_QUATERNION   ? "rad/s"
               : meaning < DESCRIBED_MAGNETIC     ? ""
               : meaning < DESCRIBED_EULER        ? "T"
                                                  : "rad";
    }
    switch (meaning) {
    case DESCRIBED_TO_VOLTAGE:
    case DESCRIBED_AXIS_VOLTAGE:
    case DESCRIBED_SUPPLY:
        return "V";
    case DESCRIBED_TO_CURRENT:
    case DESCRIBED_AXIS_CURRENT:
        return "A";
    case DESCRIBED_TO_TORQUE:
    case DESCRIBED_AXIS_TORQUE:
    case DESCRIBED_DRIVE_TORQUE:
        return "Nm";
    case DESCRIBED_PISTON_PRESSURE:
    case DESCRIBED_ROD_PRESSURE:
        return "bar";
    case DESCRIBED_TO_POSITION:
    case DESCRIBED_MOTOR_POSITION:
    case DESCRIBED_LINK_POSITION:
    case DESCRIBED_DEFLECTION:
        return "rad";
    case DESCRIBED_TO_VELOCITY:
    case DESCRIBED_MOTOR_VELOCITY:
        return "rad/s";
    case DESCRIBED_TO_KP:
        return "Nm/rad";
    case DESCRIBED_TO_KD:
        return "Nm s/rad";
    case DESCRIBED_TEMPERATURE:
        return "degC";
    case DESCRIBED_UPTIME:
    case DESCRIBED_TELEMETRY_PERIOD:
        return "s";
    default:
        return "";
    }
}

uint32_t described_known_faults(const struct described_protocol *protocol, int64_t bits)
{
    uint32_t faults = 0;

    for (int i = 0; i < DESCRIBED_FAULT_KINDS; i++) {
        if (protocol->fault_bit[i] >= 0 && bits >> protocol->fault_bit[i] & 1) {
            faults |= UINT32_C(1) << i;
        }
    }
    return faults;
}

int64_t described_fault_bits(const struct described_protocol *protocol, uint32_t faults)
{
    int64_t bits = 0;

    for (int i = 0; i < DESCRIBED_FAULT_KINDS; i++) {
        if (protocol->fault_bit[i] >= 0 && faults >> i & 1) {
            bits |= INT64_C(1) << protocol->fault_bit[i];
        }
    }
    return bits;
}

int64_t described_count(const struct field *layout, const struct described_field *field,
                        double value)
{
    double scaled = (value - field->offset) / field->scale;
    int32_t count = 0;

    if (layout->type & FIELD_FLOAT) {
        float real = isfinite(scaled) ? (float)scaled : 0.0f;
        uint32_t bits;

        memcpy(&bits, &real, sizeof bits);
        return bits;
    }
    if (scaled > INT32_MAX && scaled <= UINT32_MAX) {
        return (int64_t)(scaled + 0.5); /* of 32 bits without a sign */
    }
    control_quantize(scaled, &count);
    return control_clamp(count, field_lowest(layout), field_highest(layout));
}

double described_value(const struct field *layout, const struct described_field *field,
                       int64_t count)
{
    double scaled = (double)count;

    if (layout->type & FIELD_FLOAT) {
        uint32_t bits = (uint32_t)count;
        float real;

        memcpy(&real, &bits, sizeof real);
        scaled = isfinite(real) ? (double)real : 0.0;
    }
    return scaled * field->scale + field->offset;
}

const struct field *described_layout(const struct described_frame *frame, size_t field)
{
    const struct field *layout = frame->layout;

    for (;; layout++) {
        if (!(layout->type & FIELD_PADDING) && field-- == 0) {
            return layout;
        }
    }
}

bool described_number(const struct described_frame *frame, uint32_t id, unsigned *number)
{
    uint32_t above = id - frame->base;

    *number = 0;
    if (id < frame->base || frame->by == DESCRIBED_BY_NONE) {
        return id == frame->base;
    }
    *number = above / frame->step;
    return above % frame->step == 0 && *number <= frame->most &&
           (frame->by != DESCRIBED_BY_ADDRESS || *number > 0);
}

enum described_match described_match_data(const struct described_frame *frame, const uint8_t *data,
                                          uint8_t len, int64_t *values)
{
    /* A remote frame has a length without data */
    if (frame->remote) {
        return DESCRIBED_IS;
    }
    if (frame->repeats > 1 ? len == 0 || len % frame->length || len > frame->length * frame->repeats
                           : len != frame->length) {
        return DESCRIBED_BAD_LENGTH;
    }
    fields_decode(frame->layout, data, len, values);
    for (size_t i = 0; i < frame->nfield; i++) {
        if (frame->field[i].meaning == DESCRIBED_CONSTANT &&
            values[i] != frame->field[i].constant) {
            return DESCRIBED_BAD_CONSTANT;
        }
    }
    return DESCRIBED_IS;
}

int described_find_state(const struct described_state *state, size_t count, int64_t value,
                         bool commanded)
{
    for (size_t i = 0; i < count; i++) {
        if (state[i].value == value && (state[i].commanded || !commanded)) {
            return (int)i;
        }
    }
    return -1;
}

int described_find_field(const struct described_frame *frame, enum described_meaning meaning)
{
    for (size_t i = 0; i < frame->nfield; i++) {
        if (frame->field[i].meaning == meaning) {
            return (int)i;
        }
    }
    return -1;
}
