/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The numbers of the rigs that are shipped, which no other test would miss: friction, full scales,
 * limits, the order of axes, gains. What a rig has become is told in words and compared with what
 * was once read from the sources, line by line.
 */
#include "boards/protocol.h"
#include "rig/rig.h"

#include "base/array.h"

#include <stdio.h>
#include <string.h>

#include "tests/physics/near.h"
#include "tests/unit/arena_fixture.h"
#include "tests/test.h"

enum { LINE = 256, LINES = 160 };

static char line[LINES][LINE];
static size_t lines;
static const struct rig *rig;

static void __attribute__((format(printf, 1, 2))) add(const char *format, ...)
{
    va_list arguments;

    assert_true(lines < LINES);
    va_start(arguments, format);
    vsnprintf(line[lines++], LINE, format, arguments);
    va_end(arguments);
}

static void __attribute__((format(printf, 1, 2))) append(const char *format, ...)
{
    char *to = line[lines - 1];
    size_t used = strlen(to);
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(to + used, LINE - used, format, arguments);
    va_end(arguments);
}

static const char *joint_name(int joint)
{
    return joint < 0 ? "-" : rig->robot->joint[joint].name;
}

static void tell_time_and_start(void)
{
    add("%s: %s, tick %g ms of %zu, clock %d, integrator %d, personality %s, %g V, %g ohm",
        rig->name, rig->robot->name, (double)rig->tick_ns * 1e-6, rig->substeps, rig->clock,
        rig->integrator, rig->boards.bus ? rig->boards.bus[0].protocol->name : "none",
        rig->supply_v, rig->supply_ohm);
    add("start: %s, hold %d, settle %d, lockstep bus %d 0x%x 0x%x %g s, priority %d, cpu %d",
        rig->pose, rig->hold, rig->settle, rig->lockstep.bus, (unsigned)rig->lockstep.step_id,
        (unsigned)rig->lockstep.done_id, (double)rig->lockstep.partner_timeout_ns * 1e-9,
        rig->realtime.priority, rig->realtime.cpu);
}

static void tell_scene(void)
{
    add("contact: engine %d, law %d, friction %d, transition %g m/s", rig->contact_engine,
        rig->contact.mesh_law, rig->contact.friction, rig->contact.transition_velocity_m_s);
    add("pairs:");
    for (size_t i = 0; i < rig->nlisted_pair; i++) {
        append(" %s-%s", rig->contact.surface[rig->contact.pair[i].a].name,
               rig->contact.surface[rig->contact.pair[i].b].name);
    }
    for (size_t i = 0; i < rig->contact.nsurface; i++) {
        const struct contact_surface *s = &rig->contact.surface[i];
        const struct contact_material *m = &s->material;

        if (i > 0 && s->shape == CONTACT_CAPSULE && s[-1].shape == CONTACT_CAPSULE) {
            assert_memory_equal(m, &s[-1].material, sizeof *m); /* all of one shell */
            continue;
        }
        add("%s: %g Pa / %g m, %g s/m, %g %g %g s/m",
            s->shape == CONTACT_CAPSULE ? "capsules" : s->name, m->young_pa, m->thickness_m,
            m->dissipation_s_per_m, m->static_friction, m->dynamic_friction, m->viscous_friction);
        if (m->backing_pa_per_m > 0.0) {
            append(" on %g Pa/m", m->backing_pa_per_m);
        }
        if (s->shape == CONTACT_SPHERE || s->shape == CONTACT_BOX) {
            append(" at %g %g %g", s->position[0], s->position[1], s->position[2]);
        }
    }
}

static void tell_board(const struct board_config *board)
{
    add("%s 0x%02x kind %d %g ms:", rig->bus[board->bus].name, board->address, board->kind,
        (double)board->period_ns * 1e-6);
    for (size_t k = 0; k < BOARD_AXES_MAX && board->kind == BOARD_MOTOR; k++) {
        const struct board_axis_config *axis = &board->axis[k];

        if (axis->joint >= 0) {
            append(" %zu %s %g A %g C", k, joint_name(axis->joint), axis->current_limit_a,
                   axis->temperature_limit_c);
        }
    }
    for (size_t k = 0; k < BOARD_CHANNELS && board->kind == BOARD_TORQUE; k++) {
        append(" %s", joint_name(board->torque_joint[k]));
    }
    if (board->kind == BOARD_FT) {
        append(" %s", rig->robot->ft[board->ft].name);
    }
    for (size_t k = 0; k < BOARD_CHANNELS && board->kind != BOARD_MOTOR; k++) {
        if (k == 0 || board->full_scale[k] != board->full_scale[k - 1]) {
            append(" from %zu %g", k, board->full_scale[k]);
        }
    }
}

