/* Four or eight doubles at once: operations of the equations that C has no sign for.

   WIDTH: how many. Eight are for processors whose registers hold eight (AVX-512), see lanes.c. */

#ifndef WIDTH
#define WIDTH 4
#endif
typedef double Lanes __attribute__((vector_size(8 * WIDTH)));
typedef long long Bits __attribute__((vector_size(8 * WIDTH)));
typedef double Four __attribute__((vector_size(32)));

static inline double sign_of(double x) { return x < 0 ? -1.0 : x > 0 ? 1.0 : x; }

#if WIDTH == 8
#define REPEATED(number) {number, number, number, number, number, number, number, number}
#else
#define REPEATED(number) {number, number, number, number}
#endif
#define ALL(number) ((Lanes)REPEATED(number))
#define ALL_BITS(number) ((Bits)REPEATED(number))
#define WHERE(condition, a) ((Lanes)((Bits)(condition) & (Bits)(a)))
#define TRUTH(condition) WHERE(condition, ALL(1.0))
#define CHOICE(condition, a, b) ((Lanes)(((Bits)(condition) & (Bits)(a)) | (~(Bits)(condition) & (Bits)(b))))
#define MAGNITUDE(a) ((Lanes)((Bits)(a) & ALL_BITS(0x7fffffffffffffffLL)))
#define SIGN_BITS ALL(-0.0)
#define EACH(i) for (int i = 0; i < WIDTH; i++)
#define ROUNDING 6755399441055744.0 /* 1.5 times 2 to the 52nd: what is added to it loses its fraction */
#if defined(__x86_64__) && WIDTH == 8
#define VECTORS __attribute__((target("avx512f,avx512dq,avx512vl")))
#elif defined(__x86_64__)
#define VECTORS __attribute__((target("avx2")))
#else
#define VECTORS
#endif
#define ONLY VECTORS static inline __attribute__((always_inline, unused)) void

/* Lanes that a series does not cover are left to C's library; the others keep the values of the series, so that a row
   does not depend on its neighbours. */
#define LIBRARY_UNLESS(condition, function)                                                                       \
    {                                                                                                             \
        Bits covered = (Bits)(condition);                                                                         \
        if (!USUALLY(lanes_everywhere(&covered))) {                                                              \
            Lanes given = *a, r = *y;                                                                             \
            EACH(i) if (!covered[i]) r[i] = function(given[i]);                                                   \
            *y = r;                                                                                               \
        }                                                                                                         \
    }

ONLY lanes_sqrt(const Lanes *a, Lanes *y) {
#if defined(__clang__)
    *y = __builtin_elementwise_sqrt(*a);
#else
    Lanes x = *a, r;
    EACH(i) r[i] = sqrt(x[i]);
    *y = r;
#endif
}

ONLY lanes_floor(const Lanes *a, Lanes *y) {
    Lanes x = *a, cut = (x + ROUNDING) - ROUNDING;
    cut = cut - TRUTH(cut > x);
    *y = CHOICE(MAGNITUDE(x) < 1e15, cut, x); /* larger numbers are whole, or not finite */
}

/* Whether all lanes of a condition hold. */
VECTORS static inline __attribute__((always_inline)) bool lanes_everywhere(const Bits *condition) {
    const Bits c = *condition;
    long long all = -1;
    EACH(i) all &= c[i];
    return all != 0;
}

/* Whether a condition holds in any lane. */
VECTORS static inline __attribute__((always_inline, unused)) bool any_lane(const Bits *condition) {
    const Bits c = *condition;
    long long any = 0;
    EACH(i) any |= c[i];
    return any != 0;
}

/* e to the x within 700: 2 to a whole number times the Taylor series of what is left, up to 0.35. The series is summed
   in pairs, which takes less time than one term after the other. */
ONLY lanes_exp_within(const Lanes *a, Lanes *y) {
    Lanes x = *a, shifted = x * 1.4426950408889634 + ROUNDING, n = shifted - ROUNDING;
    Lanes r = (x - n * 6.93147180369123816490e-01) - n * 1.90821492927058770002e-10; /* ln 2 in two parts */
    Lanes r2 = r * r, r4 = r2 * r2;
    Lanes p0 = r * 1.6666666666666666e-01 + 0.5, p1 = r * 8.333333333333333e-03 + 4.1666666666666664e-02;
    Lanes p2 = r * 1.984126984126984e-04 + 1.388888888888889e-03;
    Lanes p3 = r * 2.7557319223985893e-06 + 2.48015873015873e-05;
    Lanes p4 = r * 2.505210838544172e-08 + 2.755731922398589e-07;
    Lanes p5 = r * 1.6059043836821613e-10 + 2.08767569878681e-09; /* the last term is 1 / 13! */
    Lanes s = ((p5 * r2 + p4) * r4 + (p3 * r2 + p2)) * r4 + (p1 * r2 + p0);
    s = s * r2 + r + 1.0;
    Bits power = ((Bits)shifted << 52) + (Bits)ALL(1.0); /* n stands in the last bits of the shifted number */
    *y = s * (Lanes)power;
}

