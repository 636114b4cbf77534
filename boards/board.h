/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The boards of a rig: motor drivers and sensor boards on CAN buses. They receive frames, turn
 * commands into bridge voltages, and send telemetry from the plant's sensors. Each bus speaks one
 * protocol of boards/protocol_list.h. Each protocol has a folder with its wire format in protocol.h
 * and a table of its messages or dictionary objects. boards/messages.h lists all messages.
 *
 * Once a tick the loop calls, in this order:
 *
 *   1. boards_receive    for every frame that arrived
 *   2. boards_control    state machines, time-outs, control modes; sets voltages
 *   3. boards_sample     after the plant has moved; quantizes encoders
 *   4. boards_transmit   for each bus
 *
 * One thread makes all these calls. Another thread may call only boards_next_event and
 * board_event_format.
 *
 * The caller passes in virtual time, int64_t ns since power-up. As on real boards, the control loop
 * of a board runs once a millisecond: several times in a longer tick, not in every tick if ticks
 * are shorter. All iCub boards power up together, so their transmission slots coincide: POSITION in
 * slot 0, PID_VAL in 1, STATUS in 2, the rest in 3. The first millisecond is slot 0.
 *
 * A frame that a board cannot obey is counted and never fatal. It is foreign (no such board),
 * unknown (no such command) or malformed (wrong length or value); the latter two also give an
 * event. Answers wait in a queue. When BOARD_REPLIES_MAX answers wait, the board drops further ones
 * and reports this in STATUS and with OVERFLOW.
 *
 * Units: SI, unless a name or the protocol says otherwise. All memory comes from the arena. The
 * caller owns the configuration, which must outlive boards_create; config.faults and config.context
 * must outlive the boards.
 */
#ifndef BOARDS_BOARD_H
#define BOARDS_BOARD_H

#include "base/arena.h"
#include "base/error.h"
#include "canbus/frame.h"
#include "model/plant_io.h"

enum board_kind {
    BOARD_MOTOR,    /* axes per address: icub 2 (BLL), foc 1 (2FOC), others 1 to 4 */
    BOARD_FT,       /* six-axis force-torque (STRAIN) */
    BOARD_TORQUE,   /* six joint torques in STRAIN frames (pseudo-STRAIN); icub and foc buses */
    BOARD_INERTIAL, /* inertial sensor: acceleration, angular rate, magnetic field, orientation */
};

struct protocol;
struct described_protocol;

struct boards_bus_config {
    /* protocol of the bus; NULL = the first of the list (boards/protocol_list.h) */
    const struct protocol *protocol;
    bool fd;     /* use CAN FD frames, if the protocol has them */
    bool padded; /* commands of any length may be padded to 8 bytes */
    /* for a protocol that a file describes; must outlive the boards */
    const struct described_protocol *described;
};

enum { BOARD_AXES_MAX = 4, BOARD_CHANNELS = 6, BOARD_REPLIES_MAX = 64, BOARD_ADDRESS_MAX = 254 };

/* Time from a restart until a board answers, unless the rig has boot_s. A client that resets a node
 * has time to listen for its boot-up. */
#define BOARD_RESTART_NS INT64_C(50000000)

/* Limits of the supply as multiples of the rig's supply; beyond them a board has an under-voltage
 * or over-voltage fault. Our choice: 24 V and 60 V for 48 V. */
#define BOARD_UNDER_VOLTAGE_RATIO 0.5
#define BOARD_OVER_VOLTAGE_RATIO 1.25

/* Limits of the supply pressure of hydraulic joints, as multiples of the nominal pressure. */
#define BOARD_UNDER_PRESSURE_RATIO 0.5
#define BOARD_OVER_PRESSURE_RATIO 1.25

/* The switches on a joint's link and the index pulse of its motor. A board whose protocol supports
 * switches (struct protocol) reports them and homes to them. */
