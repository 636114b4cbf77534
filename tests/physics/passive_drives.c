/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Passive drives make no energy. Random drives with random effects, links and starts run without
 * input by the default integrator at its default step, with the bridge off or the winding shorted.
 * The test computes the energies itself. HIL_PASSIVE_DRIVES=10000 runs as many drives for 10 s each
 * instead of 2,000 for 40 ms; HIL_PASSIVE_CHAINS does so for chains, HIL_PASSIVE_SEED draws others.
 *
 * The links of a chain turn about one line or slide along it, and no weight acts. Their mass matrix
 * is constant, so the robot itself has no error of integration.
 */

#include "base/random.h"
#include "model/drives/effects.h"
#include "tests/physics/near.h"
#include "tests/physics/toy_plant.h"

enum { MS = 1000000, LINKS = 4, AT_DRIVE = 2, AT_EFFECT = AT_DRIVE + PLANT_DRIVE_STATE };

struct passive_drive {
    double inertia, passive; /* of the link, kg m2; of a spring beside the drive, N m/rad */
    struct robot_sea sea;
    struct robot_effects effects;
    double limit; /* of the joint to both sides, rad; 0: none */
    struct robot_stop stop;
    bool shorted;
    double q, qd, qm, qmd, hysteresis, grip; /* at the start */
};

static double log_uniform(struct random_stream *r, double low, double high)
{
    return low * pow(high / low, random_uniform(r));
}

static double uniform(struct random_stream *r)
{
    return 2.0 * random_uniform(r) - 1.0;
}

static bool coin(struct random_stream *r)
{
    return random_uniform(r) < 0.5;
}

static struct robot_stop draw_stop(struct random_stream *r, double Ks)
{
    const double stiffness = Ks * log_uniform(r, 1.0, 100.0);

    return (struct robot_stop){stiffness, 1e-4 * stiffness * random_uniform(r)};
}

/* Draws a drive whose spring bends by `scale` rad and carries Ks times as much. */
static struct passive_drive draw_drive(uint64_t seed)
{
    struct random_stream first = {seed}, s = {random_bits(&first)}, *r = &s;
    struct passive_drive d = {.inertia = log_uniform(r, 1e-6, 10.0),
                              .passive = coin(r) ? log_uniform(r, 0.1, 1e5) : 0.0,
                              .sea = {.present = true,
                                      .J = log_uniform(r, 1e-6, 1.0),
                                      .Dm = coin(r) ? log_uniform(r, 1e-5, 1.0) : 0.0,
                                      .Ks = log_uniform(r, 1.0, 1e7),
                                      .N = 100.0,
                                      .Kt = 4.1,
                                      .Kw = 4.1,
                                      .R = 0.664,
                                      .L = 0.32e-3}};
    const double Ks = d.sea.Ks, both = d.sea.J * d.inertia / (d.sea.J + d.inertia);
    const double scale = log_uniform(r, 1e-4, 0.1), torque = Ks * scale;
    const double steepest =
        EFFECTS_COGGING_SWING * EFFECTS_COGGING_SWING * 1e6 * d.sea.J / (24.0 * d.sea.N);
    struct robot_effects *e = &d.effects;

