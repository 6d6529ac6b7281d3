#include "platform/cli/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <iterator>
#include <string>

#include "platform/linux/service.hpp"
#include "platform/linux/text_output.hpp"

namespace stillmesh {

ProgressLine::ProgressLine(bool is_shown, std::uint64_t frames_expected)
    : is_shown_(is_shown), is_terminal_(::isatty(STDERR_FILENO) == 1), frames_expected_(frames_expected) {}

void ProgressLine::frame(std::uint64_t count, PoseState state, std::int64_t now_ns) {
    if (!is_shown_) return;
    if (begin_ns_ == 0) begin_ns_ = last_ns_ = now_ns;
    const std::int64_t interval_ns = is_terminal_ ? 100'000'000 : 5'000'000'000;
    if (now_ns - last_ns_ < interval_ns) return;
    last_ns_ = now_ns;
    const double fps = static_cast<double>(count) * 1e9 / static_cast<double>(now_ns - begin_ns_);
    fmt::memory_buffer line;  // 500 bytes without the heap
    const auto end = [&line] { return std::back_inserter(line); };
    fmt::format_to(end(), "{}frame {}", is_terminal_ ? "\r" : log_prefix(LogLevel::kInfo), count);
    if (frames_expected_ > 0) fmt::format_to(end(), " of {}", frames_expected_);
    fmt::format_to(end(), ", {:.0f} frames/s, {}", fps, pose_state_name(state));
    if (is_terminal_) {
        while (line.size() < 61) line.push_back(' ');
        is_line_open_ = true;
    } else {
        line.push_back('\n');
    }
    write_standard_error({line.data(), line.size()});
}

void ProgressLine::say(const std::string& sentence) {
    finish();
    write_standard_error(log_entry(LogLevel::kNotice, printable(sentence)));
}

void ProgressLine::finish() {
    if (is_line_open_) write_standard_error(fmt::format("\r{:60}\r", ""));
    is_line_open_ = false;
}

}  // namespace stillmesh
