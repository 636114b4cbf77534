// SPDX-License-Identifier: Apache-2.0
// A robot behind CAN boards as hardware of ros2_control: libcoman-hil-client encodes commands and
// decodes telemetry by the client table of the run. Parameters of the URDF tag, all texts:
//
//     table         SocketCAN: the file RIG.joints from `coman-hil dbc RIG -o FOLDER`
//     ready         file of `coman-hil run --ready FILE`: the gateway of that run
//     host, port    or a gateway by its address
//                   without ready and port: SocketCAN, on the interfaces of the rig
//     period_ticks  ticks of virtual time that an update lasts in lockstep; 0, the default: real time
//
// Command interfaces of a joint: "voltage" (V), "current" (A) or "position" (rad), at most one for
// each joint. State interfaces: "position" (rad), "velocity" (rad/s), "effort" (N m).
//
// From version 4.40 of ros2_control (ROS 2 Jazzy) on, the framework makes the interfaces of the tag.
// In older versions (ROS 2 Humble), this component makes the interfaces.
#pragma once

#include <coman_hil_client.h>

#include <hardware_interface/handle.hpp>
#include <hardware_interface/hardware_info.hpp>
#include <hardware_interface/system_interface.hpp>
#include <hardware_interface/types/hardware_interface_return_values.hpp>
#include <hardware_interface/version.h>
#include <rclcpp/duration.hpp>
#include <rclcpp/time.hpp>
#include <rclcpp_lifecycle/state.hpp>

#include <string>
#include <vector>

#if HARDWARE_INTERFACE_VERSION_GTE(4, 40, 0)
#include <hardware_interface/types/hardware_component_interface_params.hpp>
#define COMAN_HIL_ROS2_FRAMEWORK_INTERFACES 1
#else
#define COMAN_HIL_ROS2_FRAMEWORK_INTERFACES 0
#endif

namespace coman_hil_ros2
{

class System : public hardware_interface::SystemInterface
{
  public:
    ~System() override;

#if COMAN_HIL_ROS2_FRAMEWORK_INTERFACES
    hardware_interface::CallbackReturn
    on_init(const hardware_interface::HardwareComponentInterfaceParams &params) override;
#else
    hardware_interface::CallbackReturn
    on_init(const hardware_interface::HardwareInfo &info) override;
    std::vector<hardware_interface::StateInterface> export_state_interfaces() override;
    std::vector<hardware_interface::CommandInterface> export_command_interfaces() override;
#endif
    // Connects and reads the client table.
    hardware_interface::CallbackReturn
    on_configure(const rclcpp_lifecycle::State &previous) override;
    hardware_interface::CallbackReturn on_cleanup(const rclcpp_lifecycle::State &previous) override;
    // Clears faults and switches the motors on.
    hardware_interface::CallbackReturn
    on_activate(const rclcpp_lifecycle::State &previous) override;
    // Switches the motors off.
    hardware_interface::CallbackReturn
    on_deactivate(const rclcpp_lifecycle::State &previous) override;
    hardware_interface::CallbackReturn on_error(const rclcpp_lifecycle::State &previous) override;

    // Reads the last telemetry. Returns ERROR when a board has tripped or the run is over.
    hardware_interface::return_type read(const rclcpp::Time &time,
                                         const rclcpp::Duration &period) override;
    // Sends the commands; in lockstep it also lets period_ticks pass.
    hardware_interface::return_type write(const rclcpp::Time &time,
                                          const rclcpp::Duration &period) override;

  private:
    struct Joint {
        std::string name;
        std::string command_name; // of its command interface
        hil_client_quantity quantity = HIL_CLIENT_OFF;
        int number = -1; // the client's
        double position = 0.0, velocity = 0.0, effort = 0.0;
        double command = 0.0;   // written by the controller
        double set_point = 0.0; // sent to the board
#if COMAN_HIL_ROS2_FRAMEWORK_INTERFACES
        // the framework's interfaces of the joint; null if the tag lacks the interface
        hardware_interface::StateInterface::SharedPtr position_state, velocity_state, effort_state;
        hardware_interface::CommandInterface::SharedPtr command_interface;
#endif
    };

    bool succeeded(hil_client_code code); // logs the client's message otherwise
    std::string parameter(const std::string &name) const;
    bool number(const std::string &name, int largest, int &value) const;
    hardware_interface::CallbackReturn read_tag();
    bool read_joints(double period_s);

#if COMAN_HIL_ROS2_FRAMEWORK_INTERFACES
    void find_interfaces();
    void set_states();
    void set_commands();
    void get_commands();
#else
    // The interfaces point to the values of the joints: nothing is copied.
    void find_interfaces()
    {
    }
    void set_states()
    {
    }
    void set_commands()
    {
    }
    void get_commands()
    {
    }
#endif

    std::vector<Joint> joints_;
    int period_ticks_ = 0, port_ = 0;
    hil_client client_{};
};

} // namespace coman_hil_ros2
