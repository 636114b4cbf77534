/* SPDX-License-Identifier: Apache-2.0 */
/* Watches real boards on the same bus: when they were heard, and what the log says of it. */
#include "boards/board_private.h"

void boards_external_heard(struct boards *boards, int64_t now_ns, size_t index)
{
    struct board *board = boards->board[index];

    boards->event_ns = boards->now_ns = now_ns;
    board->heard_ns = now_ns;
    if (!board->present) {
        board_event(board, BOARD_EVENT_HEARD, 0, 0, 0);
        board->present = true;
        board->silence_told = false;
    }
}

void boards_external_step(struct boards *boards, int64_t now_ns)
{
    for (size_t i = 0; i < boards->nboard; i++) {
        struct board *board = boards->board[i];
        int64_t since = board->heard_ns < 0 ? 0 : board->heard_ns;

        if (!board->config.external || board->silence_told ||
            now_ns - since <= board->config.external_timeout_ns) {
            continue;
        }
        boards->event_ns = now_ns;
        board_event(board, BOARD_EVENT_SILENT, 0, (uint32_t)((now_ns - since) / MS), 0);
        board->present = false;
        board->silence_told = true;
    }
}

bool boards_external_present(const struct boards *boards, size_t board)
{
    return boards->board[board]->present;
}
