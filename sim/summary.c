/* SPDX-License-Identifier: Apache-2.0 */
/* Writes the summary of a run, as text and as JSON. */
#include "sim/summary.h"

#include "base/json_text.h"
#include "base/whole_file.h"
#include "canbus/wire/wire.h"

#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>

/* Smallest turnover for which the imbalance is printed as a share of it, J. */
#define SHARE_LEAST_J 1e-6

const char *summary_end_text(enum loop_end end)
{
    static const char *const texts[] = {
        [LOOP_RUNNING] = "did not end",
        [LOOP_END_LENGTH] = "ran its length",
        [LOOP_END_STOPPED] = "stopped",
        [LOOP_END_CONTROLLER] = "the task ended",
        [LOOP_END_OVERRUNS] = "stopped by overruns",
        [LOOP_END_MODEL] = "the model failed",
    };

    return texts[end];
}

static double summary_us(int64_t ns)
{
    return (double)ns * 1e-3;
}

static double summary_seconds(int64_t ns)
{
    return (double)ns * 1e-9;
}

/* Returns virtual time over wall time; 0 = no tick ran. */
static double summary_real_time_factor(const struct loop_stats *stats)
{
    int64_t wall = stats->end_ns - stats->start_ns;

    return wall > 0 ? (double)stats->time_ns / (double)wall : 0.0;
}

static uint64_t state_hash(const struct summary *summary)
{
    return plant_hash(simulator_plant(summary->simulator));
}

/* ---- text ---- */

/* Prints overruns and other counters of the real clock, and a hint if the machine is too slow. */
static void print_overruns(const struct loop_stats *stats, FILE *out)
{
    fprintf(out, "overruns %" PRIu64, stats->overrun_total);
    for (int p = 0; p < PHASE_COUNT; p++) {
        if (stats->overruns[p]) {
            fprintf(out, ", %" PRIu64 " by %s", stats->overruns[p],
                    loop_phase_name((enum loop_phase)p));
        }
    }
    fprintf(out,
            "; late after them %" PRIu64 ", deadlines skipped %" PRIu64 ", pauses %" PRIu64
            " of %" PRIu64 " ticks\n",
            stats->late_ticks, stats->lost_ticks, stats->pauses, stats->pause_ticks);
    fprintf(out, "  page faults in the loop %" PRIu64 "\n", stats->page_faults);
    if (stats->overrun_total > stats->ticks / 4) {
        fprintf(out,
                "  this machine cannot keep the tick: mean %.0f us of work; longer substeps or a "
                "simpler scene would help\n",
                summary_us(stats->work.sum) / (double)stats->work.count);
    }
}

/* Prints percentiles, maximum and mean (us) of a histogram, and its share of `total` (0 = print no
 * share). */
static void summary_print_histogram(const char *name, const struct histogram *h, int64_t total,
                                    FILE *out)
{
    fprintf(out, "  %-10s %10.1f %10.1f %10.1f %10.1f", name,
            summary_us(histogram_percentile(h, 0.5)), summary_us(histogram_percentile(h, 0.99)),
            summary_us(h->max), h->count ? summary_us(h->sum) / (double)h->count : 0.0);
    if (total > 0) {
        fprintf(out, " %8.1f %%", 100.0 * (double)h->sum / (double)total);
    }
    fputc('\n', out);
}

