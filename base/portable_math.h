/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Elementary functions with bit-identical results on every machine. C libraries differ in the last
 * digit between versions and CPUs, for example because of FMA. A state, a frame or a verdict must
 * not depend on this difference. These functions use integers, and IEEE 754 additions,
 * multiplications, divisions and square roots in one fixed order (-ffp-contract=off).
 *
 * Angles are in rad. The number at a function is its largest error over millions of arguments, in
 * units in the last place (ulp). tests/unit/base/portable_math.c compares the functions with long
 * double. Zeros, infinities and NaN give the same results as in C. errno and floating-point flags
 * are undefined. The C library's sqrt, fabs, floor, round, ldexp and fmod are exact and may be
 * used. RT-safe.
 */
#ifndef BASE_PORTABLE_MATH_H
#define BASE_PORTABLE_MATH_H

/* Computes the sine and cosine of any angle. Large angles are reduced with as many digits of pi as
 * necessary. Error: 0.86 ulp. */
void portable_sincos(double x, double *sine, double *cosine);
double portable_sin(double x);
double portable_cos(double x);
double portable_tan(double x); /* 2.3 ulp */

/* Returns the angle of the point (x, y), in (-pi, pi]. Error: 1.5 ulp. */
double portable_atan2(double y, double x);
double portable_asin(double x); /* 2.2 ulp */
double portable_acos(double x); /* 2.7 ulp */

double portable_exp(double x);   /* 0.9 ulp */
double portable_expm1(double x); /* 1.5 ulp */
double portable_log(double x);   /* 0.9 ulp */
double portable_log1p(double x); /* 0.9 ulp */

/* Returns x to the power y for x > 0, as exp(y log x). Error: |y log x| + 2 ulp. Use it for scales
 * and step sizes. For full precision use products or roots. */
double portable_pow(double x, double y);

#endif
