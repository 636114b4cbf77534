/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The text of a bus's DBC file, and hashes of it. A client with files of `coman-hil dbc` compares
 * the hashes to check that its files belong to the running rig. Not RT-safe.
 */
#ifndef APP_CLI_DBC_HASH_H
#define APP_CLI_DBC_HASH_H

#include "base/memory_file.h"
#include "canbus/dbc.h"
#include "rig/rig.h"

/* Writes a DBC to *text, which must be zeroed and is freed by the caller. ERROR_MEMORY. */
enum error_code dbc_hash_write_text(const struct dbc *dbc, struct memory_file *text,
                                    struct error *error);

/* Writes "BUS=HASH BUS=HASH ..." to *hashes, owned by arena. HASH is the 64-bit FNV-1a hash
 * (base/hash.h, 16 hexadecimal digits) of the bytes from dbc_hash_write_text. Omits a bus whose
 * messages do not fit in a DBC file. ERROR_MEMORY. */
enum error_code dbc_hash_rig(const struct rig *rig, struct arena *arena, const char **hashes,
                             struct error *error);

#endif
