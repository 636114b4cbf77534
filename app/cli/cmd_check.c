/* SPDX-License-Identifier: Apache-2.0 */
/* coman-hil check: prints the contents of a rig or robot file, or its errors. */
#include "app/cli/cli.h"

#include "boards/protocol.h"
#include "manual/check.h"

#include <inttypes.h>

/* Prints size, mass, sensors and hash of a robot. */
static void check_print_robot(const struct robot *robot, const char *variant)
{
    size_t drives = 0;

    for (size_t j = 0; j < robot->njoint; j++) {
        drives += robot_joint_is_driven(&robot->joint[j]);
    }
    printf("robot       %s, variant %s, %s\n", robot->name, *variant ? variant : "default",
           robot->file);
    printf("            %zu bodies, %zu joints, %zu drives, %zu degrees of freedom, %.7g kg\n",
           robot->nbody, robot->njoint, drives, robot->nv, robot->total_mass);
    if (robot->ncoupling > 0) {
        printf("            %zu of the joints %s\n", robot->ncoupling,
               robot->ncoupling == 1 ? "follows another" : "follow others");
    }
    printf(
        "            %zu frames, %zu F/T sensors, %s inertial sensor, %zu poses, hash %016" PRIx64
        "\n",
        robot->nframe, robot->nft, robot->imu_frame < 0 ? "no" : "one", robot->npose, robot->hash);
}

/* Prints the free bodies of the scene. */
static void print_free_bodies(const struct rig *rig)
{
    for (size_t i = 0; i < rig->nfree; i++) {
        const struct plant_free_body *body = &rig->free[i];

        printf("  %-16s free body of %.7g kg at %g %g %g m\n", body->name, body->inertia.mass,
               body->position[0], body->position[1], body->position[2]);
    }
}

/* Prints contact pairs with a slack, and excluded pairs with the reasons. */
static void print_exceptions(const struct rig *rig)
{
    static const char *const why[] = {"the file leaves them out", "joined by ",
                                      "overlap in every pose", "overlap in pose "};
    const struct contact_config *contact = &rig->contact;

    for (size_t p = 0; p < contact->npair; p++) {
        const struct contact_pair *pair = &contact->pair[p];

        if (pair->slack_m > 0) {
            printf("slack       %s - %s: %.1f mm, overlap in a pose\n",
                   contact->surface[pair->a].name, contact->surface[pair->b].name,
                   1e3 * pair->slack_m);
        }
    }
    for (size_t i = 0; i < rig->nleft; i++) {
        const struct rig_left_pair *left = &rig->left[i];
        const char *what = left->what ? left->what : "";

        printf("left out    %s - %s: %s%s%s\n", contact->surface[left->a].name,
               contact->surface[left->b].name, why[left->why],
               left->why == RIG_LEFT_BY_FILE && left->what ? ": " : "", what);
    }
}

/* Prints the contact engine with its friction law, all surfaces with their materials, and the
 * pairs. */
