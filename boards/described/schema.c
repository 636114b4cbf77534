/* SPDX-License-Identifier: Apache-2.0 */
/* The keys of a protocol file: names, types, ranges and defaults, in tables for base/yaml.h. */
#include "boards/described/load.h"

#include <float.h>

#define AT(member) offsetof(struct STRUCT, member)

static const struct word type_names[] = {
    {"unsigned", 0}, {"signed", FIELD_SIGNED}, {"float", FIELD_FLOAT}, {NULL, 0}};
static const struct word order_names[] = {{"little", 0}, {"big", FIELD_BIG_ENDIAN}, {NULL, 0}};
static const struct word checksum_names[] = {
    {"xor", DESCRIBED_XOR}, {"crc8_sae_j1850", DESCRIBED_CRC8_SAE_J1850}, {NULL, 0}};
static const struct word from_names[] = {{"board", 0}, {"host", 1}, {NULL, 0}};
static const struct word by_names[] = {{"none", DESCRIBED_BY_NONE},
                                       {"address", DESCRIBED_BY_ADDRESS},
                                       {"slot", DESCRIBED_BY_SLOT},
                                       {"group", DESCRIBED_BY_GROUP},
                                       {NULL, 0}};
static const struct word of_names[] = {{"motor", DESCRIBED_MOTOR},
                                       {"ft", DESCRIBED_FT},
                                       {"inertial", DESCRIBED_INERTIAL},
                                       {"any", DESCRIBED_ANY},
                                       {NULL, 0}};
static const struct word law_names[] = {
    {"off", DESCRIBED_OFF},
    {"voltage", DESCRIBED_VOLTAGE},
    {"current", DESCRIBED_CURRENT},
    {"torque", DESCRIBED_TORQUE},
    {"velocity", DESCRIBED_VELOCITY},
    {"position", DESCRIBED_POSITION},
    {"impedance", DESCRIBED_IMPEDANCE},
    {"fault", DESCRIBED_FAULT},
    {"selected", DESCRIBED_SELECTED},
    {"refused", DESCRIBED_REFUSED},
    {NULL, 0},
};
static const struct word target_names[] = {
    {"slots", DESCRIBED_SLOTS_MASK},
    {"address", DESCRIBED_ADDRESS},
    {"axis", DESCRIBED_AXIS},
    {"state", DESCRIBED_STATE},
    {"law", DESCRIBED_LAW},
    {"telemetry_period", DESCRIBED_TELEMETRY_PERIOD},
    {"parameter", DESCRIBED_PARAMETER},
    {"parameter_value", DESCRIBED_PARAMETER_VALUE},
    {"host_number", DESCRIBED_HOST_NUMBER},
    {"new_address", DESCRIBED_NEW_ADDRESS},
    {"velocity_limit", DESCRIBED_VELOCITY_LIMIT},
    {"current_limit", DESCRIBED_CURRENT_LIMIT},
    {"position_gain", DESCRIBED_POSITION_GAIN},
    {"velocity_gain", DESCRIBED_VELOCITY_GAIN},
    {"integral_gain", DESCRIBED_INTEGRAL_GAIN},
    {"command_timeout", DESCRIBED_COMMAND_TIMEOUT},
    {"position_speed_limit", DESCRIBED_POSITION_SPEED_LIMIT},
    {"answer_id", DESCRIBED_ANSWER_ID},
    {"present_position", DESCRIBED_PRESENT_POSITION},
    {"set_point", DESCRIBED_SET_POINT},
    {"voltage", DESCRIBED_TO_VOLTAGE},
    {"duty", DESCRIBED_TO_DUTY},
    {"current", DESCRIBED_TO_CURRENT},
    {"torque", DESCRIBED_TO_TORQUE},
    {"velocity", DESCRIBED_TO_VELOCITY},
    {"position", DESCRIBED_TO_POSITION},
    {"kp", DESCRIBED_TO_KP},
    {"kd", DESCRIBED_TO_KD},
    {"velocity_cap", DESCRIBED_TO_VELOCITY_CAP},
    {"current_cap", DESCRIBED_TO_CURRENT_CAP},
    {NULL, 0},
};
#define XYZ(word, first)                                                                           \
    {word "_x", first}, {word "_y", (first) + 1},                                                  \
    {                                                                                              \
        word "_z", (first) + 2                                                                     \
    }
