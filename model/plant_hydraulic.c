/* SPDX-License-Identifier: Apache-2.0 */
/* Hydraulic joints in the plant's state: enum hydraulic_part for each cylinder, then the pressure
 * of their common supply. */
#include "model/plant_private.h"

#include <math.h>

/* Returns the state of cylinder c. */
static double *cylinder_state(const struct plant *plant, double *state, size_t c)
{
    return state + plant->at.hydraulic + HYDRAULIC_STATE * c;
}

/* Returns the piston's direction under a positive voltage, 1 or -1. */
static double cylinder_direction(const struct plant *plant, size_t c)
{
    const struct robot_joint *joint = &plant->config.robot->joint[plant->hydraulic_joint[c]];

    return hydraulic_direction(&joint->hydraulic, joint->lower, joint->upper);
}

struct hydraulic_port plant_hydraulic_port(const struct plant *plant, const double *state, size_t c)
{
    const size_t j = plant->hydraulic_joint[c];
    const struct motor_command *motor = &plant->command.motor[j];

    return (struct hydraulic_port){.q = plant_joint_position(plant, state, j),
                                   .qd = plant_joint_rate(plant, state, j),
                                   .voltage = plant->valve_voltage[c],
                                   .supply = state[plant_hydraulic_supply(plant)],
                                   .back = plant->config.robot->hydraulic_supply.back,
                                   .shift = motor->valve_shift * cylinder_direction(plant, c),
                                   .leak = motor->piston_leak,
                                   .stuck = motor->condition & DRIVE_VALVE_STUCK};
}

void plant_hydraulic_reset(struct plant *plant)
{
    const struct robot *robot = plant->config.robot;

    if (plant->nhydraulic == 0) {
        return;
    }
    for (size_t c = 0; c < plant->nhydraulic; c++) {
        hydraulic_rest(&robot->joint[plant->hydraulic_joint[c]].hydraulic, &robot->hydraulic_supply,
                       cylinder_state(plant, plant->state, c));
        plant->valve_voltage[c] = 0.0;
    }
    plant->state[plant_hydraulic_supply(plant)] = robot->hydraulic_supply.pressure;
}

bool plant_hydraulic_load(struct plant *plant, size_t c, double torque)
{
    const struct robot *robot = plant->config.robot;
    const size_t j = plant->hydraulic_joint[c];

    plant->valve_voltage[c] = 0.0;
    plant->command.motor[j].bridge_on = true;
    plant->command.motor[j].voltage_v = 0.0;
    return hydraulic_rest_loaded(&robot->joint[j].hydraulic, &robot->hydraulic_supply,
                                 plant_joint_position(plant, plant->state, j), torque,
                                 cylinder_state(plant, plant->state, c));
}

void plant_hydraulic_hold(struct plant *plant)
{
    for (size_t c = 0; c < plant->nhydraulic; c++) {
        const size_t j = plant->hydraulic_joint[c];
        const struct motor_command *motor = &plant->command.motor[j];
        const bool driven =
            motor->bridge_on && !isnan(motor->voltage_v) && !(motor->condition & DRIVE_VALVE_OFF);

        plant->valve_voltage[c] = driven ? motor->voltage_v * cylinder_direction(plant, c) : 0.0;
        if (motor->condition & DRIVE_VALVE_STUCK) {
            cylinder_state(plant, plant->state, c)[HYDRAULIC_SPOOL_RATE] = 0.0;
        }
    }
}

double plant_hydraulic_torque(const struct plant *plant, const double *state, size_t c)
{
    const size_t j = plant->hydraulic_joint[c];

    return hydraulic_torque(
        &plant->config.robot->joint[j].hydraulic, state + plant->at.hydraulic + HYDRAULIC_STATE * c,
        plant_joint_position(plant, state, j), plant_joint_rate(plant, state, j));
}

void plant_hydraulic_sample(struct plant *plant)
{
    for (size_t c = 0; c < plant->nhydraulic; c++) {
        const size_t j = plant->hydraulic_joint[c];
        const double valve_v = plant->config.robot->joint[j].hydraulic.valve_v;
        const double *y = cylinder_state(plant, plant->state, c);
        struct motor_sense *motor = &plant->sensors.motor[j];

        motor->torque_nm = plant_hydraulic_torque(plant, plant->state, c);
        motor->voltage_v =
            fmax(fmin(plant->valve_voltage[c], valve_v), -valve_v) * cylinder_direction(plant, c);
        motor->pressure_pa[0] = y[HYDRAULIC_P1];
        motor->pressure_pa[1] = y[HYDRAULIC_P2];
        motor->valve_opening = fmax(fmin(y[HYDRAULIC_SPOOL], 1.0), -1.0);
    }
    plant->sensors.oil_pa = plant->state[plant_hydraulic_supply(plant)];
}

double plant_hydraulic_energy(const struct plant *plant, const double *state)
{
    const struct robot *robot = plant->config.robot;
    double energy = 0.0;

    for (size_t c = 0; c < plant->nhydraulic; c++) {
        const size_t j = plant->hydraulic_joint[c];

        energy += hydraulic_energy(&robot->joint[j].hydraulic,
                                   state + plant->at.hydraulic + HYDRAULIC_STATE * c,
                                   plant_joint_position(plant, state, j));
    }
    if (plant->nhydraulic > 0) {
        energy +=
            hydraulic_supply_energy(&robot->hydraulic_supply, state[plant_hydraulic_supply(plant)]);
    }
    return energy;
}

void plant_hydraulic_account(const struct hydraulic_power *power, double supply, double *work)
{
    work[WORK_HYDRAULIC] += power->in - supply * power->drawn;
    work[WORK_ORIFICE] += power->orifice;
    work[WORK_LEAKAGE] += power->leakage;
    work[WORK_CYLINDER] += power->friction;
}

void plant_hydraulic_account_supply(const struct hydraulic_supply_power *power, double *work)
{
    work[WORK_HYDRAULIC] += power->pump;
    work[WORK_RELIEF] += power->relief;
    work[WORK_LEAKAGE] += power->leak;
}

void plant_hydraulic_derive(const struct plant *plant, const double *state, double *derivative,
                            double *work)
{
    const struct robot *robot = plant->config.robot;
    const size_t at = plant_hydraulic_supply(plant);
    struct hydraulic_supply_power pump;
    double drawn = 0.0;

    for (size_t c = 0; c < plant->nhydraulic; c++) {
        const struct hydraulic_port port = plant_hydraulic_port(plant, state, c);
        struct hydraulic_power power;

        hydraulic_derive(&robot->joint[plant->hydraulic_joint[c]].hydraulic,
                         state + plant->at.hydraulic + HYDRAULIC_STATE * c, &port,
                         cylinder_state(plant, derivative, c), &power);
        drawn += power.drawn;
        if (work) {
            plant_hydraulic_account(&power, port.supply, work);
        }
    }
    /* Compute the rate of the common supply */
    derivative[at] = hydraulic_supply_derive(&robot->hydraulic_supply, &plant->command.oil,
                                             state[at], drawn, &pump);
    if (work) {
        plant_hydraulic_account_supply(&pump, work);
    }
}
