/* Charts of the sphere; charts.py and panorama.py are the definition. After the periods, p holds: the chart of the source
 * and that of the result; charts across of both, and down of the result; width and height of one chart of the source,
 * its margin, and width and height of one of the result; half the view of a fisheye in turns; nine numbers of the turn;
 * then twelve faces of the source's cells, twelve of the result's, and the cell of each of six faces in the source. */
#include "look.clh"

enum { LATLONG, CUBE, CUBE_CROSS, CUBE_PAGES, MIRROR_BALL, PARABOLOID, FISHEYE };
enum { LEFT, AHEAD, RIGHT, UP, BEHIND, DOWN, NOTHING };

#define FULL 6.283185307179586
#define PER_TURN 0x1.45f306dc9c883p-3 /* turns of a radian */
#define CELLS 16

typedef global const double *restrict Numbers;

inline int is_cube(int chart) { return (chart >= CUBE) & (chart <= CUBE_PAGES); }

/* The direction at (s, t) of a chart, also beyond its edge; NaN where there is none. */
inline void directions(double *restrict x, double *restrict y, double *restrict z, const double *restrict s,
                       const double *restrict t, const int *restrict cell, int chart, Numbers p, Numbers faces) {
    if (chart == LATLONG) {
        EACH {
            double a, b, c, d;
            turn_sincos(0.5 * s[i], &a, &b);
            turn_sincos(0.25 * t[i], &c, &d);
            x[i] = d * a;
            y[i] = c;
            z[i] = d * b;
        }
    } else if (is_cube(chart)) {
        EACH {
            const int face = (int)faces[cell[i]];
            const int along = (face == AHEAD) | (face == BEHIND), beside = (face == RIGHT) | (face == LEFT);
            const double sign = ((face == AHEAD) | (face == RIGHT) | (face == DOWN)) ? 1.0 : -1.0;
            const double a = along ? sign * s[i] : (beside ? sign : s[i]);
            const double b = along | beside ? t[i] : sign;
            const double c = along ? sign : (beside ? -sign * s[i] : -sign * t[i]);
            const double by = 1.0 / sqrt(a * a + b * b + c * c);
            x[i] = a * by;
            y[i] = b * by;
            z[i] = c * by;
        }
    } else if (chart == PARABOLOID) {
        EACH {
            const double rr = s[i] * s[i] + t[i] * t[i], by = 1.0 / (1.0 + rr), turned = cell[i] == 0 ? 1.0 : -1.0;
            x[i] = turned * 2.0 * s[i] * by;
            y[i] = 2.0 * t[i] * by;
            z[i] = turned * (1.0 - rr) * by;
        }
    } else if (chart == MIRROR_BALL) {
        EACH {
            const double rr = s[i] * s[i] + t[i] * t[i], depth = rr <= 1.0 ? sqrt(1.0 - rr) : NAN;
            x[i] = 2.0 * depth * s[i];
            y[i] = 2.0 * depth * t[i];
            z[i] = 2.0 * rr - 1.0 + 0.0 * depth;
        }
    } else {
        EACH {
            const double r = sqrt(s[i] * s[i] + t[i] * t[i]), turn = r <= 1.0 ? p[12] * r : NAN;
            double a, b;
            turn_sincos(turn, &a, &b);
            const double along = r > 0.0 ? a / r : FULL * turn;
            x[i] = r > 0.0 ? along * s[i] : (r == 0.0 ? 0.0 : NAN);
            y[i] = r > 0.0 ? along * t[i] : (r == 0.0 ? 0.0 : NAN);
            z[i] = b;
        }
    }
}

/* The chart that holds each direction. */
inline void find_cells(int *restrict cell, const double *restrict x, const double *restrict y, const double *restrict z,
                       int chart, Numbers cells) {
    if (is_cube(chart)) {
        EACH {
            const double ax = fabs(x[i]), ay = fabs(y[i]), az = fabs(z[i]);
            const int beside = x[i] >= 0.0 ? RIGHT : LEFT, upright = y[i] >= 0.0 ? DOWN : UP, along = z[i] >= 0.0 ? AHEAD : BEHIND;
            cell[i] = (int)cells[((az >= ax) & (az >= ay)) ? along : (ax >= ay ? beside : upright)];
        }
    } else {
        EACH cell[i] = (chart == PARABOLOID) & !(z[i] >= 0.0);
    }
}

