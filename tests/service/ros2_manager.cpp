// SPDX-License-Identifier: Apache-2.0
// What a controller manager of ros2_control does with the hardware of examples/ros2_control:
// configures and activates it, then reads, updates and writes, with a controller that moves joints
// along a sine. Prints where they are, and the names of the interfaces with --interfaces. With
// --nan the controller writes NaN after the first second, as a controller without a command does.
//
//     manager [--real-time | --interfaces | --nan] READY JOINT...
#include "ros2_stand_in.hpp"

#include <cmath>
#include <cstdlib>
#include <memory>
#include <time.h>

using hardware_interface::CallbackReturn;
using hardware_interface::return_type;

namespace
{

constexpr double kPeriodS = 0.004, kAmplitudeRad = 0.2, kFrequencyHz = 1.0;

#if STAND_IN_VERSION < 400

// Humble: the component makes the interfaces
struct Interfaces {
    std::vector<hardware_interface::StateInterface> states;
    std::vector<hardware_interface::CommandInterface> commands;

    explicit Interfaces(hardware_interface::SystemInterface &hardware)
        : states(hardware.export_state_interfaces()), commands(hardware.export_command_interfaces())
    {
    }
    static double value(const hardware_interface::StateInterface &state)
    {
        return state.get_value();
    }
    static void command(hardware_interface::CommandInterface &command, double value)
    {
        command.set_value(value);
    }
    template <typename T> static const std::string &name(const T &interface)
    {
        return interface.get_name();
    }
};

CallbackReturn init(hardware_interface::SystemInterface &hardware,
                    const hardware_interface::HardwareInfo &info)
{
    return hardware.on_init(info);
}

#else

// From Jazzy on: the framework makes the interfaces
struct Interfaces {
    std::vector<hardware_interface::StateInterface::ConstSharedPtr> states;
    std::vector<hardware_interface::CommandInterface::SharedPtr> commands;

    explicit Interfaces(hardware_interface::SystemInterface &hardware)
        : states(hardware.on_export_state_interfaces()),
          commands(hardware.on_export_command_interfaces())
    {
    }
    static double value(const hardware_interface::StateInterface::ConstSharedPtr &state)
    {
        return state->get_optional().value();
    }
    static void command(const hardware_interface::CommandInterface::SharedPtr &command,
                        double value)
    {
        if (!command->set_value(value)) {
            std::abort();
        }
    }
    template <typename T> static const std::string &name(const T &interface)
    {
        return interface->get_name();
    }
};

CallbackReturn init(hardware_interface::SystemInterface &hardware,
                    const hardware_interface::HardwareInfo &info)
{
    hardware_interface::HardwareComponentInterfaceParams params;

    params.hardware_info = info;
    return hardware.on_init(params);
}

#endif

enum class Mode { kLockstep, kRealTime, kInterfaces, kNan };

// The 3 state interfaces of a joint are in the order of the tag: position, velocity, effort.
bool run(hardware_interface::SystemInterface &hardware, Interfaces &interfaces, Mode mode)
{
    const auto &states = interfaces.states;
    auto &commands = interfaces.commands;
    const bool real_time = mode == Mode::kRealTime;
    const double duration_s = real_time ? 0.5 : 2.0;
    const rclcpp::Duration period{kPeriodS};
    std::vector<double> start;
    double largest = 0.0;
    int update = 0;

    for (std::size_t i = 0; i < commands.size(); i++) {
        start.push_back(Interfaces::value(states[3 * i]));
    }
    for (; update * kPeriodS < duration_s; update++) {
        const double time_s = update * kPeriodS;
        const double wave = kAmplitudeRad * std::sin(2.0 * M_PI * kFrequencyHz * time_s);

        if (hardware.read({}, period) != return_type::OK) {
            return false;
        }
        for (std::size_t i = 0; i < commands.size(); i++) {
            const double position = Interfaces::value(states[3 * i]);
            const double command =
                60.0 * (start[i] + wave - position) - Interfaces::value(states[3 * i + 1]);

            largest = std::fmax(largest, std::fabs(position - start[i]));
            Interfaces::command(commands[i], mode == Mode::kNan && time_s >= 1.0
                                                 ? std::numeric_limits<double>::quiet_NaN()
                                                 : command);
        }
        if (hardware.write({}, period) != return_type::OK) {
            return false;
        }
        if (real_time) {
            const struct timespec pause = {0, 4000000};

            nanosleep(&pause, nullptr);
        }
    }
    for (std::size_t i = 0; i < commands.size(); i++) {
        std::printf("%s %+.4f, %s %+.3f\n", Interfaces::name(states[3 * i]).c_str(),
                    Interfaces::value(states[3 * i]) - start[i],
                    Interfaces::name(states[3 * i + 2]).c_str(),
                    Interfaces::value(states[3 * i + 2]));
    }
    std::printf("%.3f s, %.4f rad at most\n", update * kPeriodS, largest);
    return true;
}

} // namespace

int main(int argc, char **argv)
{
    const std::string option = argc > 1 ? argv[1] : "";
    const Mode mode = option == "--real-time"    ? Mode::kRealTime
                      : option == "--interfaces" ? Mode::kInterfaces
                      : option == "--nan"        ? Mode::kNan
                                                 : Mode::kLockstep;
    const int first = mode == Mode::kLockstep ? 1 : 2;
    std::unique_ptr<hardware_interface::SystemInterface> hardware(make_hardware());
    hardware_interface::HardwareInfo info;
    const char *ticks = std::getenv("PERIOD_TICKS");

    if (argc < first + 2) {
        return 2;
    }
    info.type = "system";
    info.hardware_parameters = {{"ready", argv[first]},
                                {"period_ticks", ticks                     ? ticks
                                                 : mode == Mode::kRealTime ? "0"
                                                                           : "4"}};
    for (int i = first + 1; i < argc; i++) {
        info.joints.push_back({argv[i], {{"voltage"}}, {{"position"}, {"velocity"}, {"effort"}}});
    }
    if (init(*hardware, info) != CallbackReturn::SUCCESS) {
        return 1;
    }
    Interfaces interfaces(*hardware);

    if (mode == Mode::kInterfaces) {
        for (const auto &state : interfaces.states) {
            std::printf("%s\n", Interfaces::name(state).c_str());
        }
        for (const auto &command : interfaces.commands) {
            std::printf("%s\n", Interfaces::name(command).c_str());
        }
        return 0;
    }
    const bool good = hardware->on_configure({}) == CallbackReturn::SUCCESS &&
                      hardware->on_activate({}) == CallbackReturn::SUCCESS &&
                      run(*hardware, interfaces, mode);
    if (!good) {
        hardware->on_error({});
        return 1;
    }
    return hardware->on_deactivate({}) == CallbackReturn::SUCCESS &&
                   hardware->on_cleanup({}) == CallbackReturn::SUCCESS
               ? 0
               : 1;
}
