// Layers blurred one over the other, and means of views from points of a lens; views.py is the definition.
//
// CHANNELS of the picture.

#define SEGMENT 64
#define NOTHING (-1.0f)
#define EACH for (int i = 0; i < SEGMENT; i++)

// The picture lies in planes and so do the layers' numbers, `pitch` wide with `around` pixels of no layer about them.
// `taps` holds down, across and weight; those of layer k begin at `begins[k]`.
kernel void layered(global const float *restrict planes, global const int *restrict index,
                    global const float *restrict radius, global const float *restrict taps,
                    global const int *restrict begins, global const int *restrict ranges, global float *restrict out,
                    int width, int height, int pitch, int around)
{
    int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height)
        return;
    size_t plane = (size_t)pitch * (height + 2 * around), home = (size_t)(row + around) * pitch + first + around;
    int segment = row * ((width + SEGMENT - 1) / SEGMENT) + first / SEGMENT;
    float total[CHANNELS][SEGMENT], alpha[SEGMENT], c[CHANNELS][SEGMENT], a[SEGMENT];
    EACH alpha[i] = 0;
    for (int k = 0; k < CHANNELS; k++)
        EACH total[k][i] = 0;
    for (int layer = ranges[2 * segment]; layer <= ranges[2 * segment + 1]; layer++) {
        EACH a[i] = 0;
        for (int k = 0; k < CHANNELS; k++)
            EACH c[k][i] = 0;
        for (int tap = begins[layer]; tap < begins[layer + 1]; tap++) {
            size_t at = home + (int)taps[3 * tap] * (long)pitch + (int)taps[3 * tap + 1];
            float w = taps[3 * tap + 2], own[SEGMENT];
            EACH {
                own[i] = index[at + i] == layer ? w : 0.0f;
                a[i] += own[i];
            }
            for (int k = 0; k < CHANNELS; k++)
                EACH c[k][i] += own[i] > 0 ? own[i] * planes[k * plane + at + i] : 0.0f;
        }
        EACH {
            float behind = 1 - (a[i] < 1 ? a[i] : 1.0f);
            alpha[i] = alpha[i] * behind + a[i];
            a[i] = behind;
        }
        for (int k = 0; k < CHANNELS; k++)
            EACH total[k][i] = (a[i] > 0 ? total[k][i] * a[i] : 0.0f) + c[k][i];
    }
    for (int i = 0; i < min(SEGMENT, width - first); i++) {
        size_t pixel = (size_t)row * width + first + i;
        for (int k = 0; k < CHANNELS; k++)
            out[pixel * CHANNELS + k] = radius[pixel] == NOTHING ? NAN : total[k][i] / alpha[i];
    }
}

// `points` of the lens: down and across; each is followed back in so many `steps`.
kernel void viewed(global const float *restrict image, global const float *restrict circles,
                   global const float *restrict radius, global const float *restrict points, global float *restrict out,
                   int count, int steps, int width, int height)
{
    int first = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (first >= width || row >= height)
        return;
    float total[CHANNELS][SEGMENT], seen[SEGMENT];
    EACH seen[i] = 0;
    for (int k = 0; k < CHANNELS; k++)
        EACH total[k][i] = 0;
    for (int view = 0; view < count; view++) {
        float down = points[2 * view], across = points[2 * view + 1];
        int at[SEGMENT];
        EACH at[i] = row * width + min(first + i, width - 1);
        for (int step = 0; step < steps; step++)
            EACH {
                float circle = circles[at[i]], y = floor(row - down * circle + 0.5f);
                float x = floor((float)min(first + i, width - 1) - across * circle + 0.5f);
                y = y > 0 ? (y < height - 1 ? y : height - 1) : 0;
                x = x > 0 ? (x < width - 1 ? x : width - 1) : 0;
                at[i] = (int)y * width + (int)x;
            }
        EACH {
            int there = radius[at[i]] != NOTHING;
            seen[i] += there;
            for (int k = 0; k < CHANNELS; k++)
                total[k][i] += there ? image[(size_t)at[i] * CHANNELS + k] : 0.0f;
        }
    }
    for (int i = 0; i < min(SEGMENT, width - first); i++) {
        size_t pixel = (size_t)row * width + first + i;
        for (int k = 0; k < CHANNELS; k++)
            out[pixel * CHANNELS + k] = radius[pixel] == NOTHING ? NAN : total[k][i] / seen[i];
    }
}
