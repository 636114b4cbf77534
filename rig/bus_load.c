/* SPDX-License-Identifier: Apache-2.0 */
/* Worst-case bus load of a rig's boards and controller: every frame as long as bit stuffing can
 * make it. */
#include "boards/cia402/protocol.h"
#include "boards/compact/protocol.h"
#include "boards/described/protocol.h"
#include "boards/foc/protocol.h"
#include "boards/messages.h"
#include "canbus/wire/bits.h"
#include "rig/rig.h"

#include <math.h>

static const double MS = 1e-3;

/* Bit times of the nominal rate that a frame takes of its bus at the worst, the intermission
 * included. */
static double worst_bits_of(const struct rig_bus *bus, uint8_t flags, unsigned bytes)
{
    struct wire_length length = wire_worst_length(flags, (uint8_t)bytes);

    length.nominal = (uint16_t)(length.nominal + WIRE_INTERMISSION_BITS);
    return (double)wire_length_ns(length, bus->bitrate, bus->data_bitrate) * 1e-9 *
           (double)bus->bitrate;
}

/* The same of a frame in the format of its bus. */
static double worst_frame_bits(const struct rig_bus *bus, unsigned bytes)
{
    return worst_bits_of(bus, bus->fd ? FRAME_FD | FRAME_BRS : 0, bytes);
}

static int board_count_axes(const struct board_config *board)
{
    int count = 0;

    for (int k = 0; k < BOARD_AXES_MAX && board->kind == BOARD_MOTOR; k++) {
        count += board->axis[k].joint >= 0;
    }
    return count;
}

/* The period that the host asks of the boards where the rig says nothing: the tick, but not below
 * the millisecond of the boards; in s. */
static double telemetry_period_s(const struct rig *rig, int64_t period_ns)
{
    return fmax((double)(period_ns > 0 ? period_ns : rig->tick_ns) * 1e-9, MS);
}

/* STRAIN: forces and torques; inertial: what the host asks for, acceleration, rate, quaternion */
static double sensor_board_load(const struct rig *rig, const struct rig_bus *bus,
                                const struct board_config *board)
{
    return (board->kind == BOARD_INERTIAL ? 3.0 * worst_frame_bits(bus, ICUB_INERTIAL_LENGTH)
                                          : 2.0 * worst_frame_bits(bus, ICUB_STRAIN_LENGTH)) /
           telemetry_period_s(rig, board->period_ns);
}

/* ---- one board, bits a second ---- */

static double icub_board_load(const struct rig *rig, const struct rig_bus *bus,
                              const struct board_config *board)
{
    /* POSITION, PID_VAL, CURRENT and VELOCITY, one in each slot; STATUS */
    return board->kind != BOARD_MOTOR ? sensor_board_load(rig, bus, board)
                                      : 4.0 * worst_frame_bits(bus, 8) / (ICUB_SLOTS * MS) +
                                            worst_frame_bits(bus, 8) / (ICUB_STATUS_PERIOD_MS * MS);
}

static double foc_board_load(const struct rig *rig, const struct rig_bus *bus,
                             const struct board_config *board)
{
    double period = telemetry_period_s(rig, 0); /* of DESIRED_TARGETS */

    return board->kind != BOARD_MOTOR
               ? sensor_board_load(rig, bus, board)
               : worst_frame_bits(bus, FOC_FEEDBACK_LENGTH) / period +
                     worst_frame_bits(bus, FOC_STATUS_LENGTH) /
                         fmax(period, (double)board->status_period_ns * 1e-9) +
                     worst_frame_bits(bus, FOC_ADDITIONAL_STATUS_LENGTH) /
                         (foc_additional_status_ms(board->address) * MS);
}

static double compact_inertial_load(const struct rig *rig, const struct rig_bus *bus,
                                    const struct board_config *board)
{
    double state = worst_frame_bits(bus, COMPACT_STATE_LENGTH);
    double motion = worst_frame_bits(bus, COMPACT_INERTIAL_FD_LENGTH);

    if (!bus->fd) {
        state += worst_frame_bits(bus, COMPACT_ACCELERATION_LENGTH);
        motion = 2.0 * worst_frame_bits(bus, COMPACT_ACCELERATION_LENGTH) +
                 worst_frame_bits(bus, COMPACT_ORIENTATION_LENGTH);
    }
    return state / (COMPACT_STATE_PERIOD_MS * MS) +
           motion / telemetry_period_s(rig, board->period_ns);
}

static double compact_board_load(const struct rig *rig, const struct rig_bus *bus,
                                 const struct board_config *board)
{
    double period = telemetry_period_s(rig, board->period_ns);
    double state = worst_frame_bits(bus, COMPACT_STATE_LENGTH) / (COMPACT_STATE_PERIOD_MS * MS);

    if (board->kind == BOARD_INERTIAL) {
        return compact_inertial_load(rig, bus, board);
    }
    if (board->kind == BOARD_FT) {
        return state + (bus->fd ? worst_frame_bits(bus, COMPACT_WRENCH_FD_LENGTH)
                                : 2.0 * worst_frame_bits(bus, COMPACT_FORCE_LENGTH)) /
                           period;
    }
    return board_count_axes(board) * state +
           (bus->fd ? worst_frame_bits(bus, (unsigned)board_count_axes(board) *
                                                COMPACT_TELEMETRY_FD_LENGTH)
                    : board_count_axes(board) * worst_frame_bits(bus, COMPACT_TELEMETRY_LENGTH)) /
               period;
}

