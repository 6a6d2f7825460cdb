// Moments and counts of CHANNELS channels in doubles; counting.py says in which order.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

// One work-item takes `share` pixels: how many values are finite, the least, the largest and the sum of each channel.
kernel void first(global const float *restrict in, global double *restrict out, global const double *restrict mean,
                  ulong share, ulong pixels)
{
    ulong part = get_global_id(0), from = part * share, to = min(from + share, pixels);
    double n[CHANNELS], low[CHANNELS], high[CHANNELS], sum[CHANNELS];
    for (int c = 0; c < CHANNELS; c++)
        n[c] = 0.0, low[c] = INFINITY, high[c] = -INFINITY, sum[c] = 0.0;
    for (ulong i = from; i < to; i++)
        for (int c = 0; c < CHANNELS; c++) {
            double x = in[i * CHANNELS + c];
            bool finite = fabs(x) < INFINITY;
            n[c] += finite ? 1.0 : 0.0;
            sum[c] += finite ? x : 0.0;
            low[c] = finite && x < low[c] ? x : low[c];
            high[c] = finite && x > high[c] ? x : high[c];
        }
    out += part * 4 * CHANNELS;
    for (int c = 0; c < CHANNELS; c++) {
        out[c] = n[c];
        out[CHANNELS + c] = low[c];
        out[2 * CHANNELS + c] = high[c];
        out[3 * CHANNELS + c] = sum[c];
    }
}

// The sums of the differences to the mean, and of their squares.
kernel void second(global const float *restrict in, global double *restrict out, global const double *restrict mean,
                   ulong share, ulong pixels)
{
    ulong part = get_global_id(0), from = part * share, to = min(from + share, pixels);
    double off[CHANNELS], square[CHANNELS];
    for (int c = 0; c < CHANNELS; c++)
        off[c] = 0.0, square[c] = 0.0;
    for (ulong i = from; i < to; i++)
        for (int c = 0; c < CHANNELS; c++) {
            double x = in[i * CHANNELS + c], apart = x - mean[c];
            apart = fabs(x) < INFINITY ? apart : 0.0;
            off[c] += apart;
            square[c] += apart * apart;
        }
    out += part * 2 * CHANNELS;
    for (int c = 0; c < CHANNELS; c++) {
        out[c] = off[c];
        out[CHANNELS + c] = square[c];
    }
}

// One work-item counts `share` pixels into histograms of its own, zeroed. `n` holds the low ends of all channels, then
// bins over range.
kernel void count(global const float *restrict in, global uint *restrict counts, global const double *restrict n,
                  int bins, ulong share, ulong pixels)
{
    ulong part = get_global_id(0), from = part * share, to = min(from + share, pixels);
    global uint *own = counts + part * (ulong)(CHANNELS * bins);
    for (ulong i = from; i < to; i++)
        for (int c = 0; c < CHANNELS; c++) {
            double x = in[i * CHANNELS + c], at = (x - n[c]) * n[CHANNELS + c];
            at = at < 0.0 ? 0.0 : at;
            at = at > bins - 1 ? (double)(bins - 1) : at;
            if (fabs(x) < INFINITY)
                own[c * bins + (int)at]++;
        }
}
