/* SPDX-License-Identifier: Apache-2.0 */
/* Events of boards as lines of a log. Not called in the loop. */
#include "boards/board_private.h"
#include "boards/cia402/protocol.h"
#include "boards/compact/protocol.h"
#include "boards/described/protocol.h"
#include "boards/icub/protocol.h"

#include <inttypes.h>
#include <stdio.h>

static const char *event_compact_mode_name(uint32_t mode)
{
    return mode == COMPACT_VOLTAGE   ? "voltage"
           : mode == COMPACT_CURRENT ? "current"
           : mode == COMPACT_FAULT   ? "fault"
                                     : "off";
}

/* The states of CiA 402 stand where others have modes. */
static const char *event_cia402_state_name(uint32_t state)
{
    static const char *const names[CIA402_STATES] = {
        [CIA402_NOT_READY] = "not ready to switch on",
        [CIA402_SWITCH_ON_DISABLED] = "switch on disabled",
        [CIA402_READY_TO_SWITCH_ON] = "ready to switch on",
        [CIA402_SWITCHED_ON] = "switched on",
        [CIA402_OPERATION_ENABLED] = "operation enabled",
        [CIA402_QUICK_STOP_ACTIVE] = "quick stop active",
        [CIA402_FAULT_REACTION_ACTIVE] = "fault reaction active",
        [CIA402_FAULT] = "fault",
    };

    return state < CIA402_STATES ? names[state] : "unknown";
}

/* The law in force: the states themselves have the names of a file. */
static const char *event_described_law_name(uint32_t law)
{
    static const char *const names[] = {
        [DESCRIBED_OFF] = "off",
        [DESCRIBED_VOLTAGE] = "voltage",
        [DESCRIBED_CURRENT] = "current",
        [DESCRIBED_TORQUE] = "torque",
        [DESCRIBED_VELOCITY] = "velocity",
        [DESCRIBED_POSITION] = "position",
        [DESCRIBED_IMPEDANCE] = "impedance",
        [DESCRIBED_FAULT] = "fault",
    };

    return law <= DESCRIBED_FAULT ? names[law] : "unknown";
}

/* A mode as people call it, with blanks; the DBC has names without. */
const char *board_mode_name(enum board_personality personality, uint32_t mode)
{
    if (personality == BOARD_COMPACT) {
        return event_compact_mode_name(mode);
    }
    if (personality == BOARD_CIA402) {
        return event_cia402_state_name(mode);
    }
    if (personality == BOARD_DESCRIBED) {
        return event_described_law_name(mode);
    }
    switch (mode) {
    case ICUB_MODE_IDLE:
        return "idle";
    case ICUB_MODE_POSITION:
        return "position";
    case ICUB_MODE_VELOCITY:
        return "velocity";
    case ICUB_MODE_TORQUE:
        return "torque";
    case ICUB_MODE_IMPEDANCE_POSITION:
        return "impedance position";
    case ICUB_MODE_IMPEDANCE_VELOCITY:
        return "impedance velocity";
    case ICUB_MODE_CURRENT:
        return "current";
    case ICUB_MODE_MIXED:
        return "mixed";
    case ICUB_MODE_DIRECT:
        return "direct position";
    case ICUB_MODE_SPEED_VOLTAGE:
        return "speed (voltage)";
    case ICUB_MODE_SPEED_CURRENT:
        return "speed (current)";
    case ICUB_MODE_NOT_CONFIGURED:
        return "not configured";
    case ICUB_MODE_OPEN_LOOP:
        return "voltage";
    case ICUB_MODE_CALIBRATION:
        return "calibration";
    case ICUB_MODE_HARDWARE_FAULT:
        return "hardware fault";
    default:
        return "unknown";
    }
}

/* What a command that timed out leads to. */
static const char *event_timeout_consequence(enum board_personality personality)
{
    return personality == BOARD_FOC         ? "a fault"
           : personality == BOARD_DESCRIBED ? "as its protocol has it"
                                            : "reference set to 0";
}

static const char *const icub_faults[] = {
    "under-voltage", "over-voltage",     "external",        "over-current",
    "Hall sensor",   "absolute encoder", "optical encoder", NULL};
static const char *const foc_faults[] = {"protocol",
                                         "Hall sequence",
                                         "absolute encoder checksum",
                                         "Hall value",
                                         "over-current",
                                         "over-voltage",
                                         "under-voltage",
                                         "external",
                                         "bit 8",
                                         "over-heating",
                                         "CAN reception warning",
                                         "CAN sending warning",
                                         "CAN passive",
                                         "CAN passive",
                                         "set-point expired",
                                         "CAN overrun",
                                         "PWM",
                                         "encoder calculation",
                                         "SPI timing",
                                         "encoder",
                                         "EMUROM CRC",
                                         "EMUROM",
                                         "I2t",
                                         "ADC calibration",
                                         "lower limit",
                                         "upper limit",
                                         "silicon",
                                         "CAN length",
                                         NULL};
