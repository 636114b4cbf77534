/* SPDX-License-Identifier: Apache-2.0 */
/* Time between a board's set point and its bridge: voltages reach the drives some ticks after the
 * boards have computed them. */
#include "boards/board_private.h"

/* Rows of voltages by joint, V: the newest is what the boards set last, the row behind it the
 * oldest, which the bridges have. */
struct voltage_delay {
    size_t rows, newest, njoint;
    double *row;
};

/* Returns the row that many ticks before the newest. */
static double *delay_row(const struct voltage_delay *delay, size_t ticks)
{
    return &delay->row[(delay->newest + delay->rows - ticks) % delay->rows * delay->njoint];
}

bool voltage_delay_create(struct boards *boards, const struct boards_config *config,
                          struct arena *arena)
{
    struct voltage_delay *delay;

    if (config->voltage_delay_ticks == 0) {
        return true;
    }
    boards->delay = delay = arena_alloc(arena, 1, sizeof *delay);
    if (!delay) {
        return false;
    }
    delay->rows = config->voltage_delay_ticks + 1;
    delay->njoint = config->njoint;
    delay->row = arena_alloc(arena, delay->rows * (config->njoint + 1), sizeof *delay->row);
    return delay->row;
}

/* Copies the voltages of all joints that our boards drive: from a row, or (back) into it. */
static void delay_copy(const struct boards *boards, double *row, bool back,
                       struct plant_command *command)
{
    for (size_t i = 0; i < boards->nboard; i++) {
        const struct board *board = boards->board[i];

        for (size_t axis = 0; axis < BOARD_AXES_MAX && !board->config.external; axis++) {
            const int joint = board_joint(board, axis);

            if (joint >= 0 && back) {
                row[joint] = command->motor[joint].voltage_v;
            } else if (joint >= 0) {
                command->motor[joint].voltage_v = row[joint];
            }
        }
    }
}

void voltage_delay_begin(struct boards *boards, struct plant_command *command)
{
    if (boards->delay) {
        delay_copy(boards, delay_row(boards->delay, 0), false, command);
    }
}

void voltage_delay_end(struct boards *boards, struct plant_command *command)
{
    struct voltage_delay *delay = boards->delay;

    if (delay) {
        delay->newest = (delay->newest + 1) % delay->rows;
        delay_copy(boards, delay_row(delay, 0), true, command);
        delay_copy(boards, delay_row(delay, delay->rows - 1), false, command);
    }
}
