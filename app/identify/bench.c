/* SPDX-License-Identifier: Apache-2.0 */
/* Reads bench files and recordings. */

#include "app/identify/identify.h"

#include "base/array.h"
#include "base/crc32.h"
#include "base/csv.h"
#include "base/input_file.h"
#include "base/text.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Largest accepted size of a recording, bytes. */
enum { RECORDING_BYTES_MAX = 1 << 28 };

static const struct yaml_field column_fields[] = {
    YAML_TEXT("time", false, bench_columns, title[COLUMN_TIME], 1, 1000),
    YAML_TEXT("position", false, bench_columns, title[SIGNAL_POSITION], 1, 1000),
    YAML_TEXT("load_torque", false, bench_columns, title[SIGNAL_LOAD_TORQUE], 1, 1000),
    YAML_TEXT("deflection", false, bench_columns, title[SIGNAL_DEFLECTION], 1, 1000),
    YAML_TEXT("motor_position", false, bench_columns, title[SIGNAL_MOTOR_POSITION], 1, 1000),
    YAML_TEXT("current", false, bench_columns, title[SIGNAL_CURRENT], 1, 1000),
    YAML_TEXT("temperature", false, bench_columns, title[SIGNAL_TEMPERATURE], 1, 1000),
    YAML_TEXT("load", false, bench_columns, title[SIGNAL_LOSS], 1, 1000),
    YAML_TEXT("speed", false, bench_columns, title[COLUMN_SPEED], 1, 1000),
    YAML_TEXT("supply_current", false, bench_columns, title[COLUMN_SUPPLY_CURRENT], 1, 1000),
    YAML_TEXT("goal", false, bench_columns, title[COLUMN_GOAL], 1, 1000),
    YAML_TEXT("voltage", false, bench_columns, title[COLUMN_COMMAND + COMMAND_VOLTAGE], 1, 1000),
    YAML_TEXT("enabled", false, bench_columns, title[COLUMN_ENABLED], 1, 1000),
    YAML_TEXT("supply", false, bench_columns, title[COLUMN_SUPPLY], 1, 1000),
    YAML_TEXT("gain", false, bench_columns, gain_word, 1, 1000),
    YAML_TEXT("torque", false, bench_columns, title[COLUMN_COMMAND + COMMAND_TORQUE], 1, 1000),
    YAML_TEXT("set_current", false, bench_columns, title[COLUMN_COMMAND + COMMAND_CURRENT], 1,
              1000),
    {"voltage_before", YAML_BOOL, false, .offset = offsetof(struct bench_columns, voltage_before)},
    YAML_NUMBER("command_at", false, bench_columns, command_at, 0.0, 1.0),
};
YAML_TABLE(column, "the columns of a recording", bench_columns);

const struct signal_kind signal_kinds[SIGNALS] = {
    [SIGNAL_POSITION] = {"position", "rad"},
    [SIGNAL_LOAD_TORQUE] = {"load_torque", "N m"},
    [SIGNAL_DEFLECTION] = {"deflection", "rad"},
    [SIGNAL_MOTOR_POSITION] = {"motor_position", "rad"},
    [SIGNAL_CURRENT] = {"current", "A"},
    [SIGNAL_TEMPERATURE] = {"temperature", "deg C"},
    [SIGNAL_LOSS] = {"loss", "of the losses"},
};

static const struct yaml_field sigma_fields[] = {
    YAML_NUMBER("position", false, bench_sigmas, signal[SIGNAL_POSITION], DBL_MIN, 1e6),
    YAML_NUMBER("load_torque", false, bench_sigmas, signal[SIGNAL_LOAD_TORQUE], DBL_MIN, 1e6),
    YAML_NUMBER("deflection", false, bench_sigmas, signal[SIGNAL_DEFLECTION], DBL_MIN, 1e6),
    YAML_NUMBER("motor_position", false, bench_sigmas, signal[SIGNAL_MOTOR_POSITION], DBL_MIN, 1e6),
    YAML_NUMBER("current", false, bench_sigmas, signal[SIGNAL_CURRENT], DBL_MIN, 1e6),
    YAML_NUMBER("temperature", false, bench_sigmas, signal[SIGNAL_TEMPERATURE], DBL_MIN, 1e6),
};
YAML_TABLE(sigma, "the noise of the signals", bench_sigmas);

