/* SPDX-License-Identifier: Apache-2.0 */
/* Numbers and names as people write them, right and wrong. */
#include "base/text.h"

#include "base/array.h"
#include "tests/test.h"

#include <float.h>

TEST(reads_finite_decimal_numbers)
{
    static const struct {
        const char *text;
        double value;
    } cases[] = {{"0", 0.0},         {"-1.5", -1.5},   {"+2", 2.0},
                 {".5", 0.5},        {"5.", 5.0},      {"1e3", 1000.0},
                 {"2.5E-3", 2.5e-3}, {"010", 10.0},    {"-0", -0.0},
                 {"1e-400", 0.0},    {"1e308", 1e308}, {"1.7976931348623157e308", DBL_MAX}};

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        double value = 99.0;

        if (!text_to_double(cases[i].text, &value) || value != cases[i].value) {
            fail_msg("\"%s\" was read as %g", cases[i].text, value);
        }
    }
}

TEST(refuses_what_is_no_finite_decimal_number)
{
    static const char *const cases[] = {"",      " 1",     "1 ",   "1,5",     "abc",   "1e",
                                        "e5",    "--1",    "0x10", "inf",     "-inf",  "nan",
                                        "1e999", "-1e999", ".",    "+",       "1.2.3", "1\n",
                                        "1e5.5", "1_000",  "1f",   "infinity"};

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        double value = 99.0;

        if (text_to_double(cases[i], &value) || value != 99.0) {
            fail_msg("\"%s\" was read as %g", cases[i], value);
        }
    }
}

TEST(reads_integers_in_decimal_and_hexadecimal_within_limits)
{
    static const struct {
        const char *text;
        int64_t value;
    } cases[] = {{"0", 0},
                 {"-7", -7},
                 {"+7", 7},
                 {"0x0D", 13},
                 {"-0x10", -16},
                 {"0XfF", 255},
                 {"9223372036854775807", INT64_MAX},
                 {"-9223372036854775808", INT64_MIN}};

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        int64_t value = 99;

        if (!text_to_int(cases[i].text, INT64_MIN, INT64_MAX, &value) || value != cases[i].value) {
            fail_msg("\"%s\" was read as %lld", cases[i].text, (long long)value);
        }
    }
}

TEST(refuses_what_is_no_integer_within_limits)
{
    static const char *const cases[] = {"",
                                        " 1",
                                        "1 ",
                                        "1.0",
                                        "1e3",
                                        "0x",
                                        "x10",
                                        "11",
                                        "-1",
                                        "-",
                                        "+",
                                        "0xg",
                                        "9223372036854775808",
                                        "1-",
                                        "--1",
                                        "0x-1"};

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        int64_t value = 99;

        if (text_to_int(cases[i], 0, 10, &value) || value != 99) {
            fail_msg("\"%s\" was read as %lld", cases[i], (long long)value);
        }
    }
}

TEST(names_the_nearest_word)
{
    static const char *const words[] = {"mass_kg", "com_m", "inertia_kg_m2", "parent"};

    assert_string_equal(text_nearest("mas_kg", words, ARRAY_COUNT(words)), "mass_kg");
    assert_string_equal(text_nearest("Mass_Kg", words, ARRAY_COUNT(words)), "mass_kg");
    assert_string_equal(text_nearest("com", words, ARRAY_COUNT(words)), "com_m");
    assert_string_equal(text_nearest("inertia_kg_m", words, ARRAY_COUNT(words)), "inertia_kg_m2");
    assert_string_equal(text_nearest("parent", words, ARRAY_COUNT(words)), "parent");
}

TEST(two_letters_swapped_are_one_mistake)
{
    static const char *const words[] = {"--ticks", "--tasks-of", "--task", "--talk"};

    assert_string_equal(text_nearest("--taks", words, ARRAY_COUNT(words)), "--task");
    assert_string_equal(text_nearest("--tikcs", words, ARRAY_COUNT(words)), "--ticks");
    assert_string_equal(text_nearest("-t-ask", words, ARRAY_COUNT(words)), "--task");
}