static const struct word source_names[] = {
    {"address", DESCRIBED_ADDRESS},
    {"axis", DESCRIBED_AXIS},
    {"state", DESCRIBED_STATE},
    {"law", DESCRIBED_LAW},
    {"telemetry_period", DESCRIBED_TELEMETRY_PERIOD},
    {"parameter_value", DESCRIBED_PARAMETER_VALUE},
    {"velocity_limit", DESCRIBED_VELOCITY_LIMIT},
    {"current_limit", DESCRIBED_CURRENT_LIMIT},
    {"position_gain", DESCRIBED_POSITION_GAIN},
    {"velocity_gain", DESCRIBED_VELOCITY_GAIN},
    {"integral_gain", DESCRIBED_INTEGRAL_GAIN},
    {"command_timeout", DESCRIBED_COMMAND_TIMEOUT},
    {"position_speed_limit", DESCRIBED_POSITION_SPEED_LIMIT},
    {"host_number", DESCRIBED_HOST_NUMBER},
    {"answer_id", DESCRIBED_ANSWER_ID},
    {"result", DESCRIBED_RESULT},
    {"motor_position", DESCRIBED_MOTOR_POSITION},
    {"link_position", DESCRIBED_LINK_POSITION},
    {"deflection", DESCRIBED_DEFLECTION},
    {"motor_velocity", DESCRIBED_MOTOR_VELOCITY},
    {"current", DESCRIBED_AXIS_CURRENT},
    {"torque", DESCRIBED_AXIS_TORQUE},
    {"drive_torque", DESCRIBED_DRIVE_TORQUE},
    {"current_target", DESCRIBED_CURRENT_TARGET},
    {"torque_target", DESCRIBED_TORQUE_TARGET},
    {"electrical_power", DESCRIBED_ELECTRICAL_POWER},
    {"mechanical_power", DESCRIBED_MECHANICAL_POWER},
    {"supply_current", DESCRIBED_SUPPLY_CURRENT},
    {"voltage", DESCRIBED_AXIS_VOLTAGE},
    {"duty", DESCRIBED_AXIS_DUTY},
    {"piston_pressure", DESCRIBED_PISTON_PRESSURE},
    {"rod_pressure", DESCRIBED_ROD_PRESSURE},
    {"valve_opening", DESCRIBED_VALVE_OPENING},
    {"commands", DESCRIBED_COMMANDS},
    {"slot", DESCRIBED_SLOT},
    {"faults", DESCRIBED_FAULTS},
    {"latched_faults", DESCRIBED_LATCHED_FAULTS},
    {"faulty", DESCRIBED_FAULTY},
    {"supply", DESCRIBED_SUPPLY},
    {"temperature", DESCRIBED_TEMPERATURE},
    {"ambient", DESCRIBED_AMBIENT},
    {"sequence", DESCRIBED_SEQUENCE},
    {"uptime", DESCRIBED_UPTIME},
    {"first_slot", DESCRIBED_FIRST_SLOT},
    {"axes", DESCRIBED_AXES_COUNT},
    {"serial", DESCRIBED_SERIAL},
    {"echo", DESCRIBED_ECHO},
    {"saturated", DESCRIBED_SATURATED},
    XYZ("force", DESCRIBED_FT_CHANNEL),
    XYZ("moment", DESCRIBED_FT_CHANNEL + 3),
    XYZ("acceleration", DESCRIBED_ACCELERATION),
    XYZ("rate", DESCRIBED_RATE),
    {"quaternion_w", DESCRIBED_QUATERNION},
    XYZ("quaternion", DESCRIBED_QUATERNION + 1),
    XYZ("magnetic", DESCRIBED_MAGNETIC),
    {"roll", DESCRIBED_EULER},
    {"pitch", DESCRIBED_EULER + 1},
    {"yaw", DESCRIBED_EULER + 2},
    {NULL, 0},
};

const char *described_law_word(enum described_law law)
{
    return word_of(law_names, (int)law);
}

const char *described_meaning_name(enum described_meaning meaning, bool from_host)
{
    const struct word *word = from_host ? target_names : source_names;

    while (word->word && word->value != (int)meaning) {
        word++;
    }
    return word->word                      ? word->word
           : meaning == DESCRIBED_CONSTANT ? "constant"
           : meaning == DESCRIBED_COUNTER  ? "counter"
           : meaning == DESCRIBED_CHECKSUM ? "checksum"
                                           : "";
}

