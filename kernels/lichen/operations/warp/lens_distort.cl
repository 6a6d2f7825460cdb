/* Lenses; lenses.py is the definition. After the periods, p holds: the model's number; 1 where places are to be distorted,
 * 0 where the distortion is taken out; the focal length; the centre in the result, and in the source; the two tangential
 * coefficients; the end of the radial function, and its value there; its four coefficients; how many brackets there
 * are, and the largest value that they reach; then the arguments at which it has the values between brackets.
 *
 * Radii and directions of a segment are found in loops over all of its pixels; a search ends when none of them moves. */
#include "look.clh"

#define DIVISION 1
#define FISHEYE 2
#define HALVINGS 100
#define STEPS 60
#define SHORTENED 12
#define CLOSE 1e-10

typedef global const double *restrict Numbers;

inline int is_division(Numbers p) { return (int)p[2] == DIVISION; }

/* The radial function, and its slope. */
inline double radial(Numbers p, double x) {
    const double s = x * x, sum = s * fma(s, fma(s, fma(s, p[16], p[15]), p[14]), p[13]);
    return is_division(p) ? x / (1.0 + sum) : x * (1.0 + sum);
}
inline double radial_slope(Numbers p, double x) {
    const double s = x * x;
    if (is_division(p)) {
        const double below = fma(s, fma(s, p[14], p[13]), 1.0);
        return (1.0 - s * fma(s, 3.0 * p[14], p[13])) / (below * below);
    }
    return 1.0 + s * fma(s, fma(s, fma(s, 9.0 * p[16], 7.0 * p[15]), 5.0 * p[14]), 3.0 * p[13]);
}
inline double radial_at(Numbers p, double x) { return x <= p[11] ? radial(p, x) : NAN; }

/* The argument of every value, NaN where there is none: Newton's steps inside a bracket, which is halved where they
 * leave it. */
inline void radial_solve(Numbers p, double *restrict out, const double *restrict value) {
    double wanted[SEGMENT], low[SEGMENT], high[SEGMENT];
    const int brackets = (int)p[17];
    const double scale = brackets / p[18];
    EACH {
        const int there = (value[i] >= 0.0) & (value[i] <= p[12]);
        wanted[i] = there ? value[i] : 0.0;
        const int at = clamp((int)fmin(wanted[i] * scale, 1e6), 0, brackets - 1);
        low[i] = p[19 + at] * (1.0 - 1e-12);
        high[i] = p[20 + at] * (1.0 + 1e-12);
        out[i] = 0.5 * (low[i] + high[i]);
    }
    for (int turn = 0; turn < HALVINGS; ++turn) {
        int moving = 0;
        EACH {
            const double x = out[i], off = radial(p, x) - wanted[i], step = x - off / radial_slope(p, x);
            low[i] = off <= 0.0 ? x : low[i];
            high[i] = off >= 0.0 ? x : high[i];
            const int inside = (step > low[i]) & (step < high[i]);
            const double next = off == 0.0 ? x : (inside ? step : 0.5 * (low[i] + high[i]));
            moving |= fabs(next - x) > 4e-16 * fabs(next);
            out[i] = next;
        }
        if (!moving) break;
    }
    EACH {
        const int there = (value[i] >= 0.0) & (value[i] <= p[12]);
        out[i] = there ? out[i] : NAN;
    }
}

/* Derivatives of the distorted place by the pinhole's: xx, the mixed one, and yy. */
inline void slopes(Numbers p, double x, double y, double *xx, double *mixed, double *yy) {
    const double s = x * x + y * y, p1 = p[9], p2 = p[10];
    const double factor = fma(s, fma(s, fma(s, fma(s, p[16], p[15]), p[14]), p[13]), 1.0);
    const double bend = fma(s, fma(s, fma(s, 8.0 * p[16], 6.0 * p[15]), 4.0 * p[14]), 2.0 * p[13]);
    *xx = factor + x * x * bend + 2.0 * p1 * y + 6.0 * p2 * x;
    *yy = factor + y * y * bend + 6.0 * p1 * y + 2.0 * p2 * x;
    *mixed = x * y * bend + 2.0 * p1 * x + 2.0 * p2 * y;
}

/* How far the distorted place of (u, v) lies from (x, y), and the square of the distance; infinite beyond the end. */
inline double missed(Numbers p, double u, double v, double x, double y, double *ex, double *ey) {
    const double rr = u * u + v * v, r = sqrt(rr), to = radial_at(p, r), by = r > 0.0 ? to / r : (to == to ? 1.0 : NAN);
    *ex = u * by + (2.0 * p[9] * u * v + p[10] * (rr + 2.0 * u * u)) - x;
    *ey = v * by + (p[9] * (rr + 2.0 * v * v) + 2.0 * p[10] * u * v) - y;
    const double squared = *ex * *ex + *ey * *ey;
    return squared == squared ? squared : INFINITY;
}

