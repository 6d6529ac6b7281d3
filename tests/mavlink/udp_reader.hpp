// A port of this machine that takes datagrams.
#pragma once

#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <string>
#include <vector>

namespace stillmesh::test {

class UdpReader {
public:
    UdpReader() : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
        const int room = 8 << 20;  // nobody reads while the program runs
        static_cast<void>(::setsockopt(socket_, SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room));
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t size = sizeof address;
        if (::bind(socket_, reinterpret_cast<const sockaddr*>(&address), size) != 0) return;
        if (::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size) == 0) port_ = ntohs(address.sin_port);
    }
    ~UdpReader() { close(); }
    UdpReader(const UdpReader&) = delete;
    UdpReader& operator=(const UdpReader&) = delete;

    void close() {
        if (socket_ >= 0) static_cast<void>(::close(socket_));
        socket_ = -1;
    }
    [[nodiscard]] std::string destination() const { return "udp:127.0.0.1:" + std::to_string(port_); }
    // What has come by now.
    [[nodiscard]] std::vector<std::string> datagrams() const {
        std::vector<std::string> out;
        std::array<char, 2048> bytes{};
        for (;;) {
            const ssize_t size = ::recv(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT);
            if (size < 0) return out;
            out.emplace_back(bytes.data(), static_cast<std::size_t>(size));
        }
    }

private:
    int socket_ = -1;
    int port_ = 0;
};

}  // namespace stillmesh::test
