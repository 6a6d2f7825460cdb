// A scalar through a palette, with contours; colour_map.py is the definition. Places are computed in doubles, or in
// pairs of floats; colours that no line is drawn over in floats.
//
// WRAP: 0 clamp, 1 repeat, 2 mirror. BANDS 1: nearest entry. CONTOURS 1: lines are drawn. PAIRS 1: places in pairs of
// floats; 2: and `low` is 0. MADE channels of the palette; where they are four or fewer, an entry is one vector of four
// numbers, and how far the next is from it stands behind; one like the first stands before it. `n` holds low, range,
// spacing, offset, line width, six numbers for pairs, then the line's colour. A work-item does 64 pixels of a row: where
// each falls is found for all of them in full vectors, then entries are fetched pixel by pixel.
//
// What bounds it, 2048 x 2048 through three colours: instructions. Pairs of floats take 0.75 of what doubles do, from 0
// on 0.67, and places that cost nothing 0.6. Sixteen pixels that are put together in registers instead of in memory,
// where whole lines were read before the last four of them had been written, made 0.79 of it.

#include "stream.clh"

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define SEGMENT 64
#define ENTRY (MADE <= 4 ? 8 : MADE) // numbers
#define EACH for (int i = 0; i < SEGMENT; i++)

inline double slope(global const float *line, int at, int size, size_t stride)
{
    int before = max(at - 1, 0), after = min(at + 1, size - 1);
    return after > before ? ((double)line[after * stride] - (double)line[before * stride]) / (after - before) : 0.0;
}

// The colour a part of the way from an entry, so many numbers into the palette, to the next.
inline float4 between(int at, float part, global const float *palette)
{
    float8 both = vload8(0, palette + at);
    return fma((float4)(part), both.hi, both.lo);
}