/* The pinhole's place of (x, y) under tangential terms, from the radial answer in (u, v). */
inline void refine(Numbers p, double *restrict u, double *restrict v, const double *restrict x, const double *restrict y) {
    double error[SEGMENT], ex[SEGMENT], ey[SEGMENT], du[SEGMENT], dv[SEGMENT], by[SEGMENT], now[SEGMENT];
    EACH {
        const double r = sqrt(x[i] * x[i] + y[i] * y[i]), inward = 0.5 * p[11] / fmax(r, 1e-300), start = inward < 1.0 ? inward : 1.0;
        u[i] = u[i] == u[i] ? u[i] : x[i] * start;
        v[i] = v[i] == v[i] ? v[i] : y[i] * start;
        error[i] = missed(p, u[i], v[i], x[i], y[i], ex + i, ey + i);
    }
    for (int turn = 0; turn < STEPS; ++turn) {
        int far = 0, moved = 0;
        EACH far |= (error[i] > CLOSE * CLOSE) & (error[i] < INFINITY);
        if (!far) break;
        EACH {
            double xx, mixed, yy;
            slopes(p, u[i], v[i], &xx, &mixed, &yy);
            const double determinant = xx * yy - mixed * mixed;
            du[i] = (yy * ex[i] - mixed * ey[i]) / determinant;
            dv[i] = (xx * ey[i] - mixed * ex[i]) / determinant;
            by[i] = 1.0;
        }
        for (int half_ = 0; half_ < SHORTENED; ++half_) {
            int worse = 0;
            EACH {
                double a, b;
                now[i] = missed(p, u[i] - by[i] * du[i], v[i] - by[i] * dv[i], x[i], y[i], &a, &b);
                const int worsened = !(now[i] < error[i]);
                by[i] = worsened ? 0.5 * by[i] : by[i];
                worse |= worsened;
            }
            if (!worse) break;
        }
        EACH {
            double a, b;
            const double right = u[i] - by[i] * du[i], down = v[i] - by[i] * dv[i];
            const double left = missed(p, right, down, x[i], y[i], &a, &b);
            const int better = left < error[i];
            moved |= better;
            u[i] = better ? right : u[i];
            v[i] = better ? down : v[i];
            ex[i] = better ? a : ex[i];
            ey[i] = better ? b : ey[i];
            error[i] = better ? left : error[i];
        }
        if (!moved) break;
    }
    EACH {
        double xx, mixed, yy;
        slopes(p, u[i], v[i], &xx, &mixed, &yy);
        const int good = (error[i] <= CLOSE * CLOSE) & (xx * yy - mixed * mixed > 0.0);
        u[i] = good ? u[i] : NAN;
        v[i] = good ? v[i] : NAN;
    }
}

inline void look(double *restrict x, double *restrict y, const double *restrict u, double v, Numbers p,
                 int *restrict held, int middle) {
    const double focal = p[4], down = (v - p[6]) / focal;
    const int model = (int)p[2], distorts = p[3] != 0.0, bent = (p[9] != 0.0) | (p[10] != 0.0);
    double a[SEGMENT], r[SEGMENT], to[SEGMENT];
    EACH {
        a[i] = (u[i] - p[5]) / focal;
        r[i] = sqrt(a[i] * a[i] + down * down);
    }
    if ((model == DIVISION) == distorts) {
        radial_solve(p, to, r);
        if (model == FISHEYE) EACH {
            double s, c;
            turn_sincos(to[i] * 0x1.45f306dc9c883p-3, &s, &c);
            to[i] = to[i] < M_PI_2 ? s / c : NAN;
        }
    } else {
        EACH to[i] = radial_at(p, model == FISHEYE ? arc_of(r[i], 1.0) : r[i]);
    }
    EACH {
        const double by = r[i] > 0.0 ? to[i] / r[i] : (to[i] == to[i] ? 1.0 : NAN);
        x[i] = a[i] * by;
        y[i] = down * by;
    }
    if (bent && distorts) EACH {
        const double rr = r[i] * r[i];
        double xx, mixed, yy;
        slopes(p, a[i], down, &xx, &mixed, &yy);
        const int there = xx * yy - mixed * mixed > 0.0;
        x[i] = there ? x[i] + (2.0 * p[9] * a[i] * down + p[10] * (rr + 2.0 * a[i] * a[i])) : NAN;
        y[i] = there ? y[i] + (p[9] * (rr + 2.0 * down * down) + 2.0 * p[10] * a[i] * down) : NAN;
    } else if (bent) {
        double below[SEGMENT];
        EACH below[i] = down;
        refine(p, x, y, a, below);
    }
    EACH {
        x[i] = p[7] + focal * x[i];
        y[i] = p[8] + focal * y[i];
    }
}

#include "look_kernel.clh"
