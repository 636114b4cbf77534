/* SPDX-License-Identifier: Apache-2.0 */
/* The object dictionary: its rows by index, access to objects, factory values, the list for the
 * protocol's page, and the electronic data sheet (EDS). */
#include "boards/cia402/private.h"
#include "boards/cia402/table.h"

#include "base/options.h"
#include "boards/protocol_list.h"

#include <inttypes.h>

/* clang-format off */
#define NODE(field, ...) {CIA402_OF_NODE, offsetof(struct cia402_node, field), __VA_ARGS__}
#define SETTING(field, ...) NODE(settings.field, __VA_ARGS__)
#define RPDO(field, ...) {CIA402_OF_RPDO, offsetof(struct cia402_pdo, field), __VA_ARGS__}
#define TPDO(field, ...) {CIA402_OF_TPDO, offsetof(struct cia402_pdo, field), __VA_ARGS__}
#define AXIS(field, ...) {CIA402_OF_AXIS, offsetof(struct cia402_axis, field), __VA_ARGS__}
#define OPTION(field, ...) AXIS(settings.field, __VA_ARGS__)
#define SENSOR(field, ...) {CIA402_OF_SENSOR, offsetof(struct cia402_sensor, field), __VA_ARGS__}

/* Sub-indices of a row: 0 only; one other; 1 to count */
#define ONE 0, 1
#define SUB(sub) sub, 1
#define SUBS(count) 1, count

/* Access of a row, and the function that writes its object; NULL = store the value */
#define CONST CIA402_CONST, NULL
#define RO CIA402_RO, NULL
#define RO_NODE CIA402_RO | CIA402_PLUS_NODE, NULL
#define RO_MAP CIA402_RO | CIA402_MAP_TPDO, NULL
#define RW CIA402_RW, NULL
#define RW_MAP CIA402_RW | CIA402_MAP_RPDO, NULL
#define RW_BY(write) CIA402_RW, cia402_##write
#define RW_MAP_BY(write) CIA402_RW | CIA402_MAP_RPDO, cia402_##write
#define RW_NODE_BY(write) CIA402_RW | CIA402_PLUS_NODE, cia402_##write
#define I8 CIA402_I8
#define I16 CIA402_I16
#define I32 CIA402_I32
#define U8 CIA402_U8
#define U16 CIA402_U16
#define U32 CIA402_U32
#define TEXT CIA402_TEXT
#define DOMAIN CIA402_DOMAIN
#define IN(min, max) min, max
#define UNIT(unit, scale) unit, scale
#define RAD "rad", CIA402_POSITION_RAD
#define RAD_S "rad/s", CIA402_POSITION_RAD
#define RAD_S2 "rad/s2", CIA402_POSITION_RAD
#define PER_MILLE "%", 0.1
#define MILLIS "s", 1e-3
#define VOLTS "V", CIA402_VOLTAGE_V
#define NO_UNIT NULL, 0.0
#define ANY 1, 0

enum {
    GAIN_MAX = 1000000000,
    MODES = 1 << 0 | 1 << 2 | 1 << 3 | 1 << 5 | 1 << 7 | 1 << 8 | 1 << 9 | 1 << 16,
};

