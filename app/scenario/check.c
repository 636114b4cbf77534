/* SPDX-License-Identifier: Apache-2.0 */
/* Checks the parts of a scenario that do not need the rig, and derives data from them. */
#include "app/scenario/private.h"

#include "base/array.h"
#include "base/text.h"
#include "base/config.h"

#include <float.h>

enum { BYTES_MAX = 64 }; /* bytes of a CAN FD frame */

/* ---- bytes ---- */

/* Parses bytes: two hexadecimal digits each, with spaces or dots between bytes. If `any` is not
 * NULL, x means any digit, and `any` receives the mask of the given digits. */
static enum error_code parse_bytes(const char *text, const struct yaml_mark *mark,
                                   uint8_t byte[BYTES_MAX], uint8_t *any, uint8_t *len,
                                   struct error *error)
{
    size_t digits = 0;

    for (const char *c = text ? text : ""; *c; c++) {
        bool wild = any && (*c == 'x' || *c == 'X');
        int value = wild ? 0 : hex_value(*c);

        /* Skip separators between bytes; each digit gives four bits of a byte and of its mask */
        if ((*c == ' ' || *c == '.') && digits % 2 == 0) {
            continue;
        }
        if (value < 0 || digits == 2 * (size_t)BYTES_MAX) {
            return yaml_error(error, mark,
                              "found data \"%.60s\", expected at most %d bytes of two hexadecimal "
                              "digits%s",
                              text, BYTES_MAX, any ? ", x for a digit that may be any" : "");
        }
        byte[digits / 2] = (uint8_t)(byte[digits / 2] << 4 | value);
        if (any) {
            any[digits / 2] = (uint8_t)(any[digits / 2] << 4 | (wild ? 0 : 0x0f));
        }
        digits++;
    }
    if (digits % 2) {
        return yaml_error(error, mark,
                          "found data \"%.60s\" with an odd number of digits, expected two a byte",
                          text);
    }
    *len = (uint8_t)(digits / 2);
    return ERROR_NONE;
}

/* Makes the CAN frame of a stimulus, and checks it against the frame format: classic or FD. */
static enum error_code check_frame(struct scenario_frame *frame, struct error *error)
{
    uint8_t flags =
        (uint8_t)((frame->extended ? FRAME_EXTENDED : 0) | (frame->fd ? FRAME_FD | FRAME_BRS : 0) |
                  (frame->remote ? FRAME_REMOTE : 0));
    enum error_code code;

    frame->frame = (struct bus_frame){.id = (uint32_t)frame->id, .flags = flags};
    code =
        parse_bytes(frame->data, &frame->mark, frame->frame.data, NULL, &frame->frame.len, error);
    if (!code && !frame_valid(&frame->frame)) {
        code = yaml_error(error, &frame->mark,
                          "found a frame with id 0x%x and %u bytes, expected one that %s can carry",
                          (unsigned)frame->frame.id, frame->frame.len,
                          frame->fd ? "CAN FD" : "classic CAN");
    }
    return code;
}

bool scenario_pattern_matches(const struct scenario_pattern *pattern, const struct bus_frame *frame)
{
    uint32_t mask = (uint32_t)pattern->id_mask;

    if (frame->flags & FRAME_ERROR || ((frame->id ^ (uint32_t)pattern->id) & mask) != 0 ||
        (frame->flags & FRAME_EXTENDED) != (pattern->extended ? FRAME_EXTENDED : 0) ||
        frame->len < pattern->len) {
        return false;
    }
    for (size_t i = 0; i < pattern->len; i++) {
        if ((frame->data[i] ^ pattern->byte[i]) & pattern->mask[i]) {
            return false;
        }
    }
    return true;
}

/* ---- labels ---- */

/* Finds the label that a time is relative to; the default is the start. */
static enum error_code resolve_after(const struct scenario *scenario, const char *after,
                                     const struct yaml_mark *mark, int *index, struct error *error)
{
    const struct yaml_names labels = {scenario->label, scenario->nlabel, sizeof *scenario->label,
                                      0};

    *index = SCENARIO_LABEL_START;
    return after ? yaml_find_name(labels, "label", after, mark, index, error) : ERROR_NONE;
}

/* ---- stimuli ---- */

