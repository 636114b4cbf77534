/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil list: lists rigs, robots, tasks and other names that commands accept. */
#include "app/cli/cli.h"
#include "app/scenario/scenario.h"
#include "base/config.h"
#include "manual/list.h"

/* Receives a name and a line of text about it. */
typedef void (*list_put)(const char *name, const char *text);

static void list_put_fault(void *context, const char *line, const char *means)
{
    const list_put *put = context;

    (*put)(line, means);
}

/* Lists the driven joints of a rig with their buses, or its faults. */
static enum error_code list_rig(const char *name, bool faults, list_put put, struct error *error)
{
    const struct rig *rig;
    struct arena arena;
    char text[256];
    enum error_code code = arena_init(&arena, RIG_COMMAND_ARENA, error);

    if (code) {
        return code;
    }
    code = rig_load(name, &arena, &rig, error);
    if (!code && faults) {
        code = rig_list_faults(rig, list_put_fault, &put, error);
    }
    for (size_t a = 0; !code && !faults && a < rig->naxis; a++) {
        snprintf(text, sizeof text, "on the bus %s", rig->bus[rig->axis[a].bus].name);
        put(rig->axis[a].joint, text);
    }
    arena_fini(&arena);
    return code;
}

#define LIST_ARENA_BYTES ((size_t)1 << 30) /* reserved address space */

/* Kinds: the kinds of configuration files, then tasks, then kinds that are only listed on
 * request. */
enum { LIST_TASKS = CONFIG_KINDS, LIST_SETTINGS, LIST_JOINTS, LIST_FAULTS, LIST_ALL };

/* Column of the text after a name. */
enum { NAME_COLUMN = 28 };

static const char of_this_machine[] = "/etc/";
static const char *const nouns[] = {"rigs",      "robots",      "scenarios", "drives",
                                    "protocols", "validations", "tasks",     "settings",
                                    "joints",    "faults",      NULL};

/* Prints a name and its wrapped text; a long name is on a separate line. */
static void list_print_line(const char *name, const char *text)
{
    int used = printf("  %s ", name);

    if (used > NAME_COLUMN) {
        putchar('\n');
        used = 0;
    }
    printf("%*s", NAME_COLUMN - used, "");
    options_wrap(text, NAME_COLUMN, NAME_COLUMN, stdout);
}

/* Reads the description in an entry's file. For a drive, *before receives a text with its kind to
 * print before the description. */
static enum error_code list_read_description(enum config_kind kind, const char *path,
                                             struct arena *arena, const char **before,
                                             const char **description, struct error *error)
{
    struct scenario *cases;
    size_t count;
    enum error_code code;
    bool hydraulic;

    switch (kind) {
    case CONFIG_SCENARIO:
        /* A scenario is valid YAML only after its parameters are inserted */
        code = scenario_read(path, arena, &cases, &count, error);
        *description = code ? NULL : cases[0].description;
        return code;
    case CONFIG_DRIVE:
        code = robot_describe_drive(path, arena, description, &hydraulic, error);
        *before = code ? "" : hydraulic ? "hydraulic: " : "electric: ";
        return code;
    default:
        return yaml_read_key(path, "description", arena, description, error);
    }
}

/* Prints an entry with its description, or the error in its file. Entries in /etc show their
 * path. */
static void list_print_entry(enum config_kind kind, const struct config_entry *entry,
                             struct arena *arena)
{
    const char *before = "", *description = NULL;
    struct error error;
    char line[1400];

    if (list_read_description(kind, entry->path, arena, &before, &description, &error)) {
        list_print_line(entry->name, error.text);
        return;
    }
    if (!strncmp(entry->path, of_this_machine, sizeof of_this_machine - 1)) {
        snprintf(line, sizeof line, "%s%.1000s (%.300s)", before, description ? description : "",
                 entry->path);
    } else {
        snprintf(line, sizeof line, "%s%.1300s", before, description ? description : entry->path);
    }
    list_print_line(entry->name, line);
}

/* Prints all entries of a kind of configuration file. */
static enum error_code list_print_kind(enum config_kind kind, bool names, struct error *error)
{
    struct config_entry *entries;
    struct arena arena;
    size_t count;
    enum error_code code = arena_init(&arena, LIST_ARENA_BYTES, error);

