/* Pixels as the warps read them: blocks of four channels, what is missing filled with 0; and the levels of a pyramid. */

#include "places.clh"

/* Four channels from `channel` on, of an image of `stride` channels. */
kernel void spread(global const float *restrict image, global float *restrict out, int pixels, int stride, int channel) {
    const int first = get_global_id(0) * SEGMENT, count = min(SEGMENT, pixels - first), taken = min(4, stride - channel);
    for (int i = 0; i < count; ++i) {
        global const float *p = image + (size_t)(first + i) * stride + channel;
        const float4 v = {p[0], taken > 1 ? p[1] : 0.0f, taken > 2 ? p[2] : 0.0f, taken > 3 ? p[3] : 0.0f};
        vstore4(v, first + i, out);
    }
}

/* Means of 2 x 2 samples: a level of half the width and height, rounded up. */
kernel void halve(global const float *restrict from, global float *restrict pyramid, int start, int end, int columns,
                  int rows, int border, float value) {
    const int first = get_global_id(0) * SEGMENT, row = get_global_id(1), width = (columns + 1) / 2;
    const Picture picture = {from ? from : pyramid + (size_t)CHANNELS * start, columns, rows, border, value};
    if (row >= (rows + 1) / 2) return;
    global float *out = pyramid + (size_t)CHANNELS * (end + (size_t)row * width);
    for (int x = first; x < min(first + SEGMENT, width); ++x) {
        T a, b, c, d;
        if (2 * x + 1 < columns && 2 * row + 1 < rows) {
            global const float *p = picture.pixels + CHANNELS * ((size_t)2 * row * columns + 2 * x);
            a = LOAD(p);
            b = LOAD(p + CHANNELS);
            c = LOAD(p + CHANNELS * (size_t)columns);
            d = LOAD(p + CHANNELS * ((size_t)columns + 1));
        } else {
            a = fetch(&picture, 2 * x, 2 * row);
            b = fetch(&picture, 2 * x + 1, 2 * row);
            c = fetch(&picture, 2 * x, 2 * row + 1);
            d = fetch(&picture, 2 * x + 1, 2 * row + 1);
        }
        const T mean = 0.25f * ((a + b) + (c + d));
#if CHANNELS == 1
        out[x] = mean;
#else
        vstore4(mean, x, out);
#endif
    }
}

/* The sum of every row, in doubles. */
kernel void sum_rows(global const float *restrict image, global double *restrict sums, int columns, int rows) {
    const int row = get_global_id(0);
    if (row >= rows) return;
    global const float *p = image + (size_t)CHANNELS * row * columns;
#if CHANNELS == 1
    double8 many = 0.0;
    int x = 0;
    for (; x + 8 <= columns; x += 8) many += convert_double8(vload8(0, p + x));
    double sum = ((many.s0 + many.s4) + (many.s1 + many.s5)) + ((many.s2 + many.s6) + (many.s3 + many.s7));
    for (; x < columns; ++x) sum += p[x];
    sums[row] = sum;
#else
    double4 even = 0.0, odd = 0.0;
    int x = 0;
    for (; x + 2 <= columns; x += 2) {
        even += convert_double4(vload4(x, p));
        odd += convert_double4(vload4(x + 1, p));
    }
    if (x < columns) even += convert_double4(vload4(x, p));
    vstore4(even + odd, row, sums);
#endif
}
