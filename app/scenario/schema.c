/* SPDX-License-Identifier: Apache-2.0 */
/* Declares the keys of a scenario file. */
#include "app/scenario/private.h"

#include <float.h>

#define AT(type, member) offsetof(struct type, member)

static const struct word host_words[] = {{"none", SCENARIO_HOST_NONE},
                                         {"enabled", SCENARIO_HOST_ENABLED},
                                         {"program", SCENARIO_HOST_PROGRAM},
                                         {NULL, 0}};

static const struct yaml_field frame_fields[] = {
    YAML_TEXT("bus", true, scenario_frame, bus, 1, 63),
    {"id", YAML_INT, true, .offset = AT(scenario_frame, id), .min = 0, .max = 0x1fffffff},
    {"data", YAML_STRING, false, .offset = AT(scenario_frame, data)},
    {"copies", YAML_INT, false, .offset = AT(scenario_frame, copies), .min = 1, .max = 256},
    {"extended", YAML_BOOL, false, .offset = AT(scenario_frame, extended)},
    {"fd", YAML_BOOL, false, .offset = AT(scenario_frame, fd)},
    {"remote", YAML_BOOL, false, .offset = AT(scenario_frame, remote)},
};
static const struct scenario_frame frame_defaults = {.copies = 1};
YAML_TABLE(frame, "a frame", scenario_frame, .defaults = &frame_defaults);

static const struct yaml_field voltage_fields[] = {
    YAML_TEXT("joint", true, scenario_voltage, joint, 1, 63),
    YAML_NUMBER("volts", true, scenario_voltage, volts, -1e3, 1e3),
};
YAML_TABLE(voltage, "a voltage", scenario_voltage);

static const struct yaml_field motor_fields[] = {
    YAML_TEXT("joint", true, scenario_motor, joint, 1, 63),
    {"on", YAML_BOOL, true, .offset = AT(scenario_motor, on)},
};
YAML_TABLE(motor, "a motor", scenario_motor);

static const struct yaml_field push_fields[] = {
    YAML_TEXT("body", true, scenario_push, body, 1, 63),
    YAML_NUMBERS("force_n", false, scenario_push, force_n, 3, -1e5, 1e5),
    YAML_NUMBERS("moment_nm", false, scenario_push, moment_nm, 3, -1e5, 1e5),
};
YAML_TABLE(push, "a push", scenario_push);

static const struct yaml_field stimulus_fields[] = {
    YAML_TEXT("label", false, scenario_stimulus, label, 1, 63),
    YAML_TEXT("after", false, scenario_stimulus, after, 1, 63),
    YAML_NUMBER("at_s", false, scenario_stimulus, at_s, 0.0, 1e5),
    YAML_NUMBER("for_s", false, scenario_stimulus, for_s, DBL_MIN, 1e5),
    YAML_NUMBER("every_s", false, scenario_stimulus, every_s, 1e-4, 1e5),
    YAML_SECTION("frame", false, scenario_stimulus, frame, frame_schema),
    YAML_SECTION("voltage", false, scenario_stimulus, voltage, voltage_schema),
    YAML_SECTION("motor", false, scenario_stimulus, motor, motor_schema),
    YAML_SECTION("push", false, scenario_stimulus, push, push_schema),
    YAML_TEXT("fault", false, scenario_stimulus, fault, 1, 140),
    {"silence", YAML_BOOL, false, .offset = AT(scenario_stimulus, silence)},
};
YAML_TABLE(stimulus, "a stimulus", scenario_stimulus);

static const struct yaml_field pattern_fields[] = {
    YAML_TEXT("bus", true, scenario_pattern, bus, 1, 63),
    {"id", YAML_INT, true, .offset = AT(scenario_pattern, id), .min = 0, .max = 0x1fffffff},
    {"id_mask", YAML_INT, false, .offset = AT(scenario_pattern, id_mask), .min = 0,
     .max = 0x1fffffff},
    {"extended", YAML_BOOL, false, .offset = AT(scenario_pattern, extended)},
    {"data", YAML_STRING, false, .offset = AT(scenario_pattern, data)},
};
static const struct scenario_pattern pattern_defaults = {.id_mask = 0x1fffffff};
YAML_TABLE(pattern, "a pattern of frames", scenario_pattern, .defaults = &pattern_defaults);