/* Derives the action of a stimulus, and refuses incompatible keys and actions. */
static enum error_code check_stimulus(const struct scenario *scenario,
                                      struct scenario_stimulus *stimulus, struct error *error)
{
    const bool does[] = {
        [SCENARIO_FRAME] = stimulus->frame.bus,     [SCENARIO_VOLTAGE] = stimulus->voltage.joint,
        [SCENARIO_MOTOR] = stimulus->motor.joint,   [SCENARIO_PUSH] = stimulus->push.body,
        [SCENARIO_FAULT] = stimulus->fault != NULL, [SCENARIO_SILENCE] = stimulus->silence,
    };
    int kinds = 0;

    stimulus->action = SCENARIO_MARK;
    for (size_t i = 0; i < ARRAY_COUNT(does); i++) {
        kinds += does[i];
        stimulus->action = does[i] ? (enum scenario_action)i : stimulus->action;
    }
    if (kinds > 1 || (kinds == 0 && !stimulus->label)) {
        return yaml_error(error, &stimulus->mark,
                          "found %d actions, expected one of frame, voltage, motor, push, fault "
                          "and silence, or a label alone",
                          kinds);
    }

    /* Refuse keys that the action does not have */
    if (stimulus->for_s > 0.0 &&
        (stimulus->action == SCENARIO_MOTOR || stimulus->action == SCENARIO_MARK)) {
        return yaml_error(error, &stimulus->mark, "found for_s, expected none: this takes no time");
    }
    if (stimulus->every_s > 0.0 && stimulus->action != SCENARIO_FRAME &&
        stimulus->action != SCENARIO_VOLTAGE) {
        return yaml_error(error, &stimulus->mark,
                          "found every_s, expected it with a frame or a voltage only");
    }
    if (stimulus->action == SCENARIO_FRAME &&
        (stimulus->for_s > 0.0) != (stimulus->every_s > 0.0)) {
        return yaml_error(error, &stimulus->mark,
                          "found %s of a frame alone, expected every_s and for_s or neither",
                          stimulus->for_s > 0.0 ? "for_s" : "every_s");
    }

    /* Refuse actions that the scenario's host or task does not allow */
    if ((stimulus->action == SCENARIO_VOLTAGE || stimulus->action == SCENARIO_MOTOR ||
         stimulus->action == SCENARIO_SILENCE) &&
        scenario->host != SCENARIO_HOST_ENABLED) {
        return yaml_error(
            error, &stimulus->mark,
            "found something for the host to do, expected host: enabled in the scenario");
    }
    if (stimulus->action == SCENARIO_SILENCE && scenario->clock == LOOP_CLOCK_LOCKSTEP) {
        return yaml_error(
            error, &stimulus->mark,
            "found silence in lockstep, expected clock: free: without STEP no tick runs");
    }
    return stimulus->action == SCENARIO_FRAME ? check_frame(&stimulus->frame, error) : ERROR_NONE;
}

/* Appends the stimuli of clean_up to the list. Their times are relative to the label clean_up. */
static enum error_code join_clean_up(struct scenario *scenario, struct arena *arena,
                                     struct error *error)
{
    size_t count = scenario->nstimulus + scenario->ncleanup;
    struct scenario_stimulus *all = arena_alloc(arena, count + 1, sizeof *all);

    if (!all) {
        return error_set(error, ERROR_MEMORY, "%s: no memory left", scenario->file);
    }
    if (count > SCENARIO_STIMULI_MAX) {
        return yaml_error(error, &scenario->mark, "found %zu stimuli, expected at most %d", count,
                          SCENARIO_STIMULI_MAX);
    }
    for (size_t i = 0; i < count; i++) {
        bool last = i >= scenario->nstimulus;

        all[i] = last ? scenario->clean_up[i - scenario->nstimulus] : scenario->stimulus[i];
        if (last && all[i].after) {
            return yaml_error(error, &all[i].mark, "found after: in clean_up, expected none");
        }
        all[i].after = last ? "clean_up" : all[i].after;
    }
    scenario->stimulus = all;
    scenario->nstimulus = count;
    return ERROR_NONE;
}

/* Assigns an index to a stimulus's label. Stimuli with the same label share the index; -1 = no
 * label. */
static enum error_code add_label(struct scenario *scenario, struct scenario_stimulus *stimulus,
                                 struct error *error)
{
    size_t index = 0;

