/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The boards of a rig: motor drivers and force-torque boards that speak on the buses. They receive
 * frames, turn them into bridge voltages, and send telemetry made from the plant's sensors. Each
 * bus speaks one protocol of the list in boards/protocol_list.h, each a folder of its own with its
 * wire format in protocol.h. Every message with its lengths and fields, or object of a dictionary,
 * is a row of a table in the same folder; boards/messages.h lists all messages.
 *
 * Once a tick the loop calls, in this order: boards_receive for every frame that arrived,
 * boards_control (state machines, time-outs, control modes -> voltages), and, after the plant has
 * moved, boards_sample (encoders are quantized) and boards_transmit for each bus. One thread makes
 * all these calls; only boards_next_event and board_event_format may be called from another.
 *
 * Time is virtual and the caller's, int64_t nanoseconds since power-up. The boards' own loop has a
 * step a millisecond, as the real one: in a longer tick it takes several, in a shorter one it
 * waits. All iCub boards power up together, so their slots (POSITION in slot 0, PID_VAL 1, STATUS
 * 2, the rest 3) coincide; the first millisecond is slot 0.
 *
 * A frame that cannot be obeyed is counted and never fatal: foreign (no board here), unknown (no
 * such command) or malformed (length or value), the latter two with an event. Answers wait in a
 * queue; a board that has BOARD_REPLIES_MAX of them waiting loses further ones and reports it in
 * STATUS and OVERFLOW.
 *
 * Units: SI, unless a name or the protocol says otherwise. All memory is the arena's; what is given
 * in a configuration stays the caller's and must outlive only boards_create, but for config.faults
 * and config.context, which must outlive the boards.
 */
#ifndef BOARDS_BOARD_H
#define BOARDS_BOARD_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/frame.h"
#include "model/plant_io.h"

#include <stddef.h>

enum board_kind {
    BOARD_MOTOR,    /* axes on one address: icub 2 (BLL), foc 1 (2FOC), others 1 to 4 */
    BOARD_FT,       /* six-axis force-torque (STRAIN) */
    BOARD_TORQUE,   /* six joint torques in STRAIN frames (pseudo-STRAIN); icub, foc buses */
    BOARD_INERTIAL, /* the robot's inertial sensor: acceleration, rate, field, orientation */
};

struct protocol;
struct described_protocol;

struct boards_bus_config {
    const struct protocol *protocol; /* what the boards speak; NULL: the first of the
                                      * list (boards/protocol_list.h) */
    bool fd;                         /* CAN FD frames, where the protocol has them */
    bool padded; /* a command may be padded to 8 bytes, whatever its length is */
    const struct described_protocol *described; /* of a protocol that a file describes; outlives
                                                 * the boards */
};

enum { BOARD_AXES_MAX = 4, BOARD_CHANNELS = 6, BOARD_REPLIES_MAX = 64 };

/* A supply below and above these multiples of the rig's is an under-voltage and an over-voltage
 * fault (ours): 24 V and 60 V of 48 V. */
#define BOARD_UNDER_VOLTAGE_RATIO 0.5
#define BOARD_OVER_VOLTAGE_RATIO 1.25

/* The same of the pressure that feeds hydraulic joints: half and 1.25 times the nominal one. */
#define BOARD_UNDER_PRESSURE_RATIO 0.5
#define BOARD_OVER_PRESSURE_RATIO 1.25

/* Switches that stand on a joint's link, and the index pulse of its motor; a board whose protocol
 * knows them (struct protocol) tells them, and homes by them. */
struct board_switches {
    bool negative, positive, home;     /* which there are */
    double negative_rad, positive_rad; /* limit switches are on from there outwards */
    double home_rad[2];                /* the home switch is on from .. to */
    double index_rad;                  /* a pulse at each multiple of this link-side angle of the
                                        * motor; 0: none */
};