static void check_print_scene(const struct rig *rig)
{
    static const char *const shapes[] = {"half space", "sphere", "box", "mesh", "capsule"};
    const struct contact_config *contact = &rig->contact;

    if (rig->contact_engine == RIG_CONTACT_NONE) {
        printf("scene       no contact engine\n");
        print_free_bodies(rig);
        return;
    }
    printf("scene       engine %s, %zu surfaces, %zu pairs\n",
           word_of(rig_engine_words, rig->contact_engine), contact->nsurface, contact->npair);
    printf("  friction  %s, transition velocity %g m/s\n",
           contact->friction == CONTACT_FRICTION_STICKING ? "sticking" : "regularized",
           contact->transition_velocity_m_s);
    print_free_bodies(rig);

    /* Shape of a surface, its place, its stiffness per area and its friction */
    for (size_t i = 0; i < contact->nsurface; i++) {
        const struct contact_surface *s = &contact->surface[i];
        const struct contact_material *m = &s->material;

        printf("  %-16s %s", s->name, shapes[s->shape]);
        if (s->shape == CONTACT_MESH) {
            printf(" of %zu faces", s->mesh->nface);
        }
        printf(" on %s, %.4g N/m3",
               s->body < 0 ? "the world" : rig_contact_name(rig, (size_t)s->body),
               m->young_pa / m->thickness_m);
        if (m->backing_pa_per_m > 0.0) {
            printf(" backed by %.4g", m->backing_pa_per_m);
        }
        printf(", friction %g static %g dynamic\n", m->static_friction, m->dynamic_friction);
    }
    printf("pairs       %zu\n", contact->npair);
    for (size_t s = 0; s < contact->nsurface; s++) {
        size_t count = 0;

        for (size_t p = 0; p < contact->npair; p++) {
            const struct contact_pair *pair = &contact->pair[p];
            int other = pair->a < pair->b ? pair->b : pair->a;

            if ((pair->a < pair->b ? pair->a : pair->b) == (int)s) {
                if (count++ == 0) {
                    printf("  %-16s with ", contact->surface[s].name);
                }
                printf("%s%s", count > 1 ? ", " : "", contact->surface[other].name);
            }
        }
        if (count) {
            printf("\n");
        }
    }
    print_exceptions(rig);
}

/* Returns the name of a joint; "spare" for -1. */
static const char *joint_name(const struct rig *rig, int joint)
{
    return joint < 0 ? "spare" : rig->robot->joint[joint].name;
}

/* Prints a board: address, kind, measured quantities, and whether it is external. */
static void print_board(const struct rig *rig, const struct board_config *board)
{
    const struct protocol *protocol = rig->bus[board->bus].protocol;
    const size_t most = protocol->axes_max;

    printf("    0x%02x ", board->address);
    switch (board->kind) {
    case BOARD_MOTOR:
        /* The joints of its axes, and unused axes if the protocol has them */
        printf("motor   ");
        for (size_t i = 0; i < most && (board->axis[i].joint >= 0 || protocol->spare_axes); i++) {
            printf("%s%s", i ? ", " : "", joint_name(rig, board->axis[i].joint));
        }
        printf("\n");
        break;
    case BOARD_FT:
        printf("F/T     %s, %g N, %g N m, every %g ms\n", rig->robot->ft[board->ft].name,
               board->full_scale[0], board->full_scale[3], (double)board->period_ns * 1e-6);
        break;
    case BOARD_INERTIAL:
        printf("inertial every %g ms\n", (double)board->period_ns * 1e-6);
        break;
    default:
        printf("torque  ");
        for (int i = 0; i < BOARD_CHANNELS; i++) {
            printf("%s%s", i ? ", " : "", joint_name(rig, board->torque_joint[i]));
        }
        printf(", %g N m, every %g ms\n", board->full_scale[0], (double)board->period_ns * 1e-6);
    }
    if (board->external) {
        printf("         external: a real board, silent after %g ms%s\n",
               (double)board->external_timeout_ns * 1e-6,
               board->kind != BOARD_MOTOR ? ""
               : board->external_torque   ? "; its joints follow its torque"
                                          : "; its joints follow its angles");
    }
}

/* Prints the errors of a sensor, unless it is ideal. */
static void print_error(const char *what, const char *unit, const struct sensor_error *e)
{
    static const struct sensor_error ideal;

    if (memcmp(e, &ideal, sizeof ideal) != 0) {
        printf("  %-16s noise %g, offset %g, gain error %g, step %g %s, %g ms late\n", what,
               e->noise_rms, e->offset, e->gain_error, e->lsb, unit, (double)e->latency_ns * 1e-6);
    }
    if (e->bandwidth_hz > 0.0 || e->hysteresis > 0.0 || e->instability_rms > 0.0) {
        printf("  %-16s bandwidth %g Hz (0: all passes), hysteresis %g of %g, instability %g in %g "
               "s\n",
               "", e->bandwidth_hz, e->hysteresis, e->full_scale, e->instability_rms,
               e->instability_s);
    }
}

/* Prints the sensors that are not ideal, and the armed faults. For joints it prints the first
 * one's errors, with a note if others differ. */
