/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The OBJ reader against random damage: seeded mutations of good files (bytes, words, lines cut,
 * doubled, swapped, replaced). Whatever comes out is either an error in words with its place, or a
 * mesh that mesh_check calls sound. Run it under the sanitizers to make it count.
 */
#include "contact/mesh.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define ROUNDS 100000
#define ROOM 4096

static const char tetrahedron[] = "# t\no t\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvn 0 0 1\n"
                                  "f 1 3 2\nf 1/1 2/1 4/1\nf 1//1 4//1 3//1\nf -3/1/1 3 4\n";
static const char prism[] = "v 2 0 0\nv 1 2 0\nv -1 2 0\nv -2 0 0\nv -1 -2 0\nv 1 -2 0 1\r\n"
                            "v 2 0 1\nv 1 2 1\nv -1 2 1\nv -2 0 1\nv -1 -2 1\nv 1 -2 \\\n1\n"
                            "f 6 5 4 3 2 1\nf 7 8 9 10 11 12\nf 1 2 8 7\nf 2 3 9 8\nf 3 4 10 9\n"
                            "f 4 5 11 10\nf 5 6 12 11\nf 6 1 7 12\n";

static uint64_t seed = 1;

/* xorshift64*: the same sequence on every machine */
static size_t random_below(size_t n)
{
    seed ^= seed >> 12;
    seed ^= seed << 25;
    seed ^= seed >> 27;
    return (size_t)((seed * 2685821657736338717u) >> 33) % n;
}

static void replace(char *text, size_t *size, size_t at, size_t cut, const char *with,
                    size_t length)
{
    if (at + cut > *size) {
        cut = *size - at;
    }
    if (*size - cut + length > ROOM) {
        return;
    }
    memmove(text + at + length, text + at + cut, *size - at - cut);
    memcpy(text + at, with, length);
    *size = *size - cut + length;
}

static void mutate(char *text, size_t *size)
{
    static const char *const word[] = {
        "nan",         "-inf",       "1e308", "-0",        "0x10",    "99999999999",
        "-2147483649", "4294967297", "/",     "//",        "1/2/3/4", "\\\n",
        "\r",          "\\",         "#",     "v",         "f",       "f 1 2 3 4 5 6\n",
        "\n",          " ",          "\t",    "v 1 2 3\n", "1e-320",  "-1",
        "0",           ".",          "+",     "1e",        "vn",      "\xff\xfe",
        "f 1 1 1\n",
    };
    size_t at = random_below(*size + 1);
    char byte = (char)random_below(256);
    const char *w = word[random_below(sizeof word / sizeof *word)];
    char copy[64];
    size_t length = random_below(sizeof copy);

    switch (random_below(5)) {
    case 0:
        replace(text, size, at, 1, &byte, 1);
        break;
    case 1:
        replace(text, size, at, random_below(4), w, strlen(w));
        break;
    case 2:
        replace(text, size, at, random_below(24), "", 0);
        break;
    case 3: /* a piece again, somewhere else */
        length = at + length > *size ? *size - at : length;
        memcpy(copy, text + at, length);
        replace(text, size, random_below(*size + 1), 0, copy, length);
        break;
    default: /* a digit for another: still well-formed, often no longer a surface */
        for (size_t i = at; i < *size; ++i) {
            if (text[i] >= '0' && text[i] <= '9') {
                text[i] = (char)('0' + random_below(10));
                break;
            }
        }
        break;
    }
}

static void damaged_files_give_an_error_in_words_or_a_sound_mesh(void **state)
{
    struct arena arena;
    size_t sound = 0, refused = 0;

    (void)state;
    assert_int_equal(arena_init(&arena, (size_t)1 << 20, NULL), ERROR_NONE);
    for (int round = 0; round < ROUNDS; ++round) {
        const char *origin = round % 2 ? tetrahedron : prism;
        size_t size = strlen(origin), used = arena.used;
        const struct mesh *mesh = NULL;
        struct error error = {0};
        enum error_code code;
        /* exactly as long as the text: the sanitizer sees a step beyond it */
        char room[ROOM], *text;

        memcpy(room, origin, size);
        for (size_t n = random_below(4); n > 0; --n) {
            mutate(room, &size);
        }
        text = malloc(size ? size : 1);
        assert_non_null(text);
        memcpy(text, room, size);
        code = mesh_read_obj_text("fuzz.obj", text, size, &arena, &mesh, &error);
        if (code == ERROR_NONE) {
            struct mesh_finding finding;

            assert_int_equal(mesh_check(mesh, &finding, NULL), ERROR_NONE);
            assert_int_equal(finding.fault, MESH_SOUND);
            assert_true(isfinite(mesh_area(mesh)) && mesh_volume(mesh) > 0);
            sound++;
        } else {
            unsigned long line, column;

            assert_int_equal(code, ERROR_INPUT);
            assert_int_equal(sscanf(error.text, "fuzz.obj:%lu:%lu: found", &line, &column), 2);
            assert_non_null(strstr(error.text, "expected"));
            for (const char *c = error.text; *c; ++c) {
                assert_true(*c >= 0x20 && *c < 0x7f);
            }
            refused++;
        }
        free(text);

        /* room for the next round */
        memset(arena.memory + used, 0, arena.used - used);
        arena.used = used;
    }
    arena_fini(&arena);

    /* both ways out were taken often */
    assert_true(sound > ROUNDS / 10);
    assert_true(refused > ROUNDS / 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(damaged_files_give_an_error_in_words_or_a_sound_mesh),
    };

    return cmocka_run_group_tests_name("obj_fuzz", tests, NULL, NULL);
}
