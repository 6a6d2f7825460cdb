// Colour through a table of size^3 colours, four floats each, red fastest.
//
// CHANNELS of a sample, the first three colour; TETRAHEDRAL 0 or 1. `k` holds three lows, three highs, three scales.

#define SEGMENT 64

static inline float held(float x, float low, float high)
{
    x = x < low ? low : x;
    return x > high ? high : x;
}

// The cell and, in *part, the place in it. A place that is NaN lies in cell 0.
static inline int cell_of(float place, int last, float *part)
{
    int cell = place >= 0.0f ? (int)place : 0;
    cell = min(cell, last);
    *part = place - (float)cell;
    return cell;
}

kernel void lookup(global const float *restrict in, global float *restrict out, global const float4 *restrict table,
                   int size, global const float *restrict k, ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, last = min(first + SEGMENT, pixels);
    int down = size, deep = size * size, all = 1 + down + deep;
    for (ulong i = first; i < last; i++) {
        global const float *x = in + i * CHANNELS;
        global float *y = out + i * CHANNELS;
        float r, g, b;
        float red = held(x[0], k[0], k[3]), green = held(x[1], k[1], k[4]), blue = held(x[2], k[2], k[5]);
        int cell = cell_of((red - k[0]) * k[6], size - 2, &r);
        cell += cell_of((green - k[1]) * k[7], size - 2, &g) * down;
        cell += cell_of((blue - k[2]) * k[8], size - 2, &b) * deep;
        global const float4 *v = table + cell;
#if TETRAHEDRAL
        // From the corner nearest black, first along the axis of the largest part, last along that of the smallest.
        float big = fmax(r, fmax(g, b)), small = fmin(r, fmin(g, b));
        float middle = fmax(fmin(r, g), fmin(fmax(r, g), b));
        int along = r >= g ? (r >= b ? 1 : deep) : (g >= b ? down : deep);
        int but = b <= g ? (b <= r ? deep : 1) : (g <= r ? down : 1);
        float4 made = v[0] * (1.0f - big) + v[along] * (big - middle) + v[all - but] * (middle - small) + v[all] * small;
#else
        float4 near = mix(mix(v[0], v[1], r), mix(v[down], v[down + 1], r), g);
        float4 far = mix(mix(v[deep], v[deep + 1], r), mix(v[deep + down], v[all], r), g);
        float4 made = mix(near, far, b);
#endif
        float known = red + green + blue;
        made = known == known ? made : (float4)(known);
        y[0] = made.x, y[1] = made.y, y[2] = made.z;
        for (int c = 3; c < CHANNELS; c++)
            y[c] = x[c];
    }
}
