/* A grid of control points; mesh.py is the definition. After the periods, p holds: columns and rows of the grid; the
 * size of the result; 1 for bicubic patches; then x and y of every node, row by row, with one more node around. */
#include "look.clh"

#define MOST 260

/* Weights of the nodes -1 to 2 at t in [0, 1] between nodes 0 and 1; a little beyond, patches go on as they are. */
inline void weigh(double *w, double t, int bicubic) {
    const double f = t < 0.0 ? 0.0 : (t > 1.0 ? 1.0 : t), g = 1.0 - f, over = t - f;
    const double before = f == 0.0 ? 0.5 * over : 0.0, after = f == 1.0 ? 0.5 * over : 0.0;
    const double w0 = -0.5 * f * g * g, w3 = -0.5 * g * f * f;
    const double w2 = f * fma(f, fma(-1.5, f, 2.0), 0.5);
    w[0] = bicubic ? w0 - before : 0.0;
    w[1] = bicubic ? 1.0 - (w0 + w2 + w3) - after : 1.0 - t;
    w[2] = bicubic ? w2 + before : t;
    w[3] = bicubic ? w3 + after : 0.0;
}

inline void look(double *restrict x, double *restrict y, const double *restrict u, double v,
                 global const double *restrict p, int *restrict held, int middle) {
    const int columns = (int)p[2], rows = (int)p[3], bicubic = p[6] != 0.0;
    const double by = (columns - 1) / p[4], down = v * ((rows - 1) / p[5]);
    const int j = clamp((int)floor(down), 0, rows - 2);
    double wy[4];
    weigh(wy, down - j, bicubic);
    /* the columns of nodes that the segment sees, weighed along the other axis once for all of its pixels */
    const int from = clamp((int)floor(u[0] * by), 0, columns - 2);
    const int to = clamp((int)floor(u[SEGMENT - 1] * by), 0, columns - 2) + 4;
    double lines[2 * MOST];
    global const double *nodes = p + 7 + 2 * ((size_t)j * (columns + 2));
    for (int k = 2 * from; k < 2 * to; ++k) {
        double sum = 0.0;
        for (int b = 0; b < 4; ++b) sum = fma(wy[b], nodes[2 * (size_t)b * (columns + 2) + k], sum);
        lines[k] = sum;
    }
    EACH {
        const double across = u[i] * by;
        const int at = clamp((int)floor(across), 0, columns - 2);
        double w[4];
        weigh(w, across - at, bicubic);
        x[i] = fma(w[0], lines[2 * at], fma(w[1], lines[2 * at + 2], fma(w[2], lines[2 * at + 4], w[3] * lines[2 * at + 6])));
        y[i] = fma(w[0], lines[2 * at + 1], fma(w[1], lines[2 * at + 3], fma(w[2], lines[2 * at + 5], w[3] * lines[2 * at + 7])));
    }
}

#include "look_kernel.clh"
