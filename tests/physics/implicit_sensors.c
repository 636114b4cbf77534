/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the sensors read after steps of the implicit integrator, on COMAN's rig with native contact:
 * against dopri5 with a tolerance of 1e-9, and against the laws of mechanics on what has moved, by
 * differences of the velocities from step to step. From the rig's own start, springs and layers
 * relaxed, through the transient and one squat of 10 cm in 2 s.
 */

#include "tests/physics/near.h"
#include "tests/physics/rig_squat.h"

enum { BEGIN = 300, SAMPLES = 2300, STEPS = 3, SENSORS = 4, PATCHES = 16 };

/* What the test hangs below the sensors of the feet */
static const struct robot_inertia below = {
    .mass = 0.6, .com = {0.02, -0.01, -0.05}, .I = {1e-3, 1e-4, 2e-4, 2e-3, -1e-4, 2e-3}};

/* The part below a sensor, world frame: the contacts' force on the sensor's body, and as it is
 * read. */
struct sensed {
    double mass, v[3]; /* of its center of mass */
    double contact[3], read[3];
};

struct sample {
    struct ft_sense ft[SENSORS];
    struct imu_sense imu;
    struct sensed sensed[SENSORS];
    double contact[3], patches[3]; /* all of it on the robot, N */
    double momentum[3];            /* kg m/s */
};

struct track {
    struct sample at[SAMPLES];
    size_t nft;
    double mass, gravity[3];
};

static void sense(const struct rig_scene *scene, size_t f, struct sensed *out)
{
    const struct robot_ft_sensor *sensor = &scene->robot->ft[f];
    const struct robot_frame *frame = &scene->robot->frame[sensor->frame];
    const struct body_motion *motion = &plant_motion(scene->plant)[frame->body];
    double R[9], arm[3], center[3];

    mat3_mul(motion->R, frame->rotation, R);
    mat3_apply(motion->R, frame->position, arm);
    mat3_apply(R, sensor->distal.com, center);
    for (int i = 0; i < 3; i++) {
        arm[i] += center[i];
        out->v[i] = motion->v[i];
    }
    vec3_add_cross(motion->w, arm, out->v);
    mat3_apply(R, plant_sensors(scene->plant)->ft[f].force_n, out->read);
    out->mass = sensor->distal.mass;
    for (size_t c = 0; c < scene->rig->contact.nbody; c++) {
        if (scene->rig->contact_body[c] == frame->body) {
            memcpy(out->contact, plant_contact_wrenches(scene->plant)[c].force,
                   sizeof out->contact);
        }
    }
}

static void observe(struct rig_scene *scene, struct sample *sample)
{
    const struct plant_sensors *sensors = plant_sensors(scene->plant);
    struct contact_patch patch[PATCHES];
    size_t count = plant_patches(scene->plant, patch, PATCHES);
    double center[3];

    *sample = (struct sample){.imu = sensors->imu};
    memcpy(sample->ft, sensors->ft, sensors->nft * sizeof *sensors->ft);
    for (size_t f = 0; f < sensors->nft; f++) {
        sense(scene, f, &sample->sensed[f]);
    }
    assert_true(count <= PATCHES);
    for (int i = 0; i < 3; i++) {
        for (size_t c = 0; c < scene->rig->contact.nbody; c++) {
            sample->contact[i] += plant_contact_wrenches(scene->plant)[c].force[i];
        }
        for (size_t p = 0; p < count; p++) {
            sample->patches[i] += patch[p].force[i]; /* the ground is first in each pair */
        }
    }
    plant_center_of_mass(scene->plant, center, sample->momentum);
}

static struct rig_scene_choice coman_with(enum plant_integrator integrator, int64_t substep_ns)
{
    return (struct rig_scene_choice){.file = "coman.yaml",
                                     .integrator = integrator,
                                     .substep_ns = substep_ns,
                                     .tolerance = 1e-9,
                                     .below = &below};
}

