/* SPDX-License-Identifier: Apache-2.0 */
/* The store of parsed files: what is read with it is what is read without it. */
#include "tests/unit/base/yaml_car.h"

#include "base/yaml_tree.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

struct part {
    struct yaml_mark mark;
    double weight;
};

static const struct yaml_field part_fields[] = {
    {"weight", YAML_REAL, true, .offset = offsetof(struct part, weight)},
};

static const struct yaml_schema part_schema = {.what = "a part",
                                               .size = sizeof(struct part),
                                               .fields = part_fields,
                                               .field_count = ARRAY_COUNT(part_fields),
                                               .extendable = true,
                                               .format_version = 1};

/* Writes a file into the working directory. */
static void write_file(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");

    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
}

/* Reads the weight in a file, which must be at that line. */
static double weight_in(const char *path, int line)
{
    struct part part;
    struct error error;

    assert_ok(yaml_read_file(path, &part_schema, &arena, &part, &error));
    assert_string_equal(part.mark.file, path);
    assert_int_equal(part.mark.line, line);
    return part.weight;
}

/* A reader of nodes, and whether the store has the text. */
static bool store_has(const char *text)
{
    struct yaml_reader reader = {.arena = &arena, .file = "any"};
    struct yaml_node *root;
    bool found;

    assert_ok(arena_init(&reader.scratch, 1 << 20, NULL));
    found = yaml_store_find(&reader, text, strlen(text), &root);
    arena_fini(&reader.scratch);
    return found;
}

static char folder[32];

FIXTURE(open_folder)
{
    strcpy(folder, "/tmp/hil-store-XXXXXX");
    return mkdtemp(folder) && !chdir(folder) ? open_arena(test_state) : -1;
}

FIXTURE(close_folder)
{
    static const char *const name[] = {"base.yaml", "heavy.yaml", "light.yaml",
                                       "part.yaml", "other.yaml", "bad.yaml"};

    for (size_t i = 0; i < ARRAY_COUNT(name); i++) {
        unlink(name[i]);
    }
    close_arena(test_state);
    return chdir("/") || rmdir(folder) ? -1 : 0;
}

TEST_WITH(file_is_parsed_once_and_read_alike, open_folder, close_folder)
{
    static const char base[] = "format_version: 1\nweight: 3.5\n";

    write_file("base.yaml", base);
    write_file("heavy.yaml", "extends: base.yaml\nweight: 7\n");
    write_file("light.yaml", "extends: base.yaml\n");
    assert_ok(yaml_store_open(NULL));
    assert_false(store_has(base));

    /* What one reading merges and removes, another one finds whole */
    for (int again = 0; again < 2; again++) {
        assert_true(weight_in("base.yaml", 1) == 3.5);
        assert_true(store_has(base));
        assert_true(weight_in("heavy.yaml", 1) == 7);
        assert_true(weight_in("light.yaml", 1) == 3.5);
    }
    yaml_store_close();
    assert_false(store_has(base));
    assert_true(weight_in("light.yaml", 1) == 3.5);
}

TEST_WITH(changed_file_is_read_anew, open_folder, close_folder)
{
    assert_ok(yaml_store_open(NULL));
    write_file("part.yaml", "weight: 1\n");
    assert_true(weight_in("part.yaml", 1) == 1);
    write_file("part.yaml", "\nweight: 2\n");
    assert_true(weight_in("part.yaml", 2) == 2);

    /* The same text under another name has that name in its marks */
    write_file("other.yaml", "weight: 1\n");
    assert_true(weight_in("other.yaml", 1) == 1);
    yaml_store_close();
}

TEST_WITH(fault_is_told_each_time, open_folder, close_folder)
{
    struct part part;
    struct error error;

    assert_ok(yaml_store_open(NULL));
    write_file("bad.yaml", "weight: 1\nweigth: 2\n");
    for (int again = 0; again < 2; again++) {
        assert_int_equal(yaml_read_file("bad.yaml", &part_schema, &arena, &part, &error),
                         ERROR_INPUT);
        assert_non_null(strstr(error.text, "bad.yaml:2:1"));
        assert_non_null(strstr(error.text, "weigth"));
    }
    yaml_store_close();
}

/* ---- a folder for the files ---- */
