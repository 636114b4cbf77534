/* SPDX-License-Identifier: Apache-2.0 */
/* The recorder: what the loop gave is in the files, in order; full rings, full disks, and
 * directories that hold something already. */
#include "base/whole_file.h"
#include "rt/recording/recorder.h"

#include "canbus/candump.h"
#include "tests/test.h"

#include <fcntl.h>
#include <pthread.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

static struct error error;
static struct recorder_counters counters;

struct fixture {
    char directory[64];
    struct arena arena;
    struct recorder_config config;
};

static const char *const buses[] = {"can0", "can1"};
static const char *const signals[] = {"q_rad", "torque_nm"};

static void set_up(struct fixture *f)
{
    strcpy(f->directory, "/tmp/recorder-test-XXXXXX");
    assert_non_null(mkdtemp(f->directory));
    assert_ok(arena_init(&f->arena, (size_t)64 << 20, &error));
    f->config = (struct recorder_config){
        .directory = f->directory,
        .lossless = true,
        .nbus = 2,
        .bus = buses,
        .nsignal = 2,
        .signal = signals,
    };
}

static void tear_down(struct fixture *f)
{
    folder_remove(f->directory);
    arena_fini(&f->arena);
}

BENCH(set_up, struct fixture, tear_down)

static const char *path_in(const struct fixture *f, const char *name)
{
    static char path[400];

    snprintf(path, sizeof path, "%s/%s", f->directory, name);
    return path;
}

static struct recorder *open_recorder(struct fixture *f)
{
    struct recorder *recorder;

    assert_ok(recorder_open(&f->config, &f->arena, &recorder, &error));
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

/* And every one of them is whole */
static uint64_t lines_in(const struct fixture *f, const char *name)
{
    FILE *file = fopen(path_in(f, name), "r");
    uint64_t count = 0;
    int c, last = '\n';

    assert_non_null(file);
    while ((c = getc(file)) != EOF) {
        count += c == '\n';
        last = c;
    }
    fclose(file);
    assert_int_equal(last, '\n');
    return count;
}

TEST_ON(every_frame_is_in_the_log_in_order, set_up, f)
{
    struct candump_reader reader CLOSED_BY(candump_close);
    struct recorder *recorder;
    struct bus_frame frame;
    char bus[16];
    bool end = false;

    /* A ring far smaller than what goes through it */
    f->config.frame_ring = 64;
    recorder = open_recorder(f);
    record_frames(recorder, 20000);
    assert_ok(recorder_close(recorder, &counters, &error));
    assert_int_equal(counters.frames, 20000);
    assert_int_equal(counters.frames_dropped, 0);
    assert_int_equal(counters.frames_unwritten, 0);
    assert_ok(candump_open(&reader, path_in(f, "candump.log"), &error));
    for (uint32_t i = 0; i < 20000; i++) {
        assert_ok(candump_next(&reader, &frame, bus, &end, &error));
        assert_false(end);
        assert_int_equal(frame.id, i % 0x800);
        assert_int_equal(get_u32_le(frame.data), i);
        assert_int_equal(frame.time_ns, (int64_t)i * 1000000);
        assert_string_equal(bus, buses[i % 2]);
    }
    assert_ok(candump_next(&reader, &frame, bus, &end, &error));
    assert_true(end);
}

TEST_ON(rows_have_titles_and_a_time_in_seconds, set_up, f)
{
    struct recorder *recorder = open_recorder(f);
    char line[200];
    FILE *csv;

    recorder_row(recorder, 0, (const double[]){0.5, -1e-9});
    recorder_row(recorder, 1234567000, (const double[]){1.0 / 3.0, 1e300});
    assert_ok(recorder_close(recorder, &counters, &error));
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

TEST_ON(a_full_ring_drops_and_counts_when_the_loop_may_not_wait, set_up, f)
{
    struct recorder *recorder;

    f->config.lossless = false;
    f->config.frame_ring = 16;
    recorder = open_recorder(f);
    record_frames(recorder, 200000);
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "did not keep up"));
    assert_int_equal(counters.frames + counters.frames_dropped, 200000);
    assert_int_equal(lines_in(f, "candump.log"), counters.frames);
    assert_true(counters.frames >= 16);
    assert_true(counters.frames_dropped > 0);
}

