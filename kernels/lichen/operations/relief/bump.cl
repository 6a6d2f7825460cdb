// Normals bent by a relief, a run of 64 pixels of a row an item; bump.py is the definition. `bump` follows it operation
// for operation, in doubles, four pixels at a time; `bump_single` in float32, eight at a time.
#include "../compositing/planes.clh"
#include "mask.clh"
#include "vector.clh"

#define RUN 64
#define FRAMED (RUN + 2)
#define WIDE 8
#define BUMP_FN static inline __attribute__((always_inline))

// A row of points and heights with one more on either side; outside of the picture there are none.
typedef struct {
    float x[FRAMED], y[FRAMED], z[FRAMED], rise[FRAMED];
} Row;

BUMP_FN void row_put(Row *row, int i, float16 x, float16 y, float16 z, float16 rise)
{
    vstore16(x, 0, row->x + i);
    vstore16(y, 0, row->y + i);
    vstore16(z, 0, row->z + i);
    vstore16(rise, 0, row->rise + i);
}

BUMP_FN void row_end(Row *row, int i, global const float *restrict position, global const float *restrict height,
                     size_t at, bool there)
{
    row->x[i] = there ? position[3 * at] : NAN;
    row->y[i] = there ? position[3 * at + 1] : NAN;
    row->z[i] = there ? position[3 * at + 2] : NAN;
    row->rise[i] = there ? height[at] : NAN;
}

BUMP_FN void row_read(Row *row, global const float *restrict position, global const float *restrict height, int wide,
                      int tall, int first, int y)
{
    bool inside = y >= 0 && y < tall;
    size_t line = inside ? (size_t)y * wide : 0;
    int count = inside ? min(RUN, wide - first) : 0;
    for (int i = 0; i < RUN; i += LANES) {
        float16 none = NAN, v[3] = {none, none, none};
        if (i + LANES <= count) {
            split3(position + (line + first + i) * 3, v);
            row_put(row, i + 1, v[0], v[1], v[2], vload16(0, height + line + first + i));
            continue;
        }
        row_put(row, i + 1, none, none, none, none);
        for (int k = i; k < count; k++)
            row_end(row, k + 1, position, height, line + first + k, true);
    }
    row_end(row, 0, position, height, inside && first > 0 ? line + first - 1 : 0, inside && first > 0);
    bool more = inside && first + RUN < wide;
    row_end(row, RUN + 1, position, height, more ? line + first + RUN : 0, more);
}

// ---------------------------------------------------------------------------------------------------------- float32

// A point and its height, for each of the lanes.
typedef struct {
    vector8 p;
    float8 h;
} Spot;

BUMP_FN Spot spot(const Row *row, int at)
{
    Spot made;
    made.p = vector(vload8(0, row->x + at), vload8(0, row->y + at), vload8(0, row->z + at));
    made.h = vload8(0, row->rise + at);
    return made;
}

BUMP_FN int8 known(float8 a) { return fabs(a) < (float8)(INFINITY); }

BUMP_FN int8 placed(vector8 p) { return known(p.x) & known(p.y) & known(p.z); }

BUMP_FN vector8 chosen(int8 which, vector8 a, vector8 b)
{
    return vector(which ? a.x : b.x, which ? a.y : b.y, which ? a.z : b.z);
}

// Half of the way from b to a, which no two floats make overflow.
BUMP_FN Spot between(Spot a, Spot b)
{
    Spot made;
    made.p = vector_subtract(vector_scale(a.p, (float8)(0.5f)), vector_scale(b.p, (float8)(0.5f)));
    made.h = a.h * 0.5f - b.h * 0.5f;
    return made;
}

// How the point and the height change along an axis, the larger of them near 1; 0 where there is no neighbour.
BUMP_FN Spot change(Spot before, Spot here, Spot after, float jump)
{
    int8 has_before = placed(before.p) & known(before.h), has_after = placed(after.p) & known(after.h);
    Spot back = between(here, before), on = between(after, here), both = between(after, before);
    float8 behind = vector_length(back.p), ahead = vector_length(on.p);
    int8 torn_before = (ahead > 0.0f) & (behind > jump * ahead), torn_after = (behind > 0.0f) & (ahead > jump * behind);
    int8 only_after = has_after & (~has_before | torn_before), only_before = has_before & (~has_after | torn_after);
    Spot made;
    made.p = chosen(only_after, on.p, chosen(only_before, back.p, both.p));
    made.h = only_after ? on.h : (only_before ? back.h : both.h);
    int8 any = has_before | has_after;
    made.p = chosen(any, made.p, vector((float8)(0.0f), (float8)(0.0f), (float8)(0.0f)));
    made.h = any ? made.h : 0.0f;
    float8 larger = fabs(made.p.y) > fabs(made.p.z) ? made.p.y : made.p.z;
    float8 power = vector_power(vector(made.p.x, larger, made.h));
    made.p = vector_scale(made.p, power);
    made.h *= power;
    return made;
}

