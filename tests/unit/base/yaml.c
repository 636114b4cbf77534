/* SPDX-License-Identifier: Apache-2.0 */
/* The reader of YAML: what is read, from text and from files. What is refused: yaml_refused.c. */
#include "tests/unit/base/yaml_car.h"

#include <sys/stat.h>
#include <unistd.h>

/* ---- what is read ---- */

TEST_WITH(reads_every_type_into_the_struct, open_arena, close_arena)
{
    struct car car = read_car(full);

    assert_true(car.mass_kg == 99.5);
    assert_true(car.electric);
    assert_int_equal(car.doors, 5);
    assert_true(car.drag == -1.5e-3);
    assert_string_equal(car.plate, "12");
    assert_int_equal(car.color, 2);
    assert_true(car.origin_m[0] == 1.0 && car.origin_m[1] == 2.5 && car.origin_m[2] == -3.0);
    assert_int_equal(car.ngear, 3);
    assert_true(car.gears[0] == 4.0 && car.gears[2] == 2.0);
    assert_int_equal(car.nowner, 2);
    assert_string_equal(car.owners[1].name, "Bob");
    assert_int_equal(car.ndriver, 2);
    assert_string_equal(car.drivers[1].name, "Dee");
    assert_true(car.engine.power_w == 5e4);
    assert_int_equal(car.nwheel, 2);
    assert_true(car.wheels[0].radius_m == 0.3 && car.wheels[1].radius_m == 0.25);
    assert_int_equal(car.wheels[1].spokes, 24);
    assert_int_equal(car.nspare, 2);
    assert_string_equal(car.spares[0].name, "boot");
    assert_string_equal(car.spares[1].name, "roof");
    assert_int_equal(car.spares[0].spokes, 16);
    assert_int_equal(car.nprice, 2);
    assert_string_equal(car.prices[1].name, "used");
    assert_true(car.prices[1].value == 9000.5);
}

TEST_WITH(marks_say_where_values_stand, open_arena, close_arena)
{
    struct car car = read_car(full);

    assert_string_equal(car.mark.file, "f.yaml");
    assert_int_equal(car.mark.line, 2);
    assert_int_equal(car.mark.column, 1);
    assert_int_equal(yaml_place(&car.mark, "doors")->line, 4);
    assert_int_equal(yaml_place(&car.mark, "doors")->column, 8);
    assert_int_equal(car.drivers[1].mark.line, 13);
    assert_int_equal(car.drivers[1].mark.column, 15);
    assert_int_equal(car.wheels[1].mark.line, 17);
    assert_int_equal(car.wheels[1].mark.column, 5);
    assert_int_equal(car.spares[1].mark.column, 9);
    assert_int_equal(car.prices[1].mark.column, 22);
}

TEST_WITH(columns_count_characters_not_bytes, open_arena, close_arena)
{
    struct car car = read_car("{plate: \"\xc3\xa4\xe2\x82\xac\", mass_kg: 1, doors: 2}");

    assert_string_equal(car.plate, "\xc3\xa4\xe2\x82\xac");
    assert_int_equal(yaml_place(&car.mark, "doors")->column, 34);
}

TEST_WITH(what_is_left_out_keeps_its_default_and_gets_its_parents_mark, open_arena, close_arena)
{
    struct car car = read_car("\nmass_kg: 1\nwheels: [{radius_m: 1}]\n");

    assert_int_equal(car.doors, 4);
    assert_int_equal(car.color, 1);
    assert_false(yaml_has(&car.mark, "electric"));
    assert_null(car.plate);
    assert_int_equal(car.engine.cylinders, 4);
    assert_int_equal(car.wheels[0].spokes, 32);
    assert_int_equal(yaml_place(&car.mark, "doors")->line, 2);
    assert_string_equal(car.engine.mark.file, "f.yaml");
    assert_int_equal(car.nowner, 0);
}

TEST_WITH(a_key_that_is_given_is_known_to_be, open_arena, close_arena)
{
    struct car car = read_car("{mass_kg: 1, electric: false}");

    assert_true(yaml_has(&car.mark, "electric"));
}

TEST_WITH(a_key_is_found_by_its_path, open_arena, close_arena)
{
    struct car car = read_car("{mass_kg: 1, engine: {power_w: 5}}");

    assert_true(yaml_has(&car.mark, "mass_kg") && yaml_has(&car.mark, "engine.power_w"));
    assert_false(yaml_has(&car.mark, "mass") || yaml_has(&car.mark, "engine.cylinders"));
    assert_true(yaml_has(&car.engine.mark, "power_w"));
    assert_int_equal(yaml_place(&car.mark, "engine.power_w")->column, 32);
    assert_int_equal(yaml_place(&car.mark, "engine.cylinders")->column, 22);
    assert_int_equal(yaml_place(&car.mark, "doors")->column, 1);
}

