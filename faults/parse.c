/* SPDX-License-Identifier: Apache-2.0 */
/* Parses a fault's line (faults/faults.h): name, target, kind, parameters and time. */
#include "faults/kinds.h"

#include "base/text.h"

#include <stdio.h>
#include <string.h>

enum { WORDS_MAX = 8, NAMES_MAX = 512, WORD_SIZE = 64 };

/* Readings of a motor's sensor under over_temperature and over_current; beyond every limit */
#define HOT_C 200.0
#define LARGE_A 1000.0

struct fault_reader {
    const char *line;
    char buffer[FAULT_TEXT_SIZE];
    char *word[WORDS_MAX];
    size_t count, at;
    const struct fault_names *names;
    struct error *error;
};

/* Sets the error for an unexpected word, or for an unexpected end of the line. */
static enum error_code fault_refuse_word(struct fault_reader *r, const char *found,
                                         const char *expected)
{
    return error_set(r->error, ERROR_INPUT, "fault \"%.159s\": found %s%.64s%s, expected %s",
                     r->line, found ? "\"" : "", found ? found : "nothing", found ? "\"" : "",
                     expected);
}

/* Sets the error for an unknown name and suggests the nearest known one. */
static enum error_code fault_refuse_name(struct fault_reader *r, const char *what, const char *name,
                                         const char *const *names, size_t count)
{
    const char *nearest = text_nearest(name, names, count < NAMES_MAX ? count : NAMES_MAX);
    char expected[256];
    size_t used = (size_t)snprintf(expected, sizeof expected, "%s", what);

    if (nearest) {
        snprintf(expected + used, sizeof expected - used, " \"%.64s\"", nearest);
    } else if (count > 0 && count <= 20) {
        for (size_t i = 0; i < count && used < sizeof expected; i++) {
            used += (size_t)snprintf(expected + used, sizeof expected - used, "%s%.64s",
                                     i ? ", " : ": ", names[i]);
        }
    }
    return fault_refuse_word(r, name, expected);
}

/* Finds a name in a list; returns false when it is not there. */
static bool fault_find_word(const char *name, const char *const *names, size_t count, size_t *index)
{
    for (size_t i = 0; i < count; i++) {
        if (!strcmp(name, names[i])) {
            *index = i;
            return true;
        }
    }
    return false;
}

/* Splits the line into words. */
static enum error_code fault_split_line(struct fault_reader *r)
{
    char *rest = NULL;

    /* Messages and logs repeat the line, so it must not contain control characters */
    for (const char *at = r->line; *at; at++) {
        if (((unsigned char)*at < 0x20 && *at != '\t') || *at == 0x7f) {
            return error_set(r->error, ERROR_INPUT,
                             "fault: found a control character at column %td, expected text",
                             at - r->line + 1);
        }
    }
    if (strlen(r->line) >= sizeof r->buffer) {
        return error_set(r->error, ERROR_INPUT,
                         "fault \"%.40s...\": found %zu characters, expected at most %zu", r->line,
                         strlen(r->line), sizeof r->buffer - 1);
    }
    memcpy(r->buffer, r->line, strlen(r->line) + 1);
    for (char *word = strtok_r(r->buffer, " \t", &rest); word;
         word = strtok_r(NULL, " \t", &rest)) {
        if (r->count == WORDS_MAX) {
            return fault_refuse_word(r, word, "nothing more");
        }
        r->word[r->count++] = word;
    }
    return ERROR_NONE;
}

/* Returns the next word without consuming it, or NULL at the end of the line. */
static const char *fault_next_word(const struct fault_reader *r)
{
    return r->at < r->count ? r->word[r->at] : NULL;
}

/* Reads the optional name of the fault, such as "knee:". */
static enum error_code fault_read_name(struct fault_reader *r, struct fault *fault)
{
    char *word = r->count ? r->word[0] : NULL;
    size_t length = word ? strlen(word) : 0;

    if (length < 2 || word[length - 1] != ':') {
        return ERROR_NONE;
    }
    word[length - 1] = '\0';
    if (!text_is_name(word)) {
        return fault_refuse_word(r, word, "a name of at most 63 letters, digits and _ - .");
    }
    snprintf(fault->name, sizeof fault->name, "%s", word);
    r->at = 1;
    return ERROR_NONE;
}

