/* SPDX-License-Identifier: Apache-2.0 */
/* Candump logs: exact text, strict reading, round trips, and log2asc of can-utils as second
 * reader. */
#include "canbus/candump.h"

#include "base/array.h"
#include "tests/test.h"

#include <unistd.h>

static uint64_t random_state;

static uint32_t random_u32(void)
{
    random_state = random_state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(random_state >> 33);
}

/* Any legal frame, time in whole microseconds. */
static struct bus_frame random_frame(void)
{
    static const uint8_t fd_length[] = {12, 16, 20, 24, 32, 48, 64};
    struct bus_frame frame = {0};
    const uint32_t kind = random_u32() % 5;

    frame.time_ns = (int64_t)(random_u32() % 2000000000) * 1000000000 +
                    (int64_t)(random_u32() % 1000000) * 1000;
    frame.len = (uint8_t)(random_u32() % 9);
    if (kind == 0) {
        frame.flags = FRAME_ERROR;
        frame.id = random_u32() & 0x1FFFFFFF;
    } else {
        frame.flags = random_u32() % 2 ? FRAME_EXTENDED : 0;
        frame.id = random_u32() & (frame.flags ? 0x1FFFFFFF : 0x7FF);
    }
    if (kind == 1) {
        frame.flags |= FRAME_REMOTE;
        return frame;
    }
    if (kind >= 3) {
        frame.flags |= FRAME_FD;
        frame.flags |= random_u32() % 2 ? FRAME_BRS : 0;
        frame.flags |= random_u32() % 2 ? FRAME_ESI : 0;
        frame.len = random_u32() % 2 ? fd_length[random_u32() % 7] : frame.len;
    }
    for (int i = 0; i < frame.len; i++) {
        frame.data[i] = (uint8_t)random_u32();
    }
    return frame;
}

static void assert_frames_equal(const struct bus_frame *a, const struct bus_frame *b)
{
    assert_int_equal(a->id, b->id);
    assert_int_equal(a->flags, b->flags);
    assert_int_equal(a->len, b->len);
    assert_int_equal(a->time_ns, b->time_ns);
    assert_memory_equal(a->data, b->data, sizeof a->data);
}

TEST(writes_lines_exactly_as_candump_does)
{
    static const struct {
        struct bus_frame frame;
        const char *line;
    } cases[] = {
        {{.id = 0x123, .len = 4, .data = {0xDE, 0xAD, 0xBE, 0xEF}, .time_ns = 1436509052249713000},
         "(1436509052.249713) can0 123#DEADBEEF\n"},
        {{.id = 0x1, .time_ns = 1999}, "(0000000000.000001) can0 001#\n"},
        {{.id = 0x1, .flags = FRAME_EXTENDED, .len = 1, .data = {7}},
         "(0000000000.000000) can0 00000001#07\n"},
        {{.id = 0x7FF, .flags = FRAME_REMOTE}, "(0000000000.000000) can0 7FF#R\n"},
        {{.id = 0x7FF, .flags = FRAME_REMOTE, .len = 8}, "(0000000000.000000) can0 7FF#R8\n"},
        {{.id = 0x4, .flags = FRAME_ERROR, .len = 8, .data = {0, 4}},
         "(0000000000.000000) can0 20000004#0004000000000000\n"},
        {{.id = 0x123, .flags = FRAME_FD}, "(0000000000.000000) can0 123##0\n"},
        {{.id = 0x123, .flags = FRAME_FD | FRAME_BRS, .len = 2, .data = {0xAA, 0xBB}},
         "(0000000000.000000) can0 123##1AABB\n"},
        {{.id = 0x123, .flags = FRAME_FD | FRAME_EXTENDED | FRAME_BRS | FRAME_ESI, .len = 1},
         "(0000000000.000000) can0 00000123##300\n"},
        {{.id = 0x1, .time_ns = -5}, "(0000000000.000000) can0 001#\n"},
        {{.id = 0x1, .time_ns = INT64_MAX}, "(9223372036.854775) can0 001#\n"},
    };
    char line[CANDUMP_LINE_MAX];

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        size_t size = candump_format(&cases[i].frame, "can0", line);

        assert_string_equal(line, cases[i].line);
        assert_int_equal(size, strlen(line));
    }
    /* The longest line there can be fits with room to spare */
    assert_int_equal(candump_format(&(struct bus_frame){.id = 1,
                                                        .flags = FRAME_EXTENDED | FRAME_FD,
                                                        .len = 64,
                                                        .time_ns = INT64_MAX},
                                    "a-name-longer-than-allowed", line),
                     19 + 1 + 15 + 1 + 8 + 3 + 128 + 1);
}

