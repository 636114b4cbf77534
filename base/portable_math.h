/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Elementary functions with the same bits on every machine. C libraries differ in the last place
 * from version to version and from CPU to CPU (they choose other code where there is FMA); what the
 * state, a frame or a verdict depends on must not. Each of these is additions, multiplications,
 * divisions and roots of IEEE 754 in one written order (-ffp-contract=off), and whole numbers.
 *
 * Angles in rad. Errors are the largest seen in units of the last place (ulp) over millions of
 * arguments each; tests/unit/base/portable_math.c holds them against long double. What C says of
 * zeros, infinities and NaN holds; errno and the flags of the floating-point unit are nobody's
 * concern. RT-safe. sqrt, fabs, floor, round, ldexp and fmod of the C library are exact, and stay.
 */
#ifndef BASE_PORTABLE_MATH_H
#define BASE_PORTABLE_MATH_H

/* Sine and cosine of any angle: large ones are reduced by as many digits of pi as they need.
 * 0.86 ulp. */
void portable_sincos(double x, double *sine, double *cosine);
double portable_sin(double x);
double portable_cos(double x);
double portable_tan(double x); /* 2.3 ulp */

/* Angle of the point (x, y) in (-pi, pi]. 1.5 ulp. */
double portable_atan2(double y, double x);
double portable_asin(double x); /* 2.2 ulp */
double portable_acos(double x); /* 2.7 ulp */

double portable_exp(double x);   /* 0.9 ulp */
double portable_expm1(double x); /* 1.5 ulp */
double portable_log(double x);   /* 0.9 ulp */
double portable_log1p(double x); /* 0.9 ulp */

/* x to the power y for x > 0 by way of the logarithm: |y log x| + 2 ulp. For scales and steps; what
 * needs the last place of a power multiplies or takes roots. */
double portable_pow(double x, double y);

#endif
