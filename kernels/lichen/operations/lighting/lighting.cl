// Pixels lit by lamps, sixteen at a time; lighting.py is the definition, lamps.py and reflection.py say how.
//
// Definitions given at build time: MODEL, 0 without highlights, and of facets DISTRIBUTION, MASKING and FRESNEL, by their
// numbers: one light of a Torrance-Sparrow surface takes two thirds of the time for it. RUN, sixteens of pixels that an
// item takes one after the other: as many items of a group would keep what each of them holds in memory.
//
// Which inputs there are is said by their channels, 0 for none, and what is looked up by the size of the tables: a program
// for every combination would take longer to build than it saves.
#include "../compositing/planes.clh"
#include "mask.clh"
#include "reflection.clh"

#define ROW 40
#define TILE 32
#define NEAR 1e-18f // squares of distances between which products of them are neither 0 nor infinite
#define FAR 1e18f

PLANE_FN vector16 load3(global const float *restrict in, int count)
{
    float16 v[3];
    planes_load(in, 3, 3, count, v);
    return vector(v[0], v[1], v[2]);
}

PLANE_FN vector16 same3(global const float *restrict n)
{
    return vector((float16)(n[0]), (float16)(n[1]), (float16)(n[2]));
}

// A colour, times that of the input if there is one.
PLANE_FN vector16 colour3(global const float *restrict n, global const float *restrict in, int channels, int count)
{
    vector16 made = same3(n);
    if (channels == 1) {
        float16 grey = plane_load(in, 1, 0, count);
        return vector_scale(made, grey);
    }
    if (channels == 3) {
        vector16 v = load3(in, count);
        return vector(made.x * v.x, made.y * v.y, made.z * v.z);
    }
    return made;
}

// place - position, the place given in two parts.
PLANE_FN vector16 towards(global const float *restrict near, global const float *restrict rest, vector16 position)
{
    return vector((near[0] - position.x) + rest[0], (near[1] - position.y) + rest[1], (near[2] - position.z) + rest[2]);
}

// The slide, or the picture of a slab's cell, where a point lies in it, between texels linearly, black around it and
// behind the lamp.
PLANE_FN vector16 projected(global const float *restrict row, vector16 way, global const float *restrict slide, int channels,
                            int wide, int high)
{
    int pitch = wide;
    if (row[31] != 0.0f) {
        wide /= (int)row[31];
        high /= (int)row[32];
        slide += ((size_t)high * (int)row[30] * pitch + (size_t)wide * (int)row[29]) * channels;
    }
    vector16 axis = same3(row + 10);
    float16 ahead = -vector_dot(axis, way);
    float16 x = fma((float16)(wide), (0.5f + row[33]) - vector_dot(same3(row + 21), way) / ahead, (float16)(0.5f));
    float16 y = fma((float16)(high), (0.5f + row[34]) - vector_dot(same3(row + 24), way) / ahead, (float16)(0.5f));
    int16 inside = (ahead > 0.0f) & (x > 0.0f) & (y > 0.0f) & (x < wide + 1.0f) & (y < high + 1.0f);
    float at_x[16], at_y[16], made[3][16];
    int in[16];
    vstore16(inside ? x : (float16)(0.0f), 0, at_x);
    vstore16(inside ? y : (float16)(0.0f), 0, at_y);
    vstore16(inside, 0, in);
    for (int i = 0; i < 16; i++) {
        int column = min((int)at_x[i], wide), row_of = min((int)at_y[i], high); // in the slide with a frame of one texel
        float right = at_x[i] - column, below = at_y[i] - row_of;
        for (int c = 0; c < 3; c++) {
            float corner[4];
            for (int k = 0; k < 4; k++) {
                int u = column + (k & 1) - 1, v = row_of + (k >> 1) - 1;
                int there = in[i] & -(u >= 0 & v >= 0 & u < wide & v < high);
                corner[k] = there ? slide[((size_t)v * pitch + u) * channels + c % channels] : 0.0f;
            }
            float upper = fma(right, corner[1] - corner[0], corner[0]);
            float lower = fma(right, corner[3] - corner[2], corner[2]);
            made[c][i] = fma(below, lower - upper, upper);
        }
    }
    return vector(vload16(0, made[0]), vload16(0, made[1]), vload16(0, made[2]));
}

