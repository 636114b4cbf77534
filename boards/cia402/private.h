/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Data and functions of the boards on a CANopen bus. A field that is an object of the dictionary is
 * an int64_t in the object's unit, for every type of object. RT-safe except functions that create
 * or print.
 */
#ifndef BOARDS_CIA402_PRIVATE_H
#define BOARDS_CIA402_PRIVATE_H

#include "boards/board_private.h"
#include "boards/cia402/table.h"

enum {
    CIA402_PDOS = CIA402_AXIS_PDOS * CIA402_BOARD_AXES, /* PDOs per direction */
    CIA402_HISTORY = 8,                                 /* entries in the error history 0x1003 */
    CIA402_EMERGENCIES = 16,                            /* most waiting emergency messages */
    CIA402_SENSOR_CHANNELS = 13,
};

/* Parameters of a PDO: 0x1400 and 0x1600, or 0x1800 and 0x1a00. */
struct cia402_pdo {
    int64_t cob_id, type, inhibit_100us, event_ms;
    int64_t count, object[CIA402_MAPPED_MAX];
};

/* State of a PDO. */
struct cia402_channel {
    /* mapped objects; a dummy has no value */
    struct cia402_entry entry[CIA402_MAPPED_MAX];
    uint8_t bytes[CIA402_MAPPED_MAX];
    uint8_t length;
    uint8_t data[8]; /* TPDO: data sent last; RPDO: data of the last frame */
    bool waits;      /* RPDO: data waits for SYNC; TPDO: not sent since its setup */
    bool requested;  /* TPDO: a remote frame requests it */
    bool unfit;      /* RPDO: the length of the last frame was wrong */
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
        CIA402_BLOCK_DOWNLOADS, /* from this value on: block transfers */
        CIA402_BLOCK_DOWNLOAD_ENDS,
        CIA402_BLOCK_UPLOAD_STARTS,
        CIA402_BLOCK_UPLOADS,
        CIA402_BLOCK_UPLOAD_WAITS, /* waits for the acknowledgment of a block */
        CIA402_BLOCK_UPLOAD_ENDS,
    } kind;
    struct cia402_entry entry; /* the object */
    /* + 6, because the last segment of a block always has 7 bytes */
    uint8_t data[CIA402_DOMAIN_MAX + 6];
    /* size: data of an upload, or announced size of a download (may be CIA402_SIZE_UNKNOWN) */
    uint32_t size, done;
    bool toggle;
    uint16_t index; /* index and sub-index of the request, for abort messages */
    uint8_t sub;
    uint8_t block;    /* most segments per block */
    uint8_t sequence; /* segments of the present block, sent or received */
    bool checked;     /* the transfer ends with a checksum */
    int64_t heard_ns; /* time of the client's last frame, in a block transfer */
};

/* State of the layer setting services (LSS). */
struct cia402_lss_slave {
    bool configuring; /* true = LSS configuration, false = LSS waiting */
    uint8_t selected; /* number of address parts that have matched, in order */
    uint8_t scanned;  /* address part that the fastscan compares next */
    uint8_t next;     /* Node-ID after the next reset of communication */
    uint8_t stored; /* Node-ID after the next power-up; next and stored may be CIA402_NO_NODE_ID */
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
    /* powered: has been powered up before; restore: use factory settings at the next reset */
    bool powered, restore;

    /* Objects that are not settings */
    int64_t device_type, error_register, identity[4], history_count, history[CIA402_HISTORY];
    int64_t sdo_request, sdo_reply, storage;

