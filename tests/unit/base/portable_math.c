/* SPDX-License-Identifier: Apache-2.0 */
/* Elementary functions against long double, at the edges as C has them, and their very bits. */
#include "base/portable_math.h"

#include "base/array.h"
#include "base/random.h"
#include "tests/test.h"

#include <float.h>

#define TURN 6.283185307179586

/* Where arguments are drawn from: uniform between least and most, then times two to a uniform
 * exponent from 0 to shift. */
struct span {
    double least, most;
    int shift;
};

struct function {
    const char *name;
    double (*f)(double x);
    double (*of_c)(double x);
    long double (*exact)(long double x);
    double bound; /* ulp, as the header says */
    struct span span[6];
};

static const struct function function[] = {
    {"sin",
     portable_sin,
     sin,
     sinl,
     0.9,
     {{-10, 10, 0}, {-1e5, 1e5, 0}, {-2e5, 2e5, 0}, {-1, 1, 62}, {-1, 1, -1000}}},
    {"cos",
     portable_cos,
     cos,
     cosl,
     0.9,
     {{-10, 10, 0}, {-1e5, 1e5, 0}, {-2e5, 2e5, 0}, {-1, 1, 62}, {-1, 1, 1023}}},
    {"tan", portable_tan, tan, tanl, 2.3, {{-1.5, 1.5, 0}, {-1e5, 1e5, 0}, {-1, 1, -60}}},
    {"asin", portable_asin, asin, asinl, 2.2, {{-1, 1, 0}, {-1, 1, -60}, {0.999, 1, 0}}},
    {"acos", portable_acos, acos, acosl, 2.7, {{-1, 1, 0}, {-1e-3, 1e-3, 0}, {0.999, 1, 0}}},
    {"exp", portable_exp, exp, expl, 0.9, {{-2, 2, 0}, {-708, 709.7, 0}, {-745, -700, 0}}},
    {"expm1", portable_expm1, expm1, expm1l, 1.5, {{-2, 2, 0}, {-45, 45, 0}, {-1, 1, -60}}},
    {"log",
     portable_log,
     log,
     logl,
     0.9,
     {{0.5, 2, 0}, {0.999, 1.001, 0}, {0.5, 1, 1024}, {0.5, 1, -1070}}},
    {"log1p",
     portable_log1p,
     log1p,
     log1pl,
     0.9,
     {{-0.999, 2, 0}, {-0.4, 0.6, 0}, {-0.3, 1, -60}, {0, 1, 100}}},
};

static double drawn(const struct span *span, struct random_stream *stream)
{
    const double x = span->least + (span->most - span->least) * random_uniform(stream);

    return ldexp(x, (int)(span->shift * random_uniform(stream)));
}

/* How far a value is from the exact one in units of its last place */
static double error_in_ulp(double value, long double exact)
{
    int exponent;

    if (exact == 0.0L) {
        return value == 0.0 ? 0.0 : (double)INFINITY;
    }
    frexpl(exact, &exponent);
    exponent = exponent < DBL_MIN_EXP ? DBL_MIN_EXP : exponent;
    return (double)(fabsl((long double)value - exact) / ldexpl(1.0L, exponent - DBL_MANT_DIG));
}

TEST(errors_stay_below_what_the_header_says)
{
    enum { DRAWS = 100000 };

    for (size_t n = 0; n < ARRAY_COUNT(function); n++) {
        const struct function *of = &function[n];
        struct random_stream stream = random_named(1, of->name);

        for (size_t s = 0; s < ARRAY_COUNT(of->span) && of->span[s].least < of->span[s].most; s++) {
            for (int i = 0; i < DRAWS; i++) {
                const double x = drawn(&of->span[s], &stream);
                const double error = error_in_ulp(of->f(x), of->exact(x));

                if (!(error <= of->bound)) {
                    fail_msg("%s(%.17g) is wrong by %.3f ulp", of->name, x, error);
                }
            }
        }
    }
}

