/* SPDX-License-Identifier: Apache-2.0 */
/* The reader of YAML: what it refuses in a text, where and in which words. */
#include "tests/unit/base/yaml_car.h"

TEST_WITH(rejects_unknown_key_and_names_the_nearest, open_arena, close_arena)
{
    refused_with("mass_kg: 1\ndors: 3\n",
                 "f.yaml:2:1: found unknown key \"dors\" in a car, expected \"doors\"");
    refused_with("{mass_kg: 1, wheels: [{radius: 1}]}",
                 "f.yaml:1:24: found unknown key \"radius\" in a wheel, expected \"radius_m\"");
    refused_with(
        "{mass_kg: 1, engine: {power_w: 1, voltage_and_more: 1}}",
        "f.yaml:1:35: found unknown key \"voltage_and_more\" in an engine, expected power_w "
        "or cylinders");
    refused_with(
        "{mass_kg: 1, <<: {doors: 1}}",
        "f.yaml:1:14: found unknown key \"<<\" in a car, expected mass_kg, electric, doors, "
        "drag, plate, color, origin_m, gears, owners, drivers, engine, wheels, spares or "
        "prices");
}

TEST_WITH(rejects_missing_keys_with_the_place_of_the_mapping, open_arena, close_arena)
{
    refused_with("doors: 1\n", "f.yaml:1:1: found a car without key \"mass_kg\", expected it");
    refused_with("mass_kg: 1\nwheels:\n  - spokes: 3\n",
                 "f.yaml:3:5: found a wheel without key \"radius_m\", expected it");
    refused_with("mass_kg: 1\nengine: {}\n",
                 "f.yaml:2:9: found an engine without key \"power_w\", expected it");
}

TEST_WITH(rejects_a_key_that_stands_twice, open_arena, close_arena)
{
    refused_with("mass_kg: 1\ndoors: 2\nmass_kg: 3\n",
                 "f.yaml:3:1: found key \"mass_kg\" again, expected it once (it stands in line 1)");
    refused_with("{mass_kg: 1, prices: {a: 1, b: 2, a: 1}}",
                 "f.yaml:1:35: found key \"a\" again, expected it once (it stands in line 1)");
}

