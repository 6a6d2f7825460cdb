/* Displacement by a pattern; displace.py is the definition. After the periods, p holds: the pattern's number; the
 * centre; amplitude, length and phase; the turns of a swirl; the reach, or infinity; the height of the image; how many
 * octaves haze has, and of each: its frequency, the shifts of its lattice, its share and the seeds of both components. */
#include "hash.clh"
#include "look.clh"

#define RIPPLE 1
#define SWIRL 2
#define TAPER 3

inline double quintic(double t) { return t * t * t * (t * (t * 6.0 - 15.0) + 10.0); }

/* The number of a cell, modulo 2^32. */
inline uint cell_of(double whole) {
    const double rest = whole - 0x1p32 * floor(whole * 0x1p-32);
    return (uint)(int)(rest - 0x1p31) ^ 0x80000000u;
}

/* A corner's gradient, times the way from it. */
inline double corner(uint column, uint row, uint seed, double fx, double fy) {
    uint a = column, b = row, c = seed;
    hash_pcg3d(&a, &b, &c);
    double sine, cosine;
    turn_sincos(a * 0x1p-32, &sine, &cosine);
    return cosine * fx + sine * fy;
}

/* Adds `by` times the noise at places (x, y) of unit cells. */
inline void add_noise(double *restrict sum, const double *restrict x, double y, uint seed, double by) {
    const double top = floor(y), fy = y - top, down = quintic(fy);
    const uint row = cell_of(top);
    EACH {
        const double left = floor(x[i]), fx = x[i] - left, across = quintic(fx);
        const uint column = cell_of(left);
        const double a = corner(column, row, seed, fx, fy), b = corner(column + 1, row, seed, fx - 1.0, fy);
        const double c = corner(column, row + 1, seed, fx, fy - 1.0);
        const double d = corner(column + 1, row + 1, seed, fx - 1.0, fy - 1.0);
        const double upper = a + across * (b - a), lower = c + across * (d - c);
        sum[i] += by * (1.4142135623730951 * (upper + down * (lower - upper)));
    }
}

inline void look(double *restrict x, double *restrict y, const double *restrict u, double v,
                 global const double *restrict p, int *restrict held, int middle) {
    const int pattern = (int)p[2];
    const double cx = p[3], cy = p[4], amplitude = p[5], length = p[6], phase = p[7], reach = p[9], dy = v - cy;
    if (pattern == RIPPLE) {
        EACH {
            const double dx = u[i] - cx, r = sqrt(dx * dx + dy * dy), turn = r / length - phase;
            double sine, cosine;
            turn_sincos(turn, &sine, &cosine);
            const double wave = amplitude * sine * (reach < INFINITY ? exp_of(-r / reach) : 1.0);
            const double by = r > 0.0 ? 1.0 / r : 0.0;
            x[i] = u[i] + wave * (dx * by);
            y[i] = v + wave * (dy * by);
        }
    } else if (pattern == SWIRL) {
        EACH {
            const double dx = u[i] - cx, left = 1.0 - sqrt(dx * dx + dy * dy) / reach, share = left > 0.0 ? left : 0.0;
            double s, c;
            turn_sincos(p[8] * (share * share), &s, &c);
            x[i] = cx + c * dx - s * dy;
            y[i] = cy + s * dx + c * dy;
        }
    } else if (pattern == TAPER) {
        const double wide = 1.0 + amplitude * (v / p[10]);
        EACH {
            x[i] = wide > 0.0 ? cx + (u[i] - cx) / wide : NAN;
            y[i] = v;
        }
    } else {
        double across[SEGMENT];
        EACH x[i] = y[i] = 0.0;
        for (int octave = 0; octave < (int)p[11]; ++octave) {
            global const double *own = p + 12 + 6 * octave;
            EACH across[i] = u[i] / length * own[0] + own[1];
            const double down = (v / length + phase) * own[0] + own[2];
            add_noise(x, across, down, cell_of(own[4]), own[3]);
            add_noise(y, across, down, cell_of(own[5]), own[3]);
        }
        EACH {
            x[i] = u[i] + amplitude * x[i];
            y[i] = v + amplitude * y[i];
        }
    }
}

#include "look_kernel.clh"
