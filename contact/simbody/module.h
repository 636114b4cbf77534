/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Interface of the module with the engine "simbody". Only rigs that choose the engine load the
 * module, because relocating Simbody's libraries slows the start of a process.
 * contact_simbody_create loads the module, which is C++. Not RT-safe.
 */
#ifndef CONTACT_SIMBODY_MODULE_H
#define CONTACT_SIMBODY_MODULE_H

#include "contact/contact.h"

#define SIMBODY_MODULE_FILE "coman-hil-simbody.so"

/* Exported by the module as simbody_module. Program and module must come from the same build. */
struct simbody_module {
    const char *version; /* HIL_VERSION */
    size_t config_size, surface_size, error_size;
    enum error_code (*create)(const struct contact_config *config, struct contact_world **world,
                              struct error *error);
};

#define SIMBODY_MODULE_SIZES                                                                       \
    sizeof(struct contact_config), sizeof(struct contact_surface), sizeof(struct error)

#endif
