/* SPDX-License-Identifier: Apache-2.0 */
/*
 * CANopen (CiA 301) and its profile for drives (CiA 402, IEC 61800-7-201): identifiers, services,
 * states, and the objects that a host needs. Boards and hosts share it; it has no behavior and is
 * RT-safe. Numbers are little-endian. boards/cia402/table.c has the whole object dictionary.
 *
 * A board is a node with a Node-ID n of 1 to 31. Identifiers of the predefined connection set:
 *
 *   0x000        NMT          host   command, node (0 = all)
 *   0x080        SYNC         host   empty, or a counter that is ignored
 *   0x080 + n    EMCY         node   u16 code, u8 error register, u8 axis, u32 faults
 *   0x180 + n    TPDO 1       node   0x280, 0x380, 0x480: TPDO 2 to 4; content by mapping
 *   0x200 + n    RPDO 1       host   0x300, 0x400, 0x500: RPDO 2 to 4
 *   0x580 + n    SDO server   node   answers
 *   0x600 + n    SDO client   host   requests
 *   0x700 + n    heartbeat    node   u8 state; boot-up 0; as a remote frame node guarding
 *   0x7e4        LSS          node   answers (CiA 305)
 *   0x7e5        LSS          host   requests
 *
 * Axis k of a node, from 0, has the objects 0x6000 to 0x67ff at + 0x800 k, as in CiA 402. The
 * manufacturer's objects 0x4000 to 0x47ff follow the same rule. The PDOs of axis k begin at 1 + 64
 * k.
 *
 * Units: positions 10 urad on the link side of the gear, velocities 10 urad/s, accelerations 10
 * urad/s2, voltages 2 mV, spring torques 10 mN m, pressures 10 mbar. Torques and currents are in
 * thousandths of their rated values (0x6076, 0x6075), as in CiA 402.
 *
 * An axis with a servo valve (board_axis_config) has pressures and opening in 0x4008 and 0x4009. It
 * has no torque modes and no current. Its motor encoder is the joint's encoder. Its spring torque
 * and its torque are the cylinder's torque on the joint, rated at the full scale of the torque
 * sensor.
 */
#ifndef BOARDS_CIA402_PROTOCOL_H
#define BOARDS_CIA402_PROTOCOL_H

#include <stdbool.h>
#include <stdint.h>

enum {
    CIA402_NODE_MAX = 31,
    CIA402_BOARD_AXES = 4,      /* most axes per node */
    CIA402_AXIS_STEP = 0x800,   /* object distance between two axes */
    CIA402_AXIS_PDOS = 4,       /* PDOs per direction and axis */
    CIA402_PDO_STEP = 64,       /* distance of PDO numbers between two axes */
    CIA402_MAPPED_MAX = 8,      /* most objects in a PDO */
    CIA402_HOMING_METHODS = 32, /* sub-indices of 0x60e3 */
};

enum cia402_cob {
    CIA402_NMT = 0x000,
    CIA402_SYNC = 0x080,
    CIA402_EMCY = 0x080,
    CIA402_TPDO = 0x180, /* + 0x100 for each further TPDO */
    CIA402_RPDO = 0x200,
    CIA402_SDO_REPLY = 0x580,
    CIA402_SDO_REQUEST = 0x600,
    CIA402_HEARTBEAT = 0x700,
    CIA402_LSS_REPLY = 0x7e4,
    CIA402_LSS_REQUEST = 0x7e5,
};

#define CIA402_COB_INVALID UINT32_C(0x80000000) /* bit 31 of a COB-ID object: disabled */

#define CIA402_COB_NO_REMOTE UINT32_C(0x40000000) /* bit 30: a TPDO ignores remote frames */

enum { CIA402_COB_MASK = 0x7ff };

enum { CIA402_SDO_LENGTH = 8, CIA402_EMCY_LENGTH = 8, CIA402_NMT_LENGTH = 2 };

