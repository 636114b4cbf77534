/* SPDX-License-Identifier: Apache-2.0 */
/* The kinds of faults: one row for each target and kind, with its parameters and their ranges. */
#include "faults/kinds.h"

#include <stdio.h>

#define SHARE                                                                                      \
    {                                                                                              \
        "share", "of the time", 0.0, 1.0, false, 0.5                                               \
    }
#define PROBABILITY                                                                                \
    {                                                                                              \
        "p", "of the frames", 0.0, 1.0, true, 0.0                                                  \
    }
#define SECONDS(key, max)                                                                          \
    {                                                                                              \
        key, "s", 1e-6, max, true, 0.0                                                             \
    }

#define LEAK_FLOW                                                                                  \
    {                                                                                              \
        "flow", "m3/s", 0.0, 1e-2, true, 0.0                                                       \
    }

/* One row: target, kind, word, meaning, whether the kind needs wire mode, parameters. */
#define RULE(of, what, word, means, wire, ...)                                                     \
    {                                                                                              \
        FAULT_##of, FAULT_##what, word, means, wire,                                               \
        {                                                                                          \
            __VA_ARGS__                                                                            \
        }                                                                                          \
    }
const struct fault_rule fault_rules[FAULT_RULES] = {
    RULE(SENSOR, OFF, "off", "reads 0", false, {0}),
    RULE(SENSOR, STUCK, "stuck", "repeats its last value", false, {0}),
    RULE(SENSOR, GARBAGE, "garbage", "random values around 0", false,
         {"amplitude", "of the channel's unit", 0.0, 1e9, true, 0.0}),
    RULE(SENSOR, WRONG, "wrong", "gain * value + offset", false,
         {"gain", "", -1e6, 1e6, false, 1.0},
         {"offset", "of the channel's unit", -1e9, 1e9, false, 0.0}),
    RULE(SENSOR, SLOW, "slow", "is updated only once a period", false, SECONDS("period", 1e3)),
    RULE(SENSOR, DELAYED, "delayed", "reads what was true some time ago", false,
         SECONDS("delay", 1.0)),
    RULE(SENSOR, INTERMITTENT, "intermittent", "reads 0 for a random share of the time", false,
         SHARE, {"dwell", "s, mean length of a gap", 1e-4, 1e3, false, 0.02}),

    RULE(BOARD, OFF, "off", "without power; boots again afterwards", false, {0}),
    RULE(BOARD, STUCK, "stuck", "frames repeat their last data", false, {0}),
    RULE(BOARD, GARBAGE, "garbage", "frames carry random data", false, {0}),
    RULE(BOARD, SLOW, "slow", "sends only every n-th frame of each identifier", false,
         {"factor", "", 2.0, 1e6, true, 0.0}),
    RULE(BOARD, DELAYED, "delayed", "sends its frames late", false, SECONDS("delay", 1.0)),
    RULE(BOARD, INTERMITTENT, "intermittent",
         "loses contact with the bus for a random share of the time", false, SHARE,
         {"dwell", "s, mean length of a gap", 1e-4, 1e3, false, 0.02}),
    RULE(BOARD, HUNG, "hung", "the firmware hangs, once, until its watchdog resets it", false,
         {"watchdog", "s", 1e-3, 60.0, false, 1.0}),

    RULE(MOTOR, OPEN_PHASE, "open_phase", "no current flows", false, {0}),
    RULE(MOTOR, SHORT, "short", "the winding is short-circuited and brakes", false, {0}),
    RULE(MOTOR, JAM, "jam", "the rotor is locked", false, {0}),
    RULE(MOTOR, SPRING_BREAK, "spring_break", "the series spring transmits no torque", false, {0}),
    RULE(MOTOR, OVER_TEMPERATURE, "over_temperature", "its drive reads a winding of 200 degree C",
         false, {0}),
    RULE(MOTOR, OVER_CURRENT, "over_current", "its drive reads 1000 A", false, {0}),

    RULE(BUS, LOSS, "loss", "frames are lost", false, PROBABILITY),
    RULE(BUS, CORRUPTION, "corruption", "a data bit is flipped, undetected by the CRC", false,
         PROBABILITY),
    RULE(BUS, LATE, "late", "frames arrive late", false, SECONDS("delay", 1.0)),
    RULE(BUS, DUPLICATE, "duplicate", "frames arrive twice", false, PROBABILITY),
    RULE(BUS, BUS_OFF, "bus_off", "the boards' controller is bus-off", false, {0}),
    RULE(BUS, ERROR_BURST, "error_burst", "bit errors on the wire", true, PROBABILITY),
    RULE(BUS, ID_COLLISION, "id_collision", "another node sends with an identifier that is in use",
         true, {"p", "of the frames", 0.0, 1.0, false, 1.0}),

    RULE(SUPPLY, SAG, "sag", "the supply voltage drops by so much", false,
         {"volts", "V", 0.0, 1e4, true, 0.0}),
    RULE(SUPPLY, SURGE, "surge", "the supply voltage rises by so much", false,
         {"volts", "V", 0.0, 1e4, true, 0.0}),

    RULE(VALVE, OFF, "off", "no current; its spool goes to the middle", false, {0}),
    RULE(VALVE, STUCK, "stuck", "its spool stays where it is", false, {0}),
    RULE(VALVE, SHIFTED, "shifted", "its spool's middle is off, positive as a voltage", false,
         {"share", "of the full opening", -1.0, 1.0, true, 0.0}),
    RULE(VALVE, LEAK, "leak", "oil leaks past the piston, so much at the nominal pressure", false,
         LEAK_FLOW),

    RULE(HYDRAULIC_SUPPLY, PUMP_LOSS, "pump_loss", "the pump gives so much less", false,
         {"share", "of its flow", 0.0, 1.0, false, 1.0}),
    RULE(HYDRAULIC_SUPPLY, LEAK, "leak", "oil leaks to the return, so much at the nominal pressure",
         false, LEAK_FLOW),
    RULE(HYDRAULIC_SUPPLY, RELIEF_SHUT, "relief_shut",
         "the relief valve does not open; the pump stalls at 1.5 times its pressure", false, {0}),
};

