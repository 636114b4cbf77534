/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The rows of protocol icub. Lengths and byte orders follow the official message tables of motor
 * and sensor boards. Some requests have two valid lengths: the fields need the shorter one, and
 * common hosts send the longer one.
 */
#include "boards/icub/table.h"

#include "base/array.h"

/* clang-format off */
#define FIELDS(...) (const struct field[]){__VA_ARGS__, {.type = FIELD_END}}

#define FIELD(kind, label, of)  {.type = kind, .name = label, .unit = of}
#define IN(kind, label, of, lowest, highest) \
    {.type = kind, .name = label, .unit = of, .min = lowest, .max = highest}
#define U8(name, unit)      FIELD(FIELD_U8, name, unit)
#define U16(name, unit)     FIELD(FIELD_U16, name, unit)
#define I16(name, unit)     FIELD(FIELD_I16, name, unit)
#define I32(name, unit)     FIELD(FIELD_I32, name, unit)
#define U16_BE(name, unit)  FIELD(FIELD_U16_BE, name, unit)
#define I16_BE(name, unit)  FIELD(FIELD_I16_BE, name, unit)
#define U8_IN(name, lowest, highest) IN(FIELD_U8, name, NULL, lowest, highest)
#define SCALED(kind, label, by) {.type = kind, .name = label, .scale = by}
#define U8_OF(label, list)  {.type = FIELD_U8, .name = label, .values = list}
#define PAD                 {.type = FIELD_PAD}

#define SET(first, length, fields) \
    .kind = ICUB_SET, .parameter = first, .request_min = length, .request_max = length, \
    .request = fields
#define SET_UP_TO(first, shortest, longest, fields) \
    .kind = ICUB_SET, .parameter = first, .request_min = shortest, .request_max = longest, \
    .request = fields
#define GET(first, length, fields) \
    .kind = ICUB_GET, .parameter = first, .request_min = 1, .request_max = 1, \
    .reply_length = length, .reply = fields
