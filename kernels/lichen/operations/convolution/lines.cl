// Filters that run along whole lines of an image, which come out transposed: twice, and it is as it was.
//
// The image is a matrix of `rows` x `width` floats. Samples of one line lie `step` rows apart: 1 down the image, whose
// rows are floats side by side; the number of channels after that, when what was a float of a row is a row. An item takes
// LANES columns, those `items` times as many further on and so forth. It runs along them in its own part of the scratch
// memory and stores them as rows, 16 x 16 floats at a time.
//
// recurse: PAIRS of complex states, each c[n] = p c[n - 1] + x[n], once from either end; the result is the sum of the
//   real parts of a c. States before the first and after the last sample come from `before` and `after`: which samples
//   they are sums of, and by which weights (`begin_weights`, 2 PAIRS of them for each sample); index -1 is the constant.
// boxes: three running means in a row, each of `2 r + 1` samples and a part of one more at either end.

#include "stream.clh"

#define LANES 16
// Samples of a line that are asked for before they are needed, since they lie too far apart for the processor to foresee
// them: 0.83 to 0.92 of the time at 12 megapixels, and nothing where the image fits into a cache.
#define AHEAD 16

inline float16 fetch(__global const float *from, int wide)
{
    if (wide == LANES)
        return vload16(0, from);
    float lanes[LANES];
    for (int i = 0; i < LANES; i++)
        lanes[i] = i < wide ? from[i] : 0.0f;
    return vload16(0, lanes);
}

inline __attribute__((always_inline)) void interleave(const float16 *v, float16 *to)
{
    #pragma unroll
    for (int i = 0; i < 8; i++) {
        float16 a = v[i], b = v[i + 8];
        to[2 * i] = (float16)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3, a.s4, b.s4, a.s5, b.s5, a.s6, b.s6, a.s7,
                              b.s7);
        to[2 * i + 1] = (float16)(a.s8, b.s8, a.s9, b.s9, a.sa, b.sa, a.sb, b.sb, a.sc, b.sc, a.sd, b.sd, a.se, b.se,
                                  a.sf, b.sf);
    }
}

// `rows` vectors of `scratch` become `wide` rows of `out`.
inline void transposed(__global const float *scratch, __global float *out, int rows, int wide, int stride)
{
    for (int i = 0; i < rows; i += 16) {
        float16 v[16], w[16];
        int count = min(16, rows - i);
        #pragma unroll
        for (int k = 0; k < 16; k++)
            v[k] = vload16(i + min(k, count - 1), scratch);
        interleave(v, w);
        interleave(w, v);
        interleave(v, w);
        interleave(w, v);
        if (count == 16 && wide == LANES) {
            #pragma unroll
            for (int k = 0; k < LANES; k++)
                vstore16(v[k], 0, out + (size_t)k * stride + i);
        } else {
            for (int k = 0; k < wide; k++) {
                float lanes[16];
                vstore16(v[k], 0, lanes);
                for (int j = 0; j < count; j++)
                    out[(size_t)k * stride + i + j] = lanes[j];
            }
        }
    }
}

#ifdef PAIRS
inline __attribute__((always_inline)) void begin(float16 *re, float16 *im, __global const float *in, int in_stride,
                                                 int step, __global const int *at, __global const float *weights,
                                                 int count, int wide, float value)
{
    #pragma unroll
    for (int k = 0; k < PAIRS; k++)
        re[k] = im[k] = (float16)(0.0f);
    for (int j = 0; j < count; j++, weights += 2 * PAIRS) {
        float16 x = at[j] < 0 ? (float16)(value) : fetch(in + (size_t)at[j] * step * in_stride, wide);
        #pragma unroll
        for (int k = 0; k < PAIRS; k++) {
            re[k] = fma((float16)(weights[2 * k]), x, re[k]);
            im[k] = fma((float16)(weights[2 * k + 1]), x, im[k]);
        }
    }
}

