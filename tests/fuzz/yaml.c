/* SPDX-License-Identifier: Apache-2.0 */
/*
 * YAML through a schema with every type in it: a text is refused with its place, or what was read
 * is within its ranges, has a place of its own, and reads the same when it is written again. An
 * input with a line "%%%" is two files, the first of which may extend the second, base.yaml.
 */
#include "base/yaml.h"

#include "base/array.h"

#include "tests/fuzz/fuzz.h"

#include <float.h>
#include <math.h>
#include <string.h>

struct part {
    struct yaml_mark mark;
    const char *name;
    double size_m;
    int64_t count;
};

struct thing {
    struct yaml_mark mark;
    bool on;
    int64_t number;
    double real, any;
    const char *text, *bounded;
    int word;
    double three[3];
    double *reals;
    struct yaml_name *names;
    struct part part, *parts, *dictionary;
    struct yaml_real_entry *prices;
    size_t nreal, nname, npart, ndictionary, nprice;
};

static const struct word words[] = {{"red", 0}, {"green", 1}, {"on", 2}, {NULL, 0}};
static const char *const word_names[] = {"red", "green", "on"};

#define PART(member) offsetof(struct part, member)
static const struct yaml_field part_fields[] = {
    {.key = "size_m",
     .type = YAML_REAL,
     .required = true,
     .offset = PART(size_m),
     .min = DBL_MIN,
     .max = 1.0},
    {.key = "count", .type = YAML_INT, .offset = PART(count), .min = -3, .max = 100},
};
static const struct part part_defaults = {.count = 32, .size_m = 0.5};
static const struct yaml_schema part_schema = {
    .what = "a part",
    .size = sizeof(struct part),
    .fields = part_fields,
    .field_count = 2,
    .name_offset = PART(name),
    .defaults = &part_defaults,
};

#define AT(member) offsetof(struct thing, member)
static const struct yaml_field thing_fields[] = {
    {.key = "on", .type = YAML_BOOL, .offset = AT(on)},
    {.key = "number", .type = YAML_INT, .offset = AT(number), .min = 0, .max = 9},
    {.key = "real", .type = YAML_REAL, .offset = AT(real), .min = -1.0, .max = 100.0},
    {.key = "any", .type = YAML_REAL, .offset = AT(any)},
    {.key = "text", .type = YAML_STRING, .offset = AT(text)},
    {.key = "bounded", .type = YAML_STRING, .offset = AT(bounded), .min = 2, .max = 8},
    {.key = "word", .type = YAML_ENUM, .offset = AT(word), .names = words},
    {.key = "three", .type = YAML_REALS, .offset = AT(three), .count = 3},
    {.key = "reals", .type = YAML_REAL_LIST, .offset = AT(reals), .count_offset = AT(nreal)},
    {.key = "names", .type = YAML_NAME_LIST, .offset = AT(names), .count_offset = AT(nname)},
    {.key = "part", .type = YAML_MAP, .offset = AT(part), .schema = &part_schema},
    {.key = "parts",
     .type = YAML_LIST,
     .offset = AT(parts),
     .count_offset = AT(npart),
     .schema = &part_schema},
    {.key = "dictionary",
     .type = YAML_DICT,
     .offset = AT(dictionary),
     .count_offset = AT(ndictionary),
     .schema = &part_schema},
    {.key = "prices", .type = YAML_REAL_DICT, .offset = AT(prices), .count_offset = AT(nprice)},
};
static const struct yaml_schema thing_schema = {
    .what = "a thing",
    .size = sizeof(struct thing),
    .fields = thing_fields,
    .field_count = ARRAY_COUNT(thing_fields),
    .extendable = true,
};

/* ---- what was read, written again ---- */

static void put_text(FILE *file, const char *text)
{
    putc('"', file);
    for (; *text; text++) {
        if (strchr("\"\\", *text) || (unsigned char)*text < 0x20 || *text == 0x7f) {
            fprintf(file, "\\x%02x", (unsigned char)*text);
        } else {
            putc(*text, file);
        }
    }
    putc('"', file);
}

static void put_part(FILE *file, const struct part *part)
{
    fprintf(file, "{size_m: %.17g, count: %lld}", part->size_m, (long long)part->count);
}

