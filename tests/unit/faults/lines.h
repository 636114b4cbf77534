/* SPDX-License-Identifier: Apache-2.0 */
/* Lines of faults that have to be right, about the small rig of names.h. */
#ifndef TESTS_UNIT_FAULTS_LINES_H
#define TESTS_UNIT_FAULTS_LINES_H

#include "tests/unit/faults/names.h"
#include "tests/test.h"

#define SECOND INT64_C(1000000000)

static inline struct fault parse(const char *text)
{
    struct fault fault;
    struct error error;

    assert_no_error(fault_parse(text, &names, &fault, &error), error.text);
    return fault;
}

#endif
