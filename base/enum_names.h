/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Names of an enum's values. One table beside the enum serves files, command lines and output.
 * RT-safe.
 */
#ifndef BASE_ENUM_NAMES_H
#define BASE_ENUM_NAMES_H

#include <stddef.h>

/* One name of a value. The last entry of a table has `word` NULL. */
struct word {
    const char *word;
    int value;
};

/* Returns the first name of a value, or NULL if the value has no name. */
static inline const char *word_of(const struct word *table, int value)
{
    while (table->word && table->value != value) {
        table++;
    }
    return table->word;
}

#endif
