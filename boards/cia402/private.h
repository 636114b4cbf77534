/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Data and functions of the boards on a CANopen bus. Fields that are objects of the dictionary are
 * int64_t in the unit of the object, whatever its type. RT-safe except functions that create.
 */
#ifndef BOARDS_CIA402_PRIVATE_H
#define BOARDS_CIA402_PRIVATE_H

#include "boards/board_private.h"
#include "boards/cia402/table.h"

#include <stdio.h>

enum {
    CIA402_PDOS = CIA402_AXIS_PDOS * CIA402_BOARD_AXES, /* PDOs per direction */
    CIA402_HISTORY = 8,                                 /* entries of the error history 0x1003 */
    CIA402_EMERGENCIES = 16,                            /* most emergency messages that wait */
    CIA402_SENSOR_CHANNELS = 13,
};

/* Parameters of a PDO: 0x1400 and 0x1600, or 0x1800 and 0x1a00. */
struct cia402_pdo {
    int64_t cob_id, type, inhibit_100us, event_ms;
    int64_t count, object[CIA402_MAPPED_MAX];
};

/* State of a PDO. */
struct cia402_channel {
    /* mapped objects; the value of a dummy is unused */
    struct cia402_entry entry[CIA402_MAPPED_MAX];
    uint8_t bytes[CIA402_MAPPED_MAX];
    uint8_t length;
    uint8_t data[8]; /* TPDO: data sent last; RPDO: data that waits for SYNC */
    bool waits;      /* RPDO: data is new; TPDO: not sent since it was set up */
    bool requested;  /* TPDO: a remote frame requests it */
    bool unfit;      /* RPDO: the last frame had a wrong length */
    int64_t syncs;   /* number of SYNCs since the last frame */
    int64_t time_ns; /* time of the last frame, sent or received */
};

/* Communication parameters that "save" stores. */
struct cia402_communication {
    int64_t cob_sync, guard_ms, life_factor, cob_emcy, emcy_inhibit_100us;
    int64_t consumer, producer_ms, error_behavior;
    struct cia402_pdo rpdo[CIA402_PDOS], tpdo[CIA402_PDOS];
};

struct cia402_emergency {
    uint16_t code;
    uint8_t error_register, axis;
    uint32_t faults;
};

struct cia402_domain {
    uint32_t size;
    uint8_t data[CIA402_DOMAIN_MAX];
};

/* Bits of the error register */
enum { CIA402_REGISTER_GENERIC = 0x01, CIA402_REGISTER_COMMUNICATION = 0x10 };

#define CIA402_SIZE_UNKNOWN UINT32_MAX

/* A transfer of the SDO server in segments or blocks. */
struct cia402_transfer {
    enum {
        CIA402_NO_TRANSFER,
        CIA402_UPLOADS,
        CIA402_DOWNLOADS,
        CIA402_BLOCK_DOWNLOADS, /* from here on: block transfers */
        CIA402_BLOCK_DOWNLOAD_ENDS,
        CIA402_BLOCK_UPLOAD_STARTS,
        CIA402_BLOCK_UPLOADS,
        CIA402_BLOCK_UPLOAD_WAITS, /* waits for the acknowledgment of a block */
        CIA402_BLOCK_UPLOAD_ENDS,
    } kind;
    struct cia402_entry entry;
    /* + 6, because the last segment of a block has seven bytes */
    uint8_t data[CIA402_DOMAIN_MAX + 6];
    uint32_t size, done; /* announced size of a download, or CIA402_SIZE_UNKNOWN */
    bool toggle;
    uint16_t index; /* as requested, for abort messages */
    uint8_t sub;
    uint8_t block;    /* most segments per block */
    uint8_t sequence; /* segments of this block sent or received */
    bool checked;     /* uses a checksum */
    int64_t heard_ns; /* last frame of the client in a block transfer */
};

/* State of the layer setting services (LSS). */
struct cia402_lss_slave {
    bool configuring; /* true = LSS configuration, false = LSS waiting */
    uint8_t selected; /* number of address parts that have matched, in order */
    uint8_t scanned;  /* address part of the present fastscan */
    uint8_t next;     /* Node-ID after the next reset of communication */
    uint8_t stored;   /* Node-ID after the next power-up; both may be CIA402_NO_NODE_ID */
};

