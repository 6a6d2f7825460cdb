// Means along straight paths, one for every pixel; paths.py is the definition.
//
// CHANNELS of the picture; BORDER its number; WALK 1: from crossing to crossing, 0: samples at even distances.
// TOTAL is the type of sums: double, or float for samples. `n` holds the ends of the exposure, the longest vector, and the border's value. Places are doubles.

#include "border.clh"

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define SEGMENT 16

typedef struct {
    global const float *pixels;
    int width, height;
    float value;
} Picture;

// Adds a pixel's weight times its value; what has no weight takes no part.
inline void add(TOTAL *restrict total, const Picture *picture, int column, int row, float weight)
{
    if (weight == 0.0f)
        return;
    int c = border_index(column, picture->width, BORDER), r = border_index(row, picture->height, BORDER);
    global const float *p = picture->pixels + CHANNELS * ((size_t)max(r, 0) * picture->width + max(c, 0));
    bool outside = c < 0 || r < 0;
    for (int k = 0; k < CHANNELS; k++)
        total[k] += weight * (outside ? picture->value : p[k]);
}

inline double unit(double x) { return x < 0 ? 0.0 : (x > 1 ? 1.0 : x); }

// The next time, after t, at which u - a t is a whole number; `end` where there is none before it.
inline double crossing(double u, double a, double line, double end)
{
    double when = (u - line) / (a == 0 ? 1.0 : a);
    return a == 0 || when > end ? end : when;
}

inline void walk(TOTAL *restrict total, const Picture *picture, double u, double v, double a, double b, double first,
                 double last)
{
    double scale = 1 / (last - first), t = first;
    double step_x = a > 0 ? -1 : 1, step_y = b > 0 ? -1 : 1, x0 = u - a * first, y0 = v - b * first;
    double line_x = a > 0 ? ceil(x0) - 1 : floor(x0) + 1, line_y = b > 0 ? ceil(y0) - 1 : floor(y0) + 1;
    while (t < last) {
        double tx = crossing(u, a, line_x, last), ty = crossing(v, b, line_y, last), end = tx < ty ? tx : ty;
        line_x += tx <= end ? step_x : 0;
        line_y += ty <= end ? step_y : 0;
        if (end > t) {
            double middle = (t + end) / 2, left = floor(u - a * middle), top = floor(v - b * middle);
            double weight[4] = {0, 0, 0, 0}, times[3] = {t, middle, end};
            for (int k = 0; k < 3; k++) {
                double x = unit(u - a * times[k] - left), y = unit(v - b * times[k] - top);
                double share = (end - t) * scale * (k == 1 ? 4.0 : 1.0) / 6;
                weight[0] += share * ((1 - y) * (1 - x));
                weight[1] += share * ((1 - y) * x);
                weight[2] += share * (y * (1 - x));
                weight[3] += share * (y * x);
            }
            int column = (int)left, row = (int)top;
            add(total, picture, column, row, (float)weight[0]);
            add(total, picture, column + 1, row, (float)weight[1]);
            add(total, picture, column, row + 1, (float)weight[2]);
            add(total, picture, column + 1, row + 1, (float)weight[3]);
            t = end;
        }
    }
}

// Between a and b; a neighbour of no weight takes no part.
inline float mixed(float a, float b, float t) { return t == 0.0f ? a : (1.0f - t) * a + t * b; }

inline void sampled(TOTAL *restrict total, const Picture *picture, double u, double v, double a, double b, double first,
                    double last, int samples)
{
    double step = (last - first) / samples, x0 = u - a * first, x1 = u - a * last, y0 = v - b * first, y1 = v - b * last;
    bool inside = fmin(x0, x1) >= 0 && fmax(x0, x1) < picture->width - 1 && fmin(y0, y1) >= 0 &&
                  fmax(y0, y1) < picture->height - 1;
    size_t below = (size_t)CHANNELS * picture->width;
    for (int k = 0; k < samples; k++) {
        double t = first + step * (k + 0.5), x = u - a * t, y = v - b * t;
        double left = floor(x), top = floor(y);
        float fx = (float)(x - left), fy = (float)(y - top);
        int column = (int)left, row = (int)top;
        if (inside) {
            global const float *p = picture->pixels + CHANNELS * ((size_t)row * picture->width + column);
            for (int c = 0; c < CHANNELS; c++) {
                float upper = mixed(p[c], p[CHANNELS + c], fx), lower = mixed(p[below + c], p[below + CHANNELS + c], fx);
                total[c] += mixed(upper, lower, fy);
            }
            continue;
        }
        add(total, picture, column, row, (1 - fy) * (1 - fx));
        add(total, picture, column + 1, row, (1 - fy) * fx);
        add(total, picture, column, row + 1, fy * (1 - fx));
        add(total, picture, column + 1, row + 1, fy * fx);
    }
    for (int k = 0; k < CHANNELS; k++)
        total[k] /= (TOTAL)samples;
}

kernel void blurred(global const float *restrict pixels, global const float *restrict motion, global float *restrict out,
                    global const double *restrict n, int width, int height, int samples, ulong count)
{
    Picture picture = {pixels, width, height, (float)n[3]};
    double first = n[0], last = n[1], largest = n[2];
    for (ulong i = get_global_id(0) * (ulong)SEGMENT; i < min((get_global_id(0) + 1) * (ulong)SEGMENT, count); i++) {
        double a = motion[2 * i], b = motion[2 * i + 1], length = sqrt(a * a + b * b);
        bool lost = !(fabs(a) < INFINITY && fabs(b) < INFINITY);
        double factor = length > largest ? largest / length : 1.0;
        a = lost ? 0.0 : a * factor;
        b = lost ? 0.0 : b * factor;
        uint row = (uint)(i / (uint)width), column = (uint)(i - (ulong)row * (uint)width);
        TOTAL total[CHANNELS];
        for (int k = 0; k < CHANNELS; k++)
            total[k] = 0;
#if WALK
        walk(total, &picture, column, row, a, b, first, last);
#else
        sampled(total, &picture, column, row, a, b, first, last, samples);
#endif
        for (int k = 0; k < CHANNELS; k++)
            out[i * CHANNELS + k] = lost ? NAN : (float)total[k];
    }
}
