#include "tests/vm/video_stream.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace vm {
namespace {

constexpr std::uint16_t kProbe = 0x0100, kCommit = 0x0200;
constexpr std::size_t kModeBytes = 48;
constexpr std::uint32_t kStereoExposure_us = 8'500, kColourExposure_us = 15'600;

}  // namespace

Pictures::~Pictures() {
    close();
}

void Pictures::close() {
    if (bytes_ != nullptr) static_cast<void>(::munmap(const_cast<std::uint8_t*>(bytes_), size_));
    bytes_ = nullptr;
}

bool Pictures::open(const std::string& path, std::size_t picture_bytes) {
    close();
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    struct stat about {};
    if (file < 0 || ::fstat(file, &about) != 0 || static_cast<std::size_t>(about.st_size) < picture_bytes) {
        std::perror(path.c_str());
        if (file >= 0) static_cast<void>(::close(file));
        return false;
    }
    size_ = static_cast<std::size_t>(about.st_size);
    picture_bytes_ = picture_bytes;
    void* const bytes = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE | MAP_POPULATE, file, 0);
    static_cast<void>(::close(file));
    if (bytes == MAP_FAILED) return false;
    bytes_ = static_cast<const std::uint8_t*>(bytes);
    return true;
}

const std::uint8_t* Pictures::at(std::int64_t number) const {
    const auto last = static_cast<std::int64_t>(size_ / picture_bytes_) - 1;
    std::int64_t index = last == 0 ? 0 : number % (2 * last);
    if (index > last) index = 2 * last - index;
    return bytes_ + static_cast<std::size_t>(index) * picture_bytes_;
}

std::size_t StreamSource::picture_bytes() const {
    const FrameSize size = stream_.sizes[committed_.size - 1U];
    return std::size_t{size.width} * size.height * stream_.bits_per_pixel / 8;
}

// What a probe or commit control reads as, for a mode.
Bytes StreamSource::mode_data(const Mode& mode) const {
    const FrameSize size = stream_.sizes[mode.size - 1U];
    const std::uint32_t frame_bytes = size.width * size.height * stream_.bits_per_pixel / 8;
    Bytes data = {0, 0, 1, mode.size};
    put32(data, mode.interval);
    data.resize(18);
    put32(data, frame_bytes);
    put32(data, frame_bytes + header_bytes(settings_.header, is_stereo()));  // most bytes of a payload
    put32(data, 1'000'000);                                                  // clock of time stamps, Hz
    data.insert(data.end(), {3, 1, 1, 1});                                   // parity and end of frame are given
    data.resize(kModeBytes);
    return data;
}

StreamSource::Mode StreamSource::nearest(const Bytes& written) {
    Mode mode;
    if (written[3] == 2) mode.size = 2;
    std::uint32_t interval = 0;
    for (std::size_t i = 0; i < 4; ++i) interval |= static_cast<std::uint32_t>(written[4 + i]) << 8U * i;
    if (interval > (kFastest + kSlowest) / 2) mode.interval = kSlowest;
    return mode;
}

bool StreamSource::control(const Setup& setup, const Bytes& written, Bytes& data) {
    if (setup.value != kProbe && setup.value != kCommit) return false;
    switch (setup.request) {
        case kSetCurrent:
            if (written.size() < kModeBytes - 14) return false;  // those of version 1.1 are as short
            if (setup.value == kProbe) {
                probed_ = nearest(written);
                return true;
            }
            committed_ = nearest(written);
            return start();
        case kGetLength: put16(data, kModeBytes); return true;
        case kGetInfo: data = {3}; return true;
        case kGetMinimum:
        case kGetMaximum:
        case kGetDefault:
        case kGetCurrent: data = mode_data(setup.value == kProbe ? probed_ : committed_); return true;
        default: return false;
    }
}

bool StreamSource::start() {
    const FrameSize size = stream_.sizes[committed_.size - 1U];
    const bool is_depth = stream_.format[0] == 'Z';
    if (stream_.bits_per_pixel == 8 && !settings_.is_together) return false;
    const std::string kind = !is_depth ? "colour" : settings_.is_together ? "registered" : "depth";
    const std::string name = kind + '_' + std::to_string(size.width) + 'x' + std::to_string(size.height);
    const std::size_t file_picture = std::size_t{size.width} * size.height * (is_depth ? 2 : 1);
    if (!pictures_.open(folder_ + '/' + name, file_picture)) return false;
    is_streaming_ = true;
    ++counts_.streams;
    payload_.clear();
    sent_bytes_ = 0;
    due_ = 0;
    return true;
}

PictureFacts StreamSource::facts(std::int64_t number, std::int64_t now_ns) const {
    PictureFacts facts;
    facts.is_stereo = is_stereo();
    facts.is_second = is_second_;
    facts.number = static_cast<std::uint32_t>(number);
    facts.middle_us = clock_us(epoch_ns_ + number * kGrid_ns);
    facts.exposure_us = is_stereo() ? kStereoExposure_us : kColourExposure_us;
    facts.now_us = clock_us(now_ns);
    facts.size = stream_.sizes[committed_.size - 1U];
    facts.interval_us = committed_.interval / 10;
    facts.is_emitter_on = settings_.is_emitter_on && (!settings_.has_turns || number % 2 == 0);
    facts.laser_power = settings_.laser_power;
    return facts;
}

void StreamSource::begin_picture(std::int64_t now_ns) {
    const std::int64_t late = ((now_ns - epoch_ns_) / kGrid_ns - due_) / step();
    const std::int64_t number = due_ + late * step();
    counts_.skipped += static_cast<std::uint64_t>(late);
    due_ = number + step();
    is_second_ = !is_second_;
    payload_ = payload_header(settings_.header, facts(number, now_ns));
    const std::size_t header = payload_.size();
    const std::uint8_t* const picture = pictures_.at(number);
    is_short_ = settings_.short_pictures > 0;
    const std::size_t bytes = picture_bytes() / (is_short_ ? 2 : 1);
    if (is_short_) --settings_.short_pictures;
    if (stream_.format[0] == 'Y') {  // no colour
        payload_.resize(header + bytes, 128);
        for (std::size_t i = 0; i < bytes / 2; ++i) payload_[header + 2 * i] = picture[i];
    } else {
        payload_.insert(payload_.end(), picture, picture + bytes);
    }
    sent_bytes_ = 0;
}

// A request that is not filled ends the payload; so does one that is filled by its last byte.
bool StreamSource::take(std::uint32_t most, Bytes& data, std::int64_t now_ns) {
    if (!is_streaming_ || settings_.is_stalled) return false;
    if (!is_sending()) {
        if (due_ == 0) due_ = ((now_ns - epoch_ns_) / kGrid_ns / step() + 1) * step();  // the first
        if (now_ns < due_ns()) return false;
        begin_picture(now_ns);
    }
    const std::size_t bytes = std::min<std::size_t>(most, payload_.size() - sent_bytes_);
    data.assign(payload_.begin() + static_cast<std::ptrdiff_t>(sent_bytes_),
                payload_.begin() + static_cast<std::ptrdiff_t>(sent_bytes_ + bytes));
    sent_bytes_ += bytes;
    if (!is_sending()) {
        ++counts_.sent;
        if (is_short_) ++counts_.short_sent;
    }
    return true;
}

}  // namespace vm
