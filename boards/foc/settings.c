/* SPDX-License-Identifier: Apache-2.0 */
/* The settings of a 2FOC board: gains of its laws as floats, limits of the current. */
#include "boards/foc/private.h"

#include "base/array.h"

#include <float.h>

enum kind { LAW_CURRENT, LAW_SPEED, LAW_POSITION, NOMINAL_CURRENT, PEAK_CURRENT };

enum { LIMIT_MAX_MA = 32767 };

#define LAW_MAX 32767.0 /* foc_law_set_gain */

static const struct {
    const char *name;
    enum kind kind;
    unsigned which; /* gain of a law */
} rows[] = {
    {"current_kp", LAW_CURRENT, FOC_LAW_KP},
    {"current_ki", LAW_CURRENT, FOC_LAW_KI},
    {"speed_kp", LAW_SPEED, FOC_LAW_KP},
    {"speed_ki", LAW_SPEED, FOC_LAW_KI},
    {"position_kp", LAW_POSITION, FOC_PID_KP},
    {"position_ki", LAW_POSITION, FOC_PID_KI},
    {"position_kd", LAW_POSITION, FOC_PID_KD},
    {"position_integral_limit", LAW_POSITION, FOC_PID_INTEGRAL_LIMIT},
    {"position_limit", LAW_POSITION, FOC_PID_OUTPUT_LIMIT},
    {"current_limit", NOMINAL_CURRENT, 0},
    {"current_peak", PEAK_CURRENT, 0},
};

/* Describes a setting: name, unit, range (struct board_settings). */
static void foc_setting_describe(const struct board *board, unsigned axis, size_t index,
                                 struct board_setting *setting)
{
    enum kind kind = rows[index].kind;
    bool is_limit = kind == NOMINAL_CURRENT || kind == PEAK_CURRENT;
    double most = is_limit ? LIMIT_MAX_MA : kind == LAW_POSITION ? (double)FLT_MAX : LAW_MAX;

    (void)board;
    (void)axis;
    *setting = (struct board_setting){
        .name = rows[index].name,
        .unit = is_limit ? "mA" : "",
        .min = is_limit ? 0.0 : -most,
        .max = most,
        .whole = is_limit,
    };
}

/* Returns the value of a setting (struct board_settings). */
static double foc_setting_get(const struct board *board, unsigned axis, size_t index)
{
    const struct foc_board *foc = foc_board_of(board);

    (void)axis;
    switch (rows[index].kind) {
    case LAW_CURRENT:
        return foc->current.gain[rows[index].which];
    case LAW_SPEED:
        return foc->speed.gain[rows[index].which];
    case LAW_POSITION:
        return (double)foc->position_law.gain[rows[index].which];
    case NOMINAL_CURRENT:
        return (double)foc->nominal_ma;
    case PEAK_CURRENT:
        return (double)foc->peak_ma;
    }
    return 0.0;
}

/* Writes a setting (struct board_settings). */
static bool foc_setting_set(struct board *board, unsigned axis, size_t index, double value)
{
    struct foc_board *foc = foc_board_of(board);

    (void)axis;
    switch (rows[index].kind) {
    case LAW_CURRENT:
        return foc_law_set_gain(&foc->current, rows[index].which, value);
    case LAW_SPEED:
        return foc_law_set_gain(&foc->speed, rows[index].which, value);
    case LAW_POSITION:
        foc->position_law.gain[rows[index].which] = (float)value;
        return true;
    case NOMINAL_CURRENT:
        foc->nominal_ma = (int64_t)value;
        return true;
    case PEAK_CURRENT:
        foc->peak_ma = (int64_t)value;
        return true;
    }
    return false;
}

const struct board_settings foc_settings = {
    .count = ARRAY_COUNT(rows),
    .describe = foc_setting_describe,
    .get = foc_setting_get,
    .set = foc_setting_set,
};