TEST_WITH(rejects_wrong_types, open_arena, close_arena)
{
    static const struct {
        const char *key_and_value, *message;
    } cases[] = {
        {"mass_kg: \"1\"", "f.yaml:1:11: found quoted text \"1\", expected a number from 0 to 100"},
        {"mass_kg: one", "f.yaml:1:11: found \"one\", expected a number from 0 to 100"},
        {"mass_kg: [1]", "f.yaml:1:11: found a list, expected a number from 0 to 100"},
        {"mass_kg: {a: 1}", "f.yaml:1:11: found a mapping, expected a number from 0 to 100"},
        {"mass_kg: ~", "f.yaml:1:11: found nothing, expected a number from 0 to 100"},
        {"mass_kg: null", "f.yaml:1:11: found nothing, expected a number from 0 to 100"},
        {"mass_kg: true", "f.yaml:1:11: found true, expected a number from 0 to 100"},
        {"mass_kg: 1e999", "f.yaml:1:11: found \"1e999\", expected a number from 0 to 100"},
        {"mass_kg: .inf", "f.yaml:1:11: found \".inf\", expected a number from 0 to 100"},
        {"mass_kg: .nan", "f.yaml:1:11: found \".nan\", expected a number from 0 to 100"},
        {"mass_kg: 5 kg", "f.yaml:1:11: found \"5 kg\", expected a number from 0 to 100"},
        {"mass_kg: 5kg", "f.yaml:1:11: found \"5kg\", expected a number from 0 to 100"},
        {"mass_kg: 1_000", "f.yaml:1:11: found \"1_000\", expected a number from 0 to 100"},
        {"mass_kg: 0x1g", "f.yaml:1:11: found \"0x1g\", expected a number from 0 to 100"},
        {"drag: x", "f.yaml:1:8: found \"x\", expected a number"},
        {"doors: 2.0", "f.yaml:1:9: found 2.0, expected an integer from 0 to 9"},
        {"doors: '2'", "f.yaml:1:9: found quoted text \"2\", expected an integer from 0 to 9"},
        {"doors: 99999999999999999999",
         "f.yaml:1:9: found 99999999999999999999, expected an integer from 0 to 9"},
        {"doors: 010", "f.yaml:1:9: found 010, expected an integer without leading zeros"},
        {"electric: yes", "f.yaml:1:12: found \"yes\", expected true or false"},
        {"electric: on", "f.yaml:1:12: found \"on\", expected true or false"},
        {"electric: True", "f.yaml:1:12: found \"True\", expected true or false"},
        {"electric: \"true\"", "f.yaml:1:12: found quoted text \"true\", expected true or false"},
        {"electric: 1", "f.yaml:1:12: found 1, expected true or false"},
        {"plate: 12",
         "f.yaml:1:9: found 12, expected a text (put it in quotes if it is meant as one)"},
        {"plate: true",
         "f.yaml:1:9: found true, expected a text (put it in quotes if it is meant as one)"},
        {"plate: ", "f.yaml:1:9: found nothing, expected a text"},
        {"plate: [a]", "f.yaml:1:9: found a list, expected a text"},
        {"color: [red]", "f.yaml:1:9: found a list, expected red, green or on"},
        {"color: gren",
         "f.yaml:1:9: found \"gren\", expected red, green or on (did you mean \"green\"?)"},
        {"color: turquoise", "f.yaml:1:9: found \"turquoise\", expected red, green or on"},
        {"origin_m: 1", "f.yaml:1:12: found 1, expected a list of 3 numbers"},
        {"origin_m: [1, 2]", "f.yaml:1:12: found a list of 2, expected a list of 3 numbers"},
        {"origin_m: [1, 2, 3, 4]", "f.yaml:1:12: found a list of 4, expected a list of 3 numbers"},
        {"origin_m: [1, x, 3]", "f.yaml:1:16: found \"x\", expected a number"},
        {"gears: 3", "f.yaml:1:9: found 3, expected a list of numbers"},
        {"gears: [3, [2]]", "f.yaml:1:13: found a list, expected a number"},
        {"owners: Ann", "f.yaml:1:10: found \"Ann\", expected a list of names"},
        {"owners: [Ann, 3]",
         "f.yaml:1:16: found 3, expected a text (put it in quotes if it is meant as one)"},
        {"drivers: {a: b}", "f.yaml:1:11: found a mapping, expected a list of names"},
        {"engine: [1]", "f.yaml:1:10: found a list, expected a mapping (an engine)"},
        {"engine: ", "f.yaml:1:10: found nothing, expected a mapping (an engine)"},
        {"wheels: {radius_m: 1}", "f.yaml:1:10: found a mapping, expected a list of mappings"},
        {"wheels: [1]", "f.yaml:1:11: found 1, expected a mapping (a wheel)"},
        {"spares: [a]", "f.yaml:1:10: found a list, expected a mapping of names to mappings"},
        {"spares: {a: 1}", "f.yaml:1:14: found 1, expected a mapping (a wheel)"},
        {"prices: [1]", "f.yaml:1:10: found a list, expected a mapping of names to numbers"},
        {"prices: {a: b}", "f.yaml:1:14: found \"b\", expected a number"},
    };
    char text[256];

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        snprintf(text, sizeof text, "{%s}", cases[i].key_and_value);
        refused_with(text, cases[i].message);
    }
}

TEST_WITH(rejects_values_out_of_range, open_arena, close_arena)
{
    refused_with("mass_kg: -1", "f.yaml:1:10: found -1, expected a number from 0 to 100");
    refused_with("mass_kg: 100.001", "f.yaml:1:10: found 100.001, expected a number from 0 to 100");
    refused_with("doors: 10", "f.yaml:1:8: found 10, expected an integer from 0 to 9");
    refused_with("doors: -1", "f.yaml:1:8: found -1, expected an integer from 0 to 9");
    refused_with("{mass_kg: 1, wheels: [{radius_m: 0}]}",
                 "f.yaml:1:34: found 0, expected a number above 0, at most 1");
    refused_with("engine: {power_w: -1}", "f.yaml:1:19: found -1, expected a number of at least 0");
    refused_with("plate: x", "f.yaml:1:8: found \"x\", expected a text of 2 to 8 bytes");
    refused_with("plate: waytoolong",
                 "f.yaml:1:8: found \"waytoolong\", expected a text of 2 to 8 bytes");
}