static void tell_drives(void)
{
    const struct board_config *board = rig->boards.board;

    add("axes: %zu,", rig->naxis);
    append(" %.6g %.6g ticks/rad, %g Nm, time-out %g s, strict %d",
           board->axis[0].joint_ticks_per_rad, board->axis[0].motor_ticks_per_rad,
           board->axis[0].torque_full_scale_nm, (double)board->command_timeout_ns * 1e-9,
           board->strict);
    for (size_t b = 0; b < rig->boards.nboard; b++) {
        const struct board_config *other = &board[b];

        for (size_t k = 0; k < BOARD_AXES_MAX && other->kind == BOARD_MOTOR; k++) {
            const struct board_axis_config *axis = &other->axis[k];

            if (axis->joint >= 0) { /* what all have in common; limits are the joint's */
                assert_true(axis->joint_ticks_per_rad == board->axis[0].joint_ticks_per_rad);
                assert_true(axis->motor_ticks_per_rad == board->axis[0].motor_ticks_per_rad);
                assert_true(axis->torque_full_scale_nm == board->axis[0].torque_full_scale_nm);
                assert_true(axis->lower_rad == rig->robot->joint[axis->joint].lower);
                assert_true(axis->upper_rad == rig->robot->joint[axis->joint].upper);
            }
        }
    }
}

static void tell_tasks(void)
{
    for (size_t i = 0; i < rig->naxis; i++) {
        const struct servo_gains *g = &rig->servo.gains[i];

        if (i == 0 || memcmp(g, g - 1, sizeof *g) != 0) {
            add("from %s: kp %g ki %g kd %g kw %g trim %g load %g limit %g", rig->axis[i].joint,
                g->kp_v_per_rad, g->ki_v_per_rad_s, g->kd_v_s_per_rad, g->kw_v_s_per_rad,
                g->trim_per_s, g->load_v_per_nm, g->limit_v);
        }
    }
    add("command %g ms, squat %g %g %g m, %g s, %d cycles",
        (double)rig->servo.command_period_ns * 1e-6, rig->squat.thigh_m, rig->squat.shank_m,
        rig->squat.depth_m, rig->squat.period_s, (int)rig->squat.cycles);
    for (size_t i = 0; i < rig->grasp.nphase; i++) {
        const struct grasp_phase *p = &rig->grasp.phase[i];

        add("%s until %g s, closed %d: %g %g %g %g", p->name, p->until_s, p->closed, p->arm_rad[0],
            p->arm_rad[1], p->arm_rad[2], p->arm_rad[3]);
    }
    if (rig->grasp.nphase > 0) {
        add("settle %g s, hold %g s, press %g N, carry %g N", rig->grasp.settle_s,
            rig->grasp.hold_s, rig->grasp.least_press_n, rig->grasp.least_carry_n);
    }
}

static void tell_rig(const char *name)
{
    struct error error;
    char path[512];

    snprintf(path, sizeof path, "%s/config/rigs/%s.yaml", HIL_SOURCE_DIR, name);
    if (rig_load(path, &arena, &rig, &error)) {
        fail_msg("%s", error.text);
    }
    lines = 0;
    tell_time_and_start();
    tell_scene();
    tell_drives();
    for (size_t b = 0; b < rig->boards.nboard; b++) {
        tell_board(&rig->boards.board[b]);
    }
    tell_tasks();
}

static void check_rig(const char *name, const char *const *expected, size_t count)
{
    size_t wrong = 0;

    tell_rig(name);
    for (size_t i = 0; i < lines || i < count; i++) {
        const char *is = i < lines ? line[i] : "nothing",
                   *was = i < count ? expected[i] : "nothing";

        if (strcmp(is, was) != 0) {
            print_error("found:    %s\nexpected: %s\n", is, was);
            wrong++;
        }
    }
    assert_int_equal(wrong, 0);
}

