/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Imports robots on wheels from URDF and drives them by the task follow. Compares their distance,
 * yaw and arc with those of wheels that roll without slip.
 */
#include "app/import/import.h"
#include "base/array.h"
#include "sim/simulator.h"
#include "tests/rig_run.h"
#include "tests/test.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

/* The ride ends while the motors are still on */
enum { DRIVE_S = 4, TICKS = 6400 };

#define INERTIAL(mass, ixx, iyy, izz)                                                              \
    "<inertial><mass value='" mass "'/><inertia ixx='" ixx "' iyy='" iyy "' izz='" izz             \
    "' ixy='0' ixz='0' iyz='0'/></inertial>"
#define BASE(com, inertial, shape)                                                                 \
    "<robot name='r'><link name='base'>" inertial "</link><link name='body'>" shape                \
    "</link><joint name='b' type='fixed'><parent link='base'/><child link='body'/>"                \
    "<origin xyz='" com "'/></joint>"
#define WHEEL_ON(parent, name, place, axis, inertial, shape)                                       \
    "<link name='" name "'>" inertial "<collision>" shape "</collision></link>"                    \
    "<joint name='" name "_wheel' type='continuous'><parent link='" parent "'/><child link='" name \
    "'/><origin xyz='" place "'/><axis xyz='" axis "'/>"                                           \
    "<limit effort='40' velocity='20'/></joint>"
#define WHEEL(...) WHEEL_ON("base", __VA_ARGS__)
#define ROUND "<origin rpy='1.5707963267948966 0 0'/>"
#define CYLINDER(radius, width)                                                                    \
    ROUND "<geometry><cylinder radius='" radius "' length='" width "'/></geometry>"
#define SMALL INERTIAL("0.4", "0.0006", "0.001", "0.0006")
#define LARGE INERTIAL("2.6", "0.024", "0.044", "0.024")
#define CHASSIS                                                                                    \
    BASE("0 0 0.02", INERTIAL("6", "0.06", "0.07", "0.1"),                                         \
         "<collision><geometry><box size='0.2 0.2 0.05'/></geometry></collision>")
/* One castor ahead and one behind, with little friction, so that they slide sideways */
#define CASTORS                                                                                    \
    "<link name='c'><collision><origin xyz='0.12 0 -0.05'/><geometry><sphere radius='0.03'/>"      \
    "</geometry></collision><collision><origin xyz='-0.12 0 -0.05'/><geometry>"                    \
    "<sphere radius='0.03'/></geometry></collision></link><joint name='cj' type='fixed'>"          \
    "<parent link='base'/><child link='c'/></joint>"
#define TWO(shape)                                                                                 \
    CHASSIS CASTORS WHEEL("left", "0 0.15 0", "0 1 0", SMALL, shape)                               \
        WHEEL("right", "0 -0.15 0", "0 1 0", SMALL, shape) "</robot>"
/* A disc that lies 20 mm above the ground; a capsule about it would reach down to the ground */
#define DISC                                                                                       \
    "<link name='disc'><inertial><mass value='0.1'/><inertia ixx='0.001' iyy='0.001' izz='0.001' " \
    "ixy='0' ixz='0' iyz='0'/></inertial><collision><origin rpy='1.5707963267948966 0 0'/>"        \
    "<geometry><mesh filename='wheel.obj'/></geometry></collision></link>"                         \
    "<joint name='d' type='revolute'><parent link='base'/><child link='disc'/>"                    \
    "<origin xyz='0.05 0 -0.04'/><axis xyz='0 0 1'/>"                                              \
    "<limit lower='-1' upper='1' effort='5' velocity='5'/></joint>"
/* A castor whose wheel trails, without a transmission */
#define SWIVEL(name, place)                                                                        \
    "<link name='" name "'>" SMALL "</link><joint name='" name "_swivel' type='continuous'>"       \
    "<parent link='base'/><child link='" name "'/><origin xyz='" place "'/><axis xyz='0 0 1'/>"    \
    "</joint>" WHEEL_ON(name, name "_roll", "-0.02 0 -0.03", "0 1 0", SMALL,                       \
                        CYLINDER("0.03", "0.005"))
