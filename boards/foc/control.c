/* SPDX-License-Identifier: Apache-2.0 */
/* The control laws of a 2FOC board; see the header for what each computes. */
#include "boards/foc/control.h"

#include "boards/motor_control.h"

#include <math.h>

/* Sets the integer gains of a law; half of ki is used. */
static void foc_law_set_mantissas(struct foc_law *law, int64_t kp, int64_t ki, int64_t shift)
{
    law->kp = kp;
    law->ki = ki / 2;
    law->shift = shift;
}

void foc_law_set(struct foc_law *law, int64_t kp, int64_t ki, int64_t shift)
{
    foc_law_set_mantissas(law, kp, ki, shift);
    law->gain[FOC_LAW_KP] = ldexp((double)kp, -(int)shift);
    law->gain[FOC_LAW_KI] = ldexp((double)ki, -(int)shift);
}

bool foc_law_set_gain(struct foc_law *law, unsigned which, double value)
{
    double gain[FOC_LAW_GAINS] = {law->gain[FOC_LAW_KP], law->gain[FOC_LAW_KI]};
    int exponent = 0;

    if (which >= FOC_LAW_GAINS || !isfinite(value) || fabs(value) >= 32768.0) {
        return false;
    }
    gain[which] = value;
    while (fmax(gain[FOC_LAW_KP], gain[FOC_LAW_KI]) >= ldexp(1.0, exponent)) {
        exponent++;
    }
    law->gain[which] = value;
    foc_law_set_mantissas(law, (int64_t)ldexp(gain[FOC_LAW_KP], 15 - exponent),
                          (int64_t)ldexp(gain[FOC_LAW_KI], 15 - exponent), 15 - exponent);
    return true;
}

void foc_law_reset(struct foc_law *law)
{
    law->v = law->error = 0;
}

int64_t foc_law_step(struct foc_law *law, int64_t error)
{
    int64_t most = (int64_t)FOC_VQ_MAX << law->shift;

    error = control_clamp(error, INT16_MIN, INT16_MAX);
    law->v += (error - law->error) * law->kp + (error + law->error) * law->ki;
    law->v = control_clamp(law->v, -most, most);
    law->error = error;
    return law->v >> law->shift;
}

int64_t foc_limiter_step(struct foc_limiter *limiter, const struct foc_law *law, int64_t vq,
                         int64_t current_ma, int64_t peak_ma)
{
    int64_t error, most = (int64_t)(2 * FOC_VQ_MAX) << law->shift;

    if (current_ma > peak_ma) {
        limiter->side = 1;
    } else if (current_ma < -peak_ma) {
        limiter->side = -1;
    }
    if (!limiter->side) {
        return vq;
    }
    error = control_clamp(limiter->side * peak_ma - current_ma, INT16_MIN, INT16_MAX);
    limiter->v += (error - limiter->error) * law->kp + (error + limiter->error) * law->ki;
    limiter->v = control_clamp(limiter->v, -most, most);
    limiter->error = error;
    if (limiter->side * limiter->v >= 0) {
        *limiter = (struct foc_limiter){0};
    }
    return vq + (limiter->v >> law->shift);
}

void foc_position_reset(struct foc_position_law *law)
{
    law->integral = law->error = 0.0;
}

/* Returns a value within +-limit. */
static double foc_clamp(double value, double limit)
{
    return fmax(fmin(value, limit), -limit);
}

int64_t foc_position_step(struct foc_position_law *law, double error)
{
    const float *gain = law->gain;
    double limit =
        gain[FOC_PID_OUTPUT_LIMIT] > 0.0f ? (double)gain[FOC_PID_OUTPUT_LIMIT] : FOC_PWM_MAX;
    double integral_limit =
        gain[FOC_PID_INTEGRAL_LIMIT] > 0.0f ? (double)gain[FOC_PID_INTEGRAL_LIMIT] : limit;
    double out;
    int32_t vq = 0;

    law->integral = foc_clamp(law->integral + (double)gain[FOC_PID_KI] * error, integral_limit);
    out = (double)gain[FOC_PID_KP] * error + law->integral +
          (double)gain[FOC_PID_KD] * (error - law->error);
    law->error = error;
    control_quantize(foc_clamp(out, limit) / (1 << FOC_VQ_SHIFT), &vq);
    return vq;
}
