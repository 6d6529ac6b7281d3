// A segment of a map store (platform/store) and a region's body (engine/paging), any bytes, as they are and with check
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

// A folder of this process in memory, where there is one: what costs time here is the file system. Left behind only by
// an input that breaks something.
const std::string& folder() {
    static const struct Folder {
        Folder() {
            const char* const memory = "/dev/shm";
            const bool is_there = ::access(memory, W_OK) == 0;
            const std::filesystem::path above = is_there ? memory : std::filesystem::temp_directory_path();
            name = (above / "stillmesh-fuzz-XXXXXX").string();
            fuzz::expect(::mkdtemp(name.data()) != nullptr, "a folder to work in");
        }
        ~Folder() {
            std::error_code ignored;
            std::filesystem::remove_all(name, ignored);
        }
        std::string name;
    } made;
    return made.name;
}

// What no segment needs again, so that an input does the same whatever was before it.
void clear(const std::string& name) {
    for (const auto& entry : std::filesystem::directory_iterator(name)) std::filesystem::remove_all(entry.path());
}

std::span<const WordWeight> all_words() {
    static const std::vector<WordWeight> words = [] {
        std::vector<WordWeight> out;
        for (std::uint16_t word = 0; word < 200; ++word) out.push_back({1000, word});
        return out;
    }();
    return words;
}

// Asks, and in the first round keeps one more; false: the store says that it could not.
bool use(RegionStore& store, bool is_keeping) {
    static std::vector<std::byte> body(1U << 20U);
    const std::string fault = store.find_fault();
    fuzz::expect(fault.empty(), "the index is right: " + fault);
    StoreQuestion question;
    question.words = all_words();
    StoreAnswer answer;
    if (store.find(question, answer, body)) check_body(std::span(body).first(answer.size_bytes));
    if (!is_keeping) return true;
    LeavingRegion region;
    region.id = 12345;
    region.words = all_words();
    static const std::vector<std::byte> left(10);
    region.body = left;
    fuzz::expect(store.keep(region) || store.has_failed(), "one more is taken, or it says why not");
    return !store.has_failed();
}

void open(const std::vector<std::byte>& bytes) {
    clear(folder());
    {
        std::ofstream out(folder() + "/00000001.seg", std::ios::binary | std::ios::trunc);
        out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    }
    RegionStoreOptions options;
    options.folder = folder();
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
        fuzz::expect(round == 0 || store.content().regions == regions, "the same regions again");
        if (!use(store, round == 0)) return;
        regions = store.content().regions;
    }
}

}  // namespace

#ifdef STILLMESH_LIBFUZZER
#include "fuzz/mutator.hpp"

namespace {

std::size_t piece_bytes(std::span<const std::uint8_t> rest, bool is_head) {
    using namespace store_records;
    if (is_head) return kSegmentHeaderBytes;
    const auto number = [&](std::size_t i) {
        return i + 1 < rest.size() ? std::size_t{rest[i]} | std::size_t{rest[i + 1]} << 8 : 0;
    };
    return kHeadBytes + kWordBytes * (number(12) % 64) + number(16) % 1024;  // as mend() reads it
}

fuzz::Piece make_header(Random&) {
    using namespace store_records;
    std::vector<std::byte> header(kSegmentHeaderBytes);
    write_segment_header(std::span<std::byte, kSegmentHeaderBytes>(header.data(), kSegmentHeaderBytes), {1, 2, 3}, 1);
    const auto* const first = reinterpret_cast<const std::uint8_t*>(header.data());
    return {first, first + header.size()};
}

// A record of any kind, with words that rise and a body of any bytes.
fuzz::Piece make_record(Random& random) {
    using namespace store_records;
    RecordHead head;
    head.kind = static_cast<RecordKind>(1 + random.below(3));
    head.words = random.below(4) == 0 ? 0 : random.below(12);
    head.body_bytes = random.below(4) == 0 ? 0 : random.below(40);
    head.sequence = 1 + random.below(8);
    head.id = random.below(6);
    head.used = random.below(10);
    head.time_ns = random.below(1000);
    std::vector<std::byte> record(head.size());
    std::size_t at = kHeadBytes;
    std::uint32_t word = 0;
    for (std::uint32_t i = 0; i < head.words; ++i, at += kWordBytes) {
        const std::uint32_t weight = random.below(2000);
        for (std::size_t b = 0; b < 2; ++b) record[at + b] = static_cast<std::byte>(word >> (8 * b));
        for (std::size_t b = 0; b < 4; ++b) record[at + 2 + b] = static_cast<std::byte>(weight >> (8 * b));
        word += 1 + random.below(20);
    }
    for (; at < record.size(); ++at) record[at] = static_cast<std::byte>(random.below(256));
    const std::span<const std::byte> all(record);
    head.words_crc = crc32(all.subspan(kHeadBytes, kWordBytes * head.words));
    head.body_crc = crc32(all.subspan(kHeadBytes + kWordBytes * head.words));
    write_head(std::span<std::byte, kHeadBytes>(record.data(), kHeadBytes), head);
    const auto* const first = reinterpret_cast<const std::uint8_t*>(record.data());
    return {first, first + record.size()};
}

}  // namespace

STILLMESH_FUZZ_BY((stillmesh::fuzz::Grammar{piece_bytes, make_header, make_record}))
#endif

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size_bytes) {
    const auto* const first = reinterpret_cast<const std::byte*>(data);
    std::vector<std::byte> bytes(first, first + size_bytes);
    check_body(bytes);
    open(bytes);
    std::vector<std::byte> mended = bytes;
    mend(mended);
    if (mended != bytes) open(mended);
    return 0;
}
