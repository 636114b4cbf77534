/* SPDX-License-Identifier: Apache-2.0 */
/* The fixed text of every generated file: vector types, sine and cosine. */
#include "model/symbolic/emit.h"

#include "base/array.h"

/*
 * Sine and cosine of 8 lanes. Reduction by n pi/2 after Cody and Waite with pi/2 in 33 + 33 + 53
 * bits: the first two products are exact (n < 2^16), the rounding of the second difference and the
 * third product are carried along as e, at most 2.5e-16. Taylor polynomials on |r| <= pi/4: the
 * terms left out are below (pi/4)^18/19! = 1.1e-19 of r and (pi/4)^18/18! = 2.1e-18 of 1
 * (alternating series). Beyond 1e5 rad portable_sincos reduces by as many digits of pi as the angle
 * asks for; below, the two give the same bits. Measured against long double up to 1e15 rad: 0.86
 * units of the last place.
 */
static const char *const preamble[] = {
    "typedef double v2 __attribute__((vector_size(16), may_alias));",
    "typedef double v4 __attribute__((vector_size(32), may_alias));",
    "typedef double v8 __attribute__((vector_size(64), may_alias));",
    "typedef int64_t w8 __attribute__((vector_size(64), may_alias));",
    "#define ALIGNED __attribute__((aligned(64)))",
    "#define JOIN(a, b) a##b",
    "#define JOIN2(a, b) JOIN(a, b)",
    "#define NAME(function) JOIN2(function##_, VARIANT)",
    "",
    "/* Of coman-hil, the same bits on every machine (base/portable_math.h); elsewhere libm's. */",
    "__attribute__((weak)) void portable_sincos(double x, double *sine, double *cosine);",
    "",
    "/* Angles beyond the reach of the fast reduction, infinities and NaN. */",
    "static __attribute__((noinline, cold)) void sincos_far(const double *x, double *sine,",
    "                                                       double *cosine)",
    "{",
    "    for (int l = 0; l < 8; l++) {",
    "        if (!(fabs(x[l]) <= 1e5)) {",
    "            if (portable_sincos) {",
    "                portable_sincos(x[l], &sine[l], &cosine[l]);",
    "            } else {",
    "                sine[l] = sin(x[l]);",
    "                cosine[l] = cos(x[l]);",
    "            }",
    "        }",
    "    }",
    "}",
};

static const char *const sincos_text[] = {
    "/* Sine and cosine of 8 angles: x = n pi/2 + r + e, then Taylor polynomials in r. */",
    "TARGET static inline void NAME(sincos)(const double *x, double *sine, double *cosine)",
    "{",
    "    const v8 a = *(const v8 *)x;",
    "    const v8 shifted = a * 0.6366197723675814 + 6755399441055744.0;",
    "    const v8 n = shifted - 6755399441055744.0;",
    "    const v8 y = a - n * 1.5707963267341256;",
    "    const v8 r = y - n * 6.077100506303966e-11;",
    "    const v8 e = ((y - r) - n * 6.077100506303966e-11) - n * 2.0222662487959506e-21;",
    "    const v8 z = r * r;",
    "    v8 s = z * 2.8114572543455206e-15 - 7.647163731819816e-13;",
    "    v8 c = z * 4.779477332387385e-14 - 1.1470745597729725e-11;",
    "    s = z * s + 1.6059043836821613e-10;",
    "    c = z * c + 2.08767569878681e-09;",
    "    s = z * s - 2.505210838544172e-08;",
    "    c = z * c - 2.755731922398589e-07;",
    "    s = z * s + 2.7557319223985893e-06;",
    "    c = z * c + 2.4801587301587302e-05;",
    "    s = z * s - 0.00019841269841269841;",
    "    c = z * c - 0.0013888888888888889;",
    "    s = z * s + 0.0083333333333333332;",
    "    c = z * c + 0.041666666666666664;",
    "    s = z * s - 0.16666666666666666;",
    "    const v8 half = 0.5 * z, w = 1.0 - half;",
    "    s = r + (z * (r * s - 0.5 * e) + e);",
    "    c = w + (((1.0 - w) - half) + (z * (z * c) - r * e));",
    "    const w8 k = (w8)shifted;",
    "    const w8 odd = -(k & 1), minus = (k & 2) << 62, turned = ((k + 1) & 2) << 62;",
    "    *(w8 *)sine = (((w8)s & ~odd) | ((w8)c & odd)) ^ minus;",
    "    *(w8 *)cosine = (((w8)c & ~odd) | ((w8)s & odd)) ^ turned;",
    "    const w8 near = ((v8)((w8)a & INT64_MAX) <= 1e5);",
    "    const int64_t *flag = (const int64_t *)&near;",
    "    if (__builtin_expect((flag[0] & flag[1] & flag[2] & flag[3] &",
    "                          flag[4] & flag[5] & flag[6] & flag[7]) == 0, 0)) {",
    "        sincos_far(x, sine, cosine);",
    "    }",
    "}",
};

void emit_preamble(FILE *file)
{
    for (size_t n = 0; n < ARRAY_COUNT(preamble); n++) {
        fprintf(file, "%s\n", preamble[n]);
    }
}

void emit_sincos(FILE *file)
{
    for (size_t n = 0; n < ARRAY_COUNT(sincos_text); n++) {
        fprintf(file, "%s\n", sincos_text[n]);
    }
}
