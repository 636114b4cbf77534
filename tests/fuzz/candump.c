/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The candump parser under mutation: whatever the bytes, it either refuses them with a column inside
 * the line or yields a legal frame whose text means the same frame again. Deterministic.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "canbus/candump.h"

#include <stdlib.h>
#include <string.h>

enum { ROUNDS = 400000 };

static uint64_t random_state = 42;

static uint32_t random_below(uint32_t limit)
{
    random_state = random_state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(random_state >> 33) % limit;
}

/* One to four small changes: a byte replaced, removed, inserted, doubled, or the end cut off. */
static size_t mutate(char *line, size_t size, size_t capacity)
{
    static const char spice[] = "0123456789ABCDEFabcdefRr#(). \n\r\tx\0\xFF";

    for (uint32_t n = 1 + random_below(4); n > 0 && size > 0; n--) {
        const size_t at = random_below((uint32_t)size);
        const char byte = spice[random_below(sizeof spice - 1)];

        switch (random_below(5)) {
        case 0:
            line[at] = byte;
            break;
        case 1:
            memmove(line + at, line + at + 1, --size - at);
            break;
        case 2:
        case 3:
            if (size < capacity) {
                memmove(line + at + 1, line + at, size++ - at);
                line[at] = random_below(2) ? byte : line[at];
            }
            break;
        default:
            size = at;
        }
    }
    return size;
}

static void mutated_lines_are_refused_or_mean_a_legal_frame(void **state)
{
    static const char *const seeds[] = {
        "(1436509052.249713) vcan0 123#DEADBEEF\n",
        "(0000000000.000001) can0 1ABCDEF0#1122334455667788\n",
        "(0000000000.000000) can0 7FF#R8\n",
        "(0000000000.000000) can0 20000004#0004000000000000\n",
        "(0000000000.000000) can0 123##3000102030405060708090A0B\n",
        "(9223372035.999999) fifteen-letters 001##000\n",
    };
    unsigned accepted = 0, refused = 0;

    (void)state;
    for (int round = 0; round < ROUNDS; round++) {
        const char *seed = seeds[random_below(sizeof seeds / sizeof *seeds)];
        char line[256], text[CANDUMP_LINE_MAX], bus[16], bus_again[16];
        struct bus_frame frame, again;
        struct error error;
        unsigned column;
        size_t size = strlen(seed);
        char *exact;

        memcpy(line, seed, size);
        size = mutate(line, size, sizeof line);
        /* a block of just this size, so that a sanitizer sees a read beyond the end */
        exact = malloc(size ? size : 1);
        memcpy(exact, line, size);
        if (candump_parse(exact, size, &frame, bus, &error)) {
            assert_int_equal(sscanf(error.text, "column %u: found", &column), 1);
            assert_in_range(column, 1, size + 1);
            refused++;
        } else {
            assert_true(frame_valid(&frame));
            assert_true(bus[0] && strlen(bus) <= 15);
            size = candump_format(&frame, bus, text);
            assert_int_equal(candump_parse(text, size, &again, bus_again, &error), ERROR_NONE);
            assert_memory_equal(&frame, &again, sizeof frame);
            assert_string_equal(bus, bus_again);
            accepted++;
        }
        free(exact);
    }
    /* both ways were walked */
    assert_true(accepted > ROUNDS / 100);
    assert_true(refused > ROUNDS / 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(mutated_lines_are_refused_or_mean_a_legal_frame),
    };

    return cmocka_run_group_tests_name("fuzz/candump", tests, NULL, NULL);
}