struct board_switches {
    bool negative, positive, home;     /* which switches exist */
    double negative_rad, positive_rad; /* a limit switch is on from this angle outwards */
    double home_rad[2];                /* the home switch is on between these angles */
    /* link-side motor angle between two index pulses; 0 = no pulse */
    double index_rad;
};

/* The time from the end of a command on the bus to the start of a board's answer: delay_ns, plus a
 * random part that is uniform from 0 to spread_ns. The answers of a board stay in order. */
struct board_reply_time {
    int64_t delay_ns, spread_ns;
};

/* Greatest delay and spread that files may set, s. */
#define BOARD_REPLY_MAX_S 0.1

/* One axis of a motor board. */
struct board_axis_config {
    /* index in the plant's arrays; -1 = spare axis. On compact, cia402 and described boards, the
     * first -1 ends the axes */
    int joint;
    double joint_ticks_per_rad; /* link encoder, for POSITION frames */
    /* rotor encoder, for MOTOR_POSITION frames; ticks per link-side rad */
    double motor_ticks_per_rad;
    double lower_rad, upper_rad; /* position limits until the host sets others */
    /* Limit of the I2t over-current fault (boards/icub/motor_board.c), until the host sets
     * another */
    double current_limit_a;
    /* limit of the winding temperature, until the host sets another; 0 = none */
    double temperature_limit_c;
    /* TorqueMax: torque of 0x8000 counts of the torque source. The source is the axis's own sensor
     * until the host selects a STRAIN board; 0 = no own sensor */
    double torque_full_scale_nm;
    double gear; /* rotor revolutions per link revolution; foc boards report rotor angles */
    /* The bridge drives a servo valve (docs/hydraulics.md), which sets the speed of the joint. The
     * axis has no current and no mode that controls a current. bemf_v_s_rad is then the valve's
     * voltage per rad/s */
    bool valve;
    /* compact, cia402, described: motor data for the factory tuning of the loops; back-EMF per
     * link-side rad/s. winding_ohm 0 = not tuned: the gains are 0 until the host sets them */
    double winding_ohm, winding_h, bemf_v_s_rad;
    double current_loop_hz; /* bandwidth of the drive's own current controller; 0 = the default */
    double torque_nm_a;     /* described: link-side torque per ampere */
    /* described: commanded and reported current and torque, divided by the true ones; 0 = 1 */
    double current_gain, torque_gain;
    double torque_offset_nm;
    struct board_switches switches;
};

struct board_config {
    const char *name; /* also the board's initial additional information */
    uint8_t model;    /* described: index of the drive's model in the protocol */
    enum board_kind kind;
    int bus; /* index of the bus */
    /* icub 1-14; foc motors 1-4, others 1-14; compact, cia402, described 1-31 */
    uint8_t address;
    /* icub: behaves exactly as the firmware, see boards/icub/motor_board.c */
    bool strict;
    bool require_calibration; /* strict: refuse to switch on an axis that was not calibrated */
    /* time without a command after which a voltage, current or torque reference becomes 0; 0 =
     * never. Foc boards have the firmware's time-out, strict icub boards have none */
    int64_t command_timeout_ns;
    double under_voltage_v; /* motor boards: under-voltage fault below this supply */
    double over_voltage_v;  /* motor boards: over-voltage fault above this supply; 0 = none */
    /* cia402, described: fault if the supply pressure of a valve axis is outside these limits, Pa;
     * 0 = none */
    double under_pressure_pa, over_pressure_pa;
    struct board_axis_config axis[BOARD_AXES_MAX]; /* BOARD_MOTOR: the first axes_max are used */
    int ft;                                        /* BOARD_FT: index in the plant's ft array */
    int torque_joint[BOARD_CHANNELS];              /* BOARD_TORQUE: joints, -1 = none */
    /* BOARD_FT: N, N, N, Nm, Nm, Nm, whole numbers because the host reads integers;
     * BOARD_TORQUE: Nm */
    double full_scale[BOARD_CHANNELS];
    /* period of STRAIN, inertial and compact telemetry until the host sets another; 0 = 1 ms */
    int64_t period_ns;
    /* foc motors: minimum period of STATUS; 0 = one STATUS with every FOC */
    int64_t status_period_ns;
    /* boot_ns: time from power-up to the start of the application, at the start of a run and after
     * a restart; 0 = none. restart_ns: minimum duration of a restart */
    int64_t boot_ns, restart_ns;
    /* time of the board's answers; a negative member = the protocol's value */
    struct board_reply_time reply;
    /* sends telemetry without a host's command: STRAIN calibrated frames, inertial acceleration,
     * rate and quaternion, icub motors with the policy 0x7f, compact telemetry */
    bool transmit_at_start;
    /* icub motors: keep an image of a firmware download (boards_firmware) */
    bool keep_firmware;
    bool discovery_stops_motors; /* as BLL firmware: discovery (class 7) switches PWM off */
    /* a real board on the same bus (boards_external_heard): the simulator neither emulates it nor
     * drives its motors */
    bool external;
    bool external_torque;        /* its joints follow the torque that it reports, not the angle */
    int64_t external_timeout_ns; /* the board counts as silent after this time without a frame */
};

