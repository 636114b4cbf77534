/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The faults of a run: each has a target, a kind and a time. A fault is written as one line,
 *
 *     [NAME:] TARGET KIND [PARAMETER...] [WHEN]
 *
 *     motor LKneeSag jam 2.0..2.5
 *     sensor LKneeSag.motor_encoder stuck 3.0..
 *     sensor l_leg_ft.fz wrong gain=1.1 offset=-20
 *     board left_leg/1 off 1..1.2
 *     board left_leg/2 hung watchdog=0.5 2.0..
 *     lossy: bus left_leg loss 0.1 manual
 *     supply sag 30 1..1.05
 *     valve lf_kfe stuck 2..
 *     hydraulic_supply pump_loss 1..
 *
 * TARGET is one of:
 *
 *   motor JOINT
 *   sensor JOINT.CHANNEL   link_encoder, motor_encoder, current, torque, temperature
 *   sensor FT[.CHANNEL]    fx fy fz tx ty tz
 *   sensor imu[.CHANNEL]   gyro_x gyro_y gyro_z accel_x accel_y accel_z mag_x mag_y mag_z
 *                          quat_w quat_x quat_y quat_z
 *   board NAME, board BUS/ADDRESS
 *   bus NAME
 *   supply
 *   valve JOINT            of a hydraulic joint
 *   hydraulic_supply
 *
 * The table in kinds.c has the kinds of each target with their parameters; faults_help lists them.
 * A parameter is KEY=VALUE; the first one may be VALUE alone. WHEN is FROM..TO in seconds of
 * virtual time; TO is exclusive and optional. With "manual" the fault starts inactive and
 * faults_set switches it. Without WHEN the fault is active from the start.
 *
 * This module stores the faults and switches them. Other modules read the member `active` of struct
 * fault and apply the effect: boards/sensing/sensing.h (sensors), boards/board_faults.c (boards),
 * canbus/fault_port.h (buses), model/plant_step.c (motors, valves, supplies). A fault is visible on
 * the buses by its effect, and in the log by its event. As on a real robot, no board reports the
 * fault in a frame.
 *
 * Units: SI; times are int64_t ns of virtual time. The arena owns the memory. Functions that
 * only read the table are RT-safe.
 */
#ifndef FAULTS_FAULTS_H
#define FAULTS_FAULTS_H

#include "base/arena.h"
#include "base/error.h"

#include <stdint.h>

enum fault_target {
    FAULT_SENSOR,
    FAULT_BOARD,
    FAULT_MOTOR,
    FAULT_BUS,
    FAULT_SUPPLY,
    FAULT_VALVE,           /* of a hydraulic joint, with its cylinder */
    FAULT_HYDRAULIC_SUPPLY /* pump, accumulator, relief valve */
};

enum fault_kind {
    /* sensor: reads 0; board: without power, boots afterwards; valve: without current, centered */
    FAULT_OFF,
    FAULT_STUCK,   /* repeats its last value; valve: keeps its position */
    FAULT_GARBAGE, /* sensor: random values; board: frames with random data */
    FAULT_WRONG,   /* wrong gain and offset */
    FAULT_SLOW,    /* sensor: a new value once per period; board: sends every n-th frame */
    FAULT_DELAYED, /* all values or frames are late */
    /* loose contact: off for a share of the time; board: disconnected from its bus */
    FAULT_INTERMITTENT,
    FAULT_HUNG,       /* boards: the firmware stops until its watchdog resets it */
    FAULT_OPEN_PHASE, /* motors: enum drive_condition */
    FAULT_SHORT,
    FAULT_JAM,
    FAULT_SPRING_BREAK,
    FAULT_LOSS,         /* buses: a frame is lost, with a probability */
    FAULT_CORRUPTION,   /* buses: one data bit is flipped, undetected by the CRC */
    FAULT_LATE,         /* buses: frames arrive after a delay */
    FAULT_DUPLICATE,    /* buses: a frame arrives twice */
    FAULT_BUS_OFF,      /* buses: the simulator's controller is bus-off */
    FAULT_ERROR_BURST,  /* wire mode only: bit errors while the fault is active */
    FAULT_ID_COLLISION, /* wire mode only: a foreign node uses the same identifier */
    FAULT_SAG,          /* supply: the voltage drops by a value in V */
    FAULT_SHIFTED,      /* valve: its center is shifted */
    /* valve: oil leaks past the piston; hydraulic supply: oil leaks to the return */
    FAULT_LEAK,
    FAULT_PUMP_LOSS,   /* hydraulic supply: the pump delivers less */
    FAULT_RELIEF_SHUT, /* hydraulic supply: the relief valve does not open */
    FAULT_SURGE,       /* supply: the voltage rises by a value in V */
    /* motors: a sensor of the drive reads far too much; becomes FAULT_WRONG of the sensor */
    FAULT_OVER_TEMPERATURE,
    FAULT_OVER_CURRENT,
};

