#include "platform/cli/live_view.hpp"

#include <algorithm>
#include <cmath>

#include "engine/geometry/lens.hpp"

namespace stillmesh {
namespace {

// A picture to look at: every few pixels the mean of two on the diagonal between them.
void shrink(const Frame& frame, ViewSnapshot& to) {
    const std::uint32_t width = frame.colour.width, height = frame.colour.height;
    std::uint32_t factor = std::max<std::uint32_t>(1, (width + kViewWidthMax - 1) / kViewWidthMax);
    while ((width / factor) * (height / factor) > kViewPixelsMax) ++factor;
    to.image_width = width;
    to.image_height = height;
    to.picture_width = width / factor;
    to.picture_height = height / factor;
    to.grey.resize(std::size_t{to.picture_width} * to.picture_height);
    const std::uint32_t channels = channels_of(frame.format);
    const std::size_t half = factor / 2;
    std::uint8_t* pixel = to.grey.data();
    for (std::uint32_t y = 0; y < to.picture_height; ++y) {
        const std::uint8_t* above = frame.colour.row(y * factor);
        const std::uint8_t* below = frame.colour.row(static_cast<std::uint32_t>(y * factor + half)) + half * channels;
        const std::size_t step = std::size_t{factor} * channels;
        for (std::uint32_t x = 0; x < to.picture_width; ++x, above += step, below += step) {
            *pixel++ = static_cast<std::uint8_t>(
                channels == 1 ? (above[0] + below[0]) / 2
                              : (above[0] + below[0] + 2 * (above[1] + below[1]) + above[2] + below[2]) / 8);
        }
    }
}

[[nodiscard]] std::int16_t steps(float px) {
    return static_cast<std::int16_t>(std::lround(std::clamp(px * kViewStepsPerPixel, 0.0F, 32767.0F)));
}

void copy_mesh(const TrackingView& view, ViewSnapshot& to) {
    to.kept.clear();
    to.cut.clear();
    to.features.clear();
    for (const TrackedEdge& edge : view.edges) {
        std::vector<ShownEdge>& edges = edge.is_kept ? to.kept : to.cut;
        if (edges.size() == kViewEdgesMax) continue;
        edges.push_back({steps(edge.x0), steps(edge.y0), steps(edge.x1), steps(edge.y1)});
    }
    for (const TrackedFeature& feature : view.features) {
        if (to.features.size() == kViewFeaturesMax) break;
        const auto kind = feature.is_static    ? ShownFeature::kStatic
                          : feature.is_dynamic ? ShownFeature::kMoving
                                               : ShownFeature::kNeither;
        to.features.push_back({steps(feature.x), steps(feature.y),
                               static_cast<std::int16_t>(std::min(feature.group, std::int32_t{32767})), kind});
    }
}

}  // namespace

LiveView::LiveView(ViewFeed* feed, const CameraModel& camera, std::int64_t frame_period_ns)
    : feed_(feed), camera_(camera), budget_ms_(static_cast<float>(frame_period_ns) * 1e-6F) {}

void LiveView::fill(const Moment& moment, const Frame& frame, ViewSnapshot& to) const {
    to.frame = moment.frame;
    to.time_ns = frame.time_ns;
    to.map = moment.map;
    to.frame_ms = moment.frame_ms;
    to.budget_ms = budget_ms_;
    shrink(frame, to);
}

void LiveView::frame(const Moment& moment, const Frame& frame, const SessionFrame& out, TrackingSession& session) {
    if (feed_ == nullptr) return;
    const bool is_due = feed_->is_due(moment.now_ns);
    const bool has_pose = out.state != PoseState::kNone;
    const RigidTransform pose = {{out.world_from_camera.q[0], out.world_from_camera.q[1], out.world_from_camera.q[2],
                                  out.world_from_camera.q[3]},
                                 {out.world_from_camera.t[0], out.world_from_camera.t[1], out.world_from_camera.t[2]}};
    if (has_pose) {
        feed_->place(frame.time_ns,
                     {static_cast<float>(pose.translation_m[0]), static_cast<float>(pose.translation_m[1]),
                      static_cast<float>(pose.translation_m[2]), static_cast<float>(out.state)});
    }
    const bool is_keyframe = out.statistics.is_keyframe && out.state == PoseState::kTracked;
    if (!is_due && !is_keyframe) return;
    ViewSnapshot& to = feed_->draft();
    if (is_due) to.keyframes.resize(kViewKeyframesMax);
    if (!session.look(look_, is_due ? std::span(to.keyframes) : std::span<KeyframePose>())) look_ = {};
    if (is_keyframe) {
        cloud_.keyframe = out.statistics.frame;
        keep_cloud(frame, look_);
    }
    if (!is_due) return;
    fill(moment, frame, to);
    to.state = out.state;
    to.reason = out.state != out.estimate.state ? "camera fault" : unsure_reason_name(out.unsure);
    to.map_from_camera = pose;
    to.keyframes.resize(look_.keyframes_written);
    copy_mesh(look_.tracking, to);
    to.statistics = out.statistics;
    to.stage_ms = look_.stage_ms;
    to.keyframe_pool = look_.keyframes;
    to.point_pool = look_.map_points;
    to.queue_pool = look_.keyframe_queue;
    feed_->hand_over();
}

void LiveView::no_pose(const Moment& moment, const Frame& frame, const char* reason) {
    if (feed_ == nullptr || !feed_->is_due(moment.now_ns)) return;
    ViewSnapshot& to = feed_->draft();
    fill(moment, frame, to);
    to.state = PoseState::kNone;
    to.reason = reason;
    copy_mesh({}, to);
    to.statistics = {};
    to.stage_ms = {};
    feed_->hand_over();
}

// What stood still, spread over the image as the features are, with the depth right below them.
void LiveView::keep_cloud(const Frame& frame, const SessionLook& look) {
    cloud_.count = 0;
    std::size_t still = 0;
    for (const TrackedFeature& feature : look.tracking.features) still += feature.is_static ? 1 : 0;
    const std::size_t stride = 1 + still / ViewCloud::kPointsMax;
    std::size_t index = 0;
    for (const TrackedFeature& feature : look.tracking.features) {
        if (!feature.is_static || index++ % stride != 0) continue;
        const auto x = static_cast<std::uint32_t>(std::max(feature.x, 0.0F) + 0.5F);
        const auto y = static_cast<std::uint32_t>(std::max(feature.y, 0.0F) + 0.5F);
        if (x >= frame.depth.width || y >= frame.depth.height || cloud_.count == ViewCloud::kPointsMax) continue;
        const double z = frame.depth.at(x, y) / frame.depth_units_per_m;
        if (z <= 0) continue;
        const ImagePoint ray = ray_of_pixel(camera_, {static_cast<double>(feature.x), static_cast<double>(feature.y)});
        const auto mm = [](double metres) {
            return static_cast<std::int16_t>(std::lround(std::clamp(1000 * metres, -32767.0, 32767.0)));
        };
        const std::uint8_t* const pixel = frame.colour.row(y) + std::size_t{x} * channels_of(frame.format);
        const std::int16_t grey = channels_of(frame.format) == 1 ? pixel[0] : pixel[1];
        cloud_.points[cloud_.count++] = {mm(ray.x * z), mm(ray.y * z), mm(z), grey};
    }
    if (cloud_.count > 0) feed_->cloud(cloud_);
}

}  // namespace stillmesh