#define PAIR(axis)                                                                                 \
    WHEEL("left", "0 0.15 0", axis, SMALL, CYLINDER("0.08", "0.03"))                               \
    WHEEL("right", "0 -0.15 0", axis, SMALL, CYLINDER("0.08", "0.03"))
#define DAMPED "0 1 0'/><dynamics damping='6"
#define LEG(name, place)                                                                           \
    "<link name='" name "_leg'>" SMALL "</link><joint name='" name "_hip' type='revolute'>"        \
    "<parent link='base'/><child link='" name "_leg'/><origin xyz='" place "'/>"                   \
    "<axis xyz='0 1 0'/><limit lower='-1' upper='1' effort='100' "                                 \
    "velocity='10'/></joint>" WHEEL_ON(name "_leg", name, "0 0 -0.2", "0 1 0", SMALL,              \
                                       CYLINDER("0.08", "0.03"))
#define LEGS(side, y) LEG(side, "0.2 " y " 0") LEG(side "2", "-0.2 " y " 0")
#define LEGGED                                                                                     \
    BASE("0 0 0.02", INERTIAL("6", "0.06", "0.07", "0.1"),                                         \
         "<collision><geometry><box size='0.4 0.2 0.05'/></geometry></collision>")                 \
    LEGS("left", "0.15") LEGS("right", "-0.15") "</robot>"
#define FOUR                                                                                       \
    BASE("0 0 0.12", INERTIAL("46", "0.6", "1.7", "2"),                                            \
         "<collision><geometry><box size='0.98 0.5 0.12'/></geometry></collision>")                \
    WHEEL("left", "0.256 0.285 0", "0 1 0", LARGE, CYLINDER("0.165", "0.114"))                     \
    WHEEL("right", "0.256 -0.285 0", "0 1 0", LARGE, CYLINDER("0.165", "0.114"))                   \
    WHEEL("left2", "-0.256 0.285 0", "0 1 0", LARGE, CYLINDER("0.165", "0.114"))                   \
    WHEEL("right2", "-0.256 -0.285 0", "0 1 0", LARGE, CYLINDER("0.165", "0.114")) "</robot>"
/* Two wheels alone; the torso hangs below their axle */
#define HANGING                                                                                    \
    "<robot name='r'><link name='base'><inertial><origin xyz='0 0 -0.08'/><mass value='8'/>"       \
    "<inertia ixx='0.05' iyy='0.04' izz='0.06' ixy='0' ixz='0' iyz='0'/></inertial></link>" WHEEL( \
        "left", "0 0.2 0", "0 1 0", LARGE, CYLINDER("0.165", "0.05"))                              \
        WHEEL("right", "0 -0.2 0", "0 -1 0", LARGE, CYLINDER("0.165", "0.05")) "</robot>"

struct ride {
    const char *name, *text;
    double radius, track;    /* m; the track is the distance between the wheels */
    double left, right;      /* angles of the joints at the end, rad */
    double right_sign;       /* of the joint's axis */
    double way_off, yaw_off; /* allowed errors as shares of way and yaw; yaw_off 0: any yaw */
    double ripple_m;         /* allowed, of the height of the axle while it drives */
};

/* State of a ride: place of the base, driven distance, heading. */
struct watch {
    struct simulator *simulator;
    bool begun;
    double low, high, from[3], place[3], yaw, pitch, way;
};

static struct arena files;
static char folder[64];

FIXTURE(open_folder)
{
    strcpy(folder, "/tmp/hil-wheels-XXXXXX");
    return arena_init(&files, (size_t)1 << 30, NULL) == ERROR_NONE && mkdtemp(folder) ? 0 : -1;
}

FIXTURE(close_folder)
{
    char command[96];

    arena_fini(&files);
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    return system(command);
}

