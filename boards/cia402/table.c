/* SPDX-License-Identifier: Apache-2.0 */
/* The rows of the object dictionary, by index. */
#include "boards/cia402/private.h"

#include "base/array.h"

/* clang-format off */
#define NODE(field) offsetof(struct cia402_node, field)
#define SETTING(field) offsetof(struct cia402_node, settings.field)
#define PDO(field) offsetof(struct cia402_pdo, field)
#define AXIS(field) offsetof(struct cia402_axis, field)
#define OPTION(field) offsetof(struct cia402_axis, settings.field)
#define SENSOR(field) offsetof(struct cia402_sensor, field)

#define RO_MAP (CIA402_RO | CIA402_MAP_TPDO)
#define RW_MAP (CIA402_RW | CIA402_MAP_RPDO)
#define RAD "rad", CIA402_POSITION_RAD
#define RAD_S "rad/s", CIA402_POSITION_RAD
#define RAD_S2 "rad/s2", CIA402_POSITION_RAD
#define PER_MILLE "%", 0.1
#define MILLIS "s", 1e-3
#define VOLTS "V", CIA402_VOLTAGE_V
#define NO_UNIT NULL, 0.0
#define ANY 0, 0

enum {
    GAIN_MAX = 1000000000,
    MODES = 1 << 0 | 1 << 2 | 1 << 3 | 1 << 5 | 1 << 7 | 1 << 8 | 1 << 9 | 1 << 16,
};

