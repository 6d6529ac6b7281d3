#include "hal/bag/bag_calibration.hpp"

#include <cmath>
#include <optional>

#include "hal/bag/ros_camera.hpp"
#include "hal/calibration/calibration.hpp"
#include "hal/calibration/ros_topics.hpp"

namespace stillmesh {
namespace {

constexpr double kMillimetres_per_m = 1000;
constexpr double kUnitsOfMetres_per_m = 5000;  // as in TUM recordings: .2 mm, up to 13.1 m

class BagCalibrator {
public:
    BagCalibrator(const BagOptions& options, const BagTopics& topics, const TopicSurvey& survey,
                  const TopicChoice& choice)
        : options_(options), topics_(topics), survey_(survey), choice_(choice) {}

    [[nodiscard]] Status find_lens(BagCalibration& out, std::string& message) const;
    [[nodiscard]] double units_per_m() const;
    [[nodiscard]] Status place_depth(BagCalibration& out, std::string& message) const;

private:
    [[nodiscard]] bool is_registered(BagCalibration& out) const;
    [[nodiscard]] const std::string& name_of(std::uint32_t place) const { return topics_[place].name; }

    const BagOptions& options_;
    const BagTopics& topics_;
    const TopicSurvey& survey_;
    const TopicChoice& choice_;
};

Status BagCalibrator::find_lens(BagCalibration& out, std::string& message) const {
    if (options_.camera) {
        out.info = *options_.camera;
        out.source = "the camera of the recording";
        return Status::kOk;
    }
    if (!options_.calibration.empty()) {
        out.source = options_.calibration;
        return load_calibration(out.source, out.info, message);
    }
    const std::string& topic = name_of(*choice_.info);
    out.source = "topic " + topic;
    const bool is_rectified = is_rectified_name(name_of(choice_.colour));
    if (is_rectified)
        out.notes.emplace_back("colour is rectified: its camera is P of the CameraInfo, without distortion.");
    return camera_of_message(*survey_.seen(*choice_.info)->camera, topic, is_rectified, out.info, message);
}

double BagCalibrator::units_per_m() const {
    if (options_.depth_units_per_m > 0) return options_.depth_units_per_m;
    if (options_.camera) return options_.camera->depth_units_per_m;
    if (is_in_metres(survey_.seen(choice_.depth)->coding)) return kUnitsOfMetres_per_m;
    if (!choice_.depth_unit_m || !(*choice_.depth_unit_m > 1e-5F && *choice_.depth_unit_m <= 0.01F)) {
        return kMillimetres_per_m;
    }
    const double units = 1 / double{*choice_.depth_unit_m};
    const double whole = std::round(units);  // a float's .001
    return std::fabs(units - whole) < 1e-6 * whole ? whole : units;
}

// Where frame and camera differ, depth is of another eye: a pixel of colour has another's depth.
bool BagCalibrator::is_registered(BagCalibration& out) const {
    const SeenTopic& colour = *survey_.seen(choice_.colour);
    const SeenTopic& depth = *survey_.seen(choice_.depth);
    // RealSense's own recordings give all streams one frame.
    const bool has_frames = !name_of(choice_.colour).ends_with("/image/data");
    if (has_frames && colour.frame_id == depth.frame_id) return true;
    const SeenTopic* const colour_info = choice_.info ? survey_.seen(*choice_.info) : nullptr;
    const SeenTopic* const depth_info = choice_.depth_info ? survey_.seen(*choice_.depth_info) : nullptr;
    if (colour_info != nullptr && depth_info != nullptr) return is_same_view(*colour_info->camera, *depth_info->camera);
    out.notes.push_back("depth is in frame '" + depth.frame_id + "', colour in '" + colour.frame_id +
                        "', and no two CameraInfo say how they lie: taken for the same view.");
    return true;
}

Status BagCalibrator::place_depth(BagCalibration& out, std::string& message) const {
    const SeenTopic& colour = *survey_.seen(choice_.colour);
    const SeenTopic& depth = *survey_.seen(choice_.depth);
    std::optional<SeparateDepth>& separate = out.info.separate_depth;
    const bool is_of_file =
        separate && separate->model.width == depth.size.width && separate->model.height == depth.size.height;
    if (is_of_file) {
        out.notes.push_back("depth is of the depth camera in " + out.source + ": registered to colour.");
        return Status::kOk;
    }
    separate.reset();
    if (is_registered(out)) return Status::kOk;
    std::optional<RigidTransform> pose =
        between_streams(survey_.frames(), name_of(choice_.depth), name_of(choice_.colour));
    if (!pose && depth.frame_id != colour.frame_id) pose = survey_.frames().between(depth.frame_id, colour.frame_id);
    if (!pose) {
        message = options_.path + ": depth (" + name_of(choice_.depth) + ") is not registered to colour (" +
                  name_of(choice_.colour) +
                  "): another frame and another camera, and no transform between them in the bag; record /tf_static, "
                  "too, or the topic of aligned depth (RealSense: align_depth, /aligned_depth_to_color/image_raw; "
                  "OpenNI: /depth_registered/image_raw) and name it with --topics, or give both cameras with "
                  "--calibration (docs/recordings.md, \"Two cameras\").";
        return Status::kInvalid;
    }
    CameraInfo info;
    const std::string& topic = name_of(*choice_.depth_info);
    const bool is_rectified = is_rectified_name(name_of(choice_.depth));
    STILLMESH_TRY(camera_of_message(*survey_.seen(*choice_.depth_info)->camera, topic, is_rectified, info, message));
    if (info.model.width != depth.size.width || info.model.height != depth.size.height) {
        message = "topic " + topic + ": is for " + std::to_string(info.model.width) + "x" +
                  std::to_string(info.model.height) + " pixels, the depth images are " +
                  std::to_string(depth.size.width) + "x" + std::to_string(depth.size.height) + ".";
        return Status::kInvalid;
    }
    separate = SeparateDepth{info.model, *pose};
    out.notes.push_back("depth is of a camera of its own (" + topic + "): registered to colour.");
    return Status::kOk;
}

}  // namespace

Status calibrate(const BagOptions& options, const BagTopics& topics, const TopicSurvey& survey,
                 const TopicChoice& choice, BagCalibration& out, std::string& message) {
    const BagCalibrator calibrator(options, topics, survey, choice);
    out = {};
    STILLMESH_TRY(calibrator.find_lens(out, message));
    out.info.depth_units_per_m = calibrator.units_per_m();
    return calibrator.place_depth(out, message);
}

}  // namespace stillmesh
