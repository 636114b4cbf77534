/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The iCub CAN protocol, protocol icub (BLL/MC4 motor boards, STRAIN, inertial boards):
 * identifiers, commands, modes, frame types, scales. Boards and hosts share it; it has no behavior
 * and is RT-safe.
 *
 * 11-bit identifiers: class << 8 | source << 4 | x. x is the destination address (classes 0, 2, 7)
 * or the frame type (classes 1, 3, 5).
 */
#ifndef BOARDS_ICUB_PROTOCOL_H
#define BOARDS_ICUB_PROTOCOL_H

#include <stdint.h>

enum icub_class {
    ICUB_POLLING_MOTOR = 0,
    ICUB_PERIODIC_MOTOR = 1,
    ICUB_POLLING_ANALOG = 2,
    ICUB_PERIODIC_ANALOG = 3,
    ICUB_PERIODIC_INERTIAL = 5,
    ICUB_MANAGEMENT = 7,
};

enum { ICUB_HOST = 0, ICUB_EVERYONE = 15, ICUB_ADDRESS_MAX = 14 };

static inline uint32_t icub_id(enum icub_class cls, unsigned source, unsigned x)
{
    return (uint32_t)cls << 8 | (source & 0xf) << 4 | (x & 0xf);
}

/* Class 0, data[0] bits 0-6; bit 7 is the axis */
enum icub_motor_command {
    ICUB_TOGGLE_VERBOSE = 0x03,
    ICUB_CALIBRATE_ENCODER = 0x04,
    ICUB_GET_CONTROL_MODE = 0x07,
    ICUB_MOTION_DONE = 0x08,
    ICUB_SET_CONTROL_MODE = 0x09,
    ICUB_WRITE_FLASH = 0x0a,
    ICUB_READ_FLASH = 0x0b,
    ICUB_GET_INFO = 0x0c, /* additional information, also available in class 7 */
    ICUB_SET_INFO = 0x0d,
    ICUB_SET_SPEED_ESTIM_SHIFT = 0x0e,
    ICUB_GET_ENCODER_POSITION = 0x14,
    ICUB_SET_DESIRED_POSITION = 0x15,
    ICUB_GET_DESIRED_POSITION = 0x16,
    ICUB_SET_DESIRED_VELOCITY = 0x17,
    ICUB_GET_DESIRED_VELOCITY = 0x18,
    ICUB_SET_DESIRED_ACCELERATION = 0x19,
    ICUB_GET_DESIRED_ACCELERATION = 0x1a,
    ICUB_POSITION_MOVE = 0x1b,
    ICUB_VELOCITY_MOVE = 0x1c,
    ICUB_SET_ENCODER_POSITION = 0x1d,
    ICUB_SET_P_GAIN = 0x1e,
    ICUB_GET_P_GAIN = 0x1f,
    ICUB_SET_D_GAIN = 0x20,
    ICUB_GET_D_GAIN = 0x21,
    ICUB_SET_I_GAIN = 0x22,
    ICUB_GET_I_GAIN = 0x23,
    ICUB_SET_I_LIMIT = 0x24,
    ICUB_GET_I_LIMIT = 0x25,
    ICUB_SET_OFFSET = 0x26,
    ICUB_GET_OFFSET = 0x27,
    ICUB_SET_SCALE = 0x28,
    ICUB_GET_SCALE = 0x29,
    ICUB_SET_OUTPUT_LIMIT = 0x2a,
    ICUB_GET_OUTPUT_LIMIT = 0x2b,
    ICUB_SET_DESIRED_TORQUE = 0x2c,
    ICUB_GET_DESIRED_TORQUE = 0x2d,
    ICUB_STOP_TRAJECTORY = 0x2e,
    ICUB_SET_PWM_LIMIT = 0x2f,
    ICUB_GET_PWM_LIMIT = 0x30,
    ICUB_SET_BOARD_ID = 0x32,
    ICUB_GET_BOARD_ID = 0x33,
    ICUB_SET_TORQUE_SOURCE = 0x34,
    ICUB_GET_PID_ERROR = 0x37,
    ICUB_GET_POSITION_REFERENCE = 0x39,
    ICUB_GET_VELOCITY_REFERENCE = 0x3a,
    ICUB_GET_ERROR_STATUS = 0x3c,
    ICUB_GET_ENCODER_VELOCITY = 0x3d,
    ICUB_SET_COMMAND_POSITION = 0x3e,
    ICUB_GET_PID_OUTPUT = 0x3f,
    ICUB_SET_MIN_POSITION = 0x40,
    ICUB_GET_MIN_POSITION = 0x41,
    ICUB_SET_MAX_POSITION = 0x42,
    ICUB_GET_MAX_POSITION = 0x43,
    ICUB_SET_MAX_VELOCITY = 0x44,
    ICUB_GET_MAX_VELOCITY = 0x45,
    ICUB_SET_CURRENT_LIMIT = 0x48,
    ICUB_SET_BROADCAST_POLICY = 0x49,
    ICUB_SET_VELOCITY_SHIFT = 0x4a,
    ICUB_SET_TORQUE_PID = 0x4e,
    ICUB_GET_TORQUE_PID = 0x4f,
    ICUB_SET_TORQUE_PID_LIMITS = 0x50,
    ICUB_GET_TORQUE_PID_LIMITS = 0x51,
    ICUB_SET_POSITION_PID = 0x52,
    ICUB_GET_POSITION_PID = 0x53,
    ICUB_SET_POSITION_PID_LIMITS = 0x54,
    ICUB_GET_POSITION_PID_LIMITS = 0x55,
    ICUB_SET_VELOCITY_TIMEOUT = 0x56,
    ICUB_SET_IMPEDANCE = 0x57,
    ICUB_GET_IMPEDANCE = 0x58,
    ICUB_SET_IMPEDANCE_OFFSET = 0x59,
    ICUB_GET_IMPEDANCE_OFFSET = 0x5a,
    ICUB_GET_FIRMWARE_VERSION = 0x5b,
    ICUB_SET_POSITION_STICTION = 0x5d,
    ICUB_GET_POSITION_STICTION = 0x5e,
    ICUB_SET_TORQUE_STICTION = 0x5f,
    ICUB_GET_TORQUE_STICTION = 0x60,
    ICUB_SET_MOTOR_PARAMETERS = 0x61,
    ICUB_GET_MOTOR_PARAMETERS = 0x62,
    ICUB_SET_MODEL_PARAMETERS = 0x63,
    ICUB_GET_MODEL_PARAMETERS = 0x64,
    ICUB_SET_CURRENT_PID = 0x65,
    ICUB_GET_CURRENT_PID = 0x66,
    ICUB_SET_I2T = 0x70,
    ICUB_GET_I2T = 0x71,
    ICUB_SET_OPEN_LOOP = 0x72,
    ICUB_GET_OPEN_LOOP = 0x73,
    ICUB_SET_INTERACTION_MODE = 0x74,
    ICUB_GET_INTERACTION_MODE = 0x75,
    ICUB_SET_TORQUE_FILTER = 0x76,
    ICUB_GET_TORQUE_FILTER = 0x78,
    ICUB_SET_TEMPERATURE_LIMIT = 0x79,
    ICUB_GET_TEMPERATURE_LIMIT = 0x7a,
};

