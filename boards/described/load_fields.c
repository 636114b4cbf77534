/* SPDX-License-Identifier: Apache-2.0 */
/* The fields of the frames of a protocol file: where their bits are, what they mean, by which
 * scale; see boards/described/load.h. */
#include "boards/described/load.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static bool described_is_integer(enum described_meaning meaning)
{
    switch (meaning) {
    case DESCRIBED_CONSTANT:
    case DESCRIBED_SLOTS_MASK:
    case DESCRIBED_ADDRESS:
    case DESCRIBED_AXIS:
    case DESCRIBED_STATE:
    case DESCRIBED_LAW:
    case DESCRIBED_COMMANDS:
    case DESCRIBED_SLOT:
    case DESCRIBED_FAULTS:
    case DESCRIBED_FAULTY:
    case DESCRIBED_SEQUENCE:
    case DESCRIBED_FIRST_SLOT:
    case DESCRIBED_AXES_COUNT:
    case DESCRIBED_ECHO:
    case DESCRIBED_SATURATED:
        return true;
    default:
        return false;
    }
}

/* A host takes the link's count to be the difference of two counts of one frame. */
static enum error_code described_check_deflection(struct described_loader *l,
                                                  const struct raw_described_frame *raw,
                                                  const struct described_frame *made)
{
    int deflection = described_find_field(made, DESCRIBED_DEFLECTION);
    int motor = described_find_field(made, DESCRIBED_MOTOR_POSITION);

    if (deflection >= 0 &&
        (motor < 0 || made->field[motor].scale != made->field[deflection].scale ||
         made->field[deflection].offset != 0.0)) {
        return yaml_error(l->error, &raw->mark,
                          "found a deflection, expected the motor_position in the same frame by "
                          "the same scale, and no offset: it is the difference of two counts");
    }
    return ERROR_NONE;
}

/* The scale of a field; of a range, so that its ends are the least and the greatest count. */
static enum error_code described_measure_field(struct described_loader *l,
                                               const struct raw_described_field *raw,
                                               const struct field *layout,
                                               struct described_field *made)
{
    made->scale = raw->scale;
    made->offset = raw->offset;
    made->host = raw->host;
    made->axis = (uint8_t)raw->axis;
    if (raw->range_given) {
        double low = (double)field_lowest(layout), high = (double)field_highest(layout);

        if (raw->scale_given || raw->offset_given || raw->type == RAW_DESCRIBED_FLOAT ||
            !(raw->range[0] < raw->range[1])) {
            return yaml_error(l->error, &raw->range_mark,
                              "found range beside scale or offset, on a float or with its ends "
                              "the wrong way round, expected [least, greatest] alone");
        }
        made->scale = (raw->range[1] - raw->range[0]) / (high - low);
        made->offset = raw->range[0] - low * made->scale;
    }
    if (!(fabs(made->scale) >= 1e-12)) {
        return yaml_error(l->error, &raw->scale_mark,
                          "found a scale of %g, expected one of at least 1e-12 either way",
                          made->scale);
    }
    if (described_is_integer(made->meaning) &&
        (raw->scale_given || raw->offset_given || raw->range_given ||
         raw->type == RAW_DESCRIBED_FLOAT)) {
        return yaml_error(l->error, &raw->mark,
                          "found a scale, an offset, a range or a float of field \"%s\", expected "
                          "none: it is a count",
                          raw->name);
    }
    return ERROR_NONE;
}

/* What a field is: one of source (boards), target (host), value. */
static enum error_code described_mean_field(struct described_loader *l, bool from_host,
                                            const struct raw_described_field *raw,
                                            const struct field *layout,
                                            struct described_field *made)
{
    if (raw->source_given + raw->target_given + raw->value_given > 1 ||
        (from_host ? raw->source_given : raw->target_given)) {
        return yaml_error(l->error, &raw->mark,
                          "found field \"%s\" of a frame from the %s with the wrong or several of "
                          "source, target and value, expected %s or value, or none of them",
                          raw->name, from_host ? "host" : "board", from_host ? "target" : "source");
    }
    if (raw->value_given) {
        made->meaning = DESCRIBED_CONSTANT;
        made->constant = raw->value;
        if (raw->value < field_lowest(layout) || raw->value > field_highest(layout)) {
            return yaml_error(l->error, &raw->value_mark,
                              "found value %lld, expected one that %d bits hold",
                              (long long)raw->value, (int)raw->bits);
        }
    } else {
        made->meaning = (enum described_meaning)(raw->source_given   ? raw->source
                                                 : raw->target_given ? raw->target
                                                                     : DESCRIBED_NOTHING);
        made->constant = -1; /* of an echo: not yet known */
    }
    return described_measure_field(l, raw, layout, made);
}

