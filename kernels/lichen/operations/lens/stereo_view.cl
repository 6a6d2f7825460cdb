// What an eye beside the camera sees; stereo_view.py is the definition. Places and disparities are doubles, so that no
// rounding decides what covers a pixel.
//
// CHANNELS of the picture. `shift` holds how far each pixel moves to the right, `near` its disparity; NaN where neither
// is known.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define GONE (-INFINITY)

// Of all pairs of neighbours that cover a pixel, the nearest; `seen` becomes its disparity, or GONE where there is none.
kernel void search(global const float *restrict in, global const double *restrict shift,
                   global const double *restrict near, global float *restrict out, global double *restrict seen,
                   double tear, int width, int height, int reach)
{
    int x = get_global_id(0), row = get_global_id(1);
    if (x >= width || row >= height)
        return;
    size_t home = (size_t)row * width;
    double most = GONE, share = 0;
    int first = 0, second = 0;
    for (int q = x - reach; q <= x + reach; q++) {
        int left = clamp(q, 0, width - 1), right = clamp(q + 1, 0, width - 1);
        double move = shift[home + left], other = shift[home + right], a = q + move, b = q + 1 + other;
        double here = near[home + left], there = near[home + right];
        double t = (x - a) / (b - a);
        if (fabs(other - move) > tear) {
            bool one = a <= x && x < a + 0.5, two = b - 0.5 <= x && x < b;
            if (!one && !two)
                continue;
            t = one && !(two && there > here) ? 0 : 1;
        } else if (!(a <= x && x < b)) {
            continue;
        }
        double value = t == 0 ? here : (t == 1 ? there : (1 - t) * here + t * there);
        if (value > most) {
            most = value;
            share = t;
            first = left;
            second = right;
        }
    }
    seen[home + x] = most;
    float t = (float)share;
    for (int c = 0; c < CHANNELS; c++) {
        float p = in[(home + first) * CHANNELS + c], q = in[(home + second) * CHANNELS + c];
        out[(home + x) * CHANNELS + c] = t == 0 ? p : (t == 1 ? q : (1 - t) * p + t * q);
    }
}

// What nothing covers shows the farther of what lies to its left and to its right; beyond a row's ends go on its first
// and its last pixel.
kernel void fill(global const float *restrict in, global const double *restrict near, global float *restrict out,
                 global const double *restrict seen, int width, int height)
{
    int row = get_global_id(0);
    if (row >= height)
        return;
    size_t home = (size_t)row * width;
    int x = 0;
    while (x < width) {
        int end = x;
        while (end < width && seen[home + end] == GONE)
            end++;
        if (end > x) {
            bool before = x > 0, after = end < width;
            double left = before ? seen[home + x - 1] : near[home];
            double right = after ? seen[home + end] : near[home + width - 1];
            bool lost = left != left && right != right, of_left = left <= right || right != right;
            global const float *from = of_left ? (before ? out : in) : (after ? out : in);
            size_t at = home + (of_left ? max(x - 1, 0) : min(end, width - 1));
            for (int k = x; k < end; k++)
                for (int c = 0; c < CHANNELS; c++)
                    out[(home + k) * CHANNELS + c] = lost ? NAN : from[at * CHANNELS + c];
        }
        x = end + 1;
    }
}

// Follows every pixel back: x <- column - shift(x), as often as there are steps.
kernel void iterated(global const float *restrict in, global const double *restrict shift, global float *restrict out,
                     int width, int height, int steps)
{
    int column = get_global_id(0), row = get_global_id(1);
    if (column >= width || row >= height)
        return;
    size_t home = (size_t)row * width;
    double x = column;
    int left = column, right = column;
    double t = 0;
    for (int k = 0; k <= steps; k++) {
        double at = x < 0 ? 0.0 : (x > width - 1 ? (double)(width - 1) : x);
        left = x == x ? (int)at : 0;
        right = min(left + 1, width - 1);
        t = at - left;
        double moved = t == 0 ? shift[home + left] : (1 - t) * shift[home + left] + t * shift[home + right];
        if (k < steps)
            x = column - moved;
    }
    bool lost = x != x;
    float part = (float)t;
    for (int c = 0; c < CHANNELS; c++) {
        float p = in[(home + left) * CHANNELS + c], q = in[(home + right) * CHANNELS + c];
        out[(home + column) * CHANNELS + c] = lost ? NAN : (part == 0 ? p : (1 - part) * p + part * q);
    }
}
