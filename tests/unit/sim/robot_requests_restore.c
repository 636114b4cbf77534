/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Going back in time with whole robots: what follows a checkpoint follows it again, frame by frame
 * and bit by bit of the plant's state. A guest on every bus notes what is sent; requests are made
 * by an observer, in the loop's own thread, so that all happens at known ticks.
 */
#include "tests/unit/sim/robot_requests_scene.h"

#include <time.h>

static void take_answers(struct witness *w, int64_t tick)
{
    struct request_answer answer;

    while (requests_answer(simulator_requests(w->simulator), &answer)) {
        if (answer.verdict != REQUEST_OK) {
            fail_msg("%s: %s", w->scene->rig, request_verdict_text(answer.verdict));
        }
        assert_int_equal((int64_t)answer.tick, tick);
        if (w->scene->at > 0 && answer.ticket == 1) {
            w->checkpoint = answer;
        } else {
            assert_true(w->scene->at == 0 || answer.state_hash == w->checkpoint.state_hash);
            w->goes++;
            w->pass = w->again;
        }
        w->asked = false;
    }
}

static void step(void *context, int64_t time_ns)
{
    struct witness *w = context;
    int64_t tick = time_ns / w->tick_ns;
    bool back;

    if (tick == w->tick) {
        return; /* lockstep: no STEP has come yet */
    }
    back = w->asked && tick <= w->tick;
    if (w->tick >= 0 && !back) {
        assert_true(w->tick < TICKS_MAX);
        note(w, &w->pass[w->tick]);
    } else {
        struct pass unused;

        note(w, &unused); /* of the tick that was undone */
    }
    w->tick = tick;
    take_answers(w, tick);
    if (tick == (int64_t)w->scene->at - 1 && w->goes == 0) {
        w->asked = true;
        ask(w, REQUEST_CHECKPOINT, 1);
    } else if (tick == (int64_t)(w->scene->at + w->scene->span) && w->goes == 0) {
        w->asked = true;
        ask(w, w->scene->at == 0 ? REQUEST_RESET : REQUEST_RESTORE, 1);
    }
}

/* What ports have lost is counted on, whatever time does. */
static void no_frames_came_back_to_life(struct simulator *simulator)
{
    char text[256];
    uint64_t key;

    while (simulator_next_event(simulator, &key, text, sizeof text)) {
        const char *lost = strstr(text, ": lost ");
        long long received, sent;

        if (lost &&
            sscanf(lost, ": lost %lld frames on receiving and %lld", &received, &sent) == 2) {
            assert_true(received >= 0 && sent >= 0);
        }
    }
}

static void repeats(const struct scene *scene)
{
    static struct witness w;
    const struct simulator_observer observer = {&w, step};
    struct arena arena;
    struct rig rig;
    uint64_t frames = 0;

    open_scene(scene, &w, &arena, &rig, &observer, scene->at + scene->span + 2, true);
    simulator_run(w.simulator);
    assert_int_equal(w.goes, 1);
    for (uint64_t t = scene->at; t < scene->at + scene->span; t++) {
        const struct pass *a = &w.first[t], *b = &w.again[t];

        if (a->frames != b->frames || a->count != b->count || a->plant != b->plant ||
            a->measured != b->measured) {
            fail_msg("%s: tick %llu differs the second time: frames %d (%llu and %llu), plant %d, "
                     "measured %d",
                     scene->rig, (unsigned long long)t, a->frames != b->frames,
                     (unsigned long long)a->count, (unsigned long long)b->count,
                     a->plant != b->plant, a->measured != b->measured);
        }
        assert_true(t == 0 || a->plant != w.first[t - 1].plant); /* it moves */
        frames += a->count;
    }
    assert_true(frames > scene->span);
    no_frames_came_back_to_life(w.simulator);
    print_message("%s: %llu frames again, %zu bytes a checkpoint\n", scene->rig,
                  (unsigned long long)frames, simulator_checkpoint_size(w.simulator));
    close_scene(&w, &arena);
}

