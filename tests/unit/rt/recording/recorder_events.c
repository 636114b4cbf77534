/* SPDX-License-Identifier: Apache-2.0 */
/* What the recorder keeps beside frames and signals: events in the order of time, poses; the end of
 * an MCAP file. */
#include "base/whole_file.h"
#include "rt/recording/recorder.h"
#include "tests/test.h"

#include <unistd.h>

static struct error error;

enum { TEXT = 1 << 20 };

struct fixture {
    char directory[64];
    struct arena arena;
    struct recorder_config config;
    struct recorder *recorder;
    char text[TEXT]; /* of the file read last */
    struct recorder_counters counters;
};

static void set_up(struct fixture *f)
{
    static const char *const buses[] = {"can0"}, *const signals[] = {"q_rad"};
    static const char *const bodies[] = {"base", "link"};

    strcpy(f->directory, "/tmp/recorder-test-XXXXXX");
    assert_non_null(mkdtemp(f->directory));
    assert_ok(arena_init(&f->arena, (size_t)64 << 20, &error));
    f->config = (struct recorder_config){.directory = f->directory,
                                         .lossless = true,
                                         .nbus = 1,
                                         .bus = buses,
                                         .nsignal = 1,
                                         .signal = signals,
                                         .nbody = 2,
                                         .body = bodies};
}

static void tear_down(struct fixture *f)
{
    folder_remove(f->directory);
    arena_fini(&f->arena);
}

BENCH(set_up, struct fixture, tear_down)

static void begin(struct fixture *f)
{
    assert_ok(recorder_open(&f->config, &f->arena, &f->recorder, &error));
}

static void end(struct fixture *f)
{
    assert_ok(recorder_close(f->recorder, &f->counters, &error));
}

static const char *read_file(struct fixture *f, const char *name)
{
    char path[400];
    FILE *file;

    snprintf(path, sizeof path, "%s/%s", f->directory, name);
    file = fopen(path, "r");
    assert_non_null(file);
    f->text[fread(f->text, 1, TEXT - 1, file)] = '\0';
    fclose(file);
    return f->text;
}

TEST_ON(events_are_lines_in_the_order_of_their_times, set_up, f)
{
    begin(f);
    recorder_event(f->recorder, 3000000000, 0, JOURNAL_WARNING, "third");
    recorder_event(f->recorder, 1000000, 0, JOURNAL_INFO, "first");
    recorder_event(f->recorder, 3000000000, 0, JOURNAL_ERROR, "third, told later");
    recorder_event(f->recorder, 2500000000, 7, JOURNAL_NOTICE, "of the same time, by rank");
    recorder_event(f->recorder, 2500000000, 0, JOURNAL_NOTICE, "second");
    end(f);
    assert_string_equal(read_file(f, "events.log"), "0.001000 info first\n"
                                                    "2.500000 notice second\n"
                                                    "2.500000 notice of the same time, by rank\n"
                                                    "3.000000 warning third\n"
                                                    "3.000000 error third, told later\n");
    assert_int_equal(f->counters.events, 5);
}

/* More than are held back for order, and than the ring takes */
TEST_ON(a_flood_of_events_is_written_whole, set_up, f)
{
    const char *at;
    char line[80];

    begin(f);
    for (int i = 0; i < 20000; i++) {
        recorder_event(f->recorder, (int64_t)(i ^ 1) * 1000, 0, JOURNAL_INFO, "flood");
    }
    end(f);
    assert_int_equal(f->counters.events, 20000);
    assert_int_equal(f->counters.events_dropped, 0);
    at = read_file(f, "events.log");
    for (int i = 0; i < 20000; i++) {
        snprintf(line, sizeof line, "%.6f info flood\n", i * 1e-6);
        assert_int_equal(strncmp(at, line, strlen(line)), 0);
        at += strlen(line);
    }
    assert_int_equal(*at, '\0');
}

TEST_ON(a_long_text_is_cut, set_up, f)
{
    char text[1000];

    memset(text, 'x', sizeof text);
    text[sizeof text - 1] = '\0';
    begin(f);
    recorder_event(f->recorder, 0, 0, JOURNAL_INFO, text);
    end(f);
    assert_int_equal(strlen(read_file(f, "events.log")),
                     strlen("0.000000 info \n") + RECORDER_EVENT_TEXT - 1);
}

TEST_ON(an_event_is_on_the_disk_soon, set_up, f)
{
    begin(f);
    recorder_event(f->recorder, 0, 0, JOURNAL_INFO, "now");
    for (int i = 0; i < 2000 && !*read_file(f, "events.log"); i++) {
        usleep(5000);
    }
    assert_string_equal(f->text, "0.000000 info now\n");
    end(f);
}

TEST_ON(poses_have_a_file_of_their_own, set_up, f)
{
    static const double row[1 + 2 * RECORDER_POSE] = {0.25, 1.0, 2.0,  3.0, 1.0, 0.0, 0.0, 0.0,
                                                      -1.0, 0.5, -0.5, 0.6, 0.8, 0.0, 0.0};

    begin(f);
    recorder_row(f->recorder, 10000000, row);
    end(f);
    assert_string_equal(read_file(f, "signals.csv"), "time_s,q_rad\n0.010000,0.25\n");
    assert_string_equal(read_file(f, "poses.csv"),
                        "time_s,base_x_m,base_y_m,base_z_m,base_qw,base_qx,base_qy,base_qz,"
                        "link_x_m,link_y_m,link_z_m,link_qw,link_qx,link_qy,link_qz\n"
                        "0.010000,1,2,3,1,0,0,0,-1,0.5,-0.5,0.6,0.8,0,0\n");
}

/* By the specification of MCAP the magic bytes stand at both ends, and before those at the end a
 * footer: opcode 2, with 20 bytes of content. */
TEST_ON(an_mcap_file_that_is_closed_has_its_end, set_up, f)
{
    enum { MAGIC = 8, FOOTER = 1 + 8 + 20 };
    static const char magic[MAGIC + 1] = "\x89MCAP0\r\n";
    char path[400];
    FILE *file;
    size_t size;

    f->config.format = RECORDER_MCAP;
    begin(f);
    recorder_event(f->recorder, 0, 0, JOURNAL_INFO, "now");
    end(f);
    snprintf(path, sizeof path, "%s/recording.mcap", f->directory);
    file = fopen(path, "r");
    assert_non_null(file);
    size = fread(f->text, 1, TEXT, file);
    fclose(file);
    assert_in_range(size, 2 * MAGIC + FOOTER, TEXT - 1);
    assert_memory_equal(f->text, magic, MAGIC);
    assert_memory_equal(f->text + size - MAGIC, magic, MAGIC);
    assert_memory_equal(f->text + size - MAGIC - FOOTER, "\x02\x14\0\0\0\0\0\0\0", 9);
}
