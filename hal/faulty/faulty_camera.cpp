#include "hal/faulty/faulty_camera.hpp"

#include <algorithm>
#include <utility>

#include "engine/base/check.hpp"

namespace stillmesh {
namespace {

// What a recording misses while nobody has it open: some 0.7 s at most.
constexpr std::uint32_t kFramesMissedMax = 20;

}  // namespace

const char* fault_name(Fault fault) noexcept {
    constexpr const char* kNames[kFaults] = {"absent",        "unplugged",
                                             "timeout",       "duplicate",
                                             "dropped",       "out of order",
                                             "backwards",     "jump",
                                             "wrap",          "frozen",
                                             "black",         "saturated",
                                             "zero depth",    "saturated depth",
                                             "random pixels", "wrong size",
                                             "torn",          "different instants"};
    return kNames[static_cast<std::uint32_t>(fault)];
}

FaultyCamera::FaultyCamera(DepthCamera& source, FaultOptions options)
    : source_(source), options_(std::move(options)), state_(options_.seed * 0x9e3779b97f4a7c15ULL + 1) {
    STILLMESH_CHECK(options_.now_ns && options_.sleep_until_ns);
    frames_left_ = 1 + random_below(static_cast<std::uint32_t>(std::max(2 * options_.good_frames_mean, 2.0)));
    if (options_.is_absent_at_start) {
        absent_opens_ = 1 + random_below(options_.absent_opens_max);
        ++counts_[static_cast<std::uint32_t>(Fault::kAbsent)];
    }
}

std::uint64_t FaultyCamera::random() noexcept {
    // splitmix64
    state_ += 0x9e3779b97f4a7c15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31U);
}

Status FaultyCamera::open() noexcept {
    close();
    if (absent_opens_ > 0) {
        --absent_opens_;
        return Status::kUnavailable;
    }
    if (is_source_open_) {
        Frame missed;
        for (std::uint32_t i = random_below(kFramesMissedMax + 1); i > 0; --i) {
            if (source_.poll(missed) != Status::kOk) break;
        }
    } else {
        STILLMESH_TRY(source_.open());
        is_source_open_ = true;
    }
    is_open_ = true;
    const CameraModel& model = source_.info().model;
    const std::size_t pixels = std::size_t{model.width} * model.height;
    for (Image* const image : {&now_, &before_, &made_}) {
        image->colour.resize(3 * pixels);
        image->depth.resize(pixels);
    }
    has_before_ = false;
    return Status::kOk;
}

void FaultyCamera::close() noexcept {
    if (is_source_open_ && !options_.is_recording) {
        source_.close();
        is_source_open_ = false;
    }
    is_open_ = false;
    if (has_fault_ && (fault_ == Fault::kTimeout || fault_ == Fault::kUnplugged || fault_ == Fault::kFrozen)) {
        has_fault_ = false;
        frames_left_ = 1 + random_below(static_cast<std::uint32_t>(std::max(2 * options_.good_frames_mean, 2.0)));
    }
}

void FaultyCamera::begin_fault() {
    do {
        fault_ = static_cast<Fault>(random_below(kFaults));
    } while ((options_.faults & (1U << static_cast<std::uint32_t>(fault_))) == 0);
    ++counts_[static_cast<std::uint32_t>(fault_)];
    has_fault_ = true;
    frames_left_ = 1 + random_below(random_below(4) == 0 ? 45 : 6);
    switch (fault_) {
        case Fault::kAbsent:
        case Fault::kUnplugged: absent_opens_ = 1 + random_below(options_.absent_opens_max); break;
        case Fault::kTimeout:
            silent_until_ns_ =
                options_.now_ns() +
                static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(options_.timeout_max_ns) + 1);
            break;
        case Fault::kBackwards:
            clock_shift_ns_ -= 1'000'000 * std::int64_t{1 + random_below(2000)};
            frames_left_ = 1;
            break;
        case Fault::kJump:
            clock_shift_ns_ += 1'000'000 * std::int64_t{1 + random_below(1'000'000)};
            frames_left_ = 1;
            break;
        case Fault::kWrap: frames_left_ = 1; break;  // its time is known with the frame
        default: break;
    }
}

void FaultyCamera::copy(const Frame& frame, Image& image) {
    const std::size_t row_bytes = std::size_t{frame.colour.width} * channels_of(frame.format);
    image.colour.resize(row_bytes * frame.colour.height);
    image.depth.resize(std::size_t{frame.depth.width} * frame.depth.height);
    for (std::uint32_t y = 0; y < frame.colour.height; ++y) {
        std::copy_n(frame.colour.row(y), row_bytes, image.colour.data() + y * row_bytes);
    }
    for (std::uint32_t y = 0; y < frame.depth.height; ++y) {
        std::copy_n(frame.depth.row(y), frame.depth.width, image.depth.data() + std::size_t{y} * frame.depth.width);
    }
    image.frame = frame;
    image.frame.mask = {};  // the source's, which goes with its next frame
}

void FaultyCamera::give(Image& image, Frame& frame) {
    const Frame& own = image.frame;
    frame = own;
    frame.colour = {image.colour.data(), own.colour.width, own.colour.height,
                    std::size_t{own.colour.width} * channels_of(own.format)};
    frame.depth = {image.depth.data(), own.depth.width, own.depth.height, own.depth.width};
}

