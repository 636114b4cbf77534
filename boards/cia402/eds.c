/* SPDX-License-Identifier: Apache-2.0 */
/* Writes an electronic data sheet; see the header. */
#include "boards/cia402/eds.h"

#include "boards/cia402/frames.h"
#include "boards/cia402/private.h"

#include <inttypes.h>

enum {
    FIRST_INDEX = 0x1000,
    LAST_INDEX = 0x9fff,
    SUBS_MAX = 40, /* more than any object has */
    OBJECT_VARIABLE = 7,
    OBJECT_ARRAY = 8,
    OBJECT_RECORD = 9,
};

/* Sections of the list of objects. */
enum section { MANDATORY, OPTIONAL, MANUFACTURER };

/* Returns the section of an index: three objects are mandatory, 0x2000 to 0x5fff ours. */
static enum section eds_section_of(unsigned index)
{
    return index == 0x1000 || index == 0x1001 || index == 0x1018 ? MANDATORY
           : index >= 0x2000 && index < 0x6000                   ? MANUFACTURER
                                                                 : OPTIONAL;
}

/* Finds an object; returns whether the node has it. */
static bool eds_has(const struct cia402_node *node, unsigned index, unsigned sub,
                    struct cia402_entry *entry)
{
    return cia402_find(node, index, sub, entry) == CIA402_DONE;
}

/* ---- values ---- */

/* Writes a number under a key: of signed types in decimal, else in hexadecimal. */
static void eds_put_number(const char *key, enum cia402_type type, int64_t value, FILE *out)
{
    if (type == CIA402_I8 || type == CIA402_I16 || type == CIA402_I32) {
        fprintf(out, "%s=%" PRId64 "\n", key, value);
    } else {
        fprintf(out, "%s=0x%" PRIX64 "\n", key, (uint64_t)value);
    }
}

/* Returns whether a value is a COB-ID that follows the Node-ID. */
static bool eds_is_of_node(const struct cia402_entry *entry, int64_t value)
{
    const struct cia402_object *object = entry->object;

    return object->access & CIA402_PLUS_NODE ||
           ((object->scope == CIA402_OF_RPDO || object->scope == CIA402_OF_TPDO) &&
            object->type == CIA402_U32 && object->sub == 1 && object->count == 1 &&
            value & CIA402_COB_MASK);
}

/* Writes the default value of an object, as it is now. */
static void eds_put_default(const struct cia402_node *node, const struct cia402_entry *entry,
                            FILE *out)
{
    int64_t value;

    if (entry->type == CIA402_TEXT) {
        fprintf(out, "DefaultValue=%s\n", cia402_text(node, entry));
        return;
    }
    if (entry->type == CIA402_DOMAIN) {
        return; /* has none */
    }
    value = cia402_value(node, entry);
    if (entry->object && eds_is_of_node(entry, value)) {
        fprintf(out, "DefaultValue=$NODEID+0x%" PRIX64 "\n",
                (uint64_t)(value - node->board.address));
        return;
    }
    eds_put_number("DefaultValue", entry->type, value, out);
}

/* Returns the word for the access to an object. */
static const char *eds_access(const struct cia402_object *object)
{
    if (!object) {
        return "const";
    }
    switch (object->access & CIA402_ACCESS_MASK) {
    case CIA402_CONST:
        return "const";
    case CIA402_RO:
        return "ro";
    case CIA402_WO:
        return "wo";
    default:
        return object->access & CIA402_MAP_RPDO ? "rww" : "rw";
    }
}

/* ---- objects ---- */

/* Writes the keys of a variable, or of a sub-index. */
static void eds_put_variable(const struct cia402_node *node, const struct cia402_entry *entry,
                             FILE *out)
{
    const struct cia402_object *object = entry->object;
    bool bounded = object && (object->min || object->max);

    fprintf(out, "ObjectType=0x%X\nDataType=0x%04X\nAccessType=%s\n", OBJECT_VARIABLE, entry->type,
            eds_access(object));
    if (bounded) {
        eds_put_number("LowLimit", entry->type, object->min, out);
        eds_put_number("HighLimit", entry->type, object->max, out);
    }
    eds_put_default(node, entry, out);
    fprintf(out, "PDOMapping=%d\n\n",
            object && object->access & (CIA402_MAP_TPDO | CIA402_MAP_RPDO) ? 1 : 0);
}

/* Returns the name of an object: where it has sub-indices, that of the first. */
static const char *eds_object_name(const struct cia402_node *node, unsigned index)
{
    struct cia402_entry entry;

    for (unsigned sub = 0; sub < SUBS_MAX; sub++) {
        if (eds_has(node, index, sub, &entry) && entry.object) {
            return entry.object->name;
        }
    }
    return "";
}

/* Writes the section of a sub-index. */
static void eds_put_sub(const struct cia402_node *node, unsigned index, unsigned sub,
                        const struct cia402_entry *entry, FILE *out)
{
    fprintf(out, "[%Xsub%X]\n", index, sub);
    if (!entry->object) {
        fputs("ParameterName=Highest sub-index supported\n", out);
    } else if (entry->object->count > 1) {
        fprintf(out, "ParameterName=%s %u\n", entry->object->name, sub);
    } else {
        fprintf(out, "ParameterName=%s\n", entry->object->name);
    }
    eds_put_variable(node, entry, out);
}

