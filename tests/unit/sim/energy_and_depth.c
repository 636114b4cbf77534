/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Runs that no robot can do: one that starts inside the ground is refused, one whose integrator or
 * contacts make energy is called that. COMAN's shipped rig, changed in one place a row.
 */
#include "base/array.h"
#include "model/plant.h"
#include "tests/rig_run.h"

static struct arena arena;
static struct rig rig;

/* Creates a simulator of the changed rig, which must be refused with these words. */
static void assert_refused(bool settle, const char *const word[5])
{
    const struct simulator_config config = {.rig = &rig,
                                            .clock = LOOP_CLOCK_FREE,
                                            .hold = rig.hold,
                                            .settle = settle,
                                            .transport = TRANSPORT_LOCAL,
                                            .ticks = 1};
    struct simulator *simulator;
    struct error error;
    char notice[256];

    if (simulator_create(&config, &arena, &simulator, notice, &error) != ERROR_INPUT) {
        fail_msg("%s", error.text);
    }
    for (int i = 0; i < 5 && word[i]; i++) {
        if (!strstr(error.text, word[i])) {
            fail_msg("no \"%s\" in %s", word[i], error.text);
        }
    }
    arena_fini(&arena);
}

TEST(a_robot_that_starts_inside_the_ground_is_refused)
{
    static const struct {
        const char *rig;
        double z;
        enum rig_contact_engine engine;
        bool settle;
        const char *word[5];
    } row[] = {
        {"coman",
         -10.0,
         RIG_CONTACT_NATIVE,
         false,
         {"right_foot", "RFoot", "10.48 m deep in ground"}},
        {"coman", 0.278, RIG_CONTACT_NATIVE, false, {"right_foot", "0.1995 m deep", "0.021 m"}},
        {"coman", 0.278, RIG_CONTACT_NATIVE, true, {"right_foot", "0.1995 m deep", "base_xyz_m"}},
        {"grasp", -10.0, RIG_CONTACT_SIMBODY, false, {"right_foot", "RFoot", "m deep in ground"}},
    };

    for (size_t i = 0; i < ARRAY_COUNT(row); i++) {
        rig_run_load(row[i].rig, &arena, &rig);
        rig.base_position[2] = row[i].z;
        rig.contact_engine = row[i].engine;
        if (row[i].engine == RIG_CONTACT_SIMBODY) {
            rig.integrator = PLANT_RK4;
            rig.contact.friction = CONTACT_FRICTION_REGULARIZED;
        }
        assert_refused(row[i].settle, row[i].word);
    }
}

/* The box of the grasp, moved into the table. */
TEST(a_free_body_that_starts_inside_a_table_is_refused)
{
    static struct plant_free_body box;

    rig_run_load("grasp", &arena, &rig);
    assert_true(rig.nfree > 0);
    box = rig.free[0];
    box.position[2] -= 0.06;
    rig.free = &box;
    rig.nfree = 1;
    assert_refused(false, (const char *const[5]){box.name, "m deep in", "expected at most"});
}

/* Runs a task, at most for these ticks. Returns the first event with a word, or "". */
static const char *run_for_event(const char *task, uint64_t ticks, const char *word,
                                 bool *found_energy)
{
    static char found[256];
    const struct simulator_config config = {.rig = &rig,
                                            .clock = LOOP_CLOCK_FREE,
                                            .hold = rig.hold,
                                            .transport = TRANSPORT_LOCAL,
                                            .task = task,
                                            .ticks = ticks};
    struct simulator *simulator = rig_run_open(&config, &arena, NULL);
    char text[256];
    uint64_t key;

    found[0] = '\0';
    simulator_run(simulator);
    while (simulator_next_event(simulator, &key, text, sizeof text)) {
        if (!found[0] && strstr(text, word)) {
            snprintf(found, sizeof found, "%s", text);
            assert_int_equal(simulator_event_priority(key), JOURNAL_WARNING);
        }
    }
    *found_energy = simulator_found_energy(simulator);
    rig_run_close(simulator, &arena, NULL);
    return found;
}

TEST(energy_from_nowhere_is_an_event)
{
    static const struct {
        const char *rig, *task;
        enum plant_integrator integrator;
        int64_t substep_ns;
        double young_pa; /* of all surfaces; 0: the rig's */
        uint64_t ticks;
        const char *word; /* "": no energy appears */
    } row[] = {
        {"coman", "squat", PLANT_IMPLICIT, 1000000, 0.0, 1500, ""},
        {"coman", "squat", PLANT_IMPLICIT, 250000, 0.0, 500, ""},
        {"coman", "squat", PLANT_RK4, 1000000, 0.0, 80, "the integrator diverges"},
        {"coman", "squat", PLANT_RK4, 500000, 0.0, 300, "integrator: implicit"},
        {"coman", "squat", PLANT_IMPLICIT, 1000000, 8e11, 600, "materials are too stiff"},
        {"hyq", "hold", PLANT_IMPLICIT, 1000000, 0.0, 1500, ""},
        {"hyq-leg", "hold", PLANT_IMPLICIT, 1000000, 0.0, 1500, ""},
        {"hyq", "hold", PLANT_RK4, 1000000, 0.0, 300, "the integrator diverges"},
    };

    for (size_t i = 0; i < ARRAY_COUNT(row); i++) {
        static struct contact_surface surface[256];
        const char *event;
        bool found;

        rig_run_load(row[i].rig, &arena, &rig);
        assert_true(rig.contact.nsurface <= ARRAY_COUNT(surface));
        for (size_t s = 0; s < rig.contact.nsurface; s++) {
            surface[s] = rig.contact.surface[s];
            if (row[i].young_pa > 0.0) {
                surface[s].material.young_pa = row[i].young_pa;
            }
        }
        rig.contact.surface = surface;
        rig.integrator = row[i].integrator;
        rig.substep_ns = row[i].substep_ns;
        rig.substeps = (size_t)(rig.tick_ns / rig.substep_ns);
        event = run_for_event(row[i].task, row[i].ticks, "energy from nowhere", &found);
        assert_int_equal(found, row[i].word[0] != '\0');
        if (!strstr(event, row[i].word) || (event[0] && !row[i].word[0])) {
            fail_msg("row %zu: %s", i, event);
        }
    }
}

/* On layers of 1 Pa a robot sinks through: the first surface below 2 cm is named. */
TEST(a_body_that_sinks_through_its_layers_is_an_event)
{
    static struct contact_surface surface[256];
    const char *event;
    bool found;

    rig_run_load("coman", &arena, &rig);
    memcpy(surface, rig.contact.surface, rig.contact.nsurface * sizeof *surface);
    for (size_t s = 0; s < rig.contact.nsurface; s++) {
        surface[s].material.young_pa = 1.0;
        surface[s].material.backing_pa_per_m = 0.0;
    }
    rig.contact.surface = surface;
    event = run_for_event("squat", 200, "deep in ground", &found);
    if (!strstr(event, "right_foot is 0.02") || !strstr(event, "(0.021 m)")) {
        fail_msg("found \"%s\"", event);
    }
    assert_false(found);
}