// The light that arrives, before the cosine at the surface, as a share of the lamp's colour; l becomes its direction.
PLANE_FN float16 arriving(global const float *restrict row, vector16 way, vector16 *l)
{
    float16 own = vector_dot(way, way), square = row[28] == 0.0f ? own : num_max(own, (float16)(row[28]));
    float16 apart = square + row[13], root = sqrt(apart), by = 1.0f / sqrt(own);
    float16 falls = (float16)(row[14]);
    if (row[16] != 0.0f) // so far away that a square is infinite, nothing times it is nothing
        falls = fma((float16)(row[16]), apart, falls);
    if (row[15] != 0.0f)
        falls = fma((float16)(row[15]), root, falls);
    // Where nothing leaves the range of floats there is one division less, and no scaling; whatever lies beside it.
    int16 usual = (own > NEAR) & (own < FAR);
    *l = vector_scale(way, by);
    float16 strength = (row[28] == 0.0f ? own * by : sqrt(square)) / (root * falls);
    if (!mask_all(usual)) {
        vector16 unit = vector_unit(way);
        *l = vector(usual ? l->x : unit.x, usual ? l->y : unit.y, usual ? l->z : unit.z);
        strength = usual ? strength : 1.0f / (sqrt(1.0f + row[13] / square) * falls); // 0 on the lamp itself
    }
    vector16 axis = same3(row + 10);
    if (row[17] != 0.0f) {
        float16 cosine = -vector_dot(axis, *l);
        strength *= num_max(cosine, (float16)(0.0f));
    }
    if (row[19] != 0.0f) {
        vector16 off = vector_add(axis, *l);
        float16 share = (row[18] - 0.5f * vector_dot(off, off)) * row[19];
        share = num_clamp(share, (float16)(0.0f), (float16)(1.0f));
        strength *= share * share * (3.0f - 2.0f * share);
    }
    return strength;
}

// Whether numbers are finite: what is not makes a NaN even of no light.
PLANE_FN int16 tame(vector16 v) { return (fabs(v.x) < INFINITY) & (fabs(v.y) < INFINITY) & (fabs(v.z) < INFINITY); }

// Whether places are so near that the way to them is finite.
PLANE_FN int16 close_by(vector16 v) { return (fabs(v.x) < 0x1p+126f) & (fabs(v.y) < 0x1p+126f) & (fabs(v.z) < 0x1p+126f); }

// No light on so many pixels.
PLANE_FN void dark(global float *restrict out, int count)
{
    float16 nothing[3] = {(float16)(0.0f), (float16)(0.0f), (float16)(0.0f)};
    planes_store(nothing, out, 3, count);
}

