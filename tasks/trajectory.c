/* SPDX-License-Identifier: Apache-2.0 */
/* Reads a file with joint trajectories, checks the limits, and interpolates between rows. */
#include "tasks/trajectory.h"

#include "base/text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    VALUES_MAX = 4000000, /* 30 joints at 60 Hz for half an hour are 3.3 million values */
    FIRST_ROW_LINE = 2,
};

static const double RATE_MOST_RAD_S = 1e3; /* rate limit of a drive whose limit is unknown */
static const double RATE_ROUNDING = 1e-9;  /* relative tolerance, for rates exactly at the limit */

/* State of reading a trajectory. */
struct reader {
    struct csv *csv;
    const struct trajectory_limit *limit;
    size_t nlimit;
    size_t joint[CSV_COLUMNS_MAX]; /* index of the limit by column; the first column is the time */
    double unit[CSV_COLUMNS_MAX];  /* scale to rad, by column */
    double *row;                   /* on the heap: time and angles, row by row */
    size_t count, capacity;
};

/* ---- the titles ---- */

/* Finds joint and unit from a column's title. A joint may have only one column. */
static enum error_code trajectory_find_joint(struct reader *reader, size_t column,
                                             struct error *error)
{
    const char *title = reader->csv->title[column];
    size_t all = strlen(title), length = all > 4 ? all - 4 : 0;
    const char *unit = title + length, *nearest;
    bool degrees = strcmp(unit, "_deg") == 0;
    char name[64];
    int joint;

    if (length == 0 || length >= sizeof name || (!degrees && strcmp(unit, "_rad") != 0)) {
        return error_set(error, ERROR_INPUT,
                         "%s:%ld: column %zu: found \"%.60s\", expected JOINT_rad or JOINT_deg",
                         reader->csv->path, reader->csv->line, column + 1, title);
    }
    reader->unit[column] = degrees ? M_PI / 180 : 1;
    snprintf(name, sizeof name, "%.*s", (int)length, title);
    joint = TEXT_FIND(reader->limit, reader->nlimit, joint, name);
    if (joint < 0) {
        nearest = text_nearest_first(name, reader->limit, sizeof *reader->limit, reader->nlimit);
        return error_set(
            error, ERROR_INPUT,
            "%s:%ld: column %zu: found joint \"%.60s\", which the rig does not drive%s%s",
            reader->csv->path, reader->csv->line, column + 1, name,
            nearest ? "; the nearest is " : "", nearest ? nearest : "");
    }
    for (size_t k = 1; k < column; k++) {
        if (reader->joint[k] == (size_t)joint) {
            return error_set(error, ERROR_INPUT,
                             "%s:%ld: column %zu: found joint \"%s\" again, which column %zu has",
                             reader->csv->path, reader->csv->line, column + 1, name, k + 1);
        }
    }
    reader->joint[column] = (size_t)joint;
    return ERROR_NONE;
}

/* ---- the rows ---- */

/* Reads all rows, converts angles to radians, and checks each row. */
static enum error_code trajectory_read_rows(struct reader *reader, struct error *error)
{
    const struct csv *csv = reader->csv;

    for (;;) {
        bool end;
        enum error_code code = csv_next(reader->csv, &end, error);
        double *row;

        if (!code && end) {
            break;
        }
        if (code) {
            return code;
        }
        if (reader->count * csv->ncolumn > VALUES_MAX) {
            return error_set(error, ERROR_INPUT,
                             "%s:%ld: found more than %d values, expected fewer", csv->path,
                             csv->line, VALUES_MAX);
        }
        if (reader->count == reader->capacity) {
            size_t capacity = reader->capacity ? 2 * reader->capacity : 256;

            row = realloc(reader->row, capacity * csv->ncolumn * sizeof *row);
            if (!row) {
                return error_set(error, ERROR_MEMORY, "no memory for the rows of %s", csv->path);
            }
            reader->row = row;
            reader->capacity = capacity;
        }

        /* Convert the row to radians */
        row = reader->row + reader->count * csv->ncolumn;
        row[0] = csv->cell[0];
        for (size_t column = 1; column < csv->ncolumn; column++) {
            row[column] = csv->cell[column] * reader->unit[column];
        }

        /* Check that times increase and angles are within their limits */
        if (reader->count > 0 && !(row[0] > row[-(ptrdiff_t)csv->ncolumn])) {
            return error_set(
                error, ERROR_INPUT,
                "%s:%ld: column 1 (time_s): found %.9g, expected more than %.9g of the row before",
                csv->path, csv->line, row[0], row[-(ptrdiff_t)csv->ncolumn]);
        }
        for (size_t column = 1; column < csv->ncolumn; column++) {
            const struct trajectory_limit *limit = &reader->limit[reader->joint[column]];

            if (!(row[column] >= limit->lower_rad && row[column] <= limit->upper_rad)) {
                return error_set(error, ERROR_INPUT,
                                 "%s:%ld: column %zu (%s): found %.6g rad, expected %.6g to %.6g "
                                 "rad, the joint's limits",
                                 csv->path, csv->line, column + 1, csv->title[column], row[column],
                                 limit->lower_rad, limit->upper_rad);
            }
        }
        reader->count++;
    }
    return reader->count >= 2
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT, "%s:%ld: found %zu rows, expected 2 or more",
                           csv->path, csv->line, reader->count);
}

