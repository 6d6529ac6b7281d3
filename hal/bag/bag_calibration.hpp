// The camera of a bag: lens, units, and where its depth camera stands, if depth is not registered to colour: from the
// calibration that is given, else from CameraInfo and the transforms in the bag.
#pragma once

#include <string>
#include <vector>

#include "engine/base/status.hpp"
#include "hal/bag/bag_camera.hpp"
#include "hal/bag/topic_choice.hpp"

namespace stillmesh {

struct BagCalibration {
    CameraInfo info;  // with separate_depth where depth has to be registered
    std::string source;
    std::vector<std::string> notes;
};

// kInvalid: the camera cannot be used, or depth is of another eye and nothing says where that stands.
[[nodiscard]] Status calibrate(const BagOptions& options, const BagTopics& topics, const TopicSurvey& survey,
                               const TopicChoice& choice, BagCalibration& out, std::string& message);

}  // namespace stillmesh
