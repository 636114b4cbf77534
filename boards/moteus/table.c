/* SPDX-License-Identifier: Apache-2.0 */
/* The registers of a moteus, and the encoding of their values. */
#include "boards/moteus/table.h"

#include "base/array.h"

#include <math.h>

/* clang-format off */
#define SHOWN(number, name, quantity) {number, 0, name, quantity, MOTEUS_R, false, 0.0}
#define COMMAND(number, name, quantity, initial) \
    {number, 0, name, quantity, MOTEUS_RW, true, initial}
#define SAME(number, as, name, quantity) {number, as, name, quantity, MOTEUS_RW, false, 0.0}
#define ACTION(number, name, quantity) {number, 0, name, quantity, MOTEUS_W, false, 0.0}
#define STORED(number, name, quantity) SAME(number, 0, name, quantity)
#define NO_SIGNAL(number, name) {number, 0, name, MOTEUS_Q_DUTY, MOTEUS_R, false, (double)NAN}
#define THREE(row, number, name, quantity) \
    row(number, name "_1", quantity), row((number) + 1, name "_2", quantity), \
    row((number) + 2, name "_3", quantity)
#define FOUR(row, number, name, quantity) \
    THREE(row, number, name, quantity), row((number) + 3, name "_4", quantity)
#define FIVE(row, number, name, quantity) \
    FOUR(row, number, name, quantity), row((number) + 4, name "_5", quantity)