static const char *write_text(const char *name, const char *text)
{
    static char path[2][128];
    static int next;
    FILE *out;

    next = !next;
    snprintf(path[next], sizeof path[next], "%s/%s", folder, name);
    out = fopen(path[next], "w");
    assert_non_null(out);
    fputs(text, out);
    assert_int_equal(fclose(out), 0);
    return path[next];
}

/* Writes an OBJ file of a wheel about y with 24 sides and a hub on either side. */
static void write_wheel(void)
{
    enum { SIDES = 24 };
    char path[128];
    FILE *out;

    snprintf(path, sizeof path, "%s/wheel.obj", folder);
    out = fopen(path, "w");
    assert_non_null(out);
    for (int i = 0; i < 2 * SIDES; i++) {
        fprintf(out, "v %.9f %.3f %.9f\n", 0.08 * cos(2 * M_PI * i / SIDES),
                i < SIDES ? -0.015 : 0.015, 0.08 * sin(2 * M_PI * i / SIDES));
    }
    fputs("v 0 -0.02 0\nv 0 0.02 0\n", out);
    for (int i = 1; i <= SIDES; i++) {
        const int j = i % SIDES + 1;

        fprintf(out, "f %d %d %d %d\nf %d %d %d\nf %d %d %d\n", i, SIDES + i, SIDES + j, j,
                2 * SIDES + 1, i, j, 2 * SIDES + 2, SIDES + j, SIDES + i);
    }
    assert_int_equal(fclose(out), 0);
}

static void watch_ride(void *context, int64_t now_ns)
{
    struct watch *w = context;
    const struct body_motion *base = plant_motion(simulator_plant(w->simulator));
    double turn = atan2(base->R[3], base->R[0]) - w->yaw;

    (void)now_ns;
    if (!w->begun) {
        w->begun = true;
        memcpy(w->from, base->p, sizeof w->from);
        memcpy(w->place, base->p, sizeof w->place);
        w->low = w->high = base->p[2];
    }
    w->way += hypot(base->p[0] - w->place[0], base->p[1] - w->place[1]);
    w->yaw += turn - 2 * M_PI * round(turn / (2 * M_PI));
    w->low = fmin(w->low, base->p[2]);
    w->high = fmax(w->high, base->p[2]);
    memcpy(w->place, base->p, sizeof w->place);
    w->pitch = asin(-base->R[6]);
}

static void ride(const struct ride *r)
{
    struct watch w = {0};
    struct import_request request = {.folder = folder, .force = true};
    struct task_input input = {0};
    struct simulator_observer observer = {&w, watch_ride};
    struct simulator_config config = {.clock = LOOP_CLOCK_FREE,
                                      .transport = TRANSPORT_LOCAL,
                                      .ticks = TICKS,
                                      .task = "follow",
                                      .observer = &observer,
                                      .task_input = &input};
    struct task_runner_status status;
    struct import_result result;
    const struct rig *rig;
    struct arena arena;
    struct error error;
    char rows[400], titles[200];
    const bool four = strstr(r->text, "left2") != NULL;

    request.file = write_text("r.urdf", r->text);
    assert_no_error(import_run(&request, &files, &result, &error), error.text);
    assert_true(result.standing[0] != '\0');
    assert_ok(arena_init(&arena, (size_t)1 << 30, &error));
    assert_no_error(rig_load(result.standing, &arena, &rig, &error), error.text);
    snprintf(titles, sizeof titles, "time_s,left_wheel_rad,right_wheel_rad%s",
             four ? ",left2_wheel_rad,right2_wheel_rad" : "");
    snprintf(rows, sizeof rows,
             four ? "%s\n0,0,0,0,0\n%d,%.9g,%.9g,%.9g,%.9g\n" : "%s\n0,0,0\n%d,%.9g,%.9g\n", titles,
             DRIVE_S, r->left, r->right_sign * r->right, r->left, r->right_sign * r->right);
    assert_no_error(rig_read_trajectory(rig, write_text("t.csv", rows), TRAJECTORY_CUBIC, &arena,
                                        &input.trajectory, &error),
                    error.text);
    config.rig = rig;
    assert_int_equal(rig->settle, strstr(r->text, "swivel") == NULL);
    config.hold = rig->hold;
    config.settle = rig->settle;
    w.simulator = rig_run_open(&config, &arena, NULL);
    simulator_run(w.simulator);
    task_runner_read(simulator_task_runner(w.simulator), &status);

    /* Closed form for rolling wheels. Joint angles are relative to the base, so its pitch counts */
    const double way = r->radius * ((r->left + r->right) / 2 + w.pitch);
    const double yaw = r->radius * (r->right - r->left) / r->track;
    const double chord = yaw != 0 ? way * sin(yaw / 2) / (yaw / 2) : way;
    const double apart = hypot(w.place[0] - w.from[0], w.place[1] - w.from[1]);

    print_message("# %s: way %.4f m of %.4f m, apart %.4f m of %.4f m, yaw %.4f rad of %.4f rad, "
                  "axle within %.2g m: %s\n",
                  r->name, w.way, way, apart, chord, w.yaw, yaw, w.high - w.low, status.message);
    assert_true(status.status == TASK_RUNNING);
    if (r->yaw_off > 0) {
        assert_true(fabs(apart - fabs(chord)) <= r->way_off * fmax(fabs(way), r->radius));
        assert_true(fabs(w.yaw - yaw) <= fmax(r->yaw_off * fabs(yaw), 0.01));
    }
    assert_true(w.high - w.low < r->ripple_m);
    rig_run_close(w.simulator, &arena, NULL);
}

