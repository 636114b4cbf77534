// SPDX-License-Identifier: Apache-2.0
// A stand-in for the headers of ros2_control and rclcpp, to compile examples/ros2_control where ROS 2
// is not installed: the declarations that the example uses, as the documentation of ROS 2 Humble and
// Jazzy has them. It proves that the example is C++ against these declarations, and what its methods
// do when they are called in the order of a controller manager; it does not prove that colcon builds
// it.
#pragma once

#include <cstdio>
#include <string>
#include <unordered_map>
#include <vector>

#define RCLCPP_ERROR(logger, ...)                                                                  \
    ((void)(logger), std::fprintf(stderr, __VA_ARGS__), std::fputc('\n', stderr))

// A function that makes the hardware, in the place of the loader of plugins
#define PLUGINLIB_EXPORT_CLASS(type, base)                                                         \
    base *make_hardware()                                                                          \
    {                                                                                              \
        return new type;                                                                           \
    }

namespace rclcpp
{
struct Logger {
};
inline Logger get_logger(const char *)
{
    return {};
}
struct Time {
};
struct Duration {
    double value_s = 0.0;
    double seconds() const
    {
        return value_s;
    }
};
} // namespace rclcpp

namespace rclcpp_lifecycle
{
struct State {
};
namespace node_interfaces
{
struct LifecycleNodeInterface {
    enum class CallbackReturn : unsigned char { SUCCESS = 97, FAILURE = 98, ERROR = 99 };
    virtual ~LifecycleNodeInterface() = default;
    virtual CallbackReturn on_configure(const State &)
    {
        return CallbackReturn::SUCCESS;
    }
    virtual CallbackReturn on_cleanup(const State &)
    {
        return CallbackReturn::SUCCESS;
    }
    virtual CallbackReturn on_activate(const State &)
    {
        return CallbackReturn::SUCCESS;
    }
    virtual CallbackReturn on_deactivate(const State &)
    {
        return CallbackReturn::SUCCESS;
    }
    virtual CallbackReturn on_error(const State &)
    {
        return CallbackReturn::SUCCESS;
    }
};
} // namespace node_interfaces
} // namespace rclcpp_lifecycle

namespace hardware_interface
{
enum class return_type : unsigned char { OK = 0, ERROR = 1 };
using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;

struct InterfaceInfo {
    std::string name;
};
struct ComponentInfo {
    std::string name;
    std::vector<InterfaceInfo> command_interfaces, state_interfaces;
};
struct HardwareInfo {
    std::string name;
    std::unordered_map<std::string, std::string> hardware_parameters;
    std::vector<ComponentInfo> joints;
};

class Handle
{
  public:
    Handle(const std::string &prefix, const std::string &interface, double *value)
        : name_(prefix + "/" + interface), value_(value)
    {
    }
    const std::string &get_name() const
    {
        return name_;
    }
    double get_value() const
    {
        return *value_;
    }
    void set_value(double value)
    {
        *value_ = value;
    }

  private:
    std::string name_;
    double *value_;
};
struct StateInterface : Handle {
    using Handle::Handle;
};
struct CommandInterface : Handle {
    using Handle::Handle;
};

class SystemInterface : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface
{
  public:
    virtual CallbackReturn on_init(const HardwareInfo &info)
    {
        info_ = info;
        return CallbackReturn::SUCCESS;
    }
    virtual std::vector<StateInterface> export_state_interfaces() = 0;
    virtual std::vector<CommandInterface> export_command_interfaces() = 0;
    virtual return_type read(const rclcpp::Time &, const rclcpp::Duration &) = 0;
    virtual return_type write(const rclcpp::Time &, const rclcpp::Duration &) = 0;

  protected:
    HardwareInfo info_;
};
} // namespace hardware_interface

hardware_interface::SystemInterface *make_hardware();
