/* SPDX-License-Identifier: Apache-2.0 */
/* Lays out the fields of a protocol file's frames: bits, meaning, scale. boards/described/load.h
 * describes the functions. */
#include "boards/described/load.h"

#include <math.h>
#include <stdio.h>

/* GAP_BITS: most bits in one piece of padding; GAPS_MAX: most pieces in a frame */
enum { GAP_BITS = 32, GAPS_MAX = 8 * DESCRIBED_LENGTH_MAX / GAP_BITS };

/* Sets the place of a field and the range of its count. type: as in struct field. */
static void described_place(struct described_field *made, unsigned type, unsigned bit, bool in_id)
{
    const struct field layout = {.type = type};
    unsigned bits = type & FIELD_BITS_MASK;

    /* The window starts at the field's first byte */
    made->in_id = in_id;
    made->big_endian = type & FIELD_BIG_ENDIAN;
    made->byte = (uint8_t)(in_id ? 0 : bit / 8);
    made->end = (uint8_t)((bit + bits + 7) / 8);
    made->shift = (uint8_t)(bit - 8 * made->byte);
    if (made->big_endian) {
        made->shift = (uint8_t)(8 * DESCRIBED_WINDOW - made->shift - bits);
    }
    made->mask = (UINT64_C(1) << bits) - 1;
    made->sign = type & FIELD_SIGNED ? UINT64_C(1) << (bits - 1) : 0;
    made->real = type & FIELD_FLOAT;
    made->low = field_lowest(&layout);
    made->high = field_highest(&layout);
}

/* Checks a deflection field. A host computes the link position as the difference of two counts,
 * motor position minus deflection. Both fields must be in one frame and have the same scale. */
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

/* Finds the meaning and the scale of a field. The meaning is a source (board), a target (host), a
 * constant, a counter or a checksum. A range maps its ends to the smallest and the largest
 * count. */
static enum error_code described_mean_field(struct described_loader *l, bool from_host,
                                            const struct raw_described_field *raw,
                                            struct described_field *made)
{
    const bool value = yaml_has(&raw->mark, "value"), range = yaml_has(&raw->mark, "range");
    const bool scaled = yaml_has(&raw->mark, "scale") || yaml_has(&raw->mark, "offset");
    const double low = (double)made->low, high = (double)made->high;
    int fault = 0;

    if (raw->fault &&
        yaml_find_name(YAML_NAMES(described_faults_schema.fields, DESCRIBED_FAULT_KINDS, key),
                       "fault", raw->fault, yaml_place(&raw->mark, "fault"), &fault, l->error)) {
        return ERROR_INPUT;
    }
    made->constant = raw->fault ? fault : made->constant;
    made->meaning = value           ? DESCRIBED_CONSTANT
                    : raw->fault    ? DESCRIBED_FAULT_BIT
                    : raw->counter  ? DESCRIBED_COUNTER
                    : raw->checksum ? DESCRIBED_CHECKSUM
                                    : made->meaning;
    if (range) {
        made->scale = (raw->range[1] - raw->range[0]) / (high - low);
        made->offset = raw->range[0] - low * made->scale;
    }
    if (yaml_has(&raw->mark, "source") + yaml_has(&raw->mark, "target") + value + raw->counter +
                (raw->fault != NULL) + (raw->checksum != DESCRIBED_NO_CHECKSUM) >
            1 ||
        yaml_has(&raw->mark, from_host ? "source" : "target") || (from_host && raw->fault)) {
        return yaml_error(l->error, &raw->mark,
                          "found field \"%s\" of a frame from the %s with the wrong or several of "
                          "source, target, value, counter and checksum, expected %s or one of the "
                          "last three, or none of them",
                          raw->name, from_host ? "host" : "board", from_host ? "target" : "source");
    }
    if (value && !made->real &&
        (raw->value != rint(raw->value) || raw->value < low || raw->value > high)) {
        return yaml_error(l->error, yaml_place(&raw->mark, "value"),
                          "found value %.15g, expected one that %d bits hold", raw->value,
                          raw->bits);
    }
    if (value) {
        made->constant =
            made->real
                ? described_count(&(struct described_field){.real = true, .scale = 1.0}, raw->value)
                : (int64_t)raw->value;
    }
    if (range && (scaled || made->real || !(raw->range[0] < raw->range[1]))) {
        return yaml_error(l->error, yaml_place(&raw->mark, "range"),
                          "found range beside scale or offset, on a float or with its ends the "
                          "wrong way round, expected [least, greatest] alone");
    }
    if (!(fabs(made->scale) >= 1e-12)) {
        return yaml_error(l->error, yaml_place(&raw->mark, "scale"),
                          "found a scale of %g, expected one of at least 1e-12 either way",
                          made->scale);
    }
    if (!described_unit(made->meaning) && (scaled || range || (made->real && !value))) {
        return yaml_error(l->error, &raw->mark,
                          "found a scale, an offset, a range or a float of field \"%s\", expected "
                          "none: it is a count",
                          raw->name);
    }
    return ERROR_NONE;
}

