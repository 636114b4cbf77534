/* SPDX-License-Identifier: Apache-2.0 */
/* Rig and robot files with random damage: an error with its place or a rig, never a crash. */
#include "rt/rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <cmocka.h>

#include "tests/unit/rig_files.h"

enum { ROUNDS = 2000 };

static struct arena arena;

static int set_up(void **state)
{
    (void)state;
    return arena_init(&arena, (size_t)64 << 20, NULL) || make_tree() ? -1 : 0;
}

static int tear_down(void **state)
{
    (void)state;
    remove_tree();
    arena_fini(&arena);
    return 0;
}

static uint64_t random_state;

static uint32_t random_number(void)
{
    random_state = random_state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (uint32_t)(random_state >> 33);
}

/* Puts other numbers, words and marks where there were some: damage that a parser does not see. */
static size_t mutate(char *text, size_t size, size_t capacity)
{
    static const char *const pieces[] = {
        "0",      "-1", "1e300", "1e-300", "nan", "true", "spare", "hip", "knee", "world", "sole",
        "rubber", "[]", "{}",    "0x7ff",  "255", "~",    "ball",  ",",   ":",    "\n"};

    for (uint32_t edits = 1 + random_number() % 3; edits > 0; edits--) {
        size_t at = random_number() % size, n, old;
        const char *piece = pieces[random_number() % (sizeof pieces / sizeof pieces[0])];

        if (random_number() % 4 == 0) {
            text[at] = (char)random_number();
            continue;
        }
        /* a whole word gives way to the piece */
        while (at > 0 && !strchr(" ,:[]{}\n", text[at - 1])) {
            at--;
        }
        for (old = 0; at + old < size && !strchr(" ,:[]{}\n", text[at + old]); old++) {
        }
        n = strlen(piece);
        if (size - old + n <= capacity) {
            memmove(text + at + n, text + at + old, size - at - old);
            memcpy(text + at, piece, n);
            size = size - old + n;
        }
    }
    return size;
}

/* "TREE/config/...:LINE:COLUMN: ..." of one of the three files */
static bool has_place(const char *message)
{
    static const char *const files[] = {"rigs/toy.yaml", "robots/toy.yaml", "meshes/toy.obj"};
    char prefix[96];
    int line, column;

    for (size_t i = 0; i < 3; i++) {
        snprintf(prefix, sizeof prefix, "%s/config/%s:", tree, files[i]);
        if (!strncmp(message, prefix, strlen(prefix))) {
            return sscanf(message + strlen(prefix), "%d:%d: ", &line, &column) == 2 && line > 0 &&
                   column > 0;
        }
    }
    return false;
}

/* Damages the file of this name, which holds good text, again and again. */
static void damage(const char *name, const char *good, size_t good_size)
{
    char text[4096];
    int taken = 0;

    assert_int_equal(write_file("config/rigs/toy.yaml", toy_rig, sizeof toy_rig - 1), 0);
    random_state = 20141118;
    for (int i = 0; i < ROUNDS; i++) {
        const struct rig *rig = NULL;
        struct error error = {0};
        enum error_code code;
        size_t size;

        memcpy(text, good, good_size);
        size = mutate(text, good_size, sizeof text);
        assert_int_equal(write_file(name, text, size), 0);
        code = rig_load(rig_path, &arena, &rig, &error);
        taken += code == ERROR_NONE;
        /* a damaged reference may name a file that is not there */
        if (code != ERROR_NONE &&
            (code != ERROR_INPUT ||
             (!has_place(error.text) && !strstr(error.text, "No such file or directory") &&
              !strstr(error.text, "found a directory") && !strstr(error.text, "variant")))) {
            fail_msg("round %d of %s (%d): %s", i, name, (int)code, error.text);
        }
        memset(arena.memory, 0, arena.used);
        arena.used = 0;
    }
    assert_in_range(taken, 10, ROUNDS - 10);
}

static void a_damaged_rig_file_gives_a_rig_or_an_error_with_its_place(void **state)
{
    (void)state;
    damage("config/rigs/toy.yaml", toy_rig, sizeof toy_rig - 1);
}

static void damaged_bodies_give_a_rig_or_an_error_with_its_place(void **state)
{
    static const char bodies[] =
        "  bodies:\n"
        "    - {name: crate, mass_kg: 1.5, box_m: [0.1, 0.2, 0.3], com_m: [0, 0, 0.01],\n"
        "       xyz_m: [1, 0, 0.5], rpy_rad: [0, 0, 0.3], velocity_m_s: [0, 0.1, 0]}\n"
        "    - {name: stone, mass_kg: 3, inertia_kg_m2: [1, 0.1, 0.2, 1.5, 0.3, 2]}\n"
        "    - {name: table, static: true, xyz_m: [1, 0, 0], rpy_rad: [0, 0, 0.1]}\n"
        "  materials:\n";
    static const char surfaces[] =
        "  surfaces:\n"
        "    - {name: lid, body: crate, shape: box, half_extents_m: [0.1, 0.1, 0.1], material: "
        "rubber}\n"
        "    - {name: top, body: table, shape: box, half_extents_m: [0.2, 0.2, 0.1], material: "
        "rubber}\n";
    char text[sizeof toy_rig + 1024];

    (void)state;
    strcpy(text, toy_rig);
    assert_true(replace(text, sizeof text, "  materials:\n", bodies));
    assert_true(replace(text, sizeof text, "  surfaces:\n", surfaces));
    assert_true(replace(text, sizeof text, "  pairs:\n", "  pairs:\n    - between: [lid, top]\n"));
    damage("config/rigs/toy.yaml", text, strlen(text));
}

static void a_damaged_robot_file_gives_a_rig_or_an_error_with_its_place(void **state)
{
    (void)state;
    damage("config/robots/toy.yaml", toy_robot, sizeof toy_robot - 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_damaged_rig_file_gives_a_rig_or_an_error_with_its_place,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(damaged_bodies_give_a_rig_or_an_error_with_its_place,
                                        set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_damaged_robot_file_gives_a_rig_or_an_error_with_its_place,
                                        set_up, tear_down),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
