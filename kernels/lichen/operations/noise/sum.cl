// Octaves of a basis on a lattice, summed. octaves.py says what an octave is, fractal.py how they become one.
//
// One work-item takes a segment of a row: what the row meets of the lattice is found once for all its pixels. Built with
// BASIS (the header of the basis), DOUBLE, HIGHER (three or four dimensions), DERIVATIVES (whether they are computed) and
// WARPED (whether places may be moved): few programs, since each takes a second to build.

#define FRACTAL_NONE 0
#define FRACTAL_FBM 1
#define FRACTAL_TURBULENCE 2
#define FRACTAL_BILLOW 3
#define FRACTAL_RIDGED 4

#define TABLES (BASIS == 4)

#include "lanes.clh"
#include "gradient.clh"
#if BASIS == 0
#include "lattice.clh"
#elif BASIS == 1
#include "simplex.clh"
#elif BASIS == 2
#include "worley.clh"
#elif BASIS == 3
#include "impulses.clh"
#else
#include "wavelet.clh"
#endif

#define VECTORS 4
#define SEGMENT (VECTORS * LANES)

// Of one octave.
typedef struct {
    real factor, amplitude, kept, across, down, period_x, period_y, unused;
} Octave;

typedef struct {
    reals total, weight;
#if DERIVATIVES
    reals x, y, weight_x, weight_y;
#endif
} Sum;

// A ridge of magnitude q, whose derivatives are x and y: Summing._ridge.
NOISE_FN void ridge(Sum *sum, reals q, reals x, reals y, real amplitude)
{
    reals down = (real)1 - q, height = down * down, signal = sum->weight * height;
    sum->total += (real)2 * amplitude * signal;
    reals twice = (real)2 * signal, one = (reals)((real)1);
#if DERIVATIVES
    reals zero = (reals)((real)0);
    reals turned_x = sum->weight_x * height - (real)2 * sum->weight * down * x;
    reals turned_y = sum->weight_y * height - (real)2 * sum->weight * down * y;
    sum->x += (real)2 * amplitude * turned_x;
    sum->y += (real)2 * amplitude * turned_y;
    sum->weight_x = twice < one ? (real)2 * turned_x : zero;
    sum->weight_y = twice < one ? (real)2 * turned_y : zero;
#endif
    sum->weight = twice < one ? twice : one;
}

NOISE_FN void add(Sum *sum, reals n, reals x, reals y, Octave octave, real mean, int fractal)
{
    if (fractal >= FRACTAL_TURBULENCE) {
#if DERIVATIVES
        reals side = sign(n);
        x *= side;
        y *= side;
#endif
        n = fabs(n);
    }
    if (fractal == FRACTAL_RIDGED) {
        ridge(sum, octave.kept * n + ((real)1 - octave.kept) * mean, octave.kept * x, octave.kept * y, octave.amplitude);
        return;
    }
    sum->total = fma(octave.factor, n, sum->total);
#if DERIVATIVES
    sum->x = fma(octave.factor, x, sum->x);
    sum->y = fma(octave.factor, y, sum->y);
#endif
}

// Sixteen values of channel `channel` from pixel (column, row) on: to `planes` if there are any (the sum itself is wanted, to
// move places by), else to `out`.
NOISE_FN void put(reals v, global real *restrict planes, global float *restrict out, int channel, int channels,
                  int column, int row, int width, int height, int stride)
{
    if (planes) {
        vstore16(v, 0, planes + ((size_t)channel * height + row) * stride + column);
        return;
    }
#if DOUBLE
    float16 values = convert_float16(v);
#else
    float16 values = v;
#endif
    size_t at = ((size_t)row * width + column) * channels + channel;
    if (channels == 1 && column + LANES <= width) {
        vstore16(values, 0, out + at);
        return;
    }
    float each[LANES];
    vstore16(values, 0, each);
    for (int i = 0; i < LANES && column + i < width; i++)
        out[at + (size_t)i * channels] = each[i];
}

