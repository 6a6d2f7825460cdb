/* Resizing: each sample of the result is a weighted sum of a few samples of the source, along one axis and then the other.
 * `index` and `weights` hold `taps` for each; `outside` is what the border's value adds.
 *
 * `both` does both axes at once where a result takes few rows, one after the other; `down` and `across`, with an image
 * between them, are for all others. The sums have the same order, and so the same bits. */

#include "stream.clh"

#define STRIP 64

/* Rows from rows. A row is `floats` long, whatever its pixels are. One work-item does STRIP floats of one row. */
kernel void down(global const float *restrict in, global float *restrict out, global const int *restrict index,
                 global const float *restrict weights, global const float *restrict outside, int taps, int floats,
                 int rows) {
    const int first = get_global_id(0) * STRIP, row = get_global_id(1);
    if (first >= floats || row >= rows) return;
    global const int *at = index + (size_t)row * taps;
    global const float *by = weights + (size_t)row * taps;
    global float *to = out + (size_t)row * floats + first;
    const float begin = outside[row];
    if (first + STRIP <= floats) {
        float16 a = begin, b = begin, c = begin, d = begin;
        for (int k = 0; k < taps; ++k) {
            global const float *p = in + (size_t)at[k] * floats + first;
            const float16 w = by[k];
            a = fma(w, vload16(0, p), a);
            b = fma(w, vload16(1, p), b);
            c = fma(w, vload16(2, p), c);
            d = fma(w, vload16(3, p), d);
        }
        vstore16(a, 0, to);
        vstore16(b, 1, to);
        vstore16(c, 2, to);
        vstore16(d, 3, to);
        return;
    }
    for (int i = 0; first + i < floats; ++i) {
        float sum = begin;
        for (int k = 0; k < taps; ++k) sum = fma(by[k], in[(size_t)at[k] * floats + first + i], sum);
        to[i] = sum;
    }
}

/* Columns from columns, of pixels of CHANNELS floats, or of `floats` where that is 0. One work-item does one column of BLOCK rows, so that indices and
 * weights are read once for all of them. */
#define BLOCK 4

kernel void across(global const float *restrict in, global float *restrict out, global const int *restrict index,
                   global const float *restrict weights, global const float *restrict outside, int taps, int columns,
                   int wide, int rows, int floats) {
    const int first = get_global_id(0) * STRIP, row = get_global_id(1) * BLOCK;
    if (first >= wide || row >= rows) return;
    const int count = min(STRIP, wide - first);
    const int channels = CHANNELS ? CHANNELS : floats;
    const size_t pitch = (size_t)columns * channels, step = (size_t)wide * channels;
    const int tall = min(BLOCK, rows - row);
    for (int i = first; i < first + count; ++i) {
        global const int *at = index + (size_t)i * taps;
        global const float *by = weights + (size_t)i * taps;
        global const float *from = in + row * pitch;
        global float *to = out + row * step + (size_t)i * channels;
        const float begin = outside[i];
#if CHANNELS == 4
        if (tall == BLOCK) {
            float4 a = begin, b = begin, c = begin, d = begin;
            for (int k = 0; k < taps; ++k) {
                global const float *p = from + 4 * at[k];
                const float4 w = by[k];
                a = fma(w, vload4(0, p), a);
                b = fma(w, vload4(0, p + pitch), b);
                c = fma(w, vload4(0, p + 2 * pitch), c);
                d = fma(w, vload4(0, p + 3 * pitch), d);
            }
            vstore4(a, 0, to);
            vstore4(b, 0, to + step);
            vstore4(c, 0, to + 2 * step);
            vstore4(d, 0, to + 3 * step);
            continue;
        }
#endif
        for (int j = 0; j < tall; ++j)
            for (int n = 0; n < channels; ++n) {
                float sum = begin;
                for (int k = 0; k < taps; ++k) sum = fma(by[k], from[j * pitch + channels * at[k] + n], sum);
                to[j * step + n] = sum;
            }
    }
}

