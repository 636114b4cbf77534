/* SPDX-License-Identifier: Apache-2.0 */
/*
 * External boards: the rotor follows what the real one tells to half a count of its frames, stands
 * still before the first frame and after a silence, both of which are said; nothing is sent for the
 * board; a leap is bounded by the drive's speed and the joint's range; a run repeats bit for bit.
 */
#include "tests/unit/sim/external_bench.h"

enum { BEGIN = 50, END = 350, AGAIN = 400, LAST = 450, TICKS = 500 };

/* What the test tells, and what came of it. */
struct script {
    double (*tell)(const struct bench *bench, int64_t ms); /* what the frame of a time says */
    struct bus_frame (*write)(const struct bench *bench, double told);
    int64_t period_ms; /* a frame every so many */

    double start, last, told, worst, fastest, stood, at_end, moved_after, farthest;
    int foreign;
};

static double tell_swing(const struct bench *bench, int64_t ms)
{
    const struct script *script = bench->test;

    return script->start + 0.05 * (1 - cos(4 * M_PI * 1e-3 * (double)(ms - BEGIN)));
}

static double tell_far(const struct bench *bench, int64_t ms)
{
    (void)bench;
    (void)ms;
    return 9.0;
}

static void script_step(struct bench *bench, int64_t ms)
{
    struct script *script = bench->test;
    struct bus_frame frame;

    /* What the tick before has done, with the frame that it had */
    const double qm = bench_motor(bench)->qm;

    if (ms == 0) {
        script->start = script->last = script->told = qm;
    } else if (ms <= BEGIN) {
        script->stood = fmax(script->stood, fabs(qm - script->start));
    } else if (ms <= END) {
        script->worst = fmax(script->worst, fabs(qm - script->told));
        script->farthest = fmax(script->farthest, qm);
    } else if (ms == END + TIMEOUT_MS + 1) {
        script->at_end = qm;
    } else if (ms > END + TIMEOUT_MS + 1 && ms <= AGAIN) {
        script->moved_after = fmax(script->moved_after, fabs(qm - script->at_end));
    }
    if (ms <= END) {
        script->fastest = fmax(script->fastest, fabs(qm - script->last) / 1e-3);
    }
    script->last = qm;

    /* Nobody but us sends its frames */
    while (can_receive(bench->ports.port[BUS], &frame, 1) == 1) {
        script->foreign += frame.id == script->write(bench, 0.0).id;
    }
    if (((ms >= BEGIN && ms < END) || (ms >= AGAIN && ms < LAST)) && ms % script->period_ms == 0) {
        script->told = script->tell(bench, ms);
        frame = script->write(bench, script->told);
        bench_send(bench, &frame);
    }
}

static void script_run(const char *rig, struct bench *bench, struct script *script)
{
    *bench = (struct bench){.rig = rig, .step = script_step, .ticks = TICKS, .test = script};
    bench_run(bench);
}

/* Follows with an error of at most so much beside half a count, the same the second time. */
static void check_followed(const char *rig, struct script script, double lag)
{
    static struct bench bench, again;
    struct script second = script;
    double bound;

    script_run(rig, &bench, &script);
    script_run(rig, &again, &second);
    bound = 0.5 * bench.count + lag + 1e-12; /* and the rounding of 300 steps */
    print_message("# %s: follows to %.3g rad of %.3g, up to %.3f rad/s\n", rig, script.worst, bound,
                  script.fastest);
    assert_true(script.stood == 0.0);
    assert_true(script.fastest > 0.5); /* 0.2 pi rad/s is the swing's */
    assert_true(script.worst <= bound);
    assert_true(script.moved_after == 0.0);
    assert_int_equal(script.foreign, 0);
    assert_true(bench.hash == again.hash);

    /* Silent at first, between, and at the end; the log says when a time-out has passed */
    assert_int_equal(bench.silent, 3);
    assert_int_equal(bench.silent_ms, TIMEOUT_MS + 1);
    assert_int_equal(bench.heard, 2);
}

TEST(a_rotor_follows_a_foc_board)
{
    check_followed("coman-foc-leg",
                   (struct script){.tell = tell_swing, .write = bench_angle, .period_ms = 1}, 0.0);
}

TEST(a_rotor_follows_a_compact_board)
{
    check_followed("coman-compact",
                   (struct script){.tell = tell_swing, .write = bench_angle, .period_ms = 1}, 0.0);
}

/* A frame every 4 ms: each tick takes a quarter of the way that is left, so that of the way d of a
 * frame (0.75)^4 = 0.316 is left at the next; at constant speed the error before a frame, e = 0.316
 * (e + d), is 0.463 d, and with the new frame 1.463 d. */
static const double MOST_WAY = 0.2 * M_PI * 4e-3; /* of the swing in 4 ms */

TEST(a_rotor_glides_between_the_frames_of_an_icub_board)
{
    check_followed("coman",
                   (struct script){.tell = tell_swing, .write = bench_angle, .period_ms = 4},
                   1.463 * MOST_WAY);
}

/* The link's angle, of an encoder with fewer counts, where nothing tells the motor's. */
static struct bus_frame write_link_angle(const struct bench *bench, double rad)
{
    struct bus_frame frame = bench_angle(bench, 0.0);

    frame.id = frame.id - ICUB_MOTOR_POSITION + ICUB_POSITION;
    put_u32_le(frame.data,
               (uint32_t)(int32_t)lrint(rad * bench->external->axis[0].joint_ticks_per_rad));
    return frame;
}

