#include "bench/accuracy/runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <type_traits>

#include "bench/accuracy/sources.hpp"
#include "platform/linux/cpu_kernels.hpp"
#include "platform/linux/memory_block.hpp"
#include "platform/linux/process.hpp"
#include "platform/linux/text_output.hpp"

namespace stillmesh::accuracy {
namespace {

// One engine with what it said so far.
struct Seat {
    MemoryBlock block;
    Engine* engine = nullptr;
    std::uint32_t units_per_frame = 0;
    std::unique_ptr<HintMaker> hints;
    std::unique_ptr<MaskMaker> masks;
    LineFile trajectory;
    std::vector<FrameRecord> records;
};

void count_matches(TrackingView view, ImageView<std::uint8_t> mask, FrameRecord& record) {
    record.has_mask = true;
    for (const TrackedFeature& feature : view.features) {
        if (!feature.is_matched) continue;
        const auto x =
            static_cast<std::uint32_t>(std::clamp(std::lround(feature.x), 0L, static_cast<long>(mask.width) - 1));
        const auto y =
            static_cast<std::uint32_t>(std::clamp(std::lround(feature.y), 0L, static_cast<long>(mask.height) - 1));
        const std::uint8_t body = mask.at(x, y);
        if (body != 0 && body != 255) continue;
        const bool is_moving = body == 255;
        (is_moving ? record.moving : record.still) += 1;
        if (feature.is_static) (is_moving ? record.moving_accepted : record.still_accepted) += 1;
    }
}

}  // namespace

bool run(const Input& input, const std::vector<Variant>& variants, const RunOptions& options,
         const std::function<void(std::uint32_t)>& on_frames, std::vector<Result>& results, std::string& message) {
    const std::unique_ptr<Source> source = open_source(input, options, message);
    if (source == nullptr) return false;
    const std::string scene =
        input.is_recording
            ? std::filesystem::path(input.scene + "/.").lexically_normal().parent_path().filename().string()
            : input.scene;
    const Limits limits = Limits::room();
    std::vector<std::unique_ptr<Seat>> seats;
    for (const Variant& variant : variants) {
        auto seat = std::make_unique<Seat>();
        if (!seat->block.allocate(bytes_needed(limits))) {
            message = "not enough memory for another engine.";
            return false;
        }
        Parameters configuration = variant.configuration;
        if (!variant.has_readout) configuration.camera.readout_s = source->readout_s();
        const auto engine = create_engine(seat->block.bytes(), limits, configuration, source->model(),
                                          {cpu_kernels(), nullptr, variant.vocabulary});
        if (!engine.is_ok()) {
            message = fmt::format("the engine refuses camera or configuration '{}': {}.", variant.name,
                                  status_name(engine.status()));
            return false;
        }
        seat->engine = engine.value();
        seat->hints = std::make_unique<HintMaker>(variant.hints, input.seed);
        seat->masks = std::make_unique<MaskMaker>(variant.masks);
        seat->units_per_frame = configuration.schedule.units_per_frame;
        if (!options.trajectories.empty() &&
            !seat->trajectory.open(
                fmt::format("{}/{}_{}_{}.txt", options.trajectories, scene, input.seed, variant.name), message)) {
            return false;
        }
        seats.push_back(std::move(seat));
    }
    std::int64_t first_ns = -1;
    for (;;) {
        TrueFrame in;
        const Status status = source->next(in, message);
        if (status == Status::kEnd) break;
        if (status != Status::kOk) return false;
        if (first_ns < 0) first_ns = in.frame.time_ns;
        const double second = static_cast<double>(in.frame.time_ns - first_ns) * 1e-9;
        for (const auto& seat : seats) {
            FrameRecord record;
            record.time_ns = in.frame.time_ns;
            record.has_truth = in.has_truth;
            record.truth = in.truth;
            const MotionHint* const hint = in.has_truth ? seat->hints->hint(in.truth, second) : nullptr;
            in.frame.mask = seat->masks->mask(in.mask);
            const std::int64_t begin_ns = monotonic_ns();
            const Status submitted = seat->engine->submit(in.frame, hint);
            record.engine_ms = static_cast<float>(monotonic_ns() - begin_ns) * 1e-6F;
            if (submitted == Status::kOk) {
                const PoseEstimate& pose = seat->engine->pose();
                record.state = pose.state;
                record.estimate.time_ns = pose.time_ns;
                std::copy_n(pose.odom_from_camera.translation_m, 3, record.estimate.t.begin());
                std::copy_n(pose.odom_from_camera.rotation_xyzw, 4, record.estimate.q.begin());
                std::copy_n(pose.covariance, 36, record.covariance.begin());
                if (in.mask.data != nullptr) count_matches(seat->engine->tracking_view(), in.mask, record);
                if (seat->trajectory.is_open() && pose.state >= PoseState::kUnsure &&
                    !seat->trajectory.write(pose_line(record.estimate), message)) {
                    return false;
                }
            }
            // Background work after the pose has been given out; counted to the frame's time.
            const std::int64_t step_ns = monotonic_ns();
            static_cast<void>(seat->engine->step(seat->units_per_frame));
            record.engine_ms += static_cast<float>(monotonic_ns() - step_ns) * 1e-6F;
            seat->records.push_back(record);
        }
        on_frames(1);
    }
    for (std::size_t i = 0; i < seats.size(); ++i) {
        Result result{scene, input.seed, input.is_recording, variants[i].name, measure(seats[i]->records)};
        result.dirt = input.dirt_name;
        result.measures.keyframes = seats[i]->engine->statistics().keyframes_made;
        results.push_back(result);
    }
    return true;
}

std::vector<std::string> split(const std::string& text) {
    std::vector<std::string> out;
    std::size_t begin = 0;
    while (begin <= text.size()) {
        const std::size_t end = std::min(text.find(',', begin), text.size());
        if (end > begin) out.push_back(text.substr(begin, end - begin));
        begin = end + 1;
    }
    return out;
}

bool parse_seeds(const std::string& text, std::vector<std::uint64_t>& seeds) {
    for (const std::string& part : split(text)) {
        char* end = nullptr;
        const std::uint64_t first = std::strtoull(part.c_str(), &end, 10);
        const std::uint64_t last = *end == '-' ? std::strtoull(end + 1, &end, 10) : first;
        if (*end != '\0' || last < first || last - first > 10'000) return false;
        for (std::uint64_t seed = first; seed <= last; ++seed) seeds.push_back(seed);
    }
    return !seeds.empty();
}

bool set_parameter(Parameters& configuration, const std::string& assignment, std::string& message) {
    const std::size_t equals = assignment.find('=');
    const std::string key = assignment.substr(0, equals);
    const std::string text = equals == std::string::npos ? "" : assignment.substr(equals + 1);
    char* end = nullptr;
    double value = std::strtod(text.c_str(), &end);
    if (text == "true" || text == "false") {
        value = text == "true" ? 1 : 0;
    } else if (text.empty() || *end != '\0') {
        message = fmt::format("'{}': give a parameter as key=number.", assignment);
        return false;
    }
    bool is_known = false;
    bool is_good = true;
    visit_all_parameters(configuration,
                         [&](const char* name, auto& slot, double least, double most, const char*, const char*) {
                             if (key != name) return;
                             is_known = true;
                             if (!(value >= least && value <= most)) {
                                 message = fmt::format("{} = {}: allowed is {} to {}.", key, text, least, most);
                                 is_good = false;
                                 return;
                             }
                             slot = static_cast<std::remove_reference_t<decltype(slot)>>(value);
                         });
    if (!is_known) message = fmt::format("'{}' is no parameter of the engine.", key);
    return is_known && is_good;
}

}  // namespace stillmesh::accuracy
