/* SPDX-License-Identifier: Apache-2.0 */
/* A DBC database is checked as it grows, and reads back out of its text as it was. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "canbus/dbc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

struct bench {
    struct arena arena;
    struct dbc *dbc;
    struct dbc_message *message;
    struct error error;
};

static int start(void **state)
{
    struct bench *b = calloc(1, sizeof *b);
    const struct dbc_message message = {.name = "TELEMETRY", .id = 0x123, .length = 8, .sender = 1};

    assert_non_null(b);
    assert_int_equal(arena_init(&b->arena, (size_t)64 << 20, &b->error), ERROR_NONE);
    b->dbc = dbc_create(&b->arena, "bench");
    assert_non_null(b->dbc);
    assert_int_equal(dbc_add_node(b->dbc, "host", &b->error), ERROR_NONE);
    assert_int_equal(dbc_add_node(b->dbc, "board", &b->error), ERROR_NONE);
    assert_int_equal(dbc_add_message(b->dbc, &message, &b->message, &b->error), ERROR_NONE);
    *state = b;
    return 0;
}

static int stop(void **state)
{
    struct bench *b = *state;

    arena_fini(&b->arena);
    free(b);
    return 0;
}

static struct dbc_signal plain(const char *name, unsigned first, unsigned bits)
{
    return (struct dbc_signal){.name = name,
                               .start = (uint16_t)first,
                               .bits = (uint8_t)bits,
                               .scale = 1.0,
                               .unit = "",
                               .receivers = 1};
}

static enum error_code add(struct bench *b, struct dbc_signal signal)
{
    struct dbc_signal *added;

    return dbc_add_signal(b->dbc, b->message, &signal, &added, &b->error);
}

static void names_are_identifiers_of_32_letters_that_mean_nothing_else(void **state)
{
    static const char *const good[] = {"a", "_9", "SET_OPEN_LOOP_pwm_0",
                                       "abcdefghijklmnopqrstuvwxyz_78901"};
    static const char *const bad[] = {
        "",    "9a",     "a b", "a-b",  "abcdefghijklmnopqrstuvwxyz_789012",
        "BO_", "SG_",    "CM_", "\xe9", "Vector__XXX",
        "BU_", "VERSION"};

    (void)state;
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        assert_true(dbc_is_name(good[i]));
    }
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_false(dbc_is_name(bad[i]));
    }
}

static void signals_stay_within_the_frame_and_off_each_other(void **state)
{
    struct bench *b = *state;
    struct dbc_signal big = plain("big", 23, 16); /* bytes 2 and 3 */

    big.big_endian = true;
    assert_int_equal(add(b, plain("first", 0, 16)), ERROR_NONE);
    assert_int_equal(add(b, big), ERROR_NONE);
    assert_int_equal(add(b, plain("over", 15, 2)), ERROR_INPUT);
    assert_non_null(strstr(b->error.text, "than first in TELEMETRY"));
    assert_int_equal(add(b, plain("over", 24, 1)), ERROR_INPUT);
    assert_non_null(strstr(b->error.text, "than big in TELEMETRY"));
    assert_int_equal(add(b, plain("first", 40, 1)), ERROR_INPUT);
    assert_int_equal(add(b, plain("last", 32, 33)), ERROR_INPUT);
    assert_int_equal(add(b, plain("none", 40, 0)), ERROR_INPUT);
    big = plain("big_last", 63, 9); /* would need byte 8 */
    big.big_endian = true;
    assert_int_equal(add(b, big), ERROR_INPUT);
    assert_int_equal(add(b, plain("last", 32, 32)), ERROR_NONE);
    assert_int_equal(b->message->nsignal, 3);
}

static void multiplexed_signals_share_bits_only_with_other_selectors(void **state)
{
    struct bench *b = *state;
    struct dbc_signal selector = plain("command", 0, 8), a = plain("a", 8, 16),
                      c = plain("c", 8, 16), d = plain("d", 16, 8), late = plain("late", 32, 8);

    a.role = c.role = d.role = DBC_MULTIPLEXED;
    a.selector = d.selector = 0x72;
    c.selector = 0xf2;
    assert_int_equal(add(b, a), ERROR_INPUT); /* no multiplexor yet */
    selector.role = DBC_MULTIPLEXOR;
    assert_int_equal(add(b, selector), ERROR_NONE);
    late.role = DBC_MULTIPLEXOR;
    assert_int_equal(add(b, late), ERROR_INPUT);
    assert_int_equal(add(b, a), ERROR_NONE);
    assert_int_equal(add(b, c), ERROR_NONE);
    assert_int_equal(add(b, d), ERROR_INPUT);
    c.selector = 256;
    c.name = "e";
    assert_int_equal(add(b, c), ERROR_INPUT); /* more than 8 bits hold */
}

