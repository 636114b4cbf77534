/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The engine "simbody" is a module of its own, loaded where a rig chooses it: Simbody's libraries
 * would cost every process their relocation at its start. This is what stands between the module,
 * which is C++, and the function contact_simbody_create, which loads it. Not RT-safe.
 */
#ifndef CONTACT_SIMBODY_MODULE_H
#define CONTACT_SIMBODY_MODULE_H

#include "contact/contact.h"

#define SIMBODY_MODULE_FILE "coman-hil-simbody.so"

/* What the module exports as simbody_module. Both sides must be of one build. */
struct simbody_module {
    const char *version; /* HIL_VERSION */
    size_t config_size, surface_size, error_size;
    enum error_code (*create)(const struct contact_config *config, struct contact_world **world,
                              struct error *error);
};

#define SIMBODY_MODULE_SIZES                                                                       \
    sizeof(struct contact_config), sizeof(struct contact_surface), sizeof(struct error)

#endif
