/* SPDX-License-Identifier: Apache-2.0 */
/* The state of a moteus, shared by the sources that are its parts. Units are those of its
 * registers: turns of the output, turns/s, N m, A, V, s. RT-safe. */
#ifndef BOARDS_MOTEUS_PRIVATE_H
#define BOARDS_MOTEUS_PRIVATE_H

#include "base/hash.h"
#include "boards/board_private.h"
#include "boards/moteus/table.h"

/* The path from the control position to the commanded one. NaN: no position is commanded, or the
 * path has not begun. */
struct moteus_path {
    double position, velocity; /* of control */
    double target;
    bool done;
};

struct moteus_board {
    struct board board;
    struct axis axis;
    double value[MOTEUS_REGISTERS]; /* what a register shows, by its number */
    double commanded_mode;          /* what was written into that of the mode */

    /* The command in force: its registers as they were when its frame ended, and what the defaults
     * make of the limits. Its mode is reached as soon as the board can */
    double command[MOTEUS_R_STAY_UPPER + 1];
    double wanted_mode, velocity_limit, acceleration_limit;
    double timeout_s; /* until the command is no longer valid; NaN: never */
    int enabling_ms;  /* until the drive is ready for its first command */
    struct moteus_path path;

    /* Configuration of the controller */
    double kp, kd; /* N m / turn, N m s / turn */
    double kp_v_a, ki_v_as, torque_nm_a;
    double zero; /* motor position that is shown as 0 */

    double motor, velocity, before; /* position of the motor, its speed, position a sample ago */
    double integral_v;
};

static inline struct moteus_board *moteus_board_of(const struct board *board)
{
    return container_of(board, struct moteus_board, board);
}

static inline enum moteus_mode moteus_mode(const struct moteus_board *moteus)
{
    return (enum moteus_mode)moteus->value[MOTEUS_R_MODE];
}

struct board_bus *moteus_bus_create(struct arena *arena);
struct board *moteus_make_board(const struct board_config *config, struct arena *arena);

#endif