const struct cia402_object cia402_objects[] = {
    /* Communication, CiA 301 */
    {0x1000, 0, 1, CIA402_OF_NODE, CIA402_U32, CIA402_RO, "Device type", NO_UNIT, 0, ANY,
     NODE(device_type), NULL},
    {0x1001, 0, 1, CIA402_OF_NODE, CIA402_U8, RO_MAP, "Error register", NO_UNIT, 0, ANY,
     NODE(error_register), NULL},
    {0x1003, 0, 1, CIA402_OF_NODE, CIA402_U8, CIA402_RW, "Number of errors", NO_UNIT, 0, ANY,
     NODE(history_count), cia402_emcy_write_history},
    {0x1003, 1, CIA402_HISTORY, CIA402_OF_NODE, CIA402_U32, CIA402_RO, "Pre-defined error field",
     NO_UNIT, 0, ANY, NODE(history), NULL},
    {0x1005, 0, 1, CIA402_OF_NODE, CIA402_U32, CIA402_RW, "COB-ID SYNC message", NO_UNIT,
     CIA402_SYNC, ANY, SETTING(cob_sync), cia402_write_cob},
    {0x1008, 0, 1, CIA402_OF_NODE, CIA402_TEXT, CIA402_CONST, "Manufacturer device name", NO_UNIT,
     0, ANY, NODE(device), NULL},
    {0x1009, 0, 1, CIA402_OF_NODE, CIA402_TEXT, CIA402_CONST, "Manufacturer hardware version",
     NO_UNIT, 0, ANY, NODE(hardware), NULL},
    {0x100a, 0, 1, CIA402_OF_NODE, CIA402_TEXT, CIA402_CONST, "Manufacturer software version",
     NO_UNIT, 0, ANY, NODE(software), NULL},
    {0x100c, 0, 1, CIA402_OF_NODE, CIA402_U16, CIA402_RW, "Guard time", MILLIS, 0, ANY,
     SETTING(guard_ms), NULL},
    {0x100d, 0, 1, CIA402_OF_NODE, CIA402_U8, CIA402_RW, "Life time factor", NO_UNIT, 0, ANY,
     SETTING(life_factor), NULL},
    {0x1010, 1, 1, CIA402_OF_NODE, CIA402_U32, CIA402_RW, "Store all parameters", NO_UNIT, 1, ANY,
     NODE(storage), cia402_node_write_store},
    {0x1011, 1, 1, CIA402_OF_NODE, CIA402_U32, CIA402_RW, "Restore all default parameters",
     NO_UNIT, 1, ANY, NODE(storage), cia402_node_write_restore},
    {0x1014, 0, 1, CIA402_OF_NODE, CIA402_U32, CIA402_RW | CIA402_PLUS_NODE, "COB-ID EMCY",
     NO_UNIT, CIA402_EMCY, ANY, SETTING(cob_emcy), cia402_write_emcy_cob},
    {0x1015, 0, 1, CIA402_OF_NODE, CIA402_U16, CIA402_RW, "Inhibit time EMCY", "s", 1e-4, 0, ANY,
     SETTING(emcy_inhibit_100us), NULL},
    {0x1016, 1, 1, CIA402_OF_NODE, CIA402_U32, CIA402_RW, "Consumer heartbeat time", NO_UNIT, 0,
     ANY, SETTING(consumer), cia402_nmt_write_consumer},
    {0x1017, 0, 1, CIA402_OF_NODE, CIA402_U16, CIA402_RW, "Producer heartbeat time", MILLIS, 0,
     ANY, SETTING(producer_ms), cia402_nmt_write_producer},
    {0x1018, 1, 4, CIA402_OF_NODE, CIA402_U32, CIA402_RO, "Identity", NO_UNIT, 0, ANY,
     NODE(identity), NULL},
    {0x1029, 1, 1, CIA402_OF_NODE, CIA402_U8, CIA402_RW, "Communication error behavior", NO_UNIT,
     0, 0, 2, SETTING(error_behavior), NULL},
    {0x1200, 1, 1, CIA402_OF_NODE, CIA402_U32, CIA402_RO | CIA402_PLUS_NODE,
     "COB-ID SDO client to server", NO_UNIT, CIA402_SDO_REQUEST, ANY, NODE(sdo_request), NULL},
    {0x1200, 2, 1, CIA402_OF_NODE, CIA402_U32, CIA402_RO | CIA402_PLUS_NODE,
     "COB-ID SDO server to client", NO_UNIT, CIA402_SDO_REPLY, ANY, NODE(sdo_reply), NULL},
    {0x1400, 1, 1, CIA402_OF_RPDO, CIA402_U32, CIA402_RW, "RPDO COB-ID", NO_UNIT, 0, ANY,
     PDO(cob_id), cia402_pdo_write_cob},
    {0x1400, 2, 1, CIA402_OF_RPDO, CIA402_U8, CIA402_RW, "RPDO transmission type", NO_UNIT, 255,
     ANY, PDO(type), cia402_pdo_write_type},
    {0x1600, 0, 1, CIA402_OF_RPDO, CIA402_U8, CIA402_RW, "RPDO mapped objects", NO_UNIT, 0, ANY,
     PDO(count), cia402_pdo_write_count},
    {0x1600, 1, CIA402_MAPPED_MAX, CIA402_OF_RPDO, CIA402_U32, CIA402_RW, "RPDO mapping", NO_UNIT,
     0, ANY, PDO(object), cia402_pdo_write_object},
    {0x1800, 1, 1, CIA402_OF_TPDO, CIA402_U32, CIA402_RW, "TPDO COB-ID", NO_UNIT, 0, ANY,
     PDO(cob_id), cia402_pdo_write_cob},
    {0x1800, 2, 1, CIA402_OF_TPDO, CIA402_U8, CIA402_RW, "TPDO transmission type", NO_UNIT, 255,
     ANY, PDO(type), cia402_pdo_write_type},
    {0x1800, 3, 1, CIA402_OF_TPDO, CIA402_U16, CIA402_RW, "TPDO inhibit time", "s", 1e-4, 0, ANY,
     PDO(inhibit_100us), cia402_pdo_write_inhibit},
    {0x1800, 5, 1, CIA402_OF_TPDO, CIA402_U16, CIA402_RW, "TPDO event timer", MILLIS, 0, ANY,
     PDO(event_ms), NULL},
    {0x1a00, 0, 1, CIA402_OF_TPDO, CIA402_U8, CIA402_RW, "TPDO mapped objects", NO_UNIT, 0, ANY,
     PDO(count), cia402_pdo_write_count},
    {0x1a00, 1, CIA402_MAPPED_MAX, CIA402_OF_TPDO, CIA402_U32, CIA402_RW, "TPDO mapping", NO_UNIT,
     0, ANY, PDO(object), cia402_pdo_write_object},

    /* Ours */
    {0x2000, 0, 1, CIA402_OF_NODE, CIA402_TEXT, CIA402_RW, "User text", NO_UNIT, 0, ANY,
     NODE(note), NULL},
    {0x2001, 0, 1, CIA402_OF_NODE, CIA402_DOMAIN, CIA402_RW, "User data", NO_UNIT, 0, ANY,
     NODE(data), NULL},
    {0x2100, 0, 1, CIA402_OF_SENSOR, CIA402_U16, RO_MAP, "Saturated channels", NO_UNIT, 0, ANY,
     SENSOR(saturated), NULL},
    {0x2101, 0, 1, CIA402_OF_SENSOR, CIA402_U32, RO_MAP, "Faults", NO_UNIT, 0, ANY,
     SENSOR(faults), NULL},
    {0x2102, 1, CIA402_SENSOR_CHANNELS, CIA402_OF_SENSOR, CIA402_I16, CIA402_RW, "Tare", NO_UNIT,
     0, ANY, SENSOR(tare), cia402_sensor_write_tare},
    {0x4000, 0, 1, CIA402_OF_AXIS, CIA402_I16, RW_MAP, "Target voltage", VOLTS, 0, ANY,
     AXIS(target_voltage), cia402_axis_write_target},
    {0x4001, 0, 1, CIA402_OF_AXIS, CIA402_I16, RO_MAP, "Voltage actual value", VOLTS, 0, ANY,
     AXIS(voltage), NULL},
    {0x4002, 0, 1, CIA402_OF_AXIS, CIA402_I32, RO_MAP, "Link encoder", RAD, 0, ANY,
     AXIS(link_encoder), NULL},
    {0x4003, 0, 1, CIA402_OF_AXIS, CIA402_I32, RO_MAP, "Motor encoder", RAD, 0, ANY,
     AXIS(motor_encoder), NULL},
    {0x4004, 0, 1, CIA402_OF_AXIS, CIA402_I16, RO_MAP, "Spring deflection", RAD, 0, ANY,
     AXIS(deflection), NULL},
    {0x4005, 0, 1, CIA402_OF_AXIS, CIA402_I16, RO_MAP, "Spring torque", "Nm", CIA402_SPRING_NM, 0,
     ANY, AXIS(spring_torque), NULL},
    {0x4006, 0, 1, CIA402_OF_AXIS, CIA402_I16, RO_MAP, "Winding temperature", "degC", 1.0, 0, ANY,
     AXIS(temperature_c), NULL},
    {0x4007, 0, 1, CIA402_OF_AXIS, CIA402_I16, RO_MAP, "Winding current", "A", 1e-3, 0, ANY,
     AXIS(current_ma), NULL},
    {0x4008, 1, 2, CIA402_OF_AXIS, CIA402_U16, RO_MAP, "Chamber pressure", "bar",
     CIA402_PRESSURE_BAR, 0, ANY, AXIS(pressure), NULL},
    {0x4009, 0, 1, CIA402_OF_AXIS, CIA402_I16, RO_MAP, "Valve opening", PER_MILLE, 0, ANY,
     AXIS(valve_opening), NULL},
    {0x4010, 0, 1, CIA402_OF_AXIS, CIA402_U32, RO_MAP, "Faults", NO_UNIT, 0, ANY, AXIS(faults),
     NULL},
    {0x4011, 0, 1, CIA402_OF_AXIS, CIA402_U16, CIA402_RW, "Command time-out", MILLIS, 0, ANY,
     OPTION(timeout_ms), NULL},
    {0x4012, 0, 1, CIA402_OF_AXIS, CIA402_U32, CIA402_RW, "Current limit", "A", 1e-3, 1, 1,
     INT32_MAX, OPTION(current_limit_ma), cia402_axis_write_limit},
    {0x4013, 0, 1, CIA402_OF_AXIS, CIA402_I16, CIA402_RW, "Temperature limit", "degC", 1.0, 125, 1,
     125, OPTION(temperature_limit_c), cia402_axis_write_limit},
    {0x4014, 1, 3, CIA402_OF_AXIS, CIA402_I32, CIA402_RW, "Current loop gain", NO_UNIT, 0, 0,
     GAIN_MAX, OPTION(current_gain), cia402_axis_write_when_off},
    {0x4015, 1, 3, CIA402_OF_AXIS, CIA402_I32, CIA402_RW, "Velocity loop gain", NO_UNIT, 0, 0,
     GAIN_MAX, OPTION(velocity_gain), cia402_axis_write_when_off},
    {0x4016, 0, 1, CIA402_OF_AXIS, CIA402_I32, CIA402_RW, "Position loop gain", "1/s", 0.1, 400, 0,
     GAIN_MAX, OPTION(position_gain), cia402_axis_write_when_off},

    /* Drives, CiA 402 */
    {0x6007, 0, 1, CIA402_OF_AXIS, CIA402_I16, CIA402_RW, "Abort connection option code", NO_UNIT,
     1, 0, 3, OPTION(abort_option), NULL},
    {0x603f, 0, 1, CIA402_OF_AXIS, CIA402_U16, RO_MAP, "Error code", NO_UNIT, 0, ANY,
     AXIS(error_code), NULL},
    {0x6040, 0, 1, CIA402_OF_AXIS, CIA402_U16, RW_MAP, "Controlword", NO_UNIT, 0, ANY,
     AXIS(controlword), cia402_axis_write_controlword},
    {0x6041, 0, 1, CIA402_OF_AXIS, CIA402_U16, RO_MAP, "Statusword", NO_UNIT, 0, ANY,
     AXIS(statusword), NULL},
    {0x605a, 0, 1, CIA402_OF_AXIS, CIA402_I16, CIA402_RW, "Quick stop option code", NO_UNIT, 2, 0,
     7, OPTION(quick_stop_option), cia402_axis_write_option},
    {0x605b, 0, 1, CIA402_OF_AXIS, CIA402_I16, CIA402_RW, "Shutdown option code", NO_UNIT, 0, 0, 1,
     OPTION(shutdown_option), NULL},
    {0x605c, 0, 1, CIA402_OF_AXIS, CIA402_I16, CIA402_RW, "Disable operation option code", NO_UNIT,
     1, 0, 1, OPTION(disable_option), NULL},
    {0x605d, 0, 1, CIA402_OF_AXIS, CIA402_I16, CIA402_RW, "Halt option code", NO_UNIT, 1, 1, 2,
     OPTION(halt_option), NULL},
    {0x605e, 0, 1, CIA402_OF_AXIS, CIA402_I16, CIA402_RW, "Fault reaction option code", NO_UNIT, 2,
     0, 2, OPTION(fault_option), NULL},
    {0x6060, 0, 1, CIA402_OF_AXIS, CIA402_I8, RW_MAP, "Modes of operation", NO_UNIT, 0, ANY,
     OPTION(mode), cia402_axis_write_mode},
    {0x6061, 0, 1, CIA402_OF_AXIS, CIA402_I8, RO_MAP, "Modes of operation display", NO_UNIT, 0,
     ANY, AXIS(mode_display), NULL},
    {0x6062, 0, 1, CIA402_OF_AXIS, CIA402_I32, RO_MAP, "Position demand value", RAD, 0, ANY,
     AXIS(position_demand), NULL},
    {0x6064, 0, 1, CIA402_OF_AXIS, CIA402_I32, RO_MAP, "Position actual value", RAD, 0, ANY,
     AXIS(position), NULL},
    {0x6065, 0, 1, CIA402_OF_AXIS, CIA402_U32, CIA402_RW, "Following error window", RAD,
     UINT32_MAX, ANY, OPTION(following_window), NULL},
    {0x6066, 0, 1, CIA402_OF_AXIS, CIA402_U16, CIA402_RW, "Following error time out", MILLIS, 0,
     ANY, OPTION(following_timeout_ms), NULL},
    {0x6067, 0, 1, CIA402_OF_AXIS, CIA402_U32, CIA402_RW, "Position window", RAD, 1000, ANY,
     OPTION(position_window), NULL},
    {0x6068, 0, 1, CIA402_OF_AXIS, CIA402_U16, CIA402_RW, "Position window time", MILLIS, 0, ANY,
     OPTION(position_window_ms), NULL},
    {0x606b, 0, 1, CIA402_OF_AXIS, CIA402_I32, RO_MAP, "Velocity demand value", RAD_S, 0, ANY,
     AXIS(velocity_demand), NULL},
    {0x606c, 0, 1, CIA402_OF_AXIS, CIA402_I32, RO_MAP, "Velocity actual value", RAD_S, 0, ANY,
     AXIS(velocity), NULL},
    {0x606d, 0, 1, CIA402_OF_AXIS, CIA402_U16, CIA402_RW, "Velocity window", RAD_S, 5000, ANY,
     OPTION(velocity_window), NULL},
    {0x606e, 0, 1, CIA402_OF_AXIS, CIA402_U16, CIA402_RW, "Velocity window time", MILLIS, 0, ANY,
     OPTION(velocity_window_ms), NULL},
    {0x606f, 0, 1, CIA402_OF_AXIS, CIA402_U16, CIA402_RW, "Velocity threshold", RAD_S, 5000, ANY,
     OPTION(velocity_threshold), NULL},
    {0x6070, 0, 1, CIA402_OF_AXIS, CIA402_U16, CIA402_RW, "Velocity threshold time", MILLIS, 0,
     ANY, OPTION(velocity_threshold_ms), NULL},
    {0x6071, 0, 1, CIA402_OF_AXIS, CIA402_I16, RW_MAP, "Target torque", PER_MILLE, 0, ANY,
     AXIS(target_torque), cia402_axis_write_target},
    {0x6072, 0, 1, CIA402_OF_AXIS, CIA402_U16, RW_MAP, "Max torque", PER_MILLE, 1000, ANY,
     OPTION(max_torque), NULL},
    {0x6073, 0, 1, CIA402_OF_AXIS, CIA402_U16, CIA402_RW, "Max current", PER_MILLE, 1000, ANY,
     OPTION(max_current), NULL},
    {0x6074, 0, 1, CIA402_OF_AXIS, CIA402_I16, RO_MAP, "Torque demand", PER_MILLE, 0, ANY,
     AXIS(torque_demand), NULL},
    {0x6075, 0, 1, CIA402_OF_AXIS, CIA402_U32, CIA402_RO, "Motor rated current", "A", 1e-3, 0, ANY,
     AXIS(rated_current_ma), NULL},
    {0x6076, 0, 1, CIA402_OF_AXIS, CIA402_U32, CIA402_RO, "Motor rated torque", "Nm", 1e-3, 0, ANY,
     AXIS(rated_torque_mnm), NULL},
    {0x6077, 0, 1, CIA402_OF_AXIS, CIA402_I16, RO_MAP, "Torque actual value", PER_MILLE, 0, ANY,
     AXIS(torque), NULL},
    {0x6078, 0, 1, CIA402_OF_AXIS, CIA402_I16, RO_MAP, "Current actual value", PER_MILLE, 0, ANY,
     AXIS(current), NULL},
    {0x6079, 0, 1, CIA402_OF_AXIS, CIA402_U32, RO_MAP, "DC link circuit voltage", "V", 1e-3, 0,
     ANY, AXIS(supply_mv), NULL},
    {0x607a, 0, 1, CIA402_OF_AXIS, CIA402_I32, RW_MAP, "Target position", RAD, 0, ANY,
     AXIS(target_position), cia402_axis_write_target},
    {0x607b, 1, 1, CIA402_OF_AXIS, CIA402_I32, CIA402_RW, "Min position range limit", RAD,
     INT32_MIN, ANY, OPTION(position_range[0]), cia402_axis_write_range},
    {0x607b, 2, 1, CIA402_OF_AXIS, CIA402_I32, CIA402_RW, "Max position range limit", RAD,
     INT32_MAX, ANY, OPTION(position_range[1]), cia402_axis_write_range},
    {0x607c, 0, 1, CIA402_OF_AXIS, CIA402_I32, CIA402_RW, "Home offset", RAD, 0, ANY,
     OPTION(home_offset), NULL},
    {0x607d, 1, 2, CIA402_OF_AXIS, CIA402_I32, CIA402_RW, "Software position limit", RAD, 0, ANY,
     OPTION(position_limit), NULL},
    {0x607f, 0, 1, CIA402_OF_AXIS, CIA402_U32, CIA402_RW, "Max profile velocity", RAD_S, 1000000,
     ANY, OPTION(max_profile_velocity), NULL},
    {0x6080, 0, 1, CIA402_OF_AXIS, CIA402_U32, CIA402_RW, "Max motor speed", "rpm", 1.0,
     100000, ANY, OPTION(max_motor_rpm), NULL},
    {0x6081, 0, 1, CIA402_OF_AXIS, CIA402_U32, RW_MAP, "Profile velocity", RAD_S, 100000, ANY,
     OPTION(profile_velocity), NULL},
    {0x6083, 0, 1, CIA402_OF_AXIS, CIA402_U32, RW_MAP, "Profile acceleration", RAD_S2, 1000000, 1,
     UINT32_MAX, OPTION(profile_acceleration), NULL},
    {0x6084, 0, 1, CIA402_OF_AXIS, CIA402_U32, RW_MAP, "Profile deceleration", RAD_S2, 1000000, 1,
     UINT32_MAX, OPTION(profile_deceleration), NULL},
    {0x6085, 0, 1, CIA402_OF_AXIS, CIA402_U32, RW_MAP, "Quick stop deceleration", RAD_S2, 5000000,
     1, UINT32_MAX, OPTION(quick_stop_deceleration), NULL},
    {0x6086, 0, 1, CIA402_OF_AXIS, CIA402_I16, RW_MAP, "Motion profile type", NO_UNIT, 0, ANY,
     OPTION(motion_profile_type), cia402_axis_write_profile_type},
    {0x6087, 0, 1, CIA402_OF_AXIS, CIA402_U32, RW_MAP, "Torque slope", PER_MILLE, 1000000, 1,
     UINT32_MAX, OPTION(torque_slope), NULL},
    {0x6088, 0, 1, CIA402_OF_AXIS, CIA402_I16, RW_MAP, "Torque profile type", NO_UNIT, 0, ANY,
     OPTION(torque_profile_type), cia402_axis_write_profile_type},
    {0x6098, 0, 1, CIA402_OF_AXIS, CIA402_I8, CIA402_RW, "Homing method", NO_UNIT, 37, ANY,
     OPTION(homing_method), cia402_axis_write_homing},
    {0x6099, 1, 2, CIA402_OF_AXIS, CIA402_U32, CIA402_RW, "Homing speed", RAD_S, 10000, ANY,
     OPTION(homing_speed), NULL},
    {0x609a, 0, 1, CIA402_OF_AXIS, CIA402_U32, CIA402_RW, "Homing acceleration", RAD_S2, 100000,
     ANY, OPTION(homing_acceleration), NULL},
    {0x60b1, 0, 1, CIA402_OF_AXIS, CIA402_I32, RW_MAP, "Velocity offset", RAD_S, 0, ANY,
     AXIS(velocity_offset), NULL},
    {0x60b2, 0, 1, CIA402_OF_AXIS, CIA402_I16, RW_MAP, "Torque offset", PER_MILLE, 0, ANY,
     AXIS(torque_offset), NULL},
    {0x60c2, 1, 1, CIA402_OF_AXIS, CIA402_U8, CIA402_RW, "Interpolation time period value",
     MILLIS, 1, 1, 255, OPTION(interpolation_ms), NULL},
    {0x60c2, 2, 1, CIA402_OF_AXIS, CIA402_I8, CIA402_RW, "Interpolation time index", NO_UNIT, -3,
     -3, -3, OPTION(interpolation_exponent), NULL},
    {0x60e3, 1, CIA402_HOMING_METHODS, CIA402_OF_AXIS, CIA402_I8, CIA402_RO,
     "Supported homing method", NO_UNIT, 0, ANY, AXIS(homing_methods), NULL},
    {0x60f4, 0, 1, CIA402_OF_AXIS, CIA402_I32, RO_MAP, "Following error actual value", RAD, 0, ANY,
     AXIS(following_error), NULL},
    {0x60fd, 0, 1, CIA402_OF_AXIS, CIA402_U32, RO_MAP, "Digital inputs", NO_UNIT, 0, ANY,
     AXIS(digital_inputs), NULL},
    {0x60ff, 0, 1, CIA402_OF_AXIS, CIA402_I32, RW_MAP, "Target velocity", RAD_S, 0, ANY,
     AXIS(target_velocity), cia402_axis_write_target},
    {0x6502, 0, 1, CIA402_OF_AXIS, CIA402_U32, CIA402_RO, "Supported drive modes", NO_UNIT, MODES,
     ANY, AXIS(supported_modes), NULL},

    {0x67ff, 0, 1, CIA402_OF_AXIS, CIA402_U32, CIA402_RO, "Single device type", NO_UNIT,
     CIA402_DEVICE_DRIVE, ANY, AXIS(device_type), NULL},

    /* Measuring devices, as CiA 404 has it */
    {0x7130, 1, CIA402_SENSOR_CHANNELS, CIA402_OF_SENSOR, CIA402_I16, RO_MAP,
     "Analog input process value", NO_UNIT, 0, ANY, SENSOR(value), NULL},
};
/* clang-format on */

