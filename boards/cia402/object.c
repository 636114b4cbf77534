/* SPDX-License-Identifier: Apache-2.0 */
/* Finds, reads and writes objects of a node's dictionary. */
#include "boards/cia402/private.h"

#include "canbus/frame.h"

#include <stdio.h>
#include <string.h>

enum { PDO_MASK = 0x1ff, FIRST_PDO = 0x1400, LAST_PDO = 0x1bff, FIRST_OF_AXES = 0x4000 };

/* ---- which object ---- */

/* Splits an index into that of axis 0 or of the first PDO, and the number of the axis or PDO (as
 * a place in the node's arrays); false: the node has none such. */
static bool cia402_split_index(const struct cia402_node *node, unsigned *index, unsigned *unit)
{
    *unit = 0;
    if (*index >= FIRST_PDO && *index <= LAST_PDO) {
        unsigned number = *index & PDO_MASK, of_axis = number % CIA402_PDO_STEP;

        *index &= ~(unsigned)PDO_MASK;
        *unit = number / CIA402_PDO_STEP * CIA402_AXIS_PDOS + of_axis;
        return of_axis < CIA402_AXIS_PDOS && *unit < cia402_pdos(node);
    }
    if (*index >= FIRST_OF_AXES && node->axes > 0) {
        unsigned first = *index < 0x6000 ? 0x4000 : 0x6000;

        *unit = (*index - first) / CIA402_AXIS_STEP;
        *index = first + (*index - first) % CIA402_AXIS_STEP;
        return *unit < node->axes;
    }
    return true;
}

/* Returns the end of the sub-indices of a row that a node has. */
static unsigned cia402_row_end(const struct cia402_node *node, const struct cia402_object *object)
{
    unsigned count = object->count;

    if (object->scope == CIA402_OF_SENSOR && object->count > 1) {
        count = (unsigned)node->sensor->channels;
    }
    return object->sub + count;
}

/* Returns whether a node has the objects of a row's scope. */
static bool cia402_node_has(const struct cia402_node *node, const struct cia402_object *object)
{
    return object->scope == CIA402_OF_AXIS     ? node->axes > 0
           : object->scope == CIA402_OF_SENSOR ? node->sensor != NULL
                                               : true;
}

/* Returns the highest sub-index of an index; 0: there is no such index. */
static unsigned cia402_highest_sub(const struct cia402_node *node, unsigned index)
{
    unsigned highest = 0;

    for (size_t i = 0; i < cia402_object_count; i++) {
        const struct cia402_object *object = &cia402_objects[i];

        if (object->index == index && cia402_node_has(node, object)) {
            highest = cia402_row_end(node, object) - 1;
        }
    }
    return highest;
}

/* Returns whether an index exists, with sub-index 0 only or more. */
static bool cia402_has_index(const struct cia402_node *node, unsigned index)
{
    const struct cia402_object *object = cia402_object_at(index, 0);

    return (object && cia402_node_has(node, object)) || cia402_highest_sub(node, index) > 0;
}

enum cia402_abort cia402_find(const struct cia402_node *node, unsigned index, unsigned sub,
                              struct cia402_entry *entry)
{
    const struct cia402_object *object;
    unsigned unit;

    if (!cia402_split_index(node, &index, &unit)) {
        return CIA402_ABORT_NO_OBJECT;
    }
    object = cia402_object_at(index, sub);
    if (object && cia402_node_has(node, object) && sub < cia402_row_end(node, object)) {
        *entry = (struct cia402_entry){object, (uint8_t)sub, (uint8_t)unit, 0, object->type};
        return CIA402_DONE;
    }
    if (!cia402_has_index(node, index)) {
        return CIA402_ABORT_NO_OBJECT;
    }

    /* Sub-index 0 of an array or a record counts the others */
    if (sub == 0) {
        *entry = (struct cia402_entry){.value = cia402_highest_sub(node, index), .type = CIA402_U8};
        return CIA402_DONE;
    }
    return CIA402_ABORT_NO_SUB_INDEX;
}

/* ---- its value ---- */

/* Returns the place of an object's value, of sub-index 0 of its row. */
static void *cia402_place(const struct cia402_node *node, const struct cia402_entry *entry)
{
    const struct cia402_object *object = entry->object;
    struct cia402_node *own = cia402_node_of(&node->board);
    char *base = (char *)own;

    switch (object->scope) {
    case CIA402_OF_AXIS:
        base = (char *)&node->axis[entry->unit];
        break;
    case CIA402_OF_RPDO:
        base = (char *)&own->settings.rpdo[entry->unit];
        break;
    case CIA402_OF_TPDO:
        base = (char *)&own->settings.tpdo[entry->unit];
        break;
    case CIA402_OF_SENSOR:
        base = (char *)node->sensor;
        break;
    default:
        break;
    }
    return base + object->offset;
}

int64_t *cia402_field(const struct cia402_node *node, const struct cia402_entry *entry)
{
    return (int64_t *)cia402_place(node, entry) + (entry->sub - entry->object->sub);
}

char *cia402_text(const struct cia402_node *node, const struct cia402_entry *entry)
{
    return cia402_place(node, entry);
}

struct cia402_domain *cia402_domain(const struct cia402_node *node,
                                    const struct cia402_entry *entry)
{
    return cia402_place(node, entry);
}

int64_t cia402_value(const struct cia402_node *node, const struct cia402_entry *entry)
{
    return entry->object ? *cia402_field(node, entry) : entry->value;
}

