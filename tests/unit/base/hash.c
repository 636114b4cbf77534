/* SPDX-License-Identifier: Apache-2.0 */
/* The hash is FNV-1a of 64 bits, as others compute it. */
#include "base/hash.h"
#include "tests/test.h"

TEST(known_texts_have_the_published_hashes)
{
    assert_true(hash_bytes(HASH_START, "", 0) == UINT64_C(0xcbf29ce484222325));
    assert_true(hash_bytes(HASH_START, "a", 1) == UINT64_C(0xaf63dc4c8601ec8c));
    assert_true(hash_bytes(HASH_START, "foobar", 6) == UINT64_C(0x85944171f73967e8));
}

TEST(pieces_hash_as_the_whole)
{
    uint64_t hash = hash_bytes(HASH_START, "foo", 3);

    assert_true(hash_bytes(hash, "bar", 3) == hash_bytes(HASH_START, "foobar", 6));
}

TEST(numbers_are_hashed_by_their_bits)
{
    const double zero = 0.0, minus_zero = -0.0;

    assert_true(hash_bytes(HASH_START, &zero, sizeof zero) !=
                hash_bytes(HASH_START, &minus_zero, sizeof minus_zero));
}