TEST(reads_what_candump_and_its_relatives_write)
{
    static const struct {
        const char *line, *bus;
        struct bus_frame frame;
    } cases[] = {
        {"(1436509052.249713) vcan0 123#DEADBEEF",
         "vcan0",
         {.id = 0x123, .len = 4, .data = {0xDE, 0xAD, 0xBE, 0xEF}, .time_ns = 1436509052249713000}},
        {"(0.000001)   can0 123#r5\n",
         "can0",
         {.id = 0x123, .flags = FRAME_REMOTE, .len = 5, .time_ns = 1000}},
        {"(0000000000.000000) x 1abcdef0#ff",
         "x",
         {.id = 0x1ABCDEF0, .flags = FRAME_EXTENDED, .len = 1, .data = {0xFF}}},
        /* Kernels from 6.1 on set bit 2 of the flags in every FD frame */
        {"(0000000000.000000) can0 123##5AA\n",
         "can0",
         {.id = 0x123, .flags = FRAME_FD | FRAME_BRS, .len = 1, .data = {0xAA}}},
        {"(0000000000.000000) fifteen-letters 20000040#\n",
         "fifteen-letters",
         {.id = 0x40, .flags = FRAME_ERROR}},
        /* Of an editor of another system, and of candump -x */
        {"(0000000000.000000) can0 123#AA\r\n", "can0", {.id = 0x123, .len = 1, .data = {0xAA}}},
        {"(0000000000.000000) can[0] 123#AA\n", "can[0]", {.id = 0x123, .len = 1, .data = {0xAA}}},
        {"(0000000000.000000) can0 123#AA T\n", "can0", {.id = 0x123, .len = 1, .data = {0xAA}}},
        {"(0000000000.000000) can0 123#AA R\n", "can0", {.id = 0x123, .len = 1, .data = {0xAA}}},
        /* Nine digits of hardware time stamps, one of other tools; what canplayer and cansend take
         * besides: no space behind the time, '.' between bytes, a length code above 8, FD lengths
         * that are filled up, and words behind the frame */
        {"(1790000000.010000123) can1 001#490D",
         "can1",
         {.id = 1, .len = 2, .data = {0x49, 0x0D}, .time_ns = 1790000000010000123}},
        {"(1.5) can0 001#", "can0", {.id = 1, .time_ns = 1500000000}},
        {"  (0.000000)can0   001#11.22.33 R B -",
         "can0",
         {.id = 1, .len = 3, .data = {0x11, 0x22, 0x33}}},
        {"(0.000000) can0 001#0102030405060708_B",
         "can0",
         {.id = 1, .len = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}}},
        {"(0.000000) can0 001##F010203040506070809",
         "can0",
         {.id = 1,
          .flags = FRAME_FD | FRAME_BRS | FRAME_ESI,
          .len = 12,
          .data = {1, 2, 3, 4, 5, 6, 7, 8, 9}}},
        /* What candump -ta prints, then with -x and -a */
        {" (0.010000)  can1  RX - -  001   [2]  49 0D   'I.'\n",
         "can1",
         {.id = 1, .len = 2, .data = {0x49, 0x0D}, .time_ns = 10000000}},
        {" (0.010000)  can1  TX B E  001  [02]  49 0D\n",
         "can1",
         {.id = 1,
          .flags = FRAME_FD | FRAME_BRS | FRAME_ESI,
          .len = 2,
          .data = {0x49, 0x0D},
          .time_ns = 10000000}},
        {" (0.010000)  can1  TX B -  001  [00] \n",
         "can1",
         {.id = 1, .flags = FRAME_FD | FRAME_BRS, .time_ns = 10000000}},
        {" (1436509052.249713)  can0  123   [4]  DE AD BE EF\n",
         "can0",
         {.id = 0x123, .len = 4, .data = {0xDE, 0xAD, 0xBE, 0xEF}, .time_ns = 1436509052249713000}},
        {" (0000000000.000000)  vcan0  1ABCDEF0   [0] ",
         "vcan0",
         {.id = 0x1ABCDEF0, .flags = FRAME_EXTENDED}},
        {" (0000000000.000000)  can0  123   [5]  remote request",
         "can0",
         {.id = 0x123, .flags = FRAME_REMOTE, .len = 5}},
        {" (0000000000.000000)  can0  123  [02]  AA BB",
         "can0",
         {.id = 0x123, .flags = FRAME_FD, .len = 2, .data = {0xAA, 0xBB}}},
        {" (0000000000.000000)  can0  20000040   [1]  01   ERRORFRAME",
         "can0",
         {.id = 0x40, .flags = FRAME_ERROR, .len = 1, .data = {1}}},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct bus_frame frame;
        struct error error;
        char bus[16];

        if (candump_parse(cases[i].line, strlen(cases[i].line), &frame, bus, &error)) {
            fail_msg("%s: %s", cases[i].line, error.text);
        }
        assert_frames_equal(&frame, &cases[i].frame);
        assert_string_equal(bus, cases[i].bus);
    }
}

