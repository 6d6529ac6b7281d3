// One video streaming interface of the camera: negotiates a mode (probe and commit, USB Video Class 1.5, 4.3.1.1), then
// hands out a picture per frame interval as one payload of a bulk endpoint, behind its header (payload_header.hpp).
// Pictures come from a file, forwards and backwards again and again, thirty a second by the camera's clock, so that all
// streams show the same moment: the middle of each exposure. While a picture is still being fetched the next ones are
// skipped. Every picture sent and skipped is counted. Memory: one picture, and the file's pages.
#pragma once

#include <cstdint>
#include <string>

#include "tests/vm/payload_header.hpp"

namespace vm {

struct StreamSettings {
    bool is_stalled = false;           // answers no request for pictures any more
    bool is_together = false;          // the stereo module stands where the colour camera does
    std::uint32_t short_pictures = 0;  // so many still end after half their lines
    HeaderKind header = HeaderKind::kBlocks;
    bool is_emitter_on = true;
    bool has_turns = false;  // the emitter is on for every other picture alone
    std::uint32_t laser_power = 0;
};

struct StreamCounts {
    std::uint64_t sent = 0;        // the host has fetched them to the last byte
    std::uint64_t short_sent = 0;  // of them without their second half
    std::uint64_t skipped = 0;     // due while the one before was still being fetched
    std::uint64_t streams = 0;     // how often streaming began
};

// Pictures of a size, in a file that is mapped.
class Pictures {
public:
    Pictures() = default;
    Pictures(const Pictures&) = delete;
    Pictures& operator=(const Pictures&) = delete;
    ~Pictures();
    [[nodiscard]] bool open(const std::string& path, std::size_t picture_bytes);
    // 0, 1, ... n - 1, n - 2, ... 1, 0, 1, ...: whatever moves moves steadily.
    [[nodiscard]] const std::uint8_t* at(std::int64_t number) const;
    void close();

private:
    const std::uint8_t* bytes_ = nullptr;
    std::size_t size_ = 0, picture_bytes_ = 0;
};

class StreamSource {
public:
    // `folder` holds a file per kind and size (d435_pictures). Infrared has the colour camera's pictures: it streams
    // only while both stand in one place.
    StreamSource(const VideoStream& stream, std::string folder) : stream_(stream), folder_(std::move(folder)) {}

    // A class request to this interface; false: stalled.
    bool control(const Setup& setup, const Bytes& written, Bytes& data);
    bool take(std::uint32_t most, Bytes& data, std::int64_t now_ns);
    void stop() { is_streaming_ = false; }
    void restart(std::int64_t now_ns) {  // plugged in: the clock begins
        stop();
        epoch_ns_ = now_ns;
    }

    [[nodiscard]] bool is_streaming() const { return is_streaming_ && !settings_.is_stalled; }
    [[nodiscard]] std::int64_t epoch_ns() const { return epoch_ns_; }                  // when picture 0 was due
    [[nodiscard]] std::int64_t due_ns() const { return epoch_ns_ + due_ * kGrid_ns; }  // when the next picture begins
    [[nodiscard]] const VideoStream& stream() const { return stream_; }
    [[nodiscard]] const StreamCounts& counts() const { return counts_; }
    [[nodiscard]] StreamSettings& settings() { return settings_; }

private:
    static constexpr std::int64_t kGrid_ns = std::int64_t{kFastest} * 100;

    struct Mode {
        std::uint8_t size = 1;
        std::uint32_t interval = kFastest;
    };

    [[nodiscard]] bool is_sending() const { return sent_bytes_ < payload_.size(); }
    // The camera's clock, us: it wraps 20 s after the camera is plugged in.
    [[nodiscard]] std::uint32_t clock_us(std::int64_t host_ns) const {
        return static_cast<std::uint32_t>((host_ns - epoch_ns_) / 1000 - 20'000'000);
    }
    [[nodiscard]] bool is_stereo() const { return stream_.interface < kColourControl; }
    [[nodiscard]] PictureFacts facts(std::int64_t number, std::int64_t now_ns) const;
    [[nodiscard]] std::size_t picture_bytes() const;
    [[nodiscard]] Bytes mode_data(const Mode& mode) const;
    static Mode nearest(const Bytes& written);
    [[nodiscard]] std::int64_t step() const { return committed_.interval == kFastest ? 1 : 2; }
    bool start();
    void begin_picture(std::int64_t now_ns);

    const VideoStream& stream_;
    std::string folder_;
    Pictures pictures_;
    Mode probed_, committed_;
    StreamSettings settings_;
    StreamCounts counts_;
    bool is_streaming_ = false;
    bool is_short_ = false;
    bool is_second_ = false;
    std::int64_t epoch_ns_ = 0;
    std::int64_t due_ = 0;  // number of the next picture by the clock
    Bytes payload_;
    std::size_t sent_bytes_ = 0;
};

}  // namespace vm
