/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil eds: writes the object dictionaries of a rig's CANopen nodes as EDS files. */
#include "app/cli/cli.h"

#include "base/whole_file.h"
#include "boards/protocol_list.h"
#include "manual/eds.h"

enum { EDS_PATH_SIZE = 1024, EDS_NAME_SIZE = 128 };

struct eds_options {
    const char *rig, *node, *output;
};

/* Checks whether a board's protocol has an object dictionary. */
static bool eds_is_node(const struct rig *rig, const struct board_config *board)
{
    return rig->bus[board->bus].protocol->write_eds;
}

/* Makes the file name of a node, for example coman-cia402-left_arm_0x01.eds. */
static void eds_make_name(const struct rig *rig, const struct board_config *board,
                          char name[EDS_NAME_SIZE])
{
    snprintf(name, EDS_NAME_SIZE, "%.50s-%.60s.eds", rig->name, board->name);
    for (char *c = name; *c; c++) {
        bool kept = (*c >= 'a' && *c <= 'z') || (*c >= 'A' && *c <= 'Z') ||
                    (*c >= '0' && *c <= '9') || strchr("-_.", *c);

        *c = kept ? *c : '_';
    }
}

/* Writes the EDS of a node to a file, or to standard output when path is NULL. */
static enum error_code eds_export_node(const struct rig *rig, const struct board_config *board,
                                       const char *path, struct arena *arena, struct error *error)
{
    const struct protocol *protocol = rig->bus[board->bus].protocol;
    char name[EDS_NAME_SIZE];
    struct whole_file file;
    enum error_code code;

    eds_make_name(rig, board, name);
    if (!path) {
        return protocol->write_eds(board, name, arena, stdout, error);
    }
    code = whole_file_open(&file, path, error);
    if (code) {
        return code;
    }
    return whole_file_close(&file, protocol->write_eds(board, name, arena, file.out, error), error);
}

/* Writes the EDS of each node to a folder; returns an error if the rig has none. */
static enum error_code eds_export_all(const struct rig *rig, const char *folder,
                                      struct arena *arena, struct error *error)
{
    size_t count = 0;

    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];
        char name[EDS_NAME_SIZE], path[EDS_PATH_SIZE];
        enum error_code code;

        if (!eds_is_node(rig, board)) {
            continue;
        }
        eds_make_name(rig, board, name);
        if (snprintf(path, sizeof path, "%s/%s", folder, name) >= EDS_PATH_SIZE) {
            return error_set(error, ERROR_INPUT, "--output: the folder's name is too long");
        }
        code = eds_export_node(rig, board, path, arena, error);
        if (code) {
            return code;
        }
        printf("%-16s %s\n", board->name, path);
        count++;
    }
    return count
               ? ERROR_NONE
               : error_set(error, ERROR_INPUT, "%s: found no bus with protocol cia402", rig->file);
}

/* Writes one node or all nodes, as the options say. */
static enum error_code eds_export(const struct eds_options *o, const struct rig *rig,
                                  struct arena *arena, struct error *error)
{
    if (!o->node) {
        enum error_code code = o->output ? folder_make_all(o->output, error) : ERROR_NONE;

        return code ? code : eds_export_all(rig, o->output ? o->output : ".", arena, error);
    }
    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];

        if (eds_is_node(rig, board) && !strcmp(board->name, o->node)) {
            return eds_export_node(rig, board, o->output, arena, error);
        }
    }
    return error_set(error, ERROR_INPUT, "found \"%.100s\", expected a board of a cia402 bus of %s",
                     o->node, rig->file);
}

static int eds_run(void *context, const struct rig *rig, struct arena *arena)
{
    struct error error;

    return eds_export(context, rig, arena, &error) ? command_fail("eds", &error) : STATUS_OK;
}

int cmd_eds(int argc, char **argv)
{
    static struct eds_options o;
    static const struct option_spec options[] = {
        {"--output", OPTION_STRING, "PATH",
         "with a NODE the file to write, standard output by default; else the folder to write "
         "into, which is made, the current one by default",
         .value = &o.output, .letter = "-o"},
    };
    static const struct operand_spec operands[] = {
        {"RIG", "a rig's file or name", true, &o.rig, .noun = "rigs"},
        {"NODE", "a board's name; all of the cia402 buses by default", false, .value = &o.node},
    };
    static const struct command_spec spec = {
        .name = "eds",
        .summary = "Write EDS files of the CANopen nodes on a rig's buses.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_EDS,
    };
    int status;

    return options_read(&spec, argc, argv, &status) ? rig_command("eds", o.rig, &o, eds_run)
                                                    : status;
}