/* Prints the durations of the phases, of ticks and wake-ups, and the cost of contact. */
static void summary_print_phases(const struct summary *summary, FILE *out)
{
    const struct simulator_config *config = simulator_configuration(summary->simulator);
    const struct loop_stats *stats = simulator_stats(summary->simulator);
    const struct plant_contact_cost *contact = simulator_contact_cost(summary->simulator);
    int64_t total = stats->end_ns - stats->start_ns;
    bool task_waits = config->task && config->clock != LOOP_CLOCK_REAL;

    fprintf(out, "  %-10s %10s %10s %10s %10s %10s\n", "us", "p50", "p99", "max", "mean", "share");
    for (int p = 0; p < PHASE_COUNT; p++) {
        if (p == PHASE_ARRIVALS && stats->phase[p].count == 0) {
            continue;
        }
        /* The loop steps an inline task in the phase in which it would otherwise wait */
        summary_print_histogram(p == PHASE_WAIT && task_waits ? "task"
                                                              : loop_phase_name((enum loop_phase)p),
                                &stats->phase[p], total, out);
    }
    summary_print_histogram("tick", &stats->work, total, out);
    if (stats->wakeup.count) {
        summary_print_histogram("wake-up", &stats->wakeup, 0, out);
    }
    if (contact->evaluations) {
        int64_t around = stats->phase[PHASE_PLANT].sum + stats->phase[PHASE_SENSORS].sum;

        fprintf(out, "  contact: %" PRIu64 " evaluations, %.1f us each", contact->evaluations,
                summary_us(contact->spent_ns) / (double)contact->evaluations);
        /* A run without ticks has evaluated contact only for the initial state, so it has no
         * share */
        if (around > 0) {
            fprintf(out, ", %.1f %% of plant and sensors",
                    100.0 * (double)contact->spent_ns / (double)around);
        }
        fputc('\n', out);
    }
}

/* Returns the load of a bus in percent: measured by its wire, else computed from the bits without
 * stuff bits. */
static double summary_bus_load(const struct summary *summary, size_t bus)
{
    const struct rig_bus *rig_bus = &simulator_configuration(summary->simulator)->rig->bus[bus];
    const struct can_counters *c = &simulator_port(summary->simulator, bus)->counters;
    const struct wire *wire = simulator_wire(summary->simulator, bus);
    double virtual_s = summary_seconds(simulator_stats(summary->simulator)->time_ns);

    if (wire) {
        struct wire_stats of_wire;

        wire_stats(wire, &of_wire);
        return 100.0 * of_wire.load_mean;
    }
    return virtual_s > 0.0 ? 100.0 * rig_bus_bits(rig_bus, c) / virtual_s / (double)rig_bus->bitrate
                           : 0.0;
}

/* Returns the sum of n counters. */
static unsigned long long summary_sum(const uint64_t *count, size_t n)
{
    unsigned long long sum = 0;

    for (size_t i = 0; i < n; i++) {
        sum += count[i];
    }
    return sum;
}

/* Prints the counters of boards, lockstep and recorder, and the number of lost events. */
static void print_rest(const struct summary *summary, FILE *out)
{
    const struct loop_stats *stats = simulator_stats(summary->simulator);
    struct board_event malformed;
    struct boards_counters b;
    char text[256];

    boards_counters(simulator_parts(summary->simulator).boards, &b);
    fprintf(out,
            "boards: %" PRIu64 " frames for them, %" PRIu64 " foreign, %" PRIu64
            " unknown commands, %" PRIu64 " malformed, %" PRIu64 " time-outs, %" PRIu64 " trips\n",
            b.frames, b.foreign, b.unknown, b.malformed, b.timeouts, b.trips);
    if (boards_last_malformed(simulator_parts(summary->simulator).boards, &malformed)) {
        board_event_format(simulator_parts(summary->simulator).boards, &malformed, text,
                           sizeof text);
        fprintf(out, "last malformed frame: %s\n", text);
    }
    if (simulator_configuration(summary->simulator)->clock == LOOP_CLOCK_LOCKSTEP) {
        fprintf(out,
                "lockstep: %" PRIu64 " STEP frames run, %" PRIu64 " of another tick, %" PRIu64
                " malformed, %" PRIu64 " silences\n",
                stats->lockstep.steps, stats->lockstep.mismatches, stats->lockstep.malformed,
                stats->lockstep.silences);
    }
    if (summary->recorded) {
        const struct recorder_counters *r = &summary->recorder;

        fprintf(out,
                "recorder: %" PRIu64 " frames, %" PRIu64 " rows, %" PRIu64
                " events; dropped %" PRIu64 " frames, %" PRIu64 " rows, %" PRIu64
                " events; not written %" PRIu64 " frames, %" PRIu64 " rows, %" PRIu64 " events\n",
                r->frames, r->rows, r->events, r->frames_dropped, r->rows_dropped,
                r->events_dropped, r->frames_unwritten, r->rows_unwritten, r->events_unwritten);
    }
    if (stats->events_lost + b.events_lost) {
        fprintf(out, "events lost: %" PRIu64 "\n", stats->events_lost + b.events_lost);
    }
}

