/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The compact protocol: ours, made for a voltage loop of 1 kHz on one wire, classic CAN or CAN FD.
 * It carries what COMAN's own boards say over Ethernet (RoboLLI), in their units as far as the bits
 * allow. Shared by the boards and by hosts; holds no behavior, so that all of it is RT-safe.
 * Numbers are little-endian, bit fields fill each byte from its least significant bit.
 *
 * A board is a NODE, 1 to 31. The axes of a bus are numbered through from 0 to 31, in the order of
 * the boards in the rig and of the axes of each: an axis's SLOT. IDENTITY tells a board's first
 * slot. 11-bit identifiers: function << 5 | number, the number being a slot, a group of four slots
 * or a node; a lower identifier wins the bus, so that commands come first.
 *
 *   function           number  from   length            when
 *   0x01 MODE          0       host   5                 on demand; always obeyed at once
 *   0x02 COMMAND       group   host   2-8 even; FD -64  every control period
 *   0x08 TELEMETRY     slot    board  8                 every telemetry period (classic bus)
 *   0x09 TELEMETRY_FD  node    board  16 an axis        every telemetry period (FD bus)
 *   0x0a FORCE         node    board  6                 every telemetry period (classic bus)
 *   0x0b MOMENT        node    board  6                 right after FORCE
 *   0x0c WRENCH_FD     node    board  12                every telemetry period (FD bus)
 *   0x0d ACCELERATION  node    board  6                 every telemetry period (classic bus)
 *   0x0e RATE          node    board  6                 right after ACCELERATION
 *   0x0f ORIENTATION   node    board  8                 right after RATE
 *   0x10 STATE         slot    board  8                 every 50 ms, and on a new mode or fault
 *   0x11 FT_STATE      node    board  8                 every 50 ms, and on a change of fault
 *   0x12 INERTIAL_FD   node    board  32                every telemetry period (FD bus)
 *   0x13 MAGNETIC      node    board  6                 with INERTIAL_STATE (classic bus)
 *   0x14 INERTIAL_STATE node   board  8                 every 50 ms, and on a change of fault
 *   0x34 REQUEST       node    host   2 read, 6 write   on demand
 *   0x35 REPLY         node    board  7                 after each REQUEST
 *   0x3e IDENTITY      node    board  8                 after DISCOVER and when a board has started
 *   0x3f DISCOVER      0       host   0                 on demand
 *
 * MODE          0: u8 mode; 1: u32 slots, bit i = slot i
 * COMMAND       2i: i16 set-point of slot 4 g + i: in voltage mode 2 mV a count (+-65.5 V), in
 *               current mode 1 mA. A short frame leaves the slots behind its end alone; on FD buses
 *               group 0 reaches all 32 slots. Zero bytes that only fill an FD length up are slots
 *               that do not exist.
 * TELEMETRY     bits 0-21  i22 motor position (link side of the gear), 1e-5 rad (+-20.97 rad)
 *               bits 22-37 i16 deflection: motor - link position, 1e-5 rad (+-0.327 rad)
 *               bits 38-49 i12 current, 10 mA (+-20.47 A)
 *               bits 50-61 i12 joint torque, 32 mN m (+-65.5 N m)
 *               bits 62-63 u2  sequence, one up with every frame
 * TELEMETRY_FD  for each axis of the board, at 16 k:
 *               0: i32 motor position, 1e-5 rad; 4: i32 link position, 1e-5 rad;
 *               8: i16 motor velocity, mrad/s; 10: i16 current, mA; 12: i24 joint torque, mN m;
 *               15: u8 bits 0-2 mode, bit 3 a fault is present, bits 4-7 sequence
 * FORCE, MOMENT 0, 2, 4: i16 x, y, z; 0.1 N and 2 mN m a count
 * WRENCH_FD     FORCE, then MOMENT in one frame
 * ACCELERATION  0, 2, 4: i16 x, y, z of the specific force, 5 mm/s2 (at rest 9.81 m/s2 up)
 * RATE          0, 2, 4: i16 x, y, z of the angular velocity, 1 mrad/s (+-32.7 rad/s)
 * ORIENTATION   0, 2, 4, 6: i16 quaternion w, x, y, z, 2^-14: from the sensor's axes to the
 *               world's, w not negative; 0 0 0 0: not known
 * INERTIAL_FD   ACCELERATION, RATE, ORIENTATION and MAGNETIC; 26, 28, 30: i16 roll, pitch, yaw,
 *               1e-4 rad: R = Rz(yaw) Ry(pitch) Rx(roll)
 * MAGNETIC      0, 2, 4: i16 x, y, z of the magnetic field, 0.1 uT
 * INERTIAL_STATE as FT_STATE; channels: acceleration x, y, z, rate x, y, z. Euler angles, gravity
 *               and linear acceleration follow from ORIENTATION and ACCELERATION
 * STATE         byte 0: bits 0-2 mode, bits 4-7 number of set-points taken, modulo 16;
 *               1: u16 faults; 3: u16 supply, mV; 5: i8 temperature of the motor, degree C;
 *               6: i16 bridge voltage, 2 mV
 * FT_STATE      0: u8 saturated channels, bit 0 = Fx ... bit 5 = Mz; 1: u16 faults; 3: u16 supply,
 *               mV; 5: i8 temperature, degree C; 6: u16 frames sent, modulo 65536
 * REQUEST       0: u8 parameter, bit 7 = write; 1: u8 axis of the board (F/T: channel);
 *               2: i32 value, only when it writes
 * REPLY         0, 1 as in the request; 2: i32 value now in force; 6: u8 result
 * IDENTITY      0: u8 kind; 1: u8 axes (others: 0); 2: u8 first slot; 3: u8 protocol version;
 *               4: u8 firmware major; 5: u8 minor; 6: u16 build
 *
 * All values saturate at the ends of their fields. A value that is out of the sensor's range is
 * held, and the fault bit says so.
 *
 * Modes: OFF opens the bridge. VOLTAGE and CURRENT close it with set-point 0, the other's set-point
 * forgotten. A fault puts the axis into FAULT, bridge open, until MODE OFF, which clears it when
 * its cause is gone; other modes are ignored in FAULT. A set-point older than the command time-out
 * becomes 0 (the winding is short-circuited and brakes) and COMPACT_FAULT_STALE is set, without
 * leaving the mode, until the next COMMAND.
 */
