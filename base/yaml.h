/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads YAML files by a schema table directly into C structs. Every error names file:line:column,
 * what was found and what was expected. Unknown keys are refused with the nearest known one. Also
 * refused: wrong types, values out of range, duplicates, missing keys, anchors/aliases, tags,
 * several documents, and too deep or too large files. Units are in the key names. Not RT-safe.
 */
#ifndef BASE_YAML_H
#define BASE_YAML_H

#include "base/arena.h"
#include "base/error.h"
#include "base/enum_names.h"

#include <stdbool.h>
#include <stddef.h>

struct yaml_key;

/* The place of a value. The arena of the read owns file and keys. */
struct yaml_mark {
    const char *file;
    int line, column;            /* from 1 */
    const struct yaml_key *keys; /* for a mapping: its keys; NULL = none */
};

/* A key of a mapping and the place of its value. */
struct yaml_key {
    const char *key; /* NULL ends the keys */
    struct yaml_mark mark;
};

enum yaml_type {
    YAML_BOOL,      /* bool */
    YAML_INT,       /* int64_t, or int with count sizeof(int) */
    YAML_REAL,      /* double, finite; or with ns an int64_t in nanoseconds, written in seconds */
    YAML_STRING,    /* const char *, in the arena; min/max bound its length when max > 0 */
    YAML_ENUM,      /* int: the value of one of the names */
    YAML_REALS,     /* double[count], exactly count entries */
    YAML_REAL_LIST, /* double * in the arena and size_t at count_offset, any length */
    YAML_NAME_LIST, /* texts with places: struct yaml_name * and size_t at count_offset */
    YAML_MAP,       /* a nested struct, read with schema */
    YAML_LIST,      /* list of mappings: struct * in the arena, size_t at count_offset */
    YAML_DICT, /* mapping name -> mapping: as YAML_LIST; the name goes to schema->name_offset */
    YAML_REAL_DICT, /* mapping name -> real: struct yaml_real_entry * and size_t at count_offset */
};

struct yaml_name {
    struct yaml_mark mark;
    const char *name;
};

struct yaml_real_entry {
    struct yaml_mark mark; /* place of the name */
    const char *name;
    double value;
};

/* The place of a key with an old name. */
struct yaml_old_key {
    struct yaml_mark mark;
    struct yaml_old_key *next; /* NULL = the last */
};

/* A key with a new name: a mapping of a schema with `now` may still use `was`. Beside `now`, the
 * old key is ignored when it has the value `only`, and unknown otherwise. */
struct yaml_renamed {
    const char *was, *now, *only;
};

struct yaml_schema;

struct yaml_field {
    const char *key;
    enum yaml_type type;
    bool required;
    size_t offset;       /* of the field in the struct */
    size_t count_offset; /* of the size_t of a list */
    size_t count;        /* for YAML_REALS, YAML_INT */
    bool ns;             /* for YAML_REAL */
    double min, max;     /* inclusive range of numbers; both 0 = any; min DBL_MIN = above zero */
    const struct yaml_schema *schema; /* for YAML_MAP, YAML_LIST, YAML_DICT */
    const struct word *names;         /* for YAML_ENUM, ends with word NULL */
    /* YAML_LIST: a unique key by which entries may also be written as a mapping; NULL = none */
    const char *entry_key;
};

/* A struct begins with `struct yaml_mark mark` (offset 0): the place of its mapping, with its keys.
 * An omitted nested map gets its parent's place, so that every message has one, and holds its
 * schema's defaults. */
struct yaml_schema {
    const char *what; /* for messages: "a joint" */
    size_t size;      /* size of the struct */
    const struct yaml_field *fields;
    size_t field_count;
    size_t name_offset; /* offset of the const char * for the name of a YAML_DICT entry */
    /* for a file: 0 = none, else offset of a uint64_t that receives the sum of the hashes of the
     * file and of all files that it extends */
    size_t hash_offset;
    /* size bytes of defaults; NULL = zeroes, or for a nested map the parent's defaults */
    const void *defaults;
    /* key of a text that may replace the mapping ("drive: NAME"); no key is required then; NULL
     * = none */
    const char *alone;
    /* For a file: the newest supported format. The file may give its format with the key
     * "format_version" (default 1); a newer one is refused. 0 = no versions. */
    int format_version;
    /* for a file: a key with a new name, and the offset of a const struct yaml_old_key * that
     * receives the list of the old one's places; NULL = none */
    const struct yaml_renamed *renamed;
    size_t old_offset;
    /* for a file: numbers, true and false may stand in quotes, as parameters of a scenario do */
    bool quoted_values;
    bool unmarked;   /* the struct belongs to another room and has no mark */
    bool extendable; /* for a file: the key "extends" names a file that this one extends */
    /* For an extendable file: finds the path of a file that `from` extends by a bare name, without
     * slash and dot. NULL = no such names. */
    enum error_code (*locate)(const char *name, const char *from, struct arena *arena,
                              const char **path, struct error *error);
};