// `filter` holds for each pair p, a and a p, as real and imaginary parts.
__kernel void recurse(__global const float *restrict in, __global const int *restrict before,
                      __global const float *restrict before_weights, __global const int *restrict after,
                      __global const float *restrict after_weights, __global const float *restrict filter,
                      __global float *restrict scratch, __global float *restrict out, int rows, int width,
                      int in_stride, int out_stride, int step, int items, int before_count, int after_count,
                      float value)
{
    int item = get_global_id(0);
    if (item >= items)
        return;
    __global float *sums = scratch + (size_t)item * LANES * rows;
    float pr[PAIRS], pi[PAIRS], ar[PAIRS], ai[PAIRS], br[PAIRS], bi[PAIRS];
    #pragma unroll
    for (int k = 0; k < PAIRS; k++) {
        pr[k] = filter[6 * k];
        pi[k] = filter[6 * k + 1];
        ar[k] = filter[6 * k + 2];
        ai[k] = filter[6 * k + 3];
        br[k] = filter[6 * k + 4];
        bi[k] = filter[6 * k + 5];
    }
    for (int x = item * LANES; x < width; x += items * LANES) {
        int wide = min(LANES, width - x);
        for (int c = 0; c < step; c++) {
            __global const float *line = in + x + (size_t)c * in_stride;
            float16 re[PAIRS], im[PAIRS];
            begin(re, im, line, in_stride, step, before, before_weights, before_count, wide, value);
            for (int i = c; i < rows; i += step) {
                stream_ask(in + x + (size_t)(i + AHEAD * step) * in_stride);
                float16 s = fetch(in + x + (size_t)i * in_stride, wide), y = (float16)(0.0f);
                #pragma unroll
                for (int k = 0; k < PAIRS; k++) {
                    float16 old = re[k];
                    re[k] = fma((float16)(pr[k]), old, fma((float16)(-pi[k]), im[k], s));
                    im[k] = fma((float16)(pr[k]), im[k], (float16)(pi[k]) * old);
                    y = fma((float16)(ar[k]), re[k], fma((float16)(-ai[k]), im[k], y));
                }
                vstore16(y, i, sums);
            }
            begin(re, im, line, in_stride, step, after, after_weights, after_count, wide, value);
            for (int i = rows - step + c; i >= 0; i -= step) {
                float16 s = fetch(in + x + (size_t)i * in_stride, wide), y = vload16(i, sums);
                #pragma unroll
                for (int k = 0; k < PAIRS; k++) {
                    float16 old = re[k];
                    y = fma((float16)(br[k]), old, fma((float16)(-bi[k]), im[k], y));
                    re[k] = fma((float16)(pr[k]), old, fma((float16)(-pi[k]), im[k], s));
                    im[k] = fma((float16)(pr[k]), im[k], (float16)(pi[k]) * old);
                }
                vstore16(y, i, sums);
            }
        }
        transposed(sums, out + (size_t)x * out_stride, rows, wide, out_stride);
    }
}
#endif

// One running mean along `count` vectors: 2 r + 1 of them and `part` of one more at either end, times `scale`. The result
// lies where the window begins, or in every `step`-th vector of `out`.
inline void box(__global const float *line, __global float *out, int count, int r, int step, float part, float scale)
{
    float16 sum = (float16)(0.0f);
    int n = 2 * r + 1;
    for (int i = 1; i <= n; i++)
        sum += vload16(i, line);
    for (int i = 0; i < count; i++) {
        float16 left = vload16(i + n + 1, line), gone = vload16(i + 1, line);
        float16 ends = vload16(i, line) + left;
        vstore16(fma((float16)(part), ends, sum) * (float16)(scale), (size_t)i * step, out);
        sum += left - gone;
    }
}

// `sources` names for each sample of a line continued by the reach of all three boxes the sample it comes from.
__kernel void boxes(__global const float *restrict in, __global const int *restrict sources,
                    __global const int *restrict radii, __global float *lines, __global float *sums,
                    __global float *restrict out, int rows, int width, int in_stride, int out_stride, int step,
                    int items, int count, float part, float value)
{
    int item = get_global_id(0);
    if (item >= items)
        return;
    __global float *line = lines + (size_t)item * LANES * count, *sum = sums + (size_t)item * LANES * rows;
    for (int x = item * LANES; x < width; x += items * LANES) {
        int wide = min(LANES, width - x);
        for (int c = 0; c < step; c++) {
            int left = count;
            for (int i = 0; i < count; i++) {
                int later = sources[min(i + AHEAD, count - 1)];
                stream_ask(in + x + ((size_t)max(later, 0) * step + c) * in_stride);
                __global const float *from = in + x + ((size_t)max(sources[i], 0) * step + c) * in_stride;
                vstore16(sources[i] < 0 ? (float16)(value) : fetch(from, wide), i, line);
            }
            for (int k = 0; k < 3; k++) {
                left -= 2 * radii[k] + 2;
                float scale = 1.0f / (2 * radii[k] + 1 + 2 * part);
                if (k < 2)
                    box(line, line, left, radii[k], 1, part, scale);
                else
                    box(line, sum + c * LANES, left, radii[k], step, part, scale);
            }
        }
        transposed(sum, out + (size_t)x * out_stride, rows, wide, out_stride);
    }
}
