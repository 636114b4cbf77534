/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A protocol file as it is written: every key has a member here and its declaration in schema.c.
 * load.c makes a table of it. Not RT-safe.
 */
#ifndef BOARDS_DESCRIBED_SCHEMA_H
#define BOARDS_DESCRIBED_SCHEMA_H

#include "base/yaml.h"

#include <stdint.h>

struct raw_described_field {
    struct yaml_mark mark, bits_mark, at_mark, scale_mark, source_mark, target_mark, value_mark,
        range_mark, values_mark, counter_mark, checksum_mark;
    const char *name;
    int64_t bits, at_bit, value, axis;
    bool at_given, value_given, source_given, target_given, range_given, scale_given, offset_given;
    bool counter;
    int type, order, checksum; /* enum described_type; 1 = big-endian; enum described_checksum */
    double scale, offset, range[2], host;
    int source, target; /* enum described_meaning */
    struct yaml_real_entry *entry;
    size_t nentry;
};

struct raw_described_frame {
    struct yaml_mark mark, id_mark, length_mark, payload_mark, reply_mark, enter_mark, of_mark,
        period_mark, repeat_mark, step_mark, brs_mark, id_fields_mark, lengths_mark;
    const char *name, *payload, *reply, *enter;
    int from, by, of;
    int64_t id, step, length, repeat;
    bool remote, telemetry, on_change, on_restart, zero, extended, fd, brs, stop, clear, restart,
        or_empty;
    bool lengths_given, step_given, length_given, payload_given, of_given, period_given, brs_given;
    double period_s, spread_s, lengths[2];
    struct raw_described_field *field, *id_field;
    size_t nfield, nid_field;
};

struct raw_described_state {
    struct yaml_mark mark, value_mark;
    const char *name;
    int64_t value, result;
    int law;
    double set_point_scale;
};

struct raw_described_fault {
    struct yaml_mark mark;
    const char *name;
    int64_t bit;
};

struct raw_described_parameter {
    struct yaml_mark mark, number_mark;
    int64_t number;
    struct raw_described_field field;
};

struct raw_described_gains {
    struct yaml_mark mark;
    double position_per_s, velocity_nm_s_rad, velocity_nm_rad;
};

struct raw_described_host {
    struct yaml_mark mark, on_state_mark, off_state_mark;
    struct yaml_name *discover, *configure, *on, *off, *command;
    size_t ndiscover, nconfigure, non, noff, ncommand;
    const char *on_state, *off_state;
};

struct raw_described {
    struct yaml_mark mark, timeout_state_mark;
    const char *name, *description, *timeout_state;
    int64_t axes, address_max;
    double command_timeout_s;
    bool command_timeout_given;
    struct raw_described_frame *frame;
    size_t nframe;
    struct raw_described_state *state, *law;
    size_t nstate, nlaw;
    struct raw_described_fault *fault;
    size_t nfault;
    struct raw_described_parameter *parameter;
    size_t nparameter;
    struct raw_described_gains gains;
    struct raw_described_host host;
};

enum { RAW_DESCRIBED_UNSIGNED, RAW_DESCRIBED_SIGNED, RAW_DESCRIBED_FLOAT };

/* Schema of a whole file: fills a struct raw_described. */
extern const struct yaml_schema described_file_schema;

#endif
