/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Reads YAML files directly into C structs, with a schema table. Every error names
 * file:line:column, what was found and what was expected. An unknown key is refused, and the error
 * suggests the nearest known key. These are also refused: wrong types, values out of range,
 * duplicate or missing keys, anchors, aliases, tags, several documents, and files that are too deep
 * or too large. Units are in the key names. Not RT-safe.
 */
#ifndef BASE_YAML_H
#define BASE_YAML_H

#include "base/arena.h"
#include "base/enum_names.h"

struct yaml_key;

/* The place of a value in a file. The arena of the read owns `file` and `keys`. */
struct yaml_mark {
    const char *file;
    int line, column;            /* both from 1 */
    const struct yaml_key *keys; /* for a mapping: its keys; NULL = none */
};

/* A key of a mapping and the place of its value. */
struct yaml_key {
    const char *key; /* NULL = end of the keys */
    struct yaml_mark mark;
};

enum yaml_type {
    YAML_BOOL,      /* bool */
    YAML_INT,       /* int64_t, or int with count sizeof(int) */
    YAML_REAL,      /* double, finite; with `ns` an int64_t in ns, in the file in seconds */
    YAML_STRING,    /* const char * in the arena; min and max bound its length if max > 0 */
    YAML_ENUM,      /* int: the value of one of `names` */
    YAML_REALS,     /* double[count], exactly count entries */
    YAML_REAL_LIST, /* double * in the arena, any length, and size_t at count_offset */
    YAML_NAME_LIST, /* list of names: struct yaml_name * and size_t at count_offset */
    YAML_MAP,       /* a nested struct, read with `schema` */
    YAML_LIST,      /* list of mappings: struct * in the arena and size_t at count_offset */
    YAML_DICT,      /* mapping name -> mapping, like YAML_LIST; name at schema->name_offset */
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

/* The place of a key that still has its old name in the file. */
struct yaml_old_key {
    struct yaml_mark mark;
    struct yaml_old_key *next; /* NULL = end of the list */
};

/* A renamed key. A file may use the old name `was` in place of the new name `now`. If a mapping has
 * both, the old key is ignored if its value is `only`, and refused otherwise. */
struct yaml_renamed {
    const char *was, *now, *only;
};

struct yaml_schema;

struct yaml_field {
    const char *key;
    enum yaml_type type;
    bool required;
    size_t offset;                    /* offset of the field in the struct */
    size_t count_offset;              /* for lists: offset of the size_t with the length */
    size_t count;                     /* YAML_REALS: entries; YAML_INT: sizeof(int) for an int */
    bool ns;                          /* YAML_REAL: store nanoseconds */
    double min, max;                  /* inclusive range; both 0 = any; min DBL_MIN = above zero */
    const struct yaml_schema *schema; /* for YAML_MAP, YAML_LIST, YAML_DICT */
    const struct word *names;         /* for YAML_ENUM, ends with word NULL */
    /* YAML_LIST: a key that identifies an entry. The file may then give a mapping in place of the
     * list: from the values of this key to the entries. NULL = list only */
    const char *entry_key;
};

/* A schema of a struct. The struct begins with `struct yaml_mark mark` (offset 0), the place of its
 * mapping with its keys, unless `unmarked` is set. If a nested mapping is omitted, its struct has
 * the defaults and the place of the parent mapping, so that messages always have a place. */
struct yaml_schema {
    const char *what; /* name in messages: "a joint" */
    size_t size;      /* size of the struct */
    const struct yaml_field *fields;
    size_t field_count;
    size_t name_offset; /* YAML_DICT: offset of the const char * for the name of an entry */
    /* For a file: offset of a uint64_t for the sum of the hashes of this file and of all files that
     * it extends. 0 = none */
    size_t hash_offset;
    /* Defaults, `size` bytes. NULL = zeros; for a nested mapping, the parent's defaults */
    const void *defaults;
    /* Key that a bare text in place of the mapping sets: "drive: NAME". Then no other key is
     * required. NULL = none */
    const char *alone;
    /* For a file: the newest supported format version. The file may give its version with the key
     * "format_version" (default 1). A newer version is refused. 0 = no versions. */
    int format_version;
    /* For a file: a renamed key. A const struct yaml_old_key * at the offset receives the list of
     * places that use the old name. NULL = none */
    const struct yaml_renamed *renamed;
    size_t old_offset;
    /* For a file: numbers, true and false may be in quotes, as in the parameters of a scenario */
    bool quoted_values;
    bool unmarked;   /* the struct is from another room and has no `mark` */
    bool extendable; /* for a file: the key "extends" names a base file */
    /* For an extendable file: finds the path of a base file that the file `from` names without a
     * slash or a dot. NULL = such names are not supported. */
    enum error_code (*locate)(const char *name, const char *from, struct arena *arena,
                              const char **path, struct error *error);
};

/* Rows of a schema. Each row is for a key and a member of a struct. The types are: a whole number
 * as int, a number, seconds as nanoseconds, n numbers, a text, a nested mapping, a list or
 * dictionary of mappings. */
#define YAML_COUNT(word, must, type, member, low, high)                                            \
    {                                                                                              \
        word, YAML_INT, must, offsetof(struct type, member), .count = sizeof(int), .min = low,     \
                                                             .max = high                           \
    }
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

/* Defines a schema with the array of its rows and further members. */
#define YAML_SCHEMA(text, type, rows, ...)                                                         \
    {                                                                                              \
        .what = text, .size = sizeof(type), .fields = rows,                                        \
        .field_count = sizeof(rows) / sizeof *(rows), __VA_ARGS__                                  \
    }

/* Defines the schema NAME_schema of the array NAME_fields. */
#define YAML_TABLE(name, text, type, ...)                                                          \
    static const struct yaml_schema name##_schema =                                                \
        YAML_SCHEMA(text, struct type, name##_fields, __VA_ARGS__)

/* Reads a file into *out, which starts with schema->defaults. Strings and lists are in arena.
 *
 * If schema->extendable is set, a file may extend a base file: "extends: FILE", or a name that
 * schema->locate finds. Values of the file replace values of the base. Mappings merge key by key.
 * Lists are replaced as a whole. For a list with an entry_key, the file may give a mapping instead:
 * it changes the entries that it names and appends new entries. Each value keeps the place and the
 * directory (for references) of the file that contains it. */
enum error_code yaml_read_file(const char *path, const struct yaml_schema *schema,
                               struct arena *arena, void *out, struct error *error);

/* Does the same as yaml_read_file from memory. Messages use `name` as the file's name. */
enum error_code yaml_read_text(const char *name, const char *text, size_t size,
                               const struct yaml_schema *schema, struct arena *arena, void *out,
                               struct error *error);

/* Reads the text of one top-level key of a file. Ignores all other keys, and base files. *text is
 * NULL if the key is missing or its value is not a text. The text is in arena. */
enum error_code yaml_read_key(const char *path, const char *key, struct arena *arena,
                              const char **text, struct error *error);

/* Writes "file:line:column: ..." for an error that is found after the read. Returns ERROR_INPUT. */
enum error_code yaml_error(struct error *error, const struct yaml_mark *mark, const char *format,
                           ...) __attribute__((format(printf, 3, 4)));

/* Returns the place of the value at a path of keys in a mapping ("motors.strict"). If a key is
 * omitted, returns the place of the mapping without this key. */
const struct yaml_mark *yaml_place(const struct yaml_mark *mapping, const char *path);

/* Returns whether a mapping contains the key at a path of keys. */
bool yaml_has(const struct yaml_mark *mapping, const char *path);

/* Copies values between two structs of the same schema, but only values that `mapping` contains.
 * Lists are shared, not copied. */
void yaml_override(const struct yaml_schema *schema, const struct yaml_mark *mapping,
                   const void *from, void *to);

/* Names of the elements of an array of structs. */
struct yaml_names {
    const void *array;
    size_t count, stride, offset; /* `offset`: offset of the name in a struct */
};

#define YAML_NAMES(array, count, member)                                                           \
    ((struct yaml_names){(array), (count), sizeof *(array), offsetof(__typeof__(*(array)), member)})

/* Finds the index of a name that a file uses. `mark` is the place of the name. `what` is its kind
 * ("joint"). If the name is unknown, the error suggests the nearest name or lists all names. */
enum error_code yaml_find_name(struct yaml_names names, const char *what, const char *name,
                               const struct yaml_mark *mark, int *index, struct error *error);

/* Resolves a file reference relative to the directory of mark->file. Refuses absolute paths.
 * Refuses files outside the configuration tree, which is the parent of this directory. The path is
 * in arena. */
enum error_code yaml_resolve_path(const struct yaml_mark *mark, const char *reference,
                                  struct arena *arena, const char **path, struct error *error);

#endif
