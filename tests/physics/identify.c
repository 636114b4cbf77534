/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Tasks sweep and follow on one drive, over every protocol. What a sweep measures is the closed
 * frequency response of the paper's equations (2) to (4), written out here; what follow reports is
 * within a bound that follows from the same equations.
 */
#include "base/array.h"
#include "sim/simulator.h"
#include "tasks/trajectory.h"

#include <complex.h>
#include <unistd.h>

#include "tests/physics/near.h"

enum { MOST_TICKS = 400000 };

/* A link on a vertical axis: no gravity, nothing else */
#define LINK_KG_M2 0.5
static const double J = 0.1, Dm = 0.2, Ks = 400, Ds = 4, Kt = 4, Kw = 4, R = 0.6, L = 0.0003;
static const double kp = 60;

static const char robot_file[] =
    "name: arm\n"
    "gravity_m_s2: [0, 0, -9.81]\n"
    "base: {type: fixed, body: post}\n"
    "drive: {J_kg_m2: 0.1, Dm_nm_s_rad: 0.2, Ks_nm_rad: 400, Ds_nm_s_rad: 4, N: 100, NKt_nm_a: 4,\n"
    "        NKw_v_s_rad: 4, R_ohm: 0.6, L_h: 0.0003}\n"
    "bodies:\n"
    "  - {name: post, mass_kg: 1, com_m: [0, 0, 0], inertia_kg_m2: [1, 0, 0, 1, 0, 1]}\n"
    "  - {name: arm, mass_kg: 1, com_m: [0, 0, 0], inertia_kg_m2: [0.5, 0, 0, 0.5, 0, 0.5]}\n"
    "joints:\n"
    "  - {name: yaw, type: revolute, parent: post, child: arm, axis: [0, 0, 1],\n"
    "     origin: {xyz_m: [0, 0, 0]}, limits: {lower_rad: -2, upper_rad: 2, torque_nm: 100},\n"
    "     drive: {}}\n"
    "poses:\n"
    "  zero: {}\n";

static const char rig_file[] =
    "name: arm\n"
    "robot: {file: arm-robot.yaml}\n"
    "protocol: %s\n"
    "clock: free\n"
    "dynamics: generic\n"
    "tick_s: 0.001\n"
    "substep_s: 0.001\n"
    "supply_v: 48\n"
    "initial: {pose: zero}\n"
    "motors:\n"
    "  joint_ticks_per_rev: 65536\n"
    "  motor_ticks_per_link_rev: 409600\n"
    "  torque_full_scale_nm: 100\n"
    "  current_limit_a: 30\n"
    "buses:\n"
    "  - name: bus\n"
    "    interface: can0\n"
    "    boards:\n"
    "      - {kind: motor, address: 1, axes: [yaw]}\n"
    "%s"
    "tasks:\n"
    "  servo: {kp_v_per_rad: 60, ki_v_per_rad_s: 0, kw_v_s_per_rad: 4, command_period_s: 0.001}\n";

static const char torque_board[] =
    "      - {kind: torque, address: 0x0c, joints: [yaw], period_s: 0.005}\n";

/* A 2FOC board has no link encoder: the host takes the spring's deflection by a torque of up to
 * 5 ms ago from the rotor's angle, which is no angle of the link at a resonance. And its voltage
 * has steps of a thousandth of the supply, cut off towards 0 (boards/foc/private.h): a sine loses
 * half a step of either sign, a square wave with the sine 2 / pi step. */
struct way {
    const char *protocol;
    bool torque_board, link_encoder;
    double step_v;
};

static const struct way ways[] = {{"icub", true, true, 0},
                                  {"foc", true, false, 0.048},
                                  {"compact", false, true, 0},
                                  {"cia402", false, true, 0}};

static char folder[] = "/tmp/hil-identify-XXXXXX";