TEST(refuses_malformed_lines_and_names_the_column)
{
    static const struct {
        const char *line;
        int column;
    } cases[] = {
        {"", 1},
        {"\n", 1},
        {"# a comment", 1},
        {"(.000000) can0 123#", 2},
        {"(-1.000000) can0 123#", 2},
        {"(1,000000) can0 123#", 3},
        {"(9223372036.000000) can0 123#", 12},
        {"(99999999999999999999999.000000) can0 123#", 20},
        {"(1.) can0 123#", 4},
        {"(1.0000000000) can0 123#", 13},
        {"(1.000000", 10},
        {"(1.000000) ", 12},
        {"(1.000000) can0", 16},
        {"(1.000000) \tcan0 123#", 12},
        {"(1.000000) sixteen-letters! 123#", 27},
        {"(1.000000) can0 ", 17},
        {"(1.000000) can0 12#", 19},
        {"(1.000000) can0 1234#", 21},
        {"(1.000000) can0 800#", 17},
        {"(1.000000) can0 40000000#", 17},
        {"(1.000000) can0 123456789#", 25},
        {"(1.000000) can0 123", 20},
        {"(1.000000) can0 123#0", 22},
        {"(1.000000) can0 123#0G", 22},
        {"(1.000000) can0 123#00,11", 23},
        {"(1.000000) can0 123#.00", 21},
        {"(1.000000) can0 123#00_9", 23},
        {"(1.000000) can0 123#0011223344556677_8", 38},
        {"(1.000000) can0 123#001122334455667788", 37},
        {"(1.000000) can0 123#R9", 22},
        {"(1.000000) can0 123#R88", 23},
        {"(1.000000) can0 123##", 22},
        {"(1.000000) can0 123##R", 22},
        {"(1.000000) can0 123###", 22},
        {"(1.000000) can0 20000004#R", 27},
        {"(1.000000) can0 20000004##0", 27},
    };

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        struct bus_frame frame;
        struct error error;
        int column = -1;
        char bus[16];

        if (candump_parse(cases[i].line, strlen(cases[i].line), &frame, bus, &error) !=
            ERROR_INPUT) {
            fail_msg("accepted: %s", cases[i].line);
        }
        sscanf(error.text, "column %d: ", &column);
        if (column != cases[i].column) {
            fail_msg("%s: %s", cases[i].line, error.text);
        }
    }
}

