#include "tests/v4l2/emulated_device.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <thread>

#include "hal/v4l2/realsense_metadata.hpp"

namespace stillmesh::test {
namespace {

using namespace v4l2;

[[nodiscard]] std::int64_t host_ns() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
}

}  // namespace

std::uint16_t depth_pixel(std::uint32_t number, std::uint32_t x, std::uint32_t y) {
    if (x == 0 && y == 0) return static_cast<std::uint16_t>(number);
    return static_cast<std::uint16_t>(1000 + (number * 7 + x + 3 * y) % 500);
}

std::uint8_t colour_byte(std::uint32_t number, std::uint32_t x, std::uint32_t y) {
    return static_cast<std::uint8_t>(number * 11 + x * 3 + y * 5);
}

EmulatedDevice::EmulatedDevice() {
    const auto add = [this](std::uint8_t interface, bool is_capture, std::vector<EmulatedMode> modes) {
        Node node;
        node.node.usb_port = "2-1";
        node.node.serial = "012345";
        node.node.product = "Intel(R) RealSense(TM) Depth Camera 435";
        node.node.vendor_id = 0x8086;
        node.node.product_id = 0x0b07;
        node.node.interface = interface;
        node.node.speed_mbit_per_s = 5000;
        node.capabilities = is_capture ? kV4l2Capture | kV4l2Streaming : 0x00800000 | kV4l2Streaming;
        node.modes = std::move(modes);
        devices.push_back(std::move(node));
    };
    add(0, true,
        {{kZ16, 1280, 720, {30, 15, 6}},
         {kZ16, 848, 480, {90, 60, 30, 15, 6}},
         {kZ16, 640, 480, {90, 60, 30, 15, 6}},
         {kZ16, 424, 240, {30}}});
    add(0, false, {{kD4xxMetadata, 0, 0, {}}});
    add(1, true,
        {{kGrey, 640, 480, {90, 60, 30, 15}},
         {kY8i, 640, 480, {30}},
         {kUyvy, 640, 480, {30}},
         {kY16, 1280, 800, {25}}});
    add(1, false, {{kD4xxMetadata, 0, 0, {}}});
    add(3, true,
        {{kYuyv, 1280, 720, {30, 15}},
         {kYuyv, 640, 480, {60, 30, 15}},
         {kYuyv, 424, 240, {60, 30}},
         {fourcc("????"), 640, 480, {30}}});
    add(3, false, {{kUvcMetadata, 0, 0, {}}, {kD4xxMetadata, 0, 0, {}}});
    plug();
    answers[0x10] = answer(0x10, details());
    answers[25 * 256 + 0x15] = answer(0x15, depth_table());
    answers[32 * 256 + 0x15] = answer(0x15, colour_table());
    answers[0x77] = answer(0x77, {});
    answers[256 + 0x77] = answer(0x77, {});
    answers[9 * 256 + 0x2c] = answer(0x2c, depth_unit(1000));
}

EmulatedDevice::~EmulatedDevice() = default;

void EmulatedDevice::unplug() {
    const std::lock_guard lock(mutex_);
    is_plugged_ = false;
    ++life_;
}

void EmulatedDevice::plug(int first_number) {
    const std::lock_guard lock(mutex_);
    is_plugged_ = true;
    for (std::size_t i = 0; i < devices.size(); ++i) {
        devices[i].node.path = "/dev/video" + std::to_string(first_number + static_cast<int>(i));
    }
}

int EmulatedDevice::enter(int handle, const char* call) {
    const auto found = handles_.find(handle);
    if (found == handles_.end()) {
        complain("a call of a node that is not open");
        return EBADF;
    }
    if (fault) {
        if (const int error = fault(call); error != 0) return error;
    }
    return !is_plugged_ || found->second.life != life_ ? ENODEV : 0;
}

std::vector<V4l2Node> EmulatedDevice::nodes() {
    const std::lock_guard lock(mutex_);
    std::vector<V4l2Node> found;
    if (!is_plugged_) return found;
    for (const Node& node : devices) found.push_back(node.node);
    return found;
}

