/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Every message of protocol foc as a table row (boards/icub/table.h). Most commands have no answer.
 * Immutable; RT-safe.
 */
#ifndef BOARDS_FOC_TABLE_H
#define BOARDS_FOC_TABLE_H

#include "boards/foc/protocol.h"
#include "boards/icub/table.h"

extern const struct icub_command foc_commands[ICUB_MOTOR_COMMANDS]; /* class 0 */
extern const struct icub_frame_type foc_frames[16];                 /* class 1 */

#endif
