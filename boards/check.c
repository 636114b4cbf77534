/* SPDX-License-Identifier: Apache-2.0 */
/* Whether a configuration of boards can be built: addresses, axes, channels, ranges. */
#include "boards/board_private.h"
#include "boards/cia402/protocol.h"
#include "boards/compact/protocol.h"
#include "boards/described/protocol.h"
#include "boards/foc/protocol.h"

#include <math.h>

enum { TICK_MAX_MS = 100 };

static enum error_code check_refuse(struct error *error, const struct board_config *board,
                                    const char *text)
{
    return error_set(error, ERROR_INPUT, "board %s: %s", board->name ? board->name : "(no name)",
                     text);
}

static bool check_is_positive(double value)
{
    return isfinite(value) && value > 0.0;
}

static enum error_code check_axis_config(const struct boards_config *config,
                                         const struct board_config *board,
                                         const struct board_axis_config *axis, struct error *error)
{
    if (axis->joint == -1) {
        return ERROR_NONE;
    }
    if (axis->joint < 0 || (size_t)axis->joint >= config->njoint) {
        return check_refuse(error, board, "there is no joint with the index of its axis");
    }
    if (!check_is_positive(axis->joint_ticks_per_rad) ||
        !check_is_positive(axis->motor_ticks_per_rad)) {
        return check_refuse(error, board, "encoders need more than 0 ticks per rad");
    }
    if (!isfinite(axis->lower_rad) || !isfinite(axis->upper_rad) ||
        axis->lower_rad >= axis->upper_rad) {
        return check_refuse(error, board, "the lower limit of an axis must be below the upper one");
    }
    if (!check_is_positive(axis->current_limit_a) || axis->current_limit_a > 1e6) {
        return check_refuse(error, board, "the current limit of an axis must be above 0 A");
    }
    if (!isfinite(axis->temperature_limit_c) || axis->temperature_limit_c < 0.0) {
        return check_refuse(error, board, "the temperature limit of an axis must not be negative");
    }
    if (!isfinite(axis->torque_full_scale_nm) || axis->torque_full_scale_nm < 0.0) {
        return check_refuse(error, board, "the full scale of torque must not be negative");
    }
    return ERROR_NONE;
}

static enum error_code check_channel_configs(const struct boards_config *config,
                                             const struct board_config *board, struct error *error)
{
    if (board->kind == BOARD_FT && (board->ft < 0 || (size_t)board->ft >= config->nft)) {
        return check_refuse(error, board, "there is no force-torque sensor with its index");
    }
    if (board->period_ns < 0) {
        return check_refuse(error, board, "the period must not be negative");
    }
    for (int i = 0; i < BOARD_CHANNELS; i++) {
        double scale = board->full_scale[i];

        if (board->kind == BOARD_TORQUE) {
            if (board->torque_joint[i] == -1) {
                continue;
            }
            if (board->torque_joint[i] < 0 || (size_t)board->torque_joint[i] >= config->njoint) {
                return check_refuse(error, board,
                                    "there is no joint with the index of its channel");
            }
        }
        if (!check_is_positive(scale) || scale > UINT16_MAX) {
            return check_refuse(error, board, "a full scale must be above 0 and at most 65535");
        }
        if (board->kind == BOARD_FT && scale != floor(scale)) {
            return check_refuse(error, board, "a full scale must be a whole number of N or Nm");
        }
    }
    return ERROR_NONE;
}

static enum error_code check_motor_board(const struct boards_config *config,
                                         const struct board_config *board, struct error *error)
{
    enum board_personality personality = boards_personality(config, board->bus);

    for (size_t i = 0; i < board_axes_max(personality); i++) {
        const struct board_axis_config *axis = &board->axis[i];
        enum error_code code = check_axis_config(config, board, axis, error);

        if (code) {
            return code;
        }
        if (personality == BOARD_FOC && axis->joint >= 0 && !check_is_positive(axis->gear)) {
            return check_refuse(error, board, "the gear must be above 0");
        }
        for (size_t k = 0; k < i; k++) {
            if (axis->joint >= 0 && board->axis[k].joint == axis->joint) {
                return check_refuse(error, board, "both axes have the same joint");
            }
        }
    }
    return ERROR_NONE;
}

