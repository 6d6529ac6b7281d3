#include "hal/v4l2/session.hpp"

#include <algorithm>
#include <cerrno>
#include <exception>
#include <utility>

namespace stillmesh::v4l2 {
namespace {

constexpr std::uint32_t kWait_ms = 20;  // how long closing waits for the reader
constexpr std::uint32_t kRoundsMax = 4 * ImageStream::kBuffers;

}  // namespace

void Session::open() {
    status = Status::kUnavailable;
    try {
        status = opening.open(wishes, opened, message);
    } catch (const std::exception&) {
        message = "no memory is left for the camera.";
    }
    if (status != Status::kOk) {
        opening.close();
        return;
    }
    const auto period_us = [](const ImageStream& stream) {
        return static_cast<std::int64_t>(1e6 / stream.mode().frames_per_s());
    };
    image_clock_ = ImageClock(period_us(opening.depth), period_us(opening.colour));
    begin(opened.period_us, link->now_ns(), opened.apart_us);
}

void Session::account(const ImageFacts& facts) noexcept {
    if (!opening.depth_metadata.is_on()) return;
    without_ = facts.device_us ? 0 : without_ + 1;
    is_without_ = is_without_ || without_ >= kWithoutMax;
    if (!facts.exposure_us) return;
    counts.exposure_sum_us += *facts.exposure_us;
    ++counts.images_exposed;
}

// Pictures without the dots, depth with them; the depth of just before, so that no picture waits for it. An image of
// which nothing is known is not used.
bool Session::is_its_turn(bool is_colour, const ImageFacts& facts) noexcept {
    if (!facts.is_laser_on) return false;
    const bool is_on = *facts.is_laser_on;
    if (!is_colour) {
        has_depth_ = has_depth_ || is_on;
        return is_on;
    }
    alike_ = is_on == was_laser_on_ ? alike_ + 1 : 0;
    was_laser_on_ = is_on;
    is_alike_ = is_alike_ || alike_ >= kAlikeMax;
    return !is_on && std::exchange(has_depth_, false);
}

std::string Session::take_remark() {
    if (is_alike_ && !std::exchange(is_alike_told_, true)) {
        return "the projector does not take turns with the images, as it was told: take --camera v4l2:ir, or v4l2.";
    }
    if (!is_without_ || std::exchange(is_without_told_, true)) return {};
    return "what the camera says about its images does not come, or damaged: they have the times at which the driver "
           "got them.";
}

bool Session::take_in(bool is_colour, int error, Image image, std::int64_t arrival_ns) {
    counts.images_missing = opening.colour.missing() + opening.depth.missing();
    counts.images_unusable = opening.colour.broken() + opening.depth.broken();
    switch (error) {
        case 0: break;
        case EAGAIN: return false;
        case EBADMSG: unusable_ns = arrival_ns; return true;
        case ENODEV: gone_why = "unplugged"; return false;
        default: gone_why = "its driver reports an error"; return false;
    }
    const V4l2Buffer& buffer = image.buffer();
    // A driver that stamps with a clock nobody knows says less than the moment it came.
    const std::int64_t driver_us =
        buffer.is_monotonic ? std::clamp<std::int64_t>(buffer.stamp_us, 0, std::int64_t{1} << 52U) : arrival_ns / 1000;
    account(image.facts);
    const std::int64_t time_us = image_clock_.stamp_us(is_colour, driver_us, image.facts.device_us);
    if (image_clock_.is_device_clock()) clock.keep_apart();
    if (opened.is_alternating && !is_its_turn(is_colour, image.facts)) return true;
    bool is_pair = false;
    static_cast<void>(add(is_colour, std::move(image), time_us, arrival_ns, is_pair));
    return true;
}

void Session::read(std::uint32_t timeout_ms) {
    const std::int64_t begin_cpu_ns = live::clock_ns(CLOCK_THREAD_CPUTIME_ID);
    const int handles[] = {opening.depth.handle(), opening.colour.handle()};
    V4l2Ready ready[2];
    const int error = link->wait(handles, timeout_ms, ready);
    const std::int64_t arrival_ns = link->now_ns();
    // By turns, so that images of one instant find each other where several wait.
    bool has_more[2] = {error == 0, error == 0};
    for (std::uint32_t round = 0; round < kRoundsMax && (has_more[0] || has_more[1]); ++round) {
        for (const bool is_colour : {false, true}) {
            if (!has_more[is_colour]) continue;
            Image image;
            const int taken = (is_colour ? opening.colour : opening.depth).take(image);
            MetadataStream& metadata = is_colour ? opening.colour_metadata : opening.depth_metadata;
            if (taken == 0) image.facts = metadata.find(image.buffer().sequence);
            const std::lock_guard lock(mutex);
            has_more[is_colour] = !is_closing && take_in(is_colour, taken, std::move(image), arrival_ns);
        }
    }
    const bool is_broken = (ready[0].is_broken && !ready[0].has_image) || (ready[1].is_broken && !ready[1].has_image);
    const std::lock_guard lock(mutex);
    if (error == ENODEV) gone_why = "unplugged";
    if (is_broken && gone_why == nullptr) gone_why = "its driver reports an error";
    counts.reader_cpu_ns += live::clock_ns(CLOCK_THREAD_CPUTIME_ID) - begin_cpu_ns;
    if (gone_why != nullptr) changed.notify_all();
}

void Session::close() noexcept {
    {
        // Images go back before their streams stop.
        const std::lock_guard lock(mutex);
        is_closing = true;
        release_images();
    }
    opening.close();
}

void Session::serve(const std::function<void()>& thread_begins) noexcept {
    if (thread_begins) thread_begins();
    open();
    {
        const std::lock_guard lock(mutex);
        is_opened = status == Status::kOk;
        changed.notify_all();
    }
    while (is_opened) {
        {
            std::unique_lock lock(mutex);
            // What is gone is left as it is until it is closed: the last pair may be in use.
            if (gone_why != nullptr) changed.wait(lock, [this] { return is_closing; });
            if (is_closing) break;
        }
        read(kWait_ms);
    }
    close();
    const std::lock_guard lock(mutex);
    is_closed = true;
    changed.notify_all();
}

}  // namespace stillmesh::v4l2