static const struct yaml_field law_fields[] = {
    YAML_NUMBER("duty_per_rad", false, bench_law, duty_per_rad, 1e-9, 1e6),
    YAML_NUMBER("duty_max", false, bench_law, duty_max, 1e-3, 1.0),
    YAML_NUMBER("torque_kp", false, bench_law, torque_kp, 1e-9, 1e6),
    YAML_NUMBER("torque_period_s", false, bench_law, torque_period_s, 0.0, 1.0),
    YAML_NUMBER("torque_delay_s", false, bench_law, torque_delay_s, 0.0, 0.1),
    YAML_NUMBER("torque_share", false, bench_law, torque_share, 1e-6, 1.0),
    YAML_NUMBER("torque_gain", false, bench_law, torque_gain, 1e-3, 1e3),
    YAML_NUMBER("torque_limit_nm", false, bench_law, torque_limit_nm, 1e-9, 1e9),
    YAML_NUMBER("torque_feed_forward", false, bench_law, torque_feed_forward, 0.0, 1e3),
};
static const struct bench_law law_defaults = {.duty_max = 1.0,
                                              .torque_share = 1.0,
                                              .torque_gain = 1.0,
                                              .torque_limit_nm = INFINITY,
                                              .torque_feed_forward = 1.0};
YAML_TABLE(law, "the law of a servo", bench_law, .defaults = &law_defaults);

static const struct yaml_field free_fields[] = {
    YAML_TEXT("key", true, bench_free, key, 1, 1000),
    YAML_TEXT("group", false, bench_free, group, 1, 1000),
    YAML_NUMBER("start", false, bench_free, start, -1e9, 1e9),
    YAML_NUMBER("lower", false, bench_free, lower, -1e9, 1e9),
    YAML_NUMBER("upper", false, bench_free, upper, -1e9, 1e9),
    YAML_NUMBER("expected", false, bench_free, expected, -1e9, 1e9),
    YAML_NUMBER("sigma", false, bench_free, sigma, -1e9, 1e9),
};
static const struct bench_free free_defaults = {.start = NAN, .lower = NAN, .upper = NAN};
YAML_TABLE(free, "a free number", bench_free, .alone = "key", .defaults = &free_defaults);

static const struct yaml_field group_number_fields[] = {
    YAML_TEXT("group", true, group_number, group, 1, 1000),
    YAML_TEXT("key", true, group_number, key, 1, 1000),
    YAML_NUMBER("value", true, group_number, value, -1e9, 1e9),
};
YAML_TABLE(group_number, "a number of a group of recordings", group_number);

static const struct word zero_words[] = {{"mean", ZERO_MEAN}, {"start", ZERO_START}, {NULL, 0}};

static const struct yaml_field recording_fields[] = {
    YAML_TEXT("file", true, bench_recording, file, 1, 1000),
    YAML_TEXT("crc32", false, bench_recording, crc32, 1, 1000),
    YAML_TEXT("group", false, bench_recording, group, 1, 1000),
    {"zero", YAML_ENUM, false, .offset = offsetof(struct bench_recording, zero),
     .names = zero_words},
    {"judge", YAML_BOOL, false, .offset = offsetof(struct bench_recording, judge)},
};
static const struct bench_recording recording_defaults = {.group = ""};
YAML_TABLE(recording, "a recording", bench_recording, .defaults = &recording_defaults);

const struct word point_words[] = {{"voltage_v", POINT_VOLTAGE},
                                   {"current_a", POINT_CURRENT},
                                   {"motor_nm", POINT_MOTOR},
                                   {"speed_rad_s", POINT_SPEED},
                                   {"load_nm", POINT_LOAD},
                                   {"loss_w", POINT_LOSS},
                                   {NULL, 0}};

static const struct yaml_field point_fields[] = {
    YAML_TEXT("what", true, bench_point, what, 1, 1000),
    YAML_NUMBER("voltage_v", false, bench_point, known[POINT_VOLTAGE], 0.0, 1e6),
    YAML_NUMBER("current_a", false, bench_point, known[POINT_CURRENT], 0.0, 1e6),
    YAML_NUMBER("motor_nm", false, bench_point, known[POINT_MOTOR], 0.0, 1e6),
    YAML_NUMBER("speed_rad_s", false, bench_point, known[POINT_SPEED], 0.0, 1e6),
    YAML_NUMBER("load_nm", false, bench_point, known[POINT_LOAD], 0.0, 1e6),
    {"backdriven", YAML_BOOL, false, .offset = offsetof(struct bench_point, backdriven)},
    {"find", YAML_ENUM, true, .offset = offsetof(struct bench_point, find), .names = point_words},
    YAML_NUMBER("value", true, bench_point, value, DBL_MIN, 1e6),
};
static const struct bench_point point_defaults = {.known = {NAN, NAN, NAN, NAN, NAN, NAN}};
YAML_TABLE(point, "a point", bench_point, .defaults = &point_defaults);