/* ---- between the rows ---- */

/* Returns the mean rate between a row and the next row, rad/s. */
static double trajectory_segment_rate(const struct trajectory *t, size_t row, size_t joint)
{
    const double *angle = t->angle + row * t->njoint + joint;

    return (angle[t->njoint] - angle[0]) / (t->time_s[row + 1] - t->time_s[row]);
}

/* Returns the largest rate between two rows, rad/s. The rate of a cubic is a parabola. */
static double trajectory_peak_rate(const struct trajectory *t, size_t row, size_t joint)
{
    double rate = trajectory_segment_rate(t, row, joint), m0, m1, a, b, peak;

    if (!t->slope) {
        return fabs(rate);
    }
    m0 = t->slope[row * t->njoint + joint];
    m1 = t->slope[(row + 1) * t->njoint + joint];
    a = 3 * (m0 + m1 - 2 * rate);
    b = 6 * rate - 4 * m0 - 2 * m1;
    /* The peak is at one of the rows, or at the parabola's vertex if the vertex is between them */
    peak = fmax(fabs(m0), fabs(m1));
    if (a * b < 0 && fabs(b) < 2 * fabs(a)) {
        peak = fmax(peak, fabs(m0 - b * b / (4 * a)));
    }
    return peak;
}

/* Checks that no joint exceeds its rate between two rows. */
static enum error_code trajectory_check_rates(const struct reader *reader,
                                              const struct trajectory *t, struct error *error)
{
    for (size_t row = 0; row + 1 < t->count; row++) {
        for (size_t joint = 0; joint < t->njoint; joint++) {
            const struct trajectory_limit *limit = &reader->limit[t->joint[joint]];
            double rate = trajectory_peak_rate(t, row, joint);

            double most = limit->rate_rad_s > 0 ? limit->rate_rad_s : RATE_MOST_RAD_S;

            if (!(rate <= most * (1 + RATE_ROUNDING))) {
                return error_set(error, ERROR_INPUT,
                                 "%s:%zu: column %zu (%s): found %.4g rad/s since the row before, "
                                 "expected at most %.4g rad/s, what the drive reaches",
                                 t->path, row + 1 + FIRST_ROW_LINE, joint + 2,
                                 reader->csv->title[joint + 1], rate, most);
            }
        }
    }
    return ERROR_NONE;
}

/* ---- the complete trajectory ---- */

/* Copies the rows into the arena, with times that start at 0. Computes the slopes and checks the
 * rates. */