TEST_WITH(takes_values_on_the_edge_of_their_range, open_arena, close_arena)
{
    assert_true(read_car("mass_kg: 0").mass_kg == 0.0);
    assert_true(read_car("mass_kg: 100").mass_kg == 100.0);
    assert_int_equal(read_car("{mass_kg: 0, doors: 9}").doors, 9);
}

TEST_WITH(rejects_what_a_configuration_does_not_need, open_arena, close_arena)
{
    refused_with("mass_kg: &a 1",
                 "f.yaml:1:10: found anchor \"&a\", expected a value without anchor");
    refused_with("engine: &e {power_w: 1}",
                 "f.yaml:1:9: found anchor \"&e\", expected a value without anchor");
    refused_with("gears: &g [1]",
                 "f.yaml:1:8: found anchor \"&g\", expected a value without anchor");
    refused_with("mass_kg: *a", "f.yaml:1:10: found alias \"*a\", expected the value itself");
    refused_with(
        "mass_kg: !!float 1",
        "f.yaml:1:10: found tag \"tag:yaml.org,2002:float\", expected a value without tag");
    refused_with("engine: !x {power_w: 1}",
                 "f.yaml:1:9: found tag \"!x\", expected a value without tag");
    refused_with("mass_kg: 1\n---\nmass_kg: 2\n",
                 "f.yaml:2:1: found a second document, expected one document in a file");
    refused_with("? [a]\n: 1\n", "f.yaml:1:3: found a list, expected the name of a key");
    refused_with("\"\": 1\n", "f.yaml:1:1: found quoted text \"\", expected the name of a key");
}

TEST_WITH(rejects_documents_that_are_no_mapping, open_arena, close_arena)
{
    refused_with("", "f.yaml:1:1: found an empty file, expected a mapping");
    refused_with("# nothing\n", "f.yaml:2:1: found an empty file, expected a mapping");
    refused_with("---\n", "f.yaml:2:1: found nothing, expected a mapping (a car): the file is of "
                          "another kind");
    /* Files of others, which may be private: nothing of them is repeated */
    refused_with("- a\n", "f.yaml:1:1: found a list, expected a mapping (a car): the file is of "
                          "another kind");
    refused_with("root:x:0:0:root:/root:/bin/bash\ndaemon:x:1:1\n",
                 "f.yaml:1:1: found a text, expected a mapping (a car): the file is of another "
                 "kind");
    refused_with("\"secret\"", "f.yaml:1:1: found a text, expected a mapping (a car): the file is "
                               "of another kind");
    refused_with(
        "root:$6$secret:20228:0:99999:7::: \nuser: $6$secret\n",
        "f.yaml:1:1: found no known key, expected a mapping (a car): the file is of another "
        "kind");
}

TEST_WITH(rejects_malformed_yaml_with_the_parsers_reason, open_arena, close_arena)
{
    refused_with("mass_kg: [1, 2\n",
                 "f.yaml:2:1: found malformed YAML (while parsing a flow sequence: did not find "
                 "expected ',' or ']'), expected a well-formed document");
    refused_with("mass_kg: 1\n\tdoors: 2\n",
                 "f.yaml:2:1: found malformed YAML (while scanning a plain scalar: found a tab "
                 "character that violates indentation), expected a well-formed document");
    refused_with(
        "mass_kg: 1\n  doors: 2\n",
        "f.yaml:2:8: found malformed YAML (mapping values are not allowed in this context), "
        "expected a well-formed document");
}