/* Reads the energy account and its turnover, the sum of all flows, J. Returns false if none was
 * requested or the contact engine has failed. */
static bool read_energy(const struct summary *summary, struct plant_energy *e, double *turnover)
{
    if (!simulator_configuration(summary->simulator)->energy ||
        plant_energy(simulator_plant(summary->simulator), e)) {
        return false;
    }
    *turnover = fabs(e->electrical_in) + fabs(e->pretension_work) + fabs(e->push_work) +
                e->joule_heat + fabs(e->motor_friction) + e->spring_damping + e->parallel_damping +
                e->stop_loss + fabs(e->contact_dissipation) + e->gear_friction +
                e->gear_hysteresis + e->bridge_loss + e->source_loss + e->chopper_heat;
    return true;
}

/* Prints the energy account and its remaining imbalance. */
static void print_energy(const struct summary *summary, FILE *out)
{
    struct plant_energy e;
    double turnover;

    if (read_energy(summary, &e, &turnover)) {
        fprintf(out,
                "energy: electrical %.6g J, pretension %.6g J, pushes %.6g J in; windings %.6g J, "
                "motor friction %.6g J, springs %.6g J, ropes %.6g J, stops %.6g J, contacts %.6g "
                "J lost\n",
                e.electrical_in, e.pretension_work, e.push_work, e.joule_heat, e.motor_friction,
                e.spring_damping, e.parallel_damping, e.stop_loss, e.contact_dissipation);
        if (e.gear_friction + e.gear_hysteresis + e.bridge_loss + e.source_loss + e.chopper_heat >
            0.0) {
            fprintf(out,
                    "  and gear friction %.6g J, hysteresis %.6g J, diodes %.6g J, source %.6g J, "
                    "brake chopper %.6g J lost\n",
                    e.gear_friction, e.gear_hysteresis, e.bridge_loss, e.source_loss,
                    e.chopper_heat);
        }
        fprintf(out, "  unbalanced %.3g J", e.balance);
        if (turnover > SHARE_LEAST_J) {
            fprintf(out, ", %.2g of the turnover\n", fabs(e.balance) / turnover);
        } else {
            fprintf(out, ", no share: less than %g J has flowed\n", SHARE_LEAST_J);
        }
    }
}