TEST(names_no_word_when_none_is_near)
{
    static const char *const words[] = {"mass_kg", "com_m"};
    char longest[200];

    memset(longest, 'x', sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    assert_null(text_nearest("voltage", words, ARRAY_COUNT(words)));
    assert_null(text_nearest(longest, words, ARRAY_COUNT(words)));
    assert_null(text_nearest("mass_kg", words, 0));
    /* A begin of three letters and more is near, an edit nearer */
    const char *const joints[] = {"LHipSag", "LKneeSag", "RKneeSag", "LKneec"};
    assert_string_equal(text_nearest("RKnee", joints, 3), "RKneeSag");
    assert_string_equal(text_nearest("LKnee", joints, 3), "LKneeSag");
    assert_string_equal(text_nearest("LKnee", joints, 4), "LKneec");
    assert_null(text_nearest("LK", joints, 3));
}

TEST(passes_over_words_that_are_too_long_to_compare)
{
    char longest[200];
    const char *words[] = {longest, "mass_kg"};

    memset(longest, 'm', sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    assert_string_equal(text_nearest("mass_k", words, ARRAY_COUNT(words)), "mass_kg");
}

TEST(a_name_is_safe_in_messages_and_file_names)
{
    static const char *const good[] = {"can0", "left_leg", "a", "...", "L-1.b"};
    static const char *const bad[] = {
        "",     ".",
        "..",   "a/b",
        "../x", "a b",
        "a\n",  "\xc3\xa4",
        "a:b",  "0123456789012345678901234567890123456789012345678901234567890123"};

    for (size_t i = 0; i < ARRAY_COUNT(good); i++) {
        if (!text_is_name(good[i])) {
            fail_msg("refused \"%s\"", good[i]);
        }
    }
    for (size_t i = 0; i < ARRAY_COUNT(bad); i++) {
        if (text_is_name(bad[i])) {
            fail_msg("took \"%s\"", bad[i]);
        }
    }
}

TEST(utf8_characters_have_one_to_four_bytes)
{
    static const struct {
        const char *text;
        size_t size, length;
    } cases[] = {
        {"a", 1, 1},
        {"a", 0, 0},
        {"\xc3\xa4", 2, 2},
        {"\xc3\xa4", 1, 0}, /* cut off */
        {"\xe2\x82\xac!", 4, 3},
        {"\xf0\x9f\xa4\x96", 4, 4},
        {"\xf0\x9f\xa4\x96", 3, 0},
        {"\xa4", 1, 0},             /* a continuation */
        {"\xc0\x80", 2, 0},         /* overlong */
        {"\xed\xa0\x80", 3, 0},     /* a surrogate */
        {"\xf4\x90\x80\x80", 4, 0}, /* beyond Unicode */
        {"\xff", 1, 0},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        assert_int_equal(text_utf8_length(cases[i].text, cases[i].size), cases[i].length);
    }
}

TEST(nothing_is_left_that_a_terminal_may_obey)
{
    static const struct {
        const char *text, *printable;
    } cases[] = {
        {"plain, \t ~", "plain, \t ~"},
        {"\x1b[31mred\x1b[0m", "?[31mred?[0m"},
        {"a\nb\rc\x07\x7f", "a?b?c??"},
        {"\xc2\x9b"
         "31m",
         "??31m"}, /* CSI as one character of UTF-8 */
        {"\x9b"
         "31m",
         "?31m"}, /* and as one byte */
        {"gr\xc3\xbc\xc3\x9f \xe2\x82\xac \xc2\xa0", "gr\xc3\xbc\xc3\x9f \xe2\x82\xac \xc2\xa0"},
        {"cut \xe2\x82", "cut ??"},
        {"", ""},
    };

    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char text[64];

        snprintf(text, sizeof text, "%s", cases[i].text);
        text_make_printable(text);
        assert_string_equal(text, cases[i].printable);
    }
}

TEST(find_compares_a_member_of_structs_or_a_list_and_skips_null)
{
    const struct {
        int number;
        const char *name;
    } rows[] = {{1, NULL}, {2, "knee"}, {3, "hip"}, {4, "knee"}};
    const char *const list[] = {"x", "y"};

    assert_int_equal(TEXT_FIND(rows, 4, name, "knee"), 1);
    assert_int_equal(TEXT_FIND(rows, 2, name, "hip"), -1);
    assert_int_equal(TEXT_INDEX(list, 2, "y"), 1);
    assert_int_equal(text_find(NULL, 0, 8, 0, "y"), -1);
}
