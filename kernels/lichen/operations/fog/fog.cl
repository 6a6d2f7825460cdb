// A picture through fog, `span` pixels of a row to a work-item, sixteen at a time; optics.py is the definition.
//
// Definitions given at build time:
//   CHANNELS, COVERAGE   of the picture; 1 where the last is coverage, which colour is multiplied by
//   KIND                 0 linear, 1 exponential, 2 squared, 3 layered, 4 by height
//   AXIS                 0 to 2 where heights of points are counted along an axis, 3 where along none
//   POSITION             1 where points are given; 0 where depths are: DEPTH_KIND 0 planar, 1 euclidean, 2 by terms
//   PLANAR               1 where distances are those along the viewing direction
//   KEEP                 1 where what is infinitely far stays as it is
//   SHINES               1 where `emissive` is given
//   TABLE                1 where `layers` is a table of `entries`: of what comes through (kinds 1, 2), or of mean densities
//                        above the eye and then below (3); 0 where it holds of all segments, those above first,
//                        where they begin, then the integrals up to there, the densities there and their slopes
// `n` holds doubles; launch.py says which.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#include "mask.clh"
#include "numeric.clh"
#include "pick.clh"
#include "vector.clh"
#include "../compositing/planes.clh"

#define ONE ((float16)(1.0f))
#define ZERO ((float16)(0.0f))

// (1 - e^-a) / a for a >= 0: a series where the difference would cancel. 2.5 ULP.
PLANE_FN float16 settled(float16 a)
{
    float16 s = (float16)(1.0f / 362880.0f);
    s = fma(s, -a, (float16)(1.0f / 40320.0f));
    s = fma(s, -a, (float16)(1.0f / 5040.0f));
    s = fma(s, -a, (float16)(1.0f / 720.0f));
    s = fma(s, -a, (float16)(1.0f / 120.0f));
    s = fma(s, -a, (float16)(1.0f / 24.0f));
    s = fma(s, -a, (float16)(1.0f / 6.0f));
    s = fma(s, -a, (float16)(0.5f));
    s = fma(s, -a, ONE);
    return a < 0.5f ? s : (ONE - num_exp(-a)) / a;
}

// A table's value at x >= 0, counted in entries: linear between them, the last beyond.
PLANE_FN float16 tabled(float16 x, global const float *restrict table, int entries)
{
    float16 last = (float16)((float)(entries - 1));
    float16 place = x < last ? x : last;
    int16 cell = convert_int16(place);
    cell = cell < entries - 2 ? cell : (int16)(entries - 2);
    cell = x == x ? cell : (int16)(0);
    int at[LANES];
    float low[LANES], high[LANES];
    vstore16(cell, 0, at);
    for (int i = 0; i < LANES; i++)
        low[i] = table[at[i]], high[i] = table[at[i] + 1];
    float16 a = vload16(0, low), b = vload16(0, high);
    return x == x ? a + (place - convert_float16(cell)) * (b - a) : x;
}

#ifdef PICKS
PLANE_FN float16 picked(global const float *restrict of, int16 at) { return (float16)(pick8(of, at.lo), pick8(of, at.hi)); }
#endif

// The mean density of layers between the eye's height and `rise` above it: what the segments before the last hold, and the
// part of the last, over the rise; all of it is added. Rises that no float's square root notices are none: one over them
// may be infinite.
PLANE_FN float16 mean_density(float16 rise, global const float *restrict layers, int above, int below)
{
    float16 far = fabs(rise), b = ZERO, before = ZERO, s, m;
    far = far < 0x1p-120f ? ZERO : far;
    int16 down = rise < 0.0f;
    int all = above + below, stride = max(all, 8);
    global const float *held = layers + stride, *starts = held + stride, *slopes = starts + stride;
#ifdef PICKS
    if (all <= 8) {
        int16 at = down ? (int16)(above) : (int16)(0);
        for (int k = 1; k < above; k++)
            at -= rise > layers[k];
        for (int k = 1; k < below; k++)
            at -= rise < -layers[above + k];
        b = picked(layers, at);
        before = picked(held, at);
        s = picked(starts, at);
        m = picked(slopes, at);
    } else
#endif
    {
        s = down ? (float16)(starts[above]) : (float16)(starts[0]);
        m = down ? (float16)(slopes[above]) : (float16)(slopes[0]);
        for (int k = 1; k < all; k++) {
            if (k == above)
                continue;
            int16 reached = k < above ? rise > layers[k] : rise < -layers[k];
            b = reached ? (float16)(layers[k]) : b;
            before = reached ? (float16)(held[k]) : before;
            s = reached ? (float16)(starts[k]) : s;
            m = reached ? (float16)(slopes[k]) : m;
        }
    }
    float16 t = far - b, mean = fma(0.5f * m, t, s);
    return b == 0.0f ? mean : fma(t, mean, before) / far;
}

