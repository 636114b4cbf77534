/* SPDX-License-Identifier: Apache-2.0 */
/* A car as a YAML document: a schema with every type in it, a whole document, and what the tests of
 * the reader do with them. */
#ifndef TESTS_UNIT_BASE_YAML_CAR_H
#define TESTS_UNIT_BASE_YAML_CAR_H

#include "base/yaml.h"

#include "base/array.h"

#include <float.h>

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
    bool electric;
    int64_t doors;
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

static const struct word colors[] = {{"red", 1}, {"green", 2}, {"on", 3}, {NULL, 0}};

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
    {.key = "electric", .type = YAML_BOOL, .offset = CAR(electric)},
    {.key = "doors", .type = YAML_INT, .offset = CAR(doors), .min = 0, .max = 9},
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

static inline enum error_code read_bytes(const char *text, size_t size, struct car *car,
                                         struct error *error)
{
    return yaml_read_text("f.yaml", text, size, &car_schema, &arena, car, error);
}

static inline struct car read_car(const char *text)
{
    struct error error = {0};
    struct car car;

    assert_no_error(read_bytes(text, strlen(text), &car, &error), error.text);
    return car;
}

/* Text is refused as bad input with exactly this message */
static inline void refused_with(const char *text, const char *message)
{
    struct error error = {0};
    struct car car;
    enum error_code code = read_bytes(text, strlen(text), &car, &error);

    if (code != ERROR_INPUT || error.code != ERROR_INPUT || strcmp(error.text, message) != 0) {
        fail_msg("for\n%s\nexpected: %s\ngot (%d): %s", text, message, (int)code, error.text);
    }
}

#endif
