// Colour differences, sixteen pixels for each work-item, in doubles or in floats; difference.py says what they are.
//
// Definitions given at build time:
//   FORMULA   76 | 94 | 2000
//   LAB       1 where the pictures hold L*a*b*, 0 where they hold linear light
//   SINGLE    1 for float32, and doubles only for pixels in doubt
//   FIRST, SECOND   channels of the two pictures
//
// CIEDE2000 without angles: of two hues as unit vectors half the distance is the sine of half the angle between them, the
// sign of their cross product says which way it turns, and the mean hue is the direction halfway along the shorter arc,
// of whose multiples the cosines are polynomials. Only the blue region's turn asks for the mean hue as an angle. Where
// hues are opposite to the last digits rounding must not decide the way round, so those pixels, which are few, are done
// as the formula is printed.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#include "numeric.clh"
#include "../compositing/planes.clh"

#define DEGREE (M_PI / 180.0)
#define BEND (6.0 / 29.0)
#define DIFFERENCE_FN static inline __attribute__((always_inline))
#define NEARLY 4e-12
// As colour.py has it: hues no farther apart count as opposite at most.
#define HALF_TURN (M_PI + 1e-12)

typedef struct {
    double8 l, a, b;
} labs;

// ------------------------------------------------------------------------------------------- functions of doubles

// The cube root of x > 0: a float's, then Halley's iteration, whose error is cubed. Brought into the range of floats.
DIFFERENCE_FN double8 root3(double8 x)
{
    long8 large = x > 0x1p100;
    double8 near = large ? x * 0x1p-99 : x;
    double8 y = convert_double8(num_cbrt(convert_float8(near))), cube = y * y * y;
    y -= y * (cube - near) / (2.0 * cube + near);
    y = large ? y * 0x1p33 : y;
    return x < INFINITY ? y : x;
}

// atan t / t for z = t^2 <= 0.42, to 2e-15: Chebyshev interpolation. Beyond it, up to 1.2, to 2e-3.
DIFFERENCE_FN double8 arctangent(double8 z)
{
    double8 p = fma(z, (double8)(0.004634527150550193), (double8)(-0.01744403615065331));
    p = fma(z, p, (double8)(0.03376892818656633));
    p = fma(z, p, (double8)(-0.047394481587510535));
    p = fma(z, p, (double8)(0.057421612521792155));
    p = fma(z, p, (double8)(-0.06640275546066593));
    p = fma(z, p, (double8)(0.0768886744622324));
    p = fma(z, p, (double8)(-0.09090607178656729));
    p = fma(z, p, (double8)(0.11111094069955195));
    p = fma(z, p, (double8)(-0.142857137091256));
    p = fma(z, p, (double8)(0.1999999998948207));
    p = fma(z, p, (double8)(-0.3333333333324528));
    return fma(z, p, (double8)(0.9999999999999978));
}

// e^-w for w from 0 on; beyond 100 as at 100. Taylor's series on half an octave to both sides, 6e-15.
DIFFERENCE_FN double8 decay(double8 w)
{
    double8 x = (w > 100.0 ? (double8)(100.0) : w) * -1.4426950408889634;
    double8 shifted = x + 0x1.8p52, y = (x - (shifted - 0x1.8p52)) * 0.6931471805599453;
    double8 p = fma(y, (double8)(1.0 / 39916800.0), (double8)(1.0 / 3628800.0));
    p = fma(y, p, (double8)(1.0 / 362880.0));
    p = fma(y, p, (double8)(1.0 / 40320.0));
    p = fma(y, p, (double8)(1.0 / 5040.0));
    p = fma(y, p, (double8)(1.0 / 720.0));
    p = fma(y, p, (double8)(1.0 / 120.0));
    p = fma(y, p, (double8)(1.0 / 24.0));
    p = fma(y, p, (double8)(1.0 / 6.0));
    p = fma(y, p, (double8)(0.5));
    p = fma(y, p, (double8)(1.0));
    p = fma(y, p, (double8)(1.0));
    return as_double8(as_long8(p) + (as_long8(shifted) << 52));
}