TEST_ON(a_full_disk_is_reported_once_and_the_loop_goes_on, set_up, f)
{
    struct recorder *recorder;

    assert_int_equal(symlink("/dev/full", path_in(f, "candump.log")), 0);
    f->config.overwrite = true;
    recorder = open_recorder(f);
    record_frames(recorder, 50000);
    recorder_row(recorder, 0, (const double[]){1.0, 2.0});
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "candump.log"));
    assert_non_null(strstr(error.text, "No space left"));
    assert_int_equal(counters.frames, 50000);
    assert_int_equal(counters.frames_unwritten, 50000);
    assert_int_equal(counters.rows_unwritten, 0);
    /* The other file is whole */
    {
        struct stat info;

        assert_int_equal(stat(path_in(f, "signals.csv"), &info), 0);
        assert_int_equal(info.st_size, strlen("time_s,q_rad,torque_nm\n0.000000,1,2\n"));
    }
}

/* Records until the recorder has something to say of a kind; false when it never does. */
static bool comes_to_say(struct recorder *recorder, const char *part)
{
    for (int i = 0; i < 2000; i++) {
        char text[800];
        unsigned kind;

        record_frames(recorder, 10);
        while (recorder_next_event(recorder, &kind, text, sizeof text)) {
            assert_true(kind < RECORDER_EVENTS);
            if (strstr(text, part)) {
                return true;
            }
        }
        usleep(5000);
    }
    return false;
}

TEST_ON(the_failure_is_told_once, set_up, f)
{
    struct recorder *recorder;
    char text[800];
    unsigned kind;

    assert_int_equal(symlink("/dev/full", path_in(f, "candump.log")), 0);
    f->config.overwrite = true;
    recorder = open_recorder(f);
    assert_true(comes_to_say(recorder, "No space left"));
    record_frames(recorder, 1000);
    assert_false(recorder_next_event(recorder, &kind, text, sizeof text));
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_SYSTEM);
}

TEST_ON(a_file_that_may_not_grow_ends_with_a_whole_line, set_up, f)
{
    struct rlimit before, tight = {.rlim_cur = 123457};
    struct recorder *recorder;
    struct stat info;

    getrlimit(RLIMIT_FSIZE, &before);
    tight.rlim_max = before.rlim_max;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &tight), 0);
    recorder = open_recorder(f);
    record_frames(recorder, 20000);
    recorder_row(recorder, 0, (const double[]){1.0, 2.0});
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_SYSTEM);
    setrlimit(RLIMIT_FSIZE, &before);
    assert_non_null(strstr(error.text, "candump.log"));
    assert_non_null(strstr(error.text, "File too large"));
    assert_int_equal(stat(path_in(f, "candump.log"), &info), 0);
    assert_in_range(info.st_size, 123457 - CANDUMP_LINE_MAX, 123457);
    assert_int_equal(counters.frames, 20000);
    assert_in_range(counters.frames_unwritten, 1, 19999);
    assert_int_equal(lines_in(f, "candump.log"), 20000 - counters.frames_unwritten);
    assert_int_equal(lines_in(f, "signals.csv"), 2);
    assert_int_equal(counters.rows_unwritten, 0);
}

TEST_ON(what_is_recorded_is_on_the_disk_soon, set_up, f)
{
    struct recorder *recorder = open_recorder(f);

    record_frames(recorder, 3);
    recorder_row(recorder, 0, (const double[]){1.0, 2.0});
    for (int i = 0; i < 2000 && lines_in(f, "candump.log") + lines_in(f, "signals.csv") < 5; i++) {
        usleep(5000);
    }
    assert_int_equal(lines_in(f, "candump.log"), 3);
    assert_int_equal(lines_in(f, "signals.csv"), 2);
    assert_ok(recorder_close(recorder, &counters, &error));
}

TEST_ON(a_removed_file_is_noticed_and_given_up, set_up, f)
{
    struct recorder *recorder = open_recorder(f);

    record_frames(recorder, 100);
    recorder_row(recorder, 0, (const double[]){1.0, 2.0});
    unlink(path_in(f, "candump.log"));
    assert_true(comes_to_say(recorder, "was removed"));
    record_frames(recorder, 100);
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "candump.log was removed"));
    assert_int_equal(access(path_in(f, "candump.log"), F_OK), -1);
    assert_int_equal(counters.frames_unwritten, counters.frames);
    assert_int_equal(counters.rows_unwritten, 0);
    assert_int_equal(lines_in(f, "signals.csv"), 2);
}

