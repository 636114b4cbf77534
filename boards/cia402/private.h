/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Data and functions of the boards of a CANopen bus. Fields that are objects of the dictionary are
 * int64_t, whatever type the object has, in the units of the object. RT-safe except for functions
 * that create.
 */
#ifndef BOARDS_CIA402_PRIVATE_H
#define BOARDS_CIA402_PRIVATE_H

#include "boards/board_private.h"
#include "boards/cia402/table.h"

#include <stdio.h>

enum {
    CIA402_PDOS = CIA402_AXIS_PDOS * CIA402_BOARD_AXES, /* of each direction */
    CIA402_HISTORY = 8,                                 /* errors in 0x1003 */
    CIA402_EMERGENCIES = 16,                            /* that wait to be sent */
    CIA402_SENSOR_CHANNELS = 13,
};

/* Parameters of a PDO: 0x1400 and 0x1600, or 0x1800 and 0x1a00. */
struct cia402_pdo {
    int64_t cob_id, type, inhibit_100us, event_ms;
    int64_t count, object[CIA402_MAPPED_MAX];
};

/* A PDO at work. */
struct cia402_channel {
    struct cia402_entry entry[CIA402_MAPPED_MAX]; /* as mapped; value of a dummy is unused */
    uint8_t bytes[CIA402_MAPPED_MAX];
    uint8_t length;
    uint8_t data[8]; /* TPDO: sent last; RPDO: waits for SYNC */
    bool waits;      /* RPDO: data is fresh; TPDO: never sent since it was set up */
    bool requested;  /* TPDO: by a remote frame */
    bool unfit;      /* RPDO: the last one had another length */
    int64_t syncs;   /* since the last one sent */
    int64_t time_ns; /* of the last one sent or received */
};

/* Parameters of communication, which "save" keeps. */
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
        CIA402_BLOCK_DOWNLOADS, /* this and what follows: blocks */
        CIA402_BLOCK_DOWNLOAD_ENDS,
        CIA402_BLOCK_UPLOAD_STARTS,
        CIA402_BLOCK_UPLOADS,
        CIA402_BLOCK_UPLOAD_WAITS, /* for the block to be acknowledged */
        CIA402_BLOCK_UPLOAD_ENDS,
    } kind;
    struct cia402_entry entry;
    uint8_t data[CIA402_DOMAIN_MAX + 6]; /* the last segment of a block has seven bytes */
    uint32_t size, done; /* size of a download: as announced, or CIA402_SIZE_UNKNOWN */
    bool toggle;
    uint16_t index; /* as asked for, for abort messages */
    uint8_t sub;
    uint8_t block;    /* segments of a block at most */
    uint8_t sequence; /* segments of this block that were sent, or taken */
    bool checked;     /* with a checksum */
    int64_t heard_ns; /* the client, in a block transfer */
};

/* Layer setting services. */
struct cia402_lss_slave {
    bool configuring; /* state LSS configuration, else LSS waiting */
    uint8_t selected; /* parts of the address that have matched, one after the other */
    uint8_t scanned;  /* the part that a fastscan is at */
    uint8_t next;     /* Node-ID of the next reset of communication */
    uint8_t stored;   /* of the next power-up; both may be CIA402_NO_NODE_ID */
};

struct cia402_axis;
struct cia402_sensor;

struct cia402_node {
    struct board board;
    enum cia402_kind kind;
    unsigned axes;
    struct cia402_axis *axis;     /* axes of them; NULL: a sensor */
    struct cia402_sensor *sensor; /* NULL: a drive */
    struct cia402_communication settings, saved;
    char note[CIA402_TEXT_MAX + 1], saved_note[CIA402_TEXT_MAX + 1];
    struct cia402_domain data, saved_data;
    char device[CIA402_TEXT_MAX + 1], hardware[CIA402_TEXT_MAX + 1], software[CIA402_TEXT_MAX + 1];
    bool powered, restore; /* at the next reset the factory's settings */

    /* Objects that are no settings */
    int64_t device_type, error_register, identity[4], history_count, history[CIA402_HISTORY];
    int64_t sdo_request, sdo_reply, storage;

    enum cia402_nmt_state state;
    bool boot_up_due, reset_due;
    int64_t heartbeat_ns; /* when the next is due */
    bool guard_toggle, guarded, guard_lost;
    int64_t guard_ns;             /* of the last remote frame */
    bool consumes, consumer_lost; /* a heartbeat has been heard */
    int64_t consumer_ns;          /* of the last */
    struct cia402_emergency emergency[CIA402_EMERGENCIES];
    unsigned emergency_first, emergencies;
    int64_t emergency_ns; /* of the last */
    int64_t syncs;        /* heard since the last transmission */
    struct cia402_channel rx[CIA402_PDOS], tx[CIA402_PDOS];
    struct cia402_transfer transfer;
    struct cia402_lss_slave lss;
    bool nameless; /* has no Node-ID: only its LSS works; the board's address is the last one */
};