ONLY lanes_exp(const Lanes *a, Lanes *y) {
    lanes_exp_within(a, y);
    LIBRARY_UNLESS(MAGNITUDE(*a) < 700.0, exp)
}

/* Natural logarithm of positive numbers by the polynomials of fdlibm (e_log.c). */
ONLY lanes_ln(const Lanes *a, Lanes *y) {
    Bits bits = (Bits)*a, e = (bits >> 52) - 1023;
    Lanes m = (Lanes)((bits & ALL_BITS(0x000fffffffffffffLL)) | (Bits)ALL(1.0));
    Bits high = (Bits)(m > 1.41421356237309504880);
    m = CHOICE(high, m * 0.5, m);
    e = e - high; /* where high holds, it is -1 */
    Lanes n = (Lanes)(e + (Bits)ALL(ROUNDING)) - ROUNDING;
    Lanes f = m - 1.0, s = f / (f + 2.0), z = s * s, w = z * z;
    Lanes even = ((w * 1.531383769920937332e-01 + 2.222219843214978396e-01) * w + 3.999999999940941908e-01) * w;
    Lanes odd = (w * 1.479819860511658591e-01 + 1.818357216161805012e-01) * w + 2.857142874366239149e-01;
    odd = (odd * w + 6.666666666666735130e-01) * z;
    Lanes half = f * f * 0.5;
    *y = n * 6.93147180369123816490e-01 - ((half - (s * (half + even + odd) + n * 1.90821492927058770002e-10)) - f);
}

/* Sine and cosine by the polynomials of fdlibm (k_sin.c, k_cos.c) after removal of quarter turns. */
ONLY lanes_wave(const Lanes *a, int ahead, Lanes *y) {
    Lanes x = *a, shifted = x * 6.36619772367581382433e-01 + ROUNDING, n = shifted - ROUNDING;
    Lanes r = ((x - n * 1.57079632673412561417e+00) - n * 6.07710050630396597660e-11) - n * 2.02226624879595063154e-21;
    Lanes z = r * r;
    Lanes sine = z * 1.58969099521155010221e-10 - 2.50507602534068634195e-08;
    sine = sine * z + 2.75573137070700676789e-06;
    sine = sine * z - 1.98412698298579493134e-04;
    sine = sine * z + 8.33333333332248946124e-03;
    sine = sine * z - 1.66666666666666324348e-01;
    sine = sine * z * r + r;
    Lanes cosine = z * -1.13596475577881948265e-11 + 2.08757232129817482790e-09;
    cosine = cosine * z - 2.75573143513906633035e-07;
    cosine = cosine * z + 2.48015872894767294178e-05;
    cosine = cosine * z - 1.38888888888741095749e-03;
    cosine = cosine * z + 4.16666666666666019037e-02;
    cosine = cosine * z * z - 0.5 * z + 1.0;
    Bits turns = (Bits)shifted + ahead;
    Lanes found = CHOICE((turns & 1) != 0, cosine, sine);
    *y = CHOICE((turns & 2) != 0, -found, found);
}

ONLY lanes_sin(const Lanes *a, Lanes *y) {
    lanes_wave(a, 0, y);
    LIBRARY_UNLESS(MAGNITUDE(*a) < 1e5, sin)
}

ONLY lanes_cos(const Lanes *a, Lanes *y) {
    lanes_wave(a, 1, y);
    LIBRARY_UNLESS(MAGNITUDE(*a) < 1e5, cos)
}

/* Arc tangent by the rational function of Cephes (atan.c), up to 0.66; beyond it by a quarter or half of pi. */
ONLY lanes_atan(const Lanes *a, Lanes *y) {
    Lanes x = *a, size = MAGNITUDE(x);
    Bits large = (Bits)(size > 2.41421356237309504880), middle = (Bits)(size > 0.66) & ~large;
    Lanes over = CHOICE(large, ALL(-1.0), CHOICE(middle, size - 1.0, size));
    Lanes under = CHOICE(large, size, CHOICE(middle, size + 1.0, ALL(1.0)));
    Lanes t = over / under, z = t * t;
    Lanes p = z * -8.750608600031904122785e-1 - 1.615753718733365076637e1;
    p = p * z - 7.500855792314704667340e1;
    p = p * z - 1.228866684490136173410e2;
    p = p * z - 6.485021904942025371773e1;
    Lanes q = z + 2.485846490142306297962e1;
    q = q * z + 1.650270098316988542046e2;
    q = q * z + 4.328810604912902668951e2;
    q = q * z + 4.853903996359136964868e2;
    q = q * z + 1.945506571482613964425e2;
    Lanes found = z * p / q * t + t; /* with what a quarter or half of pi lacks as a double */
    found = found + WHERE(large, ALL(6.123233995736765886130e-17)) + WHERE(middle, ALL(3.061616997868382943065e-17));
    found = found + WHERE(large, ALL(1.57079632679489661923)) + WHERE(middle, ALL(7.85398163397448309616e-1));
    *y = CHOICE(SIGN_BITS, x, found);
}

