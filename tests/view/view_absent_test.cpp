#include <gtest/gtest.h>

#include <string>

#include "platform/view/view_server.hpp"

namespace stillmesh {
namespace {

// Promise: a build without the server says so, and what to install.
TEST(ViewAbsent, SaysWhatToInstall) {
    ViewFeed feed;
    std::string message;
    EXPECT_EQ(open_view_server({"8080", {}}, feed, message), nullptr);
    for (const char* word :
         {"--view 8080", "not in this build", "libcpp-httplib-dev", "libjs-three", "STILLMESH_WITH_VIEW"}) {
        EXPECT_NE(message.find(word), std::string::npos) << message;
    }
}

}  // namespace
}  // namespace stillmesh
