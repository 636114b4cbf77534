/* SPDX-License-Identifier: Apache-2.0 */
/* The table of faults: reading a line, the clock, the events. */
#include "boards/faults.h"

#include "base/ring.h"
#include "base/text.h"

#include <float.h>
#include <stdio.h>
#include <string.h>

enum { EVENT_SLOTS = 1024, WORDS_MAX = 8, NAMES_MAX = 512, WORD_SIZE = 64 };

/* ---- the kinds ---- */

struct parameter {
    const char *key, *unit;
    double min, max;
    bool required;
    double otherwise; /* when it is not given */
};

struct rule {
    enum fault_target target;
    enum fault_kind kind;
    const char *word;
    const char *means;
    bool needs_wire;
    struct parameter parameter[FAULT_PARAMETERS];
};

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

static const struct rule rules[] = {
    {FAULT_SENSOR, FAULT_OFF, "off", "reads 0", false, {{0}}},
    {FAULT_SENSOR, FAULT_STUCK, "stuck", "keeps its last value", false, {{0}}},
    {FAULT_SENSOR,
     FAULT_GARBAGE,
     "garbage",
     "random values around 0",
     false,
     {{"amplitude", "of the channel's unit", 0.0, 1e9, true, 0.0}}},
    {FAULT_SENSOR,
     FAULT_WRONG,
     "wrong",
     "gain times the value plus an offset",
     false,
     {{"gain", "", -1e6, 1e6, false, 1.0},
      {"offset", "of the channel's unit", -1e9, 1e9, false, 0.0}}},
    {FAULT_SENSOR,
     FAULT_SLOW,
     "slow",
     "a new value only every period",
     false,
     {SECONDS("period", 1e3)}},
    {FAULT_SENSOR,
     FAULT_DELAYED,
     "delayed",
     "the value of some time ago",
     false,
     {SECONDS("delay", 1.0)}},
    {FAULT_SENSOR,
     FAULT_INTERMITTENT,
     "intermittent",
     "reads 0 a share of the time, at random",
     false,
     {SHARE, {"dwell", "s, mean length of a gap", 1e-4, 1e3, false, 0.02}}},

    {FAULT_BOARD, FAULT_OFF, "off", "without power; boots anew afterwards", false, {{0}}},
    {FAULT_BOARD, FAULT_STUCK, "stuck", "frames keep their last data", false, {{0}}},
    {FAULT_BOARD, FAULT_GARBAGE, "garbage", "frames carry random data", false, {{0}}},
    {FAULT_BOARD,
     FAULT_SLOW,
     "slow",
     "of each id only every n-th frame is sent",
     false,
     {{"factor", "", 2.0, 1e6, true, 0.0}}},
    {FAULT_BOARD,
     FAULT_DELAYED,
     "delayed",
     "frames are sent later",
     false,
     {SECONDS("delay", 1.0)}},
    {FAULT_BOARD,
     FAULT_INTERMITTENT,
     "intermittent",
     "without contact to the bus a share of the time, at random",
     false,
     {SHARE, {"dwell", "s, mean length of a gap", 1e-4, 1e3, false, 0.02}}},
    {FAULT_BOARD,
     FAULT_HUNG,
     "hung",
     "once, the firmware stands still until its watchdog resets it",
     false,
     {{"watchdog", "s", 1e-3, 60.0, false, 1.0}}},

    {FAULT_MOTOR, FAULT_OPEN_PHASE, "open_phase", "no current flows", false, {{0}}},
    {FAULT_MOTOR, FAULT_SHORT, "short", "the winding is shorted and brakes", false, {{0}}},
    {FAULT_MOTOR, FAULT_JAM, "jam", "the rotor is locked", false, {{0}}},
    {FAULT_MOTOR,
     FAULT_SPRING_BREAK,
     "spring_break",
     "the series spring carries nothing",
     false,
     {{0}}},

    {FAULT_BUS, FAULT_LOSS, "loss", "frames never arrive", false, {PROBABILITY}},
    {FAULT_BUS,
     FAULT_CORRUPTION,
     "corruption",
     "a data bit is flipped, unseen by the CRC",
     false,
     {PROBABILITY}},
    {FAULT_BUS, FAULT_LATE, "late", "frames arrive later", false, {SECONDS("delay", 1.0)}},
    {FAULT_BUS, FAULT_DUPLICATE, "duplicate", "frames arrive twice", false, {PROBABILITY}},
    {FAULT_BUS, FAULT_BUS_OFF, "bus_off", "the boards are off the bus", false, {{0}}},
    {FAULT_BUS, FAULT_ERROR_BURST, "error_burst", "bit errors on the wire", true, {PROBABILITY}},
    {FAULT_BUS,
     FAULT_ID_COLLISION,
     "id_collision",
     "a stranger sends with an id in use",
     true,
     {{"p", "of the frames", 0.0, 1.0, false, 1.0}}},

    {FAULT_SUPPLY,
     FAULT_SAG,
     "sag",
     "the source is so much below its voltage",
     false,
     {{"volts", "V", 0.0, 1e4, true, 0.0}}},
};

