/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The contact scenes that are measured: the pairs of surfaces that a robot meets, the paper's five
 * bodies, and a foot on bumpy ground of more and more triangles. Shared by coman-hil-bench contact
 * and by the program that counts instructions. Not RT-safe.
 */
#ifndef APP_BENCH_CONTACT_SCENES_H
#define APP_BENCH_CONTACT_SCENES_H

#include "contact/contact.h"

#include <stdint.h>

enum {
    BENCH_SURFACES = 8,
    BENCH_PAIRS = 8,
    BENCH_BODIES = 5,
    BENCH_SCENES = 10,
};

/* A contact scene, and the places where its bodies touch. */
struct bench_scene {
    const char *name;
    size_t faces;     /* triangles in all */
    double target_us; /* of an evaluation by the native engine; 0 = none is set */
    double place[BENCH_BODIES][3];
    struct contact_surface surface[BENCH_SURFACES];
    struct contact_pair pair[BENCH_PAIRS];
    struct contact_config config; /* refers to the two above, so the scene must not be moved */
};

/* Makes the scenes; meshes come from arena, which must outlive them, and so must foot. */
enum error_code bench_scenes_make(struct bench_scene scene[BENCH_SCENES], size_t *nscene,
                                  const struct mesh *foot, struct arena *arena,
                                  struct error *error);

/* Draws a motion of all bodies near their places: up to 10 mm aside, 0.3 mm up or down and 3
 * mrad turned, in slow motion. The same seed gives the same motion; it must not be 0, and is
 * advanced. */
void bench_scene_draw(const struct bench_scene *scene, uint64_t *seed,
                      struct body_motion motion[BENCH_BODIES]);

#endif