// sin x for |x| <= 1.05: Taylor's series, 1e-16.
DIFFERENCE_FN double8 sine(double8 x)
{
    double8 z = x * x;
    double8 p = fma(z, (double8)(1.0 / 355687428096000.0), (double8)(-1.0 / 1307674368000.0));
    p = fma(z, p, (double8)(1.0 / 6227020800.0));
    p = fma(z, p, (double8)(-1.0 / 39916800.0));
    p = fma(z, p, (double8)(1.0 / 362880.0));
    p = fma(z, p, (double8)(-1.0 / 5040.0));
    p = fma(z, p, (double8)(1.0 / 120.0));
    p = fma(z, p, (double8)(-1.0 / 6.0));
    return fma(x * z, p, x);
}

// Of floats' products and sums, whose squares doubles hold.
DIFFERENCE_FN double8 norm(double8 a, double8 b) { return sqrt(a * a + b * b); }

DIFFERENCE_FN double8 keep_positive(double8 x) { return x < 0.0 ? (double8)(0.0) : x; }

// sqrt(C^7 / (C^7 + 25^7)) as a ratio, so that no power overflows to a quotient of infinities.
DIFFERENCE_FN double8 share(double8 chroma)
{
    double8 r = 25.0 / chroma, square = r * r;
    return 1.0 / sqrt(1.0 + square * square * square * r);
}

// ------------------------------------------------------------------------------------------------------- the colours

DIFFERENCE_FN double8 lightness(double8 t)
{
    return t > BEND * BEND * BEND ? root3(t) : t * (1.0 / (3.0 * BEND * BEND)) + 4.0 / 29.0;
}

DIFFERENCE_FN labs lab(float8 r, float8 g, float8 b, global const double *m)
{
    labs made;
    double8 red = convert_double8(r), green = convert_double8(g), blue = convert_double8(b);
#if LAB
    made.l = red;
    made.a = green;
    made.b = blue;
#else
    double8 x = lightness(m[0] * red + m[1] * green + m[2] * blue);
    double8 y = lightness(m[3] * red + m[4] * green + m[5] * blue);
    double8 z = lightness(m[6] * red + m[7] * green + m[8] * blue);
    made.l = 116.0 * y - 16.0;
    made.a = 500.0 * (x - y);
    made.b = 200.0 * (y - z);
#endif
    return made;
}

#if FORMULA == 76
DIFFERENCE_FN double8 distance_of(labs first, labs second)
{
    double8 l = first.l - second.l, a = first.a - second.a, b = first.b - second.b;
    return sqrt(l * l + a * a + b * b);
}
#elif FORMULA == 94
DIFFERENCE_FN double8 distance_of(labs first, labs second)
{
    double8 c1 = norm(first.a, first.b), c2 = norm(second.a, second.b), chroma = c1 - c2;
    double8 l = first.l - second.l, a = first.a - second.a, b = first.b - second.b;
    double8 hue = keep_positive(a * a + b * b - chroma * chroma);
    double8 sc = 1.0 + 0.045 * c2, sh = 1.0 + 0.015 * c2;
    return sqrt(l * l + (chroma / sc) * (chroma / sc) + hue / (sh * sh));
}
#else
static inline double turned(double b, double a)
{
    double h = atan2(b, a);
    return h < 0.0 ? h + 2.0 * M_PI : h;
}

// As printed, from the hue on: of stretched a and b, chromas and the distances along L and C over their weights.
static double as_printed(double a1, double b1, double a2, double b2, double c1, double c2, double dl, double dc)
{
    double h1 = turned(b1, a1), h2 = turned(b2, a2), turn = h2 - h1, middle = (h1 + h2) / 2.0, chroma = (c1 + c2) / 2.0;
    turn = turn > HALF_TURN ? turn - 2.0 * M_PI : (turn < -HALF_TURN ? turn + 2.0 * M_PI : turn);
    if (fabs(h1 - h2) > HALF_TURN)
        middle += h1 + h2 < 2.0 * M_PI ? M_PI : -M_PI;
    double t = 1.0 - 0.17 * cos(middle - 30.0 * DEGREE) + 0.24 * cos(2.0 * middle)
             + 0.32 * cos(3.0 * middle + 6.0 * DEGREE) - 0.20 * cos(4.0 * middle - 63.0 * DEGREE);
    double blue = (middle / DEGREE - 275.0) / 25.0, r = 25.0 / chroma;
    double twist = -2.0 / sqrt(1.0 + r * r * r * r * r * r * r) * sin(60.0 * DEGREE * exp(-blue * blue));
    double dh = 2.0 * sqrt(c1 * c2) * sin(turn / 2.0) / (1.0 + 0.015 * chroma * t);
    double square = dl * dl + dc * dc + dh * dh + twist * dc * dh;
    return sqrt(square < 0.0 ? 0.0 : square);
}

