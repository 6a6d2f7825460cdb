// Directions (a, b, 1) from two slopes; sixteen pixels an item. `halved`: stored as (n + 1) / 2.
#include "../compositing/planes.clh"
#include "vector.clh"

kernel void normals(global const float *restrict a, global const float *restrict b, global float *restrict out,
                    ulong pixels, int halved)
{
    ulong first = get_global_id(0) * (ulong)LANES;
    if (first >= pixels)
        return;
    int count = (int)min((ulong)LANES, pixels - first);
    vector16 n = vector_unit(
        vector(plane_load(a + first, 1, 0, count), plane_load(b + first, 1, 0, count), (float16)(1.0f)));
    float by = halved ? 0.5f : 1.0f, rise = halved ? 0.5f : 0.0f;
    float16 made[3] = {n.x * by + rise, n.y * by + rise, n.z * by + rise};
    planes_stream(made, out + first * 3, 3, count, pixels);
}