enum { ICUB_AXIS_BIT = 0x80 };
enum { ICUB_MOTOR_COMMANDS = 0x80 }; /* number of command codes */

/* data[1] of CALIBRATE_ENCODER; a BLL board supports only the absolute type */
enum icub_calibration {
    ICUB_CALIBRATE_HARD_STOPS = 0,
    ICUB_CALIBRATE_ANALOG = 1,
    ICUB_CALIBRATE_HARD_STOPS_DIFFERENTIAL = 2,
    ICUB_CALIBRATE_ABSOLUTE = 3,
    ICUB_CALIBRATE_ABSOLUTE_AND_INCREMENTAL = 4,
};

enum icub_interaction { ICUB_STIFF = 0, ICUB_COMPLIANT = 1 };

/* data[1] of SET_CONTROL_MODE, bytes 1 and 3 of STATUS */
enum icub_mode {
    ICUB_MODE_IDLE = 0x00,
    ICUB_MODE_POSITION = 0x01,
    ICUB_MODE_VELOCITY = 0x02,
    ICUB_MODE_TORQUE = 0x03,
    ICUB_MODE_IMPEDANCE_POSITION = 0x04,
    ICUB_MODE_IMPEDANCE_VELOCITY = 0x05,
    ICUB_MODE_CURRENT = 0x06,
    ICUB_MODE_MIXED = 0x07,
    ICUB_MODE_DIRECT = 0x08,
    ICUB_MODE_FORCE_IDLE = 0x09, /* command only */
    ICUB_MODE_SPEED_VOLTAGE = 0x0a,
    ICUB_MODE_SPEED_CURRENT = 0x0b,
    ICUB_MODE_OPEN_LOOP = 0x50,
    ICUB_MODE_CALIBRATION = 0x60,
    ICUB_MODE_HARDWARE_FAULT = 0xa0,
    ICUB_MODE_NOT_CONFIGURED = 0xb0,
    ICUB_MODE_CONFIGURED = 0xb1,
    ICUB_MODE_UNKNOWN = 0xff,
};