TEST(repeats_a_squat_on_ideal_buses)
{
    const struct scene scene = {
        .rig = "coman", .task = "squat", .clock = LOOP_CLOCK_FREE, .at = 300, .span = 400};

    repeats(&scene);
}

TEST(repeats_a_squat_in_lockstep)
{
    const struct scene scene = {
        .rig = "coman", .task = "squat", .clock = LOOP_CLOCK_LOCKSTEP, .at = 251, .span = 300};

    repeats(&scene);
}

TEST(repeats_a_squat_with_numeric_dynamics)
{
    const struct scene scene = {.rig = "coman",
                                .task = "squat",
                                .clock = LOOP_CLOCK_FREE,
                                .generic = true,
                                .at = 300,
                                .span = 100};

    repeats(&scene);
}

/* Play, hysteresis, heat, friction that rests, the supply and its chopper all have states, and the
 * flags and orders among them: while the robot comes to stand and squats, and while the supply sags
 * and comes back. */
TEST(repeats_drives_with_all_that_is_real_in_them)
{
    const struct scene scenes[] = {
        {.rig = "coman-drives",
         .task = "squat",
         .clock = LOOP_CLOCK_FREE,
         .at = 700,
         .span = 400,
         .fault = {"supply sag 40 0.75..0.8", "motor LKneeSag jam 0.9.."}},
        {.rig = "coman-drives",
         .task = "squat",
         .clock = LOOP_CLOCK_FREE,
         .generic = true,
         .at = 0,
         .span = 300},
    };

    repeats(&scenes[0]);
    repeats(&scenes[1]);
}

TEST(repeats_noise_and_faults_on_wires)
{
    const struct scene scene = {
        .rig = "coman-sensors",
        .task = "squat",
        .clock = LOOP_CLOCK_FREE,
        .timed = true,
        .fault = {"bus left_leg error_burst 0.02", "bus right_leg duplicate 0.1",
                  "bus right_arm late 0.0023", "bus left_arm loss 0.05", "sensor imu intermittent",
                  "bus torso bus_off 0.40..0.65", "motor LElbj jam 0.45..",
                  "sensor LKneeSag.torque garbage 3"},
        .at = 300,
        .span = 400,
    };

    repeats(&scene);
}

TEST(repeats_a_grasp_with_free_bodies)
{
    const struct scene scene = {
        .rig = "grasp", .task = "grasp", .clock = LOOP_CLOCK_FREE, .at = 300, .span = 60};

    repeats(&scene);
}

TEST(a_reset_in_a_grasp_begins_it_again)
{
    const struct scene scene = {
        .rig = "grasp", .task = "grasp", .clock = LOOP_CLOCK_FREE, .at = 0, .span = 250};

    repeats(&scene);
}

TEST(a_reset_begins_noise_and_faults_again)
{
    const struct scene scene = {
        .rig = "coman-sensors",
        .task = "squat",
        .clock = LOOP_CLOCK_LOCKSTEP,
        .timed = true,
        .fault = {"bus left_leg error_burst 0.02 0.1..", "bus right_arm late 0.0023",
                  "sensor imu intermittent", "sensor LKneeSag.torque garbage 3 0.1..0.15"},
        .at = 0,
        .span = 200,
    };

    repeats(&scene);
}

/* Another thread reads what has happened, perhaps only after the run went back: two events of the
 * first pass, and the same of the second. */
TEST(events_from_before_going_back_are_still_told)
{
    static const char *const told[] = {
        "0.020000 s: fault 1 begins: supply sag 10 0.02..0.04",
        "0.040000 s: fault 1 ends: supply sag 10 0.02..0.04",
    };
    const struct scene scene = {.rig = "coman",
                                .clock = LOOP_CLOCK_FREE,
                                .no_contact = true,
                                .fault = {"supply sag 10 0.02..0.04"},
                                .at = 10,
                                .span = 50};
    static struct witness w;
    const struct simulator_observer observer = {&w, step};
    struct arena arena;
    struct rig rig;
    char text[256];
    uint64_t key;
    int count = 0;

    open_scene(&scene, &w, &arena, &rig, &observer, scene.at + scene.span + 2, true);
    simulator_run(w.simulator);
    assert_int_equal(w.goes, 1);
    while (simulator_next_event(w.simulator, &key, text, sizeof text)) {
        if (strstr(text, "fault ")) {
            assert_string_equal(text, told[count++ % 2]);
        }
    }
    assert_int_equal(count, 4);
    close_scene(&w, &arena);
}