/* Sorted by number. */
const struct moteus_row moteus_rows[] = {
    COMMAND(MOTEUS_R_MODE, "mode", MOTEUS_Q_NUMBER, 0.0),
    SHOWN(MOTEUS_R_POSITION, "position", MOTEUS_Q_POSITION),
    SHOWN(MOTEUS_R_VELOCITY, "velocity", MOTEUS_Q_VELOCITY),
    SHOWN(MOTEUS_R_TORQUE, "torque", MOTEUS_Q_TORQUE),
    SHOWN(MOTEUS_R_Q_CURRENT, "q_current", MOTEUS_Q_CURRENT),
    SHOWN(MOTEUS_R_D_CURRENT, "d_current", MOTEUS_Q_CURRENT),
    SHOWN(MOTEUS_R_ABS_POSITION, "abs_position", MOTEUS_Q_POSITION),
    SHOWN(MOTEUS_R_POWER, "power", MOTEUS_Q_POWER),
    SHOWN(MOTEUS_R_MOTOR_TEMPERATURE, "motor_temperature", MOTEUS_Q_TEMPERATURE),
    SHOWN(MOTEUS_R_TRAJECTORY_COMPLETE, "trajectory_complete", MOTEUS_Q_NUMBER),
    SHOWN(MOTEUS_R_HOME_STATE, "home_state", MOTEUS_Q_NUMBER),
    SHOWN(MOTEUS_R_VOLTAGE, "voltage", MOTEUS_Q_VOLTAGE),
    SHOWN(MOTEUS_R_TEMPERATURE, "temperature", MOTEUS_Q_TEMPERATURE),
    SHOWN(MOTEUS_R_FAULT, "fault", MOTEUS_Q_NUMBER),
    COMMAND(MOTEUS_R_D_VOLTAGE_COMMAND, "d_voltage_command", MOTEUS_Q_VOLTAGE, 0.0),
    COMMAND(MOTEUS_R_Q_VOLTAGE_COMMAND, "q_voltage_command", MOTEUS_Q_VOLTAGE, 0.0),
    COMMAND(MOTEUS_R_Q_CURRENT_COMMAND, "q_current_command", MOTEUS_Q_CURRENT, 0.0),
    COMMAND(MOTEUS_R_D_CURRENT_COMMAND, "d_current_command", MOTEUS_Q_CURRENT, 0.0),
    COMMAND(MOTEUS_R_POSITION_COMMAND, "position_command", MOTEUS_Q_POSITION, 0.0),
    COMMAND(MOTEUS_R_VELOCITY_COMMAND, "velocity_command", MOTEUS_Q_VELOCITY, 0.0),
    COMMAND(MOTEUS_R_FEEDFORWARD_TORQUE, "feedforward_torque", MOTEUS_Q_TORQUE, 0.0),
    COMMAND(MOTEUS_R_KP_SCALE, "kp_scale", MOTEUS_Q_SCALE, 1.0),
    COMMAND(MOTEUS_R_KD_SCALE, "kd_scale", MOTEUS_Q_SCALE, 1.0),
    COMMAND(MOTEUS_R_MAX_TORQUE, "maximum_torque", MOTEUS_Q_TORQUE, 100.0),
    COMMAND(MOTEUS_R_STOP_POSITION, "stop_position", MOTEUS_Q_POSITION, NAN),
    COMMAND(MOTEUS_R_TIMEOUT, "watchdog_timeout", MOTEUS_Q_TIME, 0.0),
    COMMAND(MOTEUS_R_VELOCITY_LIMIT, "velocity_limit", MOTEUS_Q_VELOCITY, NAN),
    COMMAND(MOTEUS_R_ACCELERATION_LIMIT, "acceleration_limit", MOTEUS_Q_ACCELERATION, NAN),
    COMMAND(MOTEUS_R_ILIMIT_SCALE, "ilimit_scale", MOTEUS_Q_SCALE, 1.0),
    COMMAND(MOTEUS_R_IGNORE_BOUNDS, "ignore_position_bounds", MOTEUS_Q_NUMBER, 0.0),
    SHOWN(MOTEUS_R_TORQUE_P, "proportional_torque", MOTEUS_Q_TORQUE),
    SHOWN(MOTEUS_R_TORQUE_I, "integral_torque", MOTEUS_Q_TORQUE),
    SHOWN(MOTEUS_R_TORQUE_D, "derivative_torque", MOTEUS_Q_TORQUE),
    SHOWN(MOTEUS_R_TORQUE_FEEDFORWARD, "feedforward_contribution", MOTEUS_Q_TORQUE),
    SHOWN(MOTEUS_R_TORQUE_TOTAL, "total_torque", MOTEUS_Q_TORQUE),
    SHOWN(MOTEUS_R_CONTROL_POSITION, "control_position", MOTEUS_Q_POSITION),
    SHOWN(MOTEUS_R_CONTROL_VELOCITY, "control_velocity", MOTEUS_Q_VELOCITY),
    SHOWN(MOTEUS_R_CONTROL_TORQUE, "control_torque", MOTEUS_Q_TORQUE),
    SHOWN(MOTEUS_R_POSITION_ERROR, "position_error", MOTEUS_Q_POSITION),
    SHOWN(MOTEUS_R_VELOCITY_ERROR, "velocity_error", MOTEUS_Q_VELOCITY),
    SHOWN(MOTEUS_R_TORQUE_ERROR, "torque_error", MOTEUS_Q_TORQUE),
    COMMAND(MOTEUS_R_STAY_LOWER, "stay_within_lower", MOTEUS_Q_POSITION, 0.0),
    COMMAND(MOTEUS_R_STAY_UPPER, "stay_within_upper", MOTEUS_Q_POSITION, 0.0),
    SAME(MOTEUS_R_STAY_FEEDFORWARD_TORQUE, MOTEUS_R_FEEDFORWARD_TORQUE,
         "stay_within_feedforward_torque", MOTEUS_Q_TORQUE),
    SAME(MOTEUS_R_STAY_KP_SCALE, MOTEUS_R_KP_SCALE, "stay_within_kp_scale", MOTEUS_Q_SCALE),
    SAME(MOTEUS_R_STAY_KD_SCALE, MOTEUS_R_KD_SCALE, "stay_within_kd_scale", MOTEUS_Q_SCALE),
    SAME(MOTEUS_R_STAY_MAX_TORQUE, MOTEUS_R_MAX_TORQUE, "stay_within_maximum_torque",
         MOTEUS_Q_TORQUE),
    SAME(MOTEUS_R_STAY_TIMEOUT, MOTEUS_R_TIMEOUT, "stay_within_timeout", MOTEUS_Q_TIME),
    SAME(MOTEUS_R_STAY_ILIMIT_SCALE, MOTEUS_R_ILIMIT_SCALE, "stay_within_ilimit_scale",
         MOTEUS_Q_SCALE),
    SAME(MOTEUS_R_STAY_IGNORE_BOUNDS, MOTEUS_R_IGNORE_BOUNDS, "stay_within_ignore_bounds",
         MOTEUS_Q_NUMBER),
    SHOWN(MOTEUS_R_ENCODER_0_POSITION, "encoder_0_position", MOTEUS_Q_POSITION),
    SHOWN(MOTEUS_R_ENCODER_0_VELOCITY, "encoder_0_velocity", MOTEUS_Q_VELOCITY),
    SHOWN(MOTEUS_R_ENCODER_1_POSITION, "encoder_1_position", MOTEUS_Q_POSITION),
    SHOWN(MOTEUS_R_ENCODER_1_VELOCITY, "encoder_1_velocity", MOTEUS_Q_VELOCITY),
    SHOWN(MOTEUS_R_ENCODER_2_POSITION, "encoder_2_position", MOTEUS_Q_POSITION),
    SHOWN(MOTEUS_R_ENCODER_2_VELOCITY, "encoder_2_velocity", MOTEUS_Q_VELOCITY),
    SHOWN(MOTEUS_R_ENCODER_VALIDITY, "encoder_validity", MOTEUS_Q_NUMBER),
    SAME(MOTEUS_R_AUX1_GPIO_COMMAND, MOTEUS_R_AUX1_GPIO_STATUS, "aux1_gpio_command", MOTEUS_Q_PINS),
    SAME(MOTEUS_R_AUX2_GPIO_COMMAND, MOTEUS_R_AUX2_GPIO_STATUS, "aux2_gpio_command", MOTEUS_Q_PINS),
    SHOWN(MOTEUS_R_AUX1_GPIO_STATUS, "aux1_gpio_status", MOTEUS_Q_PINS),
    SHOWN(MOTEUS_R_AUX2_GPIO_STATUS, "aux2_gpio_status", MOTEUS_Q_PINS),
    FIVE(SHOWN, MOTEUS_R_AUX1_ANALOG, "aux1_analog_in", MOTEUS_Q_DUTY),
    FIVE(SHOWN, MOTEUS_R_AUX2_ANALOG, "aux2_analog_in", MOTEUS_Q_DUTY),
    SHOWN(MOTEUS_R_MILLISECONDS, "milliseconds", MOTEUS_Q_COUNTER),
    STORED(MOTEUS_R_CLOCK_TRIM, "clock_trim", MOTEUS_Q_NUMBER),
    SHOWN(MOTEUS_R_AUX1_PWM_PERIOD, "aux1_pwm_input_period", MOTEUS_Q_NUMBER),
    NO_SIGNAL(MOTEUS_R_AUX1_PWM_DUTY, "aux1_pwm_input_duty_cycle"),
    SHOWN(MOTEUS_R_AUX2_PWM_PERIOD, "aux2_pwm_input_period", MOTEUS_Q_NUMBER),
    NO_SIGNAL(MOTEUS_R_AUX2_PWM_DUTY, "aux2_pwm_input_duty_cycle"),
    FIVE(STORED, MOTEUS_R_AUX1_PWM, "aux1_pwm", MOTEUS_Q_DUTY),
    FIVE(STORED, MOTEUS_R_AUX2_PWM, "aux2_pwm", MOTEUS_Q_DUTY),
    SHOWN(MOTEUS_R_MODEL, "model", MOTEUS_Q_WORD),
    SHOWN(MOTEUS_R_FIRMWARE, "firmware_version", MOTEUS_Q_WORD),
    SHOWN(MOTEUS_R_MAP_VERSION, "register_map_version", MOTEUS_Q_WORD),
    THREE(SHOWN, MOTEUS_R_SERIAL, "serial", MOTEUS_Q_WORD),
    ACTION(MOTEUS_R_OUTPUT_NEAREST, "set_output_nearest", MOTEUS_Q_POSITION),
    ACTION(MOTEUS_R_OUTPUT_EXACT, "set_output_exact", MOTEUS_Q_POSITION),
    ACTION(MOTEUS_R_RECAPTURE, "recapture", MOTEUS_Q_NUMBER),
    FOUR(SHOWN, MOTEUS_R_UUID, "uuid", MOTEUS_Q_WORD),
    FOUR(ACTION, MOTEUS_R_UUID_MASK, "uuid_mask", MOTEUS_Q_NUMBER),
    SHOWN(MOTEUS_R_UUID_MASK_CAPABLE, "uuid_mask_capable", MOTEUS_Q_NUMBER),
};
const size_t moteus_row_count = ARRAY_COUNT(moteus_rows);

