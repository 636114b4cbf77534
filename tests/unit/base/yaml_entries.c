/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Lists whose entries may stand in a mapping: both forms read alike, and a file that extends
 * another changes entries by name, adds some behind them, or replaces the list.
 */
#include "base/array.h"
#include "base/yaml.h"
#include "tests/test.h"

struct wheel {
    struct yaml_mark mark;
    int64_t address;
    const char *tire;
};

struct axle {
    struct yaml_mark mark;
    const char *name;
    double load;
    struct wheel *wheel;
    size_t nwheel;
};

struct train {
    struct yaml_mark mark;
    struct axle *axle;
    size_t naxle;
};

#define AT(member) offsetof(struct STRUCT, member)
#define STRUCT wheel
static const struct yaml_field wheel_fields[] = {
    {"address", YAML_INT, true, AT(address), .min = 1, .max = 31},
    {"tire", YAML_STRING, true, .offset = AT(tire)},
};
static const struct yaml_schema wheel_schema = {.what = "a wheel",
                                                .size = sizeof(struct wheel),
                                                .fields = wheel_fields,
                                                .field_count = ARRAY_COUNT(wheel_fields)};
#undef STRUCT
#define STRUCT axle
static const struct yaml_field axle_fields[] = {
    {"name", YAML_STRING, true, AT(name), .min = 1, .max = 63},
    {"load", YAML_REAL, true, .offset = AT(load)},
    {"wheels", YAML_LIST, true, AT(wheel), AT(nwheel), .schema = &wheel_schema,
     .entry_key = "address"},
};
static const struct yaml_schema axle_schema = {.what = "an axle",
                                               .size = sizeof(struct axle),
                                               .fields = axle_fields,
                                               .field_count = ARRAY_COUNT(axle_fields)};
#undef STRUCT
#define STRUCT train
static const struct yaml_field train_fields[] = {
    {"axles", YAML_LIST, true, AT(axle), AT(naxle), .schema = &axle_schema, .entry_key = "name"},
};
static const struct yaml_schema train_schema = {.what = "a train",
                                                .size = sizeof(struct train),
                                                .fields = train_fields,
                                                .field_count = ARRAY_COUNT(train_fields),
                                                .extendable = true};

#define LISTS                                                                                      \
    "axles:\n"                                                                                     \
    "  - name: front\n"                                                                            \
    "    load: 1\n"                                                                                \
    "    wheels: [{address: 1, tire: a}, {address: 0x02, tire: b}]\n"                              \
    "  - {name: rear, load: 2, wheels: [{address: 3, tire: c}]}\n"
#define MAPS                                                                                       \
    "axles:\n"                                                                                     \
    "  front: {load: 1, wheels: {1: {tire: a}, 0x02: {tire: b}}}\n"                                \
    "  rear: {load: 2, wheels: {3: {tire: c}}}\n"

static char folder[64];
static struct arena arena;
static struct train train;
static struct error error;

FIXTURE(open_folder)
{
    strcpy(folder, "/tmp/hil-entries-XXXXXX");
    return !mkdtemp(folder) || arena_init(&arena, 1 << 20, &error);
}

FIXTURE(close_folder)
{
    char command[96];

    arena_fini(&arena);
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return system(command);
}

/* Reads a file that extends another of that text. */
static enum error_code read_train(const char *base, const char *text)
{
    char path[96];
    FILE *file;

    snprintf(path, sizeof path, "%s/base.yaml", folder);
    file = fopen(path, "w");
    assert_non_null(file);
    fputs(base, file);
    fclose(file);
    snprintf(path, sizeof path, "%s/train.yaml", folder);
    return yaml_read_text(path, text, strlen(text), &train_schema, &arena, &train, &error);
}

/* The train in a line: axles by name and load, wheels by address and tire. */
static void assert_train(const char *expected)
{
    char text[512] = "";
    size_t used = 0;

    for (size_t a = 0; a < train.naxle; a++) {
        const struct axle *axle = &train.axle[a];

        used += (size_t)snprintf(text + used, sizeof text - used, "%s%s %g:", a ? "; " : "",
                                 axle->name, axle->load);
        for (size_t w = 0; w < axle->nwheel; w++) {
            used += (size_t)snprintf(text + used, sizeof text - used, " %d%s",
                                     (int)axle->wheel[w].address, axle->wheel[w].tire);
        }
    }
    assert_string_equal(text, expected);
}

static void assert_extended(const char *base, const char *text, const char *expected)
{
    assert_no_error(read_train(base, text), error.text);
    assert_train(expected);
}

TEST_WITH(lists_and_mappings_read_alike, open_folder, close_folder)
{
    assert_extended("", LISTS, "front 1: 1a 2b; rear 2: 3c");
    assert_extended("", MAPS, "front 1: 1a 2b; rear 2: 3c");
    assert_extended(LISTS, "extends: base.yaml\n", "front 1: 1a 2b; rear 2: 3c");
}

TEST_WITH(a_mapping_changes_entries_and_adds_some, open_folder, close_folder)
{
    static const char *const bases[] = {LISTS, MAPS};

    for (size_t n = 0; n < ARRAY_COUNT(bases); n++) {
        assert_extended(bases[n], "extends: base.yaml\naxles: {rear: {load: 5}}\n",
                        "front 1: 1a 2b; rear 5: 3c");
        assert_extended(bases[n],
                        "extends: base.yaml\naxles: {rear: {wheels: {4: {tire: d}}},\n"
                        "  front: {wheels: {2: {tire: x}}}, new: {load: 7, wheels: {}}}\n",
                        "front 1: 1a 2x; rear 2: 3c 4d; new 7:");
    }
}

TEST_WITH(a_list_replaces_all, open_folder, close_folder)
{
    assert_extended(MAPS, "extends: base.yaml\naxles: [{name: front, load: 3, wheels: []}]\n",
                    "front 3:");
    assert_extended(LISTS,
                    "extends: base.yaml\naxles: {front: {wheels: [{address: 9, tire: z}]}}\n",
                    "front 1: 9z; rear 2: 3c");
}

static void assert_refused(const char *text, const char *what)
{
    assert_int_equal(read_train(LISTS, text), ERROR_INPUT);
    if (!strstr(error.text, what)) {
        fail_msg("%s: %s", what, error.text);
    }
}

TEST_WITH(what_is_no_entry_is_refused_at_its_place, open_folder, close_folder)
{
    assert_refused("axles: {front: 3}\n", "train.yaml:1:16: found 3, expected a mapping");
    assert_refused("extends: base.yaml\naxles: {front: 3}\n",
                   "train.yaml:2:16: found 3, expected a mapping");
    assert_refused("axles: {front: {name: rear, load: 1, wheels: {}}}\n",
                   "train.yaml:1:17: found name");
    assert_refused("axles: {front: {load: 1, wheels: {x: {tire: a}}}}\n", "train.yaml:1:35: found");
    assert_refused("axles: {front: {load: 1, wheels: {32: {tire: a}}}}\n", "31");
    assert_refused("axles: 3\n", "expected a list of mappings");
}