/* Returns whether a DBC file can contain a text as a quoted string. */
static bool described_can_be_quoted(const char *text)
{
    for (; *text; text++) {
        if (*text < ' ' || *text > '~' || *text == '"' || *text == '\\') {
            return false;
        }
    }
    return true;
}

/* Gives the values of a field the names of the protocol's states or laws. If two states share a
 * value, uses the first name. */
static enum error_code described_name_states(struct described_loader *l,
                                             enum described_meaning meaning, bool from_host,
                                             struct field *layout)
{
    const struct described_state *state =
        meaning == DESCRIBED_STATE ? l->made->state : l->made->law;
    const size_t nstate = meaning == DESCRIBED_STATE ? l->made->nstate : l->made->nlaw;
    struct field_value *values = arena_alloc(l->arena, nstate + 1, sizeof *values);
    size_t count = 0;

    if (!values) {
        return described_no_memory(l);
    }
    for (size_t i = 0; i < nstate; i++) {
        const int64_t value = state[i].value;

        if (described_find_state(state, nstate, value, from_host) == (int)i &&
            value >= field_lowest(layout) && value <= field_highest(layout) &&
            described_can_be_quoted(state[i].name)) {
            values[count++] = (struct field_value){value, state[i].name};
        }
    }
    layout->values = count ? values : NULL;
    return ERROR_NONE;
}

/* Names the values of a field: the values that the file lists, or the constant. */
static enum error_code described_name_values(struct described_loader *l,
                                             const struct raw_described_field *raw,
                                             int64_t constant, struct field *layout)
{
    struct field_value *values;

    if (raw->nentry == 0 && (!yaml_has(&raw->mark, "value") || layout->type & FIELD_FLOAT)) {
        return ERROR_NONE;
    }
    values = arena_alloc(l->arena, raw->nentry + 2, sizeof *values);
    if (!values) {
        return described_no_memory(l);
    }
    values[0] = (struct field_value){constant, raw->nentry ? NULL : "always"};
    /* Each value fits into the field and has one name */
    for (size_t i = 0; i < raw->nentry; i++) {
        double value = raw->entry[i].value;

        if (value != rint(value) || value < (double)field_lowest(layout) ||
            value > (double)field_highest(layout)) {
            return yaml_error(l->error, &raw->entry[i].mark,
                              "found %.15g for \"%s\", expected an integer that %d bits hold",
                              value, raw->entry[i].name, raw->bits);
        }
        if (described_check_word(l, &raw->entry[i].mark, raw->entry[i].name)) {
            return ERROR_INPUT;
        }
        for (size_t k = 0; k < i; k++) {
            if (raw->entry[k].value == value) {
                return yaml_error(l->error, &raw->entry[i].mark,
                                  "found %.15g for \"%s\", which \"%s\" has, expected another: a "
                                  "value has one name",
                                  value, raw->entry[i].name, raw->entry[k].name);
            }
        }
        values[i] = (struct field_value){(int64_t)value, raw->entry[i].name};
    }
    layout->values = values;
    return ERROR_NONE;
}

/* The layout of a frame's data or identifier, under construction. */
struct described_plan {
    struct field *layout;
    /* layout of the frame's data while the identifier is laid out, else NULL */
    const struct field *other;
    struct described_field *field;
    size_t nlayout, nfield;
    unsigned bit, bits; /* bit of the next field; total number of bits */
    bool big;           /* byte order of the last field */
};

/* Adds padding, in pieces of at most GAP_BITS, which the codec accepts. */
static void described_add_gap(struct described_plan *plan, unsigned bits)
{
    while (bits > 0) {
        unsigned part = bits < GAP_BITS ? bits : GAP_BITS;

        plan->layout[plan->nlayout++] = (struct field){
            .type = part | FIELD_PADDING | (plan->big ? FIELD_BIG_ENDIAN : 0u), .name = "gap"};
        plan->bit += part;
        bits -= part;
    }
}

