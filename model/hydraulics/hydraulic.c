/* SPDX-License-Identifier: Apache-2.0 */
/* Computes the equations of one servo valve with its cylinder. */
#include "model/hydraulics/hydraulic.h"

#include "base/portable_math.h"

#include <math.h>

/* Pressure difference below which the flow of a port is linear (laminar), Pa. */
#define LAMINAR_PA 1e5

/* Number of parts of a span. Largest number of Newton steps per stage; two or three are usual. */
enum { SPAN_PARTS = 4, NEWTON_STEPS = 20 };

/* Newton's method ends at a pressure step below this value, Pa. Each step squares the error
 * relative to LAMINAR_PA, so the remaining error is only rounding. */
#define NEWTON_END_PA 1e-2

/* Coefficient of the scheme, 1 - 1/sqrt(2). */
#define SCHEME_GAMMA 0.29289321881345247560

/* ---- geometry, friction ---- */

/* Computes the distance between the cylinder's pins (m) by the law of cosines, and its derivative
 * with respect to the joint's angle, *lever (m/rad). */
static double find_pin_distance(const struct robot_hydraulic *cylinder, double sine, double cosine,
                                double *lever)
{
    const double a = cylinder->base, b = cylinder->arm;
    const double length = sqrt(a * a + b * b - 2.0 * a * b * cosine);

    *lever = a * b * sine / length;
    return length;
}

double hydraulic_length(const struct robot_hydraulic *cylinder, double q, double *lever)
{
    double sine, cosine;

    portable_sincos(q + cylinder->offset, &sine, &cosine);
    return find_pin_distance(cylinder, sine, cosine, lever);
}

double hydraulic_direction(const struct robot_hydraulic *cylinder, double lower, double upper)
{
    double lever;

    hydraulic_length(cylinder, 0.5 * (lower + upper), &lever);
    return lever < 0.0 ? -1.0 : 1.0;
}

double hydraulic_speed_constant(const struct robot_hydraulic *cylinder,
                                const struct robot_hydraulic_supply *supply, double lower,
                                double upper)
{
    const double A1 = cylinder->A1, A2 = cylinder->A2, drop = supply->pressure - supply->back;
    const double cubes = A1 * A1 * A1 + A2 * A2 * A2;
    double lever, out, in;

    hydraulic_length(cylinder, 0.5 * (lower + upper), &lever);
    /* Compute the speeds without load in both directions. Both ports are in series across the
     * supply; their flows have the ratio of the areas */
    out = cylinder->K * sqrt(drop * A1 / cubes);
    in = cylinder->K * sqrt(drop * A2 / cubes);
    return cylinder->valve_v * fabs(lever) / (0.5 * (out + in));
}

enum error_code hydraulic_check(const struct robot_hydraulic *cylinder, double lower, double upper,
                                struct error *error)
{
    enum { PLACES = 64 };
    double sign = 0.0;

    for (int i = 0; i <= PLACES; i++) {
        const double q = lower + (upper - lower) * i / PLACES;
        double lever, x = hydraulic_length(cylinder, q, &lever) - cylinder->closed;

        if (!(x >= 0.0 && x <= cylinder->stroke)) {
            return error_set(error, ERROR_INPUT,
                             "found the piston at %.4g m of its stroke of %.4g m with the joint at "
                             "%.4g rad, expected it within",
                             x, cylinder->stroke, q);
        }
        if (lever == 0.0 || lever * sign < 0.0) {
            return error_set(error, ERROR_INPUT,
                             "found a dead point of the cylinder near %.4g rad, expected none in "
                             "the joint's range",
                             q);
        }
        sign = lever;
    }
    return ERROR_NONE;
}

/* Returns the friction at piston speed v, N, and its slope against v. */
static double cylinder_friction(const struct robot_hydraulic *cylinder, double v, double *slope)
{
    const double c = cylinder->coulomb_speed, root = sqrt(v * v + c * c);

    *slope = cylinder->viscous + cylinder->coulomb * c * c / (root * root * root);
    return cylinder->viscous * v + cylinder->coulomb * v / root;
}