static const struct yaml_field published_fields[] = {
    YAML_TEXT("what", true, bench_published, what, 1, 1000),
    YAML_NUMBER("error_rad", false, bench_published, error[0], 0.0, 10.0),
    YAML_NUMBER("error_share", false, bench_published, error[1], 0.0, 10.0),
};
YAML_TABLE(published, "a published error", bench_published);

static const struct yaml_field joint_fields[] = {
    YAML_TEXT("joint", true, bench_joint, joint, 1, 1000),
    YAML_TEXT("drive", false, bench_joint, drive, 1, 1000),
};
YAML_TABLE(joint, "a joint to identify", bench_joint, .alone = "joint");

static const struct yaml_field limit_fields[] = {
    {"what", YAML_ENUM, true, .offset = offsetof(struct bench_limit, what), .names = limit_words},
    YAML_TEXT("of", false, bench_limit, of, 1, 1000),
    YAML_NUMBER("percent", true, bench_limit, percent, 0.0, 1e6),
    YAML_NUMBER("wanted_percent", false, bench_limit, wanted_percent, 0.0, 1e6),
};
static const struct bench_limit limit_defaults = {.wanted_percent = NAN};
YAML_TABLE(limit, "a limit", bench_limit, .defaults = &limit_defaults);

static const struct word output_words[] = {
    {"free", OUTPUT_FREE}, {"locked", OUTPUT_LOCKED}, {"inertia", OUTPUT_INERTIA}, {NULL, 0}};

static const struct yaml_field bench_fields[] = {
    YAML_TEXT("name", true, bench, name, 1, 1000),
    YAML_TEXT("description", false, bench, description, 1, 1000),
    YAML_TEXT("source", true, bench, source, 1, 1000),
    YAML_TEXT("license", true, bench, license, 1, 1000),
    YAML_TEXT("supports", false, bench, supports, 1, 1000),
    YAML_TEXT("obtain", false, bench, obtain, 1, 1000),
    YAML_TEXT("rig", false, bench, rig, 1, 1000),
    YAML_TEXT("drive", false, bench, drive, 1, 1000),
    YAML_ENTRIES("joints", YAML_LIST, false, bench, joint, njoint, joint_schema),
    {"output", YAML_ENUM, false, .offset = offsetof(struct bench, mount.output),
     .names = output_words},
    YAML_NUMBER("output_kg_m2", false, bench, mount.inertia_kg_m2, DBL_MIN, 1e6),
    YAML_NUMBER("lock_nm_rad", false, bench, mount.lock_nm_rad, DBL_MIN, 1e9),
    YAML_SECTION("columns", false, bench, columns, column_schema),
    YAML_SECTION("sigmas", false, bench, sigmas, sigma_schema),
    YAML_SECTION("law", false, bench, law, law_schema),
    YAML_NUMBER("robust_rad", false, bench, robust_rad, 0.0, 10.0),
    YAML_NUMBER("limit_rad", false, bench, limit[0], 0.0, 10.0),
    YAML_NUMBER("limit_share", false, bench, limit[1], 0.0, 10.0),
    YAML_ENTRIES("limits", YAML_LIST, false, bench, limits, nlimit, limit_schema),
    YAML_NUMBER("diagram_nm", false, bench, diagram_nm, 0.0, 1e6),
    {"numbers", YAML_REAL_DICT, false, .offset = offsetof(struct bench, number),
     .count_offset = offsetof(struct bench, nnumber)},
    YAML_ENTRIES("group_numbers", YAML_LIST, false, bench, group_number, ngroup_number,
                 group_number_schema),
    YAML_ENTRIES("free", YAML_LIST, false, bench, free, nfree, free_schema),
    YAML_ENTRIES("recordings", YAML_LIST, false, bench, recording, nrecording, recording_schema),
    YAML_ENTRIES("points", YAML_LIST, false, bench, point, npoint, point_schema),
    YAML_ENTRIES("published", YAML_LIST, false, bench, published, npublished, published_schema),
};
YAML_TABLE(bench, "a measured bench", bench);

/* Checks the key and a value of a parameter. Errors have the place in the file. */
static enum error_code check_number(const struct yaml_mark *mark, const char *key, double value,
                                    struct error *error)
{
    int parameter;

    return parameter_check(key, &parameter, error) ||
                   robot_check_number(parameters[parameter].key, value, error)
               ? error_prefix(error, "%s:%d:%d", mark->file, mark->line, mark->column)
               : ERROR_NONE;
}