/* Sets the unit and the scale of a set point from the first state that drives. */
static void described_measure_set_point(const struct described_protocol *made, struct field *layout)
{
    for (size_t i = 0; i < made->nstate; i++) {
        enum described_law law = made->state[i].law;

        if (law > DESCRIBED_OFF && law < DESCRIBED_FAULT) {
            layout->scale = made->state[i].set_point_scale;
            layout->unit = described_unit(described_law_target(law));
            return;
        }
    }
}

/* Returns whether a layout has a field named `name`. */
static bool described_has_name(const struct field *layout, const char *name)
{
    for (; layout && layout->type != FIELD_END; layout++) {
        if (!(layout->type & FIELD_PADDING) && !strcmp(layout->name, name)) {
            return true;
        }
    }
    return false;
}

/* Adds a field to a plan: its place, meaning, values and scale. */
static enum error_code described_add_field(struct described_loader *l,
                                           const struct raw_described_frame *frame,
                                           const struct raw_described_field *raw,
                                           struct described_plan *plan)
{
    struct field layout = {.type = (unsigned)(raw->bits | raw->type | raw->order),
                           .name = raw->name};
    unsigned at = yaml_has(&raw->mark, "at_bit") ? (unsigned)raw->at_bit : plan->bit;
    struct described_field made = raw->field;
    bool big = raw->order != 0;
    enum error_code code;

    if (plan->nfield == DESCRIBED_FIELDS_MAX || at + (unsigned)raw->bits > plan->bits) {
        return yaml_error(l->error, &raw->mark,
                          "found field \"%s\" as the %zuth or beyond bit %u, expected at most %d "
                          "fields within %u bits%s",
                          raw->name, plan->nfield + 1, plan->bits - 1, DESCRIBED_FIELDS_MAX,
                          plan->bits,
                          plan->other || frame->fd ? "" : ": frames with fd: true have 512");
    }
    if (described_has_name(plan->layout, raw->name) || described_has_name(plan->other, raw->name)) {
        return yaml_error(l->error, &raw->mark, "found field \"%s\" again, expected another name",
                          raw->name);
    }
    if (at < plan->bit) {
        return yaml_error(l->error, yaml_place(&raw->mark, "at_bit"),
                          "found at_bit %u, expected %u or more: fields do not overlap and are "
                          "listed in the order of their bits",
                          at, plan->bit);
    }
    if (raw->type == FIELD_FLOAT && raw->bits != 32) {
        return yaml_error(l->error, yaml_place(&raw->mark, "bits"),
                          "found a float of %d bits, expected 32", raw->bits);
    }

    /* Padding has the byte order of the field before it. One byte cannot hold both byte orders */
    if (plan->nfield > 0 && plan->big != big && plan->bit % 8 != 0) {
        described_add_gap(plan, 8 - plan->bit % 8);
        if (at < plan->bit) {
            return yaml_error(l->error, &raw->mark,
                              "found fields of both orders in one byte, expected one order");
        }
    }
    plan->big = big;
    described_add_gap(plan, at - plan->bit);
    code = described_check_word(l, &raw->mark, raw->name);
    described_place(&made, layout.type, plan->bit, plan->other);
    code = code ? code : described_mean_field(l, frame->from_host, raw, &made);
    code = code ? code : described_name_values(l, raw, made.constant, &layout);
    if (!code && !layout.values &&
        (made.meaning == DESCRIBED_STATE || made.meaning == DESCRIBED_LAW)) {
        code = described_name_states(l, made.meaning, frame->from_host, &layout);
    }
    layout.scale = made.scale;
    layout.offset = made.offset;
    layout.unit = described_unit(made.meaning);
    if (layout.unit && !*layout.unit) {
        layout.unit = NULL;
    }
    if (made.meaning == DESCRIBED_SET_POINT) {
        described_measure_set_point(l->made, &layout);
    }
    plan->layout[plan->nlayout++] = layout;
    plan->field[plan->nfield++] = made;
    plan->bit += (unsigned)raw->bits;
    return code;
}

/* Adds a hexadecimal payload: one constant per byte. */
static enum error_code described_add_payload(struct described_loader *l,
                                             const struct raw_described_frame *raw,
                                             struct described_plan *plan)
{
    const char *text = raw->payload;
    char name[16];