/* Value of one count. */
#define CIA402_POSITION_RAD 1e-5 /* also for velocity, rad/s, and acceleration, rad/s2 */
#define CIA402_VOLTAGE_V 2e-3
#define CIA402_SPRING_NM 10e-3
#define CIA402_PRESSURE_BAR 0.01
#define CIA402_FORCE_N 0.1
#define CIA402_MOMENT_NM 10e-3
#define CIA402_ACCELERATION_M_S2 5e-3
#define CIA402_RATE_RAD_S 1e-3
#define CIA402_QUATERNION 1e-4
#define CIA402_MAGNETIC_UT 0.1

/* ---- network management ---- */

enum cia402_nmt_command {
    CIA402_NMT_START = 1,
    CIA402_NMT_STOP = 2,
    CIA402_NMT_PRE_OPERATIONAL = 128,
    CIA402_NMT_RESET_NODE = 129,
    CIA402_NMT_RESET_COMMUNICATION = 130,
};

enum cia402_nmt_state {
    CIA402_BOOT_UP = 0,
    CIA402_STOPPED = 4,
    CIA402_OPERATIONAL = 5,
    CIA402_PRE_OPERATIONAL = 127,
};

/* ---- service data objects ---- */

/* Byte 0: command specifier in bits 5-7 */
enum cia402_sdo {
    CIA402_DOWNLOAD_SEGMENT = 0x00, /* from here on: requests */
    CIA402_DOWNLOAD = 0x20,
    CIA402_UPLOAD = 0x40,
    CIA402_UPLOAD_SEGMENT = 0x60,
    CIA402_ABORT = 0x80,
    CIA402_BLOCK_UPLOAD = 0xa0,
    CIA402_BLOCK_DOWNLOAD = 0xc0,
    CIA402_UPLOAD_SEGMENT_REPLY = 0x00, /* answers */
    CIA402_DOWNLOAD_SEGMENT_REPLY = 0x20,
    CIA402_UPLOAD_REPLY = 0x40,
    CIA402_DOWNLOAD_REPLY = 0x60,
    CIA402_BLOCK_DOWNLOAD_REPLY = 0xa0,
    CIA402_BLOCK_UPLOAD_REPLY = 0xc0,
    CIA402_COMMAND_MASK = 0xe0,
    CIA402_TOGGLE = 0x10,
    CIA402_EXPEDITED = 0x02,
    CIA402_SIZED = 0x01,
    CIA402_LAST = 0x01, /* in requests and answers for segments: last segment */
};

/* CiA 301, table "SDO abort codes"; 0 = done */
enum cia402_abort {
    CIA402_DONE = 0,
    CIA402_ABORT_TOGGLE = 0x05030000,
    CIA402_ABORT_TIME_OUT = 0x05040000,
    CIA402_ABORT_COMMAND = 0x05040001,
    CIA402_ABORT_BLOCK_SIZE = 0x05040002,
    CIA402_ABORT_SEQUENCE = 0x05040003,
    CIA402_ABORT_CRC = 0x05040004,
    CIA402_ABORT_READ_ONLY = 0x06010002,
    CIA402_ABORT_NO_OBJECT = 0x06020000,
    CIA402_ABORT_NOT_MAPPABLE = 0x06040041,
    CIA402_ABORT_MAPPED_LENGTH = 0x06040042,
    CIA402_ABORT_LENGTH = 0x06070010,
    CIA402_ABORT_TOO_LONG = 0x06070012,
    CIA402_ABORT_TOO_SHORT = 0x06070013,
    CIA402_ABORT_NO_SUB_INDEX = 0x06090011,
    CIA402_ABORT_VALUE = 0x06090030,
    CIA402_ABORT_TOO_HIGH = 0x06090031,
    CIA402_ABORT_TOO_LOW = 0x06090032,
    CIA402_ABORT_STORE = 0x08000020,
    CIA402_ABORT_STATE = 0x08000022,
    CIA402_ABORT_NO_DATA = 0x08000024,
};

/* ---- layer setting services, CiA 305 ---- */

enum { CIA402_LSS_LENGTH = 8, CIA402_NO_NODE_ID = 255 /* a node without a Node-ID */ };