enum { RULES = sizeof rules / sizeof rules[0] };

static const char *const target_words[] = {
    [FAULT_SENSOR] = "sensor", [FAULT_BOARD] = "board",   [FAULT_MOTOR] = "motor",
    [FAULT_BUS] = "bus",       [FAULT_SUPPLY] = "supply",
};
enum { TARGETS = sizeof target_words / sizeof target_words[0] };

static const char *const joint_channels[SENSOR_JOINT_CHANNELS] = {
    [SENSOR_LINK_ENCODER] = "link_encoder", [SENSOR_MOTOR_ENCODER] = "motor_encoder",
    [SENSOR_CURRENT] = "current",           [SENSOR_TORQUE] = "torque",
    [SENSOR_TEMPERATURE] = "temperature",
};
static const char *const ft_channels[SENSOR_FT_CHANNELS] = {"fx", "fy", "fz", "tx", "ty", "tz"};
static const char *const imu_channels[SENSOR_IMU_CHANNELS] = {"gyro_x",  "gyro_y",  "gyro_z",
                                                              "accel_x", "accel_y", "accel_z"};

size_t faults_help(size_t line, char *text, size_t size)
{
    const struct rule *rule = &rules[line < RULES ? line : 0];
    int used;

    if (!text || line >= RULES) {
        return RULES;
    }
    used = snprintf(text, size, "%s ... %s", target_words[rule->target], rule->word);
    for (int i = 0; i < FAULT_PARAMETERS && used > 0 && (size_t)used < size; i++) {
        const struct parameter *p = &rule->parameter[i];

        if (p->key) {
            used += snprintf(text + used, size - (size_t)used, p->required ? " %s%s" : " [%s%s]",
                             p->key, "=X");
        }
    }
    if (used > 0 && (size_t)used < size) {
        snprintf(text + used, size - (size_t)used, ": %s%s", rule->means,
                 rule->needs_wire ? " (wire mode)" : "");
    }
    return RULES;
}

/* ---- reading a line ---- */

struct reader {
    const char *line;
    char buffer[FAULT_TEXT_SIZE];
    char *word[WORDS_MAX];
    size_t count, at;
    const struct fault_names *names;
    struct error *error;
};

static enum error_code fault_refuse_word(struct reader *r, const char *found, const char *expected)
{
    return error_set(r->error, ERROR_INPUT, "fault \"%.159s\": found %s%.64s%s, expected %s",
                     r->line, found ? "\"" : "", found ? found : "nothing", found ? "\"" : "",
                     expected);
}

