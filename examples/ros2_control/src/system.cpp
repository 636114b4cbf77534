// SPDX-License-Identifier: Apache-2.0
#include "coman_hil_ros2/system.hpp"

#include <pluginlib/class_list_macros.hpp>
#include <rclcpp/logging.hpp>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <map>

namespace coman_hil_ros2
{

using hardware_interface::CallbackReturn;
using hardware_interface::return_type;

namespace
{

const std::map<std::string, hil_client_quantity> kQuantities = {
    {"voltage", HIL_CLIENT_VOLTAGE},
    {"current", HIL_CLIENT_CURRENT},
    {"position", HIL_CLIENT_POSITION},
};

rclcpp::Logger logger()
{
    return rclcpp::get_logger("coman_hil_ros2");
}

} // namespace

System::~System()
{
    hil_client_close(&client_);
}

bool System::succeeded(hil_client_code code)
{
    if (code != HIL_CLIENT_OK) {
        RCLCPP_ERROR(logger(), "%s", client_.message);
    }
    return code == HIL_CLIENT_OK;
}

std::string System::parameter(const std::string &name) const
{
    const auto found = info_.hardware_parameters.find(name);

    return found == info_.hardware_parameters.end() ? std::string() : found->second;
}

CallbackReturn System::on_init(const hardware_interface::HardwareInfo &info)
{
    if (SystemInterface::on_init(info) != CallbackReturn::SUCCESS) {
        return CallbackReturn::ERROR;
    }
    period_ticks_ = std::atoi(parameter("period_ticks").c_str());
    for (const auto &component : info_.joints) {
        Joint joint;

        joint.name = component.name;
        if (component.command_interfaces.size() > 1) {
            RCLCPP_ERROR(logger(), "joint %s: found %zu command interfaces, expected at most one",
                         joint.name.c_str(), component.command_interfaces.size());
            return CallbackReturn::ERROR;
        }
        for (const auto &interface : component.command_interfaces) {
            const auto quantity = kQuantities.find(interface.name);

            if (quantity == kQuantities.end()) {
                RCLCPP_ERROR(logger(),
                             "joint %s: found the command interface \"%s\", expected "
                             "voltage, current or position",
                             joint.name.c_str(), interface.name.c_str());
                return CallbackReturn::ERROR;
            }
            joint.command_name = quantity->first;
            joint.quantity = quantity->second;
        }
        joints_.push_back(joint);
    }
    return CallbackReturn::SUCCESS;
}

CallbackReturn System::on_configure(const rclcpp_lifecycle::State &)
{
    const std::string table = parameter("table");
    const std::string ready = parameter("ready"), host = parameter("host");
    hil_client_options options{};

    options.table = table.empty() ? nullptr : table.c_str();
    options.ready = ready.empty() ? nullptr : ready.c_str();
    options.host = host.empty() ? nullptr : host.c_str();
    options.port = static_cast<std::uint16_t>(std::atoi(parameter("port").c_str()));
    options.lockstep = period_ticks_ > 0;
    if (!succeeded(hil_client_open(&client_, &options))) {
        return CallbackReturn::FAILURE;
    }
    for (auto &joint : joints_) {
        joint.number = hil_client_find_joint(&client_, joint.name.c_str());
        if (joint.number < 0) {
            RCLCPP_ERROR(logger(), "joint %s: the rig has no such joint", joint.name.c_str());
            hil_client_close(&client_);
            return CallbackReturn::FAILURE;
        }
    }
    // velocities need two positions: none is known before the boards report
    return succeeded(hil_client_listen(&client_)) ? CallbackReturn::SUCCESS
                                                  : CallbackReturn::FAILURE;
}

CallbackReturn System::on_cleanup(const rclcpp_lifecycle::State &)
{
    hil_client_close(&client_);
    return CallbackReturn::SUCCESS;
}

CallbackReturn System::on_activate(const rclcpp_lifecycle::State &)
{
    // the client switches joints on by kinds of set points
    for (const auto &quantity : kQuantities) {
        std::vector<const char *> names;

        for (const auto &joint : joints_) {
            if (joint.quantity == quantity.second) {
                names.push_back(joint.name.c_str());
            }
        }
        if (!names.empty() &&
            !succeeded(hil_client_enable(&client_, names.data(), names.size(), quantity.second))) {
            return CallbackReturn::FAILURE;
        }
    }
    if (!read_joints(0.0)) {
        return CallbackReturn::FAILURE;
    }
    for (auto &joint : joints_) { // stay where they are until a controller commands
        joint.command = joint.quantity == HIL_CLIENT_POSITION ? joint.position : 0.0;
    }
    return CallbackReturn::SUCCESS;
}

CallbackReturn System::on_deactivate(const rclcpp_lifecycle::State &)
{
    return succeeded(hil_client_enable(&client_, nullptr, 0, HIL_CLIENT_OFF))
               ? CallbackReturn::SUCCESS
               : CallbackReturn::ERROR;
}

CallbackReturn System::on_error(const rclcpp_lifecycle::State &)
{
    // after this the manager may configure again, which connects anew
    hil_client_close(&client_);
    return CallbackReturn::SUCCESS;
}

std::vector<hardware_interface::StateInterface> System::export_state_interfaces()
{
    std::vector<hardware_interface::StateInterface> interfaces;

    for (auto &joint : joints_) {
        interfaces.emplace_back(joint.name, "position", &joint.position);
        interfaces.emplace_back(joint.name, "velocity", &joint.velocity);
        interfaces.emplace_back(joint.name, "effort", &joint.effort);
    }
    return interfaces;
}

std::vector<hardware_interface::CommandInterface> System::export_command_interfaces()
{
    std::vector<hardware_interface::CommandInterface> interfaces;

    for (auto &joint : joints_) {
        if (joint.quantity != HIL_CLIENT_OFF) {
            interfaces.emplace_back(joint.name, joint.command_name, &joint.command);
        }
    }
    return interfaces;
}

// What a protocol does not report is made of what it reports, or stays 0.
bool System::read_joints(double period_s)
{
    for (auto &joint : joints_) {
        const double before = joint.position;
        hil_client_joint state;

        if (!succeeded(hil_client_read(&client_, joint.number, &state))) {
            return false;
        }
        if (std::isfinite(state.position_rad)) {
            joint.position = state.position_rad;
        } else if (std::isfinite(state.motor_position_rad)) {
            joint.position = state.motor_position_rad;
        }
        if (std::isfinite(state.motor_velocity_rad_s)) {
            joint.velocity = state.motor_velocity_rad_s;
        } else {
            joint.velocity = period_s > 0.0 ? (joint.position - before) / period_s : 0.0;
        }
        joint.effort = std::isfinite(state.torque_nm) ? state.torque_nm : 0.0;
    }
    return true;
}

return_type System::read(const rclcpp::Time &, const rclcpp::Duration &period)
{
    // in lockstep the frames have arrived with the last step, and virtual time has its own period
    const double period_s = period_ticks_ > 0 ? 1e-3 * period_ticks_ : period.seconds();
    const hil_client_code code =
        period_ticks_ > 0 ? HIL_CLIENT_OK : hil_client_receive(&client_, 0);

    if (code != HIL_CLIENT_OK && code != HIL_CLIENT_TIMEOUT) {
        succeeded(code);
        return return_type::ERROR;
    }
    const int tripped = hil_client_find_tripped(&client_, 0);
    if (tripped >= 0) {
        RCLCPP_ERROR(logger(), "joint %s has tripped", hil_client_joint_name(&client_, tripped));
        return return_type::ERROR;
    }
    return read_joints(period_s) ? return_type::OK : return_type::ERROR;
}

return_type System::write(const rclcpp::Time &, const rclcpp::Duration &)
{
    for (const auto &joint : joints_) {
        if (joint.quantity != HIL_CLIENT_OFF &&
            !succeeded(hil_client_command(&client_, joint.number, joint.quantity, joint.command))) {
            return return_type::ERROR;
        }
    }
    const hil_client_code code =
        period_ticks_ > 0 ? hil_client_step(&client_, period_ticks_) : hil_client_write(&client_);
    return succeeded(code) ? return_type::OK : return_type::ERROR;
}

} // namespace coman_hil_ros2

PLUGINLIB_EXPORT_CLASS(coman_hil_ros2::System, hardware_interface::SystemInterface)