/* Checks which two quantities of a point are known: the speed and one other, or load and voltage.
 * Load and current are refused, because they do not determine the speed. */
static enum error_code check_point(const struct bench_point *point, struct error *error)
{
    const double *known = point->known;
    const int motor =
        !isnan(known[POINT_VOLTAGE]) + !isnan(known[POINT_CURRENT]) + !isnan(known[POINT_MOTOR]);
    const int link = !isnan(known[POINT_SPEED]) + !isnan(known[POINT_LOAD]);

    if (motor + link != 2 || motor > 1 || !isnan(known[point->find]) ||
        !isnan(known[POINT_LOAD] + known[POINT_CURRENT]) ||
        !isnan(known[POINT_LOAD] + known[POINT_MOTOR])) {
        return yaml_error(error, &point->mark,
                          "found keys that do not tell one steady state, expected speed_rad_s with "
                          "one of voltage_v, current_a, motor_nm and load_nm, or load_nm with "
                          "voltage_v, and another to find");
    }
    if (point->backdriven && !isnan(known[POINT_LOAD] + known[POINT_VOLTAGE])) {
        return yaml_error(error, &point->mark,
                          "found \"backdriven\" without a speed, expected speed_rad_s");
    }
    return ERROR_NONE;
}

/* Checks a bench of points: it has a rig or a drive, and no recordings. */
static enum error_code check_points(const struct bench *bench, struct error *error)
{
    enum error_code code = ERROR_NONE;

    if (!bench->rig == !bench->drive || bench->nrecording + bench->nfree > 0) {
        return yaml_error(error, &bench->mark,
                          "found points %s, expected them with one of the keys \"rig\" and "
                          "\"drive\", without recordings and free numbers",
                          bench->nrecording + bench->nfree > 0 ? "beside recordings"
                          : bench->rig                         ? "of a rig and a drive"
                                                               : "of no drive");
    }
    for (size_t i = 0; i < bench->npoint && !code; i++) {
        code = check_point(&bench->point[i], error);
    }
    return code;
}

/* Returns the number of columns from `first` up to `end` that a bench has. */
static int count_columns(const struct bench_columns *columns, size_t first, size_t end)
{
    int count = 0;

    for (size_t i = first; i < end; i++) {
        count += columns->title[i] != NULL;
    }
    return count;
}

enum command_kind bench_command(const struct bench_columns *columns)
{
    const char *const *title = columns->title + COLUMN_COMMAND;

    return title[COMMAND_TORQUE]    ? COMMAND_TORQUE
           : title[COMMAND_CURRENT] ? COMMAND_CURRENT
                                    : COMMAND_VOLTAGE;
}

/* Checks a bench of recordings. */
static enum error_code check_recordings(const struct bench *bench, struct error *error)
{
    const struct bench_columns *columns = &bench->columns;

    if (columns->title[SIGNAL_LOSS]) {
        return bench->drive && !bench->rig && count_columns(columns, 0, COLUMNS) == 4 &&
                       count_columns(columns, COLUMN_SUPPLY, COLUMNS) == 3
                   ? ERROR_NONE
                   : yaml_error(
                         error, &columns->mark,
                         "found a column \"load\", expected steady states of a \"drive\" with "
                         "columns \"load\", \"speed\", \"supply\" and \"supply_current\" alone");
    }
    if (!bench->rig || !columns->title[COLUMN_TIME] || bench->drive) {
        return yaml_error(error, &bench->mark,
                          "found no %s, expected keys \"rig\" and \"columns\" for recordings, or "
                          "\"points\" of a \"rig\" or a \"drive\"",
                          !bench->rig ? "rig" : "columns");
    }
    if (count_columns(columns, COLUMN_GOAL, COLUMN_ENABLED) != 1) {
        return yaml_error(error, &columns->mark,
                          "found none or several of the columns \"goal\", \"voltage\", \"torque\" "
                          "and \"set_current\", expected one");
    }
    if (count_columns(columns, 0, SIGNALS) == 0) {
        return yaml_error(error, &columns->mark,
                          "found no column of a measured signal, expected \"position\", "
                          "\"load_torque\" or another");
    }
    if ((bench->mount.output == OUTPUT_INERTIA || bench->mount.lock_nm_rad > 0.0) !=
            (bench->mount.inertia_kg_m2 > 0.0) ||
        (bench->mount.lock_nm_rad > 0.0 && bench->mount.output != OUTPUT_LOCKED)) {
        return yaml_error(error, &bench->mark,
                          "found an incomplete output, expected \"output_kg_m2\" with \"output: "
                          "inertia\", or with \"output: locked\" and \"lock_nm_rad\"");
    }
    if (columns->title[COLUMN_GOAL] && !(bench->law.duty_per_rad > 0.0)) {
        return yaml_error(error, &columns->mark,
                          "found a column of goals without key \"law\", expected the servo's law");
    }
    return ERROR_NONE;
}