/* Byte 0 */
enum cia402_lss {
    CIA402_LSS_SWITCH_GLOBAL = 0x04,
    CIA402_LSS_SET_NODE_ID = 0x11,
    CIA402_LSS_SET_BIT_TIMING = 0x13,
    CIA402_LSS_ACTIVATE_BIT_TIMING = 0x15,
    CIA402_LSS_STORE = 0x17,
    CIA402_LSS_SELECT_VENDOR = 0x40, /* product, revision and serial number follow */
    CIA402_LSS_SELECT_SERIAL = 0x43,
    CIA402_LSS_SELECTED = 0x44,   /* answer */
    CIA402_LSS_IDENTIFIED = 0x4f, /* answer */
    CIA402_LSS_FASTSCAN = 0x51,
    CIA402_LSS_INQUIRE_VENDOR = 0x5a, /* product, revision and serial number follow */
    CIA402_LSS_INQUIRE_SERIAL = 0x5d,
    CIA402_LSS_INQUIRE_NODE_ID = 0x5e,
};

/* ---- drives ---- */

enum cia402_state {
    CIA402_NOT_READY,
    CIA402_SWITCH_ON_DISABLED,
    CIA402_READY_TO_SWITCH_ON,
    CIA402_SWITCHED_ON,
    CIA402_OPERATION_ENABLED,
    CIA402_QUICK_STOP_ACTIVE,
    CIA402_FAULT_REACTION_ACTIVE,
    CIA402_FAULT,
    CIA402_STATES,
};

enum cia402_controlword {
    CIA402_CW_SWITCH_ON = 1 << 0,
    CIA402_CW_ENABLE_VOLTAGE = 1 << 1,
    CIA402_CW_QUICK_STOP = 1 << 2, /* 0 = quick stop */
    CIA402_CW_ENABLE_OPERATION = 1 << 3,
    CIA402_CW_NEW_SET_POINT = 1 << 4, /* profile position; homing: start */
    CIA402_CW_AT_ONCE = 1 << 5,       /* profile position: change set immediately */
    CIA402_CW_RELATIVE = 1 << 6,
    CIA402_CW_FAULT_RESET = 1 << 7, /* acts on a rising edge */
    CIA402_CW_HALT = 1 << 8,

    CIA402_CW_SHUTDOWN = 0x06, /* commands of the controlword */
    CIA402_CW_SWITCH_ON_ONLY = 0x07,
    CIA402_CW_ENABLE = 0x0f,
};

enum cia402_statusword {
    CIA402_SW_VOLTAGE_ENABLED = 1 << 4,
    CIA402_SW_WARNING = 1 << 7,
    CIA402_SW_REMOTE = 1 << 9,
    CIA402_SW_TARGET_REACHED = 1 << 10,
    CIA402_SW_INTERNAL_LIMIT = 1 << 11,
    /* bit 12, by mode: set point acknowledged, speed 0, homed, follows the command */
    CIA402_SW_MODE_12 = 1 << 12,
    CIA402_SW_MODE_13 = 1 << 13, /* bit 13: following error or homing error */
    CIA402_SW_STATE_MASK = 0x6f,
    CIA402_SW_FAULT = 0x08, /* value of state FAULT after CIA402_SW_STATE_MASK */
};

enum cia402_mode {
    CIA402_VOLTAGE_MODE = -1, /* manufacturer's mode: 0x4000 sets the bridge voltage */
    CIA402_NO_MODE = 0,
    CIA402_PROFILE_POSITION = 1,
    CIA402_PROFILE_VELOCITY = 3,
    CIA402_TORQUE = 4,
    CIA402_HOMING = 6,
    CIA402_CYCLIC_POSITION = 8,
    CIA402_CYCLIC_VELOCITY = 9,
    CIA402_CYCLIC_TORQUE = 10,
};