const char *const fault_target_words[FAULT_TARGETS] = {
    [FAULT_SENSOR] = "sensor",
    [FAULT_BOARD] = "board",
    [FAULT_MOTOR] = "motor",
    [FAULT_BUS] = "bus",
    [FAULT_SUPPLY] = "supply",
    [FAULT_VALVE] = "valve",
    [FAULT_HYDRAULIC_SUPPLY] = "hydraulic_supply",
};

const char *const sensor_joint_channels[SENSOR_JOINT_CHANNELS] = {
    [SENSOR_LINK_ENCODER] = "link_encoder", [SENSOR_MOTOR_ENCODER] = "motor_encoder",
    [SENSOR_CURRENT] = "current",           [SENSOR_TORQUE] = "torque",
    [SENSOR_TEMPERATURE] = "temperature",
};
const char *const sensor_ft_channels[SENSOR_FT_CHANNELS] = {"fx", "fy", "fz", "tx", "ty", "tz"};
const char *const sensor_imu_channels[SENSOR_IMU_CHANNELS] = {
    "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z", "mag_x",
    "mag_y",  "mag_z",  "quat_w", "quat_x",  "quat_y",  "quat_z"};

size_t faults_help(size_t line, char *text, size_t size)
{
    const struct fault_rule *rule = &fault_rules[line < FAULT_RULES ? line : 0];
    int used;

    if (!text || line >= FAULT_RULES) {
        return FAULT_RULES;
    }
    /* Write the target and the kind, then the parameters, then the meaning */
    used = snprintf(text, size, "%s ... %s", fault_target_words[rule->target], rule->word);
    for (int i = 0; i < FAULT_PARAMETERS && used > 0 && (size_t)used < size; i++) {
        const struct fault_parameter *p = &rule->parameter[i];

        if (p->key) {
            used += snprintf(text + used, size - (size_t)used, p->required ? " %s%s" : " [%s%s]",
                             p->key, "=X");
        }
    }
    if (used > 0 && (size_t)used < size) {
        snprintf(text + used, size - (size_t)used, ": %s%s", rule->means,
                 rule->needs_wire ? " (wire mode)" : "");
    }
    return FAULT_RULES;
}
