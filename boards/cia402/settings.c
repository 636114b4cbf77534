/* SPDX-License-Identifier: Apache-2.0 */
/* Settings of an axis that can also be changed beside the bus: they are objects of the
 * dictionary. */
#include "boards/cia402/private.h"

#include "base/array.h"

static const struct {
    const char *name, *unit;
    uint16_t index;
    uint8_t sub;
} rows[] = {
    {"current_kp", "mV/A", 0x4014, 1},
    {"current_ki", "mV/(A s)", 0x4014, 2},
    {"back_emf", "mV s/rad", 0x4014, 3},
    {"velocity_kp", "mV s/rad", 0x4015, 1},
    {"velocity_ki", "mV/rad", 0x4015, 2},
    {"position_ki", "mV/rad", 0x4015, 3},
    {"position_kp", "0.1/s", 0x4016, 0},
    {"current_limit", "mA", 0x4012, 0},
    {"temperature_limit", "degree C", 0x4013, 0},
};

/* Returns the highest value of a limit that the board's configuration allows. */
static int64_t cia402_most(const struct board *board, unsigned axis,
                           const struct cia402_object *object)
{
    const struct board_axis_config *config = &board->config.axis[axis];
    int64_t most = cia402_highest(object);

    if (object->index == 0x4012) {
        most = cia402_counts(config->current_limit_a, 1e-3);
    } else if (object->index == 0x4013 && config->temperature_limit_c > 0.0) {
        most = control_clamp(cia402_counts(config->temperature_limit_c, 1.0), 1, most);
    }
    return most;
}

enum cia402_abort cia402_axis_write_limit(struct cia402_node *node,
                                          const struct cia402_entry *entry, int64_t value)
{
    if (value > cia402_most(&node->board, entry->unit, entry->object)) {
        return CIA402_ABORT_TOO_HIGH;
    }
    return cia402_axis_write_when_off(node, entry, value);
}

/* Returns the object of a setting. */
static struct cia402_entry cia402_setting_entry(unsigned axis, size_t index)
{
    const struct cia402_object *object = cia402_object_at(rows[index].index, rows[index].sub);

    return (struct cia402_entry){object, rows[index].sub, (uint8_t)axis, 0, object->type};
}

/* Describes a setting (struct board_settings). */
static void cia402_setting_describe(const struct board *board, unsigned axis, size_t index,
                                    struct board_setting *setting)
{
    const struct cia402_entry entry = cia402_setting_entry(axis, index);

    *setting = (struct board_setting){.name = rows[index].name,
                                      .unit = rows[index].unit,
                                      .min = (double)cia402_lowest(entry.object),
                                      .max = (double)cia402_most(board, axis, entry.object),
                                      .whole = true};
}

/* Returns the value of a setting (struct board_settings). */
static double cia402_setting_get(const struct board *board, unsigned axis, size_t index)
{
    const struct cia402_entry entry = cia402_setting_entry(axis, index);

    return (double)cia402_value(cia402_node_of(board), &entry);
}

/* Sets a setting (struct board_settings). */
static bool cia402_setting_set(struct board *board, unsigned axis, size_t index, double value)
{
    const struct cia402_entry entry = cia402_setting_entry(axis, index);

    *cia402_field(cia402_node_of(board), &entry) = (int64_t)value;
    return true;
}

const struct board_settings cia402_settings = {
    .count = ARRAY_COUNT(rows),
    .describe = cia402_setting_describe,
    .get = cia402_setting_get,
    .set = cia402_setting_set,
};