int EmulatedDevice::open(const std::string& path, int& handle) {
    const std::lock_guard lock(mutex_);
    if (fault) {
        if (const int error = fault("open"); error != 0) return error;
    }
    for (std::size_t i = 0; i < devices.size() && is_plugged_; ++i) {
        if (devices[i].node.path != path) continue;
        if (devices[i].open_error != 0) return devices[i].open_error;
        handle = next_handle_++;
        Open& open = handles_[handle];
        open.node = i;
        open.life = life_;
        return 0;
    }
    return ENOENT;
}

void EmulatedDevice::close(int handle) {
    const std::lock_guard lock(mutex_);
    const auto found = handles_.find(handle);
    if (found == handles_.end()) return complain("closed twice");
    for (Bytes& buffer : found->second.buffers) left_.push_back(std::move(buffer));
    handles_.erase(found);
}

int EmulatedDevice::query_capability(int handle, std::uint32_t& capabilities) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "query_capability"); error != 0) return error;
    capabilities = node_of(handle).capabilities;
    return 0;
}

int EmulatedDevice::format_at(int handle, std::uint32_t index, std::uint32_t& fourcc) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "format_at"); error != 0) return error;
    std::vector<std::uint32_t> formats;
    for (const EmulatedMode& mode : node_of(handle).modes) {
        if (std::find(formats.begin(), formats.end(), mode.fourcc) == formats.end()) formats.push_back(mode.fourcc);
    }
    if (index >= formats.size()) return EINVAL;
    fourcc = formats[index];
    return 0;
}

int EmulatedDevice::size_at(int handle, std::uint32_t fourcc, std::uint32_t index, V4l2Size& size) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "size_at"); error != 0) return error;
    for (const EmulatedMode& mode : node_of(handle).modes) {
        if (mode.fourcc != fourcc || index-- != 0) continue;
        size = {mode.width, mode.height};
        return 0;
    }
    return EINVAL;
}

const EmulatedMode* EmulatedDevice::mode_of(const Node& node, const V4l2Format& format) const {
    for (const EmulatedMode& mode : node.modes) {
        if (mode.fourcc == format.fourcc && mode.width == format.width && mode.height == format.height) return &mode;
    }
    return nullptr;
}

int EmulatedDevice::interval_at(int handle, const V4l2Format& format, std::uint32_t index, V4l2Interval& interval) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "interval_at"); error != 0) return error;
    const EmulatedMode* const mode = mode_of(node_of(handle), format);
    if (mode == nullptr || index >= mode->rates.size()) return EINVAL;
    interval = {1, mode->rates[index]};
    return 0;
}

int EmulatedDevice::set_format(int handle, V4l2Format& format) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "set_format"); error != 0) return error;
    Open& open = of(handle);
    const Node& node = node_of(handle);
    if (node.is_held || !open.buffers.empty()) return EBUSY;
    // Of metadata, as Linux 6.1 has it: only as long as the images beside it have no buffers
    // (uvc_meta_v4l2_set_format).
    const bool is_metadata = (node.capabilities & kV4l2Metadata) != 0;
    const bool has_images = is_metadata && std::any_of(handles_.begin(), handles_.end(), [&open](const auto& other) {
                                return other.second.node + 1 == open.node && !other.second.buffers.empty();
                            });
    if (has_images) return EBUSY;
    if (node.ignores_mode || mode_of(node, format) == nullptr) {
        // As drivers do: the nearest they have.
        format.width = node.modes.front().width;
        format.height = node.modes.front().height - (node.ignores_mode ? 8 : 0);
    }
    const std::uint32_t pixel = bytes_per_pixel(format.fourcc);
    format.bytes_per_line = pixel * format.width;
    format.bytes = format.width == 0 ? 1024 : (pixel == 0 ? 2 : pixel) * format.width * format.height;
    open.format = format;
    return 0;
}

