/* SPDX-License-Identifier: Apache-2.0 */
/*
 * YAML files read through a schema table straight into C structs. Every error names
 * file:line:column, what was found and what was expected; unknown keys are refused with the nearest
 * known one, as are wrong types, values out of range, duplicates, missing keys, anchors/aliases,
 * tags, several documents, too deep or too large files. Units are in the key names. Not RT-safe.
 */
#ifndef BASE_YAML_H
#define BASE_YAML_H

#include "base/arena.h"
#include "base/error.h"
#include "base/enum_names.h"

#include <stdbool.h>
#include <stddef.h>

struct yaml_key;

/* Where a value stands. file and keys are owned by the arena of the read. */
struct yaml_mark {
    const char *file;
    int line, column;            /* from 1 */
    const struct yaml_key *keys; /* of a mapping that was read; NULL = none */
};

/* A key of a mapping and where its value stands. */
struct yaml_key {
    const char *key; /* NULL ends the keys */
    struct yaml_mark mark;
};

enum yaml_type {
    YAML_BOOL,      /* bool */
    YAML_INT,       /* int64_t, or int with count sizeof(int) */
    YAML_REAL,      /* double, finite; or with ns an int64_t of nanoseconds, given in seconds */
    YAML_STRING,    /* const char *, in the arena; min/max bound its length when max > 0 */
    YAML_ENUM,      /* int: the value of one of the words of names */
    YAML_REALS,     /* double[count], exactly count entries */
    YAML_REAL_LIST, /* double * in the arena and size_t at count_offset, any length */
    YAML_NAME_LIST, /* texts with marks: struct yaml_name * and size_t at count_offset */
    YAML_MAP,       /* a nested struct by value, read with schema */
    YAML_LIST,      /* list of mappings: struct * in the arena, size_t at count_offset */
    YAML_DICT, /* mapping name -> mapping: as YAML_LIST; the name goes to schema->name_offset */
    YAML_REAL_DICT, /* mapping name -> real: struct yaml_real_entry * and size_t at count_offset */
};

struct yaml_name {
    struct yaml_mark mark;
    const char *name;
};

struct yaml_real_entry {
    struct yaml_mark mark; /* of the name */
    const char *name;
    double value;
};

#define YAML_NO_OFFSET ((size_t)-1)

struct yaml_schema;

struct yaml_field {
    const char *key;
    enum yaml_type type;
    bool required;
    size_t offset;       /* of the value in the struct */
    size_t count_offset; /* of the size_t for lists */
    size_t count;        /* for YAML_REALS, YAML_INT */
    bool ns;             /* for YAML_REAL */
    double min, max;     /* inclusive range of numbers; both 0 = any; min DBL_MIN = above zero */
    size_t mark_offset;  /* 0 = none, else of a struct yaml_mark set to where the value stands */
    size_t given_offset; /* 0 = none, else of a bool set to true when the key is present */
    const struct yaml_schema *schema; /* for YAML_MAP, YAML_LIST, YAML_DICT */
    const struct word *names;         /* for YAML_ENUM, ends with word NULL */
    const char *entry_key; /* of YAML_LIST: the key by which entries may stand in a mapping, one
                            * that tells them apart; NULL = none */
};

/* A struct begins with `struct yaml_mark mark` (offset 0), set to where its mapping starts and with
 * its keys; that is why 0 can mean "none" for mark_offset and given_offset. What is left out (a
 * nested map, a value with a mark_offset) gets its parent's place, so that every message has one; a
 * nested map that is left out holds its schema's defaults. */
struct yaml_schema {
    const char *what; /* for messages: "a joint" */
    size_t size;      /* of the struct */
    const struct yaml_field *fields;
    size_t field_count;
    size_t name_offset; /* of the const char * that a YAML_DICT entry's name goes to */
    size_t hash_offset; /* of a file: 0 = none, else of a uint64_t set to the sum of the hashes of
                         * the bytes of the file and of all that it extends */
    const void
        *defaults;     /* size bytes that the struct starts as; NULL = zeroes, or for a nested map
                           * what the parent's defaults hold there */
    const char *alone; /* key of a text that may stand alone for the mapping ("drive: NAME"); then
                        * no key is required; NULL = there is none */
    /* Of a file: the newest format that this program reads. The file may say its own by the key
     * "format_version" (1 when it does not); a newer one is refused. 0 = files have no version. */
    int format_version;
    bool unmarked;   /* the struct is another room's and begins without a mark */
    bool extendable; /* of a file: the key "extends" names one that this one extends */
    /* Of an extendable file: the path of one that is extended by a bare name, without slash and
     * dot, from the file from; NULL = there are no such names. */
    enum error_code (*locate)(const char *name, const char *from, struct arena *arena,
                              const char **path, struct error *error);
};