const struct cia402_object cia402_objects[] = {
    /* Communication, CiA 301 */
    NODE(device_type, 0x1000, ONE, U32, RO, "Device type", NO_UNIT, 0, ANY),
    NODE(error_register, 0x1001, ONE, U8, RO_MAP, "Error register", NO_UNIT, 0, ANY),
    NODE(history_count, 0x1003, ONE, U8, RW_BY(emcy_write_history), "Number of errors", NO_UNIT, 0,
        ANY),
    NODE(history, 0x1003, SUBS(CIA402_HISTORY), U32, RO, "Pre-defined error field", NO_UNIT, 0,
        ANY),
    SETTING(cob_sync, 0x1005, ONE, U32, RW_BY(write_cob), "COB-ID SYNC message", NO_UNIT,
        CIA402_SYNC, ANY),
    NODE(device, 0x1008, ONE, TEXT, CONST, "Manufacturer device name", NO_UNIT, 0, ANY),
    NODE(hardware, 0x1009, ONE, TEXT, CONST, "Manufacturer hardware version", NO_UNIT, 0, ANY),
    NODE(software, 0x100a, ONE, TEXT, CONST, "Manufacturer software version", NO_UNIT, 0, ANY),
    SETTING(guard_ms, 0x100c, ONE, U16, RW, "Guard time", MILLIS, 0, ANY),
    SETTING(life_factor, 0x100d, ONE, U8, RW, "Life time factor", NO_UNIT, 0, ANY),
    NODE(storage, 0x1010, SUB(1), U32, RW_BY(node_write_store), "Store all parameters", NO_UNIT, 1,
        ANY),
    NODE(storage, 0x1011, SUB(1), U32, RW_BY(node_write_restore), "Restore all default parameters",
        NO_UNIT, 1, ANY),
    SETTING(cob_emcy, 0x1014, ONE, U32, RW_NODE_BY(write_emcy_cob), "COB-ID EMCY", NO_UNIT,
        CIA402_EMCY, ANY),
    SETTING(emcy_inhibit_100us, 0x1015, ONE, U16, RW, "Inhibit time EMCY", UNIT("s", 1e-4), 0, ANY),
    SETTING(consumer, 0x1016, SUB(1), U32, RW_BY(nmt_write_consumer), "Consumer heartbeat time",
        NO_UNIT, 0, ANY),
    SETTING(producer_ms, 0x1017, ONE, U16, RW_BY(nmt_write_producer), "Producer heartbeat time",
        MILLIS, 0, ANY),
    NODE(identity, 0x1018, SUBS(4), U32, RO, "Identity", NO_UNIT, 0, ANY),
    SETTING(error_behavior, 0x1029, SUB(1), U8, RW, "Communication error behavior", NO_UNIT, 0,
        IN(0, 2)),
    NODE(sdo_request, 0x1200, SUB(1), U32, RO_NODE, "COB-ID SDO client to server", NO_UNIT,
        CIA402_SDO_REQUEST, ANY),
    NODE(sdo_reply, 0x1200, SUB(2), U32, RO_NODE, "COB-ID SDO server to client", NO_UNIT,
        CIA402_SDO_REPLY, ANY),
    RPDO(cob_id, 0x1400, SUB(1), U32, RW_BY(pdo_write_cob), "RPDO COB-ID", NO_UNIT, 0, ANY),
    RPDO(type, 0x1400, SUB(2), U8, RW_BY(pdo_write_type), "RPDO transmission type", NO_UNIT, 255,
        ANY),
    RPDO(count, 0x1600, ONE, U8, RW_BY(pdo_write_count), "RPDO mapped objects", NO_UNIT, 0, ANY),
    RPDO(object, 0x1600, SUBS(CIA402_MAPPED_MAX), U32, RW_BY(pdo_write_object), "RPDO mapping",
        NO_UNIT, 0, ANY),
    TPDO(cob_id, 0x1800, SUB(1), U32, RW_BY(pdo_write_cob), "TPDO COB-ID", NO_UNIT, 0, ANY),
    TPDO(type, 0x1800, SUB(2), U8, RW_BY(pdo_write_type), "TPDO transmission type", NO_UNIT, 255,
        ANY),
    TPDO(inhibit_100us, 0x1800, SUB(3), U16, RW_BY(pdo_write_inhibit), "TPDO inhibit time",
        UNIT("s", 1e-4), 0, ANY),
    TPDO(event_ms, 0x1800, SUB(5), U16, RW, "TPDO event timer", MILLIS, 0, ANY),
    TPDO(count, 0x1a00, ONE, U8, RW_BY(pdo_write_count), "TPDO mapped objects", NO_UNIT, 0, ANY),
    TPDO(object, 0x1a00, SUBS(CIA402_MAPPED_MAX), U32, RW_BY(pdo_write_object), "TPDO mapping",
        NO_UNIT, 0, ANY),

    /* Manufacturer's objects */
    NODE(note, 0x2000, ONE, TEXT, RW, "User text", NO_UNIT, 0, ANY),
    NODE(data, 0x2001, ONE, DOMAIN, RW, "User data", NO_UNIT, 0, ANY),
    SENSOR(saturated, 0x2100, ONE, U16, RO_MAP, "Saturated channels", NO_UNIT, 0, ANY),
    SENSOR(faults, 0x2101, ONE, U32, RO_MAP, "Faults", NO_UNIT, 0, ANY),
    SENSOR(tare, 0x2102, SUBS(CIA402_SENSOR_CHANNELS), I16, RW_BY(sensor_write_tare), "Tare",
        NO_UNIT, 0, ANY),
    AXIS(target_voltage, 0x4000, ONE, I16, RW_MAP_BY(axis_write_target), "Target voltage", VOLTS,
        0, ANY),
    AXIS(voltage, 0x4001, ONE, I16, RO_MAP, "Voltage actual value", VOLTS, 0, ANY),
    AXIS(link_encoder, 0x4002, ONE, I32, RO_MAP, "Link encoder", RAD, 0, ANY),
    AXIS(motor_encoder, 0x4003, ONE, I32, RO_MAP, "Motor encoder", RAD, 0, ANY),
    AXIS(deflection, 0x4004, ONE, I16, RO_MAP, "Spring deflection", RAD, 0, ANY),
    AXIS(spring_torque, 0x4005, ONE, I16, RO_MAP, "Spring torque", UNIT("Nm", CIA402_SPRING_NM), 0,
        ANY),
    AXIS(temperature_c, 0x4006, ONE, I16, RO_MAP, "Winding temperature", UNIT("degC", 1.0), 0, ANY),
    AXIS(current_ma, 0x4007, ONE, I16, RO_MAP, "Winding current", UNIT("A", 1e-3), 0, ANY),
    AXIS(pressure, 0x4008, SUBS(2), U16, RO_MAP, "Chamber pressure", UNIT("bar",
        CIA402_PRESSURE_BAR), 0, ANY),
    AXIS(valve_opening, 0x4009, ONE, I16, RO_MAP, "Valve opening", PER_MILLE, 0, ANY),
    AXIS(faults, 0x4010, ONE, U32, RO_MAP, "Faults", NO_UNIT, 0, ANY),
    OPTION(timeout_ms, 0x4011, ONE, U16, RW, "Command time-out", MILLIS, 0, ANY),
    OPTION(current_limit_ma, 0x4012, ONE, U32, RW_BY(axis_write_when_off), "Current limit",
        UNIT("A", 1e-3), 1, IN(1, INT32_MAX)),
    /* Minimum above the ambient temperature: a lower limit would be a fault at once */
    OPTION(temperature_limit_c, 0x4013, ONE, I16, RW_BY(axis_write_when_off), "Temperature limit",
        UNIT("degC", 1.0), 125, IN(26, 125)),
    OPTION(current_gain, 0x4014, SUBS(3), I32, RW_BY(axis_write_when_off), "Current loop gain",
        NO_UNIT, 0, IN(0, GAIN_MAX)),
    OPTION(velocity_gain, 0x4015, SUBS(3), I32, RW_BY(axis_write_when_off), "Velocity loop gain",
        NO_UNIT, 0, IN(0, GAIN_MAX)),
    OPTION(position_gain, 0x4016, ONE, I32, RW_BY(axis_write_when_off), "Position loop gain",
        UNIT("1/s", 0.1), 400, IN(0, GAIN_MAX)),

    /* Drives, CiA 402 */
    OPTION(abort_option, 0x6007, ONE, I16, RW, "Abort connection option code", NO_UNIT, 1, IN(0,
        3)),
    AXIS(error_code, 0x603f, ONE, U16, RO_MAP, "Error code", NO_UNIT, 0, ANY),
    AXIS(controlword, 0x6040, ONE, U16, RW_MAP_BY(axis_write_controlword), "Controlword", NO_UNIT,
        0, ANY),
    AXIS(statusword, 0x6041, ONE, U16, RO_MAP, "Statusword", NO_UNIT, 0, ANY),
    OPTION(quick_stop_option, 0x605a, ONE, I16, RW_BY(axis_write_option), "Quick stop option code",
        NO_UNIT, 2, IN(0, 7)),
    OPTION(shutdown_option, 0x605b, ONE, I16, RW, "Shutdown option code", NO_UNIT, 0, IN(0, 1)),
    OPTION(disable_option, 0x605c, ONE, I16, RW, "Disable operation option code", NO_UNIT, 1, IN(0,
        1)),
    OPTION(halt_option, 0x605d, ONE, I16, RW, "Halt option code", NO_UNIT, 1, IN(1, 2)),
    OPTION(fault_option, 0x605e, ONE, I16, RW, "Fault reaction option code", NO_UNIT, 2, IN(0, 2)),
    OPTION(mode, 0x6060, ONE, I8, RW_MAP_BY(axis_write_mode), "Modes of operation", NO_UNIT, 0,
        IN(CIA402_VOLTAGE_MODE, CIA402_CYCLIC_TORQUE)),
    AXIS(mode_display, 0x6061, ONE, I8, RO_MAP, "Modes of operation display", NO_UNIT, 0, ANY),
    AXIS(position_demand, 0x6062, ONE, I32, RO_MAP, "Position demand value", RAD, 0, ANY),
    AXIS(position, 0x6064, ONE, I32, RO_MAP, "Position actual value", RAD, 0, ANY),
    OPTION(following_window, 0x6065, ONE, U32, RW, "Following error window", RAD, UINT32_MAX, ANY),
    OPTION(following_timeout_ms, 0x6066, ONE, U16, RW, "Following error time out", MILLIS, 0, ANY),
    OPTION(position_window, 0x6067, ONE, U32, RW, "Position window", RAD, 1000, ANY),
    OPTION(position_window_ms, 0x6068, ONE, U16, RW, "Position window time", MILLIS, 0, ANY),
    AXIS(velocity_demand, 0x606b, ONE, I32, RO_MAP, "Velocity demand value", RAD_S, 0, ANY),
    AXIS(velocity, 0x606c, ONE, I32, RO_MAP, "Velocity actual value", RAD_S, 0, ANY),
    OPTION(velocity_window, 0x606d, ONE, U16, RW, "Velocity window", RAD_S, 5000, ANY),
    OPTION(velocity_window_ms, 0x606e, ONE, U16, RW, "Velocity window time", MILLIS, 0, ANY),
    OPTION(velocity_threshold, 0x606f, ONE, U16, RW, "Velocity threshold", RAD_S, 5000, ANY),
    OPTION(velocity_threshold_ms, 0x6070, ONE, U16, RW, "Velocity threshold time", MILLIS, 0, ANY),
    AXIS(target_torque, 0x6071, ONE, I16, RW_MAP_BY(axis_write_target), "Target torque", PER_MILLE,
        0, ANY),
    OPTION(max_torque, 0x6072, ONE, U16, RW_MAP, "Max torque", PER_MILLE, 1000, ANY),
    OPTION(max_current, 0x6073, ONE, U16, RW, "Max current", PER_MILLE, 1000, ANY),
    AXIS(torque_demand, 0x6074, ONE, I16, RO_MAP, "Torque demand", PER_MILLE, 0, ANY),
    AXIS(rated_current_ma, 0x6075, ONE, U32, RO, "Motor rated current", UNIT("A", 1e-3), 0, ANY),
    AXIS(rated_torque_mnm, 0x6076, ONE, U32, RO, "Motor rated torque", UNIT("Nm", 1e-3), 0, ANY),
    AXIS(torque, 0x6077, ONE, I16, RO_MAP, "Torque actual value", PER_MILLE, 0, ANY),
    AXIS(current, 0x6078, ONE, I16, RO_MAP, "Current actual value", PER_MILLE, 0, ANY),
    AXIS(supply_mv, 0x6079, ONE, U32, RO_MAP, "DC link circuit voltage", UNIT("V", 1e-3), 0, ANY),
    AXIS(target_position, 0x607a, ONE, I32, RW_MAP_BY(axis_write_target), "Target position", RAD,
        0, ANY),
    /* Positions do not wrap, because joints do not turn endlessly: only one range is valid */
    OPTION(position_range[0], 0x607b, SUB(1), I32, RW, "Min position range limit", RAD, INT32_MIN,
        IN(INT32_MIN, INT32_MIN)),
    OPTION(position_range[1], 0x607b, SUB(2), I32, RW, "Max position range limit", RAD, INT32_MAX,
        IN(INT32_MAX, INT32_MAX)),
    OPTION(home_offset, 0x607c, ONE, I32, RW, "Home offset", RAD, 0, ANY),
    OPTION(position_limit, 0x607d, SUBS(2), I32, RW, "Software position limit", RAD, 0, ANY),
    OPTION(max_profile_velocity, 0x607f, ONE, U32, RW, "Max profile velocity", RAD_S, 1000000, ANY),
    OPTION(max_motor_rpm, 0x6080, ONE, U32, RW, "Max motor speed", UNIT("rpm", 1.0), 100000, ANY),
    OPTION(profile_velocity, 0x6081, ONE, U32, RW_MAP, "Profile velocity", RAD_S, 100000, ANY),
    OPTION(profile_acceleration, 0x6083, ONE, U32, RW_MAP, "Profile acceleration", RAD_S2, 1000000,
        IN(1, UINT32_MAX)),
    OPTION(profile_deceleration, 0x6084, ONE, U32, RW_MAP, "Profile deceleration", RAD_S2, 1000000,
        IN(1, UINT32_MAX)),
    OPTION(quick_stop_deceleration, 0x6085, ONE, U32, RW_MAP, "Quick stop deceleration", RAD_S2,
        5000000, IN(1, UINT32_MAX)),
    /* Only the linear ramp is supported, for position, velocity and torque */
    OPTION(motion_profile_type, 0x6086, ONE, I16, RW_MAP, "Motion profile type", NO_UNIT, 0,
        IN(0, 0)),
    OPTION(torque_slope, 0x6087, ONE, U32, RW_MAP, "Torque slope", PER_MILLE, 1000000, IN(1,
        UINT32_MAX)),
    OPTION(torque_profile_type, 0x6088, ONE, I16, RW_MAP, "Torque profile type", NO_UNIT, 0,
        IN(0, 0)),
    OPTION(homing_method, 0x6098, ONE, I8, RW_BY(axis_write_homing), "Homing method", NO_UNIT, 37,
        IN(0, 37)),
    OPTION(homing_speed, 0x6099, SUBS(2), U32, RW, "Homing speed", RAD_S, 10000, ANY),
    OPTION(homing_acceleration, 0x609a, ONE, U32, RW, "Homing acceleration", RAD_S2, 100000, ANY),
    AXIS(velocity_offset, 0x60b1, ONE, I32, RW_MAP, "Velocity offset", RAD_S, 0, ANY),
    AXIS(torque_offset, 0x60b2, ONE, I16, RW_MAP, "Torque offset", PER_MILLE, 0, ANY),
    OPTION(interpolation_ms, 0x60c2, SUB(1), U8, RW, "Interpolation time period value", MILLIS, 1,
        IN(1, 255)),
    OPTION(interpolation_exponent, 0x60c2, SUB(2), I8, RW, "Interpolation time index", NO_UNIT, -3,
        IN(-3, -3)),
    AXIS(homing_methods, 0x60e3, SUBS(CIA402_HOMING_METHODS), I8, RO, "Supported homing method",
        NO_UNIT, 0, ANY),
    AXIS(following_error, 0x60f4, ONE, I32, RO_MAP, "Following error actual value", RAD, 0, ANY),
    AXIS(digital_inputs, 0x60fd, ONE, U32, RO_MAP, "Digital inputs", NO_UNIT, 0, ANY),
    AXIS(target_velocity, 0x60ff, ONE, I32, RW_MAP_BY(axis_write_target), "Target velocity", RAD_S,
        0, ANY),
    AXIS(supported_modes, 0x6502, ONE, U32, RO, "Supported drive modes", NO_UNIT, MODES, ANY),

    AXIS(device_type, 0x67ff, ONE, U32, RO, "Single device type", NO_UNIT, CIA402_DEVICE_DRIVE,
        ANY),

    /* Measuring devices, as in CiA 404 */
    SENSOR(value, 0x7130, SUBS(CIA402_SENSOR_CHANNELS), I16, RO_MAP, "Analog input process value",
        NO_UNIT, 0, ANY),
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
    if (object->min <= object->max) {
        return object->min;
    }
    return cia402_type_is_signed(object->type)
               ? -(INT64_C(1) << (cia402_type_bits(object->type) - 1))
               : 0;
}