BUMP_FN int8 level(Spot here, Spot there) { return (here.h == there.h) | ~known(there.h); }

BUMP_FN vector8 bent(vector8 n, Spot left, Spot right, Spot above, Spot below, Spot here, float scale, float jump)
{
    int8 number = ~isnan(here.p.x) & ~isnan(here.p.y) & ~isnan(here.p.z), nowhere = number & ~placed(here.p);
    int8 flat = level(here, left) & level(here, right) & level(here, above) & level(here, below);
    int8 kept = nowhere | (known(here.h) & (flat | (int8)(scale == 0.0f ? -1 : 0)));
    if (mask_all(kept))
        return n;
    Spot x = change(left, here, right, jump), y = change(above, here, below, jump);
    vector8 unit = vector_unit(n);
    vector8 along = vector_cross(y.p, unit), across = vector_cross(unit, x.p);
    float8 det = vector_dot(x.p, along), rise = x.h * scale, fall = y.h * scale;
    float8 turned = det < 0.0f ? (float8)(-1.0f) : (float8)(1.0f);
    vector8 slope = vector_along(along, turned * rise, vector_scale(across, turned * fall));
    vector8 made = vector_unit(vector_subtract(vector_scale(unit, fabs(det)), slope));
    int8 whole = placed(here.p) & known(here.h);
    kept |= whole & ((det == 0.0f) | ((rise == 0.0f) & (fall == 0.0f)));
    made = chosen(whole, made, vector((float8)(NAN), (float8)(NAN), (float8)(NAN)));
    return chosen(kept, n, made);
}

kernel void bump_single(global const float *restrict normal, global const float *restrict position,
                        global const float *restrict height, global float *restrict out, int wide, int tall,
                        float scale, float jump)
{
    int first = get_global_id(0) * RUN, y = get_global_id(1);
    if (first >= wide || y >= tall)
        return;
    Row above, here, below;
    row_read(&above, position, height, wide, tall, first, y - 1);
    row_read(&here, position, height, wide, tall, first, y);
    row_read(&below, position, height, wide, tall, first, y + 1);
    size_t line = (size_t)y * wide + first;
    for (int i = 0; i < RUN && first + i < wide; i += LANES) {
        int count = min(LANES, wide - first - i);
        float16 n[3];
        float lane[3][LANES];
        planes_load(normal + (line + i) * 3, 3, 3, count, n);
        for (int c = 0; c < 3; c++)
            vstore16(n[c], 0, lane[c]);
        for (int k = 0; k < LANES; k += WIDE) {
            vector8 some = vector(vload8(0, lane[0] + k), vload8(0, lane[1] + k), vload8(0, lane[2] + k));
            int at = i + k;
            some = bent(some, spot(&here, at), spot(&here, at + 2), spot(&above, at + 1), spot(&below, at + 1),
                        spot(&here, at + 1), scale, jump);
            vstore8(some.x, 0, lane[0] + k);
            vstore8(some.y, 0, lane[1] + k);
            vstore8(some.z, 0, lane[2] + k);
        }
        for (int c = 0; c < 3; c++)
            n[c] = vload16(0, lane[c]);
        planes_store(n, out + (line + i) * 3, 3, count);
    }
}

#ifdef cl_khr_fp64
// ---------------------------------------------------------------------------------------------------------- doubles

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define FINE 4

typedef struct {
    double4 x, y, z;
} Vector;

// A point and its height.
typedef struct {
    Vector p;
    double4 h;
    long4 whole, number;
} Place;

BUMP_FN Vector triple(double4 x, double4 y, double4 z)
{
    Vector made;
    made.x = x;
    made.y = y;
    made.z = z;
    return made;
}

BUMP_FN Vector less(Vector a, Vector b) { return triple(a.x - b.x, a.y - b.y, a.z - b.z); }

BUMP_FN Vector times(Vector a, double4 by) { return triple(a.x * by, a.y * by, a.z * by); }

