// Medians of square windows, channel by channel: 16 floats at a time.
//
// One item owns a tile, which it stages with what lies around it, row by row.
//
// network (SIZE 3 and 5): the columns of the window are sorted once for all windows that share them. Then its rows are
//   sorted, which leaves the columns sorted, and all entries drop out that more than half of the others are known to
//   exceed, or to lie below. Of the rest the smallest and the largest are dropped until the median is left: any SIZE + 3
//   of 13 hold one that is too small and one that is too large.
// bisect (any size): the median's 32 bits are found from the highest down, by counting how many samples of the window
//   lie below. Floats are compared as integers in the same order.
//
// Where NANS is 1, exchanges carry a NaN to both sides, so one in the window is the result. Where it is 2, bisect counts
// what is left without them, and takes the lower of two middles.

#include "numeric.clh"
#include "staged.clh"

#if NANS == 1
#define MIN(a, b) num_min(a, b)
#define MAX(a, b) num_max(a, b)
#else
#define MIN(a, b) ((a) < (b) ? (a) : (b))
#define MAX(a, b) ((a) < (b) ? (b) : (a))
#endif

#define SORT(a, b)                                                                                                     \
    do {                                                                                                               \
        float16 lower = MIN(a, b);                                                                                     \
        b = MAX(a, b);                                                                                                 \
        a = lower;                                                                                                     \
    } while (0)

inline void put(__global float *to, float16 v, int count, int whole)
{
    if (count >= 16 && whole) {
        STREAM(v, (__global float16 *)to);
    } else if (count >= 16) {
        vstore16(v, 0, to);
    } else {
        float lanes[16];
        vstore16(v, 0, lanes);
        for (int i = 0; i < count; i++)
            to[i] = lanes[i];
    }
}

inline __attribute__((always_inline)) void sort3(float16 *v)
{
    SORT(v[0], v[1]);
    SORT(v[1], v[2]);
    SORT(v[0], v[1]);
}

inline __attribute__((always_inline)) void sort5(float16 *v)
{
    SORT(v[0], v[1]);
    SORT(v[3], v[4]);
    SORT(v[2], v[4]);
    SORT(v[2], v[3]);
    SORT(v[1], v[4]);
    SORT(v[0], v[3]);
    SORT(v[0], v[2]);
    SORT(v[1], v[3]);
    SORT(v[1], v[2]);
}

// The smallest of the first `count` to the front, the largest to their end.
inline __attribute__((always_inline)) void extremes(float16 *v, const int count)
{
    #pragma unroll
    for (int i = 0; i < count / 2; i++)
        SORT(v[i], v[count - 1 - i]);
    #pragma unroll
    for (int i = 1; i < (count + 1) / 2; i++)
        SORT(v[0], v[i]);
    #pragma unroll
    for (int i = count / 2; i < count - 1; i++)
        SORT(v[i], v[count - 1]);
}

#if SIZE == 3
#define SORT_LINE sort3
// Of sorted columns: the largest of the smallest, the middle of the middle and the smallest of the largest remain.
inline __attribute__((always_inline)) float16 middle(float16 v[SIZE][SIZE])
{
    float16 rest[3];
    rest[0] = MAX(MAX(v[0][0], v[0][1]), v[0][2]);
    sort3(v[1]);
    rest[1] = v[1][1];
    rest[2] = MIN(MIN(v[2][0], v[2][1]), v[2][2]);
    sort3(rest);
    return rest[1];
}
#elif SIZE == 5
#define SORT_LINE sort5
inline __attribute__((always_inline)) float16 middle(float16 v[SIZE][SIZE])
{
    #pragma unroll
    for (int i = 0; i < SIZE; i++)
        sort5(v[i]);
    // The smallest of these eight is among the first four, the largest among the others.
    float16 rest[8] = {v[0][3], v[1][2], v[2][1], v[3][0], v[1][4], v[2][3], v[3][2], v[4][1]};
    #pragma unroll
    for (int i = 1; i < 4; i++) {
        SORT(rest[0], rest[i]);
        SORT(rest[3 + i], rest[7]);
    }
    rest[0] = v[2][2];
    extremes(rest, 7);
    rest[0] = v[1][3];
    extremes(rest, 6);
    rest[0] = v[3][1];
    extremes(rest, 5);
    rest[0] = v[0][4];
    extremes(rest, 4);
    rest[0] = v[4][0];
    extremes(rest, 3);
    return rest[1];
}
#endif

