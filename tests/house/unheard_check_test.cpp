// A program that did not define stillmesh_check_failed.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <csignal>

#include "engine/base/check.hpp"

namespace stillmesh::unheard_check_test {
namespace {

// Promise: nobody has to listen: the program links without the function, and a failed check traps.
TEST(UnheardCheckDeathTest, Traps) {
    const auto is_trap = [](int status) {
        return WIFSIGNALED(status) && (WTERMSIG(status) == SIGILL || WTERMSIG(status) == SIGTRAP);
    };
    EXPECT_EXIT(STILLMESH_CHECK(1 + 1 == 3), is_trap, "");
}

}  // namespace
}  // namespace stillmesh::unheard_check_test