DIFFERENCE_FN double8 distance_of(labs first, labs second)
{
    double8 stretch = 1.5 - 0.5 * share((norm(first.a, first.b) + norm(second.a, second.b)) * 0.5);
    double8 a1 = first.a * stretch, a2 = second.a * stretch, b1 = first.b, b2 = second.b;
    double8 c1 = norm(a1, b1), c2 = norm(a2, b2), chroma = (c1 + c2) * 0.5;
    double8 l = (first.l + second.l) * 0.5, off = (l - 50.0) * (l - 50.0);
    double8 dl = (second.l - first.l) / (1.0 + 0.015 * off / sqrt(20.0 + off));
    double8 dc = (c2 - c1) / (1.0 + 0.045 * chroma);

    // Hues as unit vectors. One without chroma counts as none: whatever it is, its share is multiplied by 0.
    double8 by1 = 1.0 / (c1 == 0.0 ? (double8)(1.0) : c1), by2 = 1.0 / (c2 == 0.0 ? (double8)(1.0) : c2);
    double8 x1 = a1 * by1, y1 = b1 * by1, x2 = a2 * by2, y2 = b2 * by2, x = x2 - x1, y = y2 - y1;
    double8 cross = x1 * y2 - y1 * x2, apart = norm(x, y);
    long8 obtuse = x1 * x2 + y1 * y2 < 0.0, back = cross < 0.0;
    double8 u = obtuse ? (back ? -y : y) : x1 + x2, v = obtuse ? (back ? x : -x) : y1 + y2, size = norm(u, v);
    size = 1.0 / (size == 0.0 ? (double8)(1.0) : size);
    u *= size;
    v *= size;

    double8 square = u * u, u2 = 2.0 * square - 1.0, v2 = 2.0 * u * v, u4 = 2.0 * u2 * u2 - 1.0, v4 = 2.0 * u2 * v2;
    double8 u3 = u * (4.0 * square - 3.0), v3 = v * (4.0 * square - 1.0);
    double8 t = 1.0 - 0.17 * (u * 0.8660254037844387 + v * 0.5) + 0.24 * u2
              + 0.32 * (u3 * 0.9945218953682733 - v3 * 0.10452846326765347)
              - 0.20 * (u4 * 0.45399049973954686 + v4 * 0.8910065241883679);

    // The mean hue from 275 degrees on, by the tangent of its quarter. More than 120 degrees away, as hues from 0 to 95
    // degrees are, which lie before and not behind it, nothing is left of the turn: less than 1e-10.
    double8 sine_of = u * 0.9961946980917455 + v * 0.08715574274765836;
    double8 cosine_of = u * 0.08715574274765836 - v * 0.9961946980917455, room = 1.0 + cosine_of;
    double8 half_angle = sine_of / (room < 0.5 ? (double8)(0.5) : room);
    double8 quarter = half_angle / (1.0 + sqrt(1.0 + half_angle * half_angle));
    double8 angle = quarter * arctangent(quarter * quarter) * (4.0 / (25.0 * DEGREE));
    double8 blue = ((v >= 0.0) & (sine_of > 0.0)) | (room < 0.5) ? (double8)(0.0) : decay(angle * angle);
    double8 twist = -2.0 * share(chroma) * sine(60.0 * DEGREE * blue);

    double8 dh = sqrt(c1 * c2) * (back ? -apart : apart) / (1.0 + 0.015 * chroma * t);
    double8 made = sqrt(keep_positive(dl * dl + dc * dc + dh * dh + twist * dc * dh));

    long8 even = (obtuse & (fabs(cross) < NEARLY)) | ((v != 0.0) & (fabs(v) < NEARLY));
    even &= (c1 > 0.0) & (c2 > 0.0);
    if (mask_any(even)) {
        double p1[8], q1[8], p2[8], q2[8], d1[8], d2[8], dls[8], dcs[8], found[8], which[8];
        vstore8(a1, 0, p1), vstore8(b1, 0, q1), vstore8(a2, 0, p2), vstore8(b2, 0, q2);
        vstore8(c1, 0, d1), vstore8(c2, 0, d2), vstore8(dl, 0, dls), vstore8(dc, 0, dcs);
        vstore8(made, 0, found), vstore8(even ? (double8)(1.0) : (double8)(0.0), 0, which);
        for (int i = 0; i < 8; i++)
            if (which[i] != 0.0)
                found[i] = as_printed(p1[i], q1[i], p2[i], q2[i], d1[i], d2[i], dls[i], dcs[i]);
        made = vload8(0, found);
    }
    return made;
}
#endif