/* Reads the name of a joint. Refuses a joint whose drive does not fit the target. */
static enum error_code fault_read_motor(struct fault_reader *r, const char *name,
                                        struct fault *fault)
{
    if (!fault_find_word(name, r->names->joint, r->names->njoint, &fault->index)) {
        return fault_refuse_name(r, "a joint", name, r->names->joint, r->names->njoint);
    }
    if (!r->names->driven[fault->index]) {
        return error_set(r->error, ERROR_UNSUPPORTED,
                         "fault \"%.159s\": joint %.64s has no drive that could break", r->line,
                         name);
    }
    if (r->names->hydraulic[fault->index] != (fault->target == FAULT_VALVE)) {
        const bool motor = fault->target == FAULT_VALVE;

        return error_set(r->error, ERROR_UNSUPPORTED,
                         "fault \"%.159s\": joint %.64s has %s, expected \"%s %.64s\" or %s",
                         r->line, name, motor ? "a motor" : "a hydraulic cylinder",
                         motor ? "motor" : "valve", name,
                         motor ? "a hydraulic joint" : "a joint with a motor");
    }
    return ERROR_NONE;
}

/* Reads a channel of a sensor whose first channel is `first`. Without a channel, selects all
 * channels of the sensor. */
static enum error_code fault_read_channel(struct fault_reader *r, const char *channel,
                                          const char *const *channels, size_t count, size_t first,
                                          struct fault *fault)
{
    size_t index = 0;

    if (channel && !fault_find_word(channel, channels, count, &index)) {
        return fault_refuse_name(r, "a channel", channel, channels, count);
    }
    fault->index = first + index;
    fault->channels = channel ? 1 : count;
    return ERROR_NONE;
}

/* Reads a sensor. Names may contain dots, so the name ends at the last dot unless the whole word is
 * a known name. */
static enum error_code fault_read_sensor(struct fault_reader *r, const char *text,
                                         struct fault *fault)
{
    const struct fault_names *names = r->names;
    char name[WORD_SIZE * 2];
    size_t ft_first = names->njoint * SENSOR_JOINT_CHANNELS, index;
    const char *channel = NULL;
    char *dot;

    /* Split the word at its last dot, unless the whole word is the name of a force-torque sensor */
    snprintf(name, sizeof name, "%s", text);
    dot = strrchr(name, '.');
    if (dot && !fault_find_word(name, names->ft, names->nft, &index)) {
        *dot = '\0';
        channel = dot + 1;
    }

    /* The inertial sensor and force-torque sensors accept faults of the whole sensor */
    if (names->imu && !strcmp(name, "imu")) {
        return fault_read_channel(r, channel, sensor_imu_channels, SENSOR_IMU_CHANNELS,
                                  ft_first + names->nft * SENSOR_FT_CHANNELS, fault);
    }
    if (fault_find_word(name, names->ft, names->nft, &index)) {
        return fault_read_channel(r, channel, sensor_ft_channels, SENSOR_FT_CHANNELS,
                                  ft_first + index * SENSOR_FT_CHANNELS, fault);
    }

    /* A joint's sensor needs a channel */
    if (!fault_find_word(name, names->joint, names->njoint, &index)) {
        bool no_ft = text_nearest(name, names->joint, names->njoint) || names->nft == 0;

        return no_ft ? fault_refuse_name(r, "a joint", name, names->joint, names->njoint)
                     : fault_refuse_name(r, "a joint or a force-torque sensor", name, names->ft,
                                         names->nft);
    }
    if (!channel) {
        return fault_refuse_word(r, text,
                                 "JOINT.CHANNEL, a channel being link_encoder, motor_encoder, "
                                 "current, torque or temperature");
    }
    return fault_read_channel(r, channel, sensor_joint_channels, SENSOR_JOINT_CHANNELS,
                              index * SENSOR_JOINT_CHANNELS, fault);
}

/* Reads a board by its name or as "BUS/ADDRESS". */
static enum error_code fault_read_board(struct fault_reader *r, const char *text,
                                        struct fault *fault)
{
    const struct fault_names *names = r->names;
    const char *slash = strrchr(text, '/');
    int64_t address;

    if (fault_find_word(text, names->board, names->nboard, &fault->index)) {
        return ERROR_NONE;
    }
    if (slash && text_to_int(slash + 1, 0, 255, &address)) {
        for (size_t i = 0; i < names->nboard; i++) {
            const char *bus = names->bus[names->board_bus[i]];

            if (names->board_address[i] == address && strlen(bus) == (size_t)(slash - text) &&
                !strncmp(bus, text, (size_t)(slash - text))) {
                fault->index = i;
                return ERROR_NONE;
            }
        }
    }
    return fault_refuse_name(r, "a board, as BUS/ADDRESS or by its name,", text, names->board,
                             names->nboard);
}

