/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Every message of protocol foc as a table row (boards/icub/table.h). Most commands have no answer.
 * Immutable; RT-safe.
 */
#ifndef BOARDS_FOC_TABLE_H
#define BOARDS_FOC_TABLE_H

#include "boards/foc/protocol.h"
#include "boards/icub/table.h"

enum { FOC_PID_FIELDS = 4 }; /* kp, ki, kd, shift */

/* Settings of a board that a host reads by rows of kind ICUB_GET. Those of one message have
 * consecutive numbers; those of loops follow enum foc_pid_loop. */
enum foc_parameter {
    FOC_P_CURRENT_PID,
    FOC_P_VELOCITY_PID = FOC_P_CURRENT_PID + FOC_PID_FIELDS,
    FOC_P_POSITION_PID = FOC_P_VELOCITY_PID + FOC_PID_FIELDS,
    FOC_P_CURRENT_LIMITS = FOC_P_POSITION_PID + FOC_PID_FIELDS, /* stored without effect */
    FOC_P_VELOCITY_LIMITS = FOC_P_CURRENT_LIMITS + 3,
    FOC_P_POSITION_LIMITS = FOC_P_VELOCITY_LIMITS + 3,
    FOC_P_NOMINAL = FOC_P_POSITION_LIMITS + 3, /* mA */
    FOC_P_PEAK,
    FOC_P_OVERLOAD,
    FOC_P_FLAGS, /* as the host has set them */
    FOC_P_RESOLUTION,
    FOC_P_INDEX_OFFSET,
    FOC_P_POLES,
    FOC_P_TOLERANCE,
    FOC_P_TEMPERATURE_LIMIT, /* raw counts; 0 = none */
    FOC_P_COUNT,
};

extern const struct icub_command foc_commands[ICUB_MOTOR_COMMANDS]; /* class 0 */
extern const struct icub_frame_type foc_frames[16];                 /* class 1 */

#endif
