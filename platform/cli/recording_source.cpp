#include "platform/cli/recording_source.hpp"

#include <fmt/format.h>

#include "hal/bag/bag_files.hpp"

namespace stillmesh {

RecordingSource::RecordingSource(const ReplayOptions& options, const std::string& topics)
    : pair_gap_ns_(options.association_gap_max_ns) {
    if (!is_bag(options.folder)) {
        if (!topics.empty()) problem_ = "--topics: are a bag's; " + options.folder + " is none.";
        folder_.emplace(options);
        return;
    }
    if (!options.masks.empty()) problem_ = "--mask: pictures in a bag have no names that masks could have; convert it.";
    if (options.frames_per_s > 0) problem_ = "--fps: a bag has times; leave it out.";
    bag_.emplace(BagOptions{.path = options.folder,
                            .topics = topics,
                            .calibration = options.calibration,
                            .camera = options.camera,
                            .depth_units_per_m = options.depth_units_per_m,
                            .width_max = options.width_max,
                            .height_max = options.height_max,
                            .association_gap_max_ns = options.association_gap_max_ns,
                            .depth_offset_ns = options.depth_offset_ns});
}

DepthCamera& RecordingSource::camera() {
    return folder_ ? static_cast<DepthCamera&>(*folder_) : *bag_;
}
const std::string& RecordingSource::message() const {
    return folder_ ? folder_->message() : bag_->message();
}
const std::string& RecordingSource::calibration_source() const {
    return folder_ ? folder_->calibration_source() : bag_->calibration_source();
}
std::uint64_t RecordingSource::frames() const {
    return folder_ ? folder_->counts().frames : 0;
}
std::vector<std::string> RecordingSource::closing_notes() const {
    return bag_ ? bag_->closing_notes() : std::vector<std::string>();
}

std::vector<std::string> RecordingSource::notes() const {
    if (bag_) return bag_->notes();
    std::vector<std::string> out;
    const ReplayCounts& counts = folder_->counts();
    if (counts.colour_images > counts.frames) {
        out.push_back(fmt::format("{} of {} colour images have no depth image within {:.0f} ms: skipped.",
                                  counts.colour_images - counts.frames, counts.colour_images,
                                  static_cast<double>(pair_gap_ns_) * 1e-6));
    }
    if (counts.masks > 0) out.push_back(fmt::format("{} of {} frames have a mask.", counts.masks, counts.frames));
    if (counts.unit != TimeUnit::kSeconds) {
        out.push_back(fmt::format("the times of the recording are taken for {}: they go up by {:g}.",
                                  time_unit_name(counts.unit), counts.step));
    }
    const CameraModel& model = folder_->info().model;
    if (counts.is_registered_here) {
        out.push_back(fmt::format("depth is {}x{}, of the depth camera in {}: registered to colour, {}x{}.",
                                  counts.depth_width, counts.depth_height, folder_->calibration_source(), model.width,
                                  model.height));
    } else if (counts.depth_width != model.width) {
        out.push_back(fmt::format("depth is {}x{}, colour {}x{}: taken for the same view, the nearest pixel counts.",
                                  counts.depth_width, counts.depth_height, model.width, model.height));
    }
    if (counts.is_colour_wide) out.push_back("colour is 16-bit grey: its high byte is tracked.");
    constexpr std::int64_t kUsual_ns = 20'000'000;
    if (counts.pair_gap_longest_ns > kUsual_ns) {
        out.push_back(fmt::format(
            "images of one frame are up to {:.1f} ms apart; what moved meanwhile is not where its depth is.",
            static_cast<double>(counts.pair_gap_longest_ns) * 1e-6));
    }
    return out;
}

}  // namespace stillmesh