    d.sea.Ds = random_uniform(r) < 0.3 ? 0.0 : 2.0 * sqrt(Ks * both) * random_uniform(r);
    if (coin(r)) {
        e->coulomb = e->breakaway = torque * log_uniform(r, 1e-4, 1.0);
        if (coin(r)) {
            e->breakaway *= 1.0 + random_uniform(r);
            e->stribeck = log_uniform(r, 1e-3, 1.0);
        }
    }
    e->load.external = coin(r) ? 0.9 * random_uniform(r) : 0.0;
    e->backlash = coin(r) ? scale * log_uniform(r, 1e-2, 1.0) : 0.0;
    if (coin(r)) {
        e->hysteresis = torque * log_uniform(r, 1e-3, 1.0);
        e->hysteresis_stiffness = Ks * log_uniform(r, 1e-2, 10.0);
    }
    if (coin(r)) {
        e->ncogging = 1;
        e->cogging[0] =
            (struct robot_harmonic){24.0, fmin(torque * log_uniform(r, 1e-4, 1e-2), steepest), 0.0};
    }
    if (coin(r)) {
        e->nerror = 1;
        e->error[0] = (struct robot_harmonic){2.0, log_uniform(r, 1e-6, 2e-3), 1.0};
    }
    d.shorted = random_uniform(r) < 0.3;
    if (d.shorted && coin(r)) {
        e->pwm = 2e4;
        e->dead_time = 1e-6;
    }
    if (coin(r)) {
        d.sea.deflection = scale * log_uniform(r, 0.1, 1.0);
        d.sea.stop = draw_stop(r, Ks);
    }
    if (coin(r)) {
        d.limit = scale * log_uniform(r, 0.1, 1.0);
        d.stop = draw_stop(r, Ks);
    }
    d.q = scale * uniform(r);
    d.qm = d.q + scale * uniform(r);
    if (coin(r)) {
        d.qd = uniform(r) * fmin(100.0, scale * sqrt(Ks / d.inertia));
        d.qmd = uniform(r) * fmin(100.0, scale * sqrt(Ks / d.sea.J));
    }
    if (e->breakaway > 0.0 && coin(r)) {
        e->presliding = Ks * log_uniform(r, 1e-2, 1e3);
        d.grip = e->breakaway * uniform(r);
    }
    if (coin(r)) {
        e->saturation = log_uniform(r, 1e-3, 1e3);
        e->iron = log_uniform(r, 1e-6, 1e-2);
        e->skin = d.sea.R * log_uniform(r, 1e-3, 1.0);
    }
    return d;
}

/* Links on each other, one drive each; the first is on the ground or on a free base. */
struct passive_chain {
    int links;
    double base; /* inertia of a free base, kg m2 or kg; 0: none */
    bool slides;
    struct passive_drive drive[LINKS];
};

static struct passive_chain draw_chain(uint64_t seed)
{
    struct random_stream s = random_named(seed, "chain"), *r = &s;
    struct passive_chain c = {.links = 2 + (int)(random_bits(r) % 3),
                              .base = coin(r) ? log_uniform(r, 1e-6, 10.0) : 0.0,
                              .slides = coin(r)};

    for (int i = 0; i < c.links; i++) {
        c.drive[i] = draw_drive(random_bits(r));
    }
    return c;
}

/* Where the parts of a chain's state are. */
struct places {
    int base, q, v, drive, effect, effects;
};

static struct places find_places(const struct passive_chain *c)
{
    const int nq = c->base > 0.0 ? BASE_Q_COUNT : 0, nv = c->base > 0.0 ? BASE_V_COUNT : 0;
    struct places at = {.q = nq, .v = nq + c->links + nv, .effects = 3};

    at.base = nq + c->links + (c->slides ? BASE_V_LINEAR : BASE_V_ANGULAR) + 2;
    at.drive = at.v + c->links;
    at.effect = at.drive + PLANT_DRIVE_STATE * c->links;
    for (int i = 0; i < c->links; i++) {
        at.effects = c->drive[i].effects.presliding > 0.0 ? 4 : at.effects;
    }
    return at;
}

enum store {
    LINK,
    ROTOR,
    SPRING,
    PASSIVE,
    END_STOP,
    SPRING_STOP,
    WINDING,
    HYSTERESIS,
    COGGING,
    GRIP,
    STORES
};

static double stop_energy_at(const struct robot_stop *stop, double depth)
{
    return depth > 0.0 ? 0.5 * stop->stiffness * depth * depth : 0.0;
}

/* Computes the energies of a drive and its link, J. Returns a bound on their rounding errors: the
 * rounding errors of the angles times the torques. */
static double find_energies(const struct passive_drive *d, double q, double speed, const double *y,
                            const double *effect, double store[STORES])
{
    const struct robot_effects *e = &d->effects;
    const double qm = y[0], z = effect[0];
    const double error = e->error[0].amplitude * sin(2.0 * d->sea.N * qm + e->error[0].phase);
    const double bend = fmax(0.0, fabs(qm + error - q) - 0.5 * e->backlash);
    const double stiff = d->sea.Ks + e->hysteresis_stiffness + e->presliding;
    const double off = 4e-16 * (fabs(q) + fabs(qm)), grip = e->presliding > 0.0 ? effect[3] : 0.0;
    double rounding = 2.0 * stiff * off * (off + fabs(qm - q)) +
                      (e->cogging[0].amplitude + fabs(z) + fabs(grip)) * off;

    store[LINK] = 0.5 * d->inertia * speed * speed;
    store[ROTOR] = 0.5 * d->sea.J * y[1] * y[1];
    store[SPRING] = 0.5 * d->sea.Ks * bend * bend;
    store[PASSIVE] = 0.5 * d->passive * q * q;
    store[END_STOP] = d->limit > 0.0 ? stop_energy_at(&d->stop, fabs(q) - d->limit) : 0.0;
    store[SPRING_STOP] = stop_energy_at(&d->sea.stop, bend - d->sea.deflection);
    store[WINDING] = 0.5 * d->sea.L * y[2] * y[2];
    store[HYSTERESIS] = e->hysteresis > 0.0 ? 0.5 * z * z / e->hysteresis_stiffness : 0.0;
    store[COGGING] = e->cogging[0].amplitude / (24.0 * d->sea.N) * cos(24.0 * d->sea.N * qm);
    store[GRIP] = e->presliding > 0.0 ? 0.5 * grip * grip / e->presliding : 0.0;
    for (int i = 0; i < STORES; i++) {
        rounding += 2e-14 * fabs(store[i]);
    }
    return rounding;
}

