// SPDX-License-Identifier: Apache-2.0
// What a controller manager of ros2_control does with the hardware of examples/ros2_control:
// configures and activates it, then reads, updates and writes, with a controller that moves joints
// along a sine. Prints where they are, and the names of the interfaces with --interfaces.
//
//     manager [--real-time | --interfaces] READY JOINT...
#include "ros2_stand_in.hpp"

#include <cmath>
#include <cstring>
#include <memory>
#include <time.h>

using hardware_interface::CallbackReturn;
using hardware_interface::return_type;

namespace
{

constexpr double kPeriodS = 0.004, kAmplitudeRad = 0.2, kFrequencyHz = 1.0;

// The 3 state interfaces of a joint are in the order of the tag: position, velocity, effort.
bool run(hardware_interface::SystemInterface &hardware, bool real_time, double duration_s)
{
    auto states = hardware.export_state_interfaces();
    auto commands = hardware.export_command_interfaces();
    const rclcpp::Duration period{kPeriodS};
    std::vector<double> start;
    double largest = 0.0;
    int update = 0;

    for (std::size_t i = 0; i < commands.size(); i++) {
        start.push_back(states[3 * i].get_value());
    }
    for (; update * kPeriodS < duration_s; update++) {
        const double time_s = update * kPeriodS;
        const double wave = kAmplitudeRad * std::sin(2.0 * M_PI * kFrequencyHz * time_s);

        if (hardware.read({}, period) != return_type::OK) {
            return false;
        }
        for (std::size_t i = 0; i < commands.size(); i++) {
            const double position = states[3 * i].get_value();

            largest = std::fmax(largest, std::fabs(position - start[i]));
            commands[i].set_value(60.0 * (start[i] + wave - position) -
                                  states[3 * i + 1].get_value());
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
        std::printf("%s %+.4f, %s %+.3f\n", states[3 * i].get_name().c_str(),
                    states[3 * i].get_value() - start[i], states[3 * i + 2].get_name().c_str(),
                    states[3 * i + 2].get_value());
    }
    std::printf("%.3f s, %.4f rad at most\n", update * kPeriodS, largest);
    return true;
}

} // namespace

int main(int argc, char **argv)
{
    const bool real_time = argc > 1 && std::strcmp(argv[1], "--real-time") == 0;
    const bool interfaces = argc > 1 && std::strcmp(argv[1], "--interfaces") == 0;
    const int first = real_time || interfaces ? 2 : 1;
    std::unique_ptr<hardware_interface::SystemInterface> hardware(make_hardware());
    hardware_interface::HardwareInfo info;

    if (argc < first + 2) {
        return 2;
    }
    info.hardware_parameters = {{"ready", argv[first]}, {"period_ticks", real_time ? "0" : "4"}};
    for (int i = first + 1; i < argc; i++) {
        info.joints.push_back({argv[i], {{"voltage"}}, {{"position"}, {"velocity"}, {"effort"}}});
    }
    if (hardware->on_init(info) != CallbackReturn::SUCCESS) {
        return 1;
    }
    if (interfaces) {
        for (const auto &state : hardware->export_state_interfaces()) {
            std::printf("%s\n", state.get_name().c_str());
        }
        for (const auto &command : hardware->export_command_interfaces()) {
            std::printf("%s\n", command.get_name().c_str());
        }
        return 0;
    }
    const bool good = hardware->on_configure({}) == CallbackReturn::SUCCESS &&
                      hardware->on_activate({}) == CallbackReturn::SUCCESS &&
                      run(*hardware, real_time, real_time ? 0.5 : 2.0);
    if (!good) {
        hardware->on_error({});
        return 1;
    }
    return hardware->on_deactivate({}) == CallbackReturn::SUCCESS &&
                   hardware->on_cleanup({}) == CallbackReturn::SUCCESS
               ? 0
               : 1;
}
