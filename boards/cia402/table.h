/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The object dictionary of cia402 nodes as one table for the SDO server, the PDO mapping, the EDS
 * file and the DBC. A row is one object, or `count` equal sub-indices of one. Immutable; RT-safe
 * except cia402_eds_write.
 */
#ifndef BOARDS_CIA402_TABLE_H
#define BOARDS_CIA402_TABLE_H

#include "boards/board.h"
#include "boards/cia402/protocol.h"
#include "boards/field.h"

#include <stddef.h>
#include <stdio.h>

/* CiA 301: object codes of data types */
enum cia402_type {
    CIA402_I8 = 2,
    CIA402_I16 = 3,
    CIA402_I32 = 4,
    CIA402_U8 = 5,
    CIA402_U16 = 6,
    CIA402_U32 = 7,
    CIA402_TEXT = 9,    /* VISIBLE_STRING */
    CIA402_DOMAIN = 15, /* as many bytes as were written */
};

/* The structure that holds an object's field. */
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
    CIA402_MAP_TPDO = 4, /* may be mapped to a TPDO */
    CIA402_MAP_RPDO = 8,
    CIA402_PLUS_NODE = 16, /* the initial value includes the Node-ID */
};

struct cia402_node;
struct cia402_entry;

/* Writes a value that is within the range of its object. */
typedef enum cia402_abort cia402_write_fn(struct cia402_node *node,
                                          const struct cia402_entry *entry, int64_t value);

struct cia402_object {
    enum cia402_scope scope;
    /* offset of the int64_t, the text or the struct cia402_domain in the structure of `scope`;
     * sub-indices are consecutive int64_t */
    size_t offset;
    uint16_t index;
    uint8_t sub, count; /* first sub-index, number of sub-indices */
    enum cia402_type type;
    unsigned access;        /* enum cia402_access with flags */
    cia402_write_fn *write; /* NULL = store the value in the field */
    const char *name;
    const char *unit; /* unit of value * scale; NULL = dimensionless */
    double scale;     /* 0 means 1 */
    int64_t initial;  /* at the first power-up, unless the configuration sets it */
    int64_t min, max; /* min > max = any value of the type */
};

/* An object of a node: its row, sub-index, and axis or PDO. */
struct cia402_entry {
    const struct cia402_object *object; /* NULL = a number of sub-indices, or a dummy; see value */
    uint8_t sub, unit;
    int64_t value; /* the number of sub-indices */
    enum cia402_type type;
};

/* Most bytes of a text and of a domain. */
enum { CIA402_TEXT_MAX = 32, CIA402_DOMAIN_MAX = 1024 };

extern const struct cia402_object cia402_objects[];
extern const size_t cia402_object_count;

/* Return the bits of a type (0 for a text or a domain), and the smallest and largest value of a
 * row. */
unsigned cia402_type_bits(enum cia402_type type);
int64_t cia402_lowest(const struct cia402_object *object);
int64_t cia402_highest(const struct cia402_object *object);

/* Returns the row of an index of axis 0 and a sub-index; NULL = none. */
const struct cia402_object *cia402_object_at(unsigned index, unsigned sub);

/* Return the kind of a board, and the fields of a PDO in its plan. If a plan has an object for each
 * axis, its field appears once. */
enum cia402_kind cia402_kind_of(const struct board_config *board);
const struct field *cia402_plan_fields(const struct cia402_plan *plan);

/* Writes the object dictionary of a node as an electronic data sheet (CiA 306) with factory values
 * for its configuration and an open Node-ID ($NODEID). board: a valid board of a cia402 bus; name:
 * file name. Temporary memory from arena. Write errors stay in `out`. */
enum error_code cia402_eds_write(const struct board_config *board, const char *name,
                                 struct arena *arena, FILE *out, struct error *error);

#endif
