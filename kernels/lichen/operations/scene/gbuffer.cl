// What rays meet in a scene, eight pixels of a row at a time, in doubles; casting.py is the definition, operation for
// operation.
//
// BLOBS and TERRAINS are 1 where there are any: their code takes long to compile. `buffer` is the place of what is
// asked for in its enumeration, `channels` are those of the result. `eyes` holds the eye, the axes right, up and back,
// 1 for a camera without perspective, the farthest surface, the frame (1: the world's), and the matrix to pixels.
// Objects and materials take 16 doubles each; `balls` holds balls, 4 each, and heights behind them.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#include "mask.clh"

#define SEGMENT 64
#define LANES 8
#define WIDTH 16
#define STEPS 256
#define FN static inline __attribute__((always_inline))
#define ZERO ((double8)(0.0))

enum { DEPTH, DISTANCE, POSITION, NORMAL, ALBEDO, ROUGHNESS, MASK, HEIGHT, MOTION, EMISSIVE };

typedef struct { double8 x, y, z; } triple;

FN double8 dot3(triple a, triple b) { return (a.x * b.x + a.y * b.y) + a.z * b.z; }
FN triple from(triple o, global const double *restrict c)
{
    return (triple){o.x - c[0], o.y - c[1], o.z - c[2]};
}
FN triple along(triple o, double8 t, triple d) { return (triple){o.x + t * d.x, o.y + t * d.y, o.z + t * d.z}; }
FN triple choose(long8 which, triple yes, triple no)
{
    return (triple){which ? yes.x : no.x, which ? yes.y : no.y, which ? yes.z : no.z};
}

FN void ball(global const double *restrict c, double radius, triple origin, triple d, double8 *enter, double8 *leave)
{
    triple o = from(origin, c);
    double8 a = dot3(d, d), b = dot3(o, d), m = b / a;
    triple l = {o.x - m * d.x, o.y - m * d.y, o.z - m * d.z};
    double8 within = a * (radius * radius - dot3(l, l));
    double8 root = sqrt(within >= 0.0 ? within : (double8)(NAN));
    double8 q = b >= 0.0 ? -(b + root) : root - b;
    double8 first = (dot3(o, o) - radius * radius) / q, second = q / a;
    *enter = first < second ? first : second;
    *leave = first < second ? second : first;
}

FN double8 blob_distance(global const double *restrict balls, int count, double k, triple p, triple *slope)
{
    double8 total = 0.0;
    for (int i = 0; i < count; i++, balls += 4) {
        triple v = from(p, balls);
        double8 length = sqrt(dot3(v, v)), d = length - balls[3];
        triple g = {v.x / length, v.y / length, v.z / length};
        if (i == 0) {
            total = d, *slope = g;
            continue;
        }
        double8 h = k - fabs(total - d);
        h = h > 0.0 ? h / k : (double8)(0.0);
        double8 m = h * 0.5;
        long8 first = total < d;
        triple kept = {slope->x + (g.x - slope->x) * m, slope->y + (g.y - slope->y) * m, slope->z + (g.z - slope->z) * m};
        triple taken = {g.x + (slope->x - g.x) * m, g.y + (slope->y - g.y) * m, g.z + (slope->z - g.z) * m};
        *slope = choose(first, kept, taken);
        total = (first ? total : d) - ((h * h) * k) * 0.25;
    }
    return total;
}

FN double8 blob(global const double *restrict row, global const double *restrict balls, triple origin, triple d, triple *n)
{
    double8 enter, leave, found = (double8)(NAN), length = sqrt(dot3(d, d));
    ball(row + 1, row[4], origin, d, &enter, &leave);
    global const double *restrict mine = balls + 4 * (int)row[6];
    int count = (int)row[7];
    double8 t = enter > 0.0 ? enter : (double8)(0.0);
    long8 live = leave > 0.0;
    triple slope;
    for (int step = 0; step < STEPS && mask_any(live); step++) {
        double8 gap = fabs(blob_distance(mine, count, row[5], along(origin, t, d), &slope));
        long8 arrived = live & (gap < 0x1p-30 * (1.0 + t * length));
        found = arrived ? t : found;
        t = live ? t + gap / length : t;
        live = live & ~arrived & (t <= leave);
    }
    blob_distance(mine, count, row[5], along(origin, found, d), &slope);
    double8 size = sqrt(dot3(slope, slope));
    *n = (triple){slope.x / size, slope.y / size, slope.z / size};
    return found;
}