/* One axis of a motor board. */
struct board_axis_config {
    int joint;                   /* index in the plant's arrays; -1 = spare axis, on compact,
                                  * cia402 and described boards the end of their axes */
    double joint_ticks_per_rad;  /* POSITION frames, link encoder */
    double motor_ticks_per_rad;  /* MOTOR_POSITION frames, rotor encoder, per link-side rad */
    double lower_rad, upper_rad; /* limits until the host sets its own */
    /* Over-current, by an I2t law (boards/icub/motor_board.c), until the host sets its own */
    double current_limit_a;
    double temperature_limit_c; /* of the winding, until the host sets its own; 0 = none */
    /* TorqueMax: 0x8000 counts of the torque source, which is the axis's own sensor until the host
     * names a STRAIN board; 0 = no such sensor */
    double torque_full_scale_nm;
    double gear; /* rotor revolutions a link revolution; foc boards tell rotor angles */
    /* The bridge moves a servo valve (docs/hydraulics.md), which is a source of speed: there is no
     * current, and no mode that would control one; bemf_v_s_rad is the voltage for a rad/s */
    bool valve;
    /* compact, cia402, described: the motor that the factory has tuned the loops for, its back-EMF
     * per link-side rad/s; winding_ohm 0 = not tuned, the gains are 0 until the host sets them */
    double winding_ohm, winding_h, bemf_v_s_rad;
    double torque_nm_a; /* described: link-side torque of an ampere */
    struct board_switches switches;
};

struct board_config {
    const char *name; /* also the additional information that the board gives at first */
    enum board_kind kind;
    int bus; /* index of the bus */
    /* icub 1-14; foc motors 1-4, others 1-14; compact, cia402, described 1-31 */
    uint8_t address;
    bool strict;                /* icub: exactly as the firmware, see boards/icub/motor_board.c */
    bool require_calibration;   /* strict: an axis that was not calibrated cannot be switched on */
    int64_t command_timeout_ns; /* a voltage, current or torque reference without a fresh command
                                 * for so long becomes 0; 0 = off; foc boards have the firmware's
                                 * time-out, strict icub boards none */
    double under_voltage_v;     /* motor boards: a supply below this is a fault */
    double over_voltage_v;      /* motor boards: a supply above this is a fault; 0 = none is */
    /* cia402, described: a supply of the valves' axes outside of these is a fault, Pa; 0 = none */
    double under_pressure_pa, over_pressure_pa;
    struct board_axis_config axis[BOARD_AXES_MAX]; /* BOARD_MOTOR: the first axes_max */
    int ft;                                        /* BOARD_FT: index in the plant's ft array */
    int torque_joint[BOARD_CHANNELS];              /* BOARD_TORQUE: joints, -1 = none */
    double full_scale[BOARD_CHANNELS]; /* BOARD_FT: N, N, N, Nm, Nm, Nm, whole numbers, for the
                                        * host reads them as such; BOARD_TORQUE: Nm */
    int64_t period_ns;           /* STRAIN, inertial and compact telemetry period until set by the
                                  * host; 0 = 1 ms */
    int64_t status_period_ns;    /* foc motors: STATUS no more often; 0 = with every FOC */
    int64_t boot_ns;             /* from power-up until the application runs; 0 = from the start */
    bool transmit_at_start;      /* send without waiting for the host's command: STRAIN calibrated
                                  * frames, inertial acceleration, rate and quaternion, icub motors
                                  * with the policy 0x7f, compact telemetry */
    bool keep_firmware;          /* icub motors: an image of what is downloaded: boards_firmware */
    bool discovery_stops_motors; /* as BLL firmware: class 7 discovery switches PWM off */
    bool external;               /* a real board on the same bus: nothing is sent or obeyed for it,
                                  * its motors are left alone; boards_external_heard. */
    bool external_torque;        /* whose joints follow the torque that it tells, not the angle */
    int64_t external_timeout_ns; /* without a frame of it for so long it is silent */
};

struct boards_config {
    size_t nboard;
    const struct board_config *board;
    size_t nbus;
    const struct boards_bus_config *bus; /* nbus entries; NULL: the first protocol's */
    size_t njoint, nft;
    const struct faults *faults; /* those of boards act; NULL = none (faults/faults.h) */
    int64_t tick_ns;             /* boards_control is called once a tick; up to 100 ms */
    size_t voltage_delay_ticks;  /* from a board's voltage to its bridge; up to 1000 */
    /* Called from boards_control for each axis of a board whose application restarts: what its
     * hardware counted is lost. Must be RT-safe. NULL = not needed. */
    void (*restarted)(void *context, int joint);
    void *context;
};