struct cia402_axis;
struct cia402_sensor;

struct cia402_node {
    struct board board;
    enum cia402_kind kind;
    unsigned axes;
    struct cia402_axis *axis;     /* array of axes; NULL = sensor node */
    struct cia402_sensor *sensor; /* NULL = drive */
    struct cia402_communication settings, saved;
    char note[CIA402_TEXT_MAX + 1], saved_note[CIA402_TEXT_MAX + 1];
    struct cia402_domain data, saved_data;
    char device[CIA402_TEXT_MAX + 1], hardware[CIA402_TEXT_MAX + 1], software[CIA402_TEXT_MAX + 1];
    bool powered, restore; /* restore: use factory settings at the next reset */

    /* Objects that are not settings */
    int64_t device_type, error_register, identity[4], history_count, history[CIA402_HISTORY];
    int64_t sdo_request, sdo_reply, storage;

    enum cia402_nmt_state state;
    bool boot_up_due, reset_due;
    int64_t heartbeat_ns; /* time of the next heartbeat */
    bool guard_toggle, guarded, guard_lost;
    int64_t guard_ns;             /* time of the last guarding frame */
    bool consumes, consumer_lost; /* consumes: has received a heartbeat */
    int64_t consumer_ns;          /* time of the last heartbeat */
    struct cia402_emergency emergency[CIA402_EMERGENCIES];
    unsigned emergency_first, emergencies;
    int64_t emergency_ns; /* time of the last emergency message */
    int64_t syncs;        /* SYNCs received since the last transmission */
    struct cia402_channel rx[CIA402_PDOS], tx[CIA402_PDOS];
    struct cia402_transfer transfer;
    struct cia402_lss_slave lss;
    bool nameless; /* has no Node-ID: only LSS works; the board keeps its last address */
};

/* Returns the CANopen node of a board. */
static inline struct cia402_node *cia402_node_of(const struct board *board)
{
    return container_of(board, struct cia402_node, board);
}

/* Returns the number of PDOs of a node per direction. */
static inline unsigned cia402_pdos(const struct cia402_node *node)
{
    return node->axes ? CIA402_AXIS_PDOS * node->axes : CIA402_AXIS_PDOS;
}

/* Returns value / worth, rounded and saturated to 32 bits. */
static inline int64_t cia402_counts(double value, double worth)
{
    int32_t count = 0;

    control_quantize(value / worth, &count);
    return count;
}

/* ---- objects ---- */

/* Finds an object of a node by index and sub-index. */
enum cia402_abort cia402_find(const struct cia402_node *node, unsigned index, unsigned sub,
                              struct cia402_entry *entry);

/* Return the address of an object's value: of any object but a count; of a number. */
void *cia402_place(const struct cia402_node *node, const struct cia402_entry *entry);
int64_t *cia402_field(const struct cia402_node *node, const struct cia402_entry *entry);

int64_t cia402_value(const struct cia402_node *node, const struct cia402_entry *entry);

/* Returns the largest value of an object on a node: its row's, or less if the configuration limits
 * it. */
int64_t cia402_most(const struct cia402_node *node, const struct cia402_entry *entry);
cia402_write_fn cia402_write;

/* Returns whether an identifier is in CiA 301's table "restricted CAN-IDs": not allowed for PDOs,
 * SYNC and EMCY. */
bool cia402_cob_is_restricted(unsigned id);

/* Convert the little-endian bytes of a type to its value, and back. */
int64_t cia402_get(enum cia402_type type, const uint8_t *data);
void cia402_put(enum cia402_type type, int64_t value, uint8_t *data);

/* Sets every object of the table to its initial value, then the PDOs and the values of the
 * configuration. */
void cia402_set_factory(struct cia402_node *node);

/* ---- services ---- */

/* Obeys an SDO request of 8 bytes (sdo.c). Returns the reason of a refusal. */
enum cia402_abort cia402_sdo_receive(struct cia402_node *node, const uint8_t *data);

/* Block transfers (sdo.c): requests; the work of a tick, that is segments of an upload and the
 * time-out. While takes_all is true, every request except an abort is a segment of the download. */
void cia402_block_step(struct cia402_node *node, struct ms_span span);

