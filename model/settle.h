/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Static equilibrium: a start without the transient in which springs and contact layers take up the
 * weight.
 *
 * The angles of the links are given: the reference pose of a controller. The unknowns are the
 * heights and tilts of the base and of each free body at rest, at which the supports balance the
 * weights. The loads of the joints follow from inverse dynamics. Each series spring deflects by
 * tau/Ks (qm = q + tau/Ks) or presses its stop. Each motor carries I = tau/Kt and needs V = R I.
 * Each cylinder keeps its oil behind a closed valve. A joint without a drive at a limit presses the
 * stop there if its load has that direction: its angle changes by tau over the stop's stiffness. A
 * joint with a passive spring deflects that spring.
 *
 * The first search has no friction. Place and heading (x, y, yaw) stay as given, and the legs do
 * not push against each other through the ground, as they may after a landing. On level ground this
 * search is enough. On a slope or between hands, sideways forces remain or the first search finds
 * no equilibrium. If friction sticks (contact/contact.h), a second search then starts. The bodies
 * then move quasi-statically in all directions to where friction balances the forces. The bristles
 * keep the bend of this motion, so that the run begins at rest. Regularized friction depends on the
 * sliding speed and carries nothing at rest. With it, an equilibrium with large sideways forces is
 * refused, because the body would slide.
 *
 * An unstable equilibrium is refused too: with locked joints, the robot must return from a small
 * tilt. Balance by springs and controller is not considered.
 */
#ifndef MODEL_SETTLE_H
#define MODEL_SETTLE_H

#include "model/plant.h"

struct settled {
    size_t iterations;
    double residual; /* largest remaining force on a body, relative to its weight */
    /* largest remaining force across gravity and moment about gravity, relative to the weight */
    double sideways;
    double rise_m;   /* rise of the base along up, m; 0 with a fixed base */
    double tilt_rad; /* tilt of the base, rad */
};

/* Moves the plant, as left by plant_reset, into equilibrium. Energies count from there, the
 * sensors are sampled, and the command becomes the one that holds the equilibrium: bridges on,
 * voltages R I. Bodies that start with a velocity do not change. The clamp of a clamped robot then
 * also holds the rotors, so that the springs stay loaded while the bridges are off. This clamp
 * carries no load: contacts and sensors measure the weight from the start (plant_clamp).
 *
 * Scratch from arena. On failure returns ERROR_INPUT with the body or joint and the number that
 * shows the cause, or the contact engine's failure, and leaves the state unchanged. Causes: no
 * support, tipping over, sliding, a joint without a drive would move, a motor would need more than
 * the supply, no convergence. Support is searched down to 0.2 m below the start of a body. Not
 * RT-safe. */
enum error_code plant_settle(struct plant *plant, struct arena *arena, struct settled *settled,
                             struct error *error);

#endif
