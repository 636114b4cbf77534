/* SPDX-License-Identifier: Apache-2.0 */
/* Checks whether a configuration of boards can be built: addresses, axes, channels, ranges. */
#include "boards/board_private.h"
#include "boards/protocol_list.h"

#include <math.h>

enum { TICK_MAX_MS = 100, VOLTAGE_DELAY_MAX = 1000 };

/* Sets an error that names the board. */
static enum error_code check_refuse(struct error *error, const struct board_config *board,
                                    const char *text)
{
    return error_set(error, ERROR_INPUT, "board %s: %s", board->name ? board->name : "(no name)",
                     text);
}

/* Checks whether a number is finite and above 0. */
static bool check_is_positive(double value)
{
    return isfinite(value) && value > 0.0;
}

/* Checks an axis of a motor board: joint, encoders, limits. */
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
    /* Encoders and range of the joint */
    if (!check_is_positive(axis->joint_ticks_per_rad) ||
        !check_is_positive(axis->motor_ticks_per_rad)) {
        return check_refuse(error, board, "encoders need more than 0 ticks per rad");
    }
    if (!isfinite(axis->lower_rad) || !isfinite(axis->upper_rad) ||
        axis->lower_rad >= axis->upper_rad) {
        return check_refuse(error, board, "the lower limit of an axis must be below the upper one");
    }
    /* Limits of current, temperature and torque */
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

/* Checks the channels of a force-torque or torque board: source and full scales. */
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

        /* Unused channels need no full scale */
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

/* Checks the axes of a motor board; each joint has one axis. */
static enum error_code check_motor_board(const struct boards_config *config,
                                         const struct board_config *board, struct error *error)
{
    for (size_t i = 0; i < boards_protocol(config, board->bus)->axes_max; i++) {
        const struct board_axis_config *axis = &board->axis[i];
        enum error_code code = check_axis_config(config, board, axis, error);

        if (code) {
            return code;
        }
        for (size_t k = 0; k < i; k++) {
            if (axis->joint >= 0 && board->axis[k].joint == axis->joint) {
                return check_refuse(error, board, "both axes have the same joint");
            }
        }
    }
    return ERROR_NONE;
}

/* Checks the address and the kind of a board by the limits of its protocol. */
static enum error_code check_place(const struct protocol *protocol,
                                   const struct board_config *board, struct error *error)
{
    int most = board->kind == BOARD_MOTOR ? protocol->motor_address_max : protocol->address_max;
    char text[80];

    if (board->address < 1 || board->address > most) {
        snprintf(text, sizeof text, "the address must be 1 to %d on a bus that speaks %s", most,
                 protocol->name);
        return check_refuse(error, board, text);
    }
    if (board->kind == BOARD_TORQUE && !protocol->torque_boards) {
        snprintf(text, sizeof text, "a bus that speaks %s has no torque boards", protocol->name);
        return check_refuse(error, board, text);
    }
    if (board->kind != BOARD_MOTOR && protocol->motors_only) {
        snprintf(text, sizeof text, "a bus that speaks %s has motor boards only", protocol->name);
        return check_refuse(error, board, text);
    }
    return ERROR_NONE;
}

/* Checks one board: address, protocol, times, supplies, and the fields of its kind. */
static enum error_code check_board_config(const struct boards_config *config,
                                          const struct board_config *board, struct error *error)
{
    const struct protocol *protocol;
    enum error_code code;

    if (board->bus < 0 || (size_t)board->bus >= config->nbus) {
        return check_refuse(error, board, "there is no bus with its index");
    }

    /* Options that the protocol of the bus must support */
    protocol = boards_protocol(config, board->bus);
    code = check_place(protocol, board, error);
    if (!code && protocol->check_board) {
        code = protocol->check_board(boards_bus(config, board->bus), board, error);
    }
    if (code) {
        return code;
    }

    /* Times and supplies */
    if (board->command_timeout_ns < 0) {
        return check_refuse(error, board, "the command time-out must not be negative");
    }
    if (!(board->under_voltage_v >= 0.0 && isfinite(board->under_voltage_v) &&
          board->over_voltage_v >= 0.0 && isfinite(board->over_voltage_v))) {
        return check_refuse(error, board,
                            "under-voltage and over-voltage must be numbers, 0 or more");
    }
    if (!(board->under_pressure_pa >= 0.0 && isfinite(board->under_pressure_pa) &&
          board->over_pressure_pa >= 0.0 && isfinite(board->over_pressure_pa))) {
        return check_refuse(error, board, "pressures must be numbers, 0 or more");
    }
    if (board->boot_ns < 0 || board->status_period_ns < 0) {
        return check_refuse(error, board, "times must not be negative");
    }

    /* The joint, sensor or channels of the board */
    switch (board->kind) {
    case BOARD_MOTOR:
        return check_motor_board(config, board, error);
    case BOARD_TORQUE:
        return check_channel_configs(config, board, error);
    case BOARD_FT:
        return check_channel_configs(config, board, error);
    case BOARD_INERTIAL:
        return board->period_ns < 0 ? check_refuse(error, board, "the period must not be negative")
                                    : ERROR_NONE;
    }
    return check_refuse(error, board, "no such kind of board");
}