enum board_event_kind {
    BOARD_EVENT_MODE,        /* an axis changed its control mode: a = old, b = new */
    BOARD_EVENT_FAULT,       /* fault bits rose on an axis: a = bits, of the protocol's enum */
    BOARD_EVENT_TIMEOUT,     /* a command of an axis timed out: a = its mode */
    BOARD_EVENT_SOURCE_LOST, /* the torque source of an axis timed out: a = its address */
    BOARD_EVENT_LIMIT,       /* voltage refused beyond a joint limit: a = position in ticks */
    BOARD_EVENT_UNKNOWN,     /* no such command: a = id, b = first byte */
    BOARD_EVENT_MALFORMED,   /* wrong length or value: a = id, b = first byte */
    BOARD_EVENT_ADDRESS,     /* a board moved to another address: a = old, b = new */
    BOARD_EVENT_RESTART,     /* a board entered its bootloader: a = 1, or left it: a = 0 */
    BOARD_EVENT_FIRMWARE,    /* a download into the bootloader ended: a = bytes, b = CRC-32 */
    BOARD_EVENT_OVERFLOW,    /* a board loses replies or frames: a = how many so far */
    BOARD_EVENT_OVER_HEATED, /* icub: the winding of an axis is too hot: a = 0.1 degree C */
    BOARD_EVENT_OWED,   /* icub: a strict axis is not switched on until the host has sent something:
                              * a = enum board_owed */
    BOARD_EVENT_SILENT, /* an external board has not been heard: a = ms, since the start or its
                              * last frame */
    BOARD_EVENT_HEARD,  /* an external board is heard, for the first time or again */
};

/* An event for the log; formatted outside the loop. */
/* What the host of a strict icub axis owes it. */
enum board_owed { BOARD_OWED_PROTOCOL, BOARD_OWED_PID, BOARD_OWED_CALIBRATION };

struct board_event {
    int64_t time_ns;
    enum board_event_kind kind;
    int bus;
    uint8_t address; /* at the time */
    uint8_t axis;    /* where the kind has one */
    uint16_t board;  /* index in the configuration */
    uint32_t a, b;
};

/* Counts since the start. */
struct boards_counters {
    uint64_t frames;      /* received for some board */
    uint64_t foreign;     /* ids that belong to no board here */
    uint64_t unknown;     /* addressed to a board, but no such command */
    uint64_t malformed;   /* known command, wrong length or value */
    uint64_t timeouts;    /* of commands and torque sources */
    uint64_t trips;       /* over-current, over-temperature */
    uint64_t overflows;   /* replies and periodic frames that a board could not send */
    uint64_t events_lost; /* events that found the ring full */
};

struct boards;
struct ring;

/* Checks the configuration (addresses unique per bus, joints known and driven by one axis only,
 * ...) and makes the boards; copies what it needs of config. Memory from arena. Not RT-safe. */
enum error_code boards_create(const struct boards_config *config, struct arena *arena,
                              struct boards **boards, struct error *error);

/*
 * The phases of a tick, all RT-safe. now_ns is the virtual time of the phase: of the tick's
 * beginning in boards_receive and boards_control, of its end in boards_sample and boards_transmit.
 * Events bear it. It goes back only when the whole arena does (a checkpoint is restored).
 *
 * boards_sample is also called once before the first tick, with what the plant shows before its
 * first step. boards_receive takes any frame whatever. boards_control writes bridge and voltage of
 * the joints that have a board, from what was sampled last, and leaves the rest of command alone.
 * boards_transmit writes at most max frames, replies in the order of their requests, then periodic
 * frames by board address, and returns how many; with max below boards_transmit_max replies wait
 * and periodic frames may be lost. The node of a frame is the number of its board among those of
 * its bus, in the order of the configuration: each is a CAN node of its own.
 */
void boards_receive(struct boards *boards, int64_t now_ns, size_t bus,
                    const struct bus_frame *frame);
void boards_control(struct boards *boards, int64_t now_ns, struct plant_command *command);
void boards_sample(struct boards *boards, int64_t now_ns, const struct plant_sensors *sensors);
size_t boards_transmit(struct boards *boards, int64_t now_ns, size_t bus, struct bus_frame *frames,
                       size_t max);

