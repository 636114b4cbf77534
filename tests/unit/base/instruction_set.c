/* SPDX-License-Identifier: Apache-2.0 */
/* What the machine has is run, a narrower set when the process is held to it. */
#include "base/instruction_set.h"
#include "tests/test.h"

#if defined(__x86_64__)
/* Whether Linux names a feature of the processor in a line of flags. */
static bool kernel_tells(const char *flags, const char *feature)
{
    char word[32];

    snprintf(word, sizeof word, " %s ", feature);
    return strstr(flags, word) != NULL;
}

TEST(the_machine_has_what_the_kernel_says)
{
    FILE *file = fopen("/proc/cpuinfo", "re");
    char line[8192];

    assert_non_null(file);
    while (fgets(line, sizeof line, file) && strncmp(line, "flags", 5)) {
    }
    fclose(file);
    line[strcspn(line, "\n")] = ' ';
    assert_int_equal(instruction_set_of_machine(), !kernel_tells(line, "avx2") ? INSTRUCTIONS_PLAIN
                                                   : kernel_tells(line, "avx512f") &&
                                                           kernel_tells(line, "avx512vl") &&
                                                           kernel_tells(line, "avx512dq")
                                                       ? INSTRUCTIONS_AVX512
                                                       : INSTRUCTIONS_AVX2);
}
#else
TEST(the_machine_has_what_the_kernel_says)
{
    assert_int_equal(instruction_set_of_machine(), INSTRUCTIONS_PLAIN);
}
#endif

/* Of avx512 there are processors that lack some of what the kernels are compiled for. */
TEST(a_set_needs_all_of_its_features)
{
    for (unsigned features = 0; features < 16; features++) {
        assert_int_equal(instruction_set_with(features), features == 15 ? INSTRUCTIONS_AVX512
                                                         : features & INSTRUCTIONS_HAVE_AVX2
                                                             ? INSTRUCTIONS_AVX2
                                                             : INSTRUCTIONS_PLAIN);
    }
}

TEST(the_widest_is_used_when_nothing_holds_the_process)
{
    assert_int_equal(instruction_set_used(), instruction_set_of_machine());
}

TEST(the_process_is_held_to_what_the_machine_has)
{
    const enum instruction_set widest = instruction_set_of_machine();
    struct error error = {0};

    for (enum instruction_set set = INSTRUCTIONS_PLAIN; set < INSTRUCTION_SETS; set++) {
        const enum instruction_set before = instruction_set_used();
        const enum error_code code = instruction_set_hold(instruction_set_names[set], &error);

        assert_int_equal(code, set <= widest ? ERROR_NONE : ERROR_INPUT);
        assert_int_equal(instruction_set_used(), set <= widest ? set : before);
    }
    assert_ok(instruction_set_hold("plain", &error));
    assert_int_equal(instruction_set_used(), INSTRUCTIONS_PLAIN);
}

TEST(another_name_is_refused)
{
    struct error error = {0};

    assert_int_equal(instruction_set_hold("sse9", &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "\"sse9\" is none of plain, avx2 and avx512"));
}
