// Separable convolution of rows of floats, channels interleaved.
//
// both: in one pass over the image. A tile's rows are filtered along as they are staged, and BLOCK output rows at a time
//   are summed down what came out. For kernels of which private memory holds the rows; the others take two passes:
// columns: down the image. A strip of 32 floats is first gathered into private memory, so that images whose rows lie a
//   power of two apart do not fight for the same cache sets; then BLOCK output rows share each load.
// margins: continues the rows left and right, after which no kernel has to know about borders.
// rows: along the image, from a padded row; 64 floats at a time with four independent sums.
//
// `width` and all strides count floats.
//
// No zero weight is ever multiplied with a sample: 0 x NaN would carry NaN beyond the kernel.

#include "staged.clh"
#include "strips.clh"

#define STRIP 32
#define BAND 64
#define CHUNK 128
#define SEGMENT 64
#define RUN 1024

#ifdef STAGE
// One row of a tile, from the staged `line`. What the next is made of is on its way from `ahead` meanwhile.
STAGED_FN void along(const float *line, float *to, __global const Sample *ahead, __global const float *weights, int tile,
                     int channels, int count)
{
    for (int i = 0; i < tile; i += SEGMENT) {
        const float *p = line + i;
        float16 s0 = (float16)(0.0f), s1 = s0, s2 = s0, s3 = s0;
        #pragma unroll
        for (int k = 0; k < SEGMENT; k += 16)
            stream_ask((__global const float *)(ahead + i + k));
        for (int t = 0; t < count; t++, p += channels) {
            float16 w = (float16)(weights[t]);
            s0 = fma(w, vload16(0, p), s0);
            s1 = fma(w, vload16(1, p), s1);
            s2 = fma(w, vload16(2, p), s2);
            s3 = fma(w, vload16(3, p), s3);
        }
        vstore16(s0, 0, to + i);
        vstore16(s1, 1, to + i);
        vstore16(s2, 2, to + i);
        vstore16(s3, 3, to + i);
    }
}

// One item: `band` rows of a tile, by `tall` taps down and `wide` along. `sources` names for output row y and tap t, at
// y + t, the row to read, `beside` for a float of the tile and its margin the float of the row; -1 is the constant.
// `reach` floats lie left of the tile, and there is room for `capacity` rows.
__kernel void both(__global const Sample *restrict in, __global const float *restrict meant,
                   __global const int *restrict sources, __global const int *restrict beside,
                   __global const float *restrict down, __global const float *restrict across,
                   __global Result *restrict out, int height, int width, int reach, int stride, int band, int tile,
                   int channels, int tall, int wide, int capacity, __global const float *restrict numbers,
                   __global int *restrict counts, float value, float bias, int accumulate)
{
    int x = get_global_id(0) * tile, y = get_global_id(1) * band;
    if (x >= width || y >= height)
        return;
    float stage[STAGE] __attribute__((aligned(64))), line[MARGIN] __attribute__((aligned(64)));
    // A pitch of a power of two would have rows fight for the same cache sets.
    int rows = min(band, height - y), all = rows + tall - 1, pitch = tile + 16, first = 0, held = 0;
    int moved[2] = {0, 0}, count = min(tile, width - x), whole = (width & 15) == 0;
    for (int j = 0; j < rows; j += BLOCK) {
        int end = j + BLOCK + tall - 1;
        if (end - first > capacity) {
            move_up(stage, j - first, held, pitch);
            held -= j - first;
            first = j;
        }
        for (; first + held < min(end, all); held++) {
            int r = y + first + held;
            __global const Sample *ahead = in + (size_t)max(sources[min(r + 1, y + all - 1)], 0) * width;
            stage_row(line, in, meant, beside, sources[r], x, reach, stride, width, value);
            along(line, stage + held * pitch, ahead + clamp(x - reach, 0, max(width - tile, 0)), across, tile, channels,
                  wide);
        }
        for (int k = 0; k < count; k += LANES) {
            Strip sums[BLOCK];
            #pragma unroll
            for (int i = 0; i < BLOCK; i++)
                sums[i].v[0] = sums[i].v[1] = (float16)(bias);
            const float *p = stage + (j - first) * pitch + k;
            long_run(p, pitch, down, sums, tall);
            __global Result *to = out + (size_t)(y + j) * width + x + k;
            #pragma unroll
            for (int i = 0; i < BLOCK; i++, to += width)
                if (j + i < rows)
                    put_result(to, TAIL(sums[i].v[0], numbers), TAIL(sums[i].v[1], numbers), count - k, whole, accumulate,
                               moved);
        }
    }
    tell(moved, counts);
}
#endif

inline void store_strip(__global float *out, const float *sums, int count, int accumulate)
{
    for (int i = 0; i < count; i++)
        out[i] = accumulate ? out[i] + sums[i] : sums[i];
}

