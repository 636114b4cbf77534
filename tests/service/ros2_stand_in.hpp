// SPDX-License-Identifier: Apache-2.0
// A stand-in for the headers of ros2_control and rclcpp, to compile examples/ros2_control where ROS 2
// is not installed: the declarations that the example uses, as the headers of ros2_control have them
// on 2026-08-07 in the branches humble (2.54), jazzy (4.46), kilted (5.16) and master (6.8, ROS 2
// Lyrical and Rolling). STAND_IN_VERSION chooses: 254, 446, 516 or 608. It proves that the example is
// C++ against these declarations, and what its methods do when they are called in the order of a
// controller manager; it does not prove that colcon builds it.
#pragma once

#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

#define HARDWARE_INTERFACE_VERSION_GTE(major, minor, patch)                                        \
    (STAND_IN_VERSION >= 100 * (major) + (minor))

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
    std::string name, type;
    std::unordered_map<std::string, std::string> hardware_parameters;
    std::vector<ComponentInfo> joints;
};

#if STAND_IN_VERSION < 400

// The component makes the interfaces. They point to values of the component.
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

#else

// The framework makes the interfaces of the tag. They hold their values.
class Handle
{
  public:
    Handle(const std::string &prefix, const std::string &interface)
        : name_(prefix + "/" + interface)
    {
    }
    const std::string &get_name() const
    {
        return name_;
    }
    template <typename T = double> [[nodiscard]] std::optional<T> get_optional() const
    {
        return value_;
    }
    template <typename T> [[nodiscard]] bool get_value(T &value, bool) const
    {
        value = value_;
        return true;
    }
    template <typename T> [[nodiscard]] bool set_value(const T &value, bool = false)
    {
        value_ = value;
        return true;
    }

  private:
    std::string name_;
    double value_ = std::numeric_limits<double>::quiet_NaN();
};
struct StateInterface : Handle {
    using Handle::Handle;
    using SharedPtr = std::shared_ptr<StateInterface>;
    using ConstSharedPtr = std::shared_ptr<const StateInterface>;
};
struct CommandInterface : Handle {
    using Handle::Handle;
    using SharedPtr = std::shared_ptr<CommandInterface>;
    CommandInterface(const CommandInterface &) = delete;
    CommandInterface(CommandInterface &&) = default;
};
struct HardwareComponentInterfaceParams {
    HardwareInfo hardware_info;
};

class HardwareComponentInterface : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface
{
  public:
    HardwareComponentInterface() = default;
    HardwareComponentInterface(const HardwareComponentInterface &) = delete;
#if STAND_IN_VERSION < 600
    [[deprecated("Use on_init(const HardwareComponentInterfaceParams & params) "
                 "instead.")]] virtual CallbackReturn
    on_init(const HardwareInfo &info)
    {
        info_ = info;
        return CallbackReturn::SUCCESS;
    }
#endif
    virtual CallbackReturn on_init(const HardwareComponentInterfaceParams &params)
    {
        info_ = params.hardware_info;
        return CallbackReturn::SUCCESS;
    }
    virtual std::vector<StateInterface::ConstSharedPtr> on_export_state_interfaces()
    {
        return export_all<StateInterface::ConstSharedPtr>(states_,
                                                          &ComponentInfo::state_interfaces);
    }
    virtual std::vector<CommandInterface::SharedPtr> on_export_command_interfaces()
    {
        return export_all<CommandInterface::SharedPtr>(commands_,
                                                       &ComponentInfo::command_interfaces);
    }
    virtual return_type read(const rclcpp::Time &, const rclcpp::Duration &) = 0;
    virtual return_type write(const rclcpp::Time &, const rclcpp::Duration &)
    {
        return return_type::OK;
    }
    virtual bool has_state(const std::string &name) const
    {
        return states_.count(name) > 0;
    }
    virtual const StateInterface::SharedPtr &get_state_interface_handle(const std::string &n) const
    {
        return states_.at(n); // throws, as the framework does
    }
    virtual const CommandInterface::SharedPtr &
    get_command_interface_handle(const std::string &name) const
    {
        return commands_.at(name);
    }
    template <typename T>
    bool set_state(const StateInterface::SharedPtr &state, const T &value, bool wait)
    {
        return checked(state)->set_value(value, wait);
    }
    template <typename T>
    bool set_command(const CommandInterface::SharedPtr &command, const T &value, bool wait)
    {
        return checked(command)->set_value(value, wait);
    }
    template <typename T>
    bool get_command(const CommandInterface::SharedPtr &command, T &value, bool wait) const
    {
        return checked(command)->get_value(value, wait);
    }

  protected:
    HardwareInfo info_;

  private:
    template <typename T> static const T &checked(const T &handle)
    {
        if (!handle) {
            throw std::runtime_error("the handle of an interface is null");
        }
        return handle;
    }
    template <typename Pointer, typename Map>
    std::vector<Pointer> export_all(Map &map, std::vector<InterfaceInfo> ComponentInfo::*interfaces)
    {
        std::vector<Pointer> exported;

        for (const auto &joint : info_.joints) {
            for (const auto &interface : joint.*interfaces) {
                auto made = std::make_shared<typename Map::mapped_type::element_type>(
                    joint.name, interface.name);

                map[made->get_name()] = made;
                exported.push_back(made);
            }
        }
        return exported;
    }
    std::unordered_map<std::string, StateInterface::SharedPtr> states_;
    std::unordered_map<std::string, CommandInterface::SharedPtr> commands_;
};

class SystemInterface : public HardwareComponentInterface
{
  public:
    return_type write(const rclcpp::Time &, const rclcpp::Duration &) override = 0;
};

#endif

} // namespace hardware_interface

hardware_interface::SystemInterface *make_hardware();
