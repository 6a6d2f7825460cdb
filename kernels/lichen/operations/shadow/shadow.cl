// Which share of a light reaches every point, eight pixels of a row at a time, in doubles; comparing.py is the
// definition, operation for operation. Of one texel, floats do where no comparison could turn out otherwise. Where only
// some texels of a square are compared, and depths are stored as they are, floats do everywhere: sums of products round
// less than the quantum that is allowed for, which is then twice as large.
//
// Definitions given at build time:
//   KIND       0 one texel, 1 comparisons averaged, 2 over a penumbra, 3 Chebyshev's bound, 4 some texels of a square
//   POSITION   1 where points are given, 0 where planar depths by `terms`: 0 as stored, 1 euclidean, 2 of a window
//   NORMALS    1 where normals are given
//   PARALLEL   1 for light without perspective
//   TERMS      1 where the map holds a window's depth
//   SPAN       pixels of a work-item, which asks for the texels of SEGMENT of them before it compares the first
//   BITS       0 as stored, 1 linear codes, 2 codes of a window's depth, 3 short floats, 4 of a reversed window's depth
// `n` holds doubles; launch.py says which.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#include "interleaved.clh"
#include "mask.clh"

#define TILE 32
#define LANES 8
#define MARGIN 64.0
#define MOST 33 // texels across the widest filter
#define FN static inline __attribute__((always_inline))
#if KIND == 4 && !TERMS
typedef float real;
typedef float8 real8;
typedef int8 mask8;
#define REAL8 convert_float8
#define QUANTUM 0x1p-20f
#define PLACES global const float *restrict
#else
#define PLACES global const double *restrict
typedef double real;
typedef double8 real8;
typedef long8 mask8;
#define REAL8 convert_double8
#define QUANTUM 0x1p-21
#endif
#define QUICK (KIND == 0 && POSITION && !TERMS && !BITS)
#define ZERO ((real8)((real)0))
#define ONE ((real8)((real)1))

typedef struct { real8 x, y, z; } triple;
typedef struct { real8 u, v, z, quantum, along, facing, right, down; } receiver;
typedef struct { global const float *restrict pixels; global const double *restrict n; int width, height; } light_map;

// Eight triples of floats; after the last, zeros.
FN void triples(global const float *restrict in, int count, float8 *x, float8 *y, float8 *z)
{
    if (count == LANES) {
        split3_eight(in, x, y, z);
        return;
    }
    float lane[3][LANES];
    for (int i = 0; i < LANES; i++)
        for (int k = 0; k < 3; k++)
            lane[k][i] = i < count ? in[3 * i + k] : 0.0f;
    *x = vload8(0, lane[0]);
    *y = vload8(0, lane[1]);
    *z = vload8(0, lane[2]);
}

FN triple three(global const float *restrict in, int count)
{
    float8 x, y, z;
    triples(in, count, &x, &y, &z);
    return (triple){REAL8(x), REAL8(y), REAL8(z)};
}

FN real8 one(global const float *restrict in, int count)
{
    if (count == LANES)
        return REAL8(vload8(0, in));
    real lane[LANES];
    for (int i = 0; i < LANES; i++)
        lane[i] = i < count ? in[i] : 0.0f;
    return vload8(0, lane);
}

FN void keep(float8 v, global float *restrict out, int count)
{
    if (count == LANES) {
        vstore8(v, 0, out);
        return;
    }
    float lane[LANES];
    vstore8(v, 0, lane);
    for (int k = 0; k < count; k++)
        out[k] = lane[k];
}

// Texels that lie anywhere, lane by lane in registers: by way of memory a load would wait for the stores before it.
FN float8 gathered(global const float *restrict p, int8 at)
{
    return (float8)(p[at.s0], p[at.s1], p[at.s2], p[at.s3], p[at.s4], p[at.s5], p[at.s6], p[at.s7]);
}

FN real8 row_of(global const double *restrict m, triple p)
{
    return (((real)m[0] * p.x + (real)m[1] * p.y) + (real)m[2] * p.z) + (real)m[3];
}
FN real8 dot_of(global const double *restrict a, triple p)
{
    return (p.x * (real)a[0] + p.y * (real)a[1]) + p.z * (real)a[2];
}

