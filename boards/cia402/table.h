/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The object dictionary of cia402 nodes. The SDO server, the PDO mapping, the EDS file and the DBC
 * use this one table. A row is one object, or `count` sub-indices of equal meaning. Immutable;
 * RT-safe except cia402_eds_write.
 */
#ifndef BOARDS_CIA402_TABLE_H
#define BOARDS_CIA402_TABLE_H

#include "boards/board.h"
#include "boards/cia402/protocol.h"
#include "boards/field.h"

#include <stdio.h>

/* Data types, by their index in CiA 301. */
enum cia402_type {
    CIA402_I8 = 2,
    CIA402_I16 = 3,
    CIA402_I32 = 4,
    CIA402_U8 = 5,
    CIA402_U16 = 6,
    CIA402_U32 = 7,
    CIA402_TEXT = 9,    /* VISIBLE_STRING */
    CIA402_DOMAIN = 15, /* any number of bytes */
};

/* The structure that contains an object's field. */
enum cia402_scope {
    CIA402_OF_NODE, /* struct cia402_node */

    CIA402_OF_AXIS, /* struct cia402_axis; the index is for axis 0 */
    CIA402_OF_RPDO, /* struct cia402_pdo; the index is for PDO 0 */
    CIA402_OF_TPDO,
    CIA402_OF_SENSOR, /* struct cia402_sensor */
};

enum cia402_access {
    CIA402_CONST,
    CIA402_RO,
    CIA402_RW,
    CIA402_WO,
    CIA402_ACCESS_MASK = 3,
    CIA402_MAP_TPDO = 4, /* the object may be mapped to a TPDO */
    CIA402_MAP_RPDO = 8,
    CIA402_PLUS_NODE = 16, /* the Node-ID is added to the initial value */
};

struct cia402_node;
struct cia402_entry;

/* Writes an object. The caller has checked that value is within the object's range. */
typedef enum cia402_abort cia402_write_fn(struct cia402_node *node,
                                          const struct cia402_entry *entry, int64_t value);

struct cia402_object {
    enum cia402_scope scope;
    /* offset of the value in the structure of `scope`: an int64_t, a text or a struct
     * cia402_domain; sub-indices are consecutive int64_t */
    size_t offset;
    uint16_t index;
    uint8_t sub, count; /* first sub-index, number of sub-indices */
    enum cia402_type type;
    unsigned access;        /* enum cia402_access with flags */
    cia402_write_fn *write; /* NULL = store the value in the field */
    const char *name;
    const char *unit; /* unit of value * scale; NULL = dimensionless */
    double scale;     /* 0 means 1 */
    int64_t initial;  /* value at the first power-up, unless the configuration sets one */
    int64_t min, max; /* min > max = any value of the type */
};

/* An object of a node. */
struct cia402_entry {
    const struct cia402_object *object; /* row; NULL = a number of sub-indices or a dummy */
    uint8_t sub, unit;                  /* unit: number of the axis or PDO, from 0 */
    int64_t value;                      /* if object is NULL: the number of sub-indices */
    enum cia402_type type;
};

/* Longest text and longest domain, bytes. */
enum { CIA402_TEXT_MAX = 32, CIA402_DOMAIN_MAX = 1024 };

extern const struct cia402_object cia402_objects[];
extern const size_t cia402_object_count;

/* Return the number of bits of a type (0 for a text or a domain), and the smallest and the largest
 * value of a row. */
unsigned cia402_type_bits(enum cia402_type type);
int64_t cia402_lowest(const struct cia402_object *object);
int64_t cia402_highest(const struct cia402_object *object);

/* Returns the row of an object; index: for axis 0. NULL = none. */
const struct cia402_object *cia402_object_at(unsigned index, unsigned sub);

/* Returns the kind of a board's node. */
enum cia402_kind cia402_kind_of(const struct board_config *board);

/* Returns the fields of a plan's frame. A plan with one object per axis has one field, which the
 * frame repeats. */
const struct field *cia402_plan_fields(const struct cia402_plan *plan);

/* Writes the object dictionary of a node as an electronic data sheet (CiA 306): factory values for
 * its configuration, Node-ID left open ($NODEID). board: a valid board of a cia402 bus; name: file
 * name. Temporary memory from arena. Write errors stay in `out`. */
enum error_code cia402_eds_write(const struct board_config *board, const char *name,
                                 struct arena *arena, FILE *out, struct error *error);

#endif
