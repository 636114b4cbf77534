/* SPDX-License-Identifier: Apache-2.0 */
/* Declares the keys of a scenario file. */
#include "app/scenario/private.h"

#include "base/array.h"

#include <float.h>

#define AT(member) offsetof(struct STRUCT, member)

static const struct word host_words[] = {{"none", SCENARIO_HOST_NONE},
                                         {"enabled", SCENARIO_HOST_ENABLED},
                                         {"program", SCENARIO_HOST_PROGRAM},
                                         {NULL, 0}};

#define STRUCT scenario_frame
static const struct yaml_field frame_fields[] = {
    {"bus", YAML_STRING, true, .offset = AT(bus), .min = 1, .max = 63},
    {"id", YAML_INT, true, .offset = AT(id), .min = 0, .max = 0x1fffffff},
    {"data", YAML_STRING, false, .offset = AT(data)},
    {"copies", YAML_INT, false, .offset = AT(copies), .min = 1, .max = 256},
    {"extended", YAML_BOOL, false, .offset = AT(extended)},
    {"fd", YAML_BOOL, false, .offset = AT(fd)},
    {"remote", YAML_BOOL, false, .offset = AT(remote)},
};
#undef STRUCT
static const struct scenario_frame frame_defaults = {.copies = 1};
static const struct yaml_schema frame_schema = {.what = "a frame",
                                                .size = sizeof(struct scenario_frame),
                                                .fields = frame_fields,
                                                .field_count = ARRAY_COUNT(frame_fields),
                                                .defaults = &frame_defaults};

#define STRUCT scenario_voltage
static const struct yaml_field voltage_fields[] = {
    {"joint", YAML_STRING, true, .offset = AT(joint), .min = 1, .max = 63},
    {"volts", YAML_REAL, true, .offset = AT(volts), .min = -1e3, .max = 1e3},
};
#undef STRUCT
static const struct yaml_schema voltage_schema = {.what = "a voltage",
                                                  .size = sizeof(struct scenario_voltage),
                                                  .fields = voltage_fields,
                                                  .field_count = ARRAY_COUNT(voltage_fields)};

#define STRUCT scenario_motor
static const struct yaml_field motor_fields[] = {
    {"joint", YAML_STRING, true, .offset = AT(joint), .min = 1, .max = 63},
    {"on", YAML_BOOL, true, .offset = AT(on)},
};
#undef STRUCT
static const struct yaml_schema motor_schema = {.what = "a motor",
                                                .size = sizeof(struct scenario_motor),
                                                .fields = motor_fields,
                                                .field_count = ARRAY_COUNT(motor_fields)};

#define STRUCT scenario_push
static const struct yaml_field push_fields[] = {
    {"body", YAML_STRING, true, .offset = AT(body), .min = 1, .max = 63},
    {"force_n", YAML_REALS, false, .offset = AT(force_n), .count = 3, .min = -1e5, .max = 1e5},
    {"moment_nm", YAML_REALS, false, .offset = AT(moment_nm), .count = 3, .min = -1e5, .max = 1e5},
};
#undef STRUCT
static const struct yaml_schema push_schema = {.what = "a push",
                                               .size = sizeof(struct scenario_push),
                                               .fields = push_fields,
                                               .field_count = ARRAY_COUNT(push_fields)};

#define STRUCT scenario_stimulus
static const struct yaml_field stimulus_fields[] = {
    {"label", YAML_STRING, false, .offset = AT(label), .min = 1, .max = 63},
    {"after", YAML_STRING, false, .offset = AT(after), .min = 1, .max = 63},
    {"at_s", YAML_REAL, false, .offset = AT(at_s), .min = 0.0, .max = 1e5},
    {"for_s", YAML_REAL, false, .offset = AT(for_s), .min = DBL_MIN, .max = 1e5},
    {"every_s", YAML_REAL, false, .offset = AT(every_s), .min = 1e-4, .max = 1e5},
    {"frame", YAML_MAP, false, .offset = AT(frame), .given_offset = AT(frame_given),
     .schema = &frame_schema},
    {"voltage", YAML_MAP, false, .offset = AT(voltage), .given_offset = AT(voltage_given),
     .schema = &voltage_schema},
    {"motor", YAML_MAP, false, .offset = AT(motor), .given_offset = AT(motor_given),
     .schema = &motor_schema},
    {"push", YAML_MAP, false, .offset = AT(push), .given_offset = AT(push_given),
     .schema = &push_schema},
    {"fault", YAML_STRING, false, .offset = AT(fault), .min = 1, .max = 140,
     .given_offset = AT(fault_given)},
    {"silence", YAML_BOOL, false, .offset = AT(silence)},
};
#undef STRUCT
static const struct yaml_schema stimulus_schema = {.what = "a stimulus",
                                                   .size = sizeof(struct scenario_stimulus),
                                                   .fields = stimulus_fields,
                                                   .field_count = ARRAY_COUNT(stimulus_fields)};

