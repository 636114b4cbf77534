/* SPDX-License-Identifier: Apache-2.0 */
/* A DBC database is checked as it grows, and written line by line. */
#include "base/array.h"
#include "canbus/dbc.h"
#include "tests/test.h"

struct bench {
    struct arena arena;
    struct dbc *dbc;
    struct dbc_message *message;
    struct error error;
};

static inline void start(struct bench *b)
{
    const struct dbc_message message = {.name = "TELEMETRY", .id = 0x123, .length = 8, .sender = 1};

    assert_non_null(b);
    assert_ok(arena_init(&b->arena, (size_t)64 << 20, &b->error));
    b->dbc = dbc_create(&b->arena, "bench");
    assert_non_null(b->dbc);
    assert_ok(dbc_add_node(b->dbc, "host", &b->error));
    assert_ok(dbc_add_node(b->dbc, "board", &b->error));
    assert_ok(dbc_add_message(b->dbc, &message, &b->message, &b->error));
}

static inline void stop(struct bench *b)
{
    arena_fini(&b->arena);
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

TEST(names_are_identifiers_of_32_letters_that_mean_nothing_else)
{
    static const char *const good[] = {"a", "_9", "SET_OPEN_LOOP_pwm_0",
                                       "abcdefghijklmnopqrstuvwxyz_78901"};
    static const char *const bad[] = {
        "",    "9a",     "a b", "a-b",  "abcdefghijklmnopqrstuvwxyz_789012",
        "BO_", "SG_",    "CM_", "\xe9", "Vector__XXX",
        "BU_", "VERSION"};

    for (size_t i = 0; i < ARRAY_COUNT(good); i++) {
        assert_true(dbc_is_name(good[i]));
    }
    for (size_t i = 0; i < ARRAY_COUNT(bad); i++) {
        assert_false(dbc_is_name(bad[i]));
    }
}

BENCH(start, struct bench, stop)

TEST_ON(signals_stay_within_the_frame_and_off_each_other, start, b)
{
    struct dbc_signal big = plain("big", 23, 16); /* bytes 2 and 3 */

    big.big_endian = true;
    assert_ok(add(b, plain("first", 0, 16)));
    assert_ok(add(b, big));
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
    assert_ok(add(b, plain("last", 32, 32)));
    assert_int_equal(b->message->nsignal, 3);
}

TEST_ON(multiplexed_signals_share_bits_only_with_other_selectors, start, b)
{
    struct dbc_signal selector = plain("command", 0, 8), a = plain("a", 8, 16),
                      c = plain("c", 8, 16), d = plain("d", 16, 8), late = plain("late", 32, 8);

    a.role = c.role = d.role = DBC_MULTIPLEXED;
    a.selector = d.selector = 0x72;
    c.selector = 0xf2;
    assert_int_equal(add(b, a), ERROR_INPUT); /* no multiplexor yet */
    selector.role = DBC_MULTIPLEXOR;
    assert_ok(add(b, selector));
    late.role = DBC_MULTIPLEXOR;
    assert_int_equal(add(b, late), ERROR_INPUT);
    assert_ok(add(b, a));
    assert_ok(add(b, c));
    assert_int_equal(add(b, d), ERROR_INPUT);
    c.selector = 256;
    c.name = "e";
    assert_int_equal(add(b, c), ERROR_INPUT); /* more than 8 bits hold */
}

TEST_ON(numbers_are_finite_and_values_fit, start, b)
{
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
    assert_ok(dbc_add_signal(b->dbc, b->message, &s, &added, &b->error));
    assert_ok(dbc_add_value(b->dbc, added, -128, "low", &b->error));
    assert_int_equal(dbc_add_value(b->dbc, added, -128, "again", &b->error), ERROR_INPUT);
    assert_int_equal(dbc_add_value(b->dbc, added, 128, "high", &b->error), ERROR_INPUT);
    assert_int_equal(dbc_add_value(b->dbc, added, 1, "quo\"te", &b->error), ERROR_INPUT);
}

TEST_ON(messages_have_their_own_name_identifier_and_a_legal_length, start, b)
{
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
    assert_ok(dbc_add_message(b->dbc, &m, &added, &b->error));
}

/* The usual picture of a Motorola signal: start is the most significant bit, going down each
 * byte */
TEST(big_endian_bits_walk_down_each_byte)
{
    static const unsigned positions[12] = {20, 21, 22, 23, 8, 9, 10, 11, 12, 13, 14, 15};
    struct dbc_signal s = plain("s", 15, 12);

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
    assert_ok(dbc_write(dbc, file, &error));
    fclose(file);
    return text;
}

/* Every feature of the format that there is */
static void fill(struct bench *b)
{
    const struct dbc_message fd = {
        .name = "FD_FRAME", .id = 0x7ff, .length = 64, .fd = true, .sender = 1, .cycle_ms = 50};
    struct dbc_signal selector = plain("command", 0, 8), s = plain("value", 15, 16), *added;
    struct dbc_message *message;

    selector.role = DBC_MULTIPLEXOR;
    selector.receivers = 3;
    assert_ok(add(b, selector));
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
    assert_ok(dbc_add_signal(b->dbc, b->message, &s, &added, &b->error));
    assert_ok(dbc_add_value(b->dbc, added, -5, "minus five", &b->error));
    assert_ok(dbc_add_value(b->dbc, added, 7, "", &b->error));
    assert_int_equal(dbc_set_comment(b->dbc, &added->comment, "a; 'signal'", &b->error), 0);
    assert_int_equal(dbc_set_comment(b->dbc, &b->message->comment, "BO_ 1", &b->error), 0);
    assert_int_equal(dbc_set_comment(b->dbc, &b->dbc->node[1].comment, "", &b->error), 0);
    assert_int_equal(dbc_set_comment(b->dbc, &b->dbc->comment, "all", &b->error), 0);
    assert_ok(dbc_set_comment(b->dbc, &added->long_name, "a signal", &b->error));
    assert_ok(dbc_set_comment(b->dbc, &b->message->long_name, "a message", &b->error));
    assert_ok(dbc_set_comment(b->dbc, &b->dbc->node[1].long_name, "a board", &b->error));
    assert_ok(dbc_add_message(b->dbc, &fd, &message, &b->error));
    s = plain("real", 480, 32);
    s.type = DBC_FLOAT;
    s.receivers = 0;
    assert_ok(dbc_add_signal(b->dbc, message, &s, &added, &b->error));
    b->dbc->fd = true;
    b->dbc->bitrate = 1000000;
    b->dbc->data_bitrate = 8000000;
}

TEST_ON(a_database_is_written_line_by_line, start, b)
{
    /* What stands before the nodes and between comments and values is the same in every file */
    static const char messages[] = "BU_: host board\n"
                                   "\n"
                                   "BO_ 291 TELEMETRY: 8 board\n"
                                   " SG_ command M : 0|8@1+ (1,0) [0|0] \"\" host,board\n"
                                   " SG_ value m242 : 15|16@0- (0.07501875468867217,-0.1) "
                                   "[-1e-300|1.7976931348623157e+308] \"rad/s^2\" host\n"
                                   "\n"
                                   "BO_ 2047 FD_FRAME: 64 board\n"
                                   " SG_ real : 480|32@1- (1,0) [0|0] \"\" Vector__XXX\n"
                                   "\n"
                                   "CM_ \"all\";\n"
                                   "CM_ BU_ board \"\";\n"
                                   "CM_ BO_ 291 \"BO_ 1\";\n"
                                   "CM_ SG_ 291 value \"a; 'signal'\";\n"
                                   "BA_DEF_ \"DBName\" STRING ;\n";
    static const char end[] = "BA_DEF_DEF_ \"FrameLength\" 0;\n"
                              "BA_DEF_DEF_ \"SystemNodeLongSymbol\" \"\";\n"
                              "BA_DEF_DEF_ \"SystemMessageLongSymbol\" \"\";\n"
                              "BA_DEF_DEF_ \"SystemSignalLongSymbol\" \"\";\n"
                              "BA_ \"DBName\" \"bench\";\n"
                              "BA_ \"BusType\" \"CAN FD\";\n"
                              "BA_ \"Baudrate\" 1000000;\n"
                              "BA_ \"BaudrateCANFD\" 8000000;\n"
                              "BA_ \"SystemNodeLongSymbol\" BU_ board \"a board\";\n"
                              "BA_ \"SystemMessageLongSymbol\" BO_ 291 \"a message\";\n"
                              "BA_ \"FrameLength\" SG_ 291 value 3;\n"
                              "BA_ \"SystemSignalLongSymbol\" SG_ 291 value \"a signal\";\n"
                              "BA_ \"GenMsgCycleTime\" BO_ 2047 50;\n"
                              "BA_ \"VFrameFormat\" BO_ 2047 14;\n"
                              "VAL_ 291 value -5 \"minus five\" 7 \"\" ;\n"
                              "SIG_VALTYPE_ 2047 real : 1;\n";
    const char *at;
    size_t size;
    char *text;

    fill(b);
    text = text_of(b->dbc, &size);
    assert_ptr_equal(strstr(text, "VERSION \"\"\n\nNS_ :\n\tNS_DESC_\n"), text);
    at = strstr(text, "BU_: ");
    assert_non_null(at);
    if (strncmp(at, messages, sizeof messages - 1) != 0) {
        assert_string_equal(at, messages);
    }
    at = strstr(text, "BA_DEF_DEF_ \"FrameLength\"");
    assert_non_null(at);
    assert_string_equal(at, end);
    free(text);
}

TEST_ON(a_file_that_cannot_be_written_is_an_error, start, b)
{
    FILE *full = fopen("/dev/full", "w");

    fill(b);
    assert_non_null(full);
    assert_int_equal(dbc_write(b->dbc, full, &b->error), ERROR_SYSTEM);
    fclose(full);
}

/* One message with one signal with one value, in what memory there is. */
static enum error_code build_small(struct arena *arena, struct error *error)
{
    const struct dbc_message message = {.name = "M", .id = 1, .length = 8};
    const struct dbc_signal signal = plain("s", 0, 8);
    struct dbc *dbc = dbc_create(arena, "small");
    struct dbc_message *m;
    struct dbc_signal *s;
    enum error_code code;

    if (!dbc) {
        return ERROR_MEMORY;
    }
    code = dbc_add_node(dbc, "host", error);
    code = code ? code : dbc_add_message(dbc, &message, &m, error);
    code = code ? code : dbc_add_signal(dbc, m, &signal, &s, error);
    code = code ? code : dbc_add_value(dbc, s, 1, "one", error);
    return code ? code : dbc_set_comment(dbc, &s->comment, "a comment", error);
}

TEST_ON(memory_that_runs_out_is_an_error, start, b)
{
    enum error_code code = ERROR_MEMORY;
    size_t blocks;

    /* With one block more each time, until it is enough */
    for (blocks = 0; code; blocks++) {
        struct arena small CLOSED_BY(arena_fini);

        assert_in_range(blocks, 0, 200);
        assert_ok(arena_init(&small, (size_t)1 << 20, &b->error));
        assert_non_null(arena_alloc(&small, small.capacity / 64 - blocks, 64));
        code = build_small(&small, &b->error);
        assert_true(code == ERROR_MEMORY || code == ERROR_NONE);
    }
    assert_true(blocks > 20);
}

/* Values are as the text format defines them; bits of other messages and multiplexors are not
 * read. */
TEST_ON(signals_are_read_from_frames, start, b)
{
    struct dbc_signal by = plain("by", 0, 8), big = plain("big", 15, 12);
    struct dbc_signal low = plain("low", 20, 12), real = plain("real", 32, 32);
    struct bus_frame frame = {
        .id = 0x123, .len = 8, .data = {3, 0xAB, 0xC0 | 0x5, 0x80, 0, 0, 0x20, 0xC0}};
    double value;

    by.role = DBC_MULTIPLEXOR;
    big.big_endian = true;
    low.type = DBC_SIGNED;
    low.scale = 0.5;
    low.offset = 1.0;
    real.type = DBC_FLOAT;
    real.role = DBC_MULTIPLEXED;
    real.selector = 3;
    assert_ok(add(b, by));
    assert_ok(add(b, big));
    assert_ok(add(b, real));
    assert_ptr_equal(dbc_find_frame(b->dbc, &frame), b->message);
    assert_true(dbc_read_signal(b->message, &big, &frame, &value));
    assert_true(value == 0xABC);
    frame.data[2] = 0x0F; /* 0x80 and 0 above: -2048 */
    assert_true(dbc_read_signal(b->message, &low, &frame, &value));
    assert_true(value == 0.5 * -2048 + 1.0);
    assert_true(dbc_read_signal(b->message, &real, &frame, &value));
    assert_true(value == -2.5);

    /* Another selector, a short frame, other frames */
    frame.data[0] = 4;
    assert_false(dbc_read_signal(b->message, &real, &frame, &value));
    frame.len = 2;
    assert_false(dbc_read_signal(b->message, &low, &frame, &value));
    frame.flags = FRAME_EXTENDED;
    assert_null(dbc_find_frame(b->dbc, &frame));
    frame = (struct bus_frame){.id = 0x124};
    assert_null(dbc_find_frame(b->dbc, &frame));
}