int EmulatedDevice::set_interval(int handle, V4l2Interval& interval) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "set_interval"); error != 0) return error;
    of(handle).interval = interval;
    return 0;
}

int EmulatedDevice::set_control(int handle, std::uint32_t control, std::int32_t value) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "set_control"); error != 0) return error;
    controls[control] = value;
    return 0;
}

int EmulatedDevice::request_buffers(int handle, std::uint32_t& count) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "request_buffers"); error != 0) return error;
    Open& open = of(handle);
    Node& node = node_of(handle);
    if (node.is_held || open.is_on) return EBUSY;
    count = std::min(count, node.buffers_max);
    for (Bytes& buffer : open.buffers) left_.push_back(std::move(buffer));
    open.buffers.assign(count, Bytes(open.format.bytes));
    open.is_queued.assign(count, false);
    open.queued.clear();
    open.done.clear();
    return 0;
}

int EmulatedDevice::map(int handle, std::uint32_t index, std::span<const std::uint8_t>& bytes) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "map"); error != 0) return error;
    Open& open = of(handle);
    if (index >= open.buffers.size()) return EINVAL;
    bytes = open.buffers[index];
    mappings_.push_back(bytes.data());
    ++mapped_;
    return 0;
}

void EmulatedDevice::unmap(std::span<const std::uint8_t> bytes) {
    const std::lock_guard lock(mutex_);
    const auto found = std::find(mappings_.begin(), mappings_.end(), bytes.data());
    if (found == mappings_.end()) return complain("unmapped what was not mapped");
    mappings_.erase(found);
    --mapped_;
    std::erase_if(left_, [&](const Bytes& buffer) { return buffer.data() == bytes.data(); });
}

int EmulatedDevice::queue(int handle, std::uint32_t index) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "queue"); error != 0) return error;
    Open& open = of(handle);
    if (index >= open.buffers.size() || open.is_queued[index]) {
        complain("queued a buffer that is queued, or is none");
        return EINVAL;
    }
    if (open.is_on) produce(open);  // what was due before finds no buffer
    open.is_queued[index] = true;
    open.queued.push_back(index);
    return 0;
}

