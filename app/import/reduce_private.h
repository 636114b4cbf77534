/* SPDX-License-Identifier: Apache-2.0 */
/* What the steps of the reduction share. Not RT-safe. */
#ifndef APP_IMPORT_REDUCE_PRIVATE_H
#define APP_IMPORT_REDUCE_PRIVATE_H

#include "app/import/reduce.h"

struct reducer {
    const struct import_model *model;
    const struct import_options *options;
    struct arena *arena;
    struct import_notes *notes;
    struct import_robot *out;
    struct error *error;

    int *above;    /* by link: the joint that it hangs on, -1 = none */
    int *order;    /* links, parents first, children in the order of their joints */
    size_t norder; /* without a root that is the world */
    bool floats;   /* a floating joint says so */
    int root;      /* the link that is the base, or part of it */
    double *at;    /* by joint of the model: where a joint that is fixed stays */
};

enum error_code reduce_no_memory(const struct reducer *r);

/* Finds above, order and the root; loops and forests are refused. */
enum error_code reduce_find_tree(struct reducer *r);

/* Decides which joints are fixed, and where. */
enum error_code reduce_fix_joints(struct reducer *r);

/* Makes impossible inertias possible or refuses them. */
enum error_code reduce_check_inertia(struct reducer *r, const struct import_link *link,
                                     struct robot_inertia *inertia);

/* Frames of the links that are part of a body, sensors and poses. */
enum error_code reduce_add_frames(struct reducer *r);
enum error_code reduce_add_poses(struct reducer *r);

/* Where a joint rests: 0, or in from the nearest limit when they exclude 0. */
double reduce_rest(const struct import_joint *joint);

/* Where the child of a joint is in its parent when the joint is at q. */
void reduce_place_child(const struct import_joint *joint, double q, struct import_place *place);

#endif
