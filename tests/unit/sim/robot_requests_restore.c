/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Going back in time with whole robots: what follows a checkpoint follows it again, frame by frame
 * and bit by bit of the plant's state. A guest on every bus notes what is sent; requests are made
 * by an observer, in the loop's own thread, so that all happens at known ticks.
 */
#include "tests/unit/sim/robot_requests_scene.h"

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
    print_message("%s: %llu frames again\n", scene->rig, (unsigned long long)frames);
    close_scene(&w, &arena);
}

/* Rigs of every kind; drives with play, hysteresis, heat, friction that rests, a supply and its
 * chopper, all of which have states; noise and faults on wires; free bodies; resets. */
TEST(what_follows_a_checkpoint_follows_it_again)
{
    const enum loop_clock alone = LOOP_CLOCK_FREE, lockstep = LOOP_CLOCK_LOCKSTEP;
    const struct scene scenes[] = {
        {.rig = "coman", .task = "squat", .clock = alone, .at = 300, .span = 400},
        {.rig = "coman", .task = "squat", .clock = lockstep, .at = 251, .span = 300},
        {.rig = "coman", .task = "squat", .clock = alone, .generic = true, .at = 300, .span = 100},
        {.rig = "coman", .task = "squat", .clock = alone, .simbody = true, .at = 40, .span = 40},
        {.rig = "coman-drives",
         .task = "squat",
         .clock = alone,
         .at = 700,
         .span = 400,
         .fault = {"supply sag 40 0.75..0.8", "motor LKneeSag jam 0.9.."}},
        {.rig = "coman-drives", .task = "squat", .clock = alone, .generic = true, .span = 300},
        {.rig = "coman-sensors",
         .task = "squat",
         .clock = alone,
         .timed = true,
         .fault = {"bus left_leg error_burst 0.02", "bus right_leg duplicate 0.1",
                   "bus right_arm late 0.0023", "bus left_arm loss 0.05", "sensor imu intermittent",
                   "bus torso bus_off 0.40..0.65", "motor LElbj jam 0.45..",
                   "sensor LKneeSag.torque garbage 3"},
         .at = 300,
         .span = 400},
        {.rig = "coman-sensors",
         .task = "squat",
         .clock = lockstep,
         .timed = true,
         .fault = {"bus left_leg error_burst 0.02 0.1..", "bus right_arm late 0.0023",
                   "sensor imu intermittent", "sensor LKneeSag.torque garbage 3 0.1..0.15"},
         .span = 200},
        {.rig = "grasp", .task = "grasp", .clock = alone, .at = 300, .span = 60},
        {.rig = "grasp", .task = "grasp", .clock = alone, .span = 250},
        {.rig = "coman-compact", .task = "squat", .clock = alone, .at = 300, .span = 200},
        {.rig = "coman-cia402", .task = "squat", .clock = alone, .at = 60, .span = 200},
        {.rig = "coman-foc", .task = "squat", .clock = alone, .at = 300, .span = 200},
        {.rig = "coman-fd", .task = "squat", .clock = alone, .timed = true, .at = 300, .span = 200},
    };

    for (size_t i = 0; i < sizeof scenes / sizeof scenes[0]; i++) {
        repeats(&scenes[i]);
    }
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