/* Hyperbolic tangent by the rational function of Cephes (tanh.c), and by exp beyond 0.625. */
ONLY lanes_tanh(const Lanes *a, Lanes *y) {
    Lanes x = *a, size = MAGNITUDE(x), z = x * x, twice = size + size, power;
    twice = CHOICE(twice < 80.0, twice, ALL(80.0)); /* the tangent is 1 there; so it is where x is not a number */
    lanes_exp(&twice, &power);
    Lanes p = z * -9.64399179425052238628e-1 - 9.92877231001918586564e1;
    p = p * z - 1.61468768441708447952e3;
    Lanes q = z + 1.12811678491632931402e2;
    q = q * z + 2.23548839060100448583e3;
    q = q * z + 4.84406305325125486048e3;
    Lanes near = x + x * z * (p / q), far = CHOICE(SIGN_BITS, x, 1.0 - 2.0 / (power + 1.0));
    *y = CHOICE((size < 0.625) | (x != x), near, far);
}

/* A power of a positive base, by its logarithm times the exponent, whose size is the error in units of the last place.
   What is far from 1 is therefore left to C's library. */
ONLY lanes_pow(const Lanes *a, const Lanes *b, Lanes *y) {
    Lanes base = *a, exponent = *b, r = base;
    Bits plain = (Bits)(exponent == 1.0);
    if (!USUALLY(lanes_everywhere(&plain))) {
        Lanes product;
        lanes_ln(&base, &product);
        product = product * exponent;
        Bits covered = plain | ((Bits)(base > 1e-300) & (Bits)(base < 1e300) & (Bits)(MAGNITUDE(product) < 50.0));
        lanes_exp_within(&product, &r);
        r = CHOICE(plain, base, r);
        if (!USUALLY(lanes_everywhere(&covered)))
            EACH(i) if (!covered[i]) r[i] = quick_pow(base[i], exponent[i]);
    }
    *y = r;
}

/* n elements of a table one after the other, from a place on that differs from lane to lane; none beside the table. */
ONLY lanes_rows(const double *table, long long size, const Lanes *number, int n, Lanes *y) {
    const double *row[WIDTH];
    Lanes at = *number;
    bool inside[WIDTH], all = true;
    EACH(i) {
        inside[i] = at[i] >= 0 && at[i] + n <= (double)size;
        all = all && inside[i];
    }
    if (n > size) {
        for (int k = 0; k < n; k++) y[k] = ALL(NAN);
        return;
    }
    EACH(i) row[i] = table + (inside[i] ? (long long)at[i] : 0);
    int k = 0;
#if defined(__clang__) || __GNUC__ >= 12
    for (; k + 4 <= n; k += 4) /* four by four, turned from rows to lanes */
        for (int i = 0; i < WIDTH; i += 4) {
            Four a, b, c, d, turned[4];
            memcpy(&a, row[i] + k, sizeof a);
            memcpy(&b, row[i + 1] + k, sizeof b);
            memcpy(&c, row[i + 2] + k, sizeof c);
            memcpy(&d, row[i + 3] + k, sizeof d);
            Four ab = __builtin_shufflevector(a, b, 0, 4, 2, 6), cd = __builtin_shufflevector(c, d, 0, 4, 2, 6);
            Four ab1 = __builtin_shufflevector(a, b, 1, 5, 3, 7), cd1 = __builtin_shufflevector(c, d, 1, 5, 3, 7);
            turned[0] = __builtin_shufflevector(ab, cd, 0, 1, 4, 5);
            turned[1] = __builtin_shufflevector(ab1, cd1, 0, 1, 4, 5);
            turned[2] = __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
            turned[3] = __builtin_shufflevector(ab1, cd1, 2, 3, 6, 7);
            for (int j = 0; j < 4; j++) memcpy((double *)&y[k + j] + i, &turned[j], sizeof turned[j]);
        }
#endif
    for (; k < n; k++) EACH(i) y[k][i] = row[i][k];
    if (!USUALLY(all))
        EACH(i) for (int j = 0; !inside[i] && j < n; j++) y[j][i] = NAN;
}

/* The case of each lane, as C's switch takes it, and the one of all lanes, or -1 where they differ. */
VECTORS static inline __attribute__((unused)) int lanes_same_case(const Lanes *number, int last, int *chosen) {
    bool same = true;
    EACH(i) {
        double one = (*number)[i];
        chosen[i] = one > -1.0 && one < last ? (int)one : last;
        same = same && chosen[i] == chosen[0];
    }
    return same ? chosen[0] : -1;
}

/* Whether a lane has chosen a case. */
static inline __attribute__((unused)) bool lanes_chose(const int *chosen, int k) {
    bool found = false;
    EACH(i) found = found || chosen[i] == k;
    return found;
}

/* Results of one case for the lanes that chose it. */
VECTORS static inline __attribute__((unused)) void lanes_taken(const Lanes *part, Lanes *y, int n, const int *chosen, int k) {
    for (int j = 0; j < n; j++) EACH(i) if (chosen[i] == k) y[j][i] = part[j][i];
}