static const struct yaml_field expectation_fields[] = {
    YAML_TEXT("name", true, scenario_expectation, name, 1, 95),
    YAML_TEXT("after", false, scenario_expectation, after, 1, 63),
    YAML_NUMBER("from_s", false, scenario_expectation, from_s, 0.0, 1e5),
    YAML_NUMBER("to_s", false, scenario_expectation, to_s, 0.0, 1e5),
    YAML_NUMBER("within_s", false, scenario_expectation, within_s, 0.0, 1e5),
    YAML_TEXT("signal", false, scenario_expectation, signal, 1, 95),
    {"between", YAML_REALS, false, .offset = AT(scenario_expectation, between), .count = 2},
    {"reaches", YAML_REALS, false, .offset = AT(scenario_expectation, reaches), .count = 2},
    {"relative", YAML_BOOL, false, .offset = AT(scenario_expectation, relative)},
    YAML_SECTION("frame", false, scenario_expectation, frame, pattern_schema),
    YAML_TEXT("event", false, scenario_expectation, event, 1, 127),
    YAML_NUMBERS("count", false, scenario_expectation, count, 2, 0.0, 1e9),
    YAML_NUMBERS("period_s", false, scenario_expectation, period_s, 2, 0.0, 1e5),
    {"never", YAML_BOOL, false, .offset = AT(scenario_expectation, never)},
};
YAML_TABLE(expectation, "an expectation", scenario_expectation);

static const struct yaml_field mutation_fields[] = {
    YAML_TEXT("name", true, scenario_mutation, name, 1, 63),
    YAML_TEXT("fault", false, scenario_mutation, fault, 1, 159),
    YAML_TEXT("without", false, scenario_mutation, without, 1, 63),
    {"fails", YAML_NAME_LIST, false, AT(scenario_mutation, fails),
     .count_offset = AT(scenario_mutation, nfail)},
};
YAML_TABLE(mutation, "a mutation", scenario_mutation);

static const struct yaml_field parameter_fields[] = {
    {"values", YAML_REAL_LIST, false, AT(scenario_parameter, value),
     .count_offset = AT(scenario_parameter, nvalue)},
    {"words", YAML_NAME_LIST, false, AT(scenario_parameter, word),
     .count_offset = AT(scenario_parameter, nword)},
};
const struct yaml_schema scenario_parameter_schema =
    YAML_SCHEMA("a parameter", struct scenario_parameter, parameter_fields,
                .name_offset = offsetof(struct scenario_parameter, name));

static const struct yaml_field scenario_fields[] = {
    YAML_TEXT("name", true, scenario, name, 1, 63),
    YAML_TEXT("description", true, scenario, description, 1, 1000),
    YAML_TEXT("rig", true, scenario, rig, 1, 255),
    {"clock", YAML_ENUM, false, .offset = AT(scenario, clock), .names = loop_clock_words + 1},
    {"hold", YAML_ENUM, false, .offset = AT(scenario, hold), .names = rig_hold_words},
    {"wire", YAML_ENUM, false, .offset = AT(scenario, wire), .names = rig_wire_words},
    {"settle", YAML_BOOL, false, .offset = AT(scenario, settle)},
    {"seed", YAML_INT, false, .offset = AT(scenario, seed), .min = 0, .max = 9e15},
    YAML_NUMBER("duration_s", true, scenario, duration_s, 1e-3, 1e4),
    YAML_NUMBER("clean_up_s", false, scenario, clean_up_s, 0.0, 1e3),
    YAML_NUMBER("cpu_limit_s", false, scenario, cpu_limit_s, 0.1, 1e5),
    YAML_NUMBER("wall_limit_s", false, scenario, wall_limit_s, 0.1, 1e5),
    {"to_the_end", YAML_BOOL, false, .offset = AT(scenario, to_the_end)},
    {"host", YAML_ENUM, false, .offset = AT(scenario, host), .names = host_words},
    YAML_TEXT("task", false, scenario, task, 1, 31),
    YAML_ENTRIES("parameters", YAML_DICT, false, scenario, parameter, nparameter,
                 scenario_parameter_schema),
    {"faults", YAML_NAME_LIST, false, AT(scenario, fault), .count_offset = AT(scenario, nfault)},
    YAML_ENTRIES("stimuli", YAML_LIST, false, scenario, stimulus, nstimulus, stimulus_schema),
    YAML_ENTRIES("clean_up", YAML_LIST, false, scenario, clean_up, ncleanup, stimulus_schema),
    YAML_ENTRIES("expectations", YAML_LIST, true, scenario, expectation, nexpectation,
                 expectation_schema),
    YAML_ENTRIES("mutations", YAML_LIST, false, scenario, mutation, nmutation, mutation_schema),
};
static const struct scenario scenario_defaults = {
    .clock = LOOP_CLOCK_FREE,
    .cpu_limit_s = 60.0,
    .wall_limit_s = 60.0,
};
const struct yaml_schema scenario_file_schema =
    YAML_SCHEMA("the scenario", struct scenario, scenario_fields, .defaults = &scenario_defaults,
                .format_version = 1, .quoted_values = true);
