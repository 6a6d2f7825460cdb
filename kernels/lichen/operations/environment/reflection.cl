// Environments seen in surfaces and through them; surfaces.py, framed.py and fresnel.py are the definition, and the
// steps here are theirs, in doubles and in the same order, so that no rounding decides which chart a direction falls in.
//
// Definitions given at build time:
//   NORMALS            2 or 3 channels of the normals; UNIT 1 where they hold (n + 1) / 2; DOWN 1 where y runs down
//   VIEW               0 orthographic, 1 through the pixel's centre, 2 from positions
//   CHART              0 lat-long, 1 cubes, 2 paraboloids, 3 mirror ball
//   MODE               0 mirror, 1 refraction, 2 both
//   FRESNEL            0 a constant, 1 Fresnel's equations, 2 Schlick's approximation
//   COLOURS            1 to 4 channels of pictures
//   WEIGHT             float or double: the precision of reflectances
//   REAL, SHORT        double and 0, or float and 1: the precision of directions and places
//   SINGLE             1 where floats do except in segments that are in doubt, which are marked: there a rounding could
//                      decide about a chart, or about what is inside of a body; 2 to make those anew, in doubles
//   NEAREST            1 for the texel that a direction falls in, 0 for a mean of four
//   BASE, IRRADIANCE   1 where there is such an input; COATED 1 where the base loses what is reflected
//   BEHIND             1 where the environment shows where there is no surface
// `n` holds the turn, row by row, the eye, the scale of the view, the index, its inverse, and the constant reflectance.
// `cells` holds the cells of a cube's faces: left, ahead, right, up, behind, down.
//
// What bounds it, mirrors by the nearest texel of a lat-long image of 1024 x 512, 640 x 480 pixels: instructions, about
// 200 for eight pixels; two angles are 75 of them, texels and what is made of them 45, a copy of the same bytes takes a
// third of the time. Neither a root nor a division for unit vectors, and a product and a mask where nothing lies under
// the mirror, made 0.81 of it; angles in quarter turns without the cases of infinities, 0.92 of that; normals taken
// apart by shuffles within halves of vectors, texels without frames of a place, and four instructions for a pixel where
// all of a segment are seen, 0.68 of that.

#pragma OPENCL EXTENSION cl_khr_fp64 : enable

#include "framed.clh"
#include "fresnel.clh"

#define TILE 32
// Where only the mirror's direction counts, its length does not: 2 (n . v) n - n^2 v, without a root or a division.
#define UNSCALED (SHORT && !SINGLE && MODE == 0 && !FRESNEL && !IRRADIANCE)
#define RUN 64 // segments that an item looks at for those in doubt

// Of the cosine before and the squared one behind. A difference that could lose digits is taken in doubles; of what
// follows, WEIGHT keeps enough.
FN float reflected(double before, double ratio, double k)
{
    WEIGHT c = (WEIGHT)before;
#if FRESNEL == 2
    double f = (ratio - 1) / (ratio + 1);
    WEIGHT least = (WEIGHT)(f * f), far = 1 - (ratio < 1 ? (WEIGHT)sqrt(k < 0 ? 0.0 : k) : c), squared = far * far;
    WEIGHT made = least + (1 - least) * (squared * squared * far);
#else
    double difference = (ratio - 1) * (ratio + 1), g2 = difference + before * before;
    WEIGHT a = (WEIGHT)difference, total = (WEIGHT)(sqrt(g2 < 0 ? 0.0 : g2) + before), u = a / (total * total);
    WEIGHT w = (c * total - 1) / (c * (a / total) + 1), made = u * u * (1 + w * w) / 2;
#endif
    made = k < 0 ? 1 : made;
    made = ratio == 1 ? 0 : made;
    return (float)(c == c ? made : c);
}

FN void put(float4 made, global float *restrict p, int more)
{
#if COLOURS == 3
    if (more)
        vstore4(made, 0, p); // four numbers at once: the next pixel takes its own place back
    else
        vstore3(made.xyz, 0, p);
#else
    p[0] = made.x;
#if COLOURS > 1
    p[1] = made.y;
#endif
#if COLOURS > 2
    p[2] = made.z;
    p[3] = made.w;
#endif
#endif
}

