/* SPDX-License-Identifier: Apache-2.0 */
/* Writes a report as HTML and CSV. */
#include "app/report/report.h"

#include "base/markup.h"
#include "base/text.h"

#include <stdlib.h>
#include <string.h>

/* Largest size of a text or row, bytes; largest number of cells in a row. */
enum { LINE_BYTES = 4096, CELLS_MAX = 16 };

/* Style sheet: readable on a telephone and on paper; light or dark as the reader prefers. */
static const char style[] =
    ":root{color-scheme:light dark;--ink:#1b1f24;--soft:#57606a;--paper:#fff;--line:#d0d7de;"
    "--grid:#e3e6ea;--band:#f6f8fa;--link:#0a58ca}\n"
    "@media(prefers-color-scheme:dark){:root{--ink:#e6e8eb;--soft:#a3abb5;--paper:#14171b;"
    "--line:#3a424c;--grid:#2a3038;--band:#1b2026;--link:#7db4ff}\n"
    ".line.s0{stroke:#57b6f0}circle.s0{fill:#57b6f0}.line.s1{stroke:#ff8b45}circle.s1{fill:#ff8b45}"
    ".line.s2{stroke:#30cfa0}circle.s2{fill:#30cfa0}.line.s3{stroke:#e29cc4}circle.s3{fill:#e29cc4}"
    ".line.s6{stroke:#e6e8eb}circle.s6{fill:#e6e8eb}}\n"
    "*{box-sizing:border-box}\n"
    "body{margin:0 auto;max-width:72rem;padding:1.5rem 1rem 4rem;background:var(--paper);"
    "color:var(--ink);font:1rem/1.55 system-ui,-apple-system,\"Segoe UI\",\"Liberation Sans\","
    "sans-serif}\n"
    "h1{font-size:1.7rem;line-height:1.2;margin:0 0 .75rem}\n"
    "h2{font-size:1.25rem;line-height:1.3;margin:3rem 0 .5rem;padding-top:.75rem;"
    "border-top:1px solid var(--line)}\n"
    "p{max-width:46rem;margin:.6rem 0}a{color:var(--link)}\n"
    "nav ul{columns:2 20rem;padding-left:1.2rem;margin:.5rem 0}nav li{break-inside:avoid}\n"
    ".scroll{overflow-x:auto;margin:1rem 0}\n"
    "table{border-collapse:collapse;font-size:.9rem;font-variant-numeric:tabular-nums}\n"
    "caption{text-align:left;color:var(--soft);padding:.2rem 0 .5rem}\n"
    "th,td{text-align:left;vertical-align:top;padding:.35rem .8rem .35rem 0;"
    "border-bottom:1px solid var(--line)}\n"
    "th{font-weight:600;border-bottom:2px solid var(--line)}\n"
    "td:first-child{min-width:4.5rem}td.what{min-width:10.5rem}td.value{min-width:5rem}"
    "td:last-child{min-width:9rem}"
    "td.remark{min-width:13rem;max-width:32rem;color:var(--soft)}\n"
    "figure{margin:1.2rem 0}figcaption{max-width:46rem;color:var(--soft);font-size:.92rem}\n"
    ".panels{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,25rem),1fr));"
    "gap:.8rem}\n"
    "svg.plot{display:block;width:100%;height:auto;max-width:44rem;max-height:38rem}\n"
    "svg.plot text{fill:var(--ink);font-size:13px}svg.plot text.title{font-size:15px;"
    "font-weight:600}\n"
    ".paper{fill:var(--paper)}.grid{stroke:var(--grid);fill:none}.axis{stroke:var(--soft);"
    "fill:none}.line{stroke-width:1.7;fill:none;stroke-linejoin:round}\n"
    "@media print{h2{break-after:avoid}figure,table{break-inside:avoid}}\n";

/* Writes a CSV field, with quotation marks if it needs them. */
static void put_csv(FILE *out, const char *text)
{
    if (!strpbrk(text, ",\"\n")) {
        fputs(text, out);
        return;
    }
    putc('"', out);
    for (; *text; text++) {
        if (*text == '"') {
            putc('"', out);
        }
        putc(*text, out);
    }
    putc('"', out);
}

