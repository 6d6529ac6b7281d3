// Trajectory files of `stillmesh eval`, truth and estimate with a byte 0 between them: any bytes give a sentence, or
// poses that can be written and read again, and an evaluation without surprises.
#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "fuzz/fuzz.hpp"
#include "platform/evaluation/evaluation.hpp"
#include "platform/evaluation/trajectory.hpp"

namespace {

using namespace stillmesh;

bool parse(std::string_view text, Trajectory& trajectory) {
    std::string message;
    const Status status = parse_trajectory(text, "file", trajectory, message);
    if (status != Status::kOk) {
        fuzz::expect(status == Status::kInvalid && !message.empty(), "a bad file is kInvalid with a sentence");
        return false;
    }
    std::string written;
    for (std::size_t i = 0; i < trajectory.size(); ++i) {
        const TrajectoryPose& pose = trajectory[i];
        fuzz::expect(i == 0 || trajectory[i - 1].time_ns <= pose.time_ns, "poses are sorted");
        for (const double number : pose.t) fuzz::expect(std::isfinite(number), "positions are finite");
        double squared = 0;
        for (const double number : pose.q) squared += number * number;
        fuzz::expect(std::abs(squared - 1) < 1e-6, "quaternions have length 1");
        written += pose_line(pose);
    }
    Trajectory again;
    fuzz::expect(parse_trajectory(written, "again", again, message) == Status::kOk, "what was read can be written");
    fuzz::expect(again.size() == trajectory.size(), "no pose is lost in writing");
    return true;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const std::string_view text(reinterpret_cast<const char*>(data), size_bytes);
    const std::size_t cut = std::min(text.find('\0'), text.size());
    Trajectory truth, estimate;
    const bool is_truth_good = parse(text.substr(0, cut), truth);
    const bool is_estimate_good = parse(text.substr(std::min(cut + 1, text.size())), estimate);
    if (!is_truth_good || !is_estimate_good) return 0;
    if (const auto evaluation = evaluate(truth, estimate)) {
        fuzz::expect(evaluation->pairs.size() >= 3, "an evaluation has at least three pairs");
        fuzz::expect(evaluation->coverage >= 0 && evaluation->coverage <= 1, "coverage is a share");
        fuzz::expect(!(evaluation->ate_rmse_m < 0), "errors are not negative");
    }
    return 0;
}