/* Rows of a schema for keys of a struct type: a number, seconds as nanoseconds, n numbers, a text,
 * a nested mapping, a list or dictionary of mappings. */
#define YAML_NUMBER(word, must, type, member, low, high)                                           \
    {                                                                                              \
        word, YAML_REAL, must, offsetof(struct type, member), .min = low, .max = high              \
    }
#define YAML_SECONDS(word, must, type, member, low, high)                                          \
    {                                                                                              \
        word, YAML_REAL, must, offsetof(struct type, member), .ns = true, .min = low, .max = high  \
    }
#define YAML_NUMBERS(word, must, type, member, n, low, high)                                       \
    {                                                                                              \
        word, YAML_REALS, must, offsetof(struct type, member), .count = n, .min = low, .max = high \
    }
#define YAML_TEXT(word, must, type, member, low, high)                                             \
    {                                                                                              \
        word, YAML_STRING, must, offsetof(struct type, member), .min = low, .max = high            \
    }
#define YAML_SECTION(word, must, type, member, of)                                                 \
    {                                                                                              \
        word, YAML_MAP, must, offsetof(struct type, member), .schema = &of                         \
    }
#define YAML_ENTRIES(word, kind, must, type, member, counter, of)                                  \
    {                                                                                              \
        word, kind, must, offsetof(struct type, member), offsetof(struct type, counter),           \
            .schema = &of                                                                          \
    }

/* A schema from the array of its rows, with further members. */
#define YAML_SCHEMA(text, type, rows, ...)                                                         \
    {                                                                                              \
        .what = text, .size = sizeof(type), .fields = rows,                                        \
        .field_count = sizeof(rows) / sizeof *(rows), __VA_ARGS__                                  \
    }

/* Reads the file into *out, initialized with schema->defaults. Strings and lists are in arena.
 *
 * With schema->extendable a file may extend another: "extends: FILE", or a name that schema->locate
 * finds. Its values replace the other file's; mappings merge key by key. Lists are replaced as a
 * whole. A mapping in place of a list with an entry_key changes the entries that it names and
 * appends others. Each value keeps the place and the directory (for references) of its own file. */
enum error_code yaml_read_file(const char *path, const struct yaml_schema *schema,
                               struct arena *arena, void *out, struct error *error);

/* Does the same from memory; messages use `name` for the file. */
enum error_code yaml_read_text(const char *name, const char *text, size_t size,
                               const struct yaml_schema *schema, struct arena *arena, void *out,
                               struct error *error);

/* Reads the text of one top-level key of a file; other keys are ignored; NULL = missing or
 * not a text. Ignores files that it extends. The text is in arena. */
enum error_code yaml_read_key(const char *path, const char *key, struct arena *arena,
                              const char **text, struct error *error);

/* Writes "file:line:column: …" for a semantic error found after reading. Returns ERROR_INPUT. */
enum error_code yaml_error(struct error *error, const struct yaml_mark *mark, const char *format,
                           ...) __attribute__((format(printf, 3, 4)));

/* Returns the place of a key's value, by its path in a mapping ("motors.strict"). For an omitted
 * key, returns the place of the mapping that lacks it. */
const struct yaml_mark *yaml_place(const struct yaml_mark *mapping, const char *path);

/* Returns whether a mapping contains the key of a path. */
bool yaml_has(const struct yaml_mark *mapping, const char *path);

/* Copies the values that a mapping gives from one struct to another of the same schema; lists are
 * shared. */
void yaml_override(const struct yaml_schema *schema, const struct yaml_mark *mapping,
                   const void *from, void *to);

/* Names in an array of structs. */
struct yaml_names {
    const void *array;
    size_t count, stride, offset; /* offset: offset of the name in a struct */
};

#define YAML_NAMES(array, count, member)                                                           \
    ((struct yaml_names){(array), (count), sizeof *(array), offsetof(__typeof__(*(array)), member)})

/* Finds the index of a name from a file; mark: its place. The error says that the `what` ("joint")
 * is unknown, and the nearest name or all names. */
enum error_code yaml_find_name(struct yaml_names names, const char *what, const char *name,
                               const struct yaml_mark *mark, int *index, struct error *error);

/* Resolves a file reference relative to the directory of mark->file. Refuses absolute paths and
 * files outside the configuration tree, which is the parent of that directory. The path is in
 * arena. */
enum error_code yaml_resolve_path(const struct yaml_mark *mark, const char *reference,
                                  struct arena *arena, const char **path, struct error *error);

#endif