int64_t cia402_highest(const struct cia402_object *object)
{
    unsigned bits = cia402_type_bits(object->type);

    if (object->min <= object->max) {
        return object->max;
    }
    return (INT64_C(1) << (cia402_type_is_signed(object->type) ? bits - 1 : bits)) - 1;
}

int64_t cia402_most(const struct cia402_node *node, const struct cia402_entry *entry)
{
    /* Only objects of an axis have its number as their unit */
    const struct board_axis_config *axis = node->board.config.axis;
    int64_t most = cia402_highest(entry->object);
    double limit_c;

    switch (entry->object->index) {
    case 0x4012:
        return cia402_counts(axis[entry->unit].current_limit_a, 1e-3);
    case 0x4013:
        limit_c = axis[entry->unit].temperature_limit_c;
        return limit_c > 0.0 ? control_clamp(cia402_counts(limit_c, 1.0), 1, most) : most;
    case 0x6060: /* an axis with a valve has no torque modes */
        return axis[entry->unit].valve ? CIA402_CYCLIC_VELOCITY : most;
    default:
        return most;
    }
}

const struct cia402_object *cia402_object_at(unsigned index, unsigned sub)
{
    size_t low = 0, high = cia402_object_count;

    /* Binary search: the rows are in the order of index and sub-index */
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

/* ---- objects of a node ---- */

enum { PDO_MASK = 0x1ff, FIRST_PDO = 0x1400, LAST_PDO = 0x1bff, FIRST_OF_AXES = 0x4000 };

/* ---- finding an object ---- */

/* Splits an index. Writes to *index the index for axis 0 or PDO 0, to *unit the number of the axis
 * or PDO, from 0. Returns false when the node has no such axis or PDO. */
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

/* Returns the highest sub-index of a row on a node, plus 1. */
static unsigned cia402_row_end(const struct cia402_node *node, const struct cia402_object *object)
{
    unsigned count = object->count;

    if (object->scope == CIA402_OF_SENSOR && object->count > 1) {
        count = (unsigned)node->sensor->channels;
    }
    return object->sub + count;
}

/* Returns whether a node has the structure that contains a row's objects. */
static bool cia402_node_has(const struct cia402_node *node, const struct cia402_object *object)
{
    return object->scope == CIA402_OF_AXIS     ? node->axes > 0
           : object->scope == CIA402_OF_SENSOR ? node->sensor != NULL
                                               : true;
}

/* Returns the highest sub-index of an index; 0 = the node has no such index. */
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
    object = cia402_object_at(index, 0);
    if (!(object && cia402_node_has(node, object)) && cia402_highest_sub(node, index) == 0) {
        return CIA402_ABORT_NO_OBJECT;
    }

    /* Sub-index 0 of an array or record is the number of its other sub-indices */
    if (sub == 0) {
        *entry = (struct cia402_entry){.value = cia402_highest_sub(node, index), .type = CIA402_U8};
        return CIA402_DONE;
    }
    return CIA402_ABORT_NO_SUB_INDEX;
}

