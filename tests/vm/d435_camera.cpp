// An Intel RealSense D435 for a real kernel without one: uvcvideo binds to it, V4L2 streams its rendered pictures, its
// extension unit tells its calibration. Faults happen when they are asked for. Needs root.
//   d435_camera FOLDER COMMAND [ARGUMENTS]  runs the command beside the camera, which is not plugged in yet; FOLDER
//   holds
//                                           the pictures (d435_pictures); its exit code is the command's
//   d435_camera tell WORDS...               in the command; prints the answer, 1 if there is none or it is an error:
//     plug [usb2], unplug                   at SuperSpeed, or at the speed of USB 2
//     stall depth|infrared|colour|none      its pictures end in the middle of nowhere: no error, no data
//     short STREAM NUMBER                   so many of its next pictures end after half their lines
//     crc good|bad                          the calibration tables' checksums
//     commands answered|refused             Intel's commands stall
//     metadata blocks|clock|none            headers of pictures: with Intel's blocks, the standard's alone, without a
//     clock stereo aside|together                 the stereo module stands 15 mm beside the colour camera, or in its
//     place control answered|deaf                no control request is answered, none stalled: the kernel gives up
//     counts                                a line per stream: how often it began, pictures sent, short ones, skipped
//     projector                             0: off, 1: on, turns: on for every other picture
//     clock                                 when picture 0 was due, s since 1970
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <sstream>

#include "tests/vm/extension_unit.hpp"
#include "tests/vm/video_stream.hpp"

namespace {

using vm::Bytes;

constexpr char kSocket[] = "/tmp/d435.socket";

std::int64_t clock_ns(clockid_t clock) {
    timespec now{};
    static_cast<void>(::clock_gettime(clock, &now));
    return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}
std::int64_t now_ns() {
    return clock_ns(CLOCK_MONOTONIC);
}

class D435 final : public vm::UsbDevice {
public:
    explicit D435(const std::string& folder)
        : streams_{vm::StreamSource(vm::video_streams()[0], folder), vm::StreamSource(vm::video_streams()[1], folder),
                   vm::StreamSource(vm::video_streams()[2], folder)} {}

    void restart(vm::UsbSpeed speed) {
        standard_ = vm::d435_descriptors(speed);
        for (vm::StreamSource& one : streams_) one.restart(now_ns());
    }
    bool control(const vm::Setup& setup, const Bytes& written, Bytes& data) override;
    bool bulk(std::uint32_t endpoint, std::uint32_t most, Bytes& data) override;
    [[nodiscard]] std::array<vm::StreamSource, 3>& streams() { return streams_; }

    vm::ExtensionUnit extension_unit;

private:
    vm::StreamSource* at_endpoint(std::uint32_t endpoint) {
        for (vm::StreamSource& one : streams_) {
            if (one.stream().endpoint == endpoint) return &one;
        }
        return nullptr;
    }

    vm::StandardAnswers standard_;
    std::array<vm::StreamSource, 3> streams_;
};

bool D435::control(const vm::Setup& setup, const Bytes& written, Bytes& data) {
    constexpr std::uint8_t kClearHalt = 0x02, kSetInterface = 0x01, kSetRequest = 11, kConfigure = 9;
    // How uvcvideo ends a stream: it clears the halt of a bulk endpoint.
    if (setup.type == kClearHalt && setup.request == 1) {
        if (vm::StreamSource* const source = at_endpoint(setup.index & 0xfU)) source->stop();
    }
    if (setup.type == kSetInterface && setup.request == kSetRequest) {
        for (vm::StreamSource& one : streams_) {
            if (one.stream().interface == (setup.index & 0xffU)) one.stop();
        }
    }
    if (setup.type == 0 && setup.request == kConfigure) {  // as after a reset
        for (vm::StreamSource& one : streams_) one.stop();
    }
    if ((setup.type & 0x60U) != 0x20) return standard_.answer(setup, data);
    const std::uint32_t number = setup.index & 0xffU, unit = setup.index >> 8U;
    for (vm::StreamSource& one : streams_) {
        if (one.stream().interface == number) return one.control(setup, written, data);
    }
    constexpr std::uint16_t kErrorCode = 0x0200;
    if (number == vm::kStereoControl && unit == vm::kMonitorUnit) return extension_unit.control(setup, written, data);
    if (unit == 0 && setup.value == kErrorCode && setup.request == vm::kGetCurrent) {
        data = {extension_unit.error_code()};
        return true;
    }
    return false;
}

bool D435::bulk(std::uint32_t endpoint, std::uint32_t most, Bytes& data) {
    vm::StreamSource* const source = at_endpoint(endpoint);
    if (source == nullptr) return false;
    source->settings().is_emitter_on = extension_unit.values()[0] != 0;
    source->settings().has_turns = extension_unit.monitor.has_turns;
    source->settings().laser_power = extension_unit.values()[2];
    return source->take(most, data, now_ns());
}

class Bench {
public:
    explicit Bench(const std::string& folder) : camera_(folder), port_(camera_) {}
    int run(char** command);

private:
    std::string obey(const std::string& line);
    std::string counts();
    void answer_teller(int listener);
    int timeout_ms();