#if KIND < 4 || TERMS
// Planar depths of texels, and the step that they are stored in.
FN double8 depths(light_map map, double8 i, double8 j, double8 *step)
{
    long8 inside = (i >= 0.0) & (i < (double)map.width) & (j >= 0.0) & (j < (double)map.height);
    bool whole = mask_all(inside);
    int8 column = convert_int8(whole ? i : (inside ? i : ZERO)), row = convert_int8(whole ? j : (inside ? j : ZERO));
    double8 m = convert_double8(gathered(map.pixels, row * map.width + column));
    global const double *n = map.n;
#if TERMS
    double8 below = n[34] + n[35] * m;
    m = below <= 0.0 ? (double8)(INFINITY) : n[33] / below;
#endif
    *step = ZERO;
#if BITS > 2
    double8 shown = BITS == 3 ? m : (n[36] / m - n[37]) / n[38], large = shown * n[30], short_one = large - (large - shown);
    short_one = fabs(shown) == (double8)(INFINITY) ? shown : short_one;
    double8 kept = BITS == 3 ? short_one : n[36] / (n[37] + n[38] * short_one);
    *step = fabs(kept) == (double8)(INFINITY) ? ZERO : fabs(BITS == 3 ? kept : kept - kept * kept * (n[37] / n[36])) * n[31];
    m = fabs(m) == (double8)(INFINITY) ? m : kept;
#elif BITS
    double near = n[36], far = n[37], unit = n[38];
    double8 held = m < near ? (double8)(near) : (m > far ? (double8)(far) : m), made;
#if BITS == 1
    made = rint((held - near) / unit) * unit + near;
    *step = (double8)(unit);
#else
    made = 1.0 / (1.0 / near - rint((1.0 / near - 1.0 / held) / unit) * unit);
    *step = (made * made) * unit;
#endif
    m = fabs(m) == (double8)(INFINITY) ? m : made;
#endif
    return inside ? m : (double8)(n[39]);
}

// 1 where a texel lets light through, 0 where not, NaN where its depth is none.
FN double8 lit(light_map map, receiver r, double8 m, double8 step, double8 i, double8 j)
{
    global const double *n = map.n;
    double8 reach = m + (r.quantum + step), du = i + 0.5, dv = j + 0.5;
#if !NORMALS
#if PARALLEL
    double8 wide = (double8)(n[32]);
#else
    double8 wide = n[32] * r.z;
#endif
    long8 yes = r.z - wide * (fabs(du - r.u) + fabs(dv - r.v)) <= reach;
#else
    double8 x = du - r.u, y = dv - r.v;
    reach = reach + (PARALLEL ? (double8)(n[29]) : n[29] * r.z) * (fabs(x) + fabs(y));
    double8 across = du - map.width / 2.0, low = dv - map.height / 2.0;
#if PARALLEL
    double8 above = (r.along - r.right * across) - r.down * low;
    long8 yes = (r.z <= reach) | ((r.facing < 0.0) & (above >= reach * r.facing));
#else
    double8 below = (r.facing + r.right * across) + r.down * low;
    long8 yes = (r.z <= reach) | ((below < 0.0) & (r.along >= reach * below));
#endif
#endif
    return m != m ? m : (yes ? ONE : ZERO);
}

FN double8 shares(double8 low, double8 high, double k, double8 *i)
{
    *i = floor(low) + k;
    double8 first = *i > low ? *i : low, last = *i + 1.0 < high ? *i + 1.0 : high;
    return last > first ? last - first : ZERO;
}

FN double8 averaged(light_map map, receiver r, double8 side, int count)
{
    double8 half_side = side * 0.5, total = ZERO, j, step, across[MOST], at[MOST];
    for (int column = 0; column < count; column++)
        across[column] = shares(r.u - half_side, r.u + half_side, column, at + column);
    for (int row = 0; row < count; row++) {
        double8 b = shares(r.v - half_side, r.v + half_side, row, &j);
        for (int column = 0; column < count; column++) {
            double8 weight = across[column] * b, i = at[column];
            if (!mask_any(weight > 0.0))
                continue;
            double8 m = depths(map, i, j, &step);
            total = total + (weight > 0.0 ? weight * lit(map, r, m, step, i, j) : ZERO);
        }
    }
    total = total / (side * side);
    return total > 1.0 ? ONE : total;
}

FN double8 penumbra(light_map map, receiver r, double side, int count)
{
    double8 half_side = (double8)(side * 0.5), total = ZERO, weights = ZERO, i, j, step;
    for (int row = 0; row < count; row++) {
        double8 b = shares(r.v - half_side, r.v + half_side, row, &j);
        for (int column = 0; column < count; column++) {
            double8 weight = shares(r.u - half_side, r.u + half_side, column, &i) * b, m = depths(map, i, j, &step);
            long8 blocks = (weight > 0.0) & ~(lit(map, r, m, step, i, j) > 0.0) & (m > 0.0);
#if PARALLEL
            total = total + (blocks ? weight * m : ZERO);
#else
            total = total + (blocks ? weight * (1.0 / m) : ZERO);
#endif
            weights = weights + (blocks ? weight : ZERO);
        }
    }
    double8 mean = total / (weights > 0.0 ? weights : ONE);
#if PARALLEL
    double8 wide = map.n[40] * (r.z - mean);
#else
    double8 wide = map.n[40] * (mean - 1.0 / r.z);
#endif
    wide = wide > 1.0 ? wide : ONE;
    return (weights > 0.0) & (wide > 1.0) ? (wide < side ? wide : (double8)(side)) : ONE;
}

