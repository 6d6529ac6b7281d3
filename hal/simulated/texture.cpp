#include "hal/simulated/texture.hpp"

#include <algorithm>

#include "engine/base/random.hpp"

namespace stillmesh::simulated {
namespace {

class Painting {
public:
    Painting(std::int32_t width, std::int32_t height, std::uint64_t seed)
        : random(seed), width_(width), height_(height), pixels_(static_cast<std::size_t>(width * height)) {}

    Random random;

    [[nodiscard]] std::int32_t width() const { return width_; }
    [[nodiscard]] std::int32_t height() const { return height_; }
    [[nodiscard]] std::int32_t in(std::int32_t low, std::int32_t high) {  // [low, high]
        return low + static_cast<std::int32_t>(random.below(static_cast<std::uint32_t>(high - low + 1)));
    }
    [[nodiscard]] bool chance(double p) { return random.uniform() < p; }

    void put(std::int32_t x, std::int32_t y, std::int32_t grey) {
        if (x < 0 || y < 0 || x >= width_ || y >= height_) return;
        at(x, y) = clamp_grey(grey);
    }
    void fill(std::int32_t grey) { std::fill(pixels_.begin(), pixels_.end(), clamp_grey(grey)); }
    void rectangle(std::int32_t x0, std::int32_t y0, std::int32_t w, std::int32_t h, std::int32_t grey) {
        const std::int32_t x1 = std::min(x0 + w, width_);
        const std::int32_t y1 = std::min(y0 + h, height_);
        for (std::int32_t y = std::max(y0, 0); y < y1; ++y) {
            for (std::int32_t x = std::max(x0, 0); x < x1; ++x) at(x, y) = clamp_grey(grey);
        }
    }
    void frame(std::int32_t x, std::int32_t y, std::int32_t w, std::int32_t h, std::int32_t line, std::int32_t grey) {
        rectangle(x, y, w, line, grey);
        rectangle(x, y + h - line, w, line, grey);
        rectangle(x, y, line, h, grey);
        rectangle(x + w - line, y, line, h, grey);
    }
    void disc(std::int32_t cx, std::int32_t cy, std::int32_t radius, std::int32_t grey) {
        for (std::int32_t y = -radius; y <= radius; ++y) {
            for (std::int32_t x = -radius; x <= radius; ++x) {
                if (x * x + y * y <= radius * radius) put(cx + x, cy + y, grey);
            }
        }
    }
    void triangle(std::int32_t cx, std::int32_t cy, std::int32_t size, std::int32_t grey) {
        std::int32_t px[3];
        std::int32_t py[3];
        for (int i = 0; i < 3; ++i) {
            px[i] = cx + in(-size, size);
            py[i] = cy + in(-size, size);
        }
        const auto side = [&](int i, int j, std::int32_t x, std::int32_t y) {
            return (px[j] - px[i]) * (y - py[i]) - (py[j] - py[i]) * (x - px[i]);
        };
        for (std::int32_t y = cy - size; y <= cy + size; ++y) {
            for (std::int32_t x = cx - size; x <= cx + size; ++x) {
                const bool a = side(0, 1, x, y) >= 0;
                const bool b = side(1, 2, x, y) >= 0;
                const bool c = side(2, 0, x, y) >= 0;
                if (a == b && b == c) put(x, y, grey);
            }
        }
    }
    // Letters of 3 x 5 dots, `dot` texels each, in lines with words and gaps.
    void print(std::int32_t x0, std::int32_t y0, std::int32_t w, std::int32_t h, std::int32_t dot, std::int32_t grey) {
        for (std::int32_t y = y0; y + 5 * dot <= y0 + h; y += 8 * dot) {
            const std::int32_t line_end = x0 + w - (chance(0.3) ? in(0, w / 2) : 0);
            for (std::int32_t x = x0; x + 3 * dot <= line_end; x += 4 * dot) {
                if (chance(0.16)) continue;
                const std::uint64_t letter = random.next();
                for (std::int32_t i = 0; i < 15; ++i) {
                    if ((letter >> i & 1) != 0) rectangle(x + (i % 3) * dot, y + (i / 3) * dot, dot, dot, grey);
                }
            }
        }
    }
    // Value noise on a lattice of cells of `cell_x` x `cell_y` texels (powers of two), wrapping, up to +-amplitude.
    void noise(std::int32_t cell_x, std::int32_t cell_y, std::int32_t amplitude) {
        const std::int32_t nx = std::max(width_ / cell_x, 1);
        const std::int32_t ny = std::max(height_ / cell_y, 1);
        std::vector<std::int32_t> lattice(static_cast<std::size_t>(nx * ny));
        for (std::int32_t& value : lattice) value = in(-amplitude * 16, amplitude * 16);
        for (std::int32_t y = 0; y < height_; ++y) {
            const std::int32_t iy = y / cell_y;
            const std::int32_t fy = y % cell_y;
            const std::int32_t* r0 = lattice.data() + iy % ny * nx;
            const std::int32_t* r1 = lattice.data() + (iy + 1) % ny * nx;
            for (std::int32_t x = 0; x < width_; ++x) {
                const std::int32_t ix = x / cell_x % nx;
                const std::int32_t jx = (ix + 1) % nx;
                const std::int32_t fx = x % cell_x;
                const std::int32_t top = r0[ix] * (cell_x - fx) + r0[jx] * fx;
                const std::int32_t bottom = r1[ix] * (cell_x - fx) + r1[jx] * fx;
                const std::int32_t value = (top * (cell_y - fy) + bottom * fy) / (cell_x * cell_y * 16);
                at(x, y) = clamp_grey(at(x, y) + value);
            }
        }
    }
    void shapes(std::int32_t x0, std::int32_t y0, std::int32_t w, std::int32_t h, std::int32_t count,
                std::int32_t size_min, std::int32_t size_max, std::int32_t dark, std::int32_t bright) {
        for (std::int32_t i = 0; i < count; ++i) {
            const std::int32_t x = x0 + in(0, w);
            const std::int32_t y = y0 + in(0, h);
            const std::int32_t size = in(size_min, size_max);
            const std::int32_t grey = in(dark, bright);
            switch (in(0, 3)) {
                case 0: disc(x, y, size / 2, grey); break;
                case 1: triangle(x, y, size, grey); break;
                case 2: rectangle(x - size / 2, y - size / 3, size, size * 2 / 3, grey); break;
                default: frame(x - size / 2, y - size / 2, size, size, std::max(size / 8, 2), grey); break;
            }
        }
    }

