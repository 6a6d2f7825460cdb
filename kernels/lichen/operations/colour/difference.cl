// Colour differences in double precision, one pixel for each work-item; difference.py says what they are.
//
// Definitions given at build time:
//   FORMULA   76 | 94 | 2000
//   LAB       1 where the pictures hold L*a*b*, 0 where they hold linear light
//   FIRST, SECOND   channels of the two pictures

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#define DEGREE (M_PI / 180.0)
#define BEND (6.0 / 29.0)

inline double lightness(double t)
{
    return t > BEND * BEND * BEND ? cbrt(t) : t / (3.0 * BEND * BEND) + 4.0 / 29.0;
}

inline double3 lab(global const float *p, global const double *m)
{
    double3 c = (double3)(p[0], p[1], p[2]);
    if (LAB)
        return c;
    double x = lightness(m[0] * c.x + m[1] * c.y + m[2] * c.z);
    double y = lightness(m[3] * c.x + m[4] * c.y + m[5] * c.z);
    double z = lightness(m[6] * c.x + m[7] * c.y + m[8] * c.z);
    return (double3)(116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z));
}

inline double keep_positive(double x) { return x < 0.0 ? 0.0 : x; }

// sqrt(C^7 / (C^7 + 25^7)) as a ratio, so that no power overflows to a quotient of infinities.
inline double share(double chroma)
{
    double r = 25.0 / chroma;
    return 1.0 / sqrt(1.0 + r * r * r * r * r * r * r);
}

inline double turned(double b, double a)
{
    double h = atan2(b, a);
    return h < 0.0 ? h + 2.0 * M_PI : h;
}

inline double cie94(double3 first, double3 second)
{
    double c1 = hypot(first.y, first.z), c2 = hypot(second.y, second.z), chroma = c1 - c2;
    double3 apart = first - second;
    double hue = keep_positive(apart.y * apart.y + apart.z * apart.z - chroma * chroma);
    double sc = 1.0 + 0.045 * c2, sh = 1.0 + 0.015 * c2;
    return sqrt(apart.x * apart.x + (chroma / sc) * (chroma / sc) + hue / (sh * sh));
}

inline double ciede2000(double3 first, double3 second)
{
    double stretch = 1.5 - 0.5 * share((hypot(first.y, first.z) + hypot(second.y, second.z)) / 2.0);
    double a1 = first.y * stretch, a2 = second.y * stretch;
    double c1 = hypot(a1, first.z), c2 = hypot(a2, second.z);
    double h1 = turned(first.z, a1), h2 = turned(second.z, a2), turn = h2 - h1, middle = (h1 + h2) / 2.0;
    turn = turn > M_PI ? turn - 2.0 * M_PI : (turn < -M_PI ? turn + 2.0 * M_PI : turn);
    if (fabs(h1 - h2) > M_PI)
        middle += h1 + h2 < 2.0 * M_PI ? M_PI : -M_PI;
    if (c1 * c2 == 0.0) {
        turn = 0.0;
        middle = h1 + h2;
    }
    double l = (first.x + second.x) / 2.0, chroma = (c1 + c2) / 2.0, off = (l - 50.0) * (l - 50.0);
    double t = 1.0 - 0.17 * cos(middle - 30.0 * DEGREE) + 0.24 * cos(2.0 * middle)
             + 0.32 * cos(3.0 * middle + 6.0 * DEGREE) - 0.20 * cos(4.0 * middle - 63.0 * DEGREE);
    double blue = (middle / DEGREE - 275.0) / 25.0;
    double twist = -2.0 * share(chroma) * sin(60.0 * DEGREE * exp(-blue * blue));
    double dl = (second.x - first.x) / (1.0 + 0.015 * off / sqrt(20.0 + off));
    double dc = (c2 - c1) / (1.0 + 0.045 * chroma);
    double dh = 2.0 * sqrt(c1 * c2) * sin(turn / 2.0) / (1.0 + 0.015 * chroma * t);
    return sqrt(keep_positive(dl * dl + dc * dc + dh * dh + twist * dc * dh));
}

kernel void difference(global const float *restrict image, global const float *restrict reference,
                       global float *restrict out, global const double *restrict m, int pixels)
{
    int i = get_global_id(0);
    if (i >= pixels)
        return;
    double3 first = lab(image + (size_t)i * FIRST, m), second = lab(reference + (size_t)i * SECOND, m);
#if FORMULA == 76
    double3 apart = first - second;
    out[i] = (float)sqrt(apart.x * apart.x + apart.y * apart.y + apart.z * apart.z);
#elif FORMULA == 94
    out[i] = (float)cie94(first, second);
#else
    out[i] = (float)ciede2000(first, second);
#endif
}