struct boards_config {
    size_t nboard;
    const struct board_config *board;
    size_t nbus;
    const struct boards_bus_config *bus; /* nbus entries; NULL = all buses use the first protocol */
    size_t njoint, nft;
    /* all faults of the run (faults/faults.h); the boards apply the faults that target boards; NULL
     * = none */
    const struct faults *faults;
    int64_t tick_ns;            /* period of boards_control; up to 100 ms */
    size_t voltage_delay_ticks; /* delay from a board's voltage to its bridge; up to 1000 */
    /* boards_control calls this for each axis of a board whose application restarts. The board's
     * hardware counters are lost. Must be RT-safe. NULL = not needed. */
    void (*restarted)(void *context, int joint);
    void *context;
};

enum board_event_kind {
    BOARD_EVENT_MODE,        /* an axis changed its control mode: a = old, b = new */
    BOARD_EVENT_FAULT,       /* new fault bits on an axis: a = bits, of the protocol's enum */
    BOARD_EVENT_TIMEOUT,     /* a command of an axis timed out: a = its mode */
    BOARD_EVENT_SOURCE_LOST, /* the torque source of an axis timed out: a = its address */
    BOARD_EVENT_LIMIT,       /* refused a voltage beyond a joint limit: a = position in ticks */
    BOARD_EVENT_UNKNOWN,     /* unknown command: a = id, b = first byte */
    /* wrong length or value: a = id, b = first byte, or the reason in struct board_event */
    BOARD_EVENT_MALFORMED,
    BOARD_EVENT_ADDRESS,     /* a board moved to another address: a = old, b = new */
    BOARD_EVENT_RESTART,     /* a board entered its bootloader: a = 1, or left it: a = 0 */
    BOARD_EVENT_FIRMWARE,    /* a download into the bootloader ended: a = bytes, b = CRC-32 */
    BOARD_EVENT_OVERFLOW,    /* a board dropped replies or frames: a = total so far */
    BOARD_EVENT_OVER_HEATED, /* icub: the winding of an axis is too hot: a = 0.1 degree C */
    /* icub: the host tried to switch on a strict axis but has not sent what the axis requires: a =
     * enum board_owed */
    BOARD_EVENT_OWED,
    BOARD_EVENT_SILENT, /* an external board is silent: a = ms since the start or its last frame */
    BOARD_EVENT_HEARD,  /* an external board sends frames, for the first time or again */
};

/* What a strict icub axis still requires of the host before it switches on. */
enum board_owed { BOARD_OWED_PROTOCOL, BOARD_OWED_PID, BOARD_OWED_CALIBRATION };

