/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The rigs that ship change on purpose only. What each has become is told in words: materials,
 * boards, limits, full scales, gains, paths. shipped.txt has the hash of every text. A text that
 * has changed is printed, with its new row.
 */
#include "base/array.h"
#include "base/hash.h"
#include "rig/rig.h"

#include <dirent.h>
#include <inttypes.h>

#include "tests/unit/arena_fixture.h"

static void tell_scene(const struct rig *rig, FILE *out)
{
    const struct contact_config *contact = &rig->contact;

    fprintf(out, "contact: engine %d, law %d, friction %d, transition %g m/s\n",
            rig->contact_engine, contact->mesh_law, contact->friction,
            contact->transition_velocity_m_s);
    for (size_t i = 0; i < rig->nlisted_pair; i++) {
        fprintf(out, "pair %s-%s\n", contact->surface[contact->pair[i].a].name,
                contact->surface[contact->pair[i].b].name);
    }
    for (size_t i = 0; i < contact->nsurface; i++) {
        const struct contact_surface *s = &contact->surface[i];
        const struct contact_material *m = &s->material;

        fprintf(
            out,
            "%s: shape %d at %g %g %g, %zu faces, %g Pa / %g m, %g s/m, %g %g %g s/m, %g Pa/m\n",
            s->name, s->shape, s->position[0], s->position[1], s->position[2],
            s->shape == CONTACT_MESH ? s->mesh->nface : 0, m->young_pa, m->thickness_m,
            m->dissipation_s_per_m, m->static_friction, m->dynamic_friction, m->viscous_friction,
            m->backing_pa_per_m);
    }
    for (size_t i = 0; i < rig->nfree; i++) {
        const struct plant_free_body *body = &rig->free[i];

        fprintf(out, "%s: %g kg, %g %g %g kg m2, at %g %g %g\n", body->name, body->inertia.mass,
                body->inertia.I[0], body->inertia.I[3], body->inertia.I[5], body->position[0],
                body->position[1], body->position[2]);
    }
}

static void tell_board(const struct rig *rig, const struct board_config *board, FILE *out)
{
    fprintf(out, "%s 0x%02x kind %d %g ms, %g to %g V, time-out %g s, strict %d:",
            rig->bus[board->bus].name, board->address, board->kind, (double)board->period_ns * 1e-6,
            board->under_voltage_v, board->over_voltage_v, (double)board->command_timeout_ns * 1e-9,
            board->strict);
    for (size_t k = 0; k < BOARD_AXES_MAX && board->kind == BOARD_MOTOR; k++) {
        const struct board_axis_config *a = &board->axis[k];

        if (a->joint >= 0) {
            fprintf(out, " %zu %s %g A %g C, %g and %g ticks/rad, %g N m, %g to %g rad", k,
                    rig->robot->joint[a->joint].name, a->current_limit_a, a->temperature_limit_c,
                    a->joint_ticks_per_rad, a->motor_ticks_per_rad, a->torque_full_scale_nm,
                    a->lower_rad, a->upper_rad);
        }
    }
    for (size_t k = 0; k < BOARD_CHANNELS && board->kind != BOARD_MOTOR; k++) {
        int joint = board->kind == BOARD_TORQUE ? board->torque_joint[k] : -1;

        fprintf(out, " %s %g", joint < 0 ? "-" : rig->robot->joint[joint].name,
                board->full_scale[k]);
    }
    fprintf(out, " %s\n", board->kind == BOARD_FT ? rig->robot->ft[board->ft].name : "");
}

static void tell_gains(const struct servo_gains *g, const char *joint, FILE *out)
{
    fprintf(out, "%s: kp %g ki %g kd %g kw %g trim %g load %g limit %g V, %g N m\n", joint,
            g->kp_v_per_rad, g->ki_v_per_rad_s, g->kd_v_s_per_rad, g->kw_v_s_per_rad, g->trim_per_s,
            g->load_v_per_nm, g->limit_v, g->torque_limit_nm);
}