FN double8 box(global const double *restrict row, triple origin, triple d, triple *n)
{
    double c = row[7], s = row[8];
    triple p = from(origin, row + 1);
    double8 o[3] = {p.x * c - p.z * s, p.y, p.x * s + p.z * c};
    double8 e[3] = {d.x * c - d.z * s, d.y, d.x * s + d.z * c};
    double8 near = (double8)(-INFINITY), far = (double8)(INFINITY);
    long8 entered = 0, left = 0;
    for (int axis = 0; axis < 3; axis++) {
        double half_side = row[4 + axis];
        long8 level = e[axis] == 0.0, inside = fabs(o[axis]) <= half_side;
        double8 one = (-half_side - o[axis]) / e[axis], other = (half_side - o[axis]) / e[axis];
        double8 low = one < other ? one : other, high = one < other ? other : one;
        low = level ? (inside ? (double8)(-INFINITY) : (double8)(INFINITY)) : low;
        high = level ? (inside ? (double8)(INFINITY) : (double8)(-INFINITY)) : high;
        entered = low > near ? (long8)(axis) : entered;
        near = low > near ? low : near;
        left = high < far ? (long8)(axis) : left;
        far = high < far ? high : far;
    }
    long8 at = near > 0.0 ? entered : left;
    double8 one = (double8)(1.0), none = (double8)(0.0), x = at == 0 ? one : none, z = at == 2 ? one : none;
    *n = (triple){x * c + z * s, at == 1 ? one : none, z * c - x * s};
    return near <= far ? (near > 0.0 ? near : far) : (double8)(NAN);
}

#include "terrain.clh"

FN double8 met(global const double *restrict row, global const double *restrict balls, triple o, triple d, triple *n)
{
    switch ((int)row[0]) {
    case 0: {
        double8 enter, leave;
        ball(row + 1, row[4], o, d, &enter, &leave);
        double8 t = enter > 0.0 ? enter : leave;
        triple p = from(along(o, t, d), row + 1);
        *n = (triple){p.x / row[4], p.y / row[4], p.z / row[4]};
        return t;
    }
    case 1: {
        double a = row[1], b = row[2], c = row[3];
        *n = (triple){(double8)(a), (double8)(b), (double8)(c)};
        return (row[4] - ((a * o.x + b * o.y) + c * o.z)) / ((a * d.x + b * d.y) + c * d.z);
    }
#if BLOBS
    case 3: return blob(row, balls, o, d, n);
#endif
#if TERRAINS
    case 4: return terrain(row, balls, o, d, n);
#endif
    default: return box(row, o, d, n);
    }
}

// A number of every lane's material.
FN double8 made_of(global const double *restrict materials, int objects, long8 index, int what)
{
    double8 v = 0.0;
    for (int k = 0; k < objects; k++)
        v = index == (long8)(k) ? (double8)(materials[k * WIDTH + what]) : v;
    return v;
}

FN double8 row_of(global const double *restrict m, triple p) { return ((m[0] * p.x + m[1] * p.y) + m[2] * p.z) + m[3]; }