/* A temporary file with the text; the caller unlinks path. */
static void write_file(char path[32], const char *text, size_t size)
{
    int descriptor;

    strcpy(path, "/tmp/candump-test-XXXXXX");
    descriptor = mkstemp(path);
    assert_true(descriptor >= 0);
    assert_int_equal(write(descriptor, text, size), size);
    close(descriptor);
}

TEST(reads_a_log_to_its_end)
{
    /* Lines without a frame, one of them longer than any frame, are skipped and counted */
    static const char text[] =
        "(0000000001.000000) can0 123#11\n# of mine\n\n"
        "DROPCOUNT: dropped 2 CAN frames on 'can1' socket (total drops 2)\n"
        "DROPCOUNT: dropped 3 CAN frames on 'can1' socket (total drops 5)\n%0300d\n"
        "(0000000002.000000) can1 124#22";
    struct candump_reader reader;
    struct bus_frame frame;
    struct error error;
    char path[32], bus[16], long_text[1024], skipped[160];
    bool end;

    write_file(path, long_text, (size_t)sprintf(long_text, text, 0));
    assert_ok(candump_open(&reader, path, &error));
    assert_ok(candump_next(&reader, &frame, bus, &end, &error));
    assert_false(end);
    assert_int_equal(frame.id, 0x123);
    assert_ok(candump_next(&reader, &frame, bus, &end, &error));
    assert_false(end);
    assert_string_equal(bus, "can1");
    for (int i = 0; i < 2; i++) {
        assert_ok(candump_next(&reader, &frame, bus, &end, &error));
        assert_true(end);
    }
    assert_true(candump_skipped(&reader, skipped, sizeof skipped));
    assert_string_equal(skipped, "5 lines without a frame skipped, the first is line 2; 5 frames "
                                 "were lost when it was written (DROPCOUNT)");
    candump_close(&reader);
    unlink(path);
}

TEST(names_file_line_and_column_of_a_fault)
{
    static const struct {
        const char *text;
        size_t size;
        const char *where;
    } cases[] = {
        {"(0000000001.000000) can0 123#11\n(x", 34, ":2:2: found 'x', expected the seconds"},
        {"(0000000001.000000) can0 123#11\n(0.\0", 36, ":2:4: found byte 0x00, expected one to"},
        {"(0000000001.000000) can0 123#11\n(0.000000) c 123  [2]  AA\n", 58,
         ":2:26: found the end of the line, expected as many bytes"},
        {"(0000000001.000000) can0 123#11\n(0.000000) c 123  [9]\n", 54,
         ":2:21: found ']', expected a length"},
    };
    char path[32], bus[16], expected[128];
    char *const lengthy = calloc(1, 5000);
    struct candump_reader reader;
    struct bus_frame frame;
    struct error error;
    bool end;

    for (size_t i = 0; i < ARRAY_COUNT(cases); i++) {
        write_file(path, cases[i].text, cases[i].size);
        assert_ok(candump_open(&reader, path, &error));
        assert_ok(candump_next(&reader, &frame, bus, &end, &error));
        assert_int_equal(candump_next(&reader, &frame, bus, &end, &error), ERROR_INPUT);
        snprintf(expected, sizeof expected, "%s%s", path, cases[i].where);
        if (strncmp(error.text, expected, strlen(expected)) != 0) {
            fail_msg("%s instead of %s", error.text, expected);
        }
        candump_close(&reader);
        unlink(path);
    }
    memset(lengthy, '(', 5000);
    write_file(path, lengthy, 5000);
    assert_ok(candump_open(&reader, path, &error));
    assert_int_equal(candump_next(&reader, &frame, bus, &end, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, ":1:257: the line is longer than any frame"));
    candump_close(&reader);
    unlink(path);
    free(lengthy);
}