static void put_thing(FILE *file, const struct thing *thing)
{
    fprintf(file, "number: %lld\nreal: %.17g\nany: %.17g\nword: %s\n", (long long)thing->number,
            thing->real, thing->any, word_names[thing->word]);
    if (yaml_has(&thing->mark, "on")) {
        fprintf(file, "on: %s\n", thing->on ? "true" : "false");
    }
    if (thing->text) {
        fputs("text: ", file);
        put_text(file, thing->text);
    }
    if (thing->bounded) {
        fputs("\nbounded: ", file);
        put_text(file, thing->bounded);
    }
    fprintf(file, "\nthree: [%.17g, %.17g, %.17g]\nreals: [", thing->three[0], thing->three[1],
            thing->three[2]);
    for (size_t i = 0; i < thing->nreal; i++) {
        fprintf(file, "%s%.17g", i ? ", " : "", thing->reals[i]);
    }
    fputs("]\nnames: [", file);
    for (size_t i = 0; i < thing->nname; i++) {
        fputs(i ? ", " : "", file);
        put_text(file, thing->names[i].name);
    }
    fputs("]\npart: ", file);
    put_part(file, &thing->part);
    fputs("\nparts: [", file);
    for (size_t i = 0; i < thing->npart; i++) {
        fputs(i ? ", " : "", file);
        put_part(file, &thing->parts[i]);
    }
    fputs("]\ndictionary:\n", file);
    for (size_t i = 0; i < thing->ndictionary; i++) {
        fputs("  ", file);
        put_text(file, thing->dictionary[i].name);
        fputs(": ", file);
        put_part(file, &thing->dictionary[i]);
        putc('\n', file);
    }
    fputs(thing->ndictionary ? "prices:\n" : "  {}\nprices:\n", file);
    for (size_t i = 0; i < thing->nprice; i++) {
        fputs("  ", file);
        put_text(file, thing->prices[i].name);
        fprintf(file, ": %.17g\n", thing->prices[i].value);
    }
    fputs(thing->nprice ? "" : "  {}\n", file);
}

/* ---- what must hold ---- */

static void check_mark(const struct yaml_mark *mark)
{
    fuzz_require(mark->file && mark->line >= 1 && mark->column >= 1, "no place");
}

static void check_part(const struct part *part)
{
    fuzz_require(part->size_m >= DBL_MIN && part->size_m <= 1.0, "%g", part->size_m);
    fuzz_require(part->count >= -3 && part->count <= 100, "%lld", (long long)part->count);
}

static void check_thing(const struct thing *thing)
{
    check_mark(&thing->mark);
    check_mark(yaml_place(&thing->mark, "number"));
    fuzz_require(thing->number >= 0 && thing->number <= 9, "%lld", (long long)thing->number);
    fuzz_require(thing->real >= -1.0 && thing->real <= 100.0, "%g", thing->real);
    fuzz_require(isfinite(thing->any), "%g", thing->any);
    fuzz_require(thing->word >= 0 && thing->word <= 2, "%d", thing->word);
    fuzz_require(!thing->bounded || (strlen(thing->bounded) >= 2 && strlen(thing->bounded) <= 8),
                 "%s", thing->bounded);
    for (size_t i = 0; i < thing->nreal; i++) {
        fuzz_require(isfinite(thing->reals[i]), "%g", thing->reals[i]);
    }
    for (size_t i = 0; i < thing->npart; i++) {
        check_mark(&thing->parts[i].mark);
        check_part(&thing->parts[i]);
    }
    for (size_t i = 0; i < thing->ndictionary; i++) {
        check_part(&thing->dictionary[i]);
        for (size_t k = 0; k < i; k++) {
            fuzz_require(strcmp(thing->dictionary[i].name, thing->dictionary[k].name) != 0, "%s",
                         thing->dictionary[i].name);
        }
    }
}

static void check_again(const struct thing *thing)
{
    struct arena arena = {0};
    struct fuzz_text first, second;
    struct error error;
    struct thing again;

    put_thing(fuzz_text_open(&first), thing);
    fuzz_text_finish(&first);
    fuzz_require(arena_init(&arena, (size_t)64 << 20, NULL) == ERROR_NONE, "no memory");
    fuzz_require(yaml_read_text("x.yaml", first.text, first.size, &thing_schema, &arena, &again,
                                &error) == ERROR_NONE,
                 "%s\n%s", error.text, first.text);
    put_thing(fuzz_text_open(&second), &again);
    fuzz_text_finish(&second);
    fuzz_require(strcmp(first.text, second.text) == 0, "%s\n%s", first.text, second.text);
    fuzz_text_free(&first);
    fuzz_text_free(&second);
    arena_fini(&arena);
}

/* Two files: the one that may extend the other, and that one. */
static enum error_code read_files(const char *text, size_t size, const char *mark,
                                  struct arena *arena, struct thing *thing, struct error *error)
{
    char path[128];

    fuzz_write_file("x.yaml", text, (size_t)(mark - text) + 1);
    fuzz_write_file("base.yaml", mark + 5, size - (size_t)(mark + 5 - text));
    snprintf(path, sizeof path, "%s/x.yaml", fuzz_folder());
    return yaml_read_file(path, &thing_schema, arena, thing, error);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const char *text = (const char *)data, *mark = memmem(text, size, "\n%%%\n", 5);
    struct arena *arena = fuzz_arena((size_t)64 << 20);
    struct error error = {0};
    struct thing thing;
    enum error_code code =
        mark ? read_files(text, size, mark, arena, &thing, &error)
             : yaml_read_text("x.yaml", text, size, &thing_schema, arena, &thing, &error);

    if (code) {
        fuzz_require(code == ERROR_INPUT && code == error.code, "%d: %s", (int)code, error.text);
        fuzz_require(mark ? fuzz_is_sentence(error.text) &&
                                strstr(error.text, fuzz_folder()) == error.text
                          : fuzz_has_place(error.text, "x.yaml", size),
                     "%s", error.text);
        fuzz_tally.refused++;
    } else {
        check_thing(&thing);
        check_again(&thing);
        fuzz_tally.taken++;
    }
    return 0;
}