static const struct {
    const char *unit;
    double int8, int16, int32;
} quantities[] = {
    [MOTEUS_Q_NUMBER] = {NULL, 1.0, 1.0, 1.0},
    [MOTEUS_Q_PINS] = {NULL, 1.0, 1.0, 1.0},
    [MOTEUS_Q_WORD] = {NULL, 1.0, 1.0, 1.0},
    [MOTEUS_Q_COUNTER] = {"ms", 1.0, 1.0, 1.0},
    [MOTEUS_Q_POSITION] = {"turn", 0.01, 0.0001, 0.00001},
    [MOTEUS_Q_VELOCITY] = {"turn/s", 0.1, 0.00025, 0.00001},
    [MOTEUS_Q_ACCELERATION] = {"turn/s2", 0.05, 0.001, 0.00001},
    [MOTEUS_Q_TORQUE] = {"Nm", 0.5, 0.01, 0.001},
    [MOTEUS_Q_CURRENT] = {"A", 1.0, 0.1, 0.001},
    [MOTEUS_Q_VOLTAGE] = {"V", 0.5, 0.1, 0.001},
    [MOTEUS_Q_TEMPERATURE] = {"degC", 1.0, 0.1, 0.001},
    [MOTEUS_Q_POWER] = {"W", 10.0, 0.05, 0.0001},
    [MOTEUS_Q_SCALE] = {NULL, 1.0 / 127.0, 1.0 / 32767.0, 1.0 / 2147483647.0},
    [MOTEUS_Q_DUTY] = {NULL, 1.0 / 127.0, 1.0 / 32767.0, 1.0 / 2147483647.0},
    [MOTEUS_Q_TIME] = {"s", 0.01, 0.001, 0.000001},
};