static void follow(enum plant_integrator integrator, int64_t substep_ns, struct track *track)
{
    const struct rig_scene_choice choice = coman_with(integrator, substep_ns);
    static struct rig_scene scene;
    double settled[RIG_SCENE_JOINTS];

    rig_scene_init(&scene, &choice);
    assert_true(scene.robot->nft <= SENSORS);
    rig_scene_settle(&scene);
    memcpy(settled, scene.reference, sizeof settled);
    rig_scene_reset(&scene);
    track->nft = scene.robot->nft;
    track->mass = scene.robot->total_mass;
    memcpy(track->gravity, scene.robot->gravity, sizeof track->gravity);
    for (int k = 0; k < SAMPLES; k++) {
        rig_squat_refer(&scene, settled, 1e-3 * (k - BEGIN));
        rig_scene_hold(&scene);
        observe(&scene, &track->at[k]);
    }
    rig_scene_fini(&scene);
}

/* Newton's law: the mean of what the contacts give the robot at the begin and the end of a step is
 * what its momentum has grown by, but for the curvature of the forces in between; what went through
 * a sensor is what its part below got else. */
TEST(what_is_sensed_is_what_has_moved_the_robot)
{
    static struct track track;
    const double h = 1e-3;
    double robot = 0.0, sensors = 0.0, patches = 0.0;

    follow(PLANT_IMPLICIT, 1000000, &track);
    for (int k = BEGIN; k < SAMPLES; k++) {
        const struct sample *now = &track.at[k], *last = &track.at[k - 1];

        for (int i = 0; i < 3; i++) {
            double rate = (now->momentum[i] - last->momentum[i]) / h;
            double contact = 0.5 * (now->contact[i] + last->contact[i]);

            robot = fmax(robot, fabs(rate - contact - track.mass * track.gravity[i]));
            patches = fmax(patches, fabs(now->patches[i] - now->contact[i]));
            for (size_t f = 0; f < track.nft; f++) {
                const struct sensed *s = &now->sensed[f], *before = &last->sensed[f];
                double a = (s->v[i] - before->v[i]) / h;
                double passed =
                    0.5 * (s->contact[i] + before->contact[i]) + s->mass * (track.gravity[i] - a);

                sensors = fmax(sensors, fabs(0.5 * (s->read[i] + before->read[i]) - passed));
            }
        }
    }
    print_message("# worst: robot %.1e N, sensors %.1e N, patches %.1e N\n", robot, sensors,
                  patches);
    assert_true(robot < 0.02);
    assert_true(sensors < 0.01);
    assert_true(patches < 1e-9);
}

/* RMS and largest difference of a number, offset bytes into the sample, after the transient */
static void compare(const struct track *found, const struct track *oracle, size_t offset,
                    double *rms, double *most)
{
    double sum = 0.0;

    *most = 0.0;
    for (int k = BEGIN; k < SAMPLES; k++) {
        double a, b;

        memcpy(&a, (const char *)&found->at[k] + offset, sizeof a);
        memcpy(&b, (const char *)&oracle->at[k] + offset, sizeof b);
        sum += (a - b) * (a - b);
        *most = fmax(*most, fabs(a - b));
    }
    *rms = sqrt(sum / (SAMPLES - BEGIN));
}

/* Of the worst foot along axis i of its sensor: force (RMS and most) and moment (RMS). */
static void compare_feet(const struct track *found, const struct track *oracle, int i,
                         double *force, double *force_most, double *moment)
{
    *force = *force_most = *moment = 0.0;
    for (size_t f = 0; f < found->nft; f++) {
        size_t offset =
            offsetof(struct sample, ft) + f * sizeof(struct ft_sense) + (size_t)i * sizeof(double);
        double rms, most;

        if (found->at[BEGIN].sensed[f].contact[2] > 0.0) {
            compare(found, oracle, offset + offsetof(struct ft_sense, force_n), &rms, &most);
            *force = fmax(*force, rms);
            *force_most = fmax(*force_most, most);
            compare(found, oracle, offset + offsetof(struct ft_sense, torque_nm), &rms, &most);
            *moment = fmax(*moment, rms);
        }
    }
    assert_true(*force > 0.0);
}