/* The energies of a chain. A link's speed is the sum of the joints' rates, which may be large. */
struct chain_energy {
    double store[LINKS + 1][STORES], rounding;
};

static void find_chain_energy(const struct passive_chain *c, const double *y,
                              struct chain_energy *energy)
{
    const struct places at = find_places(c);
    double speed = c->base > 0.0 ? y[at.base] : 0.0, rates = fabs(speed);

    *energy = (struct chain_energy){.store = {{[LINK] = 0.5 * c->base * speed * speed}}};
    energy->rounding = 2e-14 * energy->store[0][LINK];
    for (int i = 0; i < c->links; i++) {
        speed += y[at.v + i];
        rates += fabs(y[at.v + i]);
        energy->rounding += 4e-16 * c->drive[i].inertia * rates * fabs(speed) * (c->links - 1);
        energy->rounding +=
            find_energies(&c->drive[i], y[at.q + i], speed, y + at.drive + PLANT_DRIVE_STATE * i,
                          y + at.effect + at.effects * i, energy->store[i + 1]);
    }
}

static void chain_open(struct toy_plant *p, const struct passive_chain *c)
{
    const double none[3] = {0.0, 0.0, 0.0}, z[3] = {0.0, 0.0, 1.0};
    const double inertia = c->base > 0.0 ? c->base : 1.0;
    const struct places at = find_places(c);
    const double upright[4] = {1.0, 0.0, 0.0, 0.0};
    double start[LINKS];

    toy_plant_begin(p, PLANT_IMPLICIT, MS);
    p->config.account_energy = false;
    toy_begin(&p->toy, c->base > 0.0, inertia, none,
              (const double[6]){inertia, 0.0, 0.0, inertia, 0.0, inertia});
    memset(p->toy.robot.gravity, 0, sizeof p->toy.robot.gravity);
    for (int i = 0; i < c->links; i++) {
        const struct passive_drive *d = &c->drive[i];
        const double I[6] = {d->inertia, 0.0, 0.0, d->inertia, 0.0, d->inertia};
        struct robot_joint *joint =
            &p->toy.joint[toy_add(&p->toy, i, c->slides ? JOINT_PRISMATIC : JOINT_REVOLUTE, z, none,
                                  d->inertia, none, I)];

        joint->sea = d->sea;
        joint->sea.effects = &d->effects;
        joint->upper = d->limit > 0.0 ? d->limit : 1e6;
        joint->lower = -joint->upper;
        joint->stop = d->stop;
        joint->passive.stiffness = d->passive;
        start[i] = d->q;
    }
    toy_plant_open(p);
    assert_ok(plant_reset(p->plant, none, upright, start));
    for (int i = 0; i < c->links; i++) {
        const struct passive_drive *d = &c->drive[i];
        double *y = p->state + at.drive + PLANT_DRIVE_STATE * i;
        double *effect = p->state + at.effect + at.effects * i;

        p->state[at.v + i] = d->qd;
        y[0] = d->qm;
        y[1] = d->qmd;
        effect[0] = d->hysteresis;
        if (d->effects.presliding > 0.0) {
            effect[3] = d->grip;
        }
        p->motor[i].bridge_on = d->shorted;
    }
}

/* Returns the largest gain of energy in a tick as a part of the energy that changed its place in
 * that tick. */