TEST_WITH(rejects_bytes_that_are_no_text, open_arena, close_arena)
{
    static const struct {
        const char *text;
        size_t size;
        const char *message;
    } cases[] = {
        {"mass_kg: 1\nab\0cd", 16, "f.yaml:2:3: found a zero byte, expected text"},
        {"a: \xff", 4, "f.yaml:1:4: found byte 0xff, expected UTF-8 text"},
        {"\xc3\xa4\xc3", 3, "f.yaml:1:2: found byte 0xc3, expected UTF-8 text"},
        {"\xc0\xaf", 2, "f.yaml:1:1: found byte 0xc0, expected UTF-8 text"},
        {"\xed\xa0\x80", 3, "f.yaml:1:1: found byte 0xed, expected UTF-8 text"},
        {"\xf4\x90\x80\x80", 4, "f.yaml:1:1: found byte 0xf4, expected UTF-8 text"},
        {"\xff\xfem\0", 4, "f.yaml:1:1: found byte 0xff, expected UTF-8 text"},
        {"a: \x1b[31m", 8, "f.yaml:1:4: found control character 0x1b, expected text"},
        {"a: \x7f", 4, "f.yaml:1:4: found control character 0x7f, expected text"},
        {"plate: \"a\\0b\"", 13, "f.yaml:1:8: found a zero byte in a text, expected none"},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct error error = {0};
        struct car car;

        assert_int_equal(read_bytes(cases[i].text, cases[i].size, &car, &error), ERROR_INPUT);
        assert_string_equal(error.text, cases[i].message);
    }
}

TEST_WITH(escapes_cannot_break_a_message_into_lines, open_arena, close_arena)
{
    refused_with("color: \"a\\nb\\x1b\"",
                 "f.yaml:1:8: found quoted text \"a?b?\", expected red, green or on");
}

TEST_WITH(a_long_value_is_cut_between_characters_in_messages, open_arena, close_arena)
{
    char text[1200] = "color: ";

    for (int i = 0; i < 500; i++) {
        strcat(text, "\xc3\xa4");
    }
    refused_with(text,
                 "f.yaml:1:8: found \"\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4"
                 "\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4"
                 "\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4\xc3\xa4...\", "
                 "expected red, green or on");
}

/* Count copies of unit between head and tail; the caller frees it */
static char *repeat(const char *head, const char *unit, size_t count, const char *tail)
{
    size_t n = strlen(unit);
    char *text = malloc(strlen(head) + n * count + strlen(tail) + 1), *p;

    assert_non_null(text);
    p = stpcpy(text, head);
    for (size_t i = 0; i < count; i++) {
        p = mempcpy(p, unit, n);
    }
    strcpy(p, tail);
    return text;
}

TEST_WITH(rejects_documents_without_bounds, open_arena, close_arena)
{
    char *deep = repeat("gears: ", "[", 100000, "");
    char *many = repeat("gears: [", "1,", 300000, "1]");
    char *keys, *large = repeat("", "#234567\n", 600000, "mass_kg: 1\n");
    size_t used = 0;

    refused_with(deep, "f.yaml:1:24: found values nested deeper than 16, expected fewer levels");
    refused_with(many, "f.yaml:1:400003: found more than 200000 values, expected fewer");
    refused_with(large, "f.yaml: found more than 4194304 bytes, expected at most that");
    keys = malloc(100000);
    assert_non_null(keys);
    for (int i = 0; i < 5000; i++) {
        used += (size_t)sprintf(keys + used, "k%d: 1\n", i);
    }
    refused_with(keys, "f.yaml:1:1: found 5000 keys in a mapping, expected at most 4096");
    free(deep);
    free(many);
    free(large);
    free(keys);
}

TEST_WITH(reports_an_arena_that_is_full, open_arena, close_arena)
{
    struct error error;
    struct arena small;
    size_t capacity = 0;
    enum error_code code;
    struct car car;

    do {
        capacity += 64;
        assert_ok(arena_init(&small, capacity, &error));
        code = yaml_read_text("f.yaml", full, strlen(full), &car_schema, &small, &car, &error);
        assert_true(code == ERROR_NONE || code == ERROR_MEMORY);
        arena_fini(&small);
    } while (code);
    assert_true(capacity > 1000);
}
