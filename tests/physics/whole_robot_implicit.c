/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The implicit integrator on COMAN's rig, native contact, against dopri5 with a tolerance of 1e-9:
 * from the rig's own start, springs and layers relaxed, through the transient of 0.2 s and one
 * squat of 10 cm in 2 s, twice as fast as the rig's.
 */
#include <time.h>

#include "tests/figure.h"
#include "tests/physics/near.h"
#include "tests/physics/rig_squat.h"

enum { BEGIN = 200, SAMPLES = 2300, STEPS = 3 }; /* ms; BEGIN: after the transient */

struct track {
    double q[SAMPLES][RIG_SCENE_JOINTS], feet[SAMPLES];
    double seconds; /* of the machine */
};

static void follow(enum plant_integrator integrator, int64_t substep_ns, struct track *track)
{
    const struct rig_scene_choice choice = {.file = "coman.yaml",
                                            .integrator = integrator,
                                            .substep_ns = substep_ns,
                                            .tolerance = 1e-9};
    static struct rig_scene scene;
    double settled[RIG_SCENE_JOINTS];
    struct timespec begin, end;

    rig_scene_init(&scene, &choice);
    rig_scene_settle(&scene);
    memcpy(settled, scene.reference, sizeof settled);
    rig_scene_reset(&scene);
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (int k = 0; k < SAMPLES; k++) {
        rig_squat_refer(&scene, settled, 1e-3 * (k - BEGIN));
        rig_scene_hold(&scene);
        for (size_t j = 0; j < scene.robot->njoint; j++) {
            track->q[k][j] = plant_sensors(scene.plant)->motor[j].q;
        }
        track->feet[k] = rig_scene_feet(&scene);
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    track->seconds =
        (double)(end.tv_sec - begin.tv_sec) + 1e-9 * (double)(end.tv_nsec - begin.tv_nsec);
    rig_scene_fini(&scene);
}

/* RMS from a sample on: of the worst joint (rad), and of the feet's force as a part of it */
static void compare(const struct track *found, const struct track *oracle, int from, double *joint,
                    double *force)
{
    double off = 0.0, size = 0.0;

    *joint = 0.0;
    for (int j = 0; j < RIG_SCENE_JOINTS; j++) {
        double sum = 0.0;

        for (int k = from; k < SAMPLES; k++) {
            double difference = found->q[k][j] - oracle->q[k][j];

            sum += difference * difference;
        }
        *joint = fmax(*joint, sqrt(sum / (SAMPLES - from)));
    }
    for (int k = from; k < SAMPLES; k++) {
        off += (found->feet[k] - oracle->feet[k]) * (found->feet[k] - oracle->feet[k]);
        size += oracle->feet[k] * oracle->feet[k];
    }
    *force = sqrt(off / size);
}

TEST(squatting_it_is_where_dopri5_is_and_of_second_order)
{
    static struct track oracle, found;
    double knee, last = 0.0;

    follow(PLANT_DOPRI5, 1000000, &oracle);
    knee = oracle.q[BEGIN + 1000][3] - oracle.q[BEGIN][3];
    print_message("# the oracle bends the knees by %.3f rad and takes %.2f s\n", knee,
                  oracle.seconds);
    assert_true(knee > 0.4);
    for (int n = 0; n < STEPS; n++) {
        int64_t substep_ns = 1000000 >> n;
        double joint, force;

        follow(PLANT_IMPLICIT, substep_ns, &found);
        compare(&found, &oracle, 0, &joint, &force);
        print_message("# h = %.2f ms, from the first tick: worst joint %.2e rad RMS, foot force "
                      "%.3f %% RMS\n",
                      1e-6 * (double)substep_ns, joint, 100.0 * force);
        if (n == 0) {
            figure_hold("squat_start_rad", joint);
            figure_hold("squat_start_percent", 100.0 * force);
        }
        compare(&found, &oracle, BEGIN, &joint, &force);
        print_message("# h = %.2f ms: worst joint %.2e rad RMS, foot force %.3f %% RMS; %.3f s\n",
                      1e-6 * (double)substep_ns, joint, 100.0 * force, found.seconds);
        assert_true(joint < 2e-5);
        assert_true(force < 1e-3);
        if (n == 0) {
            figure_hold("squat_rad", joint);
            figure_hold("squat_percent", 100.0 * force);
        } else {
            assert_near(log2(last / joint), 2.0, 0.1);
        }
        last = joint;
    }
}