/* Refuses a group that no recording of the bench has. file: also accepts the name of a recording's
 * file. */
static enum error_code check_group(const struct bench *bench, const struct yaml_mark *mark,
                                   const char *group, bool file, struct error *error)
{
    for (size_t i = 0; i < bench->nrecording && group; i++) {
        const struct bench_recording *one = &bench->recording[i];
        const char *slash = strrchr(one->file, '/');

        if (!strcmp(one->group, group) || (file && !strcmp(slash ? slash + 1 : one->file, group))) {
            return ERROR_NONE;
        }
    }
    return group && bench->nrecording > 0
               ? yaml_error(error, mark, "found group \"%.63s\", expected a recording's", group)
               : ERROR_NONE;
}

/* Checks the conditions that the schema cannot express. */
static enum error_code check_bench(const struct bench *bench, struct error *error)
{
    enum error_code code =
        bench->npoint > 0 ? check_points(bench, error) : check_recordings(bench, error);

    if (code) {
        return code;
    }
    if (bench->nfree > IDENTIFY_FREE_MAX) {
        return yaml_error(error, &bench->free[IDENTIFY_FREE_MAX].mark,
                          "found more than %d free numbers, expected fewer", IDENTIFY_FREE_MAX);
    }
    for (size_t i = 0; i < bench->nnumber; i++) {
        const struct yaml_real_entry *one = &bench->number[i];

        if (check_number(&one->mark, one->name, one->value, error)) {
            return ERROR_INPUT;
        }
    }
    for (size_t i = 0; i < bench->ngroup_number; i++) {
        const struct group_number *one = &bench->group_number[i];

        if (check_number(&one->mark, one->key, one->value, error) ||
            check_group(bench, &one->mark, one->group, false, error)) {
            return ERROR_INPUT;
        }
    }
    if (bench->nlimit > 0 && (bench->npoint > 0 || bench->columns.title[SIGNAL_LOSS])) {
        return yaml_error(error, &bench->limits->mark,
                          "found limits of steady states, expected \"limit_share\"");
    }
    for (size_t i = 0; i < bench->nlimit; i++) {
        if (check_group(bench, &bench->limits[i].mark, bench->limits[i].of, true, error)) {
            return ERROR_INPUT;
        }
    }
    for (size_t i = 0; i < bench->nfree; i++) {
        const struct bench_free *one = &bench->free[i];

        if (check_number(&one->mark, one->key, one->start, error) ||
            check_number(&one->mark, one->key, one->lower, error) ||
            check_number(&one->mark, one->key, one->upper, error) ||
            check_group(bench, &one->mark, one->group, false, error)) {
            return ERROR_INPUT;
        }
        if (yaml_has(&one->mark, "expected") != (one->sigma > 0.0) ||
            yaml_has(&one->mark, "sigma") != (one->sigma > 0.0) ||
            (yaml_has(&one->mark, "lower") && yaml_has(&one->mark, "upper") &&
             !(one->lower < one->upper))) {
            return yaml_error(error, &one->mark,
                              "found \"%s\" with bounds or a prior that cannot be, expected lower "
                              "below upper, and an expected value with a sigma above zero",
                              one->key);
        }
    }
    return ERROR_NONE;
}

enum error_code bench_read(const char *path, struct arena *arena, struct bench *bench,
                           struct error *error)
{
    enum error_code code = yaml_read_file(path, &bench_schema, arena, bench, error);

    return code ? code : check_bench(bench, error);
}

enum error_code bench_of_own(const char *joint, struct arena *arena, struct bench *bench,
                             struct error *error)
{
    char text[512];
    const int size = snprintf(text, sizeof text,
                              "{name: own, source: recordings of coman-hil run --record, license: "
                              "own, columns: {time: time_s, position: q_*_rad, voltage: "
                              "voltage_*_v, current: current_*_a, voltage_before: true}%s%.63s%s}",
                              joint ? ", joints: [\"" : "", joint ? joint : "", joint ? "\"]" : "");
    enum error_code code =
        yaml_read_text("--joint", text, (size_t)size, &bench_schema, arena, bench, error);

