/* SPDX-License-Identifier: Apache-2.0 */
/* The recorder: what the loop gave is in the files, in order; full rings, full disks, and
 * directories that hold something already. */
#include "rt/recorder.h"

#include "canbus/candump.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

struct fixture {
    char directory[64];
    struct arena arena;
    struct recorder_config config;
};

static const char *const buses[] = {"can0", "can1"};
static const char *const signals[] = {"q_rad", "torque_nm"};

static int set_up(void **state)
{
    struct fixture *f = test_calloc(1, sizeof *f);
    struct error error;

    strcpy(f->directory, "/tmp/recorder-test-XXXXXX");
    assert_non_null(mkdtemp(f->directory));
    assert_int_equal(arena_init(&f->arena, (size_t)64 << 20, &error), ERROR_NONE);
    f->config = (struct recorder_config){
        .directory = f->directory,
        .lossless = true,
        .nbus = 2,
        .bus = buses,
        .nsignal = 2,
        .signal = signals,
    };
    *state = f;
    return 0;
}

static int tear_down(void **state)
{
    struct fixture *f = *state;
    DIR *stream = opendir(f->directory);
    const struct dirent *entry;

    while (stream && (entry = readdir(stream))) {
        char path[400];

        snprintf(path, sizeof path, "%s/%s", f->directory, entry->d_name);
        unlink(path);
    }
    closedir(stream);
    rmdir(f->directory);
    arena_fini(&f->arena);
    test_free(f);
    return 0;
}

static const char *path_in(const struct fixture *f, const char *name)
{
    static char path[400];

    snprintf(path, sizeof path, "%s/%s", f->directory, name);
    return path;
}

static struct recorder *open_recorder(struct fixture *f)
{
    struct recorder *recorder;
    struct error error;

    assert_int_equal(recorder_open(&f->config, &f->arena, &recorder, &error), ERROR_NONE);
    return recorder;
}

static void record_frames(struct recorder *recorder, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        uint8_t data[4];
        struct bus_frame frame;

        put_u32_le(data, i);
        frame = frame_make(i % 0x800, 4, data);
        recorder_frame(recorder, i % 2, &frame, (int64_t)i * 1000000);
    }
}

static void every_frame_is_in_the_log_in_order(void **state)
{
    struct fixture *f = *state;
    struct recorder_counters counters;
    struct candump_reader reader;
    struct recorder *recorder;
    struct bus_frame frame;
    struct error error;
    char bus[16];
    bool end = false;

    /* a ring far smaller than what goes through it */
    f->config.frame_ring = 64;
    recorder = open_recorder(f);
    record_frames(recorder, 20000);
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_NONE);
    assert_int_equal(counters.frames, 20000);
    assert_int_equal(counters.frames_dropped, 0);
    assert_int_equal(counters.unwritten, 0);
    assert_int_equal(candump_open(&reader, path_in(f, "candump.log"), &error), ERROR_NONE);
    for (uint32_t i = 0; i < 20000; i++) {
        assert_int_equal(candump_next(&reader, &frame, bus, &end, &error), ERROR_NONE);
        assert_false(end);
        assert_int_equal(frame.id, i % 0x800);
        assert_int_equal(get_u32_le(frame.data), i);
        assert_int_equal(frame.time_ns, (int64_t)i * 1000000);
        assert_string_equal(bus, buses[i % 2]);
    }
    assert_int_equal(candump_next(&reader, &frame, bus, &end, &error), ERROR_NONE);
    assert_true(end);
    candump_close(&reader);
}

static void rows_have_titles_and_a_time_in_seconds(void **state)
{
    struct fixture *f = *state;
    struct recorder *recorder = open_recorder(f);
    struct recorder_counters counters;
    struct error error;
    char line[200];
    FILE *csv;

    recorder_row(recorder, 0, (const double[]){0.5, -1e-9});
    recorder_row(recorder, 1234567000, (const double[]){1.0 / 3.0, 1e300});
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_NONE);
    assert_int_equal(counters.rows, 2);
    csv = fopen(path_in(f, "signals.csv"), "r");
    assert_non_null(fgets(line, sizeof line, csv));
    assert_string_equal(line, "time_s,q_rad,torque_nm\n");
    assert_non_null(fgets(line, sizeof line, csv));
    assert_string_equal(line, "0.000000,0.5,-1e-09\n");
    assert_non_null(fgets(line, sizeof line, csv));
    assert_string_equal(line, "1.234567,0.333333333,1e+300\n");
    assert_null(fgets(line, sizeof line, csv));
    fclose(csv);
}