static enum error_code check_board_config(const struct boards_config *config,
                                          const struct board_config *board, struct error *error)
{
    enum board_personality personality;

    if (board->bus < 0 || (size_t)board->bus >= config->nbus) {
        return check_refuse(error, board, "there is no bus with its index");
    }

    /* Addresses, as the protocol of the bus has them */
    personality = boards_personality(config, board->bus);
    if (personality == BOARD_COMPACT) {
        if (board->address < 1 || board->address > COMPACT_NODE_MAX) {
            return check_refuse(error, board, "the address must be 1 to 31 on a compact bus");
        }
    } else if (personality == BOARD_CIA402) {
        if (board->address < 1 || board->address > CIA402_NODE_MAX) {
            return check_refuse(error, board, "the Node-ID must be 1 to 31 on a cia402 bus");
        }
    } else if (personality == BOARD_DESCRIBED) {
        const struct described_protocol *protocol = config->bus[board->bus].described;

        if (board->address < 1 || board->address > protocol->address_max) {
            return check_refuse(error, board, "the address is beyond those of its protocol");
        }
        if (board_config_axes(board) > protocol->axes) {
            return check_refuse(error, board, "it has more axes than boards of its protocol");
        }
    } else if (personality == BOARD_FOC && board->kind == BOARD_MOTOR) {
        if (board->address < 1 || board->address > FOC_AXES_MAX) {
            return check_refuse(error, board,
                                "the address must be 1 to 4, for only these have a target");
        }
    } else if (board->address < 1 || board->address > ICUB_ADDRESS_MAX) {
        return check_refuse(error, board, "the address must be 1 to 14");
    }

    if (board->command_timeout_ns < 0) {
        return check_refuse(error, board, "the command time-out must not be negative");
    }
    if (!(board->over_voltage_v >= 0.0 && isfinite(board->over_voltage_v))) {
        return check_refuse(error, board, "the over-voltage must be a number, 0 or more");
    }
    if (!(board->under_pressure_pa >= 0.0 && isfinite(board->under_pressure_pa) &&
          board->over_pressure_pa >= 0.0 && isfinite(board->over_pressure_pa))) {
        return check_refuse(error, board, "pressures must be numbers, 0 or more");
    }
    if (board->boot_ns < 0 || board->status_period_ns < 0) {
        return check_refuse(error, board, "times must not be negative");
    }

    /* What stands behind the board */
    switch (board->kind) {
    case BOARD_MOTOR:
        return check_motor_board(config, board, error);
    case BOARD_TORQUE:
        if (personality == BOARD_COMPACT) {
            return check_refuse(error, board,
                                "a compact bus needs no torque board: TELEMETRY has it");
        }
        if (personality == BOARD_CIA402) {
            return check_refuse(error, board,
                                "a cia402 bus needs no torque board: the drives measure it");
        }
        if (personality == BOARD_DESCRIBED) {
            return check_refuse(error, board, "a described protocol has no torque boards");
        }
        return check_channel_configs(config, board, error);
    case BOARD_FT:
        return check_channel_configs(config, board, error);
    case BOARD_INERTIAL:
        return board->period_ns < 0 ? check_refuse(error, board, "the period must not be negative")
                                    : ERROR_NONE;
    }
    return check_refuse(error, board, "no such kind of board");
}

/* Two boards with one address or two axes with one joint. */
static enum error_code check_board_pair(const struct boards_config *config,
                                        const struct board_config *a, const struct board_config *b,
                                        struct error *error)
{
    size_t na = board_axes_max(boards_personality(config, a->bus));
    size_t nb = board_axes_max(boards_personality(config, b->bus));

    if (a->bus == b->bus && a->address == b->address) {
        return error_set(error, ERROR_INPUT, "board %s: its address %d is that of board %s",
                         b->name ? b->name : "(no name)", b->address,
                         a->name ? a->name : "(no name)");
    }
    if (a->kind != BOARD_MOTOR || b->kind != BOARD_MOTOR) {
        return ERROR_NONE;
    }
    for (size_t i = 0; i < na; i++) {
        for (size_t j = 0; j < nb; j++) {
            if (a->axis[i].joint >= 0 && a->axis[i].joint == b->axis[j].joint) {
                return check_refuse(error, b,
                                    "one of its joints already has an axis of another board");
            }
        }
    }
    return ERROR_NONE;
}

/* A bus whose axes are numbered through has so many slots. */
static enum error_code check_slots(const struct boards_config *config, struct error *error)
{
    for (size_t bus = 0; bus < config->nbus; bus++) {
        size_t slots = 0;

        for (size_t i = 0; i < config->nboard; i++) {
            const struct board_config *board = &config->board[i];

            slots += board->bus == (int)bus ? board_config_axes(board) : 0;
            if (slots > COMPACT_SLOTS && boards_personality(config, (int)bus) == BOARD_COMPACT) {
                return check_refuse(error, board, "a compact bus has at most 32 axes");
            }
            if (slots > DESCRIBED_SLOTS &&
                boards_personality(config, (int)bus) == BOARD_DESCRIBED) {
                return check_refuse(error, board, "a described bus has at most 32 axes");
            }
        }
    }
    return ERROR_NONE;
}

enum error_code boards_check(const struct boards_config *config, struct error *error)
{
    if (config->tick_ns <= 0 || config->tick_ns > (int64_t)TICK_MAX_MS * MS) {
        return error_set(error, ERROR_INPUT, "boards: the tick must be above 0 and at most %d ms",
                         TICK_MAX_MS);
    }
    if (config->nboard > UINT16_MAX) {
        return error_set(error, ERROR_INPUT, "boards: %zu are too many", config->nboard);
    }
    for (size_t i = 0; config->bus && i < config->nbus; i++) {
        if (config->bus[i].fd && config->bus[i].personality != BOARD_COMPACT &&
            config->bus[i].personality != BOARD_DESCRIBED) {
            return error_set(error, ERROR_INPUT,
                             "boards: only compact and described boards speak CAN FD");
        }
        if (config->bus[i].personality == BOARD_DESCRIBED && !config->bus[i].described) {
            return error_set(error, ERROR_INPUT, "boards: a described bus without its protocol");
        }
        if (config->bus[i].padded && config->bus[i].personality != BOARD_ICUB &&
            config->bus[i].personality != BOARD_FOC) {
            return error_set(error, ERROR_INPUT,
                             "boards: only frames of icub and foc boards may be padded");
        }
    }

    /* Each board for itself, then against those before it */
    for (size_t i = 0; i < config->nboard; i++) {
        const struct board_config *board = &config->board[i];
        enum error_code code = check_board_config(config, board, error);

        for (size_t j = 0; !code && j < i; j++) {
            code = check_board_pair(config, &config->board[j], board, error);
        }
        if (code) {
            return code;
        }
    }
    return check_slots(config, error);
}