/* TPDOs with every so many SYNCs; those that tell a change at their event timer, as while nothing
 * changes; the heartbeat. */
static double cia402_board_load(const struct rig *rig, const struct rig_bus *bus,
                                const struct board_config *board)
{
    enum cia402_kind kind = board->kind == BOARD_MOTOR      ? CIA402_KIND_DRIVE
                            : board->kind == BOARD_INERTIAL ? CIA402_KIND_INERTIAL
                                                            : CIA402_KIND_FT;
    double period = telemetry_period_s(rig, board->period_ns), bits = 0.0;
    struct cia402_plan plan;

    bits += worst_frame_bits(bus, 1) / (CIA402_HEARTBEAT_MS * MS);
    for (unsigned i = 0; cia402_plan_row(kind, (unsigned)board_count_axes(board), i, &plan); i++) {
        if (!plan.receive) {
            bits += worst_frame_bits(bus, plan.length) /
                    (plan.event_ms ? plan.event_ms * MS : plan.type * period);
        }
    }
    return bits;
}

/* ---- the controller, bits a second ---- */

static double icub_command_load(const struct rig *rig, const struct rig_bus *bus, double period)
{
    (void)rig;
    return (double)bus->naxis * worst_frame_bits(bus, 3) / period;
}

static double foc_command_load(const struct rig *rig, const struct rig_bus *bus, double period)
{
    (void)period;
    return bus->naxis ? worst_frame_bits(bus, FOC_TARGETS_LENGTH) / telemetry_period_s(rig, 0)
                      : 0.0;
}

static double compact_command_load(const struct rig *rig, const struct rig_bus *bus, double period)
{
    size_t most = bus->fd ? COMPACT_SLOTS : COMPACT_GROUP;
    double bits = 0.0;

    (void)period;
    for (size_t left = bus->naxis; left > 0; left -= left < most ? left : most) {
        bits += worst_frame_bits(bus, frame_fd_length(2 * (unsigned)(left < most ? left : most)));
    }
    return bits / ((double)rig->tick_ns * 1e-9);
}

/* SYNC, and the voltages of all axes of each node */
static double cia402_command_load(const struct rig *rig, const struct rig_bus *bus, double period)
{
    double bits = worst_frame_bits(bus, 0);

    (void)period;
    for (size_t i = 0; i < bus->nboard; i++) {
        int axes = board_count_axes(&rig->boards.board[bus->first_board + i]);

        bits += axes ? worst_frame_bits(bus, 2 * (unsigned)axes) : 0.0;
    }
    return bits / telemetry_period_s(rig, 0);
}

/* ---- described buses: every frame that has a period ---- */

struct described_load_sum {
    const struct rig_bus *bus;
    double telemetry_bit_s, command_bit_s;
};

static bool described_add_message(void *context, const struct message *message)
{
    struct described_load_sum *sum = context;
    uint8_t flags =
        (uint8_t)((message->extended ? FRAME_EXTENDED : 0) | (message->fd ? FRAME_FD : 0) |
                  (message->bit_rate_switch ? FRAME_BRS : 0));
    double bits = worst_bits_of(sum->bus, flags, message->length);

    if (message->cycle_ns > 0) {
        *(message->from_host ? &sum->command_bit_s : &sum->telemetry_bit_s) +=
            bits / ((double)message->cycle_ns * 1e-9);
    }
    return true;
}

double rig_bus_bits(const struct rig_bus *bus, const struct can_counters *counters)
{
    double fast = (double)counters->fast_bits;
    double ratio = bus->data_bitrate ? (double)bus->bitrate / (double)bus->data_bitrate : 1.0;

    return (double)(counters->rx_bits + counters->tx_bits) - fast + fast * ratio;
}

void rig_bus_load(const struct rig *rig, size_t bus, int64_t command_period_ns,
                  double *telemetry_bit_s, double *command_bit_s)
{
    static const struct {
        double (*board)(const struct rig *rig, const struct rig_bus *bus,
                        const struct board_config *board);
        double (*commands)(const struct rig *rig, const struct rig_bus *bus, double period);
    } load[] = {
        [BOARD_ICUB] = {icub_board_load, icub_command_load},
        [BOARD_FOC] = {foc_board_load, foc_command_load},
        [BOARD_COMPACT] = {compact_board_load, compact_command_load},
        [BOARD_CIA402] = {cia402_board_load, cia402_command_load},
    };
    const struct rig_bus *of = &rig->bus[bus];

    if (of->personality == BOARD_DESCRIBED) {
        struct described_load_sum sum = {.bus = of};

        boards_messages(&rig->boards, (int)bus, described_add_message, &sum);
        *telemetry_bit_s = sum.telemetry_bit_s;
        *command_bit_s = sum.command_bit_s;
        return;
    }
    *telemetry_bit_s = 0.0;
    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];

        if (board->bus == (int)bus) {
            *telemetry_bit_s += load[of->personality].board(rig, of, board);
        }
    }
    *command_bit_s = load[of->personality].commands(rig, of, (double)command_period_ns * 1e-9);
}
