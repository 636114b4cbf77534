/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the effects of one drive beyond the paper's equations. */
#include "model/drives/effects.h"

#include "base/portable_math.h"
#include "model/stop.h"

#include <math.h>

/* Temperature for which R, Kt and Kw of a robot file are given, degree C. */
#define REFERENCE_C 25.0

/* Smallest part of the torque constant that remains in a hot motor. */
#define KT_LEAST 0.1

/* ---- functions of the motor's angle ---- */

/* Returns the mean of a sine over an interval of phase, as a part of its value at the middle. */
static double sine_mean(double half)
{
    return half == 0.0 ? 1.0 : portable_sin(half) / half;
}

/* Returns the sum of sines of the motor's angle (rad at the link; N rotor turns each): its mean
 * over the angles within `half` of qm. */
static double sum_harmonics(const struct robot_harmonic *harmonic, size_t count, double N,
                            double qm, double half)
{
    double sum = 0.0;

    for (size_t i = 0; i < count; i++) {
        double rate = harmonic[i].per_turn * N;

        sum += harmonic[i].amplitude * sine_mean(rate * half) *
               portable_sin(rate * qm + harmonic[i].phase);
    }
    return sum;
}

/* Returns the mean of the derivative of the sum of sines with respect to qm. */
static double slope_harmonics(const struct robot_harmonic *harmonic, size_t count, double N,
                              double qm, double half)
{
    double sum = 0.0;

    for (size_t i = 0; i < count; i++) {
        double rate = harmonic[i].per_turn * N;

        sum += harmonic[i].amplitude * rate * sine_mean(rate * half) *
               portable_cos(rate * qm + harmonic[i].phase);
    }
    return sum;
}

double effects_deflection(const struct robot_sea *sea, double qm, double q)
{
    return qm - q + sum_harmonics(sea->effects->error, sea->effects->nerror, sea->N, qm, 0.0);
}

/* Returns the mean of 1 + e', the gear's local ratio, over the angles within `half` of qm. */
static double gear_slope(const struct robot_sea *sea, double qm, double half)
{
    return 1.0 + slope_harmonics(sea->effects->error, sea->effects->nerror, sea->N, qm, half);
}

/* Returns the mean of the cogging torque over the angles within `half` of qm. */
static double cogging_torque(const struct robot_sea *sea, double qm, double half)
{
    return sum_harmonics(sea->effects->cogging, sea->effects->ncogging, sea->N, qm, half);
}

/* Returns the energy W of the cogging torque, J: c = -dW/dqm. */
static double cogging_energy(const struct robot_sea *sea, double qm)
{
    double energy = 0.0;

    for (size_t i = 0; i < sea->effects->ncogging; i++) {
        const struct robot_harmonic *harmonic = &sea->effects->cogging[i];
        double rate = harmonic->per_turn * sea->N;

        energy += harmonic->amplitude / rate * portable_cos(rate * qm + harmonic->phase);
    }
    return energy;
}

/* ---- spring behind the play, friction, temperature ---- */

/* Returns the bend of the spring, rad: the deflection beyond the play. */
static double spring_bend(const struct robot_sea *sea, double deflection)
{
    double play = 0.5 * sea->effects->backlash;

    return fabs(deflection) > play ? deflection - copysign(play, deflection) : 0.0;
}

/* Returns the depth of the bent spring in its stop, rad. */
static double bend_depth(const struct robot_sea *sea, double bend)
{
    return sea->stop.stiffness > 0.0 ? stop_depth(-sea->deflection, sea->deflection, bend) : 0.0;
}

/* Returns whether the spring has hysteresis; a broken one (Ks = 0) has none. */
static bool has_hysteresis(const struct robot_sea *sea)
{
    return sea->effects->hysteresis > 0.0 && sea->Ks > 0.0;
}

/* Computes the spring's torque tau_s (N m) for a bend and its rate. *elastic receives the part that
 * stores energy. With play, the tooth flanks touch on one side and only push. */
static double spring_push(const struct robot_sea *sea, double bend, double rate, double *elastic)
{
    double depth = bend_depth(sea, bend), torque;

    *elastic = sea->Ks * bend - stop_torque(&sea->stop, depth, 0.0);
    if (sea->effects->backlash == 0.0) {
        return sea->Ks * bend + sea->Ds * rate - stop_torque(&sea->stop, depth, rate);
    }
    if (bend == 0.0) {
        return 0.0;
    }
    torque = sea->Ks * bend + sea->Ds * rate - stop_torque(&sea->stop, depth, rate);
    return torque * bend > 0.0 ? torque : 0.0;
}

