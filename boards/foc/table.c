/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The rows of protocol foc. The sources of commands 82 to 126 are iCubCanProto_motorControlMessages
 * (robotology/icub-firmware-shared, 2024 to 2026), and for layouts and answers
 * embot_prot_can_motor_polling and embot_app_bldc_theMC2agent (robotology/icub-firmware, 2026).
 * That firmware answers GET_TEMPERATURE_LIMIT with 666 always; these boards answer the limit in
 * force.
 */
#include "boards/foc/table.h"

/* clang-format off */
#define FIELDS(...) (const struct field[]){__VA_ARGS__, {.type = FIELD_END}}
#define U8(label)        {.type = FIELD_U8, .name = label}
#define U8_OF(label, list) {.type = FIELD_U8, .name = label, .values = list}
#define I16(label, of)   {.type = FIELD_I16, .name = label, .unit = of}
#define F32(label)       {.type = FIELD_F32, .name = label}
#define PAD              {.type = FIELD_PAD}

#define DO(length, fields) \
    .kind = ICUB_DO, .request_min = length, .request_max = length, .request = fields
#define DO_UP_TO(shortest, longest, fields) \
    .kind = ICUB_DO, .request_min = shortest, .request_max = longest, .request = fields
#define REPLY(length, fields) .reply_length = length, .reply = fields
#define GET(first, length, fields) \
    .kind = ICUB_GET, .parameter = first, .request_min = 1, .request_max = 1, \
    .reply_length = length, .reply = fields
