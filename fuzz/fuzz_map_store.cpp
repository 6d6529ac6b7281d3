// A segment of a map store (platform/store) and a region's body (engine/record), any bytes, as they are and with check
// sums that fit: a sentence, or a store that holds what it says, answers with whole bodies, takes one more region and
// opens again; a region is refused, or every feature of it can be read.
#include <unistd.h>

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "engine/base/crc.hpp"
#include "engine/paging/region.hpp"
#include "fuzz/fuzz.hpp"
#include "platform/store/region_store.hpp"

namespace {

using namespace stillmesh;

void check_body(std::span<const std::byte> bytes) {
    RegionInfo info;
    const Status status = check_region(bytes, {50, 8, 640, 480}, info);
    fuzz::expect(
        status == Status::kOk || status == Status::kInvalid || status == Status::kCorrupt || status == Status::kFull,
        "a closed list of answers");
    if (status != Status::kOk) return;
    fuzz::expect(info.keyframe.observations <= 50, "no more features than asked for");
    for (std::uint32_t i = 0; i < info.keyframe.observations; ++i) {
        Observation observation;
        Descriptor descriptor;
        MapPoint point;
        read_region_feature(bytes, i, observation, descriptor, point);
        fuzz::expect(!point.is_suspect && observation.level < 8, "what was checked is right");
    }
}

void put(std::vector<std::byte>& bytes, std::size_t at, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i));
}

// Gives the header and each record from `at` on the check sums that their bytes have.
void mend(std::vector<std::byte>& bytes) {
    using namespace store_records;
    if (bytes.size() < kSegmentHeaderBytes) return;
    std::vector<std::byte> header(kSegmentHeaderBytes);
    write_segment_header(std::span<std::byte, kSegmentHeaderBytes>(header.data(), kSegmentHeaderBytes), {1, 2, 3}, 1);
    std::copy(header.begin(), header.end(), bytes.begin());
    for (std::size_t at = kSegmentHeaderBytes; bytes.size() - at >= kHeadBytes;) {
        const auto number = [&](std::size_t i) {
            return std::to_integer<std::uint32_t>(bytes[at + i]) | std::to_integer<std::uint32_t>(bytes[at + i + 1])
                                                                       << 8;
        };
        const std::size_t words = number(12) % 64;
        const std::size_t body = number(16) % 1024;
        const std::size_t size = kHeadBytes + kWordBytes * words + body;
        if (bytes.size() - at < size) return;
        const char letters[] = {'S', 'T', 'I', 'L', 'L', 'R', 'E', 'G'};
        for (std::size_t i = 0; i < 8; ++i) bytes[at + i] = static_cast<std::byte>(letters[i]);
        put(bytes, at + 12, static_cast<std::uint32_t>(words));
        put(bytes, at + 16, static_cast<std::uint32_t>(body));
        const std::span<const std::byte> all(bytes);
        put(bytes, at + 20, crc32(all.subspan(at + kHeadBytes, kWordBytes * words)));
        put(bytes, at + 24, crc32(all.subspan(at + kHeadBytes + kWordBytes * words, body)));
        put(bytes, at + kHeadBytes - 4, crc32(all.subspan(at, kHeadBytes - 4)));
        at += size;
    }
}

void open(const std::string& folder, const std::vector<std::byte>& bytes) {
    {
        std::ofstream out(folder + "/00000001.seg", std::ios::binary | std::ios::trunc);
        out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    }
    RegionStoreOptions options;
    options.folder = folder;
    options.origin = {1, 2, 3};
    options.regions_max = 16;
    options.is_durable = false;
    std::uint64_t regions = 0;
    for (int round = 0; round < 2; ++round) {
        RegionStore store;
        std::string message;
        const bool is_open = store.open(options, message);
        fuzz::expect(is_open || !message.empty(), "a sentence for every refusal");
        fuzz::expect(is_open || round == 0, "what was opened opens again");
        if (!is_open) return;
        fuzz::expect(store.find_fault().empty(), "the index is right: " + store.find_fault());
        fuzz::expect(round == 0 || store.content().regions == regions, "the same regions again");
        std::vector<WordWeight> words;
        for (std::uint16_t word = 0; word < 200; ++word) words.push_back({1000, word});
        StoreQuestion question;
        question.words = words;
        StoreAnswer answer;
        std::vector<std::byte> body(1U << 20U);
        if (store.find(question, answer, body)) check_body(std::span(body).first(answer.size_bytes));
        if (round == 0) {
            LeavingRegion region;
            region.id = 12345;
            region.words = words;
            region.body = std::span<const std::byte>(body).first(10);
            fuzz::expect(store.keep(region) || store.has_failed(), "one more is taken, or it says why not");
            if (store.has_failed()) return;
        }
        regions = store.content().regions;
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const auto* const first = reinterpret_cast<const std::byte*>(data);
    std::vector<std::byte> bytes(first, first + size_bytes);
    check_body(bytes);
    std::string folder = (std::filesystem::temp_directory_path() / "stillmesh-fuzz-XXXXXX").string();
    if (::mkdtemp(folder.data()) == nullptr) return 0;
    open(folder, bytes);
    mend(bytes);
    open(folder, bytes);
    std::filesystem::remove_all(folder);
    return 0;
}
