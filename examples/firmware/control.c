/* SPDX-License-Identifier: Apache-2.0 */
/* The trajectory is a polynomial of degree 5, at rest at both ends; the law is PI with the motor's
 * back-EMF (4.1 V s/rad behind the gear) fed forward, which damps as well: no D is needed. */
#include "control.h"

#include "boards.h"

#define GEAR 100.0f
#define TWO_PI 6.283185307f
#define SUPPLY_V 48.0f
#define TICK_S 0.001f

#define KP_V_PER_RAD 200.0f
#define KI_V_PER_RAD_S 400.0f
#define BACK_EMF_V_S_PER_RAD 4.1f
#define LIMIT_V 12.0f

static float angle_of(int32_t position_icubdeg)
{
    return (float)position_icubdeg * (TWO_PI / ICUBDEG_PER_TURN / GEAR);
}

static float clamp(float value, float limit)
{
    return value > limit ? limit : value < -limit ? -limit : value;
}

void control_hold(struct control *control, int32_t position_icubdeg)
{
    *control = (struct control){0};
    control->from = control->to = control->reference = angle_of(position_icubdeg);
}

void control_move(struct control *control, int16_t to_mrad, uint32_t ticks)
{
    control->from = control->reference;
    control->to = (float)to_mrad * 1e-3f;
    control->tick = 0;
    control->ticks = ticks;
}

void control_creep(struct control *control, int32_t urad)
{
    control->reference += (float)urad * 1e-6f;
    control->from = control->to = control->reference;
    control->speed = (float)urad * (1e-6f / TICK_S);
    control->ticks = control->tick = 0;
}

static void control_follow_trajectory(struct control *control)
{
    float before = control->reference, s;

    if (control->tick >= control->ticks) {
        return;
    }
    control->tick++;
    s = (float)control->tick / (float)control->ticks;
    control->reference = control->from + (control->to - control->from) * s * s * s *
                                             (10.0f + s * (-15.0f + s * 6.0f));
    control->speed = (control->reference - before) / TICK_S;
    if (control->tick == control->ticks) {
        control->reference = control->to;
        control->speed = 0.0f;
    }
}

int16_t control_step(struct control *control, int32_t position_icubdeg)
{
    float error, volts;

    control_follow_trajectory(control);
    error = control->reference - angle_of(position_icubdeg);
#ifdef BUG_INTEGRAL
    control->integral += KI_V_PER_RAD_S * TICK_S * error;
#else
    control->integral = clamp(control->integral + KI_V_PER_RAD_S * TICK_S * error, LIMIT_V / 2.0f);
#endif
    volts = KP_V_PER_RAD * error + control->integral + BACK_EMF_V_S_PER_RAD * control->speed;
    return (int16_t)(clamp(volts, LIMIT_V) * (TARGET_FULL / SUPPLY_V));
}

int16_t control_mrad(int32_t position_icubdeg)
{
    return (int16_t)(angle_of(position_icubdeg) * 1e3f);
}
