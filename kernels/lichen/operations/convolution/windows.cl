// Sums, smallest or largest values of every window of n samples along an axis, in time that does not grow with n.
//
// Lines are cut into blocks of n. A window meets at most two: it is the end of one and the beginning of the next. Ends
// are accumulated backwards and beginnings forwards inside each block, and one more step joins them (van Herk 1992, Gil
// and Werman 1993). Nothing is ever subtracted, so no error drifts, no NaN outlives its window, and sums of what is not
// negative are not negative.
//
// COMBINE is the step: 0 the sum, of samples multiplied by `scale`, 1 the smaller, 2 the larger; NANS is 0 where no sample
// is NaN, 1 where one in a window is the result, 2 where it takes no part. Sample i of a line that begins before the image
// comes from sources[i]; -1 is the constant.
//
// both: both axes at once, for windows that private memory holds twice. Along rows of pixels of three or four
//   channels, four rows abreast are taken as above, pixel by pixel, so that no step waits for the one before. Of
//   other pixels, windows of one length are joined to windows of twice that, so that all lanes of a vector are at
//   work; those of the lengths that add up to n are joined to the result. Down the image the rows that come out are
//   taken as above.
// down, across: one axis after the other, for larger windows.

#include "numeric.clh"
#include "staged.clh"

#define LANES 32
#define STAGED 256
#define GROUP 4
#define ABREAST 4
#define FEW 5 // samples that are joined one after the other

#if defined(__clang__) && defined(__x86_64__)
#define AS_WRITTEN _Pragma("clang loop vectorize(disable) interleave(disable)")
#else
#define AS_WRITTEN
#endif

#if COMBINE == 0
#define JOIN(a, b) ((a) + (b))
#define SAMPLE(v) ((v) * scale)
#define NEXT(a, b) fma(b, (float16)(scale), a)
#define NEXT8(a, b) fma(b, (float8)(scale), a)
#define AFTER(v) ((v) * after)
#elif COMBINE == 1
#define JOIN(a, b) (NANS == 1 ? num_min(a, b) : NANS == 2 ? ((b) != (b) | (a) < (b) ? (a) : (b)) : (a) < (b) ? (a) : (b))
#define SAMPLE(v) (v)
#define NEXT(a, b) JOIN(a, b)
#define NEXT8(a, b) JOIN(a, b)
#define AFTER(v) (v)
#else
#define JOIN(a, b) (NANS == 1 ? num_max(a, b) : NANS == 2 ? ((b) != (b) | (b) < (a) ? (a) : (b)) : (a) < (b) ? (b) : (a))
#define SAMPLE(v) (v)
#define NEXT(a, b) JOIN(a, b)
#define NEXT8(a, b) JOIN(a, b)
#define AFTER(v) (v)
#endif

#ifdef STAGE
// Windows of few samples, `channels` floats apart, from `line` on: one after the other. What the next row is made of is
// on its way from `ahead` meanwhile.
STAGED_FN void along_few(const float *line, float *to, __global const float *ahead, int tile, int channels, float scale,
                         float after, const int n)
{
    for (int i = 0; i < tile; i += 32) {
        stream_ask(ahead + i);
        stream_ask(ahead + i + 16);
        float16 a = SAMPLE(vload16(0, line + i)), b = SAMPLE(vload16(1, line + i));
        #pragma unroll
        for (int t = 1; t < n; t++) {
            a = NEXT(a, vload16(0, line + i + t * channels));
            b = NEXT(b, vload16(1, line + i + t * channels));
        }
        vstore16(AFTER(a), 0, to + i);
        vstore16(AFTER(b), 1, to + i);
    }
}

// Windows of n samples; what is on the line, `stride` floats, is lost. A compiler that made vectors of these vectors
// would take them apart.
STAGED_FN void along_many(float *line, float *to, __global const float *ahead, int tile, int stride, int channels, int n,
                          float scale, float after)
{
    int covered = 0;
    for (int i = 0; i < stride; i += 16) {
        stream_ask(ahead + min(i, tile - 16));
        vstore16(SAMPLE(vload16(0, line + i)), 0, line + i);
    }
    for (int length = 1;; length *= 2) {
        int last = 2 * length > n;
        if (n & length) {
            const float *from = line + covered * channels;
            AS_WRITTEN
            for (int i = 0; i < tile; i += 16) {
                float16 v = vload16(0, from + i);
                v = covered ? JOIN(vload16(0, to + i), v) : v;
                vstore16(last ? AFTER(v) : v, 0, to + i);
            }
            covered += length;
        }
        if (last)
            return;
        AS_WRITTEN
        for (int i = 0; i < stride - 2 * (length - 1) * channels; i += 16)
            vstore16(JOIN(vload16(0, line + i), vload16(0, line + i + length * channels)), 0, line + i);
    }
}