std::int64_t EmulatedDevice::period_ns(const Open& open) const {
    const std::uint32_t period_ms = devices[open.node].period_ms;
    if (period_ms != 0) return std::int64_t{period_ms} * 1'000'000;
    return std::int64_t{1'000'000'000} * open.interval.numerator / std::max(open.interval.denominator, 1U);
}

std::int64_t EmulatedDevice::time_of(const Open& open, std::int64_t number) const {
    const Node& node = devices[open.node];
    return number * period_ns(open) + (std::int64_t{node.delay_us} + std::int64_t{node.way_us} * (number % 3)) * 1000;
}

void EmulatedDevice::give(Open& open, std::int64_t number, std::int64_t time_ns) {
    Node& node = devices[open.node];
    const std::uint32_t sequence = open.sequence++;
    if (open.queued.empty()) return;  // lost
    const std::uint32_t index = open.queued.front();
    open.queued.pop_front();
    open.is_queued[index] = false;
    Bytes& bytes = open.buffers[index];
    const auto shown = static_cast<std::uint32_t>(number);
    const std::uint32_t pixel = bytes_per_pixel(open.format.fourcc);
    const bool is_dotted = open.node == 2 && is_lit(number);
    const bool is_unlit = is_alternating && !is_lit(number);
    if (paint) paint(open.node, shown, is_lit(number), bytes);
    for (std::uint32_t y = 0; y < open.format.height && pixel != 0 && !paint; ++y) {
        std::uint8_t* const row = bytes.data() + std::size_t{y} * open.format.bytes_per_line;
        for (std::uint32_t x = 0; x < open.format.width * pixel; ++x) {
            std::uint16_t depth = depth_pixel(shown, x / 2, y);
            if (is_unlit && x + y > 1) depth = static_cast<std::uint16_t>(depth + kUnlit);
            row[x] = open.format.fourcc == kZ16 ? static_cast<std::uint8_t>(depth >> (8 * (x % 2)))
                                                : colour_byte(shown, x, y);
            if (is_dotted) row[x] = static_cast<std::uint8_t>(255 - row[x]);
        }
    }
    V4l2Buffer buffer;
    buffer.index = index;
    buffer.bytes_used = open.format.bytes;
    buffer.sequence = sequence;
    buffer.stamp_us = time_ns / 1000;
    buffer.is_monotonic = node.is_stamped;
    const auto strikes = [](std::uint32_t& left) { return left > 0 && left-- > 0; };
    if (strikes(node.broken)) buffer.is_broken = true;
    if (strikes(node.cut_off)) buffer.bytes_used -= 1;
    if (strikes(node.overlong)) buffer.bytes_used += 1000;
    if (strikes(node.misnumbered)) buffer.index = 77;
    open.done.push_back(buffer);
    describe(open.node, number, buffer);
}

// As uvcvideo: into a buffer of the node behind, with the image's number.
void EmulatedDevice::describe(std::size_t node, std::int64_t number, const V4l2Buffer& image) {
    Node& said = devices[node + 1];
    for (auto& [handle, open] : handles_) {
        if (open.node != node + 1 || !open.is_on || said.is_silent || open.queued.empty()) continue;
        V4l2Buffer buffer = image;
        buffer.index = open.queued.front();
        open.queued.pop_front();
        open.is_queued[buffer.index] = false;
        const std::int64_t taken_us = image.stamp_us - std::int64_t{devices[node].way_us} * (number % 3);
        MetadataNumbers numbers;
        numbers.time_us =
            clock_us + numbers.optical_us +
            static_cast<std::uint32_t>(std::llround(static_cast<double>(taken_us) * (1 + 1e-6 * clock_ppm)));
        numbers.is_laser_on = is_lit(number);
        Bytes bytes = metadata(numbers);
        if (open.format.fourcc == kUvcMetadata) bytes.resize(22);
        if (said.spoiled > 0) {
            --said.spoiled;
            for (std::uint32_t i = 0; i < 3; ++i) {
                spoils_ = spoils_ * 1'664'525U + 1'013'904'223U;
                bytes[10 + (spoils_ >> 8U) % (bytes.size() - 10)] ^= static_cast<std::uint8_t>(1U << (spoils_ >> 29U));
            }
            if (spoils_ % 4 == 0) bytes.resize(spoils_ / 4 % bytes.size());
        }
        if (said.cut_off > 0) {
            --said.cut_off;
            bytes.pop_back();
        }
        std::copy(bytes.begin(), bytes.end(), open.buffers[buffer.index].begin());
        buffer.bytes_used = static_cast<std::uint32_t>(bytes.size());
        buffer.is_broken = false;
        open.done.push_back(buffer);
    }
}

void EmulatedDevice::produce(Open& open) {
    const Node& node = devices[open.node];
    if (!open.is_on || open.format.width == 0) return;
    for (; time_of(open, open.next_number) <= now_ns(); ++open.next_number) {
        if (!is_plugged_ || node.is_silent) continue;
        give(open, open.next_number, time_of(open, open.next_number));
    }
}

int EmulatedDevice::dequeue(int handle, V4l2Buffer& buffer) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "dequeue"); error != 0) return error;
    Open& open = of(handle);
    if (!open.is_on) return EINVAL;
    produce(open);
    if (open.done.empty()) return EAGAIN;
    buffer = open.done.front();
    open.done.pop_front();
    return 0;
}

int EmulatedDevice::set_streaming(int handle, bool is_on) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, "set_streaming"); error != 0) return error;
    Open& open = of(handle);
    if (is_on && open.format.width != 0) {
        double sum = 0;
        for (const auto& [other, it] : handles_) {
            if (it.is_on || other == handle) sum += 1e9 * it.format.bytes / static_cast<double>(period_ns(it));
        }
        if (sum > bytes_per_s_max) return ENOSPC;
        open.next_number = (now_ns() - std::int64_t{devices[open.node].delay_us} * 1000) / period_ns(open) + 1;
    } else if (!is_on) {
        open.queued.clear();
        open.done.clear();
        open.is_queued.assign(open.buffers.size(), false);
    }
    open.is_on = is_on;
    return 0;
}

