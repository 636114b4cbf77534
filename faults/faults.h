/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The faults of a run: what breaks, how, and when. A fault is written as one line,
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
 * TARGET is "motor JOINT", "sensor JOINT.CHANNEL" (link_encoder, motor_encoder, current, torque,
 * temperature), "sensor FT[.CHANNEL]" (fx fy fz tx ty tz), "sensor imu[.CHANNEL]" (gyro_x gyro_y
 * gyro_z accel_x accel_y accel_z mag_x mag_y mag_z quat_w quat_x quat_y quat_z), "board NAME" or
 * "board BUS/ADDRESS", "bus NAME", "supply", or of hydraulic joints "valve JOINT" and
 * "hydraulic_supply". The kinds of each target with their parameters are the table in
 * kinds.c; faults_help lists them. A parameter is KEY=VALUE, or VALUE alone for the first.
 * WHEN is FROM..TO in seconds of virtual time, TO exclusive and maybe left out; "manual" waits to
 * be switched by faults_set. Without WHEN the fault is active from the start.
 *
 * This is only the table and which of its faults are active. What a fault does is in
 * boards/sensing/sensing.h (sensors), boards/board_faults.c (boards), canbus/fault_port.h (buses)
 * and model/plant_step.c (motors, valves, supplies); all of them look at struct fault's active. A
 * fault shows on the buses by its effect and in the log by its event: no frame of a board reports
 * it, for a real bus would not know.
 *
 * Units: SI; times are int64_t nanoseconds of virtual time. Memory is the arena's. Functions say
 * whether they are RT-safe; those that only look at the table are.
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
    FAULT_VALVE,           /* of a hydraulic joint, and its cylinder */
    FAULT_HYDRAULIC_SUPPLY /* pump, accumulator, relief valve */
};

enum fault_kind {
    FAULT_OFF,          /* sensor: reads 0; board: without power, boots again afterwards; valve:
                         * without current, in the middle */
    FAULT_STUCK,        /* repeats what it last said; valve: stays where it is */
    FAULT_GARBAGE,      /* random values; of a board, payloads */
    FAULT_WRONG,        /* gain and offset */
    FAULT_SLOW,         /* sensor: a new value only every period; board: every n-th frame only */
    FAULT_DELAYED,      /* everything comes later */
    FAULT_INTERMITTENT, /* a loose contact: a share of the time off, or a board without its bus */
    FAULT_HUNG,         /* boards: the firmware stands still until its watchdog resets it */
    FAULT_OPEN_PHASE,   /* motors: enum drive_condition */
    FAULT_SHORT,
    FAULT_JAM,
    FAULT_SPRING_BREAK,
    FAULT_LOSS,         /* buses: a frame never arrives, with a probability */
    FAULT_CORRUPTION,   /* a bit of the data is flipped and the CRC has missed it */
    FAULT_LATE,         /* frames arrive after a delay */
    FAULT_DUPLICATE,    /* a frame arrives twice */
    FAULT_BUS_OFF,      /* the simulator's controller is off the bus */
    FAULT_ERROR_BURST,  /* wire mode only: bit errors for as long as it lasts */
    FAULT_ID_COLLISION, /* wire mode only: another node sends with an id that is in use */
    FAULT_SAG,          /* supply: so many volts are missing */
    FAULT_SHIFTED,      /* valve: its middle is off */
    FAULT_LEAK,         /* valve: oil leaks past the piston; hydraulic supply: to the return */
    FAULT_PUMP_LOSS,    /* hydraulic supply: the pump gives less */
    FAULT_RELIEF_SHUT,  /* hydraulic supply: the relief valve does not open */
};

enum { FAULT_NAME_SIZE = 64, FAULT_TEXT_SIZE = 160, FAULT_PARAMETERS = 2, FAULTS_MAX = 256 };