BUMP_FN double4 dotted(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

BUMP_FN Vector crossed(Vector a, Vector b)
{
    return triple(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

BUMP_FN Vector either(long4 which, Vector a, Vector b)
{
    return triple(which ? a.x : b.x, which ? a.y : b.y, which ? a.z : b.z);
}

BUMP_FN long4 finite(double4 a) { return fabs(a) < (double4)(INFINITY); }

BUMP_FN Place place(const Row *row, int at)
{
    Place made;
    made.p = triple(convert_double4(vload4(0, row->x + at)), convert_double4(vload4(0, row->y + at)),
                    convert_double4(vload4(0, row->z + at)));
    made.h = convert_double4(vload4(0, row->rise + at));
    long4 there = finite(made.p.x) & finite(made.p.y) & finite(made.p.z);
    made.number = (made.p.x == made.p.x) & (made.p.y == made.p.y) & (made.p.z == made.p.z);
    made.whole = there & finite(made.h);
    return made;
}

// How the point and the height change along an axis; 0 where there is no neighbour.
BUMP_FN Vector step_of(Place before, Place here, Place after, double square, double4 *rise)
{
    Vector back = less(here.p, before.p), on = less(after.p, here.p);
    double4 behind = dotted(back, back), ahead = dotted(on, on);
    long4 torn_before = (ahead > 0.0) & (behind > square * ahead), torn_after = (behind > 0.0) & (ahead > square * behind);
    long4 only_after = after.whole & (~before.whole | torn_before);
    long4 only_before = before.whole & (~after.whole | torn_after);
    long4 any = before.whole | after.whole;
    double4 zero = 0.0;
    Vector made = either(only_before, back, times(less(after.p, before.p), (double4)(0.5)));
    made = either(any, either(only_after, on, made), triple(zero, zero, zero));
    *rise = only_before ? here.h - before.h : (after.h - before.h) * 0.5;
    *rise = any ? (only_after ? after.h - here.h : *rise) : zero;
    return made;
}

BUMP_FN long4 same(Place here, Place there) { return (here.h == there.h) | ~finite(there.h); }

BUMP_FN Vector bent_fine(Vector n, Place left, Place right, Place above, Place below, Place here, double scale,
                         double square)
{
    long4 nowhere = here.number & ~(finite(here.p.x) & finite(here.p.y) & finite(here.p.z));
    long4 flat = same(here, left) & same(here, right) & same(here, above) & same(here, below);
    long4 kept = nowhere | (finite(here.h) & (flat | (long4)(scale == 0.0 ? -1 : 0)));
    if (!mask_any(~kept))
        return n;
    double4 rise, fall;
    Vector x = step_of(left, here, right, square, &rise), y = step_of(above, here, below, square, &fall);
    rise *= scale;
    fall *= scale;
    double4 length = dotted(n, n);
    Vector unit = times(n, 1.0 / (length == 0.0 ? (double4)(1.0) : sqrt(length)));
    Vector along = crossed(y, unit), across = crossed(unit, x);
    double4 det = dotted(x, along), size = fabs(det), turned = det < 0.0 ? (double4)(-1.0) : (double4)(1.0);
    Vector made = triple(size * unit.x - turned * (rise * along.x + fall * across.x),
                         size * unit.y - turned * (rise * along.y + fall * across.y),
                         size * unit.z - turned * (rise * along.z + fall * across.z));
    made = times(made, 1.0 / sqrt(dotted(made, made)));
    kept |= here.whole & ((det == 0.0) | ((rise == 0.0) & (fall == 0.0)));
    double4 none = NAN;
    return either(kept, n, either(here.whole, made, triple(none, none, none)));
}

kernel void bump(global const float *restrict normal, global const float *restrict position,
                 global const float *restrict height, global float *restrict out, int wide, int tall, double scale,
                 double jump)
{
    int first = get_global_id(0) * RUN, y = get_global_id(1);
    if (first >= wide || y >= tall)
        return;
    Row above, here, below;
    row_read(&above, position, height, wide, tall, first, y - 1);
    row_read(&here, position, height, wide, tall, first, y);
    row_read(&below, position, height, wide, tall, first, y + 1);
    size_t line = (size_t)y * wide + first;
    for (int i = 0; i < RUN && first + i < wide; i += LANES) {
        int count = min(LANES, wide - first - i);
        float16 n[3];
        float lane[3][LANES];
        planes_load(normal + (line + i) * 3, 3, 3, count, n);
        for (int c = 0; c < 3; c++)
            vstore16(n[c], 0, lane[c]);
        for (int k = 0; k < LANES; k += FINE) {
            Vector some = triple(convert_double4(vload4(0, lane[0] + k)), convert_double4(vload4(0, lane[1] + k)),
                                 convert_double4(vload4(0, lane[2] + k)));
            int at = i + k;
            some = bent_fine(some, place(&here, at), place(&here, at + 2), place(&above, at + 1),
                             place(&below, at + 1), place(&here, at + 1), scale, jump * jump);
            vstore4(convert_float4(some.x), 0, lane[0] + k);
            vstore4(convert_float4(some.y), 0, lane[1] + k);
            vstore4(convert_float4(some.z), 0, lane[2] + k);
        }
        for (int c = 0; c < 3; c++)
            n[c] = vload16(0, lane[c]);
        planes_store(n, out + (line + i) * 3, 3, count);
    }
}
#endif
