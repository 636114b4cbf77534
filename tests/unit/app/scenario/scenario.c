/* SPDX-License-Identifier: Apache-2.0 */
/* Reading scenarios: parameters, labels, patterns, and what is refused with which words. */
#include "base/random.h"
#include "app/scenario/jobs.h"

#include "tests/unit/arena_fixture.h"

#define FILE_NAME "config/scenarios/x.yaml"

static const char head[] = "name: x\n"
                           "description: what it is about\n"
                           "rig: ../rigs/coman.yaml\n"
                           "host: enabled\n"
                           "duration_s: 1.0\n";
static const char expectations[] = "expectations:\n"
                                   "  - {name: stands, signal: LElbj.q, between: [-1, 1]}\n";

static struct scenario *cases;
static size_t count;
static struct error error;

static enum error_code read_text(const char *text)
{
    error.text[0] = '\0';
    return scenario_read_text(FILE_NAME, text, strlen(text), &arena, &cases, &count, &error);
}

/* head, then more, then the expectations */
static enum error_code read_with(const char *more)
{
    char text[4096];

    snprintf(text, sizeof text, "%s%s%s", head, more, expectations);
    return read_text(text);
}

/* ---- what is read ---- */

TEST_WITH(reads_a_whole_scenario, open_arena, close_arena)
{
    const struct scenario_expectation *expectation;

    assert_ok(read_text(
        "name: whole\ndescription: all of it\nrig: ../rigs/coman.yaml\nclock: free\n"
        "hold: always\nwire: wire\nsettle: true\nseed: 7\nduration_s: 2\nclean_up_s: 0.5\n"
        "wall_limit_s: 3\nhost: enabled\nfaults: [\"supply sag 1\"]\n"
        "stimuli:\n"
        "  - {label: a, at_s: 0.1, frame: {bus: torso, id: 0x001, data: \"49 0D.00 0000\"}}\n"
        "  - {after: a, push: {body: Waist, force_n: [1, 2, 3]}, for_s: 0.2}\n"
        "clean_up:\n"
        "  - {motor: {joint: all, on: false}}\n"
        "expectations:\n"
        "  - {name: one, after: a, from_s: 0.1, within_s: 0.2, frame: {bus: torso, id: 0x110,\n"
        "     id_mask: 0x7f0, data: \"x1 2x\"}, count: [2, 4]}\n"
        "  - {name: two, event: text, never: true}\n"
        "mutations:\n"
        "  - {name: m, without: a, fails: [one]}\n"));
    assert_int_equal(count, 1);
    assert_string_equal(cases->name, "whole");
    assert_string_equal(cases->rig_path, "config/rigs/coman.yaml");
    assert_int_equal(cases->nstimulus, 3);
    assert_int_equal(cases->stimulus[0].frame.frame.len, 5);
    assert_int_equal(cases->stimulus[0].frame.frame.data[1], 0x0d);
    assert_int_equal(cases->stimulus[1].after_index, cases->stimulus[0].label_index);
    assert_int_equal(cases->stimulus[2].after_index, SCENARIO_LABEL_CLEAN_UP);
    expectation = &cases->expectation[0];
    assert_int_equal(expectation->look, SCENARIO_SEEN);
    assert_true(expectation->to_s > 0.299 && expectation->to_s < 0.301);
    assert_int_equal(expectation->frame.len, 2);
    assert_int_equal(cases->expectation[1].band[1], 0);
}

TEST_WITH(a_pattern_matches_by_bits, open_arena, close_arena)
{
    static const struct {
        uint32_t id;
        uint8_t flags, len, data[3];
        bool matches;
    } frames[] = {
        {0x110, 0, 2, {0x01, 0x20}, true},
        {0x11f, 0, 3, {0xf1, 0x2f, 0xff}, true},
        {0x110, 0, 1, {0x01}, false},
        {0x110, 0, 2, {0x02, 0x20}, false},
        {0x110, 0, 2, {0x01, 0x30}, false},
        {0x120, 0, 2, {0x01, 0x20}, false},
        {0x110, FRAME_EXTENDED, 2, {0x01, 0x20}, false},
        {0x110, FRAME_ERROR, 2, {0x01, 0x20}, false},
    };

    assert_ok(
        read_text("name: x\ndescription: d\nrig: r.yaml\nduration_s: 1\nexpectations:\n"
                  "  - {name: f, frame: {bus: b, id: 0x110, id_mask: 0x7f0, data: x1 2x}}\n"));
    for (size_t i = 0; i < sizeof frames / sizeof frames[0]; i++) {
        struct bus_frame frame = {
            .id = frames[i].id, .flags = frames[i].flags, .len = frames[i].len};

        memcpy(frame.data, frames[i].data, sizeof frames[i].data);
        assert_int_equal(scenario_pattern_matches(&cases->expectation[0].frame, &frame),
                         frames[i].matches);
    }
}

