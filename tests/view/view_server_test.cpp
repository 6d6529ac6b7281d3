#include "platform/view/view_server.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <string>

#include "platform/linux/process.hpp"
#include "tests/support/program.hpp"

namespace stillmesh::view_server_test {
namespace {

[[nodiscard]] int port_of(const ViewServer& server) {
    const std::string sentence = server.sentence();
    return std::stoi(sentence.substr(sentence.find("127.0.0.1:") + 10));
}

// A client that has asked for the stream.
class Client {
public:
    explicit Client(int port) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(static_cast<std::uint16_t>(port));
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        const std::string request = "GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n";
        is_connected_ = ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
                        ::send(socket_, request.data(), request.size(), MSG_NOSIGNAL) > 0;
    }
    ~Client() { ::close(socket_); }
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;
    [[nodiscard]] bool is_connected() const { return is_connected_; }
    // All that came so far.
    [[nodiscard]] const std::string& text() {
        std::array<char, 8192> buffer{};
        for (;;) {
            const ssize_t count = ::recv(socket_, buffer.data(), buffer.size(), MSG_DONTWAIT);
            if (count <= 0) return text_;
            text_.append(buffer.data(), static_cast<std::size_t>(count));
        }
    }

private:
    int socket_;
    bool is_connected_ = false;
    std::string text_;
};

// Promise: a camera that gives no pictures does not silence the stream: it says for how long there were none.
TEST(ViewServer, TellsHowLongTheCameraIsSilent) {
    ViewFeed feed;
    std::string message;
    const auto server = open_view_server({"0", {}}, feed, message);
    ASSERT_NE(server, nullptr) << message;
    static_cast<void>(feed.is_due(monotonic_ns() - 60'000'000'000));  // a frame, a minute ago
    Client client(port_of(*server));
    ASSERT_TRUE(client.is_connected());
    ASSERT_TRUE(test::within(20'000, [&] { return client.text().find("\"silent_s\":") != std::string::npos; }));
    const std::string& text = client.text();
    EXPECT_GE(std::stod(text.substr(text.find("\"silent_s\":") + 11)), 60.0);
    feed.event("the camera is gone");
    EXPECT_TRUE(test::within(20'000, [&] { return client.text().find("the camera is gone") != std::string::npos; }));
}

// Promise: somebody looks from when his stream begins until he has left, and then nobody does.
TEST(ViewServer, KnowsWhoLooks) {
    ViewFeed feed;
    std::string message;
    const auto server = open_view_server({"127.0.0.1:0", {}}, feed, message);
    ASSERT_NE(server, nullptr) << message;
    EXPECT_EQ(feed.watchers(), 0);
    {
        const Client one(port_of(*server)), two(port_of(*server));
        ASSERT_TRUE(one.is_connected() && two.is_connected());
        EXPECT_TRUE(test::within(20'000, [&] { return feed.watchers() == 2; }));
    }
    EXPECT_TRUE(test::within(20'000, [&] { return feed.watchers() == 0; }));
}

// Promise: a server ends while clients hang on it that take nothing, and again at once when nobody came.
TEST(ViewServer, EndsWithWhoeverHangsOnIt) {
    for (const int clients : {0, 1, kViewStreamsMax}) {
        ViewFeed feed;
        std::string message;
        auto server = open_view_server({"0", {}}, feed, message);
        ASSERT_NE(server, nullptr) << message;
        std::vector<std::unique_ptr<Client>> hanging;
        for (int i = 0; i < clients; ++i) hanging.push_back(std::make_unique<Client>(port_of(*server)));
        EXPECT_TRUE(test::within(20'000, [&] { return feed.watchers() == clients; }));
        server.reset();  // a hang is ended by the test's time limit
        EXPECT_EQ(feed.watchers(), 0);
    }
}

}  // namespace
}  // namespace stillmesh::view_server_test