static const char *const compact_faults[] = {"under-voltage",
                                             "over-voltage",
                                             "over-current",
                                             "motor encoder",
                                             "link encoder",
                                             "torque sensor",
                                             "temperature",
                                             "stale command",
                                             "limit",
                                             "overflow",
                                             "saturated",
                                             "inertial sensor",
                                             NULL};

static const char *const cia402_faults[] = {
    "under-voltage", "over-voltage",   "over-current",  "motor encoder",
    "link encoder",  "torque sensor",  "temperature",   "following error",
    "connection",    "stale command",  "limit",         "saturated",
    "no reading",    "under-pressure", "over-pressure", NULL};

const char *const *board_fault_names(enum board_personality personality)
{
    return personality == BOARD_FOC         ? foc_faults
           : personality == BOARD_COMPACT   ? compact_faults
           : personality == BOARD_CIA402    ? cia402_faults
           : personality == BOARD_DESCRIBED ? described_fault_names
                                            : icub_faults;
}

static void event_list_faults(enum board_personality personality, uint32_t bits, char *text,
                              size_t size)
{
    const char *const *names = board_fault_names(personality);
    size_t used = 0;

    text[0] = '\0';
    for (size_t i = 0; names[i]; i++) {
        if (bits >> i & 1 && used < size) {
            used += (size_t)snprintf(text + used, size - used, "%s%s", used ? ", " : "", names[i]);
        }
    }
}

static void event_describe(enum board_personality personality, const struct board_event *event,
                           char *text, size_t size)
{
    char faults[128];
    unsigned axis = event->axis;
    uint32_t a = event->a, b = event->b;

    switch (event->kind) {
    /* Of an axis */
    case BOARD_EVENT_MODE:
        snprintf(text, size, "axis %u from %s to %s%s", axis, board_mode_name(personality, a),
                 board_mode_name(personality, b), personality == BOARD_CIA402 ? "" : " mode");
        return;
    case BOARD_EVENT_FAULT:
        event_list_faults(personality, a, faults, sizeof faults);
        snprintf(text, size, "axis %u has a fault: %s", axis, faults);
        return;
    case BOARD_EVENT_TIMEOUT:
        snprintf(text, size, "axis %u: the %s%scommand timed out, %s", axis,
                 personality == BOARD_CIA402 ? "" : board_mode_name(personality, a),
                 personality == BOARD_CIA402 ? "" : " ", event_timeout_consequence(personality));
        return;
    case BOARD_EVENT_SOURCE_LOST:
        snprintf(text, size, "axis %u: torque source %" PRIu32 " timed out, motor switched off",
                 axis, a);
        return;
    case BOARD_EVENT_LIMIT:
        snprintf(text, size, "axis %u is beyond its position limit at %" PRId32 " %s", axis,
                 (int32_t)a,
                 personality == BOARD_COMPACT || personality == BOARD_CIA402
                     ? "x 1e-5 rad, only commands that lead back are obeyed"
                     : "ticks, voltage set to 0");
        return;

    /* Of a frame */
    case BOARD_EVENT_UNKNOWN:
        snprintf(text, size, "unknown command 0x%02" PRIx32 " (id 0x%03" PRIx32 ")", b, a);
        return;
    case BOARD_EVENT_MALFORMED:
        snprintf(text, size,
                 "wrong length or value in command 0x%02" PRIx32 " (id 0x%03" PRIx32 ")", b, a);
        return;

    /* Of a board */
    case BOARD_EVENT_ADDRESS:
        snprintf(text, size, "address changed from %" PRIu32 " to %" PRIu32, a, b);
        return;
    case BOARD_EVENT_RESTART:
        snprintf(text, size, "%s", a ? "bootloader entered" : "application started");
        return;
    case BOARD_EVENT_FIRMWARE:
        snprintf(text, size, "firmware received, %" PRIu32 " bytes, CRC-32 %08" PRIx32, a, b);
        return;
    case BOARD_EVENT_OVERFLOW:
        snprintf(text, size, "frames lost, %" PRIu32 " so far", a);
        return;
    case BOARD_EVENT_OVER_HEATED:
        snprintf(text, size, "axis %u is too hot: %.1f degree C", axis,
                 (int32_t)a * ICUB_TEMPERATURE_C);
        return;
    case BOARD_EVENT_SILENT:
        snprintf(text, size, "external board silent for %" PRIu32 " ms", a);
        return;
    case BOARD_EVENT_HEARD:
        snprintf(text, size, "external board heard");
        return;
    }
    snprintf(text, size, "event %d", (int)event->kind);
}

void board_event_format(const struct boards *boards, const struct board_event *event, char *text,
                        size_t size)
{
    const struct board *board = boards->board[event->board];
    char what[192];

    event_describe(board->bus->config.personality, event, what, sizeof what);
    snprintf(text, size, "%.6f s: %s (bus %d, address %d): %s", (double)event->time_ns * 1e-9,
             board->config.name, event->bus, event->address, what);
}
