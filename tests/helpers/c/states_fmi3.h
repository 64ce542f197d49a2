/* Saved states of an FMI 3.0 FMU whose instance is of the type Instance and has all that changes in `now`, a State. */

fmi3GetFMUStateTYPE fmi3GetFMUState;
fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state) {
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &((Instance *)instance)->now, sizeof(State));
    return fmi3OK;
}

fmi3SetFMUStateTYPE fmi3SetFMUState;
fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state) {
    memcpy(&((Instance *)instance)->now, state, sizeof(State));
    return fmi3OK;
}

fmi3FreeFMUStateTYPE fmi3FreeFMUState;
fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state) {
    (void)instance;
    free(*state);
    *state = NULL;
    return fmi3OK;
}