/* ---- value of an object ---- */

/* Returns the address of an object's value. For arrays it is the address of the first sub-index. */
void *cia402_place(const struct cia402_node *node, const struct cia402_entry *entry)
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
    if (value > cia402_most(node, entry)) {
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
    /* Refuse to produce SYNC and to use 29-bit identifiers */
    if (value & ~(int64_t)(CIA402_COB_INVALID | CIA402_COB_MASK) ||
        cia402_cob_is_restricted((unsigned)value & CIA402_COB_MASK)) {
        return CIA402_ABORT_VALUE;
    }
    *cia402_field(node, entry) = value;
    return CIA402_DONE;
}

/* Writes the COB-ID of EMCY. A valid identifier cannot change (CiA 301, 7.5.2.17). */
enum cia402_abort cia402_write_emcy_cob(struct cia402_node *node, const struct cia402_entry *entry,
                                        int64_t value)
{
    int64_t now = *cia402_field(node, entry);

    if (!((now | value) & CIA402_COB_INVALID) && (now ^ value) & CIA402_COB_MASK) {
        return CIA402_ABORT_VALUE;
    }
    return cia402_write_cob(node, entry, value);
}

/* ---- values as bytes ---- */

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

/* Writes a value as little-endian bytes. Saturates it to the type, because a measured value may
 * exceed it. */
