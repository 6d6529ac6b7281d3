// What a run leaves for a report that plays: numbers of each frame, small pictures with the mesh over them, what
// happened, and at the end the map. Filled by the run loop on the engine's thread, behind the pose.
//
// Memory: fixed however long the run is. Of the frames, when there are kFilmFramesMax, every second one is dropped
// (88 bytes each); of the pictures likewise when there are as many as were asked for (some 25 KB each), beside them the
// first of each stretch that a rival motion made unsure, kFilmRivalsMax at most; of the events the first kFilmEventsMax
// are kept. Cost of a picture: about a millisecond for its JPEG; a run of n frames takes as
// many pictures as asked for, times log2 of what it is too long by.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/outputs.hpp"
#include "platform/view/view_feed.hpp"
#include "platform/view/view_snapshot.hpp"

namespace stillmesh {

inline constexpr std::size_t kFilmFramesMax = 32768;
inline constexpr std::size_t kFilmEventsMax = 256;
inline constexpr std::size_t kFilmRivalsMax = 16;
inline constexpr std::uint32_t kFilmPicturesDefault = 100;
inline constexpr std::uint32_t kFilmPicturesMax = 5000;

// Why a frame is not tracked, beyond what the engine says (UnsureReason).
inline constexpr std::uint8_t kFilmCameraFault = kUnsureReasons;
inline constexpr std::uint8_t kFilmOldPictures = kUnsureReasons + 1;
[[nodiscard]] const char* film_reason_name(std::uint8_t reason) noexcept;
inline constexpr std::uint8_t kFilmReasons = kUnsureReasons + 2;

struct FilmFrame {
    std::int64_t time_ns = 0;
    std::uint32_t number = 0;  // of the run's frames
    float ms = 0;              // frame in to pose out
    std::uint16_t features = 0, static_features = 0, moving_features = 0;
    std::uint16_t map = 1;
    PoseState state = PoseState::kNone;
    std::uint8_t reason = 0;                             // an UnsureReason, or one of those above
    std::uint8_t chosen_percent = 0, rival_percent = 0;  // of the surface in view (FrameStatistics)
    std::array<float, 7> pose{};  // x, y, z (m), quaternion x, y, z, w; valid unless the state is kNone
    std::array<float, kStages> stage_ms{};
};

struct FilmPicture {
    struct Feature {
        std::int16_t x, y;  // 1/8 px of the camera's image
    };
    struct Kind {
        std::uint8_t group;  // 255: in none
        std::uint8_t kind;   // ShownFeature's, with what explains it
    };
    struct Edge {
        std::uint16_t from, to;  // of `features`
    };
    std::uint32_t frame = 0;
    std::uint32_t image_width = 0, image_height = 0;
    bool is_jpeg = false;               // else PNG
    std::vector<std::uint8_t> picture;  // grey
    std::vector<Feature> features;
    std::vector<Kind> kinds;  // of the features
    std::vector<Edge> kept, cut;

    [[nodiscard]] std::size_t size_bytes() const;
};

struct FilmEvent {
    std::int64_t time_ns = 0;
    std::string sentence;
};

class RunFilm {
public:
    // `pictures_max`: 0 for none. Memory for the frames is taken here; the system gives it as it is used.
    explicit RunFilm(std::uint32_t pictures_max);

    // Each frame once, `number` going up by one.
    void add(const FilmFrame& frame);
    // Whether the next frame's picture is wanted; then take() before the frame is added. `is_rival`: a rival motion
    // made that frame unsure.
    [[nodiscard]] bool wants_picture(bool is_rival = false) const noexcept {
        return pictures_max_ > 0 && (is_due() || (is_rival && is_rival_due()));
    }
    void take(const ViewSnapshot& snapshot, bool is_rival = false);
    void event(std::int64_t time_ns, std::string_view sentence);
    // The map as it is at the end; from here on pictures() has those of rivals among the others.
    void finish(std::vector<KeyframePose> keyframes, std::vector<KeyframeLink> links, std::vector<ViewCloud> clouds);

    [[nodiscard]] const std::vector<FilmFrame>& frames() const noexcept { return frames_; }
    [[nodiscard]] const std::vector<FilmPicture>& pictures() const noexcept { return pictures_; }
    [[nodiscard]] const std::vector<FilmEvent>& events() const noexcept { return events_; }
    [[nodiscard]] std::uint64_t events_left_out() const noexcept { return events_left_out_; }
    [[nodiscard]] const std::vector<KeyframePose>& keyframes() const noexcept { return keyframes_; }
    [[nodiscard]] const std::vector<KeyframeLink>& links() const noexcept { return links_; }
    [[nodiscard]] const std::vector<ViewCloud>& clouds() const noexcept { return clouds_; }
    [[nodiscard]] std::uint64_t frame_stride() const noexcept { return frame_stride_; }

private:
    [[nodiscard]] bool is_due() const noexcept { return frames_total_ % picture_stride_ == 0; }
    [[nodiscard]] bool is_rival_due() const noexcept { return !was_rival_ && rivals_.size() < kFilmRivalsMax; }

    std::uint32_t pictures_max_;
    bool was_rival_ = false;  // the frame that was added last
    std::uint64_t frames_total_ = 0;
    std::uint64_t frame_stride_ = 1;
    std::uint64_t picture_stride_ = 1;
    std::uint64_t events_left_out_ = 0;
    std::vector<FilmFrame> frames_;
    std::vector<FilmPicture> pictures_;
    std::vector<FilmPicture> rivals_;
    std::vector<FilmEvent> events_;
    std::vector<KeyframePose> keyframes_;
    std::vector<KeyframeLink> links_;
    std::vector<ViewCloud> clouds_;
};

}  // namespace stillmesh