#if POSITION
// The part of points less the eye in a direction, whose products may cancel; what it does not look at may be infinite.
PLANE_FN float16 along(const float16 *p, global const double *restrict eye, global const double *restrict direction)
{
    double16 total = (double16)(0.0);
    for (int c = 0; c < 3; c++)
        total = direction[c] != 0.0 ? total + direction[c] * (convert_double16(p[c]) - eye[c]) : total;
    return convert_float16(total);
}
#endif

// Whether all of sixteen lie between `least`, which is not below 0, and 2^120: most do, and need none of the cases of
// infinities and of no numbers. Numbers of one sign are in the order of their bits.
PLANE_FN bool all_plain(float16 x, float least)
{
    int16 bits = as_int16(x), beyond = (bits - as_int(least)) | (as_int(0x1p+120f) - bits);
    return !mask_any(beyond < 0);
}

// What comes through over distances, to points so far above the eye; `climb` is how much rays rise over their lengths.
PLANE_FN float16 through(float16 d, float16 rise, float16 climb, bool plain, global const double *restrict n,
                         global const float *restrict layers, int above, int below, int entries)
{
    float density = (float)n[4], start = (float)n[5], slope = (float)n[6], lift = (float)n[7], per_fall = (float)n[8];
    int16 nothing = plain ? (int16)(0) : d == INFINITY;
    float16 t;
    if (!plain)
        rise = nothing | (fabs(rise) == INFINITY) ? ZERO : rise;
#if KIND == 0
    t = num_clamp((start - d) * slope, ZERO, ONE);
#elif KIND == 1 && !TABLE
    t = num_exp(-(density * d));
#elif KIND == 2 && !TABLE
    t = density * d;
    t = num_exp(-(t * t));
#elif KIND <= 2
    t = nothing ? ZERO : tabled(d * slope, layers, entries);
#elif KIND == 3
#if TABLE
    float16 places = fabs(rise) * slope;
    float16 mean = places <= (float)(entries - 1)
        ? (rise >= 0.0f ? tabled(places, layers, entries) : tabled(places, layers + entries, entries))
        : (rise >= 0.0f ? ((float)n[21] + (float)n[22] * (fabs(rise) - lift)) : ((float)n[23] + (float)n[24] * (fabs(rise) - lift)))
            / fabs(rise);
#else
    float16 mean = mean_density(rise, layers, above, below);
#endif
    // A ray without an end: infinite, nothing, or a whole side of the fog on a slant.
    float16 whole = climb > 0.0f ? (float16)((float)n[21]) : (float16)((float)n[23]);
    float16 beyond = climb > 0.0f ? (float16)((float)n[22]) : (float16)((float)n[24]);
    float16 endless = beyond > 0.0f ? (float16)(INFINITY) : whole / fabs(climb);
    endless = climb == 0.0f ? (float16)((float)n[25]) : endless;
    t = num_exp(-(density * (nothing ? endless : mean * d)));
#else
    float16 u = rise * per_fall, down = -u > 0.0f ? -u : ZERO;
    float16 within = density * settled(fabs(u)) * num_exp(lift + down) * d;
    float16 endless = climb > 0.0f ? (float16)((float)n[21]) / climb : (float16)(INFINITY);
    t = num_exp(-(nothing ? endless : within));
#endif
    if (!plain)
        t = d == d ? t : d;
#if KEEP
    t = nothing ? ONE : t;
#endif
    return t;
}

// What is seen of a colour of which `t` comes through: no light, however much there is, where nothing does.
PLANE_FN float16 dimmed(float16 v, float16 t) { return (t == 0.0f) & (fabs(v) == INFINITY) ? ZERO : t * v; }