DIFFERENCE_FN float8 exact(const float8 *p, const float8 *q, global const double *m)
{
    return convert_float8(distance_of(lab(p[0], p[1], p[2], m), lab(q[0], q[1], q[2], m)));
}

#if SINGLE
// ---------------------------------------------------------------------------------------------------- the same in floats

typedef struct {
    float8 l, a, b;
} singles;

DIFFERENCE_FN float8 lightness_single(float8 t)
{
    return t > (float)(BEND * BEND * BEND) ? num_cbrt(t) : t * (float)(1.0 / (3.0 * BEND * BEND)) + (float)(4.0 / 29.0);
}

DIFFERENCE_FN singles lab_single(const float8 *p, global const double *m)
{
    singles made;
#if LAB
    made.l = p[0];
    made.a = p[1];
    made.b = p[2];
#else
    float8 x = lightness_single((float)m[0] * p[0] + (float)m[1] * p[1] + (float)m[2] * p[2]);
    float8 y = lightness_single((float)m[3] * p[0] + (float)m[4] * p[1] + (float)m[5] * p[2]);
    float8 z = lightness_single((float)m[6] * p[0] + (float)m[7] * p[1] + (float)m[8] * p[2]);
    made.l = 116.0f * y - 16.0f;
    made.a = 500.0f * (x - y);
    made.b = 200.0f * (y - z);
#endif
    return made;
}

DIFFERENCE_FN float8 norm_single(float8 a, float8 b) { return sqrt(a * a + b * b); }

DIFFERENCE_FN float8 share_single(float8 chroma)
{
    float8 r = 25.0f / chroma, square = r * r;
    return 1.0f / sqrt(1.0f + square * square * square * r);
}

// In doubt are hues that may be opposite the other way round, for what a* and b* are wrong by, UNSURE of the lightness and
// the chroma, unless both are as good as grey; a turn of the blue region, which counts by the root of the lesser chroma,
// where that is little beside the other; and what lies so FAR apart that what a weight is wrong by counts.
#define UNSURE 4e-6f
#define GREY 1e-4f
#define UNLIKE 16.0f
#define FAR 200.0f