#ifdef SORT_LINE
__kernel void network(__global const float *restrict in, __global const int *restrict sources,
                      __global const int *restrict beside, __global float *restrict out, int height, int width,
                      int channels, int stride, int band, int tile, int capacity, float value)
{
    int x = get_global_id(0) * tile, y = get_global_id(1) * band;
    if (x >= width || y >= height)
        return;
    float stage[STAGE] __attribute__((aligned(64))), lines[SIZE * LINE] __attribute__((aligned(64)));
    int rows = min(band, height - y), wide = min(tile, width - x), all = rows + SIZE - 1, whole = (width & 15) == 0;
    int reach = SIZE / 2 * channels, first = 0, held = 0;
    for (int j = 0; j < rows; j++) {
        STAGED(j, j + SIZE);
        __global const float *ahead = in + (size_t)max(sources[y + min(j + SIZE, all - 1)], 0) * width;
        ahead += clamp(x - reach, 0, max(width - stride, 0));
        const float *p = stage + (j - first) * stride;
        for (int i = 0; i < stride; i += 16) {
            stream_ask(ahead + i);
            float16 column[SIZE];
            #pragma unroll
            for (int k = 0; k < SIZE; k++)
                column[k] = vload16(0, p + k * stride + i);
            SORT_LINE(column);
            #pragma unroll
            for (int k = 0; k < SIZE; k++)
                vstore16(column[k], 0, lines + k * LINE + i);
        }
        for (int i = 0; i < wide; i += 16) {
            float16 v[SIZE][SIZE];
            #pragma unroll
            for (int k = 0; k < SIZE; k++)
                #pragma unroll
                for (int c = 0; c < SIZE; c++)
                    v[k][c] = vload16(0, lines + k * LINE + i + c * channels);
            put(out + (size_t)(y + j) * width + x + i, middle(v), wide - i, whole);
        }
    }
}
#endif

#if SIZE == 0
// Integers in the order of the floats, and back; it is its own inverse.
inline int16 ordered(int16 bits) { return bits ^ ((bits >> 31) & 0x7fffffff); }

__kernel void bisect(__global const float *restrict in, __global const int *restrict sources,
                     __global const int *restrict beside, __global float *restrict out, int height, int width,
                     int channels, int stride, int band, int tile, int capacity, float value, int size)
{
    int x = get_global_id(0) * tile, y = get_global_id(1) * band;
    if (x >= width || y >= height)
        return;
    float stage[STAGE] __attribute__((aligned(64)));
    int rows = min(band, height - y), wide = min(tile, width - x), all = rows + size - 1;
    int reach = size / 2 * channels, first = 0, held = 0, whole = (width & 15) == 0;
    for (int j = 0; j < rows; j++) {
        STAGED(j, j + size);
        for (int i = 0; i < wide; i += 16) {
            const float *corner = stage + (j - first) * stride + i;
            int16 found = (int16)(INT_MIN), bad = (int16)(0);
            for (int k = 0; k < size; k++)
                for (int c = 0; c < size; c++) {
                    float16 v = vload16(0, corner + k * stride + c * channels);
                    bad -= v != v;
                }
            int16 others = NANS == 2 ? size * size - 1 - bad : (int16)(size * size - 1);
            for (int bit = 31; bit >= 0; bit--) {
                // The largest number that no more than half of the others lie below, bit by bit.
                int16 tried = found + (int16)((int)(1u << bit)), count = (int16)(0);
                for (int k = 0; k < size; k++)
                    for (int c = 0; c < size; c++)
                        count -= ordered(as_int16(vload16(0, corner + k * stride + c * channels))) < tried;
                found = count <= others / 2 ? tried : found;
            }
            float16 middle = (NANS == 2 ? others < 0 : bad > 0) ? (float16)(NAN) : as_float16(ordered(found));
            put(out + (size_t)(y + j) * width + x + i, middle, wide - i, whole);
        }
    }
}
#endif
