/* Vector calculus on images; MADE is the place in `lichen.operations.streamlines.vector.Made`. */

#include "field.clh"

#define GRADIENT 0
#define PERPENDICULAR 1
#define ROTATE 2
#define NORMALISE 3
#define CURL 4
#define DIVERGENCE 5

/* The mean of a pixel's channels: of the field of which a gradient is taken. */
inline float mean_of(global const float *restrict pixel, int channels) {
    float sum = 0.0f;
    for (int c = 0; c < channels; ++c) sum += pixel[c];
    return sum / (float)channels;
}

kernel void make(global const float *restrict image, global float *restrict result, int width, int height, int channels,
                 float c, float s) {
    const int column = get_global_id(0), row = get_global_id(1);
    if (column >= width || row >= height) return;
    const size_t here = (size_t)row * width + column;
#if MADE == ROTATE || MADE == NORMALISE
    const float x = image[here * channels], y = image[here * channels + 1];
#if MADE == ROTATE
    vstore2((float2)(c * x - s * y, s * x + c * y), here, result);
#else
    const float u = fabs(x), v = fabs(y), m = u > v ? u : v, by = power_near(m), a = x * by, b = y * by;
    const float length = sqrt(a * a + b * b);
    const float one = x * 0.0f + y * 0.0f; /* 0, or NaN where a component is not finite */
    vstore2((float2)(m > 0.0f ? a / length + one : x + one, m > 0.0f ? b / length + one : y + one), here, result);
#endif
#else
    const int left = max(column - 1, 0), right = min(column + 1, width - 1);
    const int above = max(row - 1, 0), below = min(row + 1, height - 1);
    const float across = right > left ? 1.0f / (float)(right - left) : 0.0f;
    const float down = below > above ? 1.0f / (float)(below - above) : 0.0f;
    global const float *l = image + ((size_t)row * width + left) * channels, *r = image + ((size_t)row * width + right) * channels;
    global const float *a = image + ((size_t)above * width + column) * channels;
    global const float *b = image + ((size_t)below * width + column) * channels;
#if MADE == CURL
    result[here] = (r[1] - l[1]) * across - (b[0] - a[0]) * down;
#elif MADE == DIVERGENCE
    result[here] = (r[0] - l[0]) * across + (b[1] - a[1]) * down;
#else
    const float x = (mean_of(r, channels) - mean_of(l, channels)) * across;
    const float y = (mean_of(b, channels) - mean_of(a, channels)) * down;
    vstore2(MADE == GRADIENT ? (float2)(x, y) : (float2)(-y, x), here, result);
#endif
#endif
}