#define STRUCT scenario_pattern
static const struct yaml_field pattern_fields[] = {
    {"bus", YAML_STRING, true, .offset = AT(bus), .min = 1, .max = 63},
    {"id", YAML_INT, true, .offset = AT(id), .min = 0, .max = 0x1fffffff},
    {"id_mask", YAML_INT, false, .offset = AT(id_mask), .min = 0, .max = 0x1fffffff},
    {"extended", YAML_BOOL, false, .offset = AT(extended)},
    {"data", YAML_STRING, false, .offset = AT(data), .given_offset = AT(data_given)},
};
#undef STRUCT
static const struct scenario_pattern pattern_defaults = {.id_mask = 0x1fffffff};
static const struct yaml_schema pattern_schema = {.what = "a pattern of frames",
                                                  .size = sizeof(struct scenario_pattern),
                                                  .fields = pattern_fields,
                                                  .field_count = ARRAY_COUNT(pattern_fields),
                                                  .defaults = &pattern_defaults};

#define STRUCT scenario_expectation
static const struct yaml_field expectation_fields[] = {
    {"name", YAML_STRING, true, .offset = AT(name), .min = 1, .max = 95},
    {"after", YAML_STRING, false, .offset = AT(after), .min = 1, .max = 63},
    {"from_s", YAML_REAL, false, .offset = AT(from_s), .min = 0.0, .max = 1e5},
    {"to_s", YAML_REAL, false, .offset = AT(to_s), .min = 0.0, .max = 1e5,
     .given_offset = AT(to_given)},
    {"within_s", YAML_REAL, false, .offset = AT(within_s), .min = 0.0, .max = 1e5,
     .given_offset = AT(within_given)},
    {"signal", YAML_STRING, false, .offset = AT(signal), .min = 1, .max = 95,
     .given_offset = AT(signal_given)},
    {"between", YAML_REALS, false, .offset = AT(between), .count = 2,
     .given_offset = AT(between_given)},
    {"reaches", YAML_REALS, false, .offset = AT(reaches), .count = 2,
     .given_offset = AT(reaches_given)},
    {"relative", YAML_BOOL, false, .offset = AT(relative)},
    {"frame", YAML_MAP, false, .offset = AT(frame), .given_offset = AT(frame_given),
     .schema = &pattern_schema},
    {"event", YAML_STRING, false, .offset = AT(event), .min = 1, .max = 127,
     .given_offset = AT(event_given)},
    {"count", YAML_REALS, false, .offset = AT(count), .count = 2, .min = 0.0, .max = 1e9,
     .given_offset = AT(count_given)},
    {"period_s", YAML_REALS, false, .offset = AT(period_s), .count = 2, .min = 0.0, .max = 1e5,
     .given_offset = AT(period_given)},
    {"never", YAML_BOOL, false, .offset = AT(never)},
};
#undef STRUCT
static const struct yaml_schema expectation_schema = {.what = "an expectation",
                                                      .size = sizeof(struct scenario_expectation),
                                                      .fields = expectation_fields,
                                                      .field_count =
                                                          ARRAY_COUNT(expectation_fields)};

#define STRUCT scenario_mutation
static const struct yaml_field mutation_fields[] = {
    {"name", YAML_STRING, true, .offset = AT(name), .min = 1, .max = 63},
    {"fault", YAML_STRING, false, .offset = AT(fault), .min = 1, .max = 159,
     .given_offset = AT(fault_given)},
    {"without", YAML_STRING, false, .offset = AT(without), .min = 1, .max = 63,
     .given_offset = AT(without_given)},
    {"fails", YAML_NAME_LIST, false, .offset = AT(fails), .count_offset = AT(nfail)},
};
#undef STRUCT
static const struct yaml_schema mutation_schema = {.what = "a mutation",
                                                   .size = sizeof(struct scenario_mutation),
                                                   .fields = mutation_fields,
                                                   .field_count = ARRAY_COUNT(mutation_fields)};

