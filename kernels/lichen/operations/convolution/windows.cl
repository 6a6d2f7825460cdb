// Sums, smallest or largest values of every window of n samples along an axis, in time that does not grow with n.
//
// Lines are cut into blocks of n. A window meets at most two: it is the end of one and the beginning of the next. Ends
// are accumulated backwards and beginnings forwards inside each block, and one more step joins them (van Herk 1992, Gil
// and Werman 1993). Nothing is ever subtracted, so no error drifts, no NaN outlives its window, and sums of what is not
// negative are not negative.
//
// COMBINE(a, b) is the step, SCALE whether samples are multiplied by `scale` before. Sample i of a line that begins
// before the image comes from sources[i]; -1 is the constant.

#include "numeric.clh"

#define LANES 32
#define STAGED 256
#define GROUP 4

#if COMBINE == 0
#define JOIN(a, b) ((a) + (b))
#define SAMPLE(v) ((v) * scale)
#elif COMBINE == 1
#define JOIN(a, b) num_min(a, b)
#define SAMPLE(v) (v)
#else
#define JOIN(a, b) num_max(a, b)
#define SAMPLE(v) (v)
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
