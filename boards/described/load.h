/* SPDX-License-Identifier: Apache-2.0 */
/* Contents of a protocol file, and the functions that load.c and load_fields.c share. schema.c
 * declares the keys. load.c resolves names and checks frames. load_fields.c lays out fields. Not
 * RT-safe. */
#ifndef BOARDS_DESCRIBED_LOAD_H
#define BOARDS_DESCRIBED_LOAD_H

#include "boards/described/protocol.h"

struct raw_described_field {
    struct yaml_mark mark;
    struct described_field field; /* holds meaning, constant, scale, offset, host and axis */
    const char *name, *times, *fault;
    double value;
    int bits, at_bit;
    bool counter;
    /* type and order: flags of enum field_type; checksum: enum described_checksum */
    int type, order, checksum;
    double range[2];
    struct yaml_real_entry *entry;
    size_t nentry;
};

struct raw_described_frame {
    struct yaml_mark mark;
    struct described_frame row; /* members that the file sets directly */
    const char *payload, *reply, *enter, *select, *only;
    int from_host, length, repeat;
    bool extended, fd, brs;
    int64_t spread_ns;
    double lengths[2];
    struct raw_described_field *field, *id_field;
    size_t nfield, nid_field;
};

struct raw_described_parameter {
    struct yaml_mark mark;
    int64_t number;
    bool writable;
    struct raw_described_field field;
};

struct raw_described_fault {
    int bit;
    bool sticky, momentary;
};

struct raw_described_model {
    struct yaml_mark mark;
    const char *name;
    struct yaml_real_entry *entry;
    size_t nentry;
};

struct raw_described_host {
    struct yaml_mark mark;
    struct yaml_name *discover, *configure, *on, *off, *command;
    size_t ndiscover, nconfigure, non, noff, ncommand;
    const char *on_state, *off_state;
};

struct raw_described {
    struct yaml_mark mark;
    const char *name, *description, *timeout_state, *unknown_state;
    int axes, address_max;
    bool follow_fd;
    struct raw_described_fault fault[DESCRIBED_FAULT_KINDS];
    int64_t command_timeout_ns;
    struct board_reply_time time;
    struct raw_described_frame *frame;
    struct described_state *state, *law;
    struct raw_described_parameter *parameter;
    struct raw_described_model *model;
    size_t nframe, nstate, nlaw, nparameter, nmodel;
    struct described_gains gains;
    struct raw_described_host host;
};

/* Schema of a whole file: fills a struct raw_described. */
extern const struct yaml_schema described_file_schema;

/* Schema of the key `faults`: a row for each fault, in the order of enum described_fault. */
extern const struct yaml_schema described_faults_schema;

struct described_loader {
    const struct raw_described *raw;
    struct described_protocol *made;
    struct arena *arena;
    struct error *error;
    bool fd; /* the bus has CAN FD */
};

enum error_code described_no_memory(struct described_loader *l);

/* Checks that a name is valid for other tools: letters, digits and _, beginning with a letter. */
enum error_code described_check_word(struct described_loader *l, const struct yaml_mark *mark,
                                     const char *word);

/* Lays out the fields of a frame in its data and its identifier. Sets the layouts, the lengths, the
 * repetitions and the identifier bits. */
enum error_code described_lay_out(struct described_loader *l, const struct raw_described_frame *raw,
                                  struct described_frame *made);

/* Lays out the field of a parameter. A board reports the parameter. Its host can write settings,
 * targets and what the file calls writable. */
enum error_code described_lay_out_parameter(struct described_loader *l,
                                            const struct raw_described_parameter *raw,
                                            struct described_parameter *made);

#endif
