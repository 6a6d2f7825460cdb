// Every function of numeric.clh over an array, for one vector width: WIDTH is 1, 4, 8 or 16.
#include "numeric.clh"

#define GLUE_(a, b) a##b
#define GLUE(a, b) GLUE_(a, b)
#if WIDTH == 1
typedef float number;
#define LOAD(i, from) (from)[i]
#define STORE(value, i, to) (to)[i] = value
#else
typedef GLUE(float, WIDTH) number;
#define LOAD GLUE(vload, WIDTH)
#define STORE GLUE(vstore, WIDTH)
#endif

#define OF_ONE(function)                                                                                               \
    __kernel void function##_trial(__global const float* a, __global float* out, int count)                            \
    {                                                                                                                  \
        int i = get_global_id(0);                                                                                      \
        if (i < count)                                                                                                 \
            STORE(function(LOAD(i, a)), i, out);                                                                       \
    }
#define OF_TWO(function)                                                                                               \
    __kernel void function##_trial(__global const float* a, __global const float* b, __global float* out, int count)   \
    {                                                                                                                  \
        int i = get_global_id(0);                                                                                      \
        if (i < count)                                                                                                 \
            STORE(function(LOAD(i, a), LOAD(i, b)), i, out);                                                           \
    }

number clamp_to_unit(number x) { return num_clamp(x, (number)(0.0f), (number)(1.0f)); }

OF_ONE(num_exp2)
OF_ONE(num_exp)
OF_ONE(num_log2)
OF_ONE(num_log)
OF_ONE(num_cbrt)
OF_ONE(num_pow_12_5)
OF_ONE(num_pow_11_5)
OF_ONE(num_pow_5_12)
OF_ONE(num_sin)
OF_ONE(num_cos)
OF_ONE(num_sinpi)
OF_ONE(num_cospi)
OF_ONE(clamp_to_unit)
OF_TWO(num_pow)
OF_TWO(num_pow_fast)
OF_TWO(num_atan2)
OF_TWO(num_min)
OF_TWO(num_max)
