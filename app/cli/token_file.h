/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The file that keeps a page's tokens and port between runs, so that an open page finds the next
 * run of the same folder at the same address. Only its owner may read it. Not RT-safe.
 */
#ifndef APP_CLI_TOKEN_FILE_H
#define APP_CLI_TOKEN_FILE_H

#include "base/error.h"
#include "viewer/viewer.h"

#include <stdbool.h>
#include <stdint.h>

/* Contents of the file; port 0: none. */
struct page_tokens {
    char token[2][VIEWER_TOKEN]; /* to look, and to control */
    uint16_t port;
};

/* Writes the default path for runs in the working directory: coman-hil/pages/HASH in
 * $XDG_STATE_HOME or $HOME/.local/state, HASH being the hash of the directory's path. Returns
 * false if neither variable is set. */
bool token_file_default(char *path, size_t size);

/* Reads the file; *tokens has port 0 if there is none. Returns ERROR_INPUT if it is not such a
 * file, if another user owns it, or if others may read or write it. */
enum error_code token_file_read(const char *path, struct page_tokens *tokens, struct error *error);

/* Replaces the file, with mode 0600, and creates missing folders. ERROR_SYSTEM. */
enum error_code token_file_write(const char *path, const struct page_tokens *tokens,
                                 struct error *error);

#endif