/* Process data (node.c): writes to a mapping, then reactions to frames and times */
void cia402_pdo_set_factory(struct cia402_node *node);

/* NMT (node.c) */
void cia402_nmt_command(struct cia402_node *node, unsigned command);

/* Emergencies */
void cia402_emcy_raise(struct cia402_node *node, unsigned code, unsigned error_register,
                       unsigned axis, uint32_t faults);
void cia402_emcy_clear(struct cia402_node *node); /* sends "error reset" when no error is left */

/* Node (node.c) */
bool cia402_node_power_up(struct cia402_node *node);                  /* true = first power-up */
void cia402_node_step(struct cia402_node *node, struct ms_span span); /* call once a tick */
void cia402_node_transmit(struct board *board, struct ms_span span, struct frame_sink *sink);

/* ---- drives ---- */

/* Settings of an axis that "save" stores. */
struct cia402_axis_settings {
    int64_t abort_option, quick_stop_option, shutdown_option, disable_option, halt_option,
        fault_option;
    int64_t following_window, following_timeout_ms, position_window, position_window_ms;
    int64_t velocity_window, velocity_window_ms, velocity_threshold, velocity_threshold_ms;
    int64_t max_torque, max_current, position_limit[2], home_offset;
    int64_t position_range[2], max_motor_rpm, motion_profile_type, torque_profile_type;
    int64_t max_profile_velocity, profile_velocity, profile_acceleration, profile_deceleration,
        quick_stop_deceleration, torque_slope;
    int64_t homing_method, homing_speed[2], homing_acceleration;
    int64_t interpolation_ms, interpolation_exponent;
    int64_t timeout_ms, current_limit_ma, temperature_limit_c;
    int64_t current_gain[3]; /* mV/A, mV/(A s), mV s/rad */
    /* mV s/rad, mV/rad; [2]: integral gain of the position modes, mV/rad */
    int64_t velocity_gain[3];
    int64_t position_gain; /* in 0.1/s */
    int64_t mode;
};

/* Phase of a running homing procedure. */
enum cia402_homing_part {
    CIA402_HOMING_RESTS,
    CIA402_HOMING_SEARCH,
    CIA402_HOMING_LEAVE,
    CIA402_HOMING_EDGE,
    CIA402_HOMING_INDEX,
    CIA402_HOMING_STOPS,
};

/* State of a profile, in the units of the objects. */
struct cia402_profile {
    double position, velocity;
};

struct cia402_axis {
    struct axis base; /* base.mode: state of the axis */
    struct cia402_axis_settings settings, saved;

    /* Objects that are not settings */
    int64_t controlword, statusword, error_code, mode_display, supported_modes;
    int64_t target_position, target_velocity, target_torque, target_voltage;
    int64_t velocity_offset, torque_offset;
    int64_t position, velocity, torque, current; /* actual values */
    int64_t position_demand, velocity_demand, torque_demand, following_error;
    int64_t rated_current_ma, rated_torque_mnm, device_type;
    int64_t link_encoder, motor_encoder, deflection, spring_torque, voltage, current_ma,
        temperature_c, supply_mv, faults;
    int64_t pressure[2], valve_opening; /* of a hydraulic axis, else 0 */
    int64_t homing_methods[CIA402_HOMING_METHODS], digital_inputs;

    enum cia402_state state;
    enum cia402_mode mode; /* the active mode */
    uint32_t latched;      /* faults since the last reset */
    uint32_t present;      /* present faults and warnings */

    /* State of the motion */
    struct cia402_profile profile;
    double goal, next_goal; /* profile position */
    bool moving, has_next, set_point_taken;
    bool homed, homing_failed, homing_found;
    enum cia402_homing_part homing;
    int homing_direction;
    double homing_pulses, index_rad;
    bool stopping;        /* a ramp to standstill is active, in any mode */
    bool stop_by_current; /* stop at the current limit, without a ramp */
    double stop_deceleration;
    enum cia402_state stop_state;  /* state after the ramp */
    int64_t interpolation_left_ms; /* time left of the present cyclic set point */
    bool has_target;               /* a target position was written; else a cyclic axis holds */
    /* time of the last command of voltage, torque, position or velocity */
    int64_t command_ns;
    double torque_reference;                                  /* thousandths, after the slope */
    int64_t following_ms, reached_ms, standstill_ms, stop_ms; /* durations of these conditions */
    bool limited;                                             /* a limit has cut a set point */