    // Print fades: all greys move towards 128, to `percent` of their distance.
    void fade(std::int32_t percent) {
        for (std::uint8_t& grey : pixels_) grey = clamp_grey(128 + (grey - 128) * percent / 100);
    }

    [[nodiscard]] Texture finish() {
        Texture texture;
        std::size_t total = 0;
        std::uint32_t count = 0;
        for (std::int32_t w = width_, h = height_; w >= 1 && h >= 1 && count < kMipLevelsMax; w /= 2, h /= 2, ++count) {
            total += static_cast<std::size_t>(w * h);
        }
        texture.pixels.resize(total);
        std::copy(pixels_.begin(), pixels_.end(), texture.pixels.begin());
        texture.level_count = count;
        texture.width = static_cast<float>(width_);
        texture.height = static_cast<float>(height_);
        std::size_t begin = 0;
        std::int32_t w = width_;
        std::int32_t h = height_;
        float scale = 1.0F;
        for (std::uint32_t l = 0; l < count; ++l) {
            texture.levels[l] = {texture.pixels.data() + begin, w, w - 1, h - 1, scale};
            if (l + 1 < count) {
                const std::uint8_t* from = texture.pixels.data() + begin;
                std::uint8_t* to = texture.pixels.data() + begin + static_cast<std::size_t>(w * h);
                for (std::int32_t y = 0; y < h / 2; ++y) {
                    for (std::int32_t x = 0; x < w / 2; ++x) {
                        const std::uint8_t* p = from + 2 * y * w + 2 * x;
                        to[y * (w / 2) + x] = static_cast<std::uint8_t>((p[0] + p[1] + p[w] + p[w + 1] + 2) / 4);
                    }
                }
            }
            begin += static_cast<std::size_t>(w * h);
            w /= 2;
            h /= 2;
            scale *= 0.5F;
        }
        return texture;
    }

private:
    [[nodiscard]] static std::uint8_t clamp_grey(std::int32_t grey) {
        return static_cast<std::uint8_t>(std::clamp(grey, 0, 255));
    }
    [[nodiscard]] std::uint8_t& at(std::int32_t x, std::int32_t y) {
        return pixels_[static_cast<std::size_t>(std::ptrdiff_t{y} * width_ + x)];
    }