TEST(angles_of_points_are_right_in_all_directions)
{
    enum { DRAWS = 200000 };
    struct random_stream stream = random_named(1, "atan2");

    for (int i = 0; i < DRAWS; i++) {
        const double shift = i & 1 ? 40.0 * random_uniform(&stream) : 0.0;
        const double y = ldexp(2.0 * random_uniform(&stream) - 1.0, (int)-shift);
        const double x = ldexp(2.0 * random_uniform(&stream) - 1.0, i & 2 ? (int)-shift : 0);
        const double error = error_in_ulp(portable_atan2(y, x), atan2l(y, x));

        if (!(error <= 1.5)) {
            fail_msg("atan2(%.17g, %.17g) is wrong by %.3f ulp", y, x, error);
        }
    }
}

/* The doubles that come closest to a multiple of pi/2 (Muller, Elementary Functions, ch. 11), and
 * what stands on both sides of the change of reductions. */
TEST(hard_angles_are_reduced_by_enough_digits)
{
    static const double hard[] = {6381956970095103.0 * 0x1p797,
                                  5319372648326541.0 * 0x1p255,
                                  0x1.6ac5b262ca1ffp+849,
                                  1e22,
                                  DBL_MAX,
                                  1e5,
                                  100000.00000000001};

    for (size_t n = 0; n < ARRAY_COUNT(hard); n++) {
        assert_true(error_in_ulp(portable_sin(hard[n]), sinl(hard[n])) < 0.9);
        assert_true(error_in_ulp(portable_cos(hard[n]), cosl(hard[n])) < 0.9);
        assert_true(portable_sin(-hard[n]) == -portable_sin(hard[n]));
        assert_true(portable_cos(-hard[n]) == portable_cos(hard[n]));
    }
}

static bool same_value(double a, double b)
{
    return (isnan(a) && isnan(b)) || (a == b && signbit(a) == signbit(b));
}

TEST(edges_are_as_c_has_them)
{
    static const double edge[] = {0.0,        -0.0, 1.0, -1.0, (double)INFINITY, (double)-INFINITY,
                                  (double)NAN};

    for (size_t e = 0; e < ARRAY_COUNT(edge); e++) {
        for (size_t n = 0; n < ARRAY_COUNT(function); n++) {
            if (fabs(edge[e]) != 1.0) {
                assert_true(same_value(function[n].f(edge[e]), function[n].of_c(edge[e])));
            }
        }
        for (size_t f = 0; f < ARRAY_COUNT(edge); f++) {
            assert_true(same_value(portable_atan2(edge[e], edge[f]), atan2(edge[e], edge[f])));
        }
    }
    assert_true(isnan(portable_asin(1.0 + DBL_EPSILON)) && isnan(portable_acos(-1.5)));
    assert_true(isnan(portable_log(-1.0)) && isnan(portable_log1p(-1.5)));
    assert_true(portable_log1p(-1.0) == (double)-INFINITY);
    assert_true(portable_exp(1000.0) == (double)INFINITY && portable_exp(-1000.0) == 0.0);
    assert_true(portable_expm1(1000.0) == (double)INFINITY && portable_expm1(-1000.0) == -1.0);
}

TEST(powers_are_right_to_a_few_places)
{
    for (int i = 1; i < 1000; i++) {
        const double x = 0.013 * i, y = 4.0 - 0.0077 * i;

        assert_true(fabs(portable_pow(x, y) / pow(x, y) - 1.0) < 1e-14);
    }
}

/* Whatever the machine, its library and the compiler's options, these are the bits. */
TEST(bits_are_the_same_everywhere)
{
    enum { DRAWS = 2000 };
    struct random_stream stream = random_named(7, "bits");
    uint64_t hash = HASH_START;

    for (size_t n = 0; n < ARRAY_COUNT(function); n++) {
        for (size_t s = 0; s < ARRAY_COUNT(function[n].span); s++) {
            for (int i = 0; i < DRAWS; i++) {
                const double y = function[n].f(drawn(&function[n].span[s], &stream));

                hash = hash_bytes(hash, &y, sizeof y);
            }
        }
    }
    for (int i = 0; i < DRAWS; i++) {
        const double at = TURN * random_uniform(&stream);
        const double y = portable_atan2(portable_sin(at), portable_cos(at));

        hash = hash_bytes(hash, &y, sizeof y);
    }
    if (hash != UINT64_C(0xe3a63dc65d87de2e)) {
        fail_msg("the bits have the hash %016llx", (unsigned long long)hash);
    }
}