/* Both axes of a band of `tall` rows of a strip of OUT columns, of the `floats` source floats from `spans` on, at most
 * WIDE; `reach` has the first source row of each row, and the one after its last. Source rows go through a ring of SLOTS,
 * so that each is read from the image once, codes being looked up there, and is next to the rows that are summed with it:
 * in the image, rows of 4096 pixels compete for the same lines of a cache. Along rows LINES samples of a column are summed at once: one sum after the
 * other, each of which waits for its last product, took 2.5 times as long for 12 megapixels of three channels.
 * Halves of 2048 x 2048 RGBA by four taps take 1.8 times a copy of the same bytes. Stores around the caches, four rows in
 * turn, made it 1.8 times as long, whole lines of them 0.97; rows straight from the image although two sums share each,
 * 1.0; four taps unrolled, 0.96; rows asked for 8 or 16 ahead, 1.0. */
#ifdef SLOTS
#define AHEAD 4 /* rows that are asked for before they are kept: rows of a strip lie apart */

#if CODED
typedef uchar Sample;

inline void keep(float *restrict to, global const Sample *restrict from, global const float *restrict meant, int floats,
                 size_t pitch) {
    for (int i = 0; i < floats; ++i) to[i] = meant[from[i]];
}
#else
typedef float Sample;

inline void keep(float *restrict to, global const Sample *restrict from, global const float *restrict meant, int floats,
                 size_t pitch) {
    int i = 0;
    for (; i + 16 <= floats; i += 16) {
        stream_ask(from + AHEAD * pitch + i);
        vstore16(vload16(0, from + i), 0, to + i);
    }
    for (; i < floats; ++i) to[i] = from[i];
}
#endif

/* The same sums as below where no source row takes part in two of them: straight from the image. `floats` is a multiple
 * of STRIP. */
inline void sum_source(float *restrict to, global const float *restrict from, global const int *restrict at,
                       global const float *restrict by, int taps, float begin, int floats, size_t pitch) {
    for (int first = 0; first < floats; first += STRIP) {
        float16 a = begin, b = begin, c = begin, d = begin;
        for (int k = 0; k < taps; ++k) {
            global const float *p = from + at[k] * pitch + first;
            for (int i = 0; i < STRIP; i += 16) stream_ask(p + taps * pitch + i);
            const float16 w = by[k];
            a = fma(w, vload16(0, p), a);
            b = fma(w, vload16(1, p), b);
            c = fma(w, vload16(2, p), c);
            d = fma(w, vload16(3, p), d);
        }
        vstore16(a, 0, to + first);
        vstore16(b, 1, to + first);
        vstore16(c, 2, to + first);
        vstore16(d, 3, to + first);
    }
}

inline void sum_rows(float *restrict to, const float *restrict ring, global const int *restrict at,
                     global const float *restrict by, int taps, float begin, int floats) {
    for (int first = 0; first < floats; first += STRIP) {
        float16 a = begin, b = begin, c = begin, d = begin;
        for (int k = 0; k < taps; ++k) {
            const float *p = ring + at[k] % SLOTS * WIDE + first;
            const float16 w = by[k];
            a = fma(w, vload16(0, p), a);
            b = fma(w, vload16(1, p), b);
            c = fma(w, vload16(2, p), c);
            d = fma(w, vload16(3, p), d);
        }
        vstore16(a, 0, to + first);
        vstore16(b, 1, to + first);
        vstore16(c, 2, to + first);
        vstore16(d, 3, to + first);
    }
}

#if CHANNELS == 4
#define LINES 4 /* rows that are summed along together: pixels of four are vectors as they are */
#else
#define LINES 8 /* of others, vectors are samples of a column, which are put next to each other for it */
#define TOGETHER (CHANNELS ? CHANNELS : 1) /* samples of a pixel, each a sum of its own */

