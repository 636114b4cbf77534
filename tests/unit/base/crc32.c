/* SPDX-License-Identifier: Apache-2.0 */
/* The checksum against published values, whole and in parts. */
#include "base/crc32.h"
#include "tests/test.h"

TEST(published_check_values_hold)
{
    static const char fox[] = "The quick brown fox jumps over the lazy dog";

    assert_int_equal(crc32_update(0, "", 0), 0);
    assert_int_equal(crc32_update(0, "123456789", 9), 0xcbf43926);
    assert_int_equal(crc32_update(0, fox, strlen(fox)), 0x414fa339);
}

TEST(parts_give_the_same_as_the_whole)
{
    uint8_t data[257];
    uint32_t whole;

    for (size_t i = 0; i < sizeof data; i++) {
        data[i] = (uint8_t)i;
    }
    whole = crc32_update(0, data, sizeof data);
    for (size_t cut = 0; cut <= sizeof data; cut++) {
        assert_int_equal(crc32_update(crc32_update(0, data, cut), data + cut, sizeof data - cut),
                         whole);
    }
}
