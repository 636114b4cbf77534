/* SPDX-License-Identifier: Apache-2.0 */
/* Signals of a rig's DBC database: which axis and joint a field is about, and the unit and scale
 * of its counts. */
#include "boards/compact/protocol.h"
#include "boards/foc/protocol.h"
#include "rig/dbc_private.h"

#include <math.h>
#include <string.h>

enum { NO_AXIS = -1 };

/* ---- which axis a field is about ---- */

/* The axis of icub telemetry is the digit that ends its name; characters of a text are c and a
 * digit. */
static int icub_field_axis(const struct dbc_field *p)
{
    size_t size = strlen(p->field->name);
    char last = p->field->name[size - 1];

    if (p->command != MESSAGE_NO_CODE) {
        return p->command >= AXIS_BIT;
    }
    return size > 2 && (last == '0' || last == '1') ? last - '0' : NO_AXIS;
}

/* The axis of a slot of the bus; NULL = none. */
static const struct board_axis_config *dbc_slot_axis(const struct dbc_exporter *e, int slot)
{
    const struct boards_config *boards = &e->rig->boards;

    for (size_t i = 0; i < boards->nboard; i++) {
        const struct board_config *board = &boards->board[i];
        int k = slot - dbc_first_slot(e, board);

        if (board->bus == (int)e->bus && board->kind == BOARD_MOTOR && k >= 0 &&
            k < BOARD_AXES_MAX && board->axis[k].joint >= 0) {
            return &board->axis[k];
        }
    }
    return NULL;
}

/* The axis of a foc board by address; NULL = none. */
static const struct board_axis_config *dbc_address_axis(const struct dbc_exporter *e, int address)
{
    const struct boards_config *boards = &e->rig->boards;

    for (size_t i = 0; i < boards->nboard; i++) {
        if (boards->board[i].bus == (int)e->bus && boards->board[i].kind == BOARD_MOTOR &&
            boards->board[i].address == address) {
            return &boards->board[i].axis[0];
        }
    }
    return NULL;
}

/* The axis that a field is about; NULL = none. */
static const struct board_axis_config *dbc_field_axis(const struct dbc_exporter *e,
                                                      const struct dbc_field *p)
{
    const struct message *message = p->message;
    const struct board_config *board = dbc_message_board(e, message);
    int slot = message->slot, axis;

    switch (e->personality) {
    case BOARD_ICUB:
        axis = dbc_is_icub_motor(e, message) ? icub_field_axis(p) : NO_AXIS;
        return axis == NO_AXIS ? NULL : &board->axis[axis];
    case BOARD_FOC:
        return !board ? dbc_address_axis(e, p->index + 1)
               : board->kind == BOARD_MOTOR && message->id >> 8 != ICUB_MANAGEMENT ? &board->axis[0]
                                                                                   : NULL;
    default:
        if (e->personality == BOARD_DESCRIBED) {
            slot += slot < 0 ? 0 : p->repeat;
        } else if (dbc_is_list(e, message)) {
            slot = p->repeat +
                   (board ? dbc_first_slot(e, board) : (int)(message->id & 0x1f) * COMPACT_GROUP);
        }
        return slot < 0 ? NULL : dbc_slot_axis(e, slot);
    }
}

/* ---- units and scales ---- */

struct measure {
    double scale, offset;
    const char *unit;
};

/* Channel of a calibrated STRAIN frame; -1 = it is none. */
static int dbc_strain_channel(const struct dbc_exporter *e, const struct dbc_field *p)
{
    const struct board_config *board = dbc_message_board(e, p->message);
    unsigned type = p->message->id & 0xf;

    return (e->personality == BOARD_ICUB || e->personality == BOARD_FOC) && board &&
                   board->kind != BOARD_MOTOR && p->message->id >> 8 == ICUB_PERIODIC_ANALOG &&
                   (type == ICUB_FORCE || type == ICUB_TORQUE)
               ? p->index + (type == ICUB_TORQUE ? 3 : 0)
               : -1;
}

static struct measure dbc_field_measure(const struct dbc_exporter *e, const struct dbc_field *p)
{
    const struct board_axis_config *axis = dbc_field_axis(e, p);
    const struct board_config *board = dbc_message_board(e, p->message);
    const char *unit = p->field->unit ? p->field->unit : "";
    double rotor = axis && axis->gear > 0.0 ? 2.0 * M_PI / FOC_ICUBDEG_PER_REV / axis->gear : 0.0;
    double ticks = !axis || axis->joint < 0 ? 0.0
                   : p->message->id >> 8 == ICUB_PERIODIC_MOTOR &&
                           (p->message->id & 0xf) == ICUB_MOTOR_POSITION
                       ? axis->motor_ticks_per_rad
                       : axis->joint_ticks_per_rad;
    int channel = dbc_strain_channel(e, p);