/* Class 1 frame types; bit type - 1 of the broadcast policy selects a type */
enum icub_motor_type {
    ICUB_POSITION = 1,
    ICUB_PID_VALUE = 2,
    ICUB_STATUS = 3,
    ICUB_CURRENT = 4,
    ICUB_OVERFLOW = 5,
    ICUB_PRINT = 6,
    ICUB_VELOCITY = 7,
    ICUB_PID_ERROR = 8,
    ICUB_DEBUG = 9,
    ICUB_MOTOR_POSITION = 10,
    ICUB_MOTOR_SPEED = 11,
    ICUB_ADDITIONAL_STATUS = 12,
};

/* STATUS byte 0 and 2 */
enum icub_fault {
    ICUB_FAULT_UNDER_VOLTAGE = 1 << 0,
    ICUB_FAULT_OVER_VOLTAGE = 1 << 1,
    ICUB_FAULT_EXTERNAL = 1 << 2,
    ICUB_FAULT_OVER_CURRENT = 1 << 3,
    ICUB_FAULT_ABSOLUTE_ENCODER = 1 << 5,
};

/* STATUS byte 4 */
enum icub_can_status {
    ICUB_CAN_TX_OVERFLOW = 1 << 0,
    ICUB_CAN_BUS_OFF = 1 << 1,
    ICUB_CAN_TX_ERROR = 1 << 2,
    ICUB_CAN_RX_ERROR = 1 << 3,
    ICUB_CAN_RX_WARNING = 1 << 5,
};

/* STATUS byte 5 */
enum icub_board_status {
    ICUB_BOARD_OVER_TEMPERATURE_0 = 1 << 1, /* axis 0 */
    ICUB_BOARD_OVER_TEMPERATURE_1 = 1 << 2,
    ICUB_BOARD_TEMPERATURE_ERROR_0 = 1 << 3,
    ICUB_BOARD_TEMPERATURE_ERROR_1 = 1 << 4,
};

/* Worth of a temperature count, in SET_TEMPERATURE_LIMIT and in protocol foc. On real boards it
 * depends on the thermometer. */
#define ICUB_TEMPERATURE_C 0.1

enum { ICUB_SLOTS = 4 }; /* slots of 1 ms for the periodic frames of a BLL board */
enum { ICUB_STATUS_PERIOD_MS = 5000 };
enum {
    ICUB_PRINT_TEXTS = 4
    /* PRINT texts are numbered modulo this number; hosts drop texts with other numbers */
};
enum {
    ICUB_STRAIN_SAFE_MS = 200
    /* A torque loop stops if its torque source has sent no frame for this time */
};
enum { ICUB_PWM_FULL_SCALE = 1333 }; /* open-loop reference for 100 % of the supply */

/* Class 2, data[0] */
enum icub_strain_command {
    ICUB_STRAIN_SET_FILTER = 0x01,
    ICUB_STRAIN_SET_MATRIX = 0x03,
    ICUB_STRAIN_SET_DAC = 0x04,
    ICUB_STRAIN_SET_CHANNELS = 0x05,
    ICUB_STRAIN_CALIBRATE = 0x06,
    ICUB_STRAIN_SET_TRANSMIT_MODE = 0x07,
    ICUB_STRAIN_SET_PERIOD = 0x08,
    ICUB_STRAIN_SAVE = 0x09,
    ICUB_STRAIN_GET_MATRIX = 0x0a,
    ICUB_STRAIN_GET_DAC = 0x0b,
    ICUB_STRAIN_GET_ADC = 0x0c,
    ICUB_STRAIN_SET_MATRIX_GAIN = 0x11,
    ICUB_STRAIN_GET_MATRIX_GAIN = 0x12,
    ICUB_STRAIN_SET_CALIBRATION_TARE = 0x13,
    ICUB_STRAIN_GET_CALIBRATION_TARE = 0x14,
    ICUB_STRAIN_SET_CURRENT_TARE = 0x15,
    ICUB_STRAIN_GET_CURRENT_TARE = 0x16,
    ICUB_STRAIN_SET_FULL_SCALE = 0x17,
    ICUB_STRAIN_GET_FULL_SCALE = 0x18,
    ICUB_STRAIN_SET_SERIAL = 0x19,
    ICUB_STRAIN_GET_SERIAL = 0x1a,
    ICUB_STRAIN_EEPROM_SAVED = 0x1b,
    ICUB_STRAIN_GET_FIRMWARE = 0x1c,
    ICUB_STRAIN_SET_ADDRESS = 0x32,
};

enum { ICUB_STRAIN_COMMANDS = 0x40 }; /* number of command codes */

/* data[1] of the SET tare commands */
enum icub_tare { ICUB_TARE_RESET = 0, ICUB_TARE_AUTOMATIC = 1, ICUB_TARE_VALUE = 2 };

/* A channel is in offset binary: 0x8000 = 0, 0x8000 counts = full scale. Raw readings below LOW or
 * above HIGH are saturated; frames are then one byte longer. */