static double find_worst_gain(const struct passive_chain *c, int ticks)
{
    double worst = 0.0, turnover = 1.0;
    struct chain_energy energy[2];
    struct toy_plant p;

    chain_open(&p, c);
    find_chain_energy(c, p.state, &energy[0]);
    for (int k = 1; k <= ticks && turnover > 0.0; k++) {
        struct chain_energy *now = &energy[k % 2], *before = &energy[(k + 1) % 2];
        double gain = 0.0;

        assert_ok(plant_step(p.plant, 1));
        find_chain_energy(c, p.state, now);
        turnover = 0.0;
        for (int i = 0; i <= c->links; i++) {
            for (int s = 0; s < STORES; s++) {
                gain += now->store[i][s] - before->store[i][s];
                turnover += fabs(now->store[i][s] - before->store[i][s]);
            }
        }
        if (gain > now->rounding) {
            worst = fmax(worst, (gain - now->rounding) / turnover);
        }
    }
    arena_fini(&p.arena);
    return worst;
}

static struct passive_chain draw_alone(uint64_t seed)
{
    return (struct passive_chain){.links = 1, .drive = {draw_drive(seed)}};
}

/* Runs drawn chains; the variable `name` sets their number. Prints and counts those that gain. */
static void run_passive(const char *name, int usual, struct passive_chain (*draw)(uint64_t seed))
{
    const char *count = getenv(name), *seed = getenv("HIL_PASSIVE_SEED");
    const int runs = count ? atoi(count) : usual, ticks = count ? 10000 : 40;
    int gaining = 0;

    for (int n = 1; n <= runs; n++) {
        const struct passive_chain c = draw((seed ? strtoull(seed, NULL, 10) : 0) + (uint64_t)n);
        const double worst = find_worst_gain(&c, ticks);

        if (worst > 1e-9) {
            print_message("# number %d gains %.1e of its turnover in a tick\n", n, worst);
            gaining++;
        }
    }
    assert_int_equal(gaining, 0);
}

TEST(passive_drives_make_no_energy)
{
    run_passive("HIL_PASSIVE_DRIVES", 2000, draw_alone);
}

TEST(passive_chains_make_no_energy)
{
    run_passive("HIL_PASSIVE_CHAINS", 200, draw_chain);
}

/* A light link between a spring and a stiff drive with Coulomb friction: the rotor swings on both
 * springs in series. Friction F moves the middle of each half swing by F/K, damping multiplies the
 * rest by rho. */
TEST(light_link_behind_friction_decays_by_its_closed_form)
{
    const struct passive_drive d = {.inertia = 1e-3,
                                    .passive = 2425.0,
                                    .sea = {.present = true,
                                            .J = 0.0295,
                                            .Dm = 0.24,
                                            .Ks = 2e5,
                                            .Ds = 50.0,
                                            .N = 9.0,
                                            .Kt = 1.0,
                                            .Kw = 1.0,
                                            .R = 1.0,
                                            .L = 1e-3},
                                    .effects = {.coulomb = 0.03, .breakaway = 0.03},
                                    .q = 0.002,
                                    .qm = 0.002};
    const double share = d.sea.Ks / (d.sea.Ks + d.passive), K = share * d.passive;
    const double inertia = d.sea.J + d.inertia * share * share, f = d.effects.coulomb / K;
    const double D = d.sea.Dm + d.sea.Ds * (1.0 - share) * (1.0 - share);
    const double decay = 0.5 * D / inertia, rate = sqrt(K / inertia - decay * decay);
    const double rho = exp(-M_PI * decay / rate);
    double swing = d.qm, before = 0.0;
    int halves = 0;
    struct toy_plant p;

    chain_open(&p, &(struct passive_chain){.links = 1, .drive = {d}});
    for (int k = 0; k < 1500; k++) {
        const double *y = p.state + AT_DRIVE;

        assert_ok(plant_step(p.plant, 1));
        if (y[1] * before < 0.0) {
            const double found = sqrt(y[0] * y[0] + inertia / K * y[1] * y[1]);

            swing = (swing - f) * rho - f;
            halves++;
            assert_near(found, swing, 0.01 * swing + 0.5 * f);
        }
        before = y[1] != 0.0 ? y[1] : before;
    }
    print_message("# %d half swings, %.3g rad left\n", halves, swing);
    assert_true(halves > 30 && swing < 3.0 * f);
    assert_true(p.state[AT_DRIVE + 1] == 0.0 && fabs(p.state[AT_DRIVE]) <= 1.1 * f);
    arena_fini(&p.arena);
}
