/* SPDX-License-Identifier: Apache-2.0 */
/* The settings of an iCub motor board's axes: what commands of class 0 set, with their ranges. */
#include "boards/icub/motor_private.h"

#include "base/array.h"

/* One value of the command that sets it. */
static const struct {
    const char *name;
    uint8_t code;
    uint8_t field;
} rows[] = {
    {"position_kp", ICUB_SET_P_GAIN, 0},
    {"position_ki", ICUB_SET_I_GAIN, 0},
    {"position_kd", ICUB_SET_D_GAIN, 0},
    {"position_shift", ICUB_SET_SCALE, 0},
    {"position_offset", ICUB_SET_OFFSET, 0},
    {"position_limit", ICUB_SET_OUTPUT_LIMIT, 0},
    {"position_integral_limit", ICUB_SET_I_LIMIT, 0},
    {"torque_kp", ICUB_SET_TORQUE_PID, 0},
    {"torque_ki", ICUB_SET_TORQUE_PID, 1},
    {"torque_kd", ICUB_SET_TORQUE_PID, 2},
    {"torque_shift", ICUB_SET_TORQUE_PID, 3},
    {"torque_offset", ICUB_SET_TORQUE_PID_LIMITS, 0},
    {"torque_limit", ICUB_SET_TORQUE_PID_LIMITS, 1},
    {"torque_integral_limit", ICUB_SET_TORQUE_PID_LIMITS, 2},
    {"current_kp", ICUB_SET_CURRENT_PID, 0},
    {"current_ki", ICUB_SET_CURRENT_PID, 1},
    {"current_kd", ICUB_SET_CURRENT_PID, 2},
    {"current_shift", ICUB_SET_CURRENT_PID, 3},
    {"stiffness", ICUB_SET_IMPEDANCE, 0},
    {"damping", ICUB_SET_IMPEDANCE, 1},
    {"pwm_limit", ICUB_SET_PWM_LIMIT, 0},
    {"current_limit", ICUB_SET_CURRENT_LIMIT, 0},
    {"max_velocity", ICUB_SET_MAX_VELOCITY, 0},
};

/* Returns the field of the command that sets a setting. */
static const struct field *motor_setting_field(size_t index)
{
    return &icub_motor_commands[rows[index].code].request[rows[index].field];
}

/* Returns the parameter of a setting. */
static unsigned motor_setting_parameter(size_t index)
{
    return (unsigned)icub_motor_commands[rows[index].code].parameter + rows[index].field;
}

/* Describes a setting: name, unit, range (struct board_settings). */
static void motor_setting_describe(const struct board *board, unsigned axis, size_t index,
                                   struct board_setting *setting)
{
    const struct field *field = motor_setting_field(index);
    bool bounded = field->min != 0 || field->max != 0;

    (void)board;
    (void)axis;
    *setting = (struct board_setting){
        .name = rows[index].name,
        .unit = field->unit ? field->unit : "",
        .min = (double)(bounded ? field->min : field_lowest(field)),
        .max = (double)(bounded ? field->max : field_highest(field)),
        .whole = true,
    };
}

/* Returns the value of a setting (struct board_settings). */
static double motor_setting_get(const struct board *board, unsigned axis, size_t index)
{
    return (double)motor_board_of(board)->axis[axis].parameter[motor_setting_parameter(index)];
}

/* Writes a setting (struct board_settings). */
static bool motor_setting_set(struct board *board, unsigned axis, size_t index, double value)
{
    motor_board_of(board)->axis[axis].parameter[motor_setting_parameter(index)] = (int64_t)value;
    if (rows[index].code == ICUB_SET_I_GAIN) {
        motor_board_of(board)->axis[axis].position_pid.integral = 0; /* as the command */
    }
    return true;
}

const struct board_settings motor_settings = {
    .count = ARRAY_COUNT(rows),
    .describe = motor_setting_describe,
    .get = motor_setting_get,
    .set = motor_setting_set,
};
