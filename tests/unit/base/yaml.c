/* SPDX-License-Identifier: Apache-2.0 */
/* The YAML reader: every type, and every refusal with its place. */
#include "base/yaml.h"

#include "base/count.h"

#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "tests/unit/arena_fixture.h"

/* ---- a schema with everything in it ---- */

struct wheel {
    struct yaml_mark mark;
    const char *name;
    double radius_m;
    int64_t spokes;
};

struct engine {
    struct yaml_mark mark;
    double power_w;
    int64_t cylinders;
};

struct car {
    struct yaml_mark mark;
    bool electric, electric_given;
    int64_t doors;
    struct yaml_mark doors_mark;
    double mass_kg, drag;
    const char *plate;
    int color;
    double origin_m[3];
    double *gears;
    size_t ngear;
    struct yaml_name *owners;
    size_t nowner;
    struct yaml_name *drivers;
    size_t ndriver;
    struct engine engine;
    struct wheel *wheels;
    size_t nwheel;
    struct wheel *spares;
    size_t nspare;
    struct yaml_real_entry *prices;
    size_t nprice;
};

static const struct yaml_enum colors[] = {{"red", 1}, {"green", 2}, {"on", 3}, {NULL, 0}};

#define WHEEL(member) offsetof(struct wheel, member)
static const struct yaml_field wheel_fields[] = {
    {.key = "radius_m",
     .type = YAML_REAL,
     .required = true,
     .offset = WHEEL(radius_m),
     .min = DBL_MIN,
     .max = 1.0},
    {.key = "spokes", .type = YAML_INT, .offset = WHEEL(spokes), .min = 3, .max = 100},
};
static const struct wheel wheel_defaults = {.spokes = 32};
static const struct yaml_schema wheel_schema = {
    .what = "a wheel",
    .size = sizeof(struct wheel),
    .fields = wheel_fields,
    .field_count = ARRAY_COUNT(wheel_fields),
    .name_offset = WHEEL(name),
    .defaults = &wheel_defaults,
};

#define ENGINE(member) offsetof(struct engine, member)
static const struct yaml_field engine_fields[] = {
    {.key = "power_w",
     .type = YAML_REAL,
     .required = true,
     .offset = ENGINE(power_w),
     .min = 0.0,
     .max = INFINITY},
    {.key = "cylinders", .type = YAML_INT, .offset = ENGINE(cylinders)},
};
static const struct engine engine_defaults = {.cylinders = 4};
static const struct yaml_schema engine_schema = {
    .what = "an engine",
    .size = sizeof(struct engine),
    .fields = engine_fields,
    .field_count = ARRAY_COUNT(engine_fields),
    .defaults = &engine_defaults,
};

#define CAR(member) offsetof(struct car, member)
static const struct yaml_field car_fields[] = {
    {.key = "mass_kg",
     .type = YAML_REAL,
     .required = true,
     .offset = CAR(mass_kg),
     .min = 0.0,
     .max = 100.0},
    {.key = "electric",
     .type = YAML_BOOL,
     .offset = CAR(electric),
     .given_offset = CAR(electric_given)},
    {.key = "doors",
     .type = YAML_INT,
     .offset = CAR(doors),
     .min = 0,
     .max = 9,
     .mark_offset = CAR(doors_mark)},
    {.key = "drag", .type = YAML_REAL, .offset = CAR(drag)},
    {.key = "plate", .type = YAML_STRING, .offset = CAR(plate), .min = 2, .max = 8},
    {.key = "color", .type = YAML_ENUM, .offset = CAR(color), .names = colors},
    {.key = "origin_m", .type = YAML_REALS, .offset = CAR(origin_m), .count = 3},
    {.key = "gears", .type = YAML_REAL_LIST, .offset = CAR(gears), .count_offset = CAR(ngear)},
    {.key = "owners", .type = YAML_NAME_LIST, .offset = CAR(owners), .count_offset = CAR(nowner)},
    {.key = "drivers",
     .type = YAML_NAME_LIST,
     .offset = CAR(drivers),
     .count_offset = CAR(ndriver)},
    {.key = "engine", .type = YAML_MAP, .offset = CAR(engine), .schema = &engine_schema},
    {.key = "wheels",
     .type = YAML_LIST,
     .offset = CAR(wheels),
     .count_offset = CAR(nwheel),
     .schema = &wheel_schema},
    {.key = "spares",
     .type = YAML_DICT,
     .offset = CAR(spares),
     .count_offset = CAR(nspare),
     .schema = &wheel_schema},
    {.key = "prices", .type = YAML_REAL_DICT, .offset = CAR(prices), .count_offset = CAR(nprice)},
};
static const struct car car_defaults = {.doors = 4, .color = 1};
static const struct yaml_schema car_schema = {
    .what = "a car",
    .size = sizeof(struct car),
    .fields = car_fields,
    .field_count = ARRAY_COUNT(car_fields),
    .defaults = &car_defaults,
};

