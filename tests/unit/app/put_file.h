/* SPDX-License-Identifier: Apache-2.0 */
/* Files that tests write. */
#ifndef TESTS_UNIT_APP_PUT_FILE_H
#define TESTS_UNIT_APP_PUT_FILE_H

#include "tests/test.h"

/* Writes a text into a file. */
static inline void put_file(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");

    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

#endif
