/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Writes a report as one self-contained HTML page, and its numbers as CSV files beside the page. A
 * report has sections with text, tables, plots (app/report/svg.h), and comparisons of published
 * values with ours. The same content gives the same bytes. Not RT-safe.
 *
 * A report keeps its first error. Later calls do nothing, and report_close returns the error.
 */
#ifndef APP_REPORT_REPORT_H
#define APP_REPORT_REPORT_H

#include "app/report/svg.h"
#include "base/memory_file.h"
#include "base/whole_file.h"

#include <limits.h>

enum { REPORT_SECTIONS_MAX = 24, REPORT_FINDINGS_MAX = 96, REPORT_PANELS_MAX = 8 };

/* A comparison of a published value with ours. */
struct report_finding {
    bool main;      /* also in the summary */
    size_t section; /* index of its section */
    char *line;     /* the cells: quantity, published value, our value, remark */
    char *cell[4];
};

/* A result file during writing. */
struct report_file {
    struct whole_file whole; /* write to whole.out */
    char path[PATH_MAX];
};

/* Opens folder/name for writing, and makes the folder if necessary. Do not move the struct before
 * whole_file_close(&file->whole). */
enum error_code report_file_open(struct report_file *file, const char *folder, const char *name,
                                 struct error *error);

/* A report during writing. */
struct report {
    const char *folder, *title;
    FILE *body;
    struct memory_file text; /* memory of the stream body */
    struct report_file file; /* the open file beside the page */
    FILE *csv;               /* stream of `file` while a table is open */
    size_t nsection, nfinding, compared;
    struct {
        char id[32];
        char *title;
    } section[REPORT_SECTIONS_MAX];
    struct report_finding finding[REPORT_FINDINGS_MAX];
    struct error error;
};

/* Opens a report and makes its folder. folder and title must outlive the report. */
enum error_code report_open(struct report *report, const char *folder, const char *title,
                            struct error *error);

/* Starts a section. id consists of letters, digits and dashes, and is unique among the sections,
 * tables and figures of the report. */
void report_section(struct report *report, const char *id, const char *title);

/* Adds a paragraph. */
void report_text(struct report *report, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* report_table starts a table with the file ID.csv; report_row adds a row. columns and rows consist
 * of cells, separated by '|'. A row may have fewer cells than there are columns. Any other call
 * ends the table. */
void report_table(struct report *report, const char *id, const char *caption, const char *columns);
void report_row(struct report *report, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* Adds a comparison to the section, as cells "quantity|published|ours|reason for the difference".
 * The reason may be empty. */
void report_finding(struct report *report, bool main, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Writes the findings since the last call as a table. */
void report_compared(struct report *report);

/* Adds plots side by side. Each plot is also in a file ID-N.svg, and all points are in ID.csv. */
void report_figure(struct report *report, const char *id, const char *caption,
                   const struct svg_plot *panel, size_t npanel);

/* Writes index.html, and compared.csv if there are findings. Frees the report. Returns the first
 * error. */
enum error_code report_close(struct report *report, struct error *error);

/* Frees the report without writing its page. */
void report_abandon(struct report *report);

#endif
