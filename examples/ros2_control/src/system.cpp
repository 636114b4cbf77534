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

// Reads the whole number of a parameter; 0 without the parameter.
bool System::number(const std::string &name, int largest, int &value) const
{
    const std::string text = parameter(name);
    char *end = nullptr;
    const long found = std::strtol(text.c_str(), &end, 10);

    if (*end != '\0' || found < 0 || found > largest) {
        RCLCPP_ERROR(logger(), "parameter %s: found \"%s\", expected a whole number from 0 to %d",
                     name.c_str(), text.c_str(), largest);
        return false;
    }
    value = static_cast<int>(found);
    return true;
}

#if COMAN_HIL_ROS2_FRAMEWORK_INTERFACES

CallbackReturn System::on_init(const hardware_interface::HardwareComponentInterfaceParams &params)
{
    return SystemInterface::on_init(params) == CallbackReturn::SUCCESS ? read_tag()
                                                                       : CallbackReturn::ERROR;
}

void System::find_interfaces()
{
    for (auto &joint : joints_) {
        const auto find = [&](const char *name) {
            const std::string full = joint.name + "/" + name;

            return has_state(full) ? get_state_interface_handle(full) : nullptr;
        };

        joint.position_state = find("position");
        joint.velocity_state = find("velocity");
        joint.effort_state = find("effort");
        if (joint.quantity != HIL_CLIENT_OFF) {
            joint.command_interface =
                get_command_interface_handle(joint.name + "/" + joint.command_name);
        }
    }
}

// A state that a controller reads at this moment keeps its last value.
void System::set_states()
{
    const auto set = [this](const hardware_interface::StateInterface::SharedPtr &state,
                            double value) {
        if (state) {
            set_state(state, value, false);
        }
    };

    for (auto &joint : joints_) {
        set(joint.position_state, joint.position);
        set(joint.velocity_state, joint.velocity);
        set(joint.effort_state, joint.effort);
    }
}

void System::set_commands()
{
    for (auto &joint : joints_) {
        if (joint.command_interface) {
            set_command(joint.command_interface, joint.command, true);
        }
    }
}

void System::get_commands()
{
    for (auto &joint : joints_) {
        if (joint.command_interface) {
            get_command(joint.command_interface, joint.command, false);
        }
    }
}

#else

CallbackReturn System::on_init(const hardware_interface::HardwareInfo &info)
{
    return SystemInterface::on_init(info) == CallbackReturn::SUCCESS ? read_tag()
                                                                     : CallbackReturn::ERROR;
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

#endif

CallbackReturn System::read_tag()
{
    if (!number("period_ticks", 1000, period_ticks_) || !number("port", 65535, port_)) {
        return CallbackReturn::ERROR;
    }
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
    options.port = static_cast<std::uint16_t>(port_);
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
    find_interfaces();
    // A velocity needs two positions, so no velocity is known before the boards report
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
    for (auto &joint : joints_) { // hold the present positions until a controller commands
        joint.set_point = joint.quantity == HIL_CLIENT_POSITION ? joint.position : 0.0;
        joint.command = joint.set_point;
    }
    set_commands();
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

// A value that the protocol does not report is computed from other values, or stays 0.
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
    set_states();
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
    get_commands();
    for (auto &joint : joints_) {
        // A controller that has no command writes NaN: a position holds, a voltage or current ends.
        if (std::isfinite(joint.command)) {
            joint.set_point = joint.command;
        } else if (joint.quantity != HIL_CLIENT_POSITION) {
            joint.set_point = 0.0;
        }
        if (joint.quantity != HIL_CLIENT_OFF &&
            !succeeded(
                hil_client_command(&client_, joint.number, joint.quantity, joint.set_point))) {
            return return_type::ERROR;
        }
    }
    const hil_client_code code =
        period_ticks_ > 0 ? hil_client_step(&client_, period_ticks_) : hil_client_write(&client_);
    return succeeded(code) ? return_type::OK : return_type::ERROR;
}

} // namespace coman_hil_ros2

PLUGINLIB_EXPORT_CLASS(coman_hil_ros2::System, hardware_interface::SystemInterface)