FN double8 chebyshev(light_map map, receiver r, double side, int count)
{
    double8 half_side = (double8)(side * 0.5), total = ZERO, square = ZERO, weights = ZERO, i, j, step;
    long8 spoilt = 0;
    for (int row = 0; row < count; row++) {
        double8 b = shares(r.v - half_side, r.v + half_side, row, &j);
        for (int column = 0; column < count; column++) {
            double8 weight = shares(r.u - half_side, r.u + half_side, column, &i) * b, m = depths(map, i, j, &step);
            double8 behind = m > 2.0 * r.z ? r.z : m - r.z;
            double8 apart = m == (double8)(INFINITY) ? r.z : behind + (r.quantum + step);
            long8 taken = weight > 0.0;
            spoilt |= taken & (m != m);
            total = total + (taken ? weight * apart : ZERO);
            weights = weights + (taken ? weight : ZERO);
            square = square + (taken ? weight * (apart * apart) : ZERO);
        }
    }
    double8 mean = total / weights, spread = square / weights - mean * mean;
    spread = spread > 0.0 ? spread : ZERO;
    double8 made = mean >= 0.0 ? ONE : spread / (spread + mean * mean);
    return spoilt ? (double8)(NAN) : made;
}

#if KIND == 4
// The mean of comparisons with the texels at some places of a square.
FN double8 sampled(light_map map, receiver r, double side, global const double *restrict places, int count)
{
    double8 total = ZERO, step;
    for (int k = 0; k < count; k++) {
        double8 i = floor(r.u + places[2 * k] * side), j = floor(r.v + places[2 * k + 1] * side);
        double8 m = depths(map, i, j, &step);
        total = total + lit(map, r, m, step, i, j);
    }
    return total / (double)count;
}
#endif
#else
// `whole` where all of the squares lie inside of the map.
FN float8 sampled_in(light_map map, receiver r, global const float *restrict places, int count, int whole)
{
    global const double *n = map.n;
    int8 passed = 0;
    float8 spoilt = ZERO, beyond = (float8)((float)n[39]), left = r.u - 0.5f, top = r.v - 0.5f;
#if NORMALS
    float8 bend = PARALLEL ? (float8)((float)n[29]) : (float)n[29] * r.z;
    float8 base = PARALLEL ? r.along : r.facing;
    float8 right = PARALLEL ? -r.right : r.right, down = PARALLEL ? -r.down : r.down;
    base = (base + right * (0.5f - map.width * 0.5f)) + down * (0.5f - map.height * 0.5f);
#else
    float8 wide = PARALLEL ? (float8)((float)n[32]) : (float)n[32] * r.z;
#endif
    for (int k = 0; k < count; k++) {
        float8 i = floor(r.u + places[2 * k]), j = floor(r.v + places[2 * k + 1]), m;
        int8 column = convert_int8(i), row = convert_int8(j);
        if (whole)
            m = gathered(map.pixels, row * map.width + column);
        else {
            int8 inside = (column >= 0) & (column < map.width) & (row >= 0) & (row < map.height);
            m = gathered(map.pixels, (row * map.width + column) & inside);
            m = inside ? m : beyond;
        }
        float8 reach = m + r.quantum, apart = fabs(i - left) + fabs(j - top);
#if NORMALS
        reach = fma(bend, apart, reach);
        float8 plane = fma(down, j, fma(right, i, base));
#if PARALLEL
        int8 yes = (r.z <= reach) | ((r.facing < 0.0f) & (plane >= reach * r.facing));
#else
        int8 yes = (r.z <= reach) | ((plane < 0.0f) & (r.along >= reach * plane));
#endif
#else
        int8 yes = r.z - wide * apart <= reach;
#endif
        passed -= yes;
        spoilt = m == m ? spoilt : m;
    }
    return convert_float8(passed) / (float)count + spoilt;
}

