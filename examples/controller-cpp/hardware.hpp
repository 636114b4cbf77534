// SPDX-License-Identifier: Apache-2.0
// The robot as ros2_control sees one: state interfaces that read() fills, command interfaces that
// write() sends. The methods have the names of hardware_interface::SystemInterface, so that a
// hardware plugin forwards to them and exports the members of `Joint` as its interfaces.
#pragma once

#include <coman_hil_client.h>

#include <stdexcept>
#include <string>
#include <vector>

// What went wrong, in the client's words.
struct HardwareError : std::runtime_error {
    HardwareError(hil_client_code code_, const std::string &what)
        : std::runtime_error(what), code(code_)
    {
    }
    hil_client_code code;
};

struct Joint {
    std::string name;
    double position = 0.0, velocity = 0.0, effort = 0.0; // rad, rad/s, N m: state interfaces
    double voltage = 0.0;                                // V: command interface
    int number = -1;                                     // the client's
};

class Hardware
{
  public:
    // Nothing happens yet; period_ticks: of the control loop.
    Hardware(std::vector<std::string> names, int period_ticks);
    ~Hardware();
    Hardware(const Hardware &) = delete;
    Hardware &operator=(const Hardware &) = delete;

    // Each throws HardwareError.
    void on_configure(const std::string &tables, const std::string &ready); // connects
    void on_activate();                                                     // motors on
    void on_deactivate();                                                   // motors off
    void read();  // what the boards have said last
    void write(); // commands, and in lockstep the time until the next read

    std::vector<Joint> joints;

    double time_s() const
    {
        return static_cast<double>(client_.tick) * 1e-3;
    }

  private:
    void check(hil_client_code code) const;

    int period_ticks_;
    hil_client client_{};
};
