// What the kernels of this folder make of a pixel's neighbours, one float an item: for devices whose items step together
// (and `fitted`, for all).
// There thousands of items are on their way at once and share a cache, so nothing is staged. A tile in the private memory
// of every item, as on a processor, would be kept for all of them in the device's memory, tens of gigabytes.
//
// `rows` names for output row y and row t of its window, at y + t, the row to read, `columns` for a float of a row and
// column t of its window, at x + t * channels, the float of the row; -1 is the constant. `width` counts floats.

inline float neighbour(__global const float *in, int row, int column, int width, float value)
{
    return row < 0 || column < 0 ? value : in[(size_t)row * width + column];
}

// Taps that are not zero: (row, float) of the window for each, and its weight.
__kernel void correlate(__global const float *restrict in, __global const int *restrict rows,
                        __global const int *restrict columns, __global float *restrict out, int height, int width,
                        int channels, float value, __global const int2 *restrict places,
                        __global const float *restrict weights, int count, float bias, int accumulate)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    float sum = bias;
    for (int t = 0; t < count; t++)
        sum = fma(weights[t], neighbour(in, rows[y + places[t].x], columns[x + places[t].y], width, value), sum);
    __global float *to = out + (size_t)y * width + x;
    *to = accumulate ? *to + sum : sum;
}

// The slope of the plane that fits those of nine neighbours that are no NaN: `taps` has nine for each set of them, and
// sample 3 y + x the bit 2^(3 y + x) of its number.
__kernel void fitted(__global const float *restrict in, __global const int *restrict rows,
                     __global const int *restrict columns, __global float *restrict out, int height, int width,
                     int channels, float value, __global const float *restrict taps)
{
    int x = get_global_id(0), y = get_global_id(1), which = 0;
    if (x >= width || y >= height)
        return;
    float seen[9], slope = 0.0f;
    for (int t = 0; t < 9; t++) {
        seen[t] = neighbour(in, rows[y + t / 3], columns[x + t % 3 * channels], width, value);
        which |= isnan(seen[t]) ? 0 : 1 << t;
    }
    for (int t = 0; t < 9; t++) {
        float tap = taps[9 * which + t];
        slope = tap == 0.0f ? slope : fma(tap, isnan(seen[t]) ? 0.0f : seen[t], slope);
    }
    out[(size_t)y * width + x] = slope;
}

// Of a window of `tall` by `wide`: the sum of its samples times `scale` (combine 0), the smallest (1) or the largest (2),
// of all or, where `skip` is set, of those that are no NaN.
__kernel void window(__global const float *restrict in, __global const int *restrict rows,
                     __global const int *restrict columns, __global float *restrict out, int height, int width,
                     int channels, float value, int tall, int wide, int combine, float scale, int skip)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    float joined = combine == 0 ? 0.0f : skip ? NAN : combine == 1 ? INFINITY : -INFINITY;
    for (int k = 0; k < tall; k++)
        for (int c = 0; c < wide; c++) {
            float v = neighbour(in, rows[y + k], columns[x + c * channels], width, value);
            if (combine == 0)
                joined = fma(v, scale, joined);
            else if (skip ? isnan(joined) : isnan(v)) // a NaN stays, or gives way
                joined = v;
            else if (combine == 1 ? v < joined : v > joined)
                joined = v;
        }
    out[(size_t)y * width + x] = joined;
}

// Integers in the order of the floats, and back.
inline int ordered(int bits) { return bits ^ ((bits >> 31) & 0x7fffffff); }

// The median of a window of `size` by `size`, bit by bit: the largest number that no more than half of the others lie
// below. A NaN in the window is the result or, where `skip` is set, takes no part.
__kernel void median(__global const float *restrict in, __global const int *restrict rows,
                     __global const int *restrict columns, __global float *restrict out, int height, int width,
                     int channels, float value, int size, int skip)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int found = INT_MIN, bad = 0;
    for (int k = 0; k < size; k++)
        for (int c = 0; c < size; c++)
            bad += isnan(neighbour(in, rows[y + k], columns[x + c * channels], width, value));
    int others = size * size - bad - 1;
    for (int bit = 31; bit >= 0; bit--) {
        int tried = found + (int)(1u << bit), below = 0;
        for (int k = 0; k < size; k++)
            for (int c = 0; c < size; c++) {
                float v = neighbour(in, rows[y + k], columns[x + c * channels], width, value);
                below += v == v && ordered(as_int(v)) < tried;
            }
        found = below <= others / 2 ? tried : found;
    }
    out[(size_t)y * width + x] = (skip ? others < 0 : bad) ? NAN : as_float(ordered(found));
}