double hydraulic_torque(const struct robot_hydraulic *cylinder, const double *state, double q,
                        double qd)
{
    double lever, slope;

    hydraulic_length(cylinder, q, &lever);
    return lever * (state[HYDRAULIC_P1] * cylinder->A1 - state[HYDRAULIC_P2] * cylinder->A2 -
                    cylinder_friction(cylinder, lever * qd, &slope));
}

/* ---- chambers and flows ---- */

/* Return the smaller and the larger of two numbers. They are faster than fmin and fmax, which also
 * handle NAN. */
static inline double take_less(double x, double y)
{
    return x < y ? x : y;
}

static inline double take_more(double x, double y)
{
    return x > y ? x : y;
}

/* Computes the volumes of both chambers (m3) for a length between the pins. Beyond the ends of the
 * stroke the volumes stay constant. */
static void cylinder_volumes(const struct robot_hydraulic *cylinder, double length, double V[2])
{
    const double x = take_less(take_more(length - cylinder->closed, 0.0), cylinder->stroke);

    V[0] = cylinder->dead + cylinder->A1 * x;
    V[1] = cylinder->dead + cylinder->A2 * (cylinder->stroke - x);
}

/* Returns the energy of oil at a pressure, J per m3: beta (exp(p/beta) - 1) - p, to the third
 * order. */
static double oil_energy(double beta, double p)
{
    return p * p / (2.0 * beta) * (1.0 + p / (3.0 * beta));
}

double hydraulic_energy(const struct robot_hydraulic *cylinder, const double *state, double q)
{
    double V[2], lever;

    cylinder_volumes(cylinder, hydraulic_length(cylinder, q, &lever), V);
    return V[0] * oil_energy(cylinder->beta, state[HYDRAULIC_P1]) +
           V[1] * oil_energy(cylinder->beta, state[HYDRAULIC_P2]);
}

/* Returns f(dp) of a port and its slope. */
static double orifice_root(double dp, double *slope)
{
    const double square = dp * dp + LAMINAR_PA * LAMINAR_PA, quarter = sqrt(sqrt(square));

    *slope = (0.5 * dp * dp + LAMINAR_PA * LAMINAR_PA) / (square * quarter);
    return dp / quarter;
}

/* Flows into both chambers: from the valve, past the piston, and from the return. */
struct chamber_flows {
    /* flow from the valve, and its slope against the chamber's own pressure, negative */
    double valve[2], valve_slope[2];
    double suction[2], suction_slope[2];
    /* leakage from chamber 1 to 2, and its slope against the pressure difference */
    double leak, leak_slope;
    int fed; /* index of the chamber that is connected to the supply */
};

/* Computes the flows into both chambers (m3/s) at the pressures p for an opening of the spool. */
static void find_chamber_flows(const struct robot_hydraulic *cylinder, double spool,
                               const struct hydraulic_port *port, const double p[2],
                               struct chamber_flows *flows)
{
    const double cut = take_less(1.0, fabs(spool)), open = take_more(0.0, cut - cylinder->lap);
    const double K = cylinder->K * open / (1.0 - cylinder->lap);
    const double suck = cylinder->K / sqrt(LAMINAR_PA);

    flows->fed = spool > 0.0 ? 0 : 1;
    /* One chamber is connected to the supply, the other to the return. A chamber also draws oil
     * from the return if its pressure falls below the return pressure */
    for (int i = 0; i < 2; i++) {
        const double from = i == flows->fed ? port->supply : port->back;
        double slope;

        flows->valve[i] = K * orifice_root(from - p[i], &slope);
        flows->valve_slope[i] = -K * slope;
        flows->suction[i] = suck * take_more(0.0, port->back - p[i]);
        flows->suction_slope[i] = p[i] < port->back ? -suck : 0.0;
    }
    flows->leak_slope = cylinder->leakage + port->leak;
    flows->leak = flows->leak_slope * (p[0] - p[1]);
}

/* Computes the powers of these flows, W. v: speed of the piston, m/s. */
static void find_hydraulic_power(const struct robot_hydraulic *cylinder,
                                 const struct chamber_flows *flows,
                                 const struct hydraulic_port *port, const double p[2], double v,
                                 struct hydraulic_power *power)
{
    const double drawn = flows->valve[flows->fed];
    const double returned = flows->valve[1 - flows->fed] + flows->suction[0] + flows->suction[1];
    double carried = 0.0, slope;