/* Faults and warnings: bits of object 0x4010 and of EMCY. */
enum cia402_fault {
    CIA402_FAULT_UNDER_VOLTAGE = 1 << 0,
    CIA402_FAULT_OVER_VOLTAGE = 1 << 1,
    CIA402_FAULT_OVER_CURRENT = 1 << 2, /* I2t */
    CIA402_FAULT_MOTOR_ENCODER = 1 << 3,
    CIA402_FAULT_LINK_ENCODER = 1 << 4,
    CIA402_FAULT_TORQUE_SENSOR = 1 << 5,
    CIA402_FAULT_TEMPERATURE = 1 << 6,
    CIA402_FAULT_FOLLOWING = 1 << 7,
    /* heartbeat or guarding lost, if 0x6007 declares it a fault */
    CIA402_FAULT_CONNECTION = 1 << 8,
    CIA402_FAULT_STALE = 1 << 9,      /* warning: no command for the time 0x4011; the target is 0 */
    CIA402_FAULT_LIMIT = 1 << 10,     /* warning: beyond a software position limit */
    CIA402_FAULT_SATURATED = 1 << 11, /* sensors, warning: a channel is beyond its full scale */
    CIA402_FAULT_SENSOR = 1 << 12,    /* sensors, warning: a channel has no reading */
    CIA402_FAULT_UNDER_PRESSURE = 1 << 13, /* supply pressure of the axis's valve is too low */
    CIA402_FAULT_OVER_PRESSURE = 1 << 14,
};

/* Objects that hosts and messages use. Axis objects: index for axis 0. */
enum cia402_index {
    CIA402_O_DEVICE_TYPE = 0x1000,
    CIA402_O_HEARTBEAT = 0x1017,
    CIA402_O_RPDO_PARAMETER = 0x1400,
    CIA402_O_RPDO_MAPPING = 0x1600,
    CIA402_O_TPDO_PARAMETER = 0x1800,
    CIA402_O_TPDO_MAPPING = 0x1a00,
    CIA402_O_TARGET_VOLTAGE = 0x4000,
    CIA402_O_MOTOR_ENCODER = 0x4003,
    CIA402_O_DEFLECTION = 0x4004,
    CIA402_O_SPRING_TORQUE = 0x4005,
    CIA402_O_CONTROLWORD = 0x6040,
    CIA402_O_STATUSWORD = 0x6041,
    CIA402_O_MODE = 0x6060,
    CIA402_O_TARGET_POSITION = 0x607a,
    CIA402_O_CHANNEL = 0x7130, /* sensor nodes: process values as in CiA 404 */
};

/* Device type 0x1000: the profile is in the low word; bit 17 = servo drive. A node with several
 * axes has 0xffff in the high word, and the device type of axis k in 0x67ff + 0x800 k. */
#define CIA402_DEVICE_DRIVE UINT32_C(0x00020192)
#define CIA402_DEVICE_DRIVES UINT32_C(0xffff0192)
#define CIA402_DEVICE_SENSOR UINT32_C(0x00020194) /* CiA 404, analog inputs */

/* ---- PDO setup by the host of this program ---- */

enum cia402_kind { CIA402_KIND_DRIVE, CIA402_KIND_FT, CIA402_KIND_INERTIAL };

/* Setup of a PDO: the place of its parameters, and the values that the host writes there. */
struct cia402_plan {
    const char *name;
    bool receive;    /* the node receives it */
    uint8_t number;  /* from 0; parameters at 0x1400 + number, or 0x1800 + number */
    uint8_t type;    /* 1 = at every SYNC, 50 = at every 50th, 255 = on change */
    uint8_t axis;    /* axis of the data; CIA402_BOARD_AXES = all axes */
    uint8_t count;   /* number of objects */
    uint8_t length;  /* length in bytes */
    uint16_t cob_id; /* COB-ID without the Node-ID */
    uint16_t event_ms;
    /* mapped objects: index, sub-index and bits as in a mapping object */
    uint32_t object[CIA402_MAPPED_MAX];
};

enum { CIA402_STATUS_EVENT_MS = 100, CIA402_HEARTBEAT_MS = 100, CIA402_MAGNETIC_SYNCS = 50 };

/* Returns the value of a mapping object. */
static inline uint32_t cia402_mapping(unsigned index, unsigned sub, unsigned bits)
{
    return (uint32_t)index << 16 | (uint32_t)sub << 8 | bits;
}

/* Adds a two-byte object to a plan for each axis; `index` is the object of axis 0. */
static inline struct cia402_plan cia402_plan_axes(struct cia402_plan plan, unsigned axes,
                                                  unsigned index)
{
    plan.axis = CIA402_BOARD_AXES;
    plan.count = (uint8_t)axes;
    plan.length = (uint8_t)(2 * axes);
    for (unsigned k = 0; k < axes; k++) {
        plan.object[k] = cia402_mapping(index + CIA402_AXIS_STEP * k, 0, 16);
    }
    return plan;
}