void cia402_put(enum cia402_type type, int64_t value, uint8_t *data)
{
    const struct cia402_object bounds = {.type = type, .min = 1}; /* full range of the type */

    value = control_clamp(value, cia402_lowest(&bounds), cia402_highest(&bounds));
    for (unsigned i = 0; i < cia402_type_bits(type) / 8; i++) {
        data[i] = (uint8_t)((uint64_t)value >> 8 * i);
    }
}

/* ---- factory values ---- */

void cia402_set_factory(struct cia402_node *node)
{
    node->kind = (enum cia402_kind)node->board.ops->identity.type;
    if (node->kind == CIA402_KIND_DRIVE) {
        node->axis = container_of(node, struct cia402_motor, node)->axis;
    } else {
        node->sensor = &container_of(node, struct cia402_sensor_board, node)->sensor;
    }
    /* Set the initial values of the table */
    for (size_t i = 0; i < cia402_object_count; i++) {
        const struct cia402_object *object = &cia402_objects[i];
        unsigned units = object->scope == CIA402_OF_AXIS ? node->axes
                         : object->scope == CIA402_OF_RPDO || object->scope == CIA402_OF_TPDO
                             ? CIA402_PDOS
                             : cia402_node_has(node, object);

        for (unsigned unit = 0; unit < units; unit++) {
            for (unsigned sub = object->sub; sub < cia402_row_end(node, object); sub++) {
                const struct cia402_entry entry = {object, (uint8_t)sub, (uint8_t)unit, 0,
                                                   object->type};
                int64_t plus = object->access & CIA402_PLUS_NODE ? node->board.address : 0;

                if (object->type == CIA402_TEXT) {
                    memset(cia402_place(node, &entry), 0, CIA402_TEXT_MAX + 1);
                } else if (object->type == CIA402_DOMAIN) {
                    memset(cia402_place(node, &entry), 0, sizeof(struct cia402_domain));
                } else {
                    *cia402_field(node, &entry) = control_clamp(
                        object->initial + plus, cia402_lowest(object), cia402_most(node, &entry));
                }
            }
        }
    }
    /* Set the values of the board's configuration */
    for (unsigned k = 0; k < node->axes; k++) {
        cia402_axis_set_factory(&node->axis[k], &node->board.config.axis[k], &node->board.config);
    }
    if (node->sensor) {
        node->sensor->channels = node->kind == CIA402_KIND_FT ? 6 : CIA402_SENSOR_CHANNELS;
    }

    /* Set the identity of the node: vendor, product, revision and serial number */
    static const char *const kinds[] = {"drive", "force-torque sensor", "inertial sensor"};
    const struct board_identity *identity = &node->board.ops->identity;

    node->device_type = node->axes > 1    ? CIA402_DEVICE_DRIVES
                        : node->axes == 1 ? CIA402_DEVICE_DRIVE
                                          : CIA402_DEVICE_SENSOR;
    /* product code; the vendor stays 0 = unregistered */
    node->identity[1] = 0x48494c00 + node->kind;
    node->identity[2] = identity->major << 16 | identity->minor;
    node->identity[3] = (int64_t)(node->board.config.bus & 0xff) << 8 | node->board.config.address;
    snprintf(node->device, sizeof node->device, "coman-hil %s", kinds[node->kind]);
    snprintf(node->hardware, sizeof node->hardware, "simulated");
    snprintf(node->software, sizeof node->software, "%d.%d.%d", identity->major, identity->minor,
             identity->build);
    cia402_pdo_set_factory(node);
}