static enum error_code described_name_values(struct described_loader *l,
                                             const struct raw_described_field *raw,
                                             struct field *layout)
{
    struct field_value *values;

    if (raw->nentry == 0 && !raw->value_given) {
        return ERROR_NONE;
    }
    values = arena_alloc(l->arena, raw->nentry + 2, sizeof *values);
    if (!values) {
        return described_no_memory(l);
    }
    values[0] = (struct field_value){raw->value, raw->nentry ? NULL : "always"};
    for (size_t i = 0; i < raw->nentry; i++) {
        double value = raw->entry[i].value;

        if (value != rint(value) || value < (double)field_lowest(layout) ||
            value > (double)field_highest(layout)) {
            return yaml_error(l->error, &raw->entry[i].mark,
                              "found %.15g for \"%s\", expected an integer that %d bits hold",
                              value, raw->entry[i].name, (int)raw->bits);
        }
        if (described_check_word(l, &raw->entry[i].mark, raw->entry[i].name)) {
            return ERROR_INPUT;
        }
        values[i] = (struct field_value){(int64_t)value, raw->entry[i].name};
    }
    layout->values = values;
    return ERROR_NONE;
}

/* Where the fields of a frame are laid out. */
struct described_plan {
    struct field *layout;
    struct described_field *field;
    size_t nlayout, nfield;
    unsigned bit;
    bool big; /* order of the field before */
};

static void described_add_gap(struct described_plan *plan, unsigned bits)
{
    if (bits > 0) {
        plan->layout[plan->nlayout++] = (struct field){
            .type = bits | FIELD_PADDING | (plan->big ? FIELD_BIG_ENDIAN : 0u), .name = "gap"};
        plan->bit += bits;
    }
}

/* A set-point is shown in the unit of the first state that drives. */
static void described_measure_set_point(const struct described_protocol *made, struct field *layout)
{
    static const char *const units[] = {
        [DESCRIBED_VOLTAGE] = "V",    [DESCRIBED_CURRENT] = "A",
        [DESCRIBED_TORQUE] = "Nm",    [DESCRIBED_VELOCITY] = "rad/s",
        [DESCRIBED_POSITION] = "rad", [DESCRIBED_IMPEDANCE] = "rad"};

    for (size_t i = 0; i < made->nstate; i++) {
        enum described_law law = made->state[i].law;

        if (law > DESCRIBED_OFF && law < DESCRIBED_FAULT) {
            layout->scale = made->state[i].set_point_scale;
            layout->unit = units[law];
            return;
        }
    }
}

static enum error_code described_add_field(struct described_loader *l,
                                           const struct raw_described_frame *frame,
                                           const struct raw_described_field *raw,
                                           struct described_plan *plan)
{
    struct field layout = {.type = (unsigned)raw->bits, .name = raw->name};
    unsigned at = raw->at_given ? (unsigned)raw->at_bit : plan->bit;
    struct described_field made = {.meaning = DESCRIBED_NOTHING};
    enum error_code code;

    if (plan->nfield == FIELDS_MAX || at + raw->bits > 8 * DESCRIBED_LENGTH_MAX) {
        return yaml_error(l->error, &raw->mark,
                          "found field \"%s\" as the %zuth or beyond bit 63, expected at most %d "
                          "fields within %d bytes",
                          raw->name, plan->nfield + 1, FIELDS_MAX, DESCRIBED_LENGTH_MAX);
    }
    for (size_t i = 0; i < plan->nlayout; i++) {
        if (!(plan->layout[i].type & FIELD_PADDING) && !strcmp(plan->layout[i].name, raw->name)) {
            return yaml_error(l->error, &raw->mark,
                              "found field \"%s\" again, expected another name", raw->name);
        }
    }
    if (at < plan->bit) {
        return yaml_error(l->error, &raw->at_mark,
                          "found at_bit %u, expected %u or more: fields do not overlap and are "
                          "listed in the order of their bits",
                          at, plan->bit);
    }
    if (raw->type == RAW_DESCRIBED_FLOAT && raw->bits != 32) {
        return yaml_error(l->error, &raw->bits_mark, "found a float of %d bits, expected 32",
                          (int)raw->bits);
    }

