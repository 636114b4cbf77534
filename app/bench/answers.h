/* SPDX-License-Identifier: Apache-2.0 */
#ifndef APP_BENCH_ANSWERS_H
#define APP_BENCH_ANSWERS_H

#include "base/error.h"

#include <stddef.h>

/* Measures and prints the latency of `count` answers of each protocol, with simulators that it
 * starts by the file `program`. Not RT-safe. */
enum error_code bench_answers(const char *program, size_t count, struct error *error);

#endif
