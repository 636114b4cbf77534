/* SPDX-License-Identifier: Apache-2.0 */
/* Lists the possible faults of a rig. Each is listed by the beginning of its line. */
#include "faults/kinds.h"

#include <stdio.h>

/* The names to combine, and the function that receives the lines. */
struct fault_lister {
    const struct fault_names *names;
    fault_list_put put;
    void *context;
};

/* Lists "TARGET KIND" for each kind that the parser accepts. text: "TARGET". */
static void fault_list_kinds(const struct fault_lister *lister, enum fault_target target,
                             const char *text)
{
    char line[FAULT_TEXT_SIZE + 64];
    struct fault unused;

    for (size_t i = 0; i < FAULT_RULES; i++) {
        const struct fault_rule *rule = &fault_rules[i];
        const struct fault_parameter *needed = &rule->parameter[0];
        int length;

        if (rule->target != target) {
            continue;
        }
        length = snprintf(line, sizeof line, "%s %s", text, rule->word);
        if (length >= FAULT_TEXT_SIZE) {
            continue;
        }
        /* Add the required parameter for the parser. The listed line omits it */
        if (needed->key && needed->required) {
            snprintf(line + length, sizeof line - (size_t)length, " %s=%.9g", needed->key,
                     needed->max);
        }
        if (!fault_parse(line, lister->names, &unused, NULL)) {
            line[length] = '\0';
            lister->put(lister->context, line, rule->means);
        }
    }
}

/* Lists the kinds of a target with this name. channel: sensor channel, or NULL. */
static void fault_list_target(const struct fault_lister *lister, enum fault_target target,
                              const char *name, const char *channel)
{
    char text[FAULT_TEXT_SIZE];

    snprintf(text, sizeof text, "%s %s%s%s", fault_target_words[target], name, channel ? "." : "",
             channel ? channel : "");
    fault_list_kinds(lister, target, text);
}

/* Lists the faults of all sensors: of each channel, and of each whole sensor. */
static void fault_list_sensors(const struct fault_lister *lister)
{
    const struct fault_names *names = lister->names;

    for (size_t j = 0; j < names->njoint; j++) {
        for (size_t c = 0; c < SENSOR_JOINT_CHANNELS; c++) {
            fault_list_target(lister, FAULT_SENSOR, names->joint[j], sensor_joint_channels[c]);
        }
    }
    for (size_t f = 0; f < names->nft; f++) {
        fault_list_target(lister, FAULT_SENSOR, names->ft[f], NULL);
        for (size_t c = 0; c < SENSOR_FT_CHANNELS; c++) {
            fault_list_target(lister, FAULT_SENSOR, names->ft[f], sensor_ft_channels[c]);
        }
    }
    fault_list_target(lister, FAULT_SENSOR, "imu", NULL);
    for (size_t c = 0; c < SENSOR_IMU_CHANNELS; c++) {
        fault_list_target(lister, FAULT_SENSOR, "imu", sensor_imu_channels[c]);
    }
}

void faults_list(const struct fault_names *names, fault_list_put put, void *context)
{
    const struct fault_lister lister = {names, put, context};

    for (size_t j = 0; j < names->njoint; j++) {
        fault_list_target(&lister, FAULT_MOTOR, names->joint[j], NULL);
        fault_list_target(&lister, FAULT_VALVE, names->joint[j], NULL);
    }
    for (size_t b = 0; b < names->nboard; b++) {
        fault_list_target(&lister, FAULT_BOARD, names->board[b], NULL);
    }
    for (size_t b = 0; b < names->nbus; b++) {
        fault_list_target(&lister, FAULT_BUS, names->bus[b], NULL);
    }
    fault_list_kinds(&lister, FAULT_SUPPLY, fault_target_words[FAULT_SUPPLY]);
    fault_list_kinds(&lister, FAULT_HYDRAULIC_SUPPLY, fault_target_words[FAULT_HYDRAULIC_SUPPLY]);
    fault_list_sensors(&lister);
}
