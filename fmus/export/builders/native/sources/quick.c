/* Two functions of C's library as the equations use them: the same values in less time, but for the sign of a zero. */

#if defined(__GNUC__)
#define USUALLY(condition) __builtin_expect(condition, 1)
#else
#define USUALLY(condition) (condition)
#endif

static double quick_pow(double x, double y) { return USUALLY(y == 1) ? x : pow(x, y); }

static double quick_floor(double x) {
    if (!USUALLY(fabs(x) < 1e15)) return floor(x);
    double cut = (double)(long long)x;
    return cut > x ? cut - 1 : cut;
}

#define pow quick_pow
#define floor quick_floor
