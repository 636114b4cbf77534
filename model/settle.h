/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Static equilibrium: a start without the transient of springs and contact layers that take up the
 * weight only once the run has begun.
 *
 * Given are the angles of the links, and with them the pose that a controller refers to. Solved for
 * are the heights and tilts of the base and of every free body at rest, until what carries each
 * balances its weight. What the joints then bear follows from inverse dynamics: each series spring
 * is deflected by tau/Ks (qm = q + tau/Ks; beyond its room it leans on its stop), each motor
 * carries I = tau/Kt and needs V = R I, each cylinder's oil is pressed behind a closed valve. A
 * joint without a drive that stands at a limit leans on the stop there, if its load presses it: its
 * angle gives way by tau over the stop's stiffness, and one with a passive spring leans on that.
 *
 * First without friction: place and heading (x, y, yaw) stay as they are given, and legs do not
 * push against each other through the ground, as those of a robot that came down on its feet may.
 * On level ground that is all. Where sideways forces remain, or nothing is found, as on a slope or
 * between hands, and friction sticks (contact/contact.h), the bodies start anew and move quasi-
 * statically, in all directions, to where friction balances what pushes them; the bristles are left
 * as the way there has bent them, so that the run begins at rest. Regularized friction is a law of
 * the sliding speed and carries nothing at rest: there the sideways forces must be small, else the
 * equilibrium is refused: it would slide. So is one that would not last, whatever the motors do:
 * with its joints locked the robot has to come back from a small tilt. Balance that rests on the
 * springs and on the controller is not looked at.
 */
#ifndef MODEL_SETTLE_H
#define MODEL_SETTLE_H

#include "model/plant.h"

struct settled {
    size_t iterations;
    double residual; /* largest force left over on a body, part of its weight */
    double sideways; /* the same across gravity, with what turns it */
    double rise_m;   /* rise of the base along up, m; 0 with a fixed base */
    double tilt_rad; /* tilt of the base, rad */
};

/* Puts the plant, as plant_reset left it, into equilibrium; energies count from there, the sensors
 * are sampled, and the command becomes the one that holds it: bridges on, voltages R I. Bodies that
 * start with a velocity are left alone. The clamp of a clamped robot then holds the rotors too, so
 * that the springs stay loaded while the bridges are off, and carries no load: the contacts and the
 * sensors feel the weight from the start (plant_clamp).
 *
 * Scratch from arena. ERROR_INPUT with the body or joint and the figure that tells why, and the
 * state as it was: nothing supports it, it tips over, it slides, a joint without a drive would
 * move, a motor would need more than the supply, no convergence; or the contact engine's failure.
 * Bodies are looked for support down to 0.2 m below their start. Not RT-safe. */
enum error_code plant_settle(struct plant *plant, struct arena *arena, struct settled *settled,
                             struct error *error);

#endif
