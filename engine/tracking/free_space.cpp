#include "engine/tracking/free_space.hpp"

#include <algorithm>

#include "engine/base/time.hpp"
#include "engine/geometry/camera.hpp"

namespace stillmesh {
namespace {

// A point not seen for so long a way (a radian counts as a metre) may be off by more than a body is deep: at the end of
// a lap that drifted, the room itself would come into the free space of its beginning.
constexpr double kWayMax_m = 5;

// Of the new features, that came; fewer are the edges of things that stand (without it sitting_rpy:19 .031 for .005). A
// tenth does as well for boxes on a trolley, three tenths do not (.042 for .0077).
constexpr double kCameShare = 0.2;

constexpr double kNearest_m = 0.1;  // nearer is behind the keyframe's camera, or in its glass

void count(std::uint8_t& votes) noexcept {
    if (votes < 255) ++votes;
}

}  // namespace

void FreeSpace::create(Arena& arena, const Limits& limits, const Parameters& configuration) noexcept {
    parameters_ = &configuration;
    grid_.create(arena, limits);
    places_ = arena.array<Place>(limits.features_max);
    votes_ = arena.array<Votes>(limits.features_max);
}

void FreeSpace::ask(const PosedFrame& posed, const MapMatcher& matcher, const World& world) noexcept {
    std::fill_n(votes_.begin(), posed.frame.size(), Votes{});
    has_come_ = false;
    if (!(parameters_->emptiness.ray_px > 0)) return;
    const Pool<Keyframe>& keyframes = world.map.keyframes();
    for (std::uint32_t slot = 0; slot < keyframes.slots_count(); ++slot) {
        if (!keyframes.is_taken(slot) || world.local_map.keyframes()[slot] == 0) continue;
        ask_keyframe(posed, matcher, world, keyframes.at(slot));
        for (const Observation& observation : world.map.observations(keyframes.handle_of(slot))) {
            const MapPoint* const point = world.map.points().find(observation.point);
            if (observation.var_z >= 0 && point != nullptr && is_witness(*point, posed)) vote(observation, posed.frame);
        }
    }
    std::uint32_t fresh = 0;
    std::uint32_t came = 0;
    for (std::size_t i = 0; i < posed.frame.size(); ++i) {
        if (!matcher.claim(i).is_free() || !posed.frame[i].has_depth()) continue;
        ++fresh;
        came += was_empty(i) ? 1U : 0U;
    }
    has_come_ = came > kCameShare * fresh;
}

// A point that is known to stand still, where it is: one that may move says nothing of what was there.
bool FreeSpace::is_witness(const MapPoint& point, const PosedFrame& posed) const noexcept {
    return !point.is_suspect && seconds_between(point.created_ns, posed.time_ns) >= parameters_->weights.proven_s &&
           posed.travelled - static_cast<double>(point.agreed_travelled) <= kWayMax_m;
}

// Where the keyframe would have seen the new features.
void FreeSpace::ask_keyframe(const PosedFrame& posed, const MapMatcher& matcher, const World& world,
                             const Keyframe& keyframe) noexcept {
    const SE3 then_from_now = keyframe.world_from_camera.inverse() * posed.world_from_camera;
    std::size_t places = 0;
    for (std::size_t i = 0; i < posed.frame.size(); ++i) {
        if (!matcher.claim(i).is_free() || !posed.frame[i].has_depth()) continue;
        const Vector3 q = then_from_now * posed.frame[i].point();
        Vector2 pixel;
        if (!project(world.camera, q, kNearest_m, pixel) || !is_in_picture(world.camera, pixel)) continue;
        places_[places++] = {static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), static_cast<float>(q.z()),
                             static_cast<std::uint16_t>(i)};
    }
    grid_.build(world.camera.width, world.camera.height, std::span<const Place>(places_.first(places)));
}

void FreeSpace::vote(const Observation& observation, const MeasuredFrame& frame) noexcept {
    const double radius = parameters_->emptiness.ray_px;
    const WeightParameters& weights = parameters_->weights;
    const auto x = static_cast<double>(observation.x);
    const auto y = static_cast<double>(observation.y);
    grid_.visit_near(x, y, radius, [&](std::uint32_t i) {
        const Place& place = places_[i];
        const double dx = static_cast<double>(place.x) - x;
        const double dy = static_cast<double>(place.y) - y;
        if (dx * dx + dy * dy > radius * radius) return;
        const double behind = static_cast<double>(observation.z_m - place.z_m);
        const double noise = frame[place.feature].var_z + static_cast<double>(observation.var_z);
        const double body = weights.near_m * weights.near_m + weights.near_sigmas * weights.near_sigmas * noise;
        Votes& votes = votes_[place.feature];
        if (behind * behind <= body) {
            count(votes.there);
        } else if (behind > 0) {
            count(votes.behind);
        }
    });
}

}  // namespace stillmesh
