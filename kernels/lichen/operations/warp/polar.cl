/* Polar coordinates; polar.py is the definition. After the periods, p holds: 1 for the way to polar coordinates; the
 * centre in the picture; the size of the chart; its inner and outer radius; the turns of its left edge; and 0, or the
 * logarithm of outer over inner. */
#include "look.clh"

inline void look(double *restrict x, double *restrict y, const double *restrict u, double v,
                 global const double *restrict p, int *restrict held, int middle) {
    const double cx = p[3], cy = p[4], wide = p[5], tall = p[6], inner = p[7], outer = p[8], start = p[9], log_ = p[10];
    if (p[2] != 0.0) {
        const double share = v / tall;
        const double r = log_ != 0.0 ? inner * exp_of(share * log_) : inner + (outer - inner) * share;
        EACH {
            double s, c;
            turn_sincos(start + u[i] / wide, &s, &c);
            x[i] = cx + r * c;
            y[i] = cy + r * s;
        }
        return;
    }
    const double dy = v - cy;
    EACH {
        const double dx = u[i] - cx, r = sqrt(dx * dx + dy * dy), turn = arc_of(dy, dx) * 0x1.45f306dc9c883p-3 - start;
        const double away = r > 0.0 ? r : inner;
        const double share = log_ != 0.0 ? log_of(away / inner) / log_ : (r - inner) / (outer - inner);
        const int inside = (r >= inner) & (r <= outer);
        x[i] = inside ? wide * (turn - floor(turn)) : NAN;
        y[i] = inside ? tall * share : NAN;
    }
}

#include "look_kernel.clh"
