// Correlation with a two-dimensional kernel, channels interleaved.
//
// BLOCK output rows by LANES floats at a time live in registers: as many as there are. The kernel comes as `runs`:
// stretches of non-zero taps down one of its columns. Each staged vector of a run's column is loaded once and serves all
// of the rows it reaches.
//
// Of 7 x 7 taps a run is 84 multiply-adds, 36 loads of samples and 7 of weights, and its twelve sums stay in
// registers: with what is staged, read and written the kernel comes to 60 % of the peak of multiply-adds (2048 x 2048 x
// 4, two Zen 3 cores).
//
// A zero tap is in no run, so no NaN leaves the taps that are there. `width` and all strides count floats.

// Definitions given at build time:
//   TAIL(v, k)   what becomes of sixteen samples of the result before they are written, with the numbers in `k` (fuse.py)

#include "staged.clh"
#include "strips.clh"

#ifndef TAIL
#define TAIL(v, k) (v)
#endif

// A run of `count` < BLOCK taps; `count` is a literal where this is called, so that everything unrolls.
inline __attribute__((always_inline)) void short_run(const float *p, int stride, __global const float *weights,
                                                     Strip *sums, const int count)
{
    #pragma unroll
    for (int s = 0; s < BLOCK + count - 1; s++) {
        Strip a = staged(p + s * stride);
        #pragma unroll
        for (int i = 0; i < BLOCK; i++)
            if (s - i >= 0 && s - i < count) 
                one(sums + i, weights[s - i], a);
    }
}

// All runs of `count` taps, from run r on.
#define LIKE(count, body)                                                                                              \
    do {                                                                                                               \
        body(p + runs[3 * r], stride, weights + runs[3 * r + 1], sums, count);                                    \
    } while (++r < run_count && runs[3 * r + 2] == (count))

// `sources` names for output row y and kernel row t, at y + t, the row to read, and `beside` for a float of the tile and
// its margin the float of the row; -1 is the constant. `reach` floats lie left of the tile. A run is (offset into the
// stage, first weight, count).
__kernel void correlate(__global const float *restrict in, __global const int *restrict sources,
                        __global const int *restrict beside, __global const int *restrict runs,
                        __global const float *restrict weights, __global float *restrict out, int height, int width,
                        int reach, int tall, int stride, int band, int tile, int run_count, float value, float bias,
                        int capacity, int accumulate, __global const float *restrict numbers)
{
    int x = get_global_id(0) * tile, y = get_global_id(1) * band;
    if (x >= width || y >= height)
        return;
    float stage[STAGE] __attribute__((aligned(64)));
    int whole = (width & 15) == 0, first = 0, held = 0;
    int rows = min(band, height - y), wide = min(tile, width - x), all = rows + tall - 1;
    for (int j = 0; j < rows; j += BLOCK) {
        STAGED(j, j + BLOCK + tall - 1);
        // What the next rows are staged from is on its way while these are summed.
        __global const float *ahead[BLOCK];
        #pragma unroll
        for (int i = 0; i < BLOCK; i++) {
            int source = sources[y + min(j + BLOCK + tall - 1 + i, all - 1)];
            ahead[i] = in + (size_t)max(source, 0) * width + clamp(x - reach, 0, max(width - tile, 0));
        }
        for (int k = 0; k < wide; k += LANES) {
            #pragma unroll
            for (int i = 0; i < BLOCK; i++) {
                stream_ask(ahead[i] + k);
                stream_ask(ahead[i] + k + 16);
            }
            Strip sums[BLOCK];
            #pragma unroll
            for (int i = 0; i < BLOCK; i++)
                #pragma unroll
                for (int v = 0; v < VECTORS; v++)
                    sums[i].v[v] = (float16)(bias);
            const float *p = stage + (j - first) * stride + k;
            for (int r = 0; r < run_count;) {
                // Runs come in order of their length, so each loop below keeps its sums in registers.
                switch (runs[3 * r + 2]) {
                case 1: LIKE(1, short_run); break;
                case 2: LIKE(2, short_run); break;
                case 3: LIKE(3, short_run); break;
                case 4: LIKE(4, short_run); break;
                case 5: LIKE(5, short_run); break;
                case 6: LIKE(6, short_run); break;
                case 7: LIKE(7, short_run); break;
                default: LIKE(runs[3 * r + 2], long_run);
                }
            }
            __global float *to = out + (size_t)(y + j) * width + x + k;
            #pragma unroll
            for (int i = 0; i < BLOCK; i++, to += width)
                if (j + i < rows)
                    add_line(to, TAIL(sums[i].v[0], numbers), TAIL(sums[i].v[1], numbers), wide - k, whole, accumulate);
        }
    }
}