/* State of the CAN controller of a board (index in the configuration), where the bus is a wire
 * that has such: iCub boards report it in STATUS. RT-safe; once a tick before boards_transmit. */
struct board_can_state {
    unsigned tec, rec; /* error counters */
    bool bus_off;
};
void boards_set_can_state(struct boards *boards, size_t board, const struct board_can_state *state);

/* Checks whether the state of some board of a bus, as it was set last, has errors. RT-safe. */
bool boards_have_can_errors(const struct boards *boards, size_t bus);

/* State of a board, for whoever shows it. */
struct board_state {
    uint8_t address, naxis;
    bool in_bootloader, faulty; /* faulty: an axis is in hardware fault */
    bool away;                  /* a fault keeps it from the bus */
    bool external, silent;      /* external: a real one; silent: and it is not heard */
    uint8_t mode[BOARD_AXES_MAX];
    int64_t heard_ns; /* when it last received a frame that is meant for it, when an external one
                       * last sent one; -1 = never */
};

/* Whoever listens to the external boards (boards know no telemetry but their own) says when one has
 * sent a frame, and once a tick that time passes. Events tell of its silence and of its return.
 * RT-safe, in the thread of the boards. */
void boards_external_heard(struct boards *boards, int64_t now_ns, size_t board);
void boards_external_step(struct boards *boards, int64_t now_ns);

/* Returns whether an external board is heard: within its time-out. RT-safe. */
bool boards_external_present(const struct boards *boards, size_t board);

/* In the thread of the boards; RT-safe. */
void boards_state(const struct boards *boards, size_t board, struct board_state *state);

/* Returns the most frames that the boards of a bus can send in a tick. RT-safe. */
size_t boards_transmit_max(const struct boards *boards, size_t bus);

/* Switches all bridges off at once (stop, emergency). RT-safe. */
void boards_shut_down(struct boards *boards, int64_t now_ns, struct plant_command *command);

/* Returns whether some axis is in hardware fault. RT-safe. */
bool boards_fault(const struct boards *boards);

/* Settings of a motor board's axis: gains and limits that a host sets over the bus. Whoever runs
 * the simulator may change them beside it, as with a debugger, also while the axis runs. Ranges are
 * those of the protocol; a fraction is refused where the protocol has whole numbers. Read and
 * written in the thread of the boards; RT-safe. */
struct board_setting {
    const char *name; /* "current_kp", ...; static */
    const char *unit; /* "" = a count */
    double min, max;
    bool whole;
    double value; /* now */
};
size_t boards_settings(const struct boards *boards, size_t board, size_t axis);
void boards_setting(const struct boards *boards, size_t board, size_t axis, size_t index,
                    struct board_setting *setting);
double boards_get(const struct boards *boards, size_t board, size_t axis, size_t index);
bool boards_set(struct boards *boards, size_t board, size_t axis, size_t index, double value);

/* Reads what a host has downloaded last into the bootloader of a board; false: nothing. crc is
 * the CRC-32 of zlib over address (low byte, high byte), memory (0 program, 1 data) and data of
 * each line. Read in the thread of the boards; RT-safe. */
struct board_firmware {
    uint32_t lines, bytes, crc;
    const uint16_t *image; /* program memory, then data memory, 0xffff where nothing came; NULL
                            * unless keep_firmware */
    size_t words;          /* of the image */
};
bool boards_firmware(const struct boards *boards, size_t board, struct board_firmware *firmware);

/* Returns a count that increases whenever some setting may have changed, whoever did it.
 * RT-safe. */
uint64_t boards_settings_changes(const struct boards *boards);

/* Returns the ring of events, which the thread that reads them writes too: a checkpoint leaves
 * it alone. */
const struct ring *boards_event_ring(const struct boards *boards);

/* From one other thread: takes an event, false when none waits; formats it as a log line (not
 * RT-safe). */
bool boards_next_event(struct boards *boards, struct board_event *event);
void board_event_format(const struct boards *boards, const struct board_event *event, char *text,
                        size_t size);

void boards_counters(const struct boards *boards, struct boards_counters *counters);

#endif