/* Writes the sections of an index, if the node has it. */
static void eds_put_object(const struct cia402_node *node, unsigned index, FILE *out)
{
    struct cia402_entry entry;
    unsigned subs = 0;

    for (unsigned sub = 0; sub < SUBS_MAX; sub++) {
        subs += eds_has(node, index, sub, &entry);
    }
    if (!eds_has(node, index, 0, &entry)) {
        return;
    }
    fprintf(out, "[%X]\nParameterName=%s\n", index, eds_object_name(node, index));
    if (subs == 1) {
        eds_put_variable(node, &entry, out);
        return;
    }

    /* Communication parameters and the identity are records, whatever types they have */
    fprintf(out, "ObjectType=0x%X\nSubNumber=%u\n\n",
            index == 0x1018 || index == 0x1200 || (index >= 0x1400 && index < 0x1c00) ||
                    index % CIA402_AXIS_STEP == 0x60c2 % CIA402_AXIS_STEP
                ? OBJECT_RECORD
                : OBJECT_ARRAY,
            subs);
    for (unsigned sub = 0; sub < SUBS_MAX; sub++) {
        if (eds_has(node, index, sub, &entry)) {
            eds_put_sub(node, index, sub, &entry, out);
        }
    }
}

/* ---- the file ---- */

/* Writes a section of the list of objects: their number and their indices. */
static void eds_put_list(const struct cia402_node *node, const char *name, enum section section,
                         FILE *out)
{
    struct cia402_entry entry;
    unsigned count = 0;

    for (unsigned index = FIRST_INDEX; index <= LAST_INDEX; index++) {
        count += eds_section_of(index) == section && eds_has(node, index, 0, &entry);
    }
    fprintf(out, "[%s]\nSupportedObjects=%u\n", name, count);
    count = 0;
    for (unsigned index = FIRST_INDEX; index <= LAST_INDEX; index++) {
        if (eds_section_of(index) == section && eds_has(node, index, 0, &entry)) {
            fprintf(out, "%u=0x%04X\n", ++count, index);
        }
    }
    putc('\n', out);
}

/* Writes the sections before the objects: file, device, dummies and comments. */
static void eds_put_head(const struct cia402_node *node, const char *name, FILE *out)
{
    static const int rates[] = {10, 20, 50, 125, 250, 500, 800, 1000};

    fprintf(out,
            "[FileInfo]\nFileName=%s\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\n"
            "Description=%s, %u axes\nCreationTime=12:00AM\nCreationDate=01-01-2026\n"
            "CreatedBy=coman-hil\nModificationTime=12:00AM\nModificationDate=01-01-2026\n"
            "ModifiedBy=coman-hil\n\n",
            name, node->device, node->axes);
    fprintf(out,
            "[DeviceInfo]\nVendorName=coman-hil\nVendorNumber=0x%" PRIX64
            "\nProductName=%s\nProductNumber=0x%" PRIX64 "\nRevisionNumber=0x%" PRIX64
            "\nOrderCode=%s\n",
            node->identity[0], node->device, node->identity[1], node->identity[2],
            node->board.config.name);
    for (size_t i = 0; i < sizeof rates / sizeof *rates; i++) {
        fprintf(out, "BaudRate_%d=1\n", rates[i]);
    }
    fprintf(out,
            "SimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=8\n"
            "DynamicChannelsSupported=0\nGroupMessaging=0\nNrOfRXPDO=%u\nNrOfTXPDO=%u\n"
            "LSS_Supported=1\n\n[DummyUsage]\nDummy0001=0\n",
            cia402_pdos(node), cia402_pdos(node));
    for (int type = CIA402_I8; type <= CIA402_U32; type++) {
        fprintf(out, "Dummy%04X=1\n", type);
    }
    fputs("\n[Comments]\nLines=1\nLine1=Positions in 10 urad of the joint, voltages in 2 mV.\n\n",
          out);
}

enum error_code cia402_eds_write(const struct board_config *board, const char *name,
                                 struct arena *arena, FILE *out, struct error *error)
{
    enum cia402_kind kind = cia402_kind_of(board);
    struct board *made = kind == CIA402_KIND_DRIVE ? cia402_motor_create(arena)
                         : kind == CIA402_KIND_FT  ? cia402_ft_create(arena)
                                                   : cia402_inertial_create(arena);
    struct cia402_node *node;

    if (!made) {
        return error_set(error, ERROR_MEMORY, "no memory left for the EDS file");
    }

    /* A node as it comes from the factory, on no bus */
    node = cia402_node_of(made);
    made->config = *board;
    made->address = board->address;
    node->axes = board_config_axes(board);
    cia402_set_factory(node);
    eds_put_head(node, name, out);
    eds_put_list(node, "MandatoryObjects", MANDATORY, out);
    eds_put_list(node, "OptionalObjects", OPTIONAL, out);
    eds_put_list(node, "ManufacturerObjects", MANUFACTURER, out);
    for (unsigned index = FIRST_INDEX; index <= LAST_INDEX; index++) {
        eds_put_object(node, index, out);
    }
    return ERROR_NONE;
}