kernel void fog(global const float *restrict image, global const float *restrict where,
                global const float *restrict emissive, global float *restrict out, global const double *restrict n,
                global const float *restrict colour, global const float *restrict layers,
                global const double *restrict xs, global const double *restrict ys, int above, int below, int entries,
                int span, int width, int height)
{
    int per_row = (width + span - 1) / span, row = (int)get_global_id(0) / per_row;
    if (row >= height)
        return;
#if POSITION
    float eye[6];
    for (int c = 0; c < 3; c++) {
        eye[c] = (float)n[9 + c];
        eye[3 + c] = (float)(n[9 + c] - eye[c]);
    }
#else
    double y = ys[row];
    float y2 = (float)(1.0 + y * y);
#endif
    int begin = (int)get_global_id(0) % per_row * span, end = min(begin + span, width);
    for (int column = begin; column < end; column += LANES) {
        int count = min(end - column, LANES);
        ulong first = (ulong)row * width + column;
#if POSITION
        float16 p[4];
        planes_load(where + first * 3, 3, 3, count, p);
        // Relative to the eye, which is given in two parts: what is near it keeps all digits.
        float16 px = (p[0] - eye[0]) - eye[3], py = (p[1] - eye[1]) - eye[4], pz = (p[2] - eye[2]) - eye[5];
        vector16 way = vector(px, py, pz);
        float16 square = vector_dot(way, way), d, rise = ZERO, climb = ZERO;
        bool plain = all_plain(square, 0x1p-80f);
        if (plain)
            d = sqrt(square);
        else
            d = ((p[0] != p[0]) | (p[1] != p[1]) | (p[2] != p[2])) ? (float16)(NAN) : vector_length(way);
#if PLANAR
        float16 z = along(p, n + 9, n + 15);
        z = z < 0.0f ? ZERO : z;
        d = d == INFINITY ? d : (d == d ? z : d);
#endif
#if KIND >= 3
#if AXIS == 3
        rise = along(p, n + 9, n + 12);
#else
        rise = (float)n[12 + AXIS] * (AXIS == 0 ? px : (AXIS == 1 ? py : pz));
#endif
#endif
#else
        float16 stored = plane_load(where + first, 1, 0, count), z = stored;
#if DEPTH_KIND == 2
        double16 divisor = n[19] + n[20] * convert_double16(stored), zd = n[18] / divisor;
        z = convert_float16(divisor <= 0.0 ? (double16)(INFINITY) : zd);
#endif
        z = z < 0.0f ? ZERO : z;
        float16 d = z, rise = ZERO, climb = ZERO;
#if KIND >= 3 || PLANAR == (DEPTH_KIND == 1)
        double16 x = vload16(0, xs + column);
        float16 xf = convert_float16(x), slant = sqrt(xf * xf + y2);
#if PLANAR == (DEPTH_KIND == 1)
        d = PLANAR ? z / slant : z * slant;
#endif
#endif
#if KIND >= 3
        double16 climbs = n[12] * x + n[13] * y - n[14];
        climb = convert_float16(climbs);
        rise = (DEPTH_KIND == 1 ? z / slant : z) * climb;
        climb = climb / slant;
#endif
        bool plain = all_plain(d, 0.0f);
#endif
        float16 t = plain ? through(d, rise, climb, true, n, layers, above, below, entries)
                          : through(d, rise, climb, false, n, layers, above, below, entries);
#if SHINES
        float16 e = num_clamp(plane_load(emissive + first, 1, 0, count), ZERO, ONE);
        t = t + e * (ONE - t);
#endif
        float16 hidden = ONE - t;
        bool clear = !mask_any(t == 0.0f);
        global const float *in = image + first * CHANNELS;
        global float *to = out + first * CHANNELS;
#if CHANNELS <= 4
        float16 v[4];
        planes_load(in, CHANNELS, CHANNELS, count, v);
#if COVERAGE
        hidden *= v[CHANNELS - 1];
#endif
        if (clear)
#pragma unroll
            for (int c = 0; c < CHANNELS - COVERAGE; c++)
                v[c] = t * v[c] + hidden * colour[c];
        else
#pragma unroll
            for (int c = 0; c < CHANNELS - COVERAGE; c++)
                v[c] = dimmed(v[c], t) + hidden * colour[c];
        planes_store(v, to, CHANNELS, count);
#else
#if COVERAGE
        float16 cover = plane_load(in, CHANNELS, CHANNELS - 1, count);
        hidden *= cover;
        plane_store(cover, to, CHANNELS, CHANNELS - 1, count);
#endif
        for (int c = 0; c < CHANNELS - COVERAGE; c++) {
            float16 v = plane_load(in, CHANNELS, c, count);
            plane_store(dimmed(v, t) + hidden * colour[c], to, CHANNELS, c, count);
        }
#endif
    }
}
