// Shadows of a flat thing, 64 pixels to a work-item; planar_shadow.py is the definition.
//
// CHANNELS of the matte, which has a frame of one texel of 0 around it. `points` holds x, y and the height of all pixels
// over the thing, one plane after the other, each padded to whole segments; `lights` those of the light's points.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define SEGMENT 64
#define EACH for (int i = 0; i < SEGMENT; i++)

kernel void planar_shadow(global const double *restrict points, global const float *restrict matte,
                          global const double *restrict lights, global const double *restrict sizes,
                          global float *restrict out, int count, int parallel, int width, int height, ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)SEGMENT, plane = (pixels + SEGMENT - 1) / SEGMENT * SEGMENT;
    if (first >= pixels)
        return;
    global const double *px = points + first, *py = px + plane, *a = py + plane;
    double total[CHANNELS][SEGMENT], high[SEGMENT], wide = sizes[0], tall = sizes[1];
    EACH high[i] = a[i];
    for (int c = 0; c < CHANNELS; c++)
        EACH total[c][i] = 0;
    for (int k = 0; k < count; k++) {
        double lx = lights[3 * k], ly = lights[3 * k + 1], b = lights[3 * k + 2], at_x[SEGMENT], at_y[SEGMENT];
        int inside[SEGMENT], some = 0;
        EACH {
            double w = parallel ? b : b - high[i];
            double x = width * (0.5 + (b * px[i] - high[i] * lx) / w / wide) + 0.5;
            double y = height * (0.5 - (b * py[i] - high[i] * ly) / w / tall) + 0.5;
            int between = b > 0 ? high[i] < 0 : (high[i] > 0) & (b < 0);
            inside[i] = between & (x > 0) & (y > 0) & (x < width + 1) & (y < height + 1);
            at_x[i] = x;
            at_y[i] = y;
            some |= inside[i];
        }
        for (int i = 0; some && i < SEGMENT; i++) {
            if (!inside[i])
                continue;
            double column = floor(at_x[i]), row = floor(at_y[i]), right = at_x[i] - column, low = at_y[i] - row;
            global const float *upper = matte + CHANNELS * ((size_t)row * (width + 2) + (size_t)column);
            global const float *lower = upper + CHANNELS * (size_t)(width + 2);
            for (int c = 0; c < CHANNELS; c++) {
                double above = upper[c] + right * ((double)upper[CHANNELS + c] - upper[c]);
                double below = lower[c] + right * ((double)lower[CHANNELS + c] - lower[c]);
                total[c][i] += above + low * (below - above);
            }
        }
    }
    for (int i = 0; i < SEGMENT && first + i < pixels; i++)
        for (int c = 0; c < CHANNELS; c++)
            out[(first + i) * CHANNELS + c] = high[i] == high[i] ? (float)(1 - total[c][i] / count) : NAN;
}
