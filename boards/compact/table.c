/* SPDX-License-Identifier: Apache-2.0 */
/* The rows of the compact protocol. */
#include "boards/compact/table.h"

/* clang-format off */
#define FIELDS(...) (const struct field[]){__VA_ARGS__, {.type = FIELD_END}}
#define VALUE(kind, label, of, by) {.type = kind, .name = label, .unit = of, .scale = by}
#define NUMBER(kind, label) {.type = kind, .name = label}
#define NAMED(kind, label, list) {.type = kind, .name = label, .values = list}
#define BITS(n) (n)
#define SIGNED(n) ((n) | FIELD_SIGNED)
#define GAP(n) {.type = (n) | FIELD_PADDING}

const struct field_value compact_mode_names[] = {
    {COMPACT_OFF, "off"}, {COMPACT_VOLTAGE, "voltage"}, {COMPACT_CURRENT, "current"},
    {COMPACT_FAULT, "fault"}, {0, NULL}};
static const struct field_value kinds[] = {
    {COMPACT_KIND_MOTOR, "motor"}, {COMPACT_KIND_FT, "force_torque"},
    {COMPACT_KIND_INERTIAL, "inertial"}, {0, NULL}};
static const struct field_value results[] = {
    {COMPACT_OK, "ok"}, {COMPACT_UNKNOWN_PARAMETER, "unknown_parameter"},
    {COMPACT_NO_SUCH_AXIS, "no_such_axis"}, {COMPACT_OUT_OF_RANGE, "out_of_range"},
    {COMPACT_READ_ONLY, "read_only"}, {COMPACT_WRONG_LENGTH, "wrong_length"},
    {COMPACT_NOT_NOW, "not_now"}, {0, NULL}};
static const struct field_value parameters[] = {
    {COMPACT_P_KIND, "kind"}, {COMPACT_P_FIRMWARE, "firmware"}, {COMPACT_P_SERIAL, "serial"},
    {COMPACT_P_FIRST_SLOT, "first_slot"}, {COMPACT_P_UPTIME, "uptime"},
    {COMPACT_P_TELEMETRY_PERIOD, "telemetry_period"},
    {COMPACT_P_COMMAND_TIMEOUT, "command_timeout"}, {COMPACT_P_RESTART, "restart"},
    {COMPACT_P_SAVE, "save"}, {COMPACT_P_MODE, "mode"}, {COMPACT_P_FAULTS, "faults"},
    {COMPACT_P_CURRENT_LIMIT, "current_limit"}, {COMPACT_P_MIN_POSITION, "min_position"},
    {COMPACT_P_MAX_POSITION, "max_position"}, {COMPACT_P_CURRENT_KP, "current_kp"},
    {COMPACT_P_CURRENT_KI, "current_ki"}, {COMPACT_P_BACK_EMF, "back_emf"},
    {COMPACT_P_TEMPERATURE_LIMIT, "temperature_limit"},
    {COMPACT_P_FULL_SCALE, "full_scale"},
    {COMPACT_P_TARE, "tare"}, {0, NULL}};

static const struct field force[] = {
    VALUE(FIELD_I16, "fx", "N", COMPACT_FORCE_N), VALUE(FIELD_I16, "fy", "N", COMPACT_FORCE_N),
    VALUE(FIELD_I16, "fz", "N", COMPACT_FORCE_N), {.type = FIELD_END}};
static const struct field moment[] = {
    VALUE(FIELD_I16, "mx", "Nm", COMPACT_MOMENT_NM),
    VALUE(FIELD_I16, "my", "Nm", COMPACT_MOMENT_NM),
    VALUE(FIELD_I16, "mz", "Nm", COMPACT_MOMENT_NM), {.type = FIELD_END}};
static const struct field wrench[] = {
    VALUE(FIELD_I16, "fx", "N", COMPACT_FORCE_N), VALUE(FIELD_I16, "fy", "N", COMPACT_FORCE_N),
    VALUE(FIELD_I16, "fz", "N", COMPACT_FORCE_N),
    VALUE(FIELD_I16, "mx", "Nm", COMPACT_MOMENT_NM),
    VALUE(FIELD_I16, "my", "Nm", COMPACT_MOMENT_NM),
    VALUE(FIELD_I16, "mz", "Nm", COMPACT_MOMENT_NM), {.type = FIELD_END}};

