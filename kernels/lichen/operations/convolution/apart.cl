// What the kernels of this folder make of a pixel's neighbours, one float an item: for devices whose items step together.
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

// Of a window of `tall` by `wide`: the sum of its samples times `scale` (combine 0), the smallest (1) or the largest (2).
__kernel void window(__global const float *restrict in, __global const int *restrict rows,
                     __global const int *restrict columns, __global float *restrict out, int height, int width,
                     int channels, float value, int tall, int wide, int combine, float scale)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    float joined = combine == 0 ? 0.0f : combine == 1 ? INFINITY : -INFINITY;
    for (int k = 0; k < tall; k++)
        for (int c = 0; c < wide; c++) {
            float v = neighbour(in, rows[y + k], columns[x + c * channels], width, value);
            if (combine == 0)
                joined = fma(v, scale, joined);
            else if (isnan(v) || (combine == 1 ? v < joined : v > joined)) // a NaN stays
                joined = v;
        }
    out[(size_t)y * width + x] = joined;
}

// Integers in the order of the floats, and back.
inline int ordered(int bits) { return bits ^ ((bits >> 31) & 0x7fffffff); }

// The median of a window of `size` by `size`, bit by bit: the largest number that no more than half of the others lie
// below. A NaN in the window is the result.
__kernel void median(__global const float *restrict in, __global const int *restrict rows,
                     __global const int *restrict columns, __global float *restrict out, int height, int width,
                     int channels, float value, int size)
{
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width || y >= height)
        return;
    int found = INT_MIN, bad = 0;
    for (int bit = 31; bit >= 0; bit--) {
        int tried = found + (int)(1u << bit), below = 0;
        for (int k = 0; k < size; k++)
            for (int c = 0; c < size; c++) {
                float v = neighbour(in, rows[y + k], columns[x + c * channels], width, value);
                below += ordered(as_int(v)) < tried;
                bad |= isnan(v);
            }
        found = below <= size * size / 2 ? tried : found;
    }
    out[(size_t)y * width + x] = bad ? NAN : as_float(ordered(found));
}