// One item: rows [y, y + BAND) of one strip, by `count` taps of the kernel. `sources` names for output row y and tap t,
// at y + t, the row to read, or -1 for the constant. The taps after the first CHUNK add to what is there.
__kernel void columns(__global const float *restrict in, __global const int *restrict sources,
                      __global const float *restrict weights, __global float *restrict out, int height, int width,
                      int out_stride, int out_offset, int count, float value, int accumulate)
{
    int x = get_global_id(0) * STRIP, y = get_global_id(1) * BAND;
    if (x >= width || y >= height)
        return;
    float stage[(BAND + CHUNK) * STRIP];
    int rows = min(BAND, height - y), wide = min(STRIP, width - x), staged = rows + count - 1;
    for (int j = 0; j < staged; j++) {
        int source = sources[y + j];
        float *to = stage + j * STRIP;
        __global const float *from = in + (size_t)max(source, 0) * width + x;
        if (source < 0) {
            vstore16((float16)value, 0, to);
            vstore16((float16)value, 1, to);
        } else if (wide == STRIP) {
            vstore16(vload16(0, from), 0, to);
            vstore16(vload16(1, from), 1, to);
        } else {
            for (int i = 0; i < STRIP; i++)
                to[i] = i < wide ? from[i] : 0.0f;
        }
    }
    __global float *row = out + (size_t)y * out_stride + out_offset + x;
    int j = 0;
    for (; j + BLOCK <= rows; j += BLOCK)
        for (int x0 = 0; x0 < STRIP; x0 += LANES) {
            Strip sums[BLOCK];
            #pragma unroll
            for (int i = 0; i < BLOCK; i++)
                #pragma unroll
                for (int k = 0; k < VECTORS; k++)
                    sums[i].v[k] = (float16)0.0f;
            long_run(stage + j * STRIP + x0, STRIP, weights, sums, count);
            #pragma unroll
            for (int i = 0; i < BLOCK; i++) {
                __global float *to = row + (size_t)(j + i) * out_stride + x0;
                float kept[LANES];
                #pragma unroll
                for (int k = 0; k < VECTORS; k++)
                    if (wide == STRIP && !accumulate)
                        vstore16(sums[i].v[k], k, to);
                    else
                        vstore16(sums[i].v[k], k, kept);
                if (wide != STRIP || accumulate)
                    store_strip(to, kept, min(LANES, wide - x0), accumulate);
            }
        }
    for (; j < rows; j++) {
        float16 low = (float16)0.0f, high = (float16)0.0f;
        for (int t = 0; t < count; t++) {
            low = fma((float16)(weights[t]), vload16(0, stage + (j + t) * STRIP), low);
            high = fma((float16)(weights[t]), vload16(1, stage + (j + t) * STRIP), high);
        }
        float sums[STRIP];
        vstore16(low, 0, sums);
        vstore16(high, 1, sums);
        store_strip(row + (size_t)j * out_stride, sums, wide, accumulate);
    }
}

// One item: one row. `pixels` of margin on each side are filled from the row itself; -1 stands for the constant.
__kernel void margins(__global float *restrict padded, __global const int *restrict sources, int height, int stride,
                      int pixels, int width, int channels, float value)
{
    int y = get_global_id(0);
    if (y >= height)
        return;
    __global float *row = padded + (size_t)y * stride, *inner = row + pixels * channels;
    for (int i = 0; i < 2 * pixels; i++) {
        int source = sources[i];
        __global float *to = i < pixels ? row + i * channels : inner + (width + i - pixels) * channels;
        for (int c = 0; c < channels; c++)
            to[c] = source < 0 ? value : inner[source * channels + c];
    }
}

// One item: RUN floats of one row.
__kernel void rows(__global const float *restrict padded, __global const float *restrict weights,
                   __global float *restrict out, int height, int width, int stride, int channels, int count)
{
    int start = get_global_id(0) * RUN, y = get_global_id(1);
    if (start >= width || y >= height)
        return;
    int end = min(start + RUN, width);
    for (int x = start; x < end; x += SEGMENT) {
        __global const float *p = padded + (size_t)y * stride + x;
        float16 s0 = (float16)0.0f, s1 = s0, s2 = s0, s3 = s0;
        for (int t = 0; t < count; t++, p += channels) {
            float16 w = (float16)(weights[t]);
            s0 = fma(w, vload16(0, p), s0);
            s1 = fma(w, vload16(1, p), s1);
            s2 = fma(w, vload16(2, p), s2);
            s3 = fma(w, vload16(3, p), s3);
        }
        __global float *to = out + (size_t)y * width + x;
        if (x + SEGMENT <= width) {
            vstore16(s0, 0, to);
            vstore16(s1, 1, to);
            vstore16(s2, 2, to);
            vstore16(s3, 3, to);
        } else {
            float sums[SEGMENT];
            vstore16(s0, 0, sums);
            vstore16(s1, 1, sums);
            vstore16(s2, 2, sums);
            vstore16(s3, 3, sums);
            for (int i = 0; i < width - x; i++)
                to[i] = sums[i];
        }
    }
}
