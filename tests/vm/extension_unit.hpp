// The extension unit of the stereo module: controls 1 (Intel's commands, d435_monitor.hpp), 2 (emitter), 3 (exposure),
// 4 (laser power), each with its length, range and what was written (USB Video Class 1.5, 4.2.2.5).
#pragma once

#include <array>
#include <cstdint>

#include "tests/vm/d435_monitor.hpp"

namespace vm {

class ExtensionUnit {
public:
    // False: stalled; error_code() then says why, as the host asks next.
    bool control(const Setup& setup, const Bytes& written, Bytes& data);
    [[nodiscard]] std::uint8_t error_code() const { return error_code_; }
    [[nodiscard]] const std::array<std::uint32_t, 3>& values() const { return values_; }  // of controls 2 to 4

    MonitorSettings monitor;
    bool is_refused = false;  // commands are

private:
    std::uint8_t error_code_ = 0;
    Bytes answer_ = Bytes(kMessageBytes);  // to the last command
    std::array<std::uint32_t, 3> values_{1, 8500, 150};
};

}  // namespace vm
