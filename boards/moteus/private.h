/* SPDX-License-Identifier: Apache-2.0 */
/* The state of a moteus board. Units are those of its registers: turns of the output, turns/s, N m,
 * A, V, s. RT-safe. */
#ifndef BOARDS_MOTEUS_PRIVATE_H
#define BOARDS_MOTEUS_PRIVATE_H

#include "base/hash.h"
#include "boards/board_private.h"
#include "boards/moteus/table.h"

/* The path of the control position to the commanded position. position is NaN before the path
 * starts. target is NaN if no position is commanded. */
struct moteus_path {
    double position, velocity; /* control position and velocity */
    double target;
    bool done;
};

struct moteus_board {
    struct board board;
    struct axis axis;
    double value[MOTEUS_REGISTERS]; /* value that each register shows */
    double commanded_mode;          /* value written to the mode register */

    /* The command in force: a copy of the registers after its frame, with default limits. The board
     * enters the command's mode when it is ready */
    double command[MOTEUS_R_STAY_UPPER + 1];
    double wanted_mode, velocity_limit, acceleration_limit;
    double timeout_s; /* remaining time until the command expires; NaN = it never expires */
    /* remaining time until the drive is ready for its first command */
    int enabling_ms;
    struct moteus_path path;

    /* Configuration of the controller */
    double kp, kd; /* N m / turn, N m s / turn */
    double torque_nm_a;
    double zero; /* motor position that the registers show as 0 */

    /* motor position and velocity; motor position one sample ago */
    double motor, velocity, before;
    double link_before; /* link position one sample ago */
};

static inline struct moteus_board *moteus_board_of(const struct board *board)
{
    return container_of(board, struct moteus_board, board);
}

static inline enum moteus_mode moteus_mode(const struct moteus_board *moteus)
{
    return (enum moteus_mode)moteus->value[MOTEUS_R_MODE];
}

extern const struct board_ops moteus_ops;
extern const struct board_bus_ops moteus_bus_ops;

#endif
