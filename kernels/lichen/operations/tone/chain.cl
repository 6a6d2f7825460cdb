// A chain of colour steps in one pass: sixteen pixels are split into planes, taken through every step in registers, and
// joined again. chain.py says what the steps are.
//
// Definitions given at build time, beside those of planes.clh:
//   STEPS    the steps as calls, each with the place of its numbers in k

#include "numeric.clh"
#include "piecewise.clh"
#include "../colour/planes.clh"

#define STEP static inline __attribute__((always_inline))

// Rows of four: factors, then what is added. A factor of zero takes no part.
STEP void matrix(float16 *v, global const float *k)
{
    float16 made[3];
    for (int row = 0; row < 3; row++) {
        float16 sum = (float16)(k[4 * row + 3]);
        for (int c = 0; c < 3; c++)
            if (k[4 * row + c] != 0.0f)
                sum = fma(v[c], (float16)(k[4 * row + c]), sum);
        made[row] = sum;
    }
    for (int row = 0; row < 3; row++)
        v[row] = made[row];
}

// The cell of a place between 0 and `last`, and in *part the place in it. NaN lies in cell 0 and keeps its part.
STEP int16 cell_of(float16 place, int last, float16 *part)
{
    int16 cell = min(convert_int16(place >= 0.0f ? place : (float16)(0.0f)), (int16)(last));
    *part = place - convert_float16(cell);
    return cell;
}

STEP float16 placed(float16 x, float low, float high, float scale)
{
    return (num_clamp(x, (float16)(low), (float16)(high)) - low) * scale;
}

// k: three lows, highs and scales, then size numbers for each channel.
STEP void table1(float16 *v, global const float *k, int size)
{
    for (int c = 0; c < 3; c++) {
        global const float *own = k + 9 + c * size;
        float16 part;
        int index[WIDTH];
        float first[WIDTH], second[WIDTH];
        vstore16(cell_of(placed(v[c], k[c], k[3 + c], k[6 + c]), size - 2, &part), 0, index);
        for (int i = 0; i < WIDTH; i++) {
            first[i] = own[index[i]];
            second[i] = own[index[i] + 1];
        }
        float16 low = vload16(0, first);
        v[c] = fma(vload16(0, second) - low, part, low);
    }
}

#define HALVES 0x7c00

// k: for each channel the entries of the finite halves from 0 on, then of those from -0 on.
STEP void half_table(float16 *v, global const float *k)
{
    for (int c = 0; c < 3; c++) {
        global const float *own = k + 2 * HALVES * c;
        float16 a = fabs(v[c]);
        a = a > 65504.0f ? (float16)(65504.0f) : a;
        int16 bits = as_int16(a), small = a < 0x1p-14f;
        int16 whole = convert_int16(small ? a * 0x1p24f : (float16)(0.0f));
        int16 at = small ? whole : (bits >> 13) - (112 << 10);
        float16 part = small ? fma(a, (float16)(0x1p24f), -convert_float16(whole))
                             : convert_float16(bits & 0x1fff) * 0x1p-13f;
        int16 last = at > HALVES - 2;
        part = last ? (float16)(1.0f) : part;
        at = (last ? (int16)(HALVES - 2) : at) + (v[c] < 0.0f ? (int16)(HALVES) : (int16)(0));
        int index[WIDTH];
        float first[WIDTH], second[WIDTH];
        vstore16(at, 0, index);
        for (int i = 0; i < WIDTH; i++) {
            first[i] = own[index[i]];
            second[i] = own[index[i] + 1];
        }
        float16 low = vload16(0, first), y = fma(vload16(0, second) - low, part, low);
        v[c] = v[c] == v[c] ? y : v[c];
    }
}

// k: three lows, highs and scales, then size^3 colours, red fastest.
STEP void table3(float16 *v, global const float *k, int size, int tetrahedral)
{
    float16 parts[3];
    int16 cells = (int16)(0);
    int step = 1;
    for (int c = 0; c < 3; c++) {
        cells += cell_of(placed(v[c], k[c], k[3 + c], k[6 + c]), size - 2, &parts[c]) * step;
        step *= size;
    }
    int index[WIDTH];
    float r[WIDTH], g[WIDTH], b[WIDTH], x[WIDTH], y[WIDTH], z[WIDTH];
    vstore16(cells, 0, index);
    vstore16(parts[0], 0, r);
    vstore16(parts[1], 0, g);
    vstore16(parts[2], 0, b);
    int down = size, deep = size * size, all = 1 + down + deep;
    for (int i = 0; i < WIDTH; i++) {
        global const float *t = k + 9 + 3 * index[i];
        float3 made;
        if (tetrahedral) {
            float big = fmax(r[i], fmax(g[i], b[i])), small = fmin(r[i], fmin(g[i], b[i]));
            float middle = fmax(fmin(r[i], g[i]), fmin(fmax(r[i], g[i]), b[i]));
            int along = r[i] >= g[i] ? (r[i] >= b[i] ? 1 : deep) : (g[i] >= b[i] ? down : deep);
            int but = b[i] <= g[i] ? (b[i] <= r[i] ? deep : 1) : (g[i] <= r[i] ? down : 1);
            made = vload3(0, t) * (1.0f - big) + vload3(along, t) * (big - middle)
                 + vload3(all - but, t) * (middle - small) + vload3(all, t) * small;
        } else {
            float3 near = mix(mix(vload3(0, t), vload3(1, t), r[i]), mix(vload3(down, t), vload3(down + 1, t), r[i]), g[i]);
            float3 far = mix(mix(vload3(deep, t), vload3(deep + 1, t), r[i]),
                             mix(vload3(deep + down, t), vload3(all, t), r[i]), g[i]);
            made = mix(near, far, b[i]);
        }
        x[i] = made.x, y[i] = made.y, z[i] = made.z;
    }
    int16 nan = (parts[0] != parts[0]) | (parts[1] != parts[1]) | (parts[2] != parts[2]);
    v[0] = nan ? (float16)(NAN) : vload16(0, x);
    v[1] = nan ? (float16)(NAN) : vload16(0, y);
    v[2] = nan ? (float16)(NAN) : vload16(0, z);
}

// One channel through a curve whose numbers are at `place`; `pieces` are calls of piecewise.clh.
#define CURVE(channel, place, mirrored, pieces)                                                       \
    {                                                                                                 \
        float16 a = v[channel], away = a, y;                                                          \
        if (mirrored) {                                                                               \
            away = (a + k[place]) + k[place + 1];                                                     \
            a = fabs(away);                                                                           \
        }                                                                                             \
        pieces                                                                                        \
        if (mirrored)                                                                                 \
            y = as_float16(as_int16(y) ^ (as_int16(away) & (int)0x80000000)) + k[place + 2];          \
        v[channel] = y;                                                                               \
    }

kernel void chain(global const float *restrict in, global float *restrict out, global const float *restrict k, int pixels)
{
    int end = run_end(pixels);
    for (int first = run_start(); first < end; first += WIDTH) {
        int count = min(end - first, WIDTH);
        global const float *from = in + (size_t)first * IN;
        float16 v[4];
        load_planes(from, count, v);
        STEPS
        store_planes(v, from, count, out + (size_t)first * OUT, pixels);
    }
}