// `moved` are such planes: how places move along x and y, in units of `warp` px, each followed by its
// derivatives along x and y where those are wanted. `own` are numbers of the basis; `tables`, where it has any, one for
// each octave, in `table_rows` rows of `table_stride`.
kernel void sum(global const int *restrict column_cells, global const real *restrict columns,
                global const int *restrict row_cells, global const real *restrict rows, constant const uint *keys,
                constant const real *places, constant const real *terms, constant const real *own,
                global const real *restrict tables,
                global const real *restrict moved_x, global const real *restrict moved_y, global real *restrict planes,
                global float *restrict out, int width, int height, int stride, int channels, int octaves, int left, int fractal, int dimensions,
                int parts, int table_rows, int table_stride, real start, real mean, real middle, real half_range, real warp)
{
    const int segments = (width + SEGMENT - 1) / SEGMENT;
    const int first = (int)(get_global_id(0) % segments) * SEGMENT, row = (int)(get_global_id(0) / segments);
    if (row >= height)
        return;
    Sum sums[VECTORS];
    for (int v = 0; v < VECTORS; v++) {
        sums[v].total = (reals)(start);
        sums[v].weight = (reals)((real)1);
#if DERIVATIVES
        sums[v].x = sums[v].y = sums[v].weight_x = sums[v].weight_y = (reals)((real)0);
#endif
    }
    constant const Octave *all = (constant const Octave *)terms;
    #pragma unroll 1
    for (int k = 0; k < octaves; k++) {
        Octave octave = all[k];
        const int period_x = (int)octave.period_x, period_y = (int)octave.period_y;
        Slice slices[MOST_SLICES];
        #pragma unroll 1
        for (int i = 0; i < parts; i++) {
            constant const real *place = places + (k * parts + i) * 6;
            slices[i].key = vload2(k * parts + i, keys);
            slices[i].z = place[0];
            slices[i].w = place[1];
            slices[i].weight = place[2];
            slices[i].centred = place[3];
            slices[i].four = dimensions == 4;
            slices[i].count = parts;
#if TABLES
            slices[i].table = tables + (size_t)k * table_rows * table_stride;
            slices[i].stride = table_stride;
            slices[i].rows = (int)place[4];
            slices[i].columns = (int)place[5];
#endif
        }
        const int row_cell = row_cells[k * height + row];
        const real row_place = rows[k * height + row];
        Line lines[MOST_LINES];
#if !WARPED
        lines_at(lines, row_cell, row_place, slices, period_y, own);
#endif
        #pragma unroll 1
        for (int v = 0; v < VECTORS; v++) {
            const int column = first + v * LANES;
            if (column >= width)
                break;
            int16 cell = vload16(0, column_cells + (size_t)k * stride + column);
            reals x = vload16(0, columns + (size_t)k * stride + column);
#if WARPED
            size_t at = (size_t)row * stride + column;
            reals whole_x, whole_y;
            reals y = (reals)(row_place);
            if (moved_x) {
                x += warp * octave.across * vload16(0, moved_x + at);
                y += warp * octave.down * vload16(0, moved_y + at);
            }
            whole_x = floor(x);
            whole_y = floor(y);
            x -= whole_x;
            y -= whole_y;
            cell += convert_int16(whole_x);
            lines_at(lines, row_cell + convert_int16(whole_y), y, slices, period_y, own);
#endif
            reals along_x = (reals)((real)0), along_y = along_x;
            reals n = basis(cell, x, lines, slices, period_x, period_y, own, &along_x, &along_y);
            add(&sums[v], n, along_x * octave.across, along_y * octave.down, octave, mean, fractal);
        }
    }
    #pragma unroll 1
    for (int v = 0; v < VECTORS; v++) {
        const int column = first + v * LANES;
        if (column >= width)
            break;
        const reals zero = (reals)((real)0);
        if (fractal == FRACTAL_RIDGED) {
            #pragma unroll 1
            for (int k = 0; k < left; k++)
                ridge(&sums[v], (reals)(mean), zero, zero, all[octaves + k].amplitude);
        }
#if DERIVATIVES
        if (channels == 3) {
            reals slope_x = sums[v].x, slope_y = sums[v].y;
#if WARPED
            if (moved_x) {
                const size_t at = (size_t)row * stride + column, plane = (size_t)height * stride;
                reals x_x = vload16(0, moved_x + plane + at), x_y = vload16(0, moved_x + 2 * plane + at);
                reals y_x = vload16(0, moved_y + plane + at), y_y = vload16(0, moved_y + 2 * plane + at);
                slope_x = sums[v].x + warp * (sums[v].x * x_x + sums[v].y * y_x);
                slope_y = sums[v].y + warp * (sums[v].x * x_y + sums[v].y * y_y);
            }
#endif
            put(half_range * slope_x, planes, out, 1, channels, column, row, width, height, stride);
            put(half_range * slope_y, planes, out, 2, channels, column, row, width, height, stride);
        }
#endif
        put(middle + half_range * sums[v].total, planes, out, 0, channels, column, row, width, height, stride);
    }
}