/* An unknown name, with the nearest of those that exist. */
static enum error_code fault_refuse_name(struct reader *r, const char *what, const char *name,
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

static enum error_code fault_split_line(struct reader *r)
{
    char *rest = NULL;

    /* messages and logs repeat the line */
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

/* The word at the reader's place, or NULL at the end. */
static const char *fault_next_word(const struct reader *r)
{
    return r->at < r->count ? r->word[r->at] : NULL;
}

/* "knee:" before the target */
static enum error_code fault_read_name(struct reader *r, struct fault *fault)
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

static enum error_code fault_read_motor(struct reader *r, const char *name, struct fault *fault)
{
    if (!fault_find_word(name, r->names->joint, r->names->njoint, &fault->index)) {
        return fault_refuse_name(r, "a joint", name, r->names->joint, r->names->njoint);
    }
    if (!r->names->driven[fault->index]) {
        return error_set(r->error, ERROR_UNSUPPORTED,
                         "fault \"%.159s\": joint %.64s has no drive that could break", r->line,
                         name);
    }
    return ERROR_NONE;
}

/* One channel of a group that starts at first, or all of it when the line names none. */
static enum error_code fault_read_channel(struct reader *r, const char *channel,
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

/* The name before the last dot that makes it known: names may hold dots themselves. */
static enum error_code fault_read_sensor(struct reader *r, const char *text, struct fault *fault)
{
    const struct fault_names *names = r->names;
    char name[WORD_SIZE * 2];
    size_t ft_first = names->njoint * SENSOR_JOINT_CHANNELS, index;
    const char *channel = NULL;
    char *dot;

    snprintf(name, sizeof name, "%s", text);
    if (names->imu && !strcmp(name, "imu")) {
        return fault_read_channel(r, NULL, imu_channels, SENSOR_IMU_CHANNELS,
                                  ft_first + names->nft * SENSOR_FT_CHANNELS, fault);
    }
    dot = strrchr(name, '.');
    if (dot && !fault_find_word(name, names->ft, names->nft, &index)) {
        *dot = '\0';
        channel = dot + 1;
    }
    if (names->imu && channel && !strcmp(name, "imu")) {
        return fault_read_channel(r, channel, imu_channels, SENSOR_IMU_CHANNELS,
                                  ft_first + names->nft * SENSOR_FT_CHANNELS, fault);
    }
    if (fault_find_word(name, names->ft, names->nft, &index)) {
        return fault_read_channel(r, channel, ft_channels, SENSOR_FT_CHANNELS,
                                  ft_first + index * SENSOR_FT_CHANNELS, fault);
    }
    if (!fault_find_word(name, names->joint, names->njoint, &index)) {
        bool no_ft = text_nearest(name, names->joint, names->njoint) || names->nft == 0;

        return no_ft ? fault_refuse_name(r, "a joint", name, names->joint, names->njoint)
                     : fault_refuse_name(r, "a joint or a force-torque sensor", name, names->ft,
                                         names->nft);
    }
    if (!channel) {
        return fault_refuse_word(
            r, text,
            "JOINT.CHANNEL, a channel being link_encoder, motor_encoder, current, torque "
            "or temperature");
    }
    return fault_read_channel(r, channel, joint_channels, SENSOR_JOINT_CHANNELS,
                              index * SENSOR_JOINT_CHANNELS, fault);
}

/* By its name, or "BUS/ADDRESS" */
static enum error_code fault_read_board(struct reader *r, const char *text, struct fault *fault)
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

static enum error_code fault_read_target(struct reader *r, struct fault *fault)
{
    const char *word = fault_next_word(r), *name;
    size_t target;

    if (!word) {
        return fault_refuse_word(r, NULL, "sensor, board, motor, bus or supply");
    }
    if (!fault_find_word(word, target_words, TARGETS, &target)) {
        return fault_refuse_name(r, "sensor, board, motor, bus or supply", word, target_words, 0);
    }
    fault->target = (enum fault_target)target;
    r->at++;
    if (fault->target == FAULT_SUPPLY) {
        return ERROR_NONE;
    }
    name = fault_next_word(r);
    if (!name) {
        return fault_refuse_word(r, NULL, "what is broken");
    }
    r->at++;
    switch (fault->target) {
    case FAULT_MOTOR:
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

/* The word of the kind, which must be one of the target's and possible there. */
static enum error_code fault_read_kind(struct reader *r, struct fault *fault,
                                       const struct rule **out)
{
    const char *word = fault_next_word(r), *kinds[RULES];
    size_t count = 0;

    for (size_t i = 0; i < RULES; i++) {
        if (rules[i].target != fault->target) {
            continue;
        }
        if (word && !strcmp(word, rules[i].word)) {
            *out = &rules[i];
            fault->kind = rules[i].kind;
            r->at++;
            if (rules[i].needs_wire && !r->names->wire[fault->index]) {
                return error_set(r->error, ERROR_UNSUPPORTED,
                                 "fault \"%.159s\": bus %.64s is no wire in virtual time, which "
                                 "this kind needs",
                                 r->line, r->names->bus[fault->index]);
            }
            return ERROR_NONE;
        }
        kinds[count++] = rules[i].word;
    }
    return fault_refuse_name(r, "a kind of fault of this target", word ? word : "nothing", kinds,
                             count);
}

static enum error_code fault_read_window(struct reader *r, const char *word, struct fault *fault)
{
    const char *dots = strstr(word, "..");
    char from[WORD_SIZE];
    double begin = 0.0, end = 0.0;

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

static bool fault_is_window(const char *word)
{
    return strstr(word, "..") || !strcmp(word, "manual");
}

static enum error_code fault_read_parameter(struct reader *r, const struct rule *rule,
                                            const char *word, bool given[FAULT_PARAMETERS],
                                            struct fault *fault)
{
    const char *equals = strchr(word, '=');
    size_t length = equals ? (size_t)(equals - word) : 0;
    char expected[128];
    double value;

    if (length == 2 && !strncmp(word, "id", 2) && fault->target == FAULT_BUS) {
        return text_to_int(equals + 1, 0, 0x1fffffff, &fault->id)
                   ? ERROR_NONE
                   : fault_refuse_word(r, word, "id=0 to id=0x1fffffff");
    }
    for (int i = 0; i < FAULT_PARAMETERS; i++) {
        const struct parameter *p = &rule->parameter[i];
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

static enum error_code fault_read_parameters(struct reader *r, const struct rule *rule,
                                             struct fault *fault)
{
    bool given[FAULT_PARAMETERS] = {false};

    for (int i = 0; i < FAULT_PARAMETERS; i++) {
        fault->value[i] = rule->parameter[i].otherwise;
    }
    for (const char *word = fault_next_word(r); word; word = fault_next_word(r)) {
        enum error_code code;

        r->at++;
        if (fault_is_window(word)) {
            code = fault_read_window(r, word, fault);
            if (!code && fault_next_word(r)) {
                return fault_refuse_word(r, fault_next_word(r), "nothing after the time");
            }
        } else {
            code = fault_read_parameter(r, rule, word, given, fault);
        }
        if (code) {
            return code;
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
    struct reader r = {.line = text, .names = names, .error = error};
    const struct rule *rule = NULL;
    enum error_code code = fault_split_line(&r);

    memset(fault, 0, sizeof *fault);
    fault->id = -1;
    fault->to_ns = INT64_MAX;
    code = code ? code : fault_read_name(&r, fault);
    code = code ? code : fault_read_target(&r, fault);
    code = code ? code : fault_read_kind(&r, fault, &rule);
    code = code ? code : fault_read_parameters(&r, rule, fault);
    if (!code) {
        snprintf(fault->text, sizeof fault->text, "%s", text);
    }
    return code;
}

/* ---- the table ---- */

enum hand { HAND_OFF, HAND_ON, BY_CLOCK };

struct faults {
    struct fault *fault;
    enum hand *hand;
    size_t count;
    uint64_t seed;
    struct ring events;
};

enum error_code faults_create(const struct fault *fault, size_t count, uint64_t seed,
                              struct arena *arena, struct faults **out, struct error *error)
{
    struct faults *faults = arena_alloc(arena, 1, sizeof *faults);
    void *slots = arena_alloc(arena, EVENT_SLOTS, sizeof(struct fault_event));

    if (count > FAULTS_MAX) {
        return error_set(error, ERROR_INPUT, "found %zu faults, expected at most %d", count,
                         FAULTS_MAX);
    }
    if (!faults || !slots) {
        return error_set(error, ERROR_MEMORY, "no memory left for faults");
    }
    faults->fault = arena_alloc(arena, count + 1, sizeof *faults->fault);
    faults->hand = arena_alloc(arena, count + 1, sizeof *faults->hand);
    if (!faults->fault || !faults->hand) {
        return error_set(error, ERROR_MEMORY, "no memory left for %zu faults", count);
    }
    ring_init(&faults->events, slots, sizeof(struct fault_event), EVENT_SLOTS);
    faults->seed = seed;
    for (size_t i = 0; i < count; i++) {
        struct fault *to = &faults->fault[i];

        *to = fault[i];
        to->active = false;
        faults->hand[i] = BY_CLOCK;
        if (!to->name[0]) {
            snprintf(to->name, sizeof to->name, "%zu", i + 1);
        }
        if (faults_find(faults, to->name) >= 0) {
            return error_set(error, ERROR_INPUT,
                             "fault \"%.159s\": found the name %.64s again, expected another",
                             to->text, to->name);
        }
        faults->count++;
    }
    *out = faults;
    return ERROR_NONE;
}

size_t faults_count(const struct faults *faults)
{
    return faults->count;
}

const struct fault *faults_at(const struct faults *faults, size_t index)
{
    return &faults->fault[index];
}

uint64_t faults_seed(const struct faults *faults)
{
    return faults->seed;
}

int faults_find(const struct faults *faults, const char *name)
{
    for (size_t i = 0; i < faults->count; i++) {
        if (!strcmp(faults->fault[i].name, name)) {
            return (int)i;
        }
    }
    return -1;
}

static void faults_switch(struct faults *faults, int64_t now_ns, size_t index, bool active)
{
    struct fault_event event = {.time_ns = now_ns,
                                .fault = index,
                                .active = active,
                                .by_hand = faults->hand[index] != BY_CLOCK};

    if (faults->fault[index].active != active) {
        faults->fault[index].active = active;
        ring_push(&faults->events, &event); /* a full ring loses lines of the log, not the fault */
    }
}

void faults_step(struct faults *faults, int64_t now_ns)
{
    for (size_t i = 0; i < faults->count; i++) {
        const struct fault *fault = &faults->fault[i];
        bool in_window = now_ns >= fault->from_ns && now_ns < fault->to_ns;

        faults_switch(faults, now_ns, i,
                      faults->hand[i] == BY_CLOCK ? in_window : faults->hand[i] == HAND_ON);
    }
}

bool faults_set(struct faults *faults, int64_t now_ns, size_t index, bool active)
{
    if (index >= faults->count) {
        return false;
    }
    faults->hand[index] = active ? HAND_ON : HAND_OFF;
    faults_switch(faults, now_ns, index, active);
    return true;
}

const struct ring *faults_event_ring(const struct faults *faults)
{
    return &faults->events;
}

bool faults_next_event(struct faults *faults, struct fault_event *event)
{
    return ring_pop(&faults->events, event);
}

void fault_event_format(const struct faults *faults, const struct fault_event *event, char *text,
                        size_t size)
{
    const struct fault *fault = &faults->fault[event->fault];

    snprintf(text, size, "%.6f s: fault %s %s%s: %s", (double)event->time_ns * 1e-9, fault->name,
             event->active ? "begins" : "ends", event->by_hand ? " (by hand)" : "", fault->text);
}