FN void segment(global const float *restrict normals, global const float *restrict positions,
                       global const float *restrict base, global const float *restrict environment,
                       global const float *restrict irradiance, global float *restrict out,
                       global const double *restrict n, global const int *restrict cells, int width, int height,
                       int tall, int wide, int irradiance_tall, int irradiance_wide,
                       global const uchar *restrict skipped, ulong pixels, ulong number,
                       global uchar *restrict doubtful)
{
    ulong first = number * SEGMENT;
    if (first >= pixels)
        return;
    int last = (int)min((ulong)SEGMENT, pixels - first) - 1;
    int skip[SEGMENT], all_skipped = skipped != 0;
    if (skipped)
        EACH {
            uint at = (uint)first + min(i, last), row = at / (uint)width, column = at - row * (uint)width;
            skip[i] = skipped[row / TILE * ((width + TILE - 1) / TILE) + column / TILE];
            all_skipped &= skip[i];
        }
    if (all_skipped) {
        for (int k = 0; k < COLOURS * (last + 1); ++k)
            out[COLOURS * first + k] = BASE ? base[COLOURS * first + k] : 0.0f;
        return;
    }
    REAL m[9], eye_x = n[9], eye_y = n[10], eye_z = n[11], scale = n[12], index = n[13], inverse_index = n[14];
    for (int k = 0; k < 9; ++k)
        m[k] = n[k];
    float fixed = (float)n[15], given[NORMALS * SEGMENT], share[SEGMENT];
    apart(given, normals, NORMALS, first, last);
#if VIEW == 2
    float place[3 * SEGMENT];
    apart(place, positions, 3, first, last);
#endif
#if BASE
    float own[COLOURS * SEGMENT];
    apart(own, base, COLOURS, first, last);
#endif
    Directions outward, mirror, through;
    int empty[SEGMENT], doubt = 0;
#if SINGLE == 1
    float contrast = (float)((n[13] - 1) * (n[13] + 1));
    float rest_x = (float)(n[9] - eye_x), rest_y = (float)(n[10] - eye_y), rest_z = (float)(n[11] - eye_z);
#endif
    EACH {
        REAL x = given[i], y = given[SEGMENT + i];
#if UNIT
        x = x * 2 - 1;
        y = y * 2 - 1;
#endif
        y = DOWN ? -y : y;
#if NORMALS == 3
        REAL z = given[2 * SEGMENT + i];
#if UNIT
        z = z * 2 - 1;
#endif
#else
        REAL rest = 1 - (x * x + y * y), z = sqrt(rest < 0 ? R(0.0) : rest);
#endif
        SCALE(x, y, z)
        REAL square = x * x + y * y + z * z, length = UNSCALED ? R(1.0) : sqrt(square);
        REAL inverse = 1 / (length == 0 ? R(1.0) : length), unit = UNSCALED ? square : R(1.0);
        int nothing = square == 0;
#if SINGLE == 1
        doubt |= beyond(square, x, y, z);
#endif
        REAL nx = x * inverse, ny = y * inverse, nz = z * inverse;
#if VIEW == 2
        REAL a = place[i], b = place[SEGMENT + i], d = place[2 * SEGMENT + i];
#if SINGLE == 1
        int far = max(max(as_int(fabs(a)), as_int(fabs(b))), as_int(fabs(d))) == 0x7f800000;
#else
        int far = ((fabs(a) == INFINITY) | (fabs(b) == INFINITY) | (fabs(d) == INFINITY)) & (a == a) & (b == b) & (d == d);
#endif
        REAL vx = eye_x - (far ? R(0.0) : a), vy = eye_y - (far ? R(0.0) : b), vz = eye_z - (far ? R(0.0) : d);
#if SINGLE == 1
        vx += rest_x; // what the float of the eye lacks
        vy += rest_y;
        vz += rest_z;
#endif
        SCALE(vx, vy, vz)
        square = vx * vx + vy * vy + vz * vz;
        length = sqrt(square), inverse = 1 / (length == 0 ? R(1.0) : length);
#if SINGLE == 1
        doubt |= beyond(square, vx, vy, vz);
#endif
        nothing |= far | (length == 0);
        vx *= inverse;
        vy *= inverse;
        vz *= inverse;
#elif VIEW == 1
        uint at = (uint)first + i, row = at / (uint)width, column = at - row * (uint)width;
        REAL vx = (column + R(0.5) - R(0.5) * width) * -scale, vy = (row + R(0.5) - R(0.5) * height) * scale, vz = R(1.0);
        inverse = 1 / sqrt(vx * vx + vy * vy + vz * vz);
        vx *= inverse;
        vy *= inverse;
        vz *= inverse;
#else
        REAL vx = R(0.0), vy = R(0.0), vz = R(1.0);
#endif
        empty[i] = nothing;
        // Along the third axis neither products nor sums of the others' zeros are made.
        REAL c = VIEW ? nx * vx + ny * vy + nz * vz : nz, ratio = c < 0 ? inverse_index : index;
#if IRRADIANCE
        turn(&outward, i, nx, ny, nz, m);
#endif
#if !UNSCALED
        REAL sign = c < 0 ? -R(1.0) : R(1.0);
        nx *= sign;
        ny *= sign;
        nz *= sign;
        c = fabs(c);
        c = c > 1 ? R(1.0) : c;
#endif
        REAL eta = 1 / ratio, k = 1 - eta * eta * (1 - c * c), twice = 2 * c;
#if SINGLE == 1
        share[i] = FRESNEL ? fresnel_contrast(c, contrast) : fixed;
        doubt |= FRESNEL ? as_int(nothing ? 1.0f : c * sign - DOUBT) : 0;
#else
        share[i] = FRESNEL ? reflected(c, ratio, k) : fixed;
#endif
        int behind = BEHIND & nothing;
#if MODE != 1
        REAL back_x = VIEW ? unit * vx : R(0.0), back_y = VIEW ? unit * vy : R(0.0), back_z = VIEW ? unit * vz : unit;
        turn(&mirror, i, behind ? -vx : twice * nx - back_x, behind ? -vy : twice * ny - back_y,
             behind ? -vz : twice * nz - back_z, m);
#endif
#if MODE != 0
        REAL along = eta * c - sqrt(k < 0 ? R(0.0) : k);
        along = k < 0 ? twice : along;
        eta = k < 0 ? R(1.0) : eta;
        turn(&through, i, behind ? -vx : along * nx - eta * vx, behind ? -vy : along * ny - eta * vy,
             behind ? -vz : along * nz - eta * vz, m);
#endif
    }
#if SINGLE == 1
    if (doubt < 0) {
        doubtful[number] = 1;
        return;
    }
#endif
#if IRRADIANCE
    Places at_outward;
    located(&at_outward, &outward, irradiance_tall, irradiance_wide, cells, empty, m[6] == 0 && m[7] == 0, &doubt);
#endif
#if MODE != 1
    Places at_mirror;
    located(&at_mirror, &mirror, tall, wide, cells, empty, 0, &doubt);
#if SINGLE == 1
    if (doubt < 0)
        doubtful[number] = 1;
#endif
#endif
#if MODE != 0
    Places at_through;
    located(&at_through, &through, tall, wide, cells, empty, 0, &doubt);
#endif
    global float *p = out + first * COLOURS;
#if MODE == 0 && !BASE && !IRRADIANCE
    // Nothing lies under the mirror: a product, and a mask.
    int shown[SEGMENT];
    EACH {
        shown[i] = BEHIND || !empty[i] ? -1 : 0;
        share[i] = BEHIND && empty[i] ? 1.0f : share[i];
    }
    if (skipped)
        EACH shown[i] = skip[i] ? 0 : shown[i];
#if NEAREST && !FRESNEL
    // Where all directions are some, and seen, neither is asked of each.
    int odd = 0;
    EACH odd |= ~shown[i] | as_int(at_mirror.x[i]);
    if (!odd) {
        if (last == SEGMENT - 1)
#pragma unroll 9
            for (int i = 0; i < SEGMENT - 1; ++i, p += COLOURS)
                put(fixed * texel(environment, &at_mirror, i), p, 1);
        else
            for (int i = 0; i < last; ++i, p += COLOURS)
                put(fixed * texel(environment, &at_mirror, i), p, 1);
        put(fixed * texel(environment, &at_mirror, last), p, 0);
        return;
    }
#endif
    for (int i = 0; i <= last; ++i, p += COLOURS) {
        float4 seen = share[i] * value(environment, &at_mirror, i, wide);
        put(as_float4(as_int4(seen) & shown[i]), p, i < last);
    }
#else
    for (int i = 0; i <= last; ++i, p += COLOURS) {
        float4 own_light = (float4)(0.0f), made = own_light, plain;
#if BASE
        own_light = coloured(own, i);
#endif
        plain = own_light;
        // What is hidden wholly stays so, however large the product of base and irradiance.
        float kept = COATED ? 1.0f - share[i] : 1.0f;
#if IRRADIANCE
        made = value(irradiance, &at_outward, i, irradiance_wide);
#endif
#if BASE && IRRADIANCE
        made *= own_light * kept;
#elif BASE
        made = own_light * kept;
#elif IRRADIANCE
        made *= kept;
#endif
#if MODE != 1
        float4 seen = value(environment, &at_mirror, i, wide), shown = share[i] * seen;
#if BASE || IRRADIANCE
        shown += made;
#endif
        made = (int4)(-empty[i]) ? (BEHIND ? seen : plain) : shown;
#endif
#if MODE != 0
        float4 behind_it = value(environment, &at_through, i, wide), nothing_there = made;
        float passes = MODE == 1 && !FRESNEL ? share[i] : 1.0f - share[i];
#if MODE == 1
        nothing_there = BEHIND ? behind_it : plain;
#endif
        made = empty[i] ? nothing_there : made + passes * behind_it;
#endif
        if (skipped)
            made = skip[i] ? own_light : made;
        put(made, p, i < last);
    }
#endif
}

#if SINGLE == 2
#define STEPS RUN
#else
#define STEPS 1
#endif
kernel void reflection(global const float *restrict normals, global const float *restrict positions,
                       global const float *restrict base, global const float *restrict environment,
                       global const float *restrict irradiance, global float *restrict out,
                       global const double *restrict n, global const int *restrict cells, int width, int height,
                       int tall, int wide, int irradiance_tall, int irradiance_wide,
                       global const uchar *restrict skipped, ulong pixels, global uchar *restrict doubtful)
{
    ulong number = get_global_id(0) * (ulong)STEPS;
    for (int k = 0; k < STEPS && (number + k) * SEGMENT < pixels; k++) {
#if SINGLE == 1
        doubtful[number + k] = 0;
#elif SINGLE == 2
        if (!doubtful[number + k])
            continue;
#endif
        segment(normals, positions, base, environment, irradiance, out, n, cells, width, height, tall, wide,
                irradiance_tall, irradiance_wide, skipped, pixels, number + k, doubtful);
    }
}