    /* Two digits make a byte; spaces separate bytes */
    while (*text) {
        struct field_value *only;
        unsigned byte;
        int used = 0;

        if (plan->bit == plan->bits || strspn(text, "0123456789abcdefABCDEF") != 2 ||
            sscanf(text, "%2x%n", &byte, &used) != 1) {
            return yaml_error(l->error, yaml_place(&raw->mark, "payload"),
                              "found payload \"%s\", expected up to %u bytes of two hexadecimal "
                              "digits each, as \"ff 00\"",
                              raw->payload, plan->bits / 8);
        }
        snprintf(name, sizeof name, "byte_%zu", plan->nfield);
        only = arena_alloc(l->arena, 2, sizeof *only);
        plan->layout[plan->nlayout].name = arena_strdup(l->arena, name);
        if (!only || !plan->layout[plan->nlayout].name) {
            return described_no_memory(l);
        }
        only[0] = (struct field_value){byte, "always"};
        plan->layout[plan->nlayout].type = FIELD_U8;
        plan->layout[plan->nlayout++].values = only;
        plan->field[plan->nfield] = (struct described_field){
            .meaning = DESCRIBED_CONSTANT, .constant = byte, .scale = 1.0, .times = -1};
        described_place(&plan->field[plan->nfield++], FIELD_U8, plan->bit, false);
        plan->bit += 8;
        text += used;
        text += strspn(text, " ");
    }
    return ERROR_NONE;
}

/* Sets the length of a frame: the length of its fields, or a longer one that the file gives. CAN FD
 * permits only certain lengths. Also sets the range of lengths that a board accepts. */
static enum error_code described_measure_length(struct described_loader *l,
                                                const struct raw_described_frame *raw,
                                                struct described_frame *made, unsigned bits)
{
    const unsigned most = raw->fd ? DESCRIBED_LENGTH_MAX : DESCRIBED_CLASSIC_MAX;
    const unsigned repeat = (unsigned)raw->repeat, least = (bits + 7) / 8;
    const bool group = made->by == DESCRIBED_BY_GROUP, repeats = group || repeat > 1;
    const bool given = yaml_has(&raw->mark, "length");
    const double *range = raw->lengths;
    unsigned length = given                 ? (unsigned)raw->length
                      : raw->fd && !repeats ? frame_fd_length(least)
                                            : least;

    if (given && length < least) {
        return yaml_error(l->error, yaml_place(&raw->mark, "length"),
                          "found length %u, expected at least the %u bytes of the fields", length,
                          least);
    }
    if (length > most || (given && raw->fd && !repeats && frame_fd_length(length) != length)) {
        return yaml_error(l->error, yaml_place(&raw->mark, "length"),
                          "found length %u, expected %s", length,
                          raw->fd ? "one of CAN FD: 0 to 8, 12, 16, 20, 24, 32, 48 or 64"
                                  : "at most 8, or fd: true for up to 64");
    }
    /* A host's frame repeats its fields for the slots of a group, a board's frame for its axes */
    if (repeat * length > most || (repeats && length == 0) ||
        (made->from_host
             ? (repeat > 1) != group
             : group || (repeats && (made->by != DESCRIBED_BY_ADDRESS ||
                                     made->of != DESCRIBED_MOTOR || repeat < l->made->axes)))) {
        return yaml_error(
            l->error, yaml_place(&raw->mark, "repeat"),
            "found repeat %u, expected it of a frame from the host with by: group, or from motor "
            "boards with by: address as many as the board has axes, %u bytes in all",
            repeat, most);
    }
    made->length = made->shortest = made->longest = (uint8_t)length;
    if (!yaml_has(&raw->mark, "lengths")) {
        return ERROR_NONE;
    }
    if (range[0] != rint(range[0]) || range[1] != rint(range[1]) || range[0] > length ||
        range[1] < length || range[1] > DESCRIBED_CLASSIC_MAX || raw->fd || made->remote ||
        repeat > 1) {
        return yaml_error(
            l->error, yaml_place(&raw->mark, "lengths"),
            "found lengths [%g, %g], expected whole numbers about the %u bytes of the frame, at "
            "most 8, of a classic frame that is not remote and not repeated",
            range[0], range[1], length);
    }
    made->shortest = (uint8_t)range[0];
    made->longest = (uint8_t)range[1];
    return ERROR_NONE;
}

