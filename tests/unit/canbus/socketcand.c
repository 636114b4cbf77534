/* SPDX-License-Identifier: Apache-2.0 */
/* The words of the socketcand protocol, both ways. */
#include "canbus/socketcand.h"

#include "base/array.h"
#include "tests/test.h"

static struct socketcand_request parse(const char *text)
{
    struct socketcand_request request;

    socketcand_parse(text, strlen(text), &request);
    return request;
}

TEST(understands_the_commands)
{
    assert_int_equal(parse("< open can0 >").command, SOCKETCAND_OPEN);
    assert_string_equal(parse("< open can0 >").bus, "can0");
    assert_int_equal(parse("<open left_leg>").command, SOCKETCAND_OPEN);
    assert_int_equal(parse("< rawmode >").command, SOCKETCAND_RAWMODE);
    assert_int_equal(parse("< bcmmode >").command, SOCKETCAND_BCMMODE);
    assert_int_equal(parse("< echo >").command, SOCKETCAND_ECHO);
    assert_int_equal(parse("< add 1 0 123 8 11 22 33 44 55 66 77 88 >").command, SOCKETCAND_OTHER);
    assert_int_equal(parse("< statistics 1000 >").command, SOCKETCAND_OTHER);
}

TEST(understands_frames_as_the_protocol_shows_them)
{
    struct socketcand_request request = parse("< send 123 0 >");

    assert_int_equal(request.command, SOCKETCAND_SEND);
    assert_int_equal(request.frame.id, 0x123);
    assert_int_equal(request.frame.flags, 0);
    assert_int_equal(request.frame.len, 0);

    request = parse("< send 1AAAAAAA 2 1 F1 >");
    assert_int_equal(request.command, SOCKETCAND_SEND);
    assert_int_equal(request.frame.id, 0x1aaaaaaa);
    assert_int_equal(request.frame.flags, FRAME_EXTENDED);
    assert_int_equal(request.frame.len, 2);
    assert_int_equal(request.frame.data[0], 0x01);
    assert_int_equal(request.frame.data[1], 0xf1);

    request = parse("< sendrtr 123 2 >");
    assert_int_equal(request.command, SOCKETCAND_SEND);
    assert_int_equal(request.frame.flags, FRAME_REMOTE);

    request = parse("< fdsend 7FF 01 12 0 1 2 3 4 5 6 7 8 9 a b >");
    assert_int_equal(request.command, SOCKETCAND_SEND);
    assert_int_equal(request.frame.flags, FRAME_FD | FRAME_BRS);
    assert_int_equal(request.frame.len, 12);
    assert_int_equal(request.frame.data[11], 0x0b);
}

TEST(tells_short_identifiers_of_29_bits_by_their_digits)
{
    assert_int_equal(parse("< send 00000123 0 >").frame.flags, FRAME_EXTENDED);
    assert_int_equal(parse("< send 800 0 >").frame.flags, FRAME_EXTENDED);
    assert_int_equal(parse("< send 7FF 0 >").frame.flags, 0);
}

TEST(refuses_wrong_arguments)
{
    static const char *const wrong[] = {
        "< send 123 9 0 1 2 3 4 5 6 7 8 >",
        "< send 123 2 1 >",
        "< send 123 >",
        "< send >",
        "< send xyz 0 >",
        "< send 20000000 0 >",
        "< send 123456789 0 >",
        "< send 123 1 100 >",
        "< send 123 1 g >",
        "< send 123 -1 >",
        "< send 123 01x >",
        "< fdsend 123 0 9 0 1 2 3 4 5 6 7 8 >",
        "< sendrtr 123 9 >",
        "< sendrtr 123 >",
        "< fdsend 123 zz 0 >",
        "< open >",
        "< open a b >",
        "< open seventeen_letters >",
        "< rawmode now >",
        "< echo 1 >",
    };

    for (size_t i = 0; i < ARRAY_COUNT(wrong); i++) {
        if (parse(wrong[i]).command != SOCKETCAND_MALFORMED) {
            fail_msg("\"%s\" was not refused", wrong[i]);
        }
    }
}

