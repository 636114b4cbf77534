/* SPDX-License-Identifier: Apache-2.0 */
/*
 * A whole robot whose board is replaced by what it sent in another run: the task starts it, the
 * robot stands as before, and its joint goes where the board's went. That run is recorded, and its
 * recording, played, gives its very state; and from a checkpoint it goes the same way again.
 */
#include "tests/unit/sim/external_bench.h"

enum { TICKS = 4000, TICK_FRAMES = 8, AT = 3000, SPAN = 200 };

/* What the real board sent, and where its rotor was, before each tick. */
struct real {
    struct bus_frame frame[TICKS + 1][TICK_FRAMES];
    size_t count[TICKS + 1];
    double qm[TICKS + 1], base_z[TICKS + 1];
    bool clamped[TICKS + 1];
};

static struct real real, instead;

static bool real_board_sent(const struct bench *bench, const struct bus_frame *frame)
{
    unsigned function = frame->id >> 5, number = frame->id & 0x1f;

    /* TELEMETRY and STATE by slot; REPLY and IDENTITY by address */
    return function == 0x08 || function == 0x10   ? number == 0
           : function == 0x35 || function == 0x3e ? number == bench->external->address
                                                  : false;
}

static void real_note(struct bench *bench, struct real *to, int64_t ms)
{
    size_t count;

    to->qm[ms] = bench_motor(bench)->qm;
    to->base_z[ms] = plant_state(simulator_plant(bench->simulator), &count)[2];
    to->clamped[ms] = plant_is_clamped(simulator_plant(bench->simulator));
}

/* The run with the board: it is noted what it sends. */
static void real_step(struct bench *bench, int64_t ms)
{
    struct bus_frame frame;

    real_note(bench, &real, ms);
    while (can_receive(bench->ports.port[BUS], &frame, 1) == 1) {
        if (real_board_sent(bench, &frame)) {
            assert_true(real.count[ms] < TICK_FRAMES);
            real.frame[ms][real.count[ms]++] = frame;
        }
    }
}

/* The run without it: its frames come at their ticks. */
static void instead_step(struct bench *bench, int64_t ms)
{
    struct bus_frame frame;

    real_note(bench, &instead, ms);
    while (can_receive(bench->ports.port[BUS], &frame, 1) == 1) {
        assert_false(real_board_sent(bench, &frame));
    }
    for (size_t i = 0; i < real.count[ms]; i++) {
        bench_send(bench, &real.frame[ms][i]);
    }
}

FIXTURE(record_once)
{
    static struct bench bench;

    bench = (struct bench){.rig = "coman-compact",
                           .step = real_step,
                           .stands = true,
                           .own = true,
                           .task = "squat",
                           .ticks = TICKS};
    bench_run(&bench);
    return bench.heard + bench.silent;
}

/* What was told before tick t the rotor is at after it: to half a count of the board's encoder
 * and of its frames. */
TEST(a_board_may_be_replaced_by_a_real_one)
{
    static struct bench bench;
    double bound, worst = 0.0, moved = 0.0, sunk = 0.0;
    int compared = 0;

    bench = (struct bench){.rig = "coman-compact",
                           .step = instead_step,
                           .stands = true,
                           .task = "squat",
                           .ticks = TICKS};
    bench_run(&bench);
    bound = 0.5 / bench.external->axis[0].motor_ticks_per_rad + 0.5 * bench.count;
    for (int t = 0; t + 1 < TICKS; t++) {
        if (t > 100 && !instead.clamped[t - 100]) {
            worst = fmax(worst, fabs(instead.qm[t + 1] - real.qm[t]));
            moved = fmax(moved, fabs(real.qm[t] - real.qm[0]));
            sunk = fmax(sunk, fabs(instead.base_z[t] - real.base_z[t]));
            compared++;
        }
    }
    print_message("# %d ticks: rotor off by %.3g rad of %.3g, which moved %.3f rad; trunk off by "
                  "%.5f m\n",
                  compared, worst, bound, moved, sunk);
    assert_true(compared > 500 && moved > 0.1);
    assert_true(worst <= bound + 1e-12);
    assert_int_equal(bench.heard, 1);
}

/* The frames of the real board alone; nothing reads the state, which would stop the account. With
 * frames far apart the rotor jumps. */
static void plain_step(struct bench *bench, int64_t ms)
{
    struct bus_frame frame;

    while (can_receive(bench->ports.port[BUS], &frame, 1) == 1) {
    }
    for (size_t i = 0; i < real.count[ms] && (!bench->test || ms % 50 == 0); i++) {
        bench_send(bench, &real.frame[ms][i]);
    }
}

TEST(the_energy_account_holds_what_an_external_board_moves)
{
    for (int jumps = 0; jumps < 2; jumps++) {
        struct bench bench = {.rig = "coman-compact",
                              .step = plain_step,
                              .stands = true,
                              .test = jumps ? &real : NULL,
                              .task = "squat",
                              .ticks = TICKS};

        bench_run(&bench);
        if (bench.found_energy) {
            fail_msg("jumps: %d", jumps);
        }
    }
}

TEST(a_recording_brings_its_frames_back)
{
    static struct bench bench, played;
    char folder[] = "/tmp/hil-external-XXXXXX", command[64];

    assert_non_null(mkdtemp(folder));
    bench = (struct bench){.rig = "coman-compact",
                           .step = instead_step,
                           .stands = true,
                           .task = "squat",
                           .record = folder,
                           .ticks = TICKS};
    bench_run(&bench);
    played =
        (struct bench){.rig = "coman-compact", .stands = true, .stimulus = folder, .ticks = TICKS};
    bench_run(&played);
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    assert_int_equal(system(command), 0);
    assert_int_equal(played.heard, 1);
    assert_true(played.hash == bench.hash);
}

/* ---- back in time ---- */

struct witness {
    uint64_t first[SPAN + 1], again[SPAN + 1];
    int64_t tick;
    int goes;
};

static void witness_ask(struct bench *bench, enum request_kind kind)
{
    const struct loop_request request = {.ticket = kind, .kind = kind, .index = 1};

    assert_true(requests_ask(simulator_requests(bench->simulator), &request));
}

static void witness_step(struct bench *bench, int64_t ms)
{
    struct witness *w = bench->test;
    struct request_answer answer;

    while (requests_answer(simulator_requests(bench->simulator), &answer)) {
        assert_int_equal(answer.verdict, REQUEST_OK);
        w->goes += answer.ticket == REQUEST_RESTORE;
    }
    instead_step(bench, ms);
    if (ms > AT && ms <= AT + SPAN) {
        (w->goes ? w->again : w->first)[ms - AT] = plant_hash(simulator_plant(bench->simulator));
    }
    if (ms == AT - 1) {
        witness_ask(bench, REQUEST_CHECKPOINT);
    } else if (ms == AT + SPAN && w->goes == 0) {
        witness_ask(bench, REQUEST_RESTORE);
    }
}

TEST(it_goes_the_same_way_from_a_checkpoint)
{
    static struct bench bench;
    static struct witness w;

    bench = (struct bench){.rig = "coman-compact",
                           .step = witness_step,
                           .stands = true,
                           .requests = true,
                           .task = "squat",
                           .test = &w,
                           .ticks = AT + SPAN + 2};
    bench_run(&bench);
    assert_int_equal(w.goes, 1);
    for (int t = 1; t <= SPAN; t++) {
        assert_true(w.first[t] == w.again[t]);
        assert_true(t == 1 || w.first[t] != w.first[t - 1]);
    }
}

TEST_GROUP(record_once, NULL)
