/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The faults of a run: what fails, how, and when. A fault is written as one line,
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
 *   valve JOINT, hydraulic_supply   of hydraulic joints
 *
 * The table in kinds.c has the kinds of each target with their parameters; faults_help lists them.
 * A parameter is KEY=VALUE; the first one may be VALUE alone. WHEN is FROM..TO in seconds of
 * virtual time; TO is exclusive and optional. With "manual" the fault starts inactive and
 * faults_set switches it. Without WHEN the fault is active from the start.
 *
 * This module holds the faults and whether each is active. Other modules read struct fault's active
 * and apply the effect: boards/sensing/sensing.h (sensors), boards/board_faults.c (boards),
 * canbus/fault_port.h (buses), model/plant_step.c (motors, valves, supplies). A fault is visible on
 * the buses by its effect, and in the log by its event. No board reports it in a frame, as on a
 * real robot.
 *
 * Units: SI; times are int64_t ns of virtual time. Memory is the arena's. Functions say whether
 * they are RT-safe; functions that only read the table are.
 */
#ifndef FAULTS_FAULTS_H
#define FAULTS_FAULTS_H

#include "base/arena.h"
#include "base/error.h"

#include <stdbool.h>
#include <stddef.h>
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
    FAULT_GARBAGE, /* random values; board: random data */
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
};

enum { FAULT_NAME_SIZE = 64, FAULT_TEXT_SIZE = 160, FAULT_PARAMETERS = 2, FAULTS_MAX = 256 };

/* Channels of all sensors, in one numbering: five of each joint, then six of each force-torque
 * sensor, then those of the inertial sensor: gyro, accelerometer, magnetometer, orientation. */
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

/* Names that a fault's line may use. Pointers are borrowed during the call. */
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
    const bool *wire; /* per bus: a wire in virtual time */
    size_t nboard;
    const char *const *board; /* names as in struct board_config */
    const size_t *board_bus;  /* bus of each board */
    const int *board_address;
};

/* Reads one line. The error says what was found, what was expected, and the nearest name. Not
 * RT-safe. */
enum error_code fault_parse(const char *text, const struct fault_names *names, struct fault *fault,
                            struct error *error);

/* Writes line number `line` of the list of all targets, kinds and parameters. Returns the number of
 * lines if text is NULL. Not RT-safe. */
size_t faults_help(size_t line, char *text, size_t size);

/* Receives the beginning of a fault's line, "TARGET KIND", and the meaning of the kind. Required
 * parameters and a time may follow it. Both strings are borrowed during the call. */
typedef void (*fault_list_put)(void *context, const char *line, const char *means);

/* Calls put for every fault that is possible with the names. Not RT-safe. */
void faults_list(const struct fault_names *names, fault_list_put put, void *context);

/* Event that a fault began or ended. */
struct fault_event {
    int64_t time_ns;
    size_t fault;
    bool active;
    bool by_hand; /* by faults_set, not by its time window */
};

struct faults;
struct ring;

/* Copies count faults (may be 0) and numbers those without a name. Refuses duplicate names. Memory
 * from arena. Not RT-safe. */
enum error_code faults_create(const struct fault *fault, size_t count, uint64_t seed,
                              struct arena *arena, struct faults **faults, struct error *error);

size_t faults_count(const struct faults *faults);
const struct fault *faults_at(const struct faults *faults, size_t index);

/* Returns the seed of faults and noise. */
uint64_t faults_seed(const struct faults *faults);

/* Returns the index of a fault by name, -1 = none. RT-safe. */
int faults_find(const struct faults *faults, const char *name);

/* Starts and ends faults by their windows, at the beginning of the tick at now_ns. RT-safe. */
void faults_step(struct faults *faults, int64_t now_ns);

/* Switches a fault at now_ns; from then on its window is ignored. In the thread of faults_step.
 * Returns false when there is no such fault. RT-safe. */
bool faults_set(struct faults *faults, int64_t now_ns, size_t index, bool active);

/* Returns the ring of events. A checkpoint must not restore it, because the reading thread writes
 * it too. */
const struct ring *faults_event_ring(const struct faults *faults);

/* Take an event (false = none waits) and format it as a log line (not RT-safe). From one other
 * thread. */
bool faults_next_event(struct faults *faults, struct fault_event *event);
void fault_event_format(const struct faults *faults, const struct fault_event *event, char *text,
                        size_t size);

#endif