enum {
    ICUB_STRAIN_ZERO = 0x8000,
    ICUB_STRAIN_LOW = 1000,
    ICUB_STRAIN_HIGH = 64000,
    ICUB_STRAIN_LENGTH = 6,
    ICUB_STRAIN_SATURATED_LENGTH = 7,
};

enum icub_strain_transmit {
    ICUB_STRAIN_CALIBRATED = 0,
    ICUB_STRAIN_SILENT = 1,
    ICUB_STRAIN_UNCALIBRATED = 3,
    ICUB_STRAIN_BOTH = 4,
};

/* Class 3 frame types */
enum icub_analog_type {
    ICUB_UNCALIBRATED_FORCE = 0x8,
    ICUB_UNCALIBRATED_TORQUE = 0x9,
    ICUB_FORCE = 0xa,
    ICUB_TORQUE = 0xb,
};

/* Class 2 of inertial boards, data[0]. These boards also support GET_FIRMWARE and SET_ADDRESS of
 * class 2 above. Numbers are little-endian. */
enum icub_inertial_command {
    ICUB_INERTIAL_GET_CONFIG = 0x33,
    /* u16 mask with bit = sensor, u8 fusion, u32 ranges; ranges may be omitted */
    ICUB_INERTIAL_SET_CONFIG = 0x34,
    ICUB_INERTIAL_TRANSMIT = 0x35, /* u8 period in ms, 0 stops */
};

/* Any other value of fusion means ON. */
enum icub_fusion { ICUB_FUSION_ON = 1, ICUB_FUSION_OFF = 33 };

enum icub_inertial_sensor {
    ICUB_SENSOR_ACCELERATION = 0, /* specific force: 9.81 m/s2 up at rest */
    ICUB_SENSOR_MAGNETIC = 1,
    ICUB_SENSOR_GYRO = 2,
    ICUB_SENSOR_EULER = 3,      /* roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll) */
    ICUB_SENSOR_QUATERNION = 4, /* sent in its own frame type */
    ICUB_SENSOR_LINEAR = 5,     /* acceleration minus gravity */
    ICUB_SENSOR_GRAVITY = 6,    /* 9.81 m/s2 up, in the sensor's axes */
    /* x: u8, two bits each for magnetometer, accelerometer, gyro and system, 3 = calibrated; y:
     * mask of sensors beyond their range; z: mask of sensors without a reading */
    ICUB_SENSOR_STATUS = 15,
    ICUB_INERTIAL_SENSORS = 16,
};

enum { ICUB_CALIBRATED = 3 };

/* Class 5 frame types */
enum icub_inertial_type {
    ICUB_INERTIAL_TRIPLE = 3,     /* sequence, sensor, x, y, z */
    ICUB_INERTIAL_QUATERNION = 4, /* w, x, y, z: from sensor to world, w >= 0 */
};

enum { ICUB_INERTIAL_LENGTH = 8 };

/* Value of one count. Assumed (D): equal to the sensor chip on iCub's boards */
#define ICUB_ACCELERATION_M_S2 0.01
#define ICUB_MAGNETIC_UT 0.0625
#define ICUB_INERTIAL_DEG 0.0625 /* gyro in degree/s, Euler angles in degree */
#define ICUB_QUATERNION 0x1p-14

/* Class 7, data[0] */
enum icub_management_command {
    ICUB_START_UPDATE = 0x00,
    ICUB_UPDATE_ADDRESS = 0x01,
    ICUB_UPDATE_RUN = 0x02,
    ICUB_UPDATE_DATA = 0x03,
    ICUB_UPDATE_END = 0x04, /* leaves the bootloader; the application only acknowledges it */
    ICUB_GET_ADDITIONAL_INFO = 0x0c,
    ICUB_SET_ADDITIONAL_INFO = 0x0d,
    ICUB_SET_CAN_ADDRESS = 0x32,
    ICUB_DISCOVER = 0xff,
};

enum { ICUB_INFO_LENGTH = 32, ICUB_INFO_PART = 4, ICUB_SERIAL_LENGTH = 7 };
/* Time from power-up until the application starts. A host that discovers the bootloader before
 * stops this timer */
enum { ICUB_BOOTLOADER_MS = 5000 };

enum { ICUB_BOARD_DSP = 0, ICUB_BOARD_BLL = 4, ICUB_BOARD_STRAIN = 6, ICUB_BOARD_RFE = 13 };
enum {
    ICUB_PROTOCOL_MAJOR = 1,
    ICUB_PROTOCOL_MINOR = 6
    /* version of the motor protocol */
};
enum { ICUB_STRAIN_PROTOCOL_MAJOR = 1, ICUB_STRAIN_PROTOCOL_MINOR = 0 };

#endif