#ifndef BOARDS_COMPACT_PROTOCOL_H
#define BOARDS_COMPACT_PROTOCOL_H

#include <stdint.h>

enum compact_function {
    COMPACT_MODE = 0x01,
    COMPACT_COMMAND = 0x02,
    COMPACT_TELEMETRY = 0x08,
    COMPACT_TELEMETRY_FD = 0x09,
    COMPACT_FORCE = 0x0a,
    COMPACT_MOMENT = 0x0b,
    COMPACT_WRENCH_FD = 0x0c,
    COMPACT_ACCELERATION = 0x0d,
    COMPACT_RATE = 0x0e,
    COMPACT_ORIENTATION = 0x0f,
    COMPACT_STATE = 0x10,
    COMPACT_FT_STATE = 0x11,
    COMPACT_INERTIAL_FD = 0x12,
    COMPACT_MAGNETIC = 0x13,
    COMPACT_INERTIAL_STATE = 0x14,
    COMPACT_REQUEST = 0x34,
    COMPACT_REPLY = 0x35,
    COMPACT_IDENTITY = 0x3e,
    COMPACT_DISCOVER = 0x3f,
};

enum {
    COMPACT_NODE_MAX = 31,
    COMPACT_SLOTS = 32,
    COMPACT_GROUP = 4,      /* slots of a classic COMMAND */
    COMPACT_BOARD_AXES = 4, /* axes of a board at most: one FD frame */
};

static inline uint32_t compact_id(enum compact_function function, unsigned number)
{
    return (uint32_t)function << 5 | (number & 0x1f);
}

enum {
    COMPACT_MODE_LENGTH = 5,
    COMPACT_TELEMETRY_LENGTH = 8,
    COMPACT_TELEMETRY_FD_LENGTH = 16, /* an axis */
    COMPACT_FORCE_LENGTH = 6,         /* MOMENT too */
    COMPACT_WRENCH_FD_LENGTH = 12,
    COMPACT_ACCELERATION_LENGTH = 6, /* RATE and MAGNETIC too */
    COMPACT_ORIENTATION_LENGTH = 8,
    COMPACT_INERTIAL_FD_LENGTH = 32,
    COMPACT_STATE_LENGTH = 8, /* FT_STATE and INERTIAL_STATE too */
    COMPACT_READ_LENGTH = 2,
    COMPACT_WRITE_LENGTH = 6,
    COMPACT_REPLY_LENGTH = 7,
    COMPACT_IDENTITY_LENGTH = 8,
};

/* What a count is worth. */
#define COMPACT_VOLTAGE_V 2e-3
#define COMPACT_SET_CURRENT_A 1e-3 /* COMMAND, TELEMETRY_FD */
#define COMPACT_POSITION_RAD 1e-5
#define COMPACT_CURRENT_A 10e-3 /* TELEMETRY */
#define COMPACT_TORQUE_NM 32e-3 /* TELEMETRY */
#define COMPACT_TORQUE_FD_NM 1e-3
#define COMPACT_VELOCITY_RAD_S 1e-3
#define COMPACT_FORCE_N 0.1
#define COMPACT_MOMENT_NM 2e-3
#define COMPACT_ACCELERATION_M_S2 5e-3
#define COMPACT_RATE_RAD_S 1e-3
#define COMPACT_QUATERNION 0x1p-14
#define COMPACT_MAGNETIC_UT 0.1
#define COMPACT_EULER_RAD 1e-4
#define COMPACT_SUPPLY_V 1e-3

