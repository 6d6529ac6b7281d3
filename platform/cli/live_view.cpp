#include "platform/cli/live_view.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

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
    for (std::size_t i = 0; i < view.features.size() && i < kViewFeaturesMax; ++i) {
        const TrackedFeature& feature = view.features[i];
        int kind = feature.is_static    ? ShownFeature::kStatic
                   : feature.is_dynamic ? ShownFeature::kMoving
                                        : ShownFeature::kNeither;
        const unsigned by = i < view.explained_by.size() ? view.explained_by[i] : 0U;
        if ((by & TrackingView::kByChoice) != 0) kind |= ShownFeature::kByChoice;
        if ((by & TrackingView::kByRival) != 0) kind |= ShownFeature::kByRival;
        to.features.push_back({steps(feature.x), steps(feature.y),
                               static_cast<std::int16_t>(std::min(feature.group, std::int32_t{32767})),
                               static_cast<std::int16_t>(kind)});
    }
}

[[nodiscard]] RigidTransform pose_of(const SessionFrame& out) {
    const TrajectoryPose& pose = out.world_from_camera;
    return {{pose.q[0], pose.q[1], pose.q[2], pose.q[3]}, {pose.t[0], pose.t[1], pose.t[2]}};
}

}  // namespace

LiveView::LiveView(ViewFeed* feed, RunFilm* film, const CameraModel& camera, std::int64_t frame_period_ns)
    : feed_(feed), film_(film), camera_(camera), budget_ms_(static_cast<float>(frame_period_ns) * 1e-6F) {}

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
    keep_place(frame, out);
    last_time_ns_ = frame.time_ns;
    const bool is_due = feed_->is_due(moment.now_ns);
    const bool is_rival = out.state == PoseState::kUnsure && out.unsure == UnsureReason::kRival;
    const bool is_picture = film_ != nullptr && film_->wants_picture(is_rival);
    const bool is_keyframe = out.statistics.is_keyframe && out.state == PoseState::kTracked;
    if (!is_due && !is_keyframe && film_ == nullptr) return;
    ViewSnapshot& to = feed_->draft();
    to.keyframes.resize(is_due ? kViewKeyframesMax : 0);
    to.links.resize(is_due ? kViewLinksMax : 0);
    if (!session.look(look_, to.keyframes, to.links)) look_ = {};
    if (is_keyframe) {
        cloud_.keyframe = out.statistics.frame;
        keep_cloud(frame, look_);
    }
    if (is_due || is_picture) {
        fill(moment, frame, to);
        copy_mesh(look_.tracking, to);
    }
    if (is_picture) film_->take(to, is_rival);
    if (film_ != nullptr) keep_on_film(moment, frame, out);
    if (!is_due) return;
    to.state = out.state;
    to.reason = out.state != out.estimate.state ? "camera fault" : unsure_reason_name(out.unsure);
    to.map_from_camera = pose_of(out);
    to.keyframes.resize(look_.keyframes_written);
    to.links.resize(look_.links_written);
    to.statistics = out.statistics;
    to.stage_ms = look_.stage_ms;
    to.keyframe_pool = look_.keyframes;
    to.point_pool = look_.map_points;
    to.queue_pool = look_.keyframe_queue;
    feed_->hand_over();
}

void LiveView::keep_place(const Frame& frame, const SessionFrame& out) {
    const bool has_pose = out.state != PoseState::kNone;
    // Where frames are missing nothing is known of the way between; as the report does (page/run.js).
    const double missing_ms = static_cast<double>(frame.time_ns - last_time_ns_) * 1e-6;
    if (missing_ms > std::max(250.0, 3.0 * static_cast<double>(budget_ms_))) had_pose_ = false;
    if (has_pose) {
        const auto& t = out.world_from_camera.t;
        const float state = static_cast<float>(out.state) + (had_pose_ ? 0.0F : kViewPlaceGap);
        const auto& q = out.world_from_camera.q;
        feed_->place(
            frame.time_ns, {static_cast<float>(t[0]), static_cast<float>(t[1]), static_cast<float>(t[2]), state},
            {static_cast<float>(q[0]), static_cast<float>(q[1]), static_cast<float>(q[2]), static_cast<float>(q[3])});
    }
    had_pose_ = has_pose;
}

void LiveView::keep_on_film(const Moment& moment, const Frame& frame, const SessionFrame& out) {
    FilmFrame kept;
    kept.time_ns = frame.time_ns;
    kept.number = static_cast<std::uint32_t>(moment.frame);
    kept.ms = moment.frame_ms;
    kept.features = out.features;
    kept.static_features = out.static_features;
    kept.moving_features = out.dynamic_features;
    kept.map = static_cast<std::uint16_t>(moment.map);
    kept.state = out.state;
    const bool is_camera_fault = out.state != out.estimate.state;
    kept.reason = is_camera_fault ? kFilmCameraFault : static_cast<std::uint8_t>(out.unsure);
    kept.chosen_percent = static_cast<std::uint8_t>(std::lround(100 * out.statistics.chosen_share));
    kept.rival_percent = static_cast<std::uint8_t>(std::lround(100 * out.statistics.rival_share));
    for (std::size_t i = 0; i < 3; ++i) kept.pose[i] = static_cast<float>(out.world_from_camera.t[i]);
    for (std::size_t i = 0; i < 4; ++i) kept.pose[3 + i] = static_cast<float>(out.world_from_camera.q[i]);
    kept.stage_ms = look_.stage_ms;
    film_->add(kept);
}

void LiveView::no_pose(const Moment& moment, const Frame& frame, const char* reason) {
    if (feed_ == nullptr) return;
    last_time_ns_ = frame.time_ns;
    had_pose_ = false;
    const bool is_picture = film_ != nullptr && film_->wants_picture();
    const bool is_due = feed_->is_due(moment.now_ns);
    if (is_due || is_picture) {
        fill(moment, frame, feed_->draft());
        copy_mesh({}, feed_->draft());
    }
    if (is_picture) film_->take(feed_->draft());
    if (film_ != nullptr) {
        FilmFrame kept;
        kept.time_ns = frame.time_ns;
        kept.number = static_cast<std::uint32_t>(moment.frame);
        kept.map = static_cast<std::uint16_t>(moment.map);
        kept.reason = kFilmOldPictures;
        film_->add(kept);
    }
    if (!is_due) return;
    ViewSnapshot& to = feed_->draft();
    to.state = PoseState::kNone;
    to.reason = reason;
    to.statistics = {};
    to.stage_ms = {};
    feed_->hand_over();
}

void LiveView::finish(TrackingSession& session) {
    if (film_ == nullptr) return;
    std::vector<KeyframePose> keyframes(kViewKeyframesMax);
    std::vector<KeyframeLink> links(kViewLinksMax);
    SessionLook look;
    if (!session.look(look, keyframes, links)) look = {};
    keyframes.resize(look.keyframes_written);
    links.resize(look.links_written);
    std::vector<ViewCloud> clouds;
    ViewCursor cursor;
    ViewNews news;
    do {
        feed_->look(cursor, news);
        clouds.insert(clouds.end(), news.clouds.begin(), news.clouds.end());
    } while (news.clouds.size() == kViewCloudsAtOnce);
    film_->finish(std::move(keyframes), std::move(links), std::move(clouds));
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