static void check_print_sensors(const struct rig *rig)
{
    const struct sensing_config *s = &rig->sensing;
    const struct sensor_joint *joint = s->joint;
    size_t differ = 0;

    /* Compare the errors of all joints with the first one's */
    for (size_t j = 1; j < s->njoint; j++) {
        differ += memcmp(&joint[j].link_encoder, &joint[0].link_encoder,
                         offsetof(struct sensor_joint, clock) -
                             offsetof(struct sensor_joint, link_encoder)) != 0;
    }
    printf("sensors     of %zu joints, %zu F/T, seed %" PRIu64 "%s\n", s->njoint, s->nft, rig->seed,
           differ ? ", not all joints alike" : "");
    if (s->njoint > 0) {
        print_error("link encoder", "rad", &joint[0].link_encoder);
        print_error("motor encoder", "rad", &joint[0].motor_encoder);
        print_error("current", "A", &joint[0].current);
        print_error("torque", "N m", &joint[0].torque);
        print_error("temperature", "K", &joint[0].temperature);
    }
    if (s->nft > 0) {
        print_error("F/T force", "N", &s->ft[0].force);
        print_error("F/T torque", "N m", &s->ft[0].torque);
    }
    print_error("gyro", "rad/s", &s->imu.gyro);
    print_error("accelerometer", "m/s2", &s->imu.accel);
    print_error("magnetometer", "T", &s->imu.magnetic);
    print_error("orientation", "of 1", &s->imu.orientation);
    if (s->imu.ahrs.on) {
        printf("  attitude filter  %g /s to the specific force, %g /s to north, bias %g /s2\n",
               s->imu.ahrs.accel_per_s, s->imu.ahrs.magnetic_per_s, s->imu.ahrs.bias_per_s2);
    }
    if (s->clocks.period_ns > 0) {
        printf("  boards' clocks   %g ms, %g ppm\n", (double)s->clocks.period_ns * 1e-6,
               s->clocks.drift_ppm);
    }
    printf("faults      %zu armed\n", rig->nfault);
    for (size_t i = 0; i < rig->nfault; i++) {
        printf("  %s\n", rig->fault[i].name);
    }
}

