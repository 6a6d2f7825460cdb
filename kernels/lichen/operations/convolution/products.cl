// Products of a small matrix with a wide one: what transforms and folded kernels come down to.
//
// multiply: out (I x M) = left (I x J) times in (J x M), `left` given transposed as (J x I). One item owns a strip of 32
//   columns. 128 rows of the strip are copied to private memory at a time and meet all rows of `left` there, eight at
//   once. Partial sums of 128 terms are added up afterwards, which also keeps the rounding of long sums small. Row i of
//   the result starts from start[i].
// apart: the same, one float an item, for devices whose items step together and share a cache.
// flip: (rows x columns) groups of `channels` floats, transposed.

#include "stream.clh"

#define STRIP 32
#define DEPTH 128
#define BLOCK 8
#define AHEAD 8 // rows that are asked for before they are needed, since they lie too far apart to be foreseen

__kernel void multiply(__global const float *restrict left, __global const float *restrict in,
                       __global const float *restrict start, __global float *restrict out, int count, int depth,
                       int width)
{
    int x = get_global_id(0) * STRIP;
    if (x >= width)
        return;
    int wide = min(STRIP, width - x);
    float stage[DEPTH * STRIP];
    for (int first = 0; first < depth; first += DEPTH) {
        int terms = min(DEPTH, depth - first);
        for (int j = 0; j < terms; j++) {
            __global const float *from = in + (size_t)(first + j) * width + x;
            float *to = stage + j * STRIP;
            stream_ask(from + (size_t)AHEAD * width);
            stream_ask(from + (size_t)AHEAD * width + 16);
            if (wide == STRIP) {
                vstore16(vload16(0, from), 0, to);
                vstore16(vload16(1, from), 1, to);
            } else {
                for (int i = 0; i < STRIP; i++)
                    to[i] = i < wide ? from[i] : 0.0f;
            }
        }
        for (int i = 0; i < count; i += BLOCK) {
            // The last block steps back and computes some rows again, so that no block is short.
            int row = max(0, min(i, count - BLOCK)), lanes = min(BLOCK, count);
            float16 low[BLOCK], high[BLOCK];
            __global const float *l = left + (size_t)first * count + row;
            #pragma unroll
            for (int k = 0; k < BLOCK; k++)
                low[k] = high[k] = (float16)0.0f;
            if (lanes == BLOCK) {
                for (int j = 0; j < terms; j++, l += count) {
                    float16 a = vload16(0, stage + j * STRIP), b = vload16(1, stage + j * STRIP);
                    #pragma unroll
                    for (int k = 0; k < BLOCK; k++) {
                        low[k] = fma((float16)(l[k]), a, low[k]);
                        high[k] = fma((float16)(l[k]), b, high[k]);
                    }
                }
            } else {
                for (int j = 0; j < terms; j++, l += count) {
                    float16 a = vload16(0, stage + j * STRIP), b = vload16(1, stage + j * STRIP);
                    for (int k = 0; k < lanes; k++) {
                        low[k] = fma((float16)(l[k]), a, low[k]);
                        high[k] = fma((float16)(l[k]), b, high[k]);
                    }
                }
            }
            for (int k = max(0, i - row); k < lanes; k++) { // rows below `i` already hold this block's terms
                __global float *to = out + (size_t)(row + k) * width + x;
                if (wide == STRIP) {
                    float16 a = first ? vload16(0, to) : (float16)(start[row + k]);
                    float16 b = first ? vload16(1, to) : (float16)(start[row + k]);
                    vstore16(a + low[k], 0, to);
                    vstore16(b + high[k], 1, to);
                    continue;
                }
                float sums[STRIP];
                vstore16(low[k], 0, sums);
                vstore16(high[k], 1, sums);
                for (int c = 0; c < wide; c++)
                    to[c] = (first ? to[c] : start[row + k]) + sums[c];
            }
        }
    }
}

__kernel void apart(__global const float *restrict left, __global const float *restrict in,
                    __global const float *restrict start, __global float *restrict out, int count, int depth, int width)
{
    int x = get_global_id(0), i = get_global_id(1);
    if (x >= width || i >= count)
        return;
    float total = start[i];
    for (int first = 0; first < depth; first += DEPTH) {
        float sum = 0.0f;
        for (int j = first; j < min(first + DEPTH, depth); j++)
            sum = fma(left[(size_t)j * count + i], in[(size_t)j * width + x], sum);
        total += sum;
    }
    out[(size_t)i * width + x] = total;
}

__kernel void flip(__global const float *restrict in, __global float *restrict out, int rows, int columns,
                   int channels)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= columns || y >= rows)
        return;
    for (int c = 0; c < channels; c++)
        out[((size_t)x * rows + y) * channels + c] = in[((size_t)y * columns + x) * channels + c];
}