#define SET_GET(of, message, first, shortest, longest, fields) \
    [of##_SET_##message] = {"SET_" #message, ICUB_SET, first, shortest, longest, 0, fields, NULL}, \
    [of##_GET_##message] = {"GET_" #message, GET(first, shortest, fields)}

static const struct field_value loops[] = {
    {FOC_LOOP_CURRENT, "current"}, {FOC_LOOP_VELOCITY, "velocity"},
    {FOC_LOOP_POSITION, "position"}, {FOC_PID_NONE, "none"}, {0, NULL}};
static const struct field_value pid_parameters[] = {
    {FOC_PID_KP, "kp"}, {FOC_PID_KI, "ki"}, {FOC_PID_KD, "kd"},
    {FOC_PID_INTEGRAL_LIMIT, "integral_limit"}, {FOC_PID_OUTPUT_LIMIT, "output_limit"},
    {FOC_PID_KFF, "kff"}, {FOC_PID_STICTION_UP, "stiction_up"},
    {FOC_PID_STICTION_DOWN, "stiction_down"}, {FOC_PID_NONE, "none"}, {0, NULL}};
static const struct field_value motor_parameters[] = {
    {FOC_MOTOR_BEMF, "bemf"}, {FOC_MOTOR_HALL, "hall"}, {FOC_MOTOR_MAX_VELOCITY, "max_velocity"},
    {0, NULL}};

static const struct field mode[] = {U8_OF("mode", icub_mode_names), {.type = FIELD_END}};
static const struct field address[] = {
    {.type = FIELD_U8, .name = "address", .min = 1, .max = ICUB_ADDRESS_MAX},
    {.type = FIELD_END}};
static const struct field pid[] = {
    I16("kp", NULL), I16("ki", NULL), I16("kd", NULL),
    {.type = FIELD_U8, .name = "shift", .min = 0, .max = 15}, {.type = FIELD_END}};
static const struct field pid_limits[] = {
    I16("offset", NULL), I16("limit", NULL), I16("integral_limit", NULL), {.type = FIELD_END}};
static const struct field current_limits[] = {
    PAD, I16("nominal", "mA"), I16("peak", "mA"), I16("overload", "mA"), {.type = FIELD_END}};
static const struct field motor_config[] = {
    U8("flags"), I16("resolution", "tick"), I16("index_offset", "deg"),
    {.type = FIELD_I8, .name = "poles"}, U8("tolerance"), {.type = FIELD_END}};
static const struct field temperature_limit[] = {
    {.type = FIELD_I16, .name = "limit", .unit = "degC", .scale = 0.1}, {.type = FIELD_END}};
static const struct field pid_value[] = {
    U8_OF("loop", loops), U8_OF("parameter", pid_parameters), PAD, F32("value"),
    {.type = FIELD_END}};
static const struct field motor_parameter[] = {
    U8_OF("parameter", motor_parameters), F32("value"), {.type = FIELD_END}};

const struct icub_command foc_commands[ICUB_MOTOR_COMMANDS] = {
    [FOC_GET_MOTOR_PARAMETER] = {"GET_MOTOR_PARAMETER",
        DO(2, FIELDS(U8_OF("parameter", motor_parameters))), REPLY(6, motor_parameter)},
    [FOC_SET_MOTOR_PARAMETER] = {"SET_MOTOR_PARAMETER", DO(6, motor_parameter)},
    [ICUB_GET_CONTROL_MODE] = {"GET_CONTROL_MODE", DO(1, NULL), REPLY(2, mode)},
    [FOC_SET_CONTROL_MODE] = {"SET_CONTROL_MODE", DO(2, mode)},
    [ICUB_SET_DESIRED_VELOCITY] = {"SET_DESIRED_VELOCITY",
        DO(5, FIELDS(I16("velocity", "icubdeg/ms"), I16("acceleration", NULL)))},
    [ICUB_SET_BOARD_ID] = {"SET_BOARD_ID", DO(2, address)},
    [ICUB_GET_BOARD_ID] = {"GET_BOARD_ID", DO(1, NULL), REPLY(2, address)},
    /* A request of five bytes has only the peak, in bytes 1 and 2 */
    [FOC_SET_CURRENT_LIMIT] = {"SET_CURRENT_LIMIT",
        DO_UP_TO(5, 8, current_limits)},
    [ICUB_SET_POSITION_PID] = {"SET_POSITION_PID", DO(8, pid), .parameter = FOC_P_POSITION_PID},
    [ICUB_GET_POSITION_PID] = {"GET_POSITION_PID", GET(FOC_P_POSITION_PID, 8, pid)},
    SET_GET(ICUB, POSITION_PID_LIMITS, FOC_P_POSITION_LIMITS, 7, 8, pid_limits),
    [FOC_GET_FIRMWARE_VERSION] = {"GET_FIRMWARE_VERSION",
        DO(3, FIELDS(U8("major"), U8("minor"))),
        REPLY(8, FIELDS(U8_OF("type", icub_board_names), U8("major"), U8("version"), U8("build"),
                        U8("protocol_major"), U8("protocol_minor"), U8("ack")))},
    /* A request of six bytes sets one gain: byte 1 is 1 for kp, 2 for ki; a float32 follows */
    [FOC_SET_CURRENT_PID] = {"SET_CURRENT_PID", DO_UP_TO(6, 8, pid)},
    [FOC_GET_CURRENT_PID] = {"GET_CURRENT_PID", GET(FOC_P_CURRENT_PID, 8, pid)},
    SET_GET(FOC, CURRENT_PID_LIMITS, FOC_P_CURRENT_LIMITS, 7, 8, pid_limits),
    [FOC_SET_VELOCITY_PID] = {"SET_VELOCITY_PID", DO_UP_TO(6, 8, pid),
        .parameter = FOC_P_VELOCITY_PID},
    [FOC_GET_VELOCITY_PID] = {"GET_VELOCITY_PID", GET(FOC_P_VELOCITY_PID, 8, pid)},
    SET_GET(FOC, VELOCITY_PID_LIMITS, FOC_P_VELOCITY_LIMITS, 7, 8, pid_limits),
    [ICUB_SET_I2T] = {"SET_I2T", DO(5, FIELDS(I16("parameter", NULL), I16("threshold", NULL)))},
    [ICUB_SET_OPEN_LOOP] = {"SET_OPEN_LOOP", DO(3, FIELDS(I16("pwm", "pwm")))},
    [FOC_SET_MOTOR_CONFIG] = {"SET_MOTOR_CONFIG", DO_UP_TO(7, 8, motor_config)},
    SET_GET(FOC, TEMPERATURE_LIMIT, FOC_P_TEMPERATURE_LIMIT, 3, 3, temperature_limit),
    [FOC_GET_MOTOR_CONFIG] = {"GET_MOTOR_CONFIG", GET(FOC_P_FLAGS, 8, motor_config)},
    [FOC_GET_CURRENT_LIMIT] = {"GET_CURRENT_LIMIT", GET(FOC_P_NOMINAL, 8, current_limits)},
    [FOC_SET_PID] = {"SET_PID", DO(8, pid_value)},
    [FOC_GET_PID] = {"GET_PID",
        DO(3, FIELDS(U8_OF("loop", loops), U8_OF("parameter", pid_parameters))),
        REPLY(8, pid_value)},
};

const struct icub_frame_type foc_frames[16] = {
    [FOC_FEEDBACK] = {"FOC", FOC_FEEDBACK_LENGTH,
        FIELDS(I16("current", "mA"), I16("velocity", "icubdeg/ms"),
               {.type = FIELD_I32, .name = "position", .unit = "icubdeg"})},
    [FOC_STATUS] = {"STATUS", FOC_STATUS_LENGTH,
        FIELDS(U8_OF("mode", icub_mode_names), U8("encoder"),
               {.type = FIELD_I16, .name = "pwm", .unit = "%", .scale = 100.0 / FOC_PWM_FULL_SCALE},
               {.type = FIELD_U32, .name = "faults"})},
    [FOC_ADDITIONAL_STATUS] = {"ADDITIONAL_STATUS", FOC_ADDITIONAL_STATUS_LENGTH,
        FIELDS(PAD, PAD,
               {.type = FIELD_I16, .name = "temperature", .unit = "degC", .scale = 0.1})},
    [FOC_DESIRED_TARGETS] = {"DESIRED_TARGETS", FOC_TARGETS_LENGTH,
        FIELDS(I16("target1", NULL), I16("target2", NULL), I16("target3", NULL),
               I16("target4", NULL))},
};
/* clang-format on */