#define ACCELERATION \
    VALUE(FIELD_I16, "ax", "m/s2", COMPACT_ACCELERATION_M_S2), \
    VALUE(FIELD_I16, "ay", "m/s2", COMPACT_ACCELERATION_M_S2), \
    VALUE(FIELD_I16, "az", "m/s2", COMPACT_ACCELERATION_M_S2)
#define RATE \
    VALUE(FIELD_I16, "wx", "rad/s", COMPACT_RATE_RAD_S), \
    VALUE(FIELD_I16, "wy", "rad/s", COMPACT_RATE_RAD_S), \
    VALUE(FIELD_I16, "wz", "rad/s", COMPACT_RATE_RAD_S)
#define ORIENTATION \
    VALUE(FIELD_I16, "qw", NULL, COMPACT_QUATERNION), \
    VALUE(FIELD_I16, "qx", NULL, COMPACT_QUATERNION), \
    VALUE(FIELD_I16, "qy", NULL, COMPACT_QUATERNION), \
    VALUE(FIELD_I16, "qz", NULL, COMPACT_QUATERNION)
#define MAGNETIC \
    VALUE(FIELD_I16, "bx", "uT", COMPACT_MAGNETIC_UT), \
    VALUE(FIELD_I16, "by", "uT", COMPACT_MAGNETIC_UT), \
    VALUE(FIELD_I16, "bz", "uT", COMPACT_MAGNETIC_UT)
static const struct field sensor_state[] = {
    NUMBER(FIELD_U8, "saturated"), NUMBER(FIELD_U16, "faults"),
    VALUE(FIELD_U16, "supply", "V", COMPACT_SUPPLY_V),
    VALUE(FIELD_I8, "temperature", "degC", 1.0), NUMBER(FIELD_U16, "frames"), {.type = FIELD_END}};

