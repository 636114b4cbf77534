/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Seeded random numbers for noise and faults: splitmix64 (Steele, Lea, Flood 2014). Each user has
 * its own stream, and draws from one stream do not change the others. The same seed and name give
 * the same numbers on every machine. Gaussian numbers use base/portable_math.h for this. RT-safe.
 */
#ifndef BASE_RANDOM_H
#define BASE_RANDOM_H

#include "base/hash.h"
#include "base/portable_math.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

struct random_stream {
    uint64_t state;
};

static inline uint64_t random_bits(struct random_stream *stream)
{
    uint64_t z = stream->state += UINT64_C(0x9e3779b97f4a7c15);

    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return z ^ z >> 31;
}

/* Returns the stream of a name. Streams of different names are independent. */
static inline struct random_stream random_named(uint64_t seed, const char *name)
{
    struct random_stream stream = {hash_bytes(HASH_START, name, strlen(name))};

    stream.state = random_bits(&stream) ^ seed;
    stream.state = random_bits(&stream);
    return stream;
}

/* Draws a uniform number in [0, 1). */
static inline double random_uniform(struct random_stream *stream)
{
    return (double)(random_bits(stream) >> 11) * 0x1p-53;
}

/* Draws a Gaussian number with mean 0 and variance 1 (Box and Muller). Every draw consumes two
 * uniform numbers; the method's second Gaussian number is discarded. */
static inline double random_gaussian(struct random_stream *stream)
{
    double radius = sqrt(-2.0 * portable_log(1.0 - random_uniform(stream)));

    return radius * portable_cos(6.283185307179586 * random_uniform(stream));
}

/* Draws the state of an intermittent contact for the next step. `gap` and the result: true = open.
 * Open times have the mean length `dwell`. The contact is open for the fraction `share` of the
 * time. dwell and step have the same unit. */
static inline bool random_gap(struct random_stream *stream, bool gap, double share, double dwell,
                              double step)
{
    double leave = fmin(1.0, step / dwell);
    double enter = share < 1.0 ? fmin(1.0, leave * share / (1.0 - share)) : 1.0;

    if (share >= 1.0) {
        return true;
    }
    return random_uniform(stream) < (gap ? leave : enter) ? !gap : gap;
}

#endif
