// What loop closing and relocalisation search places with: the keyframe database with the handles of those in it,
// and one searcher (words, query, verifier) that both use, one at a time: a lost camera comes first, and a search
// of loop closing starts over. Limits: those of its rooms.
#pragma once

#include <cstdint>
#include <span>

#include "engine/place/keyframe_database.hpp"
#include "engine/recognition/place_verifier.hpp"

namespace stillmesh {

class PlaceSearch {
public:
    enum class User : std::uint8_t { kNone, kLoopClosing, kRelocalisation };

    static constexpr std::uint32_t kNeighbours = 10;  // whose scores say what alike means

    static constexpr void plan(ArenaPlan& arena, const Limits& limits) noexcept {
        KeyframeDatabase::plan(arena, limits);
        arena.array<Handle<Keyframe>>(limits.keyframes_max);
        FrameWords::plan(arena, limits.features_max);
        PlaceQuery::plan(arena, limits);
        PlaceVerifier::plan(arena, limits);
        arena.array<std::uint8_t>(limits.features_max);
    }
    // `vocabulary` may be empty: then nothing is ever recognised.
    void create(Arena& arena, const Limits& limits, const Parameters& configuration, const CameraModel& camera,
                const Vocabulary& vocabulary) noexcept;
    void reset() noexcept;

    [[nodiscard]] bool is_on() const noexcept { return is_on_; }
    [[nodiscard]] const Vocabulary& vocabulary() const noexcept { return *vocabulary_; }
    [[nodiscard]] KeyframeDatabase& database() noexcept { return database_; }
    [[nodiscard]] FrameWords& words() noexcept { return words_; }
    [[nodiscard]] PlaceQuery& query() noexcept { return query_; }
    [[nodiscard]] PlaceVerifier& verifier() noexcept { return verifier_; }
    [[nodiscard]] std::span<std::uint8_t> eligible() noexcept { return eligible_; }
    [[nodiscard]] std::uint32_t find_units(std::size_t features) const noexcept {
        return FrameWords::find_units(*vocabulary_, features) + static_cast<std::uint32_t>(features) / 4 + 1;
    }

    // Takes the searcher over.
    void take(User user) noexcept;
    [[nodiscard]] bool is_used_by(User user) const noexcept { return user_ == user; }

    // Forgets keyframes that have left the map. To be called before anything is asked of the database.
    void purge(const Map& map) noexcept;
    [[nodiscard]] bool has(Handle<Keyframe> keyframe) const noexcept { return owners_[keyframe.slot()] == keyframe; }
    // With words() as they are, or other ones.
    void add(Handle<Keyframe> keyframe) noexcept { add(keyframe, words_); }
    void add(Handle<Keyframe> keyframe, const FrameWords& words) noexcept;
    // Words and bag of a keyframe, by the features whose points stand still.
    void find_words(const Map& map, Handle<Keyframe> keyframe, const Parameters& configuration,
                    FrameWords& out) noexcept;
    // What "alike" means where a keyframe stands: the least score among the keyframes that share most points with it.
    struct Neighbourhood {
        std::uint32_t neighbours = 0;  // looked at
        std::uint32_t scored = 0;      // of them, in the database
        std::uint32_t score_min = 0;
    };
    [[nodiscard]] Neighbourhood neighbourhood(const Map& map, std::uint32_t slot) const noexcept;

private:
    const Vocabulary* vocabulary_ = nullptr;
    KeyframeDatabase database_;
    std::span<Handle<Keyframe>> owners_;  // by slot: the keyframe that is in the database
    FrameWords words_;
    PlaceQuery query_;
    PlaceVerifier verifier_;
    std::span<std::uint8_t> eligible_;  // by feature of the query
    User user_ = User::kNone;
    bool is_on_ = false;
};

}  // namespace stillmesh
