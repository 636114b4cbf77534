/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Of a log, the frames that the boards of the rig do not send are played: on COMAN's icub boards,
 * where a rig has external ones, and where identifiers have 29 bits. The wanted identifiers are
 * written by the protocols' pages.
 */
#include "sim/stimulus.h"
#include "tests/test.h"

#include <unistd.h>

static struct arena arena;
static struct error error;
static char folder[] = "/tmp/stimulus-XXXXXX";
static char path[64];
static struct stimulus stimulus;

/* ---- the log and its reading ---- */

FIXTURE(set_up)
{
    if (arena_init(&arena, (size_t)256 << 20, &error) || !mkdtemp(folder)) {
        return -1;
    }
    snprintf(path, sizeof path, "%s/candump.log", folder);
    return 0;
}

FIXTURE(tear_down)
{
    unlink(path);
    rmdir(folder);
    strcpy(folder + strlen(folder) - 6, "XXXXXX");
    arena_fini(&arena);
    return 0;
}

static enum error_code load_from(const char *where, const char *name, bool lockstep,
                                 const char *text)
{
    const char *interface[RIG_BUSES_MAX];
    const struct rig *rig;
    char file[512];
    FILE *log = fopen(path, "w");

    assert_non_null(log);
    assert_true(fputs(text, log) >= 0 && fclose(log) == 0);
    snprintf(file, sizeof file, "%s/config/rigs/%s.yaml", HIL_SOURCE_DIR, name);
    assert_ok(rig_load(file, &arena, &rig, &error));
    for (size_t b = 0; b < rig->nbus; b++) {
        interface[b] = rig->bus[b].interface;
    }
    return stimulus_load(where, rig, interface, lockstep, &arena, &stimulus, &error);
}

static void load(const char *name, bool lockstep, const char *text)
{
    assert_no_error(load_from(path, name, lockstep, text), error.text);
}

/* The log is refused: message is what follows the name of its file. */
static void refused(bool lockstep, const char *text, const char *message)
{
    char expected[512];

    assert_int_equal(load_from(path, "coman", lockstep, text), ERROR_INPUT);
    snprintf(expected, sizeof expected, "%s:%s", path, message);
    assert_string_equal(error.text, expected);
}

static void assert_played(size_t bus, size_t index, uint32_t id, int64_t time_ns)
{
    assert_true(index < stimulus.count[bus]);
    assert_int_equal(stimulus.frame[bus][index].id, id);
    assert_int_equal(stimulus.frame[bus][index].time_ns, time_ns);
}

/* ---- what is played ---- */

/* can0 is the torso, with motor boards 1 and 2, can1 the left leg: what the host sends to them
 * (0x001, 0x002) is played on the bus that the interface, or the bus itself, names; what boards
 * send (0x11a, 0x12a) is not, nor are errors, nor STEP and DONE (0x6f0, 0x6ff). */
TEST_WITH(frames_of_a_controller_are_played, set_up, tear_down)
{
    load("coman", false,
         "(0.001000) can0 001#07\n(0.002000) can0 11A#0102030405060708\n"
         "(0.003000) can1 002#08\n(0.003500) can0 6F0#01000000\n(0.004000) torso 002#09\n"
         "(0.004000) can0 20000004#0000000000000000\n(0.004500) can0 6FF#01000000\n"
         "(0.005000) can0 00000001#07\n(0.006000) can0 12A#00\n");
    assert_int_equal(stimulus.count[0], 3);
    assert_played(0, 0, 0x001, 1000000);
    assert_played(0, 1, 0x002, 4000000);
    assert_played(0, 2, 0x001, 5000000); /* another one, of 29 bits */
    assert_true(stimulus.frame[0][2].flags & FRAME_EXTENDED);
    assert_int_equal(stimulus.frame[0][0].data[0], 7);
    assert_int_equal(stimulus.count[1], 1);
    assert_played(1, 0, 0x002, 3000000);
    for (size_t b = 2; b < 5; b++) {
        assert_int_equal(stimulus.count[b], 0);
    }
    assert_int_equal(stimulus.start_ns, 0);
    assert_int_equal(stimulus.end_ns, 6000000); /* of a board's frame */
}

TEST_WITH(steps_are_played_to_a_clock_that_waits_for_them, set_up, tear_down)
{
    load("coman", true,
         "(0.001000) can0 6F0#01000000\n(0.001000) can1 6F0#01000000\n"
         "(0.002000) can0 6FF#01000000\n");
    assert_int_equal(stimulus.count[0], 1);
    assert_played(0, 0, 0x6f0, 1000000);
    assert_int_equal(stimulus.count[1], 0); /* STEP is for the torso's bus */
    refused(true, "(0.001000) can1 001#07\n",
            " found no STEP frame, expected some with the lockstep clock; --clock free plays what "
            "was recorded in real time");
}

TEST_WITH(a_log_of_the_wall_clock_begins_with_the_run, set_up, tear_down)
{
    load("coman", false,
         "(1700000000.250000) can0 11A#0102030405060708\n(1700000000.750000) can0 001#07\n");
    assert_int_equal(stimulus.start_ns, INT64_C(1700000000250000000));
    assert_played(0, 0, 0x001, 500000000);
    assert_int_equal(stimulus.end_ns, 500000000);
    load("coman", false, "(99999999.000000) can0 001#07\n"); /* three years: a run's own time */
    assert_int_equal(stimulus.start_ns, 0);
    assert_played(0, 0, 0x001, INT64_C(99999999000000000));
}