TEST(reports_files_that_it_cannot_read)
{
    struct candump_reader reader;
    struct error error;

    assert_int_equal(candump_open(&reader, "/no/such/log", &error), ERROR_INPUT);
    assert_string_equal(error.text, "/no/such/log: cannot be read: No such file or directory");
    assert_int_equal(candump_open(&reader, "/tmp", &error), ERROR_INPUT);
    assert_string_equal(error.text, "/tmp: found a directory, expected a file");
}

/* The line that log2asc prints for a frame, blanks squeezed; written from the ASC format. FD lines
 * end in bit timing figures that are no part of the frame. */
static void expect_asc(const struct bus_frame *frame, int64_t start_ns, char text[512])
{
    const char *x = (frame->flags & FRAME_EXTENDED) ? "x" : "";
    const int64_t us = (frame->time_ns - start_ns) / 1000;
    static const uint8_t code_of[] = {
        [12] = 9, [16] = 10, [20] = 11, [24] = 12, [32] = 13, [48] = 14, [64] = 15};
    int at = sprintf(text, "%lld.%06lld ", (long long)(us / 1000000), (long long)(us % 1000000));

    if (frame->flags & FRAME_ERROR) {
        sprintf(text + at, "1 ErrorFrame");
        return;
    }
    if (frame->flags & FRAME_FD) {
        at += sprintf(text + at, "CANFD 1 Rx %X%s %d %d %x %d", frame->id, x,
                      !!(frame->flags & FRAME_BRS), !!(frame->flags & FRAME_ESI),
                      frame->len > 8 ? code_of[frame->len] : frame->len, frame->len);
    } else {
        at += sprintf(text + at, "1 %X%s Rx %c %d", frame->id, x,
                      (frame->flags & FRAME_REMOTE) ? 'r' : 'd', frame->len);
    }
    for (int i = 0; i < frame->len && !(frame->flags & FRAME_REMOTE); i++) {
        at += sprintf(text + at, " %02X", frame->data[i]);
    }
}

static void squeeze_blanks(char *text)
{
    char *to = text;

    for (const char *from = text; *from && *from != '\n'; from++) {
        if (*from != ' ' || (to > text && to[-1] != ' ')) {
            *to++ = *from;
        }
    }
    while (to > text && to[-1] == ' ') {
        to--;
    }
    *to = '\0';
}

TEST(log2asc_reads_the_same_frames_in_our_logs)
{
    enum { FRAMES = 2000 };
    struct bus_frame *frames = calloc(FRAMES, sizeof *frames);
    char path[32], command[128], line[1024], expected[512];
    FILE *log, *asc;
    int seen = 0;

    if (system("command -v log2asc >/dev/null 2>&1") != 0) {
        print_message("SKIP: log2asc of can-utils is not installed\n");
        free(frames);
        skip();
    }
    random_state = 2;
    write_file(path, "", 0);
    log = fopen(path, "w");
    for (int i = 0; i < FRAMES; i++) {
        frames[i] = random_frame();
        frames[i].time_ns = INT64_C(1000000000000) + (int64_t)i * 123456000;
        candump_format(&frames[i], "can0", line);
        fputs(line, log);
    }
    fclose(log);
    snprintf(command, sizeof command, "log2asc -I %s can0", path);
    asc = popen(command, "r");
    assert_non_null(asc);
    while (fgets(line, sizeof line, asc)) {
        if (line[0] != ' ') {
            continue; /* the header */
        }
        assert_true(seen < FRAMES);
        squeeze_blanks(line);
        expect_asc(&frames[seen], frames[0].time_ns, expected);
        if (frames[seen].flags & FRAME_FD) {
            line[strlen(expected)] = '\0';
        }
        assert_string_equal(line, expected);
        seen++;
    }
    assert_int_equal(pclose(asc), 0);
    assert_int_equal(seen, FRAMES);
    unlink(path);
    free(frames);
}