static const char *path_of(const char *name)
{
    static char path[64];

    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static void write_text(const char *name, const char *text)
{
    FILE *file = fopen(path_of(name), "w");

    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

/* ---- a run of the task ---- */

struct session {
    struct arena arena;
    const struct rig *rig;
    struct simulator *simulator;
    struct task_input input;
    struct task_runner_status status;
};

static void session_load(struct session *s, const struct way *way)
{
    char text[2048];
    struct error error;

    snprintf(text, sizeof text, rig_file, way->protocol, way->torque_board ? torque_board : "");
    write_text("arm.yaml", text);
    assert_ok(arena_init(&s->arena, 1 << 28, &error));
    s->input = (struct task_input){NULL, NULL};
    assert_no_error(rig_load(path_of("arm.yaml"), &s->arena, &s->rig, &error), error.text);
}

static const struct task *session_run(struct session *s, const char *task,
                                      const char *const *setting, size_t nsetting)
{
    struct simulator_config config = {.rig = s->rig,
                                      .clock = LOOP_CLOCK_FREE,
                                      .transport = TRANSPORT_LOCAL,
                                      .ticks = MOST_TICKS,
                                      .task = task,
                                      .task_input = &s->input,
                                      .setting = setting,
                                      .nsetting = nsetting};
    struct realtime_report report;
    struct error error;
    char notice[256];

    assert_no_error(simulator_create(&config, &s->arena, &s->simulator, notice, &error),
                    error.text);
    assert_ok(simulator_start(s->simulator, &report, &error));
    simulator_run(s->simulator);
    task_runner_read(simulator_task_runner(s->simulator), &s->status);
    print_message("# %s: %s\n", s->rig->name, s->status.message);
    return simulator_task_runner(s->simulator)->task;
}

static void session_end(struct session *s)
{
    simulator_destroy(s->simulator);
    arena_fini(&s->arena);
}

/* ---- the analytic response ---- */

/* From volts to link angle, rotor angle and torque at one frequency: equations (2) to (4) with a
 * link I q'' = tau, Laplace transformed. */
static void respond(double hz, double complex response[SWEEP_RESPONSES])
{
    const double complex s = CMPLX(0, 2 * M_PI * hz);
    const double complex spring = Ks + Ds * s;
    const double complex link_per_motor = spring / (LINK_KG_M2 * s * s + spring);
    const double complex torque_per_motor = spring * (1 - link_per_motor);
    const double complex winding = L * s + R;
    const double complex motor =
        Kt / (winding * (J * s * s + Dm * s + torque_per_motor) + Kt * Kw * s);

    response[SWEEP_JOINT] = motor * link_per_motor;
    response[SWEEP_MOTOR] = motor;
    response[SWEEP_TORQUE] = motor * torque_per_motor;
}

static double phase_between(double a, double b)
{
    return remainder(a - b, 2 * M_PI) * 180 / M_PI;
}

static void judge_sweep(const struct task *task, const struct way *way, double tolerance,
                        double degrees, bool by_reference)
{
    static const char *const name[] = {"link", "rotor", "torque"};
    const struct sweep_point *point;
    size_t count = task_sweep_points(task, &point);
    double off[SWEEP_RESPONSES] = {0}, turned[SWEEP_RESPONSES] = {0}, least = 1;

    for (size_t i = 0; i < count; i++) {
        double complex expected[SWEEP_RESPONSES], closed;

        respond(point[i].frequency_hz, expected);
        /* V = kp (r - qm) + Kw r' in the loop: what moves is the reference */
        closed = by_reference ? CMPLX(kp, Kw * 2 * M_PI * point[i].frequency_hz) /
                                    (1 + kp * expected[SWEEP_MOTOR])
                              : 1;
        for (int k = way->link_encoder ? SWEEP_JOINT : SWEEP_MOTOR; k < SWEEP_RESPONSES; k++) {
            const struct sweep_response *got = &point[i].response[k];
            double complex right = expected[k] * closed;
            double most = tolerance + 2 / M_PI * way->step_v / point[i].input;

            off[k] = fmax(off[k], fabs(got->magnitude / cabs(right) - 1) - most + tolerance);
            turned[k] = fmax(turned[k], fabs(phase_between(got->phase_rad, carg(right))));
            least = fmin(least, got->coherence);
            if (!(fabs(got->magnitude / cabs(right) - 1) <= most) ||
                !(fabs(phase_between(got->phase_rad, carg(right))) <= degrees)) {
                print_message("# %s at %.3g Hz: %.4g at %.1f deg, expected %.4g at %.1f deg, "
                              "coherence %.4f\n",
                              name[k], point[i].frequency_hz, got->magnitude,
                              got->phase_rad * 180 / M_PI, cabs(right), carg(right) * 180 / M_PI,
                              got->coherence);
            }
        }
    }
    print_message("# off by %.2f %%, %.2f %%, %.2f %% and %.2f, %.2f, %.2f degrees; coherence "
                  "%.4f or more\n",
                  100 * off[0], 100 * off[1], 100 * off[2], turned[0], turned[1], turned[2], least);
    for (int k = 0; k < SWEEP_RESPONSES; k++) {
        assert_true(off[k] <= tolerance);
        assert_true(turned[k] <= degrees);
    }
    assert_true(least > 0.98);
}

/* The spring's resonance is at sqrt(400 / 0.5) = 28.3 rad/s, 4.5 Hz. */
TEST(a_sweep_is_the_response_of_the_equations)
{
    static const char *const setting[] = {"sweep.from_hz=1", "sweep.to_hz=12", "sweep.points=9",
                                          "sweep.amplitude_v=3"};

    for (size_t i = 0; i < ARRAY_COUNT(ways); i++) {
        struct session s;
        const struct task *task;

        session_load(&s, &ways[i]);
        s.input.joint = "yaw";
        task = session_run(&s, "sweep", setting, ARRAY_COUNT(setting));
        print_message("# %s\n", ways[i].protocol);
        assert_int_equal(s.status.status, TASK_DONE);
        judge_sweep(task, &ways[i], 0.005, 0.5, false);
        session_end(&s);
    }
}

CLOSED_BENCH(session, struct session, session_end)

/* Half a period of the commands is in it: 1.4 degrees at 8 Hz. */
TEST_ON(a_sweep_of_the_reference_is_the_closed_loop, session, s)
{
    static const char *const setting[] = {"sweep.from_hz=1", "sweep.to_hz=8", "sweep.points=6",
                                          "sweep.amplitude_rad=0.03"};
    const struct task *task;

    session_load(s, &ways[2]);
    s->input.joint = "yaw";
    task = session_run(s, "sweep", setting, ARRAY_COUNT(setting));
    assert_int_equal(s->status.status, TASK_DONE);
    judge_sweep(task, &ways[2], 0.01, 2, true);
}

TEST(a_sweep_says_what_it_cannot_do)
{
    static const char *const far[] = {"sweep.amplitude_rad=0.5"};
    static const char *const none[] = {"sweep.amplitude_v=0"};
    struct session s;

    session_load(&s, &ways[2]);
    s.input.joint = "yaw";
    session_run(&s, "sweep", none, 1);
    assert_int_equal(s.status.status, TASK_FAILED);
    assert_non_null(strstr(s.status.message, "the amplitude is 0"));
    session_end(&s);

    /* 0.5 rad at a few hertz is more than the drive bears */
    session_load(&s, &ways[2]);
    s.input.joint = "yaw";
    session_run(&s, "sweep", far, 1);
    assert_int_equal(s.status.status, TASK_FAILED);
    assert_non_null(strstr(s.status.message, "over-current"));
    session_end(&s);
}

/* ---- follow ---- */

/* A swing of 0.5 rad, there and back in 4 s, in rows of 40 ms. */
static void write_swing(const char *name, const char *unit, double scale)
{
    FILE *file = fopen(path_of(name), "w");

    assert_non_null(file);
    fprintf(file, "time_s,yaw_%s\n", unit);
    for (int i = 0; i <= 100; i++) {
        fprintf(file, "%.2f,%.12g\n", 0.04 * i, scale * 0.25 * (1 - cos(M_PI * 0.02 * i)));
    }
    assert_int_equal(fclose(file), 0);
}

/* Largest rate and acceleration of what the rows were read as; the latter from rates 1 ms apart. */
static void measure_swing(const struct trajectory *t, double *rate, double *acceleration)
{
    double before = 0, angle, now;

    *rate = *acceleration = 0;
    for (int i = 1; i <= 4000; i++) {
        trajectory_at(t, 0, 1e-3 * i, &angle, &now);
        *rate = fmax(*rate, fabs(now));
        *acceleration = fmax(*acceleration, fabs(now - before) / 1e-3);
        before = now;
    }
}

/*
 * With the loop V = kp (r - qm) + Kw r' equations (2) and (4), without L, give for e = r - qm
 *
 *     J e'' + (Dm + Kt Kw / R) e' + Kt kp / R e = J r'' + Dm r' + tau.
 *
 * The left side is overdamped, so its impulse response has one sign and |e| is at most the greatest
 * right side by Kt kp / R. The link's torque is I q''; on a spring of natural frequency w and
 * damping z the deflection d under a motor's acceleration a is at most
 * a / w^2 coth(pi z / (2 sqrt(1 - z^2))), the integral of the absolute value of its impulse
 * response; the loop passes r'' on as it is. Then come the delay of the bus, a period for the
 * command and one for the angle, and a tick of the encoders.
 */
static double follow_bound(const struct trajectory *t)
{
    double rate, acceleration, w2 = Ks / LINK_KG_M2, z = Ds / (2 * sqrt(Ks * LINK_KG_M2));
    double stiffness = Kt * kp / R, damping = Dm + Kt * Kw / R, deflection, torque;

    measure_swing(t, &rate, &acceleration);
    assert_true(damping * damping > 4 * J * stiffness);
    deflection = acceleration / w2 / tanh(M_PI * z / (2 * sqrt(1 - z * z)));
    torque = Ks * deflection + Ds * deflection * sqrt(w2);
    return (J * acceleration + Dm * rate + torque) / stiffness + deflection + rate * 0.002 +
           2 * M_PI / 65536;
}

TEST(a_joint_follows_within_the_bound)
{
    for (size_t i = 0; i < ARRAY_COUNT(ways); i++) {
        const struct follow_error *joint;
        struct session s;
        const struct task *task;
        struct error error;
        double bound, rate, acceleration;
        char path[64];

        write_swing("swing.csv", i % 2 ? "deg" : "rad", i % 2 ? 180 / M_PI : 1);
        strcpy(path, path_of("swing.csv"));
        session_load(&s, &ways[i]);
        assert_no_error(rig_read_trajectory(s.rig, path, TRAJECTORY_CUBIC, &s.arena,
                                            &s.input.trajectory, &error),
                        error.text);
        bound = follow_bound(s.input.trajectory);
        measure_swing(s.input.trajectory, &rate, &acceleration);
        task = session_run(&s, "follow", NULL, 0);
        assert_int_equal(s.status.status, TASK_DONE);
        assert_int_equal(task_follow_errors(task, &joint), 1);
        print_message(
            "# %s: worst %.2f mrad at %.2f s, RMS %.2f mrad, bound %.2f mrad (%.2f rad/s, "
            "%.2f rad/s2)\n",
            ways[i].protocol, 1e3 * joint->worst_rad, joint->worst_s, 1e3 * joint->rms_rad,
            1e3 * bound, rate, acceleration);
        assert_true(joint->moves && joint->count >= 2000 / 10);
        assert_true(fabs(joint->worst_rad) <= bound && bound < 0.03);
        assert_true(joint->rms_rad <= fabs(joint->worst_rad) && joint->rms_rad > 0);
        session_end(&s);
    }
}

TEST_ON(too_large_an_error_fails, session, s)
{
    static const char *const setting[] = {"follow.tolerance_rad=0.001"};
    struct error error;
    char path[64];

    write_swing("swing.csv", "rad", 1);
    strcpy(path, path_of("swing.csv"));
    session_load(s, &ways[0]);
    assert_ok(rig_read_trajectory(s->rig, path, TRAJECTORY_LINEAR, &s->arena, &s->input.trajectory,
                                  &error));
    session_run(s, "follow", setting, 1);
    assert_int_equal(s->status.status, TASK_FAILED);
    assert_non_null(strstr(s->status.message, "allowed are 0.001 rad"));
}

/* 48 V carry 12 rad/s. */
TEST(a_drive_is_not_asked_for_more_than_it_reaches)
{
    struct session s;
    struct error error;
    char path[64];

    strcpy(path, path_of("fast.csv"));
    session_load(&s, &ways[0]);
    write_text("fast.csv", "time_s,yaw_rad\n0,0\n0.1,1.19\n");
    assert_ok(
        rig_read_trajectory(s.rig, path, TRAJECTORY_LINEAR, &s.arena, &s.input.trajectory, &error));
    write_text("fast.csv", "time_s,yaw_rad\n0,0\n0.1,1.21\n");
    assert_int_equal(
        rig_read_trajectory(s.rig, path, TRAJECTORY_LINEAR, &s.arena, &s.input.trajectory, &error),
        ERROR_INPUT);
    assert_non_null(strstr(error.text, "fast.csv:3: column 2 (yaw_rad): found 12.1 rad/s"));
    arena_fini(&s.arena);
}

FIXTURE(make_folder)
{
    if (!mkdtemp(folder)) {
        return -1;
    }
    write_text("arm-robot.yaml", robot_file);
    return 0;
}

FIXTURE(remove_folder)
{
    static const char *const names[] = {"arm.yaml", "arm-robot.yaml", "swing.csv", "fast.csv"};

    for (size_t i = 0; i < ARRAY_COUNT(names); i++) {
        unlink(path_of(names[i]));
    }
    return rmdir(folder);
}

TEST_GROUP(make_folder, remove_folder)