/* ---- list of the dictionary for the protocol's page ---- */

static const char *const access_names[] = {
    [CIA402_CONST] = "const", [CIA402_RO] = "ro", [CIA402_RW] = "rw", [CIA402_WO] = "wo"};

/* Prints a row as an item of a list. */
static void object_print_row(const struct cia402_object *object, FILE *out)
{
    static const char *const types[] = {
        [CIA402_I8] = "i8",     [CIA402_I16] = "i16",      [CIA402_I32] = "i32",
        [CIA402_U8] = "u8",     [CIA402_U16] = "u16",      [CIA402_U32] = "u32",
        [CIA402_TEXT] = "text", [CIA402_DOMAIN] = "domain"};
    unsigned last = object->sub + object->count - 1u;
    char subs[16] = "", measure[48] = "", range[64] = "", initial[32] = "", line[256];

    if (last > 0) {
        snprintf(subs, sizeof subs, object->count > 1 ? ":%u-%u" : ":%u", object->sub, last);
    }
    if (object->unit) {
        snprintf(measure, sizeof measure, ", in %g %s", object->scale, object->unit);
    }
    if (object->min <= object->max) {
        snprintf(range, sizeof range, ", %" PRId64 " to %" PRId64, object->min, object->max);
    }
    if (object->initial) {
        snprintf(initial, sizeof initial, ", at first %" PRId64 "%s", object->initial,
                 object->access & CIA402_PLUS_NODE ? " + n" : "");
    }
    snprintf(line, sizeof line, "- 0x%04x%s `%s`: %s, %s%s%s%s%s%s", object->index, subs,
             object->name, types[object->type], access_names[object->access & CIA402_ACCESS_MASK],
             object->access & CIA402_MAP_TPDO ? ", TPDO" : "",
             object->access & CIA402_MAP_RPDO ? ", RPDO" : "", measure, range, initial);
    options_wrap(line, 0, 2, out);
}

