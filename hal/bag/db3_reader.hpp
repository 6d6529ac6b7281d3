// Bags of ROS 2 in SQLite: a table of topics and one of messages, read row by row in the order of writing, so that no
// index is needed and none is made. One place knows the SQLite library. The file is opened for reading alone; tables
// alone are read, no views. Memory: SQLite's cache of 2 MB, and a message, at most kBagPieceBytesMax.
#pragma once

#include <map>
#include <string>

#include "hal/bag/bag_file.hpp"
#include "hal/bag/bag_reader.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace stillmesh {

class Db3Reader final : public BagReader {
public:
    Db3Reader() = default;
    ~Db3Reader() override { close(); }
    Db3Reader(const Db3Reader&) = delete;
    Db3Reader& operator=(const Db3Reader&) = delete;

    [[nodiscard]] Status open(const std::string& file, BagTopics& topics, std::string& message) override;
    [[nodiscard]] Status next(BagMessage& out, std::string& message) override;

private:
    void close() noexcept;
    [[nodiscard]] Status fail(const char* what, std::string& message) const;
    [[nodiscard]] bool prepare(const char* sql);
    [[nodiscard]] bool has_tables();

    std::string name_;
    BagTopics* topics_ = nullptr;
    std::map<std::int64_t, std::uint32_t> places_;  // of a topic's row
    sqlite3* database_ = nullptr;
    sqlite3_stmt* statement_ = nullptr;
    bool is_over_ = false;
};

}  // namespace stillmesh
