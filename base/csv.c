/* SPDX-License-Identifier: Apache-2.0 */
/* Reads tables of numbers from text. */
#include "base/csv.h"

#include "base/input_file.h"
#include "base/text.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

struct csv_source {
    FILE *file;
    char line[CSV_LINE_BYTES], titles[CSV_LINE_BYTES];
};

/* Reads the next line without its line end. The last line may lack a line end. */
static enum error_code csv_read_line(struct csv *csv, bool *end, struct error *error)
{
    struct csv_source *source = csv->source;
    size_t length = 0;
    int c;

    csv->line++;
    while ((c = getc_unlocked(source->file)) != EOF && c != '\n') {
        if (length == CSV_LINE_BYTES - 1) {
            return error_set(error, ERROR_INPUT, "%s:%ld: found a line of more than %d bytes",
                             csv->path, csv->line, CSV_LINE_BYTES - 2);
        }
        if (c == '\0') {
            return error_set(error, ERROR_INPUT, "%s:%ld: found a zero byte, expected text",
                             csv->path, csv->line);
        }
        source->line[length++] = (char)c;
    }
    if (ferror(source->file)) {
        return error_set_errno(error, errno, "%s", csv->path);
    }
    *end = c == EOF && length == 0;
    source->line[length] = '\0';
    source->line[strcspn(source->line, "\r")] = '\0';
    return ERROR_NONE;
}

/* Reads the line of titles. The titles point into a copy of this line. */
static enum error_code csv_read_titles(struct csv *csv, struct error *error)
{
    bool end;
    enum error_code code = csv_read_line(csv, &end, error);

    if (code) {
        return code;
    }
    memcpy(csv->source->titles, csv->source->line, CSV_LINE_BYTES);
    for (char *at = csv->source->titles; at;) {
        if (csv->ncolumn == CSV_COLUMNS_MAX) {
            return error_set(error, ERROR_INPUT, "%s:1: found more than %d columns", csv->path,
                             CSV_COLUMNS_MAX);
        }
        csv->title[csv->ncolumn++] = strsep(&at, ",");
    }
    return ERROR_NONE;
}

/* Creates a table on an open stream and reads the titles. The table owns the stream. */
static enum error_code csv_begin(const char *path, FILE *file, struct csv **out,
                                 struct error *error)
{
    struct csv *csv = calloc(1, sizeof *csv);
    struct csv_source *source = calloc(1, sizeof *source);
    enum error_code code;

    if (!csv || !source) {
        free(csv);
        free(source);
        fclose(file);
        return error_set(error, ERROR_MEMORY, "no memory");
    }
    source->file = file;
    csv->source = source;
    csv->path = path;
    code = csv_read_titles(csv, error);
    if (code) {
        csv_close(csv);
        return code;
    }
    *out = csv;
    return ERROR_NONE;
}

enum error_code csv_open(const char *path, struct csv **csv, struct error *error)
{
    FILE *file;
    enum error_code code = input_file_stream(path, &file, error);

    return code ? code : csv_begin(path, file, csv, error);
}

enum error_code csv_open_memory(const char *path, const void *bytes, size_t size, struct csv **csv,
                                struct error *error)
{
    /* Use /dev/null for 0 bytes, because some C libraries refuse an empty stream */
    FILE *file = size > 0 ? fmemopen((void *)(uintptr_t)bytes, size, "r") : fopen("/dev/null", "r");

    return file ? csv_begin(path, file, csv, error)
                : error_set_errno(error, errno, "%s: cannot be read", path);
}

enum error_code csv_next(struct csv *csv, bool *end, struct error *error)
{
    enum error_code code = csv_read_line(csv, end, error);
    char *at = csv->source->line;

    if (code || *end) {
        return code;
    }
    for (size_t column = 0; column < csv->ncolumn; column++) {
        const char *text = strsep(&at, ",");

        if (!text || !text_to_double(text, &csv->cell[column])) {
            return error_set(error, ERROR_INPUT,
                             "%s:%ld: column %zu (%.60s): found \"%.40s\", expected a number",
                             csv->path, csv->line, column + 1, csv->title[column],
                             text ? text : "");
        }
    }
    return at ? error_set(error, ERROR_INPUT, "%s:%ld: found more than %zu columns", csv->path,
                          csv->line, csv->ncolumn)
              : ERROR_NONE;
}

void csv_close(struct csv *csv)
{
    if (!csv) {
        return;
    }
    fclose(csv->source->file);
    free(csv->source);
    free(csv);
}