static void a_full_ring_drops_and_counts_when_the_loop_may_not_wait(void **state)
{
    struct fixture *f = *state;
    struct recorder_counters counters;
    struct recorder *recorder;
    struct error error;

    f->config.lossless = false;
    f->config.frame_ring = 16;
    recorder = open_recorder(f);
    record_frames(recorder, 200000);
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_NONE);
    assert_int_equal(counters.frames + counters.frames_dropped, 200000);
    assert_true(counters.frames >= 16);
    assert_true(counters.frames_dropped > 0);
}

static void a_full_disk_is_reported_once_and_the_loop_goes_on(void **state)
{
    struct fixture *f = *state;
    struct recorder_counters counters;
    struct recorder *recorder;
    struct error error;

    assert_int_equal(symlink("/dev/full", path_in(f, "candump.log")), 0);
    f->config.overwrite = true;
    recorder = open_recorder(f);
    record_frames(recorder, 50000);
    recorder_row(recorder, 0, (const double[]){1.0, 2.0});
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "candump.log"));
    assert_non_null(strstr(error.text, "No space left"));
    assert_int_equal(counters.frames, 50000);
    assert_true(counters.unwritten > 0);
    /* the other file is whole */
    {
        struct stat info;

        assert_int_equal(stat(path_in(f, "signals.csv"), &info), 0);
        assert_int_equal(info.st_size, strlen("time_s,q_rad,torque_nm\n0.000000,1,2\n"));
    }
}

static void the_failure_is_handed_out_once(void **state)
{
    struct fixture *f = *state;
    struct recorder_counters counters;
    struct recorder *recorder;
    struct error error = {0};
    int told = 0;

    assert_int_equal(symlink("/dev/full", path_in(f, "candump.log")), 0);
    f->config.overwrite = true;
    recorder = open_recorder(f);
    for (int i = 0; i < 1000 && !told; i++) {
        record_frames(recorder, 10000);
        told += recorder_failure(recorder, &error);
    }
    assert_int_equal(told, 1);
    assert_int_equal(error.code, ERROR_SYSTEM);
    assert_false(recorder_failure(recorder, &error));
    recorder_close(recorder, &counters, &error);
}

static void a_directory_that_holds_something_is_refused(void **state)
{
    struct fixture *f = *state;
    struct recorder_counters counters;
    struct recorder *recorder;
    struct error error;

    fclose(fopen(path_in(f, "precious"), "w"));
    assert_int_equal(recorder_open(&f->config, &f->arena, &recorder, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "not empty"));
    assert_int_not_equal(access(path_in(f, "candump.log"), F_OK), 0);
    f->config.overwrite = true;
    recorder = open_recorder(f);
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_NONE);
    assert_int_equal(access(path_in(f, "precious"), F_OK), 0);
}

static void impossible_directories_are_errors(void **state)
{
    struct fixture *f = *state;
    struct recorder *recorder;
    struct error error;
    char path[400];

    snprintf(path, sizeof path, "%s/no/such", f->directory);
    f->config.directory = path;
    assert_int_equal(recorder_open(&f->config, &f->arena, &recorder, &error), ERROR_SYSTEM);
    snprintf(path, sizeof path, "%s/file", f->directory);
    fclose(fopen(path, "w"));
    assert_int_equal(recorder_open(&f->config, &f->arena, &recorder, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "Not a directory"));
}

static void a_directory_is_made(void **state)
{
    struct fixture *f = *state;
    struct recorder_counters counters;
    struct recorder *recorder;
    struct error error;

    rmdir(f->directory);
    recorder = open_recorder(f);
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_NONE);
    assert_int_equal(access(path_in(f, "candump.log"), F_OK), 0);
}

#define RECORDER_TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)

int main(void)
{
    const struct CMUnitTest tests[] = {
        RECORDER_TEST(every_frame_is_in_the_log_in_order),
        RECORDER_TEST(rows_have_titles_and_a_time_in_seconds),
        RECORDER_TEST(a_full_ring_drops_and_counts_when_the_loop_may_not_wait),
        RECORDER_TEST(a_full_disk_is_reported_once_and_the_loop_goes_on),
        RECORDER_TEST(the_failure_is_handed_out_once),
        RECORDER_TEST(a_directory_that_holds_something_is_refused),
        RECORDER_TEST(impossible_directories_are_errors),
        RECORDER_TEST(a_directory_is_made),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