static void numbers_are_finite_and_values_fit(void **state)
{
    struct bench *b = *state;
    struct dbc_signal s = plain("s", 0, 8), *added;

    s.scale = 0.0;
    assert_int_equal(add(b, s), ERROR_INPUT);
    s.scale = NAN;
    assert_int_equal(add(b, s), ERROR_INPUT);
    s.scale = 1.0;
    s.min = 1.0;
    assert_int_equal(add(b, s), ERROR_INPUT);
    s.min = 0.0;
    s.type = DBC_FLOAT;
    assert_int_equal(add(b, s), ERROR_INPUT);
    s.type = DBC_SIGNED;
    assert_int_equal(dbc_add_signal(b->dbc, b->message, &s, &added, &b->error), ERROR_NONE);
    assert_int_equal(dbc_add_value(b->dbc, added, -128, "low", &b->error), ERROR_NONE);
    assert_int_equal(dbc_add_value(b->dbc, added, -128, "again", &b->error), ERROR_INPUT);
    assert_int_equal(dbc_add_value(b->dbc, added, 128, "high", &b->error), ERROR_INPUT);
    assert_int_equal(dbc_add_value(b->dbc, added, 1, "quo\"te", &b->error), ERROR_INPUT);
}

static void messages_have_their_own_name_identifier_and_a_legal_length(void **state)
{
    struct bench *b = *state;
    struct dbc_message m = {.name = "TELEMETRY", .id = 1}, *added;

    assert_int_equal(dbc_add_message(b->dbc, &m, &added, &b->error), ERROR_INPUT);
    m.name = "OTHER";
    m.id = 0x123;
    assert_int_equal(dbc_add_message(b->dbc, &m, &added, &b->error), ERROR_INPUT);
    m.id = 0x800;
    assert_int_equal(dbc_add_message(b->dbc, &m, &added, &b->error), ERROR_INPUT);
    m.id = 1;
    m.length = 12;
    assert_int_equal(dbc_add_message(b->dbc, &m, &added, &b->error), ERROR_INPUT);
    m.fd = true;
    m.length = 13;
    assert_int_equal(dbc_add_message(b->dbc, &m, &added, &b->error), ERROR_INPUT);
    m.sender = 2;
    m.length = 12;
    assert_int_equal(dbc_add_message(b->dbc, &m, &added, &b->error), ERROR_INPUT);
    m.sender = DBC_NO_NODE;
    assert_int_equal(dbc_add_message(b->dbc, &m, &added, &b->error), ERROR_NONE);
}

/* the usual picture of a Motorola signal: start is the most significant bit, going down each byte */
static void big_endian_bits_walk_down_each_byte(void **state)
{
    static const unsigned positions[12] = {20, 21, 22, 23, 8, 9, 10, 11, 12, 13, 14, 15};
    struct dbc_signal s = plain("s", 15, 12);

    (void)state;
    s.big_endian = true;
    for (unsigned k = 0; k < 12; k++) {
        assert_int_equal(dbc_bit(&s, k), positions[k]);
    }
    s.big_endian = false;
    s.start = 3;
    assert_int_equal(dbc_bit(&s, 11), 14);
}

static char *text_of(const struct dbc *dbc, size_t *size)
{
    char *text = NULL;
    FILE *file = open_memstream(&text, size);
    struct error error;

    assert_non_null(file);
    assert_int_equal(dbc_write(dbc, file, &error), ERROR_NONE);
    fclose(file);
    return text;
}