/* s and t of directions in a chart; NaN where it does not hold them, however far it is widened. */
inline void charted(double *restrict s, double *restrict t, const double *restrict x, const double *restrict y,
                    const double *restrict z, const int *restrict cell, int chart, Numbers p, Numbers faces) {
    if (chart == LATLONG) {
        EACH {
            s[i] = arc_of(x[i], z[i]) * (2.0 * PER_TURN);
            t[i] = arc_of(y[i], sqrt(x[i] * x[i] + z[i] * z[i])) * (4.0 * PER_TURN);
        }
    } else if (is_cube(chart)) {
        EACH {
            const int face = (int)faces[cell[i]];
            const int along = (face == AHEAD) | (face == BEHIND), beside = (face == RIGHT) | (face == LEFT);
            const double sign = ((face == AHEAD) | (face == RIGHT) | (face == DOWN)) ? 1.0 : -1.0;
            const double depth = sign * (along ? z[i] : (beside ? x[i] : y[i]));
            const double across = along ? sign * x[i] : (beside ? -sign * z[i] : x[i]);
            const double down = along | beside ? y[i] : -sign * z[i];
            const int good = (depth > 1e-6 * (fabs(x[i]) + fabs(y[i]) + fabs(z[i]))) & (face != NOTHING);
            s[i] = good ? across / depth : NAN;
            t[i] = good ? down / depth : NAN;
        }
    } else if (chart == PARABOLOID) {
        EACH {
            const double length = sqrt(x[i] * x[i] + y[i] * y[i] + z[i] * z[i]), turned = cell[i] == 0 ? 1.0 : -1.0;
            const double below = length + turned * z[i];
            const int good = below > 1e-6 * length;
            s[i] = good ? turned * x[i] / below : NAN;
            t[i] = good ? y[i] / below : NAN;
        }
    } else if (chart == MIRROR_BALL) {
        EACH {
            const double flat = x[i] * x[i] + y[i] * y[i], length = sqrt(flat + z[i] * z[i]);
            const double less = z[i] > 0.0 ? flat / (length + fabs(z[i])) : length - z[i];
            const double normal = sqrt(2.0 * less * length);
            s[i] = normal == 0.0 ? 1.0 : x[i] / normal;
            t[i] = normal == 0.0 ? 0.0 : y[i] / normal;
        }
    } else {
        EACH {
            const double across = sqrt(x[i] * x[i] + y[i] * y[i]), angle = arc_of(across, z[i]) / (FULL * p[12]);
            s[i] = across == 0.0 ? angle : angle * x[i] / across;
            t[i] = across == 0.0 ? 0.0 : angle * y[i] / across;
        }
    }
}

inline void look(double *restrict x, double *restrict y, const double *restrict u, double v, Numbers p,
                 int *restrict held, int middle) {
    const int source = (int)p[2], target = (int)p[3], own_across = (int)p[4], across = (int)p[5], down = (int)p[6];
    const double wide = p[7], tall = p[8], margin = p[9], tile = p[10], high = p[11];
    Numbers turn = p + 13, faces = p + 22, shown = p + 34, cells = p + 46;
    double s[SEGMENT], t[SEGMENT], dx[SEGMENT], dy[SEGMENT], dz[SEGMENT];
    int cell[SEGMENT], own[SEGMENT];
    if (middle) EACH {
        const int column = clamp((int)floor(u[i] / tile), 0, across - 1), line = clamp((int)floor(v / high), 0, down - 1);
        held[i] = line * across + column;
    }
    EACH {
        const int both = held[i] < 0 ? -1 - held[i] : held[i];
        cell[i] = both % CELLS;
        own[i] = both / CELLS;
        s[i] = 2.0 * (u[i] - cell[i] % across * tile) / tile - 1.0;
        t[i] = 2.0 * (v - cell[i] / across * high) / high - 1.0;
    }
    directions(dx, dy, dz, s, t, cell, target, p, shown);
    EACH {
        const double a = dx[i], b = dy[i], c = dz[i];
        dx[i] = turn[0] * a + turn[1] * b + turn[2] * c;
        dy[i] = turn[3] * a + turn[4] * b + turn[5] * c;
        dz[i] = turn[6] * a + turn[7] * b + turn[8] * c;
    }
    int seen[SEGMENT];
    if (middle) {
        find_cells(own, dx, dy, dz, source, cells);
        const int square = (target == LATLONG) | is_cube(target);
        EACH {
            const int inside = square ? (fabs(s[i]) <= 1.0) & (fabs(t[i]) <= 1.0) : s[i] * s[i] + t[i] * t[i] <= 1.0;
            seen[i] = inside & !(is_cube(target) && (int)shown[cell[i]] == NOTHING);
        }
    }
    charted(s, t, dx, dy, dz, own, source, p, faces);
    if (middle) EACH {
        seen[i] &= (source != FISHEYE) | (s[i] * s[i] + t[i] * t[i] <= 1.0);
        const int both = own[i] * CELLS + cell[i];
        held[i] = seen[i] ? both : -1 - both;
    }
    EACH {
        x[i] = 0.5 * (s[i] + 1.0) * wide + margin + own[i] % own_across * (wide + 2.0 * margin);
        y[i] = 0.5 * (t[i] + 1.0) * tall + margin + own[i] / own_across * (tall + 2.0 * margin);
    }
}

#include "look_kernel.clh"
