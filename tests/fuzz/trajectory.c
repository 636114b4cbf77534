/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Trajectories: a file is refused in words with its line, or gives joints that stay within their
 * limits of angle and rate at every time.
 */
#include "tasks/trajectory.h"
#include "tests/fuzz/fuzz.h"

#include <math.h>
#include <string.h>

enum { TIMES = 200 };

static const struct trajectory_limit limits[] = {{"hip", -1, 2, 10}, {"knee", 0, 3, 0}};

static void check_trajectory(const struct trajectory *t)
{
    double length = trajectory_length_s(t);

    fuzz_require(isfinite(length) && length > 0 && t->njoint >= 1 && t->njoint <= 2,
                 "%g s, %zu joints", length, t->njoint);
    for (int i = -1; i <= TIMES; i++) {
        for (size_t k = 0; k < t->njoint; k++) {
            const struct trajectory_limit *limit = &limits[t->joint[k]];
            double most = limit->rate_rad_s > 0 ? limit->rate_rad_s : 1e3, angle, rate;

            trajectory_at(t, k, length / TIMES * i, &angle, &rate);
            fuzz_require(angle >= limit->lower_rad - 1e-9 && angle <= limit->upper_rad + 1e-9,
                         "%s at %.17g rad", limit->joint, angle);
            fuzz_require(fabs(rate) <= most * (1 + 1e-6), "%s at %.17g rad/s", limit->joint, rate);
        }
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    for (int k = TRAJECTORY_CUBIC; k <= TRAJECTORY_LINEAR; k++) {
        const struct trajectory *t = NULL;
        struct error error = {0};
        struct csv *csv;

        if (csv_open_memory("x.csv", data, size, &csv, &error) ||
            trajectory_read(csv, (enum trajectory_interpolation)k, limits, 2,
                            fuzz_arena((size_t)16 << 20), &t, &error)) {
            fuzz_require(error.code == ERROR_INPUT && strncmp(error.text, "x.csv:", 6) == 0 &&
                             fuzz_is_sentence(error.text) && strstr(error.text, "found"),
                         "%d: %s", (int)error.code, error.text);
            fuzz_tally.refused++;
        } else {
            check_trajectory(t);
            fuzz_tally.taken++;
        }
    }
    return 0;
}