TEST_WITH(what_a_mapping_gives_overrides_another_struct, open_arena, close_arena)
{
    struct car base = read_car("{mass_kg: 1, doors: 2, gears: [1, 2]}");
    struct car car = read_car("{mass_kg: 3, gears: [4], origin_m: [5, 6, 7]}");

    yaml_override(&car_schema, &car.mark, &car, &base);
    assert_true(base.mass_kg == 3 && base.origin_m[2] == 7);
    assert_int_equal(base.doors, 2);
    assert_true(base.ngear == 1 && base.gears[0] == 4);
}

TEST_WITH(an_unknown_name_is_refused_with_the_nearest_or_all, open_arena, close_arena)
{
    struct car car = read_car("{mass_kg: 1, owners: [Ann, Bob]}");
    const struct yaml_names names = YAML_NAMES(car.owners, car.nowner, name);
    struct error error;
    int index = -1;

    assert_ok(yaml_find_name(names, "owner", "Bob", &car.mark, &index, &error));
    assert_int_equal(index, 1);
    yaml_find_name(names, "owner", "Anne", &car.mark, &index, &error);
    assert_string_equal(error.text, "f.yaml:1:1: found unknown owner \"Anne\", expected \"Ann\"");
    yaml_find_name(names, "owner", "Zachary", &car.mark, &index, &error);
    assert_string_equal(error.text,
                        "f.yaml:1:1: found unknown owner \"Zachary\", expected Ann or Bob");
}

TEST_WITH(empty_lists_and_mappings_are_taken, open_arena, close_arena)
{
    struct car car = read_car("{mass_kg: 1, gears: [], wheels: [], spares: {}, prices: {}}");

    assert_int_equal(car.ngear + car.nwheel + car.nspare + car.nprice, 0);
}

TEST_WITH(a_byte_order_mark_and_document_markers_are_taken, open_arena, close_arena)
{
    struct car car = read_car("\xef\xbb\xbf%YAML 1.1\n---\nmass_kg: 1\ndoors: 2\n...\n");

    assert_int_equal(car.doors, 2);
    assert_int_equal(yaml_place(&car.mark, "doors")->line, 4);
}

TEST_WITH(json_is_taken, open_arena, close_arena)
{
    struct car car = read_car("{\"mass_kg\": 1, \"color\": \"green\"}");

    assert_int_equal(car.color, 2);
}

TEST_WITH(an_enum_word_may_look_like_a_boolean, open_arena, close_arena)
{
    assert_int_equal(read_car("{mass_kg: 1, color: on}").color, 3);
}

/* ---- files ---- */

static char directory[] = "/tmp/hil-yaml-XXXXXX";

static const char *file_path(const char *name)
{
    static char path[128];

    snprintf(path, sizeof path, "%s/%s", directory, name);
    return path;
}

static void file_refused_with(const char *path, const char *message)
{
    struct error error = {0};
    char expected[256];
    struct car car;

    snprintf(expected, sizeof expected, "%s: %s", path, message);
    assert_int_equal(yaml_read_file(path, &car_schema, &arena, &car, &error), ERROR_INPUT);
    assert_string_equal(error.text, expected);
}

FIXTURE(make_directory)
{
    return open_arena(test_state) || !mkdtemp(directory) ? -1 : 0;
}

FIXTURE(remove_directory)
{
    static const char *const names[] = {"car.yaml", "pipe", "secret.yaml", "loop.yaml"};

    for (size_t i = 0; i < ARRAY_COUNT(names); i++) {
        unlink(file_path(names[i]));
    }
    rmdir(directory);
    strcpy(directory + strlen(directory) - 6, "XXXXXX");
    return close_arena(test_state);
}

TEST_WITH(reads_a_file_and_names_it_in_marks, make_directory, remove_directory)
{
    FILE *file = fopen(file_path("car.yaml"), "w");
    struct error error = {0};
    struct car car;

    assert_non_null(file);
    assert_true(fputs(full, file) >= 0 && fclose(file) == 0);
    assert_ok(yaml_read_file(file_path("car.yaml"), &car_schema, &arena, &car, &error));
    assert_string_equal(car.mark.file, file_path("car.yaml"));
    assert_int_equal(car.nwheel, 2);
}