DIFFERENCE_FN float8 single(const float8 *p, const float8 *q, global const double *m, int8 *doubt)
{
    singles first = lab_single(p, m), second = lab_single(q, m);
    *doubt = (int8)(0);
#if FORMULA == 76
    float8 l = first.l - second.l, a = first.a - second.a, b = first.b - second.b;
    return sqrt(l * l + a * a + b * b);
#elif FORMULA == 94
    float8 c1 = norm_single(first.a, first.b), c2 = norm_single(second.a, second.b);
    float8 l = first.l - second.l, a = first.a - second.a, b = first.b - second.b;
    // The difference of the chromas without what cancels in it.
    float8 sum = c1 + c2, chroma = (a * (first.a + second.a) + b * (first.b + second.b)) / (sum > 0.0f ? sum : 1.0f);
    float8 hue = num_max(a * a + b * b - chroma * chroma, (float8)(0.0f));
    float8 by_chroma = chroma / (1.0f + 0.045f * c2), weight = 1.0f + 0.015f * c2;
    float8 made = sqrt(l * l + by_chroma * by_chroma + hue / (weight * weight));
    *doubt = made > FAR;
    return made;
#else
    float8 stretch = 1.5f - 0.5f * share_single((norm_single(first.a, first.b) + norm_single(second.a, second.b)) * 0.5f);
    float8 a1 = first.a * stretch, a2 = second.a * stretch, b1 = first.b, b2 = second.b;
    float8 c1 = norm_single(a1, b1), c2 = norm_single(a2, b2), sum = c1 + c2, chroma = sum * 0.5f;
    float8 l = (first.l + second.l) * 0.5f, off = (l - 50.0f) * (l - 50.0f);
    float8 dl = (second.l - first.l) / (1.0f + 0.015f * off / sqrt(20.0f + off));
    float8 along = (a2 - a1) * (a1 + a2) + (b2 - b1) * (b1 + b2);
    float8 dc = along / (sum > 0.0f ? sum : 1.0f) / (1.0f + 0.045f * chroma);

    float8 by1 = 1.0f / (c1 == 0.0f ? (float8)(1.0f) : c1), by2 = 1.0f / (c2 == 0.0f ? (float8)(1.0f) : c2);
    float8 x1 = a1 * by1, y1 = b1 * by1, x2 = a2 * by2, y2 = b2 * by2, x = x2 - x1, y = y2 - y1;
    float8 cross = x1 * y2 - y1 * x2, apart = norm_single(x, y);
    int8 obtuse = x1 * x2 + y1 * y2 < 0.0f, back = cross < 0.0f;
    float8 u = obtuse ? (back ? -y : y) : x1 + x2, v = obtuse ? (back ? x : -x) : y1 + y2, size = norm_single(u, v);
    size = 1.0f / (size == 0.0f ? (float8)(1.0f) : size);
    u *= size;
    v *= size;

    float8 square = u * u, u2 = 2.0f * square - 1.0f, v2 = 2.0f * u * v, u4 = 2.0f * u2 * u2 - 1.0f, v4 = 2.0f * u2 * v2;
    float8 u3 = u * (4.0f * square - 3.0f), v3 = v * (4.0f * square - 1.0f);
    float8 t = 1.0f - 0.17f * (u * 0.8660254f + v * 0.5f) + 0.24f * u2 + 0.32f * (u3 * 0.9945219f - v3 * 0.10452846f)
             - 0.20f * (u4 * 0.4539905f + v4 * 0.8910065f);

    float8 sine_of = u * 0.9961947f + v * 0.08715574f, cosine_of = u * 0.08715574f - v * 0.9961947f;
    float8 angle = num_atan2(sine_of, cosine_of) * (float)(1.0 / (25.0 * DEGREE));
    float8 blue = ((v >= 0.0f) & (sine_of > 0.0f)) | (cosine_of < -0.5f) ? (float8)(0.0f) : num_exp(-angle * angle);
    float8 twist = -2.0f * share_single(chroma) * num_sin((float)(60.0 * DEGREE) * blue);

    float8 dh = sqrt(c1) * sqrt(c2) * (back ? -apart : apart) / (1.0f + 0.015f * chroma * t);
    float8 made = sqrt(num_max(dl * dl + dc * dc + dh * dh + twist * dc * dh, (float8)(0.0f)));
    float8 wrong = UNSURE * (1.0f + (fabs(l) + 16.0f + chroma) * (by1 + by2));
    *doubt = obtuse & (fabs(cross) < wrong) & (sqrt(c1) * sqrt(c2) > GREY);
    *doubt |= (twist * twist * (c1 * c1 + c2 * c2) > UNLIKE * c1 * c2) | (made > FAR);
    return made;
#endif
}
#endif

kernel void difference(global const float *restrict image, global const float *restrict reference,
                       global float *restrict out, global const double *restrict m, int pixels)
{
    int first = get_global_id(0) * LANES;
    if (first >= pixels)
        return;
    int count = min(pixels - first, LANES);
    float16 p[4], q[4];
    planes_load(image + (size_t)first * FIRST, FIRST, 3, count, p);
    planes_load(reference + (size_t)first * SECOND, SECOND, 3, count, q);
    float8 p_low[3], p_high[3], q_low[3], q_high[3];
    #pragma unroll
    for (int c = 0; c < 3; c++) {
        p_low[c] = p[c].lo, p_high[c] = p[c].hi;
        q_low[c] = q[c].lo, q_high[c] = q[c].hi;
    }
#if SINGLE
    int8 doubt_low, doubt_high;
    float8 low = single(p_low, q_low, m, &doubt_low), high = single(p_high, q_high, m, &doubt_high);
    // What is not finite may only have left the range of floats.
    if (mask_any(doubt_low | !(low < INFINITY)))
        low = exact(p_low, q_low, m);
    if (mask_any(doubt_high | !(high < INFINITY)))
        high = exact(p_high, q_high, m);
    float16 made = (float16)(low, high);
#else
    float16 made = (float16)(exact(p_low, q_low, m), exact(p_high, q_high, m));
#endif
    planes_stream(&made, out + first, 1, count, pixels);
}