/* tau, and the factors of tau that depend on the motor's angle. */
struct gear_state {
    double slope, rate, torque; /* 1 + e', d', tau */
};

/* Computes deflection rate and torque of gear and spring in a state. */
static struct gear_state find_gear(const struct robot_sea *sea, const struct effects_state *state,
                                   double q, double qd)
{
    const double bend = spring_bend(sea, effects_deflection(sea, state->sea.qm, q));
    struct gear_state gear = {.slope = gear_slope(sea, state->sea.qm, 0.0)};
    double elastic;

    gear.rate = gear.slope * state->sea.qmd - qd;
    gear.torque = spring_push(sea, bend, gear.rate, &elastic) +
                  (has_hysteresis(sea) ? state->hysteresis : 0.0);
    return gear;
}

double effects_torque(const struct robot_sea *sea, const struct effects_state *state, double q,
                      double qd)
{
    return find_gear(sea, state, q, qd).torque;
}

/* Returns whether friction depends on the torques carried. */
static bool has_load_friction(const struct robot_load_friction *load)
{
    return load->motor > 0.0 || load->external > 0.0 || load->motor_stribeck > 0.0 ||
           load->external_stribeck > 0.0 || load->motor_quadratic > 0.0 ||
           load->external_quadratic > 0.0;
}

bool effects_sticks(const struct robot_sea *sea)
{
    return sea->effects->presliding == 0.0 &&
           (sea->effects->breakaway > 0.0 || has_load_friction(&sea->effects->load));
}

double effects_limit_grip(double grip, double friction)
{
    return fmin(fmax(grip, -friction), friction);
}

double effects_grip_energy(const struct robot_sea *sea, double grip)
{
    const double stiffness = sea->effects->presliding;

    return stiffness > 0.0 ? 0.5 * grip * grip / stiffness : 0.0;
}

/* Returns the friction from the torques carried, N m. near_rest is 1 at rest and falls to 0 with
 * the speed. The shares apply to the difference of both torques. The two torques oppose each other
 * while a motor holds a load. */
static double load_friction(const struct robot_load_friction *load,
                            const struct effects_carried *carried, double near_rest)
{
    const double M = carried->motor, T = carried->external;
    double friction = fabs(load->external * T - load->motor * M) +
                      near_rest * fabs(load->external_stribeck * T - load->motor_stribeck * M);

    /* Add the square of the smaller torque, if the torques oppose each other */
    if (M * T < 0.0) {
        friction += near_rest * (fabs(T) < fabs(M)   ? load->external_quadratic * T * T
                                 : fabs(T) > fabs(M) ? load->motor_quadratic * M * M
                                                     : 0.0);
    }
    return friction;
}

/* Returns the value of the Stribeck curve at a speed: 1 at rest, 0 at high speed. */
static double stribeck_dip(const struct robot_effects *effects, double speed)
{
    const double x = speed / effects->stribeck;

    if (effects->stribeck_exponent == 0.0) {
        return portable_exp(-x * x);
    }
    return portable_exp(-portable_pow(fabs(x), effects->stribeck_exponent));
}

double effects_friction(const struct robot_sea *sea, double speed,
                        const struct effects_carried *carried)
{
    const struct robot_effects *effects = sea->effects;
    double dip = 0.0, friction = effects->breakaway;

    if (effects->stribeck > 0.0) {
        dip = stribeck_dip(effects, speed);
        friction = effects->coulomb + (effects->breakaway - effects->coulomb) * dip;
    }
    return has_load_friction(&effects->load)
               ? friction + load_friction(&effects->load, carried, dip)
               : friction;
}

double effects_skin(const struct robot_sea *sea, double speed)
{
    return sea->effects && sea->effects->skin > 0.0 ? sea->effects->skin * sqrt(fabs(speed)) : 0.0;
}

double effects_winding(const struct robot_sea *sea, const struct effects_state *state)
{
    const struct robot_thermal *thermal = &sea->effects->thermal;
    const double R = thermal->winding_k_w > 0.0
                         ? sea->R * (1.0 + thermal->R_per_k * (state->winding_c - REFERENCE_C))
                         : sea->R;

    return R + effects_skin(sea, state->sea.qmd);
}

double effects_resistance(const struct robot_sea *sea, const struct effects_state *state)
{
    return effects_winding(sea, state) + sea->effects->bridge_ohm;
}

double effects_saturation(const struct robot_sea *sea, double I)
{
    const double most = sea->effects ? sea->effects->saturation : 0.0;

    return most > 0.0 ? most / sqrt(most * most + I * I) : 1.0;
}