// A pixel of the lines `apart` floats one below the other, of the first two and of the other two.
#define UPPER(at) (float8)(vload4(0, at), vload4(0, (at) + apart))
#define LOWER(at) UPPER((at) + 2 * apart)

STAGED_FN void put_abreast(float *const *to, int at, float8 upper, float8 lower)
{
    vstore4(upper.lo, 0, to[0] + at);
    vstore4(upper.hi, 0, to[1] + at);
    vstore4(lower.lo, 0, to[2] + at);
    vstore4(lower.hi, 0, to[3] + at);
}

// Windows of n pixels of ABREAST lines. What a pixel of three channels has behind it is overwritten by the next.
STAGED_FN void along_abreast(const float *lines, int apart, float *const *to, float *ends, int tile, int n, float scale,
                             float after, const int channels)
{
    int pixels = (tile + channels - 1) / channels;
    for (int x = 0; x < pixels; x += n) {
        int count = min(n, pixels - x);
        const float *p = lines + (x + n - 1) * channels;
        float8 upper = SAMPLE(UPPER(p)), lower = SAMPLE(LOWER(p));
        for (int i = n - 1; i >= count; i--) {
            p -= channels;
            upper = NEXT8(upper, UPPER(p));
            lower = NEXT8(lower, LOWER(p));
        }
        for (int i = count - 1;; i--) {
            vstore8(upper, 2 * i, ends);
            vstore8(lower, 2 * i + 1, ends);
            if (i == 0)
                break;
            p -= channels;
            upper = NEXT8(upper, UPPER(p));
            lower = NEXT8(lower, LOWER(p));
        }
        put_abreast(to, x * channels, AFTER(upper), AFTER(lower));
        p = lines + (x + n) * channels;
        upper = SAMPLE(UPPER(p));
        lower = SAMPLE(LOWER(p));
        for (int i = 1; i < count; i++) {
            float8 a = JOIN(vload8(2 * i, ends), upper), b = JOIN(vload8(2 * i + 1, ends), lower);
            put_abreast(to, (x + i) * channels, AFTER(a), AFTER(b));
            p += channels;
            upper = NEXT8(upper, UPPER(p));
            lower = NEXT8(lower, LOWER(p));
        }
    }
}