TEST_WITH(words_are_parameters_too, open_arena, close_arena)
{
    assert_ok(read_with("parameters:\n  task: {words: [squat, walk]}\n"
                        "faults: [\"bus ${task} loss 1\"]\n"));
    assert_int_equal(count, 2);
    assert_string_equal(cases[1].values, "task=walk");
    assert_string_equal(cases[1].fault[0].name, "bus walk loss 1");
    assert_true(cases[0].text_hash != cases[1].text_hash);
    assert_int_equal(read_with("parameters:\n  a: {words: [x], values: [1]}\n"), ERROR_INPUT);
    assert_int_equal(read_with("parameters:\n  a: {words: [\"x y\"]}\n"), ERROR_INPUT);
}

/* The rig is read as a file that extends it, whose lines are those of the scenario. */
TEST_WITH(changes_are_a_file_that_extends_the_rig, open_arena, close_arena)
{
    assert_ok(read_with("parameters:\n  v: {values: [40]}\n"
                        "changes:\n  # less\n  supply_v: ${v}\n"));
    assert_memory_equal(cases[0].changes,
                        "\n\n\n\n\n\n\n  extends: \"../rigs/coman.yaml\"\n\n  supply_v: 40\n",
                        cases[0].changes_size);
    assert_ok(read_with(""));
    assert_null(cases[0].changes);
    assert_int_equal(read_with("changes: {supply_v: 40}\n"), ERROR_INPUT);
    assert_non_null(strstr(error.text, ":6:1: found changes on the line of their key"));
    assert_int_equal(read_with("changes:\n"), ERROR_INPUT);
    assert_non_null(strstr(error.text, ":6:1: found no changes"));
}

TEST_WITH(parameters_make_every_combination, open_arena, close_arena)
{
    static const char *const values[] = {"volts=1.5, seed=1", "volts=1.5, seed=2",
                                         "volts=-2, seed=1", "volts=-2, seed=2"};

    assert_ok(read_with("parameters:\n  volts: {values: [1.5, -2]}\n\n  # seeds\n"
                        "  seed: {values: [1, 2]}\nseed: ${seed}\nstimuli:\n"
                        "  - {voltage: {joint: LElbj, volts: ${volts}}}\n"));
    assert_int_equal(count, 4);
    for (size_t i = 0; i < 4; i++) {
        assert_string_equal(cases[i].values, values[i]);
        assert_int_equal(cases[i].seed, 1 + i % 2);
        assert_true(cases[i].stimulus[0].voltage.volts == (i < 2 ? 1.5 : -2.0));
    }
}

/* An editor that knows YAML wants quotes around what begins with a brace. */
TEST_WITH(parameters_may_stand_in_quotes, open_arena, close_arena)
{
    static const char *const quotes[] = {"", "\"", "'"};
    char text[600];

    for (size_t i = 0; i < sizeof quotes / sizeof *quotes; i++) {
        const char *q = quotes[i];

        snprintf(text, sizeof text,
                 "parameters:\n  volts: {values: [1.5, -2]}\n  seed: {values: [7]}\n"
                 "  side: {words: [torso]}\nseed: %s${seed}%s\nstimuli:\n"
                 "  - {at_s: %s${seed}%s, voltage: {joint: LElbj, volts: %s${volts}%s}}\n"
                 "  - {push: {body: LFoot, force_n: [0, %s${volts}%s, 0]}, for_s: 0.1}\n"
                 "faults: [\"bus ${side} loss 1\"]\n",
                 q, q, q, q, q, q, q, q);
        assert_no_error(read_with(text), error.text);
        assert_int_equal(cases[1].seed, 7);
        assert_true(cases[0].stimulus[0].voltage.volts == 1.5);
        assert_true(cases[1].stimulus[0].voltage.volts == -2.0);
        assert_true(cases[1].stimulus[1].push.force_n[1] == -2.0);
        assert_string_equal(cases[1].fault[0].name, "bus torso loss 1");
    }
    /* Other texts are no numbers, in quotes or not */
    assert_int_equal(read_with("parameters:\n  w: {words: [x]}\nseed: \"${w}\"\n"), ERROR_INPUT);
    assert_non_null(strstr(error.text, "expected an integer"));
}

/* ---- what is refused ---- */

