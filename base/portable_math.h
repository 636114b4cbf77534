/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Elementary functions with the same bits on every machine. C libraries differ in the last digit
 * between versions and CPUs, for example with FMA. A state, a frame or a verdict must not depend on
 * this. These functions use only integers and IEEE 754 additions, multiplications, divisions and
 * roots in one fixed order (-ffp-contract=off).
 *
 * Angles in rad. Each error is the largest one found over millions of arguments, in units of the
 * last place (ulp); tests/unit/base/portable_math.c compares with long double. Zeros, infinities
 * and NaN behave as in C; errno and floating-point flags are undefined. RT-safe. sqrt, fabs, floor,
 * round, ldexp and fmod of the C library are exact and may be used.
 */
#ifndef BASE_PORTABLE_MATH_H
#define BASE_PORTABLE_MATH_H

/* Computes sine and cosine of any angle; large angles are reduced with as many digits of pi as
 * necessary. 0.86 ulp. */
void portable_sincos(double x, double *sine, double *cosine);
double portable_sin(double x);
double portable_cos(double x);
double portable_tan(double x); /* 2.3 ulp */

/* Returns the angle of the point (x, y) in (-pi, pi]. 1.5 ulp. */
double portable_atan2(double y, double x);
double portable_asin(double x); /* 2.2 ulp */
double portable_acos(double x); /* 2.7 ulp */

double portable_exp(double x);   /* 0.9 ulp */
double portable_expm1(double x); /* 1.5 ulp */
double portable_log(double x);   /* 0.9 ulp */
double portable_log1p(double x); /* 0.9 ulp */

/* Returns x to the power y for x > 0, by the logarithm: |y log x| + 2 ulp. For scales and steps;
 * for full precision multiply or take roots. */
double portable_pow(double x, double y);

#endif