    D435 camera_;
    vm::UsbPort port_;
};

std::string Bench::counts() {
    std::ostringstream text;
    for (vm::StreamSource& one : camera_.streams()) {
        const vm::StreamCounts& counts = one.counts();
        text << one.stream().name << " streams " << counts.streams << " sent " << counts.sent << " short "
             << counts.short_sent << " skipped " << counts.skipped << '\n';
    }
    return text.str();
}

// The answer; an error begins with "no".
std::string Bench::obey(const std::string& line) {
    std::istringstream words(line);
    std::string verb, what;
    words >> verb >> what;
    if (verb == "plug") {
        const vm::UsbSpeed speed = what == "usb2" ? vm::UsbSpeed::kHigh : vm::UsbSpeed::kSuper;
        port_.unplug();
        camera_.restart(speed);
        return port_.plug(speed) ? "plugged in\n" : "no: the controller does not take it\n";
    }
    if (verb == "unplug") {
        port_.unplug();
        return "unplugged\n";
    }
    if (verb == "counts") return counts();
    if (verb == "projector") {
        const vm::ExtensionUnit& unit = camera_.extension_unit;
        return unit.monitor.has_turns ? "turns\n" : std::to_string(unit.values()[0]) + '\n';
    }
    if (verb == "metadata" && (what == "blocks" || what == "clock" || what == "none")) {
        for (vm::StreamSource& one : camera_.streams()) {
            one.settings().header = what == "blocks"  ? vm::HeaderKind::kBlocks
                                    : what == "clock" ? vm::HeaderKind::kClock
                                                      : vm::HeaderKind::kBare;
        }
        return line + '\n';
    }
    if (verb == "clock") {
        const std::int64_t ahead_ns = clock_ns(CLOCK_REALTIME) - now_ns();
        return std::to_string(static_cast<double>(camera_.streams()[0].epoch_ns() + ahead_ns) * 1e-9) + '\n';
    }
    if (verb == "stereo" && (what == "aside" || what == "together")) {
        camera_.extension_unit.monitor.is_together = what == "together";
        for (vm::StreamSource& one : camera_.streams()) one.settings().is_together = what == "together";
        return line + '\n';
    }
    const bool is_good = what == "good" || what == "answered";
    if (verb == "crc") camera_.extension_unit.monitor.is_corrupt = !is_good;
    if (verb == "control") port_.set_deaf(!is_good);
    if (verb == "commands") camera_.extension_unit.is_refused = !is_good;
    bool is_known = (verb == "crc" && (is_good || what == "bad")) ||
                    (verb == "commands" && (is_good || what == "refused")) ||
                    (verb == "control" && (is_good || what == "deaf")) || (verb == "stall" && what == "none");
    for (vm::StreamSource& one : camera_.streams()) {
        const bool is_meant = what == one.stream().name;
        if (verb == "stall") one.settings().is_stalled = is_meant;
        if (verb == "short" && is_meant) words >> one.settings().short_pictures;
        is_known = is_known || (is_meant && (verb == "stall" || (verb == "short" && words)));
    }
    return is_known ? line + '\n' : "no: '" + line + "' is not understood\n";
}

void Bench::answer_teller(int listener) {
    const int teller = ::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC);
    if (teller < 0) return;
    char line[256];
    const ssize_t size = ::read(teller, line, sizeof(line));
    const std::string answer = obey(std::string(line, static_cast<std::size_t>(std::max<ssize_t>(size, 0))));
    static_cast<void>(::send(teller, answer.data(), answer.size(), MSG_NOSIGNAL));
    static_cast<void>(::close(teller));
}

// Until the next picture is due that someone waits for; short, since the command may end.
int Bench::timeout_ms() {
    std::int64_t ns = 50'000'000;
    for (const vm::StreamSource& one : camera_.streams()) {
        if (!port_.has_waiting(one.stream().endpoint) || !one.is_streaming()) continue;
        ns = std::min(ns, std::max<std::int64_t>(one.due_ns() - now_ns(), 0) + 999'999);
    }
    return static_cast<int>(ns / 1'000'000);
}

int listen_for_tellers() {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::snprintf(address.sun_path, sizeof(address.sun_path), "%s", kSocket);
    static_cast<void>(::unlink(kSocket));
    const int listener = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const bool is_bound = listener >= 0 &&
                          ::bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 &&
                          ::listen(listener, 4) == 0;
    if (!is_bound) std::perror(kSocket);
    return is_bound ? listener : -1;
}

int Bench::run(char** command) {
    const int listener = listen_for_tellers();
    if (listener < 0) return 2;
    const pid_t child = ::fork();
    if (child == 0) {
        ::execvp(command[0], command);
        std::perror(command[0]);
        ::_exit(127);
    }
    int status = 0;
    while (::waitpid(child, &status, WNOHANG) == 0) {
        pollfd files[2] = {{listener, POLLIN, 0}, {port_.socket(), POLLIN, 0}};
        static_cast<void>(::poll(files, 2, timeout_ms()));
        if (files[0].revents != 0) answer_teller(listener);
        if (files[1].revents != 0 && port_.socket() == files[1].fd) port_.serve_one();
        port_.serve_waiting();
    }
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1;
}

int tell(int count, char** words) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::snprintf(address.sun_path, sizeof(address.sun_path), "%s", kSocket);
    std::string line, answer;
    for (int i = 0; i < count; ++i) line += (i > 0 ? " " : "") + std::string(words[i]);
    const int file = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (file < 0 || ::connect(file, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 ||
        ::send(file, line.data(), line.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(line.size())) {
        std::perror(kSocket);
        return 1;
    }
    char part[256];
    for (ssize_t size = 0; (size = ::read(file, part, sizeof(part))) > 0;) {
        answer.append(part, static_cast<std::size_t>(size));
    }
    std::fputs(answer.c_str(), stdout);
    return answer.empty() || answer.starts_with("no") ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc > 2 && std::string(argv[1]) == "tell") return tell(argc - 2, argv + 2);
    if (argc < 3) return 2;
    return Bench(argv[1]).run(argv + 2);
}
