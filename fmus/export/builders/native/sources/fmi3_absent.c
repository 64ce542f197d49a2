/* The functions of FMI 3.0 for what this FMU has not: variables of other types than Float64, clocks,
   structural parameters, scheduled execution. None of it asked for is fine, anything else an error. */

static fmi3Status none_of_type(const Instance *m, const char *call, size_t n) {
    if (!allowed(m, call, ANY_MODE)) return fmi3Error;
    return n ? not_offered(m, call, "there are Float64 variables only") : fmi3OK;
}

#define NONE_OF_TYPE(type)                                                                                         \
    fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3##type values[],         \
                             size_t nv) {                                                                          \
        (void)vr;                                                                                                  \
        (void)values;                                                                                              \
        (void)nv;                                                                                                  \
        return none_of_type(ME(c), __func__, n);                                                                   \
    }                                                                                                              \
    fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3##type values[],   \
                             size_t nv) {                                                                          \
        (void)vr;                                                                                                  \
        (void)values;                                                                                              \
        (void)nv;                                                                                                  \
        return none_of_type(ME(c), __func__, n);                                                                   \
    }

NONE_OF_TYPE(Float32)
NONE_OF_TYPE(Int8)
NONE_OF_TYPE(UInt8)
NONE_OF_TYPE(Int16)
NONE_OF_TYPE(UInt16)
NONE_OF_TYPE(Int32)
NONE_OF_TYPE(UInt32)
NONE_OF_TYPE(Int64)
NONE_OF_TYPE(UInt64)
NONE_OF_TYPE(Boolean)
NONE_OF_TYPE(String)

fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[],
                         fmi3Binary values[], size_t nv) {
    (void)vr;
    (void)sizes;
    (void)values;
    (void)nv;
    return none_of_type(ME(c), __func__, n);
}

fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[],
                         const fmi3Binary values[], size_t nv) {
    (void)vr;
    (void)sizes;
    (void)values;
    (void)nv;
    return none_of_type(ME(c), __func__, n);
}

fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Clock values[]) {
    (void)vr;
    (void)values;
    return none_of_type(ME(c), __func__, n);
}

fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Clock values[]) {
    (void)vr;
    (void)values;
    return none_of_type(ME(c), __func__, n);
}

static const char *const NO_DEPENDENCIES = "dependencies are in modelDescription.xml only "
                                           "(providesPerElementDependencies = false)";

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference vr, size_t *n) {
    (void)vr;
    (void)n;
    return not_offered(ME(c), __func__, NO_DEPENDENCIES);
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent, size_t elements[],
                                       fmi3ValueReference independents[], size_t independent_elements[],
                                       fmi3DependencyKind kinds[], size_t n) {
    (void)dependent;
    (void)elements;
    (void)independents;
    (void)independent_elements;
    (void)kinds;
    (void)n;
    return not_offered(ME(c), __func__, NO_DEPENDENCIES);
}

/* ---- configuration, clocks ---- */

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
    return not_offered(ME(c), __func__, "there are no structural parameters");
}

fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
    return not_offered(ME(c), __func__, "there are no structural parameters");
}

static const char *const NO_CLOCKS = "there are no clocks";

fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[]) {
    (void)vr;
    (void)n;
    (void)intervals;
    (void)qualifiers;
    return not_offered(ME(c), __func__, NO_CLOCKS);
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]) {
    (void)vr;
    (void)n;
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    return not_offered(ME(c), __func__, NO_CLOCKS);
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 shifts[]) {
    (void)vr;
    (void)n;
    (void)shifts;
    return not_offered(ME(c), __func__, NO_CLOCKS);
}

fmi3Status fmi3GetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 counters[],
                                fmi3UInt64 resolutions[]) {
    (void)vr;
    (void)n;
    (void)counters;
    (void)resolutions;
    return not_offered(ME(c), __func__, NO_CLOCKS);
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                  const fmi3Float64 intervals[]) {
    (void)vr;
    (void)n;
    (void)intervals;
    return not_offered(ME(c), __func__, NO_CLOCKS);
}

fmi3Status fmi3SetIntervalFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                   const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]) {
    (void)vr;
    (void)n;
    (void)counters;
    (void)resolutions;
    return not_offered(ME(c), __func__, NO_CLOCKS);
}

fmi3Status fmi3SetShiftDecimal(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 shifts[]) {
    (void)vr;
    (void)n;
    (void)shifts;
    return not_offered(ME(c), __func__, NO_CLOCKS);
}

fmi3Status fmi3SetShiftFraction(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3UInt64 counters[],
                                const fmi3UInt64 resolutions[]) {
    (void)vr;
    (void)n;
    (void)counters;
    (void)resolutions;
    return not_offered(ME(c), __func__, NO_CLOCKS);
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time) {
    (void)clock;
    (void)time;
    return not_offered(ME(c), __func__, NO_CLOCKS);
}
