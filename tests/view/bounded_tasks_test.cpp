#include "platform/view/bounded_tasks.hpp"

#include <gtest/gtest.h>

#include <atomic>

#include "tests/support/program.hpp"

namespace stillmesh::bounded_tasks_test {
namespace {

// Promise: at most so many tasks run at a time, all of them run, and none is lost at the end.
TEST(BoundedTasks, RunsAllAndFewAtATime) {
    constexpr int kTasks = 200;
    constexpr int kThreads = 4;
    std::atomic<int> running{0}, most{0}, done{0};
    {
        BoundedTasks tasks(kThreads);
        for (int i = 0; i < kTasks; ++i) {
            tasks.add([&] {
                const int now = running.fetch_add(1) + 1;
                for (int before = most.load(); before < now && !most.compare_exchange_weak(before, now);) {
                }
                std::this_thread::yield();
                running.fetch_sub(1);
                done.fetch_add(1);
            });
        }
    }
    EXPECT_EQ(done.load(), kTasks);
    EXPECT_LE(most.load(), kThreads);
}

// Promise: who adds to a full queue waits until there is room, and no longer.
TEST(BoundedTasks, AddingWaitsForRoom) {
    BoundedTasks tasks(2);
    std::atomic<bool> may_end{false};
    std::atomic<int> added{0};
    const auto task = [&] {
        while (!may_end.load()) std::this_thread::yield();
    };
    std::thread adder([&] {
        for (int i = 0; i < 6; ++i) {
            tasks.add(task);
            added.fetch_add(1);
        }
    });
    EXPECT_TRUE(test::within(10'000, [&] { return added.load() == 4; }));  // two run, two wait
    EXPECT_FALSE(test::within(50, [&] { return added.load() > 4; }));
    may_end.store(true);
    EXPECT_TRUE(test::within(10'000, [&] { return added.load() == 6; }));
    adder.join();
}

}  // namespace
}  // namespace stillmesh::bounded_tasks_test
