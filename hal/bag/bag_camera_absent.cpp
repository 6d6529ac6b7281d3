#include "hal/bag/bag_camera.hpp"

namespace stillmesh {

struct BagCamera::Inside {
    BagOptions options;
    CameraInfo info;
    BagCounts counts;
    std::string message, source;
};

BagCamera::BagCamera(BagOptions options) : inside_(std::make_unique<Inside>()) {
    inside_->options = std::move(options);
}
BagCamera::~BagCamera() = default;
Status BagCamera::open() noexcept {
    inside_->message = inside_->options.path +
                       ": is a bag, and this build reads none; build with -DSTILLMESH_WITH_BAGS=ON (Debian: "
                       "libsqlite3-dev, libzstd-dev, liblz4-dev, libbz2-dev).";
    return Status::kUnavailable;
}
const CameraInfo& BagCamera::info() const noexcept {
    return inside_->info;
}
Status BagCamera::poll(Frame&) noexcept {
    return Status::kUnavailable;
}
Status BagCamera::wait(std::uint32_t) noexcept {
    return Status::kUnavailable;
}
void BagCamera::close() noexcept {}
const std::string& BagCamera::message() const noexcept {
    return inside_->message;
}
const BagCounts& BagCamera::counts() const noexcept {
    return inside_->counts;
}
const std::string& BagCamera::calibration_source() const noexcept {
    return inside_->source;
}
std::vector<std::string> BagCamera::notes() const {
    return {};
}
std::vector<std::string> BagCamera::closing_notes() const {
    return {};
}

}  // namespace stillmesh