/* Reads the target: its type, then its name. */
static enum error_code fault_read_target(struct fault_reader *r, struct fault *fault)
{
    static const char expected[] = "sensor, board, motor, bus, supply, valve or hydraulic_supply";
    const char *word = fault_next_word(r), *name;
    size_t target;

    /* Find the type of the target */
    if (!word) {
        return fault_refuse_word(r, NULL, expected);
    }
    if (!fault_find_word(word, fault_target_words, FAULT_TARGETS, &target)) {
        return fault_refuse_name(r, expected, word, fault_target_words, 0);
    }
    fault->target = (enum fault_target)target;
    r->at++;
    if (fault->target == FAULT_HYDRAULIC_SUPPLY && !r->names->oil_store) {
        return error_set(r->error, ERROR_UNSUPPORTED,
                         "fault \"%.159s\": found no hydraulic supply with an accumulator, "
                         "expected one: a constant pressure cannot be lost",
                         r->line);
    }
    if (fault->target == FAULT_SUPPLY || fault->target == FAULT_HYDRAULIC_SUPPLY) {
        return ERROR_NONE;
    }

    /* Find the name of the target */
    name = fault_next_word(r);
    if (!name) {
        return fault_refuse_word(r, NULL, "what is broken");
    }
    r->at++;
    switch (fault->target) {
    case FAULT_MOTOR:
    case FAULT_VALVE:
        return fault_read_motor(r, name, fault);
    case FAULT_SENSOR:
        return fault_read_sensor(r, name, fault);
    case FAULT_BOARD:
        return fault_read_board(r, name, fault);
    default:
        return fault_find_word(name, r->names->bus, r->names->nbus, &fault->index)
                   ? ERROR_NONE
                   : fault_refuse_name(r, "a bus", name, r->names->bus, r->names->nbus);
    }
}

/* Reads the kind of the fault. Refuses kinds that the target does not support. */
static enum error_code fault_read_kind(struct fault_reader *r, struct fault *fault,
                                       const struct fault_rule **out)
{
    const char *word = fault_next_word(r), *kinds[FAULT_RULES];
    size_t count = 0;

    for (size_t i = 0; i < FAULT_RULES; i++) {
        if (fault_rules[i].target != fault->target) {
            continue;
        }
        if (word && !strcmp(word, fault_rules[i].word)) {
            *out = &fault_rules[i];
            fault->kind = fault_rules[i].kind;
            r->at++;
            if (fault_rules[i].needs_wire && !r->names->wire[fault->index]) {
                return error_set(
                    r->error, ERROR_UNSUPPORTED,
                    "fault \"%.159s\": bus %.64s is not in wire mode, which this kind needs",
                    r->line, r->names->bus[fault->index]);
            }
            return ERROR_NONE;
        }
        kinds[count++] = fault_rules[i].word;
    }
    return fault_refuse_name(r, "a kind of fault of this target", word ? word : "nothing", kinds,
                             count);
}

/* Reads the time window, FROM..TO or "manual". */
static enum error_code fault_read_window(struct fault_reader *r, const char *word,
                                         struct fault *fault)
{
    const char *dots = strstr(word, "..");
    char from[WORD_SIZE];
    double begin = 0.0, end = 0.0;

    fault->timed = true;
    if (!strcmp(word, "manual")) {
        fault->from_ns = fault->to_ns = INT64_MAX;
        return ERROR_NONE;
    }
    snprintf(from, sizeof from, "%.*s", (int)(dots - word), word);
    if (dots - word >= (ptrdiff_t)sizeof from || !text_to_double(from, &begin) || begin < 0.0 ||
        begin > 1e9 ||
        (dots[2] && (!text_to_double(dots + 2, &end) || end <= begin || end > 1e9))) {
        return fault_refuse_word(r, word, "FROM..TO in seconds, FROM before TO, or FROM..");
    }
    fault->from_ns = (int64_t)(begin * 1e9 + 0.5);
    fault->to_ns = dots[2] ? (int64_t)(end * 1e9 + 0.5) : INT64_MAX;
    return ERROR_NONE;
}

/* Returns whether a word is a time window, FROM..TO or "manual". */
static bool fault_is_window(const char *word)
{
    return strstr(word, "..") || !strcmp(word, "manual");
}