void cia402_print_objects(FILE *out)
{
    fputs("\n## Objects\n\n", out);
    options_wrap("Of axis 0, of the first RPDO and of the first TPDO; the others follow as above. "
                 "Sub-index 0 of an object with sub-indices is how many there are. Values at first "
                 "are those of the factory where the rig says nothing: limits and gains come from "
                 "the drive, COB-IDs and mappings from the factory mapping.",
                 0, 0, out);
    putc('\n', out);
    for (size_t i = 0; i < cia402_object_count; i++) {
        object_print_row(&cia402_objects[i], out);
    }
}

/* ---- electronic data sheet (EDS); see boards/cia402/table.h ---- */

enum {
    FIRST_INDEX = 0x1000,
    LAST_INDEX = 0x9fff,
    SUBS_MAX = 40, /* greater than the highest sub-index of any object */
    OBJECT_VARIABLE = 7,
    OBJECT_ARRAY = 8,
    OBJECT_RECORD = 9,
};

/* Lists of objects in an EDS. */
enum section { MANDATORY, OPTIONAL, MANUFACTURER };

/* Finds an object. Returns whether the node has it. */
static bool eds_has(const struct cia402_node *node, unsigned index, unsigned sub,
                    struct cia402_entry *entry)
{
    return cia402_find(node, index, sub, entry) == CIA402_DONE;
}

/* Returns whether a node has an index that belongs to a section. Three indices are mandatory;
 * 0x2000 to 0x5fff are the manufacturer's. */
static bool eds_lists(const struct cia402_node *node, enum section section, unsigned index)
{
    enum section own = index == 0x1000 || index == 0x1001 || index == 0x1018 ? MANDATORY
                       : index >= 0x2000 && index < 0x6000                   ? MANUFACTURER
                                                                             : OPTIONAL;
    struct cia402_entry entry;

    return own == section && eds_has(node, index, 0, &entry);
}

/* ---- values in the EDS ---- */

/* Writes a number with its key: decimal for signed types, otherwise hexadecimal. */
static void eds_put_number(const char *key, enum cia402_type type, int64_t value, FILE *out)
{
    if (type == CIA402_I8 || type == CIA402_I16 || type == CIA402_I32) {
        fprintf(out, "%s=%" PRId64 "\n", key, value);
    } else {
        fprintf(out, "%s=0x%" PRIX64 "\n", key, (uint64_t)value);
    }
}

/* ---- objects in the EDS ---- */

/* Writes the keys of a variable, or of a sub-index. */
static void eds_put_variable(const struct cia402_node *node, const struct cia402_entry *entry,
                             FILE *out)
{
    const struct cia402_object *object = entry->object;
    unsigned access = object ? object->access : CIA402_CONST;
    bool cob = object && (object->scope == CIA402_OF_RPDO || object->scope == CIA402_OF_TPDO) &&
               object->type == CIA402_U32 && object->sub == 1 && object->count == 1;
    int64_t value = cia402_type_bits(entry->type) ? cia402_value(node, entry) : 0;

    fprintf(out, "ObjectType=0x%X\nDataType=0x%04X\nAccessType=%s%s\n", OBJECT_VARIABLE,
            entry->type, access_names[access & CIA402_ACCESS_MASK],
            access & CIA402_MAP_RPDO ? "w" : "");
    if (object && object->min <= object->max) {
        eds_put_number("LowLimit", entry->type, object->min, out);
        eds_put_number("HighLimit", entry->type, cia402_most(node, entry), out);
    }

    /* The default is the present value; a domain has none. A COB-ID may contain $NODEID */
    if (entry->type == CIA402_TEXT) {
        fprintf(out, "DefaultValue=%s\n", (const char *)cia402_place(node, entry));
    } else if (access & CIA402_PLUS_NODE || (cob && value & CIA402_COB_MASK)) {
        fprintf(out, "DefaultValue=$NODEID+0x%" PRIX64 "\n",
                (uint64_t)(value - node->board.address));
    } else if (entry->type != CIA402_DOMAIN) {
        eds_put_number("DefaultValue", entry->type, value, out);
    }
    fprintf(out, "PDOMapping=%d\n\n", access & (CIA402_MAP_TPDO | CIA402_MAP_RPDO) ? 1 : 0);
}

