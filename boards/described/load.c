/* SPDX-License-Identifier: Apache-2.0 */
/* Builds the table of a described protocol from its file: resolves names, lays out fields,
 * checks. */
#include "boards/described/load.h"

#include "base/array.h"

#include <math.h>
#include <stdio.h>

enum error_code described_no_memory(struct described_loader *l)
{
    return error_set(l->error, ERROR_MEMORY, "no memory left for the protocol \"%s\"",
                     l->raw->name);
}

enum error_code described_check_word(struct described_loader *l, const struct yaml_mark *mark,
                                     const char *word)
{
    static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";
    static const char all[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_";

    if (strspn(word, letters) > 0 && strspn(word, all) == strlen(word)) {
        return ERROR_NONE;
    }
    return yaml_error(l->error, mark,
                      "found the name \"%.60s\", expected letters, digits and _ after a letter: it "
                      "is one in DBC files too",
                      word);
}

/* ---- states ---- */

/* Finds the index of the state that the file names under `key`. Keeps *index if the key is
 * absent. */
static enum error_code described_find_name(struct described_loader *l, const struct yaml_mark *mark,
                                           const char *key, const char *name, int *index)
{
    const struct yaml_names states = YAML_NAMES(l->made->state, l->made->nstate, name);

    enum error_code code =
        name ? yaml_find_name(states, "state", name, yaml_place(mark, key), index, l->error)
             : ERROR_NONE;

    if (name && !code &&
        (l->made->state[*index].law == DESCRIBED_REFUSED) != !strcmp(key, "unknown_state")) {
        return yaml_error(l->error, yaml_place(mark, key),
                          "found state \"%s\", expected one %s law: refused", name,
                          strcmp(key, "unknown_state") != 0 ? "without" : "with");
    }
    return code;
}

/* Checks the states, or the selectable laws. */
static enum error_code described_check_states(struct described_loader *l,
                                              const struct described_state *state, size_t count,
                                              bool of_laws)
{
    for (size_t i = 0; i < count; i++) {
        const struct described_state *each = &state[i];
        bool open = each->law == DESCRIBED_OFF || each->law == DESCRIBED_FAULT;
        int fault = 0;

        for (size_t k = 0; k < i; k++) {
            if (!strcmp(state[k].name, each->name)) {
                return yaml_error(l->error, &each->mark,
                                  "found the name \"%s\" again, expected another", each->name);
            }
        }
        if (of_laws && (open || each->law >= DESCRIBED_SELECTED)) {
            return yaml_error(
                l->error, &each->mark,
                "found a law that is off, fault, selected or refused, expected one that drives");
        }
        if (each->law == DESCRIBED_SELECTED && l->raw->nlaw == 0) {
            return yaml_error(l->error, &each->mark,
                              "found law: selected without a list \"laws\", expected both or none");
        }
        if (each->fault &&
            (each->law != DESCRIBED_FAULT ||
             yaml_find_name(YAML_NAMES(described_faults_schema.fields, DESCRIBED_FAULT_KINDS, key),
                            "fault", each->fault, yaml_place(&each->mark, "fault"), &fault,
                            l->error))) {
            return each->law == DESCRIBED_FAULT
                       ? ERROR_INPUT
                       : yaml_error(l->error, yaml_place(&each->mark, "fault"),
                                    "found fault without law: fault, expected both or none");
        }
        if (each->fault) {
            l->made->fault_for[fault] = (int)i;
        }
        if (each->set_point_scale == 0.0) {
            return yaml_error(l->error, &each->mark, "found set_point_scale 0, expected another");
        }
    }
    return ERROR_NONE;
}

/* Builds states and laws, and finds the states for power-up, faults and time-outs. */
static enum error_code described_build_states(struct described_loader *l)
{
    struct described_protocol *made = l->made;
    enum error_code code = ERROR_NONE;

    if (l->raw->nstate > DESCRIBED_STATES_MAX || l->raw->nlaw > DESCRIBED_LAWS_MAX) {
        return yaml_error(l->error, &l->raw->mark,
                          "found %zu states and %zu laws, expected at most %d and %d",
                          l->raw->nstate, l->raw->nlaw, DESCRIBED_STATES_MAX, DESCRIBED_LAWS_MAX);
    }
    made->state = l->raw->state;
    made->law = l->raw->law;
    made->nstate = l->raw->nstate;
    made->nlaw = l->raw->nlaw;
    memset(made->fault_for, -1, sizeof made->fault_for);
    code = described_check_states(l, made->state, made->nstate, false);
    code = code ? code : described_check_states(l, made->law, made->nlaw, true);

    /* Axes start in the first state with law off. Faults enter the first state with law fault */
    made->off_state = made->fault_state = made->timeout_state = made->unknown_state = -1;
    for (int i = (int)made->nstate - 1; i >= 0; i--) {
        made->off_state = made->state[i].law == DESCRIBED_OFF ? i : made->off_state;
        if (made->state[i].law == DESCRIBED_FAULT &&
            (made->fault_state < 0 || !made->state[i].fault ||
             made->state[made->fault_state].fault)) {
            made->fault_state = i;
        }
    }
    if (!code && made->off_state < 0) {
        return yaml_error(l->error, &l->raw->mark,
                          "found no state with law: off, expected one: axes start in it");
    }
    if (made->fault_state < 0) {
        made->fault_state = made->off_state;
    }
    code = code ? code
                : described_find_name(l, &l->raw->mark, "on_timeout", l->raw->timeout_state,
                                      &made->timeout_state);
    return code ? code
                : described_find_name(l, &l->raw->mark, "unknown_state", l->raw->unknown_state,
                                      &made->unknown_state);
}

/* Refuses two states with the same value. A reader of the field would find only the first state. */
static enum error_code described_check_values(struct described_loader *l,
                                              enum described_meaning meaning,
                                              const struct described_state *raw, size_t count)
{
    bool carried = false;

    for (size_t i = 0; i < l->made->nframe; i++) {
        carried = carried || described_find_field(&l->made->frame[i], meaning) >= 0;
    }
    for (size_t i = 0; i < count && carried; i++) {
        for (size_t k = 0; k < i; k++) {
            if (raw[k].value == raw[i].value &&
                (raw[k].law != DESCRIBED_OFF || raw[i].law != DESCRIBED_FAULT)) {
                return yaml_error(l->error, yaml_place(&raw[i].mark, "value"),
                                  "found value %lld of \"%s\", which \"%s\" (line %d) has, "
                                  "expected another: a field tells them apart by it",
                                  (long long)raw[i].value, raw[i].name, raw[k].name,
                                  raw[k].mark.line);
            }
        }
    }
    return ERROR_NONE;
}

/* Returns the mask of a field that carries faults; 0 for any other field. */
static uint64_t described_fault_mask(const struct described_field *field)
{
    return field->meaning == DESCRIBED_FAULTS || field->meaning == DESCRIBED_LATCHED_FAULTS
               ? field->mask
               : 0;
}

/* Refuses a position law with gain 0 if no host can set the gain. Targets would have no effect. */
static enum error_code described_check_gains(const struct described_loader *l,
                                             const struct described_state *list, size_t count)
{
    bool settable = l->made->gains.position_per_s > 0.0;

    for (size_t f = 0; f < l->made->nframe; f++) {
        settable =
            settable || described_find_field(&l->made->frame[f], DESCRIBED_POSITION_GAIN) >= 0;
    }
    for (size_t i = 0; i < l->made->nparameter; i++) {
        settable = settable || l->made->parameter[i].field.meaning == DESCRIBED_POSITION_GAIN;
    }
    for (size_t i = 0; i < count && !settable; i++) {
        if (list[i].law == DESCRIBED_POSITION) {
            return yaml_error(l->error, yaml_place(&list[i].mark, "law"),
                              "found law: position with the gain 0, expected gains: "
                              "{position_per_s: ...}, or a frame or parameter that sets it");
        }
    }
    return ERROR_NONE;
}

/* Refuses a fault whose bit lies outside all fault fields. Without fault fields, accepts any
 * bit. */
static enum error_code described_check_faults(const struct described_loader *l)
{
    uint64_t bits = 0;
    char key[40];

    for (size_t f = 0; f < l->made->nframe; f++) {
        for (size_t i = 0; i < l->made->frame[f].nfield; i++) {
            bits |= described_fault_mask(&l->made->frame[f].field[i]);
        }
    }
    for (size_t i = 0; i < l->made->nparameter; i++) {
        bits |= described_fault_mask(&l->made->parameter[i].field);
    }
    for (int k = 0; k < DESCRIBED_FAULT_KINDS && bits; k++) {
        if (l->made->fault_bit[k] >= 0 && !(bits >> l->made->fault_bit[k] & 1)) {
            snprintf(key, sizeof key, "faults.%s", described_faults_schema.fields[k].key);
            return yaml_error(l->error, yaml_place(&l->raw->mark, key),
                              "found bit %d of fault \"%s\", but the longest field of faults has "
                              "the bits 0 to %d",
                              l->made->fault_bit[k], key + strlen("faults."),
                              63 - __builtin_clzll(bits));
        }
    }
    return ERROR_NONE;
}

/* ---- frames ---- */

/* Checks the keys of a frame against each other. */
static enum error_code described_check_frame(struct described_loader *l,
                                             const struct raw_described_frame *raw,
                                             const struct described_frame *made)
{
    const unsigned most = raw->extended ? DESCRIBED_EXTENDED_ID_MAX : DESCRIBED_STANDARD_ID_MAX;
    const uint64_t highest = made->base + (uint64_t)made->step * made->most;
    const bool period = made->period_ns > 0;
    const struct {
        bool wrong;
        const char *key, *message;
    } checks[] = {
        {yaml_has(&raw->mark, "step") && made->by != DESCRIBED_BY_ADDRESS, "step",
         "found step, expected it with by: address only"},
        {made->by == DESCRIBED_BY_SLOT && raw->row.of && made->of != DESCRIBED_MOTOR, "of",
         "found of beside by: slot, expected motor: only axes have slots"},
        {yaml_has(&raw->mark, "bit_rate_switch") && !raw->fd, "bit_rate_switch",
         "found bit_rate_switch without fd: true, expected both or none"},
        {made->or_empty && !made->remote, "",
         "found or_empty without remote: true, expected both or none"},
        {raw->fd && made->remote, "",
         "found fd beside remote, expected one of them: CAN FD has no remote frames"},
        {made->from_host && (made->telemetry || period || made->on_change || made->on_fault ||
                             made->on_restart || made->answer_id),
         "",
         "found a key of frames from the board in one from the host: period_s, telemetry, "
         "on_change, on_restart or answer_id"},
        {!made->from_host && (raw->reply || raw->enter || raw->select || raw->only || made->save ||
                              made->zero || made->remote || made->stop || made->clear ||
                              made->restart || yaml_has(&raw->mark, "lengths")),
         "",
         "found a key of frames from the host in one from the board: reply, enter, select, only, "
         "save, zero, stop, clear_faults, restart, lengths or remote"},
        {(made->time.delay_ns >= 0 || made->time.spread_ns >= 0) && !raw->reply, "",
         "found reply_delay_s or reply_spread_s without reply, expected both or none"},
        {made->optional && !period, "optional", "found optional without period_s, expected both"},
        {made->telemetry && period, "period_s",
         "found period_s beside telemetry, expected one of them"},
    };

    if (highest > most) {
        return yaml_error(
            l->error, yaml_place(&raw->mark, "id"),
            "found ids up to 0x%llx, expected them within 0x%x: lower id, step or address_max%s",
            (unsigned long long)highest, most,
            raw->extended ? "" : ", or set extended: true for 29 bits");
    }
    for (size_t i = 0; i < ARRAY_COUNT(checks); i++) {
        if (checks[i].wrong) {
            return yaml_error(l->error,
                              *checks[i].key ? yaml_place(&raw->mark, checks[i].key) : &raw->mark,
                              "%s", checks[i].message);
        }
    }
    if (made->period_ns % 1000000 != 0) {
        return yaml_error(l->error, yaml_place(&raw->mark, "period_s"),
                          "found a period of %.15g s, expected whole milliseconds",
                          (double)made->period_ns * 1e-9);
    }
    return ERROR_NONE;
}

/* Finds the index of the law that a frame names under `key`. Keeps *index if the key is absent. */
static enum error_code described_find_law(struct described_loader *l,
                                          const struct raw_described_frame *raw, const char *key,
                                          const char *name, int *index)
{
    return name ? yaml_find_name(YAML_NAMES(l->made->law, l->made->nlaw, name), "law", name,
                                 yaml_place(&raw->mark, key), index, l->error)
                : ERROR_NONE;
}

/* Builds the row of a frame and lays out its fields. */
static enum error_code described_build_frame(struct described_loader *l,
                                             const struct raw_described_frame *raw,
                                             struct described_frame *made)
{
    enum error_code code;

    *made = raw->row;
    made->from_host = raw->from_host;
    made->flags =
        (uint8_t)((raw->extended ? FRAME_EXTENDED : 0) | (made->remote ? FRAME_REMOTE : 0) |
                  (raw->fd ? FRAME_FD | (raw->brs ? FRAME_BRS : 0) : 0));
    made->either = l->raw->follow_fd && !made->remote;
    made->flags |= made->either && l->fd ? FRAME_FD | FRAME_BRS : 0;
    made->of = raw->row.of ? raw->row.of : made->from_host ? DESCRIBED_ANY : DESCRIBED_MOTOR;
    made->spread_ms = (unsigned)((raw->spread_ns + 500000) / 1000000);
    made->reply[0] = made->reply[1] = made->reply[2] = made->enter = -1;
    made->repeats = (uint8_t)raw->repeat;
    memset(made->echo, -1, sizeof made->echo);
    made->most = (uint8_t)(made->by == DESCRIBED_BY_ADDRESS ? l->made->address_max
                           : made->by == DESCRIBED_BY_SLOT  ? DESCRIBED_SLOTS - 1u
                           : made->by == DESCRIBED_BY_GROUP ? (DESCRIBED_SLOTS - 1u) / made->repeats
                                                            : 0u);
    code = described_check_word(l, &raw->mark, made->name);
    code = code ? code : described_check_frame(l, raw, made);
    code = code ? code : described_lay_out(l, raw, made);
    made->time.delay_ns = made->time.delay_ns < 0 ? l->raw->time.delay_ns : made->time.delay_ns;
    made->time.spread_ns = made->time.spread_ns < 0 ? l->raw->time.spread_ns : made->time.spread_ns;
    code = code ? code : described_find_name(l, &raw->mark, "enter", raw->enter, &made->enter);

    /* Properties of the row that follow from the meanings of its fields */
    made->select = made->only = -1;
    code = code ? code : described_find_law(l, raw, "select", raw->select, &made->select);
    code = code ? code : described_find_law(l, raw, "only", raw->only, &made->only);
    made->switches = made->clear || made->stop || made->enter >= 0 || made->select >= 0;
    made->configures = made->save;
    for (size_t i = 0; i < made->nfield && !code; i++) {
        enum described_meaning meaning = made->field[i].meaning;

        made->commands =
            made->commands || (meaning >= DESCRIBED_SET_POINT && meaning < DESCRIBED_TARGETS_END);
        made->switches = made->switches || meaning == DESCRIBED_STATE || meaning == DESCRIBED_LAW;
        made->configures = made->configures || described_is_setting(meaning) ||
                           meaning == DESCRIBED_ANSWER_ID || meaning == DESCRIBED_PARAMETER ||
                           meaning == DESCRIBED_PRESENT_POSITION ||
                           meaning == DESCRIBED_HOST_NUMBER || meaning == DESCRIBED_NEW_ADDRESS;
        made->checked = made->checked || meaning == DESCRIBED_STATE || meaning == DESCRIBED_LAW ||
                        meaning == DESCRIBED_PARAMETER || meaning == DESCRIBED_NEW_ADDRESS ||
                        meaning == DESCRIBED_TELEMETRY_PERIOD;
        made->selects = made->selects || meaning == DESCRIBED_SLOTS_MASK ||
                        meaning == DESCRIBED_ADDRESS || meaning == DESCRIBED_AXIS;
        made->of_one = made->of_one || meaning == DESCRIBED_AXIS ||
                       meaning == DESCRIBED_SLOTS_MASK || made->by >= DESCRIBED_BY_SLOT;
        if (made->from_host) {
            l->made->clears = l->made->clears || made->clear;
            l->made->period_settable =
                l->made->period_settable || meaning == DESCRIBED_TELEMETRY_PERIOD;
        } else {
            l->made->tells[meaning] = true;
        }
    }
    return code;
}

/* Returns the index of a frame by direction, kind of board and name; -1 = none. */
static int described_frame_index(const struct described_protocol *made, const char *name,
                                 bool from_host, unsigned kind)
{
    for (size_t i = 0; i < made->nframe; i++) {
        if (made->frame[i].from_host == from_host && made->frame[i].of & kind &&
            !strcmp(made->frame[i].name, name)) {
            return (int)i;
        }
    }
    return -1;
}

/* Finds the fields of a request that the echo fields of its reply copy. An echo without such a
 * field needs a host_value. */
static enum error_code described_link_echo(struct described_loader *l,
                                           const struct raw_described_frame *raw,
                                           struct described_frame *request,
                                           const struct described_frame *reply)
{
    int64_t echoes = 0;

    for (size_t i = 0; i < reply->nfield; i++) {
        struct described_field *echo = &reply->field[i];
        const char *name = described_layout(reply, i)->name;
        int8_t found = -1;

        if (echo->meaning != DESCRIBED_ECHO) {
            continue;
        }
        for (size_t j = 0; j < request->nfield; j++) {
            if (!strcmp(described_layout(request, j)->name, name)) {
                found = (int8_t)j;
            }
        }
        if (echoes == DESCRIBED_ECHOES || (found < 0 && echo->host == 0.0) ||
            (request->echo[echoes] >= 0 && request->echo[echoes] != found)) {
            return yaml_error(l->error, yaml_place(&raw->mark, "reply"),
                              "found reply \"%s\", whose field \"%s\" echoes one that this frame "
                              "does not have, or is beyond the %d echoes of a frame",
                              raw->reply, name, DESCRIBED_ECHOES);
        }
        echo->constant = echoes;
        request->echo[echoes++] = found;
    }
    return ERROR_NONE;
}

/* Builds all frames, then finds their answers. */
static enum error_code described_build_frames(struct described_loader *l)
{
    enum error_code code = ERROR_NONE;

    if (l->raw->nframe == 0 || l->raw->nframe > DESCRIBED_FRAMES_MAX) {
        return yaml_error(l->error, &l->raw->mark, "found %zu frames, expected 1 to %d",
                          l->raw->nframe, DESCRIBED_FRAMES_MAX);
    }
    for (size_t i = 0; i < l->raw->nframe && !code; i++) {
        code = described_build_frame(l, &l->raw->frame[i], &l->made->frame[i]);
        l->made->frame[i].index = (uint8_t)i;
        l->made->saves = l->made->saves || l->made->frame[i].save;
        l->made->nframe = i + 1;
        for (size_t k = 0; k < i && !code; k++) {
            const struct described_frame *x = &l->made->frame[k], *y = &l->made->frame[i];

            if (!strcmp(x->name, y->name) && x->from_host == y->from_host && x->of & y->of) {
                return yaml_error(l->error, &l->raw->frame[i].mark,
                                  "found frame \"%s\" again, expected one of the name (line %d) "
                                  "for a kind of board",
                                  y->name, l->raw->frame[k].mark.line);
            }
        }
    }
    for (size_t i = 0; i < l->raw->nframe && !code; i++) {
        /* Find the rows of a frame's answers. All rows must have been built. */
        const struct raw_described_frame *raw = &l->raw->frame[i];
        struct described_frame *made = &l->made->frame[i];
        bool found = !raw->reply;

        for (unsigned k = 0; raw->reply && k < 3 && !code; k++) {
            if (made->of >> k & 1) {
                made->reply[k] = described_frame_index(l->made, raw->reply, false, 1u << k);
            }
            if (made->reply[k] >= 0) {
                found = true;
                code = described_link_echo(l, raw, made, &l->made->frame[made->reply[k]]);
            }
        }
        code = found ? code
                     : yaml_error(
                           l->error, yaml_place(&raw->mark, "reply"),
                           "found reply \"%s\", expected the name of a frame from the same boards",
                           raw->reply);
    }
    return code;
}

/* ---- identifiers ---- */

/* Finds numbers with which two frames have the same identifier on every bus. Two frames with equal
 * numbers of one kind (enum described_by) belong to the same board. Addresses begin with 1. */
static bool described_find_meeting(const struct described_frame *a, const struct described_frame *b,
                                   unsigned *na, unsigned *nb)
{
    uint32_t fixed = ~(a->mask | b->mask);
    bool any = a->by == DESCRIBED_BY_NONE || b->by == DESCRIBED_BY_NONE;

    if (!any && a->by != b->by) {
        return false;
    }
    for (*na = a->by == DESCRIBED_BY_ADDRESS; *na <= a->most; ++*na) {
        const unsigned least = any ? b->by == DESCRIBED_BY_ADDRESS : *na;

        for (*nb = least; *nb <= (any || b->most < *na ? b->most : *na); ++*nb) {
            if (!((described_id(a, *na) ^ described_id(b, *nb)) & fixed)) {
                return true;
            }
        }
    }
    return false;
}

/* Refuses two frames with the same identifier that no receiver can distinguish. rig/described_ids.c
 * checks two cases later, for each rig: frames from boards of different kinds, and collisions that
 * depend on board addresses. */
static enum error_code described_check_pair(struct described_loader *l, size_t first, size_t second)
{
    const struct described_frame *a = &l->made->frame[first], *b = &l->made->frame[second];
    const bool same = a->from_host == b->from_host;
    unsigned na, nb;

    if ((a->flags ^ b->flags) & FRAME_EXTENDED || (same && !a->from_host && !(a->of & b->of)) ||
        described_told_apart(a, b) || !described_find_meeting(a, b, &na, &nb)) {
        return ERROR_NONE;
    }
    return yaml_error(
        l->error, yaml_place(&l->raw->frame[second].mark, "id"),
        "found identifier 0x%x of frame \"%s\" %s%s, which frame \"%s\" (line %d) %s%s has: "
        "expected another identifier%s",
        (unsigned)described_id(b, nb), b->name, same ? "again" : "from the ",
        same           ? ""
        : b->from_host ? "host"
                       : "board",
        a->name, l->raw->frame[first].mark.line, same ? "of the same sender" : "from the ",
        same           ? ""
        : a->from_host ? "host"
                       : "board",
        same ? ", another length, or constants that tell it apart in the first of the two" : "");
}

/* Refuses frames that a receiver cannot distinguish. This includes a frame that an earlier row
 * always matches first. */
static enum error_code described_check_ids(struct described_loader *l)
{
    enum error_code code = ERROR_NONE;

    for (size_t second = 0; second < l->made->nframe && !code; second++) {
        for (size_t first = 0; first < second && !code; first++) {
            code = described_check_pair(l, first, second);
        }
    }
    return code;
}

/* ---- parameters ---- */

/* Builds the parameters; each has a unique number. */
static enum error_code described_build_parameters(struct described_loader *l)
{
    const struct raw_described *raw = l->raw;
    enum error_code code = ERROR_NONE;

    if (raw->nparameter > DESCRIBED_PARAMETERS_MAX) {
        return yaml_error(l->error, &raw->mark, "found %zu parameters, expected at most %d",
                          raw->nparameter, DESCRIBED_PARAMETERS_MAX);
    }
    for (size_t i = 0; i < raw->nparameter && !code; i++) {
        struct described_parameter *made = &l->made->parameter[i];

        if (yaml_has(&raw->parameter[i].mark, "number") &&
            described_find_parameter(l->made, raw->parameter[i].number)) {
            return yaml_error(l->error, yaml_place(&raw->parameter[i].mark, "number"),
                              "found number %lld again, expected another",
                              (long long)raw->parameter[i].number);
        }
        code = described_lay_out_parameter(l, &raw->parameter[i], made);
        l->made->nparameter = i + 1;
    }
    return code;
}

/* ---- models ---- */

/* Finds the parameter that is the factor of a field. A host may write only positive factors. */
static enum error_code described_link_factor(struct described_loader *l,
                                             const struct raw_described_field *raw,
                                             struct described_field *field, bool *found)
{
    const struct yaml_names names = YAML_NAMES(l->made->parameter, l->made->nparameter, name);
    int index;
    enum error_code code = raw->times
                               ? yaml_find_name(names, "parameter", raw->times,
                                                yaml_place(&raw->mark, "times"), &index, l->error)
                               : ERROR_NONE;

    if (!raw->times || code) {
        return code;
    }
    if (l->made->parameter[index].field.meaning != DESCRIBED_STORED) {
        return yaml_error(l->error, yaml_place(&raw->mark, "times"),
                          "found the factor \"%s\", expected a parameter with a value", raw->times);
    }
    l->made->parameter[index].positive = true;
    field->times = (int16_t)index;
    *found = true;
    return ERROR_NONE;
}

/* Copies a layout for each model, with the scales that the model's factors give. field: fields of
 * the layout, without padding. */
static enum error_code described_scale_layout(struct described_loader *l,
                                              const struct described_field *field,
                                              const struct field *layout,
                                              const struct field ***layouts)
{
    size_t count = 1;

    while (layout && layout[count - 1].type != FIELD_END) {
        count++;
    }
    *layouts = layout ? arena_alloc(l->arena, l->made->nmodel, sizeof **layouts) : NULL;
    for (size_t m = 0; *layouts && m < l->made->nmodel; m++) {
        struct field *copy = arena_alloc(l->arena, count, sizeof *copy);
        const struct described_field *of = field;

        if (!copy) {
            return described_no_memory(l);
        }
        for (size_t i = 0; i < count; i++) {
            copy[i] = layout[i];
            if (layout[i].type != FIELD_END && !(layout[i].type & FIELD_PADDING) &&
                (of++)->times >= 0) {
                const struct described_field scaled =
                    described_model_field(l->made, (unsigned)m, of - 1);

                copy[i].scale = scaled.scale;
                copy[i].offset = scaled.offset;
            }
        }
        (*layouts)[m] = copy;
    }
    return layout && !*layouts ? described_no_memory(l) : ERROR_NONE;
}

/* Links the factors of all fields. */
static enum error_code described_link_factors(struct described_loader *l)
{
    enum error_code code = ERROR_NONE;
    bool found;

    for (size_t i = 0; i < l->made->nparameter && !code; i++) {
        code = described_link_factor(l, &l->raw->parameter[i].field, &l->made->parameter[i].field,
                                     &found);
    }
    for (size_t f = 0; f < l->made->nframe && !code; f++) {
        const struct raw_described_frame *raw = &l->raw->frame[f];
        struct described_frame *made = &l->made->frame[f];

        found = false;
        for (size_t i = 0; i < raw->nfield && !code; i++) {
            code = described_link_factor(l, &raw->field[i], &made->field[i], &found);
        }
        for (size_t i = 0; i < raw->nid_field && !code; i++) {
            code =
                described_link_factor(l, &raw->id_field[i], &made->field[made->ndata + i], &found);
        }
        if (!code && found) {
            code = described_scale_layout(l, made->field, made->layout, &made->model_layout);
        }
        if (!code && found) {
            code = described_scale_layout(l, made->field + made->ndata, made->id_layout,
                                          &made->model_id_layout);
        }
    }
    return code;
}

/* Sets the values that a model gives to parameters. A parameter with a value has it in all models,
 * unless a model gives another. */
static enum error_code described_build_model(struct described_loader *l,
                                             const struct raw_described_model *raw,
                                             struct described_model *made)
{
    const struct yaml_names names = YAML_NAMES(l->made->parameter, l->made->nparameter, name);
    int64_t *counts = arena_alloc(l->arena, l->made->nparameter + 1, sizeof *counts);
    bool *given = arena_alloc(l->arena, l->made->nparameter + 1, sizeof *given);

    if (!counts || !given) {
        return described_no_memory(l);
    }
    *made = (struct described_model){raw ? raw->name : "", counts, given};
    for (size_t i = 0; i < l->made->nparameter; i++) {
        const struct described_parameter *parameter = &l->made->parameter[i];

        given[i] = parameter->field.meaning == DESCRIBED_STORED;
        counts[i] = given[i] ? parameter->field.constant : 0;
    }
    for (size_t i = 0; raw && i < raw->nentry; i++) {
        const struct yaml_real_entry *entry = &raw->entry[i];
        int index;

        if (yaml_find_name(names, "parameter", entry->name, &entry->mark, &index, l->error)) {
            return ERROR_INPUT;
        }
        if (!l->made->parameter[index].writable &&
            l->made->parameter[index].field.meaning != DESCRIBED_STORED) {
            return yaml_error(l->error, &entry->mark,
                              "found parameter \"%s\", expected one with a value or a setting",
                              entry->name);
        }
        given[index] = true;
        counts[index] = described_count(&l->made->parameter[index].field, entry->value);
    }
    return ERROR_NONE;
}

/* Builds the models; a file without models has one without a name. */
static enum error_code described_build_models(struct described_loader *l)
{
    const struct raw_described *raw = l->raw;
    enum error_code code = ERROR_NONE;

    if (raw->nmodel > DESCRIBED_MODELS_MAX) {
        return yaml_error(l->error, &raw->mark, "found %zu models, expected at most %d",
                          raw->nmodel, DESCRIBED_MODELS_MAX);
    }
    l->made->nmodel = raw->nmodel ? raw->nmodel : 1;
    for (size_t i = 0; i < l->made->nmodel && !code; i++) {
        code = described_build_model(l, raw->nmodel ? &raw->model[i] : NULL, &l->made->model[i]);
    }
    return code ? code : described_link_factors(l);
}

/* ---- the host ---- */

/* Builds the list of frames for each step of the host. Finds the states that the host commands. */
static enum error_code described_build_host(struct described_loader *l)
{
    const struct raw_described_host *raw = &l->raw->host;
    struct described_protocol *made = l->made;
    const struct {
        const struct yaml_name *name;
        size_t count;
        struct described_list *list;
    } steps[] = {{raw->discover, raw->ndiscover, &made->host.discover},
                 {raw->configure, raw->nconfigure, &made->host.configure},
                 {raw->on, raw->non, &made->host.on},
                 {raw->off, raw->noff, &made->host.off},
                 {raw->command, raw->ncommand, &made->host.command}};
    enum error_code code;

    for (size_t s = 0; s < ARRAY_COUNT(steps); s++) {
        for (size_t i = 0; i < steps[s].count; i++) {
            const struct yaml_name *name = &steps[s].name[i];
            int frame = described_frame_index(made, name->name, true, DESCRIBED_ANY);

            if (frame < 0 || i == DESCRIBED_LIST_MAX) {
                return yaml_error(
                    l->error, &name->mark,
                    "found \"%s\", expected the name of a frame from the host, at most %d of them",
                    name->name, DESCRIBED_LIST_MAX);
            }
            steps[s].list->frame[steps[s].list->count++] = (uint8_t)frame;
        }
    }
    /* Without set points, a host that switches axes on would wait forever for motion */
    for (size_t f = 0; f < made->nframe && raw->non > 0 && raw->ncommand == 0; f++) {
        if (made->frame[f].from_host && made->frame[f].commands) {
            return yaml_error(l->error, &raw->mark,
                              "found a host without command, expected the frames that carry "
                              "set-points, as \"%s\"",
                              made->frame[f].name);
        }
    }

    /* By default, the host commands the first state that drives and the first state with law off */
    made->host.off_state = made->host.on_state = made->off_state;
    for (int i = (int)made->nstate - 1; i >= 0; i--) {
        if (made->state[i].law != DESCRIBED_OFF && made->state[i].law != DESCRIBED_FAULT &&
            made->state[i].law != DESCRIBED_REFUSED) {
            made->host.on_state = i;
        }
    }
    code = described_find_name(l, &raw->mark, "on_state", raw->on_state, &made->host.on_state);
    code = code ? code
                : described_find_name(l, &raw->mark, "off_state", raw->off_state,
                                      &made->host.off_state);

    /* The law of the host's on_state after the host's switch-on frames have selected a law */
    enum described_law law = made->state[made->host.on_state].law;

    for (size_t i = 0; i < made->host.on.count && law == DESCRIBED_SELECTED; i++) {
        const struct described_frame *row = &made->frame[made->host.on.frame[i]];
        int field = described_find_field(row, DESCRIBED_LAW);
        int found = field < 0 ? -1
                              : described_find_state(made->law, made->nlaw,
                                                     llround(row->field[field].host), true);

        law = found < 0 ? law : made->law[found].law;
    }
    made->host.law = law;

    return code;
}

/* ---- all ---- */

/* Returns whether a host reads a field with this meaning. first: only torques and rates, which the
 * host must read before it computes angles. */
static bool described_is_read(enum described_meaning meaning, bool first)
{
    bool is_first = meaning == DESCRIBED_AXIS_TORQUE || meaning == DESCRIBED_DRIVE_TORQUE ||
                    meaning == DESCRIBED_MOTOR_VELOCITY;

    bool others = meaning == DESCRIBED_STATE || meaning == DESCRIBED_FAULTS ||
                  meaning == DESCRIBED_MOTOR_POSITION || meaning == DESCRIBED_LINK_POSITION ||
                  meaning == DESCRIBED_DEFLECTION || meaning == DESCRIBED_AXIS_CURRENT ||
                  meaning >= DESCRIBED_SATURATED;

    return first ? is_first : others;
}

/* Builds the lists that the real-time loop uses: frames by identifier, frames by kind of board, and
 * fields that a host reads. */
static void described_index(struct described_protocol *made)
{
    for (size_t i = 0; i < made->nframe; i++) {
        struct described_frame *frame = &made->frame[i];
        uint64_t bit = UINT64_C(1) << i;
        unsigned number;

        for (uint32_t id = 0; id <= DESCRIBED_STANDARD_ID_MAX; id++) {
            made->rows[id] |= described_number(frame, id, false, &number) ? bit : 0;
        }
        made->extended_rows |= frame->flags & FRAME_EXTENDED ? bit : 0;
        made->host_rows |= frame->from_host ? bit : 0;
        for (unsigned k = 0; k < 3 && !frame->from_host; k++) {
            struct described_schedule *telemetry = &made->telemetry[k], *other = &made->other[k];

            if (frame->of >> k & 1 && frame->telemetry) {
                telemetry->frame[telemetry->count++] = (uint8_t)i;
            }
            if (frame->of >> k & 1 &&
                (frame->on_change || frame->on_fault || frame->period_ns > 0)) {
                other->frame[other->count++] = (uint8_t)i;
            }
        }
        for (int pass = 0; pass < 2; pass++) {
            for (size_t k = 0; k < frame->nfield; k++) {
                if (described_is_read(frame->field[k].meaning, pass == 0)) {
                    frame->read[frame->nread++] = (uint8_t)k;
                }
            }
        }
    }
}

/* Builds the whole table. Each step uses the results of earlier steps. */
static enum error_code described_build(struct described_loader *l)
{
    const struct raw_described *raw = l->raw;
    enum error_code code;

    *l->made = (struct described_protocol){
        .name = raw->name,
        .description = raw->description,
        .axes = (unsigned)raw->axes,
        .address_max = (unsigned)raw->address_max,
        .command_timeout_ns =
            yaml_has(&raw->mark, "command_timeout_s") && raw->command_timeout_ns == 0
                ? -1
                : raw->command_timeout_ns,
        .gains = raw->gains,
    };
    if (strspn(raw->name, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") !=
        strlen(raw->name)) {
        return yaml_error(l->error, &raw->mark,
                          "found the name \"%.60s\", expected letters, digits, _ and -", raw->name);
    }
    code = described_build_states(l);
    for (int i = 0; i < DESCRIBED_FAULT_KINDS; i++) {
        l->made->fault_bit[i] = raw->fault[i].bit;
        l->made->sticky |= (uint32_t)raw->fault[i].sticky << i;
        l->made->momentary |= (uint32_t)raw->fault[i].momentary << i;
    }
    code = code ? code : described_build_frames(l);
    code = code ? code : described_build_parameters(l);
    code = code ? code : described_build_models(l);
    code = code ? code : described_check_faults(l);
    code = code ? code : described_check_gains(l, raw->state, raw->nstate);
    code = code ? code : described_check_gains(l, raw->law, raw->nlaw);
    code = code ? code : described_check_ids(l);
    code = code ? code : described_check_values(l, DESCRIBED_STATE, raw->state, raw->nstate);
    code = code ? code : described_check_values(l, DESCRIBED_LAW, raw->law, raw->nlaw);
    code = code ? code : described_build_host(l);
    if (!code) {
        described_index(l->made);
    }
    return code;
}

/* Builds a table in the arena from the contents of a file. */
static enum error_code described_compile(const struct raw_described *raw, bool fd,
                                         struct arena *arena,
                                         const struct described_protocol **protocol,
                                         struct error *error)
{
    struct described_loader l = {
        .raw = raw,
        .made = arena_alloc(arena, 1, sizeof *l.made),
        .arena = arena,
        .error = error,
        .fd = fd,
    };

    *protocol = l.made;
    return l.made ? described_build(&l) : described_no_memory(&l);
}

enum error_code described_load(const char *path, bool fd, struct arena *arena,
                               const struct described_protocol **protocol, struct error *error)
{
    struct raw_described raw;
    enum error_code code = yaml_read_file(path, &described_file_schema, arena, &raw, error);

    return code ? code : described_compile(&raw, fd, arena, protocol, error);
}

enum error_code described_read_text(const char *name, const char *text, size_t size, bool fd,
                                    struct arena *arena, const struct described_protocol **protocol,
                                    struct error *error)
{
    struct raw_described raw;
    enum error_code code =
        yaml_read_text(name, text, size, &described_file_schema, arena, &raw, error);

    return code ? code : described_compile(&raw, fd, arena, protocol, error);
}
