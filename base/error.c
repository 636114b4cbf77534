/* SPDX-License-Identifier: Apache-2.0 */
/* Formats the messages of errors. */
#include "base/error.h"

#include <errno.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

/* Replaces control characters. Messages quote input, and a terminal or a log must not interpret
 * it. */
static void error_replace_control_characters(struct error *error)
{
    for (char *at = error->text; *at; at++) {
        if ((unsigned char)*at < 0x20 || *at == 0x7f) {
            *at = '?';
        }
    }
}

enum error_code error_set(struct error *error, enum error_code code, const char *format, ...)
{
    if (error) {
        va_list args;

        error->code = code;
        va_start(args, format);
        vsnprintf(error->text, sizeof error->text, format, args);
        va_end(args);
        error_replace_control_characters(error);
    }
    return code;
}

enum error_code error_set_errno(struct error *error, int errno_value, const char *format, ...)
{
    if (error) {
        va_list args;
        size_t used;

        error->code = ERROR_SYSTEM;
        va_start(args, format);
        vsnprintf(error->text, sizeof error->text, format, args);
        va_end(args);
        used = strlen(error->text);
        snprintf(error->text + used, sizeof error->text - used, ": %s", strerror(errno_value));
        error_replace_control_characters(error);
    }
    return ERROR_SYSTEM;
}

enum error_code error_set_file(struct error *error, int errno_value, const char *path,
                               const char *what)
{
    const bool name_is_wrong = errno_value == ENOENT || errno_value == ENOTDIR ||
                               errno_value == EISDIR || errno_value == EACCES ||
                               errno_value == ENAMETOOLONG || errno_value == ELOOP;

    return error_set(error, name_is_wrong ? ERROR_INPUT : ERROR_SYSTEM, "%.300s: %s: %s", path,
                     what, strerror(errno_value));
}

enum error_code error_prefix(struct error *error, const char *format, ...)
{
    char prefix[256], text[sizeof error->text];
    va_list args;

    if (!error) {
        return ERROR_INPUT;
    }
    va_start(args, format);
    vsnprintf(prefix, sizeof prefix, format, args);
    va_end(args);
    memcpy(text, error->text, sizeof text);
    snprintf(error->text, sizeof error->text, "%s: %.500s", prefix, text);
    error_replace_control_characters(error);
    return error->code;
}
