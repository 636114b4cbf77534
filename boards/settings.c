/* SPDX-License-Identifier: Apache-2.0 */
/* The settings of all axes, whatever the boards speak. */
#include "boards/board_private.h"

#include <math.h>

/* Returns a board by its index in the configuration. */
static const struct board *boards_board_at(const struct boards *boards, size_t board)
{
    return boards->board[board];
}

size_t boards_settings(const struct boards *boards, size_t board, size_t axis)
{
    const struct board *of = boards_board_at(boards, board);

    return of->ops->settings && !of->config.external && board_joint(of, axis) >= 0
               ? of->ops->settings->count
               : 0;
}

void boards_setting(const struct boards *boards, size_t board, size_t axis, size_t index,
                    struct board_setting *setting)
{
    const struct board *of = boards_board_at(boards, board);

    of->ops->settings->describe(of, (unsigned)axis, index, setting);
}

double boards_get(const struct boards *boards, size_t board, size_t axis, size_t index)
{
    const struct board *of = boards_board_at(boards, board);

    return of->ops->settings->get(of, (unsigned)axis, index);
}

bool boards_set(struct boards *boards, size_t board, size_t axis, size_t index, double value)
{
    struct board *of = boards->board[board];
    struct board_setting setting;

    boards_setting(boards, board, axis, index, &setting);
    if (!(value >= setting.min && value <= setting.max) ||
        (setting.whole && value != rint(value)) ||
        !of->ops->settings->set(of, (unsigned)axis, index, value)) {
        return false;
    }
    boards->settings_changes++;
    return true;
}

uint64_t boards_settings_changes(const struct boards *boards)
{
    return boards->settings_changes;
}