    std::int32_t width_;
    std::int32_t height_;
    std::vector<std::uint8_t> pixels_;
};

Texture plain_wall(std::uint64_t seed) {
    Painting c(512, 512, seed);
    c.fill(c.in(165, 195));
    c.noise(128, 128, 5);
    c.noise(4, 4, 2);
    return c.finish();
}

Texture carpet(std::uint64_t seed) {
    Painting c(512, 512, seed);
    c.fill(c.in(70, 100));
    c.noise(128, 128, 8);
    c.noise(16, 16, 9);
    c.noise(4, 4, 14);
    for (std::int32_t i = 0; i < 500; ++i) {
        const std::int32_t x = c.in(0, 511);
        const std::int32_t y = c.in(0, 511);
        const std::int32_t w = c.in(2, 7);
        const std::int32_t h = c.in(2, 7);
        c.rectangle(x, y, w, h, c.in(45, 150));
    }
    return c.finish();
}

Texture ceiling(std::uint64_t seed) {
    Painting c(256, 256, seed);
    c.fill(205);
    c.noise(2, 2, 7);
    c.frame(0, 0, 256, 256, 3, 130);
    return c.finish();
}

Texture wood(std::uint64_t seed) {
    Painting c(512, 512, seed);
    c.fill(c.in(120, 165));
    c.noise(256, 16, 20);
    c.noise(128, 4, 16);
    c.noise(64, 2, 10);
    for (std::int32_t i = 0; i < 14; ++i) {  // knots
        const std::int32_t x = c.in(0, 511);
        const std::int32_t y = c.in(0, 511);
        const std::int32_t r = c.in(3, 8);
        c.disc(x, y, r, 85);
        c.disc(x, y, r / 2, 60);
    }
    return c.finish();
}

Texture poster(std::uint64_t seed) {
    Painting c(512, 512, seed);
    const std::int32_t ground = c.in(60, 220);
    c.fill(ground);
    c.noise(128, 128, 35);
    c.shapes(20, 20, 470, 300, c.in(8, 16), 50, 140, 20, 240);
    c.shapes(20, 20, 470, 300, c.in(25, 50), 12, 50, 10, 245);
    const std::int32_t text = ground > 128 ? 35 : 225;
    const std::int32_t top = c.in(330, 380);
    c.rectangle(20, top - 6, 472, 512 - top - 14, ground);
    c.print(30, top, 450, 50, 6, text);
    c.print(30, top + 52, 450, 500 - top - 60, 3, text);
    c.frame(0, 0, 512, 512, 10, c.chance(0.5) ? 30 : 235);
    c.fade(c.in(55, 85));
    return c.finish();
}

Texture pinboard(std::uint64_t seed) {
    Painting c(512, 512, seed);
    c.fill(120);
    c.noise(4, 4, 16);
    for (std::int32_t i = 0; i < 26; ++i) {
        const std::int32_t w = c.in(50, 150);
        const std::int32_t h = c.in(50, 150);
        const std::int32_t x = c.in(0, 512 - w);
        const std::int32_t y = c.in(0, 512 - h);
        const std::int32_t paper = c.in(140, 240);
        c.rectangle(x + 3, y + 3, w, h, 60);
        c.rectangle(x, y, w, h, paper);
        if (c.chance(0.7)) {
            c.print(x + 6, y + 10, w - 12, h - 14, c.in(2, 4), 50);
        } else {
            c.shapes(x + 15, y + 15, w - 30, h - 30, 6, 10, 28, 20, 130);
        }
        c.disc(x + w / 2, y + 5, 4, 20);
    }
    c.fade(75);
    return c.finish();
}

Texture books(std::uint64_t seed) {
    Painting c(512, 128, seed);
    c.fill(25);
    std::int32_t x = 0;
    while (x < 512) {
        const std::int32_t w = c.in(9, 30);
        const std::int32_t h = c.in(80, 122);
        if (c.chance(0.06)) {  // a gap
            x += w;
            continue;
        }
        const std::int32_t grey = c.in(40, 215);
        c.rectangle(x, 128 - h, w - 1, h, grey);
        const std::int32_t mark = grey > 120 ? c.in(15, 60) : c.in(190, 245);
        const std::int32_t bands = c.in(0, 2);
        for (std::int32_t i = 0; i < bands; ++i) {
            const std::int32_t y = 128 - h + c.in(4, h - 10);
            c.rectangle(x, y, w - 1, c.in(2, 6), mark);
        }
        if (w >= 12) {
            const std::int32_t dot = w >= 22 ? 3 : 2;
            const std::int32_t y = 128 - h + c.in(8, 30);
            c.print(x + 2, y, w - 4, c.in(24, 60), dot, mark);
        }
        x += w;
    }
    c.noise(2, 2, 5);
    c.fade(70);
    return c.finish();
}

Texture keyboard(std::uint64_t seed) {
    Painting c(256, 128, seed);
    c.fill(40);
    for (std::int32_t row = 0; row < 6; ++row) {
        std::int32_t x = 6;
        while (x < 240) {
            const std::int32_t w = row == 5 && x > 60 && x < 80 ? 90 : c.in(12, 18);
            c.rectangle(x, 6 + row * 20, w, 16, 175);
            c.print(x + 3, 9 + row * 20, 8, 10, 2, 30);
            x += w + 3;
        }
    }
    return c.finish();
}

Texture screen(std::uint64_t seed) {
    Painting c(256, 256, seed);
    c.fill(c.in(50, 90));
    c.shapes(0, 0, 256, 256, 8, 20, 90, 30, 120);
    const std::int32_t windows = c.in(2, 4);
    for (std::int32_t i = 0; i < windows; ++i) {
        const std::int32_t w = c.in(80, 170);
        const std::int32_t h = c.in(80, 170);
        const std::int32_t x = c.in(0, 256 - w);
        const std::int32_t y = c.in(0, 256 - h);
        const bool is_dark = c.chance(0.5);
        c.rectangle(x, y, w, h, is_dark ? 30 : 220);
        c.rectangle(x, y, w, 10, 130);
        c.print(x + 5, y + 16, w - 10, h - 20, c.in(1, 2), is_dark ? 200 : 40);
    }
    return c.finish();
}

Texture paper(std::uint64_t seed) {
    Painting c(128, 256, seed);
    c.fill(225);
    c.print(10, 14, 108, 36, 4, 40);
    c.print(10, 60, 108, c.in(60, 180), 2, 60);
    if (c.chance(0.6)) {
        c.frame(12, 150, 104, 90, 3, 60);
        c.shapes(20, 160, 80, 70, 7, 10, 34, 30, 170);
    }
    return c.finish();
}

Texture metal(std::uint64_t seed) {
    Painting c(256, 256, seed);
    c.fill(c.in(110, 160));
    c.noise(128, 2, 5);
    for (std::int32_t y = 0; y < 256; y += 64) {
        c.frame(2, y + 2, 252, 60, 3, 70);
        c.rectangle(104, y + 14, 48, 8, 40);
        c.rectangle(24, y + 12, 50, 18, 225);
        c.print(28, y + 15, 44, 12, 2, 50);
        if (c.chance(0.5)) {
            const std::int32_t x = c.in(190, 230);
            const std::int32_t radius = c.in(8, 16);
            c.disc(x, y + 34, radius, c.in(40, 230));
        }
    }
    return c.finish();
}

Texture door(std::uint64_t seed) {
    Painting c(256, 512, seed);
    c.fill(c.in(90, 150));
    c.noise(4, 128, 8);
    c.frame(0, 0, 256, 512, 10, 55);
    c.frame(40, 40, 176, 170, 5, 70);
    c.frame(40, 270, 176, 190, 5, 70);
    c.rectangle(216, 250, 26, 10, 30);
    c.rectangle(90, 90, 80, 60, 225);
    c.print(98, 98, 66, 46, 3, 40);
    return c.finish();
}

Texture cloth(std::uint64_t seed) {
    Painting c(256, 256, seed);
    const std::int32_t dark = c.in(15, 60);
    const std::int32_t bright = c.in(185, 240);
    const std::int32_t ground = c.in(70, 150);
    c.fill(ground);
    switch (c.in(0, 3)) {
        case 0:  // tartan: stripes of several widths both ways, no two periods alike
            for (std::int32_t y = 0; y < 256; y += c.in(14, 40)) {
                const std::int32_t h = c.in(4, 14);
                c.rectangle(0, y, 256, h, c.chance(0.5) ? dark : bright);
            }
            for (std::int32_t x = 0; x < 256; x += c.in(14, 40)) {
                const std::int32_t w = c.in(4, 12);
                const std::int32_t grey = c.in(0, 1) != 0 ? dark : bright;
                for (std::int32_t y = 0; y < 256; y += 4) c.rectangle(x, y, w, 2, grey);
            }
            break;
        case 1:  // flowers and dots
            c.shapes(0, 0, 256, 256, 60, 10, 34, dark, bright);
            for (std::int32_t i = 0; i < 70; ++i) {
                const std::int32_t x = c.in(0, 255);
                const std::int32_t y = c.in(0, 255);
                const std::int32_t radius = c.in(3, 8);
                c.disc(x, y, radius, c.chance(0.5) ? bright : dark);
            }
            break;
        case 2:  // a knitted pattern: rows of small figures
            for (std::int32_t y = 0; y < 256; y += 16) {
                const std::int32_t grey = c.chance(0.5) ? bright : dark;
                for (std::int32_t x = 0; x < 256; x += 16) {
                    if (c.chance(0.25)) continue;
                    const std::uint64_t figure = c.random.next();
                    for (std::int32_t i = 0; i < 9; ++i) {
                        if ((figure >> i & 1) != 0) c.rectangle(x + i % 3 * 5, y + i / 3 * 5, 5, 5, grey);
                    }
                }
            }
            break;
        default:  // print: stripes with letters and signs over them
            for (std::int32_t y = 0; y < 256; y += 32) c.rectangle(0, y, 256, c.in(8, 18), bright);
            c.shapes(0, 0, 256, 256, 24, 16, 50, dark, bright);
            c.print(8, 40, 240, 60, 6, dark);
            c.print(8, 150, 240, 60, 5, bright);
            break;
    }
    // A fine pattern over the coarse one, as prints and weaves have.
    const std::int32_t figures = c.in(70, 130);
    for (std::int32_t i = 0; i < figures; ++i) {
        const std::int32_t x = c.in(0, 250);
        const std::int32_t y = c.in(0, 250);
        const std::int32_t dot = c.in(2, 4);
        const std::int32_t grey = c.chance(0.5) ? bright : dark;
        const std::uint64_t figure = c.random.next();
        for (std::int32_t k = 0; k < 9; ++k) {
            if ((figure >> k & 1) != 0) c.rectangle(x + k % 3 * dot, y + k / 3 * dot, dot, dot, grey);
        }
    }
    c.noise(2, 2, 8);
    c.noise(64, 64, 10);
    return c.finish();
}

Texture trousers(std::uint64_t seed) {
    Painting c(256, 256, seed);
    const std::int32_t ground = c.in(45, 110);
    c.fill(ground);
    c.noise(64, 64, 14);
    c.noise(2, 8, 16);
    const std::int32_t patches = c.in(70, 160);
    for (std::int32_t i = 0; i < patches; ++i) {
        const std::int32_t x = c.in(0, 255);
        const std::int32_t y = c.in(0, 255);
        const std::int32_t w = c.in(3, 12);
        const std::int32_t h = c.in(3, 16);
        c.rectangle(x, y, w, h, c.chance(0.6) ? ground + c.in(40, 100) : 20);
    }
    return c.finish();
}

Texture skin(std::uint64_t seed) {
    Painting c(64, 64, seed);
    c.fill(c.in(120, 180));
    c.noise(16, 16, 10);
    c.noise(4, 4, 4);
    return c.finish();
}

// u runs round the head, the face at the middle; v from the top down.
Texture face(std::uint64_t seed) {
    Painting c(256, 256, seed);
    const std::int32_t tone = c.in(125, 185);
    const std::int32_t hair = c.in(20, 80);
    c.fill(tone);
    c.noise(32, 32, 8);
    c.rectangle(0, 0, 256, 80, hair);
    c.rectangle(0, 0, 70, 170, hair);
    c.rectangle(186, 0, 70, 170, hair);
    for (std::int32_t i = 0; i < 120; ++i) {
        const std::int32_t x = c.in(0, 255);
        const std::int32_t h = c.in(20, 70);
        c.rectangle(x, 0, 2, h, hair + c.in(-15, 40));
    }
    for (const std::int32_t x : {104, 152}) {
        c.rectangle(x - 12, 104, 24, 4, hair);
        c.disc(x, 118, 8, 225);
        c.disc(x, 118, 4, 20);
    }
    c.rectangle(124, 120, 8, 26, tone - 25);
    c.rectangle(108, 164, 40, 8, 80);
    return c.finish();
}

Texture parcel(std::uint64_t seed) {
    Painting c(256, 256, seed);
    const std::int32_t ground = c.in(110, 190);
    c.fill(ground);
    c.noise(128, 2, 6);
    c.shapes(10, 10, 236, 236, c.in(10, 22), 20, 70, 15, 240);
    c.rectangle(0, c.in(20, 220), 256, 18, 215);
    const std::int32_t labels = c.in(2, 4);
    for (std::int32_t i = 0; i < labels; ++i) {
        const std::int32_t w = c.in(70, 130);
        const std::int32_t h = c.in(40, 90);
        const std::int32_t x = c.in(0, 256 - w);
        const std::int32_t y = c.in(0, 256 - h);
        c.rectangle(x, y, w, h, 235);
        c.print(x + 6, y + 6, w - 12, h / 2 - 6, 3, 25);
        for (std::int32_t bar = x + 6; bar < x + w - 8; bar += c.in(3, 8))
            c.rectangle(bar, y + h / 2, c.in(1, 4), h / 2 - 6, 20);
    }
    c.frame(0, 0, 256, 256, 4, 70);
    return c.finish();
}

Texture dark(std::uint64_t seed) {
    Painting c(64, 64, seed);
    c.fill(c.in(28, 50));
    c.noise(8, 8, 6);
    return c.finish();
}

}  // namespace

Texture paint(Pattern pattern, std::uint64_t seed) {
    switch (pattern) {
        case Pattern::kPlainWall: return plain_wall(seed);
        case Pattern::kCarpet: return carpet(seed);
        case Pattern::kCeiling: return ceiling(seed);
        case Pattern::kWood: return wood(seed);
        case Pattern::kPoster: return poster(seed);
        case Pattern::kPinboard: return pinboard(seed);
        case Pattern::kBooks: return books(seed);
        case Pattern::kKeyboard: return keyboard(seed);
        case Pattern::kScreen: return screen(seed);
        case Pattern::kPaper: return paper(seed);
        case Pattern::kMetal: return metal(seed);
        case Pattern::kDoor: return door(seed);
        case Pattern::kCloth: return cloth(seed);
        case Pattern::kTrousers: return trousers(seed);
        case Pattern::kSkin: return skin(seed);
        case Pattern::kFace: return face(seed);
        case Pattern::kParcel: return parcel(seed);
        case Pattern::kDark: return dark(seed);
    }
    return dark(seed);
}

}  // namespace stillmesh::simulated