static void tell_tasks(const struct rig *rig, FILE *out)
{
    for (size_t i = 0; i < rig->naxis; i++) {
        tell_gains(&rig->servo.gains[i], rig->axis[i].joint, out);
        if (rig->walk) {
            tell_gains(&rig->walk->balance.gains[i], "walking", out);
        }
    }
    fprintf(out, "command %g ms, squat %g %g %g m, %g s, %d cycles\n",
            (double)rig->servo.command_period_ns * 1e-6, rig->squat.thigh_m, rig->squat.shank_m,
            rig->squat.depth_m, rig->squat.period_s, rig->squat.cycles);
    for (size_t i = 0; i < rig->grasp.nphase; i++) {
        const struct grasp_phase *p = &rig->grasp.phase[i];

        fprintf(out, "%s until %g s, closed %d: %g %g %g %g\n", p->name, p->until_s, p->closed,
                p->arm_rad[0], p->arm_rad[1], p->arm_rad[2], p->arm_rad[3]);
    }
    fprintf(out, "settle %g s, hold %g s, press %g N, carry %g N\n", rig->grasp.settle_s,
            rig->grasp.hold_s, rig->grasp.least_press_n, rig->grasp.least_carry_n);
}

/* Returns the text of a rig, which the caller frees. */
static char *tell_rig(const char *name)
{
    const struct rig *rig;
    struct error error;
    char path[512], *text;
    size_t size;
    FILE *out = open_memstream(&text, &size);

    assert_non_null(out);
    snprintf(path, sizeof path, "%s/config/rigs/%s.yaml", HIL_SOURCE_DIR, name);
    assert_no_error(rig_load(path, &arena, &rig, &error), error.text);
    fprintf(out, "%s: %s, tick %g ms of %zu, clock %d, integrator %d, %g V, %g ohm\n", rig->name,
            rig->robot->name, (double)rig->tick_ns * 1e-6, rig->substeps, rig->clock,
            rig->integrator, rig->supply_v, rig->supply_ohm);
    fprintf(out, "%s, hold %d, settle %d, lockstep %d 0x%x 0x%x %g s, priority %d, cpu %d\n",
            rig->pose, rig->hold, rig->settle, rig->lockstep.bus, (unsigned)rig->lockstep.step_id,
            (unsigned)rig->lockstep.done_id, (double)rig->lockstep.partner_timeout_ns * 1e-9,
            rig->realtime.priority, rig->realtime.cpu);
    tell_scene(rig, out);
    for (size_t b = 0; b < rig->boards.nboard; b++) {
        tell_board(rig, &rig->boards.board[b], out);
    }
    tell_tasks(rig, out);
    assert_int_equal(fclose(out), 0);
    return text;
}

static int is_rig(const struct dirent *entry)
{
    return strstr(entry->d_name, ".yaml") != NULL;
}

TEST(every_rig_that_ships_has_its_numbers)
{
    struct dirent **entry;
    int changed = 0, count = scandir(HIL_SOURCE_DIR "/config/rigs", &entry, is_rig, alphasort);
    char list[8192] = "";
    FILE *in = fopen(HIL_SOURCE_DIR "/tests/unit/rig/shipped.txt", "r");

    assert_non_null(in);
    assert_true(count > 0 && fread(list, 1, sizeof list - 1, in) > 0);
    fclose(in);
    for (int i = 0; i < count; i++) {
        char name[64], row[128], *text;

        snprintf(name, sizeof name, "%.*s", (int)strlen(entry[i]->d_name) - 5, entry[i]->d_name);
        assert_int_equal(open_arena(NULL), 0);
        text = tell_rig(name);
        snprintf(row, sizeof row, "%016" PRIx64 " %s\n", hash_bytes(HASH_START, text, strlen(text)),
                 name);
        if (!strstr(list, row)) {
            fprintf(stderr, "%s%s", text, row);
            changed++;
        }
        free(text);
        close_arena(NULL);
        free(entry[i]);
    }
    free(entry);
    assert_int_equal(changed, 0);
}