/* Returns the node of a board. */
static inline struct cia402_node *cia402_node_of(const struct board *board)
{
    return container_of(board, struct cia402_node, board);
}

/* Returns the number of PDOs of each direction of a node. */
static inline unsigned cia402_pdos(const struct cia402_node *node)
{
    return node->axes ? CIA402_AXIS_PDOS * node->axes : CIA402_AXIS_PDOS;
}

/* Returns a value in counts of worth, rounded and held within 32 bits. */
static inline int64_t cia402_counts(double value, double worth)
{
    int32_t count = 0;

    control_quantize(value / worth, &count);
    return count;
}

/* ---- objects ---- */

/* Finds an object by index and sub-index. */
enum cia402_abort cia402_find(const struct cia402_node *node, unsigned index, unsigned sub,
                              struct cia402_entry *entry);

/* Returns the place of an object's value; not of texts, domains and counts. */
int64_t *cia402_field(const struct cia402_node *node, const struct cia402_entry *entry);
char *cia402_text(const struct cia402_node *node, const struct cia402_entry *entry);
struct cia402_domain *cia402_domain(const struct cia402_node *node,
                                    const struct cia402_entry *entry);

int64_t cia402_value(const struct cia402_node *node, const struct cia402_entry *entry);
cia402_write_fn cia402_write;

/* Returns whether an identifier is one of CiA 301's table "restricted CAN-IDs", not for PDOs,
 * SYNC and EMCY. */
bool cia402_cob_is_restricted(unsigned id);

/* Convert little-endian bytes of a type to its value and back. */
int64_t cia402_get(enum cia402_type type, const uint8_t *data);
void cia402_put(enum cia402_type type, int64_t value, uint8_t *data);

/* Sets every field of the table to its initial value; then the PDOs and what the configuration
 * says. */
void cia402_set_factory(struct cia402_node *node);

/* ---- services ---- */

/* Obeys a request of 8 bytes (sdo.c); returns why it was refused. */
enum cia402_abort cia402_sdo_receive(struct cia402_node *node, const uint8_t *data);

/* Block transfers: requests. While takes_all is true every request that is no
 * abort belongs to the download. Work of a tick: segments of an upload, and the time-out. */
void cia402_block_step(struct cia402_node *node, struct ms_span span);

/* Process data: writes to a mapping, then what is called when frames come or are due. */
void cia402_pdo_set_factory(struct cia402_node *node);

/* nmt.c */
void cia402_nmt_command(struct cia402_node *node, unsigned command);

/* Emergencies */
void cia402_emcy_raise(struct cia402_node *node, unsigned code, unsigned error_register,
                       unsigned axis, uint32_t faults);
void cia402_emcy_clear(struct cia402_node *node); /* error reset, when nothing is left */

/* node.c */
bool cia402_node_power_up(struct cia402_node *node);                  /* true: the first time */
void cia402_node_step(struct cia402_node *node, struct ms_span span); /* once a tick */
void cia402_node_transmit(struct board *board, struct ms_span span, struct frame_sink *sink);

/* ---- drives ---- */

/* Settings of an axis, which "save" keeps. */
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
    int64_t current_gain[3];  /* mV/A, mV/(A s), mV s/rad */
    int64_t velocity_gain[3]; /* mV s/rad, mV/rad, mV/rad in the modes by position */
    int64_t position_gain;    /* 1/s, in 0.1 */
    int64_t mode;
};

/* Part of a homing procedure that is under way. */
enum cia402_homing_part {
    CIA402_HOMING_RESTS,
    CIA402_HOMING_SEARCH,
    CIA402_HOMING_LEAVE,
    CIA402_HOMING_EDGE,
    CIA402_HOMING_INDEX,
    CIA402_HOMING_STOPS,
};

/* Reference of a profile, in the units of the objects. */
struct cia402_profile {
    double position, velocity;
};

struct cia402_axis {
    struct axis base; /* mode: its state */
    struct cia402_axis_settings settings, saved;

    /* Objects that are no settings */
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
    enum cia402_mode mode; /* that works */
    uint32_t latched;      /* faults since the last reset */
    uint32_t present;      /* faults and warnings now */

