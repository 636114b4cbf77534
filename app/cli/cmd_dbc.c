/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil dbc: writes the meaning of the frames on a rig's buses as DBC files. */
#include "app/cli/cli.h"

#include "base/whole_file.h"
#include "manual/dbc.h"
#include "rig/client_table.h"
#include "rig/dbc.h"

enum { PATH_SIZE = 1024 };

/* ---- one bus ---- */

/* Writes the DBC of a bus to a file and prints the numbers of its messages and signals. Without a
 * path, writes the DBC to standard output. */
static enum error_code export_bus(const struct rig *rig, size_t bus, const char *path,
                                  struct arena *arena, struct error *error)
{
    struct whole_file file;
    size_t signals = 0;
    struct dbc *dbc;
    enum error_code code = rig_dbc(rig, bus, arena, &dbc, error);

    if (code) {
        return code;
    }
    if (!path) {
        return dbc_write(dbc, stdout, error);
    }
    code = whole_file_open(&file, path, error);
    if (code) {
        return code;
    }
    code = whole_file_close(&file, dbc_write(dbc, file.out, error), error);
    for (const struct dbc_message *m = dbc->message; m; m = m->next) {
        signals += m->nsignal;
    }
    if (!code) {
        printf("%-16s %4zu messages %5zu signals  %s\n", rig->bus[bus].name, dbc->nmessage, signals,
               path);
    }
    return code;
}

/* ---- the command ---- */

/* Writes the client table to RIG.joints in a folder. */
static enum error_code export_table(const struct rig *rig, const char *folder, struct error *error)
{
    char path[PATH_SIZE];
    struct whole_file file;
    enum error_code code;

    if (snprintf(path, sizeof path, "%s/%s.joints", folder, rig->name) >= PATH_SIZE) {
        return error_set(error, ERROR_INPUT, "--output: the folder's name is too long");
    }
    code = whole_file_open(&file, path, error);
    if (code) {
        return code;
    }
    code = rig_client_table(rig, file.out, error);
    return whole_file_close(&file, code, error);
}

/* Writes the DBC of each bus to RIG-BUS.dbc in a folder, and the client table. */
static enum error_code export_all(const struct rig *rig, const char *folder, struct arena *arena,
                                  struct error *error)
{
    enum error_code code = export_table(rig, folder, error);

    for (size_t i = 0; i < rig->nbus && !code; i++) {
        char path[PATH_SIZE];

        if (snprintf(path, sizeof path, "%s/%s-%s.dbc", folder, rig->name, rig->bus[i].name) >=
            PATH_SIZE) {
            return error_set(error, ERROR_INPUT, "--output: the folder's name is too long");
        }
        code = export_bus(rig, i, path, arena, error);
    }
    return code;
}

struct dbc_options {
    const char *rig, *bus, *output;
};

/* Writes one bus or all buses, as the options say. */
static enum error_code export_rig(const struct dbc_options *o, const struct rig *rig,
                                  struct arena *arena, struct error *error)
{
    int found;

    if (!o->bus) {
        enum error_code code = o->output ? folder_make_all(o->output, error) : ERROR_NONE;

        return code ? code : export_all(rig, o->output ? o->output : ".", arena, error);
    }
    found = rig_find_bus(rig, o->bus);
    if (found < 0) {
        char names[256] = "";
        size_t used = 0;

        /* Set the error for an unknown bus; it lists the rig's buses */
        for (size_t i = 0; i < rig->nbus && used < sizeof names; i++) {
            used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", i ? ", " : "",
                                     rig->bus[i].name);
        }
        return error_set(error, ERROR_INPUT,
                         "--bus: found \"%.100s\", expected a bus of %.200s: %s%s", o->bus,
                         rig->file, names, used < sizeof names ? "" : "...");
    }
    if (o->output && strlen(o->output) >= PATH_SIZE) {
        return error_set(error, ERROR_INPUT, "--output: the file's name is too long");
    }
    return export_bus(rig, (size_t)found, o->output, arena, error);
}

static int dbc_run(void *context, const struct rig *rig, struct arena *arena)
{
    struct error error;

    return export_rig(context, rig, arena, &error) ? command_fail("dbc", &error) : STATUS_OK;
}

int cmd_dbc(int argc, char **argv)
{
    static struct dbc_options o;
    static const struct option_spec options[] = {
        {"--bus", OPTION_STRING, "NAME", "this bus only; all of the rig by default",
         .value = &o.bus},
        {"--output", OPTION_STRING, "PATH",
         "with --bus the file to write, standard output by default; else the folder to write into, "
         "which is made when it is not there, the current one by default",
         .value = &o.output, .letter = "-o"},
    };
    static const struct operand_spec operands[] = {
        {"RIG", "a rig's file or name", true, &o.rig, .noun = "rigs"}};
    static const struct command_spec spec = {
        .name = "dbc",
        .summary = "Write DBC files of the messages on a rig's buses.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_DBC,
    };
    int status;

    return options_read(&spec, argc, argv, &status) ? rig_command("dbc", o.rig, &o, dbc_run)
                                                    : status;
}