/* every feature of the format that there is */
static void fill(struct bench *b)
{
    const struct dbc_message fd = {
        .name = "FD_FRAME", .id = 0x7ff, .length = 64, .fd = true, .sender = 1, .cycle_ms = 50};
    struct dbc_signal selector = plain("command", 0, 8), s = plain("value", 15, 16), *added;
    struct dbc_message *message;

    selector.role = DBC_MULTIPLEXOR;
    selector.receivers = 3;
    assert_int_equal(add(b, selector), ERROR_NONE);
    s.role = DBC_MULTIPLEXED;
    s.selector = 0xf2;
    s.big_endian = true;
    s.type = DBC_SIGNED;
    s.scale = 100.0 / 1333;
    s.offset = -0.1;
    s.min = -1e-300;
    s.max = 1.7976931348623157e308;
    s.unit = "rad/s^2";
    s.frame_length = 3;
    assert_int_equal(dbc_add_signal(b->dbc, b->message, &s, &added, &b->error), ERROR_NONE);
    assert_int_equal(dbc_add_value(b->dbc, added, -5, "minus five", &b->error), ERROR_NONE);
    assert_int_equal(dbc_add_value(b->dbc, added, 7, "", &b->error), ERROR_NONE);
    assert_int_equal(dbc_set_comment(b->dbc, &added->comment, "a; 'signal'", &b->error), 0);
    assert_int_equal(dbc_set_comment(b->dbc, &b->message->comment, "BO_ 1", &b->error), 0);
    assert_int_equal(dbc_set_comment(b->dbc, &b->dbc->node[1].comment, "", &b->error), 0);
    assert_int_equal(dbc_set_comment(b->dbc, &b->dbc->comment, "all", &b->error), 0);
    assert_int_equal(dbc_add_message(b->dbc, &fd, &message, &b->error), ERROR_NONE);
    s = plain("real", 480, 32);
    s.type = DBC_FLOAT;
    s.receivers = 0;
    assert_int_equal(dbc_add_signal(b->dbc, message, &s, &added, &b->error), ERROR_NONE);
    b->dbc->fd = true;
    b->dbc->bitrate = 1000000;
    b->dbc->data_bitrate = 8000000;
}

static void a_written_database_reads_back_as_it_was(void **state)
{
    struct bench *b = *state;
    size_t size, again_size;
    const struct dbc_signal *s;
    struct dbc *read;
    char *text, *again;

    fill(b);
    text = text_of(b->dbc, &size);
    if (dbc_read("x.dbc", text, size, &b->arena, &read, &b->error)) {
        fail_msg("%s", b->error.text);
    }
    again = text_of(read, &again_size);
    assert_string_equal(text, again);
    assert_int_equal(read->nmessage, 2);
    assert_int_equal(read->data_bitrate, 8000000);
    assert_int_equal(read->message->next->cycle_ms, 50);
    assert_true(read->message->next->fd && !read->message->fd);
    assert_int_equal(read->message->next->signal->type, DBC_FLOAT);
    s = dbc_find_signal(read->message, "value");
    assert_non_null(s);
    assert_true(s->scale == 100.0 / 1333 && s->offset == -0.1 && s->max > 1e308);
    assert_true(s->big_endian && s->type == DBC_SIGNED && s->selector == 0xf2);
    assert_int_equal(s->frame_length, 3);
    assert_string_equal(s->value->text, "minus five");
    free(text);
    free(again);
}

