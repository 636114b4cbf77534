/* SPDX-License-Identifier: Apache-2.0 */
/* Signals of a rig's DBC database, one a field. */
#include "rig/dbc_private.h"

/* ---- signals ---- */

/* Finds the joint or the component of a force-torque sensor that a field is about. */
static void dbc_find_subject(const struct dbc_exporter *e, struct dbc_field *p)
{
    static const char *const components[] = {"fx", "fy", "fz", "mx", "my", "mz"};
    const struct field_subject *subject = &p->subject;
    const struct board_config *board = dbc_message_board(e, p->of.message);
    int joint;

    boards_describe_field(&e->rig->boards, (int)e->bus, &p->of, &p->subject);
    joint = subject->axis ? subject->axis->joint : -1;
    p->quantity = p->of.field->name;
    if (subject->channel >= 0 && board->kind == BOARD_TORQUE) {
        joint = board->torque_joint[subject->channel];
        p->quantity = "torque";
    }
    p->joint = joint >= 0 ? e->rig->robot->joint[joint].name : NULL;
    p->component =
        subject->channel >= 0 && board->kind == BOARD_FT ? components[subject->channel] : NULL;
}

/* Comments a signal with the joint or the force-torque sensor that it is about. */
static void dbc_comment_signal(struct dbc_exporter *e, const struct dbc_field *p,
                               struct dbc_signal *signal)
{
    const struct board_config *board = dbc_message_board(e, p->of.message);

    if (p->joint) {
        e->code = dbc_set_comment(e->dbc, &signal->comment, p->joint, e->error);
    } else if (p->component) {
        e->code =
            dbc_set_comment(e->dbc, &signal->comment, e->rig->robot->ft[board->ft].name, e->error);
    }
}

uint64_t dbc_message_receivers(const struct dbc_exporter *e, const struct message *message)
{
    uint64_t nodes = 0;

    if (!message->from_host) {
        return UINT64_C(1) << HOST;
    }
    if (message->receiver != MESSAGE_NO_BOARD) {
        return UINT64_C(1) << dbc_board_node(e, message->receiver);
    }
    for (size_t i = FIRST_BOARD; i < e->dbc->nnode; i++) {
        nodes |= UINT64_C(1) << i;
    }
    return nodes;
}

/* Adds a field as a signal, with its range, named values and comment. */
static void dbc_export_signal(struct dbc_exporter *e, struct dbc_message *to,
                              const struct dbc_field *p)
{
    const struct field *field = p->of.field;
    bool limited = field->min || field->max, big = field->type & FIELD_BIG_ENDIAN;
    const struct field_subject *measure = &p->subject;
    char name[NAME_SIZE];
    struct dbc_signal *added,
        signal = {
            .name = name,
            .role = p->of.code == MESSAGE_NO_CODE ? DBC_PLAIN : DBC_MULTIPLEXED,
            .selector = p->of.code == MESSAGE_NO_CODE ? 0 : (uint32_t)p->of.code,
            .start = (uint16_t)(big ? p->bit ^ 7 : p->bit),
            .bits = (uint8_t)(field->type & FIELD_BITS_MASK),
            .big_endian = big,
            .type = field->type & FIELD_FLOAT    ? DBC_FLOAT
                    : field->type & FIELD_SIGNED ? DBC_SIGNED
                                                 : DBC_UNSIGNED,
            .scale = measure->scale,
            .offset = measure->offset,
            .unit = measure->unit,
            .receivers = dbc_message_receivers(e, p->of.message),
            .frame_length = p->of.message->length == to->length ? 0 : p->of.message->length,
        };

    /* The range in the signal's unit; a float has none */
    if (signal.type != DBC_FLOAT) {
        double low = (double)(limited ? field->min : field_lowest(field));
        double high = (double)(limited ? field->max : field_highest(field));

        signal.min = low * measure->scale + measure->offset;
        signal.max = high * measure->scale + measure->offset;
    }

    dbc_make_signal_name(e, to, p, name);
    e->code = dbc_add_signal(e->dbc, to, &signal, &added, e->error);
    for (const struct field_value *v = field->values; !e->code && v && v->name; v++) {
        e->code = dbc_add_value(e->dbc, added, v->value, v->name, e->error);
    }
    if (!e->code) {
        dbc_comment_signal(e, p, added);
    }
}

void dbc_export_fields(struct dbc_exporter *e, struct dbc_message *to,
                       const struct message *message, int command)
{
    struct dbc_field p = {.of = {.message = message, .code = command},
                          .bit = 8u * message->first_byte};

    for (p.of.repeat = 0; p.of.repeat < message->repeats; p.of.repeat++) {
        const struct field *field = message->fields;

        for (; !e->code && field && field->type != FIELD_END; field++) {
            if (!(field->type & FIELD_PADDING)) {
                p.of.field = field;
                dbc_find_subject(e, &p);
                dbc_export_signal(e, to, &p);
                p.of.index++;
            }
            p.bit += field->type & FIELD_BITS_MASK;
        }
    }
}