PLANE_FN void lit(global const float *restrict normal, global const float *restrict position,
                     global const float *restrict albedo, global const float *restrict specular,
                     global const float *restrict roughness, global const float *restrict tangent,
                     global const float *restrict visibility, global const float *restrict slide,
                     global const float *restrict slab, global const int *restrict channels, int wide, int high,
                     int slab_wide, int slab_high, global const float *restrict rows,
                     int lamps, global const int *restrict active, global const float *restrict n,                      global const float *restrict tables, int size, global float *restrict out, uint width,
                     uint height, uint stride, uint item)
{
    uint per_row = (width + LANES - 1) / LANES, line = item / per_row;
    if (line >= height)
        return;
    uint column = (item - line * per_row) * LANES;
    line = (uint)((ulong)line * stride % height); // near rows have the same lamps: threads get some of everywhere
    ulong first = (ulong)line * width + column;
    int count = (int)min((uint)LANES, width - column);
    if (active) // of this tile: how many rows, and which
        active += (line / TILE * ((width + TILE - 1) / TILE) + column / TILE) * (lamps + 1);
    int looked_at = active ? active[0] : lamps;
    bool placed = channels[0] != 0;
    vector16 across = load3(normal + first * 3, count), place = across, v = same3(n + 6);
    int16 nowhere = 0;
    if (placed) {
        place = load3(position + first * 3, count);
        nowhere = (fabs(place.x) == INFINITY) | (fabs(place.y) == INFINITY) | (fabs(place.z) == INFINITY);
        if (mask_all(nowhere)) {
            dark(out + first * 3, count);
            return;
        }
    }
    vector16 matt = colour3(n + 10, albedo + first * channels[1], channels[1], count);
    int16 sound = tame(across) & tame(matt);
#if MODEL
    vector16 shiny = colour3(n + 13, specular + first * channels[2], channels[2], count);
    float16 rough = channels[3] ? plane_load(roughness + first, 1, 0, count) : (float16)(n[16]);
    rough = num_clamp(rough, (float16)(n[17]), (float16)(1.0f));
    sound &= tame(shiny) & (fabs(rough) < INFINITY);
#endif
    const bool grained = MODEL == LAFORTUNE || MODEL == WARD || MODEL == BANKS;
    // Where no lamp reaches nothing is to be found, if nothing there spoils what is made of no light either.
    if (looked_at == 0 && !grained && mask_all(nowhere | (sound & close_by(place)))) {
        dark(out + first * 3, count);
        return;
    }
    vector16 facing = vector_unit(across);
    if (placed && n[9] != 0.0f)
        v = vector_unit(towards(n, n + 3, place));
#if MODEL
    Material s;
    s.m = rough * rough;
    s.exponent = n[18] > 0.0f ? (float16)(n[18]) : 2.0f / (s.m * s.m);
    s.contrast = n[19];
    s.straight = n[20];
    s.stretch = n[21];
    for (int i = 0; i < 3; i++)
        s.lobe[i] = n[22 + i];
    s.model = MODEL;
    s.distribution = DISTRIBUTION;
    s.masking = MASKING;
    s.fresnel = FRESNEL;
    s.tables = tables;
    s.size = size;
    s.width = n[29];
    vector16 t = grained && channels[4] ? vector_unit(load3(tangent + first * 3, count)) : same3(n + 25);
    if (grained && MODEL != BANKS) {
        vector16 across_n = vector_along(facing, -vector_dot(facing, t), t);
        float16 square_across = vector_dot(across_n, across_n);
        t = vector_scale(vector_unit(across_n), square_across < n[28] ? (float16)(0.0f) : (float16)(1.0f));
    }
    float16 w = vector_dot(facing, v);
#endif
    vector16 total = vector((float16)(0.0f), (float16)(0.0f), (float16)(0.0f));
    bool spoilt = false;
    if (looked_at < lamps) {
        sound &= tame(place) & tame(v);
#if MODEL
        sound &= tame(t);
#endif
        spoilt = !mask_all(sound | nowhere);
    }
    for (int k = 0; k < (spoilt ? lamps : looked_at); k++) { // what is left out follows what is not
        int lamp = active ? active[1 + k] : k;
        global const float *restrict row = rows + lamp * ROW;
        vector16 l = same3(row + 4), light = same3(row + 1);
        if (row[0] != 0.0f) {
            vector16 way = towards(row + 4, row + 7, place);
            light = vector_scale(light, arriving(row, way, &l));
            bool cell = row[20] == 2.0f;
            if (row[20] != 0.0f && channels[cell ? 7 : 6]) {
                vector16 seen = projected(row, way, cell ? slab : slide, channels[cell ? 7 : 6], cell ? slab_wide : wide,
                                          cell ? slab_high : high);
                light = vector(light.x * seen.x, light.y * seen.y, light.z * seen.z);
            }
        }
        if (channels[5]) {
            int which = channels[5] == 1 ? 0 : (int)row[27];
            light = vector_scale(light, plane_load(visibility + first * channels[5], channels[5], which, count));
        }
        if (k >= looked_at)
            light = vector((float16)(0.0f), (float16)(0.0f), (float16)(0.0f));
        float16 u = vector_dot(facing, l), diffuse = u > 0.0f ? u : u - u;
        // Where lamps are left out of a tile, others hardly reach these pixels: the most that is asked of all is little.
        if (looked_at < lamps && !spoilt && mask_all((light.x == 0.0f) | (u <= 0.0f))) {
            int16 unlit = (light.x == 0.0f) & (light.y == 0.0f) & (light.z == 0.0f);
            if (mask_all(unlit | ((u <= 0.0f) & tame(light))))
                continue;
        }
#if MODEL
        if (MODEL == BANKS) {
            vector16 across = vector_cross(l, t);
            diffuse = vector_dot(t, t) > 0.0f ? diffuse * sqrt(vector_dot(across, across)) : diffuse;
        }
#endif
        vector16 sent = vector_scale(matt, diffuse);
#if MODEL
        sent = vector_along(shiny, highlight(s, facing, l, v, t, u, w), sent);
#endif
        total = vector(fma(light.x, sent.x, total.x), fma(light.y, sent.y, total.y), fma(light.z, sent.z, total.z));
    }
    float16 off = v.x - v.x;
    float16 made[3] = {total.x + off, total.y + off, total.z + off};
    for (int c = 0; c < 3 && placed; c++)
        made[c] = nowhere ? (float16)(0.0f) : made[c];
    planes_store(made, out + first * 3, 3, count);
}

kernel void lighting(global const float *restrict normal, global const float *restrict position,
                     global const float *restrict albedo, global const float *restrict specular,
                     global const float *restrict roughness, global const float *restrict tangent,
                     global const float *restrict visibility, global const float *restrict slide,
                     global const float *restrict slab, global const int *restrict channels, int wide, int high,
                     int slab_wide, int slab_high, global const float *restrict rows,
                     int lamps, global const int *restrict active, global const float *restrict n,
                     global const float *restrict tables, int size, global float *restrict out, uint width,
                     uint height, uint stride)
{
    uint first = (uint)get_global_id(0) * RUN;
    for (int k = 0; k < RUN; k++)
        lit(normal, position, albedo, specular, roughness, tangent, visibility, slide, slab, channels, wide, high, slab_wide,
            slab_high, rows, lamps, active, n, tables, size, out, width, height, stride, first + k);
}