    stimulus->label_index = -1;
    if (!stimulus->label) {
        return ERROR_NONE;
    }
    while (index < scenario->nlabel && strcmp(scenario->label[index], stimulus->label) != 0) {
        index++;
    }
    if (index < SCENARIO_LABELS) {
        return yaml_error(error, &stimulus->mark,
                          "found label \"%s\", expected another: that is the runner's own",
                          stimulus->label);
    }
    scenario->nlabel += index == scenario->nlabel;
    scenario->label[index] = stimulus->label;
    stimulus->label_index = (int)index;
    return ERROR_NONE;
}

/* Checks all stimuli and resolves their labels. */
static enum error_code check_stimuli(struct scenario *scenario, struct error *error)
{
    enum error_code code;

    scenario->label[SCENARIO_LABEL_START] = "start";
    scenario->label[SCENARIO_LABEL_READY] = "ready";
    scenario->label[SCENARIO_LABEL_CLEAN_UP] = "clean_up";
    scenario->nlabel = SCENARIO_LABELS;
    for (size_t i = 0; i < scenario->nstimulus; i++) {
        if ((code = check_stimulus(scenario, &scenario->stimulus[i], error)) ||
            (code = add_label(scenario, &scenario->stimulus[i], error))) {
            return code;
        }
    }

    /* Resolve references last, because a stimulus may refer to the label of a later stimulus */
    for (size_t i = 0; i < scenario->nstimulus; i++) {
        struct scenario_stimulus *stimulus = &scenario->stimulus[i];

        code = resolve_after(scenario, stimulus->after, &stimulus->mark, &stimulus->after_index,
                             error);
        if (code) {
            return code;
        }
    }
    return ERROR_NONE;
}

/* ---- expectations ---- */

/* Derives subject, band and window of an expectation from its keys. */
static enum error_code check_form(struct scenario_expectation *e, struct error *error)
{
    static const char *const keys[] = {"between", "reaches", "period_s", "count"};
    static const enum scenario_look looks[] = {SCENARIO_BETWEEN, SCENARIO_REACHES, SCENARIO_PERIOD,
                                               SCENARIO_SEEN};
    const double *const bands[] = {e->between, e->reaches, e->period_s, e->count};
    static const double never[2] = {0.0, 0.0}, once[2] = {1.0, DBL_MAX};
    const double *band = e->never ? never : once; /* a frame or event must be seen at least once */
    int how = e->never;
    bool of_signal;

    /* Derive the kind of judgment and the band */
    e->look = SCENARIO_SEEN;
    for (size_t i = 0; i < ARRAY_COUNT(keys); i++) {
        if (yaml_has(&e->mark, keys[i])) {
            e->look = looks[i];
            band = bands[i];
            how++;
        }
    }
    memcpy(e->band, band, sizeof e->band);
    of_signal = e->look == SCENARIO_BETWEEN || e->look == SCENARIO_REACHES;
    if (!!e->signal + !!e->frame.bus + !!e->event != 1 || how > 1 || !!e->signal != of_signal ||
        (e->relative && !e->signal) || (e->look == SCENARIO_PERIOD && !e->frame.bus)) {
        return yaml_error(error, &e->mark,
                          "found expectation \"%.60s\" of no known form, expected signal with "
                          "between or reaches; frame with nothing more, never, count or period_s; "
                          "or event with nothing more, never or count",
                          e->name);
    }
    if (!(e->band[0] <= e->band[1])) {
        return yaml_error(error, &e->mark, "found the band [%g, %g], expected the lower end first",
                          e->band[0], e->band[1]);
    }

    /* Derive the end of the window from one of two keys */
    e->ends = yaml_has(&e->mark, "to_s");
    if (yaml_has(&e->mark, "within_s")) {
        if (e->ends) {
            return yaml_error(error, &e->mark, "found both to_s and within_s, expected one");
        }
        e->to_s = e->from_s + e->within_s;
        e->ends = true;
    }
    if (e->ends && e->to_s < e->from_s) {
        return yaml_error(error, &e->mark, "found to_s %g before from_s %g", e->to_s, e->from_s);
    }
    return e->frame.bus ? parse_bytes(e->frame.data, &e->frame.mark, e->frame.byte, e->frame.mask,
                                      &e->frame.len, error)
                        : ERROR_NONE;
}

/* Checks the number of expectations, and the form, unique name and label of each. */
static enum error_code check_expectations(struct scenario *scenario, struct error *error)
{
    enum error_code code = ERROR_NONE;