TEST_WITH(says_why_a_file_cannot_be_read, make_directory, remove_directory)
{
    file_refused_with(file_path("none.yaml"), "cannot be read: No such file or directory");
    file_refused_with(directory, "found a directory, expected a file");
    file_refused_with("/dev/null", "found no regular file, expected a file");
    assert_int_equal(symlink("loop.yaml", file_path("loop.yaml")), 0);
    file_refused_with(file_path("loop.yaml"), "cannot be read: Too many levels of symbolic links");
}

/* As a list of files wants it, which shows what each says of itself. */
TEST_WITH(one_key_is_read_whatever_else_is_in_the_file, make_directory, remove_directory)
{
    static const struct {
        const char *text, *found; /* NULL = none */
    } cases[] = {
        {"name: a\nwhat: of a car\nother: {what: else}\n", "of a car"},
        {"what: first\nname: a\n", "first"},
        {"name: a\nother: {what: else}\n", NULL},
        {"what:\n", NULL},
        {"what: [a, b]\n", NULL},
        {"- what\n- a\n", NULL},
        {"name: what\n", NULL},
    };
    struct error error = {0};
    const char *text;

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        FILE *file = fopen(file_path("car.yaml"), "w");

        assert_non_null(file);
        assert_true(fputs(cases[i].text, file) >= 0 && fclose(file) == 0);
        assert_ok(yaml_read_key(file_path("car.yaml"), "what", &arena, &text, &error));
        if (cases[i].found) {
            assert_non_null(text);
            assert_string_equal(text, cases[i].found);
        } else {
            assert_null(text);
        }
    }
    assert_int_equal(yaml_read_key(file_path("none.yaml"), "what", &arena, &text, &error),
                     ERROR_INPUT);
    assert_null(text);
}

TEST_WITH(a_pipe_is_refused_at_once, make_directory, remove_directory)
{
    assert_int_equal(mkfifo(file_path("pipe"), 0600), 0);
    file_refused_with(file_path("pipe"), "found no regular file, expected a file");
}

TEST_WITH(says_that_a_file_may_not_be_read, make_directory, remove_directory)
{
    enum { NOBODY = 65534 };
    FILE *file = fopen(file_path("secret.yaml"), "w");
    uid_t me = geteuid();

    assert_non_null(file);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(chmod(file_path("secret.yaml"), 0), 0);
    /* root may read every file: as somebody else, who may enter the folder */
    assert_int_equal(chmod(file_path("."), 0711), 0);
    if (me == 0) {
        assert_int_equal(seteuid(NOBODY), 0);
    }
    file_refused_with(file_path("secret.yaml"), "cannot be read: Permission denied");
    assert_int_equal(seteuid(me), 0);
}

TEST_WITH(paths_are_relative_to_the_file_and_stay_in_the_tree, open_arena, close_arena)
{
    static const struct {
        const char *file, *reference, *path; /* NULL = refused */
    } cases[] = {
        {"config/rigs/a.yaml", "../robots/r.yaml", "config/robots/r.yaml"},
        {"config/rigs/a.yaml", "b.yaml", "config/rigs/b.yaml"},
        {"config/rigs/a.yaml", "./x/../b.yaml", "config/rigs/b.yaml"},
        {"config/rigs/a.yaml", "sub/b.yaml", "config/rigs/sub/b.yaml"},
        {"/etc/hil/rigs/a.yaml", "../b.yaml", "/etc/hil/b.yaml"},
        {"a.yaml", "../b.yaml", "../b.yaml"},
        {"a.yaml", "b.yaml", "b.yaml"},
        {"./a.yaml", "../b.yaml", "../b.yaml"},
        {"../../a.yaml", "../b.yaml", "../../../b.yaml"},
        {"/a.yaml", "b.yaml", "/b.yaml"},
        {"x/a.yaml", "...", "x/..."},
        {"x/a.yaml", "..b/c", "x/..b/c"},
        {"config/rigs/a.yaml", "../../b.yaml", NULL},
        {"config/rigs/a.yaml", "x/../../../b.yaml", NULL},
        {"config/rigs/a.yaml", "..//../b.yaml", NULL},
        {"config/rigs/a.yaml", "../../config/rigs/b.yaml", NULL},
        {"config/rigs/a.yaml", "/etc/passwd", NULL},
        {"config/rigs/a.yaml", "", NULL},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct yaml_mark mark = {.file = cases[i].file, .line = 7, .column = 3};
        struct error error = {0};
        const char *path = NULL;
        enum error_code code = yaml_resolve_path(&mark, cases[i].reference, &arena, &path, &error);

        if (cases[i].path) {
            assert_ok(code);
            assert_string_equal(path, cases[i].path);
        } else {
            assert_int_equal(code, ERROR_INPUT);
            assert_non_null(strstr(error.text, "config/rigs/a.yaml:7:3: found "));
        }
    }
}