/* An event for the log. Another thread formats it. */
struct board_event {
    int64_t time_ns;
    enum board_event_kind kind;
    int bus;
    uint8_t address; /* address at the time of the event */
    uint8_t axis;    /* axis, for kinds of events that have one */
    uint16_t board;  /* index of the board in the configuration */
    /* MALFORMED: row of the frame, and the reason (enum described_wrong) with b = found, c =
     * expected. why 0 = no reason: b is the first byte */
    uint8_t row, why;
    uint32_t a, b, c;
};

/* Counts since the start. */
struct boards_counters {
    uint64_t frames;      /* frames that a board received */
    uint64_t foreign;     /* no board here uses the identifier */
    uint64_t unknown;     /* for a board that has no such command */
    uint64_t malformed;   /* known command, wrong length or value */
    uint64_t timeouts;    /* time-outs of commands and torque sources */
    uint64_t trips;       /* over-current, over-temperature */
    uint64_t overflows;   /* replies and periodic frames that a board could not send */
    uint64_t events_lost; /* events dropped because the ring was full */
};

struct boards;
struct ring;

/* Creates the boards of a configuration. The caller has checked it, as rig/boards.c does: addresses
 * are unique on a bus and within the protocol's limits, indices exist, each joint has one axis.
 * Returns an error for too many axes on a bus, and for servo valves on boards that cannot move
 * them. Copies the configuration, except where a field says otherwise. Memory from arena. Not
 * RT-safe. */
enum error_code boards_create(const struct boards_config *config, struct arena *arena,
                              struct boards **boards, struct error *error);

/*
 * The phases of a tick, all RT-safe. now_ns is virtual time; events get it as time stamp. Pass the
 * start of the tick to boards_receive and boards_control, its end to boards_sample and
 * boards_transmit. It goes back only when a checkpoint restores the whole arena.
 *
 * boards_receive accepts any frame. boards_control sets bridge and voltage of the joints that have
 * a board, from the last samples. It leaves all other commands unchanged. The caller also calls
 * boards_sample once before the first tick, with the plant's initial state.
 *
 * boards_transmit writes at most max frames and returns their number: replies that are due, in the
 * order of their times and requests, then periodic frames by board address. If max is below
 * boards_transmit_max, replies wait and periodic frames may be lost. The node of a frame is the
 * index of its board among the boards of the bus, in the order of the configuration. Each board is
 * a CAN node.
 *
 * boards_transmit consists of boards_answer, which writes replies that are due by due_ns, and
 * boards_transmit_periodic. On a wire in virtual time, and between two ticks of real time, call
 * boards_answer when boards_next_answer says so: it returns the time of the next reply of a bus,
 * INT64_MAX = none. boards_receive_early is boards_receive for a frame that came at arrival_ns, up
 * to now_ns: replies count their delay from there.
 */
void boards_receive(struct boards *boards, int64_t now_ns, size_t bus,
                    const struct bus_frame *frame);
void boards_receive_early(struct boards *boards, int64_t now_ns, int64_t arrival_ns, size_t bus,
                          const struct bus_frame *frame);
void boards_control(struct boards *boards, int64_t now_ns, struct plant_command *command);
void boards_sample(struct boards *boards, int64_t now_ns, const struct plant_sensors *sensors);
size_t boards_transmit(struct boards *boards, int64_t now_ns, size_t bus, struct bus_frame *frames,
                       size_t max);
size_t boards_answer(struct boards *boards, int64_t now_ns, int64_t due_ns, size_t bus,
                     struct bus_frame *frames, size_t max);
size_t boards_transmit_periodic(struct boards *boards, int64_t now_ns, size_t bus,
                                struct bus_frame *frames, size_t max);
int64_t boards_next_answer(const struct boards *boards, size_t bus);

/* Sets the state of a board's CAN controller, if the wire simulates controllers. board: index in
 * the configuration. iCub boards report this state in STATUS. RT-safe; call it once a tick before
 * boards_transmit. */
struct board_can_state {
    unsigned tec, rec; /* error counters */
    bool bus_off;
};
void boards_set_can_state(struct boards *boards, size_t board, const struct board_can_state *state);