#define STRUCT raw_described_field
static const struct yaml_field field_fields[] = {
    {"name", YAML_STRING, true, AT(name), .min = 1, .max = 31},
    YAML_COUNT("bits", true, STRUCT, bits, 1, 32),
    YAML_COUNT("at_bit", false, STRUCT, at_bit, 0, 8 * DESCRIBED_LENGTH_MAX - 1),
    {"type", YAML_ENUM, false, AT(type), .names = type_names},
    {"order", YAML_ENUM, false, AT(order), .names = order_names},
    {"scale", YAML_REAL, false, AT(field.scale), .min = -1e12, .max = 1e12},
    {"offset", YAML_REAL, false, AT(field.offset), .min = -1e12, .max = 1e12},
    {"range", YAML_REALS, false, AT(range), .count = 2, .min = -1e12, .max = 1e12},
    {"source", YAML_ENUM, false, AT(field.meaning), .names = source_names},
    {"target", YAML_ENUM, false, AT(field.meaning), .names = target_names},
    {"value", YAML_REAL, false, AT(value), .min = -FLT_MAX, .max = FLT_MAX},
    {"times", YAML_STRING, false, AT(times), .min = 1, .max = 31},
    {"fault", YAML_STRING, false, AT(fault), .min = 1, .max = 31},
    {"wraps", YAML_BOOL, false, .offset = AT(field.wraps)},
    {"counter", YAML_BOOL, false, .offset = AT(counter)},
    {"checksum", YAML_ENUM, false, AT(checksum), .names = checksum_names},
    {"host_value", YAML_REAL, false, AT(field.host), .min = -1e12, .max = 1e12},
    YAML_COUNT("axis", false, STRUCT, field.axis, 0, DESCRIBED_AXES - 1),
    {"values", YAML_REAL_DICT, false, AT(entry), .count_offset = AT(nentry)},
};
/* The loader sets the `constant` of an echo later (described_link_echo) */
static const struct raw_described_field field_defaults = {
    .field = {.constant = -1, .scale = 1.0, .times = -1}};
YAML_TABLE(field, "a field", raw_described_field, .defaults = &field_defaults);

#undef STRUCT
#define STRUCT raw_described_frame
static const struct yaml_field frame_fields[] = {
    {"name", YAML_STRING, true, AT(row.name), .min = 1, .max = 31},
    {"from", YAML_ENUM, true, AT(from_host), .names = from_names},
    YAML_COUNT("id", true, STRUCT, row.base, 0, DESCRIBED_EXTENDED_ID_MAX),
    {"extended", YAML_BOOL, false, .offset = AT(extended)},
    {"id_fields", YAML_LIST, false, AT(id_field), AT(nid_field), .schema = &field_schema},
    {"fd", YAML_BOOL, false, .offset = AT(fd)},
    {"bit_rate_switch", YAML_BOOL, false, .offset = AT(brs)},
    {"by", YAML_ENUM, false, AT(row.by), .names = by_names},
    YAML_COUNT("step", false, STRUCT, row.step, 1, DESCRIBED_EXTENDED_ID_MAX),
    {"of", YAML_ENUM, false, AT(row.of), .names = of_names},
    {"remote", YAML_BOOL, false, .offset = AT(row.remote)},
    YAML_COUNT("length", false, STRUCT, length, 0, DESCRIBED_LENGTH_MAX),
    {"lengths", YAML_REALS, false, AT(lengths), .count = 2, .min = 0.0,
     .max = DESCRIBED_LENGTH_MAX},
    YAML_COUNT("repeat", false, STRUCT, repeat, 1, DESCRIBED_LENGTH_MAX),
    {"fields", YAML_LIST, false, AT(field), AT(nfield), .schema = &field_schema},
    {"payload", YAML_STRING, false, AT(payload), .min = 2, .max = 3 * DESCRIBED_LENGTH_MAX - 1},
    {"period_s", YAML_REAL, false, AT(row.period_ns), .ns = true, .min = 0.001, .max = 60.0},
    {"spread_s", YAML_REAL, false, AT(spread_ns), .ns = true, .min = 0.0, .max = 1.0},
    {"telemetry", YAML_BOOL, false, .offset = AT(row.telemetry)},
    {"on_change", YAML_BOOL, false, .offset = AT(row.on_change)},
    {"on_fault", YAML_BOOL, false, .offset = AT(row.on_fault)},
    {"on_restart", YAML_BOOL, false, .offset = AT(row.on_restart)},
    {"optional", YAML_BOOL, false, .offset = AT(row.optional)},
    {"reply", YAML_STRING, false, AT(reply), .min = 1, .max = 31},
    {"reply_delay_s", YAML_REAL, false, AT(row.time.delay_ns), .ns = true, .min = 0.0,
     .max = BOARD_REPLY_MAX_S},
    {"reply_spread_s", YAML_REAL, false, AT(row.time.spread_ns), .ns = true, .min = 0.0,
     .max = BOARD_REPLY_MAX_S},
    {"enter", YAML_STRING, false, AT(enter), .min = 1, .max = 31},
    {"select", YAML_STRING, false, AT(select), .min = 1, .max = 31},
    {"only", YAML_STRING, false, AT(only), .min = 1, .max = 31},
    {"answer_id", YAML_BOOL, false, .offset = AT(row.answer_id)},
    {"save", YAML_BOOL, false, .offset = AT(row.save)},
    {"zero", YAML_BOOL, false, .offset = AT(row.zero)},
    {"stop", YAML_BOOL, false, .offset = AT(row.stop)},
    {"clear_faults", YAML_BOOL, false, .offset = AT(row.clear)},
    {"or_empty", YAML_BOOL, false, .offset = AT(row.or_empty)},
    {"restart", YAML_BOOL, false, .offset = AT(row.restart)},
};
static const struct raw_described_frame frame_defaults = {
    .row = {.step = 1, .time = {-1, -1}}, .repeat = 1, .brs = true};
