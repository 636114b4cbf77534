/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil import: makes a robot and a rig from a URDF or MJCF file. */
#include "app/cli/cli.h"
#include "app/import/import.h"
#include "app/import/write.h"
#include "manual/import.h"

/* Maximum number of printed notes per kind. */
enum { NOTES_SHOWN = 12 };

/* Prints the first NOTES_SHOWN notes with this fate; the report has all notes. */
static void import_print_notes(const struct import_notes *notes, enum import_fate fate,
                               const char *report)
{
    size_t shown = 0;

    for (size_t i = 0; i < notes->count; i++) {
        const struct import_note *note = &notes->note[i];

        if (note->fate == fate && shown++ < NOTES_SHOWN) {
            printf("%s:%d: %s%s\n", note->file, note->line,
                   fate == IMPORT_MISSING ? "missing: " : "", note->text);
        }
    }
    if (shown > NOTES_SHOWN) {
        printf("... and %zu more: %s has all\n", shown - NOTES_SHOWN, report);
    }
}

/* Prints the results, and the commands to run next. */
static void import_print_result(const struct import_result *result)
{
    const struct robot *robot = result->loaded;
    const struct import_notes *notes = &result->notes;
    size_t drives = 0;

    for (size_t j = 0; j < robot->njoint; j++) {
        drives += robot_joint_is_driven(&robot->joint[j]);
    }
    printf("robot     %s: %s base, %zu bodies, %zu joints, %zu drives, %zu frames, %.7g kg\n",
           result->robot, robot->floating ? "floating" : "fixed", robot->nbody, robot->njoint,
           drives, robot->nframe, robot->total_mass);
    if (robot->ncoupling > 0) {
        printf("          %zu of the joints %s, without a drive of %s own\n", robot->ncoupling,
               robot->ncoupling == 1 ? "follows another" : "follow others",
               robot->ncoupling == 1 ? "its" : "their");
    }
    printf("sensors   %zu F/T, %s inertial; %zu shapes, %zu meshes, %zu visuals, %zu poses\n",
           robot->nft, robot->imu_frame < 0 ? "no" : "one", robot->ncapsule, result->meshes,
           robot->nvisual, robot->npose);
    printf("rig       %s: %zu buses, %.1f %% of the fullest at the worst\n", result->rig,
           result->nbus, 100.0 * result->worst_load);
    if (result->standing[0]) {
        printf("          %s\n", result->standing);
    }

    /* The number of notes by fate, then the notes that are important for the user */
    printf("report    %s:", result->report);
    for (int fate = 0; fate < IMPORT_FATES; fate++) {
        printf("%s %zu %s", fate ? "," : "", import_count_notes(notes, (enum import_fate)fate),
               import_fate_word((enum import_fate)fate));
    }
    printf("\n");

    import_print_notes(notes, IMPORT_MISSING, result->report);
    import_print_notes(notes, IMPORT_DOUBTED, result->report);
    import_print_notes(notes, IMPORT_CHANGED, result->report);
    printf("next      coman-hil run %s --task hold\n", result->rig);
}

/* Runs an import and prints its result; returns the exit status. */
static int import_run_request(const struct command_spec *spec, const struct import_request *request)
{
    struct import_result result;
    struct arena arena = {0};
    struct error error;
    enum error_code code = arena_init(&arena, RIG_COMMAND_ARENA, &error);

    code = code ? code : import_run(request, &arena, &result, &error);
    if (!code) {
        import_print_result(&result);
    }
    arena_fini(&arena);
    return options_end(spec, code, &error);
}