void summary_print(const struct summary *summary, FILE *out)
{
    /* Prints how the run ended, its times and the state hash */
    const struct simulator_config *config = simulator_configuration(summary->simulator);
    const struct loop_stats *stats = simulator_stats(summary->simulator);

    fprintf(out, "%s (%s clock, %s buses): %s\n", config->rig->name,
            word_of(loop_clock_words, config->clock),
            simulator_parts(summary->simulator).is_local ? "local" : "SocketCAN",
            summary_end_text(summary->end));
    fprintf(out, "  %" PRIu64 " ticks, %.3f s virtual in %.3f s, real-time factor %.3f\n",
            stats->ticks, summary_seconds(stats->time_ns),
            summary_seconds(stats->end_ns - stats->start_ns), summary_real_time_factor(stats));
    fprintf(out, "  state hash %016" PRIx64 "\n", state_hash(summary));
    if (simulator_configuration(summary->simulator)->clock == LOOP_CLOCK_REAL) {
        print_overruns(simulator_stats(summary->simulator), out);
    }
    summary_print_phases(summary, out);

    /* Prints a table of the buses */
    const struct rig *rig = simulator_configuration(summary->simulator)->rig;

    fprintf(out, "  %-10s %-10s %10s %10s %9s %9s %8s %8s  %s\n", "bus", "interface", "rx", "tx",
            "rx lost", "tx lost", "errors", "load", "state");
    for (size_t b = 0; b < rig->nbus; b++) {
        const struct can_port *port = simulator_port(summary->simulator, b);
        const struct can_counters *c = &port->counters;

        fprintf(out,
                "  %-10s %-10s %10" PRIu64 " %10" PRIu64 " %9" PRIu64 " %9" PRIu64 " %8" PRIu64
                " %6.1f %%  %s\n",
                rig->bus[b].name, port->bus, c->rx_frames, c->tx_frames, c->rx_dropped,
                c->tx_dropped, c->error_frames, summary_bus_load(summary, b),
                can_port_state_name(port->state));
    }

    /* Prints the final state of the CAN controllers of real interfaces, and of their queues */
    char text[320];

    for (size_t b = 0; b < rig->nbus; b++) {
        const struct can_port *port = simulator_port(summary->simulator, b);

        if (simulator_can_controller_state(summary->simulator, b, text, sizeof text)) {
            fprintf(out,
                    "  %s: %s; queue full %" PRIu64 " times, frames kept for later %" PRIu64 "\n",
                    port->bus, text, port->counters.tx_queue_full, port->counters.tx_held);
        }
    }

    /* Prints a table of the wires in virtual time */
    for (size_t b = 0; b < rig->nbus; b++) {
        const struct wire *wire = simulator_wire(summary->simulator, b);
        struct wire_stats w;

        if (!wire) {
            continue;
        }
        if (b == 0) {
            fprintf(out, "  %-10s %9s %9s %9s %9s %8s %6s %8s %8s %8s\n", "wire", "frames", "mean",
                    "peak", "worst ms", "of id", "queue", "drops", "errors", "bus-off");
        }
        wire_stats(wire, &w);
        fprintf(out,
                "  %-10s %9" PRIu64 " %7.1f %% %7.1f %% %9.3f    0x%03x %6zu %8llu %8llu %8" PRIu64
                "\n",
                rig->bus[b].name, w.frames, 100.0 * w.load_mean, 100.0 * w.load_peak,
                summary_us(w.latency_max_ns) * 1e-3, w.latency_max_id, w.queued_peak,
                summary_sum(w.dropped, WIRE_DROPS), summary_sum(w.errors, WIRE_ERRORS), w.bus_offs);
    }
    print_energy(summary, out);
    print_rest(summary, out);
}

/* ---- JSON ---- */

/* Writes a histogram as a member, followed by `end`. */
static void json_histogram(const char *name, const struct histogram *h, const char *end, FILE *out)
{
    fprintf(out,
            "    \"%s\": {\"count\": %" PRIu64 ", \"p50_ns\": %" PRId64 ", \"p99_ns\": %" PRId64
            ", \"max_ns\": %" PRId64 ", \"sum_ns\": %" PRId64 "}%s\n",
            name, h->count, histogram_percentile(h, 0.5), histogram_percentile(h, 0.99), h->max,
            h->sum, end);
}

/* Writes the counters of a bus's wire, if it has one. */
static void json_wire(const struct wire *wire, FILE *out)
{
    struct wire_stats w;

    if (!wire) {
        return;
    }
    wire_stats(wire, &w);
    fprintf(out,
            ",\n     \"wire\": {\"frames\": %" PRIu64 ", \"busy_ns\": %" PRId64
            ", \"load_peak_percent\": %.3f, \"queue_peak\": %zu, \"arbitration_lost\": %" PRIu64
            ", \"bus_offs\": %" PRIu64 ", \"worst_latency_ns\": %" PRId64
            ", \"worst_latency_id\": %u",
            w.frames, w.busy_ns, 100.0 * w.load_peak, w.queued_peak, w.arbitration_lost, w.bus_offs,
            w.latency_max_ns, w.latency_max_id);
    for (int i = 0; i < WIRE_ERRORS; i++) {
        fprintf(out, ", \"%s_errors\": %" PRIu64, wire_error_name((enum wire_error)i), w.errors[i]);
    }
    for (int i = 0; i < WIRE_DROPS; i++) {
        fprintf(out, ", \"dropped, %s\": %" PRIu64, wire_drop_name((enum wire_drop)i),
                w.dropped[i]);
    }
    fprintf(out, "}");
}