/* Writes the sections of an index and its sub-indices, if the node has the index. */
static void eds_put_object(const struct cia402_node *node, unsigned index, FILE *out)
{
    const char *name = ""; /* name of the object, or of its first sub-index */
    struct cia402_entry entry;
    unsigned subs = 0;

    for (unsigned sub = SUBS_MAX; sub-- > 0;) {
        if (eds_has(node, index, sub, &entry)) {
            subs++;
            name = entry.object ? entry.object->name : name;
        }
    }
    if (!eds_has(node, index, 0, &entry)) {
        return;
    }
    fprintf(out, "[%X]\nParameterName=%s\n", index, name);
    if (subs == 1) {
        eds_put_variable(node, &entry, out);
        return;
    }

    /* Communication parameters and the identity are records, even if all their types are equal */
    fprintf(out, "ObjectType=0x%X\nSubNumber=%u\n\n",
            index == 0x1018 || index == 0x1200 || (index >= 0x1400 && index < 0x1c00) ||
                    index % CIA402_AXIS_STEP == 0x60c2 % CIA402_AXIS_STEP
                ? OBJECT_RECORD
                : OBJECT_ARRAY,
            subs);
    for (unsigned sub = 0; sub < SUBS_MAX; sub++) {
        if (eds_has(node, index, sub, &entry)) {
            fprintf(out, "[%Xsub%X]\nParameterName=%s", index, sub,
                    entry.object ? entry.object->name : "Highest sub-index supported");
            fprintf(out, entry.object && entry.object->count > 1 ? " %u\n" : "\n", sub);
            eds_put_variable(node, &entry, out);
        }
    }
}

/* ---- the EDS file ---- */

/* Writes the list of a section: the number of objects, and their indices. */
static void eds_put_list(const struct cia402_node *node, const char *name, enum section section,
                         FILE *out)
{
    unsigned count = 0;

    for (unsigned index = FIRST_INDEX; index <= LAST_INDEX; index++) {
        count += eds_lists(node, section, index);
    }
    fprintf(out, "[%s]\nSupportedObjects=%u\n", name, count);
    count = 0;
    for (unsigned index = FIRST_INDEX; index <= LAST_INDEX; index++) {
        if (eds_lists(node, section, index)) {
            fprintf(out, "%u=0x%04X\n", ++count, index);
        }
    }
    putc('\n', out);
}

enum error_code cia402_eds_write(const struct board_config *board, const char *name,
                                 struct arena *arena, FILE *out, struct error *error)
{
    const struct board_ops *ops = protocol_cia402.board[board->kind];
    struct board *made = arena_alloc(arena, 1, ops->size);
    struct cia402_node *node;

    if (!made) {
        return error_set(error, ERROR_MEMORY, "no memory left for the EDS file");
    }

    /* Create a node with factory values that is on no bus */
    node = cia402_node_of(made);
    made->ops = ops;
    made->config = *board;
    made->address = board->address;
    node->axes = board_config_axes(board);
    cia402_set_factory(node);

    /* Write the sections before the objects: file, device, dummies, comments */
    static const int rates[] = {10, 20, 50, 125, 250, 500, 800, 1000};

    fprintf(out,
            "[FileInfo]\nFileName=%s\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\n"
            "Description=%s, %u axes\nCreationTime=12:00AM\nCreationDate=01-01-2026\n"
            "CreatedBy=coman-hil\nModificationTime=12:00AM\nModificationDate=01-01-2026\n"
            "ModifiedBy=coman-hil\n\n",
            name, node->device, node->axes);
    fprintf(out,
            "[DeviceInfo]\nVendorName=coman-hil\nVendorNumber=0x%" PRIX64
            "\nProductName=%s\nProductNumber=0x%" PRIX64 "\nRevisionNumber=0x%" PRIX64
            "\nOrderCode=%s\n",
            node->identity[0], node->device, node->identity[1], node->identity[2],
            node->board.config.name);
    for (size_t i = 0; i < sizeof rates / sizeof *rates; i++) {
        fprintf(out, "BaudRate_%d=1\n", rates[i]);
    }
    fprintf(out,
            "SimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=8\n"
            "DynamicChannelsSupported=0\nGroupMessaging=0\nNrOfRXPDO=%u\nNrOfTXPDO=%u\n"
            "LSS_Supported=1\n\n[DummyUsage]\nDummy0001=0\n",
            cia402_pdos(node), cia402_pdos(node));
    for (int type = CIA402_I8; type <= CIA402_U32; type++) {
        fprintf(out, "Dummy%04X=1\n", type);
    }
    fputs("\n[Comments]\nLines=1\nLine1=Positions in 10 urad of the joint, voltages in 2 mV.\n\n",
          out);
    eds_put_list(node, "MandatoryObjects", MANDATORY, out);
    eds_put_list(node, "OptionalObjects", OPTIONAL, out);
    eds_put_list(node, "ManufacturerObjects", MANUFACTURER, out);
    for (unsigned index = FIRST_INDEX; index <= LAST_INDEX; index++) {
        eds_put_object(node, index, out);
    }
    return ERROR_NONE;
}
