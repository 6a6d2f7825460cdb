/* A thin plate, with its derivative; thin_plate.py is the definition. After the periods, p holds: the number of knots;
 * the centre and 1 / scale of scaled coordinates; constant, x and y terms of both components; then x, y and the two
 * weights of every knot. */
#include "look.clh"

kernel void places(ARGUMENTS) {
    WHERE
    const int knots = (int)p[2];
    const double by = p[5], dv = (row + 0.5 - p[4]) * by, start_u = column + 0.5 - p[3];
    double at[SEGMENT], x[SEGMENT], y[SEGMENT], xu[SEGMENT], yu[SEGMENT], xv[SEGMENT], yv[SEGMENT];
    EACH {
        at[i] = (start_u + i) * by;
        x[i] = p[6] + p[8] * at[i] + p[10] * dv;
        y[i] = p[7] + p[9] * at[i] + p[11] * dv;
        xu[i] = p[8];
        yu[i] = p[9];
        xv[i] = p[10];
        yv[i] = p[11];
    }
    for (int k = 0; k < knots; ++k) {
        global const double *knot = p + 12 + 4 * k;
        const double kx = knot[0], dy = dv - knot[1], wx = knot[2], wy = knot[3], dd = dy * dy;
        EACH {
            const double dx = at[i] - kx, squared = dx * dx + dd;
            const double logarithm = squared > DBL_MIN ? log_of(squared) : 0.0;
            const double value = 0.5 * squared * logarithm, slope = logarithm + 1.0, a = slope * dx, b = slope * dy;
            x[i] = fma(wx, value, x[i]);
            y[i] = fma(wy, value, y[i]);
            xu[i] = fma(wx, a, xu[i]);
            yu[i] = fma(wy, a, yu[i]);
            xv[i] = fma(wx, b, xv[i]);
            yv[i] = fma(wy, b, yv[i]);
        }
    }
    for (int i = 0; i < count; ++i) {
        table[2 * (start + i)] = column + i + 0.5 + x[i];
        table[2 * (start + i) + 1] = row + 0.5 + y[i];
        if (steps)
            vstore4((float4)(1.0 + xu[i] * by, yu[i] * by, xv[i] * by, 1.0 + yv[i] * by), start + i, steps);
    }
}