    /* Channels of calibrated STRAIN frames: offset binary over the full scale */
    if (channel >= 0 && board->full_scale[channel] > 0.0) {
        return (struct measure){board->full_scale[channel] / ICUB_STRAIN_ZERO,
                                -board->full_scale[channel],
                                board->kind == BOARD_FT && channel < 3 ? "N" : "Nm"};
    }

    /* Quantities of the iCub boards, scaled by the axis that the field belongs to */
    if (e->personality == BOARD_ICUB && !strcmp(unit, "pwm")) {
        return (struct measure){100.0 / ICUB_PWM_FULL_SCALE, 0.0, "%"};
    }
    if (e->personality == BOARD_ICUB && !strcmp(unit, "tick") && ticks > 0.0) {
        return (struct measure){1.0 / ticks, 0.0, "rad"};
    }
    if (rotor > 0.0 && !strcmp(unit, "icubdeg")) {
        return (struct measure){rotor, 0.0, "rad"};
    }
    if (rotor > 0.0 && !strcmp(unit, "icubdeg/ms")) {
        return (struct measure){1e3 * rotor, 0.0, "rad/s"};
    }

    /* All others as their table says */
    return (struct measure){p->field->scale != 0.0 ? p->field->scale : 1.0, p->field->offset, unit};
}

/* ---- signals ---- */

/* Finds the joint or the component of a force-torque sensor that a field is about. */
static void dbc_find_subject(const struct dbc_exporter *e, struct dbc_field *p)
{
    static const char *const components[] = {"fx", "fy", "fz", "mx", "my", "mz"};
    const struct board_axis_config *axis = dbc_field_axis(e, p);
    const struct board_config *board = dbc_message_board(e, p->message);
    int channel = dbc_strain_channel(e, p), joint = axis ? axis->joint : -1;

    p->quantity = p->field->name;
    if (channel >= 0 && board->kind == BOARD_TORQUE) {
        joint = board->torque_joint[channel];
        p->quantity = "torque";
    }
    p->joint = joint >= 0 ? e->rig->robot->joint[joint].name : NULL;
    p->component = channel >= 0 && board->kind == BOARD_FT ? components[channel] : NULL;
}

/* Comments a signal with the joint or the force-torque sensor that it is about. */
static void dbc_comment_signal(struct dbc_exporter *e, const struct dbc_field *p,
                               struct dbc_signal *signal)
{
    const struct board_config *board = dbc_message_board(e, p->message);

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

static void dbc_export_signal(struct dbc_exporter *e, struct dbc_message *to,
                              const struct dbc_field *p)
{
    const struct field *field = p->field;
    bool limited = field->min || field->max, big = field->type & FIELD_BIG_ENDIAN;
    struct measure measure = dbc_field_measure(e, p);
    char name[NAME_SIZE];
    struct dbc_signal *added,
        signal = {
            .name = name,
            .role = p->command == MESSAGE_NO_CODE ? DBC_PLAIN : DBC_MULTIPLEXED,
            .selector = p->command == MESSAGE_NO_CODE ? 0 : (uint32_t)p->command,
            .start = (uint16_t)(big ? p->bit - p->bit % 8 + 7 - p->bit % 8 : p->bit),
            .bits = (uint8_t)(field->type & FIELD_BITS_MASK),
            .big_endian = big,
            .type = field->type & FIELD_FLOAT    ? DBC_FLOAT
                    : field->type & FIELD_SIGNED ? DBC_SIGNED
                                                 : DBC_UNSIGNED,
            .scale = measure.scale,
            .offset = measure.offset,
            .unit = measure.unit,
            .receivers = dbc_message_receivers(e, p->message),
            .frame_length = p->message->length == to->length ? 0 : p->message->length,
        };

    /* The range in the signal's unit; a float has none */
    if (signal.type != DBC_FLOAT) {
        double low = (double)(limited ? field->min : field_lowest(field));
        double high = (double)(limited ? field->max : field_highest(field));

        signal.min = low * measure.scale + measure.offset;
        signal.max = high * measure.scale + measure.offset;
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
    struct dbc_field p = {.message = message, .bit = 8u * message->first_byte, .command = command};

    for (p.repeat = 0; p.repeat < message->repeats; p.repeat++) {
        for (p.field = message->fields; !e->code && p.field && p.field->type != FIELD_END;
             p.field++) {
            if (!(p.field->type & FIELD_PADDING)) {
                dbc_find_subject(e, &p);
                dbc_export_signal(e, to, &p);
                p.index++;
            }
            p.bit += p.field->type & FIELD_BITS_MASK;
        }
    }
}