TEST(calls_unknown_what_is_no_command)
{
    static const char *const unknown[] = {"",    "<",         ">",          "<>",
                                          "< >", "< hello >", "send 123 0", "< SEND 123 0 >"};

    for (size_t i = 0; i < ARRAY_COUNT(unknown); i++) {
        if (parse(unknown[i]).command != SOCKETCAND_UNKNOWN) {
            fail_msg("\"%s\" was not called unknown", unknown[i]);
        }
    }
}

TEST(a_frame_may_name_its_bus)
{
    static const char *const named[] = {"< send 123 2 1 ff left_leg >", "< send 123 0 left_leg >",
                                        "< sendrtr 123 0 left_leg >",
                                        "< fdsend 123 1 1 ff left_leg >"};
    static const char *const wrong[] = {
        "< send 123 2 1 ff left_leg 1 >", "< send 123 2 1 left_leg >",
        "< send 123 0 seventeen_letters >", "< sendrtr 123 left_leg >", "< sendrtr 123 >"};

    assert_string_equal(parse("< send 123 2 1 ff >").bus, "");
    for (size_t i = 0; i < sizeof named / sizeof named[0]; i++) {
        assert_int_equal(parse(named[i]).command, SOCKETCAND_SEND);
        assert_string_equal(parse(named[i]).bus, "left_leg");
    }
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        assert_int_equal(parse(wrong[i]).command, SOCKETCAND_MALFORMED);
    }
}

TEST(writes_frames_as_clients_read_them)
{
    char text[SOCKETCAND_TEXT_MAX];
    struct bus_frame frame = frame_make(0x123, 4, (const uint8_t[]){0x11, 0x22, 0x33, 0x44});

    frame.time_ns = INT64_C(23424242123);
    assert_int_equal(socketcand_format(&frame, NULL, text),
                     strlen("\n< frame 123 23.424242 11223344 >"));
    assert_string_equal(text, "\n< frame 123 23.424242 11223344 >");
    frame.data[3] = 0xaf;
    socketcand_format(&frame, "left_leg", text);
    assert_string_equal(text, "\n< frame 123 23.424242 112233AF left_leg >");
    frame.len = 0;
    frame.flags = FRAME_EXTENDED;
    socketcand_format(&frame, NULL, text);
    assert_string_equal(text, "\n< frame 00000123 23.424242  >");
    frame.flags = FRAME_REMOTE;
    socketcand_format(&frame, NULL, text);
    assert_string_equal(text, "\n< rtr 123 23.424242 0 >");
    socketcand_format(&frame, "can1", text);
    assert_string_equal(text, "\n< rtr 123 23.424242 0 can1 >");
    frame.flags = FRAME_FD | FRAME_BRS | FRAME_ESI;
    frame.len = 64;
    assert_in_range(socketcand_format(&frame, NULL, text), 150, SOCKETCAND_TEXT_MAX - 1);
    assert_memory_equal(text, "\n< fdframe 123 03 23.424242 112233AF", 35);
}

TEST(writes_nothing_for_error_frames)
{
    char text[SOCKETCAND_TEXT_MAX];
    struct bus_frame frame = {.id = 4, .flags = FRAME_ERROR, .len = 8};

    assert_int_equal(socketcand_format(&frame, NULL, text), 0);
    frame = (struct bus_frame){.id = 0x800};
    assert_int_equal(socketcand_format(&frame, NULL, text), 0);
}

TEST(the_longest_frame_has_room)
{
    char text[SOCKETCAND_TEXT_MAX];
    struct bus_frame frame = {.id = 0x1fffffff,
                              .flags = FRAME_EXTENDED | FRAME_FD | FRAME_BRS,
                              .len = 64,
                              .time_ns = INT64_MAX};

    assert_in_range(socketcand_format(&frame, "sixteen_letters_", text), 1,
                    SOCKETCAND_TEXT_MAX - 1);
}