static const char full[] = "# a comment\n"
                           "mass_kg: 99.5\n"
                           "electric: true\n"
                           "doors: 0x5\n"
                           "drag: -1.5e-3\n"
                           "plate: \"12\"\n"
                           "color: green\n"
                           "origin_m: [1, 2.5, -3]\n"
                           "gears: [4, 3, 2]\n"
                           "owners:\n"
                           "  - Ann\n"
                           "  - 'Bob'\n"
                           "drivers: [Cy, Dee]\n"
                           "engine: {power_w: 5e4}\n"
                           "wheels:\n"
                           "  - {radius_m: 0.3}\n"
                           "  - radius_m: 0.25\n"
                           "    spokes: 24\n"
                           "spares:\n"
                           "  boot: {radius_m: 0.3, spokes: 16}\n"
                           "  roof: {radius_m: 0.2}\n"
                           "prices: {new: 20000, used: 9000.5}\n";

/* ---- helpers ---- */

static enum error_code read_bytes(const char *text, size_t size, struct car *car,
                                  struct error *error)
{
    return yaml_read_text("f.yaml", text, size, &car_schema, &arena, car, error);
}

static struct car read_car(const char *text)
{
    struct error error = {0};
    struct car car;

    if (read_bytes(text, strlen(text), &car, &error)) {
        fail_msg("%s", error.text);
    }
    return car;
}

/* Text is refused as bad input with exactly this message */
static void refused_with(const char *text, const char *message)
{
    struct error error = {0};
    struct car car;
    enum error_code code = read_bytes(text, strlen(text), &car, &error);

    if (code != ERROR_INPUT || error.code != ERROR_INPUT || strcmp(error.text, message) != 0) {
        fail_msg("for\n%s\nexpected: %s\ngot (%d): %s", text, message, (int)code, error.text);
    }
}

/* ---- what is read ---- */

static void reads_every_type_into_the_struct(void **state)
{
    struct car car = read_car(full);

    (void)state;
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

static void marks_say_where_values_stand(void **state)
{
    struct car car = read_car(full);

    (void)state;
    assert_string_equal(car.mark.file, "f.yaml");
    assert_int_equal(car.mark.line, 2);
    assert_int_equal(car.mark.column, 1);
    assert_int_equal(car.doors_mark.line, 4);
    assert_int_equal(car.doors_mark.column, 8);
    assert_int_equal(car.drivers[1].mark.line, 13);
    assert_int_equal(car.drivers[1].mark.column, 15);
    assert_int_equal(car.wheels[1].mark.line, 17);
    assert_int_equal(car.wheels[1].mark.column, 5);
    assert_int_equal(car.spares[1].mark.column, 9);
    assert_int_equal(car.prices[1].mark.column, 22);
}

static void columns_count_characters_not_bytes(void **state)
{
    struct car car = read_car("{plate: \"\xc3\xa4\xe2\x82\xac\", mass_kg: 1, doors: 2}");

    (void)state;
    assert_string_equal(car.plate, "\xc3\xa4\xe2\x82\xac");
    assert_int_equal(car.doors_mark.column, 34);
}

static void what_is_left_out_keeps_its_default_and_gets_its_parents_mark(void **state)
{
    struct car car = read_car("\nmass_kg: 1\nwheels: [{radius_m: 1}]\n");

    (void)state;
    assert_int_equal(car.doors, 4);
    assert_int_equal(car.color, 1);
    assert_false(car.electric_given);
    assert_null(car.plate);
    assert_int_equal(car.engine.cylinders, 4);
    assert_int_equal(car.wheels[0].spokes, 32);
    assert_int_equal(car.doors_mark.line, 2);
    assert_string_equal(car.engine.mark.file, "f.yaml");
    assert_int_equal(car.nowner, 0);
}

static void a_key_that_is_given_is_known_to_be(void **state)
{
    (void)state;
    assert_true(read_car("{mass_kg: 1, electric: false}").electric_given);
}

static void empty_lists_and_mappings_are_taken(void **state)
{
    struct car car = read_car("{mass_kg: 1, gears: [], wheels: [], spares: {}, prices: {}}");

    (void)state;
    assert_int_equal(car.ngear + car.nwheel + car.nspare + car.nprice, 0);
}

static void a_byte_order_mark_and_document_markers_are_taken(void **state)
{
    struct car car = read_car("\xef\xbb\xbf%YAML 1.1\n---\nmass_kg: 1\ndoors: 2\n...\n");

    (void)state;
    assert_int_equal(car.doors, 2);
    assert_int_equal(car.doors_mark.line, 4);
}

static void json_is_taken(void **state)
{
    struct car car = read_car("{\"mass_kg\": 1, \"color\": \"green\"}");

    (void)state;
    assert_int_equal(car.color, 2);
}

static void an_enum_word_may_look_like_a_boolean(void **state)
{
    (void)state;
    assert_int_equal(read_car("{mass_kg: 1, color: on}").color, 3);
}

/* ---- what is refused ---- */

static void rejects_unknown_key_and_names_the_nearest(void **state)
{
    (void)state;
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

static void rejects_missing_keys_with_the_place_of_the_mapping(void **state)
{
    (void)state;
    refused_with("doors: 1\n", "f.yaml:1:1: found a car without key \"mass_kg\", expected it");
    refused_with("mass_kg: 1\nwheels:\n  - spokes: 3\n",
                 "f.yaml:3:5: found a wheel without key \"radius_m\", expected it");
    refused_with("mass_kg: 1\nengine: {}\n",
                 "f.yaml:2:9: found an engine without key \"power_w\", expected it");
}

static void rejects_a_key_that_stands_twice(void **state)
{
    (void)state;
    refused_with("mass_kg: 1\ndoors: 2\nmass_kg: 3\n",
                 "f.yaml:3:1: found key \"mass_kg\" again, expected it once (it stands in line 1)");
    refused_with("{mass_kg: 1, prices: {a: 1, b: 2, a: 1}}",
                 "f.yaml:1:35: found key \"a\" again, expected it once (it stands in line 1)");
}

static void rejects_wrong_types(void **state)
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
        {"mass_kg: 0x10", "f.yaml:1:11: found 0x10, expected a number from 0 to 100"},
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

    (void)state;
    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        snprintf(text, sizeof text, "{%s}", cases[i].key_and_value);
        refused_with(text, cases[i].message);
    }
}