    /* Oil that flows into or out of a chamber carries its energy */
    for (int i = 0; i < 2; i++) {
        carried +=
            (p[i] + oil_energy(cylinder->beta, p[i])) * (flows->valve[i] + flows->suction[i]);
    }
    power->in = port->supply * drawn + port->back * returned;
    power->orifice = power->in - carried;
    power->leakage = flows->leak * (p[0] + oil_energy(cylinder->beta, p[0]) - p[1] -
                                    oil_energy(cylinder->beta, p[1]));
    power->mechanical = (p[0] * cylinder->A1 - p[1] * cylinder->A2) * v;
    power->friction = cylinder_friction(cylinder, v, &slope) * v;
    power->drawn = drawn;
}

/* Computes the rates of both pressures, Pa/s. V: chamber volumes; v: piston speed. */
static void find_pressure_rates(const struct robot_hydraulic *cylinder,
                                const struct chamber_flows *flows, const double V[2], double v,
                                double rate[2])
{
    rate[0] = cylinder->beta / V[0] *
              (flows->valve[0] + flows->suction[0] - flows->leak - cylinder->A1 * v);
    rate[1] = cylinder->beta / V[1] *
              (flows->valve[1] + flows->suction[1] + flows->leak + cylinder->A2 * v);
}

/* ---- the spool ---- */

/* Returns the target opening of the spool, -1 to 1. */
static double spool_target(const struct robot_hydraulic *cylinder,
                           const struct hydraulic_port *port)
{
    return take_more(-1.0, take_less(1.0, port->voltage / cylinder->valve_v + port->shift));
}

/* The exact motion of the spool over t seconds: a damped oscillation about the target. */
struct spool_motion {
    double M[2][2]; /* matrix for (opening - target, rate) */
};

/* Computes the exact motion of the spool over t seconds (damped oscillator). */
static struct spool_motion find_spool_motion(const struct robot_hydraulic *cylinder, double t)
{
    const double zeta = cylinder->valve_damping, decay = zeta * cylinder->valve_w;
    const double w = cylinder->valve_w * sqrt(1.0 - zeta * zeta);
    const double shrink = portable_exp(-decay * t);
    double sine, cosine;

    portable_sincos(w * t, &sine, &cosine);
    return (struct spool_motion){
        {{shrink * (cosine + decay / w * sine), shrink / w * sine},
         {-shrink * (decay * decay + w * w) / w * sine, shrink * (cosine - decay / w * sine)}}};
}

void hydraulic_derive(const struct robot_hydraulic *cylinder, const double *state,
                      const struct hydraulic_port *port, double *derivative,
                      struct hydraulic_power *power)
{
    const double *p = state + HYDRAULIC_P1, w = cylinder->valve_w;
    struct chamber_flows flows;
    double V[2], lever, v;

    cylinder_volumes(cylinder, hydraulic_length(cylinder, port->q, &lever), V);
    v = lever * port->qd;
    derivative[HYDRAULIC_SPOOL] = port->stuck ? 0.0 : state[HYDRAULIC_SPOOL_RATE];
    derivative[HYDRAULIC_SPOOL_RATE] =
        port->stuck ? 0.0
                    : w * w * (spool_target(cylinder, port) - state[HYDRAULIC_SPOOL]) -
                          2.0 * cylinder->valve_damping * w * state[HYDRAULIC_SPOOL_RATE];
    find_chamber_flows(cylinder, state[HYDRAULIC_SPOOL], port, p, &flows);
    find_pressure_rates(cylinder, &flows, V, v, derivative + HYDRAULIC_P1);
    if (power) {
        find_hydraulic_power(cylinder, &flows, port, p, v, power);
    }
}

/* ---- through a span ---- */

/* Solves two linear equations M x = b by Cramer's rule. */
static void solve_two(double M[2][2], const double b[2], double x[2])
{
    const double det = M[0][0] * M[1][1] - M[0][1] * M[1][0];

    x[0] = (M[1][1] * b[0] - M[0][1] * b[1]) / det;
    x[1] = (M[0][0] * b[1] - M[1][0] * b[0]) / det;
}