/* What is left is how far the steps lead from the exact path; it vanishes with them. */
TEST(the_feet_feel_what_they_do_with_exact_steps)
{
    /* N, N m, by axis, at a millisecond; 150 N stand on each foot */
    static const double force_bound[3] = {0.2, 0.02, 0.5}, most_bound[3] = {1.0, 0.1, 2.0};
    static const double moment_bound[3] = {0.01, 0.15, 0.002};
    static struct track oracle, found;
    double last[3] = {INFINITY, INFINITY, INFINITY};

    follow(PLANT_DOPRI5, 1000000, &oracle);
    for (int n = 0; n < STEPS; n++) {
        print_message("# h = %.2f ms:", 1.0 / (1 << n));
        follow(PLANT_IMPLICIT, 1000000 >> n, &found);
        for (int i = 0; i < 3; i++) {
            double force, most, moment;

            compare_feet(&found, &oracle, i, &force, &most, &moment);
            print_message(" %c %.4f N RMS, %.4f N at most, %.4f N m RMS;", "xyz"[i], force, most,
                          moment);
            assert_true(force < fmin(force_bound[i], 0.75 * last[i]));
            assert_true(most < most_bound[i]);
            assert_true(moment < moment_bound[i]);
            last[i] = force;
        }
        print_message("\n");
    }
}

/* What was set, not stepped to, is read as with any integrator: by the laws. */
TEST(a_state_that_was_set_is_sensed_by_the_laws)
{
    struct rig_scene_choice choice = coman_with(PLANT_IMPLICIT, 1000000);
    static struct rig_scene stepped, set;
    const struct plant_sensors *of_step, *of_laws;
    size_t count, same;
    double *from, *to, shear;

    rig_scene_init(&stepped, &choice);
    choice = coman_with(PLANT_RK4, 100000);
    rig_scene_init(&set, &choice);
    rig_scene_settle(&stepped);
    rig_scene_reset(&stepped);
    for (int k = 0; k < 50; k++) {
        rig_scene_hold(&stepped);
    }
    from = plant_state(stepped.plant, &count);
    to = plant_state(set.plant, &same);
    assert_int_equal(count, same);
    memcpy(to, from, count * sizeof *to);
    assert_ok(plant_sample(set.plant));
    of_step = plant_sensors(stepped.plant);
    of_laws = plant_sensors(set.plant);
    assert_int_equal(of_step->nft, of_laws->nft);
    shear = fabs(of_step->ft[0].force_n[0] - of_laws->ft[0].force_n[0]);
    print_message("# shear force of the step and of the laws: %.2e N apart\n", shear);
    assert_true(shear > 1e-6);

    /* Sampled twice it is the same; set to the same values, or pushed by nothing, see above */
    assert_ok(plant_sample(stepped.plant));
    assert_true(fabs(of_step->ft[0].force_n[0] - of_laws->ft[0].force_n[0]) == shear);
    to[7] = from[7] = from[7] + 1e-9;
    assert_ok(plant_sample(stepped.plant));
    assert_ok(plant_sample(set.plant));
    assert_memory_equal(of_step->ft, of_laws->ft, of_step->nft * sizeof *of_step->ft);
    assert_memory_equal(&of_step->imu, &of_laws->imu, sizeof of_step->imu);

    /* Clamped, where nothing was stepped to either */
    plant_clamp(stepped.plant, true);
    plant_clamp(set.plant, true);
    rig_scene_hold(&stepped);
    from = plant_state(stepped.plant, &count);
    memcpy(to, from, count * sizeof *to);
    assert_ok(plant_sample(set.plant));
    assert_memory_equal(of_step->ft, of_laws->ft, of_step->nft * sizeof *of_step->ft);
    assert_memory_equal(&of_step->imu, &of_laws->imu, sizeof of_step->imu);
    rig_scene_fini(&stepped);
    rig_scene_fini(&set);
}

/* Steps look through the whole state only when somebody may have written it; that changes nothing
 * where nobody has. */
TEST(a_state_that_was_handed_out_moves_as_another)
{
    const struct rig_scene_choice choice = coman_with(PLANT_IMPLICIT, 1000000);
    static struct rig_scene own, handed_out;
    size_t count;

    rig_scene_init(&own, &choice);
    rig_scene_init(&handed_out, &choice);
    assert_non_null(plant_state(handed_out.plant, &count));
    for (int k = 0; k < 300; k++) {
        rig_scene_hold(&own);
        rig_scene_hold(&handed_out);
        assert_ok(plant_sample(own.plant));
        assert_ok(plant_sample(handed_out.plant));
        assert_int_equal(plant_hash(own.plant), plant_hash(handed_out.plant));
    }
    rig_scene_fini(&own);
    rig_scene_fini(&handed_out);
}