static void rejects_values_out_of_range(void **state)
{
    (void)state;
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

static void takes_values_on_the_edge_of_their_range(void **state)
{
    (void)state;
    assert_true(read_car("mass_kg: 0").mass_kg == 0.0);
    assert_true(read_car("mass_kg: 100").mass_kg == 100.0);
    assert_int_equal(read_car("{mass_kg: 0, doors: 9}").doors, 9);
}

static void rejects_what_a_configuration_does_not_need(void **state)
{
    (void)state;
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

static void rejects_documents_that_are_no_mapping(void **state)
{
    (void)state;
    refused_with("", "f.yaml:1:1: found an empty file, expected a mapping");
    refused_with("# nothing\n", "f.yaml:2:1: found an empty file, expected a mapping");
    refused_with("---\n", "f.yaml:2:1: found nothing, expected a mapping (a car)");
    refused_with("- a\n", "f.yaml:1:1: found a list, expected a mapping (a car)");
    refused_with("hello", "f.yaml:1:1: found \"hello\", expected a mapping (a car)");
}

static void rejects_malformed_yaml_with_the_parsers_reason(void **state)
{
    (void)state;
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

static void rejects_bytes_that_are_no_text(void **state)
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

    (void)state;
    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct error error = {0};
        struct car car;

        assert_int_equal(read_bytes(cases[i].text, cases[i].size, &car, &error), ERROR_INPUT);
        assert_string_equal(error.text, cases[i].message);
    }
}

static void escapes_cannot_break_a_message_into_lines(void **state)
{
    (void)state;
    refused_with("color: \"a\\nb\\x1b\"",
                 "f.yaml:1:8: found quoted text \"a?b?\", expected red, green or on");
}

static void a_long_value_is_cut_between_characters_in_messages(void **state)
{
    char text[1200] = "color: ";

    (void)state;
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

static void rejects_documents_without_bounds(void **state)
{
    char *deep = repeat("gears: ", "[", 100000, "");
    char *many = repeat("gears: [", "1,", 300000, "1]");
    char *keys, *large = repeat("", "#234567\n", 600000, "mass_kg: 1\n");
    size_t used = 0;

    (void)state;
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

static void reports_an_arena_that_is_full(void **state)
{
    struct error error;
    struct arena small;
    size_t capacity = 0;
    enum error_code code;
    struct car car;

    (void)state;
    do {
        capacity += 64;
        assert_int_equal(arena_init(&small, capacity, &error), ERROR_NONE);
        code = yaml_read_text("f.yaml", full, strlen(full), &car_schema, &small, &car, &error);
        assert_true(code == ERROR_NONE || code == ERROR_MEMORY);
        arena_fini(&small);
    } while (code);
    assert_true(capacity > 1000);
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

static int make_directory(void **state)
{
    return open_arena(state) || !mkdtemp(directory) ? -1 : 0;
}

static int remove_directory(void **state)
{
    static const char *const names[] = {"car.yaml", "pipe", "secret.yaml", "loop.yaml"};

    for (size_t i = 0; i < ARRAY_COUNT(names); i++) {
        unlink(file_path(names[i]));
    }
    rmdir(directory);
    strcpy(directory + strlen(directory) - 6, "XXXXXX");
    return close_arena(state);
}

static void reads_a_file_and_names_it_in_marks(void **state)
{
    FILE *file = fopen(file_path("car.yaml"), "w");
    struct error error = {0};
    struct car car;

    (void)state;
    assert_non_null(file);
    assert_true(fputs(full, file) >= 0 && fclose(file) == 0);
    assert_int_equal(yaml_read_file(file_path("car.yaml"), &car_schema, &arena, &car, &error),
                     ERROR_NONE);
    assert_string_equal(car.mark.file, file_path("car.yaml"));
    assert_int_equal(car.nwheel, 2);
}

static void says_why_a_file_cannot_be_read(void **state)
{
    (void)state;
    file_refused_with(file_path("none.yaml"), "cannot be read: No such file or directory");
    file_refused_with(directory, "found a directory, expected a file");
    file_refused_with("/dev/null", "found no regular file, expected a file");
    assert_int_equal(symlink("loop.yaml", file_path("loop.yaml")), 0);
    file_refused_with(file_path("loop.yaml"), "cannot be read: Too many levels of symbolic links");
}

static void a_pipe_is_refused_at_once(void **state)
{
    (void)state;
    assert_int_equal(mkfifo(file_path("pipe"), 0600), 0);
    file_refused_with(file_path("pipe"), "found no regular file, expected a file");
}

static void says_that_a_file_may_not_be_read(void **state)
{
    FILE *file = fopen(file_path("secret.yaml"), "w");

    (void)state;
    assert_non_null(file);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(chmod(file_path("secret.yaml"), 0), 0);
    if (access(file_path("secret.yaml"), R_OK) == 0) {
        print_message("SKIP: this user may read every file\n");
        skip();
    }
    file_refused_with(file_path("secret.yaml"), "cannot be read: Permission denied");
}

static void paths_are_relative_to_the_file_and_stay_in_the_tree(void **state)
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

    (void)state;
    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct yaml_mark mark = {cases[i].file, 7, 3};
        struct error error = {0};
        const char *path = NULL;
        enum error_code code = yaml_resolve_path(&mark, cases[i].reference, &arena, &path, &error);

        if (cases[i].path) {
            assert_int_equal(code, ERROR_NONE);
            assert_string_equal(path, cases[i].path);
        } else {
            assert_int_equal(code, ERROR_INPUT);
            assert_non_null(strstr(error.text, "config/rigs/a.yaml:7:3: found "));
        }
    }
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, open_arena, close_arena)
#define FILE_TEST(name) cmocka_unit_test_setup_teardown(name, make_directory, remove_directory)
    const struct CMUnitTest tests[] = {
        TEST(reads_every_type_into_the_struct),
        TEST(marks_say_where_values_stand),
        TEST(columns_count_characters_not_bytes),
        TEST(what_is_left_out_keeps_its_default_and_gets_its_parents_mark),
        TEST(a_key_that_is_given_is_known_to_be),
        TEST(empty_lists_and_mappings_are_taken),
        TEST(a_byte_order_mark_and_document_markers_are_taken),
        TEST(json_is_taken),
        TEST(an_enum_word_may_look_like_a_boolean),
        TEST(rejects_unknown_key_and_names_the_nearest),
        TEST(rejects_missing_keys_with_the_place_of_the_mapping),
        TEST(rejects_a_key_that_stands_twice),
        TEST(rejects_wrong_types),
        TEST(rejects_values_out_of_range),
        TEST(takes_values_on_the_edge_of_their_range),
        TEST(rejects_what_a_configuration_does_not_need),
        TEST(rejects_documents_that_are_no_mapping),
        TEST(rejects_malformed_yaml_with_the_parsers_reason),
        TEST(rejects_bytes_that_are_no_text),
        TEST(escapes_cannot_break_a_message_into_lines),
        TEST(a_long_value_is_cut_between_characters_in_messages),
        TEST(rejects_documents_without_bounds),
        TEST(reports_an_arena_that_is_full),
        FILE_TEST(reads_a_file_and_names_it_in_marks),
        FILE_TEST(says_why_a_file_cannot_be_read),
        FILE_TEST(a_pipe_is_refused_at_once),
        FILE_TEST(says_that_a_file_may_not_be_read),
        TEST(paths_are_relative_to_the_file_and_stay_in_the_tree),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