enum { FAULT_NAME_SIZE = 64, FAULT_TEXT_SIZE = 160, FAULT_PARAMETERS = 2, FAULTS_MAX = 256 };

/* Channels of a joint, and numbers of channels per sensor. The channels of all sensors have one
 * numbering: five for each joint, then six for each force-torque sensor, then 13 for the inertial
 * sensor (gyro, accelerometer, magnetometer, orientation). */
enum sensor_channel {
    SENSOR_LINK_ENCODER,
    SENSOR_MOTOR_ENCODER,
    SENSOR_CURRENT,
    SENSOR_TORQUE,
    SENSOR_TEMPERATURE,
    SENSOR_JOINT_CHANNELS,
    SENSOR_FT_CHANNELS = 6,
    SENSOR_IMU_CHANNELS = 13,
};

struct fault {
    char name[FAULT_NAME_SIZE]; /* the given name, or its number from 1 */
    char text[FAULT_TEXT_SIZE]; /* the fault's line */
    enum fault_target target;
    enum fault_kind kind;
    size_t index;    /* joint, board or bus; FAULT_SENSOR: first channel */
    size_t channels; /* FAULT_SENSOR: number of channels */
    /* parameters in the order of the table, with defaults, in SI units */
    double value[FAULT_PARAMETERS];
    int64_t id;             /* FAULT_BUS: identifier of the affected frames; -1 = all */
    int64_t from_ns, to_ns; /* [from, to); INT64_MAX = no end; manual: both INT64_MAX */
    bool timed;             /* the line has a WHEN */
    bool active;            /* only faults_step and faults_set write it */
};

/* Names that a fault's line may use. The caller owns all arrays and strings. */
struct fault_names {
    size_t njoint;
    const char *const *joint;
    const bool *driven;    /* per joint: has a drive */
    const bool *hydraulic; /* per joint: the drive is a cylinder with a valve */
    bool oil_store;        /* the hydraulic supply has an accumulator, so its pressure can change */
    size_t nft;
    const char *const *ft;
    bool imu;
    size_t nbus;
    const char *const *bus;
    const bool *wire; /* per bus: is in wire mode */
    size_t nboard;
    const char *const *board; /* names as in struct board_config */
    const size_t *board_bus;  /* bus of each board */
    const int *board_address;
};

/* Parses one line. The error gives the word found, the words expected, and the nearest name. Not
 * RT-safe. */
enum error_code fault_parse(const char *text, const struct fault_names *names, struct fault *fault,
                            struct error *error);

/* Writes line number `line` of the list of all targets, kinds and parameters. Returns the number of
 * lines of the list. text may be NULL. Not RT-safe. */
size_t faults_help(size_t line, char *text, size_t size);

/* Receives the beginning of a fault's line, "TARGET KIND", and the meaning of the kind. The user
 * adds required parameters and a time window. Both strings are valid during the call. */
typedef void (*fault_list_put)(void *context, const char *line, const char *means);

/* Calls put for every fault that is possible with these names. Not RT-safe. */
void faults_list(const struct fault_names *names, fault_list_put put, void *context);

/* An event: a fault began or ended. */
struct fault_event {
    int64_t time_ns;
    size_t fault;
    bool active;
    bool by_hand; /* faults_set switched it, not its time window */
};

struct faults;
struct ring;

/* Creates the table: copies `count` faults (0 is allowed). A fault without a name gets its number
 * as its name. Refuses duplicate names. Memory from arena. Not RT-safe. */
enum error_code faults_create(const struct fault *fault, size_t count, uint64_t seed,
                              struct arena *arena, struct faults **faults, struct error *error);

size_t faults_count(const struct faults *faults);
const struct fault *faults_at(const struct faults *faults, size_t index);

/* Returns the seed of faults and noise. RT-safe. */
uint64_t faults_seed(const struct faults *faults);

/* Returns the index of the fault with this name, or -1. RT-safe. */
int faults_find(const struct faults *faults, const char *name);

/* Starts and ends faults by their time windows. Call it at the beginning of each tick; now_ns is
 * the time of the tick. RT-safe. */
void faults_step(struct faults *faults, int64_t now_ns);

/* Switches a fault on or off at now_ns. Its time window then has no effect. Call it in the thread
 * that calls faults_step. Returns false if the index is invalid. RT-safe. */
bool faults_set(struct faults *faults, int64_t now_ns, size_t index, bool active);

/* Returns the ring of events. A checkpoint must not restore it, because the thread that reads
 * events also writes to it. RT-safe. */
const struct ring *faults_event_ring(const struct faults *faults);

/* faults_next_event takes the oldest event and returns false if there is none. fault_event_format
 * writes it as a log line and is not RT-safe. Call both from one thread only; it may differ from
 * the thread of faults_step. */
bool faults_next_event(struct faults *faults, struct fault_event *event);
void fault_event_format(const struct faults *faults, const struct fault_event *event, char *text,
                        size_t size);

#endif
