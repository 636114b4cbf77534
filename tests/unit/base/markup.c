/* SPDX-License-Identifier: Apache-2.0 */
/* Text inside markup: entities, white space, control characters, encodings. */
#include "base/markup.h"

#include "base/array.h"
#include "tests/test.h"

static void assert_markup(const char *text, unsigned flags, const char *expected)
{
    char *out;
    size_t size;
    FILE *file = open_memstream(&out, &size);

    assert_non_null(file);
    markup_put_flags(file, text, flags);
    assert_int_equal(fclose(file), 0);
    assert_string_equal(out, expected);
    free(out);
}

TEST(characters_of_markup_become_entities)
{
    assert_markup("a<b>&\"c'", 0, "a&lt;b&gt;&amp;&quot;c'");
    assert_markup("", 0, "");
    assert_markup(NULL, MARKUP_ASCII | MARKUP_LINE_BREAKS, "");
}

TEST(white_space_becomes_a_space_unless_line_breaks_are_kept)
{
    assert_markup("a\nb\tc\rd", 0, "a b c d");
    assert_markup("a\nb\tc\rd", MARKUP_LINE_BREAKS, "a&#10;b c d");
}

TEST(control_characters_become_question_marks)
{
    assert_markup("a\x01\x1b[1m\x7f", 0, "a??[1m?");
    assert_markup("\x08", MARKUP_ASCII, "?");
}

TEST(characters_beyond_ascii_pass_unless_ascii_is_wanted)
{
    static const char *const valid[] = {
        "\xc2\x80",         /* U+0080, the first of two bytes */
        "\xdf\xbf",         /* U+07FF */
        "\xe0\xa0\x80",     /* U+0800, the first of three */
        "\xed\x9f\xbf",     /* U+D7FF, before the surrogates */
        "\xee\x80\x80",     /* U+E000, behind them */
        "\xef\xbf\xbd",     /* U+FFFD */
        "\xf0\x90\x80\x80", /* U+10000, the first of four */
        "\xf4\x8f\xbf\xbf", /* U+10FFFF, the last */
    };

    for (size_t i = 0; i < ARRAY_COUNT(valid); i++) {
        assert_markup(valid[i], 0, valid[i]);
    }
    assert_markup("5 \xc2\xb5m", MARKUP_ASCII, "5 ??m");
}

TEST(bytes_that_are_no_utf8_become_question_marks)
{
    static const struct {
        const char *text, *expected;
    } cases[] = {
        {"\x80x", "?x"},              /* a continuation without a beginning */
        {"\xc3", "?"},                /* a beginning at the end */
        {"\xc3<", "?&lt;"},           /* a beginning before something else */
        {"\xe2\x82", "??"},           /* cut off */
        {"\xc0\xaf", "??"},           /* overlong */
        {"\xe0\x9f\xbf", "???"},      /* overlong */
        {"\xf0\x8f\xbf\xbf", "????"}, /* overlong */
        {"\xed\xa0\x80", "???"},      /* a surrogate */
        {"\xef\xbf\xbe", "???"},      /* U+FFFE, which XML cannot hold */
        {"\xef\xbf\xbf", "???"},      /* U+FFFF */
        {"\xf4\x90\x80\x80", "????"}, /* beyond Unicode */
        {"\xf8\x88\x80\x80", "????"}, /* five bytes */
        {"\xff\xfe", "??"},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        assert_markup(cases[i].text, 0, cases[i].expected);
    }
}