/* Writes the counters of boards and recorder. */
static void json_rest(const struct summary *summary, FILE *out)
{
    const struct recorder_counters *r = &summary->recorder;
    struct boards_counters b;

    boards_counters(simulator_parts(summary->simulator).boards, &b);
    fprintf(out,
            "  \"boards\": {\"frames\": %" PRIu64 ", \"foreign\": %" PRIu64
            ", \"unknown\": %" PRIu64 ", \"malformed\": %" PRIu64 ", \"timeouts\": %" PRIu64
            ", \"trips\": %" PRIu64 "},\n",
            b.frames, b.foreign, b.unknown, b.malformed, b.timeouts, b.trips);
    fprintf(out,
            "  \"recorder\": {\"frames\": %" PRIu64 ", \"rows\": %" PRIu64 ", \"events\": %" PRIu64
            ", \"frames_dropped\": %" PRIu64 ", \"rows_dropped\": %" PRIu64
            ", \"events_dropped\": %" PRIu64 ", \"frames_unwritten\": %" PRIu64
            ", \"rows_unwritten\": %" PRIu64 ", \"events_unwritten\": %" PRIu64 "}\n",
            r->frames, r->rows, r->events, r->frames_dropped, r->rows_dropped, r->events_dropped,
            r->frames_unwritten, r->rows_unwritten, r->events_unwritten);
}

/* Writes the energy account, if there is one. */
static void json_energy(const struct summary *summary, FILE *out)
{
    struct plant_energy e;
    double turnover;

    if (read_energy(summary, &e, &turnover)) {
        fprintf(out,
                "  \"energy\": {\"electrical_in_j\": %.9g, \"pretension_work_j\": %.9g, "
                "\"push_work_j\": %.9g, \"joule_heat_j\": %.9g, \"motor_friction_j\": %.9g, "
                "\"spring_damping_j\": %.9g, \"parallel_damping_j\": %.9g, \"stop_loss_j\": %.9g, "
                "\"contact_dissipation_j\": %.9g, \"gear_friction_j\": %.9g, "
                "\"gear_hysteresis_j\": %.9g, \"bridge_loss_j\": %.9g, \"source_loss_j\": %.9g, "
                "\"chopper_heat_j\": %.9g, \"balance_j\": %.9g, \"turnover_j\": %.9g},\n",
                e.electrical_in, e.pretension_work, e.push_work, e.joule_heat, e.motor_friction,
                e.spring_damping, e.parallel_damping, e.stop_loss, e.contact_dissipation,
                e.gear_friction, e.gear_hysteresis, e.bridge_loss, e.source_loss, e.chopper_heat,
                e.balance, turnover);
    }
}

