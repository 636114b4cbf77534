/* SPDX-License-Identifier: Apache-2.0 */
#include "base/portable_math.h"

#include <float.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

__extension__ typedef unsigned __int128 uint128;

/* Arguments are reduced by parts of pi/2 and of log 2 (Cody and Waite, Software Manual for the
 * Elementary Functions, 1980). For large angles the reduction multiplies by 2/pi, with as many
 * digits as necessary (Payne and Hanek, SIGNUM Newsletter 18, 1983). All polynomials are Taylor
 * series. Their number of terms suits their interval. */
#define PI 0x1.921fb54442d18p+1
#define PI_REST 0x1.1a62633145c07p-53  /* pi = PI + PI_REST */
#define REACH 1e5                      /* largest angle that reduce_near accepts, rad */
#define LOG2_HIGH 0x1.62e42fee00000p-1 /* rounded to 32 bits */
#define LOG2_LOW 0x1.a39ef35793c76p-33

enum { EXPONENT_BIAS = 1023, MANTISSA = 52 };

static uint64_t double_bits(double x)
{
    uint64_t bits;

    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* Returns 2^n for -1022 <= n <= 1023. */
static double power_of_two(int n)
{
    const uint64_t bits = (uint64_t)(n + EXPONENT_BIAS) << MANTISSA;
    double x;

    memcpy(&x, &bits, sizeof x);
    return x;
}

/* A reduced angle: x = quadrant pi/2 + r + e with |r| <= pi/4. e is the rounding error of r. */
struct reduced_angle {
    unsigned int quadrant;
    double r, e;
};

/*
 * Reduces an angle with |x| <= REACH. It subtracts n pi/2, with pi/2 in three parts of 33, 33 and
 * 53 bits. The first two products are exact, because n < 2^16. e holds the rounding error of the
 * second difference, and the third product.
 */
static struct reduced_angle reduce_near(double x)
{
    const double shifted = x * 0.6366197723675814 + 0x1.8p52, n = shifted - 0x1.8p52;
    const double y = x - n * 1.5707963267341256, r = y - n * 6.077100506303966e-11;
    const double e = ((y - r) - n * 6.077100506303966e-11) - n * 2.0222662487959506e-21;

    return (struct reduced_angle){(unsigned int)(double_bits(shifted) & 3), r, e};
}

/* Returns 64 bits of 2/pi, starting at its bit `first`. Bit 1 is the first after the binary point.
 * Bits before bit 1 are zero. */
static uint64_t two_over_pi_bits(int first)
{
    static const uint64_t two_over_pi[] = {
        0xa2f9836e4e441529, 0xfc2757d1f534ddc0, 0xdb6295993c439041, 0xfe5163abdebbc561,
        0xb7246e3a424dd2e0, 0x06492eea09d1921c, 0xfe1deb1cb129a73e, 0xe88235f52ebb4484,
        0xe99c7026b45f7e41, 0x3991d639835339f4, 0x9c845f8bbdf9283b, 0x1ff897ffde05980f,
        0xef2f118b5a0a6d1f, 0x6d367ecf27cb09b7, 0x4f463f669e5fea2d, 0x7527bac7ebe5f17b,
        0x3d0739f78a5292ea, 0x6bfb5fb11f8d5d08, 0x56033046fc7b6bab, 0xf0cfbc209af4361d};
    const int word = (first - 1) >> 6, within = (first - 1) & 63;
    const uint64_t high = word < 0 ? 0 : two_over_pi[word], low = two_over_pi[word + 1];

    return within ? high << within | low >> (64 - within) : high;
}

/*
 * Reduces an angle with |x| > REACH. Let x = m 2^e with an integer m. The bits of 2/pi with weights
 * above 2^(1-e) add only whole turns to x 2/pi, so they are skipped. The next 192 bits, times m and
 * modulo 2^192, give x 2/pi modulo 4. This product is a fixed-point number with 190 fractional
 * bits. Its error is below m 2^-190. No double is closer to a multiple of pi/2 than 2^-62 (Muller,
 * Elementary Functions, 2016, ch. 11). At least 75 correct bits therefore remain.
 */
static struct reduced_angle reduce_far(double x)
{
    const uint64_t bits = double_bits(x);
    const uint64_t m = (bits & (UINT64_MAX >> 12)) | UINT64_C(1) << MANTISSA;
    const int e = (int)(bits >> MANTISSA & 2047) - EXPONENT_BIAS - MANTISSA;
    const uint128 half_pi = (uint128)0xc90fdaa22168c234 << 64 | 0xc4c6628b80dc1cd1;
    const uint128 low = (uint128)m * two_over_pi_bits(e + 127);
    const uint128 middle = (uint128)m * two_over_pi_bits(e + 63) + (uint64_t)(low >> 64);
    const uint64_t top = m * two_over_pi_bits(e - 1) + (uint64_t)(middle >> 64);
    uint128 fraction = (uint128)top << 66 | (uint128)(uint64_t)middle << 2 | (uint64_t)low >> 62;
    uint64_t rest = (uint64_t)low << 2;
    struct reduced_angle angle = {.quadrant = (unsigned int)(top >> 62)};
    double sign = 1.0, scale;
    uint128 product;
    int zeros = 0;

    /* Round to the nearest multiple of pi/2; the rest may be negative */
    if (fraction >> 127) {
        angle.quadrant++;
        rest = ~rest + 1;
        fraction = ~fraction + (rest == 0);
        sign = -1.0;
    }
    while (!(fraction >> 127)) {
        fraction = fraction << 1 | rest >> 63;
        rest <<= 1;
        zeros++;
    }

    /* Multiply by pi/2. Both factors have 128 bits. The upper half of the product has a relative
     * error below 2^-125 */
    product = (uint128)(uint64_t)(fraction >> 64) * (uint64_t)(half_pi >> 64) +
              ((uint128)(uint64_t)(fraction >> 64) * (uint64_t)half_pi >> 64) +
              ((uint128)(uint64_t)fraction * (uint64_t)(half_pi >> 64) >> 64);
    scale = ldexp(bits >> 63 ? -sign : sign, -127 - zeros);

    /* r gets the upper 53 bits, e the next 53 */
    angle.r = (double)(uint64_t)(product >> 75) * 0x1p75 * scale;
    angle.e = (double)((uint64_t)(product >> 22) & (UINT64_MAX >> 11)) * 0x1p22 * scale;
    angle.quadrant = bits >> 63 ? 0U - angle.quadrant : angle.quadrant;
    return angle;
}

void portable_sincos(double x, double *sine, double *cosine)
{
    struct reduced_angle angle;
    double z, s, c, half, w;

    if (!isfinite(x)) {
        *sine = *cosine = x - x;
        return;
    }
    angle = fabs(x) <= REACH ? reduce_near(x) : reduce_far(x);
    z = angle.r * angle.r;

    /* Truncation errors: (pi/4)^18/19! = 1.1e-19 relative to r, (pi/4)^18/18! = 2.1e-18 relative to
     * 1 */
    s = z * 2.8114572543455206e-15 - 7.647163731819816e-13;
    c = z * 4.779477332387385e-14 - 1.1470745597729725e-11;
    s = z * s + 1.6059043836821613e-10;
    c = z * c + 2.08767569878681e-09;
    s = z * s - 2.505210838544172e-08;
    c = z * c - 2.755731922398589e-07;
    s = z * s + 2.7557319223985893e-06;
    c = z * c + 2.4801587301587302e-05;
    s = z * s - 0.00019841269841269841;
    c = z * c - 0.0013888888888888889;
    s = z * s + 0.0083333333333333332;
    c = z * c + 0.041666666666666664;
    s = z * s - 0.16666666666666666;
    half = 0.5 * z;
    w = 1.0 - half;
    s = angle.r + (z * (angle.r * s - 0.5 * angle.e) + angle.e);
    c = w + (((1.0 - w) - half) + (z * (z * c) - angle.r * angle.e));

    *sine = angle.quadrant & 1 ? c : s;
    *cosine = angle.quadrant & 1 ? s : c;
    *sine = angle.quadrant & 2 ? -*sine : *sine;
    *cosine = (angle.quadrant + 1) & 2 ? -*cosine : *cosine;
    if (x == 0.0) {
        *sine = x;
    }
}

double portable_sin(double x)
{
    double sine, cosine;

    portable_sincos(x, &sine, &cosine);
    return sine;
}

double portable_cos(double x)
{
    double sine, cosine;

    portable_sincos(x, &sine, &cosine);
    return cosine;
}

double portable_tan(double x)
{
    double sine, cosine;

    portable_sincos(x, &sine, &cosine);
    return sine / cosine;
}

/* Computes atan(t) as high + low for 0 <= t <= 1. The table gives the angle of the nearest multiple
 * of 1/8. A series in the tangent d of the rest, |d| < 3/32, gives the rest. Its truncation error
 * is 2e-18 d. */
static void slope_angle(double t, double *high, double *low)
{
    static const double eighth[9][2] = {{0, 0},
                                        {0x1.fd5ba9aac2f6ep-4, -0x1.cd37686760c17p-59},
                                        {0x1.f5b75f92c80ddp-3, 0x1.8ab6e3cf7afbdp-57},
                                        {0x1.6f61941e4def1p-2, -0x1.c63aae6f6e918p-56},
                                        {0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56},
                                        {0x1.1e00babdefeb4p-1, -0x1.928df287a668fp-58},
                                        {0x1.4978fa3269ee1p-1, 0x1.2419a87f2a458p-56},
                                        {0x1.700a7c5784634p-1, -0x1.8c34d25aadef6p-56},
                                        {0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55}};
    const int n = t < 0.09375 ? 0 : (int)(8.0 * t + 0.5);
    const double c = 0.125 * n, d = n ? (t - c) / (1.0 + t * c) : t, z = d * d;
    double sum = 1.0 / 13 - z * (1.0 / 15);

    sum = 1.0 / 11 - z * sum;
    sum = 1.0 / 9 - z * sum;
    sum = 1.0 / 7 - z * sum;
    sum = 1.0 / 5 - z * sum;
    sum = 1.0 / 3 - z * sum;
    *high = n ? eighth[n][0] : d;
    *low = n ? d + (eighth[n][1] - d * (z * sum)) : -d * (z * sum);
}

double portable_atan2(double y, double x)
{
    const double a = fabs(y), b = fabs(x);
    double high, low, angle;

    if (isnan(x) || isnan(y)) {
        return x + y;
    }
    /* Reduce to the first octant. Zeros and infinities get the slope 0 or 1 */
    if (a <= b) {
        slope_angle(a == b ? (a == 0.0 ? 0.0 : 1.0) : a / b, &high, &low);
        angle = signbit(x) ? PI - (high - (PI_REST - low)) : high + low;
    } else {
        slope_angle(b / a, &high, &low);
        angle = 0.5 * PI -
                (signbit(x) ? -(high + (low + 0.5 * PI_REST)) : high + (low - 0.5 * PI_REST));
    }
    return copysign(angle, y);
}

double portable_asin(double x)
{
    return portable_atan2(x, sqrt((1.0 - x) * (1.0 + x)));
}

double portable_acos(double x)
{
    return 2.0 * portable_atan2(sqrt(1.0 - x), sqrt(1.0 + x));
}

/* Reduces x = k log 2 + r with |r| <= log(2)/2. Returns exp(r) - 1 - r from a series with a
 * truncation error of 4e-18 r. */
static double exp_rest(double x, int *k, double *r)
{
    const double n = floor(x * 0x1.71547652b82fep+0 + 0.5);
    const double high = x - n * LOG2_HIGH, low = n * LOG2_LOW;
    double sum = 1.0 / 479001600 + (high - low) * (1.0 / 6227020800);

    *k = (int)n;
    *r = high - low;
    sum = 1.0 / 39916800 + *r * sum;
    sum = 1.0 / 3628800 + *r * sum;
    sum = 1.0 / 362880 + *r * sum;
    sum = 1.0 / 40320 + *r * sum;
    sum = 1.0 / 5040 + *r * sum;
    sum = 1.0 / 720 + *r * sum;
    sum = 1.0 / 120 + *r * sum;
    sum = 1.0 / 24 + *r * sum;
    sum = 1.0 / 6 + *r * sum;
    sum = *r * *r * (0.5 + *r * sum);
    return sum + ((high - *r) - low) * (1.0 + *r);
}

double portable_exp(double x)
{
    double r, rest;
    int k;

    if (isnan(x)) {
        return x;
    }
    if (x > 709.8) {
        return (double)INFINITY;
    }
    if (x < -745.2) {
        return 0.0;
    }
    rest = exp_rest(x, &k, &r);
    r = 1.0 + (r + rest);

    /* Scale in two steps if 2^k is not a normal double. Only the second step rounds */
    if (k > EXPONENT_BIAS) {
        return r * 2.0 * power_of_two(k - 1);
    }
    return k < -1022 ? r * power_of_two(k + 200) * power_of_two(-200) : r * power_of_two(k);
}

double portable_expm1(double x)
{
    double r, rest, scale;
    int k;

    if (isnan(x) || x == 0.0) {
        return x;
    }
    if (x < -40.0) {
        return -1.0;
    }
    if (x > 40.0) {
        return portable_exp(x);
    }
    rest = exp_rest(x, &k, &r);
    if (k == 0) {
        return r + rest;
    }
    scale = power_of_two(-k);
    return power_of_two(k) * ((1.0 - scale) + (r + rest));
}

/*
 * Returns log(1 + f) + k log 2 + c for sqrt(1/2) - 1 <= f <= sqrt(2) - 1. With s = f/(2 + f), log(1
 * + f) = 2 artanh s = f - f^2/2 + s (f^2/2 + R). R is the series 2 s^2 (1/3 + s^2/5 + ...). Its
 * truncation error is 1e-18 f.
 */
static double log_sum(double f, int k, double c)
{
    const double s = f / (2.0 + f), z = s * s, half = 0.5 * f * f;
    double sum = 2.0 / 21 + z * (2.0 / 23);

    sum = 2.0 / 19 + z * sum;
    sum = 2.0 / 17 + z * sum;
    sum = 2.0 / 15 + z * sum;
    sum = 2.0 / 13 + z * sum;
    sum = 2.0 / 11 + z * sum;
    sum = 2.0 / 9 + z * sum;
    sum = 2.0 / 7 + z * sum;
    sum = 2.0 / 5 + z * sum;
    sum = 2.0 / 3 + z * sum;
    sum *= z;
    return k * LOG2_HIGH - ((half - (s * (half + sum) + (k * LOG2_LOW + c))) - f);
}

/* Splits a normal x = 2^k m with sqrt(1/2) <= m < sqrt(2); returns m. */
static double split_power(double x, int *k)
{
    const uint64_t bits = double_bits(x);
    double m = x;

    *k = (int)(bits >> MANTISSA) - EXPONENT_BIAS;
    m *= power_of_two(*k == EXPONENT_BIAS ? -1022 : -*k);
    m *= *k == EXPONENT_BIAS ? 0.5 : 1.0;
    if (m >= 0x1.6a09e667f3bcdp+0) {
        m *= 0.5;
        (*k)++;
    }
    return m;
}

double portable_log(double x)
{
    int k, below = 0;
    double m;

    if (!(x > 0.0)) {
        return x == 0.0 ? (double)-INFINITY : (double)NAN;
    }
    if (isinf(x)) {
        return x;
    }
    if (x < DBL_MIN) {
        x *= 0x1p54;
        below = 54;
    }
    m = split_power(x, &k);
    return log_sum(m - 1.0, k - below, 0.0);
}

double portable_log1p(double x)
{
    double u, m;
    int k;

    if (!(x > -1.0)) {
        return x == -1.0 ? (double)-INFINITY : (double)NAN;
    }
    if (isinf(x) || fabs(x) < 0x1p-54) {
        return x;
    }
    if (x > -0.29 && x < 0.41) {
        return log_sum(x, 0, 0.0);
    }

    /* Correct the logarithm by the relative rounding error of 1 + x */
    u = 1.0 + x;
    m = split_power(u, &k);
    return log_sum(m - 1.0, k, (u > 2.0 ? 1.0 - (u - x) : x - (u - 1.0)) / u);
}

double portable_pow(double x, double y)
{
    return portable_exp(y * portable_log(x));
}