YAML_TABLE(frame, "a frame", raw_described_frame, .defaults = &frame_defaults);

#undef STRUCT
#define STRUCT described_state
static const struct yaml_field state_fields[] = {
    {"name", YAML_STRING, true, AT(name), .min = 1, .max = 31},
    {"value", YAML_INT, false, AT(value), .min = 0, .max = UINT32_MAX},
    {"result", YAML_INT, false, AT(result), .min = 0, .max = UINT32_MAX},
    {"law", YAML_ENUM, true, AT(law), .names = law_names},
    {"set_point_scale", YAML_REAL, false, AT(set_point_scale), .min = -1e12, .max = 1e12},
    {"lasts_s", YAML_REAL, false, AT(lasts_ns), .ns = true, .min = 0.0, .max = 60.0},
    {"fault", YAML_STRING, false, AT(fault), .min = 1, .max = 31},
};
static const struct described_state state_defaults = {.set_point_scale = 1.0};
YAML_TABLE(state, "a state", described_state, .defaults = &state_defaults);

#undef STRUCT
#define STRUCT raw_described_fault
static const struct yaml_field bit_fields[] = {
    YAML_COUNT("bit", true, STRUCT, bit, 0, 31),
    {"sticky", YAML_BOOL, false, .offset = AT(sticky)},
    {"momentary", YAML_BOOL, false, .offset = AT(momentary)},
};
static const struct raw_described_fault no_bit = {.bit = -1};
YAML_TABLE(bit, "a fault", raw_described_fault, .defaults = &no_bit, .unmarked = true);
#define FAULT(name, kind)                                                                          \
    {                                                                                              \
        name, YAML_MAP, false, (kind) * sizeof(struct raw_described_fault), .schema = &bit_schema  \
    }
static const struct yaml_field fault_fields[] = {
    FAULT("under_voltage", DESCRIBED_UNDER_VOLTAGE),
    FAULT("over_voltage", DESCRIBED_OVER_VOLTAGE),
    FAULT("over_current", DESCRIBED_OVER_CURRENT),
    FAULT("motor_encoder", DESCRIBED_MOTOR_ENCODER),
    FAULT("link_encoder", DESCRIBED_LINK_ENCODER),
    FAULT("torque_sensor", DESCRIBED_TORQUE_SENSOR),
    FAULT("temperature", DESCRIBED_OVER_TEMPERATURE),
    FAULT("under_pressure", DESCRIBED_UNDER_PRESSURE),
    FAULT("over_pressure", DESCRIBED_OVER_PRESSURE),
    FAULT("stale", DESCRIBED_STALE),
    FAULT("position_limit", DESCRIBED_LIMIT),
    FAULT("frames_lost", DESCRIBED_OVERFLOW),
    FAULT("saturated", DESCRIBED_CHANNEL_SATURATED),
    FAULT("inertial_sensor", DESCRIBED_INERTIAL_SENSOR),
    FAULT("emergency_stop", DESCRIBED_STOPPED),
};
const struct yaml_schema described_faults_schema =
    YAML_SCHEMA("the faults", struct raw_described_fault[DESCRIBED_FAULT_KINDS], fault_fields,
                .unmarked = true);