inline void turn(float *restrict to, const float *restrict lines, int floats, int many) {
    const float *row[LINES];
#pragma unroll
    for (int j = 0; j < LINES; ++j) row[j] = lines + min(j, many - 1) * WIDE;
    for (int i = 0; i < floats; ++i)
        vstore8((float8)(row[0][i], row[1][i], row[2][i], row[3][i], row[4][i], row[5][i], row[6][i], row[7][i]), i, to);
}
#endif

kernel void both(global const Sample *restrict in, global const float *restrict meant, global float *restrict out,
                 global const int *restrict index, global const float *restrict weights,
                 global const float *restrict outside, int taps, global const int *restrict index_across,
                 global const float *restrict weights_across, global const float *restrict outside_across,
                 int taps_across, global const int *restrict reach, global const int *restrict spans, int columns, int wide,
                 int rows, int tall, int given) {
    const int strip = get_global_id(0), first = strip * OUT, top = get_global_id(1) * tall;
    if (first >= wide || top >= rows) return;
    const int channels = CHANNELS ? CHANNELS : given;
    const int left = spans[2 * strip], floats = (spans[2 * strip + 1] - left) * channels;
    const int count = min(OUT, wide - first), bottom = min(top + tall, rows);
    const size_t pitch = (size_t)columns * channels, step = (size_t)wide * channels;
    float ring[SLOTS * WIDE], lines[LINES * WIDE];
#if CHANNELS != 4
    float beside[LINES * WIDE];
#endif
    int held = 0; /* the row that the ring takes next */
    int apart = floats % STRIP == 0;
    for (int row = top + 1; row < bottom; ++row) apart &= reach[2 * row] >= reach[2 * row - 1];
    for (int row = top; row < bottom; row += LINES) {
        const int many = min(LINES, bottom - row);
        for (int j = 0; j < many; ++j) {
            global const int *at = index + (size_t)(row + j) * taps;
            global const float *by = weights + (size_t)(row + j) * taps;
#if !CODED
            if (apart) {
                sum_source(lines + j * WIDE, in + left * channels, at, by, taps, outside[row + j], floats, pitch);
                continue;
            }
#endif
            for (held = max(held, reach[2 * (row + j)]); held < reach[2 * (row + j) + 1]; ++held)
                keep(ring + held % SLOTS * WIDE, in + held * pitch + left * channels, meant, floats, pitch);
            sum_rows(lines + j * WIDE, ring, at, by, taps, outside[row + j], floats);
        }
#if CHANNELS != 4
        turn(beside, lines, floats, many);
#endif
        for (int i = first; i < first + count; ++i) {
            global const int *at = index_across + (size_t)i * taps_across;
            global const float *by = weights_across + (size_t)i * taps_across;
            global float *to = out + row * step + (size_t)i * channels;
            const float begin = outside_across[i];
#if CHANNELS == 4
            float4 sums[LINES];
#pragma unroll
            for (int j = 0; j < LINES; ++j) sums[j] = begin;
            for (int k = 0; k < taps_across; ++k) {
                const float *p = lines + 4 * (at[k] - left);
                const float4 w = by[k];
#pragma unroll
                for (int j = 0; j < LINES; ++j) sums[j] = fma(w, vload4(0, p + j * WIDE), sums[j]);
            }
#pragma unroll
            for (int j = 0; j < LINES; ++j)
                if (j < many) vstore4(sums[j], 0, to + j * step);
#else
            for (int n = 0; n < channels; n += TOGETHER) {
                float8 sums[TOGETHER];
#pragma unroll
                for (int c = 0; c < TOGETHER; ++c) sums[c] = begin;
                for (int k = 0; k < taps_across; ++k) {
                    const float *p = beside + LINES * (channels * (at[k] - left) + n);
                    const float8 w = by[k];
#pragma unroll
                    for (int c = 0; c < TOGETHER; ++c) sums[c] = fma(w, vload8(c, p), sums[c]);
                }
#pragma unroll
                for (int c = 0; c < TOGETHER; ++c) {
                    float each[LINES];
                    vstore8(sums[c], 0, each);
                    for (int j = 0; j < many; ++j) to[j * step + n + c] = each[j];
                }
            }
#endif
        }
    }
}
#endif
