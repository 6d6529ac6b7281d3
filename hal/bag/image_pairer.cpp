#include "hal/bag/image_pairer.hpp"

#include <algorithm>
#include <utility>

namespace stillmesh {
namespace {

[[nodiscard]] std::vector<ListedImage> times_of(const std::vector<WaitingImage>& images) {
    std::vector<ListedImage> out;
    out.reserve(images.size());
    for (const WaitingImage& image : images) out.push_back({image.time_ns, 0, 0});
    return out;
}

}  // namespace

bool ImagePairer::add(Stream stream, std::int64_t time_ns, std::span<const std::uint8_t> bytes) {
    Queue& queue = waiting_[stream];
    const auto at = std::lower_bound(queue.begin(), queue.end(), time_ns,
                                     [](const WaitingImage& w, std::int64_t time) { return w.time_ns < time; });
    if (time_ns <= decided_ns_[stream] || (at != queue.end() && at->time_ns == time_ns)) {
        ++counts_.times_back;
        return false;
    }
    WaitingImage image;
    image.time_ns = time_ns;
    if (!spare_.empty()) {
        image.bytes = std::move(spare_.back());
        spare_.pop_back();
    }
    image.bytes.assign(bytes.begin(), bytes.end());
    bytes_ += bytes.size();
    queue.insert(at, std::move(image));
    return true;
}

void ImagePairer::drop(Stream stream) {
    Queue& queue = waiting_[stream];
    decided_ns_[stream] = queue.front().time_ns;
    bytes_ -= queue.front().bytes.size();
    // A spare each for the images in step; what a burst needed is given back.
    if (spare_.size() < 4) spare_.push_back(std::move(queue.front().bytes));
    queue.erase(queue.begin());
    if (stream == kColour) ++counts_.lonely_colour;
}

// Whether nothing that comes can change what the first colour image gets.
bool ImagePairer::is_decided() const {
    const Queue& colour = waiting_[kColour];
    const Queue& depth = waiting_[kDepth];
    if (is_over_ || colour.size() == kWaitingMax || depth.size() == kWaitingMax || bytes_ > bytes_max_) return true;
    if (depth.empty()) return false;
    const std::int64_t time_ns = colour.front().time_ns;
    if (std::min(colour.back().time_ns, depth.back().time_ns) - time_ns >= 2 * gap_max_ns_) return true;
    return std::any_of(depth.begin(), depth.end(), [&](const WaitingImage& w) { return w.time_ns == time_ns; });
}

bool ImagePairer::next(const WaitingImage*& colour, const WaitingImage*& depth) {
    for (;;) {
        Queue& colours = waiting_[kColour];
        Queue& depths = waiting_[kDepth];
        if (colours.empty()) {
            // Depth alone: none that is older than a gap can have a partner any more, but colour may lag behind.
            while (!depths.empty() && (is_over_ || depths.size() == kWaitingMax || bytes_ > bytes_max_)) drop(kDepth);
            return false;
        }
        if (!is_decided()) return false;
        const std::vector<ImagePair> pairs = associate(times_of(colours), times_of(depths), gap_max_ns_);
        if (pairs.empty() || pairs.front().colour.time_ns != colours.front().time_ns) {
            // Depth before all colour goes first: where a stream is full, colour may still get its own.
            const bool is_depth_behind =
                !depths.empty() && depths.front().time_ns < colours.front().time_ns - gap_max_ns_;
            drop(is_depth_behind ? kDepth : kColour);
            continue;
        }
        while (depths.front().time_ns != pairs.front().depth.time_ns) drop(kDepth);
        for (const Stream stream : {kColour, kDepth}) {
            std::swap(given_[stream], waiting_[stream].front());
            bytes_ -= given_[stream].bytes.size();
            decided_ns_[stream] = given_[stream].time_ns;
            if (spare_.size() < 4) spare_.push_back(std::move(waiting_[stream].front().bytes));
            waiting_[stream].erase(waiting_[stream].begin());
        }
        colour = &given_[kColour];
        depth = &given_[kDepth];
        return true;
    }
}

}  // namespace stillmesh
