/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Plain Runge-Kutta on the pendulums' equation of motion in closed form: one angle, no plant, and
 * no compensated summation. A row of bodies that turn as one is a single pendulum with
 *     I = sum I_b + m_b (reach + com)^2,  s = sum m_b (reach + com),  I a'' = -g s sin a:
 * 6.5 and 1 for one body, 49 and 10 for both.
 */
#include "app/bench/pendulum.h"

#include <math.h>

enum { STAGES_MAX = 4 };

/* An explicit method: the weights of its stages, and of the earlier ones in each. */
struct method {
    size_t stages;
    double inner[STAGES_MAX][STAGES_MAX], weight[STAGES_MAX];
};

/* The third-order and the fourth-order rule of Kutta, Beitrag zur naeherungsweisen Integration
 * totaler Differentialgleichungen, 1901 */
static const struct method methods[2] = {
    {3, {{0.0}, {0.5}, {-1.0, 2.0}}, {1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0}},
    {4, {{0.0}, {0.5}, {0.0, 0.5}, {0.0, 0.0, 1.0}}, {1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0}},
};

/* A pendulum in closed form: I a'' = -moment sin a. */
struct swing {
    double inertia, moment;
    double angle, rate;
};

/* Returns the start of one body, or of two that turn as one. */
static struct swing swing_start(size_t bodies)
{
    return bodies == 1
               ? (struct swing){.inertia = 6.5, .moment = 1.0, .rate = PENDULUM_START_SPEED}
               : (struct swing){.inertia = 49.0, .moment = 10.0, .rate = PENDULUM_START_SPEED};
}

/* Computes the energy of a pendulum. */
static double swing_energy(const struct swing *swing)
{
    return 0.5 * swing->inertia * swing->rate * swing->rate - swing->moment * cos(swing->angle);
}

/* Takes a step by an explicit method. */
static void swing_step(struct swing *swing, const struct method *method, double dt)
{
    double rate[STAGES_MAX], pull[STAGES_MAX], angle_sum = 0.0, rate_sum = 0.0;

    for (size_t i = 0; i < method->stages; i++) {
        double angle = swing->angle;

        rate[i] = swing->rate;
        for (size_t j = 0; j < i; j++) {
            angle += dt * method->inner[i][j] * rate[j];
            rate[i] += dt * method->inner[i][j] * pull[j];
        }
        pull[i] = -swing->moment / swing->inertia * sin(angle);
        angle_sum += method->weight[i] * rate[i];
        rate_sum += method->weight[i] * pull[i];
    }
    swing->angle += dt * angle_sum;
    swing->rate += dt * rate_sum;
}

/* Returns the method of an order. */
static const struct method *method_of(enum pendulum_order order)
{
    return &methods[order == PENDULUM_RK4];
}

double pendulum_plain_energy(size_t bodies, enum pendulum_order order, double dt)
{
    struct swing swing = swing_start(bodies);
    double start = swing_energy(&swing), worst = 0.0;
    size_t steps = (size_t)llround(PENDULUM_TABLE_UNITS / dt);

    for (size_t k = 0; k < steps; k++) {
        double energy;

        swing_step(&swing, method_of(order), dt);
        energy = swing_energy(&swing);
        worst = fmax(worst, fabs((energy - start) / energy));
    }
    return worst;
}

double pendulum_linear_period_error(void)
{
    struct swing swing = swing_start(2);
    double dt = PENDULUM_PERIOD_STEP, period = pendulum_analytic_period(), last = 0.0, worst = 0.0;
    size_t steps = (size_t)llround(PENDULUM_PERIOD_UNITS / dt);
    int turns = 0;

    /* The end of a turn is where the straight line between two steps passes it */
    for (size_t k = 0; k < steps; k++) {
        double before = swing.angle, goal = 2.0 * M_PI * (turns + 1);

        swing_step(&swing, method_of(PENDULUM_RK4), dt);
        if (swing.angle >= goal) {
            double now = dt * ((double)k + (goal - before) / (swing.angle - before));

            worst = fmax(worst, fabs(now - last - period));
            last = now;
            turns++;
        }
    }
    return worst;
}
