/* SPDX-License-Identifier: Apache-2.0 */
/* Codec of described frames: identifiers, counts and values. boards/described/protocol.h describes
 * it. */
#include "boards/described/protocol.h"

#include "boards/axis.h"

const char *const described_fault_names[32] = {
    "under-voltage",  "over-voltage", "over-current",   "motor encoder",   "link encoder",
    "torque sensor",  "temperature",  "under-pressure", "over-pressure",   "stale set-point",
    "position limit", "frames lost",  "saturated",      "inertial sensor", "emergency stop",
};

const char *described_unit(enum described_meaning meaning)
{
    /* A meaning without an entry is a count */
    static const char *const units[DESCRIBED_FT_CHANNEL] = {[DESCRIBED_NOTHING] = "",
                                                            [DESCRIBED_SET_POINT] = "",
                                                            [DESCRIBED_TO_DUTY] = "",
                                                            [DESCRIBED_AXIS_DUTY] = "",
                                                            [DESCRIBED_VALVE_OPENING] = "",
                                                            [DESCRIBED_TO_VOLTAGE] = "V",
                                                            [DESCRIBED_AXIS_VOLTAGE] = "V",
                                                            [DESCRIBED_SUPPLY] = "V",
                                                            [DESCRIBED_TO_CURRENT] = "A",
                                                            [DESCRIBED_AXIS_CURRENT] = "A",
                                                            [DESCRIBED_CURRENT_LIMIT] = "A",
                                                            [DESCRIBED_CURRENT_TARGET] = "A",
                                                            [DESCRIBED_SUPPLY_CURRENT] = "A",
                                                            [DESCRIBED_TO_TORQUE] = "Nm",
                                                            [DESCRIBED_AXIS_TORQUE] = "Nm",
                                                            [DESCRIBED_DRIVE_TORQUE] = "Nm",
                                                            [DESCRIBED_TORQUE_TARGET] = "Nm",
                                                            [DESCRIBED_ELECTRICAL_POWER] = "W",
                                                            [DESCRIBED_MECHANICAL_POWER] = "W",
                                                            [DESCRIBED_POSITION_GAIN] = "1/s",
                                                            [DESCRIBED_PISTON_PRESSURE] = "bar",
                                                            [DESCRIBED_ROD_PRESSURE] = "bar",
                                                            [DESCRIBED_TO_POSITION] = "rad",
                                                            [DESCRIBED_MOTOR_POSITION] = "rad",
                                                            [DESCRIBED_LINK_POSITION] = "rad",
                                                            [DESCRIBED_DEFLECTION] = "rad",
                                                            [DESCRIBED_PRESENT_POSITION] = "rad",
                                                            [DESCRIBED_TO_VELOCITY] = "rad/s",
                                                            [DESCRIBED_MOTOR_VELOCITY] = "rad/s",
                                                            [DESCRIBED_VELOCITY_LIMIT] = "rad/s",
                                                            [DESCRIBED_TO_KP] = "Nm/rad",
                                                            [DESCRIBED_INTEGRAL_GAIN] = "Nm/rad",
                                                            [DESCRIBED_TO_KD] = "Nm s/rad",
                                                            [DESCRIBED_VELOCITY_GAIN] = "Nm s/rad",
                                                            [DESCRIBED_TEMPERATURE] = "degC",
                                                            [DESCRIBED_AMBIENT] = "degC",
                                                            [DESCRIBED_UPTIME] = "s",
                                                            [DESCRIBED_TO_VELOCITY_CAP] = "rad/s",
                                                            [DESCRIBED_TO_CURRENT_CAP] = "A",
                                                            [DESCRIBED_STORED] = "",
                                                            [DESCRIBED_COMMAND_TIMEOUT] = "s",
                                                            [DESCRIBED_POSITION_SPEED_LIMIT] =
                                                                "rad/s",
                                                            [DESCRIBED_TELEMETRY_PERIOD] = "s"};

    /* Channels of sensors */
    return meaning < DESCRIBED_FT_CHANNEL       ? units[meaning]
           : meaning < DESCRIBED_FT_CHANNEL + 3 ? "N"
           : meaning < DESCRIBED_ACCELERATION   ? "Nm"
           : meaning < DESCRIBED_RATE           ? "m/s2"
           : meaning < DESCRIBED_QUATERNION     ? "rad/s"
           : meaning < DESCRIBED_MAGNETIC       ? ""
           : meaning < DESCRIBED_EULER          ? "T"
                                                : "rad";
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

int64_t described_count(const struct described_field *field, double value)
{
    double scaled = (value - field->offset) / field->scale;
    int32_t count = 0;

    if (field->real) {
        float real = isnan(scaled) ? 0.0f : (float)scaled;
        uint32_t bits;

        memcpy(&bits, &real, sizeof bits);
        return bits;
    }
    if (!control_quantize(scaled, &count) && isinf(scaled)) {
        return scaled > 0.0 ? field->high : field->low;
    }
    if (count == INT32_MAX && scaled > INT32_MAX && scaled <= UINT32_MAX) {
        return (int64_t)(scaled + 0.5); /* unsigned fields of 32 bits */
    }
    return control_clamp(count, field->low, field->high);
}

double described_real(uint32_t bits)
{
    float real;

    memcpy(&real, &bits, sizeof real);
    return isfinite(real) ? (double)real : 0.0;
}

const struct field *described_layout(const struct described_frame *frame, size_t field)
{
    const struct field *layout = field < frame->ndata ? frame->layout : frame->id_layout;

    field -= field < frame->ndata ? 0 : frame->ndata;
    for (;; layout++) {
        if (!(layout->type & FIELD_PADDING) && field-- == 0) {
            return layout;
        }
    }
}

/* ---- checksums ---- */

const char *described_checksum_name(enum described_checksum checksum)
{
    return checksum == DESCRIBED_XOR              ? "exclusive or"
           : checksum == DESCRIBED_CRC8_SAE_J1850 ? "CRC-8 SAE J1850"
                                                  : "";
}

uint8_t described_checksum(enum described_checksum checksum, const uint8_t *data, size_t length,
                           size_t skip)
{
    bool crc = checksum == DESCRIBED_CRC8_SAE_J1850;
    uint8_t sum = crc ? 0xff : 0;

    for (size_t i = 0; i < length; i++) {
        sum ^= i == skip ? 0 : data[i];
        /* Polynomial of the CRC: x^8 + x^4 + x^3 + x^2 + 1 */
        for (int bit = 0; bit < 8 && crc && i != skip; bit++) {
            sum = (uint8_t)(sum << 1 ^ (sum & 0x80 ? 0x1d : 0));
        }
    }
    return crc ? sum ^ 0xff : sum;
}

void described_encode(const struct described_frame *frame, unsigned number, unsigned part,
                      const int64_t *counts, struct bus_frame *out)
{
    out->id = described_id(frame, number);
    for (size_t i = 0; i < frame->nfield; i++) {
        described_put(&frame->field[i], counts[i], part * frame->length, out);
    }
    described_close(frame, out->data);
}

void described_decode(const struct described_frame *frame, const struct bus_frame *sent,
                      unsigned part, int64_t *counts)
{
    for (size_t i = 0; i < frame->nfield; i++) {
        counts[i] = described_get(&frame->field[i], sent, part * frame->length);
    }
}

/* ---- which frame it is ---- */

/* Returns whether a frame can have a length. Repeated fields allow any number of repetitions; CAN
 * FD pads to its next length. */
static bool described_has_length(const struct described_frame *frame, uint8_t len)
{
    if (frame->repeats == 1) {
        return len >= frame->shortest && len <= frame->longest;
    }
    for (unsigned count = 1; count <= frame->repeats; count++) {
        if (len == described_length(frame, count)) {
            return true;
        }
    }
    return false;
}

bool described_has_constants(const struct described_frame *frame, const struct bus_frame *sent,
                             unsigned part)
{
    for (size_t i = 0; i < frame->nfield; i++) {
        const struct described_field *field = &frame->field[i];

        if (field->meaning == DESCRIBED_CONSTANT &&
            described_get(field, sent, part * frame->length) != field->constant) {
            return false;
        }
    }
    return true;
}

enum described_match described_match_frame(const struct described_frame *frame,
                                           const struct bus_frame *sent)
{
    /* A remote frame has no data to check */
    if (frame->remote) {
        return DESCRIBED_IS;
    }
    if (((frame->flags ^ sent->flags) & FRAME_FD && !frame->either) ||
        !described_has_length(frame, sent->len)) {
        return DESCRIBED_BAD_LENGTH;
    }
    if (frame->nconstant > 0 && !described_has_constants(frame, sent, 0)) {
        return DESCRIBED_BAD_CONSTANT;
    }
    if (frame->checksum &&
        sent->data[frame->checksum_byte] !=
            described_checksum(frame->checksum, sent->data, frame->length, frame->checksum_byte)) {
        return DESCRIBED_BAD_CHECKSUM;
    }
    return DESCRIBED_IS;
}

/* Computes a mask of the constant bits in a frame's data, and their values. */
static void described_find_constants(const struct described_frame *frame, struct bus_frame *mask,
                                     struct bus_frame *value)
{
    struct described_frame constants = *frame;
    int64_t bits[DESCRIBED_FIELDS_MAX] = {0}, counts[DESCRIBED_FIELDS_MAX] = {0};

    for (size_t i = 0; i < frame->ndata; i++) {
        if (frame->field[i].meaning == DESCRIBED_CONSTANT) {
            bits[i] = frame->field[i].low < 0 ? -1 : frame->field[i].high;
            counts[i] = frame->field[i].constant;
        }
    }
    constants.nfield = frame->ndata;
    constants.checksum = DESCRIBED_NO_CHECKSUM;
    described_encode(&constants, 0, 0, bits, mask);
    described_encode(&constants, 0, 0, counts, value);
}

/* Returns whether one of two rows is the request to a drive and the other only an answer of the
 * same drive with the request's identifier, as LK-TECH's have it. */
static bool described_is_exchange(const struct described_frame *a, const struct described_frame *b)
{
    const struct described_frame *answer = a->from_host ? b : a;

    return a->by == DESCRIBED_BY_ADDRESS && b->by == DESCRIBED_BY_ADDRESS && a->base == b->base &&
           a->step == b->step && !a->mask && !b->mask && !answer->period_ns && !answer->telemetry &&
           !answer->on_change && !answer->on_fault && !answer->on_restart;
}

bool described_told_apart(const struct described_frame *a, const struct described_frame *b)
{
    struct bus_frame mask[2] = {{0}}, value[2] = {{0}};

    if (a->from_host != b->from_host) {
        return a->remote != b->remote || described_is_exchange(a, b);
    }
    if (a->remote != b->remote) {
        /* A frame without data could match both rows, one remote and one with data */
        const struct described_frame *request = a->remote ? a : b, *other = a->remote ? b : a;

        return !request->or_empty || other->shortest != 0;
    }
    if (a->remote) {
        return false; /* lengths do not distinguish them */
    }
    if (described_find_field(a, DESCRIBED_PARAMETER) >= 0) {
        return true; /* b receives the parameters that the protocol does not list */
    }
    if ((a->flags ^ b->flags) & FRAME_FD ||
        (a->repeats == 1 && b->repeats == 1 &&
         (a->shortest > b->longest || b->shortest > a->longest))) {
        return true;
    }
    described_find_constants(a, &mask[0], &value[0]);
    described_find_constants(b, &mask[1], &value[1]);
    for (size_t i = 0; i < DESCRIBED_LENGTH_MAX; i++) {
        if (mask[0].data[i] & (~mask[1].data[i] | (value[0].data[i] ^ value[1].data[i]))) {
            return true;
        }
    }
    return false;
}

int described_find_state(const struct described_state *state, size_t count, int64_t value,
                         bool commanded)
{
    for (size_t i = 0; i < count; i++) {
        if (state[i].value == value && (state[i].law != DESCRIBED_FAULT || !commanded)) {
            return (int)i;
        }
    }
    return -1;
}

const struct described_parameter *
described_find_parameter(const struct described_protocol *protocol, int64_t number)
{
    for (size_t i = 0; i < protocol->nparameter; i++) {
        if (protocol->parameter[i].numbered && protocol->parameter[i].number == number) {
            return &protocol->parameter[i];
        }
    }
    return NULL;
}
