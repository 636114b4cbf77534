/* SPDX-License-Identifier: Apache-2.0 */
/* Private to the requests of a robot: robot_requests.c, robot_push.c, robot_checkpoint.c. */
#ifndef SIM_ROBOT_REQUESTS_PRIVATE_H
#define SIM_ROBOT_REQUESTS_PRIVATE_H

#include "sim/robot_requests.h"

enum tunable_kind { TUNE_SETTING, TUNE_PRETENSION, TUNE_SUPPLY, TUNE_NOISE, TUNE_TASK };

/* The parameter that a tunable stands for. */
struct meaning {
    enum tunable_kind kind;
    size_t joint;              /* TUNE_PRETENSION */
    size_t board, axis, index; /* TUNE_SETTING; index: TUNE_TASK, too */
};

struct robot_requests {
    struct robot_requests_config config;
    struct request_machine machine;
    struct checkpoint *checkpoint;
    struct tunable *tunable;
    struct meaning *meaning;
    size_t ntunable;
    unsigned char *bus_moment[CHECKPOINT_SLOTS][RIG_BUSES_MAX]; /* NULL = not a local bus */

    /* State that changes in virtual time */
    struct {
        uint64_t changes; /* of tunables that are no board settings */
        bool winding;     /* a winch is moving */
        bool pushing;     /* a push with a duration acts */
    } moving;
    int64_t *push_until; /* by body; 0 = until changed */
    double *pretension;  /* by joint: where its winch moves to */
};

/* ---- pushes (robot_push.c) ---- */

/* Returns the number of bodies: the robot's, then free ones. RT-safe. */
size_t robot_body_count(const struct robot_requests *s);

/* As in struct request_machine. RT-safe. */
enum request_verdict robot_push_body(void *context, const struct loop_request *request,
                                     int64_t now_ns);
const char *robot_body_name(void *context, size_t index);

/* Ends the pushes whose duration is over. RT-safe. */
void robot_end_pushes(struct robot_requests *s, int64_t now_ns);

/* ---- checkpoints (robot_checkpoint.c) ---- */

/* Creates the checkpoint slots over all memory that changes in virtual time, less what other
 * threads write in it. ERROR_MEMORY. Not RT-safe. */
enum error_code robot_checkpoint_create(struct robot_requests *s, struct arena *arena,
                                        struct error *error);

/* Allocates room for the frames on local buses of each slot; false = no memory. Not RT-safe. */
bool robot_checkpoint_create_buses(struct robot_requests *s, struct arena *arena);

/* As in struct request_machine. RT-safe. */
enum request_verdict robot_save(void *context, size_t slot);
void robot_restore(void *context, size_t slot);

#endif
