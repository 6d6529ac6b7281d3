// Text files. A line file is written line by line while the program runs: every finished line survives whatever happens
// to the process, and a destination that takes no lines (a full disk, a pipe without a reader or with a slow one) costs
// those lines and no time. Linux; one write(2) a line.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace stillmesh {

class LineFile {
public:
    LineFile() = default;
    ~LineFile() { close(); }
    LineFile(const LineFile&) = delete;
    LineFile& operator=(const LineFile&) = delete;

    // What is there already is added to (a last line that a crash has cut is ended first), from open() on.
    void add_to_it() { is_added_to_ = true; }
    // A file that has grown beyond becomes FILE.1, replacing the one before, and begins anew; 0: no limit. Before
    // open().
    void limit_to(std::uint64_t bytes) { bytes_max_ = bytes; }
    // "-" is standard output. Replaces the file, or adds to it; a pipe, a terminal or another device is written to as
    // it is, and a named pipe needs no reader yet. False: `message` says why.
    [[nodiscard]] bool open(const std::string& file, std::string& message);
    // The file under the same name anew, after it was moved away; one that is still there is added to. False: as open,
    // and the old one is kept.
    [[nodiscard]] bool reopen(std::string& message);
    [[nodiscard]] bool is_open() const { return !file_.empty(); }
    // Whole lines. False: they were not written, none of them in part, and `message` says why; later ones may be.
    // Waits for a reader no longer than wait_for_reader() allows: not at all, unless it was called.
    [[nodiscard]] bool write(std::string_view lines, std::string& message);
    void wait_for_reader(int milliseconds) { patience_ms_ = milliseconds; }
    void close();

private:
    [[nodiscard]] bool open_with(int flags, std::string& message);
    // False: errno says why.
    [[nodiscard]] bool write_all(std::string_view lines);

    void begin_anew_if_large();

    std::string file_;
    std::uint64_t bytes_max_ = 0;
    bool is_added_to_ = false;
    int descriptor_ = -1;
    int patience_ms_ = 0;
    bool is_regular_ = true;
    bool is_torn_ = false;  // the last line ends in the middle, and could not be taken back
};

// A line file whose failures end nothing: lines that could not be written are counted.
class CountedLines {
public:
    // As those of a line file.
    void add_to_it() { lines_.add_to_it(); }
    void limit_to(std::uint64_t bytes) { lines_.limit_to(bytes); }
    [[nodiscard]] bool open(const std::string& file, std::string& message) { return lines_.open(file, message); }
    [[nodiscard]] bool reopen(std::string& message) { return lines_.reopen(message); }
    [[nodiscard]] bool is_open() const { return lines_.is_open(); }
    void wait_for_reader(int milliseconds) { lines_.wait_for_reader(milliseconds); }
    // The sentence to say when these are the first that could not be written; else empty.
    [[nodiscard]] std::string write(std::string_view lines);
    // What to say of the run: how many were not written, and why the first was not; empty: all were.
    [[nodiscard]] std::string problem() const;

private:
    LineFile lines_;
    std::uint64_t written_ = 0, missing_ = 0;
    std::string first_message_;
};

// Writes beside the file and renames: readers see the old file or the new one, never half of it. What is no regular
// file (a pipe, a terminal, a device) is written to and never replaced; its reader has
// a few seconds to take it.
[[nodiscard]] bool write_whole_file(const std::string& file, std::string_view text, std::string& message);

// Without what commands a terminal: control bytes, alone or as UTF-8 (U+0080 to U+009F), are question marks; ends of
// lines and tabs stay. For sentences that quote files.
[[nodiscard]] std::string printable(std::string text);

// Writes to standard output. False: this, or something before it, could not be (a full disk, a closed pipe).
[[nodiscard]] bool write_standard_output(std::string_view text, std::string& message);
// As before, for text that its reader may have enough of (`| head`): a pipe that is closed is no failure.
[[nodiscard]] bool write_for_reader(std::string_view text, std::string& message);
// Writes to standard error what a run says while it runs. Never waits: where a pipe is full, or has no reader, it is
// dropped.
void write_standard_error(std::string_view text);

}  // namespace stillmesh