// One item: `band` rows of a tile, windows of `tall` rows by `wide` pixels. `sources` names for output row y and row t of
// its window, at y + t, the row to read, `beside` for a float of the tile and its margin the float of the row, and `reach`
// floats lie left of the tile. `after` is a factor on what comes out along the rows. `width` counts floats.
__kernel void both(__global const float *restrict in, __global const int *restrict sources,
                   __global const int *restrict beside, __global float *restrict out, int height, int width, int reach,
                   int stride, int band, int tile, int channels, int wide, int tall, float value, float scale,
                   float after)
{
    int x = get_global_id(0) * tile, y = get_global_id(1) * band;
    if (x >= width || y >= height)
        return;
    float stage[STAGE] __attribute__((aligned(64))), line[MARGIN] __attribute__((aligned(64)));
    float ends[(TILE / 3 + 1) * 4 * ABREAST] __attribute__((aligned(64)));
    // A pitch of a power of two would have rows fight for the same cache sets.
    int rows = min(band, height - y) + tall - 1, count = min(tile, width - x);
    int pitch = tile + 16, apart = stride + 16, whole = (width & 15) == 0;
    // Rows that come too early may lie where the blocks begin: what was there has served.
    int abreast = wide > FEW && tall > ABREAST && (channels == 3 || channels == 4) && ABREAST * apart <= MARGIN;
    float *begun = stage + 2 * tall * pitch;
    for (int r = 0; r < rows; r++) {
        int i = r % tall, odd = r / tall & 1;
        float *block = stage + odd * tall * pitch, *row = block + i * pitch;
        int later = min(r + (abreast ? ABREAST : 1), rows - 1);
        __global const float *ahead = in + (size_t)max(sources[y + later], 0) * width;
        ahead += clamp(x - reach, 0, max(width - tile, 0));
        if (abreast && r % ABREAST == 0) {
            float *to[ABREAST];
            #pragma unroll
            for (int k = 0; k < ABREAST; k++) {
                float *own = line + k * apart;
                to[k] = r + k < rows ? stage + (r + k) % (2 * tall) * pitch : own;
                stage_row(own, in, 0, beside, sources[y + min(r + k, rows - 1)], x, reach, stride, width, value);
            }
            if (channels == 3)
                along_abreast(line, apart, to, ends, tile, wide, scale, after, 3);
            else
                along_abreast(line, apart, to, ends, tile, wide, scale, after, 4);
        }
        if (abreast) {
            for (int k = 0; k < stride; k += 16)
                stream_ask(ahead + k);
        } else {
            stage_row(line, in, 0, beside, sources[y + r], x, reach, stride, width, value);
            switch (wide) {
            case 1: along_few(line, row, ahead, tile, channels, scale, after, 1); break;
            case 2: along_few(line, row, ahead, tile, channels, scale, after, 2); break;
            case 3: along_few(line, row, ahead, tile, channels, scale, after, 3); break;
            case 4: along_few(line, row, ahead, tile, channels, scale, after, 4); break;
            case 5: along_few(line, row, ahead, tile, channels, scale, after, 5); break;
            default: along_many(line, row, ahead, tile, stride, channels, wide, scale, after);
            }
        }
        __global float *to = out + (size_t)(y + r - tall + 1) * width + x;
        if (i == tall - 1) {
            // The block is whole: from now on its rows are joined with all that follow in it.
            for (int k = 0; k < count; k += 32) {
                float16 a = vload16(0, row + k), b = vload16(1, row + k);
                for (int t = tall - 2; t >= 0; t--) {
                    float *p = block + t * pitch + k;
                    a = JOIN(vload16(0, p), a);
                    b = JOIN(vload16(1, p), b);
                    vstore16(a, 0, p);
                    vstore16(b, 1, p);
                }
                put_line(to + k, a, b, count - k, whole);
            }
        } else {
            const float *end = stage + (1 - odd) * tall * pitch + (i + 1) * pitch;
            for (int k = 0; k < count; k += 32) {
                float16 a = vload16(0, row + k), b = vload16(1, row + k);
                if (i) {
                    a = JOIN(vload16(0, begun + k), a);
                    b = JOIN(vload16(1, begun + k), b);
                }
                vstore16(a, 0, begun + k);
                vstore16(b, 1, begun + k);
                if (r >= tall)
                    put_line(to + k, JOIN(vload16(0, end + k), a), JOIN(vload16(1, end + k), b), count - k, whole);
            }
        }
    }
}
#endif

inline float16 row_of(__global const float *in, int source, int width, int x, int lane, int wide, float value)
{
    if (source < 0)
        return (float16)(value);
    __global const float *from = in + (size_t)source * width + x + lane;
    if (wide == LANES)
        return vload16(0, from);
    float lanes[16];
    for (int i = 0; i < 16; i++)
        lanes[i] = lane + i < wide ? from[i] : 0.0f;
    return vload16(0, lanes);
}

inline void put(__global float *to, float16 v, int lane, int wide)
{
    if (wide == LANES) {
        vstore16(v, 0, to + lane);
        return;
    }
    float lanes[16];
    vstore16(v, 0, lanes);
    for (int i = 0; i < 16; i++)
        if (lane + i < wide)
            to[lane + i] = lanes[i];
}

#define ROW(i, lane) SAMPLE(row_of(in, sources[i], width, x, lane, wide, value))

