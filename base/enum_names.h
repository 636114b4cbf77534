/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The words of an enum: one table for files, command lines and what is printed, beside the enum
 * that it is of. RT-safe.
 */
#ifndef BASE_ENUM_NAMES_H
#define BASE_ENUM_NAMES_H

#include <stddef.h>

/* A table ends with word NULL. */
struct word {
    const char *word;
    int value;
};

/* Returns the first word of a value; NULL = it has none. */
static inline const char *word_of(const struct word *table, int value)
{
    while (table->word && table->value != value) {
        table++;
    }
    return table->word;
}

#endif
