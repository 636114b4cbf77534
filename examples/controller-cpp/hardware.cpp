// SPDX-License-Identifier: Apache-2.0
#include "hardware.hpp"

Hardware::Hardware(std::vector<std::string> names, int period_ticks) : period_ticks_(period_ticks)
{
    for (auto &name : names) {
        joints.push_back(Joint{std::move(name)});
    }
}

Hardware::~Hardware()
{
    hil_client_close(&client_);
}

void Hardware::check(hil_client_code code) const
{
    if (code != HIL_CLIENT_OK) {
        throw HardwareError(code, client_.message);
    }
}

void Hardware::on_configure(const std::string &tables, const std::string &ready)
{
    hil_client_options options{};

    options.tables = tables.c_str();
    options.ready = ready.c_str();
    options.lockstep = true;
    check(hil_client_open(&client_, &options));
    for (auto &joint : joints) {
        joint.number = hil_client_find_joint(&client_, joint.name.c_str());
        if (joint.number < 0) {
            throw HardwareError(HIL_CLIENT_INPUT, "found no joint " + joint.name);
        }
    }
}

void Hardware::on_activate()
{
    std::vector<const char *> names;

    for (const auto &joint : joints) {
        names.push_back(joint.name.c_str());
    }
    check(hil_client_enable(&client_, names.data(), names.size(), HIL_CLIENT_VOLTAGE));
    read();
    for (auto &joint : joints) {
        joint.velocity = joint.voltage = 0.0;
    }
}

void Hardware::on_deactivate()
{
    check(hil_client_enable(&client_, nullptr, 0, HIL_CLIENT_OFF));
}

void Hardware::read()
{
    for (auto &joint : joints) {
        const double before = joint.position;
        hil_client_joint state;

        check(hil_client_read(&client_, joint.number, &state));
        joint.position = state.motor_position_rad;
        joint.effort = state.torque_nm;
        joint.velocity = (joint.position - before) / (period_ticks_ * 1e-3);
    }
}

void Hardware::write()
{
    for (const auto &joint : joints) {
        check(hil_client_command(&client_, joint.number, HIL_CLIENT_VOLTAGE, joint.voltage));
    }
    check(hil_client_step(&client_, period_ticks_));
}
