// Loop closing (paper, method.md 9): every keyframe, once it is no longer the newest and its weights have settled, is
// looked up by the words of its static points. A place that scores like a neighbour, again and again (k queries agree),
// is verified by geometry; then
//   solve    pose graph over the essential graph: spanning tree, strong covisibility, loops
//   commit   in one bounded step keyframes, points and the camera move: newer keyframes follow their parent, points
//            their reference keyframe; map_from_odom takes the jump. A local adjustment that runs is dropped.
//   fuse     what both sides know of the place becomes one
// A place that the map has where verification puts it is confirmed, not corrected: tracking has come home by itself.
// Tracking never waits. Beyond the paper: a loop that would need more drift than odometry can have gathered on the way
// is none, however alike the places are (rooms of one building look alike).
// Limits: those of its parts. Units: a residual or an edge evaluated, 32 descriptors compared, 32 postings. No piece
// takes more than piece_units_max(); the result does not depend on how the pieces are cut into slices.
#pragma once

#include <cstdint>
#include <span>

#include "engine/loop_closing/essential_graph.hpp"
#include "engine/loop_closing/loop_candidates.hpp"
#include "engine/mapping/point_fusion.hpp"
#include "engine/recognition/place_search.hpp"
#include "engine/schedule/task.hpp"
#include "engine/world/world.hpp"

namespace stillmesh {

class LoopClosing final : public Task {
public:
    enum class Stage : std::uint8_t {
        kIdle,
        kWords,
        kQuery,
        kChoose,
        kPrepare,
        kVerify,
        kBuild,
        kSolve,
        kCommit,
        kFuseMatches,
        kFuseNeighbours,
    };
    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        EssentialGraph::plan(arena, World::loop_keyframes_max(limits));
        LoopCandidates::plan(arena, World::loop_keyframes_max(limits));
        FixedVector<PlaceMatch>::plan(arena, PlaceVerifier::pairs_max(limits));
    }
    void create(Arena& arena, World& world, PlaceSearch& places, PointFusion& fusion) noexcept;
    void reset() noexcept;

    [[nodiscard]] Progress step(WorkBudget& budget) noexcept override;
    // Loops that were closed or confirmed and whose keyframes are both there, the newest first, as many as fit. How
    // many.
    [[nodiscard]] std::uint32_t list_loops(std::span<KeyframeLink> out) const noexcept {
        const bool is_pending = stage_ >= Stage::kBuild && stage_ <= Stage::kCommit;
        return graph_.list_loops(is_pending ? 1 : 0, out);
    }
    [[nodiscard]] std::uint32_t piece_units_max() const noexcept { return piece_units_max_; }
    [[nodiscard]] Stage stage() const noexcept { return stage_; }

private:
    static constexpr std::uint32_t kFuseSources = 9;
    static constexpr std::uint32_t kFuseTargets = 6;

    [[nodiscard]] bool take() noexcept;
    void enter(Stage stage) noexcept;
    void finish() noexcept;
    [[nodiscard]] bool is_searching() const noexcept { return stage_ >= Stage::kWords && stage_ <= Stage::kVerify; }
    [[nodiscard]] std::uint32_t find_words() noexcept;
    [[nodiscard]] std::uint32_t choose() noexcept;
    [[nodiscard]] std::uint32_t prepare() noexcept;
    [[nodiscard]] std::uint32_t accept_or_refuse() noexcept;
    [[nodiscard]] std::uint32_t build() noexcept;
    [[nodiscard]] std::uint32_t commit() noexcept;
    [[nodiscard]] std::uint32_t fuse_matches() noexcept;
    [[nodiscard]] std::uint32_t fuse_neighbours() noexcept;
    [[nodiscard]] Refusal judge(const SE3& world_from_keyframe) const noexcept;
    void find_fuse_sides() noexcept;

    World* world_ = nullptr;  // this and the others outlive it
    PlaceSearch* places_ = nullptr;
    PointFusion* fusion_ = nullptr;
    EssentialGraph graph_;
    LoopCandidates candidates_;
    Handle<Keyframe> keyframe_;        // at hand
    Handle<Keyframe> found_;           // the place
    FixedVector<PlaceMatch> matches_;  // features of the keyframe, points of the place
    Handle<Keyframe> sources_[kFuseSources];
    std::uint32_t sources_count_ = 0;
    Handle<Keyframe> targets_[kFuseTargets];
    std::uint32_t targets_count_ = 0;
    Stage stage_ = Stage::kIdle;
    std::uint32_t cursor_ = 0;
    std::uint32_t source_ = 0, target_ = 0;
    std::uint64_t next_frame_ = 0;   // keyframes made before have been looked up
    std::uint64_t settled_end_ = 0;  // keyframes made before lie right
    std::uint32_t rest_ = 0;         // keyframes until a loop is sought again
    std::uint32_t piece_units_max_ = 0;
};

}  // namespace stillmesh
