/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Figures of the docs that a test measures. docs/figures.csv has what the docs may say; figure_hold
 * fails when a test finds something else, so that a figure cannot go stale. `./dev figures` writes
 * the table and the docs anew.
 */
#ifndef TESTS_FIGURE_H
#define TESTS_FIGURE_H

#include "tests/test.h"

/* Returns the figure of the table, a NaN when it has none of that name. */
static inline double figure_read(const char *name)
{
    FILE *file = fopen(HIL_SOURCE_DIR "/docs/figures.csv", "r");
    const size_t length = strlen(name);
    double value = NAN;
    char line[256];

    while (file && fgets(line, sizeof line, file)) {
        if (strncmp(line, name, length) == 0 && line[length] == ',') {
            value = strtod(line + length + 1, NULL);
        }
    }
    if (file) {
        fclose(file);
    }
    return value;
}

/*
 * Prints a figure, and fails unless it is within 1e-3 of the table's: less than the docs' digits
 * show, more than two C libraries differ by. With HIL_FIGURES=measure in the environment it only
 * prints.
 */
static inline void figure_hold(const char *name, double value)
{
    const char *mode = getenv("HIL_FIGURES");
    const double expected = figure_read(name);

    print_message("# figure %s %.9g\n", name, value);
    if (mode && strcmp(mode, "measure") == 0) {
        return;
    }
    if (!(fabs(value - expected) <= 1e-3 * fabs(expected))) {
        fail_msg("%s is %.6g, docs/figures.csv has %.6g: ./dev figures writes it and the docs anew",
                 name, value, expected);
    }
}

#endif
