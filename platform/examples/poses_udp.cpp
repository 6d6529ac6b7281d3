// Hears the poses of `stillmesh run --poses udp:127.0.0.1:5600`, until none has come for five seconds: poses_udp [PORT]
#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>

static void wait_at_most(int socket, time_t seconds) {
    const timeval limit{seconds, 0};
    setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
}

int main(int argc, char** argv) {
    const int poses = socket(AF_INET, SOCK_DGRAM, 0);
    sockaddr_in here{};
    here.sin_family = AF_INET;
    here.sin_port = htons(static_cast<in_port_t>(argc > 1 ? std::atoi(argv[1]) : 5600));
    here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (bind(poses, reinterpret_cast<const sockaddr*>(&here), sizeof here) != 0) return 1;
    wait_at_most(poses, 60);
    char line[4096];
    for (ssize_t size = 0; (size = recv(poses, line, sizeof line, 0)) > 0; wait_at_most(poses, 5)) {
        const auto pose = nlohmann::json::parse(line, line + size);  // a datagram is a line of docs/poses.md
        if (pose["type"] != "pose") continue;                        // an event, in words
        const int frame = pose["frame"];
        const std::string state = pose["state"];
        if (state == "none") {
            std::printf("frame %d: no pose, %s: stop\n", frame, pose["reason"].get<std::string>().c_str());
            continue;
        }
        const auto& p = pose["map_from_camera"]["p"];
        std::printf("frame %d: %s, %.2f m right, %.2f m ahead of the start\n", frame, state.c_str(), p[0].get<double>(),
                    p[2].get<double>());
    }
}