/* Friction of the paper's Table 2 on the layers of its walking code; full scales of iCub's F/T
 * boards at the legs, half as much at the arms; 49 N m at 12 A. */
static const char *const coman[] = {
    "coman: COMAN, tick 1 ms of 1, clock 0, integrator 1, personality icub, 48 V, 0 ohm",
    "start: crouch_home, hold 1, settle 0, lockstep bus 0 0x6f0 0x6ff 1 s, priority 80, cpu -1",
    "contact: engine 2, law 0, friction 1, transition 0.01 m/s",
    "pairs: ground-right_foot ground-left_foot",
    "ground: 100000 Pa / 0.001 m, 10 s/m, 1.1 0.9 0 s/m on 2e+10 Pa/m",
    "right_foot: 100000 Pa / 0.0002 m, 10 s/m, 1.1 0.9 0 s/m on 3e+10 Pa/m",
    "left_foot: 100000 Pa / 0.0002 m, 10 s/m, 1.1 0.9 0 s/m on 3e+10 Pa/m",
    "capsules: 100000 Pa / 0.00025 m, 10 s/m, 0.6 0.5 0 s/m on 1e+10 Pa/m",
    "axes: 23, 651.899 65189.9 ticks/rad, 55 Nm, time-out 0.1 s, strict 0",
    "torso 0x01 kind 0 0 ms: 0 WaistLat 12 A 70 C 1 WaistSag 12 A 70 C",
    "torso 0x02 kind 0 0 ms: 0 WaistYaw 12 A 70 C",
    "torso 0x0c kind 2 5 ms: WaistLat WaistSag WaistYaw - - - from 0 55",
    "left_leg 0x01 kind 0 0 ms: 0 LHipSag 12 A 70 C 1 LHipLat 12 A 70 C",
    "left_leg 0x02 kind 0 0 ms: 0 LHipYaw 12 A 70 C 1 LKneeSag 12 A 70 C",
    "left_leg 0x03 kind 0 0 ms: 0 LAnkLat 12 A 70 C 1 LAnkSag 12 A 70 C",
    "left_leg 0x0d kind 1 5 ms: l_leg_ft from 0 2000 from 3 40",
    "left_leg 0x0c kind 2 5 ms: LHipSag LHipLat LHipYaw LKneeSag LAnkLat LAnkSag from 0 55",
    "right_leg 0x01 kind 0 0 ms: 0 RHipSag 12 A 70 C 1 RHipLat 12 A 70 C",
    "right_leg 0x02 kind 0 0 ms: 0 RHipYaw 12 A 70 C 1 RKneeSag 12 A 70 C",
    "right_leg 0x03 kind 0 0 ms: 0 RAnkLat 12 A 70 C 1 RAnkSag 12 A 70 C",
    "right_leg 0x0e kind 1 5 ms: r_leg_ft from 0 2000 from 3 40",
    "right_leg 0x0b kind 2 5 ms: RHipSag RHipLat RHipYaw RKneeSag RAnkLat RAnkSag from 0 55",
    "left_arm 0x01 kind 0 0 ms: 0 LShSag 12 A 70 C 1 LShLat 12 A 70 C",
    "left_arm 0x02 kind 0 0 ms: 0 LShYaw 12 A 70 C 1 LElbj 12 A 70 C",
    "left_arm 0x0d kind 1 5 ms: l_arm_ft from 0 1000 from 3 20",
    "left_arm 0x0c kind 2 5 ms: LShSag LShLat LShYaw LElbj - - from 0 55",
    "right_arm 0x01 kind 0 0 ms: 0 RShSag 12 A 70 C 1 RShLat 12 A 70 C",
    "right_arm 0x02 kind 0 0 ms: 0 RShYaw 12 A 70 C 1 RElbj 12 A 70 C",
    "right_arm 0x0e kind 1 5 ms: r_arm_ft from 0 1000 from 3 20",
    "right_arm 0x0b kind 2 5 ms: RShSag RShLat RShYaw RElbj - - from 0 55",
    "from WaistLat: kp 200 ki 400 kd 0 kw 4.1 trim 1 load 0.162 limit 0",
    "command 2 ms, squat 0.2258 0.201 0.1 m, 4 s, 4 cycles",
};