/* Returns the plan of an axis's telemetry: encoder, deflection and spring torque. */
static inline struct cia402_plan cia402_plan_telemetry(unsigned axis)
{
    const unsigned step = CIA402_AXIS_STEP * axis;

    return (struct cia402_plan){
        .name = "TELEMETRY",
        .number = (uint8_t)(CIA402_PDO_STEP * axis),
        .type = 1,
        .axis = (uint8_t)axis,
        .count = 3,
        .length = 8,
        .cob_id = (uint16_t)(CIA402_TPDO + 0x100 * axis),
        .object = {cia402_mapping(CIA402_O_MOTOR_ENCODER + step, 0, 32),
                   cia402_mapping(CIA402_O_DEFLECTION + step, 0, 16),
                   cia402_mapping(CIA402_O_SPRING_TORQUE + step, 0, 16)},
    };
}

/* Returns a plan for `count` channels of a sensor node, from sub-index `first` on. */
static inline struct cia402_plan cia402_plan_channels(const char *name, unsigned number,
                                                      unsigned first, unsigned count, unsigned type)
{
    struct cia402_plan plan = {.name = name,
                               .number = (uint8_t)number,
                               .type = (uint8_t)type,
                               .axis = CIA402_BOARD_AXES,
                               .count = (uint8_t)count,
                               .length = (uint8_t)(2 * count),
                               .cob_id = (uint16_t)(CIA402_TPDO + 0x100 * number)};

    for (unsigned k = 0; k < count; k++) {
        plan.object[k] = cia402_mapping(CIA402_O_CHANNEL, first + k, 16);
    }
    return plan;
}

/*
 * Writes the plan of a node's PDO `row`, from 0. Returns false when there is no such PDO.
 *
 * At every SYNC a drive sends one frame per axis with its position. It sends the statuswords of all
 * axes in one frame when one of them changes. It receives the voltages of all axes in one frame and
 * their controlwords in another. The frame of the statuswords has the identifier 0x1c0 + n, because
 * the telemetry of the axes takes the four TPDO identifiers of the node.
 */
static inline bool cia402_plan_row(enum cia402_kind kind, unsigned axes, unsigned row,
                                   struct cia402_plan *plan)
{
    static const struct cia402_plan all[] = {
        {.name = "STATUS",
         .number = 1,
         .type = 255,
         .cob_id = 0x1c0,
         .event_ms = CIA402_STATUS_EVENT_MS},
        {.name = "VOLTAGE", .receive = true, .type = 255, .cob_id = CIA402_RPDO},
        {.name = "CONTROL",
         .receive = true,
         .number = 1,
         .type = 255,
         .cob_id = CIA402_RPDO + 0x100},
    };
    static const uint16_t of_all[] = {CIA402_O_STATUSWORD, CIA402_O_TARGET_VOLTAGE,
                                      CIA402_O_CONTROLWORD};

    /* Sensors */
    if (kind == CIA402_KIND_FT) {
        *plan = row == 0 ? cia402_plan_channels("FORCE", 0, 1, 3, 1)
                         : cia402_plan_channels("MOMENT", 1, 4, 3, 1);
        return row < 2;
    }
    if (kind == CIA402_KIND_INERTIAL) {
        *plan = row == 0   ? cia402_plan_channels("ACCELERATION", 0, 1, 3, 1)
                : row == 1 ? cia402_plan_channels("RATE", 1, 4, 3, 1)
                : row == 2 ? cia402_plan_channels("ORIENTATION", 2, 7, 4, 1)
                           : cia402_plan_channels("MAGNETIC", 3, 11, 3, CIA402_MAGNETIC_SYNCS);
        return row < 4;
    }

    /* Drives: telemetry of each axis; then statuswords, voltages and controlwords of all axes */
    if (row < axes) {
        *plan = cia402_plan_telemetry(row);
        return true;
    }
    if (row - axes < sizeof all / sizeof *all) {
        *plan = cia402_plan_axes(all[row - axes], axes, of_all[row - axes]);
        return true;
    }
    return false;
}

#endif
