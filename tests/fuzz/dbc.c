/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The DBC reader under mutation: whatever the bytes, it either refuses them with a line and column
 * inside the text or yields a database whose text reads back the same. Deterministic.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "canbus/dbc.h"
#include "canbus/dbc_private.h"

#include <stdlib.h>
#include <string.h>

enum { ROUNDS = 20000, TEXT_MAX = 8192, ARENA_BYTES = 1 << 20 };

static uint64_t random_state = 42;

static uint32_t random_below(uint32_t limit)
{
    random_state = random_state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(random_state >> 33) % limit;
}

static const char body[] =
    "BS_:\nBU_: host a b\n"
    "BO_ 257 CMD: 8 host\n"
    " SG_ command M : 0|8@1+ (1,0) [0|255] \"\" a\n"
    " SG_ pwm_0 m114 : 8|16@1- (0.075,0) [-100|100] \"%\" a,b\n"
    " SG_ pwm_1 m242 : 15|16@0- (1e-05,-2.5) [0|0] \"rad\" a\n"
    "BO_ 1025 WIDE: 64 Vector__XXX\n"
    " SG_ f : 480|32@1- (1,0) [0|0] \"\" Vector__XXX\n"
    "CM_ \"bus\";\nCM_ BU_ a \"board\";\nCM_ BO_ 257 \"m\";\nCM_ SG_ 1025 f \"s\";\n";
static const char tail[] =
    "BA_ \"DBName\" \"x\";\nBA_ \"BusType\" \"CAN FD\";\nBA_ \"Baudrate\" 1000000;\n"
    "BA_ \"BaudrateCANFD\" 8000000;\nBA_ \"GenMsgCycleTime\" BO_ 257 4;\n"
    "BA_ \"VFrameFormat\" BO_ 1025 14;\nBA_ \"FrameLength\" SG_ 257 pwm_0 3;\n"
    "VAL_ 257 command 114 \"SET_0\" 242 \"SET_1\" ;\nSIG_VALTYPE_ 1025 f : 1;\n";

static size_t make_seed(char text[TEXT_MAX])
{
    size_t size = (size_t)snprintf(text, TEXT_MAX, "VERSION \"\"\nNS_ :\n");

    for (size_t i = 0; i < DBC_SYMBOLS; i++) {
        size += (size_t)snprintf(text + size, TEXT_MAX - size, "%s\n", dbc_symbols[i]);
    }
    return size +
           (size_t)snprintf(text + size, TEXT_MAX - size, "%s%s%s", body, dbc_definitions, tail);
}

/* A few small changes, mostly of what is not fixed: a byte replaced, removed, inserted, a piece moved
 * elsewhere, or the end cut off. */
static size_t mutate(char *text, size_t size, size_t fixed)
{
    static const char spice[] = "0123456789abMm_:;|@+-(),[]\"eE. \n\t\r\x01\xff";

    for (uint32_t n = 1 + random_below(3); n > 0 && size > fixed; n--) {
        const size_t from = random_below(8) ? fixed : 0;
        const size_t at = from + random_below((uint32_t)(size - from));
        const size_t other = from + random_below((uint32_t)(size - from));
        const size_t most = size - (at > other ? at : other);
        const char byte = spice[random_below(sizeof spice - 1)];

        switch (random_below(12)) {
        case 0:
        case 1:
        case 2:
        case 3:
            text[at] = byte;
            break;
        case 4:
        case 5:
        case 6:
            memmove(text + at, text + at + 1, --size - at);
            break;
        case 7:
        case 8:
        case 9:
            if (size < TEXT_MAX) {
                memmove(text + at + 1, text + at, size++ - at);
                text[at] = byte;
            }
            break;
        case 10:
            memmove(text + at, text + other, random_below((uint32_t)(most < 30 ? most : 30)));
            break;
        default:
            size = random_below(4) ? size : at;
        }
    }
    return size;
}

static size_t write_again(const struct dbc *dbc, char text[TEXT_MAX])
{
    FILE *file = fmemopen(text, TEXT_MAX, "w");
    struct error error;
    long size;

    assert_non_null(file);
    assert_int_equal(dbc_write(dbc, file, &error), ERROR_NONE);
    size = ftell(file);
    fclose(file);
    assert_in_range(size, 1, TEXT_MAX - 1);
    return (size_t)size;
}

/* An arena that is used again and again. */
static void empty(struct arena *arena)
{
    memset(arena->memory, 0, arena->used);
    arena->used = 0;
}

static void mutated_files_are_refused_or_read_back_the_same(void **state)
{
    static char seed[TEXT_MAX], text[TEXT_MAX], first[TEXT_MAX], second[TEXT_MAX];
    const size_t seed_size = make_seed(seed);
    const size_t fixed = (size_t)(strstr(seed, "BS_:") - seed);
    unsigned accepted = 0, refused = 0;
    struct arena arena;
    struct error error;
    struct dbc *dbc;

    (void)state;
    assert_int_equal(arena_init(&arena, ARENA_BYTES, &error), ERROR_NONE);
    if (dbc_read("x", seed, seed_size, &arena, &dbc, &error)) {
        fail_msg("%s", error.text);
    }
    for (int round = 0; round < ROUNDS; round++) {
        unsigned line, column;
        size_t size;
        char *exact;

        memcpy(text, seed, seed_size);
        size = mutate(text, seed_size, fixed);
        /* a block of just this size, so that a sanitizer sees a read beyond the end */
        exact = malloc(size ? size : 1);
        assert_non_null(exact);
        memcpy(exact, text, size);
        empty(&arena);
        if (dbc_read("x", exact, size, &arena, &dbc, &error)) {
            assert_int_equal(error.code, ERROR_INPUT);
            assert_int_equal(sscanf(error.text, "x:%u:%u: found", &line, &column), 2);
            assert_in_range(line, 1, 200);
            assert_in_range(column, 1, size + 1);
            refused++;
        } else {
            size_t first_size = write_again(dbc, first), second_size;

            if (dbc_read("x", first, first_size, &arena, &dbc, &error)) {
                fail_msg("%s", error.text);
            }
            second_size = write_again(dbc, second);
            assert_int_equal(first_size, second_size);
            assert_memory_equal(first, second, first_size);
            accepted++;
        }
        free(exact);
    }
    arena_fini(&arena);
    /* both ways were walked */
    assert_true(accepted > ROUNDS / 100);
    assert_true(refused > ROUNDS / 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(mutated_files_are_refused_or_read_back_the_same),
    };

    return cmocka_run_group_tests_name("fuzz/dbc", tests, NULL, NULL);
}
