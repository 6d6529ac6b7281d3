#include "platform/evaluation/final_trajectory.hpp"

#include <cmath>

namespace stillmesh {
namespace {

using Quaternion = std::array<double, 4>;
using Translation = std::array<double, 3>;

Translation rotate(const Quaternion& q, const Translation& p) {
    // p + 2 w (u x p) + 2 u x (u x p)
    const Translation c = {q[1] * p[2] - q[2] * p[1], q[2] * p[0] - q[0] * p[2], q[0] * p[1] - q[1] * p[0]};
    const Translation d = {q[1] * c[2] - q[2] * c[1], q[2] * c[0] - q[0] * c[2], q[0] * c[1] - q[1] * c[0]};
    return {p[0] + 2 * (q[3] * c[0] + d[0]), p[1] + 2 * (q[3] * c[1] + d[1]), p[2] + 2 * (q[3] * c[2] + d[2])};
}

double distance2(const TrajectoryPose& a, const TrajectoryPose& b) {
    double sum = 0;
    for (std::size_t i = 0; i < 3; ++i) sum += (a.t[i] - b.t[i]) * (a.t[i] - b.t[i]);
    return sum;
}

}  // namespace

TrajectoryPose compose(const TrajectoryPose& a, const TrajectoryPose& b) {
    TrajectoryPose out;
    out.time_ns = b.time_ns;
    const Translation turned = rotate(a.q, b.t);
    for (std::size_t i = 0; i < 3; ++i) out.t[i] = turned[i] + a.t[i];
    out.q = {a.q[3] * b.q[0] + a.q[0] * b.q[3] + a.q[1] * b.q[2] - a.q[2] * b.q[1],
             a.q[3] * b.q[1] + a.q[1] * b.q[3] + a.q[2] * b.q[0] - a.q[0] * b.q[2],
             a.q[3] * b.q[2] + a.q[2] * b.q[3] + a.q[0] * b.q[1] - a.q[1] * b.q[0],
             a.q[3] * b.q[3] - a.q[0] * b.q[0] - a.q[1] * b.q[1] - a.q[2] * b.q[2]};
    double norm = 0;
    for (const double v : out.q) norm += v * v;
    norm = std::sqrt(norm);
    for (double& v : out.q) v /= norm;
    return out;
}

TrajectoryPose inverse_of(const TrajectoryPose& pose) {
    TrajectoryPose out;
    out.time_ns = pose.time_ns;
    out.q = {-pose.q[0], -pose.q[1], -pose.q[2], pose.q[3]};
    const Translation turned = rotate(out.q, pose.t);
    for (std::size_t i = 0; i < 3; ++i) out.t[i] = -turned[i];
    return out;
}

void FinalTrajectory::update(std::span<const KeyframeNow> keyframes) {
    ++updates_;
    std::vector<std::uint64_t> before;
    before.swap(alive_);
    for (const KeyframeNow& now : keyframes) keyframes_[now.id].seen = updates_;
    // Who left is re-expressed as the two lay at the last update: poses are those still.
    for (const std::uint64_t id : before) {
        Kept& kept = keyframes_[id];
        if (kept.seen == updates_) continue;
        std::uint64_t instead = kept.parent_id;
        const auto stays = [this](std::uint64_t other) {
            const auto found = keyframes_.find(other);
            return found != keyframes_.end() && found->second.seen == updates_;
        };
        if (instead == KeyframeNow::kNone || !stays(instead)) {
            instead = KeyframeNow::kNone;
            double nearest = 0;
            for (const std::uint64_t other : before) {
                if (!stays(other)) continue;
                const double distance = distance2(keyframes_[other].pose, kept.pose);
                if (instead != KeyframeNow::kNone && distance >= nearest) continue;
                nearest = distance;
                instead = other;
            }
        }
        if (instead == KeyframeNow::kNone) continue;  // nobody is left: it stays where it was
        kept.instead_id = instead;
        kept.instead_from_this = compose(inverse_of(keyframes_[instead].pose), kept.pose);
    }
    for (const KeyframeNow& now : keyframes) {
        Kept& kept = keyframes_[now.id];
        kept.pose = now.pose;
        kept.parent_id = now.parent_id;
        kept.instead_id = KeyframeNow::kNone;
        alive_.push_back(now.id);
    }
}

void FinalTrajectory::add(const TrajectoryPose& map_from_camera, std::uint64_t reference) {
    FrameKept frame;
    frame.pose = map_from_camera;
    const auto found = keyframes_.find(reference);
    if (reference != KeyframeNow::kNone && found != keyframes_.end()) {
        frame.reference = reference;
        frame.pose = compose(inverse_of(found->second.pose), map_from_camera);
    }
    frames_.push_back(frame);
}

void FinalTrajectory::straighten(std::int64_t since_ns) {
    for (std::size_t i = frames_.size(); i-- > 1 && frames_[i - 1].pose.time_ns > since_ns;)
        frames_[i - 1].has_strayed = true;
}

void FinalTrajectory::straighten(Trajectory& path) const {
    std::size_t before = 0;
    for (std::size_t i = 1; i < path.size(); ++i) {
        if (frames_[i].has_strayed) continue;
        const TrajectoryPose& a = path[before];
        const TrajectoryPose& b = path[i];
        for (std::size_t k = before + 1; k < i; ++k) {
            const double share =
                static_cast<double>(path[k].time_ns - a.time_ns) / static_cast<double>(b.time_ns - a.time_ns);
            for (std::size_t j = 0; j < 3; ++j) path[k].t[j] = a.t[j] + share * (b.t[j] - a.t[j]);
        }
        before = i;
    }
}

Trajectory FinalTrajectory::finish() const {
    Trajectory out;
    out.reserve(frames_.size());
    for (const FrameKept& frame : frames_) {
        TrajectoryPose pose = frame.pose;
        std::uint64_t at = frame.reference;
        // Each stands for one that left before it: the chain ends.
        while (at != KeyframeNow::kNone) {
            const Kept& kept = keyframes_.at(at);
            pose = compose(kept.instead_id != KeyframeNow::kNone ? kept.instead_from_this : kept.pose, pose);
            at = kept.instead_id;
        }
        out.push_back(pose);
    }
    straighten(out);
    return out;
}

}  // namespace stillmesh
