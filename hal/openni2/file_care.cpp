#include "hal/openni2/file_care.hpp"

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <thread>

namespace stillmesh::openni2 {
namespace {

// A recording to which nothing is added for so long is written.
constexpr int kSettled_ms = 200;
constexpr int kSettleLook_ms = 20;
constexpr int kSettleMax_ms = 3000;
// The player of files waits with its next image after so long; from being opened on, also on a busy machine.
constexpr int kPlayerRests_ms = 50;
constexpr int kPlayerBegins_ms = 300;

// Returns when nothing has been written into a file for a while.
void settle(const std::string& file) {
    std::uintmax_t size = 0;
    int quiet_ms = 0;
    for (int waited_ms = 0; quiet_ms < kSettled_ms && waited_ms < kSettleMax_ms; waited_ms += kSettleLook_ms) {
        std::this_thread::sleep_for(std::chrono::milliseconds(kSettleLook_ms));
        std::error_code error;
        const std::uintmax_t now = std::filesystem::file_size(file, error);
        quiet_ms = now == size ? quiet_ms + kSettleLook_ms : 0;
        size = now;
    }
}

}  // namespace

bool play_image_by_image(openni::PlaybackControl& playback) {
    return playback.setRepeatEnabled(true) == openni::STATUS_OK && playback.setSpeed(-1.0F) == openni::STATUS_OK;
}

void rest_player(openni::VideoStream& colour, openni::VideoStream& depth, bool has_begun) {
    if (!has_begun && depth.isValid()) static_cast<void>(depth.start());
    if (!has_begun && colour.isValid()) static_cast<void>(colour.start());
    std::this_thread::sleep_for(std::chrono::milliseconds(has_begun ? kPlayerRests_ms : kPlayerBegins_ms));
}

void end_recording(openni::Recorder& recorder, const std::string& file) {
    recorder.stop();
    settle(file);
    recorder.destroy();
}

std::string why_not_writable(const std::string& file) {
    if (std::FILE* const stream = std::fopen(file.c_str(), "wb"); stream != nullptr) {
        static_cast<void>(std::fclose(stream));
        return {};
    }
    return std::string("cannot be written: ") + std::strerror(errno) + ".";
}

}  // namespace stillmesh::openni2