/* Stores the error unless the report already has one. */
static void report_fail(struct report *report, enum error_code code, const char *what)
{
    if (!report->error.code) {
        error_set(&report->error, code, "%s", what);
    }
}

/* Checks whether the report has no error. */
static bool report_is_good(const struct report *report)
{
    return !report->error.code;
}

/* Copies a text to the heap. Without memory it stores an error and returns NULL. */
static char *report_copy_text(struct report *report, const char *text)
{
    char *copy = strdup(text);

    if (!copy) {
        report_fail(report, ERROR_MEMORY, "no memory for the report");
    }
    return copy;
}

/* Splits a line at '|' in place. Returns the number of cells. */
static size_t report_split_cells(char *line, char *cell[CELLS_MAX])
{
    size_t count = 0;

    while (line && count < CELLS_MAX) {
        cell[count++] = strsep(&line, "|");
    }
    return count;
}

enum error_code report_file_open(struct report_file *file, const char *folder, const char *name,
                                 struct error *error)
{
    enum error_code code = folder_make(folder, NULL, error);

    if (code) {
        return code;
    }
    if (snprintf(file->path, sizeof file->path, "%s/%s", folder, name) >= (int)sizeof file->path) {
        return error_set(error, ERROR_INPUT, "the name of the folder %.40s... is too long", folder);
    }
    return whole_file_open(&file->whole, file->path, error);
}

enum error_code report_open(struct report *report, const char *folder, const char *title,
                            struct error *error)
{
    enum error_code code = folder_make(folder, NULL, error);

    *report = (struct report){.folder = folder, .title = title};
    if (code) {
        return code;
    }
    report->body = memory_file_open(&report->text);
    return report->body ? ERROR_NONE : error_set(error, ERROR_MEMORY, "no memory for the report");
}

/* Opens a file beside the page; only one may be open at a time. Returns NULL if the report has an
 * error. */
static FILE *open_file(struct report *report, const char *name)
{
    if (report_is_good(report)) {
        report_file_open(&report->file, report->folder, name, &report->error);
    }
    return report_is_good(report) ? report->file.whole.out : NULL;
}

/* Closes the open file beside the page. */
static void close_file(struct report *report)
{
    struct error error;

    if (whole_file_close(&report->file.whole, ERROR_NONE, &error)) {
        report_fail(report, error.code, error.text);
    }
}

/* Ends the open table, if any, and its CSV file. */
static void close_table(struct report *report)
{
    if (report->csv) {
        fputs("</tbody></table></div>\n", report->body);
        close_file(report);
        report->csv = NULL;
    }
}

void report_section(struct report *report, const char *id, const char *title)
{
    size_t n = report->nsection;

    close_table(report);
    if (n == REPORT_SECTIONS_MAX) {
        report_fail(report, ERROR_MEMORY, "too many sections in the report");
    }
    if (!report_is_good(report)) {
        return;
    }
    snprintf(report->section[n].id, sizeof report->section[n].id, "%s", id);
    report->section[n].title = report_copy_text(report, title);
    report->nsection++;
    fprintf(report->body, "%s<section id=\"%s\">\n<h2>", n ? "</section>\n" : "", id);
    markup_put(report->body, title);
    fputs("</h2>\n", report->body);
}

void report_text(struct report *report, const char *format, ...)
{
    char line[LINE_BYTES];

    TEXT_FORMAT(line, format);
    close_table(report);
    fputs("<p>", report->body);
    markup_put(report->body, line);
    fputs("</p>\n", report->body);
}

/* Writes a row to the page, with each cell in this HTML element, and to the CSV file. */
static void put_cells(struct report *report, const char *element, char *line)
{
    char *cell[CELLS_MAX];
    size_t count = report_split_cells(line, cell);

    fputs("<tr>", report->body);
    for (size_t i = 0; i < count; i++) {
        fprintf(report->body, "<%s>", element);
        markup_put(report->body, cell[i]);
        fprintf(report->body, "</%s>", element);
        put_csv(report->csv, cell[i]);
        putc(i + 1 < count ? ',' : '\n', report->csv);
    }
    fputs("</tr>\n", report->body);
}

