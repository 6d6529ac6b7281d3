// Where a trainer's images come from: folders of PNGs, recordings, rendered scenes; and the features in them.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "platform/vocabulary/trainer.hpp"

namespace stillmesh {

struct ImageSources {
    std::vector<std::string> folders;  // all PNGs below, or the colour images of a recording (a folder with rgb.txt)
    std::vector<std::string> scenes;   // SCENE:SEED or SCENE:FIRST-LAST
    std::uint32_t every = 1;           // of a recording's images
    std::uint32_t frames = 8;          // of each rendered scene, evenly over its length
    std::uint32_t features = 1000;     // per image, at most
};

// Takes in all images, in an order that depends on nothing but their names. Images below 33 pixels or above 2047 and
// those that are neither 8-bit grey nor 8-bit RGB are left out and counted in `left_out`. False: `message` says why.
[[nodiscard]] bool collect_descriptors(const ImageSources& sources, TrainingSet& set, std::uint32_t& left_out,
                                       std::string& message, const std::function<void(const std::string&)>& say = {});

}  // namespace stillmesh