TEST_ON(a_file_removed_at_the_last_moment_is_noticed_too, set_up, f)
{
    struct recorder *recorder = open_recorder(f);

    recorder_row(recorder, 0, (const double[]){1.0, 2.0});
    unlink(path_in(f, "signals.csv"));
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "signals.csv was removed"));
    assert_int_equal(counters.rows_unwritten, 1);
}

TEST_ON(a_renamed_file_is_noticed_and_goes_on, set_up, f)
{
    struct recorder *recorder = open_recorder(f);
    char path[400];

    record_frames(recorder, 100);
    snprintf(path, sizeof path, "%s", path_in(f, "candump.log.1"));
    assert_int_equal(rename(path_in(f, "candump.log"), path), 0);
    assert_true(comes_to_say(recorder, "another name"));
    record_frames(recorder, 100);
    assert_ok(recorder_close(recorder, &counters, &error));
    assert_int_equal(lines_in(f, "candump.log.1"), counters.frames);
    assert_int_equal(access(path_in(f, "candump.log"), F_OK), -1);
}

/* ---- a pipe in the place of the log: a disk that does what we want ---- */

/* The reading end, with room for a page */
static int make_pipe(const struct fixture *f)
{
    int descriptor;

    assert_int_equal(mkfifo(path_in(f, "candump.log"), 0600), 0);
    descriptor = open(path_in(f, "candump.log"), O_RDONLY | O_NONBLOCK);
    assert_true(descriptor >= 0);
    assert_true(fcntl(descriptor, F_SETPIPE_SZ, 4096) >= 4096);
    return descriptor;
}

/* Whole lines that wait in a pipe */
static uint64_t lines_waiting(int descriptor)
{
    char text[4096];
    uint64_t count = 0;
    ssize_t size;

    while ((size = read(descriptor, text, sizeof text)) > 0) {
        for (ssize_t i = 0; i < size; i++) {
            count += text[i] == '\n';
        }
    }
    return count;
}

TEST_ON(a_pipe_that_nobody_reads_is_refused, set_up, f)
{
    struct recorder *recorder;

    assert_int_equal(mkfifo(path_in(f, "candump.log"), 0600), 0);
    f->config.overwrite = true;
    assert_int_equal(recorder_open(&f->config, &f->arena, &recorder, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "nobody reads"));
}

TEST_ON(in_real_time_a_disk_that_hangs_costs_frames_and_no_time, set_up, f)
{
    struct recorder *recorder;
    int pipe;

    f->config.overwrite = true;
    f->config.lossless = false;
    f->config.frame_ring = 1024;
    f->config.stall_ns = 200000000;
    pipe = make_pipe(f);
    recorder = open_recorder(f);
    record_frames(recorder, 100000);
    assert_true(comes_to_say(recorder, "does not keep up"));
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "candump.log"));
    assert_true(counters.frames >= 1024);
    assert_true(counters.frames_dropped > 90000);
    assert_int_equal(lines_waiting(pipe), counters.frames - counters.frames_unwritten);
    close(pipe);
}

TEST_ON(in_virtual_time_a_disk_that_hangs_is_given_up, set_up, f)
{
    struct recorder *recorder;
    int pipe;

    f->config.overwrite = true;
    f->config.frame_ring = 1024;
    f->config.stall_ns = 200000000;
    pipe = make_pipe(f);
    recorder = open_recorder(f);
    record_frames(recorder, 100000);
    recorder_row(recorder, 0, (const double[]){1.0, 2.0});
    assert_true(comes_to_say(recorder, "took nothing for 0.2 s"));
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_SYSTEM);
    assert_true(counters.frames_dropped > 90000);
    assert_int_equal(counters.rows_dropped, 1);
    assert_int_equal(lines_waiting(pipe), counters.frames - counters.frames_unwritten);
    close(pipe);
}

struct slow_reader {
    int pipe;
    uint64_t lines;
};

/* A page every 2 ms */
static void *read_slowly(void *context)
{
    struct slow_reader *reader = context;
    char text[4096];
    ssize_t size;

    fcntl(reader->pipe, F_SETFL, 0);
    while ((size = read(reader->pipe, text, sizeof text)) > 0) {
        for (ssize_t i = 0; i < size; i++) {
            reader->lines += text[i] == '\n';
        }
        usleep(2000);
    }
    return NULL;
}