/* Prints a rig. Creates its boards first, because they check more than the file's reader. */
static int check_print_rig(void *context, const struct rig *rig, struct arena *arena)
{
    struct boards *boards;
    struct error error;

    (void)context;
    if (boards_create(&rig->boards, arena, &boards, &error)) {
        error_prefix(&error, "%.200s", rig->file);
        return command_fail("check", &error);
    }
    printf("rig         %s, %s\n", rig->name, rig->file);
    check_print_robot(rig->robot, rig->variant);

    /* Print clock, integration and the start of a run */
    static const char *const holds[] = {"free", "held until all motors are on", "held"};
    const struct robot_pose *pose = &rig->robot->pose[robot_find_pose(rig->robot, rig->pose)];
    size_t moved = 0;

    printf("time        clock %s, tick %g ms = %zu x %g ms, %s, dynamics %s\n",
           word_of(loop_clock_words, rig->clock), (double)rig->tick_ns * 1e-6, rig->substeps,
           (double)rig->substep_ns * 1e-6, word_of(rig_integrator_words, rig->integrator),
           word_of(rig_dynamics_words, rig->dynamics));
    for (size_t j = 0; j < rig->robot->njoint; j++) {
        moved += rig->joint[j] != pose->joint[j];
    }
    printf("start       pose %s with %zu joints elsewhere, base at %g %g %g m, supply %g V, links "
           "%s%s\n",
           rig->pose, moved, rig->base_position[0], rig->base_position[1], rig->base_position[2],
           rig->supply_v, holds[rig->hold], rig->settle ? ", settled" : "");

    /* Print the real-time settings, and the identifiers of lockstep */
    const struct rig_realtime *rt = &rig->realtime;
    char cpu[16] = "any CPU";

    if (rt->cpu >= 0) {
        snprintf(cpu, sizeof cpu, "CPU %d", rt->cpu);
    }
    printf("real time   priority %d, %s, memory %s, on overrun %s\n", rt->priority, cpu,
           rt->lock_memory ? "locked" : "not locked", word_of(loop_overrun_words, rt->overrun));
    printf("lockstep    STEP 0x%03x on %s, DONE 0x%03x, silence reported after %g s\n",
           (unsigned)rig->lockstep.step_id, rig->bus[rig->lockstep.bus].name,
           (unsigned)rig->lockstep.done_id, (double)rig->lockstep.partner_timeout_ns * 1e-9);
    check_print_scene(rig);
    check_print_sensors(rig);

    /* Print each bus with its worst-case load, relative to its bit rate, and its boards */
    const int64_t command = rig->servo.command_period_ns;

    printf("buses       %zu, %zu boards, %zu driven joints, %zu F/T sensors\n", rig->nbus,
           rig->boards.nboard, rig->naxis, rig->nft);
    printf("            worst-case load: telemetry at the host's default policy + voltages every "
           "%g ms\n",
           (double)command * 1e-6);
    for (size_t i = 0; i < rig->nbus; i++) {
        const struct rig_bus *bus = &rig->bus[i];
        double telemetry, commands, percent = 100.0 / (double)bus->bitrate;

        rig_bus_load(rig, i, command, &telemetry, &commands);
        printf("  %-16s %s, %g kbit/s, load %.1f %% + %.1f %% = %.1f %%%s\n", bus->name,
               bus->interface, (double)bus->bitrate * 1e-3, telemetry * percent, commands * percent,
               (telemetry + commands) * percent,
               (telemetry + commands) * percent > 100.0 ? ", more than it carries" : "");
        if (rig_bus_capacity(rig, i, command) > 0) {
            printf("    carries        %zu such axes at 1 kHz, %zu at 500 Hz, %zu at 250 Hz, %zu "
                   "at 100 Hz\n",
                   rig_bus_capacity(rig, i, 1000000), rig_bus_capacity(rig, i, 2000000),
                   rig_bus_capacity(rig, i, 4000000), rig_bus_capacity(rig, i, 10000000));
        }

        /* The boards of this bus, in the order of the rig */
        for (size_t k = 0; k < rig->boards.nboard; k++) {
            if (rig->boards.board[k].bus == (int)i) {
                print_board(rig, &rig->boards.board[k]);
            }
        }
    }
    rig_command_warn_load("check", rig);
    return STATUS_OK;
}

static enum error_code check_print_robot_file(const void *variant, const struct robot *robot,
                                              struct arena *arena, struct error *error)
{
    (void)arena;
    (void)error;
    check_print_robot(robot, variant ? variant : "");
    return ERROR_NONE;
}

int cmd_check(int argc, char **argv)
{
    static const char *file, *variant;
    static bool robot;
    static const struct option_spec options[] = {
        {"--robot", OPTION_FLAG, NULL, "RIG is a robot's file or name, not a rig's",
         .value = &robot},
        {"--variant", OPTION_STRING, "NAME", "with --robot: the variant of the robot to check",
         .value = &variant},
    };
    static const struct operand_spec operands[] = {
        {"RIG", "a rig's file or name; with --robot a robot's", true, &file, .noun = "rigs"}};
    static const struct command_spec spec = {
        .name = "check",
        .summary = "Check a rig or a robot file with everything it refers to, and print its "
                   "contents.",
        OPTION_TABLE(options),
        OPERAND_TABLE(operands),
        .manual = MANUAL_CHECK,
    };
    struct error error;
    int status;

    if (!options_read(&spec, argc, argv, &status)) {
        return status;
    }
    /* A rig file already gives its robot's variant */
    if (variant && !robot) {
        error_set(&error, ERROR_INPUT,
                  "--variant: found without --robot, expected with it; a rig "
                  "file names its robot's variant itself");
        return options_fail(&spec, &error);
    }
    return robot ? robot_command("check", file, variant, variant, check_print_robot_file)
                 : rig_command("check", file, NULL, check_print_rig);
}