enum compact_mode {
    COMPACT_OFF = 0,
    COMPACT_VOLTAGE = 1,
    COMPACT_CURRENT = 2,
    COMPACT_FAULT = 7, /* reported, never commanded */
};

enum compact_fault {
    COMPACT_FAULT_UNDER_VOLTAGE = 1 << 0,
    COMPACT_FAULT_OVER_VOLTAGE = 1 << 1,
    COMPACT_FAULT_OVER_CURRENT = 1 << 2, /* I2t */
    COMPACT_FAULT_MOTOR_ENCODER = 1 << 3,
    COMPACT_FAULT_LINK_ENCODER = 1 << 4,
    COMPACT_FAULT_TORQUE_SENSOR = 1 << 5,
    COMPACT_FAULT_TEMPERATURE = 1 << 6,
    COMPACT_FAULT_STALE = 1 << 7,      /* no COMMAND for the time-out; a warning: the mode stays */
    COMPACT_FAULT_LIMIT = 1 << 8,      /* beyond a position limit; a warning: only set-points that
                                      * lead back are obeyed */
    COMPACT_FAULT_OVERFLOW = 1 << 9,   /* frames were lost; a warning, reported once */
    COMPACT_FAULT_SATURATED = 1 << 10, /* F/T, inertial: a channel is beyond its full scale; a
                                        * warning */
    COMPACT_FAULT_INERTIAL = 1 << 11,  /* a channel or the orientation has no reading; a warning */
};

enum { COMPACT_STATE_PERIOD_MS = 50 };

enum { COMPACT_WRITE = 0x80 };

/* REQUEST and REPLY byte 0; r = read only. Unit of the value in brackets. */
enum compact_parameter {
    COMPACT_P_KIND = 0,             /* r, enum compact_kind */
    COMPACT_P_FIRMWARE = 1,         /* r, major << 24 | minor << 16 | build */
    COMPACT_P_SERIAL = 2,           /* r */
    COMPACT_P_FIRST_SLOT = 3,       /* r */
    COMPACT_P_UPTIME = 4,           /* r [ms] since the application started */
    COMPACT_P_TELEMETRY_PERIOD = 5, /* [ms] 0 = silent, 1-255; of the board */
    COMPACT_P_COMMAND_TIMEOUT = 6,  /* [ms] 0 = none, up to 60000; of the board */
    COMPACT_P_RESTART = 7,          /* write 1: restart; reads 0 */
    COMPACT_P_SAVE = 8,             /* write 1: keep the settings over a restart; reads 1 if kept */
    COMPACT_P_MODE = 16,            /* r, enum compact_mode */
    COMPACT_P_FAULTS = 17,          /* r, enum compact_fault */
    COMPACT_P_CURRENT_LIMIT = 18,   /* [mA] of the I2t and of set-points, 1 up to the board's own */
    COMPACT_P_MIN_POSITION = 19,    /* [1e-5 rad] link side */
    COMPACT_P_MAX_POSITION = 20,    /* [1e-5 rad] */
    COMPACT_P_CURRENT_KP = 21,      /* [mV/A] 0-1000000 */
    COMPACT_P_CURRENT_KI = 22,      /* [mV/(A s)] */
    COMPACT_P_BACK_EMF = 23,        /* [mV s/rad], motor velocity on the link side */
    COMPACT_P_TEMPERATURE_LIMIT = 24, /* [degree C] of the winding, 1 up to the board's own */
    COMPACT_P_FULL_SCALE = 32,        /* F/T [mN, mN m] of a channel, up to the sensor's own */
    COMPACT_P_TARE = 33,              /* F/T [counts of FORCE/MOMENT] added to a channel; write 0 to
                                     * channel 255: all to 0, 1: the present reading to 0 */
};

/* The first two as RoboLLI numbers them */
enum compact_kind { COMPACT_KIND_MOTOR = 2, COMPACT_KIND_FT = 3, COMPACT_KIND_INERTIAL = 4 };

/* REPLY byte 6 */
enum compact_result {
    COMPACT_OK = 0,
    COMPACT_UNKNOWN_PARAMETER = 1,
    COMPACT_NO_SUCH_AXIS = 2,
    COMPACT_OUT_OF_RANGE = 3,
    COMPACT_READ_ONLY = 4,
    COMPACT_WRONG_LENGTH = 5,
    COMPACT_NOT_NOW = 6, /* the axis is on */
};

enum { COMPACT_PROTOCOL_VERSION = 1 };

#endif