/* Encoders of 80,000 counts; a valve shows no current. */
static const char *const hyq[] = {
    "hyq: hyq, tick 1 ms of 1, clock 0, integrator 1, personality described, 48 V, 0 ohm",
    "start: standing, hold 1, settle 1, lockstep bus 0 0x6f0 0x6ff 1 s, priority 80, cpu -1",
    "contact: engine 2, law 0, friction 1, transition 0.01 m/s",
    "pairs:",
    "ground: 100000 Pa / 0.001 m, 10 s/m, 1.1 0.9 0 s/m on 1e+10 Pa/m",
    "capsules: 100000 Pa / 0.0002 m, 10 s/m, 1.1 0.9 0 s/m on 3e+10 Pa/m",
    "axes: 12, 12732.4 12732.4 ticks/rad, 200 Nm, time-out 0.1 s, strict 0",
    "left_front 0x01 kind 0 0 ms: 0 lf_haa 1 A 70 C 1 lf_hfe 1 A 70 C 2 lf_kfe 1 A 70 C",
    "right_front 0x01 kind 0 0 ms: 0 rf_haa 1 A 70 C 1 rf_hfe 1 A 70 C 2 rf_kfe 1 A 70 C",
    "left_hind 0x01 kind 0 0 ms: 0 lh_haa 1 A 70 C 1 lh_hfe 1 A 70 C 2 lh_kfe 1 A 70 C",
    "right_hind 0x01 kind 0 0 ms: 0 rh_haa 1 A 70 C 1 rh_hfe 1 A 70 C 2 rh_kfe 1 A 70 C",
    "from lf_haa: kp 4 ki 8 kd 0 kw 0.36 trim 0 load 0 limit 0",
    "command 1 ms, squat 0 0 0 m, 0 s, 0 cycles",
};

/* Drives of 50 A and 10 A (walkman_robotran_edu_2017); depth, period and cycles of the paper's
 * section 7; limits of 40 V and 24 V of the drives that take no 80 V. */