/* What is written in place of a piece of the text that `fill` gives, and the error of the reader. */
static void errors_name_line_and_column(void **state)
{
    static const struct {
        const char *piece, *instead, *error;
    } cases[] = {
        {"VERSION", "VERSION ;", "x.dbc:1:9: found \";\""},
        {"SG_ command M : 0|8@1+", "SG_ command M : 0|8@2+",
         "x.dbc:37:22: found \"2\", expected a whole number from 0 to 1"},
        {"SG_ command M", "SG_ value M", "x.dbc:38:2: found signal value"},
        {"0|8@1+", "57|8@1+", "x.dbc:37:2: found signal command of 8 bits from bit 57 on"},
        {"m242", "m256", "x.dbc:38:2: found signal value of multiplexor value 256"},
        {"m242", "m", "x.dbc:38:12: found \"m\", expected M, m and a number, or :"},
        {"BO_ 291", "BO_ 2048", "x.dbc:36:5: found \"2048\""},
        {"8 board", "8 nobody", "x.dbc:36:22: found \"nobody\", expected a node"},
        {"8 board", "9 board", "x.dbc:36:1: found 9 bytes"},
        {"host,board", "board,host", "x.dbc:37:46: found \"host\""},
        {"-5 \"minus five\"", "-5 \"a\" -5 \"b\"", ": found value -5 of signal value again"},
        {"VFrameFormat\" BO_ 2047 14", "VFrameFormat\" BO_ 2047 0",
         "found \"0\", expected a whole"},
        {"BA_ \"VFrameFormat\" BO_ 2047 14;\n", "", "found message FD_FRAME of 64 bytes without"},
        {"SIG_VALTYPE_ 2047 real", "SIG_VALTYPE_ 291 command", ": found a float of 8 bits"},
        {"\"all\"", "\"al\xcc\"", ": found the byte 0xcc"},
        {" : 1;", "", ": found the end, expected \":\""},
    };
    struct bench *b = *state;
    struct dbc *read;
    size_t size;
    char *text;

    fill(b);
    text = text_of(b->dbc, &size);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *at = strstr(text, cases[i].piece);
        char changed[8192];
        int length;

        assert_non_null(at);
        length = snprintf(changed, sizeof changed, "%.*s%s%s", (int)(at - text), text,
                          cases[i].instead, at + strlen(cases[i].piece));
        assert_in_range(length, 1, (int)sizeof changed - 1);
        assert_int_equal(dbc_read("x.dbc", changed, (size_t)length, &b->arena, &read, &b->error),
                         ERROR_INPUT);
        assert_null(read);
        if (!strstr(b->error.text, cases[i].error)) {
            fail_msg("%s: %s", cases[i].instead, b->error.text);
        }
    }
    free(text);
}

static void every_beginning_of_a_file_is_refused(void **state)
{
    struct bench *b = *state;
    struct dbc *read;
    size_t size;
    char *text;

    fill(b);
    text = text_of(b->dbc, &size);
    /* the last line alone may lack: without it a float is a whole number */
    size = (size_t)(strstr(text, "VAL_ 291") - text) - 1;
    while (size > 0) {
        char *exact = malloc(--size ? size : 1);
        struct arena arena;

        assert_non_null(exact);
        assert_int_equal(arena_init(&arena, (size_t)64 << 20, &b->error), ERROR_NONE);
        memcpy(exact, text, size);
        if (!dbc_read("x.dbc", exact, size, &arena, &read, &b->error)) {
            /* between two lines that are optional */
            assert_true(size > (size_t)(strstr(text, "BA_ \"BaudrateCANFD\"") - text));
        }
        free(exact);
        arena_fini(&arena);
    }
    free(text);
}

static void memory_that_runs_out_is_an_error(void **state)
{
    struct bench *b = *state;
    struct dbc *read;
    size_t size;
    enum error_code code = ERROR_MEMORY;
    char *text;

    fill(b);
    text = text_of(b->dbc, &size);
    /* with one block more each time, until it is enough */
    for (size_t room = 0; code; room++) {
        struct arena small;

        assert_in_range(room, 0, 200);
        assert_int_equal(arena_init(&small, (size_t)1 << 20, &b->error), ERROR_NONE);
        assert_non_null(arena_alloc(&small, small.capacity / 64 - room, 64));
        code = dbc_read("x.dbc", text, size, &small, &read, &b->error);
        assert_true(code == ERROR_MEMORY || (code == ERROR_NONE && room > 20));
        arena_fini(&small);
    }
    free(text);
}

int main(void)
{
#define WITH_BENCH(test) cmocka_unit_test_setup_teardown(test, start, stop)
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_are_identifiers_of_32_letters_that_mean_nothing_else),
        WITH_BENCH(signals_stay_within_the_frame_and_off_each_other),
        WITH_BENCH(multiplexed_signals_share_bits_only_with_other_selectors),
        WITH_BENCH(numbers_are_finite_and_values_fit),
        WITH_BENCH(messages_have_their_own_name_identifier_and_a_legal_length),
        cmocka_unit_test(big_endian_bits_walk_down_each_byte),
        WITH_BENCH(a_written_database_reads_back_as_it_was),
        WITH_BENCH(errors_name_line_and_column),
        WITH_BENCH(every_beginning_of_a_file_is_refused),
        WITH_BENCH(memory_that_runs_out_is_an_error),
    };
#undef WITH_BENCH

    return cmocka_run_group_tests(tests, NULL, NULL);
}
