/* Hears the poses of `stillmesh run --poses udp:127.0.0.1:5600`, until none has come for five seconds: poses_udp [PORT]
 */
#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>

static void wait_at_most(int socket, time_t seconds) {
    const struct timeval limit = {seconds, 0};
    setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
}

/* What stands behind a key, in a line without spaces that was written by a program. */
static const char* value_of(const char* line, const char* key) {
    const char* at = strstr(line, key);
    return at != NULL ? at + strlen(key) : "";
}

int main(int argc, char** argv) {
    const int poses = socket(AF_INET, SOCK_DGRAM, 0);
    struct sockaddr_in here = {0};
    here.sin_family = AF_INET;
    here.sin_port = htons((in_port_t)(argc > 1 ? atoi(argv[1]) : 5600));
    here.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (bind(poses, (const struct sockaddr*)&here, sizeof here) != 0) return 1;
    wait_at_most(poses, 60);
    char line[4096];
    for (ssize_t size = 0; (size = recv(poses, line, sizeof line - 1, 0)) > 0; wait_at_most(poses, 5)) {
        line[size] = '\0'; /* a datagram is a line of docs/poses.md */
        char state[16] = "", reason[32] = "";
        double x = 0, y = 0, z = 0;
        const int frame = atoi(value_of(line, "\"frame\":"));
        if (sscanf(value_of(line, "\"state\":\""), "%15[^\"]", state) != 1) continue; /* an event, in words */
        if (strcmp(state, "none") == 0) {
            (void)sscanf(value_of(line, "\"reason\":\""), "%31[^\"]", reason);
            printf("frame %d: no pose, %s: stop\n", frame, reason);
        } else if (sscanf(value_of(line, "\"map_from_camera\":{\"p\":["), "%lf,%lf,%lf", &x, &y, &z) == 3) {
            printf("frame %d: %s, %.2f m right, %.2f m ahead of the start\n", frame, state, x, z);
        }
    }
    return 0;
}
