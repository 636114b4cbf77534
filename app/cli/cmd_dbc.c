/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil dbc: what the frames of a rig's buses mean, as DBC files. */
#include "app/cli/commands.h"

#include "base/memory_file.h"
#include "base/options.h"
#include "rig/dbc.h"
#include "base/whole_file.h"

#include <stdlib.h>
#include <string.h>

#define ARENA_BYTES ((size_t)1 << 30) /* of address space; pages cost nothing until touched */

enum { PATH_SIZE = 1024 };

static const char manual[] =
    "Writes what CAN tools need to show the frames of the rig's buses as values: a DBC file a bus, "
    "for "
    "identifiers mean something else on each. It holds every board as a node, every message with "
    "its "
    "sender, length, cycle time (of telemetry while it is asked for) and frame format, every "
    "signal "
    "with "
    "its unit, range and value names, out of the tables that the boards themselves work from. "
    "Positions are in radians of the joint, voltages of icub boards in percent of the supply, "
    "STRAIN "
    "channels in N and Nm, by what the rig says of encoders, gears and sensors.\n"
    "\n"
    "With --bus the file goes to standard output or to -o FILE. Else a file RIG-BUS.dbc for each "
    "bus "
    "is written into the folder of -o.\n"
    "\n"
    "Commands of icub and foc boards are one message a board, multiplexed by byte 0; on icub motor "
    "boards bit 7 of it is the axis, so each command is there twice: SET_OPEN_LOOP_0 with the "
    "signal "
    "SET_OPEN_LOOP_pwm_0, and SET_OPEN_LOOP_1. A command has a length of its own, which DBC cannot "
    "say: "
    "cut frames that a tool encodes to the attribute FrameLength of their signals, to 1 byte "
    "without "
    "signals.";

/* ---- one bus ---- */

static enum error_code write_text(const struct dbc *dbc, struct memory_file *text,
                                  struct error *error)
{
    FILE *file = memory_file_open(text);

    if (!file) {
        return error_set(error, ERROR_MEMORY, "no memory left for the DBC file");
    }
    /* all that can fail is the stream, which memory_file_close speaks of */
    dbc_write(dbc, file, NULL);
    return memory_file_close(file, text, "the DBC file", error);
}

/* To standard output when path is NULL. */
static enum error_code put_text(const struct memory_file *text, const char *path,
                                struct error *error)
{
    struct whole_file file;
    enum error_code code;

    if (!path) {
        fwrite(text->text, 1, text->size, stdout); /* main sees whether it could be written */
        return ERROR_NONE;
    }
    code = whole_file_open(&file, path, error);
    if (code) {
        return code;
    }
    fwrite(text->text, 1, text->size, file.out);
    return whole_file_close(&file, ERROR_NONE, error);
}

static enum error_code export_bus(const struct rig *rig, size_t bus, const char *path,
                                  struct arena *arena, struct error *error)
{
    struct memory_file text = {.text = NULL};
    size_t signals = 0;
    struct dbc *dbc;
    enum error_code code = rig_dbc(rig, bus, arena, &dbc, error);

    if (code) {
        return code;
    }
    code = write_text(dbc, &text, error);
    if (!code) {
        code = put_text(&text, path, error);
    }
    free(text.text);
    for (const struct dbc_message *m = dbc->message; m; m = m->next) {
        signals += m->nsignal;
    }
    if (!code && path) {
        printf("%-16s %4zu messages %5zu signals  %s\n", rig->bus[bus].name, dbc->nmessage, signals,
               path);
    }
    return code;
}

/* ---- the command ---- */

static enum error_code export_all(const struct rig *rig, const char *folder, struct arena *arena,
                                  struct error *error)
{
    enum error_code code = ERROR_NONE;

    for (size_t i = 0; i < rig->nbus && !code; i++) {
        char path[PATH_SIZE];

        if (snprintf(path, sizeof path, "%s/%s-%s.dbc", folder, rig->name, rig->bus[i].name) >=
            PATH_SIZE) {
            return error_set(error, ERROR_INPUT, "-o: the folder's name is too long");
        }
        code = export_bus(rig, i, path, arena, error);
    }
    return code;
}

static enum error_code export_rig(const char *file, const char *bus, const char *output,
                                  struct arena *arena, struct error *error)
{
    const struct rig *rig;
    enum error_code code = rig_load(file, arena, &rig, error);
    int found;

    if (code) {
        return code;
    }
    if (!bus) {
        return export_all(rig, output ? output : ".", arena, error);
    }
    found = rig_find_bus(rig, bus);
    if (found < 0) {
        return error_set(error, ERROR_INPUT, "--bus: found \"%.100s\", expected a bus of %s", bus,
                         rig->file);
    }
    if (output && strlen(output) >= PATH_SIZE) {
        return error_set(error, ERROR_INPUT, "-o: the file's name is too long");
    }
    return export_bus(rig, (size_t)found, output, arena, error);
}

int cmd_dbc(int argc, char **argv)
{
    const char *file = NULL, *bus = NULL, *output = NULL;
    const struct option_spec options[] = {
        {.name = "--bus",
         .type = OPTION_STRING,
         .argument = "NAME",
         .help = "this bus only; all of the rig by default",
         .value = &bus},
        {.name = "-o",
         .type = OPTION_STRING,
         .argument = "PATH",
         .help = "with --bus the file to write, standard output by default; else the folder to "
                 "write into, which must exist, the present one by default",
         .value = &output},
    };
    const struct operand_spec operands[] = {
        {.name = "RIG", .help = "the rig file", .required = true, .value = &file},
    };
    const struct command_spec spec = {
        .name = "dbc",
        .summary = "write DBC files of the messages on a rig's buses",
        .option = options,
        .noption = sizeof options / sizeof options[0],
        .operand = operands,
        .noperand = 1,
        .manual = manual,
    };
    struct arena arena;
    struct error error;
    enum error_code code;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    if (arena_init(&arena, ARENA_BYTES, &error)) {
        return command_fail(spec.name, &error);
    }
    code = export_rig(file, bus, output, &arena, &error);
    arena_fini(&arena);
    return code ? command_fail(spec.name, &error) : STATUS_OK;
}
