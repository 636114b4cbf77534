/* SPDX-License-Identifier: Apache-2.0 */
/* A small rig's names for the tests of faults and their fuzzer: four joints, of which the last has
 * a cylinder, two sensors, two buses, two boards. */
#ifndef TESTS_UNIT_FAULTS_NAMES_H
#define TESTS_UNIT_FAULTS_NAMES_H

#include "faults/faults.h"

static const char *const joints[] = {"LHipSag", "LKneeSag", "hand", "lf_kfe"};
static const bool driven[] = {true, true, false, true};
static const bool hydraulic[] = {false, false, false, true};
static const char *const fts[] = {"l_leg_ft", "r.leg.ft"};
static const char *const buses[] = {"left_leg", "torso"};
static const bool wire[] = {true, false};
static const char *const boards[] = {"left_leg/0x01", "ankle"};
static const size_t board_bus[] = {0, 0};
static const int board_address[] = {1, 13};

static const struct fault_names names = {
    .njoint = 4,
    .joint = joints,
    .driven = driven,
    .hydraulic = hydraulic,
    .oil_store = true,
    .nft = 2,
    .ft = fts,
    .imu = true,
    .nbus = 2,
    .bus = buses,
    .wire = wire,
    .nboard = 2,
    .board = boards,
    .board_bus = board_bus,
    .board_address = board_address,
};

#endif