TEST_WITH(wheels_roll_as_far_as_they_turn, open_folder, close_folder)
{
    static const char mesh[] = TWO("<geometry><mesh filename='wheel.obj'/></geometry>");
    static const char ball[] = TWO("<geometry><sphere radius='0.08'/></geometry>");
    static const char two[] = TWO(CYLINDER("0.08", "0.03"));
    static const char damped[] = CHASSIS CASTORS PAIR(DAMPED) "</robot>";
    static const char disc[] = CHASSIS CASTORS PAIR("0 1 0") DISC "</robot>";
    static const char swivels[] =
        CHASSIS PAIR("0 1 0") SWIVEL("a", "0.12 0 -0.02") SWIVEL("b", "-0.12 0 -0.02") "</robot>";
    static const struct ride row[] = {
        {"straight", two, 0.08, 0.3, 12, 12, 1, 0.01, 0.03, 1e-4},
        {"backward", two, 0.08, 0.3, -12, -12, 1, 0.01, 0.03, 1e-4},
        {"turn", two, 0.08, 0.3, -5, 5, 1, 0.01, 0.03, 1e-4},
        {"arc", two, 0.08, 0.3, 8, 12, 1, 0.01, 0.03, 1e-4},
        {"wheels of a mesh", mesh, 0.08, 0.3, 8, 12, 1, 0.01, 0.03, 1e-4},
        {"damped wheels", damped, 0.08, 0.3, 8, 12, 1, 0.01, 0.03, 1e-4},
        {"disc above the ground", disc, 0.08, 0.3, 8, 12, 1, 0.01, 0.03, 1e-4},
        {"castors that swivel", swivels, 0.08, 0.3, 8, 12, 1, 0.01, 0.03, 1e-3},
        {"castors turn", swivels, 0.08, 0.3, -5, 5, 1, 0.01, 0.03, 1e-3},
        {"balls", ball, 0.08, 0.3, 8, 12, 1, 0.01, 0.03, 1e-4},
        {"four wheels", FOUR, 0.165, 0.57, 10, 10, 1, 0.01, 0.03, 1e-3},
        {"wheels on legs", LEGGED, 0.08, 0.3, 10, 10, 1, 0.01, 0.03, 2e-3},
        {"torso below its axle", HANGING, 0.165, 0.4, 8, 8, -1, 0.01, 0.03, 1e-3},
    };

    write_wheel();
    for (size_t i = 0; i < ARRAY_COUNT(row); i++) {
        ride(&row[i]);
    }
}
