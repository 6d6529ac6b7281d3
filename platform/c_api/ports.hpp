// C functions behind the engine's ports. Each struct of the C header that crosses without a copy is laid out as the
// engine's own.
#pragma once

#include <cstddef>
#include <cstdint>

#include "engine/features/features.hpp"
#include "engine/paging/map_store.hpp"
#include "platform/c_api/stillmesh.h"

namespace stillmesh::c_api {

static_assert(sizeof(sm_keypoint) == sizeof(Keypoint) && offsetof(sm_keypoint, score) == offsetof(Keypoint, score) &&
              offsetof(sm_keypoint, level) == offsetof(Keypoint, level));
static_assert(sizeof(sm_descriptor) == sizeof(Descriptor));
static_assert(sizeof(sm_word_weight) == sizeof(WordWeight) &&
              offsetof(sm_word_weight, word) == offsetof(WordWeight, word));

[[nodiscard]] inline Status status_of(sm_status status) noexcept {
    return status >= SM_OK && status <= SM_END ? static_cast<Status>(status) : Status::kInvalid;
}

class Extractor final : public FeatureExtractor {
public:
    sm_extractor functions{};

    [[nodiscard]] Status extract(const GreyView& image, FeatureSet& features) noexcept override {
        const sm_grey grey{image.data, image.stride, image.width, image.height};
        sm_feature_room room{reinterpret_cast<sm_keypoint*>(features.keypoints.begin()),
                             reinterpret_cast<sm_descriptor*>(features.descriptors.begin()),
                             static_cast<std::uint32_t>(features.keypoints.capacity()), 0};
        features.clear();
        const Status status = status_of(functions.extract(functions.user, &grey, &room));
        if (status != Status::kOk) return status;
        if (room.count > features.keypoints.capacity()) return Status::kInvalid;
        features.keypoints.set_size(room.count);
        features.descriptors.set_size(room.count);
        return Status::kOk;
    }
};

class Store final : public MapStore {
public:
    sm_store functions{};

    [[nodiscard]] StoreContent content() const noexcept override {
        sm_store_content content{};
        functions.content(functions.user, &content);
        return {content.regions, content.ids_end, content.time_ns};
    }
    [[nodiscard]] Status keep(const LeavingRegion& region) noexcept override {
        sm_region out{};
        out.id = region.id;
        out.time_ns = region.time_ns;
        for (int i = 0; i < 3; ++i) {
            out.position_m[i] = region.position_m[i];
            out.axis[i] = region.axis[i];
        }
        out.alike_score = region.alike_score;
        out.words = reinterpret_cast<const sm_word_weight*>(region.words.data());
        out.words_count = static_cast<std::uint32_t>(region.words.size());
        out.body = region.body.data();
        out.body_bytes = region.body.size();
        return status_of(functions.keep(functions.user, &out));
    }
    [[nodiscard]] Status ask(const StoreQuestion& question) noexcept override {
        sm_question out{};
        out.number = question.number;
        out.older_than = question.older_than;
        out.words = reinterpret_cast<const sm_word_weight*>(question.words.data());
        out.words_count = static_cast<std::uint32_t>(question.words.size());
        out.without = question.without.data();
        out.without_count = static_cast<std::uint32_t>(question.without.size());
        out.score_min = question.score_min;
        return status_of(functions.ask(functions.user, &out));
    }
    [[nodiscard]] Status poll(StoreAnswer& answer, std::span<std::byte> body) noexcept override {
        sm_answer in{};
        const Status status = status_of(functions.poll(functions.user, &in, body.data(), body.size()));
        answer = {in.question, in.id, in.score, in.body_bytes};
        if (answer.size_bytes > body.size()) answer.size_bytes = 0;
        return status;
    }
    void note_use(std::uint64_t id) noexcept override { functions.note_use(functions.user, id); }
};

}  // namespace stillmesh::c_api
