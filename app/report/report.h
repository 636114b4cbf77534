/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A report as one HTML page that needs nothing else, and its numbers as CSV files beside it:
 * sections with text, tables, plots (app/report/svg.h), and comparisons of published values with
 * ours. The same bytes for the same content. Not RT-safe.
 *
 * The first error is kept; calls after it do nothing, and report_close returns it.
 */
#ifndef APP_REPORT_REPORT_H
#define APP_REPORT_REPORT_H

#include "app/report/svg.h"
#include "base/error.h"
#include "base/memory_file.h"
#include "base/whole_file.h"

#include <limits.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

enum { REPORT_SECTIONS_MAX = 24, REPORT_FINDINGS_MAX = 96, REPORT_PANELS_MAX = 8 };

/* A published value beside ours. */
struct report_finding {
    bool main;      /* shown in the summary too */
    size_t section; /* its number */
    char *line;     /* holds the cells: what, theirs, ours, remark */
    char *cell[4];
};

/* A file of results being written. */
struct report_file {
    struct whole_file whole; /* write to whole.out */
    char path[PATH_MAX];
};

/* Opens folder/name for writing; makes the folder if necessary. The struct must not move until
 * whole_file_close(&file->whole). */
enum error_code report_file_open(struct report_file *file, const char *folder, const char *name,
                                 struct error *error);

/* A report being written. */
struct report {
    const char *folder, *title;
    FILE *body;
    struct memory_file text; /* written through body */
    struct report_file file; /* the one beside the page that is open */
    FILE *csv;               /* stream of that file while a table is open */
    size_t nsection, nfinding, compared;
    struct {
        char id[32];
        char *title;
    } section[REPORT_SECTIONS_MAX];
    struct report_finding finding[REPORT_FINDINGS_MAX];
    struct error error;
};

/* Opens a report, and makes its folder. folder and title must outlive the report. */
enum error_code report_open(struct report *report, const char *folder, const char *title,
                            struct error *error);

/* Begins a section. id: a name that no other section, table or figure of the report has; letters,
 * digits, dashes. */
void report_section(struct report *report, const char *id, const char *title);

/* Adds a paragraph. */
void report_text(struct report *report, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* Begin a table with its file ID.csv, and add a row. columns and each row are cells, separated by
 * '|'; a row may have fewer cells than there are columns. The next call of any other kind closes
 * the table. */
void report_table(struct report *report, const char *id, const char *caption, const char *columns);
void report_row(struct report *report, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

/* Adds a comparison to the section: the quantity, their value, ours, and why they differ (or ""),
 * as cells "what|theirs|ours|remark". */
void report_finding(struct report *report, bool main, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Writes the findings since the last call as a table. */
void report_compared(struct report *report);

/* Adds plots side by side, each also as a file ID-N.svg, and all points in ID.csv. */
void report_figure(struct report *report, const char *id, const char *caption,
                   const struct svg_plot *panel, size_t npanel);

/* Writes index.html, and compared.csv if there are findings, and frees what the report holds;
 * returns the first error of all. */
enum error_code report_close(struct report *report, struct error *error);

/* Frees what the report holds, and writes nothing. */
void report_abandon(struct report *report);

#endif