double effects_current(const struct robot_sea *sea, double torque)
{
    const double most = sea->effects ? sea->effects->saturation : 0.0, I = torque / sea->Kt;
    const double share = most > 0.0 ? I / most : 0.0;

    return fabs(share) >= 1.0 ? copysign(INFINITY, I) : I / sqrt(1.0 - share * share);
}

/* Returns the factor of Kt and Kw at a housing temperature, degree C, and a current. */
static double field_strength(const struct robot_sea *sea, double housing_c, double I)
{
    const struct robot_thermal *thermal = &sea->effects->thermal;
    const double saturated = effects_saturation(sea, I);

    return thermal->winding_k_w > 0.0
               ? saturated * fmax(KT_LEAST, 1.0 + thermal->Kt_per_k * (housing_c - REFERENCE_C))
               : saturated;
}

double effects_damping(const struct robot_sea *sea, double I)
{
    return sea->effects ? sea->Dm + sea->effects->iron * I * I : sea->Dm;
}

double effects_hysteresis(const struct robot_sea *sea, double z, double way, double *loss)
{
    double sigma = sea->effects->hysteresis_stiffness, goal, part, end;

    *loss = 0.0;
    if (!has_hysteresis(sea) || way == 0.0) {
        return has_hysteresis(sea) ? z : 0.0;
    }
    /* Use the exact solution of Dahl's equation over a distance in one direction. The loss is the
     * work minus the stored energy */
    goal = copysign(sea->effects->hysteresis, way);
    part = -portable_expm1(-sigma * fabs(way) / sea->effects->hysteresis);
    end = z + (goal - z) * part;
    *loss = goal * way - (goal - z) * part * goal / sigma - 0.5 * (end * end - z * z) / sigma;
    return end;
}

/* ---- the equations ---- */

/* Returns the torque on the rotor without the gear's friction, N m. */
static double rotor_load(const struct robot_sea *sea, const struct effects_state *state,
                         const struct gear_state *gear)
{
    return field_strength(sea, state->housing_c, state->sea.I) * sea->Kt * state->sea.I -
           gear->slope * gear->torque + cogging_torque(sea, state->sea.qm, 0.0);
}

/* Returns the torques that the gear carries in a state. */
static struct effects_carried gear_carries(const struct robot_sea *sea,
                                           const struct effects_state *state,
                                           const struct gear_state *gear)
{
    return (struct effects_carried){
        .motor = field_strength(sea, state->housing_c, state->sea.I) * sea->Kt * state->sea.I,
        .external = -gear->slope * gear->torque,
    };
}

struct effects_carried effects_carried(const struct robot_sea *sea,
                                       const struct effects_state *state, double q, double qd)
{
    const struct gear_state gear = find_gear(sea, state, q, qd);

    return gear_carries(sea, state, &gear);
}

static int sign_of(double x)
{
    return (x > 0.0) - (x < 0.0);
}

struct effects_mode effects_find_mode(const struct robot_sea *sea,
                                      const struct effects_state *state, double q, double qd,
                                      const struct effects_bridge *bridge)
{
    struct effects_mode mode = {.slide = 1, .flow = bridge->conducts};

    /* A rotor at rest breaks away in the direction of its load, or stays at rest */
    if (effects_sticks(sea)) {
        mode.slide = sign_of(state->sea.qmd);
        if (mode.slide == 0) {
            struct gear_state gear = find_gear(sea, state, q, qd);
            struct effects_carried carried = gear_carries(sea, state, &gear);
            double load = rotor_load(sea, state, &gear);

            mode.slide = fabs(load) > effects_friction(sea, 0.0, &carried) ? sign_of(load) : 0;
        }
    } else if (sea->effects->presliding > 0.0) {
        const struct effects_carried carried = effects_carried(sea, state, q, qd);
        const double friction = effects_friction(sea, state->sea.qmd, &carried);

        mode.slide = fabs(state->grip) >= friction && state->grip * state->sea.qmd > 0.0
                         ? sign_of(state->grip)
                         : 0;
    }

    /* A current starts to flow if the voltage exceeds hold */
    if (bridge->conducts && bridge->hold > 0.0) {
        mode.flow = sign_of(state->sea.I);
        if (mode.flow == 0) {
            double Kw = field_strength(sea, state->housing_c, state->sea.I) * sea->Kw;
            double drive = bridge->voltage - Kw * state->sea.qmd;

            mode.flow = fabs(drive) > bridge->hold ? sign_of(drive) : 0;
        }
    }
    return mode;
}