    /* Loops and sensors */
    double integral_v, velocity_integral_v;
    double rpm_rad; /* rotor rpm per link-side rad/s */
    int64_t home;   /* reading of the motor encoder at position 0 */
};

struct cia402_motor {
    struct cia402_node node;
    struct cia402_axis axis[CIA402_BOARD_AXES];
};

/* Returns the index of an axis in its node. */
static inline unsigned cia402_axis_number(const struct cia402_node *node,
                                          const struct cia402_axis *axis)
{
    return (unsigned)(axis - node->axis);
}

/* Return whether the bridge is closed, in a state and in the present state. */
static inline bool cia402_state_is_on(enum cia402_state state)
{
    return state == CIA402_OPERATION_ENABLED || state == CIA402_QUICK_STOP_ACTIVE ||
           state == CIA402_FAULT_REACTION_ACTIVE;
}

static inline bool cia402_axis_is_on(const struct cia402_axis *axis)
{
    return cia402_state_is_on(axis->state);
}

/* Sets the settings from the configuration of a board. */
void cia402_axis_set_factory(struct cia402_axis *axis, const struct board_axis_config *config,
                             const struct board_config *board);

/* The state machine (axis.c). drivable: the present faults allow the bridge to stay closed. */
void cia402_axis_lose_connection(struct cia402_node *node, struct cia402_axis *axis);

/* Modes and loops (modes.c): runs a millisecond of an enabled axis and sets its voltage. */
void cia402_axis_step(struct cia402_axis *axis);
void cia402_axis_count_times(struct cia402_axis *axis);
/* sets references to the present position, resets the loops */
void cia402_axis_stand(struct cia402_axis *axis);
/* Braking ramps: slow-down, quick stop, or none (at the current limit). */
enum cia402_ramp { CIA402_RAMP_SLOW, CIA402_RAMP_QUICK, CIA402_RAMP_CURRENT };
void cia402_axis_stop(struct cia402_axis *axis, enum cia402_ramp ramp, enum cia402_state then);
void cia402_axis_take_set_point(struct cia402_axis *axis, int64_t before);
bool cia402_axis_has_stopped(const struct cia402_axis *axis);
bool cia402_axis_controls_position(const struct cia402_axis *axis);
unsigned cia402_axis_mode_status(const struct cia402_axis *axis);

/* Homing (modes.c): lists the methods that the switches allow, reads the switches, begins and ends
 * a procedure, and runs a millisecond of it. */
void cia402_homing_list(struct cia402_axis *axis, const struct board_switches *switches);
void cia402_homing_sample(struct cia402_axis *axis, const struct board_switches *switches);

/* Functions that write objects that are not simply stored. */
cia402_write_fn cia402_write_cob, cia402_write_emcy_cob, cia402_emcy_write_history,
    cia402_node_write_store, cia402_node_write_restore, cia402_nmt_write_producer,
    cia402_nmt_write_consumer, cia402_pdo_write_cob, cia402_pdo_write_type,
    cia402_pdo_write_inhibit, cia402_pdo_write_count, cia402_pdo_write_object,
    cia402_axis_write_controlword, cia402_axis_write_mode, cia402_axis_write_target,
    cia402_axis_write_option, cia402_axis_write_homing, cia402_axis_write_when_off,
    cia402_sensor_write_tare;

/* ---- sensors ---- */

struct cia402_sensor {
    int64_t value[CIA402_SENSOR_CHANNELS]; /* minus the tare */
    int64_t tare[CIA402_SENSOR_CHANNELS], saved_tare[CIA402_SENSOR_CHANNELS];
    int64_t channels, saturated, faults;
    int64_t counts[CIA402_SENSOR_CHANNELS]; /* measured */
    bool started;
};

struct board_bus *cia402_bus_create(struct arena *arena);
struct board *cia402_motor_create(struct arena *arena);
struct board *cia402_make_board(const struct board_config *config, struct arena *arena);

/* Prints the object dictionary as a section of the page. Not RT-safe. */
void cia402_print_objects(FILE *out);

#endif
