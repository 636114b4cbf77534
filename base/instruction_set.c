/* SPDX-License-Identifier: Apache-2.0 */
#include "base/instruction_set.h"

#include <string.h>

const char *const instruction_set_names[INSTRUCTION_SETS] = {
    [INSTRUCTIONS_PLAIN] = "plain",
    [INSTRUCTIONS_AVX2] = "avx2",
    [INSTRUCTIONS_AVX512] = "avx512",
};

#if defined(__x86_64__)
const char instruction_set_architecture[] = "x86_64";
#elif defined(__aarch64__)
const char instruction_set_architecture[] = "aarch64";
#else
const char instruction_set_architecture[] = "other";
#endif

static enum instruction_set held = INSTRUCTION_SETS; /* INSTRUCTION_SETS = no limit */

enum instruction_set instruction_set_with(unsigned features)
{
    const unsigned avx512 = INSTRUCTIONS_HAVE_AVX2 | INSTRUCTIONS_HAVE_AVX512F |
                            INSTRUCTIONS_HAVE_AVX512VL | INSTRUCTIONS_HAVE_AVX512DQ;

    return (features & avx512) == avx512       ? INSTRUCTIONS_AVX512
           : features & INSTRUCTIONS_HAVE_AVX2 ? INSTRUCTIONS_AVX2
                                               : INSTRUCTIONS_PLAIN;
}

enum instruction_set instruction_set_of_machine(void)
{
#if defined(__x86_64__)
    return instruction_set_with(
        (__builtin_cpu_supports("avx2") ? INSTRUCTIONS_HAVE_AVX2 : 0u) |
        (__builtin_cpu_supports("avx512f") ? INSTRUCTIONS_HAVE_AVX512F : 0u) |
        (__builtin_cpu_supports("avx512vl") ? INSTRUCTIONS_HAVE_AVX512VL : 0u) |
        (__builtin_cpu_supports("avx512dq") ? INSTRUCTIONS_HAVE_AVX512DQ : 0u));
#else
    return INSTRUCTIONS_PLAIN;
#endif
}

enum instruction_set instruction_set_used(void)
{
    return held < INSTRUCTION_SETS ? held : instruction_set_of_machine();
}

enum error_code instruction_set_hold(const char *name, struct error *error)
{
    for (enum instruction_set set = INSTRUCTIONS_PLAIN; set < INSTRUCTION_SETS; set++) {
        if (strcmp(name, instruction_set_names[set]) != 0) {
            continue;
        }
        if (set > instruction_set_of_machine()) {
            return error_set(error, ERROR_INPUT, "this machine does not have the instructions %s",
                             name);
        }
        held = set;
        return ERROR_NONE;
    }
    return error_set(error, ERROR_INPUT, "instruction set \"%s\" is none of plain, avx2 and avx512",
                     name);
}
