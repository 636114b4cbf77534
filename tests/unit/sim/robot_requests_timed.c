/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A checkpoint inside whatever takes time: a push that is being given, winches that move, faults
 * that are armed or under way. A plain run is the oracle: another one is disturbed after its
 * checkpoint, by requests that begin, change and end such activities, and goes back; from there on
 * it must follow the plain run bit by bit, beyond the end of every activity.
 */
#include "tests/tunables.h"
#include "tests/unit/sim/robot_requests_scene.h"

enum { AT = 50, SPAN = 30, LENGTH = 100 }; /* checkpoint; ticks undone; ticks compared */

struct activity {
    struct scene scene;
    void (*begin)(struct witness *w, int64_t tick);   /* what both runs ask, before AT */
    void (*disturb)(struct witness *w, int64_t tick); /* what is undone */
};

struct timed {
    struct witness w;
    const struct activity *activity;
    bool disturbed;
};

static struct timed timed;
static struct pass plain[AT + LENGTH];

/* ---- requests ---- */

static void ask_push(struct witness *w, size_t body, double x, double y, int64_t ticks)
{
    struct loop_request request = {.kind = REQUEST_PUSH,
                                   .index = body,
                                   .force_n = {x, y, 0.0},
                                   .moment_nm = {0.0, 0.25 * x, 0.5 * y},
                                   .duration_ns = ticks * w->tick_ns};

    assert_true(requests_ask(simulator_requests(w->simulator), &request));
}

static void ask_set(struct witness *w, const char *name, double value)
{
    struct requests *requests = simulator_requests(w->simulator);
    struct loop_request request = {.kind = REQUEST_SET, .value = value};
    int index = requests_find(requests, name);

    assert_true(index >= 0);
    request.index = (size_t)index;
    assert_true(requests_ask(requests, &request));
}

static void ask_fault(struct witness *w, size_t index, bool on)
{
    struct loop_request request = {.kind = REQUEST_FAULT, .index = index, .on = on};

    assert_true(requests_ask(simulator_requests(w->simulator), &request));
}

/* ---- the two runs ---- */

static void turn(void *context, int64_t time_ns)
{
    struct timed *t = context;
    struct witness *w = &t->w;
    int64_t tick = time_ns / w->tick_ns;
    struct request_answer answer;
    struct pass unused;

    while (requests_answer(simulator_requests(w->simulator), &answer)) {
        assert_string_equal(request_verdict_text(answer.verdict), request_verdict_text(REQUEST_OK));
    }
    if (w->tick > tick) {
        w->pass = w->again; /* it went back: the tick before was undone */
        note(w, &unused);
    } else if (w->tick >= 0) {
        note(w, &w->pass[w->tick]);
    }
    w->tick = tick;
    if (tick < AT - 1) {
        t->activity->begin(w, tick);
    }
    if (t->disturbed && w->goes == 0) {
        if (tick == AT - 1) {
            ask(w, REQUEST_CHECKPOINT, 1);
        } else if (tick >= AT && tick < AT + SPAN - 1) {
            t->activity->disturb(w, tick);
        } else if (tick == AT + SPAN - 1) {
            ask(w, REQUEST_RESTORE, 1);
            w->goes++;
        }
    }
}

static void perform(const struct activity *activity, bool disturbed)
{
    const struct simulator_observer observer = {&timed, turn};
    struct arena arena;
    struct rig rig;

    memset(&timed, 0, sizeof timed);
    timed.activity = activity;
    timed.disturbed = disturbed;
    open_scene(&activity->scene, &timed.w, &arena, &rig, &observer, AT + LENGTH + 1, true);
    simulator_run(timed.w.simulator);
    assert_int_equal(timed.w.goes, disturbed);
    close_scene(&timed.w, &arena);
}

static void goes_on_as_if_nothing_had_been(const struct activity *activity)
{
    perform(activity, false);
    memcpy(plain, timed.w.first, sizeof plain);
    perform(activity, true);
    assert_int_equal(timed.w.first[AT - 1].plant, plain[AT - 1].plant);
    assert_true(timed.w.first[AT + SPAN - 2].plant != plain[AT + SPAN - 2].plant); /* disturbed */
    for (size_t t = AT; t < AT + LENGTH; t++) {
        const struct pass *a = &plain[t], *b = &timed.w.again[t];

        if (a->plant != b->plant || a->measured != b->measured || a->frames != b->frames) {
            fail_msg("tick %zu after the way back differs: plant %d, measured %d, frames %d", t,
                     a->plant != b->plant, a->measured != b->measured, a->frames != b->frames);
        }
    }
}

/* ---- pushes ---- */

static void begin_pushes(struct witness *w, int64_t tick)
{
    if (tick == 20) {
        ask_push(w, 0, 30.0, -7.0, 70); /* until after the way back */
        ask_push(w, 3, 0.0, 5.0, 45);   /* ends among the ticks that are undone */
    }
    if (tick == 30) {
        ask_push(w, 5, 2.0, 1.0, 0); /* for ever */
    }
}