/* Computes the rates of both temperatures (K/s) under a heating power, W. */
static void warm_rates(const struct robot_thermal *thermal, double power,
                       const struct effects_state *state, struct effects_state *rate)
{
    double passed;

    rate->winding_c = rate->housing_c = 0.0;
    if (thermal->winding_k_w > 0.0) {
        passed = (state->winding_c - state->housing_c) / thermal->winding_k_w;
        rate->winding_c = (power - passed) / thermal->winding_j_k;
        rate->housing_c =
            (passed - (state->housing_c - thermal->ambient_c) / thermal->housing_k_w) /
            thermal->housing_j_k;
    }
}

double effects_current_rate(const struct robot_sea *sea, const struct effects_state *state,
                            const struct effects_bridge *bridge, const struct effects_mode *mode)
{
    const double Kw = field_strength(sea, state->housing_c, state->sea.I) * sea->Kw;

    return mode->flow != 0 ? (bridge->voltage - bridge->hold * mode->flow -
                              effects_resistance(sea, state) * state->sea.I - Kw * state->sea.qmd) /
                                 sea->L
                           : 0.0;
}

double effects_steady_voltage(const struct robot_sea *sea, const struct effects_state *state,
                              const struct effects_bridge *bridge)
{
    return effects_resistance(sea, state) * state->sea.I +
           field_strength(sea, state->housing_c, state->sea.I) * sea->Kw * state->sea.qmd +
           (state->sea.I < 0.0 ? -bridge->hold : bridge->hold);
}

void effects_derivative(const struct robot_sea *sea, const struct effects_state *state, double q,
                        double qd, const struct effects_bridge *bridge,
                        const struct effects_mode *mode, struct effects_state *derivative)
{
    double qmd = state->sea.qmd, I = state->sea.I;
    struct gear_state gear = find_gear(sea, state, q, qd);
    struct effects_carried carried = gear_carries(sea, state, &gear);
    const bool bends = sea->effects->presliding > 0.0 && mode->slide == 0;
    const double limit = effects_friction(sea, qmd, &carried);
    const double grip = effects_limit_grip(state->grip, limit);

    /* Compute the rates of the rotor and of the deflection */
    derivative->sea = (struct sea_state){0};
    if (mode->slide != 0 || bends) {
        const double friction = bends ? grip : mode->slide * limit;

        derivative->sea.qm = qmd;
        derivative->sea.qmd =
            (rotor_load(sea, state, &gear) - effects_damping(sea, I) * qmd - friction) / sea->J;
    }
    derivative->grip =
        bends && (fabs(grip) < limit || grip * qmd < 0.0) ? sea->effects->presliding * qmd : 0.0;
    derivative->hysteresis =
        has_hysteresis(sea)
            ? sea->effects->hysteresis_stiffness *
                  (gear.rate - fabs(gear.rate) * state->hysteresis / sea->effects->hysteresis)
            : 0.0;

    /* Compute the rates of the winding */
    derivative->sea.I = effects_current_rate(sea, state, bridge, mode);
    warm_rates(&sea->effects->thermal, effects_winding(sea, state) * (I * I + bridge->ripple),
               state, derivative);
}

/* ---- implicit Euler ---- */

/* Limits of the iterations for the speed, and for the means that depend on the speed. */
enum { SPEED_ITERATIONS = 100, FRICTION_ITERATIONS = 8, MEAN_ITERATIONS = 30 };

/* Relative residual, and relative change, at which the iterations end. */
#define SPEED_END 4e-16
#define MEAN_END 1e-12

/* Part of the torques that a residual may have. A larger one is a jump of the flanks' torque. */
#define JUMP_RESIDUAL 1e-9

/* The equation of the speed v at the end of a step, resistance v + ratio tau(v) + f(v) = push,
 * where f is friction sgn v or the grip. Its left side rises with v. */
struct speed_equation {
    double h, qd;
    double deflection; /* at the start of the step */
    double ratio;      /* mean of 1 + e' over the step */
    double resistance; /* of rotor and winding against a change of speed, N m s/rad */
    double push;       /* torque on the rotor at v = 0 without spring and friction */
    double friction;
    double grip, bending; /* at the start of the step; its derivative with respect to v, or 0 */
};

/* Returns the torque of friction at a speed, whose sign is `sense` if friction is rigid. *damping
 * receives its derivative. */
static double find_end_grip(const struct speed_equation *equation, double v, double sense,
                            double *damping)
{
    const double grip = equation->grip + equation->bending * v;
    const bool bends = equation->bending > 0.0 && fabs(grip) < equation->friction;

    *damping = bends ? equation->bending : 0.0;
    return equation->bending > 0.0 ? effects_limit_grip(grip, equation->friction)
                                   : sense * equation->friction;
}

/* Returns tau at a speed of the rotor. *damping receives its derivative with respect to d', *z the
 * hysteresis. */