/* Geometry at a time in a span: the triangle's angle, the lever and the chambers. */
struct span_place {
    double sine, cosine, lever, V[2];
};

/* Rotates the geometry by an angle with this sine and cosine. */
static void turn_place(const struct robot_hydraulic *cylinder, double sine, double cosine,
                       struct span_place *place)
{
    const double s = place->sine, c = place->cosine;

    place->sine = s * cosine + c * sine;
    place->cosine = c * cosine - s * sine;
    cylinder_volumes(
        cylinder, find_pin_distance(cylinder, place->sine, place->cosine, &place->lever), place->V);
}

/* Solves one stage of h seconds from the pressures `base` by Newton's method. Fills p and flows at
 * the stage. Also advances bend, the derivatives of the pressures with respect to the joint's
 * rate. */
static void solve_pressure_stage(const struct robot_hydraulic *cylinder,
                                 const struct hydraulic_port *port, const struct span_place *place,
                                 double spool, const double base[2], double h, double p[2],
                                 struct chamber_flows *flows, double bend[2])
{
    const double *V = place->V, lever = place->lever;
    double rate[2], M[2][2], left[2], step[2], begin[2] = {bend[0], bend[1]};

    for (int k = 0; k < NEWTON_STEPS; k++) {
        find_chamber_flows(cylinder, spool, port, p, flows);
        find_pressure_rates(cylinder, flows, V, lever * port->qd, rate);

        /* Fill the matrix 1 - h J; J: Jacobian of both pressures' rates */
        for (int i = 0; i < 2; i++) {
            const double stiff = h * cylinder->beta / V[i];

            M[i][i] =
                1.0 - stiff * (flows->valve_slope[i] + flows->suction_slope[i] - flows->leak_slope);
            M[i][1 - i] = -stiff * flows->leak_slope;
        }
        for (int i = 0; i < 2; i++) {
            left[i] = base[i] + h * rate[i] - p[i];
        }
        solve_two(M, left, step);
        p[0] += step[0];
        p[1] += step[1];
        if (fabs(step[0]) + fabs(step[1]) < NEWTON_END_PA) {
            break;
        }
    }

    /* Update the flows for the last small step of the pressures, by their slopes. Compute the
     * derivatives with the same matrix */
    for (int i = 0; i < 2; i++) {
        flows->valve[i] += flows->valve_slope[i] * step[i];
        flows->suction[i] += flows->suction_slope[i] * step[i];
    }
    flows->leak += flows->leak_slope * (step[0] - step[1]);
    begin[0] -= h * cylinder->beta / V[0] * cylinder->A1 * lever;
    begin[1] += h * cylinder->beta / V[1] * cylinder->A2 * lever;
    solve_two(M, begin, bend);
}

/* Adds weight times the powers at a stage to work. */
static void account_stage_power(const struct robot_hydraulic *cylinder,
                                const struct chamber_flows *flows,
                                const struct hydraulic_port *port, const double p[2], double v,
                                double weight, struct hydraulic_power *work)
{
    struct hydraulic_power power;

    find_hydraulic_power(cylinder, flows, port, p, v, &power);
    work->in += weight * power.in;
    work->mechanical += weight * power.mechanical;
    work->orifice += weight * power.orifice;
    work->leakage += weight * power.leakage;
    work->friction += weight * power.friction;
    work->drawn += weight * power.drawn;
}