    /* A gap has the order of what is before it; two orders do not meet within a byte */
    if (plan->nfield > 0 && plan->big != (raw->order == 1) && plan->bit % 8 != 0) {
        described_add_gap(plan, 8 - plan->bit % 8);
        if (at < plan->bit) {
            return yaml_error(l->error, &raw->mark,
                              "found fields of both orders in one byte, expected one order");
        }
    }
    plan->big = raw->order == 1;
    described_add_gap(plan, at - plan->bit);
    layout.type |= (raw->type == RAW_DESCRIBED_SIGNED ? FIELD_SIGNED : 0u) |
                   (raw->type == RAW_DESCRIBED_FLOAT ? FIELD_FLOAT : 0u) |
                   (plan->big ? FIELD_BIG_ENDIAN : 0u);
    code = described_check_word(l, &raw->mark, raw->name);
    code = code ? code : described_mean_field(l, frame->from == 1, raw, &layout, &made);
    code = code ? code : described_name_values(l, raw, &layout);
    layout.scale = made.scale;
    layout.offset = made.offset;
    if (*described_unit(made.meaning)) {
        layout.unit = described_unit(made.meaning);
    }
    if (made.meaning == DESCRIBED_SET_POINT) {
        described_measure_set_point(l->made, &layout);
    }
    plan->layout[plan->nlayout++] = layout;
    plan->field[plan->nfield++] = made;
    plan->bit += (unsigned)raw->bits;
    return code;
}

/* A payload in hexadecimal: a constant a byte. */
static enum error_code described_add_payload(struct described_loader *l,
                                             const struct raw_described_frame *raw,
                                             struct described_plan *plan)
{
    static const char *const names[DESCRIBED_LENGTH_MAX] = {"byte_0", "byte_1", "byte_2", "byte_3",
                                                            "byte_4", "byte_5", "byte_6", "byte_7"};
    const char *text = raw->payload;

    while (*text) {
        struct field_value *only;
        unsigned byte;
        int used = 0;

        if (plan->nfield == DESCRIBED_LENGTH_MAX || strspn(text, "0123456789abcdefABCDEF") != 2 ||
            sscanf(text, "%2x%n", &byte, &used) != 1) {
            return yaml_error(l->error, &raw->payload_mark,
                              "found payload \"%s\", expected up to 8 bytes of two hexadecimal "
                              "digits each, as \"ff 00\"",
                              raw->payload);
        }
        only = arena_alloc(l->arena, 2, sizeof *only);
        if (!only) {
            return described_no_memory(l);
        }
        only[0] = (struct field_value){byte, "always"};
        plan->layout[plan->nlayout++] =
            (struct field){.type = FIELD_U8, .name = names[plan->nfield], .values = only};
        plan->field[plan->nfield++] =
            (struct described_field){.meaning = DESCRIBED_CONSTANT, .constant = byte, .scale = 1.0};
        plan->bit += 8;
        text += used;
        text += strspn(text, " ");
    }
    return ERROR_NONE;
}

enum error_code described_lay_out(struct described_loader *l, const struct raw_described_frame *raw,
                                  struct described_frame *made)
{
    struct described_plan plan = {
        .layout = arena_alloc(l->arena, 3 * (FIELDS_MAX + 1), sizeof *plan.layout),
        .field = arena_alloc(l->arena, FIELDS_MAX, sizeof *plan.field),
    };
    enum error_code code = ERROR_NONE;

    if (!plan.layout || !plan.field) {
        return described_no_memory(l);
    }
    if (raw->payload_given && raw->nfield > 0) {
        return yaml_error(l->error, &raw->payload_mark,
                          "found payload beside fields, expected one of them");
    }
    code = raw->payload_given ? described_add_payload(l, raw, &plan) : ERROR_NONE;
    for (size_t i = 0; i < raw->nfield && !code; i++) {
        code = described_add_field(l, raw, &raw->field[i], &plan);
    }
    if (code) {
        return code;
    }

    /* The length: what the fields take, or more */
    made->length = (uint8_t)((plan.bit + 7) / 8);
    if (raw->length_given && raw->length < made->length) {
        return yaml_error(l->error, &raw->length_mark,
                          "found length %d, expected at least the %d bytes of the fields",
                          (int)raw->length, made->length);
    }
    made->length = raw->length_given ? (uint8_t)raw->length : made->length;
    if (raw->repeat * made->length > DESCRIBED_LENGTH_MAX ||
        (raw->repeat > 1) != (raw->by == DESCRIBED_BY_GROUP) ||
        (raw->by == DESCRIBED_BY_GROUP && (raw->from == 0 || made->length == 0))) {
        return yaml_error(l->error, &raw->repeat_mark,
                          "found repeat %d, expected it of a frame from the host with by: group, "
                          "8 bytes in all",
                          (int)raw->repeat);
    }
    described_add_gap(&plan, 8u * made->length - plan.bit);
    made->repeats = (uint8_t)raw->repeat;
    made->nfield = plan.nfield;
    made->layout = plan.layout;
    made->field = plan.field;
    return described_check_deflection(l, raw, made);
}