TEST(without_a_motor_angle_the_link_s_is_followed)
{
    check_followed("coman",
                   (struct script){.tell = tell_swing, .write = write_link_angle, .period_ms = 4},
                   1.463 * (MOST_WAY + 2 * M_PI / 4096));
}

TEST(a_leap_is_bounded)
{
    struct script script = {.tell = tell_far, .write = bench_angle, .period_ms = 1};
    static struct bench bench;
    const struct robot_sea *sea = &bench.sea;
    double upper;

    script_run("coman-compact", &bench, &script);
    upper = bench.external->axis[0].upper_rad;
    print_message("# leaps: %.3f rad/s of %.3f, ends at %.6f of %.6f rad\n", script.fastest,
                  bench.copy.supply_v / sea->Kw, script.farthest, upper);
    assert_true(script.fastest <= bench.copy.supply_v / sea->Kw * (1 + 1e-9));
    assert_true(script.fastest > 0.99 * bench.copy.supply_v / sea->Kw);
    assert_true(fabs(script.farthest - upper) < 1e-9);
}

/* ---- torque ---- */

struct pull {
    double told, before, worst, bound, largest, qd;
};

#define TORQUE_NM 32e-3

/* Compact telemetry: the torque's twelve bits begin at bit 50, counts of 32 mN m. */
static struct bus_frame write_torque(double nm)
{
    struct bus_frame frame = {.id = 0x100, .len = 8};
    uint64_t bits = ((uint64_t)lrint(nm / TORQUE_NM) & 0xfff) << 50;

    put_u32_le(frame.data, (uint32_t)bits);
    put_u32_le(frame.data + 4, (uint32_t)(bits >> 32));
    return frame;
}

/* At the end of a tick the link has gone on by half of its change of speed a in the tick, T a / 2,
 * which was not foreseen, and the rotor has it not yet: Ks T a / 2 + Ds a; the torque that is told
 * is the tick's mean, so that its end is up to one change of it apart. */
static void pull_step(struct bench *bench, int64_t ms)
{
    struct pull *pull = bench->test;
    const struct motor_sense *is = bench_motor(bench);
    const struct robot_sea *sea = &bench->sea;
    struct bus_frame frame;

    while (can_receive(bench->ports.port[BUS], &frame, 1) == 1) {
    }
    if (ms > BEGIN + 20 && ms <= END) {
        double a = fabs(is->qd - pull->qd), error = fabs(is->torque_nm - pull->told);
        double bound =
            (0.5e-3 * sea->Ks + sea->Ds) * a + fabs(pull->told - pull->before) + 1.5 * TORQUE_NM;

        if (error - bound > pull->worst - pull->bound) {
            pull->worst = error;
            pull->bound = bound;
        }
        pull->largest = fmax(pull->largest, fabs(is->torque_nm));
    }
    pull->qd = is->qd;
    pull->before = pull->told;
    if (ms >= BEGIN && ms < END) {
        pull->told = 4.0 * sin(4 * M_PI * 1e-3 * (double)(ms - BEGIN));
        frame = write_torque(pull->told);
        bench_send(bench, &frame);
    }
}

TEST(a_spring_exerts_the_torque_that_is_told)
{
    struct pull pull = {.worst = 0.0, .bound = INFINITY};
    static struct bench bench;

    bench = (struct bench){
        .rig = "coman-compact", .step = pull_step, .ticks = TICKS, .torque = true, .test = &pull};
    bench_run(&bench);
    print_message("# torque: %.4f N m off of %.4f at worst, up to %.3f N m\n", pull.worst,
                  pull.bound, pull.largest);
    assert_true(pull.worst <= pull.bound);
    assert_true(pull.largest > 3.8);
}

/* A torque beyond all reason, in the wider field of a CAN FD frame. */
static void pull_beyond_step(struct bench *bench, int64_t ms)
{
    struct pull *pull = bench->test;
    const struct motor_sense *is = bench_motor(bench);
    struct bus_frame frame = {
        .id = 0x120 | bench->external->address,
        .len = 16,
        .flags = FRAME_FD | FRAME_BRS,
    };

    put_u32_le(frame.data + 12, 0x7fffff);
    if (ms >= BEGIN) {
        bench_send(bench, &frame);
        pull->largest = fmax(pull->largest, fabs(is->qm - is->q));
        pull->bound = fmax(pull->bound, 0.5e-3 * fabs(is->qd - pull->qd)); /* as above */
    }
    pull->qd = is->qd;
    while (can_receive(bench->ports.port[BUS], &frame, 1) == 1) {
    }
}

TEST(a_torque_is_bounded_by_that_of_the_drive_at_stall)
{
    static struct bench bench;
    struct pull pull = {.bound = 0.0};
    double most;

    bench = (struct bench){
        .rig = "coman-fd", .step = pull_beyond_step, .ticks = TICKS, .torque = true, .test = &pull};
    bench_run(&bench);
    most = sea_deflection(&bench.sea, bench.sea.Kt * bench.copy.supply_v / bench.sea.R);
    print_message("# spring: %.4f rad, %.4f at stall, %.4f as told\n", pull.largest, most,
                  sea_deflection(&bench.sea, 0x7fffff * 1e-3));
    assert_true(pull.largest > 0.1 && pull.largest <= most + pull.bound);
}