TEST_WITH(refuses_with_place_and_reason, open_arena, close_arena)
{
    static const struct {
        const char *more, *says;
    } wrong[] = {
        {"color: red\n", FILE_NAME ":6:1: "},
        {"stimuli: [{at_s: 1}]\n", FILE_NAME ":6:11: found 0 actions"},
        {"stimuli: [{silence: true, fault: supply sag 1}]\n", "found 2 actions"},
        {"stimuli: [{label: ready}]\n", "runner's own"},
        {"stimuli: [{after: raedy, label: a}]\n", "unknown label \"raedy\", expected \"ready\""},
        {"stimuli: [{motor: {joint: all, on: true}, for_s: 1}]\n", "takes no time"},
        {"stimuli: [{push: {body: b}, every_s: 1}]\n", "with a frame or a voltage only"},
        {"stimuli: [{frame: {bus: b, id: 1}, every_s: 1}]\n", "expected every_s and for_s"},
        {"stimuli: [{frame: {bus: b, id: 0x800}}]\n", "classic CAN can carry"},
        {"stimuli: [{frame: {bus: b, id: 1, data: 0 1}}]\n", "two hexadecimal digits"},
        {"stimuli: [{frame: {bus: b, id: 1, data: \"001\"}}]\n", "odd number of digits"},
        {"stimuli: [{frame: {bus: b, id: 1, data: x0}}]\n", "two hexadecimal digits"},
        {"stimuli: [{frame: {bus: b, id: 1, data: 00 00 00 00 00 00 00 00 00}}]\n", "9 bytes"},
        {"clock: lockstep\nstimuli: [{silence: true}]\n", "without STEP no tick runs"},
        {"clean_up: [{after: start, label: a}]\n", "found after: in clean_up"},
        {"task: squat\n", "found both a task and a host"},
        {"mutations: [{name: m}]\n", "neither of fault and without"},
        {"mutations: [{name: m, without: nothing}]\n",
         "unknown label of a stimulus \"nothing\", expected none"},
        {"stimuli: [{label: drive}]\nmutations: [{name: m, without: drve}]\n",
         "unknown label of a stimulus \"drve\", expected \"drive\""},
        {"mutations: [{name: m, fault: f, fails: [stand]}]\n",
         "unknown expectation \"stand\", expected \"stands\""},
        {"seed: ${sed}\nparameters:\n  seed: {values: [1]}\n",
         ":6:7: found unknown parameter \"sed\", expected \"seed\""},
        {"seed: ${\n", ":6:7: found unknown parameter"},
        {"parameters:\n  a: {values: []}\n", "with 0 values"},
        {"parameters:\n  a: {value: [1]}\n", ":7:7: "},
        {"parameters:\n  a b: {values: [1]}\n", "expected a plain name"},
    };

    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        print_message("# %s", wrong[i].more);
        assert_int_equal(read_with(wrong[i].more), ERROR_INPUT);
        print_message("# %s\n", error.text);
        assert_non_null(strstr(error.text, wrong[i].says));
    }
}

TEST_WITH(refuses_expectations_of_no_form, open_arena, close_arena)
{
    static const char *const wrong[] = {
        "{name: a}",
        "{name: a, signal: x.q}",
        "{name: a, signal: x.q, between: [0, 1], reaches: [0, 1]}",
        "{name: a, signal: x.q, never: true}",
        "{name: a, event: e, between: [0, 1]}",
        "{name: a, event: e, period_s: [0, 1]}",
        "{name: a, event: e, relative: true}",
        "{name: a, event: e, never: true, count: [0, 1]}",
        "{name: a, event: e, signal: x.q, between: [0, 1]}",
        "{name: a, signal: x.q, between: [1, 0]}",
        "{name: a, event: e, to_s: 1, within_s: 1}",
        "{name: a, event: e, from_s: 2, to_s: 1}",
        "{name: a, event: e}\n  - {name: a, event: e}",
    };
    char text[1024];

    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        snprintf(text, sizeof text, "%sexpectations:\n  - %s\n", head, wrong[i]);
        assert_int_equal(read_text(text), ERROR_INPUT);
        assert_non_null(strstr(error.text, FILE_NAME ":"));
    }
}

TEST_WITH(bounds_the_number_of_combinations, open_arena, close_arena)
{
    char text[8192] = "parameters:\n";

    for (int p = 0; p < 3; p++) {
        size_t used = strlen(text);

        used += (size_t)snprintf(text + used, sizeof text - used, "  p%d: {values: [0", p);
        for (int i = 1; i < 20; i++) {
            used += (size_t)snprintf(text + used, sizeof text - used, ", %d", i);
        }
        snprintf(text + used, sizeof text - used, "]}\n");
    }
    assert_int_equal(read_text(text), ERROR_INPUT);
    assert_non_null(strstr(error.text, ":4:"));
}

