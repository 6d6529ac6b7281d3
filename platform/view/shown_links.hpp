// The graph over the keyframes as pages draw it: pairs of places in the list of keyframes that goes with it, the older
// first. A link to a keyframe that is not in the list is left out. Cost: n log n in both.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "engine/outputs.hpp"

namespace stillmesh {

struct ShownLinks {
    using Pair = std::array<std::uint16_t, 2>;
    std::vector<Pair> covisible, loops;

    ShownLinks(std::span<const KeyframePose> keyframes, std::span<const KeyframeLink> links) {
        std::vector<std::pair<std::uint64_t, std::uint16_t>> places;
        places.reserve(keyframes.size());
        for (const KeyframePose& keyframe : keyframes) {
            places.emplace_back(keyframe.id, static_cast<std::uint16_t>(places.size()));
        }
        std::sort(places.begin(), places.end());
        for (const KeyframeLink& link : links) {
            const auto older =
                std::lower_bound(places.begin(), places.end(), std::pair(link.older_id, std::uint16_t{0}));
            const auto newer =
                std::lower_bound(places.begin(), places.end(), std::pair(link.newer_id, std::uint16_t{0}));
            if (older == places.end() || older->first != link.older_id) continue;
            if (newer == places.end() || newer->first != link.newer_id) continue;
            (link.kind == KeyframeLinkKind::kLoop ? loops : covisible).push_back({older->second, newer->second});
        }
    }
};

}  // namespace stillmesh
