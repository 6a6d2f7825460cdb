// One picture composited with another, sixteen pixels to a work-item; blending.py says what is computed, and why so.
//
// Definitions given at build time:
//   COLOURS            of both pictures
//   IMAGE, BASE, OUT   channels: COLOURS, or one more where the last is coverage
//   MASK               channels of the mask, of which the last is read, or 0
//   BLEND              NORMAL, SEPARABLE or THREE; which mode of them is `mode`, its place in the enumeration
//   SATURATE           1 for the operator of that name
// Every other operator is four numbers: the image is multiplied by image_1 + image_b b, the base by base_1 + base_s s.

#include "numeric.clh"
#include "planes.clh"
#include "part.clh"
#include "blend.clh"

kernel void composite(global const float *restrict image, global const float *restrict base,
                      global const float *restrict mask, global float *restrict out, float opacity, float red,
                      float green, float blue, float image_1, float image_b, float base_1, float base_s, float most, int mode,
                      ulong pixels)
{
    ulong first = get_global_id(0) * (ulong)LANES;
    if (first >= pixels)
        return;
    int count = (int)min(pixels - first, (ulong)LANES);
    image += first * IMAGE, base += first * BASE, out += first * OUT;
    float16 m = (float16)(opacity);
#if MASK
    m *= num_clamp(plane_load(mask + first * MASK, MASK, MASK - 1, count), ZERO, ONE);
#endif
#if COLOURS <= 3
    float16 cs[4], cb[4], co[4];
    planes_load(image, IMAGE, IMAGE, count, cs);
    planes_load(base, BASE, BASE, count, cb);
    float16 a = IMAGE > COLOURS ? cs[IMAGE - 1] : ONE, b = BASE > COLOURS ? cb[BASE - 1] : ONE;
#else
    float16 a = IMAGE > COLOURS ? plane_load(image, IMAGE, IMAGE - 1, count) : ONE;
    float16 b = BASE > COLOURS ? plane_load(base, BASE, BASE - 1, count) : ONE;
#endif
    float16 s = part(a, m), from_image = image_1 + image_b * b, from_base = base_1 + base_s * s;
#if SATURATE
    float16 room = num_max(ONE - b, ZERO);
    from_image = s > room ? room / s : (b == b ? ONE : b);
#endif
#if COLOURS <= 3
#if BLEND == THREE
    float16 t[3];
    blended3(mode, cs, a, cb, b, (float4)(red, green, blue, 0.0f), t);
#endif
    for (int c = 0; c < COLOURS; c++) {
        float16 colour = part(cs[c], m);
#if BLEND == THREE
        colour = part(colour, ONE - b) + part(t[c], m);
#elif BLEND == SEPARABLE
        colour = part(colour, ONE - b) + part(blended(mode, cs[c], a, cb[c], b), m);
#endif
        co[c] = part(colour, from_image) + part(cb[c], from_base);
    }
#if OUT > COLOURS
    co[COLOURS] = num_min(part(s, from_image) + part(b, from_base), (float16)(most));
#endif
    planes_stream(co, out, OUT, count, pixels);
#else
    for (int c = 0; c < COLOURS; c++) {
        float16 cs = plane_load(image, IMAGE, c, count), cb = plane_load(base, BASE, c, count), colour = part(cs, m);
#if BLEND != NORMAL
        colour = part(colour, ONE - b) + part(blended(mode, cs, a, cb, b), m);
#endif
        plane_store(part(colour, from_image) + part(cb, from_base), out, OUT, c, count);
    }
#if OUT > COLOURS
    float16 covered = num_min(part(s, from_image) + part(b, from_base), (float16)(most));
    plane_store(covered, out, OUT, COLOURS, count);
#endif
#endif
}

// The same for two pictures of three colours and coverage, without mask and blend mode: four pixels to a vector, in
// which coverage is a lane like the others. The last pixels, fewer than four, come through an array.
#if COLOURS == 3 && IMAGE == 4 && BASE == 4 && OUT == 4 && MASK == 0 && BLEND == NORMAL
kernel void composite_flat(global const float *restrict image, global const float *restrict base,
                           global float *restrict out, float opacity, float image_1, float image_b, float base_1,
                           float base_s, float most, ulong pixels)
{
    const float far = INFINITY;
    float16 limit = (float16)(far, far, far, most, far, far, far, most, far, far, far, most, far, far, far, most);
    ulong first = get_global_id(0) * (ulong)LANES * 4, end = min(first + LANES * 4, pixels * 4);
    for (ulong at = first; at < end; at += LANES) {
        bool whole = at + LANES <= end;
        float own[LANES], other[LANES];
        if (!whole)
            for (int i = 0; i < LANES; i++) {
                own[i] = at + i < end ? image[at + i] : 0.0f;
                other[i] = at + i < end ? base[at + i] : 0.0f;
            }
        float16 cs = part(whole ? vload16(0, image + at) : vload16(0, own), (float16)(opacity));
        float16 cb = whole ? vload16(0, base + at) : vload16(0, other);
        float16 s = cs.s33337777bbbbffff, b = cb.s33337777bbbbffff;
        float16 f = image_1 + image_b * b, g = base_1 + base_s * s;
#if SATURATE
        float16 room = num_max(ONE - b, ZERO);
        f = s > room ? room / s : (b == b ? ONE : b);
#endif
        float16 y = num_min(part(cs, f) + part(cb, g), limit);
        if (whole)
            stream_store16(y, out + at, pixels * 4);
        else {
            vstore16(y, 0, own);
            for (int i = 0; i < LANES && at + i < end; i++)
                out[at + i] = own[i];
        }
    }
}
#endif
