#include "platform/store/region_store.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <map>
#include <span>
#include <sstream>

#include "platform/store/session_store.hpp"
#include "tests/store/store_rig.hpp"

namespace stillmesh::region_store_test {
namespace {

using test::MadeRegion;

// Opens, or fails the test.
void open(RegionStore& store, const RegionStoreOptions& options) {
    std::string message;
    ASSERT_TRUE(store.open(options, message)) << message;
}

std::string only_segment(const std::string& folder) {
    return folder + "/00000001.seg";
}

// Promise: what is kept is found by its words, byte for byte, in this opening and in the next.
TEST(RegionStore, KeepsAndFinds) {
    const test::TemporaryFolder folder;
    std::vector<MadeRegion> made;
    for (std::uint64_t id = 1; id <= 30; ++id) made.push_back(test::made_region(id, id));
    std::uint64_t checksum = 0;
    for (int round = 0; round < 2; ++round) {
        RegionStore store;
        open(store, test::options_in(folder.path() + "/store"));
        if (round == 0) {
            for (const MadeRegion& region : made) ASSERT_TRUE(store.keep(region.given()));
            checksum = store.checksum();
        }
        EXPECT_EQ(store.checksum(), checksum);
        EXPECT_EQ(store.content().regions, 30U);
        EXPECT_EQ(store.content().ids_end, 31U);
        EXPECT_EQ(store.content().time_ns, 30'000);
        EXPECT_EQ(store.find_fault(), "");
        std::vector<std::byte> body;
        for (const MadeRegion& region : made) {
            ASSERT_EQ(test::asked(store, region.words, body), region.region.id);
            EXPECT_EQ(body, region.body);
        }
    }
}

// Promise: any mixture of keeping, replacing, asking and using, over many openings and segments, answers as a plain map
// of regions does that is asked by brute force; regions_max holds, and those longest without use go.
TEST(RegionStore, AnswersAsAPlainMapDoes) {
    struct Kept {
        MadeRegion made;
        std::uint64_t used = 0;
    };
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
        const test::TemporaryFolder folder;
        RegionStoreOptions options = test::options_in(folder.path() + "/store");
        options.regions_max = 40;
        options.segment_bytes_max = 3000;
        std::map<std::uint64_t, Kept> model;
        Random random(seed);
        std::uint64_t clock = 0;
        auto store = std::make_unique<RegionStore>();
        open(*store, options);
        for (int step = 0; step < 1500; ++step) {
            const std::uint32_t what = random.below(100);
            if (what < 45) {
                const std::uint64_t id = 1 + random.below(90);
                const MadeRegion region = test::made_region(id, 1000 * seed + static_cast<std::uint64_t>(step));
                ASSERT_TRUE(store->keep(region.given()));
                if (model.count(id) == 0 && model.size() >= options.regions_max) {
                    const auto oldest = std::min_element(model.begin(), model.end(), [](const auto& a, const auto& b) {
                        return a.second.used < b.second.used;
                    });
                    model.erase(oldest);
                }
                model[id] = {region, ++clock};
            } else if (what < 55) {
                const std::uint64_t id = 1 + random.below(90);
                store->note_use(id);
                if (model.count(id) != 0) model[id].used = ++clock;
            } else if (what < 57) {
                store->close();
                store = std::make_unique<RegionStore>();
                open(*store, options);
            } else {
                const std::vector<WordWeight> words = test::made_words(12, 200, random);
                const std::uint64_t older = random.below(3) == 0 ? random.below(90) : ~std::uint64_t{0};
                std::vector<std::uint64_t> without;
                while (random.below(3) != 0) without.push_back(1 + random.below(90));
                const std::uint32_t score_min = 1 + random.below(kBagWeightOne / 16);
                std::uint64_t best = 0;
                std::uint32_t best_score = 0;
                for (const auto& [id, kept] : model) {
                    const std::uint32_t score = bag_score(words, kept.made.words);
                    if (score < score_min || id >= older || score <= best_score) continue;
                    if (std::find(without.begin(), without.end(), id) != without.end()) continue;
                    best = id;
                    best_score = score;
                }
                std::vector<std::byte> body;
                ASSERT_EQ(test::asked(*store, words, body, score_min, without, older), best) << seed << " " << step;
                if (best != 0) {
                    ASSERT_EQ(body, model[best].made.body);
                }
            }
            ASSERT_EQ(store->content().regions, model.size());
            if (step % 50 == 0) {
                ASSERT_EQ(store->find_fault(), "");
            }
        }
        EXPECT_GT(store->counts().segments, 1U);
        EXPECT_GT(store->counts().forgotten, 0U);
        // What is of no use is given back to the disk.
        std::uint64_t alive = 0;
        for (const auto& [id, kept] : model) alive += kept.made.body.size() + 6 * kept.made.words.size() + 88;
        EXPECT_LT(store->counts().bytes, 3 * alive + 4 * options.segment_bytes_max);
    }
}

// Promise: a region of a place that is there and looks alike is not written; one that looks otherwise, or from
// elsewhere, is.
TEST(RegionStore, APlaceIsKeptOnce) {
    const test::TemporaryFolder folder;
    RegionStore store;
    open(store, test::options_in(folder.path() + "/store"));
    const MadeRegion first = test::made_region(1, 1);
    ASSERT_TRUE(store.keep(first.given()));
    MadeRegion again = first;
    again.region.id = 2;
    again.region.alike_score = 1000;
    again.region.position_m[0] += 0.1F;
    ASSERT_TRUE(store.keep(again.given()));
    EXPECT_EQ(store.counts().known, 1U);
    EXPECT_EQ(store.content().regions, 1U);
    MadeRegion elsewhere = again;
    elsewhere.region.id = 3;
    elsewhere.region.position_m[0] += 1.0F;
    ASSERT_TRUE(store.keep(elsewhere.given()));
    MadeRegion other_look = again;
    other_look.region.id = 4;
    for (WordWeight& word : other_look.words) word.word = static_cast<std::uint16_t>(word.word + 1000);
    ASSERT_TRUE(store.keep(other_look.given()));
    MadeRegion turned = again;
    turned.region.id = 5;
    turned.region.axis[2] = 0;
    turned.region.axis[0] = 1;
    ASSERT_TRUE(store.keep(turned.given()));
    EXPECT_EQ(store.content().regions, 4U);
}

// Promise: cut off at any byte, a store opens, says what it cut, and holds every region that was whole; what is
// written then is there at the next opening.
TEST(RegionStore, TruncatedAtAnyByte) {
    const test::TemporaryFolder folder;
    std::vector<MadeRegion> made;
    std::vector<std::size_t> ends;
    {
        RegionStore store;
        open(store, test::options_in(folder.path() + "/whole"));
        for (std::uint64_t id = 1; id <= 4; ++id) {
            made.push_back(test::made_region(id, id));
            made.back().body.resize(60);
            ASSERT_TRUE(store.keep(made.back().given()));
            ends.push_back(store.counts().bytes);
        }
    }
    const std::vector<std::byte> whole = test::bytes_of_file(only_segment(folder.path() + "/whole"));
    ASSERT_EQ(whole.size(), ends.back());
    for (std::size_t size = 0; size <= whole.size(); ++size) {
        const std::string place = folder.path() + "/cut";
        std::filesystem::remove_all(place);
        std::filesystem::create_directory(place);
        test::write_file(only_segment(place), {whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)});
        std::uint64_t wanted = 0;
        while (wanted < ends.size() && ends[wanted] <= size) ++wanted;
        for (int round = 0; round < 2; ++round) {
            RegionStore store;
            std::string message;
            ASSERT_TRUE(store.open(test::options_in(place), message)) << size << message;
            const std::size_t end = wanted == 0 ? 64 : ends[wanted - 1];
            ASSERT_EQ(store.counts().cut_bytes, round == 0 && size > end ? size - end : 0U) << size;
            ASSERT_EQ(message.empty(), store.counts().cut_bytes == 0);
            ASSERT_EQ(store.content().regions, wanted + static_cast<std::uint64_t>(round));
            std::vector<std::byte> body;
            for (std::uint64_t i = 0; i < wanted; ++i) {
                ASSERT_EQ(test::asked(store, made[i].words, body), i + 1);
                ASSERT_EQ(body, made[i].body);
            }
            if (round == 0) {
                ASSERT_TRUE(store.keep(test::made_region(100, 100).given()));
            }
        }
    }
}

// Promise: with any byte flipped a store is refused with a sentence, or opens without what that byte was of, says so,
// and holds everything else; a body that is damaged is never given out.
TEST(RegionStore, AnyByteFlipped) {
    const test::TemporaryFolder folder;
    std::vector<MadeRegion> made;
    {
        RegionStoreOptions options = test::options_in(folder.path() + "/whole");
        RegionStore store;
        open(store, options);
        for (std::uint64_t id = 1; id <= 3; ++id) {
            made.push_back(test::made_region(id, id));
            made.back().body.resize(40);
            ASSERT_TRUE(store.keep(made.back().given()));
        }
    }
    const std::vector<std::byte> whole = test::bytes_of_file(only_segment(folder.path() + "/whole"));
    for (const bool is_last : {true, false}) {
        for (std::size_t at = 0; at < whole.size(); at += is_last || at < 64 ? 1 : 3) {
            const std::string place = folder.path() + "/flipped";
            std::filesystem::remove_all(place);
            std::filesystem::create_directory(place);
            std::vector<std::byte> bytes = whole;
            bytes[at] ^= static_cast<std::byte>(1U << (at % 8));
            test::write_file(only_segment(place), bytes);
            if (!is_last) {  // bodies of earlier segments are looked at when they are asked for
                std::vector<std::byte> header(64);
                store_records::write_segment_header(std::span<std::byte, 64>(header), {1, 2, 3}, 2);
                test::write_file(place + "/00000002.seg", header);
            }
            RegionStore store;
            std::string message;
            if (!store.open(test::options_in(place), message)) {
                ASSERT_LT(at, 64U);
                ASSERT_FALSE(message.empty());
                ASSERT_EQ(test::bytes_of_file(only_segment(place)), bytes);  // nothing was changed
                continue;
            }
            ASSERT_GE(at, 64U);
            std::uint64_t there = 0;
            std::vector<std::byte> body;
            for (const MadeRegion& region : made) {
                const std::uint64_t id = test::asked(store, region.words, body);
                if (id != region.region.id) continue;
                ++there;
                ASSERT_EQ(body, region.body);
            }
            ASSERT_EQ(there, 2U) << at;
            ASSERT_EQ(store.counts().damaged + (store.counts().cut_bytes > 0 ? 1U : 0U), 1U) << at;
            ASSERT_EQ(store.find_fault(), "");
        }
    }
}

// Promise: the index is made anew when most of it is of what has gone; what cannot be read by then goes, is counted,
// and everything else is found as before.
TEST(RegionStore, IndexIsMadeAnew) {
    constexpr std::uint64_t kDamaged = 2;
    const test::TemporaryFolder folder;
    const std::string place = folder.path() + "/store";
    RegionStore store;
    open(store, test::options_in(place));
    std::vector<MadeRegion> made;
    std::size_t damaged_at = 64;  // the segment's header; then the words of record kDamaged, behind its head
    for (std::uint64_t id = 1; id <= 5; ++id) {
        made.push_back(test::made_region(id, id));
        const MadeRegion& region = made.back();
        ASSERT_TRUE(store.keep(region.given()));
        if (id < kDamaged) damaged_at += store_records::kHeadBytes + 6 * region.words.size() + region.body.size();
    }
    damaged_at += store_records::kHeadBytes + 3;
    {
        std::fstream file(only_segment(place), std::ios::binary | std::ios::in | std::ios::out);
        file.seekg(static_cast<std::streamoff>(damaged_at));
        const int byte = file.get();
        file.seekp(static_cast<std::streamoff>(damaged_at));
        file.put(static_cast<char>(byte ^ 1));
    }
    for (std::uint64_t again = 0; again < 9000; ++again) {
        made[4] = test::made_region(5, 100 + again);
        made[4].body.resize(8);
        ASSERT_TRUE(store.keep(made[4].given()));
        const std::uint64_t regions = store.counts().regions;  // until then nobody has seen the damage
        ASSERT_TRUE(regions == 5U || (regions == 4U && again > 4000)) << again;
    }
    EXPECT_EQ(store.counts().regions, 4U);
    EXPECT_EQ(store.counts().damaged, 1U);
    EXPECT_EQ(store.find_fault(), "");
    std::vector<std::byte> body;
    for (const MadeRegion& region : made) {
        const std::uint64_t found = test::asked(store, region.words, body);
        if (region.region.id == kDamaged) {
            EXPECT_NE(found, kDamaged);
        } else {
            EXPECT_EQ(found, region.region.id);
            EXPECT_EQ(body, region.body);
        }
    }
}

// Promise: a kill -9 at any moment, a hundred times: the store opens, nothing that was there before is missing or
// changed, and of what was being written all but the last record is there.
TEST(RegionStore, KilledAHundredTimes) {
    const test::TemporaryFolder folder;
    RegionStoreOptions options = test::options_in(folder.path() + "/store");
    options.segment_bytes_max = 20'000;
    options.regions_max = 1'000'000;
    std::uint64_t last = 0;
    for (std::uint32_t kill_number = 0; kill_number < 100; ++kill_number) {
        int pipe_ends[2];
        ASSERT_EQ(::pipe(pipe_ends), 0);
        const pid_t child = ::fork();
        ASSERT_GE(child, 0);
        if (child == 0) {
            RegionStore store;
            std::string message;
            if (!store.open(options, message)) ::_exit(1);
            for (std::uint64_t id = last + 1;; ++id) {
                if (!store.keep(test::made_region(id, id, 50'000).given())) ::_exit(2);
                if (::write(pipe_ends[1], &id, sizeof(id)) != sizeof(id)) ::_exit(3);
                ::usleep(20);
            }
        }
        ::close(pipe_ends[1]);
        std::uint64_t said = last;
        std::uint64_t id = 0;
        const std::uint64_t stop = last + 1 + kill_number % 7;
        while (said < stop && ::read(pipe_ends[0], &id, sizeof(id)) == sizeof(id)) said = id;
        ::usleep(kill_number * 37 % 400);
        ::kill(child, SIGKILL);
        while (::read(pipe_ends[0], &id, sizeof(id)) == sizeof(id)) said = id;
        int status = 0;
        ASSERT_EQ(::waitpid(child, &status, 0), child);
        ASSERT_TRUE(WIFSIGNALED(status));
        ::close(pipe_ends[0]);
        ASSERT_GE(said, stop);
        RegionStore store;
        open(store, options);
        const StoreContent content = store.content();
        ASSERT_GE(content.ids_end, said + 1);
        ASSERT_LE(content.ids_end, said + 2);
        ASSERT_EQ(content.regions, content.ids_end - 1);
        ASSERT_EQ(store.counts().damaged, 0U);
        std::vector<std::byte> body;
        for (std::uint64_t i = std::max<std::uint64_t>(1, last); i < content.ids_end; ++i) {
            const MadeRegion region = test::made_region(i, i, 50'000);
            ASSERT_EQ(test::asked(store, region.words, body, kBagWeightOne / 64), i);
            ASSERT_EQ(body, region.body);
        }
        last = content.ids_end - 1;
    }
}

// Promise: the power fails while a segment is begun, its header lost (zeros of any length): the store opens with all
// that was there before, and takes more.
TEST(RegionStore, ASegmentThatWasNeverBegun) {
    for (const std::size_t size : {0U, 1U, 63U, 64U}) {
        const test::TemporaryFolder folder;
        const RegionStoreOptions options = test::options_in(folder.path() + "/store");
        {
            RegionStore store;
            open(store, options);
            ASSERT_TRUE(store.keep(test::made_region(1, 1, 50'000).given()));
        }
        std::ofstream(options.folder + "/00000002.seg", std::ios::binary) << std::string(size, '\0');
        {
            RegionStore store;
            open(store, options);
            EXPECT_EQ(store.counts().regions, 1U);
            ASSERT_TRUE(store.keep(test::made_region(2, 2, 50'000).given()));
        }
        RegionStore store;
        open(store, options);
        EXPECT_EQ(store.counts().regions, 2U) << size;
        EXPECT_EQ(store.counts().damaged, 0U);
    }
}

// Promise: killed while its index had a name for a moment (file systems without files that have none), a folder is a
// store all the same, and the next opening takes the file away; a folder of other files keeps them.
TEST(RegionStore, TakesAwayWhatAnIndexLeft) {
    const test::TemporaryFolder folder;
    const RegionStoreOptions options = test::options_in(folder.path() + "/store");
    const std::string left = options.folder + "/stillmesh-index.a1B2c3";
    std::filesystem::create_directory(options.folder);
    for (const std::uint64_t regions : {0U, 1U}) {
        test::write_file(left, {});
        RegionStore store;
        open(store, options);
        EXPECT_EQ(store.counts().regions, regions);
        EXPECT_FALSE(std::filesystem::exists(left));
        ASSERT_TRUE(store.keep(test::made_region(regions + 1, regions + 1).given()));
    }
    test::write_file(folder.path() + "/stillmesh-index.a1B2c3", {});
    RegionStore store;
    std::string message;
    EXPECT_FALSE(store.open(test::options_in(folder.path()), message));
    EXPECT_TRUE(std::filesystem::exists(folder.path() + "/stillmesh-index.a1B2c3"));
}

// Promise: what is no store, another's store, or a store in use is refused with one sentence that names it, and nothing
// is changed.
TEST(RegionStore, RefusesWithASentence) {
    const test::TemporaryFolder folder;
    const auto refusal = [](const RegionStoreOptions& options) {
        RegionStore store;
        std::string message;
        EXPECT_FALSE(store.open(options, message));
        EXPECT_EQ(message.find(options.folder), 0U) << message;
        return message;
    };
    const std::string place = folder.path() + "/store";
    test::write_file(folder.path() + "/file", {});
    EXPECT_NE(refusal(test::options_in(folder.path() + "/file")).find("no folder"), std::string::npos);
    EXPECT_NE(refusal(test::options_in(folder.path() + "/no/where")).find("cannot be made"), std::string::npos);
    EXPECT_NE(refusal(test::options_in(folder.path())).find("other files"), std::string::npos);
    EXPECT_FALSE(std::filesystem::exists(folder.path() + "/lock"));
    if (::geteuid() != 0) {
        std::filesystem::create_directory(folder.path() + "/closed");
        std::filesystem::permissions(folder.path() + "/closed", std::filesystem::perms::none);
        EXPECT_NE(refusal(test::options_in(folder.path() + "/closed")).find("Permission"), std::string::npos);
    }
    RegionStoreOptions options = test::options_in(place);
    RegionStore first;
    open(first, options);
    ASSERT_TRUE(first.keep(test::made_region(1, 1).given()));
    EXPECT_NE(refusal(options).find("another program"), std::string::npos);
    first.close();
    const std::vector<std::byte> before = test::bytes_of_file(only_segment(place));
    options.origin.camera_crc = 9;
    EXPECT_NE(refusal(options).find("camera"), std::string::npos);
    options.origin = {9, 2, 3};
    EXPECT_NE(refusal(options).find("vocabulary"), std::string::npos);
    options.origin = {1, 2, 9};
    EXPECT_NE(refusal(options).find("features"), std::string::npos);
    std::vector<std::byte> other_version = before;
    other_version[8] = std::byte{2};
    test::write_file(only_segment(place), other_version);
    EXPECT_NE(refusal(test::options_in(place)).find("version 2"), std::string::npos);
    EXPECT_EQ(test::bytes_of_file(only_segment(place)), other_version);
}

// Promise: a store is of one camera, whatever sign its zeros have; any other number makes another store.
TEST(RegionStore, IsOfOneCamera) {
    const auto origin_of = [](double k2, double k4) {
        CameraModel camera{640, 480, 525, 525, 319.5, 239.5};
        camera.lens = Lens::kFisheye;
        camera.k2 = k2;
        camera.k4 = k4;
        return store_options("", {}, camera, 0, 1).origin;
    };
    EXPECT_EQ(origin_of(-0.0, 0), origin_of(0, 0));
    EXPECT_EQ(origin_of(0, -0.0), origin_of(0, 0));
    EXPECT_FALSE(origin_of(1e-9, 0) == origin_of(0, 0));
    EXPECT_FALSE(origin_of(0, 1e-9) == origin_of(0, 0));
}

// Promise: a store whose numbers have come to their end says so and keeps what it has, in the next opening too; a
// record whose number is beyond it is damaged. (By 2^64 - 2 a region was kept under a number that no reader took.)
TEST(RegionStore, NumbersHaveAnEnd) {
    using namespace store_records;
    for (const std::uint64_t last : {kNumberMax - 1, kNumberMax, kNumberMax + 1}) {
        const test::TemporaryFolder folder;
        const RegionStoreOptions options = test::options_in(folder.path() + "/store");
        {
            RegionStore store;
            open(store, options);
            ASSERT_TRUE(store.keep(test::made_region(1, 1).given()));
        }
        std::vector<std::byte> bytes = test::bytes_of_file(only_segment(options.folder));
        const auto at = std::span(bytes).subspan(kSegmentHeaderBytes).first<kHeadBytes>();
        RecordHead head;
        ASSERT_TRUE(read_head(at, head));
        head.sequence = head.used = last;
        write_head(at, head);
        test::write_file(only_segment(options.folder), bytes);
        std::uint64_t kept = last > kNumberMax ? 0 : 1;
        for (int round = 0; round < 2; ++round) {
            RegionStore store;
            open(store, options);
            EXPECT_EQ(store.content().regions, kept) << last << ", round " << round;
            if (round > 0) break;
            if (last == kNumberMax) {
                EXPECT_FALSE(store.keep(test::made_region(2, 2).given()));
                EXPECT_NE(store.problem().find("no number left"), std::string::npos) << store.problem();
            } else {
                EXPECT_TRUE(store.keep(test::made_region(2, 2).given()));
                ++kept;
            }
        }
    }
}

// Promise: the example in docs/SPEC-map-store.md is what is written, byte for byte.
TEST(RegionStore, SpecIsTrue) {
    std::ifstream page(STILLMESH_SPEC);
    ASSERT_TRUE(page.is_open());
    std::vector<std::byte> wanted;
    for (std::string line; std::getline(page, line);) {
        unsigned at = 0;
        if (line.size() < 8 || std::sscanf(line.c_str(), "%4x  ", &at) != 1 || at != wanted.size()) continue;
        if (line[4] != ' ' || line[5] != ' ') continue;
        std::istringstream numbers(line.substr(6));
        for (unsigned byte = 0; numbers >> std::hex >> byte;) wanted.push_back(static_cast<std::byte>(byte));
    }
    ASSERT_EQ(wanted.size(), 168U);
    const test::TemporaryFolder folder;
    RegionStore store;
    open(store, test::options_in(folder.path() + "/store"));
    const std::vector<WordWeight> words = {{5, 7}, {1000, 300}};
    const std::vector<std::byte> body = {std::byte{'b'}, std::byte{'o'}, std::byte{'d'}, std::byte{'y'}};
    LeavingRegion region;
    region.id = 42;
    region.time_ns = 42'000;
    region.position_m[0] = 1;
    region.position_m[1] = 2;
    region.position_m[2] = 3;
    region.axis[2] = 1;
    region.words = words;
    region.body = body;
    ASSERT_TRUE(store.keep(region));
    store.close();
    EXPECT_EQ(test::bytes_of_file(only_segment(folder.path() + "/store")), wanted);
}

// Promise: in scratch a store answers and takes regions as ever, and not a byte of the folder changes; as of an earlier
// record it is what it was then.
TEST(RegionStore, ScratchLeavesNoTrace) {
    const test::TemporaryFolder folder;
    RegionStoreOptions options = test::options_in(folder.path() + "/store");
    std::uint64_t checksum_then = 0;
    std::uint64_t sequence_then = 0;
    {
        RegionStore store;
        open(store, options);
        for (std::uint64_t id = 1; id <= 10; ++id) ASSERT_TRUE(store.keep(test::made_region(id, id).given()));
        checksum_then = store.checksum();
        sequence_then = store.sequence();
        for (std::uint64_t id = 6; id <= 15; ++id) ASSERT_TRUE(store.keep(test::made_region(id, 100 + id).given()));
    }
    const std::vector<std::byte> before = test::bytes_of_file(only_segment(options.folder));
    options.is_scratch = true;
    options.sequence_max = sequence_then;
    RegionStore store;
    open(store, options);
    EXPECT_EQ(store.checksum(), checksum_then);
    EXPECT_EQ(store.content().regions, 10U);
    const MadeRegion added = test::made_region(77, 77);
    ASSERT_TRUE(store.keep(added.given()));
    std::vector<std::byte> body;
    EXPECT_EQ(test::asked(store, added.words, body), 77U);
    EXPECT_EQ(body, added.body);
    store.close();
    EXPECT_EQ(test::bytes_of_file(only_segment(options.folder)), before);
    std::size_t files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(options.folder)) {
        static_cast<void>(entry);
        ++files;
    }
    EXPECT_EQ(files, 2U);  // the segment and the lock
}

}  // namespace
}  // namespace stillmesh::region_store_test