/* Reads a parameter of the kind, or id=... of a fault on a bus. */
static enum error_code fault_read_parameter(struct fault_reader *r, const struct fault_rule *rule,
                                            const char *word, bool given[FAULT_PARAMETERS],
                                            struct fault *fault)
{
    const char *equals = strchr(word, '=');
    size_t length = equals ? (size_t)(equals - word) : 0;
    char expected[128];
    double value;

    /* id limits a fault on a bus to frames with one identifier */
    if (length == 2 && !strncmp(word, "id", 2) && fault->target == FAULT_BUS) {
        return text_to_int(equals + 1, 0, 0x1fffffff, &fault->id)
                   ? ERROR_NONE
                   : fault_refuse_word(r, word, "id=0 to id=0x1fffffff");
    }

    /* A parameter is KEY=VALUE. The first parameter may be VALUE alone */
    for (int i = 0; i < FAULT_PARAMETERS; i++) {
        const struct fault_parameter *p = &rule->parameter[i];
        bool meant = p->key &&
                     (equals ? strlen(p->key) == length && !strncmp(p->key, word, length) : i == 0);

        if (!meant) {
            continue;
        }
        snprintf(expected, sizeof expected, "%s=%g to %g %s, once", p->key, p->min, p->max,
                 p->unit);
        if (given[i] || !text_to_double(equals ? equals + 1 : word, &value) || value < p->min ||
            value > p->max) {
            return fault_refuse_word(r, word, expected);
        }
        given[i] = true;
        fault->value[i] = value;
        return ERROR_NONE;
    }

    snprintf(
        expected, sizeof expected, "%s%s%s%sFROM..TO or manual",
        rule->parameter[0].key ? rule->parameter[0].key : "", rule->parameter[0].key ? "=, " : "",
        rule->parameter[1].key ? rule->parameter[1].key : "", rule->parameter[1].key ? "=, " : "");
    return fault_refuse_word(r, word, expected);
}

/* Reads the parameters and the time window. Missing parameters get their defaults. */
static enum error_code fault_read_parameters(struct fault_reader *r, const struct fault_rule *rule,
                                             struct fault *fault)
{
    bool given[FAULT_PARAMETERS] = {false};

    for (int i = 0; i < FAULT_PARAMETERS; i++) {
        fault->value[i] = rule->parameter[i].otherwise;
    }

    /* Parameters come first. The time window ends the line */
    for (const char *word = fault_next_word(r); word; word = fault_next_word(r)) {
        enum error_code code;

        r->at++;
        code = fault_is_window(word) ? fault_read_window(r, word, fault)
                                     : fault_read_parameter(r, rule, word, given, fault);
        if (code) {
            return code;
        }
        if (fault_is_window(word) && fault_next_word(r)) {
            return fault_refuse_word(r, fault_next_word(r), "nothing after the time");
        }
    }

    for (int i = 0; i < FAULT_PARAMETERS; i++) {
        if (rule->parameter[i].required && !given[i]) {
            return fault_refuse_word(r, NULL, rule->parameter[i].key);
        }
    }
    return ERROR_NONE;
}

enum error_code fault_parse(const char *text, const struct fault_names *names, struct fault *fault,
                            struct error *error)
{
    struct fault_reader r = {.line = text, .names = names, .error = error};
    const struct fault_rule *rule = NULL;
    enum error_code code;

    /* Defaults: no name, all frames, active from the start without end */
    memset(fault, 0, sizeof *fault);
    fault->id = -1;
    fault->to_ns = INT64_MAX;

    /* [NAME:] TARGET KIND [PARAMETER...] [WHEN] */
    if ((code = fault_split_line(&r)) || (code = fault_read_name(&r, fault)) ||
        (code = fault_read_target(&r, fault)) || (code = fault_read_kind(&r, fault, &rule)) ||
        (code = fault_read_parameters(&r, rule, fault))) {
        return code;
    }

    /* Turn a motor's fault that its drive measures into the fault of a sensor with a fixed
     * reading */
    const bool hot = fault->kind == FAULT_OVER_TEMPERATURE;

    if (hot || fault->kind == FAULT_OVER_CURRENT) {
        fault->target = FAULT_SENSOR;
        fault->channels = 1;
        fault->index =
            fault->index * SENSOR_JOINT_CHANNELS + (hot ? SENSOR_TEMPERATURE : SENSOR_CURRENT);
        fault->kind = FAULT_WRONG;
        fault->value[0] = 0.0;
        fault->value[1] = hot ? HOT_C : LARGE_A;
    }
    snprintf(fault->text, sizeof fault->text, "%s", text);
    return ERROR_NONE;
}