    enum cia402_nmt_state state;
    bool boot_up_due;
    int64_t heartbeat_ns; /* time of the next heartbeat */
    bool guard_toggle, guarded, guard_lost;
    int64_t guard_ns; /* time of the last guarding frame */
    /* consumes: a first heartbeat of the monitored node was received */
    bool consumes, consumer_lost;
    int64_t consumer_ns; /* time of the last heartbeat */
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

/* Returns value / worth as a whole number of counts, rounded and saturated to 32 bits. */
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

/* cia402_place returns the address of an object's value; the object must not be a number of
 * sub-indices. cia402_field does the same for objects that are numbers. */
void *cia402_place(const struct cia402_node *node, const struct cia402_entry *entry);
int64_t *cia402_field(const struct cia402_node *node, const struct cia402_entry *entry);

int64_t cia402_value(const struct cia402_node *node, const struct cia402_entry *entry);

/* Returns the largest value that a node accepts for an object: the maximum of its row, or less if
 * the configuration limits it. */
int64_t cia402_most(const struct cia402_node *node, const struct cia402_entry *entry);
cia402_write_fn cia402_write;

/* Returns whether an identifier is in CiA 301's table "restricted CAN-IDs": not allowed for PDOs,
 * SYNC and EMCY. */
bool cia402_cob_is_restricted(unsigned id);

/* Convert the little-endian bytes of a type to a value, and a value to bytes. */
int64_t cia402_get(enum cia402_type type, const uint8_t *data);
void cia402_put(enum cia402_type type, int64_t value, uint8_t *data);

/* Sets every object of the table to its initial value. Then sets the PDOs, and the objects that the
 * configuration determines. */
void cia402_set_factory(struct cia402_node *node);

/* ---- services ---- */

/* Handles an SDO request of 8 bytes (sdo.c). Returns the abort code; CIA402_DONE = accepted. */
enum cia402_abort cia402_sdo_receive(struct cia402_node *node, const uint8_t *data);

/* Runs one tick of a block transfer (sdo.c): sends segments of an upload, and aborts the transfer
 * after its time-out. */
void cia402_block_step(struct cia402_node *node, struct ms_span span);

/* Sets the PDOs of a node to their factory settings (node.c). */
void cia402_pdo_set_factory(struct cia402_node *node);

/* Executes an NMT command (node.c), enum cia402_nmt_command. */
void cia402_nmt_command(struct cia402_node *node, unsigned command);

/* Adds an error to the register and the history, and queues an emergency message (node.c). */
void cia402_emcy_raise(struct cia402_node *node, unsigned code, unsigned error_register,
                       unsigned axis, uint32_t faults);
/* Updates the error register after a fault reset, and queues the emergency message "error reset"
 * (node.c). */
void cia402_emcy_clear(struct cia402_node *node);

/* Powers up a node (node.c). Returns true at its first power-up. */
bool cia402_node_power_up(struct cia402_node *node);

/* Run one tick of a node's services, and send its periodic frames (node.c). */
void cia402_node_step(struct cia402_node *node, struct ms_span span);
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
    /* [0]: proportional, mV/A: the bandwidth times L; [1]: integral, mV/(A s), without effect: the
     * controller cancels the winding; [2]: back-EMF, mV s/rad */
    int64_t current_gain[3];
    /* [0]: proportional, mV s/rad; [1]: integral, mV/rad; [2]: integral of the position modes,
     * mV/rad */
    int64_t velocity_gain[3];
    int64_t position_gain; /* unit 0.1/s */
    int64_t mode;
};

/* Part of the homing procedure; RESTS = no procedure runs. */
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
    struct axis base; /* base.mode: enum cia402_state */
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
    int64_t pressure[2], valve_opening; /* axis with a servo valve; else 0 */
    int64_t homing_methods[CIA402_HOMING_METHODS], digital_inputs;

    enum cia402_state state;
    enum cia402_mode mode; /* the active mode */
    uint32_t latched;      /* faults since the last reset */
    uint32_t present;      /* present faults and warnings */

    /* State of the motion */
    struct cia402_profile profile;
    double goal, next_goal; /* goals of profile position mode */
    bool moving, has_next, set_point_taken;
    bool homed, homing_failed, homing_found;
    enum cia402_homing_part homing;
    int homing_direction;
    double homing_pulses, index_rad;
    bool stopping;        /* the axis brakes to standstill, in any mode */
    bool stop_by_current; /* brake at the current limit, without a ramp */
    double stop_deceleration;
    enum cia402_state stop_state;  /* state after the standstill */
    int64_t interpolation_left_ms; /* time left of the present cyclic set point */
    /* a target position was written; without one, cyclic position mode holds the position */
    bool has_target;
    /* time of the last command of voltage, torque, position or velocity */
    int64_t command_ns;
    double torque_reference; /* torque reference after the slope, thousandths */
    /* how long these conditions have lasted */
    int64_t following_ms, reached_ms, standstill_ms, stop_ms;
    bool limited; /* a limit has reduced a set point */

    /* Loops and sensors */
    double velocity_integral_v;
    double rpm_rad; /* rotor rpm per link-side rad/s */
    int64_t home;   /* motor encoder reading at position 0 */
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