    bench->columns.current_is_optional = true;
    return code;
}

/* ---- recordings ---- */

/* Returns the number after a word in the comments of a text, or 0. */
static double find_gain(const char *text, size_t size, const char *word)
{
    const size_t length = strlen(word);

    for (const char *at = text; at + length < text + size; at++) {
        if (!strncmp(at, word, length) && (at == text || at[-1] == ' ') && at[length] == ' ') {
            return strtod(at + length, NULL);
        }
    }
    return 0.0;
}

/* Returns the size of the comment lines at the start of a text, bytes. */
static size_t comment_size(const char *text)
{
    const char *at = text + (strncmp(text, "\xef\xbb\xbf", 3) ? 0 : 3); /* a byte order mark */

    while (*at == '#') {
        at += strcspn(at, "\n");
        at += *at == '\n';
    }
    return (size_t)(at - text);
}

/* Copies the titles of columns and replaces "*" by the name of a joint. */
static enum error_code take_joint(const struct bench_columns *columns, const char *joint,
                                  struct arena *arena, struct bench_columns *taken,
                                  struct error *error)
{
    *taken = *columns;
    for (size_t i = 0; i < COLUMNS; i++) {
        const char *title = columns->title[i], *star = title ? strchr(title, '*') : NULL;
        char text[2048];

        if (star) {
            snprintf(text, sizeof text, "%.*s%.600s%s", (int)(star - title), title, joint,
                     star + 1);
            taken->title[i] = arena_strdup(arena, text);
            if (!taken->title[i]) {
                return error_set(error, ERROR_MEMORY, "no memory for the titles of columns");
            }
        }
    }
    return ERROR_NONE;
}

/* Finds the columns of a table by their titles. The index is -1 if the bench has no title for a
 * column. */
static enum error_code find_columns(const struct bench_columns *columns, const struct csv *csv,
                                    int column[COLUMNS], struct error *error)
{
    for (size_t i = 0; i < COLUMNS; i++) {
        const char *title = columns->title[i];

        column[i] = title ? TEXT_INDEX(csv->title, csv->ncolumn, title) : -1;
        for (size_t k = (size_t)(column[i] + 1); column[i] >= 0 && k < csv->ncolumn; k++) {
            if (!strcmp(csv->title[k], title)) {
                return error_set(error, ERROR_INPUT,
                                 "%s:%ld: found column \"%.80s\" again, expected it once",
                                 csv->path, csv->line, title);
            }
        }
        if (title && column[i] < 0 && !(i == SIGNAL_CURRENT && columns->current_is_optional)) {
            const char *near = text_nearest(title, csv->title, csv->ncolumn);

            return error_set(error, ERROR_INPUT, "%s:%ld: found no column \"%.80s\"%s%.80s%s%s",
                             csv->path, csv->line, title,
                             near ? ", expected it; the nearest is \"" : ", expected it",
                             near ? near : "", near ? "\"" : "",
                             csv->ncolumn > 1 ? ""
                                              : "; it was read as CSV, for a log of candump begins "
                                                "with a time in parentheses");
        }
    }
    return ERROR_NONE;
}

/* Largest mean time between two rows of a recording, s. */
static const double ROW_S = 0.5;

/* Returns the value of a column in the last row, or `other` without the column. */
static double cell_of(const struct csv *csv, int column, double other)
{
    return column < 0 ? other : csv->cell[column];
}

/* Reads a row of a recording, and adds its supply to a sum. */
static enum error_code read_row(const struct csv *csv, const int column[COLUMNS], size_t i,
                                struct recording *r, struct error *error)
{
    r->time[i] = csv->cell[column[COLUMN_TIME]];
    r->goal[i] = cell_of(csv, column[COLUMN_GOAL], 0.0);
    r->voltage[i] = cell_of(csv, column[COLUMN_COMMAND + (int)r->command], 0.0);
    for (size_t k = 0; k < SIGNALS; k++) {
        if (r->signal[k]) {
            r->signal[k][i] = csv->cell[column[k]];
        }
    }
    r->enabled[i] = cell_of(csv, column[COLUMN_ENABLED], 1.0) > 0.5;
    r->supply += cell_of(csv, column[COLUMN_SUPPLY], 0.0);
    return i == 0 || r->time[i] > r->time[i - 1]
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT,
                           "%s:%ld: found a time of %.9g s after %.9g s, expected a later one",
                           csv->path, csv->line, r->time[i], r->time[i - 1]);
}