static enum error_code trajectory_keep(const struct reader *reader, struct arena *arena,
                                       enum trajectory_interpolation interpolation,
                                       const struct trajectory **out, struct error *error)
{
    size_t njoint = reader->csv->ncolumn - 1, count = reader->count;
    struct trajectory *t = arena_alloc(arena, 1, sizeof *t);
    size_t *joint = arena_alloc(arena, njoint, sizeof *joint);
    double *time = arena_alloc(arena, count, sizeof *time);
    double *angle = arena_alloc(arena, count, njoint * sizeof *angle);
    double *slope = arena_alloc(arena, count, njoint * sizeof *slope);

    if (!t || !joint || !time || !angle || !slope) {
        return error_set(error, ERROR_MEMORY, "no memory for the trajectory");
    }
    memcpy(joint, reader->joint + 1, njoint * sizeof *joint);
    for (size_t i = 0; i < count; i++) {
        const double *row = reader->row + i * reader->csv->ncolumn;

        time[i] = row[0] - reader->row[0];
        memcpy(angle + i * njoint, row + 1, njoint * sizeof *angle);
    }
    *t = (struct trajectory){reader->csv->path, njoint, joint, count, time, angle, NULL};
    if (interpolation == TRAJECTORY_CUBIC) {
        /* A slope is the weighted harmonic mean of the rates before and after the row (Fritsch and
         * Butland). It is 0 at both ends and at extremes */
        for (size_t row = 1; row + 1 < count; row++) {
            double h0 = time[row] - time[row - 1], h1 = time[row + 1] - time[row];
            double w0 = 2 * h1 + h0, w1 = h1 + 2 * h0;

            for (size_t k = 0; k < njoint; k++) {
                double rate0 = trajectory_segment_rate(t, row - 1, k);
                double rate1 = trajectory_segment_rate(t, row, k);

                slope[row * njoint + k] =
                    rate0 * rate1 > 0 ? (w0 + w1) / (w0 / rate0 + w1 / rate1) : 0;
            }
        }
        t->slope = slope;
    }
    *out = t;
    return trajectory_check_rates(reader, t, error);
}

enum error_code trajectory_read(struct csv *csv, enum trajectory_interpolation interpolation,
                                const struct trajectory_limit *limit, size_t nlimit,
                                struct arena *arena, const struct trajectory **out,
                                struct error *error)
{
    struct reader *reader = calloc(1, sizeof *reader);
    enum error_code code;

    if (!reader) {
        csv_close(csv);
        return error_set(error, ERROR_MEMORY, "no memory");
    }
    reader->csv = csv;
    reader->limit = limit;
    reader->nlimit = nlimit;
    code = ERROR_NONE;
    if (strcmp(csv->title[0], "time_s") != 0 || csv->ncolumn < 2) {
        code = error_set(error, ERROR_INPUT,
                         "%s:%ld: found other titles, expected time_s, then JOINT_rad or JOINT_deg "
                         "for each joint",
                         csv->path, csv->line);
    }
    for (size_t column = 1; column < csv->ncolumn && !code; column++) {
        code = trajectory_find_joint(reader, column, error);
    }
    code = code ? code : trajectory_read_rows(reader, error);
    code = code ? code : trajectory_keep(reader, arena, interpolation, out, error);
    free(reader->row);
    free(reader);
    csv_close(csv);
    return code;
}

double trajectory_length_s(const struct trajectory *t)
{
    return t->time_s[t->count - 1];
}

void trajectory_at(const struct trajectory *t, size_t joint, double t_s, double *angle_rad,
                   double *rate_rad_s)
{
    size_t row = 0, high = t->count - 1, at;
    double h, s, q0, q1, rate, m0, m1;

    /* Find the last row at or before the time, except the final row */
    while (high - row > 1) {
        size_t middle = (row + high) / 2;

        if (t->time_s[middle] <= t_s) {
            row = middle;
        } else {
            high = middle;
        }
    }
    at = row * t->njoint + joint;
    h = t->time_s[row + 1] - t->time_s[row];
    s = (t_s - t->time_s[row]) / h;
    q0 = t->angle[at];
    q1 = t->angle[at + t->njoint];
    rate = (q1 - q0) / h;

    /* Outside the trajectory, the joint is at rest */
    if (!(t_s > 0) || t_s >= trajectory_length_s(t)) {
        *angle_rad = t_s > 0 ? q1 : q0;
        *rate_rad_s = 0;
        return;
    }
    if (!t->slope) {
        *angle_rad = q0 + s * (q1 - q0);
        *rate_rad_s = rate;
        return;
    }

    /* Evaluate the cubic Hermite polynomial */
    m0 = t->slope[at];
    m1 = t->slope[at + t->njoint];
    *angle_rad = q0 + s * s * (3 - 2 * s) * (q1 - q0) + h * s * (1 - s) * (m0 * (1 - s) - m1 * s);
    *rate_rad_s = 6 * s * (1 - s) * rate + m0 * (1 - s) * (1 - 3 * s) + m1 * s * (3 * s - 2);
}
