// Normal maps decoded, blended and encoded, sixteen pixels at a time; normals.py is the definition.
#include "../compositing/planes.clh"
#include "vector.clh"

#define LINEAR 0
#define PARTIAL 1
#define WHITEOUT 2
#define UDN 3

PLANE_FN vector16 decoded(global const float *restrict in, int count, int halved, int turned)
{
    float16 v[3];
    planes_load(in, 3, 3, count, v);
    if (halved)
        for (int c = 0; c < 3; c++)
            v[c] = 2.0f * v[c] - 1.0f;
    return vector(v[0], turned ? -v[1] : v[1], v[2]);
}

PLANE_FN vector16 blended(vector16 n, vector16 m, int blend)
{
    if (blend == LINEAR)
        return vector_add(n, m);
    if (blend == PARTIAL)
        return vector(fma(n.x, m.z, m.x * n.z), fma(n.y, m.z, m.y * n.z), n.z * m.z);
    if (blend == WHITEOUT)
        return vector(n.x + m.x, n.y + m.y, n.z * m.z);
    if (blend == UDN)
        return vector(n.x + m.x, n.y + m.y, n.z);
    vector16 t = vector(n.x, n.y, n.z + 1.0f), u = vector(-m.x, -m.y, m.z);
    return vector_subtract(vector_scale(t, vector_dot(t, u)), vector_scale(u, t.z));
}

kernel void normals(global const float *restrict image, global const float *restrict detail,
                    global float *restrict out, ulong pixels, int halved_before, int halved_after, int turned_before,
                    int turned_after, int renormalise, int blend, float amount)
{
    ulong first = get_global_id(0) * (ulong)LANES;
    if (first >= pixels)
        return;
    int count = (int)min((ulong)LANES, pixels - first);
    vector16 n = decoded(image + first * 3, count, halved_before, turned_before);
    if (renormalise || detail)
        n = vector_unit(n);
    if (detail) {
        vector16 m = vector_unit(decoded(detail + first * 3, count, halved_before, turned_before));
        m = vector_unit(vector(m.x * amount, m.y * amount, m.z));
        n = vector_unit(blended(n, m, blend));
    }
    float16 made[3] = {n.x, turned_after ? -n.y : n.y, n.z};
    if (halved_after)
        for (int c = 0; c < 3; c++)
            made[c] = fma(made[c], (float16)(0.5f), (float16)(0.5f));
    planes_stream(made, out + first * 3, 3, count, pixels);
}
