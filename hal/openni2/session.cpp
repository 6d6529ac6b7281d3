#include "hal/openni2/session.hpp"

#include <algorithm>
#include <mutex>
#include <optional>
#include <utility>

#include "hal/openni2/device_choice.hpp"
#include "hal/openni2/file_care.hpp"

namespace stillmesh::openni2 {
namespace {

using live::monotonic_ns;

// A file that gives nothing for so long has ended, whatever it promised.
constexpr int kFileSilence_ms = 3000;
constexpr int kLiveSilence_ms = 20;  // how long closing waits for the reader
constexpr int kPairWait_ms = 1000;
constexpr std::int64_t kBeforeNext_ns = 1'000'000;  // a recording begins so long before the next image at least
constexpr int kBeginningsMax = 5;
constexpr std::uint32_t kFileImagesMax = 1000;  // without a pair: the two streams do not belong together

// Devices are opened and closed one after the other: OpenNI2 shares a device that is opened twice, but two that open it
// at once each make the driver open it, and one of the two is never closed. A driver that hangs holds the next up.
[[nodiscard]] std::mutex& device_mutex() {
    static std::mutex& mutex = *new std::mutex;
    return mutex;
}

}  // namespace

openni::VideoStream* Session::wait_for_image(int timeout_ms) {
    openni::VideoStream* both[2] = {&streams.depth, &streams.colour};
    int ready = -1;
    const bool is_there = openni::OpenNI::waitForAnyStream(both, 2, &ready, timeout_ms) == openni::STATUS_OK;
    return is_there ? both[ready] : nullptr;
}

Status Session::record(const std::string& file) {
    record_file = file;
    if (const std::string why = why_not_writable(file); !why.empty()) {
        message = file + ": " + why;
        return Status::kInvalid;
    }
    // The recorder gives the first image of each stream the time 0. Begun between colour and depth of one instant, it
    // would shift them against each other by an image: it begins behind a pair, and anew if that took until the next.
    for (int beginnings = 1;; ++beginnings) {
        if (recorder.create(file.c_str()) != openni::STATUS_OK || recorder.attach(streams.depth) != openni::STATUS_OK ||
            recorder.attach(streams.colour) != openni::STATUS_OK) {
            break;
        }
        const std::int64_t end_ns = monotonic_ns() + std::int64_t{kPairWait_ms} * 1'000'000;
        bool is_pair = false;
        while (!is_pair && monotonic_ns() < end_ns) {
            openni::VideoStream* const ready = wait_for_image(kLiveSilence_ms);
            is_pair = ready != nullptr && take_in(*ready, monotonic_ns());
        }
        if (recorder.start() != openni::STATUS_OK) break;
        const std::int64_t next_ns = (is_pair ? slot->taken_ns : 0) + streams.period_us * 1000 - kBeforeNext_ns;
        if (!is_pair || monotonic_ns() < next_ns || beginnings == kBeginningsMax) return Status::kOk;
        streams.colour.stop();
        streams.depth.stop();
        end_recording(recorder, file);
        {
            const std::lock_guard lock(mutex);
            release_images();
            colour_index = depth_index = -1;
        }
        if (streams.depth.start() != openni::STATUS_OK || streams.colour.start() != openni::STATUS_OK) break;
    }
    message = file + ": cannot be recorded: " + extended_error() + ".";
    return Status::kInvalid;
}

void Session::open(const OpenNi2Options& options) {
    runtime = Runtime::get(message);
    if (runtime == nullptr) {
        status = Status::kInvalid;  // waiting for a camera would not help
        return;
    }
    DeviceChoice choice =
        is_file ? open_recording(options.device, device) : open_camera(*runtime, options.device, identity, device);
    if (choice.status == Status::kOk) {
        description = std::move(choice.description);
        identity = std::move(choice.identity);
        watch->uri = identity.uri;
        watch->changed = [this] {
            const std::lock_guard lock(mutex);
            gone_why = watch->is_gone ? "unplugged" : "its driver reports an error";
            changed.notify_all();
        };
        if (!is_file) runtime->watch(watch);
        choice.status = streams.start(device, is_file, description, options, choice.message);
    }
    message = std::move(choice.message);
    if (choice.status == Status::kOk) begin(streams.period_us, monotonic_ns());
    if (choice.status == Status::kOk && !options.record.empty()) choice.status = record(options.record);
    status = choice.status;
}

void Session::close() {
    {
        const std::lock_guard lock(mutex);
        is_closing = true;
        changed.notify_all();
    }
    openni::VideoStream& colour = streams.colour;
    openni::VideoStream& depth = streams.depth;
    if (is_file && device.isValid()) rest_player(colour, depth, counts.images_colour + counts.images_depth > 0);
    if (colour.isValid()) colour.stop();
    if (depth.isValid()) depth.stop();
    if (recorder.isValid()) end_recording(recorder, record_file);
    {
        // Before the streams they came from are gone.
        const std::lock_guard lock(mutex);
        release_images();
    }
    colour.destroy();
    depth.destroy();
    if (device.isValid()) device.close();
    if (runtime != nullptr) runtime->forget(watch);
}

bool Session::take_in(openni::VideoStream& stream, std::int64_t arrival_ns) {
    openni::VideoFrameRef image;
    if (stream.readFrame(&image) != openni::STATUS_OK || !image.isValid()) return false;
    const bool is_colour = image.getSensorType() == openni::SENSOR_COLOR;
    const auto time_us = static_cast<std::int64_t>(std::min<std::uint64_t>(image.getTimestamp(), 1ULL << 52U));
    std::optional<Pair> overtaken;  // released without the lock
    const std::lock_guard lock(mutex);
    if (is_closing) return false;
    int& index = is_colour ? colour_index : depth_index;
    std::int64_t& last_us = is_colour ? last_colour_us : last_depth_us;
    if (is_file && image.getFrameIndex() <= index && time_us <= last_us) {  // it begins again
        has_ended = true;
        changed.notify_all();
        return true;
    }
    last_us = time_us;
    const int missing = image.getFrameIndex() - index - 1;
    if (index >= 0 && missing > 0 && missing < 1000) counts.images_missing += static_cast<std::uint64_t>(missing);
    index = image.getFrameIndex();
    bool is_pair = false;
    overtaken = add(is_colour, image, time_us, arrival_ns, is_pair);
    return is_pair;
}

void Session::read_live() {
    std::int64_t cpu_ns = 0;
    {
        const live::CpuMeter meter(cpu_ns);
        openni::VideoStream* const ready = wait_for_image(kLiveSilence_ms);
        if (ready != nullptr) static_cast<void>(take_in(*ready, monotonic_ns()));
    }
    const std::lock_guard lock(mutex);
    counts.reader_cpu_ns += cpu_ns;
}

void Session::read_file() {
    {
        std::unique_lock lock(mutex);
        changed.wait(lock, [this] { return is_closing || (!slot && !has_ended); });
        if (is_closing) return;
    }
    for (std::uint32_t i = 0;; ++i) {
        const bool has_all = counts.images_colour >= static_cast<std::uint64_t>(streams.colour_images) &&
                             counts.images_depth >= static_cast<std::uint64_t>(streams.depth_images);
        if (has_all || i > kFileImagesMax) break;
        openni::VideoStream* const ready = wait_for_image(kFileSilence_ms);
        if (ready == nullptr) break;
        if (take_in(*ready, monotonic_ns())) return;
    }
    const std::lock_guard lock(mutex);
    has_ended = true;
    changed.notify_all();
}

void Session::serve(const OpenNi2Options& options) {
    if (options.thread_begins) options.thread_begins();
    const auto is_left = [this] {
        const std::lock_guard lock(mutex);
        return is_closing;
    };
    {
        const std::lock_guard one_at_a_time(device_mutex());
        status = Status::kUnavailable;
        if (!is_left()) open(options);
        if (is_left()) close();  // before the next may share it
    }
    {
        const std::lock_guard lock(mutex);
        is_opened = status == Status::kOk;
        changed.notify_all();
    }
    while (is_opened && !is_left()) {
        if (is_file) {
            read_file();
        } else {
            read_live();
        }
    }
    {
        const std::lock_guard one_at_a_time(device_mutex());
        close();
    }
    if (is_opened) runtime.reset();  // else the camera takes it
    const std::lock_guard lock(mutex);
    is_closed = true;
    changed.notify_all();
}

}  // namespace stillmesh::openni2