/* Finds the first field of each meaning, the counter and the checksum. */
static enum error_code described_find_checks(struct described_loader *l,
                                             const struct raw_described_frame *raw,
                                             struct described_frame *made)
{
    memset(made->first, -1, sizeof made->first);
    for (size_t k = made->nfield; k-- > 0;) {
        const struct described_field *field = &made->field[k];
        enum described_meaning meaning = field->meaning;

        if (made->first[meaning] >= 0 &&
            (meaning == DESCRIBED_COUNTER || meaning == DESCRIBED_CHECKSUM)) {
            return yaml_error(l->error, &raw->mark, "found two %ss in frame \"%s\", expected one",
                              meaning == DESCRIBED_COUNTER ? "counter" : "checksum", made->name);
        }
        made->first[meaning] = (int8_t)k;
        made->nconstant += meaning == DESCRIBED_CONSTANT;
        if (meaning == DESCRIBED_CHECKSUM && k < made->ndata) {
            const struct raw_described_field *from = &raw->field[k];

            if (field->sign || from->bits != 8 || field->shift % 8) {
                return yaml_error(l->error, yaml_place(&from->mark, "checksum"),
                                  "found checksum of field \"%s\", expected one of a frame, a byte "
                                  "of its own without a sign",
                                  from->name);
            }
            made->checksum = (enum described_checksum)from->checksum;
            made->checksum_byte = (uint8_t)(field->end - 1);
        }
    }
    made->counter = described_find_field(made, DESCRIBED_COUNTER);
    if ((made->counter >= 0 || made->checksum) &&
        (made->repeats > 1 || yaml_has(&raw->mark, "lengths"))) {
        return yaml_error(
            l->error, yaml_place(&raw->mark, made->repeats > 1 ? "repeat" : "lengths"),
            "found repeat or lengths beside a counter or a checksum, expected one of them");
    }
    return ERROR_NONE;
}

/* ---- fields in the identifier ---- */

/* Lays out the fields of the identifier and appends them to the frame's fields. Constants set bits
 * of the base. Other fields set bits of the mask. */
static enum error_code described_lay_out_id(struct described_loader *l,
                                            const struct raw_described_frame *raw,
                                            struct described_frame *made)
{
    struct described_plan plan = {
        .layout = arena_alloc(l->arena, 2 * raw->nid_field + 3, sizeof *plan.layout),
        .other = made->layout,
        .field = made->field,
        .nfield = made->ndata,
        .bits = raw->extended ? 29 : 11,
    };
    uint32_t constant = 0;
    enum error_code code = ERROR_NONE;

    if (!plan.layout) {
        return described_no_memory(l);
    }
    if (made->repeats > 1 || made->remote) {
        return yaml_error(l->error, yaml_place(&raw->mark, "id_fields"),
                          "found id_fields of a frame with repeat or remote, expected none");
    }
    for (size_t i = 0; i < raw->nid_field; i++) {
        const struct raw_described_field *from = &raw->id_field[i];
        const struct described_field *field = &plan.field[plan.nfield];
        uint32_t bits;

        code = described_add_field(l, raw, from, &plan);
        if (code) {
            return code;
        }
        if (from->order || from->type == FIELD_FLOAT || from->checksum) {
            return yaml_error(
                l->error, &from->mark,
                "found a field of the identifier that is big-endian, a float or a checksum, "
                "expected a whole number, whose bits count from the least significant on");
        }
        bits = (uint32_t)(field->mask << field->shift);
        for (unsigned number = 0; number <= made->most; number++) {
            if (described_id(made, number) & bits) {
                return yaml_error(l->error, &from->mark,
                                  "found field \"%s\" in bits of the identifier that id or its "
                                  "number %u fills (0x%x), expected these to be 0 there",
                                  from->name, number, (unsigned)described_id(made, number));
            }
        }
        if (field->meaning == DESCRIBED_CONSTANT) {
            constant |= (uint32_t)field->constant << field->shift & bits;
        } else {
            made->mask |= bits;
        }
    }
    /* The layout must cover the whole identifier */
    described_add_gap(&plan, 32 - plan.bit);
    made->base |= constant;
    made->id_layout = plan.layout;
    made->nfield = plan.nfield;
    return ERROR_NONE;
}