static double find_end_torque(const struct robot_sea *sea, const struct speed_equation *equation,
                              double hysteresis, double v, double *damping, double *z)
{
    const double rate = equation->ratio * v - equation->qd, way = equation->h * rate;
    const double bend = spring_bend(sea, equation->deflection + way);
    const struct sea_spring spring = sea_spring_at(sea, bend, rate);
    const bool play = sea->effects->backlash > 0.0;
    double torque = spring.Ks * bend + spring.Ds * rate + spring.offset;

    *damping = equation->h * spring.Ks + spring.Ds;
    if (play && torque * bend <= 0.0) {
        torque = *damping = 0.0;
    }
    *z = 0.0;
    if (has_hysteresis(sea)) {
        const double sigma = sea->effects->hysteresis_stiffness, limit = sea->effects->hysteresis;
        const double yield = 1.0 + sigma * fabs(way) / limit;

        *z = (hysteresis + sigma * way) / yield;
        *damping += equation->h * sigma * (1.0 - copysign(*z / limit, *z * way)) / yield;
    }
    return torque + *z;
}

/* Solves the equation by Newton's method within bounds. Writes torque, slope, hysteresis and grip
 * at the end. Returns the speed. */
static double solve_speed(const struct robot_sea *sea, const struct speed_equation *equation,
                          double hysteresis, double guess, struct effects_end *end)
{
    const double ratio = equation->ratio;
    const bool rigid = equation->bending == 0.0;
    double damping, *z = &end->state.hysteresis, low = 0.0, high, v, rest = 0.0, scale = 0.0;
    double G = equation->resistance, grip, gripping, held;

    /* The rotor stops if friction holds the load at rest */
    end->torque = find_end_torque(sea, equation, hysteresis, 0.0, &damping, z);
    end->slope = -damping;
    held = rigid ? 0.0 : find_end_grip(equation, 0.0, 0.0, &gripping);
    const double load = equation->push - ratio * end->torque - held;
    const double sense = load > 0.0 ? 1.0 : -1.0;

    if (rigid && fabs(load) <= equation->friction) {
        return 0.0;
    }
    high = (fabs(load) - (rigid ? equation->friction : 0.0)) / G;
    v = fmin(fmax(sense * guess, 0.0), high);
    for (int i = 0; i < SPEED_ITERATIONS; i++) {
        double next;

        end->torque = find_end_torque(sea, equation, hysteresis, sense * v, &damping, z);
        grip = find_end_grip(equation, sense * v, sense, &gripping);
        rest = G * v - sense * (equation->push - ratio * end->torque) + sense * grip;
        scale = G * v + fabs(equation->push) +
                ratio * (fabs(end->torque) + damping * (ratio * v + fabs(equation->qd)));
        if (fabs(rest) <= SPEED_END * scale) {
            break;
        }
        next = v - rest / (G + gripping + ratio * ratio * damping);
        *(rest > 0.0 ? &high : &low) = v;
        next = next > low && next < high ? next : 0.5 * (low + high);
        if (next == v) {
            break;
        }
        v = next;
    }
    if (!rigid) {
        end->state.grip = grip;
        G += gripping;
    }
    end->slope = -damping * G / (G + ratio * ratio * damping);
    /* At a jump of the flanks' torque, the rotor's motion determines the torque */
    if (fabs(rest) > JUMP_RESIDUAL * scale) {
        end->torque -= sense * rest / ratio;
        end->slope = -G / (ratio * ratio);
    }
    return sense * v;
}

/* Returns the winding in an implicit step under the current controller. */
static struct loop_step loop_step_of(const struct robot_sea *sea,
                                     const struct effects_bridge *bridge, double h, double length,
                                     const struct effects_state *begin)
{
    return (struct loop_step){.loop = bridge->loop,
                              .R = effects_resistance(sea, begin),
                              .L = sea->L,
                              .Kw = field_strength(sea, begin->housing_c, begin->sea.I) * sea->Kw,
                              .hold = bridge->hold,
                              .t = bridge->begin_s,
                              .h = h,
                              .length = length,
                              .I = begin->sea.I,
                              .qm = begin->sea.qm};
}

double effects_loop_current(const struct robot_sea *sea, const struct effects_bridge *bridge,
                            double h, double length, const struct effects_state *begin,
                            const struct effects_end *end)
{
    const struct loop_step step = loop_step_of(sea, bridge, h, length, begin);
    const struct loop_line line = loop_linearize(&step, &end->regime);

    return line.I - line.yield * end->state.sea.qmd;
}

