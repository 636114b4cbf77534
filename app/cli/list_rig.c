/* SPDX-License-Identifier: Apache-2.0 */
/* Lists the joints and faults of a rig. */
#include "app/cli/list_rig.h"

#include "app/cli/rig_command.h"
#include "rig/faults.h"

#include <stdio.h>

/* Puts out each driven joint, with the bus that it is on. */
static enum error_code list_put_joints(const struct rig *rig, list_put put, struct error *error)
{
    char text[256];

    (void)error;
    for (size_t a = 0; a < rig->naxis; a++) {
        snprintf(text, sizeof text, "on the bus %s", rig->bus[rig->axis[a].bus].name);
        put(rig->axis[a].joint, text);
    }
    return ERROR_NONE;
}

static void list_put_fault(void *context, const char *line, const char *means)
{
    const list_put *put = context;

    (*put)(line, means);
}

static enum error_code list_put_faults(const struct rig *rig, list_put put, struct error *error)
{
    return rig_list_faults(rig, list_put_fault, &put, error);
}

/* Loads a rig, lists it by body, and frees it. */
static enum error_code list_rig(const char *name, list_put put,
                                enum error_code (*body)(const struct rig *rig, list_put put,
                                                        struct error *error),
                                struct error *error)
{
    const struct rig *rig;
    struct arena arena;
    enum error_code code = arena_init(&arena, RIG_COMMAND_ARENA, error);

    if (code) {
        return code;
    }
    code = rig_load(name, &arena, &rig, error);
    code = code ? code : body(rig, put, error);
    arena_fini(&arena);
    return code;
}

enum error_code list_rig_joints(const char *rig, list_put put, struct error *error)
{
    return list_rig(rig, put, list_put_joints, error);
}

enum error_code list_rig_faults(const char *rig, list_put put, struct error *error)
{
    return list_rig(rig, put, list_put_faults, error);
}
