/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The file of --ready. It appears, complete, when clients can connect to a run or a page, and gives
 * the addresses. Each line is NAME='VALUE', readable with "." in a shell. Entries that do not apply
 * are omitted: pid, clock, control (path of the control socket), gateway_host, gateway_port, tables
 * (hashes of the buses' DBC files), page, page_view (addresses to control and to look only). Only
 * its owner may read it. Not RT-safe.
 */
#ifndef APP_CLI_READY_H
#define APP_CLI_READY_H

#include "base/error.h"

#include <stdint.h>

/* Addresses of a run. */
struct ready {
    const char *clock; /* as in --clock; "" or NULL here and below = none */
    const char *control;
    const char *gateway_host; /* NULL = no gateway */
    uint16_t gateway_port;
    const char *tables; /* from dbc_hash_rig */
    const char *page, *page_view;
};

/* Removes the file of an earlier run that was killed. Returns ERROR_INPUT if it belongs to another
 * user or program, or ERROR_SYSTEM. All functions do nothing without a path. */
enum error_code ready_begin(const char *path, struct error *error);

/* Writes the file under a temporary name, and renames it when it is complete. ERROR_INPUT,
 * ERROR_SYSTEM: as whole_file_close. */
enum error_code ready_write(const char *path, const struct ready *ready, struct error *error);

/* Removes the file, because clients can no longer connect. */
void ready_end(const char *path);

#endif