/* Returns whether the last CAN state of any board of a bus has errors. RT-safe. */
bool boards_have_can_errors(const struct boards *boards, size_t bus);

/* State of a board, for display. */
struct board_state {
    uint8_t address, naxis;
    bool in_bootloader, faulty; /* faulty: an axis is in hardware fault */
    bool away;                  /* a fault disconnects it from the bus */
    bool external, silent;      /* external: a real board; silent: it has timed out */
    uint8_t mode[BOARD_AXES_MAX];
    /* time of the last frame that was meant for this board, or that an external board sent; -1 =
     * never */
    int64_t heard_ns;
};

/* boards_external_heard records that an external board has sent a frame. Call boards_external_step
 * once a tick. The listener on the bus calls both, because boards cannot read other boards'
 * telemetry. Events report when a board falls silent and when it returns. RT-safe, in the thread of
 * the boards. */
void boards_external_heard(struct boards *boards, int64_t now_ns, size_t board);
void boards_external_step(struct boards *boards, int64_t now_ns);

/* Returns whether an external board has sent a frame within its time-out. RT-safe. */
bool boards_external_present(const struct boards *boards, size_t board);

/* Gets the state of a board. In the thread of the boards; RT-safe. */
void boards_state(const struct boards *boards, size_t board, struct board_state *state);

/* Returns the most frames that the boards of a bus can send in a tick. RT-safe. */
size_t boards_transmit_max(const struct boards *boards, size_t bus);

/* Switches all bridges off at once (stop, emergency). RT-safe. */
void boards_shut_down(struct boards *boards, int64_t now_ns, struct plant_command *command);

/* Returns whether any axis is in hardware fault. RT-safe. */
bool boards_fault(const struct boards *boards);

/* A setting of a motor axis: a gain or a limit that a host sets over the bus. The user of the
 * simulator may also change settings with boards_set while the axis runs, as with a debugger. The
 * protocol sets the ranges. boards_set refuses a fraction for a whole-number setting. In the thread
 * of the boards; RT-safe. */
struct board_setting {
    const char *name; /* "current_kp", ...; static */
    const char *unit; /* "" = a count */
    double min, max;
    bool whole;
    double value; /* present value */
};
size_t boards_settings(const struct boards *boards, size_t board, size_t axis);
void boards_setting(const struct boards *boards, size_t board, size_t axis, size_t index,
                    struct board_setting *setting);
double boards_get(const struct boards *boards, size_t board, size_t axis, size_t index);
bool boards_set(struct boards *boards, size_t board, size_t axis, size_t index, double value);

/* Gets the last firmware that a host downloaded into a board's bootloader; false = none. crc is the
 * CRC-32 of zlib over each line: address (low byte, high byte), memory (0 program, 1 data), data.
 * In the thread of the boards; RT-safe. */
struct board_firmware {
    uint32_t lines, bytes, crc;
    /* program memory, then data memory; unwritten words are 0xffff; NULL unless keep_firmware */
    const uint16_t *image;
    size_t words; /* size of the image */
};
bool boards_firmware(const struct boards *boards, size_t board, struct board_firmware *firmware);

/* Returns a counter that increases whenever a setting may have changed, from the bus or by
 * boards_set. RT-safe. */
uint64_t boards_settings_changes(const struct boards *boards);

/* Returns the ring of events. A checkpoint must not restore it, because the reading thread writes
 * it too. */
const struct ring *boards_event_ring(const struct boards *boards);

/* boards_next_event takes the oldest event; false = none. board_event_format writes an event as a
 * log line; not RT-safe. One thread other than the boards' thread may call them. */
bool boards_next_event(struct boards *boards, struct board_event *event);
void board_event_format(const struct boards *boards, const struct board_event *event, char *text,
                        size_t size);

void boards_counters(const struct boards *boards, struct boards_counters *counters);

/* Gets the event of the last malformed frame; false = there was none. */
bool boards_last_malformed(const struct boards *boards, struct board_event *event);

#endif
