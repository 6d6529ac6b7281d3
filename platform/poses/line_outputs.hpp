// Where lines go while a run goes on: files, pipes, and readers on sockets. Whoever reads, does not read, is slow or
// dies, writing never waits: what somebody did not take in time is lost to him, counted, and said once.
//
//   -, FILE, a named pipe      as LineFile: whole lines; a file may be added to and limited
//   unix:PATH, tcp:[HOST:]PORT readers connect (at most kReadersMax; more are turned away) and get whole lines from
//                              then on; without a HOST only from this machine. A reader that leaves is no loss.
//   udp:HOST:PORT              a datagram a line
//
// One thread. Memory: kPendingBytesMax for each reader, taken at open(); no heap call while lines are written. Cost:
// one system call for each reader and line (1 us for a file, 25 where a reader has to be woken), and one that looks for
// new readers.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "platform/linux/text_output.hpp"

namespace stillmesh {

class LineOutput {
public:
    virtual ~LineOutput() = default;
    // Whole lines, each ended. Returns what to say when these are the first that somebody lost; else empty.
    [[nodiscard]] virtual std::string write(std::string_view lines) = 0;
    // What was lost over all; empty: nothing.
    [[nodiscard]] virtual std::string problem() const = 0;
    // After a log rotation. False: `message` says why.
    [[nodiscard]] virtual bool reopen(std::string& message) {
        static_cast<void>(message);
        return true;
    }
};

inline constexpr std::size_t kReadersMax = 8;
inline constexpr std::size_t kPendingBytesMax = 16384;  // of a line that a reader has taken in part

struct LineOutputOptions {
    bool is_added_to = false;        // files: to what is there
    std::uint64_t bytes_max = 0;     // files: beyond, FILE becomes FILE.1
    int patience_ms = 0;             // for the reader of standard output
    const char* option = "--poses";  // that asked for it, and what it writes: in what is said of sockets
    const char* what = "lines";
};

// null: `message` says why. Nothing that is there is replaced but a file, and the socket of a run that has ended.
[[nodiscard]] std::unique_ptr<LineOutput> open_line_output(const std::string& destination,
                                                           const LineOutputOptions& options, std::string& message);
// Whether the name is that of a file or pipe, and not of a socket.
[[nodiscard]] bool is_file_destination(std::string_view destination) noexcept;

}  // namespace stillmesh
