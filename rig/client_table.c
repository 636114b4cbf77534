/* SPDX-License-Identifier: Apache-2.0 */
/* Writes a described protocol, and the boards on its bus, as JSON. */
#include "rig/client_table.h"

#include "base/json_text.h"
#include "boards/described/protocol.h"

#include <inttypes.h>

/* Writes a list of frames as an array of their indices. */
static void table_put_list(const char *key, const struct described_list *list, FILE *out)
{
    fprintf(out, "\"%s\": [", key);
    for (size_t i = 0; i < list->count; i++) {
        fprintf(out, "%s%d", i ? ", " : "", list->frame[i]);
    }
    fprintf(out, "], ");
}

/* Writes states or laws: for each its name, value, law and scale of the set point. */
static void table_put_states(const char *key, const struct described_state *state, size_t count,
                             FILE *out)
{
    fprintf(out, "\"%s\": [", key);
    for (size_t i = 0; i < count; i++) {
        fprintf(out,
                "%s{\"name\": \"%s\", \"value\": %" PRId64 ", \"law\": \"%s\", \"scale\": %.17g}",
                i ? ", " : "", state[i].name, state[i].value, described_law_word(state[i].law),
                state[i].set_point_scale);
    }
    fprintf(out, "],\n ");
}

/* Writes a field: its meaning, its bits, and its scale and range, by model if these differ. */
static void table_put_field(const struct described_protocol *p, const struct described_frame *frame,
                            size_t i, FILE *out)
{
    const struct described_field *f = &frame->field[i];

    fprintf(out,
            "%s\n   {\"name\": \"%s\", \"meaning\": \"%s\", \"byte\": %d, \"shift\": %d, \"mask\": "
            "%" PRIu64 ", \"sign\": %" PRIu64
            ", \"end\": %d, \"in_id\": %d, \"big\": %d, \"real\": %d, "
            "\"scale\": %.17g, \"offset\": %.17g, \"low\": %" PRId64 ", \"high\": %" PRId64
            ", \"constant\": %" PRId64 ", \"host\": %.17g, \"axis\": %d",
            i ? "," : "", described_layout(frame, i)->name,
            described_meaning_name(f->meaning, frame->from_host), f->byte, f->shift, f->mask,
            f->sign, f->end, f->in_id, f->big_endian, f->real, f->scale, f->offset, f->low, f->high,
            f->constant, f->host, f->axis);
    /* Scale and offset by model, in place of those above */
    fputs(f->times < 0 ? "" : ", \"models\": [", out);
    for (size_t m = 0; f->times >= 0 && m < p->nmodel; m++) {
        const struct described_field scaled = described_model_field(p, (unsigned)m, f);

        fprintf(out, "%s[%.17g, %.17g]", m ? ", " : "", scaled.scale, scaled.offset);
    }
    fputs(f->times < 0 ? "}" : "]}", out);
}

/* Writes a frame with its fields. */
static void table_put_frame(const struct described_protocol *p, const struct described_frame *frame,
                            FILE *out)
{
    static const char *const by[] = {"none", "address", "slot", "group"};

    fprintf(out,
            "{\"name\": \"%s\", \"host\": %d, \"remote\": %d, \"id\": %" PRIu32
            ", \"step\": %" PRIu32 ", \"most\": %d, \"id_mask\": %" PRIu32
            ", \"by\": \"%s\", \"extended\": %d, \"fd\": %d, "
            "\"length\": %d, \"repeats\": %d, \"of\": %u, \"of_one\": %d, \"checksum\": %d, "
            "\"checksum_byte\": %d, \"fields\": [",
            frame->name, frame->from_host, frame->remote, frame->base, frame->step, frame->most,
            frame->mask, by[frame->by], !!(frame->flags & FRAME_EXTENDED),
            !!(frame->flags & FRAME_FD), frame->length, frame->repeats, frame->of, frame->of_one,
            frame->checksum, frame->checksum_byte);
    for (size_t i = 0; i < frame->nfield; i++) {
        table_put_field(p, frame, i, out);
    }
    fputs("]}", out);
}

/* Writes the boards of the bus, each with the joints of its axes. */
static void table_put_boards(const struct rig *rig, size_t bus, FILE *out)
{
    const char *separator = "";

    fputs("\"boards\": [", out);
    for (size_t i = 0; i < rig->boards.nboard; i++) {
        const struct board_config *board = &rig->boards.board[i];
        unsigned axes = board->kind == BOARD_MOTOR ? BOARD_AXES_MAX : 0;

        if (board->bus != (int)bus) {
            continue;
        }
        while (axes > 0 && board->axis[axes - 1].joint < 0) {
            axes--;
        }
        fprintf(out, "%s{\"address\": %d, \"model\": %d, \"of\": %d, \"joints\": [", separator,
                board->address, board->model,
                board->kind == BOARD_MOTOR      ? DESCRIBED_MOTOR
                : board->kind == BOARD_INERTIAL ? DESCRIBED_INERTIAL
                                                : DESCRIBED_FT);
        for (unsigned k = 0; k < axes; k++) {
            char name[JSON_TEXT_ROOM(128)] = "null", cut[129];
            const int joint = board->axis[k].joint;

            if (joint >= 0) {
                snprintf(cut, sizeof cut, "%s", rig->robot->joint[joint].name);
                name[json_text_quote(cut, name)] = '\0';
            }
            fprintf(out, "%s%s", k ? ", " : "", name);
        }
        fputs("]}", out);
        separator = ", ";
    }
    fputs("],\n ", out);
}

void rig_client_table(const struct rig *rig, size_t bus, FILE *out)
{
    const struct described_protocol *p = rig->bus[bus].described;

    if (!p) {
        fputs("null\n", out);
        return;
    }
    fprintf(out, "{\"protocol\": \"%s\", \"on_state\": %d, \"off_state\": %d, \"clears\": %d,\n ",
            p->name, p->host.on_state, p->host.off_state, p->clears);
    table_put_states("states", p->state, p->nstate, out);
    table_put_states("laws", p->law, p->nlaw, out);
    table_put_list("discover", &p->host.discover, out);
    table_put_list("configure", &p->host.configure, out);
    table_put_list("off", &p->host.off, out);
    table_put_list("on", &p->host.on, out);
    table_put_list("command", &p->host.command, out);
    table_put_boards(rig, bus, out);
    fputs("\"frames\": [", out);
    for (size_t i = 0; i < p->nframe; i++) {
        fputs(i ? ",\n  " : "\n  ", out);
        table_put_frame(p, &p->frame[i], out);
    }
    fputs("]}\n", out);
}
