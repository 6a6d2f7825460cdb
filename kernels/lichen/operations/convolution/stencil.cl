// Correlation with a two-dimensional kernel, channels interleaved.
//
// BLOCK output rows by LANES floats at a time live in registers: as many as there are. The kernel comes as `runs`:
// stretches of up to LONGEST non-zero taps down one of its columns. Each staged vector of a run's column is loaded once
// and serves all of the rows it reaches.
//
// Of 7 x 7 taps a run is 84 multiply-adds, 36 loads of samples and 7 of weights, and its twelve sums stay in registers:
// the sums are bound by multiply-adds, and what is staged, read and written goes on beside them (`make bench
// ARGS=convolution` tells the share of their peak).
//
// Where a kernel has so many taps that summing takes longer than reading and writing (`busy`), both go on meanwhile: the
// next rows are staged beside the sums, and results are stored through the cache, for stores past it would wait for one
// another (7 x 7 taps take 0.9 of the time so, and few taps 1.1). What is read lies SOONER floats beyond what is written,
// since a processor that compares the last twelve bits of addresses takes a load from where it has just stored for a
// load of what it has stored.
//
// Rows of tiles that meet no border, summed straight from the image instead of being staged first, take 1.0 of the time
// for a Laplacian of 2048 x 2048 RGB, and 1.1 to 1.5 for 3 x 3 and 5 x 5 dense taps of RGBA: rows lie a multiple of 4 kB
// apart, and fight for the same cache sets.
//
// A zero tap is in no run, so no NaN leaves the taps that are there. `width` and all strides count floats.

#include "staged.clh"
#include "strips.clh"

#define SOONER 64

// All runs of `count` taps, from run r on.
#define LIKE(count)                                                                                                    \
    do {                                                                                                               \
        short_run(p + runs[3 * r], stride, weights + runs[3 * r + 1], sums, count);                                    \
    } while (++r < run_count && runs[3 * r + 2] == (count))

// 16 floats of each of the next BLOCK rows.
inline __attribute__((always_inline)) void stage_next(float *to, __global const float **from, int at, int stride)
{
    #pragma unroll
    for (int i = 0; i < BLOCK; i++)
        vstore16(vload16(0, from[i] + at), 0, to + i * stride);
}

// `sources` names for output row y and kernel row t, at y + t, the row to read, and `beside` for a float of the tile and
// its margin the float of the row; -1 is the constant. `reach` floats lie left of the tile. A run is (offset into the
// stage, first weight, count).
__kernel void correlate(__global const float *restrict in, __global const int *restrict sources,
                        __global const int *restrict beside, __global const int *restrict runs,
                        __global const float *restrict weights, __global Result *restrict out, int height, int width,
                        int reach, int tall, int stride, int band, int tile, int run_count, float value, float bias,
                        int capacity, int accumulate, int busy, __global const float *restrict numbers,
                        __global int *restrict counts)
{
    int x = get_global_id(0) * tile, y = get_global_id(1) * band;
    if (x >= width || y >= height)
        return;
    float stage[STAGE] __attribute__((aligned(64)));
    int moved[2] = {0, 0}, first = 0, held = 0, whole = (width & 15) == 0 && !busy;
    int rows = min(band, height - y), wide = min(tile, width - x), all = rows + tall - 1;
    int inner = busy && x >= reach && x - reach + stride <= width;
    for (int j = 0; j < rows; j += BLOCK) {
        int end = j + BLOCK + tall - 1, meanwhile = inner && end + BLOCK <= all;
        STAGED(j, end);
        // The next rows are staged while these are summed, or at least on their way.
        float *rest = stage + held * stride;
        __global const float *from[BLOCK];
        #pragma unroll
        for (int i = 0; i < BLOCK; i++) {
            int source = sources[y + min(end + i, all - 1)];
            meanwhile &= source >= 0;
            from[i] = in + (size_t)max(source, 0) * width + clamp(x - reach, 0, max(width - tile, 0));
        }
        held += meanwhile ? BLOCK : 0;
        int then = 0;
        for (; meanwhile && then < SOONER; then += 16)
            stage_next(rest + then, from, then, stride);
        for (int k = 0; k < wide; k += LANES) {
            #pragma unroll
            for (int v = 0; v < VECTORS; v++)
                if (meanwhile && then < stride) {
                    stage_next(rest + then, from, then, stride);
                    then += 16;
                }
            int soon = meanwhile ? then + SOONER : k;
            #pragma unroll
            for (int i = 0; i < BLOCK; i++) {
                stream_ask(from[i] + soon);
                stream_ask(from[i] + soon + 16);
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
                case 1: LIKE(1); break;
                case 2: LIKE(2); break;
                case 3: LIKE(3); break;
                case 4: LIKE(4); break;
                case 5: LIKE(5); break;
                case 6: LIKE(6); break;
                default: LIKE(LONGEST);
                }
            }
            __global Result *to = out + (size_t)(y + j) * width + x + k;
            #pragma unroll
            for (int i = 0; i < BLOCK; i++, to += width)
                if (j + i < rows)
                    put_result(to, TAIL(sums[i].v[0], numbers), TAIL(sums[i].v[1], numbers), wide - k, whole, accumulate,
                               moved);
        }
        for (; meanwhile && then < stride; then += 16)
            stage_next(rest + then, from, then, stride);
    }
    tell(moved, counts);
}
