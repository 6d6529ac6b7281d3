#include "engine/loop_closing/essential_graph.hpp"

#include <algorithm>

namespace stillmesh {
namespace {

constexpr std::uint32_t kStrong = 6;  // covisible keyframes of each that become edges
// What one edge of odometry is worth, with kSharedUsual points shared; a loop has been measured with care.
constexpr double kEdge_m = 0.01;
constexpr double kEdge_rad = 0.004;
constexpr double kSharedUsual = 100;
constexpr double kLoop_m = 0.005;
constexpr double kLoop_rad = 0.002;

}  // namespace

void EssentialGraph::create(Arena& arena, World& world, std::uint32_t keyframes_max) noexcept {
    world_ = &world;
    graph_.create(arena, {keyframes_max, edges_max(keyframes_max)});
    nodes_.create(arena, keyframes_max);
    loops_.create(arena, loops_max(keyframes_max));
    reset();
}

void EssentialGraph::reset() noexcept {
    graph_.begin();
    loops_.clear();
}

std::uint32_t EssentialGraph::build(std::uint64_t settled_end) noexcept {
    graph_.begin();
    nodes_.clear();
    std::uint32_t units = add_nodes();
    // First what must not be missing.
    add_tree();
    add_loops();
    units += add_covisible(settled_end);
    graph_.start(PoseGraphOptions{});
    return units;
}

// Parents before children.
std::uint32_t EssentialGraph::add_nodes() noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    const std::uint32_t slots = keyframes.slots_count();
    std::uint32_t units = 1;
    for (bool has_grown = true; has_grown;) {
        has_grown = false;
        units += slots / 64;
        for (std::uint32_t slot = 0; slot < slots; ++slot) {
            if (!keyframes.is_taken(slot) || nodes_.has(slot)) continue;
            const Keyframe& keyframe = keyframes.at(slot);
            std::uint32_t parent = PoseGraph::kNoParent;
            if (!keyframe.parent.is_null()) {
                if (!nodes_.has(keyframe.parent.slot())) continue;
                parent = nodes_.number(keyframe.parent.slot());
            }
            const auto added = graph_.add_node(keyframe.world_from_camera, parent);
            STILLMESH_CHECK(added.is_ok());
            nodes_.add(world_->map, slot, added.value());
            has_grown = true;
        }
    }
    return units;
}

void EssentialGraph::add_edge(std::uint32_t slot_a, std::uint32_t slot_b) noexcept {
    const Map& map = world_->map;
    const double share = std::clamp(static_cast<double>(map.shared(slot_a, slot_b)) / kSharedUsual, 0.2, 3.0);
    const SE3 a_from_b =
        map.keyframes().at(slot_a).world_from_camera.inverse() * map.keyframes().at(slot_b).world_from_camera;
    // Full: those that came first are the most needed.
    static_cast<void>(graph_.add_edge({nodes_.number(slot_a), nodes_.number(slot_b), a_from_b,
                                       share / (kEdge_m * kEdge_m), share / (kEdge_rad * kEdge_rad)}));
}

void EssentialGraph::add_tree() noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!nodes_.has(slot) || keyframes.at(slot).parent.is_null()) continue;
        add_edge(keyframes.at(slot).parent.slot(), slot);
    }
}

void EssentialGraph::add_loops() noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    for (std::size_t i = 0; i < loops_.size(); ++i) {
        const Loop& loop = loops_[i];
        if (keyframes.find(loop.a) == nullptr || keyframes.find(loop.b) == nullptr) continue;
        static_cast<void>(graph_.add_edge({nodes_.number(loop.a.slot()), nodes_.number(loop.b.slot()), loop.a_from_b,
                                           1.0 / (kLoop_m * kLoop_m), 1.0 / (kLoop_rad * kLoop_rad)}));
    }
}

std::uint32_t EssentialGraph::list_loops(std::size_t pending, std::span<KeyframeLink> out) const noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    std::uint32_t count = 0;
    for (std::size_t i = loops_.size() - std::min(pending, loops_.size()); i-- > 0 && count < out.size();) {
        const Keyframe* const older = keyframes.find(loops_[i].a);
        const Keyframe* const newer = keyframes.find(loops_[i].b);
        if (older == nullptr || newer == nullptr) continue;
        out[count++] = {older->frame, newer->frame, world_->map.shared(loops_[i].a.slot(), loops_[i].b.slot()),
                        KeyframeLinkKind::kLoop};
    }
    return count;
}

std::uint32_t EssentialGraph::add_covisible(std::uint64_t settled_end) noexcept {
    const Pool<Keyframe>& keyframes = world_->map.keyframes();
    const std::uint32_t slots = keyframes.slots_count();
    const std::uint32_t strong = std::max(world_->limits.features_max / 10, world_->parameters.map.shared_min);
    std::uint32_t units = 0;
    for (std::uint32_t slot = 0; slot < slots; ++slot) {
        if (!nodes_.has(slot)) continue;
        std::uint32_t best[kStrong] = {};
        const std::uint32_t count = world_->map.best_covisible(slot, best, strong);
        units += 8 + slots / 16;
        const Keyframe& keyframe = keyframes.at(slot);
        for (std::uint32_t i = 0; i < count; ++i) {
            const Keyframe& other = keyframes.at(best[i]);
            if (other.frame >= keyframe.frame) continue;
            if (keyframe.parent.slot_plus_one == best[i] + 1 || other.parent.slot_plus_one == slot + 1) continue;
            // What tracking matched across the gap before a loop corrected it says nothing about where it lies.
            const bool is_settled = keyframe.frame < settled_end;
            if (!is_settled && keyframe.frame - other.frame >= world_->parameters.loop.gap_frames) continue;
            add_edge(best[i], slot);
        }
    }
    return units;
}

}  // namespace stillmesh