// One item: `band` rows, a multiple of n, of one strip. `width` counts floats.
__kernel void down(__global const float *restrict in, __global const int *restrict sources, __global float *restrict out,
                   int height, int width, int n, int band, float value, float scale)
{
    int x = get_global_id(0) * LANES, first = get_global_id(1) * band;
    if (x >= width || first >= height)
        return;
    int wide = min(LANES, width - x);
    // Ends of blocks wait here where they fit, since rows a power of two apart fight for the same cache sets.
    float stage[STAGED * LANES];
    for (int y = first; y < min(first + band, height); y += n) {
        int rows = min(n, height - y);
        float16 a = ROW(y + n - 1, 0), b = ROW(y + n - 1, 16);
        for (int i = n - 1;; i--) {
            if (i < rows && n <= STAGED) {
                vstore16(a, 2 * i, stage);
                vstore16(b, 2 * i + 1, stage);
            } else if (i < rows) {
                put(out + (size_t)(y + i) * width + x, a, 0, wide);
                put(out + (size_t)(y + i) * width + x, b, 16, wide);
            }
            if (i == 0)
                break;
            a = JOIN(ROW(y + i - 1, 0), a);
            b = JOIN(ROW(y + i - 1, 16), b);
        }
        for (int i = 0; i < rows; i++) {
            __global float *to = out + (size_t)(y + i) * width + x;
            float16 low, high;
            if (n <= STAGED) {
                low = vload16(2 * i, stage);
                high = vload16(2 * i + 1, stage);
            } else {
                low = row_of(out, y + i, width, x, 0, wide, value);
                high = row_of(out, y + i, width, x, 16, wide, value);
            }
            if (i == 1) {
                a = ROW(y + n, 0);
                b = ROW(y + n, 16);
            } else if (i) {
                a = JOIN(a, ROW(y + n + i - 1, 0));
                b = JOIN(b, ROW(y + n + i - 1, 16));
            }
            put(to, i ? JOIN(low, a) : low, 0, wide);
            put(to, i ? JOIN(high, b) : high, 16, wide);
        }
    }
}

// A block of `count` channels of one row, from pixel x on. Where it lies `inside`, sample i is `shift` pixels further.
inline __attribute__((always_inline)) void block(__global const float *row, __global const int *sources,
                                                 __global float *out, int x, int wide, int channels, int n, int shift,
                                                 float value, float scale, const int count, const int inside)
{
    float s[GROUP];
    for (int i = n - 1; i >= 0; i--) {
        int source = inside ? x + i + shift : sources[x + i];
        #pragma unroll
        for (int c = 0; c < count; c++) {
            float v = SAMPLE(!inside && source < 0 ? value : row[source * channels + c]);
            s[c] = i == n - 1 ? v : JOIN(v, s[c]);
            if (i < wide)
                out[(x + i) * channels + c] = s[c];
        }
    }
    for (int i = 1; i < wide; i++) {
        int source = inside ? x + n + i - 1 + shift : sources[x + n + i - 1];
        #pragma unroll
        for (int c = 0; c < count; c++) {
            float v = SAMPLE(!inside && source < 0 ? value : row[source * channels + c]);
            s[c] = i == 1 ? v : JOIN(s[c], v);
            out[(x + i) * channels + c] = JOIN(out[(x + i) * channels + c], s[c]);
        }
    }
}

// `count` channels of one row. `width` counts pixels.
inline __attribute__((always_inline)) void along(__global const float *row, __global const int *sources,
                                                 __global float *out, int width, int channels, int n, int before,
                                                 float value, float scale, const int count)
{
    for (int x = 0; x < width; x += n) {
        if (x >= before && x - before + 2 * n <= width && x + n <= width)
            block(row, sources, out, x, n, channels, n, -before, value, scale, count, 1);
        else
            block(row, sources, out, x, min(n, width - x), channels, n, 0, value, scale, count, 0);
    }
}

// One item: one row.
__kernel void across(__global const float *restrict in, __global const int *restrict sources,
                     __global float *restrict out, int height, int width, int channels, int n, int before, float value,
                     float scale)
{
    int y = get_global_id(0);
    if (y >= height)
        return;
    size_t start = (size_t)y * width * channels;
    for (int c = 0; c < channels; c += GROUP) {
        __global const float *row = in + start + c;
        __global float *to = out + start + c;
        switch (min(GROUP, channels - c)) {
        case 1: along(row, sources, to, width, channels, n, before, value, scale, 1); break;
        case 2: along(row, sources, to, width, channels, n, before, value, scale, 2); break;
        case 3: along(row, sources, to, width, channels, n, before, value, scale, 3); break;
        default: along(row, sources, to, width, channels, n, before, value, scale, 4);
        }
    }
}