/* Reads a row of steady states. */
static enum error_code read_state(const struct csv *csv, const int column[COLUMNS], size_t i,
                                  struct recording *r, struct error *error)
{
    const double load = csv->cell[column[SIGNAL_LOSS]];
    const double speed = csv->cell[column[COLUMN_SPEED]];

    r->goal[i] = speed < 0.0 ? -load : load;
    r->voltage[i] = fabs(speed);
    r->time[i] =
        csv->cell[column[COLUMN_SUPPLY]] * csv->cell[column[COLUMN_SUPPLY_CURRENT]] - load * speed;
    r->signal[SIGNAL_LOSS][i] = 1.0;
    return r->time[i] > 0.0 ? ERROR_NONE
                            : error_set(error, ERROR_INPUT,
                                        "%s:%ld: found losses of %.4g W, expected more than 0: "
                                        "load and speed have one sign if the motor turns the load",
                                        csv->path, csv->line, r->time[i]);
}

/* Reads the rows of a table into arrays of `most` entries. */
static enum error_code read_rows(struct csv *csv, const int column[COLUMNS], size_t most,
                                 struct recording *r, struct error *error)
{
    const bool steady = r->signal[SIGNAL_LOSS] != NULL;
    const size_t least = steady ? 3 : 16;
    bool end;
    enum error_code code = csv_next(csv, &end, error);

    for (r->count = 0; !code && !end && r->count < most;) {
        code = (steady ? read_state : read_row)(csv, column, r->count++, r, error);
        code = code ? code : csv_next(csv, &end, error);
    }
    if (!code && r->count < least) {
        return error_set(error, ERROR_INPUT, "%s: found %zu rows, expected %zu or more", csv->path,
                         r->count, least);
    }
    /* Drives respond within milliseconds, so a larger time step means another unit of time */
    if (!code && !steady && r->time[r->count - 1] - r->time[0] > ROW_S * (double)(r->count - 1)) {
        return error_set(
            error, ERROR_INPUT,
            "%s: found %zu rows in %.9g s, expected one in %g s or more: is the time in seconds?",
            csv->path, r->count, r->time[r->count - 1] - r->time[0], ROW_S);
    }
    r->supply /= (double)(r->count ? r->count : 1);
    return code;
}

enum error_code recording_alloc(struct recording *r, size_t count, const bool has[SIGNALS],
                                struct arena *arena, struct error *error)
{
    bool failed = false;

    r->time = arena_alloc(arena, count, sizeof *r->time);
    r->goal = arena_alloc(arena, count, sizeof *r->goal);
    r->voltage = arena_alloc(arena, count, sizeof *r->voltage);
    r->enabled = arena_alloc(arena, count, sizeof *r->enabled);
    for (size_t i = 0; i < SIGNALS; i++) {
        r->signal[i] = has[i] ? arena_alloc(arena, count, sizeof *r->signal[i]) : NULL;
        failed |= has[i] && !r->signal[i];
    }
    return r->file && r->time && r->goal && r->voltage && r->enabled && !failed
               ? ERROR_NONE
               : error_set(error, ERROR_MEMORY, "no memory left for a recording");
}

void recording_take_zero(struct recording *r, enum bench_zero zero)
{
    double *value = r->signal[SIGNAL_LOAD_TORQUE], sum = 0.0;
    size_t rows = 1;

    if (!value || zero == ZERO_NONE) {
        return;
    }
    while (rows < r->count && (zero == ZERO_MEAN || (r->voltage[rows] == r->voltage[0] &&
                                                     r->goal[rows] == r->goal[0]))) {
        rows++;
    }
    for (size_t i = 0; i < rows; i++) {
        sum += value[i];
    }
    for (size_t i = 0; i < r->count; i++) {
        value[i] -= sum / (double)rows;
    }
}

bool recording_is_with(const struct recording *one, const struct recording *other)
{
    return one - one->place == other - other->place ||
           (one->group[0] && !strcmp(one->group, other->group));
}

enum signal recording_first(const struct recording *recording)
{
    size_t first = 0;

    while (first + 1 < SIGNALS && !recording->signal[first]) {
        first++;
    }
    return (enum signal)first;
}

/* Reads a recording from the text of its file. */
static enum error_code read_table(const struct bench_columns *columns, const char *text,
                                  size_t size, struct arena *arena, struct recording *r,
                                  struct error *error)
{
    struct csv *csv;
    int column[COLUMNS];
    bool has[SIGNALS];
    size_t most = 0;
    enum error_code code;

