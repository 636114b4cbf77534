/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The object dictionary of the cia402 nodes as one table: the SDO server, the PDO mapping, the EDS
 * file and the DBC read the same rows. A row is an object or, with count above 1, so many equal
 * sub-indices of one. Immutable; RT-safe but for
 * cia402_eds_write.
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
    CIA402_DOMAIN = 15, /* bytes, as many as were written */
};

/* Owner of an object, which is the structure that its field is in. */
enum cia402_scope {
    CIA402_OF_NODE, /* struct cia402_node */

    CIA402_OF_AXIS, /* struct cia402_axis; the index is that of axis 0 */
    CIA402_OF_RPDO, /* struct cia402_pdo; the index is that of number 0 */
    CIA402_OF_TPDO,
    CIA402_OF_SENSOR, /* struct cia402_sensor */
};

enum cia402_access {
    CIA402_CONST,
    CIA402_RO,
    CIA402_RW,
    CIA402_WO,
    CIA402_ACCESS_MASK = 3,
    CIA402_MAP_TPDO = 4, /* may be mapped into TPDOs */
    CIA402_MAP_RPDO = 8,
    CIA402_PLUS_NODE = 16, /* the Node-ID is added to the initial value */
};

struct cia402_node;
struct cia402_entry;

/* Writes a value within the range of its object. */
typedef enum cia402_abort cia402_write_fn(struct cia402_node *node,
                                          const struct cia402_entry *entry, int64_t value);

struct cia402_object {
    enum cia402_scope scope;
    size_t offset; /* of the int64_t, of the text, or of the struct cia402_domain, in what scope
                    * says; the next sub-index is the next int64_t */
    uint16_t index;
    uint8_t sub, count; /* sub-indices from sub on */
    enum cia402_type type;
    unsigned access;        /* enum cia402_access and its flags */
    cia402_write_fn *write; /* NULL: a value within the range goes into the field */
    const char *name;
    const char *unit; /* of a value times scale; NULL: a bare number */
    double scale;     /* 0: 1 */
    int64_t initial;  /* at the first power-up, where the board's configuration says nothing */
    int64_t min, max; /* both 0: whatever the type holds */
};

/* An object of a node: a row, which sub-index, and which axis or PDO. */
struct cia402_entry {
    const struct cia402_object *object; /* NULL: a count of sub-indices, or a dummy; see value */
    uint8_t sub, unit;
    int64_t value; /* of a count */
    enum cia402_type type;
};

/* Bytes of a text and of a domain at most. */
enum { CIA402_TEXT_MAX = 32, CIA402_DOMAIN_MAX = 1024 };

extern const struct cia402_object cia402_objects[];
extern const size_t cia402_object_count;

/* Return the bits of a type, 0 for a text or a domain; and the smallest and largest value of a
 * row. */
unsigned cia402_type_bits(enum cia402_type type);
int64_t cia402_lowest(const struct cia402_object *object);
int64_t cia402_highest(const struct cia402_object *object);

/* Returns the row of an index of axis 0 and a sub-index; NULL: none. */
const struct cia402_object *cia402_object_at(unsigned index, unsigned sub);

/* Return the kind of a board, and the fields of a PDO of its plan: those of a mapped object,
 * once where the plan has it for each axis. */
enum cia402_kind cia402_kind_of(const struct board_config *board);
const struct field *cia402_plan_fields(const struct cia402_plan *plan);

/* Writes the object dictionary of a node as an electronic data sheet (CiA 306), with the factory's
 * values that its configuration leads to, Node-ID open ($NODEID). board: one of a cia402 bus that
 * boards_create takes; name: name of the file. Memory from arena while it writes. Write errors stay
 * with out. */
enum error_code cia402_eds_write(const struct board_config *board, const char *name,
                                 struct arena *arena, FILE *out, struct error *error);

#endif
