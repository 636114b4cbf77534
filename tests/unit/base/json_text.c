/* SPDX-License-Identifier: Apache-2.0 */
/* Text as strings of JSON. */
#include "base/json_text.h"
#include "tests/test.h"

TEST(text_is_quoted_so_that_any_reader_takes_it)
{
    static const struct variant {
        const char *text, *json;
    } variants[] = {
        {"", "\"\""},
        {"plain", "\"plain\""},
        {"a \"b\" \\c", "\"a \\\"b\\\" \\\\c\""},
        {"line\nbell\a", "\"line\\u000abell\\u0007\""},
        {"\xc3\xa9 \xe2\x82\xac", "\"\xc3\xa9 \xe2\x82\xac\""},
        {"\xff\xc3", "\"\?\?\""},
        /* The last control character, the first that is none, and the one that may stay */
        {"\x1f \x7f", "\"\\u001f \x7f\""},
        {"\x01/", "\"\\u0001/\""},
        /* Characters of two, three and four bytes, and beginnings of such */
        {"\xf0\x9f\xa4\x96", "\"\xf0\x9f\xa4\x96\""},
        {"\xf0\x9f\xa4", "\"\?\?\?\""},
        {"\xe2\x82\"", "\"\?\?\\\"\""},
    };

    for (size_t i = 0; i < sizeof variants / sizeof variants[0]; i++) {
        char text[JSON_TEXT_ROOM(64)], *written = NULL;
        size_t size = 0;
        FILE *out = open_memstream(&written, &size);

        assert_int_equal(json_text_quote(variants[i].text, text), strlen(variants[i].json));
        assert_string_equal(text, variants[i].json);
        json_text_put(variants[i].text, out);
        fclose(out);
        assert_string_equal(written, variants[i].json);
        free(written);
    }
}

TEST(the_longest_result_fits_into_its_room)
{
    char text[101], json[JSON_TEXT_ROOM(100)];

    memset(text, 1, 100);
    text[100] = '\0';
    assert_int_equal(json_text_quote(text, json), JSON_TEXT_ROOM(100) - 1);
}
