// Rounding to few levels, in doubles and in the order of quantise.py, so that both decide alike.
//
// CHANNELS of a sample, COLOURS of them colour. `n` holds low, the step, levels - 1, levels - 1 over
// the range, and the strength of the dither.
// Every number is put on the scale 0 to levels - 1, where q = floor(v + threshold).

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

static inline double scaled(float x, global const double *restrict n)
{
    double v = ((double)x - n[0]) * n[3];
    v = v < 0.0 ? 0.0 : v;
    return v > n[2] ? n[2] : v;
}

static inline double rounded(double v, double threshold, global const double *restrict n)
{
    double q = floor(v + threshold);
    q = q < 0.0 ? 0.0 : q;
    return q > n[2] ? n[2] : q;
}

static inline float placed(double q, global const double *restrict n) { return (float)(n[0] + q * n[1]); }

#define SEGMENT 64

// `mask` holds side x side thresholds, already drawn towards 1/2 by what the strength lacks.
kernel void ordered(global const float *restrict in, global float *restrict out, global const double *restrict mask,
                    int side, global const double *restrict n, int width, int height)
{
    int first = get_global_id(0) * SEGMENT, y = get_global_id(1);
    if (y >= height)
        return;
    int last = min(first + SEGMENT, width);
    for (int x = first; x < last; x++) {
        size_t at = ((size_t)y * width + x) * CHANNELS;
        double threshold = mask[(y & (side - 1)) * side + (x & (side - 1))];
        for (int c = 0; c < COLOURS; c++) {
            float value = in[at + c];
            float made = placed(rounded(scaled(value, n), threshold, n), n);
            out[at + c] = isnan(value) ? value : made;
        }
        for (int c = COLOURS; c < CHANNELS; c++)
            out[at + c] = in[at + c];
    }
}

// One work-item for one channel, pixel after pixel. `errors` holds three rows of width + 4 for each channel, zeroed;
// `taps` holds (dx, dy, weight) of what a pixel receives.
kernel void diffused(global const float *restrict in, global float *restrict out, global double *restrict errors,
                     global const double *restrict taps, int count, global const double *restrict n, int width,
                     int height)
{
    int c = get_global_id(0);
    if (c >= CHANNELS)
        return;
    if (c >= COLOURS) {
        for (size_t i = 0; i < (size_t)width * height; i++)
            out[i * CHANNELS + c] = in[i * CHANNELS + c];
        return;
    }
    int stride = width + 4;
    global double *own = errors + (size_t)c * 3 * stride;
    for (int y = 0; y < height; y++) {
        global double *row = own + (size_t)(y % 3) * stride + 2;
        for (int x = 0; x < width; x++)
            row[x] = 0.0;
        for (int x = 0; x < width; x++) {
            size_t at = ((size_t)y * width + x) * CHANNELS + c;
            double received = 0.0;
            for (int i = 0; i < count; i++) {
                int dx = (int)taps[3 * i], dy = (int)taps[3 * i + 1];
                received += own[(size_t)((y + dy + 3) % 3) * stride + 2 + x + dx] * taps[3 * i + 2];
            }
            float value = in[at];
            if (isnan(value)) {
                out[at] = value;
                continue;
            }
            double v = scaled(value, n) + received;
            double q = rounded(v, 0.5, n);
            out[at] = placed(q, n);
            row[x] = (v - q) * n[4];
        }
    }
}
