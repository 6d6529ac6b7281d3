#include "platform/view/view_place.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <string>

namespace stillmesh::view_place_test {
namespace {

// Promise: a port alone is this machine's; an address may stand before it; anything else is refused with a sentence.
TEST(ViewPlace, IsAnAddressAndAPort) {
    ViewAddress address;
    std::string message;
    ASSERT_TRUE(parse_view_address("8080", address, message));
    EXPECT_EQ(address.host, "127.0.0.1");
    EXPECT_EQ(address.port, 8080);
    ASSERT_TRUE(parse_view_address("0.0.0.0:0", address, message));
    EXPECT_EQ(address.host, "0.0.0.0");
    EXPECT_EQ(address.port, 0);
    ASSERT_TRUE(parse_view_address("[::1]:65535", address, message));
    EXPECT_EQ(address.host, "::1");
    EXPECT_EQ(address.port, 65535);
    for (const char* wrong : {"", "x", "80x", "-1", "65536", "host:", ":8080", "1 ", "999999999999999999999"}) {
        message.clear();
        EXPECT_FALSE(parse_view_address(wrong, address, message)) << wrong;
        EXPECT_NE(message.find("[ADDRESS:]PORT"), std::string::npos) << message;
    }
}

// Promise: a request may call us by numbers, localhost and our own name, and by no other; our name only where the
// network may ask.
TEST(ViewPlace, ARequestNamesThisMachine) {
    char name[256] = {};
    ASSERT_EQ(::gethostname(name, sizeof name - 1), 0);
    const std::string own = name;
    for (const char* bound : {"127.0.0.1", "0.0.0.0", "192.168.1.7"}) {
        for (const char* mine :
             {"127.0.0.1", "127.0.0.1:8080", "localhost", "LOCALHOST:1", "[::1]:8080", "192.168.1.7:8080"}) {
            EXPECT_TRUE(is_own_host(mine, bound)) << mine << " at " << bound;
        }
        for (const char* other : {"", ":8080", "evil.example", "evil.example:8080", "127.0.0.1.evil.example",
                                  "localhost.evil.example", "[::1", "1.2.3", "127.0.0.1@evil.example"}) {
            EXPECT_FALSE(is_own_host(other, bound)) << other << " at " << bound;
        }
    }
    EXPECT_TRUE(is_own_host(own + ":8080", "0.0.0.0"));
    EXPECT_TRUE(is_own_host(own + ".local", "0.0.0.0"));
    EXPECT_FALSE(is_own_host(own + ".local", "127.0.0.1")) << own;
    EXPECT_TRUE(is_own_host("robot.example:80", "robot.example"));
}

}  // namespace
}  // namespace stillmesh::view_place_test
