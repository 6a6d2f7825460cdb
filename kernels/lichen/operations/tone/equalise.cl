// Histograms and their use, in doubles and in the order of equalise.py, so that both count alike.
//
// CHANNELS of a sample, COLOURS of them colour, EACH 1 where every channel has a histogram of its own. `n` holds low,
// high, bins over the range, and the strength.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

static inline double place(float x, int bins, global const double *restrict n)
{
    double v = ((double)x - n[0]) * n[2];
    v = v < 0.0 ? 0.0 : v;
    return v > bins ? (double)bins : v;
}

// One work-item counts `share` pixels into histograms of its own, zeroed.
kernel void count(global const float *restrict in, global uint *restrict counts, int bins,
                  global const double *restrict n, ulong share, ulong pixels)
{
    ulong part = get_global_id(0), first = part * share, last = min(first + share, pixels);
    global uint *own = counts + part * (ulong)((EACH ? COLOURS : 1) * bins);
    for (ulong i = first; i < last; i++) {
        global const float *x = in + i * CHANNELS;
        if (COLOURS < CHANNELS && !(x[CHANNELS - 1] > 0.0f))
            continue;
        for (int c = 0; c < COLOURS; c++)
            if (isfinite(x[c]))
                own[(EACH ? c * bins : 0) + min((int)place(x[c], bins, n), bins - 1)]++;
    }
}

#define SEGMENT 64

// `cumulative` holds bins + 1 numbers from 0 to 1 for each histogram.
kernel void apply(global const float *restrict in, global float *restrict out, global const double *restrict cumulative,
                  int bins, global const double *restrict n, ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, pixels);
    for (ulong i = first; i < last; i++) {
        global const float *x = in + i * CHANNELS;
        global float *y = out + i * CHANNELS;
        for (int c = 0; c < COLOURS; c++) {
            float value = x[c];
            double v = isnan(value) ? 0.0 : place(value, bins, n);
            int at = min((int)v, bins - 1);
            global const double *table = cumulative + (EACH ? c * (bins + 1) : 0);
            double rank = table[at] + (v - at) * (table[at + 1] - table[at]);
            double share = v / bins;
            float made = (float)(n[0] + (n[1] - n[0]) * (share + n[3] * (rank - share)));
            y[c] = isnan(value) ? value : made;
        }
        for (int c = COLOURS; c < CHANNELS; c++)
            y[c] = x[c];
    }
}
