// Horizons of a relief, sixteen pixels of a row at a time; horizons.py says what they are.
//
// `around` holds heights, or depths, with a frame of `reach` pixels; direction k looks at the places from starts[k] to
// starts[k + 1], each an offset into `around` and one over its distance, times the scale.
#include "../compositing/planes.clh"
#include "numeric.clh"
#include "vector.clh"

typedef struct {
    global const float *around, *over, *turns;
    global const int *offsets, *starts;
    int count, depth, left; // left: pixels of the frame's row from the first on
} Ring;

PLANE_FN float16 load_some(global const float *from, int left)
{
    if (left >= LANES)
        return vload16(0, from);
    float lane[LANES];
    for (int i = 0; i < LANES; i++)
        lane[i] = i < left ? from[i] : 0.0f;
    return vload16(0, lane);
}

// The largest slope in direction k, at least the floor.
PLANE_FN float16 slope_of(Ring r, global const float *at, float16 here, int k, float16 least)
{
    float16 made = least;
    for (int s = r.starts[k]; s < r.starts[k + 1]; s++) {
        float16 there = load_some(at + r.offsets[2 * s], r.left - r.offsets[2 * s + 1]);
        float16 slope;
        if (r.depth) {
            slope = (here - there) / here * r.over[s];
            slope = (((there > 0.0f) & (there < INFINITY)) | (there != there)) ? slope : (float16)(-INFINITY);
        } else
            slope = (there - here) * r.over[s];
        made = num_max(made, slope);
    }
    if (r.depth)
        made = ((here <= 0.0f) | (here == INFINITY)) ? least : made;
    return made;
}

#define PREPARE                                                                                                        \
    int column = get_global_id(0) * LANES, row = get_global_id(1);                                                     \
    int count = min(LANES, width - column);                                                                            \
    if (count <= 0)                                                                                                    \
        return;                                                                                                        \
    global const float *at = around + (size_t)(row + reach) * stride + reach + column;                                 \
    Ring r = {around, over, turns, offsets, starts, count, depth, stride - reach - column};                            \
    float16 here = load_some(at, r.left);

// The horizon's elevation in each direction: 0: its slope, 1: its sine, otherwise the angle in degrees.
kernel void elevations(global const float *restrict around, global const int *restrict offsets,
                       global const float *restrict over, global const int *restrict starts,
                       global const float *restrict turns, global const float *restrict normal,
                       global float *restrict out, int width, int stride, int reach, int directions, int depth,
                       float kind)
{
    PREPARE
    for (int k = 0; k < directions; k++) {
        float16 slope = slope_of(r, at, here, k, (float16)(0.0f)), made = slope;
        if (kind == 1.0f)
            made = slope == INFINITY ? (float16)(1.0f) : slope / sqrt(fma(slope, slope, (float16)(1.0f)));
        else if (kind != 0.0f)
            made = num_atan2(slope, (float16)(1.0f)) * 57.29577951308232f;
        plane_store(made, out + ((size_t)row * width + column) * directions, directions, k, count);
    }
}

// Half a slice of the sky, above a horizon; `along` is the normal's component in its direction, z that to the viewer.
PLANE_FN float16 open_side(float16 slope, float16 z, float16 along)
{
    float16 angle = num_atan2((float16)(1.0f), slope); // from the zenith
    float16 whole = fma(slope, slope, (float16)(1.0f));
    float16 sine = fabs(slope) > 1e15f ? (float16)(0.0f) : 2.0f * slope / whole; // of twice the angle
    return fma(z, 2.0f / whole, along * (2.0f * angle - sine));
}

// How much of the sky is seen, weighted by the cosine at the surface; `strength` of what is missing is taken away.
kernel void occlusion(global const float *restrict around, global const int *restrict offsets,
                      global const float *restrict over, global const int *restrict starts,
                      global const float *restrict turns, global const float *restrict normal,
                      global float *restrict out, int width, int stride, int reach, int directions, int depth,
                      float strength)
{
    PREPARE
    float16 seen = (float16)(0.0f), whole = seen, z = (float16)(1.0f), none = (float16)(0.0f);
    vector16 n = vector(none, none, z);
    if (normal) {
        float16 v[3];
        planes_load(normal + ((size_t)row * width + column) * 3, 3, 3, count, v);
        n = vector_unit(vector(v[0], v[1], v[2] <= 0.0f ? none : v[2]));
    }
    for (int k = 0; k < directions; k++) {
        float16 along = fma(n.x, turns[2 * k], n.y * turns[2 * k + 1]);
        float16 least = along == 0.0f ? none : -along / n.z;
        float16 slope = slope_of(r, at, here, k, least);
        if (normal) {
            seen += open_side(slope, n.z, along);
            whole += open_side(least, n.z, along);
        } else {
            seen += 2.0f / fma(slope, slope, (float16)(1.0f));
            whole += 2.0f;
        }
    }
    seen = 1.0f - strength * (1.0f - (whole == 0.0f ? (float16)(1.0f) : seen / whole));
    plane_store(seen, out + (size_t)row * width + column, 1, 0, count);
}
