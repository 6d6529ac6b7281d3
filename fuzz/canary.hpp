// Bugs that were planted on purpose, in fuzz_canary_map and fuzz_canary_engine alone: code around the engine that
// trusts what nobody promised. fuzz/run has to find both within a minute; a fuzzer that does not is too slow, or blind.
// No seed meets them: the first waits for one byte in some thousand edits, the second for a long run that maps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "engine/outputs.hpp"
#include "engine/record/map_records.hpp"

namespace stillmesh::fuzz {

// How many points there are of each weight, in a table as long as somebody thought that weights become: writes past its
// end in a map with a heavier one, which the engine takes. `map`: one that it took.
inline void count_weights(std::span<const std::byte> map, const MapFileInfo& info) {
    constexpr std::size_t kWeightAt = 151;  // docs/SPEC-map.md
    constexpr std::size_t kWeights = 150;   // in tenths
    const auto counts = std::make_unique<std::uint32_t[]>(kWeights);
    const auto points = static_cast<std::size_t>(
        map_records::records_at(info, static_cast<std::uint32_t>(map_records::Section::kPoints)));
    for (std::uint32_t i = 0; i < info.points; ++i) {
        ++counts[std::to_integer<std::size_t>(map[points + i * map_records::kPointBytes + kWeightAt])];
    }
}

// The frames at which keyframes were made, in a list as long as somebody thought that so few frames need.
class KeyframeList {
public:
    void note(const EngineStatistics& statistics) {
        if (statistics.keyframes_made > made_) frames_[made_ = statistics.keyframes_made] = statistics.frames;
    }

private:
    static constexpr std::size_t kLength = 8;
    std::unique_ptr<std::uint64_t[]> frames_ = std::make_unique<std::uint64_t[]>(kLength);
    std::uint64_t made_ = 0;
};

}  // namespace stillmesh::fuzz
