/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Errors as values. A function that can fail returns an enum error_code. If it fails, it writes one
 * readable sentence into the caller's struct error. Libraries never print and never exit.
 */
#ifndef BASE_ERROR_H
#define BASE_ERROR_H

enum error_code {
    ERROR_NONE = 0,
    ERROR_INPUT,       /* error in a person's or a peer's input: exit status 2 */
    ERROR_SYSTEM,      /* the system refused a call: exit status 3 */
    ERROR_MEMORY,      /* out of memory, or a fixed capacity is used up: exit status 3 */
    ERROR_UNSUPPORTED, /* not possible on this machine or with this build: exit status 4 */
};

struct error {
    enum error_code code;
    /* one sentence without control characters; begins with file:line:column for errors in a file */
    char text[768];
};

/* Writes code and text. Returns `code`, so that a caller can write `return error_set(...)`. `error`
 * may be NULL. Not RT-safe. */
enum error_code error_set(struct error *error, enum error_code code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Works like error_set with ERROR_SYSTEM, and appends the meaning of errno_value. Not RT-safe. */
enum error_code error_set_errno(struct error *error, int errno_value, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Writes an error about a file that a person named: "PATH: WHAT: meaning of errno_value". Returns
 * ERROR_INPUT if the name is the cause (no such file, no permission, ...), else ERROR_SYSTEM. Not
 * RT-safe. */
enum error_code error_set_file(struct error *error, int errno_value, const char *path,
                               const char *what);

/* Puts "prefix: " before the text of an error and returns its code. Not RT-safe. */
enum error_code error_prefix(struct error *error, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

#endif
