/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Linked into tests of the native engine in place of contact_native_create (ld --wrap): with
 * HIL_CONTACT_KERNELS every engine has the kernels of that name, whatever the machine would choose;
 * where the machine cannot run them, all tests of the program are one that is skipped.
 */
#include "contact/contact.h"
#include "tests/physics/contact_variants.h"

#include <stdio.h>
#include <stdlib.h>

enum error_code __wrap_contact_native_create(const struct contact_config *config,
                                             struct arena *arena, struct contact_world **world,
                                             struct error *error);

static const struct native_kernels *forced; /* NULL: the machine's choice */

__attribute__((constructor)) static void force_kernels(void)
{
    const char *name = getenv("HIL_CONTACT_KERNELS");

    if (!name) {
        return;
    }
    for (size_t n = 0; n < CONTACT_VARIANTS; n++) {
        struct contact_variant variant = contact_variant_at(n);

        if (strcmp(name, variant.name) != 0) {
            continue;
        }
        if (!variant.runs) {
            printf("1..1\nok 1 - %s # SKIP this machine has no %s\n", name, variant.needs);
            exit(0);
        }
        forced = variant.kernels;
        return;
    }
    printf("Bail out! HIL_CONTACT_KERNELS: no kernels named %s\n", name);
    exit(1);
}

enum error_code __wrap_contact_native_create(const struct contact_config *config,
                                             struct arena *arena, struct contact_world **world,
                                             struct error *error)
{
    return native_create_with_kernels(config, forced, arena, world, error);
}