#undef STRUCT
#define STRUCT raw_described_parameter
static const struct yaml_field parameter_fields[] = {
    {"number", YAML_INT, false, AT(number), .min = 0, .max = UINT32_MAX},
    {"writable", YAML_BOOL, false, .offset = AT(writable)},
    {"field", YAML_MAP, true, AT(field), .schema = &field_schema},
};
YAML_TABLE(parameter, "a parameter", raw_described_parameter);

#undef STRUCT
#define STRUCT raw_described_model
static const struct yaml_field model_fields[] = {
    {"name", YAML_STRING, true, AT(name), .min = 1, .max = 31},
    {"values", YAML_REAL_DICT, true, AT(entry), .count_offset = AT(nentry)},
};
YAML_TABLE(model, "a model", raw_described_model);

#undef STRUCT
#define STRUCT described_gains
static const struct yaml_field gains_fields[] = {
    {"position_per_s", YAML_REAL, false, AT(position_per_s), .min = 0.0, .max = 1e6},
    {"velocity_nm_s_rad", YAML_REAL, false, AT(velocity_nm_s_rad), .min = 0.0, .max = 1e6},
    {"velocity_nm_rad", YAML_REAL, false, AT(velocity_nm_rad), .min = 0.0, .max = 1e6},
};
YAML_TABLE(gains, "the gains", described_gains, .unmarked = true);

#undef STRUCT
#define STRUCT raw_described_host
static const struct yaml_field host_fields[] = {
    {"discover", YAML_NAME_LIST, false, AT(discover), .count_offset = AT(ndiscover)},
    {"configure", YAML_NAME_LIST, false, AT(configure), .count_offset = AT(nconfigure)},
    {"on", YAML_NAME_LIST, false, AT(on), .count_offset = AT(non)},
    {"off", YAML_NAME_LIST, false, AT(off), .count_offset = AT(noff)},
    {"command", YAML_NAME_LIST, false, AT(command), .count_offset = AT(ncommand)},
    {"on_state", YAML_STRING, false, AT(on_state), .min = 1, .max = 31},
    {"off_state", YAML_STRING, false, AT(off_state), .min = 1, .max = 31},
};
YAML_TABLE(host, "the host", raw_described_host, .hash_offset = 0);

#undef STRUCT
#define STRUCT raw_described
static const struct yaml_field described_fields[] = {
    {"name", YAML_STRING, true, AT(name), .min = 1, .max = 31},
    {"description", YAML_STRING, false, AT(description), .min = 1, .max = 1000},
    YAML_COUNT("axes", false, STRUCT, axes, 1, DESCRIBED_AXES),
    YAML_COUNT("address_max", false, STRUCT, address_max, 1, DESCRIBED_ADDRESS_MAX),
    {"follow_fd", YAML_BOOL, false, .offset = AT(follow_fd)},
    {"command_timeout_s", YAML_REAL, false, AT(command_timeout_ns), .ns = true, .min = 0.0,
     .max = 60.0},
    {"reply_delay_s", YAML_REAL, false, AT(time.delay_ns), .ns = true, .min = 0.0,
     .max = BOARD_REPLY_MAX_S},
    {"reply_spread_s", YAML_REAL, false, AT(time.spread_ns), .ns = true, .min = 0.0,
     .max = BOARD_REPLY_MAX_S},
    {"on_timeout", YAML_STRING, false, AT(timeout_state), .min = 1, .max = 31},
    {"unknown_state", YAML_STRING, false, AT(unknown_state), .min = 1, .max = 31},
    {"states", YAML_LIST, true, AT(state), AT(nstate), .schema = &state_schema},
    {"laws", YAML_LIST, false, AT(law), AT(nlaw), .schema = &state_schema},
    {"faults", YAML_MAP, false, AT(fault), .schema = &described_faults_schema},
    {"parameters", YAML_LIST, false, AT(parameter), AT(nparameter), .schema = &parameter_schema},
    {"models", YAML_LIST, false, AT(model), AT(nmodel), .schema = &model_schema},
    {"gains", YAML_MAP, false, AT(gains), .schema = &gains_schema},
    {"frames", YAML_LIST, true, AT(frame), AT(nframe), .schema = &frame_schema},
    {"host", YAML_MAP, false, AT(host), .schema = &host_schema},
};
static const struct raw_described described_defaults = {
    .description = "", .axes = 1, .address_max = 31};
const struct yaml_schema described_file_schema =
    YAML_SCHEMA("the protocol", struct raw_described, described_fields,
                .defaults = &described_defaults, .format_version = 1);