kernel void gbuffer(global float *restrict out, global const double *restrict eyes, global const double *restrict objects,
                    global const double *restrict balls, global const double *restrict materials,
                    global const double *restrict xs, global const double *restrict ys, int buffer, int channels, int count, int width,
                    int height)
{
    int per_row = (width + SEGMENT - 1) / SEGMENT, row = (int)get_global_id(0) / per_row;
    if (row >= height)
        return;
    int begin = ((int)get_global_id(0) % per_row) * SEGMENT, end = min(begin + SEGMENT, width);
    global const double *right = eyes + 3, *up = eyes + 6, *back = eyes + 9, *matrix = eyes + 15;
    double y = ys[row], far = eyes[13];
    bool parallel = eyes[12] != 0.0, world = eyes[14] != 0.0;
    for (int column = begin; column < end; column += LANES) {
        double8 x = vload8(0, xs + column), best = (double8)(INFINITY), zero = (double8)(0.0);
        triple o = {(double8)(eyes[0]), (double8)(eyes[1]), (double8)(eyes[2])};
        triple d = {(double8)(-back[0]), (double8)(-back[1]), (double8)(-back[2])};
        if (parallel) {
            o.x = (eyes[0] + x * right[0]) + y * up[0];
            o.y = (eyes[1] + x * right[1]) + y * up[1];
            o.z = (eyes[2] + x * right[2]) + y * up[2];
        } else {
            d.x = (x * right[0] + y * up[0]) - back[0];
            d.y = (x * right[1] + y * up[1]) - back[1];
            d.z = (x * right[2] + y * up[2]) - back[2];
        }
        long8 index = -1;
        triple n = {zero, zero, zero}, mine;
        for (int k = 0; k < count; k++) {
            double8 t = met(objects + k * WIDTH, balls, o, d, &mine);
            long8 nearer = (t > 0.0) & (t <= far) & (t < best);
            best = nearer ? t : best;
            index = nearer ? (long8)(k) : index;
            n = choose(nearer, mine, n);
        }
        long8 hit = index >= 0;
        double8 v[3] = {zero, zero, zero};
        triple p = along(o, best, d);
        if (buffer == DEPTH)
            v[0] = best;
        else if (buffer == DISTANCE)
            v[0] = best * sqrt(dot3(d, d));
        else if (buffer == POSITION && world) {
            v[0] = hit ? p.x : best, v[1] = hit ? p.y : best, v[2] = hit ? p.z : best;
        } else if (buffer == POSITION) {
            v[0] = hit ? (parallel ? x : x * best) : best;
            v[1] = hit ? (parallel ? (double8)(y) : y * best) : best;
            v[2] = hit ? -best : best;
        } else if (buffer == NORMAL) {
            long8 away = dot3(n, d) > 0.0;
            n = choose(away, (triple){-n.x, -n.y, -n.z}, n);
            if (world)
                v[0] = n.x, v[1] = n.y, v[2] = n.z;
            else {
                v[0] = (n.x * right[0] + n.y * right[1]) + n.z * right[2];
                v[1] = (n.x * up[0] + n.y * up[1]) + n.z * up[2];
                v[2] = (n.x * back[0] + n.y * back[1]) + n.z * back[2];
            }
        } else if (buffer == ALBEDO) {
            double8 side = made_of(materials, count, index, 6);
            double8 f = (floor(p.x / side) + floor(p.y / side + 0.5)) + floor(p.z / side);
            long8 odd = hit & (side > 0.0) & (f - 2.0 * floor(f * 0.5) == 1.0);
            for (int c = 0; c < 3; c++)
                v[c] = odd ? made_of(materials, count, index, 3 + c) : made_of(materials, count, index, c);
        } else if (buffer == ROUGHNESS)
            v[0] = hit ? made_of(materials, count, index, 7) : (double8)(1.0);
        else if (buffer == MASK)
            v[0] = made_of(materials, count, index, 8);
        else if (buffer == HEIGHT)
            v[0] = hit ? p.y : zero;
        else if (buffer == MOTION) {
            triple q = {p.x - made_of(materials, count, index, 10), p.y - made_of(materials, count, index, 11),
                        p.z - made_of(materials, count, index, 12)};
            double8 w = row_of(matrix + 12, p), before = row_of(matrix + 12, q);
            long8 seen = hit & (before > 0.0);
            v[0] = seen ? row_of(matrix, p) / w - row_of(matrix, q) / before : zero;
            v[1] = seen ? row_of(matrix + 4, p) / w - row_of(matrix + 4, q) / before : zero;
        } else
            v[0] = made_of(materials, count, index, 9);
        int there = min(end - column, LANES);
        global float *to = out + ((ulong)row * width + column) * channels;
        for (int c = 0; c < channels; c++) {
            float lane[LANES];
            vstore8(convert_float8(v[c]), 0, lane);
            for (int i = 0; i < there; i++)
                to[i * channels + c] = lane[i];
        }
    }
}