void effects_step_implicit(const struct robot_sea *sea, const struct effects_bridge *bridge,
                           double h, double q, double qd, bool keeps_friction,
                           const struct effects_state *begin, struct effects_end *end)
{
    const struct robot_effects *effects = sea->effects;
    const double qm = begin->sea.qm, J_h = sea->J / h;
    const bool varies = effects->nerror > 0 || effects->ncogging > 0 || effects->stribeck > 0.0 ||
                        effects->saturation > 0.0 || effects->iron > 0.0 || effects->skin > 0.0 ||
                        has_load_friction(&effects->load);
    struct effects_mode mode = effects_find_mode(sea, begin, q, qd, bridge);
    struct effects_carried carried = effects_carried(sea, begin, q, qd);
    struct speed_equation equation = {.h = h,
                                      .qd = qd,
                                      .deflection = effects_deflection(sea, qm, q),
                                      .ratio = gear_slope(sea, qm, 0.0),
                                      .grip = begin->grip,
                                      .bending = h * effects->presliding};
    const struct loop_step step = loop_step_of(sea, bridge, h, h, begin);
    double cogging = cogging_torque(sea, qm, 0.0);
    double v = begin->sea.qmd, current = begin->sea.I, last;

    *end = (struct effects_end){.state = *begin};
    equation.friction = effects_friction(sea, v, &carried);
    for (int i = 0; i < MEAN_ITERATIONS; i++) {
        /* The step is passive for any strength, damping and resistance, so use the values of the
         * last state */
        const double winding = sea->L + h * effects_resistance(sea, &end->state);
        const double strength = field_strength(sea, begin->housing_c, end->state.sea.I);
        const double Kt = strength * sea->Kt;
        double I =
            mode.flow != 0
                ? (sea->L * current + h * (bridge->voltage - bridge->hold * mode.flow)) / winding
                : current;
        double yield = mode.flow != 0 ? h * strength * sea->Kw / winding : 0.0;

        if (bridge->loop) {
            const struct loop_line line = loop_linearize(&step, &end->regime);

            I = line.I;
            yield = line.yield;
        }

        equation.resistance = J_h + effects_damping(sea, end->state.sea.I) + Kt * yield;
        equation.push = J_h * begin->sea.qmd + Kt * I + cogging;
        last = v;
        v = solve_speed(sea, &equation, begin->hysteresis, v, end);
        end->state.sea = (struct sea_state){.qm = qm + h * v, .qmd = v, .I = I - yield * v};
        if (bridge->loop && loop_revise_regime(&step, v, &end->regime)) {
            continue;
        }
        /* A current that would change its sign against the lost voltage ends: solve without it */
        if (!bridge->loop && bridge->hold > 0.0 && end->state.sea.I * mode.flow < 0.0) {
            current = mode.flow = 0;
            continue;
        }
        if (!varies || (i > 0 && fabs(v - last) <= MEAN_END * fabs(v))) {
            break;
        }
        /* Use the means of gear error and cogging over the step, which conserve energy */
        equation.ratio = gear_slope(sea, qm + 0.5 * h * v, 0.5 * h * v);
        cogging = cogging_torque(sea, qm + 0.5 * h * v, 0.5 * h * v);
        /* Friction by load may have no fixed point. Any friction is passive: keep the last one */
        if (i < FRICTION_ITERATIONS && !keeps_friction) {
            carried = (struct effects_carried){.motor = Kt * end->state.sea.I,
                                               .external = -equation.ratio * end->torque};
            equation.friction = effects_friction(sea, v, &carried);
        }
    }
}

void effects_warm(const struct robot_sea *sea, double heat, double t, struct effects_state *state)
{
    const struct robot_thermal *thermal = &sea->effects->thermal;
    struct effects_state rate;
    double a, b, c, d, x, y, det;

    if (thermal->winding_k_w == 0.0) {
        return;
    }

    /* Trapezoidal rule: solve (1 - t/2 A) change = t rate, two rows, by Cramer's rule */
    warm_rates(thermal, heat / t, state, &rate);
    b = -0.5 * t / (thermal->winding_k_w * thermal->winding_j_k);
    a = 1.0 - b;
    c = -0.5 * t / (thermal->winding_k_w * thermal->housing_j_k);
    d = 1.0 - c + 0.5 * t / (thermal->housing_k_w * thermal->housing_j_k);
    x = t * rate.winding_c;
    y = t * rate.housing_c;
    det = a * d - b * c;
    state->winding_c += (d * x - b * y) / det;
    state->housing_c += (a * y - c * x) / det;
}

void effects_power_current(const struct robot_sea *sea, const struct effects_state *state,
                           const struct effects_bridge *bridge, const struct effects_mode *mode,
                           struct effects_power *power)
{
    const double I = state->sea.I, square = I * I + bridge->ripple;
    const double R = effects_winding(sea, state), R_b = sea->effects->bridge_ohm;
    const double switching = bridge->switching * fabs(I);

