#include "engine/map/map.hpp"

namespace stillmesh {

const char* Map::find_fault() const noexcept {
    const std::uint32_t count = keyframes_.slots_count();
    for (std::uint32_t a = 0; a < count; ++a) {
        if (!keyframes_.is_taken(a)) {
            for (std::uint32_t b = 0; b < count; ++b) {
                if (shared(a, b) != 0) return "a free keyframe shares points";
            }
            continue;
        }
        const std::span<const Observation> seen = observations(keyframes_.handle_of(a));
        for (const Observation& o : seen) {
            if (points_.find(o.point) != nullptr && !is_observed_by(o.point.slot(), a)) return "an observer has no bit";
        }
        for (std::uint32_t b = 0; b < count; ++b) {
            if (shared(a, b) != shared(b, a)) return "the numbers of shared points are not symmetric";
            std::uint32_t together = 0;
            if (b != a && keyframes_.is_taken(b)) {
                for (const Observation& o : seen) {
                    if (points_.find(o.point) == nullptr) continue;
                    for (const Observation& p : observations(keyframes_.handle_of(b))) {
                        together += p.point == o.point ? 1U : 0U;
                    }
                }
            }
            if (together != shared(a, b)) return "a number of shared points is wrong";
        }
    }
    for (std::uint32_t slot = 0; slot < points_.slots_count(); ++slot) {
        std::uint32_t bits = 0;
        const char* fault = nullptr;
        visit_observers(slot, [&](std::uint32_t keyframe) {
            ++bits;
            if (keyframe >= count || !keyframes_.is_taken(keyframe) || !points_.is_taken(slot)) {
                fault = "a bit without keyframe or point";
                return;
            }
            std::uint32_t times = 0;
            for (const Observation& o : observations(keyframes_.handle_of(keyframe))) {
                times += o.point == points_.handle_of(slot) ? 1U : 0U;
            }
            if (times != 1) fault = "a keyframe observes a point never or twice";
        });
        if (fault != nullptr) return fault;
        if (!points_.is_taken(slot)) continue;
        const MapPoint& point = points_.at(slot);
        if (point.observers != bits) return "a number of observers is wrong";
        if (bits == 0) {
            if (!point.reference.is_null()) return "a reference without observers";
        } else if (keyframes_.find(point.reference) == nullptr || !is_observed_by(slot, point.reference.slot())) {
            return "a reference that does not observe";
        }
    }
    std::uint32_t roots = 0;
    for (std::uint32_t slot = 0; slot < count; ++slot) {
        if (!keyframes_.is_taken(slot)) continue;
        std::uint32_t at = slot;
        for (std::uint32_t steps = 0; !keyframes_.at(at).parent.is_null(); ++steps) {
            if (keyframes_.find(keyframes_.at(at).parent) == nullptr) return "a parent that is gone";
            if (steps > count) return "the spanning tree has a ring";
            at = keyframes_.at(at).parent.slot();
        }
        roots += at == slot ? 1U : 0U;
    }
    if (keyframes_.size() > 0 && roots != 1) return "the spanning tree has not one root";
    return nullptr;
}

}  // namespace stillmesh