int cmd_import(int argc, char **argv)
{
    static const struct word bases[] = {
        {"fixed", IMPORT_BASE_FIXED}, {"floating", IMPORT_BASE_FLOATING}, {NULL, 0}};
    static const struct word mimics[] = {{"couple", IMPORT_MIMIC_COUPLE},
                                         {"lock", IMPORT_MIMIC_LOCK},
                                         {"free", IMPORT_MIMIC_FREE},
                                         {NULL, 0}};
    static const struct word slides[] = {{"lock", 0}, {"free", 1}, {"drive", 2}, {NULL, 0}};
    static struct import_request r;
    static struct option_list lock, packages, drives, addresses;
    static int prismatic;
    static bool trust;
    static const struct option_spec options[] = {
        {"--output", OPTION_STRING, "DIR", "folder to write into; it is made when it is not there",
         .value = &r.folder, .letter = "-o"},
        {"--srdf", OPTION_STRING, "FILE", "take poses and the kind of base from this SRDF",
         .value = &r.srdf},
        {"--base", OPTION_ENUM, "KIND", "the base is fixed or floating; guessed by default",
         .value = &r.options.base, .words = bases},
        {"--pose", OPTION_STRING, "NAME",
         "pose to start in: rest, or one of the SRDF or the keyframes", .value = &r.pose},
        {"--protocol", OPTION_STRING, "NAME|FILE",
         "what the boards of motors speak: a protocol (coman-hil list protocols; with -fd over CAN "
         "FD), or the file of one; icub by default",
         .noun = "protocols", .value = &r.protocol},
        {"--address", OPTION_LIST, "JOINT=NUMBER",
         "address of the board of this joint; the others are counted; may be given more than once",
         .value = &addresses},
        {"--bus-load", OPTION_REAL, "PERCENT",
         "largest load of a bus, with all frames at full length; 80 by default",
         .value = &r.bus_load, .min = 1.0, .max = 100.0},
        {"--lock", OPTION_LIST, "JOINT", "fix this joint; may be given more than once",
         .value = &lock},
        {"--mimic", OPTION_ENUM, "HOW",
         "what becomes of joints that follow another: couple (they follow, driven by its drive), "
         "lock or free; refused by default",
         .value = &r.options.mimic, .words = mimics},
        {"--prismatic", OPTION_ENUM, "HOW",
         "what becomes of joints that slide: lock (the default), free, without a drive, or drive, "
         "by a pinion that turns",
         .value = &prismatic, .words = slides},
        {"--repair-inertia", OPTION_FLAG, NULL,
         "raise moments of inertia that no body can have; refused by default",
         .value = &r.options.repair_inertia},
        {"--drive", OPTION_LIST, "[JOINTS=]NAME",
         "drive of the catalogue for all joints, or for those whose names JOINTS matches (* and "
         "?); may be given more than once",
         .noun = "drives", .value = &drives},
        {"--package-path", OPTION_LIST, "DIR",
         "folder that holds the packages of package:// names; may be given more than once",
         .value = &packages},
        {"--trust", OPTION_FLAG, NULL,
         "read meshes and included files also from outside the folder of FILE", .value = &trust},
        {"--force", OPTION_FLAG, NULL, "write over the files of an import before",
         .value = &r.force},
    };
    static const struct operand_spec operands[] = {
        {"FILE", "the URDF or MJCF file", true, .value = &r.file}};
    static const struct command_spec spec = {
        .name = "import",
        .summary = "Make a robot and a rig of a URDF or MJCF file.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_IMPORT,
    };
    struct error error;
    int status;

    r = (struct import_request){0};
    trust = false;
    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }

    /* Checks that the option table cannot express */
    if (!r.folder) {
        error_set(&error, ERROR_INPUT, "found no --output, expected the folder to write into");
        return options_fail(&spec, &error);
    }
    r.address = addresses.item;
    r.naddress = addresses.count;
    r.options.free_slides = prismatic == 1;
    r.options.drive_slides = prismatic == 2;
    r.options.lock = lock.item;
    r.options.nlock = lock.count;
    r.options.drive = drives.item;
    r.options.ndrive = drives.count;
    r.packages = (struct import_packages){packages.item, packages.count, trust};
    return import_run_request(&spec, &r);
}
