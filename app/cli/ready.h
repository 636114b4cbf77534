/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The file of --ready appears, complete, when others can talk to a run or a page, and says where. A
 * line is NAME='VALUE', as a shell's "." reads it; entries that the run does not have are left out:
 * pid, clock, control (path of the control socket), gateway_host, gateway_port, tables (hashes of
 * the buses' DBC files), page, page_view (addresses, to control and to look only). Only its owner
 * may read it. Not RT-safe.
 */
#ifndef APP_CLI_READY_H
#define APP_CLI_READY_H

#include "base/error.h"

#include <stdint.h>

/* Where a run can be reached. */
struct ready {
    const char *clock; /* as --clock names it; "" or NULL here and below = none */
    const char *control;
    const char *gateway_host; /* NULL = no gateway */
    uint16_t gateway_port;
    const char *tables; /* dbc_hash_rig */
    const char *page, *page_view;
};

/* Removes the file of an earlier run that was killed; ERROR_INPUT when it is somebody else's.
 * Without a path nothing happens, here and below. ERROR_SYSTEM. */
enum error_code ready_begin(const char *path, struct error *error);

/* Writes the file and gives it its name when it is complete. ERROR_INPUT, ERROR_SYSTEM: as
 * whole_file_close. */
enum error_code ready_write(const char *path, const struct ready *ready, struct error *error);

/* Removes the file: nobody is there to talk to any more. */
void ready_end(const char *path);

#endif
