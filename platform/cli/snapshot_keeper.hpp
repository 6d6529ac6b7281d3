// Keeps a few meshes spread over a run of unknown length, and the one with the most moving features.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "platform/cli/session.hpp"
#include "platform/report/png_writer.hpp"
#include "platform/report/run_record.hpp"

namespace stillmesh {

class SnapshotKeeper {
public:
    explicit SnapshotKeeper(std::uint32_t count_max) : count_max_(count_max) {}

    void frame(std::uint64_t index, const Frame& frame, const SessionFrame& out, TrackingSession& session) {
        if (count_max_ == 0) return;
        const float matched = static_cast<float>(out.static_features) + static_cast<float>(out.dynamic_features);
        const float dynamic_share = matched > 0 ? static_cast<float>(out.dynamic_features) / matched : 0.0F;
        if (out.state >= PoseState::kUnsure && matched > 50 && dynamic_share > busiest_.dynamic_share + 0.03F) {
            busiest_ = take(index, frame, out, session, dynamic_share);
        }
        if (index % stride_ != stride_ / 2) return;
        if (kept_.size() == std::size_t{2} * count_max_) {
            std::vector<MeshSnapshot> half;
            for (std::size_t i = 0; i < kept_.size(); i += 2) half.push_back(std::move(kept_[i]));
            kept_ = std::move(half);
            stride_ *= 2;
            if (index % stride_ != stride_ / 2) return;
        }
        kept_.push_back(take(index, frame, out, session, dynamic_share));
    }

    [[nodiscard]] std::vector<MeshSnapshot> finish() {
        std::vector<MeshSnapshot> chosen;
        const std::size_t wanted = std::min<std::size_t>(kept_.size(), count_max_);
        for (std::size_t i = 0; i < wanted; ++i) chosen.push_back(std::move(kept_[i * kept_.size() / wanted]));
        const auto distance = [this](const MeshSnapshot& s) {
            return s.frame > busiest_.frame ? s.frame - busiest_.frame : busiest_.frame - s.frame;
        };
        const auto nearest =
            std::min_element(chosen.begin(), chosen.end(),
                             [&](const MeshSnapshot& a, const MeshSnapshot& b) { return distance(a) < distance(b); });
        if (busiest_.width > 0) {  // in place of the one nearest to it
            if (nearest == chosen.end()) {
                chosen.push_back(std::move(busiest_));
            } else {
                *nearest = std::move(busiest_);
            }
        }
        std::sort(chosen.begin(), chosen.end(),
                  [](const MeshSnapshot& a, const MeshSnapshot& b) { return a.frame < b.frame; });
        return chosen;
    }

private:
    [[nodiscard]] static MeshSnapshot take(std::uint64_t index, const Frame& frame, const SessionFrame& out,
                                           TrackingSession& session, float dynamic_share) {
        MeshSnapshot snapshot;
        snapshot.frame = index;
        snapshot.time_ns = frame.time_ns;
        snapshot.state = out.state;
        snapshot.width = frame.colour.width;
        snapshot.height = frame.colour.height;
        snapshot.dynamic_share = dynamic_share;
        snapshot.grey_png = encode_grey_png(frame);
        session.draw(snapshot);
        return snapshot;
    }

    std::uint32_t count_max_;
    std::uint64_t stride_ = 8;
    std::vector<MeshSnapshot> kept_;
    MeshSnapshot busiest_;
};

}  // namespace stillmesh