#define STRUCT scenario_parameter
static const struct yaml_field parameter_fields[] = {
    {"values", YAML_REAL_LIST, false, .offset = AT(value), .count_offset = AT(nvalue)},
    {"words", YAML_NAME_LIST, false, .offset = AT(word), .count_offset = AT(nword)},
};
#undef STRUCT
const struct yaml_schema scenario_parameter_schema = {
    .what = "a parameter",
    .size = sizeof(struct scenario_parameter),
    .fields = parameter_fields,
    .field_count = ARRAY_COUNT(parameter_fields),
    .name_offset = offsetof(struct scenario_parameter, name)};

#define STRUCT scenario
static const struct yaml_field scenario_fields[] = {
    {"name", YAML_STRING, true, .offset = AT(name), .min = 1, .max = 63},
    {"description", YAML_STRING, true, .offset = AT(description), .min = 1, .max = 1000},
    {"rig", YAML_STRING, true, .offset = AT(rig), .min = 1, .max = 255,
     .mark_offset = AT(rig_mark)},
    {"clock", YAML_ENUM, false, .offset = AT(clock), .names = loop_clock_words + 1},
    {"hold", YAML_ENUM, false, .offset = AT(hold), .names = rig_hold_words,
     .given_offset = AT(hold_given)},
    {"wire", YAML_ENUM, false, .offset = AT(wire), .names = rig_wire_words,
     .given_offset = AT(wire_given)},
    {"settle", YAML_BOOL, false, .offset = AT(settle)},
    {"seed", YAML_INT, false, .offset = AT(seed), .min = 0, .max = 9e15,
     .given_offset = AT(seed_given)},
    {"duration_s", YAML_REAL, true, .offset = AT(duration_s), .min = 1e-3, .max = 1e4},
    {"clean_up_s", YAML_REAL, false, .offset = AT(clean_up_s), .min = 0.0, .max = 1e3},
    {"cpu_limit_s", YAML_REAL, false, .offset = AT(cpu_limit_s), .min = 0.1, .max = 1e5},
    {"wall_limit_s", YAML_REAL, false, .offset = AT(wall_limit_s), .min = 0.1, .max = 1e5},
    {"to_the_end", YAML_BOOL, false, .offset = AT(to_the_end)},
    {"host", YAML_ENUM, false, .offset = AT(host), .names = host_words},
    {"task", YAML_STRING, false, .offset = AT(task), .min = 1, .max = 31,
     .mark_offset = AT(task_mark), .given_offset = AT(task_given)},
    {"parameters", YAML_DICT, false, .offset = AT(parameter), .count_offset = AT(nparameter),
     .schema = &scenario_parameter_schema},
    {"faults", YAML_NAME_LIST, false, .offset = AT(fault), .count_offset = AT(nfault)},
    {"stimuli", YAML_LIST, false, .offset = AT(stimulus), .count_offset = AT(nstimulus),
     .schema = &stimulus_schema},
    {"clean_up", YAML_LIST, false, .offset = AT(clean_up), .count_offset = AT(ncleanup),
     .schema = &stimulus_schema},
    {"expectations", YAML_LIST, true, .offset = AT(expectation), .count_offset = AT(nexpectation),
     .schema = &expectation_schema},
    {"mutations", YAML_LIST, false, .offset = AT(mutation), .count_offset = AT(nmutation),
     .schema = &mutation_schema},
};
#undef STRUCT
static const struct scenario scenario_defaults = {
    .clock = LOOP_CLOCK_FREE,
    .cpu_limit_s = 60.0,
    .wall_limit_s = 60.0,
};
const struct yaml_schema scenario_file_schema = {.what = "the scenario",
                                                 .size = sizeof(struct scenario),
                                                 .fields = scenario_fields,
                                                 .field_count = ARRAY_COUNT(scenario_fields),
                                                 .defaults = &scenario_defaults,
                                                 .format_version = 1};
