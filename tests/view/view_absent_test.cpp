#include <gtest/gtest.h>

#include <string>

#include "platform/view/view_module.hpp"

namespace stillmesh::view_absent_test {
namespace {

// Promise: where the server is not beside the program (as it is not beside this test), that is said, with where it was
// looked for and what to install.
TEST(ViewAbsent, SaysWhatToInstall) {
    ViewFeed feed;
    std::string message;
    EXPECT_EQ(load_view_server({"8080", {}}, feed, message), nullptr);
    for (const char* word : {"--view 8080: not in this build (neither /", "libstillmesh_view.so is there)",
                             "libcpp-httplib-dev", "libjs-three", "STILLMESH_WITH_VIEW"}) {
        EXPECT_NE(message.find(word), std::string::npos) << message;
    }
}

}  // namespace
}  // namespace stillmesh::view_absent_test
