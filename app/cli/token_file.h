/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The file that keeps the tokens and the port of a page from one run to the next, so that an open
 * page finds the next run of the same folder at the same address. Only its owner may read it. Not
 * RT-safe.
 */
#ifndef APP_CLI_TOKEN_FILE_H
#define APP_CLI_TOKEN_FILE_H

#include "base/error.h"
#include "viewer/viewer.h"

#include <stdbool.h>
#include <stdint.h>

/* What the file keeps; port 0: nothing. */
struct page_tokens {
    char token[2][VIEWER_TOKEN]; /* to look, and to control */
    uint16_t port;
};

/* Writes the default path for runs in the working directory: coman-hil/pages/HASH, the hash that
 * of the directory's path, below $XDG_STATE_HOME or $HOME/.local/state; false when there is
 * neither. */
bool token_file_default(char *path, size_t size);

/* Reads the file; *tokens has port 0 when there is none. ERROR_INPUT when it is not such a file, or
 * anybody but its owner, this user, may read or write it. */
enum error_code token_file_read(const char *path, struct page_tokens *tokens, struct error *error);

/* Replaces the file, with mode 0600, and makes missing folders. ERROR_SYSTEM. */
enum error_code token_file_write(const char *path, const struct page_tokens *tokens,
                                 struct error *error);

#endif
