// Correlation with a two-dimensional kernel, channels interleaved.
//
// One item owns a tile of BAND rows by TILE floats. It first gathers the tile and what lies around it into private
// memory, border included, after which nothing has to know about borders, and images whose rows lie a power of two apart
// do not fight for the same cache sets. Then BLOCK output rows by LANES floats at a time live in registers: as many as
// there are. The kernel comes as `runs`: stretches of non-zero taps down one of its columns. Each staged vector of a
// run's column is loaded once and serves all of the rows it reaches.
//
// A zero tap is in no run, so no NaN leaves the taps that are there. `width` and all strides count floats.

#include "strips.clh"

// A store that does not fetch what it overwrites.
#if defined(__has_builtin)
#if __has_builtin(__builtin_nontemporal_store)
#define STREAM(vector, to) __builtin_nontemporal_store(vector, to)
#endif
#endif
#ifndef STREAM
#define STREAM(vector, to) (*(to) = (vector))
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
                        int accumulate)
{
    int x = get_global_id(0) * tile, y = get_global_id(1) * band;
    if (x >= width || y >= height)
        return;
    float stage[STAGE];
    int aligned = (width & 15) == 0;
    int rows = min(band, height - y), wide = min(tile, width - x), staged = rows + tall - 1;
    int inside = x - reach >= 0 && x - reach + stride <= width;
    for (int j = 0; j < staged; j++) {
        int source = sources[y + j];
        float *to = stage + j * stride;
        __global const float *row = in + (size_t)max(source, 0) * width;
        if (source < 0) {
            for (int i = 0; i < stride; i += 16)
                vstore16((float16)(value), 0, to + i);
        } else if (inside) {
            for (int i = 0; i < stride; i += 16)
                vstore16(vload16(0, row + x - reach + i), 0, to + i);
        } else {
            for (int i = 0; i < stride; i++) {
                int from = beside[x + i];
                to[i] = from < 0 ? value : row[from];
            }
        }
    }
    for (int j = 0; j < rows; j += BLOCK) {
        for (int k = 0; k < wide; k += LANES) {
            Strip sums[BLOCK];
            #pragma unroll
            for (int i = 0; i < BLOCK; i++)
                #pragma unroll
                for (int v = 0; v < VECTORS; v++)
                    sums[i].v[v] = (float16)(bias);
            const float *p = stage + j * stride + k;
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
            int count = min(LANES, wide - k);
            #pragma unroll
            for (int i = 0; i < BLOCK; i++, to += width) {
                if (j + i >= rows)
                    continue;
                if (count == LANES && !accumulate && aligned) {
                    #pragma unroll
                    for (int v = 0; v < VECTORS; v++)
                        STREAM(sums[i].v[v], (__global float16 *)to + v);
                } else if (count == LANES && !accumulate) {
                    #pragma unroll
                    for (int v = 0; v < VECTORS; v++)
                        vstore16(sums[i].v[v], v, to);
                } else {
                    float each[LANES];
                    #pragma unroll
                    for (int v = 0; v < VECTORS; v++)
                        vstore16(sums[i].v[v], v, each);
                    for (int c = 0; c < count; c++)
                        to[c] = accumulate ? to[c] + each[c] : each[c];
                }
            }
        }
    }
}