TEST_ON(in_virtual_time_a_slow_disk_is_waited_for, set_up, f)
{
    struct slow_reader reader = {0};
    struct recorder *recorder;
    pthread_t thread;

    f->config.overwrite = true;
    f->config.frame_ring = 64;
    reader.pipe = make_pipe(f);
    recorder = open_recorder(f);
    assert_int_equal(pthread_create(&thread, NULL, read_slowly, &reader), 0);
    record_frames(recorder, 20000);
    assert_ok(recorder_close(recorder, &counters, &error));
    pthread_join(thread, NULL);
    assert_int_equal(counters.frames, 20000);
    assert_int_equal(reader.lines, 20000);
    close(reader.pipe);
}

TEST_ON(a_reader_that_goes_away_is_an_error_and_no_signal, set_up, f)
{
    struct recorder *recorder;
    int pipe;

    f->config.overwrite = true;
    pipe = make_pipe(f);
    recorder = open_recorder(f);
    record_frames(recorder, 10);
    close(pipe);
    assert_true(comes_to_say(recorder, "Broken pipe"));
    assert_int_equal(recorder_close(recorder, &counters, &error), ERROR_SYSTEM);
    assert_int_equal(counters.frames_dropped, 0);
    assert_true(counters.frames_unwritten > 0);
}

TEST_ON(a_directory_that_holds_something_is_refused, set_up, f)
{
    struct recorder *recorder;

    fclose(fopen(path_in(f, "precious"), "w"));
    assert_int_equal(recorder_open(&f->config, &f->arena, &recorder, &error), ERROR_INPUT);
    assert_non_null(strstr(error.text, "not empty"));
    assert_int_not_equal(access(path_in(f, "candump.log"), F_OK), 0);
    f->config.overwrite = true;
    recorder = open_recorder(f);
    assert_ok(recorder_close(recorder, &counters, &error));
    assert_int_equal(access(path_in(f, "precious"), F_OK), 0);
}

/* Its logs are overwritten, so it describes nothing any more. */
TEST_ON(the_summary_of_an_earlier_recording_goes_with_it, set_up, f)
{
    struct recorder *recorder;

    fclose(fopen(path_in(f, RECORDER_SUMMARY), "w"));
    f->config.overwrite = true;
    recorder = open_recorder(f);
    assert_int_equal(access(path_in(f, RECORDER_SUMMARY), F_OK), -1);
    assert_ok(recorder_close(recorder, &counters, &error));
}

/* /dev/full above: a link to a device overwrites nothing. */
TEST_ON(links_to_files_are_not_followed, set_up, f)
{
    char precious[400], line[16] = "";
    struct recorder *recorder;
    FILE *file;

    snprintf(precious, sizeof precious, "%s", path_in(f, "precious"));
    file = fopen(precious, "w");
    fputs("kept", file);
    fclose(file);
    f->config.overwrite = true;
    for (int n = 0; n < 2; n++) {
        /* The second one dangles: nothing is created where it points to */
        assert_int_equal(symlink(n ? "new" : precious, path_in(f, "signals.csv")), 0);
        assert_int_equal(recorder_open(&f->config, &f->arena, &recorder, &error), ERROR_INPUT);
        assert_non_null(strstr(error.text, "symbolic link"));
        unlink(path_in(f, "signals.csv"));
    }
    assert_int_equal(access(path_in(f, "new"), F_OK), -1);
    file = fopen(precious, "r");
    assert_non_null(fgets(line, sizeof line, file));
    fclose(file);
    assert_string_equal(line, "kept");
}

TEST_ON(impossible_directories_are_errors, set_up, f)
{
    struct recorder *recorder;
    char path[400];

    snprintf(path, sizeof path, "%s/no/such", f->directory);
    f->config.directory = path;
    assert_int_equal(recorder_open(&f->config, &f->arena, &recorder, &error), ERROR_SYSTEM);
    snprintf(path, sizeof path, "%s/file", f->directory);
    fclose(fopen(path, "w"));
    assert_int_equal(recorder_open(&f->config, &f->arena, &recorder, &error), ERROR_SYSTEM);
    assert_non_null(strstr(error.text, "Not a directory"));
}

TEST_ON(a_directory_is_made, set_up, f)
{
    struct recorder *recorder;

    rmdir(f->directory);
    recorder = open_recorder(f);
    assert_ok(recorder_close(recorder, &counters, &error));
    assert_int_equal(access(path_in(f, "candump.log"), F_OK), 0);
}