    if (code) {
        return code;
    }
    code = config_list(kind, &arena, &entries, &count, error);
    for (size_t i = 0; i < count && !code; i++) {
        if (names) {
            puts(entries[i].name);
        } else {
            list_print_entry(kind, &entries[i], &arena);
        }
    }
    arena_fini(&arena);
    return code;
}

/* Prints a name without its text. */
static void list_print_name(const char *name, const char *text)
{
    (void)text;
    puts(name);
}

/* Lists one kind; joints and faults need a rig. */
static enum error_code list_print_noun(int noun, const char *rig, bool names, struct error *error)
{
    list_put put = names ? list_print_name : list_print_line;
    char text[64];

    switch (noun) {
    case LIST_TASKS:
        for (const char *const *name = task_names(); *name; name++) {
            put(*name, task_summary(*name));
        }
        return ERROR_NONE;
    case LIST_SETTINGS:
        for (const char *const *task = task_names(); *task; task++) {
            snprintf(text, sizeof text, "of the task %s", *task);
            for (const char *const *name = task_setting_names(*task); *name; name++) {
                put(*name, text);
            }
        }
        return ERROR_NONE;
    case LIST_JOINTS:
    case LIST_FAULTS:
        if (!rig) {
            return error_set(error, ERROR_INPUT, "found no RIG behind %s, expected one",
                             nouns[noun]);
        }
        return list_rig(rig, noun == LIST_FAULTS, put, error);
    default:
        return list_print_kind((enum config_kind)noun, names, error);
    }
}

/* Lists each kind that needs no rig, under its title. */
static enum error_code list_print_all(bool names, struct error *error)
{
    static const char *const titles[] = {
        [CONFIG_RIG] = "Rigs (coman-hil run NAME)",
        [CONFIG_ROBOT] = "Robots (coman-hil check --robot NAME)",
        [CONFIG_SCENARIO] = "Scenarios (coman-hil test NAME)",
        [CONFIG_DRIVE] = "Drives (drive: NAME in a robot)",
        [CONFIG_PROTOCOL] = "Protocols (protocol: NAME in a rig)",
        [CONFIG_VALIDATION] = "Measured benches (coman-hil validate NAME)",
        [LIST_TASKS] = "Tasks (coman-hil run RIG --task NAME)",
    };
    enum error_code code = ERROR_NONE;

    for (int noun = 0; noun <= LIST_TASKS && !code; noun++) {
        if (!names) {
            printf("%s%s\n\n", noun ? "\n" : "", titles[noun]);
        }
        code = list_print_noun(noun, NULL, names, error);
    }
    return code;
}

/* Finds a kind by its word, plural or singular; LIST_ALL if none is given. */
static enum error_code list_find_noun(const char *given, int *noun, struct error *error)
{
    *noun = LIST_ALL;
    for (int i = 0; given && nouns[i]; i++) {
        size_t singular = strlen(nouns[i]) - 1;

        if (!strcmp(given, nouns[i]) ||
            (strlen(given) == singular && !strncmp(given, nouns[i], singular))) {
            *noun = i;
        }
    }
    return given && *noun == LIST_ALL
               ? error_set(error, ERROR_INPUT,
                           "found \"%.100s\", expected rigs, robots, scenarios, drives, protocols, "
                           "validations, tasks, settings, joints or faults",
                           given)
               : ERROR_NONE;
}

int cmd_list(int argc, char **argv)
{
    static const char *given, *rig;
    static bool names;
    static const struct option_spec options[] = {
        {"--names", OPTION_FLAG, NULL, "names alone, one a line", .value = &names},
    };
    static const struct operand_spec operands[] = {
        {"KIND",
         "rigs, robots, scenarios, drives, protocols, validations or tasks, all of them by "
         "default; settings of tasks; joints or faults of a rig",
         false, &given, .words = nouns},
        {"RIG", "for joints and faults: a rig's file or name", false, &rig, .noun = "rigs"}};
    static const struct command_spec spec = {
        .name = "list",
        .summary = "List the rigs, robots, scenarios, drives, protocols, validations and tasks "
                   "that can be given by name.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_LIST,
    };
    struct error error;
    enum error_code code;
    int status, noun;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }

    /* One kind, or all of them */
    code = list_find_noun(given, &noun, &error);
    if (!code) {
        code = noun == LIST_ALL ? list_print_all(names, &error)
                                : list_print_noun(noun, rig, names, &error);
    }
    return options_end(&spec, code, &error);
}