kernel void map(global const float *restrict in, global const float *restrict palette, global float *restrict out,
                global const double *restrict n, int entries, int channels, int channel, int columns, int rows)
{
    int from = get_global_id(0) * SEGMENT, row = get_global_id(1);
    if (row >= rows || from >= columns)
        return;
    int count = min(SEGMENT, columns - from), cell[SEGMENT];
#if MADE <= 4 && !CONTOURS
    float part[SEGMENT];
#else
    double part[SEGMENT];
#endif
    // NaN where there is no value, which makes every channel so
#if MADE <= 4
    palette += ENTRY;
#endif
    global const float *line = in + (size_t)row * columns * channels + channel;
    double low = n[0], range = n[1], steps = BANDS ? entries : entries - 1;
    int last = max(BANDS ? entries - 1 : entries - 2, 0);
    float values[SEGMENT];
    if (channels == 1 && count == SEGMENT)
        EACH values[i] = line[from + i];
    else
        EACH values[i] = line[(size_t)min(from + i, columns - 1) * channels];
#if PAIRS
    // A value less `low` and what rounding lost of it, times two parts of a scale: the cell is the right one or beside it.
    // Values beyond the ends are brought within a cell of them, where the palette goes on as it ends.
    float least = (float)n[5], most = (float)n[6], low0 = (float)n[7], low1 = (float)n[8];
    float scale0 = (float)n[9], scale1 = (float)n[10];
    EACH {
        float v = values[i];
        v = v < least ? least : v;
        v = v > most ? most : v;
#if PAIRS == 1
        float off = v - low0, back = off - v, lost = (v - (off - back)) - (low0 + back) - low1;
        float near = floor(off * scale0), rest = fma(off, scale0, -near) + fma(off, scale1, lost * scale0);
#else
        float near = floor(v * scale0), rest = fma(v, scale1, fma(v, scale0, -near));
#endif
        float whole = floor(rest);
        part[i] = rest - whole;
        whole += near;
        cell[i] = (int)(whole > -1.0f ? whole : -1.0f) * ENTRY; // NaN, too
    }
#else
    EACH {
        double t = ((double)values[i] - low) / range;
#if WRAP == 0
        t = t < 0.0 ? 0.0 : t;
        t = t > 1.0 ? 1.0 : t;
#elif WRAP == 1
        t = t - floor(t);
#else
        t = t - 2.0 * floor(t * 0.5);
        t = t > 1.0 ? 2.0 - t : t;
#endif
        double place = t != t ? 0.0 : t * steps;
        int at = (int)place;
        at = at < last ? at : last;
        at = at > 0 ? at : 0;
        cell[i] = at * ENTRY;
        double rest = BANDS ? 0.0 : place - at;
        part[i] = t != t ? NAN : rest;
    }
#endif
#if CONTOURS
    double covers[SEGMENT];
    for (int i = 0; i < count; i++) {
        int column = from + i;
        double v = line[(size_t)column * channels];
        double dx = slope(line, column, columns, channels);
        double dy = slope(in + (size_t)column * channels + channel, row, rows, (size_t)columns * channels);
        double steep = sqrt(dx * dx + dy * dy), u = (v - n[3]) / n[2];
        double off = fabs(u - rint(u)) * n[2], cover = n[4] * 0.5 + 0.5 - off / steep;
        covers[i] = steep > 0.0 && steep < INFINITY ? (cover < 0.0 ? 0.0 : (cover > 1.0 ? 1.0 : cover)) : 0.0;
    }
#endif
    global float *y = out + ((size_t)row * columns + from) * MADE;
#if MADE <= 4
#if MADE >= 3 && !CONTOURS
    if (count == SEGMENT) { // whole lines, put together in registers
        for (int i = 0; i < SEGMENT; i += 16, y += 16 * MADE) {
            float4 c[16];
#pragma unroll
            for (int k = 0; k < 16; k++)
                c[k] = between(cell[i + k], part[i + k], palette);
#if MADE == 3
            const float16 lines[3] = {
                (float16)(c[0].xyz, c[1].xyz, c[2].xyz, c[3].xyz, c[4].xyz, c[5].x),
                (float16)(c[5].yz, c[6].xyz, c[7].xyz, c[8].xyz, c[9].xyz, c[10].xy),
                (float16)(c[10].z, c[11].xyz, c[12].xyz, c[13].xyz, c[14].xyz, c[15].xyz),
            };
#else
            const float16 lines[4] = {
                (float16)(c[0], c[1], c[2], c[3]), (float16)(c[4], c[5], c[6], c[7]),
                (float16)(c[8], c[9], c[10], c[11]), (float16)(c[12], c[13], c[14], c[15]),
            };
#endif
            stream_store(lines, MADE, y, (ulong)columns * rows * MADE);
        }
        return;
    }
#endif
    // Pixels of fewer channels are written as four, one over the end of the other, and go out as whole lines.
    float made[SEGMENT * MADE + 4];
    for (int i = 0; i < count; i++) {
#if !CONTOURS
        vstore4(between(cell[i], part[i], palette), 0, made + i * MADE);
#else
        float8 both = vload8(0, palette + cell[i]);
        double4 colour = convert_double4(both.lo) + part[i] * convert_double4(both.hi);
        double4 drawn = (double4)(n[11], MADE > 1 ? n[12] : 0.0, MADE > 2 ? n[13] : 0.0, MADE > 3 ? n[14] : 0.0);
        colour = colour + covers[i] * (drawn - colour);
        vstore4(convert_float4(colour), 0, made + i * MADE);
#endif
    }
    if (count == SEGMENT)
        for (int i = 0; i < SEGMENT * MADE; i += 16)
            stream_store16(vload16(0, made + i), y + i, (ulong)columns * rows * MADE);
    else
        for (int i = 0; i < count * MADE; i++)
            y[i] = made[i];
#else
    for (int i = 0; i < count; i++)
        for (int c = 0; c < MADE; c++) {
            int after = min(cell[i] + ENTRY, (entries - 1) * ENTRY);
            double here = palette[cell[i] + c], next = palette[after + c];
            double colour = here + part[i] * (next - here);
#if CONTOURS
            colour = colour + covers[i] * (n[11 + c] - colour);
#endif
            y[i * MADE + c] = (float)colour;
        }
#endif
}
