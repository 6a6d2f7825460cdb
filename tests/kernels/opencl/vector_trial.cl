// The functions of vector.clh and fresnel.clh over arrays of vectors, for one width: WIDTH is 1, 4, 8 or 16.
#include "fresnel.clh"
#include "vector.clh"

#define GLUE_(a, b) a##b
#define GLUE(a, b) GLUE_(a, b)
#define VECTOR GLUE(vector, WIDTH)
#if WIDTH == 1
typedef float number;
#define LOAD(i, from) (from)[i]
#define STORE(value, i, to) (to)[i] = value
#else
typedef GLUE(float, WIDTH) number;
#define LOAD GLUE(vload, WIDTH)
#define STORE GLUE(vstore, WIDTH)
#endif

// Arrays hold all x, then all y, then all z; `items` groups of WIDTH lanes each.
inline VECTOR load(__global const float *from, int i, int items)
{
    return vector(LOAD(i, from), LOAD(i + items, from), LOAD(i + 2 * items, from));
}

inline void store(VECTOR v, int i, int items, __global float *to)
{
    STORE(v.x, i, to);
    STORE(v.y, i + items, to);
    STORE(v.z, i + 2 * items, to);
}

#define TRIAL(name, statement)                                                                                         \
    __kernel void name##_trial(__global const float *p, __global const float *q, __global const float *numbers,        \
                               __global float *out, int items)                                                         \
    {                                                                                                                  \
        int i = get_global_id(0);                                                                                      \
        if (i >= items)                                                                                                \
            return;                                                                                                    \
        VECTOR a = load(p, i, items), b = load(q, i, items);                                                           \
        number s = LOAD(i, numbers);                                                                                   \
        statement;                                                                                                     \
    }

TRIAL(sum, store(vector_along(vector_subtract(vector_add(a, b), b), s, b), i, items, out))
TRIAL(dot, STORE(vector_dot(a, b) + 0.0f * s, i, out))
TRIAL(cross, store(vector_cross(a, b), i, items, out))
TRIAL(length, STORE(vector_length(a), i, out))
TRIAL(unit, store(vector_unit(a), i, items, out))
TRIAL(reflect, store(vector_reflect(a, b), i, items, out))
TRIAL(refract, store(vector_refract(a, b, s), i, items, out))
TRIAL(fresnel, STORE(fresnel(fabs(a.x), s), i, out))
TRIAL(schlick, STORE(fresnel_schlick(fabs(a.x), s), i, out))
