/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The text of the DBC file of a bus, and hashes of it, by which a client that has files of
 * `coman-hil dbc` sees whether they are those of the rig that runs. Not RT-safe.
 */
#ifndef APP_CLI_DBC_HASH_H
#define APP_CLI_DBC_HASH_H

#include "base/memory_file.h"
#include "canbus/dbc.h"
#include "rig/rig.h"

/* Writes a DBC into *text, which starts zeroed and whose text the caller frees. ERROR_MEMORY. */
enum error_code dbc_hash_write_text(const struct dbc *dbc, struct memory_file *text,
                                    struct error *error);

/* Returns in *hashes "BUS=HASH BUS=HASH ...", owned by arena: of each bus the 64-bit FNV-1a hash
 * (base/hash.h, 16 hexadecimal digits) of the bytes that dbc_hash_write_text makes. A bus whose
 * messages no DBC file can hold is left out. ERROR_MEMORY. */
enum error_code dbc_hash_rig(const struct rig *rig, struct arena *arena, const char **hashes,
                             struct error *error);

#endif
