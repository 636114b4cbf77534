/* SPDX-License-Identifier: Apache-2.0 */
/* Declares the keys of a scenario file. */
#include "app/scenario/private.h"

#include "base/array.h"

#include <float.h>

#define AT(type, member) offsetof(struct type, member)

static const struct word host_words[] = {{"none", SCENARIO_HOST_NONE},
                                         {"enabled", SCENARIO_HOST_ENABLED},
                                         {"program", SCENARIO_HOST_PROGRAM},
                                         {NULL, 0}};

static const struct yaml_field frame_fields[] = {
    {"bus", YAML_STRING, true, .offset = AT(scenario_frame, bus), .min = 1, .max = 63},
    {"id", YAML_INT, true, .offset = AT(scenario_frame, id), .min = 0, .max = 0x1fffffff},
    {"data", YAML_STRING, false, .offset = AT(scenario_frame, data)},
    {"copies", YAML_INT, false, .offset = AT(scenario_frame, copies), .min = 1, .max = 256},
    {"extended", YAML_BOOL, false, .offset = AT(scenario_frame, extended)},
    {"fd", YAML_BOOL, false, .offset = AT(scenario_frame, fd)},
    {"remote", YAML_BOOL, false, .offset = AT(scenario_frame, remote)},
};
static const struct scenario_frame frame_defaults = {.copies = 1};
static const struct yaml_schema frame_schema =
    YAML_SCHEMA("a frame", struct scenario_frame, frame_fields, .defaults = &frame_defaults);

static const struct yaml_field voltage_fields[] = {
    {"joint", YAML_STRING, true, .offset = AT(scenario_voltage, joint), .min = 1, .max = 63},
    {"volts", YAML_REAL, true, .offset = AT(scenario_voltage, volts), .min = -1e3, .max = 1e3},
};
static const struct yaml_schema voltage_schema =
    YAML_SCHEMA("a voltage", struct scenario_voltage, voltage_fields);

static const struct yaml_field motor_fields[] = {
    {"joint", YAML_STRING, true, .offset = AT(scenario_motor, joint), .min = 1, .max = 63},
    {"on", YAML_BOOL, true, .offset = AT(scenario_motor, on)},
};
static const struct yaml_schema motor_schema =
    YAML_SCHEMA("a motor", struct scenario_motor, motor_fields);

static const struct yaml_field push_fields[] = {
    {"body", YAML_STRING, true, .offset = AT(scenario_push, body), .min = 1, .max = 63},
    {"force_n", YAML_REALS, false, .offset = AT(scenario_push, force_n), .count = 3, .min = -1e5,
     .max = 1e5},
    {"moment_nm", YAML_REALS, false, .offset = AT(scenario_push, moment_nm), .count = 3,
     .min = -1e5, .max = 1e5},
};
static const struct yaml_schema push_schema =
    YAML_SCHEMA("a push", struct scenario_push, push_fields);

static const struct yaml_field stimulus_fields[] = {
    {"label", YAML_STRING, false, .offset = AT(scenario_stimulus, label), .min = 1, .max = 63},
    {"after", YAML_STRING, false, .offset = AT(scenario_stimulus, after), .min = 1, .max = 63},
    {"at_s", YAML_REAL, false, .offset = AT(scenario_stimulus, at_s), .min = 0.0, .max = 1e5},
    {"for_s", YAML_REAL, false, .offset = AT(scenario_stimulus, for_s), .min = DBL_MIN, .max = 1e5},
    {"every_s", YAML_REAL, false, .offset = AT(scenario_stimulus, every_s), .min = 1e-4,
     .max = 1e5},
    {"frame", YAML_MAP, false, .offset = AT(scenario_stimulus, frame), .schema = &frame_schema},
    {"voltage", YAML_MAP, false, .offset = AT(scenario_stimulus, voltage),
     .schema = &voltage_schema},
    {"motor", YAML_MAP, false, .offset = AT(scenario_stimulus, motor), .schema = &motor_schema},
    {"push", YAML_MAP, false, .offset = AT(scenario_stimulus, push), .schema = &push_schema},
    {"fault", YAML_STRING, false, .offset = AT(scenario_stimulus, fault), .min = 1, .max = 140},
    {"silence", YAML_BOOL, false, .offset = AT(scenario_stimulus, silence)},
};
static const struct yaml_schema stimulus_schema =
    YAML_SCHEMA("a stimulus", struct scenario_stimulus, stimulus_fields);

static const struct yaml_field pattern_fields[] = {
    {"bus", YAML_STRING, true, .offset = AT(scenario_pattern, bus), .min = 1, .max = 63},
    {"id", YAML_INT, true, .offset = AT(scenario_pattern, id), .min = 0, .max = 0x1fffffff},
    {"id_mask", YAML_INT, false, .offset = AT(scenario_pattern, id_mask), .min = 0,
     .max = 0x1fffffff},
    {"extended", YAML_BOOL, false, .offset = AT(scenario_pattern, extended)},
    {"data", YAML_STRING, false, .offset = AT(scenario_pattern, data)},
};
static const struct scenario_pattern pattern_defaults = {.id_mask = 0x1fffffff};
static const struct yaml_schema pattern_schema = YAML_SCHEMA(
    "a pattern of frames", struct scenario_pattern, pattern_fields, .defaults = &pattern_defaults);