/* Channels of all sensors, numbered through: five of each joint, then six of each force-torque
 * sensor, then those of the inertial one: gyro, accelerometer, magnetometer, orientation. */
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
    char name[FAULT_NAME_SIZE]; /* as given, or its number from 1 */
    char text[FAULT_TEXT_SIZE]; /* as written */
    enum fault_target target;
    enum fault_kind kind;
    size_t index;    /* of the joint, board or bus; FAULT_SENSOR: of its first channel */
    size_t channels; /* FAULT_SENSOR: how many */
    double value[FAULT_PARAMETERS]; /* in the order of the table, defaults filled in; SI units */
    int64_t id;                     /* FAULT_BUS: of the frames meant; -1 = all */
    int64_t from_ns, to_ns;         /* [from, to); INT64_MAX = open; manual: both INT64_MAX */
    bool timed;                     /* the line says when */
    bool active;                    /* written by faults_step and faults_set only */
};

/* Names that a fault's line may use. Pointers are borrowed for the call. */
struct fault_names {
    size_t njoint;
    const char *const *joint;
    const bool *driven;    /* by joint: it has a drive */
    const bool *hydraulic; /* by joint: the drive is a cylinder behind a valve */
    bool oil_store;        /* the hydraulic supply has an accumulator: its pressure can change */
    size_t nft;
    const char *const *ft;
    bool imu;
    size_t nbus;
    const char *const *bus;
    const bool *wire; /* by bus: it is a wire in virtual time */
    size_t nboard;
    const char *const *board; /* as in struct board_config */
    const size_t *board_bus;  /* by board */
    const int *board_address;
};

/* Reads one line. The error says what was found and what was expected, with the nearest name. Not
 * RT-safe. */
enum error_code fault_parse(const char *text, const struct fault_names *names, struct fault *fault,
                            struct error *error);

/* Writes the kinds of every target with their parameters, a line each, for manuals and messages;
 * returns the number of lines when line is NULL. Not RT-safe. */
size_t faults_help(size_t line, char *text, size_t size);

/* Takes the beginning of a fault's line, "TARGET KIND", which required parameters and a time may
 * follow, and the meaning of the kind; both are borrowed for the call. */
typedef void (*fault_list_put)(void *context, const char *line, const char *means);

/* Puts out every fault that is possible with the names. Not RT-safe. */
void faults_list(const struct fault_names *names, fault_list_put put, void *context);

/* Event that a fault began or ended. */
struct fault_event {
    int64_t time_ns;
    size_t fault;
    bool active;
    bool by_hand; /* faults_set did it, not the clock */
};

struct faults;
struct ring;

/* Copies count faults (count may be 0), numbers those without a name, refuses a name that is there
 * twice. Memory from arena. Not RT-safe. */
enum error_code faults_create(const struct fault *fault, size_t count, uint64_t seed,
                              struct arena *arena, struct faults **faults, struct error *error);

size_t faults_count(const struct faults *faults);
const struct fault *faults_at(const struct faults *faults, size_t index);

/* Returns the seed of faults and noise. */
uint64_t faults_seed(const struct faults *faults);

/* Returns the index of a fault by name, -1 = none. RT-safe. */
int faults_find(const struct faults *faults, const char *name);

/* Opens and closes windows at the beginning of the tick at now_ns. RT-safe. */
void faults_step(struct faults *faults, int64_t now_ns);

/* Switches a fault by hand at now_ns; from then on its window is ignored. In the thread of
 * faults_step. False: there is no such fault. RT-safe. */
bool faults_set(struct faults *faults, int64_t now_ns, size_t index, bool active);

/* Returns the ring of events, which the thread that reads them writes too: a checkpoint leaves
 * it alone. */
const struct ring *faults_event_ring(const struct faults *faults);

/* Takes an event, false when none waits, from one other thread; formats it as a log line (not
 * RT-safe). */
bool faults_next_event(struct faults *faults, struct fault_event *event);
void fault_event_format(const struct faults *faults, const struct fault_event *event, char *text,
                        size_t size);

#endif