static void disturb_pushes(struct witness *w, int64_t tick)
{
    if (tick == AT + 1) {
        ask_push(w, 0, -11.0, 3.0, 10); /* instead of the one that is given; ends */
        ask_push(w, 2, 4.0, 0.0, 0);    /* one that would stay */
        ask_push(w, 6, 0.0, 4.0, 60);   /* one that would last beyond the way back */
    }
    if (tick == AT + 5) {
        ask_push(w, 5, 0.0, 0.0, 0); /* ends the one that is for ever */
    }
}

TEST(a_push_ends_when_it_would_have)
{
    const struct activity activity = {
        .scene = {.rig = "coman", .clock = LOOP_CLOCK_FREE, .no_contact = true, .falls = true},
        .begin = begin_pushes,
        .disturb = disturb_pushes};

    goes_on_as_if_nothing_had_been(&activity);
}

/* All is quiet at the checkpoint: what was asked after it must not come back to life. */
static void begin_nothing(struct witness *w, int64_t tick)
{
    (void)w;
    (void)tick;
}

static void disturb_by_pushes_that_last(struct witness *w, int64_t tick)
{
    if (tick == AT + 1) {
        ask_push(w, 0, 40.0, 0.0, SPAN + 20);
        ask_push(w, 4, 0.0, -3.0, 0);
    }
}

TEST(a_push_of_undone_time_is_undone)
{
    const struct activity activity = {
        .scene = {.rig = "coman", .clock = LOOP_CLOCK_FREE, .no_contact = true, .falls = true},
        .begin = begin_nothing,
        .disturb = disturb_by_pushes_that_last};

    goes_on_as_if_nothing_had_been(&activity);
}

/* ---- winches ---- */

static void begin_winches(struct witness *w, int64_t tick)
{
    if (tick == 20) {
        ask_set(w, "joint.RKneeSag.pretension_m", 0.006);  /* 60 ticks: across the way back */
        ask_set(w, "joint.LKneeSag.pretension_m", -0.004); /* 40 ticks: it ends before it */
    }
}

static void disturb_winches(struct witness *w, int64_t tick)
{
    if (tick == AT + 2) {
        ask_set(w, "joint.RKneeSag.pretension_m", 0.0);
        ask_set(w, "joint.LKneeSag.pretension_m", 0.01);
    }
}

static void stop_winches(struct witness *w, int64_t tick)
{
    const struct plant_command *command = plant_command(simulator_plant(w->simulator));
    struct requests *requests = simulator_requests(w->simulator);
    int right = requests_find(requests, "joint.RKneeSag.pretension_m");

    /* Where it is now is where it is to stay: the winches stand still when time goes back */
    if (tick == AT + 2) {
        size_t j = 0;

        while (command->motor[j].pretension_m <= 0.0) {
            j++;
            assert_true(j < command->njoint);
        }
        assert_true(right >= 0);
        ask_set(w, "joint.RKneeSag.pretension_m", command->motor[j].pretension_m);
        ask_set(w, "joint.LKneeSag.pretension_m", 0.0);
    }
}

TEST(a_winch_goes_on_to_where_it_was_told)
{
    struct activity activity = {.scene = {.rig = "coman",
                                          .clock = LOOP_CLOCK_FREE,
                                          .no_contact = true,
                                          .falls = true,
                                          .springs = true},
                                .begin = begin_winches,
                                .disturb = disturb_winches};

    goes_on_as_if_nothing_had_been(&activity);
    activity.disturb = stop_winches;
    goes_on_as_if_nothing_had_been(&activity);
    activity.begin = begin_nothing;
    activity.disturb = disturb_winches;
    goes_on_as_if_nothing_had_been(&activity);
}

/* ---- faults ---- */

enum { SAG, JAM, STUCK }; /* those that are switched by hand */

static void begin_faults(struct witness *w, int64_t tick)
{
    if (tick == 30) {
        ask_fault(w, SAG, true);
        ask_fault(w, STUCK, true);
    }
}

static void disturb_faults(struct witness *w, int64_t tick)
{
    if (tick == AT + 3) {
        ask_fault(w, SAG, false);
        ask_fault(w, JAM, true);
        ask_fault(w, STUCK, false);
    }
    if (tick == AT + 6) {
        ask_fault(w, STUCK, true); /* at another value */
        ask_set(w, "supply_v", 40.0);
        ask_set(w, "sensing.noise_scale", 3.0);
    }
}

/* Windows that end before, among and after the ticks that are undone, and begin there. */
TEST(faults_are_where_they_were)
{
    const struct activity activity = {
        .scene = {.rig = "coman-sensors",
                  .task = "squat",
                  .clock = LOOP_CLOCK_FREE,
                  .timed = true,
                  .no_contact = true,
                  .falls = true,
                  .fault = {"supply sag 10 manual", "motor LKneeSag jam manual",
                            "sensor LElbj.torque stuck manual", "motor RElbj jam 0.04..0.065",
                            "sensor RKneeSag.torque slow 0.007 0.03..0.12",
                            "bus right_arm late 0.0023 0.04..0.1",
                            "bus left_leg error_burst 0.05 0.06..0.09",
                            "bus torso bus_off 0.02..0.055"}},
        .begin = begin_faults,
        .disturb = disturb_faults};

    goes_on_as_if_nothing_had_been(&activity);
}
