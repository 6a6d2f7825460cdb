// Sums down rows whose weights come again every `period` rows: row r of the result is the sum over k < taps of
// weights[r % period, k] times row r / period * step + k of those that `sources` names, -1 being the constant. A filter
// that leaves rows out has a period of one row and a step of several, one that puts them back in the reverse.
//
// sums: one item owns a tile of a band of rows, some floats wide, and stages what they read, as `staged.clh` has it.
// apart: one item for each float, where items step together.
//
// `width` counts floats; the result begins at row `top` of `out` and has `height` rows.

#include "staged.clh"

#define SEGMENT 64

#ifdef STAGE
#if CODED
typedef uchar Sample;
#define MEANT(sample) meant[sample]
#else
typedef float Sample;
#define MEANT(sample) sample
#endif

// Floats of a row from `from` on, -1 being the constant; codes are looked up in what they are `meant` to be.
STAGED_FN void stage_line(float *to, __global const Sample *in, __global const float *meant, int source, int from,
                          int count, int width, float value)
{
    __global const Sample *row = in + (size_t)max(source, 0) * width + from;
    int i = 0;
#if !CODED
    if (source >= 0)
        for (; i + 16 <= count; i += 16)
            vstore16(vload16(0, row + i), 0, to + i);
#endif
    if (source >= 0)
        for (; i < count; i++)
            to[i] = MEANT(row[i]);
    for (; i < count; i++)
        to[i] = value;
}

__kernel void sums(__global const Sample *restrict in, __global const float *restrict meant,
                   __global const int *restrict sources,
                   __global const float *restrict weights, __global float *restrict out, int top, int height, int width,
                   int taps, int period, int step, int band, int tile, int capacity, float value)
{
    int x = get_global_id(0) * tile, y = get_global_id(1) * band;
    if (x >= width || y >= height)
        return;
    float stage[STAGE] __attribute__((aligned(64)));
    int end = min(y + band, height), count = min(tile, width - x), whole = (width & 15) == 0;
    // A pitch of a power of two would have rows fight for the same cache sets.
    int pitch = tile + 16, first = y / period * step, held = 0;
    for (int r = y; r < end; r++) {
        int wanted = r / period * step;
        if (wanted + taps - first > capacity) {
            move_up(stage, wanted - first, held, pitch);
            held -= wanted - first;
            first = wanted;
        }
        for (; first + held < wanted + taps; held++)
            stage_line(stage + held * pitch, in, meant, sources[first + held], x, count, width, value);
        __global const float *own = weights + (r % period) * taps;
        __global float *to = out + (size_t)(top + r) * width + x;
        for (int i = 0; i < count; i += SEGMENT) {
            const float *p = stage + (wanted - first) * pitch + i;
            float16 s0 = (float16)(0.0f), s1 = s0, s2 = s0, s3 = s0;
            for (int k = 0; k < taps; k++, p += pitch) {
                float16 w = (float16)(own[k]);
                s0 = fma(w, vload16(0, p), s0);
                s1 = fma(w, vload16(1, p), s1);
                s2 = fma(w, vload16(2, p), s2);
                s3 = fma(w, vload16(3, p), s3);
            }
            put_line(to + i, s0, s1, count - i, whole);
            if (count - i > 32)
                put_line(to + i + 32, s2, s3, count - i - 32, whole);
        }
    }
}
#endif

__kernel void apart(__global const float *restrict in, __global const int *restrict sources,
                    __global const float *restrict weights, __global float *restrict out, int top, int height, int width,
                    int taps, int period, int step, float value)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    float sum = 0.0f;
    for (int k = 0; k < taps; k++) {
        int source = sources[y / period * step + k];
        sum = fma(weights[y % period * taps + k], source < 0 ? value : in[(size_t)source * width + x], sum);
    }
    out[(size_t)(top + y) * width + x] = sum;
}