TEST(repeats_the_compact_boards)
{
    const struct scene scene = {
        .rig = "coman-compact", .task = "squat", .clock = LOOP_CLOCK_FREE, .at = 300, .span = 200};

    repeats(&scene);
}

TEST(repeats_the_cia402_boards)
{
    const struct scene scene = {
        .rig = "coman-cia402", .task = "squat", .clock = LOOP_CLOCK_FREE, .at = 60, .span = 200};

    repeats(&scene);
}

TEST(repeats_the_foc_boards)
{
    const struct scene scene = {
        .rig = "coman-foc", .task = "squat", .clock = LOOP_CLOCK_FREE, .at = 300, .span = 200};

    repeats(&scene);
}

TEST(repeats_fd_frames)
{
    const struct scene scene = {.rig = "coman-fd",
                                .task = "squat",
                                .clock = LOOP_CLOCK_FREE,
                                .timed = true,
                                .at = 300,
                                .span = 200};

    repeats(&scene);
}

TEST(repeats_on_the_other_contact_engine)
{
    const struct scene scene = {.rig = "coman",
                                .task = "squat",
                                .clock = LOOP_CLOCK_FREE,
                                .simbody = true,
                                .at = 40,
                                .span = 40};

    repeats(&scene);
}

/* ---- what it costs ---- */

enum { COPIES = 50 };

struct stopwatch {
    struct witness w;
    int calls;
    int64_t begin_ns,
        spent_ns[3]; /* a tick; one with checkpoints, with restores of another state */
};

static int64_t wall_ns(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void measure(void *context, int64_t time_ns)
{
    struct stopwatch *stopwatch = context;
    int64_t spent = wall_ns() - stopwatch->begin_ns;
    int call = stopwatch->calls++ - 100;
    struct request_answer answer;

    (void)time_ns;
    if (call >= 0 && call < 3) {
        stopwatch->spent_ns[call] = spent;
    }
    while (requests_answer(simulator_requests(stopwatch->w.simulator), &answer)) {
        assert_int_equal(answer.verdict, REQUEST_OK);
    }
    for (int i = 0; i < COPIES && (call == 0 || call == 1); i++) {
        ask(&stopwatch->w, call == 0 ? REQUEST_CHECKPOINT : REQUEST_RESTORE, 1u - (call & i & 1));
    }
    stopwatch->begin_ns = wall_ns();
}

TEST(prints_what_a_checkpoint_costs)
{
    static const struct scene scenes[] = {
        {.rig = "coman", .task = "squat", .clock = LOOP_CLOCK_FREE},
        {.rig = "coman", .task = "squat", .clock = LOOP_CLOCK_FREE, .timed = true},
        {.rig = "grasp", .task = "grasp", .clock = LOOP_CLOCK_FREE},
    };

    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; i++) {
        static struct stopwatch stopwatch;
        const struct simulator_observer observer = {&stopwatch, measure};
        struct arena arena;
        struct rig rig;

        memset(&stopwatch, 0, sizeof stopwatch);
        open_scene(&scenes[i], &stopwatch.w, &arena, &rig, &observer, 110, true);
        simulator_run(stopwatch.w.simulator);
        print_message("%s%s: %zu bytes, %.0f us to keep, %.0f us to go back\n", scenes[i].rig,
                      scenes[i].timed ? " on wires" : "",
                      simulator_checkpoint_size(stopwatch.w.simulator),
                      (double)(stopwatch.spent_ns[1] - stopwatch.spent_ns[0]) * 1e-3 / COPIES,
                      (double)(stopwatch.spent_ns[2] - stopwatch.spent_ns[0]) * 1e-3 / COPIES);
        close_scene(&stopwatch.w, &arena);
    }
}