const size_t cia402_object_count = ARRAY_COUNT(cia402_objects);

unsigned cia402_type_bits(enum cia402_type type)
{
    switch (type) {
    case CIA402_I8:
    case CIA402_U8:
        return 8;
    case CIA402_I16:
    case CIA402_U16:
        return 16;
    case CIA402_I32:
    case CIA402_U32:
        return 32;
    default:
        return 0;
    }
}

/* Returns whether a type has a sign. */
static bool cia402_type_is_signed(enum cia402_type type)
{
    return type == CIA402_I8 || type == CIA402_I16 || type == CIA402_I32;
}

int64_t cia402_lowest(const struct cia402_object *object)
{
    if (object->min || object->max) {
        return object->min;
    }
    return cia402_type_is_signed(object->type)
               ? -(INT64_C(1) << (cia402_type_bits(object->type) - 1))
               : 0;
}

int64_t cia402_highest(const struct cia402_object *object)
{
    unsigned bits = cia402_type_bits(object->type);

    if (object->min || object->max) {
        return object->max;
    }
    return (INT64_C(1) << (cia402_type_is_signed(object->type) ? bits - 1 : bits)) - 1;
}

const struct cia402_object *cia402_object_at(unsigned index, unsigned sub)
{
    size_t low = 0, high = cia402_object_count;

    /* Rows are in the order of index and sub-index */
    while (low < high) {
        size_t middle = (low + high) / 2;
        const struct cia402_object *object = &cia402_objects[middle];

        if (object->index < index ||
            (object->index == index && object->sub + object->count <= (int)sub)) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    if (low == cia402_object_count || cia402_objects[low].index != index ||
        sub < cia402_objects[low].sub) {
        return NULL;
    }
    return &cia402_objects[low];
}
