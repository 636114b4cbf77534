/* SPDX-License-Identifier: Apache-2.0 */
/* The state of a 2FOC board (boards/foc/board.c), shared by the sources that are its parts. Units
 * are the protocol's. RT-safe. */
#ifndef BOARDS_FOC_PRIVATE_H
#define BOARDS_FOC_PRIVATE_H

#include "boards/foc/board.h"
#include "boards/foc/control.h"
#include "boards/foc/table.h"
#include "boards/icub/board.h"

enum { FOC_ANSWERS_MAX = 8 }; /* to DESIRED_TARGETS within a tick */

struct foc_board {
    struct icub_board icub;
    uint8_t mode;
    uint32_t faults;
    uint8_t encoder; /* enum foc_encoder_state */
    bool compatible; /* the host speaks our protocol */
    bool motor_set, current_set;
    uint8_t flags; /* enum foc_motor_flag */
    int64_t resolution, index_offset, poles, tolerance;
    int64_t nominal_ma, peak_ma, overload_ma;
    int64_t temperature_limit; /* raw; 0 = none */
    struct foc_law current, speed;
    struct foc_position_law position_law;
    float motor_parameter[FOC_MOTOR_MAX_VELOCITY + 1]; /* kept for the host */

    int64_t target;   /* as last commanded for the present mode */
    int64_t speed_ma; /* reference of the current loop in SPEED_CURRENT */
    struct foc_limiter limiter;
    int64_t vq;
    int32_t start; /* position when the mode began */

    int64_t i2t; /* mA^2 ms / 1024 */
    int64_t target_ns;

    int32_t position, velocity; /* icubdeg, icubdeg/ms */
    int32_t position_before;    /* a millisecond ago */
    int32_t turn;               /* whole revolutions, to see the index go by */
    double current_a, supply_v;
    int32_t temperature; /* raw */
    bool sensors_bad, started;

    unsigned answers;
    int64_t status_ms, sampled_ms;
};

static inline struct foc_board *foc_board_of(const struct board *board)
{
    return container_of(board, struct foc_board, icub.board);
}

static inline bool foc_runs(uint8_t mode)
{
    return mode != ICUB_MODE_IDLE && mode != ICUB_MODE_HARDWARE_FAULT &&
           mode != ICUB_MODE_NOT_CONFIGURED;
}

/* Settings that may be changed beside the bus. */
extern const struct board_settings foc_settings;

#endif
