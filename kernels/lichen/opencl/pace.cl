// A task that takes long enough to time and is always the same: eight independent chains of multiply-adds.
__kernel void pace(__global float* restrict out, int items, int steps)
{
    int i = get_global_id(0);
    if (i >= items)
        return;
    const float8 half_ = (float8)(0.5f), one = (float8)(1.0f);
    float8 a = (float8)(i), b = a + 1, c = a + 2, d = a + 3, e = a + 4, f = a + 5, g = a + 6, h = a + 7;
    for (int n = 0; n < steps; ++n) {
        a = fma(a, half_, one);
        b = fma(b, half_, one);
        c = fma(c, half_, one);
        d = fma(d, half_, one);
        e = fma(e, half_, one);
        f = fma(f, half_, one);
        g = fma(g, half_, one);
        h = fma(h, half_, one);
    }
    vstore8(a + b + c + d + e + f + g + h, i, out);
}