enum error_code described_lay_out(struct described_loader *l, const struct raw_described_frame *raw,
                                  struct described_frame *made)
{
    size_t most = yaml_has(&raw->mark, "payload")      ? DESCRIBED_LENGTH_MAX
                  : raw->nfield < DESCRIBED_FIELDS_MAX ? raw->nfield
                                                       : DESCRIBED_FIELDS_MAX;
    struct described_plan plan = {
        .layout = arena_alloc(l->arena, 3 * most + 2 + GAPS_MAX, sizeof *plan.layout),
        .field = arena_alloc(l->arena, DESCRIBED_FIELDS_MAX, sizeof *plan.field),
        .bits = 8 * (raw->fd ? DESCRIBED_LENGTH_MAX : DESCRIBED_CLASSIC_MAX),
    };
    enum error_code code = ERROR_NONE;

    if (!plan.layout || !plan.field) {
        return described_no_memory(l);
    }
    if (yaml_has(&raw->mark, "payload") && raw->nfield > 0) {
        return yaml_error(l->error, yaml_place(&raw->mark, "payload"),
                          "found payload beside fields, expected one of them");
    }
    /* Add the constant payload, or the fields in order */
    code = yaml_has(&raw->mark, "payload") ? described_add_payload(l, raw, &plan) : ERROR_NONE;
    for (size_t i = 0; i < raw->nfield && !code; i++) {
        code = described_add_field(l, raw, &raw->field[i], &plan);
    }
    code = code ? code : described_measure_length(l, raw, made, plan.bit);
    if (code) {
        return code;
    }
    /* Fill the rest of the data with padding */
    described_add_gap(&plan, 8u * made->length - plan.bit);
    made->nfield = made->ndata = plan.nfield;
    made->layout = plan.layout;
    made->field = plan.field;
    /* Lay out the identifier, then check all fields */
    if (raw->nid_field > 0) {
        code = described_lay_out_id(l, raw, made);
    }
    code = code ? code : described_find_checks(l, raw, made);
    return code ? code : described_check_deflection(l, raw, made);
}

enum error_code described_lay_out_parameter(struct described_loader *l,
                                            const struct raw_described_parameter *from,
                                            struct described_parameter *parameter)
{
    const struct raw_described_field *raw = &from->field;
    struct described_field *made = &parameter->field;
    const bool targets = yaml_has(&raw->mark, "target");
    enum error_code code = described_check_word(l, &raw->mark, raw->name);

    *made = raw->field;
    parameter->name = raw->name;
    parameter->numbered = yaml_has(&from->mark, "number");
    parameter->number = (uint32_t)from->number;
    /* A parameter has no place in a frame, so it accepts no keys about the place */
    if (!code && (raw->counter || raw->checksum || yaml_has(&raw->mark, "at_bit") || raw->order ||
                  (raw->type == FIELD_FLOAT && raw->bits != 32))) {
        return yaml_error(l->error, &raw->mark,
                          "found a counter, a checksum, at_bit, order: big or a float of other "
                          "than 32 bits in a parameter, expected a source, a target or a value");
    }
    described_place(made, (unsigned)(raw->bits | raw->type), 0, false);
    code = code ? code : described_mean_field(l, targets, raw, made);
    made->meaning = made->meaning == DESCRIBED_CONSTANT ? DESCRIBED_STORED : made->meaning;
    parameter->writable = from->writable || targets || described_is_setting(made->meaning);
    if (!code &&
        (targets
             ? made->meaning <= DESCRIBED_SET_POINT || made->meaning >= DESCRIBED_TARGETS_END
             : from->writable && !described_is_setting(made->meaning) &&
                   made->meaning != DESCRIBED_STORED && made->meaning != DESCRIBED_LAW &&
                   made->meaning != DESCRIBED_ADDRESS && made->meaning != DESCRIBED_ANSWER_ID)) {
        return yaml_error(l->error, yaml_place(&raw->mark, targets ? "target" : "source"),
                          "found parameter \"%s\", which no host can write, expected a value, a "
                          "setting, law, address, answer_id, or the target of a law",
                          raw->name);
    }
    if (!code && (made->meaning == DESCRIBED_ECHO || made->meaning == DESCRIBED_PARAMETER_VALUE)) {
        return yaml_error(l->error, yaml_place(&raw->mark, "source"),
                          "found source: %s in a parameter, expected another: it is no answer",
                          made->meaning == DESCRIBED_ECHO ? "echo" : "parameter_value");
    }
    return code;
}