/* Return whether the bridge is closed: in a given state, and in the present state of an axis. */
static inline bool cia402_state_is_on(enum cia402_state state)
{
    return state == CIA402_OPERATION_ENABLED || state == CIA402_QUICK_STOP_ACTIVE ||
           state == CIA402_FAULT_REACTION_ACTIVE;
}

static inline bool cia402_axis_is_on(const struct cia402_axis *axis)
{
    return cia402_state_is_on(axis->state);
}

/* Returns a gain of the drive's own current controller: its bandwidth times `winding`. L gives the
 * proportional gain, V/A; R gives the integral gain, V/(A s). */
double cia402_own_gain(const struct board_axis_config *config, double winding);

/* Sets the settings of an axis from the configuration of its board. */
void cia402_axis_set_factory(struct cia402_axis *axis, const struct board_axis_config *config,
                             const struct board_config *board);

/* Reacts to the loss of the connection to the host, by option code 0x6007 (axis.c). */
void cia402_axis_lose_connection(struct cia402_node *node, struct cia402_axis *axis);

/* Modes and loops (modes.c). cia402_axis_step runs one millisecond of an axis and sets its voltage.
 * cia402_axis_count_times updates the times for the statusword, once a millisecond. */
void cia402_axis_step(struct cia402_axis *axis);
void cia402_axis_count_times(struct cia402_axis *axis);
/* sets the references to the present position and resets the loops */
void cia402_axis_stand(struct cia402_axis *axis);
/* Ways to brake: slow-down ramp, quick-stop ramp, or current limit without a ramp. */
enum cia402_ramp { CIA402_RAMP_SLOW, CIA402_RAMP_QUICK, CIA402_RAMP_CURRENT };
void cia402_axis_stop(struct cia402_axis *axis, enum cia402_ramp ramp, enum cia402_state then);
void cia402_axis_take_set_point(struct cia402_axis *axis, int64_t before);
bool cia402_axis_has_stopped(const struct cia402_axis *axis);
bool cia402_axis_controls_position(const struct cia402_axis *axis);
unsigned cia402_axis_mode_status(const struct cia402_axis *axis);

/* Homing (modes.c). cia402_homing_list lists the methods that the switches of a joint allow.
 * cia402_homing_sample reads the switches. */
void cia402_homing_list(struct cia402_axis *axis, const struct board_switches *switches);
void cia402_homing_sample(struct cia402_axis *axis, const struct board_switches *switches);

/* Functions of dictionary rows: check and write an object, with its side effects. */
cia402_write_fn cia402_write_cob, cia402_write_emcy_cob, cia402_emcy_write_history,
    cia402_node_write_store, cia402_node_write_restore, cia402_nmt_write_producer,
    cia402_nmt_write_consumer, cia402_pdo_write_cob, cia402_pdo_write_type,
    cia402_pdo_write_inhibit, cia402_pdo_write_count, cia402_pdo_write_object,
    cia402_axis_write_controlword, cia402_axis_write_mode, cia402_axis_write_target,
    cia402_axis_write_option, cia402_axis_write_homing, cia402_axis_write_when_off,
    cia402_sensor_write_tare;

/* ---- sensors ---- */

struct cia402_sensor {
    int64_t value[CIA402_SENSOR_CHANNELS]; /* counts + tare */
    int64_t tare[CIA402_SENSOR_CHANNELS], saved_tare[CIA402_SENSOR_CHANNELS];
    int64_t channels, saturated, faults;
    int64_t counts[CIA402_SENSOR_CHANNELS]; /* measured values */
    bool started;
};

/* A sensor board. */
struct cia402_sensor_board {
    struct cia402_node node;
    struct cia402_sensor sensor;
};

extern const struct board_bus_ops cia402_bus_ops;
extern const struct board_ops cia402_motor_ops, cia402_ft_ops, cia402_inertial_ops;

/* Prints the object dictionary as a section of the page. Not RT-safe. */
void cia402_print_objects(FILE *out);

#endif