    if (scenario->nexpectation == 0 || scenario->nexpectation > SCENARIO_EXPECTATIONS_MAX) {
        return yaml_error(error, &scenario->mark, "found %zu expectations, expected 1 to %d",
                          scenario->nexpectation, SCENARIO_EXPECTATIONS_MAX);
    }
    for (size_t i = 0; i < scenario->nexpectation && !code; i++) {
        struct scenario_expectation *e = &scenario->expectation[i];

        code = check_form(e, error);
        for (size_t k = 0; k < i && !code; k++) {
            if (!strcmp(scenario->expectation[k].name, e->name)) {
                code = yaml_error(error, &e->mark,
                                  "found expectation \"%.60s\" twice, expected names of their own",
                                  e->name);
            }
        }
        code = code ? code : resolve_after(scenario, e->after, &e->mark, &e->after_index, error);
    }
    return code;
}

/* ---- mutations ---- */

/* Checks each mutation: it adds a fault or omits stimuli, and names expectations of the
 * scenario. */
static enum error_code check_mutations(const struct scenario *scenario, struct error *error)
{
    const struct yaml_names expectations =
        YAML_NAMES(scenario->expectation, scenario->nexpectation, name);
    const struct yaml_names labels = {scenario->label + SCENARIO_LABELS,
                                      scenario->nlabel - SCENARIO_LABELS, sizeof *scenario->label,
                                      0};
    int unused;

    if (scenario->nmutation > SCENARIO_MUTATIONS_MAX) {
        return yaml_error(error, &scenario->mark, "found %zu mutations, expected at most %d",
                          scenario->nmutation, SCENARIO_MUTATIONS_MAX);
    }
    for (size_t i = 0; i < scenario->nmutation; i++) {
        const struct scenario_mutation *mutation = &scenario->mutation[i];

        if (!mutation->fault == !mutation->without) {
            return yaml_error(error, &mutation->mark,
                              "found mutation \"%.60s\" with %s of fault and without, expected one",
                              mutation->name, mutation->fault ? "both" : "neither");
        }

        /* The runner's own labels cannot be omitted */
        if (mutation->without && yaml_find_name(labels, "label of a stimulus", mutation->without,
                                                &mutation->mark, &unused, error)) {
            return ERROR_INPUT;
        }
        for (size_t k = 0; k < mutation->nfail; k++) {
            if (yaml_find_name(expectations, "expectation", mutation->fails[k].name,
                               &mutation->fails[k].mark, &unused, error)) {
                return ERROR_INPUT;
            }
        }
    }
    return ERROR_NONE;
}

/* Finds the rig: a path relative to the scenario, or the name of an installed rig. */
static enum error_code find_rig(struct scenario *scenario, struct arena *arena, struct error *error)
{
    const struct yaml_mark *mark = yaml_place(&scenario->mark, "rig");

    if (strpbrk(scenario->rig, "/.")) {
        return yaml_resolve_path(mark, scenario->rig, arena, &scenario->rig_path, error);
    }
    return rig_locate_from(scenario->rig, scenario->file, arena, &scenario->rig_path, error)
               ? error_prefix(error, "%s:%d:%d", mark->file, mark->line, mark->column)
               : ERROR_NONE;
}

enum error_code scenario_check(struct scenario *scenario, struct arena *arena, struct error *error)
{
    enum error_code code;

    if (!text_is_name(scenario->name)) {
        return yaml_error(error, &scenario->mark,
                          "found name \"%.60s\", expected letters, digits, _ - and . only",
                          scenario->name);
    }

    /* Only one of task, host and program may drive the boards; a program needs lockstep */
    if (scenario->task && scenario->host != SCENARIO_HOST_NONE) {
        return yaml_error(error, yaml_place(&scenario->mark, "task"),
                          "found both a task and a host, expected one of them to drive the boards");
    }
    if (scenario->host == SCENARIO_HOST_PROGRAM && scenario->clock != LOOP_CLOCK_LOCKSTEP) {
        return yaml_error(error, &scenario->mark,
                          "found host: program without clock: lockstep, expected it: the program "
                          "drives the run by STEP");
    }
    if (scenario->task && task_runner_check_name(scenario->task, error)) {
        return error_prefix(error, "%s:%d:%d", scenario->file,
                            yaml_place(&scenario->mark, "task")->line,
                            yaml_place(&scenario->mark, "task")->column);
    }
    if ((code = find_rig(scenario, arena, error)) ||
        (code = join_clean_up(scenario, arena, error)) || (code = check_stimuli(scenario, error)) ||
        (code = check_expectations(scenario, error))) {
        return code;
    }
    return check_mutations(scenario, error);
}
