#include "platform/view/view_feed.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace stillmesh {

ViewFeed::ViewFeed() {
    draft_.reserve();
    between_.reserve();
    places_.reserve(kViewPlacesMax);
    stamps_.reserve(kViewPlacesMax);
    clouds_.resize(kViewCloudsMax);
}

bool ViewFeed::is_due(std::int64_t now_ns) noexcept {
    last_frame_ns_.store(now_ns, std::memory_order_relaxed);
    if (watchers_.load(std::memory_order_relaxed) <= 0) return false;
    if (last_snapshot_ns_ != 0 && now_ns - last_snapshot_ns_ < kViewPeriod_ns) return false;
    last_snapshot_ns_ = now_ns;
    return true;
}

void ViewFeed::hand_over() noexcept {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock()) return;
    put_what_waits();
    std::swap(draft_, between_);
    is_fresh_ = true;
}

void ViewFeed::place(std::int64_t time_ns, const ViewPlace& place, const std::array<float, 4>& q) noexcept {
    const bool is_behind_gap = place.state >= kViewPlaceGap;
    is_gap_waiting_ = is_gap_waiting_ || is_behind_gap;  // where this place is not kept, the next that is
    if (last_place_ns_ >= 0 && time_ns - last_place_ns_ < kViewPeriod_ns) return;  // before any lock
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock()) return;
    put_what_waits();
    if (last_place_ns_ >= 0 && time_ns - last_place_ns_ < place_period_ns_) return;
    last_place_ns_ = time_ns;
    if (places_.size() == kViewPlacesMax) {
        for (std::size_t i = 0; i < kViewPlacesMax / 2; ++i) {
            const bool goes_behind_gap = i > 0 && places_[2 * i - 1].state >= kViewPlaceGap;  // the one that goes
            places_[i] = places_[2 * i];
            stamps_[i] = stamps_[2 * i];
            if (goes_behind_gap && places_[i].state < kViewPlaceGap) places_[i].state += kViewPlaceGap;
        }
        places_.resize(kViewPlacesMax / 2);
        stamps_.resize(kViewPlacesMax / 2);
        place_period_ns_ *= 2;
        ++life_;
    }
    places_.push_back(place);
    stamps_.push_back({time_ns, q});
    if (is_gap_waiting_ && !is_behind_gap) places_.back().state += kViewPlaceGap;
    is_gap_waiting_ = false;
}

void ViewFeed::cloud(const ViewCloud& cloud) noexcept {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock()) return;
    put_what_waits();
    clouds_[clouds_made_++ % kViewCloudsMax] = cloud;
}

void ViewFeed::event(std::string_view sentence) noexcept {
    Event event;
    event.size = std::min(sentence.size(), kViewEventBytesMax);
    std::memcpy(event.text.data(), sentence.data(), event.size);
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock()) {
        if (waiting_count_ < waiting_.size()) waiting_[waiting_count_++] = event;
        return;
    }
    put_what_waits();
    put_event(event);
}

void ViewFeed::begin_map() noexcept {
    is_new_map_waiting_ = true;
    last_place_ns_ = -1;
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (lock.owns_lock()) put_what_waits();
}

void ViewFeed::put_event(const Event& event) noexcept {
    events_[events_made_++ % kViewEventsMax] = event;
}

// Under the lock: first what could not be said before.
void ViewFeed::put_what_waits() noexcept {
    for (std::size_t i = 0; i < waiting_count_; ++i) put_event(waiting_[i]);
    waiting_count_ = 0;
    if (!is_new_map_waiting_) return;
    is_new_map_waiting_ = false;
    places_.clear();
    stamps_.clear();
    place_period_ns_ = kViewPeriod_ns;
    clouds_begin_ = clouds_made_;
    map_life_ = ++life_;
}

bool ViewFeed::take(ViewSnapshot& snapshot) {
    const std::lock_guard lock(mutex_);
    if (!is_fresh_) return false;
    is_fresh_ = false;
    std::swap(snapshot, between_);
    between_.reserve();  // one that came in without memory has it from here on
    return true;
}

void ViewFeed::poses(std::vector<ViewPose>& poses) {
    poses.clear();
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < places_.size(); ++i) poses.push_back({stamps_[i].time_ns, places_[i], stamps_[i].q});
}

void ViewFeed::look(ViewCursor& cursor, ViewNews& news) {
    news.places.clear();
    news.clouds.clear();
    news.events.clear();
    const std::lock_guard lock(mutex_);
    news.is_new_map = cursor.life < map_life_;
    if (cursor.life != life_) cursor.places = 0;
    cursor.life = news.life = life_;
    news.places_begin = cursor.places;
    news.places.assign(places_.begin() + static_cast<std::ptrdiff_t>(cursor.places), places_.end());
    cursor.places = places_.size();
    const std::uint64_t oldest = clouds_made_ > kViewCloudsMax ? clouds_made_ - kViewCloudsMax : 0;
    cursor.clouds = std::max({cursor.clouds, oldest, clouds_begin_});
    while (cursor.clouds < clouds_made_ && news.clouds.size() < kViewCloudsAtOnce) {
        news.clouds.push_back(clouds_[cursor.clouds++ % kViewCloudsMax]);
    }
    cursor.events = std::max(cursor.events, events_made_ > kViewEventsMax ? events_made_ - kViewEventsMax : 0);
    for (; cursor.events < events_made_; ++cursor.events) {
        const Event& event = events_[cursor.events % kViewEventsMax];
        news.events.emplace_back(event.text.data(), event.size);
    }
}

}  // namespace stillmesh