    for (size_t i = 0; i < size; i++) {
        most += text[i] == '\n';
    }
    if ((code = csv_open_memory(r->file, text, size, &csv, error))) {
        return code;
    }
    code = find_columns(columns, csv, column, error);
    for (size_t i = 0; i < SIGNALS; i++) {
        has[i] = !code && column[i] >= 0;
    }
    code = code ? code : recording_alloc(r, most + 1, has, arena, error);
    code = code ? code : read_rows(csv, column, most + 1, r, error);
    csv_close(csv);
    return code;
}

/* Removes the first rows of a recording. */
static void skip_rows(struct recording *r, size_t rows)
{
    r->count -= rows;
    r->time += rows;
    r->goal += rows;
    r->voltage += rows;
    r->enabled += rows;
    for (size_t i = 0; i < SIGNALS; i++) {
        r->signal[i] = r->signal[i] ? r->signal[i] + rows : NULL;
    }
}

/* Names the recordings of a file's joints. Recordings of a log get a common zero of time.
 * Recordings of a run begin with the first voltage or motion, because a brake may hold the joints
 * before. */
static enum error_code finish_recording(const struct identify_bench *bench, struct arena *arena,
                                        struct recording *r, struct error *error)
{
    const struct trial_robot *trial = &bench->trial;
    int64_t begin_ns = r->begin_ns;
    size_t still = 0;
    bool moved = r->is_log || !r->voltage_before;

    for (size_t k = 1; k < trial->njoint; k++) {
        begin_ns = r[k].begin_ns < begin_ns ? r[k].begin_ns : begin_ns;
    }
    while (!moved && still + 16 < r->count) {
        for (size_t k = 0; k < trial->njoint; k++) {
            const double *position = r[k].signal[SIGNAL_POSITION];

            moved |=
                r[k].voltage[still + 1] != 0.0 || (position && position[still + 1] != position[0]);
        }
        still += !moved;
    }
    for (size_t k = 0; k < trial->njoint && trial->njoint > 1; k++) {
        char name[512];

        skip_rows(&r[k], still);
        for (size_t i = 0; i < r[k].count && r->is_log; i++) {
            r[k].time[i] += 1e-9 * (double)(r[k].begin_ns - begin_ns);
        }
        snprintf(name, sizeof name, "%.400s, %.100s", r[k].name, trial->joint[trial->at[k]].name);
        r[k].name = arena_strdup(arena, name);
        if (!r[k].name) {
            return error_set(error, ERROR_MEMORY, "no memory left for a recording");
        }
    }
    return ERROR_NONE;
}

enum error_code recording_read(const struct identify_bench *bench, const char *path,
                               const char *expected, struct arena *arena, struct recording *r,
                               struct error *error)
{
    const struct bench_columns *columns = &bench->bench.columns;
    const char *slash = strrchr(path, '/'), *word = columns->gain_word;
    char *text;
    size_t size = 0;
    enum error_code code = input_file_load(path, RECORDING_BYTES_MAX, &text, &size, error);

    if (code) {
        return code;
    }
    *r = (struct recording){.file = arena_strdup(arena, path),
                            .name = arena_strdup(arena, slash ? slash + 1 : path),
                            .group = "",
                            .is_log = bench->rig && text[strspn(text, " ")] == '(',
                            .is_checked = expected != NULL,
                            .gain = word ? find_gain(text, comment_size(text), word) : 1.0,
                            .voltage_before = columns->voltage_before,
                            .command_at = columns->command_at,
                            .command = bench_command(columns)};
    snprintf(r->sum, sizeof r->sum, "%08x", crc32_update(0, text, size));
    if (expected && strcmp(expected, r->sum) != 0) {
        code = error_set(error, ERROR_INPUT, "%.200s: found CRC-32 %s, expected %.16s", path,
                         r->sum, expected);
    } else if (!r->is_log && !(r->gain > 0.0)) {
        code = error_set(error, ERROR_INPUT,
                         "%.200s: found no \"%.63s\" with a number in the comments at its begin, "
                         "expected the gain of the servo",
                         path, word);
    }
    for (size_t k = 0; k < bench->trial.njoint && !code; k++) {
        const char *joint = bench->trial.joint[bench->trial.at[k]].name;
        struct bench_columns own;

        r[k] = r[0];
        r[k].place = k;
        code = take_joint(columns, joint, arena, &own, error);
        code = code        ? code
               : r->is_log ? recording_read_log(bench->rig, joint, &own, arena, &r[k], error)
                           : read_table(&own, text, size, arena, &r[k], error);
    }
    free(text);
    return code ? code : finish_recording(bench, arena, r, error);
}