static const char *const walkman[] = {
    "walkman: WALK-MAN, tick 1 ms of 1, clock 0, integrator 1, personality icub, 80 V, 0 ohm",
    "start: squat_top, hold 1, settle 0, lockstep bus 0 0x6f0 0x6ff 1 s, priority 80, cpu -1",
    "contact: engine 2, law 0, friction 1, transition 0.01 m/s",
    "pairs: ground-right_foot ground-left_foot",
    "ground: 100000 Pa / 0.001 m, 10 s/m, 1.1 0.9 0 s/m on 2e+10 Pa/m",
    "right_foot: 100000 Pa / 0.0002 m, 10 s/m, 1.1 0.9 0 s/m on 3e+10 Pa/m",
    "left_foot: 100000 Pa / 0.0002 m, 10 s/m, 1.1 0.9 0 s/m on 3e+10 Pa/m",
    "capsules: 100000 Pa / 0.00025 m, 10 s/m, 0.6 0.5 0 s/m on 1e+10 Pa/m",
    "axes: 24, 83443 65189.9 ticks/rad, 250 Nm, time-out 0.1 s, strict 0",
    "torso 0x01 kind 0 0 ms: 0 WaistLat 50 A 70 C 1 WaistSag 50 A 70 C",
    "torso 0x02 kind 0 0 ms: 0 WaistYaw 50 A 70 C",
    "torso 0x03 kind 0 0 ms: 0 NeckYawj 10 A 70 C",
    "torso 0x0c kind 2 5 ms: WaistLat WaistSag WaistYaw NeckYawj - - from 0 250",
    "left_leg 0x01 kind 0 0 ms: 0 LHipLat 50 A 70 C 1 LHipSag 50 A 70 C",
    "left_leg 0x02 kind 0 0 ms: 0 LHipYaw 50 A 70 C 1 LKneeSag 50 A 70 C",
    "left_leg 0x03 kind 0 0 ms: 0 LAnkSag 50 A 70 C 1 LAnkLat 50 A 70 C",
    "left_leg 0x0d kind 1 5 ms: l_leg_ft from 0 2000 from 3 200",
    "left_leg 0x0c kind 2 5 ms: LHipLat LHipYaw LHipSag LKneeSag LAnkSag LAnkLat from 0 250",
    "right_leg 0x01 kind 0 0 ms: 0 RHipLat 50 A 70 C 1 RHipSag 50 A 70 C",
    "right_leg 0x02 kind 0 0 ms: 0 RHipYaw 50 A 70 C 1 RKneeSag 50 A 70 C",
    "right_leg 0x03 kind 0 0 ms: 0 RAnkSag 50 A 70 C 1 RAnkLat 50 A 70 C",
    "right_leg 0x0e kind 1 5 ms: r_leg_ft from 0 2000 from 3 200",
    "right_leg 0x0b kind 2 5 ms: RHipLat RHipYaw RHipSag RKneeSag RAnkSag RAnkLat from 0 250",
    "left_arm 0x01 kind 0 0 ms: 0 LShSag 50 A 70 C 1 LShLat 50 A 70 C",
    "left_arm 0x02 kind 0 0 ms: 0 LShYaw 50 A 70 C 1 LElbj 50 A 70 C",
    "left_arm 0x0d kind 1 5 ms: l_arm_ft from 0 1000 from 3 100",
    "left_arm 0x0c kind 2 5 ms: LShSag LShLat LShYaw LElbj - - from 0 250",
    "right_arm 0x01 kind 0 0 ms: 0 RShSag 50 A 70 C 1 RShLat 50 A 70 C",
    "right_arm 0x02 kind 0 0 ms: 0 RShYaw 50 A 70 C 1 RElbj 50 A 70 C",
    "right_arm 0x0e kind 1 5 ms: r_arm_ft from 0 1000 from 3 100",
    "right_arm 0x0b kind 2 5 ms: RShSag RShLat RShYaw RElbj - - from 0 250",
    "from WaistLat: kp 800 ki 0 kd 0 kw 11.7 trim 0.3 load 0.03 limit 40",
    "from WaistSag: kp 800 ki 0 kd 12 kw 4.55 trim 0.3 load 0.146 limit 0",
    "from WaistYaw: kp 300 ki 0 kd 0 kw 6.84 trim 0.3 load 0.178 limit 40",
    "from NeckYawj: kp 200 ki 0 kd 0 kw 4.1 trim 0.3 load 0.162 limit 24",
    "from LHipLat: kp 800 ki 0 kd 12 kw 4.55 trim 0.3 load 0.146 limit 0",
    "from LHipYaw: kp 300 ki 0 kd 0 kw 6.84 trim 0.3 load 0.178 limit 40",
    "from LKneeSag: kp 800 ki 0 kd 12 kw 4.55 trim 0.3 load 0.146 limit 0",
    "from RHipYaw: kp 300 ki 0 kd 0 kw 6.84 trim 0.3 load 0.178 limit 40",
    "from RKneeSag: kp 800 ki 0 kd 12 kw 4.55 trim 0.3 load 0.146 limit 0",
    "from LShSag: kp 300 ki 0 kd 0 kw 6.84 trim 0.3 load 0.178 limit 40",
    "command 2 ms, squat 0.356 0.4 0.3 m, 7 s, 4 cycles",
};