/* The boards of the left hip are real: what they send is played, what the shank does is not. */
TEST_WITH(frames_of_external_boards_are_played, set_up, tear_down)
{
    load("coman-rest-bus", false,
         "(0.001000) left_hip 110#0000000000000000\n(0.002000) left_hip 130#0000000000000000\n"
         "(0.003000) left_shank 110#0000000000000000\n(0.004000) left_hip 001#0000\n");
    assert_int_equal(stimulus.count[0], 3);
    assert_played(0, 0, 0x110, 1000000);
    assert_played(0, 1, 0x130, 2000000);
    assert_played(0, 2, 0x001, 4000000);
    assert_int_equal(stimulus.count[1], 0);
}

/* A RobStride motor answers with type 2, whatever is in the bits of its state; the host commands
 * with type 1, in whose identifier is a torque. */
TEST_WITH(identifiers_of_29_bits_are_told_apart, set_up, tear_down)
{
    load("coman-robstride", false,
         "(0.001000) can0 018001FD#00\n(0.002000) can0 020001FD#0000000000000000\n"
         "(0.003000) can0 028F01FD#0000000000000000\n(0.004000) can0 0300FD01#0000000000000000\n");
    assert_int_equal(stimulus.count[0], 2);
    assert_played(0, 0, 0x018001fd, 1000000);
    assert_played(0, 1, 0x0300fd01, 4000000);
}

/* A controller asks for a frame of a board with a remote frame of the same identifier: by 11 and by
 * 29 bits. */
TEST_WITH(remote_frames_are_the_controllers, set_up, tear_down)
{
    load("coman", false, "(0.001000) can0 11A#R8\n(0.002000) can0 11A#0102030405060708\n");
    assert_int_equal(stimulus.count[0], 1);
    assert_played(0, 0, 0x11a, 1000000);
    assert_true(stimulus.frame[0][0].flags & FRAME_REMOTE);
    load("coman-robstride", false, "(0.001000) can0 020001FD#R\n(0.002000) can0 020001FD#00\n");
    assert_int_equal(stimulus.count[0], 1);
    assert_played(0, 0, 0x020001fd, 1000000);
}

/* The first frame of a log may stand behind a comment. The longest time without a frame, from the
 * start of the run on, and the line at its end are known. */
TEST_WITH(lines_without_a_frame_and_gaps_are_known, set_up, tear_down)
{
    load("coman", false,
         "# mine\n(1700000000.0) can0 001#07\nDROPCOUNT: dropped 1 CAN frames on 'can0' socket\n"
         "(1700000004.0) can0 11A#00\n(1700000004.5) can0 001#08\n(1700000004.6) can0 11A#00\n");
    assert_int_equal(stimulus.start_ns, INT64_C(1700000000000000000));
    assert_string_equal(stimulus.skipped, "2 lines without a frame skipped, the first is line 1; 1 "
                                          "frames were lost when it was written (DROPCOUNT)");
    assert_int_equal(stimulus.gap_ns, INT64_C(4000000000));
    assert_int_equal(stimulus.gap_line, 4);
    assert_int_equal(stimulus.last_ns, INT64_C(4500000000));
    assert_int_equal(stimulus.end_ns, INT64_C(4600000000));
    load("coman", false, "(5.0) can0 001#07\n(6.0) can0 001#07\n");
    assert_int_equal(stimulus.gap_ns, INT64_C(5000000000));
    assert_int_equal(stimulus.gap_line, 1);
    assert_string_equal(stimulus.skipped, "");
}

TEST_WITH(a_folder_has_its_log, set_up, tear_down)
{
    assert_ok(load_from(folder, "coman", false, "(0.001000) can0 001#07\n"));
    assert_int_equal(stimulus.count[0], 1);
}

/* ---- what is refused ---- */

TEST_WITH(a_log_that_cannot_be_played_is_refused, set_up, tear_down)
{
    refused(false, "(0.001000) can0 001#07\n(0.002000) vcan7 001#07\n",
            "2: found a frame on vcan7, expected an interface or a bus of " HIL_SOURCE_DIR
            "/config/rigs/coman.yaml; --bus NAME=vcan7 says which it is");
    refused(false, "(0.002000) can0 001#07\n(0.001500) can1 001#07\n(0.001000) can0 001#07\n",
            "3: found a frame 0.001000 s earlier than the one before it on torso: the clock of the "
            "log stepped back; expected later times from this line on, in the same order: awk 'NR "
            ">= 3 { $1 = sprintf(\"(%.6f)\", substr($1, 2) + 0.001000) } 1' makes them");
    refused(false, "(0.001000) can0 001#07\n(100000000.000000) can0 001#07\n",
            "2: found a time 100000000 s after the start of the log, expected less than 100000000 "
            "s");
    refused(false, "(0.001000) can0 11A#00\n", " found no frame of a controller, expected some");
    refused(false, "  can0  001   [1]  07\n",
            " found no frame of a controller, expected some; 1 line without a frame skipped, the "
            "first is line 1");
    assert_int_equal(load_from("/nowhere", "coman", false, ""), ERROR_INPUT);
}