static const struct yaml_field expectation_fields[] = {
    {"name", YAML_STRING, true, .offset = AT(scenario_expectation, name), .min = 1, .max = 95},
    {"after", YAML_STRING, false, .offset = AT(scenario_expectation, after), .min = 1, .max = 63},
    {"from_s", YAML_REAL, false, .offset = AT(scenario_expectation, from_s), .min = 0.0,
     .max = 1e5},
    {"to_s", YAML_REAL, false, .offset = AT(scenario_expectation, to_s), .min = 0.0, .max = 1e5},
    {"within_s", YAML_REAL, false, .offset = AT(scenario_expectation, within_s), .min = 0.0,
     .max = 1e5},
    {"signal", YAML_STRING, false, .offset = AT(scenario_expectation, signal), .min = 1, .max = 95},
    {"between", YAML_REALS, false, .offset = AT(scenario_expectation, between), .count = 2},
    {"reaches", YAML_REALS, false, .offset = AT(scenario_expectation, reaches), .count = 2},
    {"relative", YAML_BOOL, false, .offset = AT(scenario_expectation, relative)},
    {"frame", YAML_MAP, false, .offset = AT(scenario_expectation, frame),
     .schema = &pattern_schema},
    {"event", YAML_STRING, false, .offset = AT(scenario_expectation, event), .min = 1, .max = 127},
    {"count", YAML_REALS, false, .offset = AT(scenario_expectation, count), .count = 2, .min = 0.0,
     .max = 1e9},
    {"period_s", YAML_REALS, false, .offset = AT(scenario_expectation, period_s), .count = 2,
     .min = 0.0, .max = 1e5},
    {"never", YAML_BOOL, false, .offset = AT(scenario_expectation, never)},
};
static const struct yaml_schema expectation_schema =
    YAML_SCHEMA("an expectation", struct scenario_expectation, expectation_fields);

static const struct yaml_field mutation_fields[] = {
    {"name", YAML_STRING, true, .offset = AT(scenario_mutation, name), .min = 1, .max = 63},
    {"fault", YAML_STRING, false, .offset = AT(scenario_mutation, fault), .min = 1, .max = 159},
    {"without", YAML_STRING, false, .offset = AT(scenario_mutation, without), .min = 1, .max = 63},
    {"fails", YAML_NAME_LIST, false, .offset = AT(scenario_mutation, fails),
     .count_offset = AT(scenario_mutation, nfail)},
};
static const struct yaml_schema mutation_schema =
    YAML_SCHEMA("a mutation", struct scenario_mutation, mutation_fields);

static const struct yaml_field parameter_fields[] = {
    {"values", YAML_REAL_LIST, false, .offset = AT(scenario_parameter, value),
     .count_offset = AT(scenario_parameter, nvalue)},
    {"words", YAML_NAME_LIST, false, .offset = AT(scenario_parameter, word),
     .count_offset = AT(scenario_parameter, nword)},
};
const struct yaml_schema scenario_parameter_schema =
    YAML_SCHEMA("a parameter", struct scenario_parameter, parameter_fields,
                .name_offset = offsetof(struct scenario_parameter, name));

static const struct yaml_field scenario_fields[] = {
    {"name", YAML_STRING, true, .offset = AT(scenario, name), .min = 1, .max = 63},
    {"description", YAML_STRING, true, .offset = AT(scenario, description), .min = 1, .max = 1000},
    {"rig", YAML_STRING, true, .offset = AT(scenario, rig), .min = 1, .max = 255},
    {"clock", YAML_ENUM, false, .offset = AT(scenario, clock), .names = loop_clock_words + 1},
    {"hold", YAML_ENUM, false, .offset = AT(scenario, hold), .names = rig_hold_words},
    {"wire", YAML_ENUM, false, .offset = AT(scenario, wire), .names = rig_wire_words},
    {"settle", YAML_BOOL, false, .offset = AT(scenario, settle)},
    {"seed", YAML_INT, false, .offset = AT(scenario, seed), .min = 0, .max = 9e15},
    {"duration_s", YAML_REAL, true, .offset = AT(scenario, duration_s), .min = 1e-3, .max = 1e4},
    {"clean_up_s", YAML_REAL, false, .offset = AT(scenario, clean_up_s), .min = 0.0, .max = 1e3},
    {"cpu_limit_s", YAML_REAL, false, .offset = AT(scenario, cpu_limit_s), .min = 0.1, .max = 1e5},
    {"wall_limit_s", YAML_REAL, false, .offset = AT(scenario, wall_limit_s), .min = 0.1,
     .max = 1e5},
    {"to_the_end", YAML_BOOL, false, .offset = AT(scenario, to_the_end)},
    {"host", YAML_ENUM, false, .offset = AT(scenario, host), .names = host_words},
    {"task", YAML_STRING, false, .offset = AT(scenario, task), .min = 1, .max = 31},
    {"parameters", YAML_DICT, false, .offset = AT(scenario, parameter),
     .count_offset = AT(scenario, nparameter), .schema = &scenario_parameter_schema},
    {"faults", YAML_NAME_LIST, false, .offset = AT(scenario, fault),
     .count_offset = AT(scenario, nfault)},
    {"stimuli", YAML_LIST, false, .offset = AT(scenario, stimulus),
     .count_offset = AT(scenario, nstimulus), .schema = &stimulus_schema},
    {"clean_up", YAML_LIST, false, .offset = AT(scenario, clean_up),
     .count_offset = AT(scenario, ncleanup), .schema = &stimulus_schema},
    {"expectations", YAML_LIST, true, .offset = AT(scenario, expectation),
     .count_offset = AT(scenario, nexpectation), .schema = &expectation_schema},
    {"mutations", YAML_LIST, false, .offset = AT(scenario, mutation),
     .count_offset = AT(scenario, nmutation), .schema = &mutation_schema},
};
static const struct scenario scenario_defaults = {
    .clock = LOOP_CLOCK_FREE,
    .cpu_limit_s = 60.0,
    .wall_limit_s = 60.0,
};
const struct yaml_schema scenario_file_schema =
    YAML_SCHEMA("the scenario", struct scenario, scenario_fields, .defaults = &scenario_defaults,
                .format_version = 1);