static const struct field_value modes[] = {
    {MOTEUS_STOPPED, "stopped"}, {MOTEUS_FAULT, "fault"}, {MOTEUS_ENABLING, "enabling"},
    {MOTEUS_CALIBRATING, "calibrating"}, {MOTEUS_CALIBRATION_COMPLETE, "calibration_complete"},
    {MOTEUS_VOLTAGE_DQ, "voltage_dq"}, {MOTEUS_CURRENT, "current"}, {MOTEUS_POSITION, "position"},
    {MOTEUS_TIMEOUT, "timeout"}, {MOTEUS_ZERO_VELOCITY, "zero_velocity"},
    {MOTEUS_STAY_WITHIN, "stay_within"}, {MOTEUS_BRAKE, "brake"}, {0, NULL}};

#define GAP(bytes) {.type = 8 * (bytes) | FIELD_PADDING}
#define VALUE(kind, label, of, by) {.type = kind, .name = label, .unit = of, .scale = by}
const struct field moteus_command_fields[] = {
    GAP(2), {.type = FIELD_I8, .name = "mode", .values = modes},
    GAP(2), VALUE(FIELD_I8, "position", "turn", 0.01),
    GAP(2), VALUE(FIELD_F32, "feedforward_torque", "Nm", 0.0),
    GAP(2), VALUE(FIELD_I8, "kp_scale", NULL, 1.0 / 127.0), {.type = FIELD_END}};