FN float8 sampled(light_map map, receiver r, float side, global const float *restrict places, int count)
{
    float reach = 0.5f * side + 1.0f;
    int8 inside = (r.u > reach) & (r.u < map.width - reach) & (r.v > reach) & (r.v < map.height - reach);
    return mask_any(~inside) ? sampled_in(map, r, places, count, 0) : sampled_in(map, r, places, count, 1);
}
#endif
#if QUICK
#include "settled.clh"
#endif

kernel void shadow(global const float *restrict where, global const float *restrict normals, global const float *restrict pixels,
                   global float *restrict out, global const double *restrict n, PLACES places,
                   global const double *restrict xs, global const double *restrict ys, int terms, int count, int map_width,
                   int map_height, int width, int height, global const uchar *restrict left_out)
{
    int per_row = (width + SPAN - 1) / SPAN, row = (int)get_global_id(0) / per_row;
    if (row >= height)
        return;
    int begin = ((int)get_global_id(0) % per_row) * SPAN, end = min(begin + SPAN, width);
    light_map map = {pixels, n, map_width, map_height};
#if QUICK
    approximate rough = approximated(map);
    sights found;
#endif
    for (int column = begin; column < end; column += LANES) {
        int there = min(end - column, LANES);
        ulong first = (ulong)row * width + column;
#if QUICK
        int at = (column - begin) % SEGMENT;
        if (at == 0)
            sought(map, &rough, where + first * 3, end - column, &found);
#endif
        if (left_out && left_out[row / TILE * ((width + TILE - 1) / TILE) + column / TILE]) {
            keep((float8)(0.0f), out + first, there);
            continue;
        }
#if QUICK
        float8 share;
        if (settled(map, &rough, &found, at, where + first * 3, normals + first * 3, there, &share)) {
            keep(share, out + first, there);
            continue;
        }
#endif
#if POSITION
        triple p = three(where + first * 3, there);
#else
        real8 x = REAL8(vload8(0, xs + column)), z = one(where + first, there);
        real y = (real)ys[row];
        if (terms == 1)
            z = z / sqrt(ONE + x * x + y * y);
        else if (terms == 2) {
            double8 below = n[44] + n[45] * convert_double8(z);
            z = REAL8(below <= 0.0 ? (double8)(INFINITY) : n[43] / below);
        }
        triple p = {x * z, y * z, -z};
#endif
        receiver r;
        real8 w = row_of(n + 12, p), per = ONE / w, u = row_of(n, p) * per, v = row_of(n + 4, p) * per;
        r.z = row_of(n + 8, p);
        r.quantum = QUANTUM * (((fabs(p.x) + fabs(p.y)) + fabs(p.z)) + (real)n[41]);
        real8 missing = (real8)((real)n[42]);
        mask8 nan = (p.x != p.x) | (p.y != p.y) | (p.z != p.z), dark = 0;
#if NORMALS
        triple m = three(normals + first * 3, there);
        r.along = (m.x * (p.x - (real)n[16]) + m.y * (p.y - (real)n[17])) + m.z * (p.z - (real)n[18]);
        r.facing = -dot_of(n + 25, m);
        r.right = dot_of(n + 19, m) * (real)n[28];
        r.down = -dot_of(n + 22, m) * (real)n[28];
        dark = (PARALLEL ? r.facing : r.along) > (real)0;
        nan |= (m.x != m.x) | (m.y != m.y) | (m.z != m.z);
#endif
        mask8 endless = (fabs(p.x) == (real8)(INFINITY)) | (fabs(p.y) == (real8)(INFINITY)) | (fabs(p.z) == (real8)(INFINITY));
        mask8 reaches = (w > (real)0) & (u > -(real)MARGIN) & (u < map_width + (real)MARGIN) & (v > -(real)MARGIN)
                        & (v < map_height + (real)MARGIN)
                        & ~dark & ~endless & ~nan;
        missing = dark ? ZERO : missing;
        missing = endless ? ONE : missing;
        missing = nan ? (real8)(NAN) : missing;
        r.u = reaches ? u : ZERO;
        r.v = reaches ? v : ZERO;
        real8 made = missing;
        if (mask_any(reaches)) {
#if KIND == 0
            double8 i = floor(r.u), j = floor(r.v), step, m0 = depths(map, i, j, &step);
            made = lit(map, r, m0, step, i, j);
#elif KIND == 1
            made = averaged(map, r, (double8)(n[46]), count);
#elif KIND == 2
            made = averaged(map, r, penumbra(map, r, n[46], count), count);
#elif KIND == 3
            made = chebyshev(map, r, n[46], count);
#else
            made = sampled(map, r, (real)n[46], places, count);
#endif
        }
        keep(convert_float8(reaches ? made : missing), out + first, there);
    }
}
