/* SPDX-License-Identifier: Apache-2.0 */
/* The parameters of a compact motor board: over the bus, and as settings beside it. */
#include "boards/compact/private.h"

#include "base/array.h"

enum { GAIN_MAX = 1000000000 };

/* Finds a setting and its range; returns false when there is no such setting. */
static bool compact_axis_find_setting(const struct board *board, struct compact_axis *axis,
                                      unsigned parameter, int64_t **setting, int64_t *least,
                                      int64_t *most)
{
    struct compact_axis_settings *p = &axis->settings;
    const struct board_axis_config *config = &board->config.axis[compact_axis_index(board, axis)];

    /* Gains; limits have ranges of their own, within those of the board's configuration */
    *least = 0;
    *most = GAIN_MAX;
    switch (parameter) {
    case COMPACT_P_CURRENT_LIMIT:
        *setting = &p->current_limit_ma;
        *least = 1;
        *most = compact_counts(config->current_limit_a, 1e-3);
        return true;
    case COMPACT_P_MIN_POSITION:
        *setting = &p->min_position;
        *least = INT32_MIN;
        *most = p->max_position;
        return true;
    case COMPACT_P_MAX_POSITION:
        *setting = &p->max_position;
        *least = p->min_position;
        *most = INT32_MAX;
        return true;
    case COMPACT_P_CURRENT_KP:
        *setting = &p->current_kp;
        return true;
    case COMPACT_P_CURRENT_KI:
        *setting = &p->current_ki;
        return true;
    case COMPACT_P_BACK_EMF:
        *setting = &p->back_emf;
        return true;
    case COMPACT_P_TEMPERATURE_LIMIT:
        *setting = &p->temperature_limit_c;
        *least = 1;
        *most = compact_temperature_limit(config);
        return true;
    default:
        return false;
    }
}

/* Reads or writes a parameter of an axis; settings are written only while the axis is off. */
static enum compact_result compact_axis_access_parameter(struct board *board,
                                                         struct compact_axis *axis,
                                                         unsigned parameter, bool write,
                                                         int64_t *value)
{
    int64_t *setting, least, most, wanted = *value;

    if (parameter == COMPACT_P_MODE || parameter == COMPACT_P_FAULTS) {
        *value = parameter == COMPACT_P_MODE ? (int64_t)axis->mode : axis->faults;
        return write ? COMPACT_READ_ONLY : COMPACT_OK;
    }
    if (!compact_axis_find_setting(board, axis, parameter, &setting, &least, &most)) {
        return COMPACT_UNKNOWN_PARAMETER;
    }
    *value = *setting;
    if (!write) {
        return COMPACT_OK;
    }
    if (compact_axis_runs(axis)) {
        return COMPACT_NOT_NOW;
    }
    if (wanted < least || wanted > most) {
        return COMPACT_OUT_OF_RANGE;
    }
    *value = *setting = wanted;
    compact_motor_of(board)->node.is_saved = false;
    board->boards->settings_changes++;
    return COMPACT_OK;
}

/* Returns whether an axis is on. */
static bool compact_motor_any_runs(const struct compact_motor *motor)
{
    for (unsigned i = 0; i < motor->axes; i++) {
        if (compact_axis_runs(&motor->axis[i])) {
            return true;
        }
    }
    return false;
}

enum compact_result compact_motor_access_parameter(struct compact_node *node, unsigned parameter,
                                                   unsigned index, bool write, int64_t *value)
{
    struct board *board = &node->board;
    struct compact_motor *motor = compact_motor_of(board);
    enum compact_result result;

    /* Parameters of an axis, then those of the board, of which SAVE keeps the axes' settings too */
    if (parameter >= COMPACT_P_MODE && parameter <= COMPACT_P_TEMPERATURE_LIMIT) {
        return index < motor->axes ? compact_axis_access_parameter(board, &motor->axis[index],
                                                                   parameter, write, value)
                                   : COMPACT_NO_SUCH_AXIS;
    }
    if (write && parameter == COMPACT_P_RESTART && compact_motor_any_runs(motor)) {
        *value = 0;
        return COMPACT_NOT_NOW;
    }
    result = compact_node_access_parameter(node, parameter, write, value);
    for (unsigned i = 0;
         result == COMPACT_OK && write && parameter == COMPACT_P_SAVE && i < motor->axes; i++) {
        motor->axis[i].saved = motor->axis[i].settings;
    }
    return result;
}

/* ---- settings beside the bus ---- */

static const struct {
    const char *name;
    enum compact_parameter parameter;
    const char *unit;
} rows[] = {
    {"current_kp", COMPACT_P_CURRENT_KP, "mV/A"},
    {"current_ki", COMPACT_P_CURRENT_KI, "mV/(A s)"},
    {"back_emf", COMPACT_P_BACK_EMF, "mV s/rad"},
    {"current_limit", COMPACT_P_CURRENT_LIMIT, "mA"},
    {"temperature_limit", COMPACT_P_TEMPERATURE_LIMIT, "degree C"},
};

/* Returns a setting by its row, with its range. */
static int64_t *compact_setting_at(const struct board *board, unsigned axis, size_t index,
                                   int64_t *least, int64_t *most)
{
    int64_t *setting = NULL;

    compact_axis_find_setting(board, &compact_motor_of(board)->axis[axis], rows[index].parameter,
                              &setting, least, most);
    return setting;
}

/* Describes a setting: name, unit, range (struct board_settings). */
static void compact_setting_describe(const struct board *board, unsigned axis, size_t index,
                                     struct board_setting *setting)
{
    int64_t least, most;

    compact_setting_at(board, axis, index, &least, &most);
    *setting = (struct board_setting){.name = rows[index].name,
                                      .unit = rows[index].unit,
                                      .min = (double)least,
                                      .max = (double)most,
                                      .whole = true};
}

/* Returns the value of a setting (struct board_settings). */
static double compact_setting_get(const struct board *board, unsigned axis, size_t index)
{
    int64_t least, most;

    return (double)*compact_setting_at(board, axis, index, &least, &most);
}

/* Writes a setting, also while the axis runs (struct board_settings). */
static bool compact_setting_set(struct board *board, unsigned axis, size_t index, double value)
{
    int64_t least, most;

    *compact_setting_at(board, axis, index, &least, &most) = (int64_t)value;
    compact_motor_of(board)->node.is_saved = false;
    return true;
}

const struct board_settings compact_settings = {
    .count = ARRAY_COUNT(rows),
    .describe = compact_setting_describe,
    .get = compact_setting_get,
    .set = compact_setting_set,
};