const struct field moteus_reply_fields[] = {
    GAP(2), {.type = FIELD_I8, .name = "mode", .values = modes},
    GAP(2), VALUE(FIELD_F32, "position", "turn", 0.0),
    VALUE(FIELD_F32, "velocity", "turn/s", 0.0), VALUE(FIELD_F32, "torque", "Nm", 0.0),
    GAP(2), VALUE(FIELD_F32, "abs_position", "turn", 0.0),
    GAP(2), VALUE(FIELD_I8, "voltage", "V", 0.5), VALUE(FIELD_I8, "temperature", "degC", 1.0),
    {.type = FIELD_I8, .name = "fault"}, {.type = FIELD_END}};
/* clang-format on */

const struct moteus_row *moteus_find_row(uint32_t number)
{
    size_t from = 0, to = moteus_row_count;

    while (from < to) {
        size_t middle = (from + to) / 2;

        if (moteus_rows[middle].number == number) {
            return &moteus_rows[middle];
        }
        if (moteus_rows[middle].number < number) {
            from = middle + 1;
        } else {
            to = middle;
        }
    }
    return NULL;
}

const char *moteus_unit(enum moteus_quantity quantity)
{
    return quantities[quantity].unit;
}

unsigned moteus_bytes(enum moteus_type type)
{
    return type == MOTEUS_INT8 ? 1 : type == MOTEUS_INT16 ? 2 : 4;
}

/* Returns the scale of a quantity for an integer type. */
static double moteus_scale(enum moteus_quantity quantity, enum moteus_type type)
{
    return type == MOTEUS_INT8    ? quantities[quantity].int8
           : type == MOTEUS_INT16 ? quantities[quantity].int16
                                  : quantities[quantity].int32;
}

/* Returns the lowest integer of a type, which means NaN. */
static int32_t moteus_lowest(enum moteus_type type)
{
    return type == MOTEUS_INT8 ? INT8_MIN : type == MOTEUS_INT16 ? INT16_MIN : INT32_MIN;
}

double moteus_get(enum moteus_quantity quantity, enum moteus_type type, const uint8_t *data)
{
    int32_t count = type == MOTEUS_INT8    ? (int8_t)data[0]
                    : type == MOTEUS_INT16 ? get_i16_le(data)
                                           : get_i32_le(data);
    float value;

    if (type == MOTEUS_FLOAT) {
        memcpy(&value, &(uint32_t){get_u32_le(data)}, sizeof value);
        return (double)value;
    }
    if (quantity > MOTEUS_Q_COUNTER && count == moteus_lowest(type)) {
        return NAN;
    }
    return count * moteus_scale(quantity, type);
}

/* Writes the lowest bytes of a number. */
static void moteus_put_bits(enum moteus_type type, uint32_t bits, uint8_t *data)
{
    for (unsigned i = 0; i < moteus_bytes(type); i++) {
        data[i] = (uint8_t)(bits >> 8 * i);
    }
}

bool moteus_put(enum moteus_quantity quantity, enum moteus_type type, double value, uint8_t *data)
{
    float single = (float)value;
    double most = -1.0 - moteus_lowest(type);
    uint32_t bits;

    if (quantity == MOTEUS_Q_WORD) {
        moteus_put_bits(type, (uint32_t)value, data);
        return type == MOTEUS_INT32;
    }
    if (quantity == MOTEUS_Q_COUNTER && type != MOTEUS_FLOAT) {
        moteus_put_bits(type, (uint32_t)value, data);
        return true;
    }
    if (type == MOTEUS_FLOAT) {
        single = quantity == MOTEUS_Q_COUNTER ? (float)((uint32_t)value % 8388608) : single;
        memcpy(&bits, &single, sizeof bits);
        moteus_put_bits(type, bits, data);
        return true;
    }

    /* The controller truncates its float32 values to integers. The lowest integer means NaN */
    single /= (float)moteus_scale(quantity, type);
    value = isfinite(single) ? trunc(fmax(fmin((double)single, most), -most))
                             : (double)moteus_lowest(type);
    moteus_put_bits(type, (uint32_t)(int32_t)value, data);
    return true;
}