/* A good file with bytes changed, lost and doubled is read or refused with words. */
TEST_WITH(survives_damaged_files, open_arena, close_arena)
{
    static const char good[] =
        "name: x\ndescription: d\nrig: ../rigs/coman.yaml\nhost: enabled\nduration_s: 1.0\n"
        "parameters:\n  v: {values: [1, 2]}\n"
        "stimuli:\n  - {label: a, after: ready, voltage: {joint: LElbj, volts: ${v}}, for_s: 0.1}\n"
        "  - {after: a, frame: {bus: torso, id: 0x01, data: \"49 0d\"}}\n"
        "expectations:\n  - {name: e, after: a, frame: {bus: b, id: 1, data: \"x0\"}, never: "
        "true}\n"
        "mutations:\n  - {name: m, without: a, fails: [e]}\n";
    struct random_stream random = random_named(20260101, "damage");
    size_t refused = 0;

    for (int round = 0; round < 1500; round++) {
        char text[2 * sizeof good];
        size_t size = sizeof good - 1;

        memcpy(text, good, sizeof good);
        for (int damage = 0; damage < 1 + round % 3; damage++) {
            size_t at = (size_t)(random_bits(&random) % size);

            switch (random_bits(&random) % 3) {
            case 0:
                text[at] = (char)random_bits(&random);
                break;
            case 1:
                memmove(text + at, text + at + 1, --size - at);
                break;
            default:
                memmove(text + at + 1, text + at, size++ - at);
                break;
            }
        }
        arena_fini(&arena);
        assert_ok(arena_init(&arena, (size_t)64 << 20, &error));
        error.text[0] = '\0';
        if (scenario_read_text(FILE_NAME, text, size, &arena, &cases, &count, &error)) {
            refused++;
            assert_true(error.text[0] != '\0');
        } else {
            assert_true(count >= 1);
        }
    }
    assert_true(refused > 500);
}

/* ---- verdicts ---- */

TEST_WITH(a_mutation_has_to_make_its_expectations_fail, open_arena, close_arena)
{
    static struct scenario_job jobs[2];
    static struct scenario_result result;
    const char *missed;

    assert_ok(read_text("name: x\ndescription: d\nrig: r.yaml\nduration_s: 1\nexpectations:\n"
                        "  - {name: one, event: a}\n  - {name: two, event: b}\n"
                        "mutations: [{name: m, fault: f, fails: [one]}, {name: n, fault: f}]\n"));
    for (int i = 0; i < 2; i++) {
        jobs[i] = (struct scenario_job){.scenario = cases, .mutation = i - 1};
        jobs[i].outcome = (struct scenario_outcome){.ran = true, .nverdict = 2};
        for (int e = 0; e < 2; e++) {
            jobs[i].outcome.verdict[e] = (struct scenario_verdict){.met = true, .judged = true};
        }
    }
    assert_false(scenario_flipped(cases, 0, &jobs[1].outcome, &missed));
    assert_string_equal(missed, "one");
    assert_false(scenario_flipped(cases, 1, &jobs[1].outcome, &missed));
    assert_string_equal(missed, "");
    jobs[1].outcome.verdict[0].met = false;
    assert_true(scenario_flipped(cases, 0, &jobs[1].outcome, &missed));
    assert_true(scenario_flipped(cases, 1, &jobs[1].outcome, &missed));

    scenario_judge(&jobs[0], &result);
    assert_int_equal(result.status, SCENARIO_PASSED);
    scenario_judge(&jobs[1], &result);
    assert_int_equal(result.status, SCENARIO_PASSED);
    scenario_judge_mutations(jobs, 2, &result);
    assert_int_equal(result.status, SCENARIO_FAILED);
    assert_string_equal(result.message, "two: no mutation of the scenario makes it fail");

    /* What could not be recorded is judged all the same */
    jobs[0].outcome.verdict[1] = (struct scenario_verdict){.judged = true, .text = "seen 2 times"};
    strcpy(jobs[0].outcome.unrecorded, "cannot make the directory d");
    scenario_judge(&jobs[0], &result);
    assert_int_equal(result.status, SCENARIO_FAILED);
    assert_string_equal(result.message,
                        "two: seen 2 times\nnot recorded: cannot make the directory d");
    assert_string_equal(result.record, "");

    jobs[1].outcome.ran = false;
    scenario_judge(&jobs[1], &result);
    assert_int_equal(result.status, SCENARIO_BROKEN);
}