/* Writes the whole summary as a JSON object. */
static void json_write(const struct summary *summary, FILE *out)
{
    const struct simulator_config *config = simulator_configuration(summary->simulator);
    const struct loop_stats *stats = simulator_stats(summary->simulator);

    char file[PATH_MAX];

    fprintf(out, "{\n  \"format_version\": %d, \"rig\": ", RECORDING_FORMAT_VERSION);
    json_text_put(config->rig->name, out);
    if (summary->put_origin) {
        summary->put_origin(summary->context, out);
    } else {
        fprintf(out, ", \"rig_file\": ");
        json_text_put(realpath(config->rig->file, file) ? file : config->rig->file, out);
    }
    fprintf(out,
            ",\n  \"clock\": \"%s\", \"end\": \"%s\",\n  \"ticks\": %" PRIu64
            ", \"virtual_s\": %.9f, \"wall_s\": %.9f, \"real_time_factor\": %.6f,\n"
            "  \"state_hash\": \"%016" PRIx64 "\",\n",
            word_of(loop_clock_words, config->clock), summary_end_text(summary->end), stats->ticks,
            summary_seconds(stats->time_ns), summary_seconds(stats->end_ns - stats->start_ns),
            summary_real_time_factor(stats), state_hash(summary));
    fprintf(out, "  \"dynamics\": ");
    json_text_put(simulator_parts(summary->simulator).dynamics, out);
    fprintf(out, ",\n");

    /* Writes overruns and other counters of the real clock, and the durations of the phases */
    fprintf(out, "  \"overruns\": {");
    for (int p = 0; p < PHASE_COUNT; p++) {
        fprintf(out, "\"%s\": %" PRIu64 ", ", loop_phase_name((enum loop_phase)p),
                stats->overruns[p]);
    }
    fprintf(out, "\"total\": %" PRIu64 "},\n", stats->overrun_total);
    fprintf(out,
            "  \"late_ticks\": %" PRIu64 ", \"dropped_deadlines\": %" PRIu64
            ", \"pauses\": %" PRIu64 ", \"pause_ticks\": %" PRIu64 ", \"page_faults\": %" PRIu64
            ",\n  \"durations\": {\n",
            stats->late_ticks, stats->lost_ticks, stats->pauses, stats->pause_ticks,
            stats->page_faults);
    for (int p = 0; p < PHASE_COUNT; p++) {
        json_histogram(loop_phase_name((enum loop_phase)p), &stats->phase[p], ",", out);
    }
    json_histogram("wakeup", &stats->wakeup, ",", out);
    json_histogram("tick", &stats->work, "", out);
    fprintf(out, "  },\n");

    /* Writes the counters of the buses and of their wires */
    const struct rig *rig = simulator_configuration(summary->simulator)->rig;

    fprintf(out, "  \"buses\": [\n");
    for (size_t b = 0; b < rig->nbus; b++) {
        const struct can_counters *c = &simulator_port(summary->simulator, b)->counters;

        fprintf(out, "    {\"name\": ");
        json_text_put(rig->bus[b].name, out);
        fprintf(out,
                ", \"rx_frames\": %" PRIu64 ", \"tx_frames\": %" PRIu64 ", \"rx_dropped\": %" PRIu64
                ", \"tx_dropped\": %" PRIu64 ", \"tx_queue_full\": %" PRIu64
                ", \"tx_held\": %" PRIu64 ", \"error_frames\": %" PRIu64
                ", \"down_events\": %" PRIu64 ", \"state\": \"%s\", \"load_percent\": %.3f",
                c->rx_frames, c->tx_frames, c->rx_dropped, c->tx_dropped, c->tx_queue_full,
                c->tx_held, c->error_frames, c->down_events,
                can_port_state_name(simulator_port(summary->simulator, b)->state),
                summary_bus_load(summary, b));
        json_wire(simulator_wire(summary->simulator, b), out);
        fprintf(out, "}%s\n", b + 1 < rig->nbus ? "," : "");
    }
    fprintf(out, "  ],\n");
    json_energy(summary, out);
    json_rest(summary, out);
    fprintf(out, "}\n");
}

enum error_code summary_write(const struct summary *summary, const char *directory,
                              struct error *error)
{
    char path[PATH_MAX];
    struct whole_file file;
    enum error_code code;

    /* Writes a temporary file first, so that a waiting reader never finds a partial file */
    snprintf(path, sizeof path, "%s/" RECORDER_SUMMARY, directory);
    code = whole_file_open(&file, path, error);
    if (code) {
        return code;
    }
    json_write(summary, file.out);
    return whole_file_close(&file, ERROR_NONE, error);
}
