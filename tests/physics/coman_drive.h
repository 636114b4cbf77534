/* SPDX-License-Identifier: Apache-2.0 */
/* COMAN's series elastic drive, link-side constants, for the tests of the actuator's equations. */
#ifndef TESTS_PHYSICS_COMAN_DRIVE_H
#define TESTS_PHYSICS_COMAN_DRIVE_H

#include "model/drives/actuator.h"

static const struct robot_sea coman_drive = {
    .present = true,
    .J = 0.1387,
    .Dm = 0.19958,
    .Ks = 395.46,
    .Ds = 0.198,
    .N = 100.0,
    .Kt = 4.1,
    .Kw = 4.1,
    .R = 0.664,
    .L = 0.32e-3,
};

#endif