const struct compact_message compact_messages[COMPACT_MESSAGES] = {
    {"MODE", COMPACT_MODE, COMPACT_BY_NONE, true, COMPACT_MODE_LENGTH, 1, 0,
     FIELDS(NAMED(FIELD_U8, "mode", compact_mode_names), NUMBER(FIELD_U32, "slots"))},
    {"COMMAND", COMPACT_COMMAND, COMPACT_BY_GROUP, true, 2, COMPACT_SLOTS, 1,
     FIELDS(VALUE(FIELD_I16, "set_point", "V", COMPACT_VOLTAGE_V))},
    {"TELEMETRY", COMPACT_TELEMETRY, COMPACT_BY_SLOT, false, COMPACT_TELEMETRY_LENGTH, 1, 1,
     FIELDS(VALUE(SIGNED(22), "motor_position", "rad", COMPACT_POSITION_RAD),
            VALUE(SIGNED(16), "deflection", "rad", COMPACT_POSITION_RAD),
            VALUE(SIGNED(12), "current", "A", COMPACT_CURRENT_A),
            VALUE(SIGNED(12), "torque", "Nm", COMPACT_TORQUE_NM), NUMBER(BITS(2), "sequence"))},
    {"TELEMETRY_FD", COMPACT_TELEMETRY_FD, COMPACT_BY_NODE, false, COMPACT_TELEMETRY_FD_LENGTH,
     COMPACT_BOARD_AXES, 1,
     FIELDS(VALUE(FIELD_I32, "motor_position", "rad", COMPACT_POSITION_RAD),
            VALUE(FIELD_I32, "link_position", "rad", COMPACT_POSITION_RAD),
            VALUE(FIELD_I16, "motor_velocity", "rad/s", COMPACT_VELOCITY_RAD_S),
            VALUE(FIELD_I16, "current", "A", COMPACT_SET_CURRENT_A),
            VALUE(FIELD_I24, "torque", "Nm", COMPACT_TORQUE_FD_NM),
            NAMED(BITS(3), "mode", compact_mode_names), NUMBER(BITS(1), "fault"),
            NUMBER(BITS(4), "sequence"))},
    {"FORCE", COMPACT_FORCE, COMPACT_BY_NODE, false, COMPACT_FORCE_LENGTH, 1, 1, force},
    {"MOMENT", COMPACT_MOMENT, COMPACT_BY_NODE, false, COMPACT_FORCE_LENGTH, 1, 1, moment},
    {"WRENCH_FD", COMPACT_WRENCH_FD, COMPACT_BY_NODE, false, COMPACT_WRENCH_FD_LENGTH, 1, 1,
     wrench},
    {"ACCELERATION", COMPACT_ACCELERATION, COMPACT_BY_NODE, false, COMPACT_ACCELERATION_LENGTH, 1,
     1, FIELDS(ACCELERATION)},
    {"RATE", COMPACT_RATE, COMPACT_BY_NODE, false, COMPACT_ACCELERATION_LENGTH, 1, 1,
     FIELDS(RATE)},
    {"ORIENTATION", COMPACT_ORIENTATION, COMPACT_BY_NODE, false, COMPACT_ORIENTATION_LENGTH, 1, 1,
     FIELDS(ORIENTATION)},
    {"STATE", COMPACT_STATE, COMPACT_BY_SLOT, false, COMPACT_STATE_LENGTH, 1,
     COMPACT_STATE_PERIOD_MS,
     FIELDS(NAMED(BITS(3), "mode", compact_mode_names), GAP(1), NUMBER(BITS(4), "commands"),
            NUMBER(FIELD_U16, "faults"), VALUE(FIELD_U16, "supply", "V", COMPACT_SUPPLY_V),
            VALUE(FIELD_I8, "temperature", "degC", 1.0),
            VALUE(FIELD_I16, "voltage", "V", COMPACT_VOLTAGE_V))},
    {"FT_STATE", COMPACT_FT_STATE, COMPACT_BY_NODE, false, COMPACT_STATE_LENGTH, 1,
     COMPACT_STATE_PERIOD_MS, sensor_state},
    {"INERTIAL_FD", COMPACT_INERTIAL_FD, COMPACT_BY_NODE, false, COMPACT_INERTIAL_FD_LENGTH, 1, 1,
     FIELDS(ACCELERATION, RATE, ORIENTATION, MAGNETIC,
            VALUE(FIELD_I16, "roll", "rad", COMPACT_EULER_RAD),
            VALUE(FIELD_I16, "pitch", "rad", COMPACT_EULER_RAD),
            VALUE(FIELD_I16, "yaw", "rad", COMPACT_EULER_RAD))},
    {"MAGNETIC", COMPACT_MAGNETIC, COMPACT_BY_NODE, false, COMPACT_ACCELERATION_LENGTH, 1,
     COMPACT_STATE_PERIOD_MS, FIELDS(MAGNETIC)},
    {"INERTIAL_STATE", COMPACT_INERTIAL_STATE, COMPACT_BY_NODE, false, COMPACT_STATE_LENGTH, 1,
     COMPACT_STATE_PERIOD_MS, sensor_state},
    {"REQUEST", COMPACT_REQUEST, COMPACT_BY_NODE, true, COMPACT_WRITE_LENGTH, 1, 0,
     FIELDS(NAMED(BITS(7), "parameter", parameters), NUMBER(BITS(1), "write"),
            NUMBER(FIELD_U8, "axis"), NUMBER(FIELD_I32, "value"))},
    {"REPLY", COMPACT_REPLY, COMPACT_BY_NODE, false, COMPACT_REPLY_LENGTH, 1, 0,
     FIELDS(NAMED(BITS(7), "parameter", parameters), NUMBER(BITS(1), "write"),
            NUMBER(FIELD_U8, "axis"), NUMBER(FIELD_I32, "value"),
            NAMED(FIELD_U8, "result", results))},
    {"IDENTITY", COMPACT_IDENTITY, COMPACT_BY_NODE, false, COMPACT_IDENTITY_LENGTH, 1, 0,
     FIELDS(NAMED(FIELD_U8, "kind", kinds), NUMBER(FIELD_U8, "axes"),
            NUMBER(FIELD_U8, "first_slot"), NUMBER(FIELD_U8, "protocol"),
            NUMBER(FIELD_U8, "firmware_major"), NUMBER(FIELD_U8, "firmware_minor"),
            NUMBER(FIELD_U16, "firmware_build"))},
    {"DISCOVER", COMPACT_DISCOVER, COMPACT_BY_NONE, true, 0, 1, 0, NULL},
};
/* clang-format on */

const struct compact_message *compact_message(unsigned function)
{
    for (size_t i = 0; i < COMPACT_MESSAGES; i++) {
        if (compact_messages[i].function == function) {
            return &compact_messages[i];
        }
    }
    return NULL;
}
