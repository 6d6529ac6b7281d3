#include "platform/store/store_service.hpp"

#include <gtest/gtest.h>

#include "engine/base/crc.hpp"
#include "tests/store/store_rig.hpp"

namespace stillmesh::store_service_test {
namespace {

// What an engine would do with a store: keeps and asks, the same in every run. What it was answered.
struct Told {
    std::vector<std::uint64_t> answers;
    std::vector<StoreEvents> events;
};

Told run(StoreService& service, std::span<const StoreEvents> events) {
    Told told;
    Random random(5);
    std::vector<std::byte> body(4096);
    std::uint64_t number = 0;
    bool is_waiting = false;
    for (std::size_t frame = 0; frame < 300; ++frame) {
        told.events.push_back(service.begin_frame(events.empty() ? StoreEvents{} : events[frame]));
        for (int i = 0; i < 3; ++i) {
            const test::MadeRegion region = test::made_region(1 + frame * 3 + static_cast<std::uint64_t>(i), frame + 1);
            told.answers.push_back(service.keep(region.given()) == Status::kOk ? 1 : 0);
        }
        StoreAnswer answer;
        if (is_waiting) {
            const Status status = service.poll(answer, body);
            if (status != Status::kTimedOut) {
                is_waiting = false;
                told.answers.push_back(
                    status == Status::kOk ? answer.id + crc32(std::span(body).first(answer.size_bytes)) : 7);
            }
        }
        if (!is_waiting) {
            const std::vector<WordWeight> words = test::made_words(10, 200, random);
            StoreQuestion question;
            question.number = ++number;
            question.words = words;
            is_waiting = service.ask(question) == Status::kOk;
        }
    }
    return told;
}

// Promise: what a thread did at its own pace, a repetition does again from the events alone: the same answers, at the
// same frames.
TEST(StoreService, EventsRepeatWhatAThreadDid) {
    for (int round = 0; round < 3; ++round) {
        const test::TemporaryFolder folder;
        RegionStoreOptions options = test::options_in(folder.path() + "/store");
        std::string message;
        Told live;
        std::uint64_t sequence = 0;
        {
            StoreService service;
            ASSERT_TRUE(service.open(options, StoreService::Mode::kThread, 4096, message)) << message;
            sequence = service.sequence();
            live = run(service, {});
            EXPECT_EQ(service.close(), "");
        }
        options.is_scratch = true;
        options.sequence_max = sequence;
        StoreService again;
        ASSERT_TRUE(again.open(options, StoreService::Mode::kRepeated, 4096, message)) << message;
        const Told repeated = run(again, live.events);
        EXPECT_EQ(repeated.events, live.events);
        EXPECT_EQ(repeated.answers, live.answers);
    }
}

// Promise: between frames everything is answered at the next one, and two runs over equal stores are equal.
TEST(StoreService, AtOnceIsAlwaysTheSame) {
    std::vector<std::uint64_t> wanted;
    for (int round = 0; round < 2; ++round) {
        const test::TemporaryFolder folder;
        std::string message;
        StoreService service;
        ASSERT_TRUE(
            service.open(test::options_in(folder.path() + "/store"), StoreService::Mode::kAtOnce, 4096, message));
        const Told told = run(service, {});
        if (wanted.empty()) wanted = told.answers;
        EXPECT_EQ(told.answers, wanted);
        EXPECT_EQ(service.close(), "");
        EXPECT_EQ(service.counts().regions, 900U);
    }
}

}  // namespace
}  // namespace stillmesh::store_service_test