/* Materials of the paper's Table 2, boards as COMAN's; the box of 1.5 kg and 15 cm. */
static const char *const grasp[] = {
    "grasp: COMAN, tick 1 ms of 1, clock 0, integrator 1, personality icub, 48 V, 0 ohm",
    "start: zero, hold 1, settle 0, lockstep bus 0 0x6f0 0x6ff 1 s, priority 80, cpu -1",
    "contact: engine 2, law 0, friction 1, transition 0.002 m/s",
    "pairs: ground-right_foot ground-left_foot table-box right_wrist-box left_wrist-box",
    "ground: 100000 Pa / 0.001 m, 10 s/m, 1.1 0.9 0 s/m",
    "right_foot: 100000 Pa / 0.0002 m, 10 s/m, 1.1 0.9 0 s/m",
    "left_foot: 100000 Pa / 0.0002 m, 10 s/m, 1.1 0.9 0 s/m",
    "right_wrist: 10000 Pa / 0.001 m, 10 s/m, 1.1 1.05 0.5 s/m at -0.015 0 -0.22",
    "left_wrist: 10000 Pa / 0.001 m, 10 s/m, 1.1 1.05 0.5 s/m at -0.015 0 -0.22",
    "box: 10000 Pa / 0.001 m, 10 s/m, 1.1 0.9 0.5 s/m at 0 0 0",
    "table: 10000 Pa / 0.001 m, 0.1 s/m, 1.1 0.9 0.5 s/m at 0.2 0 0.45",
    "axes: 23, 651.899 65189.9 ticks/rad, 55 Nm, time-out 0.1 s, strict 0",
    "torso 0x01 kind 0 0 ms: 0 WaistLat 12 A 70 C 1 WaistSag 12 A 70 C",
    "torso 0x02 kind 0 0 ms: 0 WaistYaw 12 A 70 C",
    "torso 0x0c kind 2 5 ms: WaistLat WaistSag WaistYaw - - - from 0 55",
    "left_leg 0x01 kind 0 0 ms: 0 LHipSag 12 A 70 C 1 LHipLat 12 A 70 C",
    "left_leg 0x02 kind 0 0 ms: 0 LHipYaw 12 A 70 C 1 LKneeSag 12 A 70 C",
    "left_leg 0x03 kind 0 0 ms: 0 LAnkLat 12 A 70 C 1 LAnkSag 12 A 70 C",
    "left_leg 0x0d kind 1 5 ms: l_leg_ft from 0 2000 from 3 40",
    "left_leg 0x0c kind 2 5 ms: LHipSag LHipLat LHipYaw LKneeSag LAnkLat LAnkSag from 0 55",
    "right_leg 0x01 kind 0 0 ms: 0 RHipSag 12 A 70 C 1 RHipLat 12 A 70 C",
    "right_leg 0x02 kind 0 0 ms: 0 RHipYaw 12 A 70 C 1 RKneeSag 12 A 70 C",
    "right_leg 0x03 kind 0 0 ms: 0 RAnkLat 12 A 70 C 1 RAnkSag 12 A 70 C",
    "right_leg 0x0e kind 1 5 ms: r_leg_ft from 0 2000 from 3 40",
    "right_leg 0x0b kind 2 5 ms: RHipSag RHipLat RHipYaw RKneeSag RAnkLat RAnkSag from 0 55",
    "left_arm 0x01 kind 0 0 ms: 0 LShSag 12 A 70 C 1 LShLat 12 A 70 C",
    "left_arm 0x02 kind 0 0 ms: 0 LShYaw 12 A 70 C 1 LElbj 12 A 70 C",
    "left_arm 0x0d kind 1 5 ms: l_arm_ft from 0 1000 from 3 20",
    "left_arm 0x0c kind 2 5 ms: LShSag LShLat LShYaw LElbj - - from 0 55",
    "right_arm 0x01 kind 0 0 ms: 0 RShSag 12 A 70 C 1 RShLat 12 A 70 C",
    "right_arm 0x02 kind 0 0 ms: 0 RShYaw 12 A 70 C 1 RElbj 12 A 70 C",
    "right_arm 0x0e kind 1 5 ms: r_arm_ft from 0 1000 from 3 20",
    "right_arm 0x0b kind 2 5 ms: RShSag RShLat RShYaw RElbj - - from 0 55",
    "from WaistLat: kp 200 ki 40 kd 0 kw 4.1 trim 0 load 0 limit 0",
    "command 2 ms, squat 0 0 0 m, 0 s, 0 cycles",
    "bend the elbows until 0.55 s, closed 0: 0.0879 -0.2 0.2159 -1.2021",
    "reach for the box until 0.8 s, closed 0: -0.0238 -0.2 0.4453 -1.1333",
    "close until 1.01 s, closed 0: -0.1052 -0.2 0.6425 -1.0912",
    "press until 1.25 s, closed 0: -0.2158 -0.2 0.8659 -1.033",
    "lift until 2 s, closed 1: -0.0295 -0.2 0.6199 -1.4197",
    "settle 0.5 s, hold 1 s, press 4 N, carry 12 N",
};