    power->electrical = (bridge->voltage - (bridge->hold - bridge->diodes) * mode->flow) * I +
                        switching + (R + R_b) * bridge->ripple + sea->effects->standby;
    power->bridge =
        bridge->diodes * mode->flow * I + switching + R_b * square + sea->effects->standby;
    power->joule = R * square;
}

void effects_power(const struct robot_sea *sea, const struct effects_state *state, double q,
                   double qd, const struct effects_bridge *bridge, const struct effects_mode *mode,
                   struct effects_power *power)
{
    struct effects_carried carried;
    double qmd = state->sea.qmd, elastic, push;
    double rate = gear_slope(sea, state->sea.qm, 0.0) * qmd - qd;

    effects_power_current(sea, state, bridge, mode, power);
    push = spring_push(sea, spring_bend(sea, effects_deflection(sea, state->sea.qm, q)), rate,
                       &elastic);
    power->motor = effects_damping(sea, state->sea.I) * qmd * qmd +
                   field_strength(sea, state->housing_c, state->sea.I) * (sea->Kw - sea->Kt) *
                       state->sea.I * qmd;
    carried = effects_carried(sea, state, q, qd);
    power->gear = mode->slide * effects_friction(sea, qmd, &carried) * qmd;
    power->spring_damping = (push - elastic) * rate;
    power->hysteresis = has_hysteresis(sea) ? fabs(rate) * state->hysteresis * state->hysteresis /
                                                  sea->effects->hysteresis
                                            : 0.0;
}

double effects_energy(const struct robot_sea *sea, const struct effects_state *state, double q)
{
    double bend = spring_bend(sea, effects_deflection(sea, state->sea.qm, q));
    double energy = 0.5 * (sea->L * state->sea.I * state->sea.I +
                           sea->J * state->sea.qmd * state->sea.qmd + sea->Ks * bend * bend) +
                    stop_energy(&sea->stop, bend_depth(sea, bend)) +
                    cogging_energy(sea, state->sea.qm);

    if (has_hysteresis(sea)) {
        energy += 0.5 * state->hysteresis * state->hysteresis / sea->effects->hysteresis_stiffness;
    }
    return energy + effects_grip_energy(sea, state->grip);
}

double effects_motor_rest(const struct robot_sea *sea, double q, double tau)
{
    double deflection = tau != 0.0 ? sea_deflection(sea, tau) : 0.0, qm = q + deflection;

    if (sea->effects) {
        if (tau != 0.0) {
            deflection += copysign(0.5 * sea->effects->backlash, tau);
        }
        /* Solve qm + e(qm) - q = d by Newton's method; |e'| is less than 1/2 */
        for (int i = 0; i < 8; i++) {
            qm -= (effects_deflection(sea, qm, q) - deflection) / gear_slope(sea, qm, 0.0);
        }
    }
    return qm;
}

/* ---- checks of parameters ---- */

/* Checks the parameters of a list of sines. */
static bool harmonics_are_possible(const struct robot_harmonic *harmonic, size_t count)
{
    for (size_t i = 0; i < count && count <= ROBOT_HARMONICS; i++) {
        if (!(harmonic[i].per_turn > 0.0) || !isfinite(harmonic[i].per_turn) ||
            !isfinite(harmonic[i].amplitude) || !isfinite(harmonic[i].phase)) {
            return false;
        }
    }
    return count <= ROBOT_HARMONICS;
}

/* Largest allowed |e'| of the gear's error. With a steeper error the output would not turn
 * uniformly. */
#define STEEPEST_ERROR 0.5

/* Checks whether the gear's error is less steep than STEEPEST_ERROR. */
static bool gear_is_possible(const struct robot_sea *sea)
{
    const struct robot_effects *effects = sea->effects;
    double steep = 0.0;

    for (size_t i = 0; i < effects->nerror; i++) {
        steep += fabs(effects->error[i].amplitude) * effects->error[i].per_turn * sea->N;
    }
    return steep <= STEEPEST_ERROR;
}

/* Checks that the thermal model has all constants or none. */
static bool thermal_is_possible(const struct robot_thermal *thermal)
{
    if (thermal->winding_k_w == 0.0) {
        return true;
    }
    return thermal->winding_k_w > 0.0 && thermal->housing_k_w > 0.0 && thermal->winding_j_k > 0.0 &&
           thermal->housing_j_k > 0.0 && thermal->R_per_k >= 0.0 && thermal->Kt_per_k <= 0.0 &&
           1.0 + thermal->R_per_k * (thermal->ambient_c - REFERENCE_C) > 0.0;
}

