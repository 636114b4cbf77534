/* SPDX-License-Identifier: Apache-2.0 */
/* Prints the rows of boards/cia402/table.h. */
#include "boards/cia402/object_list.h"

#include "base/options.h"
#include "boards/cia402/table.h"

#include <inttypes.h>

/* Returns the word for a type. */
static const char *object_type_name(enum cia402_type type)
{
    static const char *const names[] = {
        [CIA402_I8] = "i8",     [CIA402_I16] = "i16",      [CIA402_I32] = "i32",
        [CIA402_U8] = "u8",     [CIA402_U16] = "u16",      [CIA402_U32] = "u32",
        [CIA402_TEXT] = "text", [CIA402_DOMAIN] = "domain"};

    return names[type];
}

/* Prints a row as an item of a list. */
static void object_print_row(const struct cia402_object *object, FILE *out)
{
    static const char *const access[] = {
        [CIA402_CONST] = "const", [CIA402_RO] = "ro", [CIA402_RW] = "rw", [CIA402_WO] = "wo"};
    unsigned last = object->sub + object->count - 1u;
    char subs[16] = "", measure[48] = "", range[64] = "", initial[32] = "", line[256];

    if (last > 0) {
        snprintf(subs, sizeof subs, object->count > 1 ? ":%u-%u" : ":%u", object->sub, last);
    }
    if (object->unit) {
        snprintf(measure, sizeof measure, ", in %g %s", object->scale, object->unit);
    }
    if (object->min || object->max) {
        snprintf(range, sizeof range, ", %" PRId64 " to %" PRId64, object->min, object->max);
    }
    if (object->initial) {
        snprintf(initial, sizeof initial, ", at first %" PRId64 "%s", object->initial,
                 object->access & CIA402_PLUS_NODE ? " + n" : "");
    }
    snprintf(line, sizeof line, "- 0x%04x%s `%s`: %s, %s%s%s%s%s%s", object->index, subs,
             object->name, object_type_name(object->type),
             access[object->access & CIA402_ACCESS_MASK],
             object->access & CIA402_MAP_TPDO ? ", TPDO" : "",
             object->access & CIA402_MAP_RPDO ? ", RPDO" : "", measure, range, initial);
    options_wrap(line, 0, 2, out);
}

void cia402_print_objects(FILE *out)
{
    fputs("\n## Objects\n\n", out);
    options_wrap("Of axis 0, of the first RPDO and of the first TPDO; the others follow as above. "
                 "Sub-index 0 of an object with sub-indices is how many there are. Values at first "
                 "are those of the factory where the rig says nothing: limits and gains come from "
                 "the drive, COB-IDs and mappings from the factory mapping.",
                 0, 0, out);
    putc('\n', out);
    for (size_t i = 0; i < cia402_object_count; i++) {
        object_print_row(&cia402_objects[i], out);
    }
}