void hydraulic_advance(const struct robot_hydraulic *cylinder, const struct hydraulic_port *port,
                       double t, double *state, struct hydraulic_power *power, double *slope)
{
    const double h = t / SPAN_PARTS, share[2] = {1.0 - SCHEME_GAMMA, SCHEME_GAMMA};
    const double ahead[2] = {SCHEME_GAMMA * h, (1.0 - SCHEME_GAMMA) * h};
    const double target = spool_target(cylinder, port);
    struct spool_motion motion[2];
    struct span_place place;
    double *p = state + HYDRAULIC_P1, bend[2] = {0.0, 0.0}, sine[2], cosine[2], damping;

    /* All parts have equal length, joint rotation and spool motion */
    portable_sincos(port->q + cylinder->offset, &place.sine, &place.cosine);
    for (int s = 0; s < 2; s++) {
        portable_sincos(ahead[s] * port->qd, &sine[s], &cosine[s]);
        motion[s] = find_spool_motion(cylinder, ahead[s]);
    }

    for (int part = 0; part < SPAN_PARTS; part++) {
        double base[2] = {p[0], p[1]}, first[2] = {bend[0], bend[1]};
        const double begun[2] = {p[0], p[1]}, bent[2] = {bend[0], bend[1]};
        struct chamber_flows flows;

        for (int s = 0; s < 2; s++) {
            /* The base of the second stage extends the slope of the first stage over the remaining
             * time of the part */
            for (int i = 0; s == 1 && i < 2; i++) {
                base[i] = begun[i] + share[0] / share[1] * (p[i] - begun[i]);
                bend[i] = bent[i] + share[0] / share[1] * (first[i] - bent[i]);
            }
            if (!port->stuck) {
                /* Advance the spool's opening and rate by this motion */
                const double off = state[HYDRAULIC_SPOOL] - target,
                             rate = state[HYDRAULIC_SPOOL_RATE];

                state[HYDRAULIC_SPOOL] =
                    target + motion[s].M[0][0] * off + motion[s].M[0][1] * rate;
                state[HYDRAULIC_SPOOL_RATE] = motion[s].M[1][0] * off + motion[s].M[1][1] * rate;
            }
            turn_place(cylinder, sine[s], cosine[s], &place);
            solve_pressure_stage(cylinder, port, &place, state[HYDRAULIC_SPOOL], base,
                                 SCHEME_GAMMA * h, p, &flows, bend);
            first[0] = bend[0];
            first[1] = bend[1];
            if (power) {
                account_stage_power(cylinder, &flows, port, p, place.lever * port->qd, share[s] * h,
                                    power);
            }
        }
    }
    /* Compute the slope of the torque against the rate, from pressures and friction */
    if (slope) {
        cylinder_friction(cylinder, place.lever * port->qd, &damping);
        *slope = take_less(0.0, place.lever * (cylinder->A1 * bend[0] - cylinder->A2 * bend[1] -
                                               place.lever * damping));
    }
}

/* ---- at rest ---- */

void hydraulic_rest(const struct robot_hydraulic *cylinder, const struct robot_hydraulic_supply *s,
                    double *state)
{
    const double p1 = s->pressure * cylinder->A2 / (cylinder->A1 + cylinder->A2);

    state[HYDRAULIC_SPOOL] = state[HYDRAULIC_SPOOL_RATE] = 0.0;
    state[HYDRAULIC_P1] = p1;
    state[HYDRAULIC_P2] = p1 * cylinder->A1 / cylinder->A2;
}

bool hydraulic_rest_loaded(const struct robot_hydraulic *cylinder,
                           const struct robot_hydraulic_supply *s, double q, double torque,
                           double *state)
{
    double free[HYDRAULIC_STATE], lever, force, p1, p2;

    hydraulic_length(cylinder, q, &lever);
    force = torque / lever;
    hydraulic_rest(cylinder, s, free);
    /* Share the force between both chambers. If one pressure reaches its limit, the other chamber
     * takes the remaining force */
    p2 = free[HYDRAULIC_P2] - 0.5 * force / cylinder->A2;
    p2 = take_less(take_more(p2, s->back), s->pressure);
    p1 = (force + p2 * cylinder->A2) / cylinder->A1;
    if (p1 < s->back || p1 > s->pressure) {
        p1 = take_less(take_more(p1, s->back), s->pressure);
        p2 = (p1 * cylinder->A1 - force) / cylinder->A2;
    }
    if (!(p2 >= s->back && p2 <= s->pressure)) {
        return false;
    }
    state[HYDRAULIC_SPOOL] = state[HYDRAULIC_SPOOL_RATE] = 0.0;
    state[HYDRAULIC_P1] = p1;
    state[HYDRAULIC_P2] = p2;
    return true;
}
