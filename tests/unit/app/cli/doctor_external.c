/* SPDX-License-Identifier: Apache-2.0 */
/* What the doctor says of external boards that the test plays, by a clock that the test moves. */
#include "app/cli/doctor/doctor.h"

#include "boards/foc/protocol.h"
#include "tests/test.h"

enum { BOARDS = 3 };

/* Boards 1 to 3 of the hip, each sending every millisecond until its time is over. */
struct lab {
    struct clock clock;
    int64_t now_ns, until_ns[BOARDS];
    struct arena arena;
    const struct rig *rig;
    struct local_bus *bus;
    struct can_port *real, *port[RIG_BUSES_MAX];
    struct doctor_finding finding[DOCTOR_FINDINGS_MAX];
    size_t count;
};

static int64_t lab_now(struct clock *clock)
{
    return ((struct lab *)clock)->now_ns;
}

static void lab_sleep_until(struct clock *clock, int64_t deadline_ns)
{
    struct lab *lab = (struct lab *)clock;

    lab->now_ns = deadline_ns;
    for (int i = 0; i < BOARDS; i++) {
        const struct bus_frame frame = {.id = 0x100u | (uint32_t)(i + 1) << 4 | FOC_FEEDBACK,
                                        .len = FOC_FEEDBACK_LENGTH};

        if (lab->now_ns < lab->until_ns[i]) {
            assert_int_equal(can_send(lab->real, &frame, 1), 1);
        }
    }
}

static const struct clock_ops lab_clock = {.now = lab_now, .sleep_until = lab_sleep_until};

static inline void open_lab(struct lab *lab)
{
    const struct local_bus_config bus = {.name = "can0", .max_nodes = 2, .inbox = 256};
    struct error error;

    *lab = (struct lab){.clock = {&lab_clock}, .now_ns = 5 * CLOCK_SECOND};
    if (arena_init(&lab->arena, (size_t)64 << 20, &error) ||
        rig_load(HIL_SOURCE_DIR "/config/rigs/coman-rest-bus.yaml", &lab->arena, &lab->rig,
                 &error) ||
        local_bus_create(&bus, &lab->arena, &lab->bus, &error) ||
        local_bus_join(lab->bus, 1, NULL, 0, &lab->port[0], &error) ||
        local_bus_join(lab->bus, 1, NULL, 0, &lab->real, &error)) {
        fail();
    }
}

static inline void close_lab(struct lab *lab)
{
    local_bus_destroy(lab->bus);
    arena_fini(&lab->arena);
}

/* Findings on external boards, in the order of the rig; how many. */
static size_t examine(struct lab *lab, double listen_s, const struct doctor_finding **of)
{
    const struct doctor_config config = {.root = "/nonexistent",
                                         .rig = lab->rig,
                                         .local = true,
                                         .port = lab->port,
                                         .listen_ns = (int64_t)(listen_s * 1e9),
                                         .clock = &lab->clock,
                                         .arena = &lab->arena};
    size_t count = 0;

    lab->count = doctor_examine(&config, lab->finding, DOCTOR_FINDINGS_MAX);
    for (size_t i = 0; i < lab->count; i++) {
        if (!strcmp(lab->finding[i].subject, "external")) {
            of[count++] = &lab->finding[i];
        }
    }
    return count;
}

BENCH(open_lab, struct lab, close_lab)

TEST_ON(says_which_board_is_silent_and_when_it_was_heard, open_lab, lab)
{
    const struct doctor_finding *found[DOCTOR_FINDINGS_MAX];
    struct bus_frame frame;

    lab->until_ns[0] = INT64_MAX;
    lab->until_ns[1] = lab->now_ns + CLOCK_SECOND / 4;
    assert_int_equal(examine(lab, 1.0, found), BOARDS);
    assert_int_equal(found[0]->verdict, DOCTOR_OK);
    assert_string_equal(found[0]->found, "board hip_sag on can0 is heard, 0 ms ago");
    assert_int_equal(found[1]->verdict, DOCTOR_WARN);
    assert_string_equal(found[1]->found, "board hip_lat on can0 is silent: last heard 751 ms ago, "
                                         "its time-out is 20 ms");
    assert_int_equal(found[2]->verdict, DOCTOR_WARN);
    assert_string_equal(found[2]->found, "board hip_yaw on can0 is silent: not heard in 1 s");
    assert_true(strlen(found[2]->fix) > 0);

    /* It only listens */
    assert_int_equal(can_receive(lab->real, &frame, 1), 0);
}

TEST_ON(says_nothing_where_it_does_not_listen, open_lab, lab)
{
    const struct doctor_finding *found[DOCTOR_FINDINGS_MAX];
    int64_t start;

    assert_int_equal(examine(lab, 0.0, found), 0);
    lab->port[0] = NULL;
    assert_int_equal(examine(lab, 0.1, found), 0);

    /* Nor does it wait where the rig has none */
    assert_ok(rig_load(HIL_SOURCE_DIR "/config/rigs/coman-foc-leg.yaml", &lab->arena, &lab->rig,
                       &(struct error){0}));
    start = lab->now_ns;
    assert_int_equal(examine(lab, 1.0, found), 0);
    assert_true(lab->now_ns == start);
}
