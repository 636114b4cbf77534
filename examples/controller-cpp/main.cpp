// SPDX-License-Identifier: Apache-2.0
// A controller in C++ with the loop of ros2_control, read, update, write: moves motors along a
// sine in lockstep with a simulator.
//
//     controller TABLES READY [JOINT...]
//
// The arguments are those of examples/controller-c.
#include "hardware.hpp"

#include <cmath>
#include <cstdio>
#include <exception>

namespace
{

constexpr int kPeriodTicks = 4;
constexpr double kDurationS = 2.0, kAmplitudeRad = 0.2, kFrequencyHz = 1.0;

// The controller: a proportional law with damping on the motor's angle.
void update(std::vector<Joint> &joints, const std::vector<double> &start, double time_s)
{
    const double wave = kAmplitudeRad * std::sin(2.0 * M_PI * kFrequencyHz * time_s);

    for (std::size_t i = 0; i < joints.size(); i++) {
        joints[i].voltage = 60.0 * (start[i] + wave - joints[i].position) - joints[i].velocity;
    }
}

void run(Hardware &hardware)
{
    std::vector<double> start;
    double begin_s, largest = 0.0;

    hardware.on_activate();
    begin_s = hardware.time_s();
    for (const auto &joint : hardware.joints) {
        start.push_back(joint.position);
    }
    while (hardware.time_s() - begin_s < kDurationS) {
        hardware.read();
        update(hardware.joints, start, hardware.time_s() - begin_s);
        hardware.write();
        for (std::size_t i = 0; i < start.size(); i++) {
            largest = std::fmax(largest, std::fabs(hardware.joints[i].position - start[i]));
        }
    }
    for (std::size_t i = 0; i < start.size(); i++) {
        std::printf("%s at %+.4f rad, %+.3f N m\n", hardware.joints[i].name.c_str(),
                    hardware.joints[i].position - start[i], hardware.joints[i].effort);
    }
    std::printf("%.3f s, %.4f rad at most\n", hardware.time_s() - begin_s, largest);
    hardware.on_deactivate();
}

} // namespace

int main(int argc, char **argv)
{
    if (argc < 3) {
        std::fprintf(stderr, "usage: controller TABLES READY [JOINT...]\n");
        return 2;
    }
    try {
        std::vector<std::string> names(argv + 3, argv + argc);
        if (names.empty()) {
            names.push_back("LElbj");
        }
        Hardware hardware(names, kPeriodTicks);

        hardware.on_configure(argv[1], argv[2]);
        run(hardware);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "controller: %s\n", error.what());
        return 1;
    }
    return 0;
}
