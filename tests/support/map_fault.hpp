// Everything that a map keeps incrementally, computed anew.
#pragma once

#include <cstdint>
#include <span>

#include "engine/map/map.hpp"

namespace stillmesh::test {

// nullptr, or what is wrong. Slow: every pair of keyframes, every observation of both.
inline const char* find_fault(const Map& map) {
    const std::uint32_t count = map.keyframes().slots_count();
    for (std::uint32_t a = 0; a < count; ++a) {
        if (!map.keyframes().is_taken(a)) {
            for (std::uint32_t b = 0; b < count; ++b) {
                if (map.shared(a, b) != 0) return "a free keyframe shares points";
            }
            continue;
        }
        const std::span<const Observation> seen = map.observations(map.keyframes().handle_of(a));
        for (const Observation& o : seen) {
            if (map.points().find(o.point) != nullptr && !map.is_observed_by(o.point.slot(), a))
                return "an observer has no bit";
        }
        for (std::uint32_t b = 0; b < count; ++b) {
            if (map.shared(a, b) != map.shared(b, a)) return "the numbers of shared points are not symmetric";
            std::uint32_t together = 0;
            if (b != a && map.keyframes().is_taken(b)) {
                for (const Observation& o : seen) {
                    if (map.points().find(o.point) == nullptr) continue;
                    for (const Observation& p : map.observations(map.keyframes().handle_of(b))) {
                        together += p.point == o.point ? 1U : 0U;
                    }
                }
            }
            if (together != map.shared(a, b)) return "a number of shared points is wrong";
        }
    }
    for (std::uint32_t slot = 0; slot < map.points().slots_count(); ++slot) {
        std::uint32_t bits = 0;
        const char* fault = nullptr;
        map.visit_observers(slot, [&](std::uint32_t keyframe) {
            ++bits;
            if (keyframe >= count || !map.keyframes().is_taken(keyframe) || !map.points().is_taken(slot)) {
                fault = "a bit without keyframe or point";
                return;
            }
            std::uint32_t times = 0;
            for (const Observation& o : map.observations(map.keyframes().handle_of(keyframe))) {
                times += o.point == map.points().handle_of(slot) ? 1U : 0U;
            }
            if (times != 1) fault = "a keyframe observes a point never or twice";
        });
        if (fault != nullptr) return fault;
        if (!map.points().is_taken(slot)) continue;
        const MapPoint& point = map.points().at(slot);
        if (point.observers != bits) return "a number of observers is wrong";
        if (bits == 0) {
            if (!point.reference.is_null()) return "a reference without observers";
        } else if (map.keyframes().find(point.reference) == nullptr ||
                   !map.is_observed_by(slot, point.reference.slot())) {
            return "a reference that does not observe";
        }
    }
    std::uint32_t roots = 0;
    for (std::uint32_t slot = 0; slot < count; ++slot) {
        if (!map.keyframes().is_taken(slot)) continue;
        std::uint32_t at = slot;
        for (std::uint32_t steps = 0; !map.keyframes().at(at).parent.is_null(); ++steps) {
            if (map.keyframes().find(map.keyframes().at(at).parent) == nullptr) return "a parent that is gone";
            if (steps > count) return "the spanning tree has a ring";
            at = map.keyframes().at(at).parent.slot();
        }
        roots += at == slot ? 1U : 0U;
    }
    if (map.keyframes().size() > 0 && roots != 1) return "the spanning tree has not one root";
    return nullptr;
}

}  // namespace stillmesh::test
