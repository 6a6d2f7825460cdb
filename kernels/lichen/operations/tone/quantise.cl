// Rounding to few levels, in doubles and in the order of quantise.py, so that both decide alike.
//
// CHANNELS of a sample, COLOURS of them colour, COVERAGE (flat.clh). `n` holds low, the step, levels - 1, levels - 1 over
// the range, and the strength of the dither.
// Every number is put on the scale 0 to levels - 1, where q = floor(v + threshold).

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#include "flat.clh"

static inline __attribute__((always_inline)) double16 between(double16 v, double most)
{
    v = select(v, (double16)(0.0), v < 0.0);
    return select(v, (double16)(most), v > most);
}

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

// Sixteen samples of a row at a time. `thresholds` holds `side` rows, each `side` pixels wide and 16 samples wider,
// over again for every channel and already drawn towards 1/2 by what the strength lacks.
kernel void ordered(global const float *restrict in, global float *restrict out,
                    global const double *restrict thresholds, int side, global const double *restrict n, int row,
                    int height)
{
    int x = get_global_id(0) * FLAT_WIDTH, y = get_global_id(1);
    if (x >= row || y >= height)
        return;
    int period = side * CHANNELS;
    ulong start = (ulong)y * row, at = start + x, end = start + row;
    double16 threshold = vload16(0, thresholds + (size_t)(y & (side - 1)) * (period + FLAT_WIDTH) + x % period);
    float16 given = flat_load(in, at, end);
    double16 v = (convert_double16(given) - n[0]) * n[3];
    v = between(v, n[2]);
    double16 q = between(convert_double16(convert_int16(v + threshold)), n[2]); // neither is negative
    float16 made = convert_float16(n[0] + q * n[1]);
    made = select(made, given, isnan(given));
    flat_store(flat_keep_coverage(made, given, x), out, at, end);
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
