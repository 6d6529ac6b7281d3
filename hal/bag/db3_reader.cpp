#include "hal/bag/db3_reader.hpp"

#include <sqlite3.h>

#include <string_view>

namespace stillmesh {
namespace {

[[nodiscard]] std::string_view text_of(sqlite3_stmt* row, int column) {
    const unsigned char* const letters = sqlite3_column_text(row, column);
    if (letters == nullptr) return {};
    return {reinterpret_cast<const char*>(letters), static_cast<std::size_t>(sqlite3_column_bytes(row, column))};
}

}  // namespace

void Db3Reader::close() noexcept {
    static_cast<void>(sqlite3_finalize(statement_));
    static_cast<void>(sqlite3_close(database_));
    statement_ = nullptr;
    database_ = nullptr;
}

Status Db3Reader::fail(const char* what, std::string& message) const {
    message = name_ + ": " + what + " (SQLite: " + sqlite3_errmsg(database_) + ").";
    return Status::kInvalid;
}

bool Db3Reader::prepare(const char* sql) {
    static_cast<void>(sqlite3_finalize(statement_));
    statement_ = nullptr;
    return sqlite3_prepare_v2(database_, sql, -1, &statement_, nullptr) == SQLITE_OK;
}

// Tables: a view may be any computation.
bool Db3Reader::has_tables() {
    return prepare("SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages')") &&
           sqlite3_step(statement_) == SQLITE_ROW && sqlite3_column_int(statement_, 0) == 2;
}

Status Db3Reader::open(const std::string& file, BagTopics& topics, std::string& message) {
    name_ = file;
    topics_ = &topics;
    BagFile regular;  // SQLite would wait for a pipe
    STILLMESH_TRY(regular.open(file, message));
    if (sqlite3_open_v2(file.c_str(), &database_, SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX, nullptr) != SQLITE_OK) {
        return fail("cannot be opened", message);
    }
    static_cast<void>(sqlite3_limit(database_, SQLITE_LIMIT_LENGTH, static_cast<int>(kBagPieceBytesMax)));
    static_cast<void>(sqlite3_db_config(database_, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr));
    static_cast<void>(sqlite3_exec(database_, "PRAGMA cell_size_check = ON", nullptr, nullptr, nullptr));
    // Nothing is written; but with this SQLite opens a file that is shorter than its header says.
    static_cast<void>(sqlite3_exec(database_, "PRAGMA writable_schema = ON", nullptr, nullptr, nullptr));
    if (!has_tables()) {
        return fail(
            "has no tables 'topics' and 'messages' as rosbag2 makes them, or was left open by a recorder that "
            "was killed: open it once with 'sqlite3 FILE .tables', which puts it in order",
            message);
    }
    if (!prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY rowid")) {
        return fail("its table 'topics' is not as rosbag2 makes it", message);
    }
    int status = SQLITE_DONE;
    while ((status = sqlite3_step(statement_)) == SQLITE_ROW) {
        if (text_of(statement_, 3) != "cdr" || places_.size() >= kTopicsMax) continue;
        const auto place = topics.place_of(text_of(statement_, 1), text_of(statement_, 2), MessageLayout::kCdr);
        if (place) places_[sqlite3_column_int64(statement_, 0)] = *place;
    }
    if (status != SQLITE_DONE) return fail("its table 'topics' cannot be read", message);
    if (!prepare("SELECT topic_id, timestamp, data FROM messages ORDER BY rowid")) {
        return fail("its table 'messages' is not as rosbag2 makes it", message);
    }
    return Status::kOk;
}

Status Db3Reader::next(BagMessage& out, std::string& message) {
    while (!is_over_) {
        const int status = sqlite3_step(statement_);
        is_over_ = status != SQLITE_ROW;
        if (status == SQLITE_DONE) break;
        if (is_over_) {
            static_cast<void>(fail("is torn or damaged; it was played up to there", message));
            return Status::kCorrupt;
        }
        const auto place = places_.find(sqlite3_column_int64(statement_, 0));
        if (place == places_.end() || !(*topics_)[place->second].is_wanted) continue;
        const auto* const bytes = static_cast<const std::uint8_t*>(sqlite3_column_blob(statement_, 2));
        const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_, 2));
        out = {place->second, sqlite3_column_int64(statement_, 1),
               bytes == nullptr ? std::span<const std::uint8_t>{} : std::span(bytes, size)};
        return Status::kOk;
    }
    return Status::kEnd;
}

}  // namespace stillmesh
