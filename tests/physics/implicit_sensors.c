/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the sensors read after implicit steps of a millisecond, on rigs with native contact: against
 * dopri5 with a tolerance of 1e-9, and against Newton's law for all bodies by differences in time.
 * COMAN from its rig's own start, springs and layers relaxed, through the transient of 0.2 s and one
 * squat of 10 cm in 2 s.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "tests/physics/near.h"
#include "tests/physics/rig_scene.h"

enum { BEGIN = 300, SAMPLES = 2300, STEPS = 3, SENSORS = 2, AXES = 6, IMU = 3, FEET = 3 };

static const double depth_m = 0.1, period_s = 2.0;
static const double thigh_m = 0.2258, shank_m = 0.201;

static const char *const pitch[2][3] = {{"RHipSag", "RKneeSag", "RAnkSag"},
                                        {"LHipSag", "LKneeSag", "LAnkSag"}};
static const char *const sensor_name[SENSORS] = {"r_leg_ft", "l_leg_ft"};

struct sample {
    double ft[SENSORS][AXES]; /* N, N m */
    double specific[IMU];     /* m/s2 */
    double feet[FEET];        /* of the contacts, N */
    double momentum[3];       /* kg m/s */
};

struct track {
    struct sample at[SAMPLES];
    double mass, gravity[3];
};

/* Angles of hip, knee and ankle with the hips sunk by depth vertically over flat feet, trunk and feet
 * turned as at the start. */
static void leg_angles(const double start[3], double depth, double angle[3])
{
    double lean = start[0] + start[1] + start[2], thigh = -(start[1] + start[2]);
    double height = thigh_m * cos(thigh) + shank_m * cos(thigh + start[1]) - depth;
    double ahead = thigh_m * sin(thigh) + shank_m * sin(thigh + start[1]);
    double square = height * height + ahead * ahead, turned;

    angle[1] = acos((square - thigh_m * thigh_m - shank_m * shank_m) / (2.0 * thigh_m * shank_m));
    turned =
        atan2(ahead, height) - atan2(shank_m * sin(angle[1]), thigh_m + shank_m * cos(angle[1]));
    angle[0] = turned + lean;
    angle[2] = -turned - angle[1];
}

/* references of the legs at ms k, from those that keep the start */
static void squat(struct rig_scene *scene, const double settled[RIG_SCENE_JOINTS], int k)
{
    double t = fmax(0.0, fmin(period_s, 1e-3 * (k - BEGIN)));

    for (int side = 0; side < 2; side++) {
        double start[3], angle[3];
        int joint[3];

        for (int n = 0; n < 3; n++) {
            joint[n] = robot_find_joint(scene->robot, pitch[side][n]);
            assert_true(joint[n] >= 0);
            start[n] = scene->rig->joint[joint[n]];
        }
        leg_angles(start, 0.5 * depth_m * (1.0 - cos(2.0 * M_PI * t / period_s)), angle);
        for (int n = 0; n < 3; n++) {
            scene->reference[joint[n]] = settled[joint[n]] + angle[n] - start[n];
        }
    }
}

static void observe(struct rig_scene *scene, struct sample *sample)
{
    const struct plant_sensors *sensors = plant_sensors(scene->plant);
    const struct robot *robot = scene->robot;
    double center[3];

    *sample = (struct sample){0};
    for (size_t f = 0; f < robot->nft; f++) {
        for (int s = 0; s < SENSORS; s++) {
            if (strcmp(robot->ft[f].name, sensor_name[s]) == 0) {
                memcpy(sample->ft[s], sensors->ft[f].force_n, sizeof sensors->ft[f].force_n);
                memcpy(sample->ft[s] + 3, sensors->ft[f].torque_nm, sizeof sensors->ft[f].torque_nm);
            }
        }
    }
    memcpy(sample->specific, sensors->imu.accel_m_s2, sizeof sample->specific);
    for (size_t c = 0; c < scene->rig->contact.nbody; c++) {
        for (int i = 0; i < 3; i++) {
            sample->feet[i] += plant_contact_wrenches(scene->plant)[c].force[i];
        }
    }
    plant_centre_of_mass(scene->plant, center, sample->momentum);
}

static void follow(enum plant_integrator integrator, int64_t substep_ns, struct track *track)
{
    const struct rig_scene_choice choice = {.file = "coman.yaml",
                                            .integrator = integrator,
                                            .substep_ns = substep_ns,
                                            .tolerance = 1e-9};
    static struct rig_scene scene;
    double settled[RIG_SCENE_JOINTS];

    rig_scene_init(&scene, &choice);
    rig_scene_settle(&scene);
    memcpy(settled, scene.reference, sizeof settled);
    rig_scene_reset(&scene);
    track->mass = scene.robot->total_mass;
    memcpy(track->gravity, scene.robot->gravity, sizeof track->gravity);
    for (int k = 0; k < SAMPLES; k++) {
        squat(&scene, settled, k);
        rig_scene_hold(&scene);
        observe(&scene, &track->at[k]);
    }
    rig_scene_fini(&scene);
}

/* RMS and largest difference of a number of the sample after the transient */
static void compare(const struct track *found, const struct track *oracle, size_t offset,
                    double *rms, double *most)
{
    double sum = 0.0;

    *most = 0.0;
    for (int k = BEGIN; k < SAMPLES; k++) {
        const double *a = (const double *)((const char *)&found->at[k] + offset);
        const double *b = (const double *)((const char *)&oracle->at[k] + offset);

        sum += (*a - *b) * (*a - *b);
        *most = fmax(*most, fabs(*a - *b));
    }
    *rms = sqrt(sum / (SAMPLES - BEGIN));
}

/* the worst of count numbers from offset on; the largest differences go to most */
static double worst_of(const struct track *found, const struct track *oracle, size_t offset,
                       int count, double *most)
{
    double worst = 0.0;

    *most = 0.0;
    for (int i = 0; i < count; i++) {
        double rms, largest;

        compare(found, oracle, offset + (size_t)i * sizeof(double), &rms, &largest);
        print_message(" %.4f (%.4f)", rms, largest);
        worst = fmax(worst, rms);
        *most = fmax(*most, largest);
    }
    return worst;
}

int main(void) {
    static struct track oracle, found;
    follow(PLANT_DOPRI5, 1000000, &oracle);
    for (int n = 0; n < STEPS; n++) {
        double most;
        follow(PLANT_IMPLICIT, 1000000 >> n, &found);
        print_message("h = %g ms\n ft r", 1.0 / (1 << n));
        worst_of(&found, &oracle, offsetof(struct sample, ft), AXES, &most);
        print_message("\n ft l");
        worst_of(&found, &oracle, offsetof(struct sample, ft[1]), AXES, &most);
        print_message("\n imu");
        worst_of(&found, &oracle, offsetof(struct sample, specific), IMU, &most);
        print_message("\n feet");
        worst_of(&found, &oracle, offsetof(struct sample, feet), FEET, &most);
        double worst[3] = {0}, sum[3] = {0};
        for (int k = BEGIN; k + 1 < SAMPLES; k++)
            for (int i = 0; i < 3; i++) {
                double e = (found.at[k + 1].momentum[i] - found.at[k].momentum[i]) / 1e-3 - found.at[k + 1].feet[i] - found.mass * found.gravity[i];
                worst[i] = fmax(worst[i], fabs(e));
                sum[i] += e * e;
            }
        print_message("\n newton (backward difference at 1 ms)");
        for (int i = 0; i < 3; i++) print_message(" %.4f (%.4f)", sqrt(sum[i] / (SAMPLES - BEGIN)), worst[i]);
        print_message("\n");
    }
    return 0;
}