TEST_WITH(coman_has_its_numbers, open_arena, close_arena)
{
    check_rig("coman", coman, ARRAY_COUNT(coman));
}

TEST_WITH(hyq_has_its_numbers, open_arena, close_arena)
{
    check_rig("hyq", hyq, ARRAY_COUNT(hyq));
}

TEST_WITH(walkman_has_its_numbers, open_arena, close_arena)
{
    check_rig("walkman", walkman, ARRAY_COUNT(walkman));
}

TEST_WITH(grasp_has_its_numbers, open_arena, close_arena)
{
    check_rig("grasp", grasp, ARRAY_COUNT(grasp));
    assert_int_equal(rig->nfree, 1);
    assert_true(rig->free[0].inertia.mass == 1.5);
    for (int k = 0; k < 3; k++) { /* m (a^2 + b^2) / 12 */
        const int diagonal[3] = {0, 3, 5};
        double is = rig->free[0].inertia.I[diagonal[k]];

        assert_true(is > 0.0056249 && is < 0.0056251);
    }
    assert_true(rig->free[0].position[0] == 0.2 && rig->free[0].position[2] == 0.55);
}

/* The ground of each, and how it differs from coman-fd-imu: in its name and its ground. */
/* The benches of measured drives: their boards' limits follow the supply of the rig. */
TEST_WITH(pendulums_have_their_supplies, open_arena, close_arena)
{
    static const struct {
        const char *name;
        double supply_v, under_v, over_v, current_a, torque_nm;
    } benches[] = {{"xl330-pendulum", 7.4, 3.7, 9.25, 4.0, 2.0},
                   {"ak80-6-pendulum", 24.0, 12.0, 30.0, 40.0, 24.0}};

    for (size_t i = 0; i < ARRAY_COUNT(benches); i++) {
        tell_rig(benches[i].name);
        assert_int_equal(rig->naxis, 1);
        assert_int_equal(rig->boards.nboard, 1);
        const struct board_config *board = &rig->boards.board[0];

        assert_near(rig->supply_v, benches[i].supply_v, 0.0);
        assert_near(board->under_voltage_v, benches[i].under_v, 0.0);
        assert_near(board->over_voltage_v, benches[i].over_v, 1e-12);
        assert_near(board->axis[0].current_limit_a, benches[i].current_a, 0.0);
        assert_near(board->axis[0].torque_full_scale_nm, benches[i].torque_nm, 0.0);
    }
}

TEST_WITH(walk_rigs_are_one_robot_on_several_grounds, open_arena, close_arena)
{
    static const struct {
        const char *name, *line;
        size_t nface; /* 0: a half-space */
    } walk[] = {
        {"walk-flat", "ground: 100000 Pa / 0.001 m, 10 s/m, 1.1 0.9 0 s/m on 2e+10 Pa/m", 0},
        {"walk-bump-3cm", "ground: 100000 Pa / 0.001 m, 10 s/m, 1.1 0.9 0 s/m on 2e+10 Pa/m", 948},
        {"walk-bump-9cm", "ground: 100000 Pa / 0.001 m, 10 s/m, 1.1 0.9 0 s/m on 2e+10 Pa/m", 948},
        {"walk-slope", "ground: 100000 Pa / 0.001 m, 10 s/m, 1.1 0.9 0 s/m on 2e+10 Pa/m", 46},
        {"walk-soft", "ground: 100000 Pa / 0.02 m, 10 s/m, 1.1 0.9 0 s/m on 2e+10 Pa/m", 0},
        {"walk-slippery", "ground: 100000 Pa / 0.001 m, 10 s/m, 0.18 0.15 0 s/m on 2e+10 Pa/m", 0},
    };
    static char base[LINES][LINE];
    const char *expected[LINES];
    size_t count;

    tell_rig("coman-fd-imu");
    count = lines;
    memcpy(base, line, sizeof base);
    for (size_t r = 0; r < ARRAY_COUNT(walk); r++) {
        const struct contact_surface *ground;
        char head[LINE];

        for (size_t i = 0; i < count; i++) {
            expected[i] = strncmp(base[i], "ground:", 7) == 0 ? walk[r].line : base[i];
        }
        snprintf(head, sizeof head, "%s%s", walk[r].name, strchr(base[0], ':'));
        expected[0] = head;
        check_rig(walk[r].name, expected, count);
        ground = &rig->contact.surface[0];
        assert_string_equal(ground->name, "ground");
        assert_int_equal(ground->shape, walk[r].nface ? CONTACT_MESH : CONTACT_HALF_SPACE);
        assert_true(ground->position[0] == (walk[r].nface ? 0.5 : 0));
        assert_true(walk[r].nface == 0 || ground->mesh->nface == walk[r].nface);
    }
}