void report_table(struct report *report, const char *id, const char *caption, const char *columns)
{
    char name[64], line[LINE_BYTES];

    close_table(report);
    snprintf(name, sizeof name, "%s.csv", id);
    report->csv = open_file(report, name);
    if (!report->csv) {
        return;
    }
    fprintf(report->body, "<div class=\"scroll\"><table id=\"%s\"><caption>", id);
    markup_put(report->body, caption);
    fputs("</caption>\n<thead>", report->body);
    snprintf(line, sizeof line, "%s", columns);
    put_cells(report, "th", line);
    fputs("</thead><tbody>\n", report->body);
}

void report_row(struct report *report, const char *format, ...)
{
    char line[LINE_BYTES];

    TEXT_FORMAT(line, format);
    if (report->csv) {
        put_cells(report, "td", line);
    }
}

void report_finding(struct report *report, bool main, const char *format, ...)
{
    struct report_finding *finding = &report->finding[report->nfinding];
    char line[LINE_BYTES], *cell[CELLS_MAX], *copy;
    size_t count;

    TEXT_FORMAT(line, format);
    if (report->nfinding == REPORT_FINDINGS_MAX || report->nsection == 0) {
        report_fail(report, ERROR_MEMORY, "too many findings in the report");
    }
    copy = report_copy_text(report, line);
    if (!report_is_good(report)) {
        free(copy);
        return;
    }

    /* Missing cells are empty */
    for (count = report_split_cells(copy, cell); count < 4; count++) {
        cell[count] = copy + strlen(copy);
    }
    *finding = (struct report_finding){.main = main, .section = report->nsection - 1, .line = copy};
    memcpy(finding->cell, cell, sizeof finding->cell);
    report->nfinding++;
}

/* Writes a finding as a table row. In the summary the row has a link to the section, elsewhere the
 * remark. */
static void put_finding(const struct report *report, const struct report_finding *finding,
                        bool summary, FILE *out)
{
    static const char *const kinds[] = {"what", "value", "value", "remark"};
    const char *title = report->section[finding->section].title;
    char start[64];

    fputs("<tr>", out);
    if (summary) {
        /* The title up to its colon, for example "Fig. 3" */
        fprintf(out, "<td><a href=\"#%s\">", report->section[finding->section].id);
        snprintf(start, sizeof start, "%.*s", (int)strcspn(title, ":"), title);
        markup_put(out, start);
        fputs("</a></td>", out);
    }
    for (size_t i = 0; i < (summary ? 3 : 4); i++) {
        fprintf(out, "<td class=\"%s\">", kinds[i]);
        markup_put(out, finding->cell[i]);
        fputs("</td>", out);
    }
    fputs("</tr>\n", out);
}

void report_compared(struct report *report)
{
    close_table(report);
    fputs("<div class=\"scroll\"><table><thead><tr><th>quantity</th><th>paper</th><th>here</th>"
          "<th>remark</th></tr></thead><tbody>\n",
          report->body);
    for (; report_is_good(report) && report->compared < report->nfinding; report->compared++) {
        put_finding(report, &report->finding[report->compared], false, report->body);
    }
    fputs("</tbody></table></div>\n", report->body);
}

/* Writes a panel into the page, and to a separate file. */
static void write_panel(struct report *report, const struct svg_plot *panel, const char *id,
                        size_t number)
{
    struct svg_plot plot = *panel;
    char name[64];
    FILE *out;

    if (!report_is_good(report)) {
        return;
    }
    snprintf(name, sizeof name, "%s-%zu", id, number);
    plot.part = name;
    svg_write(&plot, report->body, &report->error);
    snprintf(name, sizeof name, "%s-%zu.svg", id, number);
    out = open_file(report, name);
    if (out) {
        svg_write(panel, out, &report->error);
        close_file(report);
    }
}

