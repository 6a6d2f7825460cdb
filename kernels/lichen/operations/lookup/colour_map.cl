// A scalar through a palette, with contours; colour_map.py is the definition. Places are computed in doubles.
//
// WRAP: 0 clamp, 1 repeat, 2 mirror. BANDS 1: nearest entry. CONTOURS 1: lines are drawn. MADE channels of the palette.
// `n` holds low, range, spacing, offset, line width, then the line's colour. One work-item for 64 pixels of a row.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define SEGMENT 64

inline double slope(global const float *line, int at, int size, size_t stride)
{
    int before = max(at - 1, 0), after = min(at + 1, size - 1);
    return after > before ? ((double)line[after * stride] - (double)line[before * stride]) / (after - before) : 0.0;
}

kernel void map(global const float *restrict in, global const float *restrict palette, global float *restrict out,
                global const double *restrict n, int entries, int channels, int channel, int columns, int rows)
{
    int from = get_global_id(0) * SEGMENT, to = min(from + SEGMENT, columns), row = get_global_id(1);
    if (row >= rows)
        return;
    global const float *line = in + (size_t)row * columns * channels + channel;
    for (int column = from; column < to; column++) {
        double v = line[(size_t)column * channels], t = (v - n[0]) / n[1];
#if WRAP == 0
        t = t < 0.0 ? 0.0 : (t > 1.0 ? 1.0 : t);
#elif WRAP == 1
        t = t - floor(t);
#else
        t = t - 2.0 * floor(t * 0.5);
        t = t > 1.0 ? 2.0 - t : t;
#endif
        bool nan = t != t;
        double place = nan ? 0.0 : t * (BANDS ? entries : entries - 1);
        int cell = clamp((int)place, 0, max(BANDS ? entries - 1 : entries - 2, 0));
        double part = BANDS ? 0.0 : place - cell;
        double cover = 0.0;
#if CONTOURS
        double dx = slope(line, column, columns, channels);
        double dy = slope(in + (size_t)column * channels + channel, row, rows, (size_t)columns * channels);
        double steep = sqrt(dx * dx + dy * dy), u = (v - n[3]) / n[2];
        double off = fabs(u - rint(u)) * n[2];
        cover = n[4] * 0.5 + 0.5 - off / steep;
        cover = steep > 0.0 && steep < INFINITY ? (cover < 0.0 ? 0.0 : (cover > 1.0 ? 1.0 : cover)) : 0.0;
#endif
        global const float *here = palette + (size_t)cell * MADE, *next = palette + (size_t)min(cell + 1, entries - 1) * MADE;
        global float *y = out + ((size_t)row * columns + column) * MADE;
        for (int c = 0; c < MADE; c++) {
            double colour = here[c] + part * ((double)next[c] - here[c]);
#if CONTOURS
            colour = colour + cover * (n[5 + c] - colour);
#endif
            y[c] = nan ? NAN : (float)colour;
        }
    }
}