/* Checks the friction due to torques carried. */
static bool load_is_possible(const struct robot_effects *effects)
{
    const struct robot_load_friction *load = &effects->load;
    const bool at_rest = load->motor_stribeck > 0.0 || load->external_stribeck > 0.0 ||
                         load->motor_quadratic > 0.0 || load->external_quadratic > 0.0;

    return load->external >= 0.0 && load->external < 1.0 && load->motor_stribeck >= 0.0 &&
           load->external_stribeck >= 0.0 && load->motor_quadratic >= 0.0 &&
           load->external_quadratic >= 0.0 && (!at_rest || effects->stribeck > 0.0);
}

double effects_cogging_rate(const struct robot_sea *sea)
{
    double stiffness = 0.0;

    for (size_t i = 0; sea->effects && i < sea->effects->ncogging; i++) {
        const struct robot_harmonic *harmonic = &sea->effects->cogging[i];

        stiffness += fabs(harmonic->amplitude) * harmonic->per_turn * sea->N;
    }
    return sqrt(stiffness / sea->J);
}

enum error_code effects_check(const struct robot_sea *sea, struct error *error)
{
    const struct robot_effects *effects = sea->effects;

    /* Breakaway friction is at least Coulomb friction */
    if (!(effects->coulomb >= 0.0 && effects->breakaway >= effects->coulomb) ||
        (effects->breakaway > effects->coulomb && !(effects->stribeck > 0.0))) {
        return error_set(error, ERROR_INPUT,
                         "found gear friction of %g N m and a breakaway torque of %g N m at %g "
                         "rad/s, expected no less at rest, and a Stribeck speed between two",
                         effects->coulomb, effects->breakaway, effects->stribeck);
    }
    /* Friction that bends must exist */
    if (!(effects->presliding >= 0.0) || (effects->presliding > 0.0 && effects->breakaway == 0.0 &&
                                          !has_load_friction(&effects->load))) {
        return error_set(error, ERROR_INPUT,
                         "found a presliding stiffness of %g N m/rad without friction of the "
                         "gear, expected both",
                         effects->presliding);
    }
    /* A gear must not lose the whole motor torque, or it would never turn */
    if (!(effects->load.motor >= 0.0 && effects->load.motor < 1.0) ||
        !(effects->stribeck_exponent >= 0.0) ||
        (has_load_friction(&effects->load) && !load_is_possible(effects))) {
        return error_set(error, ERROR_INPUT,
                         "found friction by shares of %g of the motor's torque and %g of the "
                         "load's, expected shares below 1, and a Stribeck speed with those at rest",
                         effects->load.motor, effects->load.external);
    }
    /* Check play and hysteresis. Hysteresis needs both a torque and a stiffness */
    if (!(effects->backlash >= 0.0) || !(effects->hysteresis >= 0.0) ||
        (effects->hysteresis > 0.0) != (effects->hysteresis_stiffness > 0.0)) {
        return error_set(error, ERROR_INPUT,
                         "found hysteresis of %g N m with %g N m/rad, expected both or none",
                         effects->hysteresis, effects->hysteresis_stiffness);
    }
    /* Check the sines of the gear's error and of cogging */
    if (!harmonics_are_possible(effects->error, effects->nerror) ||
        !harmonics_are_possible(effects->cogging, effects->ncogging) || !gear_is_possible(sea)) {
        return error_set(error, ERROR_INPUT,
                         "found sines of the motor's angle that cannot be, expected no more than "
                         "%d each, and of the gear's error the sum of rad times per_turn times N "
                         "no more than %g",
                         ROBOT_HARMONICS, STEEPEST_ERROR);
    }
    /* Check the thermal model, then the bridge */
    if (!thermal_is_possible(&effects->thermal)) {
        return error_set(error, ERROR_INPUT,
                         "found a winding that warms up without two resistances to heat and two "
                         "heat capacities above zero, or one that does not conduct");
    }
    if (!(effects->dead_time >= 0.0 && effects->dead_time * effects->pwm <= 0.25) ||
        !(effects->switching >= 0.0 && effects->switching * effects->pwm <= 0.25) ||
        (effects->dead_time + effects->switching > 0.0 && !(effects->pwm > 0.0)) ||
        !(effects->bridge_ohm >= 0.0) || !(effects->diode >= 0.0)) {
        return error_set(error, ERROR_INPUT,
                         "found a dead time of %g s and %g s of switching at %g Hz, expected each "
                         "no more than a quarter of the period",
                         effects->dead_time, effects->switching, effects->pwm);
    }
    return ERROR_NONE;
}
