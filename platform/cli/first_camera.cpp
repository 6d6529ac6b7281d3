#include "platform/cli/first_camera.hpp"

#include <utility>

#include "engine/base/check.hpp"

namespace stillmesh {

FirstLiveCamera::FirstLiveCamera(std::vector<Candidate> candidates) : candidates_(std::move(candidates)) {
    STILLMESH_CHECK(!candidates_.empty());
}

Status FirstLiveCamera::open() noexcept {
    if (has_chosen_) {
        const Status status = chosen().open();
        message_ = chosen().message();
        return status;
    }
    Status worst = Status::kUnavailable;
    std::string found;
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
        const Status status = candidates_[i].camera->open();
        chosen_ = i;
        if (status == Status::kOk) {
            has_chosen_ = true;
            message_.clear();
            return status;
        }
        candidates_[i].camera->close();
        // What has to be mended first is not waited for: `--camera v4l2` and its kind wait for one driver's camera.
        if (status != Status::kUnavailable) worst = status;
        found += (found.empty() ? "" : "\n  ") + candidates_[i].driver + ": " + candidates_[i].camera->message();
    }
    message_ = std::move(found);
    return worst;
}

Status FirstLiveCamera::poll(Frame& frame) noexcept {
    const Status status = chosen().poll(frame);
    if (status == Status::kUnavailable || status == Status::kCorrupt) message_ = chosen().message();
    return status;
}

}  // namespace stillmesh
