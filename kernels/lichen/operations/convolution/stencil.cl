// Correlation with a two-dimensional kernel, channels interleaved.
//
// One item owns a tile of BAND rows by TILE floats. It first gathers the tile and what lies around it into private
// memory, border included, after which nothing has to know about borders, and images whose rows lie a power of two apart
// do not fight for the same cache sets. Then eight output rows by 32 floats at a time live in registers. The kernel
// comes as `runs`: stretches of non-zero taps down one of its columns. Each staged vector of a run's column is loaded
// once and serves all of the eight rows it reaches.
//
// A zero tap is in no run, so no NaN leaves the taps that are there. `width` and all strides count floats.

#define BLOCK 8
#define LANES 32

// A store that does not fetch what it overwrites.
#if defined(__has_builtin)
#if __has_builtin(__builtin_nontemporal_store)
#define STREAM(vector, to) __builtin_nontemporal_store(vector, to)
#endif
#endif
#ifndef STREAM
#define STREAM(vector, to) (*(to) = (vector))
#endif

#define ONE(j, t)                                                                                                      \
    do {                                                                                                               \
        low[j] = fma((float16)(weights[t]), a, low[j]);                                                                \
        high[j] = fma((float16)(weights[t]), b, high[j]);                                                              \
    } while (0)

// A run of `count` < BLOCK taps; `count` is a literal where this is called, so that everything unrolls.
inline __attribute__((always_inline)) void short_run(const float *p, int stride, __global const float *weights,
                                                     float16 *low, float16 *high, const int count)
{
    #pragma unroll
    for (int s = 0; s < BLOCK + count - 1; s++) {
        float16 a = vload16(0, p + s * stride), b = vload16(1, p + s * stride);
        #pragma unroll
        for (int i = 0; i < BLOCK; i++)
            if (s - i >= 0 && s - i < count) 
                ONE(i, s - i);
    }
}

inline __attribute__((always_inline)) void long_run(const float *p, int stride, __global const float *weights,
                                                    float16 *low, float16 *high, int count)
{
    #pragma unroll
    for (int t = 0; t < BLOCK - 1; t++) {
        float16 a = vload16(0, p + t * stride), b = vload16(1, p + t * stride);
        #pragma unroll
        for (int i = 0; i <= t; i++)
            ONE(i, t - i);
    }
    for (int t = BLOCK - 1; t < count; t++) {
        float16 a = vload16(0, p + t * stride), b = vload16(1, p + t * stride);
        #pragma unroll
        for (int i = 0; i < BLOCK; i++)
            ONE(i, t - i);
    }
    #pragma unroll
    for (int s = 0; s < BLOCK - 1; s++) {
        float16 a = vload16(0, p + (count + s) * stride), b = vload16(1, p + (count + s) * stride);
        #pragma unroll
        for (int i = s + 1; i < BLOCK; i++)
            ONE(i, count + s - i);
    }
}

// All runs of `count` taps, from run r on.
#define LIKE(count, body)                                                                                              \
    do {                                                                                                               \
        body(p + runs[3 * r], stride, weights + runs[3 * r + 1], low, high, count);                                    \
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
            float16 low[BLOCK], high[BLOCK];
            #pragma unroll
            for (int i = 0; i < BLOCK; i++)
                low[i] = high[i] = (float16)(bias);
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
                    STREAM(low[i], (__global float16 *)to);
                    STREAM(high[i], (__global float16 *)to + 1);
                } else if (count == LANES && !accumulate) {
                    vstore16(low[i], 0, to);
                    vstore16(high[i], 1, to);
                } else {
                    float sums[LANES];
                    vstore16(low[i], 0, sums);
                    vstore16(high[i], 1, sums);
                    for (int c = 0; c < count; c++)
                        to[c] = accumulate ? to[c] + sums[c] : sums[c];
                }
            }
        }
    }
}