    /* What moves it */
    struct cia402_profile profile;
    double goal, next_goal; /* profile position */
    bool moving, has_next, set_point_taken;
    bool homed, homing_failed, homing_found;
    enum cia402_homing_part homing;
    int homing_direction;
    double homing_pulses, index_rad;
    bool stopping;        /* a ramp to standstill is in force, whatever the mode */
    bool stop_by_current; /* no ramp: as fast as the current limit lets */
    double stop_deceleration;
    enum cia402_state stop_state;  /* where it leads */
    int64_t interpolation_left_ms; /* of the cyclic set-point in hand */
    int64_t command_ns;            /* of the last command of voltage, torque, position, velocity */
    double torque_reference;       /* thousandths, on its slope */
    int64_t following_ms, reached_ms, standstill_ms, stop_ms; /* for how long */
    bool limited;                                             /* a set-point was cut by a limit */

    /* Loops and sensors */
    double integral_v, velocity_integral_v;
    double rpm_rad; /* a link-side rad/s in rotor revolutions a minute */
    int64_t home;   /* of the motor encoder where the position is 0 */
};

struct cia402_motor {
    struct cia402_node node;
    struct cia402_axis axis[CIA402_BOARD_AXES];
};

/* Returns the drive of a board. */
static inline struct cia402_motor *cia402_motor_of(const struct board *board)
{
    return container_of(board, struct cia402_motor, node.board);
}

/* Returns the number of an axis in its node. */
static inline unsigned cia402_axis_number(const struct cia402_node *node,
                                          const struct cia402_axis *axis)
{
    return (unsigned)(axis - node->axis);
}

/* Returns whether the bridge is closed. */
static inline bool cia402_axis_is_on(const struct cia402_axis *axis)
{
    return axis->state == CIA402_OPERATION_ENABLED || axis->state == CIA402_QUICK_STOP_ACTIVE ||
           axis->state == CIA402_FAULT_REACTION_ACTIVE;
}

/* Sets the settings that the configuration of a board gives. */
void cia402_axis_set_factory(struct cia402_axis *axis, const struct board_axis_config *config,
                             const struct board_config *board);

/* The state machine. Faults with which the bridge must open at once are not drivable. */
void cia402_axis_lose_connection(struct cia402_node *node, struct cia402_axis *axis);

/* Modes and loops (modes.c): a millisecond of an enabled axis -> its voltage. */
void cia402_axis_step(struct cia402_axis *axis);
void cia402_axis_count_times(struct cia402_axis *axis);
void cia402_axis_stand(struct cia402_axis *axis); /* references to where it is, loops empty */
/* Braking ramps: of a slow-down, of a quick stop, and none, at the current limit. */
enum cia402_ramp { CIA402_RAMP_SLOW, CIA402_RAMP_QUICK, CIA402_RAMP_CURRENT };
void cia402_axis_stop(struct cia402_axis *axis, enum cia402_ramp ramp, enum cia402_state then);
void cia402_axis_take_set_point(struct cia402_axis *axis, int64_t before);
bool cia402_axis_has_stopped(const struct cia402_axis *axis);
bool cia402_axis_controls_position(const struct cia402_axis *axis);
unsigned cia402_axis_mode_status(const struct cia402_axis *axis);

/* Homing: lists the methods that switches allow, reads the switches; begins and ends
 * a procedure, and runs a millisecond of it. */
void cia402_homing_list(struct cia402_axis *axis, const struct board_switches *switches);
void cia402_homing_sample(struct cia402_axis *axis, const struct board_switches *switches);

/* What writes the objects of the table that are not simply stored. */
cia402_write_fn cia402_write_cob, cia402_write_emcy_cob, cia402_emcy_write_history,
    cia402_node_write_store, cia402_node_write_restore, cia402_nmt_write_producer,
    cia402_nmt_write_consumer, cia402_pdo_write_cob, cia402_pdo_write_type,
    cia402_pdo_write_inhibit, cia402_pdo_write_count, cia402_pdo_write_object,
    cia402_axis_write_controlword, cia402_axis_write_mode, cia402_axis_write_target,
    cia402_axis_write_option, cia402_axis_write_homing, cia402_axis_write_when_off,
    cia402_axis_write_profile_type, cia402_axis_write_range, cia402_axis_write_limit,
    cia402_sensor_write_tare;

/* ---- sensors ---- */

struct cia402_sensor {
    int64_t value[CIA402_SENSOR_CHANNELS]; /* less the tare */
    int64_t tare[CIA402_SENSOR_CHANNELS], saved_tare[CIA402_SENSOR_CHANNELS];
    int64_t channels, saturated, faults;
    int64_t counts[CIA402_SENSOR_CHANNELS]; /* as measured */
    bool started;
};

struct board_bus *cia402_bus_create(struct arena *arena);
struct board *cia402_motor_create(struct arena *arena);
struct board *cia402_make_board(const struct board_config *config, struct arena *arena);

/* Prints the object dictionary as a section of the page. Not RT-safe. */
void cia402_print_objects(FILE *out);

#endif
