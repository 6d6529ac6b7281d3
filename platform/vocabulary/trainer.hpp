// Grows a vocabulary (docs/SPEC-vocabulary.md) from descriptors: hierarchical k-medians in Hamming distance, seeded as
// k-means++ (Arthur and Vassilvitskii 2007), words weighted by their rarity over the images (idf). The same
// descriptors, options and seed give the same bytes on every machine: whole numbers, own random numbers, own logarithm.
// Takes memory as it needs; some seconds for half a million descriptors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "engine/features/features.hpp"

namespace stillmesh {

struct TrainingSet {
    std::vector<Descriptor> descriptors;
    std::vector<std::uint32_t> image_of;  // of each descriptor; ascending from 0
    std::uint32_t images = 0;
};

struct TrainingOptions {
    std::uint32_t branching = 10;    // 2 to 32
    std::uint32_t levels = 4;        // 1 to 8
    std::uint32_t direct_level = 2;  // 1 to levels
    std::uint32_t rounds_max = 25;   // of moving medians, for each node
    std::uint64_t seed = 1;
    std::string name;               // printable ASCII, at most 47 letters
    std::uint32_t pattern_crc = 0;  // of the descriptors' sampling pattern
};

// Empty: `message` says why (no descriptors, options out of range, more words than the format has numbers for).
[[nodiscard]] std::vector<std::byte> train_vocabulary(const TrainingSet& set, const TrainingOptions& options,
                                                      std::string& message,
                                                      const std::function<void(const std::string&)>& say = {});

}  // namespace stillmesh