/* Rows of a schema for keys of struct type: a number and one in seconds that becomes nanoseconds,
 * n numbers, a text, a nested mapping, a list or dictionary of mappings. */
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

/* A schema by the array of its rows, with further members behind. */
#define YAML_SCHEMA(text, type, rows, ...)                                                         \
    {                                                                                              \
        .what = text, .size = sizeof(type), .fields = rows,                                        \
        .field_count = sizeof(rows) / sizeof *(rows), __VA_ARGS__                                  \
    }

/* Reads the file into *out, which starts as schema->defaults. Strings and lists live in arena.
 *
 * With schema->extendable a file may begin from another: "extends: FILE", or a name that
 * schema->locate knows. What it gives itself replaces what stands there, but mappings are merged
 * key by key. Lists are replaced whole; but a mapping in the place of a list with an
 * entry_key changes the entries that it names and adds others behind them. Each value
 * keeps the place, and the directory for references, of the file it stands in. */
enum error_code yaml_read_file(const char *path, const struct yaml_schema *schema,
                               struct arena *arena, void *out, struct error *error);

/* Does the same from memory; name stands for the file in messages. */
enum error_code yaml_read_text(const char *name, const char *text, size_t size,
                               const struct yaml_schema *schema, struct arena *arena, void *out,
                               struct error *error);

/* While the store is open, files whose bytes were parsed before are not parsed again: for programs
 * that read the same files many times. What comes of them does not depend on it. A process that is
 * forked finds what its parent has read. Opened and closed by one thread that reads; to be closed
 * once for each opening, also after an error (ERROR_SYSTEM: no memory can be reserved). */
enum error_code yaml_store_open(struct error *error);
void yaml_store_close(void);

/* Reads the text of one key at the top of a file, whatever else is in it; NULL = it is missing
 * or no text. What the file extends is not looked at. The text is in the arena. */
enum error_code yaml_read_key(const char *path, const char *key, struct arena *arena,
                              const char **text, struct error *error);

/* Sets "file:line:column: …" for semantic errors found after reading; returns ERROR_INPUT. */
enum error_code yaml_error(struct error *error, const struct yaml_mark *mark, const char *format,
                           ...) __attribute__((format(printf, 3, 4)));

/* Returns where the value of a key stands, by its path from a mapping ("motors.strict"); for a key
 * that is left out the place of the mapping that lacks it. */
const struct yaml_mark *yaml_place(const struct yaml_mark *mapping, const char *path);

/* Returns whether a mapping that was read has the key of a path. */
bool yaml_has(const struct yaml_mark *mapping, const char *path);

/* Copies the values that a mapping gives from one struct of a schema to another; lists are
 * shared. */
void yaml_override(const struct yaml_schema *schema, const struct yaml_mark *mapping,
                   const void *from, void *to);

/* Names in an array of structs. */
struct yaml_names {
    const void *array;
    size_t count, stride, offset; /* offset: of the name in a struct */
};

#define YAML_NAMES(array, count, member)                                                           \
    ((struct yaml_names){(array), (count), sizeof *(array), offsetof(__typeof__(*(array)), member)})

/* Finds the index of a name that a value at mark says. The error says that what ("joint") is
 * unknown, and the nearest name or all. */
enum error_code yaml_find_name(struct yaml_names names, const char *what, const char *name,
                               const struct yaml_mark *mark, int *index, struct error *error);

/* Resolves a file reference: relative to the directory of mark->file, no absolute path, and not
 * outside the configuration tree, which is the parent of that directory. The path is in the
 * arena. */
enum error_code yaml_resolve_path(const struct yaml_mark *mark, const char *reference,
                                  struct arena *arena, const char **path, struct error *error);

#endif
