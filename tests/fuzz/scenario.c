/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Scenario files: refused with a place, or cases whose frames are legal, whose bands are in order
 * and whose labels and names mean something in the rig of COMAN that they are bound to.
 */
#include "app/scenario/scenario.h"

#include "tests/fuzz/fuzz.h"

#include <math.h>
#include <string.h>

#define FILE_NAME "config/scenarios/x.yaml"

/* The rig never changes. */
static const struct rig *the_rig(void)
{
    static const struct rig *rig;
    static struct arena arena;
    struct error error;

    if (!rig) {
        fuzz_require(arena_init(&arena, (size_t)256 << 20, NULL) == ERROR_NONE, "no memory");
        fuzz_require(rig_load(HIL_SOURCE_DIR "/config/rigs/coman.yaml", &arena, &rig, &error) ==
                         ERROR_NONE,
                     "%s", error.text);
    }
    return rig;
}

static void check_stimulus(const struct scenario *scenario, const struct scenario_stimulus *s)
{
    fuzz_require(s->after_index >= 0 && (size_t)s->after_index < scenario->nlabel &&
                     s->label_index < (int)scenario->nlabel,
                 "label %d after %d of %zu", s->label_index, s->after_index, scenario->nlabel);
    fuzz_require(s->action <= SCENARIO_MARK, "action %d", (int)s->action);
    fuzz_require(isfinite(s->at_s) && isfinite(s->for_s) && isfinite(s->every_s), "%g s", s->at_s);
    if (s->action == SCENARIO_FRAME) {
        fuzz_require(frame_valid(&s->frame.frame), "id 0x%x length %u", s->frame.frame.id,
                     s->frame.frame.len);
    }
}

static void check_expectation(const struct scenario *scenario, const struct scenario_expectation *e)
{
    struct bus_frame frame = {.id = (uint32_t)e->frame.id, .len = e->frame.len};

    fuzz_require(e->name && e->look <= SCENARIO_PERIOD, "look %d", (int)e->look);
    fuzz_require(e->after_index >= 0 && (size_t)e->after_index < scenario->nlabel, "after %d",
                 e->after_index);
    fuzz_require(e->band[0] <= e->band[1], "%s: from %g to %g", e->name, e->band[0], e->band[1]);
    if (e->frame.bus) {
        /* the pattern itself, its free digits zero, is a frame that matches it */
        fuzz_require(e->frame.len <= 64, "%u bytes", e->frame.len);
        memcpy(frame.data, e->frame.byte, sizeof frame.data);
        frame.flags = e->frame.extended ? FRAME_EXTENDED : 0;
        fuzz_require(scenario_pattern_matches(&e->frame, &frame), "%s", e->name);
    }
}

static void check_case(struct scenario *scenario, const struct rig *rig)
{
    struct error error = {0};

    fuzz_require(scenario->nlabel >= SCENARIO_LABELS &&
                     scenario->nlabel <= SCENARIO_STIMULI_MAX + SCENARIO_LABELS,
                 "%zu labels", scenario->nlabel);
    fuzz_require(scenario->duration_s > 0.0 && isfinite(scenario->duration_s), "%g s",
                 scenario->duration_s);
    fuzz_require(scenario->nstimulus <= SCENARIO_STIMULI_MAX &&
                     scenario->nexpectation <= SCENARIO_EXPECTATIONS_MAX &&
                     scenario->nmutation <= SCENARIO_MUTATIONS_MAX,
                 "too much");
    fuzz_require(memchr(scenario->values, '\0', sizeof scenario->values), "no end");
    for (size_t i = 0; i < scenario->nstimulus; i++) {
        check_stimulus(scenario, &scenario->stimulus[i]);
    }
    for (size_t i = 0; i < scenario->nexpectation; i++) {
        check_expectation(scenario, &scenario->expectation[i]);
    }
    if (scenario_bind(scenario, rig, &error)) {
        fuzz_require(fuzz_has_place(error.text, FILE_NAME, 1 << 20), "%s", error.text);
        return;
    }
    for (size_t i = 0; i < scenario->nstimulus; i++) {
        const struct scenario_stimulus *s = &scenario->stimulus[i];

        fuzz_require(s->action != SCENARIO_FRAME || (size_t)s->frame.bus_index < rig->nbus, "bus");
        fuzz_require(s->action != SCENARIO_VOLTAGE || (size_t)s->voltage.axis < rig->naxis, "axis");
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const struct rig *rig = the_rig();
    struct arena *arena = fuzz_arena((size_t)256 << 20);
    struct scenario *cases;
    struct error error = {0};
    size_t count;

    if (scenario_read_text(FILE_NAME, (const char *)data, size, arena, &cases, &count, &error)) {
        fuzz_require(error.code == ERROR_INPUT && fuzz_has_place(error.text, FILE_NAME, size),
                     "%d: %s", (int)error.code, error.text);
        fuzz_tally.refused++;
        return 0;
    }
    fuzz_require(count >= 1 && count <= SCENARIO_CASES_MAX, "%zu cases", count);
    for (size_t i = 0; i < count; i++) {
        check_case(&cases[i], rig);
    }
    fuzz_tally.taken++;
    return 0;
}