enum cia402_abort cia402_write(struct cia402_node *node, const struct cia402_entry *entry,
                               int64_t value)
{
    const struct cia402_object *object = entry->object;

    if (!object || (object->access & CIA402_ACCESS_MASK) < CIA402_RW) {
        return CIA402_ABORT_READ_ONLY;
    }
    if (value > cia402_highest(object)) {
        return CIA402_ABORT_TOO_HIGH;
    }
    if (value < cia402_lowest(object)) {
        return CIA402_ABORT_TOO_LOW;
    }
    if (object->write) {
        return object->write(node, entry, value);
    }
    *cia402_field(node, entry) = value;
    return CIA402_DONE;
}

bool cia402_cob_is_restricted(unsigned id)
{
    return id < 0x080 || (id > 0x100 && id <= 0x180) || (id > 0x580 && id < 0x600) ||
           (id > 0x600 && id < 0x680) || id >= 0x6e0;
}

enum cia402_abort cia402_write_cob(struct cia402_node *node, const struct cia402_entry *entry,
                                   int64_t value)
{
    /* No generator of SYNC, no extended identifiers */
    if (value & ~(int64_t)(CIA402_COB_INVALID | CIA402_COB_MASK) ||
        cia402_cob_is_restricted((unsigned)value & CIA402_COB_MASK)) {
        return CIA402_ABORT_VALUE;
    }
    *cia402_field(node, entry) = value;
    return CIA402_DONE;
}

/* Writes the COB-ID of EMCY; that of a valid object cannot change (CiA 301, 7.5.2.17). */
enum cia402_abort cia402_write_emcy_cob(struct cia402_node *node, const struct cia402_entry *entry,
                                        int64_t value)
{
    int64_t now = *cia402_field(node, entry);

    if (!((now | value) & CIA402_COB_INVALID) && (now ^ value) & CIA402_COB_MASK) {
        return CIA402_ABORT_VALUE;
    }
    return cia402_write_cob(node, entry, value);
}

/* ---- bytes ---- */

int64_t cia402_get(enum cia402_type type, const uint8_t *data)
{
    switch (type) {
    case CIA402_I8:
        return (int8_t)data[0];
    case CIA402_U8:
        return data[0];
    case CIA402_I16:
        return get_i16_le(data);
    case CIA402_U16:
        return get_u16_le(data);
    case CIA402_I32:
        return get_i32_le(data);
    default:
        return get_u32_le(data);
    }
}

/* Writes a value in little-endian bytes, held within the type: a measured value may exceed it. */
void cia402_put(enum cia402_type type, int64_t value, uint8_t *data)
{
    const struct cia402_object bounds = {.type = type};

    value = control_clamp(value, cia402_lowest(&bounds), cia402_highest(&bounds));
    for (unsigned i = 0; i < cia402_type_bits(type) / 8; i++) {
        data[i] = (uint8_t)((uint64_t)value >> 8 * i);
    }
}

/* ---- the factory's values ---- */

/* Sets the initial values of a row, for an axis or a PDO. */
static void cia402_set_initial(struct cia402_node *node, const struct cia402_object *object,
                               unsigned unit)
{
    for (unsigned sub = object->sub; sub < cia402_row_end(node, object); sub++) {
        const struct cia402_entry entry = {object, (uint8_t)sub, (uint8_t)unit, 0, object->type};
        int64_t plus = object->access & CIA402_PLUS_NODE ? node->board.address : 0;

        if (object->type == CIA402_TEXT) {
            memset(cia402_text(node, &entry), 0, CIA402_TEXT_MAX + 1);
        } else if (object->type == CIA402_DOMAIN) {
            memset(cia402_domain(node, &entry), 0, sizeof(struct cia402_domain));
        } else {
            *cia402_field(node, &entry) = object->initial + plus;
        }
    }
}

/* Sets the identity of a node: vendor, product, revision and serial number. */
static void cia402_set_identity(struct cia402_node *node)
{
    static const char *const kinds[] = {"drive", "force-torque sensor", "inertial sensor"};
    const struct board_identity *identity = &node->board.ops->identity;

    node->device_type = node->axes > 1    ? CIA402_DEVICE_DRIVES
                        : node->axes == 1 ? CIA402_DEVICE_DRIVE
                                          : CIA402_DEVICE_SENSOR;
    node->identity[1] = 0x48494c00 + node->kind; /* vendor 0: none */
    node->identity[2] = identity->major << 16 | identity->minor;
    node->identity[3] = (int64_t)(node->board.config.bus & 0xff) << 8 | node->board.config.address;
    snprintf(node->device, sizeof node->device, "coman-hil %s", kinds[node->kind]);
    snprintf(node->hardware, sizeof node->hardware, "simulated");
    snprintf(node->software, sizeof node->software, "%d.%d.%d", identity->major, identity->minor,
             identity->build);
}

void cia402_set_factory(struct cia402_node *node)
{
    /* Initial values of the table */
    for (size_t i = 0; i < cia402_object_count; i++) {
        const struct cia402_object *object = &cia402_objects[i];
        unsigned units = object->scope == CIA402_OF_AXIS ? node->axes
                         : object->scope == CIA402_OF_RPDO || object->scope == CIA402_OF_TPDO
                             ? CIA402_PDOS
                             : cia402_node_has(node, object);

        for (unsigned unit = 0; unit < units; unit++) {
            cia402_set_initial(node, object, unit);
        }
    }
    /* Values of the board's configuration */
    for (unsigned k = 0; k < node->axes; k++) {
        cia402_axis_set_factory(&node->axis[k], &node->board.config.axis[k], &node->board.config);
    }
    if (node->sensor) {
        node->sensor->channels = node->kind == CIA402_KIND_FT ? 6 : CIA402_SENSOR_CHANNELS;
    }
    cia402_set_identity(node);
    cia402_pdo_set_factory(node);
}
