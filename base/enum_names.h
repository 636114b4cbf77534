/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The names of an enum's values: one table, beside the enum, for files, command lines and output.
 * RT-safe.
 */
#ifndef BASE_ENUM_NAMES_H
#define BASE_ENUM_NAMES_H

#include <stddef.h>

/* A table ends with word NULL. */
struct word {
    const char *word;
    int value;
};

/* Returns the first name of a value; NULL = none. */
static inline const char *word_of(const struct word *table, int value)
{
    while (table->word && table->value != value) {
        table++;
    }
    return table->word;
}

#endif