/* Writes the points of all panels to one CSV file. */
static void write_points(struct report *report, const char *id, const struct svg_plot *panel,
                         size_t npanel)
{
    char name[64];
    FILE *out;

    snprintf(name, sizeof name, "%s.csv", id);
    out = open_file(report, name);
    if (!out) {
        return;
    }
    fputs("panel,series,x,y\n", out);
    for (size_t p = 0; p < npanel; p++) {
        for (size_t s = 0; s < panel[p].nseries; s++) {
            const struct svg_series *series = &panel[p].series[s];

            for (size_t i = 0; i < series->count; i++) {
                fprintf(out, "%zu,", p + 1);
                put_csv(out, series->name);
                fprintf(out, ",%.9g,%.9g\n", series->x[i], series->y[i]);
            }
        }
    }
    close_file(report);
}

void report_figure(struct report *report, const char *id, const char *caption,
                   const struct svg_plot *panel, size_t npanel)
{
    close_table(report);
    fprintf(report->body, "<figure id=\"%s\"><div class=\"panels\">\n", id);
    for (size_t p = 0; p < npanel; p++) {
        write_panel(report, &panel[p], id, p + 1);
    }
    fputs("</div><figcaption>", report->body);
    markup_put(report->body, caption);
    fputs("</figcaption></figure>\n", report->body);
    write_points(report, id, panel, npanel);
}

/* ---- the whole ---- */

/* Writes all findings to compared.csv, if there are any. */
static void write_findings(struct report *report)
{
    FILE *out = report->nfinding ? open_file(report, "compared.csv") : NULL;

    if (!out) {
        return;
    }
    fputs("section,quantity,paper,here,remark\n", out);
    for (size_t i = 0; i < report->nfinding; i++) {
        const struct report_finding *finding = &report->finding[i];

        put_csv(out, report->section[finding->section].id);
        for (size_t k = 0; k < 4; k++) {
            putc(',', out);
            put_csv(out, finding->cell[k]);
        }
        putc('\n', out);
    }
    close_file(report);
}

/* Frees the texts of a report. */
static void report_free(struct report *report)
{
    for (size_t i = 0; i < report->nfinding; i++) {
        free(report->finding[i].line);
    }
    for (size_t i = 0; i < report->nsection; i++) {
        free(report->section[i].title);
    }
    free(report->text.text);
}

enum error_code report_close(struct report *report, struct error *error)
{
    struct error lost;
    FILE *out;

    close_table(report);
    if (memory_file_close(report->body, &report->text, "the report", &lost)) {
        report_fail(report, lost.code, lost.text);
    }
    write_findings(report);
    out = open_file(report, "index.html");
    if (out) {
        /* Write the page: head, links to the sections, summary, then the sections */
        fputs("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
              "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>",
              out);
        markup_put(out, report->title);
        fprintf(out, "</title>\n<style>\n%s</style>\n</head>\n<body>\n<h1>", style);
        markup_put(out, report->title);
        fprintf(out, "</h1>\n<nav>\n<ul>\n%s",
                report->nfinding ? "<li><a href=\"#short\">In short</a></li>\n" : "");
        for (size_t i = 0; i < report->nsection; i++) {
            fprintf(out, "<li><a href=\"#%s\">", report->section[i].id);
            markup_put(out, report->section[i].title);
            fputs("</a></li>\n", out);
        }
        fputs("</ul>\n</nav>\n", out);
        if (report->nfinding) {
            /* Writes the table of the main findings */
            fputs("<h2 id=\"short\">In short</h2>\n<div class=\"scroll\"><table><thead><tr>"
                  "<th>in the paper</th><th>quantity</th><th>paper</th><th>here</th></tr></thead>"
                  "<tbody>\n",
                  out);
            for (size_t i = 0; i < report->nfinding; i++) {
                if (report->finding[i].main) {
                    put_finding(report, &report->finding[i], true, out);
                }
            }
            fputs("</tbody></table></div>\n", out);
        }
        fwrite(report->text.text, 1, report->text.size, out);
        fprintf(out, "%s</body>\n</html>\n", report->nsection ? "</section>\n" : "");
        close_file(report);
    }
    report_free(report);
    *error = report->error;
    return report->error.code;
}

void report_abandon(struct report *report)
{
    close_table(report);
    fclose(report->body);
    report_free(report);
}