// `now_` is the new frame, `before_` the one before it, if there is one.
Status FaultyCamera::spoil(Frame& frame) {
    made_ = now_;  // sizes stay: no heap is called
    const std::size_t half_rows = now_.frame.depth.height / 2;
    const std::size_t row_bytes = std::size_t{now_.frame.colour.width} * channels_of(now_.frame.format);
    switch (fault_) {
        case Fault::kDropped: return Status::kTimedOut;
        case Fault::kDuplicate:
        case Fault::kOutOfOrder:
            if (has_before_) made_ = before_;
            break;
        case Fault::kFrozen:
            if (has_before_) {
                made_.colour = before_.colour;
                made_.depth = before_.depth;
            }
            break;
        case Fault::kBlack: std::fill(made_.colour.begin(), made_.colour.end(), std::uint8_t{0}); break;
        case Fault::kSaturated: std::fill(made_.colour.begin(), made_.colour.end(), std::uint8_t{255}); break;
        case Fault::kZeroDepth: std::fill(made_.depth.begin(), made_.depth.end(), std::uint16_t{0}); break;
        case Fault::kSaturatedDepth: std::fill(made_.depth.begin(), made_.depth.end(), std::uint16_t{65535}); break;
        case Fault::kRandomPixels:
            for (std::uint8_t& value : made_.colour) value = static_cast<std::uint8_t>(random());
            for (std::uint16_t& value : made_.depth) value = static_cast<std::uint16_t>(random());
            break;
        case Fault::kWrongSize:
            made_.frame.colour.width = made_.frame.depth.width = std::max(now_.frame.depth.width / 2, 1U);
            if (random_below(2) == 0) made_.frame.colour.height = std::max(now_.frame.colour.height / 2, 1U);
            break;
        case Fault::kTorn:
            if (has_before_) {
                const auto colour_from = static_cast<std::ptrdiff_t>(row_bytes * half_rows);
                const auto depth_from = static_cast<std::ptrdiff_t>(std::size_t{now_.frame.depth.width} * half_rows);
                std::copy(before_.colour.begin() + colour_from, before_.colour.end(),
                          made_.colour.begin() + colour_from);
                std::copy(before_.depth.begin() + depth_from, before_.depth.end(), made_.depth.begin() + depth_from);
            }
            break;
        case Fault::kDifferentInstants:
            if (has_before_) made_.depth = before_.depth;
            break;
        default: break;
    }
    give(made_, frame);
    return Status::kOk;
}

Status FaultyCamera::poll(Frame& frame) noexcept {
    if (!is_open_ || (has_fault_ && fault_ == Fault::kUnplugged)) return Status::kUnavailable;
    if (has_fault_ && fault_ == Fault::kTimeout) {
        if (options_.now_ns() < silent_until_ns_) return Status::kTimedOut;
        has_fault_ = false;
        frames_left_ = 1 + random_below(static_cast<std::uint32_t>(std::max(2 * options_.good_frames_mean, 2.0)));
    }
    Frame polled;
    STILLMESH_TRY(source_.poll(polled));
    copy(polled, now_);
    if (frames_left_ == 0) {
        if (has_fault_) {
            has_fault_ = false;
            frames_left_ = 1 + random_below(static_cast<std::uint32_t>(std::max(2 * options_.good_frames_mean, 2.0)));
        } else if (options_.faults != 0) {
            begin_fault();
            if (fault_ == Fault::kWrap) clock_shift_ns_ = -now_.frame.time_ns;
            if (fault_ == Fault::kAbsent || fault_ == Fault::kUnplugged) {
                fault_ = Fault::kUnplugged;  // either way it is gone, and absent for a while
                return Status::kUnavailable;
            }
            if (fault_ == Fault::kTimeout) return Status::kTimedOut;
        }
    }
    if (frames_left_ > 0) --frames_left_;
    now_.frame.time_ns += clock_shift_ns_;
    now_.frame.depth_time_ns += clock_shift_ns_;
    Status status = Status::kOk;
    if (has_fault_) {
        status = spoil(frame);
    } else {
        give(now_, frame);
    }
    // What is frozen or repeated stays as it was when that began.
    const bool does_hold = has_fault_ && has_before_ &&
                           (fault_ == Fault::kFrozen || fault_ == Fault::kDuplicate || fault_ == Fault::kOutOfOrder);
    if (!does_hold) {
        std::swap(before_, now_);  // swapping vectors moves no pixel: the frame given out stays valid
        has_before_ = true;
    }
    return status;
}

Status FaultyCamera::wait(std::uint32_t timeout_ms) noexcept {
    if (!is_open_) return Status::kUnavailable;
    if (has_fault_ && fault_ == Fault::kTimeout) {
        options_.sleep_until_ns(options_.now_ns() + std::min<std::int64_t>(timeout_ms, 10) * 1'000'000);
        return Status::kTimedOut;
    }
    return source_.wait(timeout_ms);
}

std::int64_t FaultyCamera::due_ns() const noexcept {
    return options_.times != nullptr ? options_.times->due_ns() : options_.now_ns();
}

std::int64_t FaultyCamera::next_due_ns() noexcept {
    return options_.times != nullptr ? options_.times->next_due_ns() : options_.now_ns();
}

std::uint64_t FaultyCamera::dropped() noexcept {
    return options_.times != nullptr ? options_.times->dropped() : 0;
}

std::string FaultyCamera::summary() const {
    std::string text;
    for (std::uint32_t i = 0; i < kFaults; ++i) {
        if (counts_[i] == 0) continue;
        text += (text.empty() ? "" : ", ") + std::to_string(counts_[i]) + " " + fault_name(static_cast<Fault>(i));
    }
    return text.empty() ? "none" : text;
}

}  // namespace stillmesh