#define SET_GET(name, first, length, fields) \
    [ICUB_SET_##name] = {"SET_" #name, SET(first, length, fields)}, \
    [ICUB_GET_##name] = {"GET_" #name, GET(first, length, fields)}
#define SET_UP_TO_GET(name, first, shortest, longest, length, fields) \
    [ICUB_SET_##name] = {"SET_" #name, SET_UP_TO(first, shortest, longest, fields)}, \
    [ICUB_GET_##name] = {"GET_" #name, GET(first, length, fields)}
#define DO(length, fields) \
    .kind = ICUB_DO, .request_min = length, .request_max = length, .request = fields
#define DO_UP_TO(shortest, longest, fields) \
    .kind = ICUB_DO, .request_min = shortest, .request_max = longest, .request = fields
#define REPLY(length, fields) .reply_length = length, .reply = fields

const struct field_value icub_mode_names[] = {
    {ICUB_MODE_IDLE, "idle"}, {ICUB_MODE_POSITION, "position"}, {ICUB_MODE_VELOCITY, "velocity"},
    {ICUB_MODE_TORQUE, "torque"}, {ICUB_MODE_IMPEDANCE_POSITION, "impedance_position"},
    {ICUB_MODE_IMPEDANCE_VELOCITY, "impedance_velocity"}, {ICUB_MODE_CURRENT, "current"},
    {ICUB_MODE_MIXED, "mixed"}, {ICUB_MODE_DIRECT, "direct"},
    {ICUB_MODE_FORCE_IDLE, "force_idle"}, {ICUB_MODE_SPEED_VOLTAGE, "speed_voltage"},
    {ICUB_MODE_SPEED_CURRENT, "speed_current"}, {ICUB_MODE_OPEN_LOOP, "open_loop"},
    {ICUB_MODE_CALIBRATION, "calibration"}, {ICUB_MODE_HARDWARE_FAULT, "hardware_fault"},
    {ICUB_MODE_NOT_CONFIGURED, "not_configured"}, {ICUB_MODE_CONFIGURED, "configured"},
    {ICUB_MODE_UNKNOWN, "unknown"}, {0, NULL}};
const struct field_value icub_board_names[] = {
    {ICUB_BOARD_DSP, "dsp"}, {1, "pic"}, {2, "2dc"}, {3, "mc4"}, {ICUB_BOARD_BLL, "bll"},
    {5, "mtb"}, {ICUB_BOARD_STRAIN, "strain"}, {7, "mais"}, {8, "2foc"}, {9, "6sg"},
    {12, "strain2"}, {ICUB_BOARD_RFE, "rfe"}, {255, "unknown"}, {0, NULL}};

static const struct field_value interactions[] = {
    {ICUB_STIFF, "stiff"}, {ICUB_COMPLIANT, "compliant"}, {0, NULL}};
static const struct field_value calibrations[] = {
    {ICUB_CALIBRATE_HARD_STOPS, "hard_stops"}, {ICUB_CALIBRATE_ANALOG, "analog"},
    {ICUB_CALIBRATE_HARD_STOPS_DIFFERENTIAL, "hard_stops_differential"},
    {ICUB_CALIBRATE_ABSOLUTE, "absolute"},
    {ICUB_CALIBRATE_ABSOLUTE_AND_INCREMENTAL, "absolute_and_incremental"}, {0, NULL}};
static const struct field_value transmit_modes[] = {
    {ICUB_STRAIN_CALIBRATED, "calibrated"}, {ICUB_STRAIN_SILENT, "silent"},
    {ICUB_STRAIN_UNCALIBRATED, "uncalibrated"}, {ICUB_STRAIN_BOTH, "both"}, {0, NULL}};
static const struct field_value fusions[] = {
    {ICUB_FUSION_ON, "on"}, {ICUB_FUSION_OFF, "off"}, {0, NULL}};
static const struct field_value inertial_sensors[] = {
    {ICUB_SENSOR_ACCELERATION, "acceleration"}, {ICUB_SENSOR_MAGNETIC, "magnetometer"},
    {ICUB_SENSOR_GYRO, "gyro"}, {ICUB_SENSOR_EULER, "euler"},
    {ICUB_SENSOR_QUATERNION, "quaternion"}, {ICUB_SENSOR_LINEAR, "linear_acceleration"},
    {ICUB_SENSOR_GRAVITY, "gravity"}, {ICUB_SENSOR_STATUS, "status"}, {0, NULL}};
static const struct field_value tares[] = {
    {ICUB_TARE_RESET, "reset"}, {ICUB_TARE_AUTOMATIC, "automatic"}, {ICUB_TARE_VALUE, "value"},
    {0, NULL}};
static const struct field_value acknowledged[] = {{0, "no"}, {1, "yes"}, {0, NULL}};

static const struct field gain[] = {I16("value", NULL), {.type = FIELD_END}};
static const struct field ticks[] = {I32("position", "tick"), {.type = FIELD_END}};
static const struct field velocity[] = {I16("velocity", NULL), {.type = FIELD_END}};
static const struct field pwm[] = {I16("pwm", "pwm"), {.type = FIELD_END}};
static const struct field pid[] = {
    I16("kp", NULL), I16("ki", NULL), I16("kd", NULL), U8("shift", NULL), {.type = FIELD_END}};
static const struct field pid_limits[] = {
    I16("offset", "pwm"), I16("limit", "pwm"), I16("integral_limit", "pwm"), {.type = FIELD_END}};
static const struct field stiction[] = {
    I16("up", "pwm"), I16("down", "pwm"), {.type = FIELD_END}};
static const struct field impedance[] = {
    I16("stiffness", NULL), I16("damping", NULL), PAD, PAD, PAD, {.type = FIELD_END}};
static const struct field motor_parameters[] = {
    I16("bemf", NULL), U8("bemf_shift", NULL), I16("ktau", NULL), U8("ktau_shift", NULL), PAD,
    {.type = FIELD_END}};
static const struct field model_parameters[] = {
    I16("kff", NULL), PAD, PAD, PAD, PAD, PAD, {.type = FIELD_END}};
static const struct field i2t[] = {
    U8("b1", NULL), U8("b2", NULL), U8("b3", NULL), U8("b4", NULL), U8("b5", NULL),
    U8("b6", NULL), U8("b7", NULL), {.type = FIELD_END}};
static const struct field byte[] = {U8("value", NULL), {.type = FIELD_END}};
static const struct field address[] = {
    U8_IN("address", 1, ICUB_ADDRESS_MAX), {.type = FIELD_END}};
static const struct field host_protocol[] = {
    U8("major", NULL), U8("minor", NULL), {.type = FIELD_END}};
static const struct field firmware[] = {
    U8_OF("type", icub_board_names), U8("major", NULL), U8("version", NULL), U8("build", NULL),
    U8("protocol_major", NULL), U8("protocol_minor", NULL), U8_OF("ack", acknowledged),
    {.type = FIELD_END}};
static const struct field info_part[] = {
    U8_IN("part", 0, ICUB_INFO_LENGTH / ICUB_INFO_PART - 1), U8("c0", NULL), U8("c1", NULL),
    U8("c2", NULL), U8("c3", NULL), {.type = FIELD_END}};

const struct icub_command icub_motor_commands[ICUB_MOTOR_COMMANDS] = {
    [ICUB_TOGGLE_VERBOSE] = {"TOGGLE_VERBOSE", DO(1, NULL)},
    [ICUB_CALIBRATE_ENCODER] = {"CALIBRATE_ENCODER",
        DO(8, FIELDS(U8_OF("type", calibrations), I16("p1", NULL), I16("p2", NULL),
                     I16("p3", "tick")))},
    [ICUB_GET_CONTROL_MODE] = {"GET_CONTROL_MODE", DO(1, NULL),
        REPLY(3, FIELDS(U8_OF("mode", icub_mode_names), PAD))},
    [ICUB_MOTION_DONE] = {"MOTION_DONE", DO(1, NULL), REPLY(3, FIELDS(I16("done", NULL)))},
    [ICUB_SET_CONTROL_MODE] = {"SET_CONTROL_MODE", DO(2, FIELDS(U8_OF("mode", icub_mode_names)))},
    [ICUB_WRITE_FLASH] = {"WRITE_FLASH", DO(1, NULL)},
    [ICUB_READ_FLASH] = {"READ_FLASH", DO(1, NULL)},
    [ICUB_GET_INFO] = {"GET_INFO", DO(1, NULL), REPLY(6, info_part)},
    [ICUB_SET_INFO] = {"SET_INFO", DO(6, info_part)},
    [ICUB_SET_SPEED_ESTIM_SHIFT] = {"SET_SPEED_ESTIM_SHIFT",
        SET(ICUB_P_JOINT_SPEED_SHIFT, 5,
            FIELDS(U8("joint_speed", NULL), U8("joint_acceleration", NULL),
                   U8("motor_speed", NULL), U8("motor_acceleration", NULL)))},
    [ICUB_GET_ENCODER_POSITION] = {"GET_ENCODER_POSITION", DO(1, NULL),
        REPLY(7, FIELDS(I32("position", "tick"), I16("speed", NULL)))},
    SET_GET(DESIRED_POSITION, ICUB_P_DESIRED_POSITION, 5, ticks),
    SET_GET(DESIRED_VELOCITY, ICUB_P_DESIRED_VELOCITY, 3, velocity),
    SET_GET(DESIRED_ACCELERATION, ICUB_P_DESIRED_ACCELERATION, 3, gain),
    [ICUB_POSITION_MOVE] = {"POSITION_MOVE",
        DO(7, FIELDS(I32("target", "tick"), I16("speed", "tick/100ms")))},
    [ICUB_VELOCITY_MOVE] = {"VELOCITY_MOVE",
        DO(5, FIELDS(I16("velocity", NULL), I16("acceleration", NULL)))},
    [ICUB_SET_ENCODER_POSITION] = {"SET_ENCODER_POSITION", DO(5, ticks)},
    SET_GET(P_GAIN, ICUB_P_POSITION_KP, 3, gain),
    SET_GET(D_GAIN, ICUB_P_POSITION_KD, 3, gain),
    SET_GET(I_GAIN, ICUB_P_POSITION_KI, 3, gain),
    SET_GET(I_LIMIT, ICUB_P_POSITION_INTEGRAL_LIMIT, 3, pwm),
    SET_GET(OFFSET, ICUB_P_POSITION_OFFSET, 3, pwm),
    SET_GET(SCALE, ICUB_P_POSITION_SHIFT, 3, gain),
    SET_GET(OUTPUT_LIMIT, ICUB_P_POSITION_LIMIT, 3, pwm),
    [ICUB_SET_DESIRED_TORQUE] = {"SET_DESIRED_TORQUE", DO(5, FIELDS(I32("torque", NULL)))},
    [ICUB_GET_DESIRED_TORQUE] = {"GET_DESIRED_TORQUE",
        GET(ICUB_P_DESIRED_TORQUE, 5, FIELDS(I32("torque", NULL)))},
    [ICUB_STOP_TRAJECTORY] = {"STOP_TRAJECTORY", DO(1, NULL)},
    SET_GET(PWM_LIMIT, ICUB_P_PWM_LIMIT, 3, pwm),
    [ICUB_SET_BOARD_ID] = {"SET_BOARD_ID", DO(2, address)},
    [ICUB_GET_BOARD_ID] = {"GET_BOARD_ID", DO(1, NULL), REPLY(2, address)},
    [ICUB_SET_TORQUE_SOURCE] = {"SET_TORQUE_SOURCE",
        SET(ICUB_P_TORQUE_SOURCE, 8,
            FIELDS(U8_IN("strain", 0, ICUB_ADDRESS_MAX), U8_IN("channel", 0, 5), PAD, PAD, PAD,
                   PAD, PAD))},
    [ICUB_GET_PID_ERROR] = {"GET_PID_ERROR", DO(1, NULL), REPLY(3, FIELDS(I16("error", "tick")))},
    [ICUB_GET_POSITION_REFERENCE] = {"GET_POSITION_REFERENCE", DO(1, NULL), REPLY(5, ticks)},
    [ICUB_GET_VELOCITY_REFERENCE] = {"GET_VELOCITY_REFERENCE", DO(1, NULL), REPLY(3, velocity)},
    [ICUB_GET_ERROR_STATUS] = {"GET_ERROR_STATUS", DO(1, NULL),
        REPLY(3, FIELDS(I16("faults", NULL)))},
    [ICUB_GET_ENCODER_VELOCITY] = {"GET_ENCODER_VELOCITY", DO(1, NULL), REPLY(3, velocity)},
    [ICUB_SET_COMMAND_POSITION] = {"SET_COMMAND_POSITION", DO(5, ticks)},
    [ICUB_GET_PID_OUTPUT] = {"GET_PID_OUTPUT", DO(1, NULL), REPLY(3, pwm)},
    SET_GET(MIN_POSITION, ICUB_P_MIN_POSITION, 5, ticks),
    SET_GET(MAX_POSITION, ICUB_P_MAX_POSITION, 5, ticks),
    SET_GET(MAX_VELOCITY, ICUB_P_MAX_VELOCITY, 3, velocity),
    [ICUB_SET_CURRENT_LIMIT] = {"SET_CURRENT_LIMIT",
        SET(ICUB_P_CURRENT_LIMIT, 5, FIELDS(IN(FIELD_I32, "limit", "mA", 0, INT32_MAX)))},
    [ICUB_SET_BROADCAST_POLICY] = {"SET_BROADCAST_POLICY",
        DO(5, FIELDS(FIELD(FIELD_U32, "mask", NULL)))},
    [ICUB_SET_VELOCITY_SHIFT] = {"SET_VELOCITY_SHIFT",
        SET(ICUB_P_VELOCITY_SHIFT, 3, FIELDS(IN(FIELD_I16, "shift", NULL, 0, 16)))},
    SET_GET(TORQUE_PID, ICUB_P_TORQUE_KP, 8, pid),
    SET_UP_TO_GET(TORQUE_PID_LIMITS, ICUB_P_TORQUE_OFFSET, 7, 8, 7, pid_limits),
    SET_GET(POSITION_PID, ICUB_P_POSITION_KP, 8, pid),
    SET_UP_TO_GET(POSITION_PID_LIMITS, ICUB_P_POSITION_OFFSET, 7, 8, 7, pid_limits),
    [ICUB_SET_VELOCITY_TIMEOUT] = {"SET_VELOCITY_TIMEOUT",
        SET(ICUB_P_VELOCITY_TIMEOUT, 3, FIELDS(IN(FIELD_I16, "timeout", "ms", 0, INT16_MAX)))},
    SET_GET(IMPEDANCE, ICUB_P_STIFFNESS, 8, impedance),
    SET_GET(IMPEDANCE_OFFSET, ICUB_P_IMPEDANCE_OFFSET, 3, gain),
    [ICUB_GET_FIRMWARE_VERSION] = {"GET_FIRMWARE_VERSION", DO(3, host_protocol),
        REPLY(8, firmware)},
    SET_GET(POSITION_STICTION, ICUB_P_POSITION_STICTION_UP, 5, stiction),
    SET_GET(TORQUE_STICTION, ICUB_P_TORQUE_STICTION_UP, 5, stiction),
    SET_UP_TO_GET(MOTOR_PARAMETERS, ICUB_P_BEMF, 7, 8, 8, motor_parameters),
    SET_UP_TO_GET(MODEL_PARAMETERS, ICUB_P_KFF, 3, 8, 8, model_parameters),
    SET_GET(CURRENT_PID, ICUB_P_CURRENT_KP, 8, pid),
    SET_UP_TO_GET(I2T, ICUB_P_I2T, 2, 8, 8, i2t),
    SET_GET(OPEN_LOOP, ICUB_P_OPEN_LOOP, 3, pwm),
    [ICUB_SET_INTERACTION_MODE] = {"SET_INTERACTION_MODE",
        SET(ICUB_P_INTERACTION, 2,
            FIELDS({.type = FIELD_U8, .name = "mode", .min = ICUB_STIFF, .max = ICUB_COMPLIANT,
                .values = interactions}))},
    [ICUB_GET_INTERACTION_MODE] = {"GET_INTERACTION_MODE",
        GET(ICUB_P_INTERACTION, 3, FIELDS(U8_OF("mode", interactions), PAD))},
    SET_GET(TORQUE_FILTER, ICUB_P_TORQUE_FILTER, 2, byte),
    SET_GET(TEMPERATURE_LIMIT, ICUB_P_TEMPERATURE_LIMIT, 3, gain),
};

static const struct field channel[] = {U8_IN("channel", 0, 5), {.type = FIELD_END}};
static const struct field channel_signed[] = {
    U8_IN("channel", 0, 5), I16_BE("value", NULL), {.type = FIELD_END}};
/* The selecting byte of an EEPROM command has two halves: regulation set (high), channel or row
 * (low). The board splits it */
static const struct field channel_of_set[] = {U8("channel", NULL), {.type = FIELD_END}};
static const struct field channel_of_set_value[] = {
    U8("channel", NULL), U16_BE("value", NULL), {.type = FIELD_END}};
static const struct field channel_of_set_signed[] = {
    U8("channel", NULL), I16_BE("value", NULL), {.type = FIELD_END}};
static const struct field full_scale[] = {
    U8("channel", NULL), U16_BE("full_scale", NULL), {.type = FIELD_END}};
static const struct field matrix_element[] = {
    U8("row", NULL), U8_IN("column", 0, 5), I16_BE("value", NULL), {.type = FIELD_END}};
static const struct field tare[] = {
    {.type = FIELD_U8, .name = "how", .min = ICUB_TARE_RESET, .max = ICUB_TARE_VALUE,
     .values = tares}, U8("channel", NULL), I16_BE("value", NULL),
    {.type = FIELD_END}};
static const struct field serial[] = {
    U8("c0", NULL), U8("c1", NULL), U8("c2", NULL), U8("c3", NULL), U8("c4", NULL),
    U8("c5", NULL), U8("c6", NULL), {.type = FIELD_END}};

const struct icub_command icub_strain_commands[ICUB_STRAIN_COMMANDS] = {
    [ICUB_STRAIN_SET_FILTER] = {"SET_FILTER", DO_UP_TO(1, 8, NULL)},
    [ICUB_STRAIN_SET_MATRIX] = {"SET_MATRIX", DO(5, matrix_element)},
    [ICUB_STRAIN_SET_DAC] = {"SET_DAC", DO(4, channel_of_set_value)},
    [ICUB_STRAIN_SET_CHANNELS] = {"SET_CHANNELS", DO(2, FIELDS(U8("mask", NULL)))},
    [ICUB_STRAIN_CALIBRATE] = {"CALIBRATE", DO_UP_TO(1, 8, NULL)},
    [ICUB_STRAIN_SET_TRANSMIT_MODE] = {"SET_TRANSMIT_MODE",
        DO(2, FIELDS(U8_OF("mode", transmit_modes)))},
    [ICUB_STRAIN_SET_PERIOD] = {"SET_PERIOD", DO(2, FIELDS(IN(FIELD_U8, "period", "ms", 1, 255)))},
    [ICUB_STRAIN_SAVE] = {"SAVE", DO(1, NULL), REPLY(2, FIELDS(U8("ok", NULL)))},
    [ICUB_STRAIN_GET_MATRIX] = {"GET_MATRIX",
        DO(3, FIELDS(U8("row", NULL), U8_IN("column", 0, 5))), REPLY(5, matrix_element)},
    [ICUB_STRAIN_GET_DAC] = {"GET_DAC", DO(2, channel_of_set),
        REPLY(4, channel_of_set_value)},
    [ICUB_STRAIN_GET_ADC] = {"GET_ADC",
        DO(3, FIELDS(U8_IN("channel", 0, 5), U8("calibrated", NULL))),
        REPLY(5, FIELDS(U8("channel", NULL), U8("calibrated", NULL), U16_BE("value", NULL)))},
    [ICUB_STRAIN_SET_MATRIX_GAIN] = {"SET_MATRIX_GAIN", DO(2, byte)},
    [ICUB_STRAIN_GET_MATRIX_GAIN] = {"GET_MATRIX_GAIN", DO(1, NULL), REPLY(2, byte)},
    [ICUB_STRAIN_SET_CALIBRATION_TARE] = {"SET_CALIBRATION_TARE", DO_UP_TO(2, 5, tare)},
    [ICUB_STRAIN_GET_CALIBRATION_TARE] = {"GET_CALIBRATION_TARE", DO(2, channel_of_set),
        REPLY(4, channel_of_set_signed)},
    [ICUB_STRAIN_SET_CURRENT_TARE] = {"SET_CURRENT_TARE", DO_UP_TO(2, 5, tare)},
    [ICUB_STRAIN_GET_CURRENT_TARE] = {"GET_CURRENT_TARE", DO(2, channel), REPLY(4, channel_signed)},
    [ICUB_STRAIN_SET_FULL_SCALE] = {"SET_FULL_SCALE", DO(4, full_scale)},
    [ICUB_STRAIN_GET_FULL_SCALE] = {"GET_FULL_SCALE", DO(2, channel_of_set), REPLY(4, full_scale)},
    [ICUB_STRAIN_SET_SERIAL] = {"SET_SERIAL", DO(8, serial)},
    [ICUB_STRAIN_GET_SERIAL] = {"GET_SERIAL", DO(1, NULL), REPLY(8, serial)},
    [ICUB_STRAIN_EEPROM_SAVED] = {"EEPROM_SAVED", DO(1, NULL), REPLY(2, FIELDS(U8("saved", NULL)))},
    [ICUB_STRAIN_GET_FIRMWARE] = {"GET_FIRMWARE", DO(3, host_protocol), REPLY(8, firmware)},
    [ICUB_STRAIN_SET_ADDRESS] = {"SET_ADDRESS", DO(2, address)},
};

static const struct field inertial_config[] = {
    U16("mask", NULL), U8_OF("fusion", fusions), FIELD(FIELD_U32, "ranges", NULL),
    {.type = FIELD_END}};

const struct icub_command icub_inertial_commands[ICUB_STRAIN_COMMANDS] = {
    [ICUB_STRAIN_GET_FIRMWARE] = {"GET_FIRMWARE", DO(3, host_protocol), REPLY(8, firmware)},
    [ICUB_STRAIN_SET_ADDRESS] = {"SET_ADDRESS", DO(2, address)},
    [ICUB_INERTIAL_GET_CONFIG] = {"GET_CONFIG", DO(1, NULL), REPLY(8, inertial_config)},
    [ICUB_INERTIAL_SET_CONFIG] = {"SET_CONFIG", DO_UP_TO(4, 8, inertial_config)},
    [ICUB_INERTIAL_TRANSMIT] = {"TRANSMIT", DO(2, FIELDS(U8("period", "ms")))},
};

const struct icub_frame_type icub_motor_frames[16] = {
    [ICUB_POSITION] = {"POSITION", 8, FIELDS(I32("position0", "tick"), I32("position1", "tick"))},
    [ICUB_PID_VALUE] = {"PID_VAL", 8,
        FIELDS(I16("pid0", "pwm"), I16("pid1", "pwm"), I16("pwm0", "pwm"), I16("pwm1", "pwm"))},
    [ICUB_STATUS] = {"STATUS", 8,
        FIELDS(U8("fault0", NULL), U8_OF("mode0", icub_mode_names), U8("fault1", NULL),
               U8_OF("mode1", icub_mode_names),
               U8("can_status", NULL), U8("board_status", NULL), U8("can_tx_errors", NULL),
               U8("can_rx_errors", NULL))},
    [ICUB_CURRENT] = {"CURRENT", 8,
        FIELDS(I16("current0", "mA"), I16("current1", "mA"), PAD, PAD, PAD, PAD)},
    [ICUB_OVERFLOW] = {"OVERFLOW", 0, NULL},
    [ICUB_PRINT] = {"PRINT", 8,
        FIELDS(U8("last", NULL), U8("text_and_part", NULL), U8("c0", NULL), U8("c1", NULL),
               U8("c2", NULL), U8("c3", NULL), U8("c4", NULL), U8("c5", NULL))},
    [ICUB_VELOCITY] = {"VELOCITY", 8,
        FIELDS(I16("velocity0", NULL), I16("velocity1", NULL), I16("acceleration0", NULL),
               I16("acceleration1", NULL))},
    [ICUB_PID_ERROR] = {"PID_ERROR", 8,
        FIELDS(I16("position_error0", "tick"), I16("position_error1", "tick"),
               I16("torque_error0", NULL), I16("torque_error1", NULL))},
    [ICUB_DEBUG] = {"DEBUG", 8,
        FIELDS(I16("torque0", NULL), I16("torque1", NULL), I16("torque_reference0", NULL),
               I16("torque_reference1", NULL))},
    [ICUB_MOTOR_POSITION] = {"MOTOR_POSITION", 8,
        FIELDS(I32("position0", "tick"), I32("position1", "tick"))},
    [ICUB_MOTOR_SPEED] = {"MOTOR_SPEED", 8,
        FIELDS(I16("speed0", NULL), I16("speed1", NULL), I16("acceleration0", NULL),
               I16("acceleration1", NULL))},
    [ICUB_ADDITIONAL_STATUS] = {"ADDITIONAL_STATUS", 1, FIELDS(U8("interaction", NULL))},
};

static const struct field three_channels[] = {
    U16("c0", NULL), U16("c1", NULL), U16("c2", NULL), {.type = FIELD_END}};

const struct icub_frame_type icub_analog_frames[16] = {
    [ICUB_UNCALIBRATED_FORCE] = {"UNCALIBRATED_FORCE", ICUB_STRAIN_LENGTH, three_channels},
    [ICUB_UNCALIBRATED_TORQUE] = {"UNCALIBRATED_TORQUE", ICUB_STRAIN_LENGTH, three_channels},
    [ICUB_FORCE] = {"FORCE", ICUB_STRAIN_LENGTH, three_channels},
    [ICUB_TORQUE] = {"TORQUE", ICUB_STRAIN_LENGTH, three_channels},
};

/* The meaning of x, y and z depends on the sensor. */
const struct icub_frame_type icub_inertial_frames[16] = {
    [ICUB_INERTIAL_TRIPLE] = {"INERTIAL", ICUB_INERTIAL_LENGTH,
        FIELDS(U8("sequence", NULL), U8_OF("sensor", inertial_sensors), I16("x", NULL),
               I16("y", NULL), I16("z", NULL))},
    [ICUB_INERTIAL_QUATERNION] = {"QUATERNION", ICUB_INERTIAL_LENGTH,
        FIELDS(SCALED(FIELD_I16, "w", ICUB_QUATERNION), SCALED(FIELD_I16, "x", ICUB_QUATERNION),
               SCALED(FIELD_I16, "y", ICUB_QUATERNION), SCALED(FIELD_I16, "z", ICUB_QUATERNION))},
};

static const struct field update_ok[] = {U8("ok", NULL), {.type = FIELD_END}};

/* The shortest length of a download frame is the length for DSP boards. Longer frames are valid,
 * because other boards add a memory page. */
static const struct {
    uint8_t code;
    struct icub_command row;
} management[] = {
    {ICUB_START_UPDATE, {"START_UPDATE", DO_UP_TO(1, 8, NULL), REPLY(2, update_ok)}},
    {ICUB_UPDATE_ADDRESS, {"UPDATE_ADDRESS",
        DO_UP_TO(5, 8, FIELDS(U8("bytes", NULL), U16("address", NULL), U8("memory", NULL)))}},
    {ICUB_UPDATE_RUN, {"UPDATE_RUN", DO_UP_TO(5, 8, FIELDS(FIELD(FIELD_U32, "entry", NULL))),
        REPLY(2, update_ok)}},
    {ICUB_UPDATE_DATA, {"UPDATE_DATA",
        DO_UP_TO(2, 8, FIELDS(U8("b0", NULL), U8("b1", NULL), U8("b2", NULL), U8("b3", NULL),
                              U8("b4", NULL), U8("b5", NULL), U8("b6", NULL))),
        REPLY(2, update_ok)}},
    {ICUB_UPDATE_END, {"UPDATE_END", DO(1, NULL), REPLY(2, update_ok)}},
    {ICUB_GET_ADDITIONAL_INFO, {"GET_ADDITIONAL_INFO", DO(1, NULL), REPLY(6, info_part)}},
    {ICUB_SET_ADDITIONAL_INFO, {"SET_ADDITIONAL_INFO", DO(6, info_part)}},
    {ICUB_SET_CAN_ADDRESS, {"SET_CAN_ADDRESS", DO(2, address)}},
    {ICUB_DISCOVER, {"DISCOVER", DO(1, NULL),
        REPLY(5, FIELDS(U8_OF("type", icub_board_names), U8("major", NULL), U8("minor", NULL),
                        U8("build", NULL)))}},
};
/* clang-format on */

const struct icub_command *icub_management_command(uint8_t code)
{
    for (size_t i = 0; i < ARRAY_COUNT(management); i++) {
        if (management[i].code == code) {
            return &management[i].row;
        }
    }
    return NULL;
}
