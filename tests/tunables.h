/* SPDX-License-Identifier: Apache-2.0 */
/* The tunables of a run, counted and found by name. */
#ifndef TESTS_TUNABLES_H
#define TESTS_TUNABLES_H

#include "rt/requests.h"

#include <string.h>

static inline size_t requests_tunables(const struct requests *requests)
{
    size_t count = 0;

    while (requests_tunable(requests, count)) {
        count++;
    }
    return count;
}

/* Returns the index of a tunable; -1 = none. */
static inline int requests_find(const struct requests *requests, const char *name)
{
    size_t count = requests_tunables(requests), i = 0;

    while (i < count && strcmp(requests_tunable(requests, i)->name, name) != 0) {
        i++;
    }
    return i < count ? (int)i : -1;
}

#endif
