#include "platform/report/run_film.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "platform/report/picture_writer.hpp"

namespace stillmesh {
namespace {

// Every second one goes, those at even places stay: what is kept are the multiples of twice the stride.
template <typename T>
void drop_every_second(std::vector<T>& values) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < values.size(); i += 2, ++kept) {
        if (kept != i) values[kept] = std::move(values[i]);
    }
    values.resize(kept);
}

[[nodiscard]] std::uint32_t key_of(std::int16_t x, std::int16_t y) {
    return static_cast<std::uint32_t>(static_cast<std::uint16_t>(x)) << 16U | static_cast<std::uint16_t>(y);
}

// Edges end at features: two numbers instead of four coordinates. One that ends elsewhere is left out.
class FeatureNumbers {
public:
    explicit FeatureNumbers(std::span<const ShownFeature> features) {
        places_.reserve(features.size());
        for (std::size_t i = 0; i < features.size(); ++i) {
            places_.emplace_back(key_of(features[i].x, features[i].y), static_cast<std::uint16_t>(i));
        }
        std::sort(places_.begin(), places_.end());
    }
    void add(std::span<const ShownEdge> edges, std::vector<FilmPicture::Edge>& to) const {
        to.reserve(edges.size());
        for (const ShownEdge& edge : edges) {
            const auto from = find(key_of(edge.x0, edge.y0)), until = find(key_of(edge.x1, edge.y1));
            if (from != places_.end() && until != places_.end()) to.push_back({from->second, until->second});
        }
    }

private:
    using Places = std::vector<std::pair<std::uint32_t, std::uint16_t>>;
    [[nodiscard]] Places::const_iterator find(std::uint32_t key) const {
        const auto at = std::lower_bound(places_.begin(), places_.end(), std::pair(key, std::uint16_t{0}));
        return at != places_.end() && at->first == key ? at : places_.end();
    }
    Places places_;
};

[[nodiscard]] FilmPicture picture_of(const ViewSnapshot& snapshot, std::uint64_t frame) {
    FilmPicture picture;
    picture.frame = static_cast<std::uint32_t>(frame);
    picture.image_width = snapshot.image_width;
    picture.image_height = snapshot.image_height;
    picture.picture =
        encode_small_picture(snapshot.grey, snapshot.picture_width, snapshot.picture_height, picture.is_jpeg);
    picture.features.reserve(snapshot.features.size());
    picture.kinds.reserve(snapshot.features.size());
    for (const ShownFeature& feature : snapshot.features) {
        picture.features.push_back({feature.x, feature.y});
        // Groups are numbered by their size: what is beyond 254 is a few features each.
        const int group = feature.group < 0 || feature.group > 254 ? 255 : feature.group;
        picture.kinds.push_back({static_cast<std::uint8_t>(group), static_cast<std::uint8_t>(feature.kind)});
    }
    const FeatureNumbers numbers(snapshot.features);
    numbers.add(snapshot.kept, picture.kept);
    numbers.add(snapshot.cut, picture.cut);
    return picture;
}

}  // namespace

const char* film_reason_name(std::uint8_t reason) noexcept {
    if (reason == kFilmCameraFault) return "camera fault";
    if (reason == kFilmOldPictures) return "old pictures";
    return unsure_reason_name(static_cast<UnsureReason>(reason < kUnsureReasons ? reason : 0));
}

std::size_t FilmPicture::size_bytes() const {
    return picture.size() + features.size() * sizeof(Feature) + kinds.size() * sizeof(Kind) +
           (kept.size() + cut.size()) * sizeof(Edge);
}

RunFilm::RunFilm(std::uint32_t pictures_max) : pictures_max_(std::min(pictures_max, kFilmPicturesMax)) {
    frames_.reserve(kFilmFramesMax);
    pictures_.reserve(pictures_max_);
}

void RunFilm::add(const FilmFrame& frame) {
    was_rival_ = frame.state == PoseState::kUnsure && frame.reason == static_cast<std::uint8_t>(UnsureReason::kRival);
    const std::uint64_t index = frames_total_++;
    if (index % frame_stride_ != 0) return;
    if (frames_.size() == kFilmFramesMax) {
        drop_every_second(frames_);
        frame_stride_ *= 2;
        if (index % frame_stride_ != 0) return;
    }
    frames_.push_back(frame);
}

void RunFilm::take(const ViewSnapshot& snapshot, bool is_rival) {
    if (!wants_picture(is_rival)) return;
    if (is_rival && is_rival_due()) rivals_.push_back(picture_of(snapshot, frames_total_));
    if (!is_due()) return;
    if (pictures_.size() == pictures_max_) {
        drop_every_second(pictures_);
        picture_stride_ *= 2;
        if (!is_due() || pictures_.size() == pictures_max_) return;
    }
    pictures_.push_back(picture_of(snapshot, frames_total_));
}

void RunFilm::event(std::int64_t time_ns, std::string_view sentence) {
    if (events_.size() == kFilmEventsMax) {
        ++events_left_out_;
        return;
    }
    events_.push_back({time_ns, std::string(sentence)});
}

void RunFilm::finish(std::vector<KeyframePose> keyframes, std::vector<KeyframeLink> links,
                     std::vector<ViewCloud> clouds) {
    keyframes_ = std::move(keyframes);
    links_ = std::move(links);
    clouds_ = std::move(clouds);
    const auto is_before = [](const FilmPicture& a, const FilmPicture& b) { return a.frame < b.frame; };
    for (FilmPicture& rival : rivals_) {
        const auto at = std::lower_bound(pictures_.begin(), pictures_.end(), rival, is_before);
        if (at == pictures_.end() || at->frame != rival.frame) pictures_.insert(at, std::move(rival));
    }
    rivals_.clear();
}

}  // namespace stillmesh