/* WALK-MAN squats and walks on the same drives: what they need of volts is the same, but not how
 * stiff the loops are. */
TEST_WITH(walkman_walks_with_the_drives_that_it_squats_with, open_arena, close_arena)
{
    tell_rig("walk-walkman");
    assert_int_equal(rig->naxis, 24);
    assert_true(rig->imu.present && rig->walk);
    for (size_t i = 0; i < rig->naxis; i++) {
        const struct servo_gains *squat = &rig->servo.gains[i];
        const struct servo_gains *walk = &rig->walk->balance.gains[i];

        assert_true(walk->kp_v_per_rad == squat->kp_v_per_rad);
        assert_true(walk->kw_v_s_per_rad == squat->kw_v_s_per_rad);
        assert_true(walk->load_v_per_nm == squat->load_v_per_nm);
        assert_true(walk->limit_v == squat->limit_v);
        assert_true(walk->trim_per_s == 0 && walk->torque_limit_nm == 210);
    }
}

/* Whether a line of coman's is this one, or, when tail, ends so. */
static bool coman_has_line(const char *text, bool tail)
{
    const size_t length = strlen(text);

    for (size_t i = 0; i < ARRAY_COUNT(coman); i++) {
        const size_t whole = strlen(coman[i]);

        if (tail ? whole >= length && strcmp(coman[i] + whole - length, text) == 0
                 : strcmp(coman[i], text) == 0) {
            return true;
        }
    }
    return false;
}

/* COMAN with other drives, sensors, starts and one more board has the same boards. */
TEST_WITH(other_rigs_of_coman_have_its_boards, open_arena, close_arena)
{
    static const char *const names[] = {"coman-bench",   "coman-drives",   "coman-imu",
                                        "coman-sensors", "coman-standing", "coman-strict"};

    for (size_t n = 0; n < ARRAY_COUNT(names); n++) {
        size_t same = 0;

        tell_rig(names[n]);
        for (size_t b = 0; b < rig->boards.nboard; b++) {
            const struct board_config *board = &rig->boards.board[b];

            if (board->kind == BOARD_INERTIAL) {
                continue;
            }
            lines = 0;
            tell_board(board);
            if (!coman_has_line(line[0], false)) {
                fail_msg("%s: %s", names[n], line[0]);
            }
            same++;
        }
        assert_int_equal(same, 21);
    }
}

/* With other protocols the boards are others, their force-torque sensors and currents are not. */
TEST_WITH(rigs_of_other_protocols_have_its_sensors, open_arena, close_arena)
{
    static const char *const names[] = {"coman-compact", "coman-compact-imu", "coman-fd",
                                        "coman-fd-imu", "coman-foc"};

    for (size_t n = 0; n < ARRAY_COUNT(names); n++) {
        size_t sensors = 0, axes = 0;

        tell_rig(names[n]);
        for (size_t b = 0; b < rig->boards.nboard; b++) {
            const struct board_config *board = &rig->boards.board[b];

            for (int k = 0; k < BOARD_AXES_MAX && board->kind == BOARD_MOTOR; k++) {
                axes += board->axis[k].joint >= 0;
                assert_true(board->axis[k].joint < 0 || board->axis[k].current_limit_a == 12.0);
            }
            if (board->kind == BOARD_FT) {
                lines = 0;
                tell_board(board);
                if (!coman_has_line(strchr(line[0], ':') + 1, true)) {
                    fail_msg("%s: %s", names[n], line[0]);
                }
                sensors++;
            }
        }
        assert_int_equal(sensors, 4);
        assert_int_equal(axes, 23);
    }
}
