// Sums over circles of confusion; circles.py is the definition.
//
// CHANNELS of the picture, which lies in planes, as its radii and depths do, all `pitch` wide with `around` pixels of
// nothing about them.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define SEGMENT 64
#define NOTHING (-1.0f)

// Every pixel within reach of a segment; `distance` holds the radius of the shape through each offset, `side` a row.
kernel void gathered(global const float *restrict planes, global const float *restrict radius,
                     global const float *restrict depth, global const int *restrict reaches,
                     global const double *restrict distance, global float *restrict out, int width, int height,
                     int pitch, int around, int side)
{
    int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height)
        return;
    size_t plane = (size_t)pitch * (height + 2 * around);
    size_t home = (size_t)(row + around) * pitch + first + around;
    int reach = reaches[row * ((width + SEGMENT - 1) / SEGMENT) + first / SEGMENT];
    double total[CHANNELS][SEGMENT], weights[SEGMENT];
    for (int i = 0; i < SEGMENT; i++) {
        weights[i] = 0;
        for (int c = 0; c < CHANNELS; c++)
            total[c][i] = 0;
    }
    for (int dy = -reach; dy <= reach; dy++) {
        for (int dx = -reach; dx <= reach; dx++) {
            double d = distance[(dy + side / 2) * side + dx + side / 2], w[SEGMENT];
            size_t at = home + dy * (long)pitch + dx;
            for (int i = 0; i < SEGMENT; i++) {
                float theirs = radius[at + i], own = radius[home + i];
                double seen = ((depth[at + i] > depth[home + i]) & (own < theirs)) ? own : theirs;
                double part = seen - d + 0.5;
                part = part < 0 ? 0.0 : (part > 1 ? 1.0 : part);
                w[i] = part / (seen * seen + 1.0 / 12);
                weights[i] += w[i];
            }
            for (int c = 0; c < CHANNELS; c++)
                for (int i = 0; i < SEGMENT; i++)
                    total[c][i] += w[i] == 0 ? 0.0 : w[i] * planes[c * plane + at + i];
        }
    }
    for (int i = 0; i < min(SEGMENT, width - first); i++) {
        bool lost = radius[home + i] == NOTHING;
        for (int c = 0; c < CHANNELS; c++)
            out[((size_t)row * width + first + i) * CHANNELS + c] = lost ? NAN : (float)(total[c][i] / weights[i]);
    }
}

// Pixels at the points of a spiral, the same for all of a segment. `taps` holds, for each segment, where its offsets
// begin and end in `offsets`: down, across, and the radius of the shape through them.
kernel void sampled(global const float *restrict planes, global const float *restrict radius,
                    global const float *restrict depth, global const int *restrict taps,
                    global const float *restrict offsets, global float *restrict out, int width, int height, int pitch,
                    int around)
{
    int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height)
        return;
    size_t plane = (size_t)pitch * (height + 2 * around);
    size_t home = (size_t)(row + around) * pitch + first + around;
    int segment = row * ((width + SEGMENT - 1) / SEGMENT) + first / SEGMENT;
    float total[CHANNELS][SEGMENT], weights[SEGMENT];
    for (int i = 0; i < SEGMENT; i++) {
        weights[i] = 0;
        for (int c = 0; c < CHANNELS; c++)
            total[c][i] = 0;
    }
    for (int k = taps[2 * segment]; k < taps[2 * segment + 1]; k++) {
        float d = offsets[3 * k + 2], w[SEGMENT];
        size_t at = home + (int)offsets[3 * k] * (long)pitch + (int)offsets[3 * k + 1];
        for (int i = 0; i < SEGMENT; i++) {
            float theirs = radius[at + i], own = radius[home + i];
            float seen = ((depth[at + i] > depth[home + i]) & (own < theirs)) ? own : theirs;
            float part = seen - d + 0.5f;
            part = part < 0 ? 0.0f : (part > 1 ? 1.0f : part);
            w[i] = part / (seen * seen + 1.0f / 12);
            weights[i] += w[i];
        }
        for (int c = 0; c < CHANNELS; c++)
            for (int i = 0; i < SEGMENT; i++)
                total[c][i] += w[i] == 0 ? 0.0f : w[i] * planes[c * plane + at + i];
    }
    for (int i = 0; i < min(SEGMENT, width - first); i++) {
        bool lost = radius[home + i] == NOTHING;
        for (int c = 0; c < CHANNELS; c++)
            out[((size_t)row * width + first + i) * CHANNELS + c] = lost ? NAN : total[c][i] / weights[i];
    }
}