/* Checks that two boards share neither an address on a bus nor a joint. */
static enum error_code check_board_pair(const struct boards_config *config,
                                        const struct board_config *a, const struct board_config *b,
                                        struct error *error)
{
    size_t na = boards_protocol(config, a->bus)->axes_max;
    size_t nb = boards_protocol(config, b->bus)->axes_max;

    if (a->bus == b->bus && a->address == b->address) {
        return error_set(error, ERROR_INPUT, "board %s: its address %d is that of board %s",
                         b->name ? b->name : "(no name)", b->address,
                         a->name ? a->name : "(no name)");
    }
    /* Only motor boards have axes */
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

/* Checks that buses with consecutively numbered axes have enough slots. */
static enum error_code check_slots(const struct boards_config *config, struct error *error)
{
    for (size_t bus = 0; bus < config->nbus; bus++) {
        const struct protocol *protocol = boards_protocol(config, (int)bus);
        size_t slots = 0;

        for (size_t i = 0; protocol->slots_max > 0 && i < config->nboard; i++) {
            const struct board_config *board = &config->board[i];

            slots += board->bus == (int)bus ? board_config_axes(board) : 0;
            if (slots > protocol->slots_max) {
                char text[80];

                snprintf(text, sizeof text, "a bus that speaks %s has at most %d axes",
                         protocol->name, protocol->slots_max);
                return check_refuse(error, board, text);
            }
        }
    }
    return ERROR_NONE;
}

/* Checks a bus against the limits of its protocol. */
static enum error_code check_bus_config(const struct boards_config *config, int index,
                                        struct error *error)
{
    const struct boards_bus_config *bus = boards_bus(config, index);
    const struct protocol *protocol = boards_protocol(config, index);
    char list[80];

    if (bus->fd && !protocol->canfd) {
        return error_set(error, ERROR_INPUT, "boards: only %s boards speak CAN FD",
                         protocols_list(offsetof(struct protocol, canfd), list, sizeof list));
    }
    if (!bus->fd && protocol->canfd_only) {
        return error_set(error, ERROR_INPUT, "boards: a bus that speaks %s must be CAN FD",
                         protocol->name);
    }
    if ((protocol->needs_file || protocol->text) && !bus->described) {
        return error_set(error, ERROR_INPUT, "boards: a %s bus without its protocol",
                         protocol->name);
    }
    if (bus->padded && !protocol->padded) {
        return error_set(error, ERROR_INPUT, "boards: only frames of %s boards may be padded",
                         protocols_list(offsetof(struct protocol, padded), list, sizeof list));
    }
    return ERROR_NONE;
}

enum error_code boards_check(const struct boards_config *config, struct error *error)
{
    if (config->tick_ns <= 0 || config->tick_ns > (int64_t)TICK_MAX_MS * MS) {
        return error_set(error, ERROR_INPUT, "boards: the tick must be above 0 and at most %d ms",
                         TICK_MAX_MS);
    }
    if (config->voltage_delay_ticks > VOLTAGE_DELAY_MAX) {
        return error_set(error, ERROR_INPUT,
                         "boards: found voltages %zu ticks late, expected %d at "
                         "most",
                         config->voltage_delay_ticks, VOLTAGE_DELAY_MAX);
    }
    if (config->nboard > UINT16_MAX) {
        return error_set(error, ERROR_INPUT, "boards: %zu are too many", config->nboard);
    }
    for (size_t i = 0; i < config->nbus; i++) {
        enum error_code code = check_bus_config(config, (int)i, error);

        if (code) {
            return code;
        }
    }

    /* Check each board, then compare it with the boards before it */
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
