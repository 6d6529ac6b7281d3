#include "platform/poses/line_outputs.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <fstream>
#include <memory>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.hpp"

namespace stillmesh::line_outputs_test {
namespace {

using test::TemporaryFolder;

[[nodiscard]] int connect_unix(const std::string& path) {
    const int socket = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return socket;
    ::close(socket);
    return -1;
}
// All that is there now, or until the other side ends.
void read_what_is_there(int socket, std::string& text, std::size_t bytes_max = ~std::size_t{0}) {
    std::array<char, 4096> buffer{};
    std::size_t got = 0;
    while (got < bytes_max) {
        const ssize_t count = ::recv(socket, buffer.data(), std::min(buffer.size(), bytes_max - got), MSG_DONTWAIT);
        if (count <= 0) return;
        text.append(buffer.data(), static_cast<std::size_t>(count));
        got += static_cast<std::size_t>(count);
    }
}
[[nodiscard]] std::string numbered_line(std::uint32_t number) {
    return std::to_string(number) + " " + std::string(900 + number % 700, static_cast<char>('a' + number % 26)) + "\n";
}
// Every whole line is one that was written, in order; returns how many.
[[nodiscard]] std::uint32_t expect_lines_in_order(const std::string& text, std::uint32_t begin, std::uint32_t end) {
    std::istringstream stream(text.substr(0, text.rfind('\n') + 1));
    std::uint32_t next = begin, count = 0;
    for (std::string line; std::getline(stream, line); ++count) {
        const auto number = static_cast<std::uint32_t>(std::stoul(line));
        EXPECT_GE(number, next);
        EXPECT_LT(number, end);
        EXPECT_EQ(line + "\n", numbered_line(number));
        next = number + 1;
    }
    return count;
}

// Promise, over 100 seeds of readers that come, read much, little or nothing, and die in the middle of a line: writing
// goes on to the end; each reader has whole lines only, in order; who reads all that comes has lost nothing; and what
// was lost is counted and said once.
TEST(LineOutputs, ReadersOfEveryKind) {
    TemporaryFolder folder;
    const std::string path = folder.path() + "/poses.sock";
    for (unsigned seed = 0; seed < 100; ++seed) {
        std::mt19937 random(seed);
        std::string message;
        auto output = open_line_output("unix:" + path, {}, message);
        ASSERT_NE(output, nullptr) << message;
        struct Reader {
            int socket = -1;
            int kind = 0;  // 0 reads all, 1 a little, 2 nothing
            std::uint32_t begin = 0, end = 0;
            std::string text;
        };
        std::vector<Reader> readers;
        std::size_t sentences = 0;
        constexpr std::uint32_t kLines = 600;
        for (std::uint32_t i = 0; i < kLines; ++i) {
            if (random() % 40 == 0 && readers.size() < kReadersMax) {
                readers.push_back({connect_unix(path), static_cast<int>(random() % 3), i, kLines, {}});
                ASSERT_GE(readers.back().socket, 0);
            }
            sentences += output->write(numbered_line(i)).empty() ? 0U : 1U;
            for (Reader& reader : readers) {
                if (reader.socket < 0) continue;
                if (reader.kind == 0) read_what_is_there(reader.socket, reader.text);
                if (reader.kind == 1) read_what_is_there(reader.socket, reader.text, random() % 500);
                if (random() % 400 == 0) {
                    ::close(reader.socket);
                    reader.socket = -1;
                    reader.end = i + 1;
                }
            }
        }
        const std::string problem = output->problem();
        EXPECT_EQ(sentences, problem.empty() ? 0U : 1U) << problem;
        // What is on its way arrives when the output ends, to who reads.
        for (Reader& reader : readers) {
            if (reader.socket >= 0 && reader.kind == 0) read_what_is_there(reader.socket, reader.text);
            // The end waits a moment for who does not read: in a few seeds is enough.
            if (reader.socket >= 0 && reader.kind != 0 && seed % 10 != 0) {
                read_what_is_there(reader.socket, reader.text);
                ::close(reader.socket);
                reader.socket = -1;
            }
        }
        output.reset();
        for (Reader& reader : readers) {
            if (reader.socket >= 0) read_what_is_there(reader.socket, reader.text);
            const std::uint32_t count = expect_lines_in_order(reader.text, reader.begin, reader.end);
            if (reader.kind == 0) {
                EXPECT_EQ(count, reader.end - reader.begin) << seed;
            }
            if (reader.socket >= 0) ::close(reader.socket);
        }
        EXPECT_NE(::access(path.c_str(), F_OK), 0) << "the socket is taken away";
        if (HasFailure()) break;
    }
}

// Promise: a reader that never reads costs no time and no memory: a hundred thousand lines are written, and those he
// did not take are counted; one that comes later and reads has them all.
TEST(LineOutputs, AStuckReaderHoldsNobodyUp) {
    TemporaryFolder folder;
    const std::string path = folder.path() + "/s";
    std::string message;
    auto output = open_line_output("unix:" + path, {}, message);
    ASSERT_NE(output, nullptr) << message;
    const int stuck = connect_unix(path);
    std::string said;
    for (std::uint32_t i = 0; i < 100'000; ++i) said += output->write("a line of poses, a short one\n");
    EXPECT_NE(said.find("a reader does not keep up"), std::string::npos);
    EXPECT_EQ(said.find("keep up"), said.rfind("keep up")) << "once";
    EXPECT_NE(output->problem().find("lines were lost"), std::string::npos);
    const int late = connect_unix(path);
    std::string text;
    for (std::uint32_t i = 0; i < 50; ++i) {
        EXPECT_EQ(output->write(numbered_line(i)), "");
        read_what_is_there(late, text);
    }
    EXPECT_EQ(expect_lines_in_order(text, 0, 50), 50U);
    ::close(stuck);
    ::close(late);
}

// Promise: more readers than there is room for are turned away at once, and their place is free again when one leaves.
TEST(LineOutputs, TooManyReaders) {
    TemporaryFolder folder;
    const std::string path = folder.path() + "/s";
    std::string message;
    auto output = open_line_output("unix:" + path, {}, message);
    ASSERT_NE(output, nullptr) << message;
    std::vector<int> sockets;
    for (std::size_t i = 0; i < kReadersMax + 2; ++i) {
        sockets.push_back(connect_unix(path));
        EXPECT_EQ(output->write("x\n"), "");
    }
    char byte = 0;
    for (std::size_t i = 0; i < sockets.size(); ++i) {
        const ssize_t count = ::recv(sockets[i], &byte, 1, MSG_DONTWAIT);
        EXPECT_EQ(count, i < kReadersMax ? 1 : 0) << i;  // 0: closed
    }
    ::close(sockets[0]);
    EXPECT_EQ(output->write("x\n"), "");
    const int another = connect_unix(path);
    EXPECT_EQ(output->write("y\n"), "");
    EXPECT_EQ(::recv(another, &byte, 1, MSG_DONTWAIT), 1);
    for (std::size_t i = 1; i < sockets.size(); ++i) ::close(sockets[i]);
    ::close(another);
}

// Promise: TCP to this machine and UDP carry the same bytes; a datagram is a line. UDP that nobody takes is counted.
TEST(LineOutputs, TcpAndUdp) {
    const int listener = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    ASSERT_EQ(::bind(listener, reinterpret_cast<const sockaddr*>(&address), size), 0);
    ASSERT_EQ(::getsockname(listener, reinterpret_cast<sockaddr*>(&address), &size), 0);
    const std::string port = std::to_string(ntohs(address.sin_port));
    std::string message;
    auto datagrams = open_line_output("udp:127.0.0.1:" + port, {}, message);
    ASSERT_NE(datagrams, nullptr) << message;
    EXPECT_EQ(datagrams->write("one\n"), "");
    EXPECT_EQ(datagrams->write("two\n"), "");
    char text[16] = {};
    EXPECT_EQ(::recv(listener, text, sizeof text, 0), 4);
    EXPECT_EQ(std::string(text), "one\n");
    ::close(listener);
    std::string said = datagrams->write("three\n");  // the network says so with the next one
    said += datagrams->write("four\n");
    EXPECT_NE(said.find("nobody listens there"), std::string::npos);

    // A port that TCP has free: asked for, and given back; somebody may be quicker, but not twenty times.
    std::unique_ptr<LineOutput> stream;
    std::string tcp_port;
    for (int i = 0; i < 20 && stream == nullptr; ++i) {
        const int probe = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        address.sin_port = 0;
        ASSERT_EQ(::bind(probe, reinterpret_cast<const sockaddr*>(&address), size), 0);
        ASSERT_EQ(::getsockname(probe, reinterpret_cast<sockaddr*>(&address), &size), 0);
        ::close(probe);
        tcp_port = std::to_string(ntohs(address.sin_port));
        stream = open_line_output("tcp:" + tcp_port, {}, message);
    }
    ASSERT_NE(stream, nullptr) << message;
    const int reader = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    ASSERT_EQ(::connect(reader, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(stream->write("five\n"), "");
    EXPECT_EQ(::recv(reader, text, sizeof text, 0), 5);
    auto second = open_line_output("tcp:127.0.0.1:" + tcp_port, {}, message);
    EXPECT_EQ(second, nullptr);
    EXPECT_NE(message.find("give another port"), std::string::npos) << message;
    ::close(reader);
}

// Promise: the socket of a run that was killed is taken over; a file, and a socket that somebody serves, are not.
TEST(LineOutputs, UnixPathsThatAreThere) {
    TemporaryFolder folder;
    const std::string path = folder.path() + "/s";
    std::string message;
    {
        const int dead = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
        sockaddr_un address{};
        address.sun_family = AF_UNIX;
        std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
        ASSERT_EQ(::bind(dead, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
        ::close(dead);
    }
    auto output = open_line_output("unix:" + path, {}, message);
    ASSERT_NE(output, nullptr) << message;
    EXPECT_EQ(open_line_output("unix:" + path, {}, message), nullptr);
    EXPECT_NE(message.find("another program's socket"), std::string::npos) << message;
    output.reset();
    std::ofstream(path) << "a file\n";
    EXPECT_EQ(open_line_output("unix:" + path, {}, message), nullptr);
    EXPECT_NE(message.find("is no socket"), std::string::npos) << message;
    EXPECT_EQ(::access(path.c_str(), F_OK), 0) << "and it is still there";
}

// Promise: every wrong name gets a sentence with its remedy.
TEST(LineOutputs, WrongNames) {
    std::string message;
    for (const char* const name : {"tcp:", "tcp:port", "tcp:70000", "udp:127.0.0.1:", "udp:127.0.0.1:x",
                                   "unix:", "tcp:no.such.host.invalid:80", "unix:/no/such/folder/s"}) {
        message.clear();
        EXPECT_EQ(open_line_output(name, {}, message), nullptr) << name;
        EXPECT_EQ(message.find(std::string("--poses ") + name + ": "), 0U) << message;
        EXPECT_TRUE(message.ends_with(".") || message.ends_with("?")) << message;
    }
}

// Promise: the patience is for the reader of standard output alone: a named pipe whose reader sleeps is not waited for.
TEST(LineOutputs, ASleepingReaderOfAPipeIsNotWaitedFor) {
    const TemporaryFolder folder;
    const std::string pipe = folder.path("pipe");
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    const int reader = ::open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    std::string message;
    LineOutputOptions options;
    options.patience_ms = 3'600'000;  // the test would not end
    const auto output = open_line_output(pipe, options, message);
    ASSERT_NE(output, nullptr) << message;
    std::size_t said = 0;
    for (std::uint32_t i = 0; i < 300; ++i) said += output->write(numbered_line(i)).empty() ? 0U : 1U;
    EXPECT_EQ(said, 1U);
    EXPECT_NE(output->problem().find("does not keep up"), std::string::npos) << output->problem();
    ::close(reader);
}

}  // namespace
}  // namespace stillmesh::line_outputs_test