std::int64_t EmulatedDevice::next_image_ns(std::span<const int> handles) {
    std::int64_t next_ns = INT64_MAX;
    for (const int handle : handles) {
        const auto found = handles_.find(handle);
        if (found == handles_.end() || !found->second.is_on) continue;
        const Open& open = found->second;
        if (!devices[open.node].is_silent && !open.queued.empty()) {
            next_ns = std::min(next_ns, time_of(open, open.next_number));
        }
    }
    return next_ns;
}

int EmulatedDevice::wait(std::span<const int> handles, std::uint32_t timeout_ms, std::span<V4l2Ready> ready) {
    std::unique_lock lock(mutex_);
    if (fault) {
        if (const int error = fault("wait"); error != 0) return error;
    }
    const auto look = [&] {
        bool has_any = false;
        for (std::size_t i = 0; i < handles.size(); ++i) {
            const auto found = handles_.find(handles[i]);
            ready[i] = {};
            if (found == handles_.end()) {
                complain("waited for a node that is not open");
                continue;
            }
            produce(found->second);
            ready[i].has_image = !found->second.done.empty();
            ready[i].is_broken = !is_plugged_ || found->second.life != life_ || devices[found->second.node].has_failed;
            has_any = has_any || ready[i].has_image || ready[i].is_broken;
        }
        return has_any;
    };
    if (look() || timeout_ms == 0) return 0;
    const std::int64_t end_ns = now_ns() + std::int64_t{timeout_ms} * 1'000'000;
    const std::int64_t until_ns = std::min(end_ns, std::max(next_image_ns(handles), now_ns()));
    if (is_real_time) {
        lock.unlock();
        std::this_thread::sleep_for(std::chrono::nanoseconds(until_ns - now_ns()));
        lock.lock();
    } else {
        now_ns_ = until_ns;
    }
    static_cast<void>(look());
    return 0;
}

int EmulatedDevice::extension(int handle, std::uint8_t unit, std::uint8_t control, V4l2Query query,
                              std::span<std::uint8_t> data) {
    const std::lock_guard lock(mutex_);
    if (const int error = enter(handle, query == V4l2Query::kSet ? "extension_set" : "extension_get"); error != 0) {
        return error;
    }
    Open& open = of(handle);
    if (unit != 3 || control < 1 || control > 2 || open.node != 0) return ENOENT;
    if (control == 2 && query == V4l2Query::kSet && data.size() == 1) {
        emitter = data[0];
        return 0;
    }
    if (data.size() != 1024) return ENOBUFS;
    if (query == V4l2Query::kSet) {
        open.asked.assign(data.begin(), data.end());
        const bool is_command = data[0] == 20 && data[1] == 0 && data[2] == 0xab && data[3] == 0xcd;
        if (!is_command) complain("a command that is none");
        if (data[4] == 0x77) {
            for (const auto& [other, it] : handles_) {
                if (it.is_on && it.life == life_) complain("the projector's turns were set while images stream");
            }
            if (answers.contains(data[8] * 256U + 0x77U)) is_alternating = data[8] == 1;
        }
        return 0;
    }
    if (open.asked.empty()) return EIO;
    const std::uint32_t code = open.asked[4], parameter = open.asked[8];
    const auto found = answers.find(code == 0x10 ? code : parameter * 256 + code);
    if (found == answers.end()) return EPIPE;
    std::copy(found->second.begin(), found->second.end(), data.begin());
    return 0;
}

std::int64_t EmulatedDevice::now_ns() {
    return is_real_time ? host_ns() : now_ns_;
}

}  // namespace stillmesh::test
